// correction_map: corrects a position on the sensor by a calibrated map, VR-SCAN V-B.
//
// What lens, spot and scan angle do to a position beyond (3) to (5) is found by calibration as maps
// over scan angle and position, one for each of MapCount positions of the lens.  A map has 33 x 65
// nodes: node (i, j) is for the angle (i - 16) / 256 turns and the position j R / 64, R =
// 2**$clog2(LineLength) px.  Between nodes, and between the maps of two positions of the lens, the
// correction is linear, so it has no jumps; beyond the ends it is that of the end.
// One multiplier makes the seven interpolations one after the other: four along the position, two
// along the angle, one along the lens.
//
//   position_i    px, PositionFraction bits
//   lens_i        position of the lens, steps; map k of map_count_i is for
//                 map_begin_i + k 2**map_shift_i
//   value_i       of node (i, j) of map k, at index_i = 2145 k + 65 i + j: px, MapFraction bits,
//                 signed; above it a bit that says that the node was filled and not measured
//   position_o    position_i plus the correction, to nearest, half up; saturated
//   saturated_o   position_o does not fit
//   filled_o      one of the nodes around was filled
//   enable_i      0: the position comes out as it went in; the maps need not have been written
//   bank_i        the one of two banks that corrects
//   write_i ..    the bus's, registered here: value_i becomes that of node index_i of the bank
//                 access_bank_i.  value_o is that of the node that index_i was of READ_BACK clocks
//                 ago, as it was before a write in that clock.  The memory has two ports: this is
//                 one, and bank_i's is not to be written
//   Latency       vrscan.fixed.correction_map.LATENCY clocks; a valid_i meanwhile starts anew.  The
//                 configuration must hold meanwhile
//   Model         vrscan.fixed.correction_map, bit-exact

