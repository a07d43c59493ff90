"""vrscan_chain clock by clock: gaps, faults, early lines, resets and a consumer that waits.

``test_chain_lines.py`` sends thousands of whole lines through the shipped elaboration; here the
order of things is what is tested, on lines short enough to step through.
"""

from dataclasses import dataclass, replace

import cocotb
import numpy as np
import pytest
from harness import (
    FallingEdge,
    generator,
    in_volume,
    parameters,
    port,
    reset,
    rounds,
    simulate,
    struct_ports,
)

from vrscan.clocked.commit_control import CommitControl
from vrscan.data import pkg
from vrscan.data.config import Config, Geometry, Peak, Sensor
from vrscan.data.points import Points
from vrscan.engines.chain_engine import RESULTS
from vrscan.fixed import vrscan_chain as chain
from vrscan.fixed.correction_map import COLUMNS, ROWS
from vrscan.fixed.line_receiver import LineReceiver
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.registers.chain_registers import Registers
from vrscan.registers.map_table import MapTable
from vrscan.registers.structs import POINT

ELABORATIONS = [
    {"NeighbourClks": 5000} | given  # a fit's point waits so long for the next line
    for given in (
        {"LineLength": 600, "PixelWidth": 12, "MaxWindow": 60},  # lines may follow without a gap
        {"LineLength": 130, "PixelWidth": 8, "MaxWindow": 20, "CountWidth": 1},  # they may not
        {"LineLength": 547, "PixelWidth": 16, "MaxWindow": 70},
        {"LineLength": 1200, "PixelWidth": 12, "MaxWindow": 60},  # nor do those of two passes
        *(
            {
                "LineLength": length,
                "PixelWidth": width,
                "MaxWindow": 255,
                "NeighbourClks": pkg.NEIGHBOUR_CLKS,
            }
            for length in (256, 8192)
            for width in (8, 16)
        ),
    )
]
PASSED = ("power", "confidence", "inward", "time", "test")  # what only passes through

pytestmark = pytest.mark.xdist_group("vrscan_chain")  # most of them take one elaboration


@dataclass(frozen=True)
class Strobes:
    """One clock at the sensor's side."""

    start: bool = False
    valid: bool = False
    pixel: int = 0
    end: bool = False
    angle: int = 0
    power: int = 0
    mirror_flags: int = 0
    rest: int = 0  # what else belongs to the line: 0 to 255, of which all of it is made

    def line(self) -> dict[str, int]:
        """Return the fields of line_t."""
        rest = self.rest
        own = {"angle": self.angle, "power": self.power, "mirror_flags": self.mirror_flags}
        more = {"confidence": rest, "inward": rest & 1, "test": rest >> 7}
        return own | more | {"time_clks": rest * 0x0101_0101, "lens": rest * 0x0101}


def min_period(window: str = "threshold") -> int:
    """Return the clocks between two good lines that the elaboration asks for."""
    given = parameters()
    peak = Peak.model_validate({"window": window})
    length, most = given["LineLength"], given["MaxWindow"]
    return chain.min_period(length, most, two_pass=peak.two_pass, fit=peak.fit)


def counted(dut, *names: str) -> list[int]:
    """Return the counters of dropped lines and points."""
    return [port(dut, f"{name}_count_o").value for name in names]


def limited(*counts: int) -> list[int]:
    """Return what counters of the running elaboration show of these counts."""
    return [min(count, (1 << parameters().get("CountWidth", 16)) - 1) for count in counts]


def registers(window: str = "threshold") -> Registers:
    """Return the shipped registers for the running elaboration."""
    given = parameters()
    sensor = Sensor(pixel_width=given["PixelWidth"], line_length=given["LineLength"])
    length = given["LineLength"]
    # The shipped lens has room for 7 um up to 7192 px.
    geometry = Geometry(centre_px=(length - 1) / 2, pitch_mm=0.007 if length < 7000 else 0.0035)
    peak = Peak.model_validate({"window": window})
    return Registers.from_config(Config(sensor=sensor, geometry=geometry, peak=peak))


