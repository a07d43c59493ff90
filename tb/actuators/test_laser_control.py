"""laser_control: every clock of the RTL against the model; limits, interlock and power by name."""

import dataclasses
import math

import cocotb
import numpy as np
import pytest
from cocotb.triggers import Timer
from harness import (
    EACH_VOLUME,
    TwinBench,
    as_integer,
    drive,
    generator,
    parameters,
    port,
    reset,
    rounds,
    simulate,
)

from vrscan.clocked.laser_control import (
    BUCKET_MARGIN,
    FACTOR_MAX,
    GUARD_LATENCY,
    INTERLOCK_LATENCY,
    LIMIT_LATENCY,
    POWER_LATENCY,
    WATCHDOG_LATENCY,
    WIDTHS,
    WINDOW_LATENCY,
    Ceilings,
    LaserControl,
    Settings,
    next_power,
)
from vrscan.clocked.laser_control import port as register_name
from vrscan.data import pkg

OFF, SWEEP, SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
RUN, FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT
STATES = (OFF, SWEEP, SETTLE, RUN, FAULT)
POWER_MAX = (1 << pkg.POWER_WIDTH) - 1

CEILINGS = {
    "PowerCeiling": "power",
    "StartupCeiling": "startup",
    "PulseCeilingClks": "pulse_clks",
    "DrainCeiling": "drain",
    "BucketCeiling": "bucket",
    "WatchdogCeilingClks": "watchdog_clks",
}
# Where the ceilings are met often, and without them: those of the parameters' ranges.
LOW = {
    "PixelWidth": 16,
    "CountWidth": 3,
    "HeartbeatBits": 1,
    "PowerCeiling": 40_000,
    "StartupCeiling": 300,
    "PulseCeilingClks": 12,
    "DrainCeiling": 9_000,
    "BucketCeiling": 600_000,
    "WatchdogCeilingClks": 150,
}
HIGH = {
    "PixelWidth": 9,
    "HeartbeatBits": 9,
    "PowerCeiling": 65_535,
    "StartupCeiling": 65_535,
    "PulseCeilingClks": (1 << 20) - 2,
    "DrainCeiling": 65_535,
    "BucketCeiling": (1 << 31) - 1,
    "WatchdogCeilingClks": (1 << 31) - 1,
}
ELABORATIONS = [LOW, HIGH, {}]

OPEN = Settings(
    enable=1,
    power=20_000,
    power_min=240,
    power_max=POWER_MAX,
    startup=250,
    target=1 << 15,
    cut=1 << 12,
    down=1 << 13,
    up=3 << 12,
    search=1 << 13,
    index_begin=0xF000,
    index_end=0x1000,
    limit_power=30_000,
    limit_startup=280,
    limit_pulse_clks=10,
    limit_drain=8_000,
    limit_bucket=580_000,
    watchdog_clks=140,
)
QUIET: dict[str, int] = {
    "laser": 0,
    "line_start": 0,
    "centre": 0,
    "state": OFF,
    "index_alive": 0,
    "phase": 0x2000,
    "alive": 0,
    "guard_ok": 1,
    "point_valid": 0,
    "point_measured": 0,
    "point_saturated": 0,
    "point_maximum": 0,
    "point_background": 0,
    "point_power": 0,
    "point_inward": 0,
    "point_test": 0,
}
BITS = tuple(
    name
    for name in QUIET
    if name not in ("state", "phase", "point_maximum", "point_background", "point_power")
)
REGISTERS = (
    "power",
    "power_pin",
    "index_light",
    "startup",
    "startup_pin",
    "heartbeat",
)
STATUS = {
    "status": "status",
    "power_inward": "power_inward",
    "power_outward": "power_outward",
    "cut_count": "cut_count",
    "duty_count": "duty_count",
    "watchdog_count": "watchdog_count",
}


