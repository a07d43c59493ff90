"""Effects of a scene's light on its points, one by one, and the safety of its laser.

The figures are those of ``vrscan.study.plan``: measured on lines of the scan, not estimated.
"""

import math
from dataclasses import dataclass

import numpy as np
from rich.console import Group
from rich.table import Table as RichTable

from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import Config
from vrscan.scene import detectability, safety
from vrscan.scene.beam import output_mw, radius_mm
from vrscan.scene.description import Description
from vrscan.scene.detectability import Beam, Filter, View
from vrscan.scene.effects import BASE, EFFECTS
from vrscan.scene.light import Light
from vrscan.scene.shapes import dot
from vrscan.scene.spots import meet
from vrscan.scene.stray import BEYOND_PX, attenuation
from vrscan.show.sheet import Column, Sheet, short, words
from vrscan.study.plan import JUMP_PX, LEAST_LINES, PARTS, ZONES, Difference, Plan

MOST_3B_MW = 500.0  # largest mean power of class 3B
MOST_3B_J = 0.03  # largest energy of one pulse, 400 to 700 nm; above 700 nm more is allowed
_FIELD_MM = 2.0  # image height of the spot whose ghosts are shown
_SHOWN = 3  # number of ghosts that are shown
_RAYS = 801  # rays on which a glint is looked for
_BRIGHT = 2.0  # a glint's light over the diffuse light, at least
_NEAR = 0.05  # share of a zone's z: surfaces that near stand for the zone
_LEAST_COS = 0.05  # least cosine of the beam on a surface that counts as having a spot

_FIGURES = ("bias_px", "rms_px", "bias_mm", "rms_mm", "changed")


def budget_table(plan: Plan, scene: Description) -> Group:
    """Return the budget for the terminal, 120 columns wide: figures, and what the effects are."""
    return Group(figures_table(plan, scene), "", effects_table(plan))


@dataclass(frozen=True)
class _Line:
    """A line of the budget; what there is not is None."""

    name: str
    state: str
    microseconds: float | None
    difference: Difference | None = None
    style: str = ""
    kind: str = ""  # lines of one kind stand together


def figures_table(plan: Plan, scene: Description) -> RichTable:
    """Return what leaving out each effect does: bias and rms in px and mm, near, middle and far."""
    heads = (
        f"{'bias':>7} {'rms':>6} {'bias':>6} {'rms':>5}\n{'px':>7} {'px':>6} {'mm':>6} {'mm':>5}"
    )

    def zone(index: int) -> Column[_Line]:
        z_mm = plan.distance_mm[index]
        head = (
            f"{ZONES[index]}, z {z_mm:.0f} mm" if np.isfinite(z_mm) else f"{ZONES[index]}: no line"
        )
        return Column(f"{head:^27}\n{heads}", lambda line: _cell(line.difference, index))

    columns: list[Column[_Line]] = [
        words("\n\neffect", lambda line: line.name),
        *map(zone, range(len(ZONES))),
        Column("points\ndiffer", _differ, "{:.1f} %", scale=100),
        words("", lambda line: line.state),
        Column("µs", lambda line: line.microseconds, "{:.1f}"),
    ]
    planned_us, full_us = plan.microseconds
    rows = [
        _Line(p.name, "on" if p.on else "off", p.microseconds, p.difference, "" if p.on else "dim")
        for p in plan.predictions
    ]
    if rows:
        base_us = full_us - sum(row.microseconds for row in plan.predictions)
        rows.insert(0, _Line("base", "on", max(base_us, 0.0)))
    rows += [
        _Line("left out", "", planned_us - full_us, plan.left_out, "bold", "sum"),
        _Line("planned", "", planned_us, style="bold", kind="sum"),
        _Line("all on", "", full_us, kind="sum"),
    ]
    return Sheet(columns, rows).terminal(
        f"{scene.source}: what its points lose without each effect, "
        f"fidelity {plan.fidelity}{_tolerance(plan)}",
        f"Bias and rms about it: how the position in one window moves (with everything, less "
        f"without the effect), on {plan.lines} lines. Points differ: share of lines with a point "
        f"in only one of the two, or two more than {JUMP_PX:g} px apart, worst of near, middle, "
        f"far and hidden from the camera. µs a line, of the quicker of two runs with all tables "
        f"made; this budget itself took {plan.seconds:.1f} s. Base: {BASE}. On and off hold from "
        f"{LEAST_LINES:,} lines on; auto gives shorter scans everything.",
        apart=lambda line: line.kind,
        style=lambda line: line.style,
    )


