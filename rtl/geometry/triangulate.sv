// triangulate: corrected position and scan angle to (x, z), VR-SCAN (3) and (4).
//
// Without their tangents, which are infinite inside the field of view: x = q sin a and
// z = q cos a, q = n / d, n = n0 + n1 s, d = (d0 + d1 s) cos a + (e0 + e1 s) sin a, s = offset / R,
// R = 2**$clog2(LineLength) px.  n and d are positive where the point lies before mirror and camera;
// the amplitude of sine and cosine cancels.  From the derivative of (3),
//
//   sigma_z = |n1 cos a - z (d1 cos a + e1 sin a)| / (d R) * slope * sigma,
//   c_obj   = erf(tolerance z / (sqrt 2 sigma_z)),
//
// the probability that z errs by less than the share tolerance of itself.  Where a few positions of
// a kind are far off, sigma is that of all and typical that of the others: c_obj is of the latter.
// With c_obj_gain it is (9) instead, snr c_obj_gain / 2**ObjectGainFraction.
//
// One multiplier and one divider, one operation at a time; every product is brought down by
// Fraction bits, to nearest, half up.
//
//   offset_i .. sigma_i  as distortion and peak_position deliver them, px
//   angle_i              scan angle, fraction of a turn
//   measured_i           there is a position; where not, all is 0 but user_o
//   x_o, z_o             mm, LengthFraction bits; error below 2 um from 250 to 1000 mm.  Here and
//                        below a mm stands for the unit of length, which n0 and n1 are in
//   sigma_z_o            mm, SigmaFraction bits, saturating
//   c_obj_o              255 is 1
//   no_range_o           n <= 0, d <= 0 or q >= 4096 mm
//   out_of_range_o       x or z does not fit in its format, or the offset had not; with either of
//                        the two there is no point: x = z = c_obj = 0, sigma_z is all ones
//   lost_o               a point between the one before and this one was dropped
//   dropped_o            a pulse a dropped point: one that came while another was in work, or whose
//                        place in the output register was still taken
//   Latency              vrscan_pkg::PointPeriod + 1 clocks: quarter_wave's, 16 products of
//                        multiply's and 2, 4 quotients of divide's and 2, and 3.  A point may follow
//                        every PointPeriod.  The configuration must hold meanwhile.
//   Model                vrscan.fixed.triangulate, bit-exact

