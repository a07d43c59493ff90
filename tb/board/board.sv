// board: vrscan with all that hangs on its pins: mirror, sensor, lens motor, a host's USB adapter.
//
//   ClockHz .. Polygon  of vrscan; the others are those of mems_mirror and the index diode, and from
//                       Facets on those of polygon_mirror: with 0 facets there is none
//   +swinging=1         the mirror starts as +angle= and +velocity= say, rad and rad/s, with the
//                       first pulse of the drive; else it starts at rest.  A polygon's velocity is
//                       a share of its speed
//   +rest=              where a polygon comes to rest, rad from the mark; 0 is on it
//   +seed=              of the index's jitter
//   +lag=, +delay=      of line_sensor
//
// laser_guard has a clock of its own, a quarter of the core's.

`default_nettype none

module board #(
  parameter int unsigned ClockHz         = 100_000_000,
  parameter int unsigned IndexOversample = 4,
  parameter int unsigned LineLength      = 2048,
  parameter int unsigned PixelWidth      = 12,
  parameter int unsigned BoardId         = 255,
  parameter bit          Polygon         = 1'b0,
  parameter real         NaturalHz       = 248.5,
  parameter real         Quality         = 200.0,
  parameter real         Torque          = 8.52e4,
  parameter real         CombRad         = 0.14870205226991687,
  parameter real         Bias            = 2.0e-7,
  parameter real         MarkRad         = 0.29670597283903605,
  parameter real         DiodeRad        = 0.017453292519943295,
  parameter real         BeamRad         = 8.7266462599716477e-3,
  parameter real         AmbientMw       = 0.0,
  parameter real         ThresholdMw     = 0.05,
  parameter real         ThresholdShare  = 0.5,
  parameter real         HoldS           = 0.5,
  parameter real         MwPerLevel      = 7.6295109483482108e-4,  // of power_o and startup_o
  parameter real         NoiseRad        = 0.0,
  parameter real         JitterS         = 1.0e-9,
  parameter int unsigned FocusAddress    = 42,
  parameter int unsigned FocusM3         = 0,  // 1: the motor is an M3 smart stage
  parameter int unsigned FocusTravel     = 6000,
  parameter int unsigned FocusStepClks   = 5000,  // a step of the motor
  parameter int unsigned Facets          = 0,
  parameter real         FacetHz         = 240.0,
  parameter real         SpinUpS         = 0.5,
  parameter real         SpeedShare      = 1.0e-5,
  parameter real         HuntingHz       = 1.0,
  parameter real         ErrorRad        = 1.0e-4
) (
  input wire logic clk_i,
  input wire logic rst_i
);

  localparam int unsigned StepClks = ClockHz >= 1_500_000 ? (ClockHz + 500_000) / 1_000_000 : 1;

  // ---- what it is started with ----
  logic [31:0] seed, lag, delay_clks;
  real         start_angle, start_velocity, rest;
  bit          swinging;
  initial begin
    seed           = 32'd1;
    lag            = '0;
    delay_clks     = '0;
    start_angle    = 0.0;
    start_velocity = 0.0;
    rest           = 0.0;
    swinging       = 1'b0;
    void'($value$plusargs("swinging=%d", swinging));
    void'($value$plusargs("seed=%d", seed));
    void'($value$plusargs("lag=%d", lag));
    void'($value$plusargs("delay=%d", delay_clks));
    void'($value$plusargs("rest=%f", rest));
    void'($value$plusargs("angle=%f", start_angle));
    void'($value$plusargs("velocity=%f", start_velocity));
  end

  import "DPI-C" function byte unsigned mirror_stalls();
  import "DPI-C" function void light_is(
    input byte unsigned edge_of_index, input int pulse_power, input int startup
  );

  // ---- the guard's clock ----
  logic       guard_clk_q;
  logic       quarter_q;
  always_ff @(posedge clk_i) begin
    quarter_q <= !quarter_q;
    if (quarter_q) guard_clk_q <= !guard_clk_q;
  end

  // ---- vrscan ----
  logic                              to_board, to_host;
  logic [       IndexOversample-1:0] comparator, gate;
  logic                              exposure, to_drive, to_pulse, to_index_light;
  logic                              enable, heartbeat;
  logic                              drive, pulse, index_light, drive_lives;
  logic                              guard_ok, guard_beat, startup_pin;
  logic [                       4:0] guard_fault;
  logic [vrscan_pkg::LevelWidth-1:0] to_level, level;
  logic [vrscan_pkg::PowerWidth-1:0] power, startup;
  logic                              line_start, line_end, pixel_valid;
  logic [            PixelWidth-1:0] pixel;
  logic                              scl, sda, scl_low, sda_low, motor_scl_low, motor_sda_low;
  assign scl = !(scl_low || motor_scl_low);
  assign sda = !(sda_low || motor_sda_low);
  vrscan #(
    .ClockHz(ClockHz), .LineLength(LineLength), .PixelWidth(PixelWidth),
    .IndexOversample(IndexOversample), .BoardId(BoardId), .Polygon(Polygon)
  ) u_vrscan (
    .clk_i, .rst_i,
    .line_start_i          (line_start),
    .line_end_i            (line_end),
    .pixel_valid_i         (pixel_valid),
    .pixel_i               (pixel),
    .pixel_overflow_count_i(16'd0),
    .line_start_o          (),
    .exposure_o            (exposure),
    .comparator_i          (comparator),
    .gate_i                (gate),
    .drive_o               (to_drive),
    .level_o               (to_level),
    .level_pin_o           (),
    .pulse_o               (to_pulse),
    .power_o               (power),
    .power_pin_o           (),
    .index_light_o         (to_index_light),
    .startup_o             (startup),
    .startup_pin_o         (startup_pin),
    .laser_enable_o        (enable),
    .heartbeat_o           (heartbeat),
    .guard_ok_i            (guard_ok),
    .guard_beat_i          (guard_beat),
    .guard_fault_i         (guard_fault),
    .focus_scl_i           (scl),
    .focus_sda_i           (sda),
    .focus_scl_low_o       (scl_low),
    .focus_sda_low_o       (sda_low),
    .rx_i                  (to_board),
    .tx_o                  (to_host),
    .host_valid_i          (1'b0),
    .host_access_i         ('0),
    .host_address_i        ('0),
    .host_data_i           ('0),
    .host_done_o           (),
    .host_status_o         (),
    .host_data_o           (),
    .record_valid_o        (),
    .record_index_o        (),
    .record_o              (),
    .readout_start_o       (),
    .readout_end_o         (),
    .readout_valid_o       (),
    .readout_pixel_o       (),
    .readout_line_o        (),
    .axi_i                 ('0),
    .mirror_state_o        (),
    .measured_o            (),
    .line_o                (),
    .centre_o              (),
    .centre_half_o         ()
  );

  // Of the mirror's level, which is a word here, the pin says whether it gets through.
  laser_guard u_laser_guard (
    .clk_i        (guard_clk_q),
    .rst_i,
    .heartbeat_i  (heartbeat),
    .enable_i     (enable),
    .pulse_i      (to_pulse),
    .index_light_i(to_index_light),
    .startup_pin_i(startup_pin),
    .drive_i      (to_drive),
    .level_pin_i  (1'b1),
    .pulse_o      (pulse),
    .index_light_o(index_light),
    .startup_pin_o(),
    .drive_o      (drive),
    .level_pin_o  (drive_lives),
    .beat_o       (guard_beat),
    .ok_o         (guard_ok),
    .fault_o      (guard_fault)
  );
  assign level = drive_lives ? to_level : '0;

  serial_port u_serial_port (.clk_i, .rst_i, .rx_i(to_host), .tx_o(to_board));

  // ---- mirror ----
  logic [vrscan_pkg::PowerWidth-1:0] pulse_light, startup_light;  // of each channel
  assign pulse_light   = pulse ? power : '0;
  assign startup_light = index_light ? startup : '0;
  logic driven_q;
  logic stall_q;
  real  angle;
  logic pulse_q;
  mirror_world #(
    .ClockHz(ClockHz), .StepClks(StepClks), .IndexOversample(IndexOversample),
    .NaturalHz(NaturalHz), .Quality(Quality), .Torque(Torque), .CombRad(CombRad), .Bias(Bias),
    .Facets(Facets), .FacetHz(FacetHz), .SpinUpS(SpinUpS), .SpeedShare(SpeedShare),
    .HuntingHz(HuntingHz), .ErrorRad(ErrorRad)
  ) u_mirror_world (
    .clk_i,
    .rst_i              (rst_i || (swinging && !driven_q && !drive)),
    .drive_i            (drive),
    .level_i            (level),
    .centre_i           (pulse != pulse_q),
    .half_i             (1'b0),
    .comparator_o       (comparator),
    .gate_o             (gate),
    .angle_true_o       (angle),
    .on_diode_o         (),
    .startup_mw_i       (MwPerLevel * real'(startup_light)),
    .pulse_mw_i         (MwPerLevel * real'(pulse_light)),
    .drop_i             (1'b0),
    .shock_i            (1'b0),
    .stall_i            (stall_q),
    .rest_rad_i         (MarkRad + rest),
    .seed_i             (seed),
    .shock_rad_per_s_i  (0.0),
    .natural_offset_hz_i(0.0),
    .damping_factor_i   (1.0),
    .start_angle_i      (start_angle),
    .start_velocity_i   (start_velocity),
    .mark_rad_i         (MarkRad),
    .width_rad_i        (DiodeRad),
    .beam_rad_i         (BeamRad),
    .ambient_mw_i       (AmbientMw),
    .threshold_mw_i     (ThresholdMw),
    .threshold_share_i  (ThresholdShare),
    .hold_s_i           (HoldS),
    .noise_rad_i        (NoiseRad),
    .jitter_s_i         (JitterS)
  );

  // The angle at the pulse's centre is the mean of those at its edges, to 0.1 urad.
  logic begun_q, ended_q;
  real  begin_angle_q, angle_q;
  always_ff @(posedge clk_i) begin
    driven_q <= (driven_q || drive) && !rst_i;
    pulse_q  <= pulse && !rst_i;
    begun_q  <= pulse && !pulse_q;
    ended_q  <= !pulse && pulse_q;
    if (begun_q) begin_angle_q <= angle;
    if (begun_q) angle_q <= angle;
    if (ended_q) angle_q <= 0.5 * (begin_angle_q + angle);
  end

  // ---- the light, and the edges of the index: another level within an open gate and one light ----
  logic [         IndexOversample-1:0] comparator_q, gate_q;
  logic                                index_edge;
  logic [2*vrscan_pkg::PowerWidth-1:0] light, light_q, light_q2;  // the comparator is a clock late
  assign light      = {pulse_light, startup_light};
  assign index_edge = (&gate) && (&gate_q) && comparator != comparator_q
      && light != '0 && light == light_q && light == light_q2;
  always_ff @(posedge clk_i) begin
    stall_q      <= mirror_stalls() != 8'd0;
    comparator_q <= comparator;
    gate_q       <= gate;
    light_q      <= light;
    light_q2     <= light_q;
    if (!rst_i && (index_edge || pulse || index_light)) begin
      light_is({7'd0, index_edge}, 32'(pulse_light), 32'(startup_light));
    end
  end

  // ---- sensor ----
  line_sensor #(.LineLength(LineLength), .PixelWidth(PixelWidth)) u_line_sensor (
    .clk_i, .rst_i,
    .exposure_i   (exposure),
    .laser_i      (pulse),
    .power_i      (power),
    .angle_i      (angle_q),
    .lag_i        (lag[1:0]),
    .delay_clks_i (delay_clks),
    .line_start_o (line_start),
    .line_end_o   (line_end),
    .pixel_valid_o(pixel_valid),
    .pixel_o      (pixel)
  );

  // ---- lens ----
  i2c_device #(.StepClks(FocusStepClks), .Travel(FocusTravel)) u_i2c_device (
    .clk_i, .rst_i,
    .scl_i         (scl),
    .sda_i         (sda),
    .scl_low_o     (motor_scl_low),
    .sda_low_o     (motor_sda_low),
    .m3_i          (FocusM3 != 0),
    .offset_i      (32'sd0),
    .status_i      (24'd0),
    .spoil_i       (5'd31),
    .spoilt_i      (8'd0),
    .address_i     (7'(FocusAddress)),
    .nack_address_i(1'b0),
    .nack_byte_i   (4'd15),
    .stretch_clks_i(16'd0),
    .stretch_bits_i(1'b0),
    .hold_scl_i    (1'b0),
    .hold_sda_i    (1'b0),
    .stall_i       (1'b0),
    .push_i        (16'sd0),
    .noise_i       (8'sd0),
    .position_o    ()
  );

endmodule

`default_nettype wire
