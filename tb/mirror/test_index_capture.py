"""index_capture: every clock of the RTL against the model, and each hard case by its name."""

from collections.abc import Iterator
from operator import attrgetter

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    Ports,
    UnitBench,
    drive_settings,
    each,
    generator,
    parameters,
    rounds,
    simulate,
)

from vrscan.clocked.index_capture import LATENCY, PERIOD_CEILING, IndexCapture
from vrscan.data import pkg
from vrscan.registers.settings import IndexSettings as Settings

ELABORATIONS = [
    {"IndexOversample": 4, "CountWidth": 16, "PeriodCeilingClks": 20_000},
    {"IndexOversample": 1, "CountWidth": 3},
    {"IndexOversample": 8, "CountWidth": 3},
    {"IndexOversample": 2, "CountWidth": 3},
]
STEP = 1 << pkg.SUB_WIDTH
MOST = (1 << pkg.TIME_WIDTH) - 1
STROBES = ("missing", "valid", "doubled", "impossible")
STATUS = ("alive", "missing_count", "doubled_count", "impossible_count", "glitch_count")
WITH_VALID = ("outward", "age")
OUTPUTS_OF = attrgetter(*STROBES, *STATUS)
WITH_VALID_OF = attrgetter(*WITH_VALID)
CALM = Settings(glitch_clks=3, width_min_clks=80, width_max_clks=300, period_max_clks=700)


def twin_of(settings: Settings) -> IndexCapture:
    """Return the twin of the running elaboration."""
    given = parameters()
    ceiling = given.get("PeriodCeilingClks", PERIOD_CEILING)
    names = ("IndexOversample", "CountWidth")
    return IndexCapture(settings, *(given[name] for name in names), ceiling)


def clocks(samples: np.ndarray, oversample: int) -> list[int]:
    """Pack samples [n] of 0 and 1 into one integer a clock, the oldest sample in bit 0."""
    weights = 1 << np.arange(oversample)
    return (np.asarray(samples, np.int64).reshape(-1, oversample) @ weights).tolist()


