"""The bit-accurate signal chain, the twin of ``rtl/vrscan_chain.sv``."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints, Pixels
from vrscan.data.contract import checked_words
from vrscan.data.points import Points
from vrscan.fixed import (
    correction_map,
    free_interval,
    line_receiver,
    line_statistics,
    peak_confidence,
    peak_fit,
    peak_isolate,
    peak_neighbours,
    peak_position,
    peak_refine,
    phase_correlate,
)
from vrscan.fixed import distortion as geometry_distortion
from vrscan.fixed import triangulate as geometry_triangulate
from vrscan.registers.chain_registers import Registers
from vrscan.registers.map_table import MapTable

MAX_WINDOW = 255
CHUNK = 1024  # lines computed at a time: they fit in a core's cache

_FirstWindows = tuple[line_statistics.LineStatistics, peak_isolate.Windows]


def latency(
    width: int,
    *,
    measured: bool,
    line_length: int,
    pixel_width: int,
    max_window: int = MAX_WINDOW,
    first_width: int | None = None,
    fit: bool = False,
    mapped: bool = False,
) -> int:
    """Return the clocks from a line's last pixel to its point.

    With a fit it is the point of the line before that comes then: a point waits for the next line,
    but not longer than ``pkg.NEIGHBOUR_CLKS``.

    Args:
        width: Number of pixels in the window.
        measured: Whether the window is measured (none of LOW_SNR, TOO_NARROW, TOO_WIDE).
        line_length: ``LineLength`` of the elaboration.
        pixel_width: ``PixelWidth`` of the elaboration.
        max_window: ``MaxWindow`` of the elaboration.
        first_width: With two passes, the number of pixels in the first window.
        fit: Whether a Gaussian is fitted, from two passes on.
        mapped: Whether positions are corrected by maps.
    """
    phase = phase_correlate.latency(width) if measured else phase_correlate.UNMEASURED_LATENCY
    if measured and first_width is not None:
        phase += phase_correlate.first_latency(first_width) + peak_refine.latency()
    judged = phase + max(peak_position.LATENCY, peak_confidence.latency()) + 1
    if fit:
        judged = pkg.FIT_START + 1 + (peak_fit.LATENCY if measured else peak_fit.UNMEASURED_LATENCY)
        judged += peak_neighbours.LATENCY
    return (
        line_receiver.LATENCY
        + line_statistics.latency(line_length, pixel_width, max_window)
        + peak_isolate.latency(line_length)
        + judged
        + (correction_map.LATENCY if mapped else 0)
        + geometry_distortion.latency(line_length)
        + geometry_triangulate.LATENCY
    )


def min_period(line_length: int, max_window: int, *, two_pass: bool, fit: bool = False) -> int:
    """Return the least clocks between the ends of two good lines; 0 for no limit."""
    if fit:
        period = pkg.FIT_PERIOD
    elif two_pass:
        period = 3 * max_window + pkg.TWO_PASS_OVERHEAD
    else:
        period = 2 * max_window + pkg.MIN_PERIOD_OVERHEAD
    return 0 if line_length >= period else period


def first_windows(lines: Pixels, registers: Registers, max_window: int) -> _FirstWindows:
    """Return statistics and first window of every line; arguments as in ``run_fixed``."""
    r = registers
    statistics = line_statistics.line_statistics(
        lines, pixel_width=r.pixel_width, max_window=max_window, noise_row=r.noise_row
    )
    window = peak_isolate.peak_isolate(
        lines,
        statistics,
        pixel_width=r.pixel_width,
        max_window=max_window,
        k_noise=r.k_noise,
        k_height=r.k_height,
        snr_min=r.snr_min,
        min_width=r.min_width,
        max_width=r.max_width,
        max_core=r.max_core,
        saturation_level=r.saturation_level,
        noise_row=r.noise_row,
        window_fit=r.window_fit,
    )
    return statistics, window


def _refined(
    lines: Pixels, first: _FirstWindows, registers: Registers, max_window: int
) -> tuple[peak_isolate.Windows, Ints, Ints, Ints]:
    """Return the second pass's windows, ramps, slopes and sigmas; the first where there is none."""
    statistics, window = first
    ramp, slope, sigma = np.zeros((3, len(lines)), np.int64)
    rows = np.flatnonzero(window.measured)
    if not rows.size:
        return window, ramp, slope, sigma
    harmonic = phase_correlate.first_harmonics(
        lines[rows],
        left=window.left[rows],
        width=window.width[rows],
        background=statistics.background[rows],
        pixel_width=registers.pixel_width,
        period_n=True,
    )
    second = peak_refine.peak_refine(
        lines[rows],
        left=window.left[rows],
        width=window.width[rows],
        phase=harmonic.phase,
        magnitude=harmonic.magnitude,
        sum=harmonic.sum,
        maximum=statistics.maximum[rows],
        background=statistics.background[rows],
        noise=window.noise[rows],
        pixel_width=registers.pixel_width,
        max_window=max_window,
        kappa=registers.kappa,
    )
    left, right = window.left.copy(), window.right.copy()
    width, flags = window.width.copy(), window.flags.copy()
    left[rows], width[rows] = second.left, second.width
    right[rows] = second.left + second.width - 1
    at_edge = (left[rows] == 0) | (right[rows] == lines.shape[1] - 1)
    flags[rows] &= ~(1 << pkg.FLAG_AT_EDGE)
    flags[rows] |= at_edge.astype(np.int64) << pkg.FLAG_AT_EDGE
    ramp[rows], slope[rows], sigma[rows] = second.ramp, second.slope, second.sigma
    window = replace(window, left=left, right=right, width=width, flags=flags)
    return window, ramp, slope, sigma


