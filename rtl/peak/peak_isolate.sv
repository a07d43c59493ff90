// peak_isolate: the threshold, and the run of pixels above it that holds the maximum.
//
//   threshold = background + max(k_noise spread, k_height (maximum - background))
//   core      = background + max(k_noise noise, (maximum - background) / 4)
//
// The statistics of a line come in, the line is replayed from the buffer, and after its last
// pixel the window goes out with its flags.  The window's pixels, and those around it, stand in a
// ring by the lower bits of their index, readable until the next line ends.  No decision divides:
// the S/N is compared as (maximum - background) < snr_min noise.  A clear spot needs snr_min noises
// and spreads where the spread is at most 17/16 of the noise, and 13/8 times as many noises
// elsewhere: noise of low frequencies is as wide as a spot.
//
// The threshold lies above what the row's background reaches, so it takes the spread, up to half of
// the height.  With noise_row it is the paper's, without that limit.  The core level tells a spot
// from its surroundings: another run above it is a rival when it is at least min_width wide, for
// what could not be a peak is none.  A spot is clear when its own run there is at most max_core
// wide and at most MostRivals others are from min_width to max_core wide.  A clear one is judged by
// the noise beside it; a broad one or one of many by the spread, where that is larger, because a
// wall's texture, its edges and its lamps look like that.  A broad one is TOO_WIDE unless it is
// saturated.  Where a fit follows, runs at most MostGap pixels apart are one: out of focus, coarse
// speckle breaks a spot up.  At the core level the width of such a one is without the gaps, and one
// of its parts has to be min_width wide.  Of a window min_width pixels have to be above, two of them
// side by side, so two hot pixels are no spot.
//
// Where black is clipped only the tail of the noise is seen, whose sigma is about 1.4 times its
// variance over its mean.  So noise above the background, but for a row's, is multiplied by 1.4
// times their ratio, in half powers of two, before the S/N is judged by it.  It is NoiseFloor
// sixteenths of a count at least, and a count where no other pixel is lit.
//
//   left_o, right_o, width_o  the window; width_o is 0 where the maximum is not above the threshold
//   noise_o                   what the peak is judged by
//   measured_o                none of LOW_SNR, TOO_NARROW and TOO_WIDE
//   read_index_i, read_pixel_o  a pixel by its index modulo 2**RingWidth, 2 clocks later: of the
//                             window and of RingMargin pixels beside it, as far as there are any
//   Latency  vrscan.fixed.peak_isolate.latency() clocks from valid_i to valid_o; replay_o comes
//            vrscan.fixed.peak_isolate.replay_latency() clocks after valid_i
//   Model    vrscan.fixed.peak_isolate, bit-exact

