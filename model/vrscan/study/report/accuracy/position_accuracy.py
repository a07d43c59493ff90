"""Accuracy of the position of the first harmonic in integers against VR-SCAN (8) in float64.

The first harmonic is that of (8): X + iY over the raw pixels of the window. With T = N it is the
same with and without a pedestal; with T = N - 1 it includes the pedestal. The sum is that of pixel
- background. The ratio of harmonic to sum decides how well the phase is known.

Phases 0 and 1 are the same, and so are a position and its neighbour one period on: an error is
taken modulo T.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.data.config import Config
from vrscan.data.residuals import rms
from vrscan.fixed.cordic_vector import angle_bounds
from vrscan.fixed.divide import divide
from vrscan.fixed.peak_position import peak_position
from vrscan.fixed.phase_correlate import STEP_WIDTH, phase_correlate
from vrscan.fixed.quarter_wave import LENGTH_ERROR, MAX_STEP, amplitude, error_bound, quarter_wave
from vrscan.ideal.position import first_harmonic
from vrscan.study.progress import Progress
from vrscan.study.report.figure import SEED, Figure, largest

LIMIT_MAX, LIMIT_RMS = 0.3e-3, 0.1e-3  # px
LEAST_RATIO = 0.1  # ratio of first harmonic to sum above which the limits hold
DECADES = 3  # decades of the ratio below that
NARROWEST, WIDEST = pkg.MIN_WINDOW, 255
FLOOR_MAX = 2.0 ** -(pkg.POSITION_FRACTION + 1)
FLOOR_RMS = 2.0**-pkg.POSITION_FRACTION / math.sqrt(12.0)
PEDESTALS = (0.0, 0.02, 0.2, 0.5, 0.8, 0.95)  # shares of full scale
PIXEL_WIDTH = 12
LINE_LENGTH = Config().sensor.line_length

_FULL = (1 << PIXEL_WIDTH) - 1
_COUNT_FRACTION = pkg.COUNT_WIDTH - PIXEL_WIDTH
_AMPLITUDE = amplitude(pkg.SINE_WIDTH)
_SCALE = 2.0 ** (pkg.SINE_WIDTH - 1)
_UNIT, _MILLI = "1e-3 px", 1e3
_BATCH = 8  # widths computed at a time: they fit in a core's cache


@dataclass(frozen=True)
class Windows:
    """Pixels of n windows that start at pixel 0.

    Attributes:
        pixels: Counts [n, 255], zeros behind the window.
        width: Number of pixels N [n].
        background: Background in counts, 12 fraction bits, not above the window's pixels [n].
    """

    pixels: Pixels
    width: Ints
    background: Ints


@dataclass(frozen=True)
class Outcome:
    """The errors of n positions against float64; all arrays [n].

    Attributes:
        error: Error of the position, px, modulo T.
        ratio: First harmonic of (8) over the sum above background.
        bound: Largest error that the widths allow, px.
        spread: Root mean square error that the widths allow, px.
    """

    error: Floats
    ratio: Floats
    bound: Floats
    spread: Floats

    @classmethod
    def joined(cls, parts: list["Outcome"]) -> "Outcome":
        """Return all parts as one."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*(np.concatenate(column) for column in columns))

    def where(self, rows: Bools) -> "Outcome":
        """Return some of the positions."""
        return Outcome(*(column[rows] for column in vars(self).values()))


def _gaussian(place: Floats, period: Floats, draw: np.random.Generator) -> Floats:
    centre = period * draw.random((len(period), 1))
    sigma = period * 10.0 ** draw.uniform(-1.5, -0.3, (len(period), 1))
    return np.asarray(np.exp(-0.5 * ((place - centre) / sigma) ** 2))


def _skewed(place: Floats, period: Floats, draw: np.random.Generator) -> Floats:
    centre = period * draw.random((len(period), 1))
    sigma = period * 10.0 ** draw.uniform(-1.5, -0.7, (len(period), 1))
    sigma = np.where(place > centre, sigma * draw.uniform(1.0, 4.0, (len(period), 1)), sigma)
    return np.asarray(np.exp(-0.5 * ((place - centre) / sigma) ** 2))


