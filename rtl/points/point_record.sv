// point_record: all that is known of a line's point, as 64 bytes, one a clock.
//
// docs/link.md has the layout; numbers are little endian, signed ones sign-extended.  Without a
// window left is 1 and right 0.  Where the point is not measured position, sigma, doubt and sigma_z
// are 0, and x and z are free_from and free_to.  The number of points lost before this one is 0: who
// keeps records, counts.
//
//   valid_i        a point, which stands for link_pkg::FullBytes clocks more; the chain's are
//                  vrscan_pkg::PointPeriod apart
//   record_valid_o a byte, from record_index_o 0 to 63 without a gap
//   Latency        vrscan.fixed.point_record.LATENCY clocks from valid_i to the first byte
//   Model          vrscan.fixed.point_record, bit-exact

`default_nettype none

module point_record (
  input  wire logic               clk_i,
  input  wire logic               rst_i,

  input  wire logic               valid_i,
  input  wire vrscan_pkg::point_t point_i,

  output      logic               record_valid_o,
  output      logic [        5:0] record_index_o,
  output      logic [        7:0] record_o
);

  if (link_pkg::FullBytes >= vrscan_pkg::PointPeriod) begin : gen_bad_period
    $error("point_record: a record takes longer than the chain's least period");
  end

  logic        [15:0] left, right, sigma, doubt, sigma_z;
  logic signed [31:0] position, x, z;
  assign left     = point_i.width != '0 ? point_i.left : 16'd1;
  assign right    = point_i.width != '0 ? point_i.right : 16'd0;
  assign sigma    = point_i.measured ? point_i.sigma : 16'd0;
  assign doubt    = point_i.measured ? point_i.doubt : 16'd0;
  assign sigma_z  = point_i.measured ? point_i.sigma_z : 16'd0;
  assign position = point_i.measured ? 32'(point_i.position) : 32'sd0;
  localparam int unsigned Align = vrscan_pkg::LengthFraction - vrscan_pkg::FreeFraction;
  assign x        = point_i.measured ? 32'(point_i.x) : signed'(32'(point_i.free_from) << Align);
  assign z        = point_i.measured ? 32'(point_i.z) : signed'(32'(point_i.free_to) << Align);

  logic [link_pkg::FullBytes-1:0][7:0] record;
  assign record = {
    point_i.line.time_clks,
    16'd0,
    2'd0, point_i.flags[vrscan_pkg::FlagMapFilled], point_i.configuration,
    point_i.flags[vrscan_pkg::FlagMixed],
    point_i.line.test, point_i.line.inward, point_i.measured,
    point_i.line.confidence,
    doubt,
    point_i.c_sfm, point_i.c_obj,
    point_i.line.power, sigma_z,
    unsigned'(z), unsigned'(x),
    unsigned'(32'(point_i.line.angle)), unsigned'(position),
    sigma, point_i.snr,
    32'(point_i.noise), 32'(point_i.background),
    point_i.row_variance, 32'(point_i.row_mean),
    point_i.maximum, right, left,
    point_i.flags[15:0], point_i.number
  };

  // A byte is chosen among every eighth, then among the eight that are left.
  logic [5:0]      index_q, part_index_q;
  logic            run_q, part_valid_q;
  logic [7:0][7:0] part_q;
  always_ff @(posedge clk_i) begin
    index_q <= valid_i ? '0 : index_q + 6'd1;
    run_q   <= valid_i || (run_q && index_q != 6'(link_pkg::FullBytes - 1));

    for (int unsigned k = 0; k < 8; k++) part_q[k] <= record[{index_q[5:3], k[2:0]}];
    part_index_q <= index_q;
    part_valid_q <= run_q;

    record_o       <= part_q[part_index_q[2:0]];
    record_index_o <= part_index_q;
    record_valid_o <= part_valid_q;

    if (rst_i) begin
      run_q          <= 1'b0;
      part_valid_q   <= 1'b0;
      record_valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
