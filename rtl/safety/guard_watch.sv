// guard_watch: what the core knows of laser_guard: whether it lives, and its trips.
//
//   guard_*_i     of laser_guard, in its clock; synchronised here.  guard_ok_i = 1, a guard_beat_i that
//                 changes, and no fault where there is no guard
//   ok_o          guard_ok_i, and guard_beat_i has changed in the last BeatClks clocks
//   fault_o       the last trip's guard_fault_i, until the next one
//   trip_count_o  how often guard_fault_i left 0 since the reset; stops at its largest value
//   Latency  guard_ok_i to ok_o 2 clocks; the last change of guard_beat_i to ok_o = 0 BeatClks + 3
//   Model    vrscan.clocked.guard_watch, bit-exact

`default_nettype none

module guard_watch #(
  parameter int unsigned CountWidth = 16,
  parameter int unsigned BeatClks   = 64  // 0.83 us: the guard's beats are 0.2 us apart
) (
  input  wire logic                                    clk_i,
  input  wire logic                                    rst_i,

  input  wire logic                                    guard_ok_i,
  input  wire logic                                    guard_beat_i,
  input  wire logic [                             4:0] guard_fault_i,

  output      logic                                    ok_o,
  output      logic [                             4:0] fault_o,
  output      logic [    vrscan_pkg::CounterWidth-1:0] trip_count_o
);

  localparam int unsigned SilentWidth = $clog2(BeatClks + 1);
  if (BeatClks < 4) begin : gen_bad_clks
    $error("guard_watch: BeatClks must be at least 4");
  end

  logic                   ok, beat, beat_q, tripped_q;
  logic [            4:0] fault;
  logic [SilentWidth-1:0] silent_q;
  synchronizer #(.Width(7)) u_guard (
    .clk_i, .rst_i, .d_i({guard_ok_i, guard_beat_i, guard_fault_i}), .q_o({ok, beat, fault})
  );
  assign ok_o = ok && silent_q != SilentWidth'(BeatClks);

  always_ff @(posedge clk_i) begin
    beat_q <= beat;
    if (beat != beat_q) silent_q <= '0;
    else if (silent_q != SilentWidth'(BeatClks)) silent_q <= silent_q + SilentWidth'(1);

    // Its bits may come a clock apart.
    tripped_q <= fault != '0;
    if (fault != '0) fault_o <= fault;
    if (fault != '0 && !tripped_q) trip_count_o <= vrscan_pkg::counted(trip_count_o, CountWidth);

    if (rst_i) begin
      beat_q       <= 1'b0;
      silent_q     <= SilentWidth'(BeatClks);
      tripped_q    <= 1'b0;
      fault_o      <= '0;
      trip_count_o <= '0;
    end
  end

endmodule

`default_nettype wire
