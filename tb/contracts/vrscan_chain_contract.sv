// vrscan_chain_contract: a line has one configuration from its first pixel to its point.

`default_nettype none

module vrscan_chain_contract (
  input wire logic                      clk_i,
  input wire logic                      rst_i,
  input wire logic                      valid_o,
  input wire vrscan_pkg::point_t        point_o,
  input wire logic                      hold_i,
  input wire logic                      empty_o,
  input wire logic                      configuration_i,
  input wire register_pkg::peak_t       peak_i,
  input wire register_pkg::geometry_t   geometry_i,
  input wire register_pkg::free_t       free_i,
  input wire register_pkg::free_table_t free_table_i,
  input wire logic                      fresh_q
);

  logic started_q;
  initial started_q = 1'b0;

  logic configuration_q, bank_q;
  register_pkg::peak_t peak_q;
  register_pkg::geometry_t geometry_q;
  register_pkg::free_t free_q;
  logic same;
  assign same = configuration_i == configuration_q && free_table_i.free_table_bank == bank_q &&
                peak_i == peak_q && geometry_i == geometry_q && free_i == free_q;

  always_ff @(posedge clk_i) begin
    started_q       <= started_q || rst_i;
    configuration_q <= configuration_i;
    bank_q          <= free_table_i.free_table_bank;
    peak_q          <= peak_i;
    geometry_q      <= geometry_i;
    free_q          <= free_i;

    if (started_q && !rst_i) begin
      simulated_held_while_a_line_is_inside:
      assume (same || (empty_o && !fresh_q));
      simulated_the_bank_in_use_is_not_written:
      assume (!free_table_i.free_table_write || !fresh_q ||
              free_table_i.free_table_write_bank != free_table_i.free_table_bank);
      simulated_the_bit_is_the_configurations:
      assert (!valid_o || point_o.configuration == configuration_i);
    end
  end

endmodule

bind vrscan_chain vrscan_chain_contract u_contract (.*);

`default_nettype wire
