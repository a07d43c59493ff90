// vrscan_guarded: vrscan_axi as it is to be wired, with its guard, the sensor's FIFO and the resets.
//
// Wiring only, for a clock of the core, one of the sensor and one of the guard.  Take this module,
// or wire vrscan_axi to laser_guard in the same way: the light and the drive go to the pins
// through the guard alone.  constraints/ has what the crossings between the clocks ask of a tool.
//
//   clk_i         of the core and of AXI; ready_i and guard_ready_i are asynchronous, and 0 is a
//                 reset.  axi_rst_o is that of the core, high active, for what is on AXI
//   guard_clk_i   must not come from clk_i, nor from its PLL or its oscillator.  The guard's parameters
//                 are for 20.7 to 31 MHz and a core of 76.667 MHz at least; laser_guard has their sense
//   sensor_*_i    in sensor_clk_i, at most SensorHz: sensor_valid_i is high while a line is read out
//   comparator_i, gate_i  asynchronous, a sample a clock
//   rx_i, focus_*_i  asynchronous, as vrscan takes them
//   guard_ok_o    the light is permitted, in guard_clk_i
//   Model         each module's own

`default_nettype none

module vrscan_guarded #(
  parameter int unsigned ClockHz     = 100_000_000,
  parameter int unsigned SensorHz    = 80_000_000,
  parameter int unsigned Baud        = 3_000_000,
  parameter int unsigned LineLength  = 2048,
  parameter int unsigned PixelWidth  = 12,
  parameter int unsigned MaxWindow   = 255,
  parameter int unsigned BoardId     = 0,
  parameter bit          Polygon     = 1'b0,
  parameter int unsigned PointSlots  = 16,
  parameter int unsigned LineSlots   = 2,
  parameter int unsigned Lanes       = 2,
  // Of laser_guard.
  parameter int unsigned GuardClks   = 16,
  parameter int unsigned PulseClks   = 320,
  parameter int unsigned BurstClks   = 400,
  parameter int unsigned IndexClks   = 320_000_000,
  parameter int unsigned StartupClks = 64,
  parameter int unsigned DriveClks   = 100_000
) (
  input  wire logic                                         clk_i,
  input  wire logic                                         ready_i,
  output      logic                                         axi_rst_o,
  input  wire logic                                         guard_clk_i,
  input  wire logic                                         guard_ready_i,

  // Sensor.
  input  wire logic                                         sensor_clk_i,
  input  wire logic                                         sensor_valid_i,
  input  wire logic [                       PixelWidth-1:0] sensor_pixel_i,
  output      logic                                         sensor_start_o,
  output      logic                                         sensor_exposure_o,

  // Mirror.
  input  wire logic                                         comparator_i,
  input  wire logic                                         gate_i,
  output      logic                                         drive_o,
  output      logic                                         level_pin_o,

  // Laser.
  output      logic                                         pulse_o,
  output      logic                                         power_pin_o,
  output      logic                                         index_light_o,
  output      logic                                         startup_pin_o,
  output      logic                                         guard_ok_o,

  // Lens.
  input  wire logic                                         focus_scl_i,
  input  wire logic                                         focus_sda_i,
  output      logic                                         focus_scl_low_o,
  output      logic                                         focus_sda_low_o,

  // Host over the serial line.
  input  wire logic                                         rx_i,
  output      logic                                         tx_o,

  // Hosts beside it.  Tools know an AXI interface by these names, which have no suffix.
  // verilog_lint: waive-start port-name-suffix
  input  wire logic                                         s_axil_awvalid,
  output      logic                                         s_axil_awready,
  input  wire logic [           link_pkg::AddressWidth+1:0] s_axil_awaddr,
  input  wire logic                                         s_axil_wvalid,
  output      logic                                         s_axil_wready,
  input  wire logic [                                 31:0] s_axil_wdata,
  input  wire logic [                                  3:0] s_axil_wstrb,
  output      logic                                         s_axil_bvalid,
  input  wire logic                                         s_axil_bready,
  output      logic [                                  1:0] s_axil_bresp,
  input  wire logic                                         s_axil_arvalid,
  output      logic                                         s_axil_arready,
  input  wire logic [           link_pkg::AddressWidth+1:0] s_axil_araddr,
  output      logic                                         s_axil_rvalid,
  input  wire logic                                         s_axil_rready,
  output      logic [                                 31:0] s_axil_rdata,
  output      logic [                                  1:0] s_axil_rresp,
  output      logic                                         m_axis_points_tvalid,
  input  wire logic                                         m_axis_points_tready,
  output      logic [                                 31:0] m_axis_points_tdata,
  output      logic                                         m_axis_points_tlast,
  output      logic [                                 23:0] m_axis_points_tuser,
  output      logic                                         m_axis_lines_tvalid,
  input  wire logic                                         m_axis_lines_tready,
  output      logic [                         16*Lanes-1:0] m_axis_lines_tdata,
  output      logic                                         m_axis_lines_tlast,
  output      logic [                                 39:0] m_axis_lines_tuser
  // verilog_lint: waive-stop port-name-suffix
);

  logic guard_rst, sensor_rst;
  reset_bridge u_reset (.clk_i, .ready_i, .rst_o(axi_rst_o));
  reset_bridge u_guard_reset (
    .clk_i(guard_clk_i), .ready_i(guard_ready_i), .rst_o(guard_rst)
  );
  reset_bridge u_sensor_reset (
    .clk_i(sensor_clk_i), .ready_i(!axi_rst_o), .rst_o(sensor_rst)
  );

  logic comparator, gate;
  synchronizer #(.Width(2)) u_index (
    .clk_i, .rst_i(1'b0), .d_i({comparator_i, gate_i}), .q_o({comparator, gate})
  );

  logic                  line_start, line_end, pixel_valid;
  logic [PixelWidth-1:0] pixel;
  logic [          15:0] overflow_count;
  pixel_fifo #(
    .PixelWidth(PixelWidth), .LineLength(LineLength), .ClockHz(ClockHz), .PixelHz(SensorHz)
  ) u_pixel_fifo (
    .clk_i, .rst_i(axi_rst_o),
    .pixel_clk_i(sensor_clk_i), .pixel_rst_i(sensor_rst),
    .line_valid_i(sensor_valid_i), .pixel_valid_i(1'b1), .pixel_i(sensor_pixel_i),
    .line_start_o(line_start), .line_end_o(line_end), .pixel_valid_o(pixel_valid),
    .pixel_o(pixel), .overflow_count_o(overflow_count)
  );

  logic drive, level_pin, pulse, index_light, startup_pin, laser_enable, heartbeat, guard_beat;
  logic [4:0] guard_fault;
  vrscan_axi #(
    .ClockHz(ClockHz), .Baud(Baud), .LineLength(LineLength), .PixelWidth(PixelWidth),
    .MaxWindow(MaxWindow), .IndexOversample(1), .BoardId(BoardId), .Polygon(Polygon),
    .PointSlots(PointSlots), .LineSlots(LineSlots), .Lanes(Lanes)
  ) u_vrscan_axi (
    .clk_i, .rst_i(axi_rst_o),
    .line_start_i(line_start), .line_end_i(line_end), .pixel_valid_i(pixel_valid),
    .pixel_i(pixel), .pixel_overflow_count_i(overflow_count),
    .line_start_o(sensor_start_o), .exposure_o(sensor_exposure_o),
    .comparator_i(comparator), .gate_i(gate), .drive_o(drive), .level_o(),
    .level_pin_o(level_pin), .pulse_o(pulse), .power_o(), .power_pin_o,
    .index_light_o(index_light), .startup_o(), .startup_pin_o(startup_pin),
    .laser_enable_o(laser_enable), .heartbeat_o(heartbeat), .guard_ok_i(guard_ok_o),
    .guard_beat_i(guard_beat), .guard_fault_i(guard_fault),
    .focus_scl_i, .focus_sda_i, .focus_scl_low_o, .focus_sda_low_o, .rx_i, .tx_o,
    .s_axil_awvalid, .s_axil_awready, .s_axil_awaddr, .s_axil_wvalid, .s_axil_wready,
    .s_axil_wdata, .s_axil_wstrb, .s_axil_bvalid, .s_axil_bready, .s_axil_bresp,
    .s_axil_arvalid, .s_axil_arready, .s_axil_araddr, .s_axil_rvalid, .s_axil_rready,
    .s_axil_rdata, .s_axil_rresp,
    .m_axis_points_tvalid, .m_axis_points_tready, .m_axis_points_tdata, .m_axis_points_tlast,
    .m_axis_points_tuser, .m_axis_lines_tvalid, .m_axis_lines_tready, .m_axis_lines_tdata,
    .m_axis_lines_tlast, .m_axis_lines_tuser,
    .mirror_state_o(), .measured_o(), .line_o(), .centre_o(), .centre_half_o()
  );

  laser_guard #(
    .GuardClks(GuardClks), .PulseClks(PulseClks), .BurstClks(BurstClks), .IndexClks(IndexClks),
    .StartupClks(StartupClks), .DriveClks(DriveClks)
  ) u_laser_guard (
    .clk_i(guard_clk_i), .rst_i(guard_rst), .heartbeat_i(heartbeat), .enable_i(laser_enable),
    .pulse_i(pulse), .index_light_i(index_light), .startup_pin_i(startup_pin),
    .drive_i(drive), .level_pin_i(level_pin),
    .pulse_o, .index_light_o, .startup_pin_o, .drive_o, .level_pin_o,
    .beat_o(guard_beat), .ok_o(guard_ok_o), .fault_o(guard_fault)
  );

endmodule

`default_nettype wire
