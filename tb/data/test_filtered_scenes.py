"""Every shipped scene before and after each filter: errors no larger, and sigma says how large."""

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness import in_volume

import vrscan
from vrscan.data import filters
from vrscan.data.lines import Truth
from vrscan.data.table import Table
from vrscan.scene.description import load, shipped
from vrscan.study.report.tally import Tally

PAGE = Path(__file__).parents[2] / "docs" / "formats.md"
LINES = 1024
# Light from beneath moves all points of a surface alike: no filter takes that away.
SCENES = [name for name in shipped() if name != "plastic"]
MOVING: dict[str, Callable[[Table], Table]] = {
    "--median 3": lambda points: filters.median(points, 3),
    "--median 5": lambda points: filters.median(points, 5),
    "--median 9": lambda points: filters.median(points, 9),
    "--average 2": lambda points: filters.average(points, 2),
    "--average 4": lambda points: filters.average(points, 4),
    "--average 8": lambda points: filters.average(points, 8),
}
REMOVING: dict[str, Callable[[Table], Table]] = {
    "--min-confidence 0.5": lambda points: filters.min_confidence(points, 0.5),
    "--without MIXED,RIVAL": lambda points: filters.without_flags(points, "MIXED,RIVAL"),
    "--spike 3": lambda points: filters.spike(points, 3.0),
    "--outlier 5": lambda points: filters.outlier(points, 5.0),
}
# The page's commands: the filters that remove points, and the one that moves what is left.
CHAINS = {
    "clean": (("--min-confidence 0.5", "--spike 3"), "--median 5"),
    "still": (("--without MIXED,RIVAL", "--outlier 5"), "--average 4"),
}


def errors(points: Table, truth: Truth) -> tuple[float, float]:
    """Return the rms error in z, mm, and that of error over sigma, as ``vrscan scan`` has them."""
    found = Tally.of(points, truth).errors()[-1]
    return found.rms_mm, found.ratio


def check_moved(name: str, before: tuple[float, float], after: tuple[float, float]) -> None:
    """Check that errors are no larger, and sigma is right where it was right before."""
    (old, told), (new, tells) = before, after
    print(f"{name}: rms {old:.3f} to {new:.3f} mm, error/sigma {told:.2f} to {tells:.2f}")
    assert new <= 1.001 * old
    assert min(0.8, told) - 0.03 <= tells <= max(1.25, told) + 0.03


@pytest.mark.parametrize(
    ("scene", "lines", "seed"),
    [
        *((name, LINES, 20100301) for name in SCENES),
        *(in_volume(name, 3000, 7) for name in SCENES),
    ],
)
def test_no_filter_makes_a_scene_worse(scene: str, lines: int, seed: int) -> None:
    made = vrscan.simulate(load(scene).model_copy(update={"seed": seed}), lines)
    points, truth = vrscan.detect(made), made.truth
    assert truth is not None
    before = errors(points, truth)
    row = [before]
    for name, filtered in MOVING.items():
        row.append(errors(filtered(points), truth))
        check_moved(name, before, row[-1])
    for name, filtered in REMOVING.items():
        left = filtered(points)
        assert np.array_equal(left.z_mm, points.z_mm)
        assert np.array_equal(left.sigma_z_mm, points.sigma_z_mm)
        assert errors(left, truth)[0] <= 1.005 * before[0], name
    for name, (removing, moving) in CHAINS.items():
        left = points
        for each in removing:
            left = REMOVING[each](left)
        kept = errors(left, truth)
        row.append(errors(MOVING[moving](left), truth))
        check_moved(name, kept, row[-1])
        assert row[-1][0] <= 1.001 * before[0]
    text = f"| {scene} | " + " | ".join(f"{rms:.3f}, {ratio:.2f}" for rms, ratio in row) + " |"
    print(text)
    if lines == LINES:
        told = [line for line in PAGE.read_text().splitlines() if line.startswith(f"| {scene} |")]
        numbers = [tuple(map(float, cell.split(","))) for cell in told[0].split("|")[2:-1]]
        for want, got in zip(numbers, row, strict=True):
            near = math.isclose(want[0], got[0], rel_tol=0.02, abs_tol=0.002)
            assert near and abs(want[1] - got[1]) < 0.03, text


def test_the_correlation_of_errors_is_that_of_the_simulator() -> None:
    """Points of a leaning plane, from in focus to far out of it, in and across sweeps."""
    made = vrscan.simulate("plane", 2048)
    points, truth = vrscan.detect(made), made.truth
    assert truth is not None
    flagged = np.any(list(points.flags.values()), axis=0)
    rows = np.flatnonzero(points.located & ~flagged & np.isfinite(truth.z_mm))
    rows = rows[np.argsort(points.angle_rad[rows])]
    error = (points.z_mm - truth.z_mm)[rows] / points.sigma_z_mm[rows]
    place, width = points.position_px[rows], points.width[rows]
    moved, product, square = [], [], []
    for step in range(1, 100):
        apart = np.abs(place[step:] - place[:-step])
        moved.append(apart / (width[step:] * width[:-step]) ** 0.25)
        product.append(error[step:] * error[:-step])
        square.append(0.5 * (error[step:] ** 2 + error[:-step] ** 2))
    at, both, each = (np.concatenate(values) for values in (moved, product, square))
    edges = np.array([0.0, 0.3, 0.8, 1.2, 1.8, 2.4, 3.2, 5.0])
    for low, high in itertools.pairwise(edges.tolist()):
        within = (at >= low) & (at < high)
        found = both[within].sum() / each[within].sum()
        told = float(filters.correlation(at[within]).mean())
        print(f"{low:.1f} to {high:.1f}: {found:.2f}, told {told:.2f}, {within.sum()} pairs")
        assert found == pytest.approx(told, abs=0.17)
