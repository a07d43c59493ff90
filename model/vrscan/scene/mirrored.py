"""Spots that the camera sees by way of a glossy surface: mirror images, and mirrored beams.

There are three ways, each of them one image a line. *Gloss to matt*: the surface that the beam
meets first mirrors it onto a second one. *Matt to gloss*: a second surface shows the mirror image
of the first spot. *Gloss to gloss*: the beam is mirrored twice, into the lens. Light from one matt
surface to another is ``Light.bounced``.

Each way is followed along one ray, to the first order about it: a lobe is a Gaussian of directions,
and a surface is bent as the normals beside the ray tell. So a plane shows a spot as if it were
at r1 + r2, the distances from spot to plane and on to the lens. Its lobe of sigma s (in direction
cosines, at an angle t with the normal) blurs the image, in angles at the lens, by s r1 / (r1 + r2)
across the scan plane and by 1 / cos t times that in it. That is the integral of the range equation,
iria (2-31), with both surfaces' f_r (1-15), over the second surface.

It leaves out: all but the brightest image of a curved mirror; ends of a mirror or of the second
surface, and steps between them, within the spot or the lobe; light of a wide lobe below the horizon
of its surface; the skirt of a polished part; a third reflection.
"""

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.ideal.geometry import undistorted
from vrscan.scene.beam import radius_mm
from vrscan.scene.light import PAN_STEP_MM, Light
from vrscan.scene.shapes import dot
from vrscan.scene.spots import Camera, meet
from vrscan.scene.surface import core

_LEAST_MM = 1.0  # least distance between two surfaces, and of an image from the lens
_LEAST_COS = 1e-3  # least cosine of an angle of incidence
_ROUNDS = 6  # most steps of the search for the place in a mirror,
_FOUND_PX = 1e-4  # step after which it ends,
_EDGE = 0.3  # and share of the first miss that a step leaves where there is but an edge
_APART_PX = 1.0  # distance of the rays that tell how a mirror is bent along the row,
_APART_RAD = 1e-3  # and across it
_ASTRAY = 0.25  # sigmas of the lobe by which the ray that was found may miss the spot
_FARTHEST_MM = 1e6  # depth of images that are farther away, or behind the lens
_UP = np.array([0.0, 1.0, 0.0])

_Each = TypeVar("_Each", bound=Any)


@dataclass(frozen=True)
class Images:
    """m images of mirrored light, no two of one line."""

    row: Ints  # line [m]
    place_px: Floats  # place along the row
    high_px: Floats  # distance of the image from the scan plane's, across the row
    collected: Floats  # share of the beam's light that enters the pupil
    depth_mm: Floats  # distance from the lens along its axis at which the image is sharp
    way_mm: Floats  # length of the beam up to its spot
    px_per_mm: Floats  # motion of the image with an offset of the beam in the scan plane,
    high_px_per_mm: Floats  # and with one across it
    px_per_rad: Floats  # motion of the image with the scan angle
    lobe_px: Floats  # sigma of the lobes' blur along the row,
    lobe_high_px: Floats  # and across it
    surface: Ints  # target of the spot that is seen


@dataclass(frozen=True)
class _Spots:
    """k places where the beam's axis meets a surface first, in the scanner's frame."""

    row: Ints  # line
    ray: Floats  # direction of the beam [k, 3]
    lift: Floats  # the scanner's place along y [k, 3]
    point: Floats  # [k, 3]
    distance: Floats  # mm from the start of the beam
    normal: Floats  # [k, 3]
    target: Ints
    albedo: Floats
    cos: Floats  # cosine of the incidence


@dataclass(frozen=True)
class _Views:
    """k rays of the camera and what they show by way of the surfaces that they meet."""

    point: Floats  # place on the surface, in the scanner's frame [k, 3]
    target: Ints
    cos: Floats  # cosine of the incidence
    away: Floats  # mirrored direction [k, 3]
    right: Floats  # unit vector across it, where the ray of a larger pixel goes [k, 3],
    up: Floats  # and that of a higher one [k, 3]
    far: Floats  # mm from the lens
    off_axis: Floats  # cosine of the angle between ray and lens's axis

    def along(self, place: Floats) -> Floats:
        """Return how far along the mirrored rays places are, mm [k]."""
        return dot(place - self.point, self.away)

    def left(self, place: Floats) -> Floats:
        """Return how far to the left of places the mirrored rays pass, mm [k]."""
        return dot(place - self.point, self.right)

    def below(self, place: Floats) -> Floats:
        """Return how far below places the mirrored rays pass, mm [k]."""
        return dot(place - self.point, self.up)


