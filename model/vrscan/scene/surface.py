"""Scattering by a surface: Lambert plus one lobe, and the scatter of a polished part.

The lobe is a function of direction cosines: its argument ``beta`` is the distance between the view
and the mirror direction when both are projected on the surface. It is 0 exactly where the halfway
vector is the normal, so camera and laser, which stand apart, see the glint at the bisector. A lobe
that is a function of ``beta`` alone is reciprocal, stays finite at grazing incidence, and its power
is a plain integral over the unit disc, so that it can never return more light than it received.
"""

import math
from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import Section
from vrscan.scene.shapes import dot

MIRROR_STEP = 2.0  # change of the refractive index, dn, that stands for a reflection
WAVELENGTH_NM = 658.0
INDEX = 1.5  # refractive index of materials that light enters: plastics, wax, cellulose, marble

Wavelength = Annotated[float, Field(ge=100, le=20_000)]


class Subsurface(Section):
    """The part of a material's matt light that leaves beside where it entered, ``subsurface``.

    ``length_mm`` is the mean way along the refracted beam to where that light turns back. On the
    surface it is spread to all sides, as a diffusion with attenuation spreads it: ``spread_mm`` is
    the scale of that spread seen from the side, an exponential to both sides.
    """

    share: float = Field(gt=0, le=0.9)
    length_mm: float = Field(gt=0, le=100)
    spread_mm: float | None = Field(default=None, ge=0, le=100)  # None: twice length_mm
    looks: float = Field(default=4.0, ge=1, le=1000)  # its independent speckle patterns

    @property
    def lateral_mm(self) -> float:
        """Return the scale of the spread."""
        return 2.0 * self.length_mm if self.spread_mm is None else self.spread_mm


class Material(Section):
    """The material of a target, one table ``[material.NAME]`` of a scene.

    ``lobe_deg`` is the lobe's standard deviation along each axis, as an angle at normal incidence.
    With ``roughness_nm`` the part is polished: of ``gloss``, the share that the roughness scatters
    goes into a K-correlation lobe. The rest stays in the Gaussian lobe, which then stands for the
    figure and the waviness of the part and should be narrow.

    ``looks`` is the number of independent speckle patterns that the surface averages; without it,
    those of the two polarisations: two where the light is matt, one where it is gloss.
    """

    reflectance: float = Field(default=0.3, ge=0, le=1)  # diffuse reflectance, Lambert
    gloss: float = Field(default=0.0, ge=0, le=1)  # share of the light in the lobe
    lobe_deg: float = Field(default=8.0, gt=0, le=60)
    roughness_nm: float | None = Field(default=None, ge=0, le=1000)  # rms, up to 1/roughness_at_nm
    roughness_at_nm: Wavelength = WAVELENGTH_NM  # light with which the roughness was measured
    surface_wave_um: Annotated[float, Field(gt=0, le=1e6)] = 20.0  # typical wavelength of roughness
    slope: float = Field(default=2.2, gt=0, le=20)  # slope of the scatter at high spatial frequency
    looks: float | None = Field(default=None, ge=1, le=1000)
    subsurface: Subsurface | None = None  # None: all light leaves where it enters

    @model_validator(mode="after")
    def _passive(self) -> "Material":
        total = self.reflectance + self.gloss
        if total > 1.0 + 1e-12:
            raise ValueError(f"reflectance + gloss is {total:.4g}, and more than 1 is no surface")
        return self

    @property
    def patterns(self) -> float:
        """Return the number of independent speckle patterns, 2 / (1 + P^2) without ``looks``.

        P is the degree of polarisation (Goodman, Speckle Phenomena in Optics, 2007, 3.4): the
        lobe's light keeps it, the matt light loses it; P is here the share of the lobe. Leaves out
        that dark matt surfaces keep a part (Umov), and that the shares depend on the view.
        """
        if self.looks is not None:
            return self.looks
        total = self.reflectance + self.gloss
        polarised = self.gloss / total if total > 0.0 else 0.0
        return 2.0 / (1.0 + polarised**2)


