"""Accuracy of fixed.scan_angle against VR-SCAN (12) in float64 of the same integers."""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import Config
from vrscan.data.residuals import rms
from vrscan.fixed.scan_angle import error_bound_turns, floor_turns, scan_angle
from vrscan.ideal.motion import motion
from vrscan.study.report.figure import SEED, Figure, largest

GROUP = "scan_angle against (12)"
LIMIT_URAD = 1.0
LARGEST_DEG = 25.0
HARMONIC = 0.02  # largest |a_k| of a mirror except a_1 = 1
SETS = 100  # number of sets of random harmonics

_TURN = 1 << pkg.PHASE_WIDTH
_ONE = 1 << pkg.MOTION_FRACTION


@dataclass(frozen=True)
class Motions:
    """n phases for each of s sets of harmonics, in the format of the ports; see ``scan_angle``.

    Attributes:
        phase: Phases p, [s, n].
        amplitude: Amplitudes A, [s, n].
        a: a_k, [s, 9].
        phi: phi_k, [s, 9].
    """

    phase: Ints
    amplitude: Ints
    a: Ints
    phi: Ints


def phases(count: int, draw: np.random.Generator) -> Ints:
    """Return phases all around the turn, one at random in each ``count``-th of it, int64 [count].

    Args:
        count: Number of phases, at least 1.
        draw: Source of the random positions.
    """
    edges = np.arange(count + 1) * _TURN // count
    return draw.integers(edges[:-1], edges[1:])


def harmonic_words(pairs: list[list[float]]) -> tuple[Ints, Ints]:
    """Return a_k and phi_k of the ports for pairs [a_k, phi_k in rad], int64 [9] each."""
    a, phi = np.array(pairs).T
    turns = np.rint(phi / (2.0 * np.pi) * _TURN).astype(np.int64)
    return np.rint(a * _ONE).astype(np.int64), turns % _TURN


def amplitude_words(degrees: Floats) -> Ints:
    """Return amplitudes of the port for amplitudes in degrees, int64 of the same shape."""
    words = np.rint(degrees / 360.0 * 2.0**pkg.AMPLITUDE_FRACTION).astype(np.int64)
    return np.asarray(words)


def errors(given: Motions) -> tuple[Floats, Floats]:
    """Return each angle's error and its bound, urad, [s, n] each.

    Raises:
        RuntimeError: if an angle does not fit.
    """
    a, phi = given.a[:, None], given.phi[:, None]
    angle, overflow = scan_angle(given.phase, given.amplitude, a, phi)
    if bool(overflow.any()):
        raise RuntimeError("accuracy: an angle does not fit")
    amplitude = given.amplitude * 2.0**-pkg.AMPLITUDE_FRACTION
    pairs = np.stack([given.a / _ONE, given.phi / _TURN * (2.0 * np.pi)], axis=-1)
    exact = [
        motion(phase / _TURN, turns * (2.0 * np.pi), harmonics)
        for phase, turns, harmonics in zip(given.phase, amplitude, pairs, strict=True)
    ]
    error = angle * (2.0 * np.pi * 2.0**-pkg.ANGLE_WIDTH) - np.array(exact)
    return np.asarray(error * 1e6), _urad(error_bound_turns(np.asarray(amplitude), a / _ONE))


def _urad(turns: Floats) -> Floats:
    return turns * (2.0 * np.pi * 1e6)


def random_harmonics(count: int, size: float, draw: np.random.Generator) -> tuple[Ints, Ints]:
    """Return a_k up to ``size`` after a_1 = 1, and any phi_k after phi_1 = 0, [count, 6] each.

    The first sets have all a_k at +-``size`` except for k = 1, where the errors add up most.

    Args:
        count: Number of sets.
        size: Largest |a_k|.
        draw: Source of the other values.
    """
    a = draw.uniform(-size, size, (count, pkg.HARMONIC_COUNT))
    a[: count // 4] = np.copysign(size, a[: count // 4])
    a[:, 0] = 1.0
    phi = draw.integers(0, _TURN, (count, pkg.HARMONIC_COUNT))
    phi[:, 0] = 0
    return np.rint(a * _ONE).astype(np.int64), phi


def cases(count: int, draw: np.random.Generator) -> list[tuple[str, Motions, float]]:
    """Return the names of the measurements, the motions, and the limit, NaN without one.

    Args:
        count: Number of phases for each case, at least ``SETS``.
        draw: Source of phases, amplitudes and harmonics.
    """
    mirror = Config().mirror
    a, phi = harmonic_words(mirror.harmonics)
    working = amplitude_words(np.full(count, mirror.amplitude_deg))
    any_amplitude = amplitude_words(draw.uniform(0.0, LARGEST_DEG, count))
    any_amplitude[::2] = amplitude_words(np.array(LARGEST_DEG))
    # A is a quarter of a turn, all |a_k| are just below 2: at other phases the angle does not fit.
    most = np.full(pkg.HARMONIC_COUNT, 2 * _ONE - 1)
    quarter = np.full(count, (1 << pkg.AMPLITUDE_WIDTH) - 1)
    near = phases(count, draw) // 256 - _TURN // 512 + _TURN // 4
    in_step = np.zeros(pkg.HARMONIC_COUNT, np.int64)
    shape = SETS, -1
    whole = count - count % SETS
    largest_deg = f"up to {LARGEST_DEG:g} degrees"
    return [
        (
            f"shipped harmonics, {mirror.amplitude_deg:g} degrees",
            Motions(phases(count, draw)[None], working[None], a[None], phi[None]),
            LIMIT_URAD,
        ),
        (
            f"shipped harmonics, {largest_deg}",
            Motions(phases(count, draw)[None], any_amplitude[None], a[None], phi[None]),
            LIMIT_URAD,
        ),
        (
            f"{SETS} sets of |a_k| up to {HARMONIC:g}, {largest_deg}",
            Motions(
                draw.permutation(phases(whole, draw)).reshape(shape),
                any_amplitude[:whole].reshape(shape),
                *random_harmonics(SETS, HARMONIC, draw),
            ),
            LIMIT_URAD,
        ),
        (
            "largest a_k and amplitude",
            Motions(near[None], quarter[None], most[None], in_step[None]),
            math.nan,
        ),
    ]


def measure(count: int) -> list[Figure]:
    """Return maximum and rms of the angle's error.

    Args:
        count: Number of phases for each row, at least ``SETS``.
    """
    draw = np.random.default_rng([SEED, 6])
    floor = float(_urad(np.array(floor_turns())))
    figures = []
    share = 0.0
    for name, given, limit in cases(count, draw):
        error, bound = errors(given)
        share = max(share, largest(error / bound))
        figures += [
            Figure(
                GROUP,
                f"{name}, maximum",
                "urad",
                largest(error),
                largest(bound),
                floor,
                limit,
                headline="" if math.isnan(limit) else "scan angle against (12), maximum",
            ),
            Figure(GROUP, f"{name}, rms", "urad", rms(error), floor=floor / math.sqrt(3.0)),
        ]
    figures.append(
        Figure(GROUP, "largest share of an angle's own bound", "1", share, predicted=1.0)
    )
    return figures
