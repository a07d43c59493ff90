"""Shapes in their own frame, and their intersections with rays in closed form. Lengths are mm.

All rays are computed at once, in float64. A hit counts only at a distance of ``START`` or more, so
a ray that leaves a surface does not meet it again at once. Edges are perfectly sharp and faces
perfectly smooth: roughness belongs to the material.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vrscan.data.arrays import Floats

START = 1e-6  # mm
_SEAM = 1e-9  # mm by which faces overlap, so that no ray slips between two of them
_TINY = 1e-30  # stands for a component of a direction that is 0
_ROOT_STEPS = 80  # steps of a root search; bisection alone would need 50


class Shape(Protocol):
    """Something that a ray can meet."""

    @property
    def extent(self) -> Floats:
        """Return the corners of a box around the shape [2, 3], infinite where it has no end."""

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """Return the distance along each ray to its first meeting with the shape, and the normal.

        Args:
            origin: Start of each ray [n, 3].
            direction: Unit vectors [n, 3].

        Returns:
            Distance [n], infinite where the ray misses, and unit normals [n, 3] of either sign
            (of any direction where it misses).
        """


def dot(a: Floats, b: Floats) -> Floats:
    """Return the scalar products of the rows [n]."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def slab(extent: Floats, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Return the distances at which rays enter and leave a box.

    A ray misses the box where the first distance is the larger.

    Args:
        extent: Low and high corner [2, 3], finite.
        origin: Start of each ray [n, 3].
        direction: Unit vectors [n, 3].
    """
    enter, leave = np.full(len(origin), -np.inf), np.full(len(origin), np.inf)
    for axis, (first, last) in enumerate(extent.T):  # numpy is slow along an axis of three
        start, step = origin[:, axis], direction[:, axis]
        inverse = 1.0 / np.where(np.abs(step) < _TINY, _TINY, step)
        low, high = (first - start) * inverse, (last - start) * inverse
        np.maximum(enter, np.minimum(low, high), out=enter)
        np.minimum(leave, np.maximum(low, high), out=leave)
    return enter, leave


def first_root(near: Floats, far: Floats, exists: np.ndarray) -> Floats:
    """Return the smaller of two distances that lies ahead, infinite where none does."""
    ahead = np.where(near > START, near, np.where(far > START, far, np.inf))
    return np.where(exists, ahead, np.inf)


@dataclass(frozen=True)
class Plane:
    """The plane z = 0 without end."""

    @property
    def extent(self) -> Floats:
        """See ``Shape``."""
        return np.array([[-np.inf, -np.inf, 0.0], [np.inf, np.inf, 0.0]])

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Shape``."""
        down = direction[:, 2]
        parallel = np.abs(down) < _TINY
        distance = -origin[:, 2] / np.where(parallel, 1.0, down)
        hit = ~parallel & (distance > START)
        normal = np.broadcast_to(np.array([0.0, 0.0, 1.0]), origin.shape)
        return np.where(hit, distance, np.inf), normal


