// line_statistics: maximum, mean, variance and background of a line, in the one pass it comes in.
//
// Sums and sums of squares are kept per block of 64 pixels; the row's are the sums of the blocks.
// Background and noise are those beside the maximum: of the pairs of whole blocks at one distance
// from the maximum's, from 2 to 2 GuardBlocks away, the darkest ones, at most GuardBlocks of them
// and no more than there are beyond the guard.  Flanks of a spot are in the blocks next to the
// maximum's, a window of MaxWindow reaches GuardBlocks at most, and light only adds, so the darkest
// hold neither spot nor rival.  A pair's mean is that of the
// maximum's place on a slope, and the noise is pooled from within parts of 16 pixels, so a gradient
// is hardly any.  At the line's end a block counts for its missing partner too.  The
// spread is that of all blocks beyond the guard.  Where no whole block is beyond it, or noise_row_i
// asks for it, the row decides, as the paper has it.
//
// Moments are exact: n^2 var = n sum(p^2) - sum(p)^2 in integers, and only results are rounded.
// Everything after the last pixel shares one multiplier, one divider and one square root.
//
//   row_mean_o, background_o,
//   noise_o, spread_o                  counts, 24 - PixelWidth fraction bits, to nearest
//   row_variance_o                     counts^2, 32 - 2 PixelWidth fraction bits, to nearest
//   Latency  vrscan.fixed.line_statistics.latency() clocks from good_i to valid_o, whatever the
//            line; the next good_i may come in the clock of valid_o
//   Model    vrscan.fixed.line_statistics, bit-exact

