// index_diode: the photodiode of the index mark with its photocurrents, its comparator and its gate.
//
// The beam is Gaussian across the diode, which reaches from width below the mark to width above it.
// The current of all of it is compared with a threshold.  With two Fields, which meet at the mark,
// the gate is high above the threshold, and the comparator where the outer field, away from zero,
// has more light than the inner one.  With one field the gate is open, and the comparator is high above
// the threshold.  Without light the comparator of two fields means nothing, and toggles now and then.
// Sample j of clock n is at time n + j / IndexOversample; the mirror's cubic is carried on for the
// up to two clocks that its outputs are behind.
//
//   angle_i .. since_clks_i  of mems_mirror
//   startup_mw_i, pulse_mw_i  light of the two channels, 0 while one is dark; it adds up
//   beam_rad_i    radius of the beam on the diode, to 1/e^2
//   ambient_mw_i  other light on the diode
//   threshold_share_i  0: the threshold is threshold_mw_i of all light.  Else it is this share of the
//                 preceding passes' largest currents above the ambient light, and threshold_mw_i at
//                 least.  A pass counts a quarter, and pulses do not count
//   hold_s_i      time constant with which the hold of these currents runs down
//   jitter_s_i    rms: each pass (one way over the diode) is shifted in time by one Gaussian number
//   noise_rad_i   rms of what is added to the angle before the comparator, first-order low pass at
//                 NoiseHz: the crossing chatters
//   drop_i        high when the beam runs onto the diode: this pass is lost, gate and comparator
//   seed_i        of all randomness, taken at reset; any value
//   Model         vrscan.scene.index_diode
//
// Far from the diode, which is tested once a step of the mirror, a clock costs a compare.  It leaves
// out: the bandwidth of amplifiers and comparators, and fields that differ.

