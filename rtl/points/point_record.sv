// point_record: all that is known of a line's point, as 64 bytes, one a clock.
//
// docs/link.md has the layout; numbers are little endian, signed ones sign-extended.  Without a
// window left is 1 and right 0.  Where the point is not measured position, sigma, doubt and sigma_z
// are 0, and x and z are free_from and free_to.  The number of points lost before this one is 0: who
// keeps records, counts.
//
//   valid_i        a point, at least link_pkg::FullBytes clocks after the one before; the chain's
//                  are vrscan_pkg::PointPeriod apart
//   record_valid_o a byte, from record_index_o 0 to 63 without a gap
//   Latency        1 clock from valid_i to the first byte
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

  if (link_pkg::FullBytes > vrscan_pkg::PointPeriod) begin : gen_bad_period
    $error("point_record: a record takes longer than the chain's least period");
  end

  localparam int unsigned RecordWidth = 8 * link_pkg::FullBytes;

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

  logic [RecordWidth-1:0] record, record_q;
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

  assign record_o = record_q[7:0];

  always_ff @(posedge clk_i) begin
    record_q <= valid_i ? record : record_q >> 8;
    if (valid_i) begin
      record_valid_o <= 1'b1;
      record_index_o <= 6'd0;
    end else begin
      if (record_index_o == 6'(link_pkg::FullBytes - 1)) record_valid_o <= 1'b0;
      record_index_o <= record_index_o + 6'd1;
    end
    if (rst_i) record_valid_o <= 1'b0;
  end

endmodule

`default_nettype wire
