// laser_lifeline_properties: what core and guard know of each other's life, with any inputs.
//
// What begins with "step_" is no claim of its own but what the induction needs; scripts/formal.py ties
// the wires "inside_*" to registers of the same name.

`default_nettype none

module laser_lifeline_properties #(
  parameter int unsigned BeatClks = 64
) (
  input wire logic       clk_i,
  input wire logic       rst_i,
  input wire logic       guard_ok_i,
  input wire logic       guard_beat_i,
  input wire logic [4:0] guard_fault_i,
  input wire logic       enable_i,
  input wire logic [7:0] first_i,
  input wire logic [7:0] second_i
);

  logic ok, heartbeat;

  guard_watch #(.BeatClks(BeatClks)) dut (
    .clk_i, .rst_i, .guard_ok_i, .guard_beat_i, .guard_fault_i,
    .ok_o(ok), .fault_o(), .trip_count_o()
  );
  laser_heartbeat #(.Width(8), .HeartbeatBits(1)) u_laser_heartbeat (
    .clk_i, .rst_i, .enable_i, .first_i, .second_i, .heartbeat_o(heartbeat)
  );

  // Tied to registers of the two.
  (* keep *) wire [$clog2(BeatClks+1)-1:0] inside_silent_q;
  (* keep *) wire inside_beat_q;
  (* keep *) wire [6:0] inside_dut__u_guard__meta_q, inside_dut__u_guard__stable_q;
  (* keep *) wire inside_laser_heartbeat__same_q, inside_laser_heartbeat__broken_q;

  logic        first_q = 1'b1;
  logic        beat_q, heartbeat_q;
  logic [ 1:0] no_q;  // guard_ok_i was 0, the newest clock first
  logic [15:0] silent_q;  // clocks since a change of the guard's beat was sampled
  logic        differed_q;  // in the last clock, or since then without an enable that was low
  logic        differed_q2, differed_q3;

  always_ff @(posedge clk_i) begin
    first_q     <= 1'b0;
    beat_q      <= !rst_i && guard_beat_i;
    heartbeat_q <= !rst_i && heartbeat;
    no_q        <= rst_i ? '1 : {no_q[0], !guard_ok_i};
    silent_q    <= rst_i || guard_beat_i != beat_q ? 16'd0
                   : silent_q == '1 ? silent_q : silent_q + 16'd1;
    differed_q  <= !rst_i && first_i != second_i;
    differed_q2 <= !rst_i && (differed_q || (differed_q2 && enable_i));
    differed_q3 <= !rst_i && differed_q2;
  end

  always_comb begin
    assume (!first_q || rst_i);
    if (!first_q) begin
      no_word_of_a_dead_guard: assert (silent_q < 16'(BeatClks + 2) || !ok);
      no_is_heard: assert (no_q != '1 || !ok);
      no_beat_after_a_difference: assert (!differed_q3 || heartbeat == heartbeat_q);

      step_beat: assert (inside_dut__u_guard__meta_q[5] == beat_q);
      step_no: assert (inside_dut__u_guard__meta_q[6] == !no_q[0] &&
                       inside_dut__u_guard__stable_q[6] == !no_q[1]);
      step_silent: assert (silent_q < 16'd2 || 16'(inside_silent_q) == 16'(BeatClks) ||
                           16'(inside_silent_q) >= silent_q - 16'd2);
      step_range: assert (16'(inside_silent_q) <= 16'(BeatClks));
      step_same: assert (inside_laser_heartbeat__same_q == !differed_q);
      step_broken: assert (inside_laser_heartbeat__broken_q == differed_q2);

      guard_lives: cover (ok && silent_q == 16'd3);
      beats: cover (heartbeat && !heartbeat_q);
    end
  end

endmodule

`default_nettype wire
