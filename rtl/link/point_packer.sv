// point_packer: the records of every step-th line, in packets.
//
//   Model    vrscan.fixed.point_packer, bit-exact

`default_nettype none

module point_packer #(
  parameter int unsigned BufferBytes = 4096
) (
  input  wire logic        clk_i,
  input  wire logic        rst_i,

  // Of point_record.
  input  wire logic        record_valid_i,
  input  wire logic [ 5:0] record_index_i,
  input  wire logic [ 7:0] record_i,

  output      logic        valid_o,
  input  wire logic        ready_i,
  output      logic [ 7:0] data_o,
  output      logic        last_o,

  input  wire logic        stream_start_i,
  input  wire logic        stream_stop_i,
  input  wire logic        stream_format_i,  // with stream_start_i: 0 compact, 1 full
  input  wire logic [ 7:0] stream_step_i,    // with stream_start_i: 1 to 255

  // Configuration.
  input  wire logic [ 7:0] points_batch_i,         // records a packet, clipped to what fits
  input  wire logic [23:0] points_timeout_clks_i,  // 0: never

  // Status: it stops at its largest value.
  output      logic [15:0] points_dropped_o
);

endmodule

`default_nettype wire
