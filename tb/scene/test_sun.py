"""Sun, sky and lamps against the reference spectrum, pvlib's tilted planes and the CIE's lamps."""

import math
import warnings
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pandas as pd
import pvlib
import pytest
from pydantic import ValidationError

from vrscan.data.arrays import Floats
from vrscan.data.errors import InputError
from vrscan.scene.sun import (
    Lamp,
    Sun,
    band_irradiance,
    band_share,
    eye_sensitivity,
    pixel_electrons,
    spectral_irradiance,
    watts_per_lumen,
)

ALL_NM = (280.0, 4000.0)  # every share is 1

# CIE 015:2018 spectra, integrated with the CIE's own V at 0.5 nm: mW in 645..665 nm a lumen.
CIE_LED = {"LED-B1": 0.2665, "LED-B2": 0.2469, "LED-B3": 0.1791, "LED-B4": 0.1374, "LED-B5": 0.1136}
CIE_TUBE = {"FL11": 0.0566, "FL12": 0.0651}
PLANCK_2800 = 0.4679


def unit(n: int, seed: int = 1) -> Floats:
    vector = np.random.default_rng(seed).normal(size=(n, 3))
    return np.asarray(vector / np.linalg.norm(vector, axis=1)[:, None])


def test_reference_spectrum_gives_the_known_figures() -> None:
    assert band_irradiance(*ALL_NM) == pytest.approx(1000.37, abs=0.005)
    assert band_irradiance(645.0, 665.0) == pytest.approx(27.55, abs=0.005)
    assert band_irradiance(645.0, 665.0, "direct") == pytest.approx(24.94, abs=0.005)
    assert 100.0 * band_share(645.0, 665.0) == pytest.approx(2.754, abs=5e-4)
    assert float(spectral_irradiance(658.0)) == pytest.approx(1.3855, abs=5e-5)
    assert 100.0 * band_share(770.0, 790.0) == pytest.approx(2.32, abs=5e-3)
    # A band between two entries of the table, and one that outgrows it.
    part = band_irradiance(657.2, 657.9) + band_irradiance(657.9, 660.1)
    assert part == pytest.approx(band_irradiance(657.2, 660.1), rel=1e-12)
    assert band_irradiance(100.0, 9000.0) == pytest.approx(band_irradiance(*ALL_NM), rel=1e-9)
    with pytest.raises(ValueError, match="empty"):
        band_irradiance(665.0, 645.0)


def test_clear_sky_alone_is_poorer_in_red() -> None:
    # What split() leaves out: the global spectrum less the direct one on a surface tilted by 37
    # degrees, sun at air mass 1.5 (48.19 degrees) in front of it.
    facing = math.cos(math.radians(48.19 - 37.0))
    sky = [
        band_irradiance(*band) - facing * band_irradiance(*band, "direct")
        for band in ((645.0, 665.0), ALL_NM)
    ]
    loss = 1.0 - sky[0] / sky[1] / band_share(645.0, 665.0)
    print(f"\nclear sky has {100 * loss:.1f} % less in band than the global spectrum")
    assert loss == pytest.approx(0.044, abs=0.002)


@pytest.mark.parametrize(
    ("latitude", "month", "declination"), [(0.0, 3, 0.0), (48.0, 6, 23.44), (-30.0, 12, -23.44)]
)
def test_sun_stands_where_it_should_at_noon(
    latitude: float, month: int, declination: float
) -> None:
    # Greatest height of the day: 90 - |latitude - declination|, and due south or north.
    noon = datetime(2026, month, 20, 12, 0, tzinfo=UTC)
    best = max(
        (
            Sun(latitude_deg=latitude, longitude_deg=0.0, time=noon + timedelta(minutes=step))
            for step in range(-30, 31)
        ),
        key=lambda sun: float(sun.towards()[1]),
    )
    east, height, north = -best.towards()[0], best.towards()[1], best.towards()[2]
    got = math.degrees(math.asin(height))
    print(f"\nlatitude {latitude}: highest {got:.2f} degrees")
    assert got == pytest.approx(90.0 - abs(latitude - declination), abs=0.35)
    assert abs(east) < 0.005
    if latitude:
        assert north * latitude < 0.0


