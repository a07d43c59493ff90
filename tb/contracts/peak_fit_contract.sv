// peak_fit_contract: each spot that is taken has its answer once, in a time that it does not
// change; a place is on the line, or what came in.

`default_nettype none

module peak_fit_contract #(
  parameter int unsigned LineLength    = 2048,
  parameter int unsigned PositionWidth = 24
) (
  input wire logic                            clk_i,
  input wire logic                            rst_i,
  input wire logic                            valid_i,
  input wire logic                            measured_i,
  input wire logic signed [PositionWidth-1:0] position_i,
  input wire logic                            reading_o,
  input wire logic                            valid_o,
  input wire logic                            mixed_o,
  input wire logic signed [PositionWidth-1:0] position_o
);

  localparam logic [15:0] Unmeasured = 16'd96;

  logic                            started_q, takes, measured_q;
  logic        [             15:0] age_q;  // clocks since the spot that was taken; 0 is idle
  logic        [             15:0] latency_q;  // of the first fit
  logic signed [PositionWidth-1:0] position_q;
  initial {started_q, latency_q} = '0;
  assign takes = valid_i && (age_q == '0 || valid_o);

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= rst_i ? '0 : takes ? 16'd1 : age_q == '0 || valid_o ? '0 : age_q + 16'd1;
    if (takes) {measured_q, position_q} <= {measured_i, position_i};
    if (started_q && valid_o && measured_q && latency_q == '0) latency_q <= age_q;

    if (started_q) begin
      simulated_one_for_each: assert (!valid_o || age_q != '0);
      simulated_whatever_the_spot:
      assert (measured_q ? latency_q == '0 || age_q == '0 || age_q <= latency_q &&
                           (age_q != latency_q || valid_o) && (!valid_o || age_q == latency_q)
                         : age_q <= Unmeasured && (!valid_o || age_q == Unmeasured));
      simulated_reads_while_it_works: assert (!reading_o || (age_q != '0 && measured_q));
      simulated_moved_on_the_line:
      assert (!valid_o || position_o == position_q ||
              (position_o >= 0 && 32'(position_o) < LineLength << vrscan_pkg::PositionFraction));
      simulated_nothing_of_nothing:
      assert (!valid_o || measured_q || (position_o == position_q && !mixed_o));
    end
  end

endmodule

bind peak_fit peak_fit_contract #(
  .LineLength(LineLength), .PositionWidth(PositionWidth)
) u_contract (.*);

`default_nettype wire
