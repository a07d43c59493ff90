"""Sums, roots and quotients of a line at the ends of their ranges, for every width and length."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Pixels
from vrscan.data.config import Peak
from vrscan.data.points import table
from vrscan.fixed.divide import divide
from vrscan.fixed.square_root import square_root
from vrscan.study.cases import printed
from vrscan.study.cases.case import Case, LineCase, ModuleCase, Outcome, flag_text
from vrscan.study.cases.case_errors import Value, number, summary
from vrscan.study.cases.case_shapes import (
    FULL,
    LENGTH,
    LEVEL,
    background,
    box,
    clipped,
    line,
    spot,
    with_spots,
)

PARTS = tuple(np.arange(0.0, 1.0, 0.125).tolist())
WRAP_32 = 1 << 32


def exact_variance(pixels: Pixels) -> Fraction:
    """Return the population variance of a line, counts squared."""
    values = [int(p) for p in pixels]
    count = len(values)
    return Fraction(count * sum(v * v for v in values) - sum(values) ** 2, count * count)


def variance_in_32_bits(pixels: Pixels) -> Fraction:
    """Return the variance that results from sums that wrap at 2^32."""
    values = [int(p) for p in pixels]
    count = len(values)
    squares, total = sum(v * v for v in values) % WRAP_32, sum(values) % WRAP_32
    return Fraction(count * squares - total * total, count * count)


@dataclass(frozen=True)
class VarianceCase(LineCase):
    """Lines whose row variance is the subject: the page shows its error, counts squared."""

    def outcome(self, window: str | None = None) -> Outcome:
        """Return the errors of the row variance."""
        base = super().outcome(window)
        got = table(self.points(window))
        step = 2.0 ** (2 * self.pixel_width - pkg.VARIANCE_WIDTH)
        here: list[Value] = []
        there: list[Value] = []
        short: list[Value] = []
        wrong = list(base.wrong)
        for k, entry in enumerate(self.lines):
            exact = exact_variance(entry.pixels)
            here.append(float(abs(Fraction(float(got.row_variance[k])) - exact)))
            if float(here[-1]) > step / 2.0:
                wrong.append(f"line {k}: row_variance off by {here[-1]}, more than half a step")
            _, deviation = printed.naive_deviation(entry.pixels)
            there.append(float(abs(Fraction(deviation * deviation) - exact)))
            short.append(float(abs(variance_in_32_bits(entry.pixels) - exact)))
        unit = "counts^2"
        text = f"{summary(there, unit)}; sums of 32 bits: {summary(short, unit)}"
        return Outcome(flag_text(got), summary(here, unit), text, tuple(wrong))


def _moments() -> Iterator[Case]:
    comb = np.where(np.arange(4096) % 2 == 0, 0, 65_535).astype(np.uint16)
    yield VarianceCase(
        "variance-largest",
        "16 bits, 4096 pixels of 0 and full scale: the sum of squares is 8.8e12",
        "sums, n sum p^2 and (sum p)^2 are exact; u32 holds the variance, to half a step. S/N is "
        "1: LOW_SNR",
        (line(comb, None),),
        pixel_width=16,
    )
    high = np.full(4096, 65_535, np.uint16)
    high[3000] = 65_534
    steps = np.where(np.arange(4096) % 2 == 0, 65_534, 65_535).astype(np.uint16)
    yield VarianceCase(
        "variance-on-a-high-level",
        "16 bits, a count's difference on 65,535: mean of squares less square of mean cancels",
        "exact until the one rounding to a step of u32, here a count squared",
        (line(high, None), line(steps, None)),
        pixel_width=16,
    )
    hum = clipped(4000.0 + 0.6 * np.cos(np.arange(LENGTH)))
    yield VarianceCase(
        "variance-small-at-12-bits",
        "half a count on 4000",
        "exact until the one rounding to 2^-8 counts squared",
        (line(hum, None),),
    )


def _ratios() -> Iterator[Case]:
    even = np.full(LENGTH, float(LEVEL))
    yield LineCase(
        "noise-zero",
        "S/N divides by 0 where the background is even",
        "NO_NOISE, S/N at its largest, 255.996; the position is as ever",
        (spot(700.0, base=even, flags="NO_NOISE"), spot(700.5, base=even, flags="NO_NOISE")),
    )
    one = even.copy()
    one[900] -= 1
    yield LineCase(
        "noise-smallest",
        "one count less on one of the 512 pixels beside the spot: the noise is 0.044 counts, S/N "
        "68,000",
        "S/N saturates at 255.996 without a flag of its own; the position is as ever",
        (spot(700.0, base=one), spot(700.5, base=one)),
    )
    # Of 16 pixels ten are 4 above LEVEL and six 4 below: mean LEVEL + 1, sample deviation 4.
    ripple = LEVEL + 4.0 * np.where(np.arange(LENGTH) % 8 < 5, 1.0, -1.0)
    lowest = [
        line(box(ripple, 704, [LEVEL + h, LEVEL + 1 + h, LEVEL + h]), flags)
        for h, flags in ((16, "LOW_SNR"), (18, "LOW_SNR"), (20, ""), (24, ""))
    ]
    yield LineCase(
        "snr-at-its-limit",
        "height over noise is 4, 4.5, 5 and 6 on an even row, where snr_min is 5",
        "LOW_SNR below 5; 5 itself is enough",
        tuple(lowest),
    )
    weak = [spot(700.0 + p, 3, 12, flags="") for p in (0.0, 0.5)]
    yield LineCase(
        "spot-12-counts",
        "12 counts of height: each pixel is rounded by a tenth of its neighbours' difference",
        "symmetric spots keep their centre whatever their height: to a step in one window, and "
        "within 0.02 px in a fit, which has the ripple of a count beside the spot",
        tuple(weak),
        fit_px=0.02,
    )


def _quotients() -> Iterator[Case]:
    def smallest() -> Outcome:
        dividend = np.array([0, 1, 12, (1 << 16) - 1, 1 << 16, 1 << 40], np.int64)
        got, over = divide(dividend, np.ones(6, np.int64), quotient_width=16)
        want = np.minimum(dividend, (1 << 16) - 1)
        fits = dividend < 1 << 16
        wrong = [] if np.array_equal(got, want) and np.array_equal(over, ~fits) else ["quotient"]
        off = np.abs(got - dividend)[fits].max()
        return Outcome("overflow_o (2 of 6)", number(float(off), "steps"), "0 steps", tuple(wrong))

    def zero() -> Outcome:
        dividend = np.array([0, 1, 1 << 40], np.int64)
        got, over = divide(dividend, np.zeros(3, np.int64), quotient_width=16)
        wrong = [] if over.all() and (got == (1 << 16) - 1).all() else ["quotient by zero"]
        with np.errstate(divide="ignore", invalid="ignore"):
            naive = np.array([0.0, 1.0, 2.0**40]) / np.float64(0.0)
        return Outcome("overflow_o", "saturates", summary(naive.tolist(), ""), tuple(wrong))

    def root() -> Outcome:
        values = [0, 1, 2, 3, (1 << 54) - 1, (1 << 54) + (1 << 27), (1 << 56) - 1]
        got = square_root(np.array(values, np.int64), root_width=28)
        most = (1 << 28) - 1
        want = [min((math.isqrt(4 * v) + 1) // 2, most) for v in values]
        wrong = [] if got.tolist() == want else [f"roots {got.tolist()}, want {want}"]
        exact = [math.sqrt(v) for v in values]
        off = max(abs(g - e) for g, e in zip(got.tolist(), exact, strict=True))
        return Outcome("none", number(off, "steps"), number(0.0, "steps"), tuple(wrong))

    entries: list[tuple[str, str, str, Callable[[], Outcome], tuple[str, ...]]] = [
        (
            "division-by-1",
            "the smallest divisor gives the largest quotient",
            "the dividend itself, or all ones and overflow_o",
            smallest,
            ("test_divide.py::random_operands_back_to_back",
             "test_divide.py::test_divide_model_is_the_rounded_quotient"),
        ),
        (
            "division-by-0",
            "x / 0 and 0 / 0",
            "all ones and overflow_o, 0 / 0 too",
            zero,
            ("test_divide.py::random_operands_back_to_back",),
        ),
        (
            "square-root-at-its-ends",
            "0, 1 and the largest radicand, whose root rounds up to one bit more",
            "to nearest, half a step; what rounds up to 2^28 saturates, a step below",
            root,
            ("test_square_root.py::random_radicands_back_to_back",
             "test_square_root.py::test_square_root_model_is_the_nearest_integer"),
        ),
    ]  # fmt: skip
    for name, breaks, defined, measure, tests in entries:
        yield ModuleCase(name, breaks, defined, measure, tests)


def _formats() -> Iterator[Case]:
    easy = Peak(snr_min=2.0)
    for width, length, centre, within, peak in (
        (8, 1000, 500.0, 0.03, Peak()),
        (10, 64, 30.0, 0.1, easy),
        (12, 2048, 700.0, 0.02, Peak()),
        (16, 4096, 3000.0, 0.02, Peak()),
    ):
        full = (1 << width) - 1
        level = float(full * LEVEL // FULL)
        base = background(length, int(level))
        flags = "ROW_STATISTICS" if length == 64 else ""
        lines = [
            spot(centre + part, 2, 0.7 * full, flags=flags, base=base, level=level, full=full)
            for part in PARTS
        ]
        more = ", snr_min 2" if length == 64 else ""
        yield LineCase(
            f"pixel-width-{width}",
            f"{width} bits: full scale is {full} counts; lines of {length}{more}",
            f"counts are aligned to 24 bits, so thresholds are the same; within {within} px",
            tuple(lines),
            within_px=within,
            peak=peak,
            pixel_width=width,
        )
    tiny = np.zeros(64)
    spots = [
        line(box(tiny, 30, [1023], full=1023), "LOW_SNR TOO_NARROW SATURATED ROW_STATISTICS",
             true=30.0),
        line(with_spots(tiny, (30, 2, 900), level=0, full=1023), "LOW_SNR ROW_STATISTICS",
             true=30.0),
    ]  # fmt: skip
    yield LineCase(
        "line-length-64",
        "a single block: no background is left, and the row's deviation holds the peak",
        "no sample of n is more than sqrt(n - 1) deviations from the mean, 7.94 here, and 13/8 of "
        "snr_min is 8.1: LOW_SNR, whatever comes; with snr_min 2 see pixel-width-10",
        tuple(spots),
        pixel_width=10,
    )
    base = background(1000, 4)
    last = [
        spot(999.0 - 8, flags="AT_EDGE", height=200, base=base, level=4, full=255),
        spot(970.0, height=200, base=base, level=4, full=255),
        spot(8.0, flags="AT_EDGE", height=200, base=base, level=4, full=255),
    ]
    yield LineCase(
        "line-length-1000",
        "the last block has 40 pixels, not 64",
        "each block with its own length; the spot's centre, to a step",
        tuple(last),
        pixel_width=8,
    )
    shipped = [spot(float(c)) for c in (63, 64, 1024, 1984, 2000)]
    yield LineCase(
        "line-length-2048",
        "spots across the border of two blocks and in the last one",
        "the spot's centre, to a step",
        tuple(shipped),
    )
    wide = background(4096, 960, 16)
    long = [
        spot(centre, 3, 40_000, flags=flags, base=wide, level=960, full=65_535)
        for centre, flags in ((8.0, "AT_EDGE"), (2048.0, ""), (4000.5, ""), (4087.0, "AT_EDGE"))
    ]
    yield LineCase(
        "line-length-4096",
        "a bit more of the position, of every sum and of the root",
        "the spot's centre, to a step",
        tuple(long),
        pixel_width=16,
    )


def cases() -> Iterator[Case]:
    """Return the entries of this module."""
    for part in (_moments, _ratios, _quotients, _formats):
        yield from part()
