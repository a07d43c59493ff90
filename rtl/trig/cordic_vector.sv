// cordic_vector: angle and magnitude of a vector by CORDIC rotations, for any amplitude.
//
// The vector is folded into the first quadrant and shifted left until its longer side fills the
// width, so that a small vector keeps its precision.  A rotation by atan(2**-i) takes two clocks.
// The side doubles with every rotation: it loses no bit, and only one shifter is needed,
//
//   along = along + |side| / 4**i,  side = 2 (side -+ along).
//
// At the end the magnitude is shifted back.
//
//   angle_o      atan2(y_i, x_i) as an unsigned fraction of a turn, to nearest; the error is at
//                most 0.62 steps, 0.33 rms, whatever the amplitude (angle_bounds of the model)
//   magnitude_o  K sqrt(x_i**2 + y_i**2), K = 1.6467602581, to nearest; the error is at most
//                0.5 + 1.7e-8 of it at AngleWidth 24 (magnitude_bound of the model).
//                Example: x_i = 30000, y_i = 40000 gives 82338
//   zero_o       x_i and y_i are 0: so are angle_o and magnitude_o
//   Latency      2 (AngleWidth + 2) + 2 floor((XyWidth - 1) / 8) + 18 clocks, 80 as shipped,
//                whatever the operands; a valid_i meanwhile starts anew
//   Model        vrscan.fixed.cordic_vector, bit-exact

