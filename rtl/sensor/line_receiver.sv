// line_receiver: turns the sensor's strobes into numbered, complete lines.
//
// A line begins at line_start_i and ends at line_end_i; a pixel in the same clock belongs to it.
// Between them pixels may come with gaps, outside of them pixels are blanking and are ignored.
// Only a line of exactly LineLength pixels that ends at least MinPeriod clocks after the one
// before, or LongPeriod where long_i says so, and without skip_i is declared good; every other line
// is counted by its fault and reported with the next good line.  Nothing behind this module has to
// undo anything: index 0 starts a line anew.
//
//   valid_o, pixel_o, index_o  the pixels of the line, index_o of the first lane
//   good_o                     with or after the last pixel: the line was complete
//   line_number_o, lost_o      with good_o: number of the line, counting every line_start_i, and
//                              whether a line was dropped since the last good one
//   Latency  1 clock from pixel_valid_i to valid_o and from line_end_i to good_o
//   Model    vrscan.fixed.line_receiver, bit-exact

`default_nettype none

module line_receiver #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned CountWidth = 16,
  localparam int unsigned IndexWidth = $clog2(LineLength),
  localparam int unsigned PeriodWidth = 12
) (
  input  wire logic                                   clk_i,
  input  wire logic                                   rst_i,

  input  wire logic                                   line_start_i,
  input  wire logic                                   line_end_i,
  input  wire logic                                   pixel_valid_i,
  input  wire logic [                 PixelWidth-1:0] pixel_i,

  output      logic                                   valid_o,
  output      logic [                 PixelWidth-1:0] pixel_o,
  output      logic [                 IndexWidth-1:0] index_o,
  output      logic                                   good_o,
  output      logic [vrscan_pkg::LineNumberWidth-1:0] line_number_o,
  output      logic                                   lost_o,

  // With line_end_i: the line is not to be measured.
  input  wire logic                                   skip_i,
  // The good lines before have been measured: the next one is not too early.
  input  wire logic                                   forget_i,

  // Clocks between two good lines' ends; 0 for no limit.
  input  wire logic [                PeriodWidth-1:0] period_i,

  // Dropped lines by fault; each counter stops at its largest value.
  output      logic [   vrscan_pkg::CounterWidth-1:0] short_count_o,
  output      logic [   vrscan_pkg::CounterWidth-1:0] long_count_o,
  output      logic [   vrscan_pkg::CounterWidth-1:0] unfinished_count_o,
  output      logic [   vrscan_pkg::CounterWidth-1:0] early_count_o,
  output      logic [   vrscan_pkg::CounterWidth-1:0] skipped_count_o  // had no other fault
);

  if (LineLength < vrscan_pkg::BlockLength) begin : gen_bad_length
    $error("line_receiver: LineLength must be at least 64");
  end
  if (PixelWidth < 8 || PixelWidth > 16) begin : gen_bad_width
    $error("line_receiver: PixelWidth must be 8..16");
  end

  logic                                   lost_q;
  logic                                   short_q, long_q, unfinished_q, early_q, skipped_q;
  logic [vrscan_pkg::LineNumberWidth-1:0] number_q;  // of the next line to start
  logic [                PeriodWidth-1:0] period_q;  // since the last good end, while it counts
  logic                                   too_early_q;

  logic                  take, over, ends, is_short, is_early, good, dropped, unfinished;
  logic [IndexWidth-1:0] index;
  line_extent #(.LineLength(LineLength)) u_line_extent (
    .clk_i, .rst_i, .line_start_i, .line_end_i, .pixel_valid_i,
    .take_o(take), .index_o(index), .ends_o(ends), .short_o(is_short), .over_o(over),
    .unfinished_o(unfinished)
  );
  assign is_early = too_early_q;
  assign good     = ends && !is_short && !over && !is_early && !skip_i;
  assign dropped  = unfinished || (ends && !good);

  always_ff @(posedge clk_i) begin
    valid_o <= take;
    pixel_o <= pixel_i;
    index_o <= index;

    if (line_start_i) number_q <= number_q + vrscan_pkg::LineNumberWidth'(1);
    good_o        <= good;
    line_number_o <= line_start_i ? number_q : number_q - vrscan_pkg::LineNumberWidth'(1);
    // An unfinished line that ends in the very clock of a good one-clock line cannot happen:
    // LineLength is more than one pixel.
    lost_o        <= lost_q;
    lost_q        <= (lost_q || dropped) && !good;

    period_q <= good ? PeriodWidth'(1) : period_q + PeriodWidth'(1);
    if (forget_i) too_early_q <= 1'b0;
    else if (good) too_early_q <= period_i > PeriodWidth'(1);
    else if (period_q == period_i - PeriodWidth'(1)) too_early_q <= 1'b0;

    // Faults are counted a clock later, which keeps the counters off the path of the pixels.
    short_q      <= ends && is_short;
    long_q       <= ends && !is_short && over;
    unfinished_q <= unfinished;
    early_q      <= ends && !is_short && !over && is_early;
    skipped_q    <= ends && !is_short && !over && !is_early && skip_i;
    if (short_q) short_count_o <= vrscan_pkg::counted(short_count_o, CountWidth);
    if (long_q) long_count_o <= vrscan_pkg::counted(long_count_o, CountWidth);
    if (unfinished_q) begin
      unfinished_count_o <= vrscan_pkg::counted(unfinished_count_o, CountWidth);
    end
    if (early_q) early_count_o <= vrscan_pkg::counted(early_count_o, CountWidth);
    if (skipped_q) skipped_count_o <= vrscan_pkg::counted(skipped_count_o, CountWidth);

    if (rst_i) begin
      valid_o            <= 1'b0;
      good_o             <= 1'b0;
      lost_q             <= 1'b0;
      number_q           <= '0;
      too_early_q        <= 1'b0;
      short_q            <= 1'b0;
      long_q             <= 1'b0;
      unfinished_q       <= 1'b0;
      early_q            <= 1'b0;
      skipped_q          <= 1'b0;
      short_count_o      <= '0;
      long_count_o       <= '0;
      unfinished_count_o <= '0;
      early_count_o      <= '0;
      skipped_count_o    <= '0;
    end
  end

endmodule

`default_nettype wire
