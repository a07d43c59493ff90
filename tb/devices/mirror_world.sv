// mirror_world: what the mirror's loop is connected to: mirror, beam and photodiode.
//
// With Facets not 0 the mirror is a polygon, and its diode has one field.
//
//   drive_i, level_i    from the loop's pins
//   comparator_o, gate_o  to them
//   centre_i, half_i    in the clock of a laser pulse's centre, or half a clock before it
//   angle_true_o        of that moment, rad, from mems_mirror's cubic; one clock behind centre_i
//   on_diode_o          the beam is on the diode, lit or not; to a step of the mirror
//   stall_i             the beam rests where it is, as that of a mirror that is stuck; a polygon's
//                       turns on to rest_rad_i

`default_nettype none

module mirror_world #(
  parameter int unsigned ClockHz         = 125_000_000,
  parameter int unsigned StepClks        = 125,
  parameter int unsigned IndexOversample = 4,
  parameter real         NaturalHz       = 248.5,
  parameter real         Quality         = 200.0,
  parameter real         Torque          = 8.52e4,
  parameter real         CombRad         = 0.14870205226991687,
  parameter real         Bias            = 2.0e-7,
  parameter int unsigned Facets          = 0,  // and of polygon_mirror
  parameter real         FacetHz         = 240.0,
  parameter real         SpinUpS         = 0.5,
  parameter real         SpeedShare      = 1.0e-5,
  parameter real         HuntingHz       = 1.0,
  parameter real         ErrorRad        = 1.0e-4
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  input  wire logic                              drive_i,
  input  wire logic [vrscan_pkg::LevelWidth-1:0] level_i,
  input  wire logic                              centre_i,
  input  wire logic                              half_i,

  output      logic [       IndexOversample-1:0] comparator_o,
  output      logic [       IndexOversample-1:0] gate_o,
  output      real                               angle_true_o,
  output      logic                              on_diode_o,

  // What happens to it.
  input  var real                                startup_mw_i,
  input  var real                                pulse_mw_i,
  input  wire logic                              drop_i,
  input  wire logic                              shock_i,
  input  wire logic                              stall_i,
  input  var real                                rest_rad_i,
  input  wire logic [                      31:0] seed_i,
  input  var real                                shock_rad_per_s_i,
  input  var real                                natural_offset_hz_i,
  input  var real                                damping_factor_i,
  input  var real                                start_angle_i,
  input  var real                                start_velocity_i,
  input  var real                                mark_rad_i,
  input  var real                                width_rad_i,
  input  var real                                beam_rad_i,
  input  var real                                ambient_mw_i,
  input  var real                                threshold_mw_i,
  input  var real                                threshold_share_i,
  input  var real                                hold_s_i,
  input  var real                                noise_rad_i,
  input  var real                                jitter_s_i
);

  localparam int unsigned SinceWidth = $clog2(StepClks + 1);
  localparam real ClockS = 1.0 / real'(ClockHz);

  real                   angle, velocity, acceleration, jerk;
  logic [SinceWidth-1:0] since_clks;
  if (Facets != 0) begin : gen_polygon
    polygon_mirror #(
      .ClockHz(ClockHz), .Facets(Facets), .FacetHz(FacetHz), .SpinUpS(SpinUpS),
      .SpeedShare(SpeedShare), .HuntingHz(HuntingHz), .ErrorRad(ErrorRad)
    ) u_polygon_mirror (
      .clk_i, .rst_i, .level_i, .natural_offset_hz_i,
      .start_speed_i(start_velocity_i),
      .angle_o      (angle),
      .velocity_o   (velocity),
      .stall_i, .rest_rad_i, .seed_i
    );
    assign acceleration = 0.0;
    assign jerk         = 0.0;
    assign since_clks   = '0;
    logic unused;
    assign unused = ^{drive_i, shock_i};
  end else begin : gen_mems
    real swung, held_q, swung_velocity, swung_acceleration, swung_jerk;
    mems_mirror #(
      .ClockHz(ClockHz), .StepClks(StepClks),
      .NaturalHz(NaturalHz), .Quality(Quality), .Torque(Torque), .CombRad(CombRad), .Bias(Bias)
    ) u_mems_mirror (
      .clk_i, .rst_i,
      .drive_i, .level_i,
      .shock_i, .shock_rad_per_s_i, .natural_offset_hz_i, .damping_factor_i,
      .start_angle_i, .start_velocity_i,
      .angle_o       (swung),
      .velocity_o    (swung_velocity),
      .acceleration_o(swung_acceleration),
      .jerk_o        (swung_jerk),
      .since_clks_o  (since_clks)
    );

    assign angle        = stall_i ? held_q : swung;
    assign velocity     = stall_i ? 0.0 : swung_velocity;
    assign acceleration = stall_i ? 0.0 : swung_acceleration;
    assign jerk         = stall_i ? 0.0 : swung_jerk;
    always_ff @(posedge clk_i) if (!stall_i) held_q <= swung;
  end

  index_diode #(
    .ClockHz(ClockHz), .StepClks(StepClks), .SinceWidth(SinceWidth),
    .IndexOversample(IndexOversample), .Fields(Facets != 0 ? 1 : 2)
  ) u_index_diode (
    .clk_i, .rst_i,
    .angle_i       (angle),
    .velocity_i    (velocity),
    .acceleration_i(acceleration),
    .jerk_i        (jerk),
    .since_clks_i  (since_clks),
    .startup_mw_i, .pulse_mw_i, .drop_i,
    .comparator_o, .gate_o,
    .mark_rad_i, .width_rad_i, .beam_rad_i, .ambient_mw_i, .threshold_mw_i, .threshold_share_i,
    .hold_s_i, .noise_rad_i, .jitter_s_i, .seed_i
  );

  // verilog_lint: waive-start always-ff-non-blocking (a local of one clock)
  always_ff @(posedge clk_i) begin
    automatic real d, off;
    off = angle - mark_rad_i;
    on_diode_o <= (off < 0.0 ? -off : off) < width_rad_i;
    if (centre_i) begin
      d = (real'(since_clks) + (half_i ? 0.5 : 0.0)) * ClockS;
      angle_true_o <= angle + d * (velocity + d * (acceleration + d * jerk / 3.0) / 2.0);
    end
  end
  // verilog_lint: waive-stop always-ff-non-blocking

endmodule

`default_nettype wire
