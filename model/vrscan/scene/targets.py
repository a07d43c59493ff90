"""Targets: the bodies that a scene file may put before the scanner, and the world that they form.

A target is described in its own frame, turned about the x, then the y, then the z axis of the
scanner's frame, and moved. Unturned, a target with a face shows it to the scanner, which looks
along +z with its scan plane at y = 0.

The world leaves out light that enters a body (all surfaces are opaque), faces that bend the light's
path, and motion of a target.
"""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Positive, Section
from vrscan.data.errors import InputError
from vrscan.scene import shapes, thread
from vrscan.scene.bust import bust
from vrscan.scene.meshes import Caster, load_mesh
from vrscan.scene.reflectance import Map, MapSection, load_map
from vrscan.scene.shapes import START, Shape, dot
from vrscan.scene.tuples import Size, Size3, Vector

__all__ = ["START", "Hits", "TargetSection", "World"]


class Target(Section, ABC):
    """The properties that all targets have."""

    name: str | None = Field(default=None, min_length=1)  # by default the kind, numbered
    position_mm: Vector = (0.0, 0.0, 500.0)
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    material: str = "default"  # name of one of the scene's materials
    map: MapSection | None = None  # a factor on the material's reflectance

    @abstractmethod
    def shape(self, folder: Path) -> Shape:
        """Return the target's shape in its own frame.

        Args:
            folder: Folder of the scene file.

        Raises:
            InputError: if a file that the target names is not valid.
        """


class Plane(Target):
    """A plane z = 0, endless or a rectangle."""

    kind: Literal["plane"] = "plane"
    size_mm: Size | None = None  # size in x and y; without it the plane is endless

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        if self.size_mm is None:
            return shapes.Plane()
        return _rectangles(((0.0, 0.0, 0.0), (self.size_mm[0], 0, 0), (0, self.size_mm[1], 0)))


class Step(Target):
    """A step: z = 0 for x > 0; for x < 0 a block stands ``height_mm`` towards the scanner."""

    kind: Literal["step"] = "step"
    size_mm: Size = (100.0, 60.0)  # size of both levels together, in x and y
    height_mm: Positive = 30.0

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        (width, length), high = self.size_mm, self.height_mm
        half = 0.5 * width
        return _rectangles(
            ((0.5 * half, 0.0, 0.0), (half, 0, 0), (0, length, 0)),
            ((-0.5 * half, 0.0, -high), (half, 0, 0), (0, length, 0)),
            ((0.0, 0.0, -0.5 * high), (0, length, 0), (0, 0, high)),
            ((-half, 0.0, -0.5 * high), (0, length, 0), (0, 0, high)),
            ((-0.5 * half, 0.5 * length, -0.5 * high), (half, 0, 0), (0, 0, high)),
            ((-0.5 * half, -0.5 * length, -0.5 * high), (half, 0, 0), (0, 0, high)),
        )


class Sphere(Target):
    """A sphere about its position."""

    kind: Literal["sphere"] = "sphere"
    radius_mm: Positive = 30.0

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        return shapes.Sphere(self.radius_mm)


class Cylinder(Target):
    """A cylinder along y: across the scan plane, in which it is a circle."""

    kind: Literal["cylinder"] = "cylinder"
    radius_mm: Positive = 30.0
    length_mm: Positive | None = None  # length between flat ends; without it there are no ends

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        return shapes.Cylinder(self.radius_mm, self.length_mm or math.inf)


class Box(Target):
    """A solid box about its position."""

    kind: Literal["box"] = "box"
    size_mm: Size3 = (60.0, 60.0, 60.0)

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        return shapes.Box(self.size_mm)


class Corner(Target):
    """Two plates that meet on the y axis and open towards the scanner."""

    kind: Literal["corner"] = "corner"
    angle_deg: float = Field(default=90.0, gt=0, lt=180)  # angle between the plates
    size_mm: Size = (100.0, 100.0)  # size of each plate: from the edge, and along it

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        half = math.radians(0.5 * self.angle_deg)
        width, length = self.size_mm
        x, z = width * math.sin(half), -width * math.cos(half)
        return _rectangles(
            *(((0.5 * s * x, 0.0, 0.5 * z), (s * x, 0, z), (0, length, 0)) for s in (-1.0, 1.0))
        )


