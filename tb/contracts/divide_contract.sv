// divide_contract: a quotient comes once, in time, and is the nearest one.

`default_nettype none

module divide_contract #(
  parameter int unsigned DividendWidth = 57,
  parameter int unsigned DivisorWidth  = 46,
  parameter int unsigned QuotientWidth = 16
) (
  input wire logic                     clk_i,
  input wire logic                     rst_i,
  input wire logic                     valid_i,
  input wire logic [DividendWidth-1:0] dividend_i,
  input wire logic [ DivisorWidth-1:0] divisor_i,
  input wire logic                     valid_o,
  input wire logic [QuotientWidth-1:0] quotient_o,
  input wire logic                     overflow_o,
  input wire logic                     start_q,
  input wire logic                     done_q,
  input wire logic [$clog2(QuotientWidth+1)-1:0] steps_q
);

  localparam logic [7:0] Latency = 8'(QuotientWidth + 3);
  localparam int unsigned Product = QuotientWidth + DivisorWidth;
  localparam int unsigned Wide = (DividendWidth > Product ? DividendWidth : Product) + 1;

  logic                     started_q;
  logic [              7:0] age_q;  // clocks since valid_i; 0 is idle
  logic [DividendWidth-1:0] dividend_q;
  logic [ DivisorWidth-1:0] divisor_q;
  logic [         Wide-1:0] sum, least;
  initial started_q = 1'b0;
  assign sum   = Wide'(dividend_q) + Wide'(divisor_q >> 1);
  assign least = Wide'(quotient_o) * Wide'(divisor_q);

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;
    if (valid_i) {dividend_q, divisor_q} <= {dividend_i, divisor_i};

    if (started_q) begin
      once_and_in_time: assert (valid_o == (age_q == Latency));
      step_age: assert (age_q <= Latency && start_q == (age_q == 8'd1) &&
                        done_q == (age_q == Latency - 8'd1));
      step_steps: assert (8'(steps_q) == (age_q >= 8'd2 && age_q < Latency - 8'd1
                                          ? Latency - 8'd1 - age_q : 8'd0));
      if (valid_o) begin
        bounded_nearest: assert (overflow_o || (least <= sum && sum - least < Wide'(divisor_q)));
        bounded_overflow: assert (!overflow_o ||
                                  (quotient_o == '1 && sum >= Wide'(divisor_q) << QuotientWidth));
      end
      a_quotient: cover (valid_o && !overflow_o && quotient_o != '0);
    end
  end

endmodule

bind divide divide_contract #(
  .DividendWidth(DividendWidth), .DivisorWidth(DivisorWidth), .QuotientWidth(QuotientWidth)
) u_contract (.*);

`default_nettype wire