# Where the inputs of the twin are: the fields of the point, and how far up.
POINT = {
    "point_measured": ("measured", 0),
    "point_saturated": ("flags", pkg.FLAG_SATURATED),
    "point_background": ("background", pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH),
    "point_power": ("line.power", 0),
    "point_inward": ("line.inward", 0),
    "point_test": ("line.test", 0),
}


def spare() -> int:
    """Return the bits by which a pixel is narrower than a height."""
    return pkg.ALIGNED_WIDTH - parameters().get("PixelWidth", 12)


def pixel(height: int) -> int:
    """Return the largest height of a pixel up to the given one."""
    return height >> spare() << spare()


def with_changes(**changes: int) -> Settings:
    """Return the open settings but for what is given."""
    return dataclasses.replace(OPEN, **changes)


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("line_start", "centre", "alive", "point_valid")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        given = parameters()
        self.ceilings = Ceilings(**{CEILINGS[k]: v for k, v in given.items() if k in CEILINGS})
        self.bits = {
            "heartbeat_bits": given.get("HeartbeatBits", 5),
            "count_width": given.get("CountWidth", 16),
        }
        self.settings: Settings | None = None
        self.lit = False  # the main channel in the last clock
        self.shown = 0  # its level
        self.registers = [(n, port(dut, f"{n}_o")) for n in REGISTERS]
        self.registers += [(n, port(dut, f"{register_name(p)}_o")) for p, n in STATUS.items()]

    def on_port(self, name: str, value: int) -> tuple[str, int]:
        if name == "point_maximum":
            return "maximum", value >> spare()
        place, shift = POINT.get(name, ("pulse" if name == "laser" else name, 0))
        return place, int(value) << shift

    def set(self, settings: Settings) -> None:
        """Change the configuration."""
        for name, value in settings.ports.items():
            if self.settings is None or self.settings.ports[name] != value:
                drive(port(self.dut, f"{name}_i"), value)
        self.settings = settings
        if self.twin is not None:
            self.twin.settings = settings

    async def start(self, settings: Settings = OPEN, **inputs: int) -> None:
        """Set the configuration and reset for a clock, with these inputs."""
        self.set(settings)
        await self.reset_to(LaserControl(settings, self.ceilings, **self.bits), **(QUIET | inputs))
        self.lit = False
        self.check()

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks with these inputs, and look at the gates before each edge."""
        self.give(**inputs)
        for _ in range(count):
            await Timer(1, "ns")
            self.check_gates()
            self.lit = bool(self.dut.pulse_o.value)
            self.shown = self.twin.power
            await super().clocks()

    def check(self) -> None:
        """Compare all registers."""
        twin, inputs = self.twin, self.inputs
        for name, handle in self.registers:
            got, want = as_integer(handle), int(getattr(twin, name))
            assert got == want, f"clock {self.clock}, {name}: {got}, want {want}, {inputs}"

    def check_gates(self) -> None:
        """Compare what hangs on an input of the same clock."""
        twin, dut, inputs = self.twin, self.dut, self.inputs
        power, inward = twin.line(
            laser=inputs["laser"], centre=inputs["centre"], phase=inputs["phase"]
        )
        want = (int(twin.pulse(laser=inputs["laser"])), power, int(inward))
        got = tuple(int(p.value) for p in (dut.pulse_o, dut.power_line_o, dut.inward_line_o))
        assert got == want, f"clock {self.clock}, pulse, line: {got}, want {want}, {inputs}"

    async def line(self, clks: int = 4, period: int = 30, **inputs: int) -> list[tuple[int, int]]:
        """Go on by a line with a pulse of some clocks; return pulse and power of each clock."""
        shown = []
        for k in range(period):
            await self.clocks(
                line_start=k == 0,
                laser=k < clks,
                centre=k == clks // 2,
                alive=k == 0,
                **inputs,
            )
            shown.append((int(self.lit), self.shown))
        return shown

    async def into_run(self, settings: Settings = OPEN, **inputs: int) -> None:
        """Reset and go on until pulses are permitted."""
        await self.start(settings)
        for _ in range(3):
            await self.line(0, state=RUN, index_alive=1, **inputs)
        await self.clocks(alive=1)
        assert self.twin.permit


async def begin(dut) -> Bench:
    """Return a bench after its reset."""
    await reset(dut)
    return Bench(dut)


def random_settings(draw: np.random.Generator, ceilings: Ceilings) -> Settings:
    """Return settings, often open ones, often with a value at an end of its range."""
    values = dict(vars(OPEN))
    for name in values:
        width = WIDTHS.get(name, 16)
        if draw.random() < 0.25:
            values[name] = int(draw.choice([0, 1, (1 << width) - 1, draw.integers(1 << width)]))
    values["enable"] = int(draw.random() < 0.95)
    values["adapt"] = int(draw.random() < 0.7)
    if draw.random() < 0.8:
        values["limit_bucket"] = min(ceilings.bucket, int(draw.integers(300_000, 900_000)))
    if draw.random() < 0.8:
        values["limit_pulse_clks"] = int(draw.integers(1, 20))
    if draw.random() < 0.8:
        values["watchdog_clks"] = int(draw.integers(20, 200))
    return Settings(**values)


class Scene:
    """Draws inputs that reach every state: lines with pulses, a host, a mirror, points."""

    def __init__(self, draw: np.random.Generator) -> None:
        self.draw = draw
        self.inputs = dict(QUIET)
        self.line = 0

    def step(self) -> dict[str, int]:
        """Return the inputs of the next clock."""
        draw, inputs = self.draw, self.inputs
        chance = draw.random(8)
        if chance[0] < 0.01:
            weights = (0.05, 0.1, 0.1, 0.7, 0.05)
            inputs["state"] = int(draw.choice(STATES, p=weights))
        if chance[1] < 0.01:
            inputs["index_alive"] = int(draw.random() < 0.9)
        if chance[2] < 0.004:
            inputs["guard_ok"] = int(draw.random() < 0.8)
        inputs["alive"] = int(chance[3] < 0.02)
        if not inputs["laser"]:
            inputs["laser"] = int(chance[4] < 0.15)
        else:
            inputs["laser"] = int(chance[4] < 0.85)
        inputs["centre"] = int(chance[5] < (0.2 if inputs["laser"] else 0.02))
        inputs["line_start"] = int(chance[6] < 0.1)
        inputs["phase"] = (inputs["phase"] + int(draw.integers(900))) % (1 << 16)
        inputs["point_valid"] = 0
        if chance[7] < 0.04:
            height = int(draw.choice([0, 100, 1 << 15, POWER_MAX, draw.integers(1 << 16)]))
            inputs |= {
                "point_valid": 1,
                "point_measured": int(draw.random() < 0.7),
                "point_saturated": int(draw.random() < 0.2),
                "point_maximum": pixel(height),
                "point_background": int(draw.choice([0, 500, draw.integers(1 << 16)])),
                "point_power": int(draw.choice([0, 1, 300, POWER_MAX, draw.integers(1 << 16)])),
                "point_inward": int(draw.integers(2)),
                "point_test": int(draw.random() < 0.1),
            }
        return inputs


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Inputs of every kind with the configuration changed meanwhile, and resets among them."""
    draw = generator(1)
    bench = await begin(dut)
    seen = set()
    counts = np.zeros(3, dtype=int)
    for _ in range(rounds(40, 400)):
        scene = Scene(draw)
        await bench.start(random_settings(draw, bench.ceilings), **scene.step())
        for _ in range(int(draw.integers(100, 700))):
            if draw.random() < 0.01 and not bench.twin.busy:
                bench.set(random_settings(draw, bench.ceilings))
            await bench.clocks(**scene.step())
            twin = bench.twin
            seen.add((bench.lit, twin.index_light, bench.inputs["state"]))
        counts += (twin.cut_count, twin.duty_count, twin.watchdog_count)
    assert {
        (True, True, RUN),
        (True, False, RUN),
        (False, True, SWEEP),
        (False, True, SETTLE),
    } <= seen
    assert np.all(counts[[0, 2]] > 5), counts
    assert counts[1] > 5 or bench.ceilings.bucket > 10**6, counts


