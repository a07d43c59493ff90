"""The mirror's calibration of VR-SCAN V-B: a plane at several operating points.

Only the mirror's parameters are fitted: the angle of the index mark, and harmonics that are
straight lines over the drive's phase, in the form that the chain's ``motion_map`` takes. Because
amplitude and phase are measured with one table at every operating point, the first harmonic has
slopes too. The geometry is that of the coarse calibration. A polygon has one operating point, and
the angle of its diode is fitted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vrscan.calibrate.coarse import (
    SHAPE_PX,
    check_stage,
    configured,
    harmonic_parameters,
    index_parameter,
)
from vrscan.calibrate.recording import Recording, angles, located, px_per_mm
from vrscan.calibrate.solve import Fit, Parameter, least_squares
from vrscan.data.arrays import Floats
from vrscan.data.config import FEWEST_HARMONICS, HARMONICS, Config
from vrscan.data.errors import InputError
from vrscan.ideal.natural_frequency import natural_frequency

LEAST_PHASES = 2  # operating points that a straight line needs
LEAST_DISTANCES = 2  # distances that tell an angle's scale from the triangle's
_SLOPE_TOLERANCE = 0.3  # of a slope, relative, and of what the first harmonic's may be


@dataclass(frozen=True)
class MirrorMap:
    """The outcome of a mirror's calibration."""

    config: Config  # the configuration with index mark, harmonics, slopes and drive phase
    fit: Fit
    natural_hz: dict[float, float]  # natural frequency that each drive phase tells
    before_mm: float  # mean absolute error in z of the overlaid periods before
    after_mm: float  # and after


def parameters(config: Config) -> list[Parameter]:
    """Return the mirror's 23 parameters: index mark, ten of harmonics, twelve slopes.

    Of a polygon it is the angle of the diode alone.
    """
    found = [index_parameter(config), *harmonic_parameters(config)]
    if config.mirror.polygon:
        return found
    rows = zip(HARMONICS, config.mirror.slopes, strict=True)
    for k, (size, phi) in list(rows)[:FEWEST_HARMONICS]:
        for name, value, least in (("a", size, 1e-5), ("phi", phi, 1e-2)):
            tolerance = _SLOPE_TOLERANCE * max(abs(value), least)
            found.append(Parameter(f"d{name}_{k}", "1/turn", value, tolerance))
    return found


def scan_angles(recording: Recording, config: Config) -> Floats:
    """Return the angles that an instrument of this configuration gives the points, rad [n]."""
    mirror = config.mirror
    phase = recording.setup.drive_phase
    away = 0.0 if phase is None else (phase - mirror.drive_phase + 0.5) % 1.0 - 0.5
    moved = away * np.array(mirror.slopes)
    return angles(recording, math.radians(mirror.index_deg), mirror.harmonics, moved)


def errors(recording: Recording, config: Config) -> Floats:
    """Return the errors in z of a scan's points, mm [n]."""
    x, z = located(recording, config, scan_angles(recording, config))
    return np.asarray(z - recording.setup.z(x))


def calibrate(recordings: Sequence[Recording], config: Config) -> MirrorMap:
    """Return the mirror's parameters from planes at known distances and several operating points.

    Args:
        recordings: The scans; those of an operating point in the order of the stage's positions.
        config: The coarse calibration.

    Raises:
        InputError: if there are too few operating points or distances, a scan has no drive phase or
            is not of a plane, or the stage does not go one way.
    """
    groups: dict[float | None, list[Recording]] = {}
    for each in recordings:
        if each.setup.kind != "plane":
            raise InputError(f"{each.name}: the mirror's calibration needs a plane")
        phase = None if config.mirror.polygon else each.setup.drive_phase
        if phase is None and not config.mirror.polygon:
            raise InputError(f"{each.name}: its setup has no drive_phase")
        groups.setdefault(phase, []).append(each)
    if len(groups) < LEAST_PHASES and not config.mirror.polygon:
        raise InputError(f"mirror: {len(groups)} operating points, needs {LEAST_PHASES}")
    for group in groups.values():
        if len({each.setup.z_mm for each in group}) < LEAST_DISTANCES:
            raise InputError(
                f"{group[0].name}: {len(group)} distance at this operating point, needs "
                f"{LEAST_DISTANCES}: a plane's error may be its distance's"
            )
        check_stage(group)
    wanted = parameters(config)
    folded = [each.folded() for each in recordings]
    weight = [px_per_mm(each, config) / np.hypot(each.sigma_px, SHAPE_PX) for each in folded]

    def residuals(values: Floats) -> Floats:
        own = configured(config, wanted, values)
        each = (w * errors(r, own) for w, r in zip(weight, folded, strict=True))
        return np.concatenate(list(each))

    fit = least_squares(residuals, wanted)
    own = configured(config, wanted, fit.values)

    def mean(of: Config) -> float:
        left = [np.mean(np.abs(each.overlaid(errors(each, of)))) for each in recordings]
        return float(np.mean(left))

    natural = {
        phase: natural_hz(config, group[0].setup.frequency_hz, phase)
        for phase, group in groups.items()
        if phase is not None
    }
    return MirrorMap(own, fit, natural, mean(config), mean(own))


def natural_hz(config: Config, frequency_hz: float, drive_phase: float) -> float:
    """Return the mirror's natural frequency, Hz, from its phase against the drive, VR-SCAN IV-D.

    Args:
        config: The configuration, with the mirror's quality and comb in ``mems``.
        frequency_hz: Frequency of the mirror.
        drive_phase: Phase that its loop measured, turns.
    """
    found = natural_frequency(
        np.array(frequency_hz),
        np.array((drive_phase + 0.5) % 1.0 - 0.5),
        math.radians(config.mirror.amplitude_deg),
        quality=config.mems.quality,
        comb_rad=math.radians(config.mems.comb_deg),
        duty=config.mirror.duty,
    )
    return float(found)
