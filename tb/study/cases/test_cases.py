"""The catalogue of hard cases: model against definition, RTL against model, and the page."""

import ast
import math
import re
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.lines import Lines
from vrscan.data.points import Points, points_equal, table
from vrscan.engines import engine as engines
from vrscan.engines.chain_engine import run_rtl
from vrscan.engines.engine import Engine
from vrscan.engines.tools import repository_root
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.study.cases import case_page as page
from vrscan.study.cases import printed
from vrscan.study.cases.case import CHAIN_TEST, UNNOTICED_PX, WINDOWS, Case, LineCase
from vrscan.study.cases.case_shapes import gauss
from vrscan.study.cases.registry import every
from vrscan.study.report.efficiency import as_printed, cell_lines

TB = repository_root() / "tb"
MOST_ROWS = 120


def line_cases() -> list[LineCase]:
    return [case for case in every() if isinstance(case, LineCase)]


def tried(case: Case) -> tuple[str, ...]:
    """Return the windows of an entry that the page shows, and two windows without a fit."""
    return (*case.modes, "two_pass") if case.modes == WINDOWS else case.modes


def named(name: str) -> LineCase:
    return next(case for case in line_cases() if case.name == name)


BUILDS: dict[tuple[int, int], list[LineCase]] = defaultdict(list)
for one in line_cases():
    BUILDS[one.build].append(one)


@pytest.mark.parametrize(
    ("case", "window"),
    [
        pytest.param(case, window, id=f"{case.name}-{window}")
        for case in every()
        for window in tried(case)
    ],
)
def test_model_is_what_is_defined(case: Case, window: str) -> None:
    assert not case.outcome(window).wrong


def rtl_points(case: LineCase, window: str) -> Points:
    """Return the RTL's points."""
    registers = Registers.from_config(case.config(window))
    return run_rtl(case.pixels, angle_turns(case.angle_rad), case.power, registers)


@pytest.mark.parametrize("window", [*WINDOWS, "two_pass"])
@pytest.mark.parametrize(
    "build",
    [
        # Another worker would wait until it is built.
        pytest.param(
            build, marks=pytest.mark.xdist_group(f"chain {build}"), id="{}x{}".format(*build)
        )
        for build in BUILDS
    ],
)
def test_chain_rtl_equals_model(build: tuple[int, int], window: str) -> None:
    for case in (each for each in BUILDS[build] if window in tried(each)):
        difference = points_equal(rtl_points(case, window), case.points(window, neighbours=True))
        assert difference is None, f"{case.name}: {difference}"


def test_every_width_and_length_is_built() -> None:
    assert {length for length, _ in BUILDS} == {64, 1000, 2048, 4096}
    assert {width for _, width in BUILDS} == {8, 10, 12, 16}


def functions(file: Path) -> dict[str, ast.AST]:
    tree = ast.parse(file.read_text())
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    return {node.name: node for node in tree.body if isinstance(node, kinds)}


def is_test(name: str, node: ast.AST) -> bool:
    """Whether pytest or cocotb runs it."""
    if isinstance(node, ast.FunctionDef):
        return name.startswith("test_")
    decorators = [ast.unparse(d) for d in node.decorator_list]
    return any(d.startswith("cocotb.test") for d in decorators)


@pytest.mark.parametrize("case", every(), ids=lambda case: case.name)
def test_the_rtl_test_of_an_entry_is_there(case: Case) -> None:
    assert case.rtl
    simulated = False
    for test in case.rtl:
        file, name = test.split("::")
        found = functions(next(TB.rglob(file)))
        assert name in found and is_test(name, found[name]), test
        # A cocotb test, and a pytest function beside it that builds the RTL; or the chain's RTL.
        cocotb = isinstance(found[name], ast.AsyncFunctionDef)
        simulated |= cocotb and any(n.startswith("test_") for n in found)
        simulated |= test == CHAIN_TEST
    assert simulated, f"no test of {case.name} runs the RTL"


def test_names_are_words_and_nobody_has_them_twice() -> None:
    names = [case.name for case in every()]
    assert len(set(names)) == len(names) <= MOST_ROWS
    assert all(re.fullmatch(r"[a-z0-9.]+(-[a-z0-9.]+)*", name) for name in names)
    assert all(case.breaks and case.defined for case in every())


# An error of the page with its unit; a count of lines has none, and is text.
ERROR = re.compile(r"(?:< |beyond )?-?\d[\d.]*(?:e-?\d+)?(?= (?:px|mm|urad|rad|counts\^2)\b)")
COMPARED = ("error here", "equations as printed, float64")
HEADINGS = [column.title for column in page.sheet([], {}).columns]
ERROR_COLUMNS = {
    len(HEADINGS): {HEADINGS.index(name) for name in COMPARED},
    4: {1, 2},  # of what is off without a warning
}
ZERO = 1e-5  # smaller errors are not printed


