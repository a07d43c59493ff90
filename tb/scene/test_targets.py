"""Targets against closed forms and dense sampling: where rays meet them, and what hides what."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pydantic import TypeAdapter, ValidationError
from scipy.optimize import brentq

from vrscan.data.arrays import Floats
from vrscan.data.errors import InputError
from vrscan.scene import shapes
from vrscan.scene import targets as t
from vrscan.scene.reflectance import Checker, ImageMap, Stripes, load_map

SEED = 20100301
HERE = Path()
SECTION = TypeAdapter(t.TargetSection)


def rays(n: int, spread: float, far: float = 500.0, seed: int = SEED) -> tuple[Floats, Floats]:
    """Return rays from all around towards points near (0, 0, 0)."""
    rng = np.random.default_rng(seed)
    origin = rng.normal(size=(n, 3))
    origin *= far / np.linalg.norm(origin, axis=1)[:, None]
    direction = rng.uniform(-spread, spread, (n, 3)) - origin
    return origin, direction / np.linalg.norm(direction, axis=1)[:, None]


def at_origin(target: t.TargetSection) -> t.World:
    return t.World([target.model_copy(update={"position_mm": (0.0, 0.0, 0.0)})], HERE)


def world(*targets: t.TargetSection) -> t.World:
    return t.World(targets, HERE)


def check_facing(hits: t.Hits, direction: Floats) -> None:
    assert np.allclose(np.linalg.norm(hits.normal, axis=1), 1.0, atol=1e-12)
    assert ((hits.normal * direction).sum(axis=1) <= 1e-12).all()


def test_sphere_is_met_where_the_quadratic_says() -> None:
    origin, direction = rays(2000, 40.0)
    hits = at_origin(t.Sphere(radius_mm=30)).cast(origin, direction)
    # Independent: distance of the line from the centre, by the cross product.
    offset = np.linalg.norm(np.cross(origin, direction), axis=1)
    hit = hits.target == 0
    assert 200 < hit.sum() < 1800
    assert np.array_equal(hit, offset <= 30.0)
    point = origin + np.where(hit, hits.distance_mm, 0.0)[:, None] * direction
    assert np.abs(np.linalg.norm(point[hit], axis=1) - 30.0).max() < 1e-9
    assert np.allclose(hits.normal[hit], point[hit] / 30.0, atol=1e-9)
    chord = 2.0 * np.sqrt(900.0 - offset[hit] ** 2)
    leave = at_origin(t.Sphere(radius_mm=30)).cast(point[hit], direction[hit])
    assert np.allclose(leave.distance_mm, chord, atol=1e-6)
    check_facing(hits, direction)
    assert np.isinf(hits.distance_mm[~hit]).all()
    assert (hits.albedo == 1.0).all()


@pytest.mark.parametrize("degrees", [(0, 0, 0), (20, -35, 70), (0, 180, 0), (90, 0, 0)])
def test_plane_in_any_pose(degrees: tuple[float, float, float]) -> None:
    origin, direction = rays(1000, 50.0)
    plane = t.Plane(rotation_deg=degrees, size_mm=(80, 40))
    hits = at_origin(plane).cast(origin, direction)
    # Independent: turn axis by axis with complex numbers instead of matrices.
    axes = np.eye(3)
    for axis, angle in enumerate(degrees):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turned = (axes[:, i] + 1j * axes[:, j]) * np.exp(1j * np.radians(angle))
        axes[:, i], axes[:, j] = turned.real, turned.imag
    distance = -(origin @ axes[2]) / (direction @ axes[2])
    point = origin + distance[:, None] * direction
    inside = (np.abs(point @ axes[0]) <= 40.0) & (np.abs(point @ axes[1]) <= 20.0)
    hit = inside & (distance > 0.0)
    assert np.array_equal(hits.target == 0, hit)
    assert 50 < hit.sum() < 950
    assert np.allclose(hits.distance_mm[hit], distance[hit], atol=1e-9)
    assert np.allclose(np.abs(hits.normal[hit] @ axes[2]), 1.0)
    check_facing(hits, direction)
    endless = at_origin(plane.model_copy(update={"size_mm": None})).cast(origin, direction)
    ahead = distance > 0.0
    assert np.allclose(endless.distance_mm[ahead], distance[ahead])
    assert np.isinf(endless.distance_mm[~ahead]).all()


def test_step_shows_both_levels_and_its_riser() -> None:
    step = world(t.Step(size_mm=(100, 60), height_mm=30, position_mm=(0, 0, 500)))
    origin = np.array([[25.0, 0, 0], [-25, 0, 0], [80, 0, 485], [-80, 0, 485], [-20, 50, 480]])
    direction = np.array([[0.0, 0, 1], [0, 0, 1], [-1, 0, 0], [1, 0, 0], [0, -1, 0]])
    hits = step.cast(origin, direction)
    assert np.allclose(hits.distance_mm, [500.0, 470.0, 80.0, 30.0, 20.0])
    assert np.allclose(hits.normal, -direction)
    assert np.allclose(step.bounds, [[-50, -30, 470], [50, 30, 500]])
    # From the low level, at the riser's foot, a lens beyond the block is hidden.
    start = np.array([[2.0, 0, 500], [45.0, 0, 500]])
    assert step.blocked(start, np.tile([-60.0, 0, 0], (2, 1))).tolist() == [True, False]


def test_the_seam_of_two_faces_lets_no_ray_through() -> None:
    corner = world(t.Corner(angle_deg=70, size_mm=(100, 100), position_mm=(3.3, 0, 456.7)))
    rng = np.random.default_rng(SEED)
    goal = np.stack([np.full(4000, 3.3), rng.uniform(-49, 49, 4000), np.full(4000, 456.7)], 1)
    origin = rng.uniform(-9.0, 9.0, (4000, 3))
    gap = goal - origin
    direction = gap / np.linalg.norm(gap, axis=1)[:, None]
    hits = corner.cast(origin, direction)
    assert np.allclose(hits.distance_mm, np.linalg.norm(gap, axis=1), atol=1e-7)


def test_corner_has_its_angle_and_sends_light_to_itself() -> None:
    for angle in (40.0, 90.0, 150.0):
        corner = at_origin(t.Corner(angle_deg=angle))
        x = np.array([-5.0, 5.0])
        origin = np.stack([x, np.zeros(2), np.full(2, -300.0)], axis=1)
        hits = corner.cast(origin, np.tile([0.0, 0.0, 1.0], (2, 1)))
        point_z = -300.0 + hits.distance_mm
        assert np.allclose(point_z, -5.0 / np.tan(np.radians(angle / 2)))
        between = np.degrees(np.arccos(-(hits.normal[0] @ hits.normal[1])))
        assert between == pytest.approx(angle)
    # A ray along one normal of a right corner meets the other plate at 45 degrees.
    corner = at_origin(t.Corner(angle_deg=90))
    start = np.array([[-20.0, 0.0, -20.0]])
    second = corner.cast(start, np.array([[1.0, 0.0, 0.0]]))
    assert second.distance_mm == pytest.approx([40.0])
    assert abs(second.normal[0, 0]) == pytest.approx(np.sqrt(0.5))


def test_box_agrees_with_six_plates() -> None:
    origin, direction = rays(3000, 60.0)
    size, degrees = (60.0, 40.0, 90.0), (10.0, 20.0, 30.0)
    hits = at_origin(t.Box(size_mm=size, rotation_deg=degrees)).cast(origin, direction)
    plates = []
    for axis in range(3):
        u, v = (np.eye(3)[(axis + k) % 3] * 0.5 * size[(axis + k) % 3] for k in (1, 2))
        plates += [(s * 0.5 * size[axis] * np.eye(3)[axis], u, v) for s in (-1.0, 1.0)]
    centre, along, across = (np.array(part) for part in zip(*plates, strict=True))
    turn = t.rotation(degrees)
    distance, normal = shapes.Patches(centre, along, across).meet(origin @ turn, direction @ turn)
    hit = np.isfinite(distance)
    assert np.array_equal(hits.target == 0, hit)
    assert 300 < hit.sum() < 2700
    assert np.allclose(hits.distance_mm[hit], distance[hit])
    cosine = ((normal @ turn.T) * hits.normal).sum(axis=1)[hit]
    assert np.abs(np.abs(cosine) - 1.0).max() < 1e-12


@pytest.mark.parametrize("length", [None, 50.0])
def test_cylinder_and_its_ends(length: float | None) -> None:
    origin, direction = rays(3000, 45.0)
    hits = at_origin(t.Cylinder(radius_mm=20, length_mm=length)).cast(origin, direction)
    hit = hits.target == 0
    point = origin[hit] + hits.distance_mm[hit, None] * direction[hit]
    radius = np.hypot(point[:, 0], point[:, 2])
    half = np.inf if length is None else length / 2
    on_side = np.abs(radius - 20.0) < 1e-9
    on_end = np.abs(np.abs(point[:, 1]) - half) < 1e-9
    assert (on_side | on_end).all()
    assert on_end.any() == (length is not None)
    assert (np.abs(point[:, 1]) <= half + 1e-9).all() and (radius <= 20.0 + 1e-9).all()
    assert np.allclose(np.abs(hits.normal[hit][on_end & ~on_side, 1]), 1.0)
    outwards = np.stack([point[:, 0], 0 * radius, point[:, 2]], axis=1)[on_side] / 20.0
    # A ray that starts within the endless cylinder sees its inside.
    outwards *= -np.sign((outwards * direction[hit][on_side]).sum(axis=1))[:, None]
    assert np.abs(hits.normal[hit][on_side] - outwards).max() < 1e-9
    # Nothing is nearer and nothing is missed: march along each ray.
    s = np.linspace(400.0, 600.0, 2001)
    march = origin[:, None] + s[:, None] * direction[:, None]
    inside = (np.hypot(march[..., 0], march[..., 2]) < 20) & (np.abs(march[..., 1]) < half)
    first = np.where(inside.any(axis=1), s[inside.argmax(axis=1)], np.inf)
    seen = np.isfinite(first)
    assert np.isfinite(hits.distance_mm[seen]).all()
    assert (hits.distance_mm[seen] <= first[seen] + 1e-9).all()
    if length is not None:
        assert (hits.distance_mm[seen] > first[seen] - 0.1 - 1e-9).all()
    check_facing(hits, direction)


@pytest.mark.parametrize(("amplitude", "period"), [(5.0, 40.0), (8.0, 6.0), (0.01, 30.0)])
def test_relief_misses_no_first_crossing(amplitude: float, period: float) -> None:
    sheet = at_origin(t.Relief(amplitude_mm=amplitude, period_mm=period, size_mm=(120, 80)))
    rng = np.random.default_rng(SEED)
    origin, direction = rays(400, 50.0, 150.0)
    # Half of them nearly along the sheet, where a ray crosses many waves.
    origin[::2, 2] = amplitude * rng.uniform(-1.5, 1.5, 200)
    direction[::2, 2] *= rng.choice([0.0, 1e-9, 0.02, 0.2], 200)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    hits = sheet.cast(origin, direction)
    wave = 2 * np.pi / period

    def height(k: int, s: Floats | float) -> Floats:
        x, z = (origin[k, axis] + s * direction[k, axis] for axis in (0, 2))
        return np.asarray(z - amplitude * np.sin(wave * x))

    s = np.linspace(0.0, 320.0, 40_001)
    worst, found = 0.0, 0
    for k in range(400):
        x, y = (origin[k, axis] + s * direction[k, axis] for axis in (0, 1))
        value = height(k, s)
        cell = (np.abs(x[1:]) < 60) & (np.abs(x[:-1]) < 60) & (np.abs(y[1:]) < 40)
        change = np.flatnonzero(cell & (np.abs(y[:-1]) < 40) & (value[:-1] * value[1:] <= 0))
        if change.size:
            i = change[0]
            want = brentq(lambda u, k=k: float(height(k, u)), s[i], s[i + 1], xtol=1e-13)
            found += 1
            # Dense sampling may miss a pair of crossings within a step; the cast may not.
            if abs(hits.distance_mm[k] - want) > 1e-7:
                assert hits.distance_mm[k] < want
                assert abs(height(k, hits.distance_mm[k])) < 1e-9
            else:
                worst = max(worst, abs(float(height(k, hits.distance_mm[k]))))
        elif np.isfinite(hits.distance_mm[k]):
            assert abs(height(k, hits.distance_mm[k])) < 1e-9
    print(f"relief {amplitude}/{period}: {found} hits, off the surface by {worst:.1e} mm")
    assert found > 100 and worst < 1e-9
    hit = hits.target == 0
    x = origin[hit, 0] + hits.distance_mm[hit] * direction[hit, 0]
    slope = amplitude * wave * np.cos(wave * x)
    assert np.allclose(hits.normal[hit, 0], -slope * hits.normal[hit, 2], atol=1e-9)
    assert (hits.normal[hit, 1] == 0.0).all()
    check_facing(hits, direction)


def test_a_ray_that_touches_a_crest_does_not_get_lost() -> None:
    amplitude, period = 8.0, 6.0
    sheet = at_origin(t.Relief(amplitude_mm=amplitude, period_mm=period, size_mm=(120, 80)))
    wave = 2 * np.pi / period
    # Tangents just past a crest come down over five others; the next crest stops them for sure.
    past = np.geomspace(1e-6, 0.02, 3000)
    x = -period / 4 * 3 + past / wave
    slope = amplitude * wave * np.cos(wave * x)
    direction = np.stack([np.ones_like(x), 0 * x, slope], axis=1)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    touch = np.stack([x, 0 * x, amplitude * np.sin(wave * x)], axis=1)
    origin = touch - 5.4 * period * direction
    hits = sheet.cast(origin, direction)
    assert (hits.distance_mm > 5.4 * period - 1e-3).all()
    assert (hits.distance_mm < 6.5 * period).all()
    print(f"{(hits.distance_mm < 5.5 * period).sum()} of {x.size} stopped where they touch")


def test_a_ray_from_a_surface_does_not_meet_it_at_once() -> None:
    for target in (
        t.Plane(rotation_deg=(10, 40, 5)),
        t.Sphere(),
        t.Cylinder(length_mm=80),
        t.Box(rotation_deg=(30, 20, 10)),
        t.Relief(amplitude_mm=3, period_mm=90),
        t.Step(),
    ):
        one = at_origin(target)
        origin, direction = rays(2000, 20.0)
        hits = one.cast(origin, direction)
        hit = hits.target == 0
        point = origin[hit] + hits.distance_mm[hit, None] * direction[hit]
        # Back where it came from, nothing is in the way; and not on the other side of the face.
        assert not one.blocked(point, origin[hit]).any(), target.kind
        assert not one.blocked(origin[hit], point).any(), target.kind
        assert one.blocked(origin[hit], point + direction[hit]).all(), target.kind


def test_the_nearest_of_several_counts_and_hides_the_others() -> None:
    targets: list[t.TargetSection] = [
        t.Plane(name="wall", position_mm=(0, 0, 600)),
        t.Sphere(name="ball", radius_mm=20, position_mm=(10, 0, 400)),
        t.Cylinder(name="pipe", radius_mm=5, position_mm=(-30, 0, 500)),
    ]
    both = world(*targets)
    assert both.names == ("wall", "ball", "pipe")
    angle = np.linspace(-0.2, 0.2, 801)
    direction = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    origin = np.zeros_like(direction)
    hits = both.cast(origin, direction)
    single = np.stack([world(one).cast(origin, direction).distance_mm for one in targets])
    assert np.array_equal(hits.distance_mm, single.min(axis=0))
    assert np.array_equal(hits.target, single.argmin(axis=0))
    assert set(hits.target) == {0, 1, 2}
    reverse = world(*targets[::-1]).cast(origin, direction)
    assert np.array_equal(2 - reverse.target, hits.target)
    assert np.array_equal(reverse.normal, hits.normal)
    # The ball's shadow on the wall, for a lens at (60, 0, 0): the cone that touches the ball.
    wall = np.stack([np.linspace(-300, 300, 3001), np.zeros(3001), np.full(3001, 600.0)], axis=1)
    lens = np.tile([60.0, 0.0, 0.0], (3001, 1))
    hidden = world(targets[0], targets[1]).blocked(wall, lens)
    axis = np.array([10.0 - 60.0, 0.0, 400.0])
    cosine = ((wall - lens) @ axis) / np.linalg.norm(wall - lens, axis=1) / np.linalg.norm(axis)
    widest = np.arcsin(20.0 / np.linalg.norm(axis))
    assert np.array_equal(hidden, np.arccos(np.minimum(cosine, 1.0)) < widest)
    assert 30 < hidden.sum() < 3000


def test_nothing_is_nan_and_nothing_warns_off_the_beaten_track() -> None:
    every = world(
        t.Plane(),
        t.Plane(size_mm=(10, 10), position_mm=(0, 0, 0)),
        t.Step(),
        t.Sphere(position_mm=(0, 0, 0)),
        t.Cylinder(),
        t.Cylinder(length_mm=10),
        t.Box(position_mm=(0, 0, -200)),
        t.Corner(),
        t.Relief(map=Checker()),
        t.Relief(position_mm=(0, 0, 0), rotation_deg=(0, 90, 0)),
        t.Bolt(),
    )
    direction = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    direction = np.delete(direction, 13, axis=0) / 1.0
    nearly = direction + np.random.default_rng(SEED).normal(size=(26, 3)) * 1e-16
    direction = np.concatenate([direction, nearly])
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for start in ((0, 0, 0), (0, 0, 500), (30, 0, 500), (0, 0, 5000), (1e4, 1e4, -1e4)):
            origin = np.tile(np.array(start, np.float64), (52, 1))
            hits = every.cast(origin, direction)
            assert not np.isnan(hits.distance_mm).any() and np.isfinite(hits.normal).all()
            assert (hits.distance_mm > 0.0).all() and np.isfinite(hits.albedo).all()
            assert np.array_equal(hits.target < 0, np.isinf(hits.distance_mm))
            assert not every.blocked(origin, origin).any()
            every.blocked(origin, origin + 1000.0 * direction)
        none = world().cast(origin, direction)
        assert (none.target == -1).all() and np.isinf(none.distance_mm).all()
        assert not world().blocked(origin, origin + direction).any()
        behind = world(t.Plane(position_mm=(0, 0, -300))).cast(
            np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
        )
        assert behind.target.tolist() == [-1]
        assert every.cast(np.empty((0, 3)), np.empty((0, 3))).target.shape == (0,)


def test_bounds_hold_everything_and_know_what_has_no_end() -> None:
    turned = world(t.Box(size_mm=(20, 20, 20), rotation_deg=(0, 45, 0), position_mm=(1, 2, 300)))
    reach = 10 * np.sqrt(2)
    want = [[1 - reach, -8, 300 - reach], [1 + reach, 12, 300 + reach]]
    assert np.allclose(turned.bounds, want)
    assert world(t.Plane(position_mm=(0, 0, 400))).bounds.tolist() == [
        [-np.inf, -np.inf, 400.0],
        [np.inf, np.inf, 400.0],
    ]
    across = world(t.Plane(position_mm=(7, 0, 400), rotation_deg=(0, 90, 0))).bounds
    assert np.allclose(across[:, 0], 7.0) and np.isinf(across[:, 1:]).all()
    pipe = world(t.Cylinder(radius_mm=5, rotation_deg=(30, 0, 0))).bounds
    assert np.allclose(pipe[:, 0], [-5, 5]) and np.isinf(pipe[:, 1:]).all()
    assert (world().bounds[0] > world().bounds[1]).all()


def test_maps_follow_their_targets() -> None:
    x = np.array([1.0, 11.0, 11.0, -1.0, -1.0])
    y = np.array([1.0, 1.0, 11.0, 1.0, -1.0])
    checker = Checker(square_mm=10, low=0.2, high=0.8)
    assert checker.factor(x, y).tolist() == [0.8, 0.2, 0.8, 0.2, 0.8]
    stripes = Stripes(period_mm=10, duty=0.3, across="y", low=0.0, high=1.0)
    y = np.arange(0.05, 100.0, 0.1)
    assert stripes.factor(np.zeros_like(y), y).mean() == pytest.approx(0.3)
    # A plane that is moved and turned by 90 degrees about z carries its stripes along.
    plane = t.Plane(position_mm=(5, 7, 500), rotation_deg=(0, 0, 90), map=Stripes(period_mm=10))
    origin = np.array([[3.0, 7.0 + s, 0.0] for s in (1.0, 6.0, -1.0, -6.0)])
    hits = world(plane, t.Plane(position_mm=(0, 0, 900))).cast(
        origin, np.tile([0.0, 0.0, 1.0], (4, 1))
    )
    assert hits.albedo.tolist() == [1.0, 0.1, 0.1, 1.0]


def test_a_picture_is_sampled_between_its_pixels(tmp_path: Path) -> None:
    ramp = np.tile(np.arange(0, 250, 10, dtype=np.uint8), (8, 1))
    Image.fromarray(ramp).save(tmp_path / "ramp.png")
    picture = load_map(ImageMap(file="ramp.png", size_mm=(50, 16)), tmp_path)
    x = np.linspace(-23.9, 23.9, 101)
    # 2 mm a pixel; columns grow towards -x: 120/255 in the middle, 5/255 per mm.
    assert np.allclose(picture.factor(x, 0 * x), (120.0 - 5.0 * x) / 255.0)
    assert picture.factor(np.array([25.1, 0.0]), np.array([0.0, 8.1])).tolist() == [1.0, 1.0]
    rows = np.repeat(np.array([[0], [65_535]], np.uint16), 2, axis=1)
    Image.fromarray(rows).save(tmp_path / "deep.png")
    tiles = load_map(ImageMap(file="deep.png", size_mm=(4, 4), repeat=True), tmp_path)
    y = np.array([1.0, -1.0, 0.0, 3.0, 2.0])  # white is below; halfway between the tiles is grey
    assert np.allclose(tiles.factor(0 * y, y), [0.0, 1.0, 0.5, 1.0, 0.5])


def test_sections_read_what_toml_gives() -> None:
    bolt = SECTION.validate_python(
        {"kind": "bolt", "position_mm": [0, 0, 400], "map": {"kind": "checker", "square_mm": 5}}
    )
    assert isinstance(bolt, t.Bolt) and bolt.position_mm == (0.0, 0.0, 400.0)
    assert bolt.pitch_mm == 5.0 and isinstance(bolt.map, Checker)
    assert SECTION.validate_python({"kind": "box", "size_mm": [1, 2, 3]}).kind == "box"


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({"kind": "teapot"}, "teapot"),
        ({"kind": "sphere", "radius_mm": -1}, "radius_mm"),
        ({"kind": "sphere", "colour": "red"}, "colour"),
        ({"kind": "plane", "position_mm": [0, 0]}, "position_mm"),
        ({"kind": "plane", "size_mm": [10, 0]}, "size_mm"),
        ({"kind": "corner", "angle_deg": 180}, "angle_deg"),
        ({"kind": "bolt", "diameter_mm": 10}, "2.5 pitches"),
        ({"kind": "bolt", "pitch_mm": 0.1}, "200 pitches"),
        ({"kind": "plane", "map": {"kind": "checker", "low": 1.2}}, "low"),
        ({"kind": "mesh"}, "file"),
        ({"kind": "plane", "name": ""}, "name"),
    ],
)
def test_bad_keys_and_values_are_refused(values: dict[str, object], word: str) -> None:
    with pytest.raises(ValidationError) as caught:
        SECTION.validate_python(values)
    assert word in str(caught.value)


def test_bad_files_and_names_are_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no picture")
    for file, word in (("text.png", "not a picture"), ("none.png", "no such picture")):
        target = t.Plane(map=ImageMap(file=file))
        with pytest.raises(InputError, match=word) as caught:
            t.World([target], tmp_path)
        assert file in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(InputError, match="target ball: 2 targets"):
        world(t.Sphere(name="ball"), t.Box(name="ball"))
    two = world(t.Sphere(), t.Sphere(), t.Box(), t.Plane(name="plane"), t.Plane())
    assert two.names == ("sphere 1", "sphere 2", "box", "plane", "plane 1")


def test_each_target_is_asked_once_for_all_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cost of a world: one call a target, with whole arrays, whatever is hit."""
    five = world(t.Plane(), t.Sphere(), t.Step(), t.Cylinder(), t.Relief(position_mm=(0, 0, 450)))
    angle = np.linspace(-0.3, 0.3, 512)
    direction = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    asked: list[tuple[str, int]] = []
    for kind in {type(placed.shape) for placed in five._placed}:

        def counted(shape, origin, direction, kind=kind, meet=kind.meet):
            asked.append((kind.__name__, len(origin)))
            return meet(shape, origin, direction)

        monkeypatch.setattr(kind, "meet", counted)
    hits = five.cast(np.zeros_like(direction), direction)
    assert len(np.unique(hits.target)) > 1
    assert asked == [(type(placed.shape).__name__, 512) for placed in five._placed]
