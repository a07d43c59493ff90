"""The tables, texts and files of the commands of ``vrscan link``."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, BinaryIO

import numpy as np
from rich.console import Group
from rich.table import Table as RichTable

from vrscan.data import link_pkg, pkg, records
from vrscan.data.arrays import Floats, Pixels
from vrscan.data.lines import Lines
from vrscan.data.points import table as in_units
from vrscan.data.points import write_csv
from vrscan.data.recordings import Clock, full_table
from vrscan.data.records import Form, Records
from vrscan.data.table import Table
from vrscan.ideal.chain import MAX_WINDOW
from vrscan.ideal.peak import cut
from vrscan.ideal.statistics import statistics
from vrscan.link.device import FAULTS, Device
from vrscan.link.register_host import STATES, Build
from vrscan.link.selftest import Check
from vrscan.link.stream import Account, Captured
from vrscan.registers import values
from vrscan.registers.register_map import LOCKS, REGISTERS
from vrscan.registers.values import Value, integer
from vrscan.show.sheet import Column, Sheet, listed, words

SHOWN = 4  # number of values that are shown of many
COMPACT_FLAGS = {
    getattr(link_pkg, f"COMPACT_{name}"): name
    for name in ("WEAK", "AT_EDGE", "SATURATED", "RIVAL", "RANGE", "MIRROR", "LOST")
}
_MS: dict[str, Any] = {"unit": "ms", "scale": 1e3}
_MARKS = " ▁▂▃▄▅▆▇█"
_MARK_ROWS = 6  # height of a raw line as text


# ---- registers ----


def value_text(name: str, value: Value, *, raw: bool = False, most: int | None = SHOWN) -> str:
    """Return a register's value as text, in its unit, or as integers.

    Args:
        name: Name of the register.
        value: Integers of the register.
        raw: Whether to show the integers instead of values in the unit.
        most: Largest number of values that are shown; all if None.
    """
    register = values.find(name)
    integers = value if isinstance(value, tuple) else (value,)
    shown = integers[:most]
    if raw:
        return " ".join(str(each) for each in shown) + " ..." * (len(shown) < len(integers))
    digits = max(1, math.ceil(register.width * math.log10(2.0)))
    texts = []
    for each in shown:
        if register.fraction:
            texts.append(f"{math.ldexp(each, -register.fraction):.{digits}g}")
        elif name in ("identity", "map_hash"):
            texts.append(f"{each:#010x}")
        else:
            texts.append(str(each))
    text = " ".join(texts) + " ..." * (len(shown) < len(integers))
    return f"{text} {register.unit}".rstrip()


def _format(name: str) -> str:
    register = values.find(name)
    fraction = f".{register.fraction}" if register.fraction else ""
    return f"{'s' if register.signed else 'u'}{register.width}{fraction}"


def register_table(found: Mapping[str, Value]) -> RichTable:
    """Return registers with their values, as integers and in their units."""
    columns: list[Column[str]] = [
        words("address", lambda name: f"{values.addresses(name)[0]:#06x}"),
        words("name", lambda name: name + f"[{values.count(name)}]" * (values.count(name) > 1)),
        words("access", lambda name: values.find(name).access),
        words("format", _format),
        Column("integer", lambda name: value_text(name, found[name], raw=True, most=2), wraps=True),
        Column("value", lambda name: value_text(name, found[name], most=2), wraps=True),
        words("meaning", lambda name: values.find(name).doc, wraps=True),
    ]
    return Sheet(columns, list(found)).terminal("Registers", "a table shows its first entries")


def info_table(device: Device) -> RichTable:
    """Return a board's identity and state."""
    build = device.build
    # All counters are read at one time.
    found = device.read_many(name for name, each in REGISTERS.items() if each.access != "strobe")
    uptime = integer(found["uptime"])
    word = integer(found["mirror_word"]) / 2.0**pkg.TURN_WIDTH * build.clock_hz
    counted = [
        f"{name} {value}"
        for name, value in found.items()
        if REGISTERS[name].access == "counter" and value and name != "frames_good"
    ]
    locked = [name.removeprefix("lock_") for name in LOCKS if found[name]]
    rows = [
        ("version", f"{build.version_text}, map {build.map_hash:#010x}, board {build.board_id}"),
        ("clock", f"{build.clock_hz / 1e6:g} MHz"),
        (
            "sensor",
            f"{build.line_length} px of {build.pixel_width} bits, windows up to "
            f"{build.max_window} px, {build.lanes} lane, {build.index_oversample} index samples "
            "a clock",
        ),
        ("uptime", f"{uptime / build.clock_hz:.6g} s of the board's time"),
        ("link", f"{device.baud} baud, {1e3 * device.round_trip_s:.3g} ms there and back"),
        ("mirror", f"{mirror_text(found)}, drive {word:.4f} Hz"),
        ("lines", "run" if found["line_enable"] else "stand still"),
        ("locked", ", ".join(locked) or "nothing"),
        ("counted", ", ".join(counted) or "no fault"),
    ]
    columns: list[Column[tuple[str, str]]] = [
        words("", lambda row: row[0]),
        words("", lambda row: row[1], wraps=True),
    ]
    return Sheet(columns, rows).terminal(f"Board at {device.port}")


