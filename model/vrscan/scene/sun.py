"""Light from other sources than the laser: sun and sky at a place and time, and lamps in a room.

Every value is an irradiance in the filter's band, before the filter's own transmission, on a
surface with a given normal in the scanner's frame.
"""

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    AwareDatetime,
    BeforeValidator,
    Field,
    field_validator,
    model_validator,
)

from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import Positive, Section
from vrscan.data.errors import InputError
from vrscan.scene.radiometry import photoelectrons

FILTER_NM = (645.0, 665.0)
LUMENS_PER_WATT = 683.0  # at 555 nm, where the eye's sensitivity V is 1

Column = Literal["global", "direct", "extraterrestrial"]
Irradiance = Annotated[float, Field(ge=0, le=2000)]


def _from_text(value: object) -> object:
    """Accept ISO 8601 text as well as TOML's own date and time."""
    if isinstance(value, str):
        try:
            return datetime.fromisoformat(value)
        except ValueError as error:
            raise ValueError("is not an ISO 8601 date and time") from error
    return value


def _known_years(value: datetime) -> datetime:
    if not 1900 <= value.year <= 2100:
        raise ValueError("must be of the years 1900 to 2100")
    return value


Time = Annotated[AwareDatetime, BeforeValidator(_from_text), AfterValidator(_known_years)]


