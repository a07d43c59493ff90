// uart_link: the host's end of the serial line: frames in, commands executed, replies and the
// packets of streams out.
//
// The rate is the default's, Baud, until uart_step is written.  The new one holds when the reply to
// that write, and all else that was to go out, is on the line.  It holds for good with the first
// good frame, and until then no packet of a stream begins: nobody may be listening at that rate.
// Where none comes within TrialClks, and after a break, the default is back.  A break stops streams
// and capture, too.
//
// A 0x00 goes out before the next frame after a reset, a change of the rate, and a byte without its
// stop bit: the other end may have heard what was none.
//
//   rx_i                 asynchronous
//   packet_*_i           source k of Streams in bit k, byte k; whole packets of at most
//                        link_pkg::MaxPayload bytes
//   uart_step            bits a clock, 24 fraction bits
//   uart_step_now        the rate that holds
//   bus_*, stream_*, capture_*, alive_o, frames_*, commands_*  of command_server
//   uart_framing ..      bytes without a stop bit, breaks, glitches, rates that got no frame; stop at
//                        2**16 - 1
//   Model                vrscan.clocked.uart_link, bit-exact

`default_nettype none

module uart_link #(
  parameter int unsigned ClockHz   = 100_000_000,
  parameter int unsigned Baud      = 3_000_000,
  parameter int unsigned TrialClks = ClockHz,
  parameter int unsigned Streams   = 2,
  localparam int unsigned StepWidth = 24
) (
  input  wire logic                               clk_i,
  input  wire logic                               rst_i,

  input  wire logic                               rx_i,
  output      logic                               tx_o,

  input  wire logic [                Streams-1:0] packet_valid_i,
  output      logic [                Streams-1:0] packet_ready_o,
  input  wire logic [              8*Streams-1:0] packet_data_i,
  input  wire logic [                Streams-1:0] packet_last_i,

  output      logic                               bus_valid_o,
  output      logic [  link_pkg::AccessWidth-1:0] bus_access_o,
  output      logic [ link_pkg::AddressWidth-1:0] bus_address_o,
  output      logic [                       31:0] bus_data_o,
  input  wire logic                               bus_done_i,
  input  wire logic [  link_pkg::StatusWidth-1:0] bus_status_i,
  input  wire logic [                       31:0] bus_data_i,

  output      logic                               stream_start_o,
  output      logic                               stream_stop_o,
  output      logic [link_pkg::StreamFormatWidth-1:0] stream_format_o,
  output      logic [                        7:0] stream_step_o,

  output      logic                               capture_start_o,
  output      logic [link_pkg::CaptureModeWidth-1:0] capture_mode_o,
  output      logic [                       31:0] capture_argument_o,
  input  wire logic                               capture_busy_i,

  output      logic                               alive_o,

  input  wire register_pkg::link_t                link_i,
  output      register_pkg::link_status_t         link_status_o
);

  localparam int unsigned Sources = Streams + 1;
  localparam int unsigned TrialWidth = $clog2(TrialClks + 1);
  localparam int unsigned QuietWidth = 3;
  // To nearest.
  localparam logic [63:0] Scaled = (64'(Baud) << StepWidth) + 64'(ClockHz) / 64'd2;
  localparam logic [63:0] Step = Scaled / 64'(ClockHz);
  localparam logic [StepWidth-1:0] DefaultStep = Step[StepWidth-1:0];

  if (Step < 64'd1 || Step > 64'd1 << (StepWidth - 3)) begin : gen_bad_baud
    $error("uart_link: Baud must be at most ClockHz / 8");
  end
  if (TrialClks < 1) begin : gen_bad_trial_clks
    $error("uart_link: TrialClks must be at least 1");
  end

  logic [              StepWidth-1:0] step_now_q;
  logic [vrscan_pkg::CounterWidth-1:0] framing_q, breaks_q, glitches_q, fallbacks_q;
  assign link_status_o.uart_step_now  = step_now_q;
  assign link_status_o.uart_framing   = framing_q;
  assign link_status_o.uart_breaks    = breaks_q;
  assign link_status_o.uart_glitches  = glitches_q;
  assign link_status_o.uart_fallbacks = fallbacks_q;

  logic       heard, framing, broken, glitch;
  logic [7:0] heard_data;
  uart_rx u_uart_rx (
    .clk_i,
    .rst_i,
    .valid_o  (heard),
    .data_o   (heard_data),
    .framing_o(framing),
    .break_o  (broken),
    .glitch_o (glitch),
    .rx_i,
    .step_i   (step_now_q)
  );

  // A break ends the frame that it broke.
  logic       payload_valid, frame_done, frame_good;
  logic [7:0] payload_data;
  logic [frame_pkg::StatusWidth-1:0] frame_status;
  assign frame_good = frame_done && frame_status == frame_pkg::StatusOk;
  frame_decoder #(
    .MaxPayload(link_pkg::MaxPayload)
  ) u_frame_decoder (
    .clk_i,
    .rst_i,
    .valid_i (heard || broken),
    .data_i  (heard_data),
    .error_i (framing),
    .valid_o (payload_valid),
    .data_o  (payload_data),
    .done_o  (frame_done),
    .status_o(frame_status)
  );

  logic       reply_valid, reply_ready, reply_last, server_busy;
  logic [7:0] reply_data;
  command_server u_command_server (
    .clk_i,
    .rst_i,
    .valid_i (payload_valid),
    .data_i  (payload_data),
    .done_i  (frame_done),
    .status_i(frame_status),
    .halt_i  (broken),
    .valid_o (reply_valid),
    .ready_i (reply_ready),
    .data_o  (reply_data),
    .last_o  (reply_last),
    .bus_valid_o,
    .bus_access_o,
    .bus_address_o,
    .bus_data_o,
    .bus_done_i,
    .bus_status_i,
    .bus_data_i,
    .stream_start_o,
    .stream_stop_o,
    .stream_format_o,
    .stream_step_o,
    .capture_start_o,
    .capture_mode_o,
    .capture_argument_o,
    .capture_busy_i,
    .alive_o,
    .busy_o  (server_busy),
    .frames_good_o(link_status_o.frames_good),
    .frames_crc_o(link_status_o.frames_crc),
    .frames_malformed_o(link_status_o.frames_malformed),
    .frames_too_long_o(link_status_o.frames_too_long),
    .frames_too_short_o(link_status_o.frames_too_short),
    .frames_framing_o(link_status_o.frames_framing),
    .commands_bad_o(link_status_o.commands_bad),
    .commands_lost_o(link_status_o.commands_lost)
  );

  logic       wanted_q;  // another rate is,
  logic       trial_q;   // or has not been heard at yet
  logic       merged_valid, merged_ready, merged_last, arbiter_busy;
  logic [7:0] merged_data;
  packet_arbiter #(
    .Sources(Sources)
  ) u_packet_arbiter (
    .clk_i,
    .rst_i,
    .valid_i({packet_valid_i, reply_valid}),
    .ready_o({packet_ready_o, reply_ready}),
    .data_i ({packet_data_i, reply_data}),
    .last_i ({packet_last_i, reply_last}),
    .hold_i (wanted_q || trial_q),
    .valid_o(merged_valid),
    .ready_i(merged_ready),
    .data_o (merged_data),
    .last_o (merged_last),
    .busy_o (arbiter_busy)
  );

  logic       coded_valid, coded_ready;
  logic [7:0] coded_data;
  frame_encoder u_frame_encoder (
    .clk_i,
    .rst_i,
    .valid_i(merged_valid),
    .ready_o(merged_ready),
    .data_i (merged_data),
    .last_i (merged_last),
    .valid_o(coded_valid),
    .ready_i(coded_ready),
    .data_o (coded_data)
  );

  // A byte waits here, as the encoder's memory is slow.
  logic       held_valid_q;
  logic [7:0] held_q;
  assign coded_ready = !held_valid_q;

  logic       lead_q;      // a 0x00 is to go in front of the next frame,
  logic       boundary_q;  // which may begin here
  logic       lead, told, told_ready, transmitter_busy;
  assign lead = lead_q && boundary_q;
  assign told = held_valid_q && told_ready;
  uart_tx u_uart_tx (
    .clk_i,
    .rst_i,
    .valid_i(held_valid_q),
    .ready_o(told_ready),
    .data_i (lead ? 8'd0 : held_q),
    .tx_o,
    .step_i (step_now_q),
    .break_i(1'b0),
    .busy_o (transmitter_busy)
  );

  // What one unit has taken, the next shows a few clocks later.
  logic [QuietWidth-1:0] quiet_q;
  logic                  quiet, change, expire;
  logic [TrialWidth-1:0] trial_left_q;
  assign quiet = !server_busy && !arbiter_busy && !merged_valid && merged_ready && !coded_valid
      && !held_valid_q && !transmitter_busy;
  assign change = wanted_q && quiet && quiet_q == '1;
  assign expire = trial_q && trial_left_q == '0;

  always_ff @(posedge clk_i) begin
    if (!quiet) quiet_q <= '0;
    else if (quiet_q != '1) quiet_q <= quiet_q + QuietWidth'(1);

    if (!held_valid_q) held_q <= coded_data;
    held_valid_q <= held_valid_q ? !told_ready || lead : coded_valid;
    if (told) boundary_q <= lead || held_q == 8'd0;
    if (told && lead) lead_q <= 1'b0;
    if (framing) lead_q <= 1'b1;

    trial_left_q <= trial_left_q - TrialWidth'(1);
    if (frame_good) trial_q <= 1'b0;
    if (change) begin
      step_now_q   <= link_i.uart_step;
      wanted_q     <= 1'b0;
      trial_q      <= 1'b1;
      trial_left_q <= TrialWidth'(TrialClks - 1);
      lead_q       <= 1'b1;
    end else if (expire && !frame_good) begin
      step_now_q  <= DefaultStep;
      trial_q     <= 1'b0;
      lead_q      <= 1'b1;
      fallbacks_q <= vrscan_pkg::counted(fallbacks_q, vrscan_pkg::CounterWidth);
    end
    if (link_i.uart_step_strobe) wanted_q <= 1'b1;
    if (broken) begin
      step_now_q <= DefaultStep;
      wanted_q   <= 1'b0;
      trial_q    <= 1'b0;
    end

    if (framing && !broken) framing_q <= vrscan_pkg::counted(framing_q, vrscan_pkg::CounterWidth);
    if (broken) breaks_q <= vrscan_pkg::counted(breaks_q, vrscan_pkg::CounterWidth);
    if (glitch) glitches_q <= vrscan_pkg::counted(glitches_q, vrscan_pkg::CounterWidth);

    if (rst_i) begin
      step_now_q   <= DefaultStep;
      quiet_q      <= '0;
      held_valid_q <= 1'b0;
      wanted_q     <= 1'b0;
      trial_q      <= 1'b0;
      lead_q       <= 1'b1;
      boundary_q   <= 1'b1;
      framing_q    <= '0;
      breaks_q     <= '0;
      glitches_q   <= '0;
      fallbacks_q  <= '0;
    end
  end

endmodule

`default_nettype wire
