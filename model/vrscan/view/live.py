"""A board as the source of a page: all its points are taken, shown in part and recorded whole.

One thread takes the points and records them; two others read the state and raw lines. Where the
port disappears, they begin again when it is back, and a recording goes on.
"""

import contextlib
import dataclasses
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from vrscan.data import records
from vrscan.data.config import Config
from vrscan.data.errors import InputError, one_line
from vrscan.data.points import table
from vrscan.data.records import Form
from vrscan.link.device import BAUD, TIMEOUT_S, Device
from vrscan.link.link_report import (
    amplitude_deg,
    captured_point,
    mirror_text,
    threshold,
    threshold_settings,
)
from vrscan.link.recorder import STATE, Recorder
from vrscan.link.register_host import Build
from vrscan.link.stream import Account
from vrscan.link.transport import LinkError, UnpluggedError
from vrscan.registers import values
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.values import Value
from vrscan.view.display import Display, RawLine

RETRY_S = 0.5  # between two attempts to open a port
GET_S = 0.1
STATE_S = 0.25  # between two readings of the state
LINE_S = 0.5  # between two raw lines
ATTEMPTS = 4
EVENTS = 50  # that are kept


@dataclasses.dataclass
class Kept:
    """A recording: its file, and how much is in it."""

    path: Path
    points: int = 0
    lines: int = 0
    lost: int = 0  # points that are missing in it
    open: bool = True


@dataclasses.dataclass(frozen=True)
class Options:
    """How a board is used.

    Attributes:
        port: Serial port.
        baud: Its rate after a reset.
        stream_baud: Rate while points come; None leaves it.
        timeout: Seconds to wait for a reply.
        form: Form of the points.
        step: Distance of the lines whose points come; None takes what the serial line carries.
        start: Whether to start lines, laser and mirror first.
        config: Configuration of the board, which its recordings hold.
        load: Whether to load it before.
    """

    port: str
    baud: int = BAUD
    stream_baud: int | None = None
    timeout: float = TIMEOUT_S
    form: Form = Form.FULL
    step: int | None = None
    start: bool = False
    config: Config = dataclasses.field(default_factory=Config)
    load: bool = False


