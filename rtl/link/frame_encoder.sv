// frame_encoder: a payload becomes a frame: a CRC is put behind it, COBS takes out the zeros, and
// 0x00 ends it.
//
// COBS tells ahead of each block of up to 254 bytes where the next zero is.  So a block opens with
// a free slot in a ring of 256 bytes; its bytes follow, and at its end the slot gets the code.  A
// zero of the payload is the clock in which the code is written; the 0x00 takes a slot of its own.
// Every byte of the frame is written once and read once, so the input waits just where the frame
// has a byte more than the payload.
//
//   ready_o      with ready_i high, low for 1 clock after 254 bytes without a zero and for 2 until
//                the ring has room again, and for 4 after last_i: two of CRC, the code, the 0x00;
//                a block that is full by then adds its own.  ready_i low: until there is room.
//   data_o       stays while ready_i is low; 0x00 is the end of a frame and nothing else
//   Latency      5 clocks from last_i taken to valid_o with the code of a block that is not full,
//                2 from the zero that ends a block; then a byte a clock
//   Model        vrscan.clocked.frame_encoder, bit-exact

`default_nettype none

module frame_encoder (
  input  wire logic       clk_i,
  input  wire logic       rst_i,

  input  wire logic       valid_i,
  output      logic       ready_o,
  input  wire logic [7:0] data_i,
  input  wire logic       last_i,

  output      logic       valid_o,
  input  wire logic       ready_i,
  output      logic [7:0] data_o
);

  typedef enum logic [2:0] {DATA, CRC_HIGH, CRC_LOW, CODE, DELIMITER} state_e;

  logic [7:0] ring_mem [256];

  // The open slot is always taken, so fill_q on read_q can only be a full ring.
  state_e                         state_q, state_d;  // ready_o has to know the next one
  logic [                    7:0] read_q, slot_q, fill_q;
  logic [                    7:0] code_q;  // of the open block as it is, 1 to 255
  logic                           full_q, full, room_q, room;
  logic [frame_pkg::CrcWidth-1:0] crc_q;

  // Whether a byte is stored is known without looking at it; whether it is a zero comes last.
  logic [7:0] given;
  logic       accept, put, zero, close, store;
  assign accept = valid_i && ready_o;
  always_comb begin
    unique case (state_q)
      CRC_HIGH: {zero, given} = {crc_q[15:8] == 8'd0, crc_q[15:8]};
      CRC_LOW: {zero, given} = {crc_q[7:0] == 8'd0, crc_q[7:0]};
      default: {zero, given} = {data_i == 8'd0, data_i};
    endcase
    unique case (state_q)
      DATA: begin
        put   = accept;
        close = full_q ? room_q : accept && zero;
        store = accept || (full_q && room_q);
      end
      CRC_HIGH, CRC_LOW: begin
        put   = room_q && !full_q;
        close = room_q && (full_q || zero);
        store = room_q;
      end
      default: begin
        put   = 1'b0;
        close = room_q;
        store = room_q;
      end
    endcase
    unique case (state_q)
      DATA: state_d = accept && last_i ? CRC_HIGH : DATA;
      CRC_HIGH: state_d = put ? CRC_LOW : CRC_HIGH;
      CRC_LOW: state_d = put ? CODE : CRC_LOW;
      CODE: state_d = close ? DELIMITER : CODE;
      DELIMITER: state_d = close ? DATA : DELIMITER;
      default: state_d = DATA;
    endcase
    full = full_q ? !room_q : put && !zero && code_q == 8'd254;
    // What is read in this clock is seen a clock later.
    room = store ? fill_q + 8'd1 != read_q : fill_q != read_q;
  end

  logic [7:0] address, value;
  assign address = close ? slot_q : fill_q;
  assign value   = !close ? given : state_q == DELIMITER ? 8'd0 : code_q;

  logic take, filled;
  assign take   = !valid_o || ready_i;
  assign filled = read_q != slot_q;

  always_ff @(posedge clk_i) begin
    if (store) ring_mem[address] <= value;
    if (take) data_o <= ring_mem[read_q];

    state_q <= state_d;
    full_q  <= full;
    room_q  <= room;
    ready_o <= state_d == DATA && !full && room;
    if (store) fill_q <= fill_q + 8'd1;
    if (close) slot_q <= fill_q;
    if (close) code_q <= 8'd1;
    else if (put) code_q <= code_q + 8'd1;

    if (state_q == DELIMITER) crc_q <= frame_pkg::CrcInit;
    else if (accept) crc_q <= frame_pkg::crc_next(crc_q, data_i);

    if (take) begin
      valid_o <= filled;
      if (filled) read_q <= read_q + 8'd1;
    end

    if (rst_i) begin
      state_q    <= DATA;
      full_q     <= 1'b0;
      ready_o    <= 1'b0;
      read_q     <= 8'd0;
      slot_q     <= 8'd0;
      fill_q     <= 8'd1;
      code_q     <= 8'd1;
      crc_q      <= frame_pkg::CrcInit;
      valid_o    <= 1'b0;
    end
  end

endmodule

`default_nettype wire
