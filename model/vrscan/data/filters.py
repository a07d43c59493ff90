"""Filters of points after the scan, which take a table and give a table of the same rows.

A point that is removed loses its place, and keeps its row with all else that was measured of the
line. A point that is moved goes along its own beam; its flags stay.

``median`` and ``average`` move a point towards what its neighbours say of it. In 1/z over the
tangent of the angle a plane is a straight line, so the neighbours' line at the point's own angle is
what they say, whatever the slope. How far the point goes follows from how well points agree with
their neighbours around it (James and Stein's estimator): all the way to the weighted mean where
they differ by no more than their sigmas, not at all at an edge or on a surface that the lines
sample too coarsely. docs/formats.md has what that gains on every shipped scene.
"""

from dataclasses import dataclass, replace

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.errors import InputError, nearest
from vrscan.data.range_image import sweeps
from vrscan.data.residuals import NORMAL
from vrscan.data.table import Table

MOST_LINES = 1001  # largest window of the median
MOST_SCANS = 100  # speckle of more sweeps is hardly another one
OUTLIER_LINES = 7  # window of ``outlier``

_MOVED = tuple(float(k) for k in (0, 0.25, 0.5, 1, 1.4, 1.85, 2.2, 2.8, 3.65, 4.5, 6))
_SHARED = tuple(float(k) for k in (0.9, 0.77, 0.56, 0.22, 0, -0.17, -0.25, -0.25, -0.1, -0.03, 0))
_DOUBT = 0.1  # share of a variance that the lines beside it added, from which on it is an edge
_SIGMAS = 3.0  # distance from a straight line at which a window ends
_STEEPEST = 1.5  # dz/dx of a surface on which a spot is too long for neighbours to tell its error
_NEAR = 8  # sweeps that have to agree; as many of their lines are as far apart as two of one
_LEAST = 0.2  # of its own sigma a point keeps: errors that all neighbours share
_AT_ONCE = 1 << 22  # elements of the largest array


def correlation(moved: Floats) -> Floats:
    """Return the correlation of the errors of two points of one surface [...].

    The speckle that moves a point is the pixels' own, so what counts is how far the spot has moved
    on the sensor, and it counts in the root of the window's width. Measured on the simulator over
    all shipped scenes, 0.25 to 1 m away, in focus and far out of it: in these units the scenes
    agree within 0.08, over the angle within 0.11. At the same angle it is 0.9, then about 0.45
    after 0.9 mrad and 0.2 after 1.4 mrad. Different noise, which is independent, makes up the rest.

    Args:
        moved: Distance of the positions, px, over the root of the window's width, px [...].
    """
    return np.asarray(np.interp(np.abs(moved), _MOVED, _SHARED))


