"""The link budget of a scene: from the laser's power to the error of a point, in closed form.

Numbers in brackets are those of iria. The three lines that are judged stand for the near, middle
and far third of a scan's points; nothing is rendered. The budget takes the spot for one on an even
surface: it leaves out edges, second bounces, ghosts and halo, the fixed pattern, and that
neighbours share a part of their speckle. The bounds are those of a detector that knows the spot's
shape. A Gaussian fit comes near them where the spot is one; on the flat spot of a lens out of focus
it errs up to three times as much.
"""

import math
from dataclasses import dataclass

import numpy as np
from rich.table import Table as RichTable

from vrscan.data.arrays import Floats
from vrscan.ideal import geometry as triangle
from vrscan.scene import beam, image, radiometry
from vrscan.scene.beam import output_mw, pulse_rms_s, radius_mm
from vrscan.scene.light import Light
from vrscan.scene.sensor import cramer_rao_variance, readout
from vrscan.scene.simulate import Scanner
from vrscan.scene.spots import Camera, Spots, meet
from vrscan.show.sheet import Column, Sheet, number, words
from vrscan.study.plan import ZONES, survey

_NEAR = 0.05  # share of a zone's z: lines that near stand for the zone
_PLACES = 16  # places within a pixel over which a bound is averaged
_AIRY = 0.42  # sigma of the Gaussian nearest to a diffraction disc, in lambda F
_STEP = 0.05  # px by which a spot is moved for the derivative
_CHORDS = np.linspace(-1.0, 1.0, 401)[1:-1]


@dataclass(frozen=True)
class Link:
    """The budget of one line; positions are in the scanner's frame.

    Powers are while the laser is on, electrons those of one exposure. Sigmas are standard
    deviations of the position from line to line; those of light know of noise alone.
    """

    line: int  # number of the line
    surface: str
    x_mm: float
    z_mm: float
    range_mm: float  # from the surface to the lens
    reflectance: float  # matt reflectance that sends as much light to the lens
    sent_mw: float  # power that leaves the instrument
    received_uw: float  # power of the spot that enters the lens, (2-30)
    passed: float  # share of it that reaches the sensor
    row_share: float  # share of that on the row, eta_B of (2-31)
    signal_e: float  # electrons of the spot on the row
    peak_e: float  # electrons of its brightest pixel
    full_scale: float  # height of that pixel over full scale, with all other light
    widths_px: dict[str, float]  # sigmas that make up the spot's
    sigma_px: float  # sigma of the spot along the row
    background_e: float  # electrons of sun and lamps in a pixel
    dark_rms_e: float  # rms noise of a pixel without light
    snr: float  # of the brightest pixel, (2-41)
    contrast: float  # of a pixel's speckle
    phase_px: float  # sigma of the window's first harmonic, (2-80); NaN if saturated
    bound_px: float  # least sigma with noise alone
    speckled_px: float  # least sigma with speckle
    mm_per_px: float  # change of z with the position
    least_reflectance: float  # matt reflectance at which the height is snr_min times the noise


