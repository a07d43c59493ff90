"""square_root: RTL against the model exactly, the model against math.isqrt."""

import math

import cocotb
import numpy as np
import pytest
from harness import (
    FallingEdge,
    assert_equal,
    each,
    generator,
    parameters,
    reset,
    reset_at_every_age,
    restart_at_every_age,
    run_vectors,
    simulate,
)

from vrscan.fixed.square_root import latency, square_root

ELABORATIONS = [{"RootWidth": 24}, {"RootWidth": 2}, {"RootWidth": 31}]
OUTPUTS = {"root_o": False}


def radicands(width: int, count: int) -> np.ndarray:
    """Return the corners, squares and midpoints with both neighbours, and every magnitude."""
    draw = generator(width)
    top = (1 << 2 * width) - 1
    roots = draw.integers(0, 1 << width, count // 8) >> draw.integers(0, width, count // 8)
    squares = (roots * roots)[:, None] + np.array([-1, 0, 1])
    midpoints = (roots * (roots + 1))[:, None] + np.array([0, 1])
    largest = (1 << width) - 1
    corners = [0, 1, 2, 3, top, top - 1, largest**2, largest * (largest + 1), largest**2 - largest]
    loose = draw.integers(0, top, count, endpoint=True) >> draw.integers(0, 2 * width, count)
    every = np.concatenate([corners, squares.ravel(), midpoints.ravel(), loose])
    return np.clip(every, 0, top)[:count]


def stimulus(width: int, count: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the operands and the model's answer."""
    radicand = radicands(width, count)
    return {"radicand_i": radicand}, {"root_o": square_root(radicand, root_width=width)}


@cocotb.test()
async def random_radicands_back_to_back(dut) -> None:
    """Every magnitude, squares and their neighbours, a new root in the clock of the last one."""
    width = parameters()["RootWidth"]
    given, want = stimulus(width, 400)
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=latency(width))
    assert_equal(got, want, given)


@cocotb.test()
async def radicand_changes_while_it_works(dut) -> None:
    """The port carries other numbers between two roots."""
    width = parameters()["RootWidth"]
    given, want = stimulus(width, 60)
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=latency(width), gaps=True)
    assert_equal(got, want, given)


@cocotb.test()
async def restart_drops_the_first_root(dut) -> None:
    """A valid_i at every moment of a root: only the second result comes out."""
    width = parameters()["RootWidth"]
    given, want = stimulus(width, 60)
    await reset(dut)
    await restart_at_every_age(dut, given, want, OUTPUTS, latency=latency(width))


@cocotb.test()
async def reset_mid_root(dut) -> None:
    """A reset with valid high, and one alone: nothing comes out, and the next root is right."""
    width = parameters()["RootWidth"]
    given, want = stimulus(width, 60)
    await reset(dut)
    for _ in range(4 * latency(width)):  # whatever the steps' counter could hold
        assert dut.valid_o.value == 0, "a result of nothing, after a reset"
        await FallingEdge(dut.clk_i)
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=latency(width))
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=latency(width), valid=False)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_square_root_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("square_root", __file__, widths)


@pytest.mark.parametrize("width", [2, 24, 31])
def test_square_root_model_is_the_nearest_integer(width: int) -> None:
    """Against floor((floor(sqrt(4 r)) + 1) / 2) in Python's unbounded arithmetic."""
    radicand = radicands(width, 20000)
    root = square_root(radicand, root_width=width)
    for r, got in zip(radicand.tolist(), root.tolist(), strict=True):
        assert got == min((math.isqrt(4 * r) + 1) // 2, (1 << width) - 1), r


def test_square_root_model_rejects_what_it_cannot_hold() -> None:
    assert square_root(np.array([1 << 62]), root_width=32) == 1 << 31
    for radicand, width in ((-1, 4), (1 << 8, 4), ((1 << 62) + 1, 40)):
        with pytest.raises(ValueError, match="radicands must be"):
            square_root(np.array([radicand]), root_width=width)
