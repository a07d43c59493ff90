"""The harmonics of (12) from a recorded motion, and the shipped ones from the simulated mirror.

``python -m vrscan.calibrate.mirror`` prints the default of ``mirror.harmonics``, and what the
paper's six and these leave of the motion.
"""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.arrays import Floats
from vrscan.config import FEWEST_HARMONICS, HARMONICS
from vrscan.errors import InputError
from vrscan.scene.mirror import Mirror, integrate, steady_state

LEAST_SAMPLES = 3 * 2  # a harmonic: three for each number that is sought


@dataclass(frozen=True)
class Motion:
    """The numbers of VR-SCAN (12) that fit a recording best."""

    frequency_hz: float  # f0
    amplitude_rad: float  # A
    phase_rad: float  # phi_0, 0 to 2 pi
    harmonics: Floats  # [count, 2]: a_k and phi_k, rad, -pi to pi; the first is 1 and 0
    residual_rad: float  # rms of what is left


def _design(time_s: Floats, frequency_hz: float, k: Floats) -> Floats:
    turns = np.multiply.outer(time_s * frequency_hz, k) % 1.0
    angle = 2.0 * np.pi * turns
    return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)


def fit_motion(
    time_s: Floats,
    angle_rad: Floats,
    frequency_hz: float,
    *,
    count: int = len(HARMONICS),
    refine: bool = False,
) -> Motion:
    """Return the motion (12) nearest to a recording, by linear least squares.

    Args:
        time_s: [n], any order and spacing.
        angle_rad: [n].
        frequency_hz: f0.
        count: Harmonics, 1 to 9.
        refine: Improve f0 too, by Gauss and Newton. It has to be right to a quarter of a turn over
            the recording.

    Returns:
        The motion. An unmeasured constant, and even harmonics, are in the residual.

    Raises:
        InputError: if there are fewer than 6 samples a harmonic, shapes disagree, a number is not
            finite, the frequency is not positive, or the samples do not determine all harmonics.
    """
    time, angle = np.asarray(time_s, np.float64), np.asarray(angle_rad, np.float64)
    if time.ndim != 1 or time.shape != angle.shape:
        raise InputError(f"fit_motion: {time.shape} times and {angle.shape} angles")
    if time.size < LEAST_SAMPLES * count:
        raise InputError(f"fit_motion: {time.size} samples, needs {LEAST_SAMPLES * count}")
    if not (np.isfinite(time).all() and np.isfinite(angle).all()):
        raise InputError("fit_motion: a time or an angle is not a finite number")
    if not (math.isfinite(frequency_hz) and frequency_hz > 0.0):
        raise InputError(f"fit_motion: frequency {frequency_hz} is not positive")

    k = np.asarray(HARMONICS[:count], np.float64)
    centre = time.mean()  # keeps frequency and phase apart
    past = time - centre
    for _ in range(20 if refine else 1):
        design = _design(past, frequency_hz, k)
        solution, _, rank, singular = np.linalg.lstsq(design, angle, rcond=None)
        if rank < design.shape[1] or singular[-1] < 1e-6 * singular[0]:
            raise InputError("fit_motion: the samples do not determine all harmonics")
        if not refine:
            break
        cosine, sine = np.split(solution, 2)
        rotated = np.concatenate([k * sine, -k * cosine])
        slope = 2.0 * np.pi * past * (design @ rotated)
        error = angle - design @ solution
        free = slope - design @ np.linalg.lstsq(design, slope, rcond=None)[0]
        change = float(free @ error / (free @ free))
        frequency_hz += change
        if abs(change) < 1e-13 * frequency_hz:
            break
    residual = angle - design @ solution
    cosine, sine = np.split(solution, 2)
    size, lag = np.hypot(cosine, sine), np.arctan2(sine, cosine)
    if size[0] == 0.0:
        raise InputError("fit_motion: nothing moves at this frequency")
    phi = np.angle(np.exp(1j * (lag - k * lag[0])))
    phi[0] = 0.0
    phase = lag[0] + 2.0 * np.pi * (frequency_hz * centre % 1.0)
    return Motion(
        frequency_hz=float(frequency_hz),
        amplitude_rad=float(size[0]),
        phase_rad=float(phase % (2.0 * np.pi)),
        harmonics=np.stack([size / size[0], phi], axis=1),
        residual_rad=float(np.sqrt(np.mean(np.square(residual)))),
    )


def simulated_motion(
    mirror: Mirror | None = None,
    frequency_hz: float = 249.0,
    drive: float = 1.0,
    guess: tuple[float, float] = (math.radians(20.5), 0.065),
    count: int = len(HARMONICS),
) -> Motion:
    """Return the motion of the simulated mirror in its steady state, time 0 at the drive's edge.

    Args:
        mirror: Its parameters, or None for the defaults.
        frequency_hz: Of the mirror.
        drive: (level / nominal level)^2.
        guess: As for ``vrscan.scene.mirror.steady_state``.
        count: Harmonics, 1 to 9.
    """
    mirror = mirror or Mirror()
    start = steady_state(mirror, frequency_hz, drive, guess)
    edges = np.arange(5) / (4.0 * frequency_hz)
    time = np.arange(1024) / (1024.0 * frequency_hz)
    wave = drive * np.array([1.0, 0.0, 1.0, 0.0])
    angle, _ = integrate(mirror, edges, wave, start, time)
    return fit_motion(time, angle, frequency_hz, count=count)


def main() -> None:
    """Print the shipped harmonics and how they were reached."""
    motion = simulated_motion()
    print(f"amplitude  {math.degrees(motion.amplitude_rad):.4f} degrees")
    print(
        f"phase      {motion.phase_rad / (2.0 * math.pi):.6f} turns after the drive's rising edge"
    )
    for count in (FEWEST_HARMONICS, len(HARMONICS)):
        left = simulated_motion(count=count).residual_rad
        print(f"residual   {left * 1e6:.3f} urad rms with {count} harmonics")
    for order, (size, phi) in zip(HARMONICS, motion.harmonics, strict=True):
        print(f"k = {order:2}  [{size:.9f}, {phi:.7f}]")


if __name__ == "__main__":
    main()
