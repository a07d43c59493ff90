"""The number table, its files, and the pages that quote it."""

import csv
import io
import math
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from vrscan.cli.app import app
from vrscan.engines.tools import repository_root
from vrscan.show.sheet import replace_block
from vrscan.study.report import formats, numbers
from vrscan.study.report.figure import Figure
from vrscan.study.report.reliability_report import EDGES_MM, MOST, STEPS, Reliability
from vrscan.study.report.space_report import Space

GOOD = Figure("group", "good", "px", 0.5, 0.8, 0.4, 1.0, headline="shown")
NEAR = Figure("group", "near", "px", 0.7, 0.8, 0.4, 1.0, headline="shown")
BAD = Figure("group", "bad", "px", 0.9, 0.8, 0.4, 1.0)
LOW = Figure("other", "low", "1", 0.8, limit=0.9, at_least=True)
BARE = Figure("other", "bare", "1", 3.0)


def test_a_figure_fails_beyond_its_bound_or_its_limit() -> None:
    assert GOOD.passes and BARE.passes
    assert not BAD.passes  # within its limit, beyond its bound
    assert not LOW.passes
    assert not Figure("group", "nothing measured", "px", math.nan, limit=1.0).passes


def test_numbers_of_the_whole_chain(tmp_path, monkeypatch) -> None:
    """The command at its quick size: every figure passes, the CSV has them all.

    But for the speed of this machine, which is the bench's to judge.
    """
    monkeypatch.setattr(numbers, "LEAST_FIXED", 0.0)
    out = tmp_path / "numbers.csv"
    result = CliRunner().invoke(app, ["numbers", "--quick", "--csv", str(out)])
    assert result.exit_code == 0, result.output
    rows = list(csv.DictReader(io.StringIO(out.read_text())))
    assert {row["passes"] for row in rows} == {"", "1"}
    groups = {row["group"] for row in rows}
    for start in ("cordic", "position, T = N", "S/N", "x and z", "scan_angle", "scatter",
                  "efficiency", "speckled", "scenes", "latency", "speed"):  # fmt: skip
        assert any(group.startswith(start) for group in groups), start
    assert "measured" in result.output and "FAIL" not in result.output


def of(points: int, within: int, **changes: int) -> Reliability:
    """Return so many points, some of them within a fraction of sigma and the others beyond."""
    shares = np.zeros(MOST * STEPS + 2, np.int64)
    shares[0], shares[-1] = within, points - within
    none = np.zeros(len(EDGES_MM) - 1)
    return Reliability(points, changes.get("astray", 0), points, 4.0 * points, shares,
                       none.astype(np.int64), none, none)  # fmt: skip


def test_scenes_add_up_and_a_headline_shows_all_of_them() -> None:
    found = {
        "default": (of(100, 90), Space(200, 50, 0, 1), numbers.Rounding(0.0074, 7.7)),
        "two": (of(300, 150, astray=4), Space(400, 150, 2, 0), numbers.Rounding(0.01, 9.0)),
        "none": (of(0, 0), Space(10, 0, 0, 0), numbers.Rounding(math.nan, math.nan)),
    }
    figures = {each.name: each for each in numbers.scene_figures(found)}
    assert figures["default, within 2 sigma, of normal errors 95.4"].measured == pytest.approx(90.0)
    assert figures["all scenes, within 2 sigma"].measured == pytest.approx(60.0)
    assert figures["all scenes, astray"].measured == pytest.approx(1.0)
    assert figures["error over sigma, median of the scenes"].measured == pytest.approx(2.0)
    false = figures["falsely free, of 200 lines with a free part"]
    assert false.measured == pytest.approx(1.0) and not false.passes
    assert figures["free, with a surface that another one hides"].measured == pytest.approx(0.5)
    assert set(numbers.headlines(figures.values())) < set(numbers.README)
    nothing = numbers.scene_figures({"none": found["none"]})
    assert all(each.passes for each in nothing)


def test_csv_leaves_empty_what_there_is_not() -> None:
    lines = numbers.sheet([GOOD, BARE, LOW]).csv().decode().splitlines()
    assert lines[1] == "group,good,px,0.5,0.8,0.4,1.0,most,1"
    assert lines[2] == "other,bare,1,3.0,,,,most,"
    assert lines[3] == "other,low,1,0.8,,,0.9,least,0"


def test_summary_shows_the_one_nearest_to_its_limit() -> None:
    text = numbers.summary([GOOD, NEAR, BAD, BARE])
    assert text.splitlines()[2:] == ["| shown | px | 0.7 | 0.8 | 0.4 | 1 |"]


def test_the_readme_shows_headlines_of_the_page() -> None:
    """As docs/numbers.md has them, and each name links to the section that is there."""
    root = repository_root()
    readme, page = (root / "README.md").read_text(), (root / "docs" / "numbers.md").read_text()
    place, _, anchor = numbers._SUMMARY.partition("#")
    assert place == "docs/numbers.md"
    assert anchor in {h.lower().replace(" ", "-") for h in re.findall(r"^#+ (.*)$", page, re.M)}
    block = page.partition("<!-- summary: begin -->")[2].partition("<!-- summary: end -->")[0]
    rows = [[c.strip() for c in x.strip("| ").split(" | ")] for x in block.splitlines()[4:] if x]
    measured = {name: (value, unit) for name, unit, value, *_ in rows}
    shown = re.findall(
        rf"^\| \[(.*)\]\({re.escape(numbers._SUMMARY)}\) \| (\S+)(.*?) \|", readme, re.M
    )
    assert [name for name, *_ in shown] == list(numbers.README)
    for name, value, unit in shown:
        assert (value, unit.strip() or "1") == measured[name], name


def test_the_excerpt_leaves_out_what_was_not_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numbers, "README", ("shown", "not measured"))
    text = numbers.excerpt([GOOD, NEAR, BARE])
    assert text.splitlines()[2:] == [
        "| [shown](docs/numbers.md#headline-figures) | 0.7 px | <= 1 |"
    ]


def test_blocks_are_replaced_between_their_markers_only() -> None:
    page = "a\n<!-- numbers: begin -->\nold\n<!-- numbers: end -->\nb\n"
    new = replace_block(page, "numbers", "new")
    assert new == "a\n<!-- numbers: begin -->\n\nnew\n\n<!-- numbers: end -->\nb\n"
    assert replace_block(new, "numbers", "new") == new
    assert replace_block(page, "formats", "new") is None
    assert replace_block("no marker", "numbers", "new") is None


def test_pages_are_rewritten_where_they_have_their_markers(tmp_path) -> None:
    (tmp_path / "docs").mkdir()
    readme, page = tmp_path / "README.md", tmp_path / "docs" / "numbers.md"
    readme.write_text("no markers\n")
    marks = ("numbers", "summary", *formats.blocks())
    page.write_text("".join(f"<!-- {m}: begin -->\n<!-- {m}: end -->\n" for m in marks))
    assert numbers.write_pages([GOOD], tmp_path) == [page]
    assert readme.read_text() == "no markers\n"
    assert "| good | px |" in page.read_text()


@pytest.mark.parametrize("name", formats.blocks())
def test_page_has_the_formats_and_latencies_of_the_sources(name: str) -> None:
    page = (repository_root() / "docs" / "numbers.md").read_text()
    fresh = replace_block(page, name, formats.blocks()[name])
    assert page == fresh, f"docs/numbers.md: {name} is stale: vrscan numbers --write"
