"""VR-SCAN's equations as printed, in float64, without handling of what they leave undefined.

They use row mean and deviation from plain sums (III-E, IV-G 1), a threshold one deviation above the
mean, (8) with T = N - 1 on raw pixels, and (5), (4) and (3) with their tangents. Sums of the window
run in the order of the pixels and use the C library's functions, so the same rounding results
everywhere.
"""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Pixels
from vrscan.data.config import Config, Geometry
from vrscan.ideal import geometry as ideal
from vrscan.study.cases.case_errors import NO_PEAK, NO_WINDOW, PHANTOM, ZERO_PERIOD, ZERO_SNR, Value
from vrscan.study.cases.case_line import Line
from vrscan.study.report.efficiency import as_printed


@dataclass(frozen=True)
class Place:
    """The result for a line: a position, px, or a word for why there is none."""

    position: Value
    snr: float


def naive_deviation(pixels: Pixels) -> tuple[float, float]:
    """Return mean and standard deviation from the sums of p and p^2, as for a stream.

    The sums are of integers below 2^53 and therefore exact; their difference is not.
    """
    values = pixels.astype(np.int64)
    count = float(len(values))
    mean = float(values.sum()) / count
    variance = float((values * values).sum()) / count - mean * mean
    return mean, math.sqrt(variance) if variance >= 0.0 else math.nan


def first_harmonic(window: list[float]) -> float:
    """Return delta of (8), px from the window's left edge; NaN where it is 0/0."""
    period = len(window) - 1
    if period == 0:
        return math.nan  # t = 0/0
    x = y = 0.0
    for k, pixel in enumerate(window):
        angle = 2.0 * math.pi * (k / period)
        x += pixel * math.cos(angle)
        y += pixel * math.sin(angle)
    delta = math.atan2(y, x) * period / (2.0 * math.pi)
    return delta if delta >= 0.0 else delta + period


def place(pixels: Pixels) -> Place:
    """Return the position of a line's peak.

    Args:
        pixels: Counts [length].
    """
    peak = as_printed(Config()).peak
    mean, deviation = naive_deviation(pixels)
    maximum = int(pixels.max())
    with np.errstate(divide="ignore", invalid="ignore"):
        snr = float((np.float64(maximum) - mean) / np.float64(deviation))
    if math.isnan(snr):
        return Place(ZERO_SNR, snr)
    if snr < peak.snr_min:
        return Place(NO_PEAK, snr)
    threshold = mean + peak.k_noise * deviation
    above = pixels > threshold
    first = int(pixels.argmax())
    if not above[first]:
        return Place(NO_WINDOW, snr)
    left, right = first, first
    while left > 0 and above[left - 1]:
        left -= 1
    while right + 1 < len(pixels) and above[right + 1]:
        right += 1
    delta = first_harmonic([float(p) for p in pixels[left : right + 1]])
    return Place(ZERO_PERIOD if math.isnan(delta) else left + delta, snr)


def position_error(found: Place, line: Line) -> Value:
    """Return the distance of the printed position from the spot, px, or a word instead."""
    if isinstance(found.position, str):
        return found.position
    right = line.true if line.true is not None else line.position
    return PHANTOM if right is None else abs(found.position - right)


def point(position_px: float, angle_rad: float, geometry: Geometry) -> tuple[float, float]:
    """Return (x, z) of a position, mm, by (5), (4) and (3) as printed.

    Args:
        position_px: Position on the sensor.
        angle_rad: Scan angle.
        geometry: The triangle; (5) is used as printed, even, whatever the geometry selects.
    """
    even = geometry.model_copy(update={"distortion": "even"})
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u, _ = ideal.undistorted(np.array(position_px), even)
        x, z = ideal.triangle_printed(u, np.array(angle_rad), even)
    return float(x), float(z)
