// vrscan_chain: from the pixels of a line to a calibrated point with its uncertainty.
//
// Wiring only: each stage holds one line, and what a later stage needs of an earlier one travels
// beside it.  Lines may follow each other without a gap; where LineLength is too short for the
// largest window to be measured in a line's time, line_receiver drops lines that come too early
// and counts them.
//
//   angle_i, power_i, mirror_flags_i  of the line, sampled with its end; the flags are those from
//                     FlagNotRunning on, and a point that has them keeps its position
//   user_i, user_o    whatever else belongs to the line, sampled with its end; not looked at
//   left_o, right_o   meaningless where width_o is 0; with window_two_pass_i of the second window
//   position_o, sigma_o, x_o, z_o, sigma_z_o  meaningless where measured_o is 0
//   valid_o, ready_i  a point that nobody took is kept and the next one dropped and counted
//   Latency  vrscan.fixed.vrscan_chain.latency(width) clocks from the last pixel with its line_end_i to valid_o:
//            a constant plus twice the window, with two passes plus the first window and another
//            constant, or a third constant where nothing is measured
//   Model    vrscan.fixed.vrscan_chain, bit-exact

`default_nettype none

module vrscan_chain #(
  parameter int unsigned Lanes      = 1,
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned MaxWindow  = 255,
  parameter int unsigned CountWidth = 16,  // of the counters of dropped lines and points
  parameter int unsigned UserWidth  = 8,
  localparam int unsigned IndexWidth    = $clog2(LineLength),
  localparam int unsigned WidthWidth    = $clog2(LineLength + 1),
  localparam int unsigned PositionWidth = IndexWidth + 1 + vrscan_pkg::PositionFraction,
  localparam int unsigned CentreWidth   = IndexWidth + 1 + vrscan_pkg::OffsetFraction
) (
  input  wire logic                                           clk_i,
  input  wire logic                                           rst_i,

  input  wire logic                                           line_start_i,
  input  wire logic                                           line_end_i,
  input  wire logic                                           pixel_valid_i,
  input  wire logic        [            Lanes*PixelWidth-1:0] pixel_i,
  input  wire logic signed [      vrscan_pkg::AngleWidth-1:0] angle_i,
  input  wire logic        [      vrscan_pkg::PowerWidth-1:0] power_i,
  input  wire logic        [ vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_i,
  input  wire logic        [                   UserWidth-1:0] user_i,

  output      logic                                           valid_o,
  input  wire logic                                           ready_i,
  output      logic        [ vrscan_pkg::LineNumberWidth-1:0] line_o,
  output      logic        [       vrscan_pkg::FlagWidth-1:0] flags_o,
  output      logic                                           measured_o,
  output      logic        [                  IndexWidth-1:0] left_o,
  output      logic        [                  IndexWidth-1:0] right_o,
  output      logic        [                  WidthWidth-1:0] width_o,
  output      logic        [                  PixelWidth-1:0] maximum_o,
  output      logic        [      vrscan_pkg::CountWidth-1:0] row_mean_o,
  output      logic        [   vrscan_pkg::VarianceWidth-1:0] row_variance_o,
  output      logic        [      vrscan_pkg::CountWidth-1:0] background_o,
  output      logic        [      vrscan_pkg::CountWidth-1:0] noise_o,
  output      logic        [        vrscan_pkg::SnrWidth-1:0] snr_o,
  output      logic signed [               PositionWidth-1:0] position_o,
  output      logic        [      vrscan_pkg::SigmaWidth-1:0] sigma_o,
  output      logic signed [      vrscan_pkg::AngleWidth-1:0] angle_o,
  output      logic signed [     vrscan_pkg::LengthWidth-1:0] x_o,
  output      logic signed [     vrscan_pkg::LengthWidth-1:0] z_o,
  output      logic        [      vrscan_pkg::SigmaWidth-1:0] sigma_z_o,
  output      logic        [ vrscan_pkg::ConfidenceWidth-1:0] c_obj_o,
  output      logic        [ vrscan_pkg::ConfidenceWidth-1:0] c_sfm_o,
  output      logic        [      vrscan_pkg::PowerWidth-1:0] power_o,
  output      logic        [                   UserWidth-1:0] user_o,

  // Configuration; it has to hold until the points of all lines are out.
  input  wire logic                                           period_n_i,
  input  wire logic                                           window_two_pass_i,
  input  wire logic                                           noise_row_i,
  input  wire logic        [                            15:0] k_noise_i,
  input  wire logic        [                            15:0] k_height_i,
  input  wire logic        [        vrscan_pkg::SnrWidth-1:0] snr_min_i,
  input  wire logic        [     vrscan_pkg::WindowWidth-1:0] min_width_i,
  input  wire logic        [     vrscan_pkg::WindowWidth-1:0] max_width_i,
  input  wire logic        [      vrscan_pkg::KappaWidth-1:0] kappa_i,
  input  wire logic        [       vrscan_pkg::GainWidth-1:0] c_obj_gain_i,
  input  wire logic        [       vrscan_pkg::GainWidth-1:0] c_sfm_gain_i,
  input  wire logic signed [                 CentreWidth-1:0] centre_i,
  input  wire logic signed [ vrscan_pkg::DistortionWidth-1:0] k1_i,
  input  wire logic signed [ vrscan_pkg::DistortionWidth-1:0] k2_i,
  input  wire logic                                           even_i,
  input  wire logic signed [   vrscan_pkg::GeometryWidth-1:0] n0_i,
  input  wire logic signed [   vrscan_pkg::GeometryWidth-1:0] n1_i,
  input  wire logic signed [   vrscan_pkg::GeometryWidth-1:0] d0_i,
  input  wire logic signed [   vrscan_pkg::GeometryWidth-1:0] d1_i,
  input  wire logic signed [   vrscan_pkg::GeometryWidth-1:0] e0_i,
  input  wire logic signed [   vrscan_pkg::GeometryWidth-1:0] e1_i,

  // Status: each counter stops at its largest value.
  output      logic        [                  CountWidth-1:0] short_count_o,
  output      logic        [                  CountWidth-1:0] long_count_o,
  output      logic        [                  CountWidth-1:0] unfinished_count_o,
  output      logic        [                  CountWidth-1:0] early_count_o,
  output      logic        [                  CountWidth-1:0] dropped_count_o
);

  // The longest a stage holds a line; the test keeps both overheads above the latencies.
  localparam int unsigned LinePeriod = 2 * MaxWindow + vrscan_pkg::MinPeriodOverhead;
  localparam int unsigned TwoPeriod  = 3 * MaxWindow + vrscan_pkg::TwoPassOverhead;
  localparam int unsigned MinPeriod  = LineLength >= LinePeriod ? 0 : LinePeriod;
  localparam int unsigned LongPeriod = LineLength >= TwoPeriod ? 0 : TwoPeriod;

  // ---- sensor ----
  logic                                   received, good, lost;
  logic [           Lanes*PixelWidth-1:0] pixel;
  logic [                 IndexWidth-1:0] index;
  logic [vrscan_pkg::LineNumberWidth-1:0] line_number;
  line_receiver #(
    .Lanes(Lanes), .LineLength(LineLength), .PixelWidth(PixelWidth),
    .MinPeriod(MinPeriod), .LongPeriod(LongPeriod), .CountWidth(CountWidth)
  ) u_line_receiver (
    .clk_i, .rst_i,
    .line_start_i, .line_end_i, .pixel_valid_i, .pixel_i,
    .valid_o      (received),
    .pixel_o      (pixel),
    .index_o      (index),
    .good_o       (good),
    .line_number_o(line_number),
    .lost_o       (lost),
    .long_i       (window_two_pass_i),
    .short_count_o, .long_count_o, .unfinished_count_o, .early_count_o
  );

  typedef struct packed {
    logic [vrscan_pkg::LineNumberWidth-1:0] number;
    logic                                   lost;
    logic [     vrscan_pkg::AngleWidth-1:0] angle;
    logic [     vrscan_pkg::PowerWidth-1:0] power;
    logic [vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags;
    logic [                  UserWidth-1:0] user;
  } line_t;
  line_t line, measured_line;
  logic [     vrscan_pkg::AngleWidth-1:0] angle_q;  // beside line_receiver's register
  logic [     vrscan_pkg::PowerWidth-1:0] power_q;
  logic [vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_q;
  logic [                  UserWidth-1:0] user_q;
  always_ff @(posedge clk_i) begin
    angle_q        <= unsigned'(angle_i);
    power_q        <= power_i;
    mirror_flags_q <= mirror_flags_i;
    user_q         <= user_i;
  end
  assign line = {line_number, lost, angle_q, power_q, mirror_flags_q, user_q};

  typedef struct packed {
    line_t                                line;
    logic [   vrscan_pkg::CountWidth-1:0] row_mean;
    logic [vrscan_pkg::VarianceWidth-1:0] row_variance;
    logic                                 row_statistics;
  } row_t;
  row_t row;
  logic                              statistics_valid;
  logic [            PixelWidth-1:0] maximum;
  logic [            IndexWidth-1:0] max_index;
  logic [vrscan_pkg::CountWidth-1:0] background, noise;
  line_statistics #(
    .Lanes(Lanes), .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow),
    .UserWidth($bits(line))
  ) u_line_statistics (
    .clk_i, .rst_i,
    .valid_i         (received),
    .pixel_i         (pixel),
    .index_i         (index),
    .good_i          (good),
    .user_i          (line),
    .valid_o         (statistics_valid),
    .maximum_o       (maximum),
    .max_index_o     (max_index),
    .row_mean_o      (row.row_mean),
    .row_variance_o  (row.row_variance),
    .background_o    (background),
    .noise_o         (noise),
    .row_statistics_o(row.row_statistics),
    .user_o          (measured_line),
    .noise_row_i
  );
  assign row.line = measured_line;

  logic                        replay, replayed, replay_last;
  logic [Lanes*PixelWidth-1:0] replay_pixel;
  logic [      IndexWidth-1:0] replay_index;
  line_buffer #(.Lanes(Lanes), .LineLength(LineLength), .PixelWidth(PixelWidth)) u_line_buffer (
    .clk_i, .rst_i,
    .valid_i (received),
    .pixel_i (pixel),
    .index_i (index),
    .good_i  (good),
    .replay_i(replay),
    .valid_o (replayed),
    .pixel_o (replay_pixel),
    .index_o (replay_index),
    .last_o  (replay_last)
  );

  // ---- peak ----
  typedef struct packed {
    row_t                              row;
    logic [            IndexWidth-1:0] left;
    logic [            IndexWidth-1:0] right;
    logic [            WidthWidth-1:0] width;
    logic [ vrscan_pkg::FlagWidth-1:0] flags;
    logic [            PixelWidth-1:0] maximum;
    logic [vrscan_pkg::CountWidth-1:0] background;
    logic [vrscan_pkg::CountWidth-1:0] noise;
  } window_t;
  window_t                            window, first, peak;
  logic                               window_valid, window_measured;
  logic [  vrscan_pkg::RingWidth-1:0] read_index, correlate_index, refine_index;
  logic [             PixelWidth-1:0] read_pixel;
  peak_isolate #(
    .Lanes(Lanes), .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow),
    .UserWidth($bits(row))
  ) u_peak_isolate (
    .clk_i, .rst_i,
    .valid_i      (statistics_valid),
    .maximum_i    (maximum),
    .max_index_i  (max_index),
    .background_i (background),
    .noise_i      (noise),
    .user_i       (row),
    .replay_o     (replay),
    .pixel_valid_i(replayed),
    .pixel_i      (replay_pixel),
    .index_i      (replay_index),
    .last_i       (replay_last),
    .valid_o      (window_valid),
    .measured_o   (window_measured),
    .left_o       (window.left),
    .right_o      (window.right),
    .width_o      (window.width),
    .flags_o      (window.flags),
    .maximum_o    (window.maximum),
    .background_o (window.background),
    .noise_o      (window.noise),
    .user_o       (window.row),
    .read_index_i (read_index),
    .read_pixel_o (read_pixel),
    .k_noise_i, .k_height_i, .snr_min_i, .min_width_i, .max_width_i
  );

  logic                                          phase_valid, phase_measured, no_phase;
  logic        [    vrscan_pkg::WindowWidth-1:0] window_width, period;
  logic        [     vrscan_pkg::AngleWidth-1:0] phase;
  logic        [ vrscan_pkg::MagnitudeWidth-1:0] magnitude;
  logic        [       vrscan_pkg::SumWidth-1:0] height_sum;
  logic signed [      vrscan_pkg::WaveWidth-1:0] wave;
  logic signed [ vrscan_pkg::WaveCountWidth-1:0] wave_count;
  logic                                          refine, refined, refining, refined_at_edge;
  logic        [                 IndexWidth-1:0] refined_left, refined_right;
  logic        [    vrscan_pkg::WindowWidth-1:0] refined_width;
  logic signed [      vrscan_pkg::RampWidth-1:0] refined_ramp;
  logic signed [vrscan_pkg::SlopeLevelWidth-1:0] refined_slope;
  assign read_index = refining ? refine_index : correlate_index;

  phase_correlate #(.PixelWidth(PixelWidth), .UserWidth($bits(window))) u_phase_correlate (
    .clk_i, .rst_i,
    .valid_i        (window_valid),
    .measured_i     (window_measured),
    .left_i         (vrscan_pkg::RingWidth'(window.left)),
    .width_i        (vrscan_pkg::WindowWidth'(window.width)),
    .background_i   (window.background),
    .user_i         (window),
    .read_index_o   (correlate_index),
    .read_pixel_i   (read_pixel),
    .refine_o       (refine),
    .refined_i      (refined),
    .refined_left_i (vrscan_pkg::RingWidth'(refined_left)),
    .refined_width_i(refined_width),
    .refined_ramp_i (refined_ramp),
    .refined_slope_i(refined_slope),
    .valid_o        (phase_valid),
    .measured_o     (phase_measured),
    .no_phase_o     (no_phase),
    .width_o        (window_width),
    .period_o       (period),
    .phase_o        (phase),
    .magnitude_o    (magnitude),
    .sum_o          (height_sum),
    .wave_o         (wave),
    .count_o        (wave_count),
    .user_o         (first),
    .window_two_pass_i,
    .period_n_i
  );

  // What peak_isolate says of a line stays until the next one's window is known.
  peak_refine #(
    .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow)
  ) u_peak_refine (
    .clk_i, .rst_i,
    .start_i     (window_valid && window_measured && window_two_pass_i),
    .maximum_i   (window.maximum),
    .background_i(window.background),
    .noise_i     (window.noise),
    .left_i      (window.left),
    .valid_i     (refine),
    .width_i     (window_width),
    .phase_i     (phase),
    .magnitude_i (magnitude),
    .sum_i       (height_sum),
    .reading_o   (refining),
    .read_index_o(refine_index),
    .read_pixel_i(read_pixel),
    .valid_o     (refined),
    .left_o      (refined_left),
    .right_o     (refined_right),
    .width_o     (refined_width),
    .at_edge_o   (refined_at_edge),
    .ramp_o      (refined_ramp),
    .slope_o     (refined_slope),
    .kappa_i
  );

  // The window that the phase is of.
  logic second_q;
  always_ff @(posedge clk_i) begin
    if (window_valid) second_q <= window_measured && window_two_pass_i;
  end
  always_comb begin
    peak = first;
    if (second_q) begin
      peak.left  = refined_left;
      peak.right = refined_right;
      peak.width = WidthWidth'(refined_width);
      peak.flags[vrscan_pkg::FlagAtEdge] = refined_at_edge;
    end
  end

  logic                            position_valid;
  logic signed [PositionWidth-1:0] position;
  peak_position #(.LineLength(LineLength)) u_peak_position (
    .clk_i, .rst_i,
    .valid_i   (phase_valid),
    .left_i    (peak.left),
    .period_i  (period),
    .phase_i   (phase),
    .valid_o   (position_valid),
    .position_o(position)
  );

  logic                                   confidence_valid, no_noise;
  logic [       vrscan_pkg::SnrWidth-1:0] snr;
  logic [     vrscan_pkg::SigmaWidth-1:0] sigma;
  logic [vrscan_pkg::ConfidenceWidth-1:0] c_obj, c_sfm;
  peak_confidence #(.PixelWidth(PixelWidth)) u_peak_confidence (
    .clk_i, .rst_i,
    .valid_i     (phase_valid),
    .measured_i  (phase_measured),
    .low_snr_i   (peak.flags[vrscan_pkg::FlagLowSnr]),
    .maximum_i   (peak.maximum),
    .background_i(peak.background),
    .noise_i     (peak.noise),
    .width_i     (window_width),
    .period_i    (period),
    .magnitude_i (magnitude),
    .sum_i       (height_sum),
    .wave_i      (wave),
    .count_i     (wave_count),
    .power_i     (peak.row.line.power),
    .valid_o     (confidence_valid),
    .snr_o       (snr),
    .no_noise_o  (no_noise),
    .sigma_o     (sigma),
    .c_obj_o     (c_obj),
    .c_sfm_o     (c_sfm),
    .kappa_i, .c_obj_gain_i, .c_sfm_gain_i
  );

  // ---- geometry: the image coordinate while the confidence is worked out, then the triangle ----
  logic                                     offset_valid, offset_saturated;
  logic signed [             CentreWidth:0] offset;
  logic signed [vrscan_pkg::SlopeWidth-1:0] slope;
  distortion #(.LineLength(LineLength)) u_distortion (
    .clk_i, .rst_i,
    .valid_i    (position_valid),
    .position_i (position),
    .valid_o    (offset_valid),
    .offset_o   (offset),
    .slope_o    (slope),
    .saturated_o(offset_saturated),
    .centre_i, .k1_i, .k2_i, .even_i
  );

  logic have_offset_q, have_confidence_q, start_q;
  always_ff @(posedge clk_i) begin
    have_offset_q     <= (have_offset_q || offset_valid) && !start_q;
    have_confidence_q <= (have_confidence_q || confidence_valid) && !start_q;
    start_q           <= (have_offset_q || offset_valid)
                         && (have_confidence_q || confidence_valid) && !start_q;
    if (rst_i) begin
      have_offset_q     <= 1'b0;
      have_confidence_q <= 1'b0;
      start_q           <= 1'b0;
    end
  end

  typedef struct packed {
    window_t                                window;
    logic [       vrscan_pkg::SnrWidth-1:0] snr;
    logic [              PositionWidth-1:0] position;
    logic [     vrscan_pkg::SigmaWidth-1:0] sigma;
    logic [vrscan_pkg::ConfidenceWidth-1:0] c_obj;
    logic [vrscan_pkg::ConfidenceWidth-1:0] c_sfm;
  } point_t;
  point_t                          point, taken;
  logic [vrscan_pkg::FlagWidth-1:0] flags;
  always_comb begin
    flags                                = peak.flags;
    flags[vrscan_pkg::FlagNoPhase]       = no_phase;
    flags[vrscan_pkg::FlagNoNoise]       = no_noise;
    flags[vrscan_pkg::FlagRowStatistics] = peak.row.row_statistics;
    flags[vrscan_pkg::FlagLinesLost]     = peak.row.line.lost;
    flags[vrscan_pkg::FlagNotRunning+:vrscan_pkg::MirrorFlagWidth] = peak.row.line.mirror_flags;
    point.window       = peak;
    point.window.flags = flags;
    point.snr          = snr;
    point.position     = phase_measured ? unsigned'(position) : '0;
    point.sigma        = sigma;
    point.c_obj        = c_obj;
    point.c_sfm        = c_sfm;
  end

  logic no_range, out_of_range, points_lost, dropped;
  triangulate #(.LineLength(LineLength), .UserWidth($bits(point))) u_triangulate (
    .clk_i, .rst_i,
    .valid_i       (start_q),
    .measured_i    (phase_measured),
    .offset_i      (offset),
    .slope_i       (slope),
    .saturated_i   (offset_saturated),
    .sigma_i       (sigma),
    .angle_i       (signed'(peak.row.line.angle)),
    .user_i        (point),
    .valid_o, .ready_i,
    .measured_o,
    .x_o, .z_o, .sigma_z_o,
    .no_range_o    (no_range),
    .out_of_range_o(out_of_range),
    .lost_o        (points_lost),
    .user_o        (taken),
    .n0_i, .n1_i, .d0_i, .d1_i, .e0_i, .e1_i,
    .dropped_o     (dropped)
  );

  always_ff @(posedge clk_i) begin
    if (dropped && dropped_count_o != '1) dropped_count_o <= dropped_count_o + CountWidth'(1);
    if (rst_i) dropped_count_o <= '0;
  end

  always_comb begin
    flags_o                              = taken.window.flags;
    flags_o[vrscan_pkg::FlagNoRange]     = no_range;
    flags_o[vrscan_pkg::FlagOutOfRange]  = out_of_range;
    flags_o[vrscan_pkg::FlagPointsLost]  = points_lost;
  end
  assign line_o         = taken.window.row.line.number;
  assign left_o         = taken.window.left;
  assign right_o        = taken.window.right;
  assign width_o        = taken.window.width;
  assign maximum_o      = taken.window.maximum;
  assign row_mean_o     = taken.window.row.row_mean;
  assign row_variance_o = taken.window.row.row_variance;
  assign background_o   = taken.window.background;
  assign noise_o        = taken.window.noise;
  assign snr_o          = taken.snr;
  assign position_o     = signed'(taken.position);
  assign sigma_o        = taken.sigma;
  assign angle_o        = signed'(taken.window.row.line.angle);
  assign c_obj_o        = taken.c_obj;
  assign c_sfm_o        = taken.c_sfm;
  assign power_o        = taken.window.row.line.power;
  assign user_o         = taken.window.row.line.user;

endmodule

`default_nettype wire
