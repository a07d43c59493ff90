"""Recorded edges of the index, from a logic analyser for example, as samples that the RTL takes."""

import math
from pathlib import Path

import numpy as np

from vrscan.data.arrays import Floats, Ints
from vrscan.data.csv_files import csv_fields
from vrscan.data.errors import InputError

Rows = np.ndarray[tuple[int], np.dtype[np.void]]
# A change of the inputs of index_capture; bit 0 of the levels is the oldest sample of the clock.
SAMPLES = np.dtype([(name, np.int64) for name in ("clock", "comparator", "gate")])
COLUMNS = ("time_s", "comparator", "gate")
_SLACK = 1e-3  # share of a sample: keeps edges on samples despite decimal times


def read(path: Path) -> tuple[Floats, Ints, Ints]:
    """Return time [n], s, and the levels of comparator and gate [n] from each time on.

    Args:
        path: A CSV file with the columns ``COLUMNS`` and a row at every change.

    Raises:
        InputError: naming file and line, if the file is missing, has other columns or no row, a
            time is negative, not a number or before the one above it, or a level is not 0 or 1.
    """
    rows = csv_fields(path)
    header = tuple(name.strip() for name in rows[0]) if rows else ()
    if header != COLUMNS:
        raise InputError(f"{path}: columns {','.join(header)!r}, want {','.join(COLUMNS)!r}")
    times: list[float] = []
    levels: list[tuple[int, int]] = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        if len(row) != len(COLUMNS):
            raise InputError(f"{path}: line {number}: {len(row)} fields, want {len(COLUMNS)}")
        try:
            time = float(row[0])
        except ValueError:
            time = math.nan
        if not (math.isfinite(time) and time >= 0.0):
            raise InputError(f"{path}: line {number}: time_s {row[0]!r} is not a time")
        if times and time < times[-1]:
            raise InputError(f"{path}: line {number}: time_s {row[0]} is before the line above")
        level = tuple(text.strip() for text in row[1:])
        if not set(level) <= {"0", "1"}:
            raise InputError(f"{path}: line {number}: levels {','.join(level)!r} are not 0 or 1")
        times.append(time)
        levels.append((int(level[0]), int(level[1])))
    if not times:
        raise InputError(f"{path}: no edges")
    both = np.array(levels, np.int64)
    return np.array(times), both[:, 0], both[:, 1]


def sample(
    time_s: Floats, comparator: Ints, gate: Ints, *, clock_hz: float, oversample: int
) -> Rows:
    """Return the changes of the samples that a board's wrapper would take, ``SAMPLES`` rows.

    Sample j of clock n is taken at (n + j / oversample) / clock_hz, with the levels from the last
    row at or before it; both are 0 before the first row.
    """
    at = np.ceil(time_s * (clock_hz * oversample) - _SLACK).astype(np.int64)
    at = np.maximum(at, 0)
    # Only the clocks with an edge, and the next ones, can differ from the clock before.
    clock = np.unique(np.concatenate([at // oversample, at // oversample + 1]))
    row = np.searchsorted(at, clock[:, None] * oversample + np.arange(oversample), side="right") - 1
    weight = 1 << np.arange(oversample)

    def word(level: Ints) -> Ints:
        return np.asarray(np.where(row >= 0, level[row], 0) @ weight, np.int64)

    samples = np.zeros(len(clock), SAMPLES)
    samples["clock"], samples["comparator"], samples["gate"] = clock, word(comparator), word(gate)
    before = np.zeros(len(clock) + 1, SAMPLES)
    before[1:] = samples
    changed = (samples["comparator"] != before["comparator"][:-1]) | (
        samples["gate"] != before["gate"][:-1]
    )
    chosen: Rows = samples[changed]
    return chosen


def pairs(time_s: Floats, comparator: Ints, gate: Ints) -> tuple[Floats, Floats]:
    """Return the times of the outward crossings that an inward one follows, and of the latter, [n].

    A crossing is a change of the comparator between two rows with the gate open.
    """
    lit = (gate[1:] == 1) & (gate[:-1] == 1)
    step = np.where(lit, comparator[1:] - comparator[:-1], 0)
    crossing = np.flatnonzero(step) + 1
    outward = step[crossing - 1] > 0
    pair = np.flatnonzero(outward[:-1] & ~outward[1:])
    return time_s[crossing[pair]], time_s[crossing[pair + 1]]
