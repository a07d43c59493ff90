"""What the lines before and behind say of a line's spot.

Where an edge cuts off a part of the spot, the centre of what is left lies beside the beam's axis,
by a share of the spot's width: it lacks light and has another width than its neighbours. A line
knows neither, as light and width change with the surface; its neighbours do. Spots of a surface lie
in a row: the second difference of their positions is small against the distance of the neighbours,
which the turn of the mirror sets from line to line. What is dimmer than both and has little of the
brighter one's light is part of a spot, and with more light what is as wide as that one, so that it
is light of that spot and no other surface's. So is what lies out of the row, or beside no spot,
where it is dark, or narrower than those beside it.

The constants are those of the shipped scenes' edges: the errors of spots alone, over sigma with its
doubt, have an rms of 0.8 to 1 whatever light they lack. That of a spot that is known to be cut is
larger; most that lack light are whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints

WIDTH_SHARE = 1 / 16  # of the squared difference of two widths beyond its noise
PIXEL_NOISE = 1 / 64  # of a width, px squared: its pixels lie elsewhere
TURN = 1 / 256  # of the distance of two positions by which their widths may differ
LIGHT_SHARE = 3 / 16  # of a width, for all the light
TYPICAL = 1 / 4  # share of the doubt that most spots with it deserve
STEADY = 1 / 4  # share of light that a spot in the row may lack
DIMMER = 1 / 2  # of each neighbour's light
# Of the brighter neighbour's light: of one about as wide as that neighbour or dimmer than both; of
# one that is dimmer than both and as wide; of one beside a single neighbour; of one astray.
FAINT, DIM, SINGLE, DARK = 1 / 4, 7 / 16, 5 / 16, 1 / 8
# Of one astray that is narrower than both; of one a little narrower, and far narrower than one of
# them; of one that is much narrower than each there is.
BRIGHT, FAIR, BRIGHTER = 11 / 16, 15 / 16, 9 / 8
OTHER, FAR_OTHER = 9 / 8, 3 / 2  # ratio of two widths that are not alike, and of two far from it
THIN, WIDE = 17 / 16, 5 / 3  # the same of both widths and the spot's, and of one of them
LEAST = 7 / 4  # the same of each width and that of a spot astray that is none with any light
ROW = 4.0  # widths from the middle of the neighbours, doubled, beyond which a spot is out of it
STRAY = 1 / 4  # the same of a spot astray, over the distance of its neighbours


@dataclass(frozen=True)
class Beside:
    """What n lines' neighbours say, [n] each."""

    sigma: Floats  # standard deviation of the position with the doubt in it, px
    typical: Floats  # that of most such positions, px
    doubt: Floats  # what the neighbours add to sigma, px
    mixed: Bools  # whether the spot is not one spot on one surface


def peak_neighbours(
    *,
    measured: Bools,
    position: Floats,
    sigma: Floats,
    scale: Floats,
    light: Floats,
    power: Ints,
    breaks: Sequence[int] = (),
) -> Beside:
    """Compare each line's spot with those of the lines before and behind it.

    Args:
        measured: Which lines have a position [n].
        position: Positions, px [n].
        sigma: Their standard deviations, px [n].
        scale: Half widths of the spots at half of their heights, px [n].
        light: Sums of the heights, counts [n].
        power: Laser powers [n].
        breaks: Lines that came so late that those before them are no neighbours.
    """
    count = len(measured)
    per_power = np.divide(light, power, out=np.full(count, np.inf), where=power > 0)
    place = np.arange(count)
    stretch = np.searchsorted(np.sort(np.asarray(breaks, np.int64)), place, side="right")
    beside = []
    for other in (place - 1, place + 1):
        inside = (other >= 0) & (other < count)
        other = np.where(inside, other, 0)
        inside &= stretch[other] == stretch
        beside.append((inside & measured[other] if count else inside, other))
    light_before, light_behind = (np.where(there, per_power[other], 0.0) for there, other in beside)
    brightest = np.maximum(light_before, light_behind)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(brightest > 0.0, per_power / brightest, np.inf)
    share = np.where(np.isnan(share), 1.0, share)  # without power, all light is alike
    excess, none = np.zeros(count), np.zeros(count, np.bool_)
    dimmer, narrower, thinner, slender, least = np.ones((5, count), np.bool_)
    wider = np.zeros(count, np.bool_)
    alike, akin = [], []
    for there, other in beside:
        noise = 2.0 * (np.square(sigma) + np.square(sigma[other]) + PIXEL_NOISE)
        distance = np.abs(position - position[other])
        differ = np.maximum(np.abs(scale - scale[other]) - TURN * distance, 0.0)
        over = np.square(differ) - noise
        excess = np.maximum(excess, np.where(there, over, 0.0))
        below, above = OTHER * scale < scale[other], scale > OTHER * scale[other]
        far_below, far_above = FAR_OTHER * scale < scale[other], scale > FAR_OTHER * scale[other]
        alike.append(~(below | above))
        akin.append(~(far_below | far_above))
        narrower &= there & below
        thinner &= there & (THIN * scale < scale[other])
        wider |= WIDE * scale < scale[other]
        slender &= ~there | far_below
        least &= ~there | (LEAST * scale < scale[other])
        dimmer &= ~there | (per_power < DIMMER * per_power[other])
        none |= ~there
    (was, before), (comes, behind) = beside
    least &= was | comes
    bend = np.abs(position[before] + position[behind] - 2.0 * position)
    out = bend > ROW * scale
    alone = none | out
    astray = none | out & (bend > STRAY * np.abs(position[before] - position[behind]))
    brighter = light_before > light_behind
    mixed = (share < FAINT) & (dimmer | np.where(brighter, *akin))
    mixed |= (share < DIM) & dimmer & np.where(brighter, *alike)
    rest = least | narrower & (share < BRIGHT) | slender & (share < BRIGHTER)
    rest |= thinner & wider & (share < FAIR)
    mixed |= astray & (rest | (share < DARK)) | none & (share < SINGLE)
    missing = np.maximum(np.where(alone, 1.0, 1.0 - STEADY) - share, 0.0)
    doubt = np.sqrt(WIDTH_SHARE * excess + np.square(LIGHT_SHARE * missing * scale))
    doubt = np.where(measured, doubt, 0.0)
    return Beside(
        sigma=np.hypot(sigma, doubt),
        typical=np.hypot(sigma, TYPICAL * doubt),
        doubt=doubt,
        mixed=measured & mixed,
    )