class Sun(Section):
    """Sun and sky over the scene, ``[sun]``.

    The scanner looks along +z, which points to compass heading ``heading_deg`` (0 north, 90 east)
    and ``pitch_deg`` above the horizon; with ``roll_deg`` 0 its +y is up (scan plane level, or
    swung down by a negative pitch), with 90 its +x is up (scan plane upright).

    The sky is "clear" (Ineichen's model with the Linke turbidity: 2 very clean, 3 clean, 5 hazy or
    tropical, 7 polluted) or "given" by two or three of ``ghi_w_m2`` (all, on the level),
    ``dni_w_m2`` (direct, facing the sun) and ``dhi_w_m2`` (diffuse, on the level).

    Reflectances are those in the filter's band, which may be far from the albedo of all sunlight:
    a leaf reflects some 0.05 at 660 nm and 0.4 to 0.5 from 720 to 1300 nm (Bowker et al., NASA
    RP-1139, 1985), concrete some 0.3 at either. Buildings as high as ``skyline_deg`` stand all
    around; 0 is open land.

    The defaults are the place and time of the detectability paper's first measurement.
    """

    latitude_deg: float = Field(default=1.30, ge=-90, le=90)
    longitude_deg: float = Field(default=103.77, ge=-180, le=180)
    altitude_m: float = Field(default=20.0, ge=-450, le=9000)
    time: Time = datetime.fromisoformat("2015-06-24T12:30:00+08:00")
    albedo: float = Field(default=0.2, ge=0, le=1)  # reflectance of the ground
    skyline_deg: float = Field(default=0.0, ge=0, le=80)
    facade_reflectance: float = Field(default=0.35, ge=0, le=1)
    heading_deg: float = Field(default=0.0, ge=-360, le=360)
    pitch_deg: float = Field(default=0.0, ge=-90, le=90)
    roll_deg: float = Field(default=0.0, ge=-360, le=360)
    sky: Literal["clear", "given"] = "clear"
    linke_turbidity: float = Field(default=3.0, ge=1, le=15)
    ghi_w_m2: Irradiance | None = None
    dni_w_m2: Irradiance | None = None
    dhi_w_m2: Irradiance | None = None

    @model_validator(mode="after")
    def _sky_is_complete(self) -> "Sun":
        given = [self.ghi_w_m2, self.dni_w_m2, self.dhi_w_m2]
        known = sum(value is not None for value in given)
        if self.sky == "given" and known < 2:
            raise ValueError('sky "given" needs two of ghi_w_m2, dni_w_m2 and dhi_w_m2')
        if self.sky == "clear" and known:
            raise ValueError('ghi_w_m2, dni_w_m2 and dhi_w_m2 belong to sky = "given"')
        return self

    def towards(self) -> Floats:
        """Return the unit vector from the scene to the sun, scanner's frame [3].

        Raises:
            InputError: if the sun is not above the horizon.
        """
        return np.array(_sky(self).towards)

    def split(
        self,
        normal: Floats,
        *,
        shaded: Bools | bool = False,
        band_nm: tuple[float, float] = FILTER_NM,
    ) -> tuple[Floats, Floats]:
        """Return the direct and the other irradiance in a band, W/m^2, [n] each; see ``parts``."""
        found = self.parts(normal, shaded=shaded, band_nm=band_nm)
        return found.direct, found.sky + found.ground + found.facades

    def parts(
        self,
        normal: Floats,
        *,
        shaded: Bools | bool = False,
        band_nm: tuple[float, float] = FILTER_NM,
    ) -> "Parts":
        """Return the irradiance in a band by where it comes from.

        Direct is what comes from the sun's disc; the sky is that of Perez's model for tilted
        surfaces (1990): an even sky, a bright patch around the sun and a band at the horizon. The
        ground is matt and lit by sun and sky. In band, the direct part has the share of ASTM G173's
        direct spectrum, the others that of its global one.

        Buildings hide the even sky below the skyline, and the band at the horizon. Their facades
        are upright, matt, face the scene, and are lit by the sun from their side of it, by an open
        sky and by the ground. So where the sun is in front of a surface, the facades that it sees
        are mostly in their own shade, and give less than the sky that they hide.

        Leaves out shadows on the ground, light that goes from building to building, a change of the
        spectrum with the sun's height and the weather (a clear sky alone is some 4 % poorer between
        645 and 665 nm than the global spectrum, and 18 % between 770 and 790 nm), and clouds of any
        shape.

        Args:
            normal: Unit normals [n, 3], scanner's frame.
            shaded: Whether something stands between surface and sun, [n] or one for all. It also
                hides the bright patch around the sun.
            band_nm: Lower and upper wavelength of the band.

        Raises:
            InputError: if the sun is not above the horizon.
        """
        sky = _sky(self)
        lit = ~np.broadcast_to(np.asarray(shaded, dtype=np.bool_), len(normal))
        rise = np.clip(normal @ np.array(sky.up), -1.0, 1.0)  # cosine of the tilt
        facing = np.clip(normal @ np.array(sky.towards), 0.0, None)
        share = band_share(*band_nm, "global")
        diffuse = 0.5 * sky.even_w_m2 * (1.0 + rise) + sky.patch_w_m2 * facing * lit
        facades = np.zeros(len(normal))
        if self.skyline_deg > 0.0:
            hidden, facades = self._skyline(normal, band_nm)
            diffuse = diffuse - sky.even_w_m2 * hidden
        else:
            diffuse = diffuse + sky.horizon_w_m2 * np.sqrt(1.0 - rise**2)
        return Parts(
            direct=sky.dni_w_m2 * facing * lit * band_share(*band_nm, "direct"),
            sky=np.clip(diffuse, 0.0, None) * share,
            ground=0.5 * self.albedo * sky.ghi_w_m2 * (1.0 - rise) * share,
            facades=facades,
        )

    def _skyline(self, normal: Floats, band_nm: tuple[float, float]) -> tuple[Floats, Floats]:
        """Return the view factor of the buildings, and their in-band light, W/m^2, [n] each."""
        up = np.array(_sky(self).up)
        # Two level directions, then the middles of equal solid angles below the skyline.
        first = np.eye(3)[np.argmin(np.abs(up))]
        first = np.cross(up, first) / np.linalg.norm(np.cross(up, first))
        bearing = 2.0 * math.pi * (np.arange(_BEARINGS) + 0.5) / _BEARINGS
        level = np.outer(np.cos(bearing), first) + np.outer(np.sin(bearing), np.cross(up, first))
        top = math.sin(math.radians(self.skyline_deg))
        height = top * (np.arange(_HEIGHTS) + 0.5) / _HEIGHTS
        towards = np.sqrt(1.0 - height**2)[:, None, None] * level + height[:, None, None] * up
        solid = 2.0 * math.pi * top / (_BEARINGS * _HEIGHTS)
        seen = np.clip(towards @ normal.T, 0.0, None).sum(axis=0) * solid / math.pi  # [bearing, n]
        open_land = self.model_copy(update={"skyline_deg": 0.0})
        lit = open_land.in_band_irradiance(-level, band_nm=band_nm)
        return seen.sum(axis=0), self.facade_reflectance * (lit @ seen)

    def in_band_irradiance(
        self,
        normal: Floats,
        *,
        shaded: Bools | bool = False,
        band_nm: tuple[float, float] = FILTER_NM,
    ) -> Floats:
        """Return the irradiance in a band, W/m^2 [n]: the sum of ``split``."""
        direct, other = self.split(normal, shaded=shaded, band_nm=band_nm)
        return direct + other


