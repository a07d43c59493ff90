// index_capture: crossings of the index mark, VR-SCAN IV-D and IV-F: when, which way, how old.
//
// A level of the comparator is settled after glitch_clks clocks (at least one) in which the gate
// and the comparator agree in every sample.  The first settled level of a gate pulse is where it
// begins, and no crossing.  From a settled level, the first other sample begins a burst.  It ends
// where a level settles: the new one is a crossing, the old one a glitch.  A single low sample of
// the gate closes it at once: level and burst are forgotten.
//
// The time of a crossing is the burst's end less the samples of the new level in it, so noise that
// is symmetric about the edge cancels, less half a sample, the mean delay of sampling.
//
// Outward, 0 to 1, then inward, 1 to 0, is a pair.  Intervals are in clocks from report to report.
//   missing     period_max_clks + 1 clocks after an outward without another, and every
//               period_max_clks from then on; width_max_clks + 1 clocks after an outward
//               whose inward has not come
//   doubled     with valid_o: the crossing before went the same way; the newer one counts
//   impossible  nearer than MinCrossing to a crossing before, an inward nearer than
//               width_min_clks to its outward, or older than age_o can tell.  It is withheld.
// Each of them leaves no outward for an inward to come, but for the doubled one's own.  A deadline
// is looked at before a crossing of the same clock, and forgets which way the one before went.
// Above PeriodCeilingClks, period_max_clks and width_max_clks act as PeriodCeilingClks.
//
//   comparator_i, gate_i  bit 0 is the oldest sample of the clock
//   age_o        clocks from the crossing to the clock of valid_o, SubWidth fraction bits
//   alive_o      there was a pair, and no deadline has passed since
//   *_count_o    stop at their largest value, and follow the strobes by a clock
//   Latency      valid_o is 4 clocks after the last clock that settles the level, and at least
//                MinCrossing clocks after the valid_o before
//   Model        vrscan.clocked.index_capture, bit-exact