def link_budget(light: Light, count: int) -> list[Link | None]:
    """Return the budget of the near, middle and far third of a scan; None where there is no line.

    Each third is judged by the line whose light is the median of those near its mean depth.

    Args:
        light: The scene and the instrument.
        count: Number of lines of the scan.

    Raises:
        InputError: if the camera sees none of the lines.
    """
    seen = survey(light, count)
    when, _ = Scanner(light, count, frozenset()).given(seen.numbers)
    spots = _spots(light, when.angle_rad, when.y_mm)
    lit = spots.seen & (spots.collected > 0.0)
    found: list[Link | None] = []
    for zone, z_mm in enumerate(seen.distance_mm):
        rows = np.flatnonzero(lit & (seen.part == zone))
        if len(rows) == 0:
            found.append(None)
            continue
        away = np.abs(spots.point[rows, 2] - z_mm)
        rows = rows[away <= max(_NEAR * z_mm, float(away.min()))]
        row = int(rows[np.argsort(spots.collected[rows])[len(rows) // 2]])
        found.append(
            _link(
                light,
                spots,
                row,
                line=int(when.line[row]),
                angle_rad=float(when.angle_rad[row]),
                rate_rad_per_s=float(when.rate_rad_per_s[row]),
                y_mm=float(when.y_mm[row]),
            )
        )
    return found


def _spots(light: Light, angle_rad: Floats, y_mm: Floats) -> Spots:
    beam = np.stack([np.sin(angle_rad), np.zeros_like(angle_rad), np.cos(angle_rad)], axis=1)
    return meet(
        light.world,
        light.materials,
        light.scene,
        light.config,
        np.zeros_like(beam),
        beam,
        y_mm,
        gloss=True,
        falloff=True,
    )


def _link(
    light: Light,
    spots: Spots,
    row: int,
    *,
    line: int,
    angle_rad: float,
    rate_rad_per_s: float,
    y_mm: float,
) -> Link:
    """Return the budget of one line, which has a spot that the lens sees."""
    scene, config = light.scene, light.config
    laser, lens, geometry = scene.laser, scene.lens, config.geometry
    distance, depth = spots.distance[row : row + 1], spots.depth[row : row + 1]
    place = float(spots.position_px[row])
    pulse_s = 1e-6 * config.line.pulse_us

    # From the laser to electrons on the row.
    sent_w = 1e-3 * output_mw(laser)
    received_w = sent_w * (1.0 - light.emitter.total) * float(spots.collected[row])
    passed = lens.transmission * lens.filter_transmission
    passed *= (1.0 - light.obscured) * (1.0 - light.scatter.total)
    received_e = float(
        radiometry.photoelectrons(
            received_w, pulse_s, scene.sensor.quantum_efficiency * passed, laser.wavelength_nm
        )
    )
    width = float(radius_mm(distance, laser)[0])
    height = 0.5 * width * geometry.focal_mm / geometry.pitch_mm / float(depth[0])
    disc = float(image.defocus_radius_px(depth, lens.focus_mm, lens.f_number, config)[0])
    tall, blur, near = np.array([height]), np.array([disc]), beam.zone(distance, laser)
    cut = beam.cut(laser)
    share = float(image.row_share(tall, blur, lens.row_offset_px, cut=cut, zone=near)[0])
    signal_e = received_e * share

    # Along the row every blur adds its variance.
    sweep = abs(float(spots.px_per_mm[row])) * float(distance[0]) * abs(rate_rad_per_s)
    half = 0.5 * config.sensor.line_length
    widths = {
        "beam": 0.5 * width * abs(float(spots.px_per_mm[row])),
        "defocus": disc * _chord_rms(height / max(disc, 1e-6)),
        "motion": sweep * pulse_rms_s(laser, pulse_s),
        "coma": lens.coma_px * abs(place - geometry.centre_px) / half,
        "diffraction": _AIRY * 1e-6 * laser.wavelength_nm * lens.f_number / geometry.pitch_mm,
        "pixel": math.sqrt(1.0 / 12.0),
    }
    sigma = math.hypot(*widths.values())
    shape, slope = _profile(light, widths, disc, height, place, float(near[0]))
    peak_e = signal_e * float(shape.max(axis=1).mean())

    # Noise.
    background_e = _background(light, place, y_mm)
    pixels = readout(scene.sensor, config.peak.kappa, config.sensor.pixel_width)
    dark_e = scene.sensor.dark_electrons(light.exposure_s)
    dark_rms = math.sqrt(pixels.read_noise_e**2 + dark_e + 1.0 / 12.0 / pixels.gain**2)
    even_e = background_e + dark_rms**2  # variance of a pixel without the spot
    target = int(spots.target[row])
    contrast = float(light.speckle.contrast(depth, light.looks[target])[0])
    top_e = (pixels.top_count - pixels.offset_counts) / pixels.gain - background_e - dark_e
    told = np.where(signal_e * shape < top_e, signal_e * slope, 0.0)
    bound, speckled = (_bound(signal_e * shape, told, even_e, each) for each in (0.0, contrast))

    phase = _phase(signal_e * shape, even_e, config.peak.k_noise, config.peak.k_height)
    u, step = triangle.undistorted(np.array([place]), geometry)
    rise = triangle.triangle(u, np.array([angle_rad]), geometry).slope * step
    white = _white(light, angle_rad, y_mm, spots.point[row])
    reflectance = float(spots.collected[row]) / white
    return Link(
        line=line,
        surface=light.names[light.groups[target]],
        x_mm=float(spots.point[row, 0]),
        z_mm=float(spots.point[row, 2]),
        range_mm=float(np.linalg.norm(spots.point[row] - _camera(light).place)),
        reflectance=reflectance,
        sent_mw=1e3 * sent_w,
        received_uw=1e6 * received_w,
        passed=passed,
        row_share=share,
        signal_e=signal_e,
        peak_e=peak_e,
        full_scale=(pixels.offset_counts + pixels.gain * (peak_e + background_e + dark_e))
        / pixels.top_count,
        widths_px=widths,
        sigma_px=sigma,
        background_e=background_e,
        dark_rms_e=dark_rms,
        snr=float(radiometry.signal_to_noise(peak_e, background_e, dark_rms)),
        contrast=contrast,
        phase_px=phase if peak_e < top_e else math.nan,
        bound_px=bound,
        speckled_px=speckled,
        mm_per_px=abs(float(rise[0])),
        least_reflectance=reflectance * _least(peak_e, background_e, dark_rms, config.peak.snr_min),
    )


def _camera(light: Light) -> Camera:
    return Camera.of(light.config, light.scene.lens.f_number)


def _white(light: Light, angle_rad: float, y_mm: float, point: Floats) -> float:
    """Return the share of the spot's light that a matt white surface would send into the lens."""
    beam = np.array([[math.sin(angle_rad), 0.0, math.cos(angle_rad)]])
    normal = light.world.cast(np.array([[0.0, y_mm, 0.0]]), beam).normal[0]
    camera = _camera(light)
    sight = camera.place - point
    far = float(np.linalg.norm(sight))
    facing = max(float(sight @ normal) / far, 0.0)
    pupil = camera.pupil_mm2 * float(-(sight @ camera.axis)) / far  # foreshortened
    return float(radiometry.matt_share(facing, pupil, far))


def _chord_rms(ratio: float) -> float:
    """Return the rms half length of the defocused disc's slice on the row, over its radius.

    It falls from 1/sqrt(3), of a uniform chord, to 1/2, of all of the disc's light.

    Args:
        ratio: Sigma of the spot across the row over the disc's radius.
    """
    chord = np.sqrt(1.0 - np.square(_CHORDS))
    share = np.array([math.erf(each / (math.sqrt(2.0) * max(ratio, 1e-6))) for each in chord])
    return math.sqrt(float((share * np.square(_CHORDS)).sum() / share.sum()))


def _background(light: Light, place_px: float, y_mm: float) -> float:
    scene = light.scene
    pixel = int(np.clip(round(place_px), 0, light.config.sensor.line_length - 1))
    names = [name for name, there in (("sun", scene.sun), ("lamps", scene.lamp)) if there]
    return float(sum(light.ambient(name, y_mm)[pixel] for name in names))


def _least(peak_e: float, background_e: float, dark_rms_e: float, snr: float) -> float:
    """Return the share of a surface's light at which the height is ``snr`` times the noise.

    The background comes from the same surface: x N = snr sqrt(x N_B + N_d^2), solved for x.
    """
    if not peak_e > 0.0:
        return math.inf
    half = 0.5 * snr**2 * background_e
    root = math.sqrt(half**2 + (peak_e * snr * dark_rms_e) ** 2)
    return (half + root) / peak_e**2


def _profile(
    light: Light, widths: dict[str, float], disc: float, height: float, place: float, near: float
) -> tuple[Floats, Floats]:
    """Return the shares of the spot's light in pixels, and their derivatives by the position.

    Motion enters as if it were part of the beam's Gaussian, or a Gaussian beside a cut beam.

    Returns:
        Two arrays [places within a pixel, pixels].
    """
    scene, geometry = light.scene, light.config.geometry
    fraction = (np.arange(_PLACES) + 0.5) / _PLACES - 0.5
    every = np.ones(_PLACES)
    gaussian = math.hypot(widths["beam"], widths["motion"])
    coma = math.copysign(widths["coma"], place - geometry.centre_px)
    width = int(image.window_width(gaussian * every, disc * every, 0.0 * every, coma * every).max())
    transfer = image.diffraction(
        image.frequencies(width), scene.laser.wavelength_nm, scene.lens.f_number, geometry.pitch_mm
    ).astype(np.float32)
    cut = beam.cut(scene.laser)
    if cut is not None:
        turns = 2.0 * widths["beam"] * image.frequencies(width)[None]
        band = image.band(np.array([height]), np.array([disc]))
        transfer *= cut.transfer(turns.astype(np.float32), np.array([near]), band)[0]
        gaussian = widths["motion"]

    def at(shift: float) -> Floats:
        found = image.profiles(
            fraction + shift,
            width,
            gaussian * every,
            radius_px=disc * every,
            height_ratio=height / max(disc, 1e-3) * every,
            coma_px=coma * every,
            transfer=transfer,
        )
        return np.maximum(found.astype(np.float64), 0.0)

    return at(0.0), (at(_STEP) - at(-_STEP)) / (2.0 * _STEP)


def _bound(light_e: Floats, slope_e: Floats, even_e: float, contrast: float) -> float:
    """Return the least sigma of a spot's position, rms over its places in a pixel.

    Args:
        light_e: Electrons of the spot [places, pixels].
        slope_e: Their derivatives by the position, 0 where a pixel is full [places, pixels].
        even_e: Variance of a pixel without the spot.
        contrast: Contrast of a pixel's speckle.
    """
    if not np.all(slope_e.any(axis=1)):
        return math.inf
    return math.sqrt(float(cramer_rao_variance(light_e, slope_e, even_e, contrast).mean()))


def _phase(light_e: Floats, even_e: float, k_noise: float, k_height: float) -> float:
    """Return the sigma of the paper's one window by (2-80), rms over its places in a pixel.

    The window is what is above the threshold. Of the sum of its pixels' variances the part of the
    harmonic across its phase has half, as (2-80) has it, whatever pixels it comes from: shot noise
    at the spot's middle makes it less by 4 % at most.

    Args:
        light_e: Electrons of the spot [places, pixels].
        even_e: Variance of a pixel without the spot.
        k_noise: Threshold in deviations of a pixel without the spot.
        k_height: Threshold in heights of the peak.
    """
    variance = 0.0
    for row in light_e:
        above = row[row > max(k_noise * math.sqrt(even_e), k_height * row.max())]
        period = len(above)
        if period < 3:
            return math.inf
        turn = np.exp(-2j * math.pi * np.arange(period) / period)
        harmonic = abs(complex((above * turn).sum()))
        noise = math.sqrt(float((above + even_e).sum()))
        variance += float(radiometry.phase_sigma(period, harmonic / noise)) ** 2 / len(light_e)
    return math.sqrt(variance)


def _height(percent: float) -> str:
    return f"{number(percent)}{' saturated' * (percent >= 100.0)}"


_WIDTHS = ("beam", "defocus", "motion", "coma", "diffraction", "pixel")


def _width(name: str) -> Column[Link]:
    return Column(f"  {name},", lambda k: k.widths_px[name], number, name=f"{name}_px", unit="px")


_COLUMNS: list[Column[Link]] = [
    words("surface", lambda link: link.surface, name="surface"),
    Column("place x, z,", lambda k: f"{k.x_mm:.0f}, {k.z_mm:.0f}", unit="mm"),
    Column(None, lambda link: link.line, name="line"),
    Column(None, lambda link: link.x_mm, name="x_mm"),
    Column(None, lambda link: link.z_mm, name="z_mm"),
    Column("distance to the lens,", lambda k: k.range_mm, number, name="range_mm", unit="mm"),
    Column("reflectance, if it were matt", lambda k: k.reflectance, number, name="reflectance"),
    Column("power that leaves,", lambda k: k.sent_mw, number, name="sent_mw", unit="mW"),
    Column("power into the lens (2-30),", lambda k: k.received_uw, number, name="received_uw",
           unit="µW"),
    Column("of it to the sensor,", lambda k: k.passed, number, name="passed", unit="%", scale=100),
    Column("of that on the row (2-31),", lambda k: k.row_share, number, name="row_share", unit="%",
           scale=100),
    Column("signal (2-43),", lambda k: k.signal_e, number, name="signal_e", unit="e"),
    Column("brightest pixel,", lambda k: k.peak_e, number, name="peak_e", unit="e"),
    Column("its height of full scale,", lambda k: k.full_scale, _height, name="full_scale",
           unit="%", scale=100),
    Column("width s of the spot,", lambda k: k.sigma_px, number, name="sigma_px", unit="px"),
    *map(_width, _WIDTHS),
    Column("background,", lambda k: k.background_e, number, name="background_e", unit="e"),
    Column("noise without light,", lambda k: k.dark_rms_e, number, name="dark_rms_e", unit="e"),
    Column("S/N of that pixel (2-41)", lambda k: k.snr, number, name="snr"),
    Column("speckle's contrast", lambda k: k.contrast, number, name="contrast"),
    Column("sigma: one window (2-80),", lambda k: k.phase_px, number, name="phase_px", unit="px"),
    Column("  bound of light,", lambda k: k.bound_px, number, name="bound_px", unit="px"),
    Column("  bound with speckle,", lambda k: k.speckled_px, number, name="speckled_px",
           unit="px"),
    Column("  the same in z,", lambda k: k.speckled_px * k.mm_per_px, number,
           name="speckled_mm", unit="mm"),
    Column("least reflectance", lambda k: k.least_reflectance, number, name="least_reflectance"),
]  # fmt: skip


def link_table(links: list[Link | None], light: Light) -> RichTable:
    """Return the budget for the terminal: a row for each quantity, a column for each zone."""

    def zone(index: int) -> Column[Column[Link]]:
        def value(quantity: Column[Link]) -> str:
            link = links[index]
            return "no line" if link is None else quantity.text(link)

        return Column(ZONES[index], value)

    columns: list[Column[Column[Link]]] = [
        words("", lambda quantity: quantity.title),
        *map(zone, range(len(ZONES))),
    ]
    quantities = Sheet(_COLUMNS, ()).shown
    config = light.config
    return Sheet(columns, quantities).terminal(
        f"{light.scene.source}: link budget of a line near, in the middle and far",
        f"In closed form, for a pulse of {config.line.pulse_us:g} µs; numbers in brackets are "
        "iria's. Sigmas: standard deviation of a position from line to line, of noise alone but "
        f"where speckle is named. Least reflectance: height of {config.peak.snr_min:g} times the "
        "noise beside the spot, on speckle's mean.",
        gap=2,
    )


def link_csv(links: list[Link | None]) -> bytes:
    """Return the budget as a file: a row for each zone that has lines."""
    there = [(zone, link) for zone, link in zip(ZONES, links, strict=True) if link is not None]

    def of(column: Column[Link]) -> Column[tuple[str, Link]]:
        return Column(None, lambda row: column.value(row[1]), name=column.name)

    zones: Column[tuple[str, Link]] = Column(None, lambda row: row[0], name="zone")
    return Sheet([zones, *map(of, _COLUMNS)], there).csv()
