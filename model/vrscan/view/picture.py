"""The numbers that the page's pictures are drawn from."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vrscan.data.arrays import Floats
from vrscan.data.table import Table

DOUBTS = (
    *("LOW_SNR", "TOO_NARROW", "TOO_WIDE", "AT_EDGE", "SATURATED", "RIVAL", "NO_PHASE", "MIXED"),
    *("NOT_RUNNING", "INDEX_FAULT", "UNSETTLED"),
)
BEAMS = 300  # most free beams that are drawn
_SPARE = 0.08  # of a range, on either side of what is in it
_ROOM = 1.8  # how much larger than needed a range may become

Columns = dict[str, npt.NDArray[np.float64]]


@dataclass(frozen=True)
class Profile:
    """Points as columns x and z, and lines as columns x0, z0, x1 and z1, all in mm."""

    sound: Columns
    doubtful: Columns  # points with a flag of ``DOUBTS``
    sigma: Columns  # from one sigma before a point to one behind it, along its beam
    free: Columns  # the free parts of beams without a point


def profile(points: Table) -> Profile:
    """Return the profile of points."""
    doubt = np.any([points.flags[name] for name in DOUBTS], axis=0)
    slope = np.tan(points.angle_rad)
    beams = np.flatnonzero(points.free_to_mm > points.free_from_mm)[-BEAMS:]
    from_mm, to_mm = points.free_from_mm[beams], points.free_to_mm[beams]
    rows = points.located & (points.sigma_z_mm > 0.0)
    z, sigma = points.z_mm[rows], points.sigma_z_mm[rows]
    return Profile(
        _places(points, points.located & ~doubt),
        _places(points, points.located & doubt),
        _beam(slope[rows], z - sigma, z + sigma),
        _beam(slope[beams], from_mm, to_mm),
    )


def _places(points: Table, rows: npt.NDArray[np.bool_]) -> Columns:
    return {"x": points.x_mm[rows], "z": points.z_mm[rows]}


def _beam(slope: Floats, near: Floats, far: Floats) -> Columns:
    return {"x0": slope * near, "z0": near, "x1": slope * far, "z1": far}


def followed(present: tuple[float, float], values: Floats) -> tuple[float, float]:
    """Return the range of an axis that shows values; it stays while they are in it and fill it.

    Args:
        present: The range at present.
        values: The values; the outermost hundredth on either side may lie outside.
    """
    if not len(values):
        return present
    low, high = np.quantile(values, (0.01, 0.99)).tolist()
    spare = _SPARE * max(high - low, 1.0)
    inside = present[0] <= low and high <= present[1]
    if inside and present[1] - present[0] < _ROOM * (high - low + 2.0 * spare):
        return present
    return low - spare, high + spare
