// line_tag_contract: a tag stays until the next readout begins, which has none for 5 clocks; counters
// stop at their largest value.

`default_nettype none

module line_tag_contract #(
  parameter int unsigned CountWidth = 16
) (
  input wire logic                  clk_i,
  input wire logic                  rst_i,
  input wire logic                  line_start_i,
  input wire vrscan_pkg::line_t     tag_o,
  input wire logic [CountWidth-1:0] untagged_count_o,
  input wire logic [CountWidth-1:0] unread_count_o,
  input wire logic [CountWidth-1:0] mistimed_count_o
);

  logic                    started_q, begins_q, reset_q, untagged;
  logic              [2:0] age_q;  // clocks since the readout began, up to the first of its tag
  logic [3*CountWidth-1:0] counts_q;
  vrscan_pkg::line_t       tag_q, bare;
  initial started_q = 1'b0;
  always_comb begin
    bare              = '0;
    bare.mirror_flags = {1'b1, {(vrscan_pkg::MirrorFlagWidth - 1) {1'b0}}};  // UNSETTLED
  end
  assign untagged = tag_q == bare;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    reset_q   <= rst_i;
    begins_q  <= rst_i || line_start_i;
    age_q     <= rst_i || line_start_i ? 3'd1 : age_q == 3'd5 ? age_q : age_q + 3'd1;
    tag_q     <= tag_o;
    counts_q  <= {untagged_count_o, unread_count_o, mistimed_count_o};

    if (started_q) begin
      simulated_tag_stays: assert (begins_q || untagged || tag_o == tag_q);
      simulated_none_at_first: assert (age_q == 3'd5 || tag_o == bare);
      simulated_counters_stop:
      assert (reset_q || (untagged_count_o >= counts_q[2*CountWidth+:CountWidth] &&
                          unread_count_o >= counts_q[CountWidth+:CountWidth] &&
                          mistimed_count_o >= counts_q[0+:CountWidth]));
    end
  end

endmodule

bind line_tag line_tag_contract #(.CountWidth(CountWidth)) u_contract (.*);

`default_nettype wire
