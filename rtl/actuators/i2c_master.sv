// i2c_master: register writes and reads of 1 to 4 bytes over I2C, and streams of any length, one
// command at a time.
//
// A bit is low for two quarters, SDA changing between them, and high for two from when SCL is seen
// high: stretching costs no high time, and SDA is taken in the middle.  Where another master ends
// the high time earlier, the bit ends with it.  Start and stop have two quarters on either side, so
// a quarter of 2.5 us keeps every minimum of the 100 kHz mode, 0.7 us those of the 400 kHz mode,
// edges of 0.1 us included.
//
// A command waits until both lines were high for three quarters.  If after timeout_i clocks a line
// is low, the bus is not free:
//   SCL has fallen meanwhile   another master has it: ARBITRATION
//   SCL is low                 BUS_STUCK
//   SDA is low                 up to nine clocks; where one finds SDA high the next is a stop, and
//                              if SDA stays high, the command follows.  If not: BUS_STUCK
// Nothing else asks for the recovery: a device that holds SDA after a command is freed by the next.
//
//   data_i, data_o   right aligned; the highest byte used is the first on the bus
//   bytes_i          data bytes less one
//   stream_i         1: no register, but bytes up to that after which last_i is 1
//   byte_valid_o     of a stream: byte_i was taken to be written, or byte_o was read.  Two clocks
//                    later last_i says whether no byte follows it; both stay until the next
//   status_o         0 OK; 1 NACK_ADDRESS; 2 NACK_DATA, of the register or of a written byte;
//                    3 STRETCH_TIMEOUT, SCL not seen high timeout_i + 1 clocks after its release,
//                    4 BUS_STUCK; 5 ARBITRATION, SDA low where a 1 was sent, or SCL in the high
//                    time of a start or stop.  After 3, 4 and 5 both lines are released, no stop
//   data_o           0 unless a read of registers was OK
//   *_low_o          1 pulls the line low; never SCL for more than two quarters on end
//   scl_i, sda_i     asynchronous; pulses of one or two clocks are not seen
//   quarter_i        clocks, at least 4 (less counts as 4), taken with the command
//   timeout_i        clocks, above 6 and what SCL needs to rise, taken with the command
//   recovery_count_o begun recoveries; stops at its largest
//   Latency  a line is seen 5 clocks after its pin; a bit lasts 4 quarters + 6 clocks and SCL's rise.
//            Undisturbed, valid_o comes 36 W + 11 quarters + 6 (9 W + 1) clocks after a write of
//            W - 2 bytes or a stream of W - 1 was taken, 36 R + 17 quarters + 6 (9 R + 2) after a
//            read of R - 3 bytes; whatever the bus does, of a stream at most 36 W + 70 quarters +
//            (9 W + 14) (timeout_i + 3), of any other command what W = 7 gives
//   Model    vrscan.clocked.i2c_master, bit-exact
//
// It leaves out the addresses of 10 bits, and starts and stops of other masters within a byte.

