"""What a plan leaves out is worth leaving out, measured on every line and not on its survey."""

import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scanners import EACH_SCANNER, SCANNERS
from scipy import stats

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.points import table
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.scene.description import load, parse
from vrscan.scene.effects import EFFECTS, present
from vrscan.scene.light import Light
from vrscan.scene.simulate import BLOCK, Scanner, simulate
from vrscan.scene.speckle import Speckle
from vrscan.study.plan import (
    FLAT_PX,
    JUMP_PX,
    LEAST_LINES,
    PARTS,
    Plan,
    _Trial,
    alike,
    dearest,
    judged,
    plan,
    survey,
)

CONFIG = Config()
COUNT = 400
LONG = 100_000  # lines on which a choice may pay


@functools.cache
def _light(name: str) -> Light:
    return Light(load(name), CONFIG)


@functools.cache
def _plan(name: str, tolerance_px: float) -> Plan:
    return plan(
        _light(name), COUNT, fidelity="auto", tolerance_px=tolerance_px, break_even_lines=LONG
    )


def _points(light: Light, active: frozenset[str], plane_px: float) -> Table:
    scan = simulate(light, COUNT, active, tolerance_px=plane_px)
    return run(Engine.FIXED, scan.lines, judged(CONFIG))


@pytest.mark.parametrize(("name", "tolerance_px"), [("default", 0.03), ("two-surfaces", 0.1)])
def test_what_is_left_out_is_below_the_tolerance_on_all_lines(
    name: str, tolerance_px: float
) -> None:
    chosen, have = _plan(name, tolerance_px), frozenset(present(_light(name).scene))
    whole, less = alike(have, chosen.active)
    full = _points(_light(name), whole, FLAT_PX)
    got = _points(_light(name), less, chosen.plane_px)
    both = full.located & got.located
    moved = (full.position_px - got.position_px)[both]
    own = np.abs(moved) < 1.0  # others are of another peak
    rms = float(np.sqrt(np.mean(np.square(moved[own]))))
    other = int((~own).sum()) + int((full.located != got.located).sum())
    off = sorted(frozenset(present(_light(name).scene)) - chosen.active)
    print(f"{name}: rms {rms:.4f} of {tolerance_px} px, {other} of {COUNT} changed, off {off}")
    assert both.sum() > 0.3 * COUNT
    assert rms <= tolerance_px
    assert other <= 0.01 * COUNT
    assert off


def test_with_grains_what_is_left_out_is_another_draw_of_the_same_error() -> None:
    """The errors against the truth have the same distribution, though single lines differ."""
    light, chosen = _light("default"), _plan("default", 0.01)
    have = frozenset(present(light.scene))
    assert "grain" in chosen.active and have - chosen.active

    def error(active: frozenset[str], plane_px: float) -> Floats:
        scan = simulate(light, 2 * BLOCK, active, tolerance_px=plane_px)
        assert scan.lines.truth is not None
        found = run(Engine.FIXED, scan.lines, judged(CONFIG))
        return np.asarray(found.position_px - scan.lines.truth.position_px)

    def apart_px(less: frozenset[str]) -> tuple[list[Floats], float]:
        both = [error(have - less, FLAT_PX), error(chosen.active - less, chosen.plane_px)]
        moved = np.nan_to_num(both[0] - both[1])
        return both, float(np.sqrt(np.mean(np.square(moved[np.abs(moved) < JUMP_PX]))))

    _, still = apart_px(frozenset({"grain"}))
    points, moved = apart_px(frozenset())
    errors = [each[np.isfinite(each) & (np.abs(each) < JUMP_PX)] for each in points]
    sizes = [np.quantile(np.abs(each), (0.5, 0.7, 0.9)) for each in errors]
    apart = stats.ks_2samp(*errors)
    print(
        f"moved {moved:.4f} px rms, {still:.4f} without; {len(errors[0])} and {len(errors[1])} "
        f"points, errors {sizes[0]} and {sizes[1]} px; distributions {apart.statistic:.4f} apart"
    )
    assert moved > 1.2 * still  # the grains make more of what is left out than it is
    assert abs(len(errors[0]) - len(errors[1])) <= 0.003 * 2 * BLOCK
    assert sizes[1] == pytest.approx(sizes[0], rel=0.03)
    assert apart.statistic < 0.01