`default_nettype none

module correction_map #(
  parameter  int unsigned LineLength    = 2048,
  parameter  int unsigned MapCount      = vrscan_pkg::MapCount,
  localparam int unsigned PixelBits     = $clog2(LineLength),
  localparam int unsigned PositionWidth = PixelBits + 1 + vrscan_pkg::PositionFraction,
  localparam int unsigned Entries       = MapCount * vrscan_pkg::MapNodes,
  localparam int unsigned IndexWidth    = $clog2(Entries)
) (
  input  wire logic                                     clk_i,
  input  wire logic                                     rst_i,  // clears control only

  // Sampled with valid_i.
  input  wire logic                                     valid_i,
  input  wire logic signed [         PositionWidth-1:0] position_i,
  input  wire logic signed [vrscan_pkg::AngleWidth-1:0] angle_i,
  input  wire logic        [ vrscan_pkg::LensWidth-1:0] lens_i,

  output      logic                                     valid_o,
  output      logic signed [         PositionWidth-1:0] position_o,
  output      logic                                     saturated_o,
  output      logic                                     filled_o,

  // The maps.
  input  wire logic                                     write_i,
  input  wire logic                                     access_bank_i,
  input  wire logic        [            IndexWidth-1:0] index_i,
  input  wire logic        [    vrscan_pkg::MapWidth:0] value_i,
  output      logic        [    vrscan_pkg::MapWidth:0] value_o,

  // Configuration.
  input  wire logic                                     enable_i,
  input  wire logic                                     bank_i,
  input  wire logic        [vrscan_pkg::MapCountWidth-1:0] map_count_i,  // 2 to MapCount
  input  wire logic        [ vrscan_pkg::LensWidth-1:0] map_begin_i,
  input  wire logic        [                       3:0] map_shift_i
);

  if (LineLength < 64 || LineLength > 8192) begin : gen_bad_line_length
    $error("correction_map: LineLength must be 64 to 8192");
  end
  if (MapCount < 2) begin : gen_bad_map_count
    $error("correction_map: MapCount must be at least 2");
  end

  localparam int unsigned MapWidth = vrscan_pkg::MapWidth;
  localparam int unsigned ColumnBits = 6;  // of an interval between nodes, over the position
  localparam int unsigned RowBits = 5;  // and over the angle
  localparam int unsigned Columns = (1 << ColumnBits) + 1;
  localparam int unsigned AngleStep = 16;  // bits of an angle between two nodes
  localparam int unsigned AngleBits = RowBits + AngleStep;
  localparam int unsigned AngleWidth = vrscan_pkg::AngleWidth;
  localparam int unsigned ShareWidth = 17;
  localparam int unsigned ValueFraction = 17;  // of a value on its way
  localparam int unsigned ValueShift = ValueFraction - vrscan_pkg::MapFraction;
  localparam int unsigned ValueWidth = MapWidth + ValueShift;
  localparam int unsigned DifferenceWidth = ValueWidth + 1;
  localparam int unsigned FactorWidth = ShareWidth + 1;
  localparam int unsigned ProductWidth = DifferenceWidth + FactorWidth;
  localparam int unsigned LensWidth = vrscan_pkg::LensWidth;
  localparam int unsigned CountWidth = $clog2(MapCount);
  localparam int unsigned AddressWidth = $clog2(2 * Entries);
  localparam int unsigned PlaceBits = PixelBits + vrscan_pkg::PositionFraction;
  localparam int unsigned CellBits = PlaceBits - ColumnBits;  // of a position within an interval

  // ---- the maps: one bank behind the other ----
  logic                    write_q;
  logic [AddressWidth-1:0] access_q, address_q;
  logic [      MapWidth:0] written_q, first_q, second;
  two_port_memory #(.Words(2 * Entries), .Width(vrscan_pkg::MapWordWidth)) u_two_port_memory (
    .clk_i, .address_i(address_q), .read_o(second),
    .write_i(write_q), .access_i(access_q), .data_i(written_q), .back_o(value_o)
  );
  always_ff @(posedge clk_i) begin
    write_q   <= write_i && !rst_i;
    access_q  <= AddressWidth'(index_i) + (access_bank_i ? AddressWidth'(Entries) : '0);
    written_q <= value_i;
    first_q   <= second;
  end

  // ---- where among the nodes: an interval, and the share of it; the end's where it is beyond ----
  typedef enum logic [3:0] {
    IDLE, TURN, PLACE, ROW, MAP, FIRST, SECOND, READ, CHOOSE, WAIT_FIRST, WAIT_SECOND, MULTIPLY,
    STORE, SUM
  } state_e;
  typedef enum logic [2:0] {ROW_0, ROW_1, COLUMN_0, ROW_2, ROW_3, COLUMN_1, LENS} step_e;
  state_e state_q;
  step_e  step_q;

  logic signed [PositionWidth-1:0] position_q;
  logic signed [   AngleWidth  :0] turned_q;  // from the first node
  logic signed [     LensWidth :0] lens_q;  // from the first map

  logic [ColumnBits-1:0] column_q;
  logic [   RowBits-1:0] row_q;
  logic [CountWidth-1:0] map_q;
  logic [ShareWidth-1:0] column_share_q, row_share_q, map_share_q;

  // The share of a position has CellBits bits; those below ShareWidth's are cut.
  logic [ShareWidth-1:0] cell_share;
  if (CellBits >= ShareWidth) begin : gen_cell_cut
    assign cell_share = position_q[CellBits-1-:ShareWidth];
  end else begin : gen_cell_shifted
    assign cell_share = {position_q[CellBits-1:0], {(ShareWidth - CellBits) {1'b0}}};
  end

  logic [vrscan_pkg::MapCountWidth-1:0] last_q;  // number of the last map
  always_ff @(posedge clk_i) last_q <= map_count_i - vrscan_pkg::MapCountWidth'(1);
  logic [ LensWidth-1:0] lens_index;
  logic [ShareWidth-1:0] lens_share;
  assign lens_index = lens_q[LensWidth-1:0] >> map_shift_i;
  assign lens_share = ShareWidth'({lens_q[LensWidth-1:0], {ShareWidth{1'b0}}} >> map_shift_i);

  // ---- the interpolations ----
  logic                              start_q, product_valid;
  logic signed [     ValueWidth-1:0] low_q, value, kept_row_q, kept_column_q;
  logic signed [DifferenceWidth-1:0] difference_q;
  logic        [     ShareWidth-1:0] share_q;
  logic signed [   ProductWidth-1:0] product;
  logic signed [     ValueWidth-1:0] moved_q;
  multiply #(
    .AWidth(DifferenceWidth),
    .BWidth(FactorWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (start_q),
    .a_i      (difference_q),
    .b_i      (signed'({1'b0, share_q})),
    .valid_o  (product_valid),
    .product_o(product)
  );

  // Between two values, so it fits; to nearest, half up.
  assign value = low_q + moved_q;

  // The correction has PositionFraction bits: to nearest, half up.
  localparam int unsigned Drop = ValueFraction - vrscan_pkg::PositionFraction;
  localparam int unsigned SumWidth = (PositionWidth > ValueWidth ? PositionWidth : ValueWidth) + 1;
  localparam logic signed [PositionWidth-1:0] PositionMax = {1'b0, {(PositionWidth - 1) {1'b1}}};
  logic signed [SumWidth-1:0] sum_q, wide;
  assign wide = SumWidth'(value);  // a shift of its own, which keeps the sign
  logic                       fits;
  assign fits = sum_q == SumWidth'(signed'(sum_q[PositionWidth-1:0]));

  // Of a map and its bank, without a multiplier.
  logic [AddressWidth-1:0] base, base_q;
  always_comb begin
    base = '0;
    for (int unsigned n = 0; n < MapCount; n++) begin
      if (map_q == CountWidth'(n)) base = AddressWidth'(n * vrscan_pkg::MapNodes);
    end
    if (bank_i) base = base + AddressWidth'(Entries);
  end

  logic [AddressWidth-1:0] corner_q;
  logic                    filled_q, done_q;

  always_ff @(posedge clk_i) begin
    start_q <= 1'b0;
    done_q  <= 1'b0;
    moved_q <= ValueWidth'(product >>> ValueFraction) + ValueWidth'(product[ValueFraction-1]);
    unique case (state_q)
      TURN: begin
        turned_q <= turned_q + (AngleWidth + 1)'(1 << (AngleBits - 1));
        lens_q   <= lens_q - signed'({1'b0, map_begin_i});
        state_q  <= PLACE;
      end
      PLACE: begin
        column_q       <= position_q[PlaceBits-1-:ColumnBits];
        column_share_q <= cell_share;
        if (position_q[PositionWidth-1]) begin
          column_q       <= '0;
          column_share_q <= '0;
        end
        row_q       <= turned_q[AngleBits-1-:RowBits];
        row_share_q <= {turned_q[AngleStep-1:0], {(ShareWidth - AngleStep) {1'b0}}};
        if (turned_q[AngleWidth]) begin
          row_q       <= '0;
          row_share_q <= '0;
        end else if (turned_q[AngleWidth-1:AngleBits] != '0) begin
          row_q       <= '1;
          row_share_q <= '1;
        end
        map_q       <= CountWidth'(lens_index);
        map_share_q <= lens_share;
        if (lens_q[LensWidth]) begin
          map_q       <= '0;
          map_share_q <= '0;
        end else if (lens_index >= LensWidth'(last_q)) begin
          map_q       <= CountWidth'(last_q) - CountWidth'(1);
          map_share_q <= '1;
        end
        state_q <= ROW;
      end
      ROW: begin
        corner_q <= AddressWidth'({row_q, column_q}) + AddressWidth'(row_q);
        base_q   <= base;
        state_q  <= MAP;
      end
      MAP: begin
        corner_q <= corner_q + base_q;
        state_q  <= FIRST;
      end
      FIRST: begin
        address_q <= corner_q;
        state_q   <= SECOND;
      end
      SECOND: begin
        address_q <= corner_q + AddressWidth'(1);
        state_q   <= READ;
      end
      READ: state_q <= CHOOSE;
      CHOOSE: state_q <= WAIT_FIRST;
      WAIT_FIRST: state_q <= WAIT_SECOND;
      WAIT_SECOND: begin
        low_q    <= ValueWidth'(signed'(first_q[MapWidth-1:0])) <<< ValueShift;
        filled_q <= filled_q || first_q[MapWidth] || second[MapWidth];
        difference_q <= (DifferenceWidth'(signed'(second[MapWidth-1:0]))
                         - DifferenceWidth'(signed'(first_q[MapWidth-1:0]))) <<< ValueShift;
        share_q <= column_share_q;
        start_q <= 1'b1;
        state_q <= MULTIPLY;
      end
      MULTIPLY: if (product_valid && !start_q) state_q <= STORE;
      STORE: state_q <= SUM;
      SUM: begin
        state_q <= FIRST;
        start_q <= 1'b0;
        unique case (step_q)
          ROW_0, ROW_2: begin
            kept_row_q <= value;
            corner_q   <= corner_q + AddressWidth'(Columns);
            step_q     <= step_q == ROW_0 ? ROW_1 : ROW_3;
          end
          ROW_1, ROW_3: begin
            low_q        <= kept_row_q;
            difference_q <= DifferenceWidth'(value) - DifferenceWidth'(kept_row_q);
            share_q      <= row_share_q;
            start_q      <= 1'b1;
            step_q       <= step_q == ROW_1 ? COLUMN_0 : COLUMN_1;
            state_q      <= MULTIPLY;
          end
          COLUMN_0: begin
            kept_column_q <= value;
            corner_q      <= corner_q + AddressWidth'(vrscan_pkg::MapNodes - Columns);
            step_q        <= ROW_2;
          end
          COLUMN_1: begin
            low_q        <= kept_column_q;
            difference_q <= DifferenceWidth'(value) - DifferenceWidth'(kept_column_q);
            share_q      <= map_share_q;
            start_q      <= 1'b1;
            step_q       <= LENS;
            state_q      <= MULTIPLY;
          end
          default: begin
            sum_q <= SumWidth'(position_q);
            if (enable_i) begin
              sum_q <= SumWidth'(position_q) + SumWidth'(wide >>> Drop)
                       + SumWidth'(value[Drop-1]);
            end
            done_q  <= 1'b1;
            state_q <= IDLE;
          end
        endcase
      end
      default: ;
    endcase
    if (valid_i) begin
      position_q <= position_i;
      turned_q   <= (AngleWidth + 1)'(angle_i);
      lens_q     <= signed'({1'b0, lens_i});
      filled_q   <= 1'b0;
      start_q    <= 1'b0;
      done_q     <= 1'b0;
      step_q     <= ROW_0;
      state_q    <= TURN;
    end

    valid_o <= done_q && !valid_i;
    if (done_q) begin
      position_o  <= fits              ? PositionWidth'(sum_q) :
                     sum_q[SumWidth-1] ? ~PositionMax : PositionMax;
      saturated_o <= !fits;
      filled_o    <= filled_q && enable_i;
    end
    if (rst_i) begin
      start_q <= 1'b0;
      done_q  <= 1'b0;
      valid_o <= 1'b0;
      state_q <= IDLE;
    end
  end

endmodule

`default_nettype wire