def effects_table(plan: Plan) -> RichTable:
    """Return what the effects are, what stands in place of those that are off, and the absent."""
    states = _states(plan)
    columns: list[Column[str]] = [
        words("effect", lambda name: name),
        words("what it is", lambda name: EFFECTS[name].what),
        words("", lambda name: states[name]),
        words("in its place", lambda name: EFFECTS[name].without if states[name] == "off" else ""),
    ]
    return Sheet(columns, list(states)).terminal(
        "The effects", style=lambda name: "" if states[name] == "on" else "dim", gap=2
    )


def _states(plan: Plan) -> dict[str, str]:
    """Return "on", "off" or "not in this scene" of every effect, in their order."""
    known = {name: "on" if name in plan.active else "off" for name in plan.present}
    return {name: known.get(name, "not in this scene") for name in EFFECTS}


def _tolerance(plan: Plan) -> str:
    return f" at {plan.tolerance_px:g} px" if plan.fidelity == "auto" else ""


def _cell(change: Difference | None, zone: int) -> str:
    if change is None:
        return ""
    if np.isnan(change.bias_px[zone]):  # no line of the zone has a point
        return f"{'-':>7} {'-':>6} {'-':>6} {'-':>5}"
    return (
        f"{short(change.bias_px[zone], 6):>7} {short(change.rms_px[zone], 6):>6} "
        f"{short(change.bias_mm[zone], 5):>6} {short(change.rms_mm[zone], 5):>5}"
    )


def _differ(line: _Line) -> float | None:
    return None if line.difference is None else float(line.difference.changed.max()) or None


def budget_csv(plan: Plan, *, times: bool = True) -> bytes:
    """Return the budget as a file: a row for each effect, then what is left out, the plan, and all.

    What an effect that the scene does not have would do stays empty.

    Args:
        plan: The figures.
        times: Whether the file has times, which another run would not repeat.
    """

    def zone(index: int, name: str) -> Column[_Line]:
        def value(line: _Line) -> float | None:
            change = line.difference
            return None if change is None else float(getattr(change, name)[index])

        return Column(None, value, name=f"{PARTS[index]}_{name}")

    def place(index: int) -> Column[_Line]:
        z_mm = float(plan.distance_mm[index])
        return Column(None, lambda _: z_mm, name=f"{ZONES[index]}_z_mm", kept="{:.3f}")

    sums = {"left_out": "all that is off", "planned": "all that is on", "full": "everything"}
    columns: list[Column[_Line]] = [
        Column(None, lambda line: line.name, name="effect"),
        Column(None, lambda line: line.state, name="state"),
        Column(None, lambda line: line.microseconds, name="us_per_line", kept="{:.3f}"),
        *(
            column
            for index in range(len(ZONES))
            for column in (place(index), *(zone(index, name) for name in _FIGURES))
        ),
        *(zone(index, "changed") for index in range(len(ZONES), len(PARTS))),
        Column(None, lambda x: sums.get(x.name) or EFFECTS[x.name].what, name="what"),
        Column(None, lambda x: "" if x.name in sums else EFFECTS[x.name].without, name="without"),
    ]
    found = {p.name: (p.microseconds, p.difference) for p in plan.predictions}
    planned_us, full_us = plan.microseconds
    rows = [
        _Line(name, "absent" if name in plan.absent else state, *found.get(name, (None, None)))
        for name, state in _states(plan).items()
    ]
    rows += [
        _Line("left_out", "", planned_us - full_us, plan.left_out),
        _Line("planned", "", planned_us),
        _Line("full", "", full_us),
    ]
    kept = [column for column in columns if times or column.name != "us_per_line"]
    return Sheet(kept, rows).csv()


# Safety


def emission(scene: Description, config: Config) -> safety.Emission:
    """Return the beam that leaves the instrument, in the form for laser safety."""
    return safety.Emission(
        wavelength_nm=scene.laser.wavelength_nm,
        mirror_hz=config.mirror.frequency_hz,
        amplitude_rad=math.radians(config.mirror.amplitude_deg),
        rate_hz=config.line.rate_hz,
        pulse_s=1e-6 * config.line.pulse_us,
    )


