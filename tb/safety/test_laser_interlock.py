"""laser_interlock: every clock of the RTL against the model; limits and interlock by name."""

import dataclasses
import functools

import cocotb
import numpy as np
import pytest
from harness import EACH_VOLUME, each, generator, rounds, simulate
from laser_bench import (
    FAULT,
    LOW,
    OFF,
    POWER_MAX,
    RUN,
    SETTLE,
    STATES,
    LightBench,
    Scene,
    ceilings,
    count_width,
    part,
    random_settings,
)

from vrscan.clocked.laser_interlock import (
    BUCKET_MARGIN,
    INTERLOCK_LATENCY,
    LIMIT_LATENCY,
    WATCHDOG_LATENCY,
    WINDOW_LATENCY,
    LaserInterlock,
)
from vrscan.registers.settings import InterlockSettings

# Without the ceilings: those of the parameters' ranges.
HIGH = {
    "PowerCeiling": 65_535,
    "StartupCeiling": 65_535,
    "PulseCeilingClks": (1 << 20) - 2,
    "DrainCeiling": 65_535,
    "BucketCeiling": (1 << 31) - 1,
    "WatchdogCeilingClks": (1 << 31) - 1,
}
ELABORATIONS = [LOW, {}, HIGH]
OPEN = part(InterlockSettings)
POWER = 20_000
QUIET = {
    "pulse": 0,
    "power": POWER,
    "line_start": 0,
    "state": OFF,
    "index_alive": 0,
    "scanning": 1,
    "startup_ok": 1,
    "phase": 0x2000,
    "alive": 0,
    "guard_ok": 1,
}
OUTPUTS = (
    *("power", "index_light", "startup", "armed", "status", "signature"),
    *("cut_count", "duty_count", "watchdog_count"),
)
with_changes = functools.partial(dataclasses.replace, OPEN)


class Bench(LightBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("line_start", "alive")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET, {name: name for name in OUTPUTS})

    def twin_of(self, settings: InterlockSettings) -> LaserInterlock:
        return LaserInterlock(settings, ceilings(), count_width())


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Inputs of every kind with the configuration changed meanwhile, and resets among them."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    seen = set()
    counts = np.zeros(3, dtype=int)
    for _ in range(rounds(40, 400)):
        scene = Scene(draw, QUIET)
        await bench.start(random_settings(draw, OPEN), **scene.step())
        for _ in range(int(draw.integers(100, 700))):
            if draw.random() < 0.01:
                bench.set(random_settings(draw, OPEN))
            await bench.clocks(**scene.step())
            twin = bench.twin
            seen.add((bench.lit, twin.index_light, bench.inputs["state"]))
        counts += (twin.cut_count, twin.duty_count, twin.watchdog_count)
    assert {
        (True, True, RUN),
        (True, False, RUN),
        (False, True, SETTLE),
    } <= seen
    assert np.all(counts[[0, 2]] > 5), counts
    assert counts[1] > 5 or ceilings().bucket > 10**6, counts


@cocotb.test()
async def pulses_begin_a_line_after_everything_is_well(dut) -> None:
    """Not in the line in which the level comes up; then every one of them, whole."""
    bench = await Bench.fresh(dut)
    await bench.start(OPEN)
    for k in range(6):
        shown = await bench.line(4, state=RUN, index_alive=1)
        lit = [pulse for pulse, _ in shown]
        assert lit == ([1, 1, 1, 1] if k >= 3 else [0] * 4) + [0] * 26, k
        assert bench.twin.power == POWER


@cocotb.test()
async def every_interlock_turns_the_main_channel_off(dut) -> None:
    """In the clock after, within a pulse, and it does not come back within the request."""
    bench = await Bench.fresh(dut)
    for latency, bad, good in (
        *((INTERLOCK_LATENCY, {"state": s}, {"state": RUN}) for s in STATES if s != RUN),
        (INTERLOCK_LATENCY, {"index_alive": 0}, {"index_alive": 1}),
        (INTERLOCK_LATENCY, {"scanning": 0}, {"scanning": 1}),
        (INTERLOCK_LATENCY, {"guard_ok": 0}, {"guard_ok": 1}),
        (INTERLOCK_LATENCY, {"enable": 0}, {"enable": 1}),
    ):
        await bench.into_run(with_changes(limit_pulse_clks=12))
        await bench.clocks(2, pulse=1)
        assert bench.lit and bench.twin.power == POWER
        if "enable" in bad:
            bench.set(with_changes(enable=0, limit_pulse_clks=12))
            bad, good = {}, {}
        for k in range(latency + 1):
            await bench.clocks(**bad)
            assert bench.lit == (k < latency)
        assert bench.twin.power == 0
        assert bench.twin.index_light == (bench.inputs["state"] == SETTLE)
        bench.set(with_changes(limit_pulse_clks=12))
        await bench.clocks(8, **good, line_start=1)
        assert not bench.lit


