// mirror_loop: the mirror, driven, indexed and held at its amplitude, and the angle of every line.
//
// Wiring only.  The drive's accumulator is the time base of all: the mirror is driven at it, its
// index tells phase and amplitude, the amplitude goes back to the drive's level and, slowly, to
// its frequency, lines follow its word, and a line's angle is that of the mirror's phase at the
// centre of its laser pulse.
//
//   comparator_i, gate_i  IndexOversample samples a clock, bit 0 the oldest
//   drive_o, level_o, level_pin_o  to the mirror: square wave, voltage, and the voltage on a pin
//   line_start_o, exposure_o, laser_o  to sensor and laser; line_o is the number of that line
//   angle_valid_o  angle_o, mirror_flags_o, confidence_o, amplitude_o and angle_line_o belong to the
//                  line whose centre_o was AngleLatency clocks before; the flags are those of now,
//                  vrscan_pkg::FlagNotRunning and the next two; an angle that saturates is unsettled
//   Latency  scan_angle's and 2 more clocks from centre_o to angle_valid_o; the centres of two lines
//            are to be at least as far apart, or the first one's angle does not come
//   Model    vrscan.clocked.mirror_loop, bit-exact

`default_nettype none

module mirror_loop #(
  parameter int unsigned IndexOversample = 4,
  parameter int unsigned CountWidth      = 16,
  localparam int unsigned MotionBits = vrscan_pkg::HarmonicCount * vrscan_pkg::MotionWidth,
  localparam int unsigned PhasesBits = vrscan_pkg::HarmonicCount * vrscan_pkg::PhaseWidth,
  localparam int unsigned SlopesBits = vrscan_pkg::HarmonicCount * vrscan_pkg::SlopeMotionWidth
) (
  input  wire logic                                             clk_i,
  input  wire logic                                             rst_i,

  // Pins.
  input  wire logic        [               IndexOversample-1:0] comparator_i,
  input  wire logic        [               IndexOversample-1:0] gate_i,
  output      logic                                             drive_o,
  output      logic        [        vrscan_pkg::LevelWidth-1:0] level_o,
  output      logic                                             level_pin_o,
  output      logic                                             line_start_o,
  output      logic                                             exposure_o,
  output      logic                                             laser_o,
  output      logic        [   vrscan_pkg::LineNumberWidth-1:0] line_o,

  // The angle of a line.
  output      logic                                             centre_o,
  output      logic                                             centre_half_o,
  output      logic                                             angle_valid_o,
  output      logic        [   vrscan_pkg::LineNumberWidth-1:0] angle_line_o,
  output      logic signed [        vrscan_pkg::AngleWidth-1:0] angle_o,
  output      logic        [                               2:0] mirror_flags_o,
  output      logic        [   vrscan_pkg::ConfidenceWidth-1:0] confidence_o,
  output      logic        [    vrscan_pkg::AmplitudeWidth-1:0] amplitude_o,

  // Control.
  input  wire logic                                             enable_i,
  input  wire logic                                             line_enable_i,

  // The table of mirror_phase.
  input  wire logic                                             table_write_i,
  input  wire logic        [vrscan_pkg::AmplitudeTableBits-1:0] table_index_i,
  input  wire logic        [    vrscan_pkg::AmplitudeWidth-1:0] table_amplitude_i,
  input  wire logic signed [     vrscan_pkg::MidpointWidth-1:0] table_midpoint_i,

  // Configuration of mirror_drive.
  input  wire logic        [         vrscan_pkg::WordWidth-1:0] sweep_word_i,
  input  wire logic        [         vrscan_pkg::WordWidth-1:0] work_word_i,
  input  wire logic        [                              31:0] sweep_rate_i,
  input  wire logic        [                              15:0] duty_i,
  input  wire logic        [        vrscan_pkg::LevelWidth-1:0] sweep_level_i,
  input  wire logic        [         vrscan_pkg::TimeWidth-1:0] sweep_timeout_i,
  input  wire logic        [         vrscan_pkg::TimeWidth-1:0] settle_timeout_i,
  input  wire logic        [         vrscan_pkg::TimeWidth-1:0] lost_timeout_i,

  // Of index_capture.
  input  wire logic        [                               7:0] glitch_clks_i,
  input  wire logic        [         vrscan_pkg::TimeWidth-1:0] width_min_clks_i,
  input  wire logic        [         vrscan_pkg::TimeWidth-1:0] width_max_clks_i,
  input  wire logic        [         vrscan_pkg::TimeWidth-1:0] period_max_clks_i,

  // Of mirror_phase.
  input  wire logic        [                               3:0] phase_shift_i,
  input  wire logic        [                               5:0] rate_shift_i,
  input  wire logic        [                               3:0] amplitude_shift_i,
  input  wire logic        [        vrscan_pkg::ErrorWidth-1:0] error_limit_i,

  // Of amplitude_control.
  input  wire logic        [    vrscan_pkg::AmplitudeWidth-1:0] amplitude_set_i,
  input  wire logic        [  vrscan_pkg::ControlGainWidth-1:0] k_p_i,
  input  wire logic        [  vrscan_pkg::ControlGainWidth-1:0] k_i_i,
  input  wire logic        [        vrscan_pkg::LevelWidth-1:0] level_min_i,
  input  wire logic        [        vrscan_pkg::LevelWidth-1:0] level_max_i,
  input  wire logic        [        vrscan_pkg::LevelWidth-1:0] level_low_i,
  input  wire logic        [        vrscan_pkg::LevelWidth-1:0] level_high_i,
  input  wire logic        [        vrscan_pkg::LevelWidth-1:0] level_nominal_i,
  input  wire logic        [     vrscan_pkg::TrimStepWidth-1:0] trim_step_i,
  input  wire logic        [  vrscan_pkg::ControlGainWidth-1:0] trim_gain_i,
  input  wire logic signed [         vrscan_pkg::TrimWidth-1:0] trim_min_i,
  input  wire logic signed [         vrscan_pkg::TrimWidth-1:0] trim_max_i,
  input  wire logic                                             trim_up_i,
  input  wire logic        [    vrscan_pkg::AmplitudeWidth-1:0] settle_limit_i,
  input  wire logic        [    vrscan_pkg::AmplitudeWidth-1:0] shock_limit_i,
  input  wire logic        [        vrscan_pkg::ErrorWidth-1:0] phase_limit_i,
  input  wire logic        [                               7:0] settle_count_i,
  input  wire logic        [                               7:0] hold_count_i,
  input  wire logic        [         vrscan_pkg::GainWidth-1:0] confidence_gain_i,

  // Of motion_map.
  input  wire logic        [        vrscan_pkg::PhaseWidth-1:0] drive_phase_i,
  input  wire logic        [                    MotionBits-1:0] motion_a_i,
  input  wire logic        [                    PhasesBits-1:0] motion_phi_i,
  input  wire logic        [                    SlopesBits-1:0] motion_da_i,
  input  wire logic        [                    SlopesBits-1:0] motion_dphi_i,

  // Of line_trigger.
  input  wire logic        [        vrscan_pkg::RatioWidth-1:0] ratio_i,
  input  wire logic        [     vrscan_pkg::LineClksWidth-1:0] exposure_delay_clks_i,
  input  wire logic        [     vrscan_pkg::LineClksWidth-1:0] exposure_clks_i,
  input  wire logic        [     vrscan_pkg::LineClksWidth-1:0] pulse_delay_clks_i,
  input  wire logic        [     vrscan_pkg::LineClksWidth-1:0] pulse_clks_i,

  // Status: each counter stops at its largest value.
  output      logic        [  vrscan_pkg::MirrorStateWidth-1:0] state_o,
  output      logic        [        vrscan_pkg::FaultWidth-1:0] fault_o,
  output      logic        [         vrscan_pkg::WordWidth-1:0] word_o,
  output      logic        [         vrscan_pkg::TurnWidth-1:0] drive_phase_o,
  output      logic        [         vrscan_pkg::TurnWidth-1:0] mirror_phase_o,
  output      logic                                             index_alive_o,
  output      logic                                             settled_o,
  output      logic                                             measured_valid_o,
  output      logic        [    vrscan_pkg::AmplitudeWidth-1:0] measured_o,
  output      logic signed [        vrscan_pkg::ErrorWidth-1:0] error_o,
  output      logic        [                    CountWidth-1:0] missing_count_o,
  output      logic        [                    CountWidth-1:0] doubled_count_o,
  output      logic        [                    CountWidth-1:0] impossible_count_o,
  output      logic        [                    CountWidth-1:0] glitch_count_o,
  output      logic        [                    CountWidth-1:0] overrun_count_o
);

  // ---- index to phase and amplitude ----
  logic                              crossing, outward, missing, doubled, impossible, broken;
  logic [  vrscan_pkg::AgeWidth-1:0] age;
  assign broken = missing || doubled || impossible;
  index_capture #(
    .IndexOversample(IndexOversample),
    .CountWidth(CountWidth)
  ) u_index_capture (
    .clk_i, .rst_i,
    .comparator_i, .gate_i,
    .valid_o     (crossing),
    .outward_o   (outward),
    .time_o      (),
    .age_o       (age),
    .missing_o   (missing),
    .doubled_o   (doubled),
    .impossible_o(impossible),
    .alive_o     (index_alive_o),
    .glitch_clks_i, .width_min_clks_i, .width_max_clks_i, .period_max_clks_i,
    .missing_count_o, .doubled_count_o, .impossible_count_o, .glitch_count_o
  );

  logic                                  acquired;
  logic [     vrscan_pkg::WordWidth-1:0] increment;
  logic [vrscan_pkg::AmplitudeWidth-1:0] average;
  mirror_phase u_mirror_phase (
    .clk_i, .rst_i,
    .valid_i   (crossing),
    .outward_i (outward),
    .age_i     (age),
    .broken_i  (broken),
    .word_i    (word_o),
    .table_write_i, .table_index_i, .table_amplitude_i, .table_midpoint_i,
    .phase_shift_i, .rate_shift_i, .amplitude_shift_i, .error_limit_i,
    .phase_o       (mirror_phase_o),
    .increment_o   (increment),
    .valid_o       (measured_valid_o),
    .measured_o,
    .amplitude_o   (average),
    .error_o,
    .half_o        (),
    .out_of_table_o(),
    .tracking_o    (),
    .acquired_o    (acquired)
  );

  // ---- amplitude to the drive ----
  logic                                unsettled, index_fault;
  logic [  vrscan_pkg::LevelWidth-1:0] level;
  logic signed [vrscan_pkg::TrimWidth-1:0] trim;
  logic [vrscan_pkg::ConfidenceWidth-1:0] confidence;
  amplitude_control u_amplitude_control (
    .clk_i, .rst_i,
    .state_i   (state_o),
    .valid_i   (measured_valid_o),
    .measured_i(measured_o),
    .error_i   (error_o),
    .acquired_i(acquired),
    .broken_i  (broken),
    .level_o      (level),
    .trim_o       (trim),
    .settled_o,
    .unsettled_o  (unsettled),
    .index_fault_o(index_fault),
    .confidence_o (confidence),
    .error_amplitude_o(),
    .amplitude_set_i, .k_p_i, .k_i_i,
    .level_min_i, .level_max_i, .level_low_i, .level_high_i, .level_nominal_i,
    .trim_step_i, .trim_gain_i, .trim_min_i, .trim_max_i, .trim_up_i,
    .settle_limit_i, .shock_limit_i, .phase_limit_i, .settle_count_i, .hold_count_i,
    .confidence_gain_i
  );

  mirror_drive u_mirror_drive (
    .clk_i, .rst_i,
    .enable_i,
    .level_i      (level),
    .trim_i       (trim),
    .index_alive_i(index_alive_o),
    .settled_i    (settled_o),
    .state_o, .fault_o, .drive_o, .level_o, .level_pin_o,
    .phase_o      (drive_phase_o),
    .word_o,
    .sweep_word_i, .work_word_i, .sweep_rate_i, .duty_i, .sweep_level_i,
    .sweep_timeout_i, .settle_timeout_i, .lost_timeout_i
  );

  // ---- lines and their angle ----
  line_trigger #(
    .CountWidth(CountWidth)
  ) u_line_trigger (
    .clk_i, .rst_i,
    .enable_i(line_enable_i),
    .word_i  (word_o),
    .line_start_o,
    .line_o,
    .exposure_o, .laser_o, .centre_o, .centre_half_o,
    .overrun_o(),
    .overrun_count_o,
    .ratio_i, .exposure_delay_clks_i, .exposure_clks_i, .pulse_delay_clks_i, .pulse_clks_i
  );

  // The phase at the centre, to nearest: half a clock is half an increment.
  localparam int unsigned PhaseDrop = vrscan_pkg::TurnWidth - vrscan_pkg::PhaseWidth;
  logic                                   centre_q;
  logic [     vrscan_pkg::TurnWidth-1:0] centre_phase_q, advance;
  logic [    vrscan_pkg::PhaseWidth-1:0] phase;
  assign advance = centre_half_o ? vrscan_pkg::TurnWidth'(increment >> 1) : '0;
  assign phase = centre_phase_q[PhaseDrop+:vrscan_pkg::PhaseWidth]
                 + vrscan_pkg::PhaseWidth'(centre_phase_q[PhaseDrop-1]);
  always_ff @(posedge clk_i) begin
    centre_q       <= centre_o;
    centre_phase_q <= mirror_phase_o + advance;
    if (centre_o) angle_line_o <= line_o;
    if (rst_i) centre_q <= 1'b0;
  end

  logic                                     scanned, overflow, scanning_q;
  logic signed [vrscan_pkg::AngleWidth-1:0] angle;

  // The harmonics follow the drive's phase, between two angles.
  logic                             offset_valid_q;
  logic [vrscan_pkg::TurnWidth-1:0] offset_q;
  logic [           MotionBits-1:0] a;
  logic [           PhasesBits-1:0] phi;
  motion_map u_motion_map (
    .clk_i, .rst_i,
    .valid_i (offset_valid_q),
    .offset_i(offset_q),
    .busy_i  (centre_q || scanning_q),
    .a_o     (a),
    .phi_o   (phi),
    .offset_o(),
    .drive_phase_i, .motion_a_i, .motion_phi_i, .motion_da_i, .motion_dphi_i
  );
  always_ff @(posedge clk_i) begin
    offset_q       <= drive_phase_o - mirror_phase_o;
    offset_valid_q <= measured_valid_o;
    scanning_q     <= centre_q || (scanning_q && !scanned);
    if (rst_i) begin
      offset_valid_q <= 1'b0;
      scanning_q     <= 1'b0;
    end
  end

  scan_angle u_scan_angle (
    .clk_i, .rst_i,
    .valid_i    (centre_q),
    .phase_i    (phase),
    .amplitude_i(average),
    .valid_o    (scanned),
    .angle_o    (angle),
    .overflow_o (overflow),
    .a_i        (a),
    .phi_i      (phi)
  );

  always_ff @(posedge clk_i) begin
    angle_valid_o <= scanned;
    if (centre_q) amplitude_o <= average;
    if (scanned) begin
      angle_o        <= angle;
      mirror_flags_o <= {unsettled || overflow, index_fault,
                         state_o != vrscan_pkg::MirrorStateWidth'(vrscan_pkg::MirrorRun)};
      confidence_o   <= confidence;
    end
    if (rst_i) angle_valid_o <= 1'b0;
  end

endmodule

`default_nettype wire
