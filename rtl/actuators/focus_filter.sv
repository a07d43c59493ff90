// focus_filter: the distance of the scene, averaged over good points.
//
// A point is good where it is measured without a flag of range or mirror.  Good points are
// averaged: average += (z - average) / 2**s, to nearest, half up, with 16 more bits kept.  s is 0
// for the first good point, 1 for two, 2 for four, up to focus_average_shift: the first points
// weigh about as much as each other.  From the first with the largest s on, distance_o follows.
// A good point after more than focus_lapse others on end is a first one; the distance stands until
// it is followed again.  Points of test lines count nowhere.
//
//   valid_i     a point, which is ignored while the last good one or the target is at work
//   busy_i      the target is at work
//   valid_o     with a new distance_o
//   lapse_o     the good point at work is a first one after a lapse
//   Latency     valid_i to valid_o: 8 clocks, to lapse_o: 2 clocks
//   Model       vrscan.clocked.focus_filter, bit-exact

`default_nettype none

module focus_filter (
  input  wire logic                                      clk_i,
  input  wire logic                                      rst_i,

  input  wire logic                                      valid_i,
  input  wire vrscan_pkg::point_t                        point_i,
  input  wire logic                                      busy_i,

  output      logic                                      valid_o,
  output      logic signed [vrscan_pkg::LengthWidth-1:0] distance_o,
  output      logic                                      lapse_o,

  // Configuration.
  input  wire register_pkg::focus_t                      focus_i
);

  localparam int unsigned LengthWidth = vrscan_pkg::LengthWidth;
  localparam int unsigned FineWidth = 16;  // bits of the average below those of z
  localparam int unsigned AverageWidth = LengthWidth + FineWidth;
  localparam int unsigned DeltaWidth = AverageWidth + 1;
  localparam int unsigned MaxShift = 15;

  localparam logic [vrscan_pkg::FlagWidth-1:0] BadFlags =
      vrscan_pkg::FlagWidth'(1 << vrscan_pkg::FlagNoRange | 1 << vrscan_pkg::FlagOutOfRange |
                             1 << vrscan_pkg::FlagNotRunning | 1 << vrscan_pkg::FlagIndexFault |
                             1 << vrscan_pkg::FlagUnsettled);

  // The clocks since a good point; 0 is idle.  What stands below in the order of its ages is
  // free-running: its operands hold long enough.
  localparam int unsigned AgeWidth = 3;
  localparam logic [AgeWidth-1:0] Begin = AgeWidth'(1);
  localparam logic [AgeWidth-1:0] Average = AgeWidth'(6);
  localparam logic [AgeWidth-1:0] Distance = AgeWidth'(7);
  logic [AgeWidth-1:0] age_q;
  logic                take, good, other_q;
  assign take = valid_i && !point_i.line.test && age_q == '0 && !valid_o && !busy_i;
  assign good = point_i.measured && (point_i.flags & BadFlags) == '0;

  logic        [            15:0] others_q;
  logic signed [ LengthWidth-1:0] point_z_q, z_q;
  logic        [             3:0] level_q, shift_q;  // log2 of the good points; s
  logic        [    MaxShift-1:0] count_q;  // of them at this level
  logic                           enough_q, lapse;
  logic signed [AverageWidth-1:0] average_q;
  logic signed [  DeltaWidth-1:0] delta_q;
  // A bit more, to round with.
  logic signed [    DeltaWidth:0] coarse_q, fine_q;
  logic signed [  DeltaWidth-1:0] part_q;
  assign lapse = age_q == Begin && others_q > focus_i.focus_lapse;

  always_ff @(posedge clk_i) begin
    valid_o <= 1'b0;
    lapse_o <= lapse;
    if (take && good) age_q <= Begin;
    else if (age_q == Distance) age_q <= '0;
    else if (age_q != '0) age_q <= age_q + AgeWidth'(1);

    // The points come from afar: what they decide, the counter and z, follows a clock later.
    point_z_q <= point_i.z;
    other_q   <= take && !good;
    if (age_q == Begin) z_q <= point_z_q;
    if (other_q && others_q != '1) others_q <= others_q + 16'd1;
    if (age_q == Begin) others_q <= '0;
    if (lapse) begin
      level_q <= '0;
      count_q <= '0;
    end

    delta_q  <= (DeltaWidth'(z_q) <<< FineWidth) - DeltaWidth'(average_q);
    enough_q <= level_q >= focus_i.focus_average_shift;
    shift_q  <= level_q >= focus_i.focus_average_shift ? focus_i.focus_average_shift : level_q;
    coarse_q <= signed'({delta_q, 1'b0}) >>> {shift_q[3:2], 2'b00};
    fine_q   <= coarse_q >>> shift_q[1:0];
    part_q   <= signed'(fine_q[DeltaWidth:1]) + DeltaWidth'(signed'({1'b0, fine_q[0]}));
    if (age_q == Average) begin
      // It stays between the average and z.
      average_q <= AverageWidth'(DeltaWidth'(average_q) + part_q);
      if (!enough_q) begin
        count_q <= count_q + MaxShift'(1);
        if (count_q == ~({MaxShift{1'b1}} << level_q)) begin
          level_q <= level_q + 4'd1;
          count_q <= '0;
        end
      end
    end
    if (age_q == Distance && enough_q) begin
      valid_o    <= 1'b1;
      distance_o <= average_q[FineWidth+:LengthWidth] + LengthWidth'(average_q[FineWidth-1]);
    end

    if (rst_i) begin
      age_q      <= '0;
      other_q    <= 1'b0;
      others_q   <= '0;
      level_q    <= '0;
      count_q    <= '0;
      average_q  <= '0;
      valid_o    <= 1'b0;
      distance_o <= '0;
      lapse_o    <= 1'b0;
    end
  end

endmodule

`default_nettype wire
