"""The virtual experiment, small: every step with light, its files, and that it goes on."""

import contextlib
import json
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from vrscan.data.config import Config, load
from vrscan.data.correction_maps import read_maps
from vrscan.data.errors import InputError
from vrscan.study import experiment
from vrscan.study.experiment import Experiment, pitch_mm
from vrscan.study.report import experiment_report as report

SMALL = {
    "RELIEF_MM": (330.0, 360.0, 400.0),
    "MIRROR_MM": (330.0, 400.0),
    "MIRROR_LEVELS": (0.66, 0.74),
    "DRIFTED_LEVELS": (0.70,),
    "MAP_COUNT": 3,
    "MAP_FAR_MM": 475.0,
    "MAP_PLANES_MM": (0.16, -0.16),
    "VERIFY_MM": (360.0, 440.0),
    "BOLT_MM": 400.0,
    "BOLT_FOCI_MM": (400.0,),
    "BOLT_POSES_DEG": (10.0,),
}


@contextlib.contextmanager
def quiet(_name: str, _total: int) -> Iterator[Callable[[int], None]]:
    yield lambda _done: None


@pytest.fixture(scope="module")
def small() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SMALL.items():
            patch.setattr(experiment, name, value)
        yield


@pytest.fixture(scope="module")
def plan(small: None, tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    folder = tmp_path_factory.mktemp("experiment")
    return Experiment(21, folder, Config(), frames=3002, bust_lines=4096, jobs=1)


@pytest.fixture(scope="module")
def found(plan: Experiment) -> dict[str, object]:
    return experiment.run(plan, quiet)


def test_it_reaches_what_the_paper_aims_at(found: dict[str, object]) -> None:
    """At short range and with a fifth of the lines; the whole experiment has the full limits."""
    for name in report.LIMITS:
        print(f"{name}: {found[name]:.4g}")
    assert found["coarse_mean_mm"] < 0.15
    assert found["plane_percent"] < 0.1
    assert found["points_percent_rms"] < 0.1
    assert found["drift_urad"] < 40.0
    assert found["pitch_mm"] == pytest.approx(5.0, abs=0.02)
    assert found["bust_points"] > 0
    report.table(found)
    report.planes(found["planes"])


def test_its_files_say_where_they_come_from(plan: Experiment, found: dict[str, object]) -> None:
    held = json.loads((plan.folder / "results.json").read_text())
    assert held == json.loads(json.dumps(found))
    config = load(plan.folder / "calibrated.toml")
    assert abs(config.geometry.base_mm - plan.instrument.base_mm) < 0.1
    text = (plan.folder / "coarse.toml").read_text()
    assert text.count("# relief-") == 3 and "sha256" in text and "+-" in text
    assert len(read_maps(plan.folder / "map.npz").corrections_px) == 3


def test_it_goes_on_where_it_was(plan: Experiment, found: dict[str, object]) -> None:
    """A second run takes no scan again, and one that is lost comes back the same."""
    paths = sorted((plan.folder / "scans").iterdir())
    before = {path: path.stat().st_mtime_ns for path in paths}
    scan = plan.coarse_scans()[1]
    lost = plan.path(scan)
    kept = np.load(lost)["position_px"]
    lost.unlink()
    again = plan.take(plan.coarse_scans(), lambda _done: None)
    assert np.array_equal(again[1].position_px, kept)
    assert {path: path.stat().st_mtime_ns for path in paths if path != lost} == {
        path: time for path, time in before.items() if path != lost
    }


def test_another_experiment_is_refused(plan: Experiment, found: dict[str, object]) -> None:
    with pytest.raises(InputError, match="holds another experiment"):
        replace(plan, seed=22).open()
    with pytest.raises(InputError, match="--frames"):
        replace(plan, frames=100)


@pytest.mark.parametrize("pitch", [4.6, 5.0, 5.37])
def test_the_pitch_of_a_drawn_thread_is_found(pitch: float) -> None:
    draw = np.random.default_rng(9)
    s = draw.uniform(-60.0, 60.0, 2500)
    off = 2.7 * np.abs((s / pitch) % 1.0 - 0.5) + 0.2 * draw.standard_normal(2500)
    turn = np.radians(15.0)
    x, z = np.cos(turn) * s - np.sin(turn) * off, np.sin(turn) * s + np.cos(turn) * off
    z[:50] += 80.0  # what lies behind the rod
    assert pitch_mm(x, 600.0 + z) == pytest.approx(pitch, abs=0.004)
