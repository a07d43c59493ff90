// laser_pair_properties: laser_interlock with the state of the real mirror_drive.
//
// The interlock hangs on mirror_drive's state; here that state is the real one, and mirror_drive's
// own inputs are free.  What begins with "step_" is no claim of its own but what the induction needs;
// scripts/formal.py ties the wires "inside_*" to registers of the same name of the drive.

`default_nettype none

module laser_pair_properties #(
  parameter int unsigned SettleCeilingClks = 1_250_000_000,
  parameter int unsigned LostCeilingClks   = 3_125_000,
  parameter int unsigned LevelCeiling      = 1_047_527,
  parameter int unsigned DutyCeiling       = 32_768
) (
  input wire logic                         clk_i,
  input wire logic                         rst_i,
  input wire logic                         enable_i,
  input wire logic                         index_alive_i,
  input wire logic                         scanning_i,
  input wire logic                         startup_ok_i,
  input wire logic                         settled_i,
  input wire logic [19:0]                  level_i,
  input wire logic signed [31:0]           trim_i,
  input wire register_pkg::mirror_t        mirror_i,
  input wire register_pkg::mirror_limits_t mirror_limits_i,
  input wire logic                         pulse_i,
  input wire logic [15:0]                  power_i,
  input wire logic                         line_start_i,
  input wire logic [15:0]                  phase_i,
  input wire logic                         alive_i,
  input wire logic                         guard_ok_i,
  input wire register_pkg::laser_t         laser_i,
  input wire register_pkg::laser_limits_t  laser_limits_i
);

  logic [ 2:0] state;
  logic        pulse, index_light;
  logic [15:0] power, startup;
  logic        drive;
  logic [19:0] level;
  logic [47:0] drive_phase, drive_phase_q, drive_phase_q2;

  mirror_drive #(
    .SettleCeilingClks(SettleCeilingClks), .LostCeilingClks(LostCeilingClks),
    .LevelCeiling(LevelCeiling), .DutyCeiling(DutyCeiling)
  ) dut (
    .clk_i, .rst_i, .enable_i, .index_alive_i, .settled_i, .level_i, .trim_i,
    .state_o    (state),
    .fault_o    (),
    .drive_o    (drive),
    .level_o    (level),
    .level_pin_o(),
    .phase_o    (drive_phase),
    .word_o     (),
    .mirror_i, .mirror_limits_i
  );

  laser_interlock u_laser_interlock (
    .clk_i, .rst_i, .pulse_i, .power_i, .line_start_i,
    .state_i         (state),
    .index_alive_i, .scanning_i, .startup_ok_i, .phase_i, .alive_i, .guard_ok_i, .laser_i,
    .laser_limits_i,
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

  (* keep *) wire [31:0] inside_timer_q, inside_limit;
  (* keep *) wire        inside_stop_q, inside_expired_q, inside_high_q;
  (* keep *) wire [15:0] inside_duty_q;

  localparam logic [2:0] Off = 3'(vrscan_pkg::MirrorOff);
  localparam logic [2:0] Settle = 3'(vrscan_pkg::MirrorSettle);
  localparam logic [2:0] Run = 3'(vrscan_pkg::MirrorRun);
  localparam logic [2:0] Fault = 3'(vrscan_pkg::MirrorFault);

  logic        first_q = 1'b1;
  logic        run_q, lit_q, alive_q, stopping_q;
  logic [31:0] lost_timeout_q;
  logic [32:0] away_q;  // clocks without an index since RUN, lost_timeout and enable as they are
  logic        goes_on;
  logic [32:0] gone_q, searched_q;  // clocks in RUN without an index, and in SETTLE, while enabled
  assign goes_on = !index_alive_i && enable_i && !stopping_q &&
                   mirror_limits_i.lost_timeout == lost_timeout_q && (state == Run || away_q != '0);

  always_ff @(posedge clk_i) begin
    first_q        <= 1'b0;
    drive_phase_q  <= drive_phase;
    drive_phase_q2 <= drive_phase_q;
    run_q          <= !rst_i && state == Run;
    lit_q          <= !rst_i && state != Off && state != Fault;
    alive_q        <= index_alive_i;
    stopping_q     <= !rst_i && state != Off && (stopping_q || !enable_i);
    lost_timeout_q <= mirror_limits_i.lost_timeout;
    gone_q         <= rst_i || state != Run || index_alive_i || !enable_i || stopping_q ? 33'd0
                      : gone_q == '1 ? gone_q : gone_q + 33'd1;
    searched_q     <= rst_i || state != Settle || !enable_i || stopping_q ? 33'd0
                      : searched_q == '1 ? searched_q : searched_q + 33'd1;
    away_q         <= rst_i || !goes_on ? 33'd0 : away_q == '1 ? away_q : away_q + 33'd1;
  end

  always_comb begin
    assume (!first_q || rst_i);
    if (!first_q) begin
      pulses_in_run_only: assert (run_q || (!pulse && power == '0));
      no_light_off_or_fault: assert (lit_q || (!pulse && !index_light && startup == '0));
      no_pulse_without_index: assert (alive_q || !pulse);
      // A stopped mirror: no light of any kind after the time-out and 3 clocks.
      no_light_of_a_stopped_mirror:
      assert (away_q < {1'b0, lost_timeout_q} + 33'd3 || (!pulse && !index_light));

      step_stop: assert (!inside_stop_q || stopping_q || state == Off);
      step_timer: assert (away_q == '0 || state != Run || {1'b0, inside_timer_q} >= away_q ||
                          inside_expired_q);
      step_away: assert (away_q == '0 || state == Run || state == Fault);
      step_lost: assert (away_q < {1'b0, lost_timeout_q} + 33'd2 || state == Fault);
      step_limit: assert (away_q == '0 || state != Run ||
                          inside_limit == (lost_timeout_q > LostCeilingClks ? LostCeilingClks
                                                                            : lost_timeout_q));

      // Ceilings, whatever the registers say and how often they change.
      no_run_of_a_stopped_mirror: assert (state != Run || gone_q <= 33'(LostCeilingClks) + 33'd2);
      no_endless_search: assert (state != Settle || searched_q <= 33'(SettleCeilingClks) + 33'd2);
      step_gone: assert (state != Run || gone_q == '0 || inside_expired_q ||
                         ({1'b0, inside_timer_q} >= gone_q && gone_q <= 33'(LostCeilingClks)));
      step_searched: assert (state != Settle || searched_q == '0 || inside_expired_q ||
                             ({1'b0, inside_timer_q} + 33'd1 >= searched_q &&
                              searched_q <= 33'(SettleCeilingClks) + 33'd1));
      step_ceilings: assert ((state != Run || inside_limit <= LostCeilingClks) &&
                             (state != Settle || inside_limit <= SettleCeilingClks));

      // What the comb gets, whatever the registers say: the phase is that of the pulse.
      drive_level_ceiling: assert (level <= 20'(LevelCeiling));
      drive_duty_ceiling: assert (!drive || drive_phase_q2[46-:16] < 16'(DutyCeiling));
      step_duty: assert (inside_duty_q <= 16'(DutyCeiling));
      step_high: assert (!inside_high_q || drive_phase_q[46-:16] < 16'(DutyCeiling));

      pulse_in_run: cover (pulse && power == 16'hffff);
      fault: cover (state == Fault && away_q != '0 && startup == '0);
    end
  end

endmodule

`default_nettype wire