def median(points: Table, lines: int) -> Table:
    """Return points that are moved towards the median of their neighbours in the same sweep.

    The neighbours are as many on either side, half of ``lines`` or fewer: a window ends at the end
    of the sweep, at a line without a point, at a point with one of the flags MIXED and RIVAL or
    with a doubt, and before a point that is off the window's straight line.

    Args:
        points: n points in the order of their lines.
        lines: Length of the window, odd, 3 to ``MOST_LINES``.

    Returns:
        The points, with sigma_z of what the median gained, correlated errors counted as such.

    Raises:
        InputError: if it is another number.
    """
    if not (3 <= lines <= MOST_LINES and lines % 2):
        raise InputError(f"--median: must be odd, 3 to {MOST_LINES} ({lines})")
    rows = np.flatnonzero(_plain(points))
    number = points.line[rows]
    apart = np.diff(number) > (np.median(np.diff(points.line)) if len(points) > 1 else 1)
    apart |= np.diff(sweeps(points.angle_rad)[rows]) != 0
    run = np.cumsum(np.concatenate([[0], apart]))[: len(rows)]
    return _smoothed(points, rows, run, lines // 2, robust=True)


def spike(points: Table, height_mm: float) -> Table:
    """Return points without those that stand out from both neighbours, to the same side.

    The neighbours are the points before and after it in the same sweep, across lines without one. A
    thing as wide as one line and higher than ``height_mm`` vanishes; edges, slopes and the ends of
    sweeps stay as they are.

    Args:
        points: n points in the order of their lines.
        height_mm: Least difference of z to either neighbour, above 0.

    Raises:
        InputError: if it is not above 0.
    """
    _check_above_0("--spike", height_mm)
    rows = np.flatnonzero(points.located)
    step = np.diff(points.z_mm[rows])
    before, behind = step[:-1], -step[1:]
    out = (np.minimum(before, behind) > height_mm) | (np.maximum(before, behind) < -height_mm)
    sweep = sweeps(points.angle_rad)[rows]
    out &= sweep[:-2] == sweep[2:]
    return _without_alone(points, rows[1:-1][out], np.full(int(out.sum()), height_mm))


def min_confidence(points: Table, least: float) -> Table:
    """Return points without those whose c_obj is below ``least``, 0 to 1; the others stay exactly.

    Raises:
        InputError: if ``least`` is not 0 to 1.
    """
    if not 0.0 <= least <= 1.0:
        raise InputError(f"--min-confidence: must be 0 to 1 ({least:g})")
    return _without(points, points.c_obj < least)


def without_flags(points: Table, names: str) -> Table:
    """Return points without those that have one of some flags; the others stay exactly.

    Args:
        points: The points.
        names: Names of flags, with commas between them.

    Raises:
        InputError: if there is no such flag.
    """
    out = np.zeros(len(points), np.bool_)
    for name in names.split(","):
        if name not in pkg.FLAGS:
            raise InputError(f"--without: no such flag: {name!r}{nearest(name, pkg.FLAGS)}")
        out |= points.flags[name]
    return _without(points, out)


def average(points: Table, scans: int) -> Table:
    """Return points that are moved towards the mean over some interlaced sweeps.

    The sweeps of a group, that follow each other, are laid over each other by angle. The neighbours
    are half as many on either side as there are sweeps, so where the sweeps interlace a window is
    as wide as the lines of one sweep are apart. It ends as that of ``median`` does. What moves
    meanwhile stays as it is where that can be seen.

    Args:
        points: n points in the order of their lines.
        scans: Number of sweeps of a group, 2 to ``MOST_SCANS``. The last group may have fewer.

    Returns:
        The points, with sigma_z of what the mean gained, correlated errors counted as such.

    Raises:
        InputError: if it is another number.
    """
    if not 2 <= scans <= MOST_SCANS:
        raise InputError(f"--average: must be 2 to {MOST_SCANS} ({scans})")
    return _smoothed(points, *_merged(points, scans, _plain(points)), scans // 2, robust=False)


def outlier(points: Table, sigmas: float) -> Table:
    """Return points without those that are far from the lines around them.

    Far is more than ``sigmas`` standard deviations off the straight line through the
    ``OUTLIER_LINES`` lines around, of the same sweep and as many on either side, by medians
    (Theil's slope, Hampel's filter). The standard deviation is the larger of the point's own
    sigma_z and that of these lines. A thing narrower than half of the lines and that high vanishes,
    and so may the corner of an edge; nothing is moved.

    Args:
        points: n points in the order of their lines.
        sigmas: Number of standard deviations, above 0; 4 or 5 is usual.

    Raises:
        InputError: if it is not above 0.
    """
    _check_above_0("--outlier", sigmas)
    tangent, near, sigma = _straight(points)
    sweep = sweeps(points.angle_rad)
    beside = np.arange(OUTLIER_LINES) - OUTLIER_LINES // 2
    place = np.arange(len(points))[:, None] + beside
    inside = (place >= 0) & (place < len(points))
    place = np.where(inside, place, place[:, [OUTLIER_LINES // 2]])
    same = inside & points.located[place] & (sweep[place] == sweep[:, None])
    same &= same[:, ::-1] & points.located[:, None]
    rows = np.flatnonzero(same.sum(axis=1) >= 5)
    place, same = place[rows], same[rows]
    away = np.where(same, tangent[place] - tangent[rows, None], np.nan)
    height = np.where(same, near[place] - near[rows, None], np.nan)
    first, second = np.triu_indices(OUTLIER_LINES, 1)
    step = away[:, second] - away[:, first]
    with np.errstate(invalid="ignore", divide="ignore"):
        slopes = np.where(step != 0.0, (height[:, second] - height[:, first]) / step, np.nan)
    slopes[np.isnan(slopes).all(axis=1)] = 0.0
    height -= np.nanmedian(slopes, axis=1)[:, None] * away
    middle = np.nanmedian(height, axis=1)
    spread = NORMAL * np.nanmedian(np.abs(height - middle[:, None]), axis=1)
    limit = sigmas * np.maximum(spread, sigma[rows])
    out = np.abs(middle) > limit
    return _without_alone(points, rows[out], limit[out] * points.z_mm[rows[out]] ** 2)


@dataclass(frozen=True)
class _Agreement:
    """What neighbours say of n points: by how much each differs from it, in 1/z, 1/mm.

    ``reach`` is the number of neighbours on either side, 0 where none agree. ``own`` is the
    covariance of the difference and the point's own error, ``variance`` that of the difference.
    ``scatter`` is the mean of difference^2 / variance over ``count`` points around each; it is 1
    where errors are as they say and nothing else makes points differ.
    """

    reach: Ints
    difference: Floats
    own: Floats
    variance: Floats
    scatter: Floats
    count: Floats


def _plain(points: Table) -> Bools:
    """Return which points are one spot on one surface, as far as is known [n]."""
    doubtful = points.doubt_px**2 > _DOUBT * points.sigma_px**2
    unclear = points.flags["MIXED"] | points.flags["RIVAL"] | doubtful
    return points.located & (points.sigma_z_mm > 0.0) & (points.z_mm > 0.0) & ~unclear


def _merged(points: Table, scans: int, some: Bools) -> tuple[Ints, Ints]:
    """Return the rows of some points by angle within each group of sweeps, and their groups."""
    group = sweeps(points.angle_rad) // scans
    rows = np.flatnonzero(some)
    rows = rows[np.lexsort((points.angle_rad[rows], group[rows]))]
    return rows, group[rows]


def _without_alone(points: Table, rows: Ints, limit_mm: Floats) -> Table:
    """Return points without those that no sweep of that time confirms.

    Args:
        points: n points.
        rows: Those that are to go [m].
        limit_mm: Least difference of z to the next points on either side, by angle among ``_NEAR``
            sweeps, of each that goes [m].
    """
    among, group = _merged(points, _NEAR, points.located)
    place = np.empty(len(points), np.int64)
    place[among] = np.arange(len(among))
    alone = np.ones(len(rows), np.bool_)
    for step in (-1, 1):
        beside = np.clip(place[rows] + step, 0, len(among) - 1)
        same = (group[beside] == group[place[rows]]) & (among[beside] != rows)
        alone &= ~same | (np.abs(points.z_mm[among[beside]] - points.z_mm[rows]) > limit_mm)
    return _without(points, rows[alone])


def _straight(points: Table) -> tuple[Floats, Floats, Floats]:
    """Return tan(angle), 1/z and sigma of 1/z, in which a plane is a straight line [n] each."""
    near = 1.0 / np.where(points.located & (points.z_mm > 0.0), points.z_mm, np.inf)
    return np.tan(points.angle_rad), near, points.sigma_z_mm * near**2


def _smoothed(points: Table, rows: Ints, run: Ints, reach: int, *, robust: bool) -> Table:
    """Return points of which some are moved towards what their neighbours say.

    A sweep does not see what lies between its lines, such as a thread of their distance, so the
    sweeps of that time have to lie on a straight line as well, over a line's distance to either
    side.

    Args:
        points: n points.
        rows: Points that may be moved, in the order of their angles in each run [m].
        run: Number of the run of each, never falling [m]; a window lies in one run.
        reach: Most neighbours on either side.
        robust: Whether the neighbours' median counts, or their mean.
    """
    if not len(rows):
        return points
    found = _agreement(points, rows, run, reach, robust=robust)
    among, group = _merged(points, _NEAR, _plain(points))
    near = _agreement(points, among, group, _NEAR, robust=False)
    scatter = np.full(len(points), np.inf)
    scatter[among] = np.where(near.reach == _NEAR, near.scatter, np.inf)
    scatter = np.maximum(found.scatter, scatter[rows])
    # With M points that differ by S, James and Stein's estimator goes (1 - 2/M) / S of the way to
    # the best weighted mean, and its variance falls by (1 + 2/M) of that share of the mean's gain,
    # of which half of 2/M is counted because S is known as badly.
    part = np.clip((1.0 - 2.0 / found.count) / np.maximum(scatter, 1e-9), 0.0, 1.0)
    known = np.minimum(part * (1.0 + 1.0 / found.count), 1.0)
    number = 2.0 * found.reach
    weight = np.clip(found.own / found.variance, 0.0, number / (number + 1.0))
    gain = weight * (2.0 * found.own - weight * found.variance)
    _, inverse, sigma = (each[rows] for each in _straight(points))
    moved = inverse - part * weight * found.difference
    sigma = np.sqrt(np.maximum(sigma**2 - known * gain, (_LEAST * sigma) ** 2))
    some = part * weight > 0.0
    z, spread = points.z_mm.copy(), points.sigma_z_mm.copy()
    z[rows[some]] = 1.0 / moved[some]
    spread[rows[some]] = (sigma / moved**2)[some]
    return _moved(points, z, spread)


def _agreement(points: Table, rows: Ints, run: Ints, reach: int, *, robust: bool) -> _Agreement:
    """Return what neighbours say of points; arguments as of ``_smoothed``."""
    count = len(rows)
    own, variance, difference = np.zeros(count), np.ones(count), np.zeros(count)
    reached = np.zeros(count, np.int64)
    place = np.arange(count)
    first, end = np.searchsorted(run, run, "left"), np.searchsorted(run, run, "right")
    room = np.minimum(place - first, end - 1 - place)
    tangent, inverse, sigma = (each[rows] for each in _straight(points))
    position, width = points.position_px[rows], np.sqrt(np.maximum(points.width[rows], 1))
    half = min(reach, int(room.max()))
    while half:
        beside = np.concatenate([np.arange(-half, 0), np.arange(1, half + 1)])
        todo = np.flatnonzero((reached == 0) & (room >= half))
        pieces = max(1, len(todo) * (2 * half) ** 2 // _AT_ONCE)
        for at in np.array_split(todo, pieces):
            window = at[:, None] + beside
            away = tangent[window] - tangent[at, None]
            height = inverse[window] - inverse[at, None]
            each = sigma[window]
            mean = away.mean(axis=1, keepdims=True)
            square = np.square(away - mean).sum(axis=1, keepdims=True)
            lever = (away - mean) / np.where(square > 0.0, square, np.inf)
            slope = (lever * height).sum(axis=1, keepdims=True)
            weight = 1.0 / (2 * half) - mean * lever  # of the line at the point's own angle
            line = (weight * height).sum(axis=1)
            off = np.abs(height - line[:, None] - slope * away)
            steep = -slope[:, 0] / (inverse[at] + line - slope[:, 0] * tangent[at])  # dz/dx
            good = (off <= _SIGMAS * each).all(axis=1) & (np.abs(steep) <= _STEEPEST)
            good &= np.abs(line) <= 1.5 * _SIGMAS * sigma[at]
            at, weight, each, line = at[good], weight[good], each[good], line[good]
            if robust:
                line = np.median((height - slope * away)[good], axis=1)
            spot = position[window[good]]
            shared = correlation((spot[:, :, None] - spot[:, None]) / width[at, None, None])
            shared[:, np.arange(2 * half), np.arange(2 * half)] = 1.0
            shared *= each[:, :, None] * each[:, None]
            spread = np.einsum("ni,nij,nj->n", weight, shared, weight)
            if robust:  # the variance of a median over that of a mean, of so many with a slope
                spread *= max(1.0, np.pi / 2.0 - 1.0 / half)
            shared = correlation((spot - position[at, None]) / width[at, None])
            cross = (weight * each * shared).sum(axis=1) * sigma[at]
            own[at] = sigma[at] ** 2 - cross
            variance[at] = np.maximum(sigma[at] ** 2 - 2.0 * cross + spread, 1e-3 * sigma[at] ** 2)
            difference[at], reached[at] = -line, half
        half = half - 1 if half <= _NEAR else half * 3 // 4
    ratio = np.where(reached > 0, difference**2 / variance, 0.0)
    far = ratio > _SIGMAS**2
    # Points around: those within twice the reach, of the same run, that have neighbours.
    low = np.maximum(place - 2 * reach - 1, first)
    high = np.minimum(place + 2 * reach + 2, end)

    def around(values: Floats | Bools) -> Floats:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(total[high] - total[low])

    number = np.maximum(around(reached > 0), 1.0)
    scatter = around(np.minimum(ratio, 2.0 * _SIGMAS**2)) / number
    scatter[far | (reached == 0)] = np.inf
    return _Agreement(reached, difference, own, variance, scatter, number)


def _moved(points: Table, z_mm: Floats, sigma_z_mm: Floats) -> Table:
    """Return points moved along their beams to another z."""
    x = points.x_mm + (z_mm - points.z_mm) * np.tan(points.angle_rad)
    return replace(points, x_mm=x, z_mm=z_mm, sigma_z_mm=sigma_z_mm)


def _without(points: Table, rows: Bools | np.ndarray) -> Table:
    """Return points of which some have lost their place."""
    located = points.located.copy()
    located[rows] = False
    return replace(points, located=located)


def _check_above_0(name: str, value: float) -> None:
    if not 0.0 < value < np.inf:  # also refuses NaN
        raise InputError(f"{name}: must be above 0 ({value:g})")
