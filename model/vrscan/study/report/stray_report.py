"""Stray light of a scene: ghosts, BSDF, cleanliness, and a budget of A and px by cause.

A is that of metis (6): the most stray light on one pixel over all light of the image, here on the
row and ``BEYOND_PX`` or more from the spot. The shift is that of a least-squares fit of the spot's
own shape, with its height and an even level, to first order in the stray light; an even or
symmetric halo shifts nothing. Both are of lines without noise and speckle.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from rich.console import Group
from rich.table import Table as RichTable

from vrscan.data.arrays import Floats
from vrscan.data.errors import InputError
from vrscan.data.residuals import rms
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer
from vrscan.scene.scatter import (
    CAUSES,
    Halo,
    Scatter,
    emitter,
    intensity,
    receiver,
)
from vrscan.scene.simulate import Scanner, picked
from vrscan.scene.stray import BEYOND_PX, Stray, attenuation, particles, pupil_faces, soiled
from vrscan.show.sheet import Column, Sheet, number, words
from vrscan.show.style import COLOURS, INK, QUIET, drawing
from vrscan.study.plan import ZONES, survey

FIELD_MM = 2.0  # image height of the spot whose ghosts are shown
_LINES = 40  # lines of each zone
_SPREAD = 4.0  # widths of the spot to either side that a fit sees
_CUT = 0.02  # height below which a pixel says nothing about the spot's width
_STEPS = 7  # values of a property that are tried
_SPAN = 300.0  # ratio of the largest to the least of them
_OPTICS = frozenset(
    ("footprint", "smear", "truncation", "diffraction", "defocus", "coma", "falloff", "gloss")
)
_SQUARE_FEET = 0.1 / 0.09290304  # in 0.1 m^2
_SIZES_UM = (5.0, 25.0, 100.0)


@dataclass(frozen=True)
class Cause:
    """What one cause does; figures are of the near, middle and far third of the depth [3]."""

    name: str
    share: float | None  # of the light that it scatters
    level: Floats  # A, median of the lines
    shift_px: Floats  # rms


@dataclass(frozen=True)
class Limit:
    """The largest value of a property with which its cause alone keeps to a target."""

    name: str
    unit: str
    now: float
    by_level: float  # A; above it no instrument is left where infinite
    by_shift: float  # the shift in this scene
    drawing: Callable[[float], str]  # how a drawing says it


@dataclass(frozen=True)
class Ghost:
    """One ghost of a spot."""

    name: str
    offset_px: float
    across_px: float
    radius_px: float
    power: float  # share of the spot's light
    level: float  # share of it in the brightest pixel: A


@dataclass(frozen=True)
class Faces:
    """The cleanliness of faces of one kind."""

    name: str
    count: int
    level: float
    covered: dict[str, float]  # share of a face, by cause
    shadowed: float  # share of the light
    diffracted: float


@dataclass(frozen=True)
class StrayBudget:
    """All figures of a scene."""

    light: Light
    tolerance_px: float
    target: float  # A with which an edge of stray light shifts the spot by the tolerance
    z_mm: Floats  # mean depth of the zones [3]
    causes: tuple[Cause, ...]  # the last is all of them together
    limits: tuple[Limit, ...]
    ghosts: tuple[Ghost, ...]
    dropped: float  # share of the light in all other ghosts
    faces: tuple[Faces, ...]


def stray_budget(light: Light, count: int, tolerance_px: float | None = None) -> StrayBudget:
    """Return the stray light of a scene.

    Args:
        light: The scene and the instrument.
        count: Number of lines of the scan, from which some are drawn.
        tolerance_px: Shift that stray light may make; the scene's own tolerance if None.

    Raises:
        InputError: if the camera sees none of the lines, or no light of them.
    """
    tolerance = light.scene.tolerance_px if tolerance_px is None else tolerance_px
    lines = _Lines(light, count)
    target = lines.target(tolerance)
    causes = tuple(_causes(light, lines))
    found, dropped = _ghosts(light, lines)
    return StrayBudget(
        light=light,
        tolerance_px=tolerance,
        target=target,
        z_mm=lines.z_mm,
        causes=causes,
        limits=tuple(_limits(light, lines, target, tolerance)),
        ghosts=found,
        dropped=dropped,
        faces=tuple(_faces(light)),
    )


class _Lines:
    """Some lines of a scan, without noise, and what stray light adds to them."""

    def __init__(self, light: Light, count: int) -> None:
        self._light = light
        seen = survey(light, count)
        rows = np.flatnonzero((seen.part < len(ZONES)) & (seen.rank < _LINES))
        when, _ = Scanner(light, count, frozenset()).given(seen.numbers[rows])
        self._optics = _OPTICS & set(present(light.scene))
        charge = Renderer(light, self._optics).charge(when)
        lit = (charge.whole_e > 0.0) & (charge.laser_e.max(axis=1) > 0.0)
        if not lit.any():
            raise InputError(f"{light.scene.source}: no line brings light to the sensor's row")
        self.when, self.zone = picked(when, np.flatnonzero(lit)), seen.part[rows][lit]
        self.z_mm = seen.distance_mm
        self.whole_e = charge.whole_e[lit]  # of each spot, on the row or not
        self.base_e = charge.laser_e[lit].astype(np.float64)
        self.place = self.base_e.argmax(axis=1)
        self.solve = [self._solver(row) for row in self.base_e]

    def _solver(self, row: Floats) -> tuple[slice, Floats]:
        """Return the pixels of a fit, and the factors of their light that give the shift."""
        pixel = np.arange(len(row))
        core = np.where(row > _CUT * row.max(), row, 0.0)
        middle = float(core @ pixel) / core.sum()
        width = math.sqrt(float(core @ np.square(pixel - middle)) / core.sum())
        first = max(math.floor(middle - _SPREAD * width) - 1, 0)
        some = slice(first, min(math.ceil(middle + _SPREAD * width) + 2, len(row)))
        # Four neighbours: the difference of two is 5 % too small on a narrow spot.
        slope = np.convolve(row, [-1 / 12, 2 / 3, 0.0, -2 / 3, 1 / 12], "same")
        basis = np.stack([-slope[some], row[some], np.ones(some.stop - some.start)])
        return some, np.linalg.pinv(basis.T)[0]

    def added(self, light: Light, effects: Iterable[str]) -> Floats:
        """Return the electrons that effects of stray light add to the lines [n, length].

        The spots are as bright as in the scene itself, whatever ``light`` scatters.
        """
        got = Renderer(light, self._optics | set(effects)).charge(self.when).laser_e
        left = _left(light) / _left(self._light)
        return np.asarray(got / left - self.base_e)

    def levels(self, added: Floats) -> Floats:
        """Return A of each line [n]."""
        away = np.abs(np.arange(added.shape[1]) - self.place[:, None]) >= BEYOND_PX
        each = zip(np.where(away, added, 0.0), self.whole_e, strict=True)
        return np.array([attenuation(row, 1.0, np.array([whole]), 1.0) for row, whole in each])

    def shifts(self, added: Floats) -> Floats:
        """Return the shift of each line, px [n]."""
        pairs = zip(added, self.solve, strict=True)
        return np.array([float(solve @ row[some]) for row, (some, solve) in pairs])

    def figures(self, light: Light, effects: Iterable[str]) -> tuple[Floats, Floats]:
        """Return A, the lines' median, and the rms shift in px, by zone [3]."""
        added = self.added(light, effects)
        return self.by_zone(self.levels(added), np.median), self.by_zone(self.shifts(added), rms)

    def by_zone(self, values: Floats, how: Callable[[Floats], object]) -> Floats:
        """Return a figure of the lines of each zone, NaN without lines [3]."""
        zones = [values[self.zone == k] for k in range(len(ZONES))]
        return np.array([how(zone) if len(zone) else math.nan for zone in zones], np.float64)

    def target(self, tolerance_px: float) -> float:
        """Return A of an edge of light under the spot's middle that shifts it by the tolerance."""
        pixel = np.arange(self.base_e.shape[1])
        edge = (pixel > self.place[:, None]).astype(np.float64)
        shift = np.abs(self.shifts(edge)) * self.whole_e  # px for all of the light
        return float(np.nanmin(self.by_zone(tolerance_px / shift, np.median)))

    def even(self, electrons: float) -> Floats:
        """Return A of light that is the same on all pixels, by zone [3]."""
        return self.by_zone(electrons / self.whole_e, np.median)


