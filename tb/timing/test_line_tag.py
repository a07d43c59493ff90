"""line_tag: every clock of the RTL against the model, and lines of a whole scanner by name."""

from dataclasses import astuple, replace

import cocotb
import numpy as np
import pytest
from harness import TwinBench, as_integer, generator, parameters, port, simulate

from vrscan.clocked.line_tag import ANGLE_LATENCY, LATENCY, LineTag, Tag
from vrscan.data import pkg
from vrscan.registers.settings import ReadoutSettings as Settings

ELABORATIONS = [{"Depth": 8, "CountWidth": 16}, {"Depth": 16, "CountWidth": 3}]
OUTPUTS = (
    *("angle", "power", "mirror_flags", "confidence", "inward", "time_clks", "superseded", "lens"),
)
QUIET = {
    "enable": 1,
    "exposure": 0,
    "line": 0,
    "centre": 0,
    "power": 0,
    "inward": 0,
    "angle_valid": 0,
    "angle_line": 0,
    "angle": 0,
    "mirror_flags": 0,
    "confidence": 0,
    "line_start": 0,
    "line_end": 0,
    "superseding": 0,
    "lens": 0,
}
UNTAGGED = Tag()
GOOD = 0  # mirror_flags of a line that can be trusted
ANY = Settings(0, 0, 0, (1 << 24) - 1)  # the last exposure that ended, however long ago


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("centre", "angle_valid", "line_start", "line_end", "superseding")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.handles = [(port(dut, f"{name}_o"), name == "angle") for name in OUTPUTS]
        self.draw = generator(9)
        self.sent: dict[int, Tag] = {}  # what belongs to each line
        self.centred = False  # the line that is exposed has had its centre
        self.at_end: list[Tag] = []

    async def start(self, settings: Settings = ANY, **inputs: int) -> None:
        """Set the configuration, and reset for a clock with these inputs."""
        given = parameters()
        twin = LineTag(settings, given["Depth"], given["CountWidth"])
        self.twin = twin
        self.change(settings)
        await self.reset_to(twin, **(QUIET | inputs))
        self.give(**dict.fromkeys(self.strobes, 0))
        self.sent.clear()
        self.at_end.clear()
        self.check()

    def count(self, count: int) -> int:
        """Return what a counter shows of so many events."""
        return min(count, (1 << parameters()["CountWidth"]) - 1)

    def check(self) -> None:
        """Compare all outputs."""
        got = tuple(as_integer(handle, signed=signed) for handle, signed in self.handles)
        want = astuple(self.twin.tag)
        where = f"clock {self.clock}, {self.inputs}"
        assert got == want, f"{where}: {OUTPUTS} {got}, want {want}"
        for name in ("untagged_count", "unread_count", "mistimed_count"):
            count = int(getattr(self.dut, f"{name}_o").value)
            assert count == getattr(self.twin, name), f"{where}: {name} {count}"

    def centre(self, line: int) -> dict[str, int]:
        """Return the inputs of a line's centre."""
        power, lens = (int(self.draw.integers(1, 1 << 16)) for _ in range(2))
        inward = line % 2
        tag = Tag(
            angle=int(self.draw.integers(-(1 << 23), 1 << 23)),
            power=power,
            mirror_flags=GOOD,
            confidence=int(self.draw.integers(1, 256)),
            inward=inward,
            time_clks=self.clock,
            lens=lens,
        )
        self.sent[line] = tag
        return {"centre": 1, "line": line, "power": power, "inward": inward, "lens": lens}

    def angle(self, line: int) -> dict[str, int]:
        """Return the inputs of a line's angle."""
        tag = self.sent[line]
        return {
            "angle_valid": 1,
            "angle_line": line,
            "angle": tag.angle,
            "mirror_flags": tag.mirror_flags,
            "confidence": tag.confidence,
        }

    def noise(self) -> None:
        """Put other values on the ports that matter with a strobe only."""
        names = ["inward", "lens", "angle_line", "angle", "mirror_flags", "confidence"]
        if not self.centred:  # the power of a line holds from its centre to its exposure's end
            names.append("power")
        self.give(**{name: int(self.draw.integers(1 << 3)) for name in names})

    async def play(self, events: dict[int, list[tuple[str, int]]], clocks: int) -> None:
        """Run for some clocks; at some of them things happen.

        ``expose`` and ``dark`` turn the exposure of a line on and off, ``centre`` and ``angle``
        are strobes, and so are ``start`` and ``end`` of a readout.
        """
        for clock in range(clocks):
            self.noise()
            inputs: dict[str, int] = {}
            for what, line in events.get(clock, ()):
                self.centred = what == "centre" or (self.centred and what != "dark")
                if what in ("expose", "dark"):
                    inputs |= {"exposure": int(what == "expose")}
                    inputs |= {"line": line} if what == "expose" else {}
                elif what == "centre":
                    inputs |= self.centre(line)
                elif what == "angle":
                    inputs |= self.angle(line)
                elif what == "change":
                    inputs["superseding"] = 1
                else:
                    inputs[f"line_{what}"] = 1
                    if what == "end":
                        self.at_end.append(self.twin.tag)
            await self.clocks(1, **inputs)

    async def line(self, number: int, *, angle: bool = True) -> None:
        """Take a line up to its exposure's end."""
        await self.clocks(2, exposure=1, line=number)
        await self.clocks(2, **self.centre(number))
        await self.clocks(2, exposure=0)
        if angle:
            await self.clocks(1, **self.angle(number))

    async def readout(self, clocks: int = 20) -> Tag:
        """Read a line out, and return its tag at its end."""
        await self.clocks(clocks - 1, line_start=1)
        tag = self.twin.tag
        await self.clocks(1, line_end=1)
        assert self.twin.tag == tag
        return tag