def laser_class(power_w: float, beam: safety.Emission, *, stalled: bool) -> str:
    """Return the class of a laser: 1, 2, 3R, 3B or 4.

    3B and 4 are separated by 0.5 W of mean power and 30 mJ of a pulse; the spreading of the light
    by a scan head is not taken into account there.

    Args:
        power_w: Power that leaves the instrument while the laser is on.
        beam: The beam, with its pulses and motion.
        stalled: Whether the mirror rests.
    """
    for name, limit in _limits(beam, stalled=stalled).items():
        if power_w <= limit.power_w:
            return name
    mean_mw, pulse_j = 1e3 * power_w * beam.duty, power_w * beam.pulse_s
    return "3B" if mean_mw <= MOST_3B_MW and pulse_j <= MOST_3B_J else "4"


def _limits(beam: safety.Emission, *, stalled: bool) -> dict[str, safety.SafePower]:
    """Return the lowest limit of each class, least class first."""
    lowest: dict[str, safety.SafePower] = {}
    for row in safety.largest_safe_power(beam):
        if (row.place == "stalled") != stalled:
            continue
        known = lowest.get(row.laser_class)
        if known is None or row.power_w < known.power_w:
            lowest[row.laser_class] = row
    return lowest


def safety_lines(scene: Description, config: Config) -> list[str]:
    """Return the largest safe power of each class, and the scene's own class, moving and stalled.

    Powers are those that leave the instrument while the laser is on. The moving beam is judged
    where it is worst: in the middle of the scan, or where it turns.
    """
    beam = emission(scene, config)
    power_mw = output_mw(scene.laser)
    pulsed = (
        f"pulses of {config.line.pulse_us:g} µs at {1e-3 * beam.rate_hz:g} kHz, "
        f"{beam.wavelength_nm:g} nm"
    )
    lines = [
        f"Laser safety (IEC 60825-1:2014; 7 mm pupil at 100 mm; {pulsed}): the scene's beam has "
        f"{power_mw:.3g} mW in a pulse, {power_mw * beam.duty:.3g} mW in the mean",
        "  largest safe power in a pulse, mW: "
        + "; ".join(
            f"class {name} {1e3 * moving.power_w:.3g} moving ({moving.rule}), "
            f"{1e3 * rest.power_w:.3g} stalled ({rest.rule})"
            for (name, moving), rest in zip(
                _limits(beam, stalled=False).items(),
                _limits(beam, stalled=True).values(),
                strict=True,
            )
        ),
    ]
    if power_mw == 0.0:
        return [*lines, "  this scene: no laser light leaves the instrument"]
    moving_class = laser_class(1e-3 * power_mw, beam, stalled=False)
    stalled_class = laser_class(1e-3 * power_mw, beam, stalled=True)
    lines.append(
        f"  this scene: class {moving_class} while the mirror moves, class {stalled_class} if it "
        "stalls"
    )
    return lines


# Other light


def light_lines(light: Light, plan: Plan) -> list[str]:
    """Return lines on the effect of sun, lamps and gloss on the laser's spot; none without them.

    B is that of detectability (4) with the laser's mean power over an exposure, as the pixel adds
    up both for that long, on the surfaces that the camera sees at each zone's depth. The least
    power is the one at which the spot is ``peak.snr_min`` times its noise, (6) with that B. Both
    assume that the spot's light is even over its 1/e2 width.
    """
    scene = light.scene
    lines = []
    if scene.sun is not None or scene.lamp:
        lines += _background_lines(light) + _brightness_lines(light, plan)
    if any(scene.material_of(target.material).gloss > 0.0 for target in scene.target):
        lines.append(_glint_line(light))
    return lines


def _background(light: Light) -> Floats:
    """Return the electrons that sun and lamps put into each pixel [length]."""
    scene = light.scene
    names = [name for name, there in (("sun", scene.sun), ("lamps", scene.lamp)) if there]
    return np.asarray(np.sum([light.ambient(name, 0.0) for name in names], axis=0))


