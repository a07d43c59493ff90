// laser_guard_properties: what laser_guard never lets through, with any inputs.
//
// Every input is free in every clock, the reset too but for the first one.  What begins with "step_"
// is no claim of its own but what the induction needs; scripts/formal.py ties the wires "inside_*"
// to registers of the same name.

`default_nettype none

module laser_guard_properties #(
  parameter int unsigned GuardClks    = 16,
  parameter int unsigned PulseClks    = 300,
  parameter int unsigned RestartBeats = 16
) (
  input wire logic clk_i,
  input wire logic rst_i,
  input wire logic heartbeat_i,
  input wire logic pulse_i,
  input wire logic index_light_i
);

  logic pulse, index_light, ok;

  laser_guard #(
    .GuardClks(GuardClks), .PulseClks(PulseClks), .RestartBeats(RestartBeats)
  ) dut (
    .clk_i, .rst_i, .heartbeat_i, .pulse_i, .index_light_i,
    .pulse_o          (pulse),
    .index_light_o    (index_light),
    .ok_o             (ok),
    .fault_o          (),
    .heartbeat_trips_o(),
    .pulse_trips_o    ()
  );

  // Tied to registers of dut.
  (* keep *) wire [$clog2(GuardClks+1)-1:0] inside_silent_q;
  (* keep *) wire [$clog2(PulseClks+1)-1:0] inside_high_q;
  (* keep *) wire [$clog2(RestartBeats+1)-1:0] inside_beats_q;
  (* keep *) wire inside_heartbeat_q;
  // Of heartbeat and pulse.
  (* keep *) wire [1:0] inside_dut__u_core__meta_q, inside_dut__u_core__stable_q;

  logic        first_q = 1'b1;
  logic        heartbeat_q, ok_q;
  logic [15:0] silent_q;  // clocks since a change was sampled
  logic [15:0] request_q;  // clocks that the request has been sampled high
  logic [15:0] long_q;  // clocks that the pulse has been on
  logic [15:0] changes_q;  // sampled since the light went off or the reset

  logic [1:0] on_their_way;  // changes that the beats do not count yet
  assign on_their_way = {1'b0, inside_dut__u_core__meta_q[1] != inside_dut__u_core__stable_q[1]} +
                        {1'b0, inside_dut__u_core__stable_q[1] != inside_heartbeat_q};

  function automatic logic [15:0] more(input logic [15:0] count);
    more = count == '1 ? count : count + 16'd1;
  endfunction

  always_ff @(posedge clk_i) begin
    first_q     <= 1'b0;
    heartbeat_q <= !rst_i && heartbeat_i;
    ok_q        <= !rst_i && ok;
    silent_q    <= rst_i || heartbeat_i != heartbeat_q ? 16'd0 : more(silent_q);
    request_q   <= rst_i || !pulse_i ? 16'd0 : more(request_q);
    long_q      <= rst_i || !pulse ? 16'd0 : more(long_q);
    changes_q   <= rst_i || (ok_q && !ok) ? 16'd0 :
                   heartbeat_i != heartbeat_q ? more(changes_q) : changes_q;
  end

  always_comb begin
    assume (!first_q || rst_i);
    if (!first_q) begin
      gates_only_take_away: assert ((pulse_i || !pulse) && (index_light_i || !index_light));
      no_light_without_heartbeat:
      assert (silent_q < 16'(GuardClks + 3) || (!pulse && !index_light));
      pulse_length: assert (!pulse || long_q < 16'(PulseClks + 3));
      // Up to three changes may be on their way through the synchroniser when the light goes off.
      restart_takes_beats: assert (!ok || ok_q || 17'(changes_q) + 17'd3 >= 17'(RestartBeats));

      step_silent: assert (silent_q < 16'd2 || 16'(inside_silent_q) == 16'(GuardClks) ||
                           16'(inside_silent_q) >= silent_q - 16'd2);
      step_silent_range: assert (16'(inside_silent_q) <= 16'(GuardClks));
      step_high: assert (request_q < 16'd2 || 16'(inside_high_q) == 16'(PulseClks) ||
                         16'(inside_high_q) >= request_q - 16'd2);
      step_high_range: assert (16'(inside_high_q) <= 16'(PulseClks));
      step_long: assert (!pulse || long_q <= request_q);
      step_heartbeat: assert (inside_dut__u_core__meta_q[1] == heartbeat_q);
      step_beats:
      assert (ok || ok_q || 17'(inside_beats_q) + 17'(on_their_way) <= 17'(changes_q) + 17'd3);
      step_ready: assert (!ok || 16'(inside_beats_q) == 16'(RestartBeats));

      light: cover (pulse && index_light && long_q == 16'd2);
    end
  end

endmodule

`default_nettype wire
