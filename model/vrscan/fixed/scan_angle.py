"""The mirror's scan angle from its phase, the twin of ``rtl/mirror/scan_angle.sv``.

VR-SCAN (12): alpha = A sum a_k cos(k p - phi_k), k = 1, 3 .. 17, p = 2 pi f0 t - phi_0.
"""

import math

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.multiply import multiply
from vrscan.fixed.quarter_wave import LATENCY as QUARTER_WAVE_LATENCY
from vrscan.fixed.quarter_wave import amplitude as wave_amplitude
from vrscan.fixed.quarter_wave import error_bound, quarter_wave
from vrscan.fixed.saturate import saturated

AMPL_WIDTH = 30  # ``AmplWidth``
FRACTION = AMPL_WIDTH - 1  # shift of every product: ``Fraction``
SUM_FRACTION = 29  # ``SumFraction``
SUM_WIDTH = SUM_FRACTION + 6  # ``SumWidth``
FACTOR_WIDTH = AMPL_WIDTH + 1  # ``FactorWidth``
# The factor that turns quarter_wave's 1.0 into 1: ``InverseLength``.
INVERSE_LENGTH = math.floor(math.ldexp(1.0, 2 * FRACTION) / wave_amplitude(AMPL_WIDTH) + 0.5)

_PRODUCT = multiply_latency(SUM_WIDTH, FACTOR_WIDTH)
LATENCY = (
    pkg.HARMONIC_COUNT * (QUARTER_WAVE_LATENCY + _PRODUCT + 2) + 2 * (_PRODUCT + 1) + 2
)  # clocks from valid_i to valid_o


def _lowered(a: Ints, b: Ints | int) -> Ints:
    # Towards minus infinity.
    return multiply(a, np.asarray(b, np.int64), a_width=SUM_WIDTH, b_width=FACTOR_WIDTH) >> FRACTION


def scan_angle(phase: Ints, amplitude: Ints | int, a: Ints, phi: Ints) -> tuple[Ints, Bools]:
    """Return scan angles exactly as the hardware rounds them.

    Args:
        phase: Phase p, turns, 28 fraction bits, u28. Any shape.
        amplitude: Amplitude A, turns, 28 fraction bits, u26; broadcast against ``phase``.
        a: a_k, 22 fraction bits, s24; the last axis is the harmonic, the others are broadcast.
        phi: phi_k, turns, 28 fraction bits, u28, [..., 9] like ``a``.

    Returns:
        The angles, int64, fractions of a turn, 24 bits, and whether an angle did not fit and is
        saturated; both have the broadcast shape of all arguments. The error of an angle is at most
        ``error_bound_turns``.

    Raises:
        ValueError: if an argument does not fit in its format or there are not 9 harmonics.
    """
    phase, amplitude, a, phi = (np.asarray(v, np.int64) for v in (phase, amplitude, a, phi))
    if a.shape[-1:] != (pkg.HARMONIC_COUNT,) or phi.shape[-1:] != (pkg.HARMONIC_COUNT,):
        raise ValueError(f"scan_angle: a and phi must end in an axis of {pkg.HARMONIC_COUNT}")
    motion_end = 1 << (pkg.MOTION_WIDTH - 1)
    for name, value, low, high in (
        ("phase", phase, 0, 1 << pkg.PHASE_WIDTH),
        ("amplitude", amplitude, 0, 1 << pkg.AMPLITUDE_WIDTH),
        ("a", a, -motion_end, motion_end),
        ("phi", phi, 0, 1 << pkg.PHASE_WIDTH),
    ):
        if value.size and (value.min() < low or value.max() >= high):
            raise ValueError(f"scan_angle: {name} is outside {low} to {high - 1}")
    mask = (1 << pkg.PHASE_WIDTH) - 1
    total = np.zeros(np.broadcast_shapes(phase.shape, a.shape[:-1], phi.shape[:-1]), np.int64)
    for n in range(pkg.HARMONIC_COUNT):
        turn = ((2 * n + 1) * phase - phi[..., n]) & mask
        _, cosine = quarter_wave(turn, phase_width=pkg.PHASE_WIDTH, ampl_width=AMPL_WIDTH)
        total = total + _lowered(a[..., n] << (SUM_FRACTION - pkg.MOTION_FRACTION), cosine)
    total = _lowered(total, INVERSE_LENGTH)
    total = _lowered(total, amplitude << (FRACTION - pkg.AMPLITUDE_FRACTION))
    # To nearest, half up.
    drop = SUM_FRACTION - pkg.ANGLE_WIDTH
    exact = (total + (1 << (drop - 1))) >> drop
    angle = saturated(exact, pkg.ANGLE_WIDTH)
    return angle, angle != exact


def error_bound_turns(amplitude: Floats, motion: Floats) -> Floats:
    """Return the largest error of an angle against (12) of the same integers, turns.

    With e a step of ``SUM_FRACTION`` bits and s = sum |a_k|, the errors are: s times quarter_wave's
    bound for the cosines, e for each of their cut products, s 2**-30 for the inverse of its 1.0,
    and e for the product with the inverse. A scales all of them. The product with A is cut to so
    many bits that the rounding of the angle, half a step, is that of the exact product.

    Args:
        amplitude: Amplitude A, turns, [...].
        motion: a_k, [..., 9].
    """
    step = 2.0**-SUM_FRACTION
    wave = error_bound(AMPL_WIDTH) / wave_amplitude(AMPL_WIDTH) + 2.0 ** -(FRACTION + 1)
    size = np.abs(motion).sum(axis=-1)
    cuts = (motion.shape[-1] + 1.0) * step
    bound: Floats = np.abs(amplitude) * (size * wave + cuts) + floor_turns()
    return bound


def floor_turns() -> float:
    """Return the rms error that the rounding of the angle alone leaves, turns."""
    return 2.0 ** -(pkg.ANGLE_WIDTH + 1)
