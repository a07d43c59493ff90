"""Head window, halo, dust and the figure A, each against geometry or an integral of its own."""

import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import dblquad, quad

from vrscan.scene.stray import (
    Dust,
    HeadWindow,
    Lens,
    Polish,
    Stray,
    attenuation,
    covered_share,
    disc_overlap,
    dust_shadow,
    halo_weights,
    obscured_share,
    particles,
    window_ghost,
)
from vrscan.scene.surface import bsdf_k, tis

WAVELENGTH_NM = 658.0
ANGLES = np.radians(np.linspace(-35.0, 35.0, 71))


def test_a_parallel_window_shifts_the_beam_and_its_ghost_as_snell_says() -> None:
    window = HeadWindow(thickness_mm=3.0, index=1.5, tilt_deg=12.0)
    found = window_ghost(window, ANGLES)
    incidence = ANGLES + math.radians(12.0)
    inside = np.arcsin(np.sin(incidence) / 1.5)
    direct = -3.0 * math.cos(math.radians(12.0)) * np.sin(incidence - inside) / np.cos(inside)
    ghost = 2.0 * 3.0 * math.cos(math.radians(12.0)) * np.tan(inside) * np.cos(incidence)
    assert np.abs(found.turn_rad).max() < 1e-12
    assert np.abs(found.direct_turn_rad).max() < 1e-12
    # The thickness counts along z; along the normal it is less by the cosine of the tilt.
    assert found.direct_shift_mm == pytest.approx(direct, abs=1e-12)
    assert found.shift_mm == pytest.approx(ghost, abs=1e-12)
    assert found.power == pytest.approx(0.005**2)


def test_a_wedge_turns_the_ghost_as_angles_alone_predict() -> None:
    window = HeadWindow(tilt_deg=5.0, wedge_deg=0.2)
    found = window_ghost(window, ANGLES)
    inner, outer = math.radians(5.0), math.radians(5.2)
    inside = np.arcsin(np.sin(ANGLES + inner) / window.index) - inner
    out = [
        np.arcsin(window.index * np.sin(heading + outer)) - outer
        for heading in (inside, inside + 2.0 * (outer - inner))
    ]
    assert found.direct_turn_rad == pytest.approx(out[0] - ANGLES, abs=1e-12)
    assert found.turn_rad == pytest.approx(out[1] - out[0], abs=1e-12)
    small = 2.0 * window.index * math.radians(0.2)
    print(f"turn at 0: {found.turn_rad[35]:.6f} rad, 2 n wedge: {small:.6f}")
    assert found.turn_rad[35] == pytest.approx(small, rel=0.02)


def test_beams_that_cannot_leave_the_window_have_no_power() -> None:
    angle = np.radians([-180.0, -90.0, -60.0, 0.0, 60.0, 85.0, 90.0, 180.0])
    found = window_ghost(HeadWindow(tilt_deg=30.0, wedge_deg=5.0), angle)
    for values in (found.shift_mm, found.turn_rad, found.power, found.direct_shift_mm):
        assert np.isfinite(values).all()
    assert found.power[0] == 0.0
    assert found.power[3] > 0.0
    assert window_ghost(HeadWindow(), np.zeros(0)).power.shape == (0,)


def _one_lever(polish: Polish) -> Stray:
    """Only the front window scatters: two faces, a focal length from the sensor."""
    return Stray(enabled=["window", "halo"], lens=Lens(kind="thin"), polish=polish)


def _density(r: float, polish: Polish, index: float) -> float:
    """Irradiance at r px for unit light, from the BSDF of the scatter, per px^2."""
    lever, pitch = 25.0, 0.007
    turn = math.atan(r * pitch / lever)
    scatter = bsdf_k(
        math.sin(turn),
        1.0,
        1.0,
        sigma_nm=polish.roughness_nm,
        wavelength_nm=WAVELENGTH_NM,
        length_um=1e3 * polish.length_mm,
        slope=polish.slope,
        index_step=index - 1.0,
    )
    # The BSDF without its cosine is per area of the disc of direction cosines, and that is
    # cos d omega = cos^4 dA / lever^2.
    return 2.0 * float(scatter) * math.cos(turn) ** 4 * (pitch / lever) ** 2


