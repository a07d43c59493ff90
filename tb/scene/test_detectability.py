"""Brightness ratio and least power, with the numbers of the detectability paper."""

import math
import warnings

import numpy as np
import pytest

from vrscan.data.arrays import Floats
from vrscan.scene.detectability import (
    Beam,
    Filter,
    View,
    brightness_ratio,
    laser_irradiance,
    least_power_w,
    required_ratio,
)
from vrscan.scene.sun import collection

PAPER_BEAM = Beam(power_w=0.08, diameter_mm=6.8, divergence_rad=2e-3, fan_rad=1.57)
PAPER_FILTER = Filter(laser=0.585, band=0.395, ratio=0.0352)
RANGES = np.array([500.0, 1000.0, 1500.0])
UNEVEN = View(laser_reflectance=0.2, background_reflectance=0.35, cos_in=0.8)


def test_striper_spreads_its_power_as_the_paper_has_it() -> None:
    # By hand: at 1 m the line is 1.57 m long and 2 + 6.8 = 8.8 mm wide.
    assert float(PAPER_BEAM.area_mm2(1000.0)) == pytest.approx(1570.0 * 8.8, rel=1e-12)
    got = float(laser_irradiance(PAPER_BEAM, 1000.0, 0.5))
    assert got == pytest.approx(0.5 * 0.080 / (1.57 * 0.0088), rel=1e-12)
    exact = (500.0 * 1.57 + 6.8) / (500.0 * 1.57)
    assert exact - 1.0 == pytest.approx(0.009, abs=5e-4)  # what D_1 leaves out


def test_spot_keeps_its_power_together() -> None:
    spot = Beam(power_w=0.05, diameter_mm=1.0, divergence_rad=1e-3)
    got = float(laser_irradiance(spot, 600.0))
    assert got == pytest.approx(0.05 / (math.pi * 0.0008**2), rel=1e-12)  # 1.6 mm across
    sun = 1000.0
    spot_ratio = float(brightness_ratio(spot, 600.0, sun, PAPER_FILTER)) - 1.0
    striper = Beam(power_w=0.05, diameter_mm=1.0, divergence_rad=1e-3, fan_rad=1.57)
    striper_ratio = float(brightness_ratio(striper, 600.0, sun, PAPER_FILTER)) - 1.0
    assert spot_ratio / striper_ratio == pytest.approx(600.0 * 1.57 / (math.pi / 4.0 * 1.6))


def _pixel_irradiance(
    laser_w_m2: Floats | float, reflectance: float, off_axis_rad: float
) -> Floats:
    """Return the irradiance on a pixel, W/m^2, at f/2.4 under a sun of 420 W/m^2; (2)."""
    light = laser_w_m2 * PAPER_FILTER.laser + 420.0 * PAPER_FILTER.ratio * PAPER_FILTER.band
    return reflectance / math.pi * collection(2.4, off_axis_rad) * light


@pytest.mark.parametrize("view", [View(), UNEVEN, View(background_off_axis_rad=0.3)])
def test_ratio_is_the_quotient_of_two_pixels(view: View) -> None:
    # (3) by (2), against (4).
    laser = laser_irradiance(PAPER_BEAM, RANGES, view.cos_in)
    with_laser = _pixel_irradiance(laser, view.laser_reflectance, view.laser_off_axis_rad)
    without = _pixel_irradiance(0.0, view.background_reflectance, view.background_off_axis_rad)
    got = brightness_ratio(PAPER_BEAM, RANGES, 420.0, PAPER_FILTER, view)
    np.testing.assert_allclose(got, with_laser / without, rtol=1e-12)


@pytest.mark.parametrize("required", [1.0, 1.3, 4.0])
def test_least_power_reaches_its_ratio_exactly(required: float) -> None:
    power = least_power_w(PAPER_BEAM, RANGES, 420.0, PAPER_FILTER, UNEVEN, required=required)
    assert np.all(power > 0.0)
    for range_mm, watts in zip(RANGES, power, strict=True):
        beam = Beam(float(watts), PAPER_BEAM.diameter_mm, PAPER_BEAM.divergence_rad, 1.57)
        got = float(brightness_ratio(beam, range_mm, 420.0, PAPER_FILTER, UNEVEN))
        assert got == pytest.approx(required, rel=1e-13)


def test_printed_least_power_is_not_that_of_equation_4() -> None:
    # (6) as printed, at 1 m.
    dark = 0.35 - 0.2
    printed = dark * 420.0 * 0.0352 * 0.395 / (0.8 * 0.2 * 0.395) * (1.570 * 0.0088)
    ours = float(least_power_w(PAPER_BEAM, 1000.0, 420.0, PAPER_FILTER, UNEVEN))
    print(f"\nleast power {1e3 * ours:.1f} mW, (6) as printed {1e3 * printed:.1f} mW")
    assert printed / ours == pytest.approx(0.585 / 0.395, rel=1e-12)
    beam = Beam(printed, 6.8, 2e-3, 1.57)
    assert float(brightness_ratio(beam, 1000.0, 420.0, PAPER_FILTER, UNEVEN)) > 1.2


def test_equal_reflectances_ask_for_no_power() -> None:
    assert np.all(least_power_w(PAPER_BEAM, RANGES, 900.0, PAPER_FILTER) == 0.0)
    bright = View(laser_reflectance=0.9, background_reflectance=0.1)
    assert np.all(least_power_w(PAPER_BEAM, RANGES, 900.0, PAPER_FILTER, bright) == 0.0)
    assert np.all(brightness_ratio(PAPER_BEAM, RANGES, 900.0, PAPER_FILTER) > 1.0)
    assert np.all(least_power_w(PAPER_BEAM, RANGES, 900.0, PAPER_FILTER, required=1.5) > 0.0)


@pytest.mark.parametrize(("background", "dark"), [(542.0, 15.0), (20_000.0, 15.0), (3.0, 30.0)])
def test_required_ratio_is_what_the_noise_asks_for(background: float, dark: float) -> None:
    ratio = required_ratio(10.0, background, dark)
    rng = np.random.default_rng(4)
    lit = rng.poisson(ratio * background, 400_000) + rng.normal(0.0, dark, 400_000)
    measured = (lit.mean() - background) / lit.std()
    print(f"\nbackground {background:.0f} e, B {ratio:.4f}: S/N {measured:.3f}, asked 10")
    assert measured == pytest.approx(10.0, rel=0.01)
    with pytest.raises(ValueError, match="above 0"):
        required_ratio(10.0, 0.0, 15.0)


def test_no_sun_and_no_laser_are_defined() -> None:
    dark = Beam(power_w=0.0, diameter_mm=1.0, divergence_rad=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.all(np.isinf(brightness_ratio(PAPER_BEAM, RANGES, 0.0, PAPER_FILTER)))
        assert np.all(brightness_ratio(dark, RANGES, 0.0, PAPER_FILTER) == 1.0)
        assert np.all(brightness_ratio(dark, RANGES, 500.0, PAPER_FILTER) == 1.0)
        assert np.all(least_power_w(dark, RANGES, 0.0, PAPER_FILTER, UNEVEN, required=9.0) == 0.0)
    with pytest.raises(ValueError, match="range"):
        brightness_ratio(PAPER_BEAM, 0.0, 500.0, PAPER_FILTER)
    with pytest.raises(ValueError, match="cos_in"):
        View(cos_in=0.0)
