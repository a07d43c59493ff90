"""power_adaptation: every clock of the RTL against the model, and the model against the formula."""

import dataclasses
import functools

import cocotb
import pytest
from harness import EACH_VOLUME, as_integer, generator, rounds, simulate
from laser_bench import POINT, POWER_MAX, Scene, SettingsBench, part, pixel, random_settings

from vrscan.clocked.power_adaptation import (
    FACTOR_MAX,
    POWER_LATENCY,
    PowerAdaptation,
    next_power,
)
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.settings import AdaptationSettings

ELABORATIONS = [{"PixelWidth": 16}, {"PixelWidth": 9}]
OPEN = part(AdaptationSettings)
QUIET = {"pulse": 0, "armed": 1, "inward": 1, **POINT}
OUTPUTS = ("power", "inward_power", "outward_power")
with_changes = functools.partial(dataclasses.replace, OPEN)


class Bench(SettingsBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("point_valid",)

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET, {name: name for name in OUTPUTS})

    def twin_of(self, settings: AdaptationSettings) -> PowerAdaptation:
        return PowerAdaptation(settings)


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Inputs of every kind with the configuration changed meanwhile, and resets among them."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    powers, same = set(), set()
    for _ in range(rounds(40, 400)):
        scene = Scene(draw, QUIET)
        await bench.start(random_settings(draw, OPEN), **scene.step())
        for _ in range(int(draw.integers(100, 700))):
            if draw.random() < 0.01 and not bench.twin.busy:
                bench.set(random_settings(draw, OPEN))
            await bench.clocks(**scene.step())
            powers.add(bench.twin.power)
            same.add(bench.twin.inward_power == bench.twin.outward_power)
    assert len(powers) > 30 and same == {True, False}


@cocotb.test()
async def the_power_stands_from_pulse_to_pulse(dut) -> None:
    """A new one comes in the clock after a request; neither within nor before one does it move."""
    bench = await Bench.fresh(dut)
    await bench.start(with_changes(adapt=0))
    await bench.clocks(armed=0)
    assert bench.twin.power == OPEN.power
    await bench.clocks(armed=1, pulse=1)
    bench.set(with_changes(adapt=0, power=1_000))
    await bench.clocks(6)
    assert bench.twin.power == OPEN.power
    await bench.clocks(pulse=0)
    assert bench.twin.power == 1_000
    bench.set(with_changes(adapt=0, power=2_000))
    await bench.clocks(5)
    assert bench.twin.power == 1_000
    await bench.clocks(armed=0)
    assert bench.twin.power == 2_000


@cocotb.test()
async def a_point_gives_the_next_power_of_its_direction(dut) -> None:
    """After POWER_LATENCY clocks, of that direction alone, of both where they share one."""
    bench = await Bench.fresh(dut)
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
        assert (bench.twin.inward_power, bench.twin.outward_power) == (OPEN.power,) * 2
        await bench.clocks()
        got = (bench.twin.inward_power, bench.twin.outward_power)
        assert got == tuple(want if shared or inward == side else OPEN.power for side in (1, 0))
        # Nothing comes of a test line, nor of a line without power.
        for silent in ({"point_test": 1}, {"point_power": 0}):
            await bench.clocks(2 * POWER_LATENCY, **(point | silent))
            assert (bench.twin.inward_power, bench.twin.outward_power) == got


@cocotb.test()
async def every_point_gives_the_power_of_the_model(dut) -> None:
    """Extreme gains, heights and limits; a point that comes too early starts anew."""
    draw = generator(3)
    bench = await Bench.fresh(dut)
    ends = (0, 1, (1 << 15) - 1, 1 << 15, POWER_MAX)
    await bench.start(with_changes(adapt=1))
    for k in range(400):
        values = {}
        for name in ("target", "down", "up", "power_min", "power_max", "cut", "search"):
            width = REGISTERS[f"laser_{name}"].width
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
        assert bench.twin.inward_power == want == as_integer(dut.inward_power_o)


@EACH_VOLUME
@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=str)
def test_rtl(elaboration: dict[str, int], volume: str) -> None:
    """Every elaboration runs every test above."""
    simulate("power_adaptation", __file__, elaboration, volume=volume)


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
