// line_sensor: a line camera behind C functions: an exposure, then its pixels, one a clock.
//
//   exposure_i    the pixels collect light while it is high
//   laser_i, power_i  what the laser sends; what comes outside an exposure is lost
//   angle_i       of the beam at the pulse's centre, rad; wanted 3 clocks after the exposure
//   lag_i, delay_clks_i  the readout waits until so many more exposures have ended, and then for so
//                 many clocks, fewer than from one end to the next.  What waits is forgotten
//                 HoldClks behind the last end
//   line_start_o .. pixel_o  LineLength pixels without a gap, Blanking clocks after that
//
// A line whose time comes before the one ahead of it is out is lost, and told to the C side.
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
  input  wire logic [                       1:0] lag_i,
  input  wire logic [                      31:0] delay_clks_i,

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

  localparam logic [31:0] HoldClks = 32'd16384;
  logic        exposure_q, busy_q;
  logic [63:0] light_q;
  logic [31:0] clks_q;
  logic [31:0] time_q;  // since the readout's time

  // The last exposures, by the lower bits of their number, and the last end.
  logic [63:0] lights_q [4];
  logic [31:0] lengths_q [4];
  real         angles_q [4];
  logic [ 1:0] number_q, last_q, read_q;
  logic [31:0] ended_q, since_q;
  logic        ended, due;
  assign ended = exposure_q && !exposure_i && !rst_i;
  assign due   = !rst_i && (ended ? delay_clks_i == '0 : since_q == delay_clks_i)
                 && ended_q + 32'(ended) > 32'(lag_i);

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
    since_q <= ended ? 32'd1 : since_q + 32'd1;
    if (since_q == HoldClks) ended_q <= '0;
    if (ended) begin
      lights_q[number_q]  <= light_q;
      lengths_q[number_q] <= clks_q;
      last_q              <= number_q;
      number_q            <= number_q + 2'd1;
      ended_q             <= ended_q + 32'd1;
    end
    if (since_q == 32'd3) angles_q[last_q] <= angle_i;
    if (due) begin
      if (busy_q && !(reading && index == 32'(LineLength - 1))) begin
        sensor_lost();
      end else begin
        busy_q <= 1'b1;
        time_q <= '0;
        read_q <= (ended ? number_q : last_q) - lag_i;
      end
    end
    if (busy_q && !rst_i && time_q == 32'(Blanking - 1)) begin
      sensor_expose(angles_q[read_q], lights_q[read_q], lengths_q[read_q]);
    end

    line_start_o  <= reading && index == '0;
    line_end_o    <= reading && index == 32'(LineLength - 1);
    pixel_valid_o <= reading;
    if (reading) pixel_o <= PixelWidth'(sensor_pixel(index));

    if (rst_i) begin
      exposure_q    <= 1'b0;
      busy_q        <= 1'b0;
      number_q      <= '0;
      ended_q       <= '0;
      since_q       <= '1;
      line_start_o  <= 1'b0;
      line_end_o    <= 1'b0;
      pixel_valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
