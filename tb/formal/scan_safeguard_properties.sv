// scan_safeguard_properties: the light behind a mirror that stops, whatever the registers hold.
//
// The real index_capture, mirror_drive, scan_safeguard and laser_interlock; every register and the
// samples of the index are free in every clock.  quiet_q counts from the last clock in which the
// comparator changed within an opening of its gate: a beam at rest changes none.  RealMirror 0 takes
// free states, words and index_alive in place of those of index_capture and mirror_drive, for
// covers and faults, which the real ones would put beyond a solver's reach.  What begins with "step_"
// is no claim of its own but what the induction needs; scripts/formal.py ties the wires "inside_*".

`default_nettype none

module scan_safeguard_properties #(
  parameter int unsigned SettleClks        = 13,
  parameter int unsigned LightClks         = 1_250_000,
  parameter int unsigned PeriodFloorClks   = 250_000,
  parameter int unsigned OuterFloor        = 6_144,
  parameter int unsigned DarkClks          = 3_125_000,
  parameter int unsigned PauseClks         = 31_250_000,
  parameter int unsigned PeriodCeilingClks = 1_250_000,
  parameter int unsigned SettleCeilingClks = 1_250_000_000,
  parameter int unsigned LostCeilingClks   = 3_125_000,
  parameter int unsigned TurnsFraction     = 32,
  parameter bit          RealMirror        = 1'b1
) (
  input wire logic                         clk_i,
  input wire logic                         rst_i,
  input wire logic [1:0]                   comparator_i,
  input wire logic [1:0]                   gate_i,
  input wire logic [2:0]                   state_i,
  input wire logic [39:0]                  word_i,
  input wire logic                         index_alive_i,
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
  input wire register_pkg::laser_limits_t  laser_limits_i,
  output     logic [32:0]                  quiet_o
);

  logic        index_alive, real_alive, scanning, startup_ok, pulse, index_light;
  logic [ 2:0] state, real_state;
  logic [39:0] word, real_word;
  logic [15:0] power, startup;

  index_capture #(.IndexOversample(2), .PeriodCeilingClks(PeriodCeilingClks)) u_index_capture (
    .clk_i, .rst_i, .comparator_i, .gate_i, .mirror_i,
    .valid_o           (),
    .outward_o         (),
    .age_o             (),
    .missing_o         (),
    .doubled_o         (),
    .impossible_o      (),
    .alive_o           (real_alive),
    .missing_count_o   (),
    .doubled_count_o   (),
    .impossible_count_o(),
    .glitch_count_o    ()
  );

  mirror_drive #(
    .SettleCeilingClks(SettleCeilingClks), .LostCeilingClks(LostCeilingClks)
  ) u_mirror_drive (
    .clk_i, .rst_i, .settled_i, .level_i, .trim_i, .mirror_i, .mirror_limits_i,
    .enable_i     (mirror_i.mirror_enable),
    .index_alive_i(real_alive),
    .state_o      (real_state),
    .fault_o      (),
    .drive_o      (),
    .level_o      (),
    .level_pin_o  (),
    .phase_o      (),
    .word_o       (real_word)
  );

  assign index_alive = RealMirror ? real_alive : index_alive_i;
  assign state       = RealMirror ? real_state : state_i;
  assign word        = RealMirror ? real_word : word_i;

  scan_safeguard #(
    .IndexOversample(2), .SettleClks(SettleClks), .LightClks(LightClks),
    .PeriodFloorClks(PeriodFloorClks), .OuterFloor(OuterFloor), .DarkClks(DarkClks),
    .PauseClks(PauseClks), .TurnsFraction(TurnsFraction)
  ) dut (
    .clk_i, .rst_i, .comparator_i, .gate_i,
    .word_i      (word),
    .state_i     (state),
    .enable_i    (laser_i.laser_enable),
    .scanning_o  (scanning),
    .startup_ok_o(startup_ok)
  );

  laser_interlock u_laser_interlock (
    .clk_i, .rst_i, .pulse_i, .power_i, .line_start_i, .phase_i, .alive_i, .guard_ok_i,
    .laser_i, .laser_limits_i,
    .state_i         (state),
    .index_alive_i   (index_alive),
    .scanning_i      (scanning),
    .startup_ok_i    (startup_ok),
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

  // ---- inside ----
  (* keep *) wire inside_open_q, inside_full_q, inside_value_q, inside_known_q, inside_level_q;
  (* keep *) wire inside_edge_q, inside_begun_q, inside_whole_q;
  (* keep *) wire [$clog2(SettleClks+1)-1:0] inside_run_q;
  (* keep *) wire [$clog2(LightClks+1)-1:0] inside_clks_q;
  (* keep *) wire [TurnsFraction:0] inside_turns_q;
  (* keep *) wire [$clog2(DarkClks+1)-1:0] inside_on_q;
  (* keep *) wire [$clog2(PauseClks+1)-1:0] inside_pause_q;
  (* keep *) wire inside_index_capture__open_q2, inside_index_capture__uniform_q;
  (* keep *) wire inside_index_capture__value_q, inside_index_capture__known_q;
  (* keep *) wire inside_index_capture__level_q, inside_index_capture__crossing_q;
  (* keep *) wire inside_index_capture__settled_q, inside_index_capture__pending_q;
  (* keep *) wire inside_index_capture__started_q;
  (* keep *) wire [7:0] inside_index_capture__left_q, inside_index_capture__run_clks_q;
  (* keep *) wire signed [32:0] inside_index_capture__period_left_q;
  (* keep *) wire signed [32:0] inside_index_capture__period_first_q;

  // ---- what has been ----
  localparam logic [2:0] Settle = 3'(vrscan_pkg::MirrorSettle);
  localparam logic [2:0] Run = 3'(vrscan_pkg::MirrorRun);
  localparam int unsigned EdgeClks = SettleClks + 3;
  localparam int unsigned CrossingClks = 262;  // a change to its crossing, glitch_clks at its most
  localparam logic [TurnsFraction:0] OuterTurns =
      (TurnsFraction + 1)'(OuterFloor) << (TurnsFraction - 16);
  localparam logic [33:0] ThreeHalves = 34'd3 << (TurnsFraction - 1);

  logic        first_q = 1'b1;
  logic [ 1:0] comparator_q, gate_q;
  logic        changes, lit;
  logic [32:0] quiet_q;  // clocks since an edge
  logic [33:0] turned_q, turned_q2, turned_q3;  // turns of the drive, once the edge has been seen
  logic [31:0] dark_q;  // clocks without light of the start-up channel
  logic [32:0] since_q;  // clocks since an edge or the end of a pause
  logic [32:0] period_q;  // clocks since an outward edge
  logic        impossible_q, impossible_q2;  // the period is too short, or its beam too small
  logic        good_q;  // a period within all limits ended a clock ago
  assign changes = gate_i == '1 && gate_q == '1 && comparator_i != comparator_q;
  assign quiet_o = quiet_q;
  assign lit     = index_light || startup != '0;
  logic        lit_state_q;  // SETTLE or RUN, a clock ago
  logic        searched_q, dark_before_q;  // there was light, and a whole pause behind it

  always_ff @(posedge clk_i) begin
    first_q      <= 1'b0;
    comparator_q <= comparator_i;
    gate_q       <= gate_i;
    if (rst_i || changes) quiet_q <= 33'd1;
    else if (quiet_q != '1) quiet_q <= quiet_q + 33'd1;

    if (rst_i || changes || quiet_q < 33'(EdgeClks)) turned_q <= '0;
    else if (turned_q < ThreeHalves) turned_q <= turned_q + 34'(word[39:16]);
    lit_state_q   <= !rst_i && (state == Settle || state == Run);
    searched_q    <= !rst_i && (searched_q || lit);
    dark_before_q <= !rst_i && (dark_before_q || (searched_q && dark_q >= PauseClks));
    turned_q2 <= rst_i ? '0 : turned_q;
    turned_q3 <= rst_i ? '0 : turned_q2;

    if (rst_i) dark_q <= '1;
    else if (lit) dark_q <= '0;
    else if (dark_q != '1) dark_q <= dark_q + 32'd1;
    if (rst_i) period_q <= '1;
    else if (inside_edge_q && inside_level_q) period_q <= 33'd1;
    else if (period_q != '1) period_q <= period_q + 33'd1;
    if (rst_i) impossible_q <= 1'b0;
    else if (inside_edge_q && inside_level_q) impossible_q <= period_q < 33'(PeriodFloorClks);
    else if (inside_edge_q && inside_turns_q < OuterTurns) impossible_q <= 1'b1;
    impossible_q2 <= !rst_i && impossible_q;
    good_q <= !rst_i && inside_edge_q && inside_level_q && inside_begun_q && inside_whole_q &&
              34'(inside_turns_q) >= ThreeHalves >> 1 && 34'(inside_turns_q) < ThreeHalves &&
              32'(inside_clks_q) + 32'd1 >= PeriodFloorClks + EdgeClks &&
              32'(inside_clks_q) + 32'd2 < LightClks;

    if (rst_i || dark_q >= PauseClks - 1) since_q <= '0;
    else if (changes) since_q <= 33'd1;
    else if (since_q != '1) since_q <= since_q + 33'd1;
  end

  always_comb begin
    assume (!first_q || rst_i);
    if (!first_q) begin
      no_pulse_of_a_mirror_at_rest:
      assert (quiet_q < 33'(LightClks) || (!pulse && power == '0));
      no_pulse_after_three_half_turns:
      assert (turned_q3 < ThreeHalves || (!pulse && power == '0));
      no_pulse_in_an_impossible_period:
      assert (!impossible_q || !impossible_q2 || (!pulse && power == '0));
      a_good_period_is_taken: assert (!good_q || scanning);
      no_light_of_a_mirror_at_rest: assert (since_q < 33'(DarkClks) || !lit);
      no_start_up_light_but_in_settle_and_run: assert (!lit || lit_state_q);
      no_index_of_a_mirror_at_rest:
      assert (quiet_q <= 33'(PeriodCeilingClks + CrossingClks) || !real_alive);
      period_ceiling:
      assert (inside_index_capture__period_first_q < signed'(33'(PeriodCeilingClks)));

      step_quiet: assert (quiet_q != '0 && since_q <= quiet_q);
      step_run: assert (!inside_known_q || inside_run_q == '0 || inside_value_q == inside_level_q ||
                        quiet_q <= 33'(inside_run_q) + 33'd1);
      step_edge: assert (!inside_edge_q || quiet_q < 33'(EdgeClks));
      step_clks: assert (!inside_begun_q || quiet_q <= 33'(inside_clks_q));
      step_scanning: assert (!scanning || (inside_begun_q && quiet_q <= 33'(LightClks - 2)));
      step_impossible: assert (!impossible_q || !scanning);
      step_period: assert (!inside_begun_q || 34'(inside_clks_q) < 34'(period_q) + 34'(EdgeClks));
      step_turned: assert (!inside_begun_q || turned_q <= 34'(inside_turns_q));
      step_late: assert (!scanning || turned_q2 < ThreeHalves);
      step_search: assert (!startup_ok || (since_q <= 33'(inside_on_q) &&
                                           32'(inside_on_q) <= DarkClks - 2));
      step_on: assert (startup_ok || inside_on_q == '0 || 32'(inside_pause_q) == PauseClks);
      step_pause: assert (startup_ok || 34'(inside_pause_q) + 34'(dark_q) >= 34'(PauseClks - 1));

      step_capture: assert (!inside_index_capture__known_q || !inside_index_capture__open_q2 ||
                            !inside_index_capture__uniform_q ||
                            inside_index_capture__value_q == inside_index_capture__level_q ||
                            34'(quiet_q) + 34'(inside_index_capture__left_q) <= 34'd257);
      step_settled: assert (!inside_index_capture__uniform_q ||
                            inside_index_capture__left_q != '0 || inside_index_capture__settled_q);
      step_run_clks: assert (inside_index_capture__run_clks_q <= 8'd254);
      step_crossing: assert (!inside_index_capture__crossing_q || quiet_q <= 33'd258);
      step_started: assert (inside_index_capture__started_q ||
                            (!real_alive && !inside_index_capture__pending_q));
      step_first: assert (inside_index_capture__period_first_q >= -33'sd1);
      step_alive: assert ((!real_alive && !inside_index_capture__pending_q) ||
                          (inside_index_capture__period_left_q >= -33'sd1 &&
                           36'(inside_index_capture__period_left_q) + 36'(signed'({1'b0, quiet_q}))
                           <= signed'(36'(PeriodCeilingClks + CrossingClks - 1))));

      pulse_in_run: cover (pulse && power != '0);
      search: cover (index_light && state == Settle);
      search_again: cover (index_light && state == Settle && searched_q && dark_before_q);
    end
  end

endmodule

`default_nettype wire
