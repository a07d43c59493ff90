// arty_a7: vrscan on an Arty A7-35: clocks, pins and synchronisers.
//
// The core runs at the board's 100 MHz, laser_guard at the configuration's own oscillator, 65 MHz
// within a half, as the board has no other.  The index is sampled at both edges, 5 ns apart.
// constraints/arty_a7.xdc has the pins; BTN0 is the reset.  No tool here builds it but the linters.

`default_nettype none

module arty_a7 #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,   // 8 to 12
  parameter bit          Polygon    = 1'b0
) (
  input  wire logic        clk_100mhz_i,
  input  wire logic        button_i,
  output      logic [ 3:0] led_o,

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

  localparam int unsigned ClockHz  = 100_000_000;
  localparam int unsigned SensorHz = 80_000_000;  // of sensor_clk_i at most, as in the constraints

  if (PixelWidth < 8 || PixelWidth > 12) begin : gen_bad_pixel_width
    $error("arty_a7: PixelWidth must be 8 to 12");
  end

  // ---- clocks and resets ----
  logic clk, guard_clk;
  BUFG u_bufg (.I(clk_100mhz_i), .O(clk));
  STARTUPE2 u_startup (
    .CLK(1'b0), .GSR(1'b0), .GTS(1'b0), .KEYCLEARB(1'b1), .PACK(1'b0),
    .USRCCLKO(1'b0), .USRCCLKTS(1'b1), .USRDONEO(1'b1), .USRDONETS(1'b1),
    .CFGMCLK(guard_clk)
  );

  logic rst, guard_rst, pixel_rst;
  reset_bridge u_reset (.clk_i(clk), .ready_i(!button_i), .rst_o(rst));
  reset_bridge u_guard_reset (.clk_i(guard_clk), .ready_i(!button_i), .rst_o(guard_rst));
  reset_bridge u_pixel_reset (.clk_i(sensor_clk_i), .ready_i(!rst), .rst_o(pixel_rst));

  // ---- inputs ----
  logic [1:0] comparator_ddr, gate_ddr, comparator, gate;
  IDDR #(.DDR_CLK_EDGE("SAME_EDGE_PIPELINED")) u_comparator (
    .D(comparator_i), .C(clk), .CE(1'b1), .R(1'b0), .S(1'b0),
    .Q1(comparator_ddr[0]), .Q2(comparator_ddr[1])
  );
  IDDR #(.DDR_CLK_EDGE("SAME_EDGE_PIPELINED")) u_gate (
    .D(gate_i), .C(clk), .CE(1'b1), .R(1'b0), .S(1'b0), .Q1(gate_ddr[0]), .Q2(gate_ddr[1])
  );
  synchronizer #(.Width(4)) u_index (
    .clk_i(clk), .rst_i(1'b0), .d_i({comparator_ddr, gate_ddr}), .q_o({comparator, gate})
  );

  // In the pins' own registers, so that no route decides when a pixel is taken.
  (* IOB = "TRUE" *) logic                  sensor_valid_q;
  (* IOB = "TRUE" *) logic [PixelWidth-1:0] sensor_pixel_q;
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
  logic scl, sda, scl_low, sda_low;
  vrscan #(
    .ClockHz(ClockHz), .LineLength(LineLength), .PixelWidth(PixelWidth), .IndexOversample(2),
    .BoardId(2), .Polygon(Polygon)
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
    .measured_o            (),
    .line_o                (),
    .centre_o              (),
    .centre_half_o         ()
  );
  IOBUF u_scl (.IO(focus_scl_io), .I(1'b0), .T(!scl_low), .O(scl));
  IOBUF u_sda (.IO(focus_sda_io), .I(1'b0), .T(!sda_low), .O(sda));

  // The fastest clock decides: 97.5 MHz.  At the slowest, a third of it, times are threefold.
  laser_guard #(
    .GuardClks(64), .PulseClks(1000), .BurstClks(1250), .IndexClks(1_000_000_000),
    .DriveClks(312_500)
  ) u_laser_guard (
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
  logic [vrscan_pkg::MirrorStateWidth-1:0] shown_q;
  always_ff @(posedge clk) shown_q <= mirror_state;
  assign led_o = {guard_ok, shown_q};

endmodule

`default_nettype wire