@pytest.mark.parametrize("sky", ["clear", "hazy", "overcast", "given"])
@pytest.mark.parametrize("hour", [8, 13, 18])
def test_surfaces_get_what_pvlib_gives_tilted_planes(sky: str, hour: int) -> None:
    skies: dict[str, dict[str, Any]] = {
        "clear": {},
        "hazy": {"linke_turbidity": 7.0},
        "overcast": {"sky": "given", "dni_w_m2": 0.0, "dhi_w_m2": 250.0},
        "given": {"sky": "given", "ghi_w_m2": 400.0, "dhi_w_m2": 150.0},
    }
    given = skies[sky]
    heading, pitch, roll = 130.0, -35.0, 20.0
    when = datetime.fromisoformat(f"2026-06-03T{hour:02d}:10:00+02:00")
    sun = Sun.model_validate(
        {
            "latitude_deg": 48.1, "longitude_deg": 11.6, "altitude_m": 520, "time": when,
            "albedo": 0.3, "heading_deg": heading, "pitch_deg": pitch, "roll_deg": roll, **given,
        }
    )  # fmt: skip
    times = pd.DatetimeIndex([when])
    site = pvlib.location.Location(48.1, 11.6, altitude=520)
    place = site.get_solarposition(times, pressure=101325).iloc[0]
    extra = float(pvlib.irradiance.get_extra_radiation(when.timetuple().tm_yday))
    zenith = float(place["apparent_zenith"])
    cosine = math.cos(math.radians(zenith))
    if sun.sky == "clear":
        turbidity = given.get("linke_turbidity", 3.0)
        clear = site.get_clearsky(times, linke_turbidity=turbidity, dni_extra=extra).iloc[0]
        ghi, dni, dhi = (float(clear[key]) for key in ("ghi", "dni", "dhi"))
    elif sky == "overcast":
        ghi, dni, dhi = 250.0, 0.0, 250.0
    else:
        ghi, dni, dhi = 400.0, min(250.0 / cosine, extra), 150.0

    # The scanner's axes in east, north, up by three turns of a body: a way of its own.
    def turn(axis: int, degrees: float) -> Floats:
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        matrix = np.eye(3)
        matrix[i, i] = matrix[j, j] = c
        matrix[i, j], matrix[j, i] = -s, s
        return matrix

    looking_north = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])  # x y z to ENU
    to_enu = turn(2, -heading) @ turn(0, pitch) @ looking_north @ turn(2, roll)
    normal = unit(200)
    enu = normal @ to_enu.T
    tilt = np.degrees(np.arccos(enu[:, 2]))
    azimuth = np.degrees(np.arctan2(enu[:, 0], enu[:, 1])) % 360.0
    airmass = float(pvlib.atmosphere.get_relative_airmass(zenith))
    plane = pvlib.irradiance.get_total_irradiance(
        tilt, azimuth, zenith, float(place["azimuth"]), dni, ghi, dhi,
        dni_extra=extra, airmass=airmass, albedo=0.3, model="perez",
    )  # fmt: skip
    direct, other = sun.split(normal, band_nm=ALL_NM)
    np.testing.assert_allclose(direct, plane["poa_direct"], rtol=2e-3, atol=0.1)
    np.testing.assert_allclose(other, plane["poa_diffuse"], rtol=2e-3, atol=0.1)
    whole = sun.in_band_irradiance(normal)
    band = direct * band_share(645.0, 665.0, "direct") + other * band_share(645.0, 665.0)
    np.testing.assert_allclose(whole, band, rtol=1e-12)


def test_level_ground_gets_the_horizontal_irradiance() -> None:
    sun = Sun(sky="given", ghi_w_m2=700.0, dhi_w_m2=180.0, pitch_deg=-90.0)
    floor = np.array([[0.0, 0.0, -1.0]])  # the scanner looks down at it
    direct, other = sun.split(floor, band_nm=ALL_NM)
    print(f"\ndirect {direct[0]:.2f}, sky {other[0]:.2f} W/m^2")
    assert direct[0] == pytest.approx(520.0, rel=1e-9)
    assert other[0] == pytest.approx(180.0, rel=1e-9)
    ceiling = -floor
    assert sun.in_band_irradiance(ceiling, band_nm=ALL_NM)[0] == pytest.approx(0.2 * 700.0)


