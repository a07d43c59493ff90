// uart_pair_properties: uart_tx heard by uart_rx, both at the same rate.
//
// What is sent and when is free, but for breaks; the reset is the first clock and no other.  The
// proof reaches to the first byte that is heard, while others are sent and wait.

`default_nettype none

module uart_pair_properties #(
  parameter int unsigned Step = 1 << 22  // bits a clock, 24 fraction bits
) (
  input wire logic       clk_i,
  input wire logic       rst_i,
  input wire logic       valid_i,
  input wire logic [7:0] data_i
);

  logic       ready, line, heard, framing, broken, glitch;
  logic [7:0] heard_data;
  uart_tx u_uart_tx (
    .clk_i, .rst_i, .valid_i, .data_i,
    .ready_o(ready),
    .tx_o   (line),
    .step_i (24'(Step)),
    .break_i(1'b0),
    .busy_o ()
  );
  uart_rx dut (
    .clk_i, .rst_i,
    .valid_o  (heard),
    .data_o   (heard_data),
    .framing_o(framing),
    .break_o  (broken),
    .glitch_o (glitch),
    .rx_i     (line),
    .step_i   (24'(Step))
  );

  // What is under way, the oldest lowest: a byte in the receiver, one on the line, one that waits.
  logic        first_q = 1'b1;
  logic [ 1:0] count_q, left;
  logic [23:0] bytes_q, others;
  assign others = heard ? bytes_q >> 8 : bytes_q;
  assign left   = count_q - 2'(heard);

  always_ff @(posedge clk_i) begin
    first_q <= 1'b0;
    count_q <= rst_i ? 2'd0 : left + 2'(valid_i && ready);
    bytes_q <= others;
    if (valid_i && ready) bytes_q[8*left+:8] <= data_i;
  end

  always_comb begin
    assume (rst_i == first_q);
    if (!first_q) begin
      bounded_every_byte_is_heard_in_order:
      assert (!heard || (count_q != 2'd0 && heard_data == bytes_q[7:0]));
      bounded_no_more_are_under_way: assert (count_q <= 2'd2 || !ready);
      bounded_nothing_else_is_heard: assert (!framing && !broken && !glitch);

      a_byte: cover (heard && heard_data == 8'h5a);
    end
  end

endmodule

`default_nettype wire
