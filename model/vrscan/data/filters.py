"""Filters of points after the scan, which take a table and give a table of the same rows.

A point that is removed loses its place, and keeps its row with all else that was measured of the
line. A point that is moved goes along its own beam; its flags stay. What each filter costs in
lateral resolution stands with it, in lines; docs/formats.md has the figures.
"""

from dataclasses import replace

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats
from vrscan.data.errors import InputError, nearest
from vrscan.data.range_image import sweeps
from vrscan.data.residuals import NORMAL
from vrscan.data.table import Table

MOST_LINES = 1001  # largest window of the median
MOST_SCANS = 1000
OUTLIER_LINES = 7  # window of ``outlier``


def median(points: Table, lines: int) -> Table:
    """Return points whose z is the median of the lines around them.

    An edge stays where it is and as steep as it is; what is narrower than half the window vanishes,
    and corners are cut. A point stays as it is where half of its window has none. sigma_z becomes
    that of a median of independent errors of the points' mean variance; neighbours that share
    their speckle gain less.

    Args:
        points: n points in the order of their lines.
        lines: Length of the window, odd, 3 to ``MOST_LINES``.

    Raises:
        InputError: if it is another number.
    """
    if not (3 <= lines <= MOST_LINES and lines % 2):
        raise InputError(f"--median: must be odd, 3 to {MOST_LINES} ({lines})")
    z = _around(np.where(points.located, points.z_mm, np.nan), lines)
    variance = _around(np.where(points.located, points.sigma_z_mm**2, np.nan), lines)
    count = np.isfinite(z).sum(axis=1)
    rows = points.located & (2 * count > lines)
    found, spread = points.z_mm.copy(), points.sigma_z_mm.copy()
    found[rows] = np.nanmedian(z[rows], axis=1)
    # pi / (2 n + pi - 2) is 1 for one point, and within 2 % of the variance of a median of more.
    gain = np.pi / (2.0 * count[rows] + np.pi - 2.0)
    spread[rows] = np.sqrt(gain * np.nanmean(variance[rows], axis=1))
    return _moved(points, found, spread)


def spike(points: Table, height_mm: float) -> Table:
    """Return points without those that stand out from both neighbours, to the same side.

    The neighbours are the points before and after it, across lines without one. A thing as wide as
    one line and higher than ``height_mm`` vanishes; edges and slopes stay as they are.

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
    return _without(points, rows[1:-1][out])


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
    """Return points whose z is the mean over some interlaced sweeps.

    The sweeps of a group, that follow each other, are laid over each other by angle, and each point
    becomes the mean of as many neighbours in angle as there are sweeps (an even number has half a
    neighbour at either end). Where the sweeps interlace, that is as wide as the lines of one sweep
    are apart, so an edge becomes that wide, with points in the air before it; what moves meanwhile
    is smeared over the group. sigma_z falls with the root of the number.

    Args:
        points: n points in the order of their lines.
        scans: Number of sweeps of a group, 2 to ``MOST_SCANS``. The last group may have fewer.

    Raises:
        InputError: if it is another number.
    """
    if not 2 <= scans <= MOST_SCANS:
        raise InputError(f"--average: must be 2 to {MOST_SCANS} ({scans})")
    sweep = sweeps(points.angle_rad)
    found, spread = points.z_mm.copy(), points.sigma_z_mm.copy()
    rows = np.flatnonzero(points.located)
    group = sweep[rows] // scans
    for part in np.split(rows, np.flatnonzero(np.diff(group)) + 1):
        if not len(part):
            continue
        order = part[np.argsort(points.angle_rad[part], kind="stable")]
        share = len(np.unique(sweep[part]))
        found[order], variance = _means(points.z_mm[order], points.sigma_z_mm[order] ** 2, share)
        spread[order] = np.sqrt(variance)
    return _moved(points, found, spread)


def outlier(points: Table, sigmas: float) -> Table:
    """Return points without those that are far from the median of the lines around them.

    Far is more than ``sigmas`` standard deviations, which are the larger of the point's own sigma_z
    and that of the lines around it, estimated from their median deviation (Hampel's filter). A
    thing narrower than half of ``OUTLIER_LINES`` and that high vanishes, and so may the corner of
    an edge; nothing is moved.

    Args:
        points: n points in the order of their lines.
        sigmas: Number of standard deviations, above 0; 4 or 5 is usual.

    Raises:
        InputError: if it is not above 0.
    """
    _check_above_0("--outlier", sigmas)
    z = _around(np.where(points.located, points.z_mm, np.nan), OUTLIER_LINES)
    rows = np.flatnonzero(points.located & (np.isfinite(z).sum(axis=1) >= 3))
    middle = np.nanmedian(z[rows], axis=1)
    spread = NORMAL * np.nanmedian(np.abs(z[rows] - middle[:, None]), axis=1)
    far = np.abs(points.z_mm[rows] - middle)
    return _without(points, rows[far > sigmas * np.maximum(spread, points.sigma_z_mm[rows])])


def _around(values: Floats, lines: int) -> Floats:
    """Return the values of the lines around each [n, lines], NaN beyond the ends."""
    padded = np.pad(values, lines // 2, constant_values=np.nan)
    return np.lib.stride_tricks.sliding_window_view(padded, lines)


def _means(z: Floats, variance: Floats, share: int) -> tuple[Floats, Floats]:
    """Return running means of values and their variances; a window at the end is narrower."""
    half, place = share / 2.0, np.arange(len(z), dtype=np.float64)
    reach = np.minimum(half, np.minimum(place, place[::-1]) + 0.5)  # to either side, in points

    def integral(values: Floats, at: Floats) -> Floats:
        """Return the sum of values up to a place that may be between two of them."""
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(np.interp(at, np.arange(len(total)) - 0.5, total))

    width = 2.0 * reach
    low, high = place - reach, place + reach
    offset = float(z[0])  # keeps the sums small
    mean = offset + (integral(z - offset, high) - integral(z - offset, low)) / width
    # Half a neighbour counts with a quarter of its variance, so two halves lack a half of one.
    part = np.where(np.rint(width) % 2 == 0, width - 0.5, width)
    spread = (integral(variance, high) - integral(variance, low)) / width
    return mean, spread * part / width**2


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