class Bench(UnitBench):
    """Drives the RTL and its twin with the same samples and compares every output every clock."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.oversample = parameters()["IndexOversample"]
        self.ones = (1 << self.oversample) - 1
        self.events: list[tuple[int, str]] = []
        self.crossings: list[dict[str, int]] = []
        self.outputs = Ports(dut, [f"{name}_o" for name in STROBES + STATUS])
        self.with_valid = Ports(dut, [f"{name}_o" for name in WITH_VALID])

    async def start(self, settings: Settings = CALM, *, busy: bool = False) -> None:
        """Set the configuration and reset for a clock, with ``busy`` while inputs are high."""
        dut = self.dut
        drive_settings(dut, settings)
        dut.rst_i.value = 1
        dut.comparator_i.value = self.ones if busy else 0
        dut.gate_i.value = self.ones if busy else 0
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        self.twin = twin_of(settings)
        self.clock = 0
        self.events = []
        self.crossings = []
        self.driven = (None, None)
        self.check("reset")

    def check(self, where: str) -> None:
        """Compare all that is defined."""
        twin = self.twin
        got, want = self.outputs.read(), OUTPUTS_OF(twin)
        assert got == want, f"clock {self.clock}, {where}: {STROBES + STATUS} {got}, want {want}"
        if twin.valid:
            got, want = self.with_valid.read(), WITH_VALID_OF(twin)
            assert got == want, f"clock {self.clock}, {where}: {WITH_VALID} {got}, want {want}"

    async def clocks(self, comparator: list[int], gate: list[int]) -> None:
        """Drive words, one a clock."""
        dut, twin = self.dut, self.twin
        for word, open_word in zip(comparator, gate, strict=True):
            if (word, open_word) != self.driven:
                dut.comparator_i.value, dut.gate_i.value = word, open_word
                self.driven = (word, open_word)
            await FallingEdge(dut.clk_i)
            twin.step(word, open_word)
            self.clock += 1
            self.check(f"comparator {word:b}, gate {open_word:b}")
            self.events += [(self.clock, name) for name in STROBES if getattr(twin, name)]
            if twin.valid:
                values = {name: int(getattr(twin, name)) for name in WITH_VALID}
                time = self.clock * STEP - twin.age
                self.crossings.append(values | {"clock": self.clock, "time": time})

    async def samples(self, comparator: np.ndarray, gate: np.ndarray | None = None) -> None:
        """Drive samples [n], n a multiple of the oversampling; the gate is open if None."""
        if gate is None:
            gate = np.ones_like(comparator)
        await self.clocks(clocks(comparator, self.oversample), clocks(gate, self.oversample))

    async def hold(self, level: int, count: int, gate: int = 1) -> None:
        """Hold both inputs for ``count`` clocks."""
        await self.clocks([level * self.ones] * count, [gate * self.ones] * count)

    def named(self, name: str) -> list[int]:
        """Return the clocks of one kind of event."""
        return [clock for clock, kind in self.events if kind == name]


def telegraph(draw: np.random.Generator, count: int, lengths: list[tuple[int, int]]) -> np.ndarray:
    """Return ``count`` samples that change level after random runs, each of one of ``lengths``."""
    parts = []
    total = 0
    level = 0
    while total < count:
        low, high = lengths[int(draw.integers(len(lengths)))]
        parts.append(np.full(int(draw.integers(low, high + 1)), level))
        total += len(parts[-1])
        level ^= 1
    return np.concatenate(parts)[:count]


def pulse(
    before: int, high: int, after: int, oversample: int, shift: int = 0, extra: int = 0
) -> np.ndarray:
    """Return a pulse, clocks, its edges moved by ``shift`` and its end by ``extra`` samples."""
    samples = np.zeros((before + high + after) * oversample, np.int64)
    samples[before * oversample + shift : (before + high) * oversample + shift + extra] = 1
    return samples


@cocotb.test()
async def random_samples(dut) -> None:
    """Levels without any order, biased so that every fault and every limit comes about."""
    draw = generator(1)
    bench = await Bench.started(dut)
    total = dict.fromkeys(STROBES, 0)
    glitches = 0
    for settings in (
        Settings(1, 0, 250, 500),
        Settings(2, 70, 130, 400),
        Settings(3, 100, 200, 300),
        Settings(9, 90, 5, 40),
        Settings(4, 70, 3000, 5000),
        Settings(0, 64, 400, 90),
    ):
        await bench.start(settings)
        o = bench.oversample
        count = 10000 * o
        few = [(1, 2), (1, 3 * o), (2 * o, 12 * o), (60 * o, 75 * o), (60 * o, 160 * o)]
        often = settings.period_max_clks > 3000  # the gate closes often, and little is missing
        pauses = [(1, 4), (70 * o, 150 * o)] if often else [(1, 4), (300 * o, 900 * o)]
        gate = telegraph(draw, count, pauses)
        gate[draw.random(count) < 1e-4] = 0
        comparator = telegraph(draw, count, few)
        # Quiet stretches, so that pairs are left alone too.
        calm = telegraph(draw, count, [(90 * o, 190 * o)])
        comparator = np.where(
            telegraph(draw, count, [(900 * o, 1800 * o)]) | often, calm, comparator
        )
        await bench.samples(comparator, gate)
        for name in STROBES:
            total[name] += len(bench.named(name))
        glitches += bench.twin.glitch_count
    assert all(n > 5 for n in [glitches, *total.values()]), (glitches, total)


@cocotb.test()
async def good_pairs_are_reported_and_nothing_else(dut) -> None:
    """Pairs at every position within a clock: times in steps of one sample, ages, alive."""
    bench = await Bench.started(dut)
    o = bench.oversample
    assert not bench.twin.alive
    for k in range(2 * o):
        await bench.samples(pulse(200, 100, 100, o, shift=k))
    assert [kind for _, kind in bench.events] == ["valid"] * 4 * o
    outward = bench.crossings[::2]
    inward = bench.crossings[1::2]
    assert all(c["outward"] for c in outward) and not any(c["outward"] for c in inward)
    for k, (out, back) in enumerate(zip(outward, inward, strict=True)):
        # Half a sample before the first sample of the new level.
        want = (400 * k + 200) * STEP + k * STEP // o - STEP // o // 2
        assert out["time"] == want
        assert back["time"] - out["time"] == 100 * STEP
    # The level settles in glitch_clks whole clocks.
    assert outward[0]["clock"] == 200 + CALM.glitch_clks - 1 + LATENCY
    assert outward[1]["clock"] == 400 + 200 + (o > 1) + CALM.glitch_clks - 1 + LATENCY + (o == 1)
    assert bench.twin.alive and not bench.twin.glitch_count


@cocotb.test()
async def pulses_one_step_apart(dut) -> None:
    """Two pairs whose widths differ by one sample are told apart, each to the step."""
    bench = await Bench.started(dut)
    o = bench.oversample
    for extra in range(-o, o + 1):
        await bench.samples(pulse(150, 120, 130, o, extra=extra))
    widths = [
        b["time"] - a["time"]
        for a, b in zip(bench.crossings[::2], bench.crossings[1::2], strict=True)
    ]
    assert widths == [120 * STEP + extra * STEP // o for extra in range(-o, o + 1)]


@cocotb.test()
async def mark_is_not_reached(dut) -> None:
    """The beam turns back before the mark: gate pulses without a crossing, missing in time."""
    bench = await Bench.started(dut)
    o = bench.oversample
    draw = generator(2)
    for _ in range(3):  # before the first outward ever, nothing is missing
        await bench.samples(draw.integers(0, 2, 500 * o), np.zeros(500 * o, np.int64))
        await bench.hold(0, 300)
    assert bench.events == [] and not bench.twin.alive
    await bench.samples(pulse(50, 100, 100, o))
    assert bench.twin.alive
    seen = bench.named("valid")[0]
    for _ in range(4):
        await bench.samples(draw.integers(0, 2, 400 * o), np.zeros(400 * o, np.int64))
        await bench.hold(0, 300)
    period = CALM.period_max_clks
    assert bench.named("missing") == [seen + 1 + k * period for k in (1, 2, 3, 4)]
    assert not bench.twin.alive
    assert bench.twin.glitch_count == 0


@cocotb.test()
async def mark_is_just_touched(dut) -> None:
    """A pair nearer than MinCrossing is withheld though width_min_clks would allow it."""
    bench = await Bench.started(dut, settings=Settings(2, 0, 300, 700))
    o = bench.oversample
    near = pkg.MIN_CROSSING
    for width in (2, 10, near - 1, near, near + 1):
        await bench.samples(pulse(150, width, 200, o))
    kinds = [kind for _, kind in bench.events]
    assert kinds == ["valid", "impossible"] * 3 + ["valid", "valid"] * 2
    assert bench.twin.alive
    # Three crossings in a row, each near the one before, withheld or not: only the first counts.
    await bench.hold(1, near - 4)
    await bench.hold(0, near - 4)
    await bench.hold(1, near - 4)
    await bench.hold(0, 2 * near)
    assert [kind for _, kind in bench.events][len(kinds) :] == ["valid"] + ["impossible"] * 3
    # An outward near an inward.
    await bench.samples(pulse(200, 100, near - 1, o))
    await bench.samples(pulse(0, 100, 200, o))
    assert [kind for _, kind in bench.events][-4:] == ["valid", "valid", "impossible", "valid"]


@cocotb.test()
async def limits_of_width(dut) -> None:
    """Inwards at, and a clock beyond, both limits; the clock of every flag."""
    bench = await Bench.started(dut)
    o = bench.oversample
    least, most = CALM.width_min_clks, CALM.width_max_clks
    for width, kinds in (
        (least - 1, ["valid", "impossible"]),
        (least, ["valid", "valid"]),
        (most, ["valid", "valid"]),
        (most + 1, ["valid", "missing", "valid"]),
        (most + 5, ["valid", "missing", "valid"]),
    ):
        await bench.start(CALM)
        await bench.samples(pulse(100, width, 100, o))
        assert [kind for _, kind in bench.events] == kinds, width
        assert bench.twin.alive == (kinds == ["valid", "valid"])
        if "missing" in kinds:
            assert bench.named("missing") == [bench.named("valid")[0] + most + 1]
    # A pair, and a period later one whose inward is late: alive goes down.
    await bench.start(CALM)
    await bench.samples(pulse(100, 100, 200, o))
    assert bench.twin.alive
    await bench.samples(pulse(100, most + 2, 200, o))
    assert not bench.twin.alive and len(bench.named("missing")) == 1
    await bench.samples(pulse(100, 100, 10, o))
    assert bench.twin.alive and not bench.named("doubled")


@cocotb.test()
async def limits_of_period(dut) -> None:
    """Outwards at the limit, a clock later and two: missing comes before or with the outward."""
    bench = await Bench.started(dut)
    o = bench.oversample
    period = CALM.period_max_clks
    for late in (0, 1, 2):
        await bench.start(CALM)
        await bench.samples(pulse(100, 100, period + late - 100, o))
        await bench.samples(pulse(0, 100, 50, o))
        first, second = (c["clock"] for c in bench.crossings if c["outward"])
        assert second - first == period + late
        assert bench.named("missing") == ([first + period + 1] if late else [])
        assert bench.twin.alive, "the pair after it is good"
        assert not bench.named("doubled")
    # The inward comes in the clock of the period's deadline: there is no pair any more.
    same = Settings(3, 80, 300, 120)
    for width in (120, 121):
        await bench.start(same)
        await bench.samples(pulse(100, width, same.glitch_clks - 1 + LATENCY, o))
        assert bench.named("valid") == [bench.clock - width, bench.clock]
        assert bench.twin.alive == (width == 120)
        assert bench.named("missing") == ([bench.clock] if width == 121 else [])
    # Both deadlines at once are one fault.
    await bench.start(Settings(3, 80, 200, 200))
    await bench.hold(0, 50)
    await bench.hold(1, 260)
    assert len(bench.named("missing")) == 1 and bench.twin.missing_count == 1


@cocotb.test()
async def limits_zero_and_maximum(dut) -> None:
    """0: the deadline passes at once; the largest value: it never does."""
    bench = await Bench.started(dut)
    o = bench.oversample
    most_count = (1 << parameters()["CountWidth"]) - 1
    await bench.start(Settings(0, 0, MOST, MOST))
    await bench.samples(pulse(1000, 3000, 1000, o))
    assert [kind for _, kind in bench.events] == ["valid", "valid"] and bench.twin.alive
    await bench.start(Settings(255, MOST, MOST, MOST))
    await bench.samples(pulse(1000, 3000, 1000, o))
    assert [kind for _, kind in bench.events] == ["valid", "impossible"]
    assert bench.named("valid") == [1000 + 254 + LATENCY]
    await bench.start(Settings(1, 0, 0, MOST))
    await bench.samples(pulse(100, 100, 100, o))
    seen = bench.named("valid")[0]
    assert bench.events == [(seen, "valid"), (seen + 1, "missing"), (seen + 100, "valid")]
    for period in (0, 1, 2):
        await bench.start(Settings(1, 0, MOST, period))
        await bench.samples(pulse(100, 70, 60, o))
        seen = bench.named("valid")[0]
        late = list(range(seen + period + 1, bench.clock + 1, max(period, 1)))
        assert bench.named("missing") == late
        assert bench.twin.missing_count == min(len(late) - (late[-1] == bench.clock), most_count)
        assert not bench.twin.alive


@cocotb.test()
async def every_kth_pulse_is_dropped(dut) -> None:
    """Outward, inward or the whole pair lost every k-th period: flagged within a period."""
    bench = await Bench.started(dut)
    o = bench.oversample
    period, width = 600, 150
    # An open gate around each of the crossings.
    for k, deadline in ((2, 650), (3, 650), (5, 650), (3, 900)):
        for lost in ("both", "inward", "outward"):
            await bench.start(Settings(2, 100, 200, deadline))
            periods = 3 * k
            for n in range(periods):
                comparator = pulse(100, width, period - 100 - width, o)
                gate = np.zeros_like(comparator)
                drop = n % k == k - 1
                for edge, name in ((100, "outward"), (100 + width, "inward")):
                    if not (drop and lost in ("both", name)):
                        gate[(edge - 40) * o : (edge + 40) * o] = 1
                await bench.samples(comparator, gate)
            await bench.hold(0, 60, gate=0)  # so that the last deadline has passed
            found = bench.named("missing")
            starts = [n * period for n in range(periods) if n % k == k - 1]
            assert len(found) == len(starts), (k, lost)
            assert all(
                0 < clock - start <= period for clock, start in zip(found, starts, strict=True)
            )
            # Only an inward that comes before the outward's deadline is doubled too.
            twice = lost == "outward" and deadline > period + width
            assert len(bench.named("doubled")) == (3 if twice else 0)
            assert not bench.named("impossible")


@cocotb.test()
async def doubled_crossings(dut) -> None:
    """Two outwards: both are valid, the newer one begins the pair; so with two inwards."""
    bench = await Bench.started(dut)
    await bench.hold(0, 20)
    await bench.hold(1, 70)
    await bench.hold(1, 10, gate=0)
    await bench.hold(0, 20)
    await bench.hold(1, CALM.width_max_clks)  # too long after the first, right after the newer
    await bench.hold(0, 70)
    assert [kind for _, kind in bench.events] == ["valid", "valid", "doubled", "valid"]
    assert bench.named("doubled") == bench.named("valid")[1:2]
    assert bench.twin.alive
    await bench.hold(0, 10, gate=0)
    await bench.hold(1, 20)
    await bench.hold(0, 70)
    assert [kind for _, kind in bench.events][4:] == ["valid", "doubled"]
    assert not bench.crossings[-1]["outward"] and bench.twin.alive
    # The second outward comes in the clock of the first one's deadline, or is withheld: either is
    # one fault, and no doubled one.
    for apart, kinds in (
        (CALM.width_max_clks, ["valid", "valid", "doubled"]),
        (CALM.width_max_clks + 1, ["valid", "missing", "valid"]),
        (pkg.MIN_CROSSING - 1, ["valid", "impossible"]),
    ):
        await bench.start(CALM)
        await bench.hold(0, 20)
        await bench.hold(1, apart - 20)
        await bench.hold(1, 10, gate=0)
        await bench.hold(0, 10)
        await bench.hold(1, 20)
        assert [kind for _, kind in bench.events] == kinds
    # The first crossing ever may go inward: no pair, no fault.
    await bench.start(CALM)
    await bench.hold(1, 100)
    await bench.hold(0, 100)
    assert [kind for _, kind in bench.events] == ["valid"] and not bench.twin.alive


@cocotb.test()
async def the_withheld_crossing_breaks_its_pair(dut) -> None:
    """After an impossible inward another inward is no pair, and nothing is missing by width."""
    bench = await Bench.started(dut)
    await bench.hold(0, 20)
    await bench.hold(1, CALM.width_min_clks - 1)
    await bench.hold(0, 90)
    await bench.hold(0, 10, gate=0)
    await bench.hold(1, 20)
    await bench.hold(0, CALM.width_max_clks)
    kinds = [kind for _, kind in bench.events]
    assert kinds == ["valid", "impossible", "valid", "doubled"], "the withheld one went inward too"
    assert not bench.twin.alive


@cocotb.test()
async def glitches_and_chatter(dut) -> None:
    """A burst that falls back is one glitch; one that does not, one crossing, by its area."""
    bench = await Bench.started(dut)
    o, g = bench.oversample, CALM.glitch_clks
    await bench.hold(0, 20)
    for k in range(1, g):
        await bench.hold(1, k)
        await bench.hold(0, 20)
        assert bench.events == [] and bench.twin.glitch_count == k
    # Back for a clock less than it takes: the burst goes on, and is one glitch at its end.
    for _ in range(4):
        await bench.hold(1, g - 1)
        await bench.hold(0, g - 1)
    await bench.hold(0, 20)
    assert bench.twin.glitch_count == g
    # A single sample, wherever in the clock.
    for k in range(o):
        single = np.zeros(20 * o, np.int64)
        single[k] = 1
        await bench.samples(single)
    most = (1 << parameters()["CountWidth"]) - 1
    assert bench.twin.glitch_count == min(g + o, most) and bench.events == []
    # Chatter: every sample of the new level counts, wherever it is.
    draw = generator(3)
    for level in (1, 0):
        seen = len(bench.crossings)
        chatter = draw.integers(0, 2, 12 * o)
        chatter[:: 2 * o], chatter[o :: 2 * o] = 0, 1  # no g clocks agree
        chatter[1:o] = 1 - chatter[0]
        begun = bench.clock
        await bench.samples(chatter)
        await bench.hold(level, 200)
        assert len(bench.crossings) == seen + 1
        count = int(np.sum(chatter == level))
        want = (begun + 12) * STEP - count * STEP // o
        got = bench.crossings[-1]["time"]
        assert got == want - STEP // o // 2


@cocotb.test()
async def gate_falls_within_a_burst(dut) -> None:
    """Wherever the gate falls before the level has settled, there is no crossing, nor later."""
    bench = await Bench.started(dut)
    o, g = bench.oversample, CALM.glitch_clks
    for k in range((g + 3) * o):
        comparator = pulse(20, 40, 0, o)
        gate = np.ones_like(comparator)
        gate[20 * o + k :] = 0
        await bench.start(CALM)
        await bench.samples(comparator, gate)
        assert (bench.named("valid") != []) == (k >= g * o), k
        assert bench.twin.glitch_count == 0
        await bench.hold(1, 40)  # it opens on the new level
        assert len(bench.events) == (k >= g * o)
    # A single low sample in a burst, wherever.
    for k in range((g + 3) * o):
        comparator = pulse(20, 40, 0, o)
        gate = np.ones_like(comparator)
        gate[20 * o + k] = 0
        await bench.start(CALM)
        await bench.samples(comparator, gate)
        assert (bench.named("valid") != []) == (k >= g * o), k


@cocotb.test()
async def comparator_means_nothing_without_a_gate(dut) -> None:
    """Noise while the gate is low, or partly low, and levels that change meanwhile."""
    bench = await Bench.started(dut)
    o = bench.oversample
    draw = generator(4)
    for _ in range(20):
        count = int(draw.integers(1, 40)) * o
        await bench.samples(draw.integers(0, 2, count), np.zeros(count, np.int64))
        await bench.hold(int(draw.integers(2)), int(draw.integers(1, 20)))
    partly = np.ones(300 * o, np.int64)
    partly[::o] = 0
    if o > 1:
        await bench.samples(telegraph(draw, 300 * o, [(10 * o, 20 * o)]), partly)
    assert bench.events == [] and bench.twin.glitch_count == 0


@cocotb.test()
async def too_old_is_impossible(dut) -> None:
    """A burst of so many new samples that the age does not fit; the one below still does."""
    bench = await Bench.started(dut, settings=Settings(3, 0, MOST, MOST))
    o = bench.oversample
    base = (LATENCY - 1) * STEP + STEP // o // 2
    fits = ((1 << pkg.AGE_WIDTH) - 1 - base) * o // STEP
    for more, kind in ((0, "valid"), (1, "impossible"), (9000 * o, "impossible")):
        await bench.start(Settings(3, 0, MOST, MOST))
        await bench.hold(0, 20)
        # Two clocks of three are new, so that nothing settles before the end.
        part = fits + more - 3 * o
        burst = np.tile(np.repeat([1, 1, 0], o), part // (2 * o) + 1)
        burst = burst[: (int(np.searchsorted(np.cumsum(burst), part)) // o + 1) * o]
        extra = int(burst.sum()) - part
        ones = np.flatnonzero(burst)
        if extra > 0:
            burst[ones[-extra:]] = 0
        if more > 1:  # beyond all the bits that are kept
            assert part * STEP // o > 2 * (1 << pkg.AGE_WIDTH)
        burst = np.concatenate([burst, np.zeros(o, np.int64), np.ones(3 * o, np.int64)])
        await bench.samples(burst)
        await bench.hold(1, 10)
        assert [event for _, event in bench.events] == [kind]


@cocotb.test()
async def counters_stop_at_their_largest_value(dut) -> None:
    """More faults of every kind than three bits hold."""
    bench = await Bench.started(dut, settings=Settings(1, 0, 70, 20))
    most = (1 << parameters()["CountWidth"]) - 1
    for _ in range(12):
        await bench.hold(0, 3)
        await bench.hold(1, 3)
    assert bench.twin.impossible_count == min(len(bench.named("impossible")), most) >= 7
    await bench.hold(1, 300)
    assert bench.twin.missing_count == min(len(bench.named("missing")), most) >= 7
    await bench.start(Settings(2, 0, MOST, MOST))
    for _ in range(12):
        await bench.hold(0, 10, gate=0)
        await bench.hold(0, 5)
        await bench.hold(1, 1)
        await bench.hold(0, 5)
        await bench.hold(1, 70)
    assert bench.twin.doubled_count == min(11, most)
    assert bench.twin.glitch_count == min(12, most)


@cocotb.test()
async def reset_in_every_state(dut) -> None:
    """A reset at any moment of a life with every fault leaves nothing behind."""
    bench = await Bench.started(dut)
    o = bench.oversample
    life = np.concatenate([pulse(8, 75, 10, o), pulse(2, 1, 70, o), pulse(0, 66, 8, o)])
    gate = np.ones_like(life)
    gate[: 3 * o] = 0
    # Two outwards, the gate closed between them.
    life = np.concatenate([life, pulse(60, 70, 0, o), pulse(8, 72, 3, o)])
    gate = np.concatenate([gate, pulse(0, 130, 3, o), np.ones(80 * o, np.int64)])
    comparator_words, gate_words = clocks(life, o), clocks(gate, o)
    probe_words = clocks(pulse(0, 80, 70, o), o)
    await bench.start(Settings(2, 70, 90, 130))
    await bench.clocks(comparator_words, gate_words)
    await bench.hold(0, 40)
    assert {kind for _, kind in bench.events} == set(STROBES) and bench.twin.glitch_count
    for age in range(1, len(comparator_words) + 40, rounds(5, 1)):
        # The only glitch is before clock 200, and one clock settles a level in some of the rest.
        settings = Settings(1 if age > 200 and age // 6 % 2 else 2, 70, 90, 130)
        await bench.start(settings)
        part = min(age, len(comparator_words))
        await bench.clocks(comparator_words[:part], gate_words[:part])
        if age > part:
            await bench.hold(0, age - part)
        await bench.start(settings, busy=bool(age % 2))
        # What comes right after it is compared with a new twin, clock by clock.
        if age % 3 == 0:
            await bench.clocks(probe_words, [bench.ones] * len(probe_words))
        elif age % 3 == 1:
            await bench.hold(0, 8)
            await bench.hold(1, 72)
            await bench.hold(0, 20)
        else:
            await bench.hold(1, 8)
            await bench.hold(0, 90)


@cocotb.test()
async def no_register_lifts_the_ceiling(dut) -> None:
    """A crossing is missing PeriodCeilingClks after one, whatever the limits are."""
    bench = await Bench.started(dut)
    ceiling = parameters().get("PeriodCeilingClks")
    if ceiling is None:
        pytest.skip("there is no ceiling")
    for settings in (Settings(1, 0, MOST, MOST), Settings(1, 0, 300, MOST)):
        await bench.start(settings)
        await bench.hold(0, 20)
        await bench.hold(1, 200)
        await bench.hold(0, 200)
        assert bench.twin.alive
        (first, _) = bench.crossings[-2:]
        await bench.hold(0, ceiling)
        assert bench.named("missing")[-1] - first["clock"] == ceiling + 1
        assert not bench.twin.alive


@EACH_VOLUME
@pytest.mark.parametrize("given", each(ELABORATIONS), ids=str)
def test_index_capture_rtl_equals_model(given: dict[str, int], volume: str) -> None:
    simulate("index_capture", __file__, given, volume=volume)


# ---- the model alone ----


def run_skipping(
    twin: IndexCapture, comparator: list[int], gate: list[int]
) -> Iterator[tuple[int, IndexCapture]]:
    """Feed words, one a clock, skipping what is idle; yield (clock, twin) where it is valid."""
    words = np.stack([comparator, gate], axis=1)
    ends = np.append(np.flatnonzero(np.any(np.diff(words, axis=0), axis=1)) + 1, len(words))
    clock = 0
    for end in ends.tolist():
        c, g = int(comparator[end - 1]), int(gate[end - 1])
        while clock < end:
            n = min(twin.idle(c, g), end - clock)
            if n:
                twin.skip(n, c, g)
                clock += n
            else:
                twin.step(c, g)
                clock += 1
            if twin.valid:
                yield clock, twin


def errors_of(
    oversample: int, sigma: float, settings: Settings, pairs: int, salt: int
) -> np.ndarray:
    """Return time less true time, samples, of crossings whose samples see noise of ``sigma``."""
    draw = generator(salt)
    twin = IndexCapture(settings, oversample)
    spacing = 400  # clocks from edge to edge
    edges = (np.arange(1, 2 * pairs + 1) * spacing + draw.uniform(-20, 20, 2 * pairs)).tolist()
    errors = []
    times = np.arange(spacing * oversample) / oversample - spacing / 2
    clock = 0
    comparator: list[int] = []
    for k, edge in enumerate(edges):
        centre = (k + 1) * spacing
        seen = times + centre + draw.normal(0.0, sigma / oversample, times.size)
        samples = (seen >= edge) ^ (k % 2)
        comparator += clocks(samples, oversample)
    comparator += [0] * spacing
    offset = spacing // 2
    gate = [(1 << oversample) - 1] * len(comparator)
    for clock, found in run_skipping(twin, comparator, gate):
        time = clock - found.age / STEP
        errors.append((time + offset - edges[len(errors)]) * oversample)
    assert len(errors) == 2 * pairs, "a crossing is lost, or one too many"
    assert twin.alive and not (twin.missing_count or twin.doubled_count or twin.impossible_count)
    return np.array(errors)


@pytest.mark.parametrize("oversample", [1, 2, 4, 8])
def test_index_capture_model_times_clean_edges_without_bias(oversample: int) -> None:
    """Edges anywhere between two samples: the error is even over one sample, its mean zero."""
    settings = Settings(3, 100, 1000, 2000)
    errors = errors_of(oversample, 0.0, settings, 2000, oversample)
    floor = 1.0 / np.sqrt(12.0)
    mean, rms = float(errors.mean()), float(np.sqrt(np.mean(errors**2)))
    print(
        f"time of a clean edge, {oversample} samples a clock, samples: mean {mean:.4f} / 0; rms "
        f"measured {rms:.4f} / predicted {floor:.4f} / floor {floor:.4f}"
    )
    assert np.abs(errors).max() <= 0.5 + 1e-6
    assert abs(mean) < 4 * floor / np.sqrt(errors.size)
    assert abs(rms / floor - 1.0) < 0.03


@pytest.mark.parametrize(("oversample", "sigma"), [(1, 3.0), (4, 4.0), (8, 12.0)])
def test_index_capture_model_times_chatter_without_bias(oversample: int, sigma: float) -> None:
    """Noise of every sample: the area's mean error is zero, its variance sigma / root pi.

    A sample at distance x from the edge is wrong with p = Phi(-|x| / sigma); the variance of the
    count is the sum of p (1 - p), which is sigma / root pi samples squared.
    """
    settings = Settings(200 // oversample, 100, 1000, 2000)
    errors = errors_of(oversample, sigma, settings, 1000, 100 + oversample)
    predicted = float(np.sqrt(sigma / np.sqrt(np.pi)))
    mean, rms = float(errors.mean()), float(np.sqrt(np.mean(errors**2)))
    print(
        f"time of an edge with noise of {sigma} samples, {oversample} a clock, samples: mean "
        f"{mean:.4f} / 0; rms measured {rms:.4f} / predicted {predicted:.4f} / floor "
        f"{1 / np.sqrt(12):.4f}"
    )
    assert abs(mean) < 4 * predicted / np.sqrt(errors.size)
    assert abs(rms / predicted - 1.0) < 0.08


def outputs(twin: IndexCapture) -> tuple[int, ...]:
    """Return every output."""
    return tuple(int(getattr(twin, name)) for name in STROBES + STATUS + WITH_VALID)


@pytest.mark.parametrize("oversample", [1, 2, 4, 8])
def test_index_capture_model_skip_is_many_steps(oversample: int) -> None:
    """Random levels, two twins: one takes every step, the other skips whenever it can."""
    draw = generator(oversample)
    skipped = 0
    for settings in (Settings(1, 0, 120, 300), Settings(4, 70, 200, 90), Settings(0, 0, 0, 0)):
        slow, fast = (IndexCapture(settings, oversample, 4, MOST - 900) for _ in range(2))
        full = (1 << oversample) - 1
        for _ in range(1500):
            c = int(draw.choice([0, full, int(draw.integers(full + 1))], p=[0.45, 0.45, 0.1]))
            g = int(draw.choice([full, int(draw.integers(full + 1))], p=[0.9, 0.1]))
            left = int(draw.choice([1, 2, 5, 80, 400]))
            while left:
                n = min(fast.idle(c, g), left)
                if n > 1:
                    n = int(draw.integers(1, n + 1))
                before = outputs(slow)
                for _ in range(max(n, 1)):
                    slow.step(c, g)
                    if n:
                        assert outputs(slow) == before
                if n:
                    fast.skip(n, c, g)
                    skipped += n
                else:
                    fast.step(c, g)
                left -= max(n, 1)
                assert outputs(slow) == outputs(fast)
    assert skipped > 50_000


def test_an_oversampling_that_the_hardware_has_not_is_refused() -> None:
    with pytest.raises(ValueError, match="index_capture: "):
        IndexCapture(CALM, 3)
