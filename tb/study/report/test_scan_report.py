"""The scan's table and picture: lines in any order, without spots, without points, panned."""

import dataclasses
import io
import warnings
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console

from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import Config
from vrscan.data.lines import Lines, Truth
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.scene.description import load
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate
from vrscan.scene.timeline import Scan, timeline
from vrscan.study.report import scan_report as report
from vrscan.study.report.efficiency import with_window
from vrscan.study.report.reliability_report import ASTRAY_PX
from vrscan.study.report.tally import Errors, Tally

CONFIG = Config()
SEED = 20100301


def chosen(recording: Lines, rows: Ints) -> Lines:
    truth = recording.truth
    assert truth is not None
    columns = {name: getattr(truth, name)[rows] for name in ("x_mm", "z_mm", "position_px")}
    return Lines(
        lines=recording.lines[rows],
        angle_rad=recording.angle_rad[rows],
        power=recording.power[rows],
        truth=Truth(surface=truth.surface[rows], names=truth.names, **columns),
    )


def swept(scene: str, count: int) -> Lines:
    """Lines at even angles, with no more than the sensor's noise."""
    even = load(scene).model_copy(update={"scan": Scan(sweep="even", half_angle_deg=11.0)})
    return simulate(Light(even, CONFIG), count, frozenset({"shot", "read"})).lines


def swinging() -> tuple[Lines, Floats]:
    """Lines of a mirror that swings over the scene and, at the turning points, beyond it."""
    count = 1500
    lines = timeline(0, count, count, CONFIG, Scan(pan_mm_per_s=500.0), SEED)
    even = swept("default", count)
    row = np.searchsorted(even.angle_rad, lines.angle_rad).clip(0, count - 1)
    recording = chosen(even, row)
    beyond = np.abs(lines.angle_rad) > np.abs(even.angle_rad).max()
    angle = np.where(beyond, lines.angle_rad, recording.angle_rad)
    return dataclasses.replace(darkened(recording, beyond), angle_rad=angle), lines.y_mm


def darkened(recording: Lines, rows: npt.NDArray[np.bool_]) -> Lines:
    """The same with lines whose beam meets nothing."""
    truth = recording.truth
    assert truth is not None
    counts = recording.lines.copy()
    counts[rows] = 60 + np.random.default_rng(SEED).integers(0, 8, counts[rows].shape)
    nothing = {
        name: np.where(rows, np.nan, getattr(truth, name))
        for name in ("x_mm", "z_mm", "position_px")
    }
    surface = np.where(rows, -1, truth.surface)
    dark = Truth(surface=surface, names=truth.names, **nothing)
    return dataclasses.replace(recording, lines=counts, truth=dark)


def measured(recording: Lines, config: Config = CONFIG) -> tuple[Table, Truth]:
    assert recording.truth is not None
    return run(Engine.IDEAL, recording, config), recording.truth


def compare(result: Table, truth: Truth) -> list[Errors]:
    return Tally.of(result, truth).errors()


def drawn(
    recording: Lines, result: Table, monkeypatch: pytest.MonkeyPatch, **options: Any
) -> list[Axes]:
    """Return the panels of a picture; it is a PNG, and drawing it warns of nothing."""
    kept: list[Figure] = []
    save = Figure.savefig

    def keep(figure: Figure, *arguments: Any, **settings: Any) -> None:
        kept.append(figure)
        save(figure, *arguments, **settings)

    monkeypatch.setattr(Figure, "savefig", keep)
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        report.picture(recording, result, CONFIG, "A scan", file, **options)
    image = matplotlib.image.imread(io.BytesIO(file.getvalue()))
    assert image.shape[0] > 1000
    assert float(image.std()) > 0.02  # something is drawn
    return kept[0].axes


def labels(axes: Axes) -> list[str]:
    return axes.get_legend_handles_labels()[1]


def points_in(axes: Axes) -> int:
    """How many points of surfaces the panel shows, as its curves hold them."""
    return sum(
        int(np.isfinite(curve.get_ydata()).sum())
        for curve in axes.get_lines()
        if curve.get_marker() in (".", "x", "+", "^")
        and not str(curve.get_label()).startswith(("hidden", "truth"))
    )


def test_the_table_does_not_depend_on_the_order_of_lines() -> None:
    recording, _ = swinging()
    shuffled = chosen(recording, np.random.default_rng(SEED).permutation(len(recording)))
    tables = []
    for lines in (recording, shuffled):
        result, truth = measured(lines, with_window(CONFIG, "threshold"))  # a line stands alone
        tables.append([dataclasses.astuple(row) for row in compare(result, truth)])
    assert [row[:3] for row in tables[0]] == [row[:3] for row in tables[1]]
    for first, second in zip(*tables, strict=True):
        assert np.allclose(first[3:], second[3:], rtol=1e-12)


def test_a_swinging_mirror_is_drawn_with_all_its_points(monkeypatch: pytest.MonkeyPatch) -> None:
    recording, _ = swinging()
    result, truth = measured(recording)
    everything = compare(result, truth)[-1]
    assert 0.3 < everything.lines / len(recording) < 0.5  # the rest is beyond the scene
    profile, error, line = drawn(recording, result, monkeypatch)
    assert profile.get_title(loc="left") == "Profile"
    assert labels(profile)[0] == "truth"
    assert points_in(profile) == points_in(error) == everything.points
    shown = [name.split(",")[0] for name in labels(profile)]
    assert shown[1:4] == ["table", "block", "pin"]
    low, high = error.get_xlim()
    assert low < -20.0 < 20.0 < high  # the lines that meet nothing are part of the scan
    assert "with its window" in line.get_title(loc="left")


