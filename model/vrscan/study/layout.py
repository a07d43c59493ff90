"""The optics of a scanner before it is built: what its camera sees, and how well, over the range.

Field of view, resolution and the error that is left to shot noise follow from the triangle of base,
lens and sensor alone; there is no scene and no lens error in them. ``vrscan budget`` has these.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, BinaryIO

import numpy as np
from rich.text import Text

from vrscan.data import pkg
from vrscan.data.arrays import Floats
from vrscan.data.config import Config, Geometry
from vrscan.data.errors import InputError
from vrscan.ideal.free_space import response, spot_px
from vrscan.ideal.geometry import (
    angle_precision,
    lateral_error,
    project,
    triangle,
    undistorted,
)
from vrscan.ideal.scanning import dwell_s, scan_efficiency, scan_rate, spacing_mm
from vrscan.show.sheet import Sheet, Value, listed
from vrscan.show.style import COLOURS, INK, QUIET, drawing, plain_log

ROWS = 9  # distances in the table
_BOARD, _BOARD_LEVEL = 0.5, 0.4  # reflectance of a board, and its spot's share of a full pixel
WIDTH, HEIGHT = 72, 20  # characters of the drawing


def sight_rad(z_mm: float, geometry: Geometry) -> float:
    """Return the angle beta of the line of sight to a point on the resting beam, (2)."""
    return math.atan2(z_mm - geometry.offset_mm, geometry.base_mm)


def check(config: Config, near_mm: float, far_mm: float) -> None:
    """Check that the sensor sees both ends of the range on the resting beam.

    Raises:
        InputError: in one line that says which value to change, and to what.
    """
    geometry, margin = config.geometry, config.free.edge_px
    if not 0.0 < near_mm < far_mm:
        raise InputError(f"near_mm = {near_mm:g}: not between 0 and far_mm = {far_mm:g}")
    if far_mm >= geometry.range_mm:
        raise InputError(
            f"far_mm = {far_mm:g}: x and z have {pkg.LENGTH_WIDTH} bits, which end at "
            f"{geometry.range_mm:g} mm with geometry.unit_mm = {geometry.unit_mm}"
        )
    last = config.sensor.line_length - 1
    ends = np.array([near_mm, far_mm])
    places = project(np.zeros(2), ends, geometry)
    off = ~((places >= margin) & (places <= last - margin))
    if not off.any():
        return
    near, far = sight_rad(near_mm, geometry), sight_rad(far_mm, geometry)
    half_mm = (last / 2.0 - margin) * geometry.pitch_mm
    wanted_mm = math.tan(0.5 * (far - near))  # half of the image for a focal length of 1
    name, z_mm = ("near_mm", near_mm) if off[0] else ("far_mm", far_mm)
    both = "both ends of the range are" if off.all() else f"{name} = {z_mm:g} is"
    if geometry.focal_mm * wanted_mm < half_mm:
        advice = f"bias_deg = {math.degrees(0.5 * (near + far)):.1f} sees both ends"
    else:
        length = math.ceil(2.0 * geometry.focal_mm * wanted_mm / geometry.pitch_mm + 2 * margin + 1)
        advice = (
            f"both ends need focal_mm of at most {half_mm / wanted_mm:.4g}, or line_length of "
            f"{length}, with bias_deg = {math.degrees(0.5 * (near + far)):.1f}"
        )
    raise InputError(f"{both} not on the sensor: {advice}")


@dataclass(frozen=True)
class Layout:
    """What a scanner reaches on the resting beam, each [n].

    Attributes:
        z_mm: Distances, from the near end of the range to the far end.
        position_px: Position on the sensor.
        step_mm: z of a pixel.
        across_mm: Width of a pixel at that distance, along the base.
        spot_px: Standard deviation of the spot's image.
        electrons: In the brightest pixel from the darkest surface, at full power; at most those of
            a full pixel.
        noise_px: Standard deviation that shot noise leaves to the position.
        sigma_mm: The same of z.
        lateral_mm: The same along the base, e_l of VR-SCAN (6).
        angle_urad: Precision p_a of the scan angle that VR-SCAN (7) asks for beside that.
        dwell_us: Time in which the beam passes a pixel.
        spacing_mm: Distance of neighbouring points of a sweep.
        efficiency: Share of time in which the camera sees the beam there.
    """

    z_mm: Floats
    position_px: Floats
    step_mm: Floats
    across_mm: Floats
    spot_px: Floats
    electrons: Floats
    noise_px: Floats
    sigma_mm: Floats
    lateral_mm: Floats
    angle_urad: Floats
    dwell_us: Floats
    spacing_mm: Floats
    efficiency: Floats


def layout(config: Config, near_mm: float, far_mm: float, count: int = ROWS) -> Layout:
    """Return what a scanner reaches at distances whose ratios are the same.

    The bound of shot noise is s / sqrt(N) with N = sqrt(2 pi) s A electrons, s the spot's width and
    A its peak.
    """
    geometry = config.geometry
    z = np.geomspace(near_mm, far_mm, count)
    zero = np.zeros(count)
    position = project(zero, z, geometry)
    u, pitch = undistorted(position, geometry)
    step = np.abs(triangle(u, zero, geometry).slope * pitch)
    beta = geometry.bias_rad + np.arctan(u / geometry.focal_mm)
    depth = np.hypot(geometry.base_mm, z - geometry.offset_mm) * np.cos(beta - geometry.bias_rad)
    spot = spot_px(depth, config) / 2.0
    electrons = config.free.darkest * response(z, zero, config)
    electrons = np.minimum(electrons, config.sensor.full_well_e)
    noise = spot / np.sqrt(math.sqrt(2.0 * math.pi) * spot * electrons)
    across = depth * geometry.pitch_mm / geometry.focal_mm
    on_sensor = noise * geometry.pitch_mm
    rate = scan_rate(config.mirror)
    return Layout(
        z_mm=z,
        position_px=position,
        step_mm=step,
        across_mm=across,
        spot_px=spot,
        electrons=electrons,
        noise_px=noise,
        sigma_mm=noise * step,
        lateral_mm=lateral_error(z, on_sensor, geometry),
        angle_urad=1e6 * angle_precision(z, on_sensor, geometry),
        dwell_us=1e6 * dwell_s(across / z, rate),
        spacing_mm=spacing_mm(z, rate, config.line.rate_hz),
        efficiency=scan_efficiency(z, config),
    )


def sheet(found: Layout) -> Sheet[Sequence[Value]]:
    """Return the table of a layout."""
    names = (
        "z\nmm", "\npx", "z\nmm/px", "across\nmm/px", "spot\npx", "electrons", "noise\npx",
        "sigma of z\nmm", "e_l (6)\nmm", "p_a (7)\nµrad", "dwell\nµs", "spacing\nmm",
        "scan\nefficiency",
    )  # fmt: skip
    columns = [getattr(found, field.name) for field in fields(found)]
    forms = (
        "{:.0f}", "{:.1f}", "{:.4f}", "{:.4f}", "{:.2f}", "{:.0f}", "{:.4f}",
        "{:.4f}", "{:.4f}", "{:.2f}", "{:.3f}", "{:.2f}", "{:.2f}",
    )  # fmt: skip
    rows = [
        tuple(form.format(value) for form, value in zip(forms, row, strict=True))
        for row in zip(*columns, strict=True)
    ]
    return listed(names, rows)


def scene(config: Config, z_mm: float) -> str:
    """Return a scene file: a grey board in focus, its spot ``_BOARD_LEVEL`` of a full pixel high.

    Its sensor is the configuration's, as that of every scene that says nothing of it.
    """
    focused = config.free.model_copy(update={"focus_mm": z_mm})
    focused_config = config.model_copy(update={"free": focused})
    full_e = _BOARD * float(response(np.array([z_mm]), np.zeros(1), focused_config)[0])
    power_mw = config.laser.rated_mw * _BOARD_LEVEL * config.sensor.full_well_e / full_e
    return (
        f'title = "a grey board at {z_mm:.4g} mm"\n\n'
        f"[laser]\npower_mw = {min(power_mw, config.laser.rated_mw):.3g}\n\n"
        f"[lens]\nfocus_mm = {z_mm:.4g}\n\n"
        f"[material.grey]\nreflectance = {_BOARD:g}\n\n"
        f'[[target]]\nkind = "plane"\nname = "board"\nmaterial = "grey"\n'
        f"position_mm = [0, 0, {z_mm:.4g}]\nrotation_deg = [0, -20, 0]\n"
    )


def summary(config: Config) -> str:
    """Return the field of view and the scan that passes it, in one line."""
    geometry = config.geometry
    ends = np.array([0.0, config.sensor.line_length - 1.0])
    u, _ = undistorted(ends, geometry)
    low, high = np.degrees(np.arctan(u / geometry.focal_mm))
    return (
        f"field of view {high - low:.1f} degrees, lines of sight at {geometry.bias_deg + low:.1f} "
        f"to {geometry.bias_deg + high:.1f}; scan +-{config.mirror.amplitude_deg:g} degrees, "
        f"{scan_rate(config.mirror):.0f} rad/s on the resting beam"
    )


def _sights(config: Config, far_mm: float) -> list[tuple[float, float]]:
    """Return where the lines of sight of the sensor's ends are at the far end of the range."""
    geometry = config.geometry
    u, _ = undistorted(np.array([0.0, config.sensor.line_length - 1.0]), geometry)
    beta = geometry.bias_rad + np.arctan(u / geometry.focal_mm)
    reach = far_mm - geometry.offset_mm
    return [
        (geometry.base_mm - reach / math.tan(angle), far_mm)
        if math.tan(angle) > 0.0
        else (geometry.base_mm + reach * math.tan(angle - math.pi / 2.0), far_mm)
        for angle in beta.tolist()
    ]


