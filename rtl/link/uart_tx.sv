// uart_tx: sends bytes, 8N1, the lowest bit first; the line rests high.
//
// Bits are counted by a phase accumulator: bit k of a run of bytes without a gap begins
// ceil(k * 2**24 / step_i) clocks after the run, so the mean rate has no error beyond step_i's own
// and no edge is a whole clock late: at 2**21, clk/8, none is late at all.  One byte waits while another is sent: a source that gives a
// byte within ten bits of the one before leaves no gap.
//
// break_i holds the line low, from the next clock on and at once: a byte under way is lost, the
// one that waits is sent afterwards.  The line is high for two bits less a clock after a break.
//
//   step_i   bits a clock, 24 fraction bits; 0 stops the line where it is
//   busy_o   a byte waits or is on the line, or a break or the time after it
//   Latency  valid_i, with ready_o, to the start bit from rest: 2 clocks
//   Model    vrscan.clocked.uart_tx, bit-exact

`default_nettype none

module uart_tx (
  input  wire logic        clk_i,
  input  wire logic        rst_i,

  input  wire logic        valid_i,
  output      logic        ready_o,
  input  wire logic [ 7:0] data_i,

  output      logic        tx_o,

  input  wire logic [23:0] step_i,
  input  wire logic        break_i,

  output      logic        busy_o
);

  localparam int unsigned PhaseWidth = 24;
  localparam logic [3:0] FrameBits = 4'd10;

  logic [           7:0] waiting_q;
  logic [           8:0] shift_q, shift_d;  // bit 0 is on the line
  logic [           3:0] left_q, left_d;    // bits of the frame, with the one on the line
  logic [PhaseWidth-1:0] phase_q;
  logic [  PhaseWidth:0] sum;
  logic                  bit_end, accept, take, full_d;
  assign sum     = {1'b0, phase_q} + {1'b0, step_i};
  assign bit_end = sum[PhaseWidth];
  assign accept  = valid_i && ready_o;
  assign take    = !ready_o && !break_i && (left_q == 4'd0 || (left_q == 4'd1 && bit_end));
  assign full_d  = accept || (!ready_o && !take);

  always_comb begin
    shift_d = shift_q;
    left_d  = left_q;
    if (break_i) begin
      shift_d = '1;
      left_d  = 4'd2;
    end else if (take) begin
      shift_d = {waiting_q, 1'b0};
      left_d  = FrameBits;
    end else if (left_q != 4'd0 && bit_end) begin
      shift_d = {1'b1, shift_q[8:1]};
      left_d  = left_q - 4'd1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (accept) waiting_q <= data_i;
    // Within a run the phase goes on, so that no fraction of a clock is lost from byte to byte.
    phase_q <= sum[PhaseWidth-1:0];
    if (break_i || (take && left_q == 4'd0)) phase_q <= '0;
    shift_q <= shift_d;
    left_q  <= left_d;
    ready_o <= !full_d;
    busy_o  <= full_d || left_d != 4'd0;
    tx_o    <= shift_d[0] && !break_i;

    if (rst_i) begin
      shift_q <= '1;
      left_q  <= '0;
      ready_o <= 1'b1;
      busy_o  <= 1'b0;
      tx_o    <= 1'b1;
    end
  end

endmodule

`default_nettype wire
