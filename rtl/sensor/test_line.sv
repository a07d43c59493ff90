// test_line: synthetic lines in place of the sensor's, so that a board without optics can be tried.
//
// Pixel i of a line whose pulse stands at c is, in counts left-aligned to 16 bits,
//
//   test_pedestal + test_height (1 + cos 2 pi (i - c) / W) / 2 + test_noise n / 2**9,
//
// the cosine only where |i - c| < W / 2 (a Hann pulse, W wide at its foot), n the noise.  It is
// exact to 17 fraction bits, rounded once to PixelWidth, to nearest, half up, and kept within
// 0 .. full scale.  A line depends on its place in the run and on the registers only, which are
// sampled with test_start.
//
//   test_position    c of the first line: px, 12 fraction bits
//   test_move        added to c from line to line; where c leaves 0 .. LineLength, LineLength is
//                    added or taken off, once, modulo 8192 px
//   test_step        2**28 / W; 0 is a line of the same height everywhere.  c times this step is
//                    rounded to nearest, half up, to a phase of 2**-28 turns
//   test_height      its 1.0 is quarter_wave's amplitude, 65534 / 65536
//   test_noise       peak of the noise.  n is the sum of the four bytes of x less 510; x, of 32
//                    bits, steps once a pixel, x ^= x << 13, x ^= x >> 17, x ^= x << 5 (Marsaglia
//                    2003), and is test_seed ^ 0x9E3779B9 before a run's first pixel, or
//                    0x9E3779B9 where that is 0.  The deviation is test_noise / sqrt(12)
//   test_lines       lines of a run, 0 is without end
//   test_period_clks    from line start to line start; at least LineLength + 16 clocks
//   test_start       begins a run; one that is on its way is cut off, in mid-line too
//   test_stop        ends it with the line that has begun, 15 clocks before its line_start_o, or a
//                    clock later where none has; test_start in the same clock wins
//   test_running_o   from the clock after test_start to the last line_end_o
//   Latency  27 clocks from test_start to the first line_start_o; lines have no gaps
//   Model    vrscan.fixed.test_line, bit-exact

