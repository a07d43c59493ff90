// peak_refine: the window that suits a spot and its noise, and the slope of the background beside.
//
// |P1| over the sum of the first window's pixels says where a Gaussian is cut, so a table gives its
// sigma.  The second window is 5 to 6.75 sigmas wide, as the ratio of dark variance to the shot
// noise of the peak asks, and lies around the first position; around the middle of the first window
// where that holds a plateau, which has no phase to speak of.  The line's end cuts it; where fewer
// than MinWindow pixels are left, the first window stands.
//
// Four blocks of up to 16 pixels on either side, the nearest an eighth of the window away, give the
// slope.  Light only adds: a pair of blocks at one distance that is brighter than the darkest pair
// by more than noise holds a rival and is left out, as is one that the line's end cuts.  The slope
// is the sum of the differences of the others over the sum of their distances, 0 without any.
//
//   start_i        a line with a window: its statistics hold from here until valid_o
//   valid_i        the harmonic of its first window; holds until valid_o
//   reading_o      read_index_o is to be read: pixels by their index modulo 2**RingWidth, which
//                  come 2 clocks later
//   ramp_o         what the baseline takes off the window's first pixel, and slope_o from pixel to
//                  pixel: aligned counts, RampFraction fraction bits
//   at_edge_o      the window ends at the line's end
//   sigma_o        of the spot, px, SigmaFraction fraction bits
//   Latency  vrscan.fixed.peak_refine.latency() clocks from valid_i, which comes START_LATENCY
//            clocks after start_i at the earliest, to valid_o; either is ignored meanwhile
//   Model    vrscan.fixed.peak_refine, bit-exact

