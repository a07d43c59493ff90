"""quarter_wave: RTL against the model exactly, the model against float64 sine and cosine."""

import math

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
    run_vectors,
    simulate,
)

from vrscan.fixed.quarter_wave import (
    LATENCY,
    LENGTH_ERROR,
    amplitude,
    error_bound,
    quarter_wave,
    table,
)

ELABORATIONS = [
    {"PhaseWidth": 28, "AmplWidth": 24},
    {"PhaseWidth": 14, "AmplWidth": 16},
    {"PhaseWidth": 25, "AmplWidth": 30},
]
OUTPUTS = {"sine_o": True, "cosine_o": True}


def phases(width: int, count: int) -> np.ndarray:
    """Return phases around every 32nd of a turn and around table steps, then random ones."""
    draw = generator(width)
    near = np.array([-2, -1, 0, 1, 2])
    marks = np.arange(32)[:, None] * (1 << (width - 5)) + near
    edges = draw.integers(0, 8192, count // 20)[:, None] * (1 << (width - 13)) + near
    loose = draw.integers(0, 1 << width, count)
    every = np.concatenate([marks.ravel(), edges.ravel(), loose])
    return (every % (1 << width))[:count]


def stimulus(
    widths: dict[str, int], phase: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the operands and the model's answer."""
    sine, cosine = quarter_wave(
        phase, phase_width=widths["PhaseWidth"], ampl_width=widths["AmplWidth"]
    )
    return {"phase_i": phase}, {"sine_o": sine, "cosine_o": cosine}


@cocotb.test()
async def random_phases_without_a_gap(dut) -> None:
    """One phase a clock, every table step and quadrant."""
    widths = parameters()
    given, want = stimulus(widths, phases(widths["PhaseWidth"], 8000))
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=LATENCY, spacing=1)
    assert_equal(got, want, given)


@cocotb.test()
async def random_phases_with_gaps(dut) -> None:
    """Gaps in valid_i, other phases on the port meanwhile."""
    widths = parameters()
    given, want = stimulus(widths, phases(widths["PhaseWidth"], 1000))
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=LATENCY, spacing=1, gaps=True)
    assert_equal(got, want, given)


@cocotb.test()
async def reset_mid_stream(dut) -> None:
    """A reset at every stage, with valid high and alone: nothing comes out, the next is right."""
    widths = parameters()
    given, want = stimulus(widths, phases(widths["PhaseWidth"], 40))
    await reset(dut)
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=LATENCY)
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=LATENCY, valid=False)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_quarter_wave_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("quarter_wave", __file__, widths)


@pytest.mark.parametrize(
    ("phase_width", "ampl_width"), [(14, 16), (28, 16), (28, 24), (30, 24), (24, 30), (30, 30)]
)
def test_quarter_wave_model_within_its_bound(phase_width: int, ampl_width: int) -> None:
    """A dense sweep of the turn: error of each output, of the length and of the angle."""
    every = np.arange(0, 1 << phase_width, 1 if phase_width < 20 else (1 << phase_width - 21) - 1)
    phase = np.concatenate([every, phases(phase_width, 20000)])
    sine, cosine = quarter_wave(phase, phase_width=phase_width, ampl_width=ampl_width)
    angle = phase * (2 * np.pi / (1 << phase_width))
    full = amplitude(ampl_width)
    error = max(
        np.abs(sine - full * np.sin(angle)).max(), np.abs(cosine - full * np.cos(angle)).max()
    )
    bound = error_bound(ampl_width)
    turned = (cosine + 1j * sine) * np.exp(-1j * angle)
    length_error = np.abs(np.abs(turned) / full - 1).max()
    angle_error = np.abs(np.angle(turned)).max()
    print(
        f"quarter_wave {phase_width}/{ampl_width}: error in steps, measured {error:.3f} / "
        f"predicted {bound:.3f} / floor 0.5; length {length_error:.2e}, angle {angle_error:.2e} rad"
    )
    assert error <= bound
    # Both roundings together move the vector by at most sqrt(1/2) of a step.
    rounding = math.sqrt(0.5) / full
    assert length_error <= LENGTH_ERROR + 1e-8 + rounding
    assert angle_error <= 1.3e-8 + rounding
    largest = (1 << (ampl_width - 1)) - 1
    assert max(sine.max(), cosine.max()) <= largest
    assert min(sine.min(), cosine.min()) >= -largest


def test_quarter_wave_table_does_not_depend_on_the_last_bit_of_a_float() -> None:
    """No entry lies so near the middle of two integers that another libm would round it anew."""
    exact = (1 - 2**-15) * 2**32 * np.sin((np.arange(1024) + 0.5) * (np.pi / 2048))
    assert np.abs(table() - exact).max() < 0.5 - 2e-5


@pytest.mark.parametrize(
    ("phase", "phase_width", "ampl_width"),
    [(-1, 28, 24), (1 << 28, 28, 24), (0, 13, 24), (0, 31, 24), (0, 28, 15), (0, 28, 31)],
)
def test_quarter_wave_model_rejects_what_is_out_of_range(
    phase: int, phase_width: int, ampl_width: int
) -> None:
    with pytest.raises(ValueError, match="quarter_wave"):
        quarter_wave(np.array([phase]), phase_width=phase_width, ampl_width=ampl_width)
