// i2c_device: a focus motor on an I2C bus, and all that can be wrong with it.  It has 256 registers,
// or is an M3 smart stage.
//
// The first byte after its address sets the register pointer, further ones write, reads go on from
// it; the pointer counts on.  Registers 0 and 1 are the motor's target, 2 and 3 where it is, high
// byte first; the position is frozen at each start condition, so that its bytes belong together.
//
//   m3_i            bytes are the commands of m3_stage and its replies, and the next four are its
//   nack_address_i  not acknowledged, as if it were not there
//   nack_byte_i     the byte after the address that is not acknowledged, and not written: 0 is the
//                   register, 15 none
//   stretch_clks_i  SCL is held low for so long after each byte, or with stretch_bits_i each bit;
//                   four times as long after a command of m3_stage
//   hold_*_i        the line is held low, whatever happens
//   stall_i         the motor stands
//   push_i          it is moved by so much, as by a knock
//   noise_i         what the sensor shows beside the position
//   position_o      moves by one every StepClks, up to Travel
//
// It leaves out rise times, and the motor's run-up and creep; the lines are looked at unfiltered.

`default_nettype none

module i2c_device #(
  parameter int unsigned StepClks = 16,
  parameter int unsigned Travel   = 65535
) (
  input  wire logic        clk_i,
  input  wire logic        rst_i,

  input  wire logic        scl_i,
  input  wire logic        sda_i,
  output      logic        scl_low_o,
  output      logic        sda_low_o,

  input  wire logic        m3_i,
  input  wire logic signed [31:0] offset_i,
  input  wire logic [23:0] status_i,
  input  wire logic [ 4:0] spoil_i,
  input  wire logic [ 7:0] spoilt_i,

  input  wire logic [ 6:0] address_i,
  input  wire logic        nack_address_i,
  input  wire logic [ 3:0] nack_byte_i,
  input  wire logic [15:0] stretch_clks_i,
  input  wire logic        stretch_bits_i,
  input  wire logic        hold_scl_i,
  input  wire logic        hold_sda_i,

  input  wire logic        stall_i,
  input  wire logic signed [15:0] push_i,
  input  wire logic signed [ 7:0] noise_i,
  output      logic [15:0] position_o
);

  logic [ 7:0] registers_q[256];
  logic [ 7:0] pointer_q, shift_q, shown;
  logic [15:0] frozen_q, target, stretch_q, step_q, from;
  logic signed [17:0] shown_position, pushed;
  logic [ 3:0] bit_q, bit_now, byte_q;
  logic        scl_q, sda_q, active_q, reading_q, pull_q, hold_scl_q, hold_sda_q;

  // ---- the M3 ----
  logic               m3_written, m3_read, m3_idle;
  logic        [ 7:0] m3_shown;
  logic signed [31:0] m3_target;
  m3_stage #(.Travel(Travel)) u_m3_stage (
    .clk_i, .rst_i,
    .written_i(m3_written), .byte_i(shift_q), .read_i(m3_read), .shown_o(m3_shown),
    .idle_o(m3_idle),
    .position_i(position_o), .offset_i(offset_i + 32'(noise_i)), .status_i, .spoil_i, .spoilt_i,
    .target_o(m3_target)
  );

  logic transferred;  // the eighth bit of a byte behind the address
  assign transferred = active_q && scl_q && !scl_i && bit_now == 4'd8 && byte_q != '0;
  assign m3_written  = transferred && !reading_q && byte_q != nack_byte_i + 4'd1;
  assign m3_read     = transferred && reading_q;

  assign target    = m3_i ? limited(18'(m3_target)) : {registers_q[0], registers_q[1]};
  assign shown_position = signed'({2'b00, position_o}) + 18'(noise_i);
  assign pushed = signed'({2'b00, position_o}) + 18'(push_i);

  function automatic logic [15:0] limited(input logic signed [17:0] value);
    limited = value < 0 ? '0 : value > 18'(Travel) ? 16'(Travel) : 16'(value);
  endfunction
  assign from = limited(pushed);
  assign scl_low_o = hold_scl_q || stretch_q != '0;
  assign sda_low_o = hold_sda_q || pull_q;
  assign bit_now   = bit_q == 4'd8 ? 4'd0 : bit_q + 4'd1;
  always_comb begin
    shown = registers_q[pointer_q];
    if (pointer_q == 8'd2) shown = frozen_q[15:8];
    if (pointer_q == 8'd3) shown = frozen_q[7:0];
    if (m3_i) shown = m3_shown;
  end

  always_ff @(posedge clk_i) begin
    scl_q <= scl_i;
    sda_q <= sda_i;
    hold_scl_q <= hold_scl_i;
    hold_sda_q <= hold_sda_i;
    if (stretch_q != '0) stretch_q <= stretch_q - 16'd1;

    if (scl_q && scl_i && sda_q && !sda_i) begin
      active_q  <= 1'b1;
      reading_q <= 1'b0;
      pull_q    <= 1'b0;
      bit_q     <= '1;  // the next fall of SCL begins bit 0
      byte_q    <= '0;
      frozen_q  <= limited(shown_position);
    end else if (scl_q && scl_i && !sda_q && sda_i) begin
      active_q <= 1'b0;
      pull_q   <= 1'b0;
    end else if (active_q && !scl_q && scl_i) begin
      shift_q <= {shift_q[6:0], sda_i};
      if (reading_q && byte_q != '0 && bit_q == 4'd8 && sda_i) active_q <= 1'b0;
    end else if (active_q && scl_q && !scl_i) begin
      bit_q  <= bit_now;
      pull_q <= reading_q && bit_now != 4'd8 && !shown[3'd7-bit_now[2:0]];
      if (stretch_bits_i || (bit_now == 4'd0 && bit_q == 4'd8)) begin
        stretch_q <= stretch_clks_i;
        if (m3_i && m3_idle && !reading_q && byte_q != '0) stretch_q <= stretch_clks_i << 2;
      end
      if (bit_now == 4'd0 && bit_q == 4'd8 && byte_q != '1) byte_q <= byte_q + 4'd1;
      if (bit_now == 4'd8) begin
        if (byte_q == '0) begin
          if (shift_q[7:1] != address_i || nack_address_i) active_q <= 1'b0;
          else pull_q <= 1'b1;
          reading_q <= shift_q[0];
        end else if (reading_q) begin
          pointer_q <= pointer_q + 8'd1;
        end else if (byte_q != nack_byte_i + 4'd1) begin
          pull_q    <= 1'b1;
          pointer_q <= byte_q == 4'd1 ? shift_q : pointer_q + 8'd1;
          if (byte_q != 4'd1) registers_q[pointer_q] <= shift_q;
        end
      end
    end

    step_q     <= step_q + 16'd1;
    position_o <= from;
    if (step_q == 16'(StepClks - 1)) begin
      step_q <= '0;
      if (!stall_i && from < target && from < 16'(Travel)) position_o <= from + 16'd1;
      if (!stall_i && from > target) position_o <= from - 16'd1;
    end

    if (rst_i) begin
      scl_q      <= 1'b1;
      sda_q      <= 1'b1;
      active_q   <= 1'b0;
      pull_q     <= 1'b0;
      stretch_q  <= '0;
      step_q     <= '0;
      position_o <= '0;
      pointer_q  <= '0;
      for (int unsigned k = 0; k < 256; k++) registers_q[k] <= '0;
    end
  end

endmodule

`default_nettype wire
