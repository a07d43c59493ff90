// line_capture: the pixels of one raw line with the record of its point, in packets.
//
//   Model    vrscan.fixed.line_capture, bit-exact

`default_nettype none

module line_capture #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12
) (
  input  wire logic                                  clk_i,
  input  wire logic                                  rst_i,

  // As vrscan_chain takes them.
  input  wire logic                                  line_start_i,
  input  wire logic                                  line_end_i,
  input  wire logic                                  pixel_valid_i,
  input  wire logic [                PixelWidth-1:0] pixel_i,

  // Of point_record.
  input  wire logic                                  record_valid_i,
  input  wire logic [                           5:0] record_index_i,
  input  wire logic [                           7:0] record_i,

  output      logic                                  valid_o,
  input  wire logic                                  ready_i,
  output      logic [                           7:0] data_o,
  output      logic                                  last_o,

  input  wire logic                                  capture_start_i,
  input  wire logic [link_pkg::CaptureModeWidth-1:0] capture_mode_i,
  input  wire logic [                          31:0] capture_argument_i,

  // Status.
  output      logic                                  capture_busy_o
);

endmodule

`default_nettype wire
