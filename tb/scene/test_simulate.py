"""A scan's lines do not depend on who made them, in which order, on how many processes."""

from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config
from vrscan.ideal.geometry import triangle, undistorted
from vrscan.scene.description import Description, load, parse
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import BLOCK, Scanner, Simulation, simulate

CONFIG = Config()
TARGETS: list[dict[str, object]] = [
    {"kind": "plane", "position_mm": [0, 0, 520], "rotation_deg": [0, -12, 0]},
    {"kind": "cylinder", "position_mm": [45, 0, 370], "radius_mm": 20, "material": "shiny"},
    {"kind": "step", "position_mm": [-45, 0, 470], "size_mm": [70, 80]},
]


def _scene(**tables: object) -> Description:
    values = {
        "target": TARGETS,
        "material": {"shiny": {"reflectance": 0.3, "gloss": 0.2}},
        "lamp": [{"illuminance_lux": 800}],
        **tables,
    }
    return parse(values, "scene", Path())


def _everything(scene: Description) -> frozenset[str]:
    return frozenset(present(scene))


def _same(first: Simulation, second: Simulation) -> None:
    assert np.array_equal(first.lines.lines, second.lines.lines)
    assert np.array_equal(first.lines.angle_rad, second.lines.angle_rad)
    for one, other in (
        (first.lines.truth, second.lines.truth),
        (first.timeline, second.timeline),
    ):
        for name, value in vars(one).items():
            if isinstance(value, np.ndarray):
                assert np.array_equal(value, getattr(other, name), equal_nan=True), name


@pytest.mark.parametrize("sweep", ["mirror", "even"])
@pytest.mark.parametrize("tolerance_px", [None, 0.0])
def test_blocks_may_be_made_in_any_order(sweep: str, tolerance_px: float | None) -> None:
    scene = _scene(scan={"sweep": sweep, "pan_mm_per_s": 300.0})
    count = 2 * BLOCK + 100
    active = _everything(scene)
    rising = Scanner(Light(scene, CONFIG), count, active, tolerance_px=tolerance_px)
    falling = Scanner(Light(scene, CONFIG), count, active, tolerance_px=tolerance_px)
    first = [rising.block(k).lines for k in range(3)]
    second = [falling.block(k).lines for k in (2, 0, 1)]
    for k, place in enumerate((1, 2, 0)):
        assert np.array_equal(first[k], second[place])
    assert len(first[2]) == (100 if sweep == "even" else BLOCK)
    assert not np.array_equal(first[0], first[1])


def test_blocks_made_together_are_those_made_alone() -> None:
    scanner = Scanner(Light(_scene(), CONFIG), 3 * BLOCK + 100, _everything(_scene()))
    alone = [scanner.part(k) for k in range(4)]
    blocks = range(1, 4)
    for one, two in zip(alone[1:], scanner.parts(blocks), strict=True):
        _same(one, two)
    whole = np.concatenate([each.lines.lines for each in alone])
    for each in (*scanner.around(range(2), 3, 1), *scanner.around(range(2, 4), 3, 1)):
        first = each.number * BLOCK
        last = first + len(each.simulation.lines)
        _same(each.simulation, alone[each.number])
        for side, lines in (
            (each.before, whole[max(first - 3, 0) : first]),
            (each.behind, whole[last : last + 1]),
        ):
            assert len(lines) == 0 if side is None else np.array_equal(side.lines, lines)
    assert [len(found) for found in scanner.together(1)] == [4]
    assert [len(found) for found in scanner.together(1, 1)] == [3]
    assert scanner.together(2) == [range(k, k + 1) for k in range(4)]  # enough for both processes


def test_any_number_of_processes_gives_the_same_lines() -> None:
    scene = _scene(scan={"pan_mm_per_s": 100.0})
    count = 2 * BLOCK + 30
    told: list[int] = []
    one = simulate(Light(scene, CONFIG), count, _everything(scene), progress=told.append)
    two = simulate(Light(scene, CONFIG), count, _everything(scene), jobs=2)
    _same(one, two)
    assert told == [BLOCK, 2 * BLOCK, count]
    assert len(one.lines) == len(one.timeline) == count
    assert one.lines.lines.dtype == np.uint16


