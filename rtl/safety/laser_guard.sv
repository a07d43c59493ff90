// laser_guard: the second line of defence, in a clock of its own: no light without a heartbeat.
//
// Everything that limits the light stands in the core's clock.  This module does not: it takes the
// board's raw oscillator, watches a signal that the core toggles, and lets the light pass only while
// that goes on.  clk_i must not come from the core's clock or its PLL.
//
//   pulse_o, index_light_o  the requests and a registered permission: a gate's delay, no jitter.
//                 Only where a permission ends or begins may a pulse be cut short, at any moment
//   heartbeat_i   any change is a beat; synchronised here, so each level lasts 2 clocks at least.
//                 GuardClks clocks without a beat are a trip
//   pulse_i       synchronised too.  High at PulseClks samples on end is a trip
//   Restart       after a reset or a trip the light stays off until RestartBeats beats have come,
//                 the one that ends a silence not counted, with no trip between them, and pulse_i
//                 is low
//   trips_o       how often each came since the reset: heartbeat, pulse; stop at their largest value
//   fault_o       what tripped last: bit 0 the heartbeat, bit 1 a pulse; 0 after a reset
//   ok_o          the permission; whoever reads it in another clock synchronises it
//   Latency  from the clock that samples it: heartbeat_i's last change to dark GuardClks + 4
//            clocks, a pulse's rise to dark PulseClks + 3; one more from the change itself
//   Model    vrscan.clocked.laser_guard, bit-exact

`default_nettype none

module laser_guard #(
  parameter int unsigned GuardClks    = 16,  // 0.64 us at 25 MHz: two beats of 2**5 clocks, 100 MHz
  parameter int unsigned PulseClks    = 300,  // 12 us at 25 MHz: beyond laser_control's own limit
  parameter int unsigned RestartBeats = 16,
  parameter int unsigned CountWidth   = 16
) (
  input  wire logic                  clk_i,
  input  wire logic                  rst_i,

  input  wire logic                  heartbeat_i,
  input  wire logic                  pulse_i,
  input  wire logic                  index_light_i,

  output      logic                  pulse_o,
  output      logic                  index_light_o,
  output      logic                  ok_o,

  output      logic [           1:0] fault_o,
  output      logic [CountWidth-1:0] heartbeat_trips_o,
  output      logic [CountWidth-1:0] pulse_trips_o
);

  if (GuardClks < 4 || PulseClks < 1 || RestartBeats < 1) begin : gen_bad_clks
    $error("laser_guard: GuardClks must be at least 4, PulseClks and RestartBeats at least 1");
  end

  localparam int unsigned SilentWidth = $clog2(GuardClks + 1);
  localparam int unsigned HighWidth = $clog2(PulseClks + 1);
  localparam int unsigned BeatsWidth = $clog2(RestartBeats + 1);

  logic                   heartbeat, heartbeat_q, pulse;
  logic [SilentWidth-1:0] silent_q;
  logic [  HighWidth-1:0] high_q;
  logic [ BeatsWidth-1:0] beats_q;
  logic                   beat, silent, long, ready;
  synchronizer #(.Width(2)) u_core (
    .clk_i, .rst_i, .d_i({heartbeat_i, pulse_i}), .q_o({heartbeat, pulse})
  );
  assign beat   = heartbeat != heartbeat_q;
  assign silent = silent_q == SilentWidth'(GuardClks);
  assign long   = high_q == HighWidth'(PulseClks);
  assign ready  = beats_q == BeatsWidth'(RestartBeats);

  assign pulse_o       = pulse_i && ok_o;
  assign index_light_o = index_light_i && ok_o;

  always_ff @(posedge clk_i) begin
    heartbeat_q <= heartbeat;

    if (beat) silent_q <= '0;
    else if (!silent) silent_q <= silent_q + SilentWidth'(1);
    if (!pulse) high_q <= '0;
    else if (!long) high_q <= high_q + HighWidth'(1);

    if (silent || long) beats_q <= '0;
    else if (beat && !ready) beats_q <= beats_q + BeatsWidth'(1);
    ok_o <= !silent && !long && ready && (ok_o || !pulse);

    if (ok_o && silent) begin
      fault_o[0] <= 1'b1;
      fault_o[1] <= long;
      if (heartbeat_trips_o != '1) heartbeat_trips_o <= heartbeat_trips_o + CountWidth'(1);
    end
    if (ok_o && long) begin
      fault_o[0] <= silent;
      fault_o[1] <= 1'b1;
      if (pulse_trips_o != '1) pulse_trips_o <= pulse_trips_o + CountWidth'(1);
    end

    if (rst_i) begin
      heartbeat_q       <= 1'b0;
      silent_q          <= SilentWidth'(GuardClks);
      high_q            <= '0;
      beats_q           <= '0;
      ok_o              <= 1'b0;
      fault_o           <= '0;
      heartbeat_trips_o <= '0;
      pulse_trips_o     <= '0;
    end
  end

endmodule

`default_nettype wire
