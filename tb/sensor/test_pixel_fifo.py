"""pixel_fifo: every pixel in its order, at any ratio of the clocks, and what an overflow may do."""

import re
import subprocess

import cocotb
import numpy as np
import pytest
from cocotb.clock import Clock
from cocotb.triggers import Timer
from cocotb.utils import get_sim_time
from harness import EACH_VOLUME, FallingEdge, RisingEdge, generator, parameters, rounds, simulate

from vrscan.clocked.pixel_fifo import Word, lost, split, words
from vrscan.engines.tools import (
    repository_root,
    rtl_boards,
    rtl_modules,
    verilator_environment,
    verilator_program,
)

ELABORATIONS = [
    # 120 px of a line wait, and 8 more fill the FIFO.
    {"PixelWidth": 12, "LineLength": 2880, "Depth": 128, "CountWidth": 16},
    {"PixelWidth": 16, "ClockHz": 1, "PixelHz": 1, "Depth": 8, "CountWidth": 2},
]
# Periods of clk_i and pixel_clk_i in ns, and how much later the second one begins.
CLOCKS = [
    (8, 10, 0),  # 80 MHz to 100
    (10, 8, 0),  # 100 to 80
    *((8, 8, phase) for phase in range(8)),
    (12, 4, 1),
    (4, 12, 1),
    (14, 10, 3),
    (10, 14, 3),
    (4, 40, 0),
]
Samples = list[tuple[bool, bool, int]]


class Bench:
    """Drives the sensor's pins in its clock, and collects words in the other one."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.got: list[Word] = []
        self.times: list[float] = []
        self.tasks: list = []

    async def start(self, clock: int, pixel_clock: int, phase: int) -> None:
        """Begin with other clocks, and reset."""
        for task in self.tasks:
            task.cancel()
        dut = self.dut
        self.periods = (clock, pixel_clock)
        self.tasks = []
        for name in ("rst", "pixel_rst", "line_valid", "pixel_valid", "pixel"):
            getattr(dut, f"{name}_i").value = 0
        self.tasks.append(cocotb.start_soon(Clock(dut.clk_i, clock, unit="ns").start()))
        if phase:
            await Timer(phase, unit="ns")
        self.tasks.append(cocotb.start_soon(Clock(dut.pixel_clk_i, pixel_clock, unit="ns").start()))
        self.tasks.append(cocotb.start_soon(self._collect()))
        await self.reset("rst", 3)

    async def _collect(self) -> None:
        dut = self.dut
        while True:
            await FallingEdge(dut.clk_i)
            start, end = int(dut.line_start_o.value), int(dut.line_end_o.value)
            if int(dut.pixel_valid_o.value):
                self.got.append(Word(bool(start), bool(end), int(dut.pixel_o.value)))
                self.times.append(get_sim_time("ns") - self.periods[0] / 2)
            elif start or end:
                self.got.append(Word(bool(start), bool(end), None))

    async def reset(self, name: str, clocks: int) -> None:
        """Reset one side and wait until both are ready."""
        await self.pulse(name, clocks)
        await self.settle()
        self.got.clear()
        self.times.clear()

    async def pulse(self, name: str, clocks: int) -> None:
        """Give one side's reset, in its own clock."""
        dut = self.dut
        edge = FallingEdge(dut.clk_i if name == "rst" else dut.pixel_clk_i)
        await edge
        getattr(dut, f"{name}_i").value = 1
        for _ in range(clocks):
            await edge
        getattr(dut, f"{name}_i").value = 0

    async def settle(self) -> None:
        """Wait until a flush is over, and the longest queue has come out."""
        await Timer((parameters()["Depth"] + 20) * self.periods[0] + 20 * self.periods[1], "ns")

    async def send(self, samples: Samples) -> None:
        """Give the sensor's pins, a sample a pixel clock."""
        dut = self.dut
        for line_valid, pixel_valid, pixel in samples:
            await FallingEdge(dut.pixel_clk_i)
            dut.line_valid_i.value = int(line_valid)
            dut.pixel_valid_i.value = int(pixel_valid)
            dut.pixel_i.value = pixel

    def overflows(self) -> int:
        return int(self.dut.overflow_count_o.value)