@pytest.mark.parametrize("polish", [Polish(), Polish(slope=1.7, length_mm=0.3, roughness_nm=5.0)])
def test_the_halo_of_a_pixel_is_the_bsdf_over_its_area(polish: Polish) -> None:
    stray = _one_lever(polish)
    index = stray.window.index
    halo = halo_weights(1500, stray)
    for px in (0, 1, 2, 10, 100, 1200):
        area, _ = dblquad(
            lambda y, x: _density(math.hypot(x, y), polish, index),
            px - 0.5,
            px + 0.5,
            -0.5,
            0.5,
            epsrel=1e-5,
        )
        print(f"{px:5d} px: {halo.weights[px]:.4e}, integral {area:.4e}")
        assert halo.weights[px] == pytest.approx(area, rel=0.002)
    energy = 2.0 * math.pi * quad(lambda r: r * _density(r, polish, index), 0.0, 50.0)[0]
    energy += (
        2.0
        * math.pi
        * quad(
            lambda t: math.exp(2.0 * t) * _density(math.exp(t), polish, index),
            math.log(50.0),
            math.log(1e9),
            limit=500,
        )[0]
    )
    expected = 2.0 * float(tis(polish.roughness_nm, WAVELENGTH_NM, index - 1.0))
    assert halo.total == pytest.approx(expected, rel=1e-12)
    assert energy == pytest.approx(expected, rel=1e-4)
    assert halo.row == pytest.approx(halo.weights[0] + 2.0 * halo.weights[1:].sum(), rel=1e-12)


def test_a_high_spot_takes_the_halo_off_the_row() -> None:
    stray, sigma = _one_lever(Polish()), 4.0
    halo = halo_weights(200, stray, sigma_px=sigma)
    y = np.linspace(-60.0, 60.0, 2401)
    height = np.exp(-0.5 * np.square(y / sigma)) / (sigma * math.sqrt(2.0 * math.pi)) * 0.05
    for px in (3, 30, 150):
        each = [_density(math.hypot(px, value), stray.polish, stray.window.index) for value in y]
        predicted = float((height * each).sum())
        assert halo.weights[px] == pytest.approx(predicted, rel=0.03)


def test_the_halo_is_what_the_parts_make_it() -> None:
    whole = halo_weights(100, Stray())
    assert (np.diff(whole.weights) < 0.0).all()
    steps = [0.5143] * 6 + [0.6172, 0.6172, 0.6150, 0.6150, 0.6172, 0.6172]
    assert whole.total == pytest.approx(sum(float(tis(2.0, WAVELENGTH_NM, step)) for step in steps))
    assert whole.row < whole.total
    assert halo_weights(5, Stray(enabled=["lens"])).total == 0.0
    assert halo_weights(5, Stray(polish=Polish(roughness_nm=0.0))).weights.sum() == 0.0
    near_two = halo_weights(50, Stray(polish=Polish(slope=2.0 + 1e-6)))
    assert near_two.weights == pytest.approx(whole.weights[:50], rel=1e-4)
    with pytest.raises(ValueError, match="halo of 0 px"):
        halo_weights(0, Stray())


def test_the_attenuation_is_the_brightest_pixel_over_all_light() -> None:
    wide = np.array([[0.0, 3e-6], [1e-6, 0.0]])
    image = np.array([[1.0, 2.0], [3.0, 4.0]])
    # 3e-6 over pixels of 2^2 against 10 over pixels of 0.5^2.
    assert attenuation(wide, 2.0, image, 0.5) == pytest.approx(12e-6 / 2.5)
    with pytest.raises(ValueError, match="no light"):
        attenuation(wide, 1.0, np.zeros((2, 2)), 1.0)


@pytest.mark.parametrize(
    ("size", "count"), [(5.0, 1785.0), (15.0, 265.0), (25.0, 78.4), (50.0, 10.7), (100.0, 1.0)]
)
def test_level_100_has_the_particles_of_the_standard(size: float, count: float) -> None:
    assert float(particles(100.0, size)) == pytest.approx(count, rel=0.005)


def test_the_vortex_mask_of_metis_table_3_agrees() -> None:
    assert float(particles(102.0, 52.4)) == pytest.approx(10.0, rel=0.01)
    ratios = [
        float(particles(level, size)) / density
        for size, density, level in ((12, 2450, 264), (37, 3270, 501), (140, 1370, 1017))
    ]
    print("other rows, times fewer than their level has:", np.round(ratios, 2))
    assert np.allclose(ratios, 9.3, rtol=0.03)


