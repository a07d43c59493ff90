// point_packer_contract: a packet comes whole and without a gap, has at most 240 bytes, and each byte
// stays until it is taken.

`default_nettype none

module point_packer_contract #(
  parameter int unsigned CountWidth = 16
) (
  input wire logic                  clk_i,
  input wire logic                  rst_i,
  input wire logic                  valid_o,
  input wire logic                  ready_i,
  input wire logic [           7:0] data_o,
  input wire logic                  last_o,
  input wire logic [CountWidth-1:0] points_dropped_o
);

  localparam logic [7:0] Most = 8'd240;

  logic                  started_q, stays_q, goes_on_q, reset_q;
  logic [           7:0] number_q;  // of the byte in its packet
  logic [           8:0] byte_q;
  logic [CountWidth-1:0] dropped_q;
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    reset_q   <= rst_i;
    stays_q   <= valid_o && !ready_i && !rst_i;
    goes_on_q <= valid_o && !(ready_i && last_o) && !rst_i;
    byte_q    <= {last_o, data_o};
    dropped_q <= points_dropped_o;
    if (rst_i) number_q <= 8'd1;
    else if (valid_o && ready_i) number_q <= last_o ? 8'd1 : number_q + 8'd1;

    if (started_q) begin
      simulated_stays: assert (!stays_q || {last_o, data_o} == byte_q);
      simulated_without_a_gap: assert (!goes_on_q || valid_o);
      simulated_no_longer: assert (!valid_o || number_q < Most || (last_o && number_q == Most));
      simulated_count_stops: assert (reset_q || points_dropped_o >= dropped_q);
    end
  end

endmodule

bind point_packer point_packer_contract #(.CountWidth(CountWidth)) u_contract (.*);

`default_nettype wire
