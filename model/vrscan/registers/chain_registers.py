"""The configuration as the integers that the RTL's ports take."""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import Config
from vrscan.data.contract import checked_angles
from vrscan.data.errors import InputError
from vrscan.registers.free_table import free_table
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.settings import Settings

CONFIDENCE_ONE = 2**pkg.CONFIDENCE_WIDTH - 1


def to_register(
    source: str, key: str, value: float, width: int, fraction: int = 0, *, signed: bool = False
) -> int:
    """Return a value as the integer of a register, rounded to nearest, half up.

    Args:
        source: Where the configuration came from, for the message.
        key: Key from which the value was made, for the message.
        value: The value.
        width: Bits of the register.
        fraction: Fraction bits of the register.
        signed: Whether the register is two's complement.

    Raises:
        InputError: naming source, key and value, if it does not fit.
    """
    scaled = math.floor(value * 2.0**fraction + 0.5)
    low, high = (-(2 ** (width - 1)), 2 ** (width - 1)) if signed else (0, 2**width)
    if not low <= scaled < high:
        step = 2.0**-fraction
        raise InputError(
            f"{source}: {key}: needs a register value of {value:.6g}, "
            f"outside {low * step:.6g} to {(high - 1) * step:.6g}"
        )
    return scaled


def fit(source: str, key: str, value: float, name: str) -> int:
    """Return a value as the integer of the register of that name, rounded to nearest, half up.

    Args:
        source: Where the configuration came from, for the message.
        key: Key from which the value was made, for the message.
        value: The value, in the register's unit.
        name: Name of the register in ``register_map``, which has its width, fraction and sign.

    Raises:
        InputError: naming source, key and value, if it does not fit.
    """
    register = REGISTERS[name]
    return to_register(
        source, key, value, register.width, register.fraction, signed=register.signed
    )


