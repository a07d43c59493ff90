// m3_motor_contract: what is sent is the command, and what is told of a stage is in its reply.
//
// The bytes of both streams are counted here, and each one is looked up by its number.  Another driver
// may use the bus while this one is not busy: such bytes and replies change nothing.

`default_nettype none

module m3_motor_contract (
  input wire logic        clk_i,
  input wire logic        rst_i,
  input wire logic        valid_i,
  input wire logic        read_i,
  input wire logic [15:0] target_i,
  input wire logic        busy_o,
  input wire logic        valid_o,
  input wire logic [ 3:0] status_o,
  input wire logic [15:0] position_o,
  input wire logic        command_valid_o,
  input wire logic        command_read_o,
  input wire logic [ 7:0] byte_o,
  input wire logic        last_o,
  input wire logic        byte_valid_i,
  input wire logic [ 7:0] byte_i,
  input wire logic        reply_valid_i,
  input wire logic [ 2:0] reply_status_i,
  input wire logic [24:0] motor_status_o,
  input wire logic [ 1:0] state_q,
  input wire logic        read_q,
  input wire logic [ 4:0] index_q,
  input wire logic        digit_q,
  input wire logic        good_q,
  input wire logic [31:0] word_q,
  input wire logic [23:0] status_q,
  input wire logic        beyond_q
);

  localparam logic [7:0] Return = 8'h0D;
  localparam logic [3:0] BadReply = 4'd7;
  localparam logic [3:0] MotorError = 4'd8;
  localparam logic [3:0] Limit = 4'd9;
  localparam logic [4:0] Shortest = 5'd5;  // bytes of <10> and <08>, with their ends
  localparam logic [4:0] Target = 5'd14;
  localparam logic [4:0] Longest = 5'd30;

  // ---- the command and the stream of now ----
  logic started_q, reading_q, second_q, runs_q, fresh_q, ended_q, stays_q;
  logic [15:0] target_q;
  logic [ 4:0] count_q, size;  // bytes that were taken, of so many
  initial started_q = 1'b0;
  assign size = second_q != reading_q ? Shortest : second_q ? Longest : Target;

  // ---- its next byte ----
  logic       digit, fits, numeral, letter;
  logic [3:0] nibble;
  logic [4:0] sent;  // digits of the target
  logic [7:0] wanted;
  assign sent   = count_q < 5'd4 ? 5'd0 : count_q > 5'd12 ? 5'd8 : count_q - 5'd4;
  assign nibble = sent < 5'd4 ? 4'd0 : 4'(target_q >> (5'd28 - 5'd4 * sent));
  assign digit  = count_q > 5'd3 && count_q < size - 5'd2 &&
                  !(second_q && (count_q == 5'd10 || count_q == 5'd19));
  always_comb begin
    wanted = " ";
    if (count_q == 5'd0) wanted = "<";
    if (count_q == 5'd1) wanted = reading_q ? "1" : "0";
    if (count_q == 5'd2) wanted = reading_q ? "0" : "8";
    if (count_q == size - 5'd2) wanted = ">";
    if (count_q == size - 5'd1) wanted = Return;
    if (digit) wanted = nibble < 4'd10 ? "0" + 8'(nibble) : "A" + 8'(nibble) - 8'd10;
  end
  assign numeral = byte_i >= "0" && byte_i <= "9";
  assign letter  = byte_i >= "A" && byte_i <= "F";
  assign fits    = digit ? numeral || letter : byte_i == wanted;

  // ---- what the reply tells ----
  logic        right_q, over_q, told, failed, at_limit;
  logic [31:0] heard_q;
  logic [23:0] told_q;
  logic [15:0] place_q;
  logic [24:0] motor_q;
  logic [ 3:0] result;
  assign told     = right_q && reply_status_i == '0;
  assign failed   = told_q[3] || told_q[16] || told_q[23];
  assign at_limit = !told_q[18] && (over_q || (!told_q[19] && (told_q[9] || told_q[10])));
  always_comb begin
    result = reply_status_i == '0 ? BadReply : 4'(reply_status_i);
    if (told) result = !reading_q ? '0 : failed ? MotorError : at_limit ? Limit : '0;
  end

  logic       start_due_q, end_due_q, take, heard, replied, more;
  logic [3:0] result_q;
  assign take    = valid_i && !busy_o;
  assign heard   = byte_valid_i && busy_o;
  assign replied = reply_valid_i && busy_o;
  assign more    = replied && !second_q && reply_status_i == '0;

  always_ff @(posedge clk_i) begin
    started_q   <= started_q || rst_i;
    start_due_q <= !rst_i && (take || more);
    end_due_q   <= !rst_i && replied && !more;
    fresh_q     <= heard;
    stays_q     <= !rst_i;
    motor_q     <= motor_status_o;
    result_q    <= second_q ? result : 4'(reply_status_i);
    if (take) {reading_q, target_q} <= {read_i, target_i};
    if (heard) begin
      count_q <= count_q + 5'd1;
      ended_q <= second_q ? byte_i == Return || count_q == Longest - 5'd1 : byte_o == Return;
      right_q <= right_q && fits;
      if (digit && second_q) heard_q <= {heard_q[27:0], byte_i[3:0] + (letter ? 4'd9 : 4'd0)};
      if (count_q == 5'd10) told_q <= heard_q[23:0];
      if (count_q == 5'd19) begin
        over_q  <= heard_q[31:16] != '0;
        place_q <= heard_q[31] ? '0 : heard_q[31:16] != '0 ? '1 : heard_q[15:0];
      end
    end
    if (take || more) begin
      second_q <= more;
      count_q  <= '0;
      ended_q  <= 1'b0;
      right_q  <= 1'b1;
      heard_q  <= word_q;  // all of it is shifted out
    end
    runs_q <= command_valid_o || (runs_q && !replied);
    if (rst_i) runs_q <= 1'b0;

    if (started_q) begin
      one_command: assume (rst_i || !valid_i || !busy_o);
      bytes_of_a_stream: assume (rst_i || !heard || (runs_q && !fresh_q && !ended_q));
      its_end: assume (rst_i || !replied || (runs_q && !byte_valid_i));
      no_success_of_a_part: assume (rst_i || !replied || reply_status_i != '0 || ended_q);

      streams_in_time: assert (command_valid_o == start_due_q);
      replies_in_time: assert (valid_o == end_due_q);
      busy_until_then: assert (busy_o == (command_valid_o || runs_q));
      a_stream_stays_one: assert (!busy_o || command_read_o == second_q);
      if (runs_q && !fresh_q) begin
        sent_as_written: assert (second_q || ended_q || byte_o == wanted);
        told_which_is_the_last: assert (last_o == ended_q);
      end
      a_command_has_an_end: assert (!runs_q || second_q || count_q <= size);
      a_reply_has_an_end: assert (!runs_q || count_q <= Longest);
      if (valid_o) begin
        result_as_told: assert (status_o == result_q);
        told_by_a_good_reply:
        assert (motor_status_o == (second_q && reading_q && (status_o == '0 || status_o > BadReply)
                                   ? {over_q, told_q} : motor_q));
        place_as_told: assert (!second_q || !reading_q || (status_o != '0 && status_o <= BadReply)
                               || position_o == place_q);
      end
      kept_until_then: assert (valid_o || !stays_q || motor_status_o == motor_q);
      nothing_of_before: assert (stays_q || motor_status_o == '0);

      step_state: assert (state_q == (!busy_o ? 2'd0 : second_q ? 2'd2 : 2'd1));
      if (busy_o) begin
        step_command: assert (read_q == reading_q && index_q == count_q);
        step_target: assert (second_q || reading_q ||
                             word_q == 32'(target_q) << (6'd4 * 6'(sent)));
        step_good: assert (!second_q || (good_q == right_q && word_q == heard_q));
        step_size: assert ((second_q && !right_q) ||
                           (ended_q == (count_q == size) && count_q <= size));
        step_ends: assert (!ended_q || count_q != '0);
        step_told: assert (!second_q || !reading_q || count_q < 5'd11 || status_q == told_q);
        step_place: assert (!second_q || !reading_q || count_q < 5'd20 ||
                            (beyond_q == over_q && position_o == place_q));
        step_not_over: assert (!second_q || ended_q || count_q < Longest);
        step_offer: assert (!runs_q || fresh_q || ended_q ||
                            (digit_q == digit && (digit || byte_o == wanted)));
      end

      a_reply_is_read: cover (command_valid_o && second_q && reading_q);
    end
  end

endmodule

bind m3_motor m3_motor_contract u_contract (.*);

`default_nettype wire
