"""The commands of ``vrscan link``: a board on a serial port."""

import contextlib
import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vrscan.cli.checks import check_range, check_suffix
from vrscan.cli.interrupt import interrupted
from vrscan.cli.panels import group
from vrscan.cli.progress import console as _console
from vrscan.data.errors import EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_TERMINATED, InputError

if TYPE_CHECKING:
    from vrscan.data.config import Config
    from vrscan.data.records import Form, Records
    from vrscan.link.device import Device, StartProgress
    from vrscan.link.recorder import Recorder
    from vrscan.link.stream import Account, Captured

FORMATS = (".mcap", ".npz", ".csv")
PICTURES = (".mcap", ".csv", ".png")
STATE_S = 1.0  # between two readings of the state that a recording has
MOST_POINTS = 100_000_000
MOST_LINES = 100_000
MOST_DARK = 50  # largest number of lines without a peak before an error

link = typer.Typer(help="Talk to a board: registers, points, raw lines, self-test.")
maps = typer.Typer(help="Load correction maps into a board, and read those that it has.")
link.add_typer(maps, name="maps")

# How `vrscan link --help` groups the commands, in this order.
PANELS = {
    "State and registers": ("info", "registers", "read", "write"),
    "Configuration": ("load", "maps"),
    "Points and lines": ("watch", "points", "capture"),
    "Checks": ("selftest", "bench"),
}


def _ports(incomplete: str) -> list[str]:
    """Return the ports that a shell completes a beginning to: those of devices and of boards."""
    from vrscan.engines.tools import build_folder

    there = _devices()
    for made in (build_folder() / name / "port" for name in ("board", "view")):
        if made.exists():
            near = made.is_relative_to(Path.cwd()) and not incomplete.startswith("/")
            there.append(str(made.relative_to(Path.cwd()) if near else made))
    return [port for port in there if port.startswith(incomplete)]


def _devices() -> list[str]:
    """Return the serial ports of this machine that have a device."""
    from serial.tools.list_ports import comports

    return [each.device for each in comports() if each.hwid != "n/a"]


PortOption = Annotated[
    str | None,
    typer.Option(
        "--port",
        "-p",
        envvar="VRSCAN_PORT",
        help="Serial port of the board.",
        autocompletion=_ports,
    ),
]
BaudOption = Annotated[int, typer.Option("--baud", help="Rate of the board after a reset.")]
TimeoutOption = Annotated[
    float,
    typer.Option(
        "--timeout",
        envvar="VRSCAN_TIMEOUT",
        help="Seconds to wait for a reply; a simulated board needs more.",
    ),
]
StartOption = Annotated[
    bool,
    typer.Option("--start", help="Start lines, laser and mirror first, and stop them at the end."),
]
BoardConfigOption = Annotated[
    Path | None, typer.Option("--config", help="TOML file in the board, kept in an .mcap.")
]
RawOption = Annotated[
    bool, typer.Option("--raw", help="Use raw integers instead of values in units.")
]
BAUD, TIMEOUT_S = 3_000_000, 5.0


def _registers(incomplete: str) -> list[str]:
    """Return the registers that a shell completes a beginning to."""
    from vrscan.registers import values

    return [name for name in values.NAMES if name.startswith(incomplete)]


@link.command()
def info(
    port: PortOption = None, baud: BaudOption = BAUD, timeout: TimeoutOption = TIMEOUT_S
) -> None:
    """Show the identity and the state of a board."""
    from vrscan.link import link_report as report

    with _device(port, baud, timeout) as device:
        _console().print(report.info_table(device))


