"""Image coordinate and scan angle to (x, z), the twin of ``rtl/geometry/triangulate.sv``.

VR-SCAN (3) and (4) without their tangents: x = q sin a and z = q cos a, q = n / d, where with s the
image coordinate in units of R = 2**clog2 of the line's length

    n = n0 + n1 s,   d = (d0 + d1 s) cos a + (e0 + e1 s) sin a.

Both rays have positive n and d; q is then the distance from the mirror, and its only singularity
the parallel rays.  The amplitude of sine and cosine cancels.
"""

from dataclasses import dataclass
from functools import cache
from math import erf, sqrt

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints
from vrscan.fixed.divide import divide
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.multiply import multiply
from vrscan.fixed.quarter_wave import LATENCY as QUARTER_WAVE_LATENCY
from vrscan.fixed.quarter_wave import quarter_wave
from vrscan.fixed.rom import rom_source

AMPL_WIDTH = 30  # ``AmplWidth``
FRACTION = AMPL_WIDTH - 1  # shift of every product: ``Fraction``
FACTOR_WIDTH = 32  # ``FactorWidth``
ROUNDED_WIDTH = 34  # ``RoundedWidth``
RANGE_WIDTH = 32  # ``RangeWidth``, of q with pkg.BASE_FRACTION fraction bits
SPREAD_FRACTION = 24  # ``SpreadFraction``, of sigma in corrected px
GRADIENT_FRACTION = 13  # ``GradientFraction``
GRADIENT_SPARE = 4  # ``GradientSpare``, left shift of the gradient before it is multiplied
SHARE_FRACTION = 6  # ``ShareFraction``
SHARE_BITS = 8  # ``share``: up to 4 sigma_z

LATENCY = (
    QUARTER_WAVE_LATENCY
    + 16 * (multiply_latency(FACTOR_WIDTH, ROUNDED_WIDTH) + 2)
    + 4 * (divide_latency(RANGE_WIDTH) + 2)
    + 3
)  # clocks from valid_i to valid_o
BUSY = LATENCY - 1  # clocks from one accepted point to the next: pkg.POINT_PERIOD


@cache
def confidences() -> Ints:
    """Return the share of a Gaussian within k / 64 standard deviations, 255 is 1, [256]."""
    end = 255 << 24
    shares = [erf(k / 2**SHARE_FRACTION / sqrt(2)) for k in range(1 << SHARE_BITS)]
    return np.array([(round(share * end) + (1 << 23)) >> 24 for share in shares], np.int64)


def rom() -> str:
    """Return ``rtl/geometry/triangulate_rom.sv``, that table."""
    comment = (
        "the share of a Gaussian within k / 64 standard deviations.",
        "Generated from vrscan.fixed.triangulate by scripts/generate.py.  255 is 1.  Its only test",
        "is that of triangulate, its user.",
    )
    memories = {"mem": (confidences(), pkg.CONFIDENCE_WIDTH)}
    return rom_source("triangulate_rom", comment, memories, {"confidence": "mem"})


@dataclass(frozen=True)
class Triangulated:
    """Points, int64 or bool of the shape of the inputs.

    Attributes:
        x: mm, 12 fraction bits; 0 with no_range or out_of_range, as z and c_obj.
        z: mm, 12 fraction bits.
        sigma_z: Standard deviation of z, mm, 12 fraction bits, saturating; its largest value with
            no_range or out_of_range.
        c_obj: Probability that z errs by less than the tolerance, or (9); 255 is 1.
        no_range: Whether the rays are parallel, or meet behind mirror or camera, or 4096 mm or more
            away.
        out_of_range: Whether x or z does not fit in its format, or the offset had not.
    """

    x: Ints
    z: Ints
    sigma_z: Ints
    c_obj: Ints
    no_range: Bools
    out_of_range: Bools


def _scaled(a: Ints, b: Ints) -> Ints:
    # To nearest, half up.
    product = multiply(a, b, a_width=FACTOR_WIDTH, b_width=ROUNDED_WIDTH)
    return (product + (1 << (FRACTION - 1))) >> FRACTION


def _dropped(value: Ints, bits: int) -> Ints:
    # To nearest, half up.
    return (value + (1 << (bits - 1))) >> bits