@dataclass(frozen=True)
class Registers(Settings):
    """Configuration of the signal chain in integers; formats are those of ``vrscan_pkg``.

    ``pixel_width`` and ``line_length`` are elaboration parameters of the RTL, not ports. They are
    included because the formats depend on them.
    """

    pixel_width: int
    line_length: int
    period_n: bool  # whether the period is T = N; otherwise T = N - 1
    window_two_pass: bool  # whether a second window follows the first, with T = N
    window_fit: bool  # whether a Gaussian is fitted to the spot
    noise_row: bool  # whether row statistics are used, not the background's
    k_noise: int  # u16, 8 fraction bits
    k_height: int  # u16, 16 fraction bits
    snr_min: int  # u16, 8 fraction bits
    min_width: int  # u8, px
    max_width: int  # u8, px
    max_core: int  # u8, px
    saturation_level: int  # u16, counts: the least saturated pixel
    kappa: int  # u18, counts per electron, 28 - PixelWidth fraction bits
    c_sfm_gain: int  # u24: c_sfm = min(255, (power * gain + 2**15) >> 16)
    centre: int  # s, 20 fraction bits, px
    k1: int  # s26, 24 fraction bits: k1 * R**2, R = 2**clog2(LineLength) px
    k2: int  # s26, 24 fraction bits: k2 * R**4
    even: bool  # whether to use (5) as printed
    n0: int  # s32, 20 fraction bits, length_unit
    n1: int  # s32, 20 fraction bits, length_unit per R
    d0: int  # s32, 30 fraction bits, in units of f
    d1: int
    e0: int
    e1: int
    tolerance: int  # u16, 24 fraction bits: share of z that a point may err
    c_obj_gain: int  # u21, 20 fraction bits: c_obj = snr * gain; 0: by tolerance
    length_unit: int  # mm, of n0, n1, the table of free space and every point
    free_begin: int  # s24, turns
    free_shift: int
    free_table_from: tuple[int, ...]  # u16, 4 fraction bits, length_unit
    free_table_to: tuple[int, ...]

    @classmethod
    def from_config(cls, config: Config) -> "Registers":
        """Return the registers of a configuration, each rounded to nearest, half up.

        Raises:
            InputError: naming the key, if a value does not fit in its register.
        """
        peak, geometry = config.peak, config.geometry
        length = config.sensor.line_length

        def unsigned(key: str, value: float, width: int, fraction: int) -> int:
            return to_register(config.source, key, value, width, fraction, signed=False)

        def signed(key: str, value: float, width: int, fraction: int) -> int:
            return to_register(config.source, key, value, width, fraction, signed=True)

        address = math.ceil(math.log2(length))
        reach_px = 2**address
        reach_mm = reach_px * geometry.pitch_mm
        per_focal = reach_mm / geometry.focal_mm
        cosine, sine = math.cos(geometry.bias_rad), math.sin(geometry.bias_rad)
        base, offset = geometry.base_mm / geometry.unit_mm, geometry.offset_mm / geometry.unit_mm
        free_begin, free_shift, free_from, free_to = free_table(config)
        lengths = pkg.GEOMETRY_WIDTH, pkg.BASE_FRACTION
        rays = pkg.GEOMETRY_WIDTH, pkg.RAY_FRACTION
        distortion = pkg.DISTORTION_WIDTH, pkg.DISTORTION_FRACTION
        position_width = address + 1 + pkg.POSITION_FRACTION
        centre_width = position_width + pkg.OFFSET_FRACTION - pkg.POSITION_FRACTION
        return cls(
            pixel_width=config.sensor.pixel_width,
            line_length=length,
            period_n=peak.period == "n",
            window_two_pass=peak.two_pass,
            window_fit=peak.fit,
            noise_row=peak.noise == "row",
            k_noise=unsigned("peak.k_noise", peak.k_noise, 16, pkg.K_NOISE_FRACTION),
            k_height=unsigned("peak.k_height", peak.cut_height, 16, pkg.K_HEIGHT_FRACTION),
            snr_min=unsigned("peak.snr_min", peak.snr_min, pkg.SNR_WIDTH, pkg.SNR_FRACTION),
            min_width=peak.min_width,
            max_width=peak.max_width,
            max_core=peak.max_core,
            saturation_level=config.sensor.least_saturated,
            kappa=unsigned(
                "peak.kappa", peak.kappa, pkg.KAPPA_WIDTH, 28 - config.sensor.pixel_width
            ),
            c_sfm_gain=unsigned(
                "laser.power_max",
                CONFIDENCE_ONE / config.laser.power_max,
                pkg.GAIN_WIDTH,
                pkg.GAIN_FRACTION,
            ),
            centre=signed(
                "geometry.centre_px", geometry.centre_px, centre_width, pkg.OFFSET_FRACTION
            ),
            k1=signed("geometry.k1", geometry.k1 * reach_mm**2, *distortion),
            k2=signed("geometry.k2", geometry.k2 * reach_mm**4, *distortion),
            even=geometry.distortion == "even",
            n0=signed("geometry.base_mm", base * sine + offset * cosine, *lengths),
            n1=signed("geometry.base_mm", (base * cosine - offset * sine) * per_focal, *lengths),
            d0=signed("geometry.bias_deg", cosine, *rays),
            d1=signed("geometry.focal_mm", -sine * per_focal, *rays),
            e0=signed("geometry.bias_deg", sine, *rays),
            e1=signed("geometry.focal_mm", cosine * per_focal, *rays),
            tolerance=unsigned(
                "geometry.tolerance",
                geometry.tolerance,
                pkg.TOLERANCE_WIDTH,
                pkg.TOLERANCE_FRACTION,
            ),
            c_obj_gain=0
            if geometry.confidence == "tolerance"
            else unsigned(
                "geometry.snr_max",
                CONFIDENCE_ONE * 2.0**-pkg.SNR_FRACTION / geometry.snr_max,
                pkg.OBJECT_GAIN_WIDTH,
                pkg.OBJECT_GAIN_FRACTION,
            ),
            length_unit=geometry.unit_mm,
            free_begin=free_begin,
            free_shift=free_shift,
            free_table_from=free_from,
            free_table_to=free_to,
        )


def angle_turns(angle_rad: Floats) -> Ints:
    """Return scan angles in the RTL's format: s24 fractions of a turn, to nearest, half up.

    Args:
        angle_rad: Angles in [-pi, pi] rad, any shape. Pi itself wraps to half a turn below zero.

    Returns:
        int64 array of the same shape, in [-2**23, 2**23).

    Raises:
        LinesError: if an angle is outside, or not a number.
    """
    half = 2 ** (pkg.ANGLE_WIDTH - 1)
    turns = np.floor(checked_angles(angle_rad) * (half / np.pi) + 0.5).astype(np.int64)
    wrapped: Ints = (turns + half) % (2 * half) - half
    return wrapped