def spot_lines(count: int, salt: int) -> np.ndarray:
    """Return lines with a spot of any width and place, some without."""
    given = parameters()
    draw = generator(salt)
    length, top = given["LineLength"], (1 << given["PixelWidth"]) - 1
    centre = draw.uniform(-2, length + 2, (count, 1))
    width = 10 ** draw.uniform(-0.3, 1.5, (count, 1))
    height = 10 ** draw.uniform(-2, 0.3, (count, 1)) * top
    lines = 0.02 * top * (1 + draw.random((count, length)))
    lines += height * np.exp(-(((np.arange(length) - centre) / width) ** 2))
    lines[draw.random(count) < 0.1] = 5
    return np.clip(np.round(lines), 0, top).astype(np.uint16)


def as_strobes(pixels: np.ndarray, salt: int, *, gap: float = 0.0) -> list[Strobes]:
    """Return the clocks of one line, with a share ``gap`` of idle ones."""
    draw = generator(salt)
    angle, power = int(draw.integers(-(1 << 20), 1 << 20)), int(draw.integers(1 << 16))
    raised = int(draw.integers(1 << pkg.MIRROR_FLAG_WIDTH))
    rest = int(draw.integers(256))
    clocks: list[Strobes] = []
    for k, pixel in enumerate(pixels.tolist()):
        while draw.random() < gap:
            clocks.append(
                Strobes(
                    start=k == 0 and not clocks, pixel=77, angle=1, power=2, mirror_flags=7 - raised
                )
            )
        last = k == len(pixels) - 1
        # What counts is sampled with the line's end.
        flags = raised if last else 7 - raised
        more = rest if last else 255 - rest
        clocks.append(Strobes(not clocks, True, pixel, last, angle, power, flags, more))
    return clocks


def idle(clocks: int) -> list[Strobes]:
    """Return clocks in which nothing happens."""
    return [Strobes()] * clocks


async def drive(dut, clocks: list[Strobes]) -> list[tuple[int, dict[str, int]]]:
    """Drive the clocks with the consumer ready and return (clock, point) as they come."""
    got = []
    given: dict[str, int] = {}
    for cycle, s in enumerate(clocks):
        dut.line_start_i.value = int(s.start)
        dut.pixel_valid_i.value = int(s.valid)
        dut.pixel_i.value = s.pixel
        dut.line_end_i.value = int(s.end)
        if s.line() != given:
            given = s.line()
            struct_ports(dut)["line_i"].give(given)
        await FallingEdge(dut.clk_i)
        if dut.valid_o.value and dut.ready_i.value:
            got.append((cycle + 1, read_point(dut)))
    return got


def read_point(dut) -> dict[str, int]:
    """Return the point on the output ports."""
    fields = struct_ports(dut)["point_o"].read()
    return {name: fields[POINT.get(name, name)] for name in (*RESULTS, *PASSED)}


def some_maps(salt: int) -> MapTable:
    """Return smooth maps whose nodes are filled in places, about the lenses of lines."""
    draw = generator(salt)
    i, j = np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij")
    waves = [np.sin(draw.uniform(0.1, 0.4) * i + 0.3 * j + k) for k in range(2)]
    filled = draw.random((2, ROWS, COLUMNS)) < 0.15
    return MapTable(np.int64(9000.0 * np.array(waves)), filled, 20_000, 14, 27_000)


async def write_maps(dut, maps: MapTable, bank: int) -> None:
    """Write maps into a bank, as the bus does."""
    for index, word in enumerate(maps.words.tolist()):
        entry = {"map_table_write": 1, "map_table_index": index, "map_table_node": word}
        struct_ports(dut)["map_table_i"].give(entry | {"map_table_access_bank": bank})
        await FallingEdge(dut.clk_i)
    struct_ports(dut)["map_table_i"].give({})


