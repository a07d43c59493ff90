"""Ghosts: light that surfaces of the receiver reflect two or more times before the sensor.

Every surface is plane or curved, may be tilted, and acts on a ray as a 3 x 3 matrix on (y, slope,
1): y in mm, the slope dy/dz in the frame of the lens, in whichever direction the light runs. The
axis y of the first plane is the sensor's u, that of the second runs across the row. Reflections
then need no unfolding: the path is the product of the matrices in the order in which the light
meets them.

The model leaves out aberrations (it is paraxial), diffraction, polarisation and the change of a
coating with the angle, absorption in the glass, light that a mount or the sensor's package
reflects, and interference between the two faces of a thin plate.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, pairwise

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.errors import InputError
from vrscan.scene.stray import Plate, Stray, disc_overlap

_MARGIN_PX = 20.0  # size of a spot: a ghost that far beside the row still lights it
_NEAREST_MM = 1.0  # least distance that is imaged

Double = tuple[int, int]  # two surfaces that reflect light to and fro: near, far
Path = tuple[Double, ...]


@dataclass(frozen=True)
class Surface:
    """One surface of the receiver."""

    name: str
    before: float  # refractive index towards the object
    after: float  # refractive index towards the sensor
    gap_mm: float  # gap to the next surface; behind the lens that of focus at infinity
    reflectance: float = 0.0
    curvature: float = 0.0  # mm^-1, positive with the centre towards the sensor
    power: float = 0.0  # mm^-1, for an ideal thin lens
    tilt_rad: float = 0.0  # about the axis across the row
    across_rad: float = 0.0  # about the row


@dataclass(frozen=True)
class Ghosts:
    """Ghosts [g] of spots [n]; the spots may have any shape."""

    names: tuple[str, ...]  # "near surface + far surface", a later reflection first, and so on
    offset_px: Floats  # [g, n] along the row, from the spot to the ghost's middle
    across_px: Floats  # [g, n] across the row
    blur_px: Floats  # [g, n] radius of the ghost's disc
    power: Floats  # [g, n] share of the spot's light, 0 where the ghost misses the sensor
    # [n] share of the light in all other ghosts, whatever their reflections, and in what misses the
    # sensor
    dropped: Floats


@dataclass(frozen=True)
class Stack:
    """The receiver from its front window to the sensor, which is the last surface."""

    surfaces: tuple[Surface, ...]
    stop: int  # the surface at which the stop lies
    moving: int  # the surface behind which the gap changes with the focus
    f_number: float
    focal_mm: float
    pitch_mm: float
    length_px: int
    centre_px: float
    least_power: float
    least_density: float  # least share of the light per pixel

    @cached_property
    def _doubles(self) -> dict[Double, float]:
        """Return the power of each double reflection (near, far) over that of light without it.

        It is the product of the two reflectances; the surfaces between the two are crossed twice
        more.
        """
        active = [k for k, surface in enumerate(self.surfaces) if surface.reflectance > 0.0]
        kept = [1.0 - surface.reflectance for surface in self.surfaces]
        return {
            (near, far): self.surfaces[near].reflectance
            * self.surfaces[far].reflectance
            * math.prod(kept[near + 1 : far]) ** 2
            for near in active
            for far in active
            if near < far
        }

    @cached_property
    def paths(self) -> tuple[Path, ...]:
        """Return the ways of light to the sensor that have ``least_power``, but for the direct one.

        A way is its double reflections (near, far) in turn. The first reflection of each but the
        first is behind the last reflection of the one before.
        """
        found: list[Path] = []

        def follow(way: Path, power: float) -> None:
            for double, part in self._doubles.items():
                if power * part >= self.least_power and (not way or double[1] > way[-1][0]):
                    found.append((*way, double))
                    if self.least_power > 0.0:  # else there is no end to them
                        follow((*way, double), power * part)

        follow((), 1.0)
        return tuple(found)

    @cached_property
    def bare(self) -> Floats:
        """Return the power of each path's ghost over the direct light's, before clipping [g]."""
        powers = [math.prod(self._doubles[double] for double in path) for path in self.paths]
        return np.array(powers, dtype=np.float64)

    @cached_property
    def total(self) -> float:
        """Return the power of all ghosts, of however many reflections, over the direct light's.

        Surfaces are added one by one: light that runs to and fro between a surface and those in
        front of it is a geometric series.
        """
        behind, light = 0.0, 1.0  # what the surfaces so far send back towards the sensor
        for surface in self.surfaces:
            series = 1.0 / (1.0 - behind * surface.reflectance)
            light *= series
            behind = surface.reflectance + (1.0 - surface.reflectance) ** 2 * behind * series
        return light - 1.0

    @cached_property
    def _degree(self) -> int:
        """Return the degree of the paths as polynomials of the travel.

        A path crosses the moving gap once, and twice more for each of its double reflections.
        """
        return 1 + 2 * max((len(path) for path in self.paths), default=0)

    def _powers(self, travel: Floats) -> Floats:
        """Return the powers of the travel that the polynomials take [p, ...]."""
        return np.stack([travel**k for k in range(self._degree + 1)])

    @cached_property
    def _direct(self) -> tuple[Floats, Floats]:
        """Return the direct path's rows at stop and sensor [plane, 3, power of travel]."""
        visits = self._trace([(k, 1) for k in range(len(self.surfaces))])
        return visits[self.stop], visits[-1]

    @cached_property
    def _paths(self) -> tuple[Floats, Floats, Ints]:
        """Return rows on the sensor and at further crossings of the stop, and the latter's ghosts.

        Their shapes are [g, 2, 3, p], [e, 2, 3, p] and [e].
        """
        ends, crossings, owners = [], [], []
        last = len(self.surfaces) - 1
        for number, path in enumerate(self.paths):
            route: list[tuple[int, int]] = []
            start = 0
            for near, far in path:
                route += [(k, 1) for k in range(start, far)]
                route += [(far, 0)]
                route += [(k, -1) for k in range(far - 1, near, -1)]
                route += [(near, 0)]
                start = near + 1
            route += [(k, 1) for k in range(start, last + 1)]
            visits = self._trace(route)
            ends.append(visits[-1])
            at_stop = [visits[step] for step, (k, _) in enumerate(route) if k == self.stop]
            crossings += at_stop[1:]
            owners += [number] * len(at_stop[1:])
        empty = np.zeros((0, 2, 3, self._degree + 1))
        return (
            np.array(ends) if ends else empty,
            np.array(crossings) if crossings else empty,
            np.array(owners, dtype=np.int64),
        )

    @cached_property
    def pupil_mm(self) -> float:
        """Return how far the entrance pupil, where distances start, is behind the first vertex."""
        stop, _ = self._direct
        return float(stop[0, 1, 0] / stop[0, 0, 0])

    @cached_property
    def stop_mm(self) -> float:
        """Return the radius of the stop, from the f-number at infinity."""
        stop, _ = self._direct
        return float(abs(stop[0, 0, 0])) * 0.5 * self.focal_mm / self.f_number

    def travel(self, focus_mm: Floats) -> Floats:
        """Return the travel of the lens, mm, when it is focused at a distance; any shape."""
        _, end = self._direct
        near = 1.0 / np.maximum(np.asarray(focus_mm, dtype=np.float64), _NEAREST_MM)
        gap = 1.0 - self.pupil_mm * near
        steady = end[0, 0, 0] * gap + end[0, 1, 0] * near
        moving = end[0, 0, 1] * gap + end[0, 1, 1] * near
        return np.asarray(-steady / moving)

    def _trace(self, route: Sequence[tuple[int, int]]) -> list[Floats]:
        """Return (A, B, C) of y = A y1 + B slope1 + C at every step, as polynomials of the travel.

        Args:
            route: Surfaces in the order of the path, and the action of each: 1 and -1 let light
                through forwards and backwards, 0 reflects it.

        Returns:
            One array [plane, 3, power of travel] for each step, where the light meets the surface.
        """
        place = np.cumsum([0.0] + [surface.gap_mm for surface in self.surfaces[:-1]])
        state = np.zeros((2, 3, 3, self._degree + 1))  # [plane, row, column, power of travel]
        state[..., 0] = np.eye(3)
        here = 0
        rows = []
        for index, way in route:
            steps = state[:, 1]
            state[:, 0] += (place[index] - place[here]) * steps
            moved = int(index > self.moving) - int(here > self.moving)
            state[:, 0, :, 1:] += moved * steps[..., :-1]
            here = index
            rows.append(state[:, 0].copy())
            slope = np.stack([_bend(self.surfaces[index], way, plane) for plane in (0, 1)])
            state[:, 1] = np.einsum("qr,qrsp->qsp", slope, state)
        return rows

    def _chief(self, powers: Floats, field_mm: Floats) -> tuple[Floats, Floats]:
        """Return y1 and slope1 of the chief ray [plane, ...] to u = field on the row.

        Args:
            powers: Powers of the travel [p, ...].
            field_mm: Position of the direct image.
        """
        stop, end = (np.tensordot(rows, powers, 1) for rows in self._direct)
        target = np.stack([field_mm, np.zeros_like(field_mm)])
        wanted = target - end[:, 2]
        centre = -stop[:, 2]
        scale = stop[:, 0] * end[:, 1] - stop[:, 1] * end[:, 0]
        y = (centre * end[:, 1] - stop[:, 1] * wanted) / scale
        slope = (stop[:, 0] * wanted - end[:, 0] * centre) / scale
        return y, slope


