"""A weighted fit of a Gaussian to the spot, which speckle does not mislead.

A spot A 2**-(u**2), u = (x - mu) / w, w = sigma sqrt(2 ln 2), multiplied by h = 2**(u**2) is A in
every pixel. Where A, mu and w are a little off, the quotient q = h p - A of a pixel p is

    q = dA + A ln 4 (u dmu / w + u**2 dw / w)

to first order: constant, slope and curvature are the corrections. Least squares with the inverse
variances of q as weights, repeated from the corrected values, are Fisher's scoring; they attain
the Cramer-Rao bound. The variance of p is R + K p + C**2 p**2, with R of read noise and background,
K counts per electron, and the contrast C of speckle, which multiplies the light (Dorsch, Haeusler,
Herrmann, Laser triangulation: fundamental uncertainty in distance measurement, 1994). With A / h
for p, that of q is R h**2 + K A h + C**2 A**2: under speckle alone the flanks weigh as much as the
top. Far out no spot is a Gaussian: it has more light, less slope and more contrast, so C**2 counts
twice from WING and four times from FAR_WING on. The weights being even, the slope is taken without
constant and curvature.

Third differences of q cancel its polynomial, and of independent noise they have 1 + 9 + 9 + 1 times
the variance. What they have more than read and shot noise make is 20 C**2 A**2, averaged over DEPTH
lines and a prior; a line's weight goes with its noise, rounded to a power of two. Where the surface
becomes rough that mean needs DEPTH lines to follow, so a line whose own speckle jumps above it has
its own: where squared differences are more than UNEVEN times what noise makes, and the line's own
speckle is more than JUMP times the mean. That neighbours share speckle counts only in the standard
deviation of the result.

Out of focus a grain may be as long as the spot, and third differences do not see it. It moves the
middle of the spot against the whole, though. The slope of all pixels is 0 where the fit has
settled; that of those in the middle has the variance T (S - S**2 / W), with S and W the weighted
sums of u**2 over the middle and over all, and T that of a pixel at the top, if the pixels are
independent. Its square over that, the lean, is 0.8 to 1.1 in focus and 1.2 to 5 out of it. Its
mean over the fits of DEPTH lines and a prior is known to a quarter. The squared error follows it
from scene to scene: what it is above that of fine grains makes the speckle's part of the variance
up to ten times as large, and coarse grains, which differences hardly see, all of it. A line's own
lean counts where it is far larger.

Grains turn the middle to either side. Light from beneath the surface, a halo or an edge leaves a
foot on one side of the spot, which turns it to the same on line after line, and pulls the fit,
which weighs the foot as much as the top. The slope in the second pass, without that of the whole,
has the variance of the lean. Where its squares over that, with their signs, add up over DEPTH lines
to most of their sum, a fit ends at the spot's shoulders, and where they are large, at its middle.
The whole's slope is its lean then, and as much as the foot would move that fit, it is doubted.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.ideal.peak import LEAST_NOISE

SPAN = 200  # px that are read, half of them on either side of the window's middle
# Speckle and foot are measured in the second pass, and used from the third on.
PASSES, ROUGH_PASS = 4, 1
DEPTH = 32  # lines over which the speckle is steadied
SCALE = float(np.sqrt(2.0 * np.log(2.0)))  # w over sigma
LN4 = float(np.log(4.0))

CUT = 8.0  # u**2 at which the window ends
WING, FAR_WING = 5.0, 7.0  # u**2 from which on the speckle's variance counts 2 and 4 times
TOP = 23 / 8  # u**2 below which the speckle is measured
MIDDLE = 2.0  # u**2 below which the lean is measured
ENDS = np.array(
    [CUT, 3.0, MIDDLE]
)  # u**2 at which a fit ends: without a foot, with one, a large one
LARGEST_QUOTIENT = 8.0
FIRST_HEIGHT = 0.75  # heights are shares of the power of two above the largest
LEAST_HEIGHT, LARGEST_HEIGHT = 1 / 16, 8.0
LEAST_SCALE, LARGEST_SCALE = 0.5, 64.0  # px
MOST_MOVE, MOST_STRETCH, MOST_RISE = 1.0, 0.3, 1.0  # of a pass: widths, widths, heights

FIRST_SPECKLE = 1 / 64  # squared contrast in the first two passes
PRIOR_SPECKLE, PRIOR_DIFFERENCES = 0.0016, 32.0
MOST_SPECKLE = 3 / 8
UNEVEN, JUMP = 4.0, 2.0
MOST_LEAN = 8.0  # of a line among others
OWN_LEAN, MOST_OWN = 12.0, 31.0  # of a line from which on it counts by itself, and up to which
FOOT_SHARE, MORE_LEAN = 5 / 8, 8.0  # of the sum of all leans and so much, what tells a foot
LARGE_FOOT = 4.0  # mean lean of a large one
FINE_LEAN = 15 / 16  # that of fine grains is hardly larger
PRIOR_LEAN, PRIOR_FITS = 3 / 2, 2.0  # before the first line
# What grains add, as a share of the speckle's variance: STEEP times the mean lean above FINE_LEAN.
# Coarse grains hide speckle from differences, and add it as a share of all variance.
STEEP = 5 / 2
MOST_GRAINS, COARSE_GRAINS = 7.0, 2.0
DIFFERENCES = 20.0  # sum of the squared coefficients of a third difference
LARGEST_AREA = 2.0  # A**2 in a line's weight
LARGEST_LIFT = 16  # a line's weight is at most 2**16
NEIGHBOURS = 1 / 4  # what the correlation of neighbours adds to the speckle's variance

FAR = 5 / 8  # first widths w between the fit and the given position
CHI_LIMIT = 5.0  # chi squared a degree of freedom, with grains, above which it is no Gaussian
PLAIN_LIMIT = 3 * CHI_LIMIT / 2  # the same without grains
MIXED_LIMIT = 3 * CHI_LIMIT  # the same above which it is not one spot
INNER = 2.0  # widths w from the line's end: a spot closer to it leans because it is cut
FEWEST = 4  # pixels
MOST_CLIPPED = 1 / 8  # share of the window's pixels at full scale
_TINY = 1e-30  # instead of no variance and no weight


class History(NamedTuple):
    """Sums of the last DEPTH - 1 lines, oldest first, [DEPTH - 1] each."""

    roughness: Floats  # what squared third differences have more than noise makes, weighted
    weight: Floats
    lean: Floats  # of the lines that have a single spot
    fits: Floats  # their number
    foot: Floats  # lean with its sign in the second pass
    clear: Floats  # the number of lines that have it

    @classmethod
    def empty(cls) -> "History":
        """Return what is known before the first line."""
        return cls(*np.zeros((6, DEPTH - 1)))


@dataclass(frozen=True)
class Fitted:
    """Fits of n lines, [n] each."""

    position: Floats  # px: the fit's, or the given one where it does not stand
    sigma: Floats  # its standard deviation, px
    fitted: Bools  # whether the fit stands
    mixed: Bools  # whether the light is not that of one spot
    speckle: Floats  # squared contrast, of this line and those before
    scale: Floats  # w, px
    grains: Floats  # what they add to the speckle's part of the variance, a share of it
    own_lean: Bools  # whether the line's own lean counts in sigma instead of them
    end: Floats  # u**2 at which the fit ends: less than CUT where a foot is told
    history: History  # for the lines that follow


class _State(NamedTuple):
    """What a pass begins with, [n] each."""

    height: Floats  # A
    place: Floats  # px
    scale: Floats  # px


class _Noise(NamedTuple):
    """The terms of a height's variance where u = 0, [n] each."""

    dark: Floats
    shot: Floats
    speckle: Floats

    @property
    def total(self) -> Floats:
        return np.asarray(np.maximum(self.dark + self.shot + self.speckle, _TINY))