def use_maps(dut, maps: MapTable | None, bank: int = 0, *, follow: bool = False) -> None:
    """Let maps take effect."""
    if maps is None:
        struct_ports(dut)["map_i"].give({})
        return
    places = {"map_begin": maps.map_begin, "map_shift": maps.map_shift, "map_lens": maps.lens}
    which = {"map_enable": 1, "map_bank": bank, "map_follow": int(follow)}
    struct_ports(dut)["map_i"].give(places | which | {"map_count": len(maps.nodes)})


def expected(
    clocks: list[Strobes], given: Registers, maps: MapTable | None = None, *, follow: bool = False
) -> list[tuple[int, dict[str, int]]]:
    """Return (clock, point) by the receiver's twin and the model of the chain."""
    elaboration = parameters()
    length = elaboration["LineLength"]
    window = "fit" if given.window_fit else "two_pass" if given.window_two_pass else "threshold"
    twin = LineReceiver(length, min_period(window))
    pixels: list[int] = []
    ends, lines, angles, powers, raised, numbers, lost = [], [], [], [], [], [], []
    lenses: list[int] = []
    passed: list[dict[str, int]] = []
    for cycle, s in enumerate(clocks):
        got = twin.step(s.start, s.valid, s.pixel, s.end)
        if got.index is not None:
            pixels = [*pixels[: got.index], s.pixel] if got.index else [s.pixel]
        if got.good:
            ends.append(cycle)
            lines.append(pixels)
            angles.append(s.angle)
            powers.append(s.power)
            raised.append(s.mirror_flags)
            line = s.line()
            lenses.append(line["lens"])
            passed.append({name: line["time_clks" if name == "time" else name] for name in PASSED})
            numbers.append(got.line_number)
            lost.append(got.lost)
    if not lines:
        return []
    points = run_fixed(
        np.array(lines, np.uint16),
        np.array(angles),
        np.array(powers),
        given,
        mirror_flags=np.array(raised),
        max_window=elaboration["MaxWindow"],
        maps=maps,
        lens=np.array(lenses) if follow else None,
    )
    flags = points.flags | np.array(lost, np.int64) << pkg.FLAG_LINES_LOST
    points = replace(points, line=np.array(numbers), flags=flags)
    _, first = chain.first_windows(np.array(lines, np.uint16), given, elaboration["MaxWindow"])
    due = [
        chain.latency(
            int(points.width[k]),
            measured=bool((points if given.window_fit else first).measured[k]),
            line_length=length,
            pixel_width=elaboration["PixelWidth"],
            max_window=elaboration["MaxWindow"],
            first_width=int(first.width[k]) if given.window_two_pass else None,
            fit=given.window_fit,
            mapped=maps is not None,
        )
        for k in range(len(lines))
    ]
    clocks = [end + due[k] for k, end in enumerate(ends)]
    if given.window_fit:  # a point comes with the next line, the last one after a wait
        clocks = [*clocks[1:], clocks[-1] + elaboration["NeighbourClks"]]
    return [(clock, row(points, k) | passed[k]) for k, clock in enumerate(clocks)]


def row(points: Points, k: int) -> dict[str, int]:
    """Return point k under the names of the ports."""
    return {name: int(getattr(points, name)[k]) for name in RESULTS}


async def compare(
    dut,
    clocks: list[Strobes],
    given: Registers,
    maps: MapTable | None = None,
    *,
    follow: bool = False,
) -> list[dict[str, int]]:
    """Drive the clocks, let the last point out, and compare every point and its clock."""
    elaboration = parameters()
    rest = 4500 + elaboration["NeighbourClks"] if given.window_fit else 2000
    clocks = clocks + idle(rest + elaboration["LineLength"])
    want = expected(clocks, given, maps, follow=follow)
    got = await drive(dut, clocks)
    for k, (have, need) in enumerate(zip(got, want, strict=False)):
        wrong = {n: (have[1][n], need[1][n]) for n in need[1] if have[1][n] != need[1][n]}
        assert have[0] == need[0] and not wrong, (
            f"point {k}: clock {have[0]}, want {need[0]}; (got, want) {wrong}"
        )
    assert len(got) == len(want), f"{len(got)} points, want {len(want)}"
    return [point for _, point in got]


