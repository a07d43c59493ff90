"""First harmonics at the limits of a phase: zero, on an axis, at the wrap."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from vrscan.data import pkg
from vrscan.fixed.cordic_vector import angle_bounds, cordic_vector
from vrscan.fixed.peak_position import peak_position
from vrscan.study.cases.case import STEP_PX, Case, LineCase, ModuleCase, Outcome
from vrscan.study.cases.case_errors import PHANTOM, Value, number, summary
from vrscan.study.cases.case_line import Line
from vrscan.study.cases.case_shapes import ANY_WIDTH, LEVEL, background, box, line

LEFT = 700
_one_window = partial(LineCase, window="threshold")  # a window's pixels are stated, and its phase
TURN = 1 << pkg.ANGLE_WIDTH


def _window(
    heights: list[int], position: float | None, flags: str = "", true: float | None = None
) -> Line:
    """Return a line whose window is just these pixels; positions are px from its left edge."""
    pixels = box(background(), LEFT, heights)
    place = None if position is None else LEFT + position
    middle = None if true is None else LEFT + true
    return line(pixels, flags, true=middle, window=(LEFT, LEFT + len(heights) - 1), position=place)


def _no_phase(heights: list[int]) -> Line:
    """Return a window without a harmonic, though its light has a middle."""
    above = np.array(heights) - LEVEL
    return _window(heights, None, "NO_PHASE", float(above @ np.arange(len(above)) / above.sum()))


def _cancelled() -> Iterator[Case]:
    combs = [_no_phase([1000, 3000] * (n // 2)) for n in (4, 6, 20, 50, 200, 254)]
    yield _one_window(
        "comb-even",
        "every second pixel of the window is dark: X and Y cancel",
        "N even: the first harmonic of a pattern of two pixels is exactly 0: NO_PHASE",
        tuple(combs),
        peak=ANY_WIDTH,
    )
    # sum (-1)^k e^(i 2 pi k / N) = e^(-i pi / N) / cos(pi / N): half a pixel before phase 0.
    odd = []
    for n in (5, 21, 51):
        comb = [1000, 3000] * (n // 2) + [1000]
        pixels = box(background(), LEFT, comb)
        # For the end samples of a dark comb the phase is opposite: half a turn further.
        place = (n / 2 - 0.5) % n
        odd.append(
            line(pixels, "", true=LEFT + (n - 1) / 2, window=(LEFT, LEFT + n - 1),
                 position=LEFT + place)
        )  # fmt: skip
    yield _one_window(
        "comb-odd-dark-ends",
        "N odd: a harmonic is left, that of the pair of equal ends",
        "opposite to the two dark ends, which are neighbours on the turn: the middle, to a step",
        tuple(odd),
    )
    bright = []
    for n in (5, 21, 51):
        comb = [3000, 1000] * (n // 2) + [3000]
        pixels = box(background(), LEFT, comb)
        bright.append(
            line(pixels, "", true=LEFT + (n - 1) / 2, window=(LEFT, LEFT + n - 1),
                 position=LEFT + n - 0.5)
        )  # fmt: skip
    yield _one_window(
        "comb-odd-bright-ends",
        "N odd: the harmonic is that of the bright ends",
        "between last and first pixel, which are neighbours on the turn: N - 1/2 from the left, "
        "half a pixel outside the window",
        tuple(bright),
        within_px=26.0,
    )
    flat = [_no_phase([2000] * n) for n in (3, 4, 16, 100, 255)]
    yield _one_window(
        "flat-window", "all samples alike", "no harmonic: NO_PHASE", tuple(flat), peak=ANY_WIDTH
    )
    nearly = [2000] * 20
    nearly[4] += 1
    yield _one_window(
        "flat-window-but-for-a-count",
        "one count in 40,000 decides the phase",
        "the place of that count: 1/38,800 of the sum is a phase still; sigma tells its worth",
        (_window(nearly, 4.0),),
    )


def _axes() -> Iterator[Case]:
    yield _one_window(
        "x-zero",
        "X = 0: Y / X is infinite",
        "a quarter turn or three, by the sign of Y: T/4 and 3T/4",
        (_window([1500, 3000, 1500, 1000], 1.0), _window([1500, 1000, 1500, 3000], 3.0)),
    )
    yield _one_window(
        "y-zero",
        "Y = 0: the sign of X decides, and phase 0 is phase 1",
        "half a turn: T/2. For phase 0 see phase-at-the-wrap",
        (_window([1000, 1500, 3000, 1500], 2.0), _window([1000, 2000, 3000, 2000], 2.0)),
    )
    yield _one_window(
        "x-and-y-zero",
        "atan2(0, 0)",
        "NO_PHASE",
        (_no_phase([3000, 1000, 3000, 1000]), _no_phase([1500, 2500, 1500, 2500])),
    )
    waves = []
    for n in (12, 20, 100):
        turn = 2.0 * np.pi * np.arange(n) / n
        waves.append(_window(np.rint(2000 + 1000 * np.sin(turn)).astype(int).tolist(), n / 4))
        waves.append(_window(np.rint(2000 - 1000 * np.sin(turn)).astype(int).tolist(), 3 * n / 4))
    yield _one_window(
        "window-antisymmetric",
        "what is high on one side is low on the other: the middle is not where the light is",
        "a sine over the whole window has its phase a quarter from its end: T/4 or 3T/4",
        tuple(waves),
        peak=ANY_WIDTH,
    )
    # sum k e^(i 2 pi k / N) = N e^(-i pi / N) / 2i sin(pi / N).
    ramps = [_window((1000 + 20 * np.arange(n)).tolist(), 0.75 * n - 0.5) for n in (9, 33, 101)]
    yield _one_window(
        "window-ramp",
        "the maximum is the window's last pixel",
        "(8) of a sawtooth: 3N/4 - 1/2, a quarter of the window before its maximum",
        tuple(ramps),
        peak=ANY_WIDTH,
    )


def _wrap_line(bump: int, count: int) -> Line:
    """Return 16-bit pixels whose phase is zero but for ``bump`` counts at sample ``count``."""
    heights = [60_000] + [3_000] * 254
    heights[count] += bump
    base = background(4096, 960, 16)
    pixels = box(base, 1000, heights, full=65_535)
    return line(pixels, "", true=1000.0, window=(1000, 1254))


def _wrap() -> Iterator[Case]:
    # One count at sample 127 of 255 is sin(pi / 255) counts of Y: half a step of 2^-24 turns.
    near = [_wrap_line(1, 127), _wrap_line(0, 0), _wrap_line(1, 128)]
    yield _one_window(
        "phase-at-the-wrap",
        "half a step of 2^-24 turns above 0, 0 itself, and half a step below: 0 or a whole T",
        "phases 0 and 1 are one: the left end, or one T on where the tables' last bits are below 0",
        tuple(near),
        within_px=255.0 + STEP_PX,
        pixel_width=16,
    )
    side = [_wrap_line(3000, 5), _wrap_line(3000, 250)]
    yield _one_window(
        "phase-beside-the-wrap",
        "a hot pixel at the end of an even window, and a count's weight on either side",
        "(8) with T = N, above 0 near the left end, below it near the right one, 253 px away",
        tuple(side),
        within_px=256.0,
        pixel_width=16,
    )

    def ends() -> Outcome:
        phase = np.array([0, 1, TURN // 2, TURN - 1])
        left = np.array([0, 1000, 0, 2048 - 16])
        period = np.full(4, 16)
        got = peak_position(left, period, phase, line_length=2048) * STEP_PX
        # A 16th of a step rounds to the step; the last one would be 2048, which does not fit.
        want = [0.0, 1000.0, 8.0, 2048.0 - STEP_PX]
        wrong = [
            f"phase {p}: {g}, want {w}" for p, g, w in zip(phase, got, want, strict=True) if g != w
        ]
        naive = left + phase / TURN * period
        return Outcome(
            "none",
            number(float(np.abs(got - naive).max()), "px"),
            number(0.0, "px"),
            tuple(wrong),
        )  # fmt: skip

    yield ModuleCase(
        "phase-largest-at-the-end",
        "the position rounds up to LineLength, which has a bit more",
        "the largest position below it; one step, 0.24e-3 px, is lost",
        ends,
        (
            "test_peak_position.py::random_windows_with_restart_and_reset",
            "test_peak_position.py::test_peak_position_model_is_equation_8",
            "test_chain_lines.py::test_chain_rtl_equals_model_on_whole_lines",
        ),
    )


def _cordic(pairs: list[tuple[int, int]], turns: list[float]) -> Outcome:
    """Return the outcome of vectors' angles against those computed by hand, turns."""
    x, y = np.array(pairs).T
    angle, magnitude, zero = cordic_vector(x, y, xy_width=pkg.HARMONIC_WIDTH, angle_width=24)
    off = (angle / TURN - turns + 0.5) % 1.0 - 0.5
    bound = angle_bounds(24)[0] / TURN
    wrong = [f"{pairs[k]}: off by {off[k]} turns" for k in np.flatnonzero(np.abs(off) > bound)]
    wrong += [f"{pairs[k]}: zero" for k in np.flatnonzero(zero)]
    wrong += [f"{pairs[k]}: no magnitude" for k in np.flatnonzero(magnitude == 0)]
    naive = [math.atan2(b, a) / (2.0 * math.pi) % 1.0 for a, b in pairs]
    there = [abs((n - t + 0.5) % 1.0 - 0.5) for n, t in zip(naive, turns, strict=True)]
    urad = 2e6 * math.pi
    return Outcome(
        "none",
        number(float(np.abs(off).max()) * urad, "urad"),
        number(max(there) * urad, "urad"),
        tuple(wrong),
    )


