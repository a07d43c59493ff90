// free_interval_contract: an interval comes once and in time, is one or none, and holds.

`default_nettype none

module free_interval_contract (
  input wire logic                             clk_i,
  input wire logic                             rst_i,
  input wire logic                             valid_i,
  input wire logic                             valid_o,
  input wire logic [vrscan_pkg::FreeWidth-1:0] from_o,
  input wire logic [vrscan_pkg::FreeWidth-1:0] to_o
);

  localparam logic [7:0] Latency = 8'd26;

  logic                               started_q, given_q;
  logic [                        7:0] age_q;  // clocks since valid_i; 0 is idle
  logic [2*vrscan_pkg::FreeWidth-1:0] interval_q;
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q  <= started_q || rst_i;
    age_q      <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;
    given_q    <= (given_q || valid_o) && !rst_i;
    interval_q <= {from_o, to_o};

    if (started_q) begin
      simulated_once_and_in_time: assert (valid_o == (age_q == Latency));
      simulated_one_or_none: assert (!valid_o || from_o < to_o || {from_o, to_o} == '0);
      simulated_holds: assert (!given_q || valid_o || {from_o, to_o} == interval_q);
    end
  end

endmodule

bind free_interval free_interval_contract u_contract (.*);

`default_nettype wire
