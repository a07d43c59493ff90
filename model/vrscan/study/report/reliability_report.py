"""Whether points are as uncertain as they say: their errors against sigma_z, of any number of them.

Points with a flag are left out: the flag says how far to trust them. A point on another spot than
the beam's own, such as a second reflection, or on a line whose spot the camera cannot see, is
astray. It lies beyond any multiple of sigma and is in no rms.
"""

import math
from dataclasses import dataclass, fields
from typing import Any, BinaryIO

import numpy as np

from vrscan.data.arrays import Floats, Ints
from vrscan.data.lines import Truth
from vrscan.data.table import Table
from vrscan.show.style import COLOURS, INK, LIGHT, QUIET, drawing, plain_log

ASTRAY_PX = 10.0
MULTIPLES = (1, 2, 3)  # of sigma, whose shares are told
STEPS, MOST = 40, 8  # steps of a multiple of sigma, and the largest one that is told apart
EDGES_MM = np.geomspace(1e-3, 1e2, 101)  # of predicted sigma
FEWEST = 20  # points of which an rms is drawn


def expected(multiple: Floats | float) -> Floats:
    """Return the share of normal errors within a multiple of sigma."""
    return np.asarray(np.vectorize(math.erf)(np.asarray(multiple) / math.sqrt(2.0)))


@dataclass(frozen=True)
class Reliability:
    """Numbers of points without a flag, and sums of their squared errors."""

    points: int  # number of them
    astray: int  # number of these that are astray
    rated: int  # number of the others that have a sigma
    square: float  # of error over sigma, over these
    within: Ints  # number of points by |error| / sigma in steps; the last are beyond, or astray
    count: Ints  # number by predicted sigma, of those in ``rated``, between ``EDGES_MM``
    square_mm: Floats  # of errors, likewise
    predicted_mm: Floats  # of sigma, likewise

    @classmethod
    def of(cls, points: Table, truth: Truth) -> "Reliability":
        """Count some points."""
        rows = points.clear
        with np.errstate(invalid="ignore"):
            good = rows & (np.abs(points.position_px - truth.position_px) <= ASTRAY_PX)
        error = np.abs(points.z_mm - truth.z_mm)[good]
        sigma = points.sigma_z_mm[good]
        rated = sigma > 0.0  # a sigma may round to 0
        ratio = np.full(len(error), np.inf)
        ratio[rated] = error[rated] / sigma[rated]
        step = np.ceil(np.minimum(ratio, MOST + 1) * STEPS).astype(np.int64)
        within = np.bincount(np.minimum(step, MOST * STEPS + 1), minlength=MOST * STEPS + 2)
        within[-1] += int(rows.sum()) - len(error)
        bins = np.clip(np.searchsorted(EDGES_MM, sigma[rated]) - 1, 0, len(EDGES_MM) - 2)
        square_mm, predicted_mm = (
            np.asarray(np.bincount(bins, np.square(each[rated]), len(EDGES_MM) - 1), np.float64)
            for each in (error, sigma)
        )
        return cls(
            int(rows.sum()),
            int(rows.sum()) - len(error),
            int(rated.sum()),
            float(np.square(ratio[rated]).sum()),
            within,
            np.bincount(bins, minlength=len(EDGES_MM) - 1),
            square_mm,
            predicted_mm,
        )

    def __add__(self, other: "Reliability") -> "Reliability":
        """Return the numbers of both together."""
        return Reliability(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    @property
    def ratio(self) -> float:
        """Rms of error over sigma: 1 where the prediction is right; NaN without points."""
        return math.sqrt(self.square / self.rated) if self.rated else math.nan

    @property
    def rms_mm(self) -> float:
        """Rms error in z of the points that have a sigma, mm; NaN without any."""
        return math.sqrt(float(self.square_mm.sum()) / self.rated) if self.rated else math.nan

    def share(self, multiple: float) -> float:
        """Return the share of points whose error is within a multiple of sigma, up to ``MOST``."""
        if not self.points:
            return math.nan
        return float(self.within[: round(multiple * STEPS) + 1].sum()) / self.points

    def __str__(self) -> str:
        """Return the numbers as a line of text."""
        if not self.points:
            return "no point without a flag"
        first, second, third = (f"{100.0 * self.share(k):.1f}" for k in MULTIPLES)
        normal = ", ".join(f"{100.0 * float(expected(k)):.1f}" for k in MULTIPLES)
        return (
            f"error/sigma {self.ratio:.2f}, 2 sigma holds {second} %; 1 and 3 hold {first} and "
            f"{third} % (normal errors: {normal}); {self.points} points without a flag, "
            f"{self.astray} astray, the others {self.rms_mm:.2f} mm rms"
        )


def picture(found: Reliability, title: str, file: BinaryIO) -> None:
    """Draw the shares within multiples of sigma, and the error over the predicted sigma.

    Args:
        found: The points.
        title: Title of the picture.
        file: A binary file, written as PNG. Its description is the text of ``found``.
    """
    with drawing(10.0, 4.4, title) as figure:
        shares, errors = figure.subplots(1, 2)
        multiple = np.arange(0, 4 * STEPS + 1) / STEPS
        shares.plot(
            multiple, 100.0 * expected(multiple), color=INK, linewidth=1.1, linestyle=(0, (4, 2)),
            label="normal errors",
        )  # fmt: skip
        if found.points:
            held = [100.0 * found.share(k) for k in multiple]
            shares.plot(multiple, held, color=COLOURS[0], linewidth=2.0, label="points")
            for k in MULTIPLES:
                percent = 100.0 * found.share(k)
                shares.text(k + 0.08, max(percent - 7.0, 2.0), f"{percent:.1f} %")
                shares.axvline(k, color=LIGHT, linewidth=0.8, zorder=0)
        shares.set(
            xlabel="k", ylabel="share of points in %", xlim=(0, 4), ylim=(0, 102),
            title="Points within k sigma of the truth",
        )  # fmt: skip
        shares.legend(loc="best")
        errors.set(
            xlabel="predicted sigma of z in mm", ylabel="rms error in mm",
            title=f"Error over prediction: {found.ratio:.2f}" if found.rated else "No point",
        )  # fmt: skip
        many = found.count >= FEWEST
        if many.any():
            count = found.count[many]
            predicted = np.sqrt(found.predicted_mm[many] / count)
            measured = np.sqrt(found.square_mm[many] / count)
            ends = np.array([predicted.min() / 1.5, predicted.max() * 1.5])
            errors.plot(ends, ends, color=INK, linewidth=1.1, linestyle=(0, (4, 2)),
                        label="as predicted")  # fmt: skip
            errors.plot(ends, 2.0 * ends, ":", color=QUIET, linewidth=0.8, label="twice, half")
            errors.plot(ends, 0.5 * ends, ":", color=QUIET, linewidth=0.8)
            style: dict[str, Any] = {"color": COLOURS[0], "capsize": 2, "markersize": 5}
            chance = measured / np.sqrt(2.0 * count)
            errors.errorbar(predicted, measured, chance, fmt="o", label="points", **style)
            errors.set(xscale="log", yscale="log")
            levels = [k * 10.0**e for e in range(-4, 3) for k in (1, 2, 5)]
            plain_log(errors, "x", levels)
            plain_log(errors, "y", levels)
            errors.legend(loc="upper left")
        figure.savefig(file, format="png", dpi=130, metadata={"Description": str(found)})
