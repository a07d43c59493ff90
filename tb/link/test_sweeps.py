"""Sweeps of a stream: the same in any blocks, at this machine's times, and columns for them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_records import random_records

from vrscan.data import records
from vrscan.data.config import Config
from vrscan.data.points import table
from vrscan.data.range_image import sweeps
from vrscan.data.table import Table
from vrscan.link.sweeps import DRIFT, JUMP_S, MOST_LINES, HostTime, Sweeps, columns

SEED = 20261126
MADE = table(records.points(random_records(np.random.default_rng(SEED), range(3 * MOST_LINES))))


def scanned(angles: np.ndarray) -> Table:
    return replace(MADE.of(slice(len(angles))), angle_rad=np.asarray(angles, np.float64))


def cut(points: Table, blocks: list[int], count: int) -> list[list[int]]:
    """Return the lines of the sweeps that come out, where the points go in in these blocks."""
    taken, found = Sweeps(count), list[list[int]]()
    edges = np.cumsum([0, *blocks, len(points)]).clip(max=len(points))
    for first, end in pairwise(edges.tolist()):
        found += [each.line.tolist() for each in taken.take(points.of(slice(first, end)))]
    return found


@settings(deadline=None, max_examples=60)
@given(
    # Whole numbers stand still and turn anywhere; some jump as a polygon's beam does.
    steps=st.lists(st.sampled_from([-20, -5, -1, -1, 0, 0, 1, 1, 5, 20]), max_size=60),
    blocks=st.lists(st.integers(0, 9), max_size=20),
    count=st.integers(1, 3),
)
def test_blocks_of_any_size_make_the_same_sweeps(
    steps: list[int], blocks: list[int], count: int
) -> None:
    points = scanned(np.cumsum([0, *steps]))
    number = sweeps(points.angle_rad, exact=True) // count
    whole = [points.line[number == each].tolist() for each in range(number[-1])]
    assert cut(points, blocks, count) == whole


def test_a_mirror_that_stands_gives_all_lines_and_holds_few() -> None:
    still = scanned(np.zeros(3 * MOST_LINES))
    found = cut(still, [1000] * 12, 1)
    assert [line for each in found for line in each] == list(range(sum(map(len, found))))
    assert len(still) - sum(map(len, found)) < MOST_LINES
    assert all(MOST_LINES <= len(each) < MOST_LINES + 1000 for each in found)


def test_the_least_delay_says_how_far_clocks_are_apart() -> None:
    """Points of a board that runs 50 ppm fast come 1 to 21 ms late, and one in 100 in time."""
    rng = np.random.default_rng(SEED)
    true_s = np.cumsum(rng.uniform(1e-3, 3e-3, 20_000))
    board_s = 7.0 + true_s * (1.0 + 50e-6)
    late_s = 1e-3 + np.where(rng.random(len(true_s)) < 0.01, 0.0, rng.uniform(0.0, 20e-3, 20_000))
    host = HostTime()
    found = [host.ahead(b, n) for b, n in zip(board_s, 1e9 + true_s + late_s, strict=True)]
    error_s = board_s + found - (1e9 + true_s)
    print(f"after 1 s {1e3 * error_s[500:].min():.3f} to {1e3 * error_s[500:].max():.3f} ms late")
    # Between two that come in time, some hundred points, the estimate grows by DRIFT and 50 ppm.
    assert error_s[500:].min() >= 0.999e-3
    assert error_s[500:].max() < 1e-3 + 2.0 * (DRIFT + 50e-6)


def test_a_clock_that_is_set_anew_is_followed_at_once() -> None:
    host = HostTime()
    assert host.ahead(5.0, 105.0) == 100.0
    assert host.ahead(6.0, 106.5) == pytest.approx(100.0 + DRIFT)  # late
    assert host.ahead(7.0, 107.0 + 2.0 * JUMP_S) == 100.0 + 2.0 * JUMP_S
    assert host.ahead(8.0, 58.0) == 50.0


@pytest.mark.parametrize("kind", ["resonant", "polygon"])
@pytest.mark.parametrize(("step", "count"), [(1, 1), (9, 1), (4, 12)])
def test_columns_hold_all_angles_and_hardly_a_hole(kind: str, step: int, count: int) -> None:
    config = Config.model_validate({"mirror": {"kind": kind}})
    mirror, found = config.mirror, columns(config, step, count)
    turns = step * mirror.frequency_hz / config.line.rate_hz
    filled = list[float]()
    for begin in np.random.default_rng(SEED).random(50):  # of the way to the first line
        turn = turns * np.arange(begin, count * (1.0 if mirror.polygon else 0.5) / turns)
        if mirror.polygon:
            angle = np.radians(720.0 / mirror.facets) * (turn % 1.0 - 0.5)
            angle = angle[np.abs(angle) < np.radians(mirror.reach_deg)]
        else:  # without the harmonics, which move it by a column at most
            angle = np.radians(mirror.amplitude_deg) * np.cos(2.0 * np.pi * turn)
        assert found.inside(angle).all()
        filled.append(len(set(found.columns(angle).tolist())) / found.count)
    print(f"{found.count} columns of {len(angle)} lines, {np.mean(filled):.1%} filled")
    assert np.mean(filled) > 0.85
    assert found.count > len(angle) / 5
    assert not found.inside(np.radians([-25.0, 25.0])).any()
