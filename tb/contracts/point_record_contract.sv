// point_record_contract: a record is 64 bytes in order, without a gap, behind its point.

`default_nettype none

module point_record_contract (
  input wire logic               clk_i,
  input wire logic               rst_i,
  input wire logic               valid_i,
  input wire vrscan_pkg::point_t point_i,
  input wire logic               record_valid_o,
  input wire logic         [5:0] record_index_o
);

  localparam logic [6:0] Bytes = 7'(link_pkg::FullBytes);

  logic               started_q;
  logic         [6:0] left_q;  // clocks that the point stands
  logic [1:0]   [6:0] due_q;  // bytes of the record that have not come
  vrscan_pkg::point_t point_q;
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    left_q    <= rst_i ? '0 : valid_i ? Bytes : left_q == '0 ? '0 : left_q - 7'd1;
    due_q     <= rst_i ? '0 : {due_q[0], left_q};
    point_q   <= point_i;

    if (started_q) begin
      points_apart: assume (rst_i || !valid_i || left_q == '0);
      a_point_stands: assume (rst_i || left_q == '0 || point_i == point_q);

      bytes_without_a_gap: assert (record_valid_o == (due_q[1] != '0));
      bytes_in_order: assert (due_q[1] == '0 || 7'(record_index_o) == Bytes - due_q[1]);
      step_left: assert (left_q <= Bytes);

      a_second_byte: cover (record_valid_o && record_index_o == 6'd1);
    end
  end

endmodule

bind point_record point_record_contract u_contract (.*);

`default_nettype wire
