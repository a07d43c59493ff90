// vrscan_pkg: the widths, formats and flag bits that all rooms agree on.
//
// scripts/generate.py writes every localparam and every struct into model/vrscan/data/pkg.py, so a
// number stands here and nowhere else.

`default_nettype none

package vrscan_pkg;
  // Numbers.  A count is a pixel value, a mean or a noise: full scale is 2**CountWidth whatever
  // the pixel width, so it has CountWidth - PixelWidth fraction bits.
  localparam int unsigned CountWidth = 24;
  localparam int unsigned VarianceWidth = 32;  // counts squared, full scale is 2**VarianceWidth
  localparam int unsigned SnrWidth = 16;
  localparam int unsigned SnrFraction = 8;
  localparam int unsigned PositionFraction = 12;  // px
  localparam int unsigned PositionWidth = 28;  // signed, of any line
  localparam int unsigned PlaceWidth = 16;  // a pixel's index, or how many, of any line
  localparam int unsigned LengthWidth = 24;
  localparam int unsigned LengthFraction = 12;  // mm
  localparam int unsigned AngleWidth = 24;  // one turn is 2**AngleWidth
  localparam int unsigned SigmaWidth = 16;
  localparam int unsigned SigmaFraction = 12;  // px or mm
  localparam int unsigned ConfidenceWidth = 8;
  localparam int unsigned PowerWidth = 16;
  localparam int unsigned LineNumberWidth = 32;
  localparam int unsigned FreeWidth = 16;  // an end of the free interval of z, unsigned
  localparam int unsigned FreeFraction = 4;  // mm

  // Configuration.
  localparam int unsigned KNoiseFraction = 8;
  localparam int unsigned KHeightFraction = 16;
  localparam int unsigned NoiseFloor = 5;  // sixteenths of a count, above a step's own sqrt(1/12)
  localparam int unsigned KappaWidth = 18;  // counts per electron, 28 - PixelWidth fraction bits
  localparam int unsigned GainWidth = 24;  // of the confidence in free space
  localparam int unsigned GainFraction = 16;

  // A line every 2 MaxWindow + MinPeriodOverhead clocks, with two passes every 3 MaxWindow +
  // TwoPassOverhead clocks, or LineLength where that is longer.
  localparam int unsigned MinPeriodOverhead = 510;
  localparam int unsigned TwoPassOverhead = 860;
  localparam int unsigned PointPeriod = 334;  // from point to point at least: triangulate is busy

  // Statistics.
  localparam int unsigned BlockLength = 64;
  localparam int unsigned PartLength = 16;  // of a block: the noise is that within its parts

  // Phase detection.  Pixels are left-aligned to AlignedWidth, so that every PixelWidth gives the
  // same widths behind the correlator.
  localparam int unsigned AlignedWidth = 16;
  localparam int unsigned WindowWidth = 8;  // bits of a window's length, at most 255
  localparam int unsigned SineWidth = 24;
  localparam int unsigned SineAmplitude = 8388353;  // quarter_wave's 1.0 at SineWidth
  localparam int unsigned PhaseWidth = 28;  // turns, of the table's input
  localparam int unsigned QuarterWaveLatency = 8;  // clocks
  localparam int unsigned HarmonicWidth = 48;  // AlignedWidth + SineWidth + WindowWidth
  localparam int unsigned MagnitudeWidth = 50;
  localparam int unsigned SumWidth = 24;  // aligned counts of a window above its pedestal
  localparam int unsigned WaveWidth = 30;  // the same times a cosine
  localparam int unsigned WaveFraction = 4;
  localparam int unsigned WaveCountWidth = 18;  // sum of cosines
  localparam int unsigned WaveCountFraction = 8;
  // sigma = T root SigmaGain / magnitude: 2**4 K SineAmplitude / (2 pi sqrt(2)), K the CORDIC's gain.
  localparam int unsigned SigmaGain = 24873230;
  // A harmonic below 2**NoPhaseShift / (K SineAmplitude) = 1.2e-6 of its sum is rounding.
  localparam int unsigned NoPhaseShift = 4;
  localparam int unsigned MinWindow = 3;  // a shorter window has no phase (T = N from N = 3)

  // Two passes.  The pixels around the run with the maximum stand in a ring, by the lower bits of
  // their index, until RingMargin pixels behind it: a second window, its gap and its blocks reach
  // 228 pixels beyond the run on either side, and a run has at most 255.
  localparam int unsigned RingWidth = 10;
  localparam int unsigned RingMargin = 256;
  localparam int unsigned SlopeLevelWidth = 27;  // of the background, aligned counts a px, signed
  localparam int unsigned RampWidth = 28;  // what is taken off a pixel, aligned counts, signed
  localparam int unsigned RampFraction = 12;  // of both

  localparam int unsigned SpotSigmaWidth = 17;  // of a spot, px, 9 fraction bits

  // The fit: a line every FitPeriod clocks.  It begins FitStart clocks after the first window
  // is known, when the second one and its quality are, whatever their widths.
  localparam int unsigned FitStart = 1480;
  localparam int unsigned FitPeriod = 2048;
  localparam int unsigned SpeckleDepth = 32;  // lines over which speckle is steadied
  localparam int unsigned ScaleWidth = 18;  // half of a spot's width at half of its height, px
  localparam int unsigned ScaleFraction = 12;
  localparam int unsigned NeighbourClks = 16384;  // lines further apart are no neighbours

  // A point's record is out LineLength + RecordClks clocks after its line's last pixel, whatever the
  // other parameters and the mode, and NeighbourClks later where it waits for the next line.
  localparam int unsigned RecordClks = 4864;

  // Geometry.
  localparam int unsigned OffsetFraction = 20;  // px
  localparam int unsigned DistortionWidth = 26;
  localparam int unsigned DistortionFraction = 24;
  localparam int unsigned SlopeWidth = 20;
  localparam int unsigned SlopeFraction = 16;
  localparam int unsigned GeometryWidth = 32;
  localparam int unsigned BaseFraction = 20;  // n0, n1: mm
  localparam int unsigned ToleranceWidth = 16;  // share of z that a point may err, for c_obj
  localparam int unsigned ToleranceFraction = 24;
  localparam int unsigned ObjectGainWidth = 21;  // of c_obj as a share of the S/N
  localparam int unsigned ObjectGainFraction = 20;
  localparam int unsigned RayFraction = 30;  // d0, d1, e0, e1
  localparam int unsigned MapWidth = 17;  // of a node of the correction map, px, signed
  localparam int unsigned MapWordWidth = 18;  // a node, and above it whether it was filled
  localparam int unsigned MapFraction = 10;
  localparam int unsigned MapNodes = 2145;  // 33 over the angle, 65 over the position
  localparam int unsigned MapCount = 9;  // positions of the lens that have a map
  localparam int unsigned MapCountWidth = 4;
  localparam int unsigned MapShiftWidth = 4;
  localparam int unsigned LensWidth = 16;  // position of the lens, steps

  // Mirror.  Phases of accumulators are fractions of a turn of the mirror.
  localparam int unsigned TurnWidth = 48;
  localparam int unsigned WordWidth = 40;  // frequency: turns a clock, TurnWidth fraction bits
  localparam int unsigned TrimWidth = 32;  // signed, added to a frequency word
  localparam int unsigned TimeWidth = 32;  // clocks
  localparam int unsigned SubWidth = 4;  // fraction bits of a crossing's time
  localparam int unsigned AgeWidth = 16;  // 2**-SubWidth clocks
  localparam int unsigned MinCrossing = 64;  // clocks: crossings closer than this are impossible
  localparam int unsigned LevelWidth = 20;  // of the drive, a voltage: full scale is 2**LevelWidth
  localparam int unsigned AmplitudeWidth = 26;  // of (12), unsigned
  localparam int unsigned AmplitudeFraction = 28;  // turns
  localparam int unsigned MidpointWidth = 28;  // turns, signed, all fraction
  localparam int unsigned ErrorWidth = 28;  // turns, signed, all fraction
  localparam int unsigned AmplitudeTableBits = 10;  // entry i: a half distance of i / 4096 turns
  localparam int unsigned MotionWidth = 24;  // a_k
  localparam int unsigned MotionFraction = 22;
  localparam int unsigned HarmonicCount = 9;  // of (12): k = 1, 3 .. 17
  localparam int unsigned SlopeMotionWidth = 24;  // of a_k and phi_k with the drive's phase, signed
  localparam int unsigned MotionSlopeFraction = 22;  // a turn
  localparam int unsigned PhiSlopeFraction = 16;  // turns a turn
  localparam int unsigned RatioWidth = 44;  // line rate over mirror frequency, unsigned
  localparam int unsigned RatioFraction = 32;
  localparam int unsigned LineClksWidth = 20;  // delays and lengths within a line, clocks
  localparam int unsigned ControlGainWidth = 18;
  localparam int unsigned ProportionalFraction = 16;
  localparam int unsigned IntegralFraction = 20;
  localparam int unsigned TrimStepWidth = 24;
  localparam int unsigned TrimGainFraction = 16;

  // States of the mirror, and why it is at fault.
  localparam int unsigned MirrorStateWidth = 3;
  localparam int unsigned MirrorOff = 0;
  localparam int unsigned MirrorSweep = 1;
  localparam int unsigned MirrorSettle = 2;
  localparam int unsigned MirrorRun = 3;
  localparam int unsigned MirrorFault = 4;
  localparam int unsigned FaultWidth = 2;
  localparam int unsigned FaultNone = 0;
  localparam int unsigned FaultSweep = 1;
  localparam int unsigned FaultSettle = 2;
  localparam int unsigned FaultIndex = 3;
  localparam int unsigned MirrorFlagWidth = 3;  // of a line: FlagNotRunning and those above it

  // Flags of a point, by bit.
  localparam int unsigned FlagWidth = 18;
  localparam int unsigned FlagLowSnr = 0;
  localparam int unsigned FlagTooNarrow = 1;
  localparam int unsigned FlagTooWide = 2;
  localparam int unsigned FlagAtEdge = 3;
  localparam int unsigned FlagSaturated = 4;
  localparam int unsigned FlagRival = 5;
  localparam int unsigned FlagNoPhase = 6;
  localparam int unsigned FlagNoNoise = 7;  // noise is zero: the S/N is its largest value
  localparam int unsigned FlagRowStatistics = 8;  // no background block was left
  localparam int unsigned FlagNoRange = 9;  // rays parallel, or the point behind the camera
  localparam int unsigned FlagOutOfRange = 10;  // x or z saturated
  localparam int unsigned FlagLinesLost = 11;  // lines before this one were dropped
  localparam int unsigned FlagPointsLost = 12;  // points before this one were dropped
  localparam int unsigned FlagNotRunning = 13;  // the mirror is not in its state RUN
  localparam int unsigned FlagIndexFault = 14;  // an index crossing was missing or wrong
  localparam int unsigned FlagUnsettled = 15;  // amplitude or phase is off: shock, drift, start-up
  localparam int unsigned FlagMixed = 16;  // not one spot on one surface
  localparam int unsigned FlagMapFilled = 17;  // corrected where calibration had no points

  // Clocks from valid_i to valid_o of what works operands off.
  function automatic int unsigned multiply_limbs(input int unsigned width);
    multiply_limbs = width <= 18 ? 1 : 1 + (width - 18 + 16) / 17;
  endfunction
  function automatic int unsigned multiply_latency(
      input int unsigned a_width, input int unsigned b_width);
    multiply_latency = multiply_limbs(a_width) * multiply_limbs(b_width) + 5;
  endfunction

  // What counts to the registers is 16 bits wide; tests let it stop earlier, to see that it does.
  localparam int unsigned CounterWidth = 16;
  function automatic logic [CounterWidth-1:0] counted(
      input logic [CounterWidth-1:0] count, input int unsigned bits);
    counted = count == CounterWidth'((1 << bits) - 1) ? count : count + CounterWidth'(1);
  endfunction

  // What belongs to a line, from its pulse to its point.
  typedef struct packed {
    logic signed [AngleWidth-1:0] angle;
    logic [PowerWidth-1:0] power;
    logic [MirrorFlagWidth-1:0] mirror_flags;
    logic [ConfidenceWidth-1:0] confidence;  // the mirror's
    logic inward;
    logic [TimeWidth-1:0] time_clks;  // of the pulse's centre
    logic [LensWidth-1:0] lens;  // position of the lens that was read last before it, steps
    logic test;  // a test line: it has angle and power, and nothing else
    logic superseded;  // its angle is of the configuration before the last commit
  } line_t;

  // A point.  Pixels are as wide as PixelWidth, in the lower bits of maximum.
  typedef struct packed {
    line_t line;
    logic [LineNumberWidth-1:0] number;
    logic [FlagWidth-1:0] flags;
    logic measured;
    logic [PlaceWidth-1:0] left;
    logic [PlaceWidth-1:0] right;
    logic [PlaceWidth-1:0] width;
    logic [AlignedWidth-1:0] maximum;
    logic [CountWidth-1:0] row_mean;
    logic [VarianceWidth-1:0] row_variance;
    logic [CountWidth-1:0] background;
    logic [CountWidth-1:0] noise;
    logic [SnrWidth-1:0] snr;
    logic signed [PositionWidth-1:0] position;
    logic [SigmaWidth-1:0] sigma;
    logic [SigmaWidth-1:0] doubt;  // what the neighbours add to sigma, in squares
    logic signed [LengthWidth-1:0] x;
    logic signed [LengthWidth-1:0] z;
    logic [SigmaWidth-1:0] sigma_z;
    logic [ConfidenceWidth-1:0] c_obj;
    logic [ConfidenceWidth-1:0] c_sfm;
    logic [FreeWidth-1:0] free_from;  // z between which the beam is free; both 0: nowhere
    logic [FreeWidth-1:0] free_to;
    logic configuration;  // changes with each commit
  } point_t;
endpackage

`default_nettype wire
