"""Points in physical units: the result of every engine, whatever its number format."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints, all_rows, some_rows
from vrscan.data.contract import POWER_LIMIT
from vrscan.data.extras import named

if TYPE_CHECKING:
    import pandas as pd

_SHARED = ("flags", "pixel_width")  # fields that are no array of rows


@dataclass(frozen=True)
class Table:
    """The columns of points.csv in physical units; all arrays [n].

    ``flags`` maps a flag's name to the rows that have it. position_px, sigma_px and doubt_px, what
    the lines beside it add to sigma_px in squares, are valid where ``measured``, x_mm, z_mm and
    sigma_z_mm where ``located``, left and right where ``width`` > 0, free_from_mm and free_to_mm
    where the latter is above 0: z between which the beam is free. Confidences are 0 to 1.
    y_mm is the position of the scanner along y, time_s that of the laser's pulse from the start of
    the recording, and power the laser's, 0 to 65535; NaN where time or power is not known.

    Example:
        >>> import vrscan
        >>> points = vrscan.detect(vrscan.simulate("plane", 64, fidelity="minimal"))
        >>> good = points.of(points.located & ~points.flags["MIXED"])
        >>> bool((good.sigma_z_mm > 0).all())
        True
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
    y_mm: Floats
    time_s: Floats
    power: Floats
    pixel_width: int

    @property
    def intensity(self) -> Floats:
        """Return the height of the peak over the background at full laser power, counts [n].

        It is NaN without a peak or where the laser's power is not known, and too small where the
        flag SATURATED stands. Light fades with the distance and out of focus, which is left in it.
        """
        height = np.maximum(self.maximum - self.background, 0.0)
        power = np.where(self.measured & (self.power > 0.0), self.power, np.nan)
        return np.asarray(height * (POWER_LIMIT / power))

    @property
    def clear(self) -> Bools:
        """Return which rows have a point without a flag [n]."""
        return np.asarray(self.located & ~np.any(list(self.flags.values()), axis=0))

    @property
    def places_mm(self) -> Floats:
        """Return x, y and z, of which x and z mean something where ``located`` [n, 3]."""
        return np.stack([self.x_mm, self.y_mm, self.z_mm], 1)

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.line)

    def of(self, rows: Bools | Ints | slice) -> "Table":
        """Return some of the rows."""
        flags = {name: raised[rows] for name, raised in self.flags.items()}
        return replace(some_rows(self, rows, shared=_SHARED), flags=flags)

    def to_frame(self) -> "pd.DataFrame":
        """Return the points as a pandas data frame with the columns of points.csv.

        Returns:
            n rows. What means nothing is missing, as it is empty in the file: ``left`` and
            ``right`` without a window, position and its sigma without a valid peak, ``x_mm``,
            ``z_mm`` and ``sigma_z_mm`` where the rays do not meet, ``free_from_mm`` and
            ``free_to_mm`` where nothing is known to be free, time, power and intensity where they
            are not known. ``frame["flags"]`` has the names of a row's flags, joined by ``|``;
            ``frame.flags`` is something of pandas' own.

        Raises:
            MissingError: if pandas is not installed.

        Example:
            >>> import vrscan
            >>> points = vrscan.detect(vrscan.simulate("plane", 64, fidelity="minimal"))
            >>> frame = points.to_frame()
            >>> len(frame), list(frame.columns[-4:])
            (64, ['y_mm', 'time_s', 'power', 'intensity'])
        """
        with named():
            import pandas as pd

        def where(rows: Bools, values: Floats) -> Floats:
            return np.where(rows, values, np.nan)

        def whole(rows: Bools, values: Ints) -> "pd.api.extensions.ExtensionArray":
            return pd.arrays.IntegerArray(values.astype(np.int64), ~rows)

        window = self.width > 0
        return pd.DataFrame(
            {
                "line": self.line,
                "peak": np.zeros(len(self), np.int64),
                "flags": flag_texts(self.flags, len(self)),
                "left": whole(window, self.left),
                "right": whole(window, self.right),
                "maximum": self.maximum,
                "row_mean": self.row_mean,
                "row_variance": self.row_variance,
                "background": self.background,
                "noise": self.noise,
                "snr": self.snr,
                "position_px": where(self.measured, self.position_px),
                "sigma_px": where(self.measured, self.sigma_px),
                "doubt_px": where(self.measured, self.doubt_px),
                "angle_rad": self.angle_rad,
                "x_mm": where(self.located, self.x_mm),
                "z_mm": where(self.located, self.z_mm),
                "sigma_z_mm": where(self.located, self.sigma_z_mm),
                "c_obj": self.c_obj,
                "c_sfm": self.c_sfm,
                "free_from_mm": where(self.free_to_mm > 0.0, self.free_from_mm),
                "free_to_mm": where(self.free_to_mm > 0.0, self.free_to_mm),
                "y_mm": self.y_mm,
                "time_s": self.time_s,
                "power": self.power,
                "intensity": self.intensity,
            }
        )

    @classmethod
    def joined(cls, parts: Sequence["Table"]) -> "Table":
        """Return one table of all rows of ``parts``: at least one part, all of one pixel width."""
        flags = {
            name: np.concatenate([part.flags[name] for part in parts]) for name in parts[0].flags
        }
        return replace(all_rows(parts, shared=_SHARED), flags=flags)


def flag_bits(flags: Mapping[str, Bools], rows: int) -> Ints:
    """Return each row's flags as the bits of ``pkg.FLAGS``."""
    bits = np.zeros(rows, np.int64)
    for name, where in flags.items():
        bits |= where.astype(np.int64) << pkg.FLAGS[name]
    return bits


def flag_texts(flags: Mapping[str, Bools], rows: int) -> list[str]:
    """Return the names of each row's flags, joined by ``|``."""
    bits = flag_bits(flags, rows)
    kinds, kind = np.unique(bits, return_inverse=True)
    texts = ["|".join(n for n, bit in pkg.FLAGS.items() if k >> bit & 1) for k in kinds.tolist()]
    return [texts[k] for k in kind.tolist()]
