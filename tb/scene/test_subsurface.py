"""Light from beneath a surface against photons, one by one; its energy, its speckle, its choice."""

import math
from pathlib import Path

import numpy as np
import pytest
from harness import generator

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.engines.engine import Engine, run
from vrscan.ideal.geometry import project
from vrscan.scene.beam import radius_mm
from vrscan.scene.description import Description, load, parse
from vrscan.scene.effects import present
from vrscan.scene.library import at_angles
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer
from vrscan.scene.simulate import simulate
from vrscan.scene.surface import INDEX, beneath
from vrscan.study.plan import plan
from vrscan.study.report.tally import Tally

CONFIG = Config()
SHARE, LENGTH_MM = 0.6, 0.8
WAX: dict[str, object] = {"share": SHARE, "length_mm": LENGTH_MM}


def scene(
    z: float = 300.0, turn: float = 0.0, subsurface: dict[str, object] | None = None, **more: object
) -> Description:
    """Return a plane that leans by ``turn`` about y, in focus, under a beam that no stop cuts."""
    values: dict[str, object] = {
        "laser": {"aperture_mm": math.inf},
        "lens": {"focus_mm": z, "coma_px": 0},
        "stray": {"enabled": []},
        "sensor": {"full_well_e": 1e12},
        "material": {"default": {"subsurface": subsurface} if subsurface else {}},
        "target": [{"kind": "plane", "position_mm": [0, 0, z], "rotation_deg": [0, turn, 0]}],
    }
    return parse(values | more, "scene", Path())


def charge(made: Description, active: set[str], angle: Floats, *, rays: bool = False) -> Floats:
    """Return the mean electrons of the laser, and all light of each line as another column."""
    renderer = Renderer(Light(made, CONFIG), frozenset(active), tolerance_px=0.0 if rays else 1e9)
    found = renderer.charge(at_angles(angle, CONFIG.mirror))
    return np.column_stack([found.laser_e, found.whole_e])


