// vrscan: the instrument, from the pins of sensor, mirror, laser and lens to a serial line.
//
// Wiring, but for the choice between sensor and test lines.  Device-independent: clocks, pins that
// sample twice a clock, and laser_guard, which needs a clock of its own, are the board's.
//
//   line_start_i ..  the sensor's readout, in clk_i; pixel_overflow_count_i of the FIFO that brings
//                 it here, 0 where there is none
//   exposure_o    the sensor is to expose; its readout begins after that.  line_start_o is the
//                 start of the line's time
//   comparator_i, gate_i  of the index, IndexOversample samples a clock, bit 0 the oldest
//   drive_o, level_o, level_pin_o  to the mirror
//   pulse_o .. heartbeat_o, guard_*_i  laser_control's
//   focus_*_i     asynchronous; *_low_o pulls the line low
//   rx_i, tx_o    8N1, Baud until the host writes uart_step; docs/link.md
//   host_*        another host on the bus to the registers, as bus_arbiter has its sources; each access
//                 is a sign of life.  record_*, readout_*: all points and lines; axi_i: what
//                 the registers tell of who takes them.  vrscan_axi.sv uses these
//   line_o, centre_o, centre_half_o  the line that goes on, and when the middle of its pulse is
//   Test lines    from test_start on until the run has ended they take the sensor's place; a line of
//                 the sensor that is cut off by that counts as unfinished.  Their points carry
//                 test_angle and test_power, and nothing of mirror and laser
//   Model         each module's own.  tb/link/test_link_board.py lets this top compute on the virtual board,
//                 and compares every field of every point with vrscan.fixed.vrscan_chain

