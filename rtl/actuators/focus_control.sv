// focus_control: keeps the lens where the scene is sharp, with a piezo motor and its position
// sensor on I2C: VR-SCAN IV-E.
//
// Distance.  Good points, those measured without a flag of range or mirror and not of a test line,
// are averaged: average += (z - average) / 2**s, to nearest, half up, with 16 more bits kept.  s
// is 0 for the first good point, 1 for two, 2 for four, up to focus_average_shift: the first
// points weigh about as much as each other.  From the first with the largest s on, distance_o
// follows.  A good point after more than focus_lapse others on end is a first one; the distance
// stands until it is followed again.  Points of test lines count nowhere.
//
// Position.  Of a table with 64 entries, linear between them, to nearest, half up: entry i is for
// a distance of focus_z_begin + i 2**(focus_z_shift + 10) steps; the first and the last hold
// beyond.  In mode AUTOMATIC the first position that comes is the target; later ones are when
// they have been more than focus_hysteresis from it for focus_hold good points on end (0 is as
// 1): it does not hunt.
//
// Motor.  Registers 0 and 1 of the device at focus_address are its target, 2 and 3 its
// position, high byte first.
//
//   OFF    mode 0 or 3, from every state
//   WAIT   there is no target yet
//   MOVE   the target is written, then the position read until it is within focus_tolerance:
//          HOLD.  Where a read focus_timeout_clks after the write or later says it is not, the
//          target is written again
//   HOLD   the position is read on; where it is off by more than the tolerance: MOVE
//   FAULT  nothing is written or read; only OFF leaves it
//
// MOVE and HOLD write a new target, and go to WAIT where it is gone.  A command that fails is given
// again, focus_retries times on end, and so is a target that is not reached; the next time is
// FAULT.  A command that runs when its state ends is waited for, but only its counter knows.
//
//   valid_i      a point; at least 26 clocks after the last one, or it is ignored
//   focus_mode         0 OFF, 1 MANUAL: focus_manual is the target, 2 AUTOMATIC
//   focus_state        0 OFF, 1 WAIT, 2 MOVE, 3 HOLD, 4 FAULT
//   focus_fault        why FAULT came: the status of i2c_master, or 6: not reached.  Kept until
//                      the next MOVE
//   focus_position     the last one read; positions are unsigned, in steps of the sensor
//   focus_in_position  a clock after the others: HOLD, at the target of now
//   focus_*_count      commands without an acknowledgement, stretched too long, on a stuck bus, of
//                      lost arbitration; targets not reached in time; begun recoveries of the
//                      bus.  Each stops at its largest value
//   focus_quarter_clks, focus_stretch_clks  i2c_master's quarter_i and timeout_i
//   Latency  valid_i to focus_distance: 8 clocks, to focus_target: 26 clocks, in which the
//            table and its registers must hold; focus_manual to it: 1 clock.  Of a command, the
//            position comes a clock after i2c_master's reply, state, fault and timeout_count 5
//            clocks after it, and the next command focus_poll_clks + 6
//   Model    vrscan.clocked.focus_control, bit-exact