def told(row: str) -> tuple[str, list[str]]:
    """Return a line of the page without the errors it tells, and these."""
    cells = re.split(r"(?<!\\)\|", row)[1:-1]
    columns = ERROR_COLUMNS.get(len(cells), set())
    errors = [found for k in sorted(columns) for found in ERROR.findall(cells[k])]
    for k in columns:
        cells[k] = ERROR.sub("#", cells[k])
    return "|".join(cells) if cells else row, errors


def value_and_step(error: str) -> tuple[float, float]:
    """Return a printed error and the step of its last digit."""
    if error.startswith("beyond"):  # rounding only, the sign, too
        return math.inf, ZERO
    value = 0.0 if error.startswith("<") else float(error)
    digits = error.partition(".")[2]
    return value, 10.0 ** -len(digits) if value else ZERO


def stale(text: str, fresh: str) -> list[str]:
    """Return the lines of ``fresh`` that ``text`` does not have.

    An error may differ by a step of its last digit, for floats are not the same on every machine,
    and rows of what is off without a warning may change places. All else is as it stands.
    """
    rows, wanted = ([told(row) for row in each.splitlines()] for each in (text, fresh))
    end = next(k for k, (row, _) in enumerate(wanted) if row == "## Off without a warning")
    for some in (rows, wanted):
        some[end:] = sorted(some[end:])
    found = [] if len(rows) == len(wanted) else [f"{len(wanted)} lines, not {len(rows)}"]
    for (got, errors), (want, limits) in zip(rows, wanted, strict=False):
        apart = got != want or len(errors) != len(limits)
        for pair in zip(errors, limits, strict=False):
            (one, step), (other, other_step) = map(value_and_step, pair)
            apart |= one != other and abs(one - other) > 1.001 * max(step, other_step)
        if apart:
            found.append(f"{want} {limits}, not {got} {errors}")
    return found


PAGE = (repository_root() / page.PAGE).read_text()


def test_page_says_what_the_generator_measures() -> None:
    outcomes = page.measure()
    difference = stale(PAGE, page.page(outcomes, PAGE))
    assert not difference, f"{page.PAGE} is stale: vrscan cases --write\n" + "\n".join(difference)
    for case in every():
        off = case.modes[0] == WINDOWS[0] and bool(outcomes[case.name][0].unnoticed)
        assert off == bool(case.untold), f"{case.name}: only what is off untold has a reason"


def test_a_wave_under_the_spot_is_a_spot_aside() -> None:
    """The place that is told leaves a more even background than the true one, and a wide sigma."""
    case, even = named("periodic-background-strong"), named("noise-a-tenth-of-a-count")
    points, on_even = table(case.points()), table(even.points())
    true = np.array([line.true for line in case.lines], np.float64)
    far = np.flatnonzero(np.abs(points.position_px - true) > 4 * UNNOTICED_PX)
    assert len(far) == 4
    for k in far:
        under = np.abs(np.arange(case.line_length) - true[k]) < 10
        aside, there = (
            np.std((case.pixels[k] - gauss(case.line_length, at, 3.0, 3000.0))[under])
            for at in (points.position_px[k], true[k])
        )
        assert aside < 0.85 * there
    assert points.sigma_px.min() > 6.5 * on_even.sigma_px.max()


@pytest.mark.parametrize(
    ("old", "new", "is_stale"),
    [
        ("| 0.22 px;", "| 0.23 px;", False),
        ("| 0.22 px;", "| 0.24 px;", True),
        ("window: 0.88 px,", "window: 0.89 px,", False),
        ("window: 0.88 px,", "window: 0.90 px,", True),
        ("| 100 px, 0/0 in (8) on 1 of 6 |", "| 99 px, 0/0 in (8) on 1 of 6 |", False),
        ("0/0 in (8) on 1 of 6", "0/0 in (8) on 2 of 6", True),
        (" 0.00012 mm | < 1e-5 mm |", " 0.00012 mm | 0 mm |", False),
        ("| none | 0 px |", "| none | 0.00024 px |", True),
        ("| 0.22 px;", "| no position;", True),
        ("within 0.1 px |", "within 0.2 px |", True),
        ("| TOO_NARROW, SATURATED |", "| TOO_NARROW |", True),
        ("| 2048 x 12 |", "| 2048 x 16 |", True),
        ("| rival-0.9-near | 5.1 px | 5.7 px,", "| rival-0.9-near | 5.3 px | 5.7 px,", True),
        (
            "| hot-pixel-in-the-spot | 0.88 px |",
            "| hot-pixel-beside-the-spot | 0.88 px |",
            True,
        ),
        ("\n## The phase\n", "\n## The phases\n", True),
        ("| line-zero |", "| line-naught |", True),
    ],
)
def test_a_page_that_says_something_else_is_stale(old: str, new: str, is_stale: bool) -> None:
    assert old in PAGE
    assert bool(stale(PAGE.replace(old, new, 1), PAGE)) == is_stale


