"""Calibration scans: their files, and the angle that the index alone gives."""

import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from synthetic import CONFIG, plane, scanned

from vrscan.calibrate import recording
from vrscan.data.errors import InputError
from vrscan.scene.timeline import Scan, timeline
from vrscan.scene.tolerances import Instrument, drawn


def test_a_scan_is_read_back(tmp_path: Path) -> None:
    made = scanned(plane(400.0, drive_phase=0.06), drawn(1), 1)
    path = tmp_path / "plane-400.npz"
    with path.open("wb") as file:
        recording.write(made, file)
    held = recording.read(path)
    assert held.setup == made.setup
    for each in fields(recording.Recording):
        if each.name not in ("name", "setup"):
            assert np.array_equal(getattr(held, each.name), getattr(made, each.name)), each.name


def test_what_is_no_scan_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scan.npz"
    for text in (b"", b"no archive"):
        path.write_bytes(text)
        with pytest.raises(InputError, match=r"scan\.npz"):
            recording.read(path)
    np.savez(path, setup=np.array("{}"))
    with pytest.raises(InputError, match=r"scan\.npz: kind"):
        recording.read(path)
    with pytest.raises(InputError, match="No such file"):
        recording.read(tmp_path / "none.npz")


@pytest.mark.parametrize("mark_deg", [17.0, -15.0])
def test_the_index_alone_gives_the_angle(mark_deg: float) -> None:
    """With the true mark and harmonics the angle is right to the jitter of the mean crossing."""
    own = Instrument(index_deg=mark_deg, harmonics=drawn(4).harmonics)
    made = scanned(plane(400.0), own, 2)
    true = own.true(CONFIG, 360.0).mirror
    angle = recording.angles(made, math.radians(mark_deg), true.harmonics)
    exact = timeline(0, 4503, 4503, CONFIG, Scan(), 2, own).angle_rad[made.line.astype(int)]
    error = 1e6 * np.abs(angle - exact).max()
    # 1 ns of jitter at the mark, in each of 30 pairs: some 0.6 urad / root 30, at most twice.
    print(f"mark {mark_deg:g} degrees: {error:.3f} urad")
    assert error < 0.7


def test_too_little_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        recording.from_file(tmp_path, CONFIG)
    (tmp_path / "points.csv").write_text("line,x_mm\n1,2\n")
    with pytest.raises(InputError, match="no column peak"):
        recording.from_file(tmp_path, CONFIG)
