"""A scene's lines, rendered with any set of its effects and always the same random numbers.

What a spot sends to the row is one or more *pieces*: a piece is a place on the row, an amount of
light, and what blurs it. A line that is one piece on an even background costs one short transform
and a table look-up for each dark pixel; only where something else falls on the row (ghosts, halo,
a second bounce, a spot on two surfaces) is the whole line worked out pixel by pixel. Both ways use
the same word of noise for the same pixel of the same line and agree bit for bit where they meet.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.constants import c, h

from vrscan.arrays import Bools, Floats, Ints, Pixels
from vrscan.lines import Truth
from vrscan.scene import image
from vrscan.scene.beam import core_share, output_mw, pulse_transform, radius_mm
from vrscan.scene.image import Singles
from vrscan.scene.light import Light
from vrscan.scene.sensor import bloom, expose_even, expose_pixels, readout
from vrscan.scene.spots import BESIDE_PX, Spots, meet
from vrscan.scene.timeline import Timeline

RAYS = 33  # across a spot that is followed part by part
_TEST = 1.5  # 1/e2 radii from the axis, where rays tell whether a spot needs those
_MAP_STEP = 2e-4  # rad between the angles at which that is found out: a fifth of a beam
_SPREAD = 2.0  # of those rays, in 1/e2 radii, either side: 3e-4 of the peak is left
_SMOOTH = 0.6  # sigma of one ray's share of the spot, in distances between rays
_TORN, _TORN_PX = 3.0, 0.5  # a jump of the image between rays, in expected steps and px
_SECTIONS = 6  # into which the way between two rays is cut to find an edge,
_ROUNDS = 2  # and how often: to 1/36
_WIDEST_PX = 250.0  # of a spot's sigma: light along a surface is spread no farther
_SHARPEN = 0.5  # px of defocus radius, from which on parts of a spot are blurred each for itself
_WIDE_DISC = 8.0  # spot sigmas of a ghost's radius, from which on its ends count as hard
_SPILT_E = 0.05  # electrons of blooming that may be lost at a window's end
_FIVE = np.linspace(-_SPREAD, _SPREAD, 5)  # 1/e2 radii, of rays that tell a smooth surface
_SMOOTH_PX = 0.1  # how far their images may be off a parabola there
_SMOOTH_LIGHT = 0.02  # and their light, of the middle one's
_CHUNK = 64  # lines whose rays are summed at a time


@dataclass(frozen=True)
class Frame:
    """n rendered lines."""

    lines: Pixels  # [n, length]
    timeline: Timeline
    reported_rad: Floats  # the angle that the chain is told [n]
    truth: Truth


@dataclass
class _Pieces:
    """m pieces of light on the row."""

    row: Ints  # of the block [m]
    place_px: Floats
    electrons: Floats  # on the row
    whole_e: Floats  # of all its light, on the row or not
    sigma_px: Floats  # along the row
    radius_px: Floats  # of the defocused disc
    height_px: Floats  # sigma across the row
    speed_px: Floats  # how far it moves in the pulse
    coma_px: Floats
    surface: Ints
    range_mm: Floats
    speckled: bool = True
    parts_px: Floats | None = None  # places of a spot's rays [m, RAYS]
    share: Floats | None = None  # of the light [m, RAYS]

    def __len__(self) -> int:
        return len(self.row)

    def of(self, rows: Ints | Bools) -> "_Pieces":
        """Return some of them."""
        chosen = {
            name: value[rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return replace(self, **chosen)  # type: ignore[arg-type]


class Renderer:
    """Renders lines of a scene with the effects ``active``.

    ``seconds`` holds what each effect has cost so far, and under ``""`` everything else.
    """

    def __init__(
        self,
        light: Light,
        active: frozenset[str],
        *,
        every_ray: bool = False,
        tolerance_px: float | None = None,
    ) -> None:
        """Prepare what depends on the effects alone.

        Args:
            light: The scene.
            active: Names of effects.
            every_ray: Whether every spot is followed part by part, needed or not.
            tolerance_px: How far a tangent plane may be off before a spot is; the scene's if None.
        """
        self.light, self.active, self.every_ray = light, active, every_ray
        self.tolerance_px = light.scene.tolerance_px if tolerance_px is None else tolerance_px
        self.seconds: dict[str, float] = {}
        self._inner = 0.0
        scene, config = light.scene, light.config
        laser = scene.laser
        if "truncation" not in active:
            laser = laser.model_copy(update={"aperture_mm": float("inf")})
        self._laser = laser
        self._pulse_s = 1e-6 * config.line.pulse_us
        photon_j = h * c / (1e-9 * laser.wavelength_nm)
        pupil = scene.lens.transmission * scene.lens.filter_transmission
        if "dust" in active:
            pupil *= 1.0 - light.obscured
        energy = 1e-3 * output_mw(laser) * self._pulse_s
        self._electrons = energy / photon_j * scene.sensor.quantum_efficiency * pupil
        if "halo" in active:
            self._electrons *= 1.0 - light.halo.total
        model = scene.sensor
        if "read" not in active:
            model = model.model_copy(update={"read_noise_e": 0.0})
        self._readout = readout(model, config.peak.kappa, config.sensor.pixel_width)
        # A spot that moves v px in the pulse has at k cycles/px the pulse's transform at k v.
        turns = image.PULSE_TURNS / self._pulse_s
        self._pulse = pulse_transform(turns, laser, self._pulse_s).astype(np.float32)
        self._transfer: dict[int, Singles] = {}
        pattern = light.pattern
        self._sensitivity: Singles | None = pattern.sensitivity if "prnu" in active else None
        if "dust" in active:
            shadow = light.shadow
            known = self._sensitivity
            self._sensitivity = shadow if known is None else known * shadow
        self._even_e, self._uneven_e = self._ambient()
        # Even light's pattern is taken for an offset, so that a table serves all dark pixels.
        self._offset: Singles | None = pattern.dark_e if "dsnu" in active else None
        if self._sensitivity is not None and self._even_e > 0.0:
            extra = np.float32(self._even_e) * (self._sensitivity - np.float32(1.0))
            self._offset = extra if self._offset is None else self._offset + extra

    # -- one block --

    def render(self, timeline: Timeline, words: Pixels) -> Frame:
        """Return the lines of a timeline.

        Args:
            timeline: n lines.
            words: The random words of their pixels, uint16 [n, length].
        """
        begin, self._inner = time.perf_counter(), 0.0
        frame = self._render(timeline, words)
        rest = time.perf_counter() - begin - self._inner
        self.seconds[""] = self.seconds.get("", 0.0) + rest
        return frame

    @contextmanager
    def _clock(self, name: str) -> Iterator[None]:
        begin, before = time.perf_counter(), self._inner
        try:
            yield
        finally:
            taken = time.perf_counter() - begin
            own = taken - (self._inner - before)
            self.seconds[name] = self.seconds.get(name, 0.0) + own
            self._inner = before + taken

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
        )

    def _render(self, timeline: Timeline, words: Pixels) -> Frame:
        count = len(timeline)
        angle = timeline.angle_rad
        beam = np.stack([np.sin(angle), np.zeros(count), np.cos(angle)], axis=1)
        spots = self._meet(np.zeros((count, 3)), beam, timeline.y_mm)
        pieces = [self._whole(spots, timeline, np.arange(count))]
        if "footprint" in self.active:
            with self._clock("footprint"):
                split = self._split(spots, beam, timeline)
                if split.any():
                    pieces = [self._whole(spots, timeline, np.flatnonzero(~split))]
                    pieces += self._by_rays(spots, beam, timeline, np.flatnonzero(split))
        second: list[_Pieces] = []
        if "window" in self.active:
            with self._clock("window"):
                second.append(self._window_ghost(timeline))
        lines = self._expose(pieces, second, timeline, words)
        return Frame(
            lines=lines,
            timeline=timeline,
            reported_rad=timeline.reported_rad if "index" in self.active else angle,
            truth=self.truth(spots),
        )

    def truth(self, spots: Spots) -> Truth:
        """Return what the lines' spots are: of the beam's axis."""
        light = self.light
        length = light.config.sensor.line_length
        place = spots.position_px
        with np.errstate(invalid="ignore"):
            seen = spots.seen & (place > -0.5) & (place < length - 0.5)
        return Truth(
            x_mm=np.where(spots.lit, spots.point[:, 0], np.nan),
            z_mm=np.where(spots.lit, spots.point[:, 2], np.nan),
            position_px=np.where(seen, place, np.nan),
            surface=light.groups[spots.target],
            names=light.names,
        )

    # -- pieces --

    def _blur(self, depth: Floats, place: Floats) -> tuple[Floats, Floats]:
        """Return radius of the disc and coma's length, px."""
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

    def _whole(self, spots: Spots, timeline: Timeline, rows: Ints) -> _Pieces:
        """Return the spots of some lines, each on its tangent plane."""
        rows = rows[spots.seen[rows] & (spots.collected[rows] > 0.0)]
        width = radius_mm(spots.distance[rows], self._laser)
        place, depth = spots.position_px[rows], spots.depth[rows]
        height = self._height(width, depth)
        radius, coma = self._blur(depth, place)
        share = image.row_share(height, radius, self.light.scene.lens.row_offset_px)
        speed = spots.px_per_mm[rows] * spots.distance[rows] * timeline.rate_rad_per_s[rows]
        whole = self._sent(spots.distance[rows]) * spots.collected[rows]
        return _Pieces(
            row=rows,
            place_px=place,
            electrons=whole * share,
            whole_e=whole,
            sigma_px=np.minimum(0.5 * width * np.abs(spots.px_per_mm[rows]), _WIDEST_PX),
            radius_px=radius,
            height_px=height,
            speed_px=self._speed(speed),
            coma_px=coma,
            surface=spots.target[rows],
            range_mm=depth,
        )

    def _sent(self, distance_mm: Floats) -> Floats:
        """Return the electrons that all light of the spot would make in the camera."""
        core = np.minimum(core_share(distance_mm, self._laser), 1.0)
        return np.asarray(self._electrons * core)

    def _speed(self, px_per_s: Floats) -> Floats:
        if "smear" not in self.active:
            return np.zeros(len(px_per_s))
        return np.minimum(np.abs(px_per_s) * self._pulse_s, 4.0 * _WIDEST_PX)

    def _offset_rays(
        self, spots: Spots, beam: Floats, rows: Ints, offset: Floats
    ) -> tuple[Floats, Floats]:
        """Return rays of the beam's cross-section, which follow its width from pivot to spot.

        Args:
            spots: Of the axis.
            beam: The axes [n, 3].
            rows: Which lines [m].
            offset: In 1/e2 radii, [k], or [m, k] of each line.

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
        origin = (start * offset)[:, :, None] * across[:, None, :]
        lean = (end - start)[:, None] * offset / far[:, None]
        direction = axis[:, None, :] + lean[:, :, None] * across[:, None, :]
        direction /= np.sqrt(1.0 + np.square(lean))[:, :, None]
        return origin.reshape(-1, 3), direction.reshape(-1, 3)

    def _split(self, spots: Spots, beam: Floats, timeline: Timeline) -> Bools:
        """Return the lines whose spots are followed ray by ray."""
        if self.every_ray:
            middle = 0.5 * self.light.config.sensor.line_length
            with np.errstate(invalid="ignore"):
                beside = np.abs(spots.position_px - middle) > middle + BESIDE_PX
            return ~(beside & spots.lit)
        if self.light.scene.scan.pan_mm_per_s != 0.0:
            return self._needs_rays(spots, beam, timeline.y_mm)
        # A scanner that stands still sees the same at the same angle: one map serves all lines.
        start, split = self._split_map()
        knot = ((timeline.angle_rad - start) / _MAP_STEP).astype(np.int64)
        knot = np.clip(knot, 0, len(split) - 2)
        return split[knot] | split[knot + 1]

    def _split_map(self) -> tuple[float, Bools]:
        """Return the first angle of the map, and at each of its angles whether rays are needed."""
        light = self.light
        key = self.tolerance_px, self.active & {"truncation", "gloss", "falloff"}
        if key not in light.split_maps:
            scan, mirror = light.scene.scan, light.config.mirror
            reach = 1.05 * mirror.amplitude_deg if scan.sweep == "mirror" else scan.half_angle_deg
            half = np.radians(reach)
            angle = -half + _MAP_STEP * np.arange(int(2.0 * half / _MAP_STEP) + 2)
            beam = np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
            still = np.zeros(len(angle))
            spots = self._meet(np.zeros_like(beam), beam, still)
            light.split_maps[key] = -half, self._needs_rays(spots, beam, still)
        return light.split_maps[key]

    def _needs_rays(self, spots: Spots, beam: Floats, y_mm: Floats) -> Bools:
        """Return the lines whose spot a tangent plane does not describe.

        Two rays three sigma either side of the axis tell: an edge or a shadow between them, beyond
        which there is 0.1 % of the light; curvature, where the image's mean moves by a ninth of
        their common deviation; or reflectance that changes across the spot.
        """
        split = np.zeros(len(spots.lit), np.bool_)
        middle = 0.5 * self.light.config.sensor.line_length
        with np.errstate(invalid="ignore"):
            beside = np.abs(spots.position_px - middle) > middle + BESIDE_PX
        rows = np.flatnonzero(~(beside & spots.lit))
        limit = self.tolerance_px
        origin, direction = self._offset_rays(spots, beam, rows, np.array([-_TEST, _TEST]))
        sides = self._meet(origin, direction, np.repeat(y_mm[rows], 2))
        seen = sides.seen.reshape(-1, 2)
        axis = spots.seen[rows]
        edge = (seen != axis[:, None]).any(axis=1)
        other = (sides.target.reshape(-1, 2) != spots.target[rows, None]).any(axis=1)
        edge |= other & seen.any(axis=1)
        with np.errstate(invalid="ignore"):
            place = sides.position_px.reshape(-1, 2)
            distance = np.where(spots.lit, spots.distance, 0.0)[rows]
            width = radius_mm(distance, self._laser)
            step = np.abs(np.diff(place, axis=1)[:, 0])
            sag = np.abs(place.mean(axis=1) - spots.position_px[rows]) / (2.0 * _TEST) ** 2
            bent = sag > 0.5 * limit
            bent |= np.abs(step - 2.0 * _TEST * width * np.abs(spots.px_per_mm[rows])) > 0.1 * step
            light = sides.collected.reshape(-1, 2)
            tilt = np.abs(np.diff(light, axis=1)[:, 0])
            uneven = tilt * step > 2.0 * (2.0 * _TEST) ** 2 * limit * spots.collected[rows]
        split[rows] = edge | ((axis | seen.any(axis=1)) & (bent | uneven))
        return split

    def _by_rays(self, spots: Spots, beam: Floats, timeline: Timeline, rows: Ints) -> list[_Pieces]:
        """Return the spots of some lines, followed ray by ray, at most two pieces a line.

        The beam's profile across the scan plane is that of its middle: what a spot's upper and
        lower parts see is taken to be the same, which for a sensor of one row is nearly so.
        """
        offset = np.linspace(-_SPREAD, _SPREAD, RAYS)
        parts = self._parts(spots, beam, timeline, rows, offset)
        # A ray's own share is smeared below; the profile is narrower by that.
        narrow = 1.0 - np.square(_SMOOTH * 2.0 * (offset[1] - offset[0]))
        shape = (len(rows), RAYS)
        cells, shift = self._cells(spots, beam, timeline, rows, offset, parts, narrow)
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
        unsharp = image.defocus_radius_px(depth, 1.0, lens.f_number, config)
        unsharp -= image.defocus_radius_px(ahead, 1.0, lens.f_number, config)
        same = np.abs(unsharp) < _SHARPEN
        pieces = []
        for some in (same, ~same):
            weight = np.where(some, light, 0.0)
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
            part = image.row_share(height, radius, lens.row_offset_px)
            step = _SMOOTH * (offset[1] - offset[0]) * width * mean(np.abs(lean))
            speed = mean(np.abs(lean)) * mean(distance) * timeline.rate_rad_per_s[rows[kept]]
            amount = self._sent(mean(distance)) * whole[kept]
            pieces.append(
                _Pieces(
                    row=rows[kept],
                    place_px=here,
                    electrons=amount * part,
                    whole_e=amount,
                    sigma_px=np.minimum(step, _WIDEST_PX),
                    radius_px=radius,
                    height_px=height,
                    speed_px=self._speed(speed),
                    coma_px=coma,
                    surface=main,
                    range_mm=behind,
                    parts_px=place[kept],
                    share=share,
                )
            )
        return pieces

    def _parts(
        self, spots: Spots, beam: Floats, timeline: Timeline, rows: Ints, offset: Floats
    ) -> Spots:
        """Return the rays of some lines' spots, [m * RAYS].

        Five of them tell whether a spot is on one smooth surface: there the others lie on the
        polynomial through the five, which follows the surface to the fifth order.
        """
        if self.every_ray:
            origin, direction = self._offset_rays(spots, beam, rows, offset)
            return self._meet(origin, direction, np.repeat(timeline.y_mm[rows], RAYS))
        few = self._meet(
            *self._offset_rays(spots, beam, rows, _FIVE), np.repeat(timeline.y_mm[rows], len(_FIVE))
        )
        shape = (len(rows), len(_FIVE))
        target = few.target.reshape(shape)
        smooth = few.seen.reshape(shape).all(axis=1) & (target == target[:, :1]).all(axis=1)
        place = np.where(few.seen, few.position_px, 0.0).reshape(shape)
        light = few.collected.reshape(shape)
        # How far the parabola through the ends and the middle misses the two others.
        smooth &= np.abs(place @ _MISS.T).max(axis=1) < _SMOOTH_PX
        smooth &= np.abs(light @ _MISS.T).max(axis=1) < _SMOOTH_LIGHT * light[:, 2]
        torn = np.flatnonzero(~smooth)
        origin, direction = self._offset_rays(spots, beam, rows[torn], offset)
        real = self._meet(origin, direction, np.repeat(timeline.y_mm[rows[torn]], RAYS))
        even = np.flatnonzero(smooth)
        blend = _lagrange(_FIVE, offset)

        def joined(real: npt.NDArray[Any], few: npt.NDArray[Any], steady: bool) -> Any:
            whole = np.empty((len(rows), RAYS, *real.shape[1:]), real.dtype)
            whole[torn] = real.reshape(len(torn), RAYS, *real.shape[1:])
            five = few.reshape(*shape, *few.shape[1:])[even]
            whole[even] = five[:, 2:3] if steady else five @ blend.T
            return whole.reshape(-1, *real.shape[1:])

        steady = ("lit", "seen", "point", "target")  # these are the middle ray's
        return Spots(
            **{
                field.name: joined(
                    getattr(real, field.name), getattr(few, field.name), field.name in steady
                )
                for field in fields(Spots)
            }
        )

    def _cells(
        self,
        spots: Spots,
        beam: Floats,
        timeline: Timeline,
        rows: Ints,
        offset: Floats,
        parts: Spots,
        narrow: float,
    ) -> tuple[Floats, Floats]:
        """Return the share of the beam that each ray stands for, and its image's shift in px.

        A ray stands for its cell, half way to its neighbours. Where two neighbours do not meet the
        same thing, the edge between them is looked for, and the cells end there: else light would
        jump from one surface to the other by a whole ray's as the beam moves.

        Returns:
            Shares and shifts [m, RAYS].
        """
        profile = np.exp(-2.0 * np.square(offset) / narrow)
        whole = profile.sum()
        shape = (len(rows), RAYS)
        cells = np.broadcast_to(profile / whole, shape).copy()
        shift = np.zeros(shape)
        kind = np.where(parts.seen, parts.target, -1).reshape(shape)
        depth, lean = parts.depth.reshape(shape), parts.px_per_mm.reshape(shape)
        step = offset[1] - offset[0]
        width = radius_mm(np.where(parts.lit, parts.distance, 0.0), self._laser).reshape(shape)
        place = np.where(kind >= 0, parts.position_px.reshape(shape), 0.0)
        expected = step * width * np.abs(lean)
        jump = np.abs(np.diff(place, axis=1))
        torn = jump > _TORN * np.maximum(expected[:, 1:], expected[:, :-1]) + _TORN_PX
        edge = (kind[:, 1:] != kind[:, :-1]) | (torn & (kind[:, 1:] >= 0))
        line, ray = np.nonzero(edge)
        if len(line) == 0:
            return cells, shift
        low, size = np.zeros(len(line)), 1.0
        left, right = kind[line, ray][:, None], kind[line, ray + 1][:, None]
        ahead, behind = depth[line, ray][:, None], depth[line, ray + 1][:, None]
        lines, y_mm = rows[line], np.repeat(timeline.y_mm[rows[line]], _SECTIONS - 1)
        part = np.arange(1, _SECTIONS) / _SECTIONS
        for _ in range(_ROUNDS):
            here = offset[ray][:, None] + (low[:, None] + size * part) * step
            found = self._meet(*self._offset_rays(spots, beam, lines, here), y_mm)
            own = np.where(found.seen, found.target, -1).reshape(here.shape)
            deep = found.depth.reshape(here.shape)
            nearer = np.abs(deep - ahead) <= np.abs(deep - behind)
            same = (own == left) & (nearer | (own != right))
            size /= _SECTIONS
            low += size * np.logical_and.accumulate(same, axis=1).sum(axis=1)
        high = low + size
        end = 0.5 * (low + high)  # of the way to the next ray, where the cell ends; 1/2 elsewhere
        moved = 0.25 + 0.5 * end  # the middle of what changes hands
        amount = (end - 0.5) * np.exp(-2.0 * np.square(offset[ray] + moved * step) / narrow) / whole
        moment = np.zeros(shape)
        cells[line, ray] += amount
        moment[line, ray] += amount * moved
        cells[line, ray + 1] -= amount
        moment[line, ray + 1] -= amount * (moved - 1.0)
        np.maximum(cells, 0.0, out=cells)
        shift = moment / np.maximum(cells, 1e-3 * profile / whole)
        return cells, np.clip(shift, -0.75, 0.75) * step * width * lean

    def _window_ghost(self, timeline: Timeline) -> _Pieces:
        """Return the second spots that the scan head's window makes: beams of their own.

        Each is on its tangent plane; where one meets an edge its parts are not told apart.
        """
        ghost = self.light.window_ghost(timeline.angle_rad)
        turned = timeline.angle_rad + ghost.turn_rad
        across = np.stack([np.cos(turned), np.zeros(len(turned)), -np.sin(turned)], axis=1)
        beam = np.stack([np.sin(turned), np.zeros(len(turned)), np.cos(turned)], axis=1)
        spots = self._meet(ghost.shift_mm[:, None] * across, beam, timeline.y_mm)
        piece = self._whole(spots, timeline, np.arange(len(turned)))
        power = ghost.power[piece.row]
        return replace(piece, electrons=piece.electrons * power, whole_e=piece.whole_e * power)

    # -- on the row --

    def _drawn(self, pieces: _Pieces, timeline: Timeline) -> Iterator[tuple[Ints, Ints, Singles]]:
        """Yield rows, first pixels and mean electrons [m, width] of pieces, by width."""
        if len(pieces) == 0:
            return
        spread = pieces.sigma_px
        if pieces.parts_px is not None and pieces.share is not None:
            used = np.where(pieces.share > 0.0, pieces.parts_px, pieces.place_px[:, None])
            spread = spread + np.abs(used - pieces.place_px[:, None]).max(axis=1) / image.REACH
        widths = image.window_width(spread, pieces.radius_px, pieces.speed_px, pieces.coma_px)
        for width in np.unique(widths):
            rows = np.flatnonzero(widths == width)
            for start in range(0, len(rows), _CHUNK if pieces.parts_px is not None else len(rows)):
                step = _CHUNK if pieces.parts_px is not None else len(rows)
                some = pieces.of(rows[start : start + step])
                yield self._draw(some, int(width), timeline)

    def _draw(self, some: _Pieces, width: int, timeline: Timeline) -> tuple[Ints, Ints, Singles]:
        middle = np.round(some.place_px)
        first = middle.astype(np.int64) - width // 2
        spectrum = None
        if some.parts_px is not None and some.share is not None:
            with self._clock("footprint"):
                spectrum = _spectrum(some.parts_px - middle[:, None], some.share, width)
        # Each blur is a factor; its price is what the transform costs with it, less without.
        light = image.profiles(
            some.place_px - middle,
            width,
            some.sigma_px,
            # The disc of a ghost is its own.
            radius_px=some.radius_px if "defocus" in self.active or not some.speckled else None,
            height_ratio=some.height_px / np.maximum(some.radius_px, 1e-3),
            speed_px=some.speed_px if "smear" in self.active else None,
            pulse=self._pulse,
            coma_px=some.coma_px if "coma" in self.active else None,
            transfer=self._pupil(width),
            spectrum=spectrum,
            clock=self._clock,
        )
        light *= some.electrons.astype(np.float32)[:, None]
        np.maximum(light, np.float32(0.0), out=light)
        if "speckle" in self.active and some.speckled:
            with self._clock("speckle"):
                light *= self._speckle(some, first, width, timeline)
        return some.row, first, light

    def _speckle(self, some: _Pieces, first: Ints, width: int, timeline: Timeline) -> Singles:
        """Return the gains of the pixels of windows."""
        length = self.light.config.sensor.line_length
        gain = self.light.speckle.gain(
            first if width <= length else np.zeros_like(first),
            min(width, length),
            timeline.angle_rad[some.row],
            self.light.looks[some.surface],
            some.range_mm,
            travel_mm=timeline.y_mm[some.row],
            surface=some.surface,
        )
        if width <= length:
            return gain
        column = np.clip(first[:, None] + np.arange(width), 0, length - 1)
        return np.take_along_axis(gain, column, axis=1)

    def _pupil(self, width: int) -> Singles | None:
        if "diffraction" not in self.active:
            return None
        if width not in self._transfer:
            scene, config = self.light.scene, self.light.config
            self._transfer[width] = image.diffraction(
                image.frequencies(width),
                scene.laser.wavelength_nm,
                scene.lens.f_number,
                config.geometry.pitch_mm,
            ).astype(np.float32)
        return self._transfer[width]

    def _ambient(self) -> tuple[float, Singles | None]:
        """Return the electrons that all pixels have, and those of each pixel or None.

        A panning scanner keeps the view of its start, and lamps do not flicker.
        """
        scene = self.light.scene
        even = 0.0
        if "dark" in self.active:
            even += scene.sensor.dark_electrons(self.light.exposure_s)
        uneven = None
        for name in ("sun", "lamps"):
            if name in self.active:
                known = self.light.ambient(name, 0.0)
                if np.ptp(known) > 0.02 * known.mean() + 0.1:
                    uneven = known if uneven is None else uneven + known
                else:
                    even += float(known.mean())
        return even, None if uneven is None else np.asarray(uneven, np.float32)

    def _expose(
        self, pieces: list[_Pieces], second: list[_Pieces], timeline: Timeline, words: Pixels
    ) -> Pixels:
        """Return the counts of a block; ``second`` are pieces too faint for ghosts and halo."""
        count, length = words.shape
        drawn = []
        for row, first, light in (d for p in pieces + second for d in self._drawn(p, timeline)):
            near = (first < length) & (first + light.shape[1] > 0)  # some of it is on the sensor
            drawn.append((row[near], first[near], light[near]))
        everywhere = bool({"ghosts", "halo", "bounce"} & self.active) or self._uneven_e is not None
        whole = np.full(count, everywhere)
        seen_once = np.zeros(count, np.int64)
        for row, first, light in drawn:
            np.add.at(seen_once, row, 1)
            whole[row[(first < 0) | (first + light.shape[1] > length)]] = True
            if "blooming" in self.active and not everywhere:
                whole[row[self._spills(light)]] = True
        whole |= seen_once > 1

        if everywhere:
            lines = np.empty((count, length), np.uint16)
        else:
            lines = self._even(words)
        rows = np.flatnonzero(whole)
        place = np.full(count, -1)
        place[rows] = np.arange(len(rows))
        field = np.zeros((len(rows), length), np.float32)
        if self._uneven_e is not None:
            field += self._uneven_e
        for row, first, light in drawn:
            some = whole[row]
            if some.any():
                _add(field, place[row[some]], first[some], light[some])
            if not some.all():
                self._windows(lines, row[~some], first[~some], light[~some], words)
        if len(rows):
            self._elsewhere(field, rows, pieces, timeline)
            field += np.float32(self._even_e)
            lines[rows] = self._pixels(field, words[rows], self._offset)
        return lines

    def _spills(self, light: Singles) -> Bools:
        """Return the windows, [m, w] electrons, over whose ends charge of full pixels spills."""
        sensor, width = self.light.scene.sensor, light.shape[1]
        full = np.float32(sensor.full_well_e - self._even_e)
        spills = np.zeros(len(light), np.bool_)
        rows = np.flatnonzero(light.max(axis=1) > full)
        if len(rows):
            over = light[rows] > full
            excess = np.where(over, light[rows] - full, np.float32(0.0)).sum(axis=1)
            charge = 0.5 * sensor.blooming * excess.astype(np.float64)  # to either side
            reach = charge / sensor.full_well_e
            reach += sensor.spill_px * np.log(np.maximum(charge / _SPILT_E, 1.0))
            left, right = over.argmax(axis=1), over[:, ::-1].argmax(axis=1)
            spills[rows] = np.minimum(left, right) < np.minimum(reach, width)
        return spills

    def _even(self, words: Pixels) -> Pixels:
        """Return lines without a spot."""
        if "shot" in self.active:
            return expose_even(words, self._even_e, self._readout, self._offset)
        still = np.full(words.shape[1], np.float32(self._even_e))
        if self._offset is not None:
            still += self._offset
        return expose_even(words, 0.0, self._readout, still)

    def _pixels(self, mean_e: Singles, words: Pixels, dark: Singles | None) -> Pixels:
        """Return counts of pixels, [m, w], of their mean electrons."""
        sensor = self.light.scene.sensor
        if "blooming" in self.active:
            with self._clock("blooming"):
                mean_e = bloom(mean_e, sensor)
        if "shot" in self.active:
            return expose_pixels(words, mean_e, self._readout, dark)
        still = mean_e if dark is None else mean_e + dark
        return expose_pixels(words, np.zeros_like(mean_e), self._readout, still)

    def _windows(
        self,
        lines: Pixels,
        row: Ints,
        first: Ints,
        light: Singles,
        words: Pixels,
    ) -> None:
        """Put spots on an even background into their windows."""
        column = first[:, None] + np.arange(light.shape[1])
        mean = light
        if self._sensitivity is not None:
            with self._clock("prnu" if "prnu" in self.active else "dust"):
                mean = light * self._sensitivity[column]
        mean = mean + np.float32(self._even_e)
        offset = None
        if self._offset is not None:
            with self._clock("dsnu" if "dsnu" in self.active else "prnu"):
                offset = self._offset[column]
        at = (row[:, None], column)
        lines[at] = self._pixels(mean, words[at], offset)

    def _elsewhere(
        self, field: Singles, rows: Ints, pieces: list[_Pieces], timeline: Timeline
    ) -> None:
        """Add to whole lines what falls beside the spot."""
        length = field.shape[1]
        inside = np.full(len(timeline), -1)
        inside[rows] = np.arange(len(rows))
        if "ghosts" in self.active:
            with self._clock("ghosts"):
                steps = np.zeros((len(field), length + 2), np.float32)
                for piece in pieces:
                    self._add_ghosts(field, steps, inside, piece, timeline)
                field += np.cumsum(steps, axis=1)[:, :length]
        if "halo" in self.active:
            with self._clock("halo"):
                weights = self.light.halo_table
                for piece in pieces:
                    kept = inside[piece.row] >= 0
                    some = piece.of(kept)
                    # The halo is of all light in the image, not of the row's share alone.
                    whole = some.whole_e.astype(np.float32)
                    middle = np.clip(np.round(some.place_px), -length, 2 * length).astype(np.int64)
                    for at, start, amount in zip(inside[some.row], middle, whole, strict=True):
                        begin = 2 * length - int(start)
                        field[at] += amount * weights[begin : begin + length]
        if "bounce" in self.active:
            with self._clock("bounce"):
                bounced = self.light.bounced(timeline.angle_rad[rows], timeline.y_mm[rows])
                field += bounced * np.float32(self._electrons)
        if self._sensitivity is not None:
            with self._clock("prnu" if "prnu" in self.active else "dust"):
                field *= self._sensitivity

    def _add_ghosts(
        self,
        field: Singles,
        steps: Singles,
        inside: Ints,
        piece: _Pieces,
        timeline: Timeline,
    ) -> None:
        """Add double reflections in the camera: discs on the row, soft where they are small.

        A disc far wider than the spot has hard ends: what the spot's own width does to them is
        left out. Its chord along the row is a run of equal pixels: a step up in ``steps`` and one
        down, of which the row holds the sum.
        """
        geometry = self.light.config.geometry
        piece = piece.of(inside[piece.row] >= 0)
        length = field.shape[1]
        if len(piece) == 0:
            return
        u_mm = (piece.place_px - geometry.centre_px) * geometry.pitch_mm
        found = self.light.ghosts(piece.range_mm, u_mm)
        whole = piece.whole_e
        for offset, across, blur, power in zip(
            found.offset_px, found.across_px, found.blur_px, found.power, strict=True
        ):
            lit = np.flatnonzero(power > 0.0)
            wide = lit[blur[lit] > _WIDE_DISC * piece.height_px[lit]]
            half = np.sqrt(np.maximum(np.square(blur[wide]) - np.square(across[wide]), 0.0))
            level = whole[wide] * power[wide] / (np.pi * np.square(blur[wide]))
            centre = piece.place_px[wide] + offset[wide] + 0.5
            row = inside[piece.row[wide]]
            for sign in (-1.0, 1.0):
                end = np.clip(centre + sign * half, 0.0, length)
                pixel = end.astype(np.int64)
                part = end - pixel
                steps[row, pixel] -= sign * level * (1.0 - part)
                steps[row, pixel + 1] -= sign * level * part
            small = lit[blur[lit] <= _WIDE_DISC * piece.height_px[lit]]
            if len(small) == 0:
                continue
            some = piece.of(small)
            own = image.row_share(some.height_px, blur[small])
            spread = np.square(some.height_px) + 0.25 * np.square(blur[small])
            own *= np.exp(-0.5 * np.square(across[small]) / spread)
            some = replace(
                some,
                place_px=some.place_px + offset[small],
                electrons=whole[small] * power[small] * own,
                radius_px=np.asarray(blur[small]),
                sigma_px=some.height_px,
                speed_px=np.zeros(len(small)),
                coma_px=np.zeros(len(small)),
                parts_px=None,
                share=None,
                speckled=False,
            )
            for row, first, light in self._drawn(some, timeline):
                _add(field, inside[row], first, light)


def _lagrange(knots: Floats, at: Floats) -> Floats:
    """Return the matrix [places, knots] of the polynomial through values at the knots."""
    each = np.eye(len(knots))
    return np.stack([np.polyval(np.polyfit(knots, row, len(knots) - 1), at) for row in each], 1)


_MISS = np.eye(5)[[1, 3]]
_MISS[:, ::2] -= _lagrange(_FIVE[::2], _FIVE[[1, 3]])


def _spectrum(offset_px: Floats, share: Floats, width: int) -> npt.NDArray[np.complex64]:
    """Return the spectrum of points on the row, [m, width + 1], from places [m, k] and shares."""
    frequency = (-2.0 * np.pi * image.frequencies(width)).astype(np.float32)
    turn = offset_px.astype(np.float32)[:, :, None] * frequency
    weight = share.astype(np.float32)[:, None, :]
    found = np.empty((len(share), width + 1), np.complex64)
    found.real = (weight @ np.cos(turn))[:, 0]
    found.imag = (weight @ np.sin(turn))[:, 0]
    return found


def _add(field: Singles, row: Ints, first: Ints, light: Singles) -> None:
    """Add windows to whole lines; what is beyond the sensor's ends is lost. No row twice."""
    length = field.shape[1]
    column = first[:, None] + np.arange(light.shape[1])
    inside = (column >= 0) & (column < length)
    if inside.all():
        field[row[:, None], column] += light
        return
    at = np.broadcast_to(row[:, None], column.shape)[inside]
    field[at, column[inside]] += light[inside]
