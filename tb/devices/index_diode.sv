// index_diode: the two-field photodiode of the index mark, its comparator and its gate.
//
// The gate is high while the lit beam is on one of the fields, |angle - mark| < width; the comparator
// is high beyond the mark, away from zero.  Without light the comparator means nothing, and toggles
// now and then.  Sample j of clock n is at time n + j / IndexOversample; the mirror's cubic is
// carried on for the up to two clocks that its outputs are behind.
//
//   angle_i .. since_clks_i  of mems_mirror
//   jitter_s_i    rms: each pass (one way over the diode) is shifted in time by one Gaussian number
//   noise_rad_i   rms of what is added to the angle before the comparator, first-order low pass at
//                 NoiseHz: the crossing chatters
//   drop_i        high when the beam runs onto the diode: this pass is lost, gate and comparator
//   laser_on_i    low: dark
//   seed_i        of all randomness, taken at reset; any value
//
// Far from the diode, which is tested once a step of the mirror, a clock costs a compare.  It leaves
// out: the beam's profile, so the gate's edges are sharp, and the peak detector behind the gate.

`default_nettype none

module index_diode #(
  parameter int unsigned ClockHz = 125_000_000,
  parameter int unsigned IndexOversample = 1,
  parameter int unsigned SinceWidth = 7,
  parameter int unsigned StepClks = 125,  // of mems_mirror: its longest step
  parameter real NoiseHz = 20.0e6
) (
  input  wire logic                       clk_i,
  input  wire logic                       rst_i,

  input  var real                         angle_i,
  input  var real                         velocity_i,
  input  var real                         acceleration_i,
  input  var real                         jerk_i,
  input  wire logic [SinceWidth-1:0]      since_clks_i,

  input  wire logic                       laser_on_i,
  input  wire logic                       drop_i,

  output      logic [IndexOversample-1:0] comparator_o,
  output      logic [IndexOversample-1:0] gate_o,

  input  var real                         mark_rad_i,  // its sign says on which side it is
  input  var real                         width_rad_i,
  input  var real                         noise_rad_i,
  input  var real                         jitter_s_i,
  input  wire logic [31:0]                seed_i
);

  localparam real TwoPi = 6.283185307179586;
  localparam real ClockS = 1.0 / real'(ClockHz);
  localparam real Remain = $exp(-TwoPi * NoiseHz * ClockS / real'(IndexOversample));
  localparam real Fresh = $sqrt(1.0 - Remain * Remain);
  localparam real Sigmas = 9.0;  // what no Gaussian number here exceeds
  localparam real SlackRad = 1.0e-6;

  if (IndexOversample == 0 || IndexOversample > 8
      || (IndexOversample & (IndexOversample - 1)) != 0) begin : gen_bad_index
    $error("index_diode: IndexOversample must be 1, 2, 4 or 8");
  end

  // Marsaglia's xorshift64.
  function automatic logic [63:0] shuffled(input logic [63:0] state);
    logic [63:0] x;
    x = state ^ (state << 13);
    x = x ^ (x >> 7);
    shuffled = x ^ (x << 17);
  endfunction

  // Box and Muller; the 32 bits keep it below 6.7 deviations.
  function automatic void draw(inout logic [63:0] state, output real gaussian);
    real radius;
    state = shuffled(state);
    radius = $sqrt(-2.0 * $ln((real'(state[63:32]) + 0.5) / 4294967296.0));
    state = shuffled(state);
    gaussian = radius * $cos(TwoPi * real'(state[63:32]) / 4294967296.0);
  endfunction

  function automatic real absolute(input real value);
    absolute = value < 0.0 ? -value : value;
  endfunction

  logic [          63:0] random_q;
  logic [SinceWidth-1:0] since_q;
  logic                  near_q;  // the beam may reach the diode before the mirror's next step
  logic                  meaningless_q;
  logic                  on_q, lost_q;  // the beam is on the diode; this pass is lost
  logic                  rising_q;
  logic                  chatter_q;
  real                   shift_q, noise_q;

  // verilog_lint: waive-start always-ff-non-blocking (locals of one clock, in the order of its draws)
  always_ff @(posedge clk_i) begin
    automatic logic [63:0] state;
    automatic logic is_near, meaningless, on, lost, chatter, beyond, busy;
    automatic logic [IndexOversample-1:0] gate, comparator;
    automatic real shift, noise, d, angle, velocity, reach, side, off, gaussian;
    state       = random_q;
    is_near     = near_q;
    meaningless = meaningless_q;
    since_q <= since_clks_i;

    // A new step of the mirror, or every clock if that is its step.
    if (since_clks_i <= since_q) begin
      state = shuffled(state);
      if (state[63:57] == '0) meaningless = !meaningless;
      reach = real'(StepClks + 4) * ClockS + Sigmas * jitter_s_i;
      reach = reach * (absolute(velocity_i) + reach * absolute(acceleration_i)) + SlackRad;
      is_near = absolute(angle_i - mark_rad_i) < width_rad_i + reach;
    end

    gate       = '0;
    comparator = {IndexOversample{meaningless}};
    if (is_near) begin
      on      = on_q;
      lost    = lost_q;
      shift   = shift_q;
      noise   = noise_q;
      chatter = chatter_q;
      side    = mark_rad_i < 0.0 ? -1.0 : 1.0;
      // The outputs of this clock begin a clock after the time of the mirror's.
      d        = (real'(since_clks_i) + 1.0) * ClockS;
      velocity = velocity_i + d * (acceleration_i + d * jerk_i / 2.0);
      if (!near_q || rising_q != (velocity > 0.0)) begin
        draw(state, gaussian);
        shift = jitter_s_i * gaussian;
      end
      rising_q <= velocity > 0.0;
      angle = angle_i + d * (velocity_i + d * (acceleration_i + d * jerk_i / 3.0) / 2.0);
      reach = absolute(velocity) * 2.0 * (ClockS + absolute(shift)) + SlackRad;
      off   = absolute(angle - mark_rad_i);
      busy  = off < reach + Sigmas * noise_rad_i || absolute(off - width_rad_i) < reach;
      if (!busy) begin
        if (!on) lost = drop_i;
        on         = off < width_rad_i;
        beyond     = side * (angle - mark_rad_i) > 0.0;
        gate       = {IndexOversample{on}};
        comparator = {IndexOversample{on ? beyond : meaningless}};
        chatter    = 1'b0;
      end else begin
        if (noise_rad_i > 0.0 && !chatter) draw(state, noise);
        chatter = 1'b1;
        for (int unsigned j = 0; j < IndexOversample; j++) begin
          d = (real'(since_clks_i) + 1.0 + real'(j) / real'(IndexOversample)) * ClockS;
          angle = angle_i + d * (velocity_i + d * (acceleration_i + d * jerk_i / 3.0) / 2.0);
          if (!on) lost = drop_i;
          on      = absolute(angle - mark_rad_i) < width_rad_i;
          gate[j] = on;
          if (noise_rad_i > 0.0) begin
            draw(state, gaussian);
            noise = Remain * noise + Fresh * gaussian;
          end
          off = angle + shift * (velocity + shift * acceleration_i / 2.0) + noise_rad_i * noise
              - mark_rad_i;
          comparator[j] = on ? side * off > 0.0 : meaningless;
        end
      end
      if (lost || !laser_on_i) gate = '0;
      if (lost || !laser_on_i) comparator = {IndexOversample{meaningless}};
      on_q      <= on;
      lost_q    <= lost;
      shift_q   <= shift;
      noise_q   <= noise;
      chatter_q <= chatter;
    end else begin
      on_q <= 1'b0;
    end

    near_q        <= is_near;
    meaningless_q <= meaningless;
    random_q      <= state;
    comparator_o  <= comparator;
    gate_o        <= gate;

    if (rst_i) begin
      random_q      <= {seed_i, 32'h9e3779b9};  // never zero
      near_q        <= 1'b0;
      on_q          <= 1'b0;
      since_q       <= '1;
      gate_o        <= '0;
      comparator_o  <= '0;
      meaningless_q <= 1'b0;
    end
  end
  // verilog_lint: waive-stop always-ff-non-blocking

endmodule

`default_nettype wire
