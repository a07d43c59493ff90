// synchronizer: a value of another clock, or of none, through two flip-flops of this one.
//
// ASYNC_REG keeps the two side by side and out of shift-register primitives; the tools place and
// time them for metastability.  Of several bits at most one may change at a time, as in Gray code,
// or each has a meaning of its own.
//
//   q_o      d_i; 0 while rst_i
//   Latency  2 clocks
//   Model    none: what has its own twin begins behind it

`default_nettype none

module synchronizer #(
  parameter int unsigned Width = 1
) (
  input  wire logic             clk_i,
  input  wire logic             rst_i,
  input  wire logic [Width-1:0] d_i,
  output      logic [Width-1:0] q_o
);

  (* ASYNC_REG = "TRUE" *) logic [Width-1:0] meta_q, stable_q;
  assign q_o = stable_q;

  always_ff @(posedge clk_i) begin
    {stable_q, meta_q} <= {meta_q, d_i};
    if (rst_i) {stable_q, meta_q} <= '0;
  end

endmodule

`default_nettype wire
