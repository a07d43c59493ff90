// mirror_drive: starts the mirror, drives it and stops it: VR-SCAN IV-G2.
//
// The phase is one turn a mirror period; the comb drive pulls twice a period, so the square wave
// comes from twice the phase.  A resonant mirror with a hardening comb starts only from above:
//
//   OFF     word is sweep_word, phase 0, both from its second clock on.  enable_i -> SWEEP
//   SWEEP   the word falls by sweep_rate / 2**16 a clock, rounded down, until it is work_word:
//           SETTLE; a sweep_word below work_word is there at once.  Time-out: FAULT
//   SETTLE  the word is work_word + trim, saturated.  index_alive_i and settled_i: RUN.
//           Time-out: FAULT
//   RUN     the same.  index_alive_i low for more than lost_timeout clocks on end: FAULT
//           settle_timeout and lost_timeout act as their ceilings where they are above them
//   FAULT   drive and level are 0, the word stands.  enable_i low -> OFF
//
// enable_i low stops from every state: a pulse that is high ends as it would have, with level and
// word as they are and the state's name kept, then comes OFF; where it is low OFF comes at once.  A
// new enable_i counts from OFF.  A pulse that does not end (a word of 0) is cut off 2**StopWidth +
// 2 clocks after the first one with enable_i low.
//
//   sweep_word, work_word, word_o      turns a clock, 48 fraction bits: 4.4e-7 Hz a step at 125 MHz
//   duty         the drive is high while frac(2 phase), its top 16 bits, is below duty, which acts as
//                DutyCeiling where it is above it.  It and sweep_level act a clock later
//   phase_o      turns; in clock n the phase at time n
//   drive_o      of the phase two clocks before
//   level_o      what is applied, full scale 2**20: 0 in OFF and FAULT, at most LevelCeiling
//   level_pin_o  sigma-delta of the first order: of 2**20 clocks level_o are high, exactly
//   fault_o      why FAULT came; kept until the next start
//   Latency  enable_i to state_o, and level_i to level_o in SETTLE and RUN: 1 clock; index_alive_i
//            and settled_i to RUN, and trim_i to word_o: 2 clocks; level_o to level_pin_o: 1 clock.  SWEEP and SETTLE last their
//            time-out and 2 clocks at most, RUN 2 clocks more than the index may be away.  The word
//            falls from the third clock of SWEEP.
//   Model    vrscan.clocked.mirror_drive, bit-exact

