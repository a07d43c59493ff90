"""The coarse calibration of VR-SCAN V-B: all 18 parameters from a relief at known distances.

The parameters are the 5 of the triangle (2) to (4), the 2 of the lens (5), the 10 of the mirror's
harmonics k = 3 to 11 (12), and the angle of the index mark; of a polygon's mirror it is the angle
of its diode alone. The paper minimises the sum of the
errors in z by a simplex search; here robust least squares weighs each error by what it is in
pixels, and the simplex search runs beside it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vrscan.calibrate.recording import Recording, angles, located, px_per_mm
from vrscan.calibrate.solve import Fit, Parameter, least_squares, simplex
from vrscan.data.arrays import Floats
from vrscan.data.config import FEWEST_HARMONICS, HARMONICS, Config, Geometry, Mirror
from vrscan.data.errors import InputError
from vrscan.data.residuals import rms
from vrscan.scene import tolerances

LEAST_DISTANCES = 3
SIMPLEX_POINTS = 200  # of a scan that the simplex search takes, which evaluates more often
SIMPLEX_SCANS = 21  # that it takes
SHAPE_PX = 0.02  # error of a position beside its sigma: shape of the spot, pattern of the sensor
DISAGREES = 4.0  # rms residual of a scan over the median of all from which it is refused
SHARE_OF_RELIEF = 0.5  # least share of the stated amplitude that the points show
ROUGH = 1.5  # tolerances of the start over those of the instrument
# What the chain sees of a relief's amplitude beyond the stated one: the mean over a spot is less.
SEEN = Parameter("seen_mm", "mm", 0.0, 0.05)


@dataclass(frozen=True)
class Coarse:
    """The outcome of a coarse calibration."""

    config: Config  # the configuration with what was found
    fit: Fit
    mean_mm: float  # mean absolute error in z, overlaid, over all distances
    point_mm: float  # the same of single points
    simplex_values: Floats  # what the simplex search found, one a parameter
    simplex_mean_mm: float
    simplex_seconds: float
    simplex_calls: int
    start_mm: float  # mean absolute error in z with the start


def harmonic_parameters(config: Config) -> list[Parameter]:
    """Return the ten of the harmonics 3 to 11; a polygon, which turns evenly, has none."""
    share, found = tolerances.HARMONIC_SHARE, []
    if config.mirror.polygon:
        return []
    rows = zip(HARMONICS, config.mirror.harmonics, strict=True)
    for k, (size, phi) in list(rows)[1:FEWEST_HARMONICS]:
        found.append(Parameter(f"a_{k}", "", size, share * max(size, 1e-6)))
        found.append(Parameter(f"phi_{k}", "rad", phi, share))
    return found


def index_parameter(config: Config) -> Parameter:
    """Return the angle of the index mark, or of the diode of a polygon."""
    mark = math.degrees(1e-3 * tolerances.INDEX_MRAD)
    return Parameter("index_deg", "deg", config.mirror.index_deg, mark)


def parameters(config: Config) -> list[Parameter]:
    """Return the 18 parameters, of a polygon 8, and what a configuration may be wrong by."""
    geometry = config.geometry
    edge = 0.5 * config.sensor.line_length * geometry.pitch_mm
    found = [
        Parameter("base_mm", "mm", geometry.base_mm, tolerances.BASE_MM),
        Parameter("bias_deg", "deg", geometry.bias_deg, tolerances.BIAS_DEG),
        Parameter("offset_mm", "mm", geometry.offset_mm, tolerances.OFFSET_MM),
        Parameter("focal_mm", "mm", geometry.focal_mm, tolerances.FOCAL_SHARE * geometry.focal_mm),
        Parameter("centre_px", "px", geometry.centre_px, tolerances.CENTRE_PX),
        Parameter("k1", "mm^-2", geometry.k1, tolerances.DISTORTION_SHARE / edge**2),
        Parameter("k2", "mm^-4", geometry.k2, tolerances.DISTORTION_SHARE / edge**4),
        *harmonic_parameters(config),
        index_parameter(config),
    ]
    return [Parameter(p.name, p.unit, p.start, ROUGH * p.tolerance) for p in found]


def configured(config: Config, wanted: Sequence[Parameter], values: Floats) -> Config:
    """Return a configuration with other values of some parameters; all others stay."""
    geometry: dict[str, float] = {}
    mirror: dict[str, object] = {}
    rows = {"": np.array(config.mirror.harmonics), "d": np.array(config.mirror.slopes)}
    for each, value in zip(wanted, values.tolist(), strict=True):
        name, _, k = each.name.partition("_")
        if each.name in Geometry.model_fields:
            geometry[each.name] = value
        elif each.name in Mirror.model_fields:
            mirror[each.name] = value
        else:  # a_k and phi_k of the harmonics, da_k and dphi_k of their slopes
            which = "d" if name.startswith("d") else ""
            rows[which][HARMONICS.index(int(k)), int(name.endswith("phi"))] = value
    if not config.mirror.polygon:
        mirror |= {"harmonics": rows[""].tolist(), "slopes": rows["d"].tolist()}
    return config.model_copy(
        update={
            "geometry": config.geometry.model_copy(update=geometry),
            "mirror": config.mirror.model_copy(update=mirror),
        }
    )


def errors(recording: Recording, config: Config, seen_mm: float = 0.0) -> Floats:
    """Return the errors in z of a scan's points, mm [n], with a configuration.

    Args:
        recording: The scan.
        config: The configuration.
        seen_mm: What is seen of a relief's amplitude beyond the stated one.
    """
    mirror = config.mirror
    angle = angles(recording, math.radians(mirror.index_deg), mirror.harmonics)
    x, z = located(recording, config, angle)
    setup = recording.setup
    wave = seen_mm * setup.wave(x) if setup.kind == "relief" else 0.0
    return np.asarray(z - setup.z(x) - wave)


def calibrate(
    recordings: Sequence[Recording], config: Config, *, search: bool = True, most: int | None = None
) -> Coarse:
    """Return the parameters that fit scans of a relief at known distances.

    Args:
        recordings: The scans, in the order of the stage's positions, all with one focus.
        config: The rough start.
        search: Whether the simplex search runs, too.
        most: Largest number of its evaluations.

    Raises:
        InputError: if there are fewer than 3 distances, the focus changes, a relief is a plane, the
            stage does not go one way, or a scan disagrees with the others.
    """
    _check(recordings)
    wanted = parameters(config)
    free = [*wanted, SEEN]
    folded = [each.folded() for each in recordings]
    weight = [px_per_mm(each, config) / np.hypot(each.sigma_px, SHAPE_PX) for each in folded]

    def residuals(values: Floats) -> Floats:
        own, seen = configured(config, wanted, values[:-1]), float(values[-1])
        each = (w * errors(r, own, seen) for w, r in zip(weight, folded, strict=True))
        return np.concatenate(list(each))

    fit = least_squares(residuals, free)
    own = configured(config, wanted, fit.values[:-1])
    _agree(recordings, own)
    step = -(-len(recordings) // SIMPLEX_SCANS)
    few = [each.thinned(SIMPLEX_POINTS) for each in recordings[::step]]

    def cost(values: Floats) -> float:
        made = configured(config, wanted, values)
        return float(np.mean([np.mean(np.abs(errors(each, made))) for each in few]))

    values, seconds, calls = np.array([each.start for each in wanted]), 0.0, 0
    if search:
        values, seconds, calls = simplex(cost, wanted, most=most)
    return Coarse(
        config=own,
        fit=fit,
        mean_mm=mean_mm(recordings, own),
        point_mm=float(np.mean([np.mean(np.abs(errors(each, own))) for each in recordings])),
        simplex_values=values,
        simplex_mean_mm=mean_mm(recordings, configured(config, wanted, values)),
        simplex_seconds=seconds,
        simplex_calls=calls,
        start_mm=mean_mm(recordings, config),
    )


def mean_mm(recordings: Sequence[Recording], config: Config) -> float:
    """Return the mean absolute error in z of the overlaid periods, over all scans, mm."""
    return float(
        np.mean([np.mean(np.abs(each.overlaid(errors(each, config)))) for each in recordings])
    )


def _check(recordings: Sequence[Recording]) -> None:
    distances = [each.setup.z_mm for each in recordings]
    if len(set(distances)) < LEAST_DISTANCES:
        raise InputError(
            f"coarse: {len(set(distances))} distances; range, focal length and base need "
            f"{LEAST_DISTANCES} or more"
        )
    if len({each.setup.focus_mm for each in recordings}) > 1:
        raise InputError("coarse: the focus changes between scans; the image's scale goes with it")
    for each in recordings:
        _check_relief(each)
    check_stage(recordings)


def _check_relief(recording: Recording) -> None:
    """Refuse a scan in which there is no sine relief."""
    setup = recording.setup
    shown = 0.0
    if setup.kind == "relief" and setup.amplitude_mm > 0.0:
        turn = 2.0 * np.pi * recording.x_mm / setup.period_mm
        flat = np.stack([np.ones(len(turn)), recording.x_mm, np.square(recording.x_mm)], axis=1)
        design = np.concatenate([flat, np.sin(turn)[:, None], np.cos(turn)[:, None]], axis=1)
        found = np.linalg.lstsq(design, recording.z_mm, rcond=None)[0]
        shown = float(np.hypot(*found[-2:])) / setup.amplitude_mm
    if shown < SHARE_OF_RELIEF:
        raise InputError(
            f"{recording.name}: a relief that is a plane ({shown:.0%} of its amplitude is seen); "
            f"base, focal length and angles cannot be told apart on it"
        )


def check_stage(recordings: Sequence[Recording]) -> None:
    """Refuse scans whose distances do not go one way, as stated or as measured.

    Raises:
        InputError: naming the scan at which the stage turns.
    """
    stated = np.array([each.setup.z_mm for each in recordings])
    seen = np.array([float(np.median(each.z_mm)) for each in recordings])
    for name, values in (("stated", stated), ("measured", seen)):
        steps = np.diff(values)
        turned = np.flatnonzero(np.sign(steps) != np.sign(stated[-1] - stated[0]))
        if len(turned):
            at = int(turned[0]) + 1
            raise InputError(
                f"{recordings[at].name}: the stage does not go one way: {name} distance "
                f"{values[at]:.2f} mm behind {values[at - 1]:.2f} mm"
            )


def _agree(recordings: Sequence[Recording], config: Config) -> None:
    """Refuse a scan that the others contradict."""
    left = np.array([rms(px_per_mm(each, config) * errors(each, config)) for each in recordings])
    worst = int(np.argmax(left))
    usual = float(np.median(left))
    if left[worst] > DISAGREES * usual:
        raise InputError(
            f"{recordings[worst].name}: disagrees with the other scans: its points are off by "
            f"{left[worst]:.2f} px rms, theirs by {usual:.2f}; its distance may be wrong"
        )
