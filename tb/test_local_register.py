"""A register: what goes in comes out a clock later."""

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge
from harness import CLOCK_NS, as_integer, drive, generator, parameters, simulate


@cocotb.test()
async def test_it_is_a_clock_behind(dut) -> None:
    cocotb.start_soon(Clock(dut.clk_i, CLOCK_NS, unit="ns").start())
    for given in generator().integers(0, 1 << parameters()["Width"], 100):
        drive(dut.d_i, int(given))
        await FallingEdge(dut.clk_i)
        assert as_integer(dut.q_o) == given


@pytest.mark.parametrize("width", [1, 9])
def test_local_register_keeps_its_promise(width: int) -> None:
    simulate("local_register", __file__, {"Width": width})
