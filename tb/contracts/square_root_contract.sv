// square_root_contract: a root comes once, in time, and is the nearest one.

`default_nettype none

module square_root_contract #(
  parameter int unsigned RootWidth = 24
) (
  input wire logic                         clk_i,
  input wire logic                         rst_i,
  input wire logic                         valid_i,
  input wire logic [      2*RootWidth-1:0] radicand_i,
  input wire logic                         valid_o,
  input wire logic [        RootWidth-1:0] root_o,
  input wire logic                         done_q,
  input wire logic [$clog2(RootWidth+2)-1:0] steps_q
);

  localparam logic [7:0] Latency = 8'(RootWidth + 3);
  localparam int unsigned Wide = 2 * RootWidth + 1;

  logic                   started_q;
  logic [            7:0] age_q;  // clocks since valid_i; 0 is idle
  logic [2*RootWidth-1:0] radicand_q;
  logic [       Wide-1:0] radicand, root, square;
  initial started_q = 1'b0;
  assign radicand = Wide'(radicand_q);
  assign root     = Wide'(root_o);
  assign square   = root * root;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;
    if (valid_i) radicand_q <= radicand_i;

    if (started_q) begin
      once_and_in_time: assert (valid_o == (age_q == Latency));
      step_age: assert (age_q <= Latency && done_q == (age_q == Latency - 8'd1));
      step_steps: assert (8'(steps_q) == (age_q >= 8'd1 && age_q < Latency - 8'd1
                                          ? Latency - 8'd1 - age_q : 8'd0));
      if (valid_o) begin
        // Below root + 1/2 and not below root - 1/2, in squares.
        bounded_nearest: assert ((radicand <= square + root || root_o == '1) &&
                                 (radicand + root > square || root_o == '0));
      end
      a_root: cover (valid_o && root_o != '0);
    end
  end

endmodule

bind square_root square_root_contract #(.RootWidth(RootWidth)) u_contract (.*);

`default_nettype wire
