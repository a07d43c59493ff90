"""Radiometry against worked numbers that hold, and against sums of its own."""

import math

import numpy as np
import pytest

from vrscan.scene import radiometry as r

LENS_MM = 25.0 / 3.0
NM = 658.0


def _close(what: str, found: float, wanted: float, rel: float) -> None:
    print(f"{what}: {found:.6g} / {wanted:.6g}")
    assert found == pytest.approx(wanted, rel=rel)


@pytest.mark.parametrize(
    ("z", "rho", "photons", "root"),
    [
        (250.0, 0.3, 3.489e8, 13209.0),
        (300.0, 0.3, 2.464e8, 11100.0),
        (600.0, 0.3, 6.343e7, 5632.0),
        (1000.0, 0.3, 2.298e7, 3390.0),
        (1000.0, 0.05, 3.830e6, 1384.0),
        (250.0, 0.9, 1.047e9, 22878.0),
    ],
)
def test_electrons_of_a_matt_target(z: float, rho: float, photons: float, root: float) -> None:
    """The range equation (2-30) for 50 mW, f/3 and a line of 1 / 37.4 kHz, 60 mm off the axis."""
    received = 0.05 * rho / math.pi * 0.25 * math.pi * LENS_MM**2 / (z**2 + 60.0**2)
    line = 1.0 / 37_400.0
    _close("photons", float(r.photoelectrons(received, line, 1.0, NM)), photons, 1e-3)
    electrons = float(r.photoelectrons(received, line, 0.5, NM))
    _close("root of electrons", math.sqrt(electrons), root, 1e-3)


def test_photons_of_658_nm() -> None:
    _close("h nu", float(r.photon_energy_j(NM)), 3.0189e-19, 2e-5)


def test_transfer_of_a_perfect_lens() -> None:
    u = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0, 2.0, -0.5])
    wanted = [1.0, 0.87289, 0.68504, 0.39100, 0.14429, 0.03739, 0.0, 0.0, 0.39100]
    assert np.allclose(r.mtf(u), wanted, atol=1e-5)
    # and it is the correlation of the pupil with itself
    axis = np.linspace(-2.0, 2.0, 1601)
    pupil = np.hypot(axis[:, None], axis) <= 1.0
    moved = np.roll(pupil, round(2.0 * 0.25 / (axis[1] - axis[0])), axis=0)
    _close("overlap of pupils", (pupil & moved).sum() / pupil.sum(), 0.68504, 2e-3)


def test_matt_light_fills_the_half_space() -> None:
    """Rings of a half sphere are pupils: a white surface sends them all of its light."""
    angle = (np.arange(2000) + 0.5) / 2000 * 0.5 * math.pi
    ring = 2.0 * math.pi * np.sin(angle) * (0.5 * math.pi / 2000) * 300.0**2
    _close("light", float(r.matt_share(np.cos(angle), ring, 300.0).sum()), 1.0, 1e-6)


def test_signal_to_noise_of_currents_and_of_counts() -> None:
    """(2-40) as printed, with (2-43) and the bandwidth of an integration, and drawn electrons."""
    seconds, efficiency, signal_w, other_w, dark_e = 26.7e-6, 0.5, 3e-11, 1e-11, 20.0
    charge = 1.602176634e-19
    responsivity = charge * efficiency / float(r.photon_energy_j(NM))  # A/W
    band = 0.5 / seconds
    shot = 2.0 * charge * band * (signal_w + other_w) * responsivity
    dark = (dark_e * charge / seconds) ** 2
    printed = math.sqrt((signal_w * responsivity) ** 2 / (shot + dark))
    signal, other = (
        float(r.photoelectrons(each, seconds, efficiency, NM)) for each in (signal_w, other_w)
    )
    found = float(r.signal_to_noise(signal, other, dark_e))
    _close("S/N", found, printed, 1e-9)
    rng = np.random.default_rng(8)
    drawn = rng.poisson(signal + other, 200_000) + rng.normal(0.0, dark_e, 200_000)
    _close("drawn", found, float((drawn.mean() - other) / drawn.std()), 0.01)
    assert float(r.signal_to_noise(0.0, 0.0, 0.0)) == 0.0


def test_phase_law_is_that_of_a_first_harmonic() -> None:
    """(2-80): 0.1125 of a period over S/N, by the phase of a noisy cosine."""
    _close("constant", float(r.phase_sigma(1.0, 1.0)), 0.11254, 1e-4)
    count, sigma = 24, 0.1
    rng = np.random.default_rng(9)
    turn = 2.0 * math.pi * np.arange(count) / count
    lines = np.cos(turn) + rng.normal(0.0, sigma, (40_000, count))
    place = np.angle(lines @ np.exp(1j * turn)) / (2.0 * math.pi) * count
    snr = 0.5 * count / (math.sqrt(count) * sigma)
    _close("px", float(r.phase_sigma(count, snr)), float(place.std()), 0.02)
