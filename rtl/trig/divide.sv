// divide: unsigned division to the nearest integer, one quotient bit a clock.
//
// Restoring division of dividend + floor(divisor / 2), so the quotient is rounded to nearest, half
// up, without a step of its own.  The quotient's width is known beforehand: the remainder starts
// with the part of the dividend above it, and what does not fit shows before the first step.
//
//   quotient_o  round(dividend_i / divisor_i); all ones where that does not fit or divisor_i is 0
//   overflow_o  the quotient did not fit, or the divisor was zero
//   Latency     QuotientWidth + 3 clocks, whatever the operands; a valid_i meanwhile starts anew
//   Model       vrscan.fixed.divide, bit-exact

`default_nettype none

module divide #(
  parameter int unsigned DividendWidth = 57,
  parameter int unsigned DivisorWidth  = 46,
  parameter int unsigned QuotientWidth = 16
) (
  input  wire logic                     clk_i,
  input  wire logic                     rst_i,  // clears valid and the step counter only

  input  wire logic                     valid_i,
  input  wire logic [DividendWidth-1:0] dividend_i,
  input  wire logic [ DivisorWidth-1:0] divisor_i,

  output      logic                     valid_o,
  output      logic [QuotientWidth-1:0] quotient_o,
  output      logic                     overflow_o
);

  if (DividendWidth < 2 || DivisorWidth < 2 || QuotientWidth < 2) begin : gen_bad_width
    $error("divide: every width must be at least 2");
  end

  // The sum of two unsigned numbers needs one bit more than the wider one.  The part above the
  // quotient is compared with the divisor, so it is padded to the divisor's width where shorter.
  localparam int unsigned WiderWidth = DividendWidth > DivisorWidth ? DividendWidth : DivisorWidth;
  localparam int unsigned MinSumWidth = QuotientWidth + DivisorWidth;
  localparam int unsigned SumWidth = WiderWidth + 1 > MinSumWidth ? WiderWidth + 1 : MinSumWidth;
  localparam int unsigned HighWidth = SumWidth - QuotientWidth;
  localparam int unsigned CountWidth = $clog2(QuotientWidth + 1);

  logic [         SumWidth-1:0] sum_q;
  logic [     DivisorWidth-1:0] divisor_q;
  logic                         start_q, done_q;
  logic [       CountWidth-1:0] steps_q;
  logic [     DivisorWidth-1:0] remainder_q;  // below the divisor, the invariant of each step
  logic [    QuotientWidth-1:0] bits_q;  // dividend bits leave on the left, quotient bits enter
  logic                         overflow_q;

  // Twice the remainder plus the next bit is below twice the divisor: one bit more is enough.
  logic [DivisorWidth:0] shifted, difference;
  logic                  fits;
  assign shifted    = {remainder_q, bits_q[QuotientWidth-1]};
  assign difference = shifted - {1'b0, divisor_q};
  assign fits       = !difference[DivisorWidth];

  always_ff @(posedge clk_i) begin
    start_q <= valid_i;
    if (valid_i) begin
      sum_q     <= SumWidth'(dividend_i) + (SumWidth'(divisor_i) >> 1);
      divisor_q <= divisor_i;
    end
    if (start_q) begin
      // A zero divisor overflows too: nothing is below it.
      overflow_q  <= sum_q[SumWidth-1:QuotientWidth] >= HighWidth'(divisor_q);
      remainder_q <= sum_q[QuotientWidth +: DivisorWidth];
      bits_q      <= sum_q[QuotientWidth-1:0];
    end else if (steps_q != '0) begin
      remainder_q <= fits ? difference[DivisorWidth-1:0] : shifted[DivisorWidth-1:0];
      bits_q      <= {bits_q[QuotientWidth-2:0], fits};
    end
    if (start_q) steps_q <= CountWidth'(QuotientWidth);
    else if (steps_q != '0) steps_q <= steps_q - CountWidth'(1);

    done_q  <= steps_q == CountWidth'(1) && !start_q && !valid_i;
    valid_o <= done_q && !valid_i;
    if (done_q) begin
      quotient_o <= overflow_q ? '1 : bits_q;
      overflow_o <= overflow_q;
    end
    if (valid_i) steps_q <= '0;
    if (rst_i) begin
      start_q <= 1'b0;
      steps_q <= '0;
      done_q  <= 1'b0;
      valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
