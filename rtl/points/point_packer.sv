// point_packer: the records of every step-th line, in packets.
//
// A packet is a batch: lines first, first + step, first + 2 step ..., each with its record.  A line
// that is missing there closes the batch, so do its last place, its age and the stream's end.  The
// bytes go into a ring as they come, behind room for the header, which is written last; only then
// is the packet there for the reader.
//
// A batch begins where the ring has room for the longest one, so that a slow reader gets whole ones;
// a record without that room is dropped.  The next one kept has FlagPointsLost (CompactLost) and,
// where it is a full one, their number.  Records come at least Spacing clocks apart; one that comes
// sooner is dropped too.
//
//   stream_start_i  ends the stream that runs, as stream_stop_i does, and begins one from sequence
//                   number and count of dropped points 0 with the next record's line; what comes
//                   until the last batch is closed, some 150 clocks, is not of the stream.
//                   stream_stop_i goes before it.
//   stream_format_i link_pkg's FormatCompact, FormatFull or FormatSpace
//   stream_step_i   1 to 255; lines are counted by their numbers, whichever have a point
//   valid_o         rises when a packet is there to its end; data_o stays while ready_i is low
//   points_batch    records a packet, clipped to 1 .. 28 compact, 3 full or 25 of space: at most
//                   240 bytes.
//                   A batch that has as many as a new value is closed.
//   points_timeout_clks    after so long a batch is closed; 0: never
//   points_dropped_o  stops at its largest value; not of the stream but since reset
//   Latency  from the first byte of a batch's last record to valid_o, where the reader is idle: 87
//            clocks for a compact record, 143 for a full one, 88 for one of space
//   Model    vrscan.clocked.point_packer, bit-exact

