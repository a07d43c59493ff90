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
//   angle_valid_o  angle_o, mirror_flags_o, confidence_o and angle_line_o belong to the
//                  line whose centre_o was AngleLatency clocks before; the flags are those of now,
//                  vrscan_pkg::FlagNotRunning and the next two; an angle that saturates is unsettled
//   scan_begin, scan_span  the part of a turn in which lines are pulsed.  A pulse is whole or absent,
//                  as its begin is inside or not; a line whose centre is outside is unsettled
//   scan_facet     a turn is a facet of a polygon, whose motion is that of half the phase: odd harmonics
//                  make a straight line of half a turn, and never of a whole one
//   take_i        from here on mirror and motion are those of another configuration: motion_i two
//                 clocks later.  Without a new table nothing but the harmonics changes; with one the
//                 phase and amplitude are acquired anew, and lines are UNSETTLED until that has
//                 settled
//   renewing_o    from take_i's next clock on, until the harmonics are those of the new configuration
//   Latency  scan_angle's and 2 more clocks from centre_o to angle_valid_o; the centres of two lines
//            are to be at least as far apart, or the first one's angle does not come
//   Model    vrscan.clocked.mirror_loop, bit-exact

`default_nettype none

module mirror_loop #(
  parameter int unsigned IndexOversample   = 4,
  parameter int unsigned CountWidth        = 16,  // where counters stop
  parameter int unsigned PeriodCeilingClks = 1_250_000,  // 10 ms at 125 MHz
  parameter int unsigned SettleCeilingClks = 1_250_000_000,  // 10 s
  parameter int unsigned LostCeilingClks   = 3_125_000  // 25 ms
) (
  input  wire logic                                           clk_i,
  input  wire logic                                           rst_i,

  // Pins.
  input  wire logic        [             IndexOversample-1:0] comparator_i,
  input  wire logic        [             IndexOversample-1:0] gate_i,
  output      logic                                           drive_o,
  output      logic        [      vrscan_pkg::LevelWidth-1:0] level_o,
  output      logic                                           level_pin_o,
  output      logic                                           line_start_o,
  output      logic                                           exposure_o,
  output      logic                                           laser_o,
  output      logic        [ vrscan_pkg::LineNumberWidth-1:0] line_o,

  // The angle of a line.
  output      logic                                           centre_o,
  output      logic                                           centre_half_o,
  output      logic                                           angle_valid_o,
  output      logic        [ vrscan_pkg::LineNumberWidth-1:0] angle_line_o,
  output      logic signed [      vrscan_pkg::AngleWidth-1:0] angle_o,
  output      logic        [ vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_o,
  output      logic        [ vrscan_pkg::ConfidenceWidth-1:0] confidence_o,

  // Registers.
  input  wire register_pkg::mirror_t                          mirror_i,
  input  wire register_pkg::mirror_limits_t                   mirror_limits_i,
  input  wire register_pkg::motion_t                          motion_i,
  input  wire register_pkg::line_t                            line_i,
  input  wire register_pkg::table_t                           table_i,
  input  wire logic                                           take_i,
  output      logic                                           renewing_o,
  output      register_pkg::mirror_status_t                   mirror_status_o
);

  register_pkg::mirror_status_t status;
  assign mirror_status_o = status;

  // ---- index to phase and amplitude ----
  logic                            crossing, outward, missing, doubled, impossible, broken;
  logic [vrscan_pkg::AgeWidth-1:0] age;
  assign broken = missing || doubled || impossible;
  index_capture #(
    .IndexOversample(IndexOversample), .CountWidth(CountWidth),
    .PeriodCeilingClks(PeriodCeilingClks)
  ) u_index_capture (
    .clk_i, .rst_i, .comparator_i, .gate_i, .mirror_i,
    .valid_o(crossing), .outward_o(outward), .age_o(age),
    .missing_o(missing), .doubled_o(doubled), .impossible_o(impossible),
    .alive_o(status.index_alive), .missing_count_o(status.missing_count),
    .doubled_count_o(status.doubled_count), .impossible_count_o(status.impossible_count),
    .glitch_count_o(status.glitch_count)
  );

  logic                                  measured, acquired;
  logic [     vrscan_pkg::WordWidth-1:0] increment;
  logic [vrscan_pkg::AmplitudeWidth-1:0] average;
  mirror_phase u_mirror_phase (
    .clk_i, .rst_i, .table_i, .renew_i(take_i), .mirror_i,
    .valid_i(crossing), .outward_i(outward), .age_i(age), .broken_i(broken),
    .word_i(status.mirror_word),
    .phase_o(status.mirror_phase), .increment_o(increment), .valid_o(measured),
    .measured_o(status.mirror_measured), .amplitude_o(average), .error_o(status.mirror_error),
    .acquired_o(acquired)
  );

  // ---- amplitude to the drive ----
  logic                                          unsettled, index_fault;
  logic        [     vrscan_pkg::LevelWidth-1:0] level;
  logic signed [      vrscan_pkg::TrimWidth-1:0] trim;
  logic        [vrscan_pkg::ConfidenceWidth-1:0] confidence;
  amplitude_control u_amplitude_control (
    .clk_i, .rst_i, .mirror_i, .mirror_limits_i,
    .state_i(status.mirror_state), .valid_i(measured),
    .measured_i(status.mirror_measured), .error_i(status.mirror_error), .acquired_i(acquired),
    .broken_i(broken),
    .level_o(level), .trim_o(trim), .settled_o(status.mirror_settled), .unsettled_o(unsettled),
    .index_fault_o(index_fault), .confidence_o(confidence)
  );

  mirror_drive #(
    .SettleCeilingClks(SettleCeilingClks), .LostCeilingClks(LostCeilingClks)
  ) u_mirror_drive (
    .clk_i, .rst_i, .mirror_i, .mirror_limits_i, .drive_o, .level_o, .level_pin_o,
    .enable_i(mirror_i.mirror_enable), .level_i(level), .trim_i(trim),
    .index_alive_i(status.index_alive), .settled_i(status.mirror_settled),
    .state_o(status.mirror_state), .fault_o(status.mirror_fault),
    .phase_o(status.mirror_drive_phase), .word_o(status.mirror_word)
  );
  assign status.mirror_level = level_o;

  // ---- lines and their angle ----
  logic        outside, dark_q, outside_q, line_outside_q, laser;
  logic [15:0] since_begin;
  assign since_begin = status.mirror_phase[vrscan_pkg::TurnWidth-1-:16] - motion_i.scan_begin;
  assign outside     = since_begin > motion_i.scan_span;
  assign laser_o     = laser && !dark_q;
  line_trigger #(.CountWidth(CountWidth)) u_line_trigger (
    .clk_i, .rst_i, .line_i,
    .line_start_o, .line_o, .exposure_o, .laser_o(laser), .centre_o, .centre_half_o,
    .enable_i(mirror_i.line_enable), .word_i(status.mirror_word),
    .overrun_o(), .overrun_count_o(status.overrun_count)
  );

  // The phase at the centre, to nearest: half a clock is half an increment.  The harmonics follow
  // the drive's phase, between two angles.
  localparam int unsigned PhaseDrop = vrscan_pkg::TurnWidth - vrscan_pkg::PhaseWidth;
  logic                                     centre_q, scanned, overflow, scanning_q;
  logic                                     offset_valid_q;
  logic        [ vrscan_pkg::TurnWidth-1:0] centre_phase, centre_phase_q, advance, offset_q;
  logic        [vrscan_pkg::PhaseWidth-1:0] phase;
  logic signed [vrscan_pkg::AngleWidth-1:0] angle;
  logic [vrscan_pkg::HarmonicCount*vrscan_pkg::MotionWidth-1:0] a;
  logic [vrscan_pkg::HarmonicCount*vrscan_pkg::PhaseWidth-1:0] phi;
  assign advance = centre_half_o ? vrscan_pkg::TurnWidth'(increment) >> 1 : '0;
  assign centre_phase = status.mirror_phase + advance;
  assign phase = centre_phase_q[PhaseDrop+:vrscan_pkg::PhaseWidth]
                 + vrscan_pkg::PhaseWidth'(centre_phase_q[PhaseDrop-1]);
  localparam int unsigned TakeClks = 3;  // until motion_i is the new one
  logic [TakeClks-1:0] take_q;
  logic                mapping;
  assign renewing_o = take_q != '0 || mapping;
  always_ff @(posedge clk_i) take_q <= rst_i ? '0 : {take_q[TakeClks-2:0], take_i};
  motion_map u_motion_map (
    .clk_i, .rst_i, .motion_i,
    .valid_i(offset_valid_q), .offset_i(offset_q), .busy_i(centre_q || scanning_q),
    .renew_i(take_q[TakeClks-1]), .renewing_o(mapping),
    .a_o(a), .phi_o(phi)
  );

  scan_angle u_scan_angle (
    .clk_i, .rst_i,
    .valid_i(centre_q), .phase_i(phase), .amplitude_i(average), .a_i(a), .phi_i(phi),
    .valid_o(scanned), .angle_o(angle), .overflow_o(overflow)
  );

  logic running;
  assign running = status.mirror_state == vrscan_pkg::MirrorStateWidth'(vrscan_pkg::MirrorRun);
  always_ff @(posedge clk_i) begin
    centre_q       <= centre_o;
    centre_phase_q <= centre_phase >> motion_i.scan_facet;
    if (!laser) dark_q <= outside;
    outside_q      <= outside;
    offset_q       <= status.mirror_drive_phase - status.mirror_phase;
    offset_valid_q <= measured;
    scanning_q     <= centre_q || (scanning_q && !scanned);
    angle_valid_o  <= scanned;
    if (centre_o) angle_line_o <= line_o;
    if (centre_q) line_outside_q <= outside_q;
    if (scanned) begin
      angle_o        <= angle;
      mirror_flags_o <= {unsettled || overflow || line_outside_q, index_fault, !running};
      confidence_o   <= confidence;
    end
    if (rst_i) begin
      centre_q       <= 1'b0;
      offset_valid_q <= 1'b0;
      scanning_q     <= 1'b0;
      angle_valid_o  <= 1'b0;
    end
  end

endmodule

`default_nettype wire
