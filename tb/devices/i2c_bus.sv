// i2c_bus: i2c_master and i2c_device on the two open-drain lines, which anybody else may pull too.
//
//   other_*_low_i  another party's pulls
//   flip_*_i       the master's pin is not what the line is
//   scl_o, sda_o   the lines
//   device_rst_i   of the device alone: rst_i does not touch it, as on a real bus

`default_nettype none

module i2c_bus #(
  parameter int unsigned TimeoutWidth = 24,
  parameter int unsigned CountWidth   = 16
) (
  input  wire logic                    clk_i,
  input  wire logic                    rst_i,
  input  wire logic                    device_rst_i,

  input  wire logic                    valid_i,
  output      logic                    ready_o,
  input  wire logic                    read_i,
  input  wire logic [             6:0] address_i,
  input  wire logic [             7:0] register_i,
  input  wire logic [             1:0] bytes_i,
  input  wire logic [            31:0] data_i,

  input  wire logic                    stream_i,
  input  wire logic [             7:0] byte_i,
  input  wire logic                    last_i,
  output      logic                    byte_valid_o,
  output      logic [             7:0] byte_o,

  output      logic                    valid_o,
  output      logic [             2:0] status_o,
  output      logic [            31:0] data_o,

  output      logic                    scl_o,
  output      logic                    sda_o,
  output      logic                    scl_low_o,
  output      logic                    sda_low_o,
  output      logic                    device_scl_low_o,
  output      logic                    device_sda_low_o,
  input  wire logic                    other_scl_low_i,
  input  wire logic                    other_sda_low_i,
  input  wire logic                    flip_scl_i,
  input  wire logic                    flip_sda_i,

  input  wire logic [            15:0] quarter_i,
  input  wire logic [TimeoutWidth-1:0] timeout_i,
  output      logic [  CountWidth-1:0] recovery_count_o,

  input  wire logic [             6:0] device_address_i,
  input  wire logic                    nack_address_i,
  input  wire logic [             3:0] nack_byte_i,
  input  wire logic [            15:0] stretch_clks_i,
  input  wire logic                    stretch_bits_i,
  input  wire logic                    hold_scl_i,
  input  wire logic                    hold_sda_i,
  output      logic [            15:0] position_o
);

  assign scl_o = !(scl_low_o || device_scl_low_o || other_scl_low_i);
  assign sda_o = !(sda_low_o || device_sda_low_o || other_sda_low_i);

  i2c_master #(
    .TimeoutWidth(TimeoutWidth),
    .CountWidth  (CountWidth)
  ) u_i2c_master (
    .clk_i, .rst_i,
    .valid_i, .ready_o, .read_i, .address_i, .register_i, .bytes_i, .data_i,
    .stream_i, .byte_i, .last_i, .byte_valid_o, .byte_o,
    .valid_o, .status_o, .data_o,
    .scl_i(scl_o ^ flip_scl_i), .sda_i(sda_o ^ flip_sda_i), .scl_low_o, .sda_low_o,
    .quarter_i, .timeout_i, .recovery_count_o
  );

  i2c_device u_i2c_device (
    .clk_i, .rst_i(device_rst_i),
    .scl_i(scl_o), .sda_i(sda_o), .scl_low_o(device_scl_low_o), .sda_low_o(device_sda_low_o),
    .m3_i(1'b0), .offset_i('0), .status_i('0), .spoil_i('1), .spoilt_i('0),
    .address_i(device_address_i),
    .nack_address_i, .nack_byte_i, .stretch_clks_i, .stretch_bits_i, .hold_scl_i, .hold_sda_i,
    .stall_i(1'b0), .push_i('0), .noise_i('0),
    .position_o
  );

endmodule

`default_nettype wire
