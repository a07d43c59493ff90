"""Closed forms of light, from laser to photoelectrons; numbers in brackets are those of iria.

iria is C. T. Due and L. M. Peterson, *Optical-Mechanical, Active/Passive Imaging Systems* (IRIA
state-of-the-art report, 1982). ``docs/radiometry.md`` says what of it is used where, and what is
left out and why. Every function is elementwise over arrays of shapes that broadcast.

All functions leave out the atmosphere (2 m of it pass 0.9996), polarisation, and the width of a
laser's line.
"""

import math

import numpy as np
from scipy.constants import c as LIGHT_SPEED
from scipy.constants import e as ELEMENTARY_CHARGE
from scipy.constants import h as PLANCK
from scipy.special import erf, j1

from vrscan.data.arrays import Floats

Real = float | Floats

PHASE_CONSTANT = 1.0 / (2.0 * math.sqrt(2.0) * math.pi)  # (2-80): 0.1125
PHASE_SNR = 6.0  # from this S/N on (2-80) holds to a few percent


# Photons and the detector


def photon_energy_j(wavelength_nm: Real) -> Floats:
    """Return h c / lambda, J."""
    return np.asarray(PLANCK * LIGHT_SPEED / (np.asarray(wavelength_nm) * 1e-9))


def responsivity_a_per_w(quantum_efficiency: Real, wavelength_nm: Real) -> Floats:
    """Return a photodiode's current responsivity, A/W: eta e lambda / (h c), (2-43)."""
    return np.asarray(ELEMENTARY_CHARGE * quantum_efficiency / photon_energy_j(wavelength_nm))


def photoelectrons(
    power_w: Real, time_s: Real, quantum_efficiency: Real, wavelength_nm: Real
) -> Floats:
    """Return the mean electrons that a power on the detector frees in a time."""
    energy = np.asarray(power_w) * np.asarray(time_s)
    return np.asarray(energy * quantum_efficiency / photon_energy_j(wavelength_nm))


def nep_w(d_star: Real, area_cm2: Real, bandwidth_hz: Real) -> Floats:
    """Return the noise equivalent power, W: sqrt(A_d df) / D*, (1-51) to (1-54).

    Args:
        d_star: Specific detectivity, cm Hz^1/2 / W.
        area_cm2: Area of the detector.
        bandwidth_hz: Bandwidth of the noise.
    """
    return np.asarray(np.sqrt(np.asarray(area_cm2) * np.asarray(bandwidth_hz)) / d_star)


def d_star(nep: Real, area_cm2: Real, bandwidth_hz: Real) -> Floats:
    """Return the specific detectivity, cm Hz^1/2 / W, of a noise equivalent power in W, (1-54)."""
    return np.asarray(np.sqrt(np.asarray(area_cm2) * np.asarray(bandwidth_hz)) / nep)


def first_order(frequency_hz: Real, time_constant_s: Real) -> Floats:
    """Return the response of a detector with one time constant over that at rest, (1-53)."""
    return 1.0 / np.hypot(1.0, 2.0 * math.pi * np.asarray(frequency_hz) * time_constant_s)


def bandwidth_hz(time_s: Real) -> Floats:
    """Return the bandwidth that fits a dwell or exposure, Hz: 1 / (2 tau), (1-61)."""
    return 0.5 / np.asarray(time_s)


# Signal to noise, for electrical power as the report has it; ``snr_rms`` is the root


def noise_a2(
    signal_w: Real,
    background_w: Real,
    nep: Real,
    responsivity: Real,
    bandwidth: Real,
) -> Floats:
    """Return the mean square noise current, A^2: shot noise and the detector's own, (2-39).

    Args:
        signal_w: Power of the laser on the detector.
        background_w: Power of all other light on it.
        nep: Noise equivalent power without light, W.
        responsivity: Responsivity of the detector, A/W.
        bandwidth: Bandwidth of the noise, Hz.
    """
    light = np.asarray(signal_w) + np.asarray(background_w)
    shot = 2.0 * ELEMENTARY_CHARGE * np.asarray(bandwidth) * light * responsivity
    return np.asarray(shot + np.square(np.asarray(nep) * responsivity))