def _background_lines(light: Light) -> list[str]:
    config, model = light.config, light.scene.sensor
    electrons = _background(light)
    gain = config.peak.kappa if model.gain is None else model.gain
    full = 2**config.sensor.pixel_width - 1
    mean, most = float(electrons.mean()), float(electrons.max())
    return [
        f"Background light: {mean:.0f} electrons a pixel in {1e6 * light.exposure_s:.1f} µs, at "
        f"most {most:.0f} ({100.0 * most * gain / full:.1f} % of full scale, shot noise "
        f"{math.sqrt(most):.0f} beside {model.read_noise_e:g} electrons of read noise)"
    ]


def _brightness_lines(light: Light, plan: Plan) -> list[str]:
    """Return B and the least power at the depth of each zone."""
    scene, config = light.scene, light.config
    point, normal, target, _ = light.view(0.0)
    seen = np.flatnonzero(target >= 0)
    if len(seen) == 0:
        return []
    pixel = np.linspace(0, config.sensor.line_length - 1, len(target)).round().astype(np.int64)
    background = _background(light)[pixel]
    gain = config.peak.kappa if scene.sensor.gain is None else scene.sensor.gain
    dark = math.hypot(scene.sensor.read_noise_e, math.sqrt(1.0 / 12.0) / gain)
    share = 1e-6 * config.line.pulse_us / light.exposure_s
    # The irradiance below is already in band, and laser and background pass the same filter.
    glass = Filter(laser=1.0, band=1.0, ratio=1.0)
    cells = []
    for zone, z_mm in zip(ZONES, plan.distance_mm, strict=True):
        if not np.isfinite(z_mm):
            continue
        away = np.abs(point[seen, 2] - z_mm)
        near = seen[away <= max(_NEAR * z_mm, float(away.min()))]
        irradiance = float(np.mean(_irradiance(light, point[near], normal[near])))
        way = np.linalg.norm(point[near], axis=1)
        facing = np.abs(dot(point[near], normal[near])) / np.maximum(way, 1.0)
        range_mm = float(way.mean())
        view = View(cos_in=float(np.clip(facing.mean(), _LEAST_COS, 1.0)))
        beam = Beam(
            power_w=1e-3 * output_mw(scene.laser) * share,
            diameter_mm=2.0 * float(radius_mm(np.array(range_mm), scene.laser)),
            divergence_rad=0.0,
        )
        ratio = float(detectability.brightness_ratio(beam, range_mm, irradiance, glass, view))
        cell = f"{zone}, z {z_mm:.0f} mm: B {ratio:.3g}"
        electrons = float(background[near].mean())
        if electrons > 0.0 and irradiance > 0.0:
            required = detectability.required_ratio(config.peak.snr_min, electrons, dark)
            least = detectability.least_power_w(
                beam, range_mm, irradiance, glass, view, required=required
            )
            cell += f", least power {1e3 * float(least) / share:.2g} mW (B {required:.3g})"
        cells.append(cell)
    return [
        "Brightness ratio of spot and background, and least power in a pulse for S/N "
        f"{config.peak.snr_min:g}:",
        *[f"  {cell}" for cell in cells],
    ]


def _irradiance(light: Light, point: Floats, normal: Floats) -> Floats:
    """Return the in-band W/m2 of sun, where nothing hides it, and of lamps on surfaces [n]."""
    scene, band = light.scene, light.scene.lens.filter_nm
    found = np.zeros(len(normal))
    if scene.sun is not None:
        far = point + 4.0 * (light.farthest_mm + 1.0) * scene.sun.towards()
        shaded = light.world.blocked(point, far)
        found = found + scene.sun.in_band_irradiance(normal, shaded=shaded, band_nm=band)
    for lamp in scene.lamp:
        found = found + lamp.in_band_irradiance(normal, band_nm=band)
    return found