`default_nettype none

module mirror_drive #(
  parameter int unsigned StopWidth         = 24,  // 134 ms at 125 MHz: a stop cuts what is slower
  parameter int unsigned SettleCeilingClks = 1_250_000_000,  // 10 s
  parameter int unsigned LostCeilingClks   = 3_125_000,  // 25 ms
  parameter int unsigned LevelCeiling      = 1_047_527,  // 0.999 of full scale
  parameter int unsigned DutyCeiling       = 32_768  // half of the time
) (
  input  wire logic                                          clk_i,
  input  wire logic                                          rst_i,

  input  wire logic                                          enable_i,
  input  wire logic                                          index_alive_i,
  input  wire logic                                          settled_i,
  input  wire logic        [     vrscan_pkg::LevelWidth-1:0] level_i,
  input  wire logic signed [      vrscan_pkg::TrimWidth-1:0] trim_i,

  output      logic [vrscan_pkg::MirrorStateWidth-1:0]       state_o,
  output      logic [      vrscan_pkg::FaultWidth-1:0]       fault_o,
  output      logic                                          drive_o,
  output      logic [      vrscan_pkg::LevelWidth-1:0]       level_o,
  output      logic                                          level_pin_o,
  output      logic [       vrscan_pkg::TurnWidth-1:0]       phase_o,
  output      logic [       vrscan_pkg::WordWidth-1:0]       word_o,

  input  wire register_pkg::mirror_t                         mirror_i,
  input  wire register_pkg::mirror_limits_t                  mirror_limits_i
);

  if (StopWidth < 1 || StopWidth >= vrscan_pkg::TimeWidth) begin : gen_bad_stop_width
    $error("mirror_drive: StopWidth must be 1 to 31");
  end
  if (LevelCeiling >= 2 ** vrscan_pkg::LevelWidth || DutyCeiling >= 2 ** 16) begin : gen_bad_level
    $error("mirror_drive: LevelCeiling must fit in 20 bits, DutyCeiling in 16");
  end

  localparam int unsigned WordWidth = vrscan_pkg::WordWidth;
  localparam int unsigned TurnWidth = vrscan_pkg::TurnWidth;
  localparam int unsigned TimeWidth = vrscan_pkg::TimeWidth;
  localparam int unsigned LevelWidth = vrscan_pkg::LevelWidth;
  localparam int unsigned DutyWidth = 16;
  localparam int unsigned RateFraction = 16;
  localparam int unsigned FineWidth = WordWidth + RateFraction;
  localparam int unsigned SumWidth = WordWidth + 2;

  localparam int unsigned StateWidth = vrscan_pkg::MirrorStateWidth;
  localparam logic [StateWidth-1:0] Off = StateWidth'(vrscan_pkg::MirrorOff);
  localparam logic [StateWidth-1:0] Sweep = StateWidth'(vrscan_pkg::MirrorSweep);
  localparam logic [StateWidth-1:0] Settle = StateWidth'(vrscan_pkg::MirrorSettle);
  localparam logic [StateWidth-1:0] Run = StateWidth'(vrscan_pkg::MirrorRun);
  localparam logic [StateWidth-1:0] Fault = StateWidth'(vrscan_pkg::MirrorFault);
  localparam int unsigned FaultWidth = vrscan_pkg::FaultWidth;

  logic                        stop_q, stop, keep;  // a pulse is ended before OFF
  logic                        high_q;
  logic                        expired_q;
  logic                        ready_q;  // for RUN
  logic        [TimeWidth-1:0] timer_q, limit;
  logic        [FineWidth-1:0] fine_q;
  logic signed [  FineWidth:0] left_q;  // fine_q less the working word less a step: < 0 is there
  logic signed [ SumWidth-1:0] sum_q;

  logic                  active, active_d, off;
  logic [StateWidth-1:0] state_q, state_d;
  assign active   = state_q == Sweep || state_q == Settle || state_q == Run;
  assign active_d = state_d == Sweep || state_d == Settle || state_d == Run;
  assign off      = state_q == Off;
  assign stop     = stop_q || !enable_i;
  assign keep     = drive_o && high_q && !(stop_q && timer_q[StopWidth]);

  logic [ TimeWidth-1:0] sweep_timeout_q, settle_timeout_q, lost_timeout_q;
  logic [ DutyWidth-1:0] duty_q;
  logic [LevelWidth-1:0] level, sweep_level_q;
  assign limit = state_q == Sweep  ? sweep_timeout_q :
                 state_q == Settle ? settle_timeout_q : lost_timeout_q;

  assign level = 32'(level_i) > LevelCeiling ? LevelWidth'(LevelCeiling) : level_i;

  always_comb begin
    state_d = state_q;
    if (active && stop) begin
      if (!keep) state_d = Off;
    end else begin
      unique case (state_q)
        Off: if (enable_i) state_d = Sweep;
        Sweep: begin
          if (left_q[FineWidth]) state_d = Settle;
          else if (expired_q) state_d = Fault;
        end
        Settle: begin
          if (ready_q) state_d = Run;
          else if (expired_q) state_d = Fault;
        end
        Run: if (expired_q) state_d = Fault;
        default: if (!enable_i) state_d = Off;
      endcase
    end
  end

  always_ff @(posedge clk_i) begin
    ready_q <= index_alive_i && settled_i;
    state_q <= state_d;
    stop_q  <= active && stop && state_d != Off;
    if (state_q == Off && state_d == Sweep) begin
      fault_o <= FaultWidth'(vrscan_pkg::FaultNone);
    end else if (active && state_d == Fault) begin
      fault_o <= state_q == Sweep  ? FaultWidth'(vrscan_pkg::FaultSweep) :
                 state_q == Settle ? FaultWidth'(vrscan_pkg::FaultSettle) :
                                     FaultWidth'(vrscan_pkg::FaultIndex);
    end

    // It counts the clocks of a state, in RUN those without an index, and those of a stop.
    timer_q <= timer_q + TimeWidth'(1);
    if (state_d != state_q || stop != stop_q || (state_q == Run && !stop && index_alive_i)) begin
      timer_q <= '0;
    end
    expired_q <= active && state_d == state_q && !(state_q == Run && index_alive_i) &&
                 timer_q >= limit;

    fine_q <= fine_q - FineWidth'(mirror_i.sweep_rate);
    left_q <= left_q - (FineWidth + 1)'({1'b0, mirror_i.sweep_rate});
    if (state_q == Off) begin
      fine_q <= {mirror_i.sweep_word, {RateFraction{1'b0}}};
      left_q <= {{1'b0, mirror_i.sweep_word} + ~{1'b0, mirror_i.work_word}, {RateFraction{1'b1}}};
    end
    sum_q <= signed'({2'b00, mirror_i.work_word}) + SumWidth'(trim_i);

    if (off) begin
      word_o <= mirror_i.sweep_word;
    end else if (active && !stop) begin
      if (state_q == Sweep && left_q[FineWidth]) word_o <= mirror_i.work_word;
      else if (state_q == Sweep) word_o <= fine_q[RateFraction+:WordWidth];
      else if (sum_q[SumWidth-1]) word_o <= '0;
      else if (sum_q[SumWidth-2]) word_o <= '1;
      else word_o <= sum_q[WordWidth-1:0];
    end
    phase_o <= off ? '0 : phase_o + TurnWidth'(word_o);

    sweep_timeout_q  <= mirror_limits_i.sweep_timeout;
    settle_timeout_q <= mirror_limits_i.settle_timeout > SettleCeilingClks
                        ? SettleCeilingClks : mirror_limits_i.settle_timeout;
    lost_timeout_q   <= mirror_limits_i.lost_timeout > LostCeilingClks
                        ? LostCeilingClks : mirror_limits_i.lost_timeout;

    duty_q  <= 32'(mirror_limits_i.duty) > DutyCeiling ? DutyWidth'(DutyCeiling)
                                                       : mirror_limits_i.duty;
    high_q  <= active && phase_o[TurnWidth-2-:DutyWidth] < duty_q;
    drive_o <= active_d && high_q;

    if (!active_d) level_o <= '0;
    else if (state_d == Sweep) level_o <= sweep_level_q;
    else if (!stop) level_o <= level;
    sweep_level_q <= 32'(mirror_limits_i.sweep_level) > LevelCeiling ? LevelWidth'(LevelCeiling)
                     : mirror_limits_i.sweep_level;

    if (rst_i) begin
      state_q     <= Off;
      fault_o     <= FaultWidth'(vrscan_pkg::FaultNone);
      drive_o     <= 1'b0;
      level_o     <= '0;
      phase_o     <= '0;
      word_o      <= '0;
      high_q      <= 1'b0;
    end
  end

  // All the instrument reads state_o.  This copy is not merged with state_q, so that what decodes
  // the state elsewhere draws none of the logic above away from here.
  local_register #(.Width(StateWidth)) u_state (
    .clk_i, .d_i(rst_i ? Off : state_d), .q_o(state_o)
  );

  sigma_delta #(.Width(LevelWidth)) u_level_pin (
    .clk_i, .rst_i, .level_i(level_o), .pin_o(level_pin_o)
  );

endmodule

`default_nettype wire
