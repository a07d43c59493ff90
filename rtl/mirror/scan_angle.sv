// scan_angle: the mirror's scan angle from the phase of its oscillation, VR-SCAN (12).
//
//   angle = A sum over k = 1, 3 .. 2 HarmonicCount - 1 of a_k cos(k p - phi_k)
//
// with p = 2 pi f0 t - phi_0.  k p grows by 2 p from one harmonic to the next, and phases in turns
// wrap by themselves.  One table and one multiplier: a product a harmonic, then the sum times the
// inverse of quarter_wave's 1.0, which is the only place that knows of it, then times A.  Every
// product is brought down by Fraction bits, towards minus infinity; only the angle is rounded, to
// nearest, half up.
//
//   phase_i      p, turns
//   amplitude_i  A, turns, AmplitudeFraction bits: up to 0.25
//   a_i, phi_i   a_k, MotionFraction bits, and phi_k, turns; k = 1 in the lowest bits.  They must
//                hold from valid_i to valid_o.
//   angle_o      turns, AngleWidth bits of fraction; below 0.3 urad from (12) for |angle| <= 25
//                degrees
//   overflow_o   the angle is beyond half a turn, and saturates
//   Latency      19 clocks a harmonic, two products of 10, and 2: 193 clocks; a valid_i meanwhile
//                starts anew
//   Model        vrscan.fixed.scan_angle, bit-exact

