"""Shadows: what a surface hides of a beam, against segments that are intersected one by one."""

from dataclasses import replace

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config
from vrscan.data.lines import Lines
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.engines.shadows import BLOCK, shaded
from vrscan.ideal.geometry import project

pytestmark = EACH_SCANNER


def scale(config: Config) -> float:
    """Return how large a scanner is; lengths below are of one with a base of 60 mm."""
    return config.geometry.base_mm / 60.0


def empty(count: int, config: Config) -> Table:
    """Return points of lines without anything, at angle 0."""
    nothing = np.full((1, config.sensor.line_length), 60, np.uint16)
    one = run(Engine.IDEAL, Lines(nothing, np.zeros(1), np.zeros(1, np.int64)), config)
    return replace(Table.joined([one] * count), line=np.arange(count))


def scanned(
    wall: tuple[float, float, float], count: int, draw: np.random.Generator, config: Config
) -> tuple[Table, np.ndarray]:
    """Return beams at random angles over an upright wall, and where each meets it or NaN.

    Args:
        wall: Its z and its ends in x, mm; the beams beside it are free from 150 to 900 mm.
        count: Number of beams.
        draw: Source of the angles.
        config: The scanner, by whose scale all lengths are larger.
    """
    z, left, right = (scale(config) * each for each in wall)
    angle = np.radians(draw.uniform(-15.0, 8.0, count))
    x = z * np.tan(angle)
    hit = (x >= left) & (x <= right)
    place = np.where(hit, project(x, np.full(count, z), config.geometry), 0.0)
    table = empty(count, config)
    return replace(
        table,
        angle_rad=angle,
        located=hit,
        measured=hit,
        x_mm=np.where(hit, x, 0.0),
        z_mm=np.where(hit, z, 0.0),
        position_px=place,
        free_from_mm=np.where(hit, 0.0, 150.0 * scale(config)),
        free_to_mm=np.where(hit, 0.0, 900.0 * scale(config)),
    ), hit


def hidden(
    x: float, z: float, wall: tuple[float, float, float], margin: float, config: Config
) -> bool:
    """Return whether the wall, longer by a margin at both ends, is before a place."""
    (at, left, right), geometry = wall, config.geometry
    if z <= at:
        return False
    share = (at - geometry.offset_mm) / (z - geometry.offset_mm)
    across = geometry.base_mm + (x - geometry.base_mm) * share
    return left - margin <= across <= right + margin


@pytest.mark.parametrize("wall", [(300.0, -30.0, 10.0), (450.0, -20.0, 60.0), (250.0, 0.0, 15.0)])
def test_what_the_wall_hides_is_taken_off_and_nothing_before_it(
    wall: tuple[float, float, float], config: Config
) -> None:
    table, hit = scanned(wall, 900, np.random.default_rng(3), config)
    (got,) = shaded([table], config)
    mm = scale(config)
    wall = mm * wall[0], mm * wall[1], mm * wall[2]
    # A strip of 16 px and the one beside it, at the wall.
    strip_mm = 32 * config.geometry.pitch_mm / config.geometry.focal_mm * wall[0] * 1.1
    shortened = 0
    for row in np.flatnonzero(~hit):
        start, end, tangent = got.free_from_mm[row], got.free_to_mm[row], np.tan(got.angle_rad[row])
        for z in np.arange(start, end, 2.0 * mm) if end else ():
            assert not hidden(z * tangent, z, wall, -mm, config), (row, z)
        full = np.arange(150.0, 900.0, 2.0) * mm
        dark = [hidden(z * tangent, z, wall, strip_mm, config) for z in full]
        first = full[dark.index(True)] if any(dark) else 900.0 * mm
        # The strip of the first dark place may begin a strip before it.
        near = not end and first < 190.0 * mm
        assert end >= min(0.9 * first - 20.0 * mm, 900.0 * mm) or near, (row, first)
        shortened += end < 900.0 * mm
    assert 30 < shortened < (~hit).sum()
    assert np.array_equal(got.z_mm, table.z_mm) and np.array_equal(got.c_sfm, table.c_sfm)


def test_parts_of_any_size_give_the_same(config: Config) -> None:
    draw = np.random.default_rng(5)
    table, _ = scanned((350.0, -25.0, 5.0), 3 * BLOCK + 100, draw, config)
    whole = Table.joined(list(shaded([table], config)))
    assert np.array_equal(whole.line, table.line)
    for size in (1, 700, BLOCK, 2500):
        parts = [
            table.of((table.line >= first) & (table.line < first + size))
            for first in range(0, len(table), size)[: 40 if size == 1 else None]
        ]
        if size == 1:
            parts.append(table.of(table.line >= 40))
        got = Table.joined(list(shaded(parts, config)))
        assert np.array_equal(got.free_to_mm, whole.free_to_mm), size
        assert np.array_equal(got.line, whole.line)


def test_a_surface_counts_for_its_block_and_those_beside_it(config: Config) -> None:
    """Points in the third of five blocks; free beams in all of them."""
    count = 5 * BLOCK
    table, hit = scanned((300.0, -30.0, 10.0), count, np.random.default_rng(7), config)
    block = table.line // BLOCK
    away = hit & (block != 2)
    table = replace(table, located=table.located & ~away, measured=table.measured & ~away)
    got = Table.joined(list(shaded([table], config)))
    cut = (got.free_to_mm < 900.0 * scale(config)) & ~hit
    assert [bool(cut[block == k].any()) for k in range(5)] == [False, True, True, True, False]


def test_points_with_a_flag_of_the_mirror_hide_nothing(config: Config) -> None:
    table, hit = scanned((300.0, -30.0, 10.0), 500, np.random.default_rng(9), config)
    table = replace(table, flags={**table.flags, "UNSETTLED": hit})
    (got,) = shaded([table], config)
    assert np.array_equal(got.free_to_mm, table.free_to_mm)


def test_no_lines(config: Config) -> None:
    assert list(shaded([], config)) == []
