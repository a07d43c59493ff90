// multiply_fast: the product of two signed numbers of up to 35 bits, one a clock.
//
// Four 18-bit multipliers with registers on both sides; multiply needs one of them and more clocks.
//
//   Latency  vrscan.fixed.multiply.FAST_LATENCY clocks
//   Model    vrscan.fixed.multiply, which is exact

`default_nettype none

module multiply_fast #(
  parameter int unsigned AWidth = 35,
  parameter int unsigned BWidth = 35
) (
  input  wire logic                            clk_i,
  input  wire logic                            rst_i,  // clears valid only

  input  wire logic                            valid_i,
  input  wire logic signed [       AWidth-1:0] a_i,
  input  wire logic signed [       BWidth-1:0] b_i,

  output      logic                            valid_o,
  output      logic signed [AWidth+BWidth-1:0] product_o
);

  if (AWidth < 18 || AWidth > 35 || BWidth < 18 || BWidth > 35) begin : gen_bad_width
    $error("multiply_fast: every width must be 18 to 35");
  end

  localparam int unsigned LowWidth = 17;
  localparam int unsigned Width    = AWidth + BWidth;

  // The outer products stand beside each other: the low one is never negative and has 2 LowWidth
  // bits.  What is added to them is the inner ones' sum.
  localparam int unsigned OuterWidth = 36 + 2 * LowWidth;
  localparam int unsigned AddedWidth = OuterWidth - LowWidth;
  logic signed [          17:0] a_low_q, a_high_q, b_low_q, b_high_q;
  logic        [2*LowWidth-1:0] low_q;
  logic signed [          35:0] left_q, right_q, high_q;
  logic signed [          36:0] inner_q2;
  logic signed [OuterWidth-1:0] outer_q2;
  logic signed [AddedWidth-1:0] added;
  logic                   [2:0] valid_q;
  assign added = signed'(outer_q2[OuterWidth-1:LowWidth]) + AddedWidth'(inner_q2);

  always_ff @(posedge clk_i) begin
    a_low_q  <= signed'({1'b0, a_i[LowWidth-1:0]});
    a_high_q <= 18'(a_i >>> LowWidth);
    b_low_q  <= signed'({1'b0, b_i[LowWidth-1:0]});
    b_high_q <= 18'(b_i >>> LowWidth);

    low_q    <= (2 * LowWidth)'(36'(a_low_q) * 36'(b_low_q));
    left_q   <= a_high_q * b_low_q;
    right_q  <= a_low_q * b_high_q;
    high_q   <= a_high_q * b_high_q;

    outer_q2  <= {high_q, low_q};
    inner_q2  <= 37'(left_q) + 37'(right_q);
    product_o <= Width'({added, outer_q2[LowWidth-1:0]});

    valid_q <= {valid_q[1:0], valid_i};
    valid_o <= valid_q[2];
    if (rst_i) begin
      valid_q <= '0;
      valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
