// laser_control: driver of a two-channel laser: the power follows the peaks, within the limits.
//
// Two channels, as laser switches have them: a main one for the pulses and a start-up one, dim, for
// the index mark, which must be found before the mirror can be known to move.  power_adaptation
// says what power is wanted, laser_interlock what light there is, and two sigma_delta bring its
// levels to pins.  There are two interlocks: a pulse and the index's light need both, and only while
// they agree laser_heartbeat beats for laser_guard.  What is added here is the power that a line had.
//
//   pulse_o       pulse_i, or 0 where laser_interlock does not permit it
//   power_o       changes between pulses only: in the second clock after a request ends, or when a
//                 limit comes down.  At most laser_limit_power
//   *_pin_o       sigma-delta of the first order: of 2**16 clocks power_o (startup_o) are high
//   power_line_o  from the clock of centre_i to the next: what the pulse has, 0 if it is
//                 suppressed, and 0 from the clock after a cut; inward_line_o is its direction
//   phase_i       mirror_phase_o's top bits.  The first half turn is inward
//   scanning_i, startup_ok_i  of scan_safeguard
//   guard_*_i     of laser_guard; guard_watch synchronises them
//   enable_o      laser_enable, for laser_guard
//   heartbeat_o   changes every 2**HeartbeatBits clocks
//   laser_status  laser_interlock's, power_adaptation's and guard_watch's
//   Latency  laser_interlock's and power_adaptation's; guard_ok_i to the light 3 clocks; *_pin_o
//            follow by a clock
//   Model    vrscan.clocked.laser_control, bit-exact

