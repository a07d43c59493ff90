"""Sine and cosine of a binary phase, the twin of ``rtl/trig/quarter_wave.sv``."""

import math
from functools import cache

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Ints
from vrscan.fixed.rom import rom_source

LATENCY = pkg.QUARTER_WAVE_LATENCY  # clocks from valid_i to valid_o

TABLE_BITS = 10
ENTRY_WIDTH = 32
SLOPE_WIDTH = 17  # number of top bits of an entry that are multiplied by d
TURN = 102944  # 2 pi / 8 in 2**-17, an 18-bit operand
_EXTRA = 17  # fraction bits of the angle d, rad, beyond TABLE_BITS; it has 18


def max_step(table_bits: int) -> float:
    """Return the largest d, half a table step, rad."""
    return math.pi / (4 << table_bits)


MAX_STEP = max_step(TABLE_BITS)
LENGTH_ERROR = MAX_STEP * MAX_STEP / 4  # 1.5e-7, length error of the interpolation, either way


def headroom(table_bits: int) -> int:
    """Return k, where 1 - 2**-k of the table's full scale stands for a sine of 1; 15 as shipped.

    With the interpolation's excess of max_step**2 / 2, 2.9e-7 as shipped, the largest result is
    still below 2**15 - 1/2 of 2**15, so it fits from 16 output bits on.
    """
    excess = max_step(table_bits) ** 2 / 2
    return next(k for k in range(15, 0, -1) if (1 - 2.0**-k) * (1 + excess) < 1 - 2.0**-16)


def _peak(table_bits: int, entry_width: int) -> int:
    """Return the entry that stands for a sine of 1."""
    bits = headroom(table_bits)
    return ((1 << bits) - 1) << (entry_width - bits)


@cache
def table(table_bits: int = TABLE_BITS, entry_width: int = ENTRY_WIDTH) -> Ints:
    """Return the quarter wave, int64 [2**table_bits]: entry k is the sine at k + 1/2 steps.

    As shipped a step is a 4096th of a turn, and 1 - 2**-15 stands for a sine of 1, in units of
    2**-32.
    """
    size = 1 << table_bits
    peak = _peak(table_bits, entry_width)
    angles = [(k + 0.5) * (math.pi / 2 / size) for k in range(size)]
    entries = np.array([math.floor(peak * math.sin(a) + 0.5) for a in angles], np.int64)
    entries.flags.writeable = False
    return entries


def amplitude(
    ampl_width: int, table_bits: int = TABLE_BITS, entry_width: int = ENTRY_WIDTH
) -> float:
    """Return the output that stands for a sine of 1, in output steps.

    By the linear interpolation the length of (cosine, sine) grows by d**2 / 2; the middle of that
    range is the amplitude, so the error of the length is +/-LENGTH_ERROR at most.
    """
    length_error = max_step(table_bits) ** 2 / 4
    peak = _peak(table_bits, entry_width)
    return math.ldexp(peak, ampl_width - 1 - entry_width) * (1 + length_error)


def error_bound(ampl_width: int) -> float:
    """Return an output's largest error against ``amplitude * sin``, as shipped, in output steps.

    It is the sum of all roundings, each derived from a width: the interpolation's length error and
    its cubic term, the entry, d and its constant, the cut factor, the cut product, and the output.
    """
    turn_error = abs(TURN / 2**17 * 8 / (2 * math.pi) - 1)
    error = (
        LENGTH_ERROR
        + MAX_STEP**3 / 3
        + 2.0 ** -(ENTRY_WIDTH + 1)
        + 2.0 ** -(TABLE_BITS + _EXTRA + 1)
        + MAX_STEP * turn_error
        + MAX_STEP * 2.0**-SLOPE_WIDTH
        + 2.0**-ENTRY_WIDTH
    )
    return math.ldexp(error, ampl_width - 1) + 0.5


