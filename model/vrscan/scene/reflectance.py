"""Reflectance maps: a factor 0 to 1 over a target's face, on top of its material's reflectance.

A map lies in the target's own x-y plane and is projected onto it along z, so on a steep flank its
pattern is as long as the flank. It leaves out colour (one wavelength sees grey), gloss that
changes with the pattern, and the softening of an edge by light that travels inside the material.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Protocol

import numpy as np
from PIL import Image
from pydantic import Field

from vrscan.data.arrays import Floats
from vrscan.data.config import Positive, Section
from vrscan.data.errors import InputError, beside, reading
from vrscan.scene.tuples import Size

Share = Annotated[float, Field(ge=0, le=1)]


class Map(Protocol):
    """A pattern of reflectance."""

    def factor(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """Return the factor on the reflectance, 0 to 1.

        Args:
            x_mm: x of the points in the target's frame [n].
            y_mm: y of the points in the target's frame [n].
        """


class Checker(Section):
    """Squares, one of which begins at the target's origin and is ``high``."""

    kind: Literal["checker"] = "checker"
    square_mm: Positive = 10.0
    low: Share = 0.1
    high: Share = 1.0

    def factor(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """See ``Map``."""
        odd = np.mod(np.floor(x_mm / self.square_mm) + np.floor(y_mm / self.square_mm), 2.0)
        return np.where(odd == 0.0, self.high, self.low)


class Stripes(Section):
    """Stripes across one axis; a ``high`` one begins at the target's origin."""

    kind: Literal["stripes"] = "stripes"
    period_mm: Positive = 20.0
    duty: Share = 0.5  # share of the period that is high
    across: Literal["x", "y"] = "x"
    low: Share = 0.1
    high: Share = 1.0

    def factor(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """See ``Map``."""
        turns = (x_mm if self.across == "x" else y_mm) / self.period_mm
        return np.where(turns - np.floor(turns) < self.duty, self.high, self.low)


class ImageMap(Section):
    """A picture, centred on the target's origin; around it the factor is 1.

    It appears the right way round to a viewer who looks along +z with y upwards: its rows go down
    in y, its columns go towards -x. Its grey values are reflectances as they are, without a gamma.
    """

    kind: Literal["image"] = "image"
    file: str  # path relative to the scene file
    size_mm: Size = (100.0, 100.0)  # size of the whole picture, in x and y
    repeat: bool = False  # whether the picture is repeated


MapSection = Annotated[Checker | Stripes | ImageMap, Field(discriminator="kind")]


@dataclass(frozen=True)
class Picture:
    """A loaded picture, sampled bilinearly between the centres of its pixels."""

    grey: Floats  # reflectances [rows, columns], 0 to 1
    size_mm: tuple[float, float]
    repeat: bool

    def factor(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """See ``Map``."""
        rows, columns = self.grey.shape
        across = 0.5 - x_mm / self.size_mm[0]  # in pictures, from the first column's edge
        down = 0.5 - y_mm / self.size_mm[1]
        inside = (across >= 0.0) & (across <= 1.0) & (down >= 0.0) & (down <= 1.0)
        if self.repeat:
            across, down = np.mod(across, 1.0), np.mod(down, 1.0)
        else:
            across, down = np.clip(across, 0.0, 1.0), np.clip(down, 0.0, 1.0)
        column, row = across * columns - 0.5, down * rows - 0.5
        left, top = np.floor(column), np.floor(row)
        right_share, low_share = column - left, row - top

        def pixel(i: Floats, j: Floats) -> Floats:
            if self.repeat:
                i, j = np.mod(i, rows), np.mod(j, columns)
            else:
                i, j = np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)
            return np.asarray(self.grey[i.astype(np.int64), j.astype(np.int64)])

        upper = (1.0 - right_share) * pixel(top, left) + right_share * pixel(top, left + 1)
        top = top + 1
        lower = (1.0 - right_share) * pixel(top, left) + right_share * pixel(top, left + 1)
        value = (1.0 - low_share) * upper + low_share * lower
        return np.where(inside | self.repeat, value, 1.0)


def load_map(section: Checker | Stripes | ImageMap, folder: Path) -> Map:
    """Return the pattern that a scene asks for.

    Args:
        section: The map's section of the scene file.
        folder: Folder of the scene file.

    Raises:
        InputError: naming the file, if it is missing or is no picture.
    """
    if not isinstance(section, ImageMap):
        return section
    path = folder / section.file
    if not path.is_file():
        raise InputError(f"{path}: no such picture{beside(path)}")
    with reading(path, "not a picture that can be read"), Image.open(path) as picture:
        deep = picture.mode.startswith("I")  # 16 bits per pixel
        grey = np.asarray(picture if deep else picture.convert("L"), np.float64)
    if grey.size == 0:
        raise InputError(f"{path}: the picture is empty")
    scaled = np.clip(grey / (65_535.0 if deep else 255.0), 0.0, 1.0)
    return Picture(scaled, section.size_mm, section.repeat)
