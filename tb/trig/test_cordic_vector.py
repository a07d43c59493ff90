"""cordic_vector: RTL against the model exactly, the model against float64 on the same integers."""

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

from vrscan.fixed.cordic_vector import (
    GAIN,
    TABLE_ENTRIES,
    angle_bounds,
    arc_tangents,
    cordic_vector,
    latency,
    magnitude_bound,
)

SHIPPED = {"XyWidth": 48, "AngleWidth": 24}
ELABORATIONS = [SHIPPED, {"XyWidth": 9, "AngleWidth": 8}, {"XyWidth": 20, "AngleWidth": 16}]
OUTPUTS = {"angle_o": False, "magnitude_o": False, "zero_o": False}


def special(width: int, size: int) -> np.ndarray:
    """Return the axes, the diagonals and their neighbours at one size, shape [n, 2]."""
    largest = (1 << (width - 1)) - 1
    near = [0, 1, -1, size, size - 1, -size, 1 - size, size // 2, -size // 2]
    pairs = np.array([(a, b) for a in near for b in near if a or b])
    return np.clip(pairs, -largest - 1, largest)


def circle(width: int, size: float, count: int) -> np.ndarray:
    """Return vectors of one length at random angles, shape [n, 2]."""
    angle = generator(width).uniform(0, 2 * np.pi, count)
    return np.rint(size * np.stack([np.cos(angle), np.sin(angle)], axis=1)).astype(np.int64)


def stimulus(
    widths: dict[str, int], count: int
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return vectors of every amplitude and the model's answer, the corners first."""
    width = widths["XyWidth"]
    draw = generator(width)
    least, largest = -(1 << (width - 1)), (1 << (width - 1)) - 1
    near = [0, 1, -1, least, largest]
    corners = np.array([(a, b) for a in near for b in near])
    loose = draw.integers(least, largest, (count, 2), endpoint=True)
    loose >>= draw.integers(0, width - 1, (count, 1))
    loose[::4] >>= draw.integers(0, width - 1, (len(loose[::4]), 2))
    x, y = np.concatenate([corners, special(width, 1 << (width // 2)), loose])[:count].T
    angle, magnitude, zero = cordic_vector(x, y, xy_width=width, angle_width=widths["AngleWidth"])
    return {"x_i": x, "y_i": y}, {"angle_o": angle, "magnitude_o": magnitude, "zero_o": zero}


def clocks(widths: dict[str, int]) -> int:
    """Return the latency of an elaboration."""
    return latency(widths["XyWidth"], widths["AngleWidth"])


@cocotb.test()
async def random_vectors_back_to_back(dut) -> None:
    """Every amplitude and quadrant, a new vector in the clock of the last result."""
    widths = parameters()
    given, want = stimulus(widths, 500)
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=clocks(widths))
    assert_equal(got, want, given)


@cocotb.test()
async def operands_change_while_it_works(dut) -> None:
    """The ports carry other vectors meanwhile."""
    widths = parameters()
    given, want = stimulus(widths, 40)
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=clocks(widths), gaps=True)
    assert_equal(got, want, given)


@cocotb.test()
async def restart_drops_the_first_vector(dut) -> None:
    """A valid_i at every moment of the work: only the second result comes out."""
    widths = parameters()
    given, want = stimulus(widths, 110)
    await reset(dut)
    await restart_at_every_age(dut, given, want, OUTPUTS, latency=clocks(widths))


@cocotb.test()
async def reset_mid_vector(dut) -> None:
    """A reset with valid high, and one alone: nothing comes out, and the next vector is right."""
    widths = parameters()
    given, want = stimulus(widths, 110)
    await reset(dut)
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=clocks(widths))
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=clocks(widths), valid=False)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_cordic_vector_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("cordic_vector", __file__, widths)


def errors(vectors: np.ndarray, widths: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle's errors in steps and the magnitude's as a share of its bound."""
    x, y = vectors.T
    turn = 1 << widths["AngleWidth"]
    angle, magnitude, zero = cordic_vector(
        x, y, xy_width=widths["XyWidth"], angle_width=widths["AngleWidth"]
    )
    assert not zero.any()
    exact = np.arctan2(y.astype(float), x.astype(float)) * (turn / (2 * np.pi))
    length = GAIN * np.hypot(x.astype(float), y.astype(float))
    bound = magnitude_bound(length, angle_width=widths["AngleWidth"])
    return (angle - exact + turn / 2) % turn - turn / 2, (magnitude - length) / bound


@pytest.mark.parametrize("widths", [SHIPPED, {"XyWidth": 60, "AngleWidth": 28}], ids=str)
def test_cordic_vector_model_within_its_bounds_at_every_amplitude(widths: dict[str, int]) -> None:
    """From full scale to 2**-20 of it, one binary step at a time, axes and diagonals too."""
    width = widths["XyWidth"]
    peak_bound, rms_bound = angle_bounds(widths["AngleWidth"])
    assert peak_bound <= 1.1 and rms_bound <= 0.36  # what the position of a peak needs
    worst_peak = worst_rms = worst_magnitude = 0.0
    for step in range(21):
        size = (1 << (width - 1 - step)) - 1
        angle, magnitude = errors(circle(width, size, 20000), widths)
        rms = float(np.sqrt(np.mean(angle**2)))
        marks, mark_magnitude = errors(special(width, size + (step > 0)), widths)
        peak = max(np.abs(angle).max(), np.abs(marks).max())
        assert peak <= peak_bound, f"2**-{step} of full scale: {peak:.3f} steps"
        assert rms <= rms_bound, f"2**-{step} of full scale: {rms:.3f} steps rms"
        worst_peak, worst_rms = max(worst_peak, peak), max(worst_rms, rms)
        worst_magnitude = max(
            worst_magnitude, np.abs(magnitude).max(), np.abs(mark_magnitude).max()
        )
    print(
        f"cordic_vector {width}/{widths['AngleWidth']}, every amplitude to 2**-20: angle in steps, "
        f"measured / predicted / floor: peak {worst_peak:.3f} / {peak_bound:.3f} / 0.5, "
        f"rms {worst_rms:.4f} / {rms_bound:.4f} / 0.2887; "
        f"magnitude {worst_magnitude:.2f} of its bound"
    )
    assert worst_magnitude <= 1


def test_cordic_vector_model_keeps_the_smallest_vectors() -> None:
    """Every vector of a few units, in 48 bits, has the angle's full precision."""
    side = np.arange(-40, 41)
    every = np.array([(a, b) for a in side for b in side if a or b])
    angle, magnitude = errors(every, SHIPPED)
    assert np.abs(angle).max() <= angle_bounds(24)[0]
    assert np.abs(magnitude).max() <= 1


def test_cordic_vector_model_is_exact_on_axes_and_diagonals() -> None:
    """Eighths of a turn at every amplitude, the most negative numbers included."""
    directions = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])
    for step in range(47):
        x, y = (directions << step).T
        angle, _, _ = cordic_vector(x, y, xy_width=48, angle_width=24)
        assert np.array_equal(angle, np.arange(8) << 21)
    least = np.array([-(1 << 47)])
    for x, y, eighth in ((least, 0 * least, 4), (0 * least, least, 6), (least, least, 5)):
        assert cordic_vector(x, y, xy_width=48, angle_width=24)[0] == eighth << 21


def test_cordic_vector_model_defines_the_zero_vector() -> None:
    angle, magnitude, zero = cordic_vector(
        np.array([0]), np.array([0]), xy_width=48, angle_width=24
    )
    assert (angle[0], magnitude[0], zero[0]) == (0, 0, True)


def test_cordic_vector_table_does_not_depend_on_the_last_bit_of_a_float() -> None:
    """No arc tangent lies so near an integer that another libm would cut it anew."""
    exact = np.arctan(2.0 ** -np.arange(TABLE_ENTRIES)) * (2**40 / (2 * np.pi))
    fraction = exact[1:] - np.array(arc_tangents()[1:])  # the first is an integer, an eighth
    assert arc_tangents()[0] == 1 << 37
    assert fraction.min() > 1e-3 and fraction.max() < 1 - 1e-3


@pytest.mark.parametrize(
    ("x", "xy_width", "angle_width"),
    [(1 << 47, 48, 24), (-(1 << 47) - 1, 48, 24), (0, 61, 24), (0, 8, 24), (0, 48, 29)],
)
def test_cordic_vector_model_rejects_what_is_out_of_range(
    x: int, xy_width: int, angle_width: int
) -> None:
    with pytest.raises(ValueError, match="cordic_vector"):
        cordic_vector(np.array([x]), np.array([1]), xy_width=xy_width, angle_width=angle_width)
