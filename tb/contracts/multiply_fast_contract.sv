// multiply_fast_contract: each pair of numbers gives its exact product, 4 clocks later.

`default_nettype none

module multiply_fast_contract #(
  parameter int unsigned AWidth = 35,
  parameter int unsigned BWidth = 35
) (
  input wire logic                            clk_i,
  input wire logic                            rst_i,
  input wire logic                            valid_i,
  input wire logic signed [       AWidth-1:0] a_i,
  input wire logic signed [       BWidth-1:0] b_i,
  input wire logic                            valid_o,
  input wire logic signed [AWidth+BWidth-1:0] product_o,
  input wire logic        [              2:0] valid_q
);

  localparam int unsigned Latency = 4;

  logic                            started_q;
  logic        [      Latency-1:0] due_q;
  logic signed [       AWidth-1:0] a_q[Latency];
  logic signed [       BWidth-1:0] b_q[Latency];
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    due_q     <= rst_i ? '0 : {due_q[Latency-2:0], valid_i};
    a_q[0]    <= a_i;
    b_q[0]    <= b_i;
    for (int unsigned k = 1; k < Latency; k++) begin
      a_q[k] <= a_q[k-1];
      b_q[k] <= b_q[k-1];
    end

    if (started_q) begin
      each_in_time: assert (valid_o == due_q[Latency-1]);
      step_due: assert (valid_q == due_q[Latency-2:0]);
      if (valid_o) begin
        simulated_exact: assert (product_o == (AWidth + BWidth)'(a_q[Latency-1]) *
                                              (AWidth + BWidth)'(b_q[Latency-1]));
      end
      a_product: cover (valid_o && product_o == '1);
    end
  end

endmodule

bind multiply_fast multiply_fast_contract #(.AWidth(AWidth), .BWidth(BWidth)) u_contract (.*);

`default_nettype wire
