// test_line: synthetic lines in place of the sensor's, so that a board without optics can be tried.
//
// Pixel i of a line whose pulse stands at c is, in counts left-aligned to 16 bits,
//
//   test_pedestal + test_height (1 + cos 2 pi (i - c) / W) / 2 + test_noise n / 2**9,
//
// the cosine only where |i - c| < W / 2 (a Hann pulse, W wide at its foot), n the noise.  It is
// exact to 17 fraction bits, rounded once to PixelWidth, to nearest, half up, and kept within
// 0 .. full scale.  A line depends on its place in the run and on the registers only, which are
// sampled with test_start_i.
//
//   test_position_i  c of the first line: px, 12 fraction bits
//   test_move_i      added to c from line to line; where c leaves 0 .. LineLength, LineLength is
//                    added or taken off, once, modulo 4096 px
//   test_step_i      2**28 / W; 0 is a line of the same height everywhere.  c times this step is
//                    rounded to nearest, half up, to a phase of 2**-28 turns
//   test_height_i    its 1.0 is quarter_wave's amplitude, 65534 / 65536
//   test_noise_i     peak of the noise.  n is the sum of the four bytes of x less 510; x, of 32
//                    bits, steps once a pixel, x ^= x << 13, x ^= x >> 17, x ^= x << 5 (Marsaglia
//                    2003), and is test_seed_i ^ 0x9E3779B9 before a run's first pixel, or
//                    0x9E3779B9 where that is 0.  The deviation is test_noise / sqrt(12)
//   test_lines_i     lines of a run, 0 is without end
//   test_period_clks_i  from line start to line start; at least LineLength + 16 clocks
//   test_start_i     begins a run; one that is on its way is cut off, in mid-line too
//   test_stop_i      ends it with the line that has begun; test_start_i in the same clock wins
//   test_running_o   from the clock after test_start_i until the clock after the last line_end_o
//   Latency  vrscan.fixed.test_line.START_LATENCY clocks from test_start_i to the first
//            line_start_o; the pixels of a line have no gaps
//   Model    vrscan.fixed.test_line, bit-exact

`default_nettype none

module test_line #(
  parameter int unsigned Lanes      = 1,
  parameter int unsigned LineLength = 2048,  // 64 to 4096
  parameter int unsigned PixelWidth = 12
) (
  input  wire logic                                           clk_i,
  input  wire logic                                           rst_i,

  output      logic                                           line_start_o,
  output      logic                                           line_end_o,
  output      logic                                           pixel_valid_o,
  output      logic        [            Lanes*PixelWidth-1:0] pixel_o,

  // Configuration.
  input  wire logic        [                            23:0] test_position_i,
  input  wire logic signed [                            23:0] test_move_i,
  input  wire logic        [        vrscan_pkg::PhaseWidth:0] test_step_i,
  input  wire logic        [    vrscan_pkg::AlignedWidth-1:0] test_height_i,
  input  wire logic        [    vrscan_pkg::AlignedWidth-1:0] test_pedestal_i,
  input  wire logic        [    vrscan_pkg::AlignedWidth-1:0] test_noise_i,
  input  wire logic        [                            31:0] test_seed_i,
  input  wire logic        [                            31:0] test_lines_i,
  input  wire logic        [                            23:0] test_period_clks_i,

  input  wire logic                                           test_start_i,
  input  wire logic                                           test_stop_i,
  output      logic                                           test_running_o
);

  if (Lanes != 1) begin : gen_bad_lanes
    $error("test_line: only Lanes = 1 is built");
  end
  if (LineLength < vrscan_pkg::BlockLength || LineLength > 4096) begin : gen_bad_length
    $error("test_line: LineLength must be 64 to 4096");
  end
  if (PixelWidth < 8 || PixelWidth > 16) begin : gen_bad_width
    $error("test_line: PixelWidth must be 8..16");
  end

endmodule

`default_nettype wire
