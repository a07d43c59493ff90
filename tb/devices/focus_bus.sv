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
  input  wire logic                                      measured_i,
  input  wire logic        [  vrscan_pkg::FlagWidth-1:0] flags_i,
  input  wire logic                                      test_i,
  input  wire logic signed [vrscan_pkg::LengthWidth-1:0] z_i,

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

  // The table.
  input  wire logic                                      focus_table_write_i,
  input  wire logic        [                        5:0] focus_table_index_i,
  input  wire logic        [                       15:0] focus_table_position_i,

  // Configuration.
  input  wire logic        [                        1:0] focus_mode_i,
  input  wire logic        [                       15:0] focus_manual_i,
  input  wire logic        [                        3:0] focus_average_shift_i,
  input  wire logic        [                       15:0] focus_lapse_i,
  input  wire logic signed [vrscan_pkg::LengthWidth-1:0] focus_z_begin_i,
  input  wire logic        [                        3:0] focus_z_shift_i,
  input  wire logic        [                       15:0] focus_hysteresis_i,
  input  wire logic        [                       15:0] focus_hold_i,
  input  wire logic        [                        6:0] focus_address_i,
  input  wire logic        [                       15:0] focus_quarter_clks_i,
  input  wire logic        [                       23:0] focus_stretch_clks_i,
  input  wire logic        [                       23:0] focus_poll_clks_i,
  input  wire logic        [                       15:0] focus_tolerance_i,
  input  wire logic        [                       31:0] focus_timeout_clks_i,
  input  wire logic        [                        7:0] focus_retries_i,

  // Status.
  output      logic        [                        2:0] focus_state_o,
  output      logic        [                        2:0] focus_fault_o,
  output      logic signed [vrscan_pkg::LengthWidth-1:0] focus_distance_o,
  output      logic        [                       15:0] focus_target_o,
  output      logic        [                       15:0] focus_position_o,
  output      logic                                      focus_in_position_o,
  output      logic        [             CountWidth-1:0] focus_nack_count_o,
  output      logic        [             CountWidth-1:0] focus_stretch_count_o,
  output      logic        [             CountWidth-1:0] focus_stuck_count_o,
  output      logic        [             CountWidth-1:0] focus_arbitration_count_o,
  output      logic        [             CountWidth-1:0] focus_timeout_count_o,
  output      logic        [             CountWidth-1:0] focus_recovery_count_o
);

  assign scl_o = !(focus_scl_low_o || device_scl_low_o || other_scl_low_i);
  assign sda_o = !(focus_sda_low_o || device_sda_low_o || other_sda_low_i);

  focus_control #(
    .CountWidth(CountWidth)
  ) u_focus_control (
    .clk_i, .rst_i, .valid_i, .measured_i, .flags_i, .test_i, .z_i, .focus_scl_low_o,
    .focus_sda_low_o, .focus_table_write_i, .focus_table_index_i, .focus_table_position_i,
    .focus_mode_i, .focus_manual_i, .focus_average_shift_i, .focus_lapse_i, .focus_z_begin_i,
    .focus_z_shift_i, .focus_hysteresis_i, .focus_hold_i, .focus_address_i, .focus_quarter_clks_i,
    .focus_stretch_clks_i, .focus_poll_clks_i, .focus_tolerance_i, .focus_timeout_clks_i,
    .focus_retries_i, .focus_state_o, .focus_fault_o, .focus_distance_o, .focus_target_o,
    .focus_position_o, .focus_in_position_o, .focus_nack_count_o, .focus_stretch_count_o,
    .focus_stuck_count_o, .focus_arbitration_count_o, .focus_timeout_count_o,
    .focus_recovery_count_o,
    .focus_scl_i(scl_o),
    .focus_sda_i(sda_o)
  );

  i2c_device #(
    .Travel(6000)
  ) u_i2c_device (
    .clk_i, .rst_i(device_rst_i),
    .scl_i(scl_o), .sda_i(sda_o), .scl_low_o(device_scl_low_o), .sda_low_o(device_sda_low_o),
    .address_i(device_address_i),
    .nack_address_i, .nack_byte_i, .stretch_clks_i, .stretch_bits_i, .hold_scl_i, .hold_sda_i,
    .stall_i, .push_i, .noise_i,
    .position_o
  );

endmodule

`default_nettype wire