@link.command()
def registers(
    name: Annotated[
        str, typer.Argument(help="Show only registers with this text in their name.")
    ] = "",
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Show all registers with their values and units; of tables only the first entries."""
    from vrscan.link import link_report as report
    from vrscan.registers import values

    names = [each for each in values.NAMES if name in each]
    if not names:
        values.find(name)  # raises an error with similar names
    with _device(port, baud, timeout) as device:
        found = device.read_many(names)
    _console().print(report.register_table(found))


@link.command()
def read(
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", help="Names of registers.", autocompletion=_registers),
    ],
    raw: RawOption = False,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Read registers and print one per line."""
    from vrscan.link import link_report as report
    from vrscan.registers import values

    for name in names:
        values.find(name)
    with _device(port, baud, timeout) as device:
        found = device.read_many(names)
    for name, value in found.items():
        print(f"{name} = {report.value_text(name, value, raw=raw, most=None)}")


@link.command(context_settings={"ignore_unknown_options": True})  # a value may begin with a minus
def write(
    name: Annotated[str, typer.Argument(help="Name of a register.", autocompletion=_registers)],
    value: Annotated[
        list[str], typer.Argument(metavar="VALUE...", help="Value in the register's unit.")
    ],
    raw: RawOption = False,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Write all values of a register, and read it back."""
    from vrscan.link import link_report as report
    from vrscan.registers import values

    integers = values.from_texts(name, value, raw=raw)
    with _device(port, baud, timeout) as device:
        device.write(name, integers)
        found = device.read(name)
    print(f"{name} = {report.value_text(name, found, raw=raw, most=None)}")


@link.command()
def watch(
    seconds: Annotated[float | None, typer.Option(help="Time after which the view ends.")] = None,
    step: Annotated[int, typer.Option(help="Show the points of every n-th line.")] = 32,
    start: StartOption = False,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Watch points, mirror, laser and focus live, until q or Ctrl-C."""
    from vrscan.cli import live

    if seconds is not None:
        check_range("--seconds", seconds, 0.01, 1e6)
    check_range("--step", step, 1, 255)
    with _device(port, baud, timeout) as device, _running(device, start):
        live.watch(device, _console(), seconds=seconds, step=step)


@link.command()
def capture(
    out: Annotated[
        Path | None,
        typer.Option(help="File for the lines: .mcap (for replay), .csv or .png; default: text."),
    ] = None,
    count: Annotated[int, typer.Option("--lines", help="Number of lines.")] = 1,
    every: Annotated[int, typer.Option(help="Fetch every n-th line, one at a time.")] = 1,
    line: Annotated[int | None, typer.Option(help="Fetch the line with this number.")] = None,
    peak: Annotated[bool, typer.Option("--peak", help="Fetch only lines with a peak.")] = False,
    start: StartOption = False,
    config: BoardConfigOption = None,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Fetch raw lines with the board's results for them.

    Where Ctrl-C, SIGTERM or the port's end comes first, the lines that came are kept.
    """
    from vrscan.data import config as configuration
    from vrscan.data.points import atomic_file, check_writable
    from vrscan.data.recordings import SUFFIX
    from vrscan.link import link_report as report

    check_range("--lines", count, 1, MOST_LINES)
    check_range("--every", every, 1, 2**32 - 1)
    if line is not None:
        check_range("--line", line, 0, 2**32 - 1)
        if count > 1:
            raise InputError(f"--line: is one line, and not {count}")
        if peak:
            raise InputError("--line: is one line, with a peak or without (--peak)")
    kind, held = check_suffix(out, PICTURES), configuration.load(config)
    if out is not None:
        check_writable(out)
    note, took = "", _Took()
    with took, _device(port, baud, timeout) as device, _running(device, start):
        settings = report.threshold_settings(device)
        with took.holding() if count > 1 else contextlib.nullcontext(), contextlib.ExitStack() as s:
            into: Recorder | None = None
            if out is not None and kind == SUFFIX:
                into = s.enter_context(_recorder(out, held, device))
            found = _captured(device, count, every, line, peak, took, into)
            if out is not None and into is None:
                with atomic_file(out) as file:
                    report.write_captures(kind, file, found, settings, device.build)
            took.kept = f"{len(found)} lines" + ("" if out is None else f" are in {out}")
        if took.status == 0 and not any(map(_has_peak, found)):
            note = _why_dark(device)
    console = _console()
    console.print(report.capture_table(found, settings, device.build))
    if out is None:
        for each in found[:3]:
            console.print(report.capture_text(each, console.width), highlight=False)
    else:
        console.print(f"{out}: {len(found)} lines", highlight=False)
    if note:
        print(f"vrscan: no peak: {note}", file=sys.stderr)
    took.end()


@link.command()
def points(
    out: Annotated[Path, typer.Option(help="File for the points: .mcap, .npz or .csv.")],
    count: Annotated[int | None, typer.Option(help="Number of points.")] = None,
    seconds: Annotated[float | None, typer.Option(help="Duration of the recording.")] = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full/--compact", help="All fields of a point, or x, z, confidence and flags only."
        ),
    ] = True,
    space: Annotated[
        bool,
        typer.Option(
            "--space", help="Points, and the free interval of lines without a point, in 9 bytes."
        ),
    ] = False,
    step: Annotated[
        int | None,
        typer.Option(help="Record every n-th line; default: as many as the serial line carries."),
    ] = None,
    stream_baud: Annotated[
        int | None,
        typer.Option(help="Rate of the link while points are recorded; default: as it is."),
    ] = None,
    start: StartOption = False,
    allow_loss: Annotated[
        bool, typer.Option("--allow-loss", help="Exit with status 0 even if points were lost.")
    ] = False,
    config: BoardConfigOption = None,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Record points; exit status 1 if some were lost.

    Where Ctrl-C, SIGTERM or the port's end comes first, the points that came are in the file, and
    the exit status is 130, 143 or 2.
    """
    from vrscan.data import config as configuration
    from vrscan.data import records
    from vrscan.data.points import atomic_file, check_writable
    from vrscan.data.recordings import SUFFIX
    from vrscan.data.records import Form
    from vrscan.link import link_report as report

    if (count is None) == (seconds is None):
        raise InputError("--count or --seconds: one of them is needed")
    if count is not None:
        check_range("--count", count, 1, MOST_POINTS)
    if seconds is not None:
        check_range("--seconds", seconds, 0.001, 1e6)
    if step is not None:
        check_range("--step", step, 1, 255)
    kind = check_suffix(out, FORMATS)
    if space and not full:
        raise InputError("--space: not with --compact")
    form = Form.SPACE if space else Form(full)
    settings = configuration.load(config)
    if stream_baud is not None:
        check_range("--stream-baud", stream_baud, 1, 1_000_000_000)
    check_writable(out)
    note, took = "", _Took()
    with (
        took,
        _device(port, baud, timeout) as device,
        _at_rate(device, stream_baud),
        _running(device, start),
    ):
        taken = device.least_step(form) if step is None else step
        with took.holding(), contextlib.ExitStack() as stack:
            into: Recorder | None = None
            if kind == SUFFIX:
                into = stack.enter_context(_recorder(out, settings, device, taken))
            found, account = _recorded(device, form, taken, count, seconds, took, into)
            if into is not None:
                into.note("account", asdict(account))
            else:
                with atomic_file(out) as file:
                    report.write_points(kind, file, found, form, taken, device.build, account)
            took.kept = f"{len(found)} points are in {out}"
        if took.status == 0 and not records.measured(found).any():
            note = _why_dark(device)
    which = "every line" if taken == 1 else f"one line in {taken}"
    print(f"{out}: {len(found)} points in the file, of {which}")
    print(account)
    if note:
        print(f"vrscan: no peak: {note}", file=sys.stderr)
    took.end()
    if account.lost and not allow_loss:
        print(f"vrscan: {out}: points were lost", file=sys.stderr)
        raise typer.Exit(1)


@link.command()
def load(
    config: Annotated[
        Path | None, typer.Option("--config", help="TOML file that overrides the defaults.")
    ] = None,
    start: Annotated[
        bool, typer.Option("--start", help="Then start lines, laser and mirror, and wait for RUN.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Write even while the mirror moves.")
    ] = False,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Write a configuration into the board, and show what it changes."""
    from vrscan.data import config as configuration
    from vrscan.link import link_report as report

    settings = configuration.load(config)
    console = _console()
    with _device(port, baud, timeout) as device:
        wanted = device.settings(settings)
        device.check_still(force)
        with _bar("read") as progress:
            before = device.read_many(wanted, progress)
        with _bar("write") as progress:
            device.load(settings, force=force, progress=progress)
        changed = {name: before[name] for name in wanted if before[name] != wanted[name]}
        if changed:
            console.print(report.change_table(changed, wanted))
        console.print(
            f"{device.port}: {len(wanted)} registers and columns of tables written, "
            f"{len(changed)} of them changed",
            highlight=False,
        )
        if settings.map.file is not None:
            console.print(f"maps of {settings.map.file} loaded", highlight=False)
        if start:
            with _starting() as progress:
                device.start(progress)
            silence = device.silence_s()
            console.print(
                f"the mirror is in RUN; the laser goes off {silence:g} s after the last command",
                highlight=False,
            )


@maps.command(name="load")
def load_maps(
    file: Annotated[Path, typer.Argument(help="Maps, as vrscan calibrate map writes them.")],
    config: Annotated[
        Path | None, typer.Option("--config", help="TOML file with the lens and its focus.")
    ] = None,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Load maps beside those in use, check all that is read back, and let them take effect.

    Lines may go on meanwhile. Where the board refuses or reads back another word, the maps in use
    stay.
    """
    from vrscan.data import config as configuration
    from vrscan.registers.map_table import map_table

    settings = configuration.load(config)
    named = settings.map.model_copy(update={"file": str(file.resolve())})
    settings = settings.model_copy(update={"map": named})
    map_table(settings)  # what does not fit is told without a board
    with _device(port, baud, timeout) as device, _bar("maps") as progress:
        loaded = device.load_maps(settings, progress)
    count, filled = len(loaded.nodes), round(100.0 * float(loaded.filled.mean()))
    print(f"{device.port}: {count} maps, {loaded.nodes.size} nodes, {filled} % of them filled")


@maps.command(name="read")
def read_maps(
    out: Annotated[Path, typer.Option(help="File for the maps, .npz.")],
    config: Annotated[
        Path | None, typer.Option("--config", help="TOML file with the lens.")
    ] = None,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Read the maps in use, and write them as vrscan calibrate map does."""
    from vrscan.calibrate.results import write_maps
    from vrscan.data import config as configuration
    from vrscan.data.points import atomic_file, check_writable
    from vrscan.registers.map_table import field_maps

    settings = configuration.load(config)
    check_suffix(out, (".npz",))
    check_writable(out)
    with _device(port, baud, timeout) as device, _bar("maps") as progress:
        found = device.read_maps(progress)
    if found is None:
        raise InputError(f"{device.port}: positions are not corrected (map_enable = 0)")
    with atomic_file(out) as file:
        write_maps(field_maps(found, settings), {}, file)
    print(f"{out}: {len(found.nodes)} maps, {found.nodes.size} nodes")


@link.command()
def selftest(
    port: PortOption = None, baud: BaudOption = BAUD, timeout: TimeoutOption = TIMEOUT_S
) -> None:
    """Compare the board's results for its test lines with the model; status 1 if they differ."""
    from vrscan.link import link_report as report
    from vrscan.link.selftest import SelfTest

    checks = []
    begun = time.monotonic()
    with _device(port, baud, timeout) as device, _bar("self-test") as bar:
        clocks = device.uptime()
        test = SelfTest(device, lambda what, done, steps: bar(done, steps, what))
        for check in test.checks():
            checks.append(check)
            if check.difference is not None:
                break
        clocks = device.uptime() - clocks
        board_s = clocks / device.build.clock_hz
    console = _console()
    console.print(report.check_table(checks))
    console.print(
        f"{sum(check.compared for check in checks)} numbers of {sum(c.lines for c in checks)} "
        f"lines, {board_s:.3g} s of the board's time in {time.monotonic() - begun:.1f} s",
        highlight=False,
    )
    failed = [check for check in checks if check.difference is not None]
    if failed:
        print(f"vrscan: {failed[0].what}: {failed[0].difference}", file=sys.stderr)
        raise typer.Exit(1)


@link.command()
def bench(
    bauds: Annotated[
        str,
        typer.Option("--bauds", help="Rates to try, with commas; default: only the present one."),
    ] = "",
    pings: Annotated[int, typer.Option(help="Number of round trips.")] = 200,
    seconds: Annotated[float, typer.Option(help="Duration of each stream.")] = 2.0,
    port: PortOption = None,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
) -> None:
    """Measure round trips, registers and points per second, by this clock and the board's."""
    from vrscan.link import benchmark
    from vrscan.link import link_report as report

    check_range("--pings", pings, 3, 100_000)
    check_range("--seconds", seconds, 0.01, 3600.0)
    try:
        rates = [int(text) for text in bauds.split(",")] if bauds else [baud]
    except ValueError:
        raise InputError(f"--bauds: must be rates with commas ({bauds})") from None
    with _device(port, baud, timeout) as device, _bar("bench") as bar:
        trips = benchmark.round_trips(device, pings, bar)
        streams = benchmark.streams(device, rates, seconds, bar)
    _console().print(report.bench_tables(trips, streams))


# ---- what they share ----


@contextlib.contextmanager
def _device(port: str | None, baud: int, timeout: float) -> Iterator["Device"]:
    """Connect to the board; Ctrl-C and SIGTERM leave the board stopped."""
    from vrscan.link.device import Device

    check_range("--baud", baud, 1, 1_000_000_000)
    check_range("--timeout", timeout, 0.01, 3600.0)
    with Device(chosen_port(port), baud=baud, timeout=timeout) as device:
        yield device


def chosen_port(port: str | None) -> str:
    """Return the port; where none was given, raise an error with those that there are."""
    if port is None:
        there = ", ".join(_devices())
        raise InputError(f"--port: which one? {f'there are {there}' if there else 'there is none'}")
    return port


def _recorder(out: Path, config: "Config", device: "Device", step: int = 1) -> "Recorder":
    """Return a recording of a board, whose lines have to be those of the configuration."""
    from vrscan.link.recorder import Recorder

    device.settings(config)
    return Recorder(out, config, device.build, step)


@contextlib.contextmanager
def _at_rate(device: "Device", rate: int | None) -> Iterator[None]:
    """Change the link's rate while the context lasts, if one is given."""
    before = device.baud
    if rate is None:
        yield
        return
    device.set_baud(rate)
    try:
        yield
    finally:
        device.set_baud(before)


@contextlib.contextmanager
def _running(device: "Device", wanted: bool) -> Iterator[None]:
    """Run lines, laser and mirror while the context lasts, if ``wanted``."""
    if not wanted:
        yield
        return
    with contextlib.ExitStack() as stack:
        with _starting() as progress:
            stack.enter_context(device.started(progress))
        yield


@contextlib.contextmanager
def _starting() -> Iterator["StartProgress"]:
    """Show a bar while the mirror starts; yield the function that updates it."""
    with _bar("waiting for the mirror") as bar:
        yield lambda state, share: bar(
            round(100 * share), 100, f"waiting for the mirror's RUN: {state}"
        )


@contextlib.contextmanager
def _bar(text: str) -> Iterator[Callable[..., None]]:
    """Show a bar on the error stream; yield its update: number done, number of all, and a text."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(text, total=None)

        def update(done: int, total: int, description: str = text) -> None:
            progress.update(task, completed=done, total=total, description=description)

        yield update


@dataclass
class _Took:
    """How a recording ended: what was received is written, whatever ended it.

    As a context it takes the error of a board that is gone by then; an error before anything was
    written goes on.

    Attributes:
        kept: What is written where, an empty text until then.
        why: What ended the recording before its time, or an empty text.
        status: The exit status that goes with it.
    """

    kept: str = ""
    why: str = ""
    status: int = 0
    _come: Callable[[], int | None] = field(default=lambda: None)  # the signal, once one came

    def __enter__(self) -> "_Took":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        from vrscan.link.transport import LinkError

        if not self.kept or not isinstance(error, LinkError):
            return False
        self._failed(error)
        return True

    @contextlib.contextmanager
    def holding(self) -> Iterator[None]:
        """Let Ctrl-C and SIGTERM end the recording only; what it has is then still written."""
        with interrupted(signal.SIGINT, signal.SIGTERM) as self._come:
            yield

    def ended(self) -> bool:
        """Return whether a signal ends the recording."""
        number = self._come()
        if number is not None:
            self.why, self.status = _SIGNALS[number]
        return number is not None

    @contextlib.contextmanager
    def unless_empty(self, received: "Callable[[], list[Any]]") -> Iterator[None]:
        """Let an error end only the recording where something was received by then."""
        try:
            yield
        except InputError as error:
            if not received():
                raise
            self._failed(error)

    def _failed(self, error: InputError) -> None:
        if self.status == 0:  # else it is what comes of the end
            self.why, self.status = str(error), EXIT_BAD_INPUT

    def end(self) -> None:
        """Say what ended the recording before its time, if something did, and exit."""
        if self.status:
            print(f"vrscan: {self.why}: {self.kept}", file=sys.stderr)
            sys.exit(self.status)


_SIGNALS: dict[int, tuple[str, int]] = {
    signal.SIGINT: ("interrupted", EXIT_INTERRUPTED),
    signal.SIGTERM: ("terminated", EXIT_TERMINATED),
}


def _has_peak(each: "Captured") -> bool:
    """Return whether a line has a point with a position."""
    from vrscan.data.records import measured

    return each.record is not None and bool(measured(each.record)[0])


def _captured(
    device: "Device",
    count: int,
    every: int,
    line: int | None,
    peak: bool,
    took: _Took,
    into: "Recorder | None",
) -> "list[Captured]":
    """Return raw lines; with ``peak`` only those with a peak; at least one.

    They are in the recording, if there is one, as soon as they come.
    """
    from vrscan.data import link_pkg

    found: list[Captured] = []

    def keep(each: "Captured") -> "list[Captured]":
        if into is not None:
            into.captures([each])
        found.append(each)
        return found

    if line is not None:
        return keep(device.capture(link_pkg.CAPTURE_LINE, line))
    if count == 1:
        for _ in range(MOST_DARK):
            one = device.capture()
            if not peak or _has_peak(one):
                return keep(one)
        raise _no_peak(device)
    dark = 0  # consecutive lines without a peak
    wanted = device.captured(link_pkg.CAPTURE_EVERY, every)
    with took.unless_empty(lambda: found), _bar("lines") as bar, wanted as lines:
        last = time.monotonic()
        while len(found) < count and not took.ended():
            each = lines.get(0.2)
            if each is not None:
                last = time.monotonic()
                if peak and not _has_peak(each):
                    dark += 1
                    if dark == MOST_DARK:
                        raise _no_peak(device)
                    continue
                dark = 0
                keep(each)
                bar(len(found), count)
            elif time.monotonic() - last > 3.0 * device.timeout:
                raise InputError(
                    f"{device.port}: no line for {3.0 * device.timeout:g} s, "
                    f"{len(found)} of {count} came"
                )
    if not found:
        raise InputError(f"{device.port}: {took.why} before a line came")
    return found


def _no_peak(device: "Device") -> InputError:
    """Return the error of having waited long enough for a peak."""
    return InputError(f"--peak: none in {MOST_DARK} lines: {_why_dark(device)}")


def _why_dark(device: "Device") -> str:
    """Return the reason why there is no peak."""
    reason = device.darkness()
    return f"{reason} (--start starts all)" if reason else "nothing is seen in the laser's light"


def _recorded(
    device: "Device",
    form: "Form",
    step: int,
    count: int | None,
    seconds: float | None,
    took: _Took,
    into: "Recorder | None",
) -> "tuple[Records, Account]":
    """Return the points of a stream and its account, up to a number, a time or another end.

    They are in the recording, if there is one, as soon as they come, and so is the board's state.
    """
    import numpy as np

    from vrscan.link.recorder import STATE
    from vrscan.link.stream import DTYPES
    from vrscan.link.transport import LinkError

    parts: list[Records] = []
    come = 0
    stream = device.stream(form, step)

    def take(part: "Records") -> None:
        if into is not None:
            into.stream(part if count is None else part[: max(count - sum(map(len, parts)), 0)])
        parts.append(part)

    def received() -> "list[Records]":
        rest = stream.get(0.0)  # points on the way belong to the recording
        if rest is not None:
            take(rest)
        return parts

    with took.unless_empty(received), _bar("points") as bar, stream:
        start = last = time.monotonic()
        told = -math.inf
        while not took.ended():
            now = time.monotonic()
            if into is not None and parts and now - told >= STATE_S:
                told = now
                with contextlib.suppress(LinkError):  # the stream tells of a board that is gone
                    into.state(device.read_many(STATE))
            if count is not None and come >= count:
                break
            if seconds is not None and now - start >= seconds:
                break
            part = stream.get(0.1)
            if part is not None:
                take(part)
                come += len(part)
                last = now
            elif count is not None and now - last > 3.0 * device.timeout:
                raise InputError(
                    f"no point for {3.0 * device.timeout:g} s, {come} of {count} came: "
                    f"{device.darkness() or 'the board says nothing of why'}"
                )
            if count is not None:
                bar(min(come, count), count)
            elif seconds is not None:
                bar(
                    min(round(now - start), round(seconds)),
                    max(1, round(seconds)),
                    f"{come} points",
                )
    found = np.concatenate(received() or [np.zeros(0, DTYPES[form])])
    return found[:count], stream.account


group(link, PANELS)
