"""Scatter of noisy positions, compared with the phase law and with the predicted sigma.

These figures have no limit: they show how well the noise is understood.
"""

import math

import numpy as np

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.residuals import rms
from vrscan.engines.engine import Engine, run
from vrscan.fixed.peak_position import peak_position
from vrscan.fixed.phase_correlate import phase_correlate
from vrscan.study.report.efficiency import LOST_PX, PEAKS, SIGMAS_PX, cell_lines, with_window
from vrscan.study.report.figure import SEED, Figure

LAW = 0.1125  # std(delta) = LAW T / snr1, snr1 = |P1| / (sqrt(N) sigma_n): white noise, T = N
GROUP = "scatter of positions"
PIXEL_WIDTH = 12


def law_ratio(
    width: int, snr1: float, count: int, draw: np.random.Generator
) -> tuple[float, float]:
    """Return the scatter over the law, and the part that the output's own rounding adds to it.

    Args:
        width: Number of pixels N of the window; the spot's sigma is a sixth of it.
        snr1: Signal-to-noise ratio of the first harmonic.
        count: Number of windows.
        draw: Source of positions and white noise.
    """
    place = np.arange(width)
    centre = width / 2.0 + draw.uniform(-0.5, 0.5, count)
    spot = 2000.0 * np.exp(-0.5 * ((place - centre[:, None]) / (width / 6.0)) ** 2)
    harmonic = np.abs((spot * np.exp(2j * np.pi * place / width)).sum(axis=1))
    noise = harmonic / (snr1 * math.sqrt(width))
    pedestal = math.ceil(6.0 * float(noise.max()))
    level = pedestal + spot + noise[:, None] * draw.standard_normal(spot.shape)
    pixels = np.clip(np.rint(level), 0, (1 << PIXEL_WIDTH) - 1).astype(np.uint16)
    found = phase_correlate(
        pixels,
        left=np.zeros(count, np.int64),
        width=np.full(count, width),
        background=np.zeros(count, np.int64),
        measured=np.ones(count, np.bool_),
        pixel_width=PIXEL_WIDTH,
        period_n=True,
    )
    step = 2.0**-pkg.POSITION_FRACTION
    length = Config().sensor.line_length
    left = np.zeros(count, np.int64)
    position = peak_position(left, found.period, found.phase, line_length=length) * step
    true = np.angle((spot * np.exp(2j * np.pi * place / width)).sum(axis=1)) % (2.0 * np.pi)
    error = position - true * width / (2.0 * np.pi)
    error = (error + width / 2.0) % width - width / 2.0
    law = LAW * width / snr1
    return rms(error) / law, step / math.sqrt(12.0) / law


def measure(count: int) -> list[Figure]:
    """Return scatter over law, and scatter over predicted sigma for whole noisy lines.

    Args:
        count: Number of windows and lines of each kind.
    """
    draw = np.random.default_rng([SEED, 5])
    figures = []
    for width in (8, 16, 31, 64, 255):
        ratio, floor = law_ratio(width, 30.0, 20 * count, draw)
        name = f"over 0.1125 T / snr1, N = {width}, snr1 = 30"
        figures.append(Figure(GROUP, name, "1", ratio, floor=floor))
    config = with_window(Config(), "threshold")  # a fit's sigma allows for a little speckle
    for sigma_px in SIGMAS_PX:
        for peak in (PEAKS[0], PEAKS[-1]):
            lines, true, _ = cell_lines(sigma_px, peak, count, config)
            result = run(Engine.FIXED, lines, config)
            error = result.position_px - true
            good = result.measured & (np.abs(error) <= LOST_PX)
            ratio = rms(error[good]) / rms(result.sigma_px[good])
            name = f"over predicted sigma, spot of {sigma_px:g} px at {100 * peak:.0f} %"
            figures.append(Figure(GROUP, name, "1", ratio))
    return figures