async def start(dut, window: str = "threshold") -> Registers:
    """Reset, load the registers and open the consumer."""
    await reset(dut)
    given = registers(window)
    struct_ports(dut)["peak_i"].give(given)
    struct_ports(dut)["geometry_i"].give(given)
    struct_ports(dut)["free_i"].give(given)
    for entry, (least, largest) in enumerate(
        zip(given.free_table_from, given.free_table_to, strict=True)
    ):
        struct_ports(dut)["free_table_i"].give(
            {
                "free_table_write": 1,
                "free_table_index": entry,
                "free_table_from": least,
                "free_table_to": largest,
            }
        )
        await FallingEdge(dut.clk_i)
    struct_ports(dut)["free_table_i"].give({})
    use_maps(dut, None)
    dut.ready_i.value = 1
    await FallingEdge(dut.clk_i)
    return given


@cocotb.test()
async def nothing_is_zero_before_the_reset(dut) -> None:
    """The simulator does begin with anything: else the tests that follow would show less."""
    bits = str(dut.point_o.value)
    assert 0.3 < bits.count("1") / len(bits) < 0.7


@cocotb.test()
async def lines_back_to_back(dut) -> None:
    """No clock between lines; where that is too fast, lines are dropped and flagged."""
    given = await start(dut)
    lines = spot_lines(40, 1)
    clocks = [s for k, line in enumerate(lines) for s in as_strobes(line, k)]
    points = await compare(dut, clocks, given)
    if not min_period():
        assert len(points) == len(lines)
    else:
        assert 0 < len(points) < len(lines)
        assert counted(dut, "early") == limited(len(lines) - len(points))
        assert points[1]["flags"] >> pkg.FLAG_LINES_LOST & 1
    if parameters()["LineLength"] <= 3 * pkg.BLOCK_LENGTH:
        # Three blocks, of which a maximum in the middle leaves none.
        assert any(point["flags"] >> pkg.FLAG_ROW_STATISTICS & 1 for point in points)


@cocotb.test()
async def two_passes_back_to_back(dut) -> None:
    """Two windows a line; the least period is theirs, and a reset in mid-stream leaves nothing."""
    await back_to_back(dut, "two_pass", 24)


@cocotb.test()
async def fits_back_to_back(dut) -> None:
    """The same of fits, whose speckle depends on the lines before."""
    await back_to_back(dut, "fit", rounds(16, 48))


async def back_to_back(dut, window: str, count: int) -> None:
    """Send lines without a gap and at their least period, and reset in between."""
    given = await start(dut, window)
    lines = spot_lines(count, 6)
    clocks = [s for k, line in enumerate(lines) for s in as_strobes(line, k)]
    points = await compare(dut, clocks, given)
    apart = min_period(window)
    if not apart:
        assert len(points) == len(lines)
    else:
        assert 0 < len(points) < len(lines)
        assert counted(dut, "early") == limited(len(lines) - len(points))
    rest = idle(max(0, apart - parameters()["LineLength"]))
    part = [s for k, line in enumerate(lines[:4]) for s in as_strobes(line, k) + rest]
    whole = expected(part + idle(5000), given)[0][0]
    for age in np.linspace(whole - 700, whole + 10, rounds(3, 12)).astype(int):
        await drive(dut, (part + idle(5000))[:age])
        dut.rst_i.value = dut.pixel_valid_i.value = dut.line_end_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        points = await compare(dut, part, given)
        assert points[0]["line"] == 0 and len(points) == 4


