"""Surfaces in the scan plane and where rays meet them. Lengths are mm, points are (x, z)."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vrscan.arrays import Floats, Ints

_START = 1e-6  # mm: a ray that leaves a surface does not meet it again at once


class Surface(Protocol):
    """Something that a ray can meet."""

    @property
    def name(self) -> str:
        """The object it belongs to."""

    @property
    def reflectance(self) -> float:
        """Share of the light that it scatters (Lambert)."""

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """Return how far along each ray the surface is, and the normal there.

        Args:
            origin: Start of each ray [n, 2].
            direction: Unit vectors [n, 2].

        Returns:
            Distance in mm [n], infinite where the ray misses, and unit normals [n, 2] of either
            sign.
        """


@dataclass(frozen=True)
class Segment:
    """A flat face between two points."""

    name: str
    reflectance: float
    start: tuple[float, float]
    end: tuple[float, float]

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Surface``."""
        start, end = np.array(self.start), np.array(self.end)
        along = end - start
        gap = start - origin
        cross = direction[:, 0] * along[1] - direction[:, 1] * along[0]
        parallel = cross == 0.0
        safe = np.where(parallel, 1.0, cross)
        distance = (gap[:, 0] * along[1] - gap[:, 1] * along[0]) / safe
        share = (gap[:, 0] * direction[:, 1] - gap[:, 1] * direction[:, 0]) / safe
        hit = ~parallel & (distance > _START) & (share >= 0.0) & (share <= 1.0)
        normal = np.array([-along[1], along[0]]) / np.hypot(*along)
        return np.where(hit, distance, np.inf), np.broadcast_to(normal, origin.shape)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder across the scan plane: a circle in it."""

    name: str
    reflectance: float
    centre: tuple[float, float]
    radius: float

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``Surface``."""
        gap = np.array(self.centre) - origin
        middle = (gap * direction).sum(axis=1)
        half = self.radius**2 - (np.square(gap).sum(axis=1) - np.square(middle))
        distance = middle - np.sqrt(np.maximum(half, 0.0))
        hit = (half >= 0.0) & (distance > _START)
        distance = np.where(hit, distance, np.inf)
        point = origin + np.where(hit, distance, 0.0)[:, None] * direction
        return distance, (point - self.centre) / self.radius


def first_hit(
    surfaces: tuple[Surface, ...], origin: Floats, direction: Floats
) -> tuple[Floats, Floats, Ints]:
    """Return the nearest surface on each ray.

    Args:
        surfaces: At least one.
        origin: Start of each ray [n, 2].
        direction: Unit vectors [n, 2].

    Returns:
        Distance in mm [n], infinite without a hit; the cosine between ray and normal [n], 0
        without a hit; the surface's index [n], -1 without a hit.
    """
    met = [surface.meet(origin, direction) for surface in surfaces]
    distances = np.stack([distance for distance, _ in met])
    nearest = np.argmin(distances, axis=0)
    rows = np.arange(len(origin))
    distance = distances[nearest, rows]
    normal = np.stack([normal for _, normal in met])[nearest, rows]
    hit = np.isfinite(distance)
    cosine = np.where(hit, np.abs((normal * direction).sum(axis=1)), 0.0)
    return distance, cosine, np.where(hit, nearest, -1).astype(np.int64)
