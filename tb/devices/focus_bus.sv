// focus_bus: focus_control and the motor of i2c_device on the two open-drain lines, which anybody
// else may pull too.
//
//   other_*_low_i  another party's pulls
//   scl_o, sda_o   the lines
//   device_rst_i   of the device alone: rst_i does not touch it, as on a real bus
//   position_o     where the motor is

`default_nettype none

module focus_bus #(
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                                      clk_i,
  input  wire logic                                      rst_i,

  // Points.
  input  wire logic                                      valid_i,
  input  wire vrscan_pkg::point_t                        point_i,

  // The bus.
  output      logic                                      scl_o,
  output      logic                                      sda_o,
  output      logic                                      focus_scl_low_o,
  output      logic                                      focus_sda_low_o,
  output      logic                                      device_scl_low_o,
  output      logic                                      device_sda_low_o,
  input  wire logic                                      other_scl_low_i,
  input  wire logic                                      other_sda_low_i,

  // The device.
  input  wire logic                                      device_rst_i,
  input  wire logic                                      m3_i,
  input  wire logic signed [                       31:0] offset_i,
  input  wire logic        [                       23:0] status_i,
  input  wire logic        [                        4:0] spoil_i,
  input  wire logic        [                        7:0] spoilt_i,
  input  wire logic        [                        6:0] device_address_i,
  input  wire logic                                      nack_address_i,
  input  wire logic        [                        3:0] nack_byte_i,
  input  wire logic        [                       15:0] stretch_clks_i,
  input  wire logic                                      stretch_bits_i,
  input  wire logic                                      hold_scl_i,
  input  wire logic                                      hold_sda_i,
  input  wire logic                                      stall_i,
  input  wire logic signed [                       15:0] push_i,
  input  wire logic signed [                        7:0] noise_i,
  output      logic        [                       15:0] position_o,

  // Registers.
  input  wire register_pkg::focus_t                      focus_i,
  input  wire register_pkg::focus_table_t                focus_table_i,
  output      register_pkg::focus_status_t               focus_status_o
);

  assign scl_o = !(focus_scl_low_o || device_scl_low_o || other_scl_low_i);
  assign sda_o = !(focus_sda_low_o || device_sda_low_o || other_sda_low_i);

  focus_control #(
    .CountWidth(CountWidth)
  ) u_focus_control (
    .clk_i, .rst_i, .valid_i, .point_i, .focus_scl_low_o, .focus_sda_low_o,
    .focus_i, .focus_table_i, .focus_status_o,
    .focus_scl_i(scl_o),
    .focus_sda_i(sda_o)
  );

  i2c_device #(
    .StepClks(4),
    .Travel  (6000)
  ) u_i2c_device (
    .clk_i, .rst_i(device_rst_i),
    .scl_i(scl_o), .sda_i(sda_o), .scl_low_o(device_scl_low_o), .sda_low_o(device_sda_low_o),
    .m3_i, .offset_i, .status_i, .spoil_i, .spoilt_i,
    .address_i(device_address_i),
    .nack_address_i, .nack_byte_i, .stretch_clks_i, .stretch_bits_i, .hold_scl_i, .hold_sda_i,
    .stall_i, .push_i, .noise_i,
    .position_o
  );

endmodule

`default_nettype wire
