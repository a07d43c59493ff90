"""The benchmark's page: what is on it is what the cells came to, and it needs nothing else.

The figures are made up here, so every number on the page can be told from where it comes.
"""

import csv
import io
import math
import re
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_command import ended

from vrscan.cli import app as cli
from vrscan.data.boards import SHIPPED
from vrscan.data.config import Config, load
from vrscan.detectors.catalogue import detector, detectors, rivals
from vrscan.engines.tools import repository_root
from vrscan.show.sheet import listed, number
from vrscan.study.bench import bench_page as page
from vrscan.study.bench import bench_report as report
from vrscan.study.bench import cost, design_cost, detect, instrument
from vrscan.study.bench.cells import Cell, Figures, plain
from vrscan.study.bench.sections import choice_section as choice
from vrscan.study.bench.sections import compare_section as compare
from vrscan.study.bench.sections import growth_section as growth
from vrscan.study.bench.sections import instrument_section as whole
from vrscan.study.bench.sections import speckle_section as speckle
from vrscan.study.bench.sections import sweeps_section as sweeps
from vrscan.study.bench.sections.section import Order
from vrscan.study.report.efficiency import LOST_PX, PEAKS, SIGMAS_PX, cell_lines
from vrscan.study.report.spot_lines import Spot, score, take

ORDER = Order(Config(), 1, quick=True)
# Others have own tests.
OWN = (
    choice.SECTION,
    compare.SECTION,
    speckle.SECTION,
    sweeps.SECTION,
    whole.SECTION,
    growth.SECTION,
)
KEYS = [each.key for each in detectors()]
BOUND, SPECKLED = 0.01, 0.03
ZONES = ("near", "middle", "far")


def errors(key: str) -> dict[str, float]:
    """Return what a detector is off by, the same in every cell."""
    size = BOUND * (1.0 + [*KEYS, *(each.key for each in rivals())].index(key))
    lost = 0.02 if key == "parabola" else 0.0
    return {"rms": size, "bias": -0.3 * size, "spread": 0.95 * size, "lost": lost}


def budget_csv() -> str:
    names = ("z_mm", "bias_px", "rms_px", "bias_mm", "rms_mm", "changed")
    heads = [f"{zone}_{name}" for zone in ZONES for name in names]
    rows = [["effect", "state", *heads, "what", "without"]]
    rows.append(["speckle", "on", *["300", "0.03", "0.04", "0.3", "0.4", "0.01"] * 3, "a", "b"])
    rows.append(["sun", "absent", *["300", "", "", "", "", ""] * 3, "a, b", ""])
    rows.append(["left_out", "", *["300", "1", "1", "1", "1", "1"] * 3, "all", ""])
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue()


def made_up(cell: Cell) -> Figures:
    """Return figures of the form that the work of a cell has."""
    if cell.work == detect.WORK:
        keys = cell.parameters.get("detectors", KEYS)
        found = {key: errors(key) for key in keys}
        bounds = {"bound_px": BOUND, "speckled_px": SPECKLED}
        return {**bounds, "lines": cell.parameters["lines"], "errors": found}
    if cell.work == design_cost.WORK:
        return {"lut": 100.0, "ff": 1.0, "ebr": 0.0, "dsp": 1.0}
    if cell.work == cost.WORK:
        rates = {key: 1000.0 * (1 + k) for k, key in enumerate(["reference", *KEYS])}
        return {"rates": rates, "lines": 7}
    if cell.work == instrument.BUDGET:
        rest = ("jumped", "error_px", "median_px", "error_mm", "median_mm", "other_window")
        rest += ("arithmetic_px", "arithmetic_mm", "fit_px", "fit_mm", "one_fit")
        names = ("error_px", "error_mm", "ratio", "within", "astray", "free", "false", "hidden")
        windows = {
            window: {name: 0.01 * (1 + k) * (1 + n) for n, name in enumerate(names)}
            for k, window in enumerate(instrument.WINDOWS)
        }
        return {"csv": budget_csv(), "points": 5, "windows": windows,
                **dict.fromkeys(rest, 0.002)}  # fmt: skip
    if cell.work == instrument.FIDELITY:
        names = ("minimal", "auto 0.1", "auto 0.01", "full")
        numbers = ("worst_px", "rms_um", "truth_rms_px")
        return {
            "rows": [
                {"scene": cell.parameters["scene"], "fidelity": name, "effects": 3, "of": 9}
                | {"lines_per_s": 4000.0 / (1 + k)}
                | dict.fromkeys(numbers, 0.01)
                for k, name in enumerate(names)
            ]
        }
    if cell.work == instrument.SPEED:
        rates = {"reference": 2000.0}
        for k, window in enumerate(instrument.WINDOWS):
            rates |= {f"fixed {window}": 1000.0 / (1 + k), f"ideal {window}": 500.0 / (1 + k)}
        return {"rates": rates, "lines": {"model": 9, "rtl": 0}, "missing": "no RTL"}
    if cell.work == choice.WORK:
        way = {"rms_mm": 0.3, "median_mm": 0.1, "lost": 0.01}
        keys = {*choice.MODULES, *choice.PC}
        return {"lines": 9, "rates": dict.fromkeys(choice.PC, 1234.0),
                "errors": dict.fromkeys(keys, way)}  # fmt: skip
    assert cell.work == instrument.GROWTH
    # Time goes with the square of the length and the root of the number.
    rows = [
        [name, length, count, 1e-9 * length**2 * count**0.5]
        for length, count in cell.parameters["sizes"]
        for name in ("reference", "fixed", "ideal", "simulator")
    ]
    return {"seconds": rows}