def snr_power(
    signal_w: Real, background_w: Real, nep: Real, responsivity: Real, bandwidth: Real
) -> Floats:
    """Return the ratio of signal to noise in electrical power, (2-40); 0 without signal.

    Args: see ``noise_a2``.
    """
    noise = noise_a2(signal_w, background_w, nep, responsivity, bandwidth)
    square = np.square(np.asarray(signal_w) * responsivity)
    return np.where(square > 0.0, square / np.where(noise > 0.0, noise, 1.0), 0.0)


def snr_rms(
    signal_w: Real, background_w: Real, nep: Real, responsivity: Real, bandwidth: Real
) -> Floats:
    """Return the ratio of signal to noise in amplitude, (2-41). Args: see ``noise_a2``."""
    return np.sqrt(snr_power(signal_w, background_w, nep, responsivity, bandwidth))


def snr_shot(
    signal_w: Real, quantum_efficiency: Real, wavelength_nm: Real, bandwidth: Real
) -> Floats:
    """Return the rms S/N that the signal's own shot noise allows, (2-44).

    With a bandwidth of 1 / (2 t) this is the root of the photoelectrons.
    """
    each = 2.0 * photon_energy_j(wavelength_nm) * bandwidth
    return np.sqrt(np.asarray(quantum_efficiency) * signal_w / each)


def snr_detector(signal_w: Real, nep: Real) -> Floats:
    """Return the rms S/N that the detector's own noise allows, (2-46)."""
    return np.asarray(np.asarray(signal_w) / np.asarray(nep))


def crossover_w(nep: Real, responsivity: Real, bandwidth: Real) -> Floats:
    """Return the signal whose shot noise is as large as the detector's, W.

    Below it the rms S/N rises as the signal, above it as its root.
    """
    return np.asarray(
        np.square(nep) * responsivity / (2.0 * ELEMENTARY_CHARGE * np.asarray(bandwidth))
    )


# The range equation


def lambert(reflectance: Real) -> Floats:
    """Return the reflectance per solid angle of a matt surface, 1/sr: rho / pi, (1-16)."""
    return np.asarray(reflectance) / math.pi


def solid_angle_sr(aperture_mm: Real, range_mm: Real, off_axis_rad: Real = 0.0) -> Floats:
    """Return the solid angle of a round lens seen from the target, A_R / R^2.

    For a lens much smaller than its distance. Off axis the pupil is seen foreshortened; the lens's
    mounts (vignetting) are left out.

    Args:
        aperture_mm: Diameter of the entrance pupil.
        range_mm: Distance from target to pupil, along the ray; infinite gives 0.
        off_axis_rad: Angle between ray and optical axis; from pi/2 on the result is 0.
    """
    area = 0.25 * math.pi * np.square(aperture_mm)
    seen = np.maximum(np.cos(off_axis_rad), 0.0)
    return np.asarray(area * seen / np.square(range_mm))


def received_w(
    emitted_w: Real,
    per_sr: Real,
    solid_angle: Real,
    *,
    optics: Real = 1.0,
    path: Real = 1.0,
    overlap: Real = 1.0,
) -> Floats:
    """Return the laser power on the detector, W: the range equation (2-30), (2-31).

    It leaves out speckle (the result is the mean over it) and light by other ways than lens and
    target.

    Args:
        emitted_w: Power that the laser emits, Phi_L.
        per_sr: Reflectance per solid angle of the target, p', towards the lens; it includes the
            cosine to the normal.
        solid_angle: Solid angle of the lens seen from the target, sr.
        optics: Transmission of transmitter and receiver together, including the filter.
        path: Transmission of the air, one way.
        overlap: eta_B, share of the spot's image on the detector: see ``row_overlap``.
    """
    target = np.asarray(emitted_w) * per_sr * solid_angle
    return np.asarray(target * optics * np.square(path) * overlap)