class LiveSource:
    """A board behind a port, from ``begin`` until ``close``.

    Args:
        options: How it is used.

    Attributes:
        display: What is shown.
        events: Times, of ``time.time``, and texts of what happened.
        kept: The last recording, or None.
        state: The state in words.
        connected: Whether a board answers.
        step: Distance of the lines whose points come.
    """

    counted = "points"  # what ``count`` counts

    def __init__(self, options: Options) -> None:
        self.display = Display()
        self.events: deque[tuple[float, str]] = deque(maxlen=EVENTS)
        self.kept: Kept | None = None
        self.state = f"{options.port}: connecting"
        self.connected = False
        self.step = options.step or 1
        self._lines_run: bool | None = None  # None is not known
        self._begun_s = time.monotonic()
        self.options = options
        self._writer: Recorder | None = None
        self._device: Device | None = None
        self._prepared = False  # configuration and start are for the first connection alone
        self._started = False
        self._past = Account()  # of earlier connections
        self._present: Callable[[], Account] = Account
        self._before = Account()  # when the recording began
        self._turn = threading.Lock()  # of the recording
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def begin(self) -> None:
        """Start the threads, if they do not run yet."""
        if self._thread.ident is None:
            self._begun_s = time.monotonic()
            self._thread.start()

    def close(self) -> None:
        """Stop what was started, end the recording, and close the port."""
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join()
        self.stop_recording()

    @property
    def name(self) -> str:
        """Return what the page calls the source."""
        return self.options.port

    @property
    def count(self) -> int:
        """Return the number of points so far."""
        return self.display.count

    @property
    def age_s(self) -> float:
        """Return the time since the source began."""
        return time.monotonic() - self._begun_s

    @property
    def awaited(self) -> str:
        """Return what has to come before all points, or an empty text."""
        if not self.connected:
            return "a board that answers"
        return "lines, which stand still" if self._lines_run is False else ""

    def account(self) -> Account:
        """Return the numbers of points that came and that did not, over all connections."""
        return _sum(self._past, self._present())

    def happened(self, text: str) -> None:
        """Note what happened."""
        self.events.append((time.time(), text))

    # ---- what the page asks for ----

    def device(self) -> Device:
        """Return the board.

        Raises:
            LinkError: if there is none at present.
        """
        if self._device is None:
            raise LinkError(f"{self.options.port}: no board answers at present")
        return self._device

    def registers(self) -> dict[str, Value]:
        """Return all registers but the tables."""
        return self.device().read_many(REGISTERS)

    def write(self, name: str, text: str) -> Value:
        """Write a register's values, in its unit and with blanks between, and return them."""
        device = self.device()
        device.write(name, values.from_texts(name, text.split()))
        self.happened(f"{name} = {text}")
        return device.read(name)

    def start(self) -> None:
        """Start lines, laser and mirror, and wait until the mirror is in RUN."""
        device = self.device()
        self.happened("lines, laser and mirror start")
        self._started = True
        device.start(lambda text, _: self._say(text))

    def stop(self) -> None:
        """Stop laser, mirror and lines."""
        self.device().stop()
        self._started = False
        self.happened("laser, mirror and lines are off")

    def record(self, path: Path) -> None:
        """Record all points and raw lines from now on.

        Raises:
            InputError: if the file cannot be written, or a recording runs.
        """
        build = self.device().build
        with self._turn:
            if self._writer is not None and self.kept is not None:
                raise InputError(f"{self.kept.path}: is being recorded")
            self._writer = Recorder(path, self.options.config, build, self.step)
            self.kept, self._before = Kept(path), self.account()
        self.happened(f"{path}: recording")

    def stop_recording(self) -> None:
        """End the recording, if there is one.

        Raises:
            InputError: if it cannot be written.
        """
        with self._turn:
            if self._writer is None or self.kept is None:
                return
            into, self._writer = self._writer, None
            self.kept.open = False
            try:
                into.note("account", dataclasses.asdict(_sum(self.account(), self._before, -1)))
                into.close()
            except OSError as error:
                raise InputError(f"{self.kept.path}: {error.strerror}") from error
        self.happened(f"{self.kept.path}: {self.kept.points} points, {self.kept.lost} lost")

    # ---- threads ----

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                options = self.options
                with Device(options.port, baud=options.baud, timeout=options.timeout) as device:
                    self._serve(device)
            except InputError as error:
                if self._device is not None or not self._prepared:
                    self.happened(str(error))
                self._say(str(error))
            finally:
                self._device, self.connected = None, False
                self._past, self._present = self.account(), Account
            self._closing.wait(RETRY_S)

    def _serve(self, device: Device) -> None:
        """Take points until the port is gone or the view ends."""
        options = self.options
        if not self._prepared and options.load:
            self._say(f"{options.port}: the configuration is loaded")
            device.load(options.config, force=True)
        if options.stream_baud is not None:
            device.set_baud(options.stream_baud)
        self._device, self.connected = device, True
        self.happened(f"{options.port}: a board answers")
        if not self._prepared and options.start:
            self.start()
        self._prepared = True
        beside = [
            threading.Thread(target=self._repeat, args=(device, act, every), daemon=True)
            for act, every in ((self._look, STATE_S), (self._capture, LINE_S))
        ]
        try:
            self.step = options.step or device.least_step(options.form)
            with device.stream(options.form, self.step) as stream:
                self._present = lambda: stream.account
                for thread in beside:
                    thread.start()
                while not self._closing.is_set():
                    found = stream.get(GET_S)
                    if found is not None:
                        self._enter(found, device.build)
                    self.display.tick(self.account().lost)
        finally:
            self.connected = False  # ends the threads beside this one
            for thread in beside:
                if thread.is_alive():
                    thread.join()
            if self._started and self._closing.is_set():
                with contextlib.suppress(LinkError):
                    device.stop()

    def _enter(self, found: records.Records, build: Build) -> None:
        points = records.form_points(found, self.options.form, build.pixel_width, build.length_unit)
        self.display.take(table(points))

        def write(into: Recorder, kept: Kept) -> None:
            into.stream(found)
            kept.points += len(found)

        self._keep(write)

    def _keep(self, write: Callable[[Recorder, Kept], None]) -> None:
        """Write to the recording, if there is one; what fails ends it."""
        failed = False
        with self._turn:
            if self._writer is None or self.kept is None:
                return
            self.kept.lost = _sum(self.account(), self._before, -1).lost
            try:
                write(self._writer, self.kept)
            except (InputError, OSError) as error:
                self.happened(f"{self.kept.path}: ends early ({one_line(error)})")
                failed = True
        if failed:
            with contextlib.suppress(InputError):
                self.stop_recording()

    def _repeat(self, device: Device, act: Callable[[Device], None], every: float) -> None:
        """Do something again and again while the board answers."""
        while self.connected and not self._closing.wait(every):
            try:
                act(device)
            except UnpluggedError:
                return
            except LinkError as error:
                self.happened(str(error))

    def _look(self, device: Device) -> None:
        found = device.read_many(STATE)
        self._keep(lambda into, _: into.state(found))
        amplitude = amplitude_deg({**found, "scan_facet": device.read("scan_facet")})
        error = values.to_scaled("mirror_error", found["mirror_error"])
        assert isinstance(error, float)
        self.display.mirror = amplitude, 360.0 * error
        self._lines_run = bool(found["line_enable"])
        lines = "lines run" if self._lines_run else "lines stand still"
        self._say(f"mirror {mirror_text(found)}, {lines}")

    def _capture(self, device: Device) -> None:
        if not device.read("line_enable"):
            return
        for _ in range(ATTEMPTS):  # at a line with a peak
            each = device.capture(timeout=self.options.timeout)
            if each.record is not None and records.measured(each.record)[0]:
                break
        settings = threshold_settings(device)
        self.display.line = RawLine(
            each.line,
            each.pixels,
            captured_point(each, device.build),
            threshold(each.pixels, settings),
        )
        if each.record is not None:

            def write(into: Recorder, kept: Kept) -> None:
                into.captures([each], points=False)
                kept.lines += 1

            self._keep(write)

    def _say(self, text: str) -> None:
        self.state = text


def _sum(first: Account, second: Account, sign: int = 1) -> Account:
    names = [field.name for field in dataclasses.fields(Account)]
    return Account(**{name: getattr(first, name) + sign * getattr(second, name) for name in names})