`default_nettype none

module point_packer #(
  parameter int unsigned BufferBytes  = 4096,
  parameter int unsigned TimeoutWidth = 24,
  parameter int unsigned CountWidth   = 16  // of what counts dropped records, at most 16
) (
  input  wire logic                    clk_i,
  input  wire logic                    rst_i,

  // Of point_record.
  input  wire logic                    record_valid_i,
  input  wire logic [             5:0] record_index_i,
  input  wire logic [             7:0] record_i,

  output      logic                    valid_o,
  input  wire logic                    ready_i,
  output      logic [             7:0] data_o,
  output      logic                    last_o,

  input  wire logic                    stream_start_i,
  input  wire logic                    stream_stop_i,
  input  wire logic [link_pkg::StreamFormatWidth-1:0] stream_format_i,
  input  wire logic [             7:0] stream_step_i,

  // Configuration.
  input  wire register_pkg::points_t   points_i,

  // Status.
  output      logic [  CountWidth-1:0] points_dropped_o
);

  if (BufferBytes < 256 || BufferBytes > 65536 || (BufferBytes & (BufferBytes - 1)) != 0)
  begin : gen_bad_buffer_bytes
    $error("point_packer: BufferBytes must be a power of two from 256 to 65536");
  end
  if (CountWidth < 2 || CountWidth > 16) begin : gen_bad_count_width
    $error("point_packer: CountWidth must be 2 to 16");
  end

  localparam int unsigned Spacing = 160;
  if (Spacing > vrscan_pkg::PointPeriod) begin : gen_bad_spacing
    $error("point_packer: the chain's points come faster than it takes them");
  end

  localparam int unsigned AddressWidth = $clog2(BufferBytes);
  localparam int unsigned PointerWidth = AddressWidth + 1;
  localparam int unsigned HeaderBytes = link_pkg::BatchHeaderBytes;
  localparam int unsigned CompactBytes = link_pkg::CompactBytes;
  localparam int unsigned FullBytes = link_pkg::FullBytes;
  localparam int unsigned MostCompact = 28;
  localparam int unsigned MostFull = 3;
  localparam int unsigned SpaceBytes = link_pkg::SpaceBytes;
  localparam int unsigned MostSpace = 25;
  localparam int unsigned BatchWidth = 5;

  // Where a full record has what a compact one needs, and what is looked at.
  localparam logic [5:0] AtFlags = 6'd4;
  localparam logic [5:0] AtAngle = 6'd36;
  localparam logic [5:0] AtX = 6'd40;
  localparam logic [5:0] AtZ = 6'd44;
  localparam logic [5:0] AtObject = 6'd52;
  localparam logic [5:0] AtFree = 6'd53;
  localparam logic [5:0] AtConfidence = 6'd56;
  localparam logic [5:0] AtBits = 6'd57;
  localparam logic [5:0] AtLost = 6'd58;

  typedef enum logic [1:0] {IDLE, HEADER, ROOM, RECORD} state_e;

  // ---- control ----
  typedef logic [link_pkg::StreamFormatWidth-1:0] format_t;
  localparam format_t Full = format_t'(link_pkg::FormatFull);
  localparam format_t Space = format_t'(link_pkg::FormatSpace);
  logic       running_q;
  format_t    format_q, next_format_q;
  logic [7:0] step_q;
  logic       pending_q, next_running_q;
  logic [7:0] next_step_q;
  logic       apply;

  // ---- the record that comes, and whether its line is one of the stream's ----
  logic [ 7:0] hold_mem [64];
  logic        filling_q, held_q, first_q;
  logic [31:0] line_q, base_q, expected_q, distance_q;
  logic [ 7:0] remainder_q;
  logic        selected_q, gap_q, measured_q, inward_q, mixed_q;
  logic [ 6:0] confidence_q;
  logic [15:0] flags_q;
  logic [ 7:0] compact_q;
  logic        begins, take, release_held;
  assign begins = record_valid_i && record_index_i == 6'd0 && running_q && !pending_q;
  assign take   = begins && !held_q;

  logic [8:0] trial;
  assign trial = {remainder_q, distance_q[31]};

  logic       no_place;
  logic [7:0] compact;
  assign no_place = flags_q[vrscan_pkg::FlagNoRange] || flags_q[vrscan_pkg::FlagOutOfRange];
  always_comb begin
    compact = 8'd0;
    compact[link_pkg::CompactMeasured] = measured_q && !no_place;
    compact[link_pkg::CompactWeak] = flags_q[vrscan_pkg::FlagLowSnr]
                                     || flags_q[vrscan_pkg::FlagTooNarrow]
                                     || flags_q[vrscan_pkg::FlagTooWide]
                                     || flags_q[vrscan_pkg::FlagNoPhase];
    compact[link_pkg::CompactAtEdge] = flags_q[vrscan_pkg::FlagAtEdge];
    compact[link_pkg::CompactSaturated] = flags_q[vrscan_pkg::FlagSaturated];
    compact[link_pkg::CompactRival] = flags_q[vrscan_pkg::FlagRival] || mixed_q;
    compact[link_pkg::CompactRange] = no_place;
    compact[link_pkg::CompactMirror] = flags_q[vrscan_pkg::FlagNotRunning]
                                       || flags_q[vrscan_pkg::FlagIndexFault]
                                       || flags_q[vrscan_pkg::FlagUnsettled];
    compact[link_pkg::CompactLost] = flags_q[vrscan_pkg::FlagLinesLost]
                                     || flags_q[vrscan_pkg::FlagPointsLost];
  end

  always_ff @(posedge clk_i) begin
    if (record_valid_i && (take || filling_q)) hold_mem[record_index_i] <= record_i;
    if (record_valid_i && (take || filling_q)) begin
      if (record_index_i < AtFlags) line_q <= {record_i, line_q[31:8]};
      if (record_index_i == AtFlags) flags_q[7:0] <= record_i;
      if (record_index_i == AtFlags + 6'd1) flags_q[15:8] <= record_i;
      if (record_index_i == AtBits) {inward_q, measured_q} <= record_i[1:0];
      if (record_index_i == AtBits) mixed_q <= record_i[3];
      if (record_index_i == AtConfidence) confidence_q <= record_i[7:1];

      // The distance to the last line of the stream modulo the step, a bit a byte.
      if (record_index_i == 6'd4) begin
        distance_q  <= first_q ? 32'd0 : line_q - base_q;
        remainder_q <= 8'd0;
      end else if (record_index_i > 6'd4 && record_index_i < 6'd37) begin
        distance_q  <= distance_q << 1;
        remainder_q <= trial >= 9'(step_q) ? trial[7:0] - step_q : trial[7:0];
      end
    end
    selected_q <= remainder_q == 8'd0;
    gap_q      <= line_q != expected_q;
    compact_q  <= compact;

    if (take) filling_q <= 1'b1;
    else if (record_valid_i && record_index_i == 6'd63) filling_q <= 1'b0;
    if (filling_q && record_valid_i && record_index_i == 6'd63) held_q <= 1'b1;
    else if (release_held) held_q <= 1'b0;

    if (stream_start_i || stream_stop_i) begin
      pending_q      <= 1'b1;
      next_running_q <= !stream_stop_i;
      next_format_q  <= stream_format_i;
      next_step_q    <= stream_step_i;
    end else if (apply) begin
      pending_q <= 1'b0;
    end
    if (apply) begin
      running_q <= next_running_q;
      if (next_running_q) begin
        format_q <= next_format_q;
        step_q   <= next_step_q;
      end
    end

    if (rst_i) begin
      running_q <= 1'b0;
      pending_q <= 1'b0;
      format_q  <= '0;
      filling_q <= 1'b0;
      held_q    <= 1'b0;
    end
  end

  // ---- the batch ----
  state_e                  state_q;
  logic [             5:0] index_q;  // byte of the header or the record
  logic                    then_room_q;
  logic [  BatchWidth-1:0] count_q, limit_q;  // records of the open batch; none: there is no batch
  logic [TimeoutWidth-1:0] age_q;
  logic [             7:0] sequence_q;
  logic [            31:0] first_line_q;
  logic [PointerWidth-1:0] head_q;  // where the open batch begins, and what the reader has ends
  logic [PointerWidth-1:0] fill_q, read_q, used_q;
  logic                    open, full_q, expired_q, room_q, room;
  logic                    keep, drop_late, drop_early;
  logic [  CountWidth-1:0] dropped_q, lost_q;
  logic [            15:0] record_lost_q;
  logic                    any_lost_q;
  logic [             1:0] drops_q;
  assign open       = count_q != '0;
  assign room       = open || room_q;
  assign keep       = state_q == ROOM && room;
  assign drop_late  = state_q == ROOM && !room;
  assign drop_early = begins && (held_q || filling_q);
  assign apply      = state_q == IDLE && !held_q && !filling_q && pending_q && !open;

  // The last byte of a record is the one behind the last but one.
  logic last_byte_q, record_ends;
  always_ff @(posedge clk_i) begin
    last_byte_q <= index_q == (format_q == Full ? 6'(FullBytes - 2)
                               : format_q == Space ? 6'(SpaceBytes - 2) : 6'(CompactBytes - 2));
  end
  assign record_ends  = state_q == RECORD && last_byte_q;
  assign release_held = record_ends || drop_late || (state_q == IDLE && !selected_q);

  localparam int unsigned SumWidth = CountWidth + 1;
  logic [SumWidth-1:0] lost, dropped_ever;
  assign lost         = SumWidth'(lost_q) + SumWidth'(drops_q);
  assign dropped_ever = SumWidth'(points_dropped_o) + SumWidth'(drops_q);

  logic [             7:0] most;
  logic [TimeoutWidth-1:0] timeout;
  assign most    = format_q == Full ? 8'(MostFull)
                   : format_q == Space ? 8'(MostSpace) : 8'(MostCompact);
  assign timeout = points_i.points_timeout_clks[TimeoutWidth-1:0];

  always_ff @(posedge clk_i) begin
    limit_q <= points_i.points_batch > most ? most[BatchWidth-1:0]
                                            : points_i.points_batch[BatchWidth-1:0];
    full_q    <= count_q >= limit_q;
    expired_q <= open && timeout != '0 && age_q >= timeout;
    if (keep && !open) age_q <= '0;
    else if (age_q != '1) age_q <= age_q + TimeoutWidth'(1);

    used_q <= fill_q - read_q;
    room_q <= used_q <= (format_q == Full
        ? PointerWidth'(BufferBytes - HeaderBytes - MostFull * FullBytes)
        : format_q == Space ? PointerWidth'(BufferBytes - HeaderBytes - MostSpace * SpaceBytes)
        : PointerWidth'(BufferBytes - HeaderBytes - MostCompact * CompactBytes));

    unique case (state_q)
      IDLE: begin
        index_q     <= 6'd0;
        then_room_q <= 1'b0;
        if (held_q) begin
          if (selected_q) begin
            base_q      <= line_q;
            first_q     <= 1'b0;
            then_room_q <= 1'b1;
            state_q     <= open && gap_q ? HEADER : ROOM;
          end
        end else if (open && ((pending_q && !filling_q) || full_q || expired_q)) begin
          state_q <= HEADER;
        end
      end
      HEADER: begin
        index_q <= index_q + 6'd1;
        if (index_q == 6'(HeaderBytes - 1)) begin
          index_q    <= 6'd0;
          head_q     <= fill_q;
          count_q    <= '0;
          sequence_q <= sequence_q + 8'd1;
          state_q    <= then_room_q ? ROOM : IDLE;
        end
      end
      ROOM: begin
        any_lost_q    <= lost_q != '0;
        record_lost_q <= 16'(lost_q);
        if (room) begin
          if (!open) begin
            fill_q       <= fill_q + PointerWidth'(HeaderBytes);
            first_line_q <= line_q;
          end
          state_q <= RECORD;
        end else begin
          state_q <= IDLE;
        end
      end
      RECORD: begin
        index_q <= index_q + 6'd1;
        fill_q  <= fill_q + PointerWidth'(1);
        if (record_ends) begin
          count_q    <= count_q + BatchWidth'(1);
          expected_q <= line_q + 32'(step_q);
          state_q    <= IDLE;
        end
      end
      default: state_q <= IDLE;
    endcase

    drops_q          <= 2'(drop_early) + 2'(drop_late);
    dropped_q        <= dropped_q + CountWidth'(drops_q);
    lost_q           <= keep ? CountWidth'(drops_q) : lost[CountWidth] ? '1 : lost[CountWidth-1:0];
    points_dropped_o <= dropped_ever[CountWidth] ? '1 : dropped_ever[CountWidth-1:0];
    if (apply && next_running_q) begin
      sequence_q <= 8'd0;
      dropped_q  <= '0;
      lost_q     <= '0;
      first_q    <= 1'b1;
    end

    if (rst_i) begin
      state_q          <= IDLE;
      count_q          <= '0;
      head_q           <= '0;
      fill_q           <= '0;
      drops_q          <= 2'd0;
      points_dropped_o <= '0;
    end
  end

  // ---- the bytes on their way into the ring: which one, its value, the memory ----
  logic                    write_q, write_q2, raw_q, mark_q;
  logic [             5:0] hold_index_q;
  logic [             7:0] other_q, byte_q;
  logic [             7:0] dropped_high_q;
  logic [AddressWidth-1:0] address_q, address_q2;
  always_ff @(posedge clk_i) begin
    write_q      <= state_q == HEADER || state_q == RECORD;
    address_q    <= state_q == HEADER ? head_q[AddressWidth-1:0] + AddressWidth'(index_q)
                                      : fill_q[AddressWidth-1:0];
    hold_index_q <= index_q;
    raw_q        <= 1'b0;
    mark_q       <= 1'b0;
    other_q      <= 8'd0;
    if (state_q == HEADER) begin
      case (index_q[3:0])
        4'd0: other_q <= 8'(link_pkg::StreamPointsCompact) + 8'(format_q);
        4'd1: other_q <= sequence_q;
        4'd2: other_q <= 8'(count_q);
        4'd3: other_q <= step_q;
        4'd4: other_q <= first_line_q[7:0];
        4'd5: other_q <= first_line_q[15:8];
        4'd6: other_q <= first_line_q[23:16];
        4'd7: other_q <= first_line_q[31:24];
        4'd8: {dropped_high_q, other_q} <= 16'(dropped_q);
        default: other_q <= dropped_high_q;
      endcase
    end else if (format_q == Full) begin
      raw_q  <= index_q != AtLost && index_q != AtLost + 6'd1;
      mark_q <= index_q == AtFlags + 6'd1 && any_lost_q;
      other_q <= index_q[0] ? record_lost_q[15:8] : record_lost_q[7:0];
    end else begin
      // A record of space is a compact one with a byte about the mirror; what is not measured has
      // the angle and the free interval in place of x and z.
      raw_q <= index_q[3:0] < 4'd7;
      case (index_q[2:0])
        3'd0, 3'd1, 3'd2: hold_index_q <= AtX + index_q;
        3'd3, 3'd4, 3'd5: hold_index_q <= AtZ - 6'd3 + index_q;
        default: hold_index_q <= AtObject;
      endcase
      if (format_q == Space && !compact_q[link_pkg::CompactMeasured]) begin
        case (index_q[2:0])
          3'd0, 3'd1: hold_index_q <= AtAngle + 6'd1 + index_q;
          3'd2, 3'd3: hold_index_q <= AtX - 6'd1 + index_q;
          3'd4, 3'd5: hold_index_q <= AtZ - 6'd3 + index_q;
          default: hold_index_q <= AtFree;
        endcase
      end
      other_q <= compact_q;
      other_q[link_pkg::CompactLost] <= compact_q[link_pkg::CompactLost] || any_lost_q;
      if (index_q[3]) other_q <= {inward_q, confidence_q};
    end

    write_q2   <= write_q;
    address_q2 <= address_q;
    byte_q     <= raw_q ? hold_mem[hold_index_q] : other_q;
    if (mark_q) byte_q[vrscan_pkg::FlagPointsLost-8] <= 1'b1;

    if (rst_i) begin
      write_q  <= 1'b0;
      write_q2 <= 1'b0;
    end
  end

  // ---- the ring and its reader, which learns a packet's length from its header ----
  // A byte that is being written is not there for the reader yet, so what it reads is not used.
  (* no_rw_check *)
  logic [7:0] ring_mem [BufferBytes];
  logic [2:0] place_q;  // byte that is read, stops at 5
  logic [4:0] records_q;
  logic [7:0] left_q;  // bytes behind it
  format_t    read_format_q;
  logic       next, filled, ends;
  assign next   = !valid_o || ready_i;
  assign filled = read_q != head_q;
  assign ends   = place_q == 3'd5 && left_q == 8'd0;

  always_ff @(posedge clk_i) begin
    if (write_q2) ring_mem[address_q2] <= byte_q;
    if (next) begin
      data_o  <= ring_mem[read_q[AddressWidth-1:0]];
      valid_o <= filled;
      last_o  <= ends;
      if (filled) begin
        read_q  <= read_q + PointerWidth'(1);
        place_q <= ends ? 3'd0 : place_q == 3'd5 ? 3'd5 : place_q + 3'd1;
        if (place_q == 3'd1) read_format_q <= data_o[link_pkg::StreamFormatWidth-1:0];
        if (place_q == 3'd3) records_q <= data_o[4:0];
        // Behind byte 5 there are 4 of the header, and the records.
        if (place_q == 3'd4) begin
          left_q <= (read_format_q == Full ? {records_q[1:0], 6'd0} : {records_q, 3'd0})
                    + (read_format_q == Space ? {3'd0, records_q} : 8'd0) + 8'd4;
        end else begin
          left_q <= left_q - 8'd1;
        end
      end
    end
    if (rst_i) begin
      read_q  <= '0;
      place_q <= 3'd0;
      valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