def _vectors() -> Iterator[Case]:
    least, most = -(1 << 47), (1 << 47) - 1
    tests = (
        "test_cordic_vector.py::random_vectors_back_to_back",
        "test_cordic_vector.py::test_cordic_vector_model_is_exact_on_axes_and_diagonals",
    )
    yield ModuleCase(
        "x-y-most-negative",
        "-2^47 has no positive counterpart in 48 bits",
        "angles 5/8, 1/2, 3/4, 7/8, 3/8 of a turn to 0.62 steps of 2^-24",
        lambda: _cordic(
            [(least, least), (least, 0), (0, least), (most, least), (least, most)],
            [0.625, 0.5, 0.75, 0.875, 0.375],
        ),
        tests,
    )
    yield ModuleCase(
        "x-y-smallest",
        "vectors of one unit in 48 bits",
        "normalised first: eighths of a turn to 0.62 steps",
        lambda: _cordic(
            [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)],
            [k / 8 for k in range(8)],
        ),
        (tests[0], "test_cordic_vector.py::test_cordic_vector_model_keeps_the_smallest_vectors"),
    )

    def nothing() -> Outcome:
        angle, magnitude, zero = cordic_vector(
            np.zeros(1, np.int64), np.zeros(1, np.int64), xy_width=48, angle_width=24
        )
        wrong = [] if zero[0] and not angle[0] and not magnitude[0] else ["(0, 0) is not zero"]
        found: list[Value] = [PHANTOM if math.isfinite(math.atan2(0.0, 0.0)) else math.nan]
        return Outcome("zero_o", "no position", summary(found, "px"), tuple(wrong))

    yield ModuleCase(
        "x-y-both-zero",
        "no vector, no angle; atan2(0, 0) is 0 by convention",
        "zero_o, angle and magnitude 0; NO_PHASE in the chain",
        nothing,
        (tests[0], "test_cordic_vector.py::test_cordic_vector_model_defines_the_zero_vector"),
    )


def cases() -> Iterator[Case]:
    """Return the entries of this module."""
    for part in (_cancelled, _axes, _wrap, _vectors):
        yield from part()
