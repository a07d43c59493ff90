// scan_angle_contract: an angle comes once and in time, and one beyond half a turn is its end.

`default_nettype none

module scan_angle_contract (
  input wire logic                                     clk_i,
  input wire logic                                     rst_i,
  input wire logic                                     valid_i,
  input wire logic                                     valid_o,
  input wire logic signed [vrscan_pkg::AngleWidth-1:0] angle_o,
  input wire logic                                     overflow_o
);

  localparam logic [7:0] Latency = 8'd193;
  localparam logic signed [vrscan_pkg::AngleWidth-1:0] Most =
      {1'b0, {(vrscan_pkg::AngleWidth - 1) {1'b1}}};

  logic       started_q;
  logic [7:0] age_q;  // clocks since valid_i; 0 is idle
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;

    if (started_q) begin
      simulated_once_and_in_time: assert (valid_o == (age_q == Latency));
      simulated_saturated: assert (!valid_o || !overflow_o || angle_o == Most || angle_o == ~Most);
    end
  end

endmodule

bind scan_angle scan_angle_contract u_contract (.*);

`default_nettype wire
