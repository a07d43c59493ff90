"""The entries of the catalogue: lines for the whole chain, or a measurement on one module."""

import abc
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints, Pixels
from vrscan.data.config import Config, Geometry, Peak, Sensor
from vrscan.data.points import SIGMA_MOST, Points, table
from vrscan.data.table import Table
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal import geometry as ideal_geometry
from vrscan.ideal.chain import run as ideal_run
from vrscan.ideal.position import first_harmonic, windows
from vrscan.ideal.two_pass import baseline
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.study.cases import printed
from vrscan.study.cases.case_errors import (
    NO_POINT,
    NO_POSITION,
    OTHER_WINDOW,
    PHANTOM,
    Value,
    number,
    summary,
)
from vrscan.study.cases.case_line import Line
from vrscan.study.report.accuracy.position_accuracy import error_bounds, phase_bounds

CHAIN_TEST = "test_cases.py::test_chain_rtl_equals_model"
WARNINGS = ("AT_EDGE", "SATURATED", "RIVAL", "ROW_STATISTICS", "MIXED")
OF_THE_POINT = frozenset({"NO_RANGE", "OUT_OF_RANGE"})  # not for entries without angles
STEP_PX = 2.0**-pkg.POSITION_FRACTION
WINDOWS = ("fit", "threshold")  # of ``peak.window``, on the page: the shipped one first
SECOND_PX = 0.01  # a window that is half a pixel off the middle of a symmetric spot
FIT_STEPS, FIT_SHARE = 3.0, 0.2  # of a fit in integers against float64: steps, and share of sigma
UNNOTICED_PX = 0.05  # an error beyond this and four sigmas, without a warning, is told as such
NEAR_MM, NEAR_ERROR_MM = 1000.0, 2e-3  # the chain's x and z up to there
FARTHEST_MM = 4096.0  # of a range
# A second window's width comes from a table. Its middle is the first position or, where that is
# unreliable, that of the run. Either choice may differ too, so its ends are compared loosely.
TABLE_PX = 2

# Flags that depend on the cut of the run: a first window of two has a cut of its own.
OF_THE_WINDOW = frozenset({"AT_EDGE", "TOO_NARROW", "TOO_WIDE", "NO_PHASE", "RIVAL"})


@dataclass(frozen=True)
class Outcome:
    """The outcome of an entry.

    Attributes:
        flags: The flags that were raised, as the page shows them.
        here: The largest error of this chain, as the page shows it.
        printed: The largest error of the paper's equations in float64, as the page shows it.
        wrong: The results that differ from the definition, one line each.
        unnoticed: Lines with a wrong position without a warning, and the error of each, px.
    """

    flags: str
    here: str
    printed: str
    wrong: tuple[str, ...] = ()
    unnoticed: tuple[float, ...] = ()


@dataclass(frozen=True)
class Case(abc.ABC):
    """An entry: a stable name, what breaks there, and the defined result in words.

    Attributes:
        untold: Why no detector could know that the position is off, where the shipped window gives
            no warning; empty where it is not off, or warns.
    """

    name: str
    breaks: str
    defined: str
    untold: str = field(default="", kw_only=True)

    @property
    @abc.abstractmethod
    def rtl(self) -> tuple[str, ...]:
        """Return the tests in ``tb/`` that prove it at RTL, ``file::function``."""

    @property
    @abc.abstractmethod
    def modes(self) -> tuple[str, ...]:
        """Return the windows with which it is shown, values of ``peak.window``, the first first."""

    @abc.abstractmethod
    def outcome(self, window: str | None = None) -> Outcome:
        """Return the model's outcome, checked against the definition.

        Args:
            window: A value of ``peak.window``; the first of ``modes`` if None.
        """


@dataclass(frozen=True)
class ModuleCase(Case):
    """An entry that concerns one module."""

    measure: Callable[[], Outcome]
    tests: tuple[str, ...]

    @property
    def rtl(self) -> tuple[str, ...]:
        """Return the tests of the module."""
        return self.tests

    @property
    def modes(self) -> tuple[str, ...]:
        """Return the shipped window: the outcome does not depend on it."""
        return WINDOWS[:1]

    def outcome(self, window: str | None = None) -> Outcome:
        """Return the twin's outcome, which does not depend on the window."""
        del window
        return self.measure()


