// lit_gate: opens the gate of a photodiode only while the light on it is constant.
//
// The diode of a beam at rest shows every change of the light: a pulse, the index light, its level.
// While the light is constant, another level of the diode means that the beam moves.
//
//   pulse_i       the main channel is on.  Its light is stronger than the start-up channel's, and its
//                 power changes between pulses, so the gate is closed in a pulse
//   index_light_i, startup_i  the start-up channel is on, and its level
//   gate_i        the diode's own gate, all ones where it has none
//   gate_o        gate_i while the index light is on without a pulse, from AnswerClks clocks after the
//                 beginning of that on, in which the diode has to answer, and from LevelClks + 1 clocks
//                 after a change of startup_i or a reset on, in which the level's filter settles
//   Latency       none, but for startup_i: 1
//   Model         vrscan.clocked.lit_gate, bit-exact

`default_nettype none

module lit_gate #(
  parameter int unsigned Samples    = 4,
  parameter int unsigned AnswerClks = 126,  // 1 us at 125 MHz
  parameter int unsigned LevelClks  = 625_000  // 5 ms
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  input  wire logic                              pulse_i,
  input  wire logic                              index_light_i,
  input  wire logic [vrscan_pkg::PowerWidth-1:0] startup_i,
  input  wire logic [               Samples-1:0] gate_i,
  output      logic [               Samples-1:0] gate_o
);

  if (AnswerClks < 1 || LevelClks <= AnswerClks) begin : gen_bad_clks
    $error("lit_gate: AnswerClks must be at least 1, LevelClks above AnswerClks");
  end

  localparam int unsigned LeftWidth = $clog2(LevelClks + 1);
  logic [vrscan_pkg::PowerWidth-1:0] startup_q;
  logic [             LeftWidth-1:0] left_q;  // clocks of constant light before the gate opens
  logic                              lit;
  assign lit    = index_light_i && !pulse_i;
  assign gate_o = lit && left_q == '0 ? gate_i : '0;

  always_ff @(posedge clk_i) begin
    startup_q <= startup_i;
    if (rst_i || startup_i != startup_q) left_q <= LeftWidth'(LevelClks);
    else if (!lit && left_q <= LeftWidth'(AnswerClks)) left_q <= LeftWidth'(AnswerClks);
    else if (left_q != '0) left_q <= left_q - LeftWidth'(1);
  end

endmodule

`default_nettype wire