def triangulate(
    offset: Ints,
    slope: Ints,
    sigma: Ints,
    angle: Ints,
    *,
    typical: Ints | None = None,
    measured: Bools | bool = True,
    saturated: Bools | bool = False,
    n0: Ints | int,
    n1: Ints | int,
    d0: Ints | int,
    d1: Ints | int,
    e0: Ints | int,
    e1: Ints | int,
    tolerance: Ints | int,
    snr: Ints | int = 0,
    c_obj_gain: Ints | int = 0,
    line_length: int,
) -> Triangulated:
    """Return where laser ray and line of sight meet, exactly as the hardware rounds it.

    sigma_z = |dz/ds| / R * slope * sigma with dz/ds = (n1 cos a - z (d1 cos a + e1 sin a)) / d, the
    derivative of (3), and c_obj = erf(tolerance z / (sqrt 2 sigma_z)) with the typical sigma.

    Args:
        offset: Corrected position from the optical axis, px, 20 fraction bits. Any shape.
        slope: d offset / d position, 16 fraction bits.
        sigma: Standard deviation of the position, px, 12 fraction bits, u16.
        angle: Scan angle, fraction of a turn, s24.
        typical: Standard deviation of most such positions, which c_obj is of; ``sigma`` if None.
        measured: Whether there is a position; where there is none, every result is 0.
        saturated: Whether ``distortion`` could not represent the offset.
        n0: Constant part of n, mm, 20 fraction bits; s32, as are the following.
        n1: Factor of s in n, mm, 20 fraction bits.
        d0: Factor of cos a in d, in units of f, 30 fraction bits, as are the following.
        d1: Factor of s cos a in d.
        e0: Factor of sin a in d.
        e1: Factor of s sin a in d.
        tolerance: Share of z, 24 fraction bits, u16.
        snr: Signal-to-noise ratio, 8 fraction bits, u16.
        c_obj_gain: Where it is not 0, c_obj is snr * c_obj_gain, 20 fraction bits, u21: (9).
        line_length: ``LineLength`` of the module.
    """
    pixel_bits = (line_length - 1).bit_length()
    offset = np.asarray(offset, np.int64)
    up = FRACTION - pkg.OFFSET_FRACTION - pixel_bits
    s = offset << up if up >= 0 else _dropped(offset, -up)
    phase = np.asarray(angle, np.int64) & ((1 << pkg.ANGLE_WIDTH) - 1)
    sine, cosine = quarter_wave(phase, phase_width=pkg.ANGLE_WIDTH, ampl_width=AMPL_WIDTH)
    move, ray_cosine, ray_sine = (np.asarray(v, np.int64) for v in (n1, d1, e1))

    numerator = n0 + _scaled(s, move)
    divisor = _scaled(cosine, d0 + _scaled(s, ray_cosine)) + _scaled(
        sine, e0 + _scaled(s, ray_sine)
    )
    behind = (numerator <= 0) | (divisor <= 0)
    divisor = np.maximum(divisor, 0)
    # |numerator| <= 6144 mm, so the dividend is below 2**63 with half the divisor added.
    distance, overflow = divide(
        np.maximum(numerator, 0) << pkg.RAY_FRACTION, divisor, quotient_width=RANGE_WIDTH
    )
    no_range = behind | overflow
    length_drop = pkg.BASE_FRACTION - pkg.LENGTH_FRACTION
    x = _dropped(_scaled(sine, distance), length_drop)
    z = _dropped(_scaled(cosine, distance), length_drop)

    rate = _scaled(cosine, ray_cosine) + _scaled(sine, ray_sine)
    shift = _dropped(_scaled(cosine, move), pkg.BASE_FRACTION - GRADIENT_FRACTION)
    gradient = shift - _scaled(z, rate)
    sigma_max = (1 << pkg.SIGMA_WIDTH) - 1
    sigma_align = FACTOR_WIDTH - 1 - pkg.SIGMA_WIDTH
    slope_align = SPREAD_FRACTION + FRACTION - pkg.SLOPE_FRACTION - pkg.SIGMA_FRACTION - sigma_align

    def along_z(own: Ints) -> Ints:
        wide = np.asarray(own, np.int64) << sigma_align
        spread = np.abs(_scaled(wide, np.asarray(slope, np.int64) << slope_align))
        scale = np.abs(_scaled(gradient << GRADIENT_SPARE, spread))
        dividend = scale << (pkg.RAY_FRACTION - pixel_bits)
        quotient, _ = divide(dividend, divisor, quotient_width=RANGE_WIDTH)
        return np.minimum(quotient, sigma_max)

    sigma_z = along_z(sigma)
    typical_z = sigma_z if typical is None else along_z(typical)
    align = FRACTION + SHARE_FRACTION - pkg.TOLERANCE_FRACTION
    allowed = np.abs(_scaled(z, np.asarray(tolerance, np.int64) << align))
    share, _ = divide(allowed, typical_z, quotient_width=RANGE_WIDTH)
    gain = np.asarray(c_obj_gain, np.int64)
    object_align = FRACTION - pkg.OBJECT_GAIN_FRACTION
    share = np.where(gain == 0, share, _scaled(np.asarray(snr, np.int64), gain << object_align))
    share = np.minimum(share, (1 << SHARE_BITS) - 1)
    c_obj = np.where(gain == 0, confidences()[share], share)

    limit = 1 << (pkg.LENGTH_WIDTH - 1)
    fits = (x >= -limit) & (x < limit) & (z >= -limit) & (z < limit)
    given = np.broadcast_to(np.asarray(measured, np.bool_), x.shape)
    valid = given & ~no_range & fits & ~np.asarray(saturated, np.bool_)
    return Triangulated(
        x=np.where(valid, x, 0),
        z=np.where(valid, z, 0),
        sigma_z=np.where(valid, sigma_z, np.where(given, sigma_max, 0)),
        c_obj=np.where(valid, c_obj, 0),
        no_range=given & no_range,
        out_of_range=given & ~no_range & ~valid,
    )
