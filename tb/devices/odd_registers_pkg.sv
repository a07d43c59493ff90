// odd_registers_pkg: what the bus of the link writes of a group of registers, what it reads
// of it, and what leaves with an entry of a table, as a struct each; and the resets.
//
// Generated from tb/devices/odd_registers.toml by scripts/generate.py; docs/registers.md says what the
// fields are.  Widths are numbers, as packages are read in the order of their paths.

`default_nettype none

package odd_registers_pkg;
  // Two words each.
  typedef struct packed {
    logic [32:0] longer;
    logic [63:0] longest;
    logic signed [39:0] negative_long;
  } wide_t;

  // What the bus reads.
  typedef struct packed {
    logic [15:0] count;
    logic signed [8:0] level;
    logic flag;
    logic [32:0] levels;
    logic [63:0] clock;
    logic signed [44:0] place;
    logic signed [31:0] raw;
  } read_t;

  // Each takes a 1 and nothing else, and keeps it until reset.
  typedef struct packed {
    logic lock_a;
    logic lock_b;
    logic lock_c;
    logic lock_d;
  } locks_t;

  // What waits for a commit.
  typedef struct packed {
    logic signed [8:0] held;
    logic [39:0] held_long;
    logic [17:0] held_several;
    logic held_bank;
  } held_t;

  // Where the memory is not.
  typedef struct packed {
    logic access_bank;
  } access_t;

  // The commit.
  typedef struct packed {
    logic commit;
    logic commit_strobe;
  } commit_t;

  // What the bus writes.
  typedef struct packed {
    logic sole;
    logic [31:0] word;
    logic signed [4:0] little;
    logic [11:0] bounded;
    logic signed [11:0] centred;
    logic signed [31:0] below;
    logic signed [31:0] above;
    logic [3:0] late;
    logic [2:0] hit;
    logic hit_strobe;
    logic signed [31:0] signal;
    logic signal_strobe;
    logic [4:0] bits;
    logic [50:0] several;
    logic [63:0] words;
  } written_t;

  // Entries that wait for a commit.
  typedef struct packed {
    logic held_table_write;
    logic [3:0] held_table_index;
    logic signed [31:0] held_table_left;
    logic [2:0] held_table_right;
    logic held_table_write_bank;
    logic held_table_bank;
    logic held_table_changed;
  } held_table_t;

  // Two banks whose memory is elsewhere: read.
  typedef struct packed {
    logic signed [8:0] elsewhere_read;
  } elsewhere_status_t;

  // Two banks whose memory is elsewhere.
  typedef struct packed {
    logic elsewhere_write;
    logic [3:0] elsewhere_index;
    logic signed [8:0] elsewhere_node;
    logic elsewhere_access_bank;
  } elsewhere_t;

  // One field, and entries that are no power of two.
  typedef struct packed {
    logic single_write;
    logic [2:0] single_index;
    logic signed [31:0] single_value;
  } single_t;

  // Three fields of four words.
  typedef struct packed {
    logic triple_write;
    logic [2:0] triple_index;
    logic [31:0] triple_low;
    logic signed [6:0] triple_middle;
    logic triple_high;
  } triple_t;

  // What a reset brings; of a table what it holds before the first write.
  localparam logic [32:0] ResetLonger = 33'h180000001;
  localparam logic [63:0] ResetLongest = 64'h0;
  localparam logic [39:0] ResetNegativeLong = 40'hfffffffffe;
  localparam logic ResetLockA = 1'h0;
  localparam logic ResetLockB = 1'h0;
  localparam logic ResetLockC = 1'h0;
  localparam logic ResetLockD = 1'h0;
  localparam logic [8:0] ResetHeld = 9'h1fd;
  localparam logic [39:0] ResetHeldLong = 40'h8000000001;
  localparam logic [17:0] ResetHeldSeveral = 18'h5145;
  localparam logic ResetHeldBank = 1'h0;
  localparam logic ResetAccessBank = 1'h0;
  localparam logic ResetCommit = 1'h0;
  localparam logic ResetSole = 1'h1;
  localparam logic [31:0] ResetWord = 32'hee6b2800;
  localparam logic [4:0] ResetLittle = 5'h10;
  localparam logic [11:0] ResetBounded = 12'h9;
  localparam logic [11:0] ResetCentred = 12'h0;
  localparam logic [31:0] ResetBelow = 32'hfffffff9;
  localparam logic [31:0] ResetAbove = 32'h7;
  localparam logic [3:0] ResetLate = 4'h0;
  localparam logic [2:0] ResetHit = 3'h2;
  localparam logic [31:0] ResetSignal = 32'h0;
  localparam logic [4:0] ResetBits = 5'h1f;
  localparam logic [50:0] ResetSeveral = 51'h7fffbfffdfffe;
  localparam logic [63:0] ResetWords = 64'h0;
  localparam logic [511:0] ResetHeldTableLeft = 512'h0;
  localparam logic [47:0] ResetHeldTableRight = 48'h0;
  localparam logic [255:0] ResetSingleValue = 256'h0;
  localparam logic [255:0] ResetTripleLow = 256'h0;
  localparam logic [55:0] ResetTripleMiddle = 56'h0;
  localparam logic [7:0] ResetTripleHigh = 8'h0;
endpackage

`default_nettype wire