@cocotb.test()
async def lines_with_maps(dut) -> None:
    """With one window and with a fit, by each bank, where the lens stands still and moves."""
    lines = spot_lines(rounds(12, 40), 9)
    for bank, (window, follow) in enumerate((("threshold", True), ("fit", False))):
        given, maps = await start(dut, window), some_maps(20 + bank)
        await write_maps(dut, some_maps(30), 1 - bank)
        await write_maps(dut, maps, bank)
        use_maps(dut, maps, bank, follow=follow)
        clocks: list[Strobes] = []
        for k, line in enumerate(lines):
            clocks += as_strobes(line, k) + idle(min_period(window))
        points = await compare(dut, clocks, given, maps, follow=follow)
        found = [point for point in points if point["measured"]]
        told = sum(point["flags"] >> pkg.FLAG_MAP_FILLED & 1 for point in found)
        assert 0 < told < len(found) or len(found) < 6  # few spots are clear on a short line
    use_maps(dut, None)


@cocotb.test()
async def gaps_everywhere(dut) -> None:
    """Gaps between pixels and between lines."""
    given = await start(dut)
    draw = generator(2)
    clocks: list[Strobes] = []
    for k, line in enumerate(spot_lines(12, 2)):
        clocks += as_strobes(line, k, gap=float(draw.random() * 0.5))
        clocks += idle(int(draw.integers(2 * min_period() + 50)))
    await compare(dut, clocks, given)


@cocotb.test()
async def bad_lines_among_good_ones(dut) -> None:
    """Short, long and unfinished lines: counted, flagged in the next point, and without trace."""
    given = await start(dut)
    lines = spot_lines(16, 3)
    pause = idle(min_period())
    clocks: list[Strobes] = []
    for k, line in enumerate(lines):
        part = as_strobes(line, k)
        if k % 4 == 1:
            part = as_strobes(line[: 1 + 31 * k % len(line)], k)
        elif k % 4 == 2:
            part = as_strobes(np.r_[line, line[:3]], k)
        elif k % 8 == 3:
            part = part[:-5]
        clocks += part + pause
    points = await compare(dut, clocks, given)
    assert len(points) < len(lines)
    assert counted(dut, "short", "long", "unfinished") == limited(4, 4, 2)


