// focus_target: where the lens should be: the table's position for the scene's distance, or the
// host's.
//
// The position is that of a table with 64 entries, linear between them, to nearest, half up:
// entry i is for a distance of focus_z_begin + i 2**(focus_z_shift + 10) steps; the first and the
// last hold beyond.  In mode AUTOMATIC the first position that comes is the target; later ones are
// when they have been more than focus_hysteresis from it for focus_hold_points good points on end (0 is
// as 1): it does not hunt.  In mode MANUAL focus_manual is the target.
//
//   valid_i      a new distance_i, which stays; not while busy_o
//   lapse_i      good points are counted anew
//   known_o      there is a target
//   Latency      valid_i to target_o: 18 clocks, in which the table and its registers must hold;
//                focus_manual to it: 1 clock
//   Model        vrscan.clocked.focus_target, bit-exact

`default_nettype none

module focus_target (
  input  wire logic                                      clk_i,
  input  wire logic                                      rst_i,

  input  wire logic                                      valid_i,
  input  wire logic signed [vrscan_pkg::LengthWidth-1:0] distance_i,
  input  wire logic                                      lapse_i,
  output      logic                                      busy_o,

  output      logic        [                       15:0] target_o,
  output      logic                                      known_o,

  // The table.
  input  wire register_pkg::focus_table_t                focus_table_i,

  // Configuration.
  input  wire register_pkg::focus_t                      focus_i
);

  localparam int unsigned LengthWidth = vrscan_pkg::LengthWidth;
  localparam int unsigned TableBits = 6;
  localparam int unsigned FractionWidth = 10;
  localparam int unsigned PositionWidth = 16;
  localparam int unsigned ShareWidth = FractionWidth + 1;
  localparam int unsigned DifferenceWidth = PositionWidth + 1;
  localparam int unsigned ProductWidth = DifferenceWidth + ShareWidth;
  localparam logic [TableBits-1:0] LastEntry = '1;

  localparam logic [1:0] Manual = 2'd1;
  localparam logic [1:0] Automatic = 2'd2;

  // The clocks since valid_i; 0 is idle.  What stands below in the order of its ages is
  // free-running: its operands hold long enough.
  localparam int unsigned AgeWidth = 5;
  localparam int unsigned Product = vrscan_pkg::multiply_latency(DifferenceWidth, ShareWidth);
  localparam logic [AgeWidth-1:0] Index = AgeWidth'(3);
  localparam logic [AgeWidth-1:0] Base = AgeWidth'(5);
  localparam logic [AgeWidth-1:0] Multiply = AgeWidth'(7);
  localparam logic [AgeWidth-1:0] Candidate = AgeWidth'(7 + Product);
  localparam logic [AgeWidth-1:0] Decide = AgeWidth'(11 + Product);
  logic [AgeWidth-1:0] age_q;
  assign busy_o = age_q != '0;

  logic        [  PositionWidth-1:0] table_mem [1 << TableBits];
  // An entry that was never written is as the bus reads it.
  initial for (int k = 0; k < (1 << TableBits); k = k + 1) begin
    table_mem[k] = register_pkg::ResetFocusTablePosition[PositionWidth*k+:PositionWidth];
  end
  logic        [  PositionWidth-1:0] entry_q, base_q, candidate_q;
  logic        [      TableBits-1:0] index_q;
  logic        [  FractionWidth-1:0] fraction_q;
  logic signed [      LengthWidth:0] beyond_q;  // the first entry
  logic        [    LengthWidth-1:0] steps_q, entries_q;
  logic                              last;
  logic signed [DifferenceWidth-1:0] difference_q, off_q;
  logic signed [   ProductWidth-1:0] product;
  logic        [  PositionWidth-1:0] off_size_q;
  assign last = entries_q[LengthWidth-1:FractionWidth] >=
                (LengthWidth - FractionWidth)'(LastEntry);

  multiply #(
    .AWidth(DifferenceWidth),
    .BWidth(ShareWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (age_q == Multiply),
    .a_i      (difference_q),
    .b_i      (signed'({1'b0, fraction_q})),
    .valid_o  (),
    .product_o(product)
  );

  logic        far_q, held_q;
  logic        manual_q, taken_q;  // the target is the host's; is one of the table
  logic [15:0] far_count_q;
  assign known_o = manual_q || taken_q;

  always_ff @(posedge clk_i) begin
    if (valid_i) age_q <= AgeWidth'(1);
    else if (age_q == Decide) age_q <= '0;
    else if (age_q != '0) age_q <= age_q + AgeWidth'(1);

    if (focus_table_i.focus_table_write) begin
      table_mem[focus_table_i.focus_table_index] <= focus_table_i.focus_table_position;
    end
    entry_q <= table_mem[index_q];

    beyond_q  <= (LengthWidth + 1)'(distance_i) - (LengthWidth + 1)'(focus_i.focus_z_begin);
    steps_q   <= (beyond_q[LengthWidth] ? '0 : beyond_q[LengthWidth-1:0])
                 >> {focus_i.focus_z_shift[3:2], 2'b00};
    entries_q <= steps_q >> focus_i.focus_z_shift[1:0];
    index_q   <= index_q + TableBits'(1);
    if (age_q == Index) begin
      index_q    <= last ? LastEntry : entries_q[FractionWidth+:TableBits];
      fraction_q <= last ? '0 : entries_q[FractionWidth-1:0];
    end
    if (age_q == Base) base_q <= entry_q;
    difference_q <= signed'({1'b0, entry_q}) - signed'({1'b0, base_q});
    if (age_q == Candidate) begin
      candidate_q <= base_q + PositionWidth'(unsigned'(product) >> FractionWidth)
                     + PositionWidth'(product[FractionWidth-1]);
    end

    off_q      <= signed'({1'b0, candidate_q}) - signed'({1'b0, target_o});
    off_size_q <= PositionWidth'(off_q[DifferenceWidth-1] ? '0 - off_q : off_q);
    far_q      <= off_size_q > focus_i.focus_hysteresis;
    held_q     <= {1'b0, far_count_q} + 17'd1 >= {1'b0, focus_i.focus_hold_points};

    manual_q <= focus_i.focus_mode == Manual;
    if (lapse_i) far_count_q <= '0;
    if (focus_i.focus_mode == Manual) target_o <= focus_i.focus_manual;
    if (focus_i.focus_mode != Automatic) begin
      taken_q     <= 1'b0;
      far_count_q <= '0;
    end else if (age_q == Decide) begin
      far_count_q <= far_q ? far_count_q + 16'd1 : '0;
      if (!taken_q || (far_q && held_q)) begin
        target_o    <= candidate_q;
        taken_q     <= 1'b1;
        far_count_q <= '0;
      end
    end

    if (rst_i) begin
      age_q       <= '0;
      manual_q    <= 1'b0;
      taken_q     <= 1'b0;
      far_count_q <= '0;
      target_o    <= '0;
    end
  end

endmodule

`default_nettype wire
