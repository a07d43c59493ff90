// laser_control: two-channel laser driver: adapts the power, and keeps the light within its limits.
//
// Two channels, as laser switches have them: a main one for the pulses and a start-up one, dim, for
// the index mark, which must be found before the mirror can be known to move.  docs/laser-safety.md
// has the times and what is proven of them.
//
// Main channel.  pulse_o is pulse_i and a registered permission, so a pulse has no latency and no
// jitter of its own.  It is given in RUN with index_alive_i, laser_enable, a host that is heard
// and guard_ok_i, and not before the second line_start_i of these on end: the level has a line to
// settle.  Any of them away: pulse_o and power_o are 0 one clock later.  It is given only while
// pulse_i is low and may then only be withdrawn, so a pulse is whole, cut or absent:
//   laser_limit_pulse_clks  a longer request is cut, and dark until it was low
//   laser_limit_bucket      of a bucket to which a clock of the pulse adds its power and which
//                           laser_limit_drain leaves a clock; one that could overflow stops the
//                           pulses until it is empty.  BucketMargin of it is kept for the pipeline
//   laser_watchdog_clks     no alive_i for so long: both channels are off, until laser_enable was
//                           low and alive_i has come.  After a reset the host has not been heard.
//                           0 is as the ceiling, not "never"
// Every limit has a ceiling by parameter, which no register lifts.
//
// Start-up channel.  index_light_o is on in SWEEP and SETTLE, in RUN while phase_i is from
// laser_index_begin to below laser_index_end, and off in OFF and FAULT.  startup_o is at most
// laser_limit_startup, 0 where the channel is off for good (not in the dark part of a turn).
//
// Power.  Every point tells the height of its peak over the background, and the next power is
// the point's own power times a factor, one multiplier, no division:
//   saturated     laser_cut / 2**14
//   not measured  1 + laser_search / 2**14, and one step
//   else          1 + k (laser_target - height) / 2**16, k = laser_down / 2**13 above the target,
//                 laser_up / 2**13 below; to 14 fraction bits, nearest, half up, within 0 and 8
// to nearest, half up, within laser_power_min (at least 1) .. laser_power_max; of limits that
// contradict each other the upper one is looked at first.  Each direction of the scan has its own
// power, or with laser_shared both have one.  Points of test lines or of no power say
// nothing.  With laser_enable or laser_adapt low the powers are laser_power, at least the least
// one: there the adaptation begins.  Without laser_adapt the power is laser_power.  What the next
// power is made of must hold meanwhile.
//
//   power_o       changes between pulses only: in the second clock after a request ends, or when a
//                 limit comes down.  At most laser_limit_power
//   *_pin_o       sigma-delta of the first order: of 2**16 clocks power_o (startup_o) are high
//   power_line_o  from the clock of centre_i to the next: what the pulse has, 0 if it is suppressed,
//                 and 0 from the clock after a cut; inward_line_o is its direction
//   phase_i       mirror_phase_o's top bits.  The first half turn is inward
//   guard_ok_i    of laser_guard; synchronised here.  1 where there is none
//   heartbeat_o   toggles every 2**HeartbeatBits clocks
//   laser_status  from bit 0: host heard, guard well, pulses permitted, bucket full, watchdog
//                 tripped
//   Latency  interlock to pulse_o and index_light_o 1 clock, phase_i to index_light_o 3, guard_ok_i
//            to both 3; a limit to power_o and startup_o 2; the last alive_i to dark:
//            laser_watchdog_clks + 3; point_valid_i to the new power: 21; a point_valid_i
//            within the first 19 of these starts anew.  *_pin_o and the counters follow by a clock
//   Model    vrscan.clocked.laser_control, bit-exact