`default_nettype none

module peak_isolate #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned MaxWindow  = 255,
  parameter int unsigned UserWidth  = 8,
  localparam int unsigned IndexWidth = $clog2(LineLength),
  localparam int unsigned WidthWidth = $clog2(LineLength + 1)
) (
  input  wire logic                               clk_i,
  input  wire logic                               rst_i,

  // Statistics of the line, sampled with valid_i.
  input  wire logic                               valid_i,
  input  wire logic [             PixelWidth-1:0] maximum_i,
  input  wire logic [             IndexWidth-1:0] max_index_i,
  input  wire logic [ vrscan_pkg::CountWidth-1:0] background_i,
  input  wire logic [ vrscan_pkg::CountWidth-1:0] noise_i,
  input  wire logic [ vrscan_pkg::CountWidth-1:0] spread_i,
  input  wire logic                               row_statistics_i,
  input  wire logic [              UserWidth-1:0] user_i,

  // The line, from line_buffer.
  output      logic                               replay_o,
  input  wire logic                               pixel_valid_i,
  input  wire logic [             PixelWidth-1:0] pixel_i,
  input  wire logic [             IndexWidth-1:0] index_i,
  input  wire logic                               last_i,

  output      logic                               valid_o,
  output      logic                               measured_o,
  output      logic [             IndexWidth-1:0] left_o,
  output      logic [             IndexWidth-1:0] right_o,
  output      logic [             WidthWidth-1:0] width_o,
  output      logic [  vrscan_pkg::FlagWidth-1:0] flags_o,
  output      logic [             PixelWidth-1:0] maximum_o,
  output      logic [ vrscan_pkg::CountWidth-1:0] background_o,
  output      logic [ vrscan_pkg::CountWidth-1:0] noise_o,
  output      logic [              UserWidth-1:0] user_o,

  input  wire logic [  vrscan_pkg::RingWidth-1:0] read_index_i,
  output      logic [             PixelWidth-1:0] read_pixel_o,

  // Configuration.
  input  wire register_pkg::peak_t                peak_i
);

  if (MaxWindow < vrscan_pkg::MinWindow || MaxWindow > 255) begin : gen_bad_window
    $error("peak_isolate: MaxWindow must be 3..255");
  end

  localparam int unsigned CountWidth  = vrscan_pkg::CountWidth;
  localparam int unsigned CountShift  = CountWidth - PixelWidth;  // pixel to count format
  localparam int unsigned WindowWidth = vrscan_pkg::WindowWidth;
  localparam int unsigned TermWidth   = CountWidth + 16;  // factor times count
  localparam int unsigned WiderWidth  = WidthWidth > WindowWidth ? WidthWidth : WindowWidth;
  localparam int unsigned HalfShift   = 1;  // the spread lifts the threshold to half of the height
  localparam int unsigned CoreShift   = 2;  // the core level is at a quarter of the height
  localparam int unsigned MostRivals  = 2;  // narrow rivals of a clear spot
  localparam int unsigned RivalWidth  = $clog2(MostRivals + 2);
  localparam int unsigned MostGap     = 4;  // pixels between two parts of a run
  localparam int unsigned GapWidth    = $clog2(MostGap + 1);
  localparam int unsigned MostRaised  = 15;  // powers of two by which clipping may hide the noise
  localparam int unsigned RaisedWidth = CountWidth + 1 + MostRaised;
  localparam int unsigned BitWidth    = $clog2(CountWidth);
  localparam int unsigned OneCount    = 1 << CountShift;

  // ---- limits that registers cannot leave ----
  logic [WindowWidth-1:0] min_width_q, below_min_q, max_width_q, max_core_q;
  always_ff @(posedge clk_i) begin
    min_width_q <= peak_i.min_width < WindowWidth'(vrscan_pkg::MinWindow)
                   ? WindowWidth'(vrscan_pkg::MinWindow) : peak_i.min_width;
    max_width_q <= peak_i.max_width >= WindowWidth'(MaxWindow) ? WindowWidth'(MaxWindow)
                                                               : peak_i.max_width;
    below_min_q <= min_width_q - WindowWidth'(1);
    max_core_q  <= peak_i.max_core;
  end

  // ---- both levels and both limits of the height: five products, one after the other ----
  typedef enum logic [2:0] {
    IDLE, SPREAD_TERM, HEIGHT_TERM, NOISE_TERM, SNR_TERM, SPREAD_SNR_TERM, SUM, REPLAY
  } state_e;
  state_e                         state_q;
  logic                           start_q, product_valid;
  logic signed [            16:0] factor_q;
  logic signed [    CountWidth:0] count_q;
  logic signed [CountWidth+17:0]  product;
  logic        [  CountWidth-1:0] height_q;  // maximum - background
  logic        [   TermWidth-1:0] spread_term_q, noise_term_q;
  logic        [  CountWidth-1:0] height_term_q;
  logic                           dim_q, far_dim_q, even_q, faint_q, far_faint_q;
  logic                           low_clear_q, low_unclear_q;
  logic        [   TermWidth+3:0] sure_q;  // 8 or 13 times the product before
  logic        [     TermWidth:0] threshold_q, core_q;  // cannot overflow: a term and a count
  logic        [  PixelWidth-1:0] maximum_q;
  logic        [  IndexWidth-1:0] max_index_q;
  logic        [  CountWidth-1:0] background_q, noise_q, spread_q;
  logic                           row_q;  // the noise has the peak in it
  logic        [   UserWidth-1:0] user_q;

  multiply #(.AWidth(CountWidth + 1), .BWidth(17)) u_multiply (
    .clk_i, .rst_i,
    .valid_i  (start_q),
    .a_i      (count_q),
    .b_i      (factor_q),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // To nearest, half up; the noise term has 8 fraction bits more than a count, the height's 16.
  // The height's factor is below one, so its term is a count.
  logic [TermWidth-1:0]  noise_term;
  logic [CountWidth-1:0] height_term;
  assign noise_term  = (product[TermWidth-1:0] + TermWidth'(1 << (vrscan_pkg::KNoiseFraction - 1)))
                       >> vrscan_pkg::KNoiseFraction;
  assign height_term = CountWidth'((product[TermWidth-1:0]
                                    + TermWidth'(1 << (vrscan_pkg::KHeightFraction - 1)))
                                   >> vrscan_pkg::KHeightFraction);
  logic unused_product;
  assign unused_product = ^product[CountWidth+17:TermWidth];

  logic [TermWidth-1:0] half_height, core_height, height_limit;
  assign half_height  = TermWidth'(height_q) >> HalfShift;
  assign core_height  = TermWidth'(height_q) >> CoreShift;
  assign height_limit = TermWidth'(height_q) << vrscan_pkg::SnrFraction;

  // Twice the logarithm to base 2, rounded down: the place of the highest bit and the next bit.
  function automatic logic [BitWidth:0] halves(input logic [CountWidth-1:0] value);
    halves = '0;
    for (int unsigned k = 1; k < CountWidth; k++) if (value[k]) halves = {BitWidth'(k), value[k-1]};
  endfunction

  // It stands long before it is a factor.
  logic [     BitWidth:0] noise_halves_q, background_halves_q;
  logic [            4:0] raise_q;  // half powers of two
  logic [ CountWidth+1:0] thrice_q;  // or twice: with the odd half one, and a fraction bit
  logic [RaisedWidth-1:0] raised_q;
  logic [ CountWidth-1:0] least_q, judged_q;
  logic [ BitWidth + 1:0] raise;
  assign raise = (BitWidth + 2)'(noise_halves_q) - (BitWidth + 2)'(background_halves_q);
  always_ff @(posedge clk_i) begin
    noise_halves_q      <= halves(noise_q);
    background_halves_q <= halves(background_q);
    raise_q             <= |raise[BitWidth:5] || &raise[4:0] ? '1 : raise[4:0] + 5'd1;
    if (raise[BitWidth+1] || raise == '0 || row_q) raise_q <= '0;
    thrice_q            <= {1'b0, noise_q, 1'b0}
                           + (raise_q[0] ? (CountWidth + 2)'(noise_q) : '0);
    raised_q            <= RaisedWidth'(((RaisedWidth + 1)'(thrice_q) << raise_q[4:1]) >> 1);
    judged_q            <= |raised_q[RaisedWidth-1:CountWidth] ? '1 : raised_q[CountWidth-1:0];
    if (raised_q < RaisedWidth'(least_q) && !row_q) judged_q <= least_q;
    least_q <= background_q == '0 ? CountWidth'(OneCount)
                                     : CountWidth'((vrscan_pkg::NoiseFloor * OneCount) >> 4);
  end

  // 13 times the product, which is compared a clock later.
  logic [TermWidth+3:0] sure_height, product_wide;
  assign sure_height  = (TermWidth + 4)'(height_limit) << 3;
  assign product_wide = (TermWidth + 4)'(product[TermWidth-1:0]);
  always_ff @(posedge clk_i) begin
    even_q <= {1'b0, spread_q, 4'd0} <= {1'b0, noise_q, 4'd0} + (CountWidth + 5)'(noise_q);
    if (product_valid)
      sure_q <= (product_wide << 3)
                + (peak_i.noise_row ? '0 : (product_wide << 2) + product_wide);
  end

  // What is compared stands since the product before.
  logic spread_high_q, spread_larger_q, noise_larger_q;
  always_ff @(posedge clk_i) begin
    spread_high_q   <= !peak_i.noise_row && spread_term_q > half_height;
    spread_larger_q <= spread_term_q > TermWidth'(height_term_q);
    noise_larger_q  <= noise_term_q > core_height;
  end

  always_ff @(posedge clk_i) begin
    start_q  <= 1'b0;
    replay_o <= 1'b0;
    unique case (state_q)
      IDLE: if (valid_i) begin
        maximum_q    <= maximum_i;
        max_index_q  <= max_index_i;
        background_q <= background_i;
        noise_q      <= noise_i;
        spread_q     <= spread_i;
        row_q        <= row_statistics_i || peak_i.noise_row;
        user_q       <= user_i;
        // A mean is not above the maximum, so this is not negative.
        height_q     <= (CountWidth'(maximum_i) << CountShift) - background_i;
        factor_q     <= signed'({1'b0, peak_i.k_noise});
        count_q      <= signed'({1'b0, spread_i});
        start_q      <= 1'b1;
        state_q      <= SPREAD_TERM;
      end
      SPREAD_TERM: if (product_valid) begin
        spread_term_q <= noise_term;
        factor_q      <= signed'({1'b0, peak_i.k_height});
        count_q       <= signed'({1'b0, height_q});
        start_q       <= 1'b1;
        state_q       <= HEIGHT_TERM;
      end
      HEIGHT_TERM: if (product_valid) begin
        if (spread_high_q) spread_term_q <= half_height;
        height_term_q <= height_term;
        factor_q      <= signed'({1'b0, peak_i.k_noise});
        count_q       <= signed'({1'b0, noise_q});
        start_q       <= 1'b1;
        state_q       <= NOISE_TERM;
      end
      NOISE_TERM: if (product_valid) begin
        threshold_q  <= spread_larger_q ? (TermWidth + 1)'(spread_term_q)
                                        : (TermWidth + 1)'(height_term_q);
        noise_term_q <= noise_term;
        factor_q     <= signed'({1'b0, peak_i.snr_min});
        count_q      <= signed'({1'b0, judged_q});
        start_q      <= 1'b1;
        state_q      <= SNR_TERM;
      end
      SNR_TERM: if (product_valid) begin
        core_q    <= {1'b0, noise_larger_q ? noise_term_q : core_height};
        dim_q     <= height_limit < product[TermWidth-1:0];
        count_q   <= signed'({1'b0, spread_q});
        start_q   <= 1'b1;
        state_q   <= SPREAD_SNR_TERM;
      end
      SPREAD_SNR_TERM: begin
        faint_q <= sure_height < sure_q;
        if (product_valid) begin
          far_dim_q <= height_limit < product[TermWidth-1:0];
          state_q   <= SUM;
        end
      end
      SUM: begin
        far_faint_q <= sure_height < sure_q;
        threshold_q <= threshold_q + (TermWidth + 1)'(background_q);
        core_q      <= core_q + (TermWidth + 1)'(background_q);
        state_q     <= REPLAY;
      end
      REPLAY: begin
        low_clear_q   <= height_q == '0 || (row_q || !even_q ? faint_q : dim_q || far_dim_q);
        low_unclear_q <= height_q == '0 || faint_q || far_faint_q;
        replay_o      <= 1'b1;
        state_q       <= IDLE;
      end
      default: state_q <= IDLE;
    endcase
    if (rst_i) begin
      state_q  <= IDLE;
      start_q  <= 1'b0;
      replay_o <= 1'b0;
    end
  end

  logic                  seen_q, above_q, core_above_q, is_max_q, last_q;
  logic [PixelWidth-1:0] pixel_q;
  logic [IndexWidth-1:0] index_q;
  logic                  first_q;

  // Three lines are under way at once: one gets its threshold, one is compared and one ends.
  // The buffer answers three clocks after replay_o, so the compared line's set changes with its
  // first pixel, and the ending line's a clock later, behind the flags of the one before.
  logic [IndexWidth-1:0] compare_max_index_q, end_max_index_q;
  logic [   TermWidth:0] compare_threshold_q, compare_core_q;
  logic                  replay_q, replay_q2, compare_low_clear_q, end_low_clear_q;
  logic                  compare_low_unclear_q, end_low_unclear_q;
  logic [PixelWidth-1:0] compare_maximum_q, end_maximum_q;
  logic                  saturated, end_saturated_q;
  logic [  GapWidth-1:0] most_gap_q;
  logic [CountWidth-1:0] compare_background_q, end_background_q;
  logic [CountWidth-1:0] compare_noise_q, end_noise_q;
  logic [CountWidth-1:0] compare_spread_q, end_spread_q;
  logic [ UserWidth-1:0] compare_user_q, end_user_q;
  assign saturated = vrscan_pkg::AlignedWidth'(compare_maximum_q) >= peak_i.saturation_level;
  always_ff @(posedge clk_i) begin
    replay_q  <= replay_o;
    replay_q2 <= replay_q;
    if (replay_q2) begin
      compare_threshold_q   <= threshold_q;
      compare_core_q        <= core_q;
      compare_low_clear_q   <= low_clear_q;
      compare_low_unclear_q <= low_unclear_q;
      compare_spread_q      <= spread_q;
      compare_max_index_q   <= max_index_q;
      compare_maximum_q     <= maximum_q;
      compare_background_q  <= background_q;
      compare_noise_q       <= noise_q;
      compare_user_q        <= user_q;
    end
    if (seen_q && first_q) begin
      end_low_clear_q   <= compare_low_clear_q;
      end_low_unclear_q <= compare_low_unclear_q;
      end_spread_q      <= compare_spread_q;
      end_max_index_q   <= compare_max_index_q;
      end_maximum_q     <= compare_maximum_q;
      end_saturated_q   <= saturated;
      most_gap_q        <= peak_i.window_fit ? GapWidth'(MostGap) : '0;
      end_background_q  <= compare_background_q;
      end_noise_q       <= compare_noise_q;
      end_user_q        <= compare_user_q;
    end
    if (rst_i) begin
      replay_q  <= 1'b0;
      replay_q2 <= 1'b0;
    end
  end

  // ---- compare ----
  always_ff @(posedge clk_i) begin
    seen_q   <= pixel_valid_i;
    above_q  <= (TermWidth + 1)'({pixel_i, {CountShift{1'b0}}}) > compare_threshold_q;
    core_above_q <= (TermWidth + 1)'({pixel_i, {CountShift{1'b0}}}) > compare_core_q;
    is_max_q <= index_i == compare_max_index_q;
    last_q   <= last_i;
    pixel_q  <= pixel_i;
    index_q  <= index_i;
    first_q  <= index_i == '0;
    if (rst_i) seen_q <= 1'b0;
  end

  // ---- runs ----
  // A run goes on through a gap; its right end is its last pixel above.
  logic                  in_run_q, has_max_q;  // of the run under way
  logic [  GapWidth-1:0] gap_q;  // pixels behind its last one above
  logic [WindowWidth-1:0] lit_q;  // its pixels above, as far as min_width goes
  logic                  enough_q;  // they are as many
  logic                  before_q, pair_q;  // the pixel before is above; two side by side are
  logic [IndexWidth-1:0] run_left_q, run_right_q;
  logic                  found_q;  // of the line so far
  logic [IndexWidth-1:0] found_left_q, found_right_q;
  logic [WidthWidth-1:0] found_width_q;
  logic                  found_enough_q;

  // The run including this pixel where it is above, the run it ends where it is not.
  logic                  has_max, run_goes_on, run_ends, enough, pair;
  logic [IndexWidth-1:0] run_left, run_right;
  assign has_max     = above_q ? is_max_q || (in_run_q && has_max_q) : has_max_q;
  assign run_left    = above_q && !in_run_q ? index_q : run_left_q;
  assign run_right   = above_q ? index_q : run_right_q;
  assign run_goes_on = (above_q || (in_run_q && gap_q != most_gap_q)) && !last_q;
  assign run_ends    = (above_q || in_run_q) && !run_goes_on;
  assign enough      = enough_q || (above_q && lit_q == below_min_q);
  assign pair        = pair_q || (above_q && before_q);

  logic                  finish_q;
  always_ff @(posedge clk_i) begin
    finish_q <= seen_q && last_q;
    if (seen_q) begin
      in_run_q    <= run_goes_on;
      has_max_q   <= has_max;
      gap_q       <= above_q ? '0 : gap_q + GapWidth'(1);
      lit_q       <= run_goes_on ? lit_q + WindowWidth'(above_q) : '0;
      enough_q    <= run_goes_on && enough;
      before_q    <= run_goes_on && above_q;
      pair_q      <= run_goes_on && pair;
      run_left_q  <= run_left;
      run_right_q <= run_right;
      if (first_q) begin
        found_q        <= 1'b0;
        found_width_q  <= '0;
        found_enough_q <= 1'b0;
      end
      if (run_ends && has_max) begin
        found_q        <= 1'b1;
        found_left_q   <= run_left;
        found_right_q  <= run_right;
        found_enough_q <= enough && pair;
        found_width_q  <= WidthWidth'(run_right) - WidthWidth'(run_left) + WidthWidth'(1);
      end
    end
    if (rst_i) begin
      finish_q <= 1'b0;
      in_run_q <= 1'b0;
      lit_q    <= '0;
      enough_q <= 1'b0;
      before_q <= 1'b0;
      pair_q   <= 1'b0;
    end
  end

  // ---- runs above the core level ----
  logic                  core_in_run_q, core_has_max_q;  // of the run under way
  logic [  GapWidth-1:0] core_gap_q;
  logic [WidthWidth-1:0] core_width_q;  // without gaps; 0 outside of a run
  logic [WindowWidth-1:0] core_part_q;  // pixels without a gap so far, as far as min_width goes
  logic                  core_enough_q;  // a part was as wide as that
  logic                  broad_q, rival_q;  // of the line so far
  logic [RivalWidth-1:0] rivals_q;  // narrow ones, up to MostRivals + 1
  logic                  core_has_max, core_goes_on, core_ends, core_broad, core_enough;
  assign core_has_max = core_above_q ? is_max_q || (core_in_run_q && core_has_max_q)
                                     : core_has_max_q;
  assign core_goes_on = (core_above_q || (core_in_run_q && core_gap_q != most_gap_q)) && !last_q;
  assign core_ends    = (core_above_q || core_in_run_q) && !core_goes_on;
  // This pixel's one is compared with the width and not added to it first: w + 1 > m is
  // 2 w + 1 >= 2 m + 1, and w > m is 2 w >= 2 m + 1.
  assign core_broad  = {WiderWidth'(core_width_q), core_above_q} >= {WiderWidth'(max_core_q), 1'b1};
  assign core_enough = core_enough_q || (core_above_q && core_part_q == below_min_q);
  always_ff @(posedge clk_i) begin
    if (seen_q) begin
      core_in_run_q  <= core_goes_on;
      core_has_max_q <= core_has_max;
      core_gap_q     <= core_above_q ? '0 : core_gap_q + GapWidth'(1);
      core_width_q   <= core_goes_on ? core_width_q + WidthWidth'(core_above_q) : '0;
      core_part_q    <= core_above_q && !last_q ? core_part_q + WindowWidth'(1) : '0;
      core_enough_q  <= core_goes_on && core_enough;
      if (first_q) begin
        broad_q  <= 1'b0;
        rival_q  <= 1'b0;
        rivals_q <= '0;
      end
      if (core_ends && core_has_max) begin
        broad_q <= core_broad;
      end else if (core_ends && core_enough) begin
        rival_q <= 1'b1;
        if (!core_broad && rivals_q <= RivalWidth'(MostRivals))
          rivals_q <= rivals_q + RivalWidth'(1);
      end
    end
    if (rst_i) begin
      core_in_run_q <= 1'b0;
      core_width_q  <= '0;
      core_part_q   <= '0;
      core_enough_q <= 1'b0;
    end
  end

  // ---- the window's pixels ----
  // Pixels go round in the ring until RingMargin of them have followed the run with the maximum;
  // then the bank rests, and the next line uses the other one.
  localparam int unsigned RingWidth = vrscan_pkg::RingWidth;
  localparam int unsigned LateWidth = $clog2(vrscan_pkg::RingMargin + 1);
  logic [PixelWidth-1:0] ring_mem [2 << RingWidth];
  logic                  bank_q;
  logic [PixelWidth-1:0] read_q;
  logic [ LateWidth-1:0] late_q;  // pixels behind the run
  logic                  keep;
  assign keep = seen_q && (first_q || late_q != LateWidth'(vrscan_pkg::RingMargin));
  always_ff @(posedge clk_i) begin
    if (keep) ring_mem[{bank_q, RingWidth'(index_q)}] <= pixel_q;
    read_q       <= ring_mem[{!bank_q, read_index_i}];
    read_pixel_o <= read_q;
    if (seen_q) begin
      if (first_q)              late_q <= '0;
      else if (found_q && keep) late_q <= late_q + LateWidth'(1);
    end
    if (seen_q && last_q) bank_q <= !bank_q;
    if (rst_i) bank_q <= 1'b0;
  end

  // ---- flags ----
  logic clear, low_snr, too_narrow, too_wide;
  assign clear      = !broad_q && rivals_q <= RivalWidth'(MostRivals);
  assign low_snr    = clear ? end_low_clear_q : end_low_unclear_q;
  assign too_narrow = !found_enough_q;
  assign too_wide   = WiderWidth'(found_width_q) > WiderWidth'(max_width_q)
                      || (broad_q && !end_saturated_q);
  always_ff @(posedge clk_i) begin
    valid_o <= finish_q;
    if (finish_q) begin
      measured_o   <= !(low_snr || too_narrow || too_wide);
      left_o       <= found_q ? found_left_q : end_max_index_q;
      right_o      <= found_q ? found_right_q : end_max_index_q;
      width_o      <= found_width_q;
      maximum_o    <= end_maximum_q;
      background_o <= end_background_q;
      noise_o      <= clear || end_noise_q > end_spread_q ? end_noise_q : end_spread_q;
      user_o       <= end_user_q;
      flags_o                            <= '0;
      flags_o[vrscan_pkg::FlagLowSnr]    <= low_snr;
      flags_o[vrscan_pkg::FlagTooNarrow] <= too_narrow;
      flags_o[vrscan_pkg::FlagTooWide]   <= too_wide;
      flags_o[vrscan_pkg::FlagAtEdge]    <=
          found_q && (found_left_q == '0 || found_right_q == IndexWidth'(LineLength - 1));
      flags_o[vrscan_pkg::FlagSaturated] <= end_saturated_q;
      flags_o[vrscan_pkg::FlagRival]     <= rival_q;
    end
    if (rst_i) valid_o <= 1'b0;
  end

endmodule

`default_nettype wire
