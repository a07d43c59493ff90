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
        background: Mean of the background, or of the row where ``row_statistics``; format of
            ``row_mean``.
        noise: Standard deviation of the background, or of the row; format of ``row_mean``.
        row_statistics: Whether the row is used because no block of background was left, bool [n].
    """

    maximum: Ints
    max_index: Ints
    row_mean: Ints
    row_variance: Ints
    background: Ints
    noise: Ints
    row_statistics: Bools


def guard_blocks(max_window: int) -> int:
    """Return the number of blocks on either side of the maximum's that a window can reach."""
    return -(-max_window // pkg.BLOCK_LENGTH)


def latency(line_length: int, pixel_width: int, max_window: int) -> int:
    """Return the clocks from ``good_i`` to ``valid_o``."""
    index_width = (line_length - 1).bit_length()
    length_width = line_length.bit_length()
    sum_width = pixel_width + index_width
    product = 1 + multiply_latency(
        2 * pixel_width + index_width + 1, max(sum_width, length_width) + 1
    )
    quotient = 1 + divide_latency(pkg.VARIANCE_WIDTH)
    root = 1 + square_root_latency(sum_width - 1 + ROOT_FRACTION)
    # Both start in the clock in which the sums of the background are known.
    select = 4 + 2 * guard_blocks(max_window) + 1 + 4
    return select + max(3 * quotient, 4 * product + root + 1) + 1 + quotient


def line_statistics(
    lines: Pixels, *, pixel_width: int, max_window: int, noise_row: bool
) -> LineStatistics:
    """Return the statistics of every line exactly as the hardware rounds them.

    The background leaves out the maximum's block of 64 pixels and ``guard_blocks`` on either
    side; the population mean and variance over the row are those of VR-SCAN, IV-G1.

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
    lengths = np.full(blocks, block, np.int64)
    lengths[-1] = length - (blocks - 1) * block

    distance = np.abs(np.arange(blocks) - (max_index // block)[:, None])
    away = distance > guard_blocks(max_window)
    row_sum, row_square = sums.sum(axis=1), squares.sum(axis=1)
    rest_length = (away * lengths).sum(axis=1)
    no_block = rest_length == 0
    use_row = no_block | noise_row
    rest_sum = np.where(use_row, row_sum, (away * sums).sum(axis=1))
    rest_square = np.where(use_row, row_square, (away * squares).sum(axis=1))
    rest_length = np.where(use_row, length, rest_length)

    mean_shift = pkg.COUNT_WIDTH - pixel_width
    variance_shift = pkg.VARIANCE_WIDTH - 2 * pixel_width
    root_width = pixel_width + (length - 1).bit_length() - 1 + ROOT_FRACTION
    row_moment = length * row_square - row_sum * row_sum
    rest_moment = rest_length * rest_square - rest_sum * rest_sum
    root = square_root(rest_moment << (2 * ROOT_FRACTION), root_width=root_width)

    def quotient(dividend: Ints, divisor: Ints | np.int64) -> Ints:
        return divide(dividend, divisor, quotient_width=pkg.VARIANCE_WIDTH)[0]

    return LineStatistics(
        maximum=maximum,
        max_index=max_index,
        row_mean=quotient(row_sum << mean_shift, np.int64(length)),
        row_variance=quotient(row_moment << variance_shift, np.int64(length * length)),
        background=quotient(rest_sum << mean_shift, rest_length),
        noise=quotient(root << (mean_shift - ROOT_FRACTION), rest_length),
        row_statistics=no_block & (not noise_row),
    )
