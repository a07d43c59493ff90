"""reset_bridge: a reset comes first, ends late, and comes when it is asked for."""

import cocotb
import pytest
from cocotb.triggers import Timer
from harness import CLOCK_NS, as_integer, drive, generator, simulate

STARTS = (1, 2, 3)  # of what a chip's flip-flops hold that nobody set
LATENCY = 4


@cocotb.test()
async def test_a_reset_comes_first_and_lasts_four_clocks_beyond_the_wish(dut) -> None:
    """By the last 0 that an edge has seen: the configuration counts as one."""
    draw, clock, ready, reset = generator(1), dut.clk_i, dut.ready_i, dut.rst_o
    drive(clock, 0)
    drive(ready, 1)
    await Timer(1)
    assert as_integer(reset) == 1  # before any clock
    seen: list[int] = [0] * LATENCY
    lasting = 0
    for _ in range(2000):
        # The wish changes at any time between two edges, and back in between at times.
        if not lasting:
            lasting = int(draw.integers(1, 12))
            for _ in range(int(draw.integers(1, 3))):
                drive(ready, 1 - as_integer(ready))
                await Timer(1)
        lasting -= 1
        seen.append(as_integer(ready))
        drive(clock, 1)
        await Timer(CLOCK_NS // 2)
        assert as_integer(reset) == 1 - seen[-LATENCY]
        drive(clock, 0)
        await Timer(CLOCK_NS // 2)
        assert as_integer(reset) == 1 - seen[-LATENCY]
    assert 500 < sum(seen) < 1500


@pytest.mark.parametrize("start", STARTS)
def test_reset_bridge(start: int) -> None:
    simulate("reset_bridge", __file__, start=start)
