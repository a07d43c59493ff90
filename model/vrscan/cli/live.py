"""A board's points and state, live in a terminal."""

import contextlib
import os
import select
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table as RichTable
from rich.text import Text

from vrscan.data import pkg, records
from vrscan.data.arrays import Floats
from vrscan.data.records import Records
from vrscan.link.device import Device
from vrscan.link.link_report import amplitude_deg, mirror_text
from vrscan.link.stream import Account
from vrscan.registers import values
from vrscan.registers.values import Value, integer

KEPT = 2000  # largest number of points of the picture
REFRESH_S = 0.2
COLUMNS, ROWS = 72, 14
STATUS = (
    "mirror_state",
    "mirror_fault",
    "mirror_settled",
    "mirror_word",
    "mirror_measured",
    "mirror_level",
    "scan_facet",
    "laser_status",
    "laser_power_inward",
    "laser_power_outward",
    "focus_state",
    "focus_distance",
    "focus_position",
    "uptime",
)
_BRAILLE = 0x2800
_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


def braille(x: Floats, z: Floats, columns: int = COLUMNS, rows: int = ROWS) -> str:
    """Return a picture of points, x to the right and z downwards, two by four dots per character.

    Args:
        x: x of the points.
        z: z of the points.
        columns: Number of characters per row.
        rows: Number of rows.
    """
    canvas = np.zeros((rows, columns), np.int64)
    if len(x):
        across = _dots(x, 2 * columns)
        down = _dots(z, 4 * rows)
        np.bitwise_or.at(canvas, (down // 4, across // 2), _DOTS[down % 4, across % 2])
    return "\n".join("".join(chr(_BRAILLE + k) for k in row) for row in canvas.tolist())


def _dots(values_: Floats, count: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return which of ``count`` dots each value falls on, from the least value to the largest."""
    low, high = float(values_.min()), float(values_.max())
    share = (values_ - low) / (high - low) if high > low else np.full(len(values_), 0.5)
    return np.minimum((share * count).astype(np.int64), count - 1)


class Profile:
    """The last points, for a picture and their statistics."""

    def __init__(self, unit_mm: int = 1) -> None:
        self._step = unit_mm * 2.0**-pkg.LENGTH_FRACTION
        self._points: Records = np.zeros(0, records.FULL)

    def add(self, found: Records) -> None:
        """Add points."""
        self._points = np.concatenate([self._points, found])[-KEPT:]

    def valid(self) -> float:
        """Return the share of the points that are measured."""
        if not len(self._points):
            return 0.0
        return float(records.measured(self._points).mean())

    def snr(self) -> float:
        """Return the median signal-to-noise ratio of the measured points."""
        found = self._points["snr"][records.measured(self._points)]
        return float(np.median(found)) * 2.0**-pkg.SNR_FRACTION if len(found) else 0.0

    def picture(self) -> Panel:
        """Return the picture of the located points."""
        points = self._points
        good = records.located(points)
        x, z = points["x"][good] * self._step, points["z"][good] * self._step
        title = "no point"
        if len(x):
            title = f"x {x.min():.2f} to {x.max():.2f} mm, z {z.min():.2f} to {z.max():.2f} mm"
        return Panel(Text(braille(x, z)), title=title, title_align="left", expand=False)


def _view(
    device: Device, found: dict[str, Value], account: Account, profile: Profile, rates: list[str]
) -> Group:
    """Return the whole view."""
    clock = device.build.clock_hz
    frequency = integer(found["mirror_word"]) / 2.0**pkg.TURN_WIDTH * clock
    level = integer(found["mirror_level"]) / 2.0**pkg.LEVEL_WIDTH
    motion = f"{amplitude_deg(found):.4f} deg, {frequency:.4f} Hz, level {level:.3f}"
    if found["scan_facet"]:
        motion = f"polygon, {frequency:.4f} facets/s"
    power = [
        100.0 * integer(found[f"laser_power_{way}"]) / (2**pkg.POWER_WIDTH - 1)
        for way in ("inward", "outward")
    ]
    distance = values.to_scaled("focus_distance", found["focus_distance"])
    assert isinstance(distance, float)
    table = RichTable.grid(padding=(0, 2, 0, 0))
    table.add_row("points", ", ".join(rates))
    table.add_row("valid", f"{100 * profile.valid():.1f} %, S/N {profile.snr():.1f}")
    table.add_row("lost", str(account))
    table.add_row("mirror", f"{mirror_text(found)}, {motion}")
    table.add_row(
        "laser",
        f"inward {power[0]:.1f} %, outward {power[1]:.1f} %, "
        f"status {integer(found['laser_status']):#x}",
    )
    table.add_row(
        "focus",
        f"state {found['focus_state']}, distance {distance * device.build.length_unit:g} mm, "
        f"position {found['focus_position']}",
    )
    return Group(table, profile.picture())


def watch(device: Device, console: Console, *, seconds: float | None, step: int) -> None:
    """Show points and state until q, Ctrl-C, or the end of a time.

    Args:
        device: The board.
        console: The terminal.
        seconds: Time after which the view ends, or None.
        step: Distance of the lines whose points are shown.
    """
    profile = Profile(device.build.length_unit)
    start = before = time.monotonic()
    with _keys() as pressed, device.stream(True, step) as stream:
        found = device.read_many(STATUS)
        clocks, come = integer(found["uptime"]), 0
        with Live(
            _view(device, found, stream.account, profile, ["none yet"]),
            console=console,
            auto_refresh=False,
        ) as live:
            while not pressed():
                now = time.monotonic()
                if seconds is not None and now - start >= seconds:
                    break
                points = stream.get(REFRESH_S)
                if points is not None:
                    profile.add(points)
                if now - before < REFRESH_S:
                    continue
                found = device.read_many(STATUS)
                passed = integer(found["uptime"]) - clocks
                more = stream.account.records - come
                rates = [f"{more / (now - before):.0f} /s"]
                if passed > 0:
                    board = more / passed * device.build.clock_hz
                    rates.append(f"{board:.0f} /s of the board's time")
                clocks, come, before = integer(found["uptime"]), stream.account.records, now
                live.update(_view(device, found, stream.account, profile, rates), refresh=True)


@contextlib.contextmanager
def _keys() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether q or Ctrl-C was pressed; restore the terminal."""
    from vrscan.cli.interrupt import interrupted

    with contextlib.ExitStack() as stack:
        ended = stack.enter_context(interrupted())
        keyboard = sys.stdin.fileno() if sys.stdin and _is_terminal() else None
        if keyboard is not None:
            keyboard = keyboard if stack.enter_context(_single_keys(keyboard)) else None

        def pressed() -> bool:
            if keyboard is not None and select.select([keyboard], [], [], 0)[0]:
                return b"q" in os.read(keyboard, 64).lower() or ended() is not None
            return ended() is not None

        yield pressed


@contextlib.contextmanager
def _single_keys(keyboard: int) -> Iterator[bool]:
    """Let keys come without Enter; yields whether they do, which is not so on Windows."""
    try:
        import termios
        import tty
    except ModuleNotFoundError:
        yield False
        return
    state = termios.tcgetattr(keyboard)
    try:
        tty.setcbreak(keyboard)
        yield True
    finally:
        termios.tcsetattr(keyboard, termios.TCSADRAIN, state)


def _is_terminal() -> bool:
    with contextlib.suppress(OSError, ValueError):
        return sys.stdin.isatty()
    return False