def _random(place: Floats, period: Floats, draw: np.random.Generator) -> Floats:
    power = draw.integers(1, 9, (len(period), 1))
    return np.asarray(draw.random((len(period), place.size)) ** power)


def _few(place: Floats, period: Floats, draw: np.random.Generator) -> Floats:
    chosen = (period * draw.random((len(period), 3))).astype(np.int64)
    shape = np.zeros((len(period), place.size))
    np.put_along_axis(shape, chosen, draw.random(chosen.shape), axis=1)
    return shape


def _clusters(place: Floats, period: Floats, draw: np.random.Generator) -> Floats:
    """Return two spots half a period apart whose harmonics almost cancel."""
    centre = period * draw.random((len(period), 1))
    sigma = period * 10.0 ** draw.uniform(-2.0, -0.9, (len(period), 1))

    def spot(middle: Floats) -> Floats:
        away = (place - middle + period / 2.0) % period - period / 2.0
        return np.asarray(np.exp(-0.5 * (away / sigma) ** 2))

    rest = 1.0 - 2.0 * 10.0 ** draw.uniform(-4.0, -0.3, (len(period), 1))
    return spot(centre) + rest * spot(centre + period / 2.0)


def _plateau(place: Floats, period: Floats, draw: np.random.Generator) -> Floats:
    """Return a box whose ends lie anywhere in their pixels."""
    ends = np.sort(period * draw.random((len(period), 2)), axis=1)
    covered = np.clip(ends[:, 1:] - place, 0.0, 1.0)
    return np.asarray(np.minimum(covered, np.clip(place + 1.0 - ends[:, :1], 0.0, 1.0)))


def _middle(place: Floats, period: Floats, draw: np.random.Generator) -> Floats:
    """Return a spot in the middle, whose harmonic with T = N - 1 is opposite to its pedestal's."""
    sigma = period * 10.0 ** draw.uniform(-1.5, -0.7, (len(period), 1))
    centre = period / 2.0 + draw.normal(0.0, 0.02, (len(period), 1))
    return np.asarray(np.exp(-0.5 * ((place - centre) / sigma) ** 2))


CANCELLING = "cancels its pedestal"
SHAPES: dict[str, Callable[[Floats, Floats, np.random.Generator], Floats]] = {
    "Gaussian": _gaussian,
    "skewed": _skewed,
    "random pixels": _random,
    "few pixels": _few,
    "two clusters": _clusters,
    "plateau": _plateau,
    CANCELLING: _middle,
}


def windows(
    shape: str, width: Ints, pedestal: Floats, *, period_n: bool, draw: np.random.Generator
) -> Windows:
    """Return windows of one of ``SHAPES``, of any height that the pedestal leaves.

    Args:
        shape: Name of the shape.
        width: Number of pixels N [n].
        pedestal: Height of the pedestal, share of full scale [n].
        period_n: Whether T = N; otherwise T = N - 1.
        draw: Source of the other random values.
    """
    place = np.arange(float(WIDEST))
    inside = place < width[:, None]
    period = (width[:, None] - (not period_n)).astype(np.float64)
    form = np.clip(np.where(inside, SHAPES[shape](place, period, draw), 0.0), 0.0, 1.0)
    level = np.floor(pedestal * _FULL)
    room = _FULL - level
    height = room * 10.0 ** draw.uniform(-2.0, 0.0, len(width))
    if shape == CANCELLING:
        harmonic = np.abs((form * np.exp(2j * np.pi * place / period)).sum(axis=1))
        height = level / np.maximum(harmonic, 1e-9) * draw.uniform(0.9, 1.1, len(width))
    height = np.clip(height, 1.0, room)
    counts = np.where(inside, level[:, None] + np.rint(height[:, None] * form), 0.0)
    # The background is a mean: any fraction below the lowest pixel.
    below = draw.integers(0, 1 << _COUNT_FRACTION, len(width))
    background = np.maximum((level.astype(np.int64) << _COUNT_FRACTION) - below, 0)
    return Windows(counts.astype(np.uint16), width, background)


def _phase_step(period: Ints) -> Ints:
    """Return 1 / T in 2**-32 turns, as in the accumulator."""
    turn = np.full(period.shape, 1 << STEP_WIDTH)
    return divide(turn, period, quotient_width=STEP_WIDTH)[0]