`default_nettype none

module triangulate #(
  parameter  int unsigned LineLength  = 2048,
  parameter  int unsigned UserWidth   = 8,  // what travels with a point, untouched
  localparam int unsigned PixelBits   = $clog2(LineLength),
  localparam int unsigned OffsetWidth = PixelBits + 2 + vrscan_pkg::OffsetFraction
) (
  input  wire logic                                        clk_i,
  input  wire logic                                        rst_i,  // clears control only

  input  wire logic                                        valid_i,
  input  wire logic                                        measured_i,
  input  wire logic signed [              OffsetWidth-1:0] offset_i,
  input  wire logic signed [   vrscan_pkg::SlopeWidth-1:0] slope_i,
  input  wire logic                                        saturated_i,
  input  wire logic        [   vrscan_pkg::SigmaWidth-1:0] sigma_i,
  input  wire logic        [   vrscan_pkg::SigmaWidth-1:0] typical_i,
  input  wire logic        [     vrscan_pkg::SnrWidth-1:0] snr_i,
  input  wire logic signed [   vrscan_pkg::AngleWidth-1:0] angle_i,
  input  wire logic        [                UserWidth-1:0] user_i,

  output      logic                                        valid_o,
  input  wire logic                                        ready_i,
  output      logic                                        measured_o,
  output      logic signed [  vrscan_pkg::LengthWidth-1:0] x_o,
  output      logic signed [  vrscan_pkg::LengthWidth-1:0] z_o,
  output      logic        [   vrscan_pkg::SigmaWidth-1:0] sigma_z_o,
  output      logic        [vrscan_pkg::ConfidenceWidth-1:0] c_obj_o,
  output      logic                                        no_range_o,
  output      logic                                        out_of_range_o,
  output      logic                                        lost_o,
  output      logic        [                UserWidth-1:0] user_o,

  input  wire register_pkg::geometry_t                     geometry_i,

  output      logic                                        dropped_o
);

  if (LineLength < 2 || LineLength > 8192) begin : gen_bad_line_length
    $error("triangulate: LineLength must be 2 to 8192");
  end
  if (UserWidth < 1) begin : gen_bad_user_width
    $error("triangulate: UserWidth must be at least 1");
  end

  localparam int unsigned AmplWidth = 30;
  localparam int unsigned Fraction = AmplWidth - 1;
  localparam int unsigned FactorWidth = 32;
  localparam int unsigned RoundedWidth = 34;
  localparam int unsigned ProductWidth = FactorWidth + RoundedWidth;
  localparam int unsigned RangeWidth = 32;
  localparam int unsigned DivisorWidth = RoundedWidth;
  localparam int unsigned DividendWidth = RoundedWidth - 1 + vrscan_pkg::RayFraction;
  localparam int unsigned LengthDrop = vrscan_pkg::BaseFraction - vrscan_pkg::LengthFraction;
  localparam int unsigned FullWidth = RoundedWidth - LengthDrop;  // of x and z, unsaturated
  localparam int unsigned SpreadFraction = 24;
  localparam int unsigned GradientFraction = 13;
  localparam int unsigned GradientSpare = 4;
  localparam int unsigned GradientDrop = vrscan_pkg::BaseFraction - GradientFraction;
  localparam int unsigned GradientWidth = FactorWidth - GradientSpare;
  // sigma fills the factor but for its sign; the slope makes up for the rest.
  localparam int unsigned SigmaAlign = FactorWidth - 1 - vrscan_pkg::SigmaWidth;
  localparam int unsigned SlopeAlign = SpreadFraction + Fraction - SigmaAlign
                                       - vrscan_pkg::SlopeFraction - vrscan_pkg::SigmaFraction;
  // A share of z comes in steps of 2**-ShareFraction sigma_z.
  localparam int unsigned ShareFraction  = 6;
  localparam int unsigned ToleranceAlign = Fraction + ShareFraction - vrscan_pkg::ToleranceFraction;
  localparam int unsigned GainAlign = Fraction - vrscan_pkg::ObjectGainFraction;

  typedef enum logic [4:0] {
    NUMERATOR, RAY_COSINE, RAY_SINE, DIVISOR_COSINE, DIVISOR_SINE, RANGE,
    RATE_COSINE, RATE_SINE, MOVE, SPREAD, CROSS_X, CROSS_Z, GRADIENT, SCALE, SIGMA_Z,
    TOLERANCE, SHARE, WHOLE_SPREAD, WHOLE_SCALE, WHOLE_SIGMA_Z
  } step_e;

  step_e                          step_q;
  logic                           busy_q, wave_start_q, start_q, store_q, done_q;
  logic                           accept, done;
  logic                           wave_valid, product_valid, quotient_valid;
  logic signed [   AmplWidth-1:0] sine, cosine;
  logic signed [ProductWidth-1:0] product;
  logic signed [RoundedWidth-1:0] rounded_q;
  logic        [  RangeWidth-1:0] quotient;  // q < 4096 mm, BaseFraction bits; then sigma_z
  logic                           overflow;

  // The point in work.
  logic signed [             OffsetWidth-1:0] offset_q;
  logic signed [  vrscan_pkg::SlopeWidth-1:0] slope_q;
  logic        [  vrscan_pkg::SigmaWidth-1:0] sigma_q, typical_q;
  logic        [    vrscan_pkg::SnrWidth-1:0] snr_q;
  logic signed [  vrscan_pkg::AngleWidth-1:0] angle_q;
  logic        [               UserWidth-1:0] user_i_q, user_q;
  logic                                       measured_q, saturated_q;
  logic                                       lost_q, missing_q;

  // Bounds follow from |s| <= 2 and constants below 2048 mm or 2.
  logic signed [FactorWidth-1:0] s;
  logic signed [RoundedWidth-1:0] numerator_q;  // <= 6144 mm, BaseFraction bits
  logic signed [RoundedWidth-1:0] ray_cosine_q, ray_sine_q;  // <= 6, RayFraction bits
  logic signed [  RoundedWidth:0] divisor_q;  // <= 6 sqrt 2, RayFraction bits
  logic signed [RoundedWidth-1:0] rate_q;  // <= 2 sqrt 2, RayFraction bits
  logic signed [GradientWidth-1:0] move_q;  // <= 2048 mm, GradientFraction bits
  logic signed [GradientWidth-1:0] gradient_q;  // < 13700 mm, GradientFraction bits
  logic        [  FactorWidth-2:0] spread_q;  // < 128 px, SpreadFraction bits
  logic        [ RoundedWidth-2:0] scale_q;  // < 2**33
  logic        [vrscan_pkg::SigmaWidth-1:0] sigma_z_q;
  logic signed [    FullWidth-1:0] x_q, z_q;  // < 4096 mm, LengthFraction bits
  logic                            no_range_q;

  // The offset has OffsetFraction + PixelBits fraction bits as s; to nearest, half up, where bits
  // go.
  localparam int unsigned SFraction = vrscan_pkg::OffsetFraction + PixelBits;
  if (SFraction <= Fraction) begin : gen_s_left
    assign s = FactorWidth'(offset_q) <<< (Fraction - SFraction);
  end else begin : gen_s_right
    localparam int unsigned Drop = SFraction - Fraction;
    assign s = FactorWidth'(((OffsetWidth + 1)'(offset_q) + (OffsetWidth + 1)'(1 << (Drop - 1)))
                            >>> Drop);
  end

  logic [vrscan_pkg::AngleWidth-1:0] phase;
  assign phase = unsigned'(angle_q);
  quarter_wave #(
    .PhaseWidth(vrscan_pkg::AngleWidth),
    .AmplWidth (AmplWidth)
  ) u_quarter_wave (
    .clk_i,
    .rst_i,
    .valid_i (wave_start_q),
    .phase_i (phase),
    .valid_o (wave_valid),
    .sine_o  (sine),
    .cosine_o(cosine)
  );

  logic by_snr_q;  // c_obj is (9)
  logic signed [ FactorWidth-1:0] a;
  logic signed [RoundedWidth-1:0] b;
  always_comb begin
    unique case (step_q)
      NUMERATOR, RAY_COSINE, RAY_SINE:  a = s;
      DIVISOR_SINE, RATE_SINE, CROSS_X: a = FactorWidth'(sine);
      SPREAD:                           a = signed'(FactorWidth'(typical_q)) <<< SigmaAlign;
      WHOLE_SPREAD:                     a = signed'(FactorWidth'(sigma_q)) <<< SigmaAlign;
      GRADIENT:                         a = FactorWidth'(z_q);
      TOLERANCE:                        a = by_snr_q ? FactorWidth'(snr_q) : FactorWidth'(z_q);
      SCALE, WHOLE_SCALE:               a = FactorWidth'(gradient_q) <<< GradientSpare;
      default:                          a = FactorWidth'(cosine);
    endcase
    unique case (step_q)
      NUMERATOR, MOVE:         b = RoundedWidth'(geometry_i.n1);
      RAY_COSINE, RATE_COSINE: b = RoundedWidth'(geometry_i.d1);
      RAY_SINE, RATE_SINE:     b = RoundedWidth'(geometry_i.e1);
      DIVISOR_COSINE:          b = ray_cosine_q;
      DIVISOR_SINE:            b = ray_sine_q;
      SPREAD, WHOLE_SPREAD:    b = RoundedWidth'(slope_q) <<< SlopeAlign;
      GRADIENT:                b = rate_q;
      SCALE, WHOLE_SCALE:      b = signed'(RoundedWidth'(spread_q));
      TOLERANCE: begin
        b = by_snr_q ? signed'(RoundedWidth'(geometry_i.c_obj_gain)) <<< GainAlign
                     : signed'(RoundedWidth'(geometry_i.tolerance)) <<< ToleranceAlign;
      end
      default:                 b = signed'(RoundedWidth'(quotient));
    endcase
  end

  logic divides;
  assign divides = step_q == RANGE || step_q == SIGMA_Z || step_q == SHARE
                   || step_q == WHOLE_SIGMA_Z;

  multiply #(
    .AWidth(FactorWidth),
    .BWidth(RoundedWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (start_q && !divides),
    .a_i      (a),
    .b_i      (b),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // A negative operand gives nonsense, which no_range_q replaces.
  logic [DividendWidth-1:0] dividend;
  logic [ DivisorWidth-1:0] divisor;
  always_comb begin
    unique case (step_q)
      RANGE:   dividend = DividendWidth'(numerator_q[RoundedWidth-2:0]) << vrscan_pkg::RayFraction;
      SHARE:   dividend = DividendWidth'(scale_q);
      default: dividend = DividendWidth'(scale_q) << (vrscan_pkg::RayFraction - PixelBits);
    endcase
    divisor = divisor_q[DivisorWidth-1:0];
    if (step_q == SHARE) divisor = by_snr_q ? DivisorWidth'(1) : DivisorWidth'(sigma_z_q);
  end

  divide #(
    .DividendWidth(DividendWidth),
    .DivisorWidth (DivisorWidth),
    .QuotientWidth(RangeWidth)
  ) u_divide (
    .clk_i,
    .rst_i,
    .valid_i   (start_q && divides),
    .dividend_i(dividend),
    .divisor_i (divisor),
    .valid_o   (quotient_valid),
    .quotient_o(quotient),
    .overflow_o(overflow)
  );

  // To nearest, half up.
  logic signed [RoundedWidth:0] length_sum, move_sum;
  logic signed [ FullWidth-1:0] length;
  assign length_sum = (RoundedWidth + 1)'(rounded_q) + (RoundedWidth + 1)'(1 << (LengthDrop - 1));
  assign length     = FullWidth'(length_sum >>> LengthDrop);
  assign move_sum   = (RoundedWidth + 1)'(rounded_q) + (RoundedWidth + 1)'(1 << (GradientDrop - 1));

  // What needs it is below 2**33 to either side.
  logic [RoundedWidth-2:0] magnitude;
  assign magnitude =
      (RoundedWidth - 1)'(rounded_q[RoundedWidth-1] ? -rounded_q : rounded_q);

  logic x_fits, z_fits, in_range_q;
  assign x_fits = x_q == FullWidth'(signed'(x_q[vrscan_pkg::LengthWidth-1:0]));
  assign z_fits = z_q == FullWidth'(signed'(z_q[vrscan_pkg::LengthWidth-1:0]));

  logic [vrscan_pkg::SigmaWidth-1:0] sigma_z;
  assign sigma_z = |quotient[RangeWidth-1:vrscan_pkg::SigmaWidth]
                   ? '1 : quotient[vrscan_pkg::SigmaWidth-1:0];

  // From the 255th step on, 4 sigma_z, it is 1; by the S/N it is the share itself.
  logic [                           7:0] share, share_q;
  logic [vrscan_pkg::ConfidenceWidth-1:0] by_tolerance, c_obj;
  assign share = |quotient[RangeWidth-1:8] ? '1 : quotient[7:0];
  triangulate_rom u_triangulate_rom (
    .clk_i,
    .confidence_index_i(share_q),
    .confidence_entry_o(by_tolerance)
  );
  assign c_obj = by_snr_q ? share_q : by_tolerance;

  assign accept = valid_i && !busy_q;
  logic full, drop;
  assign full = valid_o && !ready_i;
  assign drop = (valid_i && busy_q) || (done_q && full);

  // What passes is taken a clock later than what is worked on.
  assign done = store_q && step_q == WHOLE_SIGMA_Z;
  always_ff @(posedge clk_i) user_i_q <= user_i;
  wide_register #(.Width(UserWidth)) u_user (
    .clk_i, .take_i(accept), .hold_i(1'b0), .d_i(user_i_q), .q_o(user_q)
  );
  wide_register #(.Width(UserWidth)) u_user_out (
    .clk_i, .take_i(done), .hold_i(full), .d_i(user_q), .q_o(user_o)
  );

  always_ff @(posedge clk_i) begin
    wave_start_q <= accept;
    start_q      <= wave_valid;
    if (wave_valid) step_q <= NUMERATOR;
    if (store_q) begin
      start_q <= step_q != WHOLE_SIGMA_Z;
      unique case (step_q)
        NUMERATOR: begin
          numerator_q <= RoundedWidth'(geometry_i.n0) + rounded_q;
          step_q      <= RAY_COSINE;
        end
        RAY_COSINE: begin
          ray_cosine_q <= RoundedWidth'(geometry_i.d0) + rounded_q;
          step_q       <= RAY_SINE;
        end
        RAY_SINE: begin
          ray_sine_q <= RoundedWidth'(geometry_i.e0) + rounded_q;
          step_q     <= DIVISOR_COSINE;
        end
        DIVISOR_COSINE: begin
          divisor_q <= (RoundedWidth + 1)'(rounded_q);
          step_q    <= DIVISOR_SINE;
        end
        DIVISOR_SINE: begin
          divisor_q <= divisor_q + (RoundedWidth + 1)'(rounded_q);
          step_q    <= RANGE;
        end
        RANGE: begin
          no_range_q <= overflow || numerator_q[RoundedWidth-1] || numerator_q == '0 ||
                        divisor_q[RoundedWidth] || divisor_q == '0;
          step_q     <= RATE_COSINE;
        end
        RATE_COSINE: begin
          rate_q <= rounded_q;
          step_q <= RATE_SINE;
        end
        RATE_SINE: begin
          rate_q <= rate_q + rounded_q;
          step_q <= MOVE;
        end
        MOVE: begin
          move_q <= GradientWidth'(move_sum >>> GradientDrop);
          step_q <= SPREAD;
        end
        SPREAD: begin
          spread_q <= (FactorWidth - 1)'(magnitude);
          step_q   <= CROSS_X;
        end
        CROSS_X: begin
          x_q    <= length;
          step_q <= CROSS_Z;
        end
        CROSS_Z: begin
          z_q    <= length;
          step_q <= GRADIENT;
        end
        GRADIENT: begin
          gradient_q <= move_q - GradientWidth'(rounded_q);
          step_q     <= SCALE;
        end
        SCALE: begin
          scale_q <= magnitude;
          step_q  <= SIGMA_Z;
        end
        SIGMA_Z: begin
          sigma_z_q <= sigma_z;
          step_q    <= TOLERANCE;
        end
        TOLERANCE: begin
          scale_q <= magnitude;
          step_q  <= SHARE;
        end
        SHARE: begin
          share_q <= share;
          step_q  <= WHOLE_SPREAD;
        end
        WHOLE_SPREAD: begin
          spread_q <= (FactorWidth - 1)'(magnitude);
          step_q   <= WHOLE_SCALE;
        end
        WHOLE_SCALE: begin
          scale_q <= magnitude;
          step_q  <= WHOLE_SIGMA_Z;
        end
        default: begin
          sigma_z_q <= sigma_z;
          busy_q    <= 1'b0;
        end
      endcase
    end
    // To nearest, half up.
    rounded_q <= RoundedWidth'(product >>> Fraction) + RoundedWidth'(product[Fraction-1]);
    store_q   <= product_valid || quotient_valid;
    done_q    <= done;
    // x_q and z_q stand long before done_q.
    in_range_q <= measured_q && !no_range_q && !saturated_q && x_fits && z_fits;
    by_snr_q   <= geometry_i.c_obj_gain != '0;

    if (accept) begin
      busy_q      <= 1'b1;
      offset_q    <= offset_i;
      slope_q     <= slope_i;
      sigma_q     <= sigma_i;
      typical_q   <= typical_i;
      snr_q       <= snr_i;
      angle_q     <= angle_i;
      measured_q  <= measured_i;
      saturated_q <= saturated_i;
      lost_q      <= missing_q || drop;
    end
    missing_q <= (missing_q || drop) && !accept;
    dropped_o <= drop;

    if (ready_i) valid_o <= 1'b0;
    if (done_q && !full) begin
      valid_o        <= 1'b1;
      measured_o     <= measured_q;
      x_o            <= in_range_q ? vrscan_pkg::LengthWidth'(x_q) : '0;
      z_o            <= in_range_q ? vrscan_pkg::LengthWidth'(z_q) : '0;
      sigma_z_o      <= in_range_q ? sigma_z_q : {vrscan_pkg::SigmaWidth{measured_q}};
      c_obj_o        <= in_range_q ? c_obj : '0;
      no_range_o     <= measured_q && no_range_q;
      out_of_range_o <= measured_q && !no_range_q && !in_range_q;
      lost_o         <= lost_q;
    end
    if (rst_i) begin
      busy_q       <= 1'b0;
      wave_start_q <= 1'b0;
      start_q      <= 1'b0;
      store_q      <= 1'b0;
      done_q       <= 1'b0;
      missing_q    <= 1'b0;
      dropped_o    <= 1'b0;
      valid_o      <= 1'b0;
    end
  end

endmodule

`default_nettype wire