@dataclass(frozen=True)
class LineCase(Case):
    """An entry that consists of lines through the whole chain.

    Attributes:
        lines: The lines, all of one length.
        within_px: Largest distance of a position from ``true``, by the argument in ``defined``.
        fit_px: The same distance with a fit; as with a second window, the larger of 0.01 px and
            ``within_px``, if None.
        window: The window of which it is a statement, a value of ``peak.window``; None: any.
        peak: Thresholds that differ from the shipped ones.
        pixel_width: Bits of a pixel.
        saturation_level: Least saturated pixel; full scale if None.
        geometry: The triangle; with ``angle_deg`` the errors are those of the point, mm.
        angle_deg: Scan angle of every line; none where only the position matters.
        no_range: Lines whose rays do not meet in front of mirror and camera.
        out_of_range: Lines whose point does not fit in its format, so there is none.
    """

    lines: tuple[Line, ...] = ()
    within_px: float = STEP_PX
    fit_px: float | None = None
    window: str | None = None
    peak: Peak = field(default_factory=Peak)
    pixel_width: int = 12
    saturation_level: int | None = None
    geometry: Geometry = field(default_factory=Geometry)
    angle_deg: tuple[float, ...] = ()
    no_range: tuple[int, ...] = ()
    out_of_range: tuple[int, ...] = ()

    @property
    def rtl(self) -> tuple[str, ...]:
        """Return the test that sends every entry's lines through the RTL."""
        return (CHAIN_TEST,)

    @property
    def line_length(self) -> int:
        """Return the number of pixels of a line."""
        return len(self.lines[0].pixels)

    @property
    def build(self) -> tuple[int, int]:
        """Return ``LineLength`` and ``PixelWidth`` of the RTL."""
        return self.line_length, self.pixel_width

    @property
    def modes(self) -> tuple[str, ...]:
        """Return the windows with which it is shown."""
        return WINDOWS if self.window is None else (self.window,)

    def config(self, window: str | None = None) -> Config:
        """Return the configuration of the entry.

        Raises:
            ValidationError: if there is no such window.
        """
        chosen = {"window": window or self.modes[0]}
        peak = Peak.model_validate(self.peak.model_dump() | chosen)
        sensor = Sensor(
            pixel_width=self.pixel_width,
            line_length=self.line_length,
            saturation_level=self.saturation_level,
        )
        geometry = self.geometry
        if not self.angle_deg:  # the triangle does not matter, but its centre must fit
            geometry = geometry.model_copy(update={"centre_px": (self.line_length - 1) / 2})
        return Config(peak=peak, sensor=sensor, geometry=geometry)

    @cached_property
    def pixels(self) -> Pixels:
        """Return the pixels in counts, uint16 [n, length]."""
        return np.stack([line.pixels for line in self.lines]).astype(np.uint16)

    @cached_property
    def angle_rad(self) -> Floats:
        """Return the scan angles [n]."""
        return np.asarray(np.radians(np.array(self.angle_deg or [0.0] * len(self.lines))))

    @property
    def power(self) -> Ints:
        """Return the laser power [n]; no entry depends on it."""
        return np.full(len(self.lines), 20_000, np.int64)

    def points(self, window: str | None = None, *, neighbours: bool = False) -> Points:
        """Return the points of the model, of lines that are neighbours or have none."""
        registers = Registers.from_config(self.config(window))
        given = self.pixels, angle_turns(self.angle_rad), self.power, registers
        return run_fixed(*given, breaks=() if neighbours else range(1, len(self.lines)))

    def oracle(self, window: str | None = None) -> Table:
        """Return the points of the equations in float64 in the form of this chain."""
        given = self.pixels, self.angle_rad, self.power, self.config(window)
        return ideal_run(*given, breaks=range(1, len(self.lines)))

    def outcome(self, window: str | None = None) -> Outcome:
        """Return the model's outcome for the lines, checked against the definition."""
        window = window or self.modes[0]
        got = table(self.points(window))
        wrong, bound = self._against_equations(got, window)
        wrong += self._against_statement(got, window, bound)
        places = [printed.place(line.pixels) for line in self.lines]
        if self.angle_deg:
            here, there, more = self._points_mm(got)
            wrong += more
            unit = "mm"
        else:
            here = [_error(got, k, line, window) for k, line in enumerate(self.lines)]
            there = [
                printed.position_error(p, line) for p, line in zip(places, self.lines, strict=True)
            ]
            unit = "px"
        return Outcome(
            flags=flag_text(got, frozenset() if self.angle_deg else OF_THE_POINT),
            here=summary(here, unit),
            printed=summary(there, unit),
            wrong=tuple(wrong),
            unnoticed=tuple(_unnoticed(got, self.lines)),
        )

    def _against_equations(self, got: Table, window: str) -> tuple[list[str], Floats]:
        """Compare flags, window and position with those of the equations in float64.

        Returns:
            The differences, and the largest error of a position that the widths of the formats
            allow, px [n].
        """
        want = self.oracle(window)
        second = window != "threshold"
        wrong = []
        for name, where in want.flags.items():
            # The last bit decides the one where rays are parallel, a format's end the other.
            if name in OF_THE_POINT:
                continue
            for k in np.flatnonzero(got.flags[name] != where):
                wrong.append(f"line {k}: {name} is {got.flags[name][k]}, not as in float64")
        for name in ("left", "right", "width"):
            mine, theirs = getattr(got, name), getattr(want, name)
            away: Ints | int = 0
            if second:
                away = np.full(len(got), TABLE_PX) if name == "width" else want.width // 4
            meant = (got.width > 0) | (name == "width")
            for k in np.flatnonzero(meant & (np.abs(mine - theirs) > away)):
                wrong.append(f"line {k}: {name} is {mine[k]}, {theirs[k]} in float64")

        # The equations are applied to the very window that was taken. A fit that does not stand
        # leaves its position, and one that stands is that of the fit in float64.
        rows = np.flatnonzero(got.measured)
        left, width = got.left[rows], got.width[rows]
        heights = windows(self.pixels[rows], left, width)
        slope = baseline(self.pixels[rows], left, width, got.noise[rows]) if second else None
        exact = first_harmonic(
            heights,
            width,
            period_n=True,
            background=got.background[rows],
            noise=got.noise[rows],
            kappa=self.peak.kappa,
            slope=slope,
        )
        inside = np.arange(heights.shape[1]) < width[:, None]
        total = np.where(inside, heights - got.background[rows][:, None], 0.0).sum(axis=1)
        nothing, extra = np.zeros(len(rows)), width.astype(np.float64)
        angles = phase_bounds(width, width, total, extra, exact.magnitude, nothing)
        bound = np.zeros(len(got))
        bound[rows] = error_bounds(width, *angles)[0]
        if second:
            # The baseline is rounded to aligned counts: half of one at each pixel, either way.
            half = 0.5 / (1 << (pkg.ALIGNED_WIDTH - self.pixel_width))
            turned = 2.0 / np.pi * half * width / np.maximum(exact.magnitude, half)
            bound[rows] += width / (2.0 * np.pi) * turned
        error = (got.position_px[rows] - left - exact.delta + width / 2.0) % width - width / 2.0
        off = np.abs(error) > bound[rows]
        if window == "fit":
            apart = np.abs(got.position_px[rows] - want.position_px[rows])
            off &= apart > FIT_STEPS * STEP_PX + FIT_SHARE * got.sigma_px[rows]
        for k in np.flatnonzero(off & ~exact.no_phase):
            wrong.append(
                f"line {rows[k]}: position {got.position_px[rows[k]]:.5f} px, "
                f"{left[k] + exact.delta[k]:.5f} in float64, more than the "
                f"{bound[rows[k]]:.1e} that the widths allow"
            )
        return wrong, bound

    def _against_statement(self, got: Table, window: str, bound: Floats) -> list[str]:
        """Compare the result with the statements of the entry itself."""
        wrong = []
        one_pass, stated_in = window == "threshold", (*self.modes, *WINDOWS)
        within = self.within_px
        if window == "fit" and self.fit_px is not None:
            within = self.fit_px
        elif not one_pass:
            within = max(within, SECOND_PX)
        for k, line in enumerate(self.lines):
            raised = frozenset(name for name, where in got.flags.items() if where[k])
            raised -= OF_THE_POINT
            stated = line.raises(window)
            if stated is not None:
                loose = frozenset() if window in stated_in else OF_THE_WINDOW
                if (raised ^ stated) - loose:
                    wrong.append(f"line {k}: flags {sorted(raised)}, want {sorted(stated)}")
            measured = line.measured(window) if window in stated_in else None
            if measured is not None and got.measured[k] != measured:
                wrong.append(f"line {k}: measured is {got.measured[k]}, want {measured}")
            span = (int(got.left[k]), int(got.right[k]))
            if one_pass and line.window is not None and span != line.window:
                wrong.append(f"line {k}: window {span}, want {line.window}")
            if not got.measured[k]:
                if got.position_px[k] != 0.0:
                    wrong.append(f"line {k}: not measured, but at {got.position_px[k]} px")
                continue
            if one_pass and line.position is not None:
                off = abs(got.position_px[k] - line.position)
                if off > max(STEP_PX, bound[k]):
                    wrong.append(
                        f"line {k}: at {got.position_px[k]:.5f} px, want {line.position:.5f}"
                    )
            if line.true is not None and abs(got.position_px[k] - line.true) > within:
                wrong.append(
                    f"line {k}: {got.position_px[k] - line.true:+.4f} px from the spot, more than "
                    f"{within:g}"
                )
        return wrong

    def _points_mm(self, got: Table) -> tuple[list[Value], list[Value], list[str]]:
        """Return the errors of the points, here and as printed, and the results that are wrong."""
        wrong: list[str] = []
        here: list[Value] = []
        there: list[Value] = []
        behind: list[float] = []  # z as printed where there is no point
        for name, stated in (("NO_RANGE", self.no_range), ("OUT_OF_RANGE", self.out_of_range)):
            raised = tuple(np.flatnonzero(got.flags[name]).tolist())
            if raised != stated:
                wrong.append(f"{name} on lines {raised}, want {stated}")
        for k, line in enumerate(self.lines):
            assert line.true is not None  # a point needs a spot
            angle = float(got.angle_rad[k])
            u, _ = ideal_geometry.undistorted(np.array(line.true), self.geometry)
            point = ideal_geometry.triangle(u, np.array(angle), self.geometry)
            x, z = printed.point(line.true, angle, self.geometry)
            if k in self.no_range or k in self.out_of_range:
                reach = math.hypot(float(point.x), float(point.z))
                if k in self.no_range and reach < FARTHEST_MM and not point.no_range:
                    wrong.append(f"line {k}: NO_RANGE, and the rays meet {reach:.0f} mm away")
                if got.located[k] or got.x_mm[k] or got.z_mm[k] or got.c_obj[k]:
                    wrong.append(f"line {k}: without a range, and a point")
                if got.sigma_z_mm[k] != SIGMA_MOST:
                    wrong.append(f"line {k}: without a range, and sigma_z {got.sigma_z_mm[k]} mm")
                here.append(NO_POINT)
                behind.append(z)
                continue
            off = max(abs(got.x_mm[k] - float(point.x)), abs(got.z_mm[k] - float(point.z)))
            here.append(off)
            there.append(max(abs(x - float(point.x)), abs(z - float(point.z))))
            reach = math.hypot(float(point.x), float(point.z))
            # A position has half a step of its own, which the slope dz/du carries to z.
            spread = abs(float(point.slope)) * self.geometry.pitch_mm * STEP_PX
            allowed = NEAR_ERROR_MM * max(1.0, (reach / NEAR_MM) ** 2) + spread
            if off > allowed:
                wrong.append(f"line {k}: point off by {off:.4f} mm, more than {allowed:.4f}")
        if behind:
            ends = dict.fromkeys(number(z, "mm") for z in (min(behind), max(behind)))
            there += [f"{'points' if len(ends) > 1 else 'a point'} at z {' to '.join(ends)}"]
            there = there if len(there) > 1 else there * len(self.lines)
        return here, there, wrong