`default_nettype none

module i2c_master #(
  parameter int unsigned TimeoutWidth = 24,
  parameter int unsigned CountWidth   = 16
) (
  input  wire logic                    clk_i,
  input  wire logic                    rst_i,

  input  wire logic                    valid_i,
  output      logic                    ready_o,
  input  wire logic                    read_i,
  input  wire logic [             6:0] address_i,
  input  wire logic [             7:0] register_i,
  input  wire logic [             1:0] bytes_i,
  input  wire logic [            31:0] data_i,

  // Streams.
  input  wire logic                    stream_i,
  input  wire logic [             7:0] byte_i,
  input  wire logic                    last_i,
  output      logic                    byte_valid_o,
  output      logic [             7:0] byte_o,

  output      logic                    valid_o,
  output      logic [             2:0] status_o,
  output      logic [            31:0] data_o,

  input  wire logic                    scl_i,
  input  wire logic                    sda_i,
  output      logic                    scl_low_o,
  output      logic                    sda_low_o,

  input  wire logic [            15:0] quarter_i,
  input  wire logic [TimeoutWidth-1:0] timeout_i,

  output      logic [  CountWidth-1:0] recovery_count_o
);

  if (TimeoutWidth < 4 || TimeoutWidth > 32) begin : gen_bad_timeout
    $error("i2c_master: TimeoutWidth must be in 4..32");
  end
  if (CountWidth < 1 || CountWidth > 32) begin : gen_bad_count
    $error("i2c_master: CountWidth must be in 1..32");
  end

  localparam logic [2:0] OK = 3'd0;
  localparam logic [2:0] NACK_ADDRESS = 3'd1;
  localparam logic [2:0] NACK_DATA = 3'd2;
  localparam logic [2:0] STRETCH_TIMEOUT = 3'd3;
  localparam logic [2:0] BUS_STUCK = 3'd4;
  localparam logic [2:0] ARBITRATION = 3'd5;

  localparam logic [3:0] ACK_BIT = 4'd8;
  localparam logic [3:0] LAST_CLOCK = 4'd8;  // of a recovery, from 0

  // Quarters: SCL low in 0 and 1, high in 2 and 3; start and stop have two more.
  typedef enum logic [2:0] {HOLD, SET_UP, RISE, HIGH, AFTER, LAST} phase_e;
  typedef enum logic [1:0] {FREE, START, BIT, STOP} work_e;
  typedef enum logic [2:0] {SELECT, REGISTER, WRITE, RESELECT, READ} stage_e;

  // What is seen of the lines.
  logic       scl_sync, sda_sync;
  logic [1:0] scl_run_q, sda_run_q;
  synchronizer #(.Width(2)) u_lines (
    .clk_i, .rst_i, .d_i({scl_i, sda_i}), .q_o({scl_sync, sda_sync})
  );
  logic       scl_q, sda_q, scl_q2, sda_q2;

  // The command.
  logic                    read_q, stream_q;
  logic [             6:0] address_q;
  logic [             7:0] register_q;
  logic [             1:0] bytes_q;  // left, less one
  logic [            31:0] data_q;
  logic [            15:0] quarter_q;  // less one
  logic [TimeoutWidth-1:0] timeout_q;
  logic [             2:0] result_q;

  // Where it is.
  work_e                   work_q;
  stage_e                  stage_q;
  phase_e                  phase_q;
  logic [            15:0] left_q;  // clocks of the quarter
  logic [TimeoutWidth-1:0] wait_q;
  logic [             3:0] bit_q;  // of the byte, or clock of the recovery
  logic [             7:0] shift_q;
  logic                    seen_q;  // SCL was high in this bit
  logic                    sample_q;
  logic                    moved_q;  // SCL fell while the bus should become free
  logic                    recover_q, recovered_q;

  logic moved, ended, ack, last, ours, value, lost;
  assign moved = moved_q || (scl_q2 && !scl_q);
  assign ended = left_q == '0;
  assign ack   = bit_q == ACK_BIT;
  assign last  = stream_q ? last_i : bytes_q == '0;
  // The bits that the master sends, and what it sends; it lets go of SDA for all others.
  assign ours  = !recover_q && (stage_q == READ) == ack;
  always_comb begin
    value = 1'b1;
    if (ours && ack) value = last;
    else if (ours) value = stage_q == WRITE ? data_q[31] : shift_q[7];
  end
  assign lost   = ours && value && !sda_q2;
  assign byte_o = data_q[7:0];

  always_ff @(posedge clk_i) begin
    scl_run_q  <= {scl_run_q[0], scl_sync};
    sda_run_q  <= {sda_run_q[0], sda_sync};
    if (scl_run_q == {2{scl_sync}}) scl_q <= scl_sync;
    if (sda_run_q == {2{sda_sync}}) sda_q <= sda_sync;
    scl_q2 <= scl_q;
    sda_q2 <= sda_q;

    valid_o      <= 1'b0;
    byte_valid_o <= 1'b0;
    left_q       <= ended ? quarter_q : left_q - 16'd1;

    if (ready_o) begin
      if (valid_i) begin
        ready_o     <= 1'b0;
        read_q      <= read_i;
        stream_q    <= stream_i;
        address_q   <= address_i;
        register_q  <= register_i;
        bytes_q     <= bytes_i;
        data_q      <= read_i ? '0 : data_i << {~bytes_i, 3'd0};
        quarter_q   <= quarter_i < 16'd4 ? 16'd3 : quarter_i - 16'd1;
        timeout_q   <= timeout_i;
        result_q    <= OK;
        work_q      <= FREE;
        phase_q     <= HIGH;
        left_q      <= quarter_i < 16'd4 ? 16'd3 : quarter_i - 16'd1;
        wait_q      <= timeout_i;
        moved_q     <= 1'b0;
        recover_q   <= 1'b0;
        recovered_q <= 1'b0;
        stage_q     <= SELECT;
        bit_q       <= '0;
        shift_q     <= {address_i, stream_i && read_i};
      end
    end else if (work_q == FREE) begin
      if (wait_q != '0) wait_q <= wait_q - TimeoutWidth'(1);
      moved_q <= moved;
      if (!scl_q || !sda_q) begin
        phase_q <= HIGH;
        left_q  <= quarter_q;
        if (wait_q == '0) begin
          if (moved || !scl_q || recovered_q) begin
            ready_o  <= 1'b1;
            valid_o  <= 1'b1;
            status_o <= moved ? ARBITRATION : BUS_STUCK;
            data_o   <= '0;
          end else begin
            work_q    <= BIT;
            phase_q   <= HOLD;
            recover_q <= 1'b1;
            scl_low_o <= 1'b1;
            if (recovery_count_o != '1) recovery_count_o <= recovery_count_o + CountWidth'(1);
          end
        end
      end else if (ended) begin
        phase_q <= phase_e'(phase_q + 3'd1);
        if (phase_q == LAST) begin
          work_q    <= START;
          phase_q   <= AFTER;
          sda_low_o <= 1'b1;
        end
      end
    end else begin
      unique case (phase_q)
        HOLD: begin
          if (ended) begin
            phase_q   <= SET_UP;
            sda_low_o <= work_q == STOP || (work_q == BIT && !value);
          end
        end

        SET_UP: begin
          seen_q <= 1'b0;
          wait_q <= timeout_q;
          if (ended) begin
            phase_q   <= RISE;
            scl_low_o <= 1'b0;
          end
        end

        RISE: begin
          if (!seen_q) begin
            seen_q <= scl_q;
            wait_q <= wait_q - TimeoutWidth'(1);
            left_q <= quarter_q;
            if (!scl_q && wait_q == '0) begin
              sda_low_o <= 1'b0;
              ready_o   <= 1'b1;
              valid_o   <= 1'b1;
              status_o  <= recover_q ? BUS_STUCK : STRETCH_TIMEOUT;
              data_o    <= '0;
            end
          end else if (work_q != BIT && !scl_q) begin
            sda_low_o <= 1'b0;
            ready_o   <= 1'b1;
            valid_o   <= 1'b1;
            status_o  <= recover_q ? BUS_STUCK : ARBITRATION;
            data_o    <= '0;
          end else if (ended || !scl_q) begin
            // SDA of the clock before: with SCL it may have gone on already.
            phase_q  <= HIGH;
            left_q   <= quarter_q;
            sample_q <= sda_q2;
            if (work_q == BIT && lost) begin
              ready_o  <= 1'b1;
              valid_o  <= 1'b1;
              status_o <= ARBITRATION;
              data_o   <= '0;
            end
          end
        end

        HIGH: begin
          if (work_q != BIT && !scl_q) begin
            sda_low_o <= 1'b0;
            ready_o   <= 1'b1;
            valid_o   <= 1'b1;
            status_o  <= recover_q ? BUS_STUCK : ARBITRATION;
            data_o    <= '0;
          end else if (ended || !scl_q) begin
            phase_q <= work_q == BIT ? HOLD : AFTER;
            left_q  <= quarter_q;
            if (work_q == START) begin
              sda_low_o <= sda_q;
              if (!sda_q) begin
                ready_o  <= 1'b1;
                valid_o  <= 1'b1;
                status_o <= ARBITRATION;
                data_o   <= '0;
              end
            end else if (work_q == STOP) begin
              sda_low_o <= 1'b0;
            end else begin
              scl_low_o <= 1'b1;
              bit_q     <= bit_q + 4'd1;
              shift_q   <= {shift_q[6:0], 1'b1};
              if (!ack && (stage_q == WRITE || stage_q == READ) && !recover_q) begin
                data_q       <= {data_q[30:0], sample_q};
                byte_valid_o <= stream_q && read_q && bit_q == ACK_BIT - 4'd1;
              end
              if (recover_q) begin
                if (sample_q) work_q <= STOP;
                else if (bit_q == LAST_CLOCK) begin
                  scl_low_o <= 1'b0;
                  ready_o   <= 1'b1;
                  valid_o   <= 1'b1;
                  status_o  <= BUS_STUCK;
                  data_o    <= '0;
                end
              end else if (ack) begin
                bit_q <= '0;
                if (sample_q && stage_q != READ) begin
                  work_q   <= STOP;
                  result_q <= stage_q == SELECT || stage_q == RESELECT ? NACK_ADDRESS : NACK_DATA;
                end else begin
                  if (stream_q) data_q[31:24] <= byte_i;
                  byte_valid_o <= stream_q && !read_q && !(stage_q == WRITE && last);
                  unique case (stage_q)
                    SELECT: begin
                      stage_q <= REGISTER;
                      if (stream_q) stage_q <= read_q ? READ : WRITE;
                      shift_q <= register_q;
                    end
                    REGISTER: begin
                      stage_q <= read_q ? RESELECT : WRITE;
                      shift_q <= {address_q, 1'b1};
                      if (read_q) work_q <= START;
                    end
                    RESELECT: stage_q <= READ;
                    default: begin  // WRITE, READ
                      bytes_q <= bytes_q - 2'd1;
                      if (last) work_q <= STOP;
                    end
                  endcase
                end
              end
            end
          end
        end

        AFTER: begin
          if (work_q == START && !scl_q) begin
            work_q    <= BIT;
            phase_q   <= HOLD;
            left_q    <= quarter_q;
            scl_low_o <= 1'b1;
          end else if (ended) begin
            phase_q <= LAST;
          end
        end

        default: begin  // LAST
          if (work_q == START) begin
            if (ended || !scl_q) begin
              work_q    <= BIT;
              phase_q   <= HOLD;
              left_q    <= quarter_q;
              scl_low_o <= 1'b1;
            end
          end else if (ended) begin
            if (!recover_q) begin
              ready_o  <= 1'b1;
              valid_o  <= 1'b1;
              status_o <= result_q;
              data_o   <= read_q && !stream_q && result_q == OK ? data_q : '0;
            end else if (sda_q) begin
              work_q      <= FREE;
              phase_q     <= HIGH;
              recover_q   <= 1'b0;
              recovered_q <= 1'b1;
              wait_q      <= '0;
              bit_q       <= '0;
              shift_q     <= {address_q, stream_q && read_q};
            end else if (bit_q >= LAST_CLOCK) begin
              ready_o  <= 1'b1;
              valid_o  <= 1'b1;
              status_o <= BUS_STUCK;
              data_o   <= '0;
            end else begin
              work_q    <= BIT;
              phase_q   <= HOLD;
              bit_q     <= bit_q + 4'd1;
              scl_low_o <= 1'b1;
            end
          end
        end
      endcase
    end

    if (rst_i) begin
      ready_o          <= 1'b1;
      valid_o          <= 1'b0;
      byte_valid_o     <= 1'b0;
      scl_low_o        <= 1'b0;
      sda_low_o        <= 1'b0;
      // Low until they are seen high: a line that was low all along has not fallen.
      scl_run_q        <= '0;
      sda_run_q        <= '0;
      scl_q            <= 1'b0;
      sda_q            <= 1'b0;
      scl_q2           <= 1'b0;
      sda_q2           <= 1'b0;
      recovery_count_o <= '0;
    end
  end

endmodule

`default_nettype wire
