"""scan_safeguard: every clock of the RTL against the model; what ends the light, by name."""

import math
from collections.abc import Iterator

import cocotb
import pytest
from harness import (
    EACH_VOLUME,
    TwinBench,
    as_integer,
    generator,
    parameters,
    rounds,
    simulate,
)

from vrscan.clocked.scan_safeguard import EDGE_LATENCY, LIGHT_LATENCY, Parameters, ScanSafeguard
from vrscan.data import pkg

OFF, SWEEP, SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
RUN, FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT
SMALL = {
    "IndexOversample": 2,
    "SettleClks": 2,
    "LightClks": 700,
    "PeriodFloorClks": 220,  # more than 3/4 turns of the quickest drive
    "DarkClks": 2000,
    "PauseClks": 1500,
}
ODD = {
    "IndexOversample": 8,
    "SettleClks": 5,
    "LightClks": 650,
    "PeriodFloorClks": 300,
    "OuterFloor": 5_000,
    "DarkClks": 1800,
    "PauseClks": 900,
}
NAMES = {
    "IndexOversample": "index_oversample",
    "SettleClks": "settle_clks",
    "LightClks": "light_clks",
    "PeriodFloorClks": "period_floor_clks",
    "OuterFloor": "outer_floor",
    "DarkClks": "dark_clks",
    "PauseClks": "pause_clks",
}
PERIOD = 400  # clocks of a mirror that is as quick as a drive can be
WORD = (1 << pkg.TURN_WIDTH) // PERIOD
TOP = (1 << pkg.WORD_WIDTH) - 1
SHARE = 0.19  # of a period beyond the mark: the shipped 20.5 degrees with a mark at 17
WINDOW = 24  # clocks that the diode is lit on each side of the mark
QUIET = {"comparator": 0, "gate": 0, "word": WORD, "state": SETTLE, "enable": 1}


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.parameters = Parameters(**{NAMES[k]: v for k, v in parameters().items()})
        self.all = (1 << self.parameters.index_oversample) - 1

    async def start(self, **inputs: int) -> None:
        """Reset for a clock with these inputs."""
        await self.reset_to(ScanSafeguard(self.parameters), **(QUIET | inputs))
        self.check()

    def check(self) -> None:
        """Compare the outputs."""
        got = as_integer(self.dut.scanning_o), as_integer(self.dut.startup_ok_o)
        want = int(self.twin.scanning), int(self.twin.startup_ok)
        assert got == want, f"clock {self.clock}: {got}, want {want}, {self.inputs}"

    async def samples(
        self, pins: Iterator[tuple[bool, bool]], closed: int = 0, **inputs: int
    ) -> list[bool]:
        """Go on with comparator and gate, and return where pulses may come.

        Args:
            pins: What both are, in all samples of a clock.
            closed: Samples, by bit, in which the gate is closed nevertheless.
            inputs: The other inputs.
        """
        seen = []
        for comparator, gate in pins:
            opened = self.all * gate & ~closed
            await self.clocks(comparator=self.all * comparator, gate=opened, **inputs)
            seen.append(bool(as_integer(self.dut.scanning_o)))
        return seen

    async def turns(
        self, count: int, period: int = PERIOD, share: float = SHARE, **inputs: int
    ) -> list[bool]:
        """Go on by some periods, each from an outward edge at its first clock."""
        seen = []
        for _ in range(count):
            seen += await self.samples(turn(period, share), **inputs)
        return seen

    async def into_scan(self) -> None:
        """Reset and go on until pulses may come; the last period is whole."""
        await self.start()
        await self.samples((False, True) for _ in range(WINDOW))
        await self.turns(2, state=RUN)
        assert self.twin.scanning and self.twin.startup_ok


def turn(period: int, share: float) -> Iterator[tuple[bool, bool]]:
    """Return comparator and gate of a period whose beam is beyond the mark for a share of it."""
    beyond = round(share * period)
    for k in range(period):
        near = min(k, period - k, abs(k - beyond)) < WINDOW
        yield k < beyond, near


