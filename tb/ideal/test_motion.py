"""The mirror's motion against its definition: (11), (12), and the two crossings of a mark."""

import math

import numpy as np
import pytest
from harness import generator
from scanners import SCANNERS, resonant
from scipy.optimize import brentq

from vrscan.data.config import HARMONICS
from vrscan.ideal.motion import crossings, half_turn_residual, motion

LARGE = [[1.0, 0.0], [0.03, 2.0], [0.01, -1.3], [4e-3, 0.7], [2e-3, 3.0], [1e-3, -1.1]]
MOTIONS = {"large": LARGE} | {
    name: config.mirror.harmonics for name, config in SCANNERS.items() if resonant(config)
}


def test_motion_is_the_series() -> None:
    """(12) term by term, with phases of many turns."""
    phase = generator(1).uniform(-1000.0, 1000.0, 200)
    want = np.zeros(200)
    for order, (size, lag) in zip(HARMONICS[:6], LARGE, strict=True):
        want += 0.36 * size * np.cos(2.0 * math.pi * order * phase - lag)
    got = motion(phase, 0.36, LARGE)
    assert np.abs(got - want).max() < 1e-10  # the oracle's own large arguments
    assert motion(np.zeros((2, 3)), 1.0, LARGE).shape == (2, 3)
    amplitudes = np.array([0.0, 0.5, 1.0])
    assert np.allclose(motion(np.zeros(3), amplitudes, LARGE), amplitudes * motion(0.0, 1.0, LARGE))
    for bad in ([], [1.0, 0.0], LARGE + LARGE[:4], [[1.0]] * 6, [[math.nan, 0.0]] * 6):
        with pytest.raises(ValueError, match="harmonics"):
            motion(phase, 1.0, bad)


def test_half_turn_residual_is_what_breaks_the_symmetry() -> None:
    """(11): odd harmonics leave nothing, a constant twice itself, an even one twice its size."""
    frequency, samples = 249.0, 150
    time = np.arange(6 * samples) / (samples * 249.3)  # no whole number of samples a period
    phase = time * frequency
    angle = motion(phase, 0.36, LARGE)
    spline = 11**4 * 4.0 * samples**-4.0 * 0.36  # should all of it be of the eleventh harmonic
    residual = half_turn_residual(time, angle, frequency)
    # At the ends the spline is a little worse.
    assert np.abs(residual[:-samples]).max() < spline * 1e-3
    assert residual.size == np.count_nonzero(time + 0.5 / frequency <= time[-1])
    extra = 2e-6 + 5e-6 * np.cos(4.0 * math.pi * phase)
    residual = half_turn_residual(time, angle + extra, frequency)[:-samples]
    assert np.abs(residual - 2.0 * extra[: residual.size]).max() < spline * 1e-3
    for bad in ((time[:3], angle[:3]), (time, angle[1:]), (time[:60], angle[:60])):
        with pytest.raises(ValueError, match="half_turn_residual"):
            half_turn_residual(*bad, frequency)


@pytest.mark.parametrize("n", range(len(HARMONICS)))
def test_each_harmonic_has_its_order(n: int) -> None:
    """As many pairs as are given count, and those that are 0 are as if they were not given."""
    harmonics = [[0.0, 0.0]] * n + [[0.5, 1.25]]
    phase = generator(2).uniform(0.0, 1.0, 100)
    want = 0.4 * 0.5 * np.cos(2.0 * math.pi * (2 * n + 1) * phase - 1.25)
    assert np.abs(motion(phase, 0.4, harmonics) - want).max() < 1e-14
    longer = harmonics + [[0.0, 0.0]] * (len(HARMONICS) - n - 1)
    assert np.allclose(
        motion(phase, 0.4, longer), motion(phase, 0.4, harmonics), rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("harmonics", MOTIONS.values(), ids=MOTIONS)
@pytest.mark.parametrize("mark_deg", [17.0, -17.0, 3.0])
def test_crossings_are_those_of_the_motion(harmonics: list[list[float]], mark_deg: float) -> None:
    """From amplitude to crossings by bracketing, and back by crossings()."""
    mark = math.radians(mark_deg)
    turn = 0.5 if mark < 0.0 else 0.0
    top = motion(np.linspace(-0.1, 0.1, 20_001), 1.0, harmonics)
    turning = float(np.linspace(-0.1, 0.1, 20_001)[np.argmax(top)]) + turn
    largest = float(top.max())
    for size in abs(mark) / largest * np.array([1.0001, 1.01, 1.2, 1.5, 3.0]):

        def beyond(p: float, size: float = float(size)) -> float:
            return float(motion(np.array(p), size, harmonics)) - mark

        out = brentq(beyond, turning - 0.25, turning, xtol=1e-15)
        back = brentq(beyond, turning, turning + 0.25, xtol=1e-15)
        amplitude, middle = crossings(np.array((back - out) / 2.0), mark, harmonics)
        assert abs(amplitude / size - 1.0) < 1e-11
        assert abs(middle - (back + out) / 2.0) < 1e-12


def test_crossings_at_the_ends_and_beyond() -> None:
    """The turning point itself, a quarter of a turn, and what makes no sense."""
    pure = [[1.0, 0.0]] + [[0.0, 0.0]] * 5
    amplitude, middle = crossings(np.array([0.0, 1 / 6]), 0.25, pure)
    assert np.allclose(amplitude, [0.25, 0.5], rtol=1e-14) and np.all(middle == 0.0)
    amplitude, _ = crossings(np.array([[0.25, 0.2499]]), 0.25, LARGE)
    assert amplitude.shape == (1, 2) and amplitude[0, 1] > 1.0
    negative = [[1.0, 0.0], [0.05, math.pi / 2]] + [[0.0, 0.0]] * 4
    amplitude, _ = crossings(np.array([0.25]), 0.25, negative)
    assert np.isinf(amplitude[0]) or amplitude[0] > 5.0
    for half, mark in ((-0.01, 0.25), (0.26, 0.25), (math.nan, 0.25), (0.1, 0.0)):
        with pytest.raises(ValueError, match="crossings"):
            crossings(np.array([half]), mark, pure)
    for size in (0.34, -0.34, 3.0):
        with pytest.raises(ValueError, match="too large"):
            crossings(np.array([0.01]), 0.25, [[1.0, 0.0], [size, 1.5]] + [[0.0, 0.0]] * 4)
    crossings(np.array([0.01]), 0.25, [[1.0, 0.0], [0.33, 1.5]] + [[0.0, 0.0]] * 4)