@dataclass(frozen=True)
class Patches:
    """Rectangles, given by centre and two half edges, which are square to each other."""

    centre: Floats  # centres [k, 3]
    along: Floats  # half an edge [k, 3]
    across: Floats  # half the other edge [k, 3]

    @property
    def extent(self) -> Floats:
        """See ``Shape``."""
        reach = np.abs(self.along) + np.abs(self.across)
        return np.stack([(self.centre - reach).min(axis=0), (self.centre + reach).max(axis=0)])

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Shape``."""
        long, wide = np.linalg.norm(self.along, axis=1), np.linalg.norm(self.across, axis=1)
        u, v = self.along / long[:, None], self.across / wide[:, None]
        normal = np.cross(u, v)
        toward = normal @ direction.T  # [k, n], like all that follows
        parallel = np.abs(toward) < _TINY
        gap = dot(self.centre, normal)[:, None] - normal @ origin.T
        distance = gap / np.where(parallel, 1.0, toward)
        hit = ~parallel & (distance > START)
        for edge, half in ((u, long), (v, wide)):
            offset = edge @ origin.T - dot(self.centre, edge)[:, None]
            offset += distance * (edge @ direction.T)
            hit &= np.abs(offset) <= half[:, None] + _SEAM
        distance[~hit] = np.inf
        nearest = np.argmin(distance, axis=0)
        return distance[nearest, np.arange(len(origin))], normal[nearest]


@dataclass(frozen=True)
class Sphere:
    """A sphere about the origin."""

    radius: float

    @property
    def extent(self) -> Floats:
        """See ``Shape``."""
        return np.array([[-self.radius] * 3, [self.radius] * 3])

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Shape``."""
        middle = -dot(origin, direction)
        closest = origin + middle[:, None] * direction
        half = self.radius**2 - dot(closest, closest)
        root = np.sqrt(np.maximum(half, 0.0))
        distance = first_root(middle - root, middle + root, half >= 0.0)
        point = origin + np.where(np.isfinite(distance), distance, 0.0)[:, None] * direction
        length = np.sqrt(np.maximum(dot(point, point), _TINY))
        return distance, point / length[:, None]


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder about the y axis, its middle at the origin, closed by flat ends."""

    radius: float
    length: float  # may be infinite

    @property
    def extent(self) -> Floats:
        """See ``Shape``."""
        high = np.array([self.radius, 0.5 * self.length, self.radius])
        return np.stack([-high, high])

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Shape``."""
        o, d = origin[:, ::2], direction[:, ::2]
        square = dot(d, d)
        axial = square < _TINY
        safe = np.where(axial, 1.0, square)
        middle = -dot(o, d) / safe
        closest = o + middle[:, None] * d
        half = self.radius**2 - dot(closest, closest)
        root = np.sqrt(np.maximum(half, 0.0) / safe)
        # The ray is inside the endless cylinder from near to far, between the ends from low to
        # high: it is inside the solid where both hold.
        everywhere = axial & (dot(o, o) <= self.radius**2)
        near = np.where(axial, -np.inf, middle - root)
        far = np.where(axial, np.inf, middle + root)
        exists = np.where(axial, everywhere, half >= 0.0)
        down = direction[:, 1]
        slope = np.where(np.abs(down) < _TINY, _TINY, down)
        ends = 0.5 * self.length
        if np.isfinite(ends):
            low, high = (-ends - origin[:, 1]) / slope, (ends - origin[:, 1]) / slope
            low, high = np.minimum(low, high), np.maximum(low, high)
        else:
            low, high = np.full(len(o), -np.inf), np.full(len(o), np.inf)
        enter, leave = np.maximum(near, low), np.minimum(far, high)
        distance = first_root(enter, leave, exists & (enter <= leave))
        hit = np.isfinite(distance)
        distance = np.where(hit, distance, np.inf)
        on_end = (distance == low) | (distance == high)
        point = origin + np.where(hit, distance, 0.0)[:, None] * direction
        length = np.sqrt(np.maximum(dot(point[:, ::2], point[:, ::2]), _TINY))
        normal = np.zeros_like(origin)
        normal[:, ::2] = point[:, ::2] / length[:, None]
        normal[on_end] = (0.0, 1.0, 0.0)
        return distance, normal


