// pixel_fifo: brings a sensor's pixels from its own clock to clk_i.
//
// An asynchronous FIFO: pointers cross in Gray code through two flip-flops.  It is read in every
// clock that finds something in it, as nothing behind it waits.  Where the sensor's clock is the
// faster one, what of a line without gaps is not read while it comes has to fit.
//
//   line_valid_i   as the sensor gives it: a line is from its rise to its fall
//   pixel_valid_i  a pixel, while line_valid_i is high; constant 1 for a sensor without it
//   line_start_o   with the line's first pixel, line_end_o with its last one; a line without a
//                  pixel is not sent
//   overflow_count_o  lines that found the FIFO full.  Such a line loses all that follows, its end
//                  too, so that line_receiver counts it as unfinished; a start that found no room
//                  is sent alone as soon as there is some, if that is before the line's end.
//                  Stops at its largest value
//   rst_i, pixel_rst_i  each synchronous to its own clock and of any length: either empties the
//                  whole FIFO, and a line that is on its way loses all that follows.  rst_i alone
//                  sets the counter to zero.  Nothing comes out while pixel_clk_i stands
//   Crossings      the pointers and overflows_q in Gray code, request_q, flush_q and acknowledge_q;
//                  they are to arrive within a period of the faster clock of each other
//   Latency  a pixel waits for the next one, or the line's fall, to know whether it is the last;
//            then it takes one pixel clock and, if the FIFO is empty, the fourth edge of clk_i
//   Model    the order of the words only, vrscan.clocked.pixel_fifo: between two clocks no model has
//            the clock of a word