class Relief(Target):
    """A sheet that waves along x: z = amplitude sin(2 pi x / period)."""

    kind: Literal["relief"] = "relief"
    amplitude_mm: Positive = 5.0  # half of the height from valley to crest
    period_mm: Positive = 40.0
    size_mm: Size = (200.0, 200.0)

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        return shapes.Relief(self.amplitude_mm, self.period_mm, self.size_mm)


class Bolt(Target):
    """A threaded rod along x, profile of ISO 68-1; see ``vrscan.scene.thread``."""

    kind: Literal["bolt"] = "bolt"
    diameter_mm: Positive = 48.0
    pitch_mm: Positive = 5.0
    length_mm: Positive = 120.0

    @model_validator(mode="after")
    def _has_a_core(self) -> "Bolt":
        least = 2.5 * self.pitch_mm
        if self.diameter_mm < least:
            raise ValueError(f"diameter_mm {self.diameter_mm} is below 2.5 pitches, {least}")
        if self.length_mm > 200.0 * self.pitch_mm:
            raise ValueError(f"length_mm {self.length_mm} is above 200 pitches")
        return self

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        return thread.caster(thread.Thread(self.diameter_mm, self.pitch_mm, self.length_mm))


class Bust(Target):
    """A sculpted head on a pedestal, upright in y, facing the scanner; origin at half height."""

    kind: Literal["bust"] = "bust"
    height_mm: Positive = 300.0

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        return Caster(*bust(self.height_mm))


class Mesh(Target):
    """A closed triangle mesh from an STL, OBJ or PLY file."""

    kind: Literal["mesh"] = "mesh"
    file: str  # path relative to the scene file
    scale: Positive = 1.0  # mm per unit of the file

    def shape(self, folder: Path) -> Shape:
        """See ``Target``."""
        return Caster(*load_mesh(folder / self.file, self.scale))


TargetSection = Annotated[
    Plane | Step | Sphere | Cylinder | Box | Corner | Relief | Bolt | Bust | Mesh,
    Field(discriminator="kind"),
]

_Vector = tuple[float, float, float]


def _rectangles(*each: tuple[_Vector, _Vector, _Vector]) -> shapes.Patches:
    """Return rectangles, each given by its centre and two edges."""
    centre, along, across = (np.array(part, np.float64) for part in zip(*each, strict=True))
    return shapes.Patches(centre, 0.5 * along, 0.5 * across)


def rotation(degrees: tuple[float, float, float]) -> Floats:
    """Return the matrix [3, 3] that turns about x, then y, then z, the axes of the fixed frame."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


@dataclass(frozen=True)
class Hits:
    """The places where rays end."""

    distance_mm: Floats  # distance [n], infinite without a hit
    normal: Floats  # unit normal [n, 3] towards the ray's side; against the ray without a hit
    target: Ints  # index of the target [n], -1 without a hit
    albedo: Floats  # factor of the map [n], 1 without a map or a hit


@dataclass(frozen=True)
class _Placed:
    """A shape at its place in the scene."""

    shape: Shape
    position: Floats  # origin of the shape [3]
    rotation: Floats | None  # [3, 3], None for none
    map: Map | None

    def local(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """Return rays in the target's frame."""
        moved = origin - self.position
        if self.rotation is None:
            return moved, direction
        return moved @ self.rotation, direction @ self.rotation

    def bounds(self) -> Floats:
        """Return low and high corner [2, 3] of a box around the target, mm."""
        extent = self.shape.extent
        if self.rotation is None:
            return extent + self.position
        # An axis that does not turn into another must not multiply its infinity by 0.
        turn = np.where(np.abs(self.rotation) < 1e-12, 0.0, self.rotation)
        with np.errstate(invalid="ignore"):
            ends = np.where(turn == 0.0, 0.0, turn * extent[:, None, :])  # [2, 3 out, 3 in]
        low, high = ends.min(axis=0).sum(axis=1), ends.max(axis=0).sum(axis=1)
        return np.stack([low, high]) + self.position


