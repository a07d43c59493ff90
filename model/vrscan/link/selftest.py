"""Self-test of a board: the answers of its registers, and its results for its own test lines.

The board's test lines are those of the twin, pixel by pixel, so the bit-accurate model gives the
required value of every field of every record. A fit knows the speckle of the lines before, which a
host does not, so before each run come as many of its lines as a fit remembers; they are not
compared. All changed registers are restored; only the line numbers stay changed.
"""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vrscan.data import link_pkg, pkg, records
from vrscan.data.arrays import Pixels
from vrscan.data.bus import WORD_BITS, WORD_MASK, WRITABLE
from vrscan.data.points import Points
from vrscan.data.records import Form, Records
from vrscan.fixed import peak_fit
from vrscan.fixed.point_record import point_record
from vrscan.fixed.test_line import least_period, lines, step_of_width
from vrscan.fixed.vrscan_chain import MAX_WINDOW, min_period, run_fixed
from vrscan.link import protocol
from vrscan.link.device import Device
from vrscan.link.register_host import OFF, DeviceError
from vrscan.link.stream import DTYPES, PointStream
from vrscan.link.transport import LinkError
from vrscan.registers import values
from vrscan.registers.chain_registers import Registers
from vrscan.registers.register_map import LOCKS, REGISTERS, WINDOWS, Window
from vrscan.registers.settings import TestLineSettings as Settings

ONE_PX = 1 << pkg.POSITION_FRACTION
FULL_SCALE = (1 << pkg.ALIGNED_WIDTH) - 1
LINES = 40  # lines of a run: full records that fit the board's buffer, and those sent meanwhile
ANGLES = (0, 1 << 19, -(3 << 18), (1 << 21) - 1, -(1 << 21))  # angles of the test lines, in turn
POWERS = (65_535, 30_000, 1_000, 1, 0)
PATTERNS = (0, 0xFFFF_FFFF, 0x5555_5555, 0xAAAA_AAAA, 0x1234_5678, 0x0F1E_2D3C)
WALKING = tuple(1 << k for k in range(WORD_BITS))
# Registers that the chain uses for a point: without lines they may hold any value.
CHAIN = tuple(
    field.name for field in fields(Registers) if field.name not in ("pixel_width", "line_length")
)
TABLES = ("free_table_from", "free_table_to")
QUIET = (
    *(name for name in CHAIN if name not in TABLES),
    "drive_phase",
    "motion_a",
    "motion_phi",
    "motion_da",
    "motion_dphi",
    "scratch",
)
TEST = tuple(f"test_{field.name}" for field in fields(Settings))
CHANGED = (
    *("test_angle", "test_power", *TEST, "points_batch", "points_timeout_clks", "map_access_bank"),
)
# Counters that a working board does not increase, whatever the self-test does.
FAULTS = (
    "short_count",
    "long_count",
    "unfinished_count",
    "early_count",
    "skipped_count",
    "dropped_count",
    "uart_framing",
    "uart_breaks",
    "uart_fallbacks",
    "frames_crc",
    "frames_malformed",
    "frames_too_long",
    "frames_too_short",
    "frames_framing",
    "commands_lost",
    "points_dropped",
)


@dataclass(frozen=True)
class Check:
    """A comparison.

    Attributes:
        what: Description in a few words.
        lines: Number of lines of the sensor's length that the board made.
        compared: Number of values that were equal, or of all up to the first that was not.
        difference: The first difference, with the value that came and the one that should have
            come; None where there is none.
    """

    what: str
    lines: int
    compared: int
    difference: str | None = None


Progress = Callable[[str, int, int], None]


