// scan_safeguard: says from the pins of the index whether the mirror moves; no register has a say.
//
// laser_interlock lets no pulse through without scanning_o, and no light of the start-up channel
// without startup_ok_o.  Both rest on the samples of the index, on the drive's frequency and on
// parameters, so whatever registers hold, a mirror that stops is dark in a time that is fixed.
//
// A level of the comparator is settled after SettleClks clocks in which it and an open gate agree in
// every sample.  Within a gate pulse another settled level is an edge: outward 0 to 1, inward 1 to 0.
// A period goes from outward to outward.  It is good when
//   it has 3/4 to 3/2 turns of the drive, and PeriodFloorClks to LightClks clocks
//   one inward edge is in it, OuterFloor / 2**16 to 1/2 of a turn behind the outward edge.  So long is
//   the beam beyond the mark: OuterFloor is the floor of the amplitude, mark / cos(pi OuterFloor / 2**16)
//
//   scanning_o    begins with the end of a good period.  It ends with an edge that makes a period
//                 no good, 3/2 turns of the drive after the last outward edge, and LightClks after it
//   startup_ok_o  begins in SETTLE, where the index is searched for, while enable_i.  It ends with
//                 SETTLE and RUN, and when DarkClks passed since it began and since the outward edge
//                 of the last good period.  Then it is 0 for PauseClks at least
//   state_i       mirror_drive's; word_i the frequency of the drive
//   Latency  LightClks and DarkClks count from the edge at the pins to laser_interlock's dark outputs.
//            3/2 turns come SettleClks + 6 clocks later there, and other edges end the light
//            SettleClks + 4 clocks after they came
//   Model    vrscan.clocked.scan_safeguard, bit-exact

