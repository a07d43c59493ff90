// reset_bridge: a reset of one clock, from what is asynchronous to it.
//
// The flip-flops are 0 from the configuration on, so a reset comes first.  ASYNC_REG keeps them out
// of shift-register primitives, which do not begin with 0 and are no synchroniser.
//
//   ready_i  asynchronous; 0 asks for the reset
//   rst_o    1 from the configuration on, until ready_i has been 1 for 4 clocks; a ready_i that is 0
//            at a clock's edge is heard 4 clocks later
//   Latency  4 clocks
//   Model    none: it belongs to the boards

`default_nettype none

module reset_bridge (
  input  wire logic clk_i,
  input  wire logic ready_i,
  output      logic rst_o
);

  (* ASYNC_REG = "TRUE" *) logic [3:0] run_q;
  assign rst_o = !run_q[3];

  initial run_q = '0;

  always_ff @(posedge clk_i) run_q <= {run_q[2:0], ready_i};

endmodule

`default_nettype wire
