"""Sensor lines from pictures: PNG and TIFF, alone or in a folder, each row of a picture a line."""

import contextlib
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vrscan.data.errors import InputError, cut, reading
from vrscan.data.extras import named

SUFFIXES = (".png", ".tif", ".tiff")
# Pillow's modes: grey in one byte, grey in two bytes or in four, colours or grey and opacity.
_BYTES = ("L",)
_WORDS = ("I;16", "I;16L", "I;16B", "I")
_COLOURS = ("RGB", "RGBA", "RGBX", "LA", "P", "PA")
_LUMA = np.array([299, 587, 114])  # of red, green and blue in a thousand, ITU-R BT.601
# TIFF's tags.
_BITS, _COMPRESSION, _PHOTOMETRIC, _DESCRIPTION, _STRIPS = 258, 259, 262, 270, 273


class Pictures:
    """Rows of pictures, read one picture after the other.

    A picture of 8 bits is spread over the sensor's range, so that 255 is full scale; of colours the
    luma is. One of 16 bits has the sensor's own counts.

    Attributes:
        kind: An array of the type and shape of all lines [n, length], without meaningful values.
        in_order: True: the rows lie one after the other.
    """

    in_order = True

    def __init__(self, path: Path, pixel_width: int) -> None:
        """Look at every picture, without reading pixels.

        Args:
            path: A picture, of one or more pages, or a folder of them, which are taken in the order
                of their names, numbers in these by their value; hidden files do not count.
            pixel_width: Bits of a pixel of the sensor.

        Raises:
            InputError: naming the file, if one is damaged, neither grey nor of 8-bit colours, or of
                another width.
            MissingError: if Pillow is not installed.
        """
        self._full = 2**pixel_width - 1
        # File, page, and where the pixels of one that has no page of its own begin, else 0.
        self._pages: list[tuple[Path, int, int]] = []
        self._open: tuple[Path, Any] | None = None
        self._rest = np.zeros((0, 0), np.uint16)
        files = [path]
        if path.is_dir():
            there = (f for f in path.iterdir() if f.is_file() and not f.name.startswith("."))
            files = sorted((f for f in there if f.suffix.lower() in SUFFIXES), key=_number)
            if not files:
                raise InputError(f"{path}: no pictures ({', '.join(SUFFIXES)}) in this folder")
        count, width = 0, 0
        for file in files:
            picture = self._picture(file)
            with _reading(file):
                pages = getattr(picture, "n_frames", 1)
            for page in range(pages):
                with _reading(file):
                    picture.seek(page)
                    wide = picture.mode in _COLOURS and ";16" in str(picture.tile)
                if wide or picture.mode not in (*_BYTES, *_WORDS, *_COLOURS):
                    what = f"Pillow's {picture.mode}{' of 16 bits' if wide else ''}"
                    raise InputError(f"{file}: neither grey nor colours of 8 bits ({what})")
                if width not in (0, picture.width):
                    raise InputError(f"{file}: {picture.width} px wide, others are {width}")
                width = picture.width
                count += picture.height
                self._pages.append((file, page, 0))
            for place in _places(file, picture):
                count += picture.height
                self._pages.append((file, 0, place))
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
            with _reading(file):
                self._open = file, Image.open(file, formats=("PNG", "TIFF"))
        assert self._open is not None
        return self._open[1]

    def _page(self, file: Path, page: int, place: int) -> npt.NDArray[np.uint16]:
        picture = self._picture(file)
        tags = getattr(picture, "tag_v2", {})
        with _reading(file):
            picture.seek(page)
            if place:
                shape = picture.height, picture.width
                pixels = np.fromfile(file, _kind(picture), math.prod(shape), offset=place)
                pixels = pixels.reshape(shape)
            else:
                pixels = np.asarray(
                    picture.convert("RGB") if picture.mode in ("P", "PA") else picture
                )
        # Pillow itself turns 8 bits round of which white is 0.
        if tags.get(_PHOTOMETRIC) == 0 and (place or picture.mode in _WORDS):
            pixels = 2 ** int(tags[_BITS][0]) - 1 - pixels.astype(np.int64)
        if picture.mode in _WORDS:
            if pixels.min(initial=0) < 0 or pixels.max(initial=0) >= 2**16:
                raise InputError(f"{file}: pixels of more than 16 bits")
            return np.asarray(pixels, np.uint16)
        grey = pixels.astype(np.int64) * 1000
        if picture.mode in _COLOURS:
            grey = pixels[..., :3] @ _LUMA if pixels.shape[2] > 2 else grey[..., 0]
        return np.asarray((grey * self._full + 127_500) // 255_000, np.uint16)


def _places(file: Path, picture: Any) -> list[int]:
    """Return where the images begin that ImageJ wrote behind the only page of a stack.

    Raises:
        InputError: naming the file, if they are not there or not of one grey channel each.
    """
    tags = getattr(picture, "tag_v2", {})
    words = str(tags.get(_DESCRIPTION, "")).split()
    says = dict(word.split("=", 1) for word in words if "=" in word)
    if "ImageJ" not in says:
        return []
    images, channels = (str(says.get(key, 1)) for key in ("images", "channels"))
    if channels != "1":
        raise InputError(f"{file}: {cut(channels, 40)} channels, want one of grey")
    if images == str(picture.n_frames) or images == "1":
        return []
    with _reading(file):
        first, count = int(tags[_STRIPS][0]), int(images)
        size = picture.width * picture.height * _kind(picture).itemsize
        there = (file.stat().st_size - first) // size
    plain = tags.get(_COMPRESSION, 1) == 1 and picture.mode in (*_BYTES, *_WORDS)
    plain = plain and tags[_BITS][0] % 8 == 0
    if picture.n_frames > 1 or not plain or not 0 < count <= there:
        pages = picture.n_frames if picture.n_frames > 1 or not plain else there
        raise InputError(f"{file}: {pages} of ImageJ's {cut(images, 40)} images are there")
    return [first + k * size for k in range(1, count)]


def _kind(picture: Any) -> np.dtype[Any]:
    """Return the type of a TIFF's pixels."""
    order = "<" if picture.tag_v2.prefix == b"II" else ">"
    return np.dtype(f"{order}u{picture.tag_v2[_BITS][0] // 8}")


def _reading(file: Path) -> contextlib.AbstractContextManager[None]:
    return reading(file, "not a PNG or TIFF that can be read")


def _number(file: Path) -> list[tuple[int, str]]:
    """Return what a name is sorted by: line_9 before line_10."""
    parts = re.split(r"(\d+)", file.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]