@dataclass(frozen=True)
class Box:
    """A solid box about the origin."""

    size: tuple[float, float, float]

    @property
    def extent(self) -> Floats:
        """See ``Shape``."""
        half = 0.5 * np.array(self.size)
        return np.stack([-half, half])

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Shape``."""
        extent = self.extent
        enter, leave = slab(extent, origin, direction)
        distance = first_root(enter, leave, enter <= leave)
        hit = np.flatnonzero(np.isfinite(distance))
        point = origin[hit] + distance[hit, None] * direction[hit]
        face = np.argmin(np.abs(np.abs(point) - extent[1]), axis=1)  # the one the point is on
        normal = np.broadcast_to(np.eye(3)[0], origin.shape).copy()
        normal[hit] = np.eye(3)[face]
        return distance, normal


@dataclass(frozen=True)
class Relief:
    """A sheet z = a sin(2 pi x / period), seen from both sides, cut to a rectangle.

    Along a ray, the height above the sheet has its extremes where cos(2 pi x / period) =
    dz period / (2 pi a dx), one lowest point a period, and from one lowest point to the next it
    changes by the same amount. So the first period with a crossing is found by one division, and
    between a highest and a lowest point the crossing is the only one: none can be missed.
    """

    amplitude: float
    period: float
    size: tuple[float, float]

    @property
    def extent(self) -> Floats:
        """See ``Shape``."""
        high = np.array([0.5 * self.size[0], 0.5 * self.size[1], self.amplitude])
        return np.stack([-high, high])

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Shape``."""
        distance = np.full(len(origin), np.inf)
        slack = np.array([_SEAM, _SEAM, 1e-3 * self.amplitude + _SEAM])  # begins off the crests
        enter, leave = slab(self.extent + np.stack([-slack, slack]), origin, direction)
        enter = np.maximum(enter, START)
        rows = np.flatnonzero(enter < leave)
        if rows.size:
            distance[rows] = self._first(origin[rows], direction[rows], enter[rows], leave[rows])
        safe = np.where(np.isfinite(distance), distance, 0.0)
        wave = 2.0 * np.pi / self.period
        slope = self.amplitude * wave * np.cos(wave * (origin[:, 0] + safe * direction[:, 0]))
        normal = np.stack([-slope, np.zeros_like(slope), np.ones_like(slope)], axis=1)
        return distance, normal / np.sqrt(1.0 + np.square(slope))[:, None]

    def _first(self, origin: Floats, direction: Floats, enter: Floats, leave: Floats) -> Floats:
        wave, a = 2.0 * np.pi / self.period, self.amplitude
        x, z = origin[:, 0], origin[:, 2]
        dx, dz = direction[:, 0], direction[:, 2]

        def height(t: Floats) -> Floats:
            return np.asarray(z + t * dz - a * np.sin(wave * (x + t * dx)))

        side = np.where(height(enter) >= 0.0, 1.0, -1.0)

        steepest = a * wave * np.abs(dx)
        wavy = steepest > np.maximum(np.abs(dz), 1e-12)  # else the height only rises or only falls
        speed = np.where(wavy, wave * dx, 1.0)
        cosine = dz / np.where(wavy, a * wave * dx, 1.0)
        angle = side * np.arccos(np.clip(np.where(wavy, cosine, 1.0), -1.0, 1.0))
        turn = 2.0 * np.pi / np.abs(speed)
        # Lowest points (as seen from the ray's side) at angle, highest ones at -angle.
        lowest = enter + np.mod((angle - wave * x) / speed - enter, turn)
        gap = side * height(lowest)
        fall = -side * dz * turn  # change of the gap per period
        falling = wavy & (gap > 0.0) & (fall > _TINY)
        skip = np.where(falling, np.ceil(gap / np.where(falling, fall, 1.0)), 0.0)
        # Rounding may have skipped one period too few.
        short = side * height(lowest + skip * turn) > 0.0
        skip = np.where(falling & short, skip + 1.0, skip)
        reached = wavy & ((gap <= 0.0) | falling)
        end = np.where(reached, np.minimum(lowest + skip * turn, leave), leave)
        back = np.mod(end - (-angle - wave * x) / speed, turn)  # to the last highest point
        begin = np.where(wavy, np.maximum(enter, end - back), enter)
        crossed = side * height(end) <= 0.0

        low, high = begin, end
        t = 0.5 * (low + high)
        for _ in range(_ROOT_STEPS):
            value = side * height(t)
            low, high = np.where(value > 0.0, t, low), np.where(value > 0.0, high, t)
            rate = side * (dz - a * wave * dx * np.cos(wave * (x + t * dx)))
            step = t - value / np.where(rate < 0.0, rate, -1.0)
            inside = (rate < 0.0) & (step >= low) & (step <= high)
            new = np.where(inside, step, 0.5 * (low + high))
            moved = np.abs(np.where(crossed, new - t, 0.0)).max()
            t = new
            if moved < 1e-13 * (1.0 + float(np.abs(t).max())):
                break
        return np.where(crossed, t, np.inf)