class _Pass(NamedTuple):
    """Pixels of a pass, [n, SPAN] each."""

    inside: Bools
    near: Bools  # inside, if it were not for full scale
    square: Floats  # u**2
    weight: Floats  # 1 where u = 0
    quotient: Floats
    noise: Floats  # the quotient's variance without speckle
    u: Floats

    def sum(self, power: int, *, quotient: bool = False) -> Floats:
        """Return the weighted sums of u**power, times the quotient if that is asked for, [n]."""
        terms = self.weight * self.u**power
        return np.asarray((terms * self.quotient if quotient else terms).sum(axis=1))

    def within(self, end: Floats | float) -> "_Pass":
        """Return the pixels with a smaller u**2 alone."""
        near = self.square < np.expand_dims(end, -1)
        weight = np.where(near, self.weight, 0.0)
        return self._replace(inside=self.inside & near, near=self.near & near, weight=weight)


def _pass(height: Floats, pixel: Ints, usable: Bools, state: _State, noise: _Noise) -> _Pass:
    u = (pixel - state.place[:, None]) / state.scale[:, None]
    square = np.square(u)
    near = square < CUT
    inside = near & usable
    h = np.exp2(np.minimum(square, CUT))
    quotient = np.clip(h * height - state.height[:, None], -LARGEST_QUOTIENT, LARGEST_QUOTIENT)
    own = (noise.dark[:, None] * h + noise.shot[:, None]) * h
    wings = np.where(square < WING, 1.0, np.where(square < FAR_WING, 2.0, 4.0))
    variance = own + noise.speckle[:, None] * wings
    weight = np.where(inside, noise.total[:, None] / np.maximum(variance, _TINY), 0.0)
    return _Pass(inside, near, square, weight, quotient, own, u)


