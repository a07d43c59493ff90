// frame_encoder_contract: what frame_encoder promises.
//
// What it gives is decoded again here, and compared with what it took.  Without an end that is
// proven on the side where the ring is written: a block's code is the distance to the next one, what
// is between them is not zero, and no place is written before it was read.

`default_nettype none

module frame_encoder_contract (
  input wire logic                           clk_i,
  input wire logic                           rst_i,
  input wire logic                           valid_i,
  input wire logic                           ready_o,
  input wire logic [                    7:0] data_i,
  input wire logic                           last_i,
  input wire logic                           valid_o,
  input wire logic                           ready_i,
  input wire logic [                    7:0] data_o,
  input wire logic [                    2:0] state_q,
  input wire logic [                    7:0] read_q,
  input wire logic [                    7:0] slot_q,
  input wire logic [                    7:0] fill_q,
  input wire logic [                    7:0] code_q,
  input wire logic                           full_q,
  input wire logic                           room_q,
  input wire logic                           accept,
  input wire logic                           put,
  input wire logic                           close,
  input wire logic                           store,
  input wire logic                           take,
  input wire logic [                    7:0] given,
  input wire logic [                    7:0] address,
  input wire logic [                    7:0] value,
  input wire logic [frame_pkg::CrcWidth-1:0] crc_q
);

  localparam logic [2:0] Data = 3'd0;
  localparam logic [2:0] Delimiter = 3'd4;
  localparam logic [3:0] LongestWait = 4'd14;  // clocks without room for a byte, if all is taken

  logic started_q;
  initial started_q = 1'b0;

  // ---- what was taken waits here to come out ----
  typedef enum logic [1:0] {PAYLOAD, HIGH, LOW, END} part_e;
  logic [8:0] taken_mem[512];
  logic [8:0] put_q, got_q, entry;
  assign entry = taken_mem[got_q];

  // ---- the frame, decoded ----
  part_e       part_q;
  logic [ 7:0] left_q;
  logic        due_q, given_out, decoded, right;
  logic [ 7:0] decoded_byte;
  logic [frame_pkg::CrcWidth-1:0] crc_out_q;
  assign given_out    = valid_o && ready_i;
  assign decoded      = given_out && (left_q != 8'd0 || (due_q && data_o != 8'd0));
  assign decoded_byte = left_q != 8'd0 ? data_o : 8'd0;
  always_comb begin
    unique case (part_q)
      PAYLOAD: right = put_q != got_q && decoded_byte == entry[7:0];
      HIGH:    right = decoded_byte == crc_out_q[15:8];
      LOW:     right = decoded_byte == crc_out_q[7:0];
      default: right = 1'b0;
    endcase
  end

  logic       stays_q;
  logic [7:0] data_q;
  logic [3:0] wait_q;
  logic [7:0] committed;
  assign committed = slot_q - read_q;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    stays_q   <= valid_o && !ready_i;
    data_q    <= data_o;
    wait_q    <= ready_o || !take ? 4'd0 : wait_q == '1 ? wait_q : wait_q + 4'd1;
    if (accept) begin
      taken_mem[put_q] <= {last_i, data_i};
      put_q            <= put_q + 9'd1;
    end
    if (given_out) begin
      if (left_q != 8'd0) left_q <= left_q - 8'd1;
      else begin
        left_q <= data_o == 8'd0 ? 8'd0 : data_o - 8'd1;
        due_q  <= data_o != 8'd0 && data_o != 8'd255;
        if (data_o == 8'd0) begin
          part_q    <= PAYLOAD;
          crc_out_q <= frame_pkg::CrcInit;
        end
      end
    end
    if (decoded) begin
      if (part_q == PAYLOAD) begin
        got_q     <= got_q + 9'd1;
        crc_out_q <= frame_pkg::crc_next(crc_out_q, decoded_byte);
        if (entry[8]) part_q <= HIGH;
      end else begin
        part_q <= part_q == HIGH ? LOW : END;
      end
    end
    if (rst_i) begin
      stays_q   <= 1'b0;
      wait_q    <= 4'd0;
      put_q     <= 9'd0;
      got_q     <= 9'd0;
      left_q    <= 8'd0;
      due_q     <= 1'b0;
      part_q    <= PAYLOAD;
      crc_out_q <= frame_pkg::CrcInit;
    end

    if (started_q) begin
      data_stays: assert (!stays_q || (valid_o && data_o == data_q));
      no_deadlock: assert (wait_q <= LongestWait);
      simulated_payload_and_crc_come_out: assert (!decoded || right);
      simulated_zero_ends_whole_frames:
      assert (!given_out || data_o != 8'd0 || (left_q == 8'd0 && part_q == END));

      code_is_the_distance: assert (!close || state_q == Delimiter || value == fill_q - slot_q);
      no_zero_in_a_frame: assert (!store || (value == 8'd0) == (state_q == Delimiter));
      every_byte_is_stored:
      assert (!put || (store && (close ? given == 8'd0 && address == slot_q
                                       : value == given && address == fill_q)));
      payload_as_it_is: assert (!accept || (put && given == data_i));
      unread_is_not_overwritten: assert (!store || address - read_q >= committed);
      a_frame_ends_empty: assert (state_q != Delimiter || code_q == 8'd1);

      step_distance: assert (fill_q - slot_q == code_q && code_q != 8'd0);
      step_level: assert ({1'b0, committed} + {1'b0, code_q} <= 9'd256);
      step_room: assert (!room_q || {1'b0, committed} + {1'b0, code_q} <= 9'd255);
      step_full: assert (full_q == (code_q == 8'd255));
      step_ready: assert (!ready_o || (state_q == Data && !full_q && room_q));
      step_state: assert (state_q <= Delimiter);

      a_frame: cover (given_out && data_o == 8'd0 && part_q == END && got_q == 9'd3);
    end
  end

endmodule

bind frame_encoder frame_encoder_contract u_contract (.*);

`default_nettype wire
