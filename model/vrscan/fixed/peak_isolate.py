"""The window of the peak, the twin of ``rtl/peak/peak_isolate.sv``."""

from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints, Pixels
from vrscan.fixed import line_buffer
from vrscan.fixed.line_statistics import LineStatistics
from vrscan.fixed.multiply import latency as multiply_latency

HALF_SHIFT = 1  # the spread lifts the threshold to half of the height at most
CORE_SHIFT = 2  # the second level is at a quarter of the height
MOST_RIVALS = 2  # narrow rivals of a clear spot
MOST_RAISED = 15  # powers of two by which clipping may hide the noise
SURE = 13  # eighths of snr_min from which a spot is found on any row
EVEN = 17  # sixteenths of the noise up to which the spread of an even row is
MOST_GAP = 4  # px between the parts of a spot that speckle breaks up; a fit joins them


@dataclass(frozen=True)
class Windows:
    """Windows of n lines, one entry each.

    Attributes:
        measured: Whether the window goes to the phase detector.
        left: First pixel above the threshold; the maximum's place where no pixel is above it.
        right: Last pixel above the threshold; the maximum's place where no pixel is above it.
        width: Number of pixels in the window, 0 where the maximum is not above the threshold.
        noise: Noise that the peak is judged by: that beside it where the spot is clear, otherwise
            the larger one of that and the spread.
        flags: Bits LOW_SNR to RIVAL of ``pkg.FLAGS``.
    """

    measured: Bools
    left: Ints
    right: Ints
    width: Ints
    noise: Ints
    flags: Ints


def replay_latency() -> int:
    """Return the clocks from ``valid_i`` to ``replay_o``."""
    return 5 * (multiply_latency(pkg.COUNT_WIDTH + 1, 17) + 1) + 3


def latency(line_length: int) -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``, with the line's replay in between."""
    return replay_latency() + line_buffer.LATENCY + line_length - 1 + 3


def peak_isolate(
    lines: Pixels,
    statistics: LineStatistics,
    *,
    pixel_width: int,
    max_window: int,
    k_noise: int,
    k_height: int,
    snr_min: int,
    min_width: int,
    max_width: int,
    max_core: int,
    saturation_level: int,
    noise_row: bool,
    window_fit: bool,
) -> Windows:
    """Return the run of pixels above the threshold that holds the maximum (VR-SCAN, III-E).

    A second level, at a quarter of the height, tells spots from their surroundings: other runs
    above it are rivals, and a spot is clear where its own is at most ``max_core`` wide and no more
    than ``MOST_RIVALS`` others are from ``min_width`` to ``max_core`` wide. What is not clear is
    judged by the spread. Where a fit follows, runs at most ``MOST_GAP``
    pixels apart are one: its width at the second level is without the gaps, and one part of it has
    to be ``min_width`` wide. Of a window, too, gaps do not count for ``min_width``, and two pixels
    above are side by side: two hot ones are no spot.

    Args:
        lines: Pixels, [n, line_length].
        statistics: Statistics of the lines; ``background``, ``noise`` and ``spread`` are used.
        pixel_width: ``PixelWidth`` of the module.
        max_window: ``MaxWindow`` of the module.
        k_noise: Threshold above the background over the spread, and the second level over the
            noise, 8 fraction bits.
        k_height: Threshold above the background over the peak's height, 16 fraction bits.
        snr_min: Least signal-to-noise ratio, 8 fraction bits, of a clear spot on an even row; 13/8
            times as much elsewhere.
        min_width: Least width; below 3 counts as 3.
        max_width: Largest width; above ``max_window`` counts as ``max_window``.
        max_core: Largest width at the second level, but for a saturated spot.
        saturation_level: Least saturated pixel, counts.
        noise_row: Whether noise and spread are the row's, by which the paper cuts.
        window_fit: Whether a Gaussian is fitted.

    Returns:
        One window for each line.
    """
    count, length = lines.shape
    shift = pkg.COUNT_WIDTH - pixel_width
    min_width = max(min_width, pkg.MIN_WINDOW)
    max_width = min(max_width, max_window)

    height = (statistics.maximum << shift) - statistics.background

    def noise_term(noise: Ints) -> Ints:
        return (noise * k_noise + (1 << (pkg.K_NOISE_FRACTION - 1))) >> pkg.K_NOISE_FRACTION

    height_term = (height * k_height + (1 << (pkg.K_HEIGHT_FRACTION - 1))) >> pkg.K_HEIGHT_FRACTION
    spread_term = noise_term(statistics.spread)
    if not noise_row:
        spread_term = np.minimum(spread_term, height >> HALF_SHIFT)
    threshold = statistics.background + np.maximum(spread_term, height_term)
    core_level = statistics.background + np.maximum(
        noise_term(statistics.noise), height >> CORE_SHIFT
    )

    gap = MOST_GAP if window_fit else 0
    runs = _Runs.above(lines, threshold >> shift, statistics.max_index, gap)
    core = _Runs.above(lines, core_level >> shift, statistics.max_index, gap)
    width = runs.width
    left = np.where(runs.found, runs.left, statistics.max_index)
    right = np.where(runs.found, left + width - 1, statistics.max_index)

    rival = core.others(min_width, length) > 0
    broad = core.pixels > max_core
    clear = ~broad & (core.others(min_width, max_core) <= MOST_RIVALS)
    uneven = ~clear & (statistics.spread > statistics.noise)
    noise = np.where(uneven, statistics.spread, statistics.noise)
    row_only = statistics.row_statistics | noise_row
    raised = np.maximum(statistics.noise, unclipped(statistics, pixel_width))
    judged = np.where(row_only, statistics.noise, raised)
    even = clear & ~row_only & (16 * statistics.spread <= EVEN * statistics.noise)
    judged = np.where(clear & ~even, judged, np.maximum(judged, statistics.spread))
    least = np.where(even | noise_row, 8, SURE) * snr_min
    low_snr = (height == 0) | ((height << (pkg.SNR_FRACTION + 3)) < least * judged)
    saturated = statistics.maximum >= saturation_level
    too_narrow, too_wide = (
        (runs.pixels < min_width) | (runs.part < 2),
        (width > max_width) | (broad & ~saturated),
    )
    at_edge = runs.found & ((left == 0) | (right == length - 1))
    flags = np.zeros(count, np.int64)
    for bit, condition in (
        (pkg.FLAG_LOW_SNR, low_snr),
        (pkg.FLAG_TOO_NARROW, too_narrow),
        (pkg.FLAG_TOO_WIDE, too_wide),
        (pkg.FLAG_AT_EDGE, at_edge),
        (pkg.FLAG_SATURATED, saturated),
        (pkg.FLAG_RIVAL, rival),
    ):
        flags |= condition.astype(np.int64) << bit
    return Windows(~(low_snr | too_narrow | too_wide), left, right, width, noise, flags)