class Reader(HTMLParser):
    """Collects ids, links, sources and table rows of a page, and checks that tags close."""

    VOID = ("meta", "img", "br")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.sources: list[str] = []
        self.rows: dict[str, list[str]] = {}
        self._open: list[str] = []
        self._row: list[str] | None = None
        self.feed(text)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag not in self.VOID:
            self._open.append(tag)
        if given.get("id"):
            self.ids.append(str(given["id"]))
        self.links += [str(given["href"])] if "href" in given else []
        self.sources += [str(given["src"])] if "src" in given else []
        if tag == "tr" and given.get("id"):
            self._row = self.rows.setdefault(str(given["id"]), [])
        if tag == "td" and self._row is not None:
            self._row.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag
        if tag == "tr":
            self._row = None

    def handle_data(self, data: str) -> None:
        if self._row:
            self._row[-1] += data


@pytest.fixture(scope="module")
def parts() -> list[page.Part]:
    return [page.Part(s.key, s.title, s.blocks(ORDER, made_up)) for s in OWN]


@pytest.fixture(scope="module")
def text(parts: list[page.Part]) -> str:
    return page.page("Title <&>", "lead", [("Seed", "1 & 2")], parts)


@pytest.fixture(scope="module")
def read(text: str) -> Reader:
    return Reader(text)


def test_the_page_holds_all_it_shows(text: str, read: Reader, parts: list[page.Part]) -> None:
    assert len(set(read.ids)) == len(read.ids) > 200
    assert read.sources and all(s.startswith("data:image/png;base64,") for s in read.sources)
    beside = page.files(parts)
    for link in read.links:
        assert link.removeprefix("#") in (read.ids if link.startswith("#") else beside), link
    assert not re.search(r"https?:|<script|@import|url\(", text)
    assert "Title &lt;&amp;&gt;" in text and "1 &amp; 2" in text
    pictures = [name for name in beside if name.endswith(".png")]
    assert len(pictures) == len(read.sources) >= len(sweeps.SWEEPS) + 3
    assert all(beside[name].startswith(b"\x89PNG") for name in pictures)


def test_each_table_has_its_file_with_a_row_for_each_figure(parts: list[page.Part]) -> None:
    beside = page.files(parts)
    tables = [b for part in parts for b in part.blocks if isinstance(b, page.Table)]
    assert len(tables) >= len(sweeps.SWEEPS) + 6
    for table in tables:
        rows = list(csv.reader(io.StringIO(beside[f"{table.name}.csv"].decode())))
        sheet = table.full or table.sheet
        assert rows[0] == [column.name for column in sheet.columns if column.name]
        assert len(rows) == 1 + len(sheet.rows) > 1
        assert {len(row) for row in rows} == {len(rows[0])}, table.name


def test_the_table_of_detectors_is_what_the_cells_say(read: Reader, parts: list[page.Part]) -> None:
    assert {f"detector-{key}" for key in KEYS} < set(read.rows)
    for key in KEYS:
        found, error = read.rows[f"detector-{key}"], errors(key)
        square = (1.0 - error["lost"]) * error["rms"] ** 2 + error["lost"] * LOST_PX**2
        assert float(found[2]) == pytest.approx(BOUND**2 / square, abs=6e-4)
        assert found[4] == ("2.00 %" if error["lost"] else "0")
        assert float(found[5]) == pytest.approx(1e3 * error["rms"], rel=0.01)
    cells = [s for s in compare.cells(ORDER) if s.work == detect.WORK]
    assert len(cells) == (1 + len(PEAKS)) * len(SIGMAS_PX)
    assert read.rows["map-likelihood-2"][0] == "maximum likelihood, 2 %"
    own = f"{(BOUND / errors('likelihood')['rms']) ** 2:.3f}"
    assert read.rows["map-likelihood-90"][1:] == [own] * len(SIGMAS_PX)
    data = page.files(parts)["detectors.csv"].decode()
    assert len(list(csv.DictReader(io.StringIO(data)))) == len(PEAKS) * len(SIGMAS_PX) * len(KEYS)


