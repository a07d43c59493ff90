// phase_correlate: phase and magnitude of a window's first harmonic, and its noise sums.
//
// Pass 1 correlates the window with sine and cosine of period T = N or N - 1.  The background,
// rounded down, is taken off every pixel first, so no table error is multiplied by the pedestal.
// For T = N that changes nothing, for T = N - 1 the samples' cosines add up to exactly one, and
// the background is put back as one more sample of that weight: (8) sees the raw pixels.
//
// Pass 2 correlates with the cosine of twice the phase, measured from the peak.  Its two sums
// give sum(v_i sin^2(theta_i - phi)) = (sum(v_i) - sum(v_i cos(2 theta_i - 2 phi))) / 2, exactly
// the variance that the phase feels, for any mixture of constant and shot noise.
//
// With two passes, the first harmonic of the first window goes to peak_refine, which answers with
// the second window and the level of the background beside it.  The level is taken off in pass 1,
// beside the background; the noise of pass 2 is that of the pixels as they are.
//
// Pixels are left-aligned to 16 bits ("aligned counts"), so all widths behind are the same for
// every PixelWidth.
//
//   phase_o        turns, unsigned: peak_position makes delta of (8) from it
//   magnitude_o    cordic gain times |X + iY|, X and Y in aligned counts times the table amplitude
//   left_i         index of the window's first pixel modulo 2**RingWidth
//   refine_o       phase_o, magnitude_o and sum_o are those of the first of two windows
//   sum_o          sum of pixel - pedestal, aligned counts, at least 0
//   wave_o         sum of (pixel - pedestal) cos(2 theta - 2 phi), aligned counts, 4 fraction bits
//   count_o        sum of cos(2 theta - 2 phi), 8 fraction bits
//   no_phase_o     X = Y = 0, or so small against the sum that it is rounding: a flat window
//   Latency  vrscan.fixed.phase_correlate.latency(N): 2 N + a constant, or 2 clocks for a line
//            that is not measured; a valid_i meanwhile is ignored.  first_latency(N) from valid_i
//            to refine_o, then latency(N) from refined_i on
//   Model    vrscan.fixed.phase_correlate, bit-exact