def _left(light: Light) -> float:
    """Return the share of the light that nothing scatters."""
    return (1.0 - light.scatter.total) * (1.0 - light.emitter.total)


def _alone(stray: Stray, cause: str) -> Stray:
    """Return the table with one cause of scatter."""
    if cause == "roughness":
        return stray.model_copy(update={"enabled": [x for x in stray.enabled if x != "dust"]})
    none: dict[str, object] = {"level": 1.0, "cover_level": 1.0, "digs": 0, "scratches": 0}
    kept = {"dust": ("level", "cover_level"), "digs": ("digs",), "scratches": ("scratches",)}
    for name in kept[cause]:
        none.pop(name)
    enabled = [name for name in stray.enabled if name != "halo"]
    return stray.model_copy(update={"enabled": enabled, "dust": stray.dust.model_copy(update=none)})


def _causes(light: Light, lines: _Lines) -> Iterable[Cause]:
    stray, there = light.scene.stray, set(present(light.scene))
    for effect, scatter, where in (
        ("halo", light.scatter, "camera"),
        ("skirt", light.emitter, "scan head"),
    ):
        for cause, share in scatter.shares().items():
            if share > 0.0 and effect in there:
                figures = lines.figures(light.with_stray(_alone(stray, cause)), [effect])
                yield Cause(f"{where}: {cause}", share, *figures)
    for effect, name in (("ghosts", "camera: ghosts"), ("window", "scan head: second beam")):
        if effect in there:
            yield Cause(name, None, *lines.figures(light, [effect]))
    veil = lines.even(light.veil_e() if "veil" in there else 0.0)
    if "veil" in there:
        yield Cause("outside the field", None, veil, np.zeros_like(veil))
    level, shift = lines.figures(light, {"halo", "skirt", "ghosts", "window"} & there)
    yield Cause("all together", None, level + veil, shift)


