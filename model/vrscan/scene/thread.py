"""A threaded rod with the basic profile of ISO 68-1: a closed mesh, and the exact helicoids.

The thread is right-handed about the x axis. In an axial section its flanks include 60 degrees, the
crest is P/8 wide, the root P/4, and the flanks are 5/8 H deep, H = sqrt(3)/2 P. The mesh only
tells which crest, flank or root a ray meets; Newton's method then moves the hit onto it.

It leaves out rounded roots and crests, tolerances, the run-out of the thread, chamfers and a head:
the rod ends in two flat faces.
"""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Floats, Ints
from vrscan.scene.meshes import Caster, welded
from vrscan.scene.shapes import dot

END = 4  # the part of the end faces; crest, falling flank, root and rising flank are 0 to 3
_BREAKS = np.array([0.0, 2.0, 7.0, 11.0]) / 16.0  # shares of the pitch at which crest .. rise begin
_WIDTH = np.array([2.0, 5.0, 4.0, 5.0]) / 16.0
_SLOPE = math.sqrt(3.0)  # slope of a flank: cot 30 degrees
_CHORD = 1e-3  # mm from a facet of the crest to the surface
_NEWTON = 4
_FAR = 0.5  # mm: a larger correction has left the surface
_CLOSE = 1e-9  # mm from the surface: converged,
_EXACT = 1e-12  # and as near as makes no difference


@dataclass(frozen=True)
class Thread:
    """The sizes of a thread, mm."""

    diameter: float  # outer diameter
    pitch: float
    length: float

    @property
    def depth(self) -> float:
        """Return the depth of the thread, mm: 5/8 H."""
        return 0.625 * math.sqrt(0.75) * self.pitch

    def radius(self, axial: Floats, angle: Floats) -> Floats:
        """Return the distance of the surface from the axis, mm.

        Args:
            axial: Position x along the axis, mm, any shape.
            angle: Angle about the axis, from y towards z, rad.
        """
        along = np.mod(axial - self.pitch * angle / (2.0 * math.pi), self.pitch)
        level = np.array([0.0, 0.0, -self.depth, -self.depth, 0.0])
        inwards = np.interp(along / self.pitch, np.append(_BREAKS, 1.0), level)
        return np.asarray(0.5 * self.diameter + inwards)

    def mesh(self) -> tuple[Floats, Ints, Ints]:
        """Return vertices [v, 3], faces [f, 3] and what each face is part of [f].

        Every vertex is on the exact surface; between them the facets stay within 1.5 um of it
        radially (4 um for the thickest thread on the thinnest rod, whose flanks are twisted most),
        but at the rim of both ends, where an edge may be off by a share of a facet.
        """
        outer, half = 0.5 * self.diameter, 0.5 * self.length
        columns = max(24, math.ceil(math.pi / math.acos(max(0.0, 1.0 - _CHORD / outer))))
        # The four breaks turn after turn, and one more of each beyond either end; the end's plane
        # then gathers these into a single point for each column.
        turns = np.arange(-math.ceil(half / self.pitch) - 2, math.ceil(half / self.pitch) + 2)
        start = ((turns[:, None] + _BREAKS) * self.pitch).ravel()
        angle = 2.0 * math.pi * np.arange(columns) / columns
        axial = start + self.pitch * angle[:, None] / (2.0 * math.pi)  # [columns, breaks]
        axial = np.clip(axial, -half, half)
        level = np.where(np.arange(start.size) % 4 < 2, outer, outer - self.depth)
        clipped = np.abs(axial) == half
        radius = np.where(clipped, self.radius(axial, angle[:, None]), level)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, None]
        points = np.concatenate([axial[:, :, None], radius[:, :, None] * ring], axis=2)
        vertices = np.concatenate([points.reshape(-1, 3), [[-half, 0.0, 0.0], [half, 0.0, 0.0]]])

        breaks = start.size
        column, row = np.meshgrid(np.arange(columns), np.arange(breaks), indexing="ij")
        # One turn later the same edge is one pitch farther: four breaks.
        wrapped = column + 1 == columns
        next_row = np.minimum(np.where(wrapped, row + 4, row), breaks - 1)
        here = column * breaks + row
        there = np.where(wrapped, 0, column + 1) * breaks + next_row
        a, b = here[:, :-1], here[:, 1:]
        c, d = there[:, :-1], there[:, 1:]
        side = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], axis=2)
        part = np.broadcast_to((row[:, :-1] % 4)[:, :, None], side.shape[:3])
        low = np.stack([np.full(columns, len(vertices) - 2), there[:, 0], here[:, 0]], -1)
        high = np.stack([np.full(columns, len(vertices) - 1), here[:, -1], there[:, -1]], -1)
        faces = np.concatenate([side.reshape(-1, 3), low, high])
        parts = np.concatenate([part.ravel(), np.full(2 * columns, END)])
        vertices, faces, kept = welded(vertices, faces)
        return vertices, faces, parts[kept]


@dataclass(frozen=True)
class _Exact:
    """The correction that moves hits of the mesh onto the thread's surface."""

    thread: Thread
    part: Ints  # part that each face belongs to [f]

    def _surface(self, point: Floats, part: Ints) -> tuple[Floats, Floats]:
        """Return F [m], 0 on the surface, and its gradient [m, 3]."""
        thread = self.thread
        x, y, z = point.T
        r = np.maximum(np.hypot(y, z), 1e-9)
        rising = np.array([0.0, -_SLOPE, 0.0, _SLOPE, 0.0])[part]
        wound = x / thread.pitch - np.arctan2(z, y) / (2.0 * math.pi)  # pitches
        middle = np.append(_BREAKS + 0.5 * _WIDTH, 0.0)[part]
        along = wound - middle
        along = thread.pitch * (along - np.round(along))
        outer = 0.5 * thread.diameter
        depth = np.array([0.0, 0.5, 1.0, 0.5, 0.0])[part] * thread.depth
        turn = rising * thread.pitch / (2.0 * math.pi * r)
        gradient = np.stack([-rising, (y - turn * z) / r, (z + turn * y) / r], axis=1)
        return r - (outer - depth + rising * along), gradient

    def __call__(
        self, origin: Floats, direction: Floats, distance: Floats, face: Ints
    ) -> tuple[Floats, Floats]:
        """See ``meshes.Refine``."""
        part = self.part[face]
        new = distance.copy()
        value, gradient = self._surface(origin + new[:, None] * direction, part)
        left = np.arange(len(new))
        for _ in range(_NEWTON):
            left = left[np.abs(value[left]) > _EXACT]
            if len(left) == 0:
                break
            rate = dot(gradient[left], direction[left])
            step = value[left] / np.where(np.abs(rate) < 1e-6, np.inf, rate)
            new[left] -= np.clip(step, -_FAR, _FAR)
            at = origin[left] + new[left, None] * direction[left]
            value[left], gradient[left] = self._surface(at, part[left])
        good = (np.abs(new - distance) < _FAR) & (np.abs(value) < _CLOSE) & (part != END)
        gradient[part == END] = (1.0, 0.0, 0.0)
        normal = gradient / np.sqrt(dot(gradient, gradient))[:, None]
        return np.where(good, new, distance), normal


def caster(thread: Thread) -> Caster:
    """Return the thread as a ``Shape``, exact to 1 um where a ray just grazes an edge."""
    vertices, faces, part = thread.mesh()
    return Caster(vertices, faces, _Exact(thread, part))