class Committed:
    """Drives lines while one configuration follows another, as commit_control lets it.

    The oracle knows nothing of the chain's state: it takes the lines that the receiver's twin calls
    good, puts each with the configuration whose bit its point has, and computes the lines of each
    configuration alone, as if there were no other.
    """

    def __init__(self, dut, configurations: list[Registers], commits: list[int]) -> None:
        self.dut = dut
        self.configurations = configurations
        self.commits = commits  # clocks
        self.control = CommitControl(256)
        self.got: list[dict[str, int]] = []
        self.good: list[list[tuple[Strobes, list[int], int, bool]]] = [[] for _ in configurations]
        self.held: list[int] = []  # clocks of each hold
        self.banks = [some_maps(40), some_maps(41)] if configurations[0].line_length >= 64 else []
        first = configurations[0]
        self.receiver = LineReceiver(first.line_length, self.period(first))

    @staticmethod
    def period(given: Registers) -> int:
        """Return the least period of a configuration."""
        most = parameters()["MaxWindow"]
        two_pass, fit = given.window_two_pass, given.window_fit
        return chain.min_period(given.line_length, most, two_pass=two_pass, fit=fit)

    def give(self, number: int) -> None:
        """Let a configuration take effect."""
        for name in ("peak_i", "geometry_i", "free_i"):
            struct_ports(self.dut)[name].give(self.configurations[number])
        use_maps(self.dut, self.maps(number), number % 2, follow=self.follows(number))

    def maps(self, number: int) -> MapTable | None:
        """Return the maps of a configuration: none, those of one bank, those of the other."""
        return self.banks[number % 2] if number % 3 and self.banks else None

    @staticmethod
    def follows(number: int) -> bool:
        """Return whether the maps of a configuration follow the lens."""
        return number % 4 < 2

    async def write(self) -> None:
        """Write the maps of both banks."""
        for bank, maps in enumerate(self.banks):
            await write_maps(self.dut, maps, bank)

    async def run(self, clocks: list[Strobes]) -> None:
        """Do all of it; the first commit is that behind the reset."""
        dut, control, number = self.dut, self.control, -1
        fresh, pixels, due = False, [], None
        for cycle, s in enumerate(clocks):
            dut.line_start_i.value, dut.line_end_i.value = int(s.start), int(s.end)
            dut.pixel_valid_i.value, dut.pixel_i.value = int(s.valid), s.pixel
            if s.start or s.end:
                struct_ports(dut)["line_i"].give(s.line())
            strobe = bool(self.commits) and cycle >= self.commits[0] and not control.waiting
            if strobe:
                self.commits.pop(0)
            bank = control.configuration
            coming = self.configurations[min(number + 1, len(self.configurations) - 1)]
            entry = {
                "free_table_write": int(control.copy),
                "free_table_index": control.index,
                "free_table_from": coming.free_table_from[control.index],
                "free_table_to": coming.free_table_to[control.index],
                "free_table_write_bank": 1 - bank,
                "free_table_bank": bank,
            }
            if control.waiting:
                struct_ports(dut)["free_table_i"].give(entry)
            dut.hold_i.value, dut.take_i.value = int(control.hold), int(control.take)
            dut.configuration_i.value = bank
            if control.take:
                number += 1
                due = cycle + 2
                self.receiver.min_period = self.period(self.configurations[number])
                self.held.append(0)
            if cycle == due:
                self.give(number)
            # The receiver's twin, and which lines begin and end outside of a hold.
            if s.start:
                fresh = True
            skip = control.hold or not fresh
            if control.hold:
                fresh = False
                if self.held:
                    self.held[-1] += 1
            answer = self.receiver.step(s.start, s.valid, s.pixel, s.end, skip, control.take)
            if answer.index is not None:
                pixels = [*pixels[: answer.index], s.pixel]
            if answer.good:
                self.good[number].append((s, pixels, answer.line_number, answer.lost))
            control.step(strobe=strobe, empty=bool(dut.empty_o.value), renewing=False)
            await FallingEdge(dut.clk_i)
            if dut.valid_o.value:
                point = read_point(dut) | {"number": number}
                point["bit"] = struct_ports(dut)["point_o"].read()["configuration"]
                self.got.append(point)

    def check(self) -> int:
        """Compare all points, and return how many there are."""
        at = 0
        for number, (given, lines) in enumerate(zip(self.configurations, self.good, strict=True)):
            if not lines:
                continue
            points = run_fixed(
                np.array([pixels for _, pixels, *_ in lines], np.uint16),
                np.array([s.angle for s, *_ in lines]),
                np.array([s.power for s, *_ in lines]),
                given,
                mirror_flags=np.array([s.mirror_flags for s, *_ in lines]),
                max_window=parameters()["MaxWindow"],
                maps=self.maps(number),
                lens=np.array([s.line()["lens"] for s, *_ in lines])
                if self.follows(number)
                else None,
            )
            for k, (s, _, line, lost) in enumerate(lines):
                passed = {"time" if n == "time_clks" else n: v for n, v in s.line().items()}
                want = row(points, k) | {name: passed[name] for name in PASSED}
                want |= {"line": line, "number": number, "bit": number % 2}
                want["flags"] |= lost << pkg.FLAG_LINES_LOST
                assert self.got[at] == want, f"configuration {number}, line {line}"
                at += 1
        assert at == len(self.got)
        return at


