// command_server: takes commands as frame_decoder gives them, and answers each with one packet.
//
// A payload is kept until its frame has ended, and is a command where the status is StatusOk.
// While one is executed and its reply waits, up to Commands - 1 more wait behind it; one more is
// lost and counted.  A bad frame is counted, and told by a reply of its own unless half of the
// places are taken: noise never takes the place of a command.  Replies come in the order of the
// frames.
//
// A WRITE checks all of its words before it writes the first.  A lock that closes in between, by
// another word of the same command or by itself, ends it there, and the reply tells the address.
//
//   valid_i        a byte of the payload; done_i, status_i: its frame has ended, so
//   halt_i         streams and capture stop, and what waits to be executed is dropped
//   valid_o        a byte of the reply, last_o with its last; it rises when all of it is there
//   bus_valid_o    an access; bus_done_i answers it, in a later clock
//   stream_start_o, stream_stop_o, capture_start_o  for one clock; the values beside them stay.  To
//                  stop a capture is to start mode CaptureStop
//   capture_busy_i within 8 clocks of capture_start_o
//   alive_o        a command of a known kind and the right length is executed
//   busy_o         a command waits, is executed or has its reply not yet taken
//   frames_*_o, commands_*_o  how many there were, by their status; stop at 2**16 - 1
//   Latency        see vrscan.fixed.command_server
//   Model          vrscan.fixed.command_server, bit-exact

`default_nettype none

module command_server #(
  localparam int unsigned CountWidth = 16
) (
  input  wire logic                               clk_i,
  input  wire logic                               rst_i,

  input  wire logic                               valid_i,
  input  wire logic [                        7:0] data_i,
  input  wire logic                               done_i,
  input  wire logic [ frame_pkg::StatusWidth-1:0] status_i,
  input  wire logic                               halt_i,

  output      logic                               valid_o,
  input  wire logic                               ready_i,
  output      logic [                        7:0] data_o,
  output      logic                               last_o,

  output      logic                               bus_valid_o,
  output      logic [  link_pkg::AccessWidth-1:0] bus_access_o,
  output      logic [ link_pkg::AddressWidth-1:0] bus_address_o,
  output      logic [                       31:0] bus_data_o,
  input  wire logic                               bus_done_i,
  input  wire logic [  link_pkg::StatusWidth-1:0] bus_status_i,
  input  wire logic [                       31:0] bus_data_i,

  output      logic                               stream_start_o,
  output      logic                               stream_stop_o,
  output      logic                               stream_format_o,
  output      logic [                        7:0] stream_step_o,

  output      logic                               capture_start_o,
  output      logic [link_pkg::CaptureModeWidth-1:0] capture_mode_o,
  output      logic [                       31:0] capture_argument_o,
  input  wire logic                               capture_busy_i,

  output      logic                               alive_o,
  output      logic                               busy_o,
  output      logic [             CountWidth-1:0] frames_good_o,
  output      logic [             CountWidth-1:0] frames_crc_o,
  output      logic [             CountWidth-1:0] frames_malformed_o,
  output      logic [             CountWidth-1:0] frames_too_long_o,
  output      logic [             CountWidth-1:0] frames_too_short_o,
  output      logic [             CountWidth-1:0] frames_framing_o,
  output      logic [             CountWidth-1:0] commands_bad_o,
  output      logic [             CountWidth-1:0] commands_lost_o
);

endmodule

`default_nettype wire
