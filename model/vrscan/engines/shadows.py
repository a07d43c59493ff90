"""What the camera cannot see of a free beam, because a surface found by other lines is before it.

A point at some pixel hides all that lies behind it on that pixel's line of sight. Where a free beam
crosses the line of sight behind the point, a surface on the beam would not be seen, so the beam is
free only up to there. The surfaces are those that the lines of a block and of the two blocks beside
it have found; what no line has found, such as a surface beyond the scan's ends, hides unnoticed.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.table import Table
from vrscan.ideal.chain import MIRROR_FLAGS
from vrscan.ideal.geometry import triangle, undistorted

BLOCK = 1024  # lines whose surfaces are taken together: six periods of the mirror
_BIN_PX = 16  # width of the strips of the sensor in which the nearest surface is kept


def shaded(tables: Iterable[Table], config: Config) -> Iterator[Table]:
    """Yield points in blocks of ``BLOCK`` lines; free intervals end where they are hidden.

    Args:
        tables: Points of rising line numbers, in parts of any size, which do not change the result.
        config: The configuration that the points were computed with.
    """
    before, now = _Block(None, config), _Block(None, config)
    for table in _blocks(tables):
        then = _Block(table, config)
        yield from now.cut([before, then])
        before, now = now, then
    yield from now.cut([before])


def _blocks(tables: Iterable[Table]) -> Iterator[Table]:
    """Yield points cut where ``BLOCK`` divides a line's number; no block is empty."""
    parts: list[Table] = []
    number = -1
    for table in tables:
        numbers = table.line // BLOCK
        for each in np.unique(numbers).tolist():
            if parts and each != number:
                yield Table.joined(parts)
                parts = []
            number = each
            parts.append(table.of(numbers == each))
    if parts:
        yield Table.joined(parts)


class _Block:
    """Points of a block, and the nearest surface in each strip of the sensor."""

    def __init__(self, table: Table | None, config: Config) -> None:
        self._table, self._config = table, config
        count = -(-config.sensor.line_length // _BIN_PX)
        self._edges = np.minimum(np.arange(count + 1) * _BIN_PX, config.sensor.line_length) - 0.5
        self._number = -2 if table is None else int(table.line[0]) // BLOCK
        self.nearest = np.full(count, np.inf)
        if table is None:
            return
        good = table.located.copy()
        for name in MIRROR_FLAGS:
            good &= ~table.flags[name]
        strip = np.clip((table.position_px[good] + 0.5) // _BIN_PX, 0, count - 1).astype(np.int64)
        np.minimum.at(self.nearest, strip, table.z_mm[good])
        # The edge of a surface lies beyond the last line that met it, by less than a strip.
        padded = np.pad(self.nearest, 1, constant_values=np.inf)
        self.nearest = np.minimum(np.minimum(padded[:-2], padded[1:-1]), padded[2:])

    def cut(self, others: list["_Block"]) -> Iterator[Table]:
        """Yield the points with the surfaces of this block and of those beside it."""
        table = self._table
        if table is None:
            return
        nearest = self.nearest
        for other in others:
            if abs(other._number - self._number) == 1:
                nearest = np.minimum(nearest, other.nearest)
        rows = np.flatnonzero(table.free_to_mm > 0.0)
        start, end = table.free_from_mm.copy(), table.free_to_mm.copy()
        if len(rows):
            hidden = self._hidden(table.angle_rad[rows], start[rows], nearest)
            step = self._config.geometry.unit_mm * 2.0**-pkg.FREE_FRACTION
            end[rows] = np.minimum(end[rows], np.floor(np.minimum(hidden, 1e6) / step) * step)
        none = end <= start
        start[none], end[none] = 0.0, 0.0
        yield replace(table, free_from_mm=start, free_to_mm=end)

    def _hidden(self, angle_rad: Floats, start_mm: Floats, nearest: Floats) -> Floats:
        """Return the z beyond ``start_mm`` from which beams at these angles may be hidden [n]."""
        geometry = self._config.geometry
        image, _ = undistorted(self._edges, geometry)
        found = triangle(image, angle_rad[:, None], geometry)
        # Before the mirror a line of sight crosses at 0, where the two are parallel nowhere.
        with np.errstate(invalid="ignore"):
            before = np.cos(geometry.bias_rad + np.arctan(image / geometry.focal_mm)
                            - angle_rad[:, None]) > 0.0  # fmt: skip
        z = np.where(found.no_range, np.where(before, 0.0, np.inf), found.z)
        behind = (nearest < z[:, 1:]) & (z[:, 1:] > start_mm[:, None])
        return np.where(behind.any(axis=1), z[np.arange(len(z)), behind.argmax(axis=1)], np.inf)
