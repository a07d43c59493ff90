// command_executor: executes commands one after another, and answers each with one packet.
//
// A frame that is no command is told by a reply of its own.  Replies come in the order of the
// frames.  A WRITE checks all of its words before it writes the first.  A lock that closes in
// between, by another word of the same command or by itself, ends it there, and the reply tells the
// address.
//
//   waits_i        a frame waits; take_o begins it, release_o says that it is needed no more
//   status_i, length_i  of the frame, from the clock behind take_o on
//   index_o        a byte of it, which is byte_i a clock later
//   halt_i         streams and capture stop, and nothing is begun
//   valid_o        a byte of the reply, last_o with its last; it rises when all of it is there
//   bus_valid_o    an access; bus_done_i answers it, in a later clock
//   stream_start_o, stream_stop_o, capture_start_o  for one clock; the values beside them stay.  To
//                  stop a capture is to start mode CaptureStop
//   capture_busy_i within 8 clocks of capture_start_o
//   alive_o        a command of a known kind and the right length is executed
//   busy_o         a frame waits, is executed or has its reply not yet taken
//   commands_bad_o commands of no kind or a wrong length; stops at its largest
//   Latency        see vrscan.clocked.command_executor
//   Model          vrscan.clocked.command_executor, bit-exact

`default_nettype none

module command_executor #(
  parameter  int unsigned CountWidth  = vrscan_pkg::CounterWidth,  // where counters stop
  localparam int unsigned IndexWidth  = $clog2(link_pkg::MaxPayload),
  localparam int unsigned LengthWidth = IndexWidth + 1
) (
  input  wire logic                                  clk_i,
  input  wire logic                                  rst_i,

  // Frames.
  input  wire logic                                  waits_i,
  output      logic                                  take_o,
  output      logic                                  release_o,
  input  wire logic [    frame_pkg::StatusWidth-1:0] status_i,
  input  wire logic [               LengthWidth-1:0] length_i,
  output      logic [                IndexWidth-1:0] index_o,
  input  wire logic [                           7:0] byte_i,
  input  wire logic                                  halt_i,

  // Replies.
  output      logic                                  valid_o,
  input  wire logic                                  ready_i,
  output      logic [                           7:0] data_o,
  output      logic                                  last_o,

  // Registers.
  output      logic                                  bus_valid_o,
  output      logic [     link_pkg::AccessWidth-1:0] bus_access_o,
  output      logic [    link_pkg::AddressWidth-1:0] bus_address_o,
  output      logic [                          31:0] bus_data_o,
  input  wire logic                                  bus_done_i,
  input  wire logic [     link_pkg::StatusWidth-1:0] bus_status_i,
  input  wire logic [                          31:0] bus_data_i,

  // Streams and capture.
  output      logic                                  stream_start_o,
  output      logic                                  stream_stop_o,
  output      logic [link_pkg::StreamFormatWidth-1:0] stream_format_o,
  output      logic [                           7:0] stream_step_o,
  output      logic                                  capture_start_o,
  output      logic [link_pkg::CaptureModeWidth-1:0] capture_mode_o,
  output      logic [                          31:0] capture_argument_o,
  input  wire logic                                  capture_busy_i,

  // Status.
  output      logic                                  alive_o,
  output      logic                                  busy_o,
  output      logic [  vrscan_pkg::CounterWidth-1:0] commands_bad_o
);

  localparam int unsigned WordsWidth = $clog2(link_pkg::MaxWords + 1);
  localparam int unsigned StatusWidth = link_pkg::StatusWidth;
  localparam int unsigned CommandBytes = 7;  // of the longest command without data
  localparam int unsigned ReplyBytes = 6;  // of the longest reply without data

  typedef enum logic [3:0] {
    IDLE, LOAD, DECODE, JUDGE, ACT, COPY, WORD, ACCESS, ANSWER, STORE, COMPOSE, HEADER, SEND, DRAIN
  } state_e;

  localparam logic [StatusWidth-1:0] OK = StatusWidth'(link_pkg::StatusOk);
  localparam logic [StatusWidth-1:0] BAD_FRAME = StatusWidth'(link_pkg::StatusBadFrame);
  localparam logic [StatusWidth-1:0] UNKNOWN = StatusWidth'(link_pkg::StatusUnknownCommand);
  localparam logic [StatusWidth-1:0] BAD_LENGTH = StatusWidth'(link_pkg::StatusBadLength);
  localparam logic [StatusWidth-1:0] BAD_VALUE = StatusWidth'(link_pkg::StatusBadValue);
  localparam logic [StatusWidth-1:0] BUSY = StatusWidth'(link_pkg::StatusBusy);

  localparam logic [LengthWidth-1:0] LongestPing = LengthWidth'(link_pkg::MaxPayload - 1);
  localparam logic [LengthWidth-1:0] LongestWrite = LengthWidth'(4 + 4 * link_pkg::MaxWords);

  logic [7:0] reply_mem[1 << IndexWidth];

  state_e state_q;

  // As many bytes of the command as fetch_q says, from index_o on, are shifted in.
  logic [    IndexWidth-1:0] fetch_q;
  logic [    IndexWidth-1:0] echo_q;  // bytes of a PING that go back
  logic                      arrive_q, arrive_q2, fetched;
  logic [8*CommandBytes-1:0] shift_q;
  logic [               7:0] op, byte2, byte3, byte4;
  logic [              31:0] word;
  assign fetched = fetch_q == '0 && !arrive_q;
  assign op      = shift_q[7:0];
  assign byte2   = shift_q[23:16];
  assign byte3   = shift_q[31:24];
  assign byte4   = shift_q[39:32];
  assign word    = shift_q[55:24];  // the last four that came

  logic is_frame_q, is_ping_q, is_read_q, is_write_q, is_start_q, is_stop_q, is_capture_q;
  logic fits_ping_q, fits_read_q, fits_write_q, fits_start_q, fits_stop_q, fits_capture_q;
  logic bad_start_q, bad_capture_q, may_be_busy_q, known, fits, bad_value, access;
  logic [            7:0] op_q, sequence_q;
  logic [StatusWidth-1:0] status_q;
  assign known = is_ping_q || is_read_q || is_write_q || is_start_q || is_stop_q || is_capture_q;
  assign fits = (is_ping_q && fits_ping_q) || (is_read_q && fits_read_q)
      || (is_write_q && fits_write_q) || (is_start_q && fits_start_q)
      || (is_stop_q && fits_stop_q) || (is_capture_q && fits_capture_q);
  assign bad_value = (is_start_q && bad_start_q) || (is_capture_q && bad_capture_q);
  assign access = is_read_q || is_write_q;

  // Words of a READ or a WRITE.
  logic [link_pkg::AddressWidth-1:0] base_q, address_q;
  logic [            WordsWidth-1:0] words_q, left_q;
  logic                              check_q;    // none is written yet
  logic                              refused_q;  // one of them
  logic [                      31:0] answer_q;
  logic [                       1:0] part_q;

  // Bytes of the reply go to store_q, a clock later.
  logic [            7:0] put_data_q;
  logic                   put_valid_q;
  logic [ IndexWidth-1:0] put_index_q, store_q, send_q, last_q;
  logic [8*ReplyBytes-1:0] header_q;
  logic [             2:0] header_left_q;
  logic                    advance;
  assign advance   = !valid_o || ready_i;
  assign take_o    = state_q == IDLE && waits_i && !halt_i;
  assign release_o = state_q == HEADER && header_left_q == 3'd1;

  always_ff @(posedge clk_i) begin
    if (put_valid_q) reply_mem[put_index_q] <= put_data_q;
    if (advance) data_o <= reply_mem[send_q];

    arrive_q  <= fetch_q != '0;
    arrive_q2 <= arrive_q;
    if (fetch_q != '0) begin
      index_o <= index_o + IndexWidth'(1);
      fetch_q <= fetch_q - IndexWidth'(1);
    end
    if (arrive_q) shift_q <= {byte_i, shift_q[8*CommandBytes-1:8]};

    put_valid_q <= (state_q == COPY && arrive_q2) || state_q == STORE || state_q == HEADER;
    put_index_q <= store_q;
    unique case (state_q)
      COPY: put_data_q <= shift_q[8*CommandBytes-1-:8];
      STORE: put_data_q <= answer_q[7:0];
      default: put_data_q <= header_q[7:0];
    endcase

    bus_valid_o     <= 1'b0;
    stream_start_o  <= 1'b0;
    stream_stop_o   <= 1'b0;
    capture_start_o <= 1'b0;
    alive_o         <= 1'b0;
    busy_o          <= waits_i || state_q != IDLE;
    unique case (state_q)
      IDLE: begin
        index_o   <= '0;
        send_q    <= '0;
        part_q    <= '0;
        check_q   <= 1'b1;
        refused_q <= 1'b0;
        if (take_o) begin
          fetch_q <= IndexWidth'(CommandBytes);
          state_q <= LOAD;
        end
      end

      LOAD: if (fetched) state_q <= DECODE;

      // Bytes behind the end of the payload are of an older one: fits_* keeps them from use.
      DECODE: begin
        is_frame_q     <= status_i == frame_pkg::StatusOk;
        is_ping_q      <= op == 8'(link_pkg::CommandPing);
        is_read_q      <= op == 8'(link_pkg::CommandRead);
        is_write_q     <= op == 8'(link_pkg::CommandWrite);
        is_start_q     <= op == 8'(link_pkg::CommandStreamStart);
        is_stop_q      <= op == 8'(link_pkg::CommandStreamStop);
        is_capture_q   <= op == 8'(link_pkg::CommandCapture);
        fits_ping_q    <= length_i >= LengthWidth'(2) && length_i <= LongestPing;
        fits_read_q    <= length_i == LengthWidth'(5) && byte4 != 8'd0
            && byte4 <= 8'(link_pkg::MaxWords);
        fits_write_q   <= length_i >= LengthWidth'(8) && length_i <= LongestWrite
            && length_i[1:0] == 2'd0;
        fits_start_q   <= length_i == LengthWidth'(4);
        fits_stop_q    <= length_i == LengthWidth'(2);
        fits_capture_q <= length_i == LengthWidth'(7);
        bad_start_q    <= byte2 > 8'(link_pkg::FormatSpace) || byte3 == 8'd0;
        bad_capture_q  <= byte2 > 8'(link_pkg::CaptureEvery)
            || (byte2 == 8'(link_pkg::CaptureEvery) && word == '0);
        may_be_busy_q  <= byte2 != 8'(link_pkg::CaptureStop);
        op_q           <= op;
        sequence_q     <= length_i == LengthWidth'(1) ? 8'd0 : shift_q[15:8];
        base_q         <= {byte3, byte2};
        state_q        <= JUDGE;
      end

      JUDGE: begin
        if (!is_frame_q) status_q <= BAD_FRAME;
        else if (!known) status_q <= UNKNOWN;
        else if (!fits) status_q <= BAD_LENGTH;
        else if (bad_value) status_q <= BAD_VALUE;
        else if (is_capture_q && may_be_busy_q && capture_busy_i) status_q <= BUSY;
        else status_q <= OK;
        // The words of a WRITE are a quarter of its bytes, without the first four.
        echo_q  <= length_i[IndexWidth-1:0] - IndexWidth'(2);
        words_q <= is_read_q ? byte4[WordsWidth-1:0] : length_i[WordsWidth+1:2] - WordsWidth'(1);
        state_q <= ACT;
      end

      ACT: begin
        alive_o   <= status_q == OK || status_q == BAD_VALUE || status_q == BUSY;
        address_q <= base_q;
        left_q    <= words_q;
        index_o   <= is_ping_q ? IndexWidth'(2) : IndexWidth'(4);
        store_q   <= is_ping_q ? IndexWidth'(3) : IndexWidth'(4);
        state_q   <= COMPOSE;
        if (status_q == OK) begin
          if (is_ping_q) begin
            fetch_q <= echo_q;
            state_q <= COPY;
          end
          if (is_read_q) state_q <= ACCESS;
          if (is_write_q) begin
            fetch_q <= IndexWidth'(4);
            state_q <= WORD;
          end
          if (is_start_q) begin
            stream_start_o  <= 1'b1;
            stream_format_o <= byte2[link_pkg::StreamFormatWidth-1:0];
            stream_step_o   <= byte3;
          end
          if (is_stop_q) stream_stop_o <= 1'b1;
          if (is_capture_q) begin
            capture_start_o    <= 1'b1;
            capture_mode_o     <= byte2[link_pkg::CaptureModeWidth-1:0];
            capture_argument_o <= word;
          end
        end
      end

      COPY: begin
        if (arrive_q2) store_q <= store_q + IndexWidth'(1);
        if (fetched) state_q <= COMPOSE;
      end

      WORD: if (fetched) state_q <= ACCESS;

      ACCESS: begin
        bus_valid_o   <= 1'b1;
        bus_address_o <= address_q;
        bus_data_o    <= word;
        if (is_read_q) bus_access_o <= link_pkg::AccessWidth'(link_pkg::AccessRead);
        else if (check_q) bus_access_o <= link_pkg::AccessWidth'(link_pkg::AccessCheck);
        else bus_access_o <= link_pkg::AccessWidth'(link_pkg::AccessWrite);
        state_q <= ANSWER;
      end

      ANSWER: begin
        answer_q <= bus_data_i;
        if (bus_done_i && bus_status_i != OK) begin
          status_q  <= bus_status_i;
          refused_q <= 1'b1;
          state_q   <= COMPOSE;
        end else if (bus_done_i) begin
          address_q <= address_q + link_pkg::AddressWidth'(1);
          left_q    <= left_q - WordsWidth'(1);
          state_q   <= STORE;
          if (is_write_q && check_q) begin
            fetch_q <= IndexWidth'(4);
            state_q <= WORD;
            if (left_q == WordsWidth'(1)) begin
              index_o   <= IndexWidth'(4);
              address_q <= base_q;
              left_q    <= words_q;
              check_q   <= 1'b0;
            end
          end
        end
      end

      STORE: begin
        answer_q <= {8'd0, answer_q[31:8]};
        store_q  <= store_q + IndexWidth'(1);
        part_q   <= part_q + 2'd1;
        if (part_q == 2'd3) begin
          if (left_q == '0) begin
            state_q <= COMPOSE;
          end else if (is_read_q) begin
            state_q <= ACCESS;
          end else begin
            fetch_q <= IndexWidth'(4);
            state_q <= WORD;
          end
        end
      end

      COMPOSE: begin
        store_q  <= '0;
        header_q <= {address_q, 8'd0, 8'(status_q), sequence_q, 8'(link_pkg::ReplyBit) | op_q};
        // The first bytes only, where data follows.
        if (!is_frame_q) begin
          header_q[23:0]  <= {8'(BAD_FRAME), 8'd0, 8'(link_pkg::ReplyBit + link_pkg::CommandNone)};
          header_q[31:24] <= 8'(status_i);
          header_left_q   <= 3'd4;
          last_q          <= IndexWidth'(3);
        end else if (refused_q) begin
          header_left_q <= 3'd6;
          last_q        <= IndexWidth'(5);
        end else if (status_q == OK && access) begin
          header_q[31:24] <= 8'(words_q);
          header_left_q   <= 3'd4;
          last_q          <= {words_q, 2'd3};
        end else begin
          header_left_q <= 3'd3;
          last_q        <= status_q == OK && is_ping_q ? length_i[IndexWidth-1:0] : IndexWidth'(2);
        end
        state_q <= HEADER;
      end

      HEADER: begin
        header_q      <= {8'd0, header_q[8*ReplyBytes-1:8]};
        header_left_q <= header_left_q - 3'd1;
        store_q       <= store_q + IndexWidth'(1);
        if (release_o) state_q <= SEND;
      end

      SEND: begin
        if (advance) begin
          valid_o <= 1'b1;
          last_o  <= send_q == last_q;
          send_q  <= send_q + IndexWidth'(1);
          if (send_q == last_q) state_q <= DRAIN;
        end
      end

      DRAIN: begin
        if (ready_i) begin
          valid_o <= 1'b0;
          state_q <= IDLE;
        end
      end

      default: state_q <= IDLE;
    endcase

    if (halt_i) begin
      stream_stop_o   <= 1'b1;
      stream_start_o  <= 1'b0;
      capture_start_o <= 1'b1;
      capture_mode_o  <= link_pkg::CaptureModeWidth'(link_pkg::CaptureStop);
    end

    if (state_q == ACT && (status_q == UNKNOWN || status_q == BAD_LENGTH)) begin
      commands_bad_o <= vrscan_pkg::counted(commands_bad_o, CountWidth);
    end

    if (rst_i) begin
      state_q         <= IDLE;
      fetch_q         <= '0;
      arrive_q        <= 1'b0;
      valid_o         <= 1'b0;
      bus_valid_o     <= 1'b0;
      stream_start_o  <= 1'b0;
      stream_stop_o   <= 1'b0;
      capture_start_o <= 1'b0;
      alive_o         <= 1'b0;
      busy_o          <= 1'b0;
      commands_bad_o  <= '0;
    end
  end

endmodule

`default_nettype wire