@cocotb.test()
async def a_stopped_mirror_has_no_pulse(dut) -> None:
    """The index is away, then the drive at fault: first no pulse, then no light at all."""
    bench = await Bench.fresh(dut)
    await bench.into_run(OPEN, phase=0)
    await bench.line(4)
    assert bench.twin.index_light
    await bench.clocks(INTERLOCK_LATENCY, index_alive=0)
    for _ in range(4):
        shown = await bench.line(4)
        assert sum(pulse for pulse, _ in shown) == 0
        assert bench.twin.index_light and bench.twin.startup == OPEN.startup
    await bench.clocks(INTERLOCK_LATENCY, state=FAULT)
    assert not bench.twin.index_light and not bench.twin.startup
    assert sum(pulse for pulse, _ in await bench.line(4, index_alive=1)) == 0


@cocotb.test()
async def a_pulse_ends_at_its_limit(dut) -> None:
    """The register's, and at the ceiling where that is lower; dark until the request was low."""
    bench = await Bench.fresh(dut)
    ceiling = ceilings().pulse_clks
    for limit in (0, 1, 2, 7, min(ceiling, 30), min(ceiling + 1, 31), min(ceiling + 100, 32)):
        most = min(limit, ceiling)
        settings = with_changes(limit_pulse_clks=limit, limit_bucket=(1 << 32) - 1)
        await bench.start(settings, power=1)
        for _ in range(3):
            await bench.line(0, state=RUN, index_alive=1)
        await bench.clocks(alive=1)
        for length in (max(most - 1, 1), max(most, 1), most + 1, most + 40):
            before = bench.twin.cut_count
            lit = []
            for _ in range(length):
                await bench.clocks(pulse=1, alive=1)
                lit.append(bench.lit)
            assert lit == [k < most for k in range(length)], (limit, length)
            await bench.clocks(2, pulse=0)
            cut = most and length > most and before < (1 << count_width()) - 1
            assert bench.twin.cut_count == before + bool(cut), (limit, length)


@cocotb.test()
async def the_bucket_bounds_the_energy(dut) -> None:
    """Over every stretch of time at most the bucket and what drained; dark until it is empty."""
    bench = await Bench.fresh(dut)
    draw = generator(2)
    for drain, power in ((3_000, 30_000), (0, 20_000), (8_000, 8_000), (8_000, 30_000)):
        settings = with_changes(limit_drain=drain, limit_bucket=580_000, limit_pulse_clks=12)
        await bench.into_run(settings, power=power)
        energy = [0]
        for _ in range(120):
            shown = await bench.line(int(draw.integers(1, 12)), period=14)
            for pulse, level in shown:
                energy.append(energy[-1] + pulse * level)
            assert bench.twin.level <= 580_000
        above = np.array(energy) - drain * np.arange(len(energy))
        # The largest rise of energy less drain, over all stretches.
        assert np.max(above - np.minimum.accumulate(above)) <= 580_000
        full = bench.twin.duty_count
        assert (full > 0) == (power * 6 / 14 > drain)
        if full:
            assert np.max(above - np.minimum.accumulate(above)) > 580_000 - BUCKET_MARGIN - power
        if full and not drain:
            assert sum(pulse for pulse, _ in await bench.line(4)) == 0


@cocotb.test()
async def a_bucket_below_its_margin_lets_nothing_through(dut) -> None:
    """So much is kept for the clocks between light and permission."""
    bench = await Bench.fresh(dut)
    for bucket, lit in ((0, 0), (BUCKET_MARGIN - 1, 0), (BUCKET_MARGIN, 1)):
        await bench.start(with_changes(limit_bucket=bucket))
        for _ in range(3):
            await bench.line(0, state=RUN, index_alive=1)
        shown = await bench.line(4)
        assert (sum(pulse for pulse, _ in shown) > 0) == lit