def _ratio(dividend: Floats, divisor: Floats, most: Floats | float) -> Floats:
    """Return a quotient limited to ``most`` either way."""
    whole = divisor > 0.0
    ratio = np.where(whole, dividend, np.where(dividend < 0.0, -np.inf, np.inf))
    return np.asarray(np.clip(ratio / np.where(whole, divisor, 1.0), -most, most))


def _stepped(state: _State, seen: _Pass, least: Floats, most: Floats) -> _State:
    """Return what the next pass begins with."""
    slope = state.height * LN4
    s0, s2, s4 = (seen.sum(power) for power in (0, 2, 4))
    b0, b1, b2 = (seen.sum(power, quotient=True) for power in (0, 1, 2))
    move = _ratio(b1, s2 * slope, MOST_MOVE)
    stretch = _ratio(s0 * b2 - s2 * b0, (s0 * s4 - s2 * s2) * slope, MOST_STRETCH)
    rise = _ratio(b0 - stretch * slope * s2, s0, MOST_RISE * state.height)
    height = state.height + np.maximum(rise, -0.5 * state.height)
    return _State(
        height=np.clip(height, LEAST_HEIGHT, LARGEST_HEIGHT),
        place=state.place + move * state.scale,
        scale=np.clip(state.scale * (1.0 + stretch), least, most),
    )


def _running(before: Floats, lines: Floats) -> tuple[Floats, Floats]:
    """Return the sum of each line and the DEPTH - 1 before it, and the last lines."""
    joined = np.append(before, lines)
    # without lines np.convolve has two results
    sums = np.convolve(joined, np.ones(DEPTH), "valid")[: len(lines)]
    return sums, joined[len(lines) :]


def _steadied(
    seen: _Pass, noise: _Noise, height: Floats, measured: Bools, history: History
) -> tuple[Floats, History]:
    """Return the squared contrast of each line with those before it, and the last lines."""
    top = seen.inside & (seen.square < TOP)
    whole = top[:, 3:] & top[:, 2:-1] & top[:, 1:-2] & top[:, :-3]
    squared = np.square(np.diff(seen.quotient, 3, axis=1))
    made = seen.noise[:, 3:] + seen.noise[:, :-3]
    made += 9.0 * (seen.noise[:, 2:-1] + seen.noise[:, 1:-2])
    rough, made = (np.where(whole, each, 0.0).sum(axis=1) for each in (squared, made))
    excess = rough - made
    power = np.clip(-np.frexp(noise.dark + noise.shot)[1], 0, LARGEST_LIFT)
    weight = DIFFERENCES * whole.sum(axis=1) * np.minimum(np.square(height), LARGEST_AREA)
    most = MOST_SPECKLE * weight
    excess = np.clip(excess, -most, most)
    own = np.where(measured & (rough > UNEVEN * made), excess / np.maximum(weight, _TINY), 0.0)
    terms = (np.where(measured, np.ldexp(each, power), 0.0) for each in (excess, weight))
    (roughness, last), (weights, heavy) = (
        _running(*each) for each in zip(history[:2], terms, strict=True)
    )
    prior = PRIOR_DIFFERENCES * DIFFERENCES
    speckle = np.maximum((roughness + prior * PRIOR_SPECKLE) / (weights + prior), 0.0)
    speckle = np.where(own > JUMP * speckle, own, speckle)
    return speckle, history._replace(roughness=last, weight=heavy)


