// axil_registers_contract: the rules of AXI4-Lite, and what an answer says of the access.

`default_nettype none

module axil_registers_contract (
  input wire logic                              clk_i,
  input wire logic                              rst_i,
  input wire logic                              s_axil_awvalid,
  input wire logic                              s_axil_awready,
  input wire logic [link_pkg::AddressWidth+1:0] s_axil_awaddr,
  input wire logic                              s_axil_wvalid,
  input wire logic                              s_axil_wready,
  input wire logic [                      31:0] s_axil_wdata,
  input wire logic [                       3:0] s_axil_wstrb,
  input wire logic                              s_axil_bvalid,
  input wire logic                              s_axil_bready,
  input wire logic [                       1:0] s_axil_bresp,
  input wire logic                              s_axil_arvalid,
  input wire logic                              s_axil_arready,
  input wire logic [link_pkg::AddressWidth+1:0] s_axil_araddr,
  input wire logic                              s_axil_rvalid,
  input wire logic                              s_axil_rready,
  input wire logic [                      31:0] s_axil_rdata,
  input wire logic [                       1:0] s_axil_rresp,
  input wire logic                              bus_valid_o,
  input wire logic [ link_pkg::AccessWidth-1:0] bus_access_o,
  input wire logic [link_pkg::AddressWidth-1:0] bus_address_o,
  input wire logic [                      31:0] bus_data_o,
  input wire logic                              bus_done_i,
  input wire logic [ link_pkg::StatusWidth-1:0] bus_status_i,
  input wire logic [                      31:0] bus_data_i,
  input wire logic                              busy_q,
  input wire logic                              writes_q,
  input wire logic [link_pkg::AddressWidth-1:0] write_address_q,
  input wire logic [link_pkg::AddressWidth-1:0] read_address_q,
  input wire logic [                      31:0] data_q,
  input wire logic [                       3:0] strobes_q
);

  localparam logic [link_pkg::AccessWidth-1:0] Write =
      link_pkg::AccessWidth'(link_pkg::AccessWrite);
  localparam logic [link_pkg::AccessWidth-1:0] Read =
      link_pkg::AccessWidth'(link_pkg::AccessRead);

  logic        started_q, b_stays_q, r_stays_q, done_q, done_write_q, under_way_q, writes;
  logic        b_before_q, r_before_q, reset_q, whole_q, none_q, waited_q;
  logic [ 1:0] bresp_q, resp_q;
  logic [33:0] read_q;
  logic [31:0] answer_q;
  logic [link_pkg::AddressWidth-1:0] write_q, address_q;  // of the requests that were taken last
  logic [31:0] word_q;
  logic [ 3:0] whole_strobes_q;
  initial started_q = 1'b0;
  assign writes = bus_access_o == Write;

  always_ff @(posedge clk_i) begin
    started_q    <= started_q || rst_i;
    reset_q      <= rst_i;
    b_stays_q    <= s_axil_bvalid && !s_axil_bready && !rst_i;
    r_stays_q    <= s_axil_rvalid && !s_axil_rready && !rst_i;
    b_before_q   <= s_axil_bvalid;
    r_before_q   <= s_axil_rvalid;
    bresp_q      <= s_axil_bresp;
    read_q       <= {s_axil_rresp, s_axil_rdata};
    under_way_q  <= !rst_i && (bus_valid_o || under_way_q) && !bus_done_i;
    done_q       <= !rst_i && under_way_q && bus_done_i;
    done_write_q <= writes;
    answer_q     <= bus_data_i;
    resp_q       <= bus_status_i == link_pkg::StatusWidth'(link_pkg::StatusOk) ? 2'b00
                    : bus_status_i == link_pkg::StatusWidth'(link_pkg::StatusNoAddress) ? 2'b11
                    : 2'b10;
    if (s_axil_awvalid && s_axil_awready) write_q <= s_axil_awaddr[link_pkg::AddressWidth+1:2];
    if (s_axil_arvalid && s_axil_arready) address_q <= s_axil_araddr[link_pkg::AddressWidth+1:2];
    if (s_axil_wvalid && s_axil_wready) {whole_strobes_q, word_q} <= {s_axil_wstrb, s_axil_wdata};
    whole_q  <= strobes_q == '1;
    none_q   <= strobes_q == '0;
    waited_q <= !rst_i && !s_axil_awready && !s_axil_wready;

    if (started_q) begin
      answers_of_accesses: assume (!bus_done_i || (under_way_q && !bus_valid_o));

      b_stays: assert (!b_stays_q || (s_axil_bvalid && s_axil_bresp == bresp_q));
      r_stays: assert (!r_stays_q || (s_axil_rvalid && {s_axil_rresp, s_axil_rdata} == read_q));
      one_access_at_a_time: assert (!bus_valid_o || !under_way_q);
      written_as_given: assert (!bus_valid_o || !writes
                                || (!s_axil_awready && !s_axil_wready && whole_strobes_q == '1
                                    && {bus_address_o, bus_data_o} == {write_q, word_q}));
      read_as_given: assert (!bus_valid_o || writes || (bus_access_o == Read && !s_axil_arready
                                                        && bus_address_o == address_q));
      written_is_answered: assert (!done_q || !done_write_q
                                   || (s_axil_bvalid && s_axil_bresp == resp_q));
      read_is_answered: assert (!done_q || done_write_q || (s_axil_rvalid
                                && {s_axil_rresp, s_axil_rdata} == {resp_q, answer_q}));
      no_answer_by_itself: assert (!s_axil_rvalid || r_before_q || (done_q && !done_write_q));
      no_write_by_itself: assert (!s_axil_bvalid || b_before_q || (done_q && done_write_q)
                                  || (waited_q && !whole_q
                                      && s_axil_bresp == (none_q ? 2'b00 : 2'b10)));
      no_deadlock: assert (reset_q || busy_q || s_axil_bvalid || !waited_q
                           || s_axil_awready || s_axil_wready || s_axil_rvalid || b_before_q
                           || r_before_q || done_q || bus_valid_o);

      step_busy: assert (busy_q == (under_way_q || bus_valid_o));
      step_writes: assert (!busy_q || (writes_q == writes && (writes || bus_access_o == Read)));
      step_write: assert (!busy_q || !writes_q || (!s_axil_awready && !s_axil_wready
                                                   && !s_axil_bvalid));
      step_read: assert (!busy_q || writes_q || (!s_axil_arready && !s_axil_rvalid));
      step_write_address: assert (s_axil_awready || write_address_q == write_q);
      step_word: assert (s_axil_wready || {strobes_q, data_q} == {whole_strobes_q, word_q});
      step_read_address: assert (s_axil_arready || read_address_q == address_q);
      step_whole: assert (!busy_q || !writes_q || strobes_q == '1);

      turns: cover (done_q && done_write_q && r_stays_q);
    end
  end

endmodule

bind axil_registers axil_registers_contract u_contract (.*);

`default_nettype wire
