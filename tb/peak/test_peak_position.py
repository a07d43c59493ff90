"""peak_position: RTL against the model exactly, the model against (8) in float64."""

import cocotb
import numpy as np
import pytest
from harness import (
    assert_equal,
    generator,
    parameters,
    reset,
    reset_at_every_age,
    restart_at_every_age,
    run_vectors,
    simulate,
)

from vrscan.data import pkg
from vrscan.fixed.peak_position import LATENCY, peak_position

ELABORATIONS = [{"LineLength": 2048}, {"LineLength": 65}]
OUTPUTS = {"position_o": True}
TURN = 1 << pkg.ANGLE_WIDTH


def operands(length: int, count: int) -> dict[str, np.ndarray]:
    """Return windows on the line with any phase, the wrap and the ends first."""
    draw = generator(length)
    period = draw.integers(2, min(256, length), count)
    left = draw.integers(0, length - period, endpoint=True)
    phase = draw.integers(0, TURN, count)
    phase[:6] = 0, 1, TURN - 1, TURN // 2, TURN // 2 - 1, TURN // 4
    left[6:8] = 0, length - 1 - period[7]
    left[8:12] = length - period[8:12]  # T = N at the sensor's end
    phase[8:12] = TURN - 1, TURN - 2, TURN - TURN // 2048, TURN // 2
    return {"left_i": left, "period_i": period, "phase_i": phase}


def expected(given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the model's answer."""
    position = peak_position(
        given["left_i"],
        given["period_i"],
        given["phase_i"],
        line_length=parameters()["LineLength"],
    )
    return {"position_o": position}


@cocotb.test()
async def random_windows_with_restart_and_reset(dut) -> None:
    """Any window on the line; started anew and reset at every moment."""
    given = operands(parameters()["LineLength"], 500)
    want = expected(given)
    await reset(dut)
    assert_equal(await run_vectors(dut, given, OUTPUTS, latency=LATENCY), want, given)
    # The left edge stays until the result, so only one operand set is on the ports.
    few = {name: values[:1].repeat(2) for name, values in given.items()}
    few_want = {name: values[:1].repeat(2) for name, values in want.items()}
    await restart_at_every_age(dut, few, few_want, OUTPUTS, latency=LATENCY)
    for valid in (True, False):
        await reset_at_every_age(dut, few, few_want, OUTPUTS, latency=LATENCY, valid=valid)


@pytest.mark.parametrize("widths", ELABORATIONS, ids=str)
def test_peak_position_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("peak_position", __file__, widths)


def test_peak_position_model_is_equation_8() -> None:
    """Within half a step of left + phase T, with no case for a negative phase."""
    given = operands(2048, 5000)
    got = peak_position(*given.values(), line_length=2048) / 4096
    assert got[8] == 2048 - 1 / 4096  # rounded up to 2048, which does not fit
    signed = np.where(given["phase_i"] >= TURN // 2, given["phase_i"] - TURN, given["phase_i"])
    delta = signed / TURN * given["period_i"]
    delta = np.where(signed >= 0, delta, delta + given["period_i"])
    exact = np.minimum(given["left_i"] + delta, 2048 - 1 / 4096)
    assert np.abs(got - exact).max() <= 0.5 / 4096
