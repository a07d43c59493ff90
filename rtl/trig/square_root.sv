// square_root: square root to the nearest integer, one bit a clock.
//
// Restoring digit by digit.  One bit below the units is found too: it says whether the root lies
// above the middle between two integers, so rounding needs no comparison of its own.
//
//   root_o   round(sqrt(radicand_i)); all ones where the rounded root would not fit
//   Latency  RootWidth + 3 clocks, whatever the radicand; a valid_i meanwhile starts anew
//   Model    vrscan.fixed.square_root, bit-exact

`default_nettype none

module square_root #(
  parameter int unsigned RootWidth = 24
) (
  input  wire logic                   clk_i,
  input  wire logic                   rst_i,  // clears valid and the step counter only

  input  wire logic                   valid_i,
  input  wire logic [2*RootWidth-1:0] radicand_i,

  output      logic                   valid_o,
  output      logic [  RootWidth-1:0] root_o
);

  if (RootWidth < 2) begin : gen_bad_width
    $error("square_root: RootWidth must be at least 2");
  end

  localparam int unsigned Steps = RootWidth + 1;
  localparam int unsigned CountWidth = $clog2(Steps + 1);

  logic [2*RootWidth-1:0] radicand_q;  // leaves on the left in pairs of bits, zeros follow
  logic [    RootWidth:0] root_q;
  logic [    RootWidth:0] remainder_q;  // at most twice the root before the last step
  logic                   done_q;
  logic [ CountWidth-1:0] steps_q;

  // A step subtracts (2 root + 1)**2 - (2 root)**2 from four times the remainder and two new bits.
  logic [RootWidth+3:0] shifted, difference;
  logic                 fits;
  assign shifted    = {1'b0, remainder_q, radicand_q[2*RootWidth-1-:2]};
  assign difference = shifted - {1'b0, root_q, 2'b01};
  assign fits       = !difference[RootWidth+3];

  always_ff @(posedge clk_i) begin
    if (valid_i) begin
      radicand_q  <= radicand_i;
      root_q      <= '0;
      remainder_q <= '0;
    end else if (steps_q != '0) begin
      radicand_q  <= {radicand_q[2*RootWidth-3:0], 2'b00};
      root_q      <= {root_q[RootWidth-1:0], fits};
      // The last remainder may be wider; nobody reads it.
      remainder_q <= fits ? difference[RootWidth:0] : shifted[RootWidth:0];
    end
    if (valid_i) steps_q <= CountWidth'(Steps);
    else if (steps_q != '0) steps_q <= steps_q - CountWidth'(1);

    done_q  <= steps_q == CountWidth'(1) && !valid_i;
    valid_o <= done_q && !valid_i;
    if (done_q) begin
      root_o <= root_q[RootWidth:1] + RootWidth'(root_q[0] && root_q[RootWidth:1] != '1);
    end
    if (rst_i) begin
      steps_q <= '0;
      done_q  <= 1'b0;
      valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
