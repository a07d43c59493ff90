"""From the beam to the row: the spots of a line, and their place, brightness and blur on the row.

A spot lies on its surface's tangent plane. Where that does not describe it (edges, shadows,
curvature, patterns), it is followed ray by ray and may end on two surfaces.
"""

import functools
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.errors import blamed
from vrscan.ideal.scanning import scan_rate
from vrscan.scene import image
from vrscan.scene.beam import cut, output_mw, pulse_rms_s, radius_mm, zone
from vrscan.scene.image import Clock
from vrscan.scene.legendre import legendre
from vrscan.scene.light import Light
from vrscan.scene.mirrored import Mirrors
from vrscan.scene.radiometry import photoelectrons
from vrscan.scene.row_profile import gaussian_cumulated
from vrscan.scene.shapes import slab
from vrscan.scene.spots import OFF_SENSOR_PX, Spots, meet
from vrscan.scene.timeline import Timeline

RAYS = 33  # across a spot that is followed part by part,
OUTER = 8  # and how many of these on either side are for a cut beam's rings
_TEST = 1.5  # 1/e2 radii from the axis of the rays that test whether a spot needs them
_MAP_STEP = 2e-4  # rad between the angles of that test: a fifth of a beam
_TEST_CUT = 2.2  # and those of rays that look for other surfaces in a cut beam's rings,
_TEST_FAR = 4.7  # and in the last ones, where they count if they are brighter or bent
_BENT_PX = 1.0  # distance of a ring's image from the tangent plane's that tells of another plane
_FEW_TELL_PX = 5e-3  # tolerance below which not these few but all rays tell,
_FLAT = 0.1  # and by how many px per 1/e2 radius their images may be off the plane's
_BRIGHT = 2.0  # ratio of brightness at the sides and at the axis that tells of an edge
# 1/e2 radii of the rays of a Gaussian beam, beyond which 3e-5 of its light is, and of a cut beam,
# whose rings reach farther; and those of the rays that tell whether a spot is on a smooth surface.
_RAYS_GAUSSIAN = np.linspace(-2.0, 2.0, RAYS)
_RAYS_CUT = np.concatenate(
    [
        np.linspace(-4.7, -1.9, OUTER),
        np.linspace(-1.6, 1.6, RAYS - 2 * OUTER),
        np.linspace(1.9, 4.7, OUTER),
    ]
)
_DENSE_GAUSSIAN, _DENSE_CUT = 2.0, 1.6  # how far the rays are close together
_FEW = np.linspace(-2.0, 2.0, 5)
_FEW_CUT = np.concatenate([_RAYS_CUT[:1], _FEW, _RAYS_CUT[-1:]])
_TORN, _TORN_PX = 3.0, 0.5  # a jump of the image between rays, in expected steps and px
_SECTIONS = 6  # parts into which the way between two rays is cut to find an edge,
_ROUNDS = 2  # and the number of such cuts: to 1/36
WIDEST_PX = 250.0  # largest sigma of a spot: light along a surface is spread no farther
_LEAP = 1.5  # a jump of the light between rays: an edge of reflectance
_FAINT = 1e-3  # least share of a spot's light beside an edge that is worth the search for its place
_SHARPEN = 0.5  # px of defocus radius above which parts of a spot are blurred separately
_SMOOTH_PX = 0.1  # largest deviation of a smooth surface's images from a parabola within 2 radii
_SMOOTH_LIGHT = 0.02  # and of their light, over the middle one's
_LEAST_E = 0.5  # least light of a mirrored spot on the row that is rendered, electrons