def mirror_text(found: Mapping[str, Value]) -> str:
    """Return the mirror's state in words."""
    state = integer(found["mirror_state"])
    text = STATES[state] if state < len(STATES) else str(state)
    fault = integer(found["mirror_fault"])
    if text == "FAULT":
        text += f" ({FAULTS[fault] if fault < len(FAULTS) else fault})"
    return f"{text}, {'settled' if found['mirror_settled'] else 'not settled'}"


def amplitude_deg(found: Mapping[str, Value]) -> float:
    """Return the amplitude that the loop measured; nan of a polygon, which has none.

    Args:
        found: Values of ``scan_facet`` and ``mirror_measured``.
    """
    if found["scan_facet"]:
        return math.nan
    return 360.0 * math.ldexp(integer(found["mirror_measured"]), -pkg.AMPLITUDE_FRACTION)


def change_table(before: Mapping[str, Value], after: Mapping[str, Value]) -> RichTable:
    """Return the changes of a configuration.

    Args:
        before: Values of the registers before.
        after: New values of these registers, and of others.
    """
    rows = []
    for name, old in before.items():
        new = after[name]
        if isinstance(old, tuple) and isinstance(new, tuple):
            differ = sum(a != b for a, b in zip(old, new, strict=True))
            rows.append((name, f"{len(old)} values", f"{differ} of them others"))
        else:
            rows.append((name, value_text(name, old), value_text(name, new)))
    return listed(("name", "before", "after"), rows, left=1).terminal("Changed")


def check_table(checks: Sequence[Check]) -> RichTable:
    """Return the checks of a self-test."""
    columns: list[Column[Check]] = [
        words("what", lambda check: check.what),
        Column("lines", lambda check: check.lines or None),
        Column("compared", lambda check: check.compared),
        words("result", lambda check: check.difference or "equal", wraps=True),
    ]
    return Sheet(columns, checks).terminal("Self-test")


# ---- points ----


def write_points(
    kind: str,
    file: BinaryIO,
    found: Records,
    form: Form,
    step: int,
    build: Build,
    account: Account,
) -> None:
    """Write points.

    Args:
        kind: ``".csv"``: full points in the format of every engine's points.csv, others with
            their own columns; ``".npz"``: all fields as raw integers, with the parameters of their
            formats and the stream's account.
        file: A binary file.
        found: The points.
        form: Format of the points.
        step: Distance of the lines whose points were sent.
        build: The board's identity.
        account: Account of the stream.
    """
    if kind == ".npz":
        names = found.dtype.names or ()
        facts = {f"account_{key}": np.int64(value) for key, value in asdict(account).items()}
        np.savez_compressed(
            file,
            allow_pickle=False,
            pixel_width=np.int64(build.pixel_width),
            unit_mm=np.int64(build.length_unit),
            clock_hz=np.int64(build.clock_hz),
            step=np.int64(step),
            **facts,
            **{name: found[name] for name in names},
        )
    elif form is Form.FULL:
        clock = Clock(build.clock_hz)
        write_csv(full_table(found, build.pixel_width, clock, build.length_unit), file)
    elif form is Form.SPACE:
        _write_space(found, file, build.length_unit)
    else:
        _write_compact(found, file, build.length_unit)


