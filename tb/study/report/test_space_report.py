"""Space: lines that are called free against the truth of the scenes, and the picture's cells."""

import io
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest
from harness import in_volume

from vrscan.data.config import Config
from vrscan.data.lines import Lines, Truth
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.engines.shadows import shaded
from vrscan.scene.description import load, shipped
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate
from vrscan.study.report import space_report as report
from vrscan.study.report.space_report import BEAM, FREE, OCCUPIED, UNKNOWN, Space

MOST = 0.005  # share of lines that may be falsely free
CONFIG = Config()


def scanned(
    scene: str, count: int, seed: int, power_mw: float | None = None
) -> tuple[Lines, Config]:
    """Return a scene's lines with every effect, with another seed, and the instrument."""
    described = load(scene).model_copy(update={"seed": seed})
    if power_mw is not None:
        laser = described.laser.model_copy(update={"power_mw": power_mw})
        described = described.model_copy(update={"laser": laser})
    lens = {"focus_mm": described.lens.focus_mm, "f_number": described.lens.f_number}
    config = CONFIG.model_copy(update={"free": CONFIG.free.model_copy(update=lens)})
    lines = simulate(Light(described, config), count, frozenset(present(described))).lines
    return lines, config


def space_of(lines: Lines, config: Config, *, shade: bool = True) -> Space:
    assert lines.truth is not None
    points = run(Engine.FIXED, lines, config)
    return Space.of(Table.joined(list(shaded([points], config))) if shade else points, lines.truth)


@pytest.mark.parametrize(
    ("scene", "seed"),
    [
        ("dark", 11),
        ("two-surfaces", 11),
        ("default", 11),
        *(in_volume(scene, seed) for scene in shipped() for seed in (21, 22)),
    ],
)
def test_free_lines_meet_nothing(scene: str, seed: int) -> None:
    """The simulator's ray casting says what each beam meets."""
    lines, config = scanned(scene, 3000, seed)
    space = space_of(lines, config)
    print(f"{scene}: {space}")
    assert space.false <= MOST * len(lines)
    assert space.hidden <= MOST * len(lines)


def test_neighbours_tell_what_is_hidden() -> None:
    lines, config = scanned("two-surfaces", 2000, 5)
    alone = space_of(lines, config, shade=False)
    assert alone.hidden > 10 * MOST * len(lines) and alone.false == 0


def test_black_rubber_shows_what_the_promise_is_for() -> None:
    """A promise that the rubber breaks makes lines falsely free, the shipped one none.

    With a weaker laser: with the shipped one the rubber is seen.
    """
    lines, config = scanned("dark", 3000, 5)
    assert space_of(lines, config, shade=False).false == 0
    lines, config = scanned("dark", 2000, 6, 3.0)
    brave = config.model_copy(update={"free": config.free.model_copy(update={"darkest": 0.3})})
    broken = space_of(lines, brave, shade=False)
    assert broken.false > 2.0 * MOST * broken.free


@pytest.mark.parametrize(("power_mw", "any_free"), [(2.0, False), (10.0, True)])
def test_a_weak_laser_frees_nothing_falsely(power_mw: float, any_free: bool) -> None:
    lines, config = scanned("dark", 2000, 6, power_mw)
    space = space_of(lines, config)
    assert space.false <= MOST * len(lines) and space.hidden <= MOST * len(lines)
    assert (space.free > 0) == any_free


def test_cells_are_free_where_the_interval_covers_them() -> None:
    """Three beams: one free between two z, one with a point, one that says nothing."""
    lines, config = scanned("plane", 3, 1)
    points = run(Engine.FIXED, lines, config)
    points = replace(
        points,
        angle_rad=np.array([-0.15, 0.05, 0.15]),
        located=np.array([False, True, False]),
        z_mm=np.array([0.0, 455.0, 0.0]),
        free_from_mm=np.array([205.0, 0.0, 0.0]),
        free_to_mm=np.array([395.0, 0.0, 0.0]),
    )
    state = report.cells(points, np.linspace(-0.2, 0.2, 5), np.arange(0.0, 601.0, 10.0))
    assert np.array_equal(np.flatnonzero(state[0] == FREE), np.arange(21, 39))
    assert np.array_equal(np.flatnonzero(state[2] == BEAM), np.arange(0, 45))
    assert np.flatnonzero(state[2] == OCCUPIED).tolist() == [45]
    assert (state[[1, 3]] == UNKNOWN).all() and (state[0, :21] == UNKNOWN).all()


@pytest.mark.parametrize("moves", [False, True])
def test_the_picture_of_any_scan(moves: bool) -> None:
    lines, config = scanned("corner", 400, 1)
    truth = lines.truth
    assert truth is not None
    points = run(Engine.FIXED, lines, config)
    nothing = Truth(*(np.full(0, np.nan),) * 3, np.zeros(0, np.int64), ())
    for table, known in ((points, truth), (points.of(np.zeros(400, np.bool_)), nothing)):
        file = io.BytesIO()
        y_mm = np.linspace(0.0, 5.0, len(table)) if moves else None
        report.picture(table, known, "A scan", file, y_mm=y_mm)
        image = matplotlib.image.imread(io.BytesIO(file.getvalue()))
        assert image.shape[0] > 800 and float(image.std()) > 0.02
