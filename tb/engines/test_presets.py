"""Every shipped scanner, end to end: its light, the RTL as its twin, and points that are true."""

from pathlib import Path

import numpy as np
import pytest

from vrscan.data.config import load, presets
from vrscan.data.points import csv_rows
from vrscan.engines.engine import Engine, run
from vrscan.scene.simulate import take

LINES = 160


@pytest.mark.parametrize("name", presets())
def test_a_preset_measures_a_plane_as_its_twin_and_as_it_is(name: str) -> None:
    config = load(Path(name))
    lines = take("plane", LINES, config, "minimal").lines
    assert lines.lines.shape == (LINES, config.sensor.line_length)
    assert lines.lines.max() < 2**config.sensor.pixel_width
    rtl, twin, ideal = (run(engine, lines, config) for engine in Engine)
    assert csv_rows(rtl) == csv_rows(twin)
    truth = lines.truth
    assert truth is not None
    for points in (twin, ideal):
        visible = np.isfinite(truth.position_px)  # the camera sees a part of the scan
        seen = points.located & visible
        assert visible.sum() > LINES / 3 and seen.sum() > 0.9 * visible.sum()
        error = points.z_mm[seen] - truth.z_mm[seen]
        assert np.median(np.abs(error)) < 3.0 * np.median(points.sigma_z_mm[seen])
        assert np.abs(error).max() < 0.01 * truth.z_mm[seen].max()
