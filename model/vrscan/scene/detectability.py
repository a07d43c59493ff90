"""Whether the laser stands out against the sun: brightness ratio B and the least power.

The model is that of Liu et al., "Detectability of active triangulation range finder" (OSA),
equations (1), (4) and (6), for their line striper and for a spot; ``site`` has their case. (6) is
printed with the filter's transmittance in its band where (4) has that at the laser's line; the form
here follows from (4), so that B at the least power is the required one exactly.

The model leaves out speckle and sensor noise (but see ``required_ratio``), the beam's profile (the
light is even over its cross section; a Gaussian spot of the same 1/e^2 width is twice as bright in
the middle), haze, and a background that is lit otherwise than the surface around the laser's spot.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from vrscan.data.arrays import Floats
from vrscan.scene.sun import collection


@dataclass(frozen=True)
class Beam:
    """The laser's light as it leaves the instrument."""

    power_w: float
    diameter_mm: float  # d
    divergence_rad: float  # gamma, full angle
    fan_rad: float | None = None  # beta of a line striper; None for a spot

    def area_mm2(self, range_mm: Floats | float) -> Floats:
        """Return the area of the cross section at a range, Omega R^2.

        D_2 = R gamma + d across. A striper is D_1 = R beta long, as the paper has it (d is left
        out beside R beta: 0.9 % of its own at 0.5 m); a spot is a disc of diameter D_2.
        """
        across = np.asarray(range_mm) * self.divergence_rad + self.diameter_mm
        if self.fan_rad is None:
            return np.asarray(0.25 * math.pi * across**2)
        return np.asarray(np.asarray(range_mm) * self.fan_rad * across)


@dataclass(frozen=True)
class Filter:
    """The camera's bandpass filter, for the light of sun and laser."""

    laser: float  # t_lambda0: transmittance at the laser's line
    band: float  # t_lambdap: effective transmittance in the band
    ratio: float  # r_lambdap: the band's share of the sun's irradiance


@dataclass(frozen=True)
class View:
    """The two pixels that are compared, one with the laser's return and one without."""

    laser_reflectance: float = 0.35
    background_reflectance: float = 0.35
    cos_in: float = 1.0  # cosine of laser beam and surface normal
    laser_off_axis_rad: float = 0.0
    background_off_axis_rad: float = 0.0
    f_number: float = 3.0  # cancels from B

    def __post_init__(self) -> None:
        shares = (self.laser_reflectance, self.background_reflectance, self.cos_in)
        if not all(0.0 < share <= 1.0 for share in shares):
            raise ValueError("reflectances and cos_in must be above 0 and at most 1")

    @property
    def contrast(self) -> float:
        """Return rho_lsr C(alpha_lsr) over rho_bg C(alpha_bg)."""
        laser = self.laser_reflectance * collection(self.f_number, self.laser_off_axis_rad)
        other = self.background_reflectance * collection(
            self.f_number, self.background_off_axis_rad
        )
        return float(laser / other)


def laser_irradiance(beam: Beam, range_mm: Floats | float, cos_in: Floats | float = 1.0) -> Floats:
    """Return the laser's irradiance on the target, W/m^2; (1): P cos / (Omega R^2).

    Raises:
        ValueError: if a range is not above 0.
    """
    if not np.all(np.asarray(range_mm) > 0.0):
        raise ValueError("range must be above 0")
    return np.asarray(beam.power_w * np.asarray(cos_in) / (beam.area_mm2(range_mm) * 1e-6))


def brightness_ratio(
    beam: Beam,
    range_mm: Floats | float,
    sun_w_m2: Floats | float,
    glass: Filter,
    view: View | None = None,
) -> Floats:
    """Return B, the irradiance of the pixel with laser over that of the pixel without; (4).

    B > 1 is the paper's rule: the laser's pixel is the brighter. It is a rule about reflectances as
    much as about power: with equal ones B exceeds 1 at any power, so (6) asks for no power, and
    only a required B above 1 (``required_ratio``) says anything.

    Args:
        beam: The laser.
        range_mm: Distance of the target.
        sun_w_m2: Irradiance of the sun on the surface, over its full spectrum. 0 gives infinity, or
            1 times the contrast with a dark laser.
        glass: The camera's filter.
        view: The two pixels; None is the paper's view.
    """
    seen = view or View()
    signal = laser_irradiance(beam, range_mm, seen.cos_in) * glass.laser
    noise = np.asarray(sun_w_m2) * glass.ratio * glass.band
    dark = noise <= 0.0
    over = signal / np.where(dark, 1.0, noise)
    over = np.where(dark, np.where(signal > 0.0, np.inf, 0.0), over)
    return np.asarray(seen.contrast * (over + 1.0))


def least_power_w(
    beam: Beam,
    range_mm: Floats | float,
    sun_w_m2: Floats | float,
    glass: Filter,
    view: View | None = None,
    *,
    required: float = 1.0,
) -> Floats:
    """Return the least power that reaches a brightness ratio; (6), derived from (4).

    (6) as printed divides by the transmittance in the band instead of that at the laser's line:
    with the paper's filter it asks for 1.48 times as much.

    Args:
        beam: The laser's beam; its power is not used.
        range_mm: Distance of the target.
        sun_w_m2: Irradiance of the sun on the surface, over its full spectrum.
        glass: The camera's filter.
        view: The two pixels; None is the paper's view.
        required: Brightness ratio B to reach.

    Returns:
        Power in W; 0 where B is reached without any laser.
    """
    seen = view or View()
    unit = laser_irradiance(replace(beam, power_w=1.0), range_mm, seen.cos_in) * glass.laser
    noise = np.asarray(sun_w_m2) * glass.ratio * glass.band
    return np.asarray(np.clip(noise * (required / seen.contrast - 1.0), 0.0, None) / unit)


def required_ratio(snr: float, background_electrons: float, dark_rms_electrons: float) -> float:
    """Return the B at which the laser's signal is ``snr`` times the noise under it.

    Signal (B - 1) N on a background of N electrons, whose noise is sqrt(B N + dark^2). It is the
    answer to what (6) leaves open for equal reflectances.

    Args:
        snr: Peak signal over rms noise.
        background_electrons: Electrons N of a pixel without laser.
        dark_rms_electrons: Rms of read noise and quantisation.

    Raises:
        ValueError: if N is not above 0: without a background there is no ratio.
    """
    if not background_electrons > 0.0:
        raise ValueError("background_electrons must be above 0")
    dark = background_electrons + dark_rms_electrons**2
    signal = 0.5 * (snr**2 + snr * math.sqrt(snr**2 + 4.0 * dark))
    return 1.0 + signal / background_electrons
