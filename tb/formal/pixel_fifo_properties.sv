// pixel_fifo_properties: what pixel_fifo never does, with clocks of any rates and resets at any time.
//
// Both clocks are free inputs, and so is all else: in a step of the proof either, both or none has an
// edge.  A word is written at write_q and read at read_q, each of which goes up by one with it; so
// none is lost, doubled or reordered while the pointers stay in their order, which is what is proven:
//
//   read_gray_q2 <= its meta <= read_q <= write_gray_q2 <= its meta <= write_q <= read_gray_q2 + Depth
//
// That order is suspended from a reset to the end of the flush that it asks for, in which nothing is
// read.  scripts/formal.py ties the wires "inside_*" to registers of the same name, and what begins
// with "step_" is what the induction needs.

`default_nettype none

module pixel_fifo_properties #(
  parameter int unsigned PixelWidth = 2,
  parameter int unsigned Depth      = 8
) (
  input wire logic                  clk_i,
  input wire logic                  rst_i,
  input wire logic                  pixel_clk_i,
  input wire logic                  pixel_rst_i,
  input wire logic                  line_valid_i,
  input wire logic                  pixel_valid_i,
  input wire logic [PixelWidth-1:0] pixel_i
);

  localparam int unsigned Pointer = $clog2(Depth) + 1;
  localparam int unsigned Overflow = 4;

  logic line_start, line_end, pixel_valid;
  pixel_fifo #(
    .PixelWidth(PixelWidth), .ClockHz(1), .PixelHz(1), .Depth(Depth), .CountWidth(4)
  ) dut (
    .clk_i, .rst_i, .pixel_clk_i, .pixel_rst_i, .line_valid_i, .pixel_valid_i, .pixel_i,
    .line_start_o    (line_start),
    .line_end_o      (line_end),
    .pixel_valid_o   (pixel_valid),
    .pixel_o         (),
    .overflow_count_o()
  );

  // Tied to registers of dut.
  (* keep *) wire [Pointer-1:0] inside_write_q, inside_read_q, inside_write_gray_q;
  (* keep *) wire [Pointer-1:0] inside_read_gray_q;
  (* keep *) wire inside_write, inside_read, inside_pending_q, inside_flush_q, inside_acknowledge_q;
  (* keep *) wire [Pointer:0] inside_dut__u_to_pixel__meta_q, inside_dut__u_to_pixel__stable_q;
  (* keep *) wire [Pointer+Overflow+1:0] inside_dut__u_from_pixel__meta_q;
  (* keep *) wire [Pointer+Overflow+1:0] inside_dut__u_from_pixel__stable_q;

  function automatic logic [Pointer-1:0] binary(input logic [Pointer-1:0] gray);
    binary = gray ^ (gray >> 1);
    binary = binary ^ (binary >> 2);
    binary = binary ^ (binary >> 4);
  endfunction

  // The same words on their way: as sent, in the first flip-flop, in the second.
  logic [Pointer-1:0] written, written_meta, written_seen;
  logic [Pointer-1:0] taken, taken_meta, taken_seen;
  assign written      = inside_write_q;
  assign written_meta = binary(inside_dut__u_from_pixel__meta_q[Overflow+2+:Pointer]);
  assign written_seen = binary(inside_dut__u_from_pixel__stable_q[Overflow+2+:Pointer]);
  assign taken        = inside_read_q;
  assign taken_meta   = binary(inside_dut__u_to_pixel__meta_q[1+:Pointer]);
  assign taken_seen   = binary(inside_dut__u_to_pixel__stable_q[1+:Pointer]);

  // A flush goes round: asked for on one side, seen and acknowledged on the other, seen again.
  logic [5:0] flush;
  assign flush = {inside_flush_q,
                  inside_dut__u_to_pixel__meta_q[0], inside_dut__u_to_pixel__stable_q[0],
                  inside_acknowledge_q,
                  inside_dut__u_from_pixel__meta_q[0], inside_dut__u_from_pixel__stable_q[0]};

  // What one step of a chain may be from the next: the number of words between them.
  logic [Pointer-1:0] level, unseen, on_the_way, behind, seen_behind, room;
  logic               clean;
  assign clean       = !inside_pending_q && !inside_flush_q;
  assign level       = written - taken;
  assign on_the_way  = written - written_meta;
  assign unseen      = written_meta - written_seen;
  assign behind      = taken - taken_meta;
  assign seen_behind = taken_meta - taken_seen;
  assign room        = written - taken_seen;

  function automatic logic [Pointer+2:0] wide(input logic [Pointer-1:0] words);
    wide = {3'd0, words};
  endfunction

  always_comb begin
    // Parts of the way from what the sensor's side has seen to what it has written.
    pointers_in_order:
    assert (!clean || (wide(seen_behind) + wide(behind) + wide(written_seen - taken) +
                       wide(unseen) + wide(on_the_way) == wide(room) && wide(room) <= Depth));
    unread_is_not_overwritten: assert (!inside_write || !clean || wide(level) < Depth);
    nothing_is_read_that_was_not_written: assert (!inside_read || (clean && level != '0));
    nothing_is_read_in_a_flush: assert (!inside_read || flush == '0);

    step_gray: assert (binary(inside_write_gray_q) == written &&
                       binary(inside_read_gray_q) == taken);
    step_round: assert (flush[5] ? (flush & {1'b0, ~flush[5:1]}) == '0
                                 : (~flush & {1'b0, flush[5:1]}) == '0);
    step_quiet: assert (!(inside_pending_q || flush[5] || flush[0]) || taken == '0);
    step_taken: assert ((!flush[4] || taken_meta == '0) && (!flush[3] || taken_seen == '0));
    step_written: assert ((!flush[2] || written == '0) && (!flush[1] || written_meta == '0) &&
                          (!flush[0] || written_seen == '0));
    step_ends: assert (!(flush[0] && !flush[5]) || (taken_meta == '0 && taken_seen == '0));

    a_full_fifo: cover (clean && wide(level) == Depth && line_start);
    a_line_end: cover (line_end && pixel_valid);
  end

endmodule

`default_nettype wire
