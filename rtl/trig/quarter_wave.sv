// quarter_wave: sine and cosine of a binary phase from one quarter of a wave.
//
// The phase is counted in turns, so wrap-around needs no logic.  Entry k of the table is the sine
// at k + 1/2 steps, so the four quadrants are exact mirrors: odd ones invert the index and turn
// the small angle d around, and the quadrant gives the signs.  Around the entries s0, c0
//
//   sine = s0 + d c0,  cosine = c0 - d s0,  |d| <= pi / 4096,
//
// whose angle is exact to d**3 / 3 and whose length grows by d**2 / 2 <= 2.9e-7.
//
//   phase_i   unsigned, turns / 2**PhaseWidth
//   sine_o    signed; vrscan.fixed.quarter_wave.amplitude(AmplWidth), close to
//             (2**15 - 1) * 2**(AmplWidth - 16), stands for 1.0.  To nearest, half up; the error
//             is at most error_bound(AmplWidth) steps: 1.84 for 24 bits, 86 for 30
//   Latency   vrscan_pkg::QuarterWaveLatency clocks, one phase a clock, never stalls
//   Model     vrscan.fixed.quarter_wave, bit-exact

`default_nettype none

module quarter_wave #(
  parameter int unsigned PhaseWidth = 28,  // bits per turn, 14 to 30
  parameter int unsigned AmplWidth  = 24   // output bits including the sign, 16 to 30
) (
  input  wire logic                        clk_i,
  input  wire logic                        rst_i,    // clears valid only

  input  wire logic                        valid_i,
  input  wire logic       [PhaseWidth-1:0] phase_i,

  output      logic                        valid_o,
  output      logic signed [AmplWidth-1:0] sine_o,
  output      logic signed [AmplWidth-1:0] cosine_o
);

  if (PhaseWidth < 14 || PhaseWidth > 30) begin : gen_bad_phase_width
    $error("quarter_wave: PhaseWidth must be 14 to 30");
  end
  if (AmplWidth < 16 || AmplWidth > 30) begin : gen_bad_ampl_width
    $error("quarter_wave: AmplWidth must be 16 to 30");
  end

  localparam int unsigned Latency = vrscan_pkg::QuarterWaveLatency;
  localparam int unsigned TableBits = 10;
  localparam int unsigned EntryWidth = 32;
  localparam int unsigned ResidualWidth = PhaseWidth - 2 - TableBits;
  localparam int unsigned ScaledWidth = ResidualWidth + 18;
  localparam int unsigned StepCut = PhaseWidth - 13;  // d has 27 fraction bits, in radians
  localparam int unsigned SlopeCut = 12;  // from 27 + 17 fraction bits to the table's 32
  localparam int unsigned AmplCut = EntryWidth + 1 - AmplWidth;
  localparam logic signed [17:0] Turn = 18'sd102944;  // 2 pi / 8 in 2**-17

  // 1: fold the quadrant.  The residual is centred in its table step, which inverts its top bit.
  logic                 odd;
  logic [TableBits-1:0] index;
  assign odd   = phase_i[PhaseWidth-2];
  assign index = phase_i[PhaseWidth-3-:TableBits] ^ {TableBits{odd}};

  logic        [    TableBits-1:0] index_q;
  logic signed [ResidualWidth-1:0] residual_q;
  logic signed [             17:0] turn_q;
  always_ff @(posedge clk_i) begin
    index_q    <= index;
    residual_q <= signed'({!phase_i[ResidualWidth-1], phase_i[ResidualWidth-2:0]});
    turn_q     <= odd ? -Turn : Turn;
  end

  // The signs wait for the last stage.
  logic [Latency-1:0] valid_q;
  logic [Latency-2:0] sine_negative_q, cosine_negative_q;
  assign valid_o = valid_q[Latency-1];
  always_ff @(posedge clk_i) begin
    valid_q           <= {valid_q[Latency-2:0], valid_i};
    sine_negative_q   <= {sine_negative_q[Latency-3:0], phase_i[PhaseWidth-1]};
    cosine_negative_q <= {cosine_negative_q[Latency-3:0], phase_i[PhaseWidth-1] ^ odd};
    if (rst_i) valid_q <= '0;
  end

  // 2: read both entries; scale the residual to radians.
  logic [EntryWidth-1:0] sine_entry, cosine_entry;
  quarter_wave_rom u_rom (
    .clk_i,
    .a_index_i(index_q),
    .b_index_i(~index_q),
    .a_entry_o(sine_entry),
    .b_entry_o(cosine_entry)
  );

  logic signed [ScaledWidth-1:0] scaled_q, rounded;
  assign rounded = scaled_q + (ScaledWidth'(1) << (StepCut - 1));

  // 3: round d to nearest; |d| <= Turn fits in 18 bits.
  logic signed [          17:0] step_q;
  logic        [EntryWidth-1:0] sine_entry_q, cosine_entry_q;

  // 4: once more, so that the registers before the multipliers can lie close to them.
  logic signed [          17:0] step_q2;
  logic        [EntryWidth-1:0] sine_entry_q2, cosine_entry_q2;

  // 5: multiply with the entries' top 17 bits.
  logic signed [17:0] sine_factor, cosine_factor;
  assign sine_factor   = signed'({1'b0, sine_entry_q2[EntryWidth-1-:17]});
  assign cosine_factor = signed'({1'b0, cosine_entry_q2[EntryWidth-1-:17]});
  logic signed [          35:0] sine_slope_q, cosine_slope_q;
  logic        [EntryWidth-1:0] sine_entry_q3, cosine_entry_q3;

  // 6: once more behind them, for the same reason.
  logic signed [          35:0] sine_slope_q2, cosine_slope_q2;
  logic        [EntryWidth-1:0] sine_entry_q4, cosine_entry_q4;

  // 7: interpolate.  The sum can fall below zero by a rounding, and never exceeds 32 bits.
  logic signed [EntryWidth:0] sine_q, cosine_q;

  // 8: sign and rounding in one addition: -x is ~x + 1, and the half is above bit 0.
  function automatic logic signed [EntryWidth:0] finished(input logic signed [EntryWidth:0] value,
                                                          input logic negative);
    finished = (value ^ {(EntryWidth + 1){negative}})
             + (signed'((EntryWidth + 1)'(1)) <<< (AmplCut - 1))
             + signed'((EntryWidth + 1)'(negative));
  endfunction

  logic signed [EntryWidth:0] sine_finished, cosine_finished;
  assign sine_finished   = finished(sine_q, sine_negative_q[Latency-2]);
  assign cosine_finished = finished(cosine_q, cosine_negative_q[Latency-2]);

  always_ff @(posedge clk_i) begin
    scaled_q        <= ScaledWidth'(residual_q) * ScaledWidth'(turn_q);

    step_q          <= 18'(rounded >>> StepCut);
    sine_entry_q    <= sine_entry;
    cosine_entry_q  <= cosine_entry;

    step_q2         <= step_q;
    sine_entry_q2   <= sine_entry_q;
    cosine_entry_q2 <= cosine_entry_q;

    sine_slope_q    <= step_q2 * cosine_factor;
    cosine_slope_q  <= step_q2 * sine_factor;
    sine_entry_q3   <= sine_entry_q2;
    cosine_entry_q3 <= cosine_entry_q2;

    sine_slope_q2   <= sine_slope_q;
    cosine_slope_q2 <= cosine_slope_q;
    sine_entry_q4   <= sine_entry_q3;
    cosine_entry_q4 <= cosine_entry_q3;

    sine_q   <= signed'({1'b0, sine_entry_q4}) + (EntryWidth + 1)'(sine_slope_q2 >>> SlopeCut);
    cosine_q <= signed'({1'b0, cosine_entry_q4}) - (EntryWidth + 1)'(cosine_slope_q2 >>> SlopeCut);

    sine_o   <= AmplWidth'(sine_finished >>> AmplCut);
    cosine_o <= AmplWidth'(cosine_finished >>> AmplCut);
  end

endmodule

`default_nettype wire
