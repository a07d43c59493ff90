"""Phase and amplitude of the mirror, the twin of ``rtl/mirror/mirror_phase.sv``.

VR-SCAN IV-D and IV-G2: the middle of two crossings of the index mark gives the phase, half their
distance gives the amplitude. A table holds both for the motion (12) with its harmonics.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vrscan.clocked.idle import MOST_IDLE
from vrscan.data import pkg
from vrscan.data.arrays import Ints
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.registers.settings import PhaseSettings

FINE_WIDTH = 15  # bits of the average below those of the amplitude: ``FineWidth``
HALF_WIDTH = 28  # bits of half the distance
HALF_FRACTION = 29
TABLE_SIZE = 1 << pkg.AMPLITUDE_TABLE_BITS
FRACTION_WIDTH = HALF_WIDTH - 1 - pkg.AMPLITUDE_TABLE_BITS  # ``FractionWidth``

_PRODUCT = multiply_latency(pkg.WORD_WIDTH + 1, FRACTION_WIDTH + 1)
OUTWARD_CLKS = _PRODUCT + 3  # clocks from an outward crossing to the next one that is not ignored
LATENCY = 3 * _PRODUCT + 23  # clocks from an inward crossing's valid_i to valid_o
FIRST_READ = _PRODUCT + 6  # clocks from valid_i to the read of entry i; entry i + 1 is read next
_TURN_MASK = (1 << pkg.TURN_WIDTH) - 1
_WORD_MAX = (1 << pkg.WORD_WIDTH) - 1


def _signed(value: int, width: int) -> int:
    """Return the low bits of a number as two's complement."""
    return ((value + (1 << (width - 1))) & ((1 << width) - 1)) - (1 << (width - 1))


def _rounded(value: int, shift: int) -> int:
    """Return value / 2**shift, to nearest, half up."""
    return (value + (1 << shift >> 1)) >> shift


@dataclass(frozen=True)
class Interpolated:
    """The table's values for half distances; arrays of their shape.

    Attributes:
        amplitude: Amplitudes, turns, 28 fraction bits; u26, int64.
        midpoint: Midpoints, turns, 28 fraction bits; s28, wraps, int64.
    """

    amplitude: Ints
    midpoint: Ints


def interpolated(half: Ints, amplitude: Ints, midpoint: Ints) -> Interpolated:
    """Return amplitude and midpoint from the table exactly as the hardware rounds them.

    Args:
        half: Half distances, turns, 29 fraction bits, u28; from a quarter turn on the last entry
            holds. Any shape.
        amplitude: The table's amplitudes [1024], u26; entry i is for i / 4096 turns.
        midpoint: The table's midpoints [1024], s28.
    """
    half = np.asarray(half, np.int64)
    outside = half >> (HALF_WIDTH - 1) != 0
    index = np.where(outside, TABLE_SIZE - 1, (half >> FRACTION_WIDTH) & (TABLE_SIZE - 1))
    following = np.minimum(index + 1, TABLE_SIZE - 1)
    fraction = half & ((1 << FRACTION_WIDTH) - 1)
    bias = 1 << (FRACTION_WIDTH - 1)

    rise = amplitude[following] - amplitude[index]
    step = (midpoint[following] - midpoint[index] + (1 << 27)) % (1 << 28) - (1 << 27)
    middle = midpoint[index] + ((step * fraction + bias) >> FRACTION_WIDTH)
    return Interpolated(
        amplitude=amplitude[index] + ((rise * fraction + bias) >> FRACTION_WIDTH),
        midpoint=(middle + (1 << 27)) % (1 << 28) - (1 << 27),
    )


class _Pair(NamedTuple):
    """A pair in work: the clock of its inward crossing, distance and middle in 2**-48 turns."""

    clock: int
    distance: int
    middle: int