@cocotb.test()
async def a_silent_host_gets_no_light(dut) -> None:
    """In the stated clock; and only after laser_enable_i was low."""
    bench = await Bench.fresh(dut)
    if ceilings().watchdog_clks > 10**6:
        limits: tuple[int, ...] = (1, 40)
    else:
        limits = (1, 40, 0, ceilings().watchdog_clks, (1 << 32) - 1)
    for limit in limits:
        clks = min(limit or ceilings().watchdog_clks, ceilings().watchdog_clks)
        settings = with_changes(watchdog_clks=limit)
        await bench.start(settings)
        for state in (SETTLE, RUN):
            for _ in range(8):
                await bench.clocks(state=state, index_alive=1, phase=0, alive=1, line_start=1)
            await bench.clocks(alive=1)
            assert bench.twin.index_light
            count = bench.twin.watchdog_count
            for k in range(1, clks + WATCHDOG_LATENCY - 1):
                await bench.clocks()
                assert bench.twin.index_light, (limit, k)
                assert bench.twin.permit == (state == RUN)
            await bench.clocks()
            assert not bench.twin.index_light and not bench.twin.permit
            assert bench.twin.watchdog_count == count + 1
            for _ in range(5):
                await bench.clocks(4, alive=1)
                assert not bench.twin.index_light and not bench.twin.startup
            bench.set(dataclasses.replace(settings, enable=0))
            await bench.clocks(2)
            bench.set(settings)
            for _ in range(3):
                await bench.clocks(alive=1)
            assert bench.twin.index_light


@cocotb.test()
async def the_start_up_channel(dut) -> None:
    """Where permitted: on in SETTLE, in RUN within its window, never above its limit."""
    bench = await Bench.fresh(dut)
    ceiling = ceilings().startup
    for startup, limit in ((250, 280), (280, 250), (POWER_MAX, POWER_MAX), (0, 5)):
        await bench.start(with_changes(startup=startup, limit_startup=limit))
        await bench.clocks(4, alive=1)
        for state in STATES:
            await bench.clocks(4, state=state, alive=1)
            on = state == SETTLE
            assert bench.twin.index_light == on
            assert bench.twin.startup == (min(startup, limit, ceiling) if on or state == RUN else 0)
            assert not bench.lit
            await bench.clocks(INTERLOCK_LATENCY, startup_ok=0)
            assert not bench.twin.index_light and not bench.twin.startup
            await bench.clocks(startup_ok=1)
    for begin_, end in ((0xF000, 0x1000), (0x7000, 0x9000), (5, 5), (5, 4)):
        await bench.start(with_changes(index_begin=begin_, index_end=end), state=RUN)
        await bench.clocks(5, alive=1)
        for edge in (begin_, end, 0, 0x8000):
            for phase in (edge - 1, edge, edge + 1):
                await bench.clocks(WINDOW_LATENCY, phase=phase % 65536, alive=1)
                inside = (phase - begin_) % 65536 < (end - begin_) % 65536
                assert bench.twin.index_light == inside


@cocotb.test()
async def a_limit_that_comes_down_takes_the_power_along(dut) -> None:
    """Within the stated clocks, in the middle of a pulse; a ceiling is met at once."""
    bench = await Bench.fresh(dut)
    await bench.into_run(OPEN)
    await bench.clocks(2, pulse=1)
    assert bench.twin.power == 20_000
    bench.set(with_changes(limit_power=77))
    await bench.clocks(LIMIT_LATENCY - 1)
    assert bench.twin.power == 20_000
    await bench.clocks()
    assert bench.twin.power == 77 and bench.lit
    await bench.into_run(with_changes(limit_power=POWER_MAX), power=POWER_MAX)
    assert bench.twin.power == ceilings().power


@EACH_VOLUME
@pytest.mark.parametrize("elaboration", each(ELABORATIONS), ids=["low", "shipped", "high"])
def test_rtl(elaboration: dict[str, int], volume: str) -> None:
    """Every elaboration runs every test above."""
    simulate("laser_interlock", __file__, elaboration, volume=volume)