@dataclass(frozen=True)
class _Ways:
    """k ways from a spot to a mirror and on to the lens."""

    pixel: Floats
    near: Floats  # mm from the spot to the mirror
    leave: Floats  # cosine of the way with the spot's normal
    right_mm: Floats  # mm beside the spot that a pixel more at the lens is,
    wide: Floats  # the same for a radian: the length of the way, if the mirror is flat,
    tall: Floats  # and the same across the row
    below: Floats  # mm by which the way in the scan plane passes below the spot
    light: Floats  # share of the light of 1/sr at the spot that enters the pupil, sr


class Mirrors:
    """The glossy surfaces of a scene."""

    def __init__(self, light: Light, *, falloff: bool) -> None:
        """Prepare what all lines share; ``falloff``: whether the pupil is foreshortened."""
        self.light, self.falloff = light, falloff
        wavelength = light.scene.laser.wavelength_nm
        # The last entry is for the index -1, no target.
        each = [core(material, wavelength) for material in light.materials] + [(0.0, 0.0, 1.0)]
        self._gloss, self._scattered, self._sigma = np.array(each).T
        self._matt = np.array([material.reflectance for material in light.materials] + [0.0])
        self._camera = Camera.of(light.config, light.scene.lens.f_number)
        self._px_per_rad = light.config.geometry.focal_mm / light.config.geometry.pitch_mm

    def images(self, beam: Floats, y_mm: Floats) -> tuple[Images, Images, Images]:
        """Return the images of n lines: gloss to matt, matt to gloss, gloss to gloss.

        Args:
            beam: Direction of the beam, which starts at the origin, y = 0 [n, 3].
            y_mm: Position of the scanner along y [n].
        """
        lift = y_mm[:, None] * _UP
        hits = self.light.world.cast(lift.copy(), beam)
        cos = -dot(beam, hits.normal)
        rows = np.flatnonzero((hits.target >= 0) & (cos > _LEAST_COS))
        distance = hits.distance_mm[rows]
        first = _Spots(
            row=rows,
            ray=beam[rows],
            lift=lift[rows],
            point=distance[:, None] * beam[rows],
            distance=distance,
            normal=hits.normal[rows],
            target=hits.target[rows],
            albedo=hits.albedo[rows],
            cos=cos[rows],
        )
        matt = self._gloss_to_matt(first)
        spots, views, ways = self._ways(first)
        return (
            matt,
            self._matt_to_gloss(spots, views, ways),
            self._gloss_to_gloss(spots, views, ways, matt),
        )

    def _held(self, target: Ints, cos: Floats) -> Floats:
        """Return the share of light that the Gaussian lobe holds."""
        return np.asarray(self._gloss[target] * (1.0 - self._scattered[target] * cos))

    # -- gloss to matt --

    def _gloss_to_matt(self, first: _Spots) -> Images:
        light = self.light
        first = _of(first, self._gloss[first.target] > 0.0)
        second = meet(
            light.world,
            light.materials,
            light.scene,
            light.config,
            first.point,
            _mirrored(first.ray, first.normal),
            first.lift[:, 1],
            gloss=False,
            falloff=self.falloff,
        )
        lit = second.seen & (second.collected > 0.0) & (second.distance > _LEAST_MM)
        first, second = _of(first, lit), _of(second, lit)
        far, lean = second.distance, second.px_per_mm
        along, across = (1.0 + far * bend for bend in self._bend(first))
        high = self._px_per_rad / second.depth
        blur = far * self._sigma[first.target]
        return Images(
            row=first.row,
            place_px=second.position_px,
            high_px=high * second.point[:, 1],
            collected=second.collected * self._held(first.target, first.cos),
            depth_mm=second.depth,
            way_mm=first.distance + far,
            px_per_mm=lean * along,
            high_px_per_mm=high * across,
            px_per_rad=lean * (first.distance * along + far),
            lobe_px=blur / first.cos * np.abs(lean),
            lobe_high_px=blur * high,
            surface=second.target,
        )

    def _bend(self, first: _Spots) -> tuple[Floats, Floats]:
        """Return the angle by which mirrored light fans out, rad per mm, in and across the plane.

        Rays half a 1/e2 radius to either side tell; on a mesh that is the mean of some facets.
        """
        step = 0.5 * radius_mm(first.distance, self.light.scene.laser)
        found = []
        for way in (np.cross(_UP, first.ray), np.broadcast_to(_UP, first.ray.shape)):
            reach = step[:, None] * way
            sides = [self.light.world.cast(first.lift + d * reach, first.ray) for d in (-1.0, 1.0)]
            same = (sides[0].target == first.target) & (sides[1].target == first.target)
            low, high = (_mirrored(first.ray, side.normal) for side in sides)
            turn = dot(high - low, _mirrored(way, first.normal)) / (2.0 * step)
            found.append(np.where(same, turn, 0.0))
        return found[0], found[1]

    # -- what a glossy surface shows --

    def _matt_to_gloss(self, spots: _Spots, views: _Views, ways: _Ways) -> Images:
        back = -dot(spots.ray, spots.normal)
        # An offset of the beam in the scan plane moves the spot along its surface by so much.
        across = np.cross(_UP, spots.ray)
        slide = across + (dot(across, spots.normal) / back)[:, None] * spots.ray
        lean = dot(slide, views.right) / ways.right_mm
        # The mirror's image of the spot stands behind it as far as the fan of rays says.
        open_mm = ways.wide - ways.near
        behind = ways.near * views.far / np.where(open_mm == 0.0, 1.0, open_mm)
        depth = (views.far + np.where(open_mm == 0.0, np.inf, behind)) * views.off_axis
        high = self._px_per_rad / views.off_axis / ways.tall
        sigma = self._sigma[views.target] * ways.near
        matt = self._matt[spots.target] / np.pi * spots.albedo * ways.leave
        return Images(
            row=spots.row,
            place_px=ways.pixel,
            high_px=high * ways.below,
            collected=np.minimum(matt * ways.light, 1.0),
            depth_mm=np.where(depth > 0.0, np.clip(depth, _LEAST_MM, _FARTHEST_MM), _FARTHEST_MM),
            way_mm=spots.distance,
            px_per_mm=lean,
            high_px_per_mm=high,
            px_per_rad=lean * spots.distance,
            lobe_px=sigma / views.cos / np.abs(ways.right_mm),
            lobe_high_px=sigma * np.abs(high),
            surface=spots.target,
        )

    def _ways(self, first: _Spots) -> tuple[_Spots, _Views, _Ways]:
        """Return the brightest way of each line from its spot to a mirror and on to the lens."""
        at, pixel = self._search(first)
        spots = _of(first, at)
        views = self._look(pixel, spots.lift)
        astray = np.abs(views.left(spots.point)) * views.cos
        ahead = views.along(spots.point)
        good = (ahead > _LEAST_MM) & (views.cos > _LEAST_COS)
        good &= astray < _ASTRAY * self._sigma[views.target] * ahead
        good &= dot(views.point - spots.point, spots.normal) > 0.0
        spots, views, pixel = _of(spots, good), _of(views, good), pixel[good]
        place, near = spots.point, ahead[good]
        low, high = (self._look(pixel + d, spots.lift).left(place) for d in (-_APART_PX, _APART_PX))
        right_mm = (low - high) / (2.0 * _APART_PX)
        geometry = self.light.config.geometry
        _, slope = undistorted(pixel, geometry)
        wide = right_mm * geometry.focal_mm / slope / np.square(views.off_axis)
        below = views.below(place)
        tall = (below - self._look(pixel, spots.lift, _APART_RAD).below(place)) / _APART_RAD
        leave = dot(views.point - place, spots.normal) / near
        good = (np.abs(wide) > _LEAST_MM) & (np.abs(tall) > _LEAST_MM)
        good &= ~self.light.world.blocked(place + spots.lift, views.point + spots.lift)
        light = self._held(views.target, np.clip(views.cos, 0.0, 1.0)) * self._camera.pupil_mm2
        light /= np.maximum(np.abs(wide * tall), _LEAST_MM**2)
        light = np.where(good, light * views.off_axis if self.falloff else light, 0.0)
        ways = _Ways(pixel, near, leave, right_mm, wide, tall, below, light)
        order = np.lexsort((light, spots.row))
        best = order[np.append(np.diff(spots.row[order]) > 0, True)] if len(order) else order
        best = best[light[best] > 0.0]
        return _of(spots, best), _of(views, best), _of(ways, best)

    def _search(self, first: _Spots) -> tuple[Ints, Floats]:
        """Return spots, and the pixels whose mirrored rays meet them; a spot may have several."""
        at: list[Ints] = []
        ends: list[Floats] = []
        keys = np.round(first.lift[:, 1] / PAN_STEP_MM)
        for key in np.unique(keys):
            rows = np.flatnonzero(keys == key)
            pixel, views = self._coarse(float(key) * PAN_STEP_MM)
            glossy = self._gloss[views.target] > 0.0
            mirror = glossy[1:] & glossy[:-1] & (views.target[1:] == views.target[:-1])
            if not mirror.any():
                continue
            left, along = (
                np.einsum("ik,jk->ij", first.point[rows], way) - dot(views.point, way)
                for way in (views.right, views.away)
            )
            turns, ahead = left > 0.0, along > _LEAST_MM
            turns = (turns[:, 1:] != turns[:, :-1]) & ahead[:, 1:] & ahead[:, :-1] & mirror
            i, j = np.nonzero(turns)
            # The spot has to see one end of the piece of the mirror that may show it.
            place, normal = first.point[rows[i]], first.normal[rows[i]]
            sees = np.zeros(len(i), np.bool_)
            for end in (j, j + 1):
                sees |= dot(views.point[end] - place, normal) > 0.0
            i, j = i[sees], j[sees]
            at.append(rows[i])
            ends.append(np.stack([pixel[j], pixel[j + 1], left[i, j], left[i, j + 1]]))
        if not at:
            return np.zeros(0, np.int64), np.zeros(0)
        found = np.concatenate(at)
        which, pixel = self._refined(_of(first, found), *np.concatenate(ends, axis=1))
        return found[which], pixel

    def _refined(
        self, spots: _Spots, start: Floats, end: Floats, low: Floats, high: Floats
    ) -> tuple[Ints, Floats]:
        """Return which spots [k] a mirrored ray meets, and its pixel: regula falsi, Illinois.

        Where the miss changes its sign at an edge between two mirrors, no ray does.
        """
        found, left, at = np.full(len(start), np.nan), np.arange(len(start)), np.array(np.inf)
        most = _EDGE * np.abs(low - high)
        for _ in range(_ROUNDS):
            gap = low - high
            share = np.where(gap == 0.0, 0.5, low / np.where(gap == 0.0, 1.0, gap))
            pixel = start + np.clip(share, 0.0, 1.0) * (end - start)
            here = self._look(pixel, spots.lift).left(spots.point)
            found[left] = pixel
            same = (here > 0.0) == (low > 0.0)
            # The end that stays counts half, so that both ends come nearer.
            low, high = np.where(same, here, 0.5 * low), np.where(same, 0.5 * high, here)
            start, end = np.where(same, pixel, start), np.where(same, end, pixel)
            edge = np.abs(here) > most
            found[left[edge]] = np.nan
            more = ~edge & (np.abs(pixel - at) > _FOUND_PX)
            spots, left, pixel, most = _of(spots, more), left[more], pixel[more], most[more]
            start, end, low, high = start[more], end[more], low[more], high[more]
            if len(left) == 0:
                break
            at = pixel
        which = np.flatnonzero(~np.isnan(found))
        return which, found[which]

    def _coarse(self, y_mm: float) -> tuple[Floats, _Views]:
        """Return the pixels of ``Light.view`` and what they show by way of a mirror."""
        point, normal, target, _ = self.light.view(y_mm)
        return self.light.view_px, self._views(point, normal, target)

    def _look(self, pixel: Floats, lift: Floats, up_rad: float = 0.0) -> _Views:
        """Return what pixels show, or the places so much higher than they."""
        camera, geometry = self._camera, self.light.config.geometry
        u, _ = undistorted(pixel, geometry)
        ray = camera.axis + (u / geometry.focal_mm)[:, None] * camera.side
        ray /= np.sqrt(dot(ray, ray))[:, None]
        ray += up_rad * _UP
        ray /= np.sqrt(dot(ray, ray))[:, None]
        hits = self.light.world.cast(camera.place + lift, ray)
        far = np.where(hits.target >= 0, hits.distance_mm, 0.0)
        return self._views(camera.place + far[:, None] * ray, hits.normal, hits.target)

    def _views(self, point: Floats, normal: Floats, target: Ints) -> _Views:
        camera = self._camera
        ray = point - camera.place
        far = np.sqrt(dot(ray, ray))
        ray = np.where(far[:, None] > 0.0, ray / np.maximum(far, 1e-9)[:, None], camera.axis)
        # Across the ray, in the scan plane; rising pixels are on the side of ``camera.side``.
        right = np.cross(ray, _UP)
        right *= np.sign(camera.side @ np.cross(camera.axis, _UP))
        right /= np.sqrt(dot(right, right))[:, None]
        up = _UP - dot(ray, np.broadcast_to(_UP, ray.shape))[:, None] * ray
        return _Views(
            point=point,
            target=target,
            cos=-dot(ray, normal),
            away=_mirrored(ray, normal),
            right=_mirrored(right, normal),
            up=_mirrored(up, normal),
            far=far,
            off_axis=ray @ camera.axis,
        )

    # -- gloss to gloss --

    def _gloss_to_gloss(self, spots: _Spots, views: _Views, ways: _Ways, matt: Images) -> Images:
        """Return the beams that two surfaces mirror into the lens.

        In the mirror the lens sees the first spot, whose lobe is widened by that of the mirror as
        it appears at the spot. The image is between the place where the beam's axis meets the
        mirror and that of the mirror image: at the one if the mirror's lobe is the wide one, at the
        other if the first surface's is.
        """
        _, own, other = np.intersect1d(spots.row, matt.row, assume_unique=True, return_indices=True)
        same = (matt.surface[other] == views.target[own]) & (self._gloss[spots.target[own]] > 0.0)
        own, matt = own[same], _of(matt, other[same])
        spots, views, ways = _of(spots, own), _of(views, own), _of(ways, own)
        lobe, mirror = self._sigma[spots.target], self._sigma[views.target]
        # Mirror and spot see each other above or below the plane of the camera's ray.
        above = ways.below / ways.tall
        way = views.point - spots.point + (above * views.far)[:, None] * _UP
        toward = way / np.maximum(np.sqrt(dot(way, way)), _LEAST_MM)[:, None]
        half = toward - spots.ray
        half -= dot(half, spots.normal)[:, None] * spots.normal
        in_plane = np.cross(_UP, spots.normal)
        in_plane /= np.maximum(np.sqrt(dot(in_plane, in_plane)), 1e-9)[:, None]
        leave = ways.leave
        # Squares of the sigmas in direction cosines of the first surface, along and across the row.
        first = np.square(lobe)
        along = first + np.square(mirror * views.far * leave / views.cos / ways.wide)
        across = first + np.square(mirror * views.far / ways.tall)
        disc = self._camera.pupil_mm2 / np.pi * leave / np.abs(ways.wide * ways.tall)
        disc = np.maximum(0.5 * disc / np.sqrt(along * across), 1e-12)
        wider = disc / -np.expm1(-disc)  # as in ``surface.brdf``
        square = np.square(dot(half, in_plane)) / along + np.square(half[:, 1]) / across
        lobes = np.exp(-0.5 * square / wider) / (2.0 * np.pi * np.sqrt(along * across) * wider)
        held = self._held(spots.target, spots.cos)
        shift, rise = first / along, first / across
        shown = above * self._px_per_rad / views.off_axis
        return Images(
            row=spots.row,
            place_px=matt.place_px + shift * (ways.pixel - matt.place_px),
            high_px=matt.high_px + rise * (shown - matt.high_px),
            collected=np.minimum(held * lobes * leave * ways.light, 1.0),
            depth_mm=matt.depth_mm
            * (ways.near + views.far)
            / (ways.near * (1.0 - shift) + views.far),
            way_mm=matt.way_mm,
            px_per_mm=matt.px_per_mm,
            high_px_per_mm=matt.high_px_per_mm,
            px_per_rad=matt.px_per_rad,
            lobe_px=matt.lobe_px * np.sqrt(1.0 - shift),
            lobe_high_px=matt.lobe_high_px * np.sqrt(1.0 - rise),
            surface=matt.surface,
        )


def _of(some: _Each, rows: Ints | Bools) -> _Each:
    """Return some rows of a record of arrays."""
    chosen: _Each = replace(some, **{name: value[rows] for name, value in vars(some).items()})
    return chosen


def _mirrored(way: Floats, normal: Floats) -> Floats:
    """Return directions after a mirror."""
    return np.asarray(way - 2.0 * dot(way, normal)[:, None] * normal)
