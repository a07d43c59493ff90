// odd_registers: registers on the bus of the link.
//
// Generated from tb/devices/odd_registers.toml by scripts/generate.py; docs/registers.md lists
// them and says how they behave.
//
// A memory has the rule of each address; the value is compared with the rule's bounds, a register
// takes it, and all are read through the sixteen words of a page and then the page.  So what a
// WRITE answers has been read back.  The registers stand all over the die, so what goes to many of
// them, data, selection and reset, comes from registers near them.
//
//   rst_i         works a clock later; each group of settings has a register of its own for it, so
//                 that no net resets all of them
//   bus_valid_i   ignored from the clock after it until bus_done_o
//   bus_access_i  link_pkg; CHECK says what WRITE would, and changes nothing; 3 is as READ
//   bus_status_o  with bus_done_o, the first that applies: StatusNoAddress, StatusReadOnly,
//                 StatusLocked, StatusBusy, StatusBadValue, StatusOk
//   bus_data_o    with bus_done_o, the word as it is read; 0 unless OK
//   *_o           structs of odd_registers_pkg: what the bus has written, 7 clocks after
//                 bus_valid_i; a field *_strobe is high in the first clock in which its register
//                 has what was written
//   *_i           structs, too: a READ sees them 10 clocks after bus_valid_i
//   Wide ones     take effect with their higher word; until then the lower one waits, and is read
//                 as written.  The READ of a lower word of *_i keeps the higher one for its READ
//   Tables        an entry goes out with its last field and with *_write, the others are those
//                 written before; a reset leaves what was written for the bus to read
//   Two banks     of a table elsewhere: an entry goes out with *_write, to bank *_access_bank, and
//                 *_read of *_index comes back, 5 clocks behind a write as it was written.
//                 StatusBusy is also for a write into the bank in use
//   waiting_i ..  of commit_control.  What waits goes out 2 clocks after take_i.  Entries of
//                 waiting tables go out 2 clocks after copy_i, into the bank that is not
//                 bank_i's.  StatusBusy is for waiting_i
//   Latency       14 clocks from bus_valid_i to bus_done_o
//   Model         vrscan.clocked.register_file, bit-exact

