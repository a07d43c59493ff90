// link_pkg: the numbers of the serial protocol: commands, reply codes, streams and record sizes.
//
// scripts/generate.py writes every localparam into model/vrscan/data/link_pkg.py; docs/link.md
// says what they mean.

`default_nettype none

package link_pkg;
  // Payloads, bytes.  A reply of the most words is as long as the longest command.
  localparam int unsigned MaxPayload = 256;
  localparam int unsigned MaxWords = 62;  // of a READ or WRITE

  // The first byte of a command's payload; its reply has ReplyBit set as well.
  localparam int unsigned ReplyBit = 128;
  localparam int unsigned CommandPing = 1;
  localparam int unsigned CommandRead = 2;
  localparam int unsigned CommandWrite = 3;
  localparam int unsigned CommandStreamStart = 16;
  localparam int unsigned CommandStreamStop = 17;
  localparam int unsigned CommandCapture = 18;
  localparam int unsigned CommandNone = 127;  // of a reply to what was no command: a bad frame

  // What became of a command, and of an access to a register.
  localparam int unsigned StatusWidth = 4;
  localparam int unsigned StatusOk = 0;
  localparam int unsigned StatusUnknownCommand = 1;
  localparam int unsigned StatusBadLength = 2;
  localparam int unsigned StatusNoAddress = 3;
  localparam int unsigned StatusReadOnly = 4;
  localparam int unsigned StatusLocked = 5;
  localparam int unsigned StatusBadValue = 6;
  localparam int unsigned StatusBusy = 7;
  localparam int unsigned StatusBadFrame = 8;

  // The bus to the registers.  CHECK says what WRITE would, and changes nothing.
  localparam int unsigned AddressWidth = 16;  // of words of 32 bits
  localparam int unsigned AccessWidth = 2;
  localparam int unsigned AccessRead = 0;
  localparam int unsigned AccessCheck = 1;
  localparam int unsigned AccessWrite = 2;

  // The first byte of what comes unasked.
  localparam int unsigned StreamPointsCompact = 64;
  localparam int unsigned StreamPointsFull = 65;
  localparam int unsigned StreamPointsSpace = 66;
  localparam int unsigned StreamCapturePixels = 72;
  localparam int unsigned StreamCaptureRecord = 73;

  // Records of points, bytes.
  localparam int unsigned StreamFormatWidth = 2;
  localparam int unsigned FormatCompact = 0;
  localparam int unsigned FormatFull = 1;
  localparam int unsigned FormatSpace = 2;  // points and free beams
  localparam int unsigned CompactBytes = 8;
  localparam int unsigned SpaceBytes = 9;
  localparam int unsigned FullBytes = 64;
  localparam int unsigned BatchHeaderBytes = 10;

  // Flags of a compact record, by bit.
  localparam int unsigned CompactMeasured = 0;  // x and z hold
  localparam int unsigned CompactWeak = 1;  // LOW_SNR, TOO_NARROW, TOO_WIDE or NO_PHASE
  localparam int unsigned CompactAtEdge = 2;
  localparam int unsigned CompactSaturated = 3;
  localparam int unsigned CompactRival = 4;
  localparam int unsigned CompactRange = 5;  // NO_RANGE or OUT_OF_RANGE
  localparam int unsigned CompactMirror = 6;  // NOT_RUNNING, INDEX_FAULT or UNSETTLED
  localparam int unsigned CompactLost = 7;  // LINES_LOST or POINTS_LOST

  // Capture.
  localparam int unsigned CaptureModeWidth = 2;
  localparam int unsigned CaptureStop = 0;
  localparam int unsigned CaptureNext = 1;  // the next line
  localparam int unsigned CaptureLine = 2;  // the line of a number
  localparam int unsigned CaptureEvery = 3;  // every n-th, one at a time
  localparam int unsigned CaptureChunk = 100;  // pixels a frame
endpackage

`default_nettype wire
