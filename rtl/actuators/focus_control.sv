// focus_control: keeps the lens where the scene is sharp, with a piezo motor and its position
// sensor on I2C: VR-SCAN IV-E.
//
// Distance.  Good points, those measured without a flag of range or mirror and not of a test line,
// are averaged: average += (z - average) / 2**s, to nearest, with 16 more bits kept.  s grows from
// 0 with each power of two of good points, up to focus_average_shift_i: so the first 2**s are
// weighted about evenly.  From the point that completes them on, focus_distance_o follows.  A good
// point after more than focus_lapse_i others on end starts anew; the distance stands until then.
//
// Position.  Of a table with 64 entries, linear between them, to nearest, half up: entry i is for
// focus_z_begin_i + i 2**(focus_z_shift_i + 10) steps of z; before the first and beyond the last
// these two hold.  In mode AUTOMATIC the first position is the target; later ones only when they
// are more than focus_hysteresis_i from it, focus_hold_i points on end (0 is as 1): it does not
// hunt.
//
// Motor.  Registers 0 and 1 of the device at focus_address_i are its target, 2 and 3 its
// position, high byte first.
//
//   OFF    mode 0 or 3, from any state; a command on the bus is ended, its reply counted only
//   WAIT   no target yet: nothing is written
//   MOVE   the target is written, the position read until it is within focus_tolerance_i: HOLD.
//          Where it is not in a read focus_timeout_clks_i after the write, it is written again
//   HOLD   the position is read on; off by more than the tolerance, the target is written again
//   FAULT  nothing is written or read until the mode is 0 or 3
//
// A new target is written in MOVE and HOLD.  focus_poll_clks_i lie between a reply and the next
// command.  A command that fails is given again, focus_retries_i times on end; a target that is
// not reached, too: then FAULT.
//
//   valid_i      a clock a point; at least 30 clocks apart, an earlier one is ignored
//   focus_mode_i     0 OFF, 1 MANUAL: focus_manual_i is the target, 2 AUTOMATIC
//   focus_fault_o    why FAULT came, kept until MOVE: an i2c_master status, or 6 not reached
//   focus_in_position_o  the last position read is within the tolerance of the target
//   focus_position_o     the last one read
//   focus_*_count_o  commands that ended so; targets not reached; begun recoveries of the bus.
//                each stops at its largest
//   focus_quarter_clks_i, focus_stretch_clks_i  quarter_i and timeout_i of i2c_master
//   Positions are unsigned, in steps of the sensor.
//   Model    vrscan.fixed.focus_control, bit-exact

`default_nettype none

module focus_control #(
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

  // Pins, asynchronous; 1 pulls the line low.
  input  wire logic                                      focus_scl_i,
  input  wire logic                                      focus_sda_i,
  output      logic                                      focus_scl_low_o,
  output      logic                                      focus_sda_low_o,

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

endmodule

`default_nettype wire
