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
//   angle_valid_i  angle_i, mirror_flags_i and confidence_i of the line angle_line_i, whose
//                  centre_i has come
//   angle_o ..     hold from Latency clocks after the later of line_start_i and angle_valid_i until
//                  the next line_start_i, whatever comes meanwhile.  Until then, and where there
//                  was no exposure, no centre or no angle, they are those of an untagged line: all
//                  0 but for mirror_flags_o, which is UNSETTLED alone
//   untagged_count_o  line_end_i of lines that were untagged in that clock; stops at its largest
//   time_o         of centre_i, in clocks since the reset, modulo 2**32
//   Latency  vrscan.fixed.line_tag.LATENCY clocks
//   Model    vrscan.fixed.line_tag, bit-exact

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
  output      logic signed [      vrscan_pkg::AngleWidth-1:0] angle_o,
  output      logic        [      vrscan_pkg::PowerWidth-1:0] power_o,
  output      logic        [ vrscan_pkg::MirrorFlagWidth-1:0] mirror_flags_o,
  output      logic        [ vrscan_pkg::ConfidenceWidth-1:0] confidence_o,
  output      logic                                           inward_o,
  output      logic        [       vrscan_pkg::TimeWidth-1:0] time_o,

  // Status.
  output      logic        [                  CountWidth-1:0] untagged_count_o
);

  if (Depth < 2 || (Depth & (Depth - 1)) != 0) begin : gen_bad_depth
    $error("line_tag: Depth must be a power of two, at least 2");
  end

endmodule

`default_nettype wire