def test_costs_are_over_the_reference_and_tell_what_fills_them_in(
    read: Reader, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert read.rows["cost-parabola"][2] == f"{2.0 + KEYS.index('parabola'):.2f}"
    assert read.rows["cost-parabola"][4] == "no RTL"
    (tmp_path / "docs").mkdir()
    page_file = tmp_path / cost.TIMING
    monkeypatch.setattr(cost, "repository_root", lambda: tmp_path)
    assert cost.timing() == {} and cost.cells_of(("peak_fit",)) is None
    modules = ("peak_isolate", "phase_correlate", "peak_position", "peak_refine", "peak_fit")
    rows = [f"| {name} | 130.5 | {100 + k} | 9 | 0 | {0.5 * k} |" for k, name in enumerate(modules)]
    marks = "<!-- timing: begin -->", "| module | Fmax MHz | LUT |", *rows, "<!-- timing: end -->"
    page_file.write_text("\n".join(marks))
    placed = [page.Part("a", "a", compare.SECTION.blocks(ORDER, made_up))]
    found = Reader(page.page("", "", [], placed)).rows
    assert found["cost-one-pass"][4:] == ["303", "1.5"]
    assert found["cost-two-pass"][4:] == ["406", "3"]
    assert found["cost-fit"][4:] == ["510", "5"] and found["cost-fit"][3] == "3283"
    assert int(found["cost-two-pass"][3]) > int(found["cost-one-pass"][3]) > 100
    board = load(Path(SHIPPED.preset))
    assert read.rows["speed-hardware"][1] == f"{math.floor(board.most_lines_hz):,}"


def test_the_choice_has_every_mode_at_the_boards_rate_and_every_detector_at_its_own(
    read: Reader,
) -> None:
    board = load(Path(SHIPPED.preset))
    for name in choice.MODULES:
        title = f"{choice.TITLES[name]}, {SHIPPED.title}"
        row = read.rows[f"choice-{title.replace(' ', '-')}"]
        own = instrument.with_window(board, name)
        assert row[0] == title and row[4] == number(math.floor(own.most_lines_hz))
        assert int(row[5]) == round(choice.latency_us(name, own))
        assert int(row[6].replace(",", "")) == cost.cells_of(choice.MODULES[name])[0]
    for key in choice.PC:
        row = read.rows[f"choice-{detector(key).title.replace(' ', '-')},-PC"]
        assert row[4:] == [number(1234.0), "-", "-"]


def test_the_ways_err_as_the_scans_of_their_modes_do() -> None:
    """The measured work, small: the fit is the best of the board's modes on speckled lines."""
    found = choice.ways({"config": plain(Config()), "lines": 200}, 1)
    errors = found["errors"]
    assert set(errors) == {*choice.MODULES, *choice.PC} and set(found["rates"]) == set(choice.PC)
    assert errors["fit"]["rms_mm"] < min(errors[key]["rms_mm"] for key in ("threshold", "two_pass"))
    assert all(each["lost"] < 0.2 for each in errors.values()) and found["lines"] > 200


def test_budget_takes_the_worst_zone_and_leaves_absent_effects_out(
    read: Reader, parts: list[page.Part]
) -> None:
    assert read.rows["budget-speckle"][1] == "50"  # hypot(0.03, 0.04) px
    assert read.rows["budget-z-speckle"][1] == "500"
    assert "budget-sun" not in read.rows and "budget-left_out" not in read.rows
    assert read.rows["budget-arithmetic"][1] == read.rows["budget-the-fit"][1] == "2"
    assert page.files(parts)["budget-default.csv"].decode() == budget_csv()
    own = 1000.0 / (1 + instrument.WINDOWS.index(ORDER.config.peak.window))
    assert read.rows["speed-fixed"][1:3] == [f"{own:,.0f}", number(own / 2000.0)]
    assert read.rows["speed-rtl"][1:] == ["", "", "", "no RTL"]


def test_each_kind_of_window_has_its_error_its_reliability_and_its_speed(read: Reader) -> None:
    found = read.rows["windows-default-fit"]
    assert found[1:] == ["fit", "0.03", "0.06", "0.09", "12.0 %", "15.00 %", "18.0 %", "21.00 %",
                         "24.00 %"]  # fmt: skip
    assert read.rows["rates-two_pass"][1:] == ["0.02", "2064", "36,848", "500", "250", "-"]
    assert instrument.with_window(ORDER.config, "fit").peak.fit


def test_growth_finds_the_exponent(read: Reader) -> None:
    assert read.rows["growth-fixed-length"][2] == "2.00"
    assert read.rows["growth-fixed-lines"][2] == "0.50"
    assert growth.exponent([1, 2, 4, 8], [3, 6, 12, 24]) == pytest.approx(1.0)
    assert math.isnan(growth.exponent([1], [1.0]))


def test_the_best_of_several_rounds_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    durations = {"a": iter([9.0, 1.0, 3.0, 2.0, 4.0]), "b": iter([9.0, 0.05, 0.25, 0.25] * 9)}
    monkeypatch.setattr(time, "process_time", lambda: now[0])

    def work(name: str) -> None:
        now[0] += next(durations[name])

    found = instrument.best({"a": lambda: work("a"), "b": lambda: work("b")})
    assert found["a"] == pytest.approx(2.0)
    assert found["b"] < 9.0 and next(durations["b"]) > 0.0  # repeated, not once a round


def test_two_things_of_one_name_are_refused() -> None:
    table = page.Table("name", listed(("a",), [["1"], ["2"]]), "", key=lambda _: "same")
    with pytest.raises(ValueError, match="twice: same"):
        page.page("", "", [], [page.Part("p", "P", [table])])
    with pytest.raises(ValueError, match=r"two files name\.csv"):
        page.files([page.Part("p", "P", [table, table])])


# The lines behind the figures.


def test_lines_and_bound_are_those_of_the_efficiency_study() -> None:
    config = Config()
    taken = take(Spot(4.0, 0.2), 400, config, np.random.default_rng(3))
    lines, _, bound = cell_lines(4.0, 0.2, 400, config)
    assert float(taken.bound.mean()) == pytest.approx(float(bound.mean()), rel=1e-3)
    for moment in (np.mean, np.std):
        assert moment(taken.lines) == pytest.approx(moment(lines.lines), rel=0.01)
    assert int(taken.lines.max()) == pytest.approx(int(lines.lines.max()), rel=0.1)


def test_each_ugliness_does_what_it_says() -> None:
    config = Config()

    def mean_line(spot: Spot) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return the mean of what is left and right of the spot, -200 .. 200 px."""
        taken = take(spot, 400, config, np.random.default_rng(4))
        at = np.round(taken.true).astype(int)[:, None] + np.arange(-200, 201)
        return np.take_along_axis(taken.lines, at, axis=1).mean(axis=0)

    plain_line = mean_line(Spot(3.0, 0.3, level=300.0))
    assert plain_line[:100].mean() == pytest.approx(300.0, abs=1.0)
    assert plain_line[200] == pytest.approx(300.0 + 0.3 * 4096, rel=0.02)
    sloped = mean_line(Spot(3.0, 0.3, level=300.0, slope=1.0)) - plain_line
    assert sloped[200 - 40] == pytest.approx(-40.0, abs=3.0)
    assert sloped[200 + 40] == pytest.approx(40.0, abs=3.0)
    assert sloped[200 + 95] == pytest.approx(95.0, abs=4.0) and sloped[400] < 50.0
    rival = mean_line(Spot(3.0, 0.3, level=300.0, rival=0.5, rival_px=30.0)) - plain_line
    assert rival[230] == pytest.approx(0.5 * 0.3 * 4096, rel=0.03)
    skewed = mean_line(Spot(3.0, 0.3, level=300.0, skew=0.3)) - plain_line
    assert skewed[205] > 20.0 and skewed[195] < -20.0
    full = take(Spot(3.0, 5.0), 10, config, np.random.default_rng(4))
    assert (full.lines == 4095).sum(axis=1).min() >= 8
    assert np.isfinite(full.bound).all()


def test_speckle_has_the_contrast_asked_for() -> None:
    config = Config()
    for contrast in (0.05, 0.2):
        spot = Spot(6.0, 0.5, contrast=contrast)
        taken = take(spot, 1500, config, np.random.default_rng(5))
        at = np.round(taken.true).astype(int)
        top = taken.lines[np.arange(len(at)), at].astype(float) - 60.0
        shot = math.sqrt(config.peak.kappa * (top.mean() + 60.0) + 9.0) / top.mean()
        shape = 0.5 * (1.0 / 6.0) ** 2 / 3.0  # of the centre within its pixel
        measured = float(top.std() / top.mean())
        assert measured == pytest.approx(math.hypot(contrast, shot, shape), rel=0.12)


def test_lost_lines_count_apart() -> None:
    true = np.zeros(10)
    found = np.array([0.1, 0.1, 0.1, 0.1, -0.1, -0.1, 7.0, np.nan, 0.1, 0.1])
    result = score(found, true)
    assert result.lost == pytest.approx(0.2)
    assert result.rms == pytest.approx(0.1)
    assert result.bias == pytest.approx(0.05)
    assert result.spread == pytest.approx(math.sqrt(0.01 - 0.0025))
    assert score(np.full(3, np.nan), np.zeros(3)).lost == 1.0


# The command.

BAD = {
    "seed": (["--seed", "-1"], ["--seed", "-1"]),
    "jobs": (["--jobs", "-2"], ["--jobs", "-2"]),
    "config": (["--config", "none.toml"], ["none.toml"]),
    "folder": (["--out", "file"], ["file"]),
    "nested": (["--out", "none/none"], ["none/none"]),
    "option": (["--fast"], ["--fast"]),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words, said = BAD[name]
    (tmp_path / "file").write_text("")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(report, "make", lambda *_, **__: pytest.fail("it began"))
    assert ended(monkeypatch, "bench", "report", "--quick", *words) == cli.EXIT_BAD_INPUT
    output = capsys.readouterr()
    assert output.out == ""
    (line,) = (x for x in output.err.splitlines() if x)
    assert line.startswith("vrscan:") and all(word in line for word in said)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]


def test_an_interrupt_tells_what_is_kept_and_leaves_no_page(tmp_path: Path) -> None:
    out = tmp_path / "page"
    script = (
        "import sys; from vrscan.cli import app; from vrscan.study.bench import bench_report\n"
        "def make(order, folder, *, progress, **_):\n"
        "    import time; progress(3); print('ready', flush=True); time.sleep(60)\n"
        "bench_report.make = make\n"
        f"sys.argv = ['vrscan', 'bench', 'report', '--quick', '--out', {str(out)!r}]\n"
        "app.main()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=repository_root(),
    ) as running:
        assert running.stdout is not None and running.stderr is not None
        assert running.stdout.readline() == "ready\n"
        running.send_signal(signal.SIGINT)
        said = running.stderr.read()
    assert running.returncode == cli.EXIT_INTERRUPTED
    (line,) = (x for x in said.splitlines() if x.startswith("vrscan:"))
    assert "3 of " in line and "kept" in line
    assert "Traceback" not in said
    assert not out.exists()


def test_a_page_is_written_from_cells_and_then_from_what_is_kept(tmp_path: Path) -> None:
    done: list[int] = []
    small = Order(Config(), 3, quick=True)
    one = sweeps.Section("one", "One", lambda o: sweeps.cells(o)[:2], lambda o, f: _shown(o, f))
    for _ in range(2):
        done.clear()
        files = report.make(
            small,
            tmp_path,
            jobs=1,
            progress=done.append,
            sections=[one],
            kept=tmp_path / "kept",
        )
        assert [path.name for path in files] == ["one.csv", "index.html"]
        text = (tmp_path / "index.html").read_text()
        for fact in ("Seed", "3; the shipped scenes", "quick", "defaults"):
            assert fact in text
    assert done == [2]  # nothing was left to do
    assert len(list((tmp_path / "kept").iterdir())) == 2
    rows = list(csv.DictReader((tmp_path / "one.csv").open()))
    assert [float(row["bound"]) for row in rows] == sorted(float(row["bound"]) for row in rows)


def _shown(order: Order, found: Any) -> list[page.Block[Any]]:
    figures = [found(cell) for cell in sweeps.cells(order)[:2]]
    values = [[k, each["bound_px"]] for k, each in enumerate(figures)]
    return [page.Table("one", listed(("k", "bound"), values), "Two.", lambda row: f"row-{row[0]}")]


def test_changed_values_stand_in_the_head() -> None:
    peak = Config().peak.model_copy(update={"k_noise": 3.0})
    assert report.changes(Config().model_copy(update={"peak": peak})) == ["peak.k_noise = 3.0"]
    assert report.changes(Config()) == []
