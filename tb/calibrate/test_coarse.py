"""The coarse calibration on scans of the true equations: what it finds, says and refuses."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import CONFIG, NOISE_PX, plane, relief, scanned

from vrscan.calibrate import coarse
from vrscan.calibrate.coarse import Coarse
from vrscan.calibrate.recording import Recording
from vrscan.data.errors import InputError
from vrscan.scene.tolerances import drawn

OWN = drawn(11)
DISTANCES = (300.0, 340.0, 380.0, 420.0, 460.0, 500.0)


@pytest.fixture(scope="module")
def reliefs() -> list[Recording]:
    return [scanned(relief(z), OWN, k) for k, z in enumerate(DISTANCES)]


@pytest.fixture(scope="module")
def found(reliefs: list[Recording]) -> Coarse:
    return coarse.calibrate(reliefs, CONFIG, most=900)


def test_it_finds_what_it_says_that_it_observes(found: Coarse) -> None:
    """Each observed parameter within its standard deviation, the others at their start."""
    true = [each.start for each in coarse.parameters(OWN.true(CONFIG, 360.0))]
    true.append(0.0)  # points of these scans are of the surface itself, and not of a spot on it
    fit = found.fit
    assert len(fit.parameters) == 19
    off = (fit.values - np.array(true)) / fit.sigma
    for each, value, sigma, seen, away in zip(
        fit.parameters, fit.values, fit.sigma, fit.observed, off, strict=True
    ):
        print(f"{each.name}: {value:.6g} +- {sigma:.2g}, {away:+.1f} sigma, observed {seen}")
        if not seen:
            assert value == each.start
    assert np.sqrt(np.mean(np.square(off[fit.observed]))) < 2.0
    assert np.abs(off[fit.observed]).max() < 5.0
    for name in ("base_mm", "bias_deg", "focal_mm", "index_deg"):
        assert fit.observed[[p.name for p in fit.parameters].index(name)]
    # A harmonic of 1e-5 of the amplitude, 7 urad, is far below the noise of a point.
    assert not fit.observed.all()
    assert fit.correlated(0.8)  # bias and centre turn the same ray


def test_it_leaves_the_noise_only(found: Coarse, reliefs: list[Recording]) -> None:
    """No error beyond what the same noise makes with the true parameters."""
    best = coarse.mean_mm(reliefs, OWN.true(CONFIG, 360.0))
    print(f"start {found.start_mm:.3f} mm, found {found.mean_mm:.4f}, truth {best:.4f}")
    print(f"simplex {found.simplex_mean_mm:.4f} mm after {found.simplex_calls} evaluations")
    assert found.start_mm > 1.0
    assert found.mean_mm < 1.05 * best
    assert found.mean_mm <= found.simplex_mean_mm < 0.5 * found.start_mm


def test_outliers_do_not_pull_it(reliefs: list[Recording]) -> None:
    rng = np.random.default_rng(5)
    dirty = []
    for each in reliefs:
        jump = np.where(rng.random(len(each)) < 0.03, rng.uniform(-40.0, 40.0, len(each)), 0.0)
        dirty.append(replace(each, position_px=each.position_px + jump))
    found = coarse.calibrate(dirty, CONFIG, search=False)
    assert coarse.mean_mm(reliefs, found.config) < 1.2 * coarse.mean_mm(
        reliefs, OWN.true(CONFIG, 360.0)
    )


def test_what_cannot_work_is_refused(reliefs: list[Recording]) -> None:
    flat = [scanned(plane(z), OWN, 7) for z in DISTANCES]
    said = [replace(each, setup=relief(each.setup.z_mm)) for each in flat]
    other = replace(reliefs[2], setup=relief(380.0, focus_mm=500.0))
    turned = [reliefs[k] for k in (0, 2, 1, 3)]
    moved = [*reliefs[:3], scanned(relief(420.0), OWN, 3, off_mm=2.0), *reliefs[4:]]
    swapped = [
        replace(each, setup=relief(z)) for each, z in zip(turned, DISTANCES[:4], strict=True)
    ]
    for scans, wanted in (
        (reliefs[:2], "2 distances"),
        (flat, "a relief that is a plane"),
        (said, "a relief that is a plane"),
        ([*reliefs[:2], other, *reliefs[3:]], "the focus changes"),
        (turned, "the stage does not go one way: stated"),
        (swapped, "the stage does not go one way: measured"),
        (moved, "relief-420: disagrees"),
    ):
        with pytest.raises(InputError, match=wanted) as caught:
            coarse.calibrate(scans, CONFIG, search=False)
        assert "\n" not in str(caught.value)


def test_the_overlay_averages_what_comes_again(reliefs: list[Recording]) -> None:
    noise = np.random.default_rng(1).standard_normal(len(reliefs[0])) * NOISE_PX
    count = len(reliefs[0]) / len(reliefs[0].overlaid(noise))
    assert np.std(reliefs[0].overlaid(noise)) == pytest.approx(NOISE_PX / np.sqrt(count), rel=0.1)


def test_the_mean_of_a_place_has_the_standard_deviation_of_a_mean(reliefs: list[Recording]) -> None:
    folded = reliefs[0].folded()
    noise = np.random.default_rng(2).standard_normal(len(reliefs[0])) * reliefs[0].sigma_px
    scatter = replace(reliefs[0], x_mm=noise).folded().x_mm / folded.sigma_px
    print(f"scatter over sigma {np.std(scatter):.3f}, wanted 1")
    assert np.std(scatter) == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * len(scatter)))
