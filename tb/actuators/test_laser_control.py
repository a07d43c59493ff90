"""laser_control: every clock of the RTL against the model; a line's power, and the loop."""

import dataclasses
import functools
import itertools
import math
import re

import cocotb
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    as_integer,
    generator,
    parameters,
    rounds,
    simulate,
)
from laser_bench import (
    LOW,
    OFF,
    OPEN,
    POINT,
    POWER_MAX,
    RUN,
    SETTLE,
    LightBench,
    Scene,
    ceilings,
    count_width,
    pixel,
    random_settings,
)

from vrscan.clocked.guard_watch import BEAT_LATENCY
from vrscan.clocked.laser_control import LaserControl
from vrscan.clocked.laser_interlock import LaserInterlock
from vrscan.engines.tools import repository_root
from vrscan.registers.settings import LaserSettings

ELABORATIONS = [{"PixelWidth": 16, "HeartbeatBits": 1, "GuardBeatClks": 9, **LOW}, {}]
QUIET = {
    "pulse": 0,
    "line_start": 0,
    "centre": 0,
    "state": OFF,
    "index_alive": 0,
    "scanning": 1,
    "startup_ok": 1,
    "phase": 0x2000,
    "alive": 0,
    "guard_ok": 1,
    "guard_beat": 0,
    "guard_fault": 0,
    **POINT,
}
OUTPUTS = {
    "power": "interlock.power",
    "power_pin": "power_pin.pin",
    "index_light": "interlock.index_light",
    "startup": "interlock.startup",
    "startup_pin": "startup_pin.pin",
    "heartbeat": "heartbeat",
    "laser_status": "interlock.status",
    "laser_power_inward": "adaptation.inward_power",
    "laser_power_outward": "adaptation.outward_power",
    "laser_cut_count": "interlock.cut_count",
    "laser_duty_count": "interlock.duty_count",
    "laser_watchdog_count": "interlock.watchdog_count",
    "laser_guard_fault": "guard.fault",
    "laser_guard_count": "guard.trip_count",
}
with_changes = functools.partial(dataclasses.replace, OPEN)


def heartbeat_bits() -> int:
    """Return the parameter of the running elaboration."""
    return parameters().get("HeartbeatBits", 5)