`default_nettype none

module test_line #(
  parameter int unsigned LineLength = 2048,  // 64 to 8192
  parameter int unsigned PixelWidth = 12
) (
  input  wire logic                                           clk_i,
  input  wire logic                                           rst_i,

  output      logic                                           line_start_o,
  output      logic                                           line_end_o,
  output      logic                                           pixel_valid_o,
  output      logic        [                  PixelWidth-1:0] pixel_o,

  // Configuration.
  input  wire register_pkg::test_t                            test_i,

  output      logic                                           test_running_o
);

  if (LineLength < vrscan_pkg::BlockLength || LineLength > 8192) begin : gen_bad_length
    $error("test_line: LineLength must be 64 to 8192");
  end
  if (PixelWidth < 8 || PixelWidth > 16) begin : gen_bad_width
    $error("test_line: PixelWidth must be 8..16");
  end

  localparam int unsigned Aligned       = vrscan_pkg::AlignedWidth;
  localparam int unsigned PhaseWidth    = vrscan_pkg::PhaseWidth;
  localparam int unsigned PlaceWidth    = 25;
  localparam int unsigned MoveWidth     = 24;
  localparam int unsigned Fraction      = vrscan_pkg::PositionFraction;
  localparam int unsigned PeriodWidth   = 24;
  localparam int unsigned MinGap        = 16;
  localparam int unsigned AWidth        = PlaceWidth + 1;
  localparam int unsigned BWidth        = PhaseWidth + 2;
  // The phase of any pixel against any place: below 2**25 2**29 / 2**12, and 2**13 2**29.
  localparam int unsigned FullWidth     = PlaceWidth + PhaseWidth + 1 - Fraction + 1;
  localparam int unsigned MovedWidth    = PlaceWidth + 2;
  localparam int unsigned LeftWidth     = $clog2(LineLength);
  localparam logic signed [MovedWidth-1:0] Length = MovedWidth'(LineLength << Fraction);
  localparam logic [PeriodWidth-1:0] MinPeriod = PeriodWidth'(LineLength + MinGap);

  // Bits of a pixel before it is rounded: the product of height and 1 + cos has 17 fraction bits.
  localparam int unsigned WaveWidth     = 17;
  localparam int unsigned SumFraction   = 17;
  localparam int unsigned NoiseFraction = 9;
  localparam int unsigned DrawWidth     = 11;  // -510 .. 510
  localparam int unsigned BellWidth     = Aligned + WaveWidth;
  localparam int unsigned NoiseWidth    = Aligned + DrawWidth + 1;
  localparam int unsigned SumWidth      = Aligned + SumFraction + 3;
  localparam logic [WaveWidth-1:0] One  = WaveWidth'(65534);  // of quarter_wave, 17 bits
  localparam logic [31:0] SeedMask      = 32'h9E3779B9;

  // ---- the run: when a line begins, and where its pulse is ----
  logic signed [    MoveWidth-1:0] move_q;
  logic        [     PhaseWidth:0] step_q;
  logic        [      Aligned-1:0] height_q, pedestal_q, noise_q;
  logic        [  PeriodWidth-1:0] period_set_q, period_q, count_q;  // two clocks less
  logic                            active_q, endless_q, one_left_q, due_q, ready_q, start;
  logic        [             31:0] lines_left_q;
  logic        [   PlaceWidth-1:0] place_q, place_next_q;
  logic signed [   MovedWidth-1:0] moved_q, moved_q2;
  logic                            below_q, above_q;

  logic                            scale_q, product_valid, rounded_valid_q;
  logic signed [AWidth+BWidth-1:0] product;
  logic signed [    FullWidth-1:0] rounded_q, first_phase_q;
  multiply #(
    .AWidth(AWidth),
    .BWidth(BWidth)
  ) u_multiply (
    .clk_i, .rst_i,
    .valid_i  (scale_q),
    .a_i      (signed'({1'b0, place_q})),
    .b_i      (signed'({1'b0, step_q})),
    .valid_o  (product_valid),
    .product_o(product)
  );
  logic unused_product;
  assign unused_product = &{1'b0, product[AWidth+BWidth-1], product[Fraction-2:0]};

  assign start = active_q && ready_q && due_q;

  always_ff @(posedge clk_i) begin
    // The place of the next line.  It is at rest long before that line begins.
    moved_q      <= MovedWidth'(signed'({1'b0, place_q})) + MovedWidth'(move_q);
    moved_q2     <= moved_q;
    below_q      <= moved_q[MovedWidth-1];
    above_q      <= moved_q >= Length;
    place_next_q <= PlaceWidth'(below_q ? moved_q2 + Length :
                                above_q ? moved_q2 - Length : moved_q2);

    // The phase of its first pixel: to nearest, half up.
    scale_q         <= start;
    rounded_valid_q <= product_valid && !scale_q;
    rounded_q       <= FullWidth'(product >>> Fraction)
                       + FullWidth'(signed'({1'b0, product[Fraction-1]}));
    first_phase_q   <= -rounded_q;
    ready_q         <= (ready_q || rounded_valid_q) && !start;

    period_q   <= period_set_q < MinPeriod ? MinPeriod - PeriodWidth'(2) :
                                             period_set_q - PeriodWidth'(2);
    count_q    <= start ? period_q : count_q - PeriodWidth'(1);
    due_q      <= (due_q || count_q == '0) && !start;
    one_left_q <= lines_left_q == 32'd1;
    if (start) begin
      place_q <= place_next_q;
      if (!endless_q) lines_left_q <= lines_left_q - 32'd1;
      if (one_left_q) active_q <= 1'b0;
    end
    if (test_i.test_stop_strobe) active_q <= 1'b0;
    if (test_i.test_start_strobe) begin
      active_q        <= 1'b1;
      due_q           <= 1'b1;
      ready_q         <= 1'b0;
      scale_q         <= 1'b1;
      rounded_valid_q <= 1'b0;
      place_q         <= test_i.test_position;
      move_q          <= test_i.test_move;
      step_q          <= test_i.test_step;
      height_q        <= test_i.test_height;
      pedestal_q      <= test_i.test_pedestal;
      noise_q         <= test_i.test_noise;
      lines_left_q    <= test_i.test_lines;
      endless_q       <= test_i.test_lines == '0;
      period_set_q    <= test_i.test_period_clks;
    end
    if (rst_i) begin
      active_q        <= 1'b0;
      scale_q         <= 1'b0;
    end
  end

  // ---- the line: a phase a clock ----
  localparam int unsigned Stages = 14;  // of which one is the output
  logic                        in_line_q, first_q, last;
  logic [       LeftWidth-1:0] left_q;
  logic signed [FullWidth-1:0] phase_q;
  logic [          Stages-1:1] valid_q, first_pipe_q, last_pipe_q;
  assign last = in_line_q && left_q == '0;

  always_ff @(posedge clk_i) begin
    in_line_q <= start || (in_line_q && !last);
    first_q   <= start;
    left_q    <= start ? LeftWidth'(LineLength - 1) : left_q - LeftWidth'(1);
    phase_q   <= start ? first_phase_q : phase_q + FullWidth'(signed'({1'b0, step_q}));

    valid_q      <= {valid_q[Stages-2:1], in_line_q};
    first_pipe_q <= {first_pipe_q[Stages-2:1], first_q};
    last_pipe_q  <= {last_pipe_q[Stages-2:1], last};

    pixel_valid_o  <= valid_q[Stages-1];
    line_start_o   <= first_pipe_q[Stages-1];
    line_end_o     <= last_pipe_q[Stages-1];
    test_running_o <= active_q || in_line_q || valid_q != '0;

    if (rst_i || test_i.test_start_strobe) begin
      in_line_q      <= 1'b0;
      first_q        <= 1'b0;
      valid_q        <= '0;
      first_pipe_q   <= '0;
      last_pipe_q    <= '0;
      pixel_valid_o  <= 1'b0;
      line_start_o   <= 1'b0;
      line_end_o     <= 1'b0;
      test_running_o <= !rst_i;
    end
  end

  // ---- the pulse; the numbers are the stages ----
  logic signed [WaveWidth-1:0] cosine;
  quarter_wave #(
    .PhaseWidth(PhaseWidth),
    .AmplWidth (WaveWidth)
  ) u_quarter_wave (
    .clk_i, .rst_i,
    .valid_i (in_line_q),
    .phase_i (phase_q[PhaseWidth-1:0]),
    .valid_o (),
    .sine_o  (),
    .cosine_o(cosine)
  );

  // Within half a turn all bits from the phase's own sign upward are equal.
  localparam int unsigned WaveStage = vrscan_pkg::QuarterWaveLatency;
  logic [        WaveStage:1] inside_q;
  logic [      WaveWidth-1:0] lift_q9, lift_q10;
  logic [      BellWidth-1:0] bell_q11, bell_q12;

  // ---- the noise ----
  logic        [          31:0] x_q, x_left, x_right, x_next, seed;
  logic        [           8:0] low_q7, high_q7;
  logic signed [ DrawWidth-1:0] draw_q8, draw_q9;
  logic signed [NoiseWidth-1:0] noise_q10, noise_q11;
  assign seed    = test_i.test_seed == SeedMask ? SeedMask : test_i.test_seed ^ SeedMask;
  assign x_left  = x_q ^ (x_q << 13);
  assign x_right = x_left ^ (x_left >> 17);
  assign x_next  = x_right ^ (x_right << 5);

  // ---- the sum ----
  localparam logic signed [SumWidth-1:0] Half = SumWidth'(1) << (Aligned + SumFraction
                                                                 - PixelWidth - 1);
  logic signed [SumWidth-1:0] base_q12, total_q13;

  always_ff @(posedge clk_i) begin
    inside_q <= {inside_q[WaveStage-1:1], phase_q[FullWidth-1:PhaseWidth-1] == '0 ||
                                          phase_q[FullWidth-1:PhaseWidth-1] == '1};
    lift_q9  <= inside_q[WaveStage] ? One + unsigned'(cosine) : '0;
    lift_q10 <= lift_q9;
    bell_q11 <= BellWidth'(lift_q10) * BellWidth'(height_q);
    bell_q12 <= bell_q11;

    if (valid_q[5]) x_q <= x_next;
    if (test_i.test_start_strobe) x_q <= seed;
    low_q7    <= 9'(x_q[7:0]) + 9'(x_q[15:8]);
    high_q7   <= 9'(x_q[23:16]) + 9'(x_q[31:24]);
    draw_q8   <= signed'(DrawWidth'(low_q7) + DrawWidth'(high_q7) - DrawWidth'(510));
    draw_q9   <= draw_q8;
    noise_q10 <= NoiseWidth'(draw_q9) * NoiseWidth'(signed'({1'b0, noise_q}));
    noise_q11 <= noise_q10;

    base_q12  <= SumWidth'(signed'({1'b0, pedestal_q, {SumFraction{1'b0}}})) + Half
                 + (SumWidth'(noise_q11) <<< (SumFraction - NoiseFraction));
    total_q13 <= base_q12 + SumWidth'(signed'({1'b0, bell_q12}));

    // To nearest, half up: the half is in the sum.
    pixel_o <= total_q13[Aligned+SumFraction-1-:PixelWidth];
    if (total_q13[SumWidth-2:Aligned+SumFraction] != '0) pixel_o <= '1;
    if (total_q13[SumWidth-1]) pixel_o <= '0;
  end

endmodule

`default_nettype wire