def test_shade_takes_the_sun_and_the_patch_around_it() -> None:
    sun = Sun()
    facing = np.tile(sun.towards(), (2, 1))
    direct, other = sun.split(facing, shaded=np.array([False, True]), band_nm=ALL_NM)
    print(f"\nfacing the sun {direct[0]:.0f} + {other[0]:.0f}, in shade {other[1]:.0f} W/m^2")
    assert direct[1] == 0.0 and direct[0] > 700.0
    assert 0.0 < other[1] < other[0]
    back = -facing[:1]  # a surface that sees neither is the same in shade
    assert sun.in_band_irradiance(back) == sun.in_band_irradiance(back, shaded=True)


def test_any_hour_and_normal_is_defined() -> None:
    normal = np.vstack([unit(60, 3), np.eye(3), -np.eye(3)])
    start = datetime(2026, 3, 1, tzinfo=UTC)
    dark = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for hour in range(0, 24 * 300, 61):
            sun = Sun(latitude_deg=60.0, longitude_deg=10.0, time=start + timedelta(hours=hour))
            try:
                got = sun.in_band_irradiance(normal)
            except InputError:
                dark += 1
                continue
            assert np.all(np.isfinite(got)) and np.all(got >= 0.0) and got.max() < 40.0
    print(f"\n{dark} of 119 hours without a sun")
    assert 30 < dark < 90


