// multiply_contract: a product comes once, in time, and is exact.

`default_nettype none

module multiply_contract #(
  parameter int unsigned AWidth = 32,
  parameter int unsigned BWidth = 32
) (
  input wire logic                            clk_i,
  input wire logic                            rst_i,
  input wire logic                            valid_i,
  input wire logic signed [       AWidth-1:0] a_i,
  input wire logic signed [       BWidth-1:0] b_i,
  input wire logic                            valid_o,
  input wire logic signed [AWidth+BWidth-1:0] product_o
);

  localparam logic [7:0] Latency = 8'(vrscan_pkg::multiply_latency(AWidth, BWidth));

  logic                            started_q;
  logic        [              7:0] age_q;  // clocks since valid_i; 0 is idle
  logic signed [AWidth+BWidth-1:0] a_q, b_q;
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;
    if (valid_i) begin
      a_q <= (AWidth + BWidth)'(a_i);
      b_q <= (AWidth + BWidth)'(b_i);
    end

    if (started_q) begin
      simulated_once_and_in_time: assert (valid_o == (age_q == Latency));
      if (valid_o) begin
        simulated_exact: assert (product_o == a_q * b_q);
      end
    end
  end

endmodule

bind multiply multiply_contract #(.AWidth(AWidth), .BWidth(BWidth)) u_contract (.*);

`default_nettype wire
