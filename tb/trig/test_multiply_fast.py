"""multiply_fast: RTL against Python's own integers, exactly, a product a clock."""

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
    run_vectors,
    simulate,
)

from vrscan.fixed.multiply import FAST_LATENCY

ELABORATIONS = [{"AWidth": 35, "BWidth": 35}, {"AWidth": 18, "BWidth": 27}]


def operands(widths: dict[str, int], count: int) -> dict[str, np.ndarray]:
    """Return operands of every magnitude and both signs, with all pairs of corners first."""
    draw = generator(widths["BWidth"])
    columns = []
    for width in widths.values():
        values = draw.integers(-1 << (width - 1), 1 << (width - 1), count)
        columns.append(values >> draw.integers(0, width, count))
    corners = [
        [-1 << (w - 1), (1 << (w - 1)) - 1, 0, 1, -1, (1 << 17) - 1, -1 << 17]
        for w in widths.values()
    ]
    pairs = [(a, b) for a in corners[0] for b in corners[1]]
    for column, values in zip(columns, zip(*pairs, strict=True), strict=True):
        column[: len(pairs)] = values
    return {"a_i": columns[0].astype(object), "b_i": columns[1].astype(object)}


@cocotb.test()
async def a_product_a_clock(dut) -> None:
    """Every magnitude and sign, without a clock between."""
    given = operands(parameters(), 2000)
    await reset(dut)
    got = await run_vectors(dut, given, {"product_o": True}, latency=FAST_LATENCY, spacing=1)
    assert_equal(got, {"product_o": given["a_i"] * given["b_i"]}, given)


@cocotb.test()
async def products_with_gaps(dut) -> None:
    """The ports carry other numbers between two products."""
    given = operands(parameters(), 200)
    await reset(dut)
    got = await run_vectors(
        dut, given, {"product_o": True}, latency=FAST_LATENCY, spacing=1, gaps=True
    )
    assert_equal(got, {"product_o": given["a_i"] * given["b_i"]}, given)


@cocotb.test()
async def reset_mid_product(dut) -> None:
    """A reset at every moment of a product: nothing comes out."""
    await reset(dut)
    for age in range(FAST_LATENCY):
        dut.valid_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.valid_i.value = 0
        for _ in range(age):
            await FallingEdge(dut.clk_i)
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        for _ in range(FAST_LATENCY + 1):
            assert dut.valid_o.value == 0, f"reset at age {age}"
            await FallingEdge(dut.clk_i)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_multiply_fast_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("multiply_fast", __file__, widths)
