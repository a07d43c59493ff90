"""The beam against closed forms, and against a plane wave that a 2-D FFT carries along."""

import math

import numpy as np
import pytest
from carried_beam import carried, irradiance
from pydantic import ValidationError
from scipy.optimize import curve_fit
from scipy.special import j1

from vrscan.data.arrays import Floats
from vrscan.data.errors import InputError
from vrscan.scene import beam
from vrscan.scene.beam import Laser

UNCUT = Laser(aperture_mm=math.inf)


def test_the_uncut_beam_is_gaussian() -> None:
    # iria-digest 4.4: Rayleigh range 1.194 m, diameters 1.022 and 1.305 mm at 0.25 and 1 m.
    assert beam.rayleigh_mm(UNCUT) == pytest.approx(1194.0, abs=0.5)
    diameter = 2.0 * beam.radius_mm(np.array([0.0, 250.0, 1000.0]), UNCUT)
    assert np.allclose(diameter, [1.0, 1.022, 1.305], atol=5e-4)
    thin = UNCUT.model_copy(update={"beam_diameter_mm": 0.5})
    assert beam.rayleigh_mm(thin) == pytest.approx(298.0, abs=0.5)
    diameter = 2.0 * beam.radius_mm(np.array([250.0, 1000.0]), thin)
    assert np.allclose(diameter, [0.652, 1.749], atol=5e-4)


@pytest.mark.parametrize("waist_mm", [-300.0, 0.0, 150.0, 800.0])
@pytest.mark.parametrize("m2", [1.0, 1.7])
def test_an_uncut_beam_follows_the_hyperbola_of_its_waist(waist_mm: float, m2: float) -> None:
    laser = Laser(beam_diameter_mm=0.3, waist_mm=waist_mm, m2=m2, aperture_mm=math.inf)
    z = np.linspace(0.0, 2000.0, 41)
    rayleigh = math.pi * 0.15**2 / (m2 * 658e-6)
    expected = 0.15 * np.sqrt(1.0 + np.square((z - waist_mm) / rayleigh))
    assert np.allclose(beam.radius_mm(z, laser), expected, rtol=1e-12)
    assert beam.cut(laser) is None


@pytest.mark.parametrize(
    ("ratio", "level", "width"),
    [
        (1.0, 0.5, 1.1315),
        (1.0, math.exp(-2.0), 1.8292),
        (0.5, 0.5, 1.5460),
        (1 / 3, 0.5, 2.2493),
        (1e4, 0.5, 1.02899),  # Airy
    ],
)
def test_widths_of_the_cut_far_field(ratio: float, level: float, width: float) -> None:
    found = beam.far_field_width(ratio, level)
    print(f"T = {ratio:.3g}, level {level:.3f}: {found:.5f} / {width} lambda/D")
    assert found == pytest.approx(width, abs=6e-5)


def test_the_far_field_goes_from_gauss_to_airy() -> None:
    u = np.linspace(0.01, 3.0, 200)
    airy = np.square(2.0 * j1(math.pi * u) / (math.pi * u))
    assert np.allclose(beam.far_field(u, 1e3), airy, atol=1e-6)
    # exp(-x^2/T^2) over all x transforms to exp(-(pi u T)^2 / 4)
    gauss = np.exp(-np.square(math.pi * u * 0.25) / 2.0)
    assert np.allclose(beam.far_field(u, 0.25), gauss, atol=1e-6)
    # The closed form below 0.2 joins the integral above it.
    below, above = (beam.far_field_width(ratio) * ratio for ratio in (0.1999, 0.2001))
    assert below == pytest.approx(above, abs=1e-9)


@pytest.mark.parametrize("bad", [(0.0, 0.5), (-1.0, 0.5), (1.0, 1.0), (1.0, 0.01)])
def test_a_width_that_has_no_meaning(bad: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="far_field_width"):
        beam.far_field_width(*bad)
    with pytest.raises(ValueError, match="far_field"):
        beam.far_field(np.zeros(1), 0.1)


def test_what_passes_the_stop() -> None:
    assert 1.0 - beam.transmitted(1.0) == pytest.approx(0.1353, abs=1e-4)
    assert 1.0 - beam.transmitted(0.5) == pytest.approx(3.4e-4, abs=1e-5)
    assert beam.transmitted(0.0) == 1.0
    assert beam.output_mw(Laser()) == pytest.approx(50.0 * (1.0 - math.exp(-2.0)))
    assert beam.output_mw(UNCUT) == 50.0
    assert beam.output_mw(Laser(power_mw=0.0)) == 0.0
    rayleigh = beam.rayleigh_mm(UNCUT)
    spreading = Laser(waist_mm=-rayleigh, aperture_mm=2.0)  # sqrt(2) wider at the stop
    assert beam.truncation(spreading) == pytest.approx(math.sqrt(0.5), rel=1e-12)