def arrange(
    device: Device, settings: Settings, *, lines: int | None = None, angle: int = 0, power: int = 0
) -> None:
    """Set the registers of a run of test lines.

    Args:
        device: The board.
        settings: Settings of the lines.
        lines: Number of lines that replaces that of ``settings``, if given.
        angle: Angle of all lines; s24, a fraction of a turn.
        power: Power of all lines.
    """
    if lines is not None:
        settings = replace(settings, lines=lines)
    wanted: list[tuple[str, values.Value]] = [
        (f"test_{field.name}", getattr(settings, field.name)) for field in fields(Settings)
    ]
    # A batch that is not full is sent after a three-hundredth of a second of the board's time: most
    # runs are over by then, and each waits for it.
    timeout = min(device.build.clock_hz // 300, (1 << 24) - 1)
    wanted += [("test_angle", angle), ("test_power", power)]
    device.write_many([*wanted, ("points_batch", 255), ("points_timeout_clks", timeout)])


@contextlib.contextmanager
def arranged(device: Device) -> Iterator[None]:
    """Restore the registers that ``arrange`` changes, and end the lines.

    Raises:
        LinkError: if the sensor's lines run: they would mix with those of the test.
    """
    if device.read("line_enable"):
        raise LinkError(f"{device.port}: lines run: stop them first (line_enable = 0)")
    device.write("test_stop", 1)  # ends a run left by another host
    _settled(device)
    before = device.read_many(CHANGED)
    try:
        yield
    finally:
        device.write("test_stop", 1)
        device.write_many(before.items())


def runs(line_length: int) -> dict[str, Settings]:
    """Return the runs of test lines, by their description; no window asks for fewer of them."""
    middle = line_length // 2 * ONE_PX
    plain = Settings(
        position=middle + 1234,
        move=3 * ONE_PX + 789,
        step=step_of_width(24.0),
        height=40_000,
        pedestal=1_000,
        noise=200,
        seed=1,
        lines=LINES,
        period_clks=min_period(line_length, MAX_WINDOW, two_pass=True, fit=True),
    )
    edge = (line_length - 1) * ONE_PX
    return {
        "moving peak": plain,
        "narrow peak": replace(plain, step=step_of_width(4.0), move=ONE_PX + 97),
        "one pixel": replace(plain, step=step_of_width(1.0), noise=0, move=555),
        "wide peak": replace(plain, step=step_of_width(200.0), move=-7 * ONE_PX - 11),
        "wider than the window": replace(plain, step=step_of_width(line_length / 2)),
        "saturated": replace(plain, height=FULL_SCALE, pedestal=30_000, seed=2),
        "across the edges": replace(plain, position=edge - 5 * ONE_PX, move=ONE_PX // 2, seed=3),
        "much noise": replace(plain, height=9_000, noise=6_000, seed=4),
        "nothing but noise": replace(plain, height=0, noise=3_000, seed=5),
        "black": replace(plain, height=0, pedestal=0, noise=0),
        "white": replace(plain, height=0, pedestal=FULL_SCALE, noise=0),
        "without a foot": replace(plain, step=0, noise=500, seed=6),
        "spread out": replace(plain, period_clks=4 * least_period(line_length), seed=7),
    }


def first_difference(got: Records, want: Records) -> tuple[int, str | None]:
    """Return the number of values compared, and the first one that differs as text.

    Args:
        got: A structured array.
        want: Another one with the same fields and number of rows.
    """
    names = want.dtype.names or ()
    wrong = np.stack([np.asarray(got[name]) != np.asarray(want[name]) for name in names], 1)
    rows = np.flatnonzero(wrong.any(axis=1))
    if not len(rows):
        return wrong.size, None
    row = int(rows[0])
    name = names[int(np.flatnonzero(wrong[row])[0])]
    return row * len(names), (
        f"line {row} of {len(want)}: {name} is {got[name][row]}, want {want[name][row]} "
        f"({len(rows)} lines differ)"
    )


def full_records(points: Points, first: int, power: int, configuration: int = 0) -> Records:
    """Return the full records of a run of test lines.

    Args:
        points: The model's points for the lines.
        first: Number of the first line.
        power: Power of all lines.
        configuration: The bit that changes with each commit.
    """
    none, no = np.zeros(len(points), np.int64), np.zeros(len(points), np.bool_)
    found = point_record(points, none + power, none, no, ~no, none, configuration)
    found["line"] = (first + np.arange(len(points))) % (1 << pkg.LINE_NUMBER_WIDTH)
    return found


class SelfTest:
    """A self-test of a board.

    Args:
        device: The board. Its lines have to stand still.
        progress: Called with the name of the step, the number of its parts done, and of all its
            parts.
    """

    def __init__(self, device: Device, progress: Progress = lambda *_: None) -> None:
        self.device = device
        self.progress = progress
        self._still = device.read("mirror_state") == OFF
        if not device.read("lock_calibration"):
            device.commit()  # what is read is what the lines are measured with
        found = device.read_many(CHAIN)
        chain: dict[str, Any] = dict(found)
        for name in ("period_n", "window_two_pass", "window_fit", "noise_row", "even"):
            chain[name] = bool(chain[name])
        self._chain = Registers(
            pixel_width=device.build.pixel_width,
            line_length=device.build.line_length,
            **chain,
        )
        self._maps = device.read_maps()
        self._lead = peak_fit.REACH + 1 if self._chain.window_fit else 0

    def checks(self) -> Iterator[Check]:
        """Do one check after the other; checks after a difference mean little."""
        device = self.device
        with arranged(device):
            faults = self._counters()
            yield self.pings()
            yield self.registers()
            yield self.answers()
            named = runs(device.build.line_length)
            for form in (Form.FULL, Form.COMPACT, Form.SPACE):
                for k, (name, settings) in enumerate(named.items()):
                    yield self.run(name, settings, form, ANGLES[k % 5], POWERS[k % 5])
            for name in ("moving peak", "saturated", "nothing but noise"):
                yield self.captured(name, named[name])
            yield self.no_faults(faults)

    # ---- the link and the registers ----

    def pings(self) -> Check:
        """Send every byte and every length to the board and back."""
        longest = link_pkg.MAX_PAYLOAD - 3
        payloads = [bytes(range(256))[:longest], bytes(range(256))[-longest:], bytes(longest)]
        payloads += [bytes([255 - k]) * k for k in (0, 1, 2, 3, 100, longest)]
        for k, payload in enumerate(payloads):
            try:
                self.device.ping(payload)
            except LinkError as error:
                return Check("pings", 0, sum(map(len, payloads[:k])), str(error))
            self.progress("pings", k + 1, len(payloads))
        return Check("pings", 0, sum(map(len, payloads)))

    def registers(self) -> Check:
        """Write patterns to registers that may hold them, read them back, restore the values."""
        what, compared = "registers hold what is written", 0
        closed = {lock for lock, value in self.device.read_many(LOCKS).items() if value}
        names = [
            name
            for name in QUIET
            if values.find(name).lock not in closed
            and (self._still or name in CHAIN or name == "scratch")
        ]
        before = self.device.read_many(names)
        try:
            for k, pattern in enumerate(PATTERNS):
                settings = [(name, _filled(name, pattern + 77 * k)) for name in names]
                self.device.write_many(settings, commit=False)  # no line is to see it
                found = self.device.read_many(names)
                for name, want in settings:
                    if found[name] != want:
                        return Check(what, 0, compared, f"{name} is {found[name]}, want {want}")
                    compared += values.count(name)
                self.progress(what, k + 1, len(PATTERNS))
            for word in WALKING:
                self.device.write("scratch", word)
                compared += 1
            for window in WINDOWS.values():
                if window.lock not in closed and self._still:
                    compared += self._entries(window)
        except LinkError as error:
            return Check(what, 0, compared, str(error))
        finally:
            self.device.write_many(before.items(), commit=False)
        return Check(what, 0, compared)

    def _entries(self, window: Window) -> int:
        """Write patterns to a table's first, middle and last entry, and return the number of words.

        Raises:
            LinkError: if a word reads back differently.
        """
        if window.bank is not None and window.in_use is not None:
            free = 1 - values.integer(self.device.read(window.in_use))
            self.device.write(window.bank, free)
        places = [window.address + k * window.stride for k in (0, window.entries // 2 - 1, -1)]
        places[-1] += window.entries * window.stride
        width = len(window.fields)
        before = [self.device.read_words(place, width) for place in places]
        compared = 0
        try:
            for pattern in PATTERNS:
                wanted = [
                    [
                        values.within(field, pattern * (7 * k + j + 1)) & WORD_MASK
                        for j, field in enumerate(window.fields)
                    ]
                    for k in range(len(places))
                ]
                for place, words in zip(places, wanted, strict=True):
                    self.device.write_words(values.Block(place, words))
                for place, words in zip(places, wanted, strict=True):  # no write hit another one
                    found = self.device.read_words(place, width)
                    if found != words:
                        name = values.name_at(place)
                        raise LinkError(f"{name}: reads {found}, want {words}")
                    compared += width
        finally:
            for place, words in zip(places, before, strict=True):
                self.device.write_words(values.Block(place, words))
        return compared

    def answers(self) -> Check:
        """Try every kind of access that is refused, and check the answers."""
        what, compared = "what has to be refused is", 0
        before = self._counter("commands_bad")
        bad = list(self._bad_commands())
        expected = bad + list(self._refused())
        for k, (place, access, status) in enumerate(expected):
            try:
                access()
            except DeviceError as error:
                if error.status != status:
                    return Check(what, 0, compared, f"{place}: {error}, want status {status}")
            except LinkError as error:
                return Check(what, 0, compared, f"{place}: {error}")
            else:
                return Check(what, 0, compared, f"{place}: was done, want status {status}")
            compared += 1
            self.progress(what, k + 1, len(expected))
        now = self._counter("commands_bad")
        want = min(before + len(bad), (1 << 16) - 1)
        if now < want:  # a repeated command counts twice
            return Check(what, 0, compared, f"commands_bad is {now}, want {want}")
        return Check(what, 0, compared + 1)

    def _bad_commands(self) -> Iterator[tuple[str, Callable[[], object], int]]:
        """Yield commands that do not exist or have a wrong length, with the status to expect."""

        def send(operation: int, data: bytes) -> Callable[[], object]:
            return lambda: self.device.command(operation, data)

        known = set(protocol.Command)
        for operation in range(link_pkg.COMMAND_NONE):
            if operation not in known:
                place = f"command {operation:#04x}"
                yield place, send(operation, b""), link_pkg.STATUS_UNKNOWN_COMMAND
        for operation, lengths in (
            (link_pkg.COMMAND_PING, (link_pkg.MAX_PAYLOAD - 2,)),
            (link_pkg.COMMAND_READ, (0, 2, 4)),
            (link_pkg.COMMAND_WRITE, (0, 2, 3, 7, 4 * link_pkg.MAX_WORDS + 5)),
            (link_pkg.COMMAND_STREAM_START, (0, 1, 3)),
            (link_pkg.COMMAND_STREAM_STOP, (1,)),
            (link_pkg.COMMAND_CAPTURE, (0, 4, 6)),
        ):
            for length in lengths:
                place = f"{protocol.Command(operation).name} with {length} bytes"
                yield place, send(operation, bytes(length)), link_pkg.STATUS_BAD_LENGTH

    def _refused(self) -> Iterator[tuple[str, Callable[[], object], int]]:
        """Yield accesses that are refused, with their address and the status to expect."""
        device = self.device
        closed = {lock for lock, value in device.read_many(LOCKS).items() if value}
        current = device.read_many([r.name for r in REGISTERS.values() if r.access == "rw"])

        def write(address: int, word: int) -> Callable[[], object]:
            return lambda: device.write_words(values.Block(address, [word]))

        def read(address: int) -> Callable[[], object]:
            return lambda: device.read_words(address, 1)

        for register in REGISTERS.values():
            name, address = register.name, register.address
            if register.access not in WRITABLE:
                yield name, write(address, 0), link_pkg.STATUS_READ_ONLY
            elif register.lock in closed:
                first = values.to_words(name, current.get(name, register.minimum))[0]
                yield name, write(address, first), link_pkg.STATUS_LOCKED
            elif register.width < WORD_BITS and register.maximum >= 0:
                word = (register.maximum + 1) & WORD_MASK
                yield name, write(address, word), link_pkg.STATUS_BAD_VALUE
                word = (register.minimum - 1) & WORD_MASK
                yield name, write(address, word), link_pkg.STATUS_BAD_VALUE
        for window in WINDOWS.values():
            if window.bank is not None and window.in_use is not None:
                device.write(window.bank, device.read(window.in_use))
                status = link_pkg.STATUS_LOCKED if window.lock in closed else link_pkg.STATUS_BUSY
                yield f"{window.name} in use", write(window.address, 0), status
        for address in _holes():
            place = f"{address:#06x}"
            yield place, read(address), link_pkg.STATUS_NO_ADDRESS
            yield place, write(address, 0), link_pkg.STATUS_NO_ADDRESS

    def _counter(self, name: str) -> int:
        return values.integer(self.device.read(name))

    def _counters(self) -> dict[str, values.Value]:
        names = [r.name for r in REGISTERS.values() if r.access == "counter"]
        return self.device.read_many(name for name in FAULTS if name in names)

    def no_faults(self, before: dict[str, values.Value]) -> Check:
        """Check that no counter has increased that a working board does not increase."""
        what = "no faults were counted"
        for name, now in self._counters().items():
            if now != before[name]:
                return Check(what, 0, len(before), f"{name} is {now}, want {before[name]}")
        return Check(what, 0, len(before))

    # ---- lines ----

    def run(self, name: str, settings: Settings, form: int, angle: int, power: int) -> Check:
        """Stream the points of a run and compare every field of all of them."""
        form = Form(form)
        what = f"{name}, {form.name.lower()}"
        self._lead_in(settings, angle, power)
        with self.device.stream(form) as stream:
            self.device.write("test_start", 1)
            try:
                got = self._received(what, stream, settings.lines)
            finally:
                self.device.write("test_stop", 1)
        if len(got) != settings.lines or stream.account.lost:
            short = f"{len(got)} records, want {settings.lines} ({stream.account})"
            return Check(what, settings.lines, 0, short)
        want = self._wanted(settings, angle, power, int(got["line"][0]))
        if form is not Form.FULL:
            packed = records.space(want) if form is Form.SPACE else records.compact(want)
            want = np.zeros(len(packed), DTYPES[form])
            want["line"] = (int(got["line"][0]) + np.arange(len(packed))) % (1 << 32)
            for column in packed.dtype.names or ():
                want[column] = packed[column]
        compared, difference = first_difference(got, want)
        return Check(what, len(got), compared, difference)

    def _lead_in(self, settings: Settings, angle: int, power: int) -> None:
        """Make the lines that come before a run, and set the registers of the run."""
        if self._lead:
            arrange(self.device, settings, lines=self._lead, angle=angle, power=power)
            self.device.write("test_start", 1)
            _settled(self.device)
        arrange(self.device, settings, angle=angle, power=power)

    def _received(self, what: str, stream: PointStream, count: int) -> Records:
        """Return the records of a run, or those that came until none came within the timeout."""
        parts: list[Records] = []
        come = 0
        end = time.monotonic() + 2.0 * self.device.timeout
        while come < count and time.monotonic() < end:
            part = stream.get(end - time.monotonic())
            if part is not None:
                parts.append(part)
                come += len(part)
                self.progress(what, come, count)
                end = time.monotonic() + 2.0 * self.device.timeout
        return np.concatenate(parts) if parts else np.zeros(0, records.FULL)

    def _wanted(self, settings: Settings, angle: int, power: int, first: int) -> Records:
        """Return the full records that a run has to give behind the lines before it."""
        pixels = self._lines(settings, max(settings.lines, self._lead))
        pixels = np.concatenate([pixels[: self._lead], pixels[: settings.lines]])
        points = run_fixed(
            pixels,
            np.full(len(pixels), angle, np.int64),
            np.full(len(pixels), power, np.int64),
            self._chain,
            max_window=self.device.build.max_window,
            maps=self._maps,
            # Making the run's registers takes longer than neighbours are apart.
            breaks=(self._lead,) if self._lead else (),
        )
        bit = values.integer(self.device.read("configuration"))
        return full_records(points, first - self._lead, power, bit)[self._lead :]

    def _lines(self, settings: Settings, count: int) -> Pixels:
        build = self.device.build
        return lines(settings, count, line_length=build.line_length, pixel_width=build.pixel_width)

    def captured(self, name: str, settings: Settings) -> Check:
        """Capture the first line of a run and one in its middle, and compare all pixels."""
        what, compared = f"{name}, captured", 0
        angle, power = ANGLES[1], POWERS[1]
        settings = replace(settings, lines=8)
        pixels = self._lines(settings, settings.lines)
        want = self._wanted(settings, angle, power, 0)
        first: int | None = None
        for place in (0, 5):
            number = 0 if first is None else first + settings.lines + self._lead + place
            self._lead_in(settings, angle, power)
            mode = link_pkg.CAPTURE_NEXT if first is None else link_pkg.CAPTURE_LINE
            with self.device.captured(mode, number) as waiting:
                self.device.write("test_start", 1)
                got = waiting.get(3.0 * self.device.timeout)
            if got is None:
                return Check(what, 1, compared, f"line {place} of the run did not come whole")
            first = got.line if first is None else number - place
            if got.line != first + place:
                return Check(what, 1, compared, f"line {got.line} came, want {first + place}")
            wrong = np.flatnonzero(got.pixels != pixels[place])
            if len(wrong):
                k = wrong[0]
                text = f"pixel {k} is {got.pixels[k]}, want {pixels[place, k]}"
                return Check(what, 1, compared + int(k), f"line {place} of the run: {text}")
            compared += got.pixels.size
            if got.record is None:
                return Check(what, 1, compared, f"line {place} of the run gave no point")
            record = want[place : place + 1].copy()
            record["line"] = got.line
            more, difference = first_difference(got.record, record)
            compared += more
            if difference is not None:
                return Check(what, 1, compared, difference)
            self.progress(what, place, 5)
            _settled(self.device)
        return Check(what, 2, compared)


def _settled(device: Device) -> None:
    """Wait until a run has ended and its last point is out, which waited for a line behind."""
    end = time.monotonic() + 2.0 * device.timeout
    waited = pkg.NEIGHBOUR_CLKS + 3 * pkg.FIT_PERIOD
    ended: int | None = None
    while ended is None or device.uptime() < ended + waited:
        if ended is None and not device.read("test_running"):
            ended = device.uptime()
        if time.monotonic() > end:
            raise LinkError(f"{device.port}: the run of test lines does not end")


def _filled(name: str, pattern: int) -> values.Value:
    """Return a valid value of a register, made of the bits of a pattern."""
    register = values.find(name)
    found = tuple(
        values.within(register, pattern * (k + 1) * 0x1_0001) for k in range(values.count(name))
    )
    return found if len(found) > 1 else found[0]


def _holes() -> Sequence[int]:
    """Return the first and the last address of every gap in the map."""
    taken = sorted(
        [(r.address, r.words) for r in REGISTERS.values()]
        + [(w.address, w.entries * w.stride) for w in WINDOWS.values()]
    )
    holes = []
    at = 0
    for address, words in [*taken, (1 << link_pkg.ADDRESS_WIDTH, 0)]:
        if address > at:
            holes += sorted({at, address - 1})
        at = max(at, address + words)
    return holes
