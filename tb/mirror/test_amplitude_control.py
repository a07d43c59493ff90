"""amplitude_control: every clock of the RTL against the model, the loop against a float PI."""

import dataclasses
import functools
from operator import attrgetter

import cocotb
import numpy as np
from harness import (
    EACH_VOLUME,
    Ports,
    TwinBench,
    drive_settings,
    generator,
    rounds,
    simulate,
)

from vrscan.clocked.amplitude_control import (
    CONFIDENCE_FRACTION,
    LATENCY,
    MOST_IDLE,
    AmplitudeControl,
)
from vrscan.data import pkg
from vrscan.registers.settings import AmplitudeSettings as Settings

OUTPUTS = {
    "level": False,
    "trim": True,
    "settled": False,
    "unsettled": False,
    "index_fault": False,
    "confidence": False,
}
OFF, SWEEP, SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
RUN, FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT
AMPLITUDE_MAX = (1 << pkg.AMPLITUDE_WIDTH) - 1
LEVEL_MAX = (1 << pkg.LEVEL_WIDTH) - 1
GAIN_MAX = (1 << pkg.CONTROL_GAIN_WIDTH) - 1
TRIM_MAX = (1 << (pkg.TRIM_WIDTH - 1)) - 1
ERROR_MIN = -1 << (pkg.ERROR_WIDTH - 1)
P_ONE = 1 << pkg.PROPORTIONAL_FRACTION
I_ONE = 1 << pkg.INTEGRAL_FRACTION

# A level step for four amplitude steps at once, and one for eight each measurement.
CALM = Settings(
    amplitude_set=10_000,
    k_p=P_ONE // 4,
    k_i=I_ONE // 8,
    level_min=100,
    level_max=1000,
    level_low=150,
    level_high=900,
    level_nominal=500,
    trim_step=7,
    trim_gain=1 << (pkg.TRIM_GAIN_FRACTION - 3),
    trim_min=-30,
    trim_max=40,
    trim_up=1,
    settle_limit=20,
    shock_limit=2000,
    phase_limit=50,
    settle_count=3,
    hold_count=5,
    confidence_gain=1 << (CONFIDENCE_FRACTION - 1),
)
QUIET = {
    "state": OFF,
    "valid": False,
    "measured": 0,
    "error": 0,
    "acquired": False,
    "broken": False,
}
shown = attrgetter(*OUTPUTS)  # of a twin
with_changes = functools.partial(dataclasses.replace, CALM)


class Loop:
    """A twin alone, fed with measurements."""

    def __init__(self, settings: Settings = CALM, state: int = RUN) -> None:
        self.twin = AmplitudeControl(settings)
        self.settings = settings
        self.state = state
        self.twin.step(**QUIET)

    def measure(self, e: int, error: int = 0, **strobes: bool) -> AmplitudeControl:
        """Take a measurement that is off by ``e``."""
        calm = QUIET | {"state": self.state}
        measured = self.settings.amplitude_set - e
        self.twin.step(**calm | {"valid": True, "measured": measured, "error": error} | strobes)
        for _ in range(LATENCY - 1):
            self.twin.step(**calm)
        return self.twin

    def strobe(self, name: str) -> AmplitudeControl:
        """Give a strobe without a measurement."""
        self.twin.step(**QUIET | {"state": self.state, name: True})
        return self.twin


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("valid", "acquired", "broken")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        signed = [f"{name}_o" for name in OUTPUTS if OUTPUTS[name]]
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS], signed)

    async def start(self, settings: Settings = CALM, **inputs: int) -> None:
        """Set the configuration and reset for a clock, with these inputs."""
        drive_settings(self.dut, settings)
        self.settings = settings
        await self.reset_to(AmplitudeControl(settings), **(QUIET | inputs))
        self.check()

    def check(self) -> None:
        """Compare all outputs."""
        got = self.outputs.read()
        want = shown(self.twin)
        assert got == want, (
            f"clock {self.clock}, {self.inputs}: {tuple(OUTPUTS)} {got}, want {want}"
            f"\n{self.settings}"
        )

    async def measure(self, e: int, error: int = 0, *, clocks: int = LATENCY, **more: int) -> None:
        """Take a measurement that is off by ``e``, and wait."""
        # Behind the strobe the ports carry something else.
        measured = self.settings.amplitude_set - e
        await self.clocks(valid=True, measured=measured, error=error, **more)
        self.give(measured=measured ^ 0x155, error=~error)
        await self.clocks(clocks - 1)


