"""The second window and its baseline, the twin of ``rtl/peak/peak_refine.sv``."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints, Pixels
from vrscan.fixed import cordic_vector as cordic
from vrscan.fixed.divide import divide
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.multiply import latency as multiply_latency

# |P1| / sum of a Gaussian that a window of T = N cuts grows with the width of the cut, from 0 for a
# box to 1 for a spike, so its sigma over N is a function of this share. An entry is for shares of
# 2**-SHARE_BITS of 843 steps, which stand for 1.
SIGMA_FRACTION = 9  # fraction bits of sigma over N
SIGMA_LEAST, SIGMA_LARGEST = 0.1, 0.5
TABLE_BITS = 7
ENTRY_SHIFT = 3  # steps of the quotient per entry, as a power of two
MAGNITUDE_SHIFT, SUM_SHIFT = 12, 2  # bits that the division drops from its operands
SHARE_ONE = cordic.GAIN * pkg.SINE_AMPLITUDE / 2 ** (MAGNITUDE_SHIFT + SUM_SHIFT)

# Width in spot sigmas where the dark variance over the shot noise of the peak is at most 5/64,
# at most 5/16, at most 1, and larger.
WIDTH_FRACTION = 3
WIDTHS = (54, 52, 44, 40)

GAP_SHIFT = 3  # an eighth of the window lies between it and the blocks
PAIRS = 4
BLOCK_BITS = 4  # a block has at most 16 pixels
BRIGHTER_SHIFT = 5  # a pair brighter than the darkest by 32 times the noise is left out
QUOTIENT_WIDTH = 26


@dataclass(frozen=True)
class Refined:
    """Second windows of n lines, int64 [n] each.

    Attributes:
        left: First pixel of the window.
        width: Number of pixels of the window.
        ramp: What the baseline subtracts from the first pixel, aligned counts, 12 fraction bits.
        slope: What the baseline subtracts in addition from pixel to pixel, in the same format.
        sigma: Sigma of the spot, px, 9 fraction bits.
    """

    left: Ints
    width: Ints
    ramp: Ints
    slope: Ints
    sigma: Ints


_PRODUCT_CLKS = multiply_latency(pkg.SLOPE_LEVEL_WIDTH, pkg.ANGLE_WIDTH + 1) + 1
START_LATENCY = 2 * _PRODUCT_CLKS + 4  # clocks from start_i until valid_i may come


def latency() -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``, whatever the window."""
    quotient = divide_latency(QUOTIENT_WIDTH) + 1
    pixels = PAIRS << (BLOCK_BITS + 1)
    return 2 * quotient + 3 * _PRODUCT_CLKS + pixels + 26


@lru_cache(maxsize=1)
def sigma_table() -> Ints:
    """Return sigma over N for every entry, SIGMA_FRACTION fraction bits, to nearest."""
    cut = np.linspace(0.05, 8.0, 1600)
    place = (np.arange(2000) + 0.5) / 1000.0 - 1.0
    profile = np.exp(-0.5 * np.square(cut[:, None] * place))
    share = (profile * np.cos(np.pi * place)).sum(axis=1) / profile.sum(axis=1)
    middle = ((np.arange(1 << TABLE_BITS) << ENTRY_SHIFT) + (1 << (ENTRY_SHIFT - 1))) / SHARE_ONE
    sigma = np.clip(0.5 / np.interp(middle, share, cut), SIGMA_LEAST, SIGMA_LARGEST)
    entries: Ints = np.floor(sigma * (1 << SIGMA_FRACTION) + 0.5).astype(np.int64)
    entries.flags.writeable = False  # one table for all callers
    return entries


def table_source() -> str:
    """Return the package with the table: ``rtl/peak/spot_sigma_pkg.sv``."""
    width = SIGMA_FRACTION
    table = sigma_table()
    lines = [
        "// spot_sigma_pkg: sigma of a spot over the length of its window, by |P1| over the sum.",
        "//",
        "// Generated from vrscan.fixed.peak_refine.sigma_table() by scripts/generate.py.",
        "",
        "`default_nettype none",
        "",
        "package spot_sigma_pkg;",
        f"  localparam int unsigned SigmaFraction = {SIGMA_FRACTION};",
        f"  localparam logic [{width - 1}:0] Largest = {width}'d{table.max()};  // a plateau",
        "",
        f"  function automatic logic [{width - 1}:0] sigma(",
        f"      input logic [{TABLE_BITS - 1}:0] share);",
        "    unique case (share)",
    ]
    previous = -1
    for index, entry in enumerate(table.tolist()):
        lines.append(f"      {TABLE_BITS}'d{index}: sigma = {width}'d{entry};")
        previous = entry
    lines += [
        f"      default: sigma = {width}'d{previous};",
        "    endcase",
        "  endfunction",
        "endpackage",
        "",
        "`default_nettype wire",
        "",
    ]
    return "\n".join(lines)


def _block_sum(total: Ints, first: Ints, size: Ints, whole: Bools) -> Ints:
    """Return the sums of ``size`` pixels from ``first`` on, 0 where the block is not whole."""
    row = np.arange(len(total))
    first = np.where(whole, first, 0)
    return np.asarray(np.where(whole, total[row, first + size] - total[row, first], 0))


