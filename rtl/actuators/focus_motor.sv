// focus_motor: the commands that bring the lens's motor to its target and keep it there.
//
// Registers 0 and 1 of the motor are its target, 2 and 3 its position, high byte first.
//
//   OFF    mode 0 or 3, from every state
//   WAIT   there is no target yet
//   MOVE   the target is written, then the position read until it is within focus_tolerance:
//          HOLD.  Where a read focus_timeout_clks after the write or later says it is not, the
//          target is written again
//   HOLD   the position is read on; where it is off by more than the tolerance: MOVE
//   FAULT  nothing is written or read; only OFF leaves it
//
// MOVE and HOLD write a new target, and go to WAIT where it is gone.  After a write comes a read, so
// the position is known while the target moves on.  A command that fails is given again,
// focus_retries times on end, and so is a target that is not reached; the next time is FAULT.  A
// command that runs when its state ends is waited for, but only its counter knows.
//
//   target_i, known_i  the target, and whether there is one
//   command_*_o      a read or write of two bytes, for i2c_master or m3_motor; what is beside the
//                    strobe stays
//   reply_*_i        the end of it; replies to nothing may not come
//   state_o          0 OFF, 1 WAIT, 2 MOVE, 3 HOLD, 4 FAULT
//   fault_o          why FAULT came: the status of the reply, or 6: not reached.  Kept until the
//                    next MOVE
//   position_o       the last one read; replies of m3_motor's statuses from 8 on have one, too
//   in_position_o    a clock after the others: HOLD, at the target of now
//   *_count_o        commands without an acknowledgement, stretched too long, on a stuck bus, of
//                    lost arbitration; targets not reached in time; replies that m3_motor cannot
//                    read or that tell of a fault.  Each stops at its largest value
//   Latency  reply_valid_i to position_o: 1 clock; to state_o, fault_o and timeout_count_o: 5
//            clocks; to the next command_valid_o: focus_poll_clks + 6
//   Model    vrscan.clocked.focus_motor, bit-exact

