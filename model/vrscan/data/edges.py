"""Recorded edges of the index, from a logic analyser for example, as samples that the RTL takes."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vrscan.data.arrays import Floats, Ints
from vrscan.data.csv_files import finite, read_table
from vrscan.data.errors import InputError

Rows = np.ndarray[tuple[int], np.dtype[np.void]]
# A change of the inputs of index_capture; bit 0 of the levels is the oldest sample of the clock.
SAMPLES = np.dtype([(name, np.int64) for name in ("clock", "comparator", "gate")])
COLUMNS = ("time_s", "comparator", "gate")
_SLACK = 1e-3  # share of a sample: keeps edges on samples despite decimal times


def read(path: Path, columns: Mapping[str, str] | None = None) -> tuple[Floats, Ints, Ints]:
    """Return time [n], s, and the levels of comparator and gate [n] from each time on.

    Args:
        path: A CSV file with the columns ``COLUMNS``, in any order and with others between them,
            and a row at every sample or at every change. Times before a trigger are negative.
        columns: Names of the file's columns, by those of ``COLUMNS``, where they differ.

    Raises:
        InputError: naming file and line, if the file is missing, lacks a column or has no row, a
            time is not a number or before the one above it, or a level is not 0 or 1.
    """
    table = read_table(path, columns=columns)
    table.need(COLUMNS)
    time_s = np.asarray(table.column("time_s", finite, "is not a time"), np.float64)
    back = np.flatnonzero(np.diff(time_s) < 0.0)
    if len(back):
        row = int(back[0]) + 1
        told = f"time_s {time_s[row]:g} is before the row above"
        raise InputError(f"{path}: line {table.line[row]}: {told}")
    if not len(time_s):
        raise InputError(f"{path}: no edges")
    return time_s, table.levels("comparator"), table.levels("gate")


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