@pytest.mark.parametrize(
    ("laser", "z"),
    [
        (Laser(), 0.0),
        (Laser(), 15.0),
        (Laser(), 100.0),
        (Laser(), 300.0),
        (Laser(), 400.0),
        (Laser(), 600.0),
        (Laser(), 1000.0),
        (Laser(aperture_mm=2 / 3), 250.0),
        (Laser(beam_diameter_mm=0.4, waist_mm=400.0, aperture_mm=0.8), 300.0),
        (Laser(beam_diameter_mm=0.4, waist_mm=200.0, aperture_mm=0.8), 700.0),  # past its focus
        (Laser(waist_mm=-500.0, aperture_mm=1.2), 500.0),
    ],
)
def test_a_cut_beam_is_as_wide_as_one_carried_by_fft(laser: Laser, z: float) -> None:
    pixel, size = 0.0125, 768
    axis, irradiance = carried(laser, z, pixel, size)
    radius = float(beam.radius_mm(np.array([z]), laser)[0])
    part = np.abs(axis) <= 2.5 * radius
    square = (np.square(axis[part])[:, None] + np.square(axis[part])).ravel()
    (_, fitted), _ = curve_fit(
        lambda s, a, w: a * np.exp(-2.0 * s / w**2),
        square,
        irradiance[np.ix_(part, part)].ravel() / pixel**2,
        p0=(1.0, radius),
    )
    print(f"{z} mm: radius {radius:.4f} / {fitted:.4f} mm")
    assert radius == pytest.approx(abs(fitted), rel=0.01)


@pytest.mark.parametrize("z", [250.0, 400.0])
def test_the_two_oracles_of_a_cut_beam_agree(z: float) -> None:
    laser, pixel = Laser(waist_mm=100.0), 0.0125
    axis, light = carried(laser, z, pixel, 1024)
    middle = len(axis) // 2
    near = np.s_[middle : middle + 80]
    apart = light[middle, near] / pixel**2 - irradiance(laser, z, axis[near])
    assert np.abs(apart).max() < 5e-3 * irradiance(laser, z, np.zeros(1))[0]


def test_nothing_hit_nothing_nan() -> None:
    z = np.array([0.0, 1e-9, 1e9, np.inf])
    for laser in (Laser(), UNCUT, Laser(waist_mm=1e4), Laser(aperture_mm=0.01)):
        radius, zone = beam.radius_mm(z, laser), beam.zone(z, laser)
        assert np.all(radius > 0.0)
        assert np.isfinite(radius[:3]).all()
        assert np.isinf(radius[3])
        assert np.all((zone >= 0.0) & (zone <= 1.0))


def _trapezoid(time_s: Floats, rise_s: float, pulse_s: float) -> Floats:
    """Return the pulse's power over its top, its edges ``rise_s`` from foot to top."""
    beyond = 0.5 * pulse_s - np.abs(time_s)
    if rise_s == 0.0:
        return np.where(beyond >= 0.0, 1.0, 0.0)
    return np.clip(beyond / rise_s + 0.5, 0.0, 1.0)


@pytest.mark.parametrize("rise_us", [0.0, 0.05, 1.0])
def test_the_pulse_transforms_as_its_samples_do(rise_us: float) -> None:
    laser, pulse = Laser(rise_us=rise_us), 1e-6
    t = (np.arange(400_000) + 0.5) / 400_000 * 2.4e-6 - 1.2e-6
    shape = _trapezoid(t, rise_us * 1e-6, pulse)
    step = t[1] - t[0]
    f = np.array([0.0, 1e5, 7e5, 3.3e6])
    summed = (np.cos(2.0 * math.pi * f[:, None] * t) @ shape) * step / pulse
    assert np.allclose(beam.pulse_transform(f, laser, pulse), summed, atol=2e-6)
    rms = math.sqrt((np.square(t) @ shape) / shape.sum())
    assert beam.pulse_rms_s(laser, pulse) == pytest.approx(rms, rel=1e-5)


def test_bad_lasers() -> None:
    for bad in (
        {"power_mw": -1.0},
        {"aperture_mm": 0.0},
        {"m2": 0.9},
        {"beam_diameter_mm": 0.0},
        {"wavelength_nm": 300.0},
        {"waist_mm": math.inf},
        {"colour": "red"},
    ):
        with pytest.raises(ValidationError):
            Laser.model_validate(bad)
    with pytest.raises(InputError, match=r"laser\.rise_us = 2: longer than the pulse of 1 us"):
        beam.pulse_rms_s(Laser(rise_us=2.0), 1e-6)
