"""The triangle: image coordinate and scan angle to (x, z) and back; VR-SCAN (1) to (7).

All functions are elementwise over arrays of any one shape. Lengths are mm, angles rad; the image
coordinate u is measured from the optical axis, u = (x_s - x_M) pitch.
"""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import Geometry
from vrscan.data.errors import InputError


@dataclass(frozen=True)
class ThinLens:
    """The camera's lens and where its sensor stands, mm: the thin lens equation.

    Whatever depends on the cone of light that meets at a pixel follows from ``working``: speckle's
    cells and the diffraction disc are lambda N wide, out of focus the disc is the cone's. The
    image's scale is the f of (4), which a calibration takes up with the focus.
    """

    pupil_mm: float  # diameter
    image_mm: float  # distance from the lens to the sensor
    focus_mm: float  # depth that is in focus

    @classmethod
    def of(cls, f_number: float, focus_mm: float, geometry: Geometry) -> "ThinLens":
        """Return the lens of ``geometry.focal_mm`` that is focused at a depth.

        Args:
            f_number: Focal length over the pupil's diameter, as lenses are marked.
            focus_mm: Depth along the axis that is in focus.
            geometry: The instrument's geometry, whose focal length is used.

        Raises:
            InputError: if the focus is not farther away than the focal length.
        """
        focal = geometry.focal_mm
        if not focus_mm > focal:
            raise InputError(
                f"lens.focus_mm = {focus_mm:g}: no farther than the focal length, {focal:g} mm"
            )
        return cls(focal / f_number, 1.0 / (1.0 / focal - 1.0 / focus_mm), focus_mm)

    @property
    def working(self) -> float:
        """Return the working f-number N = F (1 + m), m the magnification of what is in focus."""
        return self.image_mm / self.pupil_mm


@dataclass(frozen=True)
class Located:
    """The places where rays meet."""

    x: Floats  # mm
    z: Floats  # mm
    slope: Floats  # dz/du, dimensionless
    no_range: Bools  # rays parallel, or meeting behind mirror or camera: x, z, slope are 0


def undistorted(position_px: Floats, geometry: Geometry) -> tuple[Floats, Floats]:
    """Return the corrected image coordinate of VR-SCAN (5), and its slope.

    As printed the correction is even in x_s - x_M; a radial distortion is odd, which is the
    default.

    Args:
        position_px: Position on the sensor, px.
        geometry: Centre, pitch, k1 in mm^-2, k2 in mm^-4, and which of the two forms.

    Returns:
        The coordinate u in mm and du/dx_s in mm/px.
    """
    u = (position_px - geometry.centre_px) * geometry.pitch_mm
    square = np.square(u)
    factor = geometry.k1 * square + geometry.k2 * np.square(square)
    slope = 3.0 * geometry.k1 * square + 5.0 * geometry.k2 * np.square(square)
    sign = np.sign(u) if geometry.distortion == "even" else np.ones_like(u)
    return u * (1.0 + sign * factor), geometry.pitch_mm * (1.0 + sign * slope)


def triangle_printed(u: Floats, angle: Floats, geometry: Geometry) -> tuple[Floats, Floats]:
    """Return (x, z) from VR-SCAN (3) and (4) as printed; not usable near beta = 90 degrees.

    Args:
        u: Corrected image coordinate, mm.
        angle: Scan angle, rad.
        geometry: Base, bias, offset and focal length.
    """
    beta = geometry.bias_rad + np.arctan(u / geometry.focal_mm)  # (4)
    z = (np.tan(beta) * geometry.base_mm + geometry.offset_mm) / (
        1.0 + np.tan(beta) * np.tan(angle)
    )
    return np.tan(angle) * z, z  # (3)


