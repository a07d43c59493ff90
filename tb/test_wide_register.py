"""A register that is taken a clock after it is asked for, of any width, unless it is held."""

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge
from harness import CLOCK_NS, as_integer, drive, generator, parameters, rounds, simulate

REACH = 64  # bits that one enable reaches


@cocotb.test()
async def test_it_takes_a_clock_later_unless_held(dut) -> None:
    draw, width = generator(), parameters()["Width"]
    cocotb.start_soon(Clock(dut.clk_i, CLOCK_NS, unit="ns").start())
    asked, kept, taken = 0, None, 0
    for clock in range(rounds(500, 20_000)):
        take, hold = int(draw.random() < 0.4), int(draw.random() < 0.3)
        data = int.from_bytes(draw.bytes(width // 8 + 1), "little") % (1 << width)
        drive(dut.take_i, take)
        drive(dut.hold_i, hold)
        drive(dut.d_i, data)
        await FallingEdge(dut.clk_i)
        if asked and not hold:
            kept, taken = data, taken + 1
        asked = take
        assert kept is None or as_integer(dut.q_o) == kept, f"clock {clock}"
    assert taken > 100


@pytest.mark.parametrize("width", [1, REACH, REACH + 1, 3 * REACH - 2])
def test_wide_register_keeps_its_promise(width: int) -> None:
    simulate("wide_register", __file__, {"Width": width})
