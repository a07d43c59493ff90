// peak_fit: a Gaussian fitted to the spot, weighted by noise and speckle.
//
// A pixel's height divided by 2**-(u**2), u the distance from the spot's middle in widths, is the
// amplitude where the spot is that Gaussian.  Place and width come from the slope and the curvature
// of these quotients, each weighted with the inverse of its variance R h**2 + K A h + C**2 A**2,
// h = 2**(u**2), of read noise, shot noise and speckle.  Four passes over the pixels; what third
// differences of the second pass's quotients have more than noise is the speckle, steadied over the
// last 16 lines and used from the third pass on.
//
// Where the fit's chi squared is large, its place far off or beyond the line, or an eighth of the
// pixels saturated, the spot is no Gaussian: fitted_o is 0, and position_o what came in.
//
//   measured_i       low: the line has no spot, and takes part in the history only
//   left_i, width_i  the second window; position_i and slope_i are those it has given
//   sigma_i          of the spot from the first window, px, 9 fraction bits
//   reading_o        read_index_o is to be read: pixels by their index modulo 2**RingWidth, which
//                    come 2 clocks later
//   spread_i         standard deviation of position_i that noise makes, px
//   sigma_o          standard deviation of position_o, px: where the fit does not stand, spread_i, or
//                    twice the fit's where that is larger, which is what speckle does to a phase
//   mixed_o          chi squared is above 8.1 a degree of freedom, and not for saturated pixels
//   speckle_o        squared contrast, 20 fraction bits
//   Latency  vrscan.fixed.peak_fit.LATENCY clocks from valid_i to valid_o, or UNMEASURED_LATENCY;
//            a valid_i meanwhile is ignored
//   Model    vrscan.fixed.peak_fit, bit-exact