def _glint_line(light: Light) -> str:
    """Return where along the sweep gloss outshines the diffuse light, at y = 0."""
    scene, config = light.scene, light.config
    half = config.mirror.amplitude_deg
    if scene.scan.sweep == "even":
        half = scene.scan.half_angle_deg
    angle = np.radians(np.linspace(-half, half, _RAYS))
    beam = np.stack([np.sin(angle), np.zeros(_RAYS), np.cos(angle)], axis=1)

    def collected(*, gloss: bool) -> tuple[Floats, Bools, Floats]:
        spots = meet(
            light.world,
            light.materials,
            scene,
            config,
            np.zeros_like(beam),
            beam,
            np.zeros(_RAYS),
            gloss=gloss,
            falloff=True,
        )
        place = np.nan_to_num(spots.position_px, nan=-1.0)
        on_row = spots.seen & (place > -0.5) & (place < config.sensor.line_length - 0.5)
        return spots.collected, on_row, spots.point

    bright, on_row, point = collected(gloss=True)
    plain, _, _ = collected(gloss=False)
    usable = on_row & (plain > 0.0)
    if not usable.any():
        return "Gloss: no spot that the camera sees"
    ratio = np.where(usable, bright / np.where(usable, plain, 1.0), 0.0)
    top = int(ratio.argmax())
    share = 100.0 * float((ratio[usable] > _BRIGHT).mean())
    where = f"x {point[top, 0]:.0f}, z {point[top, 2]:.0f} mm"
    line = f"Gloss: up to {ratio[top]:.3g} times the diffuse light, at {where}"
    if share > 0.0:
        line += f"; more than {_BRIGHT:g} times on {share:.1f} % of what the camera sees"
    return line


def summary(plan: Plan) -> list[str]:
    """Return which effects a scan has had, and what the others would have cost and done."""
    on, of = len(plan.active), len(plan.present)
    if on == of:
        return [f"effects: all {of} (fidelity {plan.fidelity})"]
    planned, everything = plan.microseconds
    known = plan.left_out.total_px[np.isfinite(plan.left_out.total_px)]
    changes = (
        f"{known.max():.4f} px rms and {100 * plan.left_out.changed.max():.1f} % of the points"
        if known.size
        else "nothing that can be told, as no surveyed line has a point with and without it"
    )
    return [
        f"effects: {on} of {of} on (fidelity {plan.fidelity}{_tolerance(plan)}), {planned:.0f} us "
        f"a line instead of {everything:.0f}, chosen in {plan.seconds:.1f} s; what is left out "
        f"changes {changes}: see vrscan budget"
    ]


def stray_lines(light: Light, plan: Plan) -> list[str]:
    """Return the scene's strongest ghosts, its halo and the loss by dust, one line each.

    Ghosts are of a spot at the middle of the scene's depth, 2 mm off the optical axis on the
    sensor. A of metis (6) is here the halo's brightest pixel beyond the spot over all light.
    """
    lines = []
    if "ghosts" in plan.present:
        depth = np.array([np.nanmedian(plan.distance_mm)])
        found = light.ghosts(depth, np.array([_FIELD_MM]))
        order = np.argsort(-found.power[:, 0])[:_SHOWN]
        each = [
            f"{found.names[k]} {found.power[k, 0]:.1e} at {found.offset_px[k, 0]:+.0f} px "
            f"in a disc of {found.blur_px[k, 0]:.0f} px"
            for k in order
            if found.power[k, 0] > 0.0
        ]
        if each:
            lines.append(f"Ghosts of a spot {_FIELD_MM:g} mm off the axis: " + "; ".join(each))
    if "window" in plan.present:
        ghost = light.window_ghost(np.zeros(1))
        turn = math.degrees(float(ghost.turn_rad[0]))
        lines.append(
            f"Scan head window: second beam of {ghost.power[0]:.1e}, "
            f"{ghost.shift_mm[0]:+.2f} mm beside the first, turned by {turn:+.2f} degrees"
        )
    if "halo" in plan.present:
        halo = light.halo
        beyond = float(halo.weights[BEYOND_PX:].max(initial=0.0))
        level = attenuation(np.array([beyond]), 1.0, np.ones(1), 1.0)
        lines.append(
            f"Halo: {halo.total:.1e} of the light is scattered, {halo.row:.1e} of it onto the row; "
            f"A of metis (6), {BEYOND_PX} px and more from the spot: {level:.1e}"
        )
    if "dust" in plan.present:
        lost = 100.0 * light.obscured
        deepest = 100.0 * (1.0 - float(light.shadow.min()))
        lines.append(
            f"Dust: takes {lost:.2f} % of the light, of the darkest pixel {deepest:.1f} % more"
        )
    return lines
