// laser_heartbeat: beats for laser_guard, for as long as two interlocks agree.
//
// Two copies of laser_interlock have the same inputs.  Each clock their outputs and signatures are
// compared, and the beat's counter counts only where they were equal.  A register of one copy that
// sticks, falls over or is lost makes them differ, so the beats stop, and the guard is dark.  A
// counter that runs by itself would beat on.
//
//   first_i, second_i  all that has to be equal
//   enable_i      laser_enable: after a difference there is no beat until it was low, nor before
//                 they agree again
//   heartbeat_o   changes every 2**HeartbeatBits clocks
//   Latency  a difference stops the counter 2 clocks later
//   Model    vrscan.clocked.laser_heartbeat, bit-exact

`default_nettype none

module laser_heartbeat #(
  parameter int unsigned Width         = 1,
  parameter int unsigned HeartbeatBits = 5
) (
  input  wire logic             clk_i,
  input  wire logic             rst_i,

  input  wire logic             enable_i,
  input  wire logic [Width-1:0] first_i,
  input  wire logic [Width-1:0] second_i,

  output      logic             heartbeat_o
);

  if (HeartbeatBits < 1 || HeartbeatBits > 24) begin : gen_bad_heartbeat
    $error("laser_heartbeat: HeartbeatBits must be 1 to 24");
  end

  logic                   same_q, broken_q;
  logic [HeartbeatBits:0] beat_q;
  assign heartbeat_o = beat_q[HeartbeatBits];

  always_ff @(posedge clk_i) begin
    same_q   <= first_i == second_i;
    broken_q <= !same_q || (broken_q && enable_i);
    if (same_q && !broken_q) beat_q <= beat_q + (HeartbeatBits + 1)'(1);

    if (rst_i) begin
      same_q   <= 1'b1;
      broken_q <= 1'b0;
      beat_q   <= '0;
    end
  end

endmodule

`default_nettype wire
