// two_port_memory: a large memory with a port that reads and one that also writes.
//
// It is made of blocks of 2 bits a word, which are as deep as blocks get, so few are to choose from;
// what leaves a block is registered before one of them is chosen.
//
//   read_o     the word at address_i 3 clocks ago
//   back_o     the word at access_i 3 clocks ago, as it was before a write in that clock
//   Collision  a word that is read by address_i in the clock in which it is written is undefined
//   Model      none: a list, in its test

`default_nettype none

module two_port_memory #(
  parameter int unsigned Words = 38610,
  parameter int unsigned Width = 18,  // even
  localparam int unsigned AddressWidth = $clog2(Words)
) (
  input  wire logic                    clk_i,

  input  wire logic [AddressWidth-1:0] address_i,
  output      logic [       Width-1:0] read_o,

  input  wire logic                    write_i,
  input  wire logic [AddressWidth-1:0] access_i,
  input  wire logic [       Width-1:0] data_i,
  output      logic [       Width-1:0] back_o
);

  localparam int unsigned BlockBits = 13;  // of an address within a block
  localparam int unsigned Depth = 1 << BlockBits;
  localparam int unsigned Part = 2;  // bits of a word in a block
  localparam int unsigned Rows = (Words + Depth - 1) / Depth;
  localparam int unsigned RowWidth = Rows > 1 ? $clog2(Rows) : 1;

  if (Width % Part != 0) begin : gen_bad_width
    $error("two_port_memory: Width must be even");
  end

  logic [Rows-1:0][Width-1:0] read_q, read_q2, back_q, back_q2;
  logic [RowWidth-1:0] access_row, read_row_q, read_row_q2, back_row_q, back_row_q2;
  assign access_row = RowWidth'(access_i >> BlockBits);

  for (genvar k = 0; k < Rows; k++) begin : gen_row
    localparam int unsigned Rest = Words - k * Depth;
    localparam int unsigned Here = Rest < Depth ? Rest : Depth;
    localparam int unsigned PlaceBits = Here > 1 ? $clog2(Here) : 1;
    for (genvar j = 0; j < Width; j += Part) begin : gen_part
      (* no_rw_check *)
      logic [Part-1:0] mem [Here];
      always_ff @(posedge clk_i) begin
        if (write_i && access_row == RowWidth'(k)) mem[access_i[PlaceBits-1:0]] <= data_i[j+:Part];
        back_q[k][j+:Part] <= mem[access_i[PlaceBits-1:0]];
        read_q[k][j+:Part] <= mem[address_i[PlaceBits-1:0]];
      end
    end
  end

  always_ff @(posedge clk_i) begin
    read_q2     <= read_q;
    read_row_q  <= RowWidth'(address_i >> BlockBits);
    read_row_q2 <= read_row_q;
    read_o      <= read_q2[read_row_q2];
    back_q2     <= back_q;
    back_row_q  <= access_row;
    back_row_q2 <= back_row_q;
    back_o      <= back_q2[back_row_q2];
  end

endmodule

`default_nettype wire
