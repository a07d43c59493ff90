"""A recording as the source of a page, at the pace at which its lines were taken."""

import threading
import time
from collections import deque
from pathlib import Path

import numpy as np

from vrscan.data import line_files, recordings
from vrscan.data.config import Config
from vrscan.data.errors import reading
from vrscan.data.lines import Lines
from vrscan.data.points import read_csv, table
from vrscan.data.records import Form, form_points
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.link.link_report import Threshold, threshold
from vrscan.link.stream import DTYPES, Account
from vrscan.view.display import Display, RawLine

TICK_S = 0.1
POINTS = {"points", "records", "short_records"}  # channels of a recording that have points


class Playback:
    """A recording, from ``begin`` until ``close``; at its end it begins anew.

    Args:
        name: Its name.
        points: Its points.
        config: The configuration that they were taken with.
        raw: Its raw lines, taken evenly over its points, with a point for each; None without.
        speed: How many times as fast as it was taken it is played.

    Attributes:
        display: What is shown.
        events: Times, of ``time.time``, and texts of what happened.
        position: Number of points that are played so far.
        playing: Whether it goes on.
    """

    connected = True
    awaited = ""  # nothing but the first point

    def __init__(
        self,
        name: str,
        points: Table,
        config: Config,
        raw: tuple[Lines, Table] | None = None,
        *,
        speed: float = 1.0,
    ) -> None:
        self.name = name
        self.display = Display()
        self.events: deque[tuple[float, str]] = deque()
        self.position = 0
        self.playing = True
        self._points, self._raw = points, raw
        self._rate = config.line.rate_hz * speed
        peak = config.peak
        self._settings = Threshold(peak.k_noise, peak.k_height, peak.noise == "row")
        self._closing = threading.Event()
        self._begun_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="playback", daemon=True)

    @property
    def length(self) -> int:
        """Return the number of points."""
        return len(self._points)

    @property
    def raw_lines(self) -> int:
        """Return the number of raw lines."""
        return 0 if self._raw is None else len(self._raw[0])

    @property
    def count(self) -> int:
        """Return how many points of the file are played; the next loop begins at 0 again."""
        return self.position

    @property
    def counted(self) -> str:
        """Return what ``count`` counts."""
        return f"of {self.length:,} points"

    @property
    def age_s(self) -> float:
        """Return the time since somebody looked first."""
        return time.monotonic() - self._begun_s

    @property
    def state(self) -> str:
        """Return the state in words."""
        return f"{self.name}: {self.length:,} points, {self.raw_lines:,} raw lines"

    def account(self) -> Account:
        """Return the number of points of the file that are played; a file loses none."""
        return Account(records=self.count)

    def begin(self) -> None:
        """Start the thread, if it does not run yet."""
        if self._thread.ident is None:
            self._begun_s = time.monotonic()
            self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join()

    def toggle(self) -> None:
        """Stop or go on."""
        self.playing = not self.playing

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
            if self._raw is not None:
                raw, made = self._raw
                at = (end - 1) * len(raw) // self.length
                pixels, point = raw.lines[at], made.of(slice(at, at + 1))
                over = threshold(pixels, self._settings)
                note = f"raw line {at + 1:,} of {len(raw):,}, even over the points"
                self.display.line = RawLine(int(point.line[0]), pixels, point, over, note)
        self.position = 0 if end == self.length else end


def opened(path: Path, given: Path | None = None, speed: float = 1.0) -> Playback:
    """Return a recording.

    Args:
        path: A recording; points.csv; points of the link, .npz; or raw lines. Of raw lines the
            fixed-point model makes the points, where they come without.
        given: File of the configuration; None takes that of the recording, or the defaults.
        speed: How many times as fast as it was taken it is played.

    Raises:
        InputError: naming the file, if it is missing or of no known kind.
    """
    config = recordings.read_config(path, given)
    points: Table | None
    raw: Lines | None = None
    if recordings.is_recording(path):
        found = recordings.read(path)
        has = {topic for topic, rows in found.rows.items() if rows}
        raw = found.lines if "lines" in has or not has & POINTS else None
        points = found.points if has & POINTS else None
    else:
        points = read_csv(path) if path.suffix == ".csv" else _link_points(path)
        raw = line_files.read(path, config) if points is None else None
    made = None if raw is None else run(Engine.FIXED, raw, config)
    points = made if points is None else points
    assert points is not None
    together = None if raw is None or made is None else (raw, made)
    return Playback(path.name, points, config, together, speed=speed)


def _link_points(path: Path) -> Table | None:
    """Return the points of a file of ``link points``, .npz, or None where it is another one."""
    if path.suffix != ".npz":
        return None
    with reading(path, "damaged"), np.load(path) as file:
        if "account_records" not in file:
            return None
        form = Form.FULL if "bits" in file else Form.SPACE if "free_to" in file else Form.COMPACT
        kind = DTYPES[form]
        found = np.zeros(len(file["line"]), kind)
        for name in kind.names or ():
            found[name] = file[name]
        formats = int(file["pixel_width"]), int(file["unit_mm"]) if "unit_mm" in file else 1
    return table(form_points(found, form, *formats))
