// amplitude_control: holds the mirror's amplitude, and says how far its angle can be trusted.
//
// VR-SCAN IV-C, IV-D: the amplitude follows the mirror's natural frequency, so it is measured once
// a period and controlled.  A PI loop sets the drive's level.  Where the level runs out, the
// drive's frequency goes on in small steps: with level_o above level_high (below level_low) a
// step a measurement, in the direction that gives more (less) amplitude, until the level has come
// back to level_nominal.  A step is proportional to how far the level is off: steps of one size
// would carry the frequency past its place, and ring.  The error e is also the detector of shocks
// and the measure of confidence.
//
// In SETTLE and RUN each valid_i is a measurement, e = amplitude_set - measured_i:
//
//   integrator  += k_i e, 20 fraction bits of a level step, exact; kept within level_min ..
//               level_max.  It stands where the level, with the integrator as it was, is at or
//               beyond the limit to which e drives it (anti-windup)
//   level_o     integrator + k_p e, to nearest, half up, kept within level_min .. level_max
//   trim_o      +/- |level_o - level_nominal| trim_gain / 2**16, to nearest, half up, at most
//               trim_step; kept within trim_min .. trim_max.  Of limits that contradict each
//               other the upper one is looked at first, here and above
//   settled_o   settle_count measurements on end were good (0 is as 1), with no broken_i and no
//               acquired_i between.  Good is an |e| of at most settle_limit and shock_limit
//               and an |error_i| of at most phase_limit
//   unsettled_o from |e| > shock_limit, |error_i| > phase_limit or acquired_i until settled_o
//   index_fault_o  from broken_i until hold_count measurements on end were good (0 is as 1)
//   confidence_o   255 - |e| confidence_gain / 2**20, to nearest, half down, at least 0; 0 while
//               unsettled_o or index_fault_o
//
// In all other states level_o is level_nominal, trim_o 0, settled_o low, unsettled_o high, and
// valid_i is ignored; index_fault_o stays as it is.
//
//   k_p, k_i      level steps (2**-20) an amplitude step (2**-28 turns), 16 and 20 fraction bits
//   trim_gain     word steps a level step, 16 fraction bits
//   Latency  44 clocks from valid_i to all outputs, a valid_i meanwhile starts anew: at least 44
//            clocks lie between two measurements, and a mirror's period is far more.  broken_i,
//            acquired_i and state_i to the outputs: 1 clock.  acquired_i without valid_i drops the
//            measurement that is worked on.  The configuration must hold meanwhile.
//   Model    vrscan.clocked.amplitude_control, bit-exact