def photons(
    z: float, turn: float, angle: float, spread_mm: float, count: int
) -> tuple[Floats, Floats]:
    """Return where photons from beneath meet the sensor, along and across its row in px.

    Each comes from a place of the beam, is bent at the surface, turns back at a depth, walks on to
    a side, and leaves where its way to the lens is the quickest (Fermat).
    """
    draw, geometry = generator(int(z + turn)), CONFIG.geometry
    lens = np.array([geometry.base_mm, geometry.offset_mm])
    lean = math.radians(turn)
    along = np.array([math.cos(lean), -math.sin(lean)])  # the surface, in x and z
    inward = np.array([math.sin(lean), math.cos(lean)])
    beam = np.array([math.sin(angle), math.cos(angle)])
    hit = beam * z * inward[1] / (beam @ inward)
    sigma = 0.5 * float(radius_mm(np.array([np.hypot(*hit)]), scene(z).laser)[0])
    bent = math.asin((beam @ along) / INDEX)
    way = draw.exponential(LENGTH_MM, count)
    begin = draw.normal(0.0, sigma, count) / (beam @ inward) + way * math.sin(bent)
    deep = way * math.cos(bent)
    # A walk that ends at any time with the same chance spreads as K_0 does.
    steps = spread_mm * np.sqrt(2.0 * draw.exponential(1.0, count))
    begin, side = begin + steps * draw.normal(size=count), steps * draw.normal(size=count)
    side += draw.normal(0.0, sigma, count)
    far, above = (lens - hit) @ along, -(lens - hit) @ inward
    low, high = np.minimum(begin, far), np.maximum(begin, far)
    for _ in range(60):
        left, right = (2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0
        first, last = (
            INDEX * np.hypot(u - begin, deep) + np.hypot(u - far, above) for u in (left, right)
        )
        low, high = np.where(first < last, low, left), np.where(first < last, right, high)
    place = hit + low[:, None] * along
    depth = (lens[0] - place[:, 0]) * math.cos(geometry.bias_rad)
    depth += (place[:, 1] - lens[1]) * math.sin(geometry.bias_rad)
    high_px = side * geometry.focal_mm / geometry.pitch_mm / depth
    return project(place[:, 0], place[:, 1], geometry), high_px


@pytest.mark.parametrize(
    ("z", "turn", "angle", "spread_mm"),
    [(300, 0, 0, 1.6), (300, 40, 0, 0.1), (300, 15, 0, 0.1), (280, -35, 0.1, 0.8)],
)
def test_the_row_gets_what_photons_bring(
    z: float, turn: float, angle: float, spread_mm: float
) -> None:
    """Profile, mean, second moment and amount of light from beneath, on one row."""
    along, across = photons(z, turn, angle, spread_mm, 300_000)
    at = np.array([angle])
    plain = charge(scene(z, turn), set(), at)[0]
    both = charge(scene(z, turn, {**WAX, "spread_mm": spread_mm}), {"subsurface"}, at)[0]
    below = ((both - (1.0 - SHARE) * plain) / SHARE)[:-1]
    spot = float(plain[:-1].argmax())
    near = slice(int(spot) - 60, int(spot) + 61)
    pixel, got = np.arange(len(below))[near] - spot, below[near] / plain[-1]
    row = along[np.abs(across) < 0.5] - spot
    row = row[np.abs(row) < 60.5]
    mean = (got @ pixel) / got.sum()
    width = math.sqrt((got @ np.square(pixel - mean)) / got.sum())
    known = np.histogram(row, np.append(pixel - 0.5, 60.5))[0].cumsum() / len(row)
    apart = float(np.abs(known - got.cumsum() / got.sum()).max())
    unsure = 3.0 / math.sqrt(len(row))
    print(
        f"of {along.size} photons on the row {len(row)}, {got.sum() * along.size:.0f} wanted; mean "
        f"{mean:.3f} and {row.mean():.3f} px, width {width:.3f} and {row.std():.3f} px, "
        f"distributions {apart:.4f} apart, {unsure / 2:.4f} by chance"
    )
    assert got.sum() * along.size == pytest.approx(len(row), rel=0.02 + unsure)
    assert mean == pytest.approx(row.mean(), abs=unsure * width + 0.05)
    assert width == pytest.approx(row.std(), rel=0.02 + unsure)
    assert apart < 0.01 + unsure / 2


@pytest.mark.parametrize("rays", [False, True])
def test_light_is_neither_lost_nor_made(rays: bool) -> None:
    """And that of the gloss leaves where it entered: the same matt light moves beside it."""
    angle = np.radians(np.linspace(-5.0, 5.0, 20))
    gloss = {"default": {"gloss": 0.3, "lobe_deg": 20.0, "subsurface": WAX}}
    moved = []
    for made in (scene(300.0, 20.0, WAX), scene(300.0, 20.0, material=gloss)):
        active = {"gloss", "footprint"} if rays else {"gloss"}
        plain = charge(made, active, angle, rays=rays)
        both = charge(made, {"subsurface", *active}, angle, rays=rays)
        np.testing.assert_allclose(both[:, -1], plain[:, -1], rtol=1e-12)
        moved.append(both[:, :-1] - plain[:, :-1])
    # On the row there is less, as it spreads across it, too.
    assert (moved[0].sum(axis=1) < -0.1 * plain[:, :-1].sum(axis=1)).all()
    assert np.abs(moved[1] - moved[0]).max() < 1e-3 * np.abs(moved[0]).max()


def test_rays_bring_what_the_tangent_plane_has() -> None:
    angle = np.radians(np.linspace(-5.0, 5.0, 20))
    made = scene(300.0, 30.0, {**WAX, "spread_mm": 0.05})
    flat, rays = (
        charge(made, {"subsurface", "footprint"}, angle, rays=rays) for rays in (False, True)
    )
    assert np.abs(flat - rays).max() < 0.01 * flat[:, :-1].max()


def test_at_an_edge_each_side_has_its_own() -> None:
    """A plate of wax before a matt wall: the wall's part of the spot keeps its shape."""
    wall = {"kind": "plane", "position_mm": [0, 0, 300.0]}
    plate = {
        "kind": "box",
        "position_mm": [-20.0, 0, 295.0],
        "size_mm": [40, 40, 10],
        "material": "wax",
    }
    made = [
        scene(target=[wall, plate], material={"wax": {"subsurface": kind} if kind else {}})
        for kind in (WAX, None)
    ]
    angle = np.array([0.0])
    both, plain = (charge(one, {"subsurface", "footprint"}, angle, rays=True)[0] for one in made)
    assert both[-1] == pytest.approx(plain[-1], rel=1e-12)
    moved = 1.0 - both[:-1] / np.maximum(plain[:-1], 1e-9)
    lit = plain[:-1] > 0.3 * plain[:-1].max()
    assert moved[lit].max() > 0.3 and moved[lit].min() < 0.12


def test_its_speckle_is_another_one_with_its_own_looks() -> None:
    """So short a length leaves the profile as it is: the gains alone differ."""
    kind = {"share": 0.9, "length_mm": 1e-4, "looks": 5.0}
    angle = np.radians(np.linspace(-8.0, 8.0, 1500))
    found = []
    for more in (set[str](), {"subsurface"}):
        made = scene(300.0, 0.0, kind)
        smooth = charge(made, more, angle)[:, :-1]
        rough = charge(made, {"speckle", *more}, angle)[:, :-1]
        bright = smooth > 0.3 * smooth.max()
        found.append((rough[bright] / smooth[bright]).std() ** 2)
    surface, with_beneath = found
    want = 0.1**2 + 0.9**2 * 2.0 / 5.0  # over the surface's with two polarisations
    print(f"squared contrast {with_beneath / surface:.3f} of the surface's, wanted {want:.3f}")
    assert with_beneath / surface == pytest.approx(want, rel=0.08)


def transported(incident: float, view: float, albedo: float, count: int) -> Floats:
    """Return mean and quarters of where light leaves a scattering medium, and its mean way.

    Lengths are in mean free paths.

    Scattering is isotropic; at every turn a photon sends its share out towards the lens. Angles
    are of beam and view from the normal, to the same side where both are positive.
    """
    draw = generator(count)
    sine_in, sine_out = math.sin(incident) / INDEX, math.sin(view) / INDEX
    slope, cosine = sine_out / math.sqrt(1 - sine_out**2), math.sqrt(1 - sine_out**2)
    heading = np.tile([sine_in, math.sqrt(1 - sine_in**2)], (count, 1))
    place, weight, way = np.zeros((count, 2)), np.ones(count), np.zeros(count)
    where, light, ways = [], [], []
    for _ in range(250):
        step = draw.exponential(1.0, len(place))
        place, way = place + step[:, None] * heading, way + step
        out = place[:, 1] < 0.0
        inner = np.abs(heading[:, 1])
        outer = np.sqrt(np.maximum(1.0 - INDEX**2 * (1.0 - inner**2), 0.0))
        reflected = 0.5 * np.square((INDEX * inner - outer) / (INDEX * inner + outer))
        reflected += 0.5 * np.square((INDEX * outer - inner) / (INDEX * outer + inner))
        weight = albedo * np.where(out, weight * reflected, weight)
        place[:, 1] = np.abs(place[:, 1])
        where.append(place[:, 0] + slope * place[:, 1])
        light.append(weight * np.exp(-place[:, 1] / cosine))
        ways.append(way + place[:, 1] / cosine)
        up = draw.uniform(-1.0, 1.0, len(place))
        aside = np.sqrt(1.0 - up**2) * np.cos(draw.uniform(0.0, 2.0 * np.pi, len(place)))
        left = (weight > 1e-3) & (place[:, 1] < 20.0)
        heading = np.column_stack([aside, up])[left]
        place, weight, way = place[left], weight[left], way[left]
    x, amount = np.concatenate(where), np.concatenate(light)
    order = np.argsort(x)
    quarters = np.interp([0.25, 0.75], np.cumsum(amount[order]) / amount.sum(), x[order])
    mean_way = np.concatenate(ways) @ amount / amount.sum()
    return np.array([x @ amount / amount.sum(), *quarters, mean_way])


@pytest.mark.parametrize(("incident", "view"), [(0.0, 0.6), (0.5, 0.7)])
def test_one_length_stands_for_a_medium_that_scatters(incident: float, view: float) -> None:
    """The inverse of the reduced scattering coefficient as ``length_mm``: mean and spread.

    The albedo is that of a medium that reflects half of the light.
    """
    mean, low, high, way = transported(incident, view, 0.98, 15_000)
    beam = np.array([[math.sin(incident), 0.0, math.cos(incident)]])
    to_lens = np.array([[math.sin(view), 0.0, -math.cos(view)]])
    want = float(beneath(beam, np.array([[0.0, 0.0, -1.0]]), to_lens)[0, 0])
    half = 2.0 * math.log(2.0)  # of the exponential to both sides, whose scale is two lengths
    quarter = 0.5 * (high - low)
    print(
        f"mean {mean:.2f} and {want:.2f}, quarters {quarter:.2f} and {half:.2f} off, way {way:.1f}"
    )
    assert mean == pytest.approx(want, rel=0.35)
    assert quarter == pytest.approx(half, rel=0.35)
    assert way == pytest.approx(16.0, rel=0.15)  # which the page's number of looks is for


@pytest.mark.parametrize(
    ("kind", "wanted"),
    [
        ({"share": 0.95, "length_mm": 1}, "material.default.subsurface.share = 0.95"),
        ({"share": 0, "length_mm": 1}, "material.default.subsurface.share = 0"),
        ({"share": 0.5, "length_mm": 0}, "material.default.subsurface.length_mm = 0"),
        ({"share": 0.5, "length_mm": 1, "spread_mm": -1}, "subsurface.spread_mm = -1"),
        ({"share": 0.5}, "material.default.subsurface.length_mm"),
        ({"share": 0.5, "length": 1}, "mean 'length_mm'?"),
    ],
)
def test_a_wrong_value_is_told_in_one_line(kind: dict[str, object], wanted: str) -> None:
    with pytest.raises(InputError) as caught:
        scene(subsurface=kind)
    assert wanted in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("share", "length_mm", "stays"), [(0.5, 0.5, True), (0.02, 0.05, False)])
