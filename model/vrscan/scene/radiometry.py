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
