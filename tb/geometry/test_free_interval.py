"""free_interval: RTL against the model exactly, the model against straight lines in float64."""

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    assert_equal,
    generator,
    port,
    reset,
    reset_at_every_age,
    restart_at_every_age,
    rounds,
    run_vectors,
    simulate,
    struct_ports,
)
from scanners import SCANNERS

from vrscan.data import pkg
from vrscan.fixed.free_interval import LATENCY, free_interval
from vrscan.registers.chain_registers import Registers
from vrscan.registers.free_table import FRACTION_WIDTH, HALF

OUTPUTS = {"from_o": False, "to_o": False}


def operands(count: int, salt: int, begin: int, shift: int) -> dict[str, np.ndarray]:
    """Return lines: angles in the table, at its ends and beyond; every ratio of power to noise."""
    draw = generator(salt)
    span = (HALF - 1) << (shift + FRACTION_WIDTH)
    angle = begin + (draw.uniform(-0.2, 1.2, count) * span).astype(np.int64)
    nodes = begin + (draw.integers(-1, HALF + 1, count) << (shift + FRACTION_WIDTH))
    angle = np.where(draw.random(count) < 0.3, nodes - draw.integers(0, 2, count), angle)
    limit = 1 << pkg.ANGLE_WIDTH - 1
    noise = draw.integers(0, 1 << 23, count, endpoint=True) >> draw.integers(0, 24, count)
    return {
        "angle_i": np.clip(angle, -limit, limit - 1),
        "power_i": draw.integers(0, 1 << 16, count) >> draw.integers(0, 17, count),
        "noise_i": noise,
    }


def tables(kind: str, salt: int) -> tuple[int, int, np.ndarray, np.ndarray]:
    """Return begin, shift and the entries: a scanner's, or intervals with empty ones."""
    if kind in SCANNERS:
        given = Registers.from_config(SCANNERS[kind])
        ends = np.array(given.free_table_from), np.array(given.free_table_to)
        return given.free_begin, given.free_shift, *ends
    draw = generator(salt)
    ends = np.sort(draw.integers(0, 1 << 16, (2, 2 * HALF)), axis=0)
    if kind == "wide":  # seldom empty together
        ends = ends // np.array([[8], [1]])
    empty = draw.random(2 * HALF) < 0.1
    ends[:, empty] = ends[::-1, empty]
    begin, shift = int(draw.integers(-(1 << 23), 1 << 22)), int(draw.integers(0, 13))
    point = draw.random(2 * HALF) < 0.03  # empty, too
    ends[1, point] = ends[0, point]
    return begin, shift, *ends


async def write(dut, kind: str, salt: int, bank: int = 0) -> dict[str, object]:
    """Write a table into a bank, and return it and its place."""
    begin, shift, least, largest = tables(kind, salt)
    for k in range(2 * HALF):
        entry = {"from": int(least[k]), "to": int(largest[k]), "index": k}
        for name, value in (entry | {"write_bank": bank, "write": 1}).items():
            port(dut, f"free_table_{name}_i").value = value
        await FallingEdge(dut.clk_i)
    port(dut, "free_table_write_i").value = 0
    return {"begin": begin, "shift": shift, "table_from": least, "table_to": largest}


def use(dut, table: dict[str, object], bank: int = 0) -> None:
    """Let the table of a bank, and its place, take effect."""
    port(dut, "free_table_bank_i").value = bank
    struct_ports(dut)["free_i"].give({f"free_{name}": table[name] for name in ("begin", "shift")})


async def load(dut, kind: str, salt: int) -> dict[str, object]:
    """Write a table, let it take effect, and return it and its place."""
    table = await write(dut, kind, salt)
    use(dut, table)
    return table


def expected(given: dict[str, np.ndarray], table: dict[str, object]) -> dict[str, np.ndarray]:
    """Return the model's answer by port."""
    least, largest = free_interval(given["angle_i"], given["power_i"], given["noise_i"], **table)
    return {"from_o": least, "to_o": largest}