def _ends(
    whole: _Pass, variance: Floats, clear: Bools, history: History
) -> tuple[Floats, Floats, History]:
    """Return where each line's fit ends by the lines before, and with its own, and the last lines.

    Lines that are not clear, with pixels at full scale, say nothing and have no foot of their own.
    """
    middle = whole.within(MIDDLE)
    share = middle.sum(2) / np.maximum(whole.sum(2), _TINY)
    slope = middle.sum(1, quotient=True) - share * whole.sum(1, quotient=True)
    lean = np.square(slope) / np.maximum(variance * middle.sum(2) * (1.0 - share), _TINY)
    foot = np.where(clear, np.copysign(np.minimum(lean, MOST_LEAN), slope), 0.0)
    turned, feet = _running(history.foot, foot)
    leant, _ = _running(np.abs(history.foot), np.abs(foot))
    count, lines = _running(history.clear, clear.astype(np.float64))
    history = history._replace(foot=feet, clear=lines)

    def end(turned: Floats, leant: Floats, count: Floats) -> Floats:
        turned = np.abs(turned)
        large = np.where(turned >= LARGE_FOOT * count, 2, 1)
        return np.asarray(ENDS[np.where(turned >= FOOT_SHARE * (leant + MORE_LEAN), large, 0)])

    before = end(turned - foot, leant - np.abs(foot), count - clear)
    return before, np.where(clear, end(turned, leant, count), CUT), history


def _grains(
    fitted: _Pass, other: _Pass, variance: Floats, single: Bools, history: History
) -> tuple[Floats, Floats, History]:
    """Return what grains add to each line's speckle, its own lean, and the last lines."""
    free = np.abs(other.sum(2) - np.square(other.sum(2)) / np.maximum(fitted.sum(2), _TINY))
    slope = other.sum(1, quotient=True)
    own = np.minimum(np.square(slope) / np.maximum(variance * free, _TINY), MOST_OWN)
    lean, leans = _running(history.lean, np.where(single, np.minimum(own, MOST_LEAN), 0.0))
    count, fits = _running(history.fits, single.astype(np.float64))
    lean = (lean + PRIOR_FITS * PRIOR_LEAN) / (count + PRIOR_FITS)
    grains = np.clip(STEEP * (lean - FINE_LEAN), 0.0, MOST_GRAINS)
    return grains, own, history._replace(lean=leans, fits=fits)


