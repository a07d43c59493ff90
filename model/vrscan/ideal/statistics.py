"""Mean and noise of a line: of its whole row, and of its background away from the peak."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels

BLOCK_LENGTH = 64  # px


@dataclass(frozen=True)
class Statistics:
    """Statistics of n lines, counts; all arrays [n]."""

    maximum: Ints
    first_maximum: Ints  # first index of the maximum, px
    row_mean: Floats
    row_variance: Floats  # counts squared
    background: Floats
    noise: Floats
    row_only: Bools  # no background block was left, so the row's statistics are used


def statistics(lines: Pixels, *, max_window: int) -> Statistics:
    """Return maximum, mean and variance of each row, and mean and noise of its background.

    VR-SCAN, section IV-G 1: maximum, average and variance of each row. The row includes the peak,
    which biases the noise, so the background leaves out the block of 64 pixels that holds the
    first maximum and as many blocks on either side as the longest window may cover.

    Args:
        lines: Counts [n, length].
        max_window: Longest window, px.

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
    row_only = ~kept.any(axis=1)
    kept |= row_only[:, None]

    def moments(where: Bools) -> tuple[Floats, Floats]:
        weight = (where * sizes).sum(axis=1)
        total = (where * sums).sum(axis=1)
        # Integer numerator: the difference is exact and never below zero.
        spread = weight * (where * squares).sum(axis=1) - np.square(total)
        return total / weight, spread / np.square(weight, dtype=np.float64)

    row_mean, row_variance = moments(np.ones((count, len(starts)), np.bool_))
    background, variance = moments(kept)
    return Statistics(
        maximum=lines.max(axis=1).astype(np.int64),
        first_maximum=first_maximum.astype(np.int64),
        row_mean=row_mean,
        row_variance=row_variance,
        background=background,
        noise=np.sqrt(variance),
        row_only=row_only,
    )
