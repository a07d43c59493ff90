"""line_extent: strobes of any kind, clock for clock as the twin, and good lines counted by hand."""

import cocotb
import pytest
from harness import FallingEdge, ReadOnly, as_integer, generator, parameters, reset, simulate

from vrscan.fixed.line_extent import Extent, LineExtent

ELABORATIONS = [{"LineLength": 2}, {"LineLength": 5}, {"LineLength": 64}]


def check(dut, want: Extent, where: str) -> None:
    """Compare all that is defined in this clock."""
    got = {name: bool(as_integer(getattr(dut, f"{name}_o"))) for name in ("take", "ends")}
    assert got == {"take": want.index is not None, "ends": want.ends}, where
    assert bool(as_integer(dut.unfinished_o)) == want.unfinished, where
    if want.index is not None:
        assert as_integer(dut.index_o) == want.index, where
    if want.ends:
        faults = bool(as_integer(dut.short_o)), bool(as_integer(dut.over_o))
        assert faults == (want.short, want.over), where


@cocotb.test()
async def any_strobes(dut) -> None:
    """Lines of about the right length, with gaps, without an end, of a clock; and resets."""
    length = parameters()["LineLength"]
    draw = generator(length)
    await reset(dut)
    twin = LineExtent(length)
    seen = set()
    for cycle in range(6000):
        # Mostly lines: a start ends the last one or cuts it off, gaps come and go.
        start = draw.random() < 1.0 / (1.5 * length + 2.0)
        end = draw.random() < 1.0 / (1.2 * length + 1.0)
        valid = draw.random() < (0.5 if cycle // 500 % 2 else 0.95)
        restart = draw.random() < 0.003
        dut.line_start_i.value = int(start)
        dut.line_end_i.value = int(end)
        dut.pixel_valid_i.value = int(valid)
        dut.rst_i.value = int(restart)
        await ReadOnly()
        want = twin.step(start, valid, end)
        check(dut, want, f"cycle {cycle}")
        seen.add((want.ends, want.short, want.over))
        await FallingEdge(dut.clk_i)
        if restart:
            twin = LineExtent(length)
    assert {(True, False, False), (True, True, False), (True, False, True)} <= seen


@cocotb.test()
async def every_length_about_the_right_one(dut) -> None:
    """Without a gap, the first pixel with the start and the last with the end, then apart."""
    length = parameters()["LineLength"]
    await reset(dut)
    for count in range(max(1, length - 2), length + 4):
        for apart in (0, 1):
            for k in range(count + 2 * apart):
                inside = apart <= k < count + apart
                dut.line_start_i.value = int(k == 0)
                dut.pixel_valid_i.value = int(inside)
                dut.line_end_i.value = int(k == count + 2 * apart - 1)
                await ReadOnly()
                assert bool(as_integer(dut.take_o)) == (inside and k - apart < length)
                if k == count + 2 * apart - 1:
                    verdict = (
                        as_integer(dut.ends_o),
                        as_integer(dut.short_o),
                        as_integer(dut.over_o),
                    )
                    assert verdict == (1, int(count < length), int(count > length)), (count, apart)
                await FallingEdge(dut.clk_i)


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=str)
def test_line_extent_rtl_equals_model(elaboration: dict[str, int]) -> None:
    simulate("line_extent", __file__, elaboration)
