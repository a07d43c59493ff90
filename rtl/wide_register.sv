// wide_register: a register of more bits than one enable reaches.
//
// The enable of some hundred flip-flops is a net as long as the die.  Here it is given a clock
// ahead, and every 64 bits have a register of it.
//
//   take_i   in the next clock d_i is taken, unless hold_i is high then
//   Latency  2 clocks from take_i to q_o
//   Model    none: pure wiring

`default_nettype none

module wide_register #(
  parameter int unsigned Width = 64
) (
  input  wire logic             clk_i,
  input  wire logic             take_i,
  input  wire logic             hold_i,
  input  wire logic [Width-1:0] d_i,
  output      logic [Width-1:0] q_o
);

  localparam int unsigned Reach = 64;
  for (genvar k = 0; k < Width; k += Reach) begin : gen_part
    localparam int unsigned Part = Width - k < Reach ? Width - k : Reach;
    logic take;
    local_register u_take (.clk_i, .d_i(take_i), .q_o(take));
    always_ff @(posedge clk_i) if (take && !hold_i) q_o[k+:Part] <= d_i[k+:Part];
  end

endmodule

`default_nettype wire