@dataclass(frozen=True)
class SampleError:
    """Errors of samples' (cosine, sine), shares of the amplitude; all arrays [n].

    Attributes:
        table: Largest length of the error by the table's length error, its entries and its rounded
            output, and the phase cut to 28 bits.
        table_rms: Root mean square of the part of this error in any one direction.
        turn: Error by the phase step's rounding to 2**-32 turns, which sample k carries k times:
            half of that of the last sample, rad. Its middle turns all samples alike.
        mean: Length of the mean error of all samples of the window, for this very table.
    """

    table: Floats
    table_rms: Floats
    turn: Floats
    mean: Floats


@cache
def _mean_error(width: int, period: int) -> float:
    """Return the length of the mean error of a window's samples."""
    error, _ = _sample_errors(width, period)
    return float(abs(error.mean()))


def _sample_errors(width: int, period: int) -> tuple[npt.NDArray[np.complex128], ...]:
    """Return the errors of cosine + i sine, and the exact ones, of the samples of a window."""
    place = np.arange(width)
    angle = (place * int(_phase_step(np.array([period]))[0])) & ((1 << STEP_WIDTH) - 1)
    sine, cosine = quarter_wave(
        angle >> (STEP_WIDTH - pkg.PHASE_WIDTH),
        phase_width=pkg.PHASE_WIDTH,
        ampl_width=pkg.SINE_WIDTH,
    )
    exact = np.exp(2j * np.pi * place / period)
    return (cosine + 1j * sine) / _AMPLITUDE - exact, exact


def sample_error(width: Ints, period: Ints) -> SampleError:
    """Return the errors of the samples of windows.

    Args:
        width: Number of pixels N [n].
        period: Period T, px [n].
    """
    half_step = 0.5 / _SCALE
    entries = error_bound(pkg.SINE_WIDTH) / _SCALE - LENGTH_ERROR - half_step
    cut = 2.0 * np.pi * 2.0 ** -(pkg.PHASE_WIDTH + 1)
    exact_step = 2.0**STEP_WIDTH / period.astype(np.float64)
    off = np.abs(_phase_step(period) - exact_step) * (width - 1).astype(np.float64)
    # d**2 / 2 about its middle, d uniform within MAX_STEP: mean -1/12, variance 1/45 of its square.
    length_rms = MAX_STEP**2 * math.sqrt(1.0 / 144.0 + 1.0 / 45.0)
    pairs = zip(width.tolist(), period.tolist(), strict=True)
    return SampleError(
        table=np.full(width.shape, LENGTH_ERROR + math.sqrt(2.0) * (entries + half_step) + cut),
        table_rms=np.full(width.shape, math.hypot(length_rms, half_step / math.sqrt(3.0)) + cut),
        turn=np.pi * off * 2.0**-STEP_WIDTH + cut,
        mean=np.array([_mean_error(*pair) for pair in pairs]),
    )


def phase_bounds(
    width: Ints, period: Ints, total: Floats, extra: Floats, harmonic: Floats, pedestal: Floats
) -> tuple[Floats, Floats]:
    """Return largest and rms error of the phase before the CORDIC, rad [n].

    An error e of every sample turns the harmonic P by up to asin(e S / |P|). ``extra`` comes with
    every pixel alike, so only the mean error counts for it.

    The pedestal, put back where T = N - 1, has the amplitude's rounding along it and, across it,
    the common turn in which it does not take part. But where it is large beside |P|, the pixels lie
    opposite to it, about phase 1/2, and so about the middle of the turns: with w the distance from
    there in half turns, sum h w^2 <= (S + X - pedestal) / 2, as 1 + cos(theta) >= 2 w^2.

    Args:
        width: Number of pixels N [n].
        period: Period T, px [n].
        total: Sum S of the pixels above the background, any unit [n].
        extra: Sum of the pedestal's distances below the background, the same unit [n].
        harmonic: First harmonic |P| of (8), the same unit [n].
        pedestal: Pedestal that was subtracted and put back, the same unit, 0 where T = N [n].
    """
    sample = sample_error(width, period)
    inner = np.sqrt(total * np.maximum(total + harmonic - pedestal, 0.0) / 2.0)
    turned = np.where(pedestal > 0.0, np.minimum(total, inner), total) * sample.turn
    alike = extra * (sample.mean + sample.turn / width)
    alike += pedestal * np.hypot(pkg.SINE_AMPLITUDE / _AMPLITUDE - 1.0, sample.turn)
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = np.where(harmonic > 0.0, (total * sample.table + turned + alike) / harmonic, np.inf)
        spread = total * (sample.table_rms + sample.turn / math.sqrt(3.0)) + alike
        spread = np.where(harmonic > 0.0, spread / harmonic, np.inf)
    worst = np.where(sine < 1.0, np.arcsin(np.minimum(sine, 1.0)), np.pi) + sample.turn
    return worst, np.minimum(spread + sample.turn, np.pi)


