"""Mean and noise of a line: of its whole row, and of its background beside the peak."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels

BLOCK_LENGTH = 64  # px
PART_LENGTH = 16  # px of a part of a block


@dataclass(frozen=True)
class Statistics:
    """Statistics of n lines, counts; all arrays [n]."""

    maximum: Ints
    first_maximum: Ints  # first index of the maximum, px
    row_mean: Floats
    row_variance: Floats  # counts squared
    background: Floats
    noise: Floats
    spread: Floats  # deviation of all that no window reaches, from block to block too
    row_only: Bools  # no background block was left, so the row's statistics are used


def statistics(lines: Pixels, *, max_window: int, noise_row: bool = False) -> Statistics:
    """Return maximum, mean and variance of each row, and mean and noise of its background.

    VR-SCAN, section IV-G 1: maximum, average and variance of each row. The row includes the peak,
    which biases the noise, and its background need not be even. So background and noise are those
    beside the peak: of pairs of whole blocks of 64 pixels at one distance from the block that holds
    the first maximum, from 2 to twice as many as the longest window may cover, the darkest ones.
    Their number is that of the pairs beyond the longest window. A block without a partner on the
    line stands for both. The noise is that within parts of 16 pixels, so it leaves out a gradient.

    Args:
        lines: Counts [n, length].
        max_window: Longest window, px.
        noise_row: Whether background, noise and spread are the row's everywhere, as the paper has
            it.

    Returns:
        The statistics of n lines.
    """
    pixels = lines.astype(np.float64)  # sums below are of integers below 2**53, hence exact
    count, length = pixels.shape
    first_maximum = np.argmax(pixels, axis=1)
    starts = np.arange(0, length, BLOCK_LENGTH)
    sizes = np.diff(np.append(starts, length))
    sums = np.add.reduceat(pixels, starts, axis=1)
    squares = np.add.reduceat(np.square(pixels), starts, axis=1)

    guard = -(-max_window // BLOCK_LENGTH)
    distance = np.abs(np.arange(len(starts)) - first_maximum[:, None] // BLOCK_LENGTH)
    kept = distance > guard
    kept |= ~kept.any(axis=1)[:, None]  # the row's deviation stands there

    def moments(where: Bools) -> tuple[Floats, Floats]:
        weight = (where * sizes).sum(axis=1)
        total = (where * sums).sum(axis=1)
        # Integer numerator: the difference is exact and never below zero.
        spread = weight * (where * squares).sum(axis=1) - np.square(total)
        return total / weight, spread / np.square(weight, dtype=np.float64)

    row_mean, row_variance = moments(np.ones((count, len(starts)), np.bool_))
    spread = np.sqrt(moments(kept)[1])

    # Whole blocks only; beyond the line's ends there is nothing, NaN.
    means, variances = (
        np.pad(np.where(sizes == BLOCK_LENGTH, values, np.nan), ((0, 0), (2 * guard, 2 * guard)),
               constant_values=np.nan)
        for values in (sums / sizes, _within_parts(pixels, len(starts)))
    )  # fmt: skip
    distance = np.arange(2, 2 * guard + 1)  # flanks of a spot are in the nearest
    centre = first_maximum[:, None] // BLOCK_LENGTH + 2 * guard

    def paired(values: Floats) -> Floats:
        left = np.take_along_axis(values, centre - distance, axis=1)
        right = np.take_along_axis(values, centre + distance, axis=1)
        left, right = np.where(np.isnan(left), right, left), np.where(np.isnan(right), left, right)
        return np.asarray((left + right) / 2.0)

    pair_means, pair_variances = paired(means), paired(variances)
    darkest = np.argsort(pair_means, axis=1, kind="stable")  # what is not there comes last
    number = np.clip(np.isfinite(pair_means).sum(axis=1) + 1 - guard, 0, guard)
    row_only = number == 0
    taken = np.arange(len(distance)) < number[:, None]

    def local(values: Floats) -> Floats:
        chosen = np.where(taken, np.take_along_axis(values, darkest, axis=1), 0.0)
        return np.asarray(chosen.sum(axis=1) / np.maximum(number, 1))

    row_deviation = np.sqrt(row_variance)
    by_row = row_only | noise_row
    return Statistics(
        maximum=lines.max(axis=1).astype(np.int64),
        first_maximum=first_maximum.astype(np.int64),
        row_mean=row_mean,
        row_variance=row_variance,
        background=np.where(by_row, row_mean, local(pair_means)),
        noise=np.where(by_row, row_deviation, np.sqrt(local(pair_variances))),
        spread=np.where(by_row, row_deviation, spread),
        row_only=row_only,
    )


def _within_parts(pixels: Floats, blocks: int) -> Floats:
    """Return the mean sample variance of the parts of each block, [n, blocks]."""
    padded = np.zeros((len(pixels), blocks * BLOCK_LENGTH))
    padded[:, : pixels.shape[1]] = pixels
    parts = padded.reshape(len(pixels), blocks, BLOCK_LENGTH // PART_LENGTH, PART_LENGTH)
    return np.asarray(parts.var(axis=3, ddof=1).mean(axis=2))