`default_nettype none

module vrscan #(
  parameter int unsigned ClockHz         = 100_000_000,
  parameter int unsigned Baud            = 3_000_000,
  parameter int unsigned LineLength      = 2048,
  parameter int unsigned PixelWidth      = 12,
  parameter int unsigned MaxWindow       = 255,
  parameter int unsigned IndexOversample = 4,
  parameter int unsigned BoardId         = 0,
  parameter bit          Polygon         = 1'b0  // the index is a polygon's start of scan
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

  // Host.
  input  wire logic                                         rx_i,
  output      logic                                         tx_o,
  input  wire logic                                         host_valid_i,
  input  wire logic [            link_pkg::AccessWidth-1:0] host_access_i,
  input  wire logic [           link_pkg::AddressWidth-1:0] host_address_i,
  input  wire logic [                                 31:0] host_data_i,
  output      logic                                         host_done_o,
  output      logic [            link_pkg::StatusWidth-1:0] host_status_o,
  output      logic [                                 31:0] host_data_o,
  output      logic                                         record_valid_o,
  output      logic [                                  5:0] record_index_o,
  output      logic [                                  7:0] record_o,
  output      logic                                         readout_start_o,
  output      logic                                         readout_end_o,
  output      logic                                         readout_valid_o,
  output      logic [                       PixelWidth-1:0] readout_pixel_o,
  output      vrscan_pkg::line_t                            readout_line_o,
  input  wire register_pkg::axi_t                           axi_i,

  // For lamps and oscilloscopes.
  output      logic [     vrscan_pkg::MirrorStateWidth-1:0] mirror_state_o,
  output      logic                                         measured_o,
  output      logic [      vrscan_pkg::LineNumberWidth-1:0] line_o,
  output      logic                                         centre_o,
  output      logic                                         centre_half_o
);

  // ---- a reset for each room, a clock after rst_i; register_file makes its own ----
  logic rst_own, rst_uart_link, rst_mirror_loop, rst_laser_control, rst_test_line, rst_line_tag;
  logic rst_vrscan_chain, rst_point_record, rst_point_packer, rst_line_capture, rst_focus_control;
  logic rst_commit_control, rst_bus_arbiter;
  local_register u_reset_own (.clk_i, .d_i(rst_i), .q_o(rst_own));
  local_register u_reset_uart_link (.clk_i, .d_i(rst_i), .q_o(rst_uart_link));
  local_register u_reset_mirror_loop (.clk_i, .d_i(rst_i), .q_o(rst_mirror_loop));
  local_register u_reset_laser_control (.clk_i, .d_i(rst_i), .q_o(rst_laser_control));
  local_register u_reset_test_line (.clk_i, .d_i(rst_i), .q_o(rst_test_line));
  local_register u_reset_line_tag (.clk_i, .d_i(rst_i), .q_o(rst_line_tag));
  local_register u_reset_vrscan_chain (.clk_i, .d_i(rst_i), .q_o(rst_vrscan_chain));
  local_register u_reset_point_record (.clk_i, .d_i(rst_i), .q_o(rst_point_record));
  local_register u_reset_point_packer (.clk_i, .d_i(rst_i), .q_o(rst_point_packer));
  local_register u_reset_line_capture (.clk_i, .d_i(rst_i), .q_o(rst_line_capture));
  local_register u_reset_focus_control (.clk_i, .d_i(rst_i), .q_o(rst_focus_control));
  local_register u_reset_commit_control (.clk_i, .d_i(rst_i), .q_o(rst_commit_control));
  local_register u_reset_bus_arbiter (.clk_i, .d_i(rst_i), .q_o(rst_bus_arbiter));

  // ---- registers ----
  register_pkg::identity_t        identity;
  register_pkg::identity_status_t identity_status;
  register_pkg::peak_t            peak;
  register_pkg::geometry_t        geometry;
  register_pkg::chain_t           chain;
  register_pkg::mirror_t          mirror;
  register_pkg::mirror_limits_t   mirror_limits;
  register_pkg::motion_t          motion;
  register_pkg::line_t            line;
  register_pkg::mirror_status_t   mirror_status, mirror_status_q;
  register_pkg::link_t            link;
  register_pkg::link_status_t     link_status;
  register_pkg::laser_t           laser;
  register_pkg::laser_limits_t    laser_limits;
  register_pkg::laser_status_t    laser_status;
  register_pkg::points_t          points;
  register_pkg::points_status_t   points_status;
  register_pkg::focus_t           focus;
  register_pkg::focus_status_t    focus_status;
  register_pkg::test_t            test;
  register_pkg::test_status_t     test_status;
  register_pkg::sensor_t          sensor;
  register_pkg::sensor_status_t   sensor_status;
  register_pkg::locks_t           locks;
  register_pkg::table_t           table_entry;
  register_pkg::focus_table_t     focus_table;
  register_pkg::free_t            free;
  register_pkg::free_table_t      free_table;
  register_pkg::map_t             map;
  register_pkg::map_access_t      map_access;
  register_pkg::map_table_t       map_table;
  register_pkg::map_table_status_t map_table_status;
  register_pkg::commit_t          commit;
  register_pkg::commit_status_t   commit_status;
  logic       commit_copy, commit_hold, commit_take, superseding, chain_empty, renewing;
  logic [9:0] commit_index;
  logic                              bus_valid, bus_done;
  logic [ link_pkg::AccessWidth-1:0] bus_access;
  logic [link_pkg::AddressWidth-1:0] bus_address;
  logic [ link_pkg::StatusWidth-1:0] bus_status;
  logic [                      31:0] bus_written, bus_read;
  register_file u_register_file (
    .clk_i, .rst_i,
    .bus_valid_i(bus_valid), .bus_access_i(bus_access), .bus_address_i(bus_address),
    .bus_data_i(bus_written), .bus_done_o(bus_done), .bus_status_o(bus_status),
    .bus_data_o(bus_read),
    .identity_o(identity), .identity_status_i(identity_status), .peak_o(peak),
    .geometry_o(geometry), .chain_i(chain), .mirror_o(mirror), .mirror_limits_o(mirror_limits),
    .motion_o(motion), .line_o(line), .mirror_status_i(mirror_status_q), .link_o(link),
    .link_status_i(link_status), .laser_o(laser), .laser_limits_o(laser_limits),
    .laser_status_i(laser_status), .points_o(points), .points_status_i(points_status),
    .focus_o(focus), .focus_status_i(focus_status), .test_o(test), .test_status_i(test_status),
    .sensor_o(sensor), .sensor_status_i(sensor_status), .locks_o(locks), .table_o(table_entry),
    .focus_table_o(focus_table), .free_o(free), .free_table_o(free_table),
    .map_o(map), .map_access_o(map_access), .map_table_o(map_table),
    .map_table_status_i(map_table_status),
    .commit_o(commit), .commit_status_i(commit_status), .axi_i,
    .waiting_i(commit_status.commit_waiting), .copy_i(commit_copy), .copy_index_i(commit_index),
    .bank_i(commit_status.configuration), .take_i(commit_take)
  );

  // ---- what waits takes effect together ----
  commit_control #(.Entries(1024)) u_commit_control (
    .clk_i, .rst_i(rst_commit_control), .commit_i(commit), .commit_status_o(commit_status),
    .copy_o(commit_copy), .index_o(commit_index),
    .hold_o(commit_hold), .empty_i(chain_empty), .take_o(commit_take),
    .superseding_o(superseding), .renewing_i(renewing)
  );

  // The loop is not where the registers are.
  always_ff @(posedge clk_i) mirror_status_q <= mirror_status;

  logic [47:0] uptime_q;
  always_ff @(posedge clk_i) uptime_q <= rst_own ? '0 : uptime_q + 48'd1;
  assign identity_status.board_id         = 16'(BoardId);
  assign identity_status.clock_hz         = ClockHz;
  assign identity_status.line_length      = 16'(LineLength);
  assign identity_status.pixel_width      = 8'(PixelWidth);
  assign identity_status.max_window       = 8'(MaxWindow);
  assign identity_status.lanes            = 8'd1;
  assign identity_status.index_oversample = 8'(IndexOversample);
  assign identity_status.uptime           = uptime_q;
  assign sensor_status.pixel_overflow_count = pixel_overflow_count_i;
  assign mirror_state_o                   = mirror_status.mirror_state;

  // The locks and the accessed bank are the registers' own, scratch and events say nothing to anyone.
  logic unused;
  assign unused = &{1'b0, identity, locks, map_access, test.test_start, test.test_stop};

  // ---- host ----
  localparam int unsigned Streams = 2;
  logic [  Streams-1:0] packet_valid, packet_ready, packet_last;
  logic [8*Streams-1:0] packet_data;
  logic                 stream_start, stream_stop, capture_start, alive;
  logic [link_pkg::StreamFormatWidth-1:0] stream_format;
  logic [          7:0] stream_step;
  logic [         31:0] capture_argument;
  logic [link_pkg::CaptureModeWidth-1:0] capture_mode;
  logic                              link_valid, link_done;
  logic [ link_pkg::AccessWidth-1:0] link_access;
  logic [link_pkg::AddressWidth-1:0] link_address;
  logic [                      31:0] link_written;
  uart_link #(.ClockHz(ClockHz), .Baud(Baud), .Streams(Streams)) u_uart_link (
    .clk_i, .rst_i(rst_uart_link), .rx_i, .tx_o, .link_i(link), .link_status_o(link_status),
    .packet_valid_i(packet_valid), .packet_ready_o(packet_ready), .packet_data_i(packet_data),
    .packet_last_i(packet_last),
    .bus_valid_o(link_valid), .bus_access_o(link_access), .bus_address_o(link_address),
    .bus_data_o(link_written), .bus_done_i(link_done), .bus_status_i(host_status_o),
    .bus_data_i(host_data_o),
    .stream_start_o(stream_start), .stream_stop_o(stream_stop), .stream_format_o(stream_format),
    .stream_step_o(stream_step),
    .capture_start_o(capture_start), .capture_mode_o(capture_mode),
    .capture_argument_o(capture_argument), .capture_busy_i(points_status.capture_busy),
    .alive_o(alive)
  );

  bus_arbiter u_bus_arbiter (
    .clk_i, .rst_i(rst_bus_arbiter),
    .valid_i({host_valid_i, link_valid}), .access_i({host_access_i, link_access}),
    .address_i({host_address_i, link_address}), .data_i({host_data_i, link_written}),
    .done_o({host_done_o, link_done}), .status_o(host_status_o), .data_o(host_data_o),
    .bus_valid_o(bus_valid), .bus_access_o(bus_access), .bus_address_o(bus_address),
    .bus_data_o(bus_written), .bus_done_i(bus_done), .bus_status_i(bus_status),
    .bus_data_i(bus_read)
  );

  // ---- mirror ----
  logic [IndexOversample-1:0] index_gate;
  if (Polygon) begin : gen_lit  // its one diode shows every change of the light
    lit_gate #(
      .Samples(IndexOversample), .AnswerClks(ClockHz / 1_000_000 + 1), .LevelClks(ClockHz / 200)
    ) u_lit_gate (
      .clk_i, .rst_i(rst_laser_control), .pulse_i(pulse_o), .index_light_i(index_light_o),
      .startup_i(startup_o), .gate_i, .gate_o(index_gate)
    );
  end else begin : gen_gate
    assign index_gate = gate_i;
  end

  logic                                          pulse, angle_valid;
  logic        [vrscan_pkg::LineNumberWidth-1:0] angle_line;
  logic signed [     vrscan_pkg::AngleWidth-1:0] angle;
  logic        [vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags;
  logic        [vrscan_pkg::ConfidenceWidth-1:0] mirror_confidence;
  mirror_loop #(
    .IndexOversample  (IndexOversample),
    .PeriodCeilingClks(ClockHz / 100),
    .SettleCeilingClks(ClockHz * 10),
    .LostCeilingClks  (ClockHz / 40)
  ) u_mirror_loop (
    .clk_i, .rst_i(rst_mirror_loop), .comparator_i, .gate_i(index_gate), .drive_o, .level_o,
    .level_pin_o,
    .mirror_i(mirror), .mirror_limits_i(mirror_limits), .motion_i(motion), .line_i(line),
    .table_i(table_entry), .take_i(commit_take), .renewing_o(renewing),
    .mirror_status_o(mirror_status),
    .line_start_o, .exposure_o, .laser_o(pulse), .line_o, .centre_o, .centre_half_o,
    .angle_valid_o(angle_valid), .angle_line_o(angle_line), .angle_o(angle),
    .mirror_flags_o(mirror_flags), .confidence_o(mirror_confidence)
  );

  // ---- laser ----
  logic scanning, startup_ok;
  scan_safeguard #(
    .IndexOversample(IndexOversample),
    .SettleClks     (ClockHz / 10_000_000 + 1),
    .LightClks      (ClockHz / 100),
    .PeriodFloorClks(Polygon ? ClockHz / 2_000 : ClockHz / 500),
    .OuterFloor     (Polygon ? 0 : 6_144),
    .DarkClks       (ClockHz / 40),
    .PauseClks      (ClockHz / 4)
  ) u_scan_safeguard (
    .clk_i, .rst_i(rst_laser_control), .comparator_i, .gate_i(index_gate),
    .word_i(mirror_status.mirror_word),
    .state_i(mirror_state_o), .enable_i(laser.laser_enable),
    .scanning_o(scanning), .startup_ok_o(startup_ok)
  );

  logic                              point_valid, seen_valid_q;
  vrscan_pkg::point_t                point, seen_q;
  logic [vrscan_pkg::PowerWidth-1:0] power_line;
  logic                              inward_line;
  laser_control #(
    .PixelWidth         (PixelWidth),
    .PulseCeilingClks   (ClockHz / 100_000),
    .BucketCeiling      ((ClockHz / 1_000_000) * 2_097_152),
    .WatchdogCeilingClks(ClockHz)
  ) u_laser_control (
    .clk_i, .rst_i(rst_laser_control),
    .laser_i(laser), .laser_limits_i(laser_limits), .laser_status_o(laser_status),
    .pulse_i(pulse), .line_start_i(line_start_o), .centre_i(centre_o), .state_i(mirror_state_o),
    .index_alive_i(mirror_status.index_alive), .scanning_i(scanning), .startup_ok_i(startup_ok),
    .phase_i(mirror_status.mirror_phase[vrscan_pkg::TurnWidth-1-:16]),
    .alive_i(alive || host_valid_i),
    .guard_ok_i, .guard_beat_i, .guard_fault_i,
    .point_valid_i(seen_valid_q), .point_i(seen_q),
    .pulse_o, .power_o, .power_pin_o, .index_light_o, .startup_o, .startup_pin_o,
    .enable_o(laser_enable_o), .heartbeat_o, .power_line_o(power_line), .inward_line_o(inward_line)
  );

  // ---- lines: the sensor's or the test's, and what belongs to each ----
  typedef struct packed {
    logic                  start;
    logic                  last;
    logic                  valid;
    logic [PixelWidth-1:0] pixel;
    vrscan_pkg::line_t     line;
  } readout_t;
  readout_t from_sensor, from_test, readout_q, readout_q2;
  assign {from_sensor.start, from_sensor.last} = {line_start_i, line_end_i};
  assign {from_sensor.valid, from_sensor.pixel} = {pixel_valid_i, pixel_i};
  line_tag u_line_tag (
    .clk_i, .rst_i(rst_line_tag),
    .enable_i(mirror.line_enable), .exposure_i(exposure_o), .line_i(line_o), .centre_i(centre_o),
    .power_i(power_line),
    .inward_i(inward_line), .lens_i(focus_status.focus_position),
    .angle_valid_i(angle_valid), .angle_line_i(angle_line), .angle_i(angle),
    .mirror_flags_i(mirror_flags), .confidence_i(mirror_confidence),
    .superseding_i(superseding),
    .line_start_i, .line_end_i, .tag_o(from_sensor.line), .sensor_i(sensor),
    .untagged_count_o(sensor_status.untagged_count), .unread_count_o(sensor_status.unread_count),
    .mistimed_count_o(sensor_status.mistimed_count)
  );

  test_line #(.LineLength(LineLength), .PixelWidth(PixelWidth)) u_test_line (
    .clk_i, .rst_i(rst_test_line), .test_i(test), .test_running_o(test_status.test_running),
    .line_start_o(from_test.start), .line_end_o(from_test.last), .pixel_valid_o(from_test.valid),
    .pixel_o(from_test.pixel)
  );
  always_comb begin
    from_test.line       = '0;
    from_test.line.angle = test.test_angle;
    from_test.line.power = test.test_power;
    from_test.line.test  = 1'b1;
  end

  // Once more at the chain: what it begins with is not where the sensor's pins are.
  always_ff @(posedge clk_i) begin
    readout_q  <= test_status.test_running ? from_test : from_sensor;
    readout_q2 <= readout_q;
    if (rst_own) begin
      {readout_q.start, readout_q.last, readout_q.valid}    <= '0;
      {readout_q2.start, readout_q2.last, readout_q2.valid} <= '0;
    end
  end

  assign {readout_start_o, readout_end_o, readout_valid_o} = {
    readout_q2.start, readout_q2.last, readout_q2.valid
  };
  assign {readout_pixel_o, readout_line_o} = {readout_q2.pixel, readout_q2.line};

  // ---- from pixels to a point, which is always taken ----
  // The chain is not where the registers are.
  register_pkg::peak_t     peak_q;
  register_pkg::geometry_t geometry_q;
  register_pkg::map_t      map_q;
  always_ff @(posedge clk_i) begin
    map_q      <= map;
    peak_q     <= peak;
    geometry_q <= geometry;
  end
  vrscan_chain #(
    .LineLength(LineLength), .PixelWidth(PixelWidth), .MaxWindow(MaxWindow)
  ) u_vrscan_chain (
    .clk_i, .rst_i(rst_vrscan_chain),
    .line_start_i(readout_q2.start), .line_end_i(readout_q2.last),
    .pixel_valid_i(readout_q2.valid), .pixel_i(readout_q2.pixel), .line_i(readout_q2.line),
    .valid_o(point_valid), .ready_i(1'b1), .point_o(point),
    .hold_i(commit_hold), .take_i(commit_take),
    .configuration_i(commit_status.configuration), .empty_o(chain_empty),
    .peak_i(peak_q), .geometry_i(geometry_q), .free_i(free), .free_table_i(free_table),
    .map_i(map_q), .map_table_i(map_table), .map_table_o(map_table_status),
    .chain_o(chain)
  );
  assign measured_o = seen_valid_q && seen_q.measured;

  // A clock later for laser, lens and host, whose places on the die are not the chain's.
  always_ff @(posedge clk_i) begin
    seen_q       <= point;
    seen_valid_q <= point_valid && !rst_own;
  end

  // ---- points to the host ----
  point_record u_point_record (
    .clk_i, .rst_i(rst_point_record), .valid_i(seen_valid_q), .point_i(seen_q),
    .record_valid_o, .record_index_o, .record_o
  );

  point_packer u_point_packer (
    .clk_i, .rst_i(rst_point_packer), .points_i(points),
    .record_valid_i(record_valid_o), .record_index_i(record_index_o), .record_i(record_o),
    .valid_o(packet_valid[0]), .ready_i(packet_ready[0]), .data_o(packet_data[7:0]),
    .last_o(packet_last[0]),
    .stream_start_i(stream_start), .stream_stop_i(stream_stop), .stream_format_i(stream_format),
    .stream_step_i(stream_step), .points_dropped_o(points_status.points_dropped)
  );

  line_capture #(.LineLength(LineLength), .PixelWidth(PixelWidth)) u_line_capture (
    .clk_i, .rst_i(rst_line_capture),
    .line_start_i(readout_q.start), .line_end_i(readout_q.last), .pixel_valid_i(readout_q.valid),
    .pixel_i(readout_q.pixel),
    .record_valid_i(record_valid_o), .record_index_i(record_index_o), .record_i(record_o),
    .valid_o(packet_valid[1]), .ready_i(packet_ready[1]), .data_o(packet_data[15:8]),
    .last_o(packet_last[1]),
    .capture_start_i(capture_start), .capture_mode_i(capture_mode),
    .capture_argument_i(capture_argument), .capture_busy_o(points_status.capture_busy)
  );

  // ---- lens ----
  focus_control u_focus_control (
    .clk_i, .rst_i(rst_focus_control), .valid_i(seen_valid_q), .point_i(seen_q),
    .focus_scl_i, .focus_sda_i, .focus_scl_low_o, .focus_sda_low_o,
    .focus_i(focus), .focus_table_i(focus_table), .focus_status_o(focus_status)
  );

endmodule

`default_nettype wire