@dataclass
class Pieces:
    """m pieces of light on the row."""

    row: Ints  # line within the block [m]
    place_px: Floats
    electrons: Floats  # light on the row
    whole_e: Floats  # electrons of all its light, on the row or not
    sigma_px: Floats  # sigma along the row, of all rays together
    radius_px: Floats  # radius of the defocused disc
    height_px: Floats  # sigma across the row
    speed_px: Floats  # distance that it moves in the pulse
    coma_px: Floats
    surface: Ints
    range_mm: Floats
    speckled: bool = True
    zone: Floats | None = None  # of a cut beam's distance, None for a Gaussian
    parts_px: Floats | None = None  # places of a spot's rays [m, RAYS]
    share: Floats | None = None  # share of the light of each ray [m, RAYS]
    cell_px: Floats | None = None  # image of a ray's cell, in the middle and in the rings [m, 2]
    beneath: Floats | None = None  # of light from beneath a surface, as ``image.profiles`` has it

    def __len__(self) -> int:
        return len(self.row)

    def of(self, rows: Ints | Bools) -> "Pieces":
        """Return some of the pieces."""
        chosen: dict[str, Any] = {
            name: value[rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return replace(self, **chosen)


class Spotter:
    """Finder of the spots of lines, with the effects ``active``.

    ``electrons`` is what the whole beam would make if it went through the lens.
    """

    def __init__(
        self,
        light: Light,
        active: frozenset[str],
        clock: Clock,
        *,
        tolerance_px: float,
    ) -> None:
        """Prepare what depends only on the effects.

        Args:
            light: The scene.
            active: Names of the effects that are on.
            clock: Function that is called with the name of an effect and returns a context that
                measures its time.
            tolerance_px: Largest error of a tangent plane; where it is larger, a spot is followed
                ray by ray. With 0 all spots are.
        """
        self.light, self.active, self.clock = light, active, clock
        self.tolerance_px = tolerance_px
        scene, config = light.scene, light.config
        laser = scene.laser
        if "truncation" not in active:
            laser = laser.model_copy(update={"aperture_mm": float("inf")})
        self._laser, self.cut = laser, cut(laser)
        self._rim_mm = 0.5 * laser.aperture_mm
        self._offset = _RAYS_GAUSSIAN if self.cut is None else _RAYS_CUT
        self._dense = _DENSE_GAUSSIAN if self.cut is None else _DENSE_CUT
        # A box as long as the pulse, of the same variance, over which the beam turns.
        self._box_s = 1e-6 * config.line.pulse_us
        if "smear" in active:
            with blamed(scene.source):
                self._box_s = math.sqrt(12.0) * pulse_rms_s(laser, self._box_s)
        # Windows of a spot on its plane reach as far as its rays would where these would all tell.
        rings = self.cut is not None and tolerance_px < _FEW_TELL_PX
        self.ring_reach = 2.0 * float(_RAYS_CUT[-1]) / image.REACH if rings else 1.0
        # No corner of the box is twice as far as any of its coordinates, so no ray that meets a
        # target is twice as far from the axis as there.
        widest = max(float(self._offset.max()), _TEST_FAR)
        self._room = 2.0 * max(widest * radius_mm(np.array([0.0, light.farthest_mm]), laser))
        self._few = _FEW if self.cut is None else _FEW_CUT
        self._blend, self._misses = _matrices(self.cut is not None)
        self._pulse_s = 1e-6 * config.line.pulse_us
        self._mirrors = Mirrors(light, falloff="falloff" in active)
        pupil = scene.lens.transmission * scene.lens.filter_transmission
        if "dust" in active:
            pupil *= 1.0 - light.obscured
        # What is scattered is lost to the spot, whether its own place is worked out or not.
        pupil *= (1.0 - light.scatter.total) * (1.0 - light.emitter.total)
        efficiency = scene.sensor.quantum_efficiency * pupil
        power_w = 1e-3 * output_mw(laser)
        found = photoelectrons(power_w, self._pulse_s, efficiency, laser.wavelength_nm)
        self.electrons = float(found)

    def find(self, timeline: Timeline) -> tuple[Spots, list[Pieces], list[Pieces]]:
        """Return the spots of the beam's axis, their pieces, and pieces of second beams."""
        count, angle = len(timeline), timeline.angle_rad
        # A mirror's largest rate tells everywhere where rays are needed, so that one map of angles
        # serves all lines; an even sweep has one rate.
        if self.light.scene.scan.sweep == "even":
            self._rate = float(np.abs(timeline.rate_rad_per_s).max(initial=0.0))
        else:
            self._rate = scan_rate(self.light.config.mirror)
        beam = np.stack([np.sin(angle), np.zeros(count), np.cos(angle)], axis=1)
        spots = self._meet(np.zeros((count, 3)), beam, timeline.y_mm)
        pieces = self._whole(spots, timeline, np.arange(count))
        if "footprint" in self.active:
            with self.clock("footprint"):
                split, shift_px = self._split(spots, beam, timeline)
                flat = [each.of(~split[each.row]) for each in pieces]
                pieces = [replace(p, place_px=p.place_px + shift_px[p.row]) for p in flat]
                if split.any():
                    pieces += self._by_rays(spots, beam, timeline, np.flatnonzero(split))
        if "mirrored" in self.active:
            with self.clock("mirrored"):
                pieces += self._mirrored(beam, timeline)
        second: list[Pieces] = []
        if "window" in self.active:
            with self.clock("window"):
                second += self._window_ghost(timeline)
        return spots, pieces, second

    def _meet(self, origin: Floats, direction: Floats, y_mm: Floats) -> Spots:
        light = self.light
        return meet(
            light.world,
            light.materials,
            light.scene,
            light.config,
            origin,
            direction,
            y_mm,
            gloss="gloss" in self.active,
            falloff="falloff" in self.active,
            subsurface="subsurface" in self.active,
        )

    def _blur(self, depth: Floats, place: Floats) -> tuple[Floats, Floats]:
        """Return the radius of the disc and the length of the coma, px."""
        light = self.light
        lens, config = light.scene.lens, light.config
        radius = np.zeros(len(depth))
        if "defocus" in self.active:
            radius = image.defocus_radius_px(depth, lens.focus_mm, lens.f_number, config)
        coma = np.zeros(len(depth))
        if "coma" in self.active:
            half = 0.5 * config.sensor.line_length
            # Away from the axis on either side of it.
            coma = lens.coma_px * np.clip((place - config.geometry.centre_px) / half, -2.0, 2.0)
        return radius, coma

    def _height(self, width_mm: Floats, depth: Floats) -> Floats:
        """Return the spot's sigma across the row, px."""
        geometry = self.light.config.geometry
        return np.asarray(0.5 * width_mm * geometry.focal_mm / geometry.pitch_mm / depth)

    def _zone(self, distance_mm: Floats) -> Floats | None:
        """Return the zone of a cut beam, None of a Gaussian one."""
        return None if self.cut is None else zone(distance_mm, self._laser)

    def _beneath(self, pieces: Pieces, tail_px: Floats, spread_px: Floats) -> Pieces:
        """Return pieces of light from beneath surfaces, from those of spots with all of its light.

        Args:
            pieces: The spots, m of them.
            tail_px: Mean distance of that light's image from the spot's [m].
            spread_px: Scales of its spread along and across the row [m, 2].
        """
        high = image.beneath_height(pieces.height_px, pieces.radius_px, spread_px[:, 1])
        return replace(
            pieces,
            place_px=pieces.place_px + tail_px,
            electrons=pieces.electrons * image.beneath_share(high),
            # Its speckle is another one than the surface's.
            surface=pieces.surface + len(self.light.materials),
            beneath=np.stack([tail_px, spread_px[:, 0], high], axis=1),
        )

    def _whole(self, spots: Spots, timeline: Timeline, rows: Ints) -> list[Pieces]:
        """Return the spots of some lines, each on its tangent plane, and light from beneath it."""
        rows = rows[spots.seen[rows] & (spots.collected[rows] > 0.0)]
        width = radius_mm(spots.distance[rows], self._laser)
        place, depth = spots.position_px[rows], spots.depth[rows]
        height = self._height(width, depth)
        radius, coma = self._blur(depth, place)
        near = self._zone(spots.distance[rows])
        offset = self.light.scene.lens.row_offset_px
        share = image.row_share(height, radius, offset, cut=self.cut, zone=near)
        speed = spots.px_per_mm[rows] * spots.distance[rows] * timeline.rate_rad_per_s[rows]
        whole = self.electrons * spots.collected[rows]
        found = Pieces(
            row=rows,
            place_px=place,
            electrons=whole * share,
            whole_e=whole,
            sigma_px=np.minimum(0.5 * width * np.abs(spots.px_per_mm[rows]), WIDEST_PX),
            radius_px=radius,
            height_px=height,
            speed_px=self._speed(speed),
            coma_px=coma,
            surface=spots.target[rows],
            range_mm=depth,
            zone=near,
        )
        below = spots.beneath[rows]
        if not below[:, 0].any():
            return [found]
        upper, lower = (
            replace(found, electrons=part * found.electrons, whole_e=part * found.whole_e)
            for part in (1.0 - below[:, 0], below[:, 0])
        )
        some = np.flatnonzero(below[:, 0])
        return [upper, self._beneath(lower.of(some), below[some, 1], below[some, 2:])]

    def _speed(self, px_per_s: Floats) -> Floats:
        if "smear" not in self.active:
            return np.zeros(len(px_per_s))
        return np.minimum(np.abs(px_per_s) * self._pulse_s, 4.0 * WIDEST_PX)

    def _moved(self, distance: Floats, rate: Floats | None = None) -> Floats:
        """Return how far the beam moves on surfaces in a pulse, in its 1/e2 radii [n].

        Args:
            distance: Finite distances of the surfaces [n].
            rate: Rates of the beam [n]; the scan's largest if None.
        """
        if "smear" not in self.active:
            return np.zeros(len(distance))
        turned = self._box_s * (self._rate if rate is None else np.abs(rate))
        return np.asarray(turned * distance / radius_mm(distance, self._laser))

    def _stretch(self, moved: Floats) -> Floats:
        """Return the factor of rays' offsets with which they reach as far as a moving beam [n]."""
        return np.asarray(1.0 + 0.5 * moved / self._dense)

    def _offset_rays(
        self, spots: Spots, beam: Floats, rows: Ints, offset: Floats
    ) -> tuple[Floats, Floats]:
        """Return rays of the beam's cross-section, which follow its width from pivot to spot.

        Those of a cut beam's rings come from the stop's rim.

        Args:
            spots: Spots of the axis.
            beam: Axes of the beam [n, 3].
            rows: Indices of the lines [m].
            offset: Offsets from the axis in 1/e2 radii, [k], or [m, k] for each line.

        Returns:
            Origins and directions [m * k, 3].
        """
        missed = ~spots.lit[rows]
        far = np.where(missed, self.light.farthest_mm, spots.distance[rows])
        start = radius_mm(np.zeros(1), self._laser)[0]
        end = radius_mm(far, self._laser)
        axis = beam[rows]
        across = np.stack([axis[:, 2], np.zeros(len(rows)), -axis[:, 0]], axis=1)
        offset = np.atleast_2d(offset)
        begin = np.clip(start * offset, -self._rim_mm, self._rim_mm)
        origin = begin[:, :, None] * across[:, None, :]
        lean = (end[:, None] * offset - begin) / far[:, None]
        direction = axis[:, None, :] + lean[:, :, None] * across[:, None, :]
        direction /= np.sqrt(1.0 + np.square(lean))[:, :, None]
        return origin.reshape(-1, 3), direction.reshape(-1, 3)

    def _split(self, spots: Spots, beam: Floats, timeline: Timeline) -> tuple[Bools, Floats]:
        """Return the lines whose spots are followed ray by ray, and the others' shifts, px [n]."""
        if self.tolerance_px == 0.0:
            return self._in_sight(spots, beam, timeline.y_mm), np.zeros(len(timeline))
        if self.light.scene.scan.pan_mm_per_s != 0.0:
            return self._needs_rays(spots, beam, timeline.y_mm)
        # A scanner that stands still sees the same at the same angle: one map serves all lines.
        start, split, shift_px = self._split_map()
        turned = (timeline.angle_rad - start) / _MAP_STEP
        knot = np.clip(turned.astype(np.int64), 0, len(split) - 2)
        near = shift_px[knot] + (shift_px[knot + 1] - shift_px[knot]) * (turned - knot)
        return split[knot] | split[knot + 1], near

    def _in_sight(self, spots: Spots, beam: Floats, y_mm: Floats) -> Bools:
        """Return the lines of which some ray may be seen.

        Those whose spot is far beside the sensor have none, nor those whose beam with its widest
        rays passes the box around all targets.
        """
        middle = 0.5 * self.light.config.sensor.line_length
        with np.errstate(invalid="ignore"):
            off_sensor = np.abs(spots.position_px - middle) > middle + OFF_SENSOR_PX
        drawn = ~(off_sensor & spots.lit)
        room = self._room * float(self._stretch(self._moved(np.array([self.light.farthest_mm])))[0])
        box = self.light.world.bounds + np.array([[-room], [room]])
        if np.isfinite(box).all():
            start = np.stack([np.zeros(len(y_mm)), y_mm, np.zeros(len(y_mm))], axis=1)
            enter, leave = slab(box, start, beam)
            drawn &= spots.lit | ((enter <= leave) & (leave > 0.0))
        return drawn

    def _split_map(self) -> tuple[float, Bools, Floats]:
        """Return the map's first angle, and what ``_needs_rays`` gives at each of its angles."""
        light = self.light
        seen = self.active & {"truncation", "gloss", "falloff", "smear"}
        key = self.tolerance_px, seen, self._rate
        if key not in light.split_maps:
            scan, mirror = light.scene.scan, light.config.mirror
            reach = 1.05 * mirror.amplitude_deg if scan.sweep == "mirror" else scan.half_angle_deg
            half = np.radians(reach)
            angle = -half + _MAP_STEP * np.arange(int(2.0 * half / _MAP_STEP) + 2)
            beam = np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
            still = np.zeros(len(angle))
            spots = self._meet(np.zeros_like(beam), beam, still)
            light.split_maps[key] = -half, *self._needs_rays(spots, beam, still)
        return light.split_maps[key]

    def _needs_rays(self, spots: Spots, beam: Floats, y_mm: Floats) -> tuple[Bools, Floats]:
        """Return the lines whose spot a tangent plane does not describe, and the others' shifts.

        Two rays three sigma either side of the axis tell: an edge or a shadow between them, beyond
        which there is 0.1 % of a Gaussian beam's light; curvature, by which the image's mean moves
        by a ninth of their common deviation; or reflectance that changes across the spot. Where
        either of these two moves it by the tolerance at most, the spot on its plane is shifted by
        as much, px [n].
        A cut beam's rings are looked after by ``_rings_need_rays``. With a narrow tolerance all
        rays tell.
        """
        split = np.zeros(len(spots.lit), np.bool_)
        shift_px = np.zeros(len(split))
        rows = np.flatnonzero(self._in_sight(spots, beam, y_mm))
        limit = self.tolerance_px
        distance = np.where(spots.lit, spots.distance, self.light.farthest_mm)[rows]
        moved = self._moved(distance)
        test = self._stretch(moved) * _TEST
        both = test[:, None] * np.array([-1.0, 1.0])
        origin, direction = self._offset_rays(spots, beam, rows, both)
        # Of the light's variance about the axis, over four times that at the two rays.
        spread = (1.0 + np.square(moved) / 3.0) / np.square(2.0 * test)
        sides = self._meet(origin, direction, np.repeat(y_mm[rows], 2))
        seen = sides.seen.reshape(-1, 2)
        axis = spots.seen[rows]
        edge = (seen != axis[:, None]).any(axis=1)
        other = (sides.target.reshape(-1, 2) != spots.target[rows, None]).any(axis=1)
        edge |= other & seen.any(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            place = sides.position_px.reshape(-1, 2)
            distance = np.where(spots.lit, spots.distance, 0.0)[rows]
            width = radius_mm(distance, self._laser)
            step = np.diff(place, axis=1)[:, 0]
            sag = (place.mean(axis=1) - spots.position_px[rows]) * spread
            size = np.abs(step)
            bent = np.abs(size - 2.0 * test * width * np.abs(spots.px_per_mm[rows])) > 0.1 * size
            light = sides.collected.reshape(-1, 2)
            tilt = np.diff(light, axis=1)[:, 0] / spots.collected[rows]
            lean = tilt * step * spread / 4.0
            bent |= np.abs(sag) > limit
            uneven = ~(np.abs(lean) <= limit)  # nor where the axis has no light
        shift = sag + lean
        shift_px[rows] = np.where(np.isfinite(shift), shift, 0.0)
        split[rows] = edge | ((axis | seen.any(axis=1)) & (bent | uneven))
        rows = rows[~split[rows]]
        if limit < _FEW_TELL_PX:
            split[rows] = self._a_ray_differs(spots, beam, y_mm, rows)
        elif self.cut is not None:
            split[rows] = self._rings_need_rays(spots, beam, y_mm, rows)
        return split, np.where(split, 0.0, shift_px)

    def _rings_need_rays(self, spots: Spots, beam: Floats, y_mm: Floats, rows: Ints) -> Bools:
        """Return which of some lines have other surfaces in a cut beam's rings [m].

        Two rays on either side tell: the nearer one of any other surface, the farther one of a
        brighter one, and both of one that bends away. A spot that the lens does not see may still
        have rings that it sees.
        """
        test = np.array([-_TEST_CUT, _TEST_CUT, -_TEST_FAR, _TEST_FAR])
        sides, off = self._beside(spots, beam, y_mm, rows, test)
        axis, light = spots.collected[rows, None], sides.collected.reshape(off.shape)
        seen, target = sides.seen.reshape(off.shape), sides.target.reshape(off.shape)
        other = (seen != spots.seen[rows, None]) | (target != spots.target[rows, None])
        edge = other[:, :2].any(axis=1)
        edge &= spots.seen[rows] | seen[:, :2].any(axis=1)
        edge |= (light > _BRIGHT * axis).any(axis=1)
        edge |= spots.seen[rows] & (seen & (off > _BENT_PX)).any(axis=1)
        return np.asarray(edge | (_BRIGHT * light[:, :2] < axis).any(axis=1))

    def _a_ray_differs(self, spots: Spots, beam: Floats, y_mm: Floats, rows: Ints) -> Bools:
        """Return of which of some lines a ray is not on the axis's tangent plane [m].

        Its image or its light is not what it would be there; what the lens does not see is dark.
        """
        offset = self._offset
        found, off = self._beside(spots, beam, y_mm, rows, offset)
        axis, light = spots.collected[rows, None], found.collected.reshape(off.shape)
        tilt = (light[:, -1:] - light[:, :1]) / (offset[-1] - offset[0]) * offset
        differs = np.abs(light - axis - tilt) > _SMOOTH_LIGHT * axis
        differs |= (light > 0.0) & (off > _FLAT * np.abs(offset))
        return np.asarray(differs.any(axis=1))

    def _beside(
        self, spots: Spots, beam: Floats, y_mm: Floats, rows: Ints, offset: Floats
    ) -> tuple[Spots, Floats]:
        """Return rays beside the axis [m * k], and how far off the plane their images are [m, k].

        The distance, px, is from the image of the same ray on the axis's tangent plane, 0 where
        there is none.
        """
        far = np.where(spots.lit, spots.distance, self.light.farthest_mm)[rows]
        reach = self._stretch(self._moved(far))[:, None] * offset
        origin, direction = self._offset_rays(spots, beam, rows, reach)
        found = self._meet(origin, direction, np.repeat(y_mm[rows], len(offset)))
        width = radius_mm(np.where(spots.lit, spots.distance, 0.0)[rows], self._laser)
        flat = spots.position_px[rows, None] + (width * spots.px_per_mm[rows])[:, None] * reach
        off = np.abs(found.position_px.reshape(flat.shape) - flat)
        return found, np.where(np.isnan(off), 0.0, off)

    def _by_rays(self, spots: Spots, beam: Floats, timeline: Timeline, rows: Ints) -> list[Pieces]:
        """Return the spots of some lines, followed ray by ray, at most two pieces for each line.

        Where there is light from beneath surfaces, they are twice as many.

        The beam's profile across the scan plane is that of its middle: what a spot's upper and
        lower parts see is taken to be the same, which for a sensor of one row is nearly so. While
        the laser is on the beam moves over its parts, which stay: they get the light of the moving
        beam, and their image is not smeared.
        """
        far = np.where(spots.lit, spots.distance, self.light.farthest_mm)[rows]
        moved = self._moved(far, timeline.rate_rad_per_s[rows])
        stretch = self._stretch(moved)[:, None]
        parts = self._parts(spots, beam, timeline, rows, stretch)
        shape = (len(rows), RAYS)
        cells, shift = self._cells(spots, beam, timeline, rows, parts, moved)
        place = parts.position_px.reshape(shape)
        used = parts.seen.reshape(shape)
        light = np.where(used, np.maximum(parts.collected.reshape(shape), 0.0), 0.0) * cells
        place = np.where(used, place, 0.0) + shift
        depth = np.where(used, parts.depth.reshape(shape), 1.0)
        target = parts.target.reshape(shape)
        distance = np.where(used, parts.distance.reshape(shape), 1.0)
        lean = np.where(used, parts.px_per_mm.reshape(shape), 0.0)

        brightest = light.argmax(axis=1)[:, None]
        ahead = np.take_along_axis(depth, brightest, axis=1)
        lens, config = self.light.scene.lens, self.light.config
        # Out of a focus at infinity both discs are on the same side, so the difference is theirs.
        unsharp = image.defocus_radius_px(depth, np.inf, lens.f_number, config)
        unsharp -= image.defocus_radius_px(ahead, np.inf, lens.f_number, config)
        same = np.abs(unsharp) < _SHARPEN
        below = parts.beneath.reshape(*shape, 4)
        layers = (False, True) if below[:, :, 0].any() else (False,)
        pieces = []
        for some, deep in itertools.product((same, ~same), layers):
            kind = below[:, :, 0] if deep else 1.0 - below[:, :, 0]
            weight = np.where(some, light * kind, 0.0)
            whole = weight.sum(axis=1)
            kept = whole > 0.0
            if not kept.any():
                continue
            share = weight[kept] / whole[kept][:, None]
            main = np.take_along_axis(target[kept], share.argmax(axis=1)[:, None], axis=1)[:, 0]

            def mean(values: Floats, share: Floats = share, kept: Bools = kept) -> Floats:
                return np.asarray((values[kept] * share).sum(axis=1))

            here, behind = mean(place), mean(depth)
            width = radius_mm(mean(distance), self._laser)
            height = self._height(width, behind)
            radius, coma = self._blur(behind, here)
            near = self._zone(mean(distance))
            part = image.row_share(height, radius, lens.row_offset_px, cut=self.cut, zone=near)
            long = np.minimum(width * mean(np.abs(lean)), WIDEST_PX)
            speed = mean(np.abs(lean)) * mean(distance) * timeline.rate_rad_per_s[rows[kept]]
            amount = self.electrons * whole[kept]
            pieces.append(
                Pieces(
                    row=rows[kept],
                    place_px=here,
                    electrons=amount * part,
                    whole_e=amount,
                    sigma_px=0.5 * long,
                    radius_px=radius,
                    height_px=height,
                    speed_px=self._speed(speed),
                    coma_px=coma,
                    surface=main,
                    range_mm=behind,
                    zone=near,
                    parts_px=place[kept],
                    share=share,
                    cell_px=(long[:, None] * stretch[kept]) * np.diff(self._offset)[[RAYS // 2, 0]],
                )
            )
            if deep:
                tail, *spread = (mean(below[:, :, k]) for k in (1, 2, 3))
                pieces[-1] = self._beneath(pieces[-1], tail, np.stack(spread, axis=1))
                pieces[-1].parts_px = place[kept] + below[kept, :, 1]
        return pieces

    def _parts(
        self, spots: Spots, beam: Floats, timeline: Timeline, rows: Ints, stretch: Floats
    ) -> Spots:
        """Return the rays of some lines' spots, [m * RAYS].

        Without ``detail``, a few tell whether a spot is on one smooth surface: there the others lie
        on the polynomial through these, which follows the surface to the fifth order at least.
        """
        offset, knots, misses = self._offset, self._few, self._misses
        if "detail" in self.active:
            origin, direction = self._offset_rays(spots, beam, rows, offset * stretch)
            return self._meet(origin, direction, np.repeat(timeline.y_mm[rows], RAYS))
        few = self._meet(
            *self._offset_rays(spots, beam, rows, knots * stretch),
            np.repeat(timeline.y_mm[rows], len(knots)),
        )
        shape = (len(rows), len(knots))
        target = few.target.reshape(shape)
        smooth = few.seen.reshape(shape).all(axis=1) & (target == target[:, :1]).all(axis=1)
        place = np.where(few.seen, few.position_px, 0.0).reshape(shape)
        light = few.collected.reshape(shape)
        middle = len(knots) // 2
        smooth &= np.abs(place @ misses.T).max(axis=1) < _SMOOTH_PX
        smooth &= np.abs(light @ misses.T).max(axis=1) < _SMOOTH_LIGHT * light[:, middle]
        torn = np.flatnonzero(~smooth)
        origin, direction = self._offset_rays(spots, beam, rows[torn], offset * stretch[torn])
        real = self._meet(origin, direction, np.repeat(timeline.y_mm[rows[torn]], RAYS))
        even = np.flatnonzero(smooth)

        def joined(real: npt.NDArray[Any], few: npt.NDArray[Any], steady: bool) -> Any:
            whole = np.empty((len(rows), RAYS, *real.shape[1:]), real.dtype)
            whole[torn] = real.reshape(len(torn), RAYS, *real.shape[1:])
            known = few.reshape(*shape, *few.shape[1:])[even]
            whole[even] = known[:, middle : middle + 1] if steady else known @ self._blend.T
            return whole.reshape(-1, *real.shape[1:])

        steady = ("lit", "seen", "point", "target", "beneath")  # these are the middle ray's
        return Spots(
            **{
                field.name: joined(
                    getattr(real, field.name), getattr(few, field.name), field.name in steady
                )
                for field in fields(Spots)
            }
        )

    def _cumulated(
        self, spots: Spots, rows: Ints, parts: Spots, moved: Floats
    ) -> Callable[[Floats, Ints], tuple[Floats, Floats]]:
        """Return the function that sums the light of some lines' profiles over the pulse.

        Its arguments are places in 1/e2 radii [k, ...] and their lines' indices in ``rows``. The
        pulse is a few moments, between which the beam's light is smooth.
        """
        still = self._still(spots, rows, parts)
        if not moved.any():
            return still
        node, weight = legendre(2 + math.ceil(2.0 * self._most_moved()))

        def sums(x: Floats, index: Ints) -> tuple[Floats, Floats]:
            light, moment = 0.0, 0.0
            for share, at in zip((0.5 * weight).tolist(), (0.5 * node).tolist(), strict=True):
                away = at * moved[index]
                part, turn = still(x - away, index)
                light, moment = light + share * part, moment + share * (turn + away * part)
            return np.asarray(light), np.asarray(moment)

        return sums

    def _most_moved(self) -> float:
        """Return the largest ``_moved`` of any distance: far away, or at the beam's waist."""
        distance = np.linspace(0.0, self.light.farthest_mm, 65)
        return float(self._moved(distance).max())

    def _still(
        self, spots: Spots, rows: Ints, parts: Spots
    ) -> Callable[[Floats, Ints], tuple[Floats, Floats]]:
        """Return the same of a beam at rest."""
        if self.cut is None:
            return lambda x, _: gaussian_cumulated(x)
        distance = np.where(spots.lit[rows], spots.distance[rows], self.light.farthest_mm)
        seen = parts.seen.reshape(len(rows), RAYS)
        depth = np.where(seen, parts.depth.reshape(len(rows), RAYS), 0.0).sum(axis=1)
        depth = np.where(seen.any(axis=1), depth / np.maximum(seen.sum(axis=1), 1), 1.0)
        radius, _ = self._blur(depth, np.zeros(len(rows)))
        height = self._height(radius_mm(distance, self._laser), depth)
        return self.cut.cumulated(zone(distance, self._laser), image.band(height, radius))

    def _cells(
        self,
        spots: Spots,
        beam: Floats,
        timeline: Timeline,
        rows: Ints,
        parts: Spots,
        moved: Floats,
    ) -> tuple[Floats, Floats]:
        """Return the share of the beam that each ray stands for, and its image's shift in px.

        A ray stands for its cell, half way to its neighbours, at the mean place of the cell's
        light; the first and the last one stand for all that is farther. Where two neighbours do not
        meet the same thing, the edge between them is looked for, and the cells end there: else
        light would jump from one surface to the other by a whole ray's as the beam moves.

        Returns:
            Shares and shifts [m, RAYS].
        """
        shape = (len(rows), RAYS)
        offset = self._offset * self._stretch(moved)[:, None]
        sums = self._cumulated(spots, rows, parts, moved)
        step = np.diff(offset, axis=1)
        ends = np.pad(offset[:, :-1] + 0.5 * step, ((0, 0), (1, 1)))
        ends[:, 0], ends[:, -1] = -np.inf, np.inf
        light, moment = sums(ends, np.arange(len(rows))[:, None])
        light = np.broadcast_to(light, (len(rows), RAYS + 1))
        moment = np.broadcast_to(moment, light.shape)
        cells, moments = np.diff(light, axis=1), np.diff(moment, axis=1)
        kind = np.where(parts.seen, parts.target, -1).reshape(shape)
        depth, lean = parts.depth.reshape(shape), parts.px_per_mm.reshape(shape)
        bright = parts.collected.reshape(shape)
        width = radius_mm(np.where(parts.lit, parts.distance, 0.0), self._laser).reshape(shape)
        place = np.where(kind >= 0, parts.position_px.reshape(shape), 0.0)
        expected = width * np.abs(lean)
        jump = np.abs(np.diff(place, axis=1))
        torn = jump > _TORN * step * np.maximum(expected[:, 1:], expected[:, :-1]) + _TORN_PX
        leap = np.maximum(bright[:, 1:], bright[:, :-1]) > _LEAP * np.minimum(
            bright[:, 1:], bright[:, :-1]
        )
        edge = (kind[:, 1:] != kind[:, :-1]) | ((torn | leap) & (kind[:, 1:] >= 0))
        amount = bright * cells
        least = _FAINT * amount.sum(axis=1, keepdims=True)
        edge &= np.maximum(amount[:, 1:], amount[:, :-1]) > least
        line, ray = np.nonzero(edge)
        if len(line):
            end = self._edges(
                spots, beam, timeline, rows[line], kind, depth, bright, torn, line, ray, offset
            )
            middle = ends[line, ray + 1]
            split = np.stack([middle, offset[line, ray] + end * step[line, ray]], axis=1)
            light, moment = sums(split, line[:, None])
            for amount, sum_ in ((cells, light), (moments, moment)):
                moved = sum_[:, 1] - sum_[:, 0]
                amount[line, ray] += moved
                amount[line, ray + 1] -= moved
        np.maximum(cells, 0.0, out=cells)
        shift = np.where(cells > 1e-7, moments / np.maximum(cells, 1e-7) - offset, 0.0)
        reach = np.concatenate([step, step[:, -1:]], axis=1)
        return cells, np.clip(shift, -1.5 * reach, 1.5 * reach) * width * lean

    def _edges(
        self,
        spots: Spots,
        beam: Floats,
        timeline: Timeline,
        rows: Ints,
        kind: Ints,
        depth: Floats,
        bright: Floats,
        torn: Bools,
        line: Ints,
        ray: Ints,
        offset: Floats,
    ) -> Floats:
        """Return where edges between neighbouring rays are, as shares of the way to the next ray.

        Args:
            spots: Spots of the axis.
            beam: Axes of the beam [n, 3].
            timeline: The lines [n].
            rows: Lines of the edges [e].
            kind: What each ray sees [m, RAYS].
            depth: Depth of what it sees [m, RAYS].
            bright: Light of what it sees [m, RAYS].
            torn: Whether the image jumps from a ray to the next [m, RAYS - 1].
            line: Line of each edge in these arrays [e].
            ray: The ray before it [e].
            offset: Offsets of the rays in 1/e2 radii [m, RAYS].
        """
        low, size = np.zeros(len(line)), 1.0

        def sides(values: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
            return values[line, ray][:, None], values[line, ray + 1][:, None]

        (left, right), (ahead, behind), (dark, lit) = sides(kind), sides(depth), sides(bright)
        by_light = ((left == right)[:, 0] & ~torn[line, ray])[:, None]
        y_mm = np.repeat(timeline.y_mm[rows], _SECTIONS - 1)
        part = np.arange(1, _SECTIONS) / _SECTIONS
        first = offset[line, ray][:, None]
        step = offset[line, ray + 1][:, None] - first
        for _ in range(_ROUNDS):
            here = first + (low[:, None] + size * part) * step
            found = self._meet(*self._offset_rays(spots, beam, rows, here), y_mm)
            own = np.where(found.seen, found.target, -1).reshape(here.shape)
            deep, light = found.depth.reshape(here.shape), found.collected.reshape(here.shape)
            nearer = np.where(
                by_light,
                np.abs(light - dark) <= np.abs(light - lit),
                np.abs(deep - ahead) <= np.abs(deep - behind),
            )
            same = (own == left) & (nearer | (own != right))
            size /= _SECTIONS
            low += size * np.logical_and.accumulate(same, axis=1).sum(axis=1)
        return np.asarray(low + 0.5 * size)

    def _mirrored(self, beam: Floats, timeline: Timeline) -> list[Pieces]:
        """Return the spots that are seen by way of glossy surfaces, at most three for each line."""
        pieces = []
        for found in self._mirrors.images(beam, timeline.y_mm):
            beam_px = 0.5 * radius_mm(found.way_mm, self._laser)
            sigma = np.hypot(beam_px * found.px_per_mm, found.lobe_px)
            height = np.hypot(beam_px * found.high_px_per_mm, found.lobe_high_px)
            radius, coma = self._blur(found.depth_mm, found.place_px)
            offset = self.light.scene.lens.row_offset_px - found.high_px
            whole = self.electrons * found.collected
            electrons = whole * image.row_share(height, radius, offset)
            speed = found.px_per_rad * timeline.rate_rad_per_s[found.row]
            piece = Pieces(
                row=found.row,
                place_px=found.place_px,
                electrons=electrons,
                whole_e=whole,
                sigma_px=np.minimum(sigma, WIDEST_PX),
                radius_px=radius,
                height_px=height,
                speed_px=self._speed(speed),
                coma_px=coma,
                surface=found.surface,
                range_mm=found.depth_mm,
            )
            pieces.append(piece.of(electrons > _LEAST_E))
        return pieces

    def _window_ghost(self, timeline: Timeline) -> list[Pieces]:
        """Return the second spots that the scan head's window makes: beams of their own.

        Each lies on its tangent plane; parts of a spot at an edge are not distinguished.
        """
        ghost = self.light.window_ghost(timeline.angle_rad)
        turned = timeline.angle_rad + ghost.turn_rad
        across = np.stack([np.cos(turned), np.zeros(len(turned)), -np.sin(turned)], axis=1)
        beam = np.stack([np.sin(turned), np.zeros(len(turned)), np.cos(turned)], axis=1)
        spots = self._meet(ghost.shift_mm[:, None] * across, beam, timeline.y_mm)
        pieces = self._whole(spots, timeline, np.arange(len(turned)))
        for piece in pieces:
            piece.electrons = piece.electrons * ghost.power[piece.row]
            piece.whole_e = piece.whole_e * ghost.power[piece.row]
        return pieces


def _lagrange(knots: Floats, at: Floats) -> Floats:
    """Return the matrix [places, knots] of the polynomial through values at the knots."""
    each = np.eye(len(knots))
    return np.stack([np.polyval(np.polyfit(knots, row, len(knots) - 1), at) for row in each], 1)


@functools.cache
def _matrices(cut: bool) -> tuple[Floats, Floats]:
    """Return the matrices from the few rays to all, and to their distances from a parabola."""
    if cut:
        return _lagrange(_FEW_CUT, _RAYS_CUT), _misses(_FEW_CUT)
    return _lagrange(_FEW, _RAYS_GAUSSIAN), _misses(_FEW)


def _misses(knots: Floats) -> Floats:
    """Return the matrix of the distances of values at the knots from a parabola.

    It goes through those in the middle and at 2 radii; how far the others are is scaled to what is
    left at 1 radius, as a cubic would be.
    """
    through = np.flatnonzero(np.isin(knots, (-2.0, 0.0, 2.0)))
    others = np.setdiff1d(np.arange(len(knots)), through)
    found = np.eye(len(knots))[others]
    found[:, through] -= _lagrange(knots[through], knots[others])
    far = np.abs(knots[others]) ** 3 - 4.0 * np.abs(knots[others])
    return np.asarray(found * 3.0 / np.abs(far)[:, None])
