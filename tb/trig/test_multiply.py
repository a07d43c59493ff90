"""multiply: RTL against the model and Python's own integers, exactly."""

import cocotb
import numpy as np
import pytest
from harness import (
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

from vrscan.fixed.multiply import latency, multiply

ELABORATIONS = [
    {"AWidth": 32, "BWidth": 32},
    {"AWidth": 69, "BWidth": 52},
    {"AWidth": 18, "BWidth": 18},
    {"AWidth": 2, "BWidth": 36},
]
OUTPUTS = {"product_o": True}


def clocks(widths: dict[str, int]) -> int:
    """Return the latency of an elaboration."""
    return latency(widths["AWidth"], widths["BWidth"])


def operands(widths: dict[str, int], count: int) -> dict[str, np.ndarray]:
    """Return operands of every magnitude and both signs, with all pairs of corners first."""
    draw = generator(widths["AWidth"])
    columns = []
    for width in widths.values():
        raw = [int.from_bytes(draw.bytes(16), "little") % (1 << width) for _ in range(count)]
        signed = [v - (1 << width) if v >> (width - 1) else v for v in raw]
        columns.append([v >> int(draw.integers(0, width)) for v in signed])
    corners = [
        [-1 << (w - 1), (1 << (w - 1)) - 1, 0, 1, -1, *((1 << 17) - 1, 1 << 17)[: 2 * (w > 18)]]
        for w in widths.values()
    ]
    pairs = [(a, b) for a in corners[0] for b in corners[1]]
    for k, (a, b) in enumerate(pairs[:count]):
        columns[0][k], columns[1][k] = a, b
    return {"a_i": np.array(columns[0], object), "b_i": np.array(columns[1], object)}


def expected(given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the products as Python integers, which no width bounds."""
    return {"product_o": given["a_i"] * given["b_i"]}


@cocotb.test()
async def random_operands_back_to_back(dut) -> None:
    """Every magnitude and sign, a new product in the clock of the last one."""
    widths = parameters()
    given = operands(widths, 600)
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=clocks(widths))
    assert_equal(got, expected(given), given)


@cocotb.test()
async def operands_change_while_it_works(dut) -> None:
    """The ports carry other numbers between two products."""
    widths = parameters()
    given = operands(widths, 100)
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=clocks(widths), gaps=True)
    assert_equal(got, expected(given), given)


@cocotb.test()
async def restart_drops_the_first_product(dut) -> None:
    """A valid_i at every moment of a product: only the second result comes out."""
    widths = parameters()
    given = operands(widths, 40)
    await reset(dut)
    await restart_at_every_age(dut, given, expected(given), OUTPUTS, latency=clocks(widths))


@cocotb.test()
async def reset_mid_product(dut) -> None:
    """A reset with valid high, and one alone: nothing comes out, and the next product is right."""
    widths = parameters()
    given = operands(widths, 40)
    await reset(dut)
    await reset_at_every_age(dut, given, expected(given), OUTPUTS, latency=clocks(widths))
    await reset_at_every_age(
        dut, given, expected(given), OUTPUTS, latency=clocks(widths), valid=False
    )


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_multiply_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("multiply", __file__, widths)


def test_multiply_model_is_exact() -> None:
    """Against Python's unbounded integers, up to the most negative product of 64 bits."""
    widths = {"AWidth": 32, "BWidth": 32}
    given = operands(widths, 5000)
    got = multiply(
        given["a_i"].astype(np.int64), given["b_i"].astype(np.int64), a_width=32, b_width=32
    )
    assert np.array_equal(got, given["a_i"] * given["b_i"])


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        (1 << 31, 1, "a does not fit in 32 bits"),
        (1, -(1 << 39) - 1, "b does not fit in 40 bits"),
        (1 << 30, 1 << 38, "does not fit in 64 bits"),
    ],
)
def test_multiply_model_rejects_what_does_not_fit(a: int, b: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        multiply(np.array([a]), np.array([b]), a_width=32, b_width=40)
