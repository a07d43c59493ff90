"""What all lines of a scene share; each part is computed once, when first needed."""

import copy
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config
from vrscan.data.errors import InputError, blamed
from vrscan.ideal.geometry import ThinLens, undistorted
from vrscan.scene.beam import radius_mm
from vrscan.scene.description import Description
from vrscan.scene.ghosts import Ghosts, Stack, ghosts, stack
from vrscan.scene.image import Singles
from vrscan.scene.radiometry import photoelectrons
from vrscan.scene.scatter import (
    MOST_SCATTERED,
    Halo,
    Scatter,
    emitter,
    halo_weights,
    intensity,
    receiver,
)
from vrscan.scene.sensor import FixedPattern, chunks, fixed_pattern
from vrscan.scene.shapes import dot
from vrscan.scene.speckle import Speckle
from vrscan.scene.spots import Camera
from vrscan.scene.stray import Stray, WindowGhost, dust_shadow, obscured_share, window_ghost
from vrscan.scene.sun import Lamp, Sun, collection, pixel_electrons
from vrscan.scene.targets import World
from vrscan.scene.timeline import Timeline
from vrscan.scene.tolerances import Instrument

VIEW_STEP = 8  # px between the rays on which the camera's view is sampled
_VIEWS = 64  # number of views of a moving scanner that are kept
PAN_STEP_MM = 1.0  # distance over which a moving scanner's view counts as the same
_SKIRT_STEP = 5e-5  # rad between the angles at which the scan head's scatter is kept
_SKIRT_ANGLES = 400  # angles at which it is computed
_STRAY = ("scatter", "emitter", "halo", "halo_table", "obscured", "shadow", "_stack", "_skirt_gain")
_FOCUSED = ("halo", "halo_table", "shadow", "_skirt_gain")  # what changes with the focus
_FARTHEST_MM = 1000.0  # least distance at which a ray that meets nothing ends

View = tuple[Floats, Floats, Ints, Floats]  # points, normals [m, 3], targets and albedo [m]
_Real = TypeVar("_Real", np.float32, np.float64)


@dataclass(frozen=True)
class Windows:
    """A part of each of n lines, of the same width and within the sensor's ends."""

    first: Ints  # its first pixel [n]
    width: int

    def of(self, lines: Ints) -> "Windows":
        """Return those of some lines."""
        return Windows(self.first[lines], self.width)

    def between(self, values: Singles) -> Singles:
        """Return a value for each pixel [n, width] from those of every eighth of the lines [n, k].

        They are those of ``Light.whole_row``.
        """
        column = self.first[:, None] + np.arange(self.width)
        place, rest = np.divmod(column, VIEW_STEP)
        low, high = (np.take_along_axis(values, place + k, axis=1) for k in (0, 1))
        return (high - low) * (rest / VIEW_STEP).astype(values.dtype) + low