`default_nettype none

module laser_control #(
  parameter int unsigned PixelWidth          = 12,
  parameter int unsigned CountWidth          = 16,
  parameter int unsigned HeartbeatBits       = 5,  // a beat every 0.26 us at 125 MHz
  parameter int unsigned GuardBeatClks       = 64,
  parameter int unsigned PowerCeiling        = 65_535,
  parameter int unsigned StartupCeiling      = 1_311,  // 1 mW of 50 mW
  parameter int unsigned PulseCeilingClks    = 1_250,  // 10 us at 125 MHz
  parameter int unsigned DrainCeiling        = 4_096,  // 3.1 mW of 50 mW on average
  parameter int unsigned BucketCeiling       = 268_435_456,  // 1.6 uJ of 50 mW at 125 MHz
  parameter int unsigned WatchdogCeilingClks = 134_217_728  // 1.07 s at 125 MHz
) (
  input  wire logic                                    clk_i,
  input  wire logic                                    rst_i,

  // From line_trigger, the mirror and the host.
  input  wire logic                                    pulse_i,
  input  wire logic                                    line_start_i,
  input  wire logic                                    centre_i,
  input  wire logic [vrscan_pkg::MirrorStateWidth-1:0] state_i,
  input  wire logic                                    index_alive_i,
  input  wire logic                                    scanning_i,
  input  wire logic                                    startup_ok_i,
  input  wire logic [                            15:0] phase_i,
  input  wire logic                                    alive_i,
  input  wire logic                                    guard_ok_i,
  input  wire logic                                    guard_beat_i,
  input  wire logic [                             4:0] guard_fault_i,

  // The point of a line.
  input  wire logic                                    point_valid_i,
  input  wire vrscan_pkg::point_t                      point_i,

  // To the driver.
  output      logic                                    pulse_o,
  output      logic [      vrscan_pkg::PowerWidth-1:0] power_o,
  output      logic                                    power_pin_o,
  output      logic                                    index_light_o,
  output      logic [      vrscan_pkg::PowerWidth-1:0] startup_o,
  output      logic                                    startup_pin_o,
  output      logic                                    enable_o,
  output      logic                                    heartbeat_o,

  // With the line.
  output      logic [      vrscan_pkg::PowerWidth-1:0] power_line_o,
  output      logic                                    inward_line_o,

  // Configuration.
  input  wire register_pkg::laser_t                    laser_i,

  // Limits.
  input  wire register_pkg::laser_limits_t             laser_limits_i,

  // Status; each counter stops at its largest value.
  output      register_pkg::laser_status_t             laser_status_o
);

  localparam int unsigned PowerWidth = vrscan_pkg::PowerWidth;

  register_pkg::laser_status_t status;
  assign laser_status_o = status;

  // ---- the power that is wanted ----
  logic                  inward, armed;
  logic [PowerWidth-1:0] power;
  assign inward = !phase_i[15];

  power_adaptation #(.PixelWidth(PixelWidth)) u_power_adaptation (
    .clk_i, .rst_i, .point_valid_i, .point_i, .laser_i, .pulse_i,
    .armed_i(armed), .inward_i(inward), .power_o(power),
    .inward_power_o(status.laser_power_inward), .outward_power_o(status.laser_power_outward)
  );

  // ---- the light that there is: two interlocks do the same ----
  logic guard_ok;
  guard_watch #(.CountWidth(CountWidth), .BeatClks(GuardBeatClks)) u_guard_watch (
    .clk_i, .rst_i, .guard_ok_i, .guard_beat_i, .guard_fault_i, .ok_o(guard_ok),
    .fault_o(status.laser_guard_fault), .trip_count_o(status.laser_guard_count)
  );

  typedef struct packed {
    logic                  pulse;
    logic                  index_light;
    logic [PowerWidth-1:0] power;
    logic [PowerWidth-1:0] startup;
    logic                  armed;
    logic [           6:0] status;
    logic                  signature;
  } light_t;
  localparam int unsigned LightWidth = 2 * PowerWidth + 11;
  light_t first, second;
  laser_interlock #(
    .CountWidth(CountWidth), .PowerCeiling(PowerCeiling), .StartupCeiling(StartupCeiling),
    .PulseCeilingClks(PulseCeilingClks), .DrainCeiling(DrainCeiling),
    .BucketCeiling(BucketCeiling), .WatchdogCeilingClks(WatchdogCeilingClks)
  ) u_laser_interlock (
    .clk_i, .rst_i, .pulse_i, .power_i(power), .line_start_i, .state_i, .index_alive_i, .scanning_i,
    .startup_ok_i, .phase_i, .alive_i, .guard_ok_i(guard_ok), .laser_i, .laser_limits_i,
    .pulse_o(first.pulse), .power_o(first.power), .index_light_o(first.index_light),
    .startup_o(first.startup), .armed_o(first.armed), .status_o(first.status),
    .signature_o(first.signature), .cut_count_o(status.laser_cut_count),
    .duty_count_o(status.laser_duty_count), .watchdog_count_o(status.laser_watchdog_count)
  );
  laser_interlock #(
    .CountWidth(1), .PowerCeiling(PowerCeiling), .StartupCeiling(StartupCeiling),
    .PulseCeilingClks(PulseCeilingClks), .DrainCeiling(DrainCeiling),
    .BucketCeiling(BucketCeiling), .WatchdogCeilingClks(WatchdogCeilingClks)
  ) u_second_interlock (
    .clk_i, .rst_i, .pulse_i, .power_i(power), .line_start_i, .state_i, .index_alive_i, .scanning_i,
    .startup_ok_i, .phase_i, .alive_i, .guard_ok_i(guard_ok), .laser_i, .laser_limits_i,
    .pulse_o(second.pulse), .power_o(second.power), .index_light_o(second.index_light),
    .startup_o(second.startup), .armed_o(second.armed), .status_o(second.status),
    .signature_o(second.signature), .cut_count_o(), .duty_count_o(), .watchdog_count_o()
  );
  laser_heartbeat #(.Width(LightWidth), .HeartbeatBits(HeartbeatBits)) u_laser_heartbeat (
    .clk_i, .rst_i, .enable_i(laser_i.laser_enable), .first_i(first), .second_i(second),
    .heartbeat_o
  );
  assign enable_o            = laser_i.laser_enable;
  assign pulse_o             = first.pulse && second.pulse;
  assign index_light_o       = first.index_light && second.index_light;
  assign power_o             = first.power;
  assign startup_o           = first.startup;
  assign armed               = first.armed;
  assign status.laser_status = first.status;

  sigma_delta #(.Width(PowerWidth)) u_power_pin (
    .clk_i, .rst_i, .level_i(power_o), .pin_o(power_pin_o)
  );

  sigma_delta #(.Width(PowerWidth)) u_startup_pin (
    .clk_i, .rst_i, .level_i(startup_o), .pin_o(startup_pin_o)
  );

  // ---- the line, from the clock of its centre on ----
  logic                  whole_q;  // the pulse goes on beyond its centre
  logic [PowerWidth-1:0] line_q;
  logic                  line_inward_q;
  assign power_line_o  = centre_i ? (pulse_o ? power_o : '0) : line_q;
  assign inward_line_o = centre_i ? inward : line_inward_q;

  always_ff @(posedge clk_i) begin
    // A cut that comes behind the centre still takes the line its power.
    whole_q       <= pulse_i && (centre_i ? pulse_o : whole_q);
    line_q        <= whole_q && pulse_i && !pulse_o && !centre_i ? '0 : power_line_o;
    line_inward_q <= inward_line_o;

    if (rst_i) begin
      whole_q       <= 1'b0;
      line_q        <= '0;
      line_inward_q <= 1'b0;
    end
  end

endmodule

`default_nettype wire
