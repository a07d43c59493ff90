// bus_arbiter: two hosts, one bus to the registers.
//
// Source 0 is command_executor, source 1 another host.  An access is begun when the one before it
// has its answer.  Source 0 goes first, and behind an answer to it nobody else begins for
// LingerClks: the words of one command follow each other sooner than that, so they are read or
// written without an access of the other host in between.
//
//   valid_i   an access of a source, whose values stay until its done_o; none comes before that
//   done_o    answers the source's access; status_o and data_o with it
//   bus_*     as register_file has it
//   Latency   1 clock from valid_i to bus_valid_o where nothing hinders, 1 from bus_done_i to done_o
//   Model     vrscan.clocked.bus_arbiter, bit-exact

`default_nettype none

module bus_arbiter #(
  parameter int unsigned LingerClks = 24
) (
  input  wire logic                                clk_i,
  input  wire logic                                rst_i,

  // Source 0 is in the lower half.
  input  wire logic [                         1:0] valid_i,
  input  wire logic [ 2*link_pkg::AccessWidth-1:0] access_i,
  input  wire logic [2*link_pkg::AddressWidth-1:0] address_i,
  input  wire logic [                        63:0] data_i,
  output      logic [                         1:0] done_o,
  output      logic [   link_pkg::StatusWidth-1:0] status_o,
  output      logic [                        31:0] data_o,

  output      logic                                bus_valid_o,
  output      logic [   link_pkg::AccessWidth-1:0] bus_access_o,
  output      logic [  link_pkg::AddressWidth-1:0] bus_address_o,
  output      logic [                        31:0] bus_data_o,
  input  wire logic                                bus_done_i,
  input  wire logic [   link_pkg::StatusWidth-1:0] bus_status_i,
  input  wire logic [                        31:0] bus_data_i
);

  if (LingerClks < 1 || LingerClks > 255) begin : gen_bad_linger_clks
    $error("bus_arbiter: LingerClks must be 1 to 255");
  end

  localparam int unsigned LingerWidth = $clog2(LingerClks + 1);

  logic [            1:0] waits_q, waits, begins;
  logic                   busy_q, second_q;  // an access is under way, and it is of source 1
  logic [LingerWidth-1:0] linger_q;
  assign waits  = waits_q | valid_i;
  assign begins = busy_q ? 2'b00 : {waits[1] && !waits[0] && linger_q == '0, waits[0]};

  always_ff @(posedge clk_i) begin
    waits_q     <= waits & ~begins;
    bus_valid_o <= begins != 2'b00;
    if (begins != 2'b00) begin
      busy_q        <= 1'b1;
      second_q      <= begins[1];
      bus_access_o  <= access_i[begins[1]*link_pkg::AccessWidth+:link_pkg::AccessWidth];
      bus_address_o <= address_i[begins[1]*link_pkg::AddressWidth+:link_pkg::AddressWidth];
      bus_data_o    <= data_i[begins[1]*32+:32];
    end

    if (linger_q != '0) linger_q <= linger_q - LingerWidth'(1);
    done_o   <= 2'b00;
    status_o <= bus_status_i;
    data_o   <= bus_data_i;
    if (busy_q && bus_done_i) begin
      busy_q <= 1'b0;
      done_o <= {second_q, !second_q};
      if (!second_q) linger_q <= LingerWidth'(LingerClks);
    end

    if (rst_i) begin
      waits_q     <= 2'b00;
      busy_q      <= 1'b0;
      bus_valid_o <= 1'b0;
      done_o      <= 2'b00;
      linger_q    <= '0;
    end
  end

endmodule

`default_nettype wire
