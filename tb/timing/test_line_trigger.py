"""line_trigger: every clock of the RTL against the model, the laser's safety, and the time base."""

import dataclasses
import functools
from fractions import Fraction

import cocotb
import numpy as np
import pytest
from cocotb.triggers import RisingEdge, Timer
from harness import (
    CLOCK_NS,
    FallingEdge,
    TwinBench,
    as_integer,
    generator,
    parameters,
    port,
    simulate,
)

from vrscan.clocked.line_trigger import (
    MIN_LINE_CLKS,
    MOST_IDLE,
    START_LATENCY,
    WRAP_LATENCY,
    LineTrigger,
    line_step,
)
from vrscan.data import pkg
from vrscan.registers.settings import TriggerSettings as Settings

ELABORATIONS = [{"CountWidth": 3}, {"CountWidth": 16}]
OUTPUTS = (
    "line_start",
    "line",
    "exposure",
    "laser",
    "centre",
    "centre_half",
    "overrun",
    "overrun_count",
)
CLOCK_HZ = 125e6
ONE = 1 << pkg.RATIO_FRACTION
TURN = 1 << pkg.TURN_WIDTH
WORD_MAX = (1 << pkg.WORD_WIDTH) - 1
RATIO_MAX = (1 << pkg.RATIO_WIDTH) - 1
CLKS_MAX = (1 << pkg.LINE_CLKS_WIDTH) - 1
WORD = 1 << 39  # with a ratio of one, 512 clocks a line

# A line of 64 clocks.
QUICK = Settings(
    ratio=8 * ONE,
    exposure_delay_clks=2,
    exposure_clks=40,
    pulse_delay_clks=10,
    pulse_clks=7,
)
with_changes = functools.partial(dataclasses.replace, QUICK)


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock.

    Whatever runs through it, the laser is low when it has to be: after a clock with ``enable_i``
    low or a reset, and after ``pulse_clks`` clocks on end.
    """

    def __init__(self, dut) -> None:
        super().__init__(dut, ("enable", "word"))
        self.handles = {name: port(dut, f"{name}_o") for name in OUTPUTS}

    async def start(self, settings: Settings = QUICK, *, word: int = WORD, enable: int = 1) -> None:
        """Set the configuration and reset for a clock, with these inputs."""
        self.inputs = {"enable": -1, "word": -1}
        self.twin = LineTrigger(settings, parameters()["CountWidth"])
        self.settings = settings
        self.change(settings)
        self.give(enable=enable, word=word)
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        self.clock = 0
        self.high = 0
        self.seen: dict[str, list[int]] = {name: [] for name in OUTPUTS}
        self.check()
        assert not self.handles["laser"].value

    def check(self) -> None:
        """Compare all outputs."""
        got = tuple(as_integer(handle) for handle in self.handles.values())
        want = tuple(int(getattr(self.twin, name)) for name in OUTPUTS)
        assert got == want, f"clock {self.clock}, {self.inputs}: {OUTPUTS} {got}, want {want}"
        for name, value in zip(OUTPUTS, got, strict=True):
            self.seen[name].append(value)

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks with these inputs."""
        self.give(**inputs)
        for _ in range(count):
            most = self.settings.pulse_clks
            await FallingEdge(self.dut.clk_i)
            self.twin.step(**self.inputs)
            self.clock += 1
            self.check()
            laser = self.seen["laser"][-1]
            if self.seen["line_start"][-1]:
                self.settings = self.twin.settings
                most = max(most, self.settings.pulse_clks)
            self.high = self.high + 1 if laser else 0
            assert self.high <= most, f"clock {self.clock}: the laser is on for too long"
            assert not laser or self.inputs["enable"], f"clock {self.clock}: the laser is on"

    def at(self, name: str) -> list[int]:
        """Return the clocks in which an output of one bit was high."""
        return np.flatnonzero(self.seen[name]).tolist()


