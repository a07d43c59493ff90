"""Mirror images and mirrored beams, against rays drawn by chance and the closed-form mirror image.

The rays know nothing of first-order optics: they leave the laser beside its axis, are scattered
into directions drawn from the lobe (or to places drawn on the second surface, weighed with f_r as
its docstring has it), and go from there to the middle of the pupil.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.scene.beam import radius_mm
from vrscan.scene.description import Description, load, parse
from vrscan.scene.library import at_angles
from vrscan.scene.light import Light
from vrscan.scene.mirrored import Images, Mirrors
from vrscan.scene.render import Renderer
from vrscan.scene.targets import Hits, World

SEED = 20100301
CONFIG = Config()
PUPIL_MM2 = 0.25 * math.pi * (25.0 / 3.0) ** 2
PHI = math.radians(82.0)
LENS = np.array([60.0, 0.0, 0.0])
AXIS = np.array([-math.cos(PHI), 0.0, math.sin(PHI)])
SIDE = np.array([math.sin(PHI), 0.0, math.cos(PHI)])
DRAWN = 100_000
MATT, GLOSS = 0.05, 0.8


@dataclass(frozen=True)
class Plate:
    """An endless plane."""

    point: Floats
    normal: Floats  # towards the scanner's side
    matt: float
    gloss: float
    lobe: float  # sigma, direction cosines

    def hit(self, start: Floats, way: Floats) -> Floats:
        return start + ((self.point - start) @ self.normal / (way @ self.normal))[:, None] * way

    def scattered(self, way: Floats, out: Floats) -> Floats:
        """Return the Gaussian lobe's f_r."""
        half = out - way
        flat = half - (half @ self.normal)[:, None] * self.normal
        square = (flat**2).sum(axis=1)
        return self.gloss * np.exp(-0.5 * square / self.lobe**2) / (2 * math.pi * self.lobe**2)

    def drawn(self, way: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Return directions drawn from the lobe, and their weight: 0 below the horizon."""
        one = np.cross([0.0, 1.0, 0.0], self.normal)
        one /= np.linalg.norm(one)
        other = np.cross(self.normal, one)
        flat = way - (way @ self.normal)[:, None] * self.normal
        beside = self.lobe * rng.standard_normal((2, len(way)))
        flat = flat + beside[0][:, None] * one + beside[1][:, None] * other
        square = (flat**2).sum(axis=1)
        up = np.sqrt(np.maximum(1.0 - square, 0.0))
        return flat + up[:, None] * self.normal, np.where(square < 1.0, self.gloss, 0.0)


def _unit(way: Floats) -> tuple[Floats, Floats]:
    size = np.linalg.norm(way, axis=-1)
    return way / size[..., None], size


def _moments(place: Floats, weight: Floats) -> tuple[float, ...]:
    """Return light, and mean and sigma along and across the row, px."""
    sight = place - LENS
    depth = sight @ AXIS
    x = 1023.5 + 25.0 / 0.007 * (sight @ SIDE) / depth
    y = 25.0 / 0.007 * sight[:, 1] / depth
    share = weight / weight.sum()
    mean = (share * x).sum(), (share * y).sum()
    spread = (share * (x - mean[0]) ** 2).sum(), (share * (y - mean[1]) ** 2).sum()
    return (weight.mean(), *mean, math.sqrt(spread[0]), math.sqrt(spread[1]))


def _first(plate: Plate, angle: float, light: Light) -> tuple[Floats, Floats, Floats]:
    """Return places and directions of rays of the beam on a plate, and the axis's place."""
    rng = np.random.default_rng(SEED)
    ray = np.array([math.sin(angle), 0.0, math.cos(angle)])
    axis = plate.hit(np.zeros((1, 3)), ray[None])[0]
    # The beam is as wide as on its way's middle: it opens by little.
    sigma = 0.5 * float(radius_mm(np.array([np.linalg.norm(axis)]), light.scene.laser)[0])
    beside = sigma * rng.standard_normal((2, DRAWN))
    start = beside[0][:, None] * np.array([ray[2], 0.0, -ray[0]])
    start[:, 1] = beside[1]
    way = np.broadcast_to(ray, start.shape)
    return plate.hit(start, way), way, axis


def _by_chance(kind: str, one: Plate, two: Plate, angle: float, light: Light) -> tuple[float, ...]:
    rng = np.random.default_rng(SEED + 1)
    spot, way, axis = _first(one, angle, light)
    if kind == "matt to gloss":
        image = LENS - 2.0 * ((LENS - two.point) @ two.normal) * two.normal
        middle = two.hit(axis[None], (image - axis)[None])[0]
        reach = np.linalg.norm(middle - axis), np.linalg.norm(LENS - middle)
        cos = (LENS - middle) @ two.normal / reach[1]
        size = 5.0 * two.lobe / (1 / reach[0] + 1 / reach[1]) / np.array([cos**2, 1.0]) + 1.0
        flat = np.cross([0.0, 1.0, 0.0], two.normal)
        flat /= np.linalg.norm(flat)
        at = size * rng.uniform(-1.0, 1.0, (DRAWN, 2))
        place = middle + at[:, :1] * flat + at[:, 1:] * np.cross(two.normal, flat)
        go, near = _unit(place - spot)
        out, far = _unit(LENS - place)
        weight = one.matt / math.pi * np.maximum(go @ one.normal, 0.0)
        weight *= np.maximum(-(go @ two.normal), 0.0) / near**2 * 4.0 * size.prod()
        weight *= two.scattered(go, out)
    else:
        go, weight = one.drawn(way, rng)
        place = two.hit(spot, go)
        weight = np.where((place - spot) @ one.normal > 0.0, weight, 0.0)
        weight = np.where(((place - spot) * go).sum(axis=1) > 0.0, weight, 0.0)
        out, far = _unit(LENS - place)
        weight *= two.matt / math.pi if kind == "gloss to matt" else two.scattered(go, out)
    weight = weight * np.maximum(out @ two.normal, 0.0) * PUPIL_MM2 / far**2
    return _moments(place, weight)


KINDS = ("gloss to matt", "matt to gloss", "gloss to gloss")


def _scene(*targets: dict[str, object], lobe_deg: float, **tables: object) -> Description:
    material = {"reflectance": MATT, "gloss": GLOSS, "lobe_deg": lobe_deg}
    values = {
        "target": list(targets),
        "material": {"default": material, "matt": {"reflectance": 0.5}},
        "laser": {"aperture_mm": math.inf},
        **tables,
    }
    return parse(values, "scene", Path())


def _corner(turn: float = 0.0, opening: float = 90.0, tip: float = 0.0) -> dict[str, object]:
    """Return a corner whose edge is at z = 450 mm."""
    return {
        "kind": "corner",
        "position_mm": [0, 0, 450],
        "rotation_deg": [tip, turn, 0],
        "size_mm": [400, 1000],
        "angle_deg": opening,
    }


def _plates(
    lobe_deg: float, turn: float = 0.0, opening: float = 90.0, tip: float = 0.0
) -> list[Plate]:
    """Return the left and the right plate of the corner."""
    lobe, half = math.sin(math.radians(lobe_deg)), math.radians(0.5 * opening)
    found = []
    for sign in (1.0, -1.0):
        x, y, z = sign * math.cos(half), 0.0, -math.sin(half)
        cos, sin = math.cos(math.radians(tip)), math.sin(math.radians(tip))
        y, z = y * cos - z * sin, y * sin + z * cos
        cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        normal = np.array([x * cos + z * sin, y, z * cos - x * sin])
        found.append(Plate(np.array([0.0, 0.0, 450.0]), normal, MATT, GLOSS, lobe))
    return found


def _spread(image: Images, light: Light) -> tuple[float, float]:
    """Return the sigmas of an image along and across the row, px."""
    beam = 0.5 * radius_mm(image.way_mm, light.scene.laser)
    return (
        float(np.hypot(beam * image.px_per_mm, image.lobe_px)[0]),
        float(np.hypot(beam * image.high_px_per_mm, image.lobe_high_px)[0]),
    )


def _images(scene: Description, degrees: Floats, y: float = 0.0) -> dict[str, Images]:
    angle = np.radians(degrees)
    beam = np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
    found = Mirrors(Light(scene, CONFIG), falloff=False).images(beam, np.full(len(angle), y))
    return dict(zip(KINDS, found, strict=True))


def _seen(point: Floats) -> tuple[float, float, float]:
    """Return where the camera sees a point, along and across the row, and its depth."""
    sight = point - LENS
    depth = float(sight @ AXIS)
    px = 25.0 / 0.007 / depth
    return 1023.5 + px * float(sight @ SIDE), px * float(sight[1]), depth


def _behind(plate: Plate, point: Floats) -> Floats:
    """Return the mirror image of a point."""
    return point - 2.0 * float((point - plate.point) @ plate.normal) * plate.normal


# Lobe, scan angle, turn and opening of the corner, degrees.
CORNERS = [
    (0.3, -3.0, 0.0, 90.0),
    (0.3, 2.5, 10.0, 90.0),
    (1.0, -2.0, 15.0, 90.0),
    (1.0, 3.5, 0.0, 95.0),
    (2.0, -3.0, 0.0, 90.0),
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", CORNERS, ids=str)
def test_light_place_and_size_are_those_of_rays_drawn_by_chance(
    kind: str, case: tuple[float, float, float, float]
) -> None:
    """First-order optics errs by the square of the lobe, and by more where light is rare."""
    lobe, degrees, turn, opening = case
    scene = _scene(_corner(turn, opening), lobe_deg=lobe)
    light = Light(scene, CONFIG)
    left, right = _plates(lobe, turn, opening)
    one, two = (left, right) if degrees < 0 else (right, left)
    image = _images(scene, np.array([degrees]))[kind]
    want = _by_chance(kind, one, two, math.radians(degrees), light)
    assert len(image.row) == 1
    got = (image.collected[0], image.place_px[0], image.high_px[0], *_spread(image, light))
    print(f"{kind}, lobe {lobe}: got", *np.round(got[1:], 2), f"{got[0]:.3e}")
    print("want", *np.round(want[1:], 2), f"{want[0]:.3e}")
    if kind == "gloss to gloss":
        if lobe < 1.0 or want[0] < 1e-4:  # a lobe no wider than the pupil; the lobe's far tail
            return
        assert abs(got[0] / want[0] - 1.0) < 0.2
    else:
        assert abs(got[0] / want[0] - 1.0) < 0.02
    assert abs(got[1] - want[1]) < 0.25 * want[3]
    assert abs(got[2] - want[2]) < 0.03 * want[4]
    assert abs(got[3] / want[3] - 1.0) < 0.13
    assert abs(got[4] / want[4] - 1.0) < 0.06


@pytest.mark.parametrize(("turn", "opening", "tip"), [(0, 90, 0), (12, 80, 0), (-5, 100, 0.15)])
def test_a_narrow_lobe_shows_the_mirror_image_of_spot_and_laser(
    turn: float, opening: float, tip: float
) -> None:
    scene = _scene(_corner(turn, opening, tip), lobe_deg=0.6)
    plates = _plates(0.6, turn, opening, tip)
    degrees = np.array([-4.0, -2.5, -1.0, 1.0, 2.5, 4.0])
    found = _images(scene, degrees)
    count = dict.fromkeys(KINDS, 0)
    for k, angle in enumerate(np.radians(degrees)):
        one, two = plates if angle < 0 else plates[::-1]
        ray = np.array([[math.sin(angle), 0.0, math.cos(angle)]])
        spot = one.hit(np.zeros((1, 3)), ray)[0]
        laser = _behind(one, np.zeros(3))
        for kind in KINDS[:2]:
            image = found[kind]
            at = np.flatnonzero(image.row == k)
            if len(at) == 0:
                continue
            count[kind] += 1
            if kind == "matt to gloss":
                want = _seen(_behind(two, spot))
            else:
                want = _seen(two.hit(laser[None], (spot - laser)[None])[0])
            got = image.place_px[at[0]], image.high_px[at[0]], image.depth_mm[at[0]]
            # Out of the plane the place follows to the first order in the tilt.
            assert np.allclose(got, want, rtol=1e-4 + 0.01 * tip, atol=0.01 + 2.0 * tip), kind
            if tip:
                assert abs(want[1]) > 0.2 and abs(got[1] / want[1] - 1.0) < 0.05
    print(count)
    assert min(count[kind] for kind in KINDS[:2]) >= 4


def test_a_beam_that_two_mirrors_send_into_the_pupil_is_there_as_a_whole() -> None:
    """Twice 80 % of it, whatever the lobe, once that is far narrower than the pupil."""
    degrees = np.linspace(-4.5, -2.5, 801)
    image = _images(_scene(_corner(), lobe_deg=0.02), degrees)["gloss to gloss"]
    top = float(image.collected.max())
    print(f"{top:.4f} of {GLOSS**2:.4f}")
    assert abs(top / GLOSS**2 - 1.0) < 0.01
    # Against a corner of 90 degrees the beam returns beside itself: the lens is 60 mm away.
    angle = math.radians(float(degrees[image.row[image.collected.argmax()]]))
    assert abs(2.0 * 450.0 * abs(math.sin(angle)) - 60.0 * math.cos(angle)) < 1.5


def test_a_bent_mirror_shows_what_rays_on_its_circle_do() -> None:
    """A spot on a wall, seen in a shaft: Fermat's way, and rays of a cone that find the lens."""
    wall = {"kind": "plane", "position_mm": [-30, 0, 450], "rotation_deg": [0, -50, 0]}
    shaft = {"kind": "cylinder", "position_mm": [25, 0, 440], "radius_mm": 20}
    scene = _scene({**wall, "material": "matt"}, shaft, lobe_deg=0.6)
    degrees = np.array([-5.0, -4.0, -3.0])
    image = _images(scene, degrees)["matt to gloss"]
    assert len(image.row) == 3
    turn = math.radians(-50.0)
    normal = np.array([-math.sin(turn), 0.0, -math.cos(turn)])
    middle, rng = np.array([25.0, 0.0, 440.0]), np.random.default_rng(SEED)
    for k, angle in enumerate(np.radians(degrees)):
        ray = np.array([math.sin(angle), 0.0, math.cos(angle)])
        spot = float(np.array([-30.0, 0.0, 450.0]) @ normal / (ray @ normal)) * ray

        def place(turn: float) -> Floats:
            return middle + 20.0 * np.array([math.sin(turn), 0.0, -math.cos(turn)])

        def way(turn: float, spot: Floats = spot) -> float:
            at = place(turn)
            return float(np.linalg.norm(at - spot) + np.linalg.norm(at - LENS))

        best = minimize_scalar(way, bounds=(-1.5, 0.5), method="bounded", options={"xatol": 1e-9})
        at = place(best.x)
        assert abs(image.place_px[k] - _seen(at)[0]) < 0.01
        # Rays of a small cone about that way, each mirrored by the circle that it meets.
        go, _ = _unit(at - spot)
        across = np.cross([0.0, 1.0, 0.0], go)
        beside = rng.uniform(-0.05, 0.05, (2, DRAWN))
        fan, _ = _unit(go + beside[0][:, None] * across + beside[1][:, None] * [0.0, 1.0, 0.0])
        flat, from_middle = fan[:, ::2], (spot - middle)[::2]
        square, half = (flat**2).sum(axis=1), flat @ from_middle
        root = half**2 - square * (from_middle @ from_middle - 400.0)
        hits = root > 0.0
        far = (-half[hits] - np.sqrt(root[hits])) / square[hits]
        point = spot + far[:, None] * fan[hits]
        outward = (point - middle) * [1.0, 0.0, 1.0] / 20.0
        on = fan[hits] - 2.0 * (fan[hits] * outward).sum(axis=1)[:, None] * outward
        sight, _ = _unit(at - LENS)
        end = point + ((LENS - point) @ sight / (on @ sight))[:, None] * on
        # A pupil four times as wide, for enough rays; 0.1 rad is the cone's side.
        solid = (np.linalg.norm(end - LENS, axis=1) < 4.0 * math.sqrt(PUPIL_MM2 / math.pi)).sum()
        want = 0.5 / math.pi * float(go @ normal) * GLOSS * 0.01 * solid / DRAWN / 16.0
        print(f"{image.collected[k]:.3e} / {want:.3e}, {solid} rays")
        assert solid > 300 and abs(image.collected[k] / want - 1.0) < 0.02 + 3.0 / math.sqrt(solid)


def test_a_bent_mirror_spreads_the_beam() -> None:
    """A shaft throws the beam onto a wall behind it; rays beside the axis tell how wide."""
    wall = {"kind": "plane", "position_mm": [0, 0, 470], "material": "matt"}
    shaft = {"kind": "cylinder", "position_mm": [30, 0, 420], "radius_mm": 20}
    degrees = np.array([1.7, 1.8])
    scene = _scene(wall, shaft, lobe_deg=0.05)
    image = _images(scene, degrees)["gloss to matt"]
    assert len(image.row) == 2
    for k, angle in enumerate(np.radians(degrees)):

        def place(offset: float, turn: float, angle: float = angle) -> float:
            ray = np.array([math.sin(angle + turn), math.cos(angle + turn)])
            start = offset * np.array([ray[1], -ray[0]]) - np.array([30.0, 420.0])
            half = ray @ start
            hit = start + (-half - math.sqrt(half**2 - start @ start + 400.0)) * ray
            on = ray - 2.0 * (ray @ hit) * hit / 400.0
            point = hit + np.array([30.0, 420.0])
            point = point + (470.0 - point[1]) / on[1] * on
            return _seen(np.array([point[0], 0.0, point[1]]))[0]

        step = 1e-3
        assert abs(image.place_px[k] - place(0.0, 0.0)) < 0.01
        beside = (place(step, 0.0) - place(-step, 0.0)) / (2.0 * step)
        turned = (place(0.0, 1e-5) - place(0.0, -1e-5)) / 2e-5
        print(f"{image.px_per_mm[k]:.1f} / {beside:.1f}; {image.px_per_rad[k]:.0f} / {turned:.0f}")
        assert abs(abs(image.px_per_mm[k] / beside) - 1.0) < 0.01
        assert abs(abs(image.px_per_rad[k] / turned) - 1.0) < 0.01
        assert abs(beside) > 10.0 * 25.0 / 0.007 / image.depth_mm[k]  # more than a flat mirror's


def test_what_stands_between_hides_the_image() -> None:
    degrees = np.array([-3.0])
    post = {"kind": "box", "position_mm": [-2, 0, 425], "size_mm": [2, 20, 20], "material": "matt"}
    free = _images(_scene(_corner(), lobe_deg=0.6), degrees)
    shut = _images(_scene(_corner(), post, lobe_deg=0.6), degrees)
    assert all(len(free[kind].row) == 1 for kind in KINDS)
    assert all(len(shut[kind].row) == 0 for kind in KINDS)


def test_a_scanner_that_moves_sees_the_mirrors_from_there() -> None:
    tilted = _corner(0.0, 90.0, 0.1)
    here = _images(_scene(tilted, lobe_deg=0.6), np.array([-3.0, 2.0]), y=7.3)
    moved = {**tilted, "position_mm": [0, -7.3, 450]}
    there = _images(_scene(moved, lobe_deg=0.6), np.array([-3.0, 2.0]))
    for kind in KINDS:
        for name in vars(here[kind]):
            one, other = getattr(here[kind], name), getattr(there[kind], name)
            assert np.allclose(one, other, rtol=1e-4, atol=1e-4), (kind, name)
    assert len(here["matt to gloss"].row) == 2


def test_the_row_gets_each_images_light_where_and_as_wide_as_it_is() -> None:
    sensor = {"full_well_e": 1e12}
    scene = _scene(_corner(), lobe_deg=1.0, sensor=sensor, stray={"enabled": []})
    light = Light(scene, CONFIG)
    when = at_angles(np.radians([2.0]), CONFIG.mirror)
    found = _images(scene, np.array([2.0]))
    lines = [
        Renderer(light, frozenset(active)).charge(when).laser_e[0].astype(np.float64)
        for active in (set(), {"mirrored"})
    ]
    extra = lines[1] - lines[0]
    spot = Renderer(light, frozenset())._spotter
    place, want = np.arange(2048.0), np.zeros(2048)
    for kind in KINDS:
        image = found[kind]
        assert len(image.row) == 1
        along, across = _spread(image, light)
        share = 1.0 / math.sqrt(2.0 * math.pi * (across**2 + 1.0 / 12.0))
        bell = np.exp(-0.5 * np.square(place - image.place_px[0]) / (along**2 + 1.0 / 12.0))
        want += spot.electrons * image.collected[0] * share * bell / bell.sum()
    print(f"{extra.sum():.0f} / {want.sum():.0f} electrons")
    assert np.abs(extra - want).max() < 0.01 * want.max()
    assert want.sum() > 0.3 * lines[0].sum()


def test_edges_of_a_thread_are_no_images_and_take_no_rays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every flank of the bolt ends where the next one shows another side: no spot is in an edge."""
    light = Light(load("bolt"), CONFIG)
    mirrors, followed = Mirrors(light, falloff=True), []
    angle = np.radians(np.linspace(-10.0, 10.0, 400))
    beam = np.stack([np.sin(angle), np.zeros(400), np.cos(angle)], axis=1)
    mirrors.images(beam, np.zeros(400))  # makes the view
    cast = World.cast

    def counted(self: World, origin: Floats, direction: Floats) -> Hits:
        followed.append(len(origin))
        return cast(self, origin, direction)

    monkeypatch.setattr(World, "cast", counted)
    images = mirrors.images(beam, np.zeros(400))
    print(f"{sum(followed)} rays, images {[len(image.row) for image in images]}")
    assert len(images[1].row) > 50
    assert sum(followed) < 6400
