"""The fit of the motion: what was put in comes out, with noise as theory says, or it is refused."""

import math
import tomllib

import numpy as np
import pytest
from harness import (
    generator,
    in_volume,
)

from vrscan.calibrate.motion_fit import (
    Motion,
    fit_motion,
    main,
    operating_map,
    simulated_map,
    simulated_motion,
)
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.ideal.motion import motion

HARMONIC = np.array(
    [
        *([1.0, 0.0], [0.03, 2.0], [0.01, -1.3], [4e-3, 0.7], [2e-3, 3.0], [1e-3, -1.1]),
        *([7e-4, 0.2], [5e-4, -2.4], [3e-4, 1.6]),
    ]
)
FREQUENCY, AMPLITUDE, PHASE = 249.0123, 0.358, 5.1


def recorded(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times at the line rate, from a late start, and angles of (12)."""
    time = 3.7 + np.arange(count) / 37_400.0
    return time, motion(time * FREQUENCY - PHASE / (2.0 * math.pi), AMPLITUDE, HARMONIC)


def test_a_clean_motion_comes_back() -> None:
    time, angle = recorded(2000)
    fit = fit_motion(time, angle, FREQUENCY)
    assert abs(fit.amplitude_rad - AMPLITUDE) < 1e-12
    assert abs(fit.phase_rad - PHASE) < 1e-9  # 3.7 s of turns in float64
    assert np.abs(fit.harmonics[:, 0] - HARMONIC[:, 0]).max() < 1e-12
    assert np.abs(fit.harmonics[:, 1] - HARMONIC[:, 1]).max() < 1e-7
    assert tuple(fit.harmonics[0]) == (1.0, 0.0)
    assert fit.residual_rad < 1e-12 and fit.frequency_hz == FREQUENCY
    again = motion(time * FREQUENCY - fit.phase_rad / (2.0 * math.pi), AMPLITUDE, fit.harmonics)
    assert np.abs(again - angle).max() < 1e-9
    order = generator(1).permutation(2000)
    assert abs(fit_motion(time[order], angle[order], FREQUENCY).amplitude_rad - AMPLITUDE) < 1e-12


def test_a_wrong_frequency_is_found() -> None:
    time, angle = recorded(4000)
    fit = fit_motion(time, angle, 248.0, refine=True)
    assert abs(fit.frequency_hz - FREQUENCY) < 1e-9
    assert abs(fit.amplitude_rad - AMPLITUDE) < 1e-11 and abs(fit.phase_rad - PHASE) < 1e-7
    assert fit_motion(time, angle, 248.0).residual_rad > 0.01


@pytest.mark.parametrize("trials", [40, in_volume(400)])
def test_noise_does_what_theory_says(trials: int) -> None:
    """White noise: the amplitude scatters by sigma sqrt(2/n), a_k by the same over A, as does f."""
    count, sigma = 1500, 1e-4
    time, angle = recorded(count)
    draw = generator(2)
    fits = [
        fit_motion(time, angle + draw.normal(0.0, sigma, count), 249.0, refine=True)
        for _ in range(trials)
    ]
    want = sigma * math.sqrt(2.0 / count)
    span = count / 37_400.0
    predicted = {
        "amplitude": (np.std([f.amplitude_rad for f in fits]), want),
        "a_3": (np.std([f.harmonics[1, 0] for f in fits]), want / AMPLITUDE),
        "a_17": (np.std([f.harmonics[8, 0] for f in fits]), want / AMPLITUDE),
        "frequency": (
            np.std([f.frequency_hz for f in fits]),
            want / AMPLITUDE * math.sqrt(12.0) / (2.0 * math.pi * span),
        ),
        "residual": (np.mean([f.residual_rad for f in fits]), sigma),
    }
    for name, (got, expected) in predicted.items():
        print(f"{name}: measured {got:.3e}, predicted {expected:.3e}")
        assert abs(got / expected - 1.0) < 4.0 / math.sqrt(2.0 * trials), name
    assert abs(np.mean([f.amplitude_rad for f in fits]) - AMPLITUDE) < 4.0 * want / trials**0.5


def test_what_cannot_be_fitted_is_refused() -> None:
    time, angle = recorded(100)
    broken = angle.copy()
    broken[7] = math.nan
    late = time.copy()
    late[3] = math.inf
    same = np.arange(100) / FREQUENCY  # once a period: no harmonic is told from another
    for arguments, word in (
        ((time[:53], angle[:53], FREQUENCY), "53 samples, needs 54"),
        ((time, angle[:99], FREQUENCY), "angles"),
        ((time, broken, FREQUENCY), "finite"),
        ((late, angle, FREQUENCY), "finite"),
        ((time, angle, 0.0), "not positive"),
        ((time, angle, math.nan), "not positive"),
        ((same, angle, FREQUENCY), "do not determine"),
        ((time, 0.0 * angle, FREQUENCY), "nothing moves"),
    ):
        with pytest.raises(InputError, match=word) as caught:
            fit_motion(*arguments)
        assert "\n" not in str(caught.value)
    assert fit_motion(time[:54] * 8.0, angle[:54], FREQUENCY).residual_rad < 1.0
    assert fit_motion(time[:36] * 8.0, angle[:36], FREQUENCY, count=6).residual_rad < 1.0


def test_nine_harmonics_leave_a_third_of_what_six_do() -> None:
    six, nine = simulated_motion(count=6), simulated_motion()
    for leaves in (six, nine):
        count = len(leaves.harmonics)
        print(f"{count} harmonics leave {leaves.residual_rad * 1e6:.3f} urad rms")
    assert abs(six.residual_rad - 3.96e-6) < 0.01e-6
    assert abs(nine.residual_rad - 1.41e-6) < 0.01e-6


@pytest.fixture(scope="module")
def shipped_map():
    """The map of the simulated mirror."""
    return simulated_map(math.radians(20.5), math.radians(17.0))[0]


def test_the_shipped_map_is_the_simulated_mirrors(shipped_map) -> None:
    """What `python -m vrscan.calibrate.motion_fit` prints is the default, to its last digit."""
    mirror = Config().mirror
    for found, shipped in (
        (shipped_map.harmonics, mirror.harmonics),
        (shipped_map.slopes, mirror.slopes),
    ):
        off = np.abs(found - np.array(shipped))
        assert off[:, 0].max() <= 0.6e-9
        assert off[:, 1].max() <= 0.6e-7
    assert abs(shipped_map.drive_phase - mirror.drive_phase) <= 0.6e-7


def test_straight_lines_follow_the_operating_point(shipped_map) -> None:
    """Of 48 urad that fixed harmonics err by at the ends of the band, 2 are left."""
    assert 40e-6 < shipped_map.residual_without_slopes_rad < 55e-6
    assert shipped_map.residual_rad < 2e-6


def test_a_map_needs_two_operating_points() -> None:
    point = Motion(249.0, 0.358, 0.4, np.array([[1.0, 0.0]]), 0.0)
    with pytest.raises(InputError, match="two operating points"):
        operating_map([point], 0.3)
    with pytest.raises(InputError, match="two operating points"):
        operating_map([point, point], 0.3)


def test_a_map_of_known_lines_is_those_lines() -> None:
    """Harmonics that are linear in the drive's phase, so small that the index does not see them."""
    slope = np.array([[0.0, 0.0], [1e-7, 3.0]])
    base = np.array([[1.0, 0.0], [1e-7, 0.4]])
    points = [
        Motion(249.0, 0.358, 2.0 * math.pi * (0.06 + d), base + d * slope, 0.0)
        for d in (-0.01, 0.0, 0.004, 0.01)
    ]
    found = operating_map(points, 0.3, reference=1)
    assert found.drive_phase == pytest.approx(0.06)
    assert np.allclose(found.harmonics, base, atol=1e-12)
    assert np.allclose(found.slopes[1], slope[1], rtol=1e-3)
    assert found.residual_rad < 1e-2 * found.residual_without_slopes_rad


def test_the_command_prints_the_default(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, shipped_map
) -> None:
    """As TOML that a configuration takes; the map is the one of the tests above."""
    point = simulated_motion()
    monkeypatch.setattr(
        "vrscan.calibrate.motion_fit.simulated_map", lambda *_: (shipped_map, [point] * 5)
    )
    main()
    text = capsys.readouterr().out
    assert "3.96 urad rms beyond k = 11" in text
    printed = tomllib.loads(text[text.index("drive_phase") :])
    mirror = Config().mirror
    assert printed == {
        "drive_phase": mirror.drive_phase,
        "harmonics": mirror.harmonics,
        "slopes": mirror.slopes,
    }