def row_overlap(radius: Real, height: Real, offset: Real = 0.0) -> Floats:
    """Return eta_B of a row of pixels and a Gaussian image: the share of its light on the row.

    The integral of the spot's profile over the row (the report has it as A_F / A_T for even light):
    (erf(sqrt2 (h/2 + y)/w) + erf(sqrt2 (h/2 - y)/w)) / 2.

    Args:
        radius: 1/e2 radius w of the image, at least 0; at 0 all light is on or off the row.
        height: Height h of the row, in the unit of ``radius``.
        offset: Distance y from the row's middle to the spot's.
    """
    above = 0.5 * np.asarray(height) + np.asarray(offset)
    below = 0.5 * np.asarray(height) - np.asarray(offset)
    width = np.maximum(radius, 1e-12 * np.maximum(np.asarray(height), 1e-30))
    scale = math.sqrt(2.0) / width
    return np.asarray(0.5 * (erf(scale * above) + erf(scale * below)))


# Diffraction and image quality


def airy(radius: Real, wavelength: Real, f_number: Real) -> Floats:
    """Return the irradiance of a point's image over that at its centre, (2-4).

    [2 J1(v) / v]^2, v = pi r / (lambda F), of a round even pupil.

    Args:
        radius: Distance from the centre.
        wavelength: Wavelength in the unit of ``radius``.
        f_number: Working focal ratio F, f / D at infinity.
    """
    v = np.asarray(math.pi * np.asarray(radius) / (np.asarray(wavelength) * f_number))
    safe = np.where(v == 0.0, 1.0, v)
    return np.where(v == 0.0, 1.0, np.square(2.0 * j1(safe) / safe))


def airy_diameter(wavelength: Real, f_number: Real) -> Floats:
    """Return the diameter of the first dark ring, 2.44 lambda F, (1-27): it holds 84 %."""
    return 2.0 * 1.2196698912665045 * np.asarray(wavelength) * f_number


def cutoff(wavelength: Real, f_number: Real) -> Floats:
    """Return the highest spatial frequency that a lens passes, 1 / (lambda F), (1-36)."""
    return 1.0 / (np.asarray(wavelength) * f_number)


def mtf(relative: Real) -> Floats:
    """Return a perfect round lens's modulation transfer, (1-37), for a sine target.

    Args:
        relative: Spatial frequency over ``cutoff``, of either sign; from 1 on the result is 0.
    """
    u = np.minimum(np.abs(relative), 1.0)
    turn = np.arccos(u)
    return np.asarray(2.0 / math.pi * (turn - u * np.sin(turn)))


def strehl(phase_rad: Floats, weight: Floats | None = None) -> float:
    """Return the Strehl ratio of a pupil, |mean of exp(i phase)|^2, (1-30).

    Args:
        phase_rad: Wave error over the pupil, any shape.
        weight: Area of each sample, of the shape of ``phase_rad``; equal areas if None.
    """
    return float(abs(np.average(np.exp(1j * phase_rad), weights=weight)) ** 2)


# Gaussian beams; ``scene.beam`` has the instrument's own, with its stop


def gaussian(radius: Real, w: Real) -> Floats:
    """Return a Gaussian beam's irradiance over that on its axis, exp(-2 r^2 / w^2), (2-7)."""
    return np.asarray(np.exp(-2.0 * np.square(np.asarray(radius) / np.asarray(w))))


def rayleigh_range(waist: Real, wavelength: Real) -> Floats:
    """Return pi w0^2 / lambda, (2-9), (2-16). Args: radius at the waist, same unit twice."""
    return np.asarray(math.pi * np.square(waist) / np.asarray(wavelength))


def gaussian_radius(distance: Real, waist: Real, wavelength: Real) -> Floats:
    """Return the 1/e2 radius at a distance from the waist, (2-8). Args: one unit throughout."""
    ratio = np.asarray(distance) / rayleigh_range(waist, wavelength)
    return np.asarray(waist) * np.hypot(1.0, ratio)


def wavefront_radius(distance: Real, waist: Real, wavelength: Real) -> Floats:
    """Return the wavefront's radius of curvature, (2-10); infinite at the waist."""
    z = np.asarray(distance, np.float64)
    safe = np.where(z == 0.0, 1.0, z)
    bent = safe * (1.0 + np.square(rayleigh_range(waist, wavelength) / safe))
    return np.where(z == 0.0, np.inf, bent)


