// peak_neighbours: what the lines before and behind say of a line's spot.
//
// A spot of which an edge cuts off a part lacks light and has another width than those beside it.
// Both put its place in doubt, by shares of its width that are added to sigma in squares: a quarter
// of what two widths differ by beyond their noise and 1/256 of the distance of their places, which
// is the surface's, and 3/16 of the share of light that is missing.
// Light over the laser's power is compared with that of the brighter neighbour; up to a quarter of
// it may be missing from a spot in a row with both.  A spot is mixed where it has less than 1/4 of
// that light and about that one's width, within 3/2, or less than half of each neighbour's; less
// than 7/16, less than half of each and that width, within 9/8; and less than 5/16 beside a line
// without a spot.  A spot is astray there, or out of the row by four widths and by a quarter of the
// distance of its neighbours, which grows with the turn of the mirror from line to line.  Then it
// is mixed where it has less than 1/8; less than 11/16 and is narrower than both by 9/8; less than
// 15/16, narrower than both by 17/16 and than one by 5/3; less than 9/8 and narrower than each that
// is there by 3/2; and with any light where it is so by 7/4.
//
//   valid_i    a line's spot; valid_o follows with that of the line before it, and user_i with it
//   scale_i    half of the spot's width at half of its height, px, 12 fraction bits
//   light_i    sum of its heights
//   sigma_o    standard deviation of the position, px, with the doubt in it; what came in where
//              there is no position, as where both neighbours leave no doubt
//   typical_o  the same with a quarter of the doubt: most spots that lack light are whole
//   doubt_o    what the neighbours add to sigma_o, in squares; px
//   A line after which none comes for NeighbourClks clocks, or until flush_i, is given without one
//   behind it, and is no neighbour of the next.
//   Latency    vrscan.fixed.peak_neighbours.LATENCY clocks from valid_i, or from the end of the
//              wait, to valid_o; a valid_i meanwhile waits for that.  The inputs have to hold until
//              then, and a clock more
//   Model      vrscan.fixed.peak_neighbours, bit-exact

