// command_queue: keeps the frames that were received until their commands are executed.
//
// A frame is a command where its status is StatusOk.  Up to seven frames are kept, among them the
// one that is executed; a command more is lost and counted.  A bad frame is counted, and kept to be
// told while fewer than four are kept: noise never takes the place of a command.
//
//   valid_i         a byte of the payload; done_i, status_i: its frame has ended, so
//   halt_i          what waits is dropped
//   waits_o         a frame waits for take_i, which begins it; not with halt_i
//   release_i       what was begun is needed no more
//   status_o, length_o  of what was begun, or of what would be
//   index_i         a byte of its payload, byte_o a clock later
//   frames_*_o, commands_lost_o  how many there were; stop at their largest
//   Latency         done_i to waits_o: 1 clock; to status_o and length_o of it: 2 clocks
//   Model           vrscan.clocked.command_queue, bit-exact

`default_nettype none

module command_queue #(
  parameter  int unsigned CountWidth  = vrscan_pkg::CounterWidth,  // where counters stop
  localparam int unsigned IndexWidth  = $clog2(link_pkg::MaxPayload),
  localparam int unsigned LengthWidth = IndexWidth + 1
) (
  input  wire logic                                clk_i,
  input  wire logic                                rst_i,

  // Frames.
  input  wire logic                                valid_i,
  input  wire logic [                         7:0] data_i,
  input  wire logic                                done_i,
  input  wire logic [  frame_pkg::StatusWidth-1:0] status_i,
  input  wire logic                                halt_i,

  // Commands.
  output      logic                                waits_o,
  input  wire logic                                take_i,
  input  wire logic                                release_i,
  output      logic [  frame_pkg::StatusWidth-1:0] status_o,
  output      logic [             LengthWidth-1:0] length_o,
  input  wire logic [              IndexWidth-1:0] index_i,
  output      logic [                         7:0] byte_o,

  // Status.
  output      logic [vrscan_pkg::CounterWidth-1:0] frames_good_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] frames_crc_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] frames_malformed_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] frames_too_long_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] frames_too_short_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] frames_framing_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] commands_lost_o
);

  localparam int unsigned PlaceWidth = 3;
  localparam int unsigned Places = 1 << PlaceWidth;  // in one of them a frame is received
  localparam int unsigned EntryWidth = frame_pkg::StatusWidth + LengthWidth;

  if (link_pkg::MaxPayload != 1 << IndexWidth) begin : gen_bad_max_payload
    $error("command_queue: link_pkg::MaxPayload must be a power of two");
  end

  logic [           7:0] command_mem[Places << IndexWidth];
  logic [EntryWidth-1:0] entry_mem  [            Places];

  // From oldest to head is the one that is executed, from head to tail those that wait; what comes
  // goes to tail.
  logic [ PlaceWidth-1:0] oldest_q, head_q, tail_q, used;
  logic [LengthWidth-1:0] received_q;
  logic                   executed_q, good, push;
  assign used    = tail_q - oldest_q;
  assign good    = status_i == frame_pkg::StatusOk;
  assign push    = done_i && (good ? used != PlaceWidth'(Places - 1) : !used[PlaceWidth-1]);
  assign waits_o = head_q != tail_q;

  always_ff @(posedge clk_i) begin
    if (valid_i) command_mem[{tail_q, received_q[IndexWidth-1:0]}] <= data_i;
    if (push) entry_mem[tail_q] <= {status_i, received_q};
    byte_o               <= command_mem[{oldest_q, index_i}];
    {status_o, length_o} <= entry_mem[oldest_q];

    if (done_i) received_q <= '0;
    else if (valid_i) received_q <= received_q + LengthWidth'(1);
    if (push) tail_q <= tail_q + PlaceWidth'(1);

    if (take_i) begin
      head_q     <= head_q + PlaceWidth'(1);
      executed_q <= 1'b1;
    end
    if (release_i) begin
      oldest_q   <= head_q;
      executed_q <= 1'b0;
    end
    if (halt_i) begin
      head_q <= tail_q;
      if (!executed_q || release_i) oldest_q <= tail_q;
    end

    if (done_i) begin
      unique case (status_i)
        frame_pkg::StatusOk: frames_good_o <= vrscan_pkg::counted(frames_good_o, CountWidth);
        frame_pkg::StatusCrc: frames_crc_o <= vrscan_pkg::counted(frames_crc_o, CountWidth);
        frame_pkg::StatusMalformed:
          frames_malformed_o <= vrscan_pkg::counted(frames_malformed_o, CountWidth);
        frame_pkg::StatusTooLong:
          frames_too_long_o <= vrscan_pkg::counted(frames_too_long_o, CountWidth);
        frame_pkg::StatusTooShort:
          frames_too_short_o <= vrscan_pkg::counted(frames_too_short_o, CountWidth);
        default: frames_framing_o <= vrscan_pkg::counted(frames_framing_o, CountWidth);
      endcase
    end
    if (done_i && good && !push) begin
      commands_lost_o <= vrscan_pkg::counted(commands_lost_o, CountWidth);
    end

    if (rst_i) begin
      oldest_q           <= '0;
      head_q             <= '0;
      tail_q             <= '0;
      received_q         <= '0;
      executed_q         <= 1'b0;
      frames_good_o      <= '0;
      frames_crc_o       <= '0;
      frames_malformed_o <= '0;
      frames_too_long_o  <= '0;
      frames_too_short_o <= '0;
      frames_framing_o   <= '0;
      commands_lost_o    <= '0;
    end
  end

endmodule

`default_nettype wire