def test_a_line_is_the_same_whichever_others_are_taken() -> None:
    scene = _scene()
    light = Light(scene, CONFIG)
    rng = np.random.default_rng(20100301)
    for active, tolerance_px in ((_everything(scene), 0.0), (frozenset({"shot", "read"}), None)):
        scanner = Scanner(light, 3 * BLOCK, active, tolerance_px=tolerance_px)
        whole = [scanner.block(k) for k in range(3)]
        lines = np.concatenate([frame.lines for frame in whole])
        place = np.concatenate([frame.truth.position_px for frame in whole])
        for count in (1, 7, 200):
            numbers = np.sort(rng.permutation(3 * BLOCK)[:count])
            some = scanner.some(numbers)
            assert np.array_equal(some.lines, lines[numbers])
            assert np.array_equal(some.truth.position_px, place[numbers], equal_nan=True)
            assert np.array_equal(some.timeline.line, numbers)


@EACH_SCANNER
def test_a_longer_scan_of_the_mirror_begins_with_the_same_lines(config: Config) -> None:
    scene = _scene()
    light, active = Light(scene, config), _everything(scene)
    short, long = (simulate(light, n, active) for n in (300, BLOCK + 50))
    assert np.array_equal(short.lines.lines, long.lines.lines[:300])
    assert np.array_equal(short.lines.angle_rad, long.lines.angle_rad[:300])


def test_an_even_sweep_goes_from_end_to_end_whatever_the_number_of_lines() -> None:
    scene = _scene(scan={"sweep": "even", "half_angle_deg": 9.0})
    for count in (2, 501, BLOCK + 1):
        angle = simulate(Light(scene, CONFIG), count, frozenset()).lines.angle_rad
        assert np.allclose(angle, np.radians(np.linspace(-9.0, 9.0, count)))


def test_another_seed_is_other_noise_on_the_same_scene() -> None:
    first, second = (_scene(seed=seed) for seed in (1, 2))
    for names, differ in (({"shot"}, True), ({"speckle"}, True), ({"prnu"}, True), (set(), False)):
        one, other = (simulate(Light(s, CONFIG), 200, frozenset(names)) for s in (first, second))
        assert np.array_equal(one.lines.lines, other.lines.lines) != differ, names
        assert one.lines.truth is not None and other.lines.truth is not None
        assert np.array_equal(
            one.lines.truth.position_px, other.lines.truth.position_px, equal_nan=True
        )


def test_effects_share_their_random_numbers() -> None:
    # What the scene's noise does to a line must be the same with and without another effect.
    scene = _scene()
    light = Light(scene, CONFIG)
    noise, more = (
        simulate(light, 200, frozenset(names)).lines.lines.astype(int)
        for names in (("shot", "read"), ("shot", "read", "window"))
    )
    away = np.abs(more - noise) > 0
    assert away.any()
    assert away.mean() < 0.01


@EACH_SCANNER
def test_truth_is_what_the_triangle_makes_of_it(config: Config) -> None:
    scene = _scene(laser={"power_mw": 1})
    lines = simulate(Light(scene, config), 700, frozenset()).lines
    truth = lines.truth
    assert truth is not None
    seen = np.isfinite(truth.position_px)
    assert 0.3 < seen.mean() < 1.0
    u, _ = undistorted(truth.position_px[seen], config.geometry)
    found = triangle(u, lines.angle_rad[seen], config.geometry)
    assert np.allclose(found.z, truth.z_mm[seen], atol=1e-8)
    assert np.allclose(found.x, truth.x_mm[seen], atol=1e-8)
    assert set(truth.surface[seen].tolist()) == {0, 1, 2}
    assert truth.names == ("plane", "cylinder", "step")
    # And the brightest pixel is there, but for curvature and edges.
    off = np.abs(lines.lines[seen].argmax(axis=1) - truth.position_px[seen])
    assert np.median(off) < 1.0


@EACH_SCANNER
def test_power_goes_with_the_lines(config: Config) -> None:
    for mw, want in ((50.0, 65535), (5.0, 6554), (0.0, 0)):
        lines = simulate(Light(_scene(laser={"power_mw": mw}), config), 20, frozenset()).lines
        assert (lines.power == want).all()
    assert (lines.lines == 60).all()


def test_a_scan_without_lines_is_a_mistake() -> None:
    with pytest.raises(ValueError, match="below 1"):
        simulate(Light(_scene(), CONFIG), 0, frozenset())


def test_the_default_scene_is_pickled_whole_for_other_processes() -> None:
    scene = load("default")
    one, two = (simulate(Light(scene, CONFIG), BLOCK + 5, frozenset(), jobs=j) for j in (1, 2))
    _same(one, two)