@pytest.mark.parametrize("level", [100.0, 300.0, 500.0, 1000.0])
def test_dust_covers_the_integral_of_its_discs(level: float) -> None:
    size = np.geomspace(1.0, level, 20_001)
    count = particles(level, size)
    middle = np.sqrt(size[1:] * size[:-1])
    area_um2 = float((0.25 * math.pi * np.square(middle) * -np.diff(count)).sum())
    assert covered_share(level) == pytest.approx(area_um2 * 1e-12 / 0.09290304, rel=1e-5)
    # Ma, Fong and Lee (1989), per cent of the area; theirs goes on above the level, which tells
    # only where there is little dust.
    published = 10.0 ** (-7.245 + 0.926 * math.log10(level) ** 2)
    print(f"level {level:g}: {100.0 * covered_share(level):.3g} %, published {published:.3g} %")
    assert 100.0 * covered_share(level) == pytest.approx(
        published, rel=0.02 if level > 100 else 0.07
    )
    assert covered_share(level, level) == 0.0


def test_the_pupil_loses_what_its_faces_cover() -> None:
    clean = Dust(level=500.0, digs=0, scratches=0)
    share = covered_share(500.0)
    assert obscured_share(Stray(dust=clean)) == pytest.approx(1.0 - (1.0 - share) ** 10)
    bare = Stray(enabled=["lens", "dust"], lens=Lens(kind="thin"), dust=clean)
    assert obscured_share(bare) == pytest.approx(1.0 - (1.0 - share) ** 2)
    scratched = Dust(level=1.0, digs=3, dig_mm=0.4, scratches=2, scratch_mm=0.05)
    beam = math.pi / 4.0 * (25.0 / 3.0) ** 2
    one = (3 * 0.16 + 2 * 0.05 * 25.0 / 3.0) / beam
    stray = Stray(enabled=["dust"], lens=Lens(kind="thin"), dust=scratched)
    assert obscured_share(stray) == pytest.approx(1.0 - (1.0 - one) ** 2)
    assert obscured_share(Stray(enabled=["window"])) == 0.0


def test_the_cover_loses_on_average_what_its_dust_covers() -> None:
    stray = Stray(dust=Dust(cover_level=400.0))
    lost = np.array([1.0 - dust_shadow(stray, 2048, seed).mean() for seed in range(300)])
    predicted = 2.0 * covered_share(400.0)
    error = lost.std() / math.sqrt(len(lost))
    print(f"lost {lost.mean():.3e} +- {error:.1e}, predicted {predicted:.3e}")
    assert abs(lost.mean() - predicted) < 4.0 * error
    assert error < 0.15 * predicted


def test_dust_on_the_cover_is_a_pattern_of_its_seed() -> None:
    stray = Stray(dust=Dust(cover_level=600.0))
    first, again, other = (dust_shadow(stray, 2048, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert first.min() >= 0.0 and first.max() <= 1.0
    # A shadow is as wide as a pixel's view of the face: 1 mm / f/3 is 48 px, so no pixel jumps.
    steps = np.abs(np.diff(first))
    assert 0.0 < steps.max() < 0.3 * (1.0 - first.min())
    assert (dust_shadow(Stray(enabled=["dust"]), 64, 1) == 1.0).all()


def test_two_discs_share_what_a_fine_grid_counts() -> None:
    x, y = np.meshgrid(*[np.linspace(-3.0, 3.0, 1201)] * 2)
    for first, second, apart in (
        (1.0, 2.0, 1.5),
        (0.3, 1.0, 0.8),
        (1.0, 1.0, 0.1),
        (2.0, 0.5, 1.0),
    ):
        both = (np.hypot(x, y) < first) & (np.hypot(x - apart, y) < second)
        counted = both.sum() * 0.005**2
        assert float(disc_overlap(first, second, np.array(apart))) == pytest.approx(
            counted, rel=3e-3
        )
    assert float(disc_overlap(1.0, 1.0, np.array(2.0))) == 0.0
    assert float(disc_overlap(1.0, 1.0, np.array(0.0))) == pytest.approx(math.pi)


@pytest.mark.parametrize(
    "values",
    [
        {"enabled": ["lantern"]},
        {"window": {"front_reflectance": 1.0}},
        {"lens": {"radii_mm": [10.0, -10.0]}},
        {"lens": {"stop": 9}},
        {"dust": {"level": 0.5}},
        {"cover": {"colour": "red"}},
    ],
)
def test_bad_sections_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Stray.model_validate(values)
