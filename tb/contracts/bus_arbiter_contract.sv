// bus_arbiter_contract: what bus_arbiter promises, and what its sources and the bus do.

`default_nettype none

module bus_arbiter_contract #(
  parameter int unsigned LingerClks = 24
) (
  input wire logic                                clk_i,
  input wire logic                                rst_i,
  input wire logic [                         1:0] valid_i,
  input wire logic [ 2*link_pkg::AccessWidth-1:0] access_i,
  input wire logic [2*link_pkg::AddressWidth-1:0] address_i,
  input wire logic [                        63:0] data_i,
  input wire logic [                         1:0] done_o,
  input wire logic [   link_pkg::StatusWidth-1:0] status_o,
  input wire logic [                        31:0] data_o,
  input wire logic                                bus_valid_o,
  input wire logic [   link_pkg::AccessWidth-1:0] bus_access_o,
  input wire logic [  link_pkg::AddressWidth-1:0] bus_address_o,
  input wire logic [                        31:0] bus_data_o,
  input wire logic                                bus_done_i,
  input wire logic [   link_pkg::StatusWidth-1:0] bus_status_i,
  input wire logic [                        31:0] bus_data_i,
  input wire logic [                         1:0] waits_q,
  input wire logic                                busy_q,
  input wire logic                                second_q,
  input wire logic [    $clog2(LingerClks+1)-1:0] linger_q
);

  localparam int unsigned AW = link_pkg::AccessWidth;
  localparam int unsigned DW = link_pkg::AddressWidth;

  logic        started_q, under_way_q, second, answered_q, reset_q, may_q;
  logic [ 1:0] open_q, open, offered_q;  // accesses without an answer
  logic [ 7:0] quiet_q;  // clocks since an answer to source 0, at most LingerClks
  logic [AW+DW+31:0] first_q, other_q;
  logic [link_pkg::StatusWidth+31:0] answer_q;
  initial started_q = 1'b0;
  assign open   = (open_q | valid_i) & ~done_o;
  assign second = second_q;

  always_ff @(posedge clk_i) begin
    started_q   <= started_q || rst_i;
    reset_q     <= rst_i;
    may_q       <= quiet_q == 8'(LingerClks);
    open_q      <= rst_i ? 2'b00 : open;
    offered_q   <= rst_i || under_way_q || bus_valid_o ? 2'b00 : waits_q | valid_i;
    under_way_q <= !rst_i && (bus_valid_o || under_way_q) && !bus_done_i;
    answered_q  <= !rst_i && under_way_q && bus_done_i;
    answer_q    <= {bus_status_i, bus_data_i};
    first_q     <= {access_i[0+:AW], address_i[0+:DW], data_i[31:0]};
    other_q     <= {access_i[AW+:AW], address_i[DW+:DW], data_i[63:32]};
    if (rst_i) quiet_q <= 8'(LingerClks);
    else if (under_way_q && bus_done_i && !second) quiet_q <= 8'd0;
    else if (quiet_q != 8'(LingerClks)) quiet_q <= quiet_q + 8'd1;

    if (started_q) begin
      one_access_of_a_source: assume (rst_i || (valid_i & open_q) == 2'b00);
      answers_of_accesses: assume (!bus_done_i || (under_way_q && !bus_valid_o));

      one_access_at_a_time: assert (!bus_valid_o || !under_way_q);
      as_it_was_given: assert (!bus_valid_o || {bus_access_o, bus_address_o, bus_data_o}
                               == (second ? other_q : first_q));
      source_0_first: assert (!bus_valid_o || !second || !offered_q[0]);
      commands_whole: assert (!bus_valid_o || !second || quiet_q == 8'(LingerClks));
      answer_to_its_source: assert (done_o == (answered_q ? {second, !second} : 2'b00));
      answer_as_it_came: assert (!answered_q || {status_o, data_o} == answer_q);
      answers_were_asked_for: assert ((done_o & ~open_q) == 2'b00);
      no_idling: assert (reset_q || bus_valid_o
                         || !(offered_q[0] || (offered_q[1] && may_q)));

      step_busy: assert (busy_q == (under_way_q || bus_valid_o));
      step_open: assert (open_q == (waits_q | done_o
                                    | (busy_q ? {second_q, !second_q} : 2'b00)));
      step_apart: assert (!busy_q || !(second_q ? waits_q[1] : waits_q[0]));
      step_linger: assert (8'(linger_q) + quiet_q == 8'(LingerClks));
      step_done: assert (!answered_q || !busy_q);

      both_served: cover (done_o[1] && quiet_q == 8'(LingerClks) && waits_q[0]);
    end
  end

endmodule

bind bus_arbiter bus_arbiter_contract #(.LingerClks(LingerClks)) u_contract (.*);

`default_nettype wire
