"""A weighted fit of the spot, the twin of ``rtl/peak/peak_fit.sv``.

A height divided by the Gaussian 2**-(u**2) is flat where the spot is that Gaussian; amplitude,
place and width are the constant, the slope and the curvature of a weighted polynomial through these
quotients. A weight is the inverse variance of its quotient: R h**2 + K A h + C**2 A**2, with
h = 2**(u**2), of read noise, shot noise and speckle, which counts more far out. Where the lines
before and a line itself lean to one side by a foot of the spot, the fit ends nearer to its middle.

Lengths along the line are in pixels from the first of SPAN pixels around the second window's
middle, heights are shares of 2**HEIGHT_FRACTION, shifted so that the largest is at least a half.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints, Pixels
from vrscan.fixed.divide import divide
from vrscan.fixed.rom import rom_source
from vrscan.fixed.saturate import saturated
from vrscan.fixed.square_root import square_root

SPAN = 200  # px that are read, half of them on either side of the window's middle
# Speckle and foot are measured in the second pass, and used from the third on.
PASSES, ROUGH_PASS = 4, 1
DEPTH = pkg.SPECKLE_DEPTH  # lines over which speckle and lean are steadied
# Lines before a line that its fit depends on: its lean is that of DEPTH lines, whose fits end by
# the feet of as many lines, each with the speckle of as many.
REACH = 3 * (DEPTH - 1)

HEIGHT_FRACTION = 17  # fraction bits: heights and amplitudes; doubled in their squares
PLACE_FRACTION = 16  # px
STEP_FRACTION = 24  # units of u a px
PLACE_BITS = 15  # fraction bits of u that are multiplied
SQUARE_FRACTION = 17  # of u**2
MOMENT_FRACTION = 14  # of u**2 and of the quotients as they are multiplied, and of all sums
CUT = 8  # u**2 at which the window ends: 3.33 sigma
ENDS = np.array([CUT, 3, 2])  # at which a fit ends: without a foot, with one, with a large one
WING, FAR_WING = 5, 7  # u**2 from which on the speckle's variance counts twice, and four times
TOP = 23 << (SQUARE_FRACTION - 3)  # u**2 below which the speckle is measured: 1.99 sigma
MIDDLE = 2  # u**2 below which the lean is measured: 1.67 sigma
TABLE_BITS = 10
MANTISSA_FRACTION = 16
WEIGHT_FRACTION = 16
RECIPROCAL_BITS = 8
SHARE_FRACTION = 17  # of the variance's three terms over their sum
SPECKLE_FRACTION = SPECKLE_WIDTH = 20  # of the squared contrast
FIRST_SPECKLE = 1 << (SPECKLE_FRACTION - 6)  # squared contrast in the first two passes: 1/64
LEAST_SPECKLE = 1678  # where nothing has been measured: 0.04**2
PRIOR_WEIGHT = 32 * 20 << 12
JUMP = 2  # times the steadied speckle, above which a line has its own instead
LN4 = 11357  # 2 ln 2, 13 fraction bits
SIGMA_TO_SCALE = 9645  # 1 / sqrt(log2(e) / 2), 13 fraction bits
DIFFERENCES = 20  # sum of the squared coefficients of a third difference
MOST_ROUNDS = 1 << 17  # of a pass's step: one unit of u
MOST_STRETCH = 4915  # 0.3, 14 fraction bits
AMPLITUDE_WIDTH = 20
LEAST_AMPLITUDE = 1 << (HEIGHT_FRACTION - 4)
LEAST_SCALE = 1 << (pkg.SCALE_FRACTION - 1)
SLOPE_WIDTH = 23  # of the middle's slope as it is squared
FREE_FRACTION = 30  # of what the lean is divided by
FREE_WIDTH = 38
LEAN_FRACTION = 8
MOST_LEAN = 8 << LEAN_FRACTION  # of a line among others
OWN_LEAN, MOST_OWN = 12 << LEAN_FRACTION, 31 << LEAN_FRACTION  # of one that counts by itself
MORE_LEAN = 8 << LEAN_FRACTION  # added to all leans, of which 5/8 tell a foot
LARGE_FOOT = 4 << LEAN_FRACTION  # mean lean of a large one
FINE_LEAN = 15 << (LEAN_FRACTION - 4)  # that of fine grains is hardly larger
PRIOR_LEAN, PRIOR_FITS = 3 << (LEAN_FRACTION - 1), 2  # before the first line
STEEP = 5  # halves that grains are of what the mean lean has above FINE_LEAN
MOST_GRAINS = 7 << LEAN_FRACTION
COARSE_GRAINS = 2 << LEAN_FRACTION  # from which on it is added to all variance
CHI_LIMIT = 5  # chi squared a degree of freedom, with grains, above which it is no Gaussian
MIXED_TIMES = 3  # that limit, above which it is not one spot
MOST_VARIANCE = (1 << (2 * HEIGHT_FRACTION)) - 1
MOST_GAIN = (1 << 30) - 1
MOST_NOISE = (1 << 32) - 1
QUOTIENT_WIDTH = 26
ROOT_WIDTH = 31
LATENCY = 1802  # clocks from valid_i to valid_o
UNMEASURED_LATENCY = 96


class History(NamedTuple):
    """Sums of the last DEPTH - 1 lines, oldest first, int64 [DEPTH - 1] each."""

    roughness: Ints  # what third differences have more than noise makes
    weight: Ints
    lean: Ints  # of the lines that have a single spot, LEAN_FRACTION fraction bits
    fits: Ints  # their number
    foot: Ints  # lean with its sign in the second pass, LEAN_FRACTION fraction bits
    clear: Ints  # the number of lines that have it

    @classmethod
    def empty(cls) -> "History":
        """Return what is known after a reset."""
        return cls(*np.zeros((6, DEPTH - 1), np.int64))


@dataclass(frozen=True)
class Fitted:
    """Fits of n lines, int64 [n] each.

    Attributes:
        position: Position of the spot, px, 12 fraction bits: the fit's, or the given one.
        sigma: Its standard deviation, px, 12 fraction bits.
        fitted: Whether the fit stands, bool.
        mixed: Whether chi squared with grains is above MIXED_TIMES what that of a fit may be.
        speckle: Squared contrast of the speckle, 20 fraction bits, of this line and those before;
            of no meaning where a line is not measured.
        scale: Width of the spot over sqrt(2 ln 2), px, 12 fraction bits; likewise.
        grains: What grains add to the speckle's part of the variance, a share of it with 8 fraction
            bits.
        own_lean: Whether the line's own lean counts in sigma instead of grains.
        end: Square of u at which the fit ends: less than CUT where a foot is told.
        history: The last lines, for those that follow.
    """

    position: Ints
    sigma: Ints
    fitted: Bools
    mixed: Bools
    speckle: Ints
    scale: Ints
    grains: Ints
    own_lean: Bools
    end: Ints
    history: History


def mantissas() -> Ints:
    """Return 2**f in the middle of each step of f from 0 to 1, MANTISSA_FRACTION fraction bits."""
    middle = (np.arange(1 << TABLE_BITS) + 0.5) / (1 << TABLE_BITS)
    found: Ints = np.floor(np.exp2(middle) * (1 << MANTISSA_FRACTION) + 0.5).astype(np.int64)
    return found


def reciprocals() -> Ints:
    """Return 1 / (1 + f) in the middle of each step of f, WEIGHT_FRACTION fraction bits."""
    middle = (np.arange(1 << RECIPROCAL_BITS) + 0.5) / (1 << RECIPROCAL_BITS)
    found: Ints = np.floor((1 << WEIGHT_FRACTION) / (1.0 + middle) + 0.5).astype(np.int64)
    return found


_MANTISSA, _RECIPROCAL = mantissas(), reciprocals()


def rom() -> str:
    """Return ``rtl/peak/peak_fit_rom.sv``, the two tables."""
    comment = (
        "the mantissa of 2**f and of 1 / (1 + f), f from 0 to 1.",
        "Generated from vrscan.fixed.peak_fit by scripts/generate.py.  An entry is that of the",
        f"middle of its step, with {MANTISSA_FRACTION} fraction bits.  Their only test is that of "
        "peak_fit, their user.",
    )
    memories = {
        "power_mem": (mantissas(), MANTISSA_FRACTION + 1),
        "reciprocal_mem": (reciprocals(), WEIGHT_FRACTION),
    }
    ports = {"power": "power_mem", "reciprocal": "reciprocal_mem"}
    return rom_source("peak_fit_rom", comment, memories, ports)


def bit_length(value: Ints) -> Ints:
    """Return the number of bits of integers from 0 to 2**52."""
    return np.asarray(np.frexp(value.astype(np.float64))[1], np.int64)


@dataclass
class _State:
    """What a pass begins with, int64 [n] each."""

    amplitude: Ints
    place: Ints
    scale: Ints
    step: Ints


class _Sums(NamedTuple):
    """What a pass adds up before a fit's end, int64 [n] each, MOMENT_FRACTION fraction bits."""

    s0: Ints
    s2: Ints
    s4: Ints
    b0: Ints
    b1: Ints
    b2: Ints
    s2_middle: Ints  # of the middle, wherever the fit ends
    b1_middle: Ints
    s2_whole: Ints  # and of the whole window
    b1_whole: Ints
    chi: Ints  # 2 MOMENT_FRACTION fraction bits
    pixels: Ints
    clipped: Ints  # saturated pixels within the window
    rough: Ints  # squared third differences, 22 fraction bits
    noise: Ints  # what noise makes of them, SHARE_FRACTION fraction bits of the variance
    quads: Ints