def test_a_page_with_a_row_less_is_stale() -> None:
    rows = PAGE.splitlines()
    for k in (40, len(rows) - 1):
        assert stale("\n".join(rows[:k] + rows[k + 1 :]), PAGE)


def altered(case: LineCase, **changes: object) -> LineCase:
    """Return the entry with another statement on its first line."""
    return replace(case, lines=(replace(case.lines[0], **changes), *case.lines[1:]))


def test_an_entry_notices_what_is_not_as_defined() -> None:
    """Another flag, window, position or place; other pixels; a point that must not be there."""
    case = named("peak-3-px")
    assert not case.outcome().wrong
    for changes in (
        {"flags": frozenset({"RIVAL"})},
        {"flags": frozenset({"TOO_NARROW"})},
        {"window": (700, 703)},
        {"position": 701.01},
        {"true": 701.5},
        {"pixels": np.roll(case.lines[0].pixels, 1)},
    ):
        assert altered(case, **changes).outcome().wrong, changes
    fitted = named("rival-0.9")
    for changes in ({"flags": frozenset()}, {"true": 600.02}):
        assert altered(fitted, **changes).outcome().wrong, changes
    place = named("rays-parallel")
    assert replace(place, no_range=(0,)).outcome().wrong
    place = named("beta-90")
    assert altered(place, true=1024.1).outcome().wrong
    assert replace(place, out_of_range=(1,)).outcome().wrong


def test_a_fit_that_is_elsewhere_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fit that is neither float64's nor the window's place: 0.015 px of a sigma of 0.03 px."""
    case = named("slope-1-count-per-px-under-3-px")
    points = case.points()
    moved = replace(points, position=points.position + round(0.015 * 2**pkg.POSITION_FRACTION))
    assert not case.outcome().wrong
    monkeypatch.setattr(LineCase, "points", lambda *_: moved)
    assert len([text for text in case.outcome().wrong if "in float64" in text]) == len(case.lines)


def test_an_error_without_a_warning_is_told() -> None:
    outcome = named("rival-0.9-near").outcome("threshold")
    assert len(outcome.unnoticed) == 1 and outcome.unnoticed[0] > 1.0
    assert not named("rival-0.9-near").outcome().unnoticed  # MIXED
    assert not named("rival-0.9").outcome().unnoticed


def test_printed_equations_are_those_of_the_float_engine() -> None:
    """On ordinary lines, where nothing is undefined, one is as good as the other."""
    lines, _, _ = cell_lines(4.0, 0.5, 100, Config())
    want = engines.run(Engine.IDEAL, lines, as_printed(Config()))
    assert want.measured.all()
    got = [printed.place(row).position for row in lines.lines]
    assert np.allclose(np.array(got, float), want.position_px, rtol=0, atol=1e-9)


def test_printed_points_are_those_of_the_triangle() -> None:
    """With a perfect lens and rays that meet, (3) and (4) as printed are the triangle's."""
    case = named("denominator-small")
    recording = Lines(case.pixels, case.angle_rad, case.power)
    want = engines.run(Engine.IDEAL, recording, case.config())
    for k, line in enumerate(case.lines):
        x, z = printed.point(line.true, case.angle_rad[k], case.geometry)
        assert x == pytest.approx(want.x_mm[k], abs=1e-6)
        assert z == pytest.approx(want.z_mm[k], abs=1e-6)


def test_the_command_shows_and_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from typer.testing import CliRunner

    from vrscan.cli.app import app
    from vrscan.engines import tools
    from vrscan.study.cases import registry

    few = {"The line": (named("peak-3-px"), named("peak-2-px"))}
    monkeypatch.setattr(registry, "rooms", lambda: few)
    monkeypatch.setattr(page, "rooms", lambda: few)
    monkeypatch.setattr(tools, "repository_root", lambda: tmp_path)
    (tmp_path / "docs").mkdir()
    shown = CliRunner().invoke(app, ["cases", "--write"])
    assert shown.exit_code == 0, shown.output
    text = (tmp_path / page.PAGE).read_text()
    assert "| peak-3-px |" in text and "peak-2-px" in shown.output
    wrong = altered(named("peak-3-px"), position=701.01)
    few["The line"] = (wrong,)
    failed = CliRunner().invoke(app, ["cases"])
    assert failed.exit_code == 1