def terminal(config: Config, near_mm: float, far_mm: float) -> Text:
    """Return the triangle as characters: z to the right, the beam, both ends, the field of view."""
    base, offset = config.geometry.base_mm, config.geometry.offset_mm
    cells = [[" "] * WIDTH for _ in range(HEIGHT)]
    low, high = -0.3 * base, 1.2 * base

    def put(x_mm: float, z_mm: float, mark: str) -> None:
        row = round((high - x_mm) / (high - low) * (HEIGHT - 1))
        column = round(z_mm / far_mm * (WIDTH - 1))
        if 0 <= row < HEIGHT and 0 <= column < WIDTH:
            cells[row][column] = mark

    share = np.linspace(0.0, 1.0, 20 * WIDTH)
    for x_mm, z_mm in _sights(config, far_mm):
        for k in share.tolist():
            put(base + k * (x_mm - base), offset + k * (z_mm - offset), ".")
    for k in share.tolist():
        put(0.0, k * far_mm, "=" if k * far_mm >= near_mm else "-")
    put(0.0, near_mm, "N")
    put(0.0, far_mm, "F")
    put(0.0, 0.0, "M")
    put(base, offset, "C")
    rows = "\n".join("".join(row).rstrip() for row in cells)
    words = f"M mirror, C camera, N {near_mm:g} mm, F {far_mm:g} mm, ... field of view, base "
    return Text(f"{rows}\n{words}{base:g} mm; the scale across is not that along")