`default_nettype none

module pixel_fifo #(
  parameter  int unsigned PixelWidth = 12,
  parameter  int unsigned LineLength = 2048,
  parameter  int unsigned ClockHz    = 76_666_667,  // of clk_i, or a little less
  parameter  int unsigned PixelHz    = 80_000_000,  // of pixel_clk_i at most
  parameter  int unsigned CountWidth = 16,
  localparam logic [63:0] FasterHz   = PixelHz > ClockHz ? 64'(PixelHz) - 64'(ClockHz) : 64'd0,
  localparam int unsigned Backlog    = 32'((64'(LineLength) * FasterHz + 64'(PixelHz) - 64'd1)
                                           / 64'(PixelHz)),
  localparam int unsigned Crossing   = 8,  // words while the pointers cross
  parameter  int unsigned Depth      = 1 << $clog2(Backlog + Crossing)
) (
  input  wire logic                        clk_i,
  input  wire logic                        rst_i,

  // The sensor, in its own clock.
  input  wire logic                        pixel_clk_i,
  input  wire logic                        pixel_rst_i,
  input  wire logic                        line_valid_i,
  input  wire logic                        pixel_valid_i,
  input  wire logic [PixelWidth-1:0] pixel_i,

  output      logic                        line_start_o,
  output      logic                        line_end_o,
  output      logic                        pixel_valid_o,
  output      logic [PixelWidth-1:0] pixel_o,

  // Status.
  output      logic [      CountWidth-1:0] overflow_count_o
);

  if (PixelHz < 1 || Depth < Backlog + Crossing || (Depth & (Depth - 1)) != 0) begin : gen_bad_depth
    $error("pixel_fifo: Depth must be a power of two that holds what of a line waits, and 8 more");
  end

  localparam int unsigned IndexWidth = $clog2(Depth);
  localparam int unsigned PointerWidth = IndexWidth + 1;
  localparam int unsigned OverflowWidth = 4;  // overflows that have not crossed yet are fewer

  typedef struct packed {
    logic                        valid;  // of the pixel
    logic                        first;
    logic                        last;
    logic [PixelWidth-1:0] pixel;
  } word_t;

  function automatic logic [PointerWidth-1:0] gray(input logic [PointerWidth-1:0] binary);
    gray = binary ^ (binary >> 1);
  endfunction

  logic [PixelWidth+2:0] mem [Depth];

  // What crosses: each is a register of its own clock, and q2 in the other one.
  logic [ PointerWidth-1:0] write_gray_q, write_gray_q2, read_gray_q, read_gray_q2;
  logic [OverflowWidth-1:0] overflows_q, overflows_q2;
  logic                     request_q, request_q2, flush_q, flush_q2;
  logic                     acknowledge_q, acknowledge_q2;

  // None has a reset: either side may be reset alone, and must see the other as it is.
  synchronizer #(.Width(PointerWidth + 1)) u_to_pixel (
    .clk_i(pixel_clk_i), .rst_i(1'b0),
    .d_i({read_gray_q, flush_q}), .q_o({read_gray_q2, flush_q2})
  );
  synchronizer #(.Width(PointerWidth + OverflowWidth + 2)) u_from_pixel (
    .clk_i, .rst_i(1'b0),
    .d_i({write_gray_q, overflows_q, request_q, acknowledge_q}),
    .q_o({write_gray_q2, overflows_q2, request_q2, acknowledge_q2})
  );

  // ---- the sensor's side ----
  logic                        line_valid_q, pixel_valid_q, have_q, owed_q, drop_q;
  logic [PixelWidth-1:0] pixel_q, held_q;
  logic [    PointerWidth-1:0] write_q, write_next;
  logic [   OverflowWidth-1:0] overflow_q, overflow_next;
  logic                        halt, full, push, write, bare;
  word_t                       word;

  assign halt = pixel_rst_i || request_q || flush_q2;
  assign full = write_gray_q == {~read_gray_q2[PointerWidth-1-:2], read_gray_q2[PointerWidth-3:0]};
  assign push = have_q && (pixel_valid_q || !line_valid_q);
  // A start that is owed goes alone where its pixel is lost already.
  assign bare          = drop_q && owed_q && line_valid_q && !full && !halt;
  assign write         = (push && !drop_q && !full && !halt) || bare;
  assign write_next    = write_q + PointerWidth'(write);
  assign overflow_next = overflow_q + OverflowWidth'(push && !drop_q && full);
  assign word          = {!bare, owed_q, !bare && !line_valid_q, held_q};

  always_ff @(posedge pixel_clk_i) begin
    line_valid_q  <= line_valid_i;
    pixel_valid_q <= line_valid_i && pixel_valid_i;
    pixel_q       <= pixel_i;

    if (push) have_q <= 1'b0;
    if (pixel_valid_q) begin
      have_q <= 1'b1;
      held_q <= pixel_q;
    end
    drop_q <= line_valid_q && (drop_q || (push && full));
    owed_q <= !line_valid_q || (owed_q && !write);

    if (write) mem[write_q[IndexWidth-1:0]] <= word;
    write_q      <= write_next;
    write_gray_q <= gray(write_next);
    overflow_q   <= overflow_next;
    overflows_q  <= overflow_next ^ (overflow_next >> 1);

    // A reset of this side asks for a flush, which makes both pointers zero while neither is used.
    acknowledge_q <= flush_q2;
    if (flush_q2) request_q <= 1'b0;
    if (halt) begin
      have_q <= 1'b0;
      drop_q <= 1'b1;  // what is left of the line
      owed_q <= 1'b0;
    end
    if (flush_q2) begin
      write_q      <= '0;
      write_gray_q <= '0;
      overflow_q   <= '0;
      overflows_q  <= '0;
    end
    if (pixel_rst_i) request_q <= 1'b1;
  end

  // ---- this side ----
  logic [    PointerWidth-1:0] read_q, read_next;
  logic [   OverflowWidth-1:0] overflow_seen_q, overflow_new, overflow_more;
  logic [CountWidth+OverflowWidth-1:0] overflow_count;
  logic                        pending_q, begins, quiet, read, read_valid_q;
  word_t                       read_word_q;

  assign begins         = (pending_q || request_q2) && !flush_q && !acknowledge_q2;
  assign quiet          = rst_i || pending_q || request_q2 || flush_q || acknowledge_q2;
  assign read           = read_gray_q != write_gray_q2 && !quiet;
  assign read_next      = read_q + PointerWidth'(read);
  assign overflow_more  = overflow_new - overflow_seen_q;
  assign overflow_count = (CountWidth + OverflowWidth)'(overflow_count_o)
                          + (CountWidth + OverflowWidth)'(overflow_more);
  assign overflow_new   = {overflows_q2[3], ^overflows_q2[3:2], ^overflows_q2[3:1], ^overflows_q2};

  always_ff @(posedge clk_i) begin
    // A flush waits for the end of the one before, and ends when the sensor's side has seen it.
    pending_q <= rst_i || (pending_q && !begins);
    flush_q   <= begins || (flush_q && !(acknowledge_q2 && !request_q2));

    read_word_q   <= mem[read_q[IndexWidth-1:0]];
    read_valid_q  <= read;
    read_q        <= read_next;
    read_gray_q   <= gray(read_next);
    pixel_o       <= read_word_q.pixel;
    pixel_valid_o <= read_valid_q && read_word_q.valid;
    line_start_o  <= read_valid_q && read_word_q.first;
    line_end_o    <= read_valid_q && read_word_q.last;

    overflow_seen_q  <= overflow_new;
    overflow_count_o <= overflow_count[CountWidth+OverflowWidth-1:CountWidth] != '0 ? '1
                        : overflow_count[CountWidth-1:0];
    if (quiet) begin
      read_valid_q     <= 1'b0;
      read_q           <= '0;
      read_gray_q      <= '0;
      pixel_valid_o    <= 1'b0;
      line_start_o     <= 1'b0;
      line_end_o       <= 1'b0;
      overflow_seen_q  <= '0;
      overflow_count_o <= overflow_count_o;
    end
    if (rst_i) overflow_count_o <= '0;
  end

endmodule

`default_nettype wire