def line(draw: np.random.Generator, length: int, *, gaps: float = 0, pause: int = 3) -> Samples:
    """Return a line and the blanking behind it, with other values where there is no pixel."""
    top = 1 << parameters()["PixelWidth"]
    rows: Samples = []
    for _ in range(length):
        while draw.random() < gaps:
            rows.append((True, False, int(draw.integers(top))))
        rows.append((True, True, int(draw.integers(top))))
    if draw.random() < gaps:
        rows.append((True, False, 5))
    return rows + [(False, bool(draw.integers(2)), int(draw.integers(top))) for _ in range(pause)]


def most(count: int) -> int:
    """Return a count as the counter of the elaboration shows it."""
    return min(count, (1 << parameters()["CountWidth"]) - 1)


@cocotb.test()
async def lines_come_whole_at_every_ratio(dut) -> None:
    """With and without gaps, of a pixel and more, and a clock of blanking between them."""
    draw = generator(1)
    bench = Bench(dut)
    for clock, pixel_clock, phase in CLOCKS:
        await bench.start(clock, pixel_clock, phase)
        # What is faster than it can be read has to fit as a whole.
        faster = pixel_clock < clock
        most_pixels = parameters()["Depth"] - 2 if faster else 100
        samples: Samples = []
        for _ in range(12):
            length = int(draw.choice([1, 2, 3, draw.integers(1, most_pixels + 1)]))
            pause = 3 * most_pixels + 20 if faster else int(draw.integers(1, 5))
            samples += line(draw, length, gaps=float(draw.choice([0, 0.4])), pause=pause)
        await bench.send(samples)
        await bench.settle()
        where = f"periods {clock}, {pixel_clock}, phase {phase}"
        assert bench.got == words(samples), where
        assert bench.overflows() == 0, where


