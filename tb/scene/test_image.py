"""The spot's image on the row: each blur against an integral or a convolution made another way."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf, j1

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.scene import image
from vrscan.scene.beam import Laser, pulse_rms_s, pulse_transform

SEED = 20100301
PULSE_S = 1e-6


def _moments(profile: Floats, reach: int | None = None) -> tuple[float, float, float]:
    """Return sum, mean and variance, out to ``reach``; the middle of the window is 0."""
    middle = len(profile) // 2
    if reach is not None:
        profile = profile[middle - reach : middle + reach + 1]
        middle = reach
    x = np.arange(len(profile)) - middle
    whole = float(profile.sum())
    mean = float((profile * x).sum() / whole)
    return whole, mean, float((profile * np.square(x - mean)).sum() / whole)


def _one(width: int, sigma: float, fraction: float = 0.0, **blur: object) -> Floats:
    arrays = {
        name: np.array([value]) if isinstance(value, float) else value
        for name, value in blur.items()
    }
    found = image.profiles(np.array([fraction]), width, np.array([sigma]), **arrays)
    return found[0].astype(np.float64)


def _pulse(laser: Laser) -> image.Singles:
    return pulse_transform(image.PULSE_TURNS / PULSE_S, laser, PULSE_S).astype(np.float32)


def _slice(sigma_x: float, sigma_y: float, radius: float, width: int) -> tuple[Floats, float]:
    """Return pixels of the row's slice through disc times Gaussian, and the row's share.

    By plain summation in two dimensions: the disc is cut into points, each a Gaussian whose
    integral over a pixel of the row is a product of two error functions.
    """
    step = radius / 60.0
    line = np.arange(-59.5, 60.0) * step
    y, x = np.meshgrid(line, line, indexing="ij")
    inside = np.hypot(x, y) < radius
    x, y = x[inside], y[inside]
    edge = np.arange(width + 1) - width // 2 - 0.5

    def part(low: Floats, high: Floats, sigma: float) -> Floats:
        scale = 1.0 / (np.sqrt(2.0) * sigma)
        return 0.5 * (erf(high * scale) - erf(low * scale))

    across = part(-0.5 - y, 0.5 - y, sigma_y)
    columns, where = np.unique(x, return_inverse=True)
    weight = np.bincount(where, across)
    along = part(edge[:-1] - columns[:, None], edge[1:] - columns[:, None], sigma_x)
    found = weight @ along / len(x)
    return found / found.sum(), float(found.sum())


@pytest.mark.parametrize("sigma", [0.5, 1.0, 2.3, 7.0])
@pytest.mark.parametrize("fraction", [-0.5, 0.0, 0.31])
def test_a_gaussian_is_that_integrated_over_pixels(sigma: float, fraction: float) -> None:
    width = 128
    edge = np.arange(width + 1) - width // 2 - 0.5 - fraction
    want = 0.5 * np.diff(erf(edge / (np.sqrt(2.0) * sigma)))
    got = _one(width, sigma, fraction)
    # What is above one cycle a pixel is left out: sinc times the Gaussian, both small there.
    beyond = 2.0 * np.exp(-2.0 * (np.pi * sigma) ** 2) * 0.22
    assert np.abs(got - want).max() < 3e-7 + beyond
    assert abs(_moments(got)[0] - 1.0) < 1e-6


@pytest.mark.parametrize(
    ("sigma_x", "sigma_y", "radius"),
    [(3.0, 4.0, 14.0), (5.0, 5.0, 2.0), (1.0, 0.6, 8.0), (2.0, 12.0, 20.0), (6.0, 2.0, 30.0)],
)
def test_a_defocused_spot_is_the_row_through_its_disc(
    sigma_x: float, sigma_y: float, radius: float
) -> None:
    width = 256
    want, share = _slice(sigma_x, sigma_y, radius, width)
    got = _one(width, sigma_x, radius_px=radius, height_ratio=sigma_y / radius)
    worst = np.abs(got - want).max() / want.max()
    held = float(image.row_share(np.array([sigma_y]), np.array([radius]))[0])
    print(f"worst / peak {worst:.1e}; row's share {held:.5f} / {share:.5f}")
    assert worst < 4e-3  # of the disc cut into points, mostly
    # Single precision far away, times its distance squared, must not count.
    reach = int(radius + 6 * sigma_x)
    assert abs(_moments(got, reach)[2] / _moments(want, reach)[2] - 1.0) < 4e-3
    assert abs(held / share - 1.0) < 6e-3


def test_without_a_disc_the_rows_share_is_irias_error_function() -> None:
    sigma = np.array([1.0, 2.0, 5.0, 16.0])
    want = erf(0.5 / (np.sqrt(2.0) * sigma))
    got = image.row_share(sigma, np.zeros(4))
    print("row's share", got, "/", want)
    assert np.abs(got / want - 1.0).max() < 2.5e-3
    # The digest's eta_B for spots of 33 and 110 um, 1/e2 diameter, on a row of 7 um.
    spots = 0.25 * np.array([33.0, 110.0]) / 7.0
    assert np.allclose(image.row_share(spots, np.zeros(2)), [0.32, 0.10], atol=0.01)


def test_a_row_beside_the_image_gets_less_and_then_nothing() -> None:
    sigma, none = np.array([4.0]), np.zeros(1)
    middle = image.row_share(sigma, none)
    low = 0.5 * (erf(5.5 / (np.sqrt(2.0) * 4.0)) - erf(4.5 / (np.sqrt(2.0) * 4.0)))
    assert np.allclose(image.row_share(sigma, none, 5.0), low, rtol=5e-3)
    assert image.row_share(sigma, none, 100.0)[0] < 1e-60 * middle[0]
    assert image.row_share(np.zeros(1), none)[0] == 1.0


def test_the_disc_is_that_of_geometric_optics() -> None:
    config = Config()
    depth = np.array([300.0, 420.0, 1000.0])
    got = image.defocus_radius_px(depth, 420.0, 3.0, config)
    # A point at s is sharp at s' behind the lens: similar triangles from the pupil to s'.
    sharp, sensor = (1.0 / (1.0 / 25.0 - 1.0 / each) for each in (depth, 420.0))
    want = 0.5 * 25.0 / 3.0 * np.abs(sharp - sensor) / sharp / 0.007
    assert np.allclose(got, want, rtol=1e-9, atol=1e-9)
    assert got[1] == 0.0
    assert np.isfinite(image.defocus_radius_px(np.array([0.0, 1e9]), 420.0, 3.0, config)).all()


def test_motion_adds_the_pulses_variance_and_nothing_else() -> None:
    laser = Laser(rise_us=0.2)
    table = _pulse(laser)
    for speed in (0.7, 2.0, 6.0, 51.0):
        reach = int(18 + speed)
        still = _moments(_one(256, 3.0), reach)
        moved = _moments(_one(256, 3.0, 0.2, speed_px=speed, pulse=table), reach)
        want = (speed * pulse_rms_s(laser, PULSE_S) / PULSE_S) ** 2
        print(f"smear of {speed} px: variance {moved[2] - still[2]:.4f} / {want:.4f}")
        assert abs(moved[0] - 1.0) < 3e-4
        assert abs(moved[1] - 0.2) < 5e-4
        assert abs((moved[2] - still[2]) / want - 1.0) < (0.01 if speed > 1.0 else 0.05)


def test_a_long_smear_is_a_trapezoid() -> None:
    laser = Laser(rise_us=0.25)
    got = _one(256, 0.7, speed_px=80.0, pulse=_pulse(laser))
    x = np.arange(256) - 128
    want = np.clip((40.0 - np.abs(x)) / 20.0 + 0.5, 0.0, 1.0) / 80.0
    assert np.abs(got - want).max() < 0.02 / 80.0


def test_diffraction_is_airys_line_spread() -> None:
    width, f_number, wavelength, pitch = 128, 8.0, 658.0, 0.007
    step = 0.05  # px
    line = np.arange(-1600, 1601) * step
    scale = np.pi * pitch / (1e-6 * wavelength * f_number)
    r = np.maximum(np.hypot(line[:, None], line), 1e-9) * scale
    spread = np.square(2.0 * j1(r) / r).sum(axis=0)
    spread /= spread.sum()
    edge = np.arange(width + 1) - width // 2 - 0.5
    scaled = (edge - line[:, None]) / (np.sqrt(2.0) * 1.5)
    want = spread @ (0.5 * np.diff(erf(scaled), axis=1))
    transfer = image.diffraction(image.frequencies(width), wavelength, f_number, pitch)
    got = _one(width, 1.5, transfer=transfer.astype(np.float32))
    print("diffraction: peak", got.max(), "/", want.max(), "without", _one(width, 1.5).max())
    # Airy's skirt beyond 80 px, 3e-3 of the light, is not in the sum above.
    assert np.abs(got - want).max() < 4e-3 * want.max()
    assert abs(got.max() / _one(width, 1.5).max() - 1.0) > 0.02


@pytest.mark.parametrize("length", [0.3, 2.0, -2.0])
def test_coma_keeps_the_mean_and_its_tail_has_a_side(length: float) -> None:
    plain, got = _one(128, 2.0, 0.25), _one(128, 2.0, 0.25, coma_px=length)
    whole, mean, variance = _moments(got)
    x = np.arange(128) - 64 - mean
    third = float((got * x**3).sum())
    assert abs(whole - 1.0) < 1e-5
    assert abs(mean - 0.25) < 1e-4
    assert abs(variance - _moments(plain)[2] - length**2) < 2e-3
    assert abs(third / (2.0 * length**3) - 1.0) < 0.03


def test_points_of_a_spectrum_lie_where_they_should() -> None:
    width = 64
    place, share = np.array([-7.3, 0.4, 11.0]), np.array([0.2, 0.5, 0.3])
    phase = np.exp(-2j * np.pi * np.outer(place, image.frequencies(width)))
    spectrum = (share @ phase)[None].astype(np.complex64)
    got = _one(width, 1.5, spectrum=spectrum)
    want = sum(
        s * image.profiles(np.array([p]), width, np.array([1.5]))[0].astype(np.float64)
        for p, s in zip(place, share, strict=True)
    )
    assert np.abs(got - want).max() < 1e-6


@settings(deadline=None, max_examples=60, derandomize=True)
@given(
    sigma=st.floats(0.4, 40.0),
    radius=st.floats(0.0, 60.0),
    height=st.floats(0.0, 60.0),
    speed=st.floats(0.0, 100.0),
    coma=st.floats(-3.0, 3.0),
    fraction=st.floats(-0.5, 0.5),
)
def test_energy_and_centre_are_kept_whatever_blurs(
    sigma: float, radius: float, height: float, speed: float, coma: float, fraction: float
) -> None:
    width = int(
        image.window_width(
            np.array([sigma]), np.array([radius]), np.array([speed]), np.array([coma])
        )[0]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        got = _one(
            width,
            sigma,
            fraction,
            radius_px=radius,
            height_ratio=height / max(radius, 1e-3),
            speed_px=speed,
            pulse=_pulse(Laser()),
            coma_px=coma,
        )
    assert np.isfinite(got).all()
    whole, mean, _ = _moments(np.maximum(got, 0.0))
    assert abs(whole - 1.0) < 2e-3
    assert abs(mean - fraction) < 0.01 + 1e-3 * width / 32
    assert got.min() > -2e-3 * got.max()


def test_a_window_holds_its_profile() -> None:
    rng = np.random.default_rng(SEED)
    table = _pulse(Laser())
    for _ in range(40):
        sigma, radius, speed = rng.uniform(0.5, 30), rng.uniform(0, 40), rng.uniform(0, 60)
        coma = rng.uniform(0.0, 2.0)
        width = int(
            image.window_width(
                np.array([sigma]), np.array([radius]), np.array([speed]), np.array([coma])
            )[0]
        )
        blur = {
            "radius_px": radius,
            "height_ratio": 0.4,
            "speed_px": speed,
            "pulse": table,
            "coma_px": coma,
        }
        wide = _one(4 * width, sigma, 0.5, **blur)
        beside = 4 * width // 2 - width // 2
        outside = 1.0 - wide[beside : beside + width].sum()
        assert abs(outside) < 5e-4, (sigma, radius, speed, coma, width)


def test_a_disc_wider_than_its_table_has_no_needle_in_its_middle() -> None:
    radius = 300.0
    got = _one(2048, 0.8, radius_px=radius, height_ratio=0.02)
    x = np.arange(2048) - 1024
    want = np.where(np.abs(x) < radius - 4, 0.5 / radius, 0.0)
    inside = np.abs(x) < radius - 4
    print("needle", got[1024] * 2 * radius, "x the box")
    assert np.abs(got[inside] - want[inside]).max() < 0.25 / radius
    assert abs(got[1024] / np.median(got[inside]) - 1.0) < 0.02
