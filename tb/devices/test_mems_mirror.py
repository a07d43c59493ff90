"""mems_mirror: its motion against scipy's, how it starts and falls, shocks, drift and damping."""

import math
from dataclasses import replace

import cocotb
import numpy as np
import pytest
from cocotb.triggers import Timer
from harness import CLOCK_NS, EACH_VOLUME, each, generator, parameters, reset, rounds, simulate

from vrscan.data import pkg
from vrscan.ideal.motion import half_turn_residual
from vrscan.scene.mems_mirror import Mirror, integrate, steady_state, sweep

# Steps of 125 clocks, of one clock, and of a number that divides no half period.
ELABORATIONS = [
    {"ClockHz": 125_000_000},
    {"ClockHz": 500_000},
    {"ClockHz": 2_000_000, "StepClks": 3},
]
NOMINAL = 734_003
# Of the angle over 40 periods: the oracle's 1e-12 a step, ten steps a piece, hundreds of pieces.
BOUND_RAD = 1e-9
# Over 0.1 s. At 500 kHz a step is 2 us, where what the cubic leaves out is below 8e-12 rad.
SHORT_BOUND_RAD = 2e-11


class Bench:
    """The mirror from a given start, and the clock that it is in; all times in clocks."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.clock_s = 1.0 / parameters()["ClockHz"]
        self.now = 0

    async def start(self, angle: float = 0.0, velocity: float = 0.0) -> None:
        """Reset to a start; time 0 is the clock that this ends in."""
        await reset(self.dut)
        self.dut.damping_factor_i.value = 1.0
        self.dut.natural_offset_hz_i.value = 0.0
        self.dut.level_i.value = NOMINAL
        await self.restart(angle, velocity)

    async def restart(self, angle: float, velocity: float) -> None:
        """Reset while the clock runs."""
        self.dut.start_angle_i.value = angle
        self.dut.start_velocity_i.value = velocity
        self.dut.rst_i.value = 1
        await Timer(2 * CLOCK_NS, "ns")
        self.dut.rst_i.value = 0
        self.now = 0

    async def until(self, clock: int) -> None:
        """Wait for the middle of a clock: what is driven there acts from its beginning."""
        if clock > self.now:
            await Timer((clock - self.now) * CLOCK_NS, "ns")
            self.now = clock

    def angle(self, later_clks: float = 0.0) -> float:
        """Return the angle so long after the beginning of this clock, by the cubic."""
        dut = self.dut
        d = (dut.since_clks_o.value.to_unsigned() + later_clks) * self.clock_s
        acceleration = dut.acceleration_o.value + d * dut.jerk_o.value / 3.0
        return dut.angle_o.value + d * (dut.velocity_o.value + d * acceleration / 2.0)

    def size(self, frequency_hz: float) -> float:
        """Return the amplitude, but for the harmonics."""
        return math.hypot(self.angle(), self.dut.velocity_o.value / (2 * math.pi * frequency_hz))


async def wave(bench: Bench, edges: np.ndarray, drive: np.ndarray) -> None:
    """Drive the square wave whose edges are given in clocks."""
    for clock, high in zip(edges[:-1].tolist(), drive.tolist(), strict=True):
        await bench.until(clock)
        bench.dut.drive_i.value = int(high)
    await bench.until(int(edges[-1]))


@cocotb.test()
async def any_drive_any_level_shocks_and_drift(dut) -> None:
    """Changes at arbitrary clocks, each with another level, drift or shock, as scipy has them."""
    bench = Bench(dut)
    draw = generator(1)
    fast = bench.clock_s < 1e-7
    count = rounds(8, 32) if fast else rounds(120, 480)
    lengths = draw.integers(1, round(1.0e-3 / bench.clock_s), size=count)
    lengths[draw.random(count) < 0.2] = draw.integers(1, 5)  # and changes clock after clock
    start = (0.35, 30.0)
    await bench.start(*start)
    mirror, state, worst = Mirror(), np.array(start), 0.0
    for k, length in enumerate(lengths.tolist()):
        begin = bench.now
        drive = int(draw.integers(2))
        level = int(draw.integers(1 << pkg.LEVEL_WIDTH)) if draw.random() < 0.3 else NOMINAL
        dut.drive_i.value = drive
        dut.level_i.value = level
        if k % 12 == 5:
            # What drifts does so from the next step on, which a shock begins.
            mirror = replace(
                Mirror(),
                natural_hz=248.5 + draw.uniform(-3.0, 3.0),
                damping=draw.uniform(0.0, 20.0),
            )
            dut.natural_offset_hz_i.value = mirror.natural_hz - 248.5
            dut.damping_factor_i.value = mirror.damping
            kick = draw.uniform(-200.0, 200.0)
            state[1] += kick
            dut.shock_rad_per_s_i.value = kick
            dut.shock_i.value = 1
        times = np.sort(draw.integers(0, length, size=3)) + draw.random()
        times = np.append(times, length)
        ends = np.array([0.0, length * bench.clock_s])
        factor = np.array([drive * (level / NOMINAL) ** 2])
        want, speed = integrate(mirror, ends, factor, tuple(state), times * bench.clock_s)
        for time, angle in zip(times[:-1].tolist(), want[:-1].tolist(), strict=True):
            # A change acts on the outputs a clock later, so in its own clock nothing is asked.
            if int(time) > 0:
                await bench.until(begin + 1)
                dut.shock_i.value = 0
                await bench.until(begin + int(time))
                worst = max(worst, abs(bench.angle(time % 1.0) - angle))
        await bench.until(begin + 1)
        dut.shock_i.value = 0
        await bench.until(begin + length)
        worst = max(worst, abs(bench.angle() - want[-1]))
        state = np.array([want[-1], speed[-1]])
    spent = bench.now * bench.clock_s
    print(f"motion: {worst:.2e} rad from scipy's after {spent:.3f} s, bound {SHORT_BOUND_RAD:.0e}")
    assert worst < SHORT_BOUND_RAD


@cocotb.test()
async def tens_of_periods_at_a_steady_drive(dut) -> None:
    """From the steady state: it stays there, as scipy says, and (11) holds to a urad."""
    bench = Bench(dut)
    quarter = round(1.0 / (4 * 249.0 * bench.clock_s))
    frequency = 1.0 / (4 * quarter * bench.clock_s)
    periods = rounds(2, 6) if bench.clock_s < 1e-7 else 40
    start = steady_state(Mirror(), frequency)
    await bench.start(*start)
    edges = np.arange(4 * periods + 1) * quarter
    drive = np.tile([1.0, 0.0], 2 * periods)
    await wave(bench, edges[:-8], drive[:-8])
    time, angle = [], []
    step = max(1, quarter // 100)
    for k in range(8):
        await bench.until(int(edges[-9 + k]))
        dut.drive_i.value = 1 - k % 2
        for clock in range(0, quarter, step):
            await bench.until(int(edges[-9 + k]) + clock)
            time.append(bench.now * bench.clock_s)
            angle.append(bench.angle())
    time, angle = np.array(time), np.array(angle)
    want, _ = integrate(Mirror(), edges * bench.clock_s, drive, start, time)
    error = np.abs(angle - want).max()
    violation = np.abs(half_turn_residual(time, angle, frequency)).max()
    print(
        f"steady: {error:.2e} rad from scipy's after {periods} periods, bound {BOUND_RAD:.0e}; "
        f"(11) is off by {violation:.1e} rad"
    )
    assert error < BOUND_RAD
    assert violation < 1e-6
    assert abs(np.abs(angle).max() - math.radians(20.5)) < math.radians(0.1)


@cocotb.test()
async def starts_on_the_way_down_only(dut) -> None:
    """From rest: 275 to 249 Hz starts it, 235 to 249 Hz does not, below its fold it falls."""
    if parameters()["ClockHz"] != 500_000:
        pytest.skip("sweeps take too many clocks")
    bench = Bench(dut)

    async def run(*arguments: float) -> float:
        edges, drive = sweep(*arguments)
        await bench.start()
        await wave(bench, np.rint(edges / bench.clock_s).astype(int), drive)
        return bench.size(arguments[1])

    up = await run(235.0, 249.0, 28.0, 0.8)
    assert up < math.radians(0.005), f"an upward sweep gives {up:.2e} rad"
    down = await run(275.0, 249.0, 26.0, 2.0)
    want = math.hypot(*np.divide(steady_state(Mirror(), 249.0), [1.0, 2 * math.pi * 249.0]))
    assert abs(down / want - 1.0) < 0.01, f"a downward sweep gives {down:.4f} rad, want {want:.4f}"
    edges, drive = sweep(248.95, 248.4, 1.0, 1.6)
    begin = bench.now
    await wave(bench, begin + np.rint(edges / bench.clock_s).astype(int), drive)
    fallen = bench.size(248.4)
    assert fallen < 0.1 * want, f"below the fold it still swings {fallen:.3f} rad"


@cocotb.test()
async def reset_starts_anew_at_any_moment(dut) -> None:
    """A reset in mid-step, with drive and shock on: the given start, then the same motion."""
    bench = Bench(dut)
    clocks = 3 * max(2, round(1e-6 / bench.clock_s)) + 1
    length = np.array([0.0, clocks * bench.clock_s])
    await bench.start(0.1, 0.0)
    draw = generator(2)
    for age in range(12):
        dut.drive_i.value = 1
        dut.shock_i.value = age % 2
        dut.shock_rad_per_s_i.value = 50.0
        await bench.until(age * 7)
        start = (draw.uniform(-0.3, 0.3), draw.uniform(-500.0, 500.0))
        dut.drive_i.value = int(age > 5)
        await bench.restart(*start)
        dut.shock_i.value = 0
        assert (dut.angle_o.value, dut.velocity_o.value) == start
        assert dut.since_clks_o.value.to_unsigned() == 0
        drive = age // 3 % 2
        dut.drive_i.value = drive
        want, _ = integrate(Mirror(), length, np.array([float(drive)]), start)
        await bench.until(clocks)
        assert abs(bench.angle() - want[-1]) < SHORT_BOUND_RAD


@EACH_VOLUME
@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_mems_mirror_moves_as_the_equation(widths: dict[str, int], volume: str) -> None:
    simulate("mems_mirror", __file__, widths, volume=volume)


def test_amplitude_follows_drift_damping_and_level() -> None:
    """Less distance to the natural frequency, more level or more damping give more amplitude."""

    def amplitude(mirror: Mirror, drive: float = 1.0, degrees: float = 20.5) -> float:
        start = steady_state(mirror, 249.0, drive, (math.radians(degrees), 0.065))
        time = np.linspace(0.0, 1.0 / 249.0, 400)
        edges, wave_ = np.arange(5) / 996.0, drive * np.array([1.0, 0.0, 1.0, 0.0])
        angle, _ = integrate(mirror, edges, wave_, start, np.minimum(time, edges[-1]))
        return math.degrees(np.abs(angle).max())

    assert abs(amplitude(Mirror()) - 20.51) < 0.02
    assert abs(amplitude(Mirror(natural_hz=248.0), degrees=17.3) - 17.33) < 0.02
    assert abs(amplitude(Mirror(natural_hz=248.6), degrees=22.0) - 22.05) < 0.02
    assert abs(amplitude(Mirror(damping=1.1)) - 20.80) < 0.02
    assert abs(amplitude(Mirror(), 1.2**2) - 21.64) < 0.02
    assert abs(amplitude(Mirror(), 0.8**2) - 19.05) < 0.02
    with pytest.raises(RuntimeError, match="no motion"):
        steady_state(Mirror(natural_hz=249.2), 249.0)


def test_the_drive_sweeps_as_asked() -> None:
    """The drive's frequency, from its edges, and where it arrives."""
    edges, drive = sweep(275.0, 249.0, 13.0, 3.0, duty=0.25)
    rise = edges[:-1][drive == 1.0]
    frequency = 0.5 / np.diff(rise)
    middle = 0.5 * (rise[1:] + rise[:-1])
    assert np.abs(frequency - np.maximum(275.0 - 13.0 * middle, 249.0)).max() < 2e-2
    assert edges[0] == 0.0 and edges[-1] == 3.0 and drive[0] == 1.0
    assert abs(np.diff(edges)[drive == 1.0].sum() / 3.0 - 0.25) < 1e-3
    up, _ = sweep(235.0, 249.0, 14.0, 1.5)
    assert abs(2.0 * np.diff(up)[-2] * 249.0 * 2.0 - 1.0) < 1e-6
    for bad in ((0.0, 249.0, 1.0, 1.0), (250.0, 249.0, -1.0, 1.0)):
        with pytest.raises(ValueError, match="sweep"):
            sweep(*bad)


def test_integration_refuses_what_does_not_fit() -> None:
    times = np.array([0.0, 1e-3])
    for edges, drive, at in (
        (times, np.zeros(2), None),
        (times[::-1], np.zeros(1), None),
        (times, np.zeros(1), np.array([2e-3])),
        (times, np.zeros(1), np.array([1e-3, 0.0])),
    ):
        with pytest.raises(ValueError, match="integrate"):
            integrate(Mirror(), edges, drive, at_s=at)