class Bench(LightBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("line_start", "centre", "alive", "point_valid")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET, OUTPUTS)
        self.guard_lives = True

    @property
    def interlock(self) -> LaserInterlock:
        return self.twin.interlock

    def twin_of(self, settings: LaserSettings) -> LaserControl:
        clks = parameters().get("GuardBeatClks", 64)
        return LaserControl(settings, ceilings(), heartbeat_bits(), count_width(), clks)

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks, with the beats of a guard that lives."""
        self.give(**inputs)
        for _ in range(count):
            if self.guard_lives:
                self.give(guard_beat=self.clock // 4 % 2)
            await super().clocks()

    def check_gates(self) -> None:
        super().check_gates()
        dut = self.dut
        want = self.twin.line(**{name: self.inputs[name] for name in ("pulse", "centre", "phase")})
        got = as_integer(dut.power_line_o), as_integer(dut.inward_line_o)
        assert got == want, f"clock {self.clock}, line: {got}, want {want}, {self.inputs}"


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Inputs of every kind with the configuration changed meanwhile, and resets among them."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    seen = set()
    for _ in range(rounds(40, 400)):
        scene = Scene(draw, QUIET)
        await bench.start(random_settings(draw, OPEN), **scene.step())
        for _ in range(int(draw.integers(100, 700))):
            if draw.random() < 0.01 and not bench.twin.adaptation.busy:
                bench.set(random_settings(draw, OPEN))
            if draw.random() < 0.01:
                bench.guard_lives = draw.random() < 0.9
            inputs = scene.step()
            del inputs["guard_beat"]
            await bench.clocks(**inputs)
            seen.add((bench.lit, as_integer(dut.power_line_o) > 0))
    assert {(True, True), (False, True), (False, False)} <= seen


@cocotb.test()
async def the_heart_beats_evenly(dut) -> None:
    """Every 2**HeartbeatBits clocks from the reset on, whatever the light does."""
    bench = await Bench.fresh(dut)
    await bench.into_run(OPEN)
    period = 1 << heartbeat_bits()
    for _ in range(4 * period):
        await bench.clocks()
        assert as_integer(dut.heartbeat_o) == bench.clock // period % 2


def registers() -> list[str]:
    """Return the registers of the interlock, but for those that only count or tell."""
    text = (repository_root() / "rtl" / "safety" / "laser_interlock.sv").read_text()
    found = set(re.findall(r"^ +(\w+_q|power_o|startup_o|index_light_o) +<=", text, re.MULTILINE))
    assert len(found) > 20
    return sorted(found - {"scan_q", "guard_q", "full_before_q"})


@cocotb.test()
async def a_flip_flop_that_sticks_stops_the_beats(dut) -> None:
    """Of each register of either interlock, at 0 and at 1, where it should have had the other.

    The light still needs the other interlock's permission.
    """
    if heartbeat_bits() > 1:
        pytest.skip("the beats are too slow")
    draw = generator(2)
    bench = await Bench.fresh(dut)
    settings = with_changes(limit_pulse_clks=6, watchdog_clks=400)
    mattered = set()
    for name, stuck, copy in itertools.product(registers(), (0, 1), ("laser", "second")):
        scene = Scene(draw, QUIET)
        scene.inputs |= {"state": RUN, "index_alive": 1, "alive": 1}
        await bench.start(settings)
        register = getattr(getattr(dut, f"u_{copy}_interlock"), name)
        other = dut.u_second_interlock if copy == "laser" else dut.u_laser_interlock
        bit = 0 if copy == "laser" else int(draw.integers(min(len(register), 6)))
        mask = 1 << bit
        wrong, beats, before = False, 0, 0
        for k in range(1000):
            inputs = scene.step() | {"guard_beat": k // 4 % 2, "guard_ok": 1, "guard_fault": 0}
            bench.give(**inputs | ({"alive": 0} if k > 500 else {}))
            await FallingEdge(dut.clk_i)
            value = as_integer(register)
            held = value | mask if stuck else value & ~mask
            wrong = wrong or (held != value and k < 900)
            register.value = held
            beats += k > 910 and as_integer(dut.heartbeat_o) != before
            before = as_integer(dut.heartbeat_o)
            assert as_integer(other.pulse_o) or not as_integer(dut.pulse_o)
        assert beats == 0 if wrong else beats > 40, f"{copy}: {name}, {mask:#x} at {stuck}: {beats}"
        mattered |= {name} if wrong else set()
    missing = sorted(set(registers()) - mattered)
    assert not missing


@cocotb.test()
async def a_guard_without_a_clock_is_missed(dut) -> None:
    """Its last beat and GuardBeatClks later the light is off, whatever it said last."""
    bench = await Bench.fresh(dut)
    await bench.into_run(with_changes(limit_pulse_clks=1000))
    bench.guard_lives = False
    for k in range(parameters().get("GuardBeatClks", 64) + BEAT_LATENCY + 2):
        await bench.clocks(alive=1, phase=0x4000)
        shone = bench.interlock.permit
        assert shone or k > 3
    assert not shone and as_integer(dut.index_light_o) == 0 and bench.interlock.power == 0


@cocotb.test()
async def a_cut_line_has_no_power(dut) -> None:
    """A pulse that is cut behind its centre says 0; the whole one before and after its power."""
    bench = await Bench.fresh(dut)
    await bench.into_run(with_changes(limit_pulse_clks=8, power=5_000))
    for clks, said in ((8, 5_000), (9, 0), (13, 0), (8, 5_000), (40, 0), (2, 5_000)):
        await bench.line(clks, period=60)
        assert int(dut.power_line_o.value) == said, clks
    await bench.line(8, state=SETTLE)
    assert int(dut.power_line_o.value) == 0


@cocotb.test()
async def the_direction_goes_with_the_line(dut) -> None:
    """Of the clock of the centre: the first half of the turn is inward."""
    bench = await Bench.fresh(dut)
    await bench.into_run(OPEN)
    for phase, inward in ((0, 1), (0x7FFF, 1), (0x8000, 0), (0xFFFF, 0)):
        await bench.clocks(centre=1, phase=phase)
        await bench.clocks(5, phase=0x4000 if not inward else 0xC000)
        assert int(dut.inward_line_o.value) == inward


@cocotb.test()
async def a_new_power_comes_in_the_second_clock_after_a_request(dut) -> None:
    """Within a pulse nothing moves."""
    bench = await Bench.fresh(dut)
    await bench.into_run(with_changes(adapt=0))
    await bench.clocks(pulse=1)
    bench.set(with_changes(power=1_000))
    await bench.clocks(6)
    assert bench.interlock.power == OPEN.power
    await bench.clocks(pulse=0)
    assert bench.interlock.power == OPEN.power
    await bench.clocks()
    assert bench.interlock.power == 1_000


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
    bench = await Bench.fresh(dut)
    settings = with_changes(
        adapt=1,
        power_min=POWER_MAX // RANGE,
        limit_power=POWER_MAX,
        limit_bucket=(1 << 32) - 1,
        limit_drain=POWER_MAX,
        watchdog_clks=0,
        limit_pulse_clks=4,
    )
    top = ceilings().power
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
                    pulse=j < 2,
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
@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["low", "shipped"])
def test_rtl(elaboration: dict[str, int], volume: str) -> None:
    """Every elaboration runs every test above."""
    held = [("laser_interlock", "*")]
    simulate("laser_control", __file__, elaboration, volume=volume, visible=held)
