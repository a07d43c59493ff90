"""The index photodiode: when it sees the beam, against the laser's power and ambient light.

The currents' oracle is a sum over the beam's profile on a fine grid, the motion's a cosine. The
table of docs/bring-up.md has the figures.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.scene.index_diode import IndexDiode, passes

CONFIG = Config()
DIODE = IndexDiode.of(CONFIG)
FIXED = replace(DIODE, threshold_mw=0.5, threshold_share=0.0)
AMPLITUDE = math.radians(CONFIG.mirror.amplitude_deg)
MARK = math.radians(CONFIG.mirror.index_deg)
TURN_PER_S = 2.0 * math.pi * CONFIG.mirror.frequency_hz
POLYGON_RAD_PER_S = math.radians(240.0 * 60.0)  # the preset's: 240 facets of 60 degrees
MISMATCH = 0.01
LIGHTS = [(1.0, 0.0), (0.25, 0.0), (50.0, 0.0), (1.0, 0.1), (1.0, 1.0), (0.25, 0.1)]  # mW, mW
PAGE = Path(__file__).parents[2] / "docs" / "bring-up.md"


def quadrature(diode: IndexDiode, angle: float, light: float) -> tuple[float, float]:
    """Return the currents of outer and inner field: strips of the beam's profile, summed up."""
    edges = np.linspace(0.0, diode.width_rad, 20_001)
    middles = 0.5 * (edges[1:] + edges[:-1])

    def field(where: Floats) -> float:
        density = np.exp(-2.0 * ((where - angle) / diode.beam_rad) ** 2)
        total = diode.beam_rad * math.sqrt(math.pi / 2.0)
        return light * float(density.sum()) * (edges[1] - edges[0]) / total

    half = 0.5 * diode.ambient_mw
    return (
        (1.0 + 0.5 * diode.mismatch) * (field(middles) + half),
        (1.0 - 0.5 * diode.mismatch) * (field(-middles) + half),
    )


def time_ns(angle_rad: float) -> float:
    """Return when the resonant mirror is at an angle from the mark on its way out."""
    return -1e9 * math.acos((MARK + angle_rad) / AMPLITUDE) / TURN_PER_S


@pytest.mark.parametrize("beam_deg", [0.2, 0.5, 1.5])
def test_currents_are_the_light_on_each_field(beam_deg: float) -> None:
    diode = replace(DIODE, beam_rad=math.radians(beam_deg), ambient_mw=0.3, mismatch=0.02)
    for angle in np.radians([-2.5, -1.0, -0.4, 0.0, 0.1, 1.0, 1.7]).tolist():
        got = diode.currents(np.asarray(angle), 1.7)
        assert got == pytest.approx(quadrature(diode, angle, 1.7), abs=1e-7)


@pytest.mark.parametrize(("light", "ambient"), LIGHTS)
def test_two_fields_are_crossed_when_the_light_is_equal(light: float, ambient: float) -> None:
    """In time: of equal fields whatever the light, else moved by the mismatch of all light."""
    for mismatch in (0.0, MISMATCH):
        diode = replace(DIODE, ambient_mw=ambient, mismatch=mismatch)

        def difference(ns: float, diode: IndexDiode = diode) -> float:
            angle = AMPLITUDE * math.cos(TURN_PER_S * 1e-9 * ns) - MARK
            outer, inner = quadrature(diode, angle, light)
            return outer - inner

        middle = time_ns(0.0)
        crossed = float(brentq(difference, middle - 9e3, middle + 9e3, xtol=1e-4)) - middle
        late = time_ns(diode.crossing_rad(light)) - middle
        print(f"{light} mW, {ambient} mW ambient, mismatch {mismatch}: {late:.3f} ns")
        assert late == pytest.approx(crossed, abs=0.01)
        assert abs(late) < 0.01 if mismatch == 0.0 else abs(late) > 50.0


@pytest.mark.parametrize(("light", "ambient"), LIGHTS)
def test_a_field_is_seen_where_its_light_is_the_threshold(light: float, ambient: float) -> None:
    for diode in (replace(FIXED, ambient_mw=ambient), replace(DIODE, ambient_mw=ambient)):
        threshold = diode.threshold(diode.peak(light))
        seen = diode.half_width_rad(light, threshold)
        if 0.0 < seen < math.inf:
            assert sum(quadrature(diode, seen, light)) == pytest.approx(threshold, abs=1e-6)
        else:
            brightest, dark = (sum(quadrature(diode, at, light)) for at in (0.0, 1.0))
            assert brightest <= threshold if seen == 0.0 else dark >= threshold


def test_the_threshold_follows_and_the_hold_runs_down() -> None:
    """More light and a little less is seen at once, much less when the hold has run down to it."""
    time = np.arange(3000) / (2.0 * CONFIG.mirror.frequency_hz)
    light = np.where(time < 1.0, 1.0, np.where(time < 2.0, 4.0, 1.0))
    seen = passes(DIODE, time, light)
    settled = DIODE.settled_half_width_rad(1.0)
    wide = seen[(time > 1.0) & (time < 1.003)]
    assert seen[0] > 1.4 * settled and (wide > 1.15 * settled).all()
    # A pass every 2 ms finds the hold at 0.984 of the peak.
    steady = seen[(time > 0.5) & (time < 1.0)].mean()
    assert steady == pytest.approx(settled, rel=0.01)
    for begin, end in ((0.5, 1.0), (1.5, 2.0), (2.9, 3.0)):
        some = seen[(time > begin) & (time < end)]
        assert some == pytest.approx(steady, rel=1e-6)
    blind = (time > 2.0) & (seen == 0.0)
    assert np.ptp(time[blind]) == pytest.approx(DIODE.hold_s * math.log(4.0 * 0.5 / 1.0), abs=0.02)
    assert (passes(DIODE, time, np.where(time < 1.0, 1.0, 0.55)) > 0.0).all()


def cells(light: float, ambient: float) -> list[str]:
    """Return a row of the page's table: three index times after those of 1 mW in the dark."""
    row = [f"{light:g}", f"{ambient:g}"]
    uneven = replace(DIODE, ambient_mw=ambient, mismatch=MISMATCH)
    for diode in (replace(uneven, mismatch=0.0), uneven):
        first = replace(diode, ambient_mw=0.0).crossing_rad(1.0)
        ns = time_ns(diode.crossing_rad(light)) - time_ns(first)
        row.append(f"{ns:.1f} ns, {1e6 * (diode.crossing_rad(light) - first):.1f} µrad")
    for diode in (FIXED, DIODE):
        here = replace(diode, ambient_mw=ambient)
        seen, first = here.settled_half_width_rad(light), diode.settled_half_width_rad(1.0)
        if seen in (0.0, math.inf):
            row.append("always high" if seen else "never high")
        else:
            earlier = seen - first
            row.append(f"{1e6 * -earlier / POLYGON_RAD_PER_S:.2f} µs, {1e3 * earlier:.2f} mrad")
    return [cell.replace("-0.0 ", "0.0 ").replace("-0.00 ", "0.00 ") for cell in row]


def test_the_page_has_the_figures() -> None:
    rows = [f"| {' | '.join(cells(*light))} |" for light in LIGHTS]
    print("\n".join(rows))
    page = PAGE.read_text()
    assert [row for row in rows if row not in page] == []
