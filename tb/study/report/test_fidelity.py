"""The bench of fidelities: its errors against plain arithmetic, its table, page and picture."""

import csv
import io
import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from rich.console import Console

from vrscan.data.arrays import Floats
from vrscan.data.config import Config, Peak
from vrscan.data.errors import InputError
from vrscan.engines.engine import Engine
from vrscan.engines.engine import run as run_engine
from vrscan.ideal import geometry as triangle
from vrscan.scene.description import load
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import Scanner, Simulation, simulate
from vrscan.scene.targets import Hits, World
from vrscan.study.plan import FLAT_PX, JUMP_PX, difference, moved
from vrscan.study.report import fidelity
from vrscan.study.report.fidelity import TOLERANCES_PX, Row

CONFIG = Config()
COUNT = 90
TIMES = {"sun": [], "grain": [8.0, 2.0, 3.0], "falloff": [0.0, 0.0], "ghosts": [20.0]}
BOARD = """
[[target]]
kind = "plane"
name = "board"
position_mm = [0, 0, 400]
rotation_deg = [0, {tilt}, 0]

[scan]
jitter_ns = {jitter}

# Fewer effects take less time.
[lens]
coma_px = 0

[sensor]
prnu = 0
dsnu_e = 0
dark_e_per_s = 0
blooming = 0
"""


@dataclass(frozen=True)
class Bench:
    """Two boards, one of them leaning, that have been through the bench."""

    scenes: tuple[str, ...]  # files
    rows: list[Row]
    told: list[int]  # of the progress


def board(folder: Path, tilt: int, jitter: int = 1) -> str:
    """A file of a board that leans, seen by an instrument whose index jitters."""
    path = folder / f"board-{tilt}-{jitter}.toml"
    path.write_text(BOARD.format(tilt=tilt, jitter=jitter))
    return str(path)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    folder = tmp_path_factory.mktemp("scenes")
    scenes, told = (board(folder, 0), board(folder, 20)), list[int]()
    return Bench(scenes, fidelity.run(scenes, COUNT, CONFIG, told.append, rounds=1), told)


def test_each_scene_has_its_five_fidelities(bench: Bench) -> None:
    rows, told = bench.rows, bench.told
    names = ["minimal", *[f"auto {t:g}" for t in TOLERANCES_PX], "full"]
    assert [row.fidelity for row in rows] == names * 2
    assert [row.scene for row in rows] == [bench.scenes[0]] * 5 + [bench.scenes[1]] * 5
    assert told == [1, 2]
    for row in rows:
        assert row.lines == COUNT
        assert math.isfinite(row.lines_per_s)
        assert row.lines_per_s > 0.0
        assert 0 <= row.effects <= row.of == len(present(load(row.scene)))
        assert (row.planning_s > 0.0) == row.fidelity.startswith("auto")
        assert abs(row.bias_px) <= row.rms_px <= row.worst_px * 1.0001
        assert row.worst_px <= row.max_px <= JUMP_PX
        assert row.p99_px <= row.max_px
        assert 0.0 <= row.differ <= 1.0
        assert 0 < row.points <= COUNT


def test_full_differs_from_itself_in_nothing(bench: Bench) -> None:
    for row in bench.rows:
        if row.fidelity == "full":
            assert (row.rms_px, row.max_px, row.rms_um, row.differ) == (0.0, 0.0, 0.0, 0.0)
            assert row.effects == row.of
            assert row.within is None


def test_minimal_is_far_off(bench: Bench) -> None:
    rows = bench.rows
    for scene in bench.scenes:
        here = {row.fidelity: row for row in rows if row.scene == scene}
        assert here["minimal"].worst_px > 5.0 * here["auto 0.01"].worst_px
        assert here["minimal"].effects == 0


