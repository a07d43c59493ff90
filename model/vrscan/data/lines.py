"""Sensor lines: the type that every engine takes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels, all_rows, some_rows


@dataclass(frozen=True)
class Truth:
    """The truth of simulated lines; all arrays [n], NaN where a line has no such value.

    Example:
        >>> import vrscan
        >>> truth = vrscan.simulate("plane", 64, fidelity="minimal").truth
        >>> truth.names, bool((truth.z_mm[truth.surface == 0] > 0).all())
        (('plane',), True)
    """

    x_mm: Floats  # x of the spot
    z_mm: Floats
    position_px: Floats  # position of the spot's image; NaN where the camera does not see it
    surface: Ints  # index into ``names``, -1 without a spot
    names: tuple[str, ...]


@dataclass(frozen=True)
class Lines:
    """n sensor lines with the data that the chain needs for each.

    Every source of lines (a recording, the simple scene, the full simulator) gives this type.

    Example:
        >>> import numpy as np
        >>> import vrscan
        >>> dark = vrscan.Lines(np.zeros((2, 2048), np.uint16), np.zeros(2), np.ones(2, np.int64))
        >>> len(dark), vrscan.detect(dark).measured.tolist()
        (2, [False, False])
    """

    lines: Pixels  # counts [n, length]
    angle_rad: Floats  # scan angle at the pulse's centre [n]
    power: Ints  # laser power [n], u16
    truth: Truth | None = None
    mirror_flags: Ints | int = 0  # [n] or one for all; bit 0 NOT_RUNNING, INDEX_FAULT, UNSETTLED
    time_s: Floats | float = math.nan  # of the pulse's centre [n] or one for all; NaN: not known
    y_mm: Floats | float = 0.0  # position of the scanner along y [n] or one for all
    # Position of the lens for the correction maps, steps, u16 [n]; None: that of ``[map]``.
    lens: Ints | None = None
    number: Ints | None = None  # number of each line on its board [n]; None: not known

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.lines)


def part(recording: Lines, rows: slice | Bools) -> Lines:
    """Return some of the lines, with their truth if they have one."""
    truth, raised = recording.truth, recording.mirror_flags
    if truth is not None:
        truth = some_rows(truth, rows, shared=("names",))
    return Lines(
        lines=recording.lines[rows],
        angle_rad=recording.angle_rad[rows],
        power=recording.power[rows],
        truth=truth,
        mirror_flags=raised if isinstance(raised, int) else raised[rows],
        time_s=np.broadcast_to(recording.time_s, len(recording))[rows],
        y_mm=np.broadcast_to(recording.y_mm, len(recording))[rows],
        lens=None if recording.lens is None else recording.lens[rows],
        number=None if recording.number is None else recording.number[rows],
    )


def bare(recording: Lines) -> Lines:
    """Return the lines without their pixels: of length 0."""
    return replace(recording, lines=np.empty((len(recording), 0), np.uint16))


def joined(parts: Sequence[Lines]) -> Lines:
    """Return all lines of ``parts``, at least one; with truth if the first have it."""
    if len(parts) == 1:
        return parts[0]
    truths = [each.truth for each in parts if each.truth is not None]
    lenses = [each.lens for each in parts if each.lens is not None]
    numbers = [each.number for each in parts if each.number is not None]
    truth = None
    if parts[0].truth is not None:
        truth = all_rows(truths, shared=("names",))
    return Lines(
        lines=np.concatenate([each.lines for each in parts]),
        angle_rad=np.concatenate([each.angle_rad for each in parts]),
        power=np.concatenate([each.power for each in parts]),
        truth=truth,
        mirror_flags=np.concatenate(
            [np.broadcast_to(np.asarray(each.mirror_flags), len(each)) for each in parts]
        ),
        time_s=np.concatenate([np.broadcast_to(each.time_s, len(each)) for each in parts]),
        y_mm=np.concatenate([np.broadcast_to(each.y_mm, len(each)) for each in parts]),
        lens=np.concatenate(lenses) if lenses else None,
        number=np.concatenate(numbers) if numbers else None,
    )