@cocotb.test()
async def pulses_begin_a_line_after_everything_is_well(dut) -> None:
    """Not in the line in which the level comes up; then every one of them, whole."""
    bench = await begin(dut)
    await bench.start()
    for k in range(6):
        shown = await bench.line(4, state=RUN, index_alive=1)
        lit = [pulse for pulse, _ in shown]
        assert lit == ([1, 1, 1, 1] if k >= 3 else [0] * 4) + [0] * 26, k
        assert bench.twin.power == OPEN.power
        power, _ = bench.twin.line(laser=False, centre=False, phase=0)
        assert power == (OPEN.power if k >= 3 else 0)


@cocotb.test()
async def every_interlock_turns_the_main_channel_off(dut) -> None:
    """In the clock after, within a pulse, and it does not come back within the request."""
    bench = await begin(dut)
    for latency, bad, good in (
        *((INTERLOCK_LATENCY, {"state": s}, {"state": RUN}) for s in STATES if s != RUN),
        (INTERLOCK_LATENCY, {"index_alive": 0}, {"index_alive": 1}),
        (GUARD_LATENCY, {"guard_ok": 0}, {"guard_ok": 1}),
        (INTERLOCK_LATENCY, {"enable": 0}, {"enable": 1}),
    ):
        await bench.into_run(with_changes(limit_pulse_clks=12))
        await bench.clocks(2, laser=1)
        assert bench.lit and bench.twin.power == OPEN.power
        if "enable" in bad:
            bench.set(with_changes(enable=0, limit_pulse_clks=12))
            bad, good = {}, {}
        for k in range(latency + 1):
            await bench.clocks(**bad)
            assert bench.lit == (k < latency)
        assert bench.twin.power == 0
        assert bench.twin.index_light == (
            bench.inputs["state"] in (SWEEP, SETTLE) if bench.inputs["state"] != RUN else False
        )
        bench.set(with_changes(limit_pulse_clks=12))
        await bench.clocks(8, **good, line_start=1)
        assert not bench.lit