def test_site_without_a_sun_is_told() -> None:
    night = Sun.model_validate(
        {"latitude_deg": 48.1, "longitude_deg": 11.6, "time": "2026-01-10T22:00:00+01:00"}
    )
    with pytest.raises(InputError) as caught:
        night.in_band_irradiance(np.eye(3))
    text = str(caught.value)
    print(f"\n{text}")
    assert "\n" not in text
    for part in ("sun:", "48.1", "11.6", "2026-01-10T22:00:00+01:00", "degrees below the horizon"):
        assert part in text


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ({"time": "2026-06-24T12:30:00"}, "timezone"),
        ({"time": "noon"}, "ISO 8601"),
        ({"time": "2500-06-24T12:30:00Z"}, "1900 to 2100"),
        ({"sky": "given", "ghi_w_m2": 100.0}, "needs two of"),
        ({"dni_w_m2": 100.0}, 'belong to sky = "given"'),
        ({"latitude_deg": 91.0}, "less than or equal to 90"),
        ({"cloud": 0.1}, "unknown key cloud"),
    ],
)
def test_bad_sun_is_told(bad: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        Sun.model_validate(bad)


def test_background_electrons_of_a_pixel() -> None:
    # 0.15 W cm^-2 um^-1 over 20 nm on a surface of 0.3, f/3, 49 um^2, one line of 26.74 us.
    irradiance = 0.15 * 1e4 * 0.020
    assert irradiance == pytest.approx(30.0)
    got = pixel_electrons(
        0.3 * irradiance / math.pi,
        f_number=3.0,
        pixel_um2=49.0,
        exposure_s=26.74e-6,
        quantum_efficiency=0.5,
    )
    print(f"\n{float(got):.1f} e predicted 542")
    assert float(got) == pytest.approx(542.0, abs=1.0)


def test_eye_sensitivity_is_the_cies() -> None:
    # CIE 1924 V: its integral, its peak, and values of the table.
    seen = np.arange(360.0, 831.0)
    assert np.trapezoid(eye_sensitivity(seen), seen) == pytest.approx(106.857, rel=2e-3)
    at = np.array([450.0, 500.0, 555.0, 600.0, 650.0])
    np.testing.assert_allclose(eye_sensitivity(at), [0.038, 0.323, 1.0, 0.631, 0.107], atol=0.01)


def test_lamps_are_near_the_cies() -> None:
    got = {
        kind: 1e3 * watts_per_lumen(kind, 645.0, 665.0)
        for kind in ("led", "halogen", "fluorescent")
    }
    print("\nmW in 645..665 nm a lumen", {key: round(value, 4) for key, value in got.items()})
    print("CIE", CIE_LED, CIE_TUBE, "Planck 2800 K", PLANCK_2800)
    assert got["halogen"] == pytest.approx(PLANCK_2800, rel=5e-3)
    assert got["led"] == pytest.approx(CIE_LED["LED-B3"], rel=0.05)
    assert got["fluorescent"] == pytest.approx(CIE_TUBE["FL11"], rel=0.06)


def test_lamp_lights_by_direction_and_shade() -> None:
    normal = np.array([[0.0, 0.0, -1.0], [0.0, 0.6, -0.8], [0.0, -1.0, 0.0]])
    lamp = Lamp(kind="halogen", illuminance_lux=1000.0, direct=0.75, towards=[0.0, 3.0, -4.0])
    full = 1000.0 * watts_per_lumen("halogen", 645.0, 665.0)
    share = lamp.in_band_irradiance(normal, shaded=np.array([False, False, False])) / full
    np.testing.assert_allclose(share, [0.25 + 0.75 * 0.8, 1.0, 0.25], rtol=1e-12)
    np.testing.assert_allclose(lamp.in_band_irradiance(normal, shaded=True) / full, 0.25)
    assert np.all(Lamp(illuminance_lux=0.0).in_band_irradiance(normal) == 0.0)
    for bad in ({"kind": "neon"}, {"illuminance_lux": -1.0}, {"towards": [0.0, 0.0, 0.0]}):
        with pytest.raises(ValidationError):
            Lamp.model_validate(bad)


def test_lamp_flickers_at_twice_the_mains() -> None:
    lamp = Lamp(flicker=0.3)
    time = np.arange(10_000, dtype=np.float64) * 1e-5  # 0.1 s
    level = lamp.level(time)
    assert level.mean() == pytest.approx(1.0, abs=1e-12)
    assert (level.max() - level.min()) / (level.max() + level.min()) == pytest.approx(0.3, rel=1e-6)
    spectrum = np.abs(np.fft.rfft(level - 1.0))
    assert np.argmax(spectrum) == round(100.0 * 0.1)
    assert Lamp(kind="fluorescent").depth > Lamp(kind="halogen").depth > 0.0


SITE = Sun(linke_turbidity=5.0, albedo=0.3)


@pytest.mark.parametrize("skyline", [0.5, 20.0, 60.0])
def test_skyline_hides_what_its_view_factor_says(skyline: float) -> None:
    """Black buildings: an upright wall loses (h + sin h cos h) / pi, a level one sin2 h."""
    h = math.radians(skyline)
    normal = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    built = SITE.model_copy(update={"skyline_deg": skyline, "facade_reflectance": 0.0})
    low = SITE.model_copy(update={"skyline_deg": 1e-9})  # hides the band at the horizon only
    even = low.parts(normal, band_nm=ALL_NM).sky - built.parts(normal, band_nm=ALL_NM).sky
    upright = (h + math.sin(h) * math.cos(h)) / math.pi
    assert even[0] / even[2] == pytest.approx(upright / math.sin(h) ** 2, rel=3e-3)
    # The roof's share of the even sky, from the difference of two wholes of pvlib's model.
    whole = SITE.parts(normal[2:], band_nm=ALL_NM, shaded=True).sky[0]
    assert even[2] / whole == pytest.approx(math.sin(h) ** 2, rel=3e-3)
    assert not built.parts(normal, band_nm=ALL_NM).facades.any()


def test_facades_are_lit_by_the_sun_from_their_side() -> None:
    """Quadrature over bearing and height of the light of each facade, for tilted surfaces."""
    built = SITE.model_copy(update={"skyline_deg": 35.0, "facade_reflectance": 0.5})
    normal = unit(6)
    bearing, height = np.meshgrid(
        np.radians(np.arange(0.25, 360.0, 0.5)), np.radians(np.arange(0.05, 35.0, 0.1)),
        indexing="ij",
    )  # fmt: skip
    way = np.stack(
        [np.sin(bearing) * np.cos(height), np.sin(height), np.cos(bearing) * np.cos(height)], -1
    )
    patch = np.radians(0.5) * np.radians(0.1) * np.cos(height)
    facing = -np.stack([np.sin(bearing[:, 0]), 0 * bearing[:, 0], np.cos(bearing[:, 0])], -1)
    radiance = 0.5 * SITE.in_band_irradiance(facing, band_nm=ALL_NM) / math.pi
    want = [
        float((radiance[:, None] * patch * np.clip(way @ each, 0.0, None)).sum()) for each in normal
    ]
    got = built.parts(normal, band_nm=ALL_NM).facades
    print(f"\nfacades {got} / {want} W/m2")
    np.testing.assert_allclose(got, want, rtol=5e-3)
    assert radiance.max() > 2.0 * radiance.min()  # sun side and shade side
