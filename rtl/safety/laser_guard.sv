// laser_guard: the second line of defence, in a clock of its own: no light without a heartbeat.
//
// Everything else that limits the light stands in the core's clock.  This module does not.  It
// watches what the core sends, and lets it pass only while that is well.  clk_i must not come from
// the core's clock, nor from its PLL or its oscillator.
//
//   heartbeat_i   any change is a beat; each level lasts 2 clocks at least
//   enable_i      laser_enable: 0 is dark
//   *_o           the same signal of the core and a registered permission: a gate's delay, no
//                 jitter.  Only where a permission ends or begins may a pulse be cut short
//   ok_o          the permission of the light.  It begins while both requests are low, with
//                 RestartBeats beats, enable_i, and no fault; after a reset and after a trip not
//                 before enable_i was low with these beats
//   fault_o       a trip: what ended the permission, or kept it from beginning while enable_i.
//                 Kept until the next permission, 0 after a reset.  From bit 0
//     silent      GuardClks clocks without a beat
//     long        pulse_i was high at PulseClks samples on end
//     spent       the budget of pulses: a lit sample adds 7, a dark one takes 1, 7 BurstClks are the
//                 end.  So of T clocks T/8 and 7/8 (BurstClks + 4) are lit at most
//     lit         the same for the start-up channel, which adds 1: T/2 and (IndexClks + 4) / 2
//     level       the same for its level, with 7 and StartupClks: a level that is stuck is none
//   drive_o, level_pin_o  0 without the heartbeat, and from DriveClks clocks of drive_i high to its
//                 end: no voltage rests on the comb.  They need no enable_i, and come back with
//                 RestartBeats beats
//   beat_o        changes every 4 clocks: the core withdraws its light when it stops
//   Latency  every input is synchronised, so from the clock that samples it: heartbeat_i's last
//            change to dark GuardClks + 4 clocks, a pulse's rise to dark PulseClks + 3, enable_i to
//            dark 3; one more from the change itself.  What is shorter than a clock counts by chance
//   Model    vrscan.clocked.laser_guard, bit-exact

