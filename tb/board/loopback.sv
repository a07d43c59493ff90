// loopback: what a test of the virtual board's own parts needs: an UART that sends back what it
// hears at a rate of its own, and a sensor that is exposed at any angle.
//
// A byte that is no digit comes back, the first one after a break as BREAK.  A digit d exposes a
// line at (d - 4.5) * AngleRad with the laser on for d * PulseClks / 8 clocks at full power; its
// pixels follow, low byte first.

`default_nettype none

module loopback #(
  parameter int unsigned ClockHz      = 100_000_000,
  parameter int unsigned Baud         = 3_000_000,
  parameter int unsigned LineLength   = 2048,
  parameter int unsigned PixelWidth   = 12,
  parameter int unsigned ExposureClks = 2674,
  parameter int unsigned PulseClks    = 100,
  parameter real         AngleRad     = 0.05
) (
  input wire logic clk_i,
  input wire logic rst_i
);

  localparam logic [23:0] Step = 24'((64'(Baud) * 64'h100_0000 + 64'(ClockHz / 2)) / 64'(ClockHz));
  localparam logic [7:0] Zero = 8'h30;
  localparam logic [7:0] BREAK = 8'h42;

  logic       to_board, to_host, heard, broken, broken_q, ready;
  logic [7:0] byte_in;
  serial_port u_serial_port (.clk_i, .rst_i, .rx_i(to_host), .tx_o(to_board));
  uart_rx u_uart_rx (
    .clk_i, .rst_i,
    .valid_o(heard), .data_o(byte_in), .framing_o(), .break_o(broken), .glitch_o(),
    .rx_i(to_board), .step_i(Step)
  );

  real                   angle_q;
  logic                  exposure_q, laser_q;
  logic [          31:0] time_q, pulse_q;
  logic                  pixel_valid;
  logic [PixelWidth-1:0] pixel;
  line_sensor #(.LineLength(LineLength), .PixelWidth(PixelWidth)) u_line_sensor (
    .clk_i, .rst_i,
    .exposure_i(exposure_q), .laser_i(laser_q), .power_i('1), .angle_i(angle_q),
    .lag_i('0), .delay_clks_i('0),
    .line_start_o(), .line_end_o(), .pixel_valid_o(pixel_valid), .pixel_o(pixel)
  );

  localparam int unsigned Depth = 4 * LineLength;
  localparam int unsigned DepthBits = $clog2(Depth);
  logic [          7:0] fifo_q[Depth];
  logic [DepthBits-1:0] in_q, out_q;
  uart_tx u_uart_tx (
    .clk_i, .rst_i,
    .valid_i(in_q != out_q), .ready_o(ready), .data_i(fifo_q[out_q]), .tx_o(to_host),
    .step_i(Step), .break_i(1'b0), .busy_o()
  );

  logic [7:0] digit;
  logic       is_digit;
  assign digit    = byte_in - Zero;
  assign is_digit = digit < 8'd10;
  always_ff @(posedge clk_i) begin
    if (in_q != out_q && ready) out_q <= out_q + DepthBits'(1);
    if (pixel_valid) begin
      fifo_q[in_q]                 <= 8'(pixel);
      fifo_q[in_q+DepthBits'(1)] <= 8'(pixel >> 8);
      in_q                         <= in_q + DepthBits'(2);
    end else if (heard && !is_digit) begin
      fifo_q[in_q] <= broken_q ? BREAK : byte_in;
      in_q         <= in_q + DepthBits'(1);
    end
    broken_q   <= broken || (broken_q && !heard);
    time_q     <= time_q + 32'd1;
    laser_q    <= exposure_q && time_q < pulse_q;
    if (time_q == 32'(ExposureClks - 1)) exposure_q <= 1'b0;
    if (heard && is_digit) begin
      exposure_q <= 1'b1;
      time_q     <= '0;
      pulse_q    <= 32'(digit) * 32'(PulseClks) / 32'd8;
      angle_q    <= (real'(digit) - 4.5) * AngleRad;
    end
    if (rst_i) begin
      in_q       <= '0;
      out_q      <= '0;
      exposure_q <= 1'b0;
      broken_q   <= 1'b0;
    end
  end

endmodule

`default_nettype wire
