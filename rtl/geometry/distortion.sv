// distortion: corrects the lens's radial distortion, VR-SCAN (5).
//
// With r the distance from the optical axis, R = 2**$clog2(LineLength) px and s = r / R, which is
// a shift, the corrected distance is r (1 + g), g = k1 s^2 + k2 s^4, and its slope is
// 1 + s^2 (3 k1 + 5 k2 s^2).  (5) as printed takes |s|: g and the bend change sign left of the axis.
// One multiplier forms the five products one after the other; each is brought down by Fraction bits.
//
//   position_i   px, PositionFraction bits
//   centre       px, OffsetFraction bits; its lower CentreWidth bits
//   k1, k2       k1 R^2 and k2 R^4, DistortionFraction bits
//   offset_o     px, OffsetFraction bits; error below 2**-18 px for 10 % at the edge of 2048 px
//   slope_o      d offset / d position, SlopeFraction bits
//   saturated_o  one of the two does not fit, or the correction is beyond 100 %
//   Latency      5 products of multiply's latency + 2 clocks, + 2; a valid_i meanwhile starts
//                anew.  The configuration must hold meanwhile.
//   Model        vrscan.fixed.distortion, bit-exact

`default_nettype none

module distortion #(
  parameter  int unsigned LineLength    = 2048,
  localparam int unsigned PixelBits     = $clog2(LineLength),
  localparam int unsigned PositionWidth = PixelBits + 1 + vrscan_pkg::PositionFraction,
  localparam int unsigned CentreWidth   = PixelBits + 1 + vrscan_pkg::OffsetFraction,
  localparam int unsigned OffsetWidth   = CentreWidth + 1
) (
  input  wire logic                                          clk_i,
  input  wire logic                                          rst_i,  // clears control only

  input  wire logic                                          valid_i,
  input  wire logic signed [              PositionWidth-1:0] position_i,

  output      logic                                          valid_o,
  output      logic signed [                OffsetWidth-1:0] offset_o,
  output      logic signed [     vrscan_pkg::SlopeWidth-1:0] slope_o,
  output      logic                                          saturated_o,

  input  wire register_pkg::geometry_t                       geometry_i
);

  if (LineLength < 2 || LineLength > 8192) begin : gen_bad_line_length
    $error("distortion: LineLength must be 2 to 8192");
  end

  localparam int unsigned Fraction = 29;  // of every intermediate, and what a product moves down
  localparam int unsigned FactorWidth = 32;
  localparam int unsigned RoundedWidth =
      FactorWidth + 2 > OffsetWidth ? FactorWidth + 2 : OffsetWidth;
  localparam int unsigned ProductWidth = FactorWidth + RoundedWidth;
  localparam int unsigned CurveFraction = 23;
  localparam int unsigned SlopeDrop = CurveFraction - vrscan_pkg::SlopeFraction;
  localparam int unsigned Align = Fraction - vrscan_pkg::DistortionFraction;

  typedef enum logic [2:0] {SQUARE, INNER, GAIN, BEND, OFFSET} step_e;

  step_e                          step_q;
  logic                           start_q, store_q, done_q;
  logic                           product_valid;
  logic signed [ProductWidth-1:0] product;
  logic signed [RoundedWidth-1:0] rounded_q;

  logic signed [ OffsetWidth-1:0] r_q;
  logic                           flip_q;  // (5) as printed, left of the axis
  logic signed [ FactorWidth-1:0] s;  // |s| <= 2
  logic signed [   FactorWidth:0] square_q;  // up to 4
  logic signed [ FactorWidth+1:0] inner_q;  // |k2 s^2| <= 8
  logic signed [ FactorWidth+1:0] factor_q;  // |k1 + k2 s^2| <= 10
  logic signed [ FactorWidth+2:0] factor_inner_q;  // <= 18
  logic signed [ FactorWidth+3:0] curve_q;  // |3 k1 + 5 k2 s^2| <= 46
  logic signed [      Fraction:0] gain_q;
  logic signed [    Fraction+1:0] signed_gain_q;
  logic signed [ FactorWidth+1:0] bend_q;  // |s^2 curve| <= 184, CurveFraction bits
  logic signed [   OffsetWidth:0] offset_q;
  logic                           gain_saturated_q;

  // r has OffsetFraction + PixelBits fraction bits as s; to nearest, half up, where bits go.
  localparam int unsigned SFraction = vrscan_pkg::OffsetFraction + PixelBits;
  if (SFraction <= Fraction) begin : gen_s_left
    assign s = FactorWidth'(r_q) <<< (Fraction - SFraction);
  end else begin : gen_s_right
    localparam int unsigned Drop = SFraction - Fraction;
    assign s = FactorWidth'(((OffsetWidth + 1)'(r_q) + (OffsetWidth + 1)'(1 << (Drop - 1)))
                            >>> Drop);
  end

  // Where the factor reaches 4, |s| is at least 1, and the gain is far beyond its limit.
  logic signed [FactorWidth-1:0] factor;
  always_comb begin
    factor = FactorWidth'(factor_q);
    if (factor_q != (FactorWidth + 2)'(factor)) begin
      factor = {factor_q[FactorWidth+1], {(FactorWidth - 1) {!factor_q[FactorWidth+1]}}};
    end
  end

  logic signed [ FactorWidth-1:0] a;
  logic signed [RoundedWidth-1:0] b;
  always_comb begin
    b = RoundedWidth'(square_q);
    unique case (step_q)
      SQUARE: begin
        a = s;
        b = RoundedWidth'(s);
      end
      INNER:  a = FactorWidth'(geometry_i.k2) <<< Align;
      GAIN:   a = factor;
      // Towards minus infinity.
      BEND:   a = FactorWidth'(curve_q >>> (Fraction - CurveFraction));
      default: begin
        a = FactorWidth'(signed_gain_q);
        b = RoundedWidth'(r_q);
      end
    endcase
  end

  multiply #(
    .AWidth(FactorWidth),
    .BWidth(RoundedWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (start_q),
    .a_i      (a),
    .b_i      (b),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // -1 <= gain < 1.
  logic                     gain_fits;
  logic signed [Fraction:0] gain;
  assign gain_fits = rounded_q == RoundedWidth'(signed'(rounded_q[Fraction:0]));
  assign gain      = gain_fits ? signed'(rounded_q[Fraction:0]) :
                     {rounded_q[RoundedWidth-1], {Fraction{!rounded_q[RoundedWidth-1]}}};

  // One plus the bend, to nearest, half up.  The bend changes sign as its complement plus one.
  localparam int unsigned SlopeSumWidth = FactorWidth + 2;
  localparam logic signed [SlopeSumWidth-1:0] OneAndHalfStep =
      SlopeSumWidth'((64'd1 << CurveFraction) + (64'd1 << (SlopeDrop - 1)));
  logic signed [SlopeSumWidth-1:0] bend, slope_sum_q;
  assign bend = flip_q ? ~bend_q : bend_q;

  localparam int unsigned SlopeRoundedWidth = SlopeSumWidth - SlopeDrop;
  localparam logic signed [vrscan_pkg::SlopeWidth-1:0] SlopeMax =
      {1'b0, {(vrscan_pkg::SlopeWidth - 1) {1'b1}}};
  localparam logic signed [OffsetWidth-1:0] OffsetMax = {1'b0, {(OffsetWidth - 1) {1'b1}}};
  logic signed [SlopeRoundedWidth-1:0] slope;
  assign slope = SlopeRoundedWidth'(slope_sum_q >>> SlopeDrop);
  logic slope_fits, offset_fits;
  assign slope_fits  = slope <= SlopeRoundedWidth'(SlopeMax) &&
                       slope >= ~(SlopeRoundedWidth'(SlopeMax));
  assign offset_fits = offset_q[OffsetWidth] == offset_q[OffsetWidth-1];

  always_ff @(posedge clk_i) begin
    start_q <= 1'b0;
    if (store_q) begin
      start_q <= step_q != OFFSET;
      unique case (step_q)
        SQUARE: begin
          square_q <= (FactorWidth + 1)'(rounded_q);
          step_q   <= INNER;
        end
        INNER: begin
          inner_q  <= (FactorWidth + 2)'(rounded_q);
          factor_q <= (FactorWidth + 2)'(rounded_q)
                      + ((FactorWidth + 2)'(geometry_i.k1) <<< Align);
          step_q   <= GAIN;
        end
        GAIN: begin
          gain_q           <= gain;
          gain_saturated_q <= !gain_fits;
          step_q           <= BEND;
        end
        BEND: begin
          bend_q <= (FactorWidth + 2)'(rounded_q);
          step_q <= OFFSET;
        end
        default: offset_q <= (OffsetWidth + 1)'(r_q) + (OffsetWidth + 1)'(rounded_q);
      endcase
    end
    if (valid_i) begin
      r_q     <= (OffsetWidth'(position_i)
                  <<< (vrscan_pkg::OffsetFraction - vrscan_pkg::PositionFraction))
                 - OffsetWidth'(signed'(geometry_i.centre[CentreWidth-1:0]));
      step_q  <= SQUARE;
      start_q <= 1'b1;
    end
    flip_q <= geometry_i.even && r_q[OffsetWidth-1];

    // To nearest, half up.
    rounded_q <= RoundedWidth'(product >>> Fraction) + RoundedWidth'(product[Fraction-1]);

    // Ready long before they are used: at least one product lies between.
    factor_inner_q <= (FactorWidth + 3)'(factor_q) + (FactorWidth + 3)'(inner_q);
    curve_q        <= (FactorWidth + 4)'(factor_q) + ((FactorWidth + 4)'(factor_inner_q) <<< 1);
    signed_gain_q  <= flip_q ? '0 - (Fraction + 2)'(gain_q) : (Fraction + 2)'(gain_q);
    slope_sum_q    <= bend + OneAndHalfStep + SlopeSumWidth'(flip_q);

    // A product of the work before must not count for the new one.
    store_q <= product_valid && !start_q && !valid_i;
    done_q  <= store_q && step_q == OFFSET && !valid_i;
    valid_o <= done_q && !valid_i;
    if (done_q) begin
      offset_o    <= offset_fits           ? OffsetWidth'(offset_q) :
                     offset_q[OffsetWidth] ? ~OffsetMax : OffsetMax;
      slope_o     <= slope_fits                 ? vrscan_pkg::SlopeWidth'(slope) :
                     slope[SlopeRoundedWidth-1] ? ~SlopeMax : SlopeMax;
      saturated_o <= gain_saturated_q || !offset_fits || !slope_fits;
    end
    if (rst_i) begin
      start_q <= 1'b0;
      store_q <= 1'b0;
      done_q  <= 1'b0;
      valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
