// multiply: signed multiplication of any width with one 18 x 18 multiplier.
//
// Product scanning: both operands are cut into limbs of 17 bits, the top one signed with up to 18.
// The limb products of one column i + j = k are added up, the sum's low 17 bits are the product's
// limb k, and the sum moves down by 17 bits for the next column.  Two registers stand on either side
// of the multiplier: it takes half of the clock itself, so the inner ones have to lie beside it, and
// the outer ones leave the rest of the design where it is.
//
//   product_o  a_i * b_i, exact for all operands
//   Latency    vrscan_pkg::multiply_latency, 5 clocks more than pairs of limbs; a valid_i meanwhile
//              starts anew
//   Model      vrscan.fixed.multiply, bit-exact

`default_nettype none

module multiply #(
  parameter int unsigned AWidth = 32,
  parameter int unsigned BWidth = 32
) (
  input  wire logic                            clk_i,
  input  wire logic                            rst_i,  // clears valid and busy only

  input  wire logic                            valid_i,
  input  wire logic signed [       AWidth-1:0] a_i,
  input  wire logic signed [       BWidth-1:0] b_i,

  output      logic                            valid_o,
  output      logic signed [AWidth+BWidth-1:0] product_o
);

  if (AWidth < 2 || BWidth < 2) begin : gen_bad_width
    $error("multiply: every width must be at least 2");
  end

  localparam int unsigned LimbWidth = 17;
  localparam int unsigned ALimbs = vrscan_pkg::multiply_limbs(AWidth);
  localparam int unsigned BLimbs = vrscan_pkg::multiply_limbs(BWidth);
  localparam int unsigned FewerLimbs = ALimbs < BLimbs ? ALimbs : BLimbs;
  localparam int unsigned AIndexWidth = ALimbs > 1 ? $clog2(ALimbs) : 1;
  localparam int unsigned BIndexWidth = BLimbs > 1 ? $clog2(BLimbs) : 1;
  localparam logic [AIndexWidth-1:0] ATop = AIndexWidth'(ALimbs - 1);
  localparam logic [BIndexWidth-1:0] BTop = BIndexWidth'(BLimbs - 1);
  // No limb product exceeds 2**34, and what comes down from the column before is below 2**-16 of a
  // column of FewerLimbs products: 2**35 * FewerLimbs bounds the sum.
  localparam int unsigned SumWidth = 36 + $clog2(FewerLimbs);
  localparam int unsigned LowWidth = LimbWidth * (ALimbs + BLimbs - 1);

  // The operands, sign-extended to whole limbs and the top limb's sign.
  logic signed [LimbWidth*ALimbs:0] a_q;
  logic signed [LimbWidth*BLimbs:0] b_q;

  // The pair of limbs on its way, and the pair that the column began with.
  logic [AIndexWidth-1:0] a_index_q, a_first_q;
  logic [BIndexWidth-1:0] b_index_q, b_first_q;
  logic                   busy_q, column_done, all_done;
  assign column_done = a_index_q == ATop || b_index_q == '0;
  assign all_done    = a_index_q == ATop && b_index_q == BTop;

  logic signed [17:0] a_limb, b_limb;
  always_comb begin
    a_limb = signed'(a_q[LimbWidth*ALimbs-:18]);
    for (int unsigned n = 0; n + 1 < ALimbs; n++) begin
      if (a_index_q == AIndexWidth'(n)) a_limb = signed'({1'b0, a_q[LimbWidth*n+:LimbWidth]});
    end
    b_limb = signed'(b_q[LimbWidth*BLimbs-:18]);
    for (int unsigned n = 0; n + 1 < BLimbs; n++) begin
      if (b_index_q == BIndexWidth'(n)) b_limb = signed'({1'b0, b_q[LimbWidth*n+:LimbWidth]});
    end
  end

  logic signed [        17:0] a_limb_q, b_limb_q, a_limb_q2, b_limb_q2;
  logic signed [        35:0] product_q, term_q;
  // Where the pair of limbs is: chosen, beside the multiplier, multiplied, and a term of the sum.
  logic        [         2:0] valid_q;
  logic        [         2:0] column_q;  // the last of a column
  logic        [         2:0] last_q;  // the last of all
  logic                       term_valid_q, term_column_q, term_last_q;
  logic signed [SumWidth-1:0] sum_q, sum;
  logic        [LowWidth-1:0] low_q;
  assign sum = sum_q + SumWidth'(term_q);

  always_ff @(posedge clk_i) begin
    if (valid_i) begin
      a_q       <= (LimbWidth * ALimbs + 1)'(a_i);
      b_q       <= (LimbWidth * BLimbs + 1)'(b_i);
      a_index_q <= '0;
      b_index_q <= '0;
      a_first_q <= '0;
      b_first_q <= '0;
    end else if (!column_done) begin
      a_index_q <= a_index_q + AIndexWidth'(1);
      b_index_q <= b_index_q - BIndexWidth'(1);
    end else if (b_first_q != BTop) begin
      a_index_q <= '0;
      b_index_q <= b_first_q + BIndexWidth'(1);
      b_first_q <= b_first_q + BIndexWidth'(1);
    end else begin
      a_index_q <= a_first_q + AIndexWidth'(1);
      a_first_q <= a_first_q + AIndexWidth'(1);
      b_index_q <= BTop;
    end
    busy_q <= valid_i || (busy_q && !all_done);

    a_limb_q       <= a_limb;
    b_limb_q       <= b_limb;
    a_limb_q2      <= a_limb_q;
    b_limb_q2      <= b_limb_q;
    product_q      <= a_limb_q2 * b_limb_q2;
    term_q         <= product_q;
    valid_q        <= valid_i ? '0 : {valid_q[1:0], busy_q};
    column_q       <= {column_q[1:0], column_done};
    last_q         <= {last_q[1:0], all_done};
    term_valid_q   <= valid_q[2] && !valid_i;
    term_column_q  <= column_q[2];
    term_last_q    <= last_q[2];

    if (valid_i) begin
      sum_q <= '0;
    end else if (term_valid_q) begin
      sum_q <= term_column_q ? sum >>> LimbWidth : sum;
      if (term_column_q) low_q <= LowWidth'({sum[LimbWidth-1:0], low_q} >> LimbWidth);
    end
    valid_o <= term_valid_q && term_last_q && !valid_i;
    if (term_valid_q && term_last_q) begin
      // The top limbs are still in the sum; the product is exact, so what is cut is its sign.
      product_o <= (AWidth + BWidth)'({sum, low_q} >> LimbWidth);
    end
    if (rst_i) begin
      busy_q       <= 1'b0;
      valid_q      <= '0;
      term_valid_q <= 1'b0;
      valid_o      <= 1'b0;
    end
  end

endmodule

`default_nettype wire