class _Pass(NamedTuple):
    """Pixels of a pass, [n, SPAN] each."""

    u: Ints
    moment: Ints
    power: Ints  # whole part of u**2
    q: Ints  # quotient less amplitude
    noise: Ints
    clipped: Bools
    inside: Bools
    top: Bools
    y: Ints  # weight
    yq: Ints
    yu2: Ints

    def sums(self, end: Ints) -> _Sums:
        """Return the sums where u**2 is less than ``end``, [n]."""
        u, moment, _, q, noise, clipped, inside, top, y, yq, yu2 = self
        middle = self.power < MIDDLE
        s2_whole, b1_whole = yu2.sum(axis=1), (yq * u).sum(axis=1) >> PLACE_BITS
        if (end != CUT).any():
            inside = inside & (self.power < end[:, None])
            y, yq, yu2 = (np.where(inside, each, 0) for each in (y, yq, yu2))
        d = saturated((q[:, 3:] - 3 * q[:, 2:-1] + 3 * q[:, 1:-2] - q[:, :-3]) >> 3, 18)
        quad = top[:, 3:] & top[:, 2:-1] & top[:, 1:-2] & top[:, :-3]
        own = np.minimum(noise, (1 << 24) - 1)
        four = own[:, 3:] + 9 * (own[:, 2:-1] + own[:, 1:-2]) + own[:, :-3]
        return _Sums(
            s0=y.sum(axis=1) >> (WEIGHT_FRACTION - MOMENT_FRACTION),
            s2=yu2.sum(axis=1),
            s4=(yu2 * moment).sum(axis=1) >> MOMENT_FRACTION,
            b0=yq.sum(axis=1),
            b1=(yq * u).sum(axis=1) >> PLACE_BITS,
            b2=(yq * moment).sum(axis=1) >> MOMENT_FRACTION,
            s2_middle=np.where(middle, yu2, 0).sum(axis=1),
            b1_middle=np.where(middle, yq * u, 0).sum(axis=1) >> PLACE_BITS,
            s2_whole=s2_whole,
            b1_whole=b1_whole,
            chi=(yq * q).sum(axis=1),
            pixels=inside.sum(axis=1),
            clipped=clipped.sum(axis=1),
            rough=np.where(quad, d * d, 0).sum(axis=1),
            noise=np.where(quad, four, 0).sum(axis=1),
            quads=quad.sum(axis=1),
        )


