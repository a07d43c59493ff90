"""A stream of points in whole sweeps of the mirror, as they come, at this machine's times.

Where a sweep begins is what ``range_image.sweeps`` says, and the same points are cut at the same
lines in whatever blocks they come.
"""

import math
from itertools import pairwise

import numpy as np

from vrscan.data.config import Config
from vrscan.data.range_image import Grid, grid, sweeps
from vrscan.data.table import Table
from vrscan.ideal.motion import motion

MOST_LINES = 4096  # of a sweep, more than any has: a mirror that stands has no turning point
DRIFT = 1e-4  # most by which a board's clock and this machine's go apart, s/s
JUMP_S = 1.0  # a change that is no delay: one of the clocks was set anew


class Sweeps:
    """Cuts points into the sweeps of the mirror.

    Args:
        count: Number of sweeps that stay together.
    """

    def __init__(self, count: int = 1) -> None:
        self._count = count
        self._held: Table | None = None  # lines that are not given out yet
        self._known = 0  # the first of them were: they show in which direction the mirror went

    def take(self, points: Table) -> list[Table]:
        """Return the sweeps that the next points make whole, in their order.

        A sweep is whole with the first point of the next one, or with ``MOST_LINES``.
        """
        held = points if self._held is None else Table.joined([self._held, points])
        angle = held.angle_rad
        begins = np.flatnonzero(np.diff(sweeps(angle, exact=True))) + 1
        ends = [self._known, *begins[begins > self._known].tolist()][:: self._count]
        if len(held) - ends[-1] >= MOST_LINES * self._count:
            ends.append(len(held))
        if len(ends) == 1:
            self._held = held
            return []
        moved = np.flatnonzero(np.diff(angle[: ends[-1]]))
        first = int(moved[-1]) if len(moved) else ends[-1]
        self._held, self._known = held.of(slice(first, None)), ends[-1] - first
        return [held.of(slice(begin, end)) for begin, end in pairwise(ends)]


class HostTime:
    """Tells how far this machine's clock is ahead of a board's, from when points come.

    No point comes before it was measured, so the least delay so far says it best; it may grow by
    ``DRIFT``. The least delay of the link remains in it.
    """

    def __init__(self) -> None:
        self._ahead_s, self._board_s = math.inf, 0.0

    def ahead(self, board_s: float, now_s: float) -> float:
        """Return this machine's time less that of the board, s.

        Args:
            board_s: The board's time of the last point that has come.
            now_s: This machine's time at which it has come.
        """
        ahead = now_s - board_s
        most = self._ahead_s + DRIFT * (board_s - self._board_s)
        self._ahead_s = ahead if ahead > most + JUMP_S else min(ahead, most)
        self._board_s = board_s
        return self._ahead_s


def columns(config: Config, step: int = 1, count: int = 1) -> Grid:
    """Return columns over all that a configuration scans, which leave hardly a hole.

    Args:
        config: Configuration of the mirror and of its lines.
        step: Distance of the lines that are sent.
        count: Number of sweeps that stay together, whose lines interlace.
    """
    mirror, turns = config.mirror, step * config.mirror.frequency_hz / config.line.rate_hz
    sweep = 1.0 if mirror.polygon else 0.5  # turns
    phase = np.asarray(turns * np.arange(math.ceil(sweep * count / turns)), np.float64)
    if mirror.polygon:
        angle = math.radians(720.0 / mirror.facets) * (phase % 1.0 - 0.5)
        low, high = math.radians(-mirror.reach_deg), math.radians(mirror.reach_deg)
    else:
        angle, whole = (
            motion(each, math.radians(mirror.amplitude_deg), mirror.harmonics)
            for each in (phase, np.linspace(0.0, 1.0, 1025))
        )
        low, high = whole.min(), whole.max()
    inside = angle[(angle > low) & (angle < high)]
    return grid(np.sort(np.concatenate([[low], inside, [high]])))