def small_settings(draw: np.random.Generator) -> Settings:
    """Return settings of a few steps each, so that every limit is met exactly, and often."""
    levels = sorted(int(v) for v in draw.integers(0, 40, size=5))
    if draw.random() < 0.2:
        draw.shuffle(levels)
    trims = sorted(int(v) for v in draw.integers(-9, 10, size=2))
    if draw.random() < 0.1:
        trims.reverse()
    return Settings(
        amplitude_set=int(draw.integers(100, 200)),
        k_p=int(draw.integers(0, P_ONE)),
        k_i=min(int(draw.integers(0, I_ONE)), GAIN_MAX),
        level_min=levels[0],
        level_low=levels[1],
        level_nominal=levels[2],
        level_high=levels[3],
        level_max=levels[4],
        trim_step=int(draw.integers(0, 5)),
        trim_gain=int(draw.integers(1 << 15)),
        trim_min=trims[0],
        trim_max=trims[1],
        trim_up=int(draw.integers(2)),
        settle_limit=int(draw.integers(5, 12)),
        shock_limit=int(draw.integers(3, 20)),
        phase_limit=int(draw.integers(0, 4)),
        settle_count=int(draw.integers(0, 4)),
        hold_count=int(draw.integers(0, 5)),
        confidence_gain=int(draw.choice([0, 1 << 19, draw.integers(1 << 24), 1 << 24])) % (1 << 24),
    )


def wide_settings(draw: np.random.Generator) -> Settings:
    """Return settings of any magnitude, the largest values among them."""

    def any_of(width: int) -> int:
        if draw.random() < 0.15:
            return (1 << width) - 1
        return int(draw.integers(1 << width)) >> int(draw.integers(width))

    levels = sorted(any_of(pkg.LEVEL_WIDTH) for _ in range(5))
    trims = sorted(any_of(pkg.TRIM_WIDTH) - TRIM_MAX - 1 for _ in range(2))
    return Settings(
        amplitude_set=any_of(pkg.AMPLITUDE_WIDTH),
        k_p=any_of(pkg.CONTROL_GAIN_WIDTH),
        k_i=any_of(pkg.CONTROL_GAIN_WIDTH),
        level_min=levels[0],
        level_low=levels[1],
        level_nominal=levels[2],
        level_high=levels[3],
        level_max=levels[4],
        trim_step=any_of(pkg.TRIM_STEP_WIDTH),
        trim_gain=any_of(pkg.CONTROL_GAIN_WIDTH),
        trim_min=trims[0],
        trim_max=trims[1],
        trim_up=int(draw.integers(2)),
        settle_limit=any_of(pkg.AMPLITUDE_WIDTH),
        shock_limit=any_of(pkg.AMPLITUDE_WIDTH),
        phase_limit=any_of(pkg.ERROR_WIDTH),
        settle_count=int(draw.integers(4)),
        hold_count=int(draw.integers(4)),
        confidence_gain=any_of(pkg.GAIN_WIDTH),
    )


def random_error(draw: np.random.Generator, settings: Settings) -> tuple[int, int]:
    """Return amplitude and phase errors, those at the limits and next to them among them."""
    small = settings.amplitude_set < 200
    limit = int(draw.choice([0, settings.settle_limit, settings.shock_limit]))
    near = (limit + int(draw.integers(-1, 2))) * int(draw.choice([-1, 1]))
    far = int(draw.integers(-25, 26)) if small else int(draw.integers(-(1 << 26), 1 << 26))
    e = near if draw.random() < 0.6 else far
    least, most = settings.amplitude_set - AMPLITUDE_MAX, settings.amplitude_set
    phase = (settings.phase_limit + int(draw.integers(-1, 2))) * int(draw.choice([-1, 1]))
    if draw.random() < 0.6:
        phase = int(draw.choice([0, 1, ERROR_MIN, -ERROR_MIN - 1], p=[0.9, 0.04, 0.03, 0.03]))
    return min(max(e, least), most), min(max(phase, ERROR_MIN), -ERROR_MIN - 1)


