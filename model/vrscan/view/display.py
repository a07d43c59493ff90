"""What the page shows of the points: the last ones, an image of the last sweeps, and a history.

A source puts all points in as they come, in blocks; what the page does not need is let go, so the
memory is bounded whatever the rate.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.range_image import Grid, Image, range_image, sweeps
from vrscan.data.table import Table

KEPT = 1500  # points of the profile
ROWS, COLUMNS = 160, 100  # of the range image
ROW_LINES = 160  # least number of lines of a row, which holds whole periods of the mirror
ROWS_A_S = 20.0  # most that scroll in
SAMPLE_S = 0.5  # what a sample of the history sums up
SAMPLES = 240


@dataclass(frozen=True)
class RawLine:
    """A line of pixels with what was made of it: a table of one row, or None for no point."""

    line: int
    pixels: Pixels
    point: Table | None
    threshold: float
    note: str = ""  # which of a file's raw lines it is


@dataclass(frozen=True)
class Sample:
    """The points and the mirror over ``SAMPLE_S``; NaN for what is not known.

    Attributes:
        time_s: End of the interval, of ``time.monotonic``.
        rate: Points per second.
        valid: Share of the lines with a position.
        snr: Median signal-to-noise ratio of these.
        lost: Number of points that were lost.
        amplitude_deg: Amplitude of the mirror.
        phase_deg: Error of its phase.
    """

    time_s: float
    rate: float
    valid: float
    snr: float
    lost: int
    amplitude_deg: float
    phase_deg: float


@dataclass
class _Sum:
    """What comes until the next sample."""

    since_s: float
    lines: int = 0
    measured: int = 0
    snr: list[Floats] = field(default_factory=list)
    flags: Counter[str] = field(default_factory=Counter)


class Display:
    """What is shown; sources put in from their threads, and pages take out from theirs."""

    def __init__(self) -> None:
        self.line: RawLine | None = None  # the last one
        self.mirror = (np.nan, np.nan)  # amplitude and error of the phase, degrees
        self.history: deque[Sample] = deque(maxlen=SAMPLES)
        self.flags: Mapping[str, float] = {}  # share of the lines with each, in the last sample
        self.count = 0  # points so far
        self._lost = 0
        self._lock = threading.Lock()
        self._last: deque[Table] = deque()
        self._open: list[Table] = []  # not yet in a row
        self._rows: deque[Image] = deque(maxlen=ROWS)
        self._row_s = -np.inf
        self._reach_rad = 0.0
        self._sum = _Sum(time.monotonic())

    def take(self, points: Table) -> None:
        """Put points in, in the order of their lines."""
        with self._lock:
            self.count += len(points)
            self._last.append(points)
            while sum(map(len, self._last)) - len(self._last[0]) >= KEPT:
                self._last.popleft()
            self._add(points)
            self._open.append(points)
            if sum(map(len, self._open)) >= ROW_LINES:
                self._open = [self._cut(Table.joined(self._open))]

    def _add(self, points: Table) -> None:
        total, good = self._sum, points.measured
        total.lines += len(points)
        total.measured += int(good.sum())
        total.snr.append(points.snr[good & (points.snr > 0.0)])  # 0 is not known
        total.flags.update({name: int(raised.sum()) for name, raised in points.flags.items()})

    def _cut(self, points: Table) -> Table:
        """Make the newest whole row of the image, and return what belongs to later ones."""
        number = sweeps(points.angle_rad)
        starts = np.flatnonzero(np.diff(number)) + 1  # of all sweeps but the first
        # Some sources know no angles, and a mirror that stands has no sweeps.
        end = int(starts[-1]) if len(starts) else len(points) // (8 * ROW_LINES) * ROW_LINES
        if end < ROW_LINES:
            return points
        before = starts[::-2][starts[::-2] <= end - ROW_LINES]  # by whole periods
        now, rows = time.monotonic(), np.arange(len(points))
        if now - self._row_s >= 1.0 / ROWS_A_S:
            self._row_s = now
            self._enter(points.of((rows >= (before[0] if len(before) else 0)) & (rows < end)))
        return points.of(rows >= end)

    def _enter(self, points: Table) -> None:
        reach = float(np.abs(points.angle_rad).max())
        if not 0.8 * self._reach_rad <= reach <= self._reach_rad:
            self._reach_rad = 1.02 * reach
            self._rows.clear()
        step = 2.0 * self._reach_rad / (COLUMNS - 1) or 1.0
        grid = Grid(-self._reach_rad, step, COLUMNS)
        made = range_image(points, np.zeros(len(points), np.int64), grid)[0]
        # Lines that are farther apart than columns leave single ones empty.
        lone = np.isnan(made[1:-1]) & np.isfinite(made[:-2]) & np.isfinite(made[2:])
        made[1:-1][lone] = made[:-2][lone]
        self._rows.append(made)

    def tick(self, lost: int) -> None:
        """End a sample when it is time to.

        Args:
            lost: Number of all points that were lost so far.
        """
        now = time.monotonic()
        with self._lock:
            total, spent = self._sum, now - self._sum.since_s
            if spent < SAMPLE_S:
                return
            self._sum = _Sum(now)
            snr = np.concatenate(total.snr or [np.empty(0)])
            most = max(total.lines, 1)
            self.history.append(
                Sample(
                    now,
                    total.lines / spent,
                    total.measured / most if total.lines else np.nan,
                    float(np.median(snr)) if len(snr) else np.nan,
                    lost - self._lost,
                    *self.mirror,
                )
            )
            self._lost = lost
            if total.lines:
                self.flags = {name: raised / most for name, raised in total.flags.items()}

    def samples(self) -> list[Sample]:
        """Return the history."""
        with self._lock:
            return list(self.history)

    def last(self) -> Table | None:
        """Return the last points, at most ``KEPT``."""
        with self._lock:
            parts = list(self._last)
        if not parts:
            return None
        found = Table.joined(parts)
        return found.of(np.arange(len(found)) >= len(found) - KEPT)

    def image(self) -> tuple[Image, float]:
        """Return the range image, mm [ROWS, COLUMNS], the newest row last, and its reach in rad."""
        found = np.full((ROWS, COLUMNS), np.nan, np.float32)
        with self._lock:
            if self._rows:
                found[-len(self._rows) :] = self._rows
            return found, self._reach_rad
