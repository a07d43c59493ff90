// line_trigger_contract: pulse and exposure lie where the line's registers say, never longer; a line
// has one centre, in the middle of its pulse, and the number behind that of the line before.

`default_nettype none

module line_trigger_contract #(
  parameter int unsigned CountWidth = 16
) (
  input wire logic                                   clk_i,
  input wire logic                                   rst_i,
  input wire logic                                   enable_i,
  input wire register_pkg::line_t                    line_i,
  input wire logic                                   wrap_q,
  input wire logic                                   line_start_o,
  input wire logic [vrscan_pkg::LineNumberWidth-1:0] line_o,
  input wire logic                                   exposure_o,
  input wire logic                                   laser_o,
  input wire logic                                   centre_o,
  input wire logic                                   overrun_o,
  input wire logic [   vrscan_pkg::CounterWidth-1:0] overrun_count_o
);

  localparam logic [vrscan_pkg::CounterWidth-1:0] Most =
      vrscan_pkg::CounterWidth'((64'd1 << CountWidth) - 64'd1);

  logic        started_q, off_q, laser_q, exposure_q;
  logic [31:0] next_line_q;  // its number
  logic [31:0] since_q, since;  // the line's start
  logic        centred_q, centred;  // its centre has come
  logic [31:0] pulse, exposed;  // clocks from the begin of the pulse, and of the exposure
  logic [vrscan_pkg::CounterWidth-1:0] count_q;
  register_pkg::line_t sampled_q, sampled_q2;  // of the line
  initial started_q = 1'b0;
  assign since   = line_start_o ? '0 : since_q;
  assign centred = centred_q && !line_start_o;
  assign pulse   = since - 32'(sampled_q2.pulse_delay_clks);
  assign exposed = since - 32'(sampled_q2.exposure_delay_clks);

  always_ff @(posedge clk_i) begin
    started_q  <= started_q || rst_i;
    off_q      <= rst_i || !enable_i;
    laser_q    <= laser_o;
    exposure_q <= exposure_o;
    since_q    <= since == '1 ? since : since + 32'd1;
    centred_q  <= centred || centre_o;
    count_q    <= rst_i ? '0 : overrun_o && count_q != Most ? count_q + 1'b1 : count_q;
    if (wrap_q) sampled_q <= line_i;
    sampled_q2  <= sampled_q;
    next_line_q <= rst_i ? '0 : next_line_q + 32'(line_start_o);

    if (started_q) begin
      simulated_off_at_once:
      assert (!off_q || !(line_start_o || exposure_o || laser_o || centre_o || overrun_o));
      simulated_pulse_in_its_place: assert (!laser_o || pulse < 32'(sampled_q2.pulse_clks));
      simulated_exposure_in_its_place:
      assert (!exposure_o || exposed < 32'(sampled_q2.exposure_clks));
      simulated_pulses_apart: assert (!line_start_o || !(laser_o && laser_q));
      simulated_exposures_apart: assert (!line_start_o || !(exposure_o && exposure_q));
      simulated_one_centre:
      assert (!centre_o || (!centred && pulse == 32'(sampled_q2.pulse_clks >> 1)));
      simulated_numbered: assert (!line_start_o || line_o == next_line_q);
      simulated_overrun_with_a_start: assert (!overrun_o || line_start_o);
      simulated_count_stops: assert (overrun_count_o <= Most);
    end
  end

endmodule

bind line_trigger line_trigger_contract #(.CountWidth(CountWidth)) u_contract (.*);

`default_nettype wire