def _raised(flags: Ints, bit: int) -> Bools:
    """Return whether a flag stands."""
    return (flags >> bit & 1).astype(np.bool_)


@dataclass(frozen=True)
class Peaks:
    """What laser and lens need of n lines before these have a place, [n] each."""

    maximum: Ints  # counts
    background: Ints  # u24, 24 - PixelWidth fraction bits
    measured: Bools  # whether there is a position
    saturated: Bools
    placed: Bools  # whether there is a window, which may have no phase
    width: Ints  # pixels of the window
    first_width: Ints  # pixels of the first window


def peaks(lines: Pixels, registers: Registers) -> Peaks:
    """Return the peaks of lines, as ``run_fixed`` has them; arguments as there."""
    (statistics, window), second, harmonic, _ = _windowed(lines, registers, MAX_WINDOW)
    return Peaks(
        maximum=statistics.maximum,
        background=statistics.background,
        measured=harmonic.measured,
        saturated=_raised(second.flags, pkg.FLAG_SATURATED),
        placed=window.measured,
        width=second.width,
        first_width=window.width,
    )


def _windowed(
    lines: Pixels, registers: Registers, max_window: int
) -> tuple[_FirstWindows, peak_isolate.Windows, phase_correlate.Harmonics, tuple[Ints, Ints]]:
    """Return first and last windows, the harmonics of the last, their slopes and sigmas."""
    r = registers
    first = first_windows(lines, r, max_window)
    statistics, window = first
    ramp, slope, sigma = np.zeros((3, len(lines)), np.int64)
    if r.window_two_pass:
        window, ramp, slope, sigma = _refined(lines, first, r, max_window)
    harmonic = phase_correlate.phase_correlate(
        lines,
        left=window.left,
        width=window.width,
        background=statistics.background,
        measured=window.measured,
        pixel_width=r.pixel_width,
        period_n=r.period_n or r.window_two_pass,
        ramp=ramp,
        slope=slope,
    )
    return first, window, harmonic, (slope, sigma)


