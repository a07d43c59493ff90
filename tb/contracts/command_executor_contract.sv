// command_executor_contract: what command_executor promises to the bus and of its replies.

`default_nettype none

module command_executor_contract (
  input wire logic                              clk_i,
  input wire logic                              rst_i,
  input wire logic                              take_o,
  input wire logic                              release_o,
  input wire logic                              halt_i,
  input wire logic                              valid_o,
  input wire logic                              ready_i,
  input wire logic [                       7:0] data_o,
  input wire logic                              last_o,
  input wire logic                              bus_valid_o,
  input wire logic [ link_pkg::AccessWidth-1:0] bus_access_o,
  input wire logic [link_pkg::AddressWidth-1:0] bus_address_o,
  input wire logic [                      31:0] bus_data_o,
  input wire logic                              bus_done_i,
  input wire logic                              busy_o,
  input wire logic [                       3:0] state_q,
  input wire logic [                       2:0] header_left_q
);

  localparam logic [3:0] Idle = 4'd0;
  localparam logic [3:0] Answer = 4'd8;
  localparam logic [3:0] Header = 4'd11;
  localparam logic [3:0] Send = 4'd12;
  localparam logic [3:0] Drain = 4'd13;

  logic started_q;
  initial started_q = 1'b0;

  logic waits_q;  // an access has no answer yet
  logic owed_q;   // a command has no reply yet
  logic held_q;   // a frame has not been released yet
  logic stays_q, goes_on_q;
  logic [8:0] reply_q;
  logic [link_pkg::AccessWidth+link_pkg::AddressWidth+31:0] access, access_q;
  assign access = {bus_access_o, bus_address_o, bus_data_o};

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    waits_q   <= (bus_valid_o || waits_q) && !bus_done_i;
    owed_q    <= take_o || (owed_q && !(valid_o && ready_i && last_o));
    held_q    <= take_o || (held_q && !release_o);
    stays_q   <= valid_o && !ready_i;
    goes_on_q <= valid_o && !(ready_i && last_o);
    reply_q   <= {last_o, data_o};
    access_q  <= access;
    if (rst_i) {waits_q, owed_q, held_q, stays_q, goes_on_q} <= '0;

    if (started_q) begin
      one_access_at_a_time: assert (!bus_valid_o || !waits_q);
      access_stays: assert (!waits_q || access == access_q);
      one_reply_of_a_command: assert ((!take_o || !owed_q) && (!valid_o || owed_q));
      one_release_of_a_frame: assert ((!take_o || !held_q) && (!release_o || held_q));
      reply_stays: assert (!stays_q || (valid_o && {last_o, data_o} == reply_q));
      reply_without_a_gap: assert (!goes_on_q || valid_o);
      nothing_begins_in_a_halt: assert (!take_o || !halt_i);
      busy_while_owed: assert (!owed_q || busy_o);

      step_access: assert ((state_q == Answer) == (bus_valid_o || waits_q) && state_q <= Drain);
      step_owed: assert (owed_q == (state_q != Idle));
      step_held: assert (held_q == (state_q != Idle && state_q <= Header));
      step_left: assert (state_q != Header || header_left_q != 3'd0);
      step_reply: assert ((!valid_o || state_q >= Send) && (state_q != Drain || valid_o) &&
                          (!valid_o || last_o == (state_q == Drain)));

      a_reply: cover (valid_o && ready_i && last_o);
    end
  end

endmodule

bind command_executor command_executor_contract u_contract (.*);

`default_nettype wire
