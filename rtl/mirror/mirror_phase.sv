// mirror_phase: the mirror's own phase and its amplitude from the index, VR-SCAN IV-D, IV-G2.
//
// A numerically controlled oscillator runs at the mirror's frequency.  Its phase at a crossing is
// phase - increment * age, both of the clock of valid_i.  The middle of an outward and the inward
// after it gives the phase, half their distance the amplitude: a table, linear between its
// entries, holds the amplitude and the middle that the motion with its harmonics has for a half
// distance, so there is no trigonometry and no division.  error = middle - the table's.
//
// A tracker of second order follows: phase -= error / 2**phase_shift, increment -= error /
// 2**rate_shift, amplitude += (measured - amplitude) / 2**amplitude_shift.  As long as nothing
// is tracked, the increment is word_i of the clock before; the first error, and one beyond
// error_limit, is taken off whole, with the increment word_i and the amplitude as measured.
//
//   valid_i      at least MinCrossing clocks after the one before; ignored while one is worked on
//   broken_i     the outward before is forgotten, also in the clock of valid_i
//   renew_i      with table_changed the table is another one, which acquired_o tells without
//                valid_o: the pair that is worked on is dropped, the outward before is forgotten,
//                and the next pair is taken as the first one is
//   table_i      two banks, of which table_bank is read; entry i is for a half distance of
//                i / 2**(AmplitudeTableBits + 2) turns; from a quarter turn on the last one holds
//   phase_o      of the clock, turns; with valid_o the corrected one
//   measured_o, error_o, acquired_o  with valid_o; hold but for acquired_o
//   amplitude_o  averaged, kept with 15 more bits
//   Rounding     to nearest, half up
//   Latency      47 clocks from an inward to valid_o; in the clock before, the phase advances by
//                the increment still, less the correction
//   Model        vrscan.clocked.mirror_phase, bit-exact

