// line_tag: angle, power, direction and time of the line that is being read out.
//
// The trigger's side writes a table by line number: what holds at the centre of a line's pulse, and
// the angle when it has been worked out.  The sensor's side reads it: a readout begins with
// line_start_i and belongs to the last exposure that had ended by then (in that clock at the
// latest), if no readout has begun since.  An angle may come after its readout has begun.
//
//   line_i         number of the line, with centre_i and in the exposure's first clock; a number
//                  does not come twice without a reset
//   exposure_i     high while the line is exposed; it ends in its first low clock
//   centre_i       middle of the pulse: power_i, inward_i and the time are sampled
//   power_i        once more in the first dark clock, if no other line's centre has come by then:
//                  a pulse that is cut behind its centre has no power
//   angle_valid_i  angle_i, mirror_flags_i and confidence_i of the line angle_line_i, whose
//                  centre_i has come
//   tag_o          holds until the next line_start_i, whatever comes meanwhile.  In the Latency
//                  before, and where there was no exposure, no centre or no angle, it is that of
//                  an untagged line: all 0 but for mirror_flags, which is UNSETTLED alone.
//                  time_clks is that of centre_i since the reset, modulo 2**32
//   untagged_count_o  lines that were untagged in the clock of their line_end_i; stops at its
//                  largest value
//   unread_count_o  exposures that another one followed, to its end, before their readout began: it
//                   never comes; stops at its largest value
//   Latency  4 clocks from line_start_i, or angle_valid_i where that is later, to tag_o
//   Model    vrscan.clocked.line_tag, bit-exact

