// line_trigger: the lines' time base: line start, exposure, laser pulse and its centre.
//
// A line lasts a turn of a 48-bit accumulator, whose step is the mirror's word times the ratio of
// line rate and mirror frequency; both accumulators have the same clock, so any ratio holds for
// ever.  A ratio of 150.1 shifts the lines of ten periods into tenfold interlace.
//
//   word_i      turns of the mirror a clock, 48 fraction bits; sampled at a line's start, used
//               from the next line's start
//   ratio       lines a mirror period, 32 fraction bits.  The product is rounded to nearest, half
//               up, and at most 2**43: 32 clocks a line.  Where it is 0 there are no lines, until
//               it is not: then a line starts at once
//   *_delay_clks_i  from line_start_o, exactly; *_clks_i 0 for none.  Sampled at a line's start.
//   line_o      number of the line, 0 the first one after a reset; a stop does not set it back
//   centre_o    in the clock that holds the middle of the pulse, delay + floor(pulse_clks / 2),
//               with centre_half_o where pulse_clks is odd and the middle half a clock later.  It
//               comes without a pulse too: a dark line has an angle
//   overrun_o   with line_start_o: pulse or exposure of the line before had not been low for a
//               clock, or its centre had not come.  They are cut off, a centre is lost; what would
//               join the one that was cut off (a delay of 0) is left out in this line.  So the
//               laser is never high for more than pulse_clks clocks on end.
//   enable_i    low: laser and exposure are low from the next clock, the accumulator starts anew
//   Latency  enable_i to the first line_start_o: the latency of multiply + 5 clocks; the
//            accumulator's wrap to line_start_o: 2 clocks
//   Model    vrscan.clocked.line_trigger, bit-exact

