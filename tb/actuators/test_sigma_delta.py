"""sigma_delta: every clock of the RTL against the model, and the model's ones against the level."""

import cocotb
import pytest
from cocotb.triggers import RisingEdge, Timer
from harness import CLOCK_NS, FallingEdge, as_integer, generator, parameters, reset, simulate

from vrscan.clocked.sigma_delta import SigmaDelta

ELABORATIONS = [{"Width": 5}, {"Width": 16}]


@cocotb.test()
async def random_levels_and_resets(dut) -> None:
    """From the last reset on, the ones are the whole turns of what the levels add up to."""
    width = parameters()["Width"]
    draw = generator(width)
    await reset(dut)
    twin, level, total, ones = SigmaDelta(width), 0, 0, 0
    for clock in range(6000):
        if draw.random() < 0.1:
            level = int(draw.choice([0, 1, (1 << width) - 1, draw.integers(1 << width)]))
        restart = draw.random() < 0.003
        dut.level_i.value = level
        dut.rst_i.value = int(restart)
        await FallingEdge(dut.clk_i)
        twin.step(level)
        total += level
        if restart:
            twin, total, ones = SigmaDelta(width), 0, 0
        pin = as_integer(dut.pin_o)
        ones += pin
        assert (pin, ones) == (twin.pin, total >> width), f"clock {clock}, level {level}"


@cocotb.test()
async def the_pin_means_its_level_exactly(dut) -> None:
    """Of 2**Width clocks, from wherever they begin, level are high."""
    width = parameters()["Width"]
    every = 1 << width
    await reset(dut)
    if width <= 8:
        for level in range(every):
            dut.level_i.value = level
            ones = 0
            for _ in range(every):
                await FallingEdge(dut.clk_i)
                ones += as_integer(dut.pin_o)
            assert ones == level
        return
    # Few are high or few are low, so edges tell them.
    for level in (0, 1, 37, 12_345, every - 37, every - 1):
        dut.level_i.value = level
        await FallingEdge(dut.clk_i)
        few = level < every // 2
        count = 0

        async def counting(edge) -> None:
            nonlocal count
            while True:
                await edge
                count += 1

        task = cocotb.start_soon(counting((RisingEdge if few else FallingEdge)(dut.pin_o)))
        await Timer(CLOCK_NS << width, unit="ns")
        task.cancel()
        await FallingEdge(dut.clk_i)
        assert count == (level if few else every - level)


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=str)
def test_sigma_delta_rtl_equals_model(elaboration: dict[str, int]) -> None:
    simulate("sigma_delta", __file__, elaboration)


def test_many_steps_at_once_are_steps() -> None:
    """With a level that stands."""
    draw = generator(1)
    for _ in range(200):
        one, many = SigmaDelta(6), SigmaDelta(6)
        for level, clocks in draw.integers(1, 64, (20, 2)).tolist():
            for _ in range(clocks):
                one.step(level)
            many.step(level, clocks)
            assert one == many
