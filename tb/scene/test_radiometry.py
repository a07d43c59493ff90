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
