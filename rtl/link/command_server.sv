// command_server: takes commands as frame_decoder gives them, and answers each with one packet.
//
// Wiring only.  command_queue keeps the frames, command_executor executes them one after another on
// the register bus and replies.
//
//   valid_i        a byte of the payload; done_i, status_i: its frame has ended, so
//   halt_i         streams and capture stop, and what waits to be executed is dropped
//   valid_o        a byte of the reply, last_o with its last; it rises when all of it is there
//   bus_*, stream_*, capture_*, alive_o, busy_o, commands_bad_o  of command_executor
//   frames_*_o, commands_lost_o  of command_queue
//   Latency        see vrscan.clocked.command_server
//   Model          vrscan.clocked.command_server, bit-exact

`default_nettype none

module command_server #(
  localparam int unsigned CountWidth = vrscan_pkg::CounterWidth
) (
  input  wire logic                                  clk_i,
  input  wire logic                                  rst_i,

  input  wire logic                                  valid_i,
  input  wire logic [                           7:0] data_i,
  input  wire logic                                  done_i,
  input  wire logic [    frame_pkg::StatusWidth-1:0] status_i,
  input  wire logic                                  halt_i,

  output      logic                                  valid_o,
  input  wire logic                                  ready_i,
  output      logic [                           7:0] data_o,
  output      logic                                  last_o,

  output      logic                                  bus_valid_o,
  output      logic [     link_pkg::AccessWidth-1:0] bus_access_o,
  output      logic [    link_pkg::AddressWidth-1:0] bus_address_o,
  output      logic [                          31:0] bus_data_o,
  input  wire logic                                  bus_done_i,
  input  wire logic [     link_pkg::StatusWidth-1:0] bus_status_i,
  input  wire logic [                          31:0] bus_data_i,

  output      logic                                  stream_start_o,
  output      logic                                  stream_stop_o,
  output      logic [link_pkg::StreamFormatWidth-1:0] stream_format_o,
  output      logic [                           7:0] stream_step_o,

  output      logic                                  capture_start_o,
  output      logic [link_pkg::CaptureModeWidth-1:0] capture_mode_o,
  output      logic [                          31:0] capture_argument_o,
  input  wire logic                                  capture_busy_i,

  output      logic                                  alive_o,
  output      logic                                  busy_o,
  output      logic [                CountWidth-1:0] frames_good_o,
  output      logic [                CountWidth-1:0] frames_crc_o,
  output      logic [                CountWidth-1:0] frames_malformed_o,
  output      logic [                CountWidth-1:0] frames_too_long_o,
  output      logic [                CountWidth-1:0] frames_too_short_o,
  output      logic [                CountWidth-1:0] frames_framing_o,
  output      logic [                CountWidth-1:0] commands_bad_o,
  output      logic [                CountWidth-1:0] commands_lost_o
);

  localparam int unsigned IndexWidth = $clog2(link_pkg::MaxPayload);

  logic                              waits, take, release_frame;
  logic [frame_pkg::StatusWidth-1:0] status;
  logic [              IndexWidth:0] length;
  logic [            IndexWidth-1:0] index;
  logic [                       7:0] payload_byte;
  command_queue u_command_queue (
    .clk_i, .rst_i, .valid_i, .data_i, .done_i, .status_i, .halt_i,
    .waits_o(waits), .take_i(take), .release_i(release_frame),
    .status_o(status), .length_o(length), .index_i(index), .byte_o(payload_byte),
    .frames_good_o, .frames_crc_o, .frames_malformed_o, .frames_too_long_o, .frames_too_short_o,
    .frames_framing_o, .commands_lost_o
  );

  command_executor u_command_executor (
    .clk_i, .rst_i, .halt_i,
    .waits_i(waits), .take_o(take), .release_o(release_frame),
    .status_i(status), .length_i(length), .index_o(index), .byte_i(payload_byte),
    .valid_o, .ready_i, .data_o, .last_o,
    .bus_valid_o, .bus_access_o, .bus_address_o, .bus_data_o,
    .bus_done_i, .bus_status_i, .bus_data_i,
    .stream_start_o, .stream_stop_o, .stream_format_o, .stream_step_o,
    .capture_start_o, .capture_mode_o, .capture_argument_o, .capture_busy_i,
    .alive_o, .busy_o, .commands_bad_o
  );

endmodule

`default_nettype wire
