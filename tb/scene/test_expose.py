"""Spots and noise of single calls: pixel integration, the converter, the bound."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.special import gammaincinv

from vrscan.scene.sensor import cramer_rao_variance, expose, spot_electrons

SEED = 20100301


def test_a_spot_holds_its_electrons_wherever_it_is() -> None:
    position = np.array([100.0, 100.3, 1999.7, np.nan, -3.0])
    sigma = np.array([1.0, 2.5, 6.0, 2.0, 2.0])
    electrons = spot_electrons(position, sigma, np.full(5, 1000.0), 2048)
    whole = 1000.0 * sigma * np.sqrt(2 * np.pi)
    assert np.allclose(electrons[:3].sum(axis=1), whole[:3], rtol=1e-12)
    centre = (electrons[:3] * np.arange(2048)).sum(axis=1) / whole[:3]
    assert np.allclose(centre, position[:3], atol=1e-9)
    assert not electrons[3].any()
    assert 0.0 < electrons[4].sum() < 0.2 * whole[4]  # most of it falls beside the sensor


def test_noise_has_the_stated_size() -> None:
    rng = np.random.default_rng(SEED)
    light = np.zeros((200, 2048))
    light[:, 1000:] = 5000.0
    counts = expose(
        light, rng, background_counts=60.0, read_noise_counts=3.0, kappa=0.2, pixel_width=12
    ).astype(float)
    dark, bright = counts[:, :1000], counts[:, 1000:]
    assert dark.mean() == pytest.approx(60.0, abs=0.05)
    assert dark.var() == pytest.approx(9.0 + 0.2 * 60.0 + 1 / 12, rel=0.02)
    assert bright.mean() == pytest.approx(1060.0, abs=0.1)
    assert bright.var() == pytest.approx(9.0 + 0.2 * 1060.0 + 1 / 12, rel=0.02)


def test_the_bound_is_the_closed_form_at_both_ends() -> None:
    sigma, height, step = np.array([4.0]), np.array([1e4]), 1e-3
    spot, ahead, behind = (
        spot_electrons(np.array([1000.3 + s]), sigma, height, 2048) for s in (0.0, step, -step)
    )
    slope = (ahead - behind) / (2 * step)
    white = cramer_rao_variance(0.0 * spot, slope, 100.0**2)[0] ** 0.5
    # Pixels blur the spot: its variance grows by 1/12 px^2 and its slope falls.
    assert white == pytest.approx(1.0623 * np.sqrt(4.0) * 100.0 / 1e4, rel=0.02)
    shot = cramer_rao_variance(spot, slope, 1e-9)[0] ** 0.5
    assert shot == pytest.approx(np.sqrt(16.0 + 1 / 12) / np.sqrt(spot.sum()), rel=0.001)


def spot_and_slope(
    centre: float, sigma: float, peak: float, length: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return a spot's electrons and their derivative by its place, [1, length] each."""
    place = np.array([centre - 1e-3, centre, centre + 1e-3])
    behind, spot, ahead = spot_electrons(place, np.full(3, sigma), np.full(3, peak), length)
    return spot[None], (ahead - behind)[None] / 2e-3


@pytest.mark.parametrize("reach", [12, 24])
def test_the_bound_of_pure_speckle_is_the_closed_form(reach: int) -> None:
    """C s^2 sqrt(3 / (2 X^3)) for a Gaussian that is cut at +-X: the flanks tell most."""
    spot, slope = spot_and_slope(100.0, 8.0, 1e9, 201)
    inside = np.abs(np.arange(201) - 100.0) <= reach
    for contrast in (0.1, 0.3):
        found = cramer_rao_variance(spot * inside, slope * inside, 1e-9, contrast)[0] ** 0.5
        predicted = contrast * 8.0**2 * math.sqrt(3 / (2 * (reach + 0.5) ** 3))
        print(f"C {contrast}, cut at {reach}.5 px: {found:.4f} / {predicted:.4f} px")
        assert found == pytest.approx(predicted, rel=0.01)


def negative_binomial(counts: np.ndarray, contrast: float) -> Callable[[np.ndarray], float]:
    """Return minus the log likelihood of a mean, of Poisson counts with gamma gains."""
    cells = contrast**-2
    return lambda mean: float(
        ((counts + cells) * np.log(mean + cells) - counts * np.log(mean)).sum()
    )


def gains_and_read_noise(
    signal: np.ndarray, contrast: float, deviation: float
) -> Callable[[np.ndarray], float]:
    """Return minus the log likelihood of a mean, by quadrature over the gain of every pixel."""
    cells = contrast**-2
    gain = gammaincinv(cells, (np.arange(128) + 0.5) / 128) / cells

    def minus_log(mean: np.ndarray) -> float:
        away = (signal[:, None] - mean[:, None] * gain) / deviation
        return -float(np.log(np.exp(-0.5 * np.square(away)).mean(axis=1) + 1e-300).sum())

    return minus_log


@pytest.mark.parametrize(
    ("contrast", "peak", "deviation"), [(0.1, 300.0, 0.0), (0.3, 1000.0, 0.0), (0.2, 1e6, 1.5e5)]
)
def test_the_most_likely_place_reaches_the_bound_with_speckle(
    contrast: float, peak: float, deviation: float
) -> None:
    """Fitted with the exact likelihood; no centroid, matched or weighted fit does better."""
    trials, length, sigma = 2500, 25, 3.0
    rng = np.random.default_rng(SEED)
    grid = np.arange(length)

    def spot(centre: float) -> np.ndarray:
        return peak * np.exp(-0.5 * np.square((grid - centre) / sigma)) + 1e-9

    true = rng.uniform(11.5, 12.5, trials)
    light = np.array([spot(centre) for centre in true])
    gains = rng.gamma(contrast**-2, contrast**2, light.shape)
    counts = rng.poisson(light * gains) if not deviation else light * gains
    counts = counts + deviation * rng.standard_normal(light.shape)
    slope = light * (grid - true[:, None]) / sigma**2
    bound = cramer_rao_variance(light, slope, deviation**2, contrast).mean()

    found = np.empty(trials)
    for i, line in enumerate(counts):
        minus_log = (
            gains_and_read_noise(line, contrast, deviation)
            if deviation
            else negative_binomial(line, contrast)
        )
        found[i] = minimize_scalar(
            lambda centre, of=minus_log: of(spot(centre)), bounds=(8.0, 16.0), method="bounded"
        ).x
    error = found - true
    efficiency = bound / np.square(error).mean()
    # Unbiased estimators that are linear about the true place, by their weights of the pixels.
    variance = deviation**2 + (0 if deviation else light) + np.square(contrast * light)
    others = []
    for weight in (1.0, 1.0 / light, 1.0 / light**2, 1.0 / variance):
        linear = weight * slope
        off = (linear * (counts - light)).sum(axis=1) / (linear * slope).sum(axis=1)
        others.append(bound / np.square(off).mean())
    print(
        f"C {contrast}, {peak:g} e, read noise {deviation:g} e: efficiency {efficiency:.3f} / 1, "
        f"of others {np.round(others, 3)}"
    )
    assert 0.93 < efficiency < 1.07
    assert abs(error.mean()) < 4 * math.sqrt(bound / trials)
    assert max(others) < 1.07 and max(others[:2]) < 0.93