def error_bounds(period: Ints, worst: Floats, typical: Floats) -> tuple[Floats, Floats]:
    """Return largest and rms error of a position: phase, CORDIC and the output's rounding, px [n].

    Args:
        period: Period T, px [n].
        worst: Largest error of the phase before the CORDIC, rad [n].
        typical: Root mean square of this error, rad [n].
    """
    length = period.astype(np.float64)
    per_radian = length / (2.0 * np.pi)
    cordic_peak, cordic_rms = angle_bounds(pkg.ANGLE_WIDTH)
    step = length * 2.0**-pkg.ANGLE_WIDTH
    bound = FLOOR_MAX + step * cordic_peak + per_radian * worst
    spread = np.sqrt(FLOOR_RMS**2 + (step * cordic_rms) ** 2 + (per_radian * typical) ** 2)
    return np.minimum(bound, length / 2.0), spread


def guarantee(*, period_n: bool) -> float:
    """Return the largest error that the widths allow at a ratio of a tenth, px.

    For any N and any heights; with T = N - 1 for any pedestal too, which at that ratio is at most
    11 times the harmonic.

    Args:
        period_n: Whether T = N; otherwise T = N - 1.
    """
    width, pedestal = np.meshgrid(
        np.arange(NARROWEST, WIDEST + 1), np.array([0.0]) if period_n else np.linspace(0, 11, 111)
    )
    width, pedestal = width.ravel(), pedestal.ravel()
    period, one = width - (not period_n), np.ones(width.shape)
    angles = phase_bounds(width, period, one / LEAST_RATIO, 0.0 * one, one, pedestal)
    return float(error_bounds(period, *angles)[0].max())


def evaluate(group: Windows, *, period_n: bool) -> Outcome:
    """Return the positions of ``phase_correlate`` and ``peak_position`` against (8).

    Args:
        group: n windows.
        period_n: Whether T = N; otherwise T = N - 1.

    Returns:
        The positions for which both find a phase.
    """
    count = len(group.width)
    measured = np.ones(count, np.bool_)
    found = phase_correlate(
        group.pixels,
        left=np.zeros(count, np.int64),
        width=group.width,
        background=group.background,
        measured=measured,
        pixel_width=PIXEL_WIDTH,
        period_n=period_n,
    )
    left = np.arange(count) % 1793  # the sum is exact wherever the window starts
    position = peak_position(left, found.period, found.phase, line_length=LINE_LENGTH)
    got = (position - (left << pkg.POSITION_FRACTION)) * 2.0**-pkg.POSITION_FRACTION

    background = group.background.astype(np.float64) * 2.0**-_COUNT_FRACTION
    exact = first_harmonic(
        group.pixels.astype(np.float64),
        group.width,
        period_n=period_n,
        background=background,
        noise=np.zeros(count),
        kappa=0.0,
    )
    period = found.period.astype(np.float64)
    difference = got - exact.delta
    error = (difference + period / 2.0) % period - period / 2.0

    inside = np.arange(WIDEST) < group.width[:, None]
    total = np.where(inside, group.pixels - background[:, None], 0.0).sum(axis=1)
    aligned = pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH  # the pedestal is the background, cut to this
    pedestal = (group.background >> aligned << aligned).astype(np.float64) * 2.0**-_COUNT_FRACTION
    worst, typical = phase_bounds(
        group.width,
        found.period,
        total,
        group.width * (background - pedestal),
        exact.magnitude,
        np.zeros(count) if period_n else pedestal,
    )
    bound, spread = error_bounds(found.period, worst, typical)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = exact.magnitude / total
    outcome = Outcome(error=error, ratio=ratio, bound=bound, spread=spread)
    return outcome.where(~exact.no_phase & ~found.no_phase)


