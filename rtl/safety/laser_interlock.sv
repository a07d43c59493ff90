// laser_interlock: lets light through only while all is well, and keeps it within its limits.
//
// Whatever is requested, this module alone decides about the light of both channels.  `make formal`
// proves its limits for any inputs; docs/laser-safety.md has them, and the times.
//
// Main channel.  pulse_o is pulse_i and a registered permission, so a pulse has no latency and no
// jitter of its own.  The permission needs RUN, index_alive_i, scanning_i, laser_enable, a host that
// is heard and guard_ok_i.  It comes after the second line_start_i at which all of these hold, because the
// level takes a line to settle.  When one of them goes, pulse_o and power_o are 0 a clock later.
// The permission begins only while pulse_i is low, so a pulse is whole, cut or absent.  Its limits:
//   laser_limit_pulse_clks  a longer request is cut, and it is dark until the request was low
//   laser_limit_bucket      a clock of light adds its power to a bucket, which laser_limit_drain
//                           leaves every clock.  When it could overflow there are no pulses until
//                           it is empty; 2**MarginBits of it cover the clocks until then
//   laser_watchdog_clks     after so long without alive_i both channels are off, until laser_enable
//                           was low and alive_i has come.  After a reset no host has been heard.
//                           0 means the ceiling, not "never"
// Every limit has a ceiling, a parameter that no register lifts.
//
// Start-up channel.  While startup_ok_i, index_light_o is on in SETTLE, and in RUN on while phase_i
// is from laser_index_begin to below laser_index_end.  It is off in OFF, SWEEP and FAULT: a sweep
// needs no index.  startup_o is laser_startup, at most laser_limit_startup; it is 0 where the channel
// may not shine, but stays up in the dark part of a turn.
//
//   power_o       power_i a clock ago, at most laser_limit_power; 0 where no pulse may come
//   phase_i       mirror_phase_o's top bits
//   scanning_i, startup_ok_i  of scan_safeguard, which no register lifts
//   guard_ok_i    of guard_watch
//   armed_o       the second line_start_i has come with all well
//   status_o      from bit 0: host heard, guard well, armed, bucket full, watchdog tripped,
//                 scanning_i and startup_ok_i a clock ago
//   signature_o   the parity of every register that has a say about light, a clock ago
//   cut_count_o, duty_count_o, watchdog_count_o  how often each limit acted; they stop at their
//                 largest value
//   Latency  state_i, index_alive_i, scanning_i, startup_ok_i, guard_ok_i and laser_enable to the
//            light: 1 clock; phase_i to index_light_o: 3; a limit to power_o and startup_o: 2; the
//            last alive_i to dark: laser_watchdog_clks + 3.  The counters follow by a clock
//   Model    vrscan.clocked.laser_interlock, bit-exact