`default_nettype none

module focus_motor #(
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                                clk_i,
  input  wire logic                                rst_i,

  input  wire logic [                        15:0] target_i,
  input  wire logic                                known_i,

  // The bus.
  output      logic                                command_valid_o,
  output      logic                                command_read_o,
  output      logic [                         7:0] command_register_o,
  output      logic [                        15:0] command_data_o,
  input  wire logic                                reply_valid_i,
  input  wire logic [                         3:0] reply_status_i,
  input  wire logic [                        15:0] reply_data_i,

  // Configuration.
  input  wire register_pkg::focus_t                focus_i,

  // Status.
  output      logic [                         2:0] state_o,
  output      logic [                         3:0] fault_o,
  output      logic [                        15:0] position_o,
  output      logic                                in_position_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] nack_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] stretch_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] stuck_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] arbitration_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] timeout_count_o,
  output      logic [vrscan_pkg::CounterWidth-1:0] reply_count_o
);

  localparam logic [1:0] Manual = 2'd1;
  localparam logic [1:0] Automatic = 2'd2;
  // The statuses of i2c_master, one more reason of FAULT, and the statuses of m3_motor.
  localparam logic [3:0] Ok = 4'd0;
  localparam logic [3:0] NackAddress = 4'd1;
  localparam logic [3:0] NackData = 4'd2;
  localparam logic [3:0] StretchTimeout = 4'd3;
  localparam logic [3:0] BusStuck = 4'd4;
  localparam logic [3:0] Arbitration = 4'd5;
  localparam logic [3:0] NotReached = 4'd6;
  localparam logic [3:0] BadReply = 4'd7;
  localparam logic [3:0] MotorError = 4'd8;
  localparam logic [3:0] Limit = 4'd9;
  localparam logic [7:0] TargetRegister = 8'd0;
  localparam logic [7:0] PositionRegister = 8'd2;

  typedef enum logic [2:0] {OFF, WAIT, MOVE, HOLD, FAULT} state_e;  // as the register has them

  state_e             state_q;
  logic               on;
  logic               busy_q;  // a command runs, or its reply is looked at
  logic               abandoned_q;  // by its state
  logic               write_q;  // the target is to be written
  logic               changed_q;
  logic               near_q, expired_q;
  logic        [ 3:0] status_q;
  logic        [ 3:0] reply_q;  // a clock each, from that after the reply
  logic        [ 7:0] failures_q, misses_q;  // on end
  logic        [23:0] pause_q;
  logic        [31:0] left_q;
  logic signed [16:0] error_q;
  logic        [15:0] error_size_q;
  logic               end_of_command;
  logic               writes;  // the next command does
  assign state_o            = state_q;
  assign command_register_o = command_read_o ? PositionRegister : TargetRegister;
  assign on             = focus_i.focus_mode == Manual || focus_i.focus_mode == Automatic;
  assign end_of_command = reply_q[3];
  assign writes         = write_q || (changed_q && command_read_o);

  always_ff @(posedge clk_i) begin
    command_valid_o <= 1'b0;
    changed_q <= target_i != command_data_o;
    if (pause_q != '0) pause_q <= pause_q - 24'd1;
    if (left_q != '0) left_q <= left_q - 32'd1;
    expired_q <= left_q == '0;

    reply_q <= {reply_q[2:0], reply_valid_i};
    if (reply_valid_i) begin
      status_q <= reply_status_i;
      if (
        (reply_status_i == Ok || reply_status_i >= MotorError) && command_read_o && !abandoned_q
      ) position_o <= reply_data_i;
    end
    error_q      <= signed'({1'b0, position_o}) - signed'({1'b0, command_data_o});
    error_size_q <= 16'(error_q[16] ? '0 - error_q : error_q);
    near_q       <= error_size_q <= focus_i.focus_tolerance;

    if (end_of_command) begin
      busy_q      <= 1'b0;
      abandoned_q <= 1'b0;
      pause_q     <= focus_i.focus_poll_clks;
    end else if (busy_q && (state_q == OFF || state_q == WAIT)) begin
      abandoned_q <= 1'b1;
    end

    unique case (state_q)
      OFF: state_q <= WAIT;

      WAIT: begin
        write_q    <= 1'b1;
        failures_q <= '0;
        misses_q   <= '0;
        if (known_i) begin
          state_q <= MOVE;
          fault_o <= '0;
        end
      end

      MOVE, HOLD: begin
        if (!known_i) begin
          state_q <= WAIT;
        end else if (end_of_command && !abandoned_q) begin
          if (status_q != Ok) begin
            failures_q <= failures_q + 8'd1;
            if (failures_q == focus_i.focus_retries) begin
              state_q <= FAULT;
              fault_o <= status_q;
            end
          end else begin
            failures_q <= '0;
            if (!command_read_o) begin
              write_q <= 1'b0;
              left_q  <= focus_i.focus_timeout_clks;
            end else if (near_q) begin
              state_q  <= HOLD;
              misses_q <= '0;
            end else if (state_q == HOLD) begin
              state_q <= MOVE;
              write_q <= 1'b1;
            end else if (expired_q) begin
              write_q  <= 1'b1;
              misses_q <= misses_q + 8'd1;
              if (misses_q == focus_i.focus_retries) begin
                state_q <= FAULT;
                fault_o <= NotReached;
              end
              timeout_count_o <= vrscan_pkg::counted(timeout_count_o, CountWidth);
            end
          end
        end else if (!busy_q && pause_q == '0) begin
          command_valid_o <= 1'b1;
          busy_q          <= 1'b1;
          command_read_o  <= !writes;
          if (writes) begin
            state_q        <= MOVE;
            write_q        <= 1'b1;
            command_data_o <= target_i;
            if (changed_q) misses_q <= '0;
          end
        end
      end

      default: ;  // FAULT
    endcase
    if (!on) state_q <= OFF;
    in_position_o <= state_q == HOLD && target_i == command_data_o;

    if (reply_valid_i) begin
      unique case (reply_status_i)
        NackAddress, NackData: nack_count_o <= vrscan_pkg::counted(nack_count_o, CountWidth);
        StretchTimeout: stretch_count_o <= vrscan_pkg::counted(stretch_count_o, CountWidth);
        BusStuck: stuck_count_o <= vrscan_pkg::counted(stuck_count_o, CountWidth);
        Arbitration: arbitration_count_o <= vrscan_pkg::counted(arbitration_count_o, CountWidth);
        BadReply, MotorError, Limit: begin
          reply_count_o <= vrscan_pkg::counted(reply_count_o, CountWidth);
        end
        default: ;  // Ok
      endcase
    end

    if (rst_i) begin
      command_valid_o     <= 1'b0;
      busy_q              <= 1'b0;
      abandoned_q         <= 1'b0;
      reply_q             <= '0;
      pause_q             <= '0;
      command_data_o      <= '0;
      state_q             <= OFF;
      fault_o             <= '0;
      position_o          <= '0;
      in_position_o       <= 1'b0;
      nack_count_o        <= '0;
      stretch_count_o     <= '0;
      stuck_count_o       <= '0;
      arbitration_count_o <= '0;
      timeout_count_o     <= '0;
      reply_count_o       <= '0;
    end
  end

endmodule

`default_nettype wire