def _pass(
    height: Ints,
    usable: Bools,
    clipped: Bools,
    state: _State,
    alpha: Ints,
    beta: Ints,
    gamma: Ints,
) -> _Pass:
    """Return the pixels of one pass; heights and pixels [n, SPAN], the others [n]."""
    start = (-state.place * state.step) >> PLACE_FRACTION
    u = start[:, None] + np.arange(SPAN) * state.step[:, None]
    u = u >> (STEP_FRACTION - PLACE_BITS)
    near = (u >= -(1 << 17)) & (u < 1 << 17)
    u = np.where(near, u, 0)
    square = (u * u) >> (2 * PLACE_BITS - SQUARE_FRACTION)
    near &= square < CUT << SQUARE_FRACTION
    inside = near & usable
    moment = square >> (SQUARE_FRACTION - MOMENT_FRACTION)
    power = np.where(near, square >> SQUARE_FRACTION, 0)
    mantissa = _MANTISSA[square >> (SQUARE_FRACTION - TABLE_BITS) & ((1 << TABLE_BITS) - 1)]
    shift = MANTISSA_FRACTION + HEIGHT_FRACTION - MOMENT_FRACTION
    quotient = ((mantissa * height) << power) >> shift
    amplitude = state.amplitude >> (HEIGHT_FRACTION - MOMENT_FRACTION)
    q = saturated(quotient - amplitude[:, None], 18)
    h = (mantissa << power) >> (MANTISSA_FRACTION - 10)
    noise = ((((alpha[:, None] * h) >> 10) + beta[:, None]) * h) >> 10
    wings = np.where(power < WING, 0, np.where(power < FAR_WING, 1, 2))
    variance = noise + (gamma[:, None] << wings)
    bits = np.maximum(bit_length(variance) - 1, SHARE_FRACTION)
    index = (variance << RECIPROCAL_BITS >> bits) & ((1 << RECIPROCAL_BITS) - 1)
    index = np.where(variance >> SHARE_FRACTION == 0, 0, index)
    y = np.where(inside, _RECIPROCAL[index] >> (bits - SHARE_FRACTION), 0)
    half = 1 << (WEIGHT_FRACTION - 1)
    yq = (y * q + half) >> WEIGHT_FRACTION
    yu2 = (y * moment + half) >> WEIGHT_FRACTION

    return _Pass(
        u, moment, power, q, noise, near & clipped, inside, inside & (square < TOP), y, yq, yu2
    )