`default_nettype none

(* keep_hierarchy *)  // of two that do the same neither may be taken for the other
module laser_interlock #(
  parameter int unsigned CountWidth          = 16,
  parameter int unsigned PowerCeiling        = 65_535,
  parameter int unsigned StartupCeiling      = 1_311,  // 1 mW of 50 mW
  parameter int unsigned PulseCeilingClks    = 1_250,  // 10 us at 125 MHz
  parameter int unsigned DrainCeiling        = 4_096,  // 3.1 mW of 50 mW on average
  parameter int unsigned BucketCeiling       = 268_435_456,  // 1.6 uJ of 50 mW at 125 MHz
  parameter int unsigned WatchdogCeilingClks = 134_217_728  // 1.07 s at 125 MHz
) (
  input  wire logic                                    clk_i,
  input  wire logic                                    rst_i,

  // What is requested, and when.
  input  wire logic                                    pulse_i,
  input  wire logic [      vrscan_pkg::PowerWidth-1:0] power_i,
  input  wire logic                                    line_start_i,

  // What has to be well.
  input  wire logic [vrscan_pkg::MirrorStateWidth-1:0] state_i,
  input  wire logic                                    index_alive_i,
  input  wire logic                                    scanning_i,
  input  wire logic                                    startup_ok_i,
  input  wire logic [                            15:0] phase_i,
  input  wire logic                                    alive_i,
  input  wire logic                                    guard_ok_i,

  // The light.
  output      logic                                    pulse_o,
  output      logic [      vrscan_pkg::PowerWidth-1:0] power_o,
  output      logic                                    index_light_o,
  output      logic [      vrscan_pkg::PowerWidth-1:0] startup_o,

  // Registers.
  input  wire register_pkg::laser_t                    laser_i,
  input  wire register_pkg::laser_limits_t             laser_limits_i,
  output      logic                                    armed_o,
  output      logic [                             6:0] status_o,
  output      logic                                    signature_o,
  output      logic [    vrscan_pkg::CounterWidth-1:0] cut_count_o,
  output      logic [    vrscan_pkg::CounterWidth-1:0] duty_count_o,
  output      logic [    vrscan_pkg::CounterWidth-1:0] watchdog_count_o
);

  localparam int unsigned PowerWidth = vrscan_pkg::PowerWidth;
  localparam int unsigned StateWidth = vrscan_pkg::MirrorStateWidth;
  localparam int unsigned LengthWidth = vrscan_pkg::LineClksWidth;
  localparam int unsigned BucketWidth = 32;
  // Four clocks of the largest power: from a clock with light to the permission.
  localparam int unsigned MarginBits = PowerWidth + 2;

  if (PowerCeiling >= 2 ** PowerWidth || StartupCeiling >= 2 ** PowerWidth ||
      DrainCeiling >= 2 ** PowerWidth) begin : gen_bad_power
    $error("laser_interlock: PowerCeiling, StartupCeiling and DrainCeiling must fit in 16 bits");
  end
  if (PulseCeilingClks >= 2 ** LengthWidth - 1) begin : gen_bad_pulse
    $error("laser_interlock: PulseCeilingClks must be below 2**20 - 1");
  end
  if (BucketCeiling >= 2 ** 31 || WatchdogCeilingClks >= 2 ** 31 ||
      WatchdogCeilingClks < 1) begin : gen_bad_bucket
    $error("laser_interlock: BucketCeiling, WatchdogCeilingClks must be below 2**31, not 0");
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

    if (rst_i) begin
      limit_power_q   <= '0;
      limit_startup_q <= '0;
      limit_pulse_q   <= '0;
      drain_q         <= '0;
      bucket_q        <= '0;
      threshold_q     <= '1;
      watchdog_q      <= '0;
    end
  end

  // ---- the host and the guard ----
  logic [31:0] silent_q;
  logic        heard_q, tripped_q, late, tripping;
  assign late     = silent_q >= watchdog_q;
  assign tripping = laser_i.laser_enable && heard_q && late && !alive_i;

  always_ff @(posedge clk_i) begin
    if (alive_i) silent_q <= '0;
    else if (!late) silent_q <= silent_q + 32'd1;
    heard_q   <= alive_i || (heard_q && !late);
    tripped_q <= laser_i.laser_enable && (tripped_q || tripping);

    if (rst_i) begin
      silent_q  <= '0;
      heard_q   <= 1'b0;
      tripped_q <= 1'b0;
    end
  end

  // ---- what may shine ----
  logic run, settling, awake, allowed, visible;
  assign run      = state_i == StateWidth'(vrscan_pkg::MirrorRun);
  assign settling = state_i == StateWidth'(vrscan_pkg::MirrorSettle);
  assign awake    = laser_i.laser_enable && heard_q && !tripped_q && guard_ok_i;
  assign allowed  = awake && run && index_alive_i && scanning_i;
  assign visible  = awake && startup_ok_i && (settling || run);

  // ---- pulses: their permission and their length ----
  logic                   permit_q, room, cut_q, full_q;
  logic [            1:0] armed_q;  // the first line_start_i, and the second
  logic [LengthWidth-1:0] clks_q;  // that pulse_i has been high
  assign armed_o = armed_q[1];
  assign pulse_o = pulse_i && permit_q;
  assign room = pulse_i ? clks_q + LengthWidth'(1) < limit_pulse_q : limit_pulse_q != '0;

  always_ff @(posedge clk_i) begin
    if (!allowed) armed_q <= '0;
    else if (line_start_i) armed_q <= {armed_q[0], 1'b1};
    permit_q <= allowed && armed_q[1] && room && !full_q && (permit_q || !pulse_i);

    if (!pulse_i) clks_q <= '0;
    else if (clks_q != '1) clks_q <= clks_q + LengthWidth'(1);
    cut_q <= pulse_o && !room;

    power_o <= '0;
    if (allowed) power_o <= power_i > limit_power_q ? limit_power_q : power_i;

    if (rst_i) begin
      armed_q  <= '0;
      permit_q <= 1'b0;
      clks_q   <= '0;
      cut_q    <= 1'b0;
      power_o  <= '0;
    end
  end

  // ---- the bucket ----
  logic        [BucketWidth-1:0] level_q;
  logic signed [ PowerWidth+1:0] delta_q;
  logic signed [BucketWidth+1:0] level;
  logic                          over, full_before_q;
  assign level = signed'({2'b00, level_q}) + (BucketWidth + 2)'(delta_q);
  assign over  = signed'({1'b0, level_q}) > threshold_q;

  always_ff @(posedge clk_i) begin
    delta_q <= (PowerWidth + 2)'(signed'({1'b0, pulse_o ? power_o : PowerWidth'(0)}))
               - (PowerWidth + 2)'(signed'({1'b0, drain_q}));
    level_q <= level[BucketWidth+1] ? '0 : level[BucketWidth-1:0];
    full_q  <= over || (full_q && level_q != '0);
    full_before_q <= full_q;

    if (rst_i) begin
      delta_q       <= '0;
      level_q       <= '0;
      full_q        <= 1'b1;
      full_before_q <= 1'b1;
    end
  end

  // ---- the start-up channel ----
  logic [15:0] offset_q, span_q;  // of the phase and of the window's end, from its begin
  logic        inside_q;

  always_ff @(posedge clk_i) begin
    offset_q      <= phase_i - laser_i.laser_index_begin;
    span_q        <= laser_i.laser_index_end - laser_i.laser_index_begin;
    inside_q      <= offset_q < span_q;
    index_light_o <= visible && (settling || inside_q);
    startup_o     <= '0;
    if (visible) begin
      startup_o <= laser_i.laser_startup > limit_startup_q ? limit_startup_q
                                                           : laser_i.laser_startup;
    end

    if (rst_i) begin
      offset_q      <= '0;
      span_q        <= '0;
      inside_q      <= 1'b0;
      index_light_o <= 1'b0;
      startup_o     <= '0;
    end
  end

  // ---- what is told ----
  logic [1:0] scan_q;
  logic       guard_q;
  assign status_o = {scan_q, tripped_q, full_q, armed_q[1], guard_q, heard_q};

  always_ff @(posedge clk_i) begin
    scan_q  <= {startup_ok_i, scanning_i};
    guard_q <= guard_ok_i;
    signature_o <= ^{limit_power_q, limit_startup_q, limit_pulse_q, drain_q, bucket_q, threshold_q,
                     watchdog_q, silent_q, heard_q, tripped_q, permit_q, cut_q, full_q, armed_q,
                     clks_q, power_o, level_q, delta_q, offset_q, span_q, inside_q, index_light_o,
                     startup_o};
    if (cut_q && pulse_i) cut_count_o <= vrscan_pkg::counted(cut_count_o, CountWidth);
    if (full_q && !full_before_q) duty_count_o <= vrscan_pkg::counted(duty_count_o, CountWidth);
    if (tripping && !tripped_q) begin
      watchdog_count_o <= vrscan_pkg::counted(watchdog_count_o, CountWidth);
    end

    if (rst_i) begin
      scan_q           <= '0;
      guard_q          <= 1'b0;
      signature_o      <= 1'b0;
      cut_count_o      <= '0;
      duty_count_o     <= '0;
      watchdog_count_o <= '0;
    end
  end

endmodule

`default_nettype wire
