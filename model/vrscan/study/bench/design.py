"""The detector with other widths: its positions against float64, and against the truth in noise.

The window, its background and its noise sums are the shipped ones. Only the computation of the
first harmonic of (8) changes: it is that of rtl/peak/phase_correlate.sv with other widths.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints, Pixels
from vrscan.data.config import Config
from vrscan.data.points import Points
from vrscan.data.residuals import rms
from vrscan.fixed import cordic_vector, phase_correlate, quarter_wave
from vrscan.fixed.divide import divide
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.vrscan_chain import MAX_WINDOW, first_windows, run_fixed
from vrscan.ideal.geometry import project, triangle, undistorted
from vrscan.ideal.position import first_harmonic, windows
from vrscan.registers.chain_registers import Registers
from vrscan.scene.sensor import REACH
from vrscan.study.bench.cells import Figures, configuration
from vrscan.study.bench.widths import ADC_BITS, Design
from vrscan.study.report.efficiency import BACKGROUND_COUNTS, PEAKS, READ_NOISE_COUNTS
from vrscan.study.report.figure import mean
from vrscan.study.report.spot_lines import profile, score

EXACT, NOISY, SKEWED = (
    f"vrscan.study.bench.design:{name}" for name in ("exact", "noisy", "skewed")
)

SPOTS_PX = (1.0, 2.0, 4.0, 8.0, 12.0, 40.0)  # without noise; the last fills the largest window
HEIGHTS = (0.05, 0.5)  # shares of full scale
SKEW, SKEW_PX = 0.25, 3.0  # sides of 0.75 and 1.25 times this many px
SKEW_HEIGHTS = (0.1, 0.2, 0.5, 0.9)  # shares of full scale
RANGES_MM = (250.0, 500.0, 1000.0)
_STEP_WIDTH = phase_correlate.STEP_WIDTH
_TURN = 1 << _STEP_WIDTH
_CHUNK = 256  # lines computed at a time


@dataclass(frozen=True)
class Cut:
    """n windows with the lines that contain them; int64 [n]."""

    left: Ints
    width: Ints
    background: Ints  # counts, ``24 - pixel_width`` fraction bits


@dataclass(frozen=True)
class Place:
    """n positions."""

    phase: Ints  # fraction of a turn, ``angle_width`` bits [n]
    position: Ints  # px, 12 fraction bits [n]
    unrounded: Floats  # px [n]


def harmonic(lines: Pixels, cut: Cut, design: Design, *, period_n: bool) -> tuple[Ints, Ints]:
    """Return X and Y of (8) as the first pass of phase_correlate gives them with these widths.

    Args:
        lines: Pixels [n, line_length].
        cut: Windows of the lines.
        design: The widths.
        period_n: Whether T = N; otherwise T = N - 1.
    """
    place = np.arange(int(cut.width.max(initial=0)))
    inside = place < cut.width[:, None]
    column = np.minimum(cut.left[:, None] + place, lines.shape[1] - 1)
    pixels = np.take_along_axis(lines, column, axis=1).astype(np.int64)
    pedestal = cut.background >> (pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH)
    aligned = pixels << (pkg.ALIGNED_WIDTH - design.pixel_width)
    height = np.where(inside, aligned - pedestal[:, None], 0)
    step, _ = divide(np.int64(_TURN), cut.width - (not period_n), quotient_width=_STEP_WIDTH)
    angle = (place * step[:, None]) & (_TURN - 1)
    sine, cosine = quarter_wave.quarter_wave(
        angle >> (_STEP_WIDTH - design.phase_width),
        phase_width=design.phase_width,
        ampl_width=design.sine_width,
        table_bits=design.table_bits,
        entry_width=design.entry_width,
    )
    x = np.einsum("nk,nk->n", height, cosine)
    y = np.einsum("nk,nk->n", height, sine)
    return x if period_n else x + pedestal * design.sine_amplitude, y


def placed(x: Ints, y: Ints, cut: Cut, design: Design, *, period_n: bool) -> Place:
    """Return the positions of harmonics as CORDIC and peak_position give them with these widths."""
    phase, _, _ = cordic_vector.cordic_vector(
        x,
        y,
        xy_width=design.xy_width,
        angle_width=design.angle_width,
        rotations=design.rotations,
    )
    period = cut.width - (not period_n)
    shift = design.angle_width - pkg.POSITION_FRACTION
    delta = (phase * period + (1 << (shift - 1))) >> shift
    return Place(
        phase=phase,
        position=(cut.left << pkg.POSITION_FRACTION) + delta,
        unrounded=cut.left + phase * period * 2.0**-design.angle_width,
    )


def every(lines: Pixels, cut: Cut, designs: Sequence[Design], *, period_n: bool) -> list[Place]:
    """Return the positions of the same windows for each of the designs."""
    sums: dict[tuple[int, int, int, int], tuple[Ints, Ints]] = {}
    found = []
    for design in designs:
        if design.table not in sums:
            sums[design.table] = harmonic(lines, cut, design, period_n=period_n)
        found.append(placed(*sums[design.table], cut, design, period_n=period_n))
    return found


def bound(design: Design, ratio: float = 0.1) -> float:
    """Return the largest error of a position that the widths allow, px: T = N, any heights.

    As ``docs/numbers.md`` derives it, with the table's largest error measured: half an output step,
    the CORDIC's, and what errors of the samples can turn a harmonic of ``ratio`` times their sum.

    Args:
        design: The widths.
        ratio: Ratio of the first harmonic to the sum of the heights.
    """
    width = np.arange(pkg.MIN_WINDOW, MAX_WINDOW + 1)[:, None]
    place = np.arange(MAX_WINDOW)
    step, _ = divide(np.int64(_TURN), width, quotient_width=_STEP_WIDTH)
    sine, cosine = quarter_wave.quarter_wave(
        ((place * step) & (_TURN - 1)) >> (_STEP_WIDTH - design.phase_width),
        phase_width=design.phase_width,
        ampl_width=design.sine_width,
        table_bits=design.table_bits,
        entry_width=design.entry_width,
    )
    full = quarter_wave.amplitude(design.sine_width, design.table_bits, design.entry_width)
    error = np.abs((cosine + 1j * sine) / full - np.exp(2j * np.pi * place / width))
    worst = np.where(place < width, error, 0.0).max(axis=1)
    period = width[:, 0].astype(np.float64)
    steps, _ = cordic_vector.angle_bounds(design.angle_width, design.rotations)
    turned = np.arcsin(np.minimum(worst / ratio, 1.0)) / (2.0 * np.pi)
    reach = 2.0 ** -(pkg.POSITION_FRACTION + 1) + period * (
        steps * 2.0**-design.angle_width + turned
    )
    return float(np.minimum(reach, period / 2.0).max())


def clocks(design: Design, width: int, first_width: int | None = None) -> int:
    """Return the clocks from the end of a line's replay to its position.

    Args:
        design: The widths.
        width: Number of pixels in the window.
        first_width: With two passes, the number of pixels in the first window.
    """
    shipped = cordic_vector.latency(pkg.HARMONIC_WIDTH, pkg.ANGLE_WIDTH)
    own = cordic_vector.latency(design.xy_width, design.angle_width, design.rotations)
    count = phase_correlate.latency(width) + own - shipped
    count += multiply_latency(design.angle_width + 1, pkg.WINDOW_WIDTH + 1) + 1
    if first_width is not None:
        from vrscan.fixed import peak_refine

        count += phase_correlate.first_latency(first_width) + own - shipped + peak_refine.latency()
    return count


# ---- lines ----


def sensor(config: Config, pixel_width: int, **peak: Any) -> Config:
    """Return the instrument with a converter of another width, under the same light.

    Args:
        config: Configuration, whose kappa belongs to its own pixel width.
        pixel_width: Bits of a pixel.
        peak: Values of [peak] that change.
    """
    kappa = math.ldexp(config.peak.kappa, pixel_width - config.sensor.pixel_width)
    values = {"window": "threshold", **peak, "kappa": kappa}
    return config.model_copy(
        update={
            "sensor": config.sensor.model_copy(update={"pixel_width": pixel_width}),
            "peak": config.peak.model_copy(update=values),
        }
    )


def light(
    sigma_px: float,
    peak: float,
    true: Floats,
    config: Config,
    draw: np.random.Generator | None,
    skew: float = 0.0,
) -> tuple[Floats, float]:
    """Return lines of one spot each as they reach the converter, and the error bound.

    It is the light of ``vrscan efficiency``, in counts of 12 bits.

    Args:
        sigma_px: Standard deviation of the spot.
        peak: Height of the spot, share of full scale.
        true: Positions of the spots, px [n].
        config: Line length, and counts per electron at its pixel width.
        draw: Source of photons and read noise; without one there is no noise.
        skew: Sides of (1 - skew) and (1 + skew) times ``sigma_px``; the top is at ``true``.

    Returns:
        Counts of 12 bits [n, line_length], not rounded, and the least variance of a position, px^2.
    """
    kappa = math.ldexp(config.peak.kappa, ADC_BITS - config.sensor.pixel_width)
    reach = math.ceil(REACH * (1.0 + skew) * sigma_px)
    first = np.round(true).astype(np.int64) - reach
    edges = first[:, None] + np.arange(2 * reach + 2.0) - 0.5
    shape, slope = profile(true, (1.0 - skew) * sigma_px, (1.0 + skew) * sigma_px, edges)
    electrons = peak * 2**ADC_BITS / kappa
    dark = (READ_NOISE_COUNTS**2 + 1.0 / 12.0) / kappa**2 + BACKGROUND_COUNTS / kappa
    told = np.square(electrons * slope) / (dark + electrons * shape)
    seen = electrons * shape + BACKGROUND_COUNTS / kappa
    counts = np.full((len(true), config.sensor.line_length), BACKGROUND_COUNTS)
    own = kappa * seen
    if draw is not None:
        even = math.hypot(READ_NOISE_COUNTS, math.sqrt(kappa * BACKGROUND_COUNTS))
        counts += even * draw.standard_normal(counts.shape, np.float32)
        own = kappa * draw.poisson(seen) + READ_NOISE_COUNTS * draw.standard_normal(seen.shape)
    np.put_along_axis(counts, first[:, None] + np.arange(2 * reach + 1), own, axis=1)
    return counts, float((1.0 / told.sum(axis=1)).mean())


def converted(counts: Floats, pixel_width: int) -> Pixels:
    """Return the output of a converter of this width for counts of 12 bits."""
    scaled = np.floor(np.ldexp(counts, pixel_width - ADC_BITS) + 0.5)
    return np.clip(scaled, 0, 2**pixel_width - 1).astype(np.uint16)


def _run(lines: Pixels, config: Config) -> Points:
    nothing = np.zeros(len(lines), np.int64)
    return run_fixed(lines, nothing, nothing, Registers.from_config(config))


def _cut(points: Points) -> tuple[Ints, Cut]:
    """Return the lines that have a position, and their windows."""
    rows = np.flatnonzero(points.measured)
    return rows, Cut(points.left[rows], points.width[rows], points.background[rows])


# ---- works ----


def exact(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the error of the arithmetic alone, against (8) in float64 on the same pixels.

    Spots without noise go through a pixel in fine steps. The period may wrap: an error is taken
    modulo T.

    Args:
        parameters: ``config``, ``designs``, all of one pixel width, and ``steps`` per pixel.
        seed: Not used.

    Returns:
        ``errors``, for each design rms and maximum of the position and rms before its rounding, px;
        ``converter``, the rms error of (8) in float64 by the pixels' rounding alone, px;
        ``windows``, their number.
    """
    designs = [Design.of(values) for values in parameters["designs"]]
    bits = designs[0].pixel_width
    if any(design.pixel_width != bits for design in designs):
        raise ValueError("design: the pixel widths of a cell differ")
    base = configuration(parameters)
    config = sensor(base, bits)
    period_n = config.peak.period == "n"
    middle = config.sensor.line_length // 2
    true = middle + (np.arange(parameters["steps"]) + 0.5) / parameters["steps"] - 0.5
    errors: list[list[Floats]] = [[] for _ in designs]
    unrounded: list[list[Floats]] = [[] for _ in designs]
    converter: list[Floats] = []
    for sigma in SPOTS_PX:
        for height in HEIGHTS:
            counts, _ = light(sigma, height, true, base, None)
            lines = converted(counts, bits)
            rows, cut = _cut(_run(lines, config))
            if not rows.size:
                continue  # the converter is too coarse
            period = (cut.width - (not period_n)).astype(np.float64)
            quiet = np.zeros(rows.size)

            def delta(pixels: Any, cut: Cut = cut, quiet: Floats = quiet) -> Floats:
                found = first_harmonic(
                    windows(pixels, cut.left, cut.width),
                    cut.width,
                    period_n=period_n,
                    background=quiet,
                    noise=quiet,
                    kappa=0.0,
                )
                return found.delta

            def off(position: Any, exact: Floats, period: Floats = period) -> Floats:
                return np.asarray((position - exact + period / 2.0) % period - period / 2.0)

            want = delta(lines[rows])
            for k, found in enumerate(every(lines[rows], cut, designs, period_n=period_n)):
                position = found.position * 2.0**-pkg.POSITION_FRACTION - cut.left
                errors[k].append(off(position, want))
                unrounded[k].append(off(found.unrounded - cut.left, want))
            converter.append(off(want, delta(np.ldexp(counts[rows], bits - ADC_BITS))))
    return {
        "errors": [
            {
                "rms": rms(np.concatenate(e)),
                "max": float(np.abs(np.concatenate(e)).max()),
                "unrounded": rms(np.concatenate(u)),
            }
            for e, u in zip(errors, unrounded, strict=True)
        ],
        "converter": rms(np.concatenate(converter)),
        "windows": sum(len(part) for part in converter),
    }


