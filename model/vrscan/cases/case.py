"""What an entry of the catalogue is: lines for the whole chain, or a measurement on one module."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from vrscan import engines
from vrscan.arrays import Floats, Ints, Pixels
from vrscan.cases import printed
from vrscan.cases.errors import NO_POINT, NO_POSITION, PHANTOM, Value, number, summary
from vrscan.chain import run_fixed
from vrscan.config import Config, Geometry, Peak, Sensor
from vrscan.engines import Engine
from vrscan.fixed import pkg
from vrscan.ideal import geometry as ideal_geometry
from vrscan.lines import Lines
from vrscan.points import Points, table
from vrscan.registers import Registers, angle_turns
from vrscan.report.accuracy.position import error_bounds, phase_bounds
from vrscan.table import Table

CHAIN_TEST = "test_hard_cases.py::test_chain_rtl_equals_model"
UNMEASURED = frozenset({"LOW_SNR", "TOO_NARROW", "TOO_WIDE", "NO_PHASE"})
WARNINGS = ("AT_EDGE", "SATURATED", "RIVAL", "ROW_STATISTICS")
OF_THE_POINT = frozenset({"NO_RANGE", "OUT_OF_RANGE"})  # which an entry without angles is not about
STEP_PX = 2.0**-pkg.POSITION_FRACTION
STEP_MM = 2.0**-pkg.LENGTH_FRACTION
UNNOTICED_PX = 0.05  # an error beyond this and four sigmas, without a warning, is told as such
NEAR_MM, NEAR_ERROR_MM = 1000.0, 2e-3  # the chain's x and z up to there
FARTHEST_MM = 4096.0  # of a range
SIGMA_MAX_MM = (2**pkg.SIGMA_WIDTH - 1) * 2.0**-pkg.SIGMA_FRACTION

# Flags that a second pass over a narrower window need not share with the first.
OF_THE_WINDOW = frozenset({"AT_EDGE", "TOO_NARROW", "TOO_WIDE", "NO_PHASE"})


@dataclass(frozen=True)
class Line:
    """One sensor line, and what is defined for it.

    Attributes:
        pixels: Counts [length].
        flags: Names of the flags that it raises, exactly; None: those that the equations raise.
        true: Where the spot is, px; None where there is none, or none that could be told.
        window: First and last pixel of the one-pass window, px; None: those of the equations.
        position: By (8) with T = N over the one-pass window, px; None: that of the equations.
    """

    pixels: Pixels
    flags: frozenset[str] | None = frozenset()
    true: float | None = None
    window: tuple[int, int] | None = None
    position: float | None = None

    @property
    def measured(self) -> bool | None:
        """Whether it has a position; None where its flags are not stated."""
        return None if self.flags is None else not self.flags & UNMEASURED


@dataclass(frozen=True)
class Outcome:
    """What came of an entry.

    Attributes:
        flags: The flags that were raised, as the page shows them.
        here: The largest error of this chain, as the page shows it.
        printed: The same of the paper's equations in float64.
        wrong: What is not as defined, one line each.
        unnoticed: Lines with a position that is off without a warning, and how far, px.
    """

    flags: str
    here: str
    printed: str
    wrong: tuple[str, ...] = ()
    unnoticed: tuple[float, ...] = ()


@dataclass(frozen=True)
class Case:
    """An entry: a stable name, what breaks there, and the defined result in words."""

    name: str
    breaks: str
    defined: str

    @property
    def rtl(self) -> tuple[str, ...]:
        """The tests in ``tb/`` that prove it at RTL, ``file::function``."""
        raise NotImplementedError

    def outcome(self, window: str = "threshold") -> Outcome:
        """Return what the model makes of it, checked against what is defined.

        Args:
            window: Mode of the window, as ``peak.window``.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class ModuleCase(Case):
    """An entry that lives in one module."""

    measure: Callable[[], Outcome]
    tests: tuple[str, ...]

    @property
    def rtl(self) -> tuple[str, ...]:
        """The tests of the module."""
        return self.tests

    def outcome(self, window: str = "threshold") -> Outcome:
        """Return what the twin makes of it; the window's mode does not matter to it."""
        del window
        return self.measure()


