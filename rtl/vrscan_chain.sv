// vrscan_chain: from the pixels of a line to a calibrated point with its uncertainty.
//
// Wiring only: each stage holds one line, and the point goes with it, each stage adding what it
// has found.  Lines may follow each other without a gap; where LineLength is too short for the
// largest window to be measured in a line's time, line_receiver drops lines that come too early
// and counts them.
//
//   line_i            what belongs to the line, sampled with its end; a point whose mirror has flags
//                     keeps its position
//   point_o           left and right are meaningless where width is 0; with window_two_pass they are
//                     those of the second window.  position, sigma, x, z and sigma_z are meaningless
//                     where measured is 0
//   valid_o, ready_i  a point that nobody took is kept and the next one dropped and counted
//   c_sfm             only where a line was in order: flags of the mirror, SATURATED, TOO_WIDE, NO_NOISE
//                     and ROW_STATISTICS make it 0; without it free_from and free_to are 0
//   Latency  vrscan.fixed.vrscan_chain.latency(width) clocks from the last pixel with its line_end_i to valid_o:
//            a constant plus twice the window, with two passes plus the first window and another
//            constant, or a third constant where nothing is measured; with a fit two constants, and
//            the point comes when that time is over for the next line, or after NeighbourClks
//   Model    vrscan.fixed.vrscan_chain, bit-exact

