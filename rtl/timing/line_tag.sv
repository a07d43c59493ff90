// line_tag: angle, power, direction and time of the line that is being read out.
//
// The trigger's side writes a table by line number: what holds at the centre of a line's pulse, and
// the angle when it has been worked out.  The sensor's side reads it.  An angle may come after its
// readout has begun.
//
// A readout begins with line_start_i.  Its exposure is the one behind whose end readout_lag others
// have ended by then (in that clock at the latest), and which no readout before was of.  A lag of
// another size looks the same from line to line, so it is noticed where lines begin: behind
// enable_i's rise the first readout has to be that of the first exposure, and to begin
// readout_min_clks to readout_max_clks behind its end.  If it does not, or if readout_lag changes,
// no readout has an exposure until the next rise.  If it does, a readout or exposure that is lost
// later shifts nothing.
//
//   enable_i       the trigger is on: lines come behind its rise.  The last readout_lag lines before
//                  its fall are untagged, and not counted as mistimed
//   line_i         number of the line, with centre_i and in the exposure's first clock; a number
//                  does not come twice without a reset
//   exposure_i     high while the line is exposed; it ends in its first low clock
//   centre_i       middle of the pulse: power_i, inward_i and the time are sampled
//   power_i        once more in the first dark clock, if no other line's centre has come by then:
//                  a pulse that is cut behind its centre has no power
//   lens_i         sampled with centre_i, as it was read last before
//   angle_valid_i  angle_i, mirror_flags_i and confidence_i of the line angle_line_i, whose
//                  centre_i has come
//   superseding_i  the configuration of angles changes: the lines whose centre_i has come before its
//                  fall are superseded
//   readout_stale  as many readouts as readout_lag behind enable_i's rise are of no exposure
//   tag_o          holds until the next line_start_i, whatever comes meanwhile.  In the Latency
//                  before, and where there was no exposure, no centre or no angle, or where the
//                  readout is mistimed, it is that of an untagged line: all 0 but for
//                  mirror_flags, which is UNSETTLED alone.
//                  time_clks is that of centre_i since the reset, modulo 2**32
//   untagged_count_o  lines that were untagged in the clock of their line_end_i; stops at its
//                  largest value
//   unread_count_o  exposures without a readout behind which more than readout_lag others, before
//                   the first readout more than 4, have ended: it never comes; stops likewise
//   mistimed_count_o  readouts that began while exposures waited for theirs, but not as many as
//                   readout_lag says, or not in the window of time; stops likewise
//   Latency  5 clocks from line_start_i to tag_o, or 4 from angle_valid_i where that is later
//   Model    vrscan.clocked.line_tag, bit-exact

