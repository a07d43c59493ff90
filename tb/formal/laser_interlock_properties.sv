// laser_interlock_properties: what the light behind laser_interlock never does, with any inputs.
//
// Every input is free in every clock, the reset too but for the first one.  "held" says that the
// limits have stood for as long as they take to get through; without it the ceilings hold.  What
// begins with "step_" is no claim of its own but what the induction needs; scripts/formal.py ties
// the wires "inside_*" to registers of the same name.

`default_nettype none

module laser_interlock_properties #(
  parameter int unsigned StartupCeiling      = 1_311,
  parameter int unsigned PowerCeiling        = 65_535,
  parameter int unsigned PulseCeilingClks    = 1_250,
  parameter int unsigned DrainCeiling        = 4_096,
  parameter int unsigned BucketCeiling       = 268_435_456,
  parameter int unsigned WatchdogCeilingClks = 134_217_728
) (
  input wire logic                        clk_i,
  input wire logic                        rst_i,
  input wire logic                        pulse_i,
  input wire logic [15:0]                 power_i,
  input wire logic                        line_start_i,
  input wire logic [2:0]                  state_i,
  input wire logic                        index_alive_i,
  input wire logic                        scanning_i,
  input wire logic                        startup_ok_i,
  input wire logic [15:0]                 phase_i,
  input wire logic                        alive_i,
  input wire logic                        guard_ok_i,
  input wire register_pkg::laser_t        laser_i,
  input wire register_pkg::laser_limits_t laser_limits_i,
  input wire logic                        window_i  // a stretch of time begins, at any moment
);

  logic        pulse, index_light;
  logic [15:0] power, startup;

  laser_interlock #(
    .PowerCeiling(PowerCeiling), .StartupCeiling(StartupCeiling),
    .PulseCeilingClks(PulseCeilingClks), .DrainCeiling(DrainCeiling),
    .BucketCeiling(BucketCeiling), .WatchdogCeilingClks(WatchdogCeilingClks)
  ) dut (
    .clk_i, .rst_i,
    .pulse_i, .power_i, .line_start_i, .state_i, .index_alive_i, .scanning_i, .startup_ok_i,
    .phase_i, .alive_i, .guard_ok_i,
    .laser_i, .laser_limits_i,
    .pulse_o         (pulse),
    .power_o         (power),
    .index_light_o   (index_light),
    .startup_o       (startup),
    .armed_o         (),
    .status_o        (),
    .cut_count_o     (),
    .duty_count_o    (),
    .watchdog_count_o()
  );

  // Tied to registers of dut.
  (* keep *) wire        inside_heard_q;
  (* keep *) wire [31:0] inside_silent_q, inside_watchdog_q;
  (* keep *) wire [19:0] inside_clks_q, inside_limit_pulse_q;
  (* keep *) wire [31:0] inside_level_q, inside_bucket_q;
  (* keep *) wire [17:0] inside_delta_q;
  (* keep *) wire [15:0] inside_drain_q, inside_limit_power_q, inside_limit_startup_q;
  (* keep *) wire [32:0] inside_threshold_q;
  (* keep *) wire        inside_full_q, inside_permit_q;

  // ---- what has been ----
  logic        first_q = 1'b1;
  logic        well_q;  // the interlock, a clock ago
  logic        settling_q, run_q, startup_ok_q;
  logic        awake_q;
  logic        pulse_q;
  logic        guard_q;
  logic [ 3:0] held_q;  // clocks that the limits have stood, up to 15
  register_pkg::laser_limits_t limits_q;
  logic [32:0] silent_q;  // clocks since the host was heard
  logic        heard_q;  // it was, ever
  logic [20:0] long_q;  // clocks that the pulse has been on
  // Energy since window_i less what drained; it may be more than that, but no more than nothing.
  logic signed [47:0] excess_q, excess;
  logic        same, held;
  assign same = limits_q == laser_limits_i;
  logic [32:0] watchdog;  // clocks after which the silent host is noticed
  logic [33:0] bucket;
  assign watchdog = 33'(laser_limits_i.laser_watchdog_clks) + 33'd2;
  assign bucket   = 34'(laser_limits_i.laser_limit_bucket);
  assign held = held_q >= 4'd3 && same;

  logic [15:0] added;
  logic [16:0] total;
  assign added = pulse ? power : 16'd0;
  assign total = {1'b0, added} + {1'b0, index_light ? startup : 16'd0};

  localparam logic signed [47:0] Floor = 48'sh10_0000_0000;
  assign excess = excess_q + signed'(48'(added)) - signed'(48'(inside_drain_q));

  // The bucket with what is on its way into it.
  logic signed [33:0] filling;
  logic        [33:0] filled;
  assign filling = signed'({2'b00, inside_level_q}) + 34'(signed'(inside_delta_q));
  assign filled  = filling[33] ? '0 : unsigned'(filling);

  // The limits have stood long enough, and with them what is in the bucket has been within it.
  logic fits_q;

  always_ff @(posedge clk_i) begin
    first_q          <= 1'b0;
    fits_q           <= !rst_i && same && (fits_q || (held_q == 4'd15 && filled <= bucket));
    well_q           <= !rst_i && state_i == 3'(vrscan_pkg::MirrorRun) && index_alive_i &&
                        scanning_i && laser_i.laser_enable;
    settling_q       <= state_i == 3'(vrscan_pkg::MirrorSettle);
    startup_ok_q     <= !rst_i && startup_ok_i;
    run_q            <= state_i == 3'(vrscan_pkg::MirrorRun);
    awake_q          <= !rst_i && laser_i.laser_enable;
    pulse_q          <= pulse_i;
    guard_q          <= !rst_i && guard_ok_i;
    limits_q         <= laser_limits_i;
    held_q           <= rst_i || !same ? 4'd0 : held_q == 4'd15 ? held_q : held_q + 4'd1;
    heard_q          <= !rst_i && (heard_q || alive_i);
    silent_q         <= rst_i || alive_i ? 33'd0 : silent_q == '1 ? silent_q : silent_q + 33'd1;
    long_q           <= rst_i || !pulse ? 21'd0 : long_q == '1 ? long_q : long_q + 21'd1;
    excess_q         <= rst_i || window_i ? 48'sd0 : excess < -Floor ? -Floor : excess;
  end

  always_comb begin
    assume (!first_q || rst_i);
    if (!first_q) begin
      // Without RUN, index, safeguard, enable: nothing of the main channel, at once.
      dark_without_interlock: assert (well_q || (!pulse && power == '0 && total <= 17'(startup)));
      startup_limit_without_interlock:
      assert (well_q || (total <= 17'(StartupCeiling) &&
                         (!held || total <= 17'(laser_limits_i.laser_limit_startup))));
      no_light_without_enable: assert (awake_q || (!pulse && !index_light && startup == '0));
      no_light_but_in_settle_and_run:
      assert (settling_q || run_q || (!pulse && !index_light && total == '0));
      no_start_up_light_without_safeguard:
      assert (startup_ok_q || (!index_light && startup == '0));
      no_light_without_guard: assert (guard_q || (!pulse && !index_light));
      // A silent host.
      no_light_before_a_host:
      assert (heard_q || (!pulse && !index_light));
      no_light_of_a_silent_host:
      assert (silent_q < 33'(WatchdogCeilingClks) + 33'd2 || (!pulse && !index_light));
      no_light_of_a_silent_host_by_register:
      assert (!held || laser_limits_i.laser_watchdog_clks == '0 ||
              silent_q < watchdog || (!pulse && !index_light));
      // The length of a pulse.
      pulse_length: assert (!pulse || (long_q < 21'(PulseCeilingClks) &&
                                       (!held ||
                                        long_q < 21'(laser_limits_i.laser_limit_pulse_clks))));
      no_second_pulse_of_a_request: assert (!pulse || !pulse_q || long_q != '0);
      // Powers.
      power_limit: assert (power <= 16'(PowerCeiling) &&
                           (!held || power <= laser_limits_i.laser_limit_power));
      startup_limit: assert (startup <= 16'(StartupCeiling) &&
                             (!held || startup <= laser_limits_i.laser_limit_startup));
      // Energy of any stretch of time: what drained meanwhile, and the bucket.
      drain_limit: assert (inside_drain_q <= 16'(DrainCeiling) &&
                           (!held || inside_drain_q <= laser_limits_i.laser_limit_drain));
      energy_of_any_stretch: assert (excess_q <= signed'(48'(filled)));
      bucket_limit: assert (filled <= 34'(BucketCeiling));
      energy_by_register: assert (!fits_q || filled <= 34'(limits_q.laser_limit_bucket));

      step_silent: assert (!inside_heard_q || {1'b0, inside_silent_q} == silent_q);
      step_heard: assert (!inside_heard_q || heard_q);
      step_watchdog: assert (inside_watchdog_q <= WatchdogCeilingClks);
      step_clks: assert (!inside_permit_q || long_q <= 21'(inside_clks_q));
      step_long: assert (!pulse || long_q == 21'(inside_clks_q));
      step_pulse: assert (inside_limit_pulse_q <= 20'(PulseCeilingClks));
      step_threshold: assert (signed'(inside_threshold_q) <=
                              signed'(33'(BucketCeiling)) - 33'sd262144);
      step_bucket: assert (inside_bucket_q <= BucketCeiling);
      step_powers: assert (inside_limit_power_q <= 16'(PowerCeiling) &&
                           inside_limit_startup_q <= 16'(StartupCeiling));

      full_power: cover (held && pulse && power == 16'(PowerCeiling) && long_q == 21'd4);
      startup_in_settle: cover (index_light && settling_q && startup == 16'(StartupCeiling));
      startup_in_run: cover (index_light && run_q && !pulse && startup != '0);
      bucket_full: cover (inside_full_q && well_q && excess_q > 48'sd0);
      cut: cover (pulse_i && pulse_q && !pulse && well_q && long_q == 21'd3);
    end
  end

endmodule

`default_nettype wire
