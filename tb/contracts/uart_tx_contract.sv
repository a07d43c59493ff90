// uart_tx_contract: what uart_tx promises: each byte that it takes is on the line once, in order.
//
// The line is read by counting bits, as a receiver with the same clock would: a bit is as long as
// the phase says.  A break ends the byte under way.

`default_nettype none

module uart_tx_contract (
  input wire logic        clk_i,
  input wire logic        rst_i,
  input wire logic        valid_i,
  input wire logic        ready_o,
  input wire logic [ 7:0] data_i,
  input wire logic        tx_o,
  input wire logic [23:0] step_i,
  input wire logic        break_i,
  input wire logic        busy_o,
  input wire logic [ 3:0] left_q,
  input wire logic [ 8:0] shift_q,
  input wire logic [ 7:0] waiting_q,
  input wire logic [23:0] phase_q
);

  localparam logic [3:0] Bits = 4'd10;
  localparam logic [3:0] Gap  = 4'd2;  // bits of rest after a break, the first less a clock

  logic started_q;
  initial started_q = 1'b0;

  // ---- what was taken and is not on the line yet, and the frame on the line ----
  logic       waits_q, broken_q, sends_q;
  logic [7:0] next_q;
  logic [9:0] frame_q;  // from the start bit in bit 0 to the stop bit
  logic [3:0] at_q;     // of its bits
  logic [3:0] rest_q;   // bits until a frame may begin, after a break
  logic       bit_ends, begins, accept;
  assign accept   = valid_i && ready_o;
  assign bit_ends = {1'b0, phase_q} + {1'b0, step_i} >= 25'd1 << 24;
  assign begins   = waits_q && !break_i && (!sends_q || (at_q == Bits - 4'd1 && bit_ends)) &&
                    (rest_q == 4'd0 || (rest_q == 4'd1 && bit_ends));

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    broken_q  <= break_i;
    waits_q   <= accept || (waits_q && !begins);
    if (accept) next_q <= data_i;
    if (break_i) begin
      sends_q <= 1'b0;
      rest_q  <= Gap;
    end else begin
      if (rest_q != 4'd0 && bit_ends) rest_q <= rest_q - 4'd1;
      if (sends_q && bit_ends) begin
        at_q <= at_q + 4'd1;
        if (at_q == Bits - 4'd1) sends_q <= 1'b0;
      end
      if (begins) begin
        frame_q <= {1'b1, next_q, 1'b0};
        at_q    <= 4'd0;
        sends_q <= 1'b1;
        rest_q  <= 4'd0;
      end
    end
    if (rst_i) begin
      broken_q <= 1'b0;
      waits_q  <= 1'b0;
      sends_q  <= 1'b0;
      rest_q   <= 4'd0;
    end

    if (started_q) begin
      one_byte_waits: assert (ready_o == !waits_q);
      frames_in_order: assert (tx_o == (broken_q ? 1'b0 : !sends_q || frame_q[at_q]));
      busy_to_the_end: assert (busy_o == (waits_q || sends_q || rest_q != 4'd0));

      step_left: assert (left_q == (sends_q ? Bits - at_q : rest_q) && left_q <= Bits);
      step_sent: assert (!sends_q || shift_q == 9'({10'h3ff, frame_q} >> at_q));
      step_rest: assert (rest_q <= Gap && (!sends_q || (rest_q == 4'd0 && at_q < Bits)));
      step_waiting: assert (!waits_q || waiting_q == next_q);
      step_idle: assert (sends_q || shift_q == '1);

      two_frames: cover (sends_q && at_q == 4'd1 && frame_q[8:1] == 8'ha5 && waits_q);
    end
  end

endmodule

bind uart_tx uart_tx_contract u_contract (.*);

`default_nettype wire