def stack(
    stray: Stray,
    *,
    focal_mm: float = 25.0,
    f_number: float = 3.0,
    pitch_mm: float = 0.007,
    length_px: int = 2048,
    centre_px: float = 1023.5,
) -> Stack:
    """Return the receiver that a scene's ``[stray]`` describes.

    The lens is scaled to the focal length, alone and in air, and stands so far from the sensor
    that infinity is sharp.

    Args:
        stray: The parts and their properties.
        focal_mm: Focal length of the lens.
        f_number: f-number of the lens at infinity, which sets the stop.
        pitch_mm: Pitch of the pixels.
        length_px: Number of pixels of the sensor.
        centre_px: Position where the optical axis meets the sensor.

    Raises:
        InputError: if the prescription is no positive lens, or the cover does not fit behind it.
    """
    front: list[Surface] = []
    for name, plate in (("window", stray.window), ("filter", stray.filter)):
        if name in stray.enabled:
            front += _plate(name, plate)
    lens = _lens(stray, focal_mm)
    cover = _plate("cover", stray.cover) if "cover" in stray.enabled else []
    chip = stray.sensor_reflectance if "sensor" in stray.enabled else 0.0
    sensor = Surface("sensor", 1.0, 1.0, 0.0, reflectance=chip)
    at = min(stray.lens.stop, len(lens)) - 1
    built = Stack(
        surfaces=(*front, *lens, *cover, sensor),
        stop=len(front) + at,
        moving=len(front) + len(lens) - 1,
        f_number=f_number,
        focal_mm=focal_mm,
        pitch_mm=pitch_mm,
        length_px=length_px,
        centre_px=centre_px,
        least_power=stray.least_power,
        least_density=stray.least_density,
    )
    gap = float(built.travel(np.array(np.inf)))
    if gap < 0.0:
        raise InputError(
            f"stray.cover: needs {-gap:.3g} mm more than there is between lens and sensor"
        )
    surfaces = list(built.surfaces)
    surfaces[built.moving] = replace(surfaces[built.moving], gap_mm=gap)
    return replace(built, surfaces=tuple(surfaces))


