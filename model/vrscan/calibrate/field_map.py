"""The correction maps of VR-SCAN V-B step 3: planes over the whole field at several foci.

A map holds by how much a position on the sensor is off, over scan angle and position: with the
calibrated angle of each point, the known plane says where its spot would have been. Spot shape,
blur, and whatever (3) to (5) leave of the lens are in it.

A map is the smooth surface nearest to the points: bilinear between its nodes, weighted by the
points' standard deviations, with a penalty on the second differences of the nodes. A node that has
no points around it is filled by the same rule, the continuation with the least second differences
that also stays near to its neighbours, and is flagged.
"""

import math
from collections.abc import Sequence

import numpy as np

from vrscan.calibrate.coarse import check_stage
from vrscan.calibrate.mirror_map import scan_angles
from vrscan.calibrate.recording import PLACES, Recording
from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import Config
from vrscan.data.correction_maps import COLUMNS, ROWS, FieldMaps, extension_mm  # the file's
from vrscan.data.errors import InputError
from vrscan.data.residuals import rms, robust_sigma
from vrscan.ideal.correction_map import ANGLE_STEP
from vrscan.ideal.geometry import project

LEAST_PLANES = 2  # at each focus
OUTLIER = 4.0  # robust standard deviations from which a point is left out
_ROUNDS = 3  # fits, each without the outliers of the one before
_BEND = 30.0  # weight of a second difference, 1/px: that of a point of 0.03 px
_LEVEL = 0.3  # weight of a first difference, 1/px, which only fills
_SPECKLE_PX = 0.1  # error of a position beside its sigma: grain and shape of the spot
_LEAST_SHARE = 1.0  # sum of a node's weights over the points from which it is known


def calibrate(recordings: Sequence[Recording], config: Config) -> FieldMaps:
    """Return the maps from planes at known distances, one map a focus.

    Args:
        recordings: The scans; those of a focus in the order of the stage's positions.
        config: Geometry and mirror as calibrated before.

    Raises:
        InputError: if a focus has too few distances, the foci are not evenly spaced over the
            position of the lens, the stage does not go one way, or a scan is not of a plane.
    """
    groups: dict[float, list[Recording]] = {}
    for each in recordings:
        if each.setup.kind != "plane":
            raise InputError(f"{each.name}: the map needs a plane")
        groups.setdefault(each.setup.focus_mm, []).append(each)
    # The lens comes nearer to infinity's position with the distance in focus.
    foci = sorted(groups, reverse=True)
    focal = config.geometry.focal_mm
    places = np.array([extension_mm(focus, focal) for focus in foci])
    if len(foci) < 2:
        raise InputError(f"map: {len(foci)} focus position, needs 2 or more")
    step = float(np.mean(np.diff(places)))
    if np.abs(np.diff(places) - step).max() > 0.02 * step:
        raise InputError(
            f"map: foci at {', '.join(f'{focus:g}' for focus in foci)} mm are not evenly spaced "
            f"over the position of the lens"
        )
    made = [_map(groups[focus], config) for focus in foci]
    return FieldMaps(
        focal_mm=focal,
        lens_begin_mm=float(places[0]),
        lens_step_mm=step,
        corrections_px=np.stack([each[0] for each in made]),
        filled=np.stack([each[1] for each in made]),
        residual_px=np.array([each[2] for each in made]),
    )


def lacking_px(recording: Recording, config: Config) -> tuple[Floats, Floats]:
    """Return the calibrated angle of each point, rad, and what its position lacks, px [n]."""
    angle = scan_angles(recording, config)
    z = np.full(len(recording), recording.setup.z_mm)
    wanted = project(z * np.tan(angle), z, config.geometry)
    return angle, np.asarray(wanted - recording.position_px)


def _map(group: Sequence[Recording], config: Config) -> tuple[Floats, Bools, float]:
    """Return a focus's nodes, px [33, 65], which of them were filled, and the rms residual."""
    from scipy.sparse import csr_matrix, vstack
    from scipy.sparse.linalg import splu

    if len({each.setup.z_mm for each in group}) < LEAST_PLANES:
        raise InputError(
            f"{group[0].name}: {len(group)} distance at this focus, needs {LEAST_PLANES}: a map "
            f"over angle and position needs a field, not a line"
        )
    check_stage(group)
    sides, values, weights = [], [], []
    for each in group:
        angle, lacking = lacking_px(each, config)
        good = np.isfinite(lacking)
        sides.append(_weights(each.position_px[good], angle[good], config))
        values.append(lacking[good])
        # Points of one angle share their speckle, where the stage stood.
        repeats = max(1.0, good.sum() / PLACES)
        weights.append(1.0 / np.hypot(each.sigma_px[good], _SPECKLE_PX) / math.sqrt(repeats))
    design, value, weight = vstack(sides).tocsr(), np.concatenate(values), np.concatenate(weights)
    smooth = _penalty()
    kept = np.ones(len(value), np.bool_)
    nodes = np.zeros(ROWS * COLUMNS)
    for _ in range(_ROUNDS):
        own = csr_matrix(design[kept].multiply(weight[kept][:, None]))
        left = (own.T @ own + smooth).tocsc()
        nodes = splu(left).solve(own.T @ (weight * value)[kept])
        off = value - design @ nodes
        spread = robust_sigma(off[kept])
        kept = np.abs(off) <= OUTLIER * max(spread, 1e-6)
    known = np.asarray(np.abs(design[kept]).sum(axis=0)).ravel() >= _LEAST_SHARE
    return nodes.reshape(ROWS, COLUMNS), ~known.reshape(ROWS, COLUMNS), rms(off[kept])


def _weights(position_px: Floats, angle_rad: Floats, config: Config) -> "object":
    """Return the matrix [n, nodes] that takes the nodes to the corrections of n points."""
    from scipy.sparse import csr_matrix

    reach = 2 ** (config.sensor.line_length - 1).bit_length()
    column = np.clip(position_px / reach * (COLUMNS - 1), 0.0, COLUMNS - 1)
    row = np.clip(angle_rad / ANGLE_STEP + (ROWS - 1) // 2, 0.0, ROWS - 1)
    j = np.minimum(column.astype(np.int64), COLUMNS - 2)
    i = np.minimum(row.astype(np.int64), ROWS - 2)
    a, b = row - i, column - j
    index = np.stack([i * COLUMNS + j, i * COLUMNS + j + 1], axis=1)
    index = np.concatenate([index, index + COLUMNS], axis=1)
    share = np.stack([(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b], axis=1)
    rows = np.repeat(np.arange(len(i)), 4)
    return csr_matrix((share.ravel(), (rows, index.ravel())), (len(i), ROWS * COLUMNS))


def _penalty() -> "object":
    """Return the matrix of the weighted squares of the nodes' differences [nodes, nodes]."""
    from scipy.sparse import diags, eye, kron

    total = None
    for size, other, swap in ((ROWS, COLUMNS, False), (COLUMNS, ROWS, True)):
        bend = diags([1.0, -2.0, 1.0], [0, 1, 2], (size - 2, size))
        step = diags([-1.0, 1.0], [0, 1], (size - 1, size))
        square = _BEND**2 * (bend.T @ bend) + _LEVEL**2 * (step.T @ step)
        part = kron(eye(other), square) if swap else kron(square, eye(other))
        total = part if total is None else total + part
    return total
