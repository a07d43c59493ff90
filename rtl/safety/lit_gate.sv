// lit_gate: opens a photodiode's gate only while one light goes on.
//
// A diode shows the light that is on it, so under a beam at rest each pulse is one of the diode.
// Within one light another level takes a beam that moves.
//
//   lit_i    the light is on
//   gate_i   the diode's own gate, all ones where it has none
//   gate_o   gate_i, from AnswerClks clocks behind the light's beginning, in which the diode has to
//            answer, up to the clock behind its end
//   Latency  AnswerClks from lit_i = 1, 1 from lit_i = 0, none from gate_i
//   Model    vrscan.clocked.lit_gate, bit-exact

`default_nettype none

module lit_gate #(
  parameter int unsigned Samples    = 4,
  parameter int unsigned AnswerClks = 126  // 1 us at 125 MHz
) (
  input  wire logic               clk_i,
  input  wire logic               rst_i,

  input  wire logic               lit_i,
  input  wire logic [Samples-1:0] gate_i,
  output      logic [Samples-1:0] gate_o
);

  if (AnswerClks < 1) begin : gen_bad_answer
    $error("lit_gate: AnswerClks must be at least 1");
  end

  localparam int unsigned LitWidth = $clog2(AnswerClks + 1);
  logic [LitWidth-1:0] lit_q;  // clocks of this light

  always_ff @(posedge clk_i) begin
    if (rst_i || !lit_i) lit_q <= '0;
    else if (lit_q != LitWidth'(AnswerClks)) lit_q <= lit_q + LitWidth'(1);
  end

  assign gate_o = lit_q == LitWidth'(AnswerClks) ? gate_i : '0;

endmodule

`default_nettype wire