@cocotb.test()
async def random_lines_back_to_back(dut) -> None:
    """The shipped tables and others; a new line in the clock of the last result."""
    await reset(dut)
    free = 0
    for k, kind in enumerate((*SCANNERS, "wide", "any", "wide")):
        table = await load(dut, kind, k)
        given = operands(rounds(400, 4000), k, table["begin"], table["shift"])
        want = expected(given, table)
        free += np.count_nonzero(want["to_o"])
        assert_equal(await run_vectors(dut, given, OUTPUTS, latency=LATENCY), want, given)
    assert free > 200


@cocotb.test()
async def lines_change_while_it_works(dut) -> None:
    """The ports carry another line between two results."""
    await reset(dut)
    table = await load(dut, "wide", 5)
    given = operands(100, 6, table["begin"], table["shift"])
    got = await run_vectors(dut, given, OUTPUTS, latency=LATENCY, gaps=True)
    assert_equal(got, expected(given, table), given)


@cocotb.test()
async def one_bank_is_written_while_the_other_is_read(dut) -> None:
    """What is written is not seen before it takes effect, and then all of it is."""
    await reset(dut)
    table = await load(dut, "wide", 9)
    for k in range(1, 6):
        writes = cocotb.start_soon(write(dut, "wide", 9 + k, k % 2))
        for salt in (k, 10 + k):  # while it is written, and behind that
            given = operands(2 * HALF // LATENCY, salt, table["begin"], table["shift"])
            want = expected(given, table)
            assert np.any(want["to_o"] > 0)
            assert_equal(await run_vectors(dut, given, OUTPUTS, latency=LATENCY), want, given)
        table = await writes
        use(dut, table, k % 2)


@cocotb.test()
async def a_new_line_or_a_reset_drops_the_one_at_work(dut) -> None:
    await reset(dut)
    table = await load(dut, "wide", 7)
    given = operands(2 * LATENCY + 4, 8, table["begin"], table["shift"])
    want = expected(given, table)
    await restart_at_every_age(dut, given, want, OUTPUTS, latency=LATENCY)
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=LATENCY)


@EACH_VOLUME
def test_free_interval_rtl_equals_model(volume: str) -> None:
    simulate("free_interval", __file__, volume=volume)


def test_the_interval_is_inside_the_straight_lines_by_less_than_a_step() -> None:
    """With a second half of the table that limits nothing, against numpy's interpolation."""
    for salt in range(20):
        begin, shift, least, largest = tables("wide", salt)
        least[HALF:], largest[HALF:] = 0, (1 << 16) - 1
        given = operands(2000, salt, begin, shift)
        given["power_i"][:], given["noise_i"][:] = 65535, 1
        table = {"begin": begin, "shift": shift, "table_from": least, "table_to": largest}
        got = expected(given, table)
        nodes = begin + (np.arange(HALF) << (shift + FRACTION_WIDTH))
        exact_from = np.interp(given["angle_i"], nodes, least[:HALF])
        exact_to = np.interp(given["angle_i"], nodes, largest[:HALF])
        rows = got["to_o"] > 0
        # The angle's bits below a share of a step are dropped.
        steepest = max(np.abs(np.diff(e[:HALF])).max() for e in (least, largest))
        slack = 1.0 + steepest * 2.0**-FRACTION_WIDTH * (shift > 0)
        assert rows.sum() > 200
        assert np.abs(got["from_o"] - exact_from)[rows].max() <= slack
        assert np.abs(got["to_o"] - exact_to)[rows].max() <= slack
        outside = (given["angle_i"] < nodes[0]) | (given["angle_i"] >= nodes[-1])
        assert outside.any() and not got["to_o"][outside].any()


@pytest.mark.parametrize("name", SCANNERS)
def test_more_noise_or_less_power_never_frees_more(name: str) -> None:
    """Of a shipped table: every entry of the second half is inside the next one."""
    begin, shift, least, largest = tables(name, 0)
    assert np.all(np.diff(least[HALF:]) <= 0) and np.all(np.diff(largest[HALF:]) >= 0)
    assert least[HALF] > largest[HALF] and least[-1] < 200 * 16 < 1000 * 16 < largest[-1]
    assert begin < 0 < shift