`default_nettype none

module laser_control #(
  parameter int unsigned PixelWidth          = 12,
  parameter int unsigned CountWidth          = 16,
  parameter int unsigned HeartbeatBits       = 5,  // a beat every 0.26 us at 125 MHz
  parameter int unsigned PowerCeiling        = 65_535,
  parameter int unsigned StartupCeiling      = 1_311,  // 1 mW of 50 mW
  parameter int unsigned PulseCeilingClks    = 1_250,  // 10 us at 125 MHz
  parameter int unsigned DrainCeiling        = 4_096,  // 3.1 mW of 50 mW on average
  parameter int unsigned BucketCeiling       = 268_435_456,  // 1.6 uJ of 50 mW at 125 MHz
  parameter int unsigned WatchdogCeilingClks = 134_217_728  // 1.07 s at 125 MHz
) (
  input  wire logic                                    clk_i,
  input  wire logic                                    rst_i,

  // From line_trigger, the mirror and the host.
  input  wire logic                                    pulse_i,
  input  wire logic                                    line_start_i,
  input  wire logic                                    centre_i,
  input  wire logic [vrscan_pkg::MirrorStateWidth-1:0] state_i,
  input  wire logic                                    index_alive_i,
  input  wire logic [                            15:0] phase_i,
  input  wire logic                                    alive_i,
  input  wire logic                                    guard_ok_i,

  // The point of a line.
  input  wire logic                                    point_valid_i,
  input  wire vrscan_pkg::point_t                      point_i,

  // To the driver.
  output      logic                                    pulse_o,
  output      logic [      vrscan_pkg::PowerWidth-1:0] power_o,
  output      logic                                    power_pin_o,
  output      logic                                    index_light_o,
  output      logic [      vrscan_pkg::PowerWidth-1:0] startup_o,
  output      logic                                    startup_pin_o,
  output      logic                                    heartbeat_o,

  // With the line.
  output      logic [      vrscan_pkg::PowerWidth-1:0] power_line_o,
  output      logic                                    inward_line_o,

  // Configuration.
  input  wire register_pkg::laser_t                    laser_i,

  // Limits.
  input  wire register_pkg::laser_limits_t             laser_limits_i,

  // Status; each counter stops at its largest value.
  output      register_pkg::laser_status_t             laser_status_o
);

  localparam int unsigned PowerWidth = vrscan_pkg::PowerWidth;
  localparam int unsigned StateWidth = vrscan_pkg::MirrorStateWidth;
  localparam int unsigned LengthWidth = vrscan_pkg::LineClksWidth;
  localparam int unsigned BucketWidth = 32;
  // Four clocks of the largest power: from a clock with light to the permission.
  localparam int unsigned MarginBits = PowerWidth + 2;

  if (PowerCeiling >= 2 ** PowerWidth || StartupCeiling >= 2 ** PowerWidth ||
      DrainCeiling >= 2 ** PowerWidth) begin : gen_bad_power
    $error("laser_control: PowerCeiling, StartupCeiling and DrainCeiling must fit in 16 bits");
  end
  if (PulseCeilingClks >= 2 ** LengthWidth - 1) begin : gen_bad_pulse
    $error("laser_control: PulseCeilingClks must be below 2**20 - 1");
  end
  if (BucketCeiling >= 2 ** 31 || WatchdogCeilingClks >= 2 ** 31 ||
      WatchdogCeilingClks < 1) begin : gen_bad_bucket
    $error("laser_control: BucketCeiling, WatchdogCeilingClks must be below 2**31, the latter > 0");
  end
  if (HeartbeatBits < 1 || HeartbeatBits > 24) begin : gen_bad_heartbeat
    $error("laser_control: HeartbeatBits must be 1 to 24");
  end

  // ---- the limits, below their ceilings ----
  logic        [ PowerWidth-1:0] limit_power_q, limit_startup_q, drain_q;
  logic        [LengthWidth-1:0] limit_pulse_q;
  logic        [BucketWidth-1:0] bucket_q;
  logic        [           31:0] watchdog_q;
  logic signed [  BucketWidth:0] threshold_q;

  function automatic logic [31:0] smaller(input logic [31:0] value, input logic [31:0] ceiling);
    smaller = value > ceiling ? ceiling : value;
  endfunction

  // ---- the host and the guard ----
  logic [31:0] silent_q;
  logic        heard_q, tripped_q, late;
  logic [ 1:0] guard_q;
  assign late = silent_q >= watchdog_q;

  // ---- the interlock ----
  logic run, seeking, awake, allowed;
  assign run     = state_i == StateWidth'(vrscan_pkg::MirrorRun);
  assign seeking = state_i == StateWidth'(vrscan_pkg::MirrorSweep) ||
                   state_i == StateWidth'(vrscan_pkg::MirrorSettle);
  assign awake   = laser_i.laser_enable && heard_q && !tripped_q && guard_q[1];
  assign allowed = awake && run && index_alive_i;

  logic       permit_q;
  logic [1:0] armed_q;  // the first line_start_i, and the second
  assign pulse_o = pulse_i && permit_q;

  // ---- the length of a pulse ----
  logic [LengthWidth-1:0] clks_q;  // that pulse_i has been high
  logic                   room, cut_q;
  assign room = pulse_i ? clks_q + LengthWidth'(1) < limit_pulse_q : limit_pulse_q != '0;

  // ---- the bucket ----
  logic        [BucketWidth-1:0] level_q;
  logic signed [ PowerWidth+1:0] delta_q;
  logic signed [BucketWidth+1:0] level;
  logic                          over, full_q;
  assign level = signed'({2'b00, level_q}) + (BucketWidth + 2)'(delta_q);
  assign over  = signed'({1'b0, level_q}) > threshold_q;

  // ---- the index window ----
  logic [15:0] offset_q, span_q;
  logic        inside_q;

  // ---- the powers ----
  logic [PowerWidth-1:0] inward_q, outward_q, request_q;
  logic                  inward, pulse_q, take;
  assign inward = !phase_i[15];
  assign take   = (pulse_q && !pulse_i) || !armed_q[1];

  // The line, from the clock of its centre on.
  logic                  whole_q;  // the pulse goes on beyond its centre
  logic [PowerWidth-1:0] line_q;
  logic                  line_inward_q;
  assign power_line_o  = centre_i ? (pulse_o ? power_o : '0) : line_q;
  assign inward_line_o = centre_i ? inward : line_inward_q;

  // ---- the next power ----
  localparam int unsigned FactorFraction = 14;
  localparam int unsigned FactorWidth = 18;
  localparam int unsigned GainFraction = 13;
  localparam int unsigned ErrorWidth = PowerWidth + 1;
  localparam int unsigned ProductWidth = ErrorWidth + FactorWidth;
  localparam int unsigned RatioShift = PowerWidth + GainFraction - FactorFraction;
  localparam int unsigned SumWidth = ProductWidth - RatioShift + 1;
  localparam int unsigned NewWidth = ProductWidth - FactorFraction;
  localparam logic signed [SumWidth-1:0] One = SumWidth'(1) <<< FactorFraction;

  localparam int unsigned AgeWidth = 5;
  localparam logic [AgeWidth-1:0] Relate = AgeWidth'(3);  // where the products start
  localparam int unsigned Product = vrscan_pkg::multiply_latency(ErrorWidth, FactorWidth);
  localparam logic [AgeWidth-1:0] Scale = AgeWidth'(5 + Product);
  localparam logic [AgeWidth-1:0] Commit = AgeWidth'(8 + 2 * Product);

  // Peak and background, their top bits.
  localparam int unsigned AlignedWidth = vrscan_pkg::AlignedWidth;
  logic [AlignedWidth-1:0] maximum, background;
  assign maximum    = point_i.maximum << (AlignedWidth - PixelWidth);
  assign background = point_i.background[vrscan_pkg::CountWidth-1-:AlignedWidth];

  // The clocks since point_valid_i; 0 is idle.  What stands below in the order of its ages is
  // free-running: its operands hold long enough.
  logic        [    AgeWidth-1:0] age_q;
  logic        [  PowerWidth-1:0] base_q;
  logic        [  PowerWidth-1:0] height_q;
  logic                           saturated_q, measured_q, point_inward_q;
  logic signed [  ErrorWidth-1:0] error_q;
  logic        [            15:0] gain_q;
  logic signed [    SumWidth-1:0] sum_q;
  logic signed [ FactorWidth-1:0] factor_q;
  logic signed [    NewWidth-1:0] new_q;
  logic                           above_q, below_q;
  logic        [  PowerWidth-1:0] least_q, first_q, clipped_q;
  logic                           start;
  logic signed [  ErrorWidth-1:0] a;
  logic signed [ FactorWidth-1:0] b;
  logic signed [ProductWidth-1:0] product;
  assign start = age_q == Relate || age_q == Scale;
  assign a     = age_q == Scale ? signed'({1'b0, base_q}) : error_q;
  assign b     = age_q == Scale ? factor_q : signed'({2'b00, gain_q});

  multiply #(
    .AWidth(ErrorWidth),
    .BWidth(FactorWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (start),
    .a_i      (a),
    .b_i      (b),
    .valid_o  (),
    .product_o(product)
  );

  logic [HeartbeatBits:0] beat_q;
  logic [ PowerWidth-1:0] power_sigma_q, startup_sigma_q;
  assign heartbeat_o = beat_q[HeartbeatBits];

  logic tripping, full_before_q;
  assign tripping = laser_i.laser_enable && heard_q && late && !alive_i;
  logic [vrscan_pkg::CounterWidth-1:0] cut_count_q, duty_count_q, watchdog_count_q;
  assign laser_status_o.laser_status = {tripped_q, full_q, armed_q[1], guard_q[1], heard_q};
  assign laser_status_o.laser_power_inward = inward_q;
  assign laser_status_o.laser_power_outward = outward_q;
  assign laser_status_o.laser_cut_count = cut_count_q;
  assign laser_status_o.laser_duty_count = duty_count_q;
  assign laser_status_o.laser_watchdog_count = watchdog_count_q;

  always_ff @(posedge clk_i) begin
    limit_power_q   <= PowerWidth'(smaller(32'(laser_limits_i.laser_limit_power), PowerCeiling));
    limit_startup_q <= PowerWidth'(smaller(32'(laser_limits_i.laser_limit_startup),
                                           StartupCeiling));
    limit_pulse_q   <= LengthWidth'(smaller(32'(laser_limits_i.laser_limit_pulse_clks),
                                            PulseCeilingClks));
    drain_q         <= PowerWidth'(smaller(32'(laser_limits_i.laser_limit_drain), DrainCeiling));
    bucket_q        <= smaller(laser_limits_i.laser_limit_bucket, BucketCeiling);
    threshold_q     <= signed'({1'b0, bucket_q}) - signed'((BucketWidth + 1)'(2 ** MarginBits));
    watchdog_q      <= smaller(laser_limits_i.laser_watchdog_clks, WatchdogCeilingClks);
    if (laser_limits_i.laser_watchdog_clks == '0) watchdog_q <= WatchdogCeilingClks;

    if (alive_i) silent_q <= '0;
    else if (!late) silent_q <= silent_q + 32'd1;
    heard_q   <= alive_i || (heard_q && !late);
    tripped_q <= laser_i.laser_enable && (tripped_q || tripping);
    guard_q   <= {guard_q[0], guard_ok_i};

    if (!allowed) armed_q <= '0;
    else if (line_start_i) armed_q <= {armed_q[0], 1'b1};
    permit_q <= allowed && armed_q[1] && room && !full_q && (permit_q || !pulse_i);

    if (!pulse_i) clks_q <= '0;
    else if (clks_q != '1) clks_q <= clks_q + LengthWidth'(1);
    cut_q <= pulse_o && !room;

    delta_q <= (PowerWidth + 2)'(signed'({1'b0, pulse_o ? power_o : PowerWidth'(0)}))
               - (PowerWidth + 2)'(signed'({1'b0, drain_q}));
    level_q <= level[BucketWidth+1] ? '0 : level[BucketWidth-1:0];
    full_q  <= over || (full_q && level_q != '0);

    offset_q      <= phase_i - laser_i.laser_index_begin;
    span_q        <= laser_i.laser_index_end - laser_i.laser_index_begin;
    inside_q      <= offset_q < span_q;
    index_light_o <= awake && (seeking || (run && inside_q));
    startup_o     <= '0;
    if (awake && (seeking || run)) begin
      startup_o <= laser_i.laser_startup > limit_startup_q ? limit_startup_q
                                                           : laser_i.laser_startup;
    end

    pulse_q <= pulse_i;
    if (take) begin
      request_q <= !laser_i.laser_adapt ? laser_i.laser_power :
                   laser_i.laser_shared || inward ? inward_q : outward_q;
    end
    power_o <= '0;
    if (allowed) power_o <= request_q > limit_power_q ? limit_power_q : request_q;

    // A cut that comes behind the centre still takes the line its power.
    whole_q <= pulse_i && (centre_i ? pulse_o : whole_q);
    line_q        <= whole_q && pulse_i && !pulse_o && !centre_i ? '0 : power_line_o;
    line_inward_q <= inward_line_o;

    {power_pin_o, power_sigma_q}     <= {1'b0, power_sigma_q} + {1'b0, power_o};
    {startup_pin_o, startup_sigma_q} <= {1'b0, startup_sigma_q} + {1'b0, startup_o};
    beat_q                           <= beat_q + (HeartbeatBits + 1)'(1);

    // The next power.
    if (point_valid_i && !point_i.line.test && point_i.line.power != '0) begin
      age_q          <= AgeWidth'(1);
      base_q         <= point_i.line.power;
      saturated_q    <= point_i.flags[vrscan_pkg::FlagSaturated];
      measured_q     <= point_i.measured;
      point_inward_q <= point_i.line.inward;
      height_q       <= maximum > background ? maximum - background : '0;
    end else if (age_q != '0) begin
      age_q <= age_q == Commit ? '0 : age_q + AgeWidth'(1);
    end
    error_q <= signed'({1'b0, laser_i.laser_target}) - signed'({1'b0, height_q});
    gain_q  <= error_q[ErrorWidth-1] ? laser_i.laser_down : laser_i.laser_up;
    // To nearest, half up.
    if (age_q == AgeWidth'(9)) begin
      sum_q <= One + SumWidth'(product >>> RatioShift)
               + SumWidth'(signed'({1'b0, product[RatioShift-1]}));
    end
    if (saturated_q) begin
      factor_q <= FactorWidth'(signed'({1'b0, laser_i.laser_cut}));
    end else if (!measured_q) begin
      factor_q <= FactorWidth'(One) + FactorWidth'(signed'({1'b0, laser_i.laser_search}));
    end else if (sum_q[SumWidth-1]) begin
      factor_q <= '0;
    end else if (sum_q[SumWidth-2:FactorWidth-1] != '0) begin
      factor_q <= {1'b0, {(FactorWidth - 1) {1'b1}}};
    end else begin
      factor_q <= sum_q[FactorWidth-1:0];
    end
    // Of nothing measured one step more, or a small power would stand.
    new_q     <= NewWidth'(product >>> FactorFraction)
                 + NewWidth'(signed'({1'b0, product[FactorFraction-1]}))
                 + NewWidth'(signed'({1'b0, !saturated_q && !measured_q}));
    least_q   <= laser_i.laser_power_min == '0 ? PowerWidth'(1) : laser_i.laser_power_min;
    above_q   <= new_q >= NewWidth'(signed'({1'b0, laser_i.laser_power_max}));
    below_q   <= new_q < NewWidth'(signed'({1'b0, least_q}));
    clipped_q <= above_q ? laser_i.laser_power_max : below_q ? least_q : new_q[PowerWidth-1:0];
    if (age_q == Commit) begin
      if (laser_i.laser_shared || point_inward_q) inward_q <= clipped_q;
      if (laser_i.laser_shared || !point_inward_q) outward_q <= clipped_q;
    end
    first_q <= laser_i.laser_power < least_q ? least_q : laser_i.laser_power;
    if (!laser_i.laser_adapt || !laser_i.laser_enable) age_q <= '0;
    if (!laser_i.laser_adapt || !laser_i.laser_enable || inward_q == '0) inward_q <= first_q;
    if (!laser_i.laser_adapt || !laser_i.laser_enable || outward_q == '0) outward_q <= first_q;

    full_before_q <= full_q;
    if (cut_q && pulse_i) cut_count_q <= vrscan_pkg::counted(cut_count_q, CountWidth);
    if (full_q && !full_before_q) begin
      duty_count_q <= vrscan_pkg::counted(duty_count_q, CountWidth);
    end
    if (tripping && !tripped_q) begin
      watchdog_count_q <= vrscan_pkg::counted(watchdog_count_q, CountWidth);
    end

    if (rst_i) begin
      limit_power_q    <= '0;
      limit_startup_q  <= '0;
      limit_pulse_q    <= '0;
      drain_q          <= '0;
      bucket_q         <= '0;
      threshold_q      <= '1;
      watchdog_q       <= '0;
      silent_q         <= '0;
      heard_q          <= 1'b0;
      tripped_q        <= 1'b0;
      guard_q          <= '0;
      armed_q          <= '0;
      permit_q         <= 1'b0;
      clks_q           <= '0;
      cut_q            <= 1'b0;
      delta_q          <= '0;
      level_q          <= '0;
      full_q           <= 1'b1;
      full_before_q    <= 1'b1;
      inside_q         <= 1'b0;
      index_light_o    <= 1'b0;
      startup_o        <= '0;
      pulse_q          <= 1'b0;
      request_q        <= '0;
      power_o          <= '0;
      whole_q          <= 1'b0;
      line_q           <= '0;
      line_inward_q    <= 1'b0;
      power_pin_o      <= 1'b0;
      power_sigma_q    <= '0;
      startup_pin_o    <= 1'b0;
      startup_sigma_q  <= '0;
      beat_q           <= '0;
      age_q            <= '0;
      least_q          <= '0;
      first_q          <= '0;
      inward_q         <= '0;
      outward_q        <= '0;
      cut_count_q      <= '0;
      duty_count_q     <= '0;
      watchdog_count_q <= '0;
    end
  end

endmodule

`default_nettype wire