def brdf(
    material: Material,
    incident: Floats,
    normal: Floats,
    view: Floats,
    albedo: Floats | float = 1.0,
    *,
    wavelength_nm: float = WAVELENGTH_NM,
    acceptance_rad: Floats | float = 0.0,
) -> Floats:
    """Return the share of the light that goes into each direction, per solid angle.

    f_r = dL/dE of iria (1-15): reflectance / pi (1-16) plus the lobe

        gloss / (2 pi s^2 (1 - exp(-1 / 2 s^2))) exp(-beta^2 / 2 s^2),  s = sin(lobe_deg)

    which integrates to ``gloss`` at normal incidence and to less where part of it would lie below
    the horizon. Of a polished part's gloss G the share q = 1 - exp(-TIS) is scattered: by
    K-correlation (metis (1), (2)) scaled to G q, and the Gaussian core is left with
    G (1 - q max(cos_in, cos_out)). As the scattered light is at most G q cos_in, both together
    stay below G at any incidence.

    Leaves out Fresnel's rise of the gloss towards grazing, shadowing by the surface's own hills,
    polarisation, light that emerges beside where it entered, and any lobe but this one (no
    retro-reflection, no grain of a machined part). For ``TIS`` near 1 and above, the scatter is
    only of the right amount; its shape is that of a smooth surface.

    Args:
        material: The surface.
        incident: Unit vectors towards the surface [n, 3].
        normal: Unit normals [n, 3].
        view: Unit vectors away from the surface [n, 3].
        albedo: The reflectance map's factor, 0 to 1, [n] or one for all. It scales the diffuse part
            alone: colour is below the surface, gloss is made by the surface.
        wavelength_nm: Wavelength of the light.
        acceptance_rad: Half angle of the lens seen from the point, [n] or one for all. The lobe is
            widened by it so that a lens in the middle of the glint collects its exact share, and
            never more than the lobe holds however narrow that is; 0 is the BRDF itself.

    Returns:
        sr^-1 [n]; 0 where light or camera is below the horizon or grazes it exactly.
    """
    cos_in = -dot(incident, normal)
    cos_out = dot(view, normal)
    lit: Bools = (cos_in > 0.0) & (cos_out > 0.0)
    scattered = material.reflectance / math.pi * np.broadcast_to(albedo, lit.shape)
    if material.gloss > 0.0:
        half = view - incident
        tangent = half - dot(half, normal)[:, None] * normal
        square = dot(tangent, tangent)
        lobe = _gauss(square, material.lobe_deg, acceptance_rad)
        if material.roughness_nm:
            share, skirt = _polish(material, wavelength_nm)
            lobe = lobe * (1.0 - share * np.clip(np.maximum(cos_in, cos_out), 0.0, 1.0))
            lobe = lobe + skirt * cos_in * cos_out * _k_shape(
                square, 2.0 * math.pi * material.surface_wave_um, wavelength_nm, material.slope
            )
        scattered = scattered + material.gloss * lobe
    return np.where(lit, scattered, 0.0)


def beneath(incident: Floats, normal: Floats, view: Floats) -> Floats:
    """Return how far light leaves from where it entered, over its way along the refracted beam.

    At a depth on the refracted beam it turns to where it is refracted into the view. Both are
    Snell's, with ``INDEX``. Their components along the surface are those outside over the index.

    Args:
        incident: Unit vectors towards the surface [n, 3].
        normal: Unit normals [n, 3].
        view: Unit vectors away from the surface [n, 3].

    Returns:
        Vectors along the surface [n, 3]; they have no meaning where light or camera is below it.
    """
    cos_in, cos_out = -dot(incident, normal), dot(view, normal)
    down, up = (np.sqrt(INDEX**2 - 1.0 + np.square(cosine)) for cosine in (cos_in, cos_out))
    entered = incident + cos_in[:, None] * normal
    left = view - cos_out[:, None] * normal
    return np.asarray((entered + (down / up)[:, None] * left) / INDEX)


def core(material: Material, wavelength_nm: float) -> tuple[float, float, float]:
    """Return gloss G, scattered share q and sigma of the Gaussian lobe that ``brdf`` has.

    At incidence ``cos_in`` the lobe holds G (1 - q cos_in) of the light, but for what lies below
    the horizon; its sigma is in direction cosines.
    """
    share = _polish(material, wavelength_nm)[0] if material.roughness_nm else 0.0
    return material.gloss, share, math.sin(math.radians(material.lobe_deg))


