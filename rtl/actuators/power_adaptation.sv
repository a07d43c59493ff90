// power_adaptation: the laser's power for the next line, from the peak of the line before.
//
// Every point tells the height of its peak over the background.  The next power is the point's own
// power times a factor, with one multiplier and no division.  The factor of a point is, where it is
//   saturated     laser_cut / 2**14
//   not measured  1 + laser_search / 2**14, and the power is one step more
//   else          1 + k (laser_target - height) / 2**16, k = laser_down / 2**13 above the target,
//                 laser_up / 2**13 below; to 14 fraction bits, nearest, half up, within 0 and 8
// The power is rounded to nearest, half up, and kept within laser_power_min (at least 1) and
// laser_power_max; of limits that contradict each other the upper one is looked at first.  Each
// direction of the scan has its own power, or with laser_shared both have one.  Points of test
// lines and of lines without power are ignored.
//
// While laser_enable or laser_adapt is low both powers are laser_power, raised to the least one;
// there the adaptation begins.  Without laser_adapt power_o is laser_power itself.  The registers
// must hold while a point is worked on.
//
//   pulse_i   when a pulse ends, the next line's power is taken
//   armed_i   of laser_interlock; while it is low the power is taken in every clock
//   inward_i  direction of the scan, whose power is taken
//   power_o   the power that is wanted, a clock after it is taken
//   inward_power_o, outward_power_o  the next power of each direction
//   Latency  point_valid_i to the new power: 21 clocks; a point_valid_i within the first 19 of
//            these starts anew
//   Model    vrscan.clocked.power_adaptation, bit-exact