def noisy(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the errors against the truth on the noisy lines of ``vrscan efficiency``.

    All designs and rules get the same photons and the same read noise.

    Args:
        parameters: ``config``, ``sigma_px``, ``lines`` for each height, ``designs``, and ``rules``:
            values of [peak] that change.
        seed: Seed of the noise.

    Returns:
        By height of ``PEAKS``: ``bound_px``; ``designs``, the scores of each; ``rules``, the scores
            of each with ``width``, the mean number of pixels of the window, ``first``, that of the
            first window where there are two, and ``rival``, the share of lines with the flag RIVAL,
            although there is no rival.
    """
    base = configuration(parameters)
    sigma, count = float(parameters["sigma_px"]), int(parameters["lines"])
    designs = [Design.of(values) for values in parameters["designs"]]
    rules: list[dict[str, Any]] = parameters["rules"]
    result: Figures = {"bound_px": [], "designs": [], "rules": []}
    for peak in PEAKS:
        draw = np.random.default_rng([seed, round(100 * sigma), round(1000 * peak)])
        length = base.sensor.line_length
        true = draw.uniform(0.25 * length, 0.75 * length, count)
        found = {design: np.full(count, np.nan) for design in designs}
        by_rule = [np.full(count, np.nan) for _ in rules]
        widths: list[list[Floats]] = [[] for _ in rules]
        firsts: list[list[Floats]] = [[] for _ in rules]
        rivals = [0 for _ in rules]
        bounds = []
        for start in range(0, count, _CHUNK):
            part = np.arange(start, min(start + _CHUNK, count))
            counts, bound = light(sigma, peak, true[part], base, draw)
            bounds.append(bound * len(part))
            for bits in sorted({design.pixel_width for design in designs}):
                own = [design for design in designs if design.pixel_width == bits]
                config = sensor(base, bits)
                lines = converted(counts, bits)
                rows, cut = _cut(_run(lines, config))
                period_n = config.peak.period == "n"
                for design, place in zip(
                    own, every(lines[rows], cut, own, period_n=period_n), strict=True
                ):
                    found[design][part[rows]] = place.position * 2.0**-pkg.POSITION_FRACTION
            lines = converted(counts, ADC_BITS)
            for k, rule in enumerate(rules):
                config = sensor(base, ADC_BITS, **rule)
                points = _run(lines, config)
                rows = np.flatnonzero(points.measured)
                position = points.position[rows] * 2.0**-pkg.POSITION_FRACTION
                by_rule[k][part[rows]] = position
                rivals[k] += int((points.flags[rows] >> pkg.FLAG_RIVAL & 1).sum())
                widths[k].append(points.width[rows].astype(np.float64))
                firsts[k].append(_first_widths(lines[rows], config))
        result["bound_px"].append(math.sqrt(sum(bounds) / count))
        result["designs"].append([asdict(score(found[design], true)) for design in designs])
        result["rules"].append(
            [
                asdict(score(where, true))
                | {
                    "width": mean(np.concatenate(width)),
                    "first": mean(np.concatenate(first)),
                    "rival": rival / count,
                }
                for where, width, first, rival in zip(by_rule, widths, firsts, rivals, strict=True)
            ]
        )
    return result


def skewed(parameters: dict[str, Any], seed: int) -> Figures:
    """Return how far each rule of the window moves a skewed spot as its height changes.

    Args:
        parameters: ``config``, ``lines`` for each of ``SKEW_HEIGHTS``, and ``rules``: values of
            [peak] that change.
        seed: Seed of the noise.

    Returns:
        ``moved``: largest less smallest mean position for each rule, px.
    """
    base, count = configuration(parameters), int(parameters["lines"])
    rules: list[dict[str, Any]] = parameters["rules"]
    means: list[list[float]] = [[] for _ in rules]
    for peak in SKEW_HEIGHTS:
        draw = np.random.default_rng([seed, round(1000 * peak)])
        length = base.sensor.line_length
        true = draw.uniform(0.25 * length, 0.75 * length, count)
        lines = converted(light(SKEW_PX, peak, true, base, draw, SKEW)[0], ADC_BITS)
        for moved, rule in zip(means, rules, strict=True):
            points = _run(lines, sensor(base, ADC_BITS, **rule))
            found = points.position * 2.0**-pkg.POSITION_FRACTION - true
            moved.append(mean(found[points.measured]))
    return {"moved": [max(each) - min(each) for each in means]}


def _first_widths(lines: Pixels, config: Config) -> Floats:
    """Return the widths of the windows that the threshold cuts, px [n]."""
    _, found = first_windows(lines, Registers.from_config(config), MAX_WINDOW)
    return found.width.astype(np.float64)


def micrometres(config: Config) -> list[float]:
    """Return dz/dx_s straight ahead at each of ``RANGES_MM``, um/px, from the geometry."""
    distance = np.array(RANGES_MM)
    u, per_px = undistorted(project(np.zeros(3), distance, config.geometry), config.geometry)
    slope = triangle(u, np.zeros(3), config.geometry).slope
    return [float(value) for value in 1e3 * np.abs(slope * per_px)]
