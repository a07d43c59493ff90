// free_interval: the interval of z in which a beam that gives no peak meets nothing.
//
// A line without a peak says something only about the part of its beam that the camera sees, and
// only as far as a surface would be bright enough there.  Both are intervals of a table that the
// host computes; the result is what they have in common:
//   entries 0 to 127    what the camera sees: entry i is for the angle free_begin + i 2**(free_shift
//                       + 10) steps, linear between two entries, from rounded up and to down;
//                       empty beyond the table, and beside an empty entry
//   entries 128 to 255  where the darkest surface gives a peak: entry 128 + 8 e + k is for
//                       q = 2**8 power / noise, to nearest, of (8 + k) 2**(e - 3) and more; empty
//                       for q = 0
//
//   Two banks, of which free_table_bank is read
//
//   from_o, to_o  mm, FreeFraction bits; both 0 where nothing is free.  They hold until the next
//                 valid_o
//   Latency  vrscan.fixed.free_interval.LATENCY clocks; a valid_i meanwhile starts anew.  The table
//            and its registers must hold meanwhile
//   Model    vrscan.fixed.free_interval, bit-exact

`default_nettype none

module free_interval (
  input  wire logic                                     clk_i,
  input  wire logic                                     rst_i,  // clears control only

  // Sampled with valid_i.
  input  wire logic                                     valid_i,
  input  wire logic signed [vrscan_pkg::AngleWidth-1:0] angle_i,
  input  wire logic        [vrscan_pkg::PowerWidth-1:0] power_i,
  input  wire logic        [vrscan_pkg::CountWidth-1:0] noise_i,

  output      logic                                     valid_o,
  output      logic        [ vrscan_pkg::FreeWidth-1:0] from_o,
  output      logic        [ vrscan_pkg::FreeWidth-1:0] to_o,

  // The table and its place.
  input  wire register_pkg::free_t                      free_i,
  input  wire register_pkg::free_table_t                free_table_i
);

  localparam int unsigned AngleWidth = vrscan_pkg::AngleWidth;
  localparam int unsigned FreeWidth = vrscan_pkg::FreeWidth;
  localparam int unsigned IndexWidth = 7;  // of either half of the table
  localparam int unsigned FractionWidth = 10;
  localparam int unsigned DifferenceWidth = FreeWidth + 1;
  localparam int unsigned ShareWidth = FractionWidth + 1;
  localparam int unsigned ProductWidth = DifferenceWidth + ShareWidth;
  localparam int unsigned QuotientFraction = 8;
  localparam int unsigned QuotientWidth = 16;
  localparam int unsigned MantissaWidth = 3;
  localparam logic [IndexWidth-1:0] LastEntry = '1;

  logic unused;
  assign unused = &{1'b0, free_table_i.free_table_changed};  // nothing is kept from line to line

  // ---- the table ----
  logic [2*FreeWidth-1:0] table_mem [4 << IndexWidth];
  // An entry that was never written is 0, as the bus reads it.
  initial for (int k = 0; k < (4 << IndexWidth); k = k + 1) table_mem[k] = '0;
  logic [   IndexWidth:0] address_q;
  logic [2*FreeWidth-1:0] read_q;
  logic [  FreeWidth-1:0] entry_from_q, entry_to_q;
  always_ff @(posedge clk_i) begin
    if (free_table_i.free_table_write) begin
      table_mem[{free_table_i.free_table_write_bank, free_table_i.free_table_index}]
          <= {free_table_i.free_table_from, free_table_i.free_table_to};
    end
    read_q                     <= table_mem[{free_table_i.free_table_bank, address_q}];
    {entry_from_q, entry_to_q} <= read_q;
  end

  // ---- what the camera sees, by the clocks since valid_i; 0 is idle.  What stands below in the
  // order of its ages is free-running: its operands hold long enough ----
  localparam int unsigned AgeWidth = 5;
  localparam int unsigned Product = vrscan_pkg::multiply_latency(DifferenceWidth, ShareWidth);
  localparam logic [AgeWidth-1:0] Index = AgeWidth'(3);
  localparam logic [AgeWidth-1:0] Base = AgeWidth'(6);
  // When the products of from and of to start, and when they are there.
  localparam logic [AgeWidth-1:0] From = AgeWidth'(8);
  localparam logic [AgeWidth-1:0] FromDone = AgeWidth'(8 + Product);
  localparam logic [AgeWidth-1:0] To = AgeWidth'(9 + Product);
  localparam logic [AgeWidth-1:0] ToDone = AgeWidth'(9 + 2 * Product);
  logic        [       AgeWidth-1:0] age_q;
  logic signed [       AngleWidth:0] offset_q;  // of the angle, from the first entry's
  logic        [     AngleWidth-1:0] coarse_q, steps_q;
  logic        [  FractionWidth-1:0] fraction_q;
  logic                              before_q, outside_q, empty_q;
  logic        [      FreeWidth-1:0] base_from_q, base_to_q, seen_from_q, seen_to_q;
  logic signed [DifferenceWidth-1:0] move_from_q, move_to_q;
  logic signed [   ProductWidth-1:0] product;

  multiply #(
    .AWidth(DifferenceWidth),
    .BWidth(ShareWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (age_q == From || age_q == To),
    .a_i      (age_q == To ? move_to_q : move_from_q),
    .b_i      (signed'({1'b0, fraction_q})),
    .valid_o  (),
    .product_o(product)
  );

  // ---- where the darkest surface would be seen, from the quotient on ----
  logic                     quotient_valid;
  logic [QuotientWidth-1:0] quotient;
  logic [MantissaWidth-1:0] mantissa_q;
  logic [              3:0] exponent, exponent_q;
  logic [              5:0] stage_q;
  logic                     dark_q;
  divide #(
    .DividendWidth(vrscan_pkg::PowerWidth + QuotientFraction),
    .DivisorWidth (vrscan_pkg::CountWidth),
    .QuotientWidth(QuotientWidth)
  ) u_divide (
    .clk_i,
    .rst_i,
    .valid_i   (valid_i),
    .dividend_i({power_i, {QuotientFraction{1'b0}}}),
    .divisor_i (noise_i),
    .valid_o   (quotient_valid),
    .quotient_o(quotient),
    .overflow_o()  // all ones is the last entry
  );
  always_comb begin
    exponent = 4'd0;
    for (int unsigned k = 1; k < QuotientWidth; ++k) begin
      if (quotient[k]) exponent = 4'(k);
    end
  end

  logic [FreeWidth-1:0] from_q, to_q;
  logic                 none_q;
  always_ff @(posedge clk_i) begin
    if (valid_i) age_q <= AgeWidth'(1);
    else if (age_q == ToDone) age_q <= '0;
    else if (age_q != '0) age_q <= age_q + AgeWidth'(1);

    if (valid_i) offset_q <= (AngleWidth + 1)'(angle_i) - (AngleWidth + 1)'(free_i.free_begin);
    before_q <= offset_q[AngleWidth];
    coarse_q <= offset_q[AngleWidth-1:0] >> {free_i.free_shift[3:2], 2'b00};
    steps_q  <= coarse_q >> free_i.free_shift[1:0];
    if (age_q == Index) begin
      fraction_q <= steps_q[FractionWidth-1:0];
      outside_q  <= before_q || steps_q[AngleWidth-1:FractionWidth]
                                >= (AngleWidth - FractionWidth)'(LastEntry);
    end
    if (age_q == Base) {base_from_q, base_to_q} <= {entry_from_q, entry_to_q};
    if (age_q == Base + AgeWidth'(1)) begin
      empty_q     <= outside_q || base_from_q >= base_to_q || entry_from_q >= entry_to_q;
      move_from_q <= signed'({1'b0, entry_from_q}) - signed'({1'b0, base_from_q});
      move_to_q   <= signed'({1'b0, entry_to_q}) - signed'({1'b0, base_to_q});
    end
    // A positive share of a step counts as a whole one: from is rounded up, to is rounded down.
    if (age_q == FromDone) begin
      seen_from_q <= base_from_q + FreeWidth'(product >>> FractionWidth)
                     + FreeWidth'(product[FractionWidth-1:0] != '0);
    end
    if (age_q == ToDone) seen_to_q <= base_to_q + FreeWidth'(product >>> FractionWidth);

    if (quotient_valid) begin
      exponent_q <= exponent;
      mantissa_q <= MantissaWidth'({quotient, {MantissaWidth{1'b0}}} >> exponent);
      dark_q     <= quotient == '0;
    end
    stage_q <= {stage_q[4:0], quotient_valid};
    if (age_q == Index) address_q <= {1'b0, steps_q[FractionWidth+:IndexWidth]};
    else if (stage_q[0]) address_q <= {1'b1, exponent_q, mantissa_q};
    else address_q <= address_q + (IndexWidth + 1)'(1);
    if (stage_q[3]) begin
      from_q <= seen_from_q > entry_from_q ? seen_from_q : entry_from_q;
      to_q   <= seen_to_q < entry_to_q ? seen_to_q : entry_to_q;
    end
    none_q <= empty_q || dark_q || from_q >= to_q;
    if (stage_q[5] && !valid_i) begin
      from_o <= none_q ? '0 : from_q;
      to_o   <= none_q ? '0 : to_q;
    end
    valid_o <= stage_q[5] && !valid_i;

    if (valid_i) stage_q <= '0;
    if (rst_i) begin
      age_q   <= '0;
      stage_q <= '0;
      valid_o <= 1'b0;
    end
  end

endmodule

`default_nettype wire
