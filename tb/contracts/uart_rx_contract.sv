// uart_rx_contract: what was heard is told once, as one of a byte, a break and a glitch.

`default_nettype none

module uart_rx_contract (
  input wire logic       clk_i,
  input wire logic       rst_i,
  input wire logic       valid_o,
  input wire logic [7:0] data_o,
  input wire logic       framing_o,
  input wire logic       break_o,
  input wire logic       glitch_o,
  input wire logic       armed_q,
  input wire logic       busy_q,
  input wire logic       line
);

  logic started_q, failed_q;
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    // A stop bit was low, and the line has not been high since; or a reset was.
    failed_q  <= rst_i || ((failed_q || framing_o) && !line);

    if (started_q) begin
      one_of_them: assert (!(valid_o && break_o) && !(glitch_o && (valid_o || break_o)));
      framing_of_something: assert (!framing_o || valid_o || break_o);
      break_is_framing_of_nothing: assert (!break_o || (framing_o && data_o == '0));
      no_start_before_it_was_high: assert (!failed_q || !busy_q);

      step_armed: assert (!(failed_q || framing_o) || !armed_q);
      step_framing: assert (!framing_o || !busy_q);

      a_byte: cover (valid_o && !framing_o && data_o == 8'ha5);
    end
  end

endmodule

bind uart_rx uart_rx_contract u_contract (.*);

`default_nettype wire
