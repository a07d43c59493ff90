"""The whole chain in float64: lines to points by the papers' equations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.data.config import Config
from vrscan.data.contract import checked
from vrscan.data.lines import Lines
from vrscan.data.points import SIGMA_MOST
from vrscan.data.table import Table
from vrscan.ideal import confidence, free_space, geometry, peak_fit, peak_neighbours, two_pass
from vrscan.ideal.correction_map import correction, filled_beside, maps_for
from vrscan.ideal.peak import (
    CORE_HEIGHT,
    EVEN,
    MOST_GAP,
    Windows,
    clear,
    cut,
    isolate,
    threshold,
    unclipped,
)
from vrscan.ideal.position import Phase, first_harmonic, windows
from vrscan.ideal.statistics import statistics

MAX_WINDOW = 255  # px
MIRROR_FLAGS = ("NOT_RUNNING", "INDEX_FAULT", "UNSETTLED")  # by bit
_CHUNK = 512  # lines computed at a time: they fit in a cache


def run(
    lines: Pixels,
    angle_rad: Floats,
    power: Ints,
    config: Config,
    progress: Callable[[int], None] | None = None,
    *,
    mirror_flags: Ints | int = 0,
    breaks: Sequence[int] = (),
    lens: Ints | None = None,
) -> Table:
    """Return the point of each line.

    Args:
        lines: Counts [n, length].
        angle_rad: Scan angle at each line [n].
        power: Laser power at each line [n].
        config: Thresholds and geometry.
        progress: Called with the number of lines done so far.
        mirror_flags: Bits of ``MIRROR_FLAGS`` for each line, [n] or one for all.
        breaks: Lines that those before them are no neighbours of; see ``peak_neighbours``.
        lens: Position of the lens at each line, steps [n]; None is that of ``[map]``.

    Returns:
        A table of n rows. Numbers are not limited to the widths of the fixed-point formats,
        but x and z beyond their range are no point.

    Raises:
        ValueError: a ``LinesError``, if ``vrscan.data.contract.checked`` refuses an argument.
    """
    given = checked(Lines(lines, angle_rad, power, mirror_flags=mirror_flags), config)
    lines, angle_rad, power = given.lines, given.angle_rad, given.power
    raised = np.asarray(given.mirror_flags)
    parts = []
    history = peak_fit.History.empty()
    for start in range(0, max(1, len(given)), _CHUNK):
        part = slice(start, start + _CHUNK)
        some = lines[part], angle_rad[part], power[part], raised[part]
        spots, history = _run(*some, config, start, history)
        parts.append(spots)
        if progress is not None:
            progress(min(start + _CHUNK, len(given)))
    return _located(parts, config, breaks, lens)


@dataclass(frozen=True)
class _Spots:
    """Spots of n lines that have no place yet, and what tells whether their neighbours agree."""

    points: Table
    scale: Floats
    light: Floats
    power: Ints


def _located(
    spots: Sequence[_Spots], config: Config, breaks: Sequence[int], lens: Ints | None
) -> Table:
    """Return the points of lines that follow each other."""
    points = Table.joined([each.points for each in spots])
    measured, flags = points.measured, dict(points.flags)
    sigma, typical, doubt = points.sigma_px, points.sigma_px, points.doubt_px
    if config.peak.fit:
        scale, light, power = (
            np.concatenate([getattr(each, name) for each in spots])
            for name in ("scale", "light", "power")
        )
        beside = peak_neighbours.peak_neighbours(
            measured=measured,
            position=points.position_px,
            sigma=sigma,
            scale=scale,
            light=light,
            power=power,
            breaks=breaks,
        )
        sigma, typical, doubt = beside.sigma, beside.typical, beside.doubt
        flags["MIXED"] = flags["MIXED"] | beside.mixed
    position, maps = points.position_px, maps_for(config)
    flags["MAP_FILLED"] = np.zeros(len(points), np.bool_)
    if maps is not None:
        if lens is None:
            place = np.full(len(points), maps.lens(config.map.focus_mm))
        else:
            place = maps.place(1e-3 * config.focus.resolution_um * lens.astype(np.float64))
        given, length = (position, points.angle_rad, place), config.sensor.line_length
        flags["MAP_FILLED"] = measured & filled_beside(*given, maps.filled, line_length=length)
        position = position + correction(*given, maps.corrections_px, line_length=length)
    u, scale = geometry.undistorted(position, config.geometry)
    located = geometry.triangle(u, points.angle_rad, config.geometry)
    sigma_z, typical_z = (np.abs(located.slope) * np.abs(scale) * own for own in (sigma, typical))
    away = np.hypot(located.x, located.z) >= 2.0 * config.geometry.range_mm  # of the format of q
    flags["NO_RANGE"] = measured & (located.no_range | away)
    beyond = np.maximum(np.abs(located.x), np.abs(located.z)) >= config.geometry.range_mm
    flags["OUT_OF_RANGE"] = measured & beyond & ~flags["NO_RANGE"]
    there = measured & ~(flags["NO_RANGE"] | flags["OUT_OF_RANGE"])
    wanted = config.geometry
    if wanted.confidence == "printed":
        c_obj = confidence.printed_confidence(points.snr, there, snr_max=wanted.snr_max)
    else:
        tolerance = wanted.tolerance
        c_obj = confidence.object_confidence(located.z, typical_z, there, tolerance=tolerance)
        c_obj = np.where(flags["MIXED"], 0.5, 1.0) * c_obj
    return replace(
        points,
        flags=flags,
        sigma_px=sigma,
        doubt_px=doubt,
        x_mm=np.where(there, located.x, 0.0),
        z_mm=np.where(there, located.z, 0.0),
        sigma_z_mm=np.minimum(sigma_z, SIGMA_MOST * config.geometry.unit_mm),
        c_obj=c_obj,
        located=there,
    )


def _run(
    lines: Pixels,
    angle_rad: Floats,
    power: Ints,
    mirror_flags: Ints,
    config: Config,
    first: int,
    history: peak_fit.History,
) -> tuple[_Spots, peak_fit.History]:
    peak = config.peak
    noise_row = peak.noise == "row"
    row = statistics(lines, max_window=MAX_WINDOW, noise_row=noise_row)
    background, noise, spread = row.background, row.noise, row.spread
    height = row.maximum - background

    gap = MOST_GAP if peak.fit else 0

    def runs(level: Floats) -> Windows:
        first, least, most = row.first_maximum, peak.min_width, peak.max_core
        return isolate(lines, first, level, min_width=least, max_width=most, gap=gap)

    k_noise, k_height = peak.k_noise, peak.cut_height
    window = runs(cut(row, k_noise=k_noise, k_height=k_height, limited=not noise_row))
    core = runs(threshold(background, noise, row.maximum, k_noise=k_noise, k_height=CORE_HEIGHT))
    clearly = clear(core, max_core=peak.max_core)
    noise = np.where(clearly, noise, np.maximum(noise, spread))
    raised = np.maximum(row.noise, unclipped(row.noise, background))
    judged = np.where(row.row_only | noise_row, row.noise, raised)
    # Dim light is a spot where the row is as even as what is beside it: noise of low frequencies,
    # which is as wide as a spot, is not.
    even = clearly & ~row.row_only & (spread <= EVEN * row.noise)
    least = np.where(even, peak.snr_min, peak.snr_sure)
    judged = np.where(clearly & ~even, judged, np.maximum(judged, spread))
    low_snr = (height <= 0.0) | (height < least * judged)
    snr = confidence.signal_to_noise(row.maximum, background, noise)

    too_narrow = (window.pixels < peak.min_width) | ~window.pair
    saturated = row.maximum >= config.sensor.least_saturated
    too_wide = (window.width > peak.max_width) | ((core.pixels > peak.max_core) & ~saturated)
    valid = np.flatnonzero(~(low_snr | too_narrow | too_wide))
    left, right, width = window.left.copy(), window.right.copy(), window.width.copy()

    def correlate(slope: Floats | None = None) -> Phase:
        return first_harmonic(
            windows(lines[valid], left[valid], width[valid]),
            width[valid],
            period_n=peak.period == "n" or peak.two_pass,
            background=background[valid],
            noise=noise[valid],
            kappa=peak.kappa,
            slope=slope,
        )

    found = correlate()
    if peak.two_pass:
        shot = np.maximum(peak.kappa * height[valid], np.finfo(np.float64).tiny)
        second = two_pass.second_windows(
            lines[valid],
            left=left[valid],
            width=width[valid],
            position=left[valid] + found.delta,
            share=found.magnitude / found.light,
            rho=np.square(noise[valid]) / shot,
            noise=noise[valid],
            max_window=MAX_WINDOW,
        )
        left[valid], width[valid] = second.left, second.width
        right[valid] = second.left + second.width - 1
        found = correlate(second.slope)
    measured = np.zeros(len(lines), np.bool_)
    measured[valid] = ~found.no_phase
    position = _spread(left[valid] + found.delta, valid, len(lines))
    sigma = _spread(found.sigma, valid, len(lines))
    mixed = np.zeros(len(lines), np.bool_)
    wide = np.zeros(len(lines))
    if peak.fit:
        fit = peak_fit.peak_fit(
            lines,
            measured=measured,
            left=left,
            width=np.where(measured, width, 0),
            slope=_spread(second.slope, valid, len(lines)),
            position=position,
            spread=sigma,
            sigma=_spread(second.sigma, valid, len(lines)),
            maximum=row.maximum,
            background=background,
            noise=noise,
            saturation_level=config.sensor.least_saturated,
            kappa=peak.kappa,
            history=history,
        )
        position, sigma, history = fit.position, fit.sigma, fit.history
        mixed, wide = fit.mixed, fit.scale
    present = window.width > 0
    last = lines.shape[1] - 1
    flags: dict[str, Bools] = {
        "LOW_SNR": low_snr,
        "TOO_NARROW": too_narrow,
        "TOO_WIDE": too_wide,
        "AT_EDGE": present & ((left == 0) | (right == last)),
        "SATURATED": saturated,
        "RIVAL": core.rivals > 0,
        "NO_PHASE": _spread(found.no_phase.astype(np.float64), valid, len(lines)) > 0,
        "NO_NOISE": noise == 0.0,
        "ROW_STATISTICS": row.row_only & (not noise_row),
        "MIXED": mixed,
        **{name: mirror_flags >> bit & 1 == 1 for bit, name in enumerate(MIRROR_FLAGS)},
    }
    nothing = low_snr & (noise > 0.0) & (mirror_flags == 0)
    for name in ("SATURATED", "TOO_WIDE", "ROW_STATISTICS"):
        nothing &= ~flags[name]
    free_from, free_to = free_space.free_interval(angle_rad, power, noise, config)
    c_sfm = confidence.free_confidence(power, nothing, power_max=config.laser.power_max)
    none = np.zeros(len(lines))
    points = Table(
        line=np.arange(first, first + len(lines)),
        flags=flags,
        left=left,
        right=right,
        width=width,
        maximum=row.maximum,
        row_mean=row.row_mean,
        row_variance=row.row_variance,
        background=background,
        noise=noise,
        snr=snr,
        position_px=position,
        sigma_px=sigma,
        doubt_px=none,
        angle_rad=np.asarray(angle_rad, np.float64),
        x_mm=none,
        z_mm=none,
        sigma_z_mm=none,
        c_obj=none,
        c_sfm=c_sfm,
        free_from_mm=np.where(c_sfm > 0.0, free_from, 0.0),
        free_to_mm=np.where(c_sfm > 0.0, free_to, 0.0),
        measured=measured,
        located=measured,
        y_mm=none,
        time_s=np.full(len(lines), np.nan),
        power=np.asarray(power, np.float64),
        pixel_width=config.sensor.pixel_width,
    )
    light = _spread(found.light, valid, len(lines))
    return _Spots(points, wide, light, np.asarray(power)), history


def _spread(values: Floats, rows: Ints, count: int) -> Floats:
    """Return ``values`` in ``rows`` of an array of ``count`` zeros."""
    spread = np.zeros(count)
    spread[rows] = values
    return spread
