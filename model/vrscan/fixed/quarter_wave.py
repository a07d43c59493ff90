"""Sine and cosine of a binary phase, the twin of ``rtl/trig/quarter_wave.sv``."""

import math
from functools import cache

import numpy as np

from vrscan.arrays import Ints
from vrscan.fixed import pkg

LATENCY = pkg.QUARTER_WAVE_LATENCY  # clocks from valid_i to valid_o

TABLE_BITS = 10
ENTRY_WIDTH = 32
STEP_WIDTH = 27  # fraction bits of the small angle d in radians; |d| < 2**-10
SLOPE_WIDTH = 17  # top bits of an entry that are multiplied with d
TURN = 102944  # 2 pi / 8 in 2**-17, an 18-bit operand
MAX_STEP = math.pi / (4 << TABLE_BITS)  # radians, half a table step
LENGTH_ERROR = MAX_STEP * MAX_STEP / 4  # 1.5e-7, of the linear interpolation, about its middle

# 2**15 - 1 of 2**15: with the interpolation's excess of MAX_STEP**2 / 2 = 2.9e-7 the largest
# result is still below 2**15 - 1/2 of 2**15, so it fits from 16 output bits on.
_PEAK = ((1 << 15) - 1) << (ENTRY_WIDTH - 15)


@cache
def table() -> Ints:
    """Return the quarter wave, int64 [1024]: entry k is the sine at k + 1/2 steps.

    A step is a 4096th of a turn. 1 - 2**-15 stands for a sine of 1, in units of 2**-32.
    """
    size = 1 << TABLE_BITS
    angles = [(k + 0.5) * (math.pi / 2 / size) for k in range(size)]
    entries = np.array([math.floor(_PEAK * math.sin(a) + 0.5) for a in angles], np.int64)
    entries.flags.writeable = False
    return entries


def amplitude(ampl_width: int) -> float:
    """Return what stands for a sine of 1, in output steps.

    The length of (cosine, sine) grows by d**2 / 2 of the linear interpolation; the middle of that
    range is the amplitude, so that the length errs by +/-LENGTH_ERROR at most.
    """
    return math.ldexp(_PEAK, ampl_width - 1 - ENTRY_WIDTH) * (1 + LENGTH_ERROR)


def error_bound(ampl_width: int) -> float:
    """Return the largest error of an output against ``amplitude * sin``, in output steps.

    The sum of all roundings, each derived from a width: the interpolation's length error and its
    cubic term, the entry, d and its constant, the cut factor, the cut product, the output.
    """
    turn_error = abs(TURN / 2**17 * 8 / (2 * math.pi) - 1)
    error = (
        LENGTH_ERROR
        + MAX_STEP**3 / 3
        + 2.0 ** -(ENTRY_WIDTH + 1)
        + 2.0 ** -(STEP_WIDTH + 1)
        + MAX_STEP * turn_error
        + MAX_STEP * 2.0**-SLOPE_WIDTH
        + 2.0**-ENTRY_WIDTH
    )
    return math.ldexp(error, ampl_width - 1) + 0.5


def quarter_wave(phase: Ints, *, phase_width: int, ampl_width: int) -> tuple[Ints, Ints]:
    """Return sine and cosine of ``phase`` exactly as the hardware rounds them.

    Args:
        phase: Integers in [0, 2**phase_width), in units of one turn / 2**phase_width. Any shape.
        phase_width: Bits per turn, ``PhaseWidth`` of the module, 14 to 30.
        ampl_width: Signed output width, ``AmplWidth`` of the module, 16 to 30.

    Returns:
        Sine and cosine, int64 arrays of the shape of ``phase``, where ``amplitude(ampl_width)``
        stands for 1.0. The error of each is at most ``error_bound(ampl_width)`` steps.

    Raises:
        ValueError: if a phase or a width is out of range.
    """
    if not (14 <= phase_width <= 30 and 16 <= ampl_width <= 30):
        raise ValueError("quarter_wave: phase_width must be 14 to 30, ampl_width 16 to 30")
    phase = np.asarray(phase, np.int64)
    if phase.size and (phase.min() < 0 or phase.max() >> phase_width):
        raise ValueError(f"quarter_wave: a phase does not fit in {phase_width} bits")
    residual_width = phase_width - 2 - TABLE_BITS
    quadrant = phase >> (phase_width - 2)
    odd = (quadrant & 1).astype(bool)
    size = 1 << TABLE_BITS
    # In odd quadrants sine and cosine change places, which inverts the index and turns d around.
    index = (phase >> residual_width) & (size - 1)
    index = np.where(odd, size - 1 - index, index)
    residual = (phase & ((1 << residual_width) - 1)) - (1 << (residual_width - 1))
    half = 1 << (phase_width - 14)
    step = (residual * np.where(odd, -TURN, TURN) + half) >> (phase_width - 13)

    sine_entry = table()[index]
    cosine_entry = table()[size - 1 - index]
    slope_shift = ENTRY_WIDTH - SLOPE_WIDTH
    down = STEP_WIDTH + SLOPE_WIDTH - ENTRY_WIDTH
    sine = sine_entry + ((step * (cosine_entry >> slope_shift)) >> down)
    cosine = cosine_entry - ((step * (sine_entry >> slope_shift)) >> down)

    sine = np.where(quadrant >= 2, -sine, sine)
    cosine = np.where((quadrant == 1) | (quadrant == 2), -cosine, cosine)
    cut = ENTRY_WIDTH + 1 - ampl_width
    return (sine + (1 << (cut - 1))) >> cut, (cosine + (1 << (cut - 1))) >> cut


def rom_source() -> str:
    """Return rtl/trig/quarter_wave_rom.sv, the table as a block RAM with two read ports."""
    size = 1 << TABLE_BITS
    lines = [
        "// quarter_wave_rom: a quarter of a sine in block RAM, with two read ports.",
        "//",
        "// Generated from vrscan.fixed.quarter_wave.table() by scripts/generate.py.  Entry k is",
        "// the sine at k + 1/2 steps of a 4096th of a turn; 1 - 2**-15 stands for 1, in 2**-32.",
        "//",
        "//   Latency  1 clock",
        "//   Model    that table itself; tested through quarter_wave, which is its only user",
        "",
        "`default_nettype none",
        "",
        "module quarter_wave_rom (",
        "  input  wire logic        clk_i,",
        "",
        f"  input  wire logic [ {TABLE_BITS - 1}:0] a_index_i,",
        f"  input  wire logic [ {TABLE_BITS - 1}:0] b_index_i,",
        "",
        f"  output      logic [{ENTRY_WIDTH - 1}:0] a_entry_o,",
        f"  output      logic [{ENTRY_WIDTH - 1}:0] b_entry_o",
        ");",
        "",
        f"  logic [{ENTRY_WIDTH - 1}:0] mem[{size}];",
        "",
        "  always_ff @(posedge clk_i) a_entry_o <= mem[a_index_i];",
        "  always_ff @(posedge clk_i) b_entry_o <= mem[b_index_i];",
        "",
        "  initial begin",
        *(
            f"    mem[{k}] = {ENTRY_WIDTH}'h{entry:0{ENTRY_WIDTH // 4}x};"
            for k, entry in enumerate(table().tolist())
        ),
        "  end",
        "",
        "endmodule",
        "",
        "`default_nettype wire",
        "",
    ]
    return "\n".join(lines)