class MirrorPhase:
    """Clock-accurate tracker. A new one is in the state after a reset, with a table of zeros.

    Args:
        settings: The configuration ports.

    Attributes:
        phase: Phase of the current clock, turns, 48 fraction bits, u48.
        increment: Advance of the phase per clock, u40.
        valid: Whether there is a new measurement; the next three are those of the last one.
        measured: Measured amplitude, turns, 28 fraction bits, u26.
        error: Middle of the crossings less the table's, turns, 28 fraction bits, s28.
        acquired: Whether the whole error was corrected at once, or will be because the table is
            another one.
        amplitude: Averaged amplitude; u26.
        tracking: Whether there was a measurement since the reset.
        table_amplitude, table_midpoint: The table, lists of 1024; a reset does not change it.
    """

    def __init__(self, settings: PhaseSettings) -> None:
        self.phase = 0
        self.increment = 0
        self.valid = False
        self.measured = 0
        self.amplitude = 0
        self.error = 0
        self.tracking = False
        self.acquired = False
        self.table_amplitude = [0] * TABLE_SIZE
        self.table_midpoint = [0] * TABLE_SIZE

        self._settings = settings
        self._clock = 0
        self._free = 0  # first clock in which a crossing is taken
        self._first: int | None = None  # phase of the outward crossing of an open pair
        self._pair: _Pair | None = None
        self._due = 0  # clock of the next step in processing the pair
        self._half = 0
        self._entries: list[tuple[int, int]] = []
        self._average = 0
        self._anew = False  # the next pair is taken as the first one is

    def step(
        self,
        *,
        valid: bool = False,
        outward: bool = False,
        age: int = 0,
        broken: bool = False,
        word: int = 0,
        table_write: bool = False,
        table_index: int = 0,
        table_amplitude: int = 0,
        table_midpoint: int = 0,
        renew: bool = False,
    ) -> None:
        """Take the ports of one clock and advance to the next; names and formats are the ports'."""
        clock = self._clock
        self._clock = clock + 1
        self.valid = self.acquired = False
        phase, increment = self.phase, self.increment
        self.phase = (phase + increment) & _TURN_MASK
        if not self.tracking:
            self.increment = word
        if self._pair is not None and clock == self._due:
            self._work(self._pair, increment, word)
        if table_write:
            self.table_amplitude[table_index] = table_amplitude
            self.table_midpoint[table_index] = table_midpoint
        if broken or renew:
            self._first = None
        if renew:
            self._pair, self._anew, self._free = None, True, clock + 1
            self.valid, self.acquired = False, True
        if not valid or clock < self._free:
            return
        position = (phase - _rounded(increment * age, pkg.SUB_WIDTH)) & _TURN_MASK
        if outward:
            self._first = position
            self._free = clock + OUTWARD_CLKS
        elif self._first is not None:
            distance = (position - self._first) & _TURN_MASK
            self._pair = _Pair(clock, distance, self._first + (distance >> 1))
            self._first = None
            self._half = min(_rounded(distance, pkg.TURN_WIDTH - HALF_WIDTH), (1 << HALF_WIDTH) - 1)
            self._entries = []
            self._due = clock + FIRST_READ
            self._free = clock + LATENCY

    def _work(self, pair: _Pair, increment: int, word: int) -> None:
        """Read an entry, then the next one, then correct."""
        outside = self._half >> (HALF_WIDTH - 1) != 0
        if len(self._entries) < 2:
            index = TABLE_SIZE - 1 if outside else self._half >> FRACTION_WIDTH
            index = min(index + len(self._entries), TABLE_SIZE - 1)
            self._entries.append((self.table_amplitude[index], self.table_midpoint[index]))
            self._due = self._due + 1 if len(self._entries) < 2 else pair.clock + LATENCY - 1
            return
        (amplitude, midpoint), (next_amplitude, next_midpoint) = self._entries
        fraction = self._half & ((1 << FRACTION_WIDTH) - 1)
        rise = _signed(next_midpoint - midpoint, pkg.MIDPOINT_WIDTH)
        measured = amplitude + _rounded((next_amplitude - amplitude) * fraction, FRACTION_WIDTH)
        midpoint += _rounded(rise * fraction, FRACTION_WIDTH)
        below = pkg.TURN_WIDTH - pkg.ERROR_WIDTH
        error = _signed(pair.middle - (midpoint << below), pkg.TURN_WIDTH)
        rounded = min(_rounded(error, below), (1 << (pkg.ERROR_WIDTH - 1)) - 1)

        settings = self._settings
        if not self.tracking or self._anew or abs(rounded) > settings.error_limit:
            self.acquired, self._anew = True, False
            correction = error
            self.increment = word
            self._average = measured << FINE_WIDTH
        else:
            correction = _rounded(error, settings.phase_shift)
            faster = increment - _rounded(error, settings.rate_shift)
            self.increment = min(max(faster, 0), _WORD_MAX)
            gap = (measured << FINE_WIDTH) - self._average
            self._average += _rounded(gap, settings.amplitude_shift)
        self.phase = (self.phase - correction) & _TURN_MASK
        self.tracking = self.valid = True
        self.measured = measured
        self.amplitude = _rounded(self._average, FINE_WIDTH)
        self.error = rounded
        self._pair = None

    def idle(self, *, word: int = 0) -> int:
        """Return for how many clocks without a strobe only the phase would advance."""
        if self.valid or self.acquired or not (self.tracking or word == self.increment):
            return 0
        return MOST_IDLE if self._pair is None else self._due - self._clock

    def skip(self, n: int, *, word: int = 0) -> None:
        """Take ``n`` clocks without a strobe at once; ``n`` is at most what ``idle`` returns."""
        del word
        self._clock += n
        self.phase = (self.phase + n * self.increment) & _TURN_MASK

    def follow(self, n: int, *, advance: int, word: int) -> None:
        """Take ``n`` clocks without a strobe at once, while ``word`` changes, before any tracking.

        Args:
            n: Number of clocks, at most what ``idle`` returns with the present increment as
                ``word``.
            advance: Sum of the increments: the present one and all words but the last.
            word: Last of the words.
        """
        self._clock += n
        self.phase = (self.phase + advance) & _TURN_MASK
        self.increment = word
