"""The mirror's motion, VR-SCAN (11) and (12), and what an index mark tells about it.

The precision that the scan angle needs, (7), is ``vrscan.ideal.geometry.angle_precision``. Phases p
= 2 pi f0 t - phi_0 are given in turns and angles in rad. Harmonics are one to nine pairs [a_k,
phi_k], phi_k in rad, for k = 1, 3 .. 17 with a_1 = 1 and phi_1 = 0; the paper has six.
"""

from collections.abc import Sequence

import numpy as np

from vrscan.data.arrays import Floats
from vrscan.data.config import HARMONICS

Harmonics = Sequence[Sequence[float]] | Floats

_TURN = 2.0 * np.pi


def _pairs(harmonics: Harmonics) -> tuple[Floats, Floats, Floats]:
    pairs = np.asarray(harmonics, np.float64)
    fits = pairs.ndim == 2 and 1 <= len(pairs) <= len(HARMONICS) and pairs.shape[1] == 2
    if not fits or not np.isfinite(pairs).all():
        raise ValueError(f"harmonics must be 1 to {len(HARMONICS)} pairs [a_k, phi_k]")
    return np.asarray(HARMONICS[: len(pairs)], np.float64), pairs[:, 0], pairs[:, 1]


def motion(phase: Floats, amplitude: Floats | float, harmonics: Harmonics) -> Floats:
    """Return the scan angle of (12), A sum a_k cos(k p - phi_k).

    Args:
        phase: Phase p, turns, any shape.
        amplitude: Amplitude A, rad, broadcast against ``phase``.
        harmonics: Pairs [a_k, phi_k], [1 to 9, 2].

    Raises:
        ValueError: if ``harmonics`` has another shape or is not finite.
    """
    k, a, phi = _pairs(harmonics)
    angle = np.cos(_TURN * (np.asarray(phase)[..., None] * k % 1.0) - phi) @ a
    return np.asarray(amplitude * angle)


def half_turn_residual(time_s: Floats, angle_rad: Floats, frequency_hz: Floats | float) -> Floats:
    """Return a(t) + a(t + T/2), which (11) says is zero, for all t at which both were recorded.

    Args:
        time_s: Rising times [n]. Between them a cubic spline is used; with m samples per period its
            error is 4 m^-4 of the amplitude, 4e-8 of it for m = 100.
        angle_rad: Angles at these times [n].
        frequency_hz: Frequency of the motion, 1 / T, one or [n].

    Returns:
        The sums in rad, [number of ``time_s`` that have a partner].

    Raises:
        ValueError: if shapes disagree or the recording is shorter than half a period.
    """
    from scipy.interpolate import CubicSpline  # the rest of the module needs numpy alone

    time, angle = np.asarray(time_s, np.float64), np.asarray(angle_rad, np.float64)
    if time.ndim != 1 or time.shape != angle.shape or time.size < 4:
        raise ValueError("half_turn_residual: needs four samples or more, and an angle for each")
    later = time + 0.5 / frequency_hz
    paired = later <= time[-1]
    if not paired.any():
        raise ValueError("half_turn_residual: the recording is shorter than half a period")
    return np.asarray(angle[paired] + CubicSpline(time, angle)(later[paired]))


def crossings(half: Floats, mark_rad: float, harmonics: Harmonics) -> tuple[Floats, Floats]:
    """Return amplitude and midpoint of the motion whose two crossings of a mark are 2 h apart.

    With S(p) = sum a_k cos(k p - phi_k), the beam passes the mark at p = m - h on its way out and
    at m + h on its way back: S(m + h) = S(m - h), A = mark / S(m + h). Of S(m + h) - S(m - h) =
    -2 sum a_k sin(k h) sin(k m - phi_k) the factor sin(h) is divided out, so h = 0, the turning
    point itself, is no special case. A mark below zero is passed half a turn later, (11).

    Args:
        half: Half distance h of the crossings, turns, 0 to 0.25. Any shape.
        mark_rad: Angle of the mark, not zero.
        harmonics: Pairs [a_k, phi_k], [1 to 9, 2].

    Returns:
        The amplitude A, rad, infinite where S is zero or has the other sign, and the midpoint m,
        turns, -0.25 to 0.75; both of the shape of ``half``.

    Raises:
        ValueError: if an h is outside its range, the mark is zero, or the harmonics are so large
            (sum k |a_k| above the first not below 1) that there need be no midpoint near the
            turning point.
    """
    k, a, phi = _pairs(harmonics)
    half = np.asarray(half, np.float64)
    if mark_rad == 0.0 or (half.size and not (half.min() >= 0.0 and half.max() <= 0.25)):
        raise ValueError("crossings: a half distance is outside 0 to 0.25, or the mark is zero")
    if np.sum(k[1:] * np.abs(a[1:])) >= 1.0:
        raise ValueError("crossings: harmonics too large: sum k |a_k| is not below 1")
    # sin(k h) / sin(h), for odd k one plus twice the cosines of the even multiples of h below k.
    even = np.cos(_TURN * half[..., None] * np.arange(2, k[-1], 2))
    ratio = 1.0 + 2.0 * np.cumsum(even, axis=-1)
    weight = a * np.concatenate([np.ones((*half.shape, 1)), ratio], axis=-1)
    middle = np.zeros_like(half)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(30):  # Newton
            inner = _TURN * middle[..., None] * k - phi
            value = (weight * np.sin(inner)).sum(axis=-1)
            slope = _TURN * (weight * k * np.cos(inner)).sum(axis=-1)
            before, middle = middle, middle - value / slope
            if np.array_equal(before, middle):
                break
    value = (weight * np.sin(_TURN * middle[..., None] * k - phi)).sum(axis=-1)
    if not (np.all(np.abs(value) < 1e-12) and np.all(np.abs(middle) < 0.25)):
        raise ValueError("crossings: harmonics too large: no midpoint was found")
    height = motion(middle + half, 1.0, harmonics)
    amplitude = np.where(height > 0.0, abs(mark_rad) / np.where(height > 0.0, height, 1.0), np.inf)
    return amplitude, middle + (0.5 if mark_rad < 0.0 else 0.0)