def picture(config: Config, near_mm: float, far_mm: float, file: BinaryIO) -> None:
    """Draw the triangle and the error over range as a PNG."""
    geometry, found = config.geometry, layout(config, near_mm, far_mm, 200)
    with drawing(9.0, 4.0, "The triangle, and what shot noise leaves") as figure:
        left, right = figure.subplots(1, 2)
        left.plot([0.0, far_mm], [0.0, 0.0], color=QUIET)
        left.plot([near_mm, far_mm], [0.0, 0.0], color=COLOURS[1], linewidth=3, label="range")
        for x_mm, z_mm in _sights(config, far_mm):
            left.plot([geometry.offset_mm, z_mm], [geometry.base_mm, x_mm], color=COLOURS[0])
        left.plot([0.0, geometry.offset_mm], [0.0, geometry.base_mm], "o-", color=INK)
        beside: dict[str, Any] = {"fontsize": 8, "color": INK, "ha": "right"}
        beside |= {"xytext": (-7.0, 0.0), "textcoords": "offset points"}
        left.annotate("mirror", (0.0, 0.0), va="top", **beside)
        left.annotate("camera", (geometry.offset_mm, geometry.base_mm), va="bottom", **beside)
        left.set_xlim(min(0.0, geometry.offset_mm) - 0.17 * far_mm, 1.03 * far_mm)
        left.set(xlabel="z, mm", ylabel="x, mm", title="Beam and field of view")
        left.legend()
        right.loglog(found.z_mm, found.step_mm, color=COLOURS[0], label="a pixel")
        right.loglog(found.z_mm, found.sigma_mm, color=COLOURS[1], label="shot noise, darkest")
        right.set(xlabel="z, mm", ylabel="z, mm", title="Resolution")
        plain_log(right, "x", [k * 10.0**e for e in range(5) for k in (1, 2, 3, 4, 5, 7)])
        plain_log(right, "y", [k * 10.0**e for e in range(-5, 3) for k in (1, 2, 5)])
        right.legend()
        figure.savefig(file, format="png", dpi=120)