@dataclass(frozen=True)
class LineCase(Case):
    """An entry that is lines through the whole chain.

    Attributes:
        lines: The lines, all of one length.
        within_px: How near to ``true`` a position is, by the argument in ``defined``.
        peak: Thresholds that differ from the shipped ones.
        pixel_width: Bits.
        geometry: The triangle; with ``angle_deg`` the errors are those of the point, mm.
        angle_deg: Scan angle of every line; none where only the position matters.
        no_range: Lines whose rays do not meet before mirror and camera.
        out_of_range: Lines whose point does not fit in its format.
    """

    lines: tuple[Line, ...] = ()
    within_px: float = STEP_PX
    peak: Peak = field(default_factory=Peak)
    pixel_width: int = 12
    geometry: Geometry = field(default_factory=Geometry)
    angle_deg: tuple[float, ...] = ()
    no_range: tuple[int, ...] = ()
    out_of_range: tuple[int, ...] = ()

    @property
    def rtl(self) -> tuple[str, ...]:
        """The test that sends every entry's lines through the RTL."""
        return (CHAIN_TEST,)

    @property
    def line_length(self) -> int:
        """Pixels of a line."""
        return len(self.lines[0].pixels)

    @property
    def build(self) -> tuple[int, int]:
        """``LineLength`` and ``PixelWidth`` of the RTL."""
        return self.line_length, self.pixel_width

    def config(self, window: str = "threshold") -> Config:
        """Return the configuration that it runs with.

        Raises:
            ValidationError: if there is no such mode of the window.
        """
        peak = Peak.model_validate(self.peak.model_dump() | {"window": window})
        sensor = Sensor(pixel_width=self.pixel_width, line_length=self.line_length)
        geometry = self.geometry
        if not self.angle_deg:  # the triangle does not matter, but its centre must fit
            geometry = geometry.model_copy(update={"centre_px": (self.line_length - 1) / 2})
        return Config(peak=peak, sensor=sensor, geometry=geometry)

    @cached_property
    def pixels(self) -> Pixels:
        """Counts, uint16 [n, length]."""
        return np.stack([line.pixels for line in self.lines]).astype(np.uint16)

    @cached_property
    def angle_rad(self) -> Floats:
        """Scan angles [n]."""
        return np.asarray(np.radians(np.array(self.angle_deg or [0.0] * len(self.lines))))

    @property
    def power(self) -> Ints:
        """Laser power [n]; no entry depends on it."""
        return np.full(len(self.lines), 20_000, np.int64)

    def points(self, window: str = "threshold") -> Points:
        """Return the points of the model."""
        registers = Registers.from_config(self.config(window))
        return run_fixed(self.pixels, angle_turns(self.angle_rad), self.power, registers)

    def oracle(self, window: str = "threshold") -> Table:
        """Return the points of the equations in float64, as this chain has them."""
        recording = Lines(self.pixels, self.angle_rad, self.power)
        return engines.run(Engine.IDEAL, recording, self.config(window))

    def outcome(self, window: str = "threshold") -> Outcome:
        """Return what the model makes of the lines, checked against what is defined."""
        got = table(self.points(window))
        want = self.oracle(window)
        bound = self._bounds_px(want)
        wrong = self._against_equations(got, want, bound)
        wrong += self._against_statement(got, window, bound)
        places = [printed.place(line.pixels) for line in self.lines]
        if self.angle_deg:
            here, there, more = self._points_mm(got)
            wrong += more
            unit = "mm"
        else:
            here = [_error(got, k, line) for k, line in enumerate(self.lines)]
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

    def _against_equations(self, got: Table, want: Table, bound: Floats) -> list[str]:
        """Compare flags, window and position with those of the equations in float64."""
        wrong = []
        for name, where in want.flags.items():
            if name == "NO_RANGE":  # decided by the last bit where rays are parallel
                continue
            for k in np.flatnonzero(got.flags[name] != where):
                wrong.append(f"line {k}: {name} is {got.flags[name][k]}, not as in float64")
        both = got.measured & want.measured
        for name in ("left", "right", "width"):
            mine, theirs = getattr(got, name), getattr(want, name)
            meant = (got.width > 0) | (name == "width")
            for k in np.flatnonzero(meant & (mine != theirs)):
                wrong.append(f"line {k}: {name} is {mine[k]}, {theirs[k]} in float64")
        width = np.maximum(want.width, 1)
        error = (got.position_px - want.position_px + width / 2.0) % width - width / 2.0
        for k in np.flatnonzero(both & (np.abs(error) > bound)):
            wrong.append(
                f"line {k}: position {got.position_px[k]:.5f} px, {want.position_px[k]:.5f} in "
                f"float64, more than the {bound[k]:.1e} that the widths allow"
            )
        return wrong

    def _bounds_px(self, want: Table) -> Floats:
        """Return by how much the widths of the formats let a position err, T = N, px [n]."""
        total, harmonic = np.ones(len(want)), np.ones(len(want))
        for k in np.flatnonzero(want.measured):
            left, count = int(want.left[k]), int(want.width[k])
            height = self.pixels[k, left : left + count] - want.background[k]
            turn = 2.0 * np.pi * np.arange(count) / count
            total[k] = height.sum()
            harmonic[k] = math.hypot(height @ np.cos(turn), height @ np.sin(turn))
        width = np.maximum(want.width, 3)
        nothing = np.zeros(len(want))
        worst, typical = phase_bounds(width, width, total, width * 1.0, harmonic, nothing)
        return error_bounds(width, worst, typical)[0]

    def _against_statement(self, got: Table, window: str, bound: Floats) -> list[str]:
        """Compare with what the entry itself states."""
        wrong = []
        one_pass = window == "threshold"
        for k, line in enumerate(self.lines):
            raised = frozenset(name for name, where in got.flags.items() if where[k])
            raised -= OF_THE_POINT
            stated = line.flags
            if stated is not None:
                differ = raised ^ stated if one_pass else (raised ^ stated) - OF_THE_WINDOW
                if differ:
                    wrong.append(f"line {k}: flags {sorted(raised)}, want {sorted(stated)}")
            if one_pass and line.measured is not None and got.measured[k] != line.measured:
                wrong.append(f"line {k}: measured is {got.measured[k]}, want {line.measured}")
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
            if line.true is not None and abs(got.position_px[k] - line.true) > self.within_px:
                wrong.append(
                    f"line {k}: {got.position_px[k] - line.true:+.4f} px from the spot, more than "
                    f"{self.within_px:g}"
                )
        return wrong

    def _points_mm(self, got: Table) -> tuple[list[Value], list[Value], list[str]]:
        """Return the errors of the points, here and as printed, and what is not as defined."""
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
            if k in self.no_range:
                near = math.hypot(float(point.x), float(point.z)) < FARTHEST_MM
                if got.x_mm[k] or got.z_mm[k] or (near and not point.no_range):
                    wrong.append(f"line {k}: NO_RANGE, and a point")
                if got.sigma_z_mm[k] != SIGMA_MAX_MM:
                    wrong.append(f"line {k}: NO_RANGE, and sigma_z {got.sigma_z_mm[k]} mm")
                here.append(NO_POINT)
                behind.append(z)
                continue
            off = max(abs(got.x_mm[k] - float(point.x)), abs(got.z_mm[k] - float(point.z)))
            here.append(off)
            there.append(max(abs(x - float(point.x)), abs(z - float(point.z))))
            if k not in self.out_of_range:
                reach = math.hypot(float(point.x), float(point.z))
                # A position has half a step of its own, which goes with the slope dz/du.
                spread = abs(float(point.slope)) * self.geometry.pitch_mm * STEP_PX
                allowed = NEAR_ERROR_MM * max(1.0, (reach / NEAR_MM) ** 2) + spread
                if off > allowed:
                    wrong.append(f"line {k}: point off by {off:.4f} mm, more than {allowed:.4f}")
        if behind:
            ends = dict.fromkeys(number(z, "mm") for z in (min(behind), max(behind)))
            there += [f"{'points' if len(ends) > 1 else 'a point'} at z {' to '.join(ends)}"]
            there = there if len(there) > 1 else there * len(self.lines)
        return here, there, wrong


def _error(got: Table, k: int, line: Line) -> Value:
    """Return the error of a position, px, or what there is instead."""
    if not got.measured[k]:
        return NO_POSITION
    if line.true is None:
        return PHANTOM if line.position is None else abs(float(got.position_px[k]) - line.position)
    return abs(float(got.position_px[k]) - line.true)


def _unnoticed(got: Table, lines: Sequence[Line]) -> list[float]:
    """Return the errors of positions that are off, and that nothing tells of."""
    found = []
    for k, line in enumerate(lines):
        if line.true is None or not got.measured[k] or any(got.flags[n][k] for n in WARNINGS):
            continue
        off = abs(float(got.position_px[k]) - line.true)
        if off > max(UNNOTICED_PX, 4.0 * float(got.sigma_px[k])):
            found.append(off)
    return found


def flag_text(got: Table, leave_out: frozenset[str] = OF_THE_POINT) -> str:
    """Return the flags of all lines, each with how many have it where not all do."""
    parts = []
    for name, where in got.flags.items():
        count = int(where.sum())
        if count and name not in leave_out:
            parts.append(name if count == len(got) else f"{name} ({count} of {len(got)})")
    return ", ".join(parts) or "none"
