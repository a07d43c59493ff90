"""The laser's beam: its width over distance, the stop that cuts it, and its pulse."""

import math
from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.optimize import brentq
from scipy.special import j0

from vrscan.data.arrays import Floats
from vrscan.data.config import Positive, Section
from vrscan.data.errors import InputError
from vrscan.scene.legendre import legendre
from vrscan.scene.row_profile import CutBeam, cut_beam

_E2 = math.exp(-2.0)
_UNCUT = 0.2  # beam over stop, below which exp(-50) of the power meets the stop's edge
_NODES = 200  # nodes of the integral over the stop; exact to 1e-12 from _UNCUT on
_UNIFORM = 50.0  # beam over stop; above it the stop is lit evenly to 4e-4 of the field


class Laser(Section):
    """The laser, its collimator and its pulse; the scene's table ``[laser]``.

    ``power_mw`` is what the diode emits while it is on. The stop and ``transmission`` reduce what
    leaves the instrument: see ``output_mw``.
    """

    wavelength_nm: float = Field(default=658.0, ge=400, le=1050)
    power_mw: float = Field(default=50.0, ge=0)  # at the pulse's top; see Description.of
    beam_diameter_mm: Positive = 1.0  # 1/e2 diameter at the waist
    waist_mm: float = 0.0  # distance of the waist from the pivot; negative: a diverging beam
    m2: float = Field(default=1.0, ge=1)  # beam quality; 1 is a pure TEM00
    # Diameter of the collimator's stop, at the pivot; inf is no stop.
    aperture_mm: Annotated[float, Field(gt=0, allow_inf_nan=True)] = 1.0
    rise_us: float = Field(default=0.05, ge=0)  # duration of either edge, foot to top
    transmission: float = Field(default=1.0, ge=0, le=1)  # collimator, mirror and window together

    @property
    def wavelength_mm(self) -> float:
        """Return the wavelength, mm."""
        return self.wavelength_nm * 1e-6


def rayleigh_mm(laser: Laser) -> float:
    """Return the distance from the waist where the uncut beam is sqrt(2) wider.

    pi w0^2 / (M^2 lambda), iria (2-9), (2-16), with M^2 of (2-22).
    """
    waist = 0.5 * laser.beam_diameter_mm
    return math.pi * waist**2 / (laser.m2 * laser.wavelength_mm)


def truncation(laser: Laser) -> float:
    """Return the 1/e2 diameter at the stop over the stop's diameter; 0 without a stop."""
    at_stop = laser.beam_diameter_mm * math.hypot(1.0, laser.waist_mm / rayleigh_mm(laser))
    return at_stop / laser.aperture_mm


def transmitted(ratio: float) -> float:
    """Return the share of a Gaussian beam's power that passes a centred round stop.

    1 - exp(-2 / ratio^2): iria 2.3.1, where a ratio of 1 loses 13.5 %.

    Args:
        ratio: Ratio from ``truncation``: 1/e2 diameter over the stop's, not negative.
    """
    return 1.0 if ratio == 0.0 else -math.expm1(-2.0 / ratio**2)


def far_field(sine: Floats, ratio: float) -> Floats:
    """Return the far field's irradiance behind a centred round stop, 1 on the axis.

    |int_0^1 exp(-x^2/ratio^2) J0(pi u x) x dx|^2, the Hankel transform of what passes the stop
    (iria 2.3.1; its limit for a wide beam is Airy's (2-4)).

    Args:
        sine: u, angle from the axis in wavelengths over the stop's diameter. Any shape.
        ratio: Ratio from ``truncation``, at least 0.2 (a less cut beam is Gaussian).

    Raises:
        ValueError: if ``ratio`` is less.
    """
    if ratio < _UNCUT:
        raise ValueError(f"far_field: the ratio must be at least {_UNCUT}, and is {ratio}")
    nodes, weights = legendre(_NODES)
    x = 0.5 * (nodes + 1.0)
    field = weights * x * np.exp(-np.square(x / ratio))
    u = np.asarray(sine, np.float64)[..., None]
    return np.asarray(np.square(j0(math.pi * u * x) @ field / field.sum()))


@lru_cache(maxsize=64)
def far_field_width(ratio: float, level: float = _E2) -> float:
    """Return the full width of the far field, in wavelengths over the stop's diameter.

    Args:
        ratio: Ratio from ``truncation``, positive. Below 0.2 the Gaussian's closed form is exact to
            1e-10.
        level: Share of the irradiance on the axis at which the width is taken: 1/2, or 1/e2.

    Raises:
        ValueError: if ``ratio`` is not positive or ``level`` not in [0.02, 1).
    """
    # Airy's first ring reaches 0.0175, so the first crossing is the main lobe's.
    if ratio <= 0.0 or not 0.02 <= level < 1.0:
        raise ValueError(f"far_field_width: ratio {ratio} or level {level} out of range")
    gaussian = math.sqrt(-2.0 * math.log(level)) * 2.0 / (math.pi * ratio)
    if ratio < _UNCUT:
        return gaussian

    def excess(u: float) -> float:
        return float(far_field(np.array(u), min(ratio, _UNIFORM))) - level

    u = 0.0
    step = 0.05 * max(gaussian, 0.2)
    while excess(u + step) > 0.0:
        u += step
    return 2.0 * float(brentq(excess, u, u + step, xtol=1e-12))