`default_nettype none

module scan_angle #(
  localparam int unsigned Harmonics  = vrscan_pkg::HarmonicCount,
  localparam int unsigned MotionBits = Harmonics * vrscan_pkg::MotionWidth,
  localparam int unsigned PhasesBits = Harmonics * vrscan_pkg::PhaseWidth
) (
  input  wire logic                                         clk_i,
  input  wire logic                                         rst_i,  // clears control only

  input  wire logic                                         valid_i,
  input  wire logic        [    vrscan_pkg::PhaseWidth-1:0] phase_i,
  input  wire logic        [vrscan_pkg::AmplitudeWidth-1:0] amplitude_i,

  output      logic                                         valid_o,
  output      logic signed [    vrscan_pkg::AngleWidth-1:0] angle_o,
  output      logic                                         overflow_o,

  input  wire logic        [                MotionBits-1:0] a_i,
  input  wire logic        [                PhasesBits-1:0] phi_i
);

  localparam int unsigned AmplWidth = 30;
  localparam int unsigned Fraction = AmplWidth - 1;  // of cosines, and what a product moves down
  localparam int unsigned SumFraction = 29;
  localparam int unsigned SumWidth = SumFraction + 6;  // |sum| <= 2 Harmonics = 18
  localparam int unsigned FactorWidth = AmplWidth + 1;
  localparam int unsigned ProductWidth = SumWidth + FactorWidth;
  localparam int unsigned MotionAlign = SumFraction - vrscan_pkg::MotionFraction;
  localparam int unsigned AmplitudeAlign = Fraction - vrscan_pkg::AmplitudeFraction;
  localparam int unsigned AngleDrop = SumFraction - vrscan_pkg::AngleWidth;
  localparam int unsigned AngleSumWidth = SumWidth + 1 - AngleDrop;
  // 2**(2 Fraction) / quarter_wave.amplitude(AmplWidth), Fraction bits.
  localparam logic signed [FactorWidth-1:0] InverseLength = 31'sd536887218;

  // The harmonics, then Lengthen and Scale.
  localparam int unsigned StepWidth = $clog2(Harmonics + 2);
  localparam logic [StepWidth-1:0] LastHarmonic = StepWidth'(Harmonics - 1);
  localparam logic [StepWidth-1:0] Lengthen = StepWidth'(Harmonics);
  localparam logic [StepWidth-1:0] Scale = StepWidth'(Harmonics + 1);

  logic        [                 StepWidth-1:0] step_q;
  logic                                         harmonic;
  logic                                         prepare_q, wave_start_q, start_q, done_q;
  logic        [vrscan_pkg::AmplitudeWidth-1:0] amplitude_q;
  logic        [    vrscan_pkg::PhaseWidth-1:0] turn_q, twice_q;  // k p, and 2 p
  logic        [    vrscan_pkg::PhaseWidth-1:0] wave_phase_q;
  logic signed [   vrscan_pkg::MotionWidth-1:0] motion_q;
  logic signed [                  SumWidth-1:0] sum_q;
  assign harmonic = step_q < Lengthen;

  // The next harmonic's constants are chosen while this one is at work, in two steps, since they come
  // from far apart: within the fours, then among them.  Behind the last harmonic they are not used.
  localparam int unsigned Fours     = (Harmonics + 3) / 4;
  localparam int unsigned WordWidth = vrscan_pkg::MotionWidth + vrscan_pkg::PhaseWidth;
  logic [                StepWidth-1:0] next_q;
  logic [4*Fours-1:0][WordWidth-1:0] words;  // amplitude and phase
  logic [  Fours-1:0][WordWidth-1:0] chosen, chosen_q;
  logic [              WordWidth-1:0] word, word_q;
  logic [ vrscan_pkg::PhaseWidth-1:0] shift_q;
  always_comb begin
    words = '0;
    for (int unsigned n = 0; n < Harmonics; n++) begin
      words[n] = {a_i[vrscan_pkg::MotionWidth*n+:vrscan_pkg::MotionWidth],
                  phi_i[vrscan_pkg::PhaseWidth*n+:vrscan_pkg::PhaseWidth]};
    end
    word = chosen_q[0];
    for (int unsigned n = 0; n < Fours; n++) begin
      chosen[n] = words[{n[StepWidth-3:0], next_q[1:0]}];
      if (next_q[StepWidth-1:2] == n[StepWidth-3:0]) word = chosen_q[n];
    end
  end

  // What the work before has left in the pipelines must not count for the new one.
  logic clear;
  assign clear = rst_i || valid_i;

  logic                        wave_valid;
  logic signed [AmplWidth-1:0] sine, cosine;
  quarter_wave #(
    .PhaseWidth(vrscan_pkg::PhaseWidth),
    .AmplWidth (AmplWidth)
  ) u_quarter_wave (
    .clk_i,
    .rst_i   (clear),
    .valid_i (wave_start_q),
    .phase_i (wave_phase_q),
    .valid_o (wave_valid),
    .sine_o  (sine),
    .cosine_o(cosine)
  );
  logic unused_sine;
  assign unused_sine = ^sine;

  logic signed [   SumWidth-1:0] a;
  logic signed [FactorWidth-1:0] b;
  always_comb begin
    a = harmonic ? SumWidth'(motion_q) <<< MotionAlign : sum_q;
    unique case (step_q)
      Lengthen: b = InverseLength;
      Scale:    b = signed'(FactorWidth'(amplitude_q)) <<< AmplitudeAlign;
      default:  b = FactorWidth'(cosine);
    endcase
  end

  logic                           product_valid;
  logic signed [ProductWidth-1:0] product;
  logic signed [    SumWidth-1:0] lowered;
  multiply #(
    .AWidth(SumWidth),
    .BWidth(FactorWidth)
  ) u_multiply (
    .clk_i,
    .rst_i    (clear),
    .valid_i  (wave_valid || start_q),
    .a_i      (a),
    .b_i      (b),
    .valid_o  (product_valid),
    .product_o(product)
  );
  assign lowered = SumWidth'(product >>> Fraction);

  // To nearest, half up.
  localparam logic signed [vrscan_pkg::AngleWidth-1:0] AngleMax =
      {1'b0, {(vrscan_pkg::AngleWidth - 1) {1'b1}}};
  logic signed [       SumWidth:0] rounded;
  logic signed [AngleSumWidth-1:0] angle_q;
  logic                            fits;
  assign rounded = (SumWidth + 1)'(lowered) + (SumWidth + 1)'(1 << (AngleDrop - 1));
  assign fits    = angle_q <= AngleSumWidth'(AngleMax) && angle_q >= ~(AngleSumWidth'(AngleMax));

  always_ff @(posedge clk_i) begin
    prepare_q    <= 1'b0;
    wave_start_q <= prepare_q;
    start_q      <= 1'b0;
    if (prepare_q) begin
      wave_phase_q <= turn_q - shift_q;
      turn_q       <= turn_q + twice_q;
    end
    next_q   <= step_q + StepWidth'(1);
    chosen_q <= chosen;
    word_q   <= word;
    if (product_valid) begin
      {motion_q, shift_q} <= word_q;
      sum_q     <= harmonic ? sum_q + lowered : lowered;
      angle_q   <= AngleSumWidth'(rounded >>> AngleDrop);
      step_q    <= step_q + StepWidth'(1);
      prepare_q <= step_q < LastHarmonic;
      start_q   <= step_q == LastHarmonic || step_q == Lengthen;
    end
    done_q  <= product_valid && step_q == Scale;
    valid_o <= done_q;
    if (done_q) begin
      angle_o    <= fits                     ? vrscan_pkg::AngleWidth'(angle_q) :
                    angle_q[AngleSumWidth-1] ? ~AngleMax : AngleMax;
      overflow_o <= !fits;
    end
    if (valid_i) begin
      step_q       <= '0;
      {motion_q, shift_q} <= words[0];
      amplitude_q  <= amplitude_i;
      turn_q       <= phase_i;
      twice_q      <= {phase_i[vrscan_pkg::PhaseWidth-2:0], 1'b0};
      sum_q        <= '0;
      prepare_q    <= 1'b1;
      wave_start_q <= 1'b0;
      start_q      <= 1'b0;
      done_q       <= 1'b0;
      valid_o      <= 1'b0;
    end
    if (rst_i) begin
      prepare_q    <= 1'b0;
      wave_start_q <= 1'b0;
      start_q      <= 1'b0;
      done_q       <= 1'b0;
      valid_o      <= 1'b0;
    end
  end

endmodule

`default_nettype wire