`default_nettype none

module line_tag #(
  parameter int unsigned Depth      = 8,  // lines from a centre to the end of its readout: 2**n
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                                           clk_i,
  input  wire logic                                           rst_i,

  // Trigger and mirror.
  input  wire logic                                           enable_i,
  input  wire logic                                           exposure_i,
  input  wire logic        [ vrscan_pkg::LineNumberWidth-1:0] line_i,
  input  wire logic                                           centre_i,
  input  wire logic        [      vrscan_pkg::PowerWidth-1:0] power_i,
  input  wire logic                                           inward_i,
  input  wire logic        [       vrscan_pkg::LensWidth-1:0] lens_i,
  input  wire logic                                           angle_valid_i,
  input  wire logic        [ vrscan_pkg::LineNumberWidth-1:0] angle_line_i,
  input  wire logic signed [      vrscan_pkg::AngleWidth-1:0] angle_i,
  input  wire logic        [ vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_i,
  input  wire logic        [ vrscan_pkg::ConfidenceWidth-1:0] confidence_i,
  input  wire logic                                           superseding_i,

  // Readout.
  input  wire logic                                           line_start_i,
  input  wire logic                                           line_end_i,
  output      vrscan_pkg::line_t                              tag_o,

  // Configuration.
  input  wire register_pkg::sensor_t                          sensor_i,

  // Status.
  output      logic        [                  CountWidth-1:0] untagged_count_o,
  output      logic        [                  CountWidth-1:0] unread_count_o,
  output      logic        [                  CountWidth-1:0] mistimed_count_o
);

  if (Depth < 8 || (Depth & (Depth - 1)) != 0) begin : gen_bad_depth
    $error("line_tag: Depth must be a power of two, at least 8");
  end

  localparam int unsigned LineWidth = vrscan_pkg::LineNumberWidth;
  localparam int unsigned IndexWidth = $clog2(Depth);
  localparam int unsigned TimeWidth = vrscan_pkg::TimeWidth;
  localparam int unsigned LagWidth = 2;
  localparam int unsigned MostLag = (1 << LagWidth) - 1;
  localparam int unsigned WaitWidth = LagWidth + 1;
  localparam int unsigned Judge = 4;  // clocks from line_start_i until its exposure's age is judged
  localparam logic [vrscan_pkg::MirrorFlagWidth-1:0] Unsettled =
      {1'b1, {(vrscan_pkg::MirrorFlagWidth - 1){1'b0}}};

  typedef struct packed {
    logic                             inward;
    logic [vrscan_pkg::LensWidth-1:0] lens;
    logic [vrscan_pkg::TimeWidth-1:0] time_clks;
  } centre_t;
  typedef struct packed {
    logic [     vrscan_pkg::AngleWidth-1:0] angle;
    logic [vrscan_pkg::MirrorFlagWidth-1:0] flags;
    logic [vrscan_pkg::ConfidenceWidth-1:0] confidence;
  } angle_t;

  // The table: a line's number is beside each half, as an older line's may still be there.
  localparam int unsigned CentreBits = LineWidth + 1 + vrscan_pkg::LensWidth
      + vrscan_pkg::TimeWidth;
  localparam int unsigned AngleBits = LineWidth + vrscan_pkg::AngleWidth
      + vrscan_pkg::MirrorFlagWidth + vrscan_pkg::ConfidenceWidth;
  logic [CentreBits-1:0] centre_mem [Depth];
  logic [ AngleBits-1:0] angle_mem [Depth];
  logic [vrscan_pkg::PowerWidth-1:0] powers_q [Depth];  // registers: two may be written at once
  logic [     Depth-1:0] centred_q, angled_q, superseded_q;
  logic                  superseded_q2, superseded_q3;

  // The exposure that is on, those that ended, the last one first, and the one that is read out.
  // An end is kept a clock later, when exposed_line_q is still its line's.
  logic                              exposure_q, ended, open_q, tagged_q;
  logic [             2:1]           start_q;
  logic [   LineWidth-1:0]           exposed_line_q, wanted_line_q, last_centre_q;
  logic [MostLag:0][LineWidth-1:0]   ended_line_q;
  logic [MostLag:0][TimeWidth-1:0]   ended_time_q;
  logic [MostLag+1:0][LineWidth-1:0] lines;  // the first: what ended a clock ago, if any
  logic [MostLag+1:0][TimeWidth-1:0] times;
  logic [              LagWidth:0]   wanted;
  assign ended  = exposure_q && !exposure_i;
  assign lines  = {ended_line_q, exposed_line_q};
  assign times  = {ended_time_q, clock_q};
  assign wanted = (LagWidth + 1)'(lag_q) + (LagWidth + 1)'(!ended_q);

  // Which exposure it is, by number and age.
  typedef enum logic [1:0] {FIRST, IN_STEP, LOST} state_e;
  state_e               state_q;
  logic                 enable_q, rise, ended_q, full, stale, due, wanted_q, timely_q;
  logic [    Judge:2]   due_q, wrong_q;  // of the readout that began so many clocks ago
  logic [ LagWidth-1:0] lag_q, stale_q;
  logic [WaitWidth-1:0] waiting_q, waiting, most;  // exposures that have not been read out
  logic [TimeWidth-1:0] wanted_time_q, age_q;
  assign rise    = enable_i && !enable_q;
  assign most    = state_q == IN_STEP ? WaitWidth'(lag_q) + WaitWidth'(1) : WaitWidth'(MostLag + 2);
  assign full    = waiting_q >= most;
  assign waiting = waiting_q + WaitWidth'(ended_q && !full);
  assign stale   = state_q == FIRST && stale_q != '0;
  assign due     = state_q != LOST && !stale && waiting == WaitWidth'(lag_q) + WaitWidth'(1);

  logic [vrscan_pkg::TimeWidth-1:0] clock_q;
  logic [           IndexWidth-1:0] index, centre_index, angle_index, exposed_index;
  assign index        = wanted_line_q[IndexWidth-1:0];
  assign centre_index = line_i[IndexWidth-1:0];
  assign angle_index  = angle_line_i[IndexWidth-1:0];
  assign exposed_index = exposed_line_q[IndexWidth-1:0];

  // What the table has, and a clock later whether it is of the line that is read out.  A power comes
  // into the table a clock later than the rest, and leaves it a clock sooner.
  logic                 cut_q, centre_come_q;
  logic [IndexWidth-1:0] cut_index_q, centre_index_q;
  logic                 centred_q2, angled_q2, centre_match_q, angle_match_q;
  logic [LineWidth-1:0] centre_line_q, angle_line_q;
  centre_t              centre_q, centre_q2;
  logic [vrscan_pkg::PowerWidth-1:0] power_come_q, power_q;
  angle_t               angle_q, angle_q2;

  always_ff @(posedge clk_i) begin
    clock_q <= clock_q + vrscan_pkg::TimeWidth'(1);

    cut_q          <= ended && last_centre_q == exposed_line_q;
    cut_index_q    <= exposed_index;
    centre_come_q  <= centre_i;
    centre_index_q <= centre_index;
    power_come_q   <= power_i;
    if (cut_q) powers_q[cut_index_q] <= power_come_q;
    if (centre_come_q) powers_q[centre_index_q] <= power_come_q;
    if (centre_i) begin
      last_centre_q            <= line_i;
      centre_mem[centre_index] <= {line_i, inward_i, lens_i, clock_q};
      centred_q[centre_index]  <= 1'b1;
      angled_q[centre_index]   <= 1'b0;  // which needs no reset: centred_q comes first
    end
    if (angle_valid_i) begin
      angle_mem[angle_index] <= {angle_line_i, unsigned'(angle_i), mirror_flags_i, confidence_i};
      angled_q[angle_index]  <= 1'b1;
    end

    if (centre_i) superseded_q[centre_index] <= 1'b0;
    if (superseding_i) superseded_q <= '1;

    exposure_q <= exposure_i;
    if (exposure_i && !exposure_q) exposed_line_q <= line_i;
    ended_q <= ended;
    if (ended_q) begin
      ended_line_q <= lines[MostLag:0];
      ended_time_q <= times[MostLag:0];
    end
    if (ended_q && full && unread_count_o != '1) begin
      unread_count_o <= unread_count_o + CountWidth'(1);
    end

    // A clock later: what ends in the clock of the readout's start is among those that have ended.
    start_q   <= {start_q[1], line_start_i};
    waiting_q <= waiting;
    if (start_q[1]) begin
      wanted_q      <= due;
      wanted_line_q <= lines[wanted];
      wanted_time_q <= times[wanted] + TimeWidth'(1);  // as late as clock_q will be
      if (stale) stale_q <= stale_q - LagWidth'(1);
      else if (waiting != '0 && (due || state_q != IN_STEP)) waiting_q <= waiting - WaitWidth'(1);
    end
    due_q   <= {due_q[Judge-1:2], start_q[1] && due};
    wrong_q <= {wrong_q[Judge-1:2], start_q[1] && !due && !stale && waiting != '0 && enable_i};

    // Its age, modulo 2**TimeWidth.
    if (start_q[2]) age_q <= clock_q - wanted_time_q;
    timely_q <= age_q >= TimeWidth'(sensor_i.readout_min_clks)
                && age_q <= TimeWidth'(sensor_i.readout_max_clks);
    if (due_q[Judge] && timely_q && state_q == FIRST) state_q <= IN_STEP;
    if (wrong_q[Judge] || (due_q[Judge] && !timely_q)) begin
      if (state_q == FIRST) state_q <= LOST;
      if (mistimed_count_o != '1) mistimed_count_o <= mistimed_count_o + CountWidth'(1);
    end
    enable_q <= enable_i;
    lag_q    <= sensor_i.readout_lag;
    if (lag_q != sensor_i.readout_lag) state_q <= LOST;
    if (rise) begin
      state_q   <= FIRST;
      waiting_q <= '0;
      stale_q   <= sensor_i.readout_stale ? sensor_i.readout_lag : '0;
      due_q     <= '0;
      wrong_q   <= '0;
    end

    {centre_line_q, centre_q} <= centre_mem[index];
    {angle_line_q, angle_q}   <= angle_mem[index];
    centred_q2     <= centred_q[index] && wanted_q;
    angled_q2      <= angled_q[index];
    centre_q2      <= centre_q;
    power_q        <= powers_q[index];
    superseded_q2  <= superseded_q[index];
    superseded_q3  <= superseded_q2;
    angle_q2       <= angle_q;
    centre_match_q <= centred_q2 && centre_line_q == wanted_line_q && start_q == '0
                      && !line_start_i;
    angle_match_q  <= angled_q2 && angle_line_q == wanted_line_q;

    // What has been tagged stays as it is: the table may go on to a later line.
    if (centre_match_q && angle_match_q && timely_q && !tagged_q) begin
      tagged_q           <= 1'b1;
      tag_o.angle        <= signed'(angle_q2.angle);
      tag_o.mirror_flags <= angle_q2.flags;
      tag_o.confidence   <= angle_q2.confidence;
      tag_o.power        <= power_q;
      tag_o.inward       <= centre_q2.inward;
      tag_o.lens         <= centre_q2.lens;
      tag_o.time_clks    <= centre_q2.time_clks;
      tag_o.superseded   <= superseded_q3;
    end
    open_q <= (open_q || line_start_i) && !line_end_i;
    if (line_end_i && (line_start_i || (open_q && !tagged_q)) && untagged_count_o != '1) begin
      untagged_count_o <= untagged_count_o + CountWidth'(1);
    end

    if (rst_i || line_start_i) begin
      tagged_q           <= 1'b0;
      tag_o              <= '0;
      tag_o.mirror_flags <= Unsettled;
    end
    if (rst_i) begin
      clock_q          <= '0;
      centred_q        <= '0;
      exposure_q       <= 1'b0;
      ended_q          <= 1'b0;
      enable_q         <= 1'b0;
      state_q          <= FIRST;
      waiting_q        <= '0;
      stale_q          <= '0;
      start_q          <= '0;
      due_q            <= '0;
      wrong_q          <= '0;
      wanted_q         <= 1'b0;
      centred_q2       <= 1'b0;
      centre_match_q   <= 1'b0;
      open_q           <= 1'b0;
      untagged_count_o <= '0;
      unread_count_o   <= '0;
      mistimed_count_o <= '0;
    end
  end

endmodule

`default_nettype wire