def quarter_wave(
    phase: Ints,
    *,
    phase_width: int,
    ampl_width: int,
    table_bits: int = TABLE_BITS,
    entry_width: int = ENTRY_WIDTH,
) -> tuple[Ints, Ints]:
    """Return sine and cosine of ``phase`` exactly as the hardware rounds them.

    Args:
        phase: Integers in [0, 2**phase_width), in units of one turn / 2**phase_width. Any shape.
        phase_width: Bits per turn, ``PhaseWidth`` of the module, 14 to 30.
        ampl_width: Signed output width, ``AmplWidth`` of the module, 16 to 30.
        table_bits: Logarithm to base 2 of the table's length; the module has 10, the design space
            others.
        entry_width: Bits of an entry, 17 or more and no fewer than ``ampl_width``; the module has
            32.

    Returns:
        Sine and cosine, int64 arrays of the shape of ``phase``, where ``amplitude(ampl_width)``
        stands for 1.0. As shipped the error of each is at most ``error_bound(ampl_width)`` steps.

    Raises:
        ValueError: if a phase or a width is out of range.
    """
    if not (14 <= phase_width <= 30 and 16 <= ampl_width <= 30):
        raise ValueError("quarter_wave: phase_width must be 14 to 30, ampl_width 16 to 30")
    if not (2 <= table_bits <= phase_width - 4 and SLOPE_WIDTH <= entry_width <= 32):
        raise ValueError("quarter_wave: table_bits or entry_width out of range")
    if ampl_width > entry_width:
        raise ValueError("quarter_wave: ampl_width is above entry_width")
    phase = np.asarray(phase, np.int64)
    if phase.size and (phase.min() < 0 or phase.max() >> phase_width):
        raise ValueError(f"quarter_wave: a phase does not fit in {phase_width} bits")
    residual_width = phase_width - 2 - table_bits
    quadrant = phase >> (phase_width - 2)
    odd = (quadrant & 1).astype(bool)
    size = 1 << table_bits
    # In odd quadrants sine and cosine change places, which inverts the index and turns d around.
    index = (phase >> residual_width) & (size - 1)
    index = np.where(odd, size - 1 - index, index)
    residual = (phase & ((1 << residual_width) - 1)) - (1 << (residual_width - 1))
    # From PhaseWidth + 14 fraction bits to those of d; 13 as shipped.
    turn_cut = phase_width - (_EXTRA - 14) - table_bits
    step = (residual * np.where(odd, -TURN, TURN) + (1 << (turn_cut - 1))) >> turn_cut

    entries = table(table_bits, entry_width)
    sine_entry = entries[index]
    cosine_entry = entries[size - 1 - index]
    slope_shift = entry_width - SLOPE_WIDTH
    down = table_bits + _EXTRA + SLOPE_WIDTH - entry_width
    sine = sine_entry + ((step * (cosine_entry >> slope_shift)) >> down)
    cosine = cosine_entry - ((step * (sine_entry >> slope_shift)) >> down)

    sine = np.where(quadrant >= 2, -sine, sine)
    cosine = np.where((quadrant == 1) | (quadrant == 2), -cosine, cosine)
    cut = entry_width + 1 - ampl_width
    return (sine + (1 << (cut - 1))) >> cut, (cosine + (1 << (cut - 1))) >> cut


def rom(table_bits: int = TABLE_BITS, entry_width: int = ENTRY_WIDTH) -> str:
    """Return rtl/trig/quarter_wave_rom.sv, the table as a block RAM with two read ports."""
    size = 1 << table_bits
    comment = (
        "a quarter of a sine in block RAM, with two read ports.",
        "Generated from vrscan.fixed.quarter_wave.table() by scripts/generate.py.  Entry k is",
        f"the sine at k + 1/2 steps of a {4 * size}th of a turn; 1 - 2**-{headroom(table_bits)} "
        f"stands for 1,",
        f"in 2**-{entry_width}.  Its only test is that of quarter_wave, its user.",
    )
    memories = {"mem": (table(table_bits, entry_width), entry_width)}
    return rom_source("quarter_wave_rom", comment, memories, {"a": "mem", "b": "mem"})
