"""First harmonic of a window and its noise sums, the twin of ``rtl/peak/phase_correlate.sv``."""

from dataclasses import dataclass

import numpy as np

from vrscan.arrays import Bools, Ints, Pixels
from vrscan.fixed import cordic_vector as cordic
from vrscan.fixed import pkg
from vrscan.fixed.divide import divide
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.quarter_wave import quarter_wave

STEP_WIDTH = 32  # bits of the phase accumulator, ``StepWidth``
UNMEASURED_LATENCY = 2  # clocks from valid_i to valid_o for a line that is not measured


@dataclass(frozen=True)
class Harmonics:
    """First harmonics of n windows, int64 [n] each; all zero where nothing is measured.

    Attributes:
        measured: Whether there was a window and it has a phase.
        no_phase: Whether there was a window whose harmonic is zero or nothing but rounding: X and Y
            together below 1.2e-6 of the sum.
        period: T of the window, px.
        phase: Fraction of a turn, 24 bits.
        magnitude: CORDIC gain times table amplitude times |P1|, aligned counts.
        sum: Sum of pixel - pedestal, aligned counts.
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


def latency(width: int) -> int:
    """Return the clocks from ``valid_i`` to ``valid_o`` for a measured window of ``width``."""
    pipeline = pkg.QUARTER_WAVE_LATENCY + 6  # table, q to q5, accumulator
    step = 1 + divide_latency(STEP_WIDTH) + 1
    first = width + pipeline + 1 + cordic.latency(pkg.HARMONIC_WIDTH, pkg.ANGLE_WIDTH)
    second = width - 1 + pipeline + 1
    return step + first + second


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
) -> Harmonics:
    """Return phase, magnitude and noise sums of every measured window (VR-SCAN (8)).

    Args:
        lines: Pixels, [n, line_length].
        left: First pixel of the window, [n].
        width: Its pixels, at most 255 where it is measured, [n].
        background: Counts, 24 - PixelWidth fraction bits, not above the pixels of the window, [n].
        measured: Which windows to measure, bool [n].
        pixel_width: ``PixelWidth`` of the module.
        period_n: Whether T = N; otherwise T = N - 1, on the raw pixels as (8) is printed.

    Returns:
        One harmonic a line.
    """
    count, length = lines.shape
    rows = np.flatnonzero(measured)
    results = {
        name: np.zeros(count, np.int64)
        for name in ("period", "phase", "magnitude", "sum", "wave", "count")
    }
    no_phase = np.zeros(count, np.bool_)
    # The period leaves the hardware for every line, modulo its width.
    results["period"][:] = (width - (not period_n)) & ((1 << pkg.WINDOW_WIDTH) - 1)
    if rows.size:
        n = width[rows]
        place = np.arange(int(n.max()))
        inside = place < n[:, None]
        columns = np.minimum(left[rows, None] + place, length - 1)
        pixels = lines[rows[:, None], columns].astype(np.int64)
        pedestal = background[rows] >> (pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH)
        height = (pixels << (pkg.ALIGNED_WIDTH - pixel_width)) - pedestal[:, None]
        height = np.where(inside, height, 0)
        turn = 1 << STEP_WIDTH
        step, _ = divide(np.int64(turn), results["period"][rows], quotient_width=STEP_WIDTH)

        x, y, _ = _correlate(height, (place * step[:, None]) & (turn - 1), inside)
        if not period_n:
            x += pedestal * pkg.SINE_AMPLITUDE
        phase, magnitude, zero = cordic.cordic_vector(
            x, y, xy_width=pkg.HARMONIC_WIDTH, angle_width=pkg.ANGLE_WIDTH
        )

        start = -(phase << (STEP_WIDTH - pkg.ANGLE_WIDTH + 1))
        angle = (start[:, None] + place * (2 * step)[:, None]) & (turn - 1)
        wave, _, plain = _correlate(height, angle, inside)
        wave_shift = pkg.SINE_WIDTH - 1 - pkg.WAVE_FRACTION
        count_shift = pkg.SINE_WIDTH - 1 - pkg.WAVE_COUNT_FRACTION
        results["phase"][rows] = phase
        results["magnitude"][rows] = magnitude
        results["sum"][rows] = height.sum(axis=1)
        results["wave"][rows] = (wave + (1 << (wave_shift - 1))) >> wave_shift
        results["count"][rows] = (plain + (1 << (count_shift - 1))) >> count_shift
        no_phase[rows] = zero | (magnitude < results["sum"][rows] << pkg.NO_PHASE_SHIFT)
    return Harmonics(measured=measured & ~no_phase, no_phase=no_phase, **results)
