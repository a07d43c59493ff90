"""How well a calibrated instrument measures a plane: its own points, and the overlaid periods."""

from dataclasses import dataclass, replace

import numpy as np

from vrscan.calibrate.mirror_map import scan_angles
from vrscan.calibrate.recording import Recording, located
from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.correction_maps import FieldMaps
from vrscan.data.residuals import rms
from vrscan.ideal.correction_map import correction

CELLS = 20  # parts of the field, by x, over which errors are averaged


@dataclass(frozen=True)
class Verified:
    """The errors of one scan of a plane, in percent of its distance where the name says so."""

    name: str
    z_mm: float
    focus_mm: float
    count: int
    mean_mm: float  # mean error
    overlaid_mm: float  # mean absolute error of the overlaid periods
    plane_percent: float  # largest absolute mean error of a cell of the field
    points_percent: float  # rms error of single points
    width_mm: float  # of the field


def measured(recording: Recording, config: Config, maps: FieldMaps | None) -> tuple[Floats, Floats]:
    """Return x and z of each point as a calibrated instrument gives them, mm [n].

    Args:
        recording: The scan, of any surface.
        config: Geometry and mirror as calibrated.
        maps: Correction maps, or None.
    """
    angle = scan_angles(recording, config)
    own = recording
    if maps is not None:
        lens = np.full(len(recording), maps.lens(recording.setup.focus_mm))
        length = config.sensor.line_length
        lacks = correction(
            recording.position_px, angle, lens, maps.corrections_px, line_length=length
        )
        own = replace(recording, position_px=recording.position_px + lacks)
    return located(own, config, angle)


def verified(recording: Recording, config: Config, maps: FieldMaps | None) -> Verified:
    """Return the errors of a scan of a plane; arguments as ``measured``."""
    x, z = measured(recording, config, maps)
    distance = recording.setup.z_mm
    error = z - recording.setup.z(x)
    cells = [np.mean(error[part]) for part in np.array_split(np.argsort(x), CELLS)]
    return Verified(
        name=recording.name,
        z_mm=distance,
        focus_mm=recording.setup.focus_mm,
        count=len(recording),
        mean_mm=float(np.mean(error)),
        overlaid_mm=float(np.mean(np.abs(recording.overlaid(error)))),
        plane_percent=100.0 * float(np.max(np.abs(cells))) / distance,
        points_percent=100.0 * rms(error) / distance,
        width_mm=float(np.ptp(x)),
    )
