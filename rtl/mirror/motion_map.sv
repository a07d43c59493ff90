// motion_map: the harmonics of the mirror's motion at the phase at which it is driven.
//
// VR-SCAN V-B: the harmonics depend slightly on the phase of the drive against the mirror, which is
// wherever the loop has come to rest.  So a_k and phi_k of (12) are linear in that phase:
//
//   d      offset_i - drive_phase.  The drive has twice the mirror's frequency, so half a turn
//          more is the same drive: d is within -1/4 .. 1/4 turn, the upper end excluded
//   a_k    motion_a + motion_da d, to nearest, half up; saturates
//   phi_k  motion_phi + motion_dphi d, to nearest, half up; wraps
//
// One multiplier, a product at a time.  All results change in one clock, in which busy_i is low.
//
//   offset_i       drive's phase less the mirror's, turns; rounded to PhaseWidth bits, half up
//   busy_i         somebody works with a_o and phi_o: they stay
//   renew_i        motion_i is another one: all is worked out anew for the last offset_i
//   renewing_o     until that is done, in spite of busy_i; at once where none has come
//   a_o, phi_o     as scan_angle takes them.  From the second clock of a reset to the first results
//                  they are motion_a and motion_phi, a clock later, whatever busy_i is
//   drive_phase    offset_i at which motion_a and motion_phi hold, turns
//   motion_da      change of a_k a turn, MotionSlopeFraction bits
//   motion_dphi    of phi_k, turns a turn, PhiSlopeFraction bits; all k = 1 in the lowest bits
//   Latency        12 clocks a product and 4: 220 clocks from valid_i to the outputs, or 1 from the
//                  first later clock in which busy_i is low; a valid_i before that clock starts
//                  anew.  The configuration must hold meanwhile; a new one counts from the next
//                  valid_i.
//   Model          vrscan.fixed.motion_map, bit-exact

