"""The natural frequency from phases, against the equation of motion that is integrated."""

import math

import numpy as np
import pytest

from vrscan.calibrate.motion_fit import NOMINAL_LEVEL, simulated_motions
from vrscan.ideal.natural_frequency import natural_frequency, resting_point, torque_means
from vrscan.scene.mems_mirror import Mirror

AMPLITUDE = math.radians(20.5)
LEVELS = (0.62, 0.70, 0.78)


@pytest.fixture(scope="module")
def rests():
    """The integrated motions at these levels."""
    return dict(zip(LEVELS, simulated_motions(AMPLITUDE, Mirror(), LEVELS), strict=True))


@pytest.mark.parametrize("damping", [1.0, 1.2])
def test_phases_of_the_integrated_motion_tell_its_natural_frequency(damping, rests):
    mirror = Mirror(damping=damping)
    points = list(rests.values())
    if damping != 1.0:
        points = simulated_motions(AMPLITUDE, mirror, (0.78,))
    found = natural_frequency(
        np.array([point.frequency_hz for point in points]),
        np.array([point.phase_rad for point in points]) / (2.0 * math.pi),
        np.array([point.amplitude_rad for point in points]),
        quality=mirror.quality / damping,
        comb_rad=mirror.comb_rad,
    )
    off = found - mirror.natural_hz
    print(f"damping {damping}: off by", np.round(1e3 * off, 3), "mHz")
    # The harmonics that are left out are 6e-4 of the motion, and as much of 0.5 Hz of stiffness.
    assert np.abs(off).max() < 1.5e-3


@pytest.mark.parametrize("level", LEVELS)
def test_the_resting_point_is_that_of_the_integrated_motion(level, rests):
    mirror, point = Mirror(), rests[level]
    frequency, phase = resting_point(
        mirror.natural_hz,
        AMPLITUDE,
        mirror.torque * (level / NOMINAL_LEVEL) ** 2,
        quality=mirror.quality,
        comb_rad=mirror.comb_rad,
    )
    assert frequency == pytest.approx(point.frequency_hz, abs=2e-3)
    assert phase == pytest.approx(point.phase_rad / (2.0 * math.pi), abs=2e-3)


def test_a_drift_moves_the_resting_frequency_by_as_much():
    mirror = Mirror()
    rest = [
        resting_point(
            hertz, AMPLITUDE, mirror.torque, quality=mirror.quality, comb_rad=mirror.comb_rad
        )
        for hertz in (248.5, 248.7)
    ]
    assert rest[1][0] - rest[0][0] == pytest.approx(0.2, abs=2e-3)
    assert rest[1][1] == pytest.approx(rest[0][1], abs=1e-4)


def test_the_means_are_those_of_a_fine_sum():
    turns = (np.arange(200_000) + 0.5) / 200_000
    for duty in (0.3, 0.5):
        for phase in (-0.02, 0.0654):
            theta = 2.0 * math.pi * (turns - phase)
            r = AMPLITUDE / 0.15 * np.cos(theta)
            torque = (2.0 * turns % 1.0 < duty) * r * np.exp(-np.square(r))
            want = [np.mean(torque * np.cos(theta)), np.mean(torque * np.sin(theta))]
            got = torque_means(np.array(phase), AMPLITUDE, 0.15, duty)
            np.testing.assert_allclose(got, want, atol=1e-5)


def test_what_drives_nothing_has_no_natural_frequency():
    found = natural_frequency(
        np.array([249.0]), np.array([0.3]), AMPLITUDE, quality=200.0, comb_rad=0.15
    )
    assert np.isnan(found).all()
    with pytest.raises(ValueError, match="does not reach"):
        resting_point(248.5, AMPLITUDE, 1e3, quality=200.0, comb_rad=0.15)
