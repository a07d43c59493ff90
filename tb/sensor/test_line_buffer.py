"""line_buffer: the line that was good comes back, whatever is written meanwhile."""

import cocotb
import numpy as np
import pytest
from harness import FallingEdge, each, generator, parameters, reset, simulate

from vrscan.fixed.line_buffer import LATENCY, LineBuffer

ELABORATIONS = [
    {"LineLength": 64, "PixelWidth": 8},
    {"LineLength": 100, "PixelWidth": 16},
]


async def stream(dut, lines: np.ndarray, good: list[bool], replay_delay: int) -> None:
    """Write lines back to back, replay each good one after a delay and compare every clock."""
    length = parameters()["LineLength"]
    twin = LineBuffer(length)
    expected: dict[int, tuple[int, int]] = {}  # clock to (index, pixel)
    replays: list[int] = []
    for cycle in range((len(lines) + 3) * length):
        row, index = divmod(cycle, length)
        writing = row < len(lines)
        last = index == length - 1
        dut.valid_i.value = int(writing)
        dut.good_i.value = int(writing and last and good[row])
        if writing:
            dut.pixel_i.value = int(lines[row, index])
            dut.index_i.value = index
            twin.write(index, int(lines[row, index]))
            if last and good[row]:
                twin.good()
                replays.append(cycle + replay_delay)
        starts = bool(replays) and replays[0] == cycle
        dut.replay_i.value = int(starts)
        if starts:
            replays.pop(0)
            for k, pixel in enumerate(twin.replay()):
                expected[cycle + LATENCY + k] = k, pixel
        await FallingEdge(dut.clk_i)
        want = expected.pop(cycle + 1, None)
        assert int(dut.valid_o.value) == (want is not None), f"cycle {cycle}"
        if want is not None:
            got = int(dut.index_o.value), int(dut.pixel_o.value)
            assert got == want, f"cycle {cycle}: got {got}, want {want}"
            assert int(dut.last_o.value) == (want[0] == length - 1), f"cycle {cycle}"
    assert not expected


@cocotb.test()
async def back_to_back_lines(dut) -> None:
    """Every line replayed while the next comes in, at the earliest and the latest moment."""
    length, top = parameters()["LineLength"], 1 << parameters()["PixelWidth"]
    await reset(dut)
    lines = generator(1).integers(top, size=(6, length))
    for delay in (1, 17, length - 1):
        await stream(dut, lines, [True] * 6, delay)


@cocotb.test()
async def dropped_lines_are_overwritten(dut) -> None:
    """A line without good_i never comes back, and does not disturb the one being replayed."""
    length, top = parameters()["LineLength"], 1 << parameters()["PixelWidth"]
    await reset(dut)
    lines = generator(2).integers(top, size=(8, length))
    await stream(dut, lines, [True, False, True, False, False, True, True, False], 5)


@cocotb.test()
async def reset_mid_replay(dut) -> None:
    """A reset in mid-replay stops it; the next line is whole."""
    length, top = parameters()["LineLength"], 1 << parameters()["PixelWidth"]
    await reset(dut)
    lines = generator(3).integers(top, size=(2, length))
    for age in (1, 2, 3, length // 2):
        await stream(dut, lines[:1], [True], 1)
        dut.replay_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.replay_i.value = 0
        for _ in range(age):
            await FallingEdge(dut.clk_i)
        dut.rst_i.value = 1
        dut.valid_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        dut.valid_i.value = 0
        for _ in range(length):
            assert dut.valid_o.value == 0, f"the replay survived a reset at its clock {age}"
            await FallingEdge(dut.clk_i)
        await stream(dut, lines, [True, True], 1)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_line_buffer_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("line_buffer", __file__, widths)
