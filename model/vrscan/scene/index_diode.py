"""The photodiode of the index, VR-SCAN IV-D and IV-F: photocurrents, comparator and threshold.

The beam is Gaussian across the diode, and the current of each field is the light that falls on it.
Two fields meet at the mark: the comparator changes where their currents are equal, and counts while
the gate is open, which is while their sum is above a threshold. A polygon's diode has one field,
whose current the comparator compares with that threshold.

The threshold is fixed, or it follows the preceding passes: a peak detector takes the largest
current of a pass above the ambient light, and a hold a quarter of its difference to this peak when
the pass is over; the threshold is a share of the hold, and at least the fixed one. Angles are
counted from the mark, away from angle 0. ``tb/devices/index_diode.sv`` is the same diode for the
virtual board.

It leaves out noise, and the bandwidth of amplifiers and comparator, which delays every pass by the
same time.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import erf

from vrscan.data.arrays import Floats
from vrscan.data.config import Config

WEIGHT = 0.25  # of a pass in the hold
SKIRT = 3.0  # radii of the beam, beyond which there is no light


@dataclass(frozen=True)
class IndexDiode:
    """A photodiode, its comparator and its threshold; light is in mW of the laser.

    Attributes:
        width_rad: Half width of the diode; the scan angle is counted, not the mirror's.
        beam_rad: Radius of the beam on the diode, to 1/e^2.
        ambient_mw: Other light on the diode, half of it on each field.
        threshold_mw: The fixed threshold, or the least one.
        threshold_share: Share of the hold that is the threshold; 0 for a fixed one of all light.
        hold_s: Time constant with which the hold runs down.
        fields: Number of fields, 2 or 1.
        mismatch: Relative difference in response of the outer and the inner field.
    """

    width_rad: float
    beam_rad: float
    ambient_mw: float
    threshold_mw: float
    threshold_share: float
    hold_s: float
    fields: int = 2
    mismatch: float = 0.0

    @classmethod
    def of(cls, config: Config) -> "IndexDiode":
        """Return the diode of a configuration's ``[mems]``."""
        mems = config.mems
        return cls(
            width_rad=math.radians(mems.diode_deg),
            beam_rad=math.radians(mems.beam_deg),
            ambient_mw=mems.ambient_mw,
            threshold_mw=mems.threshold_mw,
            threshold_share=mems.threshold_share,
            hold_s=mems.hold_s,
            fields=1 if config.mirror.polygon else 2,
        )

    def currents(self, angle_rad: Floats, light_mw: float) -> tuple[Floats, Floats]:
        """Return the currents of the outer and of the inner field, mW, of any shape."""
        edges = (self.width_rad, 0.0, -self.width_rad)
        beyond = [
            0.5 * (1.0 + erf(math.sqrt(2.0) * (edge - angle_rad) / self.beam_rad)) for edge in edges
        ]
        outer, inner = beyond[0] - beyond[1], beyond[1] - beyond[2]
        half = 0.5 * self.ambient_mw
        return (
            np.asarray((1.0 + 0.5 * self.mismatch) * (light_mw * outer + half)),
            np.asarray((1.0 - 0.5 * self.mismatch) * (light_mw * inner + half)),
        )

    def threshold(self, held_mw: float) -> float:
        """Return the threshold of all light, mW, for what the hold has."""
        if self.threshold_share == 0.0:
            return self.threshold_mw
        return self.ambient_mw + max(self.threshold_mw, self.threshold_share * held_mw)

    def peak(self, light_mw: float) -> float:
        """Return the largest current of a pass above the ambient light, mW."""
        return float(sum(self.currents(np.zeros(()), light_mw))) - self.ambient_mw

    def half_width_rad(self, light_mw: float, threshold_mw: float) -> float:
        """Return how far from the mark the current is above a threshold; 0 nowhere, inf always."""

        def above(angle: float) -> float:
            return float(sum(self.currents(np.asarray(angle), light_mw))) - threshold_mw

        far = self.width_rad + SKIRT * self.beam_rad
        if self.ambient_mw >= threshold_mw:
            return math.inf
        if above(0.0) <= 0.0:
            return 0.0
        return far if above(far) > 0.0 else float(brentq(above, 0.0, far, xtol=1e-13))

    def settled_half_width_rad(self, light_mw: float) -> float:
        """Return ``half_width_rad`` behind many passes with the same light."""
        return self.half_width_rad(light_mw, self.threshold(self.peak(light_mw)))

    def crossing_rad(self, light_mw: float) -> float:
        """Return where the currents of two fields are equal; NaN where they never are."""

        def outer(angle: float) -> float:
            pair = self.currents(np.asarray(angle), light_mw)
            return float(pair[0] - pair[1])

        # The difference rises between the middles of the fields.
        half = 0.5 * self.width_rad
        if not outer(-half) < 0.0 < outer(half):
            return math.nan
        return float(brentq(outer, -half, half, xtol=1e-13))


def passes(diode: IndexDiode, time_s: Floats, light_mw: Floats) -> Floats:
    """Return how far from the mark each pass is seen, ``half_width_rad``, [n].

    Args:
        diode: The diode, whose hold is empty at first.
        time_s: Times of the passes, rising, [n].
        light_mw: Light of each pass, [n].
    """
    held, before = 0.0, 0.0
    seen = np.empty(len(time_s))
    for k, (time, light) in enumerate(zip(time_s.tolist(), light_mw.tolist(), strict=True)):
        held *= math.exp((before - time) / diode.hold_s)
        before = time
        threshold = diode.threshold(held)
        seen[k] = diode.half_width_rad(light, threshold)
        if 0.0 < seen[k] < math.inf:
            held += WEIGHT * (diode.peak(light) - held)
    return seen
