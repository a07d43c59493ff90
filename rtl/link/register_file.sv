// register_file: registers on the bus of the link.
//
// Generated from rtl/link/registers.toml by scripts/generate.py; docs/registers.md lists
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
//   *_o           structs of register_pkg: what the bus has written, 7 clocks after
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

module register_file (
  input  wire logic                               clk_i,
  input  wire logic                               rst_i,

  input  wire logic                               bus_valid_i,
  input  wire logic [link_pkg::AccessWidth-1:0]   bus_access_i,
  input  wire logic [link_pkg::AddressWidth-1:0]  bus_address_i,
  input  wire logic [31:0]                        bus_data_i,
  output      logic                               bus_done_o,
  output      logic [link_pkg::StatusWidth-1:0]   bus_status_o,
  output      logic [31:0]                        bus_data_o,

  input  wire register_pkg::identity_status_t     identity_status_i,
  output      register_pkg::identity_t            identity_o,
  output      register_pkg::peak_t                peak_o,
  output      register_pkg::geometry_t            geometry_o,
  input  wire register_pkg::chain_t               chain_i,
  output      register_pkg::free_t                free_o,
  output      register_pkg::mirror_t              mirror_o,
  output      register_pkg::mirror_limits_t       mirror_limits_o,
  output      register_pkg::motion_t              motion_o,
  output      register_pkg::line_t                line_o,
  input  wire register_pkg::mirror_status_t       mirror_status_i,
  output      register_pkg::link_t                link_o,
  input  wire register_pkg::link_status_t         link_status_i,
  output      register_pkg::laser_t               laser_o,
  output      register_pkg::laser_limits_t        laser_limits_o,
  input  wire register_pkg::laser_status_t        laser_status_i,
  output      register_pkg::points_t              points_o,
  input  wire register_pkg::points_status_t       points_status_i,
  input  wire register_pkg::axi_t                 axi_i,
  output      register_pkg::focus_t               focus_o,
  input  wire register_pkg::focus_status_t        focus_status_i,
  output      register_pkg::test_t                test_o,
  input  wire register_pkg::test_status_t         test_status_i,
  input  wire register_pkg::sensor_status_t       sensor_status_i,
  output      register_pkg::sensor_t              sensor_o,
  output      register_pkg::commit_t              commit_o,
  input  wire register_pkg::commit_status_t       commit_status_i,
  output      register_pkg::map_t                 map_o,
  output      register_pkg::map_access_t          map_access_o,
  output      register_pkg::locks_t               locks_o,
  output      register_pkg::table_t               table_o,
  output      register_pkg::focus_table_t         focus_table_o,
  output      register_pkg::free_table_t          free_table_o,
  input  wire register_pkg::map_table_status_t    map_table_status_i,
  output      register_pkg::map_table_t           map_table_o,

  input  wire logic                               waiting_i,
  input  wire logic                               copy_i,
  input  wire logic [9:0]                         copy_index_i,
  input  wire logic                               bank_i,
  input  wire logic                               take_i
);

  // ---- the reset, once for each group of settings ----
  logic rst;
  local_register u_reset (.clk_i, .d_i(rst_i), .q_o(rst));
  logic identity_rst;
  local_register u_identity_reset (.clk_i, .d_i(rst_i), .q_o(identity_rst));
  logic peak_rst;
  local_register u_peak_reset (.clk_i, .d_i(rst_i), .q_o(peak_rst));
  logic geometry_rst;
  local_register u_geometry_reset (.clk_i, .d_i(rst_i), .q_o(geometry_rst));
  logic free_rst;
  local_register u_free_reset (.clk_i, .d_i(rst_i), .q_o(free_rst));
  logic mirror_rst;
  local_register u_mirror_reset (.clk_i, .d_i(rst_i), .q_o(mirror_rst));
  logic mirror_limits_rst;
  local_register u_mirror_limits_reset (.clk_i, .d_i(rst_i), .q_o(mirror_limits_rst));
  logic motion_rst;
  local_register u_motion_reset (.clk_i, .d_i(rst_i), .q_o(motion_rst));
  logic line_rst;
  local_register u_line_reset (.clk_i, .d_i(rst_i), .q_o(line_rst));
  logic link_rst;
  local_register u_link_reset (.clk_i, .d_i(rst_i), .q_o(link_rst));
  logic laser_rst;
  local_register u_laser_reset (.clk_i, .d_i(rst_i), .q_o(laser_rst));
  logic laser_limits_rst;
  local_register u_laser_limits_reset (.clk_i, .d_i(rst_i), .q_o(laser_limits_rst));
  logic points_rst;
  local_register u_points_reset (.clk_i, .d_i(rst_i), .q_o(points_rst));
  logic focus_rst;
  local_register u_focus_reset (.clk_i, .d_i(rst_i), .q_o(focus_rst));
  logic test_rst;
  local_register u_test_reset (.clk_i, .d_i(rst_i), .q_o(test_rst));
  logic sensor_rst;
  local_register u_sensor_reset (.clk_i, .d_i(rst_i), .q_o(sensor_rst));
  logic commit_rst;
  local_register u_commit_reset (.clk_i, .d_i(rst_i), .q_o(commit_rst));
  logic map_rst;
  local_register u_map_reset (.clk_i, .d_i(rst_i), .q_o(map_rst));
  logic map_access_rst;
  local_register u_map_access_reset (.clk_i, .d_i(rst_i), .q_o(map_access_rst));
  logic locks_rst;
  local_register u_locks_reset (.clk_i, .d_i(rst_i), .q_o(locks_rst));

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
    logic [1:0] lock;
    logic signed [32:0] minimum;
    logic signed [32:0] maximum;
  } rule_t;
  logic [70:0] rule_mem[1024];
  logic [70:0] map_rule_q;
  logic map_hit_q;
  rule_t rule_q;
  logic table_hit_q;
  logic [9:0] table_index;
  assign table_index = address_q[10:1];
  logic focus_table_hit_q;
  logic [5:0] focus_table_index;
  assign focus_table_index = address_q[5:0];
  logic free_table_hit_q;
  logic [7:0] free_table_index;
  assign free_table_index = address_q[8:1];
  logic map_table_hit_q;
  logic [14:0] map_table_index;
  assign map_table_index = address_q[14:0];
  always_ff @(posedge clk_i) begin
    map_rule_q <= rule_mem[address_q[9:0]];
    map_hit_q  <= address_q[15:10] == '0;
    table_hit_q <= address_q[15:11] == 5'h08;
    focus_table_hit_q <= address_q[15:6] == 10'h140;
    free_table_hit_q <= address_q[15:9] == 7'h30;
    map_table_hit_q <= address_q[15:15] == 1'h1 && map_table_index <= 15'd19304;
    rule_q <= map_hit_q ? map_rule_q : '0;
    if (table_hit_q)
      case (address_q[0:0])
        1'h0: rule_q <=
          {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h003ffffff};
        1'h1: rule_q <=
          {KindReadWrite, 1'd1, 2'd1, 33'h1f8000000, 33'h007ffffff};
        default: rule_q <= '0;
      endcase
    if (focus_table_hit_q) rule_q <= {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    if (free_table_hit_q)
      case (address_q[0:0])
        1'h0: rule_q <=
          {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
        1'h1: rule_q <=
          {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
        default: rule_q <= '0;
      endcase
    if (map_table_hit_q) rule_q <= {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00003ffff};
  end

  // ---- 3: against the rule; 4: the verdict ----
  logic [3:0] locks;
  assign locks = {locks_o.lock_laser, locks_o.lock_mirror, locks_o.lock_calibration, 1'b0};
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
    busy_q <= rule_q.commit && waiting_i
              && (!read || table_hit_q || free_table_hit_q || map_table_hit_q);
    if (!read && map_table_hit_q && map_access_o.map_access_bank == map_o.map_bank) busy_q <= 1'b1;
    // What an access changes judges the next: a commit waits from its own write on.
    if (step_q[4]) status_q <= verdict;
    write_q  <= step_q[4] && access_q == link_pkg::AccessWidth'(link_pkg::AccessWrite)
                && verdict == link_pkg::StatusWidth'(link_pkg::StatusOk);
    if (rst) write_q <= 1'b0;
  end

  // ---- 2: which page, which of its words, for writing and for reading ----
  logic page_00_hit_q;
  logic page_01_hit_q;
  logic page_02_hit_q;
  logic page_03_hit_q;
  logic page_04_hit_q;
  logic page_05_hit_q;
  logic page_06_hit_q;
  logic page_08_hit_q;
  logic page_09_hit_q;
  logic page_0a_hit_q;
  logic page_0b_hit_q;
  logic page_0c_hit_q;
  logic page_0d_hit_q;
  logic page_0e_hit_q;
  logic page_10_hit_q;
  logic page_12_hit_q;
  logic page_13_hit_q;
  logic page_16_hit_q;
  logic page_17_hit_q;
  logic page_18_hit_q;
  logic page_1a_hit_q;
  logic page_1c_hit_q;
  logic page_1d_hit_q;
  logic page_1e_hit_q;
  logic page_1f_hit_q;
  logic page_3f_hit_q;
  logic [15:0] word_hit_q;
  always_ff @(posedge clk_i) begin
    page_00_hit_q <= address_q[15:4] == 12'h000;
    page_01_hit_q <= address_q[15:4] == 12'h001;
    page_02_hit_q <= address_q[15:4] == 12'h002;
    page_03_hit_q <= address_q[15:4] == 12'h003;
    page_04_hit_q <= address_q[15:4] == 12'h004;
    page_05_hit_q <= address_q[15:4] == 12'h005;
    page_06_hit_q <= address_q[15:4] == 12'h006;
    page_08_hit_q <= address_q[15:4] == 12'h008;
    page_09_hit_q <= address_q[15:4] == 12'h009;
    page_0a_hit_q <= address_q[15:4] == 12'h00a;
    page_0b_hit_q <= address_q[15:4] == 12'h00b;
    page_0c_hit_q <= address_q[15:4] == 12'h00c;
    page_0d_hit_q <= address_q[15:4] == 12'h00d;
    page_0e_hit_q <= address_q[15:4] == 12'h00e;
    page_10_hit_q <= address_q[15:4] == 12'h010;
    page_12_hit_q <= address_q[15:4] == 12'h012;
    page_13_hit_q <= address_q[15:4] == 12'h013;
    page_16_hit_q <= address_q[15:4] == 12'h016;
    page_17_hit_q <= address_q[15:4] == 12'h017;
    page_18_hit_q <= address_q[15:4] == 12'h018;
    page_1a_hit_q <= address_q[15:4] == 12'h01a;
    page_1c_hit_q <= address_q[15:4] == 12'h01c;
    page_1d_hit_q <= address_q[15:4] == 12'h01d;
    page_1e_hit_q <= address_q[15:4] == 12'h01e;
    page_1f_hit_q <= address_q[15:4] == 12'h01f;
    page_3f_hit_q <= address_q[15:4] == 12'h03f;
    for (int unsigned k = 0; k < 16; k++)
      word_hit_q[k] <= address_q[3:0] == 4'(k);
  end

  // ---- 5: which register; 6: it takes the word ----
  logic [182:0] take_q;
  logic write_q2;
  always_ff @(posedge clk_i) begin
    write_q2 <= write_q;
    if (rst) write_q2 <= 1'b0;
    take_q[0] <= write_q && page_00_hit_q && word_hit_q[10] && !rst;
    take_q[1] <= write_q && page_01_hit_q && word_hit_q[0] && !rst;
    take_q[2] <= write_q && page_01_hit_q && word_hit_q[1] && !rst;
    take_q[3] <= write_q && page_01_hit_q && word_hit_q[2] && !rst;
    take_q[4] <= write_q && page_01_hit_q && word_hit_q[3] && !rst;
    take_q[5] <= write_q && page_01_hit_q && word_hit_q[4] && !rst;
    take_q[6] <= write_q && page_01_hit_q && word_hit_q[5] && !rst;
    take_q[7] <= write_q && page_01_hit_q && word_hit_q[6] && !rst;
    take_q[8] <= write_q && page_01_hit_q && word_hit_q[7] && !rst;
    take_q[9] <= write_q && page_01_hit_q && word_hit_q[8] && !rst;
    take_q[10] <= write_q && page_01_hit_q && word_hit_q[9] && !rst;
    take_q[11] <= write_q && page_01_hit_q && word_hit_q[10] && !rst;
    take_q[12] <= write_q && page_01_hit_q && word_hit_q[11] && !rst;
    take_q[13] <= write_q && page_01_hit_q && word_hit_q[12] && !rst;
    take_q[14] <= write_q && page_02_hit_q && word_hit_q[0] && !rst;
    take_q[15] <= write_q && page_02_hit_q && word_hit_q[1] && !rst;
    take_q[16] <= write_q && page_02_hit_q && word_hit_q[2] && !rst;
    take_q[17] <= write_q && page_02_hit_q && word_hit_q[3] && !rst;
    take_q[18] <= write_q && page_02_hit_q && word_hit_q[4] && !rst;
    take_q[19] <= write_q && page_02_hit_q && word_hit_q[5] && !rst;
    take_q[20] <= write_q && page_02_hit_q && word_hit_q[6] && !rst;
    take_q[21] <= write_q && page_02_hit_q && word_hit_q[7] && !rst;
    take_q[22] <= write_q && page_02_hit_q && word_hit_q[8] && !rst;
    take_q[23] <= write_q && page_02_hit_q && word_hit_q[9] && !rst;
    take_q[24] <= write_q && page_02_hit_q && word_hit_q[10] && !rst;
    take_q[25] <= write_q && page_02_hit_q && word_hit_q[11] && !rst;
    take_q[26] <= write_q && page_02_hit_q && word_hit_q[12] && !rst;
    take_q[27] <= write_q && page_02_hit_q && word_hit_q[13] && !rst;
    take_q[28] <= write_q && page_03_hit_q && word_hit_q[8] && !rst;
    take_q[29] <= write_q && page_03_hit_q && word_hit_q[9] && !rst;
    take_q[30] <= write_q && page_04_hit_q && word_hit_q[0] && !rst;
    take_q[31] <= write_q && page_04_hit_q && word_hit_q[1] && !rst;
    take_q[32] <= write_q && page_04_hit_q && word_hit_q[2] && !rst;
    take_q[33] <= write_q && page_04_hit_q && word_hit_q[3] && !rst;
    take_q[34] <= write_q && page_04_hit_q && word_hit_q[4] && !rst;
    take_q[35] <= write_q && page_04_hit_q && word_hit_q[5] && !rst;
    take_q[36] <= write_q && page_04_hit_q && word_hit_q[6] && !rst;
    take_q[37] <= write_q && page_04_hit_q && word_hit_q[7] && !rst;
    take_q[38] <= write_q && page_04_hit_q && word_hit_q[8] && !rst;
    take_q[39] <= write_q && page_04_hit_q && word_hit_q[9] && !rst;
    take_q[40] <= write_q && page_04_hit_q && word_hit_q[10] && !rst;
    take_q[41] <= write_q && page_04_hit_q && word_hit_q[11] && !rst;
    take_q[42] <= write_q && page_04_hit_q && word_hit_q[12] && !rst;
    take_q[43] <= write_q && page_04_hit_q && word_hit_q[13] && !rst;
    take_q[44] <= write_q && page_04_hit_q && word_hit_q[14] && !rst;
    take_q[45] <= write_q && page_04_hit_q && word_hit_q[15] && !rst;
    take_q[46] <= write_q && page_05_hit_q && word_hit_q[0] && !rst;
    take_q[47] <= write_q && page_05_hit_q && word_hit_q[1] && !rst;
    take_q[48] <= write_q && page_05_hit_q && word_hit_q[2] && !rst;
    take_q[49] <= write_q && page_05_hit_q && word_hit_q[3] && !rst;
    take_q[50] <= write_q && page_05_hit_q && word_hit_q[4] && !rst;
    take_q[51] <= write_q && page_05_hit_q && word_hit_q[5] && !rst;
    take_q[52] <= write_q && page_05_hit_q && word_hit_q[6] && !rst;
    take_q[53] <= write_q && page_05_hit_q && word_hit_q[7] && !rst;
    take_q[54] <= write_q && page_05_hit_q && word_hit_q[8] && !rst;
    take_q[55] <= write_q && page_05_hit_q && word_hit_q[9] && !rst;
    take_q[56] <= write_q && page_05_hit_q && word_hit_q[10] && !rst;
    take_q[57] <= write_q && page_05_hit_q && word_hit_q[11] && !rst;
    take_q[58] <= write_q && page_05_hit_q && word_hit_q[12] && !rst;
    take_q[59] <= write_q && page_05_hit_q && word_hit_q[13] && !rst;
    take_q[60] <= write_q && page_06_hit_q && word_hit_q[0] && !rst;
    take_q[61] <= write_q && page_06_hit_q && word_hit_q[1] && !rst;
    take_q[62] <= write_q && page_06_hit_q && word_hit_q[2] && !rst;
    take_q[63] <= write_q && page_06_hit_q && word_hit_q[3] && !rst;
    take_q[64] <= write_q && page_06_hit_q && word_hit_q[4] && !rst;
    take_q[65] <= write_q && page_06_hit_q && word_hit_q[5] && !rst;
    take_q[66] <= write_q && page_06_hit_q && word_hit_q[6] && !rst;
    take_q[67] <= write_q && page_06_hit_q && word_hit_q[7] && !rst;
    take_q[68] <= write_q && page_06_hit_q && word_hit_q[8] && !rst;
    take_q[69] <= write_q && page_08_hit_q && word_hit_q[0] && !rst;
    take_q[70] <= write_q && page_08_hit_q && word_hit_q[1] && !rst;
    take_q[71] <= write_q && page_08_hit_q && word_hit_q[2] && !rst;
    take_q[72] <= write_q && page_08_hit_q && word_hit_q[3] && !rst;
    take_q[73] <= write_q && page_08_hit_q && word_hit_q[4] && !rst;
    take_q[74] <= write_q && page_08_hit_q && word_hit_q[5] && !rst;
    take_q[75] <= write_q && page_08_hit_q && word_hit_q[6] && !rst;
    take_q[76] <= write_q && page_08_hit_q && word_hit_q[7] && !rst;
    take_q[77] <= write_q && page_08_hit_q && word_hit_q[8] && !rst;
    take_q[78] <= write_q && page_08_hit_q && word_hit_q[9] && !rst;
    take_q[79] <= write_q && page_08_hit_q && word_hit_q[10] && !rst;
    take_q[80] <= write_q && page_08_hit_q && word_hit_q[11] && !rst;
    take_q[81] <= write_q && page_08_hit_q && word_hit_q[12] && !rst;
    take_q[82] <= write_q && page_08_hit_q && word_hit_q[13] && !rst;
    take_q[83] <= write_q && page_08_hit_q && word_hit_q[14] && !rst;
    take_q[84] <= write_q && page_08_hit_q && word_hit_q[15] && !rst;
    take_q[85] <= write_q && page_09_hit_q && word_hit_q[0] && !rst;
    take_q[86] <= write_q && page_09_hit_q && word_hit_q[1] && !rst;
    take_q[87] <= write_q && page_09_hit_q && word_hit_q[2] && !rst;
    take_q[88] <= write_q && page_09_hit_q && word_hit_q[3] && !rst;
    take_q[89] <= write_q && page_09_hit_q && word_hit_q[4] && !rst;
    take_q[90] <= write_q && page_09_hit_q && word_hit_q[5] && !rst;
    take_q[91] <= write_q && page_09_hit_q && word_hit_q[6] && !rst;
    take_q[92] <= write_q && page_09_hit_q && word_hit_q[7] && !rst;
    take_q[93] <= write_q && page_09_hit_q && word_hit_q[8] && !rst;
    take_q[94] <= write_q && page_09_hit_q && word_hit_q[9] && !rst;
    take_q[95] <= write_q && page_09_hit_q && word_hit_q[10] && !rst;
    take_q[96] <= write_q && page_09_hit_q && word_hit_q[11] && !rst;
    take_q[97] <= write_q && page_09_hit_q && word_hit_q[12] && !rst;
    take_q[98] <= write_q && page_09_hit_q && word_hit_q[13] && !rst;
    take_q[99] <= write_q && page_09_hit_q && word_hit_q[14] && !rst;
    take_q[100] <= write_q && page_09_hit_q && word_hit_q[15] && !rst;
    take_q[101] <= write_q && page_0a_hit_q && word_hit_q[0] && !rst;
    take_q[102] <= write_q && page_0a_hit_q && word_hit_q[1] && !rst;
    take_q[103] <= write_q && page_0a_hit_q && word_hit_q[2] && !rst;
    take_q[104] <= write_q && page_0a_hit_q && word_hit_q[3] && !rst;
    take_q[105] <= write_q && page_0a_hit_q && word_hit_q[4] && !rst;
    take_q[106] <= write_q && page_0a_hit_q && word_hit_q[5] && !rst;
    take_q[107] <= write_q && page_0a_hit_q && word_hit_q[6] && !rst;
    take_q[108] <= write_q && page_0a_hit_q && word_hit_q[7] && !rst;
    take_q[109] <= write_q && page_0b_hit_q && word_hit_q[0] && !rst;
    take_q[110] <= write_q && page_0b_hit_q && word_hit_q[1] && !rst;
    take_q[111] <= write_q && page_0b_hit_q && word_hit_q[2] && !rst;
    take_q[112] <= write_q && page_0b_hit_q && word_hit_q[3] && !rst;
    take_q[113] <= write_q && page_0b_hit_q && word_hit_q[4] && !rst;
    take_q[114] <= write_q && page_0b_hit_q && word_hit_q[5] && !rst;
    take_q[115] <= write_q && page_0e_hit_q && word_hit_q[0] && !rst;
    take_q[116] <= write_q && page_10_hit_q && word_hit_q[0] && !rst;
    take_q[117] <= write_q && page_10_hit_q && word_hit_q[1] && !rst;
    take_q[118] <= write_q && page_10_hit_q && word_hit_q[2] && !rst;
    take_q[119] <= write_q && page_10_hit_q && word_hit_q[3] && !rst;
    take_q[120] <= write_q && page_10_hit_q && word_hit_q[4] && !rst;
    take_q[121] <= write_q && page_10_hit_q && word_hit_q[5] && !rst;
    take_q[122] <= write_q && page_10_hit_q && word_hit_q[6] && !rst;
    take_q[123] <= write_q && page_10_hit_q && word_hit_q[7] && !rst;
    take_q[124] <= write_q && page_10_hit_q && word_hit_q[8] && !rst;
    take_q[125] <= write_q && page_10_hit_q && word_hit_q[9] && !rst;
    take_q[126] <= write_q && page_10_hit_q && word_hit_q[10] && !rst;
    take_q[127] <= write_q && page_10_hit_q && word_hit_q[11] && !rst;
    take_q[128] <= write_q && page_10_hit_q && word_hit_q[12] && !rst;
    take_q[129] <= write_q && page_10_hit_q && word_hit_q[13] && !rst;
    take_q[130] <= write_q && page_12_hit_q && word_hit_q[0] && !rst;
    take_q[131] <= write_q && page_12_hit_q && word_hit_q[1] && !rst;
    take_q[132] <= write_q && page_12_hit_q && word_hit_q[2] && !rst;
    take_q[133] <= write_q && page_12_hit_q && word_hit_q[3] && !rst;
    take_q[134] <= write_q && page_12_hit_q && word_hit_q[4] && !rst;
    take_q[135] <= write_q && page_12_hit_q && word_hit_q[5] && !rst;
    take_q[136] <= write_q && page_16_hit_q && word_hit_q[0] && !rst;
    take_q[137] <= write_q && page_16_hit_q && word_hit_q[1] && !rst;
    take_q[138] <= write_q && page_18_hit_q && word_hit_q[0] && !rst;
    take_q[139] <= write_q && page_18_hit_q && word_hit_q[1] && !rst;
    take_q[140] <= write_q && page_18_hit_q && word_hit_q[2] && !rst;
    take_q[141] <= write_q && page_18_hit_q && word_hit_q[3] && !rst;
    take_q[142] <= write_q && page_18_hit_q && word_hit_q[4] && !rst;
    take_q[143] <= write_q && page_18_hit_q && word_hit_q[5] && !rst;
    take_q[144] <= write_q && page_18_hit_q && word_hit_q[6] && !rst;
    take_q[145] <= write_q && page_18_hit_q && word_hit_q[7] && !rst;
    take_q[146] <= write_q && page_18_hit_q && word_hit_q[8] && !rst;
    take_q[147] <= write_q && page_18_hit_q && word_hit_q[9] && !rst;
    take_q[148] <= write_q && page_18_hit_q && word_hit_q[10] && !rst;
    take_q[149] <= write_q && page_18_hit_q && word_hit_q[11] && !rst;
    take_q[150] <= write_q && page_18_hit_q && word_hit_q[12] && !rst;
    take_q[151] <= write_q && page_18_hit_q && word_hit_q[13] && !rst;
    take_q[152] <= write_q && page_18_hit_q && word_hit_q[14] && !rst;
    take_q[153] <= write_q && page_18_hit_q && word_hit_q[15] && !rst;
    take_q[154] <= write_q && page_1c_hit_q && word_hit_q[0] && !rst;
    take_q[155] <= write_q && page_1c_hit_q && word_hit_q[1] && !rst;
    take_q[156] <= write_q && page_1c_hit_q && word_hit_q[2] && !rst;
    take_q[157] <= write_q && page_1c_hit_q && word_hit_q[3] && !rst;
    take_q[158] <= write_q && page_1c_hit_q && word_hit_q[4] && !rst;
    take_q[159] <= write_q && page_1c_hit_q && word_hit_q[5] && !rst;
    take_q[160] <= write_q && page_1c_hit_q && word_hit_q[6] && !rst;
    take_q[161] <= write_q && page_1c_hit_q && word_hit_q[7] && !rst;
    take_q[162] <= write_q && page_1c_hit_q && word_hit_q[8] && !rst;
    take_q[163] <= write_q && page_1c_hit_q && word_hit_q[9] && !rst;
    take_q[164] <= write_q && page_1c_hit_q && word_hit_q[10] && !rst;
    take_q[165] <= write_q && page_1c_hit_q && word_hit_q[11] && !rst;
    take_q[166] <= write_q && page_1c_hit_q && word_hit_q[12] && !rst;
    take_q[167] <= write_q && page_1d_hit_q && word_hit_q[4] && !rst;
    take_q[168] <= write_q && page_1d_hit_q && word_hit_q[5] && !rst;
    take_q[169] <= write_q && page_1d_hit_q && word_hit_q[6] && !rst;
    take_q[170] <= write_q && page_1d_hit_q && word_hit_q[7] && !rst;
    take_q[171] <= write_q && page_1e_hit_q && word_hit_q[0] && !rst;
    take_q[172] <= write_q && page_1f_hit_q && word_hit_q[0] && !rst;
    take_q[173] <= write_q && page_1f_hit_q && word_hit_q[1] && !rst;
    take_q[174] <= write_q && page_1f_hit_q && word_hit_q[2] && !rst;
    take_q[175] <= write_q && page_1f_hit_q && word_hit_q[3] && !rst;
    take_q[176] <= write_q && page_1f_hit_q && word_hit_q[4] && !rst;
    take_q[177] <= write_q && page_1f_hit_q && word_hit_q[5] && !rst;
    take_q[178] <= write_q && page_1f_hit_q && word_hit_q[6] && !rst;
    take_q[179] <= write_q && page_1f_hit_q && word_hit_q[8] && !rst;
    take_q[180] <= write_q && page_3f_hit_q && word_hit_q[0] && !rst;
    take_q[181] <= write_q && page_3f_hit_q && word_hit_q[1] && !rst;
    take_q[182] <= write_q && page_3f_hit_q && word_hit_q[2] && !rst;
  end

  logic [31:0] identity_data;
  local_register #(.Width(32)) u_identity_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(identity_data)
  );
  logic [23:0] peak_data;
  local_register #(.Width(24)) u_peak_data (
    .clk_i, .d_i(data_q[23:0]), .q_o(peak_data)
  );
  logic [31:0] geometry_data;
  local_register #(.Width(32)) u_geometry_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(geometry_data)
  );
  logic [23:0] free_data;
  local_register #(.Width(24)) u_free_data (
    .clk_i, .d_i(data_q[23:0]), .q_o(free_data)
  );
  logic [31:0] mirror_data;
  local_register #(.Width(32)) u_mirror_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(mirror_data)
  );
  logic [31:0] mirror_limits_data;
  local_register #(.Width(32)) u_mirror_limits_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(mirror_limits_data)
  );
  logic [27:0] motion_data;
  local_register #(.Width(28)) u_motion_data (
    .clk_i, .d_i(data_q[27:0]), .q_o(motion_data)
  );
  logic [31:0] line_data;
  local_register #(.Width(32)) u_line_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(line_data)
  );
  logic [23:0] link_data;
  local_register #(.Width(24)) u_link_data (
    .clk_i, .d_i(data_q[23:0]), .q_o(link_data)
  );
  logic [15:0] laser_data;
  local_register #(.Width(16)) u_laser_data (
    .clk_i, .d_i(data_q[15:0]), .q_o(laser_data)
  );
  logic [31:0] laser_limits_data;
  local_register #(.Width(32)) u_laser_limits_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(laser_limits_data)
  );
  logic [23:0] points_data;
  local_register #(.Width(24)) u_points_data (
    .clk_i, .d_i(data_q[23:0]), .q_o(points_data)
  );
  logic [31:0] focus_data;
  local_register #(.Width(32)) u_focus_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(focus_data)
  );
  logic [31:0] test_data;
  local_register #(.Width(32)) u_test_data (
    .clk_i, .d_i(data_q[31:0]), .q_o(test_data)
  );
  logic [23:0] sensor_data;
  local_register #(.Width(24)) u_sensor_data (
    .clk_i, .d_i(data_q[23:0]), .q_o(sensor_data)
  );
  logic [0:0] commit_data;
  local_register #(.Width(1)) u_commit_data (
    .clk_i, .d_i(data_q[0:0]), .q_o(commit_data)
  );
  logic [15:0] map_data;
  local_register #(.Width(16)) u_map_data (
    .clk_i, .d_i(data_q[15:0]), .q_o(map_data)
  );
  logic [0:0] map_access_data;
  local_register #(.Width(1)) u_map_access_data (
    .clk_i, .d_i(data_q[0:0]), .q_o(map_access_data)
  );
  logic [0:0] locks_data;
  local_register #(.Width(1)) u_locks_data (
    .clk_i, .d_i(data_q[0:0]), .q_o(locks_data)
  );
  logic [31:0] centre_low_q;
  logic [31:0] sweep_word_low_q;
  logic [31:0] work_word_low_q;
  logic [31:0] ratio_low_q;
  register_pkg::peak_t peak_q;
  logic period_n_take, period_n_taken_rst;
  local_register #(.Width(2)) u_period_n_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({period_n_take, period_n_taken_rst})
  );
  logic noise_row_take, noise_row_taken_rst;
  local_register #(.Width(2)) u_noise_row_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({noise_row_take, noise_row_taken_rst})
  );
  logic k_noise_take, k_noise_taken_rst;
  local_register #(.Width(2)) u_k_noise_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({k_noise_take, k_noise_taken_rst})
  );
  logic k_height_take, k_height_taken_rst;
  local_register #(.Width(2)) u_k_height_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({k_height_take, k_height_taken_rst})
  );
  logic snr_min_take, snr_min_taken_rst;
  local_register #(.Width(2)) u_snr_min_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({snr_min_take, snr_min_taken_rst})
  );
  logic min_width_take, min_width_taken_rst;
  local_register #(.Width(2)) u_min_width_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({min_width_take, min_width_taken_rst})
  );
  logic max_width_take, max_width_taken_rst;
  local_register #(.Width(2)) u_max_width_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({max_width_take, max_width_taken_rst})
  );
  logic kappa_take, kappa_taken_rst;
  local_register #(.Width(2)) u_kappa_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({kappa_take, kappa_taken_rst})
  );
  logic c_sfm_gain_take, c_sfm_gain_taken_rst;
  local_register #(.Width(2)) u_c_sfm_gain_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({c_sfm_gain_take, c_sfm_gain_taken_rst})
  );
  logic window_two_pass_take, window_two_pass_taken_rst;
  local_register #(.Width(2)) u_window_two_pass_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({window_two_pass_take, window_two_pass_taken_rst})
  );
  logic window_fit_take, window_fit_taken_rst;
  local_register #(.Width(2)) u_window_fit_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({window_fit_take, window_fit_taken_rst})
  );
  logic max_core_take, max_core_taken_rst;
  local_register #(.Width(2)) u_max_core_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({max_core_take, max_core_taken_rst})
  );
  logic saturation_level_take, saturation_level_taken_rst;
  local_register #(.Width(2)) u_saturation_level_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({saturation_level_take, saturation_level_taken_rst})
  );
  register_pkg::geometry_t geometry_q;
  logic centre_take, centre_taken_rst;
  local_register #(.Width(2)) u_centre_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({centre_take, centre_taken_rst})
  );
  logic k1_take, k1_taken_rst;
  local_register #(.Width(2)) u_k1_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({k1_take, k1_taken_rst})
  );
  logic k2_take, k2_taken_rst;
  local_register #(.Width(2)) u_k2_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({k2_take, k2_taken_rst})
  );
  logic even_take, even_taken_rst;
  local_register #(.Width(2)) u_even_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({even_take, even_taken_rst})
  );
  logic n0_take, n0_taken_rst;
  local_register #(.Width(2)) u_n0_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({n0_take, n0_taken_rst})
  );
  logic n1_take, n1_taken_rst;
  local_register #(.Width(2)) u_n1_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({n1_take, n1_taken_rst})
  );
  logic d0_take, d0_taken_rst;
  local_register #(.Width(2)) u_d0_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({d0_take, d0_taken_rst})
  );
  logic d1_take, d1_taken_rst;
  local_register #(.Width(2)) u_d1_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({d1_take, d1_taken_rst})
  );
  logic e0_take, e0_taken_rst;
  local_register #(.Width(2)) u_e0_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({e0_take, e0_taken_rst})
  );
  logic e1_take, e1_taken_rst;
  local_register #(.Width(2)) u_e1_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({e1_take, e1_taken_rst})
  );
  logic tolerance_take, tolerance_taken_rst;
  local_register #(.Width(2)) u_tolerance_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({tolerance_take, tolerance_taken_rst})
  );
  logic length_unit_take, length_unit_taken_rst;
  local_register #(.Width(2)) u_length_unit_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({length_unit_take, length_unit_taken_rst})
  );
  logic c_obj_gain_take, c_obj_gain_taken_rst;
  local_register #(.Width(2)) u_c_obj_gain_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({c_obj_gain_take, c_obj_gain_taken_rst})
  );
  register_pkg::free_t free_q;
  logic free_begin_take, free_begin_taken_rst;
  local_register #(.Width(2)) u_free_begin_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({free_begin_take, free_begin_taken_rst})
  );
  logic free_shift_take, free_shift_taken_rst;
  local_register #(.Width(2)) u_free_shift_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({free_shift_take, free_shift_taken_rst})
  );
  register_pkg::motion_t motion_q;
  logic drive_phase_take, drive_phase_taken_rst;
  local_register #(.Width(2)) u_drive_phase_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({drive_phase_take, drive_phase_taken_rst})
  );
  logic motion_a_take, motion_a_taken_rst;
  local_register #(.Width(2)) u_motion_a_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({motion_a_take, motion_a_taken_rst})
  );
  logic motion_phi_take, motion_phi_taken_rst;
  local_register #(.Width(2)) u_motion_phi_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({motion_phi_take, motion_phi_taken_rst})
  );
  logic motion_da_take, motion_da_taken_rst;
  local_register #(.Width(2)) u_motion_da_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({motion_da_take, motion_da_taken_rst})
  );
  logic motion_dphi_take, motion_dphi_taken_rst;
  local_register #(.Width(2)) u_motion_dphi_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({motion_dphi_take, motion_dphi_taken_rst})
  );
  logic scan_facet_take, scan_facet_taken_rst;
  local_register #(.Width(2)) u_scan_facet_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({scan_facet_take, scan_facet_taken_rst})
  );
  logic scan_begin_take, scan_begin_taken_rst;
  local_register #(.Width(2)) u_scan_begin_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({scan_begin_take, scan_begin_taken_rst})
  );
  logic scan_span_take, scan_span_taken_rst;
  local_register #(.Width(2)) u_scan_span_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({scan_span_take, scan_span_taken_rst})
  );
  register_pkg::map_t map_q;
  logic map_enable_take, map_enable_taken_rst;
  local_register #(.Width(2)) u_map_enable_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({map_enable_take, map_enable_taken_rst})
  );
  logic map_bank_take, map_bank_taken_rst;
  local_register #(.Width(2)) u_map_bank_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({map_bank_take, map_bank_taken_rst})
  );
  logic map_count_take, map_count_taken_rst;
  local_register #(.Width(2)) u_map_count_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({map_count_take, map_count_taken_rst})
  );
  logic map_begin_take, map_begin_taken_rst;
  local_register #(.Width(2)) u_map_begin_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({map_begin_take, map_begin_taken_rst})
  );
  logic map_shift_take, map_shift_taken_rst;
  local_register #(.Width(2)) u_map_shift_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({map_shift_take, map_shift_taken_rst})
  );
  logic map_follow_take, map_follow_taken_rst;
  local_register #(.Width(2)) u_map_follow_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({map_follow_take, map_follow_taken_rst})
  );
  logic map_lens_take, map_lens_taken_rst;
  local_register #(.Width(2)) u_map_lens_take (
    .clk_i, .d_i({take_i, rst_i}),
    .q_o({map_lens_take, map_lens_taken_rst})
  );
  always_ff @(posedge clk_i) begin
    link_o.uart_step_strobe <= take_q[115];
    test_o.test_start_strobe <= take_q[165];
    test_o.test_stop_strobe <= take_q[166];
    commit_o.commit_strobe <= take_q[171];
    if (take_q[0]) identity_o.scratch <= identity_data;
    if (take_q[1]) peak_q.period_n <= peak_data[0];
    if (take_q[2]) peak_q.noise_row <= peak_data[0];
    if (take_q[3]) peak_q.k_noise <= peak_data[15:0];
    if (take_q[4]) peak_q.k_height <= peak_data[15:0];
    if (take_q[5]) peak_q.snr_min <= peak_data[15:0];
    if (take_q[6]) peak_q.min_width <= peak_data[7:0];
    if (take_q[7]) peak_q.max_width <= peak_data[7:0];
    if (take_q[8]) peak_q.kappa <= peak_data[17:0];
    if (take_q[9]) peak_q.c_sfm_gain <= peak_data;
    if (take_q[10]) peak_q.window_two_pass <= peak_data[0];
    if (take_q[11]) peak_q.window_fit <= peak_data[0];
    if (take_q[12]) peak_q.max_core <= peak_data[7:0];
    if (take_q[13]) peak_q.saturation_level <= peak_data[15:0];
    if (take_q[14]) centre_low_q <= geometry_data;
    if (take_q[15]) geometry_q.centre <= {geometry_data[1:0], centre_low_q};
    if (take_q[16]) geometry_q.k1 <= signed'(geometry_data[25:0]);
    if (take_q[17]) geometry_q.k2 <= signed'(geometry_data[25:0]);
    if (take_q[18]) geometry_q.even <= geometry_data[0];
    if (take_q[19]) geometry_q.n0 <= signed'(geometry_data);
    if (take_q[20]) geometry_q.n1 <= signed'(geometry_data);
    if (take_q[21]) geometry_q.d0 <= signed'(geometry_data);
    if (take_q[22]) geometry_q.d1 <= signed'(geometry_data);
    if (take_q[23]) geometry_q.e0 <= signed'(geometry_data);
    if (take_q[24]) geometry_q.e1 <= signed'(geometry_data);
    if (take_q[25]) geometry_q.tolerance <= geometry_data[15:0];
    if (take_q[26]) geometry_q.length_unit <= geometry_data[3:0];
    if (take_q[27]) geometry_q.c_obj_gain <= geometry_data[20:0];
    if (take_q[28]) free_q.free_begin <= signed'(free_data);
    if (take_q[29]) free_q.free_shift <= free_data[3:0];
    if (take_q[30]) mirror_o.mirror_enable <= mirror_data[0];
    if (take_q[31]) mirror_o.line_enable <= mirror_data[0];
    if (take_q[32]) sweep_word_low_q <= mirror_data;
    if (take_q[33]) mirror_o.sweep_word <= {mirror_data[7:0], sweep_word_low_q};
    if (take_q[34]) work_word_low_q <= mirror_data;
    if (take_q[35]) mirror_o.work_word <= {mirror_data[7:0], work_word_low_q};
    if (take_q[36]) mirror_o.sweep_rate <= mirror_data;
    if (take_q[37]) mirror_o.glitch_clks <= mirror_data[7:0];
    if (take_q[38]) mirror_o.width_min_clks <= mirror_data;
    if (take_q[39]) mirror_o.width_max_clks <= mirror_data;
    if (take_q[40]) mirror_o.period_max_clks <= mirror_data;
    if (take_q[41]) mirror_o.phase_shift <= mirror_data[3:0];
    if (take_q[42]) mirror_o.rate_shift <= mirror_data[5:0];
    if (take_q[43]) mirror_o.amplitude_shift <= mirror_data[3:0];
    if (take_q[44]) mirror_o.error_limit <= mirror_data[27:0];
    if (take_q[45]) mirror_o.amplitude_set <= mirror_data[25:0];
    if (take_q[46]) mirror_o.k_p <= mirror_data[17:0];
    if (take_q[47]) mirror_o.k_i <= mirror_data[17:0];
    if (take_q[48]) mirror_o.level_low <= mirror_data[19:0];
    if (take_q[49]) mirror_o.level_high <= mirror_data[19:0];
    if (take_q[50]) mirror_o.level_nominal <= mirror_data[19:0];
    if (take_q[51]) mirror_o.trim_step <= mirror_data[23:0];
    if (take_q[52]) mirror_o.trim_gain <= mirror_data[17:0];
    if (take_q[53]) mirror_o.trim_up <= mirror_data[0];
    if (take_q[54]) mirror_o.settle_limit <= mirror_data[25:0];
    if (take_q[55]) mirror_o.shock_limit <= mirror_data[25:0];
    if (take_q[56]) mirror_o.phase_limit <= mirror_data[27:0];
    if (take_q[57]) mirror_o.settle_count <= mirror_data[7:0];
    if (take_q[58]) mirror_o.hold_count <= mirror_data[7:0];
    if (take_q[59]) mirror_o.confidence_gain <= mirror_data[23:0];
    if (take_q[60]) mirror_limits_o.duty <= mirror_limits_data[15:0];
    if (take_q[61]) mirror_limits_o.sweep_level <= mirror_limits_data[19:0];
    if (take_q[62]) mirror_limits_o.level_min <= mirror_limits_data[19:0];
    if (take_q[63]) mirror_limits_o.level_max <= mirror_limits_data[19:0];
    if (take_q[64]) mirror_limits_o.trim_min <= signed'(mirror_limits_data);
    if (take_q[65]) mirror_limits_o.trim_max <= signed'(mirror_limits_data);
    if (take_q[66]) mirror_limits_o.sweep_timeout <= mirror_limits_data;
    if (take_q[67]) mirror_limits_o.settle_timeout <= mirror_limits_data;
    if (take_q[68]) mirror_limits_o.lost_timeout <= mirror_limits_data;
    if (take_q[69]) motion_q.drive_phase <= motion_data;
    if (take_q[70]) motion_q.motion_a[0+:24] <= motion_data[23:0];
    if (take_q[71]) motion_q.motion_a[24+:24] <= motion_data[23:0];
    if (take_q[72]) motion_q.motion_a[48+:24] <= motion_data[23:0];
    if (take_q[73]) motion_q.motion_a[72+:24] <= motion_data[23:0];
    if (take_q[74]) motion_q.motion_a[96+:24] <= motion_data[23:0];
    if (take_q[75]) motion_q.motion_a[120+:24] <= motion_data[23:0];
    if (take_q[76]) motion_q.motion_a[144+:24] <= motion_data[23:0];
    if (take_q[77]) motion_q.motion_a[168+:24] <= motion_data[23:0];
    if (take_q[78]) motion_q.motion_a[192+:24] <= motion_data[23:0];
    if (take_q[79]) motion_q.motion_phi[0+:28] <= motion_data;
    if (take_q[80]) motion_q.motion_phi[28+:28] <= motion_data;
    if (take_q[81]) motion_q.motion_phi[56+:28] <= motion_data;
    if (take_q[82]) motion_q.motion_phi[84+:28] <= motion_data;
    if (take_q[83]) motion_q.motion_phi[112+:28] <= motion_data;
    if (take_q[84]) motion_q.motion_phi[140+:28] <= motion_data;
    if (take_q[85]) motion_q.motion_phi[168+:28] <= motion_data;
    if (take_q[86]) motion_q.motion_phi[196+:28] <= motion_data;
    if (take_q[87]) motion_q.motion_phi[224+:28] <= motion_data;
    if (take_q[88]) motion_q.motion_da[0+:24] <= motion_data[23:0];
    if (take_q[89]) motion_q.motion_da[24+:24] <= motion_data[23:0];
    if (take_q[90]) motion_q.motion_da[48+:24] <= motion_data[23:0];
    if (take_q[91]) motion_q.motion_da[72+:24] <= motion_data[23:0];
    if (take_q[92]) motion_q.motion_da[96+:24] <= motion_data[23:0];
    if (take_q[93]) motion_q.motion_da[120+:24] <= motion_data[23:0];
    if (take_q[94]) motion_q.motion_da[144+:24] <= motion_data[23:0];
    if (take_q[95]) motion_q.motion_da[168+:24] <= motion_data[23:0];
    if (take_q[96]) motion_q.motion_da[192+:24] <= motion_data[23:0];
    if (take_q[97]) motion_q.motion_dphi[0+:24] <= motion_data[23:0];
    if (take_q[98]) motion_q.motion_dphi[24+:24] <= motion_data[23:0];
    if (take_q[99]) motion_q.motion_dphi[48+:24] <= motion_data[23:0];
    if (take_q[100]) motion_q.motion_dphi[72+:24] <= motion_data[23:0];
    if (take_q[101]) motion_q.motion_dphi[96+:24] <= motion_data[23:0];
    if (take_q[102]) motion_q.motion_dphi[120+:24] <= motion_data[23:0];
    if (take_q[103]) motion_q.motion_dphi[144+:24] <= motion_data[23:0];
    if (take_q[104]) motion_q.motion_dphi[168+:24] <= motion_data[23:0];
    if (take_q[105]) motion_q.motion_dphi[192+:24] <= motion_data[23:0];
    if (take_q[106]) motion_q.scan_facet <= motion_data[0];
    if (take_q[107]) motion_q.scan_begin <= motion_data[15:0];
    if (take_q[108]) motion_q.scan_span <= motion_data[15:0];
    if (take_q[109]) ratio_low_q <= line_data;
    if (take_q[110]) line_o.ratio <= {line_data[11:0], ratio_low_q};
    if (take_q[111]) line_o.exposure_delay_clks <= line_data[19:0];
    if (take_q[112]) line_o.exposure_clks <= line_data[19:0];
    if (take_q[113]) line_o.pulse_delay_clks <= line_data[19:0];
    if (take_q[114]) line_o.pulse_clks <= line_data[19:0];
    if (take_q[115]) link_o.uart_step <= link_data;
    if (take_q[116]) laser_o.laser_enable <= laser_data[0];
    if (take_q[117]) laser_o.laser_adapt <= laser_data[0];
    if (take_q[118]) laser_o.laser_shared <= laser_data[0];
    if (take_q[119]) laser_o.laser_power <= laser_data;
    if (take_q[120]) laser_o.laser_power_min <= laser_data;
    if (take_q[121]) laser_o.laser_power_max <= laser_data;
    if (take_q[122]) laser_o.laser_startup <= laser_data;
    if (take_q[123]) laser_o.laser_target <= laser_data;
    if (take_q[124]) laser_o.laser_cut <= laser_data[13:0];
    if (take_q[125]) laser_o.laser_down <= laser_data;
    if (take_q[126]) laser_o.laser_up <= laser_data;
    if (take_q[127]) laser_o.laser_search <= laser_data[13:0];
    if (take_q[128]) laser_o.laser_index_begin <= laser_data;
    if (take_q[129]) laser_o.laser_index_end <= laser_data;
    if (take_q[130]) laser_limits_o.laser_limit_power <= laser_limits_data[15:0];
    if (take_q[131]) laser_limits_o.laser_limit_startup <= laser_limits_data[15:0];
    if (take_q[132]) laser_limits_o.laser_limit_pulse_clks <= laser_limits_data[19:0];
    if (take_q[133]) laser_limits_o.laser_limit_drain <= laser_limits_data[15:0];
    if (take_q[134]) laser_limits_o.laser_limit_bucket <= laser_limits_data;
    if (take_q[135]) laser_limits_o.laser_watchdog_clks <= laser_limits_data;
    if (take_q[136]) points_o.points_batch <= points_data[7:0];
    if (take_q[137]) points_o.points_timeout_clks <= points_data;
    if (take_q[138]) focus_o.focus_mode <= focus_data[1:0];
    if (take_q[139]) focus_o.focus_manual <= focus_data[15:0];
    if (take_q[140]) focus_o.focus_average_shift <= focus_data[3:0];
    if (take_q[141]) focus_o.focus_lapse <= focus_data[15:0];
    if (take_q[142]) focus_o.focus_z_begin <= signed'(focus_data[23:0]);
    if (take_q[143]) focus_o.focus_z_shift <= focus_data[3:0];
    if (take_q[144]) focus_o.focus_hysteresis <= focus_data[15:0];
    if (take_q[145]) focus_o.focus_hold_points <= focus_data[15:0];
    if (take_q[146]) focus_o.focus_address <= focus_data[6:0];
    if (take_q[147]) focus_o.focus_quarter_clks <= focus_data[15:0];
    if (take_q[148]) focus_o.focus_stretch_clks <= focus_data[23:0];
    if (take_q[149]) focus_o.focus_poll_clks <= focus_data[23:0];
    if (take_q[150]) focus_o.focus_tolerance <= focus_data[15:0];
    if (take_q[151]) focus_o.focus_timeout_clks <= focus_data;
    if (take_q[152]) focus_o.focus_retries <= focus_data[7:0];
    if (take_q[153]) focus_o.focus_protocol <= focus_data[0];
    if (take_q[154]) test_o.test_position <= test_data[24:0];
    if (take_q[155]) test_o.test_move <= signed'(test_data[23:0]);
    if (take_q[156]) test_o.test_step <= test_data[28:0];
    if (take_q[157]) test_o.test_height <= test_data[15:0];
    if (take_q[158]) test_o.test_pedestal <= test_data[15:0];
    if (take_q[159]) test_o.test_noise <= test_data[15:0];
    if (take_q[160]) test_o.test_seed <= test_data;
    if (take_q[161]) test_o.test_lines <= test_data;
    if (take_q[162]) test_o.test_period_clks <= test_data[23:0];
    if (take_q[163]) test_o.test_angle <= signed'(test_data[23:0]);
    if (take_q[164]) test_o.test_power <= test_data[15:0];
    if (take_q[165]) test_o.test_start <= test_data[0];
    if (take_q[166]) test_o.test_stop <= test_data[0];
    if (take_q[167]) sensor_o.readout_lag <= sensor_data[1:0];
    if (take_q[168]) sensor_o.readout_stale <= sensor_data[0];
    if (take_q[169]) sensor_o.readout_min_clks <= sensor_data;
    if (take_q[170]) sensor_o.readout_max_clks <= sensor_data;
    if (take_q[171]) commit_o.commit <= commit_data[0];
    if (take_q[172]) map_q.map_enable <= map_data[0];
    if (take_q[173]) map_q.map_bank <= map_data[0];
    if (take_q[174]) map_q.map_count <= map_data[3:0];
    if (take_q[175]) map_q.map_begin <= map_data;
    if (take_q[176]) map_q.map_shift <= map_data[3:0];
    if (take_q[177]) map_q.map_follow <= map_data[0];
    if (take_q[178]) map_q.map_lens <= map_data;
    if (take_q[179]) map_access_o.map_access_bank <= map_access_data[0];
    if (take_q[180]) locks_o.lock_calibration <= locks_data[0];
    if (take_q[181]) locks_o.lock_mirror <= locks_data[0];
    if (take_q[182]) locks_o.lock_laser <= locks_data[0];
    if (identity_rst) begin
      identity_o.scratch <= register_pkg::ResetScratch;
    end
    if (period_n_take) peak_o.period_n <= peak_q.period_n;
    if (period_n_taken_rst) begin
      peak_o.period_n <= register_pkg::ResetPeriodN;
    end
    if (noise_row_take) peak_o.noise_row <= peak_q.noise_row;
    if (noise_row_taken_rst) begin
      peak_o.noise_row <= register_pkg::ResetNoiseRow;
    end
    if (k_noise_take) peak_o.k_noise <= peak_q.k_noise;
    if (k_noise_taken_rst) begin
      peak_o.k_noise <= register_pkg::ResetKNoise;
    end
    if (k_height_take) peak_o.k_height <= peak_q.k_height;
    if (k_height_taken_rst) begin
      peak_o.k_height <= register_pkg::ResetKHeight;
    end
    if (snr_min_take) peak_o.snr_min <= peak_q.snr_min;
    if (snr_min_taken_rst) begin
      peak_o.snr_min <= register_pkg::ResetSnrMin;
    end
    if (min_width_take) peak_o.min_width <= peak_q.min_width;
    if (min_width_taken_rst) begin
      peak_o.min_width <= register_pkg::ResetMinWidth;
    end
    if (max_width_take) peak_o.max_width <= peak_q.max_width;
    if (max_width_taken_rst) begin
      peak_o.max_width <= register_pkg::ResetMaxWidth;
    end
    if (kappa_take) peak_o.kappa <= peak_q.kappa;
    if (kappa_taken_rst) begin
      peak_o.kappa <= register_pkg::ResetKappa;
    end
    if (c_sfm_gain_take) peak_o.c_sfm_gain <= peak_q.c_sfm_gain;
    if (c_sfm_gain_taken_rst) begin
      peak_o.c_sfm_gain <= register_pkg::ResetCSfmGain;
    end
    if (window_two_pass_take) peak_o.window_two_pass <= peak_q.window_two_pass;
    if (window_two_pass_taken_rst) begin
      peak_o.window_two_pass <= register_pkg::ResetWindowTwoPass;
    end
    if (window_fit_take) peak_o.window_fit <= peak_q.window_fit;
    if (window_fit_taken_rst) begin
      peak_o.window_fit <= register_pkg::ResetWindowFit;
    end
    if (max_core_take) peak_o.max_core <= peak_q.max_core;
    if (max_core_taken_rst) begin
      peak_o.max_core <= register_pkg::ResetMaxCore;
    end
    if (saturation_level_take) peak_o.saturation_level <= peak_q.saturation_level;
    if (saturation_level_taken_rst) begin
      peak_o.saturation_level <= register_pkg::ResetSaturationLevel;
    end
    if (peak_rst) begin
      peak_q.period_n <= register_pkg::ResetPeriodN;
      peak_q.noise_row <= register_pkg::ResetNoiseRow;
      peak_q.k_noise <= register_pkg::ResetKNoise;
      peak_q.k_height <= register_pkg::ResetKHeight;
      peak_q.snr_min <= register_pkg::ResetSnrMin;
      peak_q.min_width <= register_pkg::ResetMinWidth;
      peak_q.max_width <= register_pkg::ResetMaxWidth;
      peak_q.kappa <= register_pkg::ResetKappa;
      peak_q.c_sfm_gain <= register_pkg::ResetCSfmGain;
      peak_q.window_two_pass <= register_pkg::ResetWindowTwoPass;
      peak_q.window_fit <= register_pkg::ResetWindowFit;
      peak_q.max_core <= register_pkg::ResetMaxCore;
      peak_q.saturation_level <= register_pkg::ResetSaturationLevel;
    end
    if (centre_take) geometry_o.centre <= geometry_q.centre;
    if (centre_taken_rst) begin
      geometry_o.centre <= register_pkg::ResetCentre;
    end
    if (k1_take) geometry_o.k1 <= geometry_q.k1;
    if (k1_taken_rst) begin
      geometry_o.k1 <= register_pkg::ResetK1;
    end
    if (k2_take) geometry_o.k2 <= geometry_q.k2;
    if (k2_taken_rst) begin
      geometry_o.k2 <= register_pkg::ResetK2;
    end
    if (even_take) geometry_o.even <= geometry_q.even;
    if (even_taken_rst) begin
      geometry_o.even <= register_pkg::ResetEven;
    end
    if (n0_take) geometry_o.n0 <= geometry_q.n0;
    if (n0_taken_rst) begin
      geometry_o.n0 <= register_pkg::ResetN0;
    end
    if (n1_take) geometry_o.n1 <= geometry_q.n1;
    if (n1_taken_rst) begin
      geometry_o.n1 <= register_pkg::ResetN1;
    end
    if (d0_take) geometry_o.d0 <= geometry_q.d0;
    if (d0_taken_rst) begin
      geometry_o.d0 <= register_pkg::ResetD0;
    end
    if (d1_take) geometry_o.d1 <= geometry_q.d1;
    if (d1_taken_rst) begin
      geometry_o.d1 <= register_pkg::ResetD1;
    end
    if (e0_take) geometry_o.e0 <= geometry_q.e0;
    if (e0_taken_rst) begin
      geometry_o.e0 <= register_pkg::ResetE0;
    end
    if (e1_take) geometry_o.e1 <= geometry_q.e1;
    if (e1_taken_rst) begin
      geometry_o.e1 <= register_pkg::ResetE1;
    end
    if (tolerance_take) geometry_o.tolerance <= geometry_q.tolerance;
    if (tolerance_taken_rst) begin
      geometry_o.tolerance <= register_pkg::ResetTolerance;
    end
    if (length_unit_take) geometry_o.length_unit <= geometry_q.length_unit;
    if (length_unit_taken_rst) begin
      geometry_o.length_unit <= register_pkg::ResetLengthUnit;
    end
    if (c_obj_gain_take) geometry_o.c_obj_gain <= geometry_q.c_obj_gain;
    if (c_obj_gain_taken_rst) begin
      geometry_o.c_obj_gain <= register_pkg::ResetCObjGain;
    end
    if (geometry_rst) begin
      centre_low_q <= register_pkg::ResetCentre[31:0];
      geometry_q.centre <= register_pkg::ResetCentre;
      geometry_q.k1 <= register_pkg::ResetK1;
      geometry_q.k2 <= register_pkg::ResetK2;
      geometry_q.even <= register_pkg::ResetEven;
      geometry_q.n0 <= register_pkg::ResetN0;
      geometry_q.n1 <= register_pkg::ResetN1;
      geometry_q.d0 <= register_pkg::ResetD0;
      geometry_q.d1 <= register_pkg::ResetD1;
      geometry_q.e0 <= register_pkg::ResetE0;
      geometry_q.e1 <= register_pkg::ResetE1;
      geometry_q.tolerance <= register_pkg::ResetTolerance;
      geometry_q.length_unit <= register_pkg::ResetLengthUnit;
      geometry_q.c_obj_gain <= register_pkg::ResetCObjGain;
    end
    if (free_begin_take) free_o.free_begin <= free_q.free_begin;
    if (free_begin_taken_rst) begin
      free_o.free_begin <= register_pkg::ResetFreeBegin;
    end
    if (free_shift_take) free_o.free_shift <= free_q.free_shift;
    if (free_shift_taken_rst) begin
      free_o.free_shift <= register_pkg::ResetFreeShift;
    end
    if (free_rst) begin
      free_q.free_begin <= register_pkg::ResetFreeBegin;
      free_q.free_shift <= register_pkg::ResetFreeShift;
    end
    if (mirror_rst) begin
      mirror_o.mirror_enable <= register_pkg::ResetMirrorEnable;
      mirror_o.line_enable <= register_pkg::ResetLineEnable;
      sweep_word_low_q <= register_pkg::ResetSweepWord[31:0];
      mirror_o.sweep_word <= register_pkg::ResetSweepWord;
      work_word_low_q <= register_pkg::ResetWorkWord[31:0];
      mirror_o.work_word <= register_pkg::ResetWorkWord;
      mirror_o.sweep_rate <= register_pkg::ResetSweepRate;
      mirror_o.glitch_clks <= register_pkg::ResetGlitchClks;
      mirror_o.width_min_clks <= register_pkg::ResetWidthMinClks;
      mirror_o.width_max_clks <= register_pkg::ResetWidthMaxClks;
      mirror_o.period_max_clks <= register_pkg::ResetPeriodMaxClks;
      mirror_o.phase_shift <= register_pkg::ResetPhaseShift;
      mirror_o.rate_shift <= register_pkg::ResetRateShift;
      mirror_o.amplitude_shift <= register_pkg::ResetAmplitudeShift;
      mirror_o.error_limit <= register_pkg::ResetErrorLimit;
      mirror_o.amplitude_set <= register_pkg::ResetAmplitudeSet;
      mirror_o.k_p <= register_pkg::ResetKP;
      mirror_o.k_i <= register_pkg::ResetKI;
      mirror_o.level_low <= register_pkg::ResetLevelLow;
      mirror_o.level_high <= register_pkg::ResetLevelHigh;
      mirror_o.level_nominal <= register_pkg::ResetLevelNominal;
      mirror_o.trim_step <= register_pkg::ResetTrimStep;
      mirror_o.trim_gain <= register_pkg::ResetTrimGain;
      mirror_o.trim_up <= register_pkg::ResetTrimUp;
      mirror_o.settle_limit <= register_pkg::ResetSettleLimit;
      mirror_o.shock_limit <= register_pkg::ResetShockLimit;
      mirror_o.phase_limit <= register_pkg::ResetPhaseLimit;
      mirror_o.settle_count <= register_pkg::ResetSettleCount;
      mirror_o.hold_count <= register_pkg::ResetHoldCount;
      mirror_o.confidence_gain <= register_pkg::ResetConfidenceGain;
    end
    if (mirror_limits_rst) begin
      mirror_limits_o.duty <= register_pkg::ResetDuty;
      mirror_limits_o.sweep_level <= register_pkg::ResetSweepLevel;
      mirror_limits_o.level_min <= register_pkg::ResetLevelMin;
      mirror_limits_o.level_max <= register_pkg::ResetLevelMax;
      mirror_limits_o.trim_min <= register_pkg::ResetTrimMin;
      mirror_limits_o.trim_max <= register_pkg::ResetTrimMax;
      mirror_limits_o.sweep_timeout <= register_pkg::ResetSweepTimeout;
      mirror_limits_o.settle_timeout <= register_pkg::ResetSettleTimeout;
      mirror_limits_o.lost_timeout <= register_pkg::ResetLostTimeout;
    end
    if (drive_phase_take) motion_o.drive_phase <= motion_q.drive_phase;
    if (drive_phase_taken_rst) begin
      motion_o.drive_phase <= register_pkg::ResetDrivePhase;
    end
    if (motion_a_take) motion_o.motion_a <= motion_q.motion_a;
    if (motion_a_taken_rst) begin
      motion_o.motion_a <= register_pkg::ResetMotionA;
    end
    if (motion_phi_take) motion_o.motion_phi <= motion_q.motion_phi;
    if (motion_phi_taken_rst) begin
      motion_o.motion_phi <= register_pkg::ResetMotionPhi;
    end
    if (motion_da_take) motion_o.motion_da <= motion_q.motion_da;
    if (motion_da_taken_rst) begin
      motion_o.motion_da <= register_pkg::ResetMotionDa;
    end
    if (motion_dphi_take) motion_o.motion_dphi <= motion_q.motion_dphi;
    if (motion_dphi_taken_rst) begin
      motion_o.motion_dphi <= register_pkg::ResetMotionDphi;
    end
    if (scan_facet_take) motion_o.scan_facet <= motion_q.scan_facet;
    if (scan_facet_taken_rst) begin
      motion_o.scan_facet <= register_pkg::ResetScanFacet;
    end
    if (scan_begin_take) motion_o.scan_begin <= motion_q.scan_begin;
    if (scan_begin_taken_rst) begin
      motion_o.scan_begin <= register_pkg::ResetScanBegin;
    end
    if (scan_span_take) motion_o.scan_span <= motion_q.scan_span;
    if (scan_span_taken_rst) begin
      motion_o.scan_span <= register_pkg::ResetScanSpan;
    end
    if (motion_rst) begin
      motion_q.drive_phase <= register_pkg::ResetDrivePhase;
      motion_q.motion_a <= register_pkg::ResetMotionA;
      motion_q.motion_phi <= register_pkg::ResetMotionPhi;
      motion_q.motion_da <= register_pkg::ResetMotionDa;
      motion_q.motion_dphi <= register_pkg::ResetMotionDphi;
      motion_q.scan_facet <= register_pkg::ResetScanFacet;
      motion_q.scan_begin <= register_pkg::ResetScanBegin;
      motion_q.scan_span <= register_pkg::ResetScanSpan;
    end
    if (line_rst) begin
      ratio_low_q <= register_pkg::ResetRatio[31:0];
      line_o.ratio <= register_pkg::ResetRatio;
      line_o.exposure_delay_clks <= register_pkg::ResetExposureDelayClks;
      line_o.exposure_clks <= register_pkg::ResetExposureClks;
      line_o.pulse_delay_clks <= register_pkg::ResetPulseDelayClks;
      line_o.pulse_clks <= register_pkg::ResetPulseClks;
    end
    if (link_rst) begin
      link_o.uart_step <= register_pkg::ResetUartStep;
      link_o.uart_step_strobe <= 1'b0;
    end
    if (laser_rst) begin
      laser_o.laser_enable <= register_pkg::ResetLaserEnable;
      laser_o.laser_adapt <= register_pkg::ResetLaserAdapt;
      laser_o.laser_shared <= register_pkg::ResetLaserShared;
      laser_o.laser_power <= register_pkg::ResetLaserPower;
      laser_o.laser_power_min <= register_pkg::ResetLaserPowerMin;
      laser_o.laser_power_max <= register_pkg::ResetLaserPowerMax;
      laser_o.laser_startup <= register_pkg::ResetLaserStartup;
      laser_o.laser_target <= register_pkg::ResetLaserTarget;
      laser_o.laser_cut <= register_pkg::ResetLaserCut;
      laser_o.laser_down <= register_pkg::ResetLaserDown;
      laser_o.laser_up <= register_pkg::ResetLaserUp;
      laser_o.laser_search <= register_pkg::ResetLaserSearch;
      laser_o.laser_index_begin <= register_pkg::ResetLaserIndexBegin;
      laser_o.laser_index_end <= register_pkg::ResetLaserIndexEnd;
    end
    if (laser_limits_rst) begin
      laser_limits_o.laser_limit_power <= register_pkg::ResetLaserLimitPower;
      laser_limits_o.laser_limit_startup <= register_pkg::ResetLaserLimitStartup;
      laser_limits_o.laser_limit_pulse_clks <= register_pkg::ResetLaserLimitPulseClks;
      laser_limits_o.laser_limit_drain <= register_pkg::ResetLaserLimitDrain;
      laser_limits_o.laser_limit_bucket <= register_pkg::ResetLaserLimitBucket;
      laser_limits_o.laser_watchdog_clks <= register_pkg::ResetLaserWatchdogClks;
    end
    if (points_rst) begin
      points_o.points_batch <= register_pkg::ResetPointsBatch;
      points_o.points_timeout_clks <= register_pkg::ResetPointsTimeoutClks;
    end
    if (focus_rst) begin
      focus_o.focus_mode <= register_pkg::ResetFocusMode;
      focus_o.focus_manual <= register_pkg::ResetFocusManual;
      focus_o.focus_average_shift <= register_pkg::ResetFocusAverageShift;
      focus_o.focus_lapse <= register_pkg::ResetFocusLapse;
      focus_o.focus_z_begin <= register_pkg::ResetFocusZBegin;
      focus_o.focus_z_shift <= register_pkg::ResetFocusZShift;
      focus_o.focus_hysteresis <= register_pkg::ResetFocusHysteresis;
      focus_o.focus_hold_points <= register_pkg::ResetFocusHoldPoints;
      focus_o.focus_address <= register_pkg::ResetFocusAddress;
      focus_o.focus_quarter_clks <= register_pkg::ResetFocusQuarterClks;
      focus_o.focus_stretch_clks <= register_pkg::ResetFocusStretchClks;
      focus_o.focus_poll_clks <= register_pkg::ResetFocusPollClks;
      focus_o.focus_tolerance <= register_pkg::ResetFocusTolerance;
      focus_o.focus_timeout_clks <= register_pkg::ResetFocusTimeoutClks;
      focus_o.focus_retries <= register_pkg::ResetFocusRetries;
      focus_o.focus_protocol <= register_pkg::ResetFocusProtocol;
    end
    if (test_rst) begin
      test_o.test_position <= register_pkg::ResetTestPosition;
      test_o.test_move <= register_pkg::ResetTestMove;
      test_o.test_step <= register_pkg::ResetTestStep;
      test_o.test_height <= register_pkg::ResetTestHeight;
      test_o.test_pedestal <= register_pkg::ResetTestPedestal;
      test_o.test_noise <= register_pkg::ResetTestNoise;
      test_o.test_seed <= register_pkg::ResetTestSeed;
      test_o.test_lines <= register_pkg::ResetTestLines;
      test_o.test_period_clks <= register_pkg::ResetTestPeriodClks;
      test_o.test_angle <= register_pkg::ResetTestAngle;
      test_o.test_power <= register_pkg::ResetTestPower;
      test_o.test_start <= register_pkg::ResetTestStart;
      test_o.test_start_strobe <= 1'b0;
      test_o.test_stop <= register_pkg::ResetTestStop;
      test_o.test_stop_strobe <= 1'b0;
    end
    if (sensor_rst) begin
      sensor_o.readout_lag <= register_pkg::ResetReadoutLag;
      sensor_o.readout_stale <= register_pkg::ResetReadoutStale;
      sensor_o.readout_min_clks <= register_pkg::ResetReadoutMinClks;
      sensor_o.readout_max_clks <= register_pkg::ResetReadoutMaxClks;
    end
    if (commit_rst) begin
      commit_o.commit <= register_pkg::ResetCommit;
      commit_o.commit_strobe <= 1'b0;
    end
    if (map_enable_take) map_o.map_enable <= map_q.map_enable;
    if (map_enable_taken_rst) begin
      map_o.map_enable <= register_pkg::ResetMapEnable;
    end
    if (map_bank_take) map_o.map_bank <= map_q.map_bank;
    if (map_bank_taken_rst) begin
      map_o.map_bank <= register_pkg::ResetMapBank;
    end
    if (map_count_take) map_o.map_count <= map_q.map_count;
    if (map_count_taken_rst) begin
      map_o.map_count <= register_pkg::ResetMapCount;
    end
    if (map_begin_take) map_o.map_begin <= map_q.map_begin;
    if (map_begin_taken_rst) begin
      map_o.map_begin <= register_pkg::ResetMapBegin;
    end
    if (map_shift_take) map_o.map_shift <= map_q.map_shift;
    if (map_shift_taken_rst) begin
      map_o.map_shift <= register_pkg::ResetMapShift;
    end
    if (map_follow_take) map_o.map_follow <= map_q.map_follow;
    if (map_follow_taken_rst) begin
      map_o.map_follow <= register_pkg::ResetMapFollow;
    end
    if (map_lens_take) map_o.map_lens <= map_q.map_lens;
    if (map_lens_taken_rst) begin
      map_o.map_lens <= register_pkg::ResetMapLens;
    end
    if (map_rst) begin
      map_q.map_enable <= register_pkg::ResetMapEnable;
      map_q.map_bank <= register_pkg::ResetMapBank;
      map_q.map_count <= register_pkg::ResetMapCount;
      map_q.map_begin <= register_pkg::ResetMapBegin;
      map_q.map_shift <= register_pkg::ResetMapShift;
      map_q.map_follow <= register_pkg::ResetMapFollow;
      map_q.map_lens <= register_pkg::ResetMapLens;
    end
    if (map_access_rst) begin
      map_access_o.map_access_bank <= register_pkg::ResetMapAccessBank;
    end
    if (locks_rst) begin
      locks_o.lock_calibration <= register_pkg::ResetLockCalibration;
      locks_o.lock_mirror <= register_pkg::ResetLockMirror;
      locks_o.lock_laser <= register_pkg::ResetLockLaser;
    end
  end

  // ---- table: written at 6, read back at 7 and 8 ----
  logic table_copy_q;
  logic [9:0] table_entry, table_entry_q;
  assign table_entry = copy_i ? copy_index_i[9:0] : table_index;
  logic [25:0] table_amplitude_mem[1024];
  logic [25:0] table_amplitude_q;
  logic [27:0] table_midpoint_mem[1024];
  logic [27:0] table_midpoint_q;
  // What the bus reads of an entry that it has not written.
  initial for (int k = 0; k < 1024; k = k + 1) begin
    table_amplitude_mem[k] = register_pkg::ResetTableAmplitude[26 * k+:26];
    table_midpoint_mem[k] = register_pkg::ResetTableMidpoint[28 * k+:28];
  end
  logic [31:0] table_read_q;
  always_ff @(posedge clk_i) begin
    if (write_q2 && table_hit_q && address_q[0:0] == 1'h0 && !rst)
      table_amplitude_mem[table_entry] <= data_q[25:0];
    table_amplitude_q <= table_amplitude_mem[table_entry];
    if (write_q2 && table_hit_q && address_q[0:0] == 1'h1 && !rst)
      table_midpoint_mem[table_entry] <= data_q[27:0];
    table_midpoint_q <= table_midpoint_mem[table_entry];
    table_copy_q  <= copy_i && !rst;
    table_entry_q <= table_entry;
    table_o.table_write      <= table_copy_q;
    table_o.table_index      <= table_entry_q;
    table_o.table_write_bank <= !bank_i;
    table_o.table_bank       <= bank_i;
    if (take_i) table_o.table_changed <= 1'b0;
    if (write_q2 && table_hit_q) table_o.table_changed <= 1'b1;
    if (rst) table_o.table_changed <= 1'b0;
    table_o.table_amplitude <= table_amplitude_q;
    table_o.table_midpoint <= signed'(table_midpoint_q);
    case (address_q[0:0])
      1'h0: table_read_q <= 32'(table_amplitude_q);
      1'h1: table_read_q <= 32'(signed'(table_midpoint_q));
      default: table_read_q <= '0;
    endcase
    if (rst) table_o.table_write <= 1'b0;
  end

  // ---- focus_table: written at 6, read back at 7 and 8 ----
  logic [15:0] focus_table_position_mem[64];
  logic [15:0] focus_table_position_q;
  // What the bus reads of an entry that it has not written.
  initial for (int k = 0; k < 64; k = k + 1) begin
    focus_table_position_mem[k] = register_pkg::ResetFocusTablePosition[16 * k+:16];
  end
  logic [31:0] focus_table_read_q;
  always_ff @(posedge clk_i) begin
    if (write_q2 && focus_table_hit_q && !rst)
      focus_table_position_mem[focus_table_index] <= data_q[15:0];
    focus_table_position_q <= focus_table_position_mem[focus_table_index];
    focus_table_o.focus_table_write <= 1'b0;
    if (write_q2 && focus_table_hit_q) begin
      focus_table_o.focus_table_write <= 1'b1;
      focus_table_o.focus_table_index <= focus_table_index;
      focus_table_o.focus_table_position <= data_q[15:0];
    end
    focus_table_read_q <= 32'(focus_table_position_q);
    if (rst) focus_table_o.focus_table_write <= 1'b0;
  end

  // ---- free_table: written at 6, read back at 7 and 8 ----
  logic free_table_copy_q;
  logic [7:0] free_table_entry, free_table_entry_q;
  assign free_table_entry = copy_i ? copy_index_i[7:0] : free_table_index;
  logic [15:0] free_table_from_mem[256];
  logic [15:0] free_table_from_q;
  logic [15:0] free_table_to_mem[256];
  logic [15:0] free_table_to_q;
  // What the bus reads of an entry that it has not written.
  initial for (int k = 0; k < 256; k = k + 1) begin
    free_table_from_mem[k] = register_pkg::ResetFreeTableFrom[16 * k+:16];
    free_table_to_mem[k] = register_pkg::ResetFreeTableTo[16 * k+:16];
  end
  logic [31:0] free_table_read_q;
  always_ff @(posedge clk_i) begin
    if (write_q2 && free_table_hit_q && address_q[0:0] == 1'h0 && !rst)
      free_table_from_mem[free_table_entry] <= data_q[15:0];
    free_table_from_q <= free_table_from_mem[free_table_entry];
    if (write_q2 && free_table_hit_q && address_q[0:0] == 1'h1 && !rst)
      free_table_to_mem[free_table_entry] <= data_q[15:0];
    free_table_to_q <= free_table_to_mem[free_table_entry];
    free_table_copy_q  <= copy_i && !rst;
    free_table_entry_q <= free_table_entry;
    free_table_o.free_table_write      <= free_table_copy_q;
    free_table_o.free_table_index      <= free_table_entry_q;
    free_table_o.free_table_write_bank <= !bank_i;
    free_table_o.free_table_bank       <= bank_i;
    if (take_i) free_table_o.free_table_changed <= 1'b0;
    if (write_q2 && free_table_hit_q) free_table_o.free_table_changed <= 1'b1;
    if (rst) free_table_o.free_table_changed <= 1'b0;
    free_table_o.free_table_from <= free_table_from_q;
    free_table_o.free_table_to <= free_table_to_q;
    case (address_q[0:0])
      1'h0: free_table_read_q <= 32'(free_table_from_q);
      1'h1: free_table_read_q <= 32'(free_table_to_q);
      default: free_table_read_q <= '0;
    endcase
    if (rst) free_table_o.free_table_write <= 1'b0;
  end

  // ---- map_table: goes out at 6, comes back at 12 ----
  logic [31:0] map_table_read_q;
  always_ff @(posedge clk_i) begin
    map_table_o.map_table_write       <= write_q2 && map_table_hit_q && !rst;
    map_table_o.map_table_access_bank <= map_access_o.map_access_bank;
    map_table_o.map_table_index       <= map_table_index;
    map_table_o.map_table_node <= data_q[17:0];
    map_table_read_q <= 32'(map_table_status_i.map_table_read);
  end

  // ---- 10: half a page's words, wide ones whole; 11: a page ----
  logic [15:0] uptime_high_q;
  logic [7:0] mirror_word_high_q;
  logic [15:0] mirror_drive_phase_high_q;
  logic [15:0] mirror_phase_high_q;
  logic [3:0] keep_q;
  always_ff @(posedge clk_i) begin
    keep_q[0] <= step_q[9] && read && page_00_hit_q && word_hit_q[11];
    if (keep_q[0]) uptime_high_q <= identity_status_i.uptime[47:32];
    keep_q[1] <= step_q[9] && read && page_0c_hit_q && word_hit_q[2];
    if (keep_q[1]) mirror_word_high_q <= mirror_status_i.mirror_word[39:32];
    keep_q[2] <= step_q[9] && read && page_0c_hit_q && word_hit_q[4];
    if (keep_q[2]) mirror_drive_phase_high_q <= mirror_status_i.mirror_drive_phase[47:32];
    keep_q[3] <= step_q[9] && read && page_0c_hit_q && word_hit_q[6];
    if (keep_q[3]) mirror_phase_high_q <= mirror_status_i.mirror_phase[47:32];
    if (rst) begin
      keep_q <= '0;
      uptime_high_q <= '0;
      mirror_word_high_q <= '0;
      mirror_drive_phase_high_q <= '0;
      mirror_phase_high_q <= '0;
    end
  end

  logic [31:0] page_00_q;
  logic [3:0] page_00_word;
  local_register #(.Width(4)) u_page_00_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_00_word)
  );
  logic [31:0] page_00_low_q;
  logic [31:0] page_00_high_q;
  always_ff @(posedge clk_i) begin
    case (page_00_word[2:0])
      3'h0: page_00_low_q <= 32'h56525343;
      3'h1: page_00_low_q <= 32'h0b1a6568;
      3'h2: page_00_low_q <= 32'h00000100;
      3'h3: page_00_low_q <= 32'(identity_status_i.board_id);
      3'h4: page_00_low_q <= identity_status_i.clock_hz;
      3'h5: page_00_low_q <= 32'(identity_status_i.line_length);
      3'h6: page_00_low_q <= 32'(identity_status_i.pixel_width);
      default: page_00_low_q <= 32'(identity_status_i.max_window);
    endcase
    case (page_00_word[2:0])
      3'h0: page_00_high_q <= 32'(identity_status_i.lanes);
      3'h1: page_00_high_q <= 32'(identity_status_i.index_oversample);
      3'h2: page_00_high_q <= identity_o.scratch;
      3'h3: page_00_high_q <= identity_status_i.uptime[31:0];
      default: page_00_high_q <= 32'(uptime_high_q);
    endcase
    page_00_q <= page_00_word[3] ? page_00_high_q : page_00_low_q;
    if (!page_00_hit_q) page_00_q <= '0;
  end

  logic [31:0] page_01_q;
  logic [3:0] page_01_word;
  local_register #(.Width(4)) u_page_01_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_01_word)
  );
  logic [31:0] page_01_low_q;
  logic [31:0] page_01_high_q;
  always_ff @(posedge clk_i) begin
    case (page_01_word[2:0])
      3'h0: page_01_low_q <= 32'(peak_q.period_n);
      3'h1: page_01_low_q <= 32'(peak_q.noise_row);
      3'h2: page_01_low_q <= 32'(peak_q.k_noise);
      3'h3: page_01_low_q <= 32'(peak_q.k_height);
      3'h4: page_01_low_q <= 32'(peak_q.snr_min);
      3'h5: page_01_low_q <= 32'(peak_q.min_width);
      3'h6: page_01_low_q <= 32'(peak_q.max_width);
      default: page_01_low_q <= 32'(peak_q.kappa);
    endcase
    case (page_01_word[2:0])
      3'h0: page_01_high_q <= 32'(peak_q.c_sfm_gain);
      3'h1: page_01_high_q <= 32'(peak_q.window_two_pass);
      3'h2: page_01_high_q <= 32'(peak_q.window_fit);
      3'h3: page_01_high_q <= 32'(peak_q.max_core);
      default: page_01_high_q <= 32'(peak_q.saturation_level);
    endcase
    page_01_q <= page_01_word[3] ? page_01_high_q : page_01_low_q;
    if (!page_01_hit_q) page_01_q <= '0;
  end

  logic [31:0] page_02_q;
  logic [3:0] page_02_word;
  local_register #(.Width(4)) u_page_02_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_02_word)
  );
  logic [31:0] page_02_low_q;
  logic [31:0] page_02_high_q;
  always_ff @(posedge clk_i) begin
    case (page_02_word[2:0])
      3'h0: page_02_low_q <= unsigned'(centre_low_q);
      3'h1: page_02_low_q <= 32'(signed'(geometry_q.centre[33:32]));
      3'h2: page_02_low_q <= 32'(geometry_q.k1);
      3'h3: page_02_low_q <= 32'(geometry_q.k2);
      3'h4: page_02_low_q <= 32'(geometry_q.even);
      3'h5: page_02_low_q <= unsigned'(geometry_q.n0);
      3'h6: page_02_low_q <= unsigned'(geometry_q.n1);
      default: page_02_low_q <= unsigned'(geometry_q.d0);
    endcase
    case (page_02_word[2:0])
      3'h0: page_02_high_q <= unsigned'(geometry_q.d1);
      3'h1: page_02_high_q <= unsigned'(geometry_q.e0);
      3'h2: page_02_high_q <= unsigned'(geometry_q.e1);
      3'h3: page_02_high_q <= 32'(geometry_q.tolerance);
      3'h4: page_02_high_q <= 32'(geometry_q.length_unit);
      default: page_02_high_q <= 32'(geometry_q.c_obj_gain);
    endcase
    page_02_q <= page_02_word[3] ? page_02_high_q : page_02_low_q;
    if (!page_02_hit_q) page_02_q <= '0;
  end

  logic [31:0] page_03_q;
  logic [3:0] page_03_word;
  local_register #(.Width(4)) u_page_03_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_03_word)
  );
  logic [31:0] page_03_low_q;
  logic [31:0] page_03_high_q;
  always_ff @(posedge clk_i) begin
    case (page_03_word[2:0])
      3'h0: page_03_low_q <= 32'(chain_i.short_count);
      3'h1: page_03_low_q <= 32'(chain_i.long_count);
      3'h2: page_03_low_q <= 32'(chain_i.unfinished_count);
      3'h3: page_03_low_q <= 32'(chain_i.early_count);
      3'h4: page_03_low_q <= 32'(chain_i.dropped_count);
      default: page_03_low_q <= 32'(chain_i.skipped_count);
    endcase
    case (page_03_word[2:0])
      3'h0: page_03_high_q <= 32'(free_q.free_begin);
      default: page_03_high_q <= 32'(free_q.free_shift);
    endcase
    page_03_q <= page_03_word[3] ? page_03_high_q : page_03_low_q;
    if (!page_03_hit_q) page_03_q <= '0;
  end

  logic [31:0] page_04_q;
  logic [3:0] page_04_word;
  local_register #(.Width(4)) u_page_04_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_04_word)
  );
  logic [31:0] page_04_low_q;
  logic [31:0] page_04_high_q;
  always_ff @(posedge clk_i) begin
    case (page_04_word[2:0])
      3'h0: page_04_low_q <= 32'(mirror_o.mirror_enable);
      3'h1: page_04_low_q <= 32'(mirror_o.line_enable);
      3'h2: page_04_low_q <= sweep_word_low_q;
      3'h3: page_04_low_q <= 32'(mirror_o.sweep_word[39:32]);
      3'h4: page_04_low_q <= work_word_low_q;
      3'h5: page_04_low_q <= 32'(mirror_o.work_word[39:32]);
      3'h6: page_04_low_q <= mirror_o.sweep_rate;
      default: page_04_low_q <= 32'(mirror_o.glitch_clks);
    endcase
    case (page_04_word[2:0])
      3'h0: page_04_high_q <= mirror_o.width_min_clks;
      3'h1: page_04_high_q <= mirror_o.width_max_clks;
      3'h2: page_04_high_q <= mirror_o.period_max_clks;
      3'h3: page_04_high_q <= 32'(mirror_o.phase_shift);
      3'h4: page_04_high_q <= 32'(mirror_o.rate_shift);
      3'h5: page_04_high_q <= 32'(mirror_o.amplitude_shift);
      3'h6: page_04_high_q <= 32'(mirror_o.error_limit);
      default: page_04_high_q <= 32'(mirror_o.amplitude_set);
    endcase
    page_04_q <= page_04_word[3] ? page_04_high_q : page_04_low_q;
    if (!page_04_hit_q) page_04_q <= '0;
  end

  logic [31:0] page_05_q;
  logic [3:0] page_05_word;
  local_register #(.Width(4)) u_page_05_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_05_word)
  );
  logic [31:0] page_05_low_q;
  logic [31:0] page_05_high_q;
  always_ff @(posedge clk_i) begin
    case (page_05_word[2:0])
      3'h0: page_05_low_q <= 32'(mirror_o.k_p);
      3'h1: page_05_low_q <= 32'(mirror_o.k_i);
      3'h2: page_05_low_q <= 32'(mirror_o.level_low);
      3'h3: page_05_low_q <= 32'(mirror_o.level_high);
      3'h4: page_05_low_q <= 32'(mirror_o.level_nominal);
      3'h5: page_05_low_q <= 32'(mirror_o.trim_step);
      3'h6: page_05_low_q <= 32'(mirror_o.trim_gain);
      default: page_05_low_q <= 32'(mirror_o.trim_up);
    endcase
    case (page_05_word[2:0])
      3'h0: page_05_high_q <= 32'(mirror_o.settle_limit);
      3'h1: page_05_high_q <= 32'(mirror_o.shock_limit);
      3'h2: page_05_high_q <= 32'(mirror_o.phase_limit);
      3'h3: page_05_high_q <= 32'(mirror_o.settle_count);
      3'h4: page_05_high_q <= 32'(mirror_o.hold_count);
      default: page_05_high_q <= 32'(mirror_o.confidence_gain);
    endcase
    page_05_q <= page_05_word[3] ? page_05_high_q : page_05_low_q;
    if (!page_05_hit_q) page_05_q <= '0;
  end

  logic [31:0] page_06_q;
  logic [3:0] page_06_word;
  local_register #(.Width(4)) u_page_06_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_06_word)
  );
  logic [31:0] page_06_low_q;
  logic [31:0] page_06_high_q;
  always_ff @(posedge clk_i) begin
    case (page_06_word[2:0])
      3'h0: page_06_low_q <= 32'(mirror_limits_o.duty);
      3'h1: page_06_low_q <= 32'(mirror_limits_o.sweep_level);
      3'h2: page_06_low_q <= 32'(mirror_limits_o.level_min);
      3'h3: page_06_low_q <= 32'(mirror_limits_o.level_max);
      3'h4: page_06_low_q <= unsigned'(mirror_limits_o.trim_min);
      3'h5: page_06_low_q <= unsigned'(mirror_limits_o.trim_max);
      3'h6: page_06_low_q <= mirror_limits_o.sweep_timeout;
      default: page_06_low_q <= mirror_limits_o.settle_timeout;
    endcase
    page_06_high_q <= mirror_limits_o.lost_timeout;
    page_06_q <= page_06_word[3] ? page_06_high_q : page_06_low_q;
    if (!page_06_hit_q) page_06_q <= '0;
  end

  logic [31:0] page_08_q;
  logic [3:0] page_08_word;
  local_register #(.Width(4)) u_page_08_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_08_word)
  );
  logic [31:0] page_08_low_q;
  logic [31:0] page_08_high_q;
  always_ff @(posedge clk_i) begin
    case (page_08_word[2:0])
      3'h0: page_08_low_q <= 32'(motion_q.drive_phase);
      3'h1: page_08_low_q <= 32'(signed'(motion_q.motion_a[0+:24]));
      3'h2: page_08_low_q <= 32'(signed'(motion_q.motion_a[24+:24]));
      3'h3: page_08_low_q <= 32'(signed'(motion_q.motion_a[48+:24]));
      3'h4: page_08_low_q <= 32'(signed'(motion_q.motion_a[72+:24]));
      3'h5: page_08_low_q <= 32'(signed'(motion_q.motion_a[96+:24]));
      3'h6: page_08_low_q <= 32'(signed'(motion_q.motion_a[120+:24]));
      default: page_08_low_q <= 32'(signed'(motion_q.motion_a[144+:24]));
    endcase
    case (page_08_word[2:0])
      3'h0: page_08_high_q <= 32'(signed'(motion_q.motion_a[168+:24]));
      3'h1: page_08_high_q <= 32'(signed'(motion_q.motion_a[192+:24]));
      3'h2: page_08_high_q <= 32'(motion_q.motion_phi[0+:28]);
      3'h3: page_08_high_q <= 32'(motion_q.motion_phi[28+:28]);
      3'h4: page_08_high_q <= 32'(motion_q.motion_phi[56+:28]);
      3'h5: page_08_high_q <= 32'(motion_q.motion_phi[84+:28]);
      3'h6: page_08_high_q <= 32'(motion_q.motion_phi[112+:28]);
      default: page_08_high_q <= 32'(motion_q.motion_phi[140+:28]);
    endcase
    page_08_q <= page_08_word[3] ? page_08_high_q : page_08_low_q;
    if (!page_08_hit_q) page_08_q <= '0;
  end

  logic [31:0] page_09_q;
  logic [3:0] page_09_word;
  local_register #(.Width(4)) u_page_09_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_09_word)
  );
  logic [31:0] page_09_low_q;
  logic [31:0] page_09_high_q;
  always_ff @(posedge clk_i) begin
    case (page_09_word[2:0])
      3'h0: page_09_low_q <= 32'(motion_q.motion_phi[168+:28]);
      3'h1: page_09_low_q <= 32'(motion_q.motion_phi[196+:28]);
      3'h2: page_09_low_q <= 32'(motion_q.motion_phi[224+:28]);
      3'h3: page_09_low_q <= 32'(signed'(motion_q.motion_da[0+:24]));
      3'h4: page_09_low_q <= 32'(signed'(motion_q.motion_da[24+:24]));
      3'h5: page_09_low_q <= 32'(signed'(motion_q.motion_da[48+:24]));
      3'h6: page_09_low_q <= 32'(signed'(motion_q.motion_da[72+:24]));
      default: page_09_low_q <= 32'(signed'(motion_q.motion_da[96+:24]));
    endcase
    case (page_09_word[2:0])
      3'h0: page_09_high_q <= 32'(signed'(motion_q.motion_da[120+:24]));
      3'h1: page_09_high_q <= 32'(signed'(motion_q.motion_da[144+:24]));
      3'h2: page_09_high_q <= 32'(signed'(motion_q.motion_da[168+:24]));
      3'h3: page_09_high_q <= 32'(signed'(motion_q.motion_da[192+:24]));
      3'h4: page_09_high_q <= 32'(signed'(motion_q.motion_dphi[0+:24]));
      3'h5: page_09_high_q <= 32'(signed'(motion_q.motion_dphi[24+:24]));
      3'h6: page_09_high_q <= 32'(signed'(motion_q.motion_dphi[48+:24]));
      default: page_09_high_q <= 32'(signed'(motion_q.motion_dphi[72+:24]));
    endcase
    page_09_q <= page_09_word[3] ? page_09_high_q : page_09_low_q;
    if (!page_09_hit_q) page_09_q <= '0;
  end

  logic [31:0] page_0a_q;
  logic [2:0] page_0a_word;
  local_register #(.Width(3)) u_page_0a_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_0a_word)
  );
  logic [31:0] page_0a_low_q;
  always_ff @(posedge clk_i) begin
    case (page_0a_word[2:0])
      3'h0: page_0a_low_q <= 32'(signed'(motion_q.motion_dphi[96+:24]));
      3'h1: page_0a_low_q <= 32'(signed'(motion_q.motion_dphi[120+:24]));
      3'h2: page_0a_low_q <= 32'(signed'(motion_q.motion_dphi[144+:24]));
      3'h3: page_0a_low_q <= 32'(signed'(motion_q.motion_dphi[168+:24]));
      3'h4: page_0a_low_q <= 32'(signed'(motion_q.motion_dphi[192+:24]));
      3'h5: page_0a_low_q <= 32'(motion_q.scan_facet);
      3'h6: page_0a_low_q <= 32'(motion_q.scan_begin);
      default: page_0a_low_q <= 32'(motion_q.scan_span);
    endcase
    page_0a_q <= page_0a_low_q;
    if (!page_0a_hit_q) page_0a_q <= '0;
  end

  logic [31:0] page_0b_q;
  logic [2:0] page_0b_word;
  local_register #(.Width(3)) u_page_0b_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_0b_word)
  );
  logic [31:0] page_0b_low_q;
  always_ff @(posedge clk_i) begin
    case (page_0b_word[2:0])
      3'h0: page_0b_low_q <= ratio_low_q;
      3'h1: page_0b_low_q <= 32'(line_o.ratio[43:32]);
      3'h2: page_0b_low_q <= 32'(line_o.exposure_delay_clks);
      3'h3: page_0b_low_q <= 32'(line_o.exposure_clks);
      3'h4: page_0b_low_q <= 32'(line_o.pulse_delay_clks);
      default: page_0b_low_q <= 32'(line_o.pulse_clks);
    endcase
    page_0b_q <= page_0b_low_q;
    if (!page_0b_hit_q) page_0b_q <= '0;
  end

  logic [31:0] page_0c_q;
  logic [3:0] page_0c_word;
  local_register #(.Width(4)) u_page_0c_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_0c_word)
  );
  logic [31:0] page_0c_low_q;
  logic [31:0] page_0c_high_q;
  always_ff @(posedge clk_i) begin
    case (page_0c_word[2:0])
      3'h0: page_0c_low_q <= 32'(mirror_status_i.mirror_state);
      3'h1: page_0c_low_q <= 32'(mirror_status_i.mirror_fault);
      3'h2: page_0c_low_q <= mirror_status_i.mirror_word[31:0];
      3'h3: page_0c_low_q <= 32'(mirror_word_high_q);
      3'h4: page_0c_low_q <= mirror_status_i.mirror_drive_phase[31:0];
      3'h5: page_0c_low_q <= 32'(mirror_drive_phase_high_q);
      3'h6: page_0c_low_q <= mirror_status_i.mirror_phase[31:0];
      default: page_0c_low_q <= 32'(mirror_phase_high_q);
    endcase
    case (page_0c_word[2:0])
      3'h0: page_0c_high_q <= 32'(mirror_status_i.mirror_level);
      3'h1: page_0c_high_q <= 32'(mirror_status_i.index_alive);
      3'h2: page_0c_high_q <= 32'(mirror_status_i.mirror_settled);
      3'h3: page_0c_high_q <= 32'(mirror_status_i.mirror_measured);
      3'h4: page_0c_high_q <= 32'(mirror_status_i.mirror_error);
      3'h5: page_0c_high_q <= 32'(mirror_status_i.missing_count);
      3'h6: page_0c_high_q <= 32'(mirror_status_i.doubled_count);
      default: page_0c_high_q <= 32'(mirror_status_i.impossible_count);
    endcase
    page_0c_q <= page_0c_word[3] ? page_0c_high_q : page_0c_low_q;
    if (!page_0c_hit_q) page_0c_q <= '0;
  end

  logic [31:0] page_0d_q;
  logic [2:0] page_0d_word;
  local_register #(.Width(3)) u_page_0d_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_0d_word)
  );
  logic [31:0] page_0d_low_q;
  always_ff @(posedge clk_i) begin
    case (page_0d_word[2:0])
      3'h0: page_0d_low_q <= 32'(mirror_status_i.glitch_count);
      default: page_0d_low_q <= 32'(mirror_status_i.overrun_count);
    endcase
    page_0d_q <= page_0d_low_q;
    if (!page_0d_hit_q) page_0d_q <= '0;
  end

  logic [31:0] page_0e_q;
  logic [3:0] page_0e_word;
  local_register #(.Width(4)) u_page_0e_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_0e_word)
  );
  logic [31:0] page_0e_low_q;
  logic [31:0] page_0e_high_q;
  always_ff @(posedge clk_i) begin
    case (page_0e_word[2:0])
      3'h0: page_0e_low_q <= 32'(link_o.uart_step);
      3'h1: page_0e_low_q <= 32'(link_status_i.uart_step_now);
      3'h2: page_0e_low_q <= 32'(link_status_i.uart_framing);
      3'h3: page_0e_low_q <= 32'(link_status_i.uart_breaks);
      3'h4: page_0e_low_q <= 32'(link_status_i.uart_glitches);
      3'h5: page_0e_low_q <= 32'(link_status_i.uart_fallbacks);
      3'h6: page_0e_low_q <= 32'(link_status_i.frames_good);
      default: page_0e_low_q <= 32'(link_status_i.frames_crc);
    endcase
    case (page_0e_word[2:0])
      3'h0: page_0e_high_q <= 32'(link_status_i.frames_malformed);
      3'h1: page_0e_high_q <= 32'(link_status_i.frames_too_long);
      3'h2: page_0e_high_q <= 32'(link_status_i.frames_too_short);
      3'h3: page_0e_high_q <= 32'(link_status_i.frames_framing);
      3'h4: page_0e_high_q <= 32'(link_status_i.commands_bad);
      default: page_0e_high_q <= 32'(link_status_i.commands_lost);
    endcase
    page_0e_q <= page_0e_word[3] ? page_0e_high_q : page_0e_low_q;
    if (!page_0e_hit_q) page_0e_q <= '0;
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
      3'h0: page_10_low_q <= 32'(laser_o.laser_enable);
      3'h1: page_10_low_q <= 32'(laser_o.laser_adapt);
      3'h2: page_10_low_q <= 32'(laser_o.laser_shared);
      3'h3: page_10_low_q <= 32'(laser_o.laser_power);
      3'h4: page_10_low_q <= 32'(laser_o.laser_power_min);
      3'h5: page_10_low_q <= 32'(laser_o.laser_power_max);
      3'h6: page_10_low_q <= 32'(laser_o.laser_startup);
      default: page_10_low_q <= 32'(laser_o.laser_target);
    endcase
    case (page_10_word[2:0])
      3'h0: page_10_high_q <= 32'(laser_o.laser_cut);
      3'h1: page_10_high_q <= 32'(laser_o.laser_down);
      3'h2: page_10_high_q <= 32'(laser_o.laser_up);
      3'h3: page_10_high_q <= 32'(laser_o.laser_search);
      3'h4: page_10_high_q <= 32'(laser_o.laser_index_begin);
      default: page_10_high_q <= 32'(laser_o.laser_index_end);
    endcase
    page_10_q <= page_10_word[3] ? page_10_high_q : page_10_low_q;
    if (!page_10_hit_q) page_10_q <= '0;
  end

  logic [31:0] page_12_q;
  logic [2:0] page_12_word;
  local_register #(.Width(3)) u_page_12_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_12_word)
  );
  logic [31:0] page_12_low_q;
  always_ff @(posedge clk_i) begin
    case (page_12_word[2:0])
      3'h0: page_12_low_q <= 32'(laser_limits_o.laser_limit_power);
      3'h1: page_12_low_q <= 32'(laser_limits_o.laser_limit_startup);
      3'h2: page_12_low_q <= 32'(laser_limits_o.laser_limit_pulse_clks);
      3'h3: page_12_low_q <= 32'(laser_limits_o.laser_limit_drain);
      3'h4: page_12_low_q <= laser_limits_o.laser_limit_bucket;
      default: page_12_low_q <= laser_limits_o.laser_watchdog_clks;
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
    case (page_13_word[2:0])
      3'h0: page_13_low_q <= 32'(laser_status_i.laser_status);
      3'h1: page_13_low_q <= 32'(laser_status_i.laser_power_inward);
      3'h2: page_13_low_q <= 32'(laser_status_i.laser_power_outward);
      3'h3: page_13_low_q <= 32'(laser_status_i.laser_cut_count);
      3'h4: page_13_low_q <= 32'(laser_status_i.laser_duty_count);
      3'h5: page_13_low_q <= 32'(laser_status_i.laser_watchdog_count);
      3'h6: page_13_low_q <= 32'(laser_status_i.laser_guard_fault);
      default: page_13_low_q <= 32'(laser_status_i.laser_guard_count);
    endcase
    page_13_q <= page_13_low_q;
    if (!page_13_hit_q) page_13_q <= '0;
  end

  logic [31:0] page_16_q;
  logic [2:0] page_16_word;
  local_register #(.Width(3)) u_page_16_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_16_word)
  );
  logic [31:0] page_16_low_q;
  always_ff @(posedge clk_i) begin
    case (page_16_word[2:0])
      3'h0: page_16_low_q <= 32'(points_o.points_batch);
      3'h1: page_16_low_q <= 32'(points_o.points_timeout_clks);
      3'h2: page_16_low_q <= 32'(points_status_i.points_dropped);
      default: page_16_low_q <= 32'(points_status_i.capture_busy);
    endcase
    page_16_q <= page_16_low_q;
    if (!page_16_hit_q) page_16_q <= '0;
  end

  logic [31:0] page_17_q;
  logic [2:0] page_17_word;
  local_register #(.Width(3)) u_page_17_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_17_word)
  );
  logic [31:0] page_17_low_q;
  always_ff @(posedge clk_i) begin
    case (page_17_word[2:0])
      3'h0: page_17_low_q <= 32'(axi_i.axi_points_dropped);
      3'h1: page_17_low_q <= 32'(axi_i.axi_lines_dropped);
      3'h2: page_17_low_q <= 32'(axi_i.axi_refused);
      default: page_17_low_q <= 32'(axi_i.axi_refused_address);
    endcase
    page_17_q <= page_17_low_q;
    if (!page_17_hit_q) page_17_q <= '0;
  end

  logic [31:0] page_18_q;
  logic [3:0] page_18_word;
  local_register #(.Width(4)) u_page_18_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_18_word)
  );
  logic [31:0] page_18_low_q;
  logic [31:0] page_18_high_q;
  always_ff @(posedge clk_i) begin
    case (page_18_word[2:0])
      3'h0: page_18_low_q <= 32'(focus_o.focus_mode);
      3'h1: page_18_low_q <= 32'(focus_o.focus_manual);
      3'h2: page_18_low_q <= 32'(focus_o.focus_average_shift);
      3'h3: page_18_low_q <= 32'(focus_o.focus_lapse);
      3'h4: page_18_low_q <= 32'(focus_o.focus_z_begin);
      3'h5: page_18_low_q <= 32'(focus_o.focus_z_shift);
      3'h6: page_18_low_q <= 32'(focus_o.focus_hysteresis);
      default: page_18_low_q <= 32'(focus_o.focus_hold_points);
    endcase
    case (page_18_word[2:0])
      3'h0: page_18_high_q <= 32'(focus_o.focus_address);
      3'h1: page_18_high_q <= 32'(focus_o.focus_quarter_clks);
      3'h2: page_18_high_q <= 32'(focus_o.focus_stretch_clks);
      3'h3: page_18_high_q <= 32'(focus_o.focus_poll_clks);
      3'h4: page_18_high_q <= 32'(focus_o.focus_tolerance);
      3'h5: page_18_high_q <= focus_o.focus_timeout_clks;
      3'h6: page_18_high_q <= 32'(focus_o.focus_retries);
      default: page_18_high_q <= 32'(focus_o.focus_protocol);
    endcase
    page_18_q <= page_18_word[3] ? page_18_high_q : page_18_low_q;
    if (!page_18_hit_q) page_18_q <= '0;
  end

  logic [31:0] page_1a_q;
  logic [3:0] page_1a_word;
  local_register #(.Width(4)) u_page_1a_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_1a_word)
  );
  logic [31:0] page_1a_low_q;
  logic [31:0] page_1a_high_q;
  always_ff @(posedge clk_i) begin
    case (page_1a_word[2:0])
      3'h0: page_1a_low_q <= 32'(focus_status_i.focus_state);
      3'h1: page_1a_low_q <= 32'(focus_status_i.focus_fault);
      3'h2: page_1a_low_q <= 32'(focus_status_i.focus_in_position);
      3'h3: page_1a_low_q <= 32'(focus_status_i.focus_distance);
      3'h4: page_1a_low_q <= 32'(focus_status_i.focus_target);
      3'h5: page_1a_low_q <= 32'(focus_status_i.focus_position);
      3'h6: page_1a_low_q <= 32'(focus_status_i.focus_nack_count);
      default: page_1a_low_q <= 32'(focus_status_i.focus_stretch_count);
    endcase
    case (page_1a_word[2:0])
      3'h0: page_1a_high_q <= 32'(focus_status_i.focus_stuck_count);
      3'h1: page_1a_high_q <= 32'(focus_status_i.focus_arbitration_count);
      3'h2: page_1a_high_q <= 32'(focus_status_i.focus_timeout_count);
      3'h3: page_1a_high_q <= 32'(focus_status_i.focus_recovery_count);
      3'h4: page_1a_high_q <= 32'(focus_status_i.focus_reply_count);
      default: page_1a_high_q <= 32'(focus_status_i.focus_motor_status);
    endcase
    page_1a_q <= page_1a_word[3] ? page_1a_high_q : page_1a_low_q;
    if (!page_1a_hit_q) page_1a_q <= '0;
  end

  logic [31:0] page_1c_q;
  logic [3:0] page_1c_word;
  local_register #(.Width(4)) u_page_1c_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_1c_word)
  );
  logic [31:0] page_1c_low_q;
  logic [31:0] page_1c_high_q;
  always_ff @(posedge clk_i) begin
    case (page_1c_word[2:0])
      3'h0: page_1c_low_q <= 32'(test_o.test_position);
      3'h1: page_1c_low_q <= 32'(test_o.test_move);
      3'h2: page_1c_low_q <= 32'(test_o.test_step);
      3'h3: page_1c_low_q <= 32'(test_o.test_height);
      3'h4: page_1c_low_q <= 32'(test_o.test_pedestal);
      3'h5: page_1c_low_q <= 32'(test_o.test_noise);
      3'h6: page_1c_low_q <= test_o.test_seed;
      default: page_1c_low_q <= test_o.test_lines;
    endcase
    case (page_1c_word[2:0])
      3'h0: page_1c_high_q <= 32'(test_o.test_period_clks);
      3'h1: page_1c_high_q <= 32'(test_o.test_angle);
      3'h2: page_1c_high_q <= 32'(test_o.test_power);
      3'h3: page_1c_high_q <= 32'(test_o.test_start);
      3'h4: page_1c_high_q <= 32'(test_o.test_stop);
      default: page_1c_high_q <= 32'(test_status_i.test_running);
    endcase
    page_1c_q <= page_1c_word[3] ? page_1c_high_q : page_1c_low_q;
    if (!page_1c_hit_q) page_1c_q <= '0;
  end

  logic [31:0] page_1d_q;
  logic [2:0] page_1d_word;
  local_register #(.Width(3)) u_page_1d_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_1d_word)
  );
  logic [31:0] page_1d_low_q;
  always_ff @(posedge clk_i) begin
    case (page_1d_word[2:0])
      3'h0: page_1d_low_q <= 32'(sensor_status_i.untagged_count);
      3'h1: page_1d_low_q <= 32'(sensor_status_i.pixel_overflow_count);
      3'h2: page_1d_low_q <= 32'(sensor_status_i.unread_count);
      3'h3: page_1d_low_q <= 32'(sensor_status_i.mistimed_count);
      3'h4: page_1d_low_q <= 32'(sensor_o.readout_lag);
      3'h5: page_1d_low_q <= 32'(sensor_o.readout_stale);
      3'h6: page_1d_low_q <= 32'(sensor_o.readout_min_clks);
      default: page_1d_low_q <= 32'(sensor_o.readout_max_clks);
    endcase
    page_1d_q <= page_1d_low_q;
    if (!page_1d_hit_q) page_1d_q <= '0;
  end

  logic [31:0] page_1e_q;
  logic [2:0] page_1e_word;
  local_register #(.Width(3)) u_page_1e_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_1e_word)
  );
  logic [31:0] page_1e_low_q;
  always_ff @(posedge clk_i) begin
    case (page_1e_word[2:0])
      3'h0: page_1e_low_q <= 32'(commit_o.commit);
      3'h1: page_1e_low_q <= 32'(commit_status_i.commit_waiting);
      default: page_1e_low_q <= 32'(commit_status_i.configuration);
    endcase
    page_1e_q <= page_1e_low_q;
    if (!page_1e_hit_q) page_1e_q <= '0;
  end

  logic [31:0] page_1f_q;
  logic [3:0] page_1f_word;
  local_register #(.Width(4)) u_page_1f_word (
    .clk_i, .d_i(address_q[3:0]), .q_o(page_1f_word)
  );
  logic [31:0] page_1f_low_q;
  logic [31:0] page_1f_high_q;
  always_ff @(posedge clk_i) begin
    case (page_1f_word[2:0])
      3'h0: page_1f_low_q <= 32'(map_q.map_enable);
      3'h1: page_1f_low_q <= 32'(map_q.map_bank);
      3'h2: page_1f_low_q <= 32'(map_q.map_count);
      3'h3: page_1f_low_q <= 32'(map_q.map_begin);
      3'h4: page_1f_low_q <= 32'(map_q.map_shift);
      3'h5: page_1f_low_q <= 32'(map_q.map_follow);
      default: page_1f_low_q <= 32'(map_q.map_lens);
    endcase
    page_1f_high_q <= 32'(map_access_o.map_access_bank);
    page_1f_q <= page_1f_word[3] ? page_1f_high_q : page_1f_low_q;
    if (!page_1f_hit_q) page_1f_q <= '0;
  end

  logic [31:0] page_3f_q;
  logic [2:0] page_3f_word;
  local_register #(.Width(3)) u_page_3f_word (
    .clk_i, .d_i(address_q[2:0]), .q_o(page_3f_word)
  );
  logic [31:0] page_3f_low_q;
  always_ff @(posedge clk_i) begin
    case (page_3f_word[2:0])
      3'h0: page_3f_low_q <= 32'(locks_o.lock_calibration);
      3'h1: page_3f_low_q <= 32'(locks_o.lock_mirror);
      default: page_3f_low_q <= 32'(locks_o.lock_laser);
    endcase
    page_3f_q <= page_3f_low_q;
    if (!page_3f_hit_q) page_3f_q <= '0;
  end

  // ---- 12: the page, the only one that is not 0; 13: the answer ----
  logic [31:0] read_q;
  always_ff @(posedge clk_i)
    read_q <= page_00_q
              | page_01_q
              | page_02_q
              | page_03_q
              | page_04_q
              | page_05_q
              | page_06_q
              | page_08_q
              | page_09_q
              | page_0a_q
              | page_0b_q
              | page_0c_q
              | page_0d_q
              | page_0e_q
              | page_10_q
              | page_12_q
              | page_13_q
              | page_16_q
              | page_17_q
              | page_18_q
              | page_1a_q
              | page_1c_q
              | page_1d_q
              | page_1e_q
              | page_1f_q
              | page_3f_q;

  always_ff @(posedge clk_i) begin
    bus_done_o   <= step_q[13];
    bus_status_o <= status_q;
    bus_data_o   <= read_q;
    if (table_hit_q) bus_data_o <= table_read_q;
    if (focus_table_hit_q) bus_data_o <= focus_table_read_q;
    if (free_table_hit_q) bus_data_o <= free_table_read_q;
    if (map_table_hit_q) bus_data_o <= map_table_read_q;
    if (status_q != link_pkg::StatusWidth'(link_pkg::StatusOk)) bus_data_o <= '0;
    if (rst) bus_done_o <= 1'b0;
  end

  // ---- the rules, by address ----
  initial begin
    for (int k = 0; k < 1024; k = k + 1) rule_mem[k] = '0;
    // identity
    rule_mem[0] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // map_hash
    rule_mem[1] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // version
    rule_mem[2] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // board_id
    rule_mem[3] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // clock_hz
    rule_mem[4] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // line_length
    rule_mem[5] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // pixel_width
    rule_mem[6] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // max_window
    rule_mem[7] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // lanes
    rule_mem[8] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // index_oversample
    rule_mem[9] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // scratch
    rule_mem[10] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // uptime, word 0
    rule_mem[11] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // uptime, word 1
    rule_mem[12] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // period_n
    rule_mem[16] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // noise_row
    rule_mem[17] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // k_noise
    rule_mem[18] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // k_height
    rule_mem[19] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // snr_min
    rule_mem[20] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // min_width
    rule_mem[21] = {KindReadWrite, 1'd1, 2'd1, 33'h000000003, 33'h0000000ff};
    // max_width
    rule_mem[22] = {KindReadWrite, 1'd1, 2'd1, 33'h000000003, 33'h0000000ff};
    // kappa
    rule_mem[23] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00003ffff};
    // c_sfm_gain
    rule_mem[24] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000ffffff};
    // window_two_pass
    rule_mem[25] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // window_fit
    rule_mem[26] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // max_core
    rule_mem[27] = {KindReadWrite, 1'd1, 2'd1, 33'h000000003, 33'h0000000ff};
    // saturation_level
    rule_mem[28] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // centre, word 0
    rule_mem[32] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h0ffffffff};
    // centre, word 1
    rule_mem[33] = {KindReadWrite, 1'd1, 2'd1, 33'h1fffffffe, 33'h000000001};
    // k1
    rule_mem[34] = {KindReadWrite, 1'd1, 2'd1, 33'h1fe000000, 33'h001ffffff};
    // k2
    rule_mem[35] = {KindReadWrite, 1'd1, 2'd1, 33'h1fe000000, 33'h001ffffff};
    // even
    rule_mem[36] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // n0
    rule_mem[37] = {KindReadWrite, 1'd1, 2'd1, 33'h180000000, 33'h07fffffff};
    // n1
    rule_mem[38] = {KindReadWrite, 1'd1, 2'd1, 33'h180000000, 33'h07fffffff};
    // d0
    rule_mem[39] = {KindReadWrite, 1'd1, 2'd1, 33'h180000000, 33'h07fffffff};
    // d1
    rule_mem[40] = {KindReadWrite, 1'd1, 2'd1, 33'h180000000, 33'h07fffffff};
    // e0
    rule_mem[41] = {KindReadWrite, 1'd1, 2'd1, 33'h180000000, 33'h07fffffff};
    // e1
    rule_mem[42] = {KindReadWrite, 1'd1, 2'd1, 33'h180000000, 33'h07fffffff};
    // tolerance
    rule_mem[43] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // length_unit
    rule_mem[44] = {KindReadWrite, 1'd1, 2'd1, 33'h000000001, 33'h00000000f};
    // c_obj_gain
    rule_mem[45] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h0001fffff};
    // short_count
    rule_mem[48] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // long_count
    rule_mem[49] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // unfinished_count
    rule_mem[50] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // early_count
    rule_mem[51] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // dropped_count
    rule_mem[52] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // skipped_count
    rule_mem[53] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // free_begin
    rule_mem[56] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // free_shift
    rule_mem[57] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000000f};
    // mirror_enable
    rule_mem[64] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // line_enable
    rule_mem[65] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // sweep_word, word 0
    rule_mem[66] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // sweep_word, word 1
    rule_mem[67] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000000ff};
    // work_word, word 0
    rule_mem[68] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // work_word, word 1
    rule_mem[69] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000000ff};
    // sweep_rate
    rule_mem[70] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // glitch_clks
    rule_mem[71] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0000000ff};
    // width_min_clks
    rule_mem[72] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0ffffffff};
    // width_max_clks
    rule_mem[73] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0ffffffff};
    // period_max_clks
    rule_mem[74] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0ffffffff};
    // phase_shift
    rule_mem[75] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000000f};
    // rate_shift
    rule_mem[76] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000003f};
    // amplitude_shift
    rule_mem[77] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000000f};
    // error_limit
    rule_mem[78] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00fffffff};
    // amplitude_set
    rule_mem[79] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h003ffffff};
    // k_p
    rule_mem[80] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00003ffff};
    // k_i
    rule_mem[81] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00003ffff};
    // level_low
    rule_mem[82] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000fffff};
    // level_high
    rule_mem[83] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000fffff};
    // level_nominal
    rule_mem[84] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000fffff};
    // trim_step
    rule_mem[85] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000ffffff};
    // trim_gain
    rule_mem[86] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00003ffff};
    // trim_up
    rule_mem[87] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // settle_limit
    rule_mem[88] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h003ffffff};
    // shock_limit
    rule_mem[89] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h003ffffff};
    // phase_limit
    rule_mem[90] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00fffffff};
    // settle_count
    rule_mem[91] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0000000ff};
    // hold_count
    rule_mem[92] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000000ff};
    // confidence_gain
    rule_mem[93] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000ffffff};
    // duty
    rule_mem[96] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h00000ffff};
    // sweep_level
    rule_mem[97] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0000fffff};
    // level_min
    rule_mem[98] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0000fffff};
    // level_max
    rule_mem[99] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0000fffff};
    // trim_min
    rule_mem[100] = {KindReadWrite, 1'd0, 2'd2, 33'h180000000, 33'h07fffffff};
    // trim_max
    rule_mem[101] = {KindReadWrite, 1'd0, 2'd2, 33'h180000000, 33'h07fffffff};
    // sweep_timeout
    rule_mem[102] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0ffffffff};
    // settle_timeout
    rule_mem[103] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0ffffffff};
    // lost_timeout
    rule_mem[104] = {KindReadWrite, 1'd0, 2'd2, 33'h000000000, 33'h0ffffffff};
    // drive_phase
    rule_mem[128] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_a[0]
    rule_mem[129] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[1]
    rule_mem[130] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[2]
    rule_mem[131] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[3]
    rule_mem[132] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[4]
    rule_mem[133] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[5]
    rule_mem[134] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[6]
    rule_mem[135] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[7]
    rule_mem[136] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_a[8]
    rule_mem[137] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_phi[0]
    rule_mem[138] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[1]
    rule_mem[139] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[2]
    rule_mem[140] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[3]
    rule_mem[141] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[4]
    rule_mem[142] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[5]
    rule_mem[143] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[6]
    rule_mem[144] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[7]
    rule_mem[145] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_phi[8]
    rule_mem[146] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00fffffff};
    // motion_da[0]
    rule_mem[147] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[1]
    rule_mem[148] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[2]
    rule_mem[149] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[3]
    rule_mem[150] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[4]
    rule_mem[151] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[5]
    rule_mem[152] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[6]
    rule_mem[153] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[7]
    rule_mem[154] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_da[8]
    rule_mem[155] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[0]
    rule_mem[156] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[1]
    rule_mem[157] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[2]
    rule_mem[158] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[3]
    rule_mem[159] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[4]
    rule_mem[160] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[5]
    rule_mem[161] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[6]
    rule_mem[162] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[7]
    rule_mem[163] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // motion_dphi[8]
    rule_mem[164] = {KindReadWrite, 1'd1, 2'd1, 33'h1ff800000, 33'h0007fffff};
    // scan_facet
    rule_mem[165] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // scan_begin
    rule_mem[166] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // scan_span
    rule_mem[167] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // ratio, word 0
    rule_mem[176] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // ratio, word 1
    rule_mem[177] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000fff};
    // exposure_delay_clks
    rule_mem[178] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000fffff};
    // exposure_clks
    rule_mem[179] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000fffff};
    // pulse_delay_clks
    rule_mem[180] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000fffff};
    // pulse_clks
    rule_mem[181] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000fffff};
    // mirror_state
    rule_mem[192] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_fault
    rule_mem[193] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_word, word 0
    rule_mem[194] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_word, word 1
    rule_mem[195] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_drive_phase, word 0
    rule_mem[196] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_drive_phase, word 1
    rule_mem[197] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_phase, word 0
    rule_mem[198] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_phase, word 1
    rule_mem[199] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_level
    rule_mem[200] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // index_alive
    rule_mem[201] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_settled
    rule_mem[202] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_measured
    rule_mem[203] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mirror_error
    rule_mem[204] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // missing_count
    rule_mem[205] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // doubled_count
    rule_mem[206] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // impossible_count
    rule_mem[207] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // glitch_count
    rule_mem[208] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // overrun_count
    rule_mem[209] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // uart_step
    rule_mem[224] = {KindReadWrite, 1'd0, 2'd0, 33'h000000400, 33'h000200000};
    // uart_step_now
    rule_mem[225] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // uart_framing
    rule_mem[226] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // uart_breaks
    rule_mem[227] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // uart_glitches
    rule_mem[228] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // uart_fallbacks
    rule_mem[229] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // frames_good
    rule_mem[230] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // frames_crc
    rule_mem[231] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // frames_malformed
    rule_mem[232] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // frames_too_long
    rule_mem[233] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // frames_too_short
    rule_mem[234] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // frames_framing
    rule_mem[235] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // commands_bad
    rule_mem[236] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // commands_lost
    rule_mem[237] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_enable
    rule_mem[256] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // laser_adapt
    rule_mem[257] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // laser_shared
    rule_mem[258] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // laser_power
    rule_mem[259] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_power_min
    rule_mem[260] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_power_max
    rule_mem[261] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_startup
    rule_mem[262] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_target
    rule_mem[263] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_cut
    rule_mem[264] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000003fff};
    // laser_down
    rule_mem[265] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_up
    rule_mem[266] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_search
    rule_mem[267] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000003fff};
    // laser_index_begin
    rule_mem[268] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_index_end
    rule_mem[269] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // laser_limit_power
    rule_mem[288] = {KindReadWrite, 1'd0, 2'd3, 33'h000000000, 33'h00000ffff};
    // laser_limit_startup
    rule_mem[289] = {KindReadWrite, 1'd0, 2'd3, 33'h000000000, 33'h00000ffff};
    // laser_limit_pulse_clks
    rule_mem[290] = {KindReadWrite, 1'd0, 2'd3, 33'h000000000, 33'h0000fffff};
    // laser_limit_drain
    rule_mem[291] = {KindReadWrite, 1'd0, 2'd3, 33'h000000000, 33'h00000ffff};
    // laser_limit_bucket
    rule_mem[292] = {KindReadWrite, 1'd0, 2'd3, 33'h000000000, 33'h0ffffffff};
    // laser_watchdog_clks
    rule_mem[293] = {KindReadWrite, 1'd0, 2'd3, 33'h000000000, 33'h0ffffffff};
    // laser_status
    rule_mem[304] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_power_inward
    rule_mem[305] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_power_outward
    rule_mem[306] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_cut_count
    rule_mem[307] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_duty_count
    rule_mem[308] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_watchdog_count
    rule_mem[309] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_guard_fault
    rule_mem[310] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // laser_guard_count
    rule_mem[311] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // points_batch
    rule_mem[352] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000000ff};
    // points_timeout_clks
    rule_mem[353] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000ffffff};
    // points_dropped
    rule_mem[354] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // capture_busy
    rule_mem[355] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // axi_points_dropped
    rule_mem[368] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // axi_lines_dropped
    rule_mem[369] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // axi_refused
    rule_mem[370] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // axi_refused_address
    rule_mem[371] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_mode
    rule_mem[384] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000002};
    // focus_manual
    rule_mem[385] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // focus_average_shift
    rule_mem[386] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000000f};
    // focus_lapse
    rule_mem[387] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // focus_z_begin
    rule_mem[388] = {KindReadWrite, 1'd0, 2'd0, 33'h1ff800000, 33'h0007fffff};
    // focus_z_shift
    rule_mem[389] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000000f};
    // focus_hysteresis
    rule_mem[390] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // focus_hold_points
    rule_mem[391] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // focus_address
    rule_mem[392] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000007f};
    // focus_quarter_clks
    rule_mem[393] = {KindReadWrite, 1'd0, 2'd0, 33'h000000004, 33'h00000ffff};
    // focus_stretch_clks
    rule_mem[394] = {KindReadWrite, 1'd0, 2'd0, 33'h000000007, 33'h000ffffff};
    // focus_poll_clks
    rule_mem[395] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000ffffff};
    // focus_tolerance
    rule_mem[396] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // focus_timeout_clks
    rule_mem[397] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // focus_retries
    rule_mem[398] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0000000ff};
    // focus_protocol
    rule_mem[399] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // focus_state
    rule_mem[416] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_fault
    rule_mem[417] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_in_position
    rule_mem[418] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_distance
    rule_mem[419] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_target
    rule_mem[420] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_position
    rule_mem[421] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_nack_count
    rule_mem[422] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_stretch_count
    rule_mem[423] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_stuck_count
    rule_mem[424] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_arbitration_count
    rule_mem[425] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_timeout_count
    rule_mem[426] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_recovery_count
    rule_mem[427] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_reply_count
    rule_mem[428] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // focus_motor_status
    rule_mem[429] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // test_position
    rule_mem[448] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h001ffffff};
    // test_move
    rule_mem[449] = {KindReadWrite, 1'd0, 2'd0, 33'h1ff800000, 33'h0007fffff};
    // test_step
    rule_mem[450] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h01fffffff};
    // test_height
    rule_mem[451] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // test_pedestal
    rule_mem[452] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // test_noise
    rule_mem[453] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // test_seed
    rule_mem[454] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // test_lines
    rule_mem[455] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h0ffffffff};
    // test_period_clks
    rule_mem[456] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000ffffff};
    // test_angle
    rule_mem[457] = {KindReadWrite, 1'd0, 2'd0, 33'h1ff800000, 33'h0007fffff};
    // test_power
    rule_mem[458] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h00000ffff};
    // test_start
    rule_mem[459] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // test_stop
    rule_mem[460] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // test_running
    rule_mem[461] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // untagged_count
    rule_mem[464] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // pixel_overflow_count
    rule_mem[465] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // unread_count
    rule_mem[466] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // mistimed_count
    rule_mem[467] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // readout_lag
    rule_mem[468] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000003};
    // readout_stale
    rule_mem[469] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // readout_min_clks
    rule_mem[470] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000ffffff};
    // readout_max_clks
    rule_mem[471] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000ffffff};
    // commit
    rule_mem[480] = {KindReadWrite, 1'd1, 2'd1, 33'h000000001, 33'h000000001};
    // commit_waiting
    rule_mem[481] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // configuration
    rule_mem[482] = {KindReadOnly, 1'd0, 2'd0, 33'h000000000, 33'h000000000};
    // map_enable
    rule_mem[496] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // map_bank
    rule_mem[497] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // map_count
    rule_mem[498] = {KindReadWrite, 1'd1, 2'd1, 33'h000000002, 33'h000000009};
    // map_begin
    rule_mem[499] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // map_shift
    rule_mem[500] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000000f};
    // map_follow
    rule_mem[501] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h000000001};
    // map_lens
    rule_mem[502] = {KindReadWrite, 1'd1, 2'd1, 33'h000000000, 33'h00000ffff};
    // map_access_bank
    rule_mem[504] = {KindReadWrite, 1'd0, 2'd0, 33'h000000000, 33'h000000001};
    // lock_calibration
    rule_mem[1008] = {KindReadWrite, 1'd0, 2'd0, 33'h000000001, 33'h000000001};
    // lock_mirror
    rule_mem[1009] = {KindReadWrite, 1'd0, 2'd0, 33'h000000001, 33'h000000001};
    // lock_laser
    rule_mem[1010] = {KindReadWrite, 1'd0, 2'd0, 33'h000000001, 33'h000000001};
  end

endmodule

`default_nettype wire