`default_nettype none

module laser_guard #(
  // For a clock of 20.7 to 31 MHz and a core of 76.667 MHz, which beats every 0.42 us.
  parameter int unsigned GuardClks    = 16,  // 0.52 us at least: a beat and 24 %
  parameter int unsigned PulseClks    = 320,  // 10.3 us at least: beyond laser_control's own limit
  parameter int unsigned BurstClks    = 400,  // 12.9 us at least
  parameter int unsigned IndexClks    = 320_000_000,  // 10.3 s at least: beyond SETTLE
  parameter int unsigned StartupClks  = 64,  // 3.1 us at most
  parameter int unsigned DriveClks    = 100_000,  // 3.2 ms at least: half a period at 155 Hz
  parameter int unsigned RestartBeats = 16
) (
  input  wire logic       clk_i,
  input  wire logic       rst_i,

  // From the core.
  input  wire logic       heartbeat_i,
  input  wire logic       enable_i,
  input  wire logic       pulse_i,
  input  wire logic       index_light_i,
  input  wire logic       startup_pin_i,
  input  wire logic       drive_i,
  input  wire logic       level_pin_i,

  // To the pins.
  output      logic       pulse_o,
  output      logic       index_light_o,
  output      logic       startup_pin_o,
  output      logic       drive_o,
  output      logic       level_pin_o,

  // To the core.
  output      logic       beat_o,
  output      logic       ok_o,
  output      logic [4:0] fault_o
);

  if (GuardClks < 4 || PulseClks < 1 || RestartBeats < 1 || DriveClks < 1) begin : gen_bad_clks
    $error("laser_guard: GuardClks must be 4 at least, PulseClks, DriveClks, RestartBeats 1");
  end
  if (BurstClks < 1 || StartupClks < 1 || IndexClks < 1 || BurstClks >= 2 ** 24 ||
      StartupClks >= 2 ** 24 || IndexClks >= 2 ** 30) begin : gen_bad_budget
    $error("laser_guard: BurstClks and StartupClks must be 1 to 2**24 - 1, IndexClks to 2**30 - 1");
  end

  localparam int unsigned Signals = 6;
  localparam int unsigned SilentWidth = $clog2(GuardClks + 1);
  localparam int unsigned HighWidth = $clog2(PulseClks + 1);
  localparam int unsigned DriveWidth = $clog2(DriveClks + 1);
  localparam int unsigned BeatsWidth = $clog2(RestartBeats + 1);
  localparam int unsigned BudgetWidth = 31;
  typedef logic [BudgetWidth-1:0] budget_t;
  localparam int unsigned DutyCost = 7;  // of a lit sample: an eighth of the time may be lit

  logic heartbeat, enable, pulse, index_light, startup, drive;
  synchronizer #(.Width(Signals)) u_core (
    .clk_i, .rst_i,
    .d_i({heartbeat_i, enable_i, pulse_i, index_light_i, startup_pin_i, drive_i}),
    .q_o({heartbeat, enable, pulse, index_light, startup, drive})
  );

  // ---- the heartbeat ----
  logic                   heartbeat_q, beat, silent, ready;
  logic [SilentWidth-1:0] silent_q;
  logic [ BeatsWidth-1:0] beats_q;
  assign beat   = heartbeat != heartbeat_q;
  assign silent = silent_q == SilentWidth'(GuardClks);
  assign ready  = beats_q == BeatsWidth'(RestartBeats);

  always_ff @(posedge clk_i) begin
    heartbeat_q <= heartbeat;
    if (beat) silent_q <= '0;
    else if (!silent) silent_q <= silent_q + SilentWidth'(1);
    if (silent) beats_q <= '0;
    else if (beat && !ready) beats_q <= beats_q + BeatsWidth'(1);

    if (rst_i) begin
      heartbeat_q <= 1'b0;
      silent_q    <= SilentWidth'(GuardClks);
      beats_q     <= '0;
    end
  end

  // ---- a pulse, and the budgets: what is on its way when one is spent still counts ----
  function automatic budget_t spend(input budget_t level, input logic on, input budget_t cost,
                                    input budget_t clks);
    if (!on) spend = level == '0 ? '0 : level - budget_t'(1);
    else if (level + cost > cost * (clks + budget_t'(4))) spend = cost * (clks + budget_t'(4));
    else spend = level + cost;
  endfunction

  logic [ HighWidth-1:0] high_q;
  logic [DriveWidth-1:0] driven_q;
  budget_t               burst_q, index_q, startup_q;
  logic                  long, held;
  logic [           4:0] faults;
  assign long   = high_q == HighWidth'(PulseClks);
  assign held   = driven_q == DriveWidth'(DriveClks);
  assign faults = {startup_q >= budget_t'(DutyCost * StartupClks), index_q >= budget_t'(IndexClks),
                   burst_q >= budget_t'(DutyCost * BurstClks), long, silent};

  always_ff @(posedge clk_i) begin
    if (!pulse) high_q <= '0;
    else if (!long) high_q <= high_q + HighWidth'(1);
    if (!drive) driven_q <= '0;
    else if (!held) driven_q <= driven_q + DriveWidth'(1);
    burst_q   <= spend(burst_q, pulse, budget_t'(DutyCost), budget_t'(BurstClks));
    index_q   <= spend(index_q, index_light, budget_t'(1), budget_t'(IndexClks));
    startup_q <= spend(startup_q, startup, budget_t'(DutyCost), budget_t'(StartupClks));

    if (rst_i) begin
      high_q    <= '0;
      driven_q  <= '0;
      burst_q   <= '0;
      index_q   <= '0;
      startup_q <= '0;
    end
  end

  // ---- the permissions ----
  logic       fresh_q;  // enable was low with beats after the last trip
  logic       moves_q;
  logic [2:0] beat_q;
  assign pulse_o       = pulse_i && ok_o;
  assign index_light_o = index_light_i && ok_o;
  assign startup_pin_o = startup_pin_i && ok_o;
  assign drive_o       = drive_i && moves_q;
  assign level_pin_o   = level_pin_i && moves_q;
  assign beat_o        = beat_q[2];

  always_ff @(posedge clk_i) begin
    fresh_q <= (!enable && ready) || (fresh_q && faults == '0);
    ok_o    <= enable && fresh_q && faults == '0 && ready && (ok_o || !(pulse || index_light));
    if (enable && faults != '0 && (fresh_q || fault_o == '0)) fault_o <= faults;
    else if (ok_o) fault_o <= '0;
    moves_q <= ready && !silent && !held;
    beat_q  <= beat_q + 3'd1;

    if (rst_i) begin
      fresh_q <= 1'b0;
      ok_o    <= 1'b0;
      fault_o <= '0;
      moves_q <= 1'b0;
      beat_q  <= '0;
    end
  end

endmodule

`default_nettype wire
