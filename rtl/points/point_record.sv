// point_record: all that is known of a line's point, as 64 bytes, one a clock.
//
// docs/link.md has the layout; numbers are little endian, signed ones sign-extended.  What has no
// meaning is 0: left and right where width is 0; position, sigma, x, z, sigma_z where the point is
// not measured.  The number of points lost before this one is 0: who keeps records, counts.
//
//   valid_i        a point, at least link_pkg::FullBytes clocks after the one before; the chain's
//                  are 200 apart
//   time_i         of the pulse's centre, clocks
//   record_valid_o a byte, from record_index_o 0 to 63 without a gap
//   Latency        1 clock from valid_i to the first byte
//   Model          vrscan.fixed.point_record, bit-exact

`default_nettype none

module point_record #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  localparam int unsigned IndexWidth    = $clog2(LineLength),
  localparam int unsigned WidthWidth    = $clog2(LineLength + 1),
  localparam int unsigned PositionWidth = IndexWidth + 1 + vrscan_pkg::PositionFraction
) (
  input  wire logic                                           clk_i,
  input  wire logic                                           rst_i,

  input  wire logic                                           valid_i,
  input  wire logic        [ vrscan_pkg::LineNumberWidth-1:0] line_i,
  input  wire logic        [       vrscan_pkg::FlagWidth-1:0] flags_i,
  input  wire logic                                           measured_i,
  input  wire logic        [                  IndexWidth-1:0] left_i,
  input  wire logic        [                  IndexWidth-1:0] right_i,
  input  wire logic        [                  WidthWidth-1:0] width_i,
  input  wire logic        [                  PixelWidth-1:0] maximum_i,
  input  wire logic        [      vrscan_pkg::CountWidth-1:0] row_mean_i,
  input  wire logic        [   vrscan_pkg::VarianceWidth-1:0] row_variance_i,
  input  wire logic        [      vrscan_pkg::CountWidth-1:0] background_i,
  input  wire logic        [      vrscan_pkg::CountWidth-1:0] noise_i,
  input  wire logic        [        vrscan_pkg::SnrWidth-1:0] snr_i,
  input  wire logic signed [               PositionWidth-1:0] position_i,
  input  wire logic        [      vrscan_pkg::SigmaWidth-1:0] sigma_i,
  input  wire logic signed [      vrscan_pkg::AngleWidth-1:0] angle_i,
  input  wire logic signed [     vrscan_pkg::LengthWidth-1:0] x_i,
  input  wire logic signed [     vrscan_pkg::LengthWidth-1:0] z_i,
  input  wire logic        [      vrscan_pkg::SigmaWidth-1:0] sigma_z_i,
  input  wire logic        [ vrscan_pkg::ConfidenceWidth-1:0] c_obj_i,
  input  wire logic        [ vrscan_pkg::ConfidenceWidth-1:0] c_sfm_i,
  input  wire logic        [      vrscan_pkg::PowerWidth-1:0] power_i,
  input  wire logic        [                             7:0] confidence_i,  // the mirror's
  input  wire logic                                           inward_i,
  input  wire logic                                           test_i,
  input  wire logic        [       vrscan_pkg::TimeWidth-1:0] time_i,

  output      logic                                           record_valid_o,
  output      logic        [                             5:0] record_index_o,
  output      logic        [                             7:0] record_o
);

  if (LineLength < 64 || LineLength > 32768) begin : gen_bad_line_length
    $error("point_record: LineLength must be 64 to 32768");
  end
  if (PixelWidth > 16) begin : gen_bad_pixel_width
    $error("point_record: PixelWidth must be at most 16");
  end

  localparam int unsigned RecordWidth = 8 * link_pkg::FullBytes;

  logic        [15:0] left, right, sigma, sigma_z;
  logic signed [31:0] position, angle, x, z;
  assign left     = width_i != '0 ? 16'(left_i) : 16'd0;
  assign right    = width_i != '0 ? 16'(right_i) : 16'd0;
  assign sigma    = measured_i ? sigma_i : 16'd0;
  assign sigma_z  = measured_i ? sigma_z_i : 16'd0;
  assign position = measured_i ? 32'(position_i) : 32'sd0;
  assign angle    = 32'(angle_i);
  assign x        = measured_i ? 32'(x_i) : 32'sd0;
  assign z        = measured_i ? 32'(z_i) : 32'sd0;

  logic [RecordWidth-1:0] record, record_q;
  assign record = {
    time_i,
    16'd0,
    5'd0, test_i, inward_i, measured_i,
    confidence_i,
    16'(width_i),
    c_sfm_i, c_obj_i,
    power_i, sigma_z,
    unsigned'(z), unsigned'(x),
    unsigned'(angle), unsigned'(position),
    sigma, snr_i,
    32'(noise_i), 32'(background_i),
    row_variance_i, 32'(row_mean_i),
    16'(maximum_i), right, left,
    flags_i, line_i
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
