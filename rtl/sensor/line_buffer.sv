// line_buffer: keeps the last good line and plays it back while the next one comes in.
//
// Two banks.  Pixels go into one; good_i makes it the readable one and turns to the other, so a
// line that is never declared good is simply overwritten.  replay_i streams the readable bank,
// a pixel a clock without a gap; a new replay_i may come with the last one.
// The line is replayed before the second next one reaches the same place: replay_i has to come
// before the next good_i.
//
//   Latency  3 clocks from replay_i to the first valid_o: the memory's output is registered again
//   Model    vrscan.fixed.line_buffer

`default_nettype none

module line_buffer #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  localparam int unsigned IndexWidth = $clog2(LineLength)
) (
  input  wire logic                        clk_i,
  input  wire logic                        rst_i,

  input  wire logic                        valid_i,
  input  wire logic [PixelWidth-1:0] pixel_i,
  input  wire logic [      IndexWidth-1:0] index_i,
  input  wire logic                        good_i,

  input  wire logic                        replay_i,

  output      logic                        valid_o,
  output      logic [PixelWidth-1:0] pixel_o,
  output      logic [      IndexWidth-1:0] index_o,
  output      logic                        last_o
);


  logic [PixelWidth-1:0] line_mem [2 << IndexWidth];

  logic                  write_bank_q, read_bank_q, reading_q;
  logic [IndexWidth-1:0] read_index_q;
  logic                  is_last;
  logic                        valid_q, last_q;
  logic [PixelWidth-1:0] pixel_q;
  logic [      IndexWidth-1:0] index_q;
  assign is_last = read_index_q == IndexWidth'(LineLength - 1);

  always_ff @(posedge clk_i) begin
    if (valid_i) line_mem[{write_bank_q, index_i}] <= pixel_i;
    pixel_q <= line_mem[{read_bank_q, read_index_q}];
    pixel_o <= pixel_q;

    if (good_i) write_bank_q <= !write_bank_q;

    valid_q <= reading_q;
    index_q <= read_index_q;
    last_q  <= is_last;
    valid_o <= valid_q;
    index_o <= index_q;
    last_o  <= last_q;
    if (replay_i) begin
      // The readable bank is the one that is not being written.
      read_bank_q  <= !write_bank_q;
      read_index_q <= '0;
      reading_q    <= 1'b1;
    end else if (reading_q) begin
      read_index_q <= read_index_q + IndexWidth'(1);
      reading_q    <= !is_last;
    end

    if (rst_i) begin
      write_bank_q <= 1'b0;
      reading_q    <= 1'b0;
      valid_q      <= 1'b0;
      valid_o      <= 1'b0;
    end
  end

endmodule

`default_nettype wire
