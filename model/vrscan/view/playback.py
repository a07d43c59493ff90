"""A recording as the source of a page, at the pace at which its lines were taken."""

import threading
import time
from collections import deque
from pathlib import Path

import numpy as np

from vrscan.data import line_files
from vrscan.data.arrays import Ints
from vrscan.data.config import Config
from vrscan.data.lines import Lines
from vrscan.data.points import read_csv
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.link.link_report import Threshold, threshold
from vrscan.link.stream import Account
from vrscan.view.display import Display, RawLine

TICK_S = 0.1


class Playback:
    """A recording, from ``begin`` until ``close``; it begins anew when it is played at its end.

    Args:
        name: Its name.
        points: Its points.
        config: The configuration that they were taken with.
        raw: Its raw lines, or None.
        numbers: The number of each raw line, in rising order.

    Attributes:
        display: What is shown.
        events: Times, of ``time.time``, and texts of what happened.
        position: Number of points that are played so far.
        playing: Whether it goes on.
    """

    connected = True

    def __init__(
        self, name: str, points: Table, config: Config, raw: Lines | None, numbers: Ints
    ) -> None:
        self.name = name
        self.display = Display()
        self.events: deque[tuple[float, str]] = deque()
        self.position = 0
        self.playing = True
        self._points, self._raw, self._numbers = points, raw, numbers
        self._rate = config.line.rate_hz
        peak = config.peak
        self._settings = Threshold(peak.k_noise, peak.k_height, peak.noise == "row")
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="playback", daemon=True)

    @property
    def length(self) -> int:
        """Return the number of points."""
        return len(self._points)

    @property
    def state(self) -> str:
        """Return the state in words."""
        return f"{self.name}: {self.length:,} points, {len(self._numbers):,} raw lines"

    def account(self) -> Account:
        """Return the number of points that were played; a file loses none."""
        return Account(records=self.display.count)

    def begin(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join()

    def toggle(self) -> None:
        """Stop, go on, or begin anew."""
        self.playing = not self.playing
        if self.playing and self.position >= self.length:
            self.position = 0

    def seek(self, position: int) -> None:
        """Go on at another point."""
        self.position = min(max(position, 0), self.length)

    def _run(self) -> None:
        due, before = 0.0, time.monotonic()
        while not self._closing.wait(TICK_S):
            now = time.monotonic()
            due, before = due + (now - before) * self._rate, now
            if self.playing:
                self._play(int(due))
            due %= 1.0
            self.display.tick(0)

    def _play(self, count: int) -> None:
        begin, end = self.position, min(self.position + count, self.length)
        if begin < end:
            self.display.take(self._points.of(slice(begin, end)))
            number = int(self._points.line[end - 1])
            at = int(np.searchsorted(self._numbers, number, "right")) - 1
            if self._raw is not None and at >= 0:
                self.display.line = self._line(self._raw, at)
        self.position, self.playing = end, end < self.length

    def _line(self, raw: Lines, at: int) -> RawLine:
        number, pixels = int(self._numbers[at]), raw.lines[at]
        row = np.flatnonzero(self._points.line == number)[:1]
        point = self._points.of(row) if len(row) else None
        return RawLine(number, pixels, point, threshold(pixels, self._settings))


def opened(path: Path, config: Config) -> Playback:
    """Return a recording.

    Args:
        path: points.csv; raw lines, of which the fixed-point model makes the points; or points of
            the link, .npz.
        config: The configuration that it was taken with.

    Raises:
        InputError: naming the file, if it is missing or of no known kind.
    """
    if path.suffix == ".csv":
        return Playback(path.name, read_csv(path), config, None, np.empty(0, np.int64))
    raw = line_files.read(path, config)
    return Playback(path.name, run(Engine.FIXED, raw, config), config, raw, np.arange(len(raw)))
