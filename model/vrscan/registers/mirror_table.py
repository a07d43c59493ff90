"""The tracker's table, from an index mark's angle and the motion's harmonics."""

import math

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints
from vrscan.data.errors import InputError
from vrscan.ideal.motion import Harmonics, crossings

ENTRIES = 2**pkg.AMPLITUDE_TABLE_BITS
ENTRIES_PER_TURN = 4 * ENTRIES


def amplitude_table(mark_rad: float, harmonics: Harmonics) -> tuple[Ints, Ints]:
    """Return amplitude and midpoint for half distances of i / 4096 turns.

    Args:
        mark_rad: Angle of the index mark; negative for one on the other side.
        harmonics: Pairs [a_k, phi_k], rad, [1 to 9, 2].

    Returns:
        Amplitude [1024], turns, 28 fraction bits, unsigned 26 bits, rising with i, at its largest
        value from where it would be above a quarter of a turn; and midpoint [1024], turns, 28
        fraction bits, signed 28 bits: the phase of (12) halfway between the crossings.

    Raises:
        InputError: naming ``mirror.harmonics`` or ``mirror.index_deg``, if two amplitudes have the
            same half distance, a midpoint is nowhere near a turning point, or the mark is zero.
    """
    half = np.arange(ENTRIES) / ENTRIES_PER_TURN
    try:
        amplitude, middle = crossings(half, mark_rad, harmonics)
    except ValueError as error:
        raise InputError(f"mirror.harmonics, mirror.index_deg: {error}") from error
    top = 2**pkg.AMPLITUDE_WIDTH - 1
    steps = np.minimum(amplitude / (2.0 * np.pi) * 2.0**pkg.AMPLITUDE_FRACTION, top)
    if np.any(np.diff(steps) < 0.0):
        raise InputError("mirror.harmonics: too large: two amplitudes have the same index times")
    one = 2**pkg.MIDPOINT_WIDTH
    turns = np.floor(middle * one + 0.5).astype(np.int64)
    return np.floor(steps + 0.5).astype(np.int64), (turns + one // 2) % one - one // 2


def pulse_table(phase_turns: float, amplitude_turns: float) -> tuple[Ints, Ints]:
    """Return the table of a polygon: however long the pulse of its diode, its middle is one phase.

    Args:
        phase_turns: Phase of the beam in the middle of the diode.
        amplitude_turns: The amplitude, which nothing changes.
    """
    amplitude = math.floor(amplitude_turns * 2.0**pkg.AMPLITUDE_FRACTION + 0.5)
    one = 2**pkg.MIDPOINT_WIDTH
    middle = (math.floor(phase_turns * one + 0.5) + one // 2) % one - one // 2
    return np.full(ENTRIES, amplitude, np.int64), np.full(ENTRIES, middle, np.int64)


def interpolation_bound(half: Floats, mark_rad: float, harmonics: Harmonics) -> Floats:
    """Return the largest distance of a straight line between entries from the amplitude, turns.

    An eighth of the entries' distance squared times the second derivative, here taken from three
    amplitudes around the interval that holds each ``half``; half a step of rounding is added.

    Args:
        half: Half distances, turns [n], at least one entry away from both ends.
        mark_rad: Angle of the index mark, as in ``amplitude_table``.
        harmonics: Harmonics as in ``amplitude_table``.
    """
    step = 1.0 / ENTRIES_PER_TURN
    first = np.floor(half / step) * step
    ends = [crossings(first + k * step, mark_rad, harmonics)[0] for k in range(-1, 3)]
    curve = np.maximum(ends[0] - 2 * ends[1] + ends[2], ends[1] - 2 * ends[2] + ends[3])
    return np.asarray(curve / 8.0 / (2.0 * np.pi) + 2.0 ** -(pkg.AMPLITUDE_FRACTION + 1))
