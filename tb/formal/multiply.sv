// multiply, for proofs: any product at any time, which is more than the real one can do.
//
// The power's arithmetic is then no part of a proof: the limits hold whatever it comes to.

`default_nettype none

module multiply #(
  parameter int unsigned AWidth = 32,
  parameter int unsigned BWidth = 32
) (
  input  wire logic                            clk_i,
  input  wire logic                            rst_i,
  input  wire logic                            valid_i,
  input  wire logic signed [       AWidth-1:0] a_i,
  input  wire logic signed [       BWidth-1:0] b_i,
  output      logic                            valid_o,
  output      logic signed [AWidth+BWidth-1:0] product_o
);

  (* anyseq *) logic                            valid;
  (* anyseq *) logic signed [AWidth+BWidth-1:0] product;
  assign valid_o   = valid;
  assign product_o = product;

endmodule

`default_nettype wire
