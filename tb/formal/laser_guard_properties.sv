// laser_guard_properties: what laser_guard never lets through, with any inputs.
//
// Every input is free in every clock, the reset too but for the first one.  What begins with "step_"
// is no claim of its own but what the induction needs; scripts/formal.py ties the wires "inside_*"
// to registers of the same name.

`default_nettype none

module laser_guard_properties #(
  parameter int unsigned GuardClks    = 16,
  parameter int unsigned PulseClks    = 320,
  parameter int unsigned BurstClks    = 400,
  parameter int unsigned IndexClks    = 320_000_000,
  parameter int unsigned StartupClks  = 64,
  parameter int unsigned DriveClks    = 100_000,
  parameter int unsigned RestartBeats = 16
) (
  input wire logic clk_i,
  input wire logic rst_i,
  input wire logic heartbeat_i,
  input wire logic enable_i,
  input wire logic pulse_i,
  input wire logic index_light_i,
  input wire logic startup_pin_i,
  input wire logic drive_i,
  input wire logic level_pin_i
);

  logic pulse, index_light, startup_pin, drive, level_pin, ok;
  logic [4:0] fault;

  laser_guard #(
    .GuardClks(GuardClks), .PulseClks(PulseClks), .BurstClks(BurstClks), .IndexClks(IndexClks),
    .StartupClks(StartupClks), .DriveClks(DriveClks), .RestartBeats(RestartBeats)
  ) dut (
    .clk_i, .rst_i, .heartbeat_i, .enable_i, .pulse_i, .index_light_i, .startup_pin_i, .drive_i,
    .level_pin_i,
    .pulse_o      (pulse),
    .index_light_o(index_light),
    .startup_pin_o(startup_pin),
    .drive_o      (drive),
    .level_pin_o  (level_pin),
    .beat_o       (),
    .ok_o         (ok),
    .fault_o      (fault)
  );

  localparam int unsigned BudgetWidth = 31;
  typedef logic [BudgetWidth-1:0] budget_t;
  localparam int unsigned BurstEnd = 7 * BurstClks;
  localparam int unsigned StartupEnd = 7 * StartupClks;
  localparam int unsigned IndexEnd = IndexClks;

  // Tied to registers of dut.
  (* keep *) wire [$clog2(GuardClks+1)-1:0] inside_silent_q;
  (* keep *) wire [$clog2(PulseClks+1)-1:0] inside_high_q;
  (* keep *) wire [$clog2(DriveClks+1)-1:0] inside_driven_q;
  (* keep *) wire [$clog2(RestartBeats+1)-1:0] inside_beats_q;
  (* keep *) wire inside_heartbeat_q, inside_fresh_q, inside_moves_q;
  (* keep *) wire [BudgetWidth-1:0] inside_burst_q, inside_index_q, inside_startup_q;
  // Of heartbeat, enable, pulse, index light, start-up level and drive.
  (* keep *) wire [5:0] inside_dut__u_core__meta_q, inside_dut__u_core__stable_q;

  // ---- what has been ----
  logic        first_q = 1'b1;
  logic        heartbeat_q, ok_q, moves_q;
  logic [15:0] silent_q;  // clocks since a change was sampled
  logic [15:0] request_q;  // clocks that the request has been sampled high
  logic [15:0] long_q;  // clocks that the pulse has been on
  logic [31:0] swing_q;  // clocks that the drive has been asked for
  logic [31:0] rest_q;  // clocks that it has been high at the pin
  logic [ 2:0] disabled_q;  // enable_i was low, the newest clock first
  logic [ 2:0] lowered_q;  // it was, and that was after the reset
  logic [ 1:0] since_q;  // clocks since the reset
  logic        owed_q;  // a new enable
  // What light of any stretch that ends here is above its share of the time.
  budget_t     bursts_q, indices_q, startups_q;

  function automatic logic [15:0] more(input logic [15:0] count);
    more = count == '1 ? count : count + 16'd1;
  endfunction

  function automatic logic [31:0] longer(input logic [31:0] count);
    longer = count == '1 ? count : count + 32'd1;
  endfunction

  function automatic budget_t spend(input budget_t level, input logic on, input budget_t cost);
    spend = on ? level + cost : level == '0 ? '0 : level - budget_t'(1);
  endfunction

  // The same, and no more than there is room for.
  function automatic budget_t fill(input budget_t level, input logic on, input budget_t cost,
                                   input budget_t most);
    fill = spend(level, on, cost) > most ? most : spend(level, on, cost);
  endfunction

  always_ff @(posedge clk_i) begin
    first_q     <= 1'b0;
    heartbeat_q <= !rst_i && heartbeat_i;
    ok_q        <= !rst_i && ok;
    moves_q     <= !rst_i && inside_moves_q;
    silent_q    <= rst_i || heartbeat_i != heartbeat_q ? 16'd0 : more(silent_q);
    request_q   <= rst_i || !pulse_i ? 16'd0 : more(request_q);
    long_q      <= rst_i || !pulse ? 16'd0 : more(long_q);
    swing_q     <= rst_i || !drive_i ? 32'd0 : longer(swing_q);
    rest_q      <= rst_i || !drive ? 32'd0 : longer(rest_q);
    disabled_q  <= rst_i ? '1 : {disabled_q[1:0], !enable_i};
    lowered_q   <= rst_i ? '0 : {lowered_q[1:0], !enable_i};
    since_q     <= rst_i ? '0 : since_q == '1 ? since_q : since_q + 2'd1;
    owed_q      <= rst_i || (ok_q && !ok && !disabled_q[1] && !disabled_q[2])
                   || (owed_q && !lowered_q[1]);
    bursts_q    <= rst_i ? '0 : spend(bursts_q, pulse, budget_t'(7));
    indices_q   <= rst_i ? '0 : spend(indices_q, index_light, budget_t'(1));
    startups_q  <= rst_i ? '0 : spend(startups_q, startup_pin, budget_t'(7));
  end

  // The budgets with what is on its way into them.
  budget_t burst, index, startup;
  localparam int unsigned BurstMost = BurstEnd + 28;
  localparam int unsigned StartupMost = StartupEnd + 28;
  localparam int unsigned IndexMost = IndexEnd + 4;
  budget_t burst_older, index_older, startup_older;
  assign burst_older   = fill(inside_burst_q, inside_dut__u_core__stable_q[3], budget_t'(7),
                              budget_t'(BurstMost));
  assign index_older   = fill(inside_index_q, inside_dut__u_core__stable_q[2], budget_t'(1),
                              budget_t'(IndexMost));
  assign startup_older = fill(inside_startup_q, inside_dut__u_core__stable_q[1], budget_t'(7),
                              budget_t'(StartupMost));
  assign burst   = fill(burst_older, inside_dut__u_core__meta_q[3], budget_t'(7),
                        budget_t'(BurstMost));
  assign index   = fill(index_older, inside_dut__u_core__meta_q[2], budget_t'(1),
                        budget_t'(IndexMost));
  assign startup = fill(startup_older, inside_dut__u_core__meta_q[1], budget_t'(7),
                        budget_t'(StartupMost));

  always_comb begin
    assume (!first_q || rst_i);
    if (!first_q) begin
      gates_only_take_away:
      assert ((pulse_i || !pulse) && (index_light_i || !index_light) &&
              (startup_pin_i || !startup_pin) && (drive_i || !drive) &&
              (level_pin_i || !level_pin));
      no_light_without_heartbeat:
      assert (silent_q < 16'(GuardClks + 3) || (!pulse && !index_light && !startup_pin));
      no_voltage_without_heartbeat:
      assert (silent_q < 16'(GuardClks + 3) || (!drive && !level_pin));
      no_light_without_enable:
      assert (disabled_q != '1 || (!pulse && !index_light && !startup_pin));
      new_enable_after_a_trip: assert (!owed_q || (!pulse && !index_light && !startup_pin));
      a_trip_is_told: assert (!ok_q || ok || disabled_q[1] || disabled_q[2] || fault != '0);
      pulse_length: assert (!pulse || long_q < 16'(PulseClks + 3));
      pulses_of_any_stretch: assert (bursts_q <= budget_t'(BurstMost));
      index_light_of_any_stretch: assert (indices_q <= budget_t'(IndexMost));
      level_of_any_stretch: assert (startups_q <= budget_t'(StartupMost));
      no_voltage_that_stays: assert (!drive || rest_q < 32'(DriveClks + 3));

      step_silent: assert (silent_q < 16'd2 || 16'(inside_silent_q) == 16'(GuardClks) ||
                           16'(inside_silent_q) >= silent_q - 16'd2);
      step_silent_range: assert (16'(inside_silent_q) <= 16'(GuardClks));
      step_high: assert (request_q < 16'd2 || 16'(inside_high_q) == 16'(PulseClks) ||
                         16'(inside_high_q) >= request_q - 16'd2);
      step_high_range: assert (16'(inside_high_q) <= 16'(PulseClks));
      step_long: assert (!pulse || long_q <= request_q);
      step_driven: assert (swing_q < 32'd2 || 32'(inside_driven_q) == 32'(DriveClks) ||
                           32'(inside_driven_q) >= swing_q - 32'd2);
      step_driven_range: assert (32'(inside_driven_q) <= 32'(DriveClks));
      step_rest: assert (!drive || rest_q <= swing_q);
      step_heartbeat: assert (inside_dut__u_core__meta_q[5] == heartbeat_q);
      step_ready: assert (!ok || 16'(inside_beats_q) == 16'(RestartBeats));
      step_enable: assert (inside_dut__u_core__meta_q[4] == !disabled_q[0] &&
                           inside_dut__u_core__stable_q[4] == !disabled_q[1]);
      step_fresh: assert (!ok || inside_fresh_q);
      step_since: assert (since_q > 2'd2 || (16'(inside_silent_q) == 16'(GuardClks) &&
                                             inside_beats_q == '0));
      step_lowered: assert (lowered_q[1] == disabled_q[1] || since_q < 2'd2);
      step_lowered_0: assert (lowered_q[0] == disabled_q[0] || since_q < 2'd1);
      step_owed: assert (!owed_q || !inside_fresh_q);
      step_trip: assert (!ok_q || ok || disabled_q[2] || !inside_fresh_q || disabled_q[1]);
      step_bursts: assert (bursts_q <= burst && inside_burst_q <= budget_t'(BurstMost));
      step_indices: assert (indices_q <= index && inside_index_q <= budget_t'(IndexMost));
      step_startups: assert (startups_q <= startup && inside_startup_q <= budget_t'(StartupMost));
      step_budgets: assert (!ok || (inside_burst_q < budget_t'(BurstEnd + 7) &&
                                    inside_index_q < budget_t'(IndexEnd + 1) &&
                                    inside_startup_q < budget_t'(StartupEnd + 7)));

      light: cover (pulse && index_light && long_q == 16'd2);
      motion: cover (drive && level_pin && rest_q == 32'd2);
      light_after_a_trip: cover (ok && fault != '0 && pulse);
    end
  end

endmodule

`default_nettype wire