def peak_fit(
    lines: Pixels,
    *,
    measured: Bools,
    left: Ints,
    width: Ints,
    slope: Floats,
    position: Floats,
    spread: Floats,
    sigma: Floats,
    maximum: Ints,
    background: Floats,
    noise: Floats,
    saturation_level: int,
    kappa: float,
    history: History,
) -> Fitted:
    """Fit a Gaussian to the spot of every line.

    The fit does not stand, and the given position stays, where chi squared is too large, with
    grains or without, where the fit went far from it or off the line, or where too many pixels are
    at full scale, whose light is not known. Speckle moves the phase of a window by some twice as
    much as it does the fit.

    Args:
        lines: Counts [n, length].
        measured: Which lines have a position [n].
        left: First pixel of the second window [n].
        width: Number of its pixels [n].
        slope: Slope of the background beside it, counts per px; 0 in the window's middle [n].
        position: Position that the second window gives, px [n].
        spread: Its standard deviation by noise, px [n].
        sigma: Standard deviation of the spot from the first window, px [n].
        maximum: Largest pixel, counts [n].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        saturation_level: Pixel from which on its light is not known.
        kappa: Counts per electron.
        history: The lines before; ``History.empty()`` at the beginning.

    Returns:
        The fits.
    """
    first = left + width // 2 - SPAN // 2
    pixel = first[:, None] + np.arange(SPAN)
    on_line = (pixel >= 0) & (pixel < lines.shape[1])
    counts = np.take_along_axis(lines, np.clip(pixel, 0, lines.shape[1] - 1), axis=1)
    clipped = on_line & (counts >= saturation_level)
    usable = on_line & ~clipped
    unit = np.ldexp(1.0, np.frexp(np.maximum(maximum - background, np.finfo(float).eps))[1])
    middle = left + (width - 1) / 2.0
    level = background[:, None] + slope[:, None] * (pixel - middle[:, None])
    height = np.clip((counts - level) / unit[:, None], -1.0, 1.0)
    dark, gain = np.square(np.maximum(noise, LEAST_NOISE) / unit), kappa / unit

    begin = np.clip(SCALE * sigma, LEAST_SCALE, LARGEST_SCALE)
    least, most = np.maximum(begin / 2, LEAST_SCALE), np.minimum(begin * 2, LARGEST_SCALE)
    state = _State(np.full(len(lines), FIRST_HEIGHT), position, begin)
    speckle, end = np.full((2, len(lines)), [[FIRST_SPECKLE], [CUT]])

    def variances() -> _Noise:
        return _Noise(dark, gain * state.height, speckle * np.square(state.height))

    at = variances()
    for number in range(PASSES):
        if number > ROUGH_PASS:
            at = variances()
        whole, before = _pass(height, pixel, usable, state, at), state
        if number == ROUGH_PASS:
            speckle, history = _steadied(whole, at, state.height, measured, history)
            own = speckle * np.square(state.height)
            variance = at._replace(speckle=own).total + NEIGHBOURS * own
            clear = measured & ~(whole.near & clipped).any(axis=1)
            end, last_end, history = _ends(whole, variance, clear, history)
        seen = whole.within(end)
        state = _stepped(state, seen, least, most)
        end = last_end if number == ROUGH_PASS else end

    count = seen.inside.sum(axis=1)
    chi = (seen.weight * np.square(seen.quotient)).sum(axis=1)
    eligible = measured & (count >= FEWEST) & (np.abs(state.place - position) <= FAR * begin)
    eligible &= (position >= first) & (position < first + SPAN)
    eligible &= (state.place >= 0.0) & (state.place < lines.shape[1])
    lost = (whole.near & clipped).sum(axis=1)
    eligible &= lost <= MOST_CLIPPED * (count + lost)
    margin = INNER * state.scale
    inner = (state.place >= margin) & (state.place < lines.shape[1] - margin)
    free = np.maximum(count - 3, 0)
    told = np.maximum(seen.sum(2), _TINY)
    variance = at.total + NEIGHBOURS * at.speckle
    plain = chi <= CHI_LIMIT * free * at.total
    single = eligible & inner & (chi <= MIXED_LIMIT * free * at.total)
    foot = end < CUT
    other = whole.within(np.where(foot, CUT, MIDDLE))
    grains, lean, history = _grains(seen, other, variance, single, history)

    def grown(grains: Floats) -> Floats:
        grained = np.where(grains >= COARSE_GRAINS, at.total, at.speckle)
        return np.asarray(variance + (1.0 + NEIGHBOURS) * grains * grained)

    limit = CHI_LIMIT * free * grown(grains)
    fitted = eligible & (chi <= limit) & (plain | inner & (lost == 0))
    fitted &= chi <= PLAIN_LIMIT * free * at.total
    mixed = measured & (lost == 0) & (chi > MIXED_LIMIT / CHI_LIMIT * limit)
    own_lean = foot | (lean > np.maximum(grains, OWN_LEAN))
    variance = grown(np.where(own_lean, lean, grains))
    own = np.sqrt(variance / told) / (before.height * LN4) * state.scale
    own = np.where(fitted, own, np.where(measured, np.maximum(2.0 * own, spread), spread))
    return Fitted(
        position=np.where(fitted, state.place, position),
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
