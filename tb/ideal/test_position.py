"""Position, sigma and confidence in float against signals whose answer is known."""

import numpy as np
import pytest

from vrscan.ideal.confidence import (
    free_confidence,
    object_confidence,
    printed_confidence,
    signal_to_noise,
)
from vrscan.ideal.position import first_harmonic, windows

SEED = 20100301


def phase(pixels: np.ndarray, width: np.ndarray, *, period_n: bool, **other: float):
    count = len(pixels)
    return first_harmonic(
        pixels,
        width,
        period_n=period_n,
        background=np.full(count, other.get("background", 0.0)),
        noise=np.full(count, other.get("noise", 1.0)),
        kappa=other.get("kappa", 0.2),
    )


@pytest.mark.parametrize("pedestal", [0.0, 60.0, 1e4])
def test_with_period_n_a_raised_cosine_is_found_on_any_pedestal(pedestal: float) -> None:
    for n in range(3, 256):
        shift = np.linspace(0.0, n, 37, endpoint=False)
        step = np.arange(n)
        pixels = pedestal + 1.0 + np.cos(2 * np.pi * (step - shift[:, None]) / n)
        found = phase(pixels, np.full(37, n), period_n=True)
        error = (found.delta - shift + n / 2) % n - n / 2
        assert np.abs(error).max() < 1e-10 * n * max(pedestal, 1.0)
        assert np.allclose(found.magnitude, n / 2)


def test_with_period_n_minus_1_a_pedestal_pulls() -> None:
    """The paper's period puts first and last sample on one phase."""
    step = np.arange(21)
    peak = np.exp(-0.5 * ((step - 9.0) / 3.0) ** 2)[None]
    width = np.array([21])
    clean, raised = (phase(p, width, period_n=False).delta[0] for p in (peak, peak + 1.0))
    assert clean == pytest.approx(9.0, abs=0.01)
    assert abs(raised - clean) > 0.05
    even = [phase(p, width, period_n=True).delta[0] for p in (peak, peak + 1.0)]
    assert even[0] == pytest.approx(even[1], abs=1e-12)


def test_flat_and_dark_windows_have_no_phase() -> None:
    pixels = np.zeros((3, 9))
    pixels[0] = 4095.0
    pixels[1, :5] = 7.0
    found = phase(pixels, np.array([9, 5, 9]), period_n=True)
    assert found.no_phase.all()
    assert not found.delta.any()
    assert not found.sigma.any()


def test_windows_are_cut_from_lines() -> None:
    lines = np.arange(40, dtype=np.uint16).reshape(2, 20)
    cut = windows(lines, np.array([3, 17]), np.array([2, 3]))
    assert cut.tolist() == [[3.0, 4.0, 0.0], [37.0, 38.0, 39.0]]
    assert windows(lines[:0], np.zeros(0, int), np.zeros(0, int)).shape == (0, 0)


@pytest.mark.parametrize("period_n", [True, False])
@pytest.mark.parametrize("kappa", [0.0, 0.2])
@pytest.mark.parametrize("n", [12, 25, 60])
def test_sigma_is_the_spread_of_noisy_positions(n: int, kappa: float, period_n: bool) -> None:
    trials = 40_000
    rng = np.random.default_rng(SEED)
    step = np.arange(n)
    peak = 2000.0 * np.exp(-0.5 * ((step - 0.47 * n) / (n / 6.0)) ** 2)
    noise = 4.0
    deviation = np.sqrt(noise**2 + kappa * peak)
    pixels = peak + deviation * rng.standard_normal((trials, n))
    width = np.full(trials, n)
    found = phase(pixels, width, period_n=period_n, noise=noise, kappa=kappa)
    want = phase(peak[None], np.array([n]), period_n=period_n, noise=noise, kappa=kappa).sigma[0]
    # The spread of a spread over 40,000 trials is 0.35 %: four of it, and the curvature.
    assert found.delta.std() == pytest.approx(want, rel=0.02)
    assert np.median(found.sigma) == pytest.approx(want, rel=0.02)


def test_sigma_of_white_noise_is_the_law_of_the_phase() -> None:
    """std(delta) = 0.1125 T / snr1, snr1 = |P1| / (sqrt(N) sigma_n)."""
    n = 31
    peak = 1000.0 * np.exp(-0.5 * ((np.arange(n) - 15.0) / 5.0) ** 2)[None]
    found = phase(peak, np.array([n]), period_n=True, noise=3.0, kappa=0.0)
    snr1 = found.magnitude[0] / (np.sqrt(n) * 3.0)
    assert found.sigma[0] == pytest.approx(0.1125 * n / snr1, rel=0.001)


def test_signal_to_noise_where_it_is_undefined() -> None:
    snr = signal_to_noise(
        np.array([100, 50, 50, 60]), np.array([50.0, 50.0, 60.0, 50.0]), np.array([5.0, 0, 5.0, 0])
    )
    assert snr.tolist() == [10.0, 0.0, 0.0, np.inf]


def test_confidences() -> None:
    valid = np.array([True, True, True, False])
    z, sigma_z = np.array([500.0, 500.0, 250.0, 500.0]), np.array([0.5, 0.0, 0.25 / 1.96, 0.5])
    found = object_confidence(z, sigma_z, valid, tolerance=0.001)
    assert found == pytest.approx([0.682689, 1.0, 0.95, 0.0], abs=1e-5)
    snr = np.array([5.0, np.inf, 20.0, 30.0])
    assert printed_confidence(snr, valid, snr_max=20.0).tolist() == [0.25, 1.0, 1.0, 0.0]
    power = np.array([100, 100, 100, 50])
    assert free_confidence(power, ~valid, power_max=100).tolist() == [0.0, 0.0, 0.0, 0.5]