`default_nettype none

module vrscan_chain #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned MaxWindow  = 255,
  parameter int unsigned CountWidth = 16,  // where the counters of dropped lines and points stop
  parameter int unsigned NeighbourClks = vrscan_pkg::NeighbourClks,
  localparam int unsigned IndexWidth    = $clog2(LineLength),
  localparam int unsigned WidthWidth    = $clog2(LineLength + 1),
  localparam int unsigned PositionWidth = IndexWidth + 1 + vrscan_pkg::PositionFraction,
  localparam int unsigned OffsetWidth   = IndexWidth + 2 + vrscan_pkg::OffsetFraction
) (
  input  wire logic                          clk_i,
  input  wire logic                          rst_i,

  input  wire logic                          line_start_i,
  input  wire logic                          line_end_i,
  input  wire logic                          pixel_valid_i,
  input  wire logic [        PixelWidth-1:0] pixel_i,
  input  wire vrscan_pkg::line_t             line_i,

  output      logic                          valid_o,
  input  wire logic                          ready_i,
  output      vrscan_pkg::point_t            point_o,

  // Configuration.  It holds while hold_i is low, and until empty_o behind its rise; with take_i what
  // lines before say of lines behind is forgotten.  hold_i skips the lines that end or begin in it
  // and those that are superseded: they are counted, and the next point has LINES_LOST.
  input  wire logic                          hold_i,
  input  wire logic                          take_i,
  input  wire logic                          configuration_i,
  output      logic                          empty_o,  // from 3 clocks behind hold_i's rise on
  input  wire register_pkg::peak_t           peak_i,
  input  wire register_pkg::geometry_t       geometry_i,
  input  wire register_pkg::free_t           free_i,
  input  wire register_pkg::free_table_t     free_table_i,
  input  wire register_pkg::map_t            map_i,  // enable only where LineLength is at least 64
  input  wire register_pkg::map_table_t      map_table_i,
  output      register_pkg::map_table_status_t map_table_o,

  output      register_pkg::chain_t          chain_o
);

  // The longest a stage holds a line; the test keeps them above the latencies.
  localparam int unsigned LinePeriod = 2 * MaxWindow + vrscan_pkg::MinPeriodOverhead;
  localparam int unsigned TwoPeriod  = 3 * MaxWindow + vrscan_pkg::TwoPassOverhead;
  localparam int unsigned FitPeriod  = vrscan_pkg::FitPeriod;
  logic [11:0] period_q;
  always_ff @(posedge clk_i) begin
    period_q <= peak_i.window_fit        ? 12'(LineLength >= FitPeriod ? 0 : FitPeriod)
                : peak_i.window_two_pass ? 12'(LineLength >= TwoPeriod ? 0 : TwoPeriod)
                                         : 12'(LineLength >= LinePeriod ? 0 : LinePeriod);
  end
  localparam int unsigned PlaceWidth = vrscan_pkg::PlaceWidth;
  vrscan_pkg::point_t begun, received_point, row, row_point, window, first, peak, point, held_q,
                      fit, weighed_fit, placed, corrected_point, taken;
  localparam int unsigned PointWidth = $bits(begun);

  // ---- a reset for each stage in the middle, a clock after rst_i, when nothing comes to it ----
  logic rst_phase, rst_refine, rst_position, rst_confidence, rst_free, rst_held;
  local_register u_reset_phase (.clk_i, .d_i(rst_i), .q_o(rst_phase));
  local_register u_reset_refine (.clk_i, .d_i(rst_i), .q_o(rst_refine));
  local_register u_reset_position (.clk_i, .d_i(rst_i), .q_o(rst_position));
  local_register u_reset_confidence (.clk_i, .d_i(rst_i), .q_o(rst_confidence));
  local_register u_reset_free (.clk_i, .d_i(rst_i), .q_o(rst_free));
  local_register u_reset_held (.clk_i, .d_i(rst_i), .q_o(rst_held));

  // ---- how many lines are inside, and that they forget each other ----
  logic                                   forget_q, flush_q;
  logic [                            3:0] inside_q;

  // ---- sensor ----
  logic                                   received, good, lost;
  logic [                 PixelWidth-1:0] pixel;
  logic [                 IndexWidth-1:0] index;
  logic [vrscan_pkg::LineNumberWidth-1:0] number;
  vrscan_pkg::line_t                      line_q;  // as late as line_receiver's outputs
  logic skip, fresh_q;  // since hold_i a line has begun
  assign skip = hold_i || !fresh_q || line_i.superseded;
  always_ff @(posedge clk_i) begin
    if (line_start_i) fresh_q <= 1'b1;
    if (hold_i) fresh_q <= 1'b0;
    if (rst_i) fresh_q <= 1'b0;
  end
  line_receiver #(
    .LineLength(LineLength), .PixelWidth(PixelWidth), .CountWidth(CountWidth)
  ) u_line_receiver (
    .clk_i, .rst_i, .line_start_i, .line_end_i, .pixel_valid_i, .pixel_i,
    .valid_o(received), .pixel_o(pixel), .index_o(index),
    .good_o(good), .line_number_o(number), .lost_o(lost), .skip_i(skip), .forget_i(forget_q),
    .period_i          (period_q),
    .short_count_o     (chain_o.short_count),
    .long_count_o      (chain_o.long_count),
    .unfinished_count_o(chain_o.unfinished_count),
    .early_count_o     (chain_o.early_count),
    .skipped_count_o   (chain_o.skipped_count)
  );
  always_ff @(posedge clk_i) line_q <= line_i;
  always_comb begin
    begun        = '0;
    begun.line   = line_q;
    begun.number = number;
    begun.line.superseded = 1'b0;
    begun.configuration   = configuration_i;
    begun.flags[vrscan_pkg::FlagLinesLost] = lost;
    begun.flags[vrscan_pkg::FlagNotRunning+:vrscan_pkg::MirrorFlagWidth] = line_q.mirror_flags;
  end

  logic                                 counted, row_statistics;
  logic [               PixelWidth-1:0] maximum;
  logic [               IndexWidth-1:0] max_index;
  logic [   vrscan_pkg::CountWidth-1:0] row_mean, background, noise, spread;
  logic [vrscan_pkg::VarianceWidth-1:0] row_variance;
  line_statistics #(
    .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow), .UserWidth(PointWidth)
  ) u_line_statistics (
    .clk_i, .rst_i,
    .valid_i(received), .pixel_i(pixel), .index_i(index), .good_i(good), .user_i(begun),
    .valid_o(counted), .maximum_o(maximum), .max_index_o(max_index),
    .row_mean_o(row_mean), .row_variance_o(row_variance), .background_o(background),
    .noise_o(noise), .spread_o(spread), .row_statistics_o(row_statistics), .user_o(received_point),
    .noise_row_i(peak_i.noise_row)
  );
  always_comb begin
    row              = received_point;
    row.row_mean     = row_mean;
    row.row_variance = row_variance;
    row.flags[vrscan_pkg::FlagRowStatistics] = row_statistics;
  end

  logic                  replay, replayed, replay_last;
  logic [PixelWidth-1:0] replay_pixel;
  logic [IndexWidth-1:0] replay_index;
  line_buffer #(.LineLength(LineLength), .PixelWidth(PixelWidth)) u_line_buffer (
    .clk_i, .rst_i,
    .valid_i(received), .pixel_i(pixel), .index_i(index), .good_i(good), .replay_i(replay),
    .valid_o(replayed), .pixel_o(replay_pixel), .index_o(replay_index), .last_o(replay_last)
  );

  // ---- peak ----
  logic                              found, found_measured;
  logic [            IndexWidth-1:0] left, right;
  logic [            WidthWidth-1:0] width;
  logic [ vrscan_pkg::FlagWidth-1:0] window_flags;
  logic [            PixelWidth-1:0] window_maximum, read_pixel;
  logic [vrscan_pkg::CountWidth-1:0] window_background, window_noise;
  logic [ vrscan_pkg::RingWidth-1:0] correlate_index, refine_index, fit_index;
  logic                              refining, fitting;
  peak_isolate #(
    .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow), .UserWidth(PointWidth)
  ) u_peak_isolate (
    .clk_i, .rst_i, .peak_i,
    .valid_i(counted), .maximum_i(maximum), .max_index_i(max_index), .background_i(background),
    .noise_i(noise), .spread_i(spread), .row_statistics_i(row_statistics), .user_i(row),
    .replay_o(replay), .pixel_valid_i(replayed), .pixel_i(replay_pixel), .index_i(replay_index),
    .last_i(replay_last),
    .valid_o(found), .measured_o(found_measured), .left_o(left), .right_o(right), .width_o(width),
    .flags_o(window_flags), .maximum_o(window_maximum), .background_o(window_background),
    .noise_o(window_noise), .user_o(row_point),
    .read_index_i(fitting ? fit_index : refining ? refine_index : correlate_index),
    .read_pixel_o(read_pixel)
  );
  always_comb begin
    window            = row_point;
    window.flags      = row_point.flags | window_flags;
    window.left       = PlaceWidth'(left);
    window.right      = PlaceWidth'(right);
    window.width      = PlaceWidth'(width);
    window.maximum    = vrscan_pkg::AlignedWidth'(window_maximum);
    window.background = window_background;
    window.noise      = window_noise;
  end

  logic                                          phased, measured, no_phase;
  logic        [    vrscan_pkg::WindowWidth-1:0] window_width, period;
  logic        [     vrscan_pkg::AngleWidth-1:0] phase;
  logic        [ vrscan_pkg::MagnitudeWidth-1:0] magnitude;
  logic        [       vrscan_pkg::SumWidth-1:0] height_sum;
  logic signed [      vrscan_pkg::WaveWidth-1:0] wave;
  logic signed [ vrscan_pkg::WaveCountWidth-1:0] wave_count;
  logic                                          refine, refined, refined_at_edge;
  logic        [                 IndexWidth-1:0] refined_left, refined_right;
  logic        [    vrscan_pkg::WindowWidth-1:0] refined_width;
  logic signed [      vrscan_pkg::RampWidth-1:0] refined_ramp;
  logic signed [vrscan_pkg::SlopeLevelWidth-1:0] refined_slope;
  logic        [ vrscan_pkg::SpotSigmaWidth-1:0] spot_sigma;
  phase_correlate #(.PixelWidth(PixelWidth), .UserWidth(PointWidth)) u_phase_correlate (
    .clk_i, .rst_i(rst_phase), .peak_i,
    .valid_i(found), .measured_i(found_measured), .left_i(vrscan_pkg::RingWidth'(left)),
    .width_i(vrscan_pkg::WindowWidth'(width)), .background_i(window_background), .user_i(window),
    .read_index_o(correlate_index), .read_pixel_i(read_pixel),
    .refine_o(refine), .refined_i(refined),
    .refined_left_i(vrscan_pkg::RingWidth'(refined_left)), .refined_width_i(refined_width),
    .refined_ramp_i(refined_ramp), .refined_slope_i(refined_slope),
    .valid_o(phased), .measured_o(measured), .no_phase_o(no_phase), .width_o(window_width),
    .period_o(period), .phase_o(phase), .magnitude_o(magnitude), .sum_o(height_sum), .wave_o(wave),
    .count_o(wave_count), .user_o(first)
  );

  // What peak_isolate says of a line stays until the next one's window is known.
  peak_refine #(
    .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow)
  ) u_peak_refine (
    .clk_i, .rst_i(rst_refine),
    .start_i(found && found_measured && peak_i.window_two_pass), .maximum_i(window_maximum),
    .background_i(window_background), .noise_i(window_noise), .left_i(left),
    .valid_i(refine), .width_i(window_width), .phase_i(phase), .magnitude_i(magnitude),
    .sum_i(height_sum),
    .reading_o(refining), .read_index_o(refine_index), .read_pixel_i(read_pixel),
    .valid_o(refined), .left_o(refined_left), .right_o(refined_right), .width_o(refined_width),
    .at_edge_o(refined_at_edge), .ramp_o(refined_ramp), .slope_o(refined_slope),
    .sigma_o(spot_sigma),
    .kappa_i(peak_i.kappa)
  );

  // The window that the phase is of.
  logic second_q;
  always_ff @(posedge clk_i) if (found) second_q <= found_measured && peak_i.window_two_pass;
  always_comb begin
    peak = first;
    if (second_q) begin
      peak.left  = PlaceWidth'(refined_left);
      peak.right = PlaceWidth'(refined_right);
      peak.width = PlaceWidth'(refined_width);
      peak.flags[vrscan_pkg::FlagAtEdge] = refined_at_edge;
    end
  end

  logic                            positioned;
  logic signed [PositionWidth-1:0] position;
  peak_position #(.LineLength(LineLength)) u_peak_position (
    .clk_i, .rst_i(rst_position),
    .valid_i(phased), .left_i(IndexWidth'(peak.left)), .period_i(period), .phase_i(phase),
    .valid_o(positioned), .position_o(position)
  );

  logic                                   judged, no_noise;
  logic [       vrscan_pkg::SnrWidth-1:0] snr;
  logic [     vrscan_pkg::SigmaWidth-1:0] sigma;
  logic [vrscan_pkg::ConfidenceWidth-1:0] c_obj, c_sfm;
  logic                                   clear;
  assign clear = peak.flags[vrscan_pkg::FlagLowSnr] && !peak.flags[vrscan_pkg::FlagSaturated]
                 && !peak.flags[vrscan_pkg::FlagTooWide]
                 && !peak.flags[vrscan_pkg::FlagRowStatistics] && peak.line.mirror_flags == '0;
  peak_confidence #(.PixelWidth(PixelWidth)) u_peak_confidence (
    .clk_i, .rst_i(rst_confidence), .peak_i,
    .valid_i(phased), .measured_i(measured),
    .clear_i(clear),
    .maximum_i(PixelWidth'(peak.maximum)), .background_i(peak.background), .noise_i(peak.noise),
    .width_i(window_width), .period_i(period), .magnitude_i(magnitude), .sum_i(height_sum),
    .wave_i(wave), .count_i(wave_count), .power_i(peak.line.power),
    .valid_o(judged), .snr_o(snr), .no_noise_o(no_noise), .sigma_o(sigma),
    .c_sfm_o(c_sfm)
  );

  // Takes less time than peak_confidence, and its result stays.
  logic [vrscan_pkg::FreeWidth-1:0] free_from, free_to;
  free_interval u_free_interval (
    .clk_i, .rst_i(rst_free), .free_i, .free_table_i,
    .valid_i(phased), .angle_i(peak.line.angle), .power_i(peak.line.power),
    .noise_i(peak.noise), .valid_o(), .from_o(free_from), .to_o(free_to)
  );

  // The point so far waits here while the next line is correlated.  Before a fit it waits for as long
  // as a line can take, so that fits are a line's time apart.
  logic                                have_position_q, have_confidence_q, start, start_q, aged_q;
  logic [$clog2(vrscan_pkg::FitStart)-1:0] age_q;
  localparam int unsigned AgeWidth = $clog2(vrscan_pkg::FitStart);
  logic [vrscan_pkg::SumWidth-1:0] light_q;
  assign start = (have_position_q || positioned) && (have_confidence_q || judged)
                 && (!peak_i.window_fit || aged_q) && !start_q;
  always_ff @(posedge clk_i) begin
    age_q  <= found ? '0 : age_q + AgeWidth'(1);
    aged_q <= !found && (aged_q || age_q == AgeWidth'(vrscan_pkg::FitStart - 2));
    have_position_q   <= (have_position_q || positioned) && !start_q;
    have_confidence_q <= (have_confidence_q || judged) && !start_q;
    start_q           <= start;
    if (start) begin
      held_q  <= point;
      light_q <= height_sum;
    end
    if (rst_i || rst_held) begin
      have_position_q   <= 1'b0;
      have_confidence_q <= 1'b0;
      start_q           <= 1'b0;
    end
  end

  always_comb begin
    point          = peak;
    point.measured = measured;
    point.snr      = snr;
    point.position = measured ? vrscan_pkg::PositionWidth'(position) : '0;
    point.sigma    = sigma;
    point.c_sfm    = c_sfm;
    point.free_from = c_sfm != '0 ? free_from : '0;
    point.free_to   = c_sfm != '0 ? free_to : '0;
    point.flags[vrscan_pkg::FlagNoPhase] = no_phase;
    point.flags[vrscan_pkg::FlagNoNoise] = no_noise;
  end

  // ---- the fit ----
  logic                              fit_done, mixed;
  logic signed [  PositionWidth-1:0] fit_position;
  logic [vrscan_pkg::SigmaWidth-1:0] fit_sigma;
  logic [vrscan_pkg::ScaleWidth-1:0] scale;
  peak_fit #(.LineLength(LineLength), .PixelWidth(PixelWidth)) u_peak_fit (
    .clk_i, .rst_i(forget_q),
    .valid_i(start_q && peak_i.window_fit), .measured_i(held_q.measured),
    .left_i(IndexWidth'(held_q.left)), .width_i(vrscan_pkg::WindowWidth'(held_q.width)),
    .slope_i(refined_slope), .position_i(PositionWidth'(held_q.position)),
    .spread_i(held_q.sigma), .sigma_i(spot_sigma), .maximum_i(PixelWidth'(held_q.maximum)),
    .background_i(held_q.background), .noise_i(held_q.noise),
    .reading_o(fitting), .read_index_o(fit_index), .read_pixel_i(read_pixel),
    .valid_o(fit_done), .mixed_o(mixed), .position_o(fit_position), .sigma_o(fit_sigma),
    .scale_o(scale), .kappa_i(peak_i.kappa), .saturation_level_i(peak_i.saturation_level)
  );
  always_comb begin
    fit = held_q;
    if (held_q.measured) begin
      fit.position = vrscan_pkg::PositionWidth'(fit_position);
      fit.sigma    = fit_sigma;
      fit.flags[vrscan_pkg::FlagMixed] = mixed;
    end
  end

  // ---- what the lines before and behind say of it: the point waits for the latter ----
  logic                              weighed, unlike;
  logic [vrscan_pkg::SigmaWidth-1:0] weighed_sigma, weighed_typical, typical, doubt;
  peak_neighbours #(
    .LineLength(LineLength), .NeighbourClks(NeighbourClks), .UserWidth(PointWidth)
  ) u_peak_neighbours (
    .clk_i, .rst_i(forget_q), .flush_i(flush_q),
    .valid_i(fit_done), .measured_i(fit.measured), .position_i(PositionWidth'(fit.position)),
    .sigma_i(fit.sigma), .scale_i(scale), .light_i(light_q), .power_i(fit.line.power),
    .user_i(fit),
    .valid_o(weighed), .sigma_o(weighed_sigma), .typical_o(weighed_typical), .doubt_o(doubt),
    .mixed_o(unlike),
    .user_o(weighed_fit)
  );
  always_comb begin
    placed  = held_q;
    typical = held_q.sigma;
    if (peak_i.window_fit) begin
      placed       = weighed_fit;
      placed.sigma = weighed_sigma;
      typical      = weighed_typical;
      placed.doubt = doubt;
      placed.flags[vrscan_pkg::FlagMixed] = weighed_fit.flags[vrscan_pkg::FlagMixed] || unlike;
    end
  end

  // ---- geometry: the image coordinate, then the triangle ----
  logic                                     corrected, offset_saturated;
  logic signed [           OffsetWidth-1:0] offset;
  logic signed [vrscan_pkg::SlopeWidth-1:0] slope;
  logic                            placing, mapped, map_saturated, map_filled;
  logic signed [PositionWidth-1:0] seen_position, map_position, taken_position;
  assign placing        = peak_i.window_fit ? weighed : start_q;
  assign seen_position  = PositionWidth'(placed.position);
  assign taken_position = map_i.map_enable ? map_position : seen_position;
  if (LineLength >= 64) begin : gen_map
    correction_map #(.LineLength(LineLength)) u_correction_map (
      .clk_i, .rst_i,
      .valid_i(placing), .position_i(seen_position),
      .angle_i(placed.line.angle),
      .lens_i(map_i.map_follow ? placed.line.lens : map_i.map_lens),
      .valid_o(mapped), .position_o(map_position), .saturated_o(map_saturated),
      .filled_o(map_filled),
      .write_i(map_table_i.map_table_write), .access_bank_i(map_table_i.map_table_access_bank),
      .index_i(map_table_i.map_table_index), .value_i(map_table_i.map_table_node),
      .value_o(map_table_o.map_table_read),
      .enable_i(map_i.map_enable), .bank_i(map_i.map_bank), .map_count_i(map_i.map_count),
      .map_begin_i(map_i.map_begin), .map_shift_i(map_i.map_shift)
    );
  end else begin : gen_no_map
    logic unused_map;
    assign unused_map    = ^{map_i, map_table_i};
    assign map_table_o   = '0;
    assign map_filled    = 1'b0;
    assign mapped        = 1'b0;
    assign map_position  = '0;
    assign map_saturated = 1'b0;
  end
  always_comb begin
    corrected_point = placed;
    corrected_point.flags[vrscan_pkg::FlagMapFilled] = map_i.map_enable && map_filled
                                                       && placed.measured;
  end
  distortion #(.LineLength(LineLength)) u_distortion (
    .clk_i, .rst_i, .geometry_i,
    .valid_i(map_i.map_enable ? mapped : placing), .position_i(taken_position),
    .valid_o(corrected), .offset_o(offset), .slope_o(slope), .saturated_o(offset_saturated)
  );

  logic                                      in_space, no_range, out_of_range, points_lost, dropped;
  logic signed [vrscan_pkg::LengthWidth-1:0] x, z;
  logic        [ vrscan_pkg::SigmaWidth-1:0] sigma_z;
  triangulate #(.LineLength(LineLength), .UserWidth(PointWidth)) u_triangulate (
    .clk_i, .rst_i, .geometry_i,
    .valid_i(corrected), .measured_i(placed.measured), .offset_i(offset), .slope_i(slope),
    .saturated_i(offset_saturated || (map_i.map_enable && map_saturated)),
    .sigma_i(placed.sigma), .typical_i(typical), .snr_i(placed.snr),
    .angle_i(placed.line.angle),
    .user_i(corrected_point),
    .valid_o, .ready_i, .measured_o(in_space), .x_o(x), .z_o(z), .sigma_z_o(sigma_z),
    .c_obj_o(c_obj),
    .no_range_o(no_range), .out_of_range_o(out_of_range), .lost_o(points_lost), .user_o(taken),
    .dropped_o(dropped)
  );
  always_comb begin
    point_o          = taken;
    point_o.measured = in_space;
    point_o.x        = x;
    point_o.z        = z;
    point_o.sigma_z  = sigma_z;
    point_o.c_obj    = c_obj;
    if (taken.flags[vrscan_pkg::FlagMixed] && geometry_i.c_obj_gain == '0) begin
      point_o.c_obj = c_obj >> 1;  // half keep the tolerance
    end
    point_o.flags[vrscan_pkg::FlagNoRange]    = no_range;
    point_o.flags[vrscan_pkg::FlagOutOfRange] = out_of_range;
    point_o.flags[vrscan_pkg::FlagPointsLost] = points_lost;
  end

  assign empty_o = inside_q == '0;
  always_ff @(posedge clk_i) begin
    inside_q <= inside_q + 4'(good) - 4'(dropped || (valid_o && ready_i));
    flush_q  <= hold_i && inside_q == 4'd1;
    forget_q <= take_i || rst_i;
    if (rst_i) inside_q <= '0;
  end

  logic [vrscan_pkg::CounterWidth-1:0] dropped_count_q;
  assign chain_o.dropped_count = dropped_count_q;
  always_ff @(posedge clk_i) begin
    if (dropped) dropped_count_q <= vrscan_pkg::counted(dropped_count_q, CountWidth);
    if (rst_i) dropped_count_q <= '0;
  end

endmodule

`default_nettype wire
