"""Whether a laser stands out against the sun at a place and time: the detectability paper's case.

A site is a TOML file; what it leaves out is the case of Liu et al., "Detectability of active
triangulation range finder" (OSA), of which it keeps the printed inputs. Light of sun and sky comes
from ``sun``, the ratio of brightness and the powers from ``detectability``, the exposure of the eye
from ``safety``.
"""

import math
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from vrscan.data.arrays import Floats
from vrscan.data.config import Positive, Section, checked, read_toml
from vrscan.scene import detectability
from vrscan.scene.detectability import Beam, Filter, View
from vrscan.scene.safety import PUPIL_MM, ansi_exposure_j_cm2
from vrscan.scene.sun import Irradiance, Sun, Time, band_irradiance, band_share
from vrscan.scene.tuples import Pair

SPECTRUM_NM = (280.0, 4000.0)
EXPOSURES_S = (0.25, 1.0, 10.0)  # durations of looking into the beam
PUPIL_CM2 = 0.385  # A of (5)

Share = Annotated[float, Field(gt=0, le=1)]


class Striper(Section):
    """The laser, ``[laser]``; without ``fan_rad`` it is a spot."""

    wavelength_nm: float = Field(ge=400, le=1050)
    power_mw: Positive
    diameter_mm: Positive
    divergence_mrad: float = Field(ge=0, le=1000)
    fan_rad: float | None = Field(default=None, gt=0, le=math.pi)

    @property
    def beam(self) -> Beam:
        """Return the beam in the units of ``detectability``."""
        return Beam(
            1e-3 * self.power_mw, self.diameter_mm, 1e-3 * self.divergence_mrad, self.fan_rad
        )


class Bandpass(Section):
    """The camera's filter, ``[filter]``: its band, and two transmittances of it.

    ``laser`` is that at the laser's line, which the laser's light passes; ``band`` is the mean over
    ``band_nm``, which the sun's passes. ``share`` is the band's part of the sun's spectrum; left
    out, it is that of ASTM G173's global spectrum.
    """

    band_nm: Pair
    laser: Share
    band: Share
    share: Share | None = None

    @model_validator(mode="after")
    def _rises(self) -> "Bandpass":
        if not SPECTRUM_NM[0] <= self.band_nm[0] < self.band_nm[1] <= SPECTRUM_NM[1]:
            raise ValueError(f"band_nm {list(self.band_nm)} must rise, within 280 to 4000")
        return self

    @property
    def glass(self) -> Filter:
        """Return the filter in the form of ``detectability``."""
        share = band_share(*self.band_nm) if self.share is None else self.share
        return Filter(laser=self.laser, band=self.band, ratio=share)


class Wall(Section):
    """The upright wall, ``[wall]``, with the laser's light and the background on it.

    ``darkest`` and ``brightest`` are the reflectances that the scene has somewhere; the least power
    is asked for a spot on the first beside a background of the second.
    """

    facing_deg: float = Field(default=0.0, ge=-360, le=360)  # compass heading of its normal
    incidence_deg: float = Field(default=0.0, ge=0, le=85)  # of the laser
    reflectance: Share = 0.35
    darkest: Share = 0.2
    brightest: Share = 0.35

    @model_validator(mode="after")
    def _in_order(self) -> "Wall":
        if self.darkest > self.brightest:
            raise ValueError(f"darkest {self.darkest:g} is above brightest {self.brightest:g}")
        return self

    def view(self, laser: float, background: float) -> View:
        """Return the two pixels on the optical axis, for the reflectances under them."""
        cosine = math.cos(math.radians(self.incidence_deg))
        return View(laser_reflectance=laser, background_reflectance=background, cos_in=cosine)


class Moment(Section):
    """A time, ``[[moment]]``, and whether something stands between sun and wall.

    ``measured_w_m2`` is the irradiance of the wall, over the full spectrum, that a measurement
    says; ``inferred_w_m2`` is what others' errors say that it was. ``published_error`` is the
    largest error that others state for a model of their own.
    """

    time: Time
    shaded: bool = False
    measured_w_m2: Irradiance | None = Field(default=None, gt=0)
    inferred_w_m2: Irradiance | None = Field(default=None, gt=0)
    published_error: float | None = Field(default=None, ge=0)

    @model_validator(mode="after")
    def _one_reference(self) -> "Moment":
        if self.measured_w_m2 is not None and self.inferred_w_m2 is not None:
            raise ValueError("measured_w_m2 and inferred_w_m2: a wall has one of the two")
        return self

    @property
    def reference_w_m2(self) -> float | None:
        """Return the irradiance that a model is compared with, measured or inferred."""
        return self.inferred_w_m2 if self.measured_w_m2 is None else self.measured_w_m2


