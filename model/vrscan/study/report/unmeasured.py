"""Why a scan has no point at all: said in a line instead of errors of 0 px."""

import math

import numpy as np

from vrscan.engines.engine import Engine, run
from vrscan.scene.doubts import doubts
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import Scanner
from vrscan.study.report.link_budget import Link, link_budget

_LINES = 512  # lines that are looked at
_COMMON = 0.5  # share of the lines whose flag is the cause
_DIM = "LOW_SNR"


def unmeasured(light: Light, count: int) -> str:
    """Return a line of text that says that a scan has no point, and why.

    The cause is what most of its lines say whose spot the camera sees; up to ``_LINES`` of them,
    from all over the scan, are rendered with all effects. Values that hardly anybody means follow.

    Args:
        light: The scene and the instrument.
        count: Number of lines of the scan.

    Raises:
        InputError: if the camera sees none of the lines.
    """
    whole = [f"because {_cause(light, count)}", *doubts(light)]
    return f"{light.scene.source}: nothing was measured: no line has a point, {'; '.join(whole)}"


def _cause(light: Light, count: int) -> str:
    links = [link for link in link_budget(light, count) if link is not None]
    if not any(link.peak_e > 0.0 for link in links):
        return "no light of the laser comes back to the sensor"
    numbers = np.unique(np.linspace(0, count - 1, min(count, _LINES)).round().astype(np.int64))
    scanner = Scanner(light, count, frozenset(present(light.scene)))
    frame = scanner.some(numbers)
    points = run(Engine.FIXED, scanner.recorded(frame), light.belief)
    seen = np.isfinite(frame.truth.position_px)
    least = _COMMON * max(int(seen.sum()), 1)
    often = [name for name, flag in points.flags.items() if int(flag[seen].sum()) >= least]
    if {"OUT_OF_RANGE", "NO_RANGE"} & set(often):
        return f"what they measure is farther away than {light.belief.geometry.range_mm:g} mm"
    best = max(links, key=lambda link: link.peak_e / _noise(link))
    dim = best.peak_e < light.config.peak.snr_min * _noise(best)
    if often and not (dim and _DIM in often):
        return f"most lines are {' and '.join(often)}"
    return _dimness(best, light)


def _noise(link: Link) -> float:
    """Return the noise of a pixel without the spot, electrons."""
    return math.sqrt(link.dark_rms_e**2 + link.background_e)


def _dimness(link: Link, light: Light) -> str:
    """Return how far the best spot is from a point, and what is unusual about it."""
    noise = _noise(link)
    text = (
        f"the spots are too dim: the best, at z = {link.z_mm:.5g} mm, has {link.peak_e:.2g} "
        f"electrons in its brightest pixel, {link.peak_e / noise:.2g} times the noise of a pixel "
        f"without it, and a point needs {light.config.peak.snr_min:g} times"
    )
    if link.sigma_px > light.config.peak.max_core:
        text += f"; its sigma is {link.sigma_px:.0f} px"
    if link.background_e > link.dark_rms_e**2:
        text += f"; sun and lamps put {link.background_e:.0f} electrons into a pixel"
    return text