`default_nettype none

module line_statistics #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned MaxWindow  = 255,
  parameter int unsigned UserWidth  = 8,
  localparam int unsigned IndexWidth = $clog2(LineLength)
) (
  input  wire logic                                 clk_i,
  input  wire logic                                 rst_i,

  input  wire logic                                 valid_i,
  input  wire logic [               PixelWidth-1:0] pixel_i,
  input  wire logic [               IndexWidth-1:0] index_i,
  input  wire logic                                 good_i,
  input  wire logic [                UserWidth-1:0] user_i,  // sampled with good_i

  output      logic                                 valid_o,
  output      logic [               PixelWidth-1:0] maximum_o,
  output      logic [               IndexWidth-1:0] max_index_o,  // the first one
  output      logic [   vrscan_pkg::CountWidth-1:0] row_mean_o,
  output      logic [vrscan_pkg::VarianceWidth-1:0] row_variance_o,
  output      logic [   vrscan_pkg::CountWidth-1:0] background_o,
  output      logic [   vrscan_pkg::CountWidth-1:0] noise_o,
  output      logic [   vrscan_pkg::CountWidth-1:0] spread_o,
  output      logic                                 row_statistics_o,  // no block was left
  output      logic [                UserWidth-1:0] user_o,

  // Configuration.
  input  wire logic                                 noise_row_i
);

  if (LineLength < vrscan_pkg::BlockLength || PixelWidth < 8 || PixelWidth > 16
      || MaxWindow > 255) begin : gen_bad_size
    $error("line_statistics: LineLength >= 64, PixelWidth 8..16 and MaxWindow <= 255 are legal");
  end

  localparam int unsigned BlockBits = $clog2(vrscan_pkg::BlockLength);
  localparam int unsigned Blocks =
      (LineLength + vrscan_pkg::BlockLength - 1) / vrscan_pkg::BlockLength;
  localparam int unsigned LastLength = LineLength - (Blocks - 1) * vrscan_pkg::BlockLength;
  localparam int unsigned BlockIndexWidth = Blocks > 1 ? $clog2(Blocks) : 1;
  localparam int unsigned GuardBlocks =
      (MaxWindow + vrscan_pkg::BlockLength - 1) / vrscan_pkg::BlockLength;
  localparam int unsigned WholeBlocks   = LineLength / vrscan_pkg::BlockLength;
  localparam int unsigned Pairs         = 2 * GuardBlocks;
  localparam int unsigned PairBits      = $clog2(Pairs);
  localparam int unsigned DistanceWidth = $clog2(Pairs + 1);

  // n pixels of at most 2**P - 1: sums below n 2**P, squares below n 2**2P.
  localparam int unsigned BlockSumWidth    = PixelWidth + BlockBits;
  localparam int unsigned BlockSquareWidth = 2 * PixelWidth + BlockBits;
  localparam int unsigned SumWidth         = PixelWidth + IndexWidth;
  localparam int unsigned SquareWidth      = 2 * PixelWidth + IndexWidth;
  localparam int unsigned LengthWidth      = $clog2(LineLength + 1);
  // Within the parts of a block, of a pair and of all pairs that are kept: n^2 var, summed.
  localparam int unsigned PartBits         = $clog2(vrscan_pkg::PartLength);
  localparam int unsigned PartSumWidth     = PixelWidth + PartBits;
  localparam int unsigned WithinWidth      = 2 * PixelWidth + BlockBits + PartBits - 2;
  localparam int unsigned PairSumWidth     = BlockSumWidth + 1;
  localparam int unsigned PairMomentWidth  = WithinWidth + 1;
  localparam int unsigned LocalMomentWidth = PairMomentWidth + $clog2(GuardBlocks);
  // n^2 var <= (n (2**P - 1) / 2)^2 < 2**MomentWidth; the kept pairs are never more than the line.
  localparam int unsigned MomentWidth      = 2 * (PixelWidth + IndexWidth) - 2;
  // The root of n^2 var carries four fraction bits: 0.03 counts / n.
  localparam int unsigned RootFraction     = 4;
  localparam int unsigned RootWidth        = MomentWidth / 2 + RootFraction;

  // ---- the pass: pixel, square, block, row ----
  logic                         valid_q, valid_q2, block_done_q;
  logic                         good_q, good_q2, good_q3, good_q4, good_q5, good_q6;
  logic [       PixelWidth-1:0] pixel_q, pixel_q2;
  logic [       IndexWidth-1:0] index_q, index_q2;
  logic [     2*PixelWidth-1:0] square_q2;
  logic [    BlockSumWidth-1:0] block_sum_q;
  logic [ BlockSquareWidth-1:0] block_square_q;
  logic [  BlockIndexWidth-1:0] block_q;
  logic [         SumWidth-1:0] sum_q;
  logic [      SquareWidth-1:0] square_sum_q;
  logic [       PixelWidth-1:0] max_q;
  logic [       IndexWidth-1:0] max_index_q;
  logic [        UserWidth-1:0] user_q, user_q2, user_q3;

  logic first_of_line, first_of_block, last_of_block;
  assign first_of_line  = index_q2 == '0;
  assign first_of_block = index_q2[BlockBits-1:0] == '0;
  assign last_of_block  = (&index_q2[BlockBits-1:0]) || index_q2 == IndexWidth'(LineLength - 1);

  // The squares of the parts' sums follow three clocks behind the block.
  logic                         last_of_part, part_done_q, part_done_q2, part_done_q3;
  logic                         block_done_q2, block_done_q3, block_done_q4;
  logic                         first_part, first_part_q, first_part_q2, first_part_q3;
  logic [     PartSumWidth-1:0] part_sum_q, part_sum_q2;
  logic [   2*PartSumWidth-1:0] part_square_q3;
  logic [ BlockSquareWidth-1:0] done_square_q;
  logic [      WithinWidth-1:0] part_squares_q, block_within;
  logic [  BlockIndexWidth-1:0] done_block_q;
  assign last_of_part = &index_q2[PartBits-1:0];
  assign first_part   = index_q2[BlockBits-1:PartBits] == '0;
  // 16 sum(p^2) less the squares of the parts' sums is never negative and fits, so low bits do.
  assign block_within = (WithinWidth'(done_square_q) << PartBits) - part_squares_q;

  logic [BlockSumWidth+BlockSquareWidth-1:0] block_mem [1 << BlockIndexWidth];
  logic [WithinWidth-1:0]                    within_mem [1 << BlockIndexWidth];

  always_ff @(posedge clk_i) begin
    valid_q   <= valid_i;
    pixel_q   <= pixel_i;
    index_q   <= index_i;
    valid_q2  <= valid_q;
    pixel_q2  <= pixel_q;
    index_q2  <= index_q;
    square_q2 <= pixel_q * pixel_q;

    block_done_q <= valid_q2 && last_of_block;
    if (valid_q2) begin
      block_sum_q    <= (first_of_block ? '0 : block_sum_q) + BlockSumWidth'(pixel_q2);
      block_square_q <= (first_of_block ? '0 : block_square_q) + BlockSquareWidth'(square_q2);
      block_q        <= BlockIndexWidth'(index_q2 >> BlockBits);
      if (first_of_line || pixel_q2 > max_q) begin
        max_q       <= pixel_q2;
        max_index_q <= index_q2;
      end
    end
    if (block_done_q) begin
      block_mem[block_q] <= {block_sum_q, block_square_q};
      sum_q        <= (block_q == '0 ? '0 : sum_q) + SumWidth'(block_sum_q);
      square_sum_q <= (block_q == '0 ? '0 : square_sum_q) + SquareWidth'(block_square_q);
    end

    part_done_q  <= valid_q2 && last_of_part;
    part_done_q2 <= part_done_q;
    part_done_q3 <= part_done_q2;
    if (valid_q2) begin
      part_sum_q <= (index_q2[PartBits-1:0] == '0 ? '0 : part_sum_q) + PartSumWidth'(pixel_q2);
      first_part_q <= first_part;
    end
    first_part_q2  <= first_part_q;
    first_part_q3  <= first_part_q2;
    part_sum_q2    <= part_sum_q;
    part_square_q3 <= part_sum_q2 * part_sum_q2;
    if (part_done_q3)
      part_squares_q <= (first_part_q3 ? '0 : part_squares_q) + WithinWidth'(part_square_q3);
    block_done_q2 <= block_done_q;
    block_done_q3 <= block_done_q2;
    block_done_q4 <= block_done_q3;
    if (block_done_q) begin
      done_square_q <= block_square_q;
      done_block_q  <= block_q;
    end
    if (block_done_q4) within_mem[done_block_q] <= block_within;

    // good travels beside the last pixel: good_q3 meets its maximum, good_q4 its sums.
    good_q  <= good_i;
    good_q2 <= good_q;
    good_q3 <= good_q2;
    good_q4 <= good_q3;
    good_q5 <= good_q4;
    good_q6 <= good_q5;
    if (good_i) user_q <= user_i;
    user_q2 <= user_q;
    user_q3 <= user_q2;
    if (rst_i) begin
      valid_q      <= 1'b0;
      valid_q2     <= 1'b0;
      block_done_q <= 1'b0;
      part_done_q  <= 1'b0;
      good_q       <= 1'b0;
      good_q2      <= 1'b0;
      good_q3      <= 1'b0;
      good_q4      <= 1'b0;
      good_q5      <= 1'b0;
      good_q6      <= 1'b0;
    end
  end

  // ---- the blocks around the maximum leave the sums, and go into pairs ----
  // The maximum's own block comes first, as the right one of distance 0.
  localparam int unsigned ReachWidth = BlockIndexWidth + DistanceWidth + 1;
  logic signed [   ReachWidth-1:0] left_q, right_q, reach;  // blocks, may lie outside the line
  logic        [DistanceWidth-1:0] distance_q, distance_q2;
  logic                            reading_q, right_side_q, last_read_q, read_q, selected_q;
  logic                            leaves_q, whole_q, short_block_q, right_side_q2;
  logic [BlockSumWidth+BlockSquareWidth-1:0] read_data_q;
  logic [     BlockSumWidth-1:0] read_sum, left_sum_q, left_sum, right_sum;
  logic [  BlockSquareWidth-1:0] read_square;
  logic [       WithinWidth-1:0] read_within_q, left_within_q, left_within, right_within;
  logic                          left_whole_q, pair_done;
  logic [     DistanceWidth-1:0] pairs_q, kept_q;
  logic                          none_kept;
  logic [       LengthWidth-1:0] length_q;
  logic [          SumWidth-1:0] rest_sum_q, row_sum_q;
  logic [       SquareWidth-1:0] rest_square_q, row_square_q;
  logic                          use_row, use_row_q;
  assign {read_sum, read_square} = read_data_q;

  logic on_line;
  assign reach   = right_side_q ? right_q : left_q;
  assign on_line = reading_q && reach >= 0 && reach < ReachWidth'(signed'(Blocks));

  // Where a line has one block of a pair only, it counts for both.
  assign left_sum     = left_whole_q ? left_sum_q : read_sum;
  assign left_within  = left_whole_q ? left_within_q : read_within_q;
  assign right_sum    = whole_q ? read_sum : left_sum_q;
  assign right_within = whole_q ? read_within_q : left_within_q;
  assign pair_done    = right_side_q2 && distance_q2 > DistanceWidth'(1)
                        && (left_whole_q || whole_q);

  // The pairs start at 2, so GuardBlocks - 1 of them are within the guard.
  assign none_kept = pairs_q < DistanceWidth'(GuardBlocks);
  assign use_row   = noise_row_i || none_kept;

  logic [   PairSumWidth-1:0] pair_sum_mem    [1 << PairBits];
  logic [PairMomentWidth-1:0] pair_moment_mem [1 << PairBits];

  always_ff @(posedge clk_i) begin
    if (good_q3) begin
      // One clock before the sums are complete: the next line's pixels already arrive.
      maximum_o   <= max_q;
      max_index_o <= max_index_q;
      user_o      <= user_q3;
      right_q     <= signed'(ReachWidth'(max_index_q >> BlockBits));
      left_q      <= signed'(ReachWidth'(max_index_q >> BlockBits)) - ReachWidth'(1);
    end
    if (good_q4) begin
      row_sum_q     <= sum_q;
      row_square_q  <= square_sum_q;
      rest_sum_q    <= sum_q;
      rest_square_q <= square_sum_q;
      length_q      <= LengthWidth'(LineLength);
      pairs_q       <= '0;
      distance_q    <= '0;
      right_side_q  <= 1'b1;
    end
    if (good_q6) reading_q <= 1'b1;
    if (reading_q) begin
      right_side_q <= !right_side_q;
      if (right_side_q) begin
        right_q    <= right_q + ReachWidth'(1);
        distance_q <= distance_q + DistanceWidth'(1);
        reading_q  <= distance_q != DistanceWidth'(Pairs);
      end else begin
        left_q     <= left_q - ReachWidth'(1);
      end
    end
    read_data_q   <= block_mem[reach[BlockIndexWidth-1:0]];
    read_within_q <= within_mem[reach[BlockIndexWidth-1:0]];
    leaves_q      <= on_line && distance_q <= DistanceWidth'(GuardBlocks);
    whole_q       <= on_line && reach < ReachWidth'(signed'(WholeBlocks));
    short_block_q <= reach == ReachWidth'(signed'(Blocks - 1));
    right_side_q2 <= right_side_q && reading_q;
    distance_q2   <= distance_q;
    last_read_q   <= reading_q && right_side_q && distance_q == DistanceWidth'(Pairs);
    if (leaves_q) begin
      rest_sum_q    <= rest_sum_q - SumWidth'(read_sum);
      rest_square_q <= rest_square_q - SquareWidth'(read_square);
      length_q      <= length_q
                       - (short_block_q ? LengthWidth'(LastLength)
                                        : LengthWidth'(vrscan_pkg::BlockLength));
    end
    left_sum_q    <= read_sum;
    left_within_q <= read_within_q;
    left_whole_q  <= whole_q;
    if (pair_done) begin
      pairs_q <= pairs_q + DistanceWidth'(1);
      pair_sum_mem[pairs_q[PairBits-1:0]] <= PairSumWidth'(left_sum) + PairSumWidth'(right_sum);
      pair_moment_mem[pairs_q[PairBits-1:0]] <=
          PairMomentWidth'(left_within) + PairMomentWidth'(right_within);
    end
    kept_q     <= none_kept ? '0 : pairs_q - DistanceWidth'(GuardBlocks - 1);
    read_q     <= last_read_q;
    selected_q <= read_q;
    if (read_q) begin
      use_row_q        <= use_row;
      row_statistics_o <= none_kept && !noise_row_i;
      if (use_row) begin
        rest_sum_q    <= row_sum_q;
        rest_square_q <= row_square_q;
        length_q      <= LengthWidth'(LineLength);
      end
    end
    if (rst_i) begin
      reading_q     <= 1'b0;
      leaves_q      <= 1'b0;
      right_side_q2 <= 1'b0;
      last_read_q   <= 1'b0;
      read_q        <= 1'b0;
      selected_q    <= 1'b0;
    end
  end

  // ---- pairs: those that are darker than each are counted, and the darkest added up ----
  // Of equal ones the nearer is the darker.  A pair takes Pairs + 3 clocks: the pair itself is read
  // first, then all, and it is added two clocks behind the last one.
  localparam int unsigned StepWidth = $clog2(Pairs + 3);
  logic                        ranking_q, comparing_q, keep, pairs_ready_q;
  logic [       StepWidth-1:0] step_q;
  logic [        PairBits-1:0] pair_index_q, other_index_q, rank_index;
  logic [    PairSumWidth-1:0] pair_sum_q, other_sum_q;
  logic [ PairMomentWidth-1:0] pair_moment_q;
  logic [   DistanceWidth-1:0] darker_q;
  logic [        SumWidth-1:0] local_sum_q;
  logic [LocalMomentWidth-1:0] local_moment_q;
  assign rank_index = step_q == '0 ? pair_index_q : PairBits'(step_q - StepWidth'(1));
  assign keep       = darker_q < kept_q && DistanceWidth'(pair_index_q) < pairs_q;

  always_ff @(posedge clk_i) begin
    other_sum_q   <= pair_sum_mem[rank_index];
    other_index_q <= rank_index;
    comparing_q   <= ranking_q && step_q != '0 && step_q <= StepWidth'(pairs_q);
    pair_moment_q <= pair_moment_mem[pair_index_q];
    pairs_ready_q <= 1'b0;
    if (ranking_q) begin
      step_q <= step_q + StepWidth'(1);
      if (step_q == StepWidth'(1)) begin
        pair_sum_q <= other_sum_q;
        darker_q   <= '0;
      end
      if (step_q == StepWidth'(Pairs + 2)) begin
        step_q        <= '0;
        pair_index_q  <= pair_index_q + PairBits'(1);
        ranking_q     <= pair_index_q != PairBits'(Pairs - 1);
        pairs_ready_q <= pair_index_q == PairBits'(Pairs - 1);
        if (keep) begin
          local_sum_q    <= local_sum_q + SumWidth'(pair_sum_q);
          local_moment_q <= local_moment_q + LocalMomentWidth'(pair_moment_q);
        end
      end
    end
    if (comparing_q && (other_sum_q < pair_sum_q
                        || (other_sum_q == pair_sum_q && other_index_q < pair_index_q)))
      darker_q <= darker_q + DistanceWidth'(1);
    if (selected_q) begin
      ranking_q      <= 1'b1;
      step_q         <= '0;
      pair_index_q   <= '0;
      local_sum_q    <= '0;
      local_moment_q <= '0;
    end
    if (rst_i) begin
      ranking_q     <= 1'b0;
      pairs_ready_q <= 1'b0;
    end
  end

  // ---- moments: sum^2 and n sum(p^2), of the row and of the rest; then that of the pairs ----
  typedef enum logic [2:0] {
    MOMENT_IDLE, ROW_SUM, ROW_SQUARE, REST_SUM, REST_SQUARE, SPREAD_ROOT, LOCAL, ROOT
  } moment_e;
  localparam int unsigned FactorAWidth =
      (SquareWidth > LocalMomentWidth ? SquareWidth : LocalMomentWidth) + 1;
  localparam int unsigned FactorBWidth =
      (SumWidth > LengthWidth ? SumWidth : LengthWidth) + 1;

  moment_e                                      moment_q;
  logic                                         factors_valid_q, product_valid;
  logic signed [              FactorAWidth-1:0] factor_a_q;
  logic signed [              FactorBWidth-1:0] factor_b_q;
  logic signed [FactorAWidth+FactorBWidth-1:0]  product;
  logic        [               MomentWidth-1:0] row_moment_q;
  logic        [               MomentWidth-1:0] sum_squared_q;
  logic                                         root_start_q, root_valid, root_ready_q;
  logic                                         spread_rooted_q, pairs_done_q;
  logic        [                 RootWidth-1:0] root;
  logic        [               2*RootWidth-1:0] radicand_q;

  // n sum(p^2) - sum(p)^2 is never negative and fits MomentWidth, so its low bits are enough.
  logic [MomentWidth-1:0] moment;
  assign moment = product[MomentWidth-1:0] - sum_squared_q;
  logic unused_product;
  assign unused_product = ^product[FactorAWidth+FactorBWidth-1:MomentWidth];

  // Kept pairs times a part's degrees of freedom, PartLength - 1.
  localparam int unsigned PartFreedomWidth = DistanceWidth + PartBits;
  logic [PartFreedomWidth-1:0] part_freedom_q;
  always_ff @(posedge clk_i)
    part_freedom_q <= (PartFreedomWidth'(kept_q) << PartBits) - PartFreedomWidth'(kept_q);

  multiply #(.AWidth(FactorAWidth), .BWidth(FactorBWidth)) u_multiply (
    .clk_i, .rst_i,
    .valid_i  (factors_valid_q),
    .a_i      (factor_a_q),
    .b_i      (factor_b_q),
    .valid_o  (product_valid),
    .product_o(product)
  );

  square_root #(.RootWidth(RootWidth)) u_square_root (
    .clk_i, .rst_i,
    .valid_i   (root_start_q),
    .radicand_i(radicand_q),
    .valid_o   (root_valid),
    .root_o    (root)
  );

  always_ff @(posedge clk_i) begin
    factors_valid_q <= 1'b0;
    root_start_q    <= 1'b0;
    unique case (moment_q)
      MOMENT_IDLE: if (selected_q) begin
        factor_a_q      <= FactorAWidth'(signed'({1'b0, row_sum_q}));
        factor_b_q      <= FactorBWidth'(signed'({1'b0, row_sum_q}));
        factors_valid_q <= 1'b1;
        moment_q        <= ROW_SUM;
      end
      ROW_SUM: if (product_valid) begin
        sum_squared_q   <= product[MomentWidth-1:0];
        factor_a_q      <= FactorAWidth'(signed'({1'b0, row_square_q}));
        factor_b_q      <= FactorBWidth'(signed'(LineLength));
        factors_valid_q <= 1'b1;
        moment_q        <= ROW_SQUARE;
      end
      ROW_SQUARE: if (product_valid) begin
        row_moment_q    <= moment;
        factor_a_q      <= FactorAWidth'(signed'({1'b0, rest_sum_q}));
        factor_b_q      <= FactorBWidth'(signed'({1'b0, rest_sum_q}));
        factors_valid_q <= 1'b1;
        moment_q        <= REST_SUM;
      end
      REST_SUM: if (product_valid) begin
        sum_squared_q   <= product[MomentWidth-1:0];
        factor_a_q      <= FactorAWidth'(signed'({1'b0, rest_square_q}));
        factor_b_q      <= FactorBWidth'(signed'({1'b0, length_q}));
        factors_valid_q <= 1'b1;
        moment_q        <= REST_SQUARE;
      end
      REST_SQUARE: if (product_valid) begin
        radicand_q      <= {moment, {2*RootFraction{1'b0}}};
        root_start_q    <= 1'b1;
        moment_q        <= SPREAD_ROOT;
      end
      // 2 kept pairs of n parts have the variance sum / (n 16 15): times the square of 15 n.
      SPREAD_ROOT: if (pairs_done_q && spread_rooted_q) begin
        factor_a_q      <= FactorAWidth'(signed'({1'b0, local_moment_q}));
        factor_b_q      <= FactorBWidth'(signed'({1'b0, part_freedom_q, 1'b0}));
        factors_valid_q <= 1'b1;
        moment_q        <= LOCAL;
      end
      LOCAL: if (product_valid) begin
        radicand_q      <= {product[MomentWidth-1:0], {2*RootFraction{1'b0}}};
        root_start_q    <= 1'b1;
        moment_q        <= ROOT;
      end
      ROOT: if (root_valid) moment_q <= MOMENT_IDLE;
      default: moment_q <= MOMENT_IDLE;
    endcase
    if (rst_i) begin
      moment_q        <= MOMENT_IDLE;
      factors_valid_q <= 1'b0;
      root_start_q    <= 1'b0;
    end
  end

  // ---- quotients: row mean and variance, spread, background, noise ----
  localparam int unsigned MeanShift     = vrscan_pkg::CountWidth - PixelWidth;
  localparam int unsigned VarianceShift = vrscan_pkg::VarianceWidth - 2 * PixelWidth;
  localparam int unsigned NoiseShift    = MeanShift - RootFraction;
  localparam int unsigned DividendWidth = MomentWidth + VarianceShift;
  localparam int unsigned DivisorWidth  = 2 * LengthWidth;

  typedef enum logic [3:0] {
    QUOTIENT_IDLE, ROW_MEAN, ROW_VARIANCE, WAIT_SPREAD, SPREAD, WAIT_PAIRS, BACKGROUND, WAIT_NOISE,
    NOISE
  } quotient_e;
  quotient_e                               quotient_q;
  logic                                    divide_start_q, quotient_valid;
  logic [              DividendWidth-1:0]  dividend_q;
  logic [               DivisorWidth-1:0]  divisor_q;
  logic [vrscan_pkg::VarianceWidth-1:0]    quotient;

  divide #(
    .DividendWidth(DividendWidth),
    .DivisorWidth (DivisorWidth),
    .QuotientWidth(vrscan_pkg::VarianceWidth)
  ) u_divide (
    .clk_i, .rst_i,
    .valid_i   (divide_start_q),
    .dividend_i(dividend_q),
    .divisor_i (divisor_q),
    .valid_o   (quotient_valid),
    .quotient_o(quotient),
    .overflow_o()  // means and variances of pixels always fit, and n is never 0
  );

  localparam int unsigned PairPixels = 2 * vrscan_pkg::BlockLength;
  logic [LengthWidth-1:0] kept_pixels;
  assign kept_pixels = LengthWidth'(kept_q) * LengthWidth'(PairPixels);

  always_ff @(posedge clk_i) begin
    divide_start_q <= 1'b0;
    valid_o        <= 1'b0;
    root_ready_q   <= (root_ready_q || root_valid) && quotient_q != QUOTIENT_IDLE;
    pairs_done_q   <= (pairs_done_q || pairs_ready_q) && quotient_q != QUOTIENT_IDLE;
    spread_rooted_q <= (spread_rooted_q || root_valid) && quotient_q != QUOTIENT_IDLE;
    unique case (quotient_q)
      QUOTIENT_IDLE: if (selected_q) begin
        dividend_q     <= DividendWidth'(row_sum_q) << MeanShift;
        divisor_q      <= DivisorWidth'(LineLength);
        divide_start_q <= 1'b1;
        quotient_q     <= ROW_MEAN;
      end
      // A quotient takes longer than the two products of the row's moment.
      ROW_MEAN: if (quotient_valid) begin
        row_mean_o     <= quotient[vrscan_pkg::CountWidth-1:0];
        dividend_q     <= DividendWidth'(row_moment_q) << VarianceShift;
        divisor_q      <= DivisorWidth'(LineLength * LineLength);
        divide_start_q <= 1'b1;
        quotient_q     <= ROW_VARIANCE;
      end
      ROW_VARIANCE: if (quotient_valid) begin
        row_variance_o <= quotient;
        quotient_q     <= WAIT_SPREAD;
      end
      WAIT_SPREAD: if (root_ready_q) begin
        dividend_q     <= DividendWidth'(root) << NoiseShift;
        divisor_q      <= DivisorWidth'(length_q);
        divide_start_q <= 1'b1;
        root_ready_q   <= 1'b0;
        quotient_q     <= SPREAD;
      end
      SPREAD: if (quotient_valid) begin
        spread_o       <= quotient[vrscan_pkg::CountWidth-1:0];
        quotient_q     <= WAIT_PAIRS;
      end
      WAIT_PAIRS: if (pairs_done_q) begin
        dividend_q     <= (use_row_q ? DividendWidth'(row_sum_q) : DividendWidth'(local_sum_q))
                          << MeanShift;
        divisor_q      <= use_row_q ? DivisorWidth'(LineLength) : DivisorWidth'(kept_pixels);
        divide_start_q <= 1'b1;
        quotient_q     <= BACKGROUND;
      end
      BACKGROUND: if (quotient_valid) begin
        background_o   <= quotient[vrscan_pkg::CountWidth-1:0];
        quotient_q     <= WAIT_NOISE;
      end
      WAIT_NOISE: if (root_ready_q) begin
        dividend_q     <= DividendWidth'(root) << NoiseShift;
        divisor_q      <= DivisorWidth'(part_freedom_q) << PartBits;
        divide_start_q <= 1'b1;
        quotient_q     <= NOISE;
      end
      NOISE: if (quotient_valid) begin
        noise_o        <= use_row_q ? spread_o : quotient[vrscan_pkg::CountWidth-1:0];
        valid_o        <= 1'b1;
        quotient_q     <= QUOTIENT_IDLE;
      end
      default: quotient_q <= QUOTIENT_IDLE;
    endcase
    if (rst_i) begin
      quotient_q     <= QUOTIENT_IDLE;
      divide_start_q <= 1'b0;
      root_ready_q   <= 1'b0;
      pairs_done_q   <= 1'b0;
      spread_rooted_q <= 1'b0;
      valid_o        <= 1'b0;
    end
  end

endmodule

`default_nettype wire