def test_auto_keeps_it_where_it_moves_points(share: float, length_mm: float, stays: bool) -> None:
    made = scene(300.0, 10.0, {"share": share, "length_mm": length_mm})
    assert "subsurface" in present(made) and "subsurface" not in present(scene())
    found = plan(Light(made, CONFIG), 200_000, fidelity="auto", tolerance_px=0.02, each=False)
    assert ("subsurface" in found.active) == stays


def test_points_of_the_shipped_scene_lie_too_deep() -> None:
    """One window's points, and their mean in the scan's table; the matt plate's do not."""
    config = Config.model_validate({"peak": {"window": "threshold"}})
    have = frozenset(present(load("plastic")))
    found = {}
    for active in (have, have - {"subsurface"}):
        lines = simulate(Light(load("plastic"), config), 1500, active).lines
        assert lines.truth is not None
        errors = Tally.of(run(Engine.FIXED, lines, config), lines.truth).errors()
        found[len(active)] = {each.name: each.mean_mm for each in errors}
        print(found)
    with_it, without = found[len(have)], found[len(have) - 1]
    assert max(abs(mean) for mean in (with_it["plate"], *without.values())) < 0.02
    assert 0.1 < with_it["nylon"] < 0.25 and 0.08 < with_it["wax"] < 0.25
