"""Spots and noise of single calls: pixel integration, the converter, the bound."""

import numpy as np
import pytest

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