def scanner(
    count: int,
    period: int,
    *,
    delay: int,
    length: int,
    angle: int,
    exposure: int = 12,
    first: int = 0,
) -> dict[int, list[tuple[str, int]]]:
    """Return the events of a scanner.

    Args:
        count: Lines.
        period: Clocks from line to line.
        delay: From the end of an exposure to the first pixel.
        length: From the first pixel to the last one.
        angle: From the pulse's centre to its angle.
        exposure: How long it lasts.
        first: Number of the first line.
    """
    events: dict[int, list[tuple[str, int]]] = {}
    for k in range(count):
        begin, line = k * period, first + k
        for clock, what in (
            (begin, "expose"),
            (begin + exposure // 2, "centre"),
            (begin + exposure, "dark"),
            (begin + exposure // 2 + angle, "angle"),
            (begin + exposure + delay, "start"),
            (begin + exposure + delay + length, "end"),
        ):
            events.setdefault(clock, []).append((what, line))
    return events


@cocotb.test()
async def an_angle_of_the_old_configuration_is_superseded(dut) -> None:
    """Whenever the change comes and however long it lasts: those centred before its end."""
    bench = await Bench.started(dut)
    seen = set()
    for change in range(0, 60, 3):
        for lasts in (1, 7, 30):
            await bench.start(Settings(1, 1, 0, (1 << 24) - 1))
            events = scanner(6, 40, delay=5, length=30, angle=9)
            for clock in range(change + 60, change + 60 + lasts):
                events.setdefault(clock, []).append(("change", 0))
            await bench.play(events, 300)
            for k, tag in enumerate(bench.at_end[1:]):  # the first readout is of no exposure
                before = k * 40 + 6 < change + 60 + lasts
                read = (k + 1) * 40 + 12 + 5  # its readout begins
                if read > change + 60 + 3:
                    assert tag.superseded == before, (change, lasts, k)
                seen.add((tag.superseded, before))
    assert {(1, True), (0, False)} <= seen


@cocotb.test()
async def every_line_has_its_own_angle(dut) -> None:
    """Readouts that begin with the exposure's end and later, and angles before and during them."""
    bench = await Bench.started(dut)
    for period, delay, length, angle in (
        (60, 0, 40, 5),  # the readout begins in the first dark clock
        (60, 0, 40, 40),  # the angle comes while it is read out
        (60, 0, 40, 46 - ANGLE_LATENCY),  # at the last moment
        (60, 1, 59, 30),  # lines without a gap
        (60, 30, 58, 50),  # the readout ends behind the next exposure
        (60, 47, 12, 58),  # the readout begins before the next exposure's end
        (300, 160, 40, 198),  # short readouts
    ):
        for first in (0, (1 << 32) - 7):
            await bench.start()
            events = scanner(14, period, delay=delay, length=length, angle=angle, first=first)
            events = {
                clock: [(what, line % (1 << 32)) for what, line in some]
                for clock, some in events.items()
            }
            await bench.play(events, 15 * period + delay + length)
            lines = [(first + k) % (1 << 32) for k in range(14)]
            assert bench.at_end == [bench.sent[line] for line in lines]
            assert bench.twin.untagged_count == bench.twin.mistimed_count == 0


@cocotb.test()
async def an_angle_that_is_late_is_not_there(dut) -> None:
    """A clock later than the last moment: the line is untagged, and the one before is not used."""
    bench = await Bench.started(dut)
    await bench.start()
    await bench.play(scanner(9, 60, delay=0, length=40, angle=47 - ANGLE_LATENCY), 9 * 60 + 60)
    assert bench.at_end == [UNTAGGED] * 9
    assert bench.twin.untagged_count == bench.count(9)


@cocotb.test()
async def a_readout_longer_than_a_period_keeps_its_line(dut) -> None:
    """Exposures go on, and overwrite its place in the table; the lines between are not read."""
    bench = await Bench.started(dut)
    for late in (False, True):
        await bench.start()
        await bench.line(0, angle=not late)
        await bench.clocks(10, line_start=1)
        if late:
            assert bench.twin.tag == UNTAGGED
            await bench.clocks(10, **bench.angle(0))
        assert bench.twin.tag == bench.sent[0]
        for number in range(1, 11):
            await bench.line(number)
            assert bench.twin.tag == bench.sent[0]
        await bench.clocks(line_end=1)
        assert await bench.readout() == bench.sent[10]
        assert bench.twin.untagged_count == 0
        assert bench.twin.unread_count == bench.count(9)


@cocotb.test()
async def an_angle_behind_the_tables_depth_is_lost(dut) -> None:
    """Its place has gone to a later line before it came, or before its readout began."""
    bench = await Bench.started(dut)
    depth = parameters()["Depth"]
    await bench.line(0, angle=False)
    await bench.clocks(10, line_start=1)
    for number in range(1, depth + 1):
        await bench.line(number)
    await bench.clocks(10, **bench.angle(0))
    assert bench.twin.tag == UNTAGGED
    await bench.clocks(line_end=1)
    # The late angle has taken the place of the last line's own.
    assert await bench.readout() == UNTAGGED
    await bench.line(depth + 1)
    assert await bench.readout() == bench.sent[depth + 1]
    assert bench.twin.untagged_count == 2


@cocotb.test()
async def readouts_without_an_exposure_are_untagged(dut) -> None:
    """Before the first, twice after one, and while the next exposure is on."""
    bench = await Bench.started(dut)
    assert await bench.readout() == UNTAGGED
    await bench.line(7)
    assert await bench.readout() == bench.sent[7]
    assert await bench.readout() == UNTAGGED
    await bench.clocks(5, exposure=1, line=8)
    await bench.clocks(5, **bench.centre(8))
    await bench.clocks(5, **bench.angle(8))
    assert await bench.readout() == UNTAGGED
    await bench.clocks(exposure=0)
    assert await bench.readout() == bench.sent[8]
    assert bench.twin.untagged_count == 3


@cocotb.test()
async def a_pulse_that_is_cut_has_no_power(dut) -> None:
    """Behind its centre and before its exposure ends; what comes later belongs to another line."""
    bench = await Bench.started(dut)
    for number, (clocks, power) in enumerate(((0, 0), (3, 0), (0, None), (1, None))):
        await bench.clocks(2, exposure=1, line=number)
        await bench.clocks(2, **bench.centre(number))
        sent = bench.sent[number]
        at_end = sent.power if power is None else power
        await bench.clocks(clocks, power=at_end)
        await bench.clocks(1, exposure=0, power=at_end)
        await bench.clocks(2, power=0 if power is None else 77)
        await bench.clocks(1, **bench.angle(number))
        assert await bench.readout() == replace(sent, power=at_end)


@cocotb.test()
async def a_lost_readout_shifts_nothing(dut) -> None:
    """Three exposures, one readout: it is the last one's; and every line after has its own."""
    bench = await Bench.started(dut)
    await bench.line(9)
    assert await bench.readout() == bench.sent[9]
    for number in range(3):
        await bench.line(number)
    assert await bench.readout() == bench.sent[2]
    assert bench.twin.unread_count == 2
    for number in range(3, 9):
        await bench.line(number)
        assert await bench.readout() == bench.sent[number]
    assert bench.twin.untagged_count == bench.twin.mistimed_count == 0


@cocotb.test()
async def a_readout_belongs_to_the_exposure_that_made_its_light(dut) -> None:
    """Readouts late by a part of a line and by several, each with the right lag and all others."""
    bench = await Bench.started(dut)
    period, lines = 60, 14
    stop = (lines - 1) * period + 24  # behind the last exposure
    for late in (0.0, 0.5, 1.0, 1.9, 2.5, 3.0, 3.9):
        delay = round(late * period)
        events = scanner(lines, period, delay=delay, length=40, angle=30)
        for lag in range(4):
            settings = replace(ANY, readout_lag=lag)
            if lag % 2:  # the age, too
                settings = replace(settings, readout_min_clks=delay, readout_max_clks=delay)
            await bench.start(settings)
            await bench.play(events, stop)
            bench.give(enable=0)
            rest = {clock - stop: some for clock, some in events.items() if clock >= stop}
            await bench.play(rest, 5 * period)
            own = lines - lag if lag == int(late) else 0  # the last ones have none behind them
            wanted = [bench.sent[line] for line in range(own)] + [UNTAGGED] * (lines - own)
            assert bench.at_end == wanted
            begun = sum(12 + delay + line * period < stop - 1 for line in range(lines))
            assert bench.twin.mistimed_count == bench.count(0 if own else begun)
            assert bench.twin.untagged_count == bench.count(lines - own)
            assert bench.twin.unread_count == 0


@cocotb.test()
async def a_readout_outside_of_its_window_is_mistimed(dut) -> None:
    """A clock too early or too late: all lines, if it is the first one, or that one alone."""
    bench = await Bench.started(dut)
    for lag, delay in ((0, 7), (2, 127)):
        exact = Settings(lag, 0, delay, delay)
        events = scanner(9, 60, delay=delay, length=40, angle=20)
        for settings in (
            exact,
            replace(exact, readout_min_clks=delay + 1, readout_max_clks=delay + 1),
            replace(exact, readout_min_clks=delay - 1, readout_max_clks=delay - 1),
        ):
            await bench.start(settings)
            await bench.play(events, 12 * 60)
            own = 9 - lag if settings == exact else 0
            wanted = [bench.sent[line] for line in range(own)] + [UNTAGGED] * (9 - own)
            assert bench.at_end == wanted
        for off in (-1, 1):
            moved = {clock: list(some) for clock, some in events.items()}
            start = 4 * 60 + 12 + delay
            moved[start].remove(("start", 4))
            moved.setdefault(start + off, []).append(("start", 4))
            await bench.start(exact)
            await bench.play(moved, 12 * 60)
            wanted = [bench.sent[line] if line != 4 else UNTAGGED for line in range(9 - lag)]
            assert bench.at_end[: 9 - lag] == wanted
            assert bench.twin.mistimed_count == bench.twin.untagged_count == 1 + lag


@cocotb.test()
async def old_lines_behind_the_start_belong_to_nothing(dut) -> None:
    """A sensor whose every readout is started by a later exposure holds the last lines back."""
    bench = await Bench.started(dut)
    for lag in (1, 2, 3):
        for stale in (0, 1):
            await bench.start(Settings(lag, stale, 0, 1000))
            for again in range(3):
                sent = len(bench.at_end)
                await bench.clocks(9, enable=0)
                await bench.clocks(2, enable=1)
                for number in range(9):
                    await bench.line(16 * again + number)
                    await bench.readout()
                    bench.at_end.append(bench.twin.tag)
                own = [bench.sent[16 * again + number] for number in range(9 - lag)]
                wanted = [UNTAGGED] * lag + own if stale else [UNTAGGED] * 9
                assert bench.at_end[sent:] == wanted
            assert bench.twin.mistimed_count == (0 if stale else bench.count(27))


@cocotb.test()
async def what_is_out_of_step_stays_so_until_the_lines_start_anew(dut) -> None:
    """Exposures without a readout at first, and another lag while lines run."""
    bench = await Bench.started(dut)
    for exposures in (2, 9):
        await bench.start()
        for number in range(exposures):
            await bench.line(number)
        assert bench.twin.unread_count == max(0, exposures - 5)
        for again in range(2):
            for number in range(20, 29):
                assert await bench.readout() == (bench.sent[number - 1] if again else UNTAGGED)
                await bench.line(number)
            await bench.clocks(5, enable=again)
            await bench.clocks(2, enable=1)
            await bench.line(19)
    await bench.start()
    for number in range(4):
        await bench.line(number)
        assert await bench.readout() == bench.sent[number]
    for lag in (1, 0):
        bench.change(replace(ANY, readout_lag=lag))
        await bench.line(5)
        assert await bench.readout() == UNTAGGED
    await bench.clocks(5, enable=0)
    await bench.line(6)
    assert await bench.readout() == UNTAGGED
    await bench.clocks(1, enable=1)
    await bench.line(7)
    assert await bench.readout() == bench.sent[7]
    # A readout ahead of the first exposure is no sign of a lag.
    await bench.clocks(5, enable=0)
    await bench.clocks(5, enable=1)
    assert await bench.readout() == UNTAGGED
    await bench.line(8)
    assert await bench.readout() == bench.sent[8]


@cocotb.test()
async def a_line_without_centre_or_angle_is_untagged(dut) -> None:
    """Even where the table still has the line that was there before."""
    bench = await Bench.started(dut)
    depth = parameters()["Depth"]
    for number in range(depth):
        await bench.line(number)
        assert await bench.readout() == bench.sent[number]
    await bench.line(depth, angle=False)
    assert await bench.readout() == UNTAGGED
    await bench.clocks(4, exposure=1, line=depth + 1)
    await bench.clocks(4, exposure=0)
    assert await bench.readout() == UNTAGGED
    # Its angle alone is not enough.
    await bench.clocks(4, exposure=1, line=depth + 2)
    bench.centre(depth + 2)
    await bench.clocks(4, exposure=0, **bench.angle(depth + 2))
    assert await bench.readout() == UNTAGGED
    # A number that comes again does not find its old angle.
    await bench.line(depth - 1, angle=False)
    assert await bench.readout() == UNTAGGED
    await bench.line(depth + 3)
    assert await bench.readout() == bench.sent[depth + 3]
    assert bench.twin.untagged_count == 4


@cocotb.test()
async def a_line_of_another_number_in_its_place_is_not_taken(dut) -> None:
    """Every bit of the number counts, in both halves of the table."""
    bench = await Bench.started(dut)
    depth = parameters()["Depth"]
    for bit in range(depth.bit_length() - 1, 32):
        for other in ("centre", "angle"):
            await bench.start()
            line, wrong = 0, 1 << bit
            await bench.clocks(2, exposure=1, line=line)
            bench.sent[line] = bench.sent[wrong] = Tag(angle=5, mirror_flags=GOOD)
            await bench.clocks(2, **bench.centre(wrong if other == "centre" else line))
            await bench.clocks(2, exposure=0)
            await bench.clocks(2, **bench.angle(wrong if other == "angle" else line))
            assert await bench.readout(10) == UNTAGGED


@cocotb.test()
async def the_latency_is_fixed(dut) -> None:
    """From the start of a readout, and from an angle that comes behind it; untagged before."""
    bench = await Bench.started(dut)
    await bench.line(0)
    await bench.clocks(5)
    assert await bench.readout(9) == bench.sent[0]
    for ahead in range(-LATENCY - 2, 12):
        number = ahead + 20
        await bench.start()
        await bench.line(1)
        assert await bench.readout(9) == bench.sent[1]
        await bench.line(number, angle=False)
        events: dict[int, list[tuple[str, int]]] = {12: [("start", 0)]}
        events.setdefault(12 + ahead, []).append(("angle", number))
        there = 12 + max(LATENCY, ahead + ANGLE_LATENCY)
        await bench.play(events, 13)
        for clock in range(13, 40):
            assert bench.twin.tag == (bench.sent[number] if clock >= there else UNTAGGED)
            await bench.play({0: events.get(clock, [])}, 1)


@cocotb.test()
async def a_start_without_an_end_counts_once(dut) -> None:
    """A line that was cut off is not counted; one of a single pixel is untagged."""
    bench = await Bench.started(dut)
    await bench.clocks(9, line_start=1)
    await bench.clocks(9, line_start=1)
    await bench.clocks(9, line_end=1)
    await bench.clocks(9, line_end=1)
    assert bench.twin.untagged_count == 1
    await bench.line(3)
    await bench.clocks(9, line_start=1)
    assert bench.twin.tag == bench.sent[3]
    await bench.line(4)
    await bench.clocks(2, line_start=1, line_end=1)
    await bench.clocks(9, line_end=1)
    assert bench.twin.untagged_count == 2


@cocotb.test()
async def a_counter_stops_at_its_largest_value(dut) -> None:
    bench = await Bench.started(dut)
    for _ in range(12):
        await bench.readout(3)
    assert int(dut.untagged_count_o.value) == min(12, (1 << parameters()["CountWidth"]) - 1)


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """Nothing of before is left, whatever the inputs were in the clock of the reset."""
    bench = await Bench.started(dut)
    number = 40
    for age in range(1, 26):
        events = scanner(3, 9, delay=0, length=8, angle=2, exposure=4, first=number)
        await bench.play(events, age)
        held = {"exposure": age % 2, "line": number, "angle_line": number}
        await bench.start(
            **held, centre=1, angle_valid=1, line_start=1, line_end=1, power=5, angle=5
        )
        # Not even with the exposure's end, which was before the reset.
        await bench.clocks(1, exposure=0)
        bench.give(line=number + 1)
        assert await bench.readout() == UNTAGGED
        await bench.clocks(1, line=number, angle_line=number)
        await bench.line(number, angle=False)
        assert await bench.readout() == UNTAGGED
        assert bench.twin.untagged_count == 2
        # A line that comes although the trigger is not on yet has its tag, too.
        await bench.start(**held, enable=0)
        await bench.line(number + 2)
        assert await bench.readout() == bench.sent[number + 2]
        await bench.start(**held)
        await bench.line(number + 1)
        assert await bench.readout() == bench.sent[number + 1]
        assert bench.sent[number + 1].time_clks < 10


@cocotb.test()
async def random_strobes(dut) -> None:
    """Without any order, with numbers near each other, so that everything meets everything."""
    draw = generator(1)
    bench = await Bench.started(dut)
    number = (1 << 32) - 200
    tagged = untagged = 0
    for busy in (0.5, 0.15, 0.04):
        for k in range(5000):
            number = (number + int(draw.random() < 3 * busy / 10)) % (1 << 32)

            older = (number - int(draw.integers(4) * draw.integers(3) // 2)) % (1 << 32)
            bench.noise()
            await bench.clocks(
                1,
                exposure=bench.inputs["exposure"] ^ int(draw.random() < busy),
                line=older if draw.random() < 0.1 else number,
                centre=int(draw.random() < busy),
                inward=int(draw.integers(2)),
                power=int(draw.integers(1 << 16)),
                lens=int(bench.draw.integers(1 << 16)),
                angle_valid=int(draw.random() < busy),
                angle_line=older if draw.random() < 0.3 else number,
                angle=int(draw.integers(-(1 << 23), 1 << 23)),
                mirror_flags=int(draw.integers(1 << pkg.MIRROR_FLAG_WIDTH)),
                confidence=int(draw.integers(256)),
                line_start=int(draw.random() < busy / 3),
                line_end=int(draw.random() < busy / 3),
                enable=int(draw.random() > busy / 20),
            )
            if draw.random() < busy / 100:
                bench.change(replace(bench.twin.settings, readout_lag=int(draw.integers(4))))
            tagged += bench.twin.tagged
            untagged += not bench.twin.tagged
            if k % 1000 == 999:
                settings = Settings(k // 1000 % 3, k // 1000 % 2, k % 7, (30, 10**6)[k // 3000])
                await bench.start(settings, exposure=int(draw.integers(2)), line=number)
    assert min(tagged, untagged) > 500, (tagged, untagged)


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=str)
def test_line_tag_rtl_equals_model(elaboration: dict[str, int]) -> None:
    simulate("line_tag", __file__, elaboration)


# ---- the model alone ----


def test_no_line_ever_has_another_ones_angle() -> None:
    """Scanners with random faults: a tag is the readout's own line's, or it is UNSETTLED."""
    draw = generator(4)
    good = bad = 0
    for _ in range(300):
        twin = LineTag(ANY, int(draw.choice([8, 16])))
        period = int(draw.integers(30, 90))
        events = scanner(
            30,
            period,
            delay=int(draw.integers(0, period)),
            length=int(draw.integers(8, period)),
            angle=int(draw.integers(3, period)),
        )
        exposed = wanted = None
        power = 0  # of the last centre
        ended: int | None = None
        for clock in range(32 * period):
            inputs = QUIET | {"exposure": int(exposed is not None), "line": exposed or 0}
            inputs["power"] = power
            for what, line in events.get(clock, ()):
                if line > 0 and draw.random() < 0.04:
                    continue  # it does not come
                if what == "expose":
                    exposed = line if exposed is None else exposed
                    inputs |= {"exposure": 1, "line": line}
                elif what == "dark":
                    ended, exposed = (exposed, None) if exposed is not None else (ended, None)
                    inputs["exposure"] = 0
                elif what == "centre":
                    power = line + 1
                    inputs |= {"centre": 1, "line": line, "power": power}
                elif what == "angle":
                    inputs |= {"angle_valid": 1, "angle_line": line, "angle": line + 1}
                else:
                    inputs[f"line_{what}"] = 1
            if inputs["line_end"] and not inputs["line_start"] and wanted is not None:
                if twin.tag != UNTAGGED:
                    assert (twin.tag.angle, twin.tag.power) == (wanted + 1, wanted + 1)
                good += twin.tag != UNTAGGED
                bad += twin.tag == UNTAGGED
            if inputs["line_start"]:
                wanted, ended = ended, None
            twin.step(**inputs)
    print(f"\n{good} lines tagged, {bad} not")
    assert good > 2000 and bad > 200


def test_the_defaults_are_unsettled() -> None:
    assert UNTAGGED.mirror_flags << pkg.FLAG_NOT_RUNNING == 1 << pkg.FLAG_UNSETTLED
    assert np.all([getattr(UNTAGGED, name) == 0 for name in OUTPUTS if name != "mirror_flags"])
