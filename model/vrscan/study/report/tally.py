"""Errors of a simulated scan's points against the truth, for any number of lines."""

from dataclasses import dataclass, fields

import numpy as np

from vrscan.data.arrays import Bools, Floats
from vrscan.data.lines import Truth
from vrscan.data.table import Table
from vrscan.study.report.reliability_report import ASTRAY_PX, Reliability


@dataclass(frozen=True)
class Errors:
    """The errors of one surface's points in z."""

    name: str
    lines: int  # number of lines with a spot that the camera sees
    points: int
    astray: int  # points more than ``ASTRAY_PX`` off on the sensor: on another spot
    mean_mm: float  # mean error of the other points, positive where they lie too deep
    rms_mm: float  # rms error of these points, as all that follows
    max_mm: float
    rms_percent: float  # rms error over the range
    max_percent: float
    ratio: float  # rms of error over predicted sigma: 1 where the prediction is right


@dataclass(frozen=True)
class Sums:
    """The sums from which the errors of one surface are computed."""

    lines: int = 0  # as in ``Errors``, like points
    points: int = 0
    good: int = 0  # points that are not astray
    sum_mm: float = 0.0
    square_mm: float = 0.0
    max_mm: float = 0.0
    square_percent: float = 0.0
    max_percent: float = 0.0
    rated: int = 0  # good points with a predicted sigma
    square_ratio: float = 0.0

    def __add__(self, other: "Sums") -> "Sums":
        """Return the sums of all lines of both."""
        pairs = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        return Sums(**{n: max(p) if n.startswith("max") else sum(p) for n, p in pairs.items()})

    def errors(self, name: str) -> Errors:
        """Return the errors of the surface; NaN where there is no point."""

        def rms(square: float, count: int) -> float:
            return float(np.sqrt(square / count)) if count else float("nan")

        return Errors(
            name=name,
            lines=self.lines,
            points=self.points,
            astray=self.points - self.good,
            mean_mm=self.sum_mm / self.good if self.good else float("nan"),
            rms_mm=rms(self.square_mm, self.good),
            max_mm=self.max_mm if self.good else float("nan"),
            rms_percent=rms(self.square_percent, self.good),
            max_percent=self.max_percent if self.good else float("nan"),
            ratio=rms(self.square_ratio, self.rated),
        )


@dataclass(frozen=True)
class Tally:
    """The sums of some lines: for each surface, and for all of them last."""

    names: tuple[str, ...]  # names of the surfaces
    sums: tuple[Sums, ...]
    lines: int
    points: int
    dark: int  # number of lines whose spot the camera cannot see
    stray: int  # number of these lines with a point
    reliability: Reliability  # errors against the predicted sigma, of points without a flag

    @classmethod
    def of(cls, result: Table, truth: Truth) -> "Tally":
        """Return the sums of lines from their points and truth."""
        seen = np.isfinite(truth.position_px)
        where = [truth.surface == index for index in range(len(truth.names))]
        where.append(np.ones(len(result), np.bool_))
        return cls(
            names=truth.names,
            sums=tuple(_sums(rows & seen, result, truth) for rows in where),
            lines=len(result),
            points=int(result.located.sum()),
            dark=int((~seen).sum()),
            stray=int((result.located & ~seen).sum()),
            reliability=Reliability.of(result, truth),
        )

    def __add__(self, other: "Tally") -> "Tally":
        """Return the sums of the lines of both, which belong to one scene."""
        return Tally(
            names=self.names,
            sums=tuple(a + b for a, b in zip(self.sums, other.sums, strict=True)),
            lines=self.lines + other.lines,
            points=self.points + other.points,
            dark=self.dark + other.dark,
            stray=self.stray + other.stray,
            reliability=self.reliability + other.reliability,
        )

    def errors(self) -> list[Errors]:
        """Return the errors of each surface, and of all of them last."""
        named = zip((*self.names, "all"), self.sums, strict=True)
        return [sums.errors(name) for name, sums in named]


def _sums(where: Bools, result: Table, truth: Truth) -> Sums:
    found = where & result.located
    with np.errstate(invalid="ignore"):
        good = found & (np.abs(result.position_px - truth.position_px) <= ASTRAY_PX)
    signed = result.z_mm[good] - truth.z_mm[good]
    error = np.abs(signed)
    share = 100.0 * error / truth.z_mm[good]  # spot and point are on one ray
    sigma = result.sigma_z_mm[good]
    ratio = error[sigma > 0.0] / sigma[sigma > 0.0]  # a sigma may round to 0

    def square(values: Floats) -> float:
        return float(np.square(values).sum())

    return Sums(
        lines=int(where.sum()),
        points=int(found.sum()),
        good=int(good.sum()),
        sum_mm=float(signed.sum()),
        square_mm=square(error),
        max_mm=float(error.max(initial=0.0)),
        square_percent=square(share),
        max_percent=float(share.max(initial=0.0)),
        rated=len(ratio),
        square_ratio=square(ratio),
    )
