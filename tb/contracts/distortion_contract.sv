// distortion_contract: an offset comes once and in time.

`default_nettype none

module distortion_contract #(
  parameter int unsigned RoundedWidth = 34
) (
  input wire logic clk_i,
  input wire logic rst_i,
  input wire logic valid_i,
  input wire logic valid_o
);

  localparam logic [7:0] Latency = 8'(5 * (vrscan_pkg::multiply_latency(32, RoundedWidth) + 2) + 2);

  logic       started_q;
  logic [7:0] age_q;  // clocks since valid_i; 0 is idle
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;
    if (started_q) simulated_once_and_in_time: assert (valid_o == (age_q == Latency));
  end

endmodule

bind distortion distortion_contract #(.RoundedWidth(RoundedWidth)) u_contract (.*);

`default_nettype wire
