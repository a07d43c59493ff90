"""line_receiver: every clock of the RTL against the model, and the faults by their names."""

import cocotb
import numpy as np
import pytest
from harness import FallingEdge, generator, parameters, reset, simulate

from vrscan.fixed.line_receiver import LineReceiver

ELABORATIONS = [
    {"LineLength": 64, "PixelWidth": 8, "CountWidth": 3},
    {"LineLength": 100, "PixelWidth": 16, "CountWidth": 16},
]


def model(period: int = 0) -> LineReceiver:
    """Return the twin of the running elaboration for a period."""
    given = parameters()
    return LineReceiver(given["LineLength"], period, given["CountWidth"])


def periods() -> tuple[int, ...]:
    """Return periods that matter to a line: none, its own length, one more, and longer ones."""
    length = parameters()["LineLength"]
    return 0, 1, length, length + 1, length + 30, 1830


async def clock_through(dut, twin: LineReceiver, strobes: np.ndarray) -> list[int]:
    """Drive (start, valid, pixel, end, skip, forget) and compare all outputs; return good lines.

    Without the last columns nothing is skipped or forgotten.
    """
    good_lines = []
    strobes = np.pad(strobes, ((0, 0), (0, 6 - strobes.shape[1])))
    for cycle, (start, valid, pixel, end, skip, forget) in enumerate(strobes.tolist()):
        dut.skip_i.value = skip
        dut.forget_i.value = forget
        dut.line_start_i.value = start
        dut.pixel_valid_i.value = valid
        dut.pixel_i.value = pixel
        dut.line_end_i.value = end
        await FallingEdge(dut.clk_i)
        want = twin.step(*map(bool, (start, valid)), pixel, *map(bool, (end, skip, forget)))
        where = f"cycle {cycle}, strobes {(start, valid, pixel, end)}"
        assert int(dut.valid_o.value) == (want.index is not None), where
        if want.index is not None:
            assert (int(dut.pixel_o.value), int(dut.index_o.value)) == (want.pixel, want.index), (
                where
            )
        assert int(dut.good_o.value) == want.good, where
        if want.good:
            got = int(dut.line_number_o.value), bool(dut.lost_o.value)
            assert got == (want.line_number, want.lost), f"{where}: {got}, want {want}"
            good_lines.append(want.line_number)
    dut.line_start_i.value = dut.line_end_i.value = dut.pixel_valid_i.value = 0
    await FallingEdge(dut.clk_i)  # the counters follow a clock later
    twin.step(False, False, 0, False)
    counts = [
        int(getattr(dut, f"{name}_count_o").value)
        for name in ("short", "long", "unfinished", "early", "skipped")
    ]
    assert counts == [twin.short, twin.long, twin.unfinished, twin.early, twin.skipped]
    return good_lines


def line(length: int, *, gap: float = 0.0, salt: int = 0, end: bool = True) -> np.ndarray:
    """Return the strobes of a line of ``length`` pixels with a share ``gap`` of idle clocks."""
    draw = generator(salt)
    top = 1 << parameters()["PixelWidth"]
    rows = []
    for k in range(length):
        while draw.random() < gap:
            rows.append((0, 0, int(draw.integers(top)), 0))
        rows.append((int(k == 0), 1, int(draw.integers(top)), int(end and k == length - 1)))
    if rows and rows[0][0] == 0:
        rows = [(1, 0, 0, 0), *[(0, *row[1:]) for row in rows]]
    return np.array(rows, dtype=np.int64).reshape(-1, 4)


@cocotb.test()
async def random_strobes(dut) -> None:
    """Strobes without any order, biased so that lines of every length come about."""
    draw = generator(1)
    length = parameters()["LineLength"]
    await reset(dut)
    twin = model()
    count = 30_000
    top = 1 << parameters()["PixelWidth"]
    strobes = np.zeros((count, 4), np.int64)
    strobes[:, 0] = draw.random(count) < 1 / (2 * length)
    strobes[:, 1] = draw.random(count) < 0.95
    strobes[:, 2] = draw.integers(top, size=count)
    strobes[:, 3] = draw.random(count) < 1 / (2 * length)
    await clock_through(dut, twin, strobes)
    assert twin.short and twin.long and twin.unfinished


@cocotb.test()
async def skipped_lines_are_counted_and_told(dut) -> None:
    """A line is skipped by the skip of its end alone, and only if it has no other fault."""
    draw = generator(2)
    length = parameters()["LineLength"]
    await reset(dut)
    dut.period_i.value = length + 30
    twin = model(length + 30)
    parts = []
    for k in range(200):
        part = line(length + int(draw.choice([0, 0, 0, 0, 1, -1])), salt=k)
        skip = draw.random(len(part)) < 0.5
        gap = np.zeros((int(draw.choice([0, 40])), 4), np.int64)
        part = np.column_stack([part, skip, draw.random(len(part)) < 0.1 / length])
        parts += [part, np.column_stack([gap, np.ones(len(gap), np.int64), 0 * gap[:, 0]])]
    await clock_through(dut, twin, np.concatenate(parts))
    assert min(twin.skipped, twin.early, twin.short, twin.long) >= 7