def _run(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    mirror_flags: Ints,
    first: int,
    registers: Registers,
    max_window: int,
    history: peak_fit.History,
) -> tuple["_Spots", peak_fit.History]:
    r = registers
    (statistics, _), window, harmonic, (slope, spot_sigma) = _windowed(lines, r, max_window)
    position = peak_position.peak_position(
        window.left, harmonic.period, harmonic.phase, line_length=r.line_length
    )
    low_snr = _raised(window.flags, pkg.FLAG_LOW_SNR)
    blind = (window.flags & (1 << pkg.FLAG_SATURATED | 1 << pkg.FLAG_TOO_WIDE)) != 0
    blind |= statistics.row_statistics | (mirror_flags != 0)
    width = window.width & ((1 << pkg.WINDOW_WIDTH) - 1)
    quality = peak_confidence.peak_confidence(
        measured=harmonic.measured,
        clear=low_snr & ~blind,
        maximum=statistics.maximum,
        background=statistics.background,
        noise=window.noise,
        width=width,
        period=harmonic.period,
        magnitude=harmonic.magnitude,
        sum=harmonic.sum,
        wave=harmonic.wave,
        count=harmonic.count,
        power=power,
        pixel_width=r.pixel_width,
        kappa=r.kappa,
        c_sfm_gain=r.c_sfm_gain,
    )
    sigma = quality.sigma
    mixed = np.zeros(len(lines), np.bool_)
    scale = np.zeros(len(lines), np.int64)
    if r.window_fit:
        fit = peak_fit.peak_fit(
            lines,
            measured=harmonic.measured,
            left=window.left,
            width=width,
            slope=slope,
            position=position,
            spread=sigma,
            sigma=spot_sigma,
            maximum=statistics.maximum,
            background=statistics.background,
            noise=window.noise,
            pixel_width=r.pixel_width,
            kappa=r.kappa,
            saturation_level=r.saturation_level,
            history=history,
        )
        position, sigma, history = fit.position, fit.sigma, fit.history
        mixed, scale = fit.mixed, fit.scale
    position = np.where(harmonic.measured, position, 0)
    free_from, free_to = free_interval.free_interval(
        angle,
        power,
        window.noise,
        begin=r.free_begin,
        shift=r.free_shift,
        table_from=r.free_table_from,
        table_to=r.free_table_to,
    )
    flags = window.flags | mirror_flags << pkg.FLAG_NOT_RUNNING
    for bit, condition in (
        (pkg.FLAG_NO_PHASE, harmonic.no_phase),
        (pkg.FLAG_NO_NOISE, quality.no_noise),
        (pkg.FLAG_ROW_STATISTICS, statistics.row_statistics),
        (pkg.FLAG_MIXED, mixed),
    ):
        flags |= condition.astype(np.int64) << bit
    none = np.zeros(len(lines), np.int64)
    points = Points(
        line=first + np.arange(len(lines)),
        flags=flags,
        left=window.left,
        right=window.right,
        width=window.width,
        maximum=statistics.maximum,
        row_mean=statistics.row_mean,
        row_variance=statistics.row_variance,
        background=statistics.background,
        noise=window.noise,
        snr=quality.snr,
        position=position,
        sigma=sigma,
        doubt=none,
        angle=angle,
        x=none,
        z=none,
        sigma_z=none,
        c_obj=none,
        c_sfm=quality.c_sfm,
        free_from=np.where(quality.c_sfm > 0, free_from, 0),
        free_to=np.where(quality.c_sfm > 0, free_to, 0),
        measured=harmonic.measured,
        pixel_width=r.pixel_width,
        unit_mm=r.length_unit,
    )
    return _Spots(points, scale, harmonic.sum, power), history


@dataclass(frozen=True)
class _Spots:
    """Spots of n lines that have no place yet, and what tells whether their neighbours agree."""

    points: Points
    scale: Ints
    light: Ints
    power: Ints


