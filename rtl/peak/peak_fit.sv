// peak_fit: a Gaussian fitted to the spot, weighted by noise and speckle.
//
// A pixel's height divided by 2**-(u**2), u the distance from the spot's middle in widths, is the
// amplitude where the spot is that Gaussian.  Place and width come from the slope and the curvature
// of these quotients, each weighted with the inverse of its variance R h**2 + K A h + C**2 A**2,
// h = 2**(u**2), of read noise, shot noise and speckle.  No spot is a Gaussian far out, so speckle
// counts twice from u**2 = 5 on and four times from 7 on.  Four passes over the pixels; what third
// differences of the second pass's quotients have more than noise is the speckle, steadied over the
// last 32 lines and used from the third pass on; where a line's squared differences are above twice
// what noise makes, and its own speckle above twice the steadied, its own is.  Grains as long as the spot, which differences do
// not see, turn the middle of the spot against the whole: the slope of the quotients there, squared,
// over what independent pixels make of it, averaged over 32 lines, tells what they add to sigma.
//
// A foot on one side of the spot turns the middle to the same side line after line.  Where the leans
// of the second pass, with their signs, add up over 32 lines to 5/8 of their sum, a fit ends at
// u**2 = 3, and at 2 where their mean is 4 or more; the lean is that of the whole then, and counts
// by itself.
//
// Where the fit's chi squared is above 5 a degree of freedom with grains or above 7.5 without, its
// place far off or beyond the line, or an eighth of the pixels saturated, the spot is no Gaussian,
// and position_o is what came in.
//
//   measured_i       low: the line has no spot, and takes part in the history only
//   left_i, width_i  the second window; position_i and slope_i are those it has given
//   sigma_i          of the spot from the first window, px, 9 fraction bits
//   reading_o        read_index_o is to be read: pixels by their index modulo 2**RingWidth, which
//                    come 2 clocks later
//   spread_i         standard deviation of position_i that noise makes, px
//   sigma_o          standard deviation of position_o, px: where the fit does not stand, spread_i, or
//                    twice the fit's where that is larger, which is what speckle does to a phase
//   mixed_o          chi squared with grains is above 15 a degree of freedom, and no pixel of the spot
//                    is saturated
//   scale_o          half of the spot's width at half of its height, px, 12 fraction bits
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
  output      logic                                          mixed_o,
  output      logic signed [              PositionWidth-1:0] position_o,
  output      logic        [     vrscan_pkg::SigmaWidth-1:0] sigma_o,
  output      logic        [     vrscan_pkg::ScaleWidth-1:0] scale_o,

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
  localparam logic [34:0] Ln4            = 35'd11357;  // 2 ln 2, 13 fraction bits
  localparam logic [34:0] SigmaToScale   = 35'd9645;  // 1 / sqrt(log2(e) / 2), 13 fraction bits
  localparam logic [36:0] OneStep        = 37'(64'd1 << 36);
  localparam logic [23:0] LastPlace      = 24'((Span << PlaceFraction) - 1);
  localparam logic [25:0] MostStretch    = 26'd4915;  // 0.3, 14 fraction bits
  localparam logic [23:0] NoiseFloor     = 24'((vrscan_pkg::NoiseFloor << CountShift) >> 4);

  // ---- what belongs to the line ----
  logic        [IndexWidth-1:0]                  left_q;
  logic        [vrscan_pkg::WindowWidth-1:0]     width_q;
  logic signed [vrscan_pkg::SlopeLevelWidth-1:0] slope_q;
  logic signed [PositionWidth-1:0]               position_q;
  logic        [vrscan_pkg::SigmaWidth-1:0]      spread_q;
  logic        [vrscan_pkg::SpotSigmaWidth-1:0]  sigma_q;
  logic        [CountWidth-1:0]                  background_q, full_q, noise_q;
  logic                                          measured_q;
  // The span's first pixel, and what its first pixel's baseline is.
  localparam int unsigned FirstWidth = IndexWidth + 3;
  localparam int unsigned LineWidth  = 34;  // of what grows along the line: u and the baseline
  logic signed [FirstWidth-1:0] first_q;
  logic signed [ LineWidth-1:0] ramp_q;
  logic        [ 4:0]           lift_q;  // the largest height is at least a half with it
  logic        [16:0]           deviation_q;
  logic        [29:0]           gain_q;
  logic        [33:0]           dark_q;
  logic        [17:0]           begin_q, least_q, most_q;
  logic        [23:0]           started_q;

  // ---- what changes from pass to pass ----
  logic        [ 1:0] pass_q;
  logic        [19:0] amplitude_q;
  logic        [23:0] place_q;
  logic signed [24:0] minus_place_q;
  logic        [17:0] scale_q;
  assign scale_o = scale_q;
  logic        [25:0] step_q;
  logic        [33:0] total_q, speckle_part_q;
  logic        [38:0] shot_q;
  logic        [17:0] alpha_q, beta_q, gamma_q;
  logic        [19:0] speckle_q;

  // ---- sums of a pass, MomentFraction fraction bits once they are complete ----
  logic        [23:0] s0_q;  // 16 fraction bits
  logic        [24:0] s2_q;
  logic        [41:0] s4_q;  // 28
  logic signed [25:0] b0_q;
  logic signed [43:0] b1_q;  // 29
  logic signed [42:0] b2_q;  // 28
  logic signed [43:0] chi_q;  // 28
  logic        [24:0] s2_middle_q;  // of the middle alone
  logic signed [43:0] b1_middle_q;  // 29
  logic        [24:0] s2_whole_q;  // wherever the fit ends
  logic signed [43:0] b1_whole_q;  // 29
  logic        [ 7:0] pixels_q, clipped_q;
  logic        [ 9:0] quads_q;  // five times their number
  logic        [41:0] rough_q;  // 22
  logic        [36:0] differences_noise_q;  // 17 of the variance
  logic        [21:0] s0;
  logic        [27:0] s4;
  logic signed [28:0] b1, b2;
  assign s0 = 22'(s0_q >> 2);
  assign s4 = 28'(s4_q >> 14);
  assign b1 = 29'(b1_q >>> 15);
  assign b2 = 29'(b2_q >>> 14);

  // ---- one multiplier, two dividers, one root: what a pass's sums are worked off with ----
  // A state names a product's factors.  Products come in the order in which they are named; one
  // stays until the next, and nothing is on its way where multiplied says so.
  typedef enum logic [4:0] {
    A_SIGMA, A_SLOPE, A_DEVIATION, A_GAIN, A_AMPLITUDE, A_AREA, A_PLACE, A_TOTAL, A_QUADS, A_S0,
    A_S2, A_DETERMINANT, A_STRETCH, A_MOVE, A_CORRELATED, A_ROOT, A_OPERAND
  } a_e;
  typedef enum logic [4:0] {
    B_SIGMA_TO_SCALE, B_HALF_SPAN, B_DEVIATION, B_AMPLITUDE, B_SPECKLE, B_STEP, B_FACTOR, B_LIGHT,
    B_LN4, B_S2, B_S4, B_B0, B_B2, B_MIDDLE, B_SLOPE, B_SCALE, B_LIFTED, B_OPERAND
  } b_e;
  a_e   a_select_q;
  b_e   b_select_q;
  logic issue_q;

  localparam int unsigned FactorWidth   = 35;
  localparam int unsigned QuotientWidth = 26;
  localparam int unsigned DividendWidth = 57;
  localparam int unsigned DivisorWidth  = 38;
  localparam int unsigned RootWidth     = 31;
  logic                            multiply_start_q, product_valid, multiplied;
  logic        [              2:0] products_q;  // on their way
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
  assign multiplied = !issue_q && products_q == 3'(product_valid);

  logic [1:0]               divide_start_q, quotient_valid, dividing_q;
  logic                     divided;
  logic [DividendWidth-1:0] first_dividend_q, second_dividend_q;
  logic [DivisorWidth-1:0]  first_divisor_q, second_divisor_q;
  logic [QuotientWidth-1:0] first_quotient, second_quotient;
  assign divided = {divide_start_q, dividing_q} == '0;
  divide #(
    .DividendWidth(DividendWidth), .DivisorWidth(DivisorWidth), .QuotientWidth(QuotientWidth)
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
    .DividendWidth(DividendWidth), .DivisorWidth(DivisorWidth), .QuotientWidth(QuotientWidth)
  ) u_second_divide (
    .clk_i, .rst_i,
    .valid_i   (divide_start_q[1]),
    .dividend_i(second_dividend_q),
    .divisor_i (second_divisor_q),
    .valid_o   (quotient_valid[1]),
    .quotient_o(second_quotient),
    .overflow_o()
  );

  logic                 root_start_q, root_valid;
  logic [RootWidth-1:0] root;
  square_root #(.RootWidth(RootWidth)) u_square_root (
    .clk_i, .rst_i,
    .valid_i   (root_start_q),
    .radicand_i(product[2*RootWidth-1:0]),
    .valid_o   (root_valid),
    .root_o    (root)
  );

  // ---- what follows other registers every clock: a state waits until it has settled ----
  // The product before, and what it is larger than the last by.
  localparam int unsigned KeptWidth = 52;
  logic        [   KeptWidth-1:0] kept_q;
  logic signed [   KeptWidth-1:0] difference_q;
  logic signed [            35:0] numerator_q;
  logic        [            35:0] magnitude_q;  // of it
  always_ff @(posedge clk_i) begin
    if (product_valid) begin
      kept_q       <= product[KeptWidth-1:0];
      difference_q <= kept_q - product[KeptWidth-1:0];
    end
    magnitude_q <= numerator_q[35] ? unsigned'(-numerator_q) : unsigned'(numerator_q);
  end

  // Limits of the width.
  always_ff @(posedge clk_i) begin
    least_q <= begin_q[17:12] == '0 ? LeastScale : begin_q >> 1;
    most_q  <= begin_q[17] ? '1 : begin_q << 1;
  end

  // The place that the fit starts from, within the span.
  logic signed [PositionWidth+1:0] start_place_q;
  logic                            start_below_q, start_inside_q;
  localparam int unsigned StartPixelWidth = PositionWidth + 1 - vrscan_pkg::PositionFraction;
  always_ff @(posedge clk_i) begin
    start_place_q <= (PositionWidth + 2)'(position_q)
        - ((PositionWidth + 2)'(first_q) <<< vrscan_pkg::PositionFraction);
    start_below_q  <= start_place_q[PositionWidth+1];
    start_inside_q <= start_place_q[PositionWidth+1:vrscan_pkg::PositionFraction]
                      < (StartPixelWidth + 1)'(Span);
    started_q      <= start_below_q ? '0
                      : start_inside_q ? 24'(unsigned'(start_place_q)) << 4 : LastPlace;
    minus_place_q  <= -signed'({1'b0, place_q});
  end

  // ---- the lean of the middle, 8 fraction bits, and what grains add to the variance ----
  localparam int unsigned LeanWidth  = 12;
  localparam int unsigned SlopeWidth = 23;
  localparam logic        [   LeanWidth-1:0] MostLean   = LeanWidth'(8 << 8);
  localparam logic        [            16:0] PriorLean  = 17'(3 << 8);  // two lines of 3/2
  localparam logic signed [ QuotientWidth:0] FineLean   = 27'sd600;  // 5/2 of 15/16
  localparam logic signed [ QuotientWidth:0] MostGrains = 27'(7 << 8);
  localparam int unsigned OwnWidth = 13;
  localparam logic        [    OwnWidth-1:0] CoarseGrains = OwnWidth'(2 << 8);
  localparam logic        [    OwnWidth-1:0] OwnLean      = OwnWidth'(12 << 8);
  localparam logic        [    OwnWidth-1:0] MostOwn      = OwnWidth'(31 << 8);
  // Of the last lines; the highest bit says whether there is one.
  logic        [   LeanWidth:0] lean_mem [vrscan_pkg::SpeckleDepth];
  logic        [   LeanWidth:0] line_lean_q, oldest_lean_q;
  logic        [ LeanWidth-1:0] limited_lean;
  logic        [$clog2(vrscan_pkg::SpeckleDepth)-1:0] lean_at_q;
  logic                         lean_full_q, lean_push;
  logic        [          16:0] leans_q;
  logic        [           5:0] fits_q;
  logic        [          24:0] other_q;  // sum of u**2 of what is turned against the fit
  logic        [QuotientWidth-1:0] free_q;
  logic signed [          28:0] b1_middle, b1_whole;
  logic signed [SlopeWidth-1:0] turn_q;  // of numerator_q
  logic signed [QuotientWidth:0] more_q;
  logic        [  OwnWidth-1:0] own_lean_q, common_q, grains_q;  // 8 fraction bits
  logic                         by_itself_q;
  logic        [          38:0] grown_q;
  logic        [          33:0] grown_limited;
  assign b1_middle = 29'(b1_middle_q >>> 15);
  assign b1_whole  = 29'(b1_whole_q >>> 15);
  assign grown_limited = |grown_q[38:34] ? '1 : grown_q[33:0];
  assign limited_lean = second_quotient > QuotientWidth'(MostLean)
                        ? MostLean : second_quotient[LeanWidth-1:0];
  always_ff @(posedge clk_i) begin
    other_q <= foot_q && pass_q != 2'd1 ? s2_whole_q : s2_middle_q;
    free_q  <= first_quotient > QuotientWidth'(other_q) ? first_quotient - QuotientWidth'(other_q)
               : QuotientWidth'(other_q) - first_quotient;
    turn_q  <= numerator_q[35:SlopeWidth-1] == '0 || numerator_q[35:SlopeWidth-1] == '1
               ? numerator_q[SlopeWidth-1:0]
               : signed'({numerator_q[35], {(SlopeWidth - 1){!numerator_q[35]}}});
    // 5/2 of the mean lean, of which the quotient is four times.
    more_q      <= signed'((27'(first_quotient) >> 1) + (27'(first_quotient) >> 3)) - FineLean;
    common_q    <= more_q[QuotientWidth] ? '0
                   : more_q > MostGrains ? OwnWidth'(MostGrains) : unsigned'(more_q[OwnWidth-1:0]);
    by_itself_q <= foot_q || (own_lean_q > OwnLean && own_lean_q > common_q);
    grains_q    <= by_itself_q ? own_lean_q : common_q;
    grown_q     <= 39'(correlated_q) + 39'(product[47:10]);
  end

  // ---- the foot: leans of the second pass with their signs, and where a fit ends ----
  localparam logic [16:0] MoreLean = 17'(8 << 8);
  // Of the last lines, where lean_mem has them: whether there is one, its sign and its size.
  logic        [LeanWidth+1:0] foot_mem [vrscan_pkg::SpeckleDepth];
  logic        [LeanWidth+1:0] oldest_foot_q, line_foot, foot_change;
  logic        [LeanWidth-1:0] foot_lean_q;
  logic                        foot_drop, foot_push;
  logic signed [         17:0] turned_q;
  logic        [         16:0] feet_q, turned_size_q;
  logic        [          5:0] clear_q;  // lines without a saturated pixel
  logic        [         20:0] more_feet, all_feet_q;
  logic                        told_q, large_q;
  // Of the pass that runs: whether a fit ends before the window, and where u**2 is 2.
  logic                        foot_q, large_foot_q;
  logic                        clear_line_q;
  assign line_foot   = {whole_q, numerator_q[35], foot_lean_q};
  assign more_feet   = 21'(feet_q) + 21'(MoreLean);
  assign foot_change = foot_drop ? oldest_foot_q : line_foot;
  always_ff @(posedge clk_i) begin
    turned_size_q <= turned_q[17] ? unsigned'(-turned_q[16:0]) : unsigned'(turned_q[16:0]);
    all_feet_q    <= more_feet + (more_feet << 2);
    told_q        <= {1'b0, turned_size_q, 3'd0} >= all_feet_q;
    large_q       <= turned_size_q >= {1'b0, clear_q, 10'd0};
    oldest_foot_q <= lean_full_q ? foot_mem[lean_at_q] : '0;
    if (foot_push) foot_mem[lean_at_q] <= line_foot;
    else if (foot_drop) foot_mem[lean_at_q] <= '0;
    if (foot_push || foot_drop) begin
      turned_q <= foot_change[LeanWidth] ^ foot_drop ? turned_q - 18'(foot_change[LeanWidth-1:0])
                  : turned_q + 18'(foot_change[LeanWidth-1:0]);
      feet_q   <= foot_drop ? feet_q - 17'(foot_change[LeanWidth-1:0])
                  : feet_q + 17'(foot_change[LeanWidth-1:0]);
      clear_q  <= foot_drop ? clear_q - 6'(foot_change[LeanWidth+1])
                  : clear_q + 6'(foot_change[LeanWidth+1]);
    end
    if (foot_push) clear_line_q <= whole_q;
    if (run_start_q) begin
      foot_q       <= told_q && (pass_q == 2'd1 || (pass_q[1] && clear_line_q));
      large_foot_q <= large_q;
    end
    if (rst_i) begin
      turned_q <= '0;
      feet_q   <= '0;
      clear_q  <= '0;
    end
  end

  // The variance at the top, and with its neighbours' share of the speckle.
  logic [39:0] line_noise_q, all_variance_q;
  logic [34:0] with_correlation_q;
  logic [33:0] correlated_q;
  logic [17:0] no_dark_q;
  always_ff @(posedge clk_i) begin
    line_noise_q       <= 40'(dark_q) + 40'(shot_q);
    all_variance_q     <= line_noise_q + 40'(speckle_part_q);
    total_q            <= |all_variance_q[39:34] ? '1
                          : all_variance_q == '0 ? 34'd1 : all_variance_q[33:0];
    with_correlation_q <= 35'(total_q) + (35'(speckle_part_q) >> 2);
    correlated_q       <= with_correlation_q[34] ? '1 : with_correlation_q[33:0];
    // What neither noise has is the speckle's share.
    no_dark_q          <= 18'(1 << ShareFraction) - alpha_q;
    gamma_q            <= no_dark_q < beta_q ? '0 : no_dark_q - beta_q;
  end

  // The steps, limited.
  logic               move_negative_q, stretch_negative_q, rise_negative_q;
  // A negative one is inverted here, and gets its 1 with its sign.
  logic        [17:0] move_size_q;
  logic        [12:0] stretch_size_q;
  logic signed [18:0] move_q;
  logic signed [13:0] stretch_q;
  logic signed [25:0] stepped_place_q;
  logic signed [20:0] stepped_scale_q;
  logic               narrow_q, wide_q, high_q;
  // The amplitude moves by half of itself downwards at most, and doubles at most.
  logic        [19:0] most_rise_q, rise_q;
  logic        [20:0] stepped_amplitude_q;
  always_ff @(posedge clk_i) begin
    move_size_q    <= (|first_quotient[QuotientWidth-1:17]
                       ? 18'(1 << 17) : {1'b0, first_quotient[16:0]}) ^ {18{move_negative_q}};
    stretch_size_q <= (second_quotient > MostStretch
                       ? 13'(MostStretch) : second_quotient[12:0]) ^ {13{stretch_negative_q}};
    move_q         <= signed'({move_negative_q, move_size_q} + 19'(move_negative_q));
    stretch_q      <= signed'({stretch_negative_q, stretch_size_q} + 14'(stretch_negative_q));
    narrow_q       <= stepped_scale_q < 21'(signed'({1'b0, least_q}));
    wide_q         <= stepped_scale_q > 21'(signed'({1'b0, most_q}));
    most_rise_q    <= rise_negative_q ? amplitude_q >> 1 : amplitude_q;
    high_q         <= first_quotient > QuotientWidth'(most_rise_q);
    rise_q         <= (high_q ? most_rise_q : first_quotient[19:0]) ^ {20{rise_negative_q}};
    stepped_amplitude_q <= 21'(({1'b0, amplitude_q, 1'b1}
                                + {rise_negative_q, rise_q, rise_negative_q}) >> 1);
  end

  // Roughness: what the differences have above what noise makes of them, at most 3/8 of a weight.
  logic        [23:0] normal_q;  // what is lifted until its highest bit is set
  logic        [12:0] light_q;
  logic        [27:0] factor_q;
  logic        [ 7:0] above_three_q;
  logic        [ 9:0] freedom_q;  // five times the degrees of freedom
  logic               uneven_q;  // the differences are above four times what noise makes
  logic               jump_q;  // so is the line's own speckle above twice the steadied
  logic signed [54:0] rough_excess;
  logic signed [56:0] lifted_excess_q, beyond_q;
  logic        [40:0] weight_q;
  logic        [39:0] most_rough_q;
  logic signed [48:0] line_rough_q;
  logic        [33:0] area_q;
  logic               excess_negative, clip;
  assign rough_excess    = signed'(55'({rough_q, 12'd0})) - 55'(product >>> 13);
  assign excess_negative = lifted_excess_q[56];
  assign clip            = beyond_q[56] == excess_negative;
  always_ff @(posedge clk_i) begin
    light_q       <= |area_q[33:29] ? '1 : area_q[28:16];
    above_three_q <= pixels_q < 8'd3 ? '0 : pixels_q - 8'd3;
    freedom_q     <= 10'(above_three_q) + (10'(above_three_q) << 2);
    factor_q      <= pass_q != 2'd1 ? 28'(freedom_q)
                     : |differences_noise_q[36:32] ? '1 : differences_noise_q[31:4];
    most_rough_q  <= 40'(weight_q >> 2) + 40'(weight_q >> 3);
    // A one below makes a negation of an inversion.
    beyond_q      <= 57'(({lifted_excess_q, 1'b1}
                          + ({9'd0, most_rough_q, 9'd0} ^ {58{!excess_negative}})) >> 1);
    jump_q        <= uneven_q && second_quotient[QuotientWidth-1:20] == '0
                     && second_quotient[19:0] > {first_quotient[18:0], 1'b0};
  end

  // The last lines, and their sums with what is assumed before any.
  localparam logic [$clog2(vrscan_pkg::SpeckleDepth)-1:0] HistoryStep = 1;
  logic        [89:0] history_mem [vrscan_pkg::SpeckleDepth];
  logic signed [48:0] oldest_rough_q;
  logic        [40:0] oldest_weight_q;
  logic        [$clog2(vrscan_pkg::SpeckleDepth)-1:0] history_at_q;
  logic               history_full_q, changed_q;
  logic signed [49:0] rough_change_q;
  logic signed [41:0] weight_change_q;
  logic signed [53:0] roughness_q;
  logic        [45:0] weights_q;

  // What the fit has found, px, PositionFraction bits, where a line ends, and whether it stands.
  localparam int unsigned FoundWidth = FirstWidth + vrscan_pkg::PositionFraction + 1;
  localparam logic signed [FoundWidth-1:0] LineEnd =
      FoundWidth'(LineLength << vrscan_pkg::PositionFraction);
  logic signed [FoundWidth-1:0] fit_place_q, margin_q, last_q;  // of a spot that no end cuts
  logic        [38:0] chi_limit_q;
  logic signed [24:0] moved_q;
  logic        [23:0] reach_q;
  logic        [40:0] mixed_limit_q;  // three times the limit
  logic        [39:0] close_limit_q;  // three halves of it
  logic               chi_close_q, close_q;
  logic               chi_small_q, enough_q, unclipped_q, whole_q, on_line_q, near_q, within_q;
  logic               chi_large_q, eligible_q, inner_q, plain_q, mixed_q;
  // Of a fit that does not stand, twice as much.
  logic [QuotientWidth:0]            wide_spread;
  logic [vrscan_pkg::SigmaWidth-1:0] fit_spread_q;
  logic                              larger_q;
  assign wide_spread = within_q ? {1'b0, first_quotient} : {first_quotient, 1'b0};
  always_ff @(posedge clk_i) begin
    fit_place_q <= (FoundWidth'(first_q) <<< vrscan_pkg::PositionFraction)
                   + FoundWidth'(signed'({1'b0, (25'(place_q) + 25'(1 << 3)) >> 4}));
    on_line_q   <= fit_place_q >= 0 && fit_place_q < LineEnd;
    margin_q    <= FoundWidth'({scale_q, 1'b0});
    last_q      <= LineEnd - margin_q;
    inner_q     <= fit_place_q >= margin_q && fit_place_q < last_q;
    moved_q     <= signed'({1'b0, place_q}) - signed'({1'b0, started_q});
    reach_q     <= (24'(begin_q) << 3) + (24'(begin_q) << 1);
    // A negative one's inversion is one less than it is far.
    near_q      <= {moved_q[23:0] ^ {24{moved_q[24]}}, moved_q[24]} <= {reach_q, 1'b0};
    chi_small_q <= chi_q <= 44'(signed'({1'b0, chi_limit_q}));
    mixed_limit_q <= 41'({chi_limit_q, 1'b0}) + 41'(chi_limit_q);
    chi_large_q <= chi_q > 44'(signed'({1'b0, mixed_limit_q}));
    close_limit_q <= 40'(chi_limit_q) + (40'(chi_limit_q) >> 1);
    chi_close_q   <= chi_q <= 44'(signed'({1'b0, close_limit_q}));
    enough_q    <= pixels_q >= 8'd4;
    unclipped_q <= (11'(clipped_q) << 3) <= 11'(pixels_q) + 11'(clipped_q);
    whole_q     <= clipped_q == '0;
    fit_spread_q <= |wide_spread[QuotientWidth:vrscan_pkg::SigmaWidth]
                    ? '1 : wide_spread[vrscan_pkg::SigmaWidth-1:0];
    larger_q    <= fit_spread_q > spread_q;
  end

  // ---- factors ----
  logic        [20:0] slope_ln4_q;  // amplitude times 2 ln 2
  logic        [33:0] determinant_q;
  logic        [29:0] divisor_q;
  logic signed [21:0] lifted_q;
  logic signed [FactorWidth-1:0] operand_q;  // what a state has put there
  always_ff @(posedge clk_i) begin
    unique case (a_select_q)
      A_SIGMA:       a_q <= FactorWidth'(sigma_q);
      A_SLOPE:       a_q <= FactorWidth'(slope_q);
      A_DEVIATION:   a_q <= FactorWidth'(deviation_q);
      A_GAIN:        a_q <= FactorWidth'(gain_q);
      A_AMPLITUDE:   a_q <= FactorWidth'(amplitude_q);
      A_AREA:        a_q <= FactorWidth'(area_q);
      A_PLACE:       a_q <= FactorWidth'(minus_place_q);
      A_TOTAL:       a_q <= FactorWidth'(total_q);
      A_QUADS:       a_q <= FactorWidth'({quads_q, 2'd0});
      A_S0:          a_q <= FactorWidth'(s0);
      A_S2:          a_q <= FactorWidth'(s2_q);
      A_DETERMINANT: a_q <= FactorWidth'(determinant_q);
      A_STRETCH:     a_q <= FactorWidth'(stretch_q);
      A_MOVE:        a_q <= FactorWidth'(move_q);
      A_CORRELATED:  a_q <= FactorWidth'(correlated_q);
      A_ROOT:        a_q <= FactorWidth'(root);
      default:       a_q <= operand_q;
    endcase
    unique case (b_select_q)
      B_SIGMA_TO_SCALE: b_q <= signed'(SigmaToScale);
      // Half a span in half pixels, and half a pixel less where the window's middle is one.
      B_HALF_SPAN:      b_q <= -(FactorWidth'(Span)) + FactorWidth'(!width_q[0]);
      B_DEVIATION:      b_q <= FactorWidth'(deviation_q);
      B_AMPLITUDE:      b_q <= FactorWidth'(amplitude_q);
      B_SPECKLE:        b_q <= FactorWidth'(speckle_q);
      B_STEP:           b_q <= FactorWidth'(step_q);
      B_FACTOR:         b_q <= FactorWidth'(factor_q);
      B_LIGHT:          b_q <= FactorWidth'(light_q);
      B_LN4:            b_q <= signed'(Ln4);
      B_S2:             b_q <= FactorWidth'(s2_q);
      B_S4:             b_q <= FactorWidth'(s4);
      B_B0:             b_q <= FactorWidth'(b0_q);
      B_B2:             b_q <= FactorWidth'(b2);
      B_MIDDLE:         b_q <= FactorWidth'(s2_middle_q);
      B_SLOPE:          b_q <= FactorWidth'(slope_ln4_q);
      B_SCALE:          b_q <= FactorWidth'(scale_q);
      B_LIFTED:         b_q <= FactorWidth'(lifted_q);
      default:          b_q <= operand_q;
    endcase
    multiply_start_q <= issue_q;
    products_q       <= products_q + 3'(issue_q) - 3'(product_valid);
    if (rst_i) begin
      multiply_start_q <= 1'b0;
      products_q       <= '0;
    end
  end

  // ---- control ----
  // States that end in _IN take the next product, the others name one or wait.
  typedef enum logic [6:0] {
    IDLE, LEVEL, LIFT, BEGIN, SCALES, DARK, SHOT, AREA, RAMP_IN, DARK_IN, SHOT_IN, AREA_IN, OWN,
    OWN_IN, VARIANCE, TOTAL, SHARE, ORIGIN, ORIGIN_IN, RUN,
    MADE, LIGHT, MADE_IN, LIGHT_IN, WEIGHT, WEIGHT_IN, NOISE, MOST, EXCEED, CLIP, HISTORY, CHANGE,
    STEADY, SPECKLE,
    FOOT, FOOT_SQUARE, FOOT_SHARE, FOOT_OWN_IN, FOOT_SQUARE_IN, FOOT_SHARE_IN, FOOT_TURN,
    FOOT_SLOPE, FOOT_PUSH,
    SLOPE, FOURTH, SECOND, CURVE, DROP, SLOPE_IN, FOURTH_IN, SECOND_IN, CURVE_IN, DROP_IN, EXCESS,
    DIVISOR_IN, DETERMINANT_IN, STRETCH, MOVE, WIDEN, STRETCH_IN, MOVE_IN, WIDEN_IN, CLAMP, STEP,
    REST_IN, REST, RISE, LIMIT, RAISE, AMPLITUDE,
    LEAN, CHI_IN, LEAN_IN, FREE, FREE_IN, LEANS, PUSH, MEAN, GRAINS, SETTLE, ADDED, OWN_ADDED,
    ADDED_IN, MIXED, ROOT, MIXED_IN, ROOT_IN, ROOTED, SPREAD_IN, JUDGE, DONE
  } state_e;
  // From 32 states on Yosys would number them, and knowing the state would take half a clock.
  (* fsm_encoding = "one-hot" *)
  state_e state_q;
  logic [6:0] steps_q;  // of a state that lasts some clocks
  logic       settled;
  assign settled = steps_q == '0;
  localparam logic [6:0] Rest = 7'd93;  // clocks that a line without a spot waits
  // A line without a spot takes part, too.
  assign lean_push = state_q == PUSH || (state_q == HISTORY && !measured_q);
  // The oldest foot goes with a line's first clocks, its own comes where it is known.
  assign foot_drop = state_q == LEVEL || (state_q == HISTORY && !measured_q);
  assign foot_push = state_q == FOOT_PUSH;

  logic run_start_q, run_done, loading_q;

  always_ff @(posedge clk_i) begin
    issue_q        <= 1'b0;
    divide_start_q <= '0;
    root_start_q   <= 1'b0;
    run_start_q    <= 1'b0;
    valid_o        <= 1'b0;
    changed_q      <= 1'b0;
    dividing_q     <= (dividing_q | divide_start_q) & ~quotient_valid;
    if (!settled) steps_q <= steps_q - 7'd1;
    deviation_q    <= noise_q[23:7];
    if (changed_q) begin
      roughness_q <= roughness_q + 54'(rough_change_q);
      weights_q   <= weights_q + 46'(weight_change_q);
    end
    oldest_lean_q <= lean_full_q ? lean_mem[lean_at_q] : '0;
    if (lean_push) begin
      lean_mem[lean_at_q] <= line_lean_q;
      lean_at_q           <= lean_at_q + HistoryStep;
      if (lean_at_q == '1) lean_full_q <= 1'b1;
      leans_q <= leans_q + 17'(line_lean_q[LeanWidth-1:0]) - 17'(oldest_lean_q[LeanWidth-1:0]);
      fits_q  <= fits_q + 6'(line_lean_q[LeanWidth]) - 6'(oldest_lean_q[LeanWidth]);
    end
    oldest_rough_q  <= '0;
    oldest_weight_q <= '0;
    if (history_full_q) {oldest_rough_q, oldest_weight_q} <= history_mem[history_at_q];
    unique case (state_q)
      IDLE: if (valid_i) begin
        measured_q   <= measured_i;
        left_q       <= left_i;
        width_q      <= width_i;
        slope_q      <= slope_i;
        position_q   <= position_i;
        spread_q     <= spread_i;
        sigma_q      <= sigma_i;
        background_q <= background_i;
        noise_q      <= noise_i;
        full_q       <= CountWidth'(maximum_i) << CountShift;
        issue_q      <= measured_i;
        a_select_q   <= A_SIGMA;
        b_select_q   <= B_SIGMA_TO_SCALE;
        line_rough_q <= '0;
        weight_q     <= '0;
        line_lean_q  <= '0;
        pass_q       <= '0;
        state_q      <= measured_i ? LEVEL : HISTORY;
      end
      LEVEL: begin
        first_q  <= FirstWidth'(left_q) + FirstWidth'(width_q[7:1]) - FirstWidth'(Span / 2);
        normal_q <= full_q - background_q;
        if (noise_q < NoiseFloor) noise_q <= NoiseFloor;
        gain_q   <= 30'(kappa_i);
        lift_q   <= '0;
        steps_q  <= 7'd22;
        state_q  <= LIFT;
      end
      // What does not fit is all ones, which stay.
      LIFT: begin
        if (!normal_q[23]) begin
          normal_q <= normal_q << 1;
          noise_q  <= noise_q[23] ? '1 : noise_q << 1;
          gain_q   <= gain_q[29] ? '1 : gain_q << 1;
          lift_q   <= lift_q + 5'd1;
        end
        if (settled && multiplied) state_q <= BEGIN;
      end
      BEGIN: begin
        begin_q    <= |product[30:28] ? '1
                      : product[27:21] == '0 ? LeastScale : unsigned'(product[27:10]);
        issue_q    <= 1'b1;
        a_select_q <= A_SLOPE;
        b_select_q <= B_HALF_SPAN;
        state_q    <= SCALES;
      end
      SCALES: begin
        scale_q     <= begin_q;
        place_q     <= started_q;
        amplitude_q <= FirstAmplitude;
        speckle_q   <= FirstSpeckle;
        state_q     <= DARK;
      end
      DARK: begin
        issue_q           <= 1'b1;
        a_select_q        <= A_DEVIATION;
        b_select_q        <= B_DEVIATION;
        second_dividend_q <= DividendWidth'(OneStep);
        second_divisor_q  <= DivisorWidth'(scale_q);
        divide_start_q[1] <= 1'b1;
        state_q           <= SHOT;
      end

      // The variance at the top, and each term's share of it.
      SHOT: begin
        issue_q    <= 1'b1;
        a_select_q <= A_GAIN;
        b_select_q <= B_AMPLITUDE;
        state_q    <= AREA;
      end
      AREA: begin
        issue_q    <= 1'b1;
        a_select_q <= A_AMPLITUDE;
        b_select_q <= B_AMPLITUDE;
        state_q    <= pass_q == '0 ? RAMP_IN : SHOT_IN;
      end
      RAMP_IN: if (product_valid) begin
        ramp_q  <= LineWidth'(product >>> 1) + LineWidth'({background_q, 4'd0});
        state_q <= DARK_IN;
      end
      DARK_IN: if (product_valid) begin
        dark_q  <= product[33:0];
        state_q <= SHOT_IN;
      end
      SHOT_IN: if (product_valid) begin
        shot_q  <= product[49:11];
        state_q <= AREA_IN;
      end
      AREA_IN: if (product_valid) begin
        area_q  <= product[39:6];
        state_q <= OWN;
      end
      OWN: begin
        issue_q    <= 1'b1;
        a_select_q <= A_AREA;
        b_select_q <= B_SPECKLE;
        state_q    <= OWN_IN;
      end
      OWN_IN: if (product_valid) begin
        speckle_part_q <= |product[53:48] ? '1 : product[47:14];
        state_q        <= VARIANCE;
      end
      VARIANCE: state_q <= TOTAL;
      TOTAL: if (divided) begin
        step_q  <= second_quotient;
        state_q <= SHARE;
      end
      SHARE: begin
        first_dividend_q  <= DividendWidth'(dark_q) << ShareFraction;
        first_divisor_q   <= DivisorWidth'(total_q);
        second_dividend_q <= DividendWidth'(shot_q) << ShareFraction;
        second_divisor_q  <= DivisorWidth'(total_q);
        divide_start_q    <= '1;
        state_q           <= ORIGIN;
      end
      // The first pixel's place in units of u.
      ORIGIN: begin
        issue_q    <= 1'b1;
        a_select_q <= A_PLACE;
        b_select_q <= B_STEP;
        state_q    <= ORIGIN_IN;
      end
      ORIGIN_IN: begin
        // The second pass has the shares of the first.
        if (pass_q != 2'd1) begin
          alpha_q <= |first_quotient[QuotientWidth-1:ShareFraction]
                     ? 18'(1 << ShareFraction) : {1'b0, first_quotient[ShareFraction-1:0]};
          beta_q  <= |second_quotient[QuotientWidth-1:ShareFraction]
                     ? 18'(1 << ShareFraction) : {1'b0, second_quotient[ShareFraction-1:0]};
        end
        if (multiplied && divided) begin
          run_start_q <= 1'b1;
          state_q     <= RUN;
        end
      end
      RUN: if (run_done) state_q <= pass_q == 2'd1 ? MADE : SLOPE;

      // The speckle of this line and of those before.
      MADE: begin
        issue_q    <= 1'b1;
        a_select_q <= A_TOTAL;
        b_select_q <= B_FACTOR;
        state_q    <= LIGHT;
      end
      LIGHT: begin
        issue_q    <= 1'b1;
        a_select_q <= A_AMPLITUDE;
        b_select_q <= B_AMPLITUDE;
        state_q    <= MADE_IN;
      end
      MADE_IN: if (product_valid) begin
        lifted_excess_q <= 57'(rough_excess) >>> 14;
        uneven_q        <= 45'(rough_q) > 45'(product >>> 23);
        state_q         <= LIGHT_IN;
      end
      LIGHT_IN: if (product_valid) begin
        area_q  <= product[39:6];
        state_q <= WEIGHT;
      end
      WEIGHT: begin
        issue_q    <= 1'b1;
        a_select_q <= A_QUADS;
        b_select_q <= B_LIGHT;
        normal_q   <= {|line_noise_q[39:33], line_noise_q[32:10]};
        state_q    <= WEIGHT_IN;
      end
      WEIGHT_IN: begin
        steps_q <= 7'd15;
        if (product_valid) begin
          weight_q <= 41'(product[24:0]);
          state_q  <= NOISE;
        end
      end
      NOISE: begin
        if (!normal_q[23]) begin
          normal_q        <= normal_q << 1;
          lifted_excess_q <= lifted_excess_q <<< 1;
          weight_q        <= weight_q << 1;
        end
        if (settled) state_q <= MOST;
      end
      MOST: state_q <= EXCEED;
      EXCEED: state_q <= CLIP;
      CLIP: begin
        line_rough_q <= 49'(lifted_excess_q - (clip ? beyond_q : '0));
        state_q      <= HISTORY;
      end
      HISTORY: begin
        rough_change_q  <= 50'(line_rough_q) - 50'(oldest_rough_q);
        weight_change_q <= signed'(42'(weight_q)) - signed'(42'(oldest_weight_q));
        changed_q       <= 1'b1;
        history_mem[history_at_q] <= {unsigned'(line_rough_q), weight_q};
        history_at_q    <= history_at_q + HistoryStep;
        if (history_at_q == '1) history_full_q <= 1'b1;
        within_q        <= 1'b0;
        // The line before may have ended late, and what takes the point needs its time.
        if (!measured_q) steps_q <= Rest;
        state_q         <= measured_q ? CHANGE : DONE;
      end
      CHANGE: state_q <= STEADY;
      STEADY: begin
        first_dividend_q  <= roughness_q[53] ? '0 : {unsigned'(roughness_q[52:0]), 4'd0};
        first_divisor_q   <= DivisorWidth'(weights_q >> 8);
        second_dividend_q <= line_rough_q[48] ? '0 : DividendWidth'(line_rough_q[47:0]) << 4;
        second_divisor_q  <= DivisorWidth'(weight_q >> 8);
        divide_start_q    <= '1;
        state_q           <= SPECKLE;
      end
      SPECKLE: if (divided) begin
        // A line's roughness is limited to 3/8 of its weight, so this fits.
        speckle_q <= jump_q ? second_quotient[19:0] : first_quotient[19:0];
        state_q   <= FOOT;
      end

      // The slope of the middle without its share of the whole's, and the variance for it.
      FOOT: begin
        issue_q     <= 1'b1;
        a_select_q  <= A_AREA;
        b_select_q  <= B_SPECKLE;
        numerator_q <= 36'(b1_whole);
        state_q     <= FOOT_SQUARE;
      end
      FOOT_SQUARE: begin
        issue_q         <= 1'b1;
        operand_q       <= FactorWidth'(s2_middle_q);
        a_select_q      <= A_OPERAND;
        b_select_q      <= B_MIDDLE;
        move_negative_q <= numerator_q[35];
        state_q         <= FOOT_SHARE;
      end
      FOOT_SHARE: begin
        issue_q   <= 1'b1;
        operand_q <= FactorWidth'(magnitude_q[28:0]);
        state_q   <= FOOT_OWN_IN;
      end
      FOOT_OWN_IN: if (product_valid) begin
        speckle_part_q <= |product[53:48] ? '1 : product[47:14];
        state_q        <= FOOT_SQUARE_IN;
      end
      FOOT_SQUARE_IN: if (product_valid) begin
        first_dividend_q <= DividendWidth'(product[49:0]);
        first_divisor_q  <= DivisorWidth'(s2_whole_q);
        state_q          <= FOOT_SHARE_IN;
      end
      FOOT_SHARE_IN: if (product_valid) begin
        second_dividend_q <= DividendWidth'(product[53:0]);
        second_divisor_q  <= DivisorWidth'(s2_whole_q);
        divide_start_q    <= '1;
        state_q           <= FOOT_TURN;
      end
      FOOT_TURN: if (divided) begin
        numerator_q <= move_negative_q ? 36'(b1_middle) + 36'(second_quotient)
                       : 36'(b1_middle) - 36'(second_quotient);
        state_q     <= FOOT_SLOPE;
      end
      FOOT_SLOPE: state_q <= LEAN;
      FOOT_PUSH: state_q <= SLOPE;

      // The step: slope to place, curvature to width, the rest to amplitude.
      SLOPE: begin
        issue_q     <= 1'b1;
        a_select_q  <= A_AMPLITUDE;
        b_select_q  <= B_LN4;
        numerator_q <= 36'(b1);
        state_q     <= FOURTH;
      end
      FOURTH: begin
        issue_q         <= 1'b1;
        a_select_q      <= A_S0;
        b_select_q      <= B_S4;
        move_negative_q <= numerator_q[35];
        state_q         <= SECOND;
      end
      SECOND: begin
        issue_q    <= 1'b1;
        a_select_q <= A_S2;
        b_select_q <= B_S2;
        state_q    <= CURVE;
      end
      CURVE: begin
        issue_q          <= 1'b1;
        a_select_q       <= A_S0;
        b_select_q       <= B_B2;
        first_dividend_q <= DividendWidth'(magnitude_q[28:0]) << 17;
        state_q          <= DROP;
      end
      DROP: begin
        issue_q    <= 1'b1;
        a_select_q <= A_S2;
        b_select_q <= B_B0;
        state_q    <= SLOPE_IN;
      end
      SLOPE_IN: if (product_valid) begin
        slope_ln4_q <= product[33:13];
        state_q     <= FOURTH_IN;
      end
      FOURTH_IN: if (product_valid) state_q <= SECOND_IN;
      SECOND_IN: if (product_valid) state_q <= CURVE_IN;
      CURVE_IN: if (product_valid) begin
        issue_q       <= 1'b1;
        a_select_q    <= A_S2;
        b_select_q    <= B_SLOPE;
        determinant_q <= difference_q[KeptWidth-1] ? '0 : unsigned'(difference_q[49:16]);
        state_q       <= DROP_IN;
      end
      DROP_IN: if (product_valid) begin
        issue_q    <= 1'b1;
        a_select_q <= A_DETERMINANT;
        b_select_q <= B_SLOPE;
        state_q    <= EXCESS;
      end
      EXCESS: begin
        issue_q     <= 1'b1;
        operand_q   <= FactorWidth'(other_q);
        a_select_q  <= A_OPERAND;
        b_select_q  <= B_OPERAND;
        numerator_q <= 36'(difference_q >>> 16);
        state_q     <= DIVISOR_IN;
      end
      DIVISOR_IN: if (product_valid) begin
        divisor_q <= product[46:17];
        state_q   <= DETERMINANT_IN;
      end
      DETERMINANT_IN: if (product_valid) begin
        first_divisor_q    <= DivisorWidth'(divisor_q);
        second_dividend_q  <= DividendWidth'(magnitude_q) << 14;
        second_divisor_q   <= product[HeightFraction+:DivisorWidth];
        stretch_negative_q <= numerator_q[35];
        divide_start_q     <= '1;
        state_q            <= STRETCH;
      end
      STRETCH: if (divided && multiplied) begin
        issue_q    <= 1'b1;
        a_select_q <= A_STRETCH;
        b_select_q <= B_SLOPE;
        // What of the other's sum is not the fit's, for the lean; the product is its square.
        first_dividend_q  <= DividendWidth'(product[49:0]);
        first_divisor_q   <= DivisorWidth'(s2_q);
        divide_start_q[0] <= pass_q == 2'd3;
        state_q           <= MOVE;
      end
      MOVE: begin
        issue_q    <= 1'b1;
        a_select_q <= A_MOVE;
        b_select_q <= B_SCALE;
        state_q    <= WIDEN;
      end
      WIDEN: begin
        issue_q    <= 1'b1;
        a_select_q <= A_STRETCH;
        b_select_q <= B_SCALE;
        state_q    <= STRETCH_IN;
      end
      STRETCH_IN: if (product_valid) begin
        lifted_q <= 22'(product >>> 14);
        state_q  <= MOVE_IN;
      end
      // Behind the last pass nothing needs an amplitude and a step.
      MOVE_IN: if (product_valid) begin
        issue_q         <= pass_q != 2'd3;
        a_select_q      <= A_S2;
        b_select_q      <= B_LIFTED;
        stepped_place_q <= 26'(signed'({1'b0, place_q})) + 26'(product >>> 13);
        state_q         <= WIDEN_IN;
      end
      WIDEN_IN: if (product_valid) begin
        stepped_scale_q <= 21'(signed'({1'b0, scale_q})) + 21'(product >>> 14);
        state_q         <= CLAMP;
      end
      CLAMP: begin
        place_q <= stepped_place_q[25] ? '0
                   : stepped_place_q[24:PlaceFraction] >= 9'(Span) ? LastPlace
                   : unsigned'(stepped_place_q[23:0]);
        numerator_q <= foot_q ? 36'(b1_whole) : 36'(b1_middle);
        state_q     <= STEP;
      end
      STEP: begin
        scale_q    <= narrow_q ? least_q : wide_q ? most_q : unsigned'(stepped_scale_q[17:0]);
        // Behind the last pass, the limit of chi squared.
        issue_q    <= pass_q == 2'd3;
        a_select_q <= A_TOTAL;
        b_select_q <= B_FACTOR;
        state_q    <= pass_q == 2'd3 ? LEAN : REST_IN;
      end
      REST_IN: begin
        second_dividend_q <= DividendWidth'(OneStep);
        second_divisor_q  <= DivisorWidth'(scale_q);
        if (product_valid) begin
          divide_start_q[1] <= 1'b1;
          numerator_q       <= 36'(b0_q) - 36'(29'(product >>> HeightFraction));
          state_q           <= REST;
        end
      end
      REST: begin
        rise_negative_q <= numerator_q[35];
        state_q         <= RISE;
      end
      RISE: begin
        first_dividend_q  <= DividendWidth'(magnitude_q[28:0]) << HeightFraction;
        first_divisor_q   <= DivisorWidth'(s0);
        divide_start_q[0] <= 1'b1;
        state_q           <= LIMIT;
      end
      LIMIT: if (divided) begin
        step_q  <= second_quotient;
        state_q <= RAISE;
      end
      RAISE: state_q <= AMPLITUDE;
      AMPLITUDE: begin
        amplitude_q <= stepped_amplitude_q[20] ? '1
                       : stepped_amplitude_q[19:13] == '0 ? LeastAmplitude
                       : stepped_amplitude_q[19:0];
        pass_q      <= pass_q + 2'd1;
        state_q     <= pass_q == '0 ? ORIGIN : SHOT;
      end

      // The standard deviation, and whether the fit stands.
      LEAN: begin
        issue_q    <= 1'b1;
        operand_q  <= FactorWidth'(turn_q);
        a_select_q <= A_OPERAND;
        b_select_q <= B_OPERAND;
        state_q    <= pass_q == 2'd3 ? CHI_IN : LEAN_IN;
      end
      CHI_IN: if (product_valid) begin
        chi_limit_q <= product[44:6];
        state_q     <= LEAN_IN;
      end
      LEAN_IN: if (product_valid) begin
        second_dividend_q <= DividendWidth'(product[44:0]) << 10;
        state_q           <= FREE;
      end
      FREE: if (divided) begin
        issue_q    <= 1'b1;
        operand_q  <= FactorWidth'(free_q);
        a_select_q <= A_CORRELATED;
        b_select_q <= B_OPERAND;
        state_q    <= FREE_IN;
      end
      FREE_IN: if (product_valid) begin
        eligible_q <= enough_q && start_inside_q && on_line_q && near_q && unclipped_q;
        plain_q    <= chi_small_q;
        close_q    <= chi_close_q;
        second_divisor_q  <= |product[59:56] ? '1 : product[55:18];
        divide_start_q[1] <= 1'b1;
        state_q           <= LEANS;
      end
      LEANS: if (divided) begin
        own_lean_q  <= second_quotient > QuotientWidth'(MostOwn)
                       ? MostOwn : second_quotient[OwnWidth-1:0];
        foot_lean_q <= whole_q ? limited_lean : '0;
        if (pass_q == 2'd3 && eligible_q && inner_q && !chi_large_q)
          line_lean_q <= {1'b1, limited_lean};
        state_q <= pass_q == 2'd3 ? PUSH : FOOT_PUSH;
      end
      PUSH: state_q <= MEAN;
      MEAN: begin
        first_dividend_q  <= DividendWidth'({leans_q + PriorLean, 2'd0});
        first_divisor_q   <= DivisorWidth'(fits_q) + DivisorWidth'(2);
        divide_start_q[0] <= 1'b1;
        state_q           <= GRAINS;
      end
      GRAINS: begin
        steps_q <= 7'd1;
        if (divided) state_q <= SETTLE;
      end
      SETTLE: if (settled) state_q <= ADDED;
      // It counts 5/4 times: neighbours share it.  Coarse grains hide from differences.
      // What is common to the lines limits chi squared, a line's own counts in its sigma only.
      ADDED: begin
        issue_q    <= 1'b1;
        operand_q  <= common_q >= CoarseGrains ? FactorWidth'(total_q) :
                      FactorWidth'(speckle_part_q);
        lifted_q   <= (22'(common_q) << 2) + 22'(common_q);
        a_select_q <= A_OPERAND;
        b_select_q <= B_LIFTED;
        state_q    <= OWN_ADDED;
      end
      OWN_ADDED: begin
        issue_q    <= 1'b1;
        operand_q  <= grains_q >= CoarseGrains ? FactorWidth'(total_q) :
                      FactorWidth'(speckle_part_q);
        lifted_q   <= (22'(grains_q) << 2) + 22'(grains_q);
        state_q    <= ADDED_IN;
      end
      ADDED_IN: if (product_valid) state_q <= MIXED;
      MIXED: begin
        issue_q    <= 1'b1;
        operand_q  <= FactorWidth'(grown_limited);
        b_select_q <= B_FACTOR;
        state_q    <= ROOT;
      end
      ROOT: begin
        issue_q    <= 1'b1;
        operand_q  <= FactorWidth'(grown_limited);
        b_select_q <= B_S2;
        state_q    <= MIXED_IN;
      end
      MIXED_IN: if (product_valid) begin
        chi_limit_q <= product[44:6];
        state_q     <= ROOT_IN;
      end
      // The product stays, so the root takes it a clock later.
      ROOT_IN: if (product_valid) begin
        root_start_q <= 1'b1;
        state_q      <= ROOTED;
      end
      ROOTED: if (root_valid) begin
        issue_q    <= 1'b1;
        a_select_q <= A_ROOT;
        b_select_q <= B_SCALE;
        state_q    <= SPREAD_IN;
      end
      SPREAD_IN: if (product_valid) begin
        within_q          <= eligible_q && close_q && chi_small_q
                             && (plain_q || (inner_q && whole_q));
        mixed_q           <= chi_large_q && whole_q;
        first_dividend_q  <= DividendWidth'(product[48:10]);
        divide_start_q[0] <= 1'b1;
        first_divisor_q   <= DivisorWidth'(divisor_q);
        state_q           <= JUDGE;
      end
      JUDGE: if (divided) state_q <= DONE;
      DONE: if (settled) begin
        valid_o    <= 1'b1;
        mixed_o    <= measured_q && mixed_q;
        position_o <= within_q ? PositionWidth'(fit_place_q) : position_q;
        sigma_o    <= measured_q && (within_q || larger_q) ? fit_spread_q : spread_q;
        state_q    <= IDLE;
      end
      default: state_q <= IDLE;
    endcase
    if (rst_i) begin
      state_q        <= IDLE;
      issue_q        <= 1'b0;
      divide_start_q <= '0;
      dividing_q     <= '0;
      root_start_q   <= 1'b0;
      run_start_q    <= 1'b0;
      valid_o        <= 1'b0;
      changed_q      <= 1'b0;
      history_at_q   <= '0;
      history_full_q <= 1'b0;
      roughness_q    <= PriorRoughness;
      weights_q      <= PriorWeight;
      lean_at_q      <= '0;
      lean_full_q    <= 1'b0;
      leans_q        <= '0;
      fits_q         <= '0;
    end
  end

  // ---- the span's pixels, which the first pass follows ----
  (* no_rw_check *)  // a pixel is read long after it is written
  logic [PixelWidth-1:0] pixel_mem [1 << IndexBits];
  logic [ IndexBits-1:0] load_q, load_q2, load_q3;
  logic                  load_valid_q2, load_valid_q3;
  assign reading_o = loading_q;
  always_ff @(posedge clk_i) begin
    if (state_q == IDLE && valid_i) begin
      loading_q    <= measured_i;
      load_q       <= '0;
      read_index_o <= vrscan_pkg::RingWidth'(left_i) + vrscan_pkg::RingWidth'(width_i[7:1])
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
    if (load_valid_q3) pixel_mem[load_q3] <= read_pixel_i;
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
  logic signed [ LineWidth-1:0] u_0, ramp_0;
  always_ff @(posedge clk_i) begin
    if (run_start_q) begin
      index_0   <= '0;
      running_0 <= 1'b1;
      place_0   <= first_q;
      u_0       <= LineWidth'(product >>> PlaceFraction);
      ramp_0    <= ramp_q;
    end else if (running_0) begin
      index_0   <= index_0 + IndexBits'(1);
      running_0 <= index_0 != IndexBits'(Span - 1);
      place_0   <= place_0 + FirstWidth'(1);
      u_0       <= u_0 + LineWidth'(step_q);
      ramp_0    <= ramp_0 + LineWidth'(slope_q);
    end
    if (rst_i) running_0 <= 1'b0;
  end

  // How far the last pixel has come: its sums are complete behind the last stage.
  localparam int unsigned Stages = 30;
  logic [Stages-1:0] running_q;  // from stage 1 on
  always_ff @(posedge clk_i) begin
    running_q <= Stages'({running_q, running_0});
    if (rst_i) running_q <= '0;
  end
  assign run_done = running_q[Stages-1] && !running_q[Stages-2];

  // Heights saturate at 25 bits, of which 18 are kept.  They are lifted by 8 or 16 first, and what
  // does not fit is known before it is shifted.
  localparam int unsigned LevelWidth = 30;
  logic        [PixelWidth-1:0] pixel_1, pixel_2;
  logic                         online_1, online_2, online_3, online_4, online_5;
  logic                         near_1, near_2, near_3, near_4, near_5;
  logic                         clipped_3, clipped_4, clipped_5;
  logic signed [17:0]           u_1, u_2;
  logic signed [LevelWidth-1:0] level_1, level_2, height_3;
  logic                         negative_4, negative_5, negative_6, fits_4, fits_5, fits_6;
  logic        [24:0]           height_4, coarse_5;
  logic signed [35:0]           square_3;
  logic        [22:0]           square_4;
  logic        [19:0]           square_5;
  logic        [17:0]           fine_6;
  logic signed [17:0]           height_7;
  logic        [16:0]           mantissa_6, mantissa_7;
  logic        [ 2:0]           power_6, power_7;
  logic                         inside_6, top_6, middle_6, fit_6;
  logic signed [LineWidth-10:0] u_scaled;
  logic        [LevelWidth-2:8] sign_bits_3;  // whether a bit is not as its sign
  logic        [ 6:0]           sign_bits_5, shifted_5;
  assign u_scaled    = (LineWidth - 9)'(u_0 >>> 9);
  assign sign_bits_3 = height_3[LevelWidth-2:8] ^ {(LevelWidth - 9){height_3[LevelWidth-1]}};
  assign sign_bits_5 = coarse_5[23:17] ^ {7{negative_5}};
  assign shifted_5   = ~(7'h7F >> lift_q[2:0]);
  always_ff @(posedge clk_i) begin
    pixel_1  <= pixel_mem[index_0];
    online_1 <= running_0 && !place_0[FirstWidth-1]
                && place_0 < FirstWidth'(signed'(LineLength));
    near_1   <= running_0 && (u_scaled[LineWidth-10:17] == '0 || u_scaled[LineWidth-10:17] == '1);
    u_1      <= u_scaled[17:0];
    level_1  <= LevelWidth'(ramp_0 >>> (vrscan_pkg::RampFraction - 8));

    pixel_2  <= pixel_1;
    online_2 <= online_1;
    near_2   <= near_1;
    u_2      <= near_1 ? u_1 : '0;
    level_2  <= level_1;

    height_3  <= LevelWidth'({pixel_2, {CountShift{1'b0}}}) - level_2;
    clipped_3 <= vrscan_pkg::AlignedWidth'(pixel_2) >= saturation_level_i;
    online_3  <= online_2;
    near_3    <= near_2;
    square_3  <= u_2 * u_2;

    height_4   <= height_3[24:0];
    negative_4 <= height_3[LevelWidth-1];
    fits_4     <= !(|sign_bits_3[LevelWidth-2:24] || (|lift_q[4:3] && |sign_bits_3[23:16])
                    || (lift_q[4] && |sign_bits_3[15:8]));
    clipped_4  <= clipped_3;
    online_4   <= online_3;
    near_4     <= near_3;
    square_4   <= 23'(square_3 >> 13);

    coarse_5   <= lift_q[4] ? {height_4[8:0], 16'd0}
                  : lift_q[3] ? {height_4[16:0], 8'd0} : height_4;
    negative_5 <= negative_4;
    fits_5     <= fits_4;
    clipped_5  <= clipped_4;
    online_5   <= online_4;
    near_5     <= near_4 && square_4[22:20] == '0;
    square_5   <= square_4[19:0];

    // The table answers in stage 6.
    fine_6     <= 18'((coarse_5 << lift_q[2:0]) >> 7);
    negative_6 <= negative_5;
    fits_6     <= fits_5 && (sign_bits_5 & shifted_5) == '0;
    power_6    <= near_5 ? square_5[19:17] : '0;
    inside_6   <= near_5 && online_5 && !clipped_5;
    top_6      <= near_5 && online_5 && !clipped_5 && square_5 < 20'(23 << 14);
    middle_6   <= near_5 && online_5 && !clipped_5 && square_5[19:18] == '0;
    fit_6      <= near_5 && online_5 && !clipped_5
                  && (!foot_q || square_5[19:18] == '0
                      || (!large_foot_q && square_5[19:17] == 3'd2));

    height_7   <= fits_6 ? signed'(fine_6) : signed'({negative_6, {17{!negative_6}}});
    mantissa_7 <= mantissa_6;
    power_7    <= power_6;
  end

  // The quotient, and beside it the variance in units of that at the top.
  logic signed [17:0] mantissa_8, height_8;
  logic        [17:0] alpha_8, h_8, h_9, h_10, h_11;
  logic        [ 2:0] power_8, power_9, power_10, power_11, power_12, power_13;
  logic signed [35:0] quotient_9, quotient_10;
  logic        [35:0] first_9, first_10;
  logic signed [23:0] quotient_11, excess_12;
  logic        [26:0] linear_11;
  logic signed [17:0] q_13;
  logic        [35:0] low_12, high_12, low_13, high_13;
  logic        [33:0] noise_14;
  logic        [19:0] speckle_14;
  logic        [34:0] variance_15;
  logic        [23:0] noise_15;  // what is above is not told
  always_ff @(posedge clk_i) begin
    mantissa_8 <= signed'(18'(mantissa_7));
    height_8   <= height_7;
    alpha_8    <= alpha_q;  // one without an enable, which the multiplier takes
    h_8        <= 18'((24'(mantissa_7) << power_7) >> 6);
    power_8    <= power_7;

    quotient_9 <= mantissa_8 * height_8;
    first_9    <= 36'(alpha_8) * 36'(h_8);
    h_9        <= h_8;
    power_9    <= power_8;

    quotient_10 <= quotient_9;
    first_10    <= first_9;
    h_10        <= h_9;
    power_10    <= power_9;

    quotient_11 <= 24'((43'(quotient_10) <<< power_10) >>> 19);
    linear_11   <= 27'(first_10 >> 10) + 27'(beta_q);
    h_11        <= h_10;
    power_11    <= power_10;

    excess_12 <= quotient_11 - 24'(amplitude_q[19:3]);
    low_12    <= 36'(linear_11[16:0]) * 36'(h_11);
    high_12   <= 36'(linear_11[26:17]) * 36'(h_11);
    power_12  <= power_11;

    q_13    <= excess_12[23:17] == '0 || excess_12[23:17] == '1
               ? excess_12[17:0] : signed'({excess_12[23], {17{!excess_12[23]}}});
    low_13  <= low_12;
    high_13 <= high_12;
    power_13 <= power_12;

    noise_14   <= 34'((53'(high_13) << 17) + 53'(low_13) >> 10);
    speckle_14 <= 20'(gamma_q) << {power_13 == 3'd7, power_13 == 3'd5 || power_13 == 3'd6};

    noise_15    <= |noise_14[33:24] ? '1 : noise_14[23:0];
    variance_15 <= 35'(noise_14) + 35'(speckle_14);
  end

  // The variance's reciprocal: it is shifted down by 16 or 8, by 4 and by the rest until its highest
  // bit is bit 17, and 8 bits behind that ask the table.
  logic [25:0] scaled_15;
  logic [15:0] coarse_16;
  logic [11:0] finer_17;
  logic [ 1:0] over_16;  // powers of two above 1: sixteens and eights
  logic [ 2:0] over_17;  // and fours
  logic [ 4:0] over_18, over_19;
  logic [ 3:0] over_20;
  logic [ 7:0] index_18;
  logic [15:0] reciprocal_19, reciprocal_20, weight_21;
  logic        keep_20;
  assign scaled_15 = 26'(variance_15 >> 9);
  always_ff @(posedge clk_i) begin
    over_16   <= {|scaled_15[25:24], !(|scaled_15[25:24]) && |scaled_15[23:16]};
    coarse_16 <= |scaled_15[25:24] ? 16'(scaled_15[25:16])
                 : |scaled_15[23:16] ? scaled_15[23:8] : scaled_15[15:0];

    over_17  <= {over_16, |coarse_16[15:12]};
    finer_17 <= |coarse_16[15:12] ? coarse_16[15:4] : coarse_16[11:0];

    over_18  <= {over_17, finer_17[11] || finer_17[10],
                 finer_17[11] || (finer_17[9] && !finer_17[10])};
    index_18 <= finer_17[11] ? finer_17[10:3] : finer_17[10] ? finer_17[9:2]
                : finer_17[9] ? finer_17[8:1] : finer_17[8] ? finer_17[7:0] : '0;

    over_19 <= over_18;

    over_20       <= over_19[3:0];
    keep_20       <= inside_19 && !over_19[4];
    reciprocal_20 <= reciprocal_19;

    weight_21 <= keep_20 ? reciprocal_20 >> over_20 : '0;
  end

  peak_fit_rom u_peak_fit_rom (
    .clk_i,
    .power_index_i     (square_5[16:7]),
    .reciprocal_index_i(index_18),
    .power_entry_o     (mantissa_6),
    .reciprocal_entry_o(reciprocal_19)
  );

  // ---- delays ----
  logic [12:0] inside_delay_q;  // from stage 7
  logic [ 9:0] top_delay_q;  // from stage 7
  logic [21:0] middle_delay_q;  // from stage 7
  logic        inside_19;
  logic        middle_26, middle_28;
  logic [23:0] fit_delay_q;  // from stage 7
  logic        fit_21, fit_25, fit_26, fit_28, fit_29, fit_30;
  assign fit_21 = fit_delay_q[14];
  assign fit_25 = fit_delay_q[18];
  assign fit_26 = fit_delay_q[19];
  assign fit_28 = fit_delay_q[21];
  assign fit_29 = fit_delay_q[22];
  assign fit_30 = fit_delay_q[23];
  assign inside_19 = inside_delay_q[12];
  assign middle_26 = middle_delay_q[19];
  assign middle_28 = middle_delay_q[21];
  localparam int unsigned UDelay = 24;  // stage 2 to 26
  localparam int unsigned QDelay = 15;  // stage 13 to 28
  localparam int unsigned SquareDelay = 23;  // stage 5 to 28
  logic        [     18*UDelay-1:0] u_delay_q;
  logic        [     18*QDelay-1:0] q_delay_q;
  logic        [17*SquareDelay-1:0] square_delay_q;
  logic signed [17:0] u_26, q_14, q_22, q_28;
  logic signed [17:0] square_23, square_27, square_28;
  assign u_26      = signed'(u_delay_q[18*UDelay-1-:18]);
  assign q_14      = signed'(q_delay_q[17:0]);
  assign q_22      = signed'(q_delay_q[18*9-1-:18]);
  assign q_28      = signed'(q_delay_q[18*QDelay-1-:18]);
  assign square_23 = signed'({1'b0, square_delay_q[17*18-1-:17]});
  assign square_27 = signed'({1'b0, square_delay_q[17*22-1-:17]});
  assign square_28 = signed'({1'b0, square_delay_q[17*SquareDelay-1-:17]});
  always_ff @(posedge clk_i) begin
    inside_delay_q <= 13'({inside_delay_q, inside_6});
    top_delay_q    <= 10'({top_delay_q, top_6});
    middle_delay_q <= 22'({middle_delay_q, middle_6});
    fit_delay_q    <= 24'({fit_delay_q, fit_6});
    u_delay_q      <= (18 * UDelay)'({u_delay_q, unsigned'(u_2)});
    q_delay_q      <= (18 * QDelay)'({q_delay_q, unsigned'(q_13)});
    square_delay_q <= (17 * SquareDelay)'({square_delay_q, square_5[19:3]});
  end

  // ---- third differences of the quotients, and what noise makes of them ----
  logic signed [18:0] difference_14, difference_15;
  logic signed [19:0] second_15, second_16;
  logic signed [20:0] third_16;
  logic signed [17:0] third_17;
  logic               quad_14, quad_15, quad_16, quad_17, quad_18, quad_19;
  logic signed [35:0] rough_18, rough_19;
  logic        [23:0] noise_16;
  logic        [24:0] pair_16, pair_17, pair_18;
  logic        [25:0] outer_17;
  logic        [28:0] four_18;
  always_ff @(posedge clk_i) begin
    difference_14 <= 19'(q_13) - 19'(q_14);
    difference_15 <= difference_14;
    second_15     <= 20'(difference_14) - 20'(difference_15);
    second_16     <= second_15;
    third_16      <= 21'(second_15) - 21'(second_16);
    third_17      <= 18'(third_16 >>> 3);
    rough_18      <= third_17 * third_17;
    rough_19      <= rough_18;

    quad_14 <= &top_delay_q[9:6];
    quad_15 <= quad_14;
    quad_16 <= quad_15;
    quad_17 <= quad_16;
    quad_18 <= quad_17;
    quad_19 <= quad_18;

    // The squares of the coefficients are 1 9 9 1, which is (1 1) times (1 8 1).
    noise_16 <= noise_15;
    pair_16  <= 25'(noise_15) + 25'(noise_16);
    pair_17  <= pair_16;
    pair_18  <= pair_17;
    outer_17 <= 26'(pair_16) + 26'(pair_18);
    four_18  <= 29'(outer_17) + (29'(pair_18) << 3);
  end

  // ---- weighted quotients and moments ----
  // Each product begins a clock behind another, so that no register has to lie beside two
  // multipliers.
  logic signed [17:0] weight_22, weight_23;
  logic signed [35:0] weighted_23, weighted_24, moment_24, moment_25;
  logic signed [17:0] weighted_25, weighted_26, weighted_27, weighted_28;
  logic signed [17:0] moment_26, moment_27, moment_28;
  logic signed [35:0] slope_27, slope_28, curve_28, curve_29, fourth_29, fourth_30, chi_29, chi_30;
  always_ff @(posedge clk_i) begin
    weight_22   <= signed'(18'(weight_21));
    weighted_23 <= weight_22 * q_22;
    weighted_24 <= weighted_23;
    weighted_25 <= 18'(weighted_24 >>> WeightFraction) + 18'(weighted_24[WeightFraction-1]);
    weighted_26 <= weighted_25;
    weighted_27 <= weighted_26;
    weighted_28 <= weighted_27;

    weight_23 <= weight_22;
    moment_24 <= weight_23 * square_23;
    moment_25 <= moment_24;
    moment_26 <= 18'(moment_25 >>> WeightFraction) + 18'(moment_25[WeightFraction-1]);
    moment_27 <= moment_26;
    moment_28 <= moment_27;

    slope_27  <= weighted_26 * u_26;
    slope_28  <= slope_27;
    curve_28  <= weighted_27 * square_27;
    curve_29  <= curve_28;
    fourth_29 <= moment_28 * square_28;
    fourth_30 <= fourth_29;
    chi_29    <= weighted_28 * q_28;
    chi_30    <= chi_29;
  end

  // ---- sums: what is not inside has no weight, and what does not run is not inside ----
  always_ff @(posedge clk_i) begin
    if (run_start_q) begin
      s0_q                <= '0;
      s2_q                <= '0;
      s4_q                <= '0;
      b0_q                <= '0;
      b1_q                <= '0;
      b2_q                <= '0;
      chi_q               <= '0;
      s2_middle_q         <= '0;
      b1_middle_q         <= '0;
      s2_whole_q          <= '0;
      b1_whole_q          <= '0;
      pixels_q            <= '0;
      clipped_q           <= '0;
      quads_q             <= '0;
      rough_q             <= '0;
      differences_noise_q <= '0;
    end else begin
      clipped_q <= clipped_q + 8'(near_5 && online_5 && clipped_5);
      pixels_q  <= pixels_q + 8'(fit_6);
      if (quad_18) begin
        quads_q             <= quads_q + 10'd5;
        differences_noise_q <= differences_noise_q + 37'(four_18);
      end
      if (quad_19) rough_q <= rough_q + 42'(unsigned'(rough_19));
      if (fit_21) s0_q <= s0_q + 24'(weight_21);
      if (fit_26) s2_q <= s2_q + 25'(unsigned'(moment_26));
      if (fit_25) b0_q <= b0_q + 26'(weighted_25);
      if (fit_28) b1_q <= b1_q + 44'(slope_28);
      if (fit_29) b2_q <= b2_q + 43'(curve_29);
      if (fit_30) begin
        s4_q  <= s4_q + 42'(unsigned'(fourth_30));
        chi_q <= chi_q + 44'(chi_30);
      end
      s2_whole_q <= s2_whole_q + 25'(unsigned'(moment_26));
      b1_whole_q <= b1_whole_q + 44'(slope_28);
      if (middle_26) s2_middle_q <= s2_middle_q + 25'(unsigned'(moment_26));
      if (middle_28) b1_middle_q <= b1_middle_q + 44'(slope_28);
    end
  end

endmodule

`default_nettype wire
