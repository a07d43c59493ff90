"""Accuracy of x, z and sigma_z of fixed.distortion and fixed.triangulate against float64.

The reference is VR-SCAN (3) to (5) in float64. Both get the same positions and angles, which are
integers. The constants of the instrument are float64's own, so the rounding of the registers is
part of the error.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import Config, Geometry
from vrscan.fixed.distortion import FRACTION as LENS_FRACTION
from vrscan.fixed.distortion import distortion
from vrscan.fixed.quarter_wave import LENGTH_ERROR, error_bound
from vrscan.fixed.triangulate import (
    AMPL_WIDTH,
    FRACTION,
    GRADIENT_FRACTION,
    GRADIENT_SPARE,
    SPREAD_FRACTION,
    triangulate,
)
from vrscan.ideal import geometry as ideal
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.study.progress import Progress
from vrscan.study.report.figure import SEED, Figure, largest

NEAREST_MM, FARTHEST_MM = 250.0, 1000.0
DISTORTION = 0.01  # share of the last pixel's distance
LIMIT_MM = 2e-3
SHARE = 0.005  # allowed share of sigma_z, or one step
FLOOR_MM = 2.0 ** -(pkg.LENGTH_FRACTION + 1)
GROUP = "x and z, 250 to 1000 mm"

_POSITION_STEP = 2.0**-pkg.POSITION_FRACTION
_LENGTH_STEP = 2.0**-pkg.LENGTH_FRACTION
_SIGMA_STEP = 2.0**-pkg.SIGMA_FRACTION
_SIGMA_MAX = (1 << pkg.SIGMA_WIDTH) - 1


def instruments() -> Iterator[Geometry]:
    """Return the shipped instrument without distortion and with up to 1 % of it at the edge."""
    yield Geometry()
    edge = Geometry().pitch_mm * Geometry().centre_px
    for first, second in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (2.0, -1.0)):
        for form in ("odd", "even"):
            k1, k2 = first * DISTORTION / edge**2, second * DISTORTION / edge**4
            yield Geometry.model_validate({"k1": k1, "k2": k2, "distortion": form})


INSTRUMENTS = len(list(instruments()))


def view(
    geometry: Geometry, distances: int, line_length: int, draw: np.random.Generator
) -> tuple[Ints, Ints]:
    """Return the field of view: every pixel at distances from 250 to 1000 mm.

    Args:
        geometry: The instrument.
        distances: Number of distances per pixel.
        line_length: Number of pixels of a line.
        draw: Source of the random fractions of a pixel.

    Returns:
        Positions, 12 fraction bits, and angles, s24 fractions of a turn; [line_length * distances].
    """
    pixel = np.arange(line_length)[:, None] << pkg.POSITION_FRACTION
    half = 1 << (pkg.POSITION_FRACTION - 1)
    position = pixel + draw.integers(-half, half, (line_length, distances))
    position = np.clip(position, 0, (line_length - 1) << pkg.POSITION_FRACTION)
    u, _ = ideal.undistorted(position * _POSITION_STEP, geometry)
    beta = geometry.bias_rad + np.arctan(u / geometry.focal_mm)
    z = np.linspace(NEAREST_MM, FARTHEST_MM, distances) + np.zeros(position.shape)
    x = geometry.base_mm - (z - geometry.offset_mm) / np.tan(beta)
    return position.ravel(), angle_turns(np.arctan2(x, z)).ravel()


@dataclass(frozen=True)
class Bounds:
    """The errors that the widths allow; all arrays [n]."""

    place_mm: Floats  # error of x and of z
    sigma_share: Floats  # error of sigma_z, as a share of it
    sigma_mm: Floats  # additional error, however small sigma_z is


def bounds(position_px: Floats, angle_rad: Floats, geometry: Geometry, line_length: int) -> Bounds:
    """Return the largest errors, each product's rounding carried to the result.

    With q = n / d the distance from the mirror and s = u / R: the offset's and the constants' steps
    go through dq/ds = (n1 - q d') / d, an error of n through 1 / d, one of d through q / d, a turn
    of the table's ray through q and dq/da.

    Args:
        position_px: Positions, px [n].
        angle_rad: Scan angles, rad [n].
        geometry: The instrument.
        line_length: Number of pixels of a line.
    """
    reach = 2.0 ** (line_length - 1).bit_length()
    r = position_px - geometry.centre_px
    t = np.abs(r) / reach
    k1 = abs(geometry.k1) * (geometry.pitch_mm * reach) ** 2
    k2 = abs(geometry.k2) * (geometry.pitch_mm * reach) ** 4

    # The offset: t^2, k1 + k2 t^2 and the gain err by half a step each, as do k1, k2 and centre.
    half = 2.0 ** -(LENS_FRACTION + 1)
    constant = 2.0 ** -(pkg.DISTORTION_FRACTION + 1)
    square = (2.0 * t + 1.0) * half
    factor = k2 * square + half + constant * (1.0 + t**2)
    gain = t**2 * factor + (k1 + k2 * t**2) * square + half
    centre = 2.0 ** -(pkg.OFFSET_FRACTION + 1)
    offset_px = np.abs(r) * gain + centre + 1.1 * centre

    u, _ = ideal.undistorted(position_px, geometry)
    s = u / geometry.pitch_mm / reach
    per_focal = reach * geometry.pitch_mm / geometry.focal_mm
    sine, cosine = np.sin(geometry.bias_rad), np.cos(geometry.bias_rad)
    base, back = geometry.base_mm, geometry.offset_mm
    n1 = (base * cosine - back * sine) * per_focal
    n = base * sine + back * cosine + n1 * s
    along, across = np.cos(angle_rad), np.sin(angle_rad)
    ray_cosine, ray_sine = cosine - sine * per_focal * s, sine + cosine * per_focal * s
    d = ray_cosine * along + ray_sine * across
    d_rate = per_focal * (cosine * across - sine * along)
    q = n / d

    s_error = 2.0 ** -(FRACTION + 1) + offset_px / reach
    step = 0.5 * (2.0 + np.abs(s))  # rounding of two constants and of the product
    n_error = step * 2.0**-pkg.BASE_FRACTION
    d_error = (step * (np.abs(along) + np.abs(across)) + 1.0) * 2.0**-pkg.RAY_FRACTION
    turn = np.sqrt(2.0) * (error_bound(AMPL_WIDTH) * 2.0 ** (1 - AMPL_WIDTH) - LENGTH_ERROR)
    dq_ds = np.abs(n1 - q * d_rate) / d
    dq_da = q * np.abs(ray_sine * along - ray_cosine * across) / d
    place = (
        (n_error + q * d_error) / d
        + dq_ds * s_error
        + (q + dq_da) * turn
        + 2.0**-pkg.BASE_FRACTION
        + FLOOR_MM
    )
    # dz/ds = g / d with g = n1 cos a - z d'; its two products, z and d' themselves.
    z = q * along
    g = np.abs(n1 * along - z * d_rate)
    g_error = (
        2.0 ** -(GRADIENT_FRACTION + 1) * 2.0
        + place * np.abs(d_rate)
        + z * 2.0 ** (1 - pkg.RAY_FRACTION)
        + n_error
        + n1 * turn
        + z * per_focal * (turn + 2.0**-pkg.RAY_FRACTION)
    )
    slope = 1.1 * 2.0 ** -(pkg.SLOPE_FRACTION + 1)  # for a slope of 0.9 or more
    d_turn = (np.abs(ray_sine * along - ray_cosine * across) + d) * turn
    sigma = g_error / g + slope + (d_error + d_turn + np.abs(d_rate) * s_error) / d
    # Half a step each of sigma in corrected px, of its product with g, and of the quotient.
    product = 2.0 ** -(GRADIENT_FRACTION + GRADIENT_SPARE + SPREAD_FRACTION - FRACTION + 1)
    spread = 2.0 ** -(SPREAD_FRACTION + 1)
    sigma_mm = (g * spread + product) / (d * reach) + 0.5 * _SIGMA_STEP
    return Bounds(place_mm=place, sigma_share=sigma, sigma_mm=sigma_mm)


@dataclass(frozen=True)
class Outcome:
    """The errors of n points against float64; all arrays [n].

    Attributes:
        place_mm: Larger error of x and z.
        bound_mm: Error of x and z that the widths allow.
        sigma_z: Error of sigma_z, in units of 0.5 % or one step.
        sigma_bound: Error of sigma_z that the widths allow, in the same units.
    """

    place_mm: Floats
    bound_mm: Floats
    sigma_z: Floats
    sigma_bound: Floats


def evaluate(geometry: Geometry, distances: int, draw: np.random.Generator) -> Outcome:
    """Return the errors over the whole field of view of an instrument.

    Args:
        geometry: The instrument.
        distances: Number of distances per pixel.
        draw: Source of random fractions of a pixel, and of sigmas over their whole format.
    """
    config = Config(geometry=geometry)
    registers, length = Registers.from_config(config), config.sensor.line_length
    position, angle = view(geometry, distances, length, draw)
    sigma = np.exp(draw.uniform(0.0, np.log(_SIGMA_MAX), len(position))).astype(np.int64)
    corrected = distortion(
        position,
        centre=registers.centre,
        k1=registers.k1,
        k2=registers.k2,
        even=registers.even,
        line_length=length,
    )
    points = triangulate(
        corrected.offset,
        corrected.slope,
        sigma,
        angle,
        n0=registers.n0,
        n1=registers.n1,
        d0=registers.d0,
        d1=registers.d1,
        e0=registers.e0,
        e1=registers.e1,
        tolerance=registers.tolerance,
        line_length=length,
    )
    if bool((points.no_range | points.out_of_range | corrected.saturated).any()):
        raise RuntimeError("accuracy: a point of the field of view has no range")

    position_px = position.astype(np.float64) * _POSITION_STEP
    angle_rad = angle.astype(np.float64) * (2.0 * np.pi / (1 << pkg.ANGLE_WIDTH))
    u, slope = ideal.undistorted(position_px, geometry)
    exact = ideal.triangle(u, angle_rad, geometry)
    bound = bounds(position_px, angle_rad, geometry, length)
    place = np.maximum(
        np.abs(points.x * _LENGTH_STEP - exact.x), np.abs(points.z * _LENGTH_STEP - exact.z)
    )
    sigma_z = np.abs(exact.slope * slope) * sigma * _SIGMA_STEP
    shown = np.minimum(sigma_z, _SIGMA_MAX * _SIGMA_STEP)
    allowed = np.maximum(SHARE * shown, _SIGMA_STEP)
    return Outcome(
        place_mm=place,
        bound_mm=bound.place_mm,
        sigma_z=np.abs(points.sigma_z * _SIGMA_STEP - shown) / allowed,
        sigma_bound=(bound.sigma_share * sigma_z + bound.sigma_mm) / allowed,
    )


def measure(distances: int, progress: Progress | None = None) -> list[Figure]:
    """Return the figures of x, z and sigma_z.

    Args:
        distances: Number of distances per pixel.
        progress: Called after every instrument.
    """
    draw = np.random.default_rng([SEED, 4])
    found: dict[bool, list[Outcome]] = {False: [], True: []}
    for done, geometry in enumerate(instruments()):
        bent = geometry.k1 != 0.0 or geometry.k2 != 0.0
        found[bent].append(evaluate(geometry, distances, draw))
        if progress is not None:
            progress(done + 1)
    figures = []
    for bent, title in ((False, "no distortion"), (True, "k1, k2 up to 1 % at the edge")):
        place = np.concatenate([o.place_mm for o in found[bent]])
        bound = np.concatenate([o.bound_mm for o in found[bent]])
        figures.append(
            Figure(
                GROUP,
                f"{title}, maximum of {len(place)} points",
                "um",
                1e3 * largest(place),
                1e3 * largest(bound),
                1e3 * FLOOR_MM,
                1e3 * LIMIT_MM,
                headline="x and z, 250 to 1000 mm, maximum",
            )
        )
    every = [o for outcomes in found.values() for o in outcomes]
    share = max(largest(o.place_mm / o.bound_mm) for o in every)
    name = "largest share of a point's own bound"
    figures += [
        Figure(GROUP, name, "1", share, predicted=1.0),
        Figure(
            GROUP,
            "sigma_z, error",
            "0.5 % or step",
            max(largest(o.sigma_z) for o in every),
            max(largest(o.sigma_bound) for o in every),
            0.5,
            1.0,
            headline="sigma_z, 250 to 1000 mm",
        ),
    ]
    return figures