def cut(laser: Laser) -> CutBeam | None:
    """Return the tables of the beam's cross section, or None for one that no stop cuts."""
    ratio = truncation(laser)
    if ratio < _UNCUT:
        return None
    ratio = min(ratio, _UNIFORM)
    return cut_beam(ratio, far_field_width(ratio) / 4.0)


def _spread(distance: Floats, laser: Laser) -> tuple[Floats, Floats]:
    """Return lambda z / a and the stop's image by the wave's curvature, mm, at finite distances."""
    # A wave that converges to R is at z the flat wave at z / (1 - z/R), scaled by 1 - z/R.
    scale = 1.0 - distance * laser.waist_mm / (laser.waist_mm**2 + rayleigh_mm(laser) ** 2)
    stop = 0.5 * laser.aperture_mm
    return laser.m2 * laser.wavelength_mm * distance / stop, stop * np.abs(scale)


def zone(distance: Floats, laser: Laser) -> Floats:
    """Return how far a cut beam is on its way from the stop's shadow, 0, to the far field, 1.

    It is nu / (1 + nu), nu = lambda z / a^2 behind a flat wave in a stop of radius a. Without a
    stop it is 0.

    Args:
        distance: Distances from the pivot, mm [n].
        laser: The laser's beam and stop.
    """
    if math.isinf(laser.aperture_mm):
        return np.zeros_like(distance)
    far = np.isinf(distance)
    spread, shadow = _spread(np.where(far, 1.0, np.abs(distance)), laser)
    return np.where(far, 1.0, spread / (spread + shadow))


def radius_mm(distance: Floats, laser: Laser) -> Floats:
    """Return the 1/e2 radius of the Gaussian that fits the beam best.

    Without a stop this is iria's (2-8) exactly. Behind one the irradiance is Fresnel's integral
    over the stop, and the radius that of the Gaussian nearest to it in least squares. The shipped
    beam of 1 mm, cut at 1 mm, is a third narrower at 0.4 m than uncut (Fresnel's focus of the
    stop), as wide near 1.1 m, and 1.4 times as wide far away.

    It is a scale and not the whole of a cut beam: ``cut`` has its cross section with the rings.
    It leaves out the diode's ellipse and astigmatism, the way from collimator to mirror, and the
    mirror's own edge. With M^2 above 1 the wavelength is taken as M^2 times as long, which is right
    without a stop.

    Args:
        distance: Distances from the pivot, mm [n]. An infinite one (no hit) gives an infinite
            radius.
        laser: The laser's beam and stop.

    Returns:
        Radii, mm, of the shape of ``distance``, never 0.
    """
    distance = np.asarray(distance, np.float64)
    finite = np.isfinite(distance)
    z = np.where(finite, np.abs(distance), 0.0)
    tables = cut(laser)
    if tables is not None:
        return np.where(finite, tables.radius(*_spread(z, laser)), np.inf)
    rayleigh = rayleigh_mm(laser)
    at_stop = 0.5 * laser.beam_diameter_mm * math.hypot(1.0, laser.waist_mm / rayleigh)
    shadow = at_stop * (1.0 - z * laser.waist_mm / (laser.waist_mm**2 + rayleigh**2))
    spread = laser.m2 * laser.wavelength_mm / (math.pi * at_stop) * z
    return np.where(finite, np.hypot(shadow, spread), np.inf)


def output_mw(laser: Laser) -> float:
    """Return the power that leaves the instrument at the pulse's top, mW."""
    return laser.power_mw * laser.transmission * transmitted(truncation(laser))


def _edge_s(laser: Laser, pulse_s: float) -> float:
    edge = laser.rise_us * 1e-6
    if edge > pulse_s:
        raise InputError(
            f"laser.rise_us = {laser.rise_us:g}: longer than the pulse of {pulse_s * 1e6:g} us"
        )
    return edge


def pulse_transform(frequency_hz: Floats, laser: Laser, pulse_s: float) -> Floats:
    """Return the Fourier transform of the pulse about its centre, 1 at zero frequency.

    A trapezoid is a box of the pulse's width folded with a box of the edge's, so the transform is
    sinc(f pulse) sinc(f edge): real. A spot that moves v px/s has its spectrum at k cycles/px
    multiplied by this at f = k v.

    Args:
        frequency_hz: Frequencies of any shape.
        laser: The laser, whose edges are used.
        pulse_s: Width of the pulse at half height.

    Raises:
        InputError: if an edge is longer than the pulse.
    """
    edge = _edge_s(laser, pulse_s)
    f = np.asarray(frequency_hz, np.float64)
    return np.asarray(np.sinc(f * pulse_s) * np.sinc(f * edge))


def pulse_rms_s(laser: Laser, pulse_s: float) -> float:
    """Return the pulse's rms duration, s; times a spot's speed it is the sigma that smear adds.

    Raises:
        InputError: if an edge is longer than the pulse.
    """
    return math.hypot(pulse_s, _edge_s(laser, pulse_s)) / math.sqrt(12.0)
