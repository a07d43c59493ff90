"""The resonant mirror's equation of motion, which ``tb/devices/mems_mirror.sv`` has to agree with.

A comb drive pulls towards zero while the square wave is high, VR-SCAN IV-C:

    a'' = -(w0/Q) a' - w0^2 (a - bias) - tau u g(a),   g = r exp(-r^2), r = a / a_c

with a the optical scan angle and u the drive, its level's square included. It starts on a downward
sweep only, has two stable amplitudes below that, and falls to rest beneath a fold, as the paper's
mirror does.

It leaves out: higher modes, the plate's bending, noise of drive and air, temperature (its effects
are given as a shift of the natural frequency and a factor on the damping), and how the charge
follows the drive's voltage.
"""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Floats

RELATIVE_TOLERANCE = 1e-12  # relative error of the integrator per step
ABSOLUTE_TOLERANCE = 1e-14


@dataclass(frozen=True)
class Mirror:
    """Physical parameters; the defaults give 20.5 degrees at 249.0 Hz."""

    natural_hz: float = 248.5
    quality: float = 200.0
    torque: float = 8.52e4  # tau, s^-2, at the nominal level
    comb_rad: float = math.radians(8.52)  # comb angle a_c
    bias_rad: float = 2e-7  # rest position, from which a start grows
    damping: float = 1.0  # factor on w0/Q

    def acceleration(self, angle: Floats, velocity: Floats, drive: Floats | float) -> Floats:
        """Return the angular acceleration a''.

        Args:
            angle: Angle, rad, any shape.
            velocity: Angular velocity, rad/s, of the shape of ``angle``.
            drive: (level / nominal level)^2 where the square wave is high, 0 where it is low.
        """
        omega = 2.0 * math.pi * self.natural_hz
        r = angle / self.comb_rad
        free = omega**2 * (self.bias_rad - angle) - self.damping * omega / self.quality * velocity
        return np.asarray(free - self.torque * drive * r * np.exp(-np.square(r)))


def sweep(
    start_hz: float, stop_hz: float, rate_hz_per_s: float, duration_s: float, duty: float = 0.5
) -> tuple[Floats, Floats]:
    """Return the edges of a drive that sweeps from one frequency to another and stays there.

    Args:
        start_hz: Frequency of the mirror at time 0, where the drive's phase is 0.
        stop_hz: Last frequency of the mirror, above or below.
        rate_hz_per_s: Rate of change of the frequency, positive.
        duration_s: Duration of the sweep and the time after it.
        duty: Share of its period that the drive, at twice the mirror's frequency, is high.

    Returns:
        Times s [n + 1], from 0 to ``duration_s``, and the drive between them, 0 or 1 [n].

    Raises:
        ValueError: if ``duty`` is not between 0 and 1, or a frequency or the rate is not positive.
    """
    if not 0.0 < duty < 1.0 or min(start_hz, stop_hz, rate_hz_per_s, duration_s) <= 0.0:
        raise ValueError("sweep: duty must be inside 0 to 1, everything else positive")
    rate = math.copysign(rate_hz_per_s, stop_hz - start_hz)
    arrival = (stop_hz - start_hz) / rate
    turned = 0.5 * (start_hz + stop_hz) * arrival

    whole = max(0.0, turned + stop_hz * (duration_s - arrival), start_hz * duration_s)
    k = np.arange(math.ceil(2.0 * whole) + 1)
    phase = 0.5 * np.stack([k, k + duty], axis=1).ravel()  # turns of the mirror at each edge
    # start t + rate t^2 / 2 = phase, without the difference of two large numbers.
    sweeping = 2.0 * phase / (start_hz + np.sqrt(np.maximum(start_hz**2 + 2.0 * rate * phase, 0.0)))
    time = np.where(phase < turned, sweeping, arrival + (phase - turned) / stop_hz)
    inside = time < duration_s
    drive = np.tile([1.0, 0.0], k.size)[inside]
    return np.append(time[inside], duration_s), drive


