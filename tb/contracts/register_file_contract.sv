// register_file_contract: what register_file promises on the bus.

`default_nettype none

module register_file_contract (
  input wire logic                              clk_i,
  input wire logic                              rst_i,
  input wire logic                              bus_valid_i,
  input wire logic [ link_pkg::AccessWidth-1:0] bus_access_i,
  input wire logic                              bus_done_o,
  input wire logic [ link_pkg::StatusWidth-1:0] bus_status_o,
  input wire logic [                      31:0] bus_data_o,
  input wire register_pkg::mirror_limits_t      mirror_limits_o,
  input wire register_pkg::laser_limits_t       laser_limits_o,
  input wire register_pkg::locks_t              locks_o,
  input wire logic [                      13:1] step_q,
  input wire logic                              rst,
  input wire logic [ link_pkg::AccessWidth-1:0] access_q
);

  localparam logic [link_pkg::AccessWidth-1:0] Write =
      link_pkg::AccessWidth'(link_pkg::AccessWrite);

  logic started_q, reset_q;
  initial {started_q, reset_q} = 2'b00;

  logic                             reset_q2, done_q, starts, written_q;
  logic [                     13:1] age_q;  // of the access under way
  logic [link_pkg::AccessWidth-1:0] kind_q;
  register_pkg::mirror_limits_t     mirror_limits_q;
  register_pkg::laser_limits_t      laser_limits_q;
  register_pkg::locks_t             locks_q;
  assign starts = bus_valid_i && age_q == '0;

  always_ff @(posedge clk_i) begin
    {reset_q2, reset_q} <= {reset_q, rst_i};
    started_q <= started_q || reset_q;
    age_q     <= reset_q ? '0 : {age_q[12:1], starts};
    done_q    <= age_q[13] && !reset_q;
    if (starts) kind_q <= bus_access_i;
    written_q       <= (age_q != '0 && kind_q == Write) || reset_q;
    mirror_limits_q <= mirror_limits_o;
    laser_limits_q  <= laser_limits_o;
    locks_q         <= locks_o;

    if (started_q) begin
      one_answer_in_time: assert (bus_done_o == done_q);
      refused_reads_zero: assert (!bus_done_o || bus_data_o == '0 ||
                                  bus_status_o == link_pkg::StatusWidth'(link_pkg::StatusOk));
      only_a_write_changes: assert (written_q || (mirror_limits_o == mirror_limits_q &&
                                                  laser_limits_o == laser_limits_q &&
                                                  locks_o == locks_q));
      simulated_locks_stay: assert (reset_q2 || (locks_q & ~locks_o) == '0);

      step_age: assert (rst == reset_q && step_q == age_q);
      step_kind: assert (age_q == '0 || access_q == kind_q);

      a_lock: cover (bus_done_o && locks_o != '0);
    end
  end

endmodule

bind register_file register_file_contract u_contract (.*);

`default_nettype wire