@cocotb.test()
async def another_table_drops_the_measurement_at_work(dut) -> None:
    """Whatever clock of it ``acquired`` comes in alone, it does not settle what comes after."""
    bench = await Bench.fresh(dut)
    for at in range(1, LATENCY + 2):
        await bench.start(dataclasses.replace(CALM, settle_count=1), state=RUN)
        await bench.measure(0)
        assert bench.twin.settled
        before = bench.twin.level
        await bench.measure(16, clocks=at)
        await bench.clocks(1, acquired=True)
        await bench.clocks(LATENCY + 2)
        assert bench.twin.unsettled and not bench.twin.settled
        # What ends in the clock of `acquired` itself still moves the level.
        assert (bench.twin.level == before) == (at < LATENCY - 1)
        await bench.measure(2)
        assert bench.twin.settled and not bench.twin.unsettled


@cocotb.test()
async def random_measurements_at_small_limits(dut) -> None:
    """A few steps of everything, so that every comparison is met at equality."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    seen = set()
    for _ in range(rounds(25, 200)):
        await bench.start(small_settings(draw), state=SWEEP)
        await bench.clocks(1 + int(draw.integers(3)))
        bench.give(state=int(draw.choice([SETTLE, RUN])))
        bias = int(draw.integers(-3, 4))
        for _ in range(45):
            e, phase = random_error(draw, bench.settings)
            await bench.measure(e + bias, phase, clocks=LATENCY + int(draw.integers(2)))
            if draw.random() < 0.05:
                await bench.clocks(1, **{str(draw.choice(["acquired", "broken"])): True})
            twin = bench.twin
            seen.add((twin.settled, twin.unsettled, twin.index_fault, twin.confidence > 0))
    assert {flags[:3] for flags in seen} == {
        (settled, unsettled, fault)
        for settled in (False, True)
        for unsettled in (False, True)
        for fault in (False, True)
        if not (settled and unsettled)
    }
    assert all(not confident for _, unsettled, fault, confident in seen if unsettled or fault)


@cocotb.test()
async def random_measurements_of_any_size(dut) -> None:
    """The widest words through all of the arithmetic."""
    draw = generator(2)
    bench = await Bench.fresh(dut)
    for _ in range(rounds(60, 500)):
        await bench.start(wide_settings(draw), state=SWEEP)
        await bench.clocks(2)
        bench.give(state=RUN)
        for _ in range(12):
            await bench.measure(*random_error(draw, bench.settings))


@cocotb.test()
async def random_strobes_states_and_resets(dut) -> None:
    """Strobes at any moment, measurements that follow too soon, every state, resets."""
    draw = generator(3)
    bench = await Bench.fresh(dut)
    measured = 0
    for _ in range(rounds(40, 200)):
        settings = small_settings(draw)
        await bench.start(settings, state=int(draw.integers(5)), broken=True, acquired=True)
        for _ in range(30):
            strobes = {name: bool(draw.random() < 0.15) for name in ("acquired", "broken")}
            if draw.random() < 0.2:
                strobes["state"] = int(draw.choice([OFF, SWEEP, SETTLE, RUN, FAULT, 5, 6, 7]))
            elif bench.inputs["state"] not in (SETTLE, RUN) and draw.random() < 0.5:
                strobes["state"] = int(draw.choice([SETTLE, RUN]))
            clocks = int(draw.choice([1, LATENCY - 1, LATENCY, draw.integers(1, LATENCY + 9)]))
            if draw.random() < 0.8:
                await bench.measure(*random_error(draw, settings), clocks=clocks, **strobes)
            else:
                await bench.clocks(clocks, **strobes)
            measured += clocks >= LATENCY
    assert measured > rounds(300, 1500)


@cocotb.test()
async def the_latency_is_fixed(dut) -> None:
    """All outputs change LATENCY clocks after valid_i; one in between starts anew."""
    bench = await Bench.fresh(dut)
    await bench.start(state=RUN)
    await bench.clocks(1, state=SWEEP)
    await bench.clocks(2, state=RUN)
    for gap in range(1, LATENCY):
        before = shown(bench.twin)
        await bench.measure(7, clocks=gap)
        await bench.measure(5 if gap % 2 else -5, clocks=LATENCY - 1)
        assert shown(bench.twin)[:6] == before[:6]
        await bench.clocks()
        assert bench.twin.confidence == (252 if bench.twin.settled else 0)  # 255 - 5 / 2
    assert bench.twin.settled
    await bench.measure(9, clocks=2 * LATENCY + 5)
    assert bench.twin.confidence == 250


@cocotb.test()
async def leaving_the_loop_drops_a_measurement(dut) -> None:
    """A state that has no loop, or a reset, at every moment of the work: nothing comes of it."""
    bench = await Bench.fresh(dut)
    for age in range(1, LATENCY + 1):
        for state in (OFF, SWEEP, FAULT):
            await bench.start(state=RUN)
            await bench.clocks(1, state=SWEEP)
            for e in (300, 10, 10, 10):
                await bench.measure(e, state=RUN)
            assert bench.twin.settled and bench.twin.level != CALM.level_nominal
            await bench.measure(3, clocks=age)
            await bench.clocks(1, state=state)
            assert bench.twin.level == CALM.level_nominal and not bench.twin.settled
            assert bench.twin.unsettled and bench.twin.confidence == 0
            await bench.clocks(LATENCY + 1, state=RUN)
            assert bench.twin.level == CALM.level_nominal
        await bench.measure(3, clocks=age)
        await bench.start(state=RUN)
        await bench.clocks(LATENCY + 1)
        assert shown(bench.twin) == (0, 0, 0, 1, 0, 0)


@cocotb.test()
async def trim_steps_at_both_limits(dut) -> None:
    """From beyond a limit until the nominal level is crossed, both ways and both signs."""
    bench = await Bench.fresh(dut)
    for up in (0, 1):
        for sign in (1, -1):
            await bench.start(with_changes(trim_up=up), state=SWEEP)
            await bench.clocks()
            bench.give(state=RUN)
            for e in (*[400] * 12, *[-100] * 30, *[300] * 20, 0, 0, 0):
                await bench.measure(sign * e)


@cocotb.test()
async def counts_of_255(dut) -> None:
    """The longest counts there are, and more good measurements than they need."""
    bench = await Bench.fresh(dut)
    await bench.start(with_changes(settle_count=255, hold_count=254), state=RUN, broken=True)
    await bench.clocks(1, broken=True)
    for k in range(1, 258):
        await bench.measure(0)
        assert bench.twin.settled == (k >= 255)
        assert bench.twin.index_fault == (k < 254)


@EACH_VOLUME
def test_amplitude_control_rtl_equals_model(volume: str) -> None:
    simulate("amplitude_control", __file__, volume=volume)


# ---- the model alone ----


def test_the_level_is_a_pi_controllers() -> None:
    """Within its limits: integrator + k_p e against float64, half a step of rounding."""
    draw = generator(11)
    settings = with_changes(
        level_nominal=1 << 19, level_min=0, level_max=LEVEL_MAX, level_high=LEVEL_MAX, level_low=0
    )
    loop = Loop(settings)
    integrator = float(settings.level_nominal)
    worst = 0.0
    for e in draw.integers(-3000, 3000, size=500).tolist():
        integrator += settings.k_i / I_ONE * e
        level = loop.measure(e).level
        worst = max(worst, abs(level - (integrator + settings.k_p / P_ONE * e)))
    print(f"\nlevel against a float PI: measured {worst:.3f}, predicted 0.5, floor 0.5 steps")
    assert worst <= 0.5
    # Half a step goes up.
    for e, level in ((2, 501), (-2, 500)):
        assert Loop(with_changes(k_i=0)).measure(e).level == level


def test_the_level_leaves_its_limit_with_the_errors_sign() -> None:
    """After a long saturation, against a float PI without anti-windup, which stays for long."""
    for sign, limit in ((1, CALM.level_max), (-1, CALM.level_min)):
        loop = Loop()
        integrator = float(CALM.level_nominal)
        for _ in range(400):
            level = loop.measure(sign * 800).level
            integrator += CALM.k_i / I_ONE * sign * 800
        assert level == limit
        leaves = next(k for k in range(1, 100) if loop.measure(-sign * 80).level != limit)
        without = 0
        beyond = True
        while beyond:
            without += 1
            integrator -= CALM.k_i / I_ONE * sign * 80
            level = integrator - CALM.k_p / P_ONE * sign * 80
            beyond = level >= CALM.level_max if sign > 0 else level <= CALM.level_min
        print(
            f"\nafter 400 measurements beyond the limit: left with measurement {leaves}, "
            f"without anti-windup {without}"
        )
        assert leaves == 1
        assert without > 1000


def test_the_integrator_starts_at_the_nominal_level_and_comes_within_limits() -> None:
    """A nominal level beyond a limit is left at the first measurement, whatever its sign."""
    for e in (-8, 0, 8):
        loop = Loop(with_changes(level_nominal=3000, k_p=0))
        assert loop.twin.level == 3000
        assert loop.measure(e).level == CALM.level_max
        assert loop.measure(-8).level == CALM.level_max - 1
        loop = Loop(with_changes(level_nominal=3, k_p=0))
        assert loop.measure(e).level == CALM.level_min
        assert loop.measure(8).level == CALM.level_min + 1


def test_the_trim_has_hysteresis() -> None:
    """Nothing up to the limit; beyond it a step a measurement until the nominal level is met.

    A step is an eighth of what the level is off, to nearest, half up, and at most 7.
    """
    still = {"k_i": 0, "k_p": P_ONE, "trim_min": -300, "trim_max": 300}  # the level is 500 + e
    up = {900: 0, 901: 7, 899: 14, 508: 15, 504: 16, 503: 16, 500: 16, 600: 16}
    down = {150: 16, 149: 9, 151: 2, 492: 1, 496: 0, 497: 0, 499: 0, 501: 0, 400: 0}
    turn = {902: 7, 148: 0, 903: 7}
    for sign in (1, -1):
        loop = Loop(with_changes(**still, trim_up=int(sign > 0)))
        for level, trim in (up | down | turn).items():
            assert loop.measure(level - 500).level == level
            assert loop.twin.trim == sign * trim, f"level {level}"
    for still_at in (500, 499):
        # At the nominal level, or past it, stepping is over: it does not begin anew within limits.
        loop = Loop(with_changes(**still))
        assert [loop.measure(v - 500).trim for v in (901, still_at, 900, 880)] == [7, 7, 7, 7]
        loop = Loop(with_changes(**still))
        below = 1000 - still_at
        assert [loop.measure(v - 500).trim for v in (149, below, 150, 180)] == [-7, -7, -7, -7]


def test_the_trim_stops_at_its_limits() -> None:
    """Of either sign; there it waits for the level to come back."""
    loop = Loop(with_changes(k_i=0, k_p=P_ONE))
    assert [loop.measure(450).trim for _ in range(8)] == [7, 14, 21, 28, 35, 40, 40, 40]
    assert loop.measure(-400).trim == 33
    assert [loop.measure(-400).trim for _ in range(11)][-3:] == [-30, -30, -30]
    # A limit on the wrong side of zero is reached with the first step, the upper one last.
    assert Loop(with_changes(trim_min=9, k_p=P_ONE)).measure(450).trim == 9
    assert Loop(with_changes(trim_max=-9, k_p=P_ONE)).measure(450).trim == -9
    # Limits that contradict each other: beyond the upper one, or else below the lower one.
    for start, trim in ((450, -9), (-400, 5)):
        loop = Loop(with_changes(trim_max=-9, trim_min=5, k_p=P_ONE, trim_step=10))
        assert loop.measure(start).trim == trim


def test_settled_and_unsettled() -> None:
    """What settles, what ends it and what unsettles, each at its limit."""
    loop = Loop()
    assert [loop.measure(0).settled for _ in range(4)] == [False, False, True, True]
    assert not loop.twin.unsettled
    assert loop.measure(20, 50).settled and loop.measure(-20, -50).settled
    # Not good, but no shock either.
    for e in (21, -21):
        assert not loop.measure(e).settled and not loop.twin.unsettled
        assert [loop.measure(0).settled for _ in range(3)] == [False, False, True]
    assert not loop.measure(2000).unsettled and not loop.measure(-2000).unsettled
    for e, phase in ((2001, 0), (-2001, 0), (0, 51), (0, -51)):
        assert loop.measure(e, phase).unsettled and not loop.twin.settled
        assert [loop.measure(0).unsettled for _ in range(3)] == [True, True, False]
        assert loop.twin.settled
    twin = loop.strobe("acquired")
    assert twin.unsettled and not twin.settled and not twin.confidence
    assert [loop.measure(0).unsettled for _ in range(3)] == [True, True, False]
    # A settle_limit beyond the shock's does not make a shock good.
    loop = Loop(with_changes(settle_limit=3000, settle_count=0))
    assert loop.measure(2000).settled and not loop.measure(2001).settled


def test_index_faults() -> None:
    """Held until enough measurements on end were good; they do not unsettle, but settle anew."""
    loop = Loop()
    for _ in range(3):
        loop.measure(0)
    twin = loop.strobe("broken")
    assert twin.index_fault and not twin.settled and not twin.unsettled and not twin.confidence
    assert [loop.measure(0).index_fault for _ in range(4)] == [True] * 4
    assert loop.twin.settled and not loop.twin.confidence
    loop.measure(21)
    assert [loop.measure(0).index_fault for _ in range(6)] == [True] * 4 + [False] * 2
    assert loop.twin.confidence == 255
    for count in (0, 1):
        loop = Loop(with_changes(hold_count=count, settle_count=count))
        loop.strobe("broken")
        assert loop.twin.index_fault
        assert not loop.measure(0).index_fault and loop.twin.settled
    # One before the loop is closed is not forgotten.
    loop = Loop(state=SWEEP)
    loop.strobe("broken")
    assert loop.measure(0).index_fault
    loop.state = SETTLE
    assert [loop.measure(0).index_fault for _ in range(5)] == [True] * 4 + [False]


def test_confidence_falls_linearly() -> None:
    """From 255 at no error to 0 at the set one, to nearest."""
    limit = 1000
    gain = round(255 / limit * (1 << CONFIDENCE_FRACTION))
    loop = Loop(with_changes(confidence_gain=gain))
    for _ in range(3):
        loop.measure(0)
    for e in (0, 1, -1, 2, 100, -500, 997, 998, 999, 1000, -1000, 1001, 2000):
        exact = max(255 * (1 - abs(e) / limit), 0)
        assert abs(loop.measure(e).confidence - exact) <= 0.51
    assert loop.measure(1000).confidence == 0 and loop.measure(996).confidence == 1
    # A half goes down.
    loop = Loop(with_changes(settle_count=1))
    assert [loop.measure(e).confidence for e in (0, 1, 2, 3)] == [255, 254, 254, 253]


def test_skipping_is_stepping() -> None:
    """At random moments of random runs, with random settings: all of the state is the same."""
    draw = generator(5)
    skipped = 0
    for _ in range(40):
        settings = small_settings(draw)
        stepped, jumper = AmplitudeControl(settings), AmplitudeControl(settings)
        inputs = dict(QUIET)
        for _ in range(200):
            strobes = {name: bool(draw.random() < 0.1) for name in ("acquired", "broken")}
            strobes["valid"] = bool(draw.random() < 0.5)
            if draw.random() < 0.1:
                inputs["state"] = int(draw.choice([OFF, SWEEP, SETTLE, RUN, RUN, RUN, FAULT]))
            e, phase = random_error(draw, settings)
            given = inputs | strobes | {"measured": settings.amplitude_set - e, "error": phase}
            assert jumper.idle(**given) == 0 or not any(strobes.values())
            for twin in (stepped, jumper):
                twin.step(**given)
            for _ in range(3):
                most = jumper.idle(**inputs)
                assert 0 <= most <= MOST_IDLE
                count = min(most, int(draw.integers(2 * LATENCY)))
                before = shown(jumper)
                jumper.skip(count, **inputs)
                for _ in range(count):
                    stepped.step(**inputs)
                assert vars(stepped) == vars(jumper)
                assert before == shown(jumper)
                for twin in (stepped, jumper):
                    twin.step(**inputs)
                skipped += count
    assert skipped > 50_000
