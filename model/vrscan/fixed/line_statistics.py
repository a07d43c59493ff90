"""Moments of a line and of its background, the twin of ``rtl/sensor/line_statistics.sv``."""

from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints, Pixels
from vrscan.fixed.divide import divide
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.square_root import latency as square_root_latency
from vrscan.fixed.square_root import square_root

ROOT_FRACTION = 4  # fraction bits of n times the standard deviation, ``RootFraction``


@dataclass(frozen=True)
class LineStatistics:
    """Statistics of n lines, int64 [n] each, in the formats of ``rtl/vrscan_pkg.sv``.

    Attributes:
        maximum: Largest pixel, counts.
        max_index: First place of the maximum, px.
        row_mean: Mean of the whole line, counts, 24 - PixelWidth fraction bits.
        row_variance: Population variance of the whole line, counts^2, 32 - 2 PixelWidth.
        background: Mean of the blocks beside the maximum, or of the row where ``row_statistics``;
            format of ``row_mean``.
        noise: Standard deviation within these blocks, or of the row; format of ``row_mean``.
        spread: Standard deviation of all that a window cannot reach, from block to block too, or
            of the row; format of ``row_mean``.
        row_statistics: Whether the row is used because no block of background was left, bool [n].
    """

    maximum: Ints
    max_index: Ints
    row_mean: Ints
    row_variance: Ints
    background: Ints
    noise: Ints
    spread: Ints
    row_statistics: Bools


