"""The table of the loops of laser and lens, small: its rows, its files and its page."""

import io
from pathlib import Path

import pytest

from vrscan.data.config import Config
from vrscan.study.report import loops_report as report

ROWS = [
    report.Row(r, z, way, 7.0, 0.5, z, 1.0, 0.0, 0.03 * (4 - way), 1.0)
    for r in report.REFLECTANCES
    for z in report.PLANES_MM
    for way in range(len(report.NAMES))
]


def test_a_loop_brings_the_peak_to_its_target(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lens out of focus at 300 mm, the power with its loop and without."""
    monkeypatch.setattr(report, "BLOCKS", 2)
    monkeypatch.setattr(report, "MEASURED", 1)
    work = report._Work(Config())
    constant, adapted = (work((0.8, 300.0, way)) for way in (0, 1))
    assert constant.peak < 0.3 < adapted.peak < 0.7
    assert constant.power_mw == pytest.approx(report.POWER_MW, abs=1e-3) != adapted.power_mw
    assert constant.focus_mm == pytest.approx(report.FOCUS_MM, rel=1e-3)
    assert constant.points > 0.9 < adapted.points


def test_the_page_gets_table_and_picture_between_its_marks(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    page, drawn = report.pages(tmp_path)
    page.write_text(f"before\n{report._BEGIN}\nold\n{report._END}\nbehind\n")
    assert report.write(ROWS, tmp_path) == (page, drawn)
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("behind\n") and "old" not in text
    assert text.count("adaptive, automatic") == len(ROWS) // len(report.NAMES)
    assert drawn.read_bytes().startswith(b"\x89PNG")
    png = io.BytesIO()
    report.picture(ROWS, png)
    assert png.getvalue() == drawn.read_bytes()
    assert len(report.sheet(ROWS).csv().splitlines()) == len(ROWS) + 1 == report.COUNT + 1
