"""First harmonic of a window and its noise sums, the twin of ``rtl/peak/phase_correlate.sv``."""

from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints, Pixels
from vrscan.fixed import cordic_vector as cordic
from vrscan.fixed.divide import divide
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.quarter_wave import quarter_wave

STEP_WIDTH = 32  # bits of the phase accumulator, ``StepWidth``
_TURN = 1 << STEP_WIDTH
UNMEASURED_LATENCY = 2  # clocks from valid_i to valid_o for a line that is not measured


@dataclass(frozen=True)
class Harmonics:
    """First harmonics of n windows, int64 [n] each; all zero where no window is measured.

    Attributes:
        measured: Whether there was a window, and it has a phase.
        no_phase: Whether there was a window whose harmonic is zero or no more than rounding: X and
            Y together below 1.2e-6 of the sum of the heights that were correlated.
        period: T of the window, px.
        phase: Phase of the first harmonic, fraction of a turn, 24 bits.
        magnitude: CORDIC gain times table amplitude times |P1|, aligned counts.
        sum: Sum of pixel - pedestal, aligned counts, at least 0.
        wave: Sum of (pixel - pedestal) cos(2 theta - 2 phi), 4 fraction bits.
        count: Sum of cos(2 theta - 2 phi), 8 fraction bits.
    """

    measured: Bools
    no_phase: Bools
    period: Ints
    phase: Ints
    magnitude: Ints
    sum: Ints
    wave: Ints
    count: Ints


@dataclass(frozen=True)
class FirstHarmonics:
    """Results of the first pass over n windows, int64 [n] each."""

    phase: Ints
    magnitude: Ints
    sum: Ints  # sum of the heights that were correlated, at least 0
    zero: Bools  # X = Y = 0


_PIPELINE = pkg.QUARTER_WAVE_LATENCY + 6  # table, q to q5, accumulator


def first_latency(width: int) -> int:
    """Return the clocks from ``valid_i``, or ``refined_i``, to the harmonic of ``width`` pixels.

    In the first of two passes that is the clock of ``refine_o``.
    """
    step = 1 + divide_latency(STEP_WIDTH) + 1
    return step + width + _PIPELINE + 1 + cordic.latency(pkg.HARMONIC_WIDTH, pkg.ANGLE_WIDTH)


def latency(width: int) -> int:
    """Return the clocks from ``valid_i``, or ``refined_i``, to ``valid_o``."""
    return first_latency(width) + width - 1 + _PIPELINE + 1


def _pixels(lines: Pixels, left: Ints, width: Ints, pixel_width: int) -> tuple[Ints, Bools]:
    """Return the aligned counts of each window, [n, m], and which of them are inside."""
    place = np.arange(int(width.max(initial=0)))
    inside = place < width[:, None]
    columns = np.minimum(left[:, None] + place, lines.shape[1] - 1)
    rows = np.arange(len(lines))[:, None]
    aligned = lines[rows, columns].astype(np.int64) << (pkg.ALIGNED_WIDTH - pixel_width)
    return aligned, inside


def first_harmonics(
    lines: Pixels,
    *,
    left: Ints,
    width: Ints,
    background: Ints,
    pixel_width: int,
    period_n: bool,
    ramp: Ints | int = 0,
    slope: Ints | int = 0,
) -> FirstHarmonics:
    """Return phase and magnitude of every window; arguments as in ``phase_correlate``."""
    aligned, inside = _pixels(lines, left, width, pixel_width)
    place = np.arange(aligned.shape[1])
    pedestal = background >> (pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH)
    begin, rise = (np.broadcast_to(np.asarray(v, np.int64), len(lines)) for v in (ramp, slope))
    # The remainder of a pixel's rounding is carried to the next pixel.
    lowered = np.cumsum(begin[:, None] + place * rise[:, None], axis=1)
    lowered = (lowered + (1 << (pkg.RAMP_FRACTION - 1))) >> pkg.RAMP_FRACTION
    level = np.diff(lowered, axis=1, prepend=0)
    height = np.where(inside, aligned - pedestal[:, None] - level, 0)
    step, _ = divide(np.int64(_TURN), width - (not period_n), quotient_width=STEP_WIDTH)
    x, y, _ = _correlate(height, (place * step[:, None]) & (_TURN - 1), inside)
    if not period_n:
        x += pedestal * pkg.SINE_AMPLITUDE
    phase, magnitude, zero = cordic.cordic_vector(
        x, y, xy_width=pkg.HARMONIC_WIDTH, angle_width=pkg.ANGLE_WIDTH
    )
    return FirstHarmonics(phase, magnitude, np.maximum(height.sum(axis=1), 0), zero)


