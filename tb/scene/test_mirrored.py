"""Mirror images and mirrored beams, against rays drawn by chance and the closed-form mirror image.

The rays know nothing of first-order optics: they leave the laser beside its axis, are scattered
into directions drawn from the lobe (or to places drawn on the second surface, weighed with f_r as
its docstring has it), and go from there to the middle of the pupil.
"""

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.scene.beam import radius_mm
from vrscan.scene.description import Description, parse
from vrscan.scene.light import Light
from vrscan.scene.mirrored import Images, Mirrors
from vrscan.scene.render import Renderer
from vrscan.scene.timeline import Timeline

SEED = 20100301
CONFIG = Config()
PUPIL_MM2 = 0.25 * math.pi * (25.0 / 3.0) ** 2
PHI = math.radians(82.0)
LENS = np.array([60.0, 0.0, 0.0])
AXIS = np.array([-math.cos(PHI), 0.0, math.sin(PHI)])
SIDE = np.array([math.sin(PHI), 0.0, math.cos(PHI)])
DRAWN = 200_000
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
        size = 7.0 * two.lobe / (1 / reach[0] + 1 / reach[1]) / np.array([cos**2, 1.0]) + 1.0
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


def _corner(lobe_deg: float, turn: float, *, z: float = 450.0, opening: float = 90.0) -> Description:
    return parse(
        {
            "target": [
                {
                    "kind": "corner",
                    "position_mm": [0, 0, z],
                    "rotation_deg": [0, turn, 0],
                    "size_mm": [400, 1000],
                    "angle_deg": opening,
                }
            ],
            "material": {"default": {"reflectance": MATT, "gloss": GLOSS, "lobe_deg": lobe_deg}},
            "laser": {"aperture_mm": math.inf},
        },
        "scene",
        Path(),
    )


def _plates(lobe_deg: float, turn: float, opening: float = 90.0) -> list[Plate]:
    """Return the left and the right plate of the corner."""
    lobe = math.sin(math.radians(lobe_deg))
    half = math.radians(0.5 * opening)
    found = []
    for sign in (1.0, -1.0):
        tilt = math.radians(turn)
        normal = np.array([sign * math.cos(half), 0.0, -math.sin(half)])
        normal = np.array(
            [
                normal[0] * math.cos(tilt) + normal[2] * math.sin(tilt),
                0.0,
                -normal[0] * math.sin(tilt) + normal[2] * math.cos(tilt),
            ]
        )
        found.append(Plate(np.array([0.0, 0.0, 450.0]), normal, MATT, GLOSS, lobe))
    return found


def _spread(image: Images, light: Light) -> tuple[float, float]:
    """Return the sigmas of an image along and across the row, px."""
    beam = 0.5 * radius_mm(image.way_mm, light.scene.laser)
    return (
        float(np.hypot(beam * image.px_per_mm, image.lobe_px)[0]),
        float(np.hypot(beam * image.high_px_per_mm, image.lobe_high_px)[0]),
    )


def _beam(angle: Floats) -> Floats:
    return np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)


def figures(lobe: float, degrees: float, turn: float, opening: float = 90.0):
    angle = math.radians(degrees)
    light = Light(_corner(lobe, turn, opening=opening), CONFIG)
    left, right = _plates(lobe, turn, opening)
    one, two = (left, right) if degrees < 0 else (right, left)
    out = {}
    for kind, image in zip(KINDS, Mirrors(light, falloff=False).images(_beam(np.array([angle])), np.zeros(1)), strict=True):
        want = _by_chance(kind, one, two, angle, light)
        got = None
        if len(image.row):
            got = (image.collected[0], image.place_px[0], image.high_px[0], *_spread(image, light))
        out[kind] = got, want
    return out
