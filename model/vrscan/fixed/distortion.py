"""Correction of the lens's radial distortion, the twin of ``rtl/geometry/distortion.sv``.

VR-SCAN (5): u = r + R (k1 s^3 + k2 s^5) with r the distance from the optical axis, R = 2**clog2 of
the line's length and s = r / R; odd as a radial distortion is, or with |s|, as printed.
"""

from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.multiply import multiply
from vrscan.fixed.saturate import saturated

FRACTION = 29  # fraction bits of every intermediate, and shift of every product: ``Fraction``
FACTOR_WIDTH = 32  # ``FactorWidth``
CURVE_FRACTION = 23  # ``CurveFraction``
PRODUCTS = 5


@dataclass(frozen=True)
class Distorted:
    """Corrected positions, int64 of the shape of ``position``.

    Attributes:
        offset: Distance from the optical axis, px, 20 fraction bits.
        slope: d offset / d position, 16 fraction bits.
        saturated: Whether one of them did not fit, or the correction exceeds 100 %; bool.
    """

    offset: Ints
    slope: Ints
    saturated: Bools


def _pixel_bits(line_length: int) -> int:
    return (line_length - 1).bit_length()


def offset_width(line_length: int) -> int:
    """Return the bits of an offset: the difference of two positions, which never wraps."""
    return _pixel_bits(line_length) + 2 + pkg.OFFSET_FRACTION


def _rounded_width(line_length: int) -> int:
    return max(FACTOR_WIDTH + 2, offset_width(line_length))


def latency(line_length: int) -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``."""
    return PRODUCTS * (multiply_latency(FACTOR_WIDTH, _rounded_width(line_length)) + 2) + 2


def distortion(
    position: Ints,
    *,
    centre: Ints | int,
    k1: Ints | int,
    k2: Ints | int,
    even: Bools | bool,
    line_length: int,
) -> Distorted:
    """Return corrected positions exactly as the hardware rounds them.

    With e = 2**-30, half a step of every intermediate, s^2 errs by e_w = 2 |s| e + e, the factor
    k1 + k2 s^2 by e_c = |k2| e_w + e, the gain by e_g = s^2 e_c + |k1 + k2 s^2| e_w + e, and the
    offset by |r| e_g + 2**-21 px: below 2**-18 px for a distortion of 10 % at the edge of 2048 px.

    Args:
        position: Positions on the sensor, px, 12 fraction bits, ``PositionWidth`` bits. Any shape.
        centre: Position of the optical axis, px, 20 fraction bits, ``CentreWidth`` bits.
        k1: k1 R^2, 24 fraction bits, s26.
        k2: k2 R^4, 24 fraction bits, s26.
        even: Whether to take (5) as printed.
        line_length: ``LineLength`` of the module.
    """
    pixel_bits = _pixel_bits(line_length)
    width = offset_width(line_length)

    def scaled(a: Ints, b: Ints) -> Ints:
        # To nearest, half up.
        product = multiply(a, b, a_width=FACTOR_WIDTH, b_width=_rounded_width(line_length))
        return (product + (1 << (FRACTION - 1))) >> FRACTION

    r = (np.asarray(position, np.int64) << (pkg.OFFSET_FRACTION - pkg.POSITION_FRACTION)) - centre
    up = FRACTION - pkg.OFFSET_FRACTION - pixel_bits
    # To nearest, half up, where the line is so long that bits are lost.
    s = r << up if up >= 0 else (r + (1 << (-up - 1))) >> -up
    align = FRACTION - pkg.DISTORTION_FRACTION
    first = np.asarray(k1, np.int64) << align
    second = np.asarray(k2, np.int64) << align
    flip = np.asarray(even, np.bool_) & (r < 0)

    square = scaled(s, s)
    inner = scaled(second, square)
    factor = first + inner
    gain = scaled(saturated(factor, FACTOR_WIDTH), square)
    # 3 k1 + 5 k2 s^2, towards minus infinity.
    curve = (factor + 2 * (factor + inner)) >> (FRACTION - CURVE_FRACTION)
    bend = scaled(curve, square)

    limited = saturated(gain, FRACTION + 1)
    exact_offset = r + scaled(np.where(flip, -limited, limited), r)
    # To nearest, half up.
    drop = CURVE_FRACTION - pkg.SLOPE_FRACTION
    exact_slope = (np.where(flip, -bend, bend) + (1 << CURVE_FRACTION) + (1 << (drop - 1))) >> drop
    offset = saturated(exact_offset, width)
    slope = saturated(exact_slope, pkg.SLOPE_WIDTH)
    return Distorted(
        offset=offset,
        slope=slope,
        saturated=(gain != limited) | (offset != exact_offset) | (slope != exact_slope),
    )
