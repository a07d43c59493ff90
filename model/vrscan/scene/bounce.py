"""The second bounce: the light that the spot throws on the rest of what the camera sees.

Both reflections are Lambertian; a third reflection and the gloss of either are left out. Far from
the spot the light changes slowly with the angle and along the row: it is worked out at ``KNOTS``
angles and for the places of ``Light.view_px``, once for a scene. Within ``NEAR_PX`` of the spots of
a line and of the two angles around it, it changes faster than those are apart, and is that of the
line's own spot; within ``BESIDE_PX`` of that, it is worked out for each pixel.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.ideal.geometry import project
from vrscan.scene.beam import radius_mm
from vrscan.scene.image import Singles
from vrscan.scene.light import PAN_STEP_MM, VIEW_STEP, Light, View, Windows
from vrscan.scene.sensor import chunks
from vrscan.scene.shapes import dot
from vrscan.scene.spots import Camera
from vrscan.scene.sun import collection

KNOTS = 193
NEAR_PX = 64
BESIDE_PX = 32
_BESIDE_PLACES = 2  # on either side of a window, where light tells of light in it
_EDGE = 1.02  # range of the angles over the scan's amplitude
_TABLES = 48  # number of places of a panning scanner that are kept
_RAYS = 1 << 16  # rays followed at a time


@dataclass(frozen=True)
class _Spots:
    """Places where the beam's axis meets the scene, of n lines."""

    point: Floats  # in the scanner's frame, mm [n, 3]
    normal: Floats  # [n, 3]
    gain: Floats  # radiance over irradiance, 1/sr [n], 0 where nothing is met
    width_mm: Floats  # 1/e2 radius of the beam [n]
    position_px: Floats  # image [n], NaN where there is none
    meshed: Bools  # on a mesh, whose faces may be smaller than the places are apart [n]