`default_nettype none

module line_tag #(
  parameter int unsigned Depth      = 4,  // lines from a centre to the end of its readout: 2**n
  parameter int unsigned CountWidth = 16
) (
  input  wire logic                                           clk_i,
  input  wire logic                                           rst_i,

  // Trigger and mirror.
  input  wire logic                                           exposure_i,
  input  wire logic        [ vrscan_pkg::LineNumberWidth-1:0] line_i,
  input  wire logic                                           centre_i,
  input  wire logic        [      vrscan_pkg::PowerWidth-1:0] power_i,
  input  wire logic                                           inward_i,
  input  wire logic                                           angle_valid_i,
  input  wire logic        [ vrscan_pkg::LineNumberWidth-1:0] angle_line_i,
  input  wire logic signed [      vrscan_pkg::AngleWidth-1:0] angle_i,
  input  wire logic        [ vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_i,
  input  wire logic        [ vrscan_pkg::ConfidenceWidth-1:0] confidence_i,

  // Readout.
  input  wire logic                                           line_start_i,
  input  wire logic                                           line_end_i,
  output      vrscan_pkg::line_t                              tag_o,

  // Status.
  output      logic        [                  CountWidth-1:0] untagged_count_o,
  output      logic        [                  CountWidth-1:0] unread_count_o
);

  if (Depth < 2 || (Depth & (Depth - 1)) != 0) begin : gen_bad_depth
    $error("line_tag: Depth must be a power of two, at least 2");
  end

  localparam int unsigned LineWidth = vrscan_pkg::LineNumberWidth;
  localparam int unsigned IndexWidth = $clog2(Depth);
  localparam logic [vrscan_pkg::MirrorFlagWidth-1:0] Unsettled =
      {1'b1, {(vrscan_pkg::MirrorFlagWidth - 1){1'b0}}};

  typedef struct packed {
    logic                             inward;
    logic [vrscan_pkg::TimeWidth-1:0] time_clks;
  } centre_t;
  typedef struct packed {
    logic [     vrscan_pkg::AngleWidth-1:0] angle;
    logic [vrscan_pkg::MirrorFlagWidth-1:0] flags;
    logic [vrscan_pkg::ConfidenceWidth-1:0] confidence;
  } angle_t;

  // The table: a line's number is beside each half, as an older line's may still be there.
  localparam int unsigned CentreBits = LineWidth + 1 + vrscan_pkg::TimeWidth;
  localparam int unsigned AngleBits = LineWidth + vrscan_pkg::AngleWidth
      + vrscan_pkg::MirrorFlagWidth + vrscan_pkg::ConfidenceWidth;
  logic [CentreBits-1:0] centre_mem [Depth];
  logic [ AngleBits-1:0] angle_mem [Depth];
  logic [vrscan_pkg::PowerWidth-1:0] powers_q [Depth];  // registers: two may be written at once
  logic [     Depth-1:0] centred_q, angled_q;

  // The exposure that is on, the last one that ended, and the one that is being read out.
  logic                 exposure_q, ended, ended_q, wanted_q, start_q, open_q, tagged_q;
  logic [LineWidth-1:0] exposed_line_q, ended_line_q, wanted_line_q, last_centre_q;
  assign ended = exposure_q && !exposure_i;

  logic [vrscan_pkg::TimeWidth-1:0] clock_q;
  logic [           IndexWidth-1:0] index, centre_index, angle_index, exposed_index;
  assign index        = wanted_line_q[IndexWidth-1:0];
  assign centre_index = line_i[IndexWidth-1:0];
  assign angle_index  = angle_line_i[IndexWidth-1:0];
  assign exposed_index = exposed_line_q[IndexWidth-1:0];

  // What the table has, and a clock later whether it is of the line that is read out.
  logic                 centred_q2, angled_q2, centre_match_q, angle_match_q;
  logic [LineWidth-1:0] centre_line_q, angle_line_q;
  centre_t              centre_q, centre_q2;
  logic [vrscan_pkg::PowerWidth-1:0] power_q, power_q2;
  angle_t               angle_q, angle_q2;

  always_ff @(posedge clk_i) begin
    clock_q <= clock_q + vrscan_pkg::TimeWidth'(1);

    if (ended && last_centre_q == exposed_line_q) powers_q[exposed_index] <= power_i;
    if (centre_i) begin
      last_centre_q            <= line_i;
      powers_q[centre_index]   <= power_i;
      centre_mem[centre_index] <= {line_i, inward_i, clock_q};
      centred_q[centre_index]  <= 1'b1;
      angled_q[centre_index]   <= 1'b0;  // which needs no reset: centred_q comes first
    end
    if (angle_valid_i) begin
      angle_mem[angle_index] <= {angle_line_i, unsigned'(angle_i), mirror_flags_i, confidence_i};
      angled_q[angle_index]  <= 1'b1;
    end

    exposure_q <= exposure_i;
    if (exposure_i && !exposure_q) exposed_line_q <= line_i;
    if (ended) ended_line_q <= exposed_line_q;
    ended_q <= (ended_q || ended) && !line_start_i;
    if (ended && ended_q && unread_count_o != '1) begin
      unread_count_o <= unread_count_o + CountWidth'(1);
    end
    start_q <= line_start_i;
    if (line_start_i) begin
      wanted_q      <= ended_q || ended;
      wanted_line_q <= ended ? exposed_line_q : ended_line_q;
    end

    {centre_line_q, centre_q} <= centre_mem[index];
    {angle_line_q, angle_q}   <= angle_mem[index];
    centred_q2     <= centred_q[index] && wanted_q;
    angled_q2      <= angled_q[index];
    centre_q2      <= centre_q;
    power_q        <= powers_q[index];
    power_q2       <= power_q;
    angle_q2       <= angle_q;
    centre_match_q <= centred_q2 && centre_line_q == wanted_line_q && !start_q && !line_start_i;
    angle_match_q  <= angled_q2 && angle_line_q == wanted_line_q;

    // What has been tagged stays as it is: the table may go on to a later line.
    if (centre_match_q && angle_match_q && !tagged_q) begin
      tagged_q           <= 1'b1;
      tag_o.angle        <= signed'(angle_q2.angle);
      tag_o.mirror_flags <= angle_q2.flags;
      tag_o.confidence   <= angle_q2.confidence;
      tag_o.power        <= power_q2;
      tag_o.inward       <= centre_q2.inward;
      tag_o.time_clks    <= centre_q2.time_clks;
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
      wanted_q         <= 1'b0;
      centred_q2       <= 1'b0;
      centre_match_q   <= 1'b0;
      open_q           <= 1'b0;
      untagged_count_o <= '0;
      unread_count_o   <= '0;
    end
  end

endmodule

`default_nettype wire