def test_a_wider_tolerance_leaves_out_more() -> None:
    narrow, wide = _plan("default", 0.003), _plan("default", 0.03)
    have = frozenset(present(_light("default").scene))
    assert len(narrow.active) > len(wide.active)
    # Each stays within its own, as measured together on the survey.
    for found, limit in ((narrow, 0.003), (wide, 0.03)):
        assert found.left_out.total_px.max() <= limit
        assert found.left_out.changed.max() <= 0.02  # one line of a part
        assert found.active <= have
        assert found.present == present(_light("default").scene)


def test_a_plan_does_not_depend_on_how_long_things_take(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same scene gets the same effects, and so the same lines, on a slow and a busy machine."""
    rng, now = np.random.default_rng(3), [0.0]

    def erratic() -> float:
        now[0] += float(rng.exponential(0.01))
        return now[0]

    wanted = _plan("default", 0.03)
    for clock in ("perf_counter", "thread_time"):
        monkeypatch.setattr(f"time.{clock}", erratic)
    found = plan(
        _light("default"), COUNT, fidelity="auto", tolerance_px=0.03, break_even_lines=LONG
    )
    assert (found.active, found.plane_px) == (wanted.active, wanted.plane_px)
    assert [p.microseconds for p in found.predictions] != [
        p.microseconds for p in wanted.predictions
    ]


def test_effects_that_cost_the_same_are_tried_in_one_order() -> None:
    """A set has its names in another order in each process, and the choice follows the order."""
    wanted = sorted(EFFECTS, key=lambda name: -EFFECTS[name].typical_us)
    assert dearest(frozenset(EFFECTS)) == wanted
    assert dearest(["rays", *wanted[::-2]]) == [name for name in wanted if name in wanted[::-2]]


def test_lines_of_one_place_are_one_observation() -> None:
    """A survey's lines that move far count more where they are all of one edge."""
    light = _light("default")
    seen = survey(light, LONG)
    trial = _Trial(light, LONG, seen, 0.01, frozenset())
    size = np.bincount(seen.part, minlength=len(PARTS)).astype(np.float64)
    near = np.flatnonzero(seen.part == 0)
    moved = near[: len(near) // 10]
    spent = np.zeros((2, len(seen.part)))
    spent[0, moved] = 0.6 * 0.01**2 * size[0] / len(moved)
    apart, together = np.arange(len(spent[0])), np.zeros(len(spent[0]), np.int64)
    assert not trial._exceeds(spent, seen.part, apart, size)
    assert trial._exceeds(spent, seen.part, together, size)
    # A place has 80 lines at most, in one block, one after the other.
    for k in range(seen.place.max() + 1):
        lines = seen.numbers[seen.place == k]
        assert np.ptp(lines) < 80 and np.ptp(lines // BLOCK) == 0


def test_a_table_made_at_first_use_is_no_effects_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tyre far out of focus needs many tables of speckle; each takes a second of this clock."""
    tyre = {"kind": "cylinder", "position_mm": [0, 0, 1200], "radius_mm": 300, "length_mm": 200}
    light = Light(parse({"target": [tyre]}, "tyre", Path()), CONFIG)
    now = [0.0]

    def clock() -> float:
        now[0] += 1e-6
        return now[0]

    make = Speckle._make

    def slow(speckle: Speckle, level: int) -> None:
        now[0] += 1.0
        make(speckle, level)

    monkeypatch.setattr(Speckle, "_make", slow)
    monkeypatch.setattr("time.thread_time", clock)
    found = plan(light, 3000, fidelity="full", each=True)
    cost = {each.name: each.microseconds for each in found.predictions}
    print(
        f"speckle {cost['speckle']:.3f} us, grain {cost['grain']:.3f}, in all {found.microseconds}"
    )
    assert now[0] > 3.0
    assert cost["speckle"] < 1.0 and found.microseconds[1] < 10.0


def test_a_plan_says_what_it_decided() -> None:
    found = _plan("default", 0.03)
    assert found.fidelity == "auto"
    assert found.tolerance_px == 0.03
    assert {p.name for p in found.predictions} | set(found.absent) == set(EFFECTS)
    assert {p.name for p in found.predictions if p.on} == found.active
    assert (np.diff(found.distance_mm) > 0.0).all()
    for prediction in found.predictions:
        assert prediction.difference.bias_px.shape == (len(PARTS),)
        assert prediction.microseconds >= 0.0
        assert np.isfinite(prediction.difference.total_px).all()
    # Speckle rules this instrument, as it rules every real one.
    biggest = max(found.predictions, key=lambda p: float(p.difference.total_px.max()))
    speckle = next(p for p in found.predictions if p.name == "speckle")
    assert speckle.on
    assert speckle.difference.total_px.max() > 0.1
    assert biggest.on


def test_tables_that_all_lines_share_are_not_the_price_of_an_effect(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By a clock that goes on only while the speckle's table is made: by a second, once."""
    make, now = Speckle.__init__, [0.0]

    def slow(speckle: Speckle, *given: Any, **named: Any) -> None:
        now[0] += 1.0
        make(speckle, *given, **named)

    monkeypatch.setattr(Speckle, "__init__", slow)
    for clock in ("perf_counter", "thread_time"):
        monkeypatch.setattr(f"time.{clock}", lambda: now[0])
    found = plan(Light(load("plane"), CONFIG), 200, fidelity="full", each=True)
    assert now == [1.0] and found.seconds == 1.0
    assert {p.name: p.microseconds for p in found.predictions if p.microseconds} == {}
    assert "speckle" in found.active


def test_full_minimal_and_lists_are_what_they_say() -> None:
    light = _light("plane")
    have = frozenset(present(light.scene))
    full = plan(light, 60, fidelity="full")
    assert full.active == have and full.plane_px == FLAT_PX
    assert full.left_out.total_px.max() == 0.0
    minimal = plan(light, 60, fidelity="minimal")
    assert minimal.active == frozenset() and minimal.plane_px == light.scene.tolerance_px
    assert minimal.left_out.total_px.max() > 0.1
    some = plan(light, 60, fidelity=["speckle", "sun"])
    assert some.fidelity == "list"
    assert some.active == {"speckle"}  # the scene has no sun
    assert plan(light, 60, fidelity=[]).active == frozenset()


def test_a_plan_that_cannot_be_made_is_told_in_one_line() -> None:
    light = _light("plane")
    wrong: list[dict[str, Any]] = [
        {"fidelity": ["speckel"]},
        {"fidelity": ["sun", "sun"]},
        {"fidelity": "best"},
        {"tolerance_px": 0.0},
        {"tolerance_px": -1.0},
        {"tolerance_px": float("nan")},
    ]
    for arguments in wrong:
        with pytest.raises(InputError) as caught:
            plan(light, 300, **arguments)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("count", [1, 3, 40])
def test_a_scan_of_few_lines_is_planned_too(count: int) -> None:
    light = Light(
        parse(
            {
                "target": [{"kind": "plane", "position_mm": [0, 0, 400]}],
                "scan": {"sweep": "even", "half_angle_deg": 5.0},
            },
            "few",
            Path(),
        ),
        CONFIG,
    )
    found = plan(light, count, fidelity="auto", tolerance_px=0.1)
    assert found.lines == count
    there = np.isfinite(found.distance_mm)
    assert there.sum() == min(count, 3)
    assert np.isfinite(found.left_out.total_px[there]).all()


def test_a_scene_without_power_has_everything_as_nothing_tells() -> None:
    values: dict[str, object] = {
        "target": [{"kind": "plane", "position_mm": [0, 0, 400]}],
        "laser": {"power_mw": 0},
    }
    found = plan(
        Light(parse(values, "dark", Path()), CONFIG), 100, fidelity="auto", break_even_lines=10**6
    )
    assert found.pointless and set(found.active) == set(found.present)
    assert np.isnan(found.left_out.total_px).all() and (found.left_out.changed == 0.0).all()


def test_a_choice_holds_on_lines_that_the_survey_has_not_seen() -> None:
    """Rms of each third by depth, and points that come or go, on blocks of another seed's scan."""
    tolerance_px, count = 0.01, 40 * BLOCK
    light = Light(load("step").model_copy(update={"seed": 5}), CONFIG)
    seen = survey(light, count)
    found = plan(
        light, count, tolerance_px=tolerance_px, each=False, seen=seen, break_even_lines=LONG
    )
    whole = frozenset(present(light.scene))
    off = whole - found.active
    assert {"ghosts", "bounce", "halo"} <= off
    surveyed = set(np.unique(seen.numbers // BLOCK).tolist())
    blocks = [block for block in (7, 20, 33) if block not in surveyed]
    assert len(blocks) == 3
    apart, depth, differ = [], [], 0
    registers = Registers.from_config(judged(CONFIG))
    for block in blocks:
        points = []
        for active, plane_px in zip(
            alike(whole, found.active), (FLAT_PX, found.plane_px), strict=True
        ):
            frame = Scanner(light, count, active, tolerance_px=plane_px).block(block)
            power = np.full(len(frame.lines), CONFIG.laser.power_max, np.int64)
            angle = angle_turns(frame.reported_rad)
            points.append(table(run_fixed(frame.lines, angle, power, registers)))
        first, second = points
        both = first.located & second.located & np.isfinite(frame.truth.position_px)
        moved = first.position_px - second.position_px
        jumped = both & (np.abs(moved) > JUMP_PX)
        differ += int(((first.located != second.located) | jumped).sum())
        apart.append(moved[both & ~jumped])
        depth.append(frame.truth.z_mm[both & ~jumped])
    order = np.argsort(np.concatenate(depth), kind="stable")
    thirds = np.array_split(np.concatenate(apart)[order], 3)
    rms = [float(np.sqrt(np.mean(np.square(third)))) for third in thirds]
    print(f"rms {rms} of {tolerance_px} px, {differ} of {3 * BLOCK} differ, off {sorted(off)}")
    assert max(rms) <= tolerance_px
    assert differ <= 0.003 * 3 * BLOCK


def test_a_short_scan_has_everything_and_nothing_is_rendered_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    light = _light("plane")
    seen = survey(light, LEAST_LINES - 1)

    def render(*_: object) -> None:
        raise AssertionError("rendered")

    monkeypatch.setattr("vrscan.scene.render.Renderer.render", render)
    found = plan(light, LEAST_LINES - 1, fidelity="auto", each=False, seen=seen)
    assert found.active == frozenset(present(light.scene))
    assert found.plane_px == FLAT_PX
    assert found.count == LEAST_LINES - 1
    with pytest.raises(AssertionError, match="rendered"):
        plan(light, LEAST_LINES, fidelity="auto", each=False, seen=seen)


# The corner is nearer than the metre sees.
@pytest.mark.parametrize(
    ("scene", "config"),
    [("corner", CONFIG), *(pytest.param("plane", each, id=k) for k, each in SCANNERS.items())],
)
def test_the_budget_chooses_as_the_scan_does(scene: str, config: Config) -> None:
    light = Light(load(scene), config)
    alone = plan(light, 20_000, fidelity="auto", tolerance_px=0.03, each=False)
    table = plan(light, 20_000, fidelity="auto", tolerance_px=0.03, each=True)
    assert (alone.active, alone.plane_px) == (table.active, table.plane_px)
    assert alone.active < frozenset(present(light.scene))
    assert alone.left_out.total_px.tolist() == table.left_out.total_px.tolist()
    assert not alone.predictions
    assert [row.name for row in table.predictions] == list(table.present)


@EACH_SCANNER
def test_a_survey_draws_from_each_part_alike(config: Config) -> None:
    seen = survey(Light(load("default"), config), 20_000)
    assert len(np.unique(seen.numbers)) == len(seen.numbers)
    assert (np.diff(seen.rank) >= 0).all()
    sizes = np.bincount(seen.part, minlength=len(PARTS))
    assert (sizes[:3] == 340).all()
    assert (np.bincount(seen.part[: seen.first(16)], minlength=4)[:3] == 16).all()
    assert (np.diff(seen.distance_mm) > 0.0).all()


@pytest.mark.parametrize("count", [2_000, 20_000, LONG])
def test_the_survey_of_an_even_sweep_has_lines_of_all_its_edges(count: int) -> None:
    """A stair's edges move the lines of a few beams' widths each, which the sweep sees once."""
    scene: dict[str, Any] = {
        "target": [{"kind": "plane", "position_mm": [0, 0, 400], "size_mm": [300, 50]}],
        "scan": {"sweep": "even", "half_angle_deg": 5.0},
    }
    seen = survey(Light(parse(scene, "sweep", Path()), CONFIG), count)
    apart = np.diff(np.sort(seen.numbers), prepend=0, append=count - 1)
    print(f"{len(seen.numbers)} of {count} lines, {apart.max()} apart at most")
    assert apart.max() < 0.02 * count


@EACH_SCANNER
def test_lines_are_given_in_any_order(config: Config) -> None:
    scanner = Scanner(Light(load("plane"), config), 3000, frozenset({"speckle"}))
    numbers = np.array([2050, 3, 1500, 2, 1023, 2999])
    order = np.argsort(numbers)
    mixed, rising = scanner.some(numbers), scanner.some(numbers[order])
    np.testing.assert_array_equal(mixed.lines[order], rising.lines)
    np.testing.assert_array_equal(mixed.reported_rad[order], rising.reported_rad)
