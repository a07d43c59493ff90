// cordic_vector_contract: an angle comes once and in time; a magnitude is that of its sides.

`default_nettype none

module cordic_vector_contract #(
  parameter int unsigned XyWidth    = 48,
  parameter int unsigned AngleWidth = 24
) (
  input wire logic                      clk_i,
  input wire logic                      rst_i,
  input wire logic                      valid_i,
  input wire logic signed [XyWidth-1:0] x_i,
  input wire logic signed [XyWidth-1:0] y_i,
  input wire logic                      valid_o,
  input wire logic     [AngleWidth-1:0] angle_o,
  input wire logic        [XyWidth+1:0] magnitude_o,
  input wire logic                      zero_o
);

  localparam logic [7:0] Latency = 8'(2 * (AngleWidth + 2) + 2 * ((XyWidth - 1) / 8) + 18);

  logic               started_q;
  logic [        7:0] age_q;  // clocks since valid_i; 0 is idle
  logic [XyWidth+1:0] x_q, y_q, longer;  // the sides
  initial started_q = 1'b0;
  assign longer = x_q > y_q ? x_q : y_q;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : valid_i ? 8'd1 : age_q == '0 || age_q == Latency ? '0 : age_q + 8'd1;
    if (valid_i) begin
      x_q <= (XyWidth + 2)'(unsigned'(x_i < 0 ? -x_i : x_i));
      y_q <= (XyWidth + 2)'(unsigned'(y_i < 0 ? -y_i : y_i));
    end

    if (started_q) begin
      simulated_once_and_in_time: assert (valid_o == (age_q == Latency));
      if (valid_o) begin
        simulated_zero: assert (zero_o == (longer == '0) &&
                                (!zero_o || (angle_o == '0 && magnitude_o == '0)));
        // The gain is between 13/8 and 2.
        simulated_magnitude: assert (magnitude_o + (XyWidth + 2)'(2) >=
                                     longer + (longer >> 1) + (longer >> 3) &&
                                     (magnitude_o >> 1) <= x_q + y_q);
      end
    end
  end

endmodule

bind cordic_vector cordic_vector_contract #(
  .XyWidth(XyWidth), .AngleWidth(AngleWidth)
) u_contract (.*);

`default_nettype wire