def _limits(light: Light, lines: _Lines, target: float, tolerance_px: float) -> Iterable[Limit]:
    """Yield the largest values of what makes scatter, each cause alone."""
    stray, there = light.scene.stray, set(present(light.scene))

    def limit(
        name: str,
        unit: str,
        effect: str,
        cause: str,
        now: float,
        change: Callable[[float], Stray],
        largest: float,
        drawing: Callable[[float], str] = lambda _: "",
    ) -> Iterable[Limit]:
        """Try values up to the one with which half of the light is scattered."""
        if effect not in there or not now > 0.0:
            return

        def changed(value: float) -> Light:
            return light.with_stray(_alone(change(value), cause))

        most = _most(changed, largest)
        tried = np.geomspace(most / _SPAN, most, _STEPS)
        figures = [lines.figures(changed(value), [effect]) for value in tried]
        level, shift = (np.array([np.nanmax(each[k]) for each in figures]) for k in (0, 1))
        yield Limit(
            name, unit, now, _reached(tried, level, target), _reached(tried, shift, tolerance_px),
            drawing,
        )  # fmt: skip

    def section(name: str, **values: object) -> Stray:
        return stray.model_copy(update={name: getattr(stray, name).model_copy(update=values)})

    dust = stray.dust
    if "halo" in stray.enabled:
        yield from limit(
            "camera: roughness", "nm", "halo", "roughness", stray.polish.roughness_nm,
            lambda x: section("polish", roughness_nm=x), 200.0,
        )  # fmt: skip
        if "mirror" in stray.enabled:
            yield from limit(
                "mirror: roughness", "nm", "skirt", "roughness", stray.mirror.roughness_nm,
                lambda x: section("mirror", roughness_nm=x), 200.0,
            )  # fmt: skip
    if "dust" in stray.enabled:
        yield from limit(
            "camera: cleanliness level", "", "halo", "dust", dust.level,
            lambda x: section("dust", level=max(x, 1.0), cover_level=1.0), 2000.0,
        )  # fmt: skip
        if dust.digs:
            yield from limit(
                "camera: digs", "mm", "halo", "digs", dust.dig_mm,
                lambda x: section("dust", dig_mm=x), 5.0,
                lambda x: f"5/{dust.digs}x{x:.2g}, dig {_dig_number(x):.0f}",
            )  # fmt: skip
        if dust.scratches:
            yield from limit(
                "camera: scratches", "mm", "halo", "scratches", dust.scratch_mm,
                lambda x: section("dust", scratch_mm=x), 1.0,
                lambda x: f"L{dust.scratches}x{x:.2g}, scratch {1e3 * x:.2g}",
            )  # fmt: skip


def _most(changed: Callable[[float], Light], largest: float) -> float:
    """Return the largest value, to 5 %, with which less than half of the light is scattered."""
    while True:
        try:
            changed(largest)
        except InputError:
            largest *= 0.95
        else:
            return largest


def _dig_number(root_mm: float) -> float:
    """Return a dig's number in scratch-dig: its diameter in hundredths of mm."""
    return 200.0 * root_mm / math.sqrt(math.pi)