def waist_from(w: Real, curvature_radius: Real, wavelength: Real) -> tuple[Floats, Floats]:
    """Return waist radius and distance from it of a beam of known radius and wavefront.

    (2-13), (2-14). Args: one unit throughout; ``curvature_radius`` positive when diverging, not 0.
    """
    shape = math.pi * np.square(w) / (np.asarray(wavelength) * curvature_radius)
    waist = np.asarray(w) / np.hypot(1.0, shape)
    return waist, np.asarray(curvature_radius / (1.0 + 1.0 / np.square(shape)))


def divergence_rad(waist: Real, wavelength: Real) -> Floats:
    """Return the full 1/e2 angle far away, (4/pi) lambda / (2 w0), (2-15)."""
    return 2.0 * np.asarray(wavelength) / (math.pi * np.asarray(waist))


def focus_shift(focal: Real, curvature_radius: Real) -> Floats:
    """Return the travel of a lens that bends the wavefront to a radius, from (2-17).

    dt = f (f + dt) / R solved exactly: f^2 / (R - f). Args: one unit; R longer than f.
    """
    f = np.asarray(focal)
    return np.asarray(np.square(f) / (np.asarray(curvature_radius) - f))


# Scanning


def peak_rate(amplitude_rad: Real, frequency_hz: Real) -> Floats:
    """Return the fastest rate of a sinusoidal scan, rad/s: 2 pi f a0."""
    return 2.0 * math.pi * np.asarray(frequency_hz) * amplitude_rad


def mean_rate(amplitude_rad: Real, frequency_hz: Real) -> Floats:
    """Return the mean rate of a sinusoidal scan, rad/s: 4 f a0."""
    return 4.0 * np.asarray(frequency_hz) * amplitude_rad


def dwell_s(angle_rad: Real, rate_rad_per_s: Real) -> Floats:
    """Return the time for which a scan stays within an angle, s, (1-40); infinite at rest."""
    rate = np.abs(np.asarray(rate_rad_per_s, np.float64))
    safe = np.where(rate > 0.0, rate, 1.0)
    return np.where(rate > 0.0, np.asarray(angle_rad) / safe, np.inf)


def scan_efficiency(used: Real) -> tuple[Floats, Floats]:
    """Return the time and the evenness of a sinusoidal scan of which only the middle is used.

    Both are derived here; the report has eta_s of rotating mirrors only, (1-42) to (1-44).

    Args:
        used: Largest angle in use over the amplitude, 0 to 1.

    Returns:
        Share of the time in use, (2/pi) asin q, and slowest over fastest rate, sqrt(1 - q^2).

    Raises:
        ValueError: if ``used`` is outside its range.
    """
    q = np.asarray(used, np.float64)
    if np.any((q < 0.0) | (q > 1.0)):
        raise ValueError("scan_efficiency: the used share must be 0 to 1")
    return 2.0 / math.pi * np.arcsin(q), np.sqrt(1.0 - np.square(q))


# Speckle and the phase of a peak


def speckle_cells(range_: Real, spot: Real, aperture_area: Real, wavelength: Real) -> Floats:
    """Return the number of speckle cells of size lambda R / S in a lens, at least 1 (2.5.4).

    The detector that sums them sees the square root of this as mean over rms. Args: one unit.
    """
    cell = np.asarray(wavelength) * range_ / spot
    return np.maximum(np.asarray(aperture_area) / np.square(cell), 1.0)


def phase_error(interval: Real, snr: Real) -> Floats:
    """Return the rms error of a position that is read from a phase, (2-80).

    0.1125 interval / snr. The report has half the modulation's wavelength for the interval; for
    VR-SCAN's peak (8) it is the window's period, and ``snr`` the first harmonic's rms S/N,
    |P1| / (sqrt(N) sigma). Holds from an S/N of 6 on: at 2 the true error is 10 % larger, at 1 it
    is 23 %. White noise only: no speckle, no window that moves with the noise.

    Args:
        interval: Interval in which the position is unambiguous.
        snr: Signal-to-noise ratio, positive.
    """
    return np.asarray(PHASE_CONSTANT * np.asarray(interval) / np.asarray(snr))
