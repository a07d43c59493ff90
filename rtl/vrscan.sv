// vrscan: the instrument, from the pins of sensor, mirror, laser and lens to a serial line.
//
// Wiring, but for the choice between sensor and test lines.  Device-independent: clocks, pins that
// sample twice a clock, and laser_guard, which needs a clock of its own, are the board's.
//
//   line_start_i ..  the sensor's readout, in clk_i; pixel_overflow_count_i of the FIFO that brings
//                 it here, 0 where there is none
//   exposure_o    the sensor is to expose; its readout begins after that.  line_start_o is the
//                 start of the line's time
//   comparator_i, gate_i  of the index, IndexOversample samples a clock, bit 0 the oldest
//   drive_o, level_o, level_pin_o  to the mirror
//   pulse_o .. heartbeat_o, guard_ok_i  laser_control's
//   focus_*_i     asynchronous; *_low_o pulls the line low
//   rx_i, tx_o    8N1, Baud until the host writes uart_step; docs/link.md
//   line_o, centre_o, centre_half_o  the line that goes on, and when the middle of its pulse is
//   Test lines    from test_start on until the run has ended they take the sensor's place; a line of
//                 the sensor that is cut off by that counts as unfinished.  Their points carry
//                 test_angle and test_power, and nothing of mirror and laser
//   Model         each module's own.  tb/link/test_link_board.py lets this top compute on the virtual board,
//                 and compares every field of every point with vrscan.fixed.vrscan_chain

