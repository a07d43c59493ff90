"""The window of the peak, the twin of ``rtl/peak/peak_isolate.sv``."""

from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints, Pixels
from vrscan.fixed import line_buffer
from vrscan.fixed.line_statistics import LineStatistics
from vrscan.fixed.multiply import latency as multiply_latency

LARGEST_WINDOW = (1 << pkg.WINDOW_WIDTH) - 1


@dataclass(frozen=True)
class Windows:
    """Windows of n lines, one entry each.

    Attributes:
        measured: Whether the window goes to the phase detector.
        left: First pixel above the threshold; the maximum's place where no pixel is above it.
        right: Last pixel above the threshold; the maximum's place where no pixel is above it.
        width: Number of pixels in the window, 0 where the maximum is not above the threshold.
        flags: Bits LOW_SNR to RIVAL of ``pkg.FLAGS``.
    """

    measured: Bools
    left: Ints
    right: Ints
    width: Ints
    flags: Ints


def replay_latency() -> int:
    """Return the clocks from ``valid_i`` to ``replay_o``."""
    return 3 * (multiply_latency(pkg.COUNT_WIDTH + 1, 17) + 1) + 3


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
) -> Windows:
    """Return the run of pixels above the threshold that holds the maximum (VR-SCAN, III-E).

    Args:
        lines: Pixels, [n, line_length].
        statistics: Statistics of the lines; ``background`` and ``noise`` are used.
        pixel_width: ``PixelWidth`` of the module.
        max_window: ``MaxWindow`` of the module.
        k_noise: Threshold above the background over the noise, 8 fraction bits.
        k_height: Threshold above the background over the peak's height, 16 fraction bits.
        snr_min: Least signal-to-noise ratio, 8 fraction bits.
        min_width: Least width; below 3 counts as 3.
        max_width: Largest width; above ``max_window`` counts as ``max_window``.

    Returns:
        One window for each line.
    """
    count, length = lines.shape
    shift = pkg.COUNT_WIDTH - pixel_width
    min_width = max(min_width, pkg.MIN_WINDOW)
    max_width = min(max_width, max_window)

    height = (statistics.maximum << shift) - statistics.background
    noise_term = (statistics.noise * k_noise + (1 << (pkg.K_NOISE_FRACTION - 1))) >> (
        pkg.K_NOISE_FRACTION
    )
    height_term = (height * k_height + (1 << (pkg.K_HEIGHT_FRACTION - 1))) >> pkg.K_HEIGHT_FRACTION
    threshold = statistics.background + np.maximum(noise_term, height_term)
    low_snr = (height == 0) | ((height << pkg.SNR_FRACTION) < snr_min * statistics.noise)

    # pixel 2**shift > threshold is pixel > floor(threshold / 2**shift).
    limit = np.minimum(threshold >> shift, (1 << 16) - 1).astype(np.uint16)
    stride = length + 2
    above = np.zeros((count, stride), np.bool_)
    np.greater(lines, limit[:, None], out=above[:, 1:-1])
    flat = above.reshape(-1)
    edges = np.flatnonzero(flat[1:] != flat[:-1])
    starts, ends = edges[0::2], edges[1::2]  # a run is [start, end) in columns of ``lines``
    widths = ends - starts
    rows = starts // stride

    row = np.arange(count)
    peak = row * stride + statistics.max_index
    run = np.searchsorted(starts, peak, side="right") - 1
    if starts.size:
        found = (run >= 0) & (ends[run] > peak)
    else:
        found = np.zeros(count, np.bool_)
    run = np.where(found, run, 0)
    if starts.size:
        left = np.where(found, starts[run] - row * stride, statistics.max_index)
        width = np.where(found, widths[run], 0)
    else:
        left, width = statistics.max_index, np.zeros(count, np.int64)
    right = np.where(found, left + width - 1, statistics.max_index)

    wide_runs = np.bincount(rows[widths >= min_width], minlength=count)
    rival = wide_runs > (found & (width >= min_width))

    too_narrow, too_wide = width < min_width, width > max_width
    at_edge = found & ((left == 0) | (right == length - 1))
    saturated = statistics.maximum == (1 << pixel_width) - 1
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
    return Windows(~(low_snr | too_narrow | too_wide), left, right, width, flags)
