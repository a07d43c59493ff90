// peak_confidence_contract: each peak that is taken has its answer once and in time.

`default_nettype none

module peak_confidence_contract (
  input wire logic                                   clk_i,
  input wire logic                                   rst_i,
  input wire logic                                   valid_i,
  input wire logic                                   measured_i,
  input wire logic                                   clear_i,
  input wire logic                                   valid_o,
  input wire logic [     vrscan_pkg::SigmaWidth-1:0] sigma_o,
  input wire logic [vrscan_pkg::ConfidenceWidth-1:0] c_sfm_o
);

  // Seven products, two quotients and a root, one after the other.
  localparam logic [15:0] Latency = 16'(7 * (vrscan_pkg::multiply_latency(50, 32) + 2)
                                        + 2 * (vrscan_pkg::SigmaWidth + 4) + (28 + 4) + 2);

  logic        started_q, takes, measured_q, clear_q;
  logic [15:0] age_q;  // clocks since the peak that was taken; 0 is idle
  initial started_q = 1'b0;
  assign takes = valid_i && (age_q == '0 || age_q == Latency);

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : takes ? 16'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 16'd1;
    if (takes) {measured_q, clear_q} <= {measured_i, clear_i};

    if (started_q) begin
      simulated_once_and_in_time: assert (valid_o == (age_q == Latency));
      simulated_no_sigma_of_nothing: assert (!valid_o || measured_q || sigma_o == '0);
      simulated_no_confidence_in_light: assert (!valid_o || clear_q || c_sfm_o == '0);
    end
  end

endmodule

bind peak_confidence peak_confidence_contract u_contract (.*);

`default_nettype wire
