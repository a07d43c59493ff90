// peak_position: the peak's place on the sensor from the phase of its window.
//
// delta = phase T / (2 pi) of (8).  The phase is an unsigned fraction of a turn, so the case
// delta' < 0 of (8) needs no logic: it is the upper half of the turn.
//
//   position_o  left + delta in px, 12 fraction bits, to nearest, half up, below the power of two
//               at or above LineLength
//   Latency  vrscan.fixed.peak_position.LATENCY clocks; a valid_i meanwhile starts anew
//   Model    vrscan.fixed.peak_position, bit-exact

`default_nettype none

module peak_position #(
  parameter int unsigned LineLength = 2048,
  localparam int unsigned IndexWidth    = $clog2(LineLength),
  localparam int unsigned PositionWidth = IndexWidth + 1 + vrscan_pkg::PositionFraction
) (
  input  wire logic                                      clk_i,
  input  wire logic                                      rst_i,

  input  wire logic                                      valid_i,
  input  wire logic        [             IndexWidth-1:0] left_i,  // must stay until valid_o
  input  wire logic        [vrscan_pkg::WindowWidth-1:0] period_i,
  input  wire logic        [ vrscan_pkg::AngleWidth-1:0] phase_i,

  output      logic                                      valid_o,
  output      logic signed [          PositionWidth-1:0] position_o
);

  localparam int unsigned PhaseWidth  = vrscan_pkg::AngleWidth + 1;
  localparam int unsigned PeriodWidth = vrscan_pkg::WindowWidth + 1;
  localparam int unsigned Shift       = vrscan_pkg::AngleWidth - vrscan_pkg::PositionFraction;

  logic                                     product_valid;
  logic signed [PhaseWidth+PeriodWidth-1:0] product;  // delta, AngleWidth fraction bits
  multiply #(.AWidth(PhaseWidth), .BWidth(PeriodWidth)) u_multiply (
    .clk_i, .rst_i,
    .valid_i,
    .a_i      (signed'({1'b0, phase_i})),
    .b_i      (signed'({1'b0, period_i})),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // A window ends on the line and delta is at most T, so the sum is LineLength at most.  That it
  // reaches only by rounding, and where it does not fit it is the largest position instead.
  logic signed [PositionWidth-1:0] delta, sum;
  assign delta = PositionWidth'((product + (PhaseWidth + PeriodWidth)'(1 << (Shift - 1)))
                                >>> Shift);
  assign sum   = delta
                 + (PositionWidth'(signed'({1'b0, left_i})) <<< vrscan_pkg::PositionFraction);

  always_ff @(posedge clk_i) begin
    valid_o <= product_valid && !valid_i;
    if (product_valid) begin
      position_o <= sum[PositionWidth-1] ? {1'b0, {(PositionWidth - 1){1'b1}}} : sum;
    end
    if (rst_i) valid_o <= 1'b0;
  end

endmodule

`default_nettype wire
