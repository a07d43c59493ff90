// mems_mirror: the resonant mirror, a driven nonlinear oscillator in real arithmetic.
//
//   a'' = -(w0/Q) a' - w0^2 a - tau (level/LevelNominal)^2 g(a) u + b,  g = r exp(-r^2), r = a/a_c
//
// a is the optical scan angle, u the drive.  The bias b is what a mirror at rest starts from.
// Fourth-order Runge-Kutta steps end every StepClks clocks and, exactly, where drive, level or a
// shock change the equation; in between the outputs are those of the last step, and whoever wants
// the angle evaluates the cubic.  So most clocks cost an increment and two compares.
//
//   drive_i, level_i      what they are in clock n acts from time n to time n + 1
//   shock_i               adds shock_rad_per_s_i to the velocity at time n
//   natural_offset_hz_i,  drift of w0 / 2 pi and a factor on the damping w0/Q; from the next step on
//   damping_factor_i
//   angle_o ..            at time n - since_clks_o: rad, rad/s, rad/s^2, rad/s^3.  The angle at time
//                         n + x, with d = (since_clks_o + x) / ClockHz, is
//                         angle + d (velocity + d (acceleration + d jerk / 3) / 2)
//                         to 5e-13 rad for d up to 1 us, while drive and level hold
//   Reset                 holds the start angle and velocity; time 0 is the first clock without it
//   Model                 vrscan.scene.mems_mirror, by scipy; they agree to 1e-9 rad
//
// It leaves out: the beam's own width, higher modes, noise of the drive, temperature but for the
// two inputs.

`default_nettype none

module mems_mirror #(
  parameter int unsigned ClockHz = 125_000_000,
  parameter int unsigned StepClks = (ClockHz + 500_000) / 1_000_000 > 0 ?
                                    (ClockHz + 500_000) / 1_000_000 : 1,  // 1 us
  parameter int unsigned LevelNominal = 734_003,  // 0.7 of full scale: torque is Torque
  parameter real NaturalHz = 248.5,
  parameter real Quality = 200.0,
  parameter real Torque = 8.52e4,  // tau, s^-2
  parameter real CombRad = 0.14870205226991687,  // a_c, 8.52 degrees
  parameter real Bias = 2.0e-7,  // b / w0^2, rad
  localparam int unsigned SinceWidth = $clog2(StepClks + 1)
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  input  wire logic                              drive_i,
  input  wire logic [vrscan_pkg::LevelWidth-1:0] level_i,

  input  wire logic                              shock_i,
  input  var real                                shock_rad_per_s_i,
  input  var real                                natural_offset_hz_i,
  input  var real                                damping_factor_i,
  input  var real                                start_angle_i,
  input  var real                                start_velocity_i,

  output      real                               angle_o,
  output      real                               velocity_o,
  output      real                               acceleration_o,
  output      real                               jerk_o,
  output      logic [SinceWidth-1:0]             since_clks_o
);

  localparam real TwoPi = 6.283185307179586;
  localparam real ClockS = 1.0 / real'(ClockHz);

  // Without jerk and its like: force per moment of inertia at an angle.
  function automatic real force_at(input real angle, input real velocity, input real loss,
                                   input real stiffness, input real torque);
    real r;
    r = angle / CombRad;
    // No torque, no exponential: half of all steps.
    force_at = stiffness * (Bias - angle) - loss * velocity
        - (torque == 0.0 ? 0.0 : torque * r * $exp(-r * r));
  endfunction

  function automatic void runge_kutta(inout real angle, inout real velocity, input real h,
                                      input real k1, input real loss, input real stiffness,
                                      input real torque);
    real v2, v3, v4, k2, k3, k4;
    v2 = velocity + 0.5 * h * k1;
    k2 = force_at(angle + 0.5 * h * velocity, v2, loss, stiffness, torque);
    v3 = velocity + 0.5 * h * k2;
    k3 = force_at(angle + 0.5 * h * v2, v3, loss, stiffness, torque);
    v4 = velocity + h * k3;
    k4 = force_at(angle + h * v3, v4, loss, stiffness, torque);
    angle = angle + h / 6.0 * (velocity + 2.0 * (v2 + v3) + v4);
    velocity = velocity + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
  endfunction

  logic                              drive_q;
  logic [vrscan_pkg::LevelWidth-1:0] level_q;
  real                               loss_q, stiffness_q, torque_q;  // since the last step

  logic changed;
  assign changed = drive_i != drive_q || level_i != level_q || shock_i || rst_i;

  // verilog_lint: waive-start always-ff-non-blocking (locals of one step, in the order of its sums)
  always_ff @(posedge clk_i) begin
    automatic real angle, velocity, loss, stiffness, torque, omega, ratio, r, slope, k1;
    drive_q <= drive_i;
    level_q <= level_i;
    if (changed || since_clks_o == SinceWidth'(StepClks - 1)) begin
      angle    = angle_o;
      velocity = velocity_o;
      // Up to time n with what held before; then the clock that ends now, if that fills a step.
      if (changed) begin
        if (since_clks_o != '0) begin
          runge_kutta(angle, velocity, real'(since_clks_o) * ClockS, acceleration_o, loss_q,
                      stiffness_q, torque_q);
        end
        if (shock_i) velocity = velocity + shock_rad_per_s_i;
      end else begin
        runge_kutta(angle, velocity, real'(StepClks) * ClockS, acceleration_o, loss_q, stiffness_q,
                    torque_q);
      end
      omega     = TwoPi * (NaturalHz + natural_offset_hz_i);
      loss      = omega / Quality * damping_factor_i;
      stiffness = omega * omega;
      ratio     = real'(level_i) / real'(LevelNominal);
      torque    = drive_i ? Torque * ratio * ratio : 0.0;
      since_clks_o <= SinceWidth'(changed);
      if (changed && StepClks == 1) begin
        k1 = force_at(angle, velocity, loss, stiffness, torque);
        runge_kutta(angle, velocity, ClockS, k1, loss, stiffness, torque);
        since_clks_o <= '0;
      end
      if (rst_i) begin
        angle        = start_angle_i;
        velocity     = start_velocity_i;
        since_clks_o <= '0;
      end
      k1 = force_at(angle, velocity, loss, stiffness, torque);
      r  = angle / CombRad;
      slope = torque == 0.0 ? 0.0 : torque / CombRad * (1.0 - 2.0 * r * r) * $exp(-r * r);
      loss_q         <= loss;
      stiffness_q    <= stiffness;
      torque_q       <= torque;
      angle_o        <= angle;
      velocity_o     <= velocity;
      acceleration_o <= k1;
      jerk_o         <= -loss * k1 - (stiffness + slope) * velocity;
    end else begin
      since_clks_o <= since_clks_o + SinceWidth'(1);
    end
  end
  // verilog_lint: waive-stop always-ff-non-blocking

endmodule

`default_nettype wire