@cocotb.test()
async def good_lines_back_to_back_and_with_gaps(dut) -> None:
    """Whole lines are all good where the period allows it, early ones are counted."""
    for period in (0, parameters()["LineLength"] + 30):
        await lines_with_a_period(dut, period)


async def lines_with_a_period(dut, period: int) -> None:
    """Send lines back to back, and with gaps."""
    length = parameters()["LineLength"]
    await reset(dut)
    dut.period_i.value = period
    twin = model(period)
    parts = [line(length, salt=k) for k in range(4)]
    good = await clock_through(dut, twin, np.concatenate(parts))
    if period <= length:
        assert good == [0, 1, 2, 3] and twin.early == 0
    else:
        assert good == [0, 2] and twin.early == 2
    pause = np.zeros((period, 4), np.int64)
    parts = [part for k in range(4) for part in (line(length, gap=0.4, salt=k), pause)]
    assert await clock_through(dut, twin, np.concatenate(parts)) == [4, 5, 6, 7]


@cocotb.test()
async def the_least_period_is_enough(dut) -> None:
    """Ends that are the period apart are both good; a clock less is early."""
    length = parameters()["LineLength"]
    for period in periods():
        await reset(dut)
        dut.period_i.value = period
        if period <= length:
            assert await clock_through(dut, model(period), np.tile(line(length), (3, 1))) == [
                0,
                1,
                2,
            ]
            continue
        pause = np.zeros((period - length, 4), np.int64)
        strobes = [line(length), pause, line(length), pause[1:], line(length), line(length)]
        good = await clock_through(dut, model(period), np.concatenate(strobes))
        assert good == [0, 1, 3]


@cocotb.test()
async def bad_lines_are_counted_and_the_next_is_clean(dut) -> None:
    """Short, long, unfinished and empty lines, each followed by a good one that says so."""
    length = parameters()["LineLength"]
    await reset(dut)
    twin = model()
    pause = np.zeros((1, 4), np.int64)
    faults = [
        line(length - 1),
        line(length + 1),
        line(length, end=False),  # unfinished: the next line_start_i finds it open
        line(1),
        np.concatenate([line(length - 1, end=False), [[0, 0, 0, 1]]]),  # ends without its last
        np.array([[1, 0, 0, 1]]),  # started and ended in one clock, no pixel
    ]
    for k, fault in enumerate(faults):
        strobes = np.concatenate([fault, line(length, gap=0.1, salt=k), pause])
        assert await clock_through(dut, twin, strobes) == [2 * k + 1]
        assert await clock_through(dut, twin, pause) == []
    assert (twin.short, twin.long, twin.unfinished) == (4, 1, 1)


@cocotb.test()
async def separate_strobes_and_blanking_pixels(dut) -> None:
    """Start and end in clocks of their own; pixels outside of a line are ignored."""
    length = parameters()["LineLength"]
    await reset(dut)
    twin = model()
    inner = line(length)
    inner[:, 0] = inner[:, 3] = 0
    blank = np.array([[0, 1, 7, 0]] * 5)
    strobes = np.concatenate([blank, [[1, 0, 0, 0]], inner, [[0, 0, 0, 1]], blank, [[0, 0, 0, 1]]])
    assert await clock_through(dut, twin, strobes) == [0]
    assert (twin.short, twin.long, twin.unfinished, twin.early) == (0, 0, 0, 0)


@cocotb.test()
async def counters_stop_at_their_largest_value(dut) -> None:
    """More short lines than a 3-bit counter holds."""
    await reset(dut)
    twin = model()
    await clock_through(dut, twin, np.concatenate([line(2, salt=k) for k in range(12)]))
    assert int(dut.short_count_o.value) == min(12, (1 << parameters()["CountWidth"]) - 1)


@cocotb.test()
async def reset_mid_line(dut) -> None:
    """After a reset in mid-line the rest of that line is blanking, and the next line is good."""
    length = parameters()["LineLength"]
    await reset(dut)
    for age in (1, 2, length // 2, length):
        part = line(length)
        await clock_through(dut, model(), part[:age] * [1, 1, 1, 0])
        dut.rst_i.value = 1
        dut.pixel_valid_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        twin = model()
        rest = np.concatenate([part[age:], line(length)])
        assert await clock_through(dut, twin, rest) == [0], f"after a reset at pixel {age}"


@cocotb.test()
async def reset_forgets_what_came_before(dut) -> None:
    """Faults of every kind and a reset at once: the next line is good, the first, none lost."""
    length = parameters()["LineLength"]
    await reset(dut)
    faults = [line(length), line(length), line(2), line(length + 1), line(3, end=False)]
    await clock_through(dut, model(), np.concatenate(faults))
    dut.rst_i.value = 1
    await FallingEdge(dut.clk_i)
    dut.rst_i.value = 0
    assert await clock_through(dut, model(), line(length)) == [0]


@pytest.mark.parametrize("widths", ELABORATIONS, ids=str)
def test_line_receiver_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("line_receiver", __file__, widths)