@cocotb.test()
async def a_stopped_mirror_has_no_pulse(dut) -> None:
    """The index is away, then the drive at fault: first no pulse, then no light at all."""
    bench = await begin(dut)
    await bench.into_run(phase=0)
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
    bench = await begin(dut)
    ceiling = bench.ceilings.pulse_clks
    for limit in (0, 1, 2, 7, min(ceiling, 30), min(ceiling + 1, 31), min(ceiling + 100, 32)):
        most = min(limit, ceiling)
        settings = with_changes(limit_pulse_clks=limit, limit_bucket=(1 << 32) - 1, power=1)
        await bench.start(settings)
        for _ in range(3):
            await bench.line(0, state=RUN, index_alive=1)
        await bench.clocks(alive=1)
        for length in (max(most - 1, 1), max(most, 1), most + 1, most + 40):
            before = bench.twin.cut_count
            lit = []
            for k in range(length):
                await bench.clocks(laser=1, alive=1, centre=k == length // 2)
                lit.append(bench.lit)
            assert lit == [k < most for k in range(length)], (limit, length)
            await bench.clocks(2, laser=0)
            cut = most and length > most and before < (1 << bench.bits["count_width"]) - 1
            assert bench.twin.cut_count == before + bool(cut), (limit, length)


@cocotb.test()
async def a_cut_line_has_no_power(dut) -> None:
    """A pulse that is cut behind its centre says 0; the whole one before and after its power."""
    bench = await begin(dut)
    await bench.into_run(with_changes(limit_pulse_clks=8, power=5_000))
    for clks, said in ((8, 5_000), (9, 0), (13, 0), (8, 5_000), (40, 0), (2, 5_000)):
        await bench.line(clks, period=60)
        assert int(dut.power_line_o.value) == said, clks
    await bench.line(8, state=SETTLE)
    assert int(dut.power_line_o.value) == 0


@cocotb.test()
async def the_direction_goes_with_the_line(dut) -> None:
    """Of the clock of the centre: the first half of the turn is inward."""
    bench = await begin(dut)
    await bench.into_run()
    for phase, inward in ((0, 1), (0x7FFF, 1), (0x8000, 0), (0xFFFF, 0)):
        await bench.clocks(centre=1, phase=phase)
        await bench.clocks(5, phase=0x4000 if not inward else 0xC000)
        assert int(dut.inward_line_o.value) == inward


@cocotb.test()
async def the_bucket_bounds_the_energy(dut) -> None:
    """Over every stretch of time at most the bucket and what drained; dark until it is empty."""
    bench = await begin(dut)
    draw = generator(2)
    for drain, power in ((3_000, 30_000), (0, 20_000), (8_000, 8_000), (8_000, 30_000)):
        settings = with_changes(
            limit_drain=drain, power=power, limit_bucket=580_000, limit_pulse_clks=12
        )
        await bench.into_run(settings)
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
    bench = await begin(dut)
    for bucket, lit in ((0, 0), (BUCKET_MARGIN - 1, 0), (BUCKET_MARGIN, 1)):
        await bench.start(with_changes(limit_bucket=bucket))
        for _ in range(3):
            await bench.line(0, state=RUN, index_alive=1)
        shown = await bench.line(4)
        assert (sum(pulse for pulse, _ in shown) > 0) == lit


@cocotb.test()
async def a_silent_host_gets_no_light(dut) -> None:
    """In the stated clock; and only after laser_enable_i was low."""
    bench = await begin(dut)
    if bench.ceilings.watchdog_clks > 10**6:
        limits: tuple[int, ...] = (1, 40)
    else:
        limits = (1, 40, 0, bench.ceilings.watchdog_clks, (1 << 32) - 1)
    for limit in limits:
        clks = min(limit or bench.ceilings.watchdog_clks, bench.ceilings.watchdog_clks)
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
    """On in SWEEP and SETTLE, in RUN within its window alone, never above its limit."""
    bench = await begin(dut)
    ceiling = bench.ceilings.startup
    for startup, limit in ((250, 280), (280, 250), (POWER_MAX, POWER_MAX), (0, 5)):
        await bench.start(with_changes(startup=startup, limit_startup=limit))
        await bench.clocks(4, alive=1)
        for state in STATES:
            await bench.clocks(4, state=state, alive=1)
            on = state in (SWEEP, SETTLE)
            assert bench.twin.index_light == on
            assert bench.twin.startup == (min(startup, limit, ceiling) if on or state == RUN else 0)
            assert not bench.lit
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
    bench = await begin(dut)
    await bench.into_run()
    await bench.clocks(2, laser=1)
    assert bench.twin.power == 20_000
    bench.set(with_changes(limit_power=77))
    await bench.clocks(LIMIT_LATENCY - 1)
    assert bench.twin.power == 20_000
    await bench.clocks()
    assert bench.twin.power == 77 and bench.lit
    await bench.into_run(with_changes(power=POWER_MAX, limit_power=POWER_MAX))
    assert bench.twin.power == bench.ceilings.power


@cocotb.test()
async def the_power_stands_from_pulse_to_pulse(dut) -> None:
    """A new one comes in the second clock after a request; within a pulse nothing moves."""
    bench = await begin(dut)
    await bench.into_run(with_changes(adapt=0))
    await bench.clocks(laser=1)
    bench.set(with_changes(power=1_000))
    await bench.clocks(6)
    assert bench.twin.power == 20_000
    await bench.clocks(laser=0)
    assert bench.twin.power == 20_000
    await bench.clocks()
    assert bench.twin.power == 1_000
    bench.set(with_changes(power=2_000))
    await bench.clocks(5, alive=1)
    assert bench.twin.power == 1_000


@cocotb.test()
async def pins_are_high_in_proportion(dut) -> None:
    """Of 2**16 clocks as many as the level says."""
    bench = await begin(dut)
    if bench.ceilings != Ceilings():
        return
    await bench.into_run(with_changes(power=12_345, watchdog_clks=0))
    high = np.zeros(2, dtype=int)
    beats = []
    for _ in range(1 << 16):
        await bench.clocks()
        high += (int(dut.power_pin_o.value), int(dut.startup_pin_o.value))
        beats.append(int(dut.heartbeat_o.value))
    assert tuple(high) == (12_345, OPEN.startup)
    assert np.all(np.diff(np.flatnonzero(np.diff(beats))) == 1 << 5)


@cocotb.test()
async def a_point_gives_the_next_power_of_its_direction(dut) -> None:
    """After POWER_LATENCY clocks, of that direction alone, of both where they share one."""
    bench = await begin(dut)
    settings = with_changes(adapt=1)
    height = pixel(9_000)
    point = {"point_valid": 1, "point_measured": 1, "point_maximum": height, "point_power": 3_000}
    want = next_power(settings, 3_000, height, measured=True, saturated=False)
    for shared, inward in ((0, 0), (0, 1), (1, 0), (1, 1)):
        await bench.start(settings)
        bench.set(dataclasses.replace(settings, adapt=0))
        await bench.clocks(2)
        bench.set(dataclasses.replace(settings, shared=shared))
        await bench.clocks(POWER_LATENCY - 1, **point, point_inward=inward)
        assert (bench.twin.power_inward, bench.twin.power_outward) == (OPEN.power,) * 2
        await bench.clocks()
        got = (bench.twin.power_inward, bench.twin.power_outward)
        assert got == tuple(want if shared or inward == side else OPEN.power for side in (1, 0))
        # Nothing comes of a test line, nor of a line without power.
        for silent in ({"point_test": 1}, {"point_power": 0}):
            await bench.clocks(2 * POWER_LATENCY, **(point | silent))
            assert (bench.twin.power_inward, bench.twin.power_outward) == got


@cocotb.test()
async def every_point_gives_the_power_of_the_model(dut) -> None:
    """Extreme gains, heights and limits; a point that comes too early starts anew."""
    draw = generator(3)
    bench = await begin(dut)
    ends = (0, 1, (1 << 15) - 1, 1 << 15, POWER_MAX)
    await bench.start(with_changes(adapt=1))
    for k in range(400):
        values = {}
        for name in ("target", "down", "up", "power_min", "power_max", "cut", "search"):
            width = WIDTHS.get(name, 16)
            value = int(draw.choice([*ends, draw.integers(1 << 16)])) & ((1 << width) - 1)
            values[name] = value if draw.random() < 0.5 else getattr(OPEN, name)
        settings = with_changes(adapt=1, shared=1, **values)
        bench.set(settings)
        power = int(draw.choice([1, POWER_MAX, draw.integers(1, 1 << 16)]))
        maximum, background = (int(draw.choice([*ends, draw.integers(1 << 16)])) for _ in "ab")
        maximum = pixel(maximum)
        measured, saturated = draw.random() < 0.8, draw.random() < 0.1
        if k % 8 == 0:
            await bench.clocks(int(draw.integers(1, 20)), point_valid=1, point_power=5)
        await bench.clocks(
            POWER_LATENCY,
            point_valid=1,
            point_measured=int(measured),
            point_saturated=int(saturated),
            point_maximum=maximum,
            point_background=background,
            point_power=power,
        )
        want = next_power(
            settings,
            power,
            max(maximum - background, 0),
            measured=measured,
            saturated=saturated,
        )
        assert bench.twin.power_inward == want == port(dut, "laser_power_inward_o").value


# The sensor of the closed loop: counts rise with the power up to full scale; a peak below a
# fiftieth of it is lost in the noise.
FULL = POWER_MAX
FAINT = FULL // 50
DELAY = 4  # lines from a pulse to the first one that knows its point: the point comes while the
# level for the third stands already
RANGE = 273  # of powers on real surfaces
LINES = 75  # within which the loop follows a step: half a turn of 150 lines
CLOSE = 0.1  # of the target


def seen(gain: float, power: int) -> dict[str, int]:
    """Return the point of a surface: ``gain`` is aligned counts a power step."""
    height = min(math.floor(gain * power), FULL)
    return {
        "point_measured": int(height >= FAINT),
        "point_saturated": int(height == FULL),
        "point_maximum": pixel(height),
        "point_power": power,
        "point_inward": 1,
    }


def steps() -> list[tuple[float, float]]:
    """Return surfaces before and after: all of the range up and down, and parts of it."""
    dark = OPEN.target / POWER_MAX
    bright = dark * RANGE
    middle = dark * math.sqrt(RANGE)
    return [(dark, bright), (bright, dark), (dark, middle), (middle, bright), (bright, middle)]


@cocotb.test()
async def the_loop_follows_a_step_of_the_surface(dut) -> None:
    """From dark to bright and back over the range of powers, within LINES lines."""
    bench = await begin(dut)
    settings = with_changes(
        adapt=1,
        power_min=POWER_MAX // RANGE,
        limit_power=POWER_MAX,
        limit_bucket=(1 << 32) - 1,
        limit_drain=POWER_MAX,
        watchdog_clks=0,
        limit_pulse_clks=4,
    )
    top = bench.ceilings.power
    for before, after in steps():
        await bench.into_run(settings)
        waiting: list[int] = []
        for k in range(2 * LINES + 10):
            gain = before if k < LINES + 5 else after
            point: dict[str, int] = {}
            if len(waiting) == DELAY - 2:
                power = waiting.pop(0)
                point = seen(gain, power) | {"point_valid": 1}
            # The point comes in the dark part of the line.
            for j in range(30):
                await bench.clocks(
                    line_start=j == 0,
                    laser=j < 2,
                    centre=j == 1,
                    alive=j == 0,
                    phase=0x4000,
                    **(point if j == 5 else {}),
                )
            waiting.append(int(dut.power_line_o.value))
            if k in (LINES, 2 * LINES + 5):
                ideal = min(settings.target / gain, top)
                assert abs(waiting[-1] / ideal - 1) < CLOSE, (before, after, k, waiting, ideal)


@EACH_VOLUME
@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["low", "high", "shipped"])
def test_rtl(elaboration: dict[str, int], volume: str) -> None:
    """Every elaboration runs every test above."""
    simulate("laser_control", __file__, elaboration, volume=volume)


@pytest.mark.parametrize("name", list(vars(OPEN)))
def test_settings_have_widths(name: str) -> None:
    """Each is refused below zero and beyond its width."""
    for value in (-1, 1 << WIDTHS.get(name, 16)):
        with pytest.raises(ValueError, match=name):
            with_changes(**{name: value})


def test_next_power_is_the_formula() -> None:
    """Against the formula of the header in rationals: half a step, and what the factor rounds."""
    draw = generator(4)
    worst = 0.0
    for _ in range(4000):
        power, height = (int(v) for v in draw.integers(0, 1 << 16, 2))
        error = OPEN.target - height
        gain = (OPEN.down if error < 0 else OPEN.up) / 2**13
        exact = power * (1 + gain * error / 2**16)
        got = next_power(
            with_changes(power_min=1), max(power, 1), height, measured=True, saturated=False
        )
        if 1 <= exact <= POWER_MAX:
            worst = max(worst, abs(got - exact))
    bound = 0.5 + POWER_MAX * 2.0**-15
    print(f"next_power: worst {worst:.3f}, bound {bound:.3f}")
    assert bound / 2 < worst <= bound
    assert FACTOR_MAX < 8 << 14
