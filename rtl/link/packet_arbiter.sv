// packet_arbiter: several sources of packets, one line.
//
// It turns to another source only between two packets.  Source 0 goes before all others; they take
// turns.  A source raises valid when its whole packet is there, and then gives it without a gap:
// so source 0 waits for one packet at most.
//
//   hold_i   no packet of another source than 0 begins
//   ready_o  follows ready_i in the same clock
//   data_o   stays while ready_i is low
//   busy_o   a packet is being taken
//   Latency  2 clocks from valid_i to valid_o, then a byte a clock; one clock more from packet to
//            packet
//   Model    vrscan.clocked.packet_arbiter, bit-exact

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

  if (Sources < 2 || Sources > 16) begin : gen_bad_sources
    $error("packet_arbiter: Sources must be 2 to 16");
  end

  logic [Sources-1:0] grant_q, after_q;  // the source whose turn it is, and those behind it
  logic [Sources-1:0] streams, turn, candidates, choice;
  assign streams    = hold_i ? '0 : valid_i & ~(Sources'(1));
  assign turn       = streams & after_q;
  assign candidates = turn != '0 ? turn : streams;
  // The lowest of them.
  assign choice     = valid_i[0] ? Sources'(1) : candidates & (~candidates + Sources'(1));

  logic take, accept, last;
  logic [7:0] data;
  assign take    = !valid_o || ready_i;
  assign ready_o = take ? grant_q : '0;
  assign accept  = (valid_i & ready_o) != '0;
  assign last    = (last_i & grant_q) != '0;
  always_comb begin
    data = 8'd0;
    for (int unsigned k = 0; k < Sources; k++) data |= grant_q[k] ? data_i[8*k+:8] : 8'd0;
  end

  always_ff @(posedge clk_i) begin
    if (take) begin
      valid_o <= accept;
      data_o  <= data;
      last_o  <= last;
    end
    if (!busy_o) begin
      grant_q <= choice;
      busy_o  <= choice != '0;
    end else if (accept && last) begin
      grant_q <= '0;
      busy_o  <= 1'b0;
    end
    if (busy_o && !grant_q[0]) after_q <= ~(grant_q | (grant_q - Sources'(1)));

    if (rst_i) begin
      valid_o <= 1'b0;
      grant_q <= '0;
      after_q <= '0;
      busy_o  <= 1'b0;
    end
  end

endmodule

`default_nettype wire
