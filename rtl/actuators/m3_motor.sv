// m3_motor: turns the writes and reads of focus_motor into commands of an M3 smart stage, and its
// replies into theirs (New Scale Technologies, M3-LS Linear Smart Stage Command & Control Reference
// Guide, 06224-M-0003).
//
// A write of the target is <08 0000TTTT>, a read of the position <10>, each with its carriage
// return and as a stream of i2c_master.  A second stream reads the reply, which has to be <08>, or
// <10 SSSSSS PPPPPPPP EEEEEEEE> with digits 0..9 and A..F: status, position and error of the
// position.  It ends with the carriage return, or with the 30th byte.
//
//   valid_i .. target_i  a command; the next one may come after valid_o
//   busy_o           from a clock after it up to valid_o; meanwhile the bus is this module's
//   status_o         as i2c_master's; else 7: the reply is none of the command's; 8: the stage's
//                    status has its driver not responding (bit 3), an encoder error (16), or a stall
//                    (23); 9: it is not on target (18), and its position has not 16 bits, or it is at
//                    a limit (9, 10) and does not move towards the target (19)
//   position_o       of a read with status_o 0, 8 or 9: the stage's position, 0 for one below that
//                    and 65535 for one above
//   motor_status_o   bits 23..0: the status in the last good reply to a read; 24: its position was
//                    below 0 or above 65535
//   Latency  command_valid_o comes a clock after valid_i, and a clock after the reply to the first
//            stream; valid_o a clock after that to the second
//   Model    vrscan.clocked.m3_motor, bit-exact

