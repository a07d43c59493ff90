// pixel_fifo: brings a sensor's pixels from its own clock to clk_i.
//
// An asynchronous FIFO: pointers cross in Gray code through two flip-flops.  It is read in every
// clock that finds something in it, as nothing behind it waits.
//
//   line_valid_i   as the sensor gives it: a line is from its rise to its fall
//   pixel_valid_i  a pixel, while line_valid_i is high; constant 1 for a sensor without it
//   line_start_o   with the line's first pixel, line_end_o with its last one; a line without a
//                  pixel is not sent
//   overflow_count_o  lines that found the FIFO full.  Such a line loses all that follows, its end
//                  too, so that line_receiver counts it as unfinished; its start is sent as soon as
//                  there is room.  Stops at its largest value
//   rst_i, pixel_rst_i  each synchronous to its own clock and of any length; either empties the
//                  whole FIFO, and a line that is on its way loses all that follows.  rst_i alone
//                  sets the counter to zero.  While pixel_clk_i stands nothing comes out
//   Latency  a pixel waits for the next one, or the line's fall, to know whether it is the last;
//            from then on 1 pixel clock and 4 to 5 clocks of clk_i where the FIFO is empty
//   Model    the order of the words only, vrscan.fixed.pixel_fifo: between two clocks no model has
//            the clock of a word

`default_nettype none

module pixel_fifo #(
  parameter int unsigned Lanes      = 1,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned Depth      = 64,  // 2**n, at least 8
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                        clk_i,
  input  wire logic                        rst_i,

  // The sensor, in its own clock.
  input  wire logic                        pixel_clk_i,
  input  wire logic                        pixel_rst_i,
  input  wire logic                        line_valid_i,
  input  wire logic                        pixel_valid_i,
  input  wire logic [Lanes*PixelWidth-1:0] pixel_i,

  output      logic                        line_start_o,
  output      logic                        line_end_o,
  output      logic                        pixel_valid_o,
  output      logic [Lanes*PixelWidth-1:0] pixel_o,

  // Status.
  output      logic [      CountWidth-1:0] overflow_count_o
);

  if (Lanes != 1) begin : gen_bad_lanes
    $error("pixel_fifo: only Lanes = 1 is built");
  end
  if (Depth < 8 || (Depth & (Depth - 1)) != 0) begin : gen_bad_depth
    $error("pixel_fifo: Depth must be a power of two, at least 8");
  end

endmodule

`default_nettype wire