def ghosts(stack: Stack, focus_mm: Floats, distance_mm: Floats, field_mm: Floats) -> Ghosts:
    """Return all ghosts, followed over focus, distance and image position.

    Metis 3.2 as an array: the three arguments broadcast, so that a cube over all of them is one
    call. Each ghost is a linear form of the ray whose coefficients are polynomials of the lens's
    travel; they are found once a stack and are exact. Ghosts of four and more reflections are among
    them where they are strong enough; with a ``least_power`` of 0, which would have no end, there
    are those of two. Where the light crosses the stop again, it lets
    through what the discs of beam and stop have in common; of several crossings the narrowest
    counts, which is too much where they clip at different sides. A clipped ghost keeps its
    middle and radius.

    Ghosts that are weaker than the section's ``least_power``, thinner than its ``least_density``
    for all of the spots, or miss the sensor for all are dropped; their light is in ``dropped``.

    Args:
        stack: The receiver.
        focus_mm: The distance at which the camera is in focus.
        distance_mm: Distance of the spot. Both count along the axis from the entrance pupil, the
            camera's centre of projection; where not above 0, or NaN, the ghosts have no power.
        field_mm: Position u of the direct image on the sensor, mm; NaN as above.

    Returns:
        Ghosts [g, n], the strongest first, finite throughout.
    """
    focus, distance, field = np.broadcast_arrays(
        np.asarray(focus_mm, np.float64),
        np.asarray(distance_mm, np.float64),
        np.asarray(field_mm, np.float64),
    )
    shape = focus.shape
    seen = (distance > 0.0) & np.isfinite(field) & (focus > 0.0)
    field = np.where(seen, field, 0.0)
    near = np.where(seen, 1.0 / np.where(seen, np.maximum(distance, _NEAREST_MM), 1.0), 0.0)
    focus = np.where(seen, focus, np.inf)

    if focus.size and np.all(focus == focus.flat[0]):  # the usual scene: one focus for all lines
        powers = stack._powers(stack.travel(focus.flat[0])).reshape(-1, *([1] * len(shape)))
    else:
        powers = stack._powers(stack.travel(focus))
    y, slope = stack._chief(powers, field)
    stop, _ = (np.tensordot(rows, powers, 1) for rows in stack._direct)
    # The pencil from the spot: how y1 and slope1 change with the height in the stop.
    pencil_y = (1.0 - stack.pupil_mm * near) / stop[0, 0]
    pencil_slope = near / stop[0, 0]

    ends, crossings, owner = stack._paths
    order = np.argsort(-stack.bare, kind="stable")
    end = np.tensordot(ends[order, 0, :2], powers, 1)
    blur = stack.stop_mm * np.abs(end[:, 0] * pencil_y + end[:, 1] * pencil_slope)
    blur = np.where(seen, blur, 0.0) / stack.pitch_mm
    bare = stack.bare[order].reshape(-1, *([1] * len(shape)))
    density = np.where(seen, bare / (math.pi * np.maximum(np.square(blur), 1.0)), 0.0)
    dense = density.max(axis=tuple(range(1, density.ndim)), initial=0.0) >= stack.least_density
    strong, blur, bare = order[dense], blur[dense], bare[dense]
    weak = stack.total - float(stack.bare[strong].sum())

    end = np.tensordot(ends[strong], powers, 1)  # [g, plane, 3, ...]
    offset = (end[:, 0, 0] * y[0] + end[:, 0, 1] * slope[0] + end[:, 0, 2]) - field
    across = end[:, 1, 0] * y[1] + end[:, 1, 1] * slope[1] + end[:, 1, 2]
    offset, across = offset / stack.pitch_mm, across / stack.pitch_mm
    lit = _on_sensor(field / stack.pitch_mm + offset, across, blur, stack)
    share = np.ones((len(strong), *shape))
    place = {pair: k for k, pair in enumerate(strong.tolist())}
    for rows, pair in zip(crossings, owner.tolist(), strict=True):
        if pair not in place:
            continue
        row = np.tensordot(rows, powers, 1)
        middle = np.hypot(
            row[0, 0] * y[0] + row[0, 1] * slope[0] + row[0, 2],
            row[1, 0] * y[1] + row[1, 1] * slope[1] + row[1, 2],
        )
        radius = np.abs(row[0, 0] * pencil_y + row[0, 1] * pencil_slope) * stack.stop_mm
        k = place[pair]
        share[k] = np.minimum(share[k], _passed(radius, middle, stack))
    power = bare * share * seen
    missed = np.where(lit, 0.0, power).sum(axis=0)
    power = np.where(lit, power, 0.0)
    kept = lit.any(axis=tuple(range(1, lit.ndim)))
    names = tuple(_path_name(stack, stack.paths[k]) for k in strong[kept])
    whole = (int(kept.sum()), *shape)
    return Ghosts(
        names=names,
        offset_px=np.broadcast_to(offset[kept], whole),
        across_px=np.broadcast_to(across[kept], whole),
        blur_px=np.broadcast_to(blur[kept], whole),
        power=power[kept],
        dropped=np.asarray(missed + weak * seen),
    )