`default_nettype none

module peak_refine #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned MaxWindow  = 255,
  localparam int unsigned IndexWidth = $clog2(LineLength)
) (
  input  wire logic                                          clk_i,
  input  wire logic                                          rst_i,

  input  wire logic                                          start_i,
  input  wire logic        [                 PixelWidth-1:0] maximum_i,
  input  wire logic        [     vrscan_pkg::CountWidth-1:0] background_i,
  input  wire logic        [     vrscan_pkg::CountWidth-1:0] noise_i,
  input  wire logic        [                 IndexWidth-1:0] left_i,

  input  wire logic                                          valid_i,
  input  wire logic        [    vrscan_pkg::WindowWidth-1:0] width_i,
  input  wire logic        [     vrscan_pkg::AngleWidth-1:0] phase_i,
  input  wire logic        [ vrscan_pkg::MagnitudeWidth-1:0] magnitude_i,
  input  wire logic        [       vrscan_pkg::SumWidth-1:0] sum_i,

  output      logic                                          reading_o,
  output      logic        [      vrscan_pkg::RingWidth-1:0] read_index_o,
  input  wire logic        [                 PixelWidth-1:0] read_pixel_i,

  output      logic                                          valid_o,
  output      logic        [                 IndexWidth-1:0] left_o,
  output      logic        [                 IndexWidth-1:0] right_o,
  output      logic        [    vrscan_pkg::WindowWidth-1:0] width_o,
  output      logic                                          at_edge_o,
  output      logic signed [      vrscan_pkg::RampWidth-1:0] ramp_o,
  output      logic signed [vrscan_pkg::SlopeLevelWidth-1:0] slope_o,
  output      logic        [ vrscan_pkg::SpotSigmaWidth-1:0] sigma_o,

  // Configuration.
  input  wire logic        [     vrscan_pkg::KappaWidth-1:0] kappa_i
);

  if (MaxWindow < vrscan_pkg::MinWindow || MaxWindow > 255) begin : gen_bad_window
    $error("peak_refine: MaxWindow must be 3..255");
  end

  localparam int unsigned CountWidth  = vrscan_pkg::CountWidth;
  localparam int unsigned CountShift  = CountWidth - PixelWidth;  // pixel to count format
  localparam int unsigned WindowWidth = vrscan_pkg::WindowWidth;
  localparam int unsigned AngleWidth  = vrscan_pkg::AngleWidth;
  localparam int unsigned SlopeWidth  = vrscan_pkg::SlopeLevelWidth;
  localparam int unsigned RampWidth   = vrscan_pkg::RampWidth;
  localparam int unsigned RingWidth   = vrscan_pkg::RingWidth;
  // Places up to a window beyond either end, in halves.
  localparam int unsigned PlaceWidth  = (IndexWidth > WindowWidth ? IndexWidth : WindowWidth) + 3;

  // ---- one multiplier, one divider ----
  localparam int unsigned AWidth        = SlopeWidth;
  localparam int unsigned BWidth        = CountWidth + 1;
  localparam int unsigned DividendWidth = 38;
  localparam int unsigned DivisorWidth  = 26;
  localparam int unsigned QuotientWidth = 26;
  logic                            multiply_start_q, product_valid;
  logic signed [       AWidth-1:0] a_q;
  logic signed [       BWidth-1:0] b_q;
  logic signed [AWidth+BWidth-1:0] product;
  multiply #(.AWidth(AWidth), .BWidth(BWidth)) u_multiply (
    .clk_i, .rst_i,
    .valid_i  (multiply_start_q),
    .a_i      (a_q),
    .b_i      (b_q),
    .valid_o  (product_valid),
    .product_o(product)
  );

  logic                     divide_start_q, quotient_valid;
  logic [DividendWidth-1:0] dividend_q;
  logic [ DivisorWidth-1:0] divisor_q;
  logic [QuotientWidth-1:0] quotient;
  divide #(
    .DividendWidth(DividendWidth), .DivisorWidth(DivisorWidth), .QuotientWidth(QuotientWidth)
  ) u_divide (
    .clk_i, .rst_i,
    .valid_i   (divide_start_q),
    .dividend_i(dividend_q),
    .divisor_i (divisor_q),
    .valid_o   (quotient_valid),
    .quotient_o(quotient),
    .overflow_o()  // the share's is cut at the table's end; a slope fits
  );

  // What the division leaves of magnitude and sum: a share of 1 is 843 steps, 8 of them an entry.
  localparam int unsigned MagnitudeShift = 12;
  localparam int unsigned SumShift       = 2;
  localparam int unsigned EntryShift     = 3;
  localparam int unsigned TableBits      = 7;
  localparam int unsigned SigmaWidth     = spot_sigma_pkg::SigmaFraction;
  localparam int unsigned WidthShift     = spot_sigma_pkg::SigmaFraction + 3;
  logic unused_magnitude;
  assign unused_magnitude = ^magnitude_i[MagnitudeShift-1:0];

  // Widths in eighths of a sigma, by how many of the limits 5/64, 5/16 and 1 the ratio exceeds.
  function automatic logic [5:0] sigmas(input logic [1:0] rung);
    unique case (rung)
      2'd0:    sigmas = 6'd54;
      2'd1:    sigmas = 6'd52;
      2'd2:    sigmas = 6'd44;
      default: sigmas = 6'd40;
    endcase
  endfunction

  // ---- blocks ----
  localparam int unsigned BlockBits   = 4;  // at most 16 pixels
  localparam int unsigned Pairs       = 4;
  localparam int unsigned SumWidth    = PixelWidth + BlockBits + 1;  // of a pair, below all ones
  localparam int unsigned RiseWidth   = SumWidth + 3;  // of all pairs, signed
  localparam int unsigned SpanWidth   = WindowWidth + 4;  // below 4 (255 + 2 * 31 + 4 * 16)
  localparam int unsigned StepWidth   = BlockBits + 1 + $clog2(Pairs);
  localparam int unsigned ScaleShift  = CountShift + vrscan_pkg::RampFraction
                                        - (CountWidth - vrscan_pkg::AlignedWidth) - BlockBits;

  typedef enum logic [3:0] {
    IDLE, SQUARE, LIGHT, RUNG, SHARE, LOOK, SIGMA, WIDTH, PLACE, BESIDE, READ, PICK, SCALE, SLOPE,
    LEVEL, RAMP
  } state_e;
  state_e                         state_q;
  logic        [   StepWidth-1:0] step_q;

  // Registers that follow their inputs every clock: a state waits until they have settled.
  logic        [  CountWidth-1:0] height_q;  // maximum - background
  logic        [   TableBits-1:0] share_q;
  logic        [  SigmaWidth-1:0] sigma_q;
  logic        [   WindowWidth:0] half_pixels_q;  // from left_i to the position
  logic signed [  PlaceWidth-1:0] centre_q;
  logic        [             9:0] rounded_q;
  logic        [ WindowWidth-1:0] wanted_q;
  logic signed [  PlaceWidth-1:0] first_q, last_q, cut_first_q, cut_last_q, count_q;
  logic                           short_q;
  logic        [             2:0] block_bits_q;
  logic        [     BlockBits:0] block_q;  // its pixels
  logic        [ WindowWidth-4:0] gap_q;
  logic signed [  PlaceWidth-1:0] left_edge_q, right_edge_q;  // last pixels of the gaps
  logic        [   RiseWidth-1:0] size_q;
  logic                           falling_q;
  localparam logic [StepWidth-1:0] PlaceSteps  = StepWidth'(6);  // rounded_q to short_q
  localparam logic [StepWidth-1:0] BesideSteps = StepWidth'(2);  // width_o to the edges

  localparam int unsigned ShotWidth = CountWidth + vrscan_pkg::KappaWidth - 4;
  logic        [2*CountWidth-1:0] dark_q;
  logic        [   ShotWidth-1:0] shot_q;
  logic        [             1:0] rung_q;
  logic        [   WindowWidth:0] position_q;  // of the phase, in half pixels
  logic signed [  PlaceWidth-1:0] left_room_q, right_room_q;  // beyond this pair; negative: cut
  logic        [   RingWidth-1:0] left_place_q, right_place_q;
  logic        [   SpanWidth-1:0] distance_q, span_q;
  logic                           taking;  // a pixel of the block
  assign taking = {1'b0, step_q[BlockBits-1:0]} < block_q;

  // A pixel's part in its pair, while it is read.
  logic [2:0] take_q, right_q, begin_q, end_q;
  logic       ended_q;
  logic        [   SumWidth-1:0] sum_q, least_q;
  logic signed [     SumWidth:0] rise_q;
  // The last one lowest; all ones where a pair is cut.
  logic        [Pairs*SumWidth-1:0]     sums_q;
  logic        [Pairs*(SumWidth+1)-1:0] rises_q;
  logic                          whole;
  assign whole = !left_room_q[PlaceWidth-1] && !right_room_q[PlaceWidth-1];

  // Pairs that are taken: what one is brighter than the least, whether it counts, and the sums.
  logic                           picked_q, picked_q2, whole_q, kept_q2;
  logic        [    SumWidth-1:0] excess_q;
  logic signed [      SumWidth:0] picked_rise_q, picked_rise_q2;
  logic signed [   RiseWidth-1:0] total_q;

  always_ff @(posedge clk_i) begin
    multiply_start_q <= 1'b0;
    divide_start_q   <= 1'b0;
    valid_o          <= 1'b0;
    unique case (state_q)
      IDLE: if (start_i) begin
        a_q              <= AWidth'(signed'({1'b0, noise_i}));
        b_q              <= BWidth'(signed'({1'b0, noise_i}));
        multiply_start_q <= 1'b1;
        state_q          <= SQUARE;
      end else if (valid_i) begin
        dividend_q       <= DividendWidth'(magnitude_i >> MagnitudeShift);
        divisor_q        <= DivisorWidth'(sum_i) << SumShift;
        divide_start_q   <= 1'b1;
        a_q              <= AWidth'(signed'({1'b0, phase_i}));
        b_q              <= BWidth'(signed'({1'b0, width_i}));
        multiply_start_q <= 1'b1;
        state_q          <= SHARE;
      end

      // The dark variance over kappa times the height, while the first window is correlated, against
      // 1, 5/16 and 5/64; kappa has 4 fraction bits more than a count, and an integer above x is one
      // above floor(x).
      SQUARE: if (product_valid) begin
        dark_q           <= product[2*CountWidth-1:0];
        a_q              <= AWidth'(signed'({1'b0, height_q}));
        b_q              <= BWidth'(signed'({1'b0, kappa_i}));
        multiply_start_q <= 1'b1;
        state_q          <= LIGHT;
      end
      LIGHT: if (product_valid) begin
        shot_q  <= ShotWidth'(product >>> 4);
        rung_q  <= '0;
        step_q  <= '0;
        state_q <= RUNG;
      end
      RUNG: begin
        rung_q  <= rung_q + 2'(dark_q > (2 * CountWidth)'(shot_q));
        shot_q  <= step_q == '0 ? ShotWidth'((product + (product <<< 2)) >>> 8) : shot_q >> 2;
        step_q  <= step_q + StepWidth'(1);
        if (step_q == StepWidth'(2)) state_q <= IDLE;
      end

      // The spot's sigma, and the width that is wanted.
      SHARE: begin
        if (product_valid) position_q <= (WindowWidth + 1)'(product >>> (AngleWidth - 1));
        if (quotient_valid) begin
          step_q  <= '0;
          state_q <= LOOK;
        end
      end
      LOOK: begin
        a_q              <= AWidth'(signed'({1'b0, sigma_q}));
        b_q              <= BWidth'(signed'({1'b0, width_i}));
        step_q           <= step_q + StepWidth'(1);
        multiply_start_q <= step_q[0];
        if (step_q[0]) state_q <= SIGMA;
      end
      SIGMA: if (product_valid) begin
        sigma_o          <= vrscan_pkg::SpotSigmaWidth'(product);
        a_q              <= AWidth'(product);
        b_q              <= BWidth'(signed'({1'b0, sigmas(rung_q)}));
        multiply_start_q <= 1'b1;
        state_q          <= WIDTH;
      end
      WIDTH: begin
        step_q <= '0;
        if (product_valid) state_q <= PLACE;
      end

      // Its place, and where the blocks beside it begin.
      PLACE: begin
        step_q  <= step_q + StepWidth'(1);
        left_o  <= short_q ? left_i : IndexWidth'(cut_first_q);
        right_o <= short_q ? left_i + IndexWidth'(width_i) - IndexWidth'(1)
                           : IndexWidth'(cut_last_q);
        width_o <= short_q ? width_i : WindowWidth'(count_q);
        if (step_q == PlaceSteps) begin
          step_q  <= '0;
          state_q <= BESIDE;
        end
      end
      BESIDE: begin
        step_q        <= step_q + StepWidth'(1);
        at_edge_o     <= left_o == '0 || right_o == IndexWidth'(LineLength - 1);
        left_room_q   <= left_edge_q - PlaceWidth'(block_q);
        right_room_q  <= PlaceWidth'(LineLength - 1) - right_edge_q - PlaceWidth'(block_q);
        left_place_q  <= RingWidth'(left_edge_q) - RingWidth'(1);
        right_place_q <= RingWidth'(right_edge_q) + RingWidth'(1);
        distance_q    <= SpanWidth'(width_o) + (SpanWidth'(gap_q) << 1) + SpanWidth'(block_q);
        span_q        <= '0;
        total_q       <= '0;
        least_q       <= '1;
        if (step_q == BesideSteps) begin
          step_q    <= '0;
          reading_o <= 1'b1;
          state_q   <= READ;
        end
      end
      READ: begin
        // After the last step no pixel is taken until the last pair is in.
        if (step_q != '1) step_q <= step_q + StepWidth'(1);
        if (taking && !step_q[BlockBits]) left_place_q <= left_place_q - RingWidth'(1);
        if (taking && step_q[BlockBits]) right_place_q <= right_place_q + RingWidth'(1);
        if (ended_q) begin
          sums_q  <= (Pairs * SumWidth)'({sums_q, whole ? sum_q : {SumWidth{1'b1}}});
          rises_q <= (Pairs * (SumWidth + 1))'({rises_q, unsigned'(rise_q)});
          if (whole && sum_q < least_q) least_q <= sum_q;
          left_room_q  <= left_room_q - PlaceWidth'(block_q);
          right_room_q <= right_room_q - PlaceWidth'(block_q);
        end
        if (ended_q && step_q == '1) begin
          step_q  <= '0;
          state_q <= PICK;
        end
      end
      PICK: begin
        step_q <= step_q + StepWidth'(1);
        sums_q  <= sums_q << SumWidth;
        rises_q <= rises_q << (SumWidth + 1);
        if (picked_q2) begin
          if (kept_q2) begin
            total_q <= total_q + RiseWidth'(picked_rise_q2);
            span_q  <= span_q + distance_q;
          end
          distance_q <= distance_q + (SpanWidth'(block_q) << 1);
        end
        if (step_q == StepWidth'(Pairs + 1)) begin
          step_q  <= '0;
          state_q <= SCALE;
        end
      end
      SCALE: begin
        // For size_q to follow, and for the division to take it.
        reading_o      <= 1'b0;
        step_q         <= step_q + StepWidth'(1);
        dividend_q     <= DividendWidth'(size_q) << (6'(ScaleShift + BlockBits) - 6'(block_bits_q));
        divisor_q      <= DivisorWidth'(span_q);
        divide_start_q <= step_q[0];
        if (step_q[0]) state_q <= SLOPE;
      end
      SLOPE: if (quotient_valid) begin
        slope_o <= span_q == '0 ? '0
                   : falling_q ? SlopeWidth'(0) - SlopeWidth'(quotient) : SlopeWidth'(quotient);
        state_q <= LEVEL;
      end
      LEVEL: begin
        a_q              <= slope_o;
        b_q              <= BWidth'(signed'({1'b0, width_o})) - BWidth'(1);
        multiply_start_q <= 1'b1;
        state_q          <= RAMP;
      end
      RAMP: if (product_valid) begin
        ramp_o  <= RampWidth'(0) - RampWidth'(product >>> 1);  // in the window's middle it is 0
        valid_o <= 1'b1;
        state_q <= IDLE;
      end
      default: state_q <= IDLE;
    endcase
    if (rst_i) begin
      state_q          <= IDLE;
      multiply_start_q <= 1'b0;
      divide_start_q   <= 1'b0;
      reading_o        <= 1'b0;
      valid_o          <= 1'b0;
    end
  end

  // ---- what follows its inputs ----
  logic signed [PlaceWidth-1:0] next_first;
  assign next_first = first_q + PlaceWidth'(1);
  always_ff @(posedge clk_i) begin
    height_q <= (CountWidth'(maximum_i) << CountShift) - background_i;

    share_q       <= |quotient[QuotientWidth-1:EntryShift+TableBits]
                     ? '1 : quotient[EntryShift+:TableBits];
    sigma_q       <= spot_sigma_pkg::sigma(share_q);
    half_pixels_q <= sigma_q == spot_sigma_pkg::Largest
                     ? (WindowWidth + 1)'(width_i) - (WindowWidth + 1)'(1) : position_q;
    centre_q      <= PlaceWidth'(signed'({1'b0, left_i, 1'b0}))
                     + PlaceWidth'(signed'({1'b0, half_pixels_q}));

    // To nearest, half up; at most half of 255, 6.75 times.
    rounded_q <= 10'((product + (AWidth + BWidth)'(1 << (WidthShift - 1))) >>> WidthShift);
    wanted_q  <= rounded_q < 10'(vrscan_pkg::MinWindow) ? WindowWidth'(vrscan_pkg::MinWindow)
                 : rounded_q > 10'(MaxWindow) ? WindowWidth'(MaxWindow) : WindowWidth'(rounded_q);
    // To nearest, half up: floor(x / 2 + 1), the 1 in what follows.
    first_q     <= (centre_q - PlaceWidth'(signed'({1'b0, wanted_q}))) >>> 1;
    last_q      <= first_q + PlaceWidth'(signed'({1'b0, wanted_q}));
    cut_first_q <= next_first < 0 ? '0 : next_first;
    cut_last_q  <= last_q > PlaceWidth'(LineLength - 1) ? PlaceWidth'(LineLength - 1) : last_q;
    count_q     <= cut_last_q - cut_first_q + PlaceWidth'(1);
    short_q     <= count_q < PlaceWidth'(vrscan_pkg::MinWindow);

    block_bits_q <= width_o[WindowWidth-1:4] != '0 ? 3'd4 : width_o[3] ? 3'd3
                    : width_o[2] ? 3'd2 : 3'd1;
    block_q      <= (BlockBits + 1)'(1) << block_bits_q;
    gap_q        <= width_o[WindowWidth-1:3];
    left_edge_q  <= PlaceWidth'(signed'({1'b0, left_o})) - PlaceWidth'(gap_q);
    right_edge_q <= PlaceWidth'(signed'({1'b0, right_o})) + PlaceWidth'(gap_q);

    falling_q <= total_q < 0;
    size_q    <= total_q < 0 ? RiseWidth'(-total_q) : RiseWidth'(total_q);
  end

  // ---- the pairs' sums: a pixel comes two clocks behind its index ----
  always_ff @(posedge clk_i) begin
    read_index_o <= step_q[BlockBits] ? right_place_q : left_place_q;
    take_q  <= {take_q[1:0], taking};
    right_q <= {right_q[1:0], step_q[BlockBits]};
    begin_q <= {begin_q[1:0], step_q[BlockBits:0] == '0};
    end_q   <= {end_q[1:0], state_q == READ && step_q[BlockBits:0] == '1};
    ended_q <= end_q[2];
    if (begin_q[2]) begin
      sum_q  <= SumWidth'(read_pixel_i);
      rise_q <= (SumWidth + 1)'(0) - (SumWidth + 1)'(read_pixel_i);
    end else if (take_q[2]) begin
      sum_q  <= sum_q + SumWidth'(read_pixel_i);
      rise_q <= right_q[2] ? rise_q + (SumWidth + 1)'(read_pixel_i)
                           : rise_q - (SumWidth + 1)'(read_pixel_i);
    end

    picked_q       <= state_q == PICK && step_q < StepWidth'(Pairs);
    whole_q        <= sums_q[Pairs*SumWidth-1-:SumWidth] != '1;
    excess_q       <= sums_q[Pairs*SumWidth-1-:SumWidth] - least_q;
    picked_rise_q  <= signed'(rises_q[Pairs*(SumWidth+1)-1-:SumWidth+1]);
    picked_q2      <= picked_q;
    // 32 noises, in the sum's format: the upper bits of one noise, as a pair has up to 32 pixels.
    kept_q2        <= whole_q && excess_q <= noise_i[CountWidth-1-:SumWidth];
    picked_rise_q2 <= picked_rise_q;
  end

endmodule

`default_nettype wire
