// commit_control: lets all that waits for a commit take effect together, between two lines.
//
// While a line is worked on, what it is worked on with must not change.  So first the waiting
// tables are copied into the banks that are not in use, which disturbs nothing.  Then no line may
// enter the chain any more; those inside get out in a bounded time, however fast lines come.  Then
// all changes in one clock, and the mirror works out its harmonics.  A line whose pulse came before
// that has its angle of the old configuration, so it is not measured either.
//
//   commit_i      commit_strobe, ignored while commit_waiting: the bus answers BUSY then
//   copy_o        entry index_o of each table is copied in this clock
//   hold_o        no line may enter the chain
//   empty_i       no line is in the chain; looked at from EmptyClks clocks behind hold_o's rise on
//   take_o        for one clock: from here on the other configuration holds
//   superseding_o from take_o on, until the angles are of the new configuration as well
//   renewing_i    they are not yet; looked at from SettleClks clocks behind take_o on
//   commit_status_o  configuration changes behind take_o
//   After a reset there is a commit, so that the banks in use have what the bus reads.
//   Model         vrscan.clocked.commit_control, bit-exact

`default_nettype none

module commit_control #(
  parameter int unsigned Entries = 1024,  // of the largest table
  localparam int unsigned IndexWidth = $clog2(Entries)
) (
  input  wire logic                         clk_i,
  input  wire logic                         rst_i,

  input  wire register_pkg::commit_t        commit_i,
  output      register_pkg::commit_status_t commit_status_o,

  // To the registers.
  output      logic                         copy_o,
  output      logic [       IndexWidth-1:0] index_o,

  // To chain and mirror.
  output      logic                         hold_o,
  input  wire logic                         empty_i,
  output      logic                         take_o,
  output      logic                         superseding_o,
  input  wire logic                         renewing_i
);

  localparam int unsigned EmptyClks = 8;
  localparam int unsigned SettleClks = 8;

  typedef enum logic [2:0] {IDLE, COPY, DRAIN, TAKE, SETTLE, RENEW} state_e;
  state_e state_q;
  logic [3:0] age_q;

  logic unused;
  assign unused = &{1'b0, commit_i.commit};

  always_ff @(posedge clk_i) begin
    take_o <= 1'b0;
    age_q  <= age_q + 4'd1;
    unique case (state_q)
      IDLE: if (commit_i.commit_strobe) begin
        commit_status_o.commit_waiting <= 1'b1;
        copy_o                         <= 1'b1;
        state_q                        <= COPY;
      end
      COPY: begin
        index_o <= index_o + IndexWidth'(1);
        age_q   <= '0;
        if (index_o == IndexWidth'(Entries - 1)) begin
          index_o <= '0;
          copy_o  <= 1'b0;
          hold_o  <= 1'b1;
          state_q <= DRAIN;
        end
      end
      DRAIN: begin
        if (age_q == 4'(EmptyClks)) begin
          age_q <= age_q;
          if (empty_i) begin
            take_o        <= 1'b1;
            superseding_o <= 1'b1;
            state_q       <= TAKE;
          end
        end
      end
      TAKE: begin
        commit_status_o.configuration <= !commit_status_o.configuration;
        age_q                         <= '0;
        state_q                       <= SETTLE;
      end
      SETTLE: if (age_q == 4'(SettleClks)) begin
        hold_o  <= 1'b0;
        state_q <= RENEW;
      end
      default: if (!renewing_i) begin  // RENEW
        superseding_o                  <= 1'b0;
        commit_status_o.commit_waiting <= 1'b0;
        state_q                        <= IDLE;
      end
    endcase
    if (rst_i) begin
      state_q         <= COPY;
      commit_status_o <= '1;
      copy_o          <= 1'b1;
      index_o         <= '0;
      hold_o          <= 1'b0;
      take_o          <= 1'b0;
      superseding_o   <= 1'b0;
    end
  end

endmodule

`default_nettype wire
