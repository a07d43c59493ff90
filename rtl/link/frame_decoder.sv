// frame_decoder: the payload of a frame that frame_encoder made, and whether it is whole.
//
// The last two bytes of a frame are its CRC, and which they are is known at its end only: a byte
// goes out when two more have been decoded.  So the payload is out before its CRC is known, and
// the consumer keeps it aside until done_o, and takes it where status_o is StatusOk, no other.
//
// A 0x00 ends what there is, so the frame behind a bad one is a new one; without anything before
// it, it is silence.  A frame that has lost its 0x00 takes the next one with it, unless the sender
// puts a 0x00 in front too.  A byte with error_i spoils its frame, and ends it where it is a 0x00:
// what was one frame is then two, the second with a code where there was none and a CRC that fits
// once in 2**16.  The same goes for a byte that an error has made 0x00.
//
//   valid_i     a byte, in any clock; error_i: it had no stop bit
//   valid_o     a byte of the payload; at most MaxPayload a frame
//   done_o      the frame has ended; status_o is one of frame_pkg's.  Of several faults it names
//               the one highest here: Framing, Malformed, TooLong, TooShort, Crc.
//   Latency     2 clocks from the byte that lets one go, and from the 0x00 to done_o
//   Model       vrscan.clocked.frame_decoder, bit-exact

`default_nettype none

module frame_decoder #(
  parameter int unsigned MaxPayload = 1024  // bytes
) (
  input  wire logic                              clk_i,
  input  wire logic                              rst_i,

  input  wire logic                              valid_i,
  input  wire logic [                       7:0] data_i,
  input  wire logic                              error_i,

  output      logic                              valid_o,
  output      logic [                       7:0] data_o,

  output      logic                              done_o,
  output      logic [frame_pkg::StatusWidth-1:0] status_o
);

  if (MaxPayload < 1 || MaxPayload > 65535) begin : gen_bad_max_payload
    $error("frame_decoder: MaxPayload must be 1 to 65535");
  end

  localparam int unsigned CrcBytes = 2;
  localparam int unsigned TooMany = MaxPayload + CrcBytes + 1;
  localparam int unsigned CountWidth = $clog2(TooMany + 1);

  // COBS: at most one byte comes out for one that comes in.
  logic       open_q, inside_q, due_q, framing_q;
  logic [7:0] left_q;  // bytes of the block still to come
  logic       byte_valid_q, end_q, cut_q, framing_q2;
  logic [7:0] byte_q;

  // CRC and length.
  logic [frame_pkg::CrcWidth-1:0] crc_q;
  logic [         CountWidth-1:0] count_q;  // bytes decoded, stops at TooMany
  logic [                    7:0] newer_q, older_q;

  always_ff @(posedge clk_i) begin
    byte_valid_q <= 1'b0;
    end_q        <= 1'b0;
    cut_q        <= inside_q;
    framing_q2   <= framing_q || error_i;
    byte_q       <= inside_q ? data_i : 8'd0;
    if (valid_i && data_i == 8'd0) begin
      end_q     <= open_q;
      open_q    <= 1'b0;
      inside_q  <= 1'b0;
      due_q     <= 1'b0;
      framing_q <= 1'b0;
    end else if (valid_i) begin
      open_q    <= 1'b1;
      framing_q <= framing_q || error_i;
      if (inside_q) begin
        byte_valid_q <= 1'b1;
        left_q       <= left_q - 8'd1;
        inside_q     <= left_q != 8'd1;
      end else begin
        // A code.  The block before it ends in a zero, unless it was full or there was none.
        byte_valid_q <= due_q;
        left_q       <= data_i - 8'd1;
        inside_q     <= data_i != 8'd1;
        due_q        <= data_i != 8'd255;
      end
    end

    valid_o <= 1'b0;
    done_o  <= end_q;
    data_o  <= older_q;
    if (byte_valid_q) begin
      valid_o <= count_q >= CountWidth'(CrcBytes) && count_q < CountWidth'(TooMany - 1);
      newer_q <= byte_q;
      older_q <= newer_q;
      crc_q   <= frame_pkg::crc_next(crc_q, byte_q);
      if (count_q != CountWidth'(TooMany)) count_q <= count_q + CountWidth'(1);
    end
    if (end_q) begin
      crc_q   <= frame_pkg::CrcInit;
      count_q <= '0;
    end

    if (framing_q2) status_o <= frame_pkg::StatusFraming;
    else if (cut_q) status_o <= frame_pkg::StatusMalformed;
    else if (count_q == CountWidth'(TooMany)) status_o <= frame_pkg::StatusTooLong;
    else if (count_q <= CountWidth'(CrcBytes)) status_o <= frame_pkg::StatusTooShort;
    else if (crc_q != '0) status_o <= frame_pkg::StatusCrc;
    else status_o <= frame_pkg::StatusOk;

    if (rst_i) begin
      open_q       <= 1'b0;
      inside_q     <= 1'b0;
      due_q        <= 1'b0;
      framing_q    <= 1'b0;
      byte_valid_q <= 1'b0;
      end_q        <= 1'b0;
      crc_q        <= frame_pkg::CrcInit;
      count_q      <= '0;
      valid_o      <= 1'b0;
      done_o       <= 1'b0;
    end
  end

endmodule

`default_nettype wire
