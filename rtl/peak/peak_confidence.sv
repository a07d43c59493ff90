// peak_confidence: signal-to-noise and uncertainty of a peak, and confidence in its absence.
//
//   snr    = (maximum - background) / noise
//   sigma  = T / (2 pi) sqrt(sum v_i sin^2(theta_i - phi)) / |P1|,  v_i = noise^2 + kappa p_i,
//            p_i above background, from the sums of phase_correlate
//   c_sfm  = power / power_max where nothing is there (10): where clear_i is and the noise is not
//            zero, else 0
//
// In aligned counts, with C the sum of the plain cosines, S the sum of pixel - pedestal, W its
// wave and f the background's fraction below the pedestal:
//   2 sum v_i sin^2 = (noise^2 - kappa f) (N - C) + kappa (S - W)
//
//   snr_o    8 fraction bits, saturating; a noise of zero gives the largest value, or 0 where
//            the maximum does not exceed the background
//   sigma_o  px, 12 fraction bits, saturating; 0 where nothing is measured
//   Latency  vrscan.fixed.peak_confidence.latency() clocks, whatever the data; a valid_i meanwhile
//            is ignored
//   Model    vrscan.fixed.peak_confidence, bit-exact

`default_nettype none

module peak_confidence #(
  parameter int unsigned PixelWidth = 12
) (
  input  wire logic                                         clk_i,
  input  wire logic                                         rst_i,

  // Sampled with valid_i.
  input  wire logic                                         valid_i,
  input  wire logic                                         measured_i,
  input  wire logic                                         clear_i,
  input  wire logic        [                PixelWidth-1:0] maximum_i,
  input  wire logic        [    vrscan_pkg::CountWidth-1:0] background_i,
  input  wire logic        [    vrscan_pkg::CountWidth-1:0] noise_i,
  input  wire logic        [   vrscan_pkg::WindowWidth-1:0] width_i,
  input  wire logic        [   vrscan_pkg::WindowWidth-1:0] period_i,
  input  wire logic        [vrscan_pkg::MagnitudeWidth-1:0] magnitude_i,
  input  wire logic        [      vrscan_pkg::SumWidth-1:0] sum_i,
  input  wire logic signed [     vrscan_pkg::WaveWidth-1:0] wave_i,
  input  wire logic signed [vrscan_pkg::WaveCountWidth-1:0] count_i,
  input  wire logic        [    vrscan_pkg::PowerWidth-1:0] power_i,

  output      logic                                         valid_o,
  output      logic        [      vrscan_pkg::SnrWidth-1:0] snr_o,
  output      logic                                         no_noise_o,
  output      logic        [    vrscan_pkg::SigmaWidth-1:0] sigma_o,
  output      logic        [vrscan_pkg::ConfidenceWidth-1:0] c_sfm_o,

  // Configuration.
  input  wire register_pkg::peak_t                          peak_i
);

  localparam int unsigned CountWidth = vrscan_pkg::CountWidth;
  localparam int unsigned CountShift = CountWidth - PixelWidth;
  // Aligned counts squared: a count has 8 fraction bits, its square 16; noise is at most half of
  // full scale, N - C at most 2 * 255, so the sum stays below 2**(2 * 15 + 9 + 16).
  localparam int unsigned SquareFraction = 2 * (CountWidth - vrscan_pkg::AlignedWidth);
  localparam int unsigned KappaFraction  = 28 - vrscan_pkg::AlignedWidth;
  localparam int unsigned RootWidth      = 28;
  localparam int unsigned AWidth         = 50;
  localparam int unsigned BWidth         = 32;
  localparam int unsigned NumeratorWidth = 62;
  localparam int unsigned FractionWidth  = CountWidth - vrscan_pkg::AlignedWidth;

  // ---- what arrived ----
  logic                                         measured_q, clear_q;
  logic        [                CountWidth-1:0] noise_q, height_q;
  logic        [             FractionWidth-1:0] fraction_q;
  logic        [   vrscan_pkg::WindowWidth-1:0] period_q;
  logic        [vrscan_pkg::MagnitudeWidth-1:0] magnitude_q;
  logic signed [vrscan_pkg::WaveCountWidth-1:0] free_q;  // N - C
  logic signed [     vrscan_pkg::WaveWidth-1:0] shot_q;  // S - W

  // ---- one multiplier, one divider, one root; a step is the unit that is waited for ----
  typedef enum logic [3:0] {
    IDLE, FREE, SNR, SQUARE, FRACTION, CONSTANT, SHOT, ROOT, SCALE, GAIN, SIGMA, DONE
  } state_e;
  state_e                          state_q;
  logic                            multiply_start_q, product_valid;
  logic signed [       AWidth-1:0] a_q;
  logic signed [       BWidth-1:0] b_q;
  logic signed [AWidth+BWidth-1:0] product;
  logic                            divide_start_q, quotient_valid;
  logic [      NumeratorWidth-1:0] numerator_q;
  logic [vrscan_pkg::MagnitudeWidth-1:0] denominator_q;
  logic [vrscan_pkg::SigmaWidth-1:0]     quotient;
  logic                            root_start_q, root_valid;
  logic [         2*RootWidth-1:0] radicand_q;
  logic [           RootWidth-1:0] root;

  multiply #(.AWidth(AWidth), .BWidth(BWidth)) u_multiply (
    .clk_i, .rst_i,
    .valid_i  (multiply_start_q),
    .a_i      (a_q),
    .b_i      (b_q),
    .valid_o  (product_valid),
    .product_o(product)
  );

  divide #(
    .DividendWidth(NumeratorWidth),
    .DivisorWidth (vrscan_pkg::MagnitudeWidth),
    .QuotientWidth(vrscan_pkg::SigmaWidth)
  ) u_divide (
    .clk_i, .rst_i,
    .valid_i   (divide_start_q),
    .dividend_i(numerator_q),
    .divisor_i (denominator_q),
    .valid_o   (quotient_valid),
    .quotient_o(quotient),
    .overflow_o()  // all ones is the saturation
  );

  square_root #(.RootWidth(RootWidth)) u_square_root (
    .clk_i, .rst_i,
    .valid_i   (root_start_q),
    .radicand_i(radicand_q),
    .valid_o   (root_valid),
    .root_o    (root)
  );

  // ---- a product is rounded in the clock after it comes, and used in the next ----
  // Squares have 16 fraction bits.  kappa f comes with 12 + 8, constant with 16 + 8, and a
  // confidence with the 16 of its gain; all to nearest, half up.
  localparam int unsigned KappaShift      = KappaFraction + FractionWidth - SquareFraction;
  localparam int unsigned VarianceWidth   = 2 * RootWidth + 2;
  localparam int unsigned ConfidenceWidth = vrscan_pkg::ConfidenceWidth;
  localparam int unsigned ScaledWidth     = vrscan_pkg::GainWidth + vrscan_pkg::PowerWidth;
  localparam logic [24:0] SigmaGain       = 25'(vrscan_pkg::SigmaGain);
  logic        [    2*CountWidth-1:0] square_q;
  logic signed [   VarianceWidth-1:0] constant_q, rounded_constant_q, variance_q;
  logic signed [          AWidth-1:0] kappa_fraction_q;
  logic        [     ScaledWidth-1:0] scaled_q;
  logic        [ ConfidenceWidth-1:0] confidence;
  logic                               product_ready_q;
  assign confidence = scaled_q > ScaledWidth'(255) ? '1 : scaled_q[ConfidenceWidth-1:0];
  always_ff @(posedge clk_i) begin
    product_ready_q    <= product_valid;
    kappa_fraction_q   <= AWidth'((product + (AWidth + BWidth)'(1 << (KappaShift - 1)))
                                  >>> KappaShift);
    rounded_constant_q <= VarianceWidth'(
        (product + (AWidth + BWidth)'(1 << (vrscan_pkg::WaveCountFraction - 1)))
        >>> vrscan_pkg::WaveCountFraction);
    scaled_q           <= (unsigned'(product[ScaledWidth-1:0])
                           + ScaledWidth'(1 << (vrscan_pkg::GainFraction - 1)))
                          >> vrscan_pkg::GainFraction;
    if (rst_i) product_ready_q <= 1'b0;
  end

  always_ff @(posedge clk_i) begin
    multiply_start_q <= 1'b0;
    divide_start_q   <= 1'b0;
    root_start_q     <= 1'b0;
    valid_o          <= 1'b0;
    unique case (state_q)
      IDLE: if (valid_i) begin
        measured_q  <= measured_i;
        clear_q     <= clear_i && noise_i != '0;
        noise_q     <= noise_i;
        height_q    <= (CountWidth'(maximum_i) << CountShift) - background_i;
        fraction_q  <= background_i[FractionWidth-1:0];
        period_q    <= period_i;
        magnitude_q <= magnitude_i;
        free_q      <= signed'({2'b0, width_i, {vrscan_pkg::WaveCountFraction{1'b0}}}) - count_i;
        shot_q      <= signed'({2'b0, sum_i, {vrscan_pkg::WaveFraction{1'b0}}}) - wave_i;
        // Power first: it needs nothing else.
        a_q              <= AWidth'(signed'({1'b0, peak_i.c_sfm_gain}));
        b_q              <= BWidth'(signed'({1'b0, power_i}));
        multiply_start_q <= 1'b1;
        state_q          <= FREE;
      end
      FREE: if (product_ready_q) begin
        c_sfm_o        <= clear_q ? confidence : '0;
        numerator_q    <= NumeratorWidth'(height_q) << vrscan_pkg::SnrFraction;
        denominator_q  <= vrscan_pkg::MagnitudeWidth'(noise_q);
        divide_start_q <= 1'b1;
        state_q        <= SNR;
      end
      SNR: if (quotient_valid) begin
        snr_o            <= height_q == '0 ? '0 : quotient;
        no_noise_o       <= noise_q == '0;
        a_q              <= AWidth'(signed'({1'b0, noise_q}));
        b_q              <= BWidth'(signed'({1'b0, noise_q}));
        multiply_start_q <= 1'b1;
        state_q          <= SQUARE;
      end
      SQUARE: if (product_ready_q) begin
        square_q         <= product[2*CountWidth-1:0];
        a_q              <= AWidth'(signed'({1'b0, peak_i.kappa}));
        b_q              <= BWidth'(signed'({1'b0, fraction_q}));
        multiply_start_q <= 1'b1;
        state_q          <= FRACTION;
      end
      FRACTION: if (product_ready_q) begin
        a_q              <= signed'({2'b0, square_q}) - kappa_fraction_q;
        b_q              <= BWidth'(free_q);
        multiply_start_q <= 1'b1;
        state_q          <= CONSTANT;
      end
      CONSTANT: if (product_ready_q) begin
        constant_q       <= rounded_constant_q;
        a_q              <= AWidth'(signed'({1'b0, peak_i.kappa}));
        b_q              <= BWidth'(shot_q);
        multiply_start_q <= 1'b1;
        state_q          <= SHOT;
      end
      SHOT: if (product_ready_q) begin
        variance_q       <= constant_q + VarianceWidth'(product);
        state_q          <= ROOT;
      end
      ROOT: begin
        // Rounding can leave a variance of zero a little below it.
        radicand_q       <= variance_q < 0 ? '0 : variance_q[2*RootWidth-1:0];
        root_start_q     <= 1'b1;
        state_q          <= SCALE;
      end
      SCALE: if (root_valid) begin
        a_q              <= AWidth'(signed'({1'b0, root}));
        b_q              <= BWidth'(signed'({1'b0, period_q}));
        multiply_start_q <= 1'b1;
        state_q          <= GAIN;
      end
      GAIN: if (product_ready_q) begin
        a_q              <= product[AWidth-1:0];
        b_q              <= BWidth'(signed'({1'b0, SigmaGain}));
        multiply_start_q <= 1'b1;
        state_q          <= SIGMA;
      end
      SIGMA: if (product_ready_q) begin
        numerator_q      <= product[NumeratorWidth-1:0];
        denominator_q    <= magnitude_q;
        divide_start_q   <= 1'b1;
        state_q          <= DONE;
      end
      DONE: if (quotient_valid) begin
        sigma_o          <= measured_q ? quotient : '0;
        valid_o          <= 1'b1;
        state_q          <= IDLE;
      end
      default: state_q <= IDLE;
    endcase
    if (rst_i) begin
      state_q          <= IDLE;
      multiply_start_q <= 1'b0;
      divide_start_q   <= 1'b0;
      root_start_q     <= 1'b0;
      valid_o          <= 1'b0;
    end
  end

endmodule

`default_nettype wire