def integrate(
    mirror: Mirror,
    edges_s: Floats,
    drive: Floats,
    start: tuple[float, float] = (0.0, 0.0),
    at_s: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Return angle and velocity; the integration stops and starts at every edge of the drive.

    Args:
        mirror: Parameters of the mirror.
        edges_s: Rising times [n + 1] at which the drive changes, and both ends.
        drive: (level / nominal level)^2 u between these times [n].
        start: Angle, rad, and velocity, rad/s, at ``edges_s[0]``.
        at_s: Rising times, inside the edges, at which to return the motion; the edges themselves if
            None.

    Returns:
        Angle, rad, and velocity, rad/s, each of the shape of ``at_s``.

    Raises:
        ValueError: if shapes disagree, the times do not rise, or ``at_s`` is outside.
        RuntimeError: if the integrator gives up.
    """
    from scipy.integrate import solve_ivp  # the mirror's parameters need numpy alone

    at = np.asarray(edges_s if at_s is None else at_s, np.float64)
    if len(edges_s) != len(drive) + 1 or np.any(np.diff(edges_s) < 0.0):
        raise ValueError("integrate: edges must rise, and be one more than the drive's values")
    if at.size and (np.any(np.diff(at) < 0.0) or at[0] < edges_s[0] or at[-1] > edges_s[-1]):
        raise ValueError("integrate: the times asked for must rise and be inside the edges")
    motion = np.empty((2, at.size))
    state = np.array(start, np.float64)
    first = np.searchsorted(at, edges_s[:-1], side="left")
    last = np.append(first[1:], at.size)
    for k, factor in enumerate(drive):
        begin, end = float(edges_s[k]), float(edges_s[k + 1])
        if begin == end:
            continue

        def derivative(_: float, y: Floats, factor: float = float(factor)) -> tuple[float, float]:
            return y[1], float(mirror.acceleration(y[0], y[1], factor))

        piece = slice(first[k], last[k])
        solution = solve_ivp(
            derivative,
            (0.0, end - begin),
            state,
            method="DOP853",
            dense_output=first[k] < last[k],
            rtol=RELATIVE_TOLERANCE,
            atol=ABSOLUTE_TOLERANCE,
        )
        if not solution.success:
            raise RuntimeError(f"integrate: {solution.message}")
        if first[k] < last[k]:
            motion[:, piece] = solution.sol(at[piece] - begin)
        state = solution.y[:, -1]
    motion[:, at == edges_s[-1]] = state[:, None]  # no piece begins with the last time
    return motion[0], motion[1]


def steady_state(
    mirror: Mirror,
    frequency_hz: float,
    drive: float = 1.0,
    guess: tuple[float, float] = (math.radians(20.5), 0.065),
) -> tuple[float, float]:
    """Return angle and velocity at the drive's phase 0, for the motion that repeats every period.

    Args:
        mirror: Parameters of the mirror.
        frequency_hz: Frequency of the mirror; the drive has twice that, with a duty of 0.5.
        drive: (level / nominal level)^2 while the drive is high.
        guess: Amplitude, rad, and the turns from the drive's rising edge to the positive turning
            point. There are several such motions; the one found is near this.

    Raises:
        RuntimeError: if none is found.
    """
    from scipy.optimize import root

    edges = np.arange(5) / (4.0 * frequency_hz)
    wave = drive * np.array([1.0, 0.0, 1.0, 0.0])
    omega = 2.0 * math.pi * frequency_hz

    def mismatch(state: Floats) -> Floats:
        angle, velocity = integrate(mirror, edges, wave, (state[0], state[1] * omega))
        return np.array([angle[-1] - state[0], velocity[-1] / omega - state[1]])

    turn = 2.0 * math.pi * guess[1]
    found = root(mismatch, [guess[0] * math.cos(turn), guess[0] * math.sin(turn)], tol=1e-13)
    if np.abs(mismatch(found.x)).max() > 1e-10 or math.hypot(*found.x) < 0.1 * guess[0]:
        raise RuntimeError(f"steady_state: no motion of {guess[0]:.3g} rad at {frequency_hz} Hz")
    return float(found.x[0]), float(found.x[1] * omega)
