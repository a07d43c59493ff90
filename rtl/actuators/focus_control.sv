// focus_control: keeps the lens where the scene is sharp, with a piezo motor and its position
// sensor on I2C: VR-SCAN IV-E.
//
// Wiring only.  focus_filter averages the distance of good points, focus_target looks up where the
// lens should be for it, focus_motor brings the motor there by commands, which i2c_master puts on
// the bus; with focus_protocol, m3_motor translates them before.
//
//   valid_i      a point; at least 26 clocks after the last one, or it is ignored
//   focus_mode         0 OFF, 1 MANUAL: focus_manual is the target, 2 AUTOMATIC
//   focus_target, focus_position  unsigned, in steps of the sensor
//   focus_protocol     0: the motor has registers, 1: it is an M3; a command ends as it began
//   focus_recovery_count  begun recoveries of the bus; stops at its largest value
//   focus_quarter_clks, focus_stretch_clks  i2c_master's quarter_i and timeout_i
//   Latency  valid_i to focus_distance: 8 clocks, to focus_target: 26 clocks, in which the
//            table and its registers must hold; focus_manual to it: 1 clock
//   Model    vrscan.clocked.focus_control, bit-exact

`default_nettype none

module focus_control #(
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                                      clk_i,
  input  wire logic                                      rst_i,

  // Points.
  input  wire logic                                      valid_i,
  input  wire vrscan_pkg::point_t                        point_i,

  // Pins, asynchronous; 1 pulls the line low.
  input  wire logic                                      focus_scl_i,
  input  wire logic                                      focus_sda_i,
  output      logic                                      focus_scl_low_o,
  output      logic                                      focus_sda_low_o,

  // The table.
  input  wire register_pkg::focus_table_t                focus_table_i,

  // Configuration.
  input  wire register_pkg::focus_t                      focus_i,

  // Status.
  output      register_pkg::focus_status_t               focus_status_o
);

  register_pkg::focus_status_t status;
  assign focus_status_o = status;

  logic distance_valid, lapse, target_busy, target_known;
  focus_filter u_focus_filter (
    .clk_i, .rst_i, .valid_i, .point_i, .focus_i,
    .busy_i(target_busy), .valid_o(distance_valid), .distance_o(status.focus_distance),
    .lapse_o(lapse)
  );

  focus_target u_focus_target (
    .clk_i, .rst_i, .focus_table_i, .focus_i,
    .valid_i(distance_valid), .distance_i(status.focus_distance), .lapse_i(lapse),
    .busy_o(target_busy), .target_o(status.focus_target), .known_o(target_known)
  );

  logic        command_valid, command_read;
  logic [ 7:0] command_register;
  logic [15:0] command_data;
  logic        m3_busy, m3_valid, m3_command_valid, m3_command_read;
  logic [ 3:0] m3_status;
  logic [15:0] m3_position;
  logic        bus_valid, byte_valid, last;
  logic [ 2:0] bus_status;
  logic [31:0] bus_data;
  logic [ 7:0] written_byte, read_byte;
  logic        unused_bus_data;
  assign unused_bus_data = ^bus_data[31:16];
  focus_motor #(.CountWidth(CountWidth)) u_focus_motor (
    .clk_i, .rst_i, .focus_i,
    .target_i(status.focus_target), .known_i(target_known),
    .command_valid_o(command_valid), .command_read_o(command_read),
    .command_register_o(command_register), .command_data_o(command_data),
    .reply_valid_i (m3_valid || (bus_valid && !m3_busy)),
    .reply_status_i(m3_valid ? m3_status : {1'b0, bus_status}),
    .reply_data_i  (m3_valid ? m3_position : bus_data[15:0]),
    .state_o(status.focus_state), .fault_o(status.focus_fault),
    .position_o(status.focus_position), .in_position_o(status.focus_in_position),
    .nack_count_o(status.focus_nack_count), .stretch_count_o(status.focus_stretch_count),
    .stuck_count_o(status.focus_stuck_count),
    .arbitration_count_o(status.focus_arbitration_count),
    .timeout_count_o(status.focus_timeout_count), .reply_count_o(status.focus_reply_count)
  );

  m3_motor u_m3_motor (
    .clk_i, .rst_i,
    .valid_i(command_valid && focus_i.focus_protocol),
    .read_i(command_read), .target_i(command_data),
    .busy_o(m3_busy), .valid_o(m3_valid), .status_o(m3_status), .position_o(m3_position),
    .command_valid_o(m3_command_valid), .command_read_o(m3_command_read),
    .byte_o(written_byte), .last_o(last), .byte_valid_i(byte_valid), .byte_i(read_byte),
    .reply_valid_i(bus_valid), .reply_status_i(bus_status),
    .motor_status_o(status.focus_motor_status)
  );

  logic [CountWidth-1:0] recovery_count;
  assign status.focus_recovery_count = vrscan_pkg::CounterWidth'(recovery_count);
  i2c_master #(.CountWidth(CountWidth)) u_i2c_master (
    .clk_i, .rst_i,
    .valid_i(m3_command_valid || (command_valid && !focus_i.focus_protocol)),
    .ready_o(),  // only focus_motor gives commands, m3_motor in its place
    .read_i(m3_busy ? m3_command_read : command_read), .address_i(focus_i.focus_address),
    .register_i(command_register), .bytes_i(2'd1), .data_i({16'd0, command_data}),
    .stream_i(m3_busy), .byte_i(written_byte), .last_i(last),
    .byte_valid_o(byte_valid), .byte_o(read_byte),
    .valid_o(bus_valid), .status_o(bus_status), .data_o(bus_data),
    .scl_i(focus_scl_i), .sda_i(focus_sda_i),
    .scl_low_o(focus_scl_low_o), .sda_low_o(focus_sda_low_o),
    .quarter_i(focus_i.focus_quarter_clks), .timeout_i(focus_i.focus_stretch_clks),
    .recovery_count_o(recovery_count)
  );

endmodule

`default_nettype wire