def _signed_divide(dividend: Ints, divisor: Ints, most: Ints | int) -> Ints:
    """Return a quotient with the dividend's sign, limited to ``most``."""
    quotient, _ = divide(np.abs(dividend), divisor, quotient_width=QUOTIENT_WIDTH)
    return np.where(dividend < 0, -1, 1) * np.minimum(quotient, most)


def _stepped(state: _State, sums: _Sums, least: Ints, most: Ints) -> _State:
    """Return what the next pass begins with."""
    slope = (state.amplitude * LN4) >> 13
    divisor = (sums.s2 * slope) >> HEIGHT_FRACTION
    move = _signed_divide(sums.b1 << 17, divisor, MOST_ROUNDS)
    determinant = (sums.s0 * sums.s4 - sums.s2 * sums.s2) >> 16
    excess = (sums.s0 * sums.b2 - sums.s2 * sums.b0) >> 16
    determinant = np.maximum(determinant, 0)
    stretch = _signed_divide(excess << 14, (determinant * slope) >> HEIGHT_FRACTION, MOST_STRETCH)
    rest = sums.b0 - ((((stretch * slope) >> 14) * sums.s2) >> HEIGHT_FRACTION)
    rise = _signed_divide(rest << HEIGHT_FRACTION, sums.s0, state.amplitude)
    amplitude = state.amplitude + np.maximum(rise, -(state.amplitude >> 1))
    amplitude = np.clip(amplitude, LEAST_AMPLITUDE, (1 << AMPLITUDE_WIDTH) - 1)
    place = state.place + ((move * state.scale) >> (17 + pkg.SCALE_FRACTION - PLACE_FRACTION))
    place = np.clip(place, 0, (SPAN << PLACE_FRACTION) - 1)
    scale = np.clip(state.scale + ((state.scale * stretch) >> 14), least, most)
    return _State(amplitude, place, scale, _step(scale))


def _step(scale: Ints) -> Ints:
    """Return units of u a px."""
    one = np.int64(1 << (STEP_FRACTION + pkg.SCALE_FRACTION))
    return divide(one, scale, quotient_width=QUOTIENT_WIDTH)[0]


class _Variance(NamedTuple):
    """The variance of a height at the top and its terms, 2 HEIGHT_FRACTION fraction bits, [n]."""

    dark: Ints
    shot: Ints
    speckle: Ints
    total: Ints

    @property
    def correlated(self) -> Ints:
        """Return the sum with what neighbours share."""
        return np.minimum(self.total + (self.speckle >> 2), MOST_VARIANCE)


def _variance(dark: Ints, shot: Ints, speckle: Ints, amplitude: Ints) -> _Variance:
    own = ((amplitude * amplitude >> 6) * speckle) >> (SPECKLE_FRACTION - 6)
    total = np.clip(dark + shot + own, 1, MOST_VARIANCE)
    return _Variance(dark, shot, own, total)


