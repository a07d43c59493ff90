// sigma_delta: a level as the share of time that a pin is high, by a modulator of the first order.
//
// An accumulator adds the level every clock, and its carry is the pin.  Of 2**Width clocks on end
// level_i are high, exactly.  Of the first n clocks after a reset the pin is high in the sum of
// their levels / 2**Width, rounded down.
//
//   Latency  1 clock from level_i to pin_o
//   Model    vrscan.clocked.sigma_delta, bit-exact

`default_nettype none

module sigma_delta #(
  parameter int unsigned Width = 16  // bits of the level
) (
  input  wire logic             clk_i,
  input  wire logic             rst_i,

  input  wire logic [Width-1:0] level_i,
  output      logic             pin_o
);

  logic [Width-1:0] sum_q;

  always_ff @(posedge clk_i) begin
    {pin_o, sum_q} <= {1'b0, sum_q} + {1'b0, level_i};

    if (rst_i) begin
      pin_o <= 1'b0;
      sum_q <= '0;
    end
  end

endmodule

`default_nettype wire