`default_nettype none

module m3_motor (
  input  wire logic        clk_i,
  input  wire logic        rst_i,

  input  wire logic        valid_i,
  input  wire logic        read_i,
  input  wire logic [15:0] target_i,

  output      logic        busy_o,
  output      logic        valid_o,
  output      logic [ 3:0] status_o,
  output      logic [15:0] position_o,

  // i2c_master, whose address and settings are given to it elsewhere.
  output      logic        command_valid_o,
  output      logic        command_read_o,
  output      logic [ 7:0] byte_o,
  output      logic        last_o,
  input  wire logic        byte_valid_i,
  input  wire logic [ 7:0] byte_i,
  input  wire logic        reply_valid_i,
  input  wire logic [ 2:0] reply_status_i,

  // Status.
  output      logic [24:0] motor_status_o
);

  localparam logic [2:0] Ok = 3'd0;  // of i2c_master
  localparam logic [3:0] BadReply = 4'd7;
  localparam logic [3:0] MotorError = 4'd8;
  localparam logic [3:0] Limit = 4'd9;
  localparam logic [7:0] CarriageReturn = 8'h0D;
  localparam logic [4:0] FirstBlank = 5'd10;  // of the reply to a read, behind its status
  localparam logic [4:0] SecondBlank = 5'd19;  // behind its position
  localparam logic [4:0] LastByte = 5'd29;

  typedef enum logic [1:0] {IDLE, SEND, RECEIVE} state_e;

  state_e      state_q;
  logic        read_q;
  logic [ 4:0] index_q;  // of the byte that comes next
  logic        digit_q;  // it is a digit; if not, it is byte_o
  logic        good_q;
  logic [31:0] word_q;  // digits that are still to be sent, or were received
  logic [23:0] status_q;
  logic        beyond_q;

  // ---- the byte that comes next ----
  logic       short_form, digit;
  logic [4:0] close;
  logic [7:0] character;
  assign short_form = (state_q == SEND) == read_q;
  always_comb begin
    close = LastByte - 5'd1;
    if (state_q == SEND) close = 5'd12;
    if (short_form) close = 5'd3;
    digit = index_q > 5'd3 && index_q < close;
    if (state_q == RECEIVE && (index_q == FirstBlank || index_q == SecondBlank)) digit = 1'b0;
    character = " ";
    if (index_q == 5'd0) character = "<";
    if (index_q == 5'd1) character = read_q ? "1" : "0";
    if (index_q == 5'd2) character = read_q ? "0" : "8";
    if (index_q == close) character = ">";
    if (index_q == close + 5'd1) character = CarriageReturn;
    if (digit) character = {4'h3, word_q[31:28]};
    if (digit && word_q[31:28] > 4'd9) character = {4'h4, word_q[31:28] - 4'd9};
  end

  // ---- the byte that has come ----
  logic       decimal, letter, fits;
  logic [3:0] nibble;
  assign decimal = byte_i[7:4] == 4'h3 && byte_i[3:0] <= 4'd9;
  assign letter  = byte_i[7:3] == 5'b01000 && byte_i[2:0] != 3'd0 && byte_i[2:0] != 3'd7;
  assign nibble  = letter ? byte_i[3:0] + 4'd9 : byte_i[3:0];
  assign fits    = digit_q ? decimal || letter : byte_i == byte_o;

  logic failed, at_limit;
  assign failed   = status_q[3] || status_q[16] || status_q[23];
  assign at_limit = !status_q[18] && (beyond_q || (!status_q[19] && (status_q[9] || status_q[10])));

  always_ff @(posedge clk_i) begin
    valid_o         <= 1'b0;
    command_valid_o <= 1'b0;
    byte_o          <= character;
    digit_q         <= digit;

    unique case (state_q)
      IDLE: begin
        read_q         <= read_i;
        word_q         <= {16'd0, target_i};
        command_read_o <= 1'b0;
        index_q        <= '0;
        last_o         <= 1'b0;
        if (valid_i) begin
          state_q         <= SEND;
          busy_o          <= 1'b1;
          command_valid_o <= 1'b1;
        end
      end

      SEND: begin
        good_q <= 1'b1;
        if (byte_valid_i) begin
          index_q <= index_q + 5'd1;
          last_o  <= byte_o == CarriageReturn;
          if (digit_q) word_q <= word_q << 4;
        end
        if (reply_valid_i) begin
          index_q <= '0;
          last_o  <= 1'b0;
          if (reply_status_i == Ok) begin
            state_q         <= RECEIVE;
            command_valid_o <= 1'b1;
            command_read_o  <= 1'b1;
          end else begin
            state_q  <= IDLE;
            busy_o   <= 1'b0;
            valid_o  <= 1'b1;
            status_o <= {1'b0, reply_status_i};
          end
        end
      end

      default: begin  // RECEIVE
        if (byte_valid_i) begin
          index_q <= index_q + 5'd1;
          last_o  <= byte_i == CarriageReturn || index_q == LastByte;
          good_q  <= good_q && fits;
          if (digit_q) word_q <= {word_q[27:0], nibble};
          if (index_q == FirstBlank) status_q <= word_q[23:0];
          if (index_q == SecondBlank) begin
            beyond_q   <= word_q[31:16] != '0;
            position_o <= word_q[15:0];
            if (word_q[31:16] != '0) position_o <= word_q[31] ? '0 : '1;
          end
        end
        if (reply_valid_i) begin
          state_q <= IDLE;
          busy_o  <= 1'b0;
          valid_o <= 1'b1;
          if (reply_status_i != Ok) status_o <= {1'b0, reply_status_i};
          else if (!good_q) status_o <= BadReply;
          else if (read_q && failed) status_o <= MotorError;
          else if (read_q && at_limit) status_o <= Limit;
          else status_o <= {1'b0, Ok};
          if (reply_status_i == Ok && good_q && read_q) motor_status_o <= {beyond_q, status_q};
        end
      end
    endcase

    if (rst_i) begin
      state_q         <= IDLE;
      busy_o          <= 1'b0;
      valid_o         <= 1'b0;
      command_valid_o <= 1'b0;
      motor_status_o  <= '0;
    end
  end

endmodule

`default_nettype wire
