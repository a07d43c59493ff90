// line_statistics_contract: each line has its statistics once, with what came with it, in a time that
// it does not change; the maximum is on the line.

`default_nettype none

module line_statistics_contract #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned IndexWidth = 11,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned UserWidth  = 8
) (
  input wire logic                              clk_i,
  input wire logic                              rst_i,
  input wire logic                              good_i,
  input wire logic [             UserWidth-1:0] user_i,
  input wire logic                              valid_o,
  input wire logic [            PixelWidth-1:0] maximum_o,
  input wire logic [            IndexWidth-1:0] max_index_o,
  input wire logic [vrscan_pkg::CountWidth-1:0] row_mean_o,
  input wire logic [             UserWidth-1:0] user_o
);

  logic                 started_q, works_q;
  logic [         15:0] age_q, latency_q;  // clocks since good_i; of the first line
  logic [UserWidth-1:0] user_q;
  initial {started_q, latency_q} = '0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    works_q   <= !rst_i && (good_i || (works_q && !valid_o));
    age_q     <= good_i ? 16'd1 : age_q + 16'd1;
    if (good_i) user_q <= user_i;
    if (started_q && valid_o && latency_q == '0) latency_q <= age_q;

    if (started_q) begin
      simulated_one_at_a_time: assume (rst_i || !good_i || !works_q || valid_o);
      simulated_one_for_each: assert (!valid_o || works_q);
      simulated_whatever_the_line: assert (latency_q == '0 || !works_q ||
                                           valid_o == (age_q == latency_q));
      if (valid_o) begin
        simulated_user_of_the_line: assert (user_o == user_q);
        simulated_maximum_on_the_line: assert (32'(max_index_o) < LineLength);
        simulated_mean_up_to_maximum:
        assert (row_mean_o <= {maximum_o, {(vrscan_pkg::CountWidth - PixelWidth) {1'b0}}});
      end
    end
  end

endmodule

bind line_statistics line_statistics_contract #(
  .LineLength(LineLength), .IndexWidth(IndexWidth), .PixelWidth(PixelWidth), .UserWidth(UserWidth)
) u_contract (.*);

`default_nettype wire