# The paper prints errors, not what it measured, so its walls are inferred. Its model of the direct
# sun alone takes the 900 W/m2 of ASTM G173 at both times, and is wrong by up to 26.7 and 56.9 %. An
# error of the sun's light is largest at the nearest range. There the model has B = 1.61, so the
# wall has 2.20 and 3.74, which is what 459 and 201 W/m2 give. (Were the model's B the larger one,
# the wall would have 2,000 and 20,000 W/m2, more than the sun gives outside the atmosphere.)
_PAPER_MOMENTS = (
    Moment(
        time=datetime.fromisoformat("2015-06-24T12:30:00+08:00"),
        inferred_w_m2=459.0,
        published_error=0.14,
    ),
    Moment(
        time=datetime.fromisoformat("2015-06-24T14:30:00+08:00"),
        shaded=True,
        inferred_w_m2=201.0,
        published_error=0.136,
    ),
)


class Site(Section):
    """A site in the form of its file; a table that is given replaces the paper's as a whole.

    The sky's turbidity is the mean of June there (pvlib's table of Linke turbidities). The ground
    is grass and concrete; the paper's 0.2 is their albedo of all sunlight, 0.4 that at 780 nm.
    """

    title: str = "Liu et al., north-facing wall in Singapore"
    range_mm: Annotated[list[Positive], Field(min_length=1, max_length=20)] = Field(
        default_factory=lambda: [500.0, 1000.0, 1500.0]
    )
    laser: Striper = Striper(
        wavelength_nm=780.0, power_mw=80.0, diameter_mm=6.8, divergence_mrad=2.0, fan_rad=1.57
    )
    filter: Bandpass = Bandpass(band_nm=(770.0, 790.0), laser=0.585, band=0.395, share=0.0352)
    wall: Wall = Wall()
    sun: Sun = Sun(linke_turbidity=4.93, albedo=0.4)
    moment: Annotated[list[Moment], Field(max_length=6)] = Field(default_factory=list)

    @property
    def moments(self) -> tuple[Moment, ...]:
        """Return the file's times, the paper's, or that of a sun of the file's own."""
        if self.moment:
            return tuple(self.moment)
        return (Moment(time=self.sun.time),) if "sun" in self.model_fields_set else _PAPER_MOMENTS

    def sun_at(self, time: datetime) -> Sun:
        """Return the sun in the frame of the wall, whose +z is the wall's normal."""
        given = {"time": time, "heading_deg": self.wall.facing_deg, "pitch_deg": 0.0}
        return self.sun.model_copy(update=given)


def load(path: Path | None) -> Site:
    """Return the paper's site, or that of a file.

    Raises:
        InputError: naming file, key and value, if the file is missing, is not TOML, has an unknown
            key, or a value of the wrong type or out of range.
    """
    return Site() if path is None else checked(Site, read_toml(path, str(path)), str(path))


