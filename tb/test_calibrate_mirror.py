"""The fit of the motion: what was put in comes out, with noise as theory says, or it is refused."""

import math

import numpy as np
import pytest
from harness import generator

from vrscan.calibrate.mirror import fit_motion, main, simulated_motion
from vrscan.config import Config
from vrscan.errors import InputError
from vrscan.ideal.mirror import motion

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


def test_noise_does_what_theory_says() -> None:
    """White noise: the amplitude scatters by sigma sqrt(2/n), a_k by the same over A, as does f."""
    count, sigma, trials = 1500, 1e-4, 150
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


def test_the_shipped_harmonics_are_the_simulated_mirrors() -> None:
    """What `python -m vrscan.calibrate.mirror` prints is the default, to its last digit."""
    fit = simulated_motion()
    shipped = np.array(Config().mirror.harmonics)
    assert np.abs(fit.harmonics - shipped)[:, 0].max() <= 0.6e-9
    assert np.abs(fit.harmonics - shipped)[:, 1].max() <= 0.6e-7
    assert abs(math.degrees(fit.amplitude_rad) - 20.5235) < 1e-3
    six = simulated_motion(count=6)
    for leaves in (six, fit):
        count = len(leaves.harmonics)
        print(f"{count} harmonics leave {leaves.residual_rad * 1e6:.3f} urad rms")
    assert abs(six.residual_rad - 3.96e-6) < 0.01e-6
    assert abs(fit.residual_rad - 1.41e-6) < 0.01e-6


def test_the_command_prints_the_default(capsys: pytest.CaptureFixture[str]) -> None:
    main()
    lines = capsys.readouterr().out.splitlines()
    printed = [
        line.split("[")[1].rstrip("]").split(", ") for line in lines if line.startswith("k =")
    ]
    assert [[float(a), float(phi)] for a, phi in printed] == Config().mirror.harmonics
    assert "residual   3.959 urad rms with 6 harmonics" in lines
    assert "residual   1.413 urad rms with 9 harmonics" in lines
