"""Sensor lines from pictures: PNG and TIFF, alone or in a folder, each row of a picture a line."""

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vrscan.data.errors import InputError, one_line, unread
from vrscan.data.extras import named

SUFFIXES = (".png", ".tif", ".tiff")
# Pillow's modes of grey pictures: one byte, two bytes, and two bytes in four.
_BYTES = ("L",)
_WORDS = ("I;16", "I;16L", "I;16B", "I")


class Pictures:
    """Rows of pictures, read one picture after the other.

    A picture of 8 bits is spread over the sensor's range, so that 255 is full scale; one of 16 bits
    has the sensor's own counts.

    Attributes:
        kind: An array of the type and shape of all lines [n, length], without meaningful values.
        in_order: True: the rows lie one after the other.
    """

    in_order = True

    def __init__(self, path: Path, pixel_width: int) -> None:
        """Look at every picture, without reading pixels.

        Args:
            path: A picture, of one or more pages, or a folder of them, which are taken in the order
                of their names, numbers in these by their value.
            pixel_width: Bits of a pixel of the sensor.

        Raises:
            InputError: naming the file, if one is damaged, not grey, or of another width.
            MissingError: if Pillow is not installed.
        """
        self._full = 2**pixel_width - 1
        self._pages: list[tuple[Path, int]] = []
        self._open: tuple[Path, Any] | None = None
        self._rest = np.zeros((0, 0), np.uint16)
        files = [path]
        if path.is_dir():
            files = sorted((f for f in path.iterdir() if f.suffix.lower() in SUFFIXES), key=_number)
            if not files:
                raise InputError(f"{path}: no pictures ({', '.join(SUFFIXES)}) in this folder")
        count, width = 0, 0
        for file in files:
            picture = self._picture(file)
            for page in range(getattr(picture, "n_frames", 1)):
                with _told(file):
                    picture.seek(page)
                if picture.mode not in (*_BYTES, *_WORDS):
                    raise InputError(f"{file}: not grey of 8 or 16 bits (Pillow's {picture.mode})")
                if width not in (0, picture.width):
                    raise InputError(f"{file}: {picture.width} px wide, others are {width}")
                width = picture.width
                count += picture.height
                self._pages.append((file, page))
        self.kind = np.broadcast_to(np.zeros((), np.uint16), (count, width))
        self._rest = np.zeros((0, width), np.uint16)
        self._next = 0

    def rows(self, count: int) -> npt.NDArray[np.uint16]:
        """Return the next rows.

        Raises:
            InputError: naming the file, if a picture is damaged.
        """
        parts = [self._rest]
        there = len(self._rest)
        while there < count:
            parts.append(self._page(*self._pages[self._next]))
            there += len(parts[-1])
            self._next += 1
        found = np.concatenate(parts)
        self._rest = found[count:]
        return found[:count]

    def end(self) -> None:
        """Close the last file."""
        if self._open is not None:
            self._open[1].close()
            self._open = None

    def _picture(self, file: Path) -> Any:
        """Return a file, opened if it is not the one that is open."""
        with named():
            from PIL import Image

        if self._open is None or self._open[0] != file:
            self.end()
            with _told(file):
                self._open = file, Image.open(file, formats=("PNG", "TIFF"))
        assert self._open is not None
        return self._open[1]

    def _page(self, file: Path, page: int) -> npt.NDArray[np.uint16]:
        picture = self._picture(file)
        with _told(file):
            picture.seek(page)
            pixels = np.asarray(picture)
        if picture.mode in _BYTES:
            spread = (pixels.astype(np.uint32) * self._full + 127) // 255
            return np.asarray(spread, np.uint16)
        if pixels.min(initial=0) < 0 or pixels.max(initial=0) >= 2**16:
            raise InputError(f"{file}: pixels of more than 16 bits")
        return np.asarray(pixels, np.uint16)


@contextlib.contextmanager
def _told(file: Path) -> Iterator[None]:
    """Turn the errors of Pillow into an ``InputError`` that names the file."""
    try:
        yield
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:
            reason = unread(error, file)
        else:
            reason = f"not a PNG or TIFF that can be read ({one_line(error)})"
        raise InputError(f"{file}: {reason}") from error


def _number(file: Path) -> list[tuple[int, str]]:
    """Return what a name is sorted by: line_9 before line_10."""
    parts = re.split(r"(\d+)", file.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]