`default_nettype none

module index_diode #(
  parameter int unsigned ClockHz = 125_000_000,
  parameter int unsigned IndexOversample = 1,
  parameter int unsigned Fields = 2,
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

  input  var real                         startup_mw_i,
  input  var real                         pulse_mw_i,
  input  wire logic                       drop_i,

  output      logic [IndexOversample-1:0] comparator_o,
  output      logic [IndexOversample-1:0] gate_o,

  input  var real                         mark_rad_i,  // its sign says on which side it is
  input  var real                         width_rad_i,
  input  var real                         beam_rad_i,
  input  var real                         ambient_mw_i,
  input  var real                         threshold_mw_i,
  input  var real                         threshold_share_i,
  input  var real                         hold_s_i,
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
  localparam real Skirt = 3.0;  // radii of the beam, beyond which there is no light
  localparam real Everywhere = 1.0e9;

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

  // Abramowitz and Stegun 7.1.26, to 1.5e-7.
  function automatic real erf(input real x);
    real t;
    t = 1.0 / (1.0 + 0.3275911 * absolute(x));
    t = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027
        + t * 1.061405429))));
    t = 1.0 - t * $exp(-x * x);
    erf = x < 0.0 ? -t : t;
  endfunction

  // The share of the beam's light that is on the diode, with the beam's middle off the mark.
  function automatic real caught(input real off);
    caught = 0.5 * (erf($sqrt(2.0) * (width_rad_i - off) / beam_rad_i)
        + erf($sqrt(2.0) * (width_rad_i + off) / beam_rad_i));
  endfunction

  // How far off the mark the current is above the threshold: 0 if nowhere.
  function automatic real half_width(input real light, input real threshold);
    real low, high;
    low  = 0.0;
    high = width_rad_i + Skirt * beam_rad_i;
    if (threshold <= 0.0) high = Everywhere;
    else if (light * caught(0.0) <= threshold) high = 0.0;
    else begin
      for (int unsigned k = 0; k < 48; k++) begin
        if (light * caught(0.5 * (low + high)) > threshold) low = 0.5 * (low + high);
        else high = 0.5 * (low + high);
      end
    end
    half_width = high;
  endfunction

  logic [          63:0] random_q;
  logic [SinceWidth-1:0] since_q;
  logic                  near_q;  // the beam may reach the diode before the mirror's next step
  logic                  meaningless_q;
  logic                  on_q, lost_q;  // the beam is on the diode or nearly; this pass is lost
  logic                  rising_q;
  logic                  chatter_q;
  real                   shift_q, noise_q;
  logic                  fresh_q;  // the hold has changed
  real                   startup_q, pulse_q;
  real                   edge_q, threshold_q;  // of the present light
  real                   peak_q, held_q;  // of this pass, and of those before
  int unsigned           held_clks_q;  // since the hold's running down was last counted

  // verilog_lint: waive-start always-ff-non-blocking (locals of one clock, in the order of its draws)
  always_ff @(posedge clk_i) begin
    automatic logic [63:0] state;
    automatic logic is_near, meaningless, on, above, lost, chatter, beyond, busy, dark;
    automatic logic [IndexOversample-1:0] gate, comparator;
    automatic real shift, noise, d, angle, velocity, reach, side, off, gaussian;
    automatic real edge_rad, threshold, peak, held, current;
    state       = random_q;
    is_near     = near_q;
    meaningless = meaningless_q;
    edge_rad    = edge_q;
    threshold   = threshold_q;
    peak        = peak_q;
    held        = held_q;
    dark        = startup_mw_i + pulse_mw_i <= 0.0;
    since_q     <= since_clks_i;
    held_clks_q <= held_clks_q + 1;

    // A new step of the mirror, or every clock if that is its step.
    if (since_clks_i <= since_q) begin
      state = shuffled(state);
      if (state[63:57] == '0) meaningless = !meaningless;
      reach = real'(StepClks + 4) * ClockS + Sigmas * jitter_s_i;
      reach = reach * (absolute(velocity_i) + reach * absolute(acceleration_i)) + SlackRad;
      is_near = absolute(angle_i - mark_rad_i) < width_rad_i + Skirt * beam_rad_i + reach;
    end

    above      = threshold_share_i == 0.0 && ambient_mw_i >= threshold_mw_i;
    gate       = {IndexOversample{above}};
    comparator = {IndexOversample{Fields == 1 ? above : meaningless}};
    if (is_near) begin
      // Another light or threshold, so another place of the gate's edges.
      if (!near_q || fresh_q || startup_mw_i != startup_q || pulse_mw_i != pulse_q) begin
        held = held * $exp(-real'(held_clks_q) * ClockS / hold_s_i);
        held_clks_q <= 1;
        if (threshold_share_i == 0.0) threshold = threshold_mw_i - ambient_mw_i;
        else if (threshold_share_i * held > threshold_mw_i) threshold = threshold_share_i * held;
        else threshold = threshold_mw_i;
        edge_rad = half_width(startup_mw_i + pulse_mw_i, threshold);
      end
      if (!near_q) peak = 0.0;
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
      if (!on) lost = drop_i;
      on   = off < width_rad_i + Skirt * beam_rad_i;
      busy = off < reach + Sigmas * noise_rad_i
          || absolute(off - edge_rad) < reach + (Fields == 1 ? Sigmas * noise_rad_i : 0.0);

      // The largest current of this pass, which its end takes into the hold.
      fresh_q <= 1'b0;
      if (pulse_mw_i == 0.0 && threshold_share_i > 0.0) begin
        current = lost ? 0.0 : startup_mw_i * caught(off);
        if (current > peak) peak = current;
        if (current <= threshold && peak > threshold) begin
          held = held + (peak - held) / 4.0;
          peak = 0.0;
          fresh_q <= 1'b1;
        end
      end

      if (!busy) begin
        above      = off < edge_rad;
        beyond     = side * (angle - mark_rad_i) > 0.0;
        gate       = {IndexOversample{above}};
        comparator = {IndexOversample{Fields == 1 ? above : beyond}};
        chatter    = 1'b0;
      end else begin
        if (noise_rad_i > 0.0 && !chatter) draw(state, noise);
        chatter = 1'b1;
        for (int unsigned j = 0; j < IndexOversample; j++) begin
          d = (real'(since_clks_i) + 1.0 + real'(j) / real'(IndexOversample)) * ClockS;
          angle = angle_i + d * (velocity_i + d * (acceleration_i + d * jerk_i / 3.0) / 2.0);
          gate[j] = absolute(angle - mark_rad_i) < edge_rad;
          if (noise_rad_i > 0.0) begin
            draw(state, gaussian);
            noise = Remain * noise + Fresh * gaussian;
          end
          off = angle + shift * (velocity + shift * acceleration_i / 2.0) + noise_rad_i * noise
              - mark_rad_i;
          comparator[j] = Fields == 1 ? absolute(off) < edge_rad : side * off > 0.0;
        end
      end
      if (lost && edge_rad != Everywhere) gate = '0;
      if (Fields == 1) comparator = lost && edge_rad != Everywhere ? '0 : comparator;
      else begin
        for (int unsigned j = 0; j < IndexOversample; j++) begin
          if (!gate[j] || lost || dark) comparator[j] = meaningless;
        end
      end
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
    edge_q        <= edge_rad;
    threshold_q   <= threshold;
    peak_q        <= peak;
    held_q        <= held;
    startup_q     <= startup_mw_i;
    pulse_q       <= pulse_mw_i;
    comparator_o  <= comparator;
    gate_o        <= Fields == 1 ? '1 : gate;

    if (rst_i) begin
      random_q      <= {seed_i, 32'h9e3779b9};  // never zero
      near_q        <= 1'b0;
      on_q          <= 1'b0;
      since_q       <= '1;
      gate_o        <= Fields == 1 ? '1 : '0;
      comparator_o  <= '0;
      meaningless_q <= 1'b0;
      held_q        <= 0.0;
      held_clks_q   <= 0;
    end
  end
  // verilog_lint: waive-stop always-ff-non-blocking

endmodule

`default_nettype wire
