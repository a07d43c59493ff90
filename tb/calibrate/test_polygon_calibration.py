"""The calibration of a scanner with a polygon: its eight parameters, and what it then measures."""

import math
from pathlib import Path

import numpy as np
import pytest
from synthetic import POLYGON, plane, relief, scanned

from vrscan.calibrate import coarse, mirror_map, recording, results, verify
from vrscan.calibrate.coarse import Coarse
from vrscan.calibrate.recording import Recording
from vrscan.data.config import load
from vrscan.scene.timeline import Scan, timeline
from vrscan.scene.tolerances import drawn

OWN = drawn(21, POLYGON)
FOCUS_MM = 360.0
OF_IT = {"frequency_hz": POLYGON.mirror.frequency_hz, "facets": POLYGON.mirror.facets}
FRAMES = 4503
DISTANCES = (300.0, 350.0, 400.0, 450.0, 500.0)


@pytest.fixture(scope="module")
def reliefs() -> list[Recording]:
    made = (relief(z, FOCUS_MM, **OF_IT) for z in DISTANCES)
    return [scanned(each, OWN, k, frames=FRAMES, config=POLYGON) for k, each in enumerate(made)]


@pytest.fixture(scope="module")
def planes() -> list[Recording]:
    made = (plane(z, FOCUS_MM, **OF_IT) for z in (330.0, 430.0))
    return [scanned(each, OWN, 40 + k, config=POLYGON) for k, each in enumerate(made)]


@pytest.fixture(scope="module")
def found(reliefs: list[Recording]) -> Coarse:
    return coarse.calibrate(reliefs, POLYGON, search=False)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["before", "behind"])
def test_the_starts_of_scan_give_the_angle(side: float) -> None:
    """With a diode before the scan the jitter is left and a part of the hunting of the speed.

    A diode behind the scan tells a facet's angle by the start of the one before it, which has
    another error.
    """
    update = {"index_deg": side * POLYGON.mirror.index_deg}
    config = POLYGON.model_copy(update={"mirror": POLYGON.mirror.model_copy(update=update)})
    own = OWN.model_copy(update=update)
    made = scanned(plane(400.0, **OF_IT), own, 3, frames=FRAMES, config=config)
    when = timeline(0, FRAMES, FRAMES, config, Scan(), 3, own)
    exact = when.angle_rad[made.line.astype(int)]
    mark = math.radians(config.mirror.index_deg)
    error = recording.angles(made, mark, config.mirror.harmonics) - exact
    later = made.time_s > made.in_s[0]  # before the first start the facet is another
    urad = 1e6 * float(np.sqrt(np.mean(np.square(error[later]))))
    facet_rad = math.radians(720.0 / config.mirror.facets)
    jitter = 1e-3 * config.mems.jitter_ns * facet_rad * config.mirror.frequency_hz
    hunting = config.polygon.speed_ppm * facet_rad
    facets = math.sqrt(2.0) * config.polygon.facet_urad if side < 0.0 else 0.0
    print(f"{urad:.2f} urad rms; jitter {jitter:.2f}, hunting {hunting:.2f}, facets {facets:.0f}")
    assert 0.5 * jitter < urad < math.hypot(jitter, facets) + hunting
    assert 1e6 * np.abs(made.angle_rad - exact).max() < 4.0 * math.hypot(jitter, facets) + hunting


def test_coarse_finds_the_geometry_and_the_diode(found: Coarse, reliefs: list[Recording]) -> None:
    """All that is observed within its standard deviation, and no error but that of the noise."""
    true = OWN.true(POLYGON, FOCUS_MM)
    fit = found.fit
    names = [each.name for each in fit.parameters]
    assert names[-2:] == ["index_deg", "seen_mm"] and len(names) == 9  # and no harmonics
    right = np.array([*(each.start for each in coarse.parameters(true)), 0.0])
    off = (fit.values - right) / fit.sigma
    for name, value, away, seen in zip(names, fit.values, off, fit.observed, strict=True):
        print(f"{name}: {value:.6g}, {away:+.1f} sigma, observed {seen}")
    assert np.abs(off[fit.observed]).max() < 5.0 and np.sqrt(np.mean(off[fit.observed] ** 2)) < 2.0
    assert all(fit.observed[names.index(name)] for name in ("base_mm", "focal_mm", "index_deg"))
    best = coarse.mean_mm(reliefs, true)
    print(f"start {found.start_mm:.3f} mm, found {found.mean_mm:.4f}, truth {best:.4f}")
    assert found.start_mm > 1.0 and found.mean_mm < 1.05 * best


def test_planes_that_no_step_has_seen_are_flat(
    found: Coarse, planes: list[Recording], tmp_path: Path
) -> None:
    """The file that coarse writes is that of the same polygon, and verify shows what it gains."""
    path = tmp_path / "coarse.toml"
    path.write_text(results.configuration(found.config, results.fitted(found.fit)))
    config = load(path)
    assert config.mirror == found.config.mirror and config.geometry == found.config.geometry
    for each in planes:
        before, after = (verify.verified(each, belief, None) for belief in (POLYGON, config))
        print(
            f"{each.name}: {before.plane_percent:.3f} % before, {after.plane_percent:.3f} % after"
        )
        assert before.plane_percent > 0.3 and after.plane_percent < 0.02
        assert abs(after.mean_mm) < 0.05 < abs(before.mean_mm)


def test_planes_alone_find_the_diode(planes: list[Recording]) -> None:
    """With the right geometry ``mirror`` fits one parameter, and needs no operating points."""
    true = OWN.true(POLYGON, FOCUS_MM)
    belief = POLYGON.model_copy(update={"geometry": true.geometry})
    fitted = mirror_map.calibrate(planes, belief)
    urad = [
        1e6 * math.radians(each.mirror.index_deg - true.mirror.index_deg)
        for each in (belief, fitted.config)
    ]
    print(f"diode off by {urad[0]:+.1f} urad before, {urad[1]:+.1f} after")
    assert [each.name for each in fitted.fit.parameters] == ["index_deg"]
    assert abs(urad[0]) > 100.0 and abs(urad[1]) < 10.0 and not fitted.natural_hz
