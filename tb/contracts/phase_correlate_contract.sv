// phase_correlate_contract: one window at a time, each with one answer and what came with it, after
// twice its width and a time that it does not change; a second window where it was asked for.

`default_nettype none

module phase_correlate_contract #(
  parameter int unsigned UserWidth = 8
) (
  input wire logic                               clk_i,
  input wire logic                               rst_i,
  input wire logic                               valid_i,
  input wire logic                               measured_i,
  input wire logic [vrscan_pkg::WindowWidth-1:0] width_i,
  input wire logic [              UserWidth-1:0] user_i,
  input wire register_pkg::peak_t                peak_i,
  input wire logic                               refine_o,
  input wire logic                               refined_i,
  input wire logic [vrscan_pkg::WindowWidth-1:0] refined_width_i,
  input wire logic                               valid_o,
  input wire logic                               measured_o,
  input wire logic                               no_phase_o,
  input wire logic [vrscan_pkg::WindowWidth-1:0] width_o,
  input wire logic [              UserWidth-1:0] user_o
);

  localparam logic [15:0] Unmeasured = 16'd2;

  logic started_q, takes, works_q, measured_q, again_q, asked_q;  // a second window: due, asked for
  logic [                       15:0] age_q, twice, rest_q;  // clocks since the window came
  logic [vrscan_pkg::WindowWidth-1:0] width_q;
  logic [              UserWidth-1:0] user_q;
  initial {started_q, rest_q} = '0;
  assign takes = valid_i && (!works_q || valid_o);
  assign twice = {7'd0, width_q, 1'b0};

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    works_q   <= !rst_i && (takes || (works_q && !valid_o));
    asked_q   <= !rst_i && (refine_o || asked_q) && !refined_i;
    again_q   <= takes ? measured_i && peak_i.window_two_pass : again_q && !refine_o;
    age_q     <= takes || (asked_q && refined_i) ? 16'd1 : age_q + 16'd1;
    if (takes) {measured_q, width_q, user_q} <= {measured_i, width_i, user_i};
    else if (asked_q && refined_i) width_q <= refined_width_i;
    if (started_q && valid_o && measured_q && rest_q == '0) rest_q <= age_q - twice;

    if (started_q) begin
      simulated_one_for_each: assert (!valid_o || (works_q && !again_q && !asked_q));
      simulated_second_window_once: assert (!refine_o || (works_q && again_q && !asked_q));
      if (valid_o) begin
        simulated_whatever_the_window:
        assert (measured_q ? rest_q == '0 || age_q == twice + rest_q : age_q == Unmeasured);
        simulated_what_came: assert (user_o == user_q && width_o == width_q);
        simulated_no_phase_of_nothing: assert (!measured_o || (measured_q && !no_phase_o));
      end
    end
  end

endmodule

bind phase_correlate phase_correlate_contract #(.UserWidth(UserWidth)) u_contract (.*);

`default_nettype wire