`default_nettype none

module amplitude_control (
  input  wire logic                                             clk_i,
  input  wire logic                                             rst_i,

  input  wire logic        [  vrscan_pkg::MirrorStateWidth-1:0] state_i,
  input  wire logic                                             valid_i,
  input  wire logic        [    vrscan_pkg::AmplitudeWidth-1:0] measured_i,
  input  wire logic signed [        vrscan_pkg::ErrorWidth-1:0] error_i,
  input  wire logic                                             acquired_i,
  input  wire logic                                             broken_i,

  output      logic        [        vrscan_pkg::LevelWidth-1:0] level_o,
  output      logic signed [         vrscan_pkg::TrimWidth-1:0] trim_o,
  output      logic                                             settled_o,
  output      logic                                             unsettled_o,
  output      logic                                             index_fault_o,
  output      logic        [   vrscan_pkg::ConfidenceWidth-1:0] confidence_o,

  input  wire register_pkg::mirror_t                            mirror_i,
  input  wire register_pkg::mirror_limits_t                     mirror_limits_i
);

  localparam int unsigned LevelWidth = vrscan_pkg::LevelWidth;
  localparam int unsigned AmplitudeWidth = vrscan_pkg::AmplitudeWidth;
  localparam int unsigned ErrorWidth = vrscan_pkg::ErrorWidth;
  localparam int unsigned TrimWidth = vrscan_pkg::TrimWidth;
  localparam int unsigned Fraction = vrscan_pkg::IntegralFraction;
  localparam int unsigned Align = vrscan_pkg::IntegralFraction - vrscan_pkg::ProportionalFraction;
  localparam int unsigned ConfidenceFraction = 20;

  localparam int unsigned EWidth = AmplitudeWidth + 1;
  localparam int unsigned GainWidth = vrscan_pkg::GainWidth + 1;  // the widest gain and a sign
  localparam int unsigned ProductWidth = EWidth + GainWidth;
  localparam int unsigned TermWidth = EWidth + vrscan_pkg::ControlGainWidth;  // of a product with k
  localparam int unsigned IntegratorWidth = LevelWidth + Fraction;
  localparam int unsigned MovedWidth = TermWidth + 1;  // a term is wider than the integrator
  localparam int unsigned SumWidth = TermWidth + Align + 2;
  localparam int unsigned RoundedWidth = SumWidth - Fraction + 1;
  localparam int unsigned TrimSumWidth = TrimWidth + 1;
  localparam int unsigned TrimStepWidth = vrscan_pkg::TrimStepWidth;
  localparam int unsigned DropWidth = ProductWidth - ConfidenceFraction;
  localparam int unsigned ConfidenceWidth = vrscan_pkg::ConfidenceWidth;

  localparam int unsigned RateWidth =
      LevelWidth + vrscan_pkg::ControlGainWidth - vrscan_pkg::TrimGainFraction + 1;

  localparam int unsigned AgeWidth = 6;
  localparam int unsigned Product = vrscan_pkg::multiply_latency(EWidth, GainWidth);
  localparam logic [AgeWidth-1:0] Proportional = AgeWidth'(1);  // where the products start
  localparam logic [AgeWidth-1:0] Integral = AgeWidth'(Product + 1);
  localparam logic [AgeWidth-1:0] Gain = AgeWidth'(2 * Product + 1);
  localparam logic [AgeWidth-1:0] Confident = AgeWidth'(3 * Product + 1);  // that of Gain is there
  localparam logic [AgeWidth-1:0] Trim = AgeWidth'(3 * Product + 2);
  // The clock before the outputs change.
  localparam logic [AgeWidth-1:0] Commit = AgeWidth'(4 * Product + 7);

  logic active;
  assign active = state_i == vrscan_pkg::MirrorStateWidth'(vrscan_pkg::MirrorSettle) ||
                  state_i == vrscan_pkg::MirrorStateWidth'(vrscan_pkg::MirrorRun);

  // The clocks since valid_i; 0 is idle.  What stands below in the order of its ages is
  // free-running: its operands hold long enough.
  logic [AgeWidth-1:0] age_q;
  logic                commit;
  assign commit = age_q == Commit && !valid_i;

  logic signed [         EWidth-1:0] e_q;
  logic        [ AmplitudeWidth-1:0] e_size_q;
  logic signed [     ErrorWidth-1:0] error_q;
  logic        [     ErrorWidth-1:0] error_size_q;
  logic                              fine_q, shock_q, in_phase_q;
  logic        [     LevelWidth-1:0] off_size_q;  // of the level from its nominal

  logic                              start;
  logic signed [         EWidth-1:0] factor;
  logic        [      GainWidth-2:0] gain;
  logic signed [   ProductWidth-1:0] product;
  always_comb begin
    factor = e_q;
    gain   = (GainWidth - 1)'(mirror_i.k_p);
    if (age_q == Integral) gain = (GainWidth - 1)'(mirror_i.k_i);
    if (age_q == Gain) begin
      factor = signed'({1'b0, e_size_q});
      gain   = mirror_i.confidence_gain;
    end
    if (age_q == Trim) begin
      factor = EWidth'(signed'({1'b0, off_size_q}));
      gain   = (GainWidth - 1)'(mirror_i.trim_gain);
    end
  end
  assign start = age_q == Proportional || age_q == Integral || age_q == Gain || age_q == Trim;

  multiply #(
    .AWidth(EWidth),
    .BWidth(GainWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (start),
    .a_i      (factor),
    .b_i      (signed'({1'b0, gain})),
    .valid_o  (),
    .product_o(product)
  );

  // The level, twice through the same adder: with the integrator as it was, and as it will be.
  logic        [IntegratorWidth-1:0] integrator_q, integrator_new_q, integrator;
  logic signed [      TermWidth-1:0] proportional_q, integral_q;
  logic signed [       SumWidth-1:0] sum_q;
  logic signed [   RoundedWidth-1:0] rounded_q;
  logic                              above_q, below_q;  // at the limit or beyond
  logic                              stands_q;
  logic        [     LevelWidth-1:0] level_new_q;
  logic signed [     MovedWidth-1:0] moved_q;
  logic                              moved_above_q, moved_below_q;

  assign integrator = age_q[AgeWidth-1:4] != '0 ? integrator_new_q : integrator_q;

  function automatic logic signed [RoundedWidth-1:0] wide(input logic [LevelWidth-1:0] level);
    wide = RoundedWidth'(signed'({1'b0, level}));
  endfunction

  function automatic logic signed [MovedWidth-1:0] fine(input logic [LevelWidth-1:0] level);
    fine = MovedWidth'(signed'({1'b0, level, {Fraction{1'b0}}}));
  endfunction

  // The trim.
  logic                           more_q, less_q, more_new_q, less_new_q;
  logic                           high_q, low_q, not_above_q, not_below_q;
  logic        [   RateWidth-1:0] rate_q;
  logic        [TrimStepWidth-1:0] step_q;
  logic signed [TrimSumWidth-1:0] trim_sum_q, trim_step;
  logic                           trim_above_q, trim_below_q;
  assign trim_step = TrimSumWidth'(signed'({1'b0, step_q}));

  // Confidence.
  logic        [      DropWidth-1:0] drop_q;
  logic        [ConfidenceWidth-1:0] confidence_q;

  // The flags.
  // The counts are compared a clock ahead; one that was cleared in that clock begins with this one.
  logic [7:0] good_count_q, good_count_d;
  logic       good_q, bad_q, clear, cleared_q;
  logic       settles_q, holds_q, first_settles_q, first_holds_q;
  logic       unsettled, index_fault, settled, held;
  assign clear        = acquired_i || broken_i || !active;
  assign good_count_d = good_count_q == '1 ? good_count_q : good_count_q + 8'd1;
  assign settled      = good_q && (cleared_q ? first_settles_q : settles_q);
  assign held         = good_q && (cleared_q ? first_holds_q : holds_q);
  assign unsettled    = bad_q || (unsettled_o && !settled);
  assign index_fault  = index_fault_o && !held;

  always_ff @(posedge clk_i) begin
    if (valid_i) begin
      age_q   <= AgeWidth'(1);
      e_q     <= signed'({1'b0, mirror_i.amplitude_set}) - signed'({1'b0, measured_i});
      error_q <= error_i;
    end else if (age_q != '0) begin
      age_q <= commit || acquired_i ? '0 : age_q + AgeWidth'(1);
    end

    e_size_q     <= AmplitudeWidth'(e_q[EWidth-1] ? '0 - e_q : e_q);
    error_size_q <= unsigned'(error_q[ErrorWidth-1] ? '0 - error_q : error_q);
    fine_q       <= e_size_q <= mirror_i.settle_limit;
    shock_q      <= e_size_q > mirror_i.shock_limit;
    in_phase_q   <= error_size_q <= mirror_i.phase_limit;
    good_q       <= fine_q && in_phase_q && !shock_q;
    bad_q        <= shock_q || !in_phase_q;

    cleared_q       <= clear;
    settles_q       <= good_count_d >= mirror_i.settle_count;
    holds_q         <= good_count_d >= mirror_i.hold_count;
    first_settles_q <= mirror_i.settle_count <= 8'd1;
    first_holds_q   <= mirror_i.hold_count <= 8'd1;

    if (age_q == Integral) proportional_q <= TermWidth'(product);
    if (age_q == Gain) integral_q <= stands_q ? '0 : TermWidth'(product);

    // To nearest, half up.
    rounded_q <= RoundedWidth'(sum_q >>> Fraction)
                 + RoundedWidth'(signed'({1'b0, sum_q[Fraction-1]}));
    sum_q     <= (SumWidth'(proportional_q) <<< Align) + SumWidth'(signed'({1'b0, integrator}));
    above_q   <= rounded_q >= wide(mirror_limits_i.level_max);
    below_q   <= rounded_q <= wide(mirror_limits_i.level_min);
    if (age_q == AgeWidth'(15)) stands_q <= e_q[EWidth-1] ? below_q : above_q;

    moved_q          <= MovedWidth'(signed'({1'b0, integrator_q})) + MovedWidth'(integral_q);
    moved_above_q    <= moved_q >= fine(mirror_limits_i.level_max);
    moved_below_q    <= moved_q < fine(mirror_limits_i.level_min);
    integrator_new_q <= moved_above_q ? {mirror_limits_i.level_max, {Fraction{1'b0}}} :
                        moved_below_q ? {mirror_limits_i.level_min, {Fraction{1'b0}}} :
                                        IntegratorWidth'(moved_q);
    level_new_q <= above_q ? mirror_limits_i.level_max :
                   below_q ? mirror_limits_i.level_min : LevelWidth'(rounded_q);

    high_q      <= level_new_q > mirror_i.level_high;
    low_q       <= level_new_q < mirror_i.level_low;
    not_above_q <= level_new_q <= mirror_i.level_nominal;
    not_below_q <= level_new_q >= mirror_i.level_nominal;
    more_new_q  <= high_q || (more_q && !low_q && !not_above_q);
    less_new_q  <= !high_q && (low_q || (less_q && !not_below_q));
    off_size_q  <= level_new_q > mirror_i.level_nominal ?
                   level_new_q - mirror_i.level_nominal : mirror_i.level_nominal - level_new_q;
    rate_q      <= RateWidth'(unsigned'(product) >> vrscan_pkg::TrimGainFraction)
                   + RateWidth'(product[vrscan_pkg::TrimGainFraction-1]);
    step_q      <= TrimStepWidth'(rate_q) > mirror_i.trim_step ? mirror_i.trim_step :
                                                                 TrimStepWidth'(rate_q);
    trim_sum_q  <= TrimSumWidth'(trim_o)
                   + (more_new_q == mirror_i.trim_up ? trim_step : '0 - trim_step);
    trim_above_q <= trim_sum_q >= TrimSumWidth'(mirror_limits_i.trim_max);
    trim_below_q <= trim_sum_q < TrimSumWidth'(mirror_limits_i.trim_min);

    // To nearest, half up.
    if (age_q == Confident) begin
      drop_q <= DropWidth'(unsigned'(product) >> ConfidenceFraction)
                + DropWidth'(product[ConfidenceFraction-1]);
    end
    confidence_q <= drop_q[DropWidth-1:ConfidenceWidth] != '0 ? '0 : ~drop_q[ConfidenceWidth-1:0];

    if (commit) begin
      level_o           <= level_new_q;
      integrator_q      <= integrator_new_q;
      more_q            <= more_new_q;
      less_q            <= less_new_q;
      settled_o         <= settled;
      unsettled_o       <= unsettled;
      index_fault_o     <= index_fault;
      good_count_q      <= good_q ? good_count_d : '0;
      confidence_o      <= unsettled || index_fault ? '0 : confidence_q;
      if (more_new_q || less_new_q) begin
        trim_o <= trim_above_q ? mirror_limits_i.trim_max :
                  trim_below_q ? mirror_limits_i.trim_min : TrimWidth'(trim_sum_q);
      end
    end
    if (clear) begin
      settled_o    <= 1'b0;
      good_count_q <= '0;
      confidence_o <= '0;
    end
    if (acquired_i || !active) unsettled_o <= 1'b1;
    if (broken_i) index_fault_o <= 1'b1;
    if (!active) begin
      age_q        <= '0;
      level_o      <= mirror_i.level_nominal;
      integrator_q <= {mirror_i.level_nominal, {Fraction{1'b0}}};
      trim_o       <= '0;
      more_q       <= 1'b0;
      less_q       <= 1'b0;
    end

    if (rst_i) begin
      age_q             <= '0;
      level_o           <= '0;
      integrator_q      <= '0;
      trim_o            <= '0;
      more_q            <= 1'b0;
      less_q            <= 1'b0;
      settled_o         <= 1'b0;
      unsettled_o       <= 1'b1;
      index_fault_o     <= 1'b0;
      good_count_q      <= '0;
      confidence_o      <= '0;
    end
  end

endmodule

`default_nettype wire
