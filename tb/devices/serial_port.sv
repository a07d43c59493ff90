// serial_port: the other end of the board's UART, a USB adapter behind C functions.
//
//   serial_step(busy)   bits a clock, 24 fraction bits; asked every clock.  busy: a byte to the
//                       board waits or is on the line, which a new rate would tear
//   serial_take()       the next byte for the board, or -1; asked when the line can have one
//   serial_give(value)  a byte of the board; 256 is a break, and 512 is added for a low stop bit

`default_nettype none

module serial_port (
  input  wire logic clk_i,
  input  wire logic rst_i,

  input  wire logic rx_i,  // the board's uart_tx_o
  output      logic tx_o   // the board's uart_rx_i
);

  import "DPI-C" function int serial_step(input bit busy);
  import "DPI-C" function int serial_take();
  import "DPI-C" function void serial_give(input int value);

  logic [23:0] step_q;
  logic        give, ready, framing, broken, busy, valid_q;
  logic [ 7:0] given, data_q;

  uart_rx u_uart_rx (
    .clk_i, .rst_i,
    .valid_o(give), .data_o(given), .framing_o(framing), .break_o(broken), .glitch_o(),
    .rx_i, .step_i(step_q)
  );

  uart_tx u_uart_tx (
    .clk_i, .rst_i,
    .valid_i(valid_q), .ready_o(ready), .data_i(data_q), .tx_o,
    .step_i(step_q), .break_i(1'b0), .busy_o(busy)
  );

  // verilog_lint: waive-start always-ff-non-blocking (a local of one clock)
  always_ff @(posedge clk_i) begin
    automatic int taken;
    step_q <= 24'(serial_step(busy || valid_q));
    if (valid_q && ready) valid_q <= 1'b0;
    if (!valid_q && ready && !rst_i) begin
      taken   = serial_take();
      valid_q <= taken >= 0;
      data_q  <= 8'(taken);
    end
    if ((give || broken) && !rst_i) begin
      serial_give(broken ? 256 : 32'(given) + (framing ? 512 : 0));
    end
    if (rst_i) valid_q <= 1'b0;
  end
  // verilog_lint: waive-stop always-ff-non-blocking

endmodule

`default_nettype wire
