// line_capture: the pixels of one raw line with the record of its point, in packets.
//
// Lines are counted as line_receiver counts them, and only one of exactly LineLength pixels is
// taken.  Its pixels go out as chunks of link_pkg::CaptureChunk, then a packet with its record: or
// without, where the chain has made none, which is known when one of a later line comes or none
// within WaitClks.
//
//   record_valid_i   of point_record; a record is taken from its index 0 on
//   valid_o          rises when a packet is there to its end; data_o stays while ready_i is low
//   capture_start_i  ignored while one runs, but for CaptureStop, which ends it behind the packet
//                    that goes out
//   capture_mode_i   CaptureNext: the first good line that begins at least 2 clocks later.
//                    CaptureLine: the one of a number, and only a packet without a record where it
//                    is bad or past; the 2**31 lines from the next one on are not past.
//                    CaptureEvery: the next good line, then those that come a multiple of n later,
//                    if they are good and all of the last one is out
//   capture_argument_i  the number of the line, or n (0 is 1)
//   capture_busy_o   a capture runs; 2 clocks after its start, 1 after its end
//   Latency  3 clocks from the line_end_i of the line to valid_o, then a byte a clock; 2 between
//            two packets
//   Model    vrscan.clocked.line_capture, bit-exact

`default_nettype none

module line_capture #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12
) (
  input  wire logic                                  clk_i,
  input  wire logic                                  rst_i,

  // As vrscan_chain takes them.
  input  wire logic                                  line_start_i,
  input  wire logic                                  line_end_i,
  input  wire logic                                  pixel_valid_i,
  input  wire logic [                PixelWidth-1:0] pixel_i,

  // Of point_record.
  input  wire logic                                  record_valid_i,
  input  wire logic [                           5:0] record_index_i,
  input  wire logic [                           7:0] record_i,

  output      logic                                  valid_o,
  input  wire logic                                  ready_i,
  output      logic [                           7:0] data_o,
  output      logic                                  last_o,

  input  wire logic                                  capture_start_i,
  input  wire logic [link_pkg::CaptureModeWidth-1:0] capture_mode_i,
  input  wire logic [                          31:0] capture_argument_i,

  // Status.
  output      logic                                  capture_busy_o
);

  if (LineLength < 64 || LineLength > 255 * link_pkg::CaptureChunk) begin : gen_bad_line_length
    $error("line_capture: LineLength must be 64 to 25500");
  end
  if (PixelWidth < 8 || PixelWidth > 16) begin : gen_bad_pixel_width
    $error("line_capture: PixelWidth must be 8 to 16");
  end

  localparam int unsigned IndexWidth = $clog2(LineLength);
  localparam int unsigned FillWidth = $clog2(LineLength + 1);
  localparam int unsigned Chunk = link_pkg::CaptureChunk;
  localparam int unsigned HeaderBytes = 8;
  localparam int unsigned WaitClks = LineLength + vrscan_pkg::RecordClks
                                     + vrscan_pkg::NeighbourClks;
  localparam int unsigned ClksWidth = $clog2(WaitClks + 1);

  typedef enum logic [2:0] {IDLE, ARM, ARMED, CHUNK, AWAIT, SEND} state_e;

  state_e                                state_q;
  logic                                  stop_q;
  logic [link_pkg::CaptureModeWidth-1:0] mode_q;
  logic [                          31:0] argument_q;
  logic                                  one_line, every;
  assign one_line = mode_q == link_pkg::CaptureModeWidth'(link_pkg::CaptureLine);
  assign every    = mode_q == link_pkg::CaptureModeWidth'(link_pkg::CaptureEvery);

  // ---- the line ----
  logic [PixelWidth-1:0] line_mem [1 << IndexWidth];

  logic [          31:0] number_q, line_q;  // of the next line to start, of the one to be sent
  logic                  capturing_q;  // this line is the one, if it is good
  logic                  store, ends, is_short, over, good;
  logic [IndexWidth-1:0] index;
  line_extent #(.LineLength(LineLength)) u_line_extent (
    .clk_i, .rst_i, .line_start_i, .line_end_i, .pixel_valid_i,
    .take_o(store), .index_o(index), .ends_o(ends), .short_o(is_short), .over_o(over),
    .unfinished_o()
  );
  assign good = ends && !is_short && !over;

  // Which line is wanted: left_q counts down to -1.
  logic [31:0] ahead;  // lines before the one of the argument, -1 where it is the next
  logic [32:0] left_q;
  logic        past_q, first_q, due, wanted, captured, failed;
  assign ahead    = argument_q + ~number_q;
  assign due      = first_q || left_q[32];
  assign wanted   = state_q == ARMED && line_start_i && due && !past_q;
  assign captured = capturing_q && !line_start_i && good;
  assign failed   = one_line && (past_q || (capturing_q && (line_start_i || (ends && !good)))
                                 || (wanted && ends));

  // ---- the record ----
  logic [7:0] record_mem [link_pkg::FullBytes];

  logic                 got_q, missing_q, awaiting, coming_q, equal_q, borrow_q, later_q;
  logic [ClksWidth-1:0] clks_q;
  logic [          7:0] line_byte;
  logic [          8:0] above;
  logic                 first_byte, take;
  assign awaiting   = (state_q == CHUNK || state_q == SEND || state_q == AWAIT)
                      && !got_q && !missing_q;
  assign first_byte = record_index_i == 6'd0;
  assign take       = awaiting && record_valid_i && (first_byte || coming_q);
  always_comb begin
    case (record_index_i[1:0])
      2'd0: line_byte = line_q[7:0];
      2'd1: line_byte = line_q[15:8];
      2'd2: line_byte = line_q[23:16];
      default: line_byte = line_q[31:24];
    endcase
  end
  assign above = {1'b0, record_i} - {1'b0, line_byte} - 9'(borrow_q && !first_byte);

  always_ff @(posedge clk_i) begin
    if (take) record_mem[record_index_i] <= record_i;
    later_q <= 1'b0;
    if (take) begin
      coming_q <= 1'b1;
      if (record_index_i < 6'd4) begin
        borrow_q <= above[8];
        equal_q  <= (equal_q || first_byte) && above[7:0] == 8'd0;
        later_q  <= record_index_i == 6'd3 && !above[7] && !(equal_q && above[7:0] == 8'd0);
      end
      if (record_index_i == 6'd63) got_q <= equal_q;
    end
    if (!awaiting) coming_q <= 1'b0;
    if (later_q || clks_q == ClksWidth'(WaitClks)) missing_q <= 1'b1;
    if (awaiting) clks_q <= clks_q + ClksWidth'(1);
    if (state_q == ARMED || state_q == IDLE) begin
      got_q     <= 1'b0;
      missing_q <= state_q == ARMED && failed;
      clks_q    <= '0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (store && state_q == ARMED) line_mem[index] <= pixel_i;
    if (line_start_i) number_q <= number_q + 32'd1;

    if (line_start_i) left_q <= every && due ? {1'b0, argument_q} - 33'd2 : left_q - 33'd1;
    if (state_q == ARM) begin
      left_q  <= {ahead[31], ahead};
      past_q  <= one_line && ahead[31] && ahead != '1;
      first_q <= !one_line;
    end
    if (every && captured) first_q <= 1'b0;

    if (state_q != ARMED) capturing_q <= 1'b0;
    else if (line_start_i) capturing_q <= wanted;
    if (wanted) line_q <= number_q;
    if (state_q == ARMED && one_line) line_q <= argument_q;

    if (rst_i) number_q <= '0;
  end

  // ---- the packets ----
  logic [             7:0] pixels_sequence_q, record_sequence_q;
  logic [             7:0] chunk_q;
  logic [   FillWidth-1:0] rest_q;  // pixels not yet sent
  logic                    many_q;  // more of them than a chunk has
  logic                    record_q;  // the packet is that of the record
  logic [            63:0] header_q;
  logic [             3:0] place_q;  // byte of the header, stops behind it
  logic [             7:0] left_bytes_q;  // behind the byte that goes out next
  logic [             5:0] record_place_q;
  logic [  IndexWidth-1:0] pixel_place_q;
  logic [  PixelWidth-1:0] pixel_q;
  logic [            15:0] word_q;
  logic [             7:0] count, body;
  logic                    odd_q, in_header, fetch, sent;
  assign count     = many_q ? 8'(Chunk) : 8'(rest_q);
  assign in_header = place_q != 4'(HeaderBytes);
  assign body      = record_q ? record_mem[record_place_q]
                              : odd_q ? word_q[15:8] : word_q[7:0];
  assign fetch     = place_q == 4'(HeaderBytes - 1) || (odd_q && left_bytes_q != 8'd0);
  assign sent      = valid_o && ready_i && last_o;

  always_ff @(posedge clk_i) begin
    pixel_q        <= line_mem[pixel_place_q];
    capture_busy_o <= state_q != IDLE;
    many_q         <= rest_q > FillWidth'(Chunk);
    if (capture_start_i
        && capture_mode_i == link_pkg::CaptureModeWidth'(link_pkg::CaptureStop)) stop_q <= 1'b1;

    unique case (state_q)
      IDLE: begin
        stop_q     <= 1'b0;
        mode_q     <= capture_mode_i;
        argument_q <= capture_argument_i;
        if (capture_start_i
            && capture_mode_i != link_pkg::CaptureModeWidth'(link_pkg::CaptureStop)) begin
          state_q <= ARM;
        end
      end
      ARM: begin
        // A line that starts in this clock would not be counted.
        if (stop_q) state_q <= IDLE;
        else if (!line_start_i) state_q <= ARMED;
      end
      ARMED: begin
        chunk_q       <= 8'd0;
        rest_q        <= FillWidth'(LineLength);
        many_q        <= LineLength > Chunk;
        pixel_place_q <= '0;
        if (stop_q) state_q <= IDLE;
        else if (failed) state_q <= AWAIT;
        else if (captured) state_q <= CHUNK;
      end
      CHUNK: begin
        place_q      <= 4'd0;
        left_bytes_q <= 8'(HeaderBytes - 1) + {count[6:0], 1'b0};
        odd_q        <= 1'b0;
        record_q     <= 1'b0;
        header_q     <= {
          line_q, count, chunk_q, pixels_sequence_q, 8'(link_pkg::StreamCapturePixels)
        };
        if (stop_q) begin
          state_q <= IDLE;
        end else begin
          pixels_sequence_q <= pixels_sequence_q + 8'd1;
          chunk_q           <= chunk_q + 8'd1;
          rest_q            <= rest_q - FillWidth'(count);
          state_q           <= SEND;
        end
      end
      AWAIT: begin
        place_q        <= 4'd0;
        left_bytes_q   <= got_q ? 8'(HeaderBytes + link_pkg::FullBytes - 1) : 8'(HeaderBytes - 1);
        record_place_q <= 6'd0;
        record_q       <= 1'b1;
        header_q       <= {
          line_q, 8'd0, 7'd0, !got_q, record_sequence_q, 8'(link_pkg::StreamCaptureRecord)
        };
        if (stop_q) begin
          state_q <= IDLE;
        end else if (got_q || missing_q) begin
          record_sequence_q <= record_sequence_q + 8'd1;
          state_q           <= SEND;
        end
      end
      default: begin  // SEND
        if (sent) begin
          valid_o <= 1'b0;
          if (stop_q) state_q <= IDLE;
          else if (!record_q) state_q <= rest_q == '0 ? AWAIT : CHUNK;
          else state_q <= every ? ARMED : IDLE;
        end else if (!valid_o || ready_i) begin
          header_q     <= header_q >> 8;
          data_o       <= in_header ? header_q[7:0] : body;
          valid_o      <= 1'b1;
          last_o       <= left_bytes_q == 8'd0;
          left_bytes_q <= left_bytes_q - 8'd1;
          if (in_header) begin
            place_q <= place_q + 4'd1;
          end else begin
            record_place_q <= record_place_q + 6'd1;
            odd_q          <= !odd_q;
          end
          // The next pixel, if it is of this packet; the memory has had time for it.
          if (fetch) begin
            word_q        <= 16'(pixel_q);
            pixel_place_q <= pixel_place_q + IndexWidth'(1);
          end
        end
      end
    endcase

    if (rst_i) begin
      state_q           <= IDLE;
      stop_q            <= 1'b0;
      capture_busy_o    <= 1'b0;
      valid_o           <= 1'b0;
      pixels_sequence_q <= 8'd0;
      record_sequence_q <= 8'd0;
    end
  end

endmodule

`default_nettype wire
