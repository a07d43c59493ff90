// vrscan_axi: the instrument with AXI interfaces beside the serial line.
//
// Wiring only.  The registers over AXI4-Lite, the points and the raw lines each as an AXI4-Stream,
// all in clk_i; docs/axi.md says what is in them.  Laser, mirror and lens do not know who takes points.
//
// This module alone is no laser's controller: light and drive go to the pins through laser_guard, which
// has a clock of its own.  vrscan_guarded.sv is this module with its guard.
//
//   s_axil_*         of axil_registers; m_axis_points_* of axis_points, m_axis_lines_* of axis_lines
//   the other ports  of vrscan
//   PointSlots, LineSlots  points and lines that are kept while nobody takes them, powers of two
//   Lanes            pixels in a word of m_axis_lines_tdata
//   Model            each module's own; tb/test_vrscan_axi.py compares all that comes out of this top
//                    with vrscan.fixed.vrscan_chain and the twins of the AXI modules

`default_nettype none

module vrscan_axi #(
  parameter int unsigned ClockHz         = 100_000_000,
  parameter int unsigned Baud            = 3_000_000,
  parameter int unsigned LineLength      = 2048,
  parameter int unsigned PixelWidth      = 12,
  parameter int unsigned MaxWindow       = 255,
  parameter int unsigned IndexOversample = 4,
  parameter int unsigned BoardId         = 0,
  parameter bit          Polygon         = 1'b0,
  parameter int unsigned PointSlots      = 16,
  parameter int unsigned LineSlots       = 2,
  parameter int unsigned Lanes           = 2
) (
  input  wire logic                                         clk_i,
  input  wire logic                                         rst_i,

  // Sensor.
  input  wire logic                                         line_start_i,
  input  wire logic                                         line_end_i,
  input  wire logic                                         pixel_valid_i,
  input  wire logic [                       PixelWidth-1:0] pixel_i,
  input  wire logic [                                 15:0] pixel_overflow_count_i,
  output      logic                                         line_start_o,
  output      logic                                         exposure_o,

  // Mirror.
  input  wire logic [                  IndexOversample-1:0] comparator_i,
  input  wire logic [                  IndexOversample-1:0] gate_i,
  output      logic                                         drive_o,
  output      logic [           vrscan_pkg::LevelWidth-1:0] level_o,
  output      logic                                         level_pin_o,

  // Laser.
  output      logic                                         pulse_o,
  output      logic [           vrscan_pkg::PowerWidth-1:0] power_o,
  output      logic                                         power_pin_o,
  output      logic                                         index_light_o,
  output      logic [           vrscan_pkg::PowerWidth-1:0] startup_o,
  output      logic                                         startup_pin_o,
  output      logic                                         laser_enable_o,
  output      logic                                         heartbeat_o,
  // Of laser_guard, and of nothing else: a constant 1 takes the second line of defence away.
  input  wire logic                                         guard_ok_i,
  input  wire logic                                         guard_beat_i,
  input  wire logic [                                  4:0] guard_fault_i,

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
  output      logic [                                 39:0] m_axis_lines_tuser,
  // verilog_lint: waive-stop port-name-suffix

  // For lamps and oscilloscopes.
  output      logic [     vrscan_pkg::MirrorStateWidth-1:0] mirror_state_o,
  output      logic                                         measured_o,
  output      logic [      vrscan_pkg::LineNumberWidth-1:0] line_o,
  output      logic                                         centre_o,
  output      logic                                         centre_half_o
);

  // A reset for each part, a clock after rst_i; vrscan makes its own.
  logic rst_registers, rst_points, rst_lines;
  local_register u_reset_registers (.clk_i, .d_i(rst_i), .q_o(rst_registers));
  local_register u_reset_points (.clk_i, .d_i(rst_i), .q_o(rst_points));
  local_register u_reset_lines (.clk_i, .d_i(rst_i), .q_o(rst_lines));

  logic                              host_valid, host_done;
  logic [ link_pkg::AccessWidth-1:0] host_access;
  logic [link_pkg::AddressWidth-1:0] host_address;
  logic [                      31:0] host_written, host_read;
  logic [ link_pkg::StatusWidth-1:0] host_status;
  logic                              record_valid;
  logic [                       5:0] record_index;
  logic [                       7:0] record;
  logic                              readout_start, readout_end, readout_valid;
  logic [            PixelWidth-1:0] readout_pixel;
  vrscan_pkg::line_t                 readout_line;
  register_pkg::axi_t                axi;
  vrscan #(
    .ClockHz(ClockHz), .Baud(Baud), .LineLength(LineLength), .PixelWidth(PixelWidth),
    .MaxWindow(MaxWindow), .IndexOversample(IndexOversample), .BoardId(BoardId),
    .Polygon(Polygon)
  ) u_vrscan (
    .clk_i, .rst_i,
    .line_start_i, .line_end_i, .pixel_valid_i, .pixel_i, .pixel_overflow_count_i,
    .line_start_o, .exposure_o, .comparator_i, .gate_i, .drive_o, .level_o, .level_pin_o,
    .pulse_o, .power_o, .power_pin_o, .index_light_o, .startup_o, .startup_pin_o,
    .laser_enable_o, .heartbeat_o, .guard_ok_i, .guard_beat_i, .guard_fault_i, .focus_scl_i,
    .focus_sda_i, .focus_scl_low_o, .focus_sda_low_o, .rx_i, .tx_o, .mirror_state_o,
    .measured_o, .line_o, .centre_o, .centre_half_o,
    .host_valid_i(host_valid), .host_access_i(host_access), .host_address_i(host_address),
    .host_data_i(host_written), .host_done_o(host_done), .host_status_o(host_status),
    .host_data_o(host_read),
    .record_valid_o(record_valid), .record_index_o(record_index), .record_o(record),
    .readout_start_o(readout_start), .readout_end_o(readout_end),
    .readout_valid_o(readout_valid), .readout_pixel_o(readout_pixel),
    .readout_line_o(readout_line), .axi_i(axi)
  );

  axil_registers u_axil_registers (
    .clk_i, .rst_i(rst_registers),
    .s_axil_awvalid, .s_axil_awready, .s_axil_awaddr, .s_axil_wvalid, .s_axil_wready,
    .s_axil_wdata, .s_axil_wstrb, .s_axil_bvalid, .s_axil_bready, .s_axil_bresp,
    .s_axil_arvalid, .s_axil_arready, .s_axil_araddr, .s_axil_rvalid, .s_axil_rready,
    .s_axil_rdata, .s_axil_rresp,
    .bus_valid_o(host_valid), .bus_access_o(host_access), .bus_address_o(host_address),
    .bus_data_o(host_written), .bus_done_i(host_done), .bus_status_i(host_status),
    .bus_data_i(host_read),
    .refused_o(axi.axi_refused), .refused_address_o(axi.axi_refused_address)
  );

  axis_points #(.Slots(PointSlots)) u_axis_points (
    .clk_i, .rst_i(rst_points),
    .record_valid_i(record_valid), .record_index_i(record_index), .record_i(record),
    .m_axis_tvalid(m_axis_points_tvalid), .m_axis_tready(m_axis_points_tready),
    .m_axis_tdata(m_axis_points_tdata), .m_axis_tlast(m_axis_points_tlast),
    .m_axis_tuser(m_axis_points_tuser), .points_dropped_o(axi.axi_points_dropped)
  );

  axis_lines #(
    .LineLength(LineLength), .PixelWidth(PixelWidth), .Lanes(Lanes), .Slots(LineSlots)
  ) u_axis_lines (
    .clk_i, .rst_i(rst_lines),
    .line_start_i(readout_start), .line_end_i(readout_end), .pixel_valid_i(readout_valid),
    .pixel_i(readout_pixel), .line_i(readout_line),
    .m_axis_tvalid(m_axis_lines_tvalid), .m_axis_tready(m_axis_lines_tready),
    .m_axis_tdata(m_axis_lines_tdata), .m_axis_tlast(m_axis_lines_tlast),
    .m_axis_tuser(m_axis_lines_tuser), .lines_dropped_o(axi.axi_lines_dropped)
  );

endmodule

`default_nettype wire
