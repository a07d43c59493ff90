"""Radiometry against worked numbers that hold, and against sums and simulations of its own."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from vrscan.data.config import Config
from vrscan.scene import radiometry as r
from vrscan.scene.beam import Laser, radius_mm

SEED = 20100301
LENS_MM = 25.0 / 3.0
NM = 658.0


def _close(what: str, found: float, wanted: float, rel: float) -> None:
    print(f"{what}: {found:.6g} / {wanted:.6g}")
    assert found == pytest.approx(wanted, rel=rel)


# The instrument's numbers: 658 nm, 50 mW, f/3, base 60 mm, a line of 1 / 37.4 kHz


@pytest.mark.parametrize(
    ("z", "rho", "solid", "power", "photons", "root"),
    [
        (250.0, 0.3, 8.251e-4, 3.940e-6, 3.489e8, 13209.0),
        (300.0, 0.3, 5.827e-4, 2.782e-6, 2.464e8, 11100.0),
        (600.0, 0.3, 1.500e-4, 7.162e-7, 6.343e7, 5632.0),
        (1000.0, 0.3, 5.435e-5, 2.595e-7, 2.298e7, 3390.0),
        (1000.0, 0.05, 5.435e-5, 4.325e-8, 3.830e6, 1384.0),
        (250.0, 0.9, 8.251e-4, 1.182e-5, 1.047e9, 22878.0),
    ],
)
def test_light_from_the_target(
    z: float, rho: float, solid: float, power: float, photons: float, root: float
) -> None:
    away = math.hypot(z, 60.0)
    omega = r.solid_angle_sr(LENS_MM, away)
    _close("sr", float(omega), solid, 1e-3)
    received = r.received_w(0.05, r.lambert(rho), omega)
    _close("W", float(received), power, 1e-3)
    line = 1.0 / 37_400.0
    _close("photons", float(r.photoelectrons(received, line, 1.0, NM)), photons, 1e-3)
    electrons = r.photoelectrons(received, line, 0.5, NM)
    _close("root of electrons", math.sqrt(electrons), root, 1e-3)
    shot = r.snr_shot(received, 0.5, NM, r.bandwidth_hz(line))
    assert float(shot) == pytest.approx(math.sqrt(electrons), rel=1e-12)


def test_the_range_of_powers() -> None:
    near = r.received_w(0.05, r.lambert(0.9), r.solid_angle_sr(LENS_MM, math.hypot(250, 60)))
    far = r.received_w(0.05, r.lambert(0.05), r.solid_angle_sr(LENS_MM, math.hypot(1000, 60)))
    _close("near bright over far dark", float(near / far), 273.0, 2e-3)


def test_a_microsecond_from_a_metre() -> None:
    received = r.received_w(0.05, r.lambert(0.3), r.solid_angle_sr(LENS_MM, 1001.8))
    _close("electrons", float(r.photoelectrons(received, 1e-6, 1.0, NM)), 8.6e5, 0.01)


def test_losses_multiply() -> None:
    plain = r.received_w(2.0, 0.1, 1e-3)
    lossy = r.received_w(2.0, 0.1, 1e-3, optics=0.5, path=0.9, overlap=0.2)
    assert float(lossy) == pytest.approx(float(plain) * 0.5 * 0.81 * 0.2)
    assert float(r.solid_angle_sr(1.0, 10.0, math.radians(60.0))) == pytest.approx(
        0.5 * float(r.solid_angle_sr(1.0, 10.0))
    )


def test_what_of_the_image_falls_on_the_row() -> None:
    # 33 to 110 um wide images: 0.10 to 0.32 of the light is on a row of 7 um.
    geometry = Config().geometry
    z = np.array([250.0, 1000.0])
    radius = radius_mm(z, Laser(aperture_mm=math.inf)) * geometry.focal_mm / z
    share = r.row_overlap(radius, geometry.pitch_mm)
    print("diameters, um", 2e3 * radius, "shares", share)
    assert np.allclose(2e3 * radius, [102.0, 32.6], atol=0.5)
    assert 0.10 < share[0] < share[1] < 0.34
    for w, h, y in [(0.02, 0.007, 0.0), (0.02, 0.007, 0.01), (0.001, 0.007, 0.0035)]:
        whole = math.sqrt(math.pi / 2.0) * w
        part, _ = quad(lambda s, w=w: math.exp(-2.0 * s**2 / w**2), y - h / 2, y + h / 2)
        assert float(r.row_overlap(w, h, y)) == pytest.approx(part / whole, rel=1e-9)
    assert r.row_overlap(np.zeros(2), 7.0, np.array([0.0, 4.0])).tolist() == [1.0, 0.0]


def test_photons_of_658_nm() -> None:
    _close("h nu", float(r.photon_energy_j(NM)), 3.0189e-19, 2e-5)
    _close("A/W", float(r.responsivity_a_per_w(0.5, NM)), 0.26536, 2e-5)


# Two regimes of noise: iria's figure 2-29, recomputed


@pytest.mark.parametrize(
    ("power", "decibel"),
    [(1e-12, -60.0), (1e-9, 0.0), (1e-8, 20.0), (1e-7, 39.9), (1e-6, 59.3), (1e-5, 75.4)],
)
def test_signal_to_noise_in_both_limits(power: float, decibel: float) -> None:
    nep = r.nep_w(2e10, 4e-4, 1e6)
    responsivity = r.responsivity_a_per_w(0.2, 10_600.0)
    ratio = r.snr_power(power, 0.0, nep, responsivity, 1e6)
    found = 10.0 * math.log10(ratio)
    print(f"{power:g} W: {found:.2f} / {decibel} dB")
    assert found == pytest.approx(decibel, abs=0.06)


def test_the_limits_meet_at_the_crossover() -> None:
    nep = r.nep_w(2e10, 4e-4, 1e6)
    _close("NEP", float(nep), 1e-9, 1e-12)
    _close("D*", float(r.d_star(nep, 4e-4, 1e6)), 2e10, 1e-12)
    responsivity = r.responsivity_a_per_w(0.2, 10_600.0)
    _close("A/W", float(responsivity), 1.7099, 1e-4)
    crossover = float(r.crossover_w(nep, responsivity, 1e6))
    _close("crossover", crossover, 5.336e-6, 1e-3)
    shot, detector = 1e4 * crossover, 1e-4 * crossover
    for power, limit in [
        (shot, r.snr_shot(shot, 0.2, 10_600.0, 1e6)),
        (detector, r.snr_detector(detector, nep)),
    ]:
        assert float(r.snr_rms(power, 0.0, nep, responsivity, 1e6)) == pytest.approx(
            float(limit), rel=1e-4
        )
    # rms ratio rises as the power below and as its root above
    slope = [
        math.log10(
            r.snr_rms(10.0 * p, 0.0, nep, responsivity, 1e6)
            / r.snr_rms(p, 0.0, nep, responsivity, 1e6)
        )
        for p in (detector, shot)
    ]
    print("slopes", slope, "/ [1, 0.5]")
    assert np.allclose(slope, [1.0, 0.5], atol=2e-3)


def test_sun_on_the_detector_costs_shot_noise_only() -> None:
    dark = r.snr_power(1e-9, 0.0, 0.0, 0.3, 1e4)
    lit = r.snr_power(1e-9, 3e-9, 0.0, 0.3, 1e4)
    assert float(dark / lit) == pytest.approx(4.0)
    assert float(r.snr_power(0.0, 0.0, 0.0, 0.3, 1e4)) == 0.0


def test_counted_photons_have_that_ratio() -> None:
    rng = np.random.default_rng(SEED)
    power, time = 2e-11, 1e-5
    mean = float(r.photoelectrons(power, time, 0.5, NM))
    counts = rng.poisson(mean, 200_000)
    ratio = float(r.snr_shot(power, 0.5, NM, r.bandwidth_hz(time)))
    _close("mean over deviation", counts.mean() / counts.std(), ratio, 0.01)


def test_a_detector_with_a_time_constant() -> None:
    assert float(r.first_order(0.0, 1.0)) == 1.0
    assert float(r.first_order(1.0 / (2.0 * math.pi * 1e-3), 1e-3)) == pytest.approx(0.5**0.5)
    assert float(r.bandwidth_hz(0.5e-6)) == 1e6


# Diffraction


def test_airy_disk() -> None:
    wavelength, f_number = 0.658, 3.0
    diameter = float(r.airy_diameter(wavelength, f_number))
    _close("diameter, um", diameter, 4.82, 1e-3)
    assert float(r.airy(0.5 * diameter, wavelength, f_number)) < 1e-12
    assert float(r.airy(0.0, wavelength, f_number)) == 1.0
    radius = np.linspace(0.0, 200.0, 2_000_001)
    light = r.airy(radius, wavelength, f_number) * radius
    inside = light[radius <= 0.5 * diameter].sum() / light.sum()
    # what is beyond 200 um: 1 - E = 2 / (pi v)
    inside *= 1.0 - 2.0 / (math.pi * math.pi * 200.0 / (wavelength * f_number))
    _close("share in the disk", inside, 0.837785, 1e-4)
    half = 0.5 * 1.02899 * wavelength * f_number
    _close("at half width", float(r.airy(half, wavelength, f_number)), 0.5, 1e-4)


def test_transfer_of_a_perfect_lens() -> None:
    u = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0, 2.0, -0.5])
    wanted = [1.0, 0.87289, 0.68504, 0.39100, 0.14429, 0.03739, 0.0, 0.0, 0.39100]
    assert np.allclose(r.mtf(u), wanted, atol=1e-5)
    assert float(r.cutoff(0.658e-3, 3.0)) == pytest.approx(506.6, rel=1e-4)
    # and it is the correlation of the pupil with itself
    axis = np.linspace(-2.0, 2.0, 1601)
    pupil = np.hypot(axis[:, None], axis) <= 1.0
    moved = np.roll(pupil, round(2.0 * 0.25 / (axis[1] - axis[0])), axis=0)
    _close("overlap of pupils", (pupil & moved).sum() / pupil.sum(), 0.68504, 2e-3)


def test_strehl_of_a_quarter_wave() -> None:
    rng = np.random.default_rng(SEED)
    rough = rng.normal(0.0, 2.0 * math.pi * 0.075, 1_000_000)
    _close("0.075 waves rms, gaussian", r.strehl(rough), 0.80086, 2e-3)
    # a quarter wave of focus error, peak to valley: sinc^2(1/8 ...) = (sin(pi/4) / (pi/4))^2
    s = (np.arange(10_000) + 0.5) / 10_000  # radius squared: even in area
    _close("quarter wave of focus", r.strehl(0.5 * math.pi * s), 0.8106, 1e-4)
    assert r.strehl(np.array([0.0, math.pi]), np.array([1.0, 0.0])) == 1.0


# Gaussian beams


def test_worked_beams() -> None:
    # wavelength, diameter in m: 1.06 um and 10.6 um, 50 mm
    for wavelength, angle, rayleigh in [(1.06e-6, 26.993e-6, 1852.0), (10.6e-6, 269.93e-6, 185.24)]:
        _close("divergence", float(r.divergence_rad(0.025, wavelength)), angle, 1e-4)
        _close("Rayleigh range, m", float(r.rayleigh_range(0.025, wavelength)), rayleigh, 2e-4)
    unfocused = 2.0 * r.gaussian_radius(np.array([100.0, 300.0, 1000.0]), 0.025, 10.6e-6)
    assert np.allclose(unfocused, [0.05682, 0.09517, 0.2745], rtol=1e-3)
    assert 2.0 * float(r.gaussian_radius(300.0, 0.025, 1.06e-6)) == pytest.approx(0.05065, rel=1e-3)
    _close("focus shift, um", 1e6 * float(r.focus_shift(0.2, 300.0)), 133.4, 1e-3)


def test_radius_and_wavefront_lead_back_to_the_waist() -> None:
    z = np.array([-3.0, 0.5, 2.0, 40.0])
    w, bent = r.gaussian_radius(z, 1e-3, 6e-7), r.wavefront_radius(z, 1e-3, 6e-7)
    waist, away = r.waist_from(w, bent, 6e-7)
    assert np.allclose(waist, 1e-3, rtol=1e-9)
    assert np.allclose(away, z, rtol=1e-9)
    assert np.isinf(r.wavefront_radius(0.0, 1e-3, 6e-7))
    rayleigh = float(r.rayleigh_range(1e-3, 6e-7))
    assert float(r.wavefront_radius(rayleigh, 1e-3, 6e-7)) == pytest.approx(2.0 * rayleigh)
    inside, _ = quad(lambda s: float(r.gaussian(s, 1.0)) * s, 0.0, 1.0)
    assert inside * 4.0 == pytest.approx(1.0 - math.exp(-2.0))


# Scanning


def test_rates_and_dwell_of_the_mirror() -> None:
    amplitude = math.radians(20.5)
    peak, mean = float(r.peak_rate(amplitude, 250.0)), float(r.mean_rate(amplitude, 250.0))
    _close("peak", peak, 562.0, 1e-3)
    _close("mean", mean, 357.8, 1e-3)
    _close("angle in a line", mean / 37_400.0, 9.57e-3, 1e-3)
    _close("dwell on 1.7 mrad", float(r.dwell_s(1.7e-3, -peak)), 3.02e-6, 2e-3)
    assert np.isinf(r.dwell_s(1.0, 0.0))
    share, slow = r.scan_efficiency(np.array([0.5, 0.7, 0.9]))
    assert np.allclose(share, [0.333, 0.494, 0.713], atol=5e-4)
    assert np.allclose(slow, [0.866, 0.714, 0.436], atol=5e-4)
    t = np.linspace(0.0, 1.0, 1_000_001)
    counted = (np.abs(np.sin(2.0 * math.pi * t)) <= 0.7).mean()
    assert float(share[1]) == pytest.approx(counted, abs=1e-4)
    with pytest.raises(ValueError, match="scan_efficiency"):
        r.scan_efficiency(1.1)


# Speckle and phase


def test_speckle_at_the_lens() -> None:
    area = 0.25 * math.pi * LENS_MM**2
    z = np.array([250.0, 1000.0])
    spots = np.array([0.652, 1.749]), np.array([1.022, 1.305])
    cells = np.array([r.speckle_cells(z, spot, area, NM * 1e-6) for spot in spots])
    print("cells", cells.ravel(), "/ 214 to 1989")
    assert cells.max() > 1989 * 0.95
    assert cells.min() == pytest.approx(214.0, rel=0.02)
    assert float(r.speckle_cells(1e9, 1.0, 1.0, 1e-3)) == 1.0


@pytest.mark.parametrize("ratio", [6.0, 10.0, 100.0])
@pytest.mark.parametrize(("length", "sigma"), [(33, 4.0), (17, 3.4)])
def test_the_phase_law_holds_for_a_peak(ratio: float, length: int, sigma: float) -> None:
    rng = np.random.default_rng(SEED)
    t = np.arange(length)
    peak = np.exp(-np.square(t - (length - 1) / 2.0) / (2.0 * sigma**2))
    turn = np.exp(-2j * math.pi * t / length)
    true = turn @ peak
    noise = abs(true) / (math.sqrt(length) * ratio)
    trials = peak + noise * rng.standard_normal((40_000, length))
    error = np.angle((trials @ turn) * np.conj(true)) * length / (2.0 * math.pi)
    _close(f"S/N {ratio:g}, px", error.std(), float(r.phase_error(length, ratio)), 0.02)


def test_the_phase_law_at_its_edge() -> None:
    assert pytest.approx(0.112540, abs=1e-6) == r.PHASE_CONSTANT
    assert r.PHASE_SNR == 6.0
