// axil_registers: an AXI4-Lite slave in front of the bus to the registers.
//
// The word at address a of docs/registers.md is that at byte 4 a here.  One access is under way at
// a time; where a write and a read wait, they take turns.
//
//   s_axil_*addr   bytes; bits 1..0 are not looked at
//   s_axil_wstrb   all ones: the word is written.  All zeros: nothing is done, with OKAY.  Anything
//                  else is refused, as no register takes a part of a word
//   s_axil_*resp   OKAY; DECERR where there is no register; SLVERR where the access is refused
//   refused_o      why the last access was refused: a status of link_pkg, StatusBadLength for a part
//                  of a word; refused_address_o is its address, of words
//   bus_*          as command_executor has it
//   Latency        2 clocks from arready, or the later of awready and wready, to bus_valid_o; 1 from
//                  bus_done_i to rvalid or bvalid; where no bus is asked, 2 to bvalid
//   Model          vrscan.clocked.axil_registers, bit-exact

`default_nettype none

module axil_registers #(
  localparam int unsigned ByteWidth = link_pkg::AddressWidth + 2
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  // Tools know an AXI interface by these names, which have no suffix.
  // verilog_lint: waive-start port-name-suffix
  input  wire logic                              s_axil_awvalid,
  output      logic                              s_axil_awready,
  input  wire logic [             ByteWidth-1:0] s_axil_awaddr,
  input  wire logic                              s_axil_wvalid,
  output      logic                              s_axil_wready,
  input  wire logic [                      31:0] s_axil_wdata,
  input  wire logic [                       3:0] s_axil_wstrb,
  output      logic                              s_axil_bvalid,
  input  wire logic                              s_axil_bready,
  output      logic [                       1:0] s_axil_bresp,
  input  wire logic                              s_axil_arvalid,
  output      logic                              s_axil_arready,
  input  wire logic [             ByteWidth-1:0] s_axil_araddr,
  output      logic                              s_axil_rvalid,
  input  wire logic                              s_axil_rready,
  output      logic [                      31:0] s_axil_rdata,
  output      logic [                       1:0] s_axil_rresp,
  // verilog_lint: waive-stop port-name-suffix

  output      logic                              bus_valid_o,
  output      logic [ link_pkg::AccessWidth-1:0] bus_access_o,
  output      logic [link_pkg::AddressWidth-1:0] bus_address_o,
  output      logic [                      31:0] bus_data_o,
  input  wire logic                              bus_done_i,
  input  wire logic [ link_pkg::StatusWidth-1:0] bus_status_i,
  input  wire logic [                      31:0] bus_data_i,

  // Status.
  output      logic [ link_pkg::StatusWidth-1:0] refused_o,
  output      logic [link_pkg::AddressWidth-1:0] refused_address_o
);

  localparam logic [1:0] OKAY = 2'b00;
  localparam logic [1:0] SLVERR = 2'b10;
  localparam logic [1:0] DECERR = 2'b11;
  localparam logic [link_pkg::StatusWidth-1:0] OK = link_pkg::StatusWidth'(link_pkg::StatusOk);

  logic [link_pkg::AddressWidth-1:0] write_address_q, read_address_q;
  logic [                      31:0] data_q;
  logic [                       3:0] strobes_q;
  logic                              busy_q, writes_q;  // an access is under way; the last wrote
  logic                              write_due, read_due, write, read, whole, done, refused;
  logic [                       1:0] answer;
  assign write_due = !s_axil_awready && !s_axil_wready && !s_axil_bvalid && !busy_q;
  assign read_due  = !s_axil_arready && !s_axil_rvalid && !busy_q;
  assign write     = write_due && !(read_due && writes_q);
  assign read      = read_due && !write;
  assign whole     = strobes_q == '1;
  assign done      = busy_q && bus_done_i;
  assign refused   = done ? bus_status_i != OK : write && !whole && strobes_q != '0;
  assign answer    = !refused ? OKAY
                     : done && bus_status_i == link_pkg::StatusWidth'(link_pkg::StatusNoAddress)
                     ? DECERR : SLVERR;

  always_ff @(posedge clk_i) begin
    // A ready channel is empty; what has come stays until it is answered.
    if (s_axil_awvalid && s_axil_awready) begin
      s_axil_awready  <= 1'b0;
      write_address_q <= s_axil_awaddr[ByteWidth-1:2];
    end
    if (s_axil_wvalid && s_axil_wready) begin
      s_axil_wready <= 1'b0;
      data_q        <= s_axil_wdata;
      strobes_q     <= s_axil_wstrb;
    end
    if (s_axil_arvalid && s_axil_arready) begin
      s_axil_arready <= 1'b0;
      read_address_q <= s_axil_araddr[ByteWidth-1:2];
    end

    bus_valid_o <= read || (write && whole);
    if (read || write) begin
      busy_q        <= read || whole;
      writes_q      <= write;
      bus_access_o  <= write ? link_pkg::AccessWidth'(link_pkg::AccessWrite)
                             : link_pkg::AccessWidth'(link_pkg::AccessRead);
      bus_address_o <= write ? write_address_q : read_address_q;
      bus_data_o    <= data_q;
    end
    if (done) busy_q <= 1'b0;

    if (s_axil_bvalid && s_axil_bready) s_axil_bvalid <= 1'b0;
    if (done ? writes_q : write && !whole) begin
      {s_axil_awready, s_axil_wready, s_axil_bvalid} <= '1;
      s_axil_bresp                                   <= answer;
    end
    if (s_axil_rvalid && s_axil_rready) s_axil_rvalid <= 1'b0;
    if (done && !writes_q) begin
      {s_axil_arready, s_axil_rvalid} <= '1;
      s_axil_rresp                    <= answer;
      s_axil_rdata                    <= bus_data_i;
    end
    if (refused) begin
      refused_o         <= done ? bus_status_i : link_pkg::StatusWidth'(link_pkg::StatusBadLength);
      refused_address_o <= done ? bus_address_o : write_address_q;
    end

    if (rst_i) begin
      {s_axil_awready, s_axil_wready, s_axil_arready} <= '1;
      {s_axil_bvalid, s_axil_rvalid}                  <= '0;
      bus_valid_o                                     <= 1'b0;
      busy_q                                          <= 1'b0;
      writes_q                                        <= 1'b0;
      refused_o                                       <= OK;
      refused_address_o                               <= '0;
    end
  end

  logic unused;
  assign unused = &{1'b0, s_axil_awaddr[1:0], s_axil_araddr[1:0]};

endmodule

`default_nettype wire