def extremes(
    width: int, *, period_n: bool, directions: int, draw: np.random.Generator
) -> tuple[Windows, float]:
    """Return the windows whose harmonic the table turns furthest, at a ratio of just a tenth.

    For a phase, the heights that turn it most are the solution of a linear programme: the greatest
    sum of height times the sample's error across the phase, with the sum, and both sides of the
    harmonic, given. At most three samples then differ from 0. Their neighbours in height come
    along, so that the output's rounding meets the worst of them.

    Args:
        width: Number of pixels N.
        period_n: Whether T = N; otherwise T = N - 1, and a pedestal is a variable too.
        directions: Number of phases to try.
        draw: Source of the random phases.

    Returns:
        The windows, and the furthest that any heights at these phases can move a position, px:
        by the table, and by as much as CORDIC and rounding can add.
    """
    period = width - (not period_n)
    error, exact = _sample_errors(width, period)
    weight = np.ones(width)
    if not period_n:
        exact, weight = np.append(exact, 1.0), np.append(weight, 0.0)
        error = np.append(error, pkg.SINE_AMPLITUDE / _AMPLITUDE - 1.0)
    rows, levels = [], []
    furthest = 0.0
    for phase in draw.uniform(0.0, 2.0 * np.pi, directions):
        aim = 1.003 * LEAST_RATIO * np.exp(1j * phase)
        found = linprog(
            -1e7 * (error * np.exp(-1j * phase)).imag,
            A_eq=np.array([exact.real, exact.imag, weight]),
            b_eq=np.array([aim.real, aim.imag, 1.0]),
        )
        if found.status != 0:
            continue  # three samples of T = 2 do not reach every phase
        heights = found.x
        furthest = max(furthest, -1e-7 * float(found.fun) / LEAST_RATIO)
        level = float(heights[width:].sum())
        scale = min(_FULL / (heights[:width].max() + level), 0.95 * _FULL / max(level, 1e-9))
        counts = np.rint(scale * heights[:width]).astype(np.int64)
        near = draw.integers(-8, 9, (24, width)) * (counts > 8)
        rows.append(np.clip(counts - 8 * (counts > 8) + near, 0, _FULL))
        levels += [math.floor(scale * level)] * len(near)
    pedestal = np.array(levels, np.int64)
    pixels = np.zeros((len(levels), WIDEST), np.int64)
    if rows:
        pixels[:, :width] = np.minimum(np.concatenate(rows) + pedestal[:, None], _FULL)
    found_windows = Windows(
        pixels.astype(np.uint16), np.full(len(levels), width), pedestal << _COUNT_FRACTION
    )
    turns = furthest / (2.0 * np.pi) + angle_bounds(pkg.ANGLE_WIDTH)[0] * 2.0**-pkg.ANGLE_WIDTH
    return found_windows, period * turns + FLOOR_MAX


def _batches(every: int) -> Iterator[Ints]:
    widths = np.arange(NARROWEST, WIDEST + 1, every)
    for start in range(0, len(widths), _BATCH):
        yield widths[start : start + _BATCH]


def batches(every: int) -> int:
    """Return the number of times that ``sweep`` reports its progress."""
    return len(list(_batches(every)))


@dataclass(frozen=True)
class Sweep:
    """Positions of all kinds of windows, of one of the two periods.

    Attributes:
        by_shape: Positions for each of ``SHAPES``.
        extreme: Positions of the worst windows.
        furthest: Largest distance by which any heights at a ratio of a tenth move a position, px.
    """

    by_shape: dict[str, Outcome]
    extreme: Outcome
    furthest: float


