"""What a scan says about space: occupied, free and unknown, as a picture and against the truth."""

from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.lines import Truth
from vrscan.data.table import Table
from vrscan.show.style import COLOURS, INK, LIGHT, drawing

UNKNOWN, FREE, BEAM, OCCUPIED = range(4)  # states of a cell
_SHADES = (LIGHT, COLOURS[2], "#d9ead8", INK)
_ANGLES, _DEPTHS = 240, 400  # cells of the picture, at most
_LINES = 12  # lines for each angle, at least
_SLICE = 1500  # lines in the middle of a moving scanner's way that are drawn


@dataclass(frozen=True)
class Space:
    """Numbers of lines.

    Attributes:
        lines: Number of lines.
        free: Lines of which a part of the beam is called free.
        false: Those of them with a surface in that part that the camera sees.
        hidden: Those with a surface in that part that another one hides from the camera.
    """

    lines: int
    free: int
    false: int
    hidden: int

    @classmethod
    def of(cls, points: Table, truth: Truth) -> "Space":
        """Count the lines of some points."""
        free = points.free_to_mm > 0.0
        with np.errstate(invalid="ignore"):
            inside = (truth.z_mm >= points.free_from_mm) & (truth.z_mm <= points.free_to_mm)
        seen = np.isfinite(truth.position_px)
        return cls(
            len(points),
            int(free.sum()),
            int((free & inside & seen).sum()),
            int((free & inside & ~seen).sum()),
        )

    def __add__(self, other: "Space") -> "Space":
        """Return the numbers of both together."""
        return Space(
            self.lines + other.lines,
            self.free + other.free,
            self.false + other.false,
            self.hidden + other.hidden,
        )

    def __str__(self) -> str:
        """Return the numbers as a line of text."""
        if not self.free:
            return "no line with a free part of the beam"
        return (
            f"{self.free} lines with a free part of the beam; falsely free, with a surface in it, "
            f"are {self.false} ({100.0 * self.false / self.free:.2f} %), and {self.hidden} more "
            f"({100.0 * self.hidden / self.free:.2f} %) with one that is hidden from the camera"
        )


def cells(points: Table, angle_edges: Floats, depth_edges: Floats) -> Ints:
    """Return the state of each cell over scan angle and z, [angles, depths].

    A beam that met a surface is free up to there; of the other beams the free interval is. A cell
    with a point is occupied, whatever other beams say.

    Args:
        points: The points.
        angle_edges: Edges of the cells, rad, rising.
        depth_edges: Edges of the cells, mm, rising.
    """
    count = len(angle_edges) - 1, len(depth_edges) - 1
    state = np.full(count, UNKNOWN)
    column = np.searchsorted(angle_edges, points.angle_rad, "right") - 1
    inside = (column >= 0) & (column < count[0])

    def mark(rows: Bools, start: Floats, end: Floats, value: int) -> None:
        for row in np.flatnonzero(rows & inside).tolist():
            first, last = np.searchsorted(depth_edges, (start[row], end[row]))
            part = state[column[row], first : max(last - 1, first)]  # cells that lie in it wholly
            part[part < value] = value

    mark(points.free_to_mm > 0.0, points.free_from_mm, points.free_to_mm, FREE)
    mark(points.located, np.zeros(len(points)), points.z_mm, BEAM)
    depth = np.searchsorted(depth_edges, points.z_mm, "right") - 1
    hit = points.located & inside & (depth >= 0) & (depth < count[1])
    state[column[hit], depth[hit]] = OCCUPIED
    return state


def picture(
    points: Table, truth: Truth, title: str, file: BinaryIO, *, y_mm: Floats | None = None
) -> None:
    """Draw space in the scan plane: occupied, free up to a point, free without one, unknown.

    Args:
        points: Points of the scan.
        truth: Truth of the same lines, drawn over it.
        title: Title of the picture.
        file: A binary file, written as PNG.
        y_mm: Position of the scanner at each line [n]; of a moving one the middle is drawn.
    """
    rows = np.ones(len(points), np.bool_)
    if y_mm is not None and len(points) and np.ptp(y_mm) > 0.0:
        order = np.argsort(np.abs(y_mm - np.median(y_mm)), kind="stable")
        rows = np.isin(np.arange(len(points)), order[:_SLICE])
        low, high = y_mm[rows].min(), y_mm[rows].max()
        title = f"{title}; y = {low:.1f} to {high:.1f} mm"
    some = points.of(rows)
    ends = np.concatenate([some.z_mm[some.located], some.free_to_mm, truth.z_mm[rows], [100.0]])
    reach = 1.05 * float(np.nanmax(ends[np.isfinite(ends)]))
    half = float(np.abs(some.angle_rad).max(initial=0.1)) * 1.001
    angle_edges = np.linspace(-half, half, min(_ANGLES, max(len(some) // _LINES, 8)) + 1)
    depth_edges = np.linspace(0.0, reach, _DEPTHS + 1)
    state = cells(some, angle_edges, depth_edges)
    with drawing(8.0, 8.0, title) as figure:
        axes = figure.add_subplot()
        across = np.tan(angle_edges)[:, None] * depth_edges
        up = np.broadcast_to(depth_edges, across.shape)
        axes.pcolormesh(
            across, up, state, cmap=ListedColormap(_SHADES), vmin=-0.5, vmax=3.5, rasterized=True
        )
        axes.plot(truth.x_mm[rows], truth.z_mm[rows], ".", color=COLOURS[1], markersize=1.2)
        names = ("unknown", "free, without a point", "free up to a point", "occupied")
        handles = [
            Patch(color=shade, label=name) for shade, name in zip(_SHADES, names, strict=True)
        ]
        handles.append(Patch(color=COLOURS[1], label="truth"))
        axes.legend(handles=handles, loc="lower right")
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(visible=False)
        axes.set(xlabel="x in mm", ylabel="z in mm")
        figure.savefig(file, format="png", dpi=130)