def bounced(
    light: Light, angle_rad: Floats, y_mm: Floats, windows: Windows | None = None
) -> Singles:
    """Return the light that spots throw on the rest of the scene, [n, length] or [n, width].

    It is in units of the electrons that the whole beam would make if it went through the lens.

    Args:
        light: The scene.
        angle_rad: Angle of each line [n].
        y_mm: Position of the scanner along y [n].
        windows: What is wanted of each line; all of it if None.
    """
    limit = _limit(light)
    turned = np.clip((angle_rad + limit) / (2.0 * limit), 0.0, 1.0) * (KNOTS - 1)
    knot = np.minimum(turned.astype(np.int64), KNOTS - 2)
    share = (turned - knot).astype(np.float32)
    keys = np.round(y_mm / PAN_STEP_MM).astype(np.int64)
    length = light.config.sensor.line_length
    width = length if windows is None else windows.width
    start = np.zeros(len(angle_rad), np.int64) if windows is None else windows.first
    places = len(light.view_px)
    if windows is not None:
        places = min(places, width // VIEW_STEP + 2 * (1 + _BESIDE_PLACES))
    found = np.empty((len(angle_rad), width), np.float32)
    for key in np.unique(keys).tolist():
        rows, y = np.flatnonzero(keys == key), key * PAN_STEP_MM
        low, whole, marks = _table(light, key)
        before, more = knot[rows], share[rows]
        at = sliding_window_view(whole, width, axis=1)
        for part in chunks(len(rows), width):
            begin = start[rows[part]]
            first, behind = at[before[part], begin], at[before[part] + 1, begin]
            found[rows[part]] = first + (behind - first) * more[part, None]
        spots = _meet(light, angle_rad[rows], y)
        first_place = np.maximum(start[rows] // VIEW_STEP - _BESIDE_PLACES, 0)
        near = _near(spots.position_px, marks[before], marks[before + 1], first_place, places)
        near &= (first_place < low.shape[1] - np.arange(places)[:, None]).T
        line, at_place = np.nonzero(near)
        place = first_place[line] + at_place
        own = _thrown(light, spots, y, light.view_px, light.view(y), line, place)
        change = np.zeros(near.shape, np.float32)
        first = low[before[line], place]
        known = first + (low[before[line] + 1, place] - first) * more[line]
        change[line, at_place] = own - known
        changed = np.flatnonzero(change.any(axis=1))
        for part in chunks(len(changed), width):
            some = changed[part]
            if windows is None:
                found[rows[some]] += light.whole_row(change[some])
            else:
                begin = start[rows[some]] - VIEW_STEP * first_place[some]
                found[rows[some]] += Windows(begin, width).between(change[some])
        # Each pixel, if any place beside the spot has light, or if some may have it in between.
        beside = np.abs(light.view_px[place] - spots.position_px[line]) < BESIDE_PX + VIEW_STEP
        wanted = spots.meshed.copy()
        wanted[line[beside & (own > 0.0)]] = True
        line, pixel = _beside(spots.position_px, wanted, length)
        column = pixel - start[rows[line]]
        inside = (column >= 0) & (column < width)
        line, pixel, column = line[inside], pixel[inside], column[inside]
        seen, which = np.unique(pixel, return_inverse=True)
        at_px = seen.astype(np.float64)
        found[rows[line], column] = _thrown(
            light, spots, y, at_px, light.look(at_px, y), line, which
        )
    return found


def _limit(light: Light) -> float:
    """Return the largest of the angles at which the light is worked out once, rad."""
    scan, mirror = light.scene.scan, light.config.mirror
    return _EDGE * math.radians(
        scan.half_angle_deg if scan.sweep == "even" else mirror.amplitude_deg
    )


def _table(light: Light, key: int) -> tuple[Singles, Singles, Floats]:
    """Return the light at ``KNOTS`` angles, by place and by pixel, and where the spots are, px."""
    if key not in light.bounces:
        y = key * PAN_STEP_MM
        spots = _meet(light, np.linspace(-_limit(light), _limit(light), KNOTS), y)
        shape = KNOTS, len(light.view_px)
        every = np.indices(shape).reshape(2, -1)
        low = _thrown(light, spots, y, light.view_px, light.view(y), *every).reshape(shape)
        if len(light.bounces) >= _TABLES:
            light.bounces.clear()
        light.bounces[key] = low, light.whole_row(low), spots.position_px
    return light.bounces[key]


def _near(own: Floats, before: Floats, behind: Floats, first: Ints, places: int) -> Bools:
    """Return which of some places of each line are near one of three marks [k, places].

    Args:
        own: First marks, NaN for none [k].
        before: Second ones [k].
        behind: Third ones [k].
        first: First place of each line [k].
        places: Number of its places.
    """
    pixel = VIEW_STEP * (first[:, None] + np.arange(places, dtype=np.float64))
    near = np.zeros(pixel.shape, np.bool_)
    with np.errstate(invalid="ignore"):
        for mark in (own, before, behind):
            apart = pixel - mark[:, None]
            near |= (apart >= -NEAR_PX) & (apart < NEAR_PX)
    return near


def _beside(position_px: Floats, wanted: Bools, length: int) -> tuple[Ints, Ints]:
    """Return line and pixel of each pixel beside the spots of some lines [k]."""
    lines = np.flatnonzero(wanted & ~np.isnan(position_px))
    pixel = np.round(position_px[lines])[:, None] + np.arange(-BESIDE_PX, BESIDE_PX + 1)
    line, column = np.nonzero((pixel >= 0) & (pixel < length))
    return lines[line], pixel[line, column].astype(np.int64)


def _meet(light: Light, angle: Floats, y_mm: float) -> _Spots:
    """Return where the beam's axis meets the scene at some angles."""
    beam = np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
    hits = light.world.cast(np.zeros_like(beam) + np.array([0.0, y_mm, 0.0]), beam)
    lit = hits.target >= 0
    distance = np.where(lit, hits.distance_mm, 0.0)
    point = distance[:, None] * beam
    camera = Camera.of(light.config, light.scene.lens.f_number)
    front = lit & ((point - camera.place) @ camera.axis > 0.0)
    position = np.full(len(angle), np.nan)
    position[front] = project(point[front, 0], point[front, 2], light.config.geometry)
    gain = np.where(lit, light.diffuse(hits.target, hits.albedo), 0.0) / np.pi
    width = radius_mm(distance, light.scene.laser)
    meshed = lit & np.append(light.world.meshed, False)[hits.target]
    return _Spots(point, hits.normal, gain, width, position, meshed)


def _thrown(
    light: Light, spots: _Spots, y_mm: float, pixel: Floats, view: View, line: Ints, place: Ints
) -> Singles:
    """Return the light that spots throw on places [k].

    Args:
        light: The scene.
        spots: The spots of some lines.
        y_mm: Position of the scanner along y.
        pixel: Pixels of the places [m].
        view: What they see.
        line: Index of each pair's line [k].
        place: Index of each pair's place [k].
    """
    point, normal, target, albedo = view
    found = np.zeros(len(line), np.float32)
    pair = np.flatnonzero((spots.gain > 0.0)[line] & (target >= 0)[place])
    i, j = line[pair], place[pair]
    way = point[j] - spots.point[i]
    leave, arrive = dot(way, spots.normal[i]), -dot(way, normal[j])
    kept = np.flatnonzero((leave > 1e-9) & (arrive > 1e-9))
    pair, i, j = pair[kept], i[kept], j[kept]
    square = dot(way[kept], way[kept])
    lift = np.array([0.0, y_mm, 0.0])
    clear = np.zeros(len(i), np.bool_)
    for start in range(0, len(i), _RAYS):
        some = slice(start, start + _RAYS)
        clear[some] = ~light.world.blocked(spots.point[i[some]] + lift, point[j[some]] + lift)
    # The spot is not a point: nearer than its sigma its light does not grow any more.
    nearest = np.square(0.5 * spots.width_mm[i])
    form = clear * (leave * arrive)[kept] / square / (square + nearest)
    # In mm2, like the irradiance; the beam's electrons already include lens and filter.
    area = np.square(light.config.geometry.pitch_mm)
    seen_sr = collection(light.scene.lens.f_number, light.off_axis_rad(pixel))[j]
    again = light.diffuse(target[j], albedo[j]) / np.pi
    found[pair] = spots.gain[i] * form * again * area * seen_sr
    return found