def _shares(variance: _Variance) -> tuple[Ints, Ints, Ints]:
    """Return each term over the sum, SHARE_FRACTION fraction bits."""
    one = 1 << SHARE_FRACTION
    alpha, beta = (
        np.minimum(
            divide(term << SHARE_FRACTION, variance.total, quotient_width=QUOTIENT_WIDTH)[0], one
        )
        for term in (variance.dark, variance.shot)
    )
    return alpha, beta, np.maximum(one - alpha - beta, 0)


def _running(before: Ints, lines: Ints) -> tuple[Ints, Ints]:
    """Return the sum of each line and the DEPTH - 1 before it, and the last lines."""
    joined = np.append(before, lines)
    # without lines np.convolve has two results
    sums = np.convolve(joined, np.ones(DEPTH, np.int64), "valid")[: len(lines)]
    return sums, joined[len(lines) :]


def _steadied(
    sums: _Sums, variance: _Variance, amplitude: Ints, measured: Bools, history: History
) -> tuple[Ints, History]:
    """Return the squared contrast of each line with those before it, and the last lines.

    A line whose own jumps above it has its own.
    """
    made = (variance.total * (np.minimum(sums.noise, MOST_NOISE) >> 4)) >> (SHARE_FRACTION - 4)
    excess = (sums.rough << (2 * HEIGHT_FRACTION - 22)) - made
    noise = variance.dark + variance.shot
    lift = np.clip(2 * HEIGHT_FRACTION - bit_length(noise), 0, 16)
    area = np.minimum(amplitude * amplitude >> (2 * HEIGHT_FRACTION - 12), (1 << 13) - 1)
    weight = (DIFFERENCES * sums.quads * area) << lift
    most = (weight >> 2) + (weight >> 3)  # 3/8
    roughness = (excess >> (2 * HEIGHT_FRACTION - 20)) << lift
    roughness = np.clip(roughness, -most << 8, most << 8)
    roughness, weight = (np.where(measured, value, 0) for value in (roughness, weight))
    (sums_of, rough), (weights, heavy) = (
        _running(*each) for each in zip(history[:2], (roughness, weight), strict=True)
    )
    prior = PRIOR_WEIGHT * LEAST_SPECKLE >> 12  # 20 fraction bits
    dividend = np.maximum(sums_of + prior, 0) << 4
    speckle, _ = divide(dividend, (weights + PRIOR_WEIGHT) >> 8, quotient_width=QUOTIENT_WIDTH)
    own, _ = divide(np.maximum(roughness, 0) << 4, weight >> 8, quotient_width=QUOTIENT_WIDTH)
    uneven = sums.rough > made >> (2 * HEIGHT_FRACTION - 22 - 2)  # four times
    jump = uneven & (own >> SPECKLE_WIDTH == 0) & (own > JUMP * speckle)
    speckle = np.where(jump, own, speckle)
    return speckle, history._replace(roughness=rough, weight=heavy)


def _lean(slope: Ints, free: Ints, variance: Ints) -> Ints:
    """Return a slope's square over its variance, LEAN_FRACTION fraction bits."""
    shift = 2 * HEIGHT_FRACTION + MOMENT_FRACTION - FREE_FRACTION
    divisor = np.minimum(variance * free >> shift, (1 << FREE_WIDTH) - 1)
    slope = saturated(slope, SLOPE_WIDTH)
    dividend = slope * slope << (FREE_FRACTION + LEAN_FRACTION - 2 * MOMENT_FRACTION)
    return np.minimum(divide(dividend, divisor, quotient_width=QUOTIENT_WIDTH)[0], MOST_OWN)


def _ends(sums: _Sums, variance: Ints, clear: Ints, history: History) -> tuple[Ints, Ints, History]:
    """Return each fit's end by the lines before, and with its own lean, and the last lines."""
    dividends = sums.s2_middle * sums.s2_middle, sums.s2_middle * np.abs(sums.b1_whole)
    both, share = (divide(d, sums.s2_whole, quotient_width=QUOTIENT_WIDTH)[0] for d in dividends)
    slope = sums.b1_middle - np.where(sums.b1_whole < 0, -share, share)
    lean = np.minimum(_lean(slope, np.abs(sums.s2_middle - both), variance), MOST_LEAN) * clear
    foot = np.where(slope < 0, -lean, lean)
    turned, feet = _running(history.foot, foot)
    leant, _ = _running(np.abs(history.foot), lean)
    count, lines = _running(history.clear, clear)
    history = history._replace(foot=feet, clear=lines)

    def end(turned: Ints, leant: Ints, count: Ints) -> Ints:
        turned = np.abs(turned)
        large = np.where(turned >= LARGE_FOOT * count, 2, 1)
        return np.asarray(ENDS[np.where(8 * turned >= 5 * (leant + MORE_LEAN), large, 0)])

    before = end(turned - foot, leant - lean, count - clear)
    return before, np.where(clear, end(turned, leant, count), CUT), history