class World:
    """All targets of a scene."""

    def __init__(self, targets: Sequence[TargetSection], folder: Path):
        """Build the targets.

        Args:
            targets: Targets of the scene file; the index into them is the index in ``Hits.target``.
                There may be none.
            folder: Folder of the scene file, to which the paths of meshes and pictures are
                relative.

        Raises:
            InputError: if a mesh or a picture is not valid, or two targets have one name.
        """
        self.targets = tuple(targets)
        self.names = _names(self.targets)
        self._placed = tuple(
            _Placed(
                target.shape(folder),
                np.array(target.position_mm, np.float64),
                rotation(target.rotation_deg) if any(target.rotation_deg) else None,
                None if target.map is None else load_map(target.map, folder),
            )
            for target in self.targets
        )

    @property
    def meshed(self) -> Bools:
        """Return which targets are meshes [n]."""
        return np.array([isinstance(placed.shape, Caster) for placed in self._placed], np.bool_)

    @property
    def each_bounds(self) -> list[Floats]:
        """Return low and high corner [2, 3] of a box around each target, mm."""
        return [placed.bounds() for placed in self._placed]

    @property
    def bounds(self) -> Floats:
        """Return the corners of a box around all targets, mm [2, 3]; infinite if one is endless.

        The box may be somewhat larger than the targets. For an empty world it is inside out.
        """
        if not self._placed:
            return np.array([[np.inf] * 3, [-np.inf] * 3])
        each = np.stack(self.each_bounds)
        return np.stack([each[:, 0].min(axis=0), each[:, 1].max(axis=0)])

    def cast(self, origin: Floats, direction: Floats) -> Hits:
        """Return the first hit of each ray.

        A ray that starts on a surface does not meet it again within 1e-6 mm, on a mesh within 2e-6
        of its size.

        Args:
            origin: Start of each ray, mm [n, 3].
            direction: Unit vectors [n, 3].
        """
        n = len(origin)
        distance = np.full(n, np.inf)
        normal = -direction
        target = np.full(n, -1, np.int64)
        albedo = np.ones(n)
        for index, placed in enumerate(self._placed):
            start, toward = placed.local(origin, direction)
            met, facing = placed.shape.meet(start, toward)
            rows = np.flatnonzero(met < distance)
            if rows.size == 0:
                continue
            distance[rows], target[rows] = met[rows], index
            found = facing[rows]
            normal[rows] = found if placed.rotation is None else found @ placed.rotation.T
            if placed.map is None:
                albedo[rows] = 1.0
            else:
                point = start[rows] + met[rows, None] * toward[rows]
                albedo[rows] = placed.map.factor(point[:, 0], point[:, 1])
        away = dot(normal, direction) > 0.0
        normal[away] *= -1.0
        return Hits(distance, normal, target, albedo)

    def blocked(self, start: Floats, end: Floats) -> Bools:
        """Return whether a target stands between two points, both ends excluded.

        Args:
            start: First points, mm [n, 3].
            end: Second points, mm [n, 3].

        Returns:
            bool [n]; False where both points are the same.
        """
        gap = end - start
        length = np.sqrt(dot(gap, gap))
        direction = gap / np.where(length > 0.0, length, 1.0)[:, None]
        direction[length == 0.0] = (0.0, 0.0, 1.0)
        blocked = np.zeros(len(start), np.bool_)
        left = np.arange(len(start))
        for placed in self._placed:
            met, _ = placed.shape.meet(*placed.local(start[left], direction[left]))
            hit = met < length[left] - START
            blocked[left[hit]] = True
            left = left[~hit]
            if left.size == 0:
                break
        return blocked


def _names(targets: Sequence[TargetSection]) -> tuple[str, ...]:
    """Return the targets' names; nameless ones are called by their kind, numbered if many."""
    given = [target.name for target in targets if target.name is not None]
    for name, count in Counter(given).items():
        if count > 1:
            raise InputError(f"target {name}: {count} targets have this name")
    taken = set(given)
    kinds = Counter(target.kind for target in targets if target.name is None)
    names = []
    for target in targets:
        name = target.name or target.kind
        if target.name is None:
            number = 1
            while name in taken or (kinds[target.kind] > 1 and number == 1):
                name = f"{target.kind} {number}"
                number += 1
            taken.add(name)
        names.append(name)
    return tuple(names)