`default_nettype none

module phase_correlate #(
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned UserWidth  = 8
) (
  input  wire logic                                         clk_i,
  input  wire logic                                         rst_i,

  input  wire logic                                         valid_i,
  input  wire logic                                         measured_i,
  input  wire logic        [     vrscan_pkg::RingWidth-1:0] left_i,
  input  wire logic        [   vrscan_pkg::WindowWidth-1:0] width_i,
  input  wire logic        [    vrscan_pkg::CountWidth-1:0] background_i,
  input  wire logic        [                 UserWidth-1:0] user_i,

  // The window's pixels: two clocks from index to pixel.
  output      logic        [     vrscan_pkg::RingWidth-1:0] read_index_o,
  input  wire logic        [                PixelWidth-1:0] read_pixel_i,

  // The second window.
  output      logic                                         refine_o,
  input  wire logic                                         refined_i,
  input  wire logic        [     vrscan_pkg::RingWidth-1:0] refined_left_i,
  input  wire logic        [   vrscan_pkg::WindowWidth-1:0] refined_width_i,
  input  wire logic signed [     vrscan_pkg::RampWidth-1:0] refined_ramp_i,
  input  wire logic signed [vrscan_pkg::SlopeLevelWidth-1:0] refined_slope_i,

  output      logic                                         valid_o,
  output      logic                                         measured_o,
  output      logic                                         no_phase_o,
  output      logic        [   vrscan_pkg::WindowWidth-1:0] width_o,
  output      logic        [   vrscan_pkg::WindowWidth-1:0] period_o,
  output      logic        [    vrscan_pkg::AngleWidth-1:0] phase_o,
  output      logic        [vrscan_pkg::MagnitudeWidth-1:0] magnitude_o,
  output      logic        [      vrscan_pkg::SumWidth-1:0] sum_o,
  output      logic signed [     vrscan_pkg::WaveWidth-1:0] wave_o,
  output      logic signed [ vrscan_pkg::WaveCountWidth-1:0] count_o,
  output      logic        [                 UserWidth-1:0] user_o,

  // Configuration.
  input  wire register_pkg::peak_t                          peak_i
);

  localparam int unsigned WindowWidth   = vrscan_pkg::WindowWidth;
  localparam int unsigned AlignedWidth  = vrscan_pkg::AlignedWidth;
  localparam int unsigned SineWidth     = vrscan_pkg::SineWidth;
  localparam int unsigned HarmonicWidth = vrscan_pkg::HarmonicWidth;
  localparam int unsigned PhaseWidth    = vrscan_pkg::PhaseWidth;  // of the table's input
  localparam int unsigned StepWidth     = 32;  // phase accumulator, turns
  localparam int unsigned LowWidth      = 17;  // of a sine, for the 18-bit multipliers
  localparam int unsigned HighWidth     = SineWidth - LowWidth;

  // ---- control ----
  typedef enum logic [2:0] {
    IDLE, STEP, FIRST_PASS, PHASE, REFINE, SECOND_PASS, DRAIN
  } state_e;
  state_e                   state_q;
  logic                     begin_pass;  // the sums are zero
  logic                     step_start_q, step_valid;
  logic [    StepWidth-1:0] step;
  logic [    StepWidth-1:0] angle_q;  // of the sample that is issued
  logic [    StepWidth-1:0] angle_step_q;
  logic [  WindowWidth-1:0] left_q;  // samples still to issue
  logic [ AlignedWidth-1:0] pedestal_q;
  logic                     issue_q;
  logic                     restore_q;  // the sample that puts the pedestal back
  logic                     summed_q;  // the second pass is complete
  logic                     again_q;  // another window follows this one
  logic [vrscan_pkg::RingWidth-1:0]  first_index_q;  // of the window
  // Of 255 heights below 2**17: with a level taken off they may be negative.
  localparam int unsigned TotalWidth = vrscan_pkg::SumWidth + 2;
  logic signed [TotalWidth-1:0]      sum_q;  // of the heights
  logic [vrscan_pkg::SumWidth-1:0]   positive_sum_q;
  // What is taken off the next pixel beside the background: at most half of what one can be.  What
  // is lost by rounding goes over to the pixel behind it, so that it adds up to nothing.
  logic signed [vrscan_pkg::RampWidth-1:0]       ramp_q;
  logic        [vrscan_pkg::RampFraction-1:0]    rest_q, rest;
  logic                                          carry;
  assign {carry, rest} = {1'b0, rest_q} + {1'b0, ramp_q[vrscan_pkg::RampFraction-1:0]};
  logic signed [vrscan_pkg::SlopeLevelWidth-1:0] slope_q;
  logic                     issue_q2;

  divide #(
    .DividendWidth(StepWidth + 1), .DivisorWidth(WindowWidth), .QuotientWidth(StepWidth)
  ) u_step (
    .clk_i, .rst_i,
    .valid_i   (step_start_q),
    .dividend_i({1'b1, {StepWidth{1'b0}}}),
    .divisor_i (period_o),
    .valid_o   (step_valid),
    .quotient_o(step),
    .overflow_o()  // T is 2 or more
  );

  logic                                  cordic_start_q, cordic_valid, cordic_zero;
  logic [    vrscan_pkg::AngleWidth-1:0] cordic_angle;
  logic [vrscan_pkg::MagnitudeWidth-1:0] cordic_magnitude;

  // The sum is still that of the first pass, and has been for long.
  logic [vrscan_pkg::MagnitudeWidth-1:0] no_phase_below;
  assign no_phase_below = vrscan_pkg::MagnitudeWidth'(positive_sum_q) << vrscan_pkg::NoPhaseShift;

  assign begin_pass = state_q == IDLE || cordic_valid;

  always_ff @(posedge clk_i) begin
    step_start_q <= 1'b0;
    issue_q      <= 1'b0;
    restore_q    <= 1'b0;
    refine_o     <= 1'b0;
    valid_o      <= 1'b0;
    positive_sum_q <= sum_q < 0 ? '0 : sum_q[vrscan_pkg::SumWidth-1:0];
    issue_q2       <= issue_q;
    if (issue_q2) begin
      ramp_q <= ramp_q + vrscan_pkg::RampWidth'(slope_q);
      rest_q <= rest;
    end
    unique case (state_q)
      IDLE: if (valid_i) begin
        // Where nothing is measured the results are zero.
        measured_o   <= measured_i;
        user_o       <= user_i;
        width_o      <= width_i;
        period_o     <= width_i - WindowWidth'(!(peak_i.period_n || peak_i.window_two_pass));
        first_index_q <= left_i;
        ramp_q       <= '0;
        rest_q       <= '0;
        slope_q      <= '0;
        again_q      <= peak_i.window_two_pass;
        phase_o      <= '0;
        magnitude_o  <= '0;
        no_phase_o   <= 1'b0;
        pedestal_q   <= background_i[vrscan_pkg::CountWidth-1 -: AlignedWidth];
        step_start_q <= measured_i;
        state_q      <= measured_i ? STEP : DRAIN;
      end
      STEP: if (step_valid) begin
        angle_q      <= '0;
        angle_step_q <= step;
        left_q       <= width_o;
        read_index_o <= first_index_q;
        issue_q      <= 1'b1;
        state_q      <= FIRST_PASS;
      end
      FIRST_PASS, SECOND_PASS: begin
        angle_q      <= angle_q + angle_step_q;
        read_index_o <= read_index_o + vrscan_pkg::RingWidth'(1);
        left_q       <= left_q - WindowWidth'(1);
        issue_q      <= left_q != WindowWidth'(1);
        if (left_q == WindowWidth'(1)) begin
          restore_q <= state_q == FIRST_PASS;
          state_q   <= state_q == FIRST_PASS ? PHASE : DRAIN;
        end
      end
      PHASE: if (cordic_valid) begin
        phase_o      <= cordic_angle;
        magnitude_o  <= cordic_magnitude;
        no_phase_o   <= cordic_zero || cordic_magnitude < no_phase_below;
        // The second harmonic, measured from the peak: 2 (theta - phi).
        angle_q      <= -{cordic_angle[vrscan_pkg::AngleWidth-2:0],
                          {(StepWidth - vrscan_pkg::AngleWidth + 1){1'b0}}};
        angle_step_q <= angle_step_q << 1;
        left_q       <= width_o;
        read_index_o <= first_index_q;
        ramp_q       <= '0;
        rest_q       <= '0;
        slope_q      <= '0;
        sum_o        <= positive_sum_q;
        refine_o     <= again_q;
        issue_q      <= !again_q;
        state_q      <= again_q ? REFINE : SECOND_PASS;
      end
      REFINE: if (refined_i) begin
        again_q       <= 1'b0;
        width_o       <= refined_width_i;
        period_o      <= refined_width_i;
        first_index_q <= refined_left_i;
        ramp_q        <= refined_ramp_i;
        rest_q        <= {1'b1, {(vrscan_pkg::RampFraction - 1){1'b0}}};
        slope_q       <= refined_slope_i;
        step_start_q  <= 1'b1;
        state_q       <= STEP;
      end
      DRAIN: if (summed_q || !measured_o) begin
        measured_o <= measured_o && !no_phase_o;
        sum_o      <= sum_q < 0 ? '0 : sum_q[vrscan_pkg::SumWidth-1:0];
        // To nearest, half up; the table's amplitude is 2**(SineWidth - 1) within 4e-5.
        wave_o     <= (vrscan_pkg::WaveWidth)'((x_q + HarmonicWidth'(1 << (WaveShift - 1)))
                                               >>> WaveShift);
        count_o    <= (vrscan_pkg::WaveCountWidth)'((plain_sum_q
                                                     + PlainWidth'(1 << (WaveCountShift - 1)))
                                                    >>> WaveCountShift);
        valid_o    <= 1'b1;
        state_q    <= IDLE;
      end
      default: state_q <= IDLE;
    endcase
    if (rst_i) begin
      state_q      <= IDLE;
      step_start_q <= 1'b0;
      issue_q      <= 1'b0;
      restore_q    <= 1'b0;
      refine_o     <= 1'b0;
      valid_o      <= 1'b0;
    end
  end

  logic unused_background;
  assign unused_background = ^background_i[vrscan_pkg::CountWidth-AlignedWidth-1:0];

  // ---- samples: the pixel waits for its sine ----
  localparam int unsigned TableLatency = vrscan_pkg::QuarterWaveLatency;
  localparam int unsigned HeightWidth  = AlignedWidth + 2;  // above pedestal and ramp, and a sign
  localparam int unsigned Delay        = TableLatency - 3;  // index to pixel to height takes three

  logic signed [SineWidth-1:0] sine, cosine;
  logic                        table_valid;
  quarter_wave #(.PhaseWidth(PhaseWidth), .AmplWidth(SineWidth)) u_quarter_wave (
    .clk_i, .rst_i,
    .valid_i (issue_q || restore_q),
    .phase_i (angle_q[StepWidth-1 -: PhaseWidth]),
    .valid_o (table_valid),
    .sine_o  (sine),
    .cosine_o(cosine)
  );

  logic        [  AlignedWidth-1:0] aligned;
  logic        [   HeightWidth-1:0] height_q;
  logic signed [   HeightWidth-1:0] level_q;  // of the pixel that comes next
  logic                             restore_q2, restore_q3, restore_q4;
  logic        [Delay*HeightWidth-1:0] height_delay_q;
  logic        [         Delay-1:0] restore_delay_q;
  logic signed [   HeightWidth-1:0] height;
  logic                             restore;
  assign aligned = AlignedWidth'(read_pixel_i) << (AlignedWidth - PixelWidth);
  assign height  = signed'(height_delay_q[Delay*HeightWidth-1 -: HeightWidth]);
  assign restore = restore_delay_q[Delay-1];

  always_ff @(posedge clk_i) begin
    restore_q2 <= restore_q;
    restore_q3 <= restore_q2;
    restore_q4 <= restore_q3;
    level_q    <= signed'(HeightWidth'(pedestal_q))
                  + HeightWidth'(ramp_q >>> vrscan_pkg::RampFraction)
                  + signed'(HeightWidth'(carry));
    if (restore_q3) height_q <= period_o == width_o ? '0 : HeightWidth'(pedestal_q);
    else            height_q <= HeightWidth'(aligned) - unsigned'(level_q);
    height_delay_q  <= (Delay*HeightWidth)'({height_delay_q, height_q});
    restore_delay_q <= Delay'({restore_delay_q, restore_q4});
  end

  // ---- products: a sine in two parts, each an 18-bit multiplier with registers ----
  // Chosen, beside the multipliers, multiplied, behind them, and joined: q to q5.
  localparam int unsigned LowProduct  = HeightWidth + LowWidth + 1;
  localparam int unsigned HighProduct = HeightWidth + HighWidth;
  localparam int unsigned FullProduct = HeightWidth + SineWidth;

  logic        [            4:0] sample_q;  // stage by stage
  logic        [            4:0] restored_q;
  logic        [5*HeightWidth-1:0] height_stages_q;
  logic        [  5*SineWidth-1:0] cosine_stages_q;
  logic signed [HeightWidth-1:0] height_q1, height_q2;
  logic signed [  SineWidth-1:0] sine_q, cosine_q, sine_q2, cosine_q2;
  logic signed [     LowWidth:0] sine_low, cosine_low;
  logic signed [  HighWidth-1:0] sine_high, cosine_high;
  logic signed [ LowProduct-1:0] sine_low_q3, cosine_low_q3, sine_low_q4, cosine_low_q4;
  logic signed [HighProduct-1:0] sine_high_q3, cosine_high_q3, sine_high_q4, cosine_high_q4;
  logic signed [FullProduct-1:0] sine_product_q5, cosine_product_q5;
  assign sine_low    = signed'({1'b0, sine_q2[LowWidth-1:0]});
  assign sine_high   = signed'(sine_q2[SineWidth-1:LowWidth]);
  assign cosine_low  = signed'({1'b0, cosine_q2[LowWidth-1:0]});
  assign cosine_high = signed'(cosine_q2[SineWidth-1:LowWidth]);

  // What a sample needs again where its products arrive.
  logic                          arrived, arrived_restored;
  logic        [HeightWidth-1:0] arrived_height;
  logic signed [  SineWidth-1:0] arrived_cosine;
  assign arrived          = sample_q[4];
  assign arrived_restored = restored_q[4];
  assign arrived_height   = height_stages_q[5*HeightWidth-1-:HeightWidth];
  assign arrived_cosine   = signed'(cosine_stages_q[5*SineWidth-1-:SineWidth]);

  always_ff @(posedge clk_i) begin
    sample_q        <= {sample_q[3:0], table_valid};
    restored_q      <= {restored_q[3:0], restore};
    height_stages_q <= {height_stages_q[4*HeightWidth-1:0], unsigned'(height)};
    cosine_stages_q <= {cosine_stages_q[4*SineWidth-1:0], unsigned'(cosine)};

    height_q1 <= height;
    sine_q    <= restore ? '0 : sine;
    cosine_q  <= restore ? SineWidth'(signed'(vrscan_pkg::SineAmplitude)) : cosine;

    height_q2 <= height_q1;
    sine_q2   <= sine_q;
    cosine_q2 <= cosine_q;

    sine_low_q3    <= LowProduct'(height_q2) * LowProduct'(sine_low);
    sine_high_q3   <= HighProduct'(height_q2) * HighProduct'(sine_high);
    cosine_low_q3  <= LowProduct'(height_q2) * LowProduct'(cosine_low);
    cosine_high_q3 <= HighProduct'(height_q2) * HighProduct'(cosine_high);

    sine_low_q4    <= sine_low_q3;
    sine_high_q4   <= sine_high_q3;
    cosine_low_q4  <= cosine_low_q3;
    cosine_high_q4 <= cosine_high_q3;

    sine_product_q5   <= FullProduct'(sine_low_q4) + (FullProduct'(sine_high_q4) <<< LowWidth);
    cosine_product_q5 <= FullProduct'(cosine_low_q4) + (FullProduct'(cosine_high_q4) <<< LowWidth);
    if (rst_i) sample_q <= '0;
  end

  // ---- sums ----
  // At most 255 pixels and the pedestal, below 2**16 each: |X|, |Y| < 2**(8 + 16 + 23).  With a ramp
  // heights are below 1.5 * 2**16, but then T = N, and 255 |cosines| add up to at most 170.
  localparam int unsigned PlainWidth     = SineWidth + WindowWidth;
  localparam int unsigned WaveShift      = SineWidth - 1 - vrscan_pkg::WaveFraction;
  localparam int unsigned WaveCountShift = SineWidth - 1 - vrscan_pkg::WaveCountFraction;
  logic signed [      HarmonicWidth-1:0] x_q, y_q;
  logic signed [         PlainWidth-1:0] plain_sum_q;
  logic        [        WindowWidth-1:0] taken_q;  // samples of this pass
  always_ff @(posedge clk_i) begin
    cordic_start_q <= arrived && arrived_restored;
    summed_q       <= arrived && state_q == DRAIN && taken_q == width_o - WindowWidth'(1);
    if (begin_pass) begin
      x_q         <= '0;
      y_q         <= '0;
      sum_q       <= '0;
      plain_sum_q <= '0;
      taken_q     <= '0;
    end else if (arrived) begin
      x_q     <= x_q + HarmonicWidth'(cosine_product_q5);
      y_q     <= y_q + HarmonicWidth'(sine_product_q5);
      taken_q <= taken_q + WindowWidth'(1);
      if (!arrived_restored) begin
        sum_q       <= sum_q + TotalWidth'(signed'(arrived_height));
        plain_sum_q <= plain_sum_q + PlainWidth'(arrived_cosine);
      end
    end
    if (rst_i) begin
      cordic_start_q <= 1'b0;
      summed_q       <= 1'b0;
    end
  end

  cordic_vector #(.XyWidth(HarmonicWidth), .AngleWidth(vrscan_pkg::AngleWidth)) u_cordic_vector (
    .clk_i, .rst_i,
    .valid_i    (cordic_start_q),
    .x_i        (x_q),
    .y_i        (y_q),
    .valid_o    (cordic_valid),
    .angle_o    (cordic_angle),
    .magnitude_o(cordic_magnitude),
    .zero_o     (cordic_zero)
  );

endmodule

`default_nettype wire
