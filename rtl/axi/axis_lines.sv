// axis_lines: the pixels of raw lines as an AXI4-Stream, a line a packet.
//
// Lines are counted as line_receiver counts them, and only those of exactly LineLength pixels go
// out.  A line is there for the reader when its last pixel has come; one that begins while Slots
// lines are kept is dropped whole and counted.
//
//   line_start_i ..  as vrscan_chain takes them; line_i is sampled with line_end_i
//   m_axis_tdata   pixels, each in the lower bits of 16, the first one in bits 15..0
//   m_axis_tlast   with the last pixels of a line
//   m_axis_tuser   the same in all words: bits 31..0 the line's number, 34..32 the mirror's flags
//                  (NOT_RUNNING, INDEX_FAULT, UNSETTLED), 35 a test line, 36 its angle is of the
//                  settings before the last commit, 37 a line before it was dropped or was no good
//                  one, 39..38 zero
//   lines_dropped_o  good lines without room; stops at its largest value
//   Latency        2 clocks from line_end_i to tvalid, where nothing waits
//   Model          vrscan.clocked.axis_lines, bit-exact

`default_nettype none

module axis_lines #(
  parameter  int unsigned LineLength = 2048,  // a multiple of Lanes
  parameter  int unsigned PixelWidth = 12,
  parameter  int unsigned Lanes      = 2,  // pixels of a word, a power of two
  parameter  int unsigned Slots      = 2,  // a power of two
  parameter  int unsigned CountWidth = vrscan_pkg::CounterWidth,  // where lines_dropped_o stops
  localparam int unsigned UserWidth  = 40
) (
  input  wire logic                                clk_i,
  input  wire logic                                rst_i,

  input  wire logic                                line_start_i,
  input  wire logic                                line_end_i,
  input  wire logic                                pixel_valid_i,
  input  wire logic [              PixelWidth-1:0] pixel_i,
  input  wire vrscan_pkg::line_t                   line_i,

  // Tools know an AXI interface by these names, which have no suffix.
  // verilog_lint: waive-start port-name-suffix
  output      logic                                m_axis_tvalid,
  input  wire logic                                m_axis_tready,
  output      logic [                16*Lanes-1:0] m_axis_tdata,
  output      logic                                m_axis_tlast,
  output      logic [               UserWidth-1:0] m_axis_tuser,
  // verilog_lint: waive-stop port-name-suffix

  // Status.
  output      logic [vrscan_pkg::CounterWidth-1:0] lines_dropped_o
);

  if (Lanes < 2 || (Lanes & (Lanes - 1)) != 0 || LineLength % Lanes != 0) begin : gen_bad_lanes
    $error("axis_lines: Lanes must be a power of two that divides LineLength, at least 2");
  end
  if (LineLength < 64) begin : gen_bad_line_length
    $error("axis_lines: LineLength must be at least 64");
  end
  if (PixelWidth < 8 || PixelWidth > 16) begin : gen_bad_pixel_width
    $error("axis_lines: PixelWidth must be 8 to 16");
  end

  localparam int unsigned IndexWidth = $clog2(LineLength);
  localparam int unsigned LaneWidth = $clog2(Lanes);
  localparam int unsigned WordWidth = Lanes * PixelWidth;

  logic [IndexWidth-1:0] index;
  logic                  store, ends, is_short, over, unfinished, good;
  line_extent #(.LineLength(LineLength)) u_line_extent (
    .clk_i, .rst_i, .line_start_i, .line_end_i, .pixel_valid_i,
    .take_o(store), .index_o(index), .ends_o(ends), .short_o(is_short), .over_o(over),
    .unfinished_o(unfinished)
  );
  assign good = ends && !is_short && !over;

  logic [31:0] number_q;  // of the next line to start
  logic        room, take, taking_q, lost_q;
  assign take = line_start_i ? room : taking_q;

  // The pixels of a word but its last, the newest one at the top.
  logic [WordWidth-PixelWidth-1:0] word_q;
  logic [           WordWidth-1:0] packed_word, data;
  assign packed_word = {pixel_i, word_q};

  axis_ring #(
    .Slots(Slots), .Words(LineLength / Lanes), .DataWidth(WordWidth), .UserWidth(UserWidth)
  ) u_axis_ring (
    .clk_i, .rst_i, .room_o(room),
    .write_i(take && store && index[LaneWidth-1:0] == '1),
    .place_i(index[IndexWidth-1:LaneWidth]), .data_i(packed_word),
    .commit_i(take && good),
    .user_i({2'd0, lost_q, line_i.superseded, line_i.test, line_i.mirror_flags,
             number_q - 32'd1}),
    .m_axis_tvalid, .m_axis_tready, .m_axis_tdata(data), .m_axis_tlast, .m_axis_tuser
  );
  always_comb begin
    m_axis_tdata = '0;
    for (int unsigned k = 0; k < Lanes; k++) begin
      m_axis_tdata[16*k+:PixelWidth] = data[PixelWidth*k+:PixelWidth];
    end
  end

  always_ff @(posedge clk_i) begin
    if (store) word_q <= packed_word[WordWidth-1:PixelWidth];
    taking_q <= take && !ends;
    if (line_start_i) number_q <= number_q + 32'd1;
    if (good && !take) lines_dropped_o <= vrscan_pkg::counted(lines_dropped_o, CountWidth);
    if (unfinished || (ends && !(take && good))) lost_q <= 1'b1;
    else if (take && good) lost_q <= 1'b0;

    if (rst_i) begin
      taking_q        <= 1'b0;
      number_q        <= '0;
      lost_q          <= 1'b0;
      lines_dropped_o <= '0;
    end
  end

  // The rest of what belongs to a line is in the record of its point.
  logic unused;
  assign unused = &{1'b0, line_i};

endmodule

`default_nettype wire
