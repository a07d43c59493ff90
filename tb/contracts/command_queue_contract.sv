// command_queue_contract: up to seven frames are kept, four of them bad; a frame more is not, and
// counted where it is a command; what was begun stays as it is.

`default_nettype none

module command_queue_contract #(
  parameter int unsigned CountWidth  = 16,
  parameter int unsigned LengthWidth = 11
) (
  input wire logic                                clk_i,
  input wire logic                                rst_i,
  input wire logic                                done_i,
  input wire logic [  frame_pkg::StatusWidth-1:0] status_i,
  input wire logic                                halt_i,
  input wire logic                                waits_o,
  input wire logic                                take_i,
  input wire logic                                release_i,
  input wire logic [  frame_pkg::StatusWidth-1:0] status_o,
  input wire logic [             LengthWidth-1:0] length_o,
  input wire logic [vrscan_pkg::CounterWidth-1:0] frames_good_o,
  input wire logic [vrscan_pkg::CounterWidth-1:0] commands_lost_o,
  input wire logic [                         2:0] oldest_q,
  input wire logic [                         2:0] head_q,
  input wire logic [                         2:0] tail_q,
  input wire logic                                executed_q
);

  localparam logic [vrscan_pkg::CounterWidth-1:0] Most =
      vrscan_pkg::CounterWidth'((64'd1 << CountWidth) - 64'd1);

  logic       started_q, begun_q, good, keeps;
  logic [1:0] age_q;  // clocks since a frame was begun; stops
  // Frames; what is dropped keeps its place while one is executed.
  logic [2:0] waiting_q, waiting, kept_q, kept;
  logic [vrscan_pkg::CounterWidth-1:0] good_q, lost_q;
  logic [frame_pkg::StatusWidth+LengthWidth-1:0] entry_q;
  initial started_q = 1'b0;
  assign good    = status_i == frame_pkg::StatusOk;
  assign keeps   = done_i && kept_q < (good ? 3'd7 : 3'd4);
  assign waiting = halt_i ? '0 : waiting_q - 3'(take_i);
  assign kept    = begun_q && !release_i ? kept_q : halt_i || release_i ? waiting : kept_q;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    begun_q   <= take_i || (begun_q && !release_i);
    age_q     <= take_i ? 2'd1 : age_q == 2'd3 ? age_q : age_q + 2'd1;
    waiting_q <= waiting + 3'(keeps);
    kept_q    <= kept + 3'(keeps);
    good_q    <= done_i && good && good_q != Most ? good_q + 1'b1 : good_q;
    lost_q    <= done_i && good && !keeps && lost_q != Most ? lost_q + 1'b1 : lost_q;
    entry_q   <= {status_o, length_o};
    if (rst_i) begin
      begun_q <= 1'b0;
      {waiting_q, kept_q} <= '0;
      {good_q, lost_q} <= '0;
    end

    if (started_q) begin
      takes_what_waits: assume (!take_i || (waits_o && !begun_q && !halt_i));
      releases_what_was_begun: assume (!release_i || begun_q);

      waits_while_one_does: assert (waits_o == (waiting_q != '0));
      lost_is_counted: assert (commands_lost_o == lost_q && frames_good_o == good_q);
      begun_stays: assert (!begun_q || age_q != 2'd3 || {status_o, length_o} == entry_q);

      step_begun: assert (executed_q == begun_q);
      step_places: assert (tail_q - oldest_q == kept_q && tail_q - head_q == waiting_q);
      step_kept: assert (kept_q >= waiting_q + 3'(begun_q) && waiting_q + 4'(begun_q) < 4'd8);

      a_lost_command: cover (commands_lost_o == 16'd1 && begun_q);
    end
  end

endmodule

bind command_queue command_queue_contract #(
  .CountWidth(CountWidth), .LengthWidth(LengthWidth)
) u_contract (.*);

`default_nettype wire
