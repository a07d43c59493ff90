// line_extent: where a line begins and ends, and whether it has as many pixels as it should.
//
// A line begins at line_start_i and ends at line_end_i; a pixel in the same clock belongs to it.
// Between them pixels may come with gaps, outside of them pixels are blanking and are ignored.
// What is said is of this clock.  line_receiver and line_capture go by it, so both mean the same by
// a good line.
//
//   take_o, index_o  this pixel is one of the line's first LineLength, and which
//   ends_o           the line ends; short_o, over_o, with it: too few pixels, too many
//   unfinished_o     a line begins though the one before has not ended
//   Latency  none: combinational, from what has been of the line
//   Model    vrscan.fixed.line_extent, bit-exact

`default_nettype none

module line_extent #(
  parameter int unsigned LineLength = 2048,
  localparam int unsigned IndexWidth = $clog2(LineLength)
) (
  input  wire logic                  clk_i,
  input  wire logic                  rst_i,

  input  wire logic                  line_start_i,
  input  wire logic                  line_end_i,
  input  wire logic                  pixel_valid_i,

  output      logic                  take_o,
  output      logic [IndexWidth-1:0] index_o,
  output      logic                  ends_o,
  output      logic                  short_o,
  output      logic                  over_o,
  output      logic                  unfinished_o
);

  localparam int unsigned FillWidth = $clog2(LineLength + 1);
  logic                 in_line_q, over_q, active, full;
  logic                 full_q, one_left_q;  // known before the pixel comes
  logic [FillWidth-1:0] fill_q, fill, next_fill;  // pixels of this line so far
  assign active       = in_line_q || line_start_i;
  assign fill         = line_start_i ? '0 : fill_q;
  assign full         = full_q && !line_start_i;
  assign next_fill    = fill + FillWidth'(take_o);
  assign take_o       = active && pixel_valid_i && !full;
  assign index_o      = fill[IndexWidth-1:0];
  assign over_o       = (over_q && !line_start_i) || (active && pixel_valid_i && full);
  assign ends_o       = active && line_end_i;
  assign short_o      = !(full || (one_left_q && !line_start_i && pixel_valid_i));
  assign unfinished_o = in_line_q && line_start_i;

  always_ff @(posedge clk_i) begin
    fill_q     <= next_fill;
    full_q     <= next_fill == FillWidth'(LineLength);
    one_left_q <= next_fill == FillWidth'(LineLength - 1);
    over_q     <= over_o;
    in_line_q  <= active && !line_end_i;
    if (rst_i) in_line_q <= 1'b0;
  end

endmodule

`default_nettype wire
