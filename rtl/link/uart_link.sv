// uart_link: the host's end of the serial line: frames in, commands executed, replies and the
// packets of streams out.
//
// The rate is the default's, Baud, until uart_step is written.  The new one holds when the reply to
// that write, and all else that was to go out, is on the line; until then no packet of a stream
// begins.  It holds for good with the first good frame; where none comes within TrialClks, and
// after a break, the default is back.  A break stops streams and capture, too.
//
// A 0x00 goes out before the next frame after a reset, a change of the rate, and a byte without its
// stop bit: the other end may have heard what was none.
//
//   rx_i                 asynchronous
//   packet_*_i           source k of Streams in bit k, byte k; whole packets of at most
//                        link_pkg::MaxPayload bytes
//   uart_step_i          bits a clock, 24 fraction bits; uart_step_written_i with a write of it
//   uart_step_now_o      the rate that holds
//   bus_*, stream_*, capture_*, alive_o, frames_*_o, commands_*_o  of command_server
//   uart_*_o             bytes without a stop bit, breaks, glitches, rates that got no frame; stop at
//                        2**16 - 1
//   Model                vrscan.fixed.uart_link, bit-exact

`default_nettype none

module uart_link #(
  parameter int unsigned ClockHz   = 100_000_000,
  parameter int unsigned Baud      = 3_000_000,
  parameter int unsigned TrialClks = ClockHz,
  parameter int unsigned Streams   = 2,
  localparam int unsigned StepWidth  = 24,
  localparam int unsigned CountWidth = 16
) (
  input  wire logic                               clk_i,
  input  wire logic                               rst_i,

  input  wire logic                               rx_i,
  output      logic                               tx_o,

  input  wire logic [                Streams-1:0] packet_valid_i,
  output      logic [                Streams-1:0] packet_ready_o,
  input  wire logic [              8*Streams-1:0] packet_data_i,
  input  wire logic [                Streams-1:0] packet_last_i,

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

  input  wire logic [              StepWidth-1:0] uart_step_i,
  input  wire logic                               uart_step_written_i,

  output      logic [              StepWidth-1:0] uart_step_now_o,
  output      logic [             CountWidth-1:0] uart_framing_o,
  output      logic [             CountWidth-1:0] uart_breaks_o,
  output      logic [             CountWidth-1:0] uart_glitches_o,
  output      logic [             CountWidth-1:0] uart_fallbacks_o,
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
