// m3_stage: the commands of an M3 smart stage (06224-M-0003) as i2c_device has them: <08 TTTTTTTT>
// moves to a target, <10> asks for status and position.  Other ones get <24>, those without
// brackets <23>.
//
//   written_i, byte_i  a byte from the host; a carriage return ends the command
//   read_i           the host has read shown_o; behind the reply's end that is 255
//   position_i       where the motor is, and offset_i what is shown beside it
//   status_i         bits that the status has too
//   spoil_i          the byte of each reply, from 0, that is spoilt_i; 31 none
//   idle_o           no command has begun
//
// It leaves out all other commands and motion in the open loop: the loop is always closed.

`default_nettype none

module m3_stage #(
  parameter int unsigned Travel = 65535
) (
  input  wire logic               clk_i,
  input  wire logic               rst_i,

  input  wire logic               written_i,
  input  wire logic        [ 7:0] byte_i,
  input  wire logic               read_i,
  output      logic        [ 7:0] shown_o,
  output      logic               idle_o,

  input  wire logic        [15:0] position_i,
  input  wire logic signed [31:0] offset_i,
  input  wire logic        [23:0] status_i,
  input  wire logic        [ 4:0] spoil_i,
  input  wire logic        [ 7:0] spoilt_i,
  output      logic signed [31:0] target_o
);

  localparam int Window = 2;  // largest distance that is on target
  localparam logic [7:0] CarriageReturn = 8'h0D;

  logic        [111:0] heard_q, heard;  // the last 14 bytes of the command
  logic        [239:0] reply_q;
  logic        [  4:0] place_q;  // of the shown byte
  logic signed [ 31:0] position, distance;
  logic        [ 23:0] status;
  logic                forward, reverse, on_target;

  assign heard     = {heard_q[103:0], byte_i};
  assign idle_o    = heard_q == '0;
  assign shown_o   = place_q == spoil_i ? spoilt_i : reply_q[239:232];
  assign position  = signed'({16'd0, position_i});
  assign distance  = target_o - position;
  assign on_target = distance >= -Window && distance <= Window;
  assign forward   = position_i >= 16'(Travel);
  assign reverse   = position_i == '0;
  always_comb begin
    status     = status_i | 24'h30_0000;  // the loop is closed, and holds the target
    status[1]  = status[1] || distance > 0;
    status[9]  = status[9] || forward;
    status[10] = status[10] || reverse;
    status[18] = status[18] || on_target;
    status[19] = status[19] || (!on_target && !(distance > 0 ? forward : reverse));
    status[2]  = status[2] || status[19];
  end

  // The digits of a number, the first in the highest byte.
  function automatic logic [63:0] digits(input logic [31:0] value);
    for (int k = 0; k < 8; k++) begin
      logic [7:0] nibble;
      nibble = {4'd0, value[4*k+:4]};
      digits[8*k+:8] = nibble + (nibble > 8'd9 ? 8'h37 : 8'h30);
    end
  endfunction

  // The number of such digits.
  function automatic logic [31:0] number(input logic [63:0] text);
    for (int k = 0; k < 8; k++) begin
      number[4*k+:4] = text[8*k+6] ? text[8*k+:4] + 4'd9 : text[8*k+:4];
    end
  endfunction

  logic [63:0] shown_status, shown_position, shown_error;
  assign shown_status   = digits({8'd0, status});
  assign shown_position = digits(position + offset_i);
  assign shown_error    = digits(distance);

  always_ff @(posedge clk_i) begin
    if (written_i) begin
      heard_q <= byte_i == CarriageReturn ? '0 : heard;
      if (byte_i == CarriageReturn) begin
        place_q <= '0;
        reply_q <= {"<24>", CarriageReturn, {25{8'hFF}}};
        if (heard[15:8] != ">" || heard_q[103:0] == '0) begin
          reply_q <= {"<23>", CarriageReturn, {25{8'hFF}}};
        end else if (heard == 112'({"<10>", CarriageReturn})) begin
          reply_q <= {
            "<10 ", shown_status[47:0], " ", shown_position, " ", shown_error, ">", CarriageReturn
          };
        end else if (heard[111:80] == "<08 ") begin
          target_o <= number(heard[79:16]);
          reply_q  <= {"<08>", CarriageReturn, {25{8'hFF}}};
        end
      end
    end else if (read_i) begin
      reply_q <= {reply_q[231:0], 8'hFF};
      place_q <= place_q == '1 ? place_q : place_q + 5'd1;
    end

    if (rst_i) begin
      heard_q  <= '0;
      reply_q  <= '1;
      place_q  <= '0;
      target_o <= '0;
    end
  end

endmodule

`default_nettype wire
