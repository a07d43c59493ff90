"""Recordings of the view."""

from pathlib import Path

import numpy as np

from vrscan.data.lines import Lines
from vrscan.data.points import Points, atomic_file


class Recorder:
    """A recording."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._points: list[Points] = []

    def points(self, found: Points) -> None:
        """Write points."""
        self._points.append(found)

    def lines(self, found: Lines) -> None:
        """Write lines."""

    def close(self) -> None:
        """End."""
        with atomic_file(self._path) as file:
            found = Points.concatenate(self._points)
            np.savez(file, line=found.line, x=found.x, z=found.z)