def _write_space(found: Records, file: BinaryIO, unit_mm: int) -> None:
    """Write points and free beams as text; a line is one or the other, and the rest is empty."""
    length, ends = (
        math.ceil(bits * math.log10(2.0)) for bits in (pkg.LENGTH_FRACTION, pkg.FREE_FRACTION)
    )
    file.write(
        b"line,x_mm,z_mm,c_obj,angle_rad,free_from_mm,free_to_mm,c_sfm,flags,confidence,inward\n"
    )
    step, free_step = (unit_mm * 2.0**-k for k in (pkg.LENGTH_FRACTION, pkg.FREE_FRACTION))
    turn = 2.0 * math.pi * 2.0**-pkg.ANGLE_WIDTH
    point = records.measured(found)
    for each, is_point in zip(found, point.tolist(), strict=True):
        place, beam = ",,", ",,,"
        if is_point:
            place = f"{each['x'] * step:.{length}f},{each['z'] * step:.{length}f}"
            place += f",{each['c_obj'] / 255:.3f}"
        else:
            span = ","
            if each["free_to"]:
                span = f"{each['free_from'] * free_step:.{ends}f}"
                span += f",{each['free_to'] * free_step:.{ends}f}"
            beam = f"{each['angle'] * turn:.5f},{span},{each['c_sfm'] / 255:.3f}"
        names = "|".join(name for bit, name in COMPACT_FLAGS.items() if each["flags"] >> bit & 1)
        mirror = f"{each['confidence'] / 254:.3f},{each['inward']}"
        file.write(f"{each['line']},{place},{beam},{names},{mirror}\n".encode())


def _write_compact(found: Records, file: BinaryIO, unit_mm: int) -> None:
    """Write compact points as text; x and z are empty where a point is not measured."""
    decimals = math.ceil(pkg.LENGTH_FRACTION * math.log10(2.0))
    file.write(b"line,x_mm,z_mm,c_obj,flags\n")
    step = unit_mm * 2.0**-pkg.LENGTH_FRACTION
    for line, x, z, c_obj, flags in found.tolist():
        place = ","
        if flags >> link_pkg.COMPACT_MEASURED & 1:
            place = f"{x * step:.{decimals}f},{z * step:.{decimals}f}"
        names = "|".join(name for bit, name in COMPACT_FLAGS.items() if flags >> bit & 1)
        file.write(f"{line},{place},{c_obj / 255:.3f},{names}\n".encode())


# ---- raw lines ----


@dataclass(frozen=True)
class Threshold:
    """The settings of a board from which its thresholds are computed."""

    k_noise: float
    k_height: float
    noise_row: bool


def threshold_settings(device: Device) -> Threshold:
    """Return the board's settings of the threshold."""
    names = ("k_noise", "k_height", "noise_row")
    found = device.read_many(names)
    k_noise, k_height, noise_row = (integer(found[name]) for name in names)
    return Threshold(
        k_noise / 2.0**pkg.K_NOISE_FRACTION,
        k_height / 2.0**pkg.K_HEIGHT_FRACTION,
        bool(noise_row),
    )


def captured_point(each: Captured, build: Build) -> Table | None:
    """Return what the board made of a line, a table of one row, or None for no point."""
    if each.record is None:
        return None
    return in_units(records.points(each.record, build.pixel_width, build.length_unit))


def threshold(pixels: Pixels, settings: Threshold) -> float:
    """Return the threshold of a line, which takes more than its point says."""
    limited = not settings.noise_row
    row = statistics(pixels[None], max_window=MAX_WINDOW, noise_row=settings.noise_row)
    level = cut(row, k_noise=settings.k_noise, k_height=settings.k_height, limited=limited)
    return float(level[0])


def _flags(point: Table) -> str:
    return "|".join(name for name, where in point.flags.items() if where[0])