def test_what_is_left_out_is_not_traced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The work behind the speeds, in rays: a line of full takes 30 times those of minimal."""
    cast, rays = World.cast, [0]

    def counted(world: World, origin: Floats, direction: Floats) -> Hits:
        rays[0] += len(origin)
        return cast(world, origin, direction)

    monkeypatch.setattr(World, "cast", counted)
    light = Light(load(board(tmp_path, 20)), CONFIG)
    whole = frozenset(present(light.scene))

    def taken(active: frozenset[str], plane_px: float | None = None) -> int:
        rays[0] = 0
        simulate(light, COUNT, active, tolerance_px=plane_px)
        return rays[0]

    minimal, full = taken(frozenset()), taken(whole, FLAT_PX)
    assert COUNT <= minimal <= 1024  # no more than those of a block
    assert full > 30 * minimal
    # A plane needs no spot to be followed part by part; that is found out once.
    first, again = taken(whole), taken(whole)
    # Seven rays at each of 3,757 angles tell it, of which four look for what a stop's rings meet.
    assert again < first < full
    assert again < full / 4


def test_errors_are_those_of_two_simulations(bench: Bench) -> None:
    """The row of minimal, by hand: same lines, subtracted."""
    light = Light(load(bench.scenes[0]), CONFIG)
    whole = frozenset(present(light.scene))
    full = simulate(light, COUNT, whole, tolerance_px=FLAT_PX)
    bare = simulate(light, COUNT, frozenset())
    one = Config(peak=Peak(window="threshold"))  # as auto chooses
    first = run_engine(Engine.FIXED, full.lines, one)
    second = run_engine(Engine.FIXED, bare.lines, one)
    row = bench.rows[0]
    truth = full.lines.truth
    assert truth is not None
    seen = np.isfinite(truth.position_px)
    both = first.located & second.located & seen
    z_um = 1e3 * (second.z_mm - first.z_mm)[both]
    # The index turns the angle by microradians: a thousandth of what moves the spot.
    px = (second.position_px - first.position_px)[both]
    print(f"rms measured {row.rms_px:.5f} px, by hand {np.sqrt(np.mean(px**2)):.5f} px")
    assert row.rms_px == pytest.approx(np.sqrt(np.mean(px**2)), rel=0.02)
    assert row.rms_um == pytest.approx(np.sqrt(np.mean(z_um**2)))
    assert row.bias_um == pytest.approx(z_um.mean())
    assert row.points == both.sum()
    known = second.located & seen
    error = (second.position_px - truth.position_px)[known]
    assert row.truth_rms_px == pytest.approx(np.sqrt(np.mean(error**2)))
    assert row.truth_median_px == pytest.approx(np.median(np.abs(error)))


def test_a_turned_angle_counts_as_the_pixels_that_move_z_as_far(tmp_path: Path) -> None:
    light = Light(load(board(tmp_path, 20, 300)), CONFIG)
    whole = frozenset(present(light.scene))
    full = run_engine(
        Engine.FIXED, simulate(light, COUNT, whole, tolerance_px=FLAT_PX).lines, CONFIG
    )
    bare = run_engine(
        Engine.FIXED, simulate(light, COUNT, whole - {"index"}, tolerance_px=FLAT_PX).lines, CONFIG
    )
    apart = moved(bare, full, CONFIG)
    rows = np.flatnonzero(full.located & bare.located)
    np.testing.assert_array_equal(bare.position_px[rows], full.position_px[rows])
    assert np.abs(apart[rows]).max() > 0.05
    u, _ = triangle.undistorted(full.position_px[rows] + apart[rows], CONFIG.geometry)
    there = triangle.triangle(u, full.angle_rad[rows], CONFIG.geometry)
    error = there.z - bare.z_mm[rows]
    shift = np.abs(bare.z_mm[rows] - full.z_mm[rows])
    print(f"z moved by up to {shift.max():.3f} mm, left {np.abs(error).max():.2e} mm")
    assert np.abs(error).max() < 0.01 * shift.max()
    # The plan's own figure for the same tables.
    same = difference(bare, full, np.zeros(COUNT, np.int64), light)
    assert same.bias_px[0] == pytest.approx(apart[rows].mean())
    assert same.rms_px[0] == pytest.approx(apart[rows].std())


def row(scene: str, name: str, worst: float, speed: float, tolerance: float = math.nan) -> Row:
    return Row(
        scene=scene,
        fidelity=name,
        tolerance_px=tolerance,
        effects=12,
        of=20,
        lines=COUNT,
        lines_per_s=speed,
        planning_s=0.0,
        points=80,
        bias_px=-0.5 * worst,
        rms_px=0.8 * worst,
        worst_px=worst,
        p99_px=2.0 * worst,
        max_px=3.0 * worst,
        bias_um=-123.4 * worst,
        rms_um=234.5 * worst,
        differ=0.0123 * worst,
        truth_rms_px=0.45,
        truth_median_px=0.21,
    )


@cache
def made_up(scenes: int = 2) -> tuple[Row, ...]:
    rows = []
    for index in range(scenes):
        name = f"scene-{index}"
        rows.append(row(name, "minimal", 1.5, 60_000.0))
        rows.append(row(name, "auto 0.1", 0.09, 50_000.0, 0.1))
        rows.append(row(name, "auto 0.03", 0.031, 40_000.0, 0.03))
        rows.append(row(name, "auto 0.01", 0.01, 30_000.0, 0.01))
        rows.append(row(name, "full", 0.0, 4_000.0 * (index + 1)))
    return tuple(rows)


def test_only_an_auto_beyond_its_tolerance_is_out() -> None:
    assert [each.within for each in made_up(1)] == [None, True, False, True, None]
    assert fidelity.faster(made_up(), "scene-0") == 7.5
    assert fidelity.faster(made_up(), "scene-1") == 3.75


def test_page_has_a_line_for_each_scene() -> None:
    lines = fidelity.markdown(made_up()).splitlines()
    assert len(lines) == 4
    assert len({line.count("|") for line in lines}) == 1
    assert "| scene-0 | 60,000, 1.5 px |" in lines[2]
    assert "**0.031 px**" in lines[2]
    assert lines[2].count("**") == 2
    assert "| 7.5 x |" in lines[2]


def test_table_fits_and_marks_what_is_out(bench: Bench) -> None:
    console = Console(width=120, file=io.StringIO())
    wide = [replace(each, scene="window-ghost") for each in (*made_up(), *bench.rows)]
    console.print(fidelity.table(wide))
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert "…" not in text
    (out,) = {line.split("NO")[0].split()[1] for line in text.splitlines() if " NO " in line}
    assert out == "auto"
    assert sum(" NO " in line for line in text.splitlines()) == 2 + sum(
        each.within is False for each in bench.rows
    )


def test_csv_reads_back() -> None:
    read = list(csv.DictReader(io.StringIO(fidelity.csv_file(made_up()).decode())))
    assert len(read) == len(made_up())
    for found, want in zip(read, made_up(), strict=True):
        assert found["fidelity"] == want.fidelity
        assert float(found["rms_um"]) == pytest.approx(want.rms_um, rel=1e-5)
        assert float(found["lines_per_s"]) == want.lines_per_s
        assert found["within"] == {True: "1", False: "0", None: ""}[want.within]
        assert found["tolerance_px"] == ("" if want.within is None else f"{want.tolerance_px:g}")


@pytest.mark.parametrize("scenes", [1, 5])
def test_picture_shows_every_fidelity(scenes: int) -> None:
    file = io.BytesIO()
    fidelity.picture(made_up(scenes), file)
    file.seek(0)
    image = matplotlib.image.imread(file)
    assert image.shape[1] > 800
    for mark in fidelity._marks().values():
        colour = [int(mark["color"][k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
        near = np.abs(image[..., :3] - colour).max(axis=-1) < 0.02
        assert near.sum() > 20 * scenes


def test_page_and_picture_are_rewritten(tmp_path: Path) -> None:
    assert fidelity.write_pages(made_up(), TIMES, tmp_path) == []
    page = tmp_path / "docs" / "light.md"
    page.parent.mkdir()
    page.write_text("no markers\n")
    assert fidelity.write_pages(made_up(), TIMES, tmp_path) == []
    assert page.read_text() == "no markers\n"
    page.write_text(
        "above\n<!-- costs: begin -->\n<!-- costs: end -->\n"
        "<!-- fidelity: begin -->\nold\n<!-- fidelity: end -->\nbelow\n"
    )
    written = fidelity.write_pages(made_up(), TIMES, tmp_path)
    assert written == [page, page.with_name("fidelity.png")]
    text = page.read_text()
    assert text.startswith("above\n")
    assert text.endswith("below\n")
    assert fidelity.markdown(made_up()) in text
    assert "| grain | 3.0 | 8.0 | 2 |" in text and "sun" not in text and "falloff" not in text
    assert text.index("| ghosts") < text.index("| grain")  # the most expensive first
    assert "old" not in text
    assert written[1].read_bytes().startswith(b"\x89PNG")


def test_an_unknown_scene_is_told_before_any_work() -> None:
    told: list[int] = []
    with pytest.raises(InputError, match="nowhere"):
        fidelity.run(["plane", "nowhere"], COUNT, CONFIG, told.append)
    assert told == []


def test_an_effect_takes_the_time_of_its_best_round(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock of whole rounds: the first, which makes tables, is the slowest."""
    taken, parts = [9.0, 5.0, 2.0, 4.0], Scanner.parts

    def timed(scanner: Scanner, blocks: range) -> list[Simulation]:
        found = parts(scanner, blocks)
        scanner.renderer.seconds |= {"speckle": 1e-3 * taken.pop(0)}
        return found

    monkeypatch.setattr(Scanner, "parts", timed)
    found = fidelity.costs([board(tmp_path, 0)], 40, CONFIG)
    assert found["speckle"] == [pytest.approx(2e-3 / 40 * 1e6)]
    assert found["sun"] == [] and not taken
    assert len(found["grain"]) == 1 and found["grain"][0] > 0.0