`default_nettype none

module mirror_phase (
  input  wire logic                                             clk_i,
  input  wire logic                                             rst_i,

  input  wire logic                                             valid_i,
  input  wire logic                                             outward_i,
  input  wire logic        [          vrscan_pkg::AgeWidth-1:0] age_i,
  input  wire logic                                             broken_i,
  input  wire logic        [         vrscan_pkg::WordWidth-1:0] word_i,

  input  wire register_pkg::table_t                             table_i,
  input  wire logic                                             renew_i,

  input  wire register_pkg::mirror_t                            mirror_i,

  output      logic        [         vrscan_pkg::TurnWidth-1:0] phase_o,
  output      logic        [         vrscan_pkg::WordWidth-1:0] increment_o,

  output      logic                                             valid_o,
  output      logic        [    vrscan_pkg::AmplitudeWidth-1:0] measured_o,
  output      logic        [    vrscan_pkg::AmplitudeWidth-1:0] amplitude_o,
  output      logic signed [        vrscan_pkg::ErrorWidth-1:0] error_o,
  output      logic                                             acquired_o
);

  localparam int unsigned TurnWidth = vrscan_pkg::TurnWidth;
  localparam int unsigned WordWidth = vrscan_pkg::WordWidth;
  localparam int unsigned SubWidth = vrscan_pkg::SubWidth;
  localparam int unsigned AmplitudeWidth = vrscan_pkg::AmplitudeWidth;
  localparam int unsigned MidpointWidth = vrscan_pkg::MidpointWidth;
  localparam int unsigned ErrorWidth = vrscan_pkg::ErrorWidth;
  localparam int unsigned TableBits = vrscan_pkg::AmplitudeTableBits;
  localparam int unsigned HalfWidth = vrscan_pkg::PhaseWidth;
  // A half distance of a quarter turn is 2**(HalfWidth-1): index and fraction are what is below.
  localparam int unsigned FractionWidth = HalfWidth - 1 - TableBits;
  localparam int unsigned FactorWidth = WordWidth + 1;
  localparam int unsigned ShareWidth = FractionWidth + 1;  // an age, or a fraction between entries
  localparam int unsigned ProductWidth = FactorWidth + ShareWidth;
  localparam int unsigned FineWidth = 15;  // bits of the average below those of the amplitude
  localparam int unsigned AverageWidth = AmplitudeWidth + FineWidth;
  localparam int unsigned ShiftedWidth = TurnWidth + 1;
  localparam int unsigned HalfDrop = TurnWidth - HalfWidth;
  localparam int unsigned MiddleDrop = TurnWidth - MidpointWidth;

  if (FractionWidth != vrscan_pkg::AgeWidth + 1) begin : gen_bad_widths
    $error("mirror_phase: an age and a fraction between entries take one factor's width");
  end

  typedef enum logic [4:0] {
    IDLE, AGE, POSITION, DISTANCE, HALF, ADDRESS, NEXT_ADDRESS, FETCH, BASE, DIFFERENCE,
    AMPLITUDE, MIDPOINT, MEASURED, ERROR, LIMIT, MAGNITUDE, COMPARE, SHIFT_A, SHIFT_B, CORRECT,
    CANDIDATE, ADVANCE, APPLY
  } step_e;

  step_e step_q;
  logic  take, renew;
  assign renew = renew_i && table_i.table_changed;
  logic  pending_q, outward_q;  // an outward is there; the crossing at work is one
  assign take = valid_i && !renew && step_q == IDLE && (outward_i || (pending_q && !broken_i));

  // One multiplier: age times increment, then fraction times the difference of two entries.
  logic                           start_q, product_valid;
  logic signed [ FactorWidth-1:0] factor_q;
  logic signed [  ShareWidth-1:0] share_q;
  logic signed [ProductWidth-1:0] product;
  logic signed [   TurnWidth-1:0] rounded_q;
  multiply #(
    .AWidth(FactorWidth),
    .BWidth(ShareWidth)
  ) u_multiply (
    .clk_i,
    .rst_i    (rst_i || renew),
    .valid_i  (start_q),
    .a_i      (factor_q),
    .b_i      (share_q),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // The table, its output registered again.  An entry that is written in the clock in which it is
  // read may come out as anything on a chip, and as it was before in simulation: a table is
  // written before it is used, and nothing has to be built for it.
  localparam int unsigned EntryWidth = AmplitudeWidth + MidpointWidth;
  (* no_rw_check *)
  logic [EntryWidth-1:0] table_mem [2 << TableBits];
  // An entry that was never written is 0, as the bus reads it.
  initial for (int k = 0; k < (2 << TableBits); k = k + 1) table_mem[k] = '0;
  logic [EntryWidth-1:0] entry_q, entry_q2;
  logic [ TableBits-1:0] index_q;

  // The crossings.
  logic        [    TurnWidth-1:0] captured_q, position_q, first_q, distance_q, middle_q;
  logic        [      HalfWidth:0] half;
  logic        [    HalfWidth-1:0] half_q;
  logic                            out_of_table, tracking_q;
  logic        [AmplitudeWidth-1:0] base_q, measured_q;
  logic        [ MidpointWidth-1:0] base_midpoint_q, difference_q, midpoint_q;
  assign half         = (HalfWidth + 1)'(distance_q >> HalfDrop)
                        + (HalfWidth + 1)'(distance_q[HalfDrop-1]);
  assign out_of_table = half_q[HalfWidth-1];

  // The error, to nearest with as many bits as leave; half a turn less half a step saturates.
  logic signed [   TurnWidth-1:0] error_q;
  logic signed [    ErrorWidth:0] error;
  logic signed [  ErrorWidth-1:0] error_rounded_q;
  logic        [  ErrorWidth-1:0] magnitude_q;
  logic                           beyond_q, anew_q, acquire;
  assign error   = (ErrorWidth + 1)'(error_q >>> (TurnWidth - ErrorWidth))
                   + signed'((ErrorWidth + 1)'(error_q[TurnWidth-ErrorWidth-1]));
  assign acquire = !tracking_q || beyond_q || anew_q;

  // Shifts by up to 63 in three stages and one that rounds: phase, rate and amplitude in a row.
  logic signed [ShiftedWidth-1:0] shift_q, coarse_q, middling_q, fine_q;
  logic        [             5:0] by_q;
  logic        [             3:0] by_q2;
  logic        [             1:0] by_q3;
  logic signed [   TurnWidth-1:0] shifted_q;

  // What is taken off the phase: nothing, but once the correction.
  logic signed [   TurnWidth-1:0] correction_q;
  logic        [   TurnWidth-1:0] taken_off_q;
  logic signed [   TurnWidth+1:0] candidate_q;
  logic        [   WordWidth-1:0] rate_q, increment;
  logic        [AverageWidth-1:0] average_q;
  logic signed [  AverageWidth:0] gap_q;
  logic        [AverageWidth-1:0] next_average_q;
  assign increment = acquire ? word_i : rate_q;

  always_ff @(posedge clk_i) begin
    if (table_i.table_write) begin
      table_mem[{table_i.table_write_bank, table_i.table_index}]
          <= {table_i.table_amplitude, table_i.table_midpoint};
    end
    entry_q  <= table_mem[{table_i.table_bank, index_q}];
    entry_q2 <= entry_q;

    start_q <= 1'b0;
    valid_o <= 1'b0;
    acquired_o <= 1'b0;
    phase_o     <= phase_o + TurnWidth'(increment_o) - taken_off_q;
    taken_off_q <= '0;
    if (!tracking_q) increment_o <= word_i;

    if (broken_i) pending_q <= 1'b0;
    if (take) begin
      pending_q  <= outward_i;
      outward_q  <= outward_i;
      captured_q <= phase_o;
      factor_q   <= FactorWidth'(increment_o);
      share_q    <= ShareWidth'(age_i);
      start_q    <= 1'b1;
      step_q     <= AGE;
    end

    if (product_valid) begin
      rounded_q <= step_q == AGE ?
          TurnWidth'(product >>> SubWidth) + TurnWidth'(product[SubWidth-1]) :
          TurnWidth'(product >>> FractionWidth) + TurnWidth'(product[FractionWidth-1]);
    end
    gap_q <= (AverageWidth + 1)'({measured_q, FineWidth'(0)}) - (AverageWidth + 1)'(average_q);

    unique case (step_q)
      IDLE: ;
      AGE: if (product_valid) step_q <= POSITION;
      POSITION: begin
        position_q <= captured_q - unsigned'(rounded_q);
        if (outward_q) first_q <= captured_q - unsigned'(rounded_q);
        step_q <= outward_q ? IDLE : DISTANCE;
      end
      DISTANCE: begin
        distance_q <= position_q - first_q;
        step_q     <= HALF;
      end
      HALF: begin
        half_q   <= half[HalfWidth] ? '1 : half[HalfWidth-1:0];
        middle_q <= first_q + (distance_q >> 1);
        step_q   <= ADDRESS;
      end
      ADDRESS: begin
        index_q <= out_of_table ? '1 : half_q[FractionWidth+:TableBits];
        share_q <= ShareWidth'(half_q[FractionWidth-1:0]);
        step_q  <= NEXT_ADDRESS;
      end
      NEXT_ADDRESS: begin
        if (index_q != '1) index_q <= index_q + TableBits'(1);
        step_q <= FETCH;
      end
      FETCH: step_q <= BASE;
      BASE: begin
        {base_q, base_midpoint_q} <= entry_q2;
        step_q                    <= DIFFERENCE;
      end
      DIFFERENCE: begin
        factor_q     <= FactorWidth'(entry_q2[MidpointWidth+:AmplitudeWidth])
                        - FactorWidth'(base_q);
        difference_q <= entry_q2[MidpointWidth-1:0] - base_midpoint_q;
        start_q      <= 1'b1;
        step_q       <= AMPLITUDE;
      end
      AMPLITUDE: begin
        if (product_valid) begin
          factor_q <= FactorWidth'(signed'(difference_q));
          start_q  <= 1'b1;
          step_q   <= MIDPOINT;
        end
      end
      MIDPOINT: begin
        measured_q <= base_q + unsigned'(rounded_q[AmplitudeWidth-1:0]);
        if (product_valid) step_q <= MEASURED;
      end
      MEASURED: begin
        midpoint_q <= base_midpoint_q + unsigned'(rounded_q[MidpointWidth-1:0]);
        step_q     <= ERROR;
      end
      ERROR: begin
        error_q <= signed'(middle_q - {midpoint_q, MiddleDrop'(0)});
        step_q  <= LIMIT;
      end
      LIMIT: begin
        // One bit more than the error has, and it rounds.
        shift_q         <= {error_q, 1'b0};
        by_q            <= 6'(mirror_i.phase_shift);
        error_rounded_q <= error[ErrorWidth] == error[ErrorWidth-1] ? ErrorWidth'(error) :
                           {1'b0, {(ErrorWidth - 1) {1'b1}}};
        step_q          <= MAGNITUDE;
      end
      MAGNITUDE: begin
        by_q        <= mirror_i.rate_shift;
        magnitude_q <= error_rounded_q[ErrorWidth-1] ? -unsigned'(error_rounded_q) :
                                                       unsigned'(error_rounded_q);
        step_q      <= COMPARE;
      end
      COMPARE: begin
        shift_q  <= ShiftedWidth'(signed'({gap_q, 1'b0}));
        by_q     <= 6'(mirror_i.amplitude_shift);
        beyond_q <= magnitude_q > mirror_i.error_limit;
        step_q   <= SHIFT_A;
      end
      SHIFT_A: step_q <= SHIFT_B;
      SHIFT_B: step_q <= CORRECT;
      CORRECT: begin
        correction_q <= acquire ? error_q : shifted_q;
        step_q       <= CANDIDATE;
      end
      CANDIDATE: begin
        candidate_q <= (TurnWidth + 2)'(increment_o) - (TurnWidth + 2)'(shifted_q);
        step_q      <= ADVANCE;
      end
      ADVANCE: begin
        rate_q         <= candidate_q[TurnWidth+1] ? '0 :
                          candidate_q[TurnWidth:WordWidth] != '0 ? '1 : candidate_q[WordWidth-1:0];
        next_average_q <= acquire ? {measured_q, FineWidth'(0)} :
                                    average_q + unsigned'(shifted_q[AverageWidth-1:0]);
        taken_off_q    <= unsigned'(correction_q);
        step_q         <= APPLY;
      end
      default: begin  // APPLY
        increment_o    <= increment;
        average_q      <= next_average_q;
        valid_o        <= 1'b1;
        measured_o     <= measured_q;
        amplitude_o    <= next_average_q[FineWidth+:AmplitudeWidth]
                          + AmplitudeWidth'(next_average_q[FineWidth-1]);
        error_o        <= error_rounded_q;
        tracking_q     <= 1'b1;
        anew_q         <= 1'b0;
        acquired_o     <= acquire;
        step_q         <= IDLE;
      end
    endcase

    coarse_q   <= shift_q >>> {by_q[5:4], 4'd0};
    by_q2      <= by_q[3:0];
    middling_q <= coarse_q >>> {by_q2[3:2], 2'd0};
    by_q3      <= by_q2[1:0];
    fine_q     <= middling_q >>> by_q3;
    shifted_q  <= TurnWidth'(fine_q >>> 1) + TurnWidth'(fine_q[0]);

    if (renew) begin
      pending_q  <= 1'b0;
      anew_q     <= 1'b1;
      acquired_o <= 1'b1;
      valid_o    <= 1'b0;
      if (step_q != APPLY) begin  // the phase has not moved yet
        step_q      <= IDLE;
        start_q     <= 1'b0;
        taken_off_q <= '0;
      end
    end
    if (rst_i) begin
      step_q      <= IDLE;
      pending_q   <= 1'b0;
      anew_q      <= 1'b0;
      phase_o     <= '0;
      increment_o <= '0;
      taken_off_q <= '0;
      amplitude_o <= '0;
      measured_o  <= '0;
      error_o     <= '0;
      valid_o     <= 1'b0;
      tracking_q  <= 1'b0;
      acquired_o  <= 1'b0;
    end
  end

endmodule

`default_nettype wire