`default_nettype none

module motion_map #(
  localparam int unsigned Harmonics  = vrscan_pkg::HarmonicCount,
  localparam int unsigned MotionBits = Harmonics * vrscan_pkg::MotionWidth,
  localparam int unsigned PhasesBits = Harmonics * vrscan_pkg::PhaseWidth
) (
  input  wire logic                                     clk_i,
  input  wire logic                                     rst_i,

  input  wire logic                                     valid_i,
  input  wire logic        [ vrscan_pkg::TurnWidth-1:0] offset_i,
  input  wire logic                                     busy_i,
  input  wire logic                                     renew_i,
  output      logic                                     renewing_o,

  output      logic        [            MotionBits-1:0] a_o,
  output      logic        [            PhasesBits-1:0] phi_o,

  input  wire register_pkg::motion_t                    motion_i
);

  localparam int unsigned MotionWidth = vrscan_pkg::MotionWidth;
  localparam int unsigned PhaseWidth = vrscan_pkg::PhaseWidth;
  localparam int unsigned SlopeWidth = vrscan_pkg::SlopeMotionWidth;
  localparam int unsigned OffsetDrop = vrscan_pkg::TurnWidth - PhaseWidth;
  localparam int unsigned DWidth = PhaseWidth - 1;
  localparam int unsigned ProductWidth = DWidth + SlopeWidth;
  localparam int unsigned MotionDrop =
      vrscan_pkg::MotionSlopeFraction + PhaseWidth - vrscan_pkg::MotionFraction;
  localparam int unsigned PhiDrop = vrscan_pkg::PhiSlopeFraction;

  // One bit a step, which selects its constants at once: the a_k, then the phi_k, and all done.
  localparam int unsigned Done = 2 * Harmonics;
  logic [Done:0] step_q;
  logic          of_phi_q, of_phi_q2;
  logic          prepare_q, select_q, start_q, add_q, store_q, waiting_q;
  logic          mapped_q;  // there were results
  logic          commit;
  logic                                     known_q, start;  // an offset has come; work begins
  assign commit = waiting_q && (!busy_i || renewing_o);
  assign start  = valid_i || (renew_i && known_q);

  // The step's constants; a_k is as wide as phi_k, so that one adder does for both.
  logic        [SlopeWidth-1:0] slope;
  logic        [PhaseWidth-1:0] base;
  logic        [SlopeWidth-1:0] slope_q;
  logic signed [SlopeWidth-1:0] operand_q;  // beside the multiplier
  logic        [PhaseWidth-1:0] base_q;
  always_comb begin
    slope = '0;
    base  = '0;
    for (int unsigned n = 0; n < Harmonics; n++) begin
      if (step_q[n]) begin
        slope |= motion_i.motion_da[SlopeWidth*n+:SlopeWidth];
        base  |= PhaseWidth'(signed'(motion_i.motion_a[MotionWidth*n+:MotionWidth]));
      end
      if (step_q[Harmonics+n]) begin
        slope |= motion_i.motion_dphi[SlopeWidth*n+:SlopeWidth];
        base  |= motion_i.motion_phi[PhaseWidth*n+:PhaseWidth];
      end
    end
  end

  logic        [PhaseWidth-1:0] offset_q;
  logic signed [    DWidth-1:0] d_q;

  logic                           product_valid;
  logic signed [ProductWidth-1:0] product;
  multiply #(
    .AWidth(DWidth),
    .BWidth(SlopeWidth)
  ) u_multiply (
    .clk_i,
    .rst_i    (rst_i || start),  // the product of the work before must not count for the new one
    .valid_i  (start_q),
    .a_i      (d_q),
    .b_i      (operand_q),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // To nearest, half up.
  logic [PhaseWidth-1:0] dropped, moved_q, sum_q;
  logic                  half;
  assign dropped = PhaseWidth'(of_phi_q ? product >>> PhiDrop : product >>> MotionDrop);
  assign half    = of_phi_q ? product[PhiDrop-1] : product[MotionDrop-1];

  localparam logic [MotionWidth-1:0] MotionMax = {1'b0, {(MotionWidth - 1) {1'b1}}};
  logic [PhaseWidth-MotionWidth:0] signs;
  logic                            fits;
  logic [         MotionWidth-1:0] motion;
  assign signs  = sum_q[PhaseWidth-1:MotionWidth-1];
  assign fits   = signs == '0 || signs == '1;
  assign motion = fits                ? sum_q[MotionWidth-1:0] :
                  sum_q[PhaseWidth-1] ? ~MotionMax : MotionMax;

  // Results move in from the top.  What earlier work has left has moved out when they are all there.
  logic [MotionBits-1:0] a_q;
  logic [PhasesBits-1:0] phi_q;

  always_ff @(posedge clk_i) begin
    d_q       <= signed'(DWidth'(offset_q - motion_i.drive_phase));
    slope_q   <= slope;
    operand_q <= signed'(slope_q);
    base_q    <= base;
    moved_q   <= dropped + PhaseWidth'(half);
    sum_q     <= base_q + moved_q;
    prepare_q <= product_valid && !step_q[Done-1];
    select_q  <= prepare_q;
    start_q   <= select_q;
    add_q     <= product_valid;
    store_q   <= add_q;
    of_phi_q  <= step_q[Done-1:Harmonics] != '0;
    of_phi_q2 <= of_phi_q;
    if (product_valid) step_q <= step_q << 1;
    if (store_q && of_phi_q2) phi_q <= {sum_q, phi_q[PhasesBits-1:PhaseWidth]};
    if (store_q && !of_phi_q2) a_q <= {motion, a_q[MotionBits-1:MotionWidth]};
    if (store_q && step_q[Done]) waiting_q <= 1'b1;

    if (commit) begin
      waiting_q <= 1'b0;
      mapped_q  <= 1'b1;
      a_o       <= a_q;
      phi_o     <= phi_q;
    end else if (!mapped_q) begin
      a_o   <= motion_i.motion_a;
      phi_o <= motion_i.motion_phi;
    end
    if (valid_i) begin
      offset_q <= offset_i[OffsetDrop+:PhaseWidth] + PhaseWidth'(offset_i[OffsetDrop-1]);
      known_q  <= 1'b1;
    end
    renewing_o <= (renewing_o && !commit) || (renew_i && known_q);
    if (start) begin
      step_q    <= (Done + 1)'(1);
      prepare_q <= 1'b1;
      waiting_q <= 1'b0;
    end
    if (rst_i) begin
      prepare_q <= 1'b0;
      select_q  <= 1'b0;
      start_q   <= 1'b0;
      add_q     <= 1'b0;
      store_q   <= 1'b0;
      waiting_q <= 1'b0;
      mapped_q  <= 1'b0;
      known_q   <= 1'b0;
      renewing_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
