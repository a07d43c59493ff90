// register_pkg: what the bus of the link writes of a group of registers, what it reads
// of it, and what leaves with an entry of a table, as a struct each; and the resets.
//
// Generated from rtl/link/registers.toml by scripts/generate.py; docs/registers.md says what the
// fields are.  Widths are numbers, as packages are read in the order of their paths.

`default_nettype none

package register_pkg;
  // Identity of the instrument and parameters of its build: read.
  typedef struct packed {
    logic [15:0] board_id;
    logic [31:0] clock_hz;
    logic [15:0] line_length;
    logic [7:0] pixel_width;
    logic [7:0] max_window;
    logic [7:0] lanes;
    logic [7:0] index_oversample;
    logic [47:0] uptime;
  } identity_status_t;

  // Identity of the instrument and parameters of its build.
  typedef struct packed {
    logic [31:0] scratch;
  } identity_t;

  // Threshold, window and confidence of the peak.
  typedef struct packed {
    logic period_n;
    logic noise_row;
    logic [15:0] k_noise;
    logic [15:0] k_height;
    logic [15:0] snr_min;
    logic [7:0] min_width;
    logic [7:0] max_width;
    logic [17:0] kappa;
    logic [23:0] c_sfm_gain;
    logic window_two_pass;
    logic window_fit;
    logic [7:0] max_core;
    logic [15:0] saturation_level;
  } peak_t;

  // Geometry of the triangulation, with R = 2**ceil(log2(line_length)) px.
  typedef struct packed {
    logic signed [33:0] centre;
    logic signed [25:0] k1;
    logic signed [25:0] k2;
    logic even;
    logic signed [31:0] n0;
    logic signed [31:0] n1;
    logic signed [31:0] d0;
    logic signed [31:0] d1;
    logic signed [31:0] e0;
    logic signed [31:0] e1;
    logic [15:0] tolerance;
    logic [3:0] length_unit;
    logic [20:0] c_obj_gain;
  } geometry_t;

  // Counters of lines and points that were lost.
  typedef struct packed {
    logic [15:0] short_count;
    logic [15:0] long_count;
    logic [15:0] unfinished_count;
    logic [15:0] early_count;
    logic [15:0] dropped_count;
    logic [15:0] skipped_count;
  } chain_t;

  // Place of free_table's entries over the scan angle.
  typedef struct packed {
    logic signed [23:0] free_begin;
    logic [3:0] free_shift;
  } free_t;

  // Control loop of the mirror.
  typedef struct packed {
    logic mirror_enable;
    logic line_enable;
    logic [39:0] sweep_word;
    logic [39:0] work_word;
    logic [31:0] sweep_rate;
    logic [7:0] glitch_clks;
    logic [31:0] width_min_clks;
    logic [31:0] width_max_clks;
    logic [31:0] period_max_clks;
    logic [3:0] phase_shift;
    logic [5:0] rate_shift;
    logic [3:0] amplitude_shift;
    logic [27:0] error_limit;
    logic [25:0] amplitude_set;
    logic [17:0] k_p;
    logic [17:0] k_i;
    logic [19:0] level_low;
    logic [19:0] level_high;
    logic [19:0] level_nominal;
    logic [23:0] trim_step;
    logic [17:0] trim_gain;
    logic trim_up;
    logic [25:0] settle_limit;
    logic [25:0] shock_limit;
    logic [27:0] phase_limit;
    logic [7:0] settle_count;
    logic [7:0] hold_count;
    logic [23:0] confidence_gain;
  } mirror_t;

  // Limits of the mirror's drive.
  typedef struct packed {
    logic [15:0] duty;
    logic [19:0] sweep_level;
    logic [19:0] level_min;
    logic [19:0] level_max;
    logic signed [31:0] trim_min;
    logic signed [31:0] trim_max;
    logic [31:0] sweep_timeout;
    logic [31:0] settle_timeout;
    logic [31:0] lost_timeout;
  } mirror_limits_t;

  // Harmonics of the mirror's motion (12) at k = 1, 3 .. 17, and the part of it that is scanned.
  typedef struct packed {
    logic [27:0] drive_phase;
    logic [215:0] motion_a;
    logic [251:0] motion_phi;
    logic [215:0] motion_da;
    logic [215:0] motion_dphi;
    logic scan_facet;
    logic [15:0] scan_begin;
    logic [15:0] scan_span;
  } motion_t;

  // Timing of a line; clocks count from its start.
  typedef struct packed {
    logic [43:0] ratio;
    logic [19:0] exposure_delay_clks;
    logic [19:0] exposure_clks;
    logic [19:0] pulse_delay_clks;
    logic [19:0] pulse_clks;
  } line_t;

  // State of the mirror.
  typedef struct packed {
    logic [2:0] mirror_state;
    logic [1:0] mirror_fault;
    logic [39:0] mirror_word;
    logic [47:0] mirror_drive_phase;
    logic [47:0] mirror_phase;
    logic [19:0] mirror_level;
    logic index_alive;
    logic mirror_settled;
    logic [25:0] mirror_measured;
    logic signed [27:0] mirror_error;
    logic [15:0] missing_count;
    logic [15:0] doubled_count;
    logic [15:0] impossible_count;
    logic [15:0] glitch_count;
    logic [15:0] overrun_count;
  } mirror_status_t;

  // Serial line, with a counter for each way in which a frame can end.
  typedef struct packed {
    logic [23:0] uart_step;
    logic uart_step_strobe;
  } link_t;

  // Serial line, with a counter for each way in which a frame can end: read.
  typedef struct packed {
    logic [23:0] uart_step_now;
    logic [15:0] uart_framing;
    logic [15:0] uart_breaks;
    logic [15:0] uart_glitches;
    logic [15:0] uart_fallbacks;
    logic [15:0] frames_good;
    logic [15:0] frames_crc;
    logic [15:0] frames_malformed;
    logic [15:0] frames_too_long;
    logic [15:0] frames_too_short;
    logic [15:0] frames_framing;
    logic [15:0] commands_bad;
    logic [15:0] commands_lost;
  } link_status_t;

  // Power of the laser, 65535 at full scale; the laser is dark until these are loaded.
  typedef struct packed {
    logic laser_enable;
    logic laser_adapt;
    logic laser_shared;
    logic [15:0] laser_power;
    logic [15:0] laser_power_min;
    logic [15:0] laser_power_max;
    logic [15:0] laser_startup;
    logic [15:0] laser_target;
    logic [13:0] laser_cut;
    logic [15:0] laser_down;
    logic [15:0] laser_up;
    logic [13:0] laser_search;
    logic [15:0] laser_index_begin;
    logic [15:0] laser_index_end;
  } laser_t;

  // Limits of the laser, which no other register exceeds; the parameters of the build are their
  // ceilings.
  typedef struct packed {
    logic [15:0] laser_limit_power;
    logic [15:0] laser_limit_startup;
    logic [19:0] laser_limit_pulse_clks;
    logic [15:0] laser_limit_drain;
    logic [31:0] laser_limit_bucket;
    logic [31:0] laser_watchdog_clks;
  } laser_limits_t;

  // State of the laser.
  typedef struct packed {
    logic [6:0] laser_status;
    logic [15:0] laser_power_inward;
    logic [15:0] laser_power_outward;
    logic [15:0] laser_cut_count;
    logic [15:0] laser_duty_count;
    logic [15:0] laser_watchdog_count;
    logic [4:0] laser_guard_fault;
    logic [15:0] laser_guard_count;
  } laser_status_t;

  // Packets to the host.
  typedef struct packed {
    logic [7:0] points_batch;
    logic [23:0] points_timeout_clks;
  } points_t;

  // Packets to the host: read.
  typedef struct packed {
    logic [15:0] points_dropped;
    logic capture_busy;
  } points_status_t;

  // The AXI interfaces of vrscan_axi; all 0 without them.
  typedef struct packed {
    logic [15:0] axi_points_dropped;
    logic [15:0] axi_lines_dropped;
    logic [3:0] axi_refused;
    logic [15:0] axi_refused_address;
  } axi_t;

  // Autofocus; positions are in steps of the motor's sensor.
  typedef struct packed {
    logic [1:0] focus_mode;
    logic [15:0] focus_manual;
    logic [3:0] focus_average_shift;
    logic [15:0] focus_lapse;
    logic signed [23:0] focus_z_begin;
    logic [3:0] focus_z_shift;
    logic [15:0] focus_hysteresis;
    logic [15:0] focus_hold_points;
    logic [6:0] focus_address;
    logic [15:0] focus_quarter_clks;
    logic [23:0] focus_stretch_clks;
    logic [23:0] focus_poll_clks;
    logic [15:0] focus_tolerance;
    logic [31:0] focus_timeout_clks;
    logic [7:0] focus_retries;
    logic focus_protocol;
  } focus_t;

  // State of the autofocus.
  typedef struct packed {
    logic [2:0] focus_state;
    logic [3:0] focus_fault;
    logic focus_in_position;
    logic signed [23:0] focus_distance;
    logic [15:0] focus_target;
    logic [15:0] focus_position;
    logic [15:0] focus_nack_count;
    logic [15:0] focus_stretch_count;
    logic [15:0] focus_stuck_count;
    logic [15:0] focus_arbitration_count;
    logic [15:0] focus_timeout_count;
    logic [15:0] focus_recovery_count;
    logic [15:0] focus_reply_count;
    logic [24:0] focus_motor_status;
  } focus_status_t;

  // Test lines in place of the sensor's: a raised cosine on a pedestal with noise. A run uses the
  // values written before test_start.
  typedef struct packed {
    logic [24:0] test_position;
    logic signed [23:0] test_move;
    logic [28:0] test_step;
    logic [15:0] test_height;
    logic [15:0] test_pedestal;
    logic [15:0] test_noise;
    logic [31:0] test_seed;
    logic [31:0] test_lines;
    logic [23:0] test_period_clks;
    logic signed [23:0] test_angle;
    logic [15:0] test_power;
    logic test_start;
    logic test_start_strobe;
    logic test_stop;
    logic test_stop_strobe;
  } test_t;

  // Test lines in place of the sensor's: a raised cosine on a pedestal with noise. A run uses the
  // values written before test_start: read.
  typedef struct packed {
    logic test_running;
  } test_status_t;

  // Which exposure a readout of the sensor belongs to, and counters of lines lost between the two:
  // read.
  typedef struct packed {
    logic [15:0] untagged_count;
    logic [15:0] pixel_overflow_count;
    logic [15:0] unread_count;
    logic [15:0] mistimed_count;
  } sensor_status_t;

  // Which exposure a readout of the sensor belongs to, and counters of lines lost between the two.
  typedef struct packed {
    logic [1:0] readout_lag;
    logic readout_stale;
    logic [23:0] readout_min_clks;
    logic [23:0] readout_max_clks;
  } sensor_t;

  // What is written into peak, geometry, free, motion, map and their tables takes effect together,
  // between two lines.
  typedef struct packed {
    logic commit;
    logic commit_strobe;
  } commit_t;

  // What is written into peak, geometry, free, motion, map and their tables takes effect together,
  // between two lines: read.
  typedef struct packed {
    logic commit_waiting;
    logic configuration;
  } commit_status_t;

  // Correction maps: the bank of map_table in use, and where the lens stands among its maps.
  typedef struct packed {
    logic map_enable;
    logic map_bank;
    logic [3:0] map_count;
    logic [15:0] map_begin;
    logic [3:0] map_shift;
    logic map_follow;
    logic [15:0] map_lens;
  } map_t;

  // Access to the banks of map_table.
  typedef struct packed {
    logic map_access_bank;
  } map_access_t;

  // Each takes a 1 and nothing else, and keeps it until reset.
  typedef struct packed {
    logic lock_calibration;
    logic lock_mirror;
    logic lock_laser;
  } locks_t;

  // Amplitude table of the mirror: entry i belongs to crossings that are i / 2048 turns apart.
  typedef struct packed {
    logic table_write;
    logic [9:0] table_index;
    logic [25:0] table_amplitude;
    logic signed [27:0] table_midpoint;
    logic table_write_bank;
    logic table_bank;
    logic table_changed;
  } table_t;

  // Table of the autofocus: entry i belongs to a distance of focus_z_begin + i 2**(focus_z_shift +
  // 10) steps.
  typedef struct packed {
    logic focus_table_write;
    logic [5:0] focus_table_index;
    logic [15:0] focus_table_position;
  } focus_table_t;

  // Intervals of z in which a line without a peak is free, empty where from is not below to. Entry
  // i < 128: what the camera sees at the angle free_begin + i 2**(free_shift + 10) steps. Entry 128
  // + 8 e + k: where the darkest surface gives a peak, for 2**8 power / noise of (8 + k) 2**(e - 3)
  // and more.
  typedef struct packed {
    logic free_table_write;
    logic [7:0] free_table_index;
    logic [15:0] free_table_from;
    logic [15:0] free_table_to;
    logic free_table_write_bank;
    logic free_table_bank;
    logic free_table_changed;
  } free_table_t;

  // Nodes of the correction maps: entry 2145 k + 65 i + j of map k belongs to the angle (i - 16) /
  // 256 turns and the position j R / 64: read.
  typedef struct packed {
    logic [17:0] map_table_read;
  } map_table_status_t;

  // Nodes of the correction maps: entry 2145 k + 65 i + j of map k belongs to the angle (i - 16) /
  // 256 turns and the position j R / 64.
  typedef struct packed {
    logic map_table_write;
    logic [14:0] map_table_index;
    logic [17:0] map_table_node;
    logic map_table_access_bank;
  } map_table_t;

  // What a reset brings; of a table what it holds before the first write.
  localparam logic [31:0] ResetScratch = 32'h0;
  localparam logic ResetPeriodN = 1'h1;
  localparam logic ResetNoiseRow = 1'h0;
  localparam logic [15:0] ResetKNoise = 16'h280;
  localparam logic [15:0] ResetKHeight = 16'h2666;
  localparam logic [15:0] ResetSnrMin = 16'h500;
  localparam logic [7:0] ResetMinWidth = 8'h3;
  localparam logic [7:0] ResetMaxWidth = 8'hff;
  localparam logic [17:0] ResetKappa = 18'h3333;
  localparam logic [23:0] ResetCSfmGain = 24'hff;
  localparam logic ResetWindowTwoPass = 1'h1;
  localparam logic ResetWindowFit = 1'h1;
  localparam logic [7:0] ResetMaxCore = 8'h40;
  localparam logic [15:0] ResetSaturationLevel = 16'hfff;
  localparam logic [33:0] ResetCentre = 34'h3ff80000;
  localparam logic [25:0] ResetK1 = 26'h0;
  localparam logic [25:0] ResetK2 = 26'h0;
  localparam logic ResetEven = 1'h0;
  localparam logic [31:0] ResetN0 = 32'h3b6a848;
  localparam logic [31:0] ResetN1 = 32'h4c9d79;
  localparam logic [31:0] ResetD0 = 32'h8e8364b;
  localparam logic [31:0] ResetD1 = 32'hdba83161;
  localparam logic [31:0] ResetE0 = 32'h3f608d52;
  localparam logic [31:0] ResetE1 = 32'h51b9098;
  localparam logic [15:0] ResetTolerance = 16'h4189;
  localparam logic [3:0] ResetLengthUnit = 4'h1;
  localparam logic [20:0] ResetCObjGain = 21'h0;
  localparam logic [23:0] ResetFreeBegin = 24'hf0b17e;
  localparam logic [3:0] ResetFreeShift = 4'h4;
  localparam logic ResetMirrorEnable = 1'h0;
  localparam logic ResetLineEnable = 1'h0;
  localparam logic [39:0] ResetSweepWord = 40'h0;
  localparam logic [39:0] ResetWorkWord = 40'h0;
  localparam logic [31:0] ResetSweepRate = 32'h0;
  localparam logic [7:0] ResetGlitchClks = 8'h0;
  localparam logic [31:0] ResetWidthMinClks = 32'h0;
  localparam logic [31:0] ResetWidthMaxClks = 32'h0;
  localparam logic [31:0] ResetPeriodMaxClks = 32'h0;
  localparam logic [3:0] ResetPhaseShift = 4'h0;
  localparam logic [5:0] ResetRateShift = 6'h0;
  localparam logic [3:0] ResetAmplitudeShift = 4'h0;
  localparam logic [27:0] ResetErrorLimit = 28'h0;
  localparam logic [25:0] ResetAmplitudeSet = 26'h0;
  localparam logic [17:0] ResetKP = 18'h0;
  localparam logic [17:0] ResetKI = 18'h0;
  localparam logic [19:0] ResetLevelLow = 20'h0;
  localparam logic [19:0] ResetLevelHigh = 20'h0;
  localparam logic [19:0] ResetLevelNominal = 20'h0;
  localparam logic [23:0] ResetTrimStep = 24'h0;
  localparam logic [17:0] ResetTrimGain = 18'h0;
  localparam logic ResetTrimUp = 1'h0;
  localparam logic [25:0] ResetSettleLimit = 26'h0;
  localparam logic [25:0] ResetShockLimit = 26'h0;
  localparam logic [27:0] ResetPhaseLimit = 28'h0;
  localparam logic [7:0] ResetSettleCount = 8'h0;
  localparam logic [7:0] ResetHoldCount = 8'h0;
  localparam logic [23:0] ResetConfidenceGain = 24'h0;
  localparam logic [15:0] ResetDuty = 16'h0;
  localparam logic [19:0] ResetSweepLevel = 20'h0;
  localparam logic [19:0] ResetLevelMin = 20'h0;
  localparam logic [19:0] ResetLevelMax = 20'h0;
  localparam logic [31:0] ResetTrimMin = 32'h0;
  localparam logic [31:0] ResetTrimMax = 32'h0;
  localparam logic [31:0] ResetSweepTimeout = 32'h0;
  localparam logic [31:0] ResetSettleTimeout = 32'h0;
  localparam logic [31:0] ResetLostTimeout = 32'h0;
  localparam logic [27:0] ResetDrivePhase = 28'h0;
  localparam logic [215:0] ResetMotionA = 216'h0;
  localparam logic [251:0] ResetMotionPhi = 252'h0;
  localparam logic [215:0] ResetMotionDa = 216'h0;
  localparam logic [215:0] ResetMotionDphi = 216'h0;
  localparam logic ResetScanFacet = 1'h0;
  localparam logic [15:0] ResetScanBegin = 16'h0;
  localparam logic [15:0] ResetScanSpan = 16'hffff;
  localparam logic [43:0] ResetRatio = 44'h0;
  localparam logic [19:0] ResetExposureDelayClks = 20'h0;
  localparam logic [19:0] ResetExposureClks = 20'h0;
  localparam logic [19:0] ResetPulseDelayClks = 20'h0;
  localparam logic [19:0] ResetPulseClks = 20'h0;
  localparam logic [23:0] ResetUartStep = 24'h7ae14;
  localparam logic ResetLaserEnable = 1'h0;
  localparam logic ResetLaserAdapt = 1'h0;
  localparam logic ResetLaserShared = 1'h0;
  localparam logic [15:0] ResetLaserPower = 16'h0;
  localparam logic [15:0] ResetLaserPowerMin = 16'h0;
  localparam logic [15:0] ResetLaserPowerMax = 16'h0;
  localparam logic [15:0] ResetLaserStartup = 16'h0;
  localparam logic [15:0] ResetLaserTarget = 16'h0;
  localparam logic [13:0] ResetLaserCut = 14'h0;
  localparam logic [15:0] ResetLaserDown = 16'h0;
  localparam logic [15:0] ResetLaserUp = 16'h0;
  localparam logic [13:0] ResetLaserSearch = 14'h0;
  localparam logic [15:0] ResetLaserIndexBegin = 16'h0;
  localparam logic [15:0] ResetLaserIndexEnd = 16'h0;
  localparam logic [15:0] ResetLaserLimitPower = 16'h0;
  localparam logic [15:0] ResetLaserLimitStartup = 16'h0;
  localparam logic [19:0] ResetLaserLimitPulseClks = 20'h0;
  localparam logic [15:0] ResetLaserLimitDrain = 16'h0;
  localparam logic [31:0] ResetLaserLimitBucket = 32'h0;
  localparam logic [31:0] ResetLaserWatchdogClks = 32'h0;
  localparam logic [7:0] ResetPointsBatch = 8'h18;
  localparam logic [23:0] ResetPointsTimeoutClks = 24'h1e8480;
  localparam logic [1:0] ResetFocusMode = 2'h0;
  localparam logic [15:0] ResetFocusManual = 16'h0;
  localparam logic [3:0] ResetFocusAverageShift = 4'h0;
  localparam logic [15:0] ResetFocusLapse = 16'h0;
  localparam logic [23:0] ResetFocusZBegin = 24'h0;
  localparam logic [3:0] ResetFocusZShift = 4'h0;
  localparam logic [15:0] ResetFocusHysteresis = 16'h0;
  localparam logic [15:0] ResetFocusHoldPoints = 16'h0;
  localparam logic [6:0] ResetFocusAddress = 7'h0;
  localparam logic [15:0] ResetFocusQuarterClks = 16'hfa;
  localparam logic [23:0] ResetFocusStretchClks = 24'h2625a0;
  localparam logic [23:0] ResetFocusPollClks = 24'h30d40;
  localparam logic [15:0] ResetFocusTolerance = 16'h0;
  localparam logic [31:0] ResetFocusTimeoutClks = 32'h0;
  localparam logic [7:0] ResetFocusRetries = 8'h0;
  localparam logic ResetFocusProtocol = 1'h0;
  localparam logic [24:0] ResetTestPosition = 25'h400000;
  localparam logic [23:0] ResetTestMove = 24'h1000;
  localparam logic [28:0] ResetTestStep = 29'hcccccd;
  localparam logic [15:0] ResetTestHeight = 16'h9c40;
  localparam logic [15:0] ResetTestPedestal = 16'h7d0;
  localparam logic [15:0] ResetTestNoise = 16'h3e8;
  localparam logic [31:0] ResetTestSeed = 32'h0;
  localparam logic [31:0] ResetTestLines = 32'h0;
  localparam logic [23:0] ResetTestPeriodClks = 24'h0;
  localparam logic [23:0] ResetTestAngle = 24'h0;
  localparam logic [15:0] ResetTestPower = 16'h0;
  localparam logic ResetTestStart = 1'h0;
  localparam logic ResetTestStop = 1'h0;
  localparam logic [1:0] ResetReadoutLag = 2'h0;
  localparam logic ResetReadoutStale = 1'h0;
  localparam logic [23:0] ResetReadoutMinClks = 24'h0;
  localparam logic [23:0] ResetReadoutMaxClks = 24'hffffff;
  localparam logic ResetCommit = 1'h0;
  localparam logic ResetMapEnable = 1'h0;
  localparam logic ResetMapBank = 1'h0;
  localparam logic [3:0] ResetMapCount = 4'h2;
  localparam logic [15:0] ResetMapBegin = 16'h0;
  localparam logic [3:0] ResetMapShift = 4'h0;
  localparam logic ResetMapFollow = 1'h0;
  localparam logic [15:0] ResetMapLens = 16'h0;
  localparam logic ResetMapAccessBank = 1'h0;
  localparam logic ResetLockCalibration = 1'h0;
  localparam logic ResetLockMirror = 1'h0;
  localparam logic ResetLockLaser = 1'h0;
  localparam logic [26623:0] ResetTableAmplitude = 26624'h0;
  localparam logic [28671:0] ResetTableMidpoint = 28672'h0;
  localparam logic [1023:0] ResetFocusTablePosition = 1024'h0;
  localparam logic [4095:0] ResetFreeTableFrom = 4096'h0;
  localparam logic [4095:0] ResetFreeTableTo = 4096'h0;
endpackage

`default_nettype wire