def guard_blocks(max_window: int) -> int:
    """Return the number of blocks on either side of the maximum's that a window can reach."""
    return -(-max_window // pkg.BLOCK_LENGTH)


def latency(line_length: int, pixel_width: int, max_window: int) -> int:
    """Return the clocks from ``good_i`` to ``valid_o``."""
    index_width = (line_length - 1).bit_length()
    length_width = line_length.bit_length()
    sum_width = pixel_width + index_width
    guard = guard_blocks(max_window)
    pairs = 2 * guard
    moment_bits = (pkg.BLOCK_LENGTH * pkg.PART_LENGTH).bit_length() - 2  # of a pair, over 2 P
    pair_moment_width = 2 * pixel_width + moment_bits + (guard - 1).bit_length()
    product = 1 + multiply_latency(
        max(2 * pixel_width + index_width, pair_moment_width) + 1,
        max(sum_width, length_width) + 1,
    )
    quotient = 1 + divide_latency(pkg.VARIANCE_WIDTH)
    root = 1 + square_root_latency(sum_width - 1 + ROOT_FRACTION)
    # All start in the clock in which the sums of all blocks are known.
    select = 6 + 2 * pairs + 1 + 4
    ranked = pairs * (pairs + 3) + 1
    spread = max(2 * quotient, 4 * product + root) + 1 + quotient
    background = max(spread, ranked) + 1 + quotient
    noise = max(background, max(4 * product + root, ranked) + 1 + product + root) + 1 + quotient
    return select + noise


def line_statistics(
    lines: Pixels, *, pixel_width: int, max_window: int, noise_row: bool
) -> LineStatistics:
    """Return the statistics of every line exactly as the hardware rounds them.

    Background and noise are those beside the maximum: of the pairs of whole blocks of 64 pixels at
    one distance from the maximum's, from 2 to twice ``guard_blocks`` away, the darkest ones, at
    most ``guard_blocks`` of them and no more than there are beyond the guard. Flanks of a spot are
    in the blocks next to the maximum's, a window reaches ``guard_blocks`` at most, and light only
    adds, so the darkest hold neither spot nor rival. The noise is that within their parts of 16
    pixels, the spread that of all blocks beyond the guard. The population mean and variance over
    the row are those of VR-SCAN, IV-G1.

    Args:
        lines: Pixels below 2**pixel_width, [n, line_length].
        pixel_width: ``PixelWidth`` of the module, 8..16.
        max_window: ``MaxWindow`` of the module, at most 255.
        noise_row: Whether to use the statistics of the row, ``noise_row_i``.

    Returns:
        The statistics, n entries each.

    Raises:
        ValueError: if a line is shorter than a block, or a pixel does not fit.
    """
    count, length = lines.shape
    block = pkg.BLOCK_LENGTH
    if length < block:
        raise ValueError(f"line_statistics: lines of {length} pixels, at least {block} are needed")
    maximum = lines.max(axis=1, initial=0).astype(np.int64)
    if count and maximum.max() >> pixel_width:
        raise ValueError(f"line_statistics: a pixel does not fit in {pixel_width} bits")
    max_index = lines.argmax(axis=1).astype(np.int64)

    blocks = -(-length // block)
    if length % block:
        padded = np.zeros((count, blocks * block), np.int64)
        padded[:, :length] = lines
    else:
        padded = lines.astype(np.int64)
    pixels = padded.reshape(count, blocks, block)
    sums = np.einsum("nbk->nb", pixels)
    squares = np.einsum("nbk,nbk->nb", pixels, pixels)
    parts = pixels.reshape(count, blocks, block // pkg.PART_LENGTH, pkg.PART_LENGTH).sum(axis=3)
    within = pkg.PART_LENGTH * squares - np.einsum("nbk,nbk->nb", parts, parts)
    lengths = np.full(blocks, block, np.int64)
    lengths[-1] = length - (blocks - 1) * block

    distance = np.abs(np.arange(blocks) - (max_index // block)[:, None])
    away = distance > guard_blocks(max_window)
    row_sum, row_square = sums.sum(axis=1), squares.sum(axis=1)
    pair_sums, pair_moments, kept = _darkest_pairs(
        sums[:, : length // block], within[:, : length // block], max_index // block, max_window
    )
    no_block = kept == 0
    use_row = no_block | noise_row
    rest_length = np.where(use_row, length, (away * lengths).sum(axis=1))
    rest_sum = np.where(use_row, row_sum, (away * sums).sum(axis=1))
    rest_square = np.where(use_row, row_square, (away * squares).sum(axis=1))
    pixels_kept = np.where(use_row, length, 2 * block * kept)

    mean_shift = pkg.COUNT_WIDTH - pixel_width
    variance_shift = pkg.VARIANCE_WIDTH - 2 * pixel_width
    root_width = pixel_width + (length - 1).bit_length() - 1 + ROOT_FRACTION
    row_moment = length * row_square - row_sum * row_sum

    def quotient(dividend: Ints, divisor: Ints | np.int64) -> Ints:
        return divide(dividend, divisor, quotient_width=pkg.VARIANCE_WIDTH)[0]

    def deviation(moment: Ints, count: Ints) -> Ints:
        """Return the standard deviation whose variance is ``moment / count**2``."""
        root = square_root(moment << (2 * ROOT_FRACTION), root_width=root_width)
        return quotient(root << (mean_shift - ROOT_FRACTION), count)

    spread = deviation(rest_length * rest_square - rest_sum * rest_sum, rest_length)
    # Of n parts of 16 pixels the variance is sum(within) / (n 16 15); a pair has 8 parts.
    free = pkg.PART_LENGTH - 1
    freedom = np.where(use_row, 1, free * pkg.PART_LENGTH * kept)
    noise = deviation(np.where(use_row, 0, 2 * free * kept * pair_moments), freedom)
    return LineStatistics(
        maximum=maximum,
        max_index=max_index,
        row_mean=quotient(row_sum << mean_shift, np.int64(length)),
        row_variance=quotient(row_moment << variance_shift, np.int64(length * length)),
        background=quotient(np.where(use_row, row_sum, pair_sums) << mean_shift, pixels_kept),
        noise=np.where(use_row, spread, noise),
        spread=spread,
        row_statistics=no_block & (not noise_row),
    )


def _darkest_pairs(
    sums: Ints, within: Ints, max_block: Ints, max_window: int
) -> tuple[Ints, Ints, Ints]:
    """Return the sums and moments of the darkest pairs, and how many there are, [n] each.

    Args:
        sums: Sums of the whole blocks, [n, blocks].
        within: Their moments within parts of 16 pixels, [n, blocks].
        max_block: Block of the maximum, [n].
        max_window: ``MaxWindow`` of the module.
    """
    blocks = sums.shape[1]
    guard = guard_blocks(max_window)
    distance = np.arange(2, 2 * guard + 1)
    left, right = max_block[:, None] - distance, max_block[:, None] + distance
    has_left, has_right = left >= 0, right < blocks
    # Where a line has one block of a pair only, it counts for both.
    left, right = np.where(has_left, left, right), np.where(has_right, right, left)
    there = has_left | has_right
    left, right = np.where(there, (left, right), 0)
    row = np.arange(len(sums))[:, None]
    pair_sums = np.where(there, sums[row, left] + sums[row, right], np.iinfo(np.int64).max)
    pair_moments = within[row, left] + within[row, right]
    kept = np.clip(there.sum(axis=1) + 1 - guard, 0, guard)
    rank = np.argsort(np.argsort(pair_sums, axis=1, kind="stable"), axis=1, kind="stable")
    dark = rank < kept[:, None]  # of equal ones the nearer
    return (dark * pair_sums).sum(axis=1), (dark * pair_moments).sum(axis=1), kept
