"""docs/instrument.md from an experiment: its tables, and what it refuses."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from harness import generator

from vrscan.calibrate.recording import Recording, Setup
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.study.report import instrument_report
from vrscan.study.report.experiment_report import LIMITS, passes

NAMES = ("base_mm", "bias_deg", "offset_mm", "focal_mm", "centre_px", "index_deg", "a_11")
PLANE = {
    "mean_mm": 0.01,
    "overlaid_mm": 0.1,
    "plane_percent": 0.03,
    "points_percent": 0.04,
    "width_mm": 140.0,
    "count": 5000,
}


def results() -> dict[str, object]:
    rows = [
        {"name": name, "true": 1.0, "found": 1.01, "sigma": 0.02, "observed": name != "a_11"}
        for name in NAMES
    ]
    return {
        "coarse_mean_mm": 0.11,
        "plane_percent": 0.04,
        "points_percent_rms": 0.2,
        "drift_urad": 5.0,
        "index_mrad": 0.004,
        "pitch_mm": 4.97,
        "bust_points": 280_966,
        "coarse": {
            "start_mm": 14.0,
            "least_squares_seconds": 20.0,
            "least_squares_calls": 800,
            "simplex_mean_mm": 0.12,
            "simplex_seconds": 60.0,
            "simplex_calls": 7200,
            "parameters": rows,
        },
        "map": {},
        "drift": [{"level": 0.7, "frequency_hz": 249.0, "natural_hz": 248.5004, "view_urad": 6.0}],
        "planes": [PLANE | {"z_mm": z, "focus_mm": z} for z in (250.0, 1000.0)],
        "pitches_mm": [4.97, 4.97],
        "bust": {"lines": 1_000_000, "rms_mm": 0.2},
        "lines_in_view": [91.0, 103.0],
        "seed": 3,
        "frames": 10_000,
        "engine": "fixed",
    }


def test_the_page_says_what_is_kept_and_what_is_missed() -> None:
    found = results()
    text = instrument_report.page(found, Config())
    for name, (what, _, _) in LIMITS.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| {what} |"))
        assert row.endswith("| ok |" if passes(name, found[name]) else "| missed |")
    assert passes("bust_points", 280_966) and not passes("pitch_mm", 4.97)
    assert "left at their start: a_11." in text
    # 4 x 20.5 degrees over 150.1 lines: the paper says 9 mrad.
    assert "9.53 (0.953)" in text
    assert "150.1 (1501); with a point 91 to 103 |" in text
    assert all(picture in text for picture in instrument_report.PICTURES.values())


@pytest.mark.parametrize("count", [1, 6])
def test_each_distance_of_the_relief_has_a_colour(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That the legend covers no point and tells them apart is looked at in every picture."""
    draw, held = generator(8), {}
    for z_mm in range(320, 320 + 20 * count, 20):
        setup = Setup(kind="relief", z_mm=z_mm, amplitude_mm=5, focus_mm=360, frequency_hz=249)
        x_mm = draw.uniform(-100.0, 100.0, 2000)
        columns = [x_mm] * 5 + [x_mm, setup.z(x_mm)] + [np.arange(3.0)] * 2
        held[f"relief-{z_mm}"] = Recording(f"relief-{z_mm}", setup, *columns)
    monkeypatch.setattr(instrument_report, "load", lambda _: Config())
    monkeypatch.setattr(
        instrument_report.coarse, "errors", lambda each, _: draw.normal(0.0, 0.4, len(each))
    )
    file = io.BytesIO()
    instrument_report._relief(held, Path(), Config(), None, file)
    assert file.getvalue().startswith(b"\x89PNG")


def test_what_is_no_experiment_is_refused(tmp_path: Path) -> None:
    for text, wanted in ((None, "run-all makes it"), ("{", "not a file"), ("{}", "no bust")):
        if text is not None:
            (tmp_path / "results.json").write_text(text)
        with pytest.raises(InputError, match=wanted):
            instrument_report.read(tmp_path)
    (tmp_path / "results.json").write_text(json.dumps(results()))
    with pytest.raises(InputError, match=r"calibrated\.toml"):
        instrument_report.write(tmp_path, tmp_path)
