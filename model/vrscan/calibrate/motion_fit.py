"""The harmonics of (12) from a recorded motion, and the shipped ones from the simulated mirror.

``python -m vrscan.calibrate.motion_fit`` prints the defaults of ``mirror.harmonics``,
``mirror.drive_phase`` and ``mirror.slopes``, and what the paper's six harmonics, these, and their
straight lines over the drive's phase leave of the motion.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vrscan.data.arrays import Floats
from vrscan.data.config import FEWEST_HARMONICS, HARMONICS
from vrscan.data.csv_files import finite, plain_name, read_table
from vrscan.data.errors import InputError
from vrscan.data.residuals import rms
from vrscan.ideal.motion import crossings, motion
from vrscan.scene.mems_mirror import Mirror, integrate, steady_state

NOMINAL_LEVEL = 0.7  # share of full scale at which the simulated mirror has its nominal torque
LEAST_SAMPLES = 3 * 2  # per harmonic: three for each number that is fitted


@dataclass(frozen=True)
class Motion:
    """The parameters of VR-SCAN (12) that fit a recording best."""

    frequency_hz: float  # frequency f0
    amplitude_rad: float  # amplitude A
    phase_rad: float  # phase phi_0, 0 to 2 pi
    harmonics: Floats  # [count, 2]: a_k and phi_k, rad, -pi to pi; the first is 1 and 0
    residual_rad: float  # rms of the residual


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
    """Return the motion (12) nearest to a recording, found by linear least squares.

    Args:
        time_s: Times [n], in any order and spacing.
        angle_rad: Angles at these times [n].
        frequency_hz: Frequency f0.
        count: Number of harmonics, 1 to 9.
        refine: Whether to improve f0 too, by Gauss and Newton. It has to be right to a quarter of a
            turn over the recording.

    Returns:
        The motion. Its residual contains a constant offset, which is not fitted, and even
        harmonics.

    Raises:
        InputError: if there are fewer than 6 samples a harmonic, shapes disagree, a number is not
            finite, the frequency is not positive, or the samples do not determine all harmonics.

    Example:
        >>> import numpy as np
        >>> import vrscan
        >>> time = np.arange(3000) / 37_400
        >>> angle = 0.35 * np.sin(2 * np.pi * 249 * time)
        >>> motion = vrscan.fit_motion(time, angle, 249.0)
        >>> round(motion.amplitude_rad, 6)
        0.35
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
    centre = time.mean()  # decouples frequency and phase
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
        residual_rad=rms(residual),
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
        mirror: Parameters of the mirror, or None for the defaults.
        frequency_hz: Frequency of the mirror.
        drive: (level / nominal level)^2.
        guess: First guess, as in ``vrscan.scene.mems_mirror.steady_state``.
        count: Number of harmonics, 1 to 9.
    """
    mirror = mirror or Mirror()
    start = steady_state(mirror, frequency_hz, drive, guess)
    edges = np.arange(5) / (4.0 * frequency_hz)
    time = np.arange(1024) / (1024.0 * frequency_hz)
    wave = drive * np.array([1.0, 0.0, 1.0, 0.0])
    angle, _ = integrate(mirror, edges, wave, start, time)
    return fit_motion(time, angle, frequency_hz, count=count)


def read_motion(path: Path, column: str, from_s: float) -> tuple[Floats, Floats]:
    """Return times, s, and angles, rad, [n] each, of a CSV file with a line of column names.

    Args:
        path: A CSV file with the column ``time_s``, such as mirror.csv.
        column: Name of the column with the angle; rows where it is empty are left out.
        from_s: Time before which rows are left out.

    Raises:
        InputError: naming file and column or line, if the file is missing, has no such column, or a
            value is not a number.
    """
    table, name = read_table(path), plain_name(column)
    table.need(("time_s", name))
    table = table.with_value(name)
    time, angle = (np.asarray(table.column(each, finite)) for each in ("time_s", name))
    late = time >= from_s
    if not late.any():
        raise InputError(f"{path}: no {column} from {from_s:g} s on")
    return time[late], angle[late]


@dataclass(frozen=True)
class OperatingMap:
    """Harmonics of (12) as straight lines over the drive's phase, at one amplitude.

    VR-SCAN V-B asks for a map over operating points. At one amplitude these differ by how far the
    turning point lags the drive's edge, which the index measures.
    """

    drive_phase: float  # turns, at which ``harmonics`` hold
    harmonics: Floats  # [count, 2]: a_k and phi_k, rad
    slopes: Floats  # [count, 2]: changes of both per turn of drive phase
    residual_rad: float  # rms error of the angle that remains at the worst operating point
    residual_without_slopes_rad: float  # the same error without slopes


def operating_map(
    points: Sequence[Motion], mark_rad: float, *, reference: int | None = None
) -> OperatingMap:
    """Return the straight lines through the harmonics of several operating points.

    The index is measured with one table, that of the map's own harmonics. Where the harmonics
    differ from these, the phase and the amplitude that it gives are a little off. The map describes
    the motion in terms of these measured values: its first harmonic, 1 and 0 at ``drive_phase``,
    has slopes too.

    Args:
        points: Motions at about one amplitude whose ``phase_rad`` counts from the drive's rising
            edge, two or more, all with the same number of harmonics.
        mark_rad: Angle of the index mark.
        reference: Index of the point whose drive phase is the map's; the middle one if None.

    Raises:
        InputError: if there are fewer than two different drive phases.
        ValueError: if a motion does not pass the mark.
    """
    phase = np.array([point.phase_rad / (2.0 * math.pi) for point in points])
    if len(points) < 2 or np.ptp(phase) == 0.0:
        raise InputError("operating_map: needs two operating points or more")
    middle = len(points) // 2 if reference is None else reference
    away = phase - phase[middle]
    true = np.stack([point.harmonics for point in points])
    true[..., 1] = np.unwrap(true[..., 1], axis=0)
    design = np.stack([np.ones_like(away), away], axis=1)
    base = np.linalg.lstsq(design, true.reshape(len(points), -1), rcond=None)[0][0].reshape(-1, 2)
    seen = np.stack(
        [_as_seen(point, rows, mark_rad, base) for point, rows in zip(points, true, strict=True)]
    )
    slope = np.linalg.lstsq(away[:, None], (seen - base).reshape(len(points), -1), rcond=None)[0]
    slope = slope.reshape(-1, 2)
    turns = np.arange(512) / 512.0
    left, flat = 0.0, 0.0
    for point, offset, rows in zip(points, away.tolist(), seen, strict=True):
        truth = motion(turns, point.amplitude_rad, rows)
        mapped = motion(turns, point.amplitude_rad, base + offset * slope)
        left = max(left, float(np.std(mapped - truth)))
        flat = max(flat, float(np.std(motion(turns, point.amplitude_rad, base) - truth)))
    base[:, 1] = np.angle(np.exp(1j * base[:, 1]))
    return OperatingMap(float(phase[middle]), base, slope, left, flat)


def _as_seen(point: Motion, harmonics: Floats, mark_rad: float, table: Floats) -> Floats:
    """Return the harmonics of a motion in the phase and amplitude that the index measures for it.

    Args:
        point: The motion.
        harmonics: Harmonics of the motion, phases unwrapped.
        mark_rad: Angle of the index mark.
        table: Harmonics with which phase and amplitude are measured.
    """
    from scipy.optimize import brentq  # a fit to a recording needs numpy alone

    def excess(half: float) -> float:
        return float(crossings(np.array([half]), mark_rad, harmonics)[0][0]) - point.amplitude_rad

    half = np.array([brentq(excess, 0.0, 0.2, xtol=1e-15)])
    _, at = crossings(half, mark_rad, harmonics)
    amplitude, taken_for = crossings(half, mark_rad, table)
    k = np.asarray(HARMONICS[: len(harmonics)], np.float64)
    seen = harmonics.copy()
    seen[:, 0] *= point.amplitude_rad / float(amplitude[0])
    seen[:, 1] += 2.0 * math.pi * k * float(taken_for[0] - at[0])
    return seen


LEVELS = (0.62, 0.66, 0.70, 0.74, 0.78)  # levels of the drive over the band in which the loop rests


def simulated_map(amplitude_rad: float, mark_rad: float) -> tuple[OperatingMap, list[Motion]]:
    """Return the map of the simulated mirror over ``LEVELS``, and the operating points."""
    points = simulated_motions(amplitude_rad)
    return operating_map(points, mark_rad), points


def simulated_motions(
    amplitude_rad: float, mirror: Mirror | None = None, levels: Sequence[float] = LEVELS
) -> list[Motion]:
    """Return the motions of the simulated mirror at drive levels.

    Each level has the frequency at which the mirror swings by ``amplitude_rad``.
    """
    from scipy.optimize import brentq

    guess = (amplitude_rad, 0.065)
    points = []
    for level in levels:
        drive = (level / NOMINAL_LEVEL) ** 2

        def excess(frequency_hz: float, drive: float = drive) -> float:
            found = simulated_motion(mirror, frequency_hz, drive, guess)
            return found.amplitude_rad - amplitude_rad

        frequency = brentq(excess, 248.85, 249.15, xtol=1e-6)
        points.append(simulated_motion(mirror, frequency, drive, guess))
    return points


def main() -> None:
    """Print the shipped harmonics, their slopes, and the errors of the motion that remain."""
    chosen, points = simulated_map(math.radians(20.5), math.radians(17.0))
    for level, point in zip(LEVELS, points, strict=True):
        print(
            f"level {level:.2f}: {point.frequency_hz:.4f} Hz, drive phase "
            f"{point.phase_rad / (2.0 * math.pi):.6f} turns, {point.residual_rad * 1e6:.2f} urad "
            f"rms beyond k = {HARMONICS[-1]}"
        )
    six = simulated_motion(count=FEWEST_HARMONICS).residual_rad
    print(f"{six * 1e6:.2f} urad rms beyond k = {HARMONICS[FEWEST_HARMONICS - 1]}")
    left, flat = 1e6 * chosen.residual_rad, 1e6 * chosen.residual_without_slopes_rad
    print(f"straight lines leave {left:.2f} urad rms, none {flat:.2f}")
    print(f"drive_phase = {chosen.drive_phase:.7f}")
    for name, rows in (("harmonics", chosen.harmonics), ("slopes", chosen.slopes)):
        print(f"{name} = [")
        for size, phi in rows:
            print(f"    [{size:.9f}, {phi:.7f}],")
        print("]")


if __name__ == "__main__":
    main()