def _correlate(height: Ints, angle: Ints, inside: Bools) -> tuple[Ints, Ints, Ints]:
    """Return the sums of height cos, height sin and cos over the pixels inside."""
    phase = angle >> (STEP_WIDTH - pkg.PHASE_WIDTH)
    sine, cosine = quarter_wave(phase, phase_width=pkg.PHASE_WIDTH, ampl_width=pkg.SINE_WIDTH)
    cosine = np.where(inside, cosine, 0)
    x = np.einsum("nk,nk->n", height, cosine)
    y = np.einsum("nk,nk->n", height, sine)
    return x, y, cosine.sum(axis=1)


def phase_correlate(
    lines: Pixels,
    *,
    left: Ints,
    width: Ints,
    background: Ints,
    measured: Bools,
    pixel_width: int,
    period_n: bool,
    ramp: Ints | int = 0,
    slope: Ints | int = 0,
) -> Harmonics:
    """Return phase, magnitude and noise sums of every measured window (VR-SCAN (8)).

    Args:
        lines: Pixels, [n, line_length].
        left: First pixel of the window, [n].
        width: Number of pixels of the window, at most 255 where it is measured, [n].
        background: Level of the background, counts, 24 - PixelWidth fraction bits, [n].
        measured: Which windows to measure, bool [n].
        pixel_width: ``PixelWidth`` of the module.
        period_n: Whether T = N; otherwise T = N - 1, on the raw pixels as (8) is printed.
        ramp: What the first pass subtracts from the window's first pixel besides the background,
            aligned counts, 12 fraction bits, [n] or one for all.
        slope: What it subtracts in addition from pixel to pixel, in the same format.

    Returns:
        One harmonic for each line.
    """
    count = len(lines)
    rows = np.flatnonzero(measured)
    results = {
        name: np.zeros(count, np.int64)
        for name in ("period", "phase", "magnitude", "sum", "wave", "count")
    }
    no_phase = np.zeros(count, np.bool_)
    # The hardware outputs the period of every line, modulo its width.
    results["period"][:] = (width - (not period_n)) & ((1 << pkg.WINDOW_WIDTH) - 1)
    if rows.size:
        n = width[rows]
        begin, rise = (np.broadcast_to(np.asarray(v, np.int64), count) for v in (ramp, slope))
        found = first_harmonics(
            lines[rows],
            left=left[rows],
            width=n,
            background=background[rows],
            pixel_width=pixel_width,
            period_n=period_n,
            ramp=begin[rows],
            slope=rise[rows],
        )
        # The noise is that of the pixels as they are, so only the background is subtracted here.
        aligned, inside = _pixels(lines[rows], left[rows], n, pixel_width)
        pedestal = background[rows] >> (pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH)
        height = np.where(inside, aligned - pedestal[:, None], 0)
        step, _ = divide(np.int64(_TURN), results["period"][rows], quotient_width=STEP_WIDTH)
        start = -(found.phase << (STEP_WIDTH - pkg.ANGLE_WIDTH + 1))
        angle = (start[:, None] + np.arange(height.shape[1]) * (2 * step)[:, None]) & (_TURN - 1)
        wave, _, plain = _correlate(height, angle, inside)
        wave_shift = pkg.SINE_WIDTH - 1 - pkg.WAVE_FRACTION
        count_shift = pkg.SINE_WIDTH - 1 - pkg.WAVE_COUNT_FRACTION
        results["phase"][rows] = found.phase
        results["magnitude"][rows] = found.magnitude
        results["sum"][rows] = np.maximum(height.sum(axis=1), 0)
        results["wave"][rows] = (wave + (1 << (wave_shift - 1))) >> wave_shift
        results["count"][rows] = (plain + (1 << (count_shift - 1))) >> count_shift
        no_phase[rows] = found.zero | (found.magnitude < found.sum << pkg.NO_PHASE_SHIFT)
    return Harmonics(measured=measured & ~no_phase, no_phase=no_phase, **results)