def random_settings(draw: np.random.Generator, line_clks: int) -> Settings:
    """Return delays and lengths about a line's length, zero and one often among them."""

    def clks() -> int:
        near = int(draw.integers(line_clks * 3 // 4 + 1))
        return int(draw.choice([0, 1, near, near, near, near, line_clks, CLKS_MAX], p=P))

    return Settings(
        ratio=int(draw.integers(ONE // 2, 2 * ONE)),
        exposure_delay_clks=clks(),
        exposure_clks=clks(),
        pulse_delay_clks=clks(),
        pulse_clks=clks(),
    )


P = [0.2, 0.1, 0.16, 0.16, 0.16, 0.16, 0.04, 0.02]


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Words, settings, stops and resets at any time: the laser is never on for too long."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    overruns = lines = lasers = 0
    for _ in range(70):
        line_clks = int(draw.integers(32, 200))
        word = TURN // line_clks
        await bench.start(random_settings(draw, line_clks), word=word % (WORD_MAX + 1))
        base = min(word, WORD_MAX)
        scale = -(-word // base)

        def settings(clks: int = line_clks, scale: int = scale) -> Settings:
            found = random_settings(draw, clks)
            return dataclasses.replace(found, ratio=min(found.ratio * scale, RATIO_MAX))

        bench.change(settings())
        for _ in range(int(draw.integers(3, 30))):
            inputs = {"enable": int(draw.random() < 0.93)}
            if draw.random() < 0.3:
                share = draw.choice([0, 1, 0.5 + draw.random()], p=[0.05, 0.15, 0.8])
                inputs["word"] = min(int(base * share), WORD_MAX)
            if draw.random() < 0.2:
                bench.change(settings())
            long = bench.inputs["enable"] or inputs["enable"]
            await bench.clocks(int(draw.integers(1, 120 if long else 30)), **inputs)
        overruns += len(bench.at("overrun"))
        lines += len(bench.at("line_start"))
        lasers += len(bench.at("laser"))
    assert overruns > 30 and lines > 150 and lasers > 500


@cocotb.test()
async def the_first_line_comes_at_once(dut) -> None:
    """A fixed time after enable_i, again after a stop of any length; numbers go on."""
    bench = await Bench.fresh(dut)
    await bench.start(enable=0)
    await bench.clocks(5)
    number = 0
    for pause in (1, 2, *range(3, 40, 4), 100):
        began = bench.clock
        await bench.clocks(130, enable=1)
        starts = [clock - began for clock in bench.at("line_start") if clock > began]
        assert starts == [START_LATENCY, START_LATENCY + 64]
        assert bench.twin.line == number + 1
        number += 2
        await bench.clocks(pause, enable=0)


@cocotb.test()
async def stopped_at_every_moment(dut) -> None:
    """Laser, exposure and strobes are low in the next clock, and the next start is as any."""
    bench = await Bench.fresh(dut)
    for age in range(1, START_LATENCY + 70):
        await bench.start(with_changes(pulse_delay_clks=0, exposure_delay_clks=0))
        await bench.clocks(age)
        await bench.clocks(1, enable=0)
        for name in ("laser", "exposure", "line_start", "centre", "overrun"):
            assert not bench.seen[name][-1]
        lines = len(bench.at("line_start"))
        await bench.clocks(age % 5)
        began = bench.clock
        await bench.clocks(START_LATENCY + 1, enable=1)
        assert bench.at("line_start")[-1] - began == START_LATENCY
        assert bench.twin.line == lines and len(bench.at("line_start")) == lines + 1


@cocotb.test()
async def reset_at_every_moment(dut) -> None:
    """Nothing of what was is left, and the first line after it is number 0."""
    bench = await Bench.fresh(dut)
    overrun = with_changes(pulse_delay_clks=0, pulse_clks=65, exposure_delay_clks=0)
    for age in range(1, START_LATENCY + 140, 3):
        await bench.start(overrun)
        await bench.clocks(age)
        await bench.start(overrun)
        assert not any(values[0] for values in bench.seen.values())
        await bench.clocks(START_LATENCY + 5)
        assert bench.at("line_start") == [START_LATENCY]
        assert bench.twin.line == 0


@cocotb.test()
async def delays_are_exact(dut) -> None:
    """Exposure, pulse and centre begin and end by their clocks; the centre is floored."""
    bench = await Bench.fresh(dut)
    for delay in (0, 1, 2, 20):
        for length in (0, 1, 2, 3, 4, 15, 16):
            other = {"exposure_delay_clks": 20 - delay, "exposure_clks": 16 - length}
            pulse = {"pulse_delay_clks": delay, "pulse_clks": length}
            await bench.start(with_changes(**pulse, **other))
            await bench.clocks(START_LATENCY + 64)
            for name, first, count in (
                ("laser", delay, length),
                ("exposure", 20 - delay, 16 - length),
            ):
                wanted = [START_LATENCY + first + k for k in range(count)]
                assert [clock for clock in bench.at(name) if clock < START_LATENCY + 64] == wanted
            assert bench.at("centre")[0] == START_LATENCY + delay + length // 2
            assert bench.seen["centre_half"][bench.at("centre")[0]] == length % 2
            assert not bench.at("overrun")


@cocotb.test()
async def a_line_that_is_too_short_is_an_overrun(dut) -> None:
    """The last that fits ends a clock before the next start; one more is cut off and counted.

    A pulse, or an exposure, that would join the one that was cut off is left out; after a delay
    it comes. A centre that does not come counts too, also without a pulse.
    """
    bench = await Bench.fresh(dut)
    nothing = {"exposure_delay_clks": 0, "exposure_clks": 0, "pulse_delay_clks": 0, "pulse_clks": 0}
    top = (1 << parameters()["CountWidth"]) - 1
    for kind, output in (("pulse", "laser"), ("exposure", "exposure")):
        for delay in (0, 1, 5, 62, 63):
            for slack in (-1, 0, 1, 100):
                length = max(63 - delay + slack, 0)
                given = {f"{kind}_delay_clks": delay, f"{kind}_clks": length}
                await bench.start(with_changes(**nothing | given))
                lines = 6
                await bench.clocks(START_LATENCY + 64 * lines)
                starts = bench.at("line_start")
                assert starts == [START_LATENCY + 64 * k for k in range(lines + 1)]
                late = slack > 0 and length > 0
                assert bench.at("overrun") == (starts[1:] if late else [])
                assert bench.twin.overrun_count == (min(lines, top) if late else 0)
                on = [clock for clock in bench.at(output) if clock < starts[-1]]
                shown = min(length, 64 - delay)
                skips = late and delay == 0
                wanted = [
                    start + delay + k
                    for start in starts[: -1 : 2 if skips else 1]
                    for k in range(shown)
                ]
                assert on == wanted
    for delay in (63, 64):
        await bench.start(with_changes(**nothing | {"pulse_delay_clks": delay}))
        await bench.clocks(START_LATENCY + 64 * 4)
        assert len(bench.at("centre")) == (4 if delay == 63 else 0)
        assert len(bench.at("overrun")) == (0 if delay == 63 else 4)
    for delay in (63, CLKS_MAX):
        # No exposure has no end, wherever it would be.
        await bench.start(with_changes(**nothing | {"exposure_delay_clks": delay}))
        await bench.clocks(START_LATENCY + 64 * 3)
        assert not bench.at("overrun")


@cocotb.test()
async def a_counter_stops_at_its_largest_value(dut) -> None:
    """More overruns than a 3-bit counter holds."""
    bench = await Bench.fresh(dut)
    await bench.start(with_changes(pulse_delay_clks=80, ratio=16 * ONE))
    await bench.clocks(32 * 12)
    assert len(bench.at("overrun")) > 8
    most = (1 << parameters()["CountWidth"]) - 1
    assert bench.seen["overrun_count"][-1] == min(most, len(bench.at("overrun")))


@cocotb.test()
async def settings_count_from_the_next_line(dut) -> None:
    """A pulse that has begun keeps its length; the word of a line's start counts a line later."""
    bench = await Bench.fresh(dut)
    await bench.start()
    await bench.clocks(START_LATENCY + 12)
    assert bench.seen["laser"][-1]
    bench.change(with_changes(pulse_clks=40, pulse_delay_clks=1, ratio=4 * ONE))
    await bench.clocks(64 * 8)
    starts = bench.at("line_start")
    # The ratio of 4 was sampled at the second start, so the third line is the first of 128 clocks.
    assert np.diff(starts).tolist()[:4] == [64, 64, 128, 128]
    on = np.array(bench.at("laser")) - starts[0]
    assert on[:7].tolist() == list(range(10, 17))
    assert on[7:47].tolist() == list(range(65, 105))


@cocotb.test()
async def a_ratio_of_zero_has_no_lines(dut) -> None:
    """Nor has a word of zero; a line starts as soon as there is a rate, and a line without a rate
    after it ends its pulse."""
    bench = await Bench.fresh(dut)
    for zero in ("word", "ratio"):
        await bench.start(with_changes(ratio=0 if zero == "ratio" else 8 * ONE), word=0)
        if zero == "ratio":
            bench.give(word=WORD)
        await bench.clocks(300)
        assert not bench.at("line_start")
        bench.change(QUICK)
        began = bench.clock
        await bench.clocks(200, word=WORD)
        first = bench.at("line_start")[0] - began
        assert first <= 2 * START_LATENCY
        if zero == "word":
            bench.give(word=0)
        else:
            bench.change(with_changes(ratio=0))
        await bench.clocks(400)
        starts = bench.at("line_start")
        last = starts[-1]
        assert bench.clock - last > 200
        assert [clock - last for clock in bench.at("laser") if clock > last] == list(range(10, 17))
        assert not bench.at("overrun")
        bench.change(QUICK)
        await bench.clocks(200, word=WORD)
        assert len(bench.at("line_start")) >= len(starts) + 2
        assert np.diff(bench.at("line_start"))[-1] == 64


@cocotb.test()
async def half_a_step_is_rounded_up(dut) -> None:
    """The least rate there is starts a line; what is rounded down to zero does not."""
    bench = await Bench.fresh(dut)
    for word, ratio, lines in ((1, ONE // 2, 1), (1, ONE // 2 - 1, 0), (ONE // 2, 1, 1)):
        await bench.start(with_changes(ratio=ratio), word=word)
        await bench.clocks(3 * START_LATENCY)
        assert len(bench.at("line_start")) == lines
        assert len(bench.at("laser")) == lines * QUICK.pulse_clks


@cocotb.test()
async def a_line_without_end_has_one_pulse(dut) -> None:
    """Its time stops at the largest value: where it wrapped the laser would be on again."""
    bench = await Bench.fresh(dut)
    await bench.start(with_changes(ratio=ONE), word=1)
    pulses = 0

    async def count() -> None:
        nonlocal pulses
        while True:
            await RisingEdge(dut.laser_o)
            pulses += 1

    task = cocotb.start_soon(count())
    await Timer(CLOCK_NS * ((2 << pkg.LINE_CLKS_WIDTH) + 100), unit="ns")
    task.cancel()
    assert pulses == 1


@cocotb.test()
async def a_huge_ratio_is_limited(dut) -> None:
    """At most a line in 32 clocks, whatever the word; just below the limit it is not limited."""
    bench = await Bench.fresh(dut)
    for word, ratio, length in (
        (WORD_MAX, RATIO_MAX, 32),
        (1 << 39, 16 * ONE, 32),
        (1 << 39, 16 * ONE + 1, 32),
        (1 << 39, 32 * ONE, 32),
        (1 << 39, 16 * ONE - 1, 33),
    ):
        # Long enough for the remainder of the last one to add up to more than its first clock.
        await bench.start(with_changes(ratio=ratio, pulse_delay_clks=1), word=word)
        await bench.clocks(START_LATENCY + 100)
        starts = bench.at("line_start")
        assert starts[1] - starts[0] == length


@cocotb.test()
async def a_ratio_of_150_keeps_its_phases(dut) -> None:
    """Over five periods of the mirror, each of 2**14 clocks: lines start at the same 150 clocks."""
    bench = await Bench.fresh(dut)
    period = 1 << 14
    await bench.start(with_changes(ratio=150 * ONE), word=1 << pkg.TURN_WIDTH - 14)
    await bench.clocks(START_LATENCY + 3 * period)
    starts = np.array(bench.at("line_start")[:450]) - START_LATENCY
    assert np.array_equal(starts[:150] % period, starts[150:300] % period)
    assert np.array_equal(starts[:150] % period, starts[300:] % period)


@pytest.mark.parametrize("widths", ELABORATIONS, ids=str)
def test_line_trigger_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("line_trigger", __file__, widths)


# ---- the model alone ----


def line_starts(word: int, ratio: int, count: int) -> list[int]:
    """Return the clocks of the first ``count`` lines, from the first one's on."""
    twin = LineTrigger(with_changes(ratio=ratio, pulse_clks=0, exposure_clks=0))
    inputs = {"enable": True, "word": word}
    now = 0
    found: list[int] = []
    while len(found) < count:
        jump = twin.idle(**inputs)
        twin.skip(jump, **inputs)
        twin.step(**inputs)
        now += jump + 1
        if twin.line_start:
            found.append(now)
    assert found[0] == START_LATENCY
    return [clock - START_LATENCY for clock in found]


def test_lines_follow_each_other_exactly() -> None:
    """Line k starts in the first clock at which k turns of the accumulator are full."""
    for word, ratio in ((560_000_000, 150 * ONE), (560_123_457, 646_392_359_123)):
        step = line_step(word, ratio)
        starts = line_starts(word, ratio, 2000)
        assert starts == [-(-k * TURN // step) for k in range(2000)]


def test_a_ratio_of_150_stays_at_its_phases_for_ever() -> None:
    """Where the period is whole clocks the phases are the same ones; else within a clock's step."""
    for word in (1 << 30, 1 << 32, 560_699_887):
        starts = np.array(line_starts(word, 150 * ONE, 150 * 60 + 1), object)
        phases = starts * word % TURN
        later = (phases[150:] - phases[:-150]) % TURN
        first = (phases[150::150] - phases[0]) % TURN
        if TURN % word == 0:
            assert not later.any()
        # The start is the first clock behind a phase that stands still.
        assert max(first) < word
    print(f"\n150 lines a period at word {word}: line 0 of 60 periods within {max(first)} steps")


def test_a_ratio_of_150_1_is_tenfold_interlace() -> None:
    """The lines of ten periods lie on 1501 distinct phases, evenly to a clock's step."""
    word = round(249.0 / CLOCK_HZ * TURN)
    starts = np.array(line_starts(word, round(150.1 * ONE), 3002), object)
    phases = np.sort((starts[:1501] * word % TURN).astype(np.int64))
    assert len(set(phases.tolist())) == 1501
    gaps = np.diff(np.append(phases, phases[0] + TURN)) / TURN
    print(
        f"\nratio 150.1: ten periods, 1501 lines, {len(set(phases.tolist()))} phases, "
        f"{1501 * gaps.min():.4f} to {1501 * gaps.max():.4f} of 1/1501 turn apart"
    )
    clock = word / TURN
    assert abs(gaps - 1 / 1501).max() <= clock * 1.001
    # The eleventh period's lines fall upon those of the first.
    again = (starts[1501:] - starts[:1501]) * word % TURN
    assert all(min(value, TURN - value) <= word for value in again.tolist())


def test_the_step_is_rounded_once() -> None:
    """To nearest, half up, against exact fractions; at most a line in 32 clocks."""
    draw = generator(3)
    for _ in range(3000):
        word = int(draw.integers(WORD_MAX + 1)) >> int(draw.integers(40))
        ratio = int(draw.integers(RATIO_MAX + 1)) >> int(draw.integers(44))
        exact = Fraction(word * ratio, ONE)
        want = min((exact + Fraction(1, 2)).__floor__(), TURN // MIN_LINE_CLKS)
        assert line_step(word, ratio) == want
    assert line_step(1, ONE // 2) == 1
    assert line_step(1, ONE // 2 - 1) == 0
    assert WRAP_LATENCY < MIN_LINE_CLKS and START_LATENCY < MIN_LINE_CLKS


def test_skipping_is_stepping() -> None:
    """At random moments of random runs, with random settings: all of the state is the same."""
    draw = generator(5)
    skipped = 0
    for _ in range(40):
        line_clks = int(draw.integers(40, 3000))
        stepped, jumper = (LineTrigger(QUICK, 3) for _ in range(2))
        inputs = {"enable": True, "word": TURN // line_clks // 8}
        for _ in range(300):
            if draw.random() < 0.05:
                settings = random_settings(draw, line_clks)
                ratio = 0 if draw.random() < 0.1 else settings.ratio * 8
                settings = dataclasses.replace(settings, ratio=ratio)
                stepped.settings = jumper.settings = settings
            if draw.random() < 0.05:
                inputs = inputs | {"enable": bool(draw.random() < 0.7)}
            most = jumper.idle(**inputs)
            assert 0 <= most <= MOST_IDLE
            count = min(most, int(draw.integers(400)))
            before = {name: getattr(jumper, name) for name in OUTPUTS}
            jumper.skip(count, **inputs)
            for _ in range(count):
                stepped.step(**inputs)
            assert before == {name: getattr(jumper, name) for name in OUTPUTS}
            if inputs["enable"]:
                assert vars(stepped) == vars(jumper)
            for _ in range(int(draw.integers(1, 4))):
                stepped.step(**inputs)
                jumper.step(**inputs)
            skipped += count
    assert skipped > 50_000
