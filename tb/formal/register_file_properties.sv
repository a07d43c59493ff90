// register_file_properties: the registers that the light hangs on hold what the host was told.
//
// The addresses are those of docs/registers.md, as a host knows them.  The bus, the reset and every
// status are free in every clock; the host waits for bus_done_o, as what comes before is ignored.
// What begins with "step_" is no claim of its own but what the induction needs.

`default_nettype none

module register_file_properties (
  input wire logic                              clk_i,
  input wire logic                              rst_i,
  input wire logic                              bus_valid_i,
  input wire logic [link_pkg::AccessWidth-1:0]  bus_access_i,
  input wire logic [link_pkg::AddressWidth-1:0] bus_address_i,
  input wire logic [31:0]                       bus_data_i,
  input wire register_pkg::identity_status_t    identity_status_i,
  input wire register_pkg::chain_t              chain_i,
  input wire register_pkg::mirror_status_t      mirror_status_i,
  input wire register_pkg::link_status_t        link_status_i,
  input wire register_pkg::laser_status_t       laser_status_i,
  input wire register_pkg::points_status_t      points_status_i,
  input wire register_pkg::focus_status_t       focus_status_i,
  input wire register_pkg::test_status_t        test_status_i,
  input wire register_pkg::sensor_status_t      sensor_status_i,
  input wire register_pkg::commit_status_t      commit_status_i,
  input wire register_pkg::map_table_status_t   map_table_status_i,
  input wire logic                              waiting_i,
  input wire logic                              copy_i,
  input wire logic [9:0]                        copy_index_i,
  input wire logic                              bank_i,
  input wire logic                              take_i
);

  register_pkg::mirror_t             mirror;
  register_pkg::mirror_limits_t      bounds;
  register_pkg::laser_t              laser;
  register_pkg::laser_limits_t       limits;
  register_pkg::locks_t              locks;
  logic                              done;
  logic [link_pkg::StatusWidth-1:0]  status;
  register_file dut (
    .clk_i, .rst_i, .bus_valid_i, .bus_access_i, .bus_address_i, .bus_data_i,
    .bus_done_o     (done),
    .bus_status_o   (status),
    .bus_data_o     (),
    .identity_status_i,
    .identity_o     (),
    .peak_o         (),
    .geometry_o     (),
    .chain_i,
    .free_o         (),
    .mirror_o       (mirror),
    .mirror_limits_o(bounds),
    .motion_o       (),
    .line_o         (),
    .mirror_status_i,
    .link_o         (),
    .link_status_i,
    .laser_o        (laser),
    .laser_limits_o (limits),
    .laser_status_i,
    .points_o       (),
    .points_status_i,
    .focus_o        (),
    .focus_status_i,
    .test_o         (),
    .test_status_i,
    .sensor_status_i,
    .sensor_o       (),
    .locks_o        (locks),
    .table_o        (),
    .focus_table_o  (),
    .free_table_o   (),
    .commit_o       (),
    .map_o          (),
    .map_access_o   (),
    .map_table_o    (),
    .map_table_status_i,
    .commit_status_i, .waiting_i, .copy_i, .copy_index_i, .bank_i, .take_i
  );

  // ---- what the light hangs on, and where the host writes it ----
  localparam int unsigned Limits = 6;  // under lock_laser
  localparam int unsigned Bounds = 15;  // under lock_mirror
  localparam int unsigned Others = 8;
  localparam int unsigned Count = Limits + Bounds + Others;
  logic [Count-1:0][47:0] named;  // address, value
  assign named = {
    16'h0040, 31'd0, mirror.mirror_enable,
    16'h0100, 31'd0, laser.laser_enable,
    16'h0106, 16'd0, laser.laser_startup,
    16'h010c, 16'd0, laser.laser_index_begin,
    16'h010d, 16'd0, laser.laser_index_end,
    16'h03f0, 31'd0, locks.lock_calibration,
    16'h03f1, 31'd0, locks.lock_mirror,
    16'h03f2, 31'd0, locks.lock_laser,
    16'h0047, 24'd0, mirror.glitch_clks,
    16'h0048, mirror.width_min_clks,
    16'h0049, mirror.width_max_clks,
    16'h004a, mirror.period_max_clks,
    16'h0058, 6'd0, mirror.settle_limit,
    16'h005b, 24'd0, mirror.settle_count,
    16'h0060, 16'd0, bounds.duty,
    16'h0061, 12'd0, bounds.sweep_level,
    16'h0062, 12'd0, bounds.level_min,
    16'h0063, 12'd0, bounds.level_max,
    16'h0064, bounds.trim_min,
    16'h0065, bounds.trim_max,
    16'h0066, bounds.sweep_timeout,
    16'h0067, bounds.settle_timeout,
    16'h0068, bounds.lost_timeout,
    16'h0120, 16'd0, limits.laser_limit_power,
    16'h0121, 16'd0, limits.laser_limit_startup,
    16'h0122, 12'd0, limits.laser_limit_pulse_clks,
    16'h0123, 16'd0, limits.laser_limit_drain,
    16'h0124, limits.laser_limit_bucket,
    16'h0125, limits.laser_watchdog_clks
  };

  // ---- what has been ----
  logic                              first_q = 1'b1;
  logic                              rst_q, rst_q2;  // the registers are cleared by rst_q2
  logic [ 3:0]                       clks_q;  // since an access began, which ends with 14; 0 none
  logic                              write_q;  // the access is a WRITE
  logic [link_pkg::AddressWidth-1:0] address_q;
  logic [31:0]                       data_q;
  logic [Count-1:0][47:0]            named_q, begun_q;  // a clock ago; as the access began
  logic                              laser_lock_q, mirror_lock_q;
  logic [Count-1:0]                  kept, told, refused, cleared;

  always_ff @(posedge clk_i) begin
    first_q       <= 1'b0;
    rst_q         <= rst_i;
    rst_q2        <= rst_q;
    named_q       <= named;
    laser_lock_q  <= locks.lock_laser;
    mirror_lock_q <= locks.lock_mirror;
    if (rst_q) clks_q <= '0;
    else if (clks_q == '0) clks_q <= {3'd0, bus_valid_i};
    else clks_q <= clks_q == 4'd14 ? 4'd0 : clks_q + 4'd1;
    if (clks_q == '0) begin
      write_q   <= bus_access_i == link_pkg::AccessWidth'(link_pkg::AccessWrite);
      address_q <= bus_address_i;
      data_q    <= bus_data_i;
      begun_q   <= named;
    end
  end

  for (genvar k = 0; k < Count; k++) begin : gen_named
    logic here;
    assign here       = clks_q != '0 && write_q && address_q == named[k][47:32];
    assign kept[k]    = here || named[k] == named_q[k];
    assign told[k]    = !(done && here && status == link_pkg::StatusWidth'(link_pkg::StatusOk)) ||
                        named[k][31:0] == data_q;
    assign refused[k] = !(done && status != link_pkg::StatusWidth'(link_pkg::StatusOk)) ||
                        named[k] == begun_q[k];
    assign cleared[k] = named[k][31:0] == '0;
  end

  always_comb begin
    assume (!first_q || (rst_i && rst_q && rst_q2));
    assume (!bus_valid_i || clks_q == '0);
    if (!first_q && !rst_q2) begin
      nothing_without_a_write: assert (&kept);
      told_is_so: assert (&told);
      refused_is_so: assert (&refused);
      locked_laser: assert (!laser_lock_q || named[Limits-1:0] == named_q[Limits-1:0]);
      locked_mirror:
      assert (!mirror_lock_q || named[Limits+:Bounds] == named_q[Limits+:Bounds]);
      locks_stay: assert ((!laser_lock_q || locks.lock_laser) &&
                          (!mirror_lock_q || locks.lock_mirror));
      done_ends_an_access: assert (done == (clks_q == 4'd14));

      enabled: cover (laser.laser_enable && limits.laser_watchdog_clks == 32'd5);
    end
    if (!first_q && rst_q2) cleared_by_the_reset: assert (&cleared);
  end

endmodule

`default_nettype wire