`default_nettype none

module vrscan #(
  parameter int unsigned ClockHz         = 100_000_000,
  parameter int unsigned Baud            = 3_000_000,
  parameter int unsigned Lanes           = 1,
  parameter int unsigned LineLength      = 2048,
  parameter int unsigned PixelWidth      = 12,
  parameter int unsigned MaxWindow       = 255,
  parameter int unsigned IndexOversample = 4,
  parameter int unsigned BoardId         = 0
) (
  input  wire logic                                         clk_i,
  input  wire logic                                         rst_i,

  // Sensor.
  input  wire logic                                         line_start_i,
  input  wire logic                                         line_end_i,
  input  wire logic                                         pixel_valid_i,
  input  wire logic [                 Lanes*PixelWidth-1:0] pixel_i,
  input  wire logic [                                 15:0] pixel_overflow_count_i,
  output      logic                                         line_start_o,
  output      logic                                         exposure_o,

  // Mirror.
  input  wire logic [                  IndexOversample-1:0] comparator_i,
  input  wire logic [                  IndexOversample-1:0] gate_i,
  output      logic                                         drive_o,
  output      logic [           vrscan_pkg::LevelWidth-1:0] level_o,
  output      logic                                         level_pin_o,

  // Laser.
  output      logic                                         pulse_o,
  output      logic [           vrscan_pkg::PowerWidth-1:0] power_o,
  output      logic                                         power_pin_o,
  output      logic                                         index_light_o,
  output      logic [           vrscan_pkg::PowerWidth-1:0] startup_o,
  output      logic                                         startup_pin_o,
  output      logic                                         heartbeat_o,
  input  wire logic                                         guard_ok_i,

  // Lens.
  input  wire logic                                         focus_scl_i,
  input  wire logic                                         focus_sda_i,
  output      logic                                         focus_scl_low_o,
  output      logic                                         focus_sda_low_o,

  // Host.
  input  wire logic                                         rx_i,
  output      logic                                         tx_o,

  // For lamps and oscilloscopes.
  output      logic [     vrscan_pkg::MirrorStateWidth-1:0] mirror_state_o,
  output      logic                                         measured_o,
  output      logic [      vrscan_pkg::LineNumberWidth-1:0] line_o,
  output      logic                                         centre_o,
  output      logic                                         centre_half_o
);

  localparam int unsigned IndexWidth    = $clog2(LineLength);
  localparam int unsigned WidthWidth    = $clog2(LineLength + 1);
  localparam int unsigned PositionWidth = IndexWidth + 1 + vrscan_pkg::PositionFraction;
  localparam int unsigned CentreWidth   = IndexWidth + 1 + vrscan_pkg::OffsetFraction;
  localparam int unsigned AlignedWidth  = vrscan_pkg::AlignedWidth;

  // ---- a reset for each room, a clock after rst_i; register_bank makes its own ----
  logic rst_own;
  logic rst_uart_link;
  logic rst_mirror_loop;
  logic rst_laser_control;
  logic rst_test_line;
  logic rst_line_tag;
  logic rst_vrscan_chain;
  logic rst_point_record;
  logic rst_point_packer;
  logic rst_line_capture;
  logic rst_focus_control;
  local_register u_reset_own (.clk_i, .d_i(rst_i), .q_o(rst_own));
  local_register u_reset_uart_link (.clk_i, .d_i(rst_i), .q_o(rst_uart_link));
  local_register u_reset_mirror_loop (.clk_i, .d_i(rst_i), .q_o(rst_mirror_loop));
  local_register u_reset_laser_control (.clk_i, .d_i(rst_i), .q_o(rst_laser_control));
  local_register u_reset_test_line (.clk_i, .d_i(rst_i), .q_o(rst_test_line));
  local_register u_reset_line_tag (.clk_i, .d_i(rst_i), .q_o(rst_line_tag));
  local_register u_reset_vrscan_chain (.clk_i, .d_i(rst_i), .q_o(rst_vrscan_chain));
  local_register u_reset_point_record (.clk_i, .d_i(rst_i), .q_o(rst_point_record));
  local_register u_reset_point_packer (.clk_i, .d_i(rst_i), .q_o(rst_point_packer));
  local_register u_reset_line_capture (.clk_i, .d_i(rst_i), .q_o(rst_line_capture));
  local_register u_reset_focus_control (.clk_i, .d_i(rst_i), .q_o(rst_focus_control));

  // ---- host and registers ----
  localparam int unsigned Streams = 2;
  logic [  Streams-1:0] packet_valid, packet_ready, packet_last;
  logic [8*Streams-1:0] packet_data;
  logic                                stream_start, stream_stop, stream_format;
  logic [                         7:0] stream_step;
  logic                                capture_start;
  logic [link_pkg::CaptureModeWidth-1:0] capture_mode;
  logic [                        31:0] capture_argument;
  logic                                alive;
  logic                                bus_valid, bus_done;
  logic [   link_pkg::AccessWidth-1:0] bus_access;
  logic [  link_pkg::AddressWidth-1:0] bus_address;
  logic [   link_pkg::StatusWidth-1:0] bus_status;
  logic [                        31:0] bus_written, bus_read;
  register_pkg::settings_t             settings;
  register_pkg::status_t               status;
  uart_link #(
    .ClockHz(ClockHz), .Baud(Baud), .Streams(Streams)
  ) u_uart_link (
    .clk_i, .rst_i(rst_uart_link),
    .rx_i, .tx_o,
    .packet_valid_i    (packet_valid),
    .packet_ready_o    (packet_ready),
    .packet_data_i     (packet_data),
    .packet_last_i     (packet_last),
    .bus_valid_o       (bus_valid),
    .bus_access_o      (bus_access),
    .bus_address_o     (bus_address),
    .bus_data_o        (bus_written),
    .bus_done_i        (bus_done),
    .bus_status_i      (bus_status),
    .bus_data_i        (bus_read),
    .stream_start_o    (stream_start),
    .stream_stop_o     (stream_stop),
    .stream_format_o   (stream_format),
    .stream_step_o     (stream_step),
    .capture_start_o   (capture_start),
    .capture_mode_o    (capture_mode),
    .capture_argument_o(capture_argument),
    .capture_busy_i    (status.capture_busy),
    .alive_o           (alive),
    .uart_step_i        (settings.uart_step),
    .uart_step_written_i(settings.uart_step_strobe),
    .uart_step_now_o    (status.uart_step_now),
    .uart_framing_o     (status.uart_framing),
    .uart_breaks_o      (status.uart_breaks),
    .uart_glitches_o    (status.uart_glitches),
    .uart_fallbacks_o   (status.uart_fallbacks),
    .frames_good_o      (status.frames_good),
    .frames_crc_o       (status.frames_crc),
    .frames_malformed_o (status.frames_malformed),
    .frames_too_long_o  (status.frames_too_long),
    .frames_too_short_o (status.frames_too_short),
    .frames_framing_o   (status.frames_framing),
    .commands_bad_o     (status.commands_bad),
    .commands_lost_o    (status.commands_lost)
  );

  register_bank u_register_bank (
    .clk_i, .rst_i,
    .bus_valid_i  (bus_valid),
    .bus_access_i (bus_access),
    .bus_address_i(bus_address),
    .bus_data_i   (bus_written),
    .bus_done_o   (bus_done),
    .bus_status_o (bus_status),
    .bus_data_o   (bus_read),
    .settings_o   (settings),
    .status_i     (status)
  );

  logic [47:0] uptime_q;
  always_ff @(posedge clk_i) begin
    uptime_q <= uptime_q + 48'd1;
    if (rst_own) uptime_q <= '0;
  end
  assign status.board_id             = 16'(BoardId);
  assign status.clock_hz             = ClockHz;
  assign status.line_length          = 16'(LineLength);
  assign status.pixel_width          = 8'(PixelWidth);
  assign status.max_window           = 8'(MaxWindow);
  assign status.lanes                = 8'(Lanes);
  assign status.index_oversample     = 8'(IndexOversample);
  assign status.uptime               = uptime_q;
  assign status.pixel_overflow_count = pixel_overflow_count_i;

  // ---- mirror ----
  logic                                          laser, angle_valid;
  logic        [vrscan_pkg::LineNumberWidth-1:0] angle_line;
  logic signed [     vrscan_pkg::AngleWidth-1:0] angle;
  logic        [vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags;
  logic        [vrscan_pkg::ConfidenceWidth-1:0] mirror_confidence;
  logic                                          measured_valid;
  logic        [ vrscan_pkg::AmplitudeWidth-1:0] measured;
  logic signed [     vrscan_pkg::ErrorWidth-1:0] error;
  mirror_loop #(
    .IndexOversample(IndexOversample)
  ) u_mirror_loop (
    .clk_i, .rst_i(rst_mirror_loop),
    .comparator_i, .gate_i,
    .drive_o, .level_o, .level_pin_o,
    .line_start_o, .exposure_o,
    .laser_o            (laser),
    .line_o, .centre_o, .centre_half_o,
    .angle_valid_o      (angle_valid),
    .angle_line_o       (angle_line),
    .angle_o            (angle),
    .mirror_flags_o     (mirror_flags),
    .confidence_o       (mirror_confidence),
    .amplitude_o        (),
    .enable_i           (settings.mirror_enable),
    .line_enable_i      (settings.line_enable),
    .table_write_i      (settings.table_write),
    .table_index_i      (settings.table_index),
    .table_amplitude_i  (settings.table_amplitude),
    .table_midpoint_i   (settings.table_midpoint),
    .sweep_word_i       (settings.sweep_word),
    .work_word_i        (settings.work_word),
    .sweep_rate_i       (settings.sweep_rate),
    .duty_i             (settings.duty),
    .sweep_level_i      (settings.sweep_level),
    .sweep_timeout_i    (settings.sweep_timeout),
    .settle_timeout_i   (settings.settle_timeout),
    .lost_timeout_i     (settings.lost_timeout),
    .glitch_clks_i      (settings.glitch_clks),
    .width_min_clks_i   (settings.width_min_clks),
    .width_max_clks_i   (settings.width_max_clks),
    .period_max_clks_i  (settings.period_max_clks),
    .phase_shift_i      (settings.phase_shift),
    .rate_shift_i       (settings.rate_shift),
    .amplitude_shift_i  (settings.amplitude_shift),
    .error_limit_i      (settings.error_limit),
    .amplitude_set_i    (settings.amplitude_set),
    .k_p_i              (settings.k_p),
    .k_i_i              (settings.k_i),
    .level_min_i        (settings.level_min),
    .level_max_i        (settings.level_max),
    .level_low_i        (settings.level_low),
    .level_high_i       (settings.level_high),
    .level_nominal_i    (settings.level_nominal),
    .trim_step_i        (settings.trim_step),
    .trim_gain_i        (settings.trim_gain),
    .trim_min_i         (settings.trim_min),
    .trim_max_i         (settings.trim_max),
    .trim_up_i          (settings.trim_up),
    .settle_limit_i     (settings.settle_limit),
    .shock_limit_i      (settings.shock_limit),
    .phase_limit_i      (settings.phase_limit),
    .settle_count_i     (settings.settle_count),
    .hold_count_i       (settings.hold_count),
    .confidence_gain_i  (settings.confidence_gain),
    .drive_phase_i      (settings.drive_phase),
    .motion_a_i         (settings.motion_a),
    .motion_phi_i       (settings.motion_phi),
    .motion_da_i        (settings.motion_da),
    .motion_dphi_i      (settings.motion_dphi),
    .ratio_i            (settings.ratio),
    .exposure_delay_clks_i(settings.exposure_delay_clks),
    .exposure_clks_i    (settings.exposure_clks),
    .pulse_delay_clks_i (settings.pulse_delay_clks),
    .pulse_clks_i       (settings.pulse_clks),
    .state_o            (mirror_state_o),
    .fault_o            (status.mirror_fault),
    .word_o             (status.mirror_word),
    .drive_phase_o      (status.mirror_drive_phase),
    .mirror_phase_o     (status.mirror_phase),
    .index_alive_o      (status.index_alive),
    .settled_o          (status.mirror_settled),
    .measured_valid_o   (measured_valid),
    .measured_o         (measured),
    .error_o            (error),
    .missing_count_o    (status.missing_count),
    .doubled_count_o    (status.doubled_count),
    .impossible_count_o (status.impossible_count),
    .glitch_count_o     (status.glitch_count),
    .overrun_count_o    (status.overrun_count)
  );
  assign status.mirror_state = mirror_state_o;
  assign status.mirror_level = level_o;
  logic        [vrscan_pkg::AmplitudeWidth-1:0] measured_q;
  logic signed [    vrscan_pkg::ErrorWidth-1:0] error_q;
  always_ff @(posedge clk_i) begin
    if (measured_valid) begin
      measured_q <= measured;
      error_q    <= error;
    end
    if (rst_own) begin
      measured_q <= '0;
      error_q    <= '0;
    end
  end
  assign status.mirror_measured = measured_q;
  assign status.mirror_error    = error_q;

  // ---- laser ----
  logic                                     point_valid, point_measured;
  logic [      vrscan_pkg::FlagWidth-1:0]   flags;
  logic [                 PixelWidth-1:0]   maximum;
  logic [     vrscan_pkg::CountWidth-1:0]   background;
  logic [     vrscan_pkg::PowerWidth-1:0]   power, power_line;
  logic                                     inward_line;

  // What goes through the chain with a line.
  typedef struct packed {
    logic                                   test;
    logic                                   inward;
    logic [vrscan_pkg::ConfidenceWidth-1:0] confidence;
    logic [      vrscan_pkg::TimeWidth-1:0] moment;
  } beside_t;
  beside_t line_beside, beside;

  laser_control #(
    .PulseCeilingClks   (ClockHz / 100_000),
    .BucketCeiling      ((ClockHz / 1_000_000) * 2_097_152),
    .WatchdogCeilingClks(ClockHz)
  ) u_laser_control (
    .clk_i, .rst_i(rst_laser_control),
    .laser_i           (laser),
    .line_start_i      (line_start_o),
    .centre_i          (centre_o),
    .state_i           (mirror_state_o),
    .index_alive_i     (status.index_alive),
    .phase_i           (status.mirror_phase[vrscan_pkg::TurnWidth-1-:16]),
    .alive_i           (alive),
    .guard_ok_i,
    .point_valid_i     (point_valid),
    .point_measured_i  (point_measured),
    .point_saturated_i (flags[vrscan_pkg::FlagSaturated]),
    .point_maximum_i   ({maximum, (AlignedWidth - PixelWidth)'(0)}),
    .point_background_i(background[vrscan_pkg::CountWidth-1-:AlignedWidth]),
    .point_power_i     (power),
    .point_inward_i    (beside.inward),
    .point_test_i      (beside.test),
    .pulse_o, .power_o, .power_pin_o, .index_light_o, .startup_o, .startup_pin_o, .heartbeat_o,
    .power_line_o      (power_line),
    .inward_line_o     (inward_line),
    .laser_enable_i        (settings.laser_enable),
    .laser_adapt_i         (settings.laser_adapt),
    .laser_shared_i        (settings.laser_shared),
    .laser_power_i         (settings.laser_power),
    .laser_power_min_i     (settings.laser_power_min),
    .laser_power_max_i     (settings.laser_power_max),
    .laser_startup_i       (settings.laser_startup),
    .laser_target_i        (settings.laser_target),
    .laser_cut_i           (settings.laser_cut),
    .laser_down_i          (settings.laser_down),
    .laser_up_i            (settings.laser_up),
    .laser_search_i        (settings.laser_search),
    .laser_index_begin_i   (settings.laser_index_begin),
    .laser_index_end_i     (settings.laser_index_end),
    .laser_limit_power_i   (settings.laser_limit_power),
    .laser_limit_startup_i (settings.laser_limit_startup),
    .laser_limit_pulse_clks_i(settings.laser_limit_pulse_clks),
    .laser_limit_drain_i   (settings.laser_limit_drain),
    .laser_limit_bucket_i  (settings.laser_limit_bucket),
    .laser_watchdog_clks_i (settings.laser_watchdog_clks),
    .laser_status_o        (status.laser_status),
    .laser_power_inward_o  (status.laser_power_inward),
    .laser_power_outward_o (status.laser_power_outward),
    .laser_cut_count_o     (status.laser_cut_count),
    .laser_duty_count_o    (status.laser_duty_count),
    .laser_watchdog_count_o(status.laser_watchdog_count)
  );

  // ---- lines: the sensor's or the test's, and what belongs to each ----
  logic                        test_running, test_start, test_end, test_valid;
  logic [Lanes*PixelWidth-1:0] test_pixel;
  test_line #(
    .Lanes(Lanes), .LineLength(LineLength), .PixelWidth(PixelWidth)
  ) u_test_line (
    .clk_i, .rst_i(rst_test_line),
    .line_start_o      (test_start),
    .line_end_o        (test_end),
    .pixel_valid_o     (test_valid),
    .pixel_o           (test_pixel),
    .test_position_i   (settings.test_position),
    .test_move_i       (settings.test_move),
    .test_step_i       (settings.test_step),
    .test_height_i     (settings.test_height),
    .test_pedestal_i   (settings.test_pedestal),
    .test_noise_i      (settings.test_noise),
    .test_seed_i       (settings.test_seed),
    .test_lines_i      (settings.test_lines),
    .test_period_clks_i(settings.test_period_clks),
    .test_start_i      (settings.test_start_strobe),
    .test_stop_i       (settings.test_stop_strobe),
    .test_running_o    (test_running)
  );
  assign status.test_running = test_running;

  logic signed [     vrscan_pkg::AngleWidth-1:0] tag_angle;
  logic        [     vrscan_pkg::PowerWidth-1:0] tag_power;
  logic        [vrscan_pkg::MirrorFlagWidth-1:0] tag_flags;
  logic        [vrscan_pkg::ConfidenceWidth-1:0] tag_confidence;
  logic                                          tag_inward;
  logic        [      vrscan_pkg::TimeWidth-1:0] tag_moment;
  line_tag u_line_tag (
    .clk_i, .rst_i(rst_line_tag),
    .exposure_i    (exposure_o),
    .line_i        (line_o),
    .centre_i      (centre_o),
    .power_i       (power_line),
    .inward_i      (inward_line),
    .angle_valid_i (angle_valid),
    .angle_line_i  (angle_line),
    .angle_i       (angle),
    .mirror_flags_i(mirror_flags),
    .confidence_i  (mirror_confidence),
    .line_start_i, .line_end_i,
    .angle_o       (tag_angle),
    .power_o       (tag_power),
    .mirror_flags_o(tag_flags),
    .confidence_o  (tag_confidence),
    .inward_o      (tag_inward),
    .time_o        (tag_moment),
    .untagged_count_o(status.untagged_count)
  );

  logic                                          line_start_q, line_end_q, pixel_valid_q;
  logic        [           Lanes*PixelWidth-1:0] pixel_q;
  logic signed [     vrscan_pkg::AngleWidth-1:0] angle_q;
  logic        [     vrscan_pkg::PowerWidth-1:0] power_q;
  logic        [vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_q;
  always_ff @(posedge clk_i) begin
    line_start_q   <= test_running ? test_start : line_start_i;
    line_end_q     <= test_running ? test_end : line_end_i;
    pixel_valid_q  <= test_running ? test_valid : pixel_valid_i;
    pixel_q        <= test_running ? test_pixel : pixel_i;
    angle_q        <= test_running ? settings.test_angle : tag_angle;
    power_q        <= test_running ? settings.test_power : tag_power;
    mirror_flags_q <= test_running ? '0 : tag_flags;
    line_beside    <= test_running ? {1'b1, (1 + vrscan_pkg::ConfidenceWidth
                                             + vrscan_pkg::TimeWidth)'(0)}
                                   : {1'b0, tag_inward, tag_confidence, tag_moment};
    if (rst_own) begin
      line_start_q  <= 1'b0;
      line_end_q    <= 1'b0;
      pixel_valid_q <= 1'b0;
    end
  end

  // Once more, beside the chain: what it begins with is not where the sensor's pins are.
  logic                                          line_start_q2, line_end_q2, pixel_valid_q2;
  logic        [           Lanes*PixelWidth-1:0] pixel_q2;
  logic signed [     vrscan_pkg::AngleWidth-1:0] angle_q2;
  logic        [     vrscan_pkg::PowerWidth-1:0] power_q2;
  logic        [vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_q2;
  beside_t                                       line_beside_q2;
  always_ff @(posedge clk_i) begin
    line_start_q2   <= line_start_q;
    line_end_q2     <= line_end_q;
    pixel_valid_q2  <= pixel_valid_q;
    pixel_q2        <= pixel_q;
    angle_q2        <= angle_q;
    power_q2        <= power_q;
    mirror_flags_q2 <= mirror_flags_q;
    line_beside_q2  <= line_beside;
    if (rst_own) begin
      line_start_q2  <= 1'b0;
      line_end_q2    <= 1'b0;
      pixel_valid_q2 <= 1'b0;
    end
  end

  // ---- from pixels to a point, which is always taken ----
  logic        [vrscan_pkg::LineNumberWidth-1:0] point_line;
  logic        [                 IndexWidth-1:0] left, right;
  logic        [                 WidthWidth-1:0] width;
  logic        [     vrscan_pkg::CountWidth-1:0] row_mean, noise;
  logic        [  vrscan_pkg::VarianceWidth-1:0] row_variance;
  logic        [       vrscan_pkg::SnrWidth-1:0] snr;
  logic signed [              PositionWidth-1:0] position;
  logic        [     vrscan_pkg::SigmaWidth-1:0] sigma, sigma_z;
  logic signed [     vrscan_pkg::AngleWidth-1:0] point_angle;
  logic signed [    vrscan_pkg::LengthWidth-1:0] x, z;
  logic        [vrscan_pkg::ConfidenceWidth-1:0] c_obj, c_sfm;
  vrscan_chain #(
    .Lanes(Lanes), .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow),
    .UserWidth($bits(line_beside))
  ) u_vrscan_chain (
    .clk_i, .rst_i(rst_vrscan_chain),
    .line_start_i  (line_start_q2),
    .line_end_i    (line_end_q2),
    .pixel_valid_i (pixel_valid_q2),
    .pixel_i       (pixel_q2),
    .angle_i       (angle_q2),
    .power_i       (power_q2),
    .mirror_flags_i(mirror_flags_q2),
    .user_i        (line_beside_q2),
    .valid_o       (point_valid),
    .ready_i       (1'b1),
    .line_o        (point_line),
    .flags_o       (flags),
    .measured_o    (point_measured),
    .left_o        (left),
    .right_o       (right),
    .width_o       (width),
    .maximum_o     (maximum),
    .row_mean_o    (row_mean),
    .row_variance_o(row_variance),
    .background_o  (background),
    .noise_o       (noise),
    .snr_o         (snr),
    .position_o    (position),
    .sigma_o       (sigma),
    .angle_o       (point_angle),
    .x_o           (x),
    .z_o           (z),
    .sigma_z_o     (sigma_z),
    .c_obj_o       (c_obj),
    .c_sfm_o       (c_sfm),
    .power_o       (power),
    .user_o        (beside),
    .period_n_i    (settings.period_n),
    .window_two_pass_i(settings.window_two_pass),
    .noise_row_i   (settings.noise_row),
    .k_noise_i     (settings.k_noise),
    .k_height_i    (settings.k_height),
    .snr_min_i     (settings.snr_min),
    .min_width_i   (settings.min_width),
    .max_width_i   (settings.max_width),
    .kappa_i       (settings.kappa),
    .c_obj_gain_i  (settings.c_obj_gain),
    .c_sfm_gain_i  (settings.c_sfm_gain),
    .centre_i      (CentreWidth'(settings.centre)),
    .k1_i          (settings.k1),
    .k2_i          (settings.k2),
    .even_i        (settings.even),
    .n0_i          (settings.n0),
    .n1_i          (settings.n1),
    .d0_i          (settings.d0),
    .d1_i          (settings.d1),
    .e0_i          (settings.e0),
    .e1_i          (settings.e1),
    .short_count_o     (status.short_count),
    .long_count_o      (status.long_count),
    .unfinished_count_o(status.unfinished_count),
    .early_count_o     (status.early_count),
    .dropped_count_o   (status.dropped_count)
  );
  assign measured_o = point_valid && point_measured;

  // ---- points to the host ----
  logic       record_valid;
  logic [5:0] record_index;
  logic [7:0] record;
  point_record #(
    .LineLength(LineLength), .PixelWidth(PixelWidth)
  ) u_point_record (
    .clk_i, .rst_i(rst_point_record),
    .valid_i       (point_valid),
    .line_i        (point_line),
    .flags_i       (flags),
    .measured_i    (point_measured),
    .left_i        (left),
    .right_i       (right),
    .width_i       (width),
    .maximum_i     (maximum),
    .row_mean_i    (row_mean),
    .row_variance_i(row_variance),
    .background_i  (background),
    .noise_i       (noise),
    .snr_i         (snr),
    .position_i    (position),
    .sigma_i       (sigma),
    .angle_i       (point_angle),
    .x_i           (x),
    .z_i           (z),
    .sigma_z_i     (sigma_z),
    .c_obj_i       (c_obj),
    .c_sfm_i       (c_sfm),
    .power_i       (power),
    .confidence_i  (beside.confidence),
    .inward_i      (beside.inward),
    .test_i        (beside.test),
    .time_i        (beside.moment),
    .record_valid_o(record_valid),
    .record_index_o(record_index),
    .record_o      (record)
  );

  point_packer u_point_packer (
    .clk_i, .rst_i(rst_point_packer),
    .record_valid_i       (record_valid),
    .record_index_i       (record_index),
    .record_i             (record),
    .valid_o              (packet_valid[0]),
    .ready_i              (packet_ready[0]),
    .data_o               (packet_data[7:0]),
    .last_o               (packet_last[0]),
    .stream_start_i       (stream_start),
    .stream_stop_i        (stream_stop),
    .stream_format_i      (stream_format),
    .stream_step_i        (stream_step),
    .points_batch_i       (settings.points_batch),
    .points_timeout_clks_i(settings.points_timeout_clks),
    .points_dropped_o     (status.points_dropped)
  );

  line_capture #(
    .LineLength(LineLength), .PixelWidth(PixelWidth)
  ) u_line_capture (
    .clk_i, .rst_i(rst_line_capture),
    .line_start_i      (line_start_q),
    .line_end_i        (line_end_q),
    .pixel_valid_i     (pixel_valid_q),
    .pixel_i           (pixel_q),
    .record_valid_i    (record_valid),
    .record_index_i    (record_index),
    .record_i          (record),
    .valid_o           (packet_valid[1]),
    .ready_i           (packet_ready[1]),
    .data_o            (packet_data[15:8]),
    .last_o            (packet_last[1]),
    .capture_start_i   (capture_start),
    .capture_mode_i    (capture_mode),
    .capture_argument_i(capture_argument),
    .capture_busy_o    (status.capture_busy)
  );

  // ---- lens ----
  focus_control u_focus_control (
    .clk_i, .rst_i(rst_focus_control),
    .valid_i   (point_valid),
    .measured_i(point_measured),
    .flags_i   (flags),
    .test_i    (beside.test),
    .z_i       (z),
    .focus_scl_i, .focus_sda_i, .focus_scl_low_o, .focus_sda_low_o,
    .focus_table_write_i      (settings.focus_table_write),
    .focus_table_index_i      (settings.focus_table_index),
    .focus_table_position_i   (settings.focus_table_position),
    .focus_mode_i             (settings.focus_mode),
    .focus_manual_i           (settings.focus_manual),
    .focus_average_shift_i    (settings.focus_average_shift),
    .focus_lapse_i            (settings.focus_lapse),
    .focus_z_begin_i          (settings.focus_z_begin),
    .focus_z_shift_i          (settings.focus_z_shift),
    .focus_hysteresis_i       (settings.focus_hysteresis),
    .focus_hold_i             (settings.focus_hold),
    .focus_address_i          (settings.focus_address),
    .focus_quarter_clks_i     (settings.focus_quarter_clks),
    .focus_stretch_clks_i     (settings.focus_stretch_clks),
    .focus_poll_clks_i        (settings.focus_poll_clks),
    .focus_tolerance_i        (settings.focus_tolerance),
    .focus_timeout_clks_i     (settings.focus_timeout_clks),
    .focus_retries_i          (settings.focus_retries),
    .focus_state_o            (status.focus_state),
    .focus_fault_o            (status.focus_fault),
    .focus_distance_o         (status.focus_distance),
    .focus_target_o           (status.focus_target),
    .focus_position_o         (status.focus_position),
    .focus_in_position_o      (status.focus_in_position),
    .focus_nack_count_o       (status.focus_nack_count),
    .focus_stretch_count_o    (status.focus_stretch_count),
    .focus_stuck_count_o      (status.focus_stuck_count),
    .focus_arbitration_count_o(status.focus_arbitration_count),
    .focus_timeout_count_o    (status.focus_timeout_count),
    .focus_recovery_count_o   (status.focus_recovery_count)
  );

  // The locks are the registers' own, scratch and events say nothing to anyone.
  logic unused;
  assign unused = &{1'b0, settings.scratch, settings.lock_calibration, settings.lock_mirror,
                    settings.lock_laser, settings.test_start, settings.test_stop};

endmodule

`default_nettype wire
