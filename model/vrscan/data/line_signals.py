"""Sensor lines from a logic analyser's recording of the sensor's pins, as a CSV file.

The pins are those of the boards: ``sensor_clk``, ``sensor_valid`` and ``sensor_pixel``. A pixel is
taken at each rising edge of the clock with valid high, and a line ends when valid is low at one.
"""

import re
from pathlib import Path

import numpy as np

from vrscan.data.arrays import Ints, Pixels
from vrscan.data.csv_files import csv_fields
from vrscan.data.errors import InputError

CLOCK, VALID, PIXEL = "sensor_clk", "sensor_valid", "sensor_pixel"
_MOST_BITS = 16


def read(path: Path, line_length: int) -> Pixels:
    """Return the whole lines of a recording, uint16 [n, line_length].

    Args:
        path: A CSV file with a row at each sample or at each change. Its columns, in any order and
            with others between them, are ``sensor_clk`` and ``sensor_valid``, 0 or 1, and the
            pixel: ``sensor_pixel``, a number, decimal or ``0x``, or ``sensor_pixel[0]`` and so on,
            a bit each. Names may end in ``_i``; spaces and the case of letters do not matter. Rows
            that begin with ``;`` or ``#`` are comments.
        line_length: Number of pixels of a line. The lines at the recording's ends may be cut off,
            and are left out.

    Raises:
        InputError: naming the file, and the line if one is wrong, if it is missing, lacks a column,
            a level is not one, a line between others has another length, or none is whole.
    """
    table = [(n, row) for n, row in enumerate(csv_fields(path), 1) if row and any(row)]
    table = [(n, row) for n, row in table if not row[0].lstrip().startswith((";", "#"))]
    header = [_name(each) for each in table[0][1]] if table else []
    bits = [f"{PIXEL}[{k}]" for k in range(_MOST_BITS) if f"{PIXEL}[{k}]" in header]
    if bits != [f"{PIXEL}[{k}]" for k in range(len(bits))]:
        raise InputError(f"{path}: bits of {PIXEL} are missing: there are {', '.join(bits)}")
    words = [PIXEL] if PIXEL in header else bits
    if {"x_mm", "z_mm"} <= set(header):
        raise InputError(f"{path}: holds points, not lines")
    for name in (CLOCK, VALID, *(words or [PIXEL])):
        if name not in header:
            raise InputError(f"{path}: no column {name} (has {', '.join(header) or 'none'})")
    levels = {name: _levels(path, table[1:], header.index(name), name, name == PIXEL)
              for name in (CLOCK, VALID, *words)}  # fmt: skip
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
        row = table[1 + int(edge[begin[wrong[0]]])][0]
        length = int((end - begin)[wrong[0]])
        raise InputError(f"{path}: line {row}: {length} px until {VALID} falls, want {line_length}")
    if not whole.any():
        raise InputError(f"{path}: no whole line of {line_length} px")
    return np.stack([pixel[a:b] for a, b in zip(begin[whole], end[whole], strict=True)]).astype(
        np.uint16
    )


def _name(text: str) -> str:
    """Return the name of a column as it is meant."""
    name = re.sub(r"\s", "", text).lower()
    return re.sub(r"_i(?=$|\[)", "", name)


def _levels(
    path: Path, rows: list[tuple[int, list[str]]], place: int, name: str, number: bool
) -> Ints:
    """Return a column of levels, 0 or 1, or of numbers [rows]."""
    found = np.zeros(len(rows), np.int64)
    for index, (line, row) in enumerate(rows):
        text = row[place].strip() if place < len(row) else ""
        try:
            found[index] = int(text, 0 if text[:2].lower() == "0x" else 10)
        except (ValueError, OverflowError):
            raise InputError(f"{path}: line {line}: {name} {text!r} is no number") from None
        if not (number and found[index] >= 0) and text not in ("0", "1"):
            raise InputError(f"{path}: line {line}: {name} {text!r} is not 0 or 1")
    return found