`default_nettype none

module cordic_vector #(
  parameter int unsigned XyWidth    = 48,  // 9 to 60
  parameter int unsigned AngleWidth = 24   // 8 to 28
) (
  input  wire logic                      clk_i,
  input  wire logic                      rst_i,  // clears valid and the state only

  input  wire logic                      valid_i,
  input  wire logic signed [XyWidth-1:0] x_i,
  input  wire logic signed [XyWidth-1:0] y_i,

  output      logic                      valid_o,
  output      logic     [AngleWidth-1:0] angle_o,
  output      logic        [XyWidth+1:0] magnitude_o,
  output      logic                      zero_o
);

  if (XyWidth < 9 || XyWidth > 60) begin : gen_bad_xy_width
    $error("cordic_vector: XyWidth must be 9 to 60");
  end
  if (AngleWidth < 8 || AngleWidth > 28) begin : gen_bad_angle_width
    $error("cordic_vector: AngleWidth must be 8 to 28");
  end

  localparam int unsigned Iterations = AngleWidth + 2;
  localparam int unsigned AngleGuard = 10;
  localparam int unsigned SumWidth = AngleWidth + AngleGuard;
  localparam int unsigned NormWidth = AngleWidth + 7;
  localparam int unsigned WideWidth = XyWidth > NormWidth ? XyWidth : NormWidth;
  localparam int unsigned Padding = WideWidth - XyWidth;
  // A normalised vector is shorter than sqrt(2) * 2**NormWidth, times K: below 4 * 2**NormWidth.
  // Before rotation i the side is at most 2**(1 - i) of that length, times 2**i.
  localparam int unsigned AlongWidth = NormWidth + 2;
  localparam int unsigned SideWidth = NormWidth + 4;
  localparam int unsigned ScaledWidth = WideWidth + 3;  // the magnitude and half a step

  // Coarse steps of 8 bits leave 7 fine steps of one bit.
  localparam int unsigned CoarseSteps = (XyWidth - 1) / 8;
  localparam int unsigned FineSteps = 7;

  typedef enum logic [3:0] {
    IDLE,
    COARSE,   // normalise by 8 bits
    FINE,     // normalise by one bit
    LOAD,
    SHIFT,    // form the side's part
    ROTATE,
    SCALE,
    UNFINE,   // undo the fine steps
    UNCOARSE,
    DONE
  } state_e;

  state_e     state_q;
  logic [4:0] step_q;  // of the state, or the rotation's index

  always_ff @(posedge clk_i) begin
    step_q <= step_q + 5'd1;
    unique case (state_q)
      COARSE: begin
        if (step_q == 5'(CoarseSteps - 1)) begin
          state_q <= FINE;
          step_q  <= '0;
        end
      end
      FINE:   if (step_q == 5'(FineSteps - 1)) state_q <= LOAD;
      LOAD: begin
        state_q <= SHIFT;
        step_q  <= '0;
      end
      SHIFT: begin
        state_q <= ROTATE;
        step_q  <= step_q;
      end
      ROTATE: state_q <= step_q == 5'(Iterations - 1) ? SCALE : SHIFT;
      SCALE: begin
        state_q <= UNFINE;
        step_q  <= '0;
      end
      UNFINE: begin
        if (step_q == 5'(FineSteps - 1)) begin
          state_q <= UNCOARSE;
          step_q  <= '0;
        end
      end
      UNCOARSE: if (step_q == 5'(CoarseSteps - 1)) state_q <= DONE;
      default:  state_q <= IDLE;
    endcase
    if (valid_i) begin
      state_q <= COARSE;
      step_q  <= '0;
    end
    if (rst_i) state_q <= IDLE;
  end

  // Normalise.
  logic [XyWidth-1:0] x_absolute, y_absolute;
  assign x_absolute = (x_i ^ {XyWidth{x_i[XyWidth-1]}}) + XyWidth'(x_i[XyWidth-1]);
  assign y_absolute = (y_i ^ {XyWidth{y_i[XyWidth-1]}}) + XyWidth'(y_i[XyWidth-1]);

  logic                 x_negative_q, y_negative_q;
  logic [WideWidth-1:0] across_q, up_q;
  logic [          2:0] coarse_q, fine_q;  // shifts done
  logic                 coarse, fine;
  assign coarse = (across_q[WideWidth-1-:8] | up_q[WideWidth-1-:8]) == '0;
  assign fine   = !(across_q[WideWidth-1] || up_q[WideWidth-1]);

  // Rotate.
  logic        [AlongWidth-1:0] along_q, part_q;
  logic signed [ SideWidth-1:0] side_q, along_signed;
  logic        [  SumWidth-1:0] angle_q, arc_q;
  logic                         below, zero_q;
  assign below        = side_q[SideWidth-1];
  assign along_signed = signed'(SideWidth'(along_q));

  // Scale back; the lowest bit is the half.
  logic [ScaledWidth-1:0] scaled_q;
  logic [    XyWidth+1:0] rounded;
  assign rounded = (XyWidth + 2)'(((scaled_q >> Padding) + ScaledWidth'(1)) >> 1);

  always_ff @(posedge clk_i) begin
    unique case (state_q)
      COARSE: begin
        if (coarse) begin
          across_q <= across_q << 8;
          up_q     <= up_q << 8;
          coarse_q <= coarse_q + 3'd1;
        end
      end
      FINE: begin
        if (fine) begin
          across_q <= across_q << 1;
          up_q     <= up_q << 1;
          fine_q   <= fine_q + 3'd1;
        end
      end
      LOAD: begin
        along_q <= AlongWidth'(across_q[WideWidth-1-:NormWidth]);
        side_q  <= signed'(SideWidth'(up_q[WideWidth-1-:NormWidth]));
        // Half an output step, so that the cut at the end rounds; half a turn on the left.
        angle_q <= {x_negative_q, (SumWidth - 1)'(1) << (AngleGuard - 1)};
        zero_q  <= fine;
      end
      SHIFT: begin
        part_q <= AlongWidth'(side_q >>> {step_q, 1'b0});
        arc_q  <= SumWidth'(cordic_pkg::arc_tangent(step_q) >> (cordic_pkg::TableWidth - SumWidth));
      end
      ROTATE: begin
        along_q <= below ? along_q - part_q : along_q + part_q;
        side_q  <= (below ? side_q + along_signed : side_q - along_signed) <<< 1;
        angle_q <= below ^ x_negative_q ^ y_negative_q ? angle_q - arc_q : angle_q + arc_q;
      end
      SCALE: scaled_q <= ScaledWidth'(along_q) << (WideWidth - NormWidth + 1);
      UNFINE: begin
        if (fine_q != '0) begin
          scaled_q <= scaled_q >> 1;
          fine_q   <= fine_q - 3'd1;
        end
      end
      UNCOARSE: begin
        if (coarse_q != '0) begin
          scaled_q <= scaled_q >> 8;
          coarse_q <= coarse_q - 3'd1;
        end
      end
      DONE: begin
        angle_o     <= zero_q ? '0 : angle_q[SumWidth-1-:AngleWidth];
        magnitude_o <= zero_q ? '0 : rounded;
        zero_o      <= zero_q;
      end
      default: ;
    endcase
    if (valid_i) begin
      x_negative_q <= x_i[XyWidth-1];
      y_negative_q <= y_i[XyWidth-1];
      across_q     <= WideWidth'(x_absolute) << Padding;
      up_q         <= WideWidth'(y_absolute) << Padding;
      coarse_q     <= '0;
      fine_q       <= '0;
    end
    valid_o <= state_q == DONE && !valid_i;
    if (rst_i) valid_o <= 1'b0;
  end

endmodule

`default_nettype wire
