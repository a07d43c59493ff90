"""The mirror's natural frequency from the phase of its motion against the drive, VR-SCAN IV-D.

The mirror moves as A cos(theta), theta = 2 pi (t f - phase), with t from a rising edge of the
drive. The comb pulls towards zero with tau g(a), g = r exp(-r^2), r = a / a_c, while the square
wave u of frequency 2 f is high. Over a period the work of the torque makes up for the damping, and
its part that is in phase with the angle adds to the spring:

    tau <u g sin> = w0 w A / (2 Q)        w0^2 = w^2 - (2 tau / A) <u g cos>

Together they say w0^2 = w^2 - w0 w R / Q, R = <u g cos> / <u g sin>, which needs neither the torque
nor the drive's level: only the quality Q, which a ring-down shows, and the shape of the comb's
torque. The harmonics, a thousandth of the motion, are left out.
"""

import math

import numpy as np

from vrscan.data.arrays import Floats

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)  # the torque is smooth over half a pulse


def torque_means(
    phase: Floats, amplitude_rad: Floats | float, comb_rad: float, duty: float = 0.5
) -> tuple[Floats, Floats]:
    """Return the means <u g cos> and <u g sin> over a period, of the broadcast shape.

    Args:
        phase: Phase of the motion's turning point behind a rising edge of the drive, turns.
        amplitude_rad: Amplitude A, of a shape that broadcasts with ``phase``.
        comb_rad: Comb angle a_c.
        duty: Share of its period that the drive is high.
    """
    # Half a turn on, both angle and torque have the other sign: one pulse of the drive is enough.
    turns = 0.25 * duty * (_NODES + 1.0)
    theta = 2.0 * math.pi * (turns - np.asarray(phase)[..., None])
    r = np.asarray(amplitude_rad)[..., None] / comb_rad * np.cos(theta)
    torque = 0.5 * duty * _WEIGHTS * r * np.exp(-np.square(r))
    return np.sum(torque * np.cos(theta), axis=-1), np.sum(torque * np.sin(theta), axis=-1)


def natural_frequency(
    frequency_hz: Floats,
    phase: Floats,
    amplitude_rad: Floats | float,
    *,
    quality: float,
    comb_rad: float,
    duty: float = 0.5,
) -> Floats:
    """Return the natural frequency w0 / (2 pi), Hz, of the broadcast shape of the arguments.

    Args:
        frequency_hz: Frequency of the mirror, which is half of the drive's.
        phase: Phase of the motion's turning point behind a rising edge of the drive, turns.
        amplitude_rad: Amplitude of the motion's first harmonic.
        quality: Quality Q of the mirror.
        comb_rad: Comb angle a_c.
        duty: Share of its period that the drive is high.

    Returns:
        NaN where the torque of this phase does not drive the mirror.
    """
    stiff, work = torque_means(phase, amplitude_rad, comb_rad, duty)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(work > 0.0, stiff / work, np.nan) / (2.0 * quality)
    return np.asarray(frequency_hz * (np.hypot(1.0, ratio) - ratio))


def resting_point(
    natural_hz: float,
    amplitude_rad: float,
    torque: float,
    *,
    quality: float,
    comb_rad: float,
    duty: float = 0.5,
) -> tuple[float, float]:
    """Return frequency, Hz, and phase, turns, at which a torque holds an amplitude.

    That is where the loop comes to rest after a drift of the natural frequency, for it brings the
    drive's level, and so the torque, back to the nominal one.

    Args:
        natural_hz: Natural frequency.
        amplitude_rad: Amplitude of the motion.
        torque: tau at the drive's level, s^-2.
        quality: Quality Q of the mirror.
        comb_rad: Comb angle a_c.
        duty: Share of its period that the drive is high.

    Raises:
        ValueError: if the torque is too weak for the amplitude.
    """
    phase = np.linspace(-0.125, 0.25, 3073)
    stiff, work = torque_means(phase, amplitude_rad, comb_rad, duty)
    natural = 2.0 * math.pi * natural_hz
    omega = np.sqrt(natural**2 + 2.0 * torque / amplitude_rad * stiff)
    excess = torque * work - natural * omega * amplitude_rad / (2.0 * quality)
    # On the branch that a downward sweep reaches the work falls with the phase.
    first = int(np.argmax(excess))
    if excess[first] < 0.0:
        raise ValueError(f"resting_point: the torque does not reach {amplitude_rad:g} rad")
    last = first + int(np.argmin(excess[first:]))
    branch = slice(first, last + 1)
    rest = float(np.interp(0.0, -excess[branch], phase[branch]))
    return float(np.interp(rest, phase, omega)) / (2.0 * math.pi), rest