def _slope(lines: Pixels, left: Ints, width: Ints, noise: Ints, pixel_width: int) -> Ints:
    """Return the slope beside each window, aligned counts per px, 12 fraction bits, [n]."""
    count, length = lines.shape
    total = np.zeros((count, length + 1), np.int64)
    np.cumsum(lines, axis=1, out=total[:, 1:])
    bits = np.minimum(np.floor(np.log2(width)).astype(np.int64), BLOCK_BITS)
    size, gap = 1 << bits, width >> GAP_SHIFT
    never = np.int64(1) << (pixel_width + BLOCK_BITS + 2)  # larger than every sum
    sums = np.full((count, PAIRS), never)
    rises, distances = np.zeros((2, count, PAIRS), np.int64)
    for k in range(PAIRS):
        near = gap + k * size
        first, last = left - near - size, left + width + near
        whole = (first >= 0) & (last + size <= length)
        below, above = (_block_sum(total, place, size, whole) for place in (first, last))
        sums[:, k] = np.where(whole, above + below, never)
        rises[:, k] = above - below
        distances[:, k] = width + 2 * near + size
    excess = (sums - sums.min(axis=1)[:, None]) << (pkg.COUNT_WIDTH - pixel_width)
    kept = (sums < never) & (excess <= (noise << BRIGHTER_SHIFT)[:, None])
    rise = (rises * kept).sum(axis=1)
    span = (distances * kept).sum(axis=1)
    shift = pkg.ALIGNED_WIDTH - pixel_width + pkg.RAMP_FRACTION - BLOCK_BITS
    scaled = np.abs(rise) << (shift + BLOCK_BITS - bits)
    slope, _ = divide(scaled, np.maximum(span, 1), quotient_width=QUOTIENT_WIDTH)
    return np.asarray(np.where(rise < 0, -slope, slope))


def peak_refine(
    lines: Pixels,
    *,
    left: Ints,
    width: Ints,
    phase: Ints,
    magnitude: Ints,
    sum: Ints,
    maximum: Ints,
    background: Ints,
    noise: Ints,
    pixel_width: int,
    max_window: int,
    kappa: int,
) -> Refined:
    """Return the window that suits spot and noise, and the slope of the background beside it.

    The first window's |P1| / sum gives the spot's sigma, and the noise gives the width in sigmas.
    The middle of the window is the first position, or the middle of the first window where that
    holds a plateau. The line's end cuts the window; where fewer than 3 pixels are left, the first
    window is kept.

    The slope is that between PAIRS blocks of up to 16 pixels on either side. Light is never
    negative: pairs of blocks at equal distances that are brighter than the darkest pair by more
    than the noise hold a rival and are left out, as are those that the line's end cuts; without any
    pair the slope is 0.

    Args:
        lines: Pixels, [n, line_length].
        left: First pixel of the first window, [n].
        width: Number of pixels of the first window, 3 to 255, [n].
        phase: Phase of its first harmonic, T = N, fraction of a turn, 24 bits, [n].
        magnitude: Magnitude of its first harmonic from ``phase_correlate``, [n].
        sum: Sum of its heights, aligned counts, [n].
        maximum: Largest pixel, counts, [n].
        background: Level of the background, counts, 24 - PixelWidth fraction bits, [n].
        noise: Noise of the background in the same format, at most half of full scale, [n].
        pixel_width: ``PixelWidth`` of the module.
        max_window: ``MaxWindow`` of the module.
        kappa: Counts per electron, 28 - PixelWidth fraction bits.

    Returns:
        The second window of every line.
    """
    quotient, _ = divide(
        magnitude >> MAGNITUDE_SHIFT, sum << SUM_SHIFT, quotient_width=QUOTIENT_WIDTH
    )
    table = sigma_table()
    share = table[np.minimum(quotient >> ENTRY_SHIFT, (1 << TABLE_BITS) - 1)]
    dark = (noise * noise) << 4  # kappa has 4 fraction bits more than a count
    shot = kappa * ((maximum << (pkg.COUNT_WIDTH - pixel_width)) - background)
    rung = (dark > shot).astype(np.int64) + (dark << 4 > 5 * shot) + (dark << 6 > 5 * shot)
    shift = SIGMA_FRACTION + WIDTH_FRACTION
    wanted = (width * share * np.array(WIDTHS)[rung] + (1 << (shift - 1))) >> shift
    wanted = np.clip(wanted, pkg.MIN_WINDOW, max_window)

    half_pixels = np.where(
        share == table.max(), width - 1, (phase * width) >> (pkg.ANGLE_WIDTH - 1)
    )
    first = (2 * left + half_pixels + 2 - wanted) >> 1
    last = np.minimum(first + wanted - 1, lines.shape[1] - 1)
    first = np.maximum(first, 0)
    kept = last - first + 1 >= pkg.MIN_WINDOW
    first = np.where(kept, first, left)
    count = np.where(kept, last - first + 1, width)

    slope = _slope(lines, first, count, noise, pixel_width)
    ramp = -((slope * (count - 1)) >> 1)  # the ramp is 0 in the window's middle
    return Refined(left=first, width=count, ramp=ramp, slope=slope, sigma=width * share)