def _reached(tried: Floats, figure: Floats, target: float) -> float:
    """Return the value at which a figure that rises comes to a target; infinite if it does not."""
    above = np.flatnonzero(figure > target)
    if len(above) == 0:
        return math.inf
    k = max(int(above[0]), 1)
    low, high = np.log(np.maximum(figure[k - 1 : k + 1], 1e-300))
    step = (math.log(target) - low) / (high - low)
    return float(tried[k - 1] * (tried[k] / tried[k - 1]) ** step)


def _ghosts(light: Light, lines: _Lines) -> tuple[tuple[Ghost, ...], float]:
    if "ghosts" not in present(light.scene):
        return (), 0.0
    depth = np.array([np.nanmedian(lines.z_mm)])
    found = light.ghosts(depth, np.array([FIELD_MM]))
    height = light.sharp_sigma_px
    every = []
    for k, name in enumerate(found.names):
        power, radius = float(found.power[k, 0]), float(found.blur_px[k, 0])
        if power > 0.0:
            # The middle of a disc that the spot blurs.
            square = max(radius / height, 1e-6) ** 2
            level = power * -math.expm1(-0.5 * square) / (math.pi * square * height**2)
            places = float(found.offset_px[k, 0]), float(found.across_px[k, 0])
            every.append(Ghost(name, *places, radius, power, level))
    return tuple(sorted(every, key=lambda ghost: -ghost.level)), float(found.dropped[0])


def _faces(light: Light) -> Iterable[Faces]:
    stray = light.scene.stray
    if "dust" not in stray.enabled:
        return
    dust, width = stray.dust, light.config.geometry.focal_mm / light.scene.lens.f_number
    covered = soiled(stray, width)

    far_mm = light.config.geometry.focal_mm  # lever of the faces near the pupil

    def diffracted(scatter: Scatter, *, pupil: bool) -> float:
        soil = [each for each in scatter.scatterers if each.cause != "roughness"]
        return sum(scatter.share(each) for each in soil if (each.lever_mm == far_mm) == pupil)

    yield Faces(
        "window, filter, lens", pupil_faces(stray), dust.level, covered, light.obscured,
        diffracted(light.scatter, pupil=True),
    )  # fmt: skip
    if "cover" in stray.enabled:
        cover = soiled(_cover(stray), width)
        lost = 1.0 - float(light.shadow.mean())
        yield Faces(
            "cover", 2, dust.cover_level, cover, lost, diffracted(light.scatter, pupil=False)
        )
    faces = ("mirror" in stray.enabled) + 2 * ("head_window" in stray.enabled)
    if faces:
        lost = 1.0 - (1.0 - sum(covered.values())) ** faces
        yield Faces(
            "scan head", faces, dust.level, covered, lost, diffracted(light.emitter, pupil=False)
        )


def _cover(stray: Stray) -> Stray:
    update = {"level": stray.dust.cover_level, "digs": 0, "scratches": 0}
    return stray.model_copy(update={"dust": stray.dust.model_copy(update=update)})


# What is shown


def report(found: StrayBudget) -> Group:
    """Return all tables for the terminal, at most 120 columns wide."""
    tables: list[RichTable | str] = [budget_table(found)]
    for table, there in (
        (limit_table, found.limits),
        (ghost_table, found.ghosts),
        (faces_table, found.faces),
    ):
        if there:
            tables += ["", table(found)]
    return Group(*tables)


def _zones(heading: str, values: Callable[[Cause], Floats], name: str) -> list[Column[Cause]]:
    def zone(k: int) -> Column[Cause]:
        head = f"{heading if k == 0 else ''}\n{ZONES[k]}"
        return Column(head, lambda row: float(values(row)[k]), number, name=f"{ZONES[k]}_{name}")

    return [zone(k) for k in range(len(ZONES))]


def _columns(found: StrayBudget) -> list[Column[Cause]]:
    return [
        words("\ncause", lambda row: row.name, name="cause"),
        Column("share of\nthe light", lambda row: row.share, number, name="share"),
        *_zones("A", lambda row: row.level, "a"),
        Column("largest over\nthe target", lambda row: float(np.nanmax(row.level)) / found.target,
               number, name="a_over_target"),
        *_zones("shift, px", lambda row: row.shift_px, "shift_px"),
    ]  # fmt: skip