`default_nettype none

module power_adaptation #(
  parameter int unsigned PixelWidth = 12
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  // The point of a line.
  input  wire logic                              point_valid_i,
  input  wire vrscan_pkg::point_t                point_i,

  // The line that comes.
  input  wire logic                              pulse_i,
  input  wire logic                              armed_i,
  input  wire logic                              inward_i,
  output      logic [vrscan_pkg::PowerWidth-1:0] power_o,

  // Registers.
  input  wire register_pkg::laser_t              laser_i,
  output      logic [vrscan_pkg::PowerWidth-1:0] inward_power_o,
  output      logic [vrscan_pkg::PowerWidth-1:0] outward_power_o
);

  localparam int unsigned PowerWidth = vrscan_pkg::PowerWidth;
  localparam int unsigned FactorFraction = 14;
  localparam int unsigned FactorWidth = 18;
  localparam int unsigned GainFraction = 13;
  localparam int unsigned ErrorWidth = PowerWidth + 1;
  localparam int unsigned ProductWidth = ErrorWidth + FactorWidth;
  localparam int unsigned RatioShift = PowerWidth + GainFraction - FactorFraction;
  localparam int unsigned SumWidth = ProductWidth - RatioShift + 1;
  localparam int unsigned NewWidth = ProductWidth - FactorFraction;
  localparam logic signed [SumWidth-1:0] One = SumWidth'(1) <<< FactorFraction;

  localparam int unsigned AgeWidth = 5;
  localparam int unsigned Product = vrscan_pkg::multiply_latency(ErrorWidth, FactorWidth);
  // When the products start, when the first one is there, and when the new power is.
  localparam logic [AgeWidth-1:0] Relate = AgeWidth'(3);
  localparam logic [AgeWidth-1:0] Related = AgeWidth'(3 + Product);
  localparam logic [AgeWidth-1:0] Scale = AgeWidth'(5 + Product);
  localparam logic [AgeWidth-1:0] Commit = AgeWidth'(8 + 2 * Product);

  // Peak and background, their top bits.
  localparam int unsigned AlignedWidth = vrscan_pkg::AlignedWidth;
  logic [AlignedWidth-1:0] maximum, background;
  assign maximum    = point_i.maximum << (AlignedWidth - PixelWidth);
  assign background = point_i.background[vrscan_pkg::CountWidth-1-:AlignedWidth];

  // The clocks since point_valid_i; 0 is idle.  What stands below in the order of its ages is
  // free-running: its operands hold long enough.
  logic        [    AgeWidth-1:0] age_q;
  logic        [  PowerWidth-1:0] base_q;
  logic        [  PowerWidth-1:0] height_q;
  logic                           saturated_q, measured_q, point_inward_q;
  logic signed [  ErrorWidth-1:0] error_q;
  logic        [            15:0] gain_q;
  logic signed [    SumWidth-1:0] sum_q;
  logic signed [ FactorWidth-1:0] factor_q;
  logic signed [    NewWidth-1:0] new_q;
  logic                           above_q, below_q;
  logic        [  PowerWidth-1:0] least_q, first_q, clipped_q;
  logic                           start;
  logic signed [  ErrorWidth-1:0] a;
  logic signed [ FactorWidth-1:0] b;
  logic signed [ProductWidth-1:0] product;
  assign start = age_q == Relate || age_q == Scale;
  assign a     = age_q == Scale ? signed'({1'b0, base_q}) : error_q;
  assign b     = age_q == Scale ? factor_q : signed'({2'b00, gain_q});

  multiply #(
    .AWidth(ErrorWidth),
    .BWidth(FactorWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (start),
    .a_i      (a),
    .b_i      (b),
    .valid_o  (),
    .product_o(product)
  );

  logic pulse_q, still;
  assign still = !laser_i.laser_adapt || !laser_i.laser_enable;

  always_ff @(posedge clk_i) begin
    if (point_valid_i && !point_i.line.test && point_i.line.power != '0) begin
      age_q          <= AgeWidth'(1);
      base_q         <= point_i.line.power;
      saturated_q    <= point_i.flags[vrscan_pkg::FlagSaturated];
      measured_q     <= point_i.measured;
      point_inward_q <= point_i.line.inward;
      height_q       <= maximum > background ? maximum - background : '0;
    end else if (age_q != '0) begin
      age_q <= age_q == Commit ? '0 : age_q + AgeWidth'(1);
    end
    error_q <= signed'({1'b0, laser_i.laser_target}) - signed'({1'b0, height_q});
    gain_q  <= error_q[ErrorWidth-1] ? laser_i.laser_down : laser_i.laser_up;
    // To nearest, half up.
    if (age_q == Related) begin
      sum_q <= One + SumWidth'(product >>> RatioShift)
               + SumWidth'(signed'({1'b0, product[RatioShift-1]}));
    end
    if (saturated_q) begin
      factor_q <= FactorWidth'(signed'({1'b0, laser_i.laser_cut}));
    end else if (!measured_q) begin
      factor_q <= FactorWidth'(One) + FactorWidth'(signed'({1'b0, laser_i.laser_search}));
    end else if (sum_q[SumWidth-1]) begin
      factor_q <= '0;
    end else if (sum_q[SumWidth-2:FactorWidth-1] != '0) begin
      factor_q <= {1'b0, {(FactorWidth - 1) {1'b1}}};
    end else begin
      factor_q <= sum_q[FactorWidth-1:0];
    end
    // Of nothing measured one step more, or a small power would stand.
    new_q     <= NewWidth'(product >>> FactorFraction)
                 + NewWidth'(signed'({1'b0, product[FactorFraction-1]}))
                 + NewWidth'(signed'({1'b0, !saturated_q && !measured_q}));
    least_q   <= laser_i.laser_power_min == '0 ? PowerWidth'(1) : laser_i.laser_power_min;
    above_q   <= new_q >= NewWidth'(signed'({1'b0, laser_i.laser_power_max}));
    below_q   <= new_q < NewWidth'(signed'({1'b0, least_q}));
    clipped_q <= above_q ? laser_i.laser_power_max : below_q ? least_q : new_q[PowerWidth-1:0];
    first_q   <= laser_i.laser_power < least_q ? least_q : laser_i.laser_power;

    if (age_q == Commit) begin
      if (laser_i.laser_shared || point_inward_q) inward_power_o <= clipped_q;
      if (laser_i.laser_shared || !point_inward_q) outward_power_o <= clipped_q;
    end
    if (still) age_q <= '0;
    if (still || inward_power_o == '0) inward_power_o <= first_q;
    if (still || outward_power_o == '0) outward_power_o <= first_q;

    pulse_q <= pulse_i;
    if ((pulse_q && !pulse_i) || !armed_i) begin
      power_o <= !laser_i.laser_adapt ? laser_i.laser_power :
                 laser_i.laser_shared || inward_i ? inward_power_o : outward_power_o;
    end

    if (rst_i) begin
      age_q           <= '0;
      least_q         <= '0;
      first_q         <= '0;
      inward_power_o  <= '0;
      outward_power_o <= '0;
      pulse_q         <= 1'b0;
      power_o         <= '0;
    end
  end

endmodule

`default_nettype wire
