"""mirror_drive: every clock of the RTL against the model, and start, stop and faults by name."""

import dataclasses
import functools
from operator import attrgetter

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    TwinBench,
    as_integer,
    drive_settings,
    generator,
    parameters,
    port,
    rounds,
    simulate,
)

from vrscan.clocked.mirror_drive import (
    DRIVE_LATENCY,
    DUTY_CEILING,
    LEVEL_CEILING,
    MOST_IDLE,
    READY_LATENCY,
    TIMEOUT_LATENCY,
    TRIM_LATENCY,
    MirrorDrive,
    floor_sum,
)
from vrscan.data import pkg
from vrscan.registers.settings import DriveSettings as Settings

ELABORATIONS = [
    {
        "StopWidth": 6,
        "SettleCeilingClks": 350,
        "LostCeilingClks": 90,
        "LevelCeiling": 650_000,
        "DutyCeiling": 20_000,
    },
    {"StopWidth": 24, "LevelCeiling": 2**20 - 2, "DutyCeiling": 65_534},
    {"StopWidth": 24},
]
CEILINGS = {
    "SettleCeilingClks": "settle_ceiling",
    "LostCeilingClks": "lost_ceiling",
    "LevelCeiling": "level_ceiling",
    "DutyCeiling": "duty_ceiling",
}
OUTPUTS = ("state", "fault", "drive", "level", "level_pin", "phase", "word")
OFF, SWEEP, SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
RUN, FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT
CLOCK_HZ = 125e6
WORD_MAX = (1 << pkg.WORD_WIDTH) - 1
LEVEL_MAX = (1 << pkg.LEVEL_WIDTH) - 1
NEVER = (1 << pkg.TIME_WIDTH) - 1

# A period of the drive is 512 clocks, a sweep 256 clocks.
QUICK = Settings(
    sweep_word=(1 << 38) + (1 << 23),
    work_word=1 << 38,
    sweep_rate=1 << 31,
    duty=1 << 15,
    sweep_level=700_000,
    sweep_timeout=2000,
    settle_timeout=1000,
    lost_timeout=300,
)
QUIET = {"enable": False, "trim": 0, "level": 0, "index_alive": False, "settled": False}
shown = attrgetter(*OUTPUTS)  # of a twin
with_changes = functools.partial(dataclasses.replace, QUICK)


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.handles = [port(dut, f"{name}_o") for name in OUTPUTS]

    async def start(self, settings: Settings = QUICK, **inputs: int) -> None:
        """Set the configuration and reset for a clock, with these inputs."""
        drive_settings(self.dut, settings)
        given = parameters()
        limits = {CEILINGS[name]: most for name, most in given.items() if name in CEILINGS}
        twin = MirrorDrive(settings, given["StopWidth"], **limits)
        await self.reset_to(twin, **(QUIET | inputs))
        self.check()

    def check(self) -> None:
        """Compare all outputs."""
        got = tuple(as_integer(handle) for handle in self.handles)
        want = shown(self.twin)
        assert got == want, f"clock {self.clock}, {self.inputs}: {OUTPUTS} {got}, want {want}"

    async def until(self, state: int, most: int = 5000, **inputs: int) -> int:
        """Go on until the drive is in a state and return how many clocks that took."""
        for count in range(most):
            if self.twin.state == state:
                return count
            await self.clocks(**inputs)
        raise AssertionError(f"not in state {state} after {most} clocks")

    async def into(self, state: int, settings: Settings = QUICK) -> None:
        """Reset and take the shortest way into a state."""
        await self.start(settings, level=600_000)
        await self.clocks(2)
        if state in (SWEEP, SETTLE, RUN):
            await self.until(SWEEP, enable=True)
        if state in (SETTLE, RUN):
            await self.until(SETTLE)
        if state == RUN:
            await self.until(RUN, index_alive=True, settled=True)
        if state == FAULT:
            timeless = dataclasses.replace(settings, sweep_timeout=0)
            await self.start(timeless, level=600_000)
            await self.until(FAULT, enable=True)


