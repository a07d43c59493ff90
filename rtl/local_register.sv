// local_register: a register of its own, for one user of a value that has many.
//
// A net that goes everywhere is as long as the die, and sets its clock.  Each user, a room or a
// group of settings, has one of these in its stead; synthesis keeps it, and does not make one
// register of several that hold the same.
//
//   Latency  1 clock
//   Model    none: pure wiring; what has its own twin begins behind it

`default_nettype none

(* keep_hierarchy *)
module local_register #(
  parameter int unsigned Width = 1
) (
  input  wire logic             clk_i,
  input  wire logic [Width-1:0] d_i,
  output      logic [Width-1:0] q_o
);

  always_ff @(posedge clk_i) q_o <= d_i;

endmodule

`default_nettype wire
