// commit_control_contract: one commit at a time, each entry copied once, and one change of the
// configuration, with no line in the chain.

`default_nettype none

module commit_control_contract #(
  parameter int unsigned Entries    = 1024,
  parameter int unsigned IndexWidth = 10
) (
  input wire logic                         clk_i,
  input wire logic                         rst_i,
  input wire register_pkg::commit_t        commit_i,
  input wire register_pkg::commit_status_t commit_status_o,
  input wire logic                         copy_o,
  input wire logic [       IndexWidth-1:0] index_o,
  input wire logic                         hold_o,
  input wire logic                         empty_i,
  input wire logic                         take_o,
  input wire logic                         superseding_o,
  input wire logic                         renewing_i,
  input wire logic [                  2:0] state_q,
  input wire logic [                  3:0] age_q
);

  localparam logic [3:0] EmptyClks = 4'd8;
  localparam logic [3:0] SettleClks = 4'd8;
  localparam logic [2:0] Copy = 3'd1;
  localparam logic [2:0] Drain = 3'd2;
  localparam logic [2:0] Settle = 3'd4;
  localparam logic [2:0] Renew = 3'd5;

  logic started_q;
  initial started_q = 1'b0;

  logic waiting;
  assign waiting = commit_status_o.commit_waiting;

  logic waiting_q, strobe_q, hold_q, empty_q, renewing_q;  // a clock ago
  logic taken_q;  // there was a take_o in this commit
  logic configuration_q;  // what all take_o until now make of it
  logic [IndexWidth:0] copied_q;  // entries, in this commit
  logic [3:0] held_q, since_q;  // clocks since hold_o's rise, and since take_o, up to 15

  always_ff @(posedge clk_i) begin
    started_q       <= started_q || rst_i;
    waiting_q       <= waiting;
    strobe_q        <= commit_i.commit_strobe;
    hold_q          <= hold_o;
    empty_q         <= empty_i;
    renewing_q      <= renewing_i;
    taken_q         <= waiting && (taken_q || take_o);
    configuration_q <= configuration_q ^ take_o;
    copied_q        <= waiting ? copied_q + (IndexWidth + 1)'(copy_o) : '0;
    held_q          <= !hold_o ? 4'd0 : held_q + 4'(held_q != '1);
    since_q         <= take_o ? 4'd1 : since_q + 4'(since_q != '1);
    if (rst_i) begin
      {waiting_q, configuration_q}  <= '1;
      {strobe_q, hold_q, taken_q}   <= '0;
      {copied_q, held_q, since_q}   <= '0;
    end

    if (started_q) begin
      begins_when_it_is_asked: assert (waiting_q || waiting == strobe_q);
      one_change_of_a_commit: assert ((!take_o || (waiting && !taken_q)) &&
                                      (waiting || !waiting_q || taken_q));
      the_bit_tells_it: assert (commit_status_o.configuration == configuration_q);
      each_entry_once: assert ((!copy_o || {1'b0, index_o} == copied_q) &&
                               (!hold_o || 32'(copied_q) == Entries));
      held_and_empty: assert (!take_o || (hold_o && empty_q && held_q > EmptyClks));
      held_until_all_is_there: assert (hold_o || !hold_q || (taken_q && since_q > SettleClks));
      superseding_to_the_end: assert (superseding_o == (waiting && (take_o || taken_q)));
      ends_renewed: assert (waiting || !waiting_q || !renewing_q);
      no_idling: assert (waiting == (copy_o || hold_o || superseding_o));
      no_deadlock:
      assert ((!hold_o || held_q <= EmptyClks || !empty_q || take_o || taken_q) &&
              (!waiting || !taken_q || since_q <= SettleClks + 4'd2 || renewing_q));

      step_copy: assert (copy_o == (state_q == Copy) && (copy_o || index_o == '0));
      step_hold: assert (hold_o == (state_q > Copy && state_q < Renew) && state_q <= Renew);
      step_take: assert (take_o == (hold_o && state_q != Drain && state_q != Settle));
      step_taken: assert ((taken_q && waiting) == (state_q >= Settle));
      step_age: assert ((state_q != Drain || age_q == (held_q > EmptyClks ? EmptyClks : held_q)) &&
                        (state_q != Settle || (age_q == since_q - 4'd1 && age_q <= SettleClks)));

      a_commit: cover (waiting_q && !waiting && !configuration_q);
      a_wait: cover (hold_o && held_q == 4'd12 && !taken_q);
    end
  end

endmodule

bind commit_control commit_control_contract #(
  .Entries(Entries), .IndexWidth(IndexWidth)
) u_contract (.*);

`default_nettype wire