class Light:
    """A scene and an instrument that looks at it.

    Args:
        scene: The scene, completed by ``Description.of``.
        config: What the instrument believes, ``belief``; ``config`` is what it is, which differs
            where the scene has an instrument of its own.

    Raises:
        InputError: if a mesh or map does not load, the laser is above its rating or not in the
            filter's band, the exposure is shorter than its pulse or longer than a line, the lens is
            focused nearer than its focal length, the sun is not above the horizon, or receiver or
            scan head scatters more than half of its light.
    """

    def __init__(self, scene: Description, config: Config) -> None:
        scene = scene.of(config)
        self.scene, self.belief = scene, config
        if scene.instrument is not None:
            with blamed(scene.source):
                focus, start = scene.lens.focus_mm, scene.scan.start_s
                config = scene.instrument.true(config, focus, start)
        self.config = config
        if scene.laser.power_mw > config.laser.rated_mw:
            raise InputError(
                f"{scene.source}: laser.power_mw = {scene.laser.power_mw:g}: above the rated "
                f"{config.laser.rated_mw:g} mW"
            )
        with blamed(scene.source):
            self.world = World(scene.target, scene.folder)
            if scene.sun is not None:
                scene.sun.towards()  # raises an error at night
        self.materials = tuple(scene.material_of(target.material) for target in scene.target)
        self.names = tuple(dict.fromkeys(self.world.names))
        # The last entry is for the index -1, no target.
        self.groups = np.array([self.names.index(n) for n in self.world.names] + [-1], np.int64)
        # Of each target's surface, then of the light from beneath each, then of no target.
        below = [each.subsurface.looks if each.subsurface else 1.0 for each in self.materials]
        self.looks = scene.speckle.looks * np.array(
            [material.patterns for material in self.materials] + below + [1.0]
        )
        self.exposure_s = (
            1e-6 * scene.exposure_us if scene.exposure_us is not None else 1 / config.line.rate_hz
        )
        if self.exposure_s > 1.0 / config.line.rate_hz * (1 + 1e-9):
            raise InputError(
                f"{scene.source}: exposure_us = {scene.exposure_us:g}: longer than the line period"
            )
        if self.exposure_s < 1e-6 * config.line.pulse_us * (1 - 1e-9):
            raise InputError(
                f"{scene.source}: exposure_us = {scene.exposure_us:g}: shorter than the laser's "
                f"pulse of {config.line.pulse_us:g} us"
            )
        low, high = scene.lens.filter_nm
        if not low <= scene.laser.wavelength_nm <= high:
            raise InputError(
                f"{scene.source}: laser.wavelength_nm = {scene.laser.wavelength_nm:g}: outside "
                f"lens.filter_nm, {low:g} to {high:g}"
            )
        self.lens = ThinLens.of(scene.lens.f_number, scene.lens.focus_mm, config.geometry)
        ends = np.abs(self.world.bounds)
        self.farthest_mm = float(ends[np.isfinite(ends)].max(initial=_FARTHEST_MM))
        # Where spots need rays, by tolerance and effects; see pieces.
        self.split_maps: dict[tuple[float, frozenset[str], float], tuple[float, Bools, Floats]] = {}
        self._views: dict[int, View] = {}
        self.bounces: dict[int, tuple[Singles, Singles, Floats]] = {}  # see bounce
        self._skirts: dict[int, tuple[Singles, Singles]] = {}
        self._refuse_fog()

    @cached_property
    def pattern(self) -> FixedPattern:
        """Return the sensor's fixed pattern."""
        return fixed_pattern(self.scene.sensor, self.scene.seed, self.config.sensor.line_length)

    @cached_property
    def speckle(self) -> Speckle:
        """Return the speckle, the gain of each pixel."""
        geometry = self.config.geometry
        return Speckle(
            self.scene.seed,
            self.config.sensor.line_length,
            self.lens,
            wavelength_nm=self.scene.laser.wavelength_nm,
            pitch_mm=geometry.pitch_mm,
        )

    # -- the lens in motion --

    def focused(self, focus_mm: float, *, afresh: bool) -> "Light":
        """Return the same scene through the lens in focus at another depth.

        The image's scale is that of (4) with the sensor's distance from the lens; without a
        reference in the scene's ``[instrument]`` the configuration's scale is that of
        ``free.focus_mm``. Grains of speckle keep the size that they have at this light's focus,
        which changes by a twentieth over the lens's travel.

        Args:
            focus_mm: Depth along the axis that is in focus.
            afresh: Whether all light beside the spot is worked out anew; otherwise it is that of
                this light, whose focus is near.

        Raises:
            InputError: if the focus is not farther away than the focal length.
        """
        scene, belief = self.scene, self.belief
        own = Instrument() if scene.instrument is None else scene.instrument
        if own.reference_focus_mm is None:
            own = own.model_copy(update={"reference_focus_mm": belief.free.focus_mm})
        lens = scene.lens.model_copy(update={"focus_mm": focus_mm})
        other = copy.copy(self)
        other.scene = scene.model_copy(update={"lens": lens, "instrument": own})
        with blamed(scene.source):
            other.config = own.true(belief, focus_mm, scene.scan.start_s)
            other.lens = ThinLens.of(lens.f_number, focus_mm, other.config.geometry)
        other.__dict__["speckle"] = speckle = copy.copy(self.speckle)
        speckle.lens = other.lens
        if afresh:
            for name in _FOCUSED:
                other.__dict__.pop(name, None)
            other.split_maps = {}
            other._views, other.bounces, other._skirts = {}, {}, {}
        else:
            other.__dict__.update({name: getattr(self, name) for name in _FOCUSED})
        return other

    # -- stray light --

    def with_stray(self, stray: Stray) -> "Light":
        """Return the same scene with another table of stray light; what is known is shared.

        Raises:
            InputError: if receiver or scan head scatters more than half of its light.
        """
        other = copy.copy(self)
        other.scene = self.scene.model_copy(update={"stray": stray})
        for name in _STRAY:
            other.__dict__.pop(name, None)
        other._skirts = {}
        other._refuse_fog()
        return other

    def _refuse_fog(self) -> None:
        for name, scatter in (("receiver", self.scatter), ("scan head", self.emitter)):
            if scatter.total > MOST_SCATTERED:
                shares = scatter.shares()
                most = max(shares, key=lambda cause: shares[cause])
                raise InputError(
                    f"{self.scene.source}: stray: the {name} scatters {scatter.total:.2g} of the "
                    f"light, most of it by {most}; more than {MOST_SCATTERED:g} is no instrument"
                )

    @cached_property
    def scatter(self) -> Scatter:
        """Return what scatters in the receiver."""
        return receiver(
            self.scene.stray,
            focal_mm=self.config.geometry.focal_mm,
            f_number=self.scene.lens.f_number,
            wavelength_nm=self.scene.laser.wavelength_nm,
        )

    @cached_property
    def emitter(self) -> Scatter:
        """Return what scatters in the scan head."""
        return emitter(
            self.scene.stray,
            face_mm=self.config.geometry.focal_mm / self.scene.lens.f_number,
            wavelength_nm=self.scene.laser.wavelength_nm,
        )

    @cached_property
    def halo(self) -> Halo:
        """Return the scatter of the receiver, to either end of the sensor from either end.

        Its row share depends on the height of the spot; it is that of a spot in focus.
        """
        return halo_weights(
            2 * self.config.sensor.line_length,
            self.scatter,
            sigma_px=self.sharp_sigma_px,
            pitch_mm=self.config.geometry.pitch_mm,
        )

    @cached_property
    def halo_table(self) -> Singles:
        """Return the halo about its middle at 2 L, float32 [4 L], as wide as the spot is high.

        It is in shares of the light that is not scattered.
        """
        weights = self.halo.weights / (1.0 - self.halo.total)
        reach = math.ceil(5.0 * self.sharp_sigma_px) + 1
        spot = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / self.sharp_sigma_px))
        spread = np.convolve(np.append(weights[:0:-1], weights), spot / spot.sum(), "same")
        return np.append(0.0, spread).astype(np.float32)

    @property
    def sharp_sigma_px(self) -> float:
        """Return the sigma of a spot in focus on an upright surface."""
        geometry, focus = self.config.geometry, self.scene.lens.focus_mm
        width = float(radius_mm(np.array([focus]), self.scene.laser)[0])
        return 0.5 * width * geometry.focal_mm / geometry.pitch_mm / focus

    @cached_property
    def obscured(self) -> float:
        """Return the share of light that dust on the pupil absorbs."""
        focal = self.config.geometry.focal_mm
        return obscured_share(self.scene.stray, focal_mm=focal, f_number=self.scene.lens.f_number)

    @cached_property
    def shadow(self) -> Singles:
        """Return the share of each pixel's light that passes the cover's dust, float32 [length]."""
        return dust_shadow(
            self.scene.stray,
            self.config.sensor.line_length,
            self.scene.seed,
            pitch_mm=self.config.geometry.pitch_mm,
            f_number=self.lens.working,
        ).astype(np.float32)

    @cached_property
    def _stack(self) -> Stack:
        geometry = self.config.geometry
        with blamed(self.scene.source):
            return stack(
                self.scene.stray,
                focal_mm=geometry.focal_mm,
                f_number=self.scene.lens.f_number,
                pitch_mm=geometry.pitch_mm,
                length_px=self.config.sensor.line_length,
                centre_px=geometry.centre_px,
            )

    def ghosts(self, depth_mm: Floats, field_mm: Floats) -> Ghosts:
        """Return the ghosts of spots at these depths and image heights [n]."""
        focus = np.full(len(depth_mm), self.scene.lens.focus_mm)
        return ghosts(self._stack, focus, depth_mm, field_mm)

    def window_ghost(self, angle_rad: Floats) -> WindowGhost:
        """Return the second beam of the scan head's window [n], without power if there is none."""
        stray = self.scene.stray
        found = window_ghost(stray.head_window, angle_rad)
        if "head_window" in stray.enabled:
            return found
        return replace(found, power=np.zeros_like(found.power))

    # -- what the camera sees --

    @property
    def view_px(self) -> Floats:
        """Return the pixels for which the camera's view is computed, and one after the last."""
        count = -(-self.config.sensor.line_length // VIEW_STEP) + 1
        return VIEW_STEP * np.arange(count, dtype=np.float64)

    def view(self, y_mm: float) -> View:
        """Return what the camera sees: points, normals, target (-1 for none) and albedo.

        It is computed for every eighth pixel. Points are in the scanner's frame, which is at
        ``y_mm``.
        """
        key = round(y_mm / PAN_STEP_MM)
        if key not in self._views:
            y = key * PAN_STEP_MM
            if len(self._views) == _VIEWS:
                self._views.pop(next(iter(self._views)))  # the oldest
            self._views[key] = self.look(self.view_px, y)
        return self._views[key]

    def look(self, pixel: Floats, y_mm: float) -> View:
        """Return what some pixels see, as ``view`` does."""
        camera = Camera.of(self.config, self.scene.lens.f_number)
        u, _ = undistorted(pixel, self.config.geometry)
        ray = camera.axis + (u / self.config.geometry.focal_mm)[:, None] * camera.side
        ray /= np.linalg.norm(ray, axis=1)[:, None]
        start = np.broadcast_to(camera.place, ray.shape) + np.array([0.0, y_mm, 0.0])
        hits = self.world.cast(start, ray)
        distance = np.where(hits.target >= 0, hits.distance_mm, 0.0)
        return camera.place + distance[:, None] * ray, hits.normal, hits.target, hits.albedo

    def off_axis_rad(self, pixel: Floats) -> Floats:
        """Return the angle from the axis at which pixels look."""
        u, _ = undistorted(pixel, self.config.geometry)
        return np.asarray(np.arctan(u / self.config.geometry.focal_mm))

    def whole_row(self, values: npt.NDArray[_Real]) -> npt.NDArray[_Real]:
        """Return a value for each pixel [..., length] from one for every eighth."""
        share = (np.arange(VIEW_STEP) / VIEW_STEP).astype(values.dtype)
        found = np.diff(values)[..., None] * share
        found += values[..., :-1, None]
        return found.reshape(*values.shape[:-1], -1)[..., : self.config.sensor.line_length]

    def diffuse(self, target: Ints, albedo: Floats) -> Floats:
        """Return the reflectance of places on targets, 0 where the target is -1 [n]."""
        known = np.array([material.reflectance for material in self.materials] + [0.0])
        return known[target] * albedo

    def ambient(self, name: str, y_mm: float) -> Floats:
        """Return the electrons that sun or lamps put into each pixel in an exposure [length].

        Surfaces are Lambert's. The sun's direct part is hidden by the scene's own targets.

        Args:
            name: ``sun``, or ``lamps`` for the mean of their flicker.
            y_mm: Position of the scanner along y.
        """
        found = np.zeros(self.config.sensor.line_length)
        for source in self._sources(name):
            found += self._ambient_of(source, y_mm)
        return found

    def changing_ambient(self, names: Iterable[str], timeline: Timeline) -> Singles:
        """Return the electrons of ambient light where views or times differ by line [n, length].

        Args:
            names: Names as in ``ambient``.
            timeline: n lines, which give the scanner's position and the phase of the lamps'
                flicker.
        """
        found = np.zeros((len(timeline), self.config.sensor.line_length), np.float32)
        keys = np.round(timeline.y_mm / PAN_STEP_MM).astype(np.int64)
        for source in (source for name in names for source in self._sources(name)):
            level = np.ones(len(timeline))
            if isinstance(source, Lamp):
                level = source.level(timeline.time_s)
            for key in np.unique(keys).tolist():
                rows = np.flatnonzero(keys == key)
                light = self._ambient_of(source, key * PAN_STEP_MM)
                found[rows] += (level[rows, None] * light).astype(np.float32)
        return found

    def flicker_e(self) -> float:
        """Return the largest change of a pixel from its mean by the lamps' flicker, electrons."""
        return sum(
            lamp.depth * float(self._ambient_of(lamp, 0.0).max()) for lamp in self.scene.lamp
        )

    def _sources(self, name: str) -> list[Sun | Lamp]:
        if name == "sun":
            return [] if self.scene.sun is None else [self.scene.sun]
        return list(self.scene.lamp)

    def _ambient_of(self, source: Sun | Lamp, y_mm: float) -> Floats:
        point, normal, target, albedo = self.view(y_mm)
        scene = self.scene
        hit = target >= 0
        shaded = np.zeros(len(target), np.bool_)
        if isinstance(source, Sun):
            start = point + np.array([0.0, round(y_mm / PAN_STEP_MM) * PAN_STEP_MM, 0.0])
            far = start + 4.0 * (self.farthest_mm + 1.0) * source.towards()
            shaded[hit] = self.world.blocked(start[hit], far[hit])
        band = scene.lens.filter_nm
        irradiance = source.in_band_irradiance(normal, shaded=shaded, band_nm=band)
        radiance = np.where(hit, self.diffuse(target, albedo) * irradiance / np.pi, 0.0)
        electrons = pixel_electrons(
            radiance,
            f_number=scene.lens.f_number,
            pixel_um2=np.square(1e3 * self.config.geometry.pitch_mm),
            exposure_s=self.exposure_s,
            quantum_efficiency=scene.sensor.quantum_efficiency,
            transmission=scene.lens.transmission * scene.lens.filter_transmission,
            off_axis_rad=self.off_axis_rad(self.view_px),
            wavelength_nm=0.5 * sum(band),
        )
        return self.whole_row(electrons)

    def veil_e(self) -> float:
        """Return the electrons that sun and lamps outside the field put into each pixel.

        Their irradiance on the window over ``out_of_field``, in the filter's band, evenly over the
        sensor. The sun's direct part is left out where the scene hides it from the lens. The light
        of the laser's own spots beyond the sensor is left out: 1e-10 of it comes to a pixel.
        """
        scene = self.scene
        camera = Camera.of(self.config, scene.lens.f_number)
        irradiance = 0.0
        for source in (*self._sources("sun"), *self._sources("lamps")):
            shaded: Bools | bool = False
            if isinstance(source, Sun):
                far = camera.place + 4.0 * (self.farthest_mm + 1.0) * source.towards()
                shaded = self.world.blocked(camera.place[None], far[None])
            band = scene.lens.filter_nm
            lit = source.in_band_irradiance(camera.axis[None], shaded=shaded, band_nm=band)
            irradiance += float(lit[0])
        area_m2 = np.square(1e-3 * self.config.geometry.pitch_mm)
        power_w = irradiance / scene.stray.out_of_field * area_m2
        return float(
            photoelectrons(
                power_w,
                self.exposure_s,
                scene.sensor.quantum_efficiency,
                0.5 * sum(scene.lens.filter_nm),
            )
        )

    # -- the scan head's scatter --

    def add_skirt(
        self,
        field: Singles,
        electrons: float,
        angle_rad: Floats,
        y_mm: Floats,
        windows: Windows | None = None,
    ) -> None:
        """Add the light that the scan head scatters beside the beam.

        The pixels' own points are lit over the angle between them and the beam in the plane of the
        scan, where they are not hidden from the pivot; what they see of it is Lambert's. The beam's
        own width is left out but for the angle below which the light does not grow any more.

        Args:
            field: The lines [n, length], or the windows of them [n, width].
            electrons: What is left of the beam, electrons, if all of it went through the lens.
            angle_rad: Angle of each line [n].
            y_mm: Position of the scanner along y [n].
            windows: What of each line ``field`` holds; all of it if None.
        """
        width = field.shape[1]
        keys = np.round(y_mm / PAN_STEP_MM).astype(np.int64)
        table = self._skirt_gain * np.float32(electrons)
        for key in np.unique(keys).tolist():
            if key not in self._skirts:
                if len(self._skirts) >= _VIEWS:
                    self._skirts.clear()
                self._skirts[key] = self._skirt_seen(key * PAN_STEP_MM)
            heading, gain = self._skirts[key]
            steps = sliding_window_view(heading * np.float32(1.0 / _SKIRT_STEP), width)
            gains = sliding_window_view(gain, width)
            turned = (angle_rad / _SKIRT_STEP).astype(np.float32)[:, None]
            here = np.flatnonzero(keys == key)
            for some in chunks(len(here), width):
                rows = here[some]
                begin = slice(1) if windows is None else windows.first[rows]
                apart = steps[begin] - turned[rows]
                place = np.abs(apart, out=apart).astype(np.int32)
                table.take(place, mode="clip", out=apart)
                apart *= gains[begin]
                field[rows] += apart

    @cached_property
    def _skirt_gain(self) -> Singles:
        """Return the light per solid angle at steps of the angle from the beam."""
        laser = self.scene.laser
        waist = float(radius_mm(np.array([self.scene.lens.focus_mm]), laser)[0])
        angle = np.geomspace(waist / self.scene.lens.focus_mm, 1.5, _SKIRT_ANGLES)
        light = intensity(self.emitter, angle)
        steps = (np.arange(int(1.5 / _SKIRT_STEP)) + 0.5) * _SKIRT_STEP
        left = 1.0 - self.emitter.total
        return np.asarray(np.interp(steps, angle, light / left), np.float32)

    def _skirt_seen(self, y_mm: float) -> tuple[Singles, Singles]:
        """Return the directions from the pivot to what the pixels see, and how they see it.

        A panning scanner sees each place in few lines: there every eighth pixel is followed.
        """
        panning = self.scene.scan.pan_mm_per_s != 0.0
        length = self.config.sensor.line_length
        pixel = self.view_px if panning else np.arange(length, dtype=np.float64)
        point, normal, target, albedo = self.view(y_mm) if panning else self.look(pixel, y_mm)
        lift = np.array([0.0, y_mm, 0.0])
        away = np.linalg.norm(point, axis=1)
        seen = (target >= 0) & (away > 0.0)
        away = np.where(seen, away, 1.0)
        facing = np.where(seen, -dot(point, normal) / away, 0.0)
        seen &= facing > 1e-9
        some = point[seen] + lift
        hidden = self.world.blocked(np.broadcast_to(lift, some.shape), some)
        lit = np.zeros(len(pixel))
        lit[seen] = np.where(hidden, 0.0, facing[seen] / np.square(away[seen]))
        seen_sr = collection(self.scene.lens.f_number, self.off_axis_rad(pixel))
        area = np.square(self.config.geometry.pitch_mm)
        gain = lit * self.diffuse(target, albedo) / np.pi * area * seen_sr
        heading = np.arctan2(point[:, 0], point[:, 2])
        if panning:
            heading, gain = self.whole_row(heading), self.whole_row(gain)
        return heading.astype(np.float32), gain.astype(np.float32)
