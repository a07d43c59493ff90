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

  logic signed [       17:0] a_low_q, a_high_q, b_low_q, b_high_q;
  logic signed [       35:0] low_q, left_q, right_q, high_q, low_q2, left_q2, right_q2, high_q2;
  logic                [2:0] valid_q;

  always_ff @(posedge clk_i) begin
    a_low_q  <= signed'({1'b0, a_i[LowWidth-1:0]});
    a_high_q <= 18'(a_i >>> LowWidth);
    b_low_q  <= signed'({1'b0, b_i[LowWidth-1:0]});
    b_high_q <= 18'(b_i >>> LowWidth);

    low_q    <= a_low_q * b_low_q;
    left_q   <= a_high_q * b_low_q;
    right_q  <= a_low_q * b_high_q;
    high_q   <= a_high_q * b_high_q;

    low_q2   <= low_q;
    left_q2  <= left_q;
    right_q2 <= right_q;
    high_q2  <= high_q;

    product_o <= Width'(low_q2) + ((Width'(left_q2) + Width'(right_q2)) <<< LowWidth)
                 + (Width'(high_q2) <<< (2 * LowWidth));

    valid_q <= {valid_q[1:0], valid_i};
    valid_o <= valid_q[2];
    if (rst_i) begin
      valid_q <= '0;
      valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