def _plate(name: str, plate: Plate) -> list[Surface]:
    tilt, across = math.radians(plate.tilt_deg), math.radians(plate.across_deg)
    wedge = math.radians(plate.wedge_deg)
    glass = plate.index
    return [
        Surface(
            f"{name} 1",
            1.0,
            glass,
            plate.thickness_mm,
            reflectance=plate.front_reflectance,
            tilt_rad=tilt,
            across_rad=across,
        ),
        Surface(
            f"{name} 2",
            glass,
            1.0,
            plate.gap_mm,
            reflectance=plate.back_reflectance,
            tilt_rad=tilt + wedge,
            across_rad=across,
        ),
    ]


def _lens(stray: Stray, focal_mm: float) -> list[Surface]:
    lens = stray.lens
    if lens.kind == "thin":
        return [Surface("lens", 1.0, 1.0, 0.0, power=1.0 / focal_mm)]
    media = [1.0, *lens.index, 1.0]
    bends = [1.0 / radius if radius else 0.0 for radius in lens.radii_mm]
    height, slope = 1.0, 0.0
    for bend, (before, after), gap in zip(
        bends, pairwise(media), [*lens.spacing_mm, 0.0], strict=True
    ):
        slope = before / after * (slope + bend * height) - bend * height
        height += slope * gap
    if not slope < 0.0:
        raise InputError("stray.lens: the prescription does not gather light")
    scale = -slope * focal_mm  # focal length wanted over that of the prescription
    kept = lens.reflectance if "lens" in stray.enabled else 0.0
    return [
        Surface(
            f"lens {k + 1}", before, after, gap * scale, reflectance=kept, curvature=bend / scale
        )
        for k, (bend, (before, after), gap) in enumerate(
            zip(bends, pairwise(media), [*lens.spacing_mm, 0.0], strict=True)
        )
    ]