@cocotb.test()
async def random_mirrors_and_resets(dut) -> None:
    """Mirrors that stall, slip and chatter, a drive and a state that change, and resets."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    seen = set()
    for _ in range(rounds(30, 200)):
        await bench.into_scan()
        bench.give(state=int(draw.choice([SETTLE, RUN])))
        for _ in range(int(draw.integers(4, 14))):
            chance = draw.random(6)
            if chance[0] < 0.3:
                state = int(
                    draw.choice([OFF, SWEEP, SETTLE, RUN, FAULT], p=[0.2, 0.1, 0.4, 0.2, 0.1])
                )
                bench.give(state=state, enable=int(draw.random() < 0.9))
            if chance[1] < 0.2:
                bench.give(word=int(draw.choice([0, WORD // 2, WORD, WORD, WORD, TOP])))
            period = PERIOD if chance[2] < 0.7 else int(draw.integers(60, 900))
            share = SHARE if chance[3] < 0.8 else float(draw.uniform(0.01, 0.6))
            for comparator, gate in turn(period, share):
                noise = draw.random() < (0.02 if chance[4] < 0.1 else 0.0)
                some = int(draw.integers(bench.all + 1)) if noise else bench.all * comparator
                bench.give(comparator=some, gate=bench.all * (gate and chance[5] > 0.03))
                await bench.clocks()
                seen.add((bench.twin.scanning, bench.twin.startup_ok, bench.inputs["state"]))
    wanted = {(True, True, RUN), (True, True, SETTLE), (False, True, SETTLE)}
    wanted |= {(False, False, SETTLE), (False, False, RUN), (False, False, OFF)}
    assert wanted <= seen, wanted - seen


@cocotb.test()
async def a_mirror_that_stops_is_dark_in_time(dut) -> None:
    """3/2 turns of the drive as it was or becomes, but never later than LightClks from the edge."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    delay = limits.settle_clks + EDGE_LATENCY
    for word in (WORD, WORD * 3 // 4, 0, TOP):
        for beyond in (False, True):
            await bench.into_scan()
            await bench.samples(iter([(True, True)] * 9))  # the last edge
            bench.give(word=word)
            on = 9 + sum(await bench.samples((beyond, False) for _ in range(3000)))
            turned = math.ceil(1.5 * (1 << pkg.TURN_WIDTH) / word) + delay if word else 10**9
            want = min(limits.light_clks - LIGHT_LATENCY, turned)
            # What is dropped of the word makes the turns a little later.
            assert want < on + 1 <= want + 2, (word, on, want)
            assert on < limits.light_clks - 1


@cocotb.test()
async def an_impossible_index_permits_nothing(dut) -> None:
    """Too quick, too slow or too small a mirror, one that only shivers, or half of the edges."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    floor = limits.outer_floor / 65_536
    good = [(PERIOD, SHARE), (PERIOD * 4 // 5, SHARE), (PERIOD * 7 // 5, SHARE)]
    good += [(PERIOD, floor + 0.01), (PERIOD, 0.48)]
    bad = [(PERIOD * 7 // 10, SHARE), (PERIOD * 8 // 5, SHARE), (PERIOD // 2, SHARE)]
    bad += [(PERIOD, floor - 0.01), (PERIOD, 0.53), (2 * PERIOD, SHARE)]
    for period, share in (*good, *bad):
        await bench.into_scan()
        lit = await bench.turns(6, period, share)
        assert any(lit[2 * period :]) == all(lit[2 * period :]) == ((period, share) in good)
        lit = await bench.turns(3)
        assert all(lit[2 * PERIOD + 9 :])
    # A drive that is told to be as quick as the index lifts no floor of the time.
    for period in (limits.period_floor_clks - 1, limits.period_floor_clks):
        await bench.start(word=TOP)
        assert any(await bench.turns(4, period, 0.4)) == (period == limits.period_floor_clks)
    # The floor of the amplitude, where this drive needs 32 clocks for it.
    word = limits.outer_floor << pkg.TURN_WIDTH - 16 - 5
    period = (1 << pkg.TURN_WIDTH) // word
    for beyond in (32, 33):
        await bench.start(word=word)
        assert any(await bench.turns(4, period, beyond / period)) == (beyond > 32)
    # Outward edges alone: the way back is dark.
    await bench.into_scan()
    lit = []
    for _ in range(4):
        lit += await bench.samples((k < 200, k < 20 or k > 380) for k in range(PERIOD))
    assert not any(lit[PERIOD + limits.settle_clks + 4 :])


@cocotb.test()
async def an_edge_out_of_place_ends_the_light(dut) -> None:
    """At once, for a whole good period; a pulse below SettleClks or behind the gate is none."""
    bench = await Bench.fresh(dut)
    settle = bench.parameters.settle_clks
    for clks, closed in ((1, 0), (settle - 1, 0), (settle, 0), (8, 0), (8, 1)):
        await bench.into_scan()
        pins = list(turn(PERIOD, SHARE))
        for k in range(200, 220):
            pins[k] = (206 <= k < 206 + clks, True)
        lit = await bench.samples(iter(pins[:206]))
        lit += await bench.samples(iter(pins[206:214]), closed)
        lit += await bench.samples(iter(pins[214:]))
        seen = clks >= settle and not closed
        assert all(lit[: 206 + settle + 2])
        assert any(lit[206 + settle + 2 :]) == all(lit[206 + settle + 2 :]) != seen
        lit = await bench.turns(3)
        assert any(lit[: PERIOD - 5]) != seen
        assert all(lit[2 * PERIOD + 9 :])


@cocotb.test()
async def the_start_up_light_is_short_and_rare(dut) -> None:
    """DarkClks without a good period, then PauseClks of dark, and it begins in SETTLE alone."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    for state in (OFF, SWEEP, RUN, FAULT):
        await bench.start(state=state)
        await bench.clocks(3)
        assert not bench.twin.startup_ok
    await bench.start(enable=0)
    await bench.clocks(3)
    assert not bench.twin.startup_ok
    bench.give(enable=1)
    on = []
    for k in range(8000):
        bench.give(comparator=bench.all * (k // 7 % 2), gate=bench.all)  # a beam at rest, and noise
        await bench.clocks(
            state=OFF if limits.dark_clks <= k - 50 < limits.dark_clks + 50 else SETTLE
        )
        on.append(int(bench.twin.startup_ok))
    changes = [k for k in range(1, 8000) if on[k] != on[k - 1]]
    assert on[0] and changes[0] == limits.dark_clks - 1
    assert changes[1] - changes[0] == limits.pause_clks + 1
    assert changes[2] - changes[1] == limits.dark_clks - 1
    # With good periods it goes on, and in RUN it does not come back.
    await bench.into_scan()
    await bench.turns(2 * limits.dark_clks // PERIOD)
    assert bench.twin.startup_ok
    edge = limits.settle_clks + EDGE_LATENCY
    await bench.samples(iter([(True, True)] * edge))
    await bench.clocks(limits.dark_clks - LIGHT_LATENCY - edge)
    assert bench.twin.startup_ok
    await bench.clocks(1)
    assert not bench.twin.startup_ok
    await bench.turns(2 * limits.pause_clks // PERIOD)
    assert not bench.twin.startup_ok
    await bench.clocks(2, state=SETTLE)
    assert bench.twin.startup_ok
    # Who leaves SETTLE within the light has to wait as long.
    await bench.clocks(1, state=OFF)
    await bench.clocks(limits.pause_clks - 1, state=SETTLE)
    assert not bench.twin.startup_ok
    await bench.clocks(2)
    assert bench.twin.startup_ok


@EACH_VOLUME
@pytest.mark.parametrize("elaboration", [SMALL, ODD], ids=["small", "odd"])
def test_rtl(elaboration: dict[str, int], volume: str) -> None:
    """Every elaboration runs every test above."""
    simulate("scan_safeguard", __file__, elaboration, volume=volume)
