"""divide: RTL against the model exactly, the model against Python's own integers."""

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

from vrscan.fixed.divide import divide, latency

ELABORATIONS = [
    {"DividendWidth": 57, "DivisorWidth": 46, "QuotientWidth": 16},
    {"DividendWidth": 20, "DivisorWidth": 3, "QuotientWidth": 24},
    {"DividendWidth": 9, "DivisorWidth": 17, "QuotientWidth": 2},
]
OUTPUTS = {"quotient_o": False, "overflow_o": False}


def operands(widths: dict[str, int], count: int) -> dict[str, np.ndarray]:
    """Return dividends and divisors of every magnitude, with the corners first."""
    draw = generator(widths["DividendWidth"])
    top = (1 << widths["DividendWidth"]) - 1, (1 << widths["DivisorWidth"]) - 1
    corners = [(0, 0), (0, 1), (1, 0), (top[0], 1), (top[0], top[1]), (1, 2), (3, 2), (1, top[1])]
    dividend = draw.integers(0, top[0], count, endpoint=True) >> draw.integers(
        0, widths["DividendWidth"], count
    )
    divisor = draw.integers(0, top[1], count, endpoint=True) >> draw.integers(
        0, widths["DivisorWidth"], count
    )
    for k, corner in enumerate(corners):
        dividend[k], divisor[k] = corner
    return {"dividend_i": dividend, "divisor_i": divisor}


def expected(widths: dict[str, int], given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the model's answer."""
    quotient, overflow = divide(
        given["dividend_i"], given["divisor_i"], quotient_width=widths["QuotientWidth"]
    )
    return {"quotient_o": quotient, "overflow_o": overflow}


@cocotb.test()
async def random_operands_back_to_back(dut) -> None:
    """Every magnitude, a new division in the clock of the last result."""
    widths = parameters()
    given = operands(widths, 400)
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=latency(widths["QuotientWidth"]))
    assert_equal(got, expected(widths, given), given)


@cocotb.test()
async def operands_change_while_it_works(dut) -> None:
    """The ports carry other numbers between two divisions."""
    widths = parameters()
    given = operands(widths, 60)
    await reset(dut)
    got = await run_vectors(
        dut, given, OUTPUTS, latency=latency(widths["QuotientWidth"]), gaps=True
    )
    assert_equal(got, expected(widths, given), given)


@cocotb.test()
async def restart_drops_the_first_division(dut) -> None:
    """A valid_i at every moment of a division: only the second result comes out."""
    widths = parameters()
    given = operands(widths, 40)
    await reset(dut)
    await restart_at_every_age(
        dut, given, expected(widths, given), OUTPUTS, latency=latency(widths["QuotientWidth"])
    )


@cocotb.test()
async def reset_mid_division(dut) -> None:
    """A reset with and without valid: nothing comes out, and the next division is right."""
    widths = parameters()
    given = operands(widths, 40)
    await reset(dut)
    want = expected(widths, given)
    clocks = latency(widths["QuotientWidth"])
    for _ in range(4 * clocks):  # whatever the steps' counter could hold
        assert dut.valid_o.value == 0, "a result of nothing, after a reset"
        await FallingEdge(dut.clk_i)
    for valid in (True, False):
        await reset_at_every_age(dut, given, want, OUTPUTS, latency=clocks, valid=valid)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_divide_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("divide", __file__, widths)


def test_divide_model_is_the_rounded_quotient() -> None:
    """Against exact integers: floor((2 a + b) / 2 b), in Python's unbounded arithmetic."""
    given = operands(ELABORATIONS[0], 5000)
    quotient, overflow = divide(given["dividend_i"], given["divisor_i"], quotient_width=16)
    for a, b, q, o in zip(*given.values(), quotient, overflow, strict=True):
        exact = (2 * int(a) + int(b)) // (2 * int(b)) if b else 1 << 16
        assert o == (exact > 0xFFFF)
        assert q == min(exact, 0xFFFF)


def test_divide_model_rejects_negative_operands() -> None:
    with pytest.raises(ValueError, match="negative"):
        divide(np.array([-1]), np.array([1]), quotient_width=4)