@cocotb.test()
async def a_line_without_gaps_fits(dut) -> None:
    """At the clocks of the elaboration, whatever their phase, with a pause to read what waits."""
    draw = generator(8)
    bench = Bench(dut)
    clock, pixel_clock = (46, 46) if "PixelHz" in parameters() else (48, 46)
    for phase in range(0, 46, rounds(11, 3)):
        await bench.start(clock, pixel_clock, phase)
        samples: Samples = []
        for _ in range(2):
            length = parameters().get("LineLength", 500)
            samples += line(draw, length, pause=length // 20 + 10)
        await bench.send(samples)
        await bench.settle()
        assert bench.overflows() == 0, f"phase {phase}"
        assert bench.got == words(samples), f"phase {phase}"


@cocotb.test()
async def a_line_without_a_pixel_is_not_sent(dut) -> None:
    """Its line_valid alone, and pixels in the blanking."""
    bench = Bench(dut)
    await bench.start(8, 10, 0)
    empty = [(True, False, 3)] * 5 + [(False, True, 4)] * 5
    samples = [*empty, (True, True, 7), (True, False, 8), (False, True, 9), *empty]
    await bench.send([*samples, (False, False, 0)])
    await bench.settle()
    assert bench.got == [Word(True, True, 7)] == words(samples)


@cocotb.test()
async def the_latency_is_a_pixel_clock_and_four_edges(dut) -> None:
    """From the pixel that follows, or the fall of the line, whatever the phase of the clocks."""
    bench = Bench(dut)
    for clock, pixel_clock, phase in CLOCKS:
        await bench.start(clock, pixel_clock, phase)
        for follows in (True, False):
            await bench.settle()
            await bench.send([(True, True, 77)])
            await RisingEdge(dut.pixel_clk_i)
            bench.times.clear()
            await bench.send([(follows, True, 78)])
            await RisingEdge(dut.pixel_clk_i)
            sampled = get_sim_time("ns")
            await bench.send([(False, False, 0)])
            await bench.settle()
            took = bench.times[0] - sampled - pixel_clock
            assert 3 * clock <= took <= 4 * clock, f"{took} ns, {clock}, {pixel_clock}, {phase}"


@cocotb.test()
async def an_overflow_takes_the_rest_of_its_line(dut) -> None:
    """A pixel clock three times as fast: long lines are cut off, and each is counted, once."""
    draw = generator(2)
    bench = Bench(dut)
    depth = parameters()["Depth"]
    for pause in (400, 3 * depth, 40, 2):
        await bench.start(12, 4, 1)
        samples: Samples = [(False, False, 0)]
        for length in [5, depth // 2, 3 * depth, 5 * depth, 3, depth, 2 * depth] * 2:
            samples += line(draw, length, pause=pause)
        await bench.send(samples)
        await bench.settle()
        sent = words(samples)
        missing = lost(sent, bench.got)
        print(f"pause {pause}: {missing} of 14 lines lost, {len(split(bench.got))} starts")
        assert bench.overflows() == most(missing)
        assert missing >= 6
        # Long lines have their start, even where they had no room for their first pixel.
        assert len(split(bench.got)) >= 8
        if pause == 400:
            assert missing == 6 and len(split(bench.got)) == 14
            cut = [some for some in split(bench.got) if not some[-1].end]
            assert len(cut) == 6 and all(len(some) >= depth for some in cut)
        # What comes after is not touched by it.
        bench.got.clear()
        after = line(draw, min(depth - 2, 20), pause=99)
        await bench.send(after)
        await bench.settle()
        assert bench.got == words(after)


@cocotb.test()
async def a_start_without_room_for_its_pixel_comes_alone(dut) -> None:
    """A long line fills the FIFO; the next one begins at once, and lasts until there is room."""
    draw = generator(3)
    bench = Bench(dut)
    depth = parameters()["Depth"]
    bare = 0
    for length in range(depth - 2, depth + depth // 4 + 4):
        await bench.start(20, 2, 1)
        samples = line(draw, length, pause=1) + line(draw, 60, pause=900)
        samples += line(draw, 3, pause=10)
        await bench.send(samples)
        await bench.settle()
        assert bench.overflows() == lost(words(samples), bench.got) >= 1
        starts = split(bench.got)
        assert len(starts) == 3 and starts[2] == split(words(samples))[2]
        bare += starts[1][0].pixel is None
    assert bare >= 1


@cocotb.test()
async def every_reset_in_mid_line(dut) -> None:
    """Of either side, at any moment, for a clock and longer: the rest of the line does not come,
    what had not been read neither, and the next line is whole."""
    draw = generator(4)
    bench = Bench(dut)
    cut = 0
    for clock, pixel_clock, phase in ((8, 10, 0), (10, 8, 0), (8, 8, 3), (12, 4, 1), (4, 12, 1)):
        await bench.start(clock, pixel_clock, phase)
        for name in ("rst", "pixel_rst"):
            for age in (0, 1, 2, 3, 7, 20):
                for clocks in (1, 9):
                    await bench.settle()
                    bench.got.clear()
                    length = 30
                    before = line(draw, length, pause=0)
                    await bench.send(before[:age])
                    task = cocotb.start_soon(bench.send(before[age:] * 4))
                    await bench.pulse(name, clocks)
                    await task
                    await bench.send([(False, False, 0)] * 2)
                    await bench.settle()
                    where = f"{name} after {age}, {clocks} clocks, at {clock}, {pixel_clock}"
                    given = words([*before * 4, (False, False, 0)])
                    assert bench.got == given[: len(bench.got)], where
                    assert not any(word.end for word in bench.got), where
                    assert len(bench.got) <= age + clocks * max(clock // pixel_clock, 1) + 9, where
                    cut += bool(bench.got)
                    bench.got.clear()
                    after = line(draw, 7)
                    await bench.send(after)
                    await bench.settle()
                    assert bench.got == words(after), where
    assert cut > 20


@cocotb.test()
async def resets_that_follow_each_other(dut) -> None:
    """Of both sides, at every distance: what was sent before the last one does not come after."""
    draw = generator(5)
    bench = Bench(dut)
    for clock, pixel_clock, phase in ((8, 10, 0), (10, 8, 0), (12, 4, 1), (4, 12, 1)):
        await bench.start(clock, pixel_clock, phase)
        for first, second in (("rst", "rst"), ("pixel_rst", "rst"), ("rst", "pixel_rst")):
            for distance in range(1, 20, rounds(3, 1)):
                pixels: Samples = [(True, True, k % 99 + 1) for k in range(200)]
                task = cocotb.start_soon(bench.send([*pixels, *[(False, False, 0)] * 3] * 2))
                await bench.pulse(first, 1)
                await Timer(distance * min(clock, pixel_clock), "ns")
                await bench.pulse(second, 1)
                # rst_i is seen at once; the other one's way takes some clocks.
                await Timer(1 if second == "rst" else 4 * clock + 2 * pixel_clock, "ns")
                bench.got.clear()
                await Timer(3 * clock, "ns")
                early = len(bench.got)
                await task
                await bench.settle()
                assert not early, f"{early} words right after {second}, {distance} clocks"
                # All that comes is the second line, whole: the first one was cut off.
                if pixel_clock >= clock:
                    assert bench.got == words([*pixels, (False, False, 0)]), distance
                bench.got.clear()
                after = line(draw, 5)
                await bench.send(after)
                await bench.settle()
                assert bench.got == words(after)


@cocotb.test()
async def resets_among_short_lines(dut) -> None:
    """The sensor sends on between two flushes: what it sent before the second does not come."""
    bench = Bench(dut)
    for clock, pixel_clock, phase in ((8, 10, 0), (8, 8, 3), (4, 12, 1), (4, 40, 0)):
        await bench.start(clock, pixel_clock, phase)
        edges = 3 * pixel_clock // clock  # that the flush's end takes to come back
        for distance in range(1, 12 + 2 * edges, rounds(3, 1)):
            short: Samples = []
            for k in range(80 + (distance + 12) * clock // pixel_clock):
                pixels = [(True, True, 2 * k % 200), (True, True, (2 * k + 1) % 200)]
                short += [*pixels, (False, False, 0)]
            count = 0

            async def send(short: Samples = short) -> None:
                nonlocal count
                for sample in short:
                    await bench.send([sample])
                    count += 1

            task = cocotb.start_soon(send())
            await Timer(20 * pixel_clock, "ns")
            await bench.pulse("rst", 1)
            await Timer(distance * clock, "ns")
            before = count
            await bench.pulse("rst", 1)
            await Timer(1, "ns")
            bench.got.clear()
            await task
            await bench.settle()
            given = words(short)
            where = f"{distance} clocks, at {clock}, {pixel_clock}"
            assert bench.got and bench.got[0].start, where
            assert bench.got == given[-len(bench.got) :], where
            assert len(bench.got) <= len(words(short[before:])), where


@cocotb.test()
async def resets_and_the_counter(dut) -> None:
    """The sensor's reset keeps it, this side's sets it to zero; it stops at its largest value."""
    draw = generator(6)
    bench = Bench(dut)
    depth = parameters()["Depth"]
    await bench.start(12, 4, 1)
    for _ in range(2):
        for count in range(1, 7):
            await bench.send(line(draw, 3 * depth, pause=20))
            await bench.settle()
            assert bench.overflows() == most(count)
            await bench.reset("pixel_rst", 1)
            assert bench.overflows() == most(count)
        await bench.reset("rst", 1)
        assert bench.overflows() == 0


@cocotb.test()
async def a_reset_waits_for_the_sensors_clock(dut) -> None:
    """Nothing comes out while it stands; afterwards lines are whole, from their start."""
    bench = Bench(dut)
    draw = generator(7)
    await bench.start(8, 10, 0)
    await bench.send(line(draw, 3, pause=0))
    bench.tasks[1].cancel()
    await bench.pulse("rst", 1)
    bench.got.clear()
    await Timer(2000, "ns")
    assert not bench.got
    bench.tasks[1] = cocotb.start_soon(Clock(dut.pixel_clk_i, 10, unit="ns").start())
    await bench.send([(True, True, 1)] * 30 + [(False, False, 0)])
    after = line(draw, 9)
    await bench.send(after)
    await bench.settle()
    assert bench.got == words(after)


@EACH_VOLUME
@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=str)
def test_pixel_fifo_keeps_the_models_order(elaboration: dict[str, int], volume: str) -> None:
    simulate("pixel_fifo", __file__, elaboration, volume=volume)


@pytest.mark.parametrize(
    ("parameters", "holds"),
    [
        ({}, True),
        ({"Depth": 64}, False),  # 86 px of a line wait
        ({"Depth": 100}, False),
        ({"LineLength": 2881, "Depth": 128}, False),
        ({"LineLength": 25500, "PixelHz": 400_000_000, "Depth": 16384}, False),
        ({"LineLength": 25500, "PixelHz": 400_000_000}, True),
        ({"PixelHz": 76_666_667, "Depth": 8}, True),
        ({"ClockHz": 1, "PixelHz": 1, "Depth": 4}, False),
    ],
    ids=str,
)
def test_too_small_a_depth_is_refused(parameters: dict[str, int], holds: bool) -> None:
    file = next(file for file in rtl_modules() if file.stem == "pixel_fifo")
    given = [f"-G{name}={value}" for name, value in parameters.items()]
    done = subprocess.run(
        [verilator_program(), "--lint-only", *given, "-y", file.parents[1], file],
        env=verilator_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode == 0) == holds, done.stderr
    assert ("pixel_fifo: Depth must be" in done.stderr) != holds


@pytest.mark.parametrize(
    ("board", "constraints", "clock", "hz"),
    [
        ("ulx3s", "ulx3s.lpf", r'FREQUENCY PORT "sensor_clk_i" (\S+) MHZ', 1e6),
        ("arty_a7", "arty_a7.xdc", r"-name sensor -period (\S+)", -1e9),
    ],
)
def test_boards_have_a_fifo_for_the_clock_of_their_constraints(
    board: str, constraints: str, clock: str, hz: float
) -> None:
    """A number of MHz is a frequency, one of ns a period."""
    found = re.search(clock, (repository_root() / "constraints" / constraints).read_text())
    assert found
    sensor_hz = hz * float(found[1]) if hz > 0 else -hz / float(found[1])
    wrapper = next(file for file in rtl_boards() if file.stem == board).read_text()
    stated = re.search(r" SensorHz += ([\d_]+)", wrapper)
    assert stated and int(stated[1]) == sensor_hz


# ---- the model alone ----


def a(*pixels: int | None, end: bool = True) -> list[Word]:
    last = len(pixels) - 1
    return [Word(k == 0, end and k == last, pixel) for k, pixel in enumerate(pixels)]


def test_words_are_the_samples_of_a_line() -> None:
    samples = [(False, True, 1), (True, False, 2), (True, True, 3), (True, True, 4)]
    assert words([*samples, (False, True, 5)]) == a(3, 4)
    assert words(samples) == []


def test_what_an_overflow_may_take() -> None:
    sent = a(1, 2, 3) + a(4, 5) + a(6)
    for got, count in (
        (sent, 0),
        (a(1, 2, end=False) + a(4, 5) + a(6), 1),
        (a(4, 5) + a(6), 1),
        (a(1, 2, 3) + a(None, end=False) + a(6), 1),
        (a(1, 2, end=False) + a(4, end=False), 3),
        ([], 3),
    ):
        assert lost(sent, got) == count


def test_what_an_overflow_may_not_do() -> None:
    sent = a(1, 2, 3) + a(4, 5) + a(6)
    for got in (
        a(1, 3),
        a(2, 3),
        a(4, 5) + a(1, 2, 3),
        a(1, 2),
        sent + a(6),
        a(1, 2)[1:],
        a(None, 2, 3),
        [*a(1, 2, 3), Word(False, True, 3)],
        a(1, 2, 3, end=False),
    ):
        with pytest.raises(ValueError, match="pixel_fifo: "):
            lost(sent, got)
