"""The K-correlation BSDF as the METIS paper prints it."""

import math

import numpy as np

from vrscan.data.arrays import Floats


def bsdf_k(
    beta: Floats | float,
    cos_in: Floats | float,
    cos_out: Floats | float,
    *,
    sigma_nm: float,
    wavelength_nm: float,
    length_um: float,
    slope: float,
    index_step: float = 2.0,
    specular: float = 1.0,
) -> Floats:
    """Return the BSDF of metis (1), or of (2) where the slope is 2, sr^-1.

    Args:
        beta: Distance of the scattered from the specular direction, in direction cosines.
        cos_in: Cosine of the angle of incidence.
        cos_out: Cosine of the scattered direction with the normal.
        sigma_nm: Rms roughness that is effective at this wavelength.
        wavelength_nm: Wavelength of the light.
        length_um: B, 2 pi times the typical wavelength of the surface.
        slope: Slope s of the BSDF at high spatial frequencies.
        index_step: dn, the change of the refractive index at the surface; 2 for a mirror.
        specular: R, the reflectivity, or the transmission for scatter in transmission.
    """
    waves = (1e3 * length_um / wavelength_nm) ** 2
    front = math.pi * index_step**2 * specular * waves * (sigma_nm / wavelength_nm) ** 2
    front = 4.0 * front * np.asarray(cos_in) * np.asarray(cos_out)
    if slope == 2.0:
        return np.asarray(front / math.log1p(waves) / (1.0 + waves * np.square(beta)))
    bracket = 1.0 - (1.0 + waves) ** (1.0 - 0.5 * slope)
    fall = np.power(1.0 + waves * np.square(beta), 0.5 * slope)
    return np.asarray(front * (0.5 * slope - 1.0) / bracket / fall)