`default_nettype none

module odd_registers (
  input  wire logic                               clk_i,
  input  wire logic                               rst_i,

  input  wire logic                               bus_valid_i,
  input  wire logic [link_pkg::AccessWidth-1:0]   bus_access_i,
  input  wire logic [link_pkg::AddressWidth-1:0]  bus_address_i,
  input  wire logic [31:0]                        bus_data_i,
  output      logic                               bus_done_o,
  output      logic [link_pkg::StatusWidth-1:0]   bus_status_o,
  output      logic [31:0]                        bus_data_o,

  output      odd_registers_pkg::wide_t           wide_o,
  input  wire odd_registers_pkg::read_t           read_i,
  output      odd_registers_pkg::locks_t          locks_o,
  output      odd_registers_pkg::held_t           held_o,
  output      odd_registers_pkg::access_t         access_o,
  output      odd_registers_pkg::commit_t         commit_o,
  output      odd_registers_pkg::written_t        written_o,
  output      odd_registers_pkg::held_table_t     held_table_o,
  input  wire odd_registers_pkg::elsewhere_status_t elsewhere_status_i,
  output      odd_registers_pkg::elsewhere_t      elsewhere_o,
  output      odd_registers_pkg::single_t         single_o,
  output      odd_registers_pkg::triple_t         triple_o,

  input  wire logic                               waiting_i,
  input  wire logic                               copy_i,
  input  wire logic [3:0]                         copy_index_i,
  input  wire logic                               bank_i,
  input  wire logic                               take_i
);

  // ---- the reset, once for each group of settings ----
  logic rst;
  local_register u_reset (.clk_i, .d_i(rst_i), .q_o(rst));
  logic wide_rst;
  local_register u_wide_reset (.clk_i, .d_i(rst_i), .q_o(wide_rst));
  logic locks_rst;
  local_register u_locks_reset (.clk_i, .d_i(rst_i), .q_o(locks_rst));
  logic held_rst;
  local_register u_held_reset (.clk_i, .d_i(rst_i), .q_o(held_rst));
  logic access_rst;
  local_register u_access_reset (.clk_i, .d_i(rst_i), .q_o(access_rst));
  logic commit_rst;
  local_register u_commit_reset (.clk_i, .d_i(rst_i), .q_o(commit_rst));
  logic written_rst;
  local_register u_written_reset (.clk_i, .d_i(rst_i), .q_o(written_rst));

  // ---- an access, and how far it is ----
  logic [13:1] step_q;
  logic [link_pkg::AccessWidth-1:0] access_q;
  logic [link_pkg::AddressWidth-1:0] address_q;
  logic [31:0] data_q;
  logic start, read, write_q;
  assign start = bus_valid_i && step_q == '0;
  assign read = access_q != link_pkg::AccessWidth'(link_pkg::AccessCheck)
                && access_q != link_pkg::AccessWidth'(link_pkg::AccessWrite);
  always_ff @(posedge clk_i) begin
    step_q <= {step_q[12:1], start};
    if (start) begin
      access_q  <= bus_access_i;
      address_q <= bus_address_i;
      data_q    <= bus_data_i;
    end
    if (rst) step_q <= '0;
  end

  // ---- 1: look up the rule; 2: take it.  Its bounds are signed, hence the 33 bits ----
  localparam logic [1:0] KindNone = 2'd0;
  localparam logic [1:0] KindReadOnly = 2'd1;
  localparam logic [1:0] KindReadWrite = 2'd2;
  typedef struct packed {
    logic [1:0] kind;
    logic commit;
    logic [2:0] lock;
    logic signed [32:0] minimum;
    logic signed [32:0] maximum;
  } rule_t;
  logic [71:0] rule_mem[1024];
  logic [71:0] map_rule_q;
  logic map_hit_q;
  rule_t rule_q;
  logic held_table_hit_q;
  logic [3:0] held_table_index;
  assign held_table_index = address_q[4:1];
  logic elsewhere_hit_q;
  logic [3:0] elsewhere_index;
  assign elsewhere_index = address_q[3:0];
  logic single_hit_q;
  logic [2:0] single_index;
  assign single_index = address_q[2:0];
  logic triple_hit_q;
  logic [2:0] triple_index;
  assign triple_index = address_q[4:2];
  always_ff @(posedge clk_i) begin
    map_rule_q <= rule_mem[address_q[9:0]];
    map_hit_q  <= address_q[15:10] == '0;
    held_table_hit_q <= address_q[15:5] == 11'h040;
    elsewhere_hit_q <= address_q[15:4] == 12'h100 && elsewhere_index <= 4'd12;
    single_hit_q <= address_q[15:3] == 13'h0080 && single_index <= 3'd4;
    triple_hit_q <= address_q[15:5] == 11'h7ff;
    rule_q <= map_hit_q ? map_rule_q : '0;
    if (held_table_hit_q)
      case (address_q[0:0])
        1'h0: rule_q <=
          {KindReadWrite, 1'd1, 3'd0, 33'h180000000, 33'h07fffffff};
        1'h1: rule_q <=
          {KindReadWrite, 1'd1, 3'd0, 33'h000000000, 33'h000000007};
        default: rule_q <= '0;
      endcase
    if (elsewhere_hit_q) rule_q <= {KindReadWrite, 1'd1, 3'd0, 33'h1ffffff00, 33'h0000000ff};
    if (single_hit_q) rule_q <= {KindReadWrite, 1'd0, 3'd0, 33'h1fffffff7, 33'h07fffffff};
    if (triple_hit_q)
      case (address_q[1:0])
        2'h0: rule_q <=
          {KindReadWrite, 1'd0, 3'd4, 33'h000000000, 33'h0ffffffff};
        2'h1: rule_q <=
          {KindReadWrite, 1'd0, 3'd4, 33'h1ffffffc4, 33'h00000003f};
        2'h2: rule_q <=
          {KindReadWrite, 1'd0, 3'd4, 33'h000000000, 33'h000000001};
        default: rule_q <= '0;
      endcase
  end

  // ---- 3: against the rule; 4: the verdict ----
  logic [7:0] locks;
  assign locks = {3'd0, locks_o.lock_d, locks_o.lock_c, locks_o.lock_b, locks_o.lock_a, 1'b0};
  logic signed [32:0] value;
  assign value = signed'({rule_q.minimum[32] && data_q[31], data_q});
  logic [1:0] kind_q;
  logic below_q, above_q, locked_q, busy_q;
  logic [link_pkg::StatusWidth-1:0] verdict, status_q;
  always_comb begin
    verdict = link_pkg::StatusWidth'(link_pkg::StatusOk);
    if (kind_q == KindNone)
      verdict = link_pkg::StatusWidth'(link_pkg::StatusNoAddress);
    else if (!read && kind_q == KindReadOnly)
      verdict = link_pkg::StatusWidth'(link_pkg::StatusReadOnly);
    else if (!read && locked_q)
      verdict = link_pkg::StatusWidth'(link_pkg::StatusLocked);
    else if (busy_q)
      verdict = link_pkg::StatusWidth'(link_pkg::StatusBusy);
    else if (!read && (below_q || above_q))
      verdict = link_pkg::StatusWidth'(link_pkg::StatusBadValue);
  end
  always_ff @(posedge clk_i) begin
    kind_q   <= rule_q.kind;
    below_q  <= value < rule_q.minimum;
    above_q  <= value > rule_q.maximum;
    locked_q <= locks[rule_q.lock];
    busy_q <= rule_q.commit && waiting_i && (!read || held_table_hit_q || elsewhere_hit_q);
    if (!read && elsewhere_hit_q && access_o.access_bank == held_o.held_bank) busy_q <= 1'b1;
    // What an access changes judges the next: a commit waits from its own write on.
    if (step_q[4]) status_q <= verdict;
    write_q  <= step_q[4] && access_q == link_pkg::AccessWidth'(link_pkg::AccessWrite)
                && verdict == link_pkg::StatusWidth'(link_pkg::StatusOk);
    if (rst) write_q <= 1'b0;
  end

  // ---- 2: which page, which of its words, for writing and for reading ----
  logic page_00_hit_q;
  logic page_10_hit_q;
  logic page_11_hit_q;
  logic page_12_hit_q;
  logic page_13_hit_q;
  logic page_14_hit_q;
  logic page_1f_hit_q;
  logic page_20_hit_q;
  logic page_3f_hit_q;
  logic [15:0] word_hit_q;
  always_ff @(posedge clk_i) begin
    page_00_hit_q <= address_q[15:4] == 12'h000;
    page_10_hit_q <= address_q[15:4] == 12'h010;
    page_11_hit_q <= address_q[15:4] == 12'h011;
    page_12_hit_q <= address_q[15:4] == 12'h012;
    page_13_hit_q <= address_q[15:4] == 12'h013;
    page_14_hit_q <= address_q[15:4] == 12'h014;
    page_1f_hit_q <= address_q[15:4] == 12'h01f;
    page_20_hit_q <= address_q[15:4] == 12'h020;
    page_3f_hit_q <= address_q[15:4] == 12'h03f;
    for (int unsigned k = 0; k < 16; k++)
      word_hit_q[k] <= address_q[3:0] == 4'(k);
  end

  // ---- 5: which register; 6: it takes the word ----
  logic [38:0] take_q;
  logic write_q2;
  always_ff @(posedge clk_i) begin
    write_q2 <= write_q;
    if (rst) write_q2 <= 1'b0;
    take_q[0] <= write_q && page_00_hit_q && word_hit_q[0] && !rst;
    take_q[1] <= write_q && page_00_hit_q && word_hit_q[1] && !rst;
    take_q[2] <= write_q && page_00_hit_q && word_hit_q[2] && !rst;
    take_q[3] <= write_q && page_00_hit_q && word_hit_q[3] && !rst;
    take_q[4] <= write_q && page_00_hit_q && word_hit_q[4] && !rst;
    take_q[5] <= write_q && page_00_hit_q && word_hit_q[5] && !rst;
    take_q[6] <= write_q && page_10_hit_q && word_hit_q[14] && !rst;
    take_q[7] <= write_q && page_10_hit_q && word_hit_q[15] && !rst;
    take_q[8] <= write_q && page_11_hit_q && word_hit_q[0] && !rst;
    take_q[9] <= write_q && page_11_hit_q && word_hit_q[1] && !rst;
    take_q[10] <= write_q && page_12_hit_q && word_hit_q[0] && !rst;
    take_q[11] <= write_q && page_12_hit_q && word_hit_q[1] && !rst;
    take_q[12] <= write_q && page_12_hit_q && word_hit_q[2] && !rst;
    take_q[13] <= write_q && page_12_hit_q && word_hit_q[3] && !rst;
    take_q[14] <= write_q && page_12_hit_q && word_hit_q[4] && !rst;
    take_q[15] <= write_q && page_12_hit_q && word_hit_q[5] && !rst;
    take_q[16] <= write_q && page_12_hit_q && word_hit_q[6] && !rst;
    take_q[17] <= write_q && page_13_hit_q && word_hit_q[0] && !rst;
    take_q[18] <= write_q && page_14_hit_q && word_hit_q[0] && !rst;
    take_q[19] <= write_q && page_1f_hit_q && word_hit_q[12] && !rst;
    take_q[20] <= write_q && page_1f_hit_q && word_hit_q[13] && !rst;
    take_q[21] <= write_q && page_1f_hit_q && word_hit_q[14] && !rst;
    take_q[22] <= write_q && page_1f_hit_q && word_hit_q[15] && !rst;
    take_q[23] <= write_q && page_20_hit_q && word_hit_q[0] && !rst;
    take_q[24] <= write_q && page_20_hit_q && word_hit_q[1] && !rst;
    take_q[25] <= write_q && page_20_hit_q && word_hit_q[2] && !rst;
    take_q[26] <= write_q && page_20_hit_q && word_hit_q[3] && !rst;
    take_q[27] <= write_q && page_20_hit_q && word_hit_q[4] && !rst;
    take_q[28] <= write_q && page_20_hit_q && word_hit_q[5] && !rst;
    take_q[29] <= write_q && page_20_hit_q && word_hit_q[6] && !rst;
    take_q[30] <= write_q && page_20_hit_q && word_hit_q[7] && !rst;
    take_q[31] <= write_q && page_20_hit_q && word_hit_q[8] && !rst;
    take_q[32] <= write_q && page_20_hit_q && word_hit_q[9] && !rst;
    take_q[33] <= write_q && page_20_hit_q && word_hit_q[10] && !rst;
    take_q[34] <= write_q && page_20_hit_q && word_hit_q[11] && !rst;
    take_q[35] <= write_q && page_20_hit_q && word_hit_q[12] && !rst;
    take_q[36] <= write_q && page_20_hit_q && word_hit_q[13] && !rst;
    take_q[37] <= write_q && page_20_hit_q && word_hit_q[14] && !rst;
    take_q[38] <= write_q && page_20_hit_q && word_hit_q[15] && !rst;
  end

  logic [31:0] wide_data;
  local_register #(.Width(32)) u_wide_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(wide_data)
  );
  logic [0:0] locks_data;
  local_register #(.Width(1)) u_locks_data (
    .clk_i, .d_i(data_q[0:0]), .q_o(locks_data)
  );
  logic [31:0] held_data;
  local_register #(.Width(32)) u_held_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(held_data)
  );
  logic [0:0] access_data;
  local_register #(.Width(1)) u_access_data (
    .clk_i, .d_i(data_q[0:0]), .q_o(access_data)
  );
  logic [0:0] commit_data;
  local_register #(.Width(1)) u_commit_data (
    .clk_i, .d_i(data_q[0:0]), .q_o(commit_data)
  );
  logic [31:0] written_data;
  local_register #(.Width(32)) u_written_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(written_data)
  );
  logic [31:0] longer_low_q;
  logic [31:0] longest_low_q;
  logic [31:0] negative_long_low_q;
  logic [31:0] held_long_low_q;
  odd_registers_pkg::held_t held_q;
  logic held_take, held_taken_rst;
  local_register #(.Width(2)) u_held_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({held_take, held_taken_rst})
  );
  logic held_long_take, held_long_taken_rst;
  local_register #(.Width(2)) u_held_long_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({held_long_take, held_long_taken_rst})
  );
  logic held_several_take, held_several_taken_rst;
  local_register #(.Width(2)) u_held_several_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({held_several_take, held_several_taken_rst})
  );
  logic held_bank_take, held_bank_taken_rst;
  local_register #(.Width(2)) u_held_bank_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({held_bank_take, held_bank_taken_rst})
  );
  always_ff @(posedge clk_i) begin
    commit_o.commit_strobe <= take_q[18];
    written_o.hit_strobe <= take_q[27];
    written_o.signal_strobe <= take_q[28];
    if (take_q[0]) longer_low_q <= wide_data;
    if (take_q[1]) wide_o.longer <= {wide_data[0:0], longer_low_q};
    if (take_q[2]) longest_low_q <= wide_data;
    if (take_q[3]) wide_o.longest <= {wide_data[31:0], longest_low_q};
    if (take_q[4]) negative_long_low_q <= wide_data;
    if (take_q[5]) wide_o.negative_long <= {wide_data[7:0], negative_long_low_q};
    if (take_q[6]) locks_o.lock_a <= locks_data[0];
    if (take_q[7]) locks_o.lock_b <= locks_data[0];
    if (take_q[8]) locks_o.lock_c <= locks_data[0];
    if (take_q[9]) locks_o.lock_d <= locks_data[0];
    if (take_q[10]) held_q.held <= signed'(held_data[8:0]);
    if (take_q[11]) held_long_low_q <= held_data;
    if (take_q[12]) held_q.held_long <= {held_data[7:0], held_long_low_q};
    if (take_q[13]) held_q.held_several[0+:6] <= held_data[5:0];
    if (take_q[14]) held_q.held_several[6+:6] <= held_data[5:0];
    if (take_q[15]) held_q.held_several[12+:6] <= held_data[5:0];
    if (take_q[16]) held_q.held_bank <= held_data[0];
    if (take_q[17]) access_o.access_bank <= access_data[0];
    if (take_q[18]) commit_o.commit <= commit_data[0];
    if (take_q[19]) written_o.sole <= written_data[0];
    if (take_q[20]) written_o.word <= written_data;
    if (take_q[21]) written_o.little <= signed'(written_data[4:0]);
    if (take_q[22]) written_o.bounded <= written_data[11:0];
    if (take_q[23]) written_o.centred <= signed'(written_data[11:0]);
    if (take_q[24]) written_o.below <= signed'(written_data);
    if (take_q[25]) written_o.above <= signed'(written_data);
    if (take_q[26]) written_o.late <= written_data[3:0];
    if (take_q[27]) written_o.hit <= written_data[2:0];
    if (take_q[28]) written_o.signal <= signed'(written_data);
    if (take_q[29]) written_o.bits[0+:1] <= written_data[0];
    if (take_q[30]) written_o.bits[1+:1] <= written_data[0];
    if (take_q[31]) written_o.bits[2+:1] <= written_data[0];
    if (take_q[32]) written_o.bits[3+:1] <= written_data[0];
    if (take_q[33]) written_o.bits[4+:1] <= written_data[0];
    if (take_q[34]) written_o.several[0+:17] <= written_data[16:0];
    if (take_q[35]) written_o.several[17+:17] <= written_data[16:0];
    if (take_q[36]) written_o.several[34+:17] <= written_data[16:0];
    if (take_q[37]) written_o.words[0+:32] <= written_data;
    if (take_q[38]) written_o.words[32+:32] <= written_data;
    if (wide_rst) begin
      longer_low_q <= odd_registers_pkg::ResetLonger[31:0];
      wide_o.longer <= odd_registers_pkg::ResetLonger;
      longest_low_q <= odd_registers_pkg::ResetLongest[31:0];
      wide_o.longest <= odd_registers_pkg::ResetLongest;
      negative_long_low_q <= odd_registers_pkg::ResetNegativeLong[31:0];
      wide_o.negative_long <= odd_registers_pkg::ResetNegativeLong;
    end
    if (locks_rst) begin
      locks_o.lock_a <= odd_registers_pkg::ResetLockA;
      locks_o.lock_b <= odd_registers_pkg::ResetLockB;
      locks_o.lock_c <= odd_registers_pkg::ResetLockC;
      locks_o.lock_d <= odd_registers_pkg::ResetLockD;
    end
    if (held_take) held_o.held <= held_q.held;
    if (held_taken_rst) begin
      held_o.held <= odd_registers_pkg::ResetHeld;
    end
    if (held_long_take) held_o.held_long <= held_q.held_long;
    if (held_long_taken_rst) begin
      held_o.held_long <= odd_registers_pkg::ResetHeldLong;
    end
    if (held_several_take) held_o.held_several <= held_q.held_several;
    if (held_several_taken_rst) begin
      held_o.held_several <= odd_registers_pkg::ResetHeldSeveral;
    end
    if (held_bank_take) held_o.held_bank <= held_q.held_bank;
    if (held_bank_taken_rst) begin
      held_o.held_bank <= odd_registers_pkg::ResetHeldBank;
    end
    if (held_rst) begin
      held_q.held <= odd_registers_pkg::ResetHeld;
      held_long_low_q <= odd_registers_pkg::ResetHeldLong[31:0];
      held_q.held_long <= odd_registers_pkg::ResetHeldLong;
      held_q.held_several <= odd_registers_pkg::ResetHeldSeveral;
      held_q.held_bank <= odd_registers_pkg::ResetHeldBank;
    end
    if (access_rst) begin
      access_o.access_bank <= odd_registers_pkg::ResetAccessBank;
    end
    if (commit_rst) begin
      commit_o.commit <= odd_registers_pkg::ResetCommit;
      commit_o.commit_strobe <= 1'b0;
    end
    if (written_rst) begin
      written_o.sole <= odd_registers_pkg::ResetSole;
      written_o.word <= odd_registers_pkg::ResetWord;
      written_o.little <= odd_registers_pkg::ResetLittle;
      written_o.bounded <= odd_registers_pkg::ResetBounded;
      written_o.centred <= odd_registers_pkg::ResetCentred;
      written_o.below <= odd_registers_pkg::ResetBelow;
      written_o.above <= odd_registers_pkg::ResetAbove;
      written_o.late <= odd_registers_pkg::ResetLate;
      written_o.hit <= odd_registers_pkg::ResetHit;
      written_o.hit_strobe <= 1'b0;
      written_o.signal <= odd_registers_pkg::ResetSignal;
      written_o.signal_strobe <= 1'b0;
      written_o.bits <= odd_registers_pkg::ResetBits;
      written_o.several <= odd_registers_pkg::ResetSeveral;
      written_o.words <= odd_registers_pkg::ResetWords;
    end
  end

  // ---- held_table: written at 6, read back at 7 and 8 ----
  logic held_table_copy_q;
  logic [3:0] held_table_entry, held_table_entry_q;
  assign held_table_entry = copy_i ? copy_index_i[3:0] : held_table_index;
  logic [31:0] held_table_left_mem[16];
  logic [31:0] held_table_left_q;
  logic [2:0] held_table_right_mem[16];
  logic [2:0] held_table_right_q;
  // What the bus reads of an entry that it has not written.
  initial for (int k = 0; k < 16; k = k + 1) begin
    held_table_left_mem[k] = odd_registers_pkg::ResetHeldTableLeft[32 * k+:32];
    held_table_right_mem[k] = odd_registers_pkg::ResetHeldTableRight[3 * k+:3];
  end
  logic [31:0] held_table_read_q;
  always_ff @(posedge clk_i) begin
    if (write_q2 && held_table_hit_q && address_q[0:0] == 1'h0 && !rst)
      held_table_left_mem[held_table_entry] <= data_q[31:0];
    held_table_left_q <= held_table_left_mem[held_table_entry];
    if (write_q2 && held_table_hit_q && address_q[0:0] == 1'h1 && !rst)
      held_table_right_mem[held_table_entry] <= data_q[2:0];
    held_table_right_q <= held_table_right_mem[held_table_entry];
    held_table_copy_q  <= copy_i && !rst;
    held_table_entry_q <= held_table_entry;
    held_table_o.held_table_write      <= held_table_copy_q;
    held_table_o.held_table_index      <= held_table_entry_q;
    held_table_o.held_table_write_bank <= !bank_i;
    held_table_o.held_table_bank       <= bank_i;
    if (take_i) held_table_o.held_table_changed <= 1'b0;
    if (write_q2 && held_table_hit_q) held_table_o.held_table_changed <= 1'b1;
    if (rst) held_table_o.held_table_changed <= 1'b0;
    held_table_o.held_table_left <= signed'(held_table_left_q);
    held_table_o.held_table_right <= held_table_right_q;
    case (address_q[0:0])
      1'h0: held_table_read_q <= held_table_left_q;
      1'h1: held_table_read_q <= 32'(held_table_right_q);
      default: held_table_read_q <= '0;
    endcase
    if (rst) held_table_o.held_table_write <= 1'b0;
  end

  // ---- elsewhere: goes out at 6, comes back at 12 ----
  logic [31:0] elsewhere_read_q;
  always_ff @(posedge clk_i) begin
    elsewhere_o.elsewhere_write       <= write_q2 && elsewhere_hit_q && !rst;
    elsewhere_o.elsewhere_access_bank <= access_o.access_bank;
    elsewhere_o.elsewhere_index       <= elsewhere_index;
    elsewhere_o.elsewhere_node <= signed'(data_q[8:0]);
    elsewhere_read_q <= 32'(signed'(elsewhere_status_i.elsewhere_read));
  end

  // ---- single: written at 6, read back at 7 and 8 ----
  logic [31:0] single_value_mem[8];
  logic [31:0] single_value_q;
  // What the bus reads of an entry that it has not written.
  initial for (int k = 0; k < 8; k = k + 1) begin
    single_value_mem[k] = odd_registers_pkg::ResetSingleValue[32 * k+:32];
  end
  logic [31:0] single_read_q;
  always_ff @(posedge clk_i) begin
    if (write_q2 && single_hit_q && !rst)
      single_value_mem[single_index] <= data_q[31:0];
    single_value_q <= single_value_mem[single_index];
    single_o.single_write <= 1'b0;
    if (write_q2 && single_hit_q) begin
      single_o.single_write <= 1'b1;
      single_o.single_index <= single_index;
      single_o.single_value <= signed'(data_q[31:0]);
    end
    single_read_q <= single_value_q;
    if (rst) single_o.single_write <= 1'b0;
  end

  // ---- triple: written at 6, read back at 7 and 8 ----
  logic [31:0] triple_low_mem[8];
  logic [31:0] triple_low_q, triple_low_q2;
  logic [6:0] triple_middle_mem[8];
  logic [6:0] triple_middle_q, triple_middle_q2;
  logic [0:0] triple_high_mem[8];
  logic [0:0] triple_high_q;
  // What the bus reads of an entry that it has not written.
  initial for (int k = 0; k < 8; k = k + 1) begin
    triple_low_mem[k] = odd_registers_pkg::ResetTripleLow[32 * k+:32];
    triple_middle_mem[k] = odd_registers_pkg::ResetTripleMiddle[7 * k+:7];
    triple_high_mem[k] = odd_registers_pkg::ResetTripleHigh[1 * k+:1];
  end
  logic [31:0] triple_read_q;
  always_ff @(posedge clk_i) begin
    if (write_q2 && triple_hit_q && address_q[1:0] == 2'h0 && !rst)
      triple_low_mem[triple_index] <= data_q[31:0];
    triple_low_q <= triple_low_mem[triple_index];
    triple_low_q2 <= triple_low_q;
    if (write_q2 && triple_hit_q && address_q[1:0] == 2'h1 && !rst)
      triple_middle_mem[triple_index] <= data_q[6:0];
    triple_middle_q <= triple_middle_mem[triple_index];
    triple_middle_q2 <= triple_middle_q;
    if (write_q2 && triple_hit_q && address_q[1:0] == 2'h2 && !rst)
      triple_high_mem[triple_index] <= data_q[0:0];
    triple_high_q <= triple_high_mem[triple_index];
    triple_o.triple_write <= 1'b0;
    if (write_q2 && triple_hit_q && address_q[1:0] == 2'h2) begin
      triple_o.triple_write <= 1'b1;
      triple_o.triple_index <= triple_index;
      triple_o.triple_low <= triple_low_q2;
      triple_o.triple_middle <= signed'(triple_middle_q2);
      triple_o.triple_high <= data_q[0:0];
    end
    case (address_q[1:0])
      2'h0: triple_read_q <= triple_low_q;
      2'h1: triple_read_q <= 32'(signed'(triple_middle_q));
      2'h2: triple_read_q <= 32'(triple_high_q);
      default: triple_read_q <= '0;
    endcase
    if (rst) triple_o.triple_write <= 1'b0;
  end

  // ---- 10: half a page's words, wide ones whole; 11: a page ----
  logic [31:0] clock_high_q;
  logic [12:0] place_high_q;
  logic [1:0] keep_q;
  always_ff @(posedge clk_i) begin
    keep_q[0] <= step_q[9] && read && page_10_hit_q && word_hit_q[6];
    if (keep_q[0]) clock_high_q <= read_i.clock[63:32];
    keep_q[1] <= step_q[9] && read && page_10_hit_q && word_hit_q[8];
    if (keep_q[1]) place_high_q <= read_i.place[44:32];
    if (rst) begin
      keep_q <= '0;
      clock_high_q <= '0;
      place_high_q <= '0;
    end
  end

  logic [31:0] page_00_q;
  logic [2:0] page_00_word;
  local_register #(.Width(3)) u_page_00_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_00_word)
  );
  logic [31:0] page_00_low_q;
  always_ff @(posedge clk_i) begin
    case (page_00_word[2:0])
      3'h0: page_00_low_q <= longer_low_q;
      3'h1: page_00_low_q <= 32'(wide_o.longer[32:32]);
      3'h2: page_00_low_q <= longest_low_q;
      3'h3: page_00_low_q <= wide_o.longest[63:32];
      3'h4: page_00_low_q <= unsigned'(negative_long_low_q);
      default: page_00_low_q <= 32'(signed'(wide_o.negative_long[39:32]));
    endcase
    page_00_q <= page_00_low_q;
    if (!page_00_hit_q) page_00_q <= '0;
  end

  logic [31:0] page_10_q;
  logic [3:0] page_10_word;
  local_register #(.Width(4)) u_page_10_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_10_word)
  );
  logic [31:0] page_10_low_q;
  logic [31:0] page_10_high_q;
  always_ff @(posedge clk_i) begin
    case (page_10_word[2:0])
      3'h0: page_10_low_q <= 32'(read_i.count);
      3'h1: page_10_low_q <= 32'(read_i.level);
      3'h2: page_10_low_q <= 32'(read_i.flag);
      3'h3: page_10_low_q <= 32'(signed'(read_i.levels[0+:11]));
      3'h4: page_10_low_q <= 32'(signed'(read_i.levels[11+:11]));
      3'h5: page_10_low_q <= 32'(signed'(read_i.levels[22+:11]));
      3'h6: page_10_low_q <= read_i.clock[31:0];
      default: page_10_low_q <= clock_high_q;
    endcase
    case (page_10_word[2:0])
      3'h0: page_10_high_q <= unsigned'(read_i.place[31:0]);
      3'h1: page_10_high_q <= 32'(signed'(place_high_q));
      3'h2: page_10_high_q <= unsigned'(read_i.raw);
      3'h6: page_10_high_q <= 32'(locks_o.lock_a);
      default: page_10_high_q <= 32'(locks_o.lock_b);
    endcase
    page_10_q <= page_10_word[3] ? page_10_high_q : page_10_low_q;
    if (!page_10_hit_q) page_10_q <= '0;
  end

  logic [31:0] page_11_q;
  logic [2:0] page_11_word;
  local_register #(.Width(3)) u_page_11_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_11_word)
  );
  logic [31:0] page_11_low_q;
  always_ff @(posedge clk_i) begin
    case (page_11_word[2:0])
      3'h0: page_11_low_q <= 32'(locks_o.lock_c);
      default: page_11_low_q <= 32'(locks_o.lock_d);
    endcase
    page_11_q <= page_11_low_q;
    if (!page_11_hit_q) page_11_q <= '0;
  end

  logic [31:0] page_12_q;
  logic [2:0] page_12_word;
  local_register #(.Width(3)) u_page_12_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_12_word)
  );
  logic [31:0] page_12_low_q;
  always_ff @(posedge clk_i) begin
    case (page_12_word[2:0])
      3'h0: page_12_low_q <= 32'(held_q.held);
      3'h1: page_12_low_q <= held_long_low_q;
      3'h2: page_12_low_q <= 32'(held_q.held_long[39:32]);
      3'h3: page_12_low_q <= 32'(held_q.held_several[0+:6]);
      3'h4: page_12_low_q <= 32'(held_q.held_several[6+:6]);
      3'h5: page_12_low_q <= 32'(held_q.held_several[12+:6]);
      default: page_12_low_q <= 32'(held_q.held_bank);
    endcase
    page_12_q <= page_12_low_q;
    if (!page_12_hit_q) page_12_q <= '0;
  end

  logic [31:0] page_13_q;
  logic [2:0] page_13_word;
  local_register #(.Width(3)) u_page_13_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_13_word)
  );
  logic [31:0] page_13_low_q;
  always_ff @(posedge clk_i) begin
    page_13_low_q <= 32'(access_o.access_bank);
    page_13_q <= page_13_low_q;
    if (!page_13_hit_q) page_13_q <= '0;
  end

  logic [31:0] page_14_q;
  logic [2:0] page_14_word;
  local_register #(.Width(3)) u_page_14_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_14_word)
  );
  logic [31:0] page_14_low_q;
  always_ff @(posedge clk_i) begin
    page_14_low_q <= 32'(commit_o.commit);
    page_14_q <= page_14_low_q;
    if (!page_14_hit_q) page_14_q <= '0;
  end

  logic [31:0] page_1f_q;
  logic [2:0] page_1f_word;
  local_register #(.Width(3)) u_page_1f_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_1f_word)
  );
  logic [31:0] page_1f_high_q;
  always_ff @(posedge clk_i) begin
    case (page_1f_word[2:0])
      3'h4: page_1f_high_q <= 32'(written_o.sole);
      3'h5: page_1f_high_q <= written_o.word;
      3'h6: page_1f_high_q <= 32'(written_o.little);
      default: page_1f_high_q <= 32'(written_o.bounded);
    endcase
    page_1f_q <= page_1f_high_q;
    if (!page_1f_hit_q) page_1f_q <= '0;
  end

  logic [31:0] page_20_q;
  logic [3:0] page_20_word;
  local_register #(.Width(4)) u_page_20_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_20_word)
  );
  logic [31:0] page_20_low_q;
  logic [31:0] page_20_high_q;
  always_ff @(posedge clk_i) begin
    case (page_20_word[2:0])
      3'h0: page_20_low_q <= 32'(written_o.centred);
      3'h1: page_20_low_q <= unsigned'(written_o.below);
      3'h2: page_20_low_q <= unsigned'(written_o.above);
      3'h3: page_20_low_q <= 32'(written_o.late);
      3'h4: page_20_low_q <= 32'(written_o.hit);
      3'h5: page_20_low_q <= unsigned'(written_o.signal);
      3'h6: page_20_low_q <= 32'(written_o.bits[0+:1]);
      default: page_20_low_q <= 32'(written_o.bits[1+:1]);
    endcase
    case (page_20_word[2:0])
      3'h0: page_20_high_q <= 32'(written_o.bits[2+:1]);
      3'h1: page_20_high_q <= 32'(written_o.bits[3+:1]);
      3'h2: page_20_high_q <= 32'(written_o.bits[4+:1]);
      3'h3: page_20_high_q <= 32'(signed'(written_o.several[0+:17]));
      3'h4: page_20_high_q <= 32'(signed'(written_o.several[17+:17]));
      3'h5: page_20_high_q <= 32'(signed'(written_o.several[34+:17]));
      3'h6: page_20_high_q <= written_o.words[0+:32];
      default: page_20_high_q <= written_o.words[32+:32];
    endcase
    page_20_q <= page_20_word[3] ? page_20_high_q : page_20_low_q;
    if (!page_20_hit_q) page_20_q <= '0;
  end

  logic [31:0] page_3f_q;
  logic [2:0] page_3f_word;
  local_register #(.Width(3)) u_page_3f_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_3f_word)
  );
  logic [31:0] page_3f_high_q;
  always_ff @(posedge clk_i) begin
    case (page_3f_word[2:0])
      3'h0: page_3f_high_q <= 32'h000000c8;
      3'h1: page_3f_high_q <= 32'hfffffffd;
      3'h2: page_3f_high_q <= 32'hb4673c14;
      default: page_3f_high_q <= 32'h00000100;
    endcase
    page_3f_q <= page_3f_high_q;
    if (!page_3f_hit_q) page_3f_q <= '0;
  end

  // ---- 12: the page, the only one that is not 0; 13: the answer ----
  logic [31:0] read_q;
  always_ff @(posedge clk_i)
    read_q <= page_00_q
              | page_10_q
              | page_11_q
              | page_12_q
              | page_13_q
              | page_14_q
              | page_1f_q
              | page_20_q
              | page_3f_q;

  always_ff @(posedge clk_i) begin
    bus_done_o   <= step_q[13];
    bus_status_o <= status_q;
    bus_data_o   <= read_q;
    if (held_table_hit_q) bus_data_o <= held_table_read_q;
    if (elsewhere_hit_q) bus_data_o <= elsewhere_read_q;
    if (single_hit_q) bus_data_o <= single_read_q;
    if (triple_hit_q) bus_data_o <= triple_read_q;
    if (status_q != link_pkg::StatusWidth'(link_pkg::StatusOk)) bus_data_o <= '0;
    if (rst) bus_done_o <= 1'b0;
  end

  // ---- the rules, by address ----
  initial begin
    for (int k = 0; k < 1024; k = k + 1) rule_mem[k] = '0;
    // longer, word 0
    rule_mem[0] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h0ffffffff};
    // longer, word 1
    rule_mem[1] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // longest, word 0
    rule_mem[2] = {KindReadWrite, 1'd0, 3'd1, 33'h000000000, 33'h0ffffffff};
    // longest, word 1
    rule_mem[3] = {KindReadWrite, 1'd0, 3'd1, 33'h000000000, 33'h0ffffffff};
    // negative_long, word 0
    rule_mem[4] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h0ffffffff};
    // negative_long, word 1
    rule_mem[5] = {KindReadWrite, 1'd0, 3'd0, 33'h1ffffff80, 33'h00000007f};
    // count
    rule_mem[256] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // level
    rule_mem[257] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // flag
    rule_mem[258] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // levels[0]
    rule_mem[259] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // levels[1]
    rule_mem[260] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // levels[2]
    rule_mem[261] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // clock, word 0
    rule_mem[262] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // clock, word 1
    rule_mem[263] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // place, word 0
    rule_mem[264] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // place, word 1
    rule_mem[265] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // raw
    rule_mem[266] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // lock_a
    rule_mem[270] = {KindReadWrite, 1'd0, 3'd0, 33'h000000001, 33'h000000001};
    // lock_b
    rule_mem[271] = {KindReadWrite, 1'd0, 3'd0, 33'h000000001, 33'h000000001};
    // lock_c
    rule_mem[272] = {KindReadWrite, 1'd0, 3'd0, 33'h000000001, 33'h000000001};
    // lock_d
    rule_mem[273] = {KindReadWrite, 1'd0, 3'd0, 33'h000000001, 33'h000000001};
    // held
    rule_mem[288] = {KindReadWrite, 1'd1, 3'd1, 33'h1ffffff00, 33'h0000000ff};
    // held_long, word 0
    rule_mem[289] = {KindReadWrite, 1'd1, 3'd1, 33'h000000000, 33'h0ffffffff};
    // held_long, word 1
    rule_mem[290] = {KindReadWrite, 1'd1, 3'd1, 33'h000000000, 33'h0000000ff};
    // held_several[0]
    rule_mem[291] = {KindReadWrite, 1'd1, 3'd1, 33'h000000000, 33'h00000003f};
    // held_several[1]
    rule_mem[292] = {KindReadWrite, 1'd1, 3'd1, 33'h000000000, 33'h00000003f};
    // held_several[2]
    rule_mem[293] = {KindReadWrite, 1'd1, 3'd1, 33'h000000000, 33'h00000003f};
    // held_bank
    rule_mem[294] = {KindReadWrite, 1'd1, 3'd1, 33'h000000000, 33'h000000001};
    // access_bank
    rule_mem[304] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // commit
    rule_mem[320] = {KindReadWrite, 1'd1, 3'd0, 33'h000000001, 33'h000000001};
    // sole
    rule_mem[508] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // word
    rule_mem[509] = {KindReadWrite, 1'd0, 3'd2, 33'h000000000, 33'h0ffffffff};
    // little
    rule_mem[510] = {KindReadWrite, 1'd0, 3'd0, 33'h1fffffff0, 33'h00000000f};
    // bounded
    rule_mem[511] = {KindReadWrite, 1'd0, 3'd1, 33'h000000007, 33'h000000fa0};
    // centred
    rule_mem[512] = {KindReadWrite, 1'd0, 3'd0, 33'h1fffffffb, 33'h000000005};
    // below
    rule_mem[513] = {KindReadWrite, 1'd0, 3'd0, 33'h180000000, 33'h1fffffffe};
    // above
    rule_mem[514] = {KindReadWrite, 1'd0, 3'd0, 33'h000000003, 33'h07fffffff};
    // late
    rule_mem[515] = {KindReadWrite, 1'd0, 3'd0, 33'h000000003, 33'h00000000f};
    // hit
    rule_mem[516] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000007};
    // signal
    rule_mem[517] = {KindReadWrite, 1'd0, 3'd1, 33'h180000000, 33'h07fffffff};
    // bits[0]
    rule_mem[518] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // bits[1]
    rule_mem[519] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // bits[2]
    rule_mem[520] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // bits[3]
    rule_mem[521] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // bits[4]
    rule_mem[522] = {KindReadWrite, 1'd0, 3'd0, 33'h000000000, 33'h000000001};
    // several[0]
    rule_mem[523] = {KindReadWrite, 1'd0, 3'd2, 33'h1ffff0000, 33'h00000ffff};
    // several[1]
    rule_mem[524] = {KindReadWrite, 1'd0, 3'd2, 33'h1ffff0000, 33'h00000ffff};
    // several[2]
    rule_mem[525] = {KindReadWrite, 1'd0, 3'd2, 33'h1ffff0000, 33'h00000ffff};
    // words[0]
    rule_mem[526] = {KindReadWrite, 1'd0, 3'd0, 33'h00000000a, 33'h0ffffffff};
    // words[1]
    rule_mem[527] = {KindReadWrite, 1'd0, 3'd0, 33'h00000000a, 33'h0ffffffff};
    // first
    rule_mem[1016] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // negative
    rule_mem[1017] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // hash
    rule_mem[1018] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
    // version
    rule_mem[1019] = {KindReadOnly, 1'd0, 3'd0, 33'h000000000, 33'h000000000};
  end

endmodule

`default_nettype wire
