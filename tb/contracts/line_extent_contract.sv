// line_extent_contract: the pixels of a line have their numbers, and a line is good or its fault is
// told; counted a second time.

`default_nettype none

module line_extent_contract #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned IndexWidth = 11
) (
  input wire logic                          clk_i,
  input wire logic                          rst_i,
  input wire logic                          line_start_i,
  input wire logic                          line_end_i,
  input wire logic                          pixel_valid_i,
  input wire logic                          take_o,
  input wire logic [        IndexWidth-1:0] index_o,
  input wire logic                          ends_o,
  input wire logic                          short_o,
  input wire logic                          over_o,
  input wire logic                          unfinished_o,
  input wire logic                          in_line_q,
  input wire logic                          over_q,
  input wire logic                          full_q,
  input wire logic                          one_left_q,
  input wire logic [$clog2(LineLength+1)-1:0] fill_q
);

  logic        started_q, open_q, open;
  logic [31:0] prior_q, prior, number;  // pixels of the line; stops at one too many
  initial started_q = 1'b0;
  assign open   = open_q || line_start_i;
  assign prior  = line_start_i ? '0 : prior_q;
  assign number = !open || !pixel_valid_i || prior > LineLength ? prior : prior + 32'd1;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    open_q    <= open && !line_end_i && !rst_i;
    prior_q   <= number;

    if (started_q) begin
      takes_the_first: assert (take_o == (open && pixel_valid_i && prior < LineLength));
      numbered: assert (!take_o || 32'(index_o) == prior);
      ends_once: assert (ends_o == (open && line_end_i));
      short_is_told: assert (!ends_o || short_o == (number < LineLength));
      over_is_told: assert (!ends_o || over_o == (number > LineLength));
      unfinished_is_told: assert (unfinished_o == (open_q && line_start_i));

      step_open: assert (in_line_q == open_q && (!open_q || prior_q <= LineLength + 32'd1));
      step_over: assert (!open_q || over_q == (prior_q > LineLength));
      step_fill: assert (!open_q || 32'(fill_q) == (over_q ? LineLength : prior_q));
      step_full: assert (!open_q || (full_q == (prior_q >= LineLength) &&
                                     one_left_q == (prior_q == LineLength - 32'd1)));

      a_good_line: cover (ends_o && !short_o && !over_o);
    end
  end

endmodule

bind line_extent line_extent_contract #(
  .LineLength(LineLength), .IndexWidth(IndexWidth)
) u_contract (.*);

`default_nettype wire