def triangle(u: Floats, angle: Floats, geometry: Geometry) -> Located:
    """Return (x, z) and dz/du: (3) and (4) without their tangents, singular only for parallel rays.

    Multiplied by cos(beta) cos(angle) and f / cos(atan(u / f)), (3) becomes x = n sin(a) / d and
    z = n cos(a) / d with n = B (f sin P + u cos P) + CZ (f cos P - u sin P) and
    d = (f cos P - u sin P) cos(a) + (f sin P + u cos P) sin(a).

    Args:
        u: Corrected image coordinate, mm.
        angle: Scan angle, rad.
        geometry: Base, bias, offset and focal length.
    """
    sine, cosine = np.sin(geometry.bias_rad), np.cos(geometry.bias_rad)
    along = geometry.focal_mm * sine + u * cosine
    across = geometry.focal_mm * cosine - u * sine
    n = geometry.base_mm * along + geometry.offset_mm * across
    d = across * np.cos(angle) + along * np.sin(angle)
    no_range = (n <= 0.0) | (d <= 0.0)  # parallel, or behind mirror or camera
    safe = np.where(no_range, 1.0, d)
    z = np.where(no_range, 0.0, n * np.cos(angle) / safe)
    x = np.where(no_range, 0.0, n * np.sin(angle) / safe)
    dn = geometry.base_mm * cosine - geometry.offset_mm * sine
    dd = cosine * np.sin(angle) - sine * np.cos(angle)
    slope = np.where(no_range, 0.0, (dn * np.cos(angle) - z * dd) / safe)
    return Located(x=x, z=z, slope=slope, no_range=no_range)


def project(x: Floats, z: Floats, geometry: Geometry) -> Floats:
    """Return the position in px at which the camera sees (x, z), from (2), (4) and (5) inverted.

    Points behind the camera, and images that the distortion cannot produce, give NaN.

    Args:
        x: Coordinate along the scan, mm.
        z: Distance from the mirror, mm.
        geometry: The whole geometry.
    """
    beta = np.arctan2(z - geometry.offset_mm, geometry.base_mm - x)
    off_axis = beta - geometry.bias_rad
    seen = np.cos(off_axis) > 0.0
    wanted = geometry.focal_mm * np.tan(np.where(seen, off_axis, 0.0))
    position = wanted / geometry.pitch_mm + geometry.centre_px
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(20):  # Newton; distortion is a few per cent, so it ends after five
            u, slope = undistorted(position, geometry)
            step = (u - wanted) / slope
            position = position - step
            if not np.any(np.abs(step) > 1e-12 * np.abs(position)):
                break
        u, _ = undistorted(position, geometry)
        seen &= np.abs(u - wanted) < 1e-9 * geometry.focal_mm
    return np.where(seen, position, np.nan)


def radial_error(range_mm: Floats, position_error_mm: float, geometry: Geometry) -> Floats:
    """Return e_r = r^2 p_p / (f B) of VR-SCAN (6), mm; scan angle and offset are 0 there.

    Args:
        range_mm: Distance r.
        position_error_mm: Precision p_p on the sensor.
        geometry: The base and focal length.
    """
    return np.square(range_mm) * position_error_mm / (geometry.focal_mm * geometry.base_mm)


def lateral_error(
    range_mm: Floats, position_error_mm: Floats | float, geometry: Geometry
) -> Floats:
    """Return e_l = e_r B / r = r p_p / f of VR-SCAN (6), mm.

    Args:
        range_mm: Distance r.
        position_error_mm: Precision p_p on the sensor.
        geometry: The focal length.
    """
    return np.asarray(range_mm * position_error_mm / geometry.focal_mm)


def angle_precision(
    range_mm: Floats, position_error_mm: Floats | float, geometry: Geometry
) -> Floats:
    """Return the scan angle precision p_a that VR-SCAN (7) asks for, rad.

    Args:
        range_mm: Distance r.
        position_error_mm: Precision p_p on the sensor.
        geometry: The focal length.
    """
    lateral = lateral_error(range_mm, position_error_mm, geometry)
    return np.asarray(np.arctan(lateral / range_mm))