`default_nettype none

module scan_safeguard #(
  parameter int unsigned IndexOversample = 4,
  parameter int unsigned SettleClks      = 13,  // 0.1 us at 125 MHz
  parameter int unsigned LightClks       = 1_250_000,  // 10 ms
  parameter int unsigned PeriodFloorClks = 250_000,  // 2 ms
  parameter int unsigned OuterFloor      = 6_144,  // 3/32 turn: 17.8 degrees with a mark at 17
  parameter int unsigned DarkClks        = 3_125_000,  // 25 ms
  parameter int unsigned PauseClks       = 31_250_000,  // 250 ms
  parameter int unsigned TurnsFraction   = 32  // less: more turns a clock, for proofs
) (
  input  wire logic                                    clk_i,
  input  wire logic                                    rst_i,

  input  wire logic [             IndexOversample-1:0] comparator_i,
  input  wire logic [             IndexOversample-1:0] gate_i,
  input  wire logic [       vrscan_pkg::WordWidth-1:0] word_i,
  input  wire logic [vrscan_pkg::MirrorStateWidth-1:0] state_i,
  input  wire logic                                    enable_i,

  output      logic                                    scanning_o,
  output      logic                                    startup_ok_o
);

  // From the clock of an edge at the pins to that in which clks_q counts from it.
  localparam int unsigned EdgeClks = SettleClks + 3;
  if (SettleClks < 1 || LightClks < EdgeClks + 2 || LightClks >= 2 ** 30
      || PeriodFloorClks + EdgeClks > LightClks) begin : gen_bad_light
    $error("scan_safeguard: SettleClks, PeriodFloorClks below LightClks, which is below 2**30");
  end
  if (DarkClks < EdgeClks + 2 || DarkClks >= 2 ** 30 || PauseClks < 1
      || PauseClks >= 2 ** 30) begin : gen_bad_dark
    $error("scan_safeguard: DarkClks must be above SettleClks + 4, PauseClks not 0");
  end
  if (OuterFloor > 32_768 || TurnsFraction < 25 || TurnsFraction > 32) begin : gen_bad_outer
    $error("scan_safeguard: OuterFloor must be at most half a turn, TurnsFraction 25 to 32");
  end

  localparam int unsigned RunWidth = $clog2(SettleClks + 1);
  localparam int unsigned ClksWidth = $clog2(LightClks + 1);
  localparam int unsigned OnWidth = $clog2(DarkClks + 1);
  localparam int unsigned PauseWidth = $clog2(PauseClks + 1);
  localparam int unsigned StateWidth = vrscan_pkg::MirrorStateWidth;
  // Turns of the drive, below 2; what is dropped of its word is 4e-5 of the shipped frequency.
  localparam int unsigned WordDrop = vrscan_pkg::TurnWidth - 32;
  localparam logic [TurnsFraction:0] OuterTurns =
      (TurnsFraction + 1)'(OuterFloor) << (TurnsFraction - 16);

  logic unused;
  assign unused = ^word_i[WordDrop-1:0];

  // ---- edges ----
  logic                open_q, full_q, empty_q, value_q, known_q, level_q, edge_q;
  logic [RunWidth-1:0] run_q;  // clocks in which the samples have agreed on value_q
  logic                settled, outward, inward;
  assign settled = open_q && run_q == RunWidth'(SettleClks);
  assign outward = edge_q && level_q;
  assign inward  = edge_q && !level_q;

  always_ff @(posedge clk_i) begin
    open_q  <= &gate_i;
    full_q  <= &comparator_i;
    empty_q <= !(|comparator_i);

    value_q <= full_q;
    if (!open_q || !(full_q || empty_q)) run_q <= '0;
    else if (run_q == '0 || value_q != full_q) run_q <= RunWidth'(1);
    else if (run_q != RunWidth'(SettleClks)) run_q <= run_q + RunWidth'(1);

    known_q <= open_q && (known_q || settled);
    if (settled) level_q <= value_q;
    edge_q <= settled && known_q && level_q != value_q;

    if (rst_i) begin
      open_q  <= 1'b0;
      run_q   <= '0;
      known_q <= 1'b0;
      edge_q  <= 1'b0;
    end
  end

  // ---- periods ----
  logic [      ClksWidth-1:0] clks_q;  // since the outward edge came to the pins
  logic [  TurnsFraction:0] turns_q;  // of the drive, since it came here
  logic begun_q, outer_q, whole_q;  // outward came, beyond the mark, came back in time
  logic late, early, narrow, wide, good, back;
  assign late   = (&turns_q[TurnsFraction-:2]) || clks_q >= ClksWidth'(LightClks - 2);
  assign early  = turns_q < {3'b011, (TurnsFraction - 2)'(0)} ||
                  clks_q < ClksWidth'(PeriodFloorClks + EdgeClks - 1);
  // Without a floor there is nothing to compare.
  if (OuterFloor == 0) begin : gen_any
    assign narrow = 1'b0;
  end else begin : gen_floor
    assign narrow = turns_q < OuterTurns;
  end
  assign wide   = turns_q[TurnsFraction] || turns_q[TurnsFraction-1];
  assign good   = outward && begun_q && whole_q && !late && !early;
  assign back   = inward && begun_q && outer_q && !late && !narrow && !wide;

  always_ff @(posedge clk_i) begin
    if (outward) clks_q <= ClksWidth'(EdgeClks);
    else if (!late) clks_q <= clks_q + ClksWidth'(1);
    if (outward) turns_q <= '0;
    else if (!late) begin
      turns_q <= turns_q + (TurnsFraction + 1)'(word_i[vrscan_pkg::WordWidth-1:WordDrop]);
    end

    begun_q    <= outward || (begun_q && !late && (!inward || back));
    outer_q    <= outward || (outer_q && !inward);
    whole_q    <= !outward && (whole_q || back);
    scanning_o <= good || (scanning_o && !late && !outward && (!inward || back));

    if (rst_i) begin
      clks_q     <= ClksWidth'(LightClks);
      turns_q    <= '0;
      begun_q    <= 1'b0;
      outer_q    <= 1'b0;
      whole_q    <= 1'b0;
      scanning_o <= 1'b0;
    end
  end

  // ---- the start-up channel ----
  logic [   OnWidth-1:0] on_q;  // since the search began, or the last good period ended at the pins
  logic [PauseWidth-1:0] pause_q;
  logic                  settling, running;
  assign settling = state_i == StateWidth'(vrscan_pkg::MirrorSettle);
  assign running  = state_i == StateWidth'(vrscan_pkg::MirrorRun);

  always_ff @(posedge clk_i) begin
    if (startup_ok_o) begin
      on_q    <= good ? OnWidth'(EdgeClks) : on_q + OnWidth'(1);
      pause_q <= PauseWidth'(PauseClks);
      startup_ok_o <= (settling || running) && on_q < OnWidth'(DarkClks - 2);
    end else begin
      on_q <= '0;
      if (pause_q != '0) pause_q <= pause_q - PauseWidth'(1);
      startup_ok_o <= settling && enable_i && pause_q == '0;
    end

    if (rst_i) begin
      on_q         <= '0;
      pause_q      <= '0;
      startup_ok_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
