// packet_arbiter_contract: what packet_arbiter promises, and what its sources do.

`default_nettype none

module packet_arbiter_contract #(
  parameter int unsigned Sources = 3
) (
  input wire logic                 clk_i,
  input wire logic                 rst_i,
  input wire logic [  Sources-1:0] valid_i,
  input wire logic [  Sources-1:0] ready_o,
  input wire logic [8*Sources-1:0] data_i,
  input wire logic [  Sources-1:0] last_i,
  input wire logic                 hold_i,
  input wire logic                 valid_o,
  input wire logic                 ready_i,
  input wire logic [          7:0] data_o,
  input wire logic                 last_o,
  input wire logic                 busy_o,
  input wire logic [  Sources-1:0] grant_q,
  input wire logic [  Sources-1:0] after_q
);

  localparam logic [Sources-1:0] Streams = ~(Sources'(1));

  logic               started_q;
  logic [Sources-1:0] taken, waits_q, open_q, offered_q;
  logic [Sources-1:0] passed_q[Sources];  // streams that began while this one waited
  logic               stays_q, came_q, last_q, idle_q;
  logic [        7:0] data, data_q;
  initial started_q = 1'b0;
  assign taken = valid_i & ready_o;

  // A packet has begun that another one was not asked for.
  logic [Sources-1:0] begun;
  logic               repeated, out_of_turn;
  assign begun = idle_q ? grant_q : '0;
  always_comb begin
    data        = 8'd0;
    repeated    = 1'b0;
    out_of_turn = 1'b0;
    for (int unsigned k = 0; k < Sources; k++) begin
      if (taken[k]) data = data_i[8*k+:8];
      if (k != 0 && offered_q[k] && (begun & passed_q[k] & Streams) != '0) repeated = 1'b1;
      for (int unsigned j = 0; j < Sources; j++) begin
        if (passed_q[k][j] && (after_q[k] ? j <= k && after_q[j] : j <= k || after_q[j])) begin
          out_of_turn = 1'b1;
        end
      end
    end
  end

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    waits_q   <= valid_i & ~(taken & last_i);
    open_q    <= taken == '0 ? open_q : taken & ~last_i;
    offered_q <= hold_i ? valid_i & Sources'(1) : valid_i;
    idle_q    <= !busy_o;
    stays_q   <= valid_o && !ready_i;
    came_q    <= taken != '0;
    if (taken != '0) {data_q, last_q} <= {data, (taken & last_i) != '0};
    for (int unsigned k = 0; k < Sources; k++) begin
      passed_q[k] <= k == 0 || !valid_i[k] || grant_q[k] ? '0
                     : offered_q[k] ? passed_q[k] | (begun & Streams) : passed_q[k];
    end
    if (rst_i) begin
      waits_q   <= '0;
      open_q    <= '0;
      offered_q <= '0;
      idle_q    <= 1'b0;
      stays_q   <= 1'b0;
      came_q    <= 1'b0;
      for (int unsigned k = 0; k < Sources; k++) passed_q[k] <= '0;
    end

    if (started_q) begin
      offers_stand: assume (rst_i || (waits_q & ~valid_i & ~open_q) == '0);

      one_source: assert ((ready_o & (ready_o - Sources'(1))) == '0);
      taken_only_with_room: assert (ready_o == '0 || !valid_o || ready_i);
      nothing_lost: assert (!(came_q || stays_q) ||
                            (valid_o && data_o == data_q && last_o == last_q));
      nothing_doubled: assert (came_q || stays_q || !valid_o);
      packets_unmixed: assert (open_q == '0 || (taken & ~open_q) == '0);
      source_0_first: assert (!offered_q[0] || (begun & Streams) == '0);
      streams_take_turns: assert (!repeated);
      held_streams_do_not_begin: assert ((begun & ~offered_q) == '0);
      no_deadlock: assert (!busy_o || (valid_o && !ready_i) || taken != '0 ||
                           (open_q & ~valid_i) != '0 || rst_i);
      no_idling: assert (!idle_q || offered_q == '0 || busy_o);

      step_one: assert (busy_o ? grant_q != '0 && (grant_q & (grant_q - Sources'(1))) == '0
                               : grant_q == '0);
      step_waits: assert ((grant_q & ~waits_q & ~open_q) == '0);
      step_open: assert (open_q == '0 || open_q == grant_q);
      step_after: assert (!after_q[0] && (~after_q & (~after_q + Sources'(1)) & Streams) == '0);
      step_turn: assert (!out_of_turn && passed_q[0] == '0);

      a_turn: cover (begun == Sources'(2) && passed_q[1] != '0);
    end
  end

endmodule

bind packet_arbiter packet_arbiter_contract #(.Sources(Sources)) u_contract (.*);

`default_nettype wire