`default_nettype none

module index_capture #(
  parameter int unsigned IndexOversample   = 4,  // samples a clock: 1, 2, 4 or 8
  parameter int unsigned CountWidth        = 16,
  parameter int unsigned PeriodCeilingClks = 1_250_000  // 10 ms at 125 MHz
) (
  input  wire logic                                clk_i,
  input  wire logic                                rst_i,

  input  wire logic [         IndexOversample-1:0] comparator_i,
  input  wire logic [         IndexOversample-1:0] gate_i,

  output      logic                                valid_o,
  output      logic                                outward_o,
  output      logic [    vrscan_pkg::AgeWidth-1:0] age_o,

  output      logic                                missing_o,
  output      logic                                doubled_o,
  output      logic                                impossible_o,
  output      logic                                alive_o,

  input  wire register_pkg::mirror_t               mirror_i,

  output      logic [vrscan_pkg::CounterWidth-1:0] missing_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] doubled_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] impossible_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] glitch_count_o
);

  if (IndexOversample == 0 || IndexOversample > 8
      || (IndexOversample & (IndexOversample - 1)) != 0) begin : gen_bad_samples
    $error("index_capture: IndexOversample must be 1, 2, 4 or 8");
  end

  localparam int unsigned TimeWidth = vrscan_pkg::TimeWidth;
  localparam int unsigned SubWidth = vrscan_pkg::SubWidth;
  localparam int unsigned AgeWidth = vrscan_pkg::AgeWidth;
  localparam int unsigned OnesWidth = $clog2(IndexOversample + 1);
  localparam int unsigned SampleShift = SubWidth - $clog2(IndexOversample);
  // What the age is before a sample is counted: the clocks from a burst's end to valid_o, and half
  // a sample.
  localparam logic [AgeWidth:0] BaseAge =
      (AgeWidth + 1)'((3 << SubWidth) + (1 << (SampleShift - 1)));
  localparam int unsigned NearWidth = $clog2(vrscan_pkg::MinCrossing) + 1;

  // The clock's samples, put together.
  logic                 open_q, full_q, empty_q;
  logic [OnesWidth-1:0] ones, ones_q;
  always_comb begin
    ones = '0;
    for (int unsigned n = 0; n < IndexOversample; n++) ones += OnesWidth'(comparator_i[n]);
  end

  // Runs of clocks that agree.
  logic                 uniform, same, open_q2, uniform_q, settled_q, value_q;
  logic [          7:0] run_clks_q, left_q;  // clocks that settle a level, less one
  logic [OnesWidth-1:0] ones_q2, zeros_q2;
  assign uniform = open_q && (full_q || empty_q);
  assign same    = uniform_q && value_q == full_q;

  // Bursts.
  logic                 known_q, level_q, burst_q;
  logic                 crossing_q, crossing_outward_q, glitch_q;
  logic [OnesWidth-1:0] fresh;  // samples of the new level
  logic [   AgeWidth:0] age_q, age, crossing_age_q;  // the top bit: too old, and stays so
  assign fresh = level_q ? zeros_q2 : ones_q2;
  assign age   = {1'b0, age_q[AgeWidth-1:0]} + ((AgeWidth + 1)'(fresh) << SampleShift);

  // Pairs.  A limit has passed when its counter has run below zero.
  logic                     started_q, pending_q, before_q, before_outward_q;
  logic signed [TimeWidth:0] period_left_q, width_left_q, early_left_q;
  logic signed [TimeWidth:0] period_first_q, period_again_q, width_first_q, early_first_q;
  logic [    NearWidth-1:0] near_left_q;
  logic late, pending, doubled, early, impossible, accept, outward, inward;
  logic [    TimeWidth-1:0] period_max, width_max;
  assign period_max = mirror_i.period_max_clks > PeriodCeilingClks ? PeriodCeilingClks
                                                                   : mirror_i.period_max_clks;
  assign width_max  = mirror_i.width_max_clks > PeriodCeilingClks ? PeriodCeilingClks
                                                                  : mirror_i.width_max_clks;
  assign late       = (started_q && period_left_q[TimeWidth]) ||
                      (pending_q && width_left_q[TimeWidth]);
  assign pending    = pending_q && !late;
  assign early      = !near_left_q[NearWidth-1] ||
                      (pending && !crossing_outward_q && !early_left_q[TimeWidth]);
  assign impossible = crossing_q && (early || crossing_age_q[AgeWidth]);
  assign accept     = crossing_q && !(early || crossing_age_q[AgeWidth]);
  assign doubled    = accept && before_q && !late && before_outward_q == crossing_outward_q;
  assign outward    = accept && crossing_outward_q;
  assign inward     = accept && !crossing_outward_q;

  always_ff @(posedge clk_i) begin
    open_q  <= &gate_i;
    full_q  <= &comparator_i;
    empty_q <= !(|comparator_i);
    ones_q  <= ones;

    run_clks_q <= mirror_i.glitch_clks == '0 ? '0 : mirror_i.glitch_clks - 8'd1;
    open_q2    <= open_q;
    uniform_q  <= uniform;
    value_q    <= full_q;
    ones_q2    <= ones_q;
    zeros_q2   <= OnesWidth'(IndexOversample) - ones_q;
    settled_q  <= uniform && (same ? left_q <= 8'd1 : run_clks_q == '0);
    if (!same) left_q <= run_clks_q;
    else if (left_q != '0) left_q <= left_q - 8'd1;

    crossing_q         <= 1'b0;
    glitch_q           <= 1'b0;
    crossing_outward_q <= value_q;
    crossing_age_q     <= {age_q[AgeWidth] || age[AgeWidth], age[AgeWidth-1:0]};
    age_q              <= BaseAge;
    if (!open_q2) begin
      known_q <= 1'b0;
      burst_q <= 1'b0;
    end else if (settled_q) begin
      known_q    <= 1'b1;
      level_q    <= value_q;
      burst_q    <= 1'b0;
      crossing_q <= known_q && value_q != level_q;
      glitch_q   <= burst_q && value_q == level_q;
    end else if (known_q && (burst_q || fresh != '0)) begin
      burst_q <= 1'b1;
      age_q   <= {age_q[AgeWidth] || age[AgeWidth], age[AgeWidth-1:0]};
    end

    // Nothing of the configuration is compared with a counter: it is where the counter begins.
    period_first_q <= (TimeWidth + 1)'(period_max) - (TimeWidth + 1)'(1);
    period_again_q <= (TimeWidth + 1)'(period_max) - (TimeWidth + 1)'(2);
    width_first_q  <= (TimeWidth + 1)'(width_max) - (TimeWidth + 1)'(1);
    early_first_q  <= (TimeWidth + 1)'(mirror_i.width_min_clks) - (TimeWidth + 1)'(2);
    if (outward) period_left_q <= period_first_q;
    else if (period_left_q[TimeWidth]) period_left_q <= period_again_q;
    else period_left_q <= period_left_q - (TimeWidth + 1)'(1);
    if (outward) width_left_q <= width_first_q;
    else if (!width_left_q[TimeWidth]) width_left_q <= width_left_q - (TimeWidth + 1)'(1);
    if (outward) early_left_q <= early_first_q;
    else if (!early_left_q[TimeWidth]) early_left_q <= early_left_q - (TimeWidth + 1)'(1);
    if (crossing_q) near_left_q <= NearWidth'(vrscan_pkg::MinCrossing - 2);
    else if (!near_left_q[NearWidth-1]) near_left_q <= near_left_q - NearWidth'(1);

    if (outward) started_q <= 1'b1;
    pending_q <= outward || (pending && !crossing_q);
    before_q  <= crossing_q || (before_q && !late);
    if (crossing_q) before_outward_q <= crossing_outward_q;

    valid_o      <= accept;
    missing_o    <= late;
    doubled_o    <= doubled;
    impossible_o <= impossible;
    alive_o      <= (alive_o && !late) || (inward && pending);
    if (accept) begin
      outward_o <= crossing_outward_q;
      age_o     <= crossing_age_q[AgeWidth-1:0];
    end

    if (missing_o) missing_count_o <= vrscan_pkg::counted(missing_count_o, CountWidth);
    if (doubled_o) doubled_count_o <= vrscan_pkg::counted(doubled_count_o, CountWidth);
    if (impossible_o) begin
      impossible_count_o <= vrscan_pkg::counted(impossible_count_o, CountWidth);
    end
    if (glitch_q) glitch_count_o <= vrscan_pkg::counted(glitch_count_o, CountWidth);

    // A closed gate clears the levels and bursts behind it.
    if (rst_i) begin
      open_q             <= 1'b0;
      open_q2            <= 1'b0;
      crossing_q         <= 1'b0;
      glitch_q           <= 1'b0;
      started_q          <= 1'b0;
      pending_q          <= 1'b0;
      before_q           <= 1'b0;
      near_left_q        <= '1;
      valid_o            <= 1'b0;
      missing_o          <= 1'b0;
      doubled_o          <= 1'b0;
      impossible_o       <= 1'b0;
      alive_o            <= 1'b0;
      missing_count_o    <= '0;
      doubled_count_o    <= '0;
      impossible_count_o <= '0;
      glitch_count_o     <= '0;
    end
  end

endmodule

`default_nettype wire