def test_a_moving_scanner_gets_a_map(monkeypatch: pytest.MonkeyPatch) -> None:
    recording, y = swinging()
    result, truth = measured(recording)
    axes = drawn(recording, result, monkeypatch, y_mm=y)
    assert axes[0].get_ylabel() == "y in mm"
    points = compare(result, truth)[-1].points
    assert labels(axes[0])[-1] == f"{points} points"
    offsets = np.asarray(axes[0].collections[0].get_offsets())
    assert offsets.shape == (points, 2)
    assert np.ptp(offsets[:, 1]) == pytest.approx(np.ptp(y), rel=0.1)
    still = drawn(recording, result, monkeypatch, y_mm=np.full(len(recording), 3.0))
    assert still[0].get_ylabel() == "z in mm"


@pytest.mark.parametrize("count", [1, 200])
def test_a_scan_that_meets_nothing(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = swept("plane", count)
    recording = darkened(recording, np.ones(count, np.bool_))
    result, truth = measured(recording)
    rows = compare(result, truth)
    assert [(row.lines, row.points) for row in rows] == [(0, 0), (0, 0)]
    console = Console(width=120, file=io.StringIO(), record=True)
    console.print(report.error_table(rows, "nothing"))
    text = console.export_text()
    assert "nan" not in text
    assert text.split().count("-") >= 12
    for y in (None, np.arange(float(count))):
        _, error, line = drawn(recording, result, monkeypatch, y_mm=y)
        assert error.get_title(loc="left") == "No point on a spot"
        assert line.get_title(loc="left").startswith("No line with a point")


def test_a_surface_without_points_is_in_the_table_and_not_in_the_legend(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recording = swept("default", 400)
    truth = recording.truth
    assert truth is not None
    named = dataclasses.replace(truth, names=(*truth.names, "behind"))
    recording = dataclasses.replace(recording, truth=named)
    result, _ = measured(recording)
    row = next(row for row in compare(result, named) if row.name == "behind")
    assert (row.lines, row.points) == (0, 0)
    axes = drawn(recording, result, monkeypatch)
    assert not any(label.startswith("behind") for label in labels(axes[0]))


def test_many_surfaces_can_be_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = swept("plane", 600)
    truth = recording.truth
    assert truth is not None
    names = tuple(f"part {k}" for k in range(10))
    surface = np.where(truth.surface >= 0, np.arange(600) // 60, -1)
    recording = dataclasses.replace(
        recording, truth=dataclasses.replace(truth, surface=surface, names=names)
    )
    result, _ = measured(recording)
    axes = drawn(recording, result, monkeypatch)
    looks = {
        (curve.get_color(), curve.get_marker())
        for curve in axes[0].get_lines()
        if str(curve.get_label()).startswith("part")
    }
    assert len(looks) == 10
    legend = axes[0].get_legend()
    assert legend is not None
    assert len(legend.get_texts()) == 11


def test_points_without_a_spot_are_drawn_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line whose spot the camera cannot see, and that has a point all the same: a ghost's."""
    recording = swept("plane", 300)
    truth = recording.truth
    assert truth is not None
    position = truth.position_px.copy()
    position[100:120] = np.nan
    haunted = dataclasses.replace(truth, position_px=position)
    recording = dataclasses.replace(recording, truth=haunted)
    result, _ = measured(recording)
    assert Tally.of(result, haunted).stray == 20
    axes = drawn(recording, result, monkeypatch)
    assert "without a spot, 20 points" in labels(axes[0])
    assert points_in(axes[0]) == int(result.located.sum()) - 20


def test_a_sigma_that_rounds_to_nothing_leaves_the_ratio_to_the_others() -> None:
    recording = swept("plane", 300)
    result, truth = measured(recording)
    wanted = compare(result, truth)[-1].ratio
    sigma = result.sigma_z_mm.copy()
    sigma[::50] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ratio = compare(dataclasses.replace(result, sigma_z_mm=sigma), truth)[-1].ratio
        none = compare(dataclasses.replace(result, sigma_z_mm=0.0 * sigma), truth)[-1]
    assert ratio == pytest.approx(wanted, rel=0.1)
    assert np.isnan(none.ratio)
    assert none.points == 300


def test_points_on_another_spot_are_counted_and_not_in_the_errors() -> None:
    recording = swept("plane", 300)
    result, truth = measured(recording)
    before = compare(result, truth)[-1]
    assert before.astray == 0
    place = truth.position_px.copy()
    place[50:57] += ASTRAY_PX + 1.0  # as if the spot were there
    moved = dataclasses.replace(truth, position_px=place, z_mm=truth.z_mm + 0.0)
    after = compare(result, moved)[-1]
    assert (after.points, after.astray) == (before.points, 7)
    assert after.rms_mm == pytest.approx(before.rms_mm, rel=0.1)


def test_lines_without_truth_have_no_picture(tmp_path: Path) -> None:
    recording = swept("plane", 3)
    result, _ = measured(recording)
    bare = dataclasses.replace(recording, truth=None)
    with (
        (tmp_path / "picture.png").open("wb") as file,
        pytest.raises(ValueError, match="without truth"),
    ):
        report.picture(bare, result, CONFIG, "none", file)