_Row = tuple[Captured, Table | None]


def capture_table(found: Sequence[Captured], settings: Threshold, build: Build) -> RichTable:
    """Return raw lines with the board's result for each."""

    def of(value: Callable[[Table], Any]) -> Callable[[_Row], Any]:
        return lambda row: None if row[1] is None else value(row[1])

    columns: list[Column[_Row]] = [
        Column("line", lambda row: row[0].line),
        Column("least", lambda row: int(row[0].pixels.min())),
        Column("most", lambda row: int(row[0].pixels.max())),
        Column("background", of(lambda p: p.background[0]), "{:.1f}"),
        Column("noise", of(lambda p: p.noise[0]), "{:.2f}"),
        Column("threshold", lambda row: threshold(row[0].pixels, settings), "{:.1f}"),
        Column("window", of(lambda p: f"{p.left[0]}..{p.right[0]}" if p.width[0] > 0 else "")),
        Column("position", of(lambda p: p.position_px[0] if p.measured[0] else None), "{:.3f}"),
        Column("S/N", of(lambda p: p.snr[0]), "{:.1f}"),
        words("flags", of(_flags), wraps=True, absent="no point"),
    ]
    rows = [(each, captured_point(each, build)) for each in found]
    return Sheet(columns, rows).terminal("Lines")


def capture_text(each: Captured, width: int) -> str:
    """Return a raw line as text: each column's largest pixel, from 0 to the line's largest."""
    columns = min(width, len(each.pixels))
    edges = np.linspace(0, len(each.pixels), columns + 1).astype(np.int64)[:-1]
    heights = np.maximum.reduceat(each.pixels, edges).astype(np.float64)
    steps = len(_MARKS) - 1
    scaled = np.round(heights / max(1.0, heights.max()) * _MARK_ROWS * steps).astype(np.int64)
    lines = [f"line {each.line}, 0 to {int(heights.max())}, {len(each.pixels)} px"]
    for row in reversed(range(_MARK_ROWS)):
        part = np.clip(scaled - row * steps, 0, steps)
        lines.append("".join(_MARKS[k] for k in part))
    return "\n".join(lines)


def write_captures(
    kind: str, file: BinaryIO, found: Sequence[Captured], settings: Threshold, build: Build
) -> None:
    """Write raw lines.

    Args:
        kind: ``".csv"``: one column for each line; ``".png"``: a picture.
        file: A binary file.
        found: The lines.
        settings: Settings of the thresholds in the picture.
        build: The board's identity.
    """
    if kind == ".csv":
        pixels = np.stack([each.pixels for each in found], axis=1).tolist()
        names = ["pixel", *(f"line_{each.line}" for each in found)]
        file.write(listed(names, [(k, *row) for k, row in enumerate(pixels)]).csv())
    else:
        _picture(file, found, settings, build)


def _records(found: Sequence[Captured]) -> Records:
    """Return the record of each line, all zeros where it gave none."""
    empty = np.zeros(1, records.FULL)
    return np.concatenate([empty if e.record is None else e.record for e in found])


def captured_lines(found: Sequence[Captured], clock: Clock) -> Lines:
    """Return raw lines with what their points tell of angle, power, mirror and time."""
    points = _records(found)
    known = np.array([each.record is not None for each in found])
    time_s = np.full(len(found), np.nan)
    time_s[known] = clock.beside(points["time"][known])
    raised = points["flags"] >> pkg.FLAG_NOT_RUNNING & ((1 << pkg.MIRROR_FLAG_WIDTH) - 1)
    return Lines(
        lines=np.stack([each.pixels for each in found]),
        angle_rad=points["angle"] * (2.0 * math.pi / 2.0**pkg.ANGLE_WIDTH),
        power=points["power"].astype(np.int64),
        mirror_flags=raised.astype(np.int64),
        time_s=time_s,
        number=np.array([each.line for each in found]),
    )