`default_nettype none

module line_trigger #(
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                                   clk_i,
  input  wire logic                                   rst_i,

  input  wire logic                                   enable_i,
  input  wire logic [      vrscan_pkg::WordWidth-1:0] word_i,

  output      logic                                   line_start_o,
  output      logic [vrscan_pkg::LineNumberWidth-1:0] line_o,
  output      logic                                   exposure_o,
  output      logic                                   laser_o,
  output      logic                                   centre_o,
  output      logic                                   centre_half_o,
  output      logic                                   overrun_o,
  output      logic [   vrscan_pkg::CounterWidth-1:0] overrun_count_o,  // stops at its largest

  input  wire register_pkg::line_t                    line_i
);

  localparam int unsigned TurnWidth = vrscan_pkg::TurnWidth;
  localparam int unsigned NumberWidth = vrscan_pkg::LineNumberWidth;
  localparam int unsigned AWidth = vrscan_pkg::WordWidth + 1;
  localparam int unsigned BWidth = vrscan_pkg::RatioWidth + 1;
  localparam int unsigned RoundedWidth =
      vrscan_pkg::WordWidth + vrscan_pkg::RatioWidth - vrscan_pkg::RatioFraction;
  localparam int unsigned StepTop = TurnWidth - 5;  // the bit of 32 clocks a line, the largest step
  // An end is below the largest value, where the time of a line stops.
  localparam int unsigned SpanWidth = vrscan_pkg::LineClksWidth + 1;

  // The step of the next line.
  logic                            sample, pending_q;
  logic                            product_valid, rounded_valid_q, next_valid_q;
  logic signed [AWidth+BWidth-1:0] product;
  logic        [ RoundedWidth-1:0] rounded_q;
  logic        [        StepTop:0] next_q, step_q, step;
  logic                            next_zero_q;

  // The accumulator.
  logic                            run_q, wrap_q;
  logic        [    TurnWidth-1:0] turn_q;
  assign sample = enable_i && (wrap_q || (!run_q && !pending_q));
  assign step   = wrap_q ? next_q : step_q;

  multiply #(
    .AWidth(AWidth),
    .BWidth(BWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (sample),
    .a_i      (signed'({1'b0, word_i})),
    .b_i      (signed'({1'b0, line_i.ratio})),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // Both factors are positive, and their product's top two bits zero.
  logic unused_product;
  assign unused_product = &{1'b0, product[AWidth+BWidth-1-:2],
                            product[vrscan_pkg::RatioFraction-2:0]};

  // The line: the clocks since its start, and what was set when it began.
  logic                   first_q, live_q, late_q;
  logic [SpanWidth-1:0]   time_q, ahead_q;  // ahead_q is what time_q will be
  logic [SpanWidth-1:0]   exposure_begin_q, exposure_end_q, pulse_begin_q, pulse_end_q, centre_q;
  logic                   exposed_q, half_q;
  logic                   skip_laser_q, skip_exposure_q;
  logic [NumberWidth-1:0] number_q;

  // Whether begin and end have been reached, at time_q.
  logic pulse_begun_q, pulse_left_q, exposure_begun_q, exposure_left_q;
  logic pulse, exposure, skip_laser, skip_exposure;
  assign pulse         = pulse_left_q && pulse_begun_q;
  assign exposure      = exposure_left_q && exposure_begun_q;
  assign skip_laser    = first_q ? laser_o && pulse : skip_laser_q;
  assign skip_exposure = first_q ? exposure_o && exposure : skip_exposure_q;

  always_ff @(posedge clk_i) begin
    // To nearest, half up.
    rounded_q       <= product[vrscan_pkg::RatioFraction+:RoundedWidth]
                       + RoundedWidth'(product[vrscan_pkg::RatioFraction-1]);
    // A product of the work before a stop must not count for the new one.
    rounded_valid_q <= product_valid && !sample;
    next_valid_q    <= rounded_valid_q;
    if (rounded_valid_q) begin
      next_q      <= rounded_q[StepTop:0];
      next_zero_q <= rounded_q == '0;
      if (rounded_q[RoundedWidth-1:StepTop] != '0) next_q <= {1'b1, {StepTop{1'b0}}};
    end
    pending_q <= sample || (pending_q && !next_valid_q);

    {wrap_q, turn_q} <= {1'b0, turn_q} + (TurnWidth + 1)'(step);
    step_q           <= step;
    if (wrap_q && next_zero_q) run_q <= 1'b0;
    if (!run_q || (wrap_q && next_zero_q)) wrap_q <= 1'b0;
    if (!run_q && next_valid_q && !next_zero_q) begin
      run_q  <= 1'b1;
      wrap_q <= 1'b1;
      turn_q <= '0;
    end

    first_q <= wrap_q;
    late_q  <= wrap_q && (pulse_left_q || (exposure_left_q && exposed_q));
    time_q  <= ahead_q;
    if (ahead_q != '1) ahead_q <= ahead_q + SpanWidth'(1);
    if (ahead_q == pulse_begin_q) pulse_begun_q <= 1'b1;
    if (ahead_q == pulse_end_q) pulse_left_q <= 1'b0;
    if (ahead_q == exposure_begin_q) exposure_begun_q <= 1'b1;
    if (ahead_q == exposure_end_q) exposure_left_q <= 1'b0;
    if (wrap_q) begin
      live_q           <= 1'b1;
      time_q           <= '0;
      ahead_q          <= SpanWidth'(1);
      pulse_begun_q    <= line_i.pulse_delay_clks == '0;
      pulse_left_q     <= line_i.pulse_delay_clks != '0 || line_i.pulse_clks != '0;
      exposure_begun_q <= line_i.exposure_delay_clks == '0;
      exposure_left_q  <= line_i.exposure_delay_clks != '0 || line_i.exposure_clks != '0;
      exposure_begin_q <= SpanWidth'(line_i.exposure_delay_clks);
      exposure_end_q   <= SpanWidth'(line_i.exposure_delay_clks) + SpanWidth'(line_i.exposure_clks);
      exposed_q        <= line_i.exposure_clks != '0;
      pulse_begin_q    <= SpanWidth'(line_i.pulse_delay_clks);
      pulse_end_q      <= SpanWidth'(line_i.pulse_delay_clks) + SpanWidth'(line_i.pulse_clks);
      centre_q         <= SpanWidth'(line_i.pulse_delay_clks)
                          + (SpanWidth'(line_i.pulse_clks) >> 1);
      half_q           <= line_i.pulse_clks[0];
    end
    skip_laser_q    <= skip_laser;
    skip_exposure_q <= skip_exposure;

    line_start_o  <= first_q;
    exposure_o    <= exposure && !skip_exposure;
    laser_o       <= pulse && !skip_laser;
    centre_o      <= live_q && time_q == centre_q;
    centre_half_o <= half_q;
    overrun_o     <= late_q;
    if (late_q && enable_i) begin
      overrun_count_o <= vrscan_pkg::counted(overrun_count_o, CountWidth);
    end
    if (first_q && enable_i) begin
      line_o   <= number_q;
      number_q <= number_q + NumberWidth'(1);
    end

    if (rst_i || !enable_i) begin
      pending_q       <= 1'b0;
      rounded_valid_q <= 1'b0;
      next_valid_q    <= 1'b0;
      run_q           <= 1'b0;
      wrap_q          <= 1'b0;
      first_q         <= 1'b0;
      live_q          <= 1'b0;
      late_q          <= 1'b0;
      pulse_left_q    <= 1'b0;
      exposure_left_q <= 1'b0;
      line_start_o    <= 1'b0;
      exposure_o      <= 1'b0;
      laser_o         <= 1'b0;
      centre_o        <= 1'b0;
      overrun_o       <= 1'b0;
    end
    if (rst_i) begin
      line_o          <= '0;
      number_q        <= '0;
      centre_half_o   <= 1'b0;
      half_q          <= 1'b0;
      overrun_count_o <= '0;
    end
  end

endmodule

`default_nettype wire
