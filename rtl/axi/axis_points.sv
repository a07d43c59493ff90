// axis_points: the full records of all points as an AXI4-Stream, a record a packet.
//
// A record that nobody has taken is kept; one that comes while Slots of them are, is dropped and
// counted.  The next record that is kept has FlagPointsLost and the number of those dropped before
// it, as those of point_packer have.
//
//   record_*_i     of point_record
//   m_axis_tdata   words of the record, the byte with the lowest index in bits 7..0; all bytes count
//   m_axis_tlast   with the last word of a record, which is the point of one line
//   m_axis_tuser   the same in all words: bits 17..0 the point's flags by their numbers in
//                  vrscan_pkg, 18 measured, 19 configuration, 20 inward, 21 a test line, 23..22 zero
//   points_dropped_o  stops at its largest value
//   Latency        67 clocks from a record's first byte to tvalid, where nothing waits
//   Model          vrscan.clocked.axis_points, bit-exact

`default_nettype none

module axis_points #(
  parameter  int unsigned Slots      = 16,  // a power of two
  parameter  int unsigned CountWidth = vrscan_pkg::CounterWidth,  // where points_dropped_o stops
  localparam int unsigned UserWidth  = 24
) (
  input  wire logic                                clk_i,
  input  wire logic                                rst_i,

  // Of point_record.
  input  wire logic                                record_valid_i,
  input  wire logic [                         5:0] record_index_i,
  input  wire logic [                         7:0] record_i,

  // Tools know an AXI interface by these names, which have no suffix.
  // verilog_lint: waive-start port-name-suffix
  output      logic                                m_axis_tvalid,
  input  wire logic                                m_axis_tready,
  output      logic [                        31:0] m_axis_tdata,
  output      logic                                m_axis_tlast,
  output      logic [               UserWidth-1:0] m_axis_tuser,
  // verilog_lint: waive-stop port-name-suffix

  // Status.
  output      logic [vrscan_pkg::CounterWidth-1:0] points_dropped_o
);

  localparam int unsigned Words = link_pkg::FullBytes / 4;

  // Where a record has what is looked at.
  localparam logic [5:0] AtFlags = 6'd4;
  localparam logic [5:0] AtBits = 6'd57;
  localparam logic [5:0] AtLost = 6'd58;

  logic                  room, begins, ends, take, taking_q;
  logic [          15:0] lost_q;  // since the last record that was kept
  logic [           7:0] data;  // record_i with what is known here
  logic [          23:0] word_q;
  logic [          15:0] flags_q;
  logic [           7:0] bits_q;
  logic [ UserWidth-1:0] user;
  assign begins = record_valid_i && record_index_i == 6'd0;
  assign ends   = record_index_i == 6'(link_pkg::FullBytes - 1);
  assign take   = record_valid_i && (begins ? room : taking_q);
  assign user = {
    2'd0, bits_q[2], bits_q[1], bits_q[4], bits_q[0], bits_q[5], bits_q[3], flags_q
  };

  always_comb begin
    data = record_i;
    if (record_index_i == AtFlags + 6'd1) begin
      data[vrscan_pkg::FlagPointsLost-8] = record_i[vrscan_pkg::FlagPointsLost-8] || lost_q != '0;
    end
    if (record_index_i == AtLost) data = lost_q[7:0];
    if (record_index_i == AtLost + 6'd1) data = lost_q[15:8];
  end

  axis_ring #(.Slots(Slots), .Words(Words), .DataWidth(32), .UserWidth(UserWidth)) u_axis_ring (
    .clk_i, .rst_i, .room_o(room),
    .write_i(take && record_index_i[1:0] == 2'd3), .place_i(record_index_i[5:2]),
    .data_i({data, word_q}), .commit_i(take && ends), .user_i(user),
    .m_axis_tvalid, .m_axis_tready, .m_axis_tdata, .m_axis_tlast, .m_axis_tuser
  );

  always_ff @(posedge clk_i) begin
    if (record_valid_i) begin
      word_q <= {data, word_q[23:8]};
      if (record_index_i == AtFlags) flags_q[7:0] <= data;
      if (record_index_i == AtFlags + 6'd1) flags_q[15:8] <= data;
      if (record_index_i == AtBits) bits_q <= data;
    end
    if (record_valid_i) taking_q <= take && !ends;
    if (begins && !room) begin
      points_dropped_o <= vrscan_pkg::counted(points_dropped_o, CountWidth);
      lost_q           <= vrscan_pkg::counted(lost_q, CountWidth);
    end
    if (take && ends) lost_q <= '0;

    if (rst_i) begin
      taking_q         <= 1'b0;
      lost_q           <= '0;
      points_dropped_o <= '0;
    end
  end

  // Confidence of the mirror and what else the byte has is in the record only.
  logic unused;
  assign unused = &{1'b0, bits_q[7:6]};

endmodule

`default_nettype wire
