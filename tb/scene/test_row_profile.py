"""The row's view of a cut beam against a wave that a 2-D FFT carries, summed over its grid."""

import math

import numpy as np
import pytest
from carried_beam import carried

from vrscan.data.arrays import Floats
from vrscan.scene import beam, image
from vrscan.scene.beam import Laser
from vrscan.scene.row_profile import CutBeam, gaussian_cumulated

SIZE = 1024
CASES = [
    (Laser(), 250.0),
    (Laser(), 400.0),
    (Laser(), 1000.0),
    (Laser(aperture_mm=2 / 3), 250.0),
    (Laser(beam_diameter_mm=0.4, waist_mm=200.0, aperture_mm=0.8), 700.0),  # past its focus
    (Laser(waist_mm=-500.0, aperture_mm=1.2), 500.0),
]


def tables(laser: Laser) -> CutBeam:
    found = beam.cut(laser)
    assert found is not None
    return found


def chord(place: Floats, disc: float, row: float) -> Floats:
    """Return a disc's mean light over the height of a row beside its middle, of 1 in all."""

    def below(y: Floats) -> Floats:
        y = np.clip(y / disc, -1.0, 1.0)
        return 0.5 + (y * np.sqrt(1.0 - y * y) + np.arcsin(y)) / math.pi

    return below(place + 0.5 * row) - below(place - 0.5 * row)


@pytest.mark.parametrize(("laser", "z"), CASES)
def test_the_row_sees_what_a_carried_wave_puts_there(laser: Laser, z: float) -> None:
    row = 0.0125 if z < 600.0 else 0.0166  # one of the grid's; a far beam needs a wider grid
    axis, power = carried(laser, z, row, SIZE)
    place, cut = np.array([z]), tables(laser)
    zone, radius = beam.zone(place, laser), float(beam.radius_mm(place, laser)[0])
    for disc in (0.02, 0.6, 4.0):
        half = disc * radius
        profile = chord(axis, half, row) @ power  # light along the row
        share = float(profile.sum())
        got = float(cut.row_share(np.array([row / radius]), np.array([disc]), zone)[0])
        band = image.band(np.array([0.5 * radius / row]), np.array([half / row]))
        turns = np.linspace(0.0, 2.5, 60)
        want = np.cos(2.0 * math.pi * turns[:, None] / radius * axis) @ profile / share
        worst = np.abs(cut.transfer(turns[None].astype(np.float32), zone, band)[0] - want).max()
        print(f"z {z:g}, disc {half:.3f} mm: {got:.6f} / {share:.6f}, transform to {worst:.5f}")
        assert got == pytest.approx(share, rel=1e-3)
        assert worst < 4e-3

        x = np.array([0.2, 0.5, 0.9, 1.5, 2.5, 4.0])
        light, moment = cut.cumulated(zone, band)(x[None], np.zeros((1, 1), np.int64))
        fine = np.linspace(0.0, 4.0, 4001)
        density = np.interp(fine * radius, axis, profile) / share / row * radius
        step = fine[1]
        sums = np.cumsum(density) * step - 0.5 * step * (density[0] + density)
        firsts = np.cumsum(density * fine) * step
        assert np.abs(light[0] - np.interp(x, fine, sums)).max() < 2.5e-3
        assert np.abs(moment[0] - np.interp(x, fine, firsts)).max() < 4e-3


@pytest.mark.parametrize("ratio", [1.0, 3.0])
@pytest.mark.parametrize("zone", [0.0, 0.51, 1.0])
def test_no_light_is_lost(ratio: float, zone: float) -> None:
    """On rows that lie side by side there is all of it, whatever the distance and the disc."""
    cut = tables(Laser(beam_diameter_mm=ratio, aperture_mm=1.0))
    zones, disc = np.full(4, zone), np.array([0.0, 0.4, 3.0, 40.0])
    band = disc / (1.0 + disc)
    light, _ = cut.cumulated(zones, band)(np.full((4, 1), 9.0), np.arange(4)[:, None])
    assert np.all(light == 0.5)
    turns = np.zeros((4, 1), np.float32)
    assert np.all(cut.transfer(turns, zones, band) == 1.0)
    # Far wider than the spot, the disc's chord is all that the row sees.
    wide = float(cut.row_share(np.full(4, 0.1), disc, zones)[3])
    assert wide == pytest.approx(0.1 * 2.0 / math.pi / 40.0, rel=2e-3)


def test_a_beam_that_is_hardly_cut_is_the_uncut_one() -> None:
    laser = Laser(beam_diameter_mm=1.0, aperture_mm=4.0)
    whole = Laser(beam_diameter_mm=1.0, aperture_mm=math.inf)
    z = np.array([1.0, 300.0, 900.0, 3000.0])
    cut = tables(laser)
    assert np.allclose(beam.radius_mm(z, laser), beam.radius_mm(z, whole), rtol=2e-4)
    turns = np.linspace(0.0, 1.2, 40)
    want = np.exp(-0.5 * np.square(math.pi * turns))
    for band in (0.0, 0.4, 1.0):
        at = np.full(len(z), band)
        zone = beam.zone(z, laser)
        found = cut.transfer(np.tile(turns, (len(z), 1)).astype(np.float32), zone, at)
        assert np.abs(found - want).max() < 5e-4
        x = np.tile(np.array([-1.7, -0.4, 0.0, 0.6, 3.0]), (len(z), 1))
        got = cut.cumulated(zone, at)(x, np.arange(len(z))[:, None])
        for one, other in zip(got, gaussian_cumulated(x), strict=True):
            assert np.abs(one - other).max() < 1e-3


def test_a_gaussians_light_and_moment_are_its_integrals() -> None:
    x = np.linspace(0.0, 2.0, 20_001)
    density = math.sqrt(2.0 / math.pi) * np.exp(-2.0 * x * x)
    light, moment = gaussian_cumulated(x)
    assert np.abs(np.gradient(light, x) - density)[1:-1].max() < 1e-6
    assert np.abs(np.gradient(moment, x) - x * density)[1:-1].max() < 1e-6
    assert moment[0] == light[0] == 0.0
    assert gaussian_cumulated(np.array([np.inf]))[0][0] == 0.5
