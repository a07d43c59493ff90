// axis_ring_contract: the rules of an AXI4-Stream, whole packets, and no slot written over.

`default_nettype none

module axis_ring_contract #(
  parameter int unsigned Slots     = 4,
  parameter int unsigned Words     = 16,
  parameter int unsigned DataWidth = 32,
  parameter int unsigned UserWidth = 24
) (
  input wire logic                     clk_i,
  input wire logic                     rst_i,
  input wire logic                     room_o,
  input wire logic                     write_i,
  input wire logic [$clog2(Words)-1:0] place_i,
  input wire logic                     commit_i,
  input wire logic                     m_axis_tvalid,
  input wire logic                     m_axis_tready,
  input wire logic [    DataWidth-1:0] m_axis_tdata,
  input wire logic                     m_axis_tlast,
  input wire logic [    UserWidth-1:0] m_axis_tuser,
  input wire logic [  $clog2(Slots):0] head_q,
  input wire logic [  $clog2(Slots):0] tail_q,
  input wire logic [$clog2(Words)-1:0] place_q
);

  localparam int unsigned PointerWidth = $clog2(Slots) + 1;
  localparam int unsigned CountWidth = $clog2(Words);

  logic                         started_q, stays_q, clear_q;
  logic [DataWidth+UserWidth:0] word, word_q;
  logic [       CountWidth-1:0] taken_q;  // words of the packet that goes out, taken so far
  logic [     PointerWidth-1:0] used;
  initial started_q = 1'b0;
  assign word = {m_axis_tlast, m_axis_tuser, m_axis_tdata};
  assign used = head_q - tail_q;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    clear_q   <= rst_i;
    stays_q   <= m_axis_tvalid && !m_axis_tready && !rst_i;
    word_q    <= word;
    if (m_axis_tvalid && m_axis_tready) begin
      taken_q <= m_axis_tlast ? '0 : taken_q + CountWidth'(1);
    end
    if (rst_i) taken_q <= '0;

    if (started_q) begin
      only_with_room: assume (rst_i || room_o || !(write_i || commit_i));
      inside_the_packet: assume (!write_i || 32'(place_i) < Words);

      stays_until_taken: assert (!stays_q || (m_axis_tvalid && word == word_q));
      packets_whole: assert (!m_axis_tvalid || m_axis_tlast == (32'(taken_q) == Words - 1));
      not_more_than_slots: assert (32'(used) <= Slots);
      room_is_told: assert (room_o == (32'(used) < Slots));
      no_slot_read_and_written: assert (room_o || head_q[PointerWidth-2:0]
                                        == tail_q[PointerWidth-2:0]);
      nothing_after_a_reset: assert (!clear_q || (!m_axis_tvalid && used == '0));
      inside_a_packet_no_gap: assert (clear_q || taken_q == '0 || m_axis_tvalid);

      step_place: assert (32'(place_q) == (!m_axis_tvalid || m_axis_tlast ? 32'd0
                                          : 32'(taken_q) + 32'd1));
      step_place_filled: assert (place_q == '0 || used != '0);
      step_taken: assert (32'(taken_q) < Words && (m_axis_tvalid || taken_q == '0));

      full: cover (!room_o && stays_q);
      second_packet: cover (m_axis_tvalid && m_axis_tlast && used != '0);
    end
  end

endmodule

bind axis_ring axis_ring_contract #(
  .Slots(Slots), .Words(Words), .DataWidth(DataWidth), .UserWidth(UserWidth)
) u_contract (.*);

`default_nettype wire
