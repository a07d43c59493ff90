"""Detectors for speckled spots, whose flanks tell as much of the position as their tops.

Speckle multiplies the light: the logarithm of a height has the same noise wherever light leads, and
a root less at the flanks than the height has over its own size. So heights are raised to a power,
or their logarithm is taken, before the first harmonic of VR-SCAN (8); or each height is divided by
the Gaussian itself, which makes it the amplitude plus noise (``vrscan.ideal.peak_fit``).
"""

from collections.abc import Callable

import numpy as np

from vrscan.data.arrays import Floats, Pixels
from vrscan.detectors.patch import (
    K_HEIGHT,
    K_NOISE,
    LEAST_SNR,
    REACH,
    Patch,
    columns,
    cut,
    place,
    run,
)
from vrscan.ideal.peak_fit import CUT, LN4, SCALE

_LEAST_SIGMA = 0.3  # px
_MOST_PASSES = 5  # from the centroid to a window that no longer moves
_LEAST_PIXELS = 4
_MOST_MOVE = 1.0  # widths of the spot, in one step of a fit

Transform = Callable[[Floats, Floats], Floats]  # of heights and noise [n, m], in counts


def power(exponent: float) -> Transform:
    """Return the power of a height, with its sign: noise around 0 stays around 0."""
    return lambda height, _: np.sign(height) * np.abs(height) ** exponent


def logarithm(height: Floats, noise: Floats) -> Floats:
    """Return log(1 + height / noise), with its sign."""
    over = np.abs(height) / np.maximum(noise, np.finfo(float).tiny)
    return np.asarray(np.sign(height) * np.log1p(over))


def _moments(patch: Patch, noise: Floats) -> tuple[Floats, Floats]:
    """Return centroid and standard deviation of the light above the shipped threshold [n], px.

    The largest pixel, from which ``patch.shape`` has the width, is a bright speckle.
    """
    mask = run(patch, np.maximum(K_NOISE * noise, K_HEIGHT * patch.height))
    light = np.where(mask & patch.found[:, None], patch.signal, 0.0)
    area = np.maximum(light.sum(axis=1), np.finfo(float).tiny)
    step = columns()
    centre = light @ step / area
    square = (light * np.square(step - centre[:, None])).sum(axis=1) / area
    return centre, np.maximum(np.sqrt(square), _LEAST_SIGMA)


def harmonic(
    lines: Pixels, background: Floats, noise: Floats, *, widths: float, transform: Transform
) -> Floats:
    """Return the phase of the first harmonic of transformed heights [n], px; (8) with T = N.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        widths: Width of the window, standard deviations of the spot; it lies around the position,
            which is found again until the window stays.
        transform: What is done to the heights first.
    """
    patch = cut(lines, background, noise)
    at, sigma = _moments(patch, noise)
    height = transform(patch.signal, noise[:, None])
    period = np.clip(np.round(widths * sigma), _LEAST_PIXELS, 2 * REACH + 1)[:, None]
    step = columns()
    for _ in range(_MOST_PASSES):
        left = np.round(at[:, None] - 0.5 * (period - 1.0))
        inside = (step >= left) & (step < left + period) & patch.inside
        turn = np.exp(2j * np.pi * (step - left) / period)
        sums = np.where(inside, height * turn, 0.0).sum(axis=1)
        at = left[:, 0] + np.angle(sums) % (2.0 * np.pi) * period[:, 0] / (2.0 * np.pi)
    return place(patch, at)


def weighted(
    lines: Pixels,
    background: Floats,
    noise: Floats,
    kappa: float,
    *,
    steps: int,
    contrast: float,
    full: int,
    start: Floats | None = None,
    dark: bool = True,
) -> Floats:
    """Return the place after some steps of the weighted fit, with amplitude and width as measured.

    A height over the Gaussian 2**-(u**2) is the amplitude A; a wrong place gives these quotients a
    slope. Their variance is R h**2 + K A h + C**2 A**2, h = 2**(u**2).

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        kappa: Counts per electron.
        steps: Number of steps.
        contrast: C of the speckle.
        full: Full scale, counts, which carries no information.
        start: Positions to begin with, px, NaN where there is none [n]; the centroid if None.
        dark: Whether read and shot noise are in the weights, too.
    """
    patch = cut(lines, background, noise)
    at, sigma = _moments(patch, noise)
    if start is not None:
        at = np.where(np.isnan(start), at, start - patch.peak)
    scale = SCALE * sigma
    step, usable = columns(), patch.inside & (patch.raw < full)
    for _ in range(steps):
        u = (step - at[:, None]) / scale[:, None]
        square = np.square(u)
        inside = usable & (square < CUT)
        h = np.exp2(np.minimum(square, CUT))
        q = patch.signal * h
        top = inside & (square < 1.0)
        amplitude = np.where(top, q, 0.0).sum(axis=1) / np.maximum(top.sum(axis=1), 1)
        amplitude = np.maximum(amplitude, LEAST_SNR * np.maximum(noise, 1.0))
        speckle = np.square(contrast * amplitude)[:, None]
        own = np.square(noise[:, None] * h) + kappa * amplitude[:, None] * h if dark else 0.0
        y = np.where(inside, 1.0 / (own + speckle), 0.0)
        told = np.maximum((y * square).sum(axis=1), np.finfo(float).tiny)
        move = (y * (q - amplitude[:, None]) * u).sum(axis=1) / (told * amplitude * LN4)
        at = at + np.clip(move, -_MOST_MOVE, _MOST_MOVE) * scale
    found = place(patch, at)
    return found if start is None else np.where(np.isnan(start), np.nan, found)