def _grains(
    sums: _Sums, foot: Bools, variance: Ints, single: Bools, history: History
) -> tuple[Ints, Ints, History]:
    """Return what grains add to each line's speckle, its own lean, and the last lines."""
    other = np.where(foot, sums.s2_whole, sums.s2_middle)
    both, _ = divide(other * other, sums.s2, quotient_width=QUOTIENT_WIDTH)
    slope = np.where(foot, sums.b1_whole, sums.b1_middle)
    own = _lean(slope, np.abs(other - both), variance)
    lean, leans = _running(history.lean, np.where(single, np.minimum(own, MOST_LEAN), 0))
    count, fits = _running(history.fits, single.astype(np.int64))
    dividend = (lean + PRIOR_FITS * PRIOR_LEAN) << 2
    # 5/2 of the mean, of which the quotient is four times.
    four, _ = divide(dividend, count + PRIOR_FITS, quotient_width=QUOTIENT_WIDTH)
    grains = (four >> 1) + (four >> 3) - (STEEP * FINE_LEAN >> 1)
    return np.clip(grains, 0, MOST_GRAINS), own, history._replace(lean=leans, fits=fits)


def peak_fit(
    lines: Pixels,
    *,
    measured: Bools,
    left: Ints,
    width: Ints,
    slope: Ints,
    position: Ints,
    spread: Ints,
    sigma: Ints,
    maximum: Ints,
    background: Ints,
    noise: Ints,
    pixel_width: int,
    kappa: int,
    saturation_level: int,
    history: History,
) -> Fitted:
    """Fit a Gaussian to the spot of every line.

    Args:
        lines: Pixels, [n, line_length].
        measured: Which lines have a position, bool [n].
        left: First pixel of the second window, [n].
        width: Number of its pixels, [n].
        slope: Slope of the background beside it, aligned counts a px, 12 fraction bits, [n].
        position: Position that the second window gives, px, 12 fraction bits, [n].
        spread: Its standard deviation by noise, px, 12 fraction bits, [n].
        sigma: Sigma of the spot from the first window, px, 9 fraction bits, [n].
        maximum: Largest pixel, counts, [n].
        background: Level of the background, counts, 24 - PixelWidth fraction bits, [n].
        noise: Noise of the background in the same format, [n].
        pixel_width: ``PixelWidth`` of the module.
        kappa: Counts per electron, 28 - PixelWidth fraction bits.
        saturation_level: Pixel from which on its light is not known.
        history: The lines before; ``History.empty()`` after a reset.

    Returns:
        The fits.
    """
    count, length = lines.shape
    first = left + (width >> 1) - SPAN // 2
    place = first[:, None] + np.arange(SPAN)
    on_line = (place >= 0) & (place < length)
    pixel = lines[np.arange(count)[:, None], np.clip(place, 0, length - 1)].astype(np.int64)
    clipped = on_line & (pixel >= saturation_level)
    full = maximum << (pkg.COUNT_WIDTH - pixel_width)
    lift = np.clip(pkg.COUNT_WIDTH - bit_length(np.maximum(full - background, 1)), 0, 23)
    ramp = slope * -(SPAN // 2) + np.where(width & 1, 0, slope >> 1)
    level = (ramp[:, None] + np.arange(SPAN) * slope[:, None]) >> (pkg.RAMP_FRACTION - 8)
    height = (pixel << (pkg.COUNT_WIDTH - pixel_width)) - background[:, None] - level
    height = saturated((saturated(height, 27) << lift[:, None]) >> 7, 18)
    floor = (pkg.NOISE_FLOOR << (pkg.COUNT_WIDTH - pixel_width)) >> 4
    deviation = np.minimum((np.maximum(noise, floor) << lift) >> 7, (1 << 17) - 1)
    dark = deviation * deviation
    gain = np.minimum(np.int64(kappa) << lift, MOST_GAIN)
    begin = np.clip((sigma * SIGMA_TO_SCALE) >> 10, LEAST_SCALE, (1 << pkg.SCALE_WIDTH) - 1)
    least = np.maximum(begin >> 1, LEAST_SCALE)
    most = np.minimum(begin << 1, (1 << pkg.SCALE_WIDTH) - 1)
    begun = position - (first << pkg.POSITION_FRACTION)
    begun = begun << (PLACE_FRACTION - pkg.POSITION_FRACTION)
    amplitude = np.full(count, 3 << (HEIGHT_FRACTION - 2), np.int64)
    started = np.clip(begun, 0, (SPAN << PLACE_FRACTION) - 1)
    state = _State(amplitude, started, begin, _step(begin))
    usable = on_line & ~clipped
    speckle, end = np.full((2, count), [[FIRST_SPECKLE], [CUT]], np.int64)
    variance = _variance(dark, gain * state.amplitude >> 11, speckle, state.amplitude)
    shares = _shares(variance)
    for number in range(PASSES):
        seen = _pass(height, usable, clipped, state, *shares)
        sums = seen.sums(end)
        if number == ROUGH_PASS:
            speckle, history = _steadied(sums, variance, state.amplitude, measured, history)
            rough = _variance(dark, variance.shot, speckle, state.amplitude).correlated
            clear = (measured & (sums.clipped == 0)).astype(np.int64)
            end, last_end, history = _ends(sums, rough, clear, history)
            sums = seen.sums(end)
        before = state
        state = _stepped(state, sums, least, most)
        end = last_end if number == ROUGH_PASS else end
        if ROUGH_PASS <= number < PASSES - 1:
            variance = _variance(dark, gain * state.amplitude >> 11, speckle, state.amplitude)
            shares = _shares(variance)

    freedom = CHI_LIMIT * np.maximum(sums.pixels - 3, 0)
    found = (first << pkg.POSITION_FRACTION) + (
        (state.place + (1 << (PLACE_FRACTION - pkg.POSITION_FRACTION - 1)))
        >> (PLACE_FRACTION - pkg.POSITION_FRACTION)
    )
    far = np.abs(state.place - started) > (5 * begin << (PLACE_FRACTION - pkg.SCALE_FRACTION)) >> 3
    eligible = measured & ~far & (sums.pixels >= 4) & (begun == started)
    eligible &= (found >= 0) & (found < length << pkg.POSITION_FRACTION)
    eligible &= sums.clipped << 3 <= sums.pixels + sums.clipped
    margin = state.scale << 1  # a spot closer to the line's end leans because it is cut
    inner = (found >= margin) & (found < (length << pkg.POSITION_FRACTION) - margin)
    shift = 2 * (HEIGHT_FRACTION - MOMENT_FRACTION)
    limit = variance.total * freedom >> shift
    plain, close = sums.chi <= limit, sums.chi <= limit + (limit >> 1)
    single = eligible & inner & (sums.chi <= MIXED_TIMES * limit)
    total, foot = variance.correlated, end < CUT
    grains, lean, history = _grains(sums, foot, total, single, history)

    def grown(grains: Ints) -> Ints:
        grained = np.where(grains >= COARSE_GRAINS, variance.total, variance.speckle)
        return np.minimum(total + (grained * (5 * grains) >> 10), MOST_VARIANCE)  # 5/4 times

    limit = grown(grains) * freedom >> shift
    fitted = eligible & close & (sums.chi <= limit) & (plain | inner & (sums.clipped == 0))
    mixed = measured & (sums.clipped == 0) & (sums.chi > MIXED_TIMES * limit)
    own_lean = foot | (lean > np.maximum(grains, OWN_LEAN))
    total = grown(np.where(own_lean, lean, grains))
    root = square_root(total * sums.s2, root_width=ROOT_WIDTH)
    divisor = (sums.s2 * ((before.amplitude * LN4) >> 13)) >> HEIGHT_FRACTION
    # Scale and root have 36 fraction bits, the divisor 14 and sigma 12.
    root = (state.scale * root) >> 10
    own, _ = divide(root, divisor, quotient_width=QUOTIENT_WIDTH)
    own = np.minimum(np.where(fitted, own, own << 1), (1 << pkg.SIGMA_WIDTH) - 1)
    own = np.where(fitted, own, np.where(measured, np.maximum(own, spread), spread))
    return Fitted(
        position=np.where(fitted, found, position),
        sigma=own,
        fitted=fitted,
        mixed=mixed,
        speckle=speckle,
        scale=state.scale,
        grains=grains,
        own_lean=own_lean,
        end=end,
        history=history,
    )