def configurations(draw: np.random.Generator, windows: list[str]) -> list[Registers]:
    """Return configurations that differ in all that the chain takes."""
    made = []
    for k, window in enumerate(windows):
        given = registers(window)
        entries = len(given.free_table_from)
        least = draw.integers(0, 1 << 15, entries)
        made.append(
            replace(
                given,
                k_noise=given.k_noise + 40 * k,
                kappa=given.kappa + 1000 * k,
                noise_row=bool(k % 3 == 1),
                c_sfm_gain=given.c_sfm_gain * (1 + k) % (1 << 20),
                saturation_level=given.saturation_level - k,
                centre=given.centre + 12_345_678 * k,
                k1=given.k1 + 3001 * k,
                n0=given.n0 - 9_999_999 * k,
                tolerance=given.tolerance + 77 * k,
                c_obj_gain=4321 * k if k % 3 == 2 else 0,
                free_begin=given.free_begin - 5000 * k,
                free_table_from=tuple(least.tolist()),
                free_table_to=tuple((least + draw.integers(0, 1 << 15, entries)).tolist()),
            )
        )
    return made


@cocotb.test()
async def every_point_is_of_one_configuration(dut) -> None:
    """Commits at any moment, lines with and without gaps, every window followed by every other."""
    draw = generator(8)
    order = ["threshold", "fit", "two_pass", "fit", "fit", "threshold", "two_pass", "threshold"]
    await reset(dut)
    dut.ready_i.value = 1
    count = rounds(70, 200)
    clocks = idle(400)  # the commit behind the reset
    for k, line in enumerate(spot_lines(count, 8)):
        clocks += as_strobes(line, k) + idle(int(draw.choice([0, 0, 0, 1, 300])))
    commits = np.sort(draw.integers(2000, len(clocks), len(order) - 1)).tolist()
    bench = Committed(dut, configurations(draw, order), commits)
    await bench.write()
    rest = 8000 + parameters()["NeighbourClks"]
    await bench.run(clocks + idle(rest))
    points = bench.check()
    skipped = bench.receiver.skipped
    assert counted(dut, "skipped") == limited(skipped)
    assert points > len(order) and skipped >= len(order) - 1
    assert points + skipped + bench.receiver.early == count
    print(f"{len(order) - 1} commits: {skipped} lines skipped, holds of {bench.held} clocks")
    # A hold is as long as what is inside takes, whatever comes meanwhile.
    assert max(bench.held) < 2 * pkg.FIT_PERIOD + 3000 + parameters()["LineLength"]


@cocotb.test()
async def consumer_that_waits(dut) -> None:
    """A point that nobody takes stays; the next ones are counted, and the first after says so."""
    given = await start(dut)
    lines = spot_lines(6, 4)
    period = max(min_period(), len(lines[0]))
    clocks: list[Strobes] = []
    for k, line in enumerate(lines):
        part = as_strobes(line, k)
        clocks += part + idle(period - len(part))
    rest = idle(3000 + len(lines[0]))
    want = expected(clocks + rest, given)
    dut.ready_i.value = 0
    # The consumer opens between the third and the fourth point.
    split = (want[2][0] + want[3][0]) // 2
    clocks = clocks + rest
    await drive(dut, clocks[:split])
    assert dut.valid_o.value == 1
    assert read_point(dut) == want[0][1]
    assert counted(dut, "dropped") == limited(2)
    dut.ready_i.value = 1
    got = await drive(dut, clocks[split:])
    flagged = want[3][1] | {"flags": want[3][1]["flags"] | 1 << pkg.FLAG_POINTS_LOST}
    assert [point for _, point in got] == [flagged, want[4][1], want[5][1]]
    dut.rst_i.value = 1
    await FallingEdge(dut.clk_i)
    dut.rst_i.value = 0
    assert counted(dut, "dropped") == [0]


