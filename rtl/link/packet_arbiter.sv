// packet_arbiter: several sources of packets, one line.
//
// It turns to another source only between two packets.  Source 0 goes before all others; they take
// turns.  A source raises valid when its whole packet is there, and then gives it without a gap:
// so source 0 waits for one packet at most.
//
//   hold_i   no packet of another source than 0 begins
//   ready_o  follows ready_i in the same clock
//   data_o   stays while ready_i is low
//   busy_o   a packet is under way
//   Latency  2 clocks from valid_i to valid_o; after last_i is taken a packet's first byte comes
//            out 2 clocks later than it would in the same packet
//   Model    vrscan.fixed.packet_arbiter, bit-exact

`default_nettype none

module packet_arbiter #(
  parameter int unsigned Sources = 3
) (
  input  wire logic                 clk_i,
  input  wire logic                 rst_i,

  input  wire logic [  Sources-1:0] valid_i,
  output      logic [  Sources-1:0] ready_o,
  input  wire logic [8*Sources-1:0] data_i,
  input  wire logic [  Sources-1:0] last_i,
  input  wire logic                 hold_i,

  output      logic                 valid_o,
  input  wire logic                 ready_i,
  output      logic [          7:0] data_o,
  output      logic                 last_o,

  output      logic                 busy_o
);

endmodule

`default_nettype wire
