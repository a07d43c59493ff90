"""A sculpted head on a pedestal, made from formulae: the same closed mesh every time.

The sculpture is a smooth union of spheres, ellipsoids and bars, described by its distance. Every
horizontal line towards the vertical axis is followed inwards to the first point of the surface, so
each height is one ring of vertices, and the mesh is closed by construction. It has no undercut
within a horizontal section (hair behind the ears, locks that stand off), which a scanner that
looks from the front would hardly see.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vrscan.data.arrays import Floats, Ints

_Points = np.ndarray[tuple[int, ...], np.dtype[np.floating]]  # of either precision

HEIGHT = 300.0  # mm as shipped; described below at 293.5 mm: y up, the face looks along -z
_RINGS = 122
_COLUMNS = 240
_START = 130.0  # mm from the axis, outside the whole sculpture
_STEPS = 40
_RELAX = 0.85  # shortens the steps: a blended distance may be too long
_INNER = 0.5  # mm, least radius
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True)
class _Part:
    """An ellipsoid, or a bar with round ends where ``end`` is given; mm."""

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]
    end: tuple[float, float, float] | None = None
    blend: float = 4.0  # width of the seam with the parts before
    carve: bool = False  # whether the part is taken away

    @property
    def span(self) -> tuple[float, float]:
        """Return the lowest and highest y that the part can change."""
        y = (self.centre[1], self.centre[1] if self.end is None else self.end[1])
        reach = self.radii[1] + 2.0 * self.blend
        return min(y) - reach, max(y) + reach

    def distance(self, x: _Points, y: _Points, z: _Points) -> _Points:
        """Return the approximate distance of points outside the part, mm."""
        px, py, pz = x - self.centre[0], y - self.centre[1], z - self.centre[2]
        if self.end is not None:
            bar = [float(b - a) for a, b in zip(self.centre, self.end, strict=True)]
            square = sum(b * b for b in bar)
            share = np.clip((px * bar[0] + py * bar[1] + pz * bar[2]) / square, 0.0, 1.0)
            px, py, pz = px - share * bar[0], py - share * bar[1], pz - share * bar[2]
            return np.asarray(np.sqrt(px * px + py * py + pz * pz) - self.radii[0])
        a, b, c = self.radii
        if a == b == c:
            return np.asarray(np.sqrt(px * px + py * py + pz * pz) - a)
        near = np.sqrt((px / a) ** 2 + (py / b) ** 2 + (pz / c) ** 2)
        slope = np.sqrt((px / a**2) ** 2 + (py / b**2) ** 2 + (pz / c**2) ** 2)
        return np.asarray(near * (near - 1.0) / np.maximum(slope, 1e-9))


def _ball(x: float, y: float, z: float, r: float, blend: float = 4.0) -> _Part:
    return _Part((x, y, z), (r, r, r), None, blend)


def _pair(part: _Part) -> list[_Part]:
    """Return a part and its mirror image."""
    x, y, z = part.centre
    end = None if part.end is None else (-part.end[0], part.end[1], part.end[2])
    return [part, _Part((-x, y, z), part.radii, end, part.blend, part.carve)]


def _bar(
    start: tuple[float, float, float], end: tuple[float, float, float], r: float, blend: float
) -> _Part:
    return _Part(start, (r, r, r), end, blend)


def _body() -> list[_Part]:
    """Return pedestal, chest and neck."""
    return [
        _Part((0.0, 4.0, 4.0), (52.0, 9.0, 46.0), None, 2.0),
        _Part((0.0, 22.0, 4.0), (34.0, 30.0, 31.0), None, 8.0),
        _Part((0.0, 42.0, 4.0), (43.0, 6.0, 38.0), None, 3.0),
        _Part((0.0, 88.0, 6.0), (60.0, 44.0, 35.0), None, 6.0),
        *_pair(_Part((44.0, 104.0, 8.0), (36.0, 27.0, 28.0), None, 14.0)),
        *_pair(_Part((23.0, 88.0, -16.0), (26.0, 22.0, 16.0), None, 8.0)),
        _bar((0.0, 112.0, 10.0), (0.0, 176.0, 4.0), 28.0, 14.0),
        *_pair(_bar((24.0, 172.0, 6.0), (6.0, 122.0, -20.0), 6.0, 10.0)),
    ]


def _face() -> list[_Part]:
    """Return skull, jaw and features."""
    return [
        _Part((0.0, 236.0, 8.0), (42.0, 48.0, 52.0), None, 8.0),
        _Part((0.0, 206.0, -10.0), (34.0, 44.0, 37.0), None, 10.0),
        *_pair(_ball(24.0, 211.0, -28.0, 12.0, 8.0)),  # cheekbones
        *_pair(_bar((4.0, 238.0, -43.5), (27.0, 238.0, -31.0), 6.5, 6.0)),  # brow
        *_pair(_Part((16.5, 227.0, -48.0), (12.0, 8.0, 11.0), None, 4.0, carve=True)),
        *_pair(_ball(16.5, 226.5, -33.0, 8.5, 1.5)),  # eyes
        *_pair(_bar((9.5, 231.5, -41.0), (24.5, 230.5, -36.0), 1.9, 1.5)),  # upper lids
        *_pair(_bar((10.0, 221.0, -40.0), (24.0, 221.5, -36.0), 1.6, 1.5)),  # lower lids
        _bar((0.0, 236.0, -44.0), (0.0, 209.0, -60.0), 4.6, 5.0),  # nose
        _ball(0.0, 207.0, -59.0, 6.4, 3.0),
        *_pair(_Part((6.8, 205.5, -52.0), (4.6, 4.6, 6.0), None, 2.5)),
        _Part((0.0, 190.0, -42.0), (16.0, 11.0, 8.0), None, 6.0),  # mouth
        *_pair(_bar((1.5, 192.6, -50.2), (11.5, 189.6, -44.5), 2.6, 1.6)),
        _bar((-8.0, 186.0, -46.8), (8.0, 186.0, -46.8), 3.4, 1.6),
        *_pair(_Part((44.0, 219.0, 8.0), (7.5, 16.0, 10.0), None, 3.0)),  # ears
        *_pair(_Part((51.0, 220.0, 7.0), (4.0, 9.0, 5.0), None, 2.0, carve=True)),
        *_pair(_ball(45.5, 206.0, 4.0, 4.5, 2.0)),
        _Part((0.0, 167.0, -32.0), (24.0, 24.0, 18.0), None, 8.0),  # beard
        _Part((0.0, 148.0, -34.0), (14.0, 20.0, 12.0), None, 8.0),
        *_pair(_bar((30.0, 204.0, -12.0), (20.0, 176.0, -28.0), 9.0, 6.0)),
        *_pair(_bar((3.0, 197.5, -49.0), (15.0, 192.0, -46.0), 3.6, 2.0)),  # moustache
        *_pair(_bar((15.0, 192.0, -46.0), (23.0, 178.0, -42.0), 3.2, 2.0)),
    ]


def _curls() -> list[_Part]:
    """Return locks over beard and hair, spread by the golden angle."""
    parts = []
    for k in range(38):  # the beard, as seen from the front
        turn, out = k * _GOLDEN, math.sqrt((k + 0.5) / 38.0)
        x, y = 25.0 * out * math.cos(turn), 158.0 + 25.0 * out * math.sin(turn)
        if abs(x) < 10.0 and y > 179.0:
            continue  # the lower lip
        depth = -51.0 + 16.0 * out**2 + 0.1 * (158.0 - y)
        parts.append(_ball(x * (1.0 - 0.012 * max(0.0, 150.0 - y)), y, depth, 5.6, 1.8))
    for k in range(6):  # whiskers, from the ears down to the beard
        x, y, z = 35.5 - 2.1 * k, 207.0 - 6.2 * k, -9.0 - 4.6 * k
        parts += _pair(_ball(x, y, z, 6.2, 2.0))
        parts += _pair(_ball(x - 1.5, y - 7.0, z + 7.0, 6.0, 2.0))
    for k in range(150):  # the hair: a sphere of points, stretched over the skull
        up = 1.0 - (k + 0.5) / 75.0
        turn, out = k * _GOLDEN, math.sqrt(1.0 - up * up)
        x, z = out * math.cos(turn), out * math.sin(turn)
        face = z < -0.1 and up < 0.42 - 0.35 * abs(x)
        ear = abs(x) > 0.72 and -0.68 < up < 0.05 and z < 0.5
        if face or ear or up < -0.8:
            continue
        size = 8.2 + 1.6 * math.sin(7.0 * turn)
        parts.append(_ball(43.0 * x, 238.0 + 48.0 * up, 9.0 + 51.0 * z, size, 2.2))
    return parts


def _distance(parts: list[_Part], x: _Points, y: _Points, z: _Points) -> _Points:
    """Return the approximate distance of points outside the sculpture, mm.

    Rows [h, n] share a y [h, 1].
    """
    total = np.full(x.shape, 1e3, x.dtype)
    for part in parts:
        low, high = part.span
        first, last = np.searchsorted(y[:, 0], (low, high))
        if first == last:
            continue
        old = total[first:last]
        one = part.distance(x[first:last], y[first:last], z[first:last])
        sign = -1.0 if part.carve else 1.0
        # Polynomial smooth minimum; carving is the same of the outside.
        share = np.clip(0.5 + 0.5 * (sign * old - one) / part.blend, 0.0, 1.0)
        seam = share * one + (1.0 - share) * sign * old - part.blend * share * (1.0 - share)
        total[first:last] = sign * seam
    return total


def _radius(parts: list[_Part], y: Floats, angle: Floats) -> Floats:
    """Return the distance of the outermost surface from the axis, mm [h, n].

    Args:
        parts: The parts of the sculpture.
        y: Rising heights, mm [h].
        angle: Angles about the axis, rad [n].
    """
    # Single precision, an error of some 1e-5 mm here, halves the time.
    height = y[:, None].astype(np.float32)
    sine, cosine = np.sin(angle).astype(np.float32), np.cos(angle).astype(np.float32)
    r = np.full((y.size, angle.size), _START, np.float32)
    for _ in range(_STEPS):
        gap = _distance(parts, r * sine, height, -r * cosine)
        r = np.maximum(r - _RELAX * gap, _INNER)
        if np.abs(gap[r > _INNER]).max(initial=0.0) < 0.02:
            break
    return r.astype(np.float64)


@lru_cache(maxsize=4)
def bust(height_mm: float = HEIGHT) -> tuple[Floats, Ints]:
    """Return the bust as a closed mesh; the arrays are shared and read-only.

    Args:
        height_mm: Height from the pedestal's foot to the hair.

    Returns:
        Vertices, mm [v, 3]: y is up, the face looks along -z, the origin is on the axis at half
        height. Faces [f, 3], some 59,000.

    Raises:
        ValueError: if the height is not positive.
    """
    if height_mm <= 0.0:
        raise ValueError(f"bust: a height of {height_mm} mm is not positive")
    parts = _body() + _face() + _curls()
    # Rings are spread evenly along the mean contour, so that level parts get their share.
    coarse = np.concatenate([np.arange(0.0, 288.0, 3.0), np.arange(288.0, 300.0, 0.25)])
    contour = _radius(parts, coarse, np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False))
    solid = contour.max(axis=1) > _INNER
    coarse, contour = coarse[solid], contour[solid]
    step = np.hypot(np.diff(coarse), np.abs(np.diff(contour, axis=0)).mean(axis=1))
    step *= np.where(coarse[1:] > 175.0, 1.6, 1.0)  # the head gets more of them
    along = np.concatenate([[0.0], np.cumsum(step)])
    y = np.interp(np.linspace(0.0, along[-1], _RINGS), along, coarse)
    # Columns are twice as close in front as behind.
    turn = 2.0 * math.pi * np.arange(_COLUMNS) / _COLUMNS
    angle = turn - 0.33 * np.sin(turn)
    r = _radius(parts, y, angle)

    points = np.stack(
        [r * np.sin(angle), np.broadcast_to(y[:, None], r.shape), -r * np.cos(angle)], axis=-1
    )
    foot, top = len(points) * _COLUMNS, len(points) * _COLUMNS + 1
    ends = np.array([[0.0, y[0], 0.0], [0.0, y[-1], 0.0]])
    vertices = np.concatenate([points.reshape(-1, 3), ends])
    ring, column = np.meshgrid(np.arange(_RINGS), np.arange(_COLUMNS), indexing="ij")
    here = ring * _COLUMNS + column
    aside = ring * _COLUMNS + (column + 1) % _COLUMNS
    a, b, c, d = here[:-1], aside[:-1], here[1:], aside[1:]
    side = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], axis=2).reshape(-1, 3)
    low = np.stack([np.full(_COLUMNS, foot), here[0], aside[0]], -1)
    high = np.stack([np.full(_COLUMNS, top), aside[-1], here[-1]], -1)
    faces = np.concatenate([side, low, high])
    vertices[:, 1] -= 0.5 * (y[0] + y[-1])
    vertices *= height_mm / (y[-1] - y[0])
    vertices.flags.writeable = faces.flags.writeable = False
    return vertices, faces