@cocotb.test()
async def reset_mid_stream(dut) -> None:
    """A reset at any moment of the chain's work, with pixels coming: then all is as at first."""
    given = await start(dut)
    lines = spot_lines(3, 5)
    part = [s for k, line in enumerate(lines) for s in as_strobes(line, k) + idle(min_period())]
    whole = expected(part + idle(3000), given)[0][0]
    for age in np.linspace(3, whole + 10, 9).astype(int):
        await drive(dut, (part + idle(3000))[:age])
        dut.rst_i.value = dut.pixel_valid_i.value = dut.line_end_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        points = await compare(dut, part, given)
        assert points[0]["line"] == 0


@pytest.mark.parametrize(
    ("widths", "volume"),
    [
        *((widths, "short") for widths in ELABORATIONS[:2]),
        *(in_volume(widths, "short") for widths in ELABORATIONS[4:]),  # their lines are volume
        *(in_volume(widths, "long") for widths in ELABORATIONS[:4]),
    ],
    ids=str,
)
def test_vrscan_chain_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("vrscan_chain", __file__, widths, volume=volume)


@pytest.mark.parametrize("start", [2, 3, in_volume(4)])
def test_what_registers_hold_before_the_reset_changes_no_point(start: int) -> None:
    simulate("vrscan_chain", __file__, ELABORATIONS[0], start=start, only="before|fits")


@pytest.mark.parametrize("pixel_width", [8, 12, 16])
@pytest.mark.parametrize("line_length", [64, 256, 1000, 2048, 4096, 8192])
def test_no_stage_is_busy_longer_than_the_least_period(line_length: int, pixel_width: int) -> None:
    """MinPeriodOverhead covers the stages: what is between two lines is enough for each."""
    from vrscan.fixed import (
        line_statistics,
        peak_confidence,
        peak_fit,
        peak_isolate,
        peak_neighbours,
        peak_position,
        peak_refine,
        phase_correlate,
        triangulate,
    )

    for max_window in (3, 63, 255):
        period = max(2 * max_window + pkg.MIN_PERIOD_OVERHEAD, line_length)
        # Statistics until the threshold has taken them over.
        threshold = line_statistics.latency(line_length, pixel_width, max_window)
        assert max(threshold, peak_isolate.replay_latency()) + 2 <= period
        # A window stays in phase_correlate until its point waits elsewhere.
        quality = max(peak_position.LATENCY, peak_confidence.latency()) + 2
        phase = phase_correlate.latency(max_window)
        assert phase + quality <= period
        # The triangle has let one point go when the next comes, which may have had no window.
        assert phase + triangulate.BUSY <= phase_correlate.UNMEASURED_LATENCY + period

        # With two passes, the same of the second window and what lies between the two.
        period = max(3 * max_window + pkg.TWO_PASS_OVERHEAD, line_length)
        assert max(threshold, peak_isolate.replay_latency()) + 2 <= period
        both = phase_correlate.first_latency(max_window) + peak_refine.latency()
        assert both + phase + quality <= period
        assert both + phase + triangulate.BUSY <= phase_correlate.UNMEASURED_LATENCY + period
        # The line's pixels and statistics are those of the line until then.
        assert phase_correlate.first_latency(pkg.MIN_WINDOW) > peak_refine.START_LATENCY

        # With a fit all of that is over when it starts, and its pixels are read and the fit is over
        # before the next line's are there; where that one is not measured, its point comes sooner.
        assert both + phase + quality <= pkg.FIT_START
        assert pkg.FIT_START + peak_fit.SPAN + 5 < pkg.FIT_PERIOD
        behind = max(triangulate.BUSY, peak_neighbours.LATENCY + 1)
        assert peak_fit.LATENCY + behind <= peak_fit.UNMEASURED_LATENCY + pkg.FIT_PERIOD
    assert max(3 * 255 + pkg.TWO_PASS_OVERHEAD, pkg.FIT_PERIOD) <= 2048
    assert triangulate.BUSY == pkg.POINT_PERIOD
