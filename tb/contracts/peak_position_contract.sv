// peak_position_contract: a place comes once, in time, and lies on the line.

`default_nettype none

module peak_position_contract #(
  parameter int unsigned IndexWidth    = 11,
  parameter int unsigned PositionWidth = 24
) (
  input wire logic                            clk_i,
  input wire logic                            rst_i,
  input wire logic                            valid_i,
  input wire logic        [   IndexWidth-1:0] left_i,
  input wire logic                            valid_o,
  input wire logic signed [PositionWidth-1:0] position_o
);

  localparam logic [7:0] Latency = 8'(vrscan_pkg::multiply_latency(
      vrscan_pkg::AngleWidth + 1, vrscan_pkg::WindowWidth + 1) + 1);

  logic                  started_q;
  logic [           7:0] age_q;  // clocks since valid_i; 0 is idle
  logic [IndexWidth-1:0] left_q;
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;
    if (valid_i) left_q <= left_i;

    if (started_q) begin
      simulated_left_stays: assume (valid_i || age_q == '0 || age_q == Latency || left_i == left_q);
      simulated_once_and_in_time: assert (valid_o == (age_q == Latency));
      simulated_not_before_the_window:
      assert (!valid_o || position_o >>> vrscan_pkg::PositionFraction >=
                          PositionWidth'(signed'({1'b0, left_q})));
    end
  end

endmodule

bind peak_position peak_position_contract #(
  .IndexWidth(IndexWidth), .PositionWidth(PositionWidth)
) u_contract (.*);

`default_nettype wire