def _halves(value: Ints) -> Ints:
    # Twice the logarithm to base 2, rounded down to where it or a half more is a sum of two powers.
    mantissa, bits = np.frexp(np.maximum(value, 1).astype(np.float64))
    return 2 * (bits.astype(np.int64) - 1) + (mantissa >= 0.75)


def unclipped(statistics: LineStatistics, pixel_width: int) -> Ints:
    """Return the noise of a sensor whose black is clipped, as far as the clipping hides it [n].

    Of a Gaussian that only reaches above black with its tail, sigma is about 1.4 times the variance
    over the mean. So where the noise is larger than the background, in half powers of two, it is
    multiplied by their ratio and 1.4. It is 5/16 of a count at least, a little above the steps' own
    sqrt(1/12), and a count where all of the background is 0 and tells nothing.
    """
    noise, mean = statistics.noise, statistics.background
    halves = _halves(noise) - _halves(mean)
    halves = np.where(halves > 0, np.minimum(halves + 1, 2 * MOST_RAISED + 1), 0)
    raised: Ints = (noise * np.where(halves & 1, 3, 2) << (halves >> 1)) >> 1
    one = 1 << (pkg.COUNT_WIDTH - pixel_width)
    raised = np.maximum(raised, np.where(mean == 0, one, (pkg.NOISE_FLOOR * one) >> 4))
    return np.minimum(raised, (1 << pkg.COUNT_WIDTH) - 1)


@dataclass(frozen=True)
class _Runs:
    """Runs of pixels above a level, in all lines.

    Attributes:
        own: Index of the run that holds the line's maximum, -1 without one, [n].
        left: First pixel of that run, meaningless without one, [n].
        width: Its width, 0 without one, [n].
        pixels: Those of its pixels above the level, all but gaps, [n].
        part: Width of its widest part without a gap, [n].
        rows: Line of each run [m].
        counts: Pixels above the level of each run [m].
        parts: Width of the widest part of each run without a gap [m].
    """

    own: Ints
    left: Ints
    width: Ints
    pixels: Ints
    part: Ints
    rows: Ints
    counts: Ints
    parts: Ints

    @classmethod
    def above(cls, lines: Pixels, level: Ints, max_index: Ints, gap: int) -> "_Runs":
        """Return the runs of pixels above ``level``, whole counts [n], joined over a gap."""
        count, length = lines.shape
        # pixel 2**shift > threshold is pixel > floor(threshold / 2**shift).
        limit = np.minimum(level, (1 << 16) - 1).astype(np.uint16)
        stride = length + 2
        above = np.zeros((count, stride), np.bool_)
        np.greater(lines, limit[:, None], out=above[:, 1:-1])
        flat = above.reshape(-1)
        edges = np.flatnonzero(flat[1:] != flat[:-1])
        starts, ends = edges[0::2], edges[1::2]  # a run is [start, end) in columns of ``lines``
        if not starts.size:
            none = np.zeros(count, np.int64)
            return cls(none - 1, none, none, none, none, *[starts] * 3)
        line = starts // stride
        apart = (starts[1:] - ends[:-1] > gap) | (line[1:] > line[:-1])
        begins = np.flatnonzero(np.append(True, apart))
        counts, parts = (each.reduceat(ends - starts, begins) for each in (np.add, np.maximum))
        starts, ends = starts[begins], ends[np.append(apart, True)]
        first = np.arange(count) * stride
        peak = first + max_index
        run = np.searchsorted(starts, peak, side="right") - 1
        found = (run >= 0) & (ends[run] > peak)
        width, pixels, part = (
            np.where(found, each[run], 0) for each in (ends - starts, counts, parts)
        )
        own, rows = np.where(found, run, -1), starts // stride
        return cls(own, starts[run] - first, width, pixels, part, rows, counts, parts)

    @property
    def found(self) -> Bools:
        """Whether a run holds the line's maximum [n]."""
        return np.asarray(self.own >= 0)

    def others(self, least: int, most: int) -> Ints:
        """Return how many other runs have at most ``most`` pixels and a part of ``least`` [n]."""
        fits = (self.parts >= least) & (self.counts <= most)
        fits[self.own[self.found]] = False
        return np.bincount(self.rows[fits], minlength=len(self.found))