@dataclass(frozen=True)
class Outlook:
    """What sun and laser make of the wall at one time; arrays are over the ranges.

    Irradiances are W/m^2 over the full spectrum: the in-band one over the band's share of ASTM
    G173's global spectrum, so a part whose spectrum differs counts with what it has in the band.

    Raises:
        InputError: if the sun is not above the horizon.
    """

    site: Site
    moment: Moment

    @cached_property
    def parts_w_m2(self) -> dict[str, float]:
        """Irradiance by where it comes from."""
        band = self.site.filter.band_nm
        normal = np.array([[0.0, 0.0, 1.0]])
        sun = self.site.sun_at(self.moment.time)
        found = vars(sun.parts(normal, shaded=self.moment.shaded, band_nm=band))
        return {name: float(value[0]) / band_share(*band) for name, value in found.items()}

    @cached_property
    def sun_w_m2(self) -> float:
        """Irradiance of the wall."""
        return sum(self.parts_w_m2.values())

    @cached_property
    def elevation_deg(self) -> float:
        """Height of the sun above the horizon."""
        return math.degrees(math.asin(self.site.sun_at(self.moment.time).towards()[1]))

    @cached_property
    def azimuth_deg(self) -> float:
        """Compass heading of the sun."""
        x, _, z = self.site.sun_at(self.moment.time).towards()
        return (math.degrees(math.atan2(-x, z)) + self.site.wall.facing_deg) % 360.0

    @property
    def laser_w_m2(self) -> Floats:
        """Irradiance of the laser's light on the wall, (1)."""
        cosine = math.cos(math.radians(self.site.wall.incidence_deg))
        return detectability.laser_irradiance(
            self.site.laser.beam, np.array(self.site.range_mm), cosine
        )

    def ratio(self, sun_w_m2: float, range_mm: Floats | None = None) -> Floats:
        """Return B of (4) for an irradiance of the wall, of equal reflectances."""
        wall = self.site.wall
        places = np.array(self.site.range_mm) if range_mm is None else range_mm
        view = wall.view(wall.reflectance, wall.reflectance)
        glass = self.site.filter.glass
        return detectability.brightness_ratio(self.site.laser.beam, places, sun_w_m2, glass, view)

    @property
    def model(self) -> Floats:
        """B with the sun's light as it is modelled here."""
        return self.ratio(self.sun_w_m2)

    @property
    def direct_sun_w_m2(self) -> float:
        """Irradiance in models with a direct sun of ASTM G173 that faces the wall at any time."""
        return band_irradiance(*SPECTRUM_NM, "direct")

    @property
    def direct_sun(self) -> Floats:
        """B of such a model."""
        return self.ratio(self.direct_sun_w_m2)

    @property
    def reference(self) -> Floats:
        """B that the measured or inferred irradiance gives; NaN without one."""
        known = self.moment.reference_w_m2
        return np.full(len(self.site.range_mm), np.nan) if known is None else self.ratio(known)

    @property
    def least_w(self) -> Floats:
        """Least power, (6) as it follows from (4), on the darkest beside the brightest surface."""
        wall = self.site.wall
        return detectability.least_power_w(
            self.site.laser.beam,
            np.array(self.site.range_mm),
            self.sun_w_m2,
            self.site.filter.glass,
            wall.view(wall.darkest, wall.brightest),
        )

    @property
    def printed_least_w(self) -> Floats:
        """Least power as (6) is printed: with ``band`` where (4) has ``laser``."""
        return self.least_w * self.site.filter.laser / self.site.filter.band


def eye_limits_w(laser: Striper, range_mm: float, time_s: float) -> tuple[float, float]:
    """Return the largest power of a striper for an eye at a range: (5), and what it stands for.

    The line is ``fan_rad`` R long and D_2 wide. The permitted exposure MPE t^-1 over that area is
    the largest power of a line that is at least as wide as the pupil; of a narrower one a part of
    the pupil stays dark, and MPE is of the mean over it. (5) divides the line's length by D_2
    instead of multiplying with it: for a line as wide as the pupil it gives pi/4 of the power, for
    wider ones less the wider they are.

    Args:
        laser: A laser with a fan.
        range_mm: Distance of the eye.
        time_s: Duration of the exposure, 18e-6 to 10.

    Returns:
        Powers, W: (5), and that of the mean exposure of the pupil.

    Raises:
        InputError: for a wavelength outside 700 to 1050 nm, or another duration.
        ValueError: for a spot.
    """
    if laser.fan_rad is None:
        raise ValueError("eye_limits_w: (5) is of a line, and the laser has no fan")
    exposure = ansi_exposure_j_cm2(laser.wavelength_nm, time_s)
    across_mm = range_mm * 1e-3 * laser.divergence_mrad + laser.diameter_mm
    long_mm = range_mm * laser.fan_rad
    printed = exposure * PUPIL_CM2 * long_mm / (time_s * across_mm)
    q = min(across_mm / PUPIL_MM, 1.0)
    lit_mm2 = 0.5 * PUPIL_MM**2 * (math.asin(q) + q * math.sqrt(1.0 - q**2))  # of the pupil
    share = lit_mm2 / (long_mm * across_mm)
    return printed, exposure * 1e-2 * 0.25 * math.pi * PUPIL_MM**2 / (time_s * share)
