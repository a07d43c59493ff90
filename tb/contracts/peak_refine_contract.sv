// peak_refine_contract: the second window lies inside the line, and comes in a time that it does not
// change.

`default_nettype none

module peak_refine_contract #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned MaxWindow  = 255,
  parameter int unsigned IndexWidth = 11
) (
  input wire logic                               clk_i,
  input wire logic                               rst_i,
  input wire logic                               start_i,
  input wire logic                               valid_i,
  input wire logic                               reading_o,
  input wire logic                               valid_o,
  input wire logic [             IndexWidth-1:0] left_o,
  input wire logic [             IndexWidth-1:0] right_o,
  input wire logic [vrscan_pkg::WindowWidth-1:0] width_o,
  input wire logic                               at_edge_o
);

  logic        started_q, asked_q;  // valid_i has come, and has no answer yet
  logic [15:0] age_q, latency_q;  // clocks since it came; of the first answer
  initial {started_q, latency_q} = '0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    asked_q   <= !rst_i && (valid_i || (asked_q && !valid_o)) && !(start_i && !asked_q);
    age_q     <= asked_q && !valid_o ? age_q + 16'd1 : 16'd1;
    if (started_q && valid_o && latency_q == '0) latency_q <= age_q;

    if (started_q) begin
      simulated_one_for_each: assert (!valid_o || asked_q);
      simulated_reads_while_it_works: assert (!reading_o || asked_q);
      simulated_whatever_the_window: assert (latency_q == '0 || !asked_q ||
                                             valid_o == (age_q == latency_q));
      if (valid_o) begin
        simulated_window_inside_the_line: assert (left_o <= right_o && 32'(right_o) < LineLength);
        simulated_width_is_the_windows:
        assert (32'(width_o) == 32'(right_o) - 32'(left_o) + 32'd1 && 32'(width_o) <= MaxWindow);
        simulated_edge: assert (at_edge_o == (left_o == '0 || 32'(right_o) == LineLength - 1));
      end
    end
  end

endmodule

bind peak_refine peak_refine_contract #(
  .LineLength(LineLength), .MaxWindow(MaxWindow), .IndexWidth(IndexWidth)
) u_contract (.*);

`default_nettype wire