def budget_table(found: StrayBudget) -> RichTable:
    """Return A and shift by cause."""
    last = found.causes[-1]
    return Sheet(_columns(found), found.causes).terminal(
        f"{found.light.scene.source}: stray light by cause",
        f"A, metis (6): most light of a pixel on the row, {BEYOND_PX} px and more from the spot, "
        f"over all light of its image. Target: {found.target:.2g}, with which an edge of light "
        f"under the spot would shift it by {found.tolerance_px:g} px. Shift: rms, of a fit of the "
        "spot's own shape. Thirds of the depth at z "
        + ", ".join(f"{z:.0f}" for z in found.z_mm)
        + " mm.",
        apart=lambda row: "sum" if row is last else row.name.partition(":")[0],
        gap=2,
    )


def budget_csv(found: StrayBudget) -> bytes:
    """Return the budget by cause as a file, with the target in each row."""
    target: Column[Cause] = Column(None, lambda _: found.target, name="target_a")
    return Sheet([*_columns(found), target], found.causes).csv()


def limit_table(found: StrayBudget) -> RichTable:
    """Return which polish and cleanliness keep to the target and to the tolerance."""

    def most(value: float) -> str:
        return "any" if math.isinf(value) else number(value)

    columns: list[Column[Limit]] = [
        words("\nproperty", lambda row: f"{row.name}{', ' * bool(row.unit)}{row.unit}"),
        Column("\nnow", lambda row: row.now, number),
        Column("\nfor A", lambda row: row.by_level, most, name="for_a"),
        Column("for the\nshift", lambda row: row.by_shift, most, name="for_shift"),
        words("in a drawing\nnow", lambda row: row.drawing(row.now)),
        words("\nfor A", lambda row: _drawn(row, row.by_level)),
        words("\nfor the shift", lambda row: _drawn(row, row.by_shift)),
    ]
    return Sheet(columns, found.limits).terminal(
        f"Largest values that leave A below {found.target:.2g}, or a shift of "
        f"{found.tolerance_px:g} px in this scene",
        "Each cause alone, in the worst third. Any: not before half of the light is scattered. "
        "Drawings: ISO 10110-7 (number of digs x root of the area, number of scratches x width), "
        "and scratch-dig with the scratch's width in µm and the dig's diameter in 0.01 mm. "
        "Cleanliness: MIL-STD-1246C.",
    )


def _drawn(row: Limit, value: float) -> str:
    return "" if math.isinf(value) else row.drawing(value)


def _ghost_columns() -> list[Column[Ghost]]:
    return [
        words("reflections", lambda row: row.name, name="reflections"),
        Column("place,", lambda row: row.offset_px, "{:+.1f}", name="offset_px", unit="px"),
        Column("across,", lambda row: row.across_px, "{:+.1f}", name="across_px", unit="px"),
        Column("radius,", lambda row: row.radius_px, "{:.1f}", name="radius_px", unit="px"),
        Column("share", lambda row: row.power, number, name="share"),
        Column("A", lambda row: row.level, number, name="a"),
    ]


def ghost_table(found: StrayBudget) -> RichTable:
    """Return the ghosts, the brightest first."""
    return Sheet(_ghost_columns(), found.ghosts).terminal(
        f"Ghosts of a spot {FIELD_MM:g} mm off the axis, z {np.nanmedian(found.z_mm):.0f} mm",
        "Places are from the spot, of discs; share of the spot's light. A: in the disc's middle, "
        "were it on the row. All others, of any number of reflections, too thin to be rendered or "
        f"beside the sensor: {found.dropped:.2g} of the light.",
        gap=2,
    )


def ghost_csv(found: StrayBudget) -> bytes:
    """Return the ghosts as a file."""
    return Sheet(_ghost_columns(), found.ghosts).csv()


def faces_table(found: StrayBudget) -> RichTable:
    """Return the cleanliness of the faces, and what it costs."""

    def size(um: float) -> Column[Faces]:
        return Column(
            f"≥ {um:g}\nµm", lambda row: float(particles(row.level, um)) * _SQUARE_FEET, number
        )

    def covers(cause: str) -> Column[Faces]:
        return Column(f"{cause}\n%", lambda row: row.covered.get(cause), number, scale=100)

    columns: list[Column[Faces]] = [
        words("\nfaces", lambda row: f"{row.name} ({row.count})"),
        Column("\nlevel", lambda row: row.level, "{:g}"),
        *map(size, _SIZES_UM),
        *map(covers, CAUSES[1:]),
        Column("shadow\n%", lambda row: row.shadowed, number, scale=100),
        Column("lobe\n%", lambda row: row.diffracted, number, scale=100),
    ]
    return Sheet(columns, found.faces).terminal(
        "Cleanliness",
        "Levels of MIL-STD-1246C; particles on 0.1 m², of a size and larger. Covered by dust, digs "
        "and scratches: of one face. In shadow, and in the lobe about the spot: of the light, by "
        "all of the faces.",
    )


