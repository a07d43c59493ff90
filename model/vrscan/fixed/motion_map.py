"""The mirror's harmonics at the phase of its drive, the twin of ``rtl/mirror/motion_map.sv``.

VR-SCAN V-B: the harmonics of the motion (12) depend slightly on the phase of the drive against the
mirror. Here a_k and phi_k are linear in it.
"""

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Ints
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.multiply import multiply
from vrscan.registers.settings import MotionSettings

D_WIDTH = pkg.PHASE_WIDTH - 1  # ``DWidth``
LATENCY = (
    2 * pkg.HARMONIC_COUNT * (multiply_latency(D_WIDTH, pkg.SLOPE_MOTION_WIDTH) + 3) + 4
)  # clocks from valid_i to the outputs, with busy_i low

_COMMIT = LATENCY - 1
_OFFSET_DROP = pkg.TURN_WIDTH - pkg.PHASE_WIDTH
_MOTION_DROP = pkg.MOTION_SLOPE_FRACTION + pkg.PHASE_WIDTH - pkg.MOTION_FRACTION
_PHI_DROP = pkg.PHI_SLOPE_FRACTION
_QUARTER = 1 << (pkg.PHASE_WIDTH - 2)
_MOTION_END = 1 << (pkg.MOTION_WIDTH - 1)
_SLOPE_END = 1 << (pkg.SLOPE_MOTION_WIDTH - 1)
_TURN = 1 << pkg.PHASE_WIDTH
# Range of the arguments with one value per harmonic: the least value, and the largest + 1.
_HARMONICS = {
    "a": (-_MOTION_END, _MOTION_END),
    "phi": (0, _TURN),
    "da": (-_SLOPE_END, _SLOPE_END),
    "dphi": (-_SLOPE_END, _SLOPE_END),
}


def _change(d: Ints, slope: Ints, drop: int) -> Ints:
    # To nearest, half up.
    product = multiply(d, slope, a_width=D_WIDTH, b_width=pkg.SLOPE_MOTION_WIDTH)
    return (product + (1 << (drop - 1))) >> drop


def motion_map(
    offset: Ints | int, drive_phase: Ints | int, a: Ints, phi: Ints, da: Ints, dphi: Ints
) -> tuple[Ints, Ints, Ints]:
    """Return the harmonics at a phase of the drive, exactly as the hardware rounds them.

    Args:
        offset: Phase of the drive less that of the mirror, turns, 48 fraction bits, u48. Any shape.
        drive_phase: The offset at which ``a`` and ``phi`` hold, turns, 28 fraction bits, u28;
            broadcast against ``offset``.
        a: a_k at ``drive_phase``, 22 fraction bits, s24; the last axis is the harmonic, the others
            are broadcast against ``offset``.
        phi: phi_k at ``drive_phase``, turns, 28 fraction bits, u28, [..., 9] like ``a``.
        da: Change of a_k per turn of the drive, 22 fraction bits, s24, [..., 9].
        dphi: Change of phi_k, turns per turn, 16 fraction bits, s24, [..., 9].

    Returns:
        a_k and phi_k, int64 [..., 9] in the formats of ``a``, which saturates, and ``phi``, which
        wraps; and the drive's phase less ``drive_phase``, turns, 28 fraction bits, s28, modulo half
        a turn within -1/4 <= d < 1/4.

    Raises:
        ValueError: if an argument does not fit in its format or there are not 9 harmonics.
    """
    offset, drive_phase = np.asarray(offset, np.int64), np.asarray(drive_phase, np.int64)
    a, phi, da, dphi = (np.asarray(v, np.int64) for v in (a, phi, da, dphi))
    values = {"a": a, "phi": phi, "da": da, "dphi": dphi}
    for name, value in values.items():
        if value.shape[-1:] != (pkg.HARMONIC_COUNT,):
            raise ValueError(f"motion_map: {name} must end in an axis of {pkg.HARMONIC_COUNT}")
    limits = {"offset": (0, 1 << pkg.TURN_WIDTH), "drive_phase": (0, _TURN), **_HARMONICS}
    for name, value in {"offset": offset, "drive_phase": drive_phase, **values}.items():
        low, high = limits[name]
        if value.size and (value.min() < low or value.max() >= high):
            raise ValueError(f"motion_map: {name} is outside {low} to {high - 1}")
    rounded = (offset + (1 << (_OFFSET_DROP - 1))) >> _OFFSET_DROP
    # The sign of D_WIDTH bits.
    d = ((rounded - drive_phase + _QUARTER) & (2 * _QUARTER - 1)) - _QUARTER
    each = d[..., None]
    motion = np.clip(a + _change(each, da, _MOTION_DROP), -_MOTION_END, _MOTION_END - 1)
    return motion, (phi + _change(each, dphi, _PHI_DROP)) & (_TURN - 1), d


class MotionMap:
    """Clock-accurate map; a new one is in the state after a reset.

    Args:
        settings: The values of the configuration ports.

    Attributes:
        a: a_k, k = 1, 3 .. 17; s24, 22 fraction bits.
        phi: phi_k; u28, turns, 28 fraction bits.
        renewing: Whether all is worked out anew for other settings.
    """

    def __init__(self, settings: MotionSettings) -> None:
        self.settings = settings
        self.a = settings.motion_a
        self.phi = settings.motion_phi
        self._age = 0  # clocks since valid, 0 when idle; stops while the results wait
        self._offset = 0
        self._known = False  # an offset has come
        self.renewing = False

    def step(self, *, valid: bool, offset: int, busy: bool, renew: bool = False) -> None:
        """Advance by one clock."""
        if self._age == _COMMIT:
            if not busy or self.renewing:
                self._age = 0
                self.renewing = False
                self._commit()
        elif self._age:
            self._age += 1
        if renew and self._known:
            self._age, self.renewing = 1, True
        if valid:
            self._age = 1
            self._offset, self._known = offset, True

    def _commit(self) -> None:
        given = self.settings
        a, phi, _ = motion_map(
            self._offset,
            given.drive_phase,
            np.array(given.motion_a),
            np.array(given.motion_phi),
            np.array(given.motion_da),
            np.array(given.motion_dphi),
        )
        self.a = tuple(a.tolist())
        self.phi = tuple(phi.tolist())
