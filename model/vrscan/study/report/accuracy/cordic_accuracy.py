"""Accuracy of cordic_vector at its shipped widths against atan2 in float64."""

import math

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints
from vrscan.data.residuals import rms
from vrscan.fixed.cordic_vector import angle_bounds, cordic_vector
from vrscan.study.report.figure import SEED, Figure, largest

LIMIT_PEAK, LIMIT_RMS = 1.1, 0.36  # steps
LEAST_AMPLITUDE = 2.0**-20  # share of full scale
GROUP = "cordic_vector, angle"

_TURN = 1 << pkg.ANGLE_WIDTH
_FULL = (1 << (pkg.HARMONIC_WIDTH - 1)) - 1


def _vectors(low: float, high: float, count: int, draw: np.random.Generator) -> tuple[Ints, Ints]:
    """Return vectors of amplitudes from low to high, shares of full scale; int64 [n, 2].

    They are vectors of any direction, then the axes, the diagonals and their nearest neighbours.
    """
    size = _FULL * np.exp(draw.uniform(np.log(low), np.log(high), count))
    size[:2] = _FULL * np.array([low, high])
    direction = draw.uniform(0.0, 2.0 * np.pi, count)
    around = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    anywhere = np.rint(size[:, None] * around).astype(np.int64)

    side = size[: max(2, count // 100)].astype(np.int64)
    near = np.array([-2, -1, 0, 1, 2])
    signs = np.array([-1, 1])
    axes = np.stack(np.broadcast_arrays(side[:, None, None] * signs, near[:, None]), axis=-1)
    up = signs[:, None] * (side[:, None, None, None] + near[:, None, None])
    diagonals = np.stack(np.broadcast_arrays(side[:, None, None, None] * signs, up), axis=-1)
    marks = [axes.reshape(-1, 2), axes.reshape(-1, 2)[:, ::-1], diagonals.reshape(-1, 2)]
    return anywhere, np.clip(np.concatenate(marks), -_FULL - 1, _FULL)


def errors(vectors: Ints) -> Floats:
    """Return the angle's error of each vector in steps of 2**-24 turns, [n].

    Args:
        vectors: x and y in 48 bits, not both 0, [n, 2]; exact in float64.
    """
    x, y = vectors.T
    angle, _, _ = cordic_vector(x, y, xy_width=pkg.HARMONIC_WIDTH, angle_width=pkg.ANGLE_WIDTH)
    exact = np.arctan2(y.astype(np.float64), x.astype(np.float64)) * (_TURN / (2.0 * np.pi))
    return np.asarray((angle - exact + _TURN / 2) % _TURN - _TURN / 2)


def measure(count: int) -> list[Figure]:
    """Return peak and rms of the angle's error for every decade of the input's amplitude.

    Args:
        count: Number of random vectors per decade; the peak is also taken over axes and diagonals,
            where the error is almost zero.
    """
    draw = np.random.default_rng([SEED, 1])
    predicted_peak, predicted_rms = angle_bounds(pkg.ANGLE_WIDTH)
    figures = []
    for decade in range(7):
        high = 10.0**-decade
        low = max(high / 10.0, LEAST_AMPLITUDE)
        anywhere, marks = _vectors(low, high, count, draw)
        error = errors(anywhere)
        peak = max(largest(error), largest(errors(marks)))
        bottom = "2^-20" if low == LEAST_AMPLITUDE else f"1e-{decade + 1}"
        top = f"1e-{decade}" if decade else "1"
        name = f"amplitude {top} to {bottom} of full scale"
        figures += [
            Figure(
                GROUP,
                f"{name}, peak",
                "steps",
                peak,
                predicted_peak,
                0.5,
                LIMIT_PEAK,
                headline="CORDIC angle, full scale to 2^-20, peak",
            ),
            Figure(
                GROUP,
                f"{name}, rms",
                "steps",
                rms(error),
                predicted_rms,
                1.0 / math.sqrt(12.0),
                LIMIT_RMS,
                headline="CORDIC angle, full scale to 2^-20, rms",
            ),
        ]
    return figures