def picture(found: StrayBudget, file: BinaryIO) -> None:
    """Draw the BSDF by cause, and what it puts on the row beside the spot, as PNG."""
    title = f"{found.light.scene.source}: scatter"
    with drawing(10.0, 4.4, title) as figure:
        grid = figure.add_gridspec(1, 2)
        _draw_bsdf(figure.add_subplot(grid[0]), found.light)
        _draw_row(figure.add_subplot(grid[1]), found)
        figure.savefig(file, format="png", dpi=130)


def _parts(stray: Stray) -> list[tuple[str, Stray]]:
    """Return the tables with one cause each, of those with which the camera scatters."""
    parts = [(cause, _alone(stray, cause)) for cause in CAUSES]
    return [(cause, part) for cause, part in parts if receiver(part).total > 0.0]


def _draw_bsdf(axes: Axes, light: Light) -> None:
    """Draw the BSDF of all faces of the camera by cause, and of the scan head."""
    angle = np.geomspace(3e-4, 1.5, 500)
    wave = light.scene.laser.wavelength_nm
    width = light.config.geometry.focal_mm / light.scene.lens.f_number
    options = {"f_number": light.scene.lens.f_number, "wavelength_nm": wave}
    whole = np.zeros_like(angle)
    for (cause, part), colour in zip(_parts(light.scene.stray), COLOURS, strict=False):
        # Angles in front of the lens: all levers are 1 mm, and the cover's faces are left out.
        bare = part.model_copy(update={"enabled": [x for x in part.enabled if x != "cover"]})
        near = receiver(bare, focal_mm=light.config.geometry.focal_mm, **options)
        level = intensity(_levelled(near), angle) / np.cos(angle)
        if not level.any():
            continue
        whole += level
        axes.loglog(1e3 * angle[1:-1], level[1:-1], color=colour, label=cause)
    if whole.max() > 0.0:
        axes.loglog(1e3 * angle[1:-1], whole[1:-1], color=INK, linewidth=1.6, label="camera")
    scatter = emitter(light.scene.stray, face_mm=width, wavelength_nm=wave)
    if scatter.total > 0.0:
        head = intensity(scatter, angle) / np.cos(angle)
        shown = 1e3 * angle[1:-1], head[1:-1]
        axes.loglog(*shown, color=QUIET, linestyle="--", label="scan head")
    axes.set(
        xlabel="angle from the beam in mrad", ylabel="BSDF in 1/sr", title="All faces, by cause"
    )
    if whole.max() > 0.0:
        axes.set_ylim(1e-3 * float(whole[len(angle) // 2 :].max()), 3.0 * float(whole[1:].max()))
        axes.legend(loc="lower left")


def _levelled(scatter: Scatter) -> Scatter:
    """Return the scatterers with levers of 1 mm."""
    return Scatter(tuple(replace(each, lever_mm=1.0) for each in scatter.scatterers))


def _draw_row(axes: Axes, found: StrayBudget) -> None:
    """Draw the share of a spot's light in the pixels beside it, by cause, with A's target."""
    light = found.light
    pixel = np.arange(1, light.config.sensor.line_length)

    def weights(each: Light) -> Floats:
        halo: Halo = each.halo
        return halo.weights[pixel]

    for (cause, part), colour in zip(_parts(light.scene.stray), COLOURS, strict=False):
        axes.loglog(pixel, weights(light.with_stray(part)), color=colour, label=cause)
    if light.scatter.total > 0.0:
        axes.loglog(pixel, weights(light), color=INK, linewidth=1.6, label="camera")
        axes.legend(loc="lower left")
    axes.set_yscale("log")
    axes.axhline(found.target, color=QUIET, linestyle="--", linewidth=1.0)
    axes.text(1.2, 1.2 * found.target, f"{found.tolerance_px:g} px", color=QUIET, fontsize=8)
    axes.axvline(BEYOND_PX, color=QUIET, linewidth=0.8)
    axes.set(
        xlabel="distance from the spot in px",
        ylabel="share of the light in a pixel of the row",
        title=f"Halo on the row; A from {BEYOND_PX} px on",
        ylim=(1e-10, None),
    )
