// lit_gate_properties: the diode of a beam at rest has no edge within an opening of lit_gate.
//
// The light, its level, the gate and the diode's comparator are free in every clock.  While the beam
// moves (moves_i) the comparator is free, too.  At rest it may be any function of the light, so it may
// change in the dark, in a pulse, in the AnswerClks clocks after the beginning of constant light, and
// in the LevelClks clocks after the pin of the start-up level, which is a clock behind startup_i, has
// another level.  What begins with "step_" is no claim of its own but what the induction needs;
// scripts/formal.py ties the wire "inside_left_q".

`default_nettype none

module lit_gate_properties #(
  parameter int unsigned AnswerClks = 126,
  parameter int unsigned LevelClks  = 625_000
) (
  input wire logic        clk_i,
  input wire logic        rst_i,
  input wire logic        pulse_i,
  input wire logic        index_light_i,
  input wire logic [15:0] startup_i,
  input wire logic [ 1:0] comparator_i,
  input wire logic [ 1:0] gate_i,
  input wire logic        moves_i
);

  logic [1:0] gate;
  lit_gate #(.Samples(2), .AnswerClks(AnswerClks), .LevelClks(LevelClks)) dut (
    .clk_i, .rst_i, .pulse_i, .index_light_i, .startup_i, .gate_i, .gate_o(gate)
  );
  (* keep *) wire [$clog2(LevelClks+1)-1:0] inside_left_q;
  (* keep *) wire [15:0] inside_startup_q;

  logic        first_q = 1'b1;
  logic        lit;
  logic [ 1:0] comparator_q, gate_q;
  logic [15:0] startup_q;
  logic [31:0] steady_q;  // clocks of light without a pulse that go before this one
  logic [31:0] still_q;  // clocks since the level changed
  logic [31:0] answer_left, level_left;
  assign lit         = index_light_i && !pulse_i;
  assign answer_left = steady_q < AnswerClks ? AnswerClks - steady_q : 32'd0;
  assign level_left  = still_q < LevelClks + 1 ? LevelClks + 32'd1 - still_q : 32'd0;

  always_ff @(posedge clk_i) begin
    first_q      <= 1'b0;
    comparator_q <= comparator_i;
    gate_q       <= gate;
    startup_q    <= startup_i;
    if (!lit) steady_q <= '0;
    else if (steady_q != '1) steady_q <= steady_q + 32'd1;
    if (rst_i || startup_i != startup_q) still_q <= 32'd1;
    else if (still_q != '1) still_q <= still_q + 32'd1;
  end

  always_comb begin
    assume (!first_q || rst_i);
    if (!first_q) begin
      a_beam_at_rest:
      assume (moves_i || !lit || steady_q <= AnswerClks || still_q <= LevelClks + 1 ||
              comparator_i == comparator_q);

      no_edge_of_a_beam_at_rest:
      assert (moves_i || gate != '1 || gate_q != '1 || comparator_i == comparator_q);
      open_in_constant_light:
      assert (gate == (lit && answer_left == '0 && level_left == '0 ? gate_i : '0));

      step_left: assert (32'(inside_left_q) == (answer_left > level_left ? answer_left
                                                                         : level_left));
      step_startup: assert (inside_startup_q == startup_q);

      an_edge_of_a_beam_that_moves:
      cover (gate == '1 && gate_q == '1 && comparator_i != comparator_q);
    end
  end

endmodule

`default_nettype wire
