// triangulate_contract: one point at a time; each comes in time or is told as dropped, stays until
// it is taken, and has no place where it says so.

`default_nettype none

module triangulate_contract #(
  parameter int unsigned UserWidth = 8
) (
  input wire logic                                          clk_i,
  input wire logic                                          rst_i,
  input wire logic                                          valid_i,
  input wire logic        [                  UserWidth-1:0] user_i,
  input wire logic                                          valid_o,
  input wire logic                                          ready_i,
  input wire logic                                          measured_o,
  input wire logic signed [    vrscan_pkg::LengthWidth-1:0] x_o,
  input wire logic signed [    vrscan_pkg::LengthWidth-1:0] z_o,
  input wire logic        [     vrscan_pkg::SigmaWidth-1:0] sigma_z_o,
  input wire logic        [vrscan_pkg::ConfidenceWidth-1:0] c_obj_o,
  input wire logic                                          no_range_o,
  input wire logic                                          out_of_range_o,
  input wire logic                                          lost_o,
  input wire logic        [                  UserWidth-1:0] user_o,
  input wire logic                                          dropped_o
);

  localparam logic [15:0] Period = 16'(vrscan_pkg::PointPeriod);
  localparam int unsigned Width = 2 * vrscan_pkg::LengthWidth + vrscan_pkg::SigmaWidth
      + vrscan_pkg::ConfidenceWidth + UserWidth + 4;

  logic                 started_q, takes, ends, full, there_q, stays_q, drop_q, no_place;
  logic [         15:0] age_q;  // clocks since the point that was taken; 0 is idle
  logic [UserWidth-1:0] user_q, due_q;
  logic [    Width-1:0] point, point_q;
  initial started_q = 1'b0;
  assign ends     = age_q == Period;  // it is there a clock later
  assign takes    = valid_i && (age_q == '0 || ends);
  assign full     = valid_o && !ready_i;
  assign no_place = no_range_o || out_of_range_o;
  assign point    = {measured_o, x_o, z_o, sigma_z_o, c_obj_o, no_range_o, out_of_range_o, lost_o,
                     user_o};

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= takes ? 16'd1 : age_q == '0 || ends ? '0 : age_q + 16'd1;
    there_q   <= ends || full;
    stays_q   <= full;
    drop_q    <= (valid_i && !takes) || (ends && full);
    point_q   <= point;
    if (takes) user_q <= user_i;
    if (ends && !full) due_q <= user_q;
    if (rst_i) begin
      {there_q, stays_q, drop_q} <= '0;
      age_q <= '0;
    end

    if (started_q) begin
      simulated_in_time_and_until_taken: assert (valid_o == there_q);
      simulated_stays: assert (!stays_q || point == point_q);
      simulated_drops_are_told: assert (dropped_o == drop_q);
      if (valid_o) begin
        simulated_in_order: assert (user_o == due_q);
        simulated_no_place:
        assert (!no_place || (measured_o && x_o == '0 && z_o == '0 && c_obj_o == '0 &&
                              sigma_z_o == '1 && !(no_range_o && out_of_range_o)));
        simulated_nothing_of_nothing:
        assert (measured_o || {x_o, z_o, sigma_z_o, c_obj_o, no_place} == '0);
      end
    end
  end

endmodule

bind triangulate triangulate_contract #(.UserWidth(UserWidth)) u_contract (.*);

`default_nettype wire