def sweep(
    count: int,
    directions: int,
    *,
    period_n: bool,
    every: int = 1,
    progress: Progress | None = None,
) -> Sweep:
    """Return the positions of all kinds of windows.

    Args:
        count: Number of windows for each width, shape and pedestal.
        directions: Number of phases for which the worst windows of each width are looked for.
        period_n: Whether T = N; otherwise T = N - 1.
        every: Step of the width, from 3 to 255 px.
        progress: Called after every few widths.
    """
    draw = np.random.default_rng([SEED, 2, period_n])
    parts: dict[str, list[Outcome]] = {
        shape: [] for shape in SHAPES if not (period_n and shape == CANCELLING)
    }
    extreme: list[Outcome] = []
    furthest = 0.0
    for done, widths in enumerate(_batches(every)):
        width = np.repeat(widths, count * len(PEDESTALS))
        pedestal = np.tile(np.array(PEDESTALS), count * len(widths))
        for shape, outcomes in parts.items():
            group = windows(shape, width, pedestal, period_n=period_n, draw=draw)
            outcomes.append(evaluate(group, period_n=period_n))
        for each in widths.tolist():
            group, far = extremes(each, period_n=period_n, directions=directions, draw=draw)
            extreme.append(evaluate(group, period_n=period_n))
            furthest = max(furthest, far)
        if progress is not None:
            progress(done + 1)
    by_shape = {shape: Outcome.joined(outcomes) for shape, outcomes in parts.items()}
    return Sweep(by_shape, Outcome.joined(extreme), furthest)


def measure(result: Sweep, *, period_n: bool) -> list[Figure]:
    """Return the figures of a ``sweep``.

    Below a ratio of a tenth the limit grows as its inverse; a row of a decade has the limit of the
    decade's lower end, and what each window may is kept in the row of the shares. The rms leaves
    out the windows that were made to be worst, and those that cancel their pedestal: such a spot is
    low and in the middle, where the rounding has little to do.
    """
    group = "position, T = N" if period_n else "position, T = N - 1"
    usual = Outcome.joined([o for shape, o in result.by_shape.items() if shape != CANCELLING])
    every = Outcome.joined([*result.by_shape.values(), result.extreme])

    def maximum(name: str, outcome: Outcome, limit: float, headline: str = "") -> Figure:
        name = f"{name}, maximum of {len(outcome.error)} windows"
        error, bound = largest(outcome.error), largest(outcome.bound)
        return Figure(
            group,
            name,
            _UNIT,
            _MILLI * error,
            _MILLI * bound,
            _MILLI * FLOOR_MAX,
            _MILLI * limit,
            headline=headline,
        )

    good = usual.where(usual.ratio >= LEAST_RATIO)
    name = f"ratio >= {LEAST_RATIO:g}"
    figures = [
        Figure(
            group,
            f"{name}, rms",
            _UNIT,
            _MILLI * rms(good.error),
            _MILLI * rms(good.spread),
            _MILLI * FLOOR_RMS,
            _MILLI * LIMIT_RMS,
            headline=f"{group}, rms",
        ),
        maximum(
            name, every.where(every.ratio >= LEAST_RATIO), LIMIT_MAX, headline=f"{group}, maximum"
        ),
        Figure(
            group,
            f"{name}, worst heights there can be",
            _UNIT,
            _MILLI * result.furthest,
            _MILLI * guarantee(period_n=period_n),
            floor=_MILLI * FLOOR_MAX,
            limit=_MILLI * LIMIT_MAX,
        ),
    ]
    for decade in range(DECADES):
        high, low = LEAST_RATIO * 10.0**-decade, LEAST_RATIO * 10.0 ** -(decade + 1)
        dim = every.where((every.ratio >= low) & (every.ratio < high))
        figures.append(maximum(f"ratio {low:g} to {high:g}", dim, LIMIT_MAX * LEAST_RATIO / low))
    allowed = LIMIT_MAX * np.maximum(1.0, LEAST_RATIO / every.ratio)
    judged = every.ratio >= LEAST_RATIO * 10.0**-DECADES
    share = largest((every.error / allowed)[judged])
    name = "largest share of a window's own"
    figures += [
        Figure(group, f"{name} limit", "1", share, limit=1.0),
        Figure(group, f"{name} bound", "1", largest(every.error / every.bound), predicted=1.0),
    ]
    return figures
