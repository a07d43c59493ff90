// peak_neighbours_contract: each line comes out once, in order and in time, behind the next one or
// behind the wait, which flush_i ends.

`default_nettype none

module peak_neighbours_contract #(
  parameter int unsigned NeighbourClks = 16384,
  parameter int unsigned UserWidth     = 8
) (
  input wire logic                              clk_i,
  input wire logic                              rst_i,
  input wire logic                              valid_i,
  input wire logic                              measured_i,
  input wire logic [             UserWidth-1:0] user_i,
  input wire logic                              flush_i,
  input wire logic                              valid_o,
  input wire logic                              mixed_o,
  input wire logic [vrscan_pkg::SigmaWidth-1:0] sigma_o,
  input wire logic [vrscan_pkg::SigmaWidth-1:0] typical_o,
  input wire logic [vrscan_pkg::SigmaWidth-1:0] doubt_o,
  input wire logic [             UserWidth-1:0] user_o
);

  // Two quotients, seven products and three roots, one after the other.
  localparam logic [15:0] Alone = 16'(32 + 3 + 2);  // the first one: nothing to give
  localparam logic [15:0] Latency = 16'(2 * (32 + 3 + 1) + 7 * (vrscan_pkg::multiply_latency(
      18, 18) + 1) + 3 * (18 + 3 + 1) + 5);

  logic                 started_q, waits_q, kept_q, gives_q, flush_q, came_q, idle, comes, late;
  logic                 measured_q, given_measured_q;
  logic [         15:0] age_q;  // clocks since a line was taken, or since the wait's end; 0 is idle
  logic [         31:0] since_q;  // the newest line
  logic [UserWidth-1:0] user_q, given_q;
  initial started_q = 1'b0;
  assign idle  = age_q == '0 || age_q == (gives_q ? Latency : Alone);
  assign comes = idle && (valid_i || waits_q);
  assign late  = idle && !comes && kept_q && (flush_q || since_q >= NeighbourClks);

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    age_q     <= comes || late ? 16'd1 : idle ? '0 : age_q + 16'd1;
    waits_q   <= (valid_i || waits_q) && !idle;
    flush_q   <= kept_q && flush_i && !comes && !late;
    came_q    <= comes && !rst_i;
    since_q   <= comes ? 32'd1 : since_q + 32'd1;
    if (comes || late) begin
      kept_q                      <= comes;
      gives_q                     <= kept_q;
      {given_measured_q, given_q} <= {measured_q, user_q};
    end
    if (comes) {measured_q, user_q} <= {measured_i, user_i};
    if (rst_i) begin
      {waits_q, kept_q, gives_q, flush_q} <= '0;
      age_q <= '0;
    end

    if (started_q) begin
      simulated_inputs_hold:
      assume (!came_q || {measured_i, user_i} == {measured_q, user_q});
      simulated_once_and_in_time: assert (valid_o == (gives_q && age_q == Latency));
      if (valid_o) begin
        simulated_in_order: assert (user_o == given_q);
        simulated_less_of_it: assert (typical_o <= sigma_o);
        simulated_no_doubt_of_nothing: assert (given_measured_q || (doubt_o == '0 && !mixed_o));
      end
    end
  end

endmodule

bind peak_neighbours peak_neighbours_contract #(
  .NeighbourClks(NeighbourClks), .UserWidth(UserWidth)
) u_contract (.*);

`default_nettype wire
