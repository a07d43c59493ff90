"""Sensor lines from a logic analyser's recording of the sensor's pins, as a CSV file.

The pins are those of the boards: ``sensor_clk``, ``sensor_valid`` and ``sensor_pixel``. A pixel is
taken at each rising edge of the clock with valid high, and a line ends when valid is low at one.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vrscan.data.arrays import Pixels
from vrscan.data.csv_files import read_table, whole
from vrscan.data.errors import InputError

CLOCK, VALID, PIXEL = "sensor_clk", "sensor_valid", "sensor_pixel"
_MOST_BITS = 16


def read(path: Path, line_length: int, columns: Mapping[str, str] | None = None) -> Pixels:
    """Return the whole lines of a recording, uint16 [n, line_length].

    Args:
        path: A CSV file with a row at each sample or at each change. Its columns, in any order and
            with others between them, are ``sensor_clk`` and ``sensor_valid``, 0 or 1, and the
            pixel: ``sensor_pixel``, a number, decimal or ``0x``, or ``sensor_pixel[0]`` and so on,
            a bit each. Names may end in ``_i``; spaces and the case of letters do not matter.
        line_length: Number of pixels of a line. The lines at the recording's ends may be cut off,
            and are left out.
        columns: Names of the file's columns, by those above, where they differ.

    Raises:
        InputError: naming the file, and the line if one is wrong, if it is missing, lacks a column,
            a level is not one, a line between others has another length, or none is whole.
    """
    table = read_table(path, columns=columns)
    bits = [f"{PIXEL}[{k}]" for k in range(_MOST_BITS) if f"{PIXEL}[{k}]" in table.names]
    if bits != [f"{PIXEL}[{k}]" for k in range(len(bits))]:
        raise InputError(f"{path}: bits of {PIXEL} are missing: there are {', '.join(bits)}")
    words = [PIXEL] if PIXEL in table.names else bits
    if {"x_mm", "z_mm"} <= set(table.names):
        raise InputError(f"{path}: holds points, not lines")
    table.need((CLOCK, VALID, *(words or [PIXEL])))
    levels = {name: table.levels(name) for name in (CLOCK, VALID, *bits)}
    if words != bits:
        levels[PIXEL] = np.asarray(table.column(PIXEL, _count), np.int64)
    clock = levels[CLOCK]
    edge = np.flatnonzero((clock[1:] == 1) & (clock[:-1] == 0)) + 1
    if words == bits:
        pixel = sum(levels[name][edge] << k for k, name in enumerate(bits))
    else:
        pixel = levels[PIXEL][edge]
    pixel = np.asarray(pixel, np.int64)
    valid = levels[VALID][edge] == 1
    turns = np.flatnonzero(np.diff(valid.astype(np.int8), prepend=0, append=0))
    begin, end = turns[::2], turns[1::2]
    if len(pixel) and pixel.max() >= 2**16:
        raise InputError(f"{path}: {PIXEL} of more than 16 bits ({pixel.max()})")
    whole = end - begin == line_length
    # What begins at the first edge or ends at the last may be a part of a line.
    inner = (begin > 0) & (end < len(valid))
    wrong = np.flatnonzero(inner & ~whole)
    if len(wrong):
        row = table.line[int(edge[begin[wrong[0]]])]
        length = int((end - begin)[wrong[0]])
        raise InputError(f"{path}: line {row}: {length} px until {VALID} falls, want {line_length}")
    if not whole.any():
        raise InputError(f"{path}: no whole line of {line_length} px")
    return np.stack([pixel[a:b] for a, b in zip(begin[whole], end[whole], strict=True)]).astype(
        np.uint16
    )


def _count(text: str) -> int:
    """Return a pixel's value; raise ValueError for what is none."""
    value = whole(text)
    if value < 0:
        raise ValueError(text)
    return value