`default_nettype none

module focus_control #(
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                                      clk_i,
  input  wire logic                                      rst_i,

  // Points.
  input  wire logic                                      valid_i,
  input  wire vrscan_pkg::point_t                        point_i,

  // Pins, asynchronous; 1 pulls the line low.
  input  wire logic                                      focus_scl_i,
  input  wire logic                                      focus_sda_i,
  output      logic                                      focus_scl_low_o,
  output      logic                                      focus_sda_low_o,

  // The table.
  input  wire register_pkg::focus_table_t                focus_table_i,

  // Configuration.
  input  wire register_pkg::focus_t                      focus_i,

  // Status.
  output      register_pkg::focus_status_t               focus_status_o
);

  localparam int unsigned LengthWidth = vrscan_pkg::LengthWidth;
  localparam int unsigned FineWidth = 16;  // bits of the average below those of z
  localparam int unsigned AverageWidth = LengthWidth + FineWidth;
  localparam int unsigned DeltaWidth = AverageWidth + 1;
  localparam int unsigned MaxShift = 15;
  localparam int unsigned TableBits = 6;
  localparam int unsigned FractionWidth = 10;
  localparam int unsigned PositionWidth = 16;
  localparam int unsigned ShareWidth = FractionWidth + 1;
  localparam int unsigned DifferenceWidth = PositionWidth + 1;
  localparam int unsigned ProductWidth = DifferenceWidth + ShareWidth;
  localparam logic [TableBits-1:0] LastEntry = '1;

  localparam logic [vrscan_pkg::FlagWidth-1:0] BadFlags =
      vrscan_pkg::FlagWidth'(1 << vrscan_pkg::FlagNoRange | 1 << vrscan_pkg::FlagOutOfRange |
                             1 << vrscan_pkg::FlagNotRunning | 1 << vrscan_pkg::FlagIndexFault |
                             1 << vrscan_pkg::FlagUnsettled);

  localparam logic [1:0] Manual = 2'd1;
  localparam logic [1:0] Automatic = 2'd2;
  localparam logic [2:0] Off = 3'd0;
  localparam logic [2:0] Wait = 3'd1;
  localparam logic [2:0] Move = 3'd2;
  localparam logic [2:0] Hold = 3'd3;
  localparam logic [2:0] Fault = 3'd4;
  localparam logic [2:0] NotReached = 3'd6;

  // ---- what the status says ----
  localparam int unsigned CounterWidth = vrscan_pkg::CounterWidth;
  logic        [              2:0] state_q, fault_q;
  logic                            in_position_q;
  logic signed [  LengthWidth-1:0] distance_q;
  logic        [PositionWidth-1:0] target_q, read_position_q;
  logic        [ CounterWidth-1:0] nack_count_q, stretch_count_q, stuck_count_q;
  logic        [ CounterWidth-1:0] arbitration_count_q, timeout_count_q;
  logic        [   CountWidth-1:0] recovery_count;
  assign focus_status_o.focus_state             = state_q;
  assign focus_status_o.focus_fault             = fault_q;
  assign focus_status_o.focus_in_position       = in_position_q;
  assign focus_status_o.focus_distance          = distance_q;
  assign focus_status_o.focus_target            = target_q;
  assign focus_status_o.focus_position          = read_position_q;
  assign focus_status_o.focus_nack_count        = nack_count_q;
  assign focus_status_o.focus_stretch_count     = stretch_count_q;
  assign focus_status_o.focus_stuck_count       = stuck_count_q;
  assign focus_status_o.focus_arbitration_count = arbitration_count_q;
  assign focus_status_o.focus_timeout_count     = timeout_count_q;
  assign focus_status_o.focus_recovery_count    = CounterWidth'(recovery_count);

  // ---- distance ----
  // The clocks since valid_i; 0 is idle.  What stands below in the order of its ages is
  // free-running: its operands hold long enough.
  localparam int unsigned AgeWidth = 5;
  localparam logic [AgeWidth-1:0] Begin = AgeWidth'(1);
  localparam logic [AgeWidth-1:0] Average = AgeWidth'(6);
  localparam logic [AgeWidth-1:0] Distance = AgeWidth'(7);
  localparam logic [AgeWidth-1:0] Index = AgeWidth'(11);
  localparam logic [AgeWidth-1:0] Base = AgeWidth'(13);
  localparam logic [AgeWidth-1:0] Multiply = AgeWidth'(15);
  localparam int unsigned Product = vrscan_pkg::multiply_latency(DifferenceWidth, ShareWidth);
  localparam logic [AgeWidth-1:0] Candidate = AgeWidth'(15 + Product);
  localparam logic [AgeWidth-1:0] Decide = AgeWidth'(19 + Product);
  logic [AgeWidth-1:0] age_q;
  logic                take, good;
  assign take = valid_i && !point_i.line.test && age_q == '0;
  assign good = point_i.measured && (point_i.flags & BadFlags) == '0;

  logic        [            15:0] others_q;
  logic signed [ LengthWidth-1:0] z_q;
  logic        [             3:0] level_q, shift_q;  // log2 of the good points; s
  logic        [    MaxShift-1:0] count_q;  // of them at this level
  logic                           enough_q;
  logic signed [AverageWidth-1:0] average_q;
  logic signed [  DeltaWidth-1:0] delta_q;
  // A bit more, to round with.
  logic signed [    DeltaWidth:0] coarse_q, fine_q;
  logic signed [  DeltaWidth-1:0] part_q;

  always_ff @(posedge clk_i) begin
    if (take && good) age_q <= Begin;
    else if (age_q == Decide || (age_q == Distance && !enough_q)) age_q <= '0;
    else if (age_q != '0) age_q <= age_q + AgeWidth'(1);

    if (take && good) z_q <= point_i.z;
    if (take && !good && others_q != '1) others_q <= others_q + 16'd1;
    if (age_q == Begin) begin
      others_q <= '0;
      if (others_q > focus_i.focus_lapse) begin
        level_q <= '0;
        count_q <= '0;
      end
    end

    delta_q  <= (DeltaWidth'(z_q) <<< FineWidth) - DeltaWidth'(average_q);
    enough_q <= level_q >= focus_i.focus_average_shift;
    shift_q  <= level_q >= focus_i.focus_average_shift ? focus_i.focus_average_shift : level_q;
    coarse_q <= signed'({delta_q, 1'b0}) >>> {shift_q[3:2], 2'b00};
    fine_q   <= coarse_q >>> shift_q[1:0];
    part_q   <= signed'(fine_q[DeltaWidth:1]) + DeltaWidth'(signed'({1'b0, fine_q[0]}));
    if (age_q == Average) begin
      // It stays between the average and z.
      average_q <= AverageWidth'(DeltaWidth'(average_q) + part_q);
      if (!enough_q) begin
        count_q <= count_q + MaxShift'(1);
        if (count_q == ~({MaxShift{1'b1}} << level_q)) begin
          level_q <= level_q + 4'd1;
          count_q <= '0;
        end
      end
    end
    if (age_q == Distance && enough_q) begin
      distance_q <= average_q[FineWidth+:LengthWidth]
                          + LengthWidth'(average_q[FineWidth-1]);
    end

    if (rst_i) begin
      age_q            <= '0;
      others_q         <= '0;
      level_q          <= '0;
      count_q          <= '0;
      average_q        <= '0;
      distance_q <= '0;
    end
  end

  // ---- position ----
  logic        [  PositionWidth-1:0] table_mem [1 << TableBits];
  logic        [  PositionWidth-1:0] entry_q, base_q, candidate_q;
  logic        [      TableBits-1:0] index_q;
  logic        [  FractionWidth-1:0] fraction_q;
  logic signed [      LengthWidth:0] beyond_q;  // the first entry
  logic        [    LengthWidth-1:0] steps_q, entries_q;
  logic                              last;
  logic signed [DifferenceWidth-1:0] difference_q, off_q;
  logic signed [   ProductWidth-1:0] product;
  logic        [  PositionWidth-1:0] off_size_q;
  assign last = entries_q[LengthWidth-1:FractionWidth] >=
                (LengthWidth - FractionWidth)'(LastEntry);

  multiply #(
    .AWidth(DifferenceWidth),
    .BWidth(ShareWidth)
  ) u_multiply (
    .clk_i,
    .rst_i,
    .valid_i  (age_q == Multiply),
    .a_i      (difference_q),
    .b_i      (signed'({1'b0, fraction_q})),
    .valid_o  (),
    .product_o(product)
  );

  logic        far_q, held_q, known;
  logic        manual_q, taken_q;  // the target is the host's; is one of the table
  logic [15:0] far_count_q;
  assign known = manual_q || taken_q;

  always_ff @(posedge clk_i) begin
    if (focus_table_i.focus_table_write) begin
      table_mem[focus_table_i.focus_table_index] <= focus_table_i.focus_table_position;
    end
    entry_q <= table_mem[index_q];

    beyond_q  <= (LengthWidth + 1)'(distance_q) - (LengthWidth + 1)'(focus_i.focus_z_begin);
    steps_q   <= (beyond_q[LengthWidth] ? '0 : beyond_q[LengthWidth-1:0])
                 >> {focus_i.focus_z_shift[3:2], 2'b00};
    entries_q <= steps_q >> focus_i.focus_z_shift[1:0];
    index_q   <= index_q + TableBits'(1);
    if (age_q == Index) begin
      index_q    <= last ? LastEntry : entries_q[FractionWidth+:TableBits];
      fraction_q <= last ? '0 : entries_q[FractionWidth-1:0];
    end
    if (age_q == Base) base_q <= entry_q;
    difference_q <= signed'({1'b0, entry_q}) - signed'({1'b0, base_q});
    if (age_q == Candidate) begin
      candidate_q <= base_q + PositionWidth'(unsigned'(product) >> FractionWidth)
                     + PositionWidth'(product[FractionWidth-1]);
    end

    off_q      <= signed'({1'b0, candidate_q}) - signed'({1'b0, target_q});
    off_size_q <= PositionWidth'(off_q[DifferenceWidth-1] ? '0 - off_q : off_q);
    far_q      <= off_size_q > focus_i.focus_hysteresis;
    held_q     <= {1'b0, far_count_q} + 17'd1 >= {1'b0, focus_i.focus_hold};

    manual_q <= focus_i.focus_mode == Manual;
    if (age_q == Begin && others_q > focus_i.focus_lapse) far_count_q <= '0;
    if (focus_i.focus_mode == Manual) target_q <= focus_i.focus_manual;
    if (focus_i.focus_mode != Automatic) begin
      taken_q     <= 1'b0;
      far_count_q <= '0;
    end else if (age_q == Decide) begin
      far_count_q <= far_q ? far_count_q + 16'd1 : '0;
      if (!taken_q || (far_q && held_q)) begin
        target_q <= candidate_q;
        taken_q        <= 1'b1;
        far_count_q    <= '0;
      end
    end

    if (rst_i) begin
      manual_q       <= 1'b0;
      taken_q        <= 1'b0;
      far_count_q    <= '0;
      target_q <= '0;
    end
  end

  // ---- motor ----
  localparam logic [2:0] Ok = 3'd0;
  localparam logic [2:0] NackAddress = 3'd1;
  localparam logic [2:0] NackData = 3'd2;
  localparam logic [2:0] StretchTimeout = 3'd3;
  localparam logic [2:0] BusStuck = 3'd4;
  localparam logic [2:0] Arbitration = 3'd5;
  localparam logic [7:0] TargetRegister = 8'd0;
  localparam logic [7:0] PositionRegister = 8'd2;

  logic        start_q, read_q, replied;
  logic [ 2:0] status, status_q;
  logic [31:0] data;
  logic        unused_data;
  logic [15:0] written_q;
  assign unused_data = ^data[31:16];
  i2c_master #(
    .CountWidth(CountWidth)
  ) u_i2c_master (
    .clk_i,
    .rst_i,
    .valid_i         (start_q),
    .ready_o         (),  // only this module gives commands
    .read_i          (read_q),
    .address_i       (focus_i.focus_address),
    .register_i      (read_q ? PositionRegister : TargetRegister),
    .bytes_i         (2'd1),
    .data_i          ({16'd0, written_q}),
    .valid_o         (replied),
    .status_o        (status),
    .data_o          (data),
    .scl_i           (focus_scl_i),
    .sda_i           (focus_sda_i),
    .scl_low_o       (focus_scl_low_o),
    .sda_low_o       (focus_sda_low_o),
    .quarter_i       (focus_i.focus_quarter_clks),
    .timeout_i       (focus_i.focus_stretch_clks),
    .recovery_count_o(recovery_count)
  );

  logic                              on;
  logic                              busy_q;  // a command runs, or its reply is looked at
  logic                              abandoned_q;  // by its state
  logic                              write_q;  // the target is to be written
  logic                              changed_q;
  logic                              near_q, expired_q;
  logic        [                3:0] reply_q;  // a clock each, from that after the reply
  logic        [                7:0] failures_q, misses_q;  // on end
  logic        [               23:0] pause_q;
  logic        [               31:0] left_q;
  logic signed [DifferenceWidth-1:0] error_q;
  logic        [  PositionWidth-1:0] error_size_q;
  logic                              end_of_command;
  assign on             = focus_i.focus_mode == Manual || focus_i.focus_mode == Automatic;
  assign end_of_command = reply_q[3];

  always_ff @(posedge clk_i) begin
    start_q   <= 1'b0;
    changed_q <= target_q != written_q;
    if (pause_q != '0) pause_q <= pause_q - 24'd1;
    if (left_q != '0) left_q <= left_q - 32'd1;
    expired_q <= left_q == '0;

    reply_q <= {reply_q[2:0], replied};
    if (replied) begin
      status_q <= status;
      if (status == Ok && read_q && !abandoned_q) read_position_q <= data[15:0];
    end
    error_q      <= signed'({1'b0, read_position_q}) - signed'({1'b0, written_q});
    error_size_q <= PositionWidth'(error_q[DifferenceWidth-1] ? '0 - error_q : error_q);
    near_q       <= error_size_q <= focus_i.focus_tolerance;

    if (end_of_command) begin
      busy_q      <= 1'b0;
      abandoned_q <= 1'b0;
      pause_q     <= focus_i.focus_poll_clks;
    end else if (busy_q && (state_q == Off || state_q == Wait)) begin
      abandoned_q <= 1'b1;
    end

    unique case (state_q)
      Off: state_q <= Wait;

      Wait: begin
        write_q    <= 1'b1;
        failures_q <= '0;
        misses_q   <= '0;
        if (known) begin
          state_q <= Move;
          fault_q <= '0;
        end
      end

      Move, Hold: begin
        if (!known) begin
          state_q <= Wait;
        end else if (end_of_command && !abandoned_q) begin
          if (status_q != Ok) begin
            failures_q <= failures_q + 8'd1;
            if (failures_q == focus_i.focus_retries) begin
              state_q <= Fault;
              fault_q <= status_q;
            end
          end else begin
            failures_q <= '0;
            if (!read_q) begin
              write_q <= 1'b0;
              left_q  <= focus_i.focus_timeout_clks;
            end else if (near_q) begin
              state_q <= Hold;
              misses_q      <= '0;
            end else if (state_q == Hold) begin
              state_q <= Move;
              write_q       <= 1'b1;
            end else if (expired_q) begin
              write_q  <= 1'b1;
              misses_q <= misses_q + 8'd1;
              if (misses_q == focus_i.focus_retries) begin
                state_q <= Fault;
                fault_q <= NotReached;
              end
              timeout_count_q <= vrscan_pkg::counted(timeout_count_q, CountWidth);
            end
          end
        end else if (!busy_q && pause_q == '0) begin
          start_q <= 1'b1;
          busy_q  <= 1'b1;
          read_q  <= !(changed_q || write_q);
          if (changed_q || write_q) begin
            state_q   <= Move;
            write_q   <= 1'b1;
            written_q <= target_q;
          end
          if (changed_q) misses_q <= '0;
        end
      end

      default: ;  // FAULT
    endcase
    if (!on) state_q <= Off;
    in_position_q <= state_q == Hold && target_q == written_q;

    if (replied) begin
      if (status == NackAddress || status == NackData) begin
        nack_count_q <= vrscan_pkg::counted(nack_count_q, CountWidth);
      end
      if (status == StretchTimeout) begin
        stretch_count_q <= vrscan_pkg::counted(stretch_count_q, CountWidth);
      end
      if (status == BusStuck) begin
        stuck_count_q <= vrscan_pkg::counted(stuck_count_q, CountWidth);
      end
      if (status == Arbitration) begin
        arbitration_count_q <= vrscan_pkg::counted(arbitration_count_q, CountWidth);
      end
    end

    if (rst_i) begin
      start_q             <= 1'b0;
      busy_q              <= 1'b0;
      abandoned_q         <= 1'b0;
      reply_q             <= '0;
      pause_q             <= '0;
      written_q           <= '0;
      state_q             <= Off;
      fault_q             <= '0;
      read_position_q     <= '0;
      in_position_q       <= 1'b0;
      nack_count_q        <= '0;
      stretch_count_q     <= '0;
      stuck_count_q       <= '0;
      arbitration_count_q <= '0;
      timeout_count_q     <= '0;
    end
  end

endmodule

`default_nettype wire
