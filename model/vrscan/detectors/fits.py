"""Gaussian fits: least squares, and maximum likelihood under shot and read noise.

Both have three unknowns, height, centre and width; the background is known. They take damped
Gauss-Newton steps (Levenberg 1944, Marquardt 1963) on all lines at once. Centre and width are
fitted in units of the first guess of the width, so one damping serves all three. Pixels at full
scale carry no information about the shape and are left out.
"""

import warnings
from collections.abc import Callable

import numpy as np
from scipy.special import erf

from vrscan.data.arrays import Bools, Floats, Pixels
from vrscan.detectors.patch import Patch, columns, cut, place, shape

_STEPS = 40
_CLOSE = 1e-5  # px: a smaller step ends the fit
_LEAST_WIDTH, _MOST_WIDTH = 0.25, 64.0  # px
_LEAST_VARIANCE = 1.0 / 12.0  # counts^2: variance of the converter's step
_ROOT2PI = np.sqrt(2.0 * np.pi)

# From height, centre and width [n] each to the profile and its three derivatives, [n, m] each.
Model = Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats, Floats, Floats]]


def sampled(
    step: Floats, height: Floats, centre: Floats, width: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return A exp(-(i - mu)^2 / 2 s^2) and its derivatives by A, mu and s, all [n, m].

    Args:
        step: Positions i of the pixels [m].
        height: Heights A [n].
        centre: Centres mu [n].
        width: Widths s [n].
    """
    away = (step - centre[:, None]) / width[:, None]
    unit = np.exp(-0.5 * np.square(away))
    profile = height[:, None] * unit
    slope = profile * away / width[:, None]
    return profile, unit, slope, slope * away


def integrated(
    step: Floats, height: Floats, centre: Floats, width: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the same, integrated over each pixel, all [n, m]; ``step`` rises by ones."""
    edges = np.append(step - 0.5, step[-1] + 0.5)
    away = (edges - centre[:, None]) / width[:, None]
    density = np.exp(-0.5 * np.square(away))
    unit = 0.5 * _ROOT2PI * width[:, None] * np.diff(erf(away / np.sqrt(2.0)), axis=1)
    profile = height[:, None] * unit
    slope = -height[:, None] * np.diff(density, axis=1)
    wider = profile / width[:, None] - height[:, None] * np.diff(away * density, axis=1)
    return profile, unit, slope, wider


def _fit(
    patch: Patch,
    noise: Floats,
    kappa: float | None,
    model: Model,
    *,
    reach: float,
    full: int,
) -> Floats:
    """Return the offset of the fitted centre, NaN where the fit has left its pixels [n]."""
    first = shape(patch, noise)
    step = columns()
    near = np.abs(step - first.centre[:, None]) <= reach * first.sigma[:, None] + 1.0
    used: Bools = near & patch.inside & (patch.raw < full)
    wanted = np.flatnonzero(near.any(axis=0))
    some = slice(int(wanted[0]), int(wanted[-1]) + 1)
    step, used, signal = step[some], used[:, some], patch.signal[:, some]
    height, centre, width = patch.height.copy(), first.centre.copy(), first.sigma.copy()
    height = np.where(patch.found, height, 1.0)
    white = np.maximum(np.square(noise), _LEAST_VARIANCE)[:, None]

    def weights(profile: Floats) -> Floats:
        variance = white if kappa is None else white + kappa * np.maximum(profile, 0.0)
        return np.where(used, 1.0 / variance, 0.0)

    damping = np.full(len(height), 1e-3)
    ends = np.zeros(len(height), np.bool_)
    given = model(step, height, centre, width)
    weight = weights(given[0])
    cost = (weight * np.square(signal - given[0])).sum(axis=1)
    for _ in range(_STEPS):
        profile, *slopes = given
        # A clipped spot may be twenty times as high as it seems, so the height's unit follows it.
        scale = np.stack([height, first.sigma, first.sigma], axis=1)
        jacobian = np.stack(slopes, axis=1) * scale[:, :, None]
        weighted = jacobian * weight[:, None, :]
        normal = weighted @ jacobian.transpose(0, 2, 1)
        gradient = np.einsum("nkm,nm->nk", weighted, signal - profile)
        spread = np.einsum("nkk->nk", normal).copy()
        floor = 1e-12 * spread.max(axis=1, keepdims=True) + 1e-30
        damped = normal + np.einsum("nk,kl->nkl", damping[:, None] * spread + floor, np.eye(3))
        move = np.clip(np.linalg.solve(damped, gradient[:, :, None])[:, :, 0], -1.0, 1.0) * scale
        trial = (
            np.maximum(height + move[:, 0], 0.1 * height),
            centre + move[:, 1],
            np.clip(width + move[:, 2], _LEAST_WIDTH, _MOST_WIDTH),
        )
        tried = model(step, *trial)
        # A step is judged with the weights that it was made with; the next step has new ones.
        new = (weight * np.square(signal - tried[0])).sum(axis=1)
        better = new <= cost
        height, centre, width = (
            np.where(better, a, b) for a, b in zip(trial, (height, centre, width), strict=True)
        )
        ends |= np.abs(move[:, 1]) < _CLOSE
        column = better[:, None]
        given = (
            np.where(column, tried[0], given[0]),
            np.where(column, tried[1], given[1]),
            np.where(column, tried[2], given[2]),
            np.where(column, tried[3], given[3]),
        )
        damping = np.where(better, 0.1 * damping, 10.0 * np.maximum(damping, 1e-6))
        weight = weights(given[0])
        cost = (weight * np.square(signal - given[0])).sum(axis=1)
        if ends.all():
            break
    lost = np.abs(centre - first.centre) > reach * first.sigma + 1.0
    return np.where(lost | (used.sum(axis=1) < 4), np.nan, centre)


def least_squares(
    lines: Pixels, background: Floats, noise: Floats, *, reach: float, full: int
) -> Floats:
    """Return the centre of a Gaussian fitted by least squares with equal weights [n], px.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        reach: Distance around the peak in which pixels are used, in its measured widths.
        full: Full scale, counts.
    """
    patch = cut(lines, background, noise)
    return place(patch, _fit(patch, noise, None, sampled, reach=reach, full=full))


def likelihood(
    lines: Pixels, background: Floats, noise: Floats, kappa: float, *, reach: float, full: int
) -> Floats:
    """Return the most likely centre of a pixel-integrated Gaussian [n], px.

    Fisher scoring: Gauss-Newton steps in which each pixel weighs 1 / (noise^2 + kappa f_i), f_i the
    profile itself. That is the likelihood of Poisson numbers, and of shot and read noise as long as
    both are near Gaussian (Winick, *Cramer-Rao lower bounds on the performance of charge-coupled-
    device optical position estimators*, JOSA A 3, 1986). It reaches the bound, which it is compared
    with.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        kappa: Counts per electron.
        reach: Distance around the peak in which pixels are used, in its measured widths.
        full: Full scale, counts.
    """
    patch = cut(lines, background, noise)
    return place(patch, _fit(patch, noise, kappa, integrated, reach=reach, full=full))


def scipy_fit(
    lines: Pixels, background: Floats, noise: Floats, kappa: float, *, reach: float, full: int
) -> tuple[Floats, Floats]:
    """Return the centre of a Gaussian by ``scipy.optimize.curve_fit`` and its sigma [n] each, px.

    It is what a user would write: each pixel weighs by read noise and by the shot noise of its own
    counts, and the covariance is taken as it is. Both are NaN where it does not converge.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        kappa: Counts per electron.
        reach: Distance around the peak in which pixels are used, in its measured widths.
        full: Full scale, counts; pixels that reach it are not used.
    """
    from scipy.optimize import OptimizeWarning, curve_fit  # takes a while to import

    patch = cut(lines, background, noise)
    first, step = shape(patch, noise), columns()
    centre, sigma = np.full((2, len(lines)), np.nan)
    near = np.abs(step - first.centre[:, None]) <= reach * first.sigma[:, None] + 1.0
    near &= patch.inside & (patch.raw < full)
    white = np.maximum(np.square(noise), _LEAST_VARIANCE)
    spread = np.sqrt(white[:, None] + kappa * np.maximum(patch.signal, 0.0))
    for k in np.flatnonzero(patch.found & (near.sum(axis=1) > 3)):
        some = near[k]
        start = patch.height[k], first.centre[k], first.sigma[k]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OptimizeWarning)
            try:
                found, covariance = curve_fit(
                    _gauss, step[some], patch.signal[k, some], start, spread[k, some],
                    absolute_sigma=True,
                )  # fmt: skip
            except RuntimeError:  # too many steps
                continue
        centre[k], sigma[k] = found[1], np.sqrt(covariance[1, 1])
    found = place(patch, centre)
    return found, np.where(np.isnan(found), np.nan, sigma)


def _gauss(x: Floats, height: float, centre: float, width: float) -> Floats:
    return np.asarray(height * np.exp(-0.5 * np.square((x - centre) / width)))
