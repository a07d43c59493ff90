"""What the lines beside it say of a spot, the twin of ``rtl/peak/peak_neighbours.sv``.

A spot of which an edge cuts off a part has less light and another width than those beside it. Both
put its place in doubt, by a share of its width. A spot that is much dimmer than both, or dim and as
wide as the brighter one, or astray and dark or narrower, is not one spot on one surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints
from vrscan.fixed.divide import divide
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.square_root import latency as root_latency
from vrscan.fixed.square_root import square_root

LIGHT_FRACTION = 8  # of aligned counts over the laser's power
SHARE_FRACTION = 14  # of a spot's light over its brighter neighbour's
WHOLE = 1 << SHARE_FRACTION
# Lights of a spot that is not one spot on one surface: of one about as wide as the brighter
# neighbour or dimmer than both; of one that is dimmer and as wide; of one beside a single one; of
# one astray.
FAINT, DIM, SINGLE, DARK = WHOLE >> 2, 7 * WHOLE >> 4, 5 * WHOLE >> 4, WHOLE >> 3
# Of one astray that is narrower than both; of one a little narrower, and far narrower than one of
# them; of one much narrower than each there is. Below 4/7 of each it is none with any light.
BRIGHT, FAIR, BRIGHTER = 11 * WHOLE >> 4, 15 * WHOLE >> 4, WHOLE + (WHOLE >> 3)
PIXEL_NOISE = 1 << 18  # of a width, px squared, 24 fraction bits: its pixels lie elsewhere
TURN = 8  # a width may differ by the distance of the positions, shifted by this
ROW = 4  # widths from the middle of the neighbours, doubled, beyond which a spot is out of the row
STEADY = WHOLE - (WHOLE >> 2)  # light that a spot in a row with its neighbours may lack
QUOTIENT_WIDTH, ROOT_WIDTH, FACTOR_WIDTH = 32, 18, 18
MOST_DIFFERENCE = (1 << (FACTOR_WIDTH - 1)) - 1  # of two widths
PRODUCTS = 7  # one after the other
LATENCY = (  # clocks from valid_i to valid_o
    2 * (divide_latency(QUOTIENT_WIDTH) + 1)
    + PRODUCTS * (multiply_latency(FACTOR_WIDTH, FACTOR_WIDTH) + 1)
    + 3 * (root_latency(ROOT_WIDTH) + 1)
    + 5
)


@dataclass(frozen=True)
class Beside:
    """What n lines' neighbours say, [n] each.

    Attributes:
        sigma: Standard deviation of the position, px, 12 fraction bits, the doubt in it.
        typical: That of most such positions, with a quarter of the doubt.
        doubt: What the neighbours add to ``sigma``, px, 12 fraction bits.
        mixed: Whether the spot is not one spot on one surface, bool.
    """

    sigma: Ints
    typical: Ints
    doubt: Ints
    mixed: Bools


def _shifted(values: Ints, by: int) -> Ints:
    """Return the values of the lines before (1) or behind (-1); 0 beyond the ends."""
    moved = np.zeros_like(values)
    if by > 0:
        moved[1:] = values[:-1]
    else:
        moved[:-1] = values[1:]
    return moved


def peak_neighbours(
    *,
    measured: Bools,
    position: Ints,
    sigma: Ints,
    scale: Ints,
    light: Ints,
    power: Ints,
    breaks: Sequence[int] = (),
) -> Beside:
    """Compare each line's spot with those of the lines before and behind it.

    Args:
        measured: Which lines have a position, bool [n].
        position: Positions, px, 12 fraction bits, [n].
        sigma: Their standard deviations, px, 12 fraction bits, [n].
        scale: Widths of the spots, half of that at half of the height, px, 12 fraction bits, [n].
        light: Sums of the heights, aligned counts, [n].
        power: Laser powers, u16, [n].
        breaks: Lines that came so late that those before them are no neighbours.
    """
    per_power, _ = divide(light << LIGHT_FRACTION, power, quotient_width=QUOTIENT_WIDTH)
    spot = {"position": position, "sigma": sigma, "scale": scale, "light": per_power}
    beside = []
    for by in (1, -1):
        there = _shifted(measured.astype(np.int64), by) > 0
        for each in breaks:
            there[each if by > 0 else each - 1] = False
        beside.append((there, {name: _shifted(value, by) for name, value in spot.items()}))
    before, behind = (np.where(there, other["light"], 0) for there, other in beside)
    brightest = np.maximum(before, behind)
    share, _ = divide(per_power << SHARE_FRACTION, brightest, quotient_width=QUOTIENT_WIDTH)

    excess = np.zeros(len(measured), np.int64)
    none = np.zeros(len(measured), np.bool_)
    dimmer, narrower, thinner, slender, least = np.ones((5, len(measured)), np.bool_)
    wider = np.zeros(len(measured), np.bool_)
    alike, akin = [], []
    for there, other in beside:
        distance = np.abs(position - other["position"])
        difference = np.abs(scale - other["scale"]) - (distance >> TURN)
        difference = np.clip(difference, 0, MOST_DIFFERENCE)
        noise = 2 * (sigma * sigma + other["sigma"] * other["sigma"] + PIXEL_NOISE)
        excess = np.maximum(excess, np.where(there, difference * difference - noise, 0))
        below, above = 9 * scale < 8 * other["scale"], 8 * scale > 9 * other["scale"]
        far_below, far_above = 3 * scale < 2 * other["scale"], 2 * scale > 3 * other["scale"]
        alike.append(~(below | above))
        akin.append(~(far_below | far_above))
        narrower &= there & below
        thinner &= there & (17 * scale < 16 * other["scale"])
        wider |= 5 * scale < 3 * other["scale"]
        slender &= ~there | far_below
        least &= ~there | (7 * scale < 4 * other["scale"])
        dimmer &= ~there | (2 * per_power < other["light"])
        none |= ~there
    (was, first), (comes, last) = beside
    least &= was | comes
    bend = np.abs(first["position"] + last["position"] - 2 * position)
    out = bend > ROW * scale
    alone = none | out
    astray = none | out & (4 * bend > np.abs(first["position"] - last["position"]))
    brighter = before > behind
    mixed = (share < FAINT) & (dimmer | np.where(brighter, *akin))
    mixed |= (share < DIM) & dimmer & np.where(brighter, *alike)
    rest = least | narrower & (share < BRIGHT) | slender & (share < BRIGHTER)
    rest |= thinner & wider & (share < FAIR)
    mixed |= astray & (rest | (share < DARK)) | none & (share < SINGLE)
    missing = np.maximum(np.where(alone, WHOLE, STEADY) - share, 0)
    cut = (3 * missing * (scale >> 1)) >> (SHARE_FRACTION + 3)
    doubt = (excess >> 4) + cut * cut
    most = (1 << pkg.SIGMA_WIDTH) - 1
    own = sigma * sigma
    whole, typical, added = (
        np.minimum(square_root(value, root_width=ROOT_WIDTH), most)
        for value in (own + doubt, own + (doubt >> 4), doubt)
    )
    return Beside(
        sigma=np.where(measured, whole, sigma),
        typical=np.where(measured, typical, sigma),
        doubt=np.where(measured, added, 0),
        mixed=measured & mixed,
    )
