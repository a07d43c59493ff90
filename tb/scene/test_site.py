"""The detectability paper's case against its printed figures, and what stands around the wall."""

import math
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pvlib
import pytest

from vrscan.data.errors import InputError
from vrscan.scene.safety import emission_limit_j
from vrscan.scene.site import Moment, Outlook, Site, eye_limits_w, load
from vrscan.scene.sun import Sun, band_share

# Liu et al.: the errors of the two times that they print.
DIRECT_ERRORS, OWN_ERRORS = (0.267, 0.569), (0.140, 0.136)
SIGNAL = 0.080 / (1.57 * 0.5 * 0.0078) * 0.585  # W/m2 at 0.5 m, by hand from (1)
PER_SUN = 0.0352 * 0.395
DIRECT_W_M2 = 900.1  # ASTM G173, direct


def paper() -> tuple[Outlook, Outlook]:
    site = load(None)
    first, second = (Outlook(site, moment) for moment in site.moments)
    return first, second


def test_reference_follows_from_the_printed_errors() -> None:
    """B of the direct sun is too small by the printed error at the nearest range."""
    for outlook, error in zip(paper(), DIRECT_ERRORS, strict=True):
        direct = 1.0 + SIGNAL / (DIRECT_W_M2 * PER_SUN)
        measured = direct / (1.0 - error)
        implied = SIGNAL / ((measured - 1.0) * PER_SUN)
        print(f"\nerror {error}: B {direct:.4f} for {measured:.4f}, {implied:.1f} W/m2")
        assert outlook.moment.inferred_w_m2 == pytest.approx(implied, abs=1.0)
        assert outlook.direct_sun[0] == pytest.approx(direct, rel=1e-4)
        found = np.abs(outlook.direct_sun / outlook.reference - 1.0)
        assert found.max() == pytest.approx(error, abs=1e-3)
        assert found.argmax() == 0
        # The other sign would need more light than the sun gives outside the atmosphere.
        other = SIGNAL / ((direct / (1.0 + error) - 1.0) * PER_SUN)
        assert other > 1361.0


def test_errors_are_below_the_papers_own() -> None:
    for outlook, error in zip(paper(), OWN_ERRORS, strict=True):
        found = outlook.model / outlook.reference - 1.0
        print(f"\n{outlook.moment.time:%H:%M}: {100 * found} %, the paper's up to {100 * error} %")
        assert np.abs(found).max() < error
        assert outlook.moment.published_error == error
        assert np.all(outlook.model > 1.0)  # the paper: detectable in all scenarios


def test_ground_of_grass_gives_what_the_shade_lacks() -> None:
    """With the albedo of all sunlight the shade is too dark; the band's own brings it near 201."""
    _, shade = paper()
    printed = Site(sun=Sun(linke_turbidity=4.93, albedo=0.2), moment=list(load(None).moments))
    _, dark = (Outlook(printed, moment) for moment in printed.moments)
    print(
        f"\nin shade: albedo 0.2 {dark.sun_w_m2:.0f}, 0.4 {shade.sun_w_m2:.0f}, inferred 201 W/m2"
    )
    assert dark.sun_w_m2 == pytest.approx(138.0, abs=2.0)
    assert shade.sun_w_m2 == pytest.approx(201.0, rel=0.12)
    ground = shade.parts_w_m2["ground"] - dark.parts_w_m2["ground"]
    ghi = clear_sky(shade.moment.time)[0]
    assert ground == pytest.approx(0.5 * 0.2 * ghi, rel=2e-3)


def clear_sky(when: datetime) -> tuple[float, float]:
    """Return ghi and dni of pvlib's own clear sky."""
    place = pvlib.location.Location(1.30, 103.77, altitude=20.0)
    sky = place.get_clearsky(pd.DatetimeIndex([when]), linke_turbidity=4.93).iloc[0]
    return float(sky["ghi"]), float(sky["dni"])


def test_direct_light_is_the_clear_skys_on_a_north_wall() -> None:
    sunny, shade = paper()
    dni = clear_sky(sunny.moment.time)[1]
    elevation, azimuth = math.radians(sunny.elevation_deg), math.radians(sunny.azimuth_deg)
    want = dni * math.cos(elevation) * math.cos(azimuth)
    want *= band_share(770.0, 790.0, "direct") / band_share(770.0, 790.0)
    assert sunny.parts_w_m2["direct"] == pytest.approx(want, rel=5e-3)
    assert shade.parts_w_m2["direct"] == 0.0
    place = pvlib.solarposition.get_solarposition(
        pd.DatetimeIndex([shade.moment.time]), 1.30, 103.77
    ).iloc[0]
    assert shade.azimuth_deg == pytest.approx(float(place["azimuth"]), abs=0.05)


def test_turbidity_is_that_of_june_in_singapore() -> None:
    when = pd.DatetimeIndex([load(None).moments[0].time])
    known = pvlib.clearsky.lookup_linke_turbidity(when, 1.30, 103.77).iloc[0]
    assert load(None).sun.linke_turbidity == pytest.approx(float(known), abs=0.005)


