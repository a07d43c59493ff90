// ulx3s: vrscan on a ULX3S with an LFE5U-85F: clocks, pins and synchronisers.
//
// The core runs at 76.667 MHz from the PLL and the board's oscillator: at most 36,848 lines/s of
// 2,048 pixels.  laser_guard runs from the chip's own oscillator: 310 MHz / 12, within a fifth.  The
// index is sampled at both edges, 6.5 ns apart.
// constraints/ulx3s.lpf has the pins; FIRE1 is the reset.  A sensor of fewer bits has the lower pins.
// scripts/bitstream.py gives the parameters where a configuration is built.

`default_nettype none

module ulx3s #(
  parameter int unsigned LineLength   = 2048,
  parameter int unsigned PixelWidth   = 12,    // 8 to 12
  parameter bit          Polygon      = 1'b0,
  parameter int unsigned ClockHz      = 76_666_667,
  parameter int unsigned SensorHz     = 80_000_000,  // of sensor_clk_i at most, as constrained
  parameter int unsigned PllInput     = 3,     // 25 MHz over this, times
  parameter int unsigned PllFeedback  = 23,    // this, is the output that feeds back; times
  parameter int unsigned PllOscillate = 4,     // this, 400 to 800 MHz; over
  parameter int unsigned PllCore      = 10     // this, the core's clock
) (
  input  wire logic        clk_25mhz_i,
  input  wire logic        button_i,
  output      logic [ 7:0] led_o,

  // USB serial.
  input  wire logic        uart_rx_i,
  output      logic        uart_tx_o,

  // Sensor: its own pixel clock, valid while a line is read out.
  input  wire logic        sensor_clk_i,
  input  wire logic        sensor_valid_i,
  input  wire logic [11:0] sensor_pixel_i,
  output      logic        sensor_start_o,
  output      logic        sensor_exposure_o,

  // Mirror: drive and level, comparator and gate of the index.
  input  wire logic        comparator_i,
  input  wire logic        gate_i,
  output      logic        drive_o,
  output      logic        level_o,

  // Laser: two channels, each with its switch and its level.
  output      logic        pulse_o,
  output      logic        power_o,
  output      logic        index_light_o,
  output      logic        startup_o,

  // Lens: I2C.
  inout  wire logic        focus_scl_io,
  inout  wire logic        focus_sda_io
);

  if (PixelWidth < 8 || PixelWidth > 12) begin : gen_bad_pixel_width
    $error("ulx3s: PixelWidth must be 8 to 12");
  end

  // ---- clocks and resets ----
  logic clk, feedback_clk, locked;
  (* FREQUENCY_PIN_CLKI = "25", FREQUENCY_PIN_CLKOP = "191.667", FREQUENCY_PIN_CLKOS = "76.667" *)
  EHXPLLL #(
    .CLKI_DIV    (PllInput),
    .CLKFB_DIV   (PllFeedback),
    .CLKOP_ENABLE("ENABLED"),
    .CLKOP_DIV   (PllOscillate),
    .CLKOP_CPHASE(PllOscillate - 1),
    .CLKOS_ENABLE("ENABLED"),
    .CLKOS_DIV   (PllCore),
    .CLKOS_CPHASE(PllCore - 1),
    .FEEDBK_PATH ("CLKOP")
  ) u_pll (
    .CLKI        (clk_25mhz_i),
    .CLKFB       (feedback_clk),
    .CLKOP       (feedback_clk),
    .CLKOS       (clk),
    .LOCK        (locked),
    .RST         (1'b0),
    .STDBY       (1'b0),
    .PHASESEL0   (1'b0),
    .PHASESEL1   (1'b0),
    .PHASEDIR    (1'b1),
    .PHASESTEP   (1'b1),
    .PHASELOADREG(1'b1),
    .PLLWAKESYNC (1'b0),
    .ENCLKOP     (1'b0)
  );

  logic guard_clk;
  OSCG #(.DIV(12)) u_oscillator (.OSC(guard_clk));

  logic rst, guard_rst, pixel_rst;
  reset_bridge u_reset (.clk_i(clk), .ready_i(locked && !button_i), .rst_o(rst));
  reset_bridge u_guard_reset (.clk_i(guard_clk), .ready_i(!button_i), .rst_o(guard_rst));
  reset_bridge u_pixel_reset (.clk_i(sensor_clk_i), .ready_i(!rst), .rst_o(pixel_rst));

  // ---- inputs ----
  logic [1:0] comparator_ddr, gate_ddr, comparator, gate;
  IDDRX1F u_comparator (
    .D(comparator_i), .SCLK(clk), .RST(1'b0), .Q0(comparator_ddr[0]), .Q1(comparator_ddr[1])
  );
  IDDRX1F u_gate (
    .D(gate_i), .SCLK(clk), .RST(1'b0), .Q0(gate_ddr[0]), .Q1(gate_ddr[1])
  );
  synchronizer #(.Width(4)) u_index (
    .clk_i(clk), .rst_i(1'b0), .d_i({comparator_ddr, gate_ddr}), .q_o({comparator, gate})
  );

  // In the pins' own registers, so that no route decides when a pixel is taken.
  (* syn_useioff = 1 *) logic                  sensor_valid_q;
  (* syn_useioff = 1 *) logic [PixelWidth-1:0] sensor_pixel_q;
  always_ff @(posedge sensor_clk_i) begin
    sensor_valid_q <= sensor_valid_i;
    sensor_pixel_q <= sensor_pixel_i[PixelWidth-1:0];
  end

  logic                  line_start, line_end, pixel_valid;
  logic [PixelWidth-1:0] pixel;
  logic [          15:0] overflow_count;
  pixel_fifo #(
    .PixelWidth(PixelWidth), .LineLength(LineLength), .ClockHz(ClockHz), .PixelHz(SensorHz)
  ) u_pixel_fifo (
    .clk_i           (clk),
    .rst_i           (rst),
    .pixel_clk_i     (sensor_clk_i),
    .pixel_rst_i     (pixel_rst),
    .line_valid_i    (sensor_valid_q),
    .pixel_valid_i   (1'b1),
    .pixel_i         (sensor_pixel_q),
    .line_start_o    (line_start),
    .line_end_o      (line_end),
    .pixel_valid_o   (pixel_valid),
    .pixel_o         (pixel),
    .overflow_count_o(overflow_count)
  );

  // ---- the instrument ----
  logic [vrscan_pkg::MirrorStateWidth-1:0] mirror_state;
  logic pulse, index_light, startup, drive, level, laser_enable, heartbeat, guard_ok, guard_beat;
  logic [4:0] guard_fault;
  logic measured, scl, sda, scl_low, sda_low;
  vrscan #(
    .ClockHz(ClockHz), .LineLength(LineLength), .PixelWidth(PixelWidth), .IndexOversample(2),
    .BoardId(1), .Polygon(Polygon)
  ) u_vrscan (
    .clk_i                 (clk),
    .rst_i                 (rst),
    .line_start_i          (line_start),
    .line_end_i            (line_end),
    .pixel_valid_i         (pixel_valid),
    .pixel_i               (pixel),
    .pixel_overflow_count_i(overflow_count),
    .line_start_o          (sensor_start_o),
    .exposure_o            (sensor_exposure_o),
    .comparator_i          (comparator),
    .gate_i                (gate),
    .drive_o               (drive),
    .level_o               (),
    .level_pin_o           (level),
    .pulse_o               (pulse),
    .power_o               (),
    .power_pin_o           (power_o),
    .index_light_o         (index_light),
    .startup_o             (),
    .startup_pin_o         (startup),
    .laser_enable_o        (laser_enable),
    .heartbeat_o           (heartbeat),
    .guard_ok_i            (guard_ok),
    .guard_beat_i          (guard_beat),
    .guard_fault_i         (guard_fault),
    .focus_scl_i           (scl),
    .focus_sda_i           (sda),
    .focus_scl_low_o       (scl_low),
    .focus_sda_low_o       (sda_low),
    .rx_i                  (uart_rx_i),
    .tx_o                  (uart_tx_o),
    .host_valid_i          (1'b0),
    .host_access_i         ('0),
    .host_address_i        ('0),
    .host_data_i           ('0),
    .host_done_o           (),
    .host_status_o         (),
    .host_data_o           (),
    .record_valid_o        (),
    .record_index_o        (),
    .record_o              (),
    .readout_start_o       (),
    .readout_end_o         (),
    .readout_valid_o       (),
    .readout_pixel_o       (),
    .readout_line_o        (),
    .axi_i                 ('0),
    .mirror_state_o        (mirror_state),
    .measured_o            (measured),
    .line_o                (),
    .centre_o              (),
    .centre_half_o         ()
  );
  BB u_scl (.B(focus_scl_io), .I(1'b0), .T(!scl_low), .O(scl));
  BB u_sda (.B(focus_sda_io), .I(1'b0), .T(!sda_low), .O(sda));

  laser_guard u_laser_guard (
    .clk_i        (guard_clk),
    .rst_i        (guard_rst),
    .heartbeat_i  (heartbeat),
    .enable_i     (laser_enable),
    .pulse_i      (pulse),
    .index_light_i(index_light),
    .startup_pin_i(startup),
    .drive_i      (drive),
    .level_pin_i  (level),
    .pulse_o,
    .index_light_o,
    .startup_pin_o(startup_o),
    .drive_o,
    .level_pin_o  (level_o),
    .beat_o       (guard_beat),
    .ok_o         (guard_ok),
    .fault_o      (guard_fault)
  );

  // A register of its own, or the mirror's state would be placed at its LED, far from what reads it.
  logic [vrscan_pkg::MirrorStateWidth:0] shown_q;
  always_ff @(posedge clk) shown_q <= {measured, mirror_state};
  assign led_o = {
    guard_ok, index_light_o, pulse_o, shown_q[vrscan_pkg::MirrorStateWidth], !uart_rx_i,
    shown_q[vrscan_pkg::MirrorStateWidth-1:0]
  };

endmodule

`default_nettype wire