def _bend(surface: Surface, way: int, plane: int) -> Floats:
    """Return the factors of y, slope and 1 that give the slope behind a surface.

    The surface is z = c y^2 / 2 + t y, so that its normal leans by g = c y + t. Snell's law is n
    (slope + g) = n' (slope' + g), in either direction; a mirror has slope' + g = -(slope + g).
    """
    tilt = surface.across_rad if plane else surface.tilt_rad
    if way == 0:
        return np.array([-2.0 * surface.curvature, -1.0, -2.0 * tilt])
    before, after = surface.before, surface.after
    ratio = before / after if way > 0 else after / before
    extra = ratio - 1.0
    return np.array([extra * surface.curvature - way * surface.power, ratio, extra * tilt])


def _passed(radius: Floats, middle: Floats, stack: Stack) -> Floats:
    """Return the share of a beam of this radius, so far off the axis, that passes the stop."""
    radius = np.maximum(radius, 1e-6)
    common = disc_overlap(radius, stack.stop_mm, middle)
    return np.asarray(common / (math.pi * np.square(radius)))


def _on_sensor(position: Floats, across: Floats, blur: Floats, stack: Stack) -> Bools:
    """Return whether discs at ``position`` px from the axis light a pixel of the row."""
    pixel = position + stack.centre_px
    reach = blur + _MARGIN_PX
    return (
        (pixel > -0.5 - reach)
        & (pixel < stack.length_px - 0.5 + reach)
        & (np.abs(across) < 0.5 + reach)
    )


def _path_name(stack: Stack, path: Path) -> str:
    """Return the pairs of a path in turn, one that is met again with the number of times."""
    pairs = [" + ".join(stack.surfaces[k].name for k in pair) for pair in path]
    groups = [(name, len(list(same))) for name, same in groupby(pairs)]
    return ", ".join(name if times == 1 else f"{name} x{times}" for name, times in groups)
