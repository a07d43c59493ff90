"""Closed forms of light, from laser to photoelectrons; numbers in brackets are those of iria.

iria is C. T. Due and L. M. Peterson, *Optical-Mechanical, Active/Passive Imaging Systems* (IRIA
state-of-the-art report, 1982). ``docs/radiometry.md`` says what of it is used where, and what is
left out and why. Every function is elementwise over arrays of shapes that broadcast.
"""

import math

import numpy as np
from scipy.constants import c as LIGHT_SPEED
from scipy.constants import h as PLANCK

from vrscan.data.arrays import Floats

Real = float | Floats


def photon_energy_j(wavelength_nm: Real) -> Floats:
    """Return h c / lambda, J."""
    return np.asarray(PLANCK * LIGHT_SPEED / (np.asarray(wavelength_nm) * 1e-9))


def photoelectrons(
    power_w: Real, time_s: Real, quantum_efficiency: Real, wavelength_nm: Real
) -> Floats:
    """Return the mean electrons that a power on the detector frees in a time."""
    energy = np.asarray(power_w) * np.asarray(time_s)
    return np.asarray(energy * quantum_efficiency / photon_energy_j(wavelength_nm))


def mtf(relative: Real) -> Floats:
    """Return a perfect round lens's modulation transfer, (1-37), for a sine target.

    Args:
        relative: Spatial frequency over the cut-off 1 / (lambda F), (1-36), of either sign. From 1
            on the result is 0.
    """
    u = np.minimum(np.abs(relative), 1.0)
    turn = np.arccos(u)
    return np.asarray(2.0 / math.pi * (turn - u * np.sin(turn)))


def matt_share(cosine: Real, pupil_mm2: Real, range_mm: Real) -> Floats:
    """Return the share of a matt white surface's light that enters a pupil: (2-30), rho = 1.

    Args:
        cosine: Cosine of the surface's normal and the way to the pupil.
        pupil_mm2: Area of the pupil, as it is seen from the surface.
        range_mm: Distance of the pupil.
    """
    solid = np.asarray(pupil_mm2) / np.square(range_mm)
    return np.asarray(np.asarray(cosine) / math.pi * solid)


def signal_to_noise(signal_e: Real, background_e: Real, dark_rms_e: Real) -> Floats:
    """Return the rms signal over noise of a detector, (2-40) and (2-41), in electrons.

    With the responsivity of (2-43) and the bandwidth 1 / 2T of an integration over T, a power
    Phi R is e N / T, and (2-40) is N^2 / (N + N_B + N_d^2).

    Args:
        signal_e: Electrons N of the signal.
        background_e: Electrons N_B of other light.
        dark_rms_e: Rms N_d of the noise without light; with a signal it is above 0, or there is no
            noise at all and the result is 0.
    """
    variance = np.asarray(signal_e) + background_e + np.square(dark_rms_e)
    root = np.sqrt(np.maximum(variance, np.finfo(np.float64).tiny))
    return np.asarray(np.where(variance > 0.0, np.asarray(signal_e) / root, 0.0))


def phase_sigma(period: Real, snr: Real) -> Floats:
    """Return the deviation of a distance that a phase gives, (2-80), in units of its period.

    period / (2 sqrt2 pi S/N), good to 2 % above S/N = 6. Here the period is the window of the
    first harmonic, and S/N its magnitude over the root of the sum of all pixels' variances.

    Args:
        period: Distance of one turn: the ambiguity interval Lambda / 2 of a phase range finder.
        snr: Rms signal over noise.
    """
    return np.asarray(np.asarray(period) / (2.0 * math.sqrt(2.0) * math.pi * np.asarray(snr)))