def random_settings(draw: np.random.Generator) -> Settings:
    """Return settings in which everything happens within hundreds of clocks."""
    work = int(draw.integers(WORD_MAX + 1)) >> int(draw.integers(0, 12))
    span = int(draw.integers(WORD_MAX + 1)) >> int(draw.integers(1, 36))
    sweep = min(work + span, WORD_MAX) if draw.random() < 0.9 else max(work - span, 0)
    rate = min(max(span << 16, 1) // int(draw.integers(1, 400)), (1 << 32) - 1)
    return Settings(
        sweep_word=sweep,
        work_word=work,
        sweep_rate=rate,
        duty=int(draw.choice([0, 1, 65535, draw.integers(1 << 16), draw.integers(1 << 16)])),
        sweep_level=int(draw.integers(LEVEL_MAX + 1)),
        sweep_timeout=int(draw.choice([0, 100, 400, 1000, NEVER])),
        settle_timeout=int(draw.choice([0, 100, 400, NEVER])),
        lost_timeout=int(draw.choice([0, 1, 20, 100])),
    )


def random_inputs(draw: np.random.Generator, inputs: dict[str, int]) -> dict[str, int]:
    """Return the inputs, some of them changed: most often on, and the limits among the numbers."""
    changed = dict(inputs)
    if draw.random() < 0.02:
        changed["enable"] = bool(draw.random() < 0.8)
    if draw.random() < 0.05:
        changed["index_alive"] = bool(draw.random() < 0.8)
    if draw.random() < 0.05:
        changed["settled"] = bool(draw.random() < 0.3)
    if draw.random() < 0.02:
        changed["level"] = int(draw.choice([0, LEVEL_MAX, draw.integers(LEVEL_MAX)]))
    if draw.random() < 0.02:
        trim = int(draw.choice([0, -1 << 31, (1 << 31) - 1, draw.integers(-1 << 31, 1 << 31)]))
        changed["trim"] = trim
    return changed


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Inputs without any order: every state is left by every way, and a reset comes in each."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    ways = set()
    resets = set()
    for _ in range(rounds(60, 500)):
        await bench.start(random_settings(draw), **random_inputs(draw, QUIET))
        for _ in range(int(draw.integers(50, 700))):
            before = bench.twin.state
            await bench.clocks(**random_inputs(draw, bench.inputs))
            ways.add((before, bench.twin.state))
        resets.add(bench.twin.state)
    assert resets == {OFF, SWEEP, SETTLE, RUN, FAULT}
    wanted = {
        *((state, state) for state in resets),
        *((state, OFF) for state in resets),
        *((state, FAULT) for state in (SWEEP, SETTLE, RUN)),
        (OFF, SWEEP),
        (SWEEP, SETTLE),
        (SETTLE, RUN),
    }
    assert not wanted - ways


@cocotb.test()
async def from_off_to_run(dut) -> None:
    """The word falls from the third clock of SWEEP to the working word, then follows the trim."""
    bench = await Bench.fresh(dut)
    await bench.start()
    await bench.clocks(3)
    assert shown(bench.twin) == (OFF, pkg.FAULT_NONE, 0, 0, 0, 0, QUICK.sweep_word)
    await bench.until(SWEEP, enable=True)
    most = parameters().get("LevelCeiling", LEVEL_CEILING)
    assert bench.twin.level == min(QUICK.sweep_level, most)
    steps = (QUICK.sweep_word - QUICK.work_word) * 2**16 // QUICK.sweep_rate
    for k in range(steps + 1):
        assert bench.twin.state == SWEEP
        fallen = max(k - 1, 0) * QUICK.sweep_rate / 2**16
        assert bench.twin.word == QUICK.sweep_word - fallen
        await bench.clocks(level=3, trim=77)
    assert bench.twin.state == SETTLE and bench.twin.word == QUICK.work_word
    assert bench.twin.level == 3
    await bench.clocks(50, trim=-77)
    assert bench.twin.word == QUICK.work_word - 77
    await bench.clocks(TRIM_LATENCY - 1, trim=99)
    assert bench.twin.word == QUICK.work_word - 77
    await bench.clocks()
    assert bench.twin.word == QUICK.work_word + 99
    for alive, settled, state in ((0, 1, SETTLE), (1, 0, SETTLE), (1, 1, RUN)):
        await bench.clocks(READY_LATENCY - 1, index_alive=alive, settled=settled)
        assert bench.twin.state == SETTLE
        await bench.clocks()
        assert bench.twin.state == state
    await bench.clocks(settled=0, level=LEVEL_MAX)
    await bench.clocks(2000)
    assert bench.twin.state == RUN and bench.twin.level == most


@cocotb.test()
async def a_sweep_from_below_is_there_at_once(dut) -> None:
    """A sweep word at or below the working word, with a rate of zero: SETTLE is the next clock."""
    bench = await Bench.fresh(dut)
    for sweep, work, arrives in ((7, 7, True), (0, WORD_MAX, True), (8, 7, False)):
        await bench.start(with_changes(sweep_word=sweep, work_word=work, sweep_rate=0))
        await bench.until(SWEEP, enable=True)
        assert bench.twin.word == sweep
        await bench.clocks()
        assert (bench.twin.state, bench.twin.word) == ((SETTLE, work) if arrives else (SWEEP, 8))


@cocotb.test()
async def sweep_without_ever_an_index_ends_in_fault(dut) -> None:
    """By SWEEP's time-out where it takes too long, else by SETTLE's; FAULT drives nothing."""
    bench = await Bench.fresh(dut)
    for timeout in (0, 1, 2, 100):
        for changes, state, cause in (
            ({"sweep_timeout": timeout, "settle_timeout": 77}, SWEEP, pkg.FAULT_SWEEP),
            ({"settle_timeout": timeout, "sweep_timeout": 2000}, SETTLE, pkg.FAULT_SETTLE),
        ):
            await bench.start(with_changes(**changes, lost_timeout=5))
            await bench.until(state, enable=True, level=5)
            assert await bench.until(FAULT) == timeout + TIMEOUT_LATENCY
            assert (bench.twin.fault, bench.twin.drive, bench.twin.level) == (cause, 0, 0)
            word = bench.twin.word
            await bench.clocks(300, index_alive=1, settled=1, trim=1)
            assert bench.twin.state == FAULT and not bench.twin.level_pin
            assert bench.twin.word == word
            await bench.clocks(enable=False, index_alive=0, settled=0, trim=0)
            assert (bench.twin.state, bench.twin.fault) == (OFF, cause)
            await bench.clocks(20)
            assert bench.twin.fault == cause
            await bench.clocks(enable=True)
            assert (bench.twin.state, bench.twin.fault) == (SWEEP, pkg.FAULT_NONE)


@cocotb.test()
async def arriving_wins_over_a_time_out(dut) -> None:
    """In the very clock of the time-out the sweep is over, or the loop settled."""
    bench = await Bench.fresh(dut)
    length = (QUICK.sweep_word - QUICK.work_word) * 2**16 // QUICK.sweep_rate + 1  # of SWEEP
    for slack, state in ((0, FAULT), (1, SETTLE)):
        await bench.start(with_changes(sweep_timeout=length - TIMEOUT_LATENCY - 1 + slack))
        await bench.until(SWEEP, enable=True)
        await bench.until(state)
    for late, state in ((0, RUN), (1, FAULT)):
        await bench.into(SETTLE, with_changes(settle_timeout=40))
        await bench.clocks(40 + TIMEOUT_LATENCY - READY_LATENCY + late)
        await bench.clocks(READY_LATENCY, index_alive=1, settled=1)
        assert bench.twin.state == state


@cocotb.test()
async def the_index_may_be_away_for_its_time(dut) -> None:
    """Exactly lost_timeout clocks on end are forgiven, one more is a fault; so at the ceiling."""
    bench = await Bench.fresh(dut)
    most = parameters().get("LostCeilingClks")
    for limit in (0, 1, 30, *((most + 1, NEVER) if most else ())):
        timeout = min(limit, most or limit)
        settings = with_changes(lost_timeout=limit, settle_timeout=3, sweep_timeout=NEVER)
        await bench.into(RUN, settings)
        for _ in range(3):
            await bench.clocks(timeout, index_alive=0)
            await bench.clocks(2, index_alive=1)
        await bench.clocks(20)
        assert bench.twin.state == RUN
        await bench.clocks(timeout + 1, index_alive=0)
        await bench.clocks(index_alive=1)
        assert (bench.twin.state, bench.twin.fault) == (FAULT, pkg.FAULT_INDEX)


def pulses(wave: list[bool]) -> list[int]:
    """Return the lengths of all high pulses."""
    edges = np.flatnonzero(np.diff(np.array([0, *wave, 0], np.int64)))
    return (edges[1::2] - edges[::2]).tolist()


@cocotb.test()
async def a_stop_leaves_no_runt(dut) -> None:
    """Stopped all over a period, in every state: the last pulse is as long as all are."""
    bench = await Bench.fresh(dut)
    settings = with_changes(sweep_word=1 << 39, work_word=1 << 39, settle_timeout=3000)
    slow = dataclasses.replace(settings, work_word=(1 << 39) - 1, sweep_rate=0)
    period = 1 << 47 - 39
    length = 1 << 6  # a duty of a quarter
    for chosen, state in ((slow, SWEEP), (settings, SETTLE), (settings, RUN)):
        chosen = dataclasses.replace(chosen, duty=1 << 14)
        for moment in range(0, period + 3, rounds(5, 1) if state == RUN else 23):
            await bench.into(SETTLE if state == RUN else state, chosen)
            if state == RUN:
                await bench.clocks(period // 2)  # not within a pulse: the wave has whole ones
                await bench.until(RUN, index_alive=True, settled=True)
            wave = [bench.twin.drive]
            level = bench.twin.level
            for k in range(moment + 2 * period):
                name = bench.twin.state
                # What comes behind the stop's request does not count: it is on again at once.
                again = 0 if name == OFF else k > moment
                lost = {"level": 5, "trim": 5, "index_alive": 0, "settled": 1} if again else {}
                before = bench.twin.state
                await bench.clocks(enable=k < moment or again, **lost)
                wave.append(bench.twin.drive)
                assert bench.twin.state in (OFF, name)
                assert bench.twin.level == (0 if bench.twin.state == OFF else level)
                if bench.twin.state == OFF:
                    assert not bench.twin.drive
                    assert before != OFF or not bench.twin.phase
            assert bench.twin.state == OFF
            assert set(pulses(wave)) <= {length}, f"stopped after {moment} clocks"


@cocotb.test()
async def a_pulse_that_does_not_end_is_cut_off(dut) -> None:
    """With a word of zero the phase stands: the drive is high until the stop gives up."""
    stop_clks = 1 << parameters()["StopWidth"]
    bench = await Bench.fresh(dut)
    await bench.into(RUN, with_changes(sweep_word=0, work_word=0))
    await bench.clocks(100)
    assert bench.twin.phase == 0 and bench.twin.drive
    if stop_clks > 1000:
        await bench.clocks(1000, enable=False)
        assert bench.twin.drive
        return
    await bench.clocks(stop_clks + 1, enable=False)
    assert bench.twin.drive and bench.twin.state == RUN
    await bench.clocks()
    assert not bench.twin.drive and bench.twin.state == OFF


@cocotb.test()
async def words_at_their_limits(dut) -> None:
    """The largest word, and trims that would leave the format on either side."""
    bench = await Bench.fresh(dut)
    for work, trim, want in (
        (WORD_MAX, 0, WORD_MAX),
        (WORD_MAX, 1, WORD_MAX),
        (WORD_MAX - 5, 5, WORD_MAX),
        (WORD_MAX - 5, 6, WORD_MAX),
        (WORD_MAX, -1, WORD_MAX - 1),
        (WORD_MAX, (1 << 31) - 1, WORD_MAX),
        (0, -1, 0),
        (5, -5, 0),
        (5, -6, 0),
        (0, -1 << 31, 0),
        (0, 1, 1),
    ):
        await bench.into(SETTLE, with_changes(work_word=work, sweep_word=work))
        await bench.clocks(300, trim=trim)
        assert bench.twin.word == want


@cocotb.test()
async def duty_counts_65536ths(dut) -> None:
    """Of a whole period of the drive exactly duty / 65536 are high, at most the ceiling."""
    bench = await Bench.fresh(dut)
    most = parameters().get("DutyCeiling", DUTY_CEILING)
    for duty in (0, 1 << 7, 3 << 13, 65535):
        settings = with_changes(sweep_word=1 << 39, work_word=1 << 39, duty=duty)
        await bench.into(SETTLE, settings)
        high = 0
        for _ in range(256):
            await bench.clocks()
            high += bench.twin.drive
        # 65535 is high on all phases of this word but none: the low part is less than a step.
        assert high == -(-min(duty, most) // 256)


@EACH_VOLUME
@pytest.mark.parametrize("widths", ELABORATIONS, ids=str)
def test_mirror_drive_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("mirror_drive", __file__, widths, volume=volume)


# ---- the model alone ----


def test_a_step_of_the_drive_is_below_a_microhertz() -> None:
    """The mirror's frequency, the drive being at twice of it."""
    step = CLOCK_HZ / 2**pkg.TURN_WIDTH
    print(f"\nstep of the drive: {2 * step:.3g} Hz, of the mirror: {step:.3g} Hz; aim 1e-6 Hz")
    assert 2 * step < 1e-6
    twins = []
    for word in (560_000_000, 560_000_001):
        settings = with_changes(sweep_word=word, work_word=word, sweep_timeout=NEVER)
        twin = MirrorDrive(settings)
        twin.step(**QUIET)
        for _ in range(4):
            twin.step(**QUIET | {"enable": True})
        # Runs on in SETTLE for ten seconds.
        twin.settings = dataclasses.replace(settings, settle_timeout=NEVER)
        left = int(10 * CLOCK_HZ)
        while left:
            count = min(twin.idle(**QUIET | {"enable": True}), left)
            twin.skip(count, **QUIET | {"enable": True})
            left -= count
            if left:
                twin.step(**QUIET | {"enable": True})
                left -= 1
        twins.append(twin)
    apart = (twins[1].phase - twins[0].phase) % 2**pkg.TURN_WIDTH / 2**pkg.TURN_WIDTH
    assert apart == pytest.approx(10 * step, rel=1e-6)


def test_the_drive_is_at_twice_the_mirrors_frequency() -> None:
    """At 249 Hz, duty a half: 996 edges a second, after a sweep at 10 Hz a second from 251 Hz."""
    word = round(249 / CLOCK_HZ * 2**pkg.TURN_WIDTH)
    settings = Settings(
        sweep_word=round(251 / CLOCK_HZ * 2**pkg.TURN_WIDTH),
        work_word=word,
        sweep_rate=round(10 / CLOCK_HZ**2 * 2 ** (pkg.TURN_WIDTH + 16)),
        duty=1 << 15,
        sweep_level=1 << 19,
        sweep_timeout=NEVER,
        settle_timeout=NEVER,
        lost_timeout=0,
    )
    twin = MirrorDrive(settings)
    inputs = QUIET | {"enable": True, "level": 1 << 18}
    now = 0
    edges, steps = [], 0
    swept = 0
    while now < 0.5 * CLOCK_HZ:
        before = twin.drive
        count = twin.idle(**inputs)
        twin.skip(count, **inputs)
        twin.step(**inputs)
        now += count + 1
        steps += 1
        if twin.drive != before:
            edges.append(now)
        if twin.state == SETTLE and not swept:
            swept = now
    # The rate's rounding, and the word's, which falls in whole clocks.
    assert swept / CLOCK_HZ == pytest.approx(0.2, rel=1e-3)
    settled = np.array([edge for edge in edges if edge > swept + CLOCK_HZ / 200])
    period = (settled[-1] - settled[0]) / (len(settled) - 1)
    assert period == pytest.approx(CLOCK_HZ / (4 * 249), abs=1.0)
    # From the first edge to the sweep's end the phase is the integral of the frequency.
    before = sum(edge < swept for edge in edges) / 4
    assert before == pytest.approx(0.2 * 250, abs=0.5)
    print(f"\n{steps} steps for half a second of mirror time")
    assert steps < 20 * len(edges)


def test_skipping_is_stepping() -> None:
    """At random moments of random runs, with random settings: all of the state is the same."""
    draw = generator(5)
    skipped = 0
    for _ in range(60):
        settings = random_settings(draw)
        if draw.random() < 0.5:
            # Slower: thousands of clocks between two edges.
            settings = dataclasses.replace(
                settings,
                sweep_word=settings.sweep_word >> 8,
                work_word=settings.work_word >> 8,
                sweep_rate=settings.sweep_rate >> 8,
            )
        stepped, jumper = MirrorDrive(settings, 6), MirrorDrive(settings, 6)
        inputs = random_inputs(draw, QUIET)
        for _ in range(400):
            for _ in range(int(draw.integers(1, 4))):
                inputs = random_inputs(draw, inputs)
            most = jumper.idle(**inputs)
            assert 0 <= most <= MOST_IDLE
            count = min(most, int(draw.integers(300)))
            before = {name: getattr(jumper, name) for name in ("state", "drive", "level", "fault")}
            jumper.skip(count, **inputs)
            for _ in range(count):
                stepped.step(**inputs)
            assert vars(stepped) == vars(jumper)
            assert before == {name: getattr(jumper, name) for name in before}
            for _ in range(int(draw.integers(1, 4))):
                stepped.step(**inputs)
                jumper.step(**inputs)
            skipped += count
    assert skipped > 50_000


def test_floor_sum_is_the_sum() -> None:
    """Against the sum term by term, negative slopes and offsets too."""
    draw = generator(6)
    for _ in range(2000):
        count, denominator = int(draw.integers(40)), int(draw.integers(1, 50))
        slope, offset = (int(v) for v in draw.integers(-99, 100, size=2))
        want = sum((slope * k + offset) // denominator for k in range(count))
        assert floor_sum(count, slope, offset, denominator) == want


def test_the_wave_is_the_phase_two_clocks_before() -> None:
    """The wave of a clock belongs to the phase of DRIVE_LATENCY clocks before."""
    twin = MirrorDrive(QUICK)
    twin.step(**QUIET)
    phases = []
    for k in range(500):
        twin.step(**QUIET | {"enable": True})
        phases.append(twin.phase)
        if k >= 20:
            half = phases[-1 - DRIVE_LATENCY] * 2 % 2**pkg.TURN_WIDTH
            assert twin.drive == (half / 2**pkg.TURN_WIDTH < QUICK.duty / 2**16)
