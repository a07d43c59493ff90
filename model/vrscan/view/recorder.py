"""Recordings of the view: the files of ``link points`` and ``link capture``, written as they come.

Records and lines go at once into unnamed files beside the recording, so their number has no limit
but the disk's; the files appear under their names when the recording ends.
"""

import contextlib
import tempfile
from pathlib import Path
from typing import IO

import numpy as np

from vrscan.data.points import atomic_file, check_writable
from vrscan.data.records import FULL, Form, Records
from vrscan.link.link_report import Threshold, write_captures, write_points
from vrscan.link.register_host import Build
from vrscan.link.stream import DTYPES, Account, Captured


class Recorder:
    """A recording.

    Args:
        path: File for the points, .npz; the one for raw lines has ``-lines`` in its name.
        form: Form of the records.
        build: The board's identity.

    Attributes:
        lines_path: File for raw lines, which is written where there are some.

    Raises:
        InputError: if the files cannot be written.
    """

    def __init__(self, path: Path, form: Form, build: Build) -> None:
        self.path, self.lines_path = path, path.with_name(f"{path.stem}-lines{path.suffix}")
        self._form, self._build = form, build
        check_writable(path)
        kind = [("line", "<u4"), ("has_point", "?"), ("pixels", "<u2", build.line_length)]
        self._line = np.dtype([*kind, ("record", FULL)])
        self._files = contextlib.ExitStack()
        self._points: IO[bytes] = self._files.enter_context(_unnamed(path.parent))
        self._lines: IO[bytes] = self._files.enter_context(_unnamed(path.parent))

    def points(self, found: Records) -> None:
        """Write records with the numbers of their lines."""
        self._points.write(found.tobytes())

    def line(self, found: Captured) -> None:
        """Write a raw line."""
        row = np.zeros(1, self._line)
        row["line"], row["pixels"], row["has_point"] = found.line, found.pixels, False
        if found.record is not None:
            row["record"], row["has_point"] = found.record, True
        self._lines.write(row.tobytes())

    def close(self, step: int, account: Account, settings: Threshold) -> None:
        """End the recording.

        Args:
            step: Distance of the lines whose points came.
            account: What came and what did not while it was recorded.
            settings: Settings of the board's threshold.

        Raises:
            InputError: if the files cannot be written.
        """
        with self._files:
            found = _read(self._points, DTYPES[self._form])
            with atomic_file(self.path) as file:
                form, build = self._form, self._build
                write_points(".npz", file, found, form, step, build, account)
            rows = _read(self._lines, self._line)
            if not len(rows):
                return
            records = rows["record"]
            points = [
                records[k : k + 1] if has else None for k, has in enumerate(rows["has_point"])
            ]
            lines = list(map(Captured, rows["line"].tolist(), rows["pixels"], points))
            with atomic_file(self.lines_path) as file:
                write_captures(".npz", file, lines, settings, self._build.pixel_width)


def _unnamed(folder: Path) -> IO[bytes]:
    return tempfile.TemporaryFile(dir=folder)


def _read(file: IO[bytes], kind: np.dtype[np.void]) -> Records:
    """Return what was written into an unnamed file; a full disk may have cut the last one."""
    file.seek(0)
    data = file.read()
    return np.frombuffer(data, kind, len(data) // kind.itemsize)