@dataclass(frozen=True)
class SpreadCase(LineCase):
    """Lines whose positions should be equal: the error is their spread."""

    def outcome(self, window: str | None = None) -> Outcome:
        """Return the spread of the positions, checked against ``within_px``."""
        base = super().outcome(window)
        got = table(self.points(window))
        here = float(np.ptp(got.position_px))
        wrong = [*base.wrong, *(f"line {k}: not measured" for k in np.flatnonzero(~got.measured))]
        if here > self.within_px:
            wrong.append(f"positions differ by {here:.4f} px, more than {self.within_px:g}")
        found = [printed.place(line.pixels).position for line in self.lines]
        places = [place for place in found if not isinstance(place, str)]
        there: list[Value] = [place for place in found if isinstance(place, str)]
        if places:
            there.append(max(places) - min(places))
        return Outcome(base.flags, number(here, "px"), summary(there, "px"), tuple(wrong))


def _error(got: Table, k: int, line: Line, window: str) -> Value:
    """Return the error of a position, px, or a word where there is no position."""
    if not got.measured[k]:
        return NO_POSITION
    right = line.true
    if right is None and line.position is not None:
        # The entry states the place of the one window only.
        if window != "threshold":
            return OTHER_WINDOW
        right = line.position
    return PHANTOM if right is None else abs(float(got.position_px[k]) - right)


def _unnoticed(got: Table, lines: Sequence[Line]) -> list[float]:
    """Return the errors of wrong positions without a warning."""
    found = []
    for k, line in enumerate(lines):
        if line.true is None or not got.measured[k] or any(got.flags[n][k] for n in WARNINGS):
            continue
        off = abs(float(got.position_px[k]) - line.true)
        if off > max(UNNOTICED_PX, 4.0 * float(got.sigma_px[k])):
            found.append(off)
    return found


def flag_text(got: Table, leave_out: frozenset[str] = OF_THE_POINT) -> str:
    """Return the flags of all lines, each with its number of lines where not all have it."""
    parts = []
    for name, where in got.flags.items():
        count = int(where.sum())
        if count and name not in leave_out:
            parts.append(name if count == len(got) else f"{name} ({count} of {len(got)})")
    return ", ".join(parts) or "none"
