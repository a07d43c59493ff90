// axis_ring: packets of one length, written word by word, as an AXI4-Stream.
//
// A packet is written into a slot of the ring in any order, and is there for the reader from its
// commit on.  What is written and not committed is written over by the next packet, so a packet
// that turns out bad is simply not committed.  A packet that the reader has not taken stays.
//
//   room_o         a slot is free; follows the last commit, and the last word taken, in the next
//                  clock.  Nothing may be written or committed without it
//   write_i        a word of the packet that is being written, at place_i
//   commit_i       with the last word or later: the packet is complete; user_i is of all its words
//   m_axis_*       tlast with the last word; tdata, tlast and tuser stay while tready is low
//   Latency        2 clocks from commit_i to tvalid, then a word a clock, also from packet to packet
//   Model          vrscan.clocked.axis_ring, bit-exact

`default_nettype none

module axis_ring #(
  parameter  int unsigned Slots      = 4,   // a power of two
  parameter  int unsigned Words      = 16,  // of a packet
  parameter  int unsigned DataWidth  = 32,
  parameter  int unsigned UserWidth  = 24,
  localparam int unsigned PlaceWidth = $clog2(Words)
) (
  input  wire logic                  clk_i,
  input  wire logic                  rst_i,

  output      logic                  room_o,
  input  wire logic                  write_i,
  input  wire logic [PlaceWidth-1:0] place_i,
  input  wire logic [ DataWidth-1:0] data_i,
  input  wire logic                  commit_i,
  input  wire logic [ UserWidth-1:0] user_i,

  // Tools know an AXI interface by these names, which have no suffix.
  // verilog_lint: waive-start port-name-suffix
  output      logic                  m_axis_tvalid,
  input  wire logic                  m_axis_tready,
  output      logic [ DataWidth-1:0] m_axis_tdata,
  output      logic                  m_axis_tlast,
  output      logic [ UserWidth-1:0] m_axis_tuser
  // verilog_lint: waive-stop port-name-suffix
);

  if (Slots < 2 || (Slots & (Slots - 1)) != 0) begin : gen_bad_slots
    $error("axis_ring: Slots must be a power of two from 2 on");
  end
  if (Words < 2) begin : gen_bad_words
    $error("axis_ring: Words must be at least 2");
  end

  localparam int unsigned SlotWidth = $clog2(Slots);

  // What is being written is not there for the reader yet, so what it reads then is not used.
  (* no_rw_check *)
  logic [DataWidth-1:0] data_mem[Slots << PlaceWidth];
  (* no_rw_check *)
  logic [UserWidth-1:0] user_mem[Slots];

  logic [   SlotWidth:0] head_q, tail_q;  // slot that is written, slot that is read
  logic [PlaceWidth-1:0] place_q;
  logic                  next, filled, ends;
  assign room_o = (head_q ^ tail_q) != {1'b1, SlotWidth'(0)};
  assign next   = !m_axis_tvalid || m_axis_tready;
  assign filled = head_q != tail_q;
  assign ends   = place_q == PlaceWidth'(Words - 1);

  always_ff @(posedge clk_i) begin
    if (write_i) data_mem[{head_q[SlotWidth-1:0], place_i}] <= data_i;
    if (commit_i) user_mem[head_q[SlotWidth-1:0]] <= user_i;
    if (commit_i) head_q <= head_q + (SlotWidth + 1)'(1);

    if (next) begin
      m_axis_tvalid <= filled;
      m_axis_tdata  <= data_mem[{tail_q[SlotWidth-1:0], place_q}];
      m_axis_tuser  <= user_mem[tail_q[SlotWidth-1:0]];
      m_axis_tlast  <= ends;
      if (filled) begin
        place_q <= ends ? '0 : place_q + PlaceWidth'(1);
        if (ends) tail_q <= tail_q + (SlotWidth + 1)'(1);
      end
    end

    if (rst_i) begin
      head_q        <= '0;
      tail_q        <= '0;
      place_q       <= '0;
      m_axis_tvalid <= 1'b0;
    end
  end

endmodule

`default_nettype wire
