"""The correction of positions by calibrated maps, VR-SCAN V-B step 3, in float64.

The paper makes a table from (alpha, x_s) to coordinates for each focus. Here a map holds what a
position on the sensor lacks, so that (3) to (5) remain, and a map of zeros changes nothing.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config
from vrscan.data.correction_maps import (
    COLUMNS,
    ROWS,
    FieldMaps,
    extension_mm,
    focus_of_mm,
    maps_of,
)
from vrscan.ideal.geometry import undistorted

ANGLE_STEP = 2.0 * np.pi / 256.0  # rad between two nodes; the middle one is at 0
BEYOND = 1.01  # focus of a thin lens's first map, over the farthest that has a lens position
STEP_BITS = 9  # its maps are so many steps of the lens apart, as a power of two
_NEWTON = 8


def maps_for(config: Config) -> FieldMaps | None:
    """Return the maps that a configuration corrects with: of a file, of a thin lens, or None.

    Raises:
        InputError: as ``maps_of``.
    """
    return thin_lens_maps(config) if config.map.thin_lens else maps_of(config)


def with_moving_lens(config: Config) -> Config:
    """Return a configuration for a lens that moves.

    Without maps it gets those of a thin lens, and the lens goes no nearer than they reach.
    """
    if config.map.file is not None:
        return config
    geometry, focus = config.geometry, config.focus
    last_mm = extension_mm(BEYOND * focus.far_mm, geometry.focal_mm)
    last_mm += 1e-3 * focus.resolution_um * (pkg.MAP_COUNT - 1) * 2**STEP_BITS
    # The depth in focus is along the camera's axis.
    axis_mm = focus_of_mm(last_mm, geometry.focal_mm)
    near_mm = max(focus.near_mm, axis_mm * float(np.sin(geometry.bias_rad)) + geometry.offset_mm)
    own = {
        "map": config.map.model_copy(update={"thin_lens": True}),
        "focus": focus.model_copy(update={"near_mm": near_mm}),
    }
    changed = config.model_copy(update=own)
    changed._source = config._source
    return changed


def thin_lens_maps(config: Config) -> FieldMaps:
    """Return what a calibration would find of a thin lens: its image's scale at each focus.

    The scale of (4) is f + e, e = f^2 / (g - f) the way of the lens for the depth g in focus; that
    of ``free.focus_mm`` is ``geometry.focal_mm``. The corrected position has the image coordinate
    (5) of the position, times the one scale over the other.
    """
    geometry, sensor = config.geometry, config.sensor
    focal, resolution = geometry.focal_mm, 1e-3 * config.focus.resolution_um
    reach = 2 ** (sensor.line_length - 1).bit_length()
    place = np.linspace(0.0, reach, COLUMNS)
    begin = round(extension_mm(BEYOND * config.focus.far_mm, focal) / resolution) * resolution
    step = resolution * 2**STEP_BITS
    own = focal + extension_mm(config.free.focus_mm, focal)
    u, _ = undistorted(place, geometry)
    rows = []
    for k in range(pkg.MAP_COUNT):
        wanted, corrected = u * own / (focal + begin + k * step), place.copy()
        for _ in range(_NEWTON):
            at, slope = undistorted(corrected, geometry)
            corrected -= (at - wanted) / slope
        rows.append(np.broadcast_to(corrected - place, (ROWS, COLUMNS)))
    nodes = np.array(rows)
    nothing = np.zeros(nodes.shape, np.bool_)
    return FieldMaps(focal, begin, step, nodes, nothing, np.zeros(len(nodes)))


def correction(
    position_px: Floats, angle_rad: Floats, lens: Floats, maps: Floats, *, line_length: int
) -> Floats:
    """Return the correction of positions: bilinear in each map, linear between two of them.

    Args:
        position_px: Positions on the sensor, px [n].
        angle_rad: Scan angles [n].
        lens: Positions of the lens in units of the maps' distance, 0 at the first [n].
        maps: Corrections, px [maps, 33, 65]; node (i, j) is for the angle (i - 16) / 256 turns and
            the position j R / 64, R = 2**ceil(log2(line_length)) px.
        line_length: Number of pixels of a line.

    Returns:
        Corrections, px [n]; beyond the outer nodes those of the nearest edge.
    """
    given = position_px, angle_rad, lens, len(maps), line_length
    return np.asarray(sum(weight * maps[corner] for weight, corner in _corners(*given)))


def filled_beside(
    position_px: Floats, angle_rad: Floats, lens: Floats, filled: Bools, *, line_length: int
) -> Bools:
    """Return whether one of the nodes around had no points when the maps were made [n].

    Args:
        position_px: As of ``correction``, and so are the others.
        angle_rad: Scan angles.
        lens: Positions of the lens.
        filled: Nodes without points [maps, 33, 65].
        line_length: Number of pixels of a line.
    """
    given = position_px, angle_rad, lens, len(filled), line_length
    return np.asarray(np.any([filled[corner] for _, corner in _corners(*given)], axis=0))


def _corners(
    position_px: Floats, angle_rad: Floats, lens: Floats, count: int, line_length: int
) -> Iterator[tuple[Floats, tuple[Ints, Ints, Ints]]]:
    """Yield weight and indices of each of the eight nodes around."""
    reach = 2 ** (line_length - 1).bit_length()
    column = np.clip(position_px / reach * (COLUMNS - 1), 0.0, COLUMNS - 1)
    row = np.clip(angle_rad / ANGLE_STEP + (ROWS - 1) // 2, 0.0, ROWS - 1)
    plane = np.clip(lens, 0.0, count - 1)
    lows = [
        np.minimum(np.floor(at), last - 1).astype(np.int64)
        for at, last in ((plane, count - 1), (row, ROWS - 1), (column, COLUMNS - 1))
    ]
    shares = [at - low for at, low in zip((plane, row, column), lows, strict=True)]
    for steps in itertools.product((0, 1), repeat=3):
        parts = [share if step else 1.0 - share for share, step in zip(shares, steps, strict=True)]
        k, i, j = (low + step for low, step in zip(lows, steps, strict=True))
        yield parts[0] * parts[1] * parts[2], (k, i, j)