def _picture(file: BinaryIO, found: Sequence[Captured], settings: Threshold, build: Build) -> None:
    """Draw each line with its window, background and threshold."""
    from vrscan.show.style import COLOURS, QUIET, drawing

    shown = found[:12]
    with drawing(9.0, 2.2 * len(shown) + 0.6) as figure:
        axes = figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0]
        for axis, each in zip(axes, shown, strict=True):
            axis.plot(each.pixels, color=COLOURS[0], linewidth=0.8, drawstyle="steps-mid")
            title = f"line {each.line}"
            point = captured_point(each, build)
            if point is not None:
                level, over = float(point.background[0]), threshold(each.pixels, settings)
                axis.axhline(level, color=QUIET, linewidth=0.8, label="background")
                look = {"color": COLOURS[1], "linewidth": 0.8, "dashes": (4, 3)}
                axis.axhline(over, label="threshold", **look)
                if point.width[0] > 0:
                    ends = point.left[0] - 0.5, point.right[0] + 0.5
                    axis.axvspan(*ends, color=COLOURS[2], alpha=0.2, label="window")
                if point.measured[0]:
                    place = float(point.position_px[0])
                    axis.axvline(place, color=COLOURS[3], linewidth=0.8, label="position")
                    title += f": {place:.3f} px, S/N {point.snr[0]:.1f}"
                title += f" {_flags(point)}".rstrip()
            axis.set_title(title)
            axis.set_xlim(0, len(each.pixels) - 1)
            axis.set_ylabel("counts")
        axes[-1].set_xlabel("pixel")
        named = axes[0].get_legend_handles_labels()
        figure.legend(*named, loc="outside lower center", ncols=4)
        figure.savefig(file, format="png", dpi=120)


# ---- bench ----


@dataclass(frozen=True)
class Trips:
    """Many round trips of one kind.

    Attributes:
        what: Name of the command.
        seconds: Duration of each trip, by this machine's clock.
        board_s: Duration of all trips together, by the board's clock.
        words: Number of register words in each trip.
    """

    what: str
    seconds: Floats
    board_s: float
    words: int


@dataclass(frozen=True)
class Rate:
    """A stream of test lines at full speed.

    Attributes:
        baud: Rate of the link.
        form: Format of the records.
        points: Number of points that came.
        seconds: Duration by this machine's clock.
        board_s: Duration by the board's clock.
        share: Share of the serial line's time that was used, by the board's clock.
    """

    baud: int
    form: Form
    points: int
    seconds: float
    board_s: float
    share: float


def bench_tables(trips: Sequence[Trips], rates: Sequence[Rate]) -> Group:
    """Return round trips and streams as two tables."""
    commands: list[Column[Trips]] = [
        words("command", lambda trip: trip.what),
        Column("median", lambda trip: float(np.median(trip.seconds)), "{:.3f}", **_MS),
        Column("p95", lambda trip: float(np.percentile(trip.seconds, 95)), "{:.3f}", **_MS),
        Column("1/s", lambda trip: 1.0 / float(trip.seconds.mean()), "{:.0f}"),
        Column("words/s", lambda trip: trip.words / float(trip.seconds.mean()) or None, "{:.0f}"),
        Column("board", lambda trip: trip.board_s / len(trip.seconds), "{:.4f}", **_MS),
        Column(
            "board words/s",
            lambda trip: trip.words * len(trip.seconds) / (trip.board_s or math.inf) or None,
            "{:.0f}",
        ),
    ]
    points: list[Column[Rate]] = [
        Column("baud", lambda rate: rate.baud),
        words("records", lambda rate: rate.form.name.lower()),
        Column("points", lambda rate: rate.points),
        Column("points/s", lambda rate: rate.points / rate.seconds, "{:.0f}"),
        Column("board s", lambda rate: rate.board_s, "{:.4f}"),
        Column(
            "board points/s",
            lambda rate: rate.points / rate.board_s if rate.board_s else None,
            "{:.0f}",
        ),
        Column("of the line", lambda rate: rate.share, "{:.0f} %", scale=100),
    ]
    caption = "board: of a simulated one this is what counts"
    return Group(
        Sheet(commands, trips).terminal("Commands", caption, gap=2),
        "",
        Sheet(points, rates).terminal(
            "Points", "of test lines, as many as the line carries", gap=2
        ),
    )