def _gauss(square: Floats, lobe_deg: float, acceptance_rad: Floats | float) -> Floats:
    """Return the unit lobe at ``beta``^2, sr^-1."""
    # A disc of radius a around the lobe's middle collects 1 - exp(-x), x = a^2 / 2 s^2. A lobe with
    # s^2 x / (1 - exp(-x)) times the disc's area gives the same share.
    own = math.sin(math.radians(lobe_deg)) ** 2
    disc = np.maximum(np.square(acceptance_rad) / (2.0 * own), 1e-12)
    spread = own * disc / -np.expm1(-disc)
    value: Floats = np.exp(-square / (2.0 * spread)) / (
        2.0 * math.pi * spread * -np.expm1(-0.5 / spread)
    )
    return value


@lru_cache(maxsize=64)
def _polish(material: Material, wavelength_nm: float) -> tuple[float, float]:
    """Return the scattered share of the gloss and the factor of its lobe's shape."""
    whole = tis_of(material, wavelength_nm)
    if whole == 0.0:
        return 0.0, 0.0
    share = -math.expm1(-whole)
    length_um = 2.0 * math.pi * material.surface_wave_um
    return share, share * _k_peak(wavelength_nm, length_um, material.slope)


def tis_of(material: Material, wavelength_nm: float) -> float:
    """Return the total integrated scatter of a polished part's roughness, over its gloss."""
    sigma_nm = effective_roughness(
        material.roughness_nm or 0.0,
        wavelength_nm,
        material.roughness_at_nm,
        length_um=2.0 * math.pi * material.surface_wave_um,
        slope=material.slope,
    )
    return float(tis(sigma_nm, wavelength_nm))


def effective_roughness(
    sigma_nm: float, wavelength_nm: float, measured_nm: float, *, length_um: float, slope: float
) -> float:
    """Return the rms roughness that scatters light of one wavelength, measured at another.

    Metis (4), and (5) at slope 2: only spatial frequencies below 1 / wavelength scatter, so the
    squares are as the power of the K-correlation spectrum up to there. (4) is printed with plus
    signs in its brackets; the power is that of (1), with minus signs.

    Args:
        sigma_nm: Rms roughness over spatial frequencies from 0 to 1 / ``measured_nm``.
        wavelength_nm: Wavelength of the light.
        measured_nm: Wavelength at which the roughness was measured.
        length_um: B, 2 pi times the typical wavelength of the surface.
        slope: Slope s of the scatter at high spatial frequencies.
    """
    power, measured = (_k_band(length_um, each, slope) for each in (wavelength_nm, measured_nm))
    return sigma_nm * math.sqrt(power / measured)


def tis(
    sigma_nm: Floats | float, wavelength_nm: Floats | float, index_step: float = MIRROR_STEP
) -> Floats:
    """Return the total integrated scatter, metis (3): (2 pi dn sigma / lambda)^2.

    The share of the specular light that a smooth surface scatters; small against 1 or not valid.

    Args:
        sigma_nm: Rms roughness over spatial frequencies from 0 to 1/lambda.
        wavelength_nm: Wavelength of the light.
        index_step: Change of the refractive index at the surface; 2 for a mirror.
    """
    return np.asarray(
        np.square(2.0 * math.pi * index_step * np.asarray(sigma_nm) / wavelength_nm),
        dtype=np.float64,
    )


def _k_band(length_um: float, wavelength_nm: float, slope: float) -> float:
    """Return (1 - (1 + B^2/lambda^2)^(1 - s/2)) / (s/2 - 1): at slope 2 ln(1 + B^2/lambda^2)."""
    log = math.log1p((1e3 * length_um / wavelength_nm) ** 2)
    exponent = (1.0 - 0.5 * slope) * log
    return log if exponent == 0.0 else log * math.expm1(exponent) / exponent


def _k_peak(wavelength_nm: float, length_um: float, slope: float) -> float:
    """Return the BSDF of metis (1), or (2) at slope 2, at beta 0, over TIS and the cosines."""
    waves = 1e3 * length_um / wavelength_nm
    return waves**2 / (math.pi * _k_band(length_um, wavelength_nm, slope))


def _k_shape(square: Floats, length_um: float, wavelength_nm: float, slope: float) -> Floats:
    """Return (1 + B^2 beta^2 / lambda^2)^(-s/2)."""
    waves = 1e3 * length_um / wavelength_nm
    return np.asarray(np.power(1.0 + waves**2 * square, -0.5 * slope))
