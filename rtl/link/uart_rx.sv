// uart_rx: receives bytes, 8N1, the lowest bit first; the line rests high.
//
// The first low sample after a high line begins a frame and restarts the phase accumulator, a clock
// ahead: half for the mean delay of sampling the edge, half for that of sampling after a phase.  A
// bit is the majority of the samples at 3, 4 and 5 eighths of it; for a stop bit the last one alone
// is enough, as it is the farthest from the edge that began the frame.  A low last sample of a good
// stop bit is the next frame's first.  Bits shorter than 8 clocks are sampled in the middle, once.
//
// A start bit whose majority is high is a glitch.  After a low stop bit, and after a reset, nothing
// is a start until the line was high.
//
//   rx_i       asynchronous; synchronised here
//   step_i     bits a clock, 24 fraction bits; at most 2**22, and up to 2**21, clk/8, by majority
//   framing_o  the stop bit is low: with valid_o, or with break_o
//   break_o    so were all the bits before it: there is no valid_o
//   glitch_o   a start bit was none
//   Latency    from the first low sample of rx_i to valid_o, framing_o and break_o:
//              ceil(77/8 * 2**24 / step_i) + 1 clocks; for short bits 76/8
//   Tolerance  bits of T clocks, a rate off by a share e, and each edge, by itself, by up to J clocks:
//              slow 8 T e < T/2 - 1 - 2 J, fast 10 T e < T/2 - 1 - 2 J, or T/2 - 2 J where T/2 is
//              whole.  At clk/8 4.7 and 5.0 % (J = 0), 3.1 and 3.7 % (1/2), 1.5 and 2.5 % (1)
//   Model      vrscan.clocked.uart_rx, bit-exact

`default_nettype none

module uart_rx (
  input  wire logic        clk_i,
  input  wire logic        rst_i,

  output      logic        valid_o,
  output      logic [ 7:0] data_o,
  output      logic        framing_o,
  output      logic        break_o,
  output      logic        glitch_o,

  input  wire logic        rx_i,

  input  wire logic [23:0] step_i
);

  localparam int unsigned PhaseWidth = 24;
  localparam logic [PhaseWidth-1:0] WidestStep = PhaseWidth'(1) << (PhaseWidth - 3);
  localparam logic [3:0] StartBit = 4'd0;
  localparam logic [3:0] StopBit = 4'd9;

  logic                  line;
  synchronizer u_line (.clk_i, .rst_i, .d_i(rx_i), .q_o(line));

  logic                  wide_q;   // a bit has its three samples
  logic                  armed_q;  // the line was high
  logic                  busy_q;
  logic [           3:0] bit_q;
  logic [           1:0] samples_q;
  logic [PhaseWidth-1:0] phase_q, sum;
  logic [           2:0] eighth, eighth_d;
  logic                  decide, vote, stop, ends, start;
  assign sum      = phase_q + step_i;
  assign eighth   = phase_q[PhaseWidth-1-:3];
  assign eighth_d = sum[PhaseWidth-1-:3];
  assign decide   = busy_q && (wide_q ? eighth == 3'd4 && eighth_d == 3'd5
                                      : !eighth[2] && eighth_d[2]);
  assign vote     = wide_q ? (line && |samples_q) || &samples_q : line;
  assign stop     = line || (wide_q && &samples_q);
  assign ends     = decide && ((bit_q == StartBit && vote) || (bit_q == StopBit && stop));
  assign start    = !line && (busy_q ? ends : armed_q);

  always_ff @(posedge clk_i) begin
    wide_q <= step_i <= WidestStep;

    phase_q <= start ? step_i : sum;
    if (start) samples_q <= '0;
    else if (eighth_d != eighth) samples_q <= {samples_q[0], line};

    valid_o   <= 1'b0;
    framing_o <= 1'b0;
    break_o   <= 1'b0;
    glitch_o  <= 1'b0;
    if (!busy_q) armed_q <= armed_q || line;
    if (decide) begin
      bit_q <= bit_q + 4'd1;
      if (bit_q == StartBit) begin
        busy_q   <= !vote;
        glitch_o <= vote;
      end else if (bit_q == StopBit) begin
        busy_q    <= 1'b0;
        armed_q   <= stop;
        valid_o   <= stop || data_o != '0;
        framing_o <= !stop;
        break_o   <= !stop && data_o == '0;
      end else begin
        data_o <= {vote, data_o[7:1]};
      end
    end
    if (start) begin
      busy_q <= 1'b1;
      bit_q  <= StartBit;
    end

    if (rst_i) begin
      armed_q   <= 1'b0;
      busy_q    <= 1'b0;
      valid_o   <= 1'b0;
      framing_o <= 1'b0;
      break_o   <= 1'b0;
      glitch_o  <= 1'b0;
    end
  end

endmodule

`default_nettype wire