`default_nettype none

module peak_neighbours #(
  parameter  int unsigned LineLength    = 2048,
  parameter  int unsigned NeighbourClks = vrscan_pkg::NeighbourClks,
  parameter  int unsigned UserWidth     = 8,
  localparam int unsigned PositionWidth = $clog2(LineLength) + 1 + vrscan_pkg::PositionFraction
) (
  input  wire logic                                     clk_i,
  input  wire logic                                     rst_i,

  input  wire logic                                     valid_i,
  input  wire logic                                     measured_i,
  input  wire logic signed [         PositionWidth-1:0] position_i,
  input  wire logic        [vrscan_pkg::SigmaWidth-1:0] sigma_i,
  input  wire logic        [vrscan_pkg::ScaleWidth-1:0] scale_i,
  input  wire logic        [  vrscan_pkg::SumWidth-1:0] light_i,
  input  wire logic        [vrscan_pkg::PowerWidth-1:0] power_i,
  input  wire logic        [             UserWidth-1:0] user_i,
  input  wire logic                                     flush_i,

  output      logic                                     valid_o,
  output      logic        [vrscan_pkg::SigmaWidth-1:0] sigma_o,
  output      logic        [vrscan_pkg::SigmaWidth-1:0] typical_o,
  output      logic        [vrscan_pkg::SigmaWidth-1:0] doubt_o,
  output      logic                                     mixed_o,
  output      logic        [             UserWidth-1:0] user_o
);

  localparam int unsigned SigmaWidth    = vrscan_pkg::SigmaWidth;
  localparam int unsigned ScaleWidth    = vrscan_pkg::ScaleWidth;
  localparam int unsigned LightFraction = 8;
  localparam int unsigned LightWidth    = vrscan_pkg::SumWidth + LightFraction;
  localparam int unsigned ShareFraction = 14;
  localparam int unsigned DividendWidth = LightWidth + ShareFraction;
  localparam int unsigned FactorWidth   = 18;
  localparam int unsigned SquareWidth   = 2 * FactorWidth;
  localparam int unsigned RootWidth     = FactorWidth;
  localparam int unsigned BendWidth     = PositionWidth + 2;
  localparam int unsigned Turn          = 8;
  localparam int unsigned TurnWidth     = PositionWidth + 1 - Turn;
  localparam logic [LightWidth-1:0] Whole    = LightWidth'(1 << ShareFraction);
  localparam logic [LightWidth-1:0] Dark     = Whole >> 3;
  localparam logic [LightWidth-1:0] Faint    = Whole >> 2;
  localparam logic [LightWidth-1:0] Single   = (Whole >> 2) + (Whole >> 4);
  localparam logic [LightWidth-1:0] Dim      = (Whole >> 1) - (Whole >> 4);
  localparam logic [LightWidth-1:0] Bright   = (Whole >> 1) + (Whole >> 3) + (Whole >> 4);
  localparam logic [LightWidth-1:0] Fair     = Whole - (Whole >> 4);
  localparam logic [LightWidth-1:0] Brighter = Whole + (Whole >> 3);
  localparam logic [LightWidth-1:0] Steady   = Whole - (Whole >> 2);

  // ---- three lines ----
  typedef struct packed {
    logic                            measured;
    logic signed [PositionWidth-1:0] position;
    logic        [   SigmaWidth-1:0] sigma;
    logic        [   ScaleWidth-1:0] scale;
    logic        [   LightWidth-1:0] light;  // over the laser's power
  } spot_t;
  spot_t                before_q, centre_q, after_q;
  logic                 before_there_q, centre_there_q, after_there_q;
  logic [UserWidth-1:0] centre_user_q, after_user_q;

  // ---- one multiplier, one divider, one root ----
  typedef enum logic [4:0] {
    IDLE, LIGHT, RANK, SHARE, MISSING, FACTORS, CUT, OWN, BEFORE, BEFORE_WIDTH, AFTER, AFTER_WIDTH,
    CUT_SQUARE, ADDED, DOUBT, TYPICAL, WHOLE
  } state_e;
  state_e                         state_q;
  logic                           multiply_start_q, product_valid;
  logic signed [ FactorWidth-1:0] a_q, b_q;
  logic signed [ SquareWidth-1:0] product;
  logic                           divide_start_q, quotient_valid;
  logic        [DividendWidth-1:0] dividend_q;
  logic        [   LightWidth-1:0] divisor_q, quotient;
  logic                           root_start_q, root_valid;
  logic        [ SquareWidth-1:0] radicand_q;
  logic        [   RootWidth-1:0] root;

  multiply #(.AWidth(FactorWidth), .BWidth(FactorWidth)) u_multiply (
    .clk_i, .rst_i,
    .valid_i(multiply_start_q), .a_i(a_q), .b_i(b_q), .valid_o(product_valid), .product_o(product)
  );
  divide #(
    .DividendWidth(DividendWidth), .DivisorWidth(LightWidth), .QuotientWidth(LightWidth)
  ) u_divide (
    .clk_i, .rst_i,
    .valid_i(divide_start_q), .dividend_i(dividend_q), .divisor_i(divisor_q),
    .valid_o(quotient_valid), .quotient_o(quotient),
    .overflow_o()  // all ones is the saturation
  );
  square_root #(.RootWidth(RootWidth)) u_square_root (
    .clk_i, .rst_i,
    .valid_i(root_start_q), .radicand_i(radicand_q), .valid_o(root_valid), .root_o(root)
  );

  // ---- the middle one and those beside it, [1] before and [0] behind ----
  logic [1:0]                           there;
  logic [1:0][LightWidth-1:0]           light;
  logic [1:0][ScaleWidth-1:0]           scale;
  logic [1:0][PositionWidth-1:0]        position;
  assign there    = {before_q.measured, after_q.measured};
  assign light[1] = before_q.measured ? before_q.light : '0;
  assign light[0] = after_q.measured ? after_q.light : '0;
  assign scale    = {before_q.scale, after_q.scale};
  assign position = {before_q.position, after_q.position};

  // Two widths, the smaller one and the larger one; by how much they differ beyond what the surface
  // may make of it, and by which of the ratios 17/16, 9/8, 3/2, 5/3 and 7/4.  What is not ready in
  // one clock is registered: all this is read after the division, dozens of clocks later.
  localparam int unsigned RatioWidth = ScaleWidth + 5;
  logic [1:0][ScaleWidth-1:0]   small_q, large_q, differ_q;
  logic [1:0][RatioWidth-1:0]   seventeen_q, nine_q, seven_q, five_q, three_q;  // times the smaller
  logic [1:0][RatioWidth-1:0]   thrice_q;                                       // the larger
  logic [1:0][PositionWidth:0]  apart_q, distance_q;
  logic [1:0][FactorWidth-2:0]  difference_q;
  logic [1:0]                   thin_q, unlike_q, remote_q, wide_q, least_q, below_q, dimmer_q;
  logic [LightWidth-1:0]        brightest_q, share_q;
  logic signed [BendWidth-1:0]  bend_q, between_q;
  logic        [BendWidth-1:0]  row_q, gap_q;
  logic                         brighter_q, out_of_row_q, strayed_q, alone_q, astray_q;
  logic                         narrower_q, thinner_q, slender_q, slimmest_q;
  logic                         mixed_astray_q, mixed_q;
  function automatic logic [FactorWidth-2:0] beyond(
      input logic [ScaleWidth-1:0] difference, input logic [TurnWidth-1:0] turn);
    logic [RatioWidth-1:0] left;  // a long line's turn is wider than a width
    left   = RatioWidth'(difference) > RatioWidth'(turn)
             ? RatioWidth'(difference) - RatioWidth'(turn) : '0;
    beyond = |left[RatioWidth-1:FactorWidth-1] ? '1 : left[FactorWidth-2:0];
  endfunction
  function automatic logic [RatioWidth-1:0] shifted(
      input logic [ScaleWidth-1:0] value, input int unsigned by);
    shifted = RatioWidth'(value) << by;
  endfunction
  // Both factors of a square, and the start.
  function automatic logic [2*FactorWidth:0] squared(input logic [FactorWidth-2:0] value);
    squared = {1'b0, value, 1'b0, value, 1'b1};
  endfunction
  always_ff @(posedge clk_i) if (state_q != IDLE) begin
    for (int unsigned k = 0; k < 2; k++) begin
      small_q[k]      <= centre_q.scale < scale[k] ? centre_q.scale : scale[k];
      large_q[k]      <= centre_q.scale < scale[k] ? scale[k] : centre_q.scale;
      below_q[k]      <= there[k] && centre_q.scale < scale[k];
      seventeen_q[k]  <= shifted(small_q[k], 4) + shifted(small_q[k], 0);
      nine_q[k]       <= shifted(small_q[k], 3) + shifted(small_q[k], 0);
      seven_q[k]      <= shifted(small_q[k], 3) - shifted(small_q[k], 0);
      five_q[k]       <= shifted(small_q[k], 2) + shifted(small_q[k], 0);
      three_q[k]      <= shifted(small_q[k], 1) + shifted(small_q[k], 0);
      thrice_q[k]     <= shifted(large_q[k], 1) + shifted(large_q[k], 0);
      thin_q[k]       <= shifted(large_q[k], 4) > seventeen_q[k];
      unlike_q[k]     <= shifted(large_q[k], 3) > nine_q[k];
      remote_q[k]     <= shifted(large_q[k], 1) > three_q[k];
      wide_q[k]       <= thrice_q[k] > five_q[k];
      least_q[k]      <= shifted(large_q[k], 2) > seven_q[k];
      apart_q[k]      <= (PositionWidth + 1)'(signed'(position[k]))
                         - (PositionWidth + 1)'(centre_q.position);
      distance_q[k]   <= apart_q[k][PositionWidth] ? -apart_q[k] : apart_q[k];
      differ_q[k]     <= large_q[k] - small_q[k];
      difference_q[k] <= beyond(differ_q[k], distance_q[k][PositionWidth:Turn]);
      dimmer_q[k]     <= !there[k] || {1'b0, light[k]} > {centre_q.light, 1'b0};
    end
    brightest_q    <= light[1] > light[0] ? light[1] : light[0];
    brighter_q     <= light[1] > light[0];
    bend_q         <= BendWidth'(before_q.position) + BendWidth'(after_q.position)
                      - (BendWidth'(centre_q.position) <<< 1);
    row_q          <= unsigned'(bend_q < 0 ? -bend_q : bend_q);
    between_q      <= BendWidth'(before_q.position) - BendWidth'(after_q.position);
    gap_q          <= unsigned'(between_q < 0 ? -between_q : between_q);
    out_of_row_q   <= row_q > BendWidth'({centre_q.scale, 2'b0});
    strayed_q      <= {row_q, 2'b0} > {2'b0, gap_q};
    alone_q        <= !(&there) || out_of_row_q;
    astray_q       <= !(&there) || (out_of_row_q && strayed_q);
    narrower_q     <= &(below_q & unlike_q);
    thinner_q      <= &(below_q & thin_q) && |wide_q;
    slender_q      <= &(~there | (below_q & remote_q));
    slimmest_q     <= &(~there | (below_q & least_q)) && |there;
    mixed_astray_q <= slimmest_q || share_q < Dark || (share_q < Bright && narrower_q)
                      || (share_q < Fair && thinner_q) || (share_q < Brighter && slender_q);
    mixed_q        <= (share_q < Faint && (&dimmer_q || !remote_q[brighter_q]))
                      || (share_q < Dim && &dimmer_q && !unlike_q[brighter_q])
                      || (share_q < Single && !(&there)) || (astray_q && mixed_astray_q);
  end

  // A difference's noise is that of both widths, and an eighth of a pixel of each by where the pixels
  // lie.
  localparam logic [SquareWidth-1:0] PixelNoise = SquareWidth'(1 << 18);  // px squared
  logic        [  SquareWidth-1:0] own_q, noise_q, added_q;
  logic signed [    SquareWidth:0] over_q, excess_q;  // excess_q follows over_q by two clocks
  logic                            more_q;
  logic        [   LightWidth-1:0] limit;
  logic        [  ShareFraction:0] missing_q;
  logic        [  FactorWidth-2:0] cut_q;
  assign limit = alone_q ? Whole : Steady;

  logic [SigmaWidth-1:0] limited;
  assign limited = |root[RootWidth-1:SigmaWidth] ? '1 : root[SigmaWidth-1:0];

  localparam int unsigned WaitWidth = $clog2(NeighbourClks + 1);
  logic [WaitWidth-1:0] waited_q;
  logic                 pending_q, late_q, comes, take, take_q;
  assign comes = valid_i || pending_q;
  assign take  = state_q == IDLE && (comes || late_q);

  // What passes goes with the lines; its output changes with the first one of the results.
  wide_register #(.Width(UserWidth)) u_after_user (
    .clk_i, .take_i(take), .hold_i(1'b0), .d_i(user_i), .q_o(after_user_q)
  );
  wide_register #(.Width(UserWidth)) u_centre_user (
    .clk_i, .take_i(take), .hold_i(1'b0), .d_i(after_user_q), .q_o(centre_user_q)
  );
  wide_register #(.Width(UserWidth)) u_user (
    .clk_i, .take_i(state_q == DOUBT && root_valid), .hold_i(1'b0), .d_i(centre_user_q),
    .q_o(user_o)
  );

  always_ff @(posedge clk_i) begin
    multiply_start_q <= 1'b0;
    divide_start_q   <= 1'b0;
    root_start_q     <= 1'b0;
    valid_o          <= 1'b0;
    pending_q        <= comes && state_q != IDLE;
    waited_q         <= late_q ? waited_q : waited_q + WaitWidth'(1);
    take_q           <= take;
    more_q           <= state_q == CUT_SQUARE && after_q.measured && over_q > excess_q;
    if (take_q) begin
      before_q          <= centre_q;
      before_q.measured <= before_there_q && centre_q.measured;
      centre_q          <= after_q;
      after_q.measured  <= after_there_q && measured_i;
      after_q.position  <= position_i;
      after_q.sigma     <= sigma_i;
      after_q.scale     <= scale_i;
    end
    late_q           <= after_there_q && (flush_i || waited_q >= WaitWidth'(NeighbourClks - 2));
    unique case (state_q)
      IDLE: begin
        dividend_q <= DividendWidth'(light_i) << LightFraction;
        divisor_q  <= LightWidth'(power_i);
        if (take) begin
          before_there_q <= centre_there_q;
          centre_there_q <= after_there_q;
          after_there_q  <= comes;
          waited_q       <= '0;
          late_q         <= 1'b0;
          divide_start_q <= 1'b1;
          state_q        <= LIGHT;
        end
      end
      LIGHT: if (quotient_valid) begin
        after_q.light <= quotient;
        state_q       <= centre_there_q ? RANK : IDLE;
      end
      RANK: state_q <= SHARE;
      SHARE: begin
        dividend_q     <= DividendWidth'(centre_q.light) << ShareFraction;
        divisor_q      <= brightest_q;
        divide_start_q <= 1'b1;
        state_q        <= MISSING;
      end
      MISSING: if (quotient_valid) begin
        share_q   <= quotient;
        missing_q <= (ShareFraction + 1)'(limit > quotient ? limit - quotient : '0);
        state_q   <= FACTORS;
      end
      FACTORS: begin
        a_q              <= FactorWidth'({missing_q, 1'b0}) + FactorWidth'(missing_q);
        b_q              <= FactorWidth'(centre_q.scale >> 1);
        multiply_start_q <= 1'b1;
        state_q          <= CUT;
      end
      CUT: if (product_valid) begin
        cut_q   <= (FactorWidth - 1)'(product >>> (ShareFraction + 3));
        {a_q, b_q, multiply_start_q} <= squared((FactorWidth - 1)'(centre_q.sigma));
        state_q <= OWN;
      end
      OWN: if (product_valid) begin
        own_q   <= product;
        {a_q, b_q, multiply_start_q} <= squared((FactorWidth - 1)'(before_q.sigma));
        state_q <= BEFORE;
      end
      BEFORE: if (product_valid) begin
        noise_q <= own_q + product + PixelNoise;
        {a_q, b_q, multiply_start_q} <= squared(difference_q[1]);
        state_q <= BEFORE_WIDTH;
      end
      BEFORE_WIDTH: if (product_valid) begin
        over_q  <= (SquareWidth + 1)'(product) - signed'({noise_q, 1'b0});
        {a_q, b_q, multiply_start_q} <= squared((FactorWidth - 1)'(after_q.sigma));
        state_q  <= AFTER;
      end
      AFTER: begin
        excess_q <= before_q.measured && over_q > 0 ? over_q : '0;
        if (product_valid) begin
          noise_q <= own_q + product + PixelNoise;
          {a_q, b_q, multiply_start_q} <= squared(difference_q[0]);
          state_q <= AFTER_WIDTH;
        end
      end
      AFTER_WIDTH: if (product_valid) begin
        over_q   <= (SquareWidth + 1)'(product) - signed'({noise_q, 1'b0});
        {a_q, b_q, multiply_start_q} <= squared(cut_q);
        state_q  <= CUT_SQUARE;
      end
      CUT_SQUARE: begin
        if (more_q) excess_q <= over_q;
        if (product_valid) begin
          added_q <= SquareWidth'(unsigned'(excess_q) >> 4) + product;
          state_q <= ADDED;
        end
      end
      ADDED: begin
        radicand_q   <= added_q;
        root_start_q <= 1'b1;
        state_q      <= DOUBT;
      end
      DOUBT: if (root_valid) begin
        doubt_o      <= centre_q.measured ? limited : '0;
        radicand_q   <= own_q + (added_q >> 4);
        root_start_q <= 1'b1;
        state_q      <= TYPICAL;
      end
      TYPICAL: if (root_valid) begin
        typical_o    <= centre_q.measured ? limited : centre_q.sigma;
        radicand_q   <= own_q + added_q;
        root_start_q <= 1'b1;
        state_q      <= WHOLE;
      end
      WHOLE: if (root_valid) begin
        valid_o        <= 1'b1;
        sigma_o        <= centre_q.measured ? limited : centre_q.sigma;
        mixed_o        <= centre_q.measured && mixed_q;
        state_q        <= IDLE;
      end
      default: state_q <= IDLE;
    endcase
    if (rst_i) begin
      state_q          <= IDLE;
      multiply_start_q <= 1'b0;
      divide_start_q   <= 1'b0;
      root_start_q     <= 1'b0;
      valid_o          <= 1'b0;
      centre_there_q   <= 1'b0;
      after_there_q    <= 1'b0;
      pending_q        <= 1'b0;
      late_q           <= 1'b0;
      waited_q         <= '0;
    end
  end

endmodule

`default_nettype wire