def test_least_power_is_6_with_the_lasers_transmittance() -> None:
    sunny, _ = paper()
    area = 1.57 * 0.5 * 0.0078
    by_hand = (0.35 - 0.2) / 0.2 * sunny.sun_w_m2 * PER_SUN / 0.585 * area
    assert sunny.least_w[0] == pytest.approx(by_hand, rel=1e-9)
    assert sunny.printed_least_w[0] / sunny.least_w[0] == pytest.approx(0.585 / 0.395)


def test_ansi_limit_with_the_printed_width_gives_the_papers_power() -> None:
    """5: R 50 cm, D_2 7 mm, 10 s; 80 mW is the exposure on the line's cross section."""
    striper = load(None).laser.model_copy(update={"diameter_mm": 6.0})  # D_2 = 7 mm at 0.5 m
    mpe = 1.8e-3 * 10.0 ** (0.002 * 80.0) * 10.0**0.75  # J/cm2
    printed, exact = eye_limits_w(striper, 500.0, 10.0)
    print(f"\n(5) {1e3 * printed:.1f} mW, exposure on the line {1e3 * exact:.1f} mW, chosen 80 mW")
    assert printed == pytest.approx(50.0 * mpe * 0.385 * 1.57 / (10.0 * 0.7), rel=1e-9)
    assert exact == pytest.approx(mpe * 50.0 * 1.57 * 0.7 / 10.0, rel=1e-9)
    assert exact == pytest.approx(0.080, rel=0.01)
    assert printed / exact == pytest.approx(0.385 / 0.7**2)


@pytest.mark.parametrize("across_mm", [1.0, 5.0, 7.0, 12.0])
def test_eye_limit_is_the_mean_over_the_pupil(across_mm: float) -> None:
    """Rays of the line counted in a pupil; the energy that enters is that of IEC's class 1."""
    site = load(None)
    striper = site.laser.model_copy(update={"diameter_mm": across_mm, "divergence_mrad": 0.0})
    _, power = eye_limits_w(striper, 500.0, 10.0)
    rng = np.random.default_rng(3)
    along, across = rng.uniform(-3.5, 3.5, (2, 400_000))
    inside = np.hypot(along, across) < 3.5
    lit_mm2 = 49.0 * float((inside & (np.abs(across) < 0.5 * across_mm)).mean())
    entered = power * 10.0 * lit_mm2 / (1.57 * 500.0 * across_mm)
    assert entered == pytest.approx(emission_limit_j("1", 780.0, 10.0), rel=0.02)


def test_eye_limits_end_where_the_rule_does() -> None:
    striper = load(None).laser
    with pytest.raises(InputError, match="wavelength_nm = 658"):
        eye_limits_w(striper.model_copy(update={"wavelength_nm": 658.0}), 500.0, 1.0)
    with pytest.raises(InputError, match="time_s = 11"):
        eye_limits_w(striper, 500.0, 11.0)
    with pytest.raises(ValueError, match="no fan"):
        eye_limits_w(striper.model_copy(update={"fan_rad": None}), 500.0, 1.0)


def test_buildings_in_front_of_a_sunlit_wall_take_more_than_they_give() -> None:
    _, shade = paper()
    sun = shade.site.sun.model_copy(update={"skyline_deg": 30.0})
    built = Outlook(shade.site.model_copy(update={"sun": sun}), shade.moment)
    print(f"\nopen land {shade.sun_w_m2:.0f}, skyline of 30 degrees {built.sun_w_m2:.0f} W/m2")
    assert built.sun_w_m2 < shade.sun_w_m2
    assert built.parts_w_m2["facades"] > 20.0


def test_own_site_starts_from_nothing_of_the_papers_light(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    path.write_text(
        "range_mm = [300]\n[filter]\nband_nm = [645, 665]\nlaser = 0.8\nband = 0.7\n"
        '[sun]\ntime = "2026-06-01T12:00:00+02:00"\nlatitude_deg = 48\nlongitude_deg = 11\n'
        "[wall]\nfacing_deg = 180\n"
    )
    site = load(path)
    assert site.filter.glass.ratio == pytest.approx(0.02754, abs=1e-5)
    assert site.moments == (Moment(time=site.sun.time),)
    found = Outlook(site, site.moments[0])
    assert np.isnan(found.reference).all()
    assert found.sun_w_m2 > 300.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("range_mm = []", "range_mm"),
        ("range_mm = [0]", "range_mm.0 = 0"),
        ("[laser]\npower_mw = 5", "laser.wavelength_nm"),
        ("[wall]\ndarkest = 0.5", "darkest 0.5 is above brightest 0.35"),
        ("[filter]\nband_nm = [790, 770]\nlaser = 1\nband = 1", "must rise"),
        ('[[moment]]\ntime = "noon"', "ISO 8601"),
        ("[sun]\nskyline_deg = 90", "sun.skyline_deg = 90"),
        ("colour = 3", "unknown key colour"),
        ("range_mm = [", "not a TOML file"),
    ],
)
def test_bad_site_is_named(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
