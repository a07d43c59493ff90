// polygon_mirror: a polygon that turns at a speed of its own, in real arithmetic.
//
//   FacetHz       mean number of facets a second; natural_offset_hz_i comes on top
//   SpinUpS       the speed approaches that one with this time constant, and 0 where level_i is 0
//   SpeedShare, HuntingHz  relative amplitude of the speed's hunting, and its frequency
//   FacetRad      optical angle of a facet: 720 degrees over Facets
//   ErrorRad      rms error of a facet's angle, drawn at reset: of the beam, and so of the diode's pulse
//   start_speed_i share of the speed that it has at reset
//   angle_o ..    as those of mems_mirror: at time n - since_clks_o, here always 0
//   stall_i       from its next passage of rest_rad_i on the beam rests there
//   Model         vrscan.scene.polygon
//
// It leaves out: the pyramid error, and the walk of the beam on the facet.

`default_nettype none

module polygon_mirror #(
  parameter int unsigned ClockHz = 125_000_000,
  parameter int unsigned Facets = 12,
  parameter real FacetHz = 240.0,
  parameter real SpinUpS = 0.5,
  parameter real SpeedShare = 1.0e-5,
  parameter real HuntingHz = 1.0,
  parameter real ErrorRad = 1.0e-4
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  input  wire logic [vrscan_pkg::LevelWidth-1:0] level_i,
  input  var real                                natural_offset_hz_i,
  input  var real                                start_speed_i,

  output      real                               angle_o,
  output      real                               velocity_o,

  input  wire logic                              stall_i,
  input  var real                                rest_rad_i,
  input  wire logic [31:0]                       seed_i
);

  localparam real TwoPi = 6.283185307179586;
  localparam real ClockS = 1.0 / real'(ClockHz);
  localparam real FacetRad = 2.0 * TwoPi / real'(Facets);

  // Marsaglia's xorshift64, then Box and Muller.
  function automatic void draw(inout logic [63:0] state, output real gaussian);
    real radius;
    logic [63:0] x;
    for (int unsigned k = 0; k < 2; k++) begin
      x = state ^ (state << 13);
      x = x ^ (x >> 7);
      state = x ^ (x << 17);
      if (k == 0) radius = $sqrt(-2.0 * $ln((real'(state[63:32]) + 0.5) / 4294967296.0));
    end
    gaussian = radius * $cos(TwoPi * real'(state[63:32]) / 4294967296.0);
  endfunction

  real         error_q [Facets];
  real         place_q, speed_q, time_q;  // of a facet; facets a clock; s
  int unsigned facet_q;
  logic        rests_q;
  logic [63:0] random_q;

  // verilog_lint: waive-start always-ff-non-blocking (locals of one clock, in the order of its draws)
  always_ff @(posedge clk_i) begin
    automatic logic [63:0] state;
    automatic real wanted, speed, place, angle, gaussian;
    automatic logic rests;
    automatic int unsigned facet;
    state  = random_q;
    facet  = facet_q;
    wanted = level_i == '0 ? 0.0 : (FacetHz + natural_offset_hz_i) * ClockS
        * (1.0 + SpeedShare * $cos(TwoPi * HuntingHz * time_q));
    // The hunting is that of the speed itself, and not slowed down by the spin-up.
    speed  = speed_q + (wanted - speed_q) * (ClockS / SpinUpS);
    place  = place_q + speed;
    if (place >= 1.0) begin
      place = place - 1.0;
      facet = facet + 1 == Facets ? 0 : facet + 1;
    end
    angle = FacetRad * (0.5 - place) + error_q[facet];
    rests = stall_i && (rests_q || (angle_o > rest_rad_i && angle <= rest_rad_i));
    if (rests) begin
      speed = 0.0;
      place = place_q;
      angle = angle_o;
    end
    angle_o    <= angle;
    velocity_o <= -FacetRad * speed / ClockS;
    place_q    <= place;
    speed_q    <= speed;
    facet_q    <= facet;
    rests_q    <= rests;
    time_q     <= time_q + ClockS;

    if (rst_i) begin
      state = {seed_i, 32'h9e3779b9};  // never zero
      for (int unsigned k = 0; k < Facets; k++) begin
        draw(state, gaussian);
        error_q[k] <= ErrorRad * gaussian;
      end
      place_q <= 0.0;
      speed_q <= start_speed_i * FacetHz * ClockS;
      facet_q <= 0;
      time_q  <= 0.0;
      rests_q <= 1'b0;
    end
    random_q <= state;
  end
  // verilog_lint: waive-stop always-ff-non-blocking

endmodule

`default_nettype wire
