// line_sensor: a line camera behind C functions: an exposure, then its pixels, one a clock.
//
//   exposure_i    the pixels collect light while it is high
//   laser_i, power_i  what the laser sends; what comes outside an exposure is lost
//   angle_i       of the beam at the pulse's centre, rad; wanted Blanking clocks after the exposure
//   line_start_o .. pixel_o  LineLength pixels without a gap, Blanking clocks after the exposure
//
// An exposure that ends before the line of the one before is out is lost, and told to the C side.
//
//   sensor_expose(angle, light, exposure_clks)  a line is to be made; light is the sum of power_i
//   sensor_pixel(index)                         a pixel of that line
//   sensor_lost()                               a line was lost

`default_nettype none

module line_sensor #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned Blanking   = 16  // at least 4
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  input  wire logic                              exposure_i,
  input  wire logic                              laser_i,
  input  wire logic [vrscan_pkg::PowerWidth-1:0] power_i,
  input  var real                                angle_i,

  output      logic                              line_start_o,
  output      logic                              line_end_o,
  output      logic                              pixel_valid_o,
  output      logic [            PixelWidth-1:0] pixel_o
);

  import "DPI-C" function void sensor_expose(
    input real angle_rad, input longint light, input int exposure_clks);
  import "DPI-C" function int sensor_pixel(input int index);
  import "DPI-C" function void sensor_lost();

  if (Blanking < 4) begin : gen_bad_blanking
    $error("line_sensor: Blanking must be at least 4");
  end

  logic        exposure_q, busy_q;
  logic [63:0] light_q, kept_light_q;
  logic [31:0] clks_q, kept_clks_q;
  logic [31:0] time_q;  // since the exposure's end

  logic        reading;
  logic [31:0] index;
  assign reading = busy_q && !rst_i && time_q >= 32'(Blanking);
  assign index   = time_q - 32'(Blanking);

  always_ff @(posedge clk_i) begin
    exposure_q <= exposure_i;
    if (exposure_i) begin
      light_q <= (exposure_q ? light_q : '0) + (laser_i ? 64'(power_i) : '0);
      clks_q  <= (exposure_q ? clks_q : '0) + 32'd1;
    end

    time_q <= time_q + 32'd1;
    if (reading && index == 32'(LineLength - 1)) busy_q <= 1'b0;
    if (exposure_q && !exposure_i && !rst_i) begin
      if (busy_q && !(reading && index == 32'(LineLength - 1))) begin
        sensor_lost();
      end else begin
        busy_q       <= 1'b1;
        time_q       <= '0;
        kept_light_q <= light_q;
        kept_clks_q  <= clks_q;
      end
    end
    if (busy_q && !rst_i && time_q == 32'(Blanking - 1)) begin
      sensor_expose(angle_i, kept_light_q, kept_clks_q);
    end

    line_start_o  <= reading && index == '0;
    line_end_o    <= reading && index == 32'(LineLength - 1);
    pixel_valid_o <= reading;
    if (reading) pixel_o <= PixelWidth'(sensor_pixel(index));

    if (rst_i) begin
      exposure_q    <= 1'b0;
      busy_q        <= 1'b0;
      line_start_o  <= 1'b0;
      line_end_o    <= 1'b0;
      pixel_valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
