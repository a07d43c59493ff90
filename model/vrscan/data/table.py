"""Points in physical units: the result of every engine, whatever its number format."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints


@dataclass(frozen=True)
class Table:
    """The columns of points.csv in physical units; all arrays [n].

    ``flags`` maps a flag's name to the rows that have it. position_px, sigma_px and doubt_px, what
    the lines beside it add to sigma_px in squares, are valid where ``measured``, x_mm, z_mm and
    sigma_z_mm where ``located``, left and right where ``width`` > 0, free_from_mm and free_to_mm
    where the latter is above 0: z between which the beam is free. Confidences are 0 to 1.
    """

    line: Ints
    flags: Mapping[str, Bools]
    left: Ints
    right: Ints
    width: Ints
    maximum: Ints
    row_mean: Floats
    row_variance: Floats
    background: Floats
    noise: Floats
    snr: Floats
    position_px: Floats
    sigma_px: Floats
    doubt_px: Floats
    angle_rad: Floats
    x_mm: Floats
    z_mm: Floats
    sigma_z_mm: Floats
    c_obj: Floats
    c_sfm: Floats
    free_from_mm: Floats
    free_to_mm: Floats
    measured: Bools
    located: Bools
    pixel_width: int

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.line)

    def of(self, rows: Bools) -> "Table":
        """Return some of the rows."""
        columns = {
            field.name: getattr(self, field.name)[rows]
            for field in fields(self)
            if field.name not in ("flags", "pixel_width")
        }
        flags = {name: raised[rows] for name, raised in self.flags.items()}
        return Table(flags=flags, pixel_width=self.pixel_width, **columns)

    @classmethod
    def joined(cls, parts: Sequence["Table"]) -> "Table":
        """Return one table of all rows of ``parts``: at least one part, all of one pixel width."""
        columns = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(cls)
            if field.name not in ("flags", "pixel_width")
        }
        flags = {
            name: np.concatenate([part.flags[name] for part in parts]) for name in parts[0].flags
        }
        return cls(flags=flags, pixel_width=parts[0].pixel_width, **columns)
