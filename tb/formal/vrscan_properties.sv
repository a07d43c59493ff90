// vrscan_properties: what the light at vrscan's own pins never does, registers and pins free.
//
// The properties of four other files, once more: scripts/formal.py takes their modules out and
// ties what they look at to the instances inside vrscan.  What went into those modules comes from
// where it begins instead, pins and the registers' outputs, so that a wire to another place breaks
// them.  The registers are free in every clock; register_file_properties says that they hold what
// was written.  What no light depends on, from the pixels to the points and the link, is free, too.
// In a build for a polygon the comparator is that of lit_gate_properties: free while the beam moves,
// and at rest any function of the light.

`default_nettype none

module vrscan_properties #(
  parameter int unsigned ClockHz = 100_000_000,
  parameter bit          Polygon = 1'b0
) (
  input wire logic        clk_i,
  input wire logic        rst_i,
  input wire logic        line_start_i,
  input wire logic        line_end_i,
  input wire logic        pixel_valid_i,
  input wire logic [11:0] pixel_i,
  input wire logic [15:0] pixel_overflow_count_i,
  input wire logic [ 1:0] comparator_i,
  input wire logic [ 1:0] gate_i,
  input wire logic        guard_ok_i,
  input wire logic        guard_beat_i,
  input wire logic [ 4:0] guard_fault_i,
  input wire logic        focus_scl_i,
  input wire logic        focus_sda_i,
  input wire logic        rx_i,
  input wire logic        host_valid_i,
  input wire logic [ 1:0] host_access_i,
  input wire logic [15:0] host_address_i,
  input wire logic [31:0] host_data_i,
  input wire logic        window_i,
  input wire logic        moves_i
);

  logic        line_start, pulse, power_pin, index_light, startup_pin;
  logic [15:0] power, startup;
  logic [ 2:0] state;
  vrscan #(.ClockHz(ClockHz), .IndexOversample(2), .Polygon(Polygon)) dut (
    .clk_i, .rst_i, .line_start_i, .line_end_i, .pixel_valid_i, .pixel_i, .pixel_overflow_count_i,
    .comparator_i, .gate_i, .guard_ok_i, .guard_beat_i, .guard_fault_i,
    .focus_scl_i, .focus_sda_i, .rx_i, .host_valid_i, .host_access_i, .host_address_i,
    .host_data_i, .axi_i('0),
    .line_start_o   (line_start),
    .exposure_o     (),
    .drive_o        (),
    .level_o        (),
    .level_pin_o    (),
    .pulse_o        (pulse),
    .power_o        (power),
    .power_pin_o    (power_pin),
    .index_light_o  (index_light),
    .startup_o      (startup),
    .startup_pin_o  (startup_pin),
    .laser_enable_o (),
    .heartbeat_o    (),
    .focus_scl_low_o(),
    .focus_sda_low_o(),
    .tx_o           (),
    .host_done_o    (),
    .host_status_o  (),
    .host_data_o    (),
    .record_valid_o (),
    .record_index_o (),
    .record_o       (),
    .readout_start_o(),
    .readout_end_o  (),
    .readout_valid_o(),
    .readout_pixel_o(),
    .readout_line_o (),
    .mirror_state_o (state),
    .measured_o     (),
    .line_o         (),
    .centre_o       (),
    .centre_half_o  ()
  );

  logic first_q = 1'b1;

  // ---- where things begin ----
  (* keep *) wire register_pkg::laser_t inside_dut__u_register_file__laser_o;
  (* keep *) wire register_pkg::laser_limits_t inside_dut__u_register_file__laser_limits_o;
  (* keep *) wire register_pkg::mirror_t inside_dut__u_register_file__mirror_o;
  (* keep *) wire register_pkg::mirror_limits_t inside_dut__u_register_file__mirror_limits_o;
  (* keep *) wire inside_dut__u_uart_link__alive_o;
  (* keep *) wire inside_dut__u_mirror_loop__u_index_capture__alive_o;
  (* keep *) wire inside_dut__u_mirror_loop__u_line_trigger__laser_o;
  (* keep *) wire [31:0] inside_dut__u_mirror_loop__u_mirror_phase__phase_o;
  (* keep *) wire inside_dut__u_mirror_loop__u_amplitude_control__settled_o;
  (* keep *) wire [19:0] inside_dut__u_mirror_loop__u_amplitude_control__level_o;
  (* keep *) wire signed [31:0] inside_dut__u_mirror_loop__u_amplitude_control__trim_o;
  (* keep *) wire inside_dut__u_scan_safeguard__scanning_o;
  (* keep *) wire inside_dut__u_scan_safeguard__startup_ok_o;
  (* keep *) wire [15:0] inside_dut__u_laser_control__u_power_adaptation__power_o;
  (* keep *) wire inside_dut__u_laser_control__u_guard_watch__ok_o;
  (* keep *) wire inside_dut__u_laser_control__u_laser_interlock__pulse_o;
  (* keep *) wire inside_dut__u_laser_control__u_laser_interlock__index_light_o;
  (* keep *) wire [15:0] inside_dut__u_laser_control__u_laser_interlock__power_o;
  (* keep *) wire [15:0] inside_dut__u_laser_control__u_laser_interlock__startup_o;
  (* keep *) wire inside_dut__rst_laser_control, inside_dut__rst_mirror_loop;
  (* keep *) wire [1:0] inside_dut__index_gate;

  laser_interlock_properties #(
    .PulseCeilingClks(ClockHz / 100_000), .BucketCeiling(ClockHz / 1_000_000 * 2_097_152),
    .WatchdogCeilingClks(ClockHz)
  ) u_interlock (
    .clk_i, .window_i,
    .guard_ok_i    (inside_dut__u_laser_control__u_guard_watch__ok_o),
    .rst_i         (inside_dut__rst_laser_control),
    .pulse_i       (inside_dut__u_mirror_loop__u_line_trigger__laser_o),
    .power_i       (inside_dut__u_laser_control__u_power_adaptation__power_o),
    .line_start_i  (line_start),
    .state_i       (state),
    .index_alive_i (inside_dut__u_mirror_loop__u_index_capture__alive_o),
    .scanning_i    (inside_dut__u_scan_safeguard__scanning_o),
    .startup_ok_i  (inside_dut__u_scan_safeguard__startup_ok_o),
    .phase_i       (inside_dut__u_mirror_loop__u_mirror_phase__phase_o[31:16]),
    .alive_i       (inside_dut__u_uart_link__alive_o || host_valid_i),
    .laser_i       (inside_dut__u_register_file__laser_o),
    .laser_limits_i(inside_dut__u_register_file__laser_limits_o)
  );

  laser_pair_properties #(
    .SettleCeilingClks(ClockHz * 10), .LostCeilingClks(ClockHz / 40)
  ) u_pair (
    .clk_i,
    .guard_ok_i     (inside_dut__u_laser_control__u_guard_watch__ok_o),
    .rst_i          (inside_dut__rst_mirror_loop),
    .enable_i       (inside_dut__u_register_file__mirror_o.mirror_enable),
    .index_alive_i  (inside_dut__u_mirror_loop__u_index_capture__alive_o),
    .scanning_i     (inside_dut__u_scan_safeguard__scanning_o),
    .startup_ok_i   (inside_dut__u_scan_safeguard__startup_ok_o),
    .settled_i      (inside_dut__u_mirror_loop__u_amplitude_control__settled_o),
    .level_i        (inside_dut__u_mirror_loop__u_amplitude_control__level_o),
    .trim_i         (inside_dut__u_mirror_loop__u_amplitude_control__trim_o),
    .mirror_i       (inside_dut__u_register_file__mirror_o),
    .mirror_limits_i(inside_dut__u_register_file__mirror_limits_o),
    .pulse_i        (inside_dut__u_mirror_loop__u_line_trigger__laser_o),
    .power_i        (inside_dut__u_laser_control__u_power_adaptation__power_o),
    .line_start_i   (line_start),
    .phase_i        (inside_dut__u_mirror_loop__u_mirror_phase__phase_o[31:16]),
    .alive_i        (inside_dut__u_uart_link__alive_o || host_valid_i),
    .laser_i        (inside_dut__u_register_file__laser_o),
    .laser_limits_i (inside_dut__u_register_file__laser_limits_o)
  );

  logic [32:0] quiet;
  scan_safeguard_properties #(
    .SettleClks(ClockHz / 10_000_000 + 1), .LightClks(ClockHz / 100),
    .PeriodFloorClks(ClockHz / (Polygon ? 2_000 : 500)), .OuterFloor(Polygon ? 0 : 6_144),
    .DarkClks(ClockHz / 40), .PauseClks(ClockHz / 4),
    .PeriodCeilingClks(ClockHz / 100), .SettleCeilingClks(ClockHz * 10),
    .LostCeilingClks(ClockHz / 40)
  ) u_safeguard (
    .clk_i, .comparator_i,
    .quiet_o        (quiet),
    .gate_i         (inside_dut__index_gate),
    .guard_ok_i     (inside_dut__u_laser_control__u_guard_watch__ok_o),
    .rst_i          (inside_dut__rst_mirror_loop),
    .state_i        ('0),
    .word_i         ('0),
    .index_alive_i  (1'b0),
    .settled_i      (inside_dut__u_mirror_loop__u_amplitude_control__settled_o),
    .level_i        (inside_dut__u_mirror_loop__u_amplitude_control__level_o),
    .trim_i         (inside_dut__u_mirror_loop__u_amplitude_control__trim_o),
    .mirror_i       (inside_dut__u_register_file__mirror_o),
    .mirror_limits_i(inside_dut__u_register_file__mirror_limits_o),
    .pulse_i        (inside_dut__u_mirror_loop__u_line_trigger__laser_o),
    .power_i        (inside_dut__u_laser_control__u_power_adaptation__power_o),
    .line_start_i   (line_start),
    .phase_i        (inside_dut__u_mirror_loop__u_mirror_phase__phase_o[31:16]),
    .alive_i        (inside_dut__u_uart_link__alive_o || host_valid_i),
    .laser_i        (inside_dut__u_register_file__laser_o),
    .laser_limits_i (inside_dut__u_register_file__laser_limits_o)
  );

  laser_lifeline_properties u_lifeline (
    .clk_i, .guard_ok_i, .guard_beat_i, .guard_fault_i,
    .rst_i   (inside_dut__rst_laser_control),
    .enable_i(1'b1),
    .first_i ('0),
    .second_i('0)
  );

  // ---- the gate of the index ----
  if (Polygon) begin : gen_diode
    lit_gate_properties #(
      .AnswerClks(ClockHz / 1_000_000 + 1), .LevelClks(ClockHz / 200)
    ) u_diode (
      .clk_i, .comparator_i, .gate_i, .moves_i,
      .rst_i        (inside_dut__rst_laser_control),
      .pulse_i      (pulse),
      .index_light_i(index_light),
      .startup_i    (startup)
    );

    logic [32:0] rest_q;  // clocks since the beam moved
    always_ff @(posedge clk_i) begin
      if (inside_dut__rst_mirror_loop || moves_i) rest_q <= 33'd1;
      else if (rest_q != '1) rest_q <= rest_q + 33'd1;
    end

    always_comb begin
      if (!first_q) begin
        no_pulse_of_a_polygon_at_rest:
        assert (rest_q < 33'(ClockHz / 100) || (!pulse && power == '0));
        step_rest: assert (rest_q <= quiet);
      end
    end
  end else begin : gen_gate
    always_comb gate_of_the_pin: assert (inside_dut__index_gate == gate_i);
  end

  // ---- the pins themselves ----
  logic rst_q;
  logic dim_q, calm_q;  // no power a clock ago
  always_ff @(posedge clk_i) begin
    first_q <= 1'b0;
    rst_q   <= rst_i;
    dim_q   <= inside_dut__rst_laser_control || power == '0;
    calm_q  <= inside_dut__rst_laser_control || startup == '0;
  end

  always_comb begin
    if (first_q) begin
      assume (rst_i && inside_dut__rst_laser_control && inside_dut__rst_mirror_loop);
    end else begin
      reset_arrives: assert (inside_dut__rst_laser_control == rst_q &&
                             inside_dut__rst_mirror_loop == rst_q);
      // A second interlock may only take away.
      pins_within_the_interlock:
      assert (pulse <= inside_dut__u_laser_control__u_laser_interlock__pulse_o &&
              index_light <= inside_dut__u_laser_control__u_laser_interlock__index_light_o &&
              power == inside_dut__u_laser_control__u_laser_interlock__power_o &&
              startup == inside_dut__u_laser_control__u_laser_interlock__startup_o);
      no_power_pin_without_power: assert (!dim_q || !power_pin);
      no_startup_pin_without_power: assert (!calm_q || !startup_pin);

      pulse_at_the_pins: cover (pulse && power_pin && power == 16'hffff);
      start_up_light_at_the_pins: cover (index_light && startup == 16'd1311);
    end
  end

endmodule

`default_nettype wire