def _located(
    spots: Sequence[_Spots],
    registers: Registers,
    breaks: Sequence[int],
    maps: MapTable | None = None,
    lens: Ints | None = None,
) -> Points:
    """Return the points of lines that follow each other."""
    r = registers
    points = Points.concatenate([each.points for each in spots])
    sigma, typical, doubt, flags = points.sigma, points.sigma, points.doubt, points.flags
    if r.window_fit:
        scale, light, power = (
            np.concatenate([getattr(each, name) for each in spots])
            for name in ("scale", "light", "power")
        )
        beside = peak_neighbours.peak_neighbours(
            measured=points.measured,
            position=points.position,
            sigma=points.sigma,
            scale=scale,
            light=light,
            power=power,
            breaks=breaks,
        )
        sigma, typical, doubt = beside.sigma, beside.typical, beside.doubt
        flags = flags | beside.mixed.astype(np.int64) << pkg.FLAG_MIXED
    position, unplaced = points.position, np.zeros(len(points), np.bool_)
    if maps is not None:
        moved = correction_map.correction_map(
            points.position,
            points.angle,
            np.full(len(points), maps.lens) if lens is None else lens,
            nodes=maps.nodes,
            filled=maps.filled,
            map_begin=maps.map_begin,
            map_shift=maps.map_shift,
            line_length=r.line_length,
        )
        position, unplaced = moved.position, moved.saturated
        filled = moved.filled & points.measured
        flags = flags | filled.astype(np.int64) << pkg.FLAG_MAP_FILLED
    corrected = geometry_distortion.distortion(
        position,
        centre=r.centre,
        k1=r.k1,
        k2=r.k2,
        even=r.even,
        line_length=r.line_length,
    )
    place = geometry_triangulate.triangulate(
        corrected.offset,
        corrected.slope,
        sigma,
        points.angle,
        typical=typical,
        measured=points.measured,
        saturated=corrected.saturated | unplaced,
        n0=r.n0,
        n1=r.n1,
        d0=r.d0,
        d1=r.d1,
        e0=r.e0,
        e1=r.e1,
        tolerance=r.tolerance,
        snr=points.snr,
        c_obj_gain=r.c_obj_gain,
        line_length=r.line_length,
    )
    half = (flags >> pkg.FLAG_MIXED & 1) if r.c_obj_gain == 0 else 0
    flags = flags | place.no_range.astype(np.int64) << pkg.FLAG_NO_RANGE
    flags = flags | place.out_of_range.astype(np.int64) << pkg.FLAG_OUT_OF_RANGE
    return replace(
        points,
        flags=flags,
        sigma=sigma,
        doubt=doubt,
        x=place.x,
        z=place.z,
        sigma_z=place.sigma_z,
        c_obj=place.c_obj >> half,
    )


def run_fixed(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    registers: Registers,
    progress: Callable[[int], None] | None = None,
    *,
    mirror_flags: Ints | int = 0,
    max_window: int = MAX_WINDOW,
    breaks: Sequence[int] = (),
    maps: MapTable | None = None,
    lens: Ints | None = None,
) -> Points:
    """Return the point of every line, bit for bit as the RTL for good lines.

    Args:
        lines: Pixels, uint16 [n, registers.line_length].
        angle: Scan angles, fractions of a turn as 24-bit signed integers, [n].
        power: Laser powers, u16, [n].
        registers: The configuration; ``pixel_width`` and ``line_length`` are the elaboration's.
        progress: Called with the number of lines done so far.
        mirror_flags: Flags of the mirror from bit 0, NOT_RUNNING, upwards; 0..7, [n] or one for
            all.
        max_window: ``MaxWindow`` of the elaboration.
        breaks: Lines that came more than ``pkg.NEIGHBOUR_CLKS`` after those before them.
        maps: Correction maps; None corrects nothing.
        lens: Position of the lens as each line's position is corrected, steps, u16 [n]; None is
            that of the maps.

    Returns:
        n points, numbered from 0.

    Raises:
        ValueError: a ``LinesError``, if ``vrscan.data.contract.checked_words`` refuses an argument.
    """
    lines, angle, power, raised = checked_words(
        lines,
        angle,
        power,
        mirror_flags,
        line_length=registers.line_length,
        pixel_width=registers.pixel_width,
    )
    parts = []
    history = peak_fit.History.empty()
    for start in range(0, max(1, len(lines)), CHUNK):
        part = slice(start, start + CHUNK)
        given = lines[part], angle[part], power[part], raised[part]
        spots, history = _run(*given, start, registers, max_window, history)
        parts.append(spots)
        if progress is not None:
            progress(min(start + CHUNK, len(lines)))
    return _located(parts, registers, breaks, maps, lens)