`default_nettype none

module peak_fit #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  localparam int unsigned IndexWidth    = $clog2(LineLength),
  localparam int unsigned PositionWidth = IndexWidth + 1 + vrscan_pkg::PositionFraction
) (
  input  wire logic                                          clk_i,
  input  wire logic                                          rst_i,

  input  wire logic                                          valid_i,
  input  wire logic                                          measured_i,
  input  wire logic        [                 IndexWidth-1:0] left_i,
  input  wire logic        [    vrscan_pkg::WindowWidth-1:0] width_i,
  input  wire logic signed [vrscan_pkg::SlopeLevelWidth-1:0] slope_i,
  input  wire logic signed [              PositionWidth-1:0] position_i,
  input  wire logic        [     vrscan_pkg::SigmaWidth-1:0] spread_i,
  input  wire logic        [ vrscan_pkg::SpotSigmaWidth-1:0] sigma_i,
  input  wire logic        [                 PixelWidth-1:0] maximum_i,
  input  wire logic        [     vrscan_pkg::CountWidth-1:0] background_i,
  input  wire logic        [     vrscan_pkg::CountWidth-1:0] noise_i,

  output      logic                                          reading_o,
  output      logic        [      vrscan_pkg::RingWidth-1:0] read_index_o,
  input  wire logic        [                 PixelWidth-1:0] read_pixel_i,

  output      logic                                          valid_o,
  output      logic                                          fitted_o,
  output      logic                                          mixed_o,
  output      logic signed [              PositionWidth-1:0] position_o,
  output      logic        [     vrscan_pkg::SigmaWidth-1:0] sigma_o,
  output      logic        [   vrscan_pkg::SpeckleWidth-1:0] speckle_o,

  // Configuration.
  input  wire logic        [     vrscan_pkg::KappaWidth-1:0] kappa_i,
  input  wire logic        [   vrscan_pkg::AlignedWidth-1:0] saturation_level_i
);

  localparam int unsigned CountWidth = vrscan_pkg::CountWidth;
  localparam int unsigned CountShift = CountWidth - PixelWidth;  // pixel to count format

  // Formats, as vrscan.fixed.peak_fit has them: fraction bits.
  localparam int unsigned Span           = 200;  // px
  localparam int unsigned IndexBits      = 8;    // of a pixel of the span
  localparam int unsigned HeightFraction = 17;
  localparam int unsigned PlaceFraction  = 16;
  localparam int unsigned ShareFraction  = 17;
  localparam int unsigned WeightFraction = 16;
  localparam logic [19:0] FirstAmplitude = 20'(3 << (HeightFraction - 2));
  localparam logic [19:0] LeastAmplitude = 20'(1 << (HeightFraction - 4));
  localparam logic [17:0] LeastScale     = 18'(1 << 11);
  localparam logic [19:0] FirstSpeckle   = 20'(1 << 14);
  localparam logic        [45:0] PriorWeight    = 46'(32 * 20 << 12);
  localparam logic signed [53:0] PriorRoughness = 54'sd1073920;  // 32 * 20 * 1678
  localparam logic [33:0] MostVariance   = '1;
  localparam logic [29:0] MostGain       = '1;
  localparam logic [34:0] Ln4            = 35'd11357;  // 2 ln 2, 13 fraction bits
  localparam logic [34:0] SigmaToScale   = 35'd9645;  // 1 / sqrt(log2(e) / 2), 13 fraction bits
  localparam logic [36:0] OneStep        = 37'(64'd1 << 36);
  localparam logic [23:0] LastPlace      = 24'((Span << PlaceFraction) - 1);
  localparam logic [25:0] MostRounds     = 26'(1 << 17);
  localparam logic [25:0] MostStretch    = 26'd4915;  // 0.3, 14 fraction bits
  localparam logic [23:0] NoiseFloor     = 24'((5 << CountShift) >> 4);

  // ---- one multiplier, two dividers, one root: what a pass's sums are worked off with ----
  localparam int unsigned FactorWidth   = 35;
  localparam int unsigned QuotientWidth = 26;
  logic                            multiply_start_q, product_valid;
  logic signed [FactorWidth-1:0]   a_q, b_q;
  logic signed [2*FactorWidth-1:0] product;
  multiply_fast #(.AWidth(FactorWidth), .BWidth(FactorWidth)) u_multiply_fast (
    .clk_i, .rst_i,
    .valid_i  (multiply_start_q),
    .a_i      (a_q),
    .b_i      (b_q),
    .valid_o  (product_valid),
    .product_o(product)
  );

  logic [1:0]        divide_start_q, quotient_valid, dividing_q;
  logic [57:0]       first_dividend_q, second_dividend_q;
  logic [39:0]       first_divisor_q, second_divisor_q;
  logic [QuotientWidth-1:0] first_quotient, second_quotient;
  divide #(
    .DividendWidth(58), .DivisorWidth(40), .QuotientWidth(QuotientWidth)
  ) u_first_divide (
    .clk_i, .rst_i,
    .valid_i   (divide_start_q[0]),
    .dividend_i(first_dividend_q),
    .divisor_i (first_divisor_q),
    .valid_o   (quotient_valid[0]),
    .quotient_o(first_quotient),
    .overflow_o()  // all ones, which every user limits
  );
  divide #(
    .DividendWidth(58), .DivisorWidth(40), .QuotientWidth(QuotientWidth)
  ) u_second_divide (
    .clk_i, .rst_i,
    .valid_i   (divide_start_q[1]),
    .dividend_i(second_dividend_q),
    .divisor_i (second_divisor_q),
    .valid_o   (quotient_valid[1]),
    .quotient_o(second_quotient),
    .overflow_o()
  );

  localparam int unsigned RootWidth = 31;
  logic                   root_start_q, root_valid;
  logic [2*RootWidth-1:0] radicand_q;
  logic [RootWidth-1:0]   root;
  square_root #(.RootWidth(RootWidth)) u_square_root (
    .clk_i, .rst_i,
    .valid_i   (root_start_q),
    .radicand_i(radicand_q),
    .valid_o   (root_valid),
    .root_o    (root)
  );

  // ---- what belongs to the line ----
  logic        [IndexWidth-1:0]                  left_q;
  logic        [vrscan_pkg::WindowWidth-1:0]     width_q;
  logic signed [vrscan_pkg::SlopeLevelWidth-1:0] slope_q;
  logic signed [PositionWidth-1:0]               position_q;
  logic        [vrscan_pkg::SigmaWidth-1:0]      spread_q;
  logic        [CountWidth-1:0]                  background_q, full_q, noise_q;
  // The span's first pixel, and what its first pixel's baseline is.
  localparam int unsigned FirstWidth = IndexWidth + 3;
  logic signed [FirstWidth-1:0] first_q;
  logic signed [35:0]           ramp_q;
  logic        [ 4:0]           lift_q;  // the largest height is at least a half with it
  logic        [16:0]           deviation_q;
  logic        [29:0]           gain_q;
  logic        [33:0]           dark_q;
  logic        [17:0]           begin_q, least_q, most_q;
  logic        [23:0]           started_q;

  // ---- what changes from pass to pass ----
  logic [ 1:0] pass_q;
  logic [19:0] amplitude_q;
  logic [23:0] place_q;
  logic [17:0] scale_q;
  logic [25:0] step_q;
  logic [33:0] total_q, speckle_part_q;
  logic [38:0] shot_q;
  logic [17:0] alpha_q, beta_q, gamma_q;
  logic [19:0] speckle_q;
  assign speckle_o = speckle_q;

  // ---- sums of a pass, MomentFraction fraction bits once they are complete ----
  logic        [23:0] s0_q;  // 16 fraction bits
  logic        [24:0] s2_q;
  logic        [41:0] s4_q;  // 28
  logic signed [25:0] b0_q;
  logic signed [43:0] b1_q;  // 29
  logic signed [42:0] b2_q;  // 28
  logic signed [43:0] chi_q;  // 28
  logic        [ 7:0] pixels_q, clipped_q, quads_q;
  logic        [41:0] rough_q;  // 22
  logic        [36:0] differences_noise_q;  // 17 of the variance
  logic        [21:0] s0;
  logic        [27:0] s4;
  logic signed [28:0] b1, b2;
  assign s0 = 22'(s0_q >> 2);
  assign s4 = 28'(s4_q >> 14);
  assign b1 = 29'(b1_q >>> 15);
  assign b2 = 29'(b2_q >>> 14);

  // ---- control ----
  typedef enum logic [5:0] {
    IDLE, PASS_BY, LIFT, SCALES, DARK, BEGIN, SHOT, AREA, OWN, TOTAL, SHARE, ORIGIN, PLACED, LOADED,
    RUN, MADE, SQUARE, WEIGHT, ROUGH, CLIP, HISTORY, STEADY, SPECKLE, SLOPE, DIVISOR, FOURTH, SECOND,
    CURVE, DROP, DETERMINANT, STRETCH, RISE, REST, PLACE, SCALE, STEP, LIMIT, RADICAND, ROOT,
    SPREAD, JUDGE
  } state_e;
  state_e state_q;

  logic        run_start_q, run_done;
  logic        loaded_q, loading_q;
  logic        measured_q;

  // Registers that follow others every clock: a state waits until they have settled.
  logic [CountWidth-1:0] height_q;  // maximum - background
  logic [CountWidth-1:0] floored_q;  // noise, at least what rounding makes
  logic [           4:0] height_lift_q;
  always_comb begin
    height_lift_q = 5'd23;
    for (int unsigned n = 0; n < CountWidth; n++) begin
      if (height_q[n]) height_lift_q = 5'(CountWidth - 1 - n);
    end
  end
  logic [39:0] lifted_noise;
  logic [40:0] lifted_kappa;
  assign lifted_noise = 40'((47'(floored_q) << lift_q) >> 7);
  assign lifted_kappa = 41'(kappa_i) << lift_q;

  logic signed [34:0] slope35_q;  // amplitude times 2 ln 2
  logic        [39:0] divisor_q;
  logic signed [69:0] kept_q;  // a product that another one is taken from
  logic signed [35:0] excess_q;
  logic        [33:0] determinant_q;
  logic               move_negative_q, stretch_negative_q, rise_negative_q;
  logic        [17:0] move;
  logic        [12:0] stretch;
  assign move    = first_quotient > MostRounds ? 18'(MostRounds) : 18'(first_quotient);
  assign stretch = second_quotient > MostStretch ? 13'(MostStretch) : 13'(second_quotient);
  logic signed [18:0] signed_move;
  logic signed [13:0] signed_stretch;
  assign signed_move    = move_negative_q ? -signed'({1'b0, move}) : signed'({1'b0, move});
  assign signed_stretch = stretch_negative_q ? -signed'({1'b0, stretch}) : signed'({1'b0, stretch});
  logic signed [18:0] move_q;
  logic signed [13:0] stretch_q;
  logic signed [28:0] rest_q;

  // The amplitude moves by half of itself downwards at most, and doubles at most.
  logic [QuotientWidth-1:0] half_amplitude, whole_amplitude;
  assign half_amplitude  = QuotientWidth'(amplitude_q >> 1);
  assign whole_amplitude = QuotientWidth'(amplitude_q);
  logic [20:0] stepped_amplitude;
  always_comb begin
    if (rise_negative_q) begin
      stepped_amplitude = 21'(amplitude_q)
          - 21'(first_quotient > half_amplitude ? half_amplitude : first_quotient);
    end else begin
      stepped_amplitude = 21'(amplitude_q)
          + 21'(first_quotient > whole_amplitude ? whole_amplitude : first_quotient);
    end
  end
  logic signed [24:0] minus_place;
  assign minus_place = -signed'({1'b0, place_q});
  logic signed [25:0] stepped_place;
  logic signed [20:0] stepped_scale;
  assign stepped_place = 26'(signed'({1'b0, place_q})) + 26'(product >>> 13);
  assign stepped_scale = 21'(signed'({1'b0, scale_q})) + 21'(product >>> 14);

  // Roughness: what the differences have above what noise makes of them.
  logic        [ 4:0] noise_lift_q;
  logic        [38:0] line_noise_q;
  logic signed [54:0] rough_excess_q;
  logic        [41:0] weight_q;
  logic signed [56:0] lifted_excess_q;
  logic signed [48:0] most_rough_q;
  logic signed [48:0] line_rough_q;
  logic        [31:0] most_noise;
  assign most_noise = |differences_noise_q[36:32] ? '1 : differences_noise_q[31:0];
  logic [5:0] noise_bits;
  always_comb begin
    noise_bits = '0;
    for (int unsigned n = 0; n < 39; n++) if (line_noise_q[n]) noise_bits = 6'(n + 1);
  end

  // The last lines, and their sums.
  localparam logic [$clog2(vrscan_pkg::SpeckleDepth)-1:0] HistoryStep = 1;
  logic        [90:0] history_mem [vrscan_pkg::SpeckleDepth];
  logic        [90:0] oldest_q;
  logic        [$clog2(vrscan_pkg::SpeckleDepth)-1:0] history_at_q;
  logic               history_full_q;
  logic signed [53:0] roughness_q;
  logic        [45:0] weights_q;
  logic signed [48:0] oldest_rough;
  logic        [41:0] oldest_weight;
  assign oldest_rough  = history_full_q ? signed'(oldest_q[90:42]) : '0;
  assign oldest_weight = history_full_q ? oldest_q[41:0] : '0;
  logic signed [53:0] with_prior;
  assign with_prior = roughness_q + PriorRoughness;
  logic [45:0] weight_with_prior;
  assign weight_with_prior = weights_q + PriorWeight;

  logic [39:0] all_variance;
  assign all_variance = 40'(dark_q) + 40'(shot_q) + 40'(speckle_part_q);
  logic [34:0] with_correlation;
  assign with_correlation = 35'(total_q) + 35'(speckle_part_q >> 2) + 35'(speckle_part_q >> 3);
  logic [23:0] distance;
  assign distance = place_q > started_q ? place_q - started_q : started_q - place_q;
  logic [9:0] freedom;  // five times the degrees of freedom
  assign freedom = pixels_q < 8'd3 ? '0 : 10'(pixels_q - 8'd3) + (10'(pixels_q - 8'd3) << 2);
  // What the fit has found, px, PositionFraction bits, and where a line ends.
  localparam int unsigned FoundWidth = FirstWidth + vrscan_pkg::PositionFraction + 1;
  localparam logic signed [FoundWidth-1:0] LineEnd =
      FoundWidth'(LineLength << vrscan_pkg::PositionFraction);
  logic signed [FoundWidth-1:0] fit_place_q;
  logic lost;  // more than an eighth of the pixels are saturated
  assign lost = (11'(clipped_q) << 3) > 11'(pixels_q) + 11'(clipped_q);
  logic [45:0] mixed_limit_q;  // 13/8 of the limit
  logic                         start_inside_q;
  logic [43:0] chi_limit_q;
  // Of a fit that does not stand, twice as much.
  logic [QuotientWidth:0]              wide_spread;
  logic [vrscan_pkg::SigmaWidth-1:0] spread;
  assign wide_spread = within_q ? {1'b0, first_quotient} : {first_quotient, 1'b0};
  assign spread = |wide_spread[QuotientWidth:vrscan_pkg::SigmaWidth]
                  ? '1 : wide_spread[vrscan_pkg::SigmaWidth-1:0];
  logic        within_q, mixed_q;

  always_ff @(posedge clk_i) begin
    multiply_start_q <= 1'b0;
    divide_start_q   <= '0;
    root_start_q     <= 1'b0;
    run_start_q      <= 1'b0;
    valid_o          <= 1'b0;
    dividing_q       <= (dividing_q | divide_start_q) & ~quotient_valid;
    height_q         <= full_q - background_q;
    floored_q        <= noise_q > NoiseFloor ? noise_q : NoiseFloor;
    deviation_q      <= |lifted_noise[39:17] ? '1 : lifted_noise[16:0];
    gain_q           <= |lifted_kappa[40:30] ? MostGain : lifted_kappa[29:0];
    line_noise_q     <= 39'(dark_q) + shot_q;
    noise_lift_q     <= noise_bits > 6'd34 ? '0 : 6'd34 - noise_bits > 6'd16 ? 5'd16
                                                  : 5'(6'd34 - noise_bits);
    oldest_q         <= history_mem[history_at_q];
    unique case (state_q)
      IDLE: if (valid_i) begin
        measured_q   <= measured_i;
        left_q       <= left_i;
        width_q      <= width_i;
        slope_q      <= slope_i;
        position_q   <= position_i;
        spread_q     <= spread_i;
        background_q <= background_i;
        noise_q      <= noise_i;
        full_q       <= CountWidth'(maximum_i) << CountShift;
        a_q          <= FactorWidth'(sigma_i);
        b_q          <= signed'(SigmaToScale);
        multiply_start_q <= measured_i;
        line_rough_q <= '0;
        weight_q     <= '0;
        pass_q       <= '0;
        state_q      <= measured_i ? LIFT : PASS_BY;
      end
      // Its point may not come so early that that of the line before is still in the triangle.
      PASS_BY: if (loaded_q) state_q <= HISTORY;
      LIFT: if (product_valid) begin
        // height_q has settled.
        begin_q <= |product[69:28] ? '1 : 18'(product >>> 10) < LeastScale ? LeastScale
                                                                           : 18'(product >>> 10);
        lift_q  <= height_lift_q;
        first_q <= FirstWidth'(left_q) + FirstWidth'(width_q >> 1) - FirstWidth'(Span / 2);
        ramp_q  <= (width_q[0] ? '0 : 36'(slope_q >>> 1)) - (36'(slope_q) <<< 6)
                   - (36'(slope_q) <<< 5) - (36'(slope_q) <<< 2);
        state_q <= SCALES;
      end
      SCALES: begin
        // Only to let deviation_q and gain_q settle; DARK begins a clock later.
        least_q     <= begin_q >> 1 < LeastScale ? LeastScale : begin_q >> 1;
        most_q      <= begin_q[17] ? '1 : begin_q << 1;
        scale_q     <= begin_q;
        amplitude_q <= FirstAmplitude;
        state_q     <= DARK;
      end
      DARK: begin
        a_q <= FactorWidth'(deviation_q);
        b_q <= FactorWidth'(deviation_q);
        multiply_start_q <= 1'b1;
        second_dividend_q <= 58'(OneStep);
        second_divisor_q  <= 40'(scale_q);
        divide_start_q[1] <= 1'b1;
        dividing_q[1]     <= 1'b1;
        state_q <= BEGIN;
      end
      BEGIN: if (product_valid) begin
        dark_q    <= 34'(product);
        place_q   <= started_q;
        speckle_q <= FirstSpeckle;
        a_q       <= FactorWidth'(gain_q);
        b_q       <= FactorWidth'(amplitude_q);
        multiply_start_q <= 1'b1;
        state_q   <= SHOT;
      end

      // The variance at the top, and each term's share of it.
      SHOT: if (product_valid) begin
        shot_q  <= 39'(product >>> 11);
        a_q     <= FactorWidth'(amplitude_q);
        b_q     <= FactorWidth'(amplitude_q);
        multiply_start_q <= 1'b1;
        state_q <= AREA;
      end
      AREA: if (product_valid) begin
        a_q     <= FactorWidth'(product >>> 6);
        b_q     <= FactorWidth'(speckle_q);
        multiply_start_q <= 1'b1;
        state_q <= OWN;
      end
      OWN: if (product_valid) begin
        speckle_part_q <= |product[69:48] ? '1 : 34'(product >>> 14);
        state_q        <= TOTAL;
      end
      TOTAL: if (dividing_q == '0) begin
        if (pass_q == '0) step_q <= second_quotient;
        total_q <= |all_variance[39:34] ? MostVariance
                   : all_variance == '0 ? 34'd1 : 34'(all_variance);
        state_q <= SHARE;
      end
      SHARE: begin
        first_dividend_q  <= 58'(dark_q) << ShareFraction;
        first_divisor_q   <= 40'(total_q);
        second_dividend_q <= 58'(shot_q) << ShareFraction;
        second_divisor_q  <= 40'(total_q);
        divide_start_q    <= '1;
        dividing_q        <= '1;
        // The first pixel's place in units of u.
        a_q               <= FactorWidth'(minus_place);
        b_q               <= FactorWidth'(step_q);
        multiply_start_q  <= 1'b1;
        state_q           <= ORIGIN;
      end
      ORIGIN: if (dividing_q == '0) begin
        alpha_q <= first_quotient > QuotientWidth'(1 << ShareFraction) ? 18'(1 << ShareFraction)
                                                                       : 18'(first_quotient);
        beta_q  <= second_quotient > QuotientWidth'(1 << ShareFraction) ? 18'(1 << ShareFraction)
                                                                        : 18'(second_quotient);
        state_q <= LOADED;
      end
      PLACED: if (product_valid) state_q <= LOADED;
      LOADED: if (loaded_q) begin
        gamma_q     <= 19'(alpha_q) + 19'(beta_q) > 19'(1 << ShareFraction) ? '0
                       : 18'(1 << ShareFraction) - alpha_q - beta_q;
        run_start_q <= 1'b1;
        state_q     <= RUN;
      end
      RUN: if (run_done) begin
        // The first product of both ways.
        a_q     <= pass_q == 2'd1 ? FactorWidth'(total_q) : FactorWidth'(amplitude_q);
        b_q     <= pass_q == 2'd1 ? FactorWidth'(most_noise >> 4) : signed'(Ln4);
        multiply_start_q <= 1'b1;
        state_q  <= pass_q == 2'd1 ? MADE : SLOPE;
      end

      // The speckle of this line and of those before.
      MADE: if (product_valid) begin
        rough_excess_q <= signed'(55'({rough_q, 12'd0})) - 55'(product >>> 13);
        a_q     <= FactorWidth'(amplitude_q);
        b_q     <= FactorWidth'(amplitude_q);
        multiply_start_q <= 1'b1;
        state_q <= SQUARE;
      end
      SQUARE: if (product_valid) begin
        a_q     <= (FactorWidth'(quads_q) << 4) + (FactorWidth'(quads_q) << 2);
        b_q     <= |product[39:35] ? FactorWidth'((1 << 13) - 1) : FactorWidth'(product[34:22]);
        multiply_start_q <= 1'b1;
        state_q <= WEIGHT;
      end
      WEIGHT: if (product_valid) begin
        weight_q        <= 42'(product) << noise_lift_q;
        lifted_excess_q <= 57'(rough_excess_q >>> 14) <<< noise_lift_q;
        state_q         <= ROUGH;
      end
      ROUGH: begin
        most_rough_q <= 49'((49'(weight_q >> 2) + 49'(weight_q >> 3)) << 8);
        state_q      <= CLIP;
      end
      CLIP: begin
        line_rough_q <= lifted_excess_q > 57'(most_rough_q) ? most_rough_q
                        : lifted_excess_q < 57'(-most_rough_q) ? -most_rough_q
                        : 49'(lifted_excess_q);
        state_q      <= HISTORY;
      end
      HISTORY: begin
        roughness_q  <= roughness_q + 54'(line_rough_q) - 54'(oldest_rough);
        weights_q    <= weights_q + 46'(weight_q) - 46'(oldest_weight);
        history_mem[history_at_q] <= {unsigned'(line_rough_q), weight_q};
        history_at_q <= history_at_q + HistoryStep;
        if (history_at_q == '1) history_full_q <= 1'b1;
        state_q      <= measured_q ? STEADY : JUDGE;
        within_q     <= 1'b0;
      end
      STEADY: begin
        first_dividend_q  <= with_prior[53] ? '0 : 58'(with_prior) << 4;
        first_divisor_q   <= 40'(weight_with_prior >> 8);
        divide_start_q[0] <= 1'b1;
        dividing_q[0]     <= 1'b1;
        state_q           <= SPECKLE;
      end
      SPECKLE: if (dividing_q == '0) begin
        // A line's roughness is limited to 3/8 of its weight, so this fits.
        speckle_q <= 20'(first_quotient);
        a_q       <= FactorWidth'(amplitude_q);
        b_q       <= signed'(Ln4);
        multiply_start_q <= 1'b1;
        state_q   <= SLOPE;
      end

      // The step: slope to place, curvature to width, the rest to amplitude.
      SLOPE: if (product_valid) begin
        slope35_q <= FactorWidth'(product >>> 13);
        a_q       <= FactorWidth'(product >>> 13);
        b_q       <= FactorWidth'(s2_q);
        multiply_start_q <= 1'b1;
        state_q   <= DIVISOR;
      end
      DIVISOR: if (product_valid) begin
        divisor_q        <= 40'(product >>> HeightFraction);
        first_divisor_q  <= 40'(product >>> HeightFraction);
        first_dividend_q <= 58'(b1 < 0 ? unsigned'(-b1) : unsigned'(b1)) << 17;
        move_negative_q  <= b1 < 0;
        divide_start_q[0] <= 1'b1;
        dividing_q[0]     <= 1'b1;
        a_q     <= FactorWidth'(s0);
        b_q     <= FactorWidth'(s4);
        multiply_start_q <= 1'b1;
        state_q <= FOURTH;
      end
      FOURTH: if (product_valid) begin
        kept_q  <= product;
        a_q     <= FactorWidth'(s2_q);
        b_q     <= FactorWidth'(s2_q);
        multiply_start_q <= 1'b1;
        state_q <= SECOND;
      end
      SECOND: if (product_valid) begin
        determinant_q <= kept_q < product ? '0 : 34'((kept_q - product) >>> 16);
        a_q     <= FactorWidth'(s0);
        b_q     <= FactorWidth'(b2);
        multiply_start_q <= 1'b1;
        state_q <= CURVE;
      end
      CURVE: if (product_valid) begin
        kept_q  <= product;
        a_q     <= FactorWidth'(s2_q);
        b_q     <= FactorWidth'(b0_q);
        multiply_start_q <= 1'b1;
        state_q <= DROP;
      end
      DROP: if (product_valid) begin
        excess_q <= 36'((kept_q - product) >>> 16);
        a_q      <= FactorWidth'(determinant_q);
        b_q      <= slope35_q;
        multiply_start_q <= 1'b1;
        state_q  <= DETERMINANT;
      end
      DETERMINANT: if (product_valid) begin
        second_divisor_q  <= 40'(product >>> HeightFraction);
        second_dividend_q <= 58'(excess_q < 0 ? unsigned'(-excess_q) : unsigned'(excess_q)) << 14;
        stretch_negative_q <= excess_q < 0;
        divide_start_q[1] <= 1'b1;
        dividing_q[1]     <= 1'b1;
        state_q           <= STRETCH;
      end
      STRETCH: if (dividing_q == '0) begin
        move_q    <= signed_move;
        stretch_q <= signed_stretch;
        a_q       <= FactorWidth'(signed_stretch);
        b_q       <= slope35_q;
        multiply_start_q <= 1'b1;
        state_q   <= RISE;
      end
      RISE: if (product_valid) begin
        a_q     <= FactorWidth'(product >>> 14);
        b_q     <= FactorWidth'(s2_q);
        multiply_start_q <= 1'b1;
        state_q <= REST;
      end
      REST: if (product_valid) begin
        rest_q  <= 29'(b0_q) - 29'(product >>> HeightFraction);
        a_q     <= FactorWidth'(move_q);
        b_q     <= FactorWidth'(scale_q);
        multiply_start_q <= 1'b1;
        state_q <= PLACE;
      end
      PLACE: if (product_valid) begin
        first_dividend_q  <= 58'(rest_q < 0 ? unsigned'(-rest_q) : unsigned'(rest_q))
                             << HeightFraction;
        first_divisor_q   <= 40'(s0);
        rise_negative_q   <= rest_q < 0;
        divide_start_q[0] <= 1'b1;
        dividing_q[0]     <= 1'b1;
        place_q <= stepped_place < 0 ? '0
                   : stepped_place > 26'(signed'({1'b0, LastPlace})) ? LastPlace
                   : 24'(stepped_place);
        a_q     <= FactorWidth'(stretch_q);
        b_q     <= FactorWidth'(scale_q);
        multiply_start_q <= 1'b1;
        state_q <= SCALE;
      end
      SCALE: if (product_valid) begin
        scale_q <= stepped_scale < 21'(signed'({1'b0, least_q})) ? least_q
                   : stepped_scale > 21'(signed'({1'b0, most_q})) ? most_q : 18'(stepped_scale);
        state_q <= STEP;
      end
      STEP: if (!dividing_q[1]) begin
        second_dividend_q <= 58'(OneStep);
        second_divisor_q  <= 40'(scale_q);
        divide_start_q[1] <= 1'b1;
        dividing_q[1]     <= 1'b1;
        state_q           <= LIMIT;
      end
      LIMIT: if (dividing_q == '0) begin
        step_q      <= second_quotient;
        amplitude_q <= stepped_amplitude < 21'(LeastAmplitude) ? LeastAmplitude
                       : stepped_amplitude[20] ? '1 : 20'(stepped_amplitude);
        pass_q      <= pass_q + 2'd1;
        multiply_start_q <= 1'b1;
        if (pass_q == 2'd3) begin
          a_q     <= FactorWidth'(total_q);
          b_q     <= FactorWidth'(freedom);
          state_q <= RADICAND;
        end else if (pass_q == '0) begin
          a_q     <= FactorWidth'(minus_place);
          b_q     <= FactorWidth'(second_quotient);
          state_q <= PLACED;
        end else begin
          a_q     <= FactorWidth'(gain_q);
          b_q     <= stepped_amplitude < 21'(LeastAmplitude) ? FactorWidth'(LeastAmplitude)
                     : stepped_amplitude[20] ? FactorWidth'(20'hFFFFF)
                     : FactorWidth'(stepped_amplitude);
          state_q <= SHOT;
        end
      end

      // The standard deviation, and whether the fit stands.
      RADICAND: if (product_valid) begin
        chi_limit_q <= 44'(product >>> 6);
        a_q         <= with_correlation[34] ? FactorWidth'(MostVariance)
                                            : FactorWidth'(with_correlation);
        b_q         <= FactorWidth'(s2_q);
        multiply_start_q <= 1'b1;
        state_q     <= ROOT;
      end
      ROOT: begin
        within_q <= chi_q <= signed'(chi_limit_q) && pixels_q >= 8'd4 && start_inside_q
                    && fit_place_q >= 0 && fit_place_q < LineEnd
                    && 24'(distance) <= (24'(begin_q) << 3) + (24'(begin_q) << 1)
                    && !lost;
        mixed_q  <= !lost && 46'(chi_q) > signed'(mixed_limit_q);
        if (product_valid) begin
          radicand_q   <= (2 * RootWidth)'(product);
          root_start_q <= 1'b1;
        end
        if (root_valid) begin
          a_q     <= FactorWidth'(root);
          b_q     <= FactorWidth'(scale_q);
          multiply_start_q <= 1'b1;
          state_q <= SPREAD;
        end
      end
      SPREAD: if (product_valid) begin
        first_dividend_q  <= 58'(product >>> 10);
        first_divisor_q   <= divisor_q;
        divide_start_q[0] <= 1'b1;
        dividing_q[0]     <= 1'b1;
        state_q           <= JUDGE;
      end
      JUDGE: if (!measured_q || dividing_q == '0) begin
        valid_o    <= 1'b1;
        fitted_o   <= within_q;
        mixed_o    <= measured_q && mixed_q;
        position_o <= within_q ? PositionWidth'(fit_place_q) : position_q;
        sigma_o    <= !measured_q ? spread_q : within_q ? spread
                      : spread > spread_q ? spread : spread_q;
        state_q    <= IDLE;
      end
      default: state_q <= IDLE;
    endcase
    if (rst_i) begin
      state_q          <= IDLE;
      multiply_start_q <= 1'b0;
      divide_start_q   <= '0;
      dividing_q       <= '0;
      root_start_q     <= 1'b0;
      run_start_q      <= 1'b0;
      valid_o          <= 1'b0;
      history_at_q     <= '0;
      history_full_q   <= 1'b0;
      roughness_q      <= '0;
      weights_q        <= '0;
    end
  end
  // The place that the fit starts from, within the span.
  logic signed [PositionWidth+1:0] start_place;
  assign start_place = (PositionWidth + 2)'(position_q)
      - ((PositionWidth + 2)'(first_q) <<< vrscan_pkg::PositionFraction);
  always_ff @(posedge clk_i) begin
    mixed_limit_q <= 46'(chi_limit_q) + 46'(chi_limit_q >> 1) + 46'(chi_limit_q >> 3);
    fit_place_q <= (FoundWidth'(first_q) <<< vrscan_pkg::PositionFraction)
                   + FoundWidth'(signed'({1'b0, (25'(place_q) + 25'(1 << 3)) >> 4}));
    start_inside_q <= start_place >= 0 && start_place
        < (PositionWidth + 2)'(signed'(Span << vrscan_pkg::PositionFraction));
    started_q <= start_place < 0 ? '0
        : start_place >= (PositionWidth + 2)'(signed'(Span << vrscan_pkg::PositionFraction))
          ? LastPlace : 24'(start_place) << 4;
  end

  // ---- the span's pixels ----
  logic [PixelWidth-1:0] pixel_mem [1 << IndexBits];
  logic [ IndexBits-1:0] load_q, load_q2, load_q3;
  logic                  load_valid_q2, load_valid_q3;
  assign reading_o = loading_q;
  always_ff @(posedge clk_i) begin
    if (state_q == IDLE && valid_i) begin
      loading_q    <= 1'b1;
      loaded_q     <= 1'b0;
      load_q       <= '0;
      read_index_o <= vrscan_pkg::RingWidth'(left_i) + vrscan_pkg::RingWidth'(width_i >> 1)
                      - vrscan_pkg::RingWidth'(Span / 2);
    end else if (loading_q) begin
      load_q       <= load_q + IndexBits'(1);
      read_index_o <= read_index_o + vrscan_pkg::RingWidth'(1);
      loading_q    <= load_q != IndexBits'(Span - 1);
    end
    load_valid_q2 <= loading_q;
    load_q2       <= load_q;
    load_valid_q3 <= load_valid_q2;
    load_q3       <= load_q2;
    if (load_valid_q3) begin
      pixel_mem[load_q3] <= read_pixel_i;
      loaded_q           <= load_q3 == IndexBits'(Span - 1);
    end
    if (rst_i) begin
      loading_q     <= 1'b0;
      load_valid_q2 <= 1'b0;
      load_valid_q3 <= 1'b0;
    end
  end

  // ---- a pass: a pixel a clock, its stage in the names ----
  logic        [IndexBits-1:0]  index_0;
  logic                         running_0;
  logic signed [FirstWidth-1:0] place_0;
  logic signed [35:0]           u_0;
  logic signed [35:0]           ramp_0;
  always_ff @(posedge clk_i) begin
    if (run_start_q) begin
      index_0   <= '0;
      running_0 <= 1'b1;
      place_0   <= first_q;
      u_0       <= 36'(product >>> PlaceFraction);
      ramp_0    <= ramp_q;
    end else if (running_0) begin
      index_0   <= index_0 + IndexBits'(1);
      running_0 <= index_0 != IndexBits'(Span - 1);
      place_0   <= place_0 + FirstWidth'(1);
      u_0       <= u_0 + 36'(signed'({1'b0, step_q}));
      ramp_0    <= ramp_0 + 36'(slope_q);
    end
    if (rst_i) running_0 <= 1'b0;
  end

  // What goes along: by stage, the newest in the lowest bits.
  localparam int unsigned Stages = 27;
  logic [Stages-1:0] running_q;  // from stage 1 on
  always_ff @(posedge clk_i) begin
    running_q <= Stages'({running_q, running_0});
    if (rst_i) running_q <= '0;
  end
  assign run_done = running_q[Stages-1] && !running_q[Stages-2];

  logic        [PixelWidth-1:0] pixel_1, pixel_2;
  logic                         online_1, online_2, online_3, online_4, online_5;
  logic                         near_1, near_2, near_3, near_4, near_5;
  logic                         clipped_3, clipped_4, clipped_5;
  logic signed [17:0]           u_1, u_2;
  logic signed [31:0]           level_1, level_2, height_3;
  logic signed [26:0]           raw_4;
  logic signed [35:0]           square_3;
  logic        [22:0]           square_4;
  logic        [19:0]           square_5;
  logic signed [50:0]           coarse_5;
  logic signed [57:0]           fine_6;
  logic signed [17:0]           height_7;
  logic        [16:0]           mantissa_6, mantissa_7;
  logic        [ 2:0]           power_6, power_7;
  logic                         inside_6, top_6;
  logic signed [26:0]           u_scaled;
  assign u_scaled = 27'(u_0 >>> 9);
  always_ff @(posedge clk_i) begin
    pixel_1  <= pixel_mem[index_0];
    online_1 <= running_0 && !place_0[FirstWidth-1]
                && place_0 < FirstWidth'(signed'(LineLength));
    near_1   <= running_0 && (u_scaled[26:17] == '0 || u_scaled[26:17] == '1);
    u_1      <= u_scaled[17:0];
    level_1  <= 32'(ramp_0 >>> (vrscan_pkg::RampFraction - 8));

    pixel_2  <= pixel_1;
    online_2 <= online_1;
    near_2   <= near_1;
    u_2      <= near_1 ? u_1 : '0;
    level_2  <= level_1;

    height_3  <= 32'(signed'({1'b0, pixel_2, {CountShift{1'b0}}}))
                 - 32'(signed'({1'b0, background_q})) - level_2;
    clipped_3 <= vrscan_pkg::AlignedWidth'(pixel_2) >= saturation_level_i;
    online_3  <= online_2;
    near_3    <= near_2;
    square_3  <= u_2 * u_2;

    raw_4     <= height_3 > 32'sh3FFFFFF ? 27'sh3FFFFFF
                 : height_3 < -32'sh4000000 ? -27'sh4000000 : 27'(height_3);
    clipped_4 <= clipped_3;
    online_4  <= online_3;
    near_4    <= near_3;
    square_4  <= 23'(square_3 >> 13);

    coarse_5  <= 51'(raw_4) <<< {lift_q[4:3], 3'd0};
    clipped_5 <= clipped_4;
    online_5  <= online_4;
    near_5    <= near_4 && square_4[22:20] == '0;
    square_5  <= square_4[19:0];

    // The table answers in stage 6.
    fine_6    <= 58'(coarse_5) <<< lift_q[2:0];
    power_6   <= near_5 ? square_5[19:17] : '0;
    inside_6  <= near_5 && online_5 && !clipped_5;
    top_6     <= near_5 && online_5 && !clipped_5 && square_5 < 20'(23 << 14);

    height_7   <= fine_6 > 58'sh0FFFFFF ? 18'sh1FFFF
                  : fine_6 < -58'sh1000000 ? -18'sh20000 : 18'(fine_6 >>> 7);
    mantissa_7 <= mantissa_6;
    power_7    <= power_6;
  end

  // The quotient, and beside it the variance in units of that at the top.
  logic signed [17:0] mantissa_8, height_8;
  logic        [17:0] h_8, h_9, h_10, h_11;
  logic        [ 2:0] power_8, power_9, power_10;
  logic signed [35:0] quotient_9, quotient_10;
  logic        [35:0] first_9, first_10;
  logic signed [23:0] quotient_11;
  logic        [26:0] linear_11;
  logic signed [17:0] q_12;
  logic        [35:0] low_12, high_12, low_13, high_13;
  logic        [33:0] noise_14, noise_15;
  logic        [34:0] variance_15, variance_16;
  logic        [ 4:0] over_16, over_17, over_18;  // powers of two above 1
  logic        [15:0] reciprocal_18;
  logic        [15:0] weight_19;
  logic        [ 7:0] reciprocal_index_17;
  logic signed [23:0] excess_11;
  assign excess_11 = quotient_11 - 24'(amplitude_q >> 3);
  logic [4:0] over_15;
  always_comb begin
    over_15 = '0;
    for (int unsigned n = 18; n < 35; n++) if (variance_15[n]) over_15 = 5'(n - 17);
  end
  logic [7:0] index_16;
  assign index_16 = variance_16 < 35'(1 << 17) ? '0 : 8'(variance_16 >> (over_16 + 5'd9));

  peak_fit_rom u_peak_fit_rom (
    .clk_i,
    .power_index_i     (square_5[16:7]),
    .reciprocal_index_i(reciprocal_index_17),
    .power_entry_o     (mantissa_6),
    .reciprocal_entry_o(reciprocal_18)
  );

  always_ff @(posedge clk_i) begin
    mantissa_8 <= signed'(18'(mantissa_7));
    height_8   <= height_7;
    h_8        <= 18'((24'(mantissa_7) << power_7) >> 6);
    power_8    <= power_7;

    quotient_9 <= mantissa_8 * height_8;
    first_9    <= 36'(alpha_q) * 36'(h_8);
    h_9        <= h_8;
    power_9    <= power_8;

    quotient_10 <= quotient_9;
    first_10    <= first_9;
    h_10        <= h_9;
    power_10    <= power_9;

    quotient_11 <= 24'((43'(quotient_10) <<< power_10) >>> 19);
    linear_11   <= 27'(first_10 >> 10) + 27'(beta_q);
    h_11        <= h_10;

    q_12    <= excess_11 > 24'sh1FFFF ? 18'sh1FFFF
               : excess_11 < -24'sh20000 ? -18'sh20000 : 18'(excess_11);
    low_12  <= 36'(linear_11[16:0]) * 36'(h_11);
    high_12 <= 36'(linear_11[26:17]) * 36'(h_11);

    low_13  <= low_12;
    high_13 <= high_12;

    noise_14 <= 34'((53'(high_13) << 17) + 53'(low_13) >> 10);

    noise_15    <= noise_14;
    variance_15 <= 35'(noise_14) + 35'(gamma_q);

    over_16     <= over_15;
    variance_16 <= variance_15;

    reciprocal_index_17 <= index_16;
    over_17             <= over_16;
    over_18             <= over_17;

    weight_19 <= inside_18 ? reciprocal_18 >> over_18 : '0;
  end

  // ---- delays ----
  logic [12:0] inside_delay_q;  // from stage 7
  logic [ 5:0] top_delay_q;  // from stage 7
  logic        inside_18;
  assign inside_18 = inside_delay_q[11];
  localparam int unsigned UDelay = 21;  // stage 2 to 23
  localparam int unsigned QDelay = 11;  // stage 12 to 23
  localparam int unsigned SquareDelay = 18;  // stage 5 to 23
  logic        [   18*UDelay-1:0] u_delay_q;
  logic        [   18*QDelay-1:0] q_delay_q;
  logic        [17*SquareDelay-1:0] square_delay_q;
  logic signed [17:0] u_23, q_19, q_23;
  logic signed [17:0] square_19, square_23;
  assign u_23      = signed'(u_delay_q[18*UDelay-1-:18]);
  assign q_19      = signed'(q_delay_q[18*7-1-:18]);
  assign q_23      = signed'(q_delay_q[18*QDelay-1-:18]);
  assign square_19 = signed'({1'b0, square_delay_q[17*14-1-:17]});
  assign square_23 = signed'({1'b0, square_delay_q[17*SquareDelay-1-:17]});
  always_ff @(posedge clk_i) begin
    inside_delay_q <= 13'({inside_delay_q, inside_6});
    top_delay_q    <= 6'({top_delay_q, top_6});
    u_delay_q      <= (18 * UDelay)'({u_delay_q, unsigned'(u_2)});
    q_delay_q      <= (18 * QDelay)'({q_delay_q, unsigned'(q_12)});
    square_delay_q <= (17 * SquareDelay)'({square_delay_q, square_5[19:3]});
  end

  // ---- third differences of the quotients, and what noise makes of them ----
  logic signed [17:0] q_13, q_14, q_15;
  logic               top_12, top_13, top_14, top_15;
  logic signed [20:0] difference_13;
  logic signed [17:0] difference_14, difference_15;
  logic               quad_13, quad_14, quad_15, quad_16, quad_17;
  logic signed [35:0] rough_16, rough_17;
  logic        [23:0] noise24_15, noise24_16, noise24_17, noise24_18;
  logic        [28:0] four_16;
  assign top_12 = top_delay_q[5];
  assign noise24_15 = |noise_15[33:24] ? '1 : noise_15[23:0];
  always_ff @(posedge clk_i) begin
    q_13   <= q_12;
    q_14   <= q_13;
    q_15   <= q_14;
    top_13 <= top_12;
    top_14 <= top_13;
    top_15 <= top_14;
    difference_13 <= (21'(q_12) - 21'(q_15)) + 21'(3) * (21'(q_14) - 21'(q_13));
    quad_13       <= top_12 && top_13 && top_14 && top_15;

    difference_14 <= 18'(difference_13 >>> 3);
    quad_14       <= quad_13;
    difference_15 <= difference_14;
    quad_15       <= quad_14;
    rough_16      <= difference_15 * difference_15;
    quad_16       <= quad_15;
    rough_17      <= rough_16;
    quad_17       <= quad_16;

    noise24_16 <= noise24_15;
    noise24_17 <= noise24_16;
    noise24_18 <= noise24_17;
    four_16    <= 29'(noise24_15) + 29'(noise24_18)
                  + ((29'(noise24_16) + 29'(noise24_17)) << 3)
                  + 29'(noise24_16) + 29'(noise24_17);
  end

  // ---- weighted quotients and moments ----
  logic signed [17:0] weight_20, q_20, square_20;
  logic signed [35:0] weighted_21, weighted_22, moment_21, moment_22;
  logic signed [17:0] weighted_23, moment_23;
  logic signed [35:0] slope_24, slope_25, curve_24, curve_25, fourth_24, fourth_25, chi_24, chi_25;
  localparam logic signed [35:0] Half = 36'(1 << (WeightFraction - 1));
  always_ff @(posedge clk_i) begin
    weight_20 <= signed'(18'(weight_19));
    q_20      <= q_19;
    square_20 <= square_19;

    weighted_21 <= weight_20 * q_20;
    moment_21   <= weight_20 * square_20;
    weighted_22 <= weighted_21;
    moment_22   <= moment_21;
    weighted_23 <= 18'((weighted_22 + Half) >>> WeightFraction);
    moment_23   <= 18'((moment_22 + Half) >>> WeightFraction);

    slope_24  <= weighted_23 * u_23;
    curve_24  <= weighted_23 * square_23;
    fourth_24 <= moment_23 * square_23;
    chi_24    <= weighted_23 * q_23;
    slope_25  <= slope_24;
    curve_25  <= curve_24;
    fourth_25 <= fourth_24;
    chi_25    <= chi_24;
  end

  // ---- sums: what is not inside has no weight ----
  always_ff @(posedge clk_i) begin
    if (run_start_q) begin
      s0_q                <= '0;
      s2_q                <= '0;
      s4_q                <= '0;
      b0_q                <= '0;
      b1_q                <= '0;
      b2_q                <= '0;
      chi_q               <= '0;
      pixels_q            <= '0;
      clipped_q           <= '0;
      quads_q             <= '0;
      rough_q             <= '0;
      differences_noise_q <= '0;
    end else begin
      if (running_q[4]) clipped_q <= clipped_q + 8'(near_5 && online_5 && clipped_5);
      if (running_q[5]) pixels_q <= pixels_q + 8'(inside_6);
      if (running_q[15] && quad_16) begin
        quads_q             <= quads_q + 8'd1;
        differences_noise_q <= differences_noise_q + 37'(four_16);
      end
      if (running_q[16] && quad_17) rough_q <= rough_q + 42'(unsigned'(rough_17));
      if (running_q[18]) s0_q <= s0_q + 24'(weight_19);
      if (running_q[22]) begin
        s2_q <= s2_q + 25'(unsigned'(moment_23));
        b0_q <= b0_q + 26'(weighted_23);
      end
      if (running_q[24]) begin
        s4_q  <= s4_q + 42'(unsigned'(fourth_25));
        b1_q  <= b1_q + 44'(slope_25);
        b2_q  <= b2_q + 43'(curve_25);
        chi_q <= chi_q + 44'(chi_25);
      end
    end
  end

endmodule

`default_nettype wire
