// frame_decoder_contract: what frame_decoder promises, and nothing about how.
//
// A frame is decoded a second time here, by a register of what is open: its bytes, their CRC and
// their number are compared with what comes out.

`default_nettype none

module frame_decoder_contract #(
  parameter int unsigned MaxPayload = 1024
) (
  input wire logic                              clk_i,
  input wire logic                              rst_i,
  input wire logic                              valid_i,
  input wire logic [                       7:0] data_i,
  input wire logic                              error_i,
  input wire logic                              valid_o,
  input wire logic [                       7:0] data_o,
  input wire logic                              done_o,
  input wire logic [frame_pkg::StatusWidth-1:0] status_o,
  input wire logic                              open_q,
  input wire logic                              inside_q,
  input wire logic                              due_q,
  input wire logic                              framing_q,
  input wire logic [                       7:0] left_q,
  input wire logic                              byte_valid_q,
  input wire logic                              end_q,
  input wire logic [    frame_pkg::CrcWidth-1:0] crc_q,
  input wire logic [                      16:0] count_q,
  input wire logic [                       7:0] byte_q,
  input wire logic [                       7:0] newer_q,
  input wire logic [                       7:0] older_q
);

  localparam logic [16:0] Most = 17'(MaxPayload) + 17'd3;  // where counting ends

  logic started_q;
  initial started_q = 1'b0;

  // ---- the frame as it comes: the byte of this clock, decoded ----
  logic       begun_q, framing;  // something has come since the last 0x00
  logic [7:0] rest_q;            // bytes to the next code
  logic       zero_q;            // a zero stands before the next code
  logic       broken_q;          // a byte had no stop bit
  logic       ends, comes;
  logic [7:0] decoded;
  assign ends    = valid_i && data_i == 8'd0;
  assign comes   = valid_i && !ends && (rest_q != 8'd0 || zero_q);
  assign decoded = rest_q != 8'd0 ? data_i : 8'd0;
  assign framing = broken_q || error_i;

  // ---- what has come of it, a clock later ----
  logic [16:0]                    number_q, number;
  logic [7:0]                     last_q, before_q;  // the two latest
  logic [frame_pkg::CrcWidth-1:0] crc_own_q;
  assign number = !comes || number_q == Most ? number_q : number_q + 17'd1;

  logic [16:0] ahead;  // of the module's count, with what it has decoded
  assign ahead = byte_valid_q && count_q != Most ? count_q + 17'd1 : count_q;

  // ---- what is due ----
  logic                              byte_due_q, byte_due_q2, done_due_q, done_due_q2;
  logic [                       7:0] out_q, out_q2;
  logic [frame_pkg::StatusWidth-1:0] status_q, status_q2;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    if (ends) begin
      {begun_q, zero_q, broken_q} <= 3'b000;
      rest_q    <= 8'd0;
      number_q  <= 17'd0;
      crc_own_q <= frame_pkg::CrcInit;
    end else if (valid_i) begin
      begun_q  <= 1'b1;
      broken_q <= framing;
      rest_q   <= rest_q != 8'd0 ? rest_q - 8'd1 : data_i - 8'd1;
      if (rest_q == 8'd0) zero_q <= data_i != 8'd255;
      number_q <= number;
      if (comes) begin
        {before_q, last_q} <= {last_q, decoded};
        crc_own_q <= frame_pkg::crc_next(crc_own_q, decoded);
      end
    end

    byte_due_q <= comes && number_q >= 17'd2 && number_q < 17'(MaxPayload) + 17'd2;
    out_q      <= before_q;
    done_due_q <= ends && begun_q;
    status_q   <= framing ? frame_pkg::StatusFraming
                  : rest_q != 8'd0 ? frame_pkg::StatusMalformed
                  : number_q == Most ? frame_pkg::StatusTooLong
                  : number_q <= 17'd2 ? frame_pkg::StatusTooShort
                  : crc_own_q != '0 ? frame_pkg::StatusCrc : frame_pkg::StatusOk;
    {byte_due_q2, out_q2}    <= {byte_due_q, out_q};
    {done_due_q2, status_q2}        <= {done_due_q, status_q};
    if (rst_i) begin
      {begun_q, zero_q, broken_q, byte_due_q, byte_due_q2, done_due_q, done_due_q2} <= '0;
      rest_q    <= 8'd0;
      number_q  <= 17'd0;
      crc_own_q <= frame_pkg::CrcInit;
    end

    if (started_q) begin
      bytes_come_once_and_in_order:
      assert (valid_o == byte_due_q2 && (!valid_o || data_o == out_q2));
      every_frame_ends_once: assert (done_o == done_due_q2 && (!done_o || status_o == status_q2));
      no_byte_with_the_end: assert (!(valid_o && done_o));

      step_blocks: assert (open_q == begun_q && due_q == zero_q && framing_q == broken_q &&
                           rest_q == (inside_q ? left_q : 8'd0) && (!inside_q || left_q != 8'd0));
      step_nothing: assert (begun_q || end_q || (!byte_valid_q && count_q == 17'd0 &&
                                                 crc_q == frame_pkg::CrcInit));
      step_number: assert (end_q ? !byte_valid_q && number_q == 17'd0
                                 : number_q == ahead && count_q <= Most);
      step_crc: assert (crc_own_q == (end_q ? frame_pkg::CrcInit : byte_valid_q
                                      ? frame_pkg::crc_next(crc_q, byte_q) : crc_q));
      step_last: assert (number_q < 17'd1 || last_q == (byte_valid_q ? byte_q : newer_q));
      step_before: assert (number_q < 17'd2 || before_q == (byte_valid_q ? newer_q : older_q));

      a_frame: cover (done_o && status_o == frame_pkg::StatusOk);
    end
  end

endmodule

bind frame_decoder frame_decoder_contract #(.MaxPayload(MaxPayload)) u_contract (
  .*, .count_q(17'(count_q))
);

`default_nettype wire