_BEARINGS, _HEIGHTS = 72, 8  # directions in which a skyline is looked at


@dataclass(frozen=True)
class Parts:
    """Irradiance in a band on surfaces, W/m^2, [n] each."""

    direct: Floats
    sky: Floats
    ground: Floats
    facades: Floats


@dataclass(frozen=True)
class _Sky:
    """The sun's direction and the parts of the sky's light."""

    towards: tuple[float, float, float]  # direction of the sun, scanner's frame
    up: tuple[float, float, float]
    elevation_deg: float
    ghi_w_m2: float
    dni_w_m2: float
    even_w_m2: float  # Perez: dhi (1 - F1)
    patch_w_m2: float  # Perez: dhi F1 / cos(zenith)
    horizon_w_m2: float  # Perez: dhi F2


def _pvlib() -> Any:
    """Return pvlib; it is imported here because the import takes a second."""
    import pvlib

    return pvlib


def _frame(sun: Sun) -> Floats:
    """Return the scanner's axes x, y, z as rows, in east, north, up."""
    heading, pitch, roll = np.radians([sun.heading_deg, sun.pitch_deg, sun.roll_deg])
    level = np.array([math.sin(heading), math.cos(heading), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    z = math.cos(pitch) * level + math.sin(pitch) * up
    y = -math.sin(pitch) * level + math.cos(pitch) * up
    x = np.cross(y, z)
    return np.array(
        [
            math.cos(roll) * x + math.sin(roll) * y,
            -math.sin(roll) * x + math.cos(roll) * y,
            z,
        ]
    )


@lru_cache(maxsize=64)
def _sky(sun: Sun) -> _Sky:
    """Return sun and sky of a site; raises InputError where the sun is not above the horizon."""
    import pandas as pd

    pvlib = _pvlib()
    when = pd.DatetimeIndex([sun.time])
    place = pvlib.solarposition.get_solarposition(
        when, sun.latitude_deg, sun.longitude_deg, altitude=sun.altitude_m
    ).iloc[0]
    elevation = float(place["apparent_elevation"])
    if not elevation > 0.0:
        raise InputError(
            f"sun: at latitude {sun.latitude_deg:g}, longitude {sun.longitude_deg:g} on "
            f"{sun.time.isoformat()} the sun is {-elevation:.1f} degrees below the horizon"
        )
    zenith, azimuth = float(place["apparent_zenith"]), float(place["azimuth"])
    cosine = math.cos(math.radians(zenith))
    day = sun.time.astimezone(UTC).timetuple().tm_yday
    extra = float(pvlib.irradiance.get_extra_radiation(day))
    airmass = float(pvlib.atmosphere.get_relative_airmass(zenith))
    ghi, dni, dhi = _weather(sun, zenith, airmass, extra)
    even, patch, horizon = _perez(dhi, dni, extra, zenith, airmass)
    level = math.sin(math.radians(zenith))
    compass = math.radians(azimuth)
    frame = _frame(sun)
    towards = frame @ np.array([level * math.sin(compass), level * math.cos(compass), cosine])
    up = frame[:, 2]
    return _Sky(
        towards=(float(towards[0]), float(towards[1]), float(towards[2])),
        up=(float(up[0]), float(up[1]), float(up[2])),
        elevation_deg=elevation,
        ghi_w_m2=ghi,
        dni_w_m2=dni,
        even_w_m2=even,
        patch_w_m2=patch,
        horizon_w_m2=horizon,
    )


def _weather(
    sun: Sun, zenith_deg: float, airmass: float, extra_w_m2: float
) -> tuple[float, float, float]:
    """Return ghi, dni and dhi in W/m^2."""
    pvlib = _pvlib()
    cosine = math.cos(math.radians(zenith_deg))
    if sun.sky == "clear":
        pressure = pvlib.atmosphere.alt2pres(sun.altitude_m)
        clear = pvlib.clearsky.ineichen(
            zenith_deg,
            pvlib.atmosphere.get_absolute_airmass(airmass, pressure),
            sun.linke_turbidity,
            altitude=sun.altitude_m,
            dni_extra=extra_w_m2,
        )
        return float(clear["ghi"]), float(clear["dni"]), float(clear["dhi"])
    ghi, dni, dhi = sun.ghi_w_m2, sun.dni_w_m2, sun.dhi_w_m2
    if dhi is None:
        dhi = max((ghi or 0.0) - (dni or 0.0) * cosine, 0.0)
    if dni is None:
        # Near the horizon a small error of ghi - dhi would become an arbitrarily large dni.
        dni = min(max((ghi or 0.0) - dhi, 0.0) / cosine, extra_w_m2)
    return dni * cosine + dhi if ghi is None else ghi, dni, dhi


def _perez(
    dhi: float, dni: float, extra_w_m2: float, zenith_deg: float, airmass: float
) -> tuple[float, float, float]:
    """Return dhi (1 - F1), dhi F1 / B and dhi F2 of Perez's model.

    They are computed from an upright surface that faces the sun, where all three parts count.
    """
    pvlib = _pvlib()
    if dhi <= 0.0:
        return 0.0, 0.0, 0.0
    tilt = zenith_deg if zenith_deg > 1.0 else 90.0
    parts = pvlib.irradiance.perez(
        tilt, 180.0, dhi, dni, extra_w_m2, zenith_deg, 180.0, airmass, return_components=True
    )
    facing = math.cos(math.radians(tilt - zenith_deg))
    even = float(parts["poa_isotropic"]) * 2.0 / (1.0 + math.cos(math.radians(tilt)))
    patch = float(parts["poa_circumsolar"]) / facing
    horizon = float(parts["poa_horizon"]) / math.sin(math.radians(tilt))
    return even, patch, horizon


@lru_cache(maxsize=1)
def _reference() -> dict[str, Floats]:
    """Return the ASTM G173-03 spectra: "nm", and W m^-2 nm^-1 of each column."""
    table = _pvlib().spectrum.get_reference_spectra()
    spectra = {name: table[name].to_numpy(dtype=np.float64) for name in table.columns}
    return {"nm": table.index.to_numpy(dtype=np.float64), **spectra}


def spectral_irradiance(wavelength_nm: Floats | float, column: Column = "global") -> Floats:
    """Return ASTM G173-03's spectrum, W m^-2 nm^-1, 0 outside 280..4000 nm.

    Args:
        wavelength_nm: Wavelengths of any shape.
        column: "global" (37 degrees tilt), "direct" (with the bright patch around the sun), both
            at air mass 1.5, or "extraterrestrial".
    """
    spectra = _reference()
    return np.asarray(
        np.interp(wavelength_nm, spectra["nm"], spectra[column], left=0.0, right=0.0),
        dtype=np.float64,
    )


def band_irradiance(low_nm: float, high_nm: float, column: Column = "global") -> float:
    """Return the integral of ASTM G173's spectrum over a band, W/m^2; 0 outside 280..4000 nm.

    Raises:
        ValueError: if the band is empty.
    """
    if not high_nm > low_nm:
        raise ValueError(f"band {low_nm} to {high_nm} nm is empty")
    tabled = _reference()["nm"]
    low_nm, high_nm = (float(np.clip(edge, tabled[0], tabled[-1])) for edge in (low_nm, high_nm))
    inside = tabled[(tabled > low_nm) & (tabled < high_nm)]
    points = np.concatenate([[low_nm], inside, [high_nm]])
    return float(np.trapezoid(spectral_irradiance(points, column), points))


@lru_cache(maxsize=64)
def band_share(low_nm: float, high_nm: float, column: Column = "global") -> float:
    """Return r of the detectability paper: the band's share of the whole spectrum."""
    return band_irradiance(low_nm, high_nm, column) / band_irradiance(280.0, 4000.0, column)


class Lamp(Section):
    """A lamp of the room, one table ``[[lamp]]``.

    ``illuminance_lux`` is what a surface that faces the lamp receives. The share ``direct`` of it
    comes from ``towards`` and falls with the cosine; the rest fills the room and is the same on any
    surface. The lamp's distance and size and the shadows it throws are left out.
    """

    kind: Literal["led", "halogen", "fluorescent"] = "led"
    illuminance_lux: float = Field(default=500.0, ge=0, le=200_000)
    direct: float = Field(default=0.0, ge=0, le=1)
    towards: list[float] = Field(default_factory=lambda: [0.0, 1.0, 0.0])  # in the scanner's frame
    flicker: float | None = Field(default=None, ge=0, le=1)  # depth; the usual one if None
    mains_hz: Positive = 50.0
    phase_rad: float = 0.0  # phase of the flicker at time 0

    @field_validator("towards")
    @classmethod
    def _points(cls, value: list[float]) -> list[float]:
        if len(value) != 3 or not any(value):
            raise ValueError("must be [x, y, z] and not all zero")
        return value

    @property
    def depth(self) -> float:
        """Return (max - min) / (max + min) of the light over a half period of the mains."""
        return FLICKER[self.kind] if self.flicker is None else self.flicker

    def level(self, time_s: Floats) -> Floats:
        """Return the light over its mean at each time: a sine of twice the mains frequency.

        Leaves out the harmonics of real flicker and that of dimmed lamps.
        """
        angle = 4.0 * math.pi * self.mains_hz * time_s + self.phase_rad
        return np.asarray(1.0 + self.depth * np.cos(angle))

    def in_band_irradiance(
        self,
        normal: Floats,
        *,
        shaded: Bools | bool = False,
        band_nm: tuple[float, float] = FILTER_NM,
    ) -> Floats:
        """Return the mean irradiance in a band, W/m^2 [n]; ``level`` gives its factor at a time.

        Args:
            normal: Unit normals [n, 3], scanner's frame.
            shaded: Whether the lamp is hidden; the room's even light remains.
            band_nm: Lower and upper wavelength of the band.
        """
        lit = ~np.broadcast_to(np.asarray(shaded, dtype=np.bool_), len(normal))
        towards = np.array(self.towards) / np.linalg.norm(self.towards)
        facing = np.clip(normal @ towards, 0.0, None) * lit
        whole = self.illuminance_lux * watts_per_lumen(self.kind, *band_nm)
        return np.asarray(whole * (1.0 - self.direct + self.direct * facing))


# Depth of the flicker at twice the mains frequency: a filament's heat smooths it, a tube on an
# electronic ballast and an LED with a smoothing driver keep about these.
FLICKER = {"led": 0.1, "halogen": 0.08, "fluorescent": 0.2}

# A tube with three phosphors: line (nm), width at half height (nm), power. Mercury at 405, 436 and
# 578; BaMgAl:Eu 455; Tb 488, 545, 587; Eu 611, 627, 651, 689, 708. Powers about as in CIE F11.
_LINES = np.array(
    [
        [405.0, 5.0, 0.9],
        [436.0, 5.0, 2.4],
        [455.0, 60.0, 5.7],
        [488.0, 14.0, 2.9],
        [545.0, 9.0, 10.8],
        [587.0, 17.0, 3.9],
        [612.0, 8.0, 7.5],
        [627.0, 13.0, 2.8],
        [653.0, 25.0, 1.2],
        [689.0, 15.0, 0.5],
        [708.0, 10.0, 0.9],
    ]
)


def lamp_spectrum(kind: str, wavelength_nm: Floats) -> Floats:
    """Return a lamp's spectral power, in units of its own [n].

    Halogen is Planck's law (iria (1-6)) at 2800 K. The LED, of some 4000 K, is a blue line and a
    phosphor whose two flanks are Gaussians of different width (H. Jin et al., IEEE Photonics
    Journal 5, 2013). The fluorescent tube is a sum of lines of three phosphors and mercury. Leaves
    out the colours other than these that lamps are sold in: between 2700 and 6500 K the LED's
    light in 645..665 nm goes from 1.5 to 0.6 of this one's.

    Args:
        kind: "led", "halogen" or "fluorescent".
        wavelength_nm: Wavelengths [n].
    """
    if kind == "halogen":
        return np.asarray(
            (wavelength_nm / 560.0) ** -5 / np.expm1(1.438777e7 / (wavelength_nm * 2800.0))
        )
    if kind == "led":
        flank = np.where(wavelength_nm < 595.0, 100.0, 65.0)  # half width at half height
        phosphor = 0.87 * np.exp2(-(((wavelength_nm - 595.0) / flank) ** 2))
        return np.asarray(phosphor + 0.85 * np.exp2(-(((wavelength_nm - 450.0) / 12.0) ** 2)))
    centre, width, power = _LINES.T[:, :, None]
    lines = power / width * np.exp2(-((2.0 * (wavelength_nm - centre) / width) ** 2))
    return np.asarray(lines.sum(axis=0))


def eye_sensitivity(wavelength_nm: Floats) -> Floats:
    """Return the eye's V at each wavelength, within 0.01 of the CIE's table.

    The two lobes that Wyman, Sloan and Shirley fit to it (JCGT 2(2), 2013).
    """
    first, second = wavelength_nm - 568.8, wavelength_nm - 530.9
    return np.asarray(
        0.821 * np.exp(-0.5 * (first * np.where(first < 0.0, 0.0213, 0.0247)) ** 2)
        + 0.286 * np.exp(-0.5 * (second * np.where(second < 0.0, 0.0613, 0.0322)) ** 2)
    )


@lru_cache(maxsize=64)
def watts_per_lumen(kind: str, low_nm: float, high_nm: float) -> float:
    """Return a lamp's power in a band over its luminous flux, W/lm or (W/m^2)/lux.

    Raises:
        ValueError: if the band is empty.
    """
    if not high_nm > low_nm:
        raise ValueError(f"band {low_nm} to {high_nm} nm is empty")
    seen = np.arange(360.0, 831.0)
    light = np.trapezoid(lamp_spectrum(kind, seen) * eye_sensitivity(seen), seen)
    band = np.linspace(low_nm, high_nm, max(32, math.ceil(2.0 * (high_nm - low_nm))))
    return float(np.trapezoid(lamp_spectrum(kind, band), band) / (LUMENS_PER_WATT * light))


def collection(f_number: float, off_axis_rad: Floats | float = 0.0) -> Floats:
    """Return C = (pi/4) (D/f)^2 cos^4, the irradiance of a pixel over the radiance it sees, sr.

    The detectability paper's C(alpha) with cos^4 for its A(alpha). Leaves out vignetting, and the
    smaller angle of a lens that is focused near: times 1 / (1 + magnification)^2.
    """
    return np.asarray(0.25 * math.pi / f_number**2 * np.cos(off_axis_rad) ** 4)


def pixel_electrons(
    radiance_w_m2_sr: Floats | float,
    *,
    f_number: float,
    pixel_um2: float,
    exposure_s: float,
    quantum_efficiency: float,
    transmission: float = 1.0,
    off_axis_rad: Floats | float = 0.0,
    wavelength_nm: float = 658.0,
) -> Floats:
    """Return the electrons that light in a band puts into a pixel.

    Args:
        radiance_w_m2_sr: Radiance of the surface, in band: reflectance times irradiance over pi.
        f_number: f-number of the lens.
        pixel_um2: Area of the pixel.
        exposure_s: Time for which the pixel collects light; for sun and lamps that is the whole
            exposure, not the laser's pulse.
        quantum_efficiency: Electrons per photon.
        transmission: Transmission of filter and lens.
        off_axis_rad: Angle of the pixel's ray with the axis.
        wavelength_nm: Wavelength that stands for the whole band.
    """
    power_w = radiance_w_m2_sr * collection(f_number, off_axis_rad) * pixel_um2 * 1e-12
    efficiency = quantum_efficiency * transmission
    return photoelectrons(power_w, exposure_s, efficiency, wavelength_nm)
