"""The command ``vrscan bench attack``: detectors on lines of an optics that is not the renderer's.

The modes of the instrument and simple detectors have the same lines. Every error is that of the
lines that the fit keeps: it has a position there, and no flag that warns.
"""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vrscan.data.arrays import Bools, Floats, Pixels
from vrscan.data.config import Config
from vrscan.data.residuals import rms
from vrscan.data.table import Table
from vrscan.detectors import fits
from vrscan.detectors.catalogue import detector
from vrscan.detectors.plain import plain_lines
from vrscan.engines.engine import BLOCK, Engine, run
from vrscan.show.sheet import Column, Sheet, rewrite, words
from vrscan.study.bench.attack_cases import CASES, DARK, Case, DarkCase, noise, source
from vrscan.study.bench.attack_optics import OFFSET, unit
from vrscan.study.cases.case import WARNINGS
from vrscan.study.cases.case_page import ATTACK, PAGE
from vrscan.study.progress import Progress, for_each
from vrscan.study.report.efficiency import with_window

SEED = 20_261_129
LINES, QUICK_LINES = 320, 80  # of a case
DARK_LINES, QUICK_DARK_LINES = 20_000, 1000
FIT, *OTHERS = MODES = ("fit", "two_pass", "threshold")
SCIPY = "scipy"
# Short name and value of the parameter of each simple detector, by the name in the table.
SIMPLE: dict[str, tuple[str, float | None]] = {
    "centroid": ("centroid-noise", None),
    "centroid 20%": ("centroid-height", 0.2),
    "Blais-Rioux": ("blais-rioux-8", None),
    "Steger": ("steger", None),
    SCIPY: ("scipy", None),
}
SILENT_PX, SILENT_SIGMAS = 1.0, 5.0  # errors beyond both without a warning are silent
MOST_SILENT, MOST_RATIO = 0.01, 1.6  # of a row that the page does not show
WORST = 10  # rows that it shows anyway
LEAST_FOUND = 0.9  # of the lines that the fit keeps, of a detector that it is compared with


@dataclass(frozen=True)
class Score:
    """What a detector makes of a case."""

    rms: float  # rms error, px; NaN without a line
    bias: float  # mean error, px
    kept: float  # share of the lines with a position and without a warning
    ratio: float = math.nan  # rms of error over sigma of the lines that it keeps itself
    silent: float = math.nan  # share of the lines that are far off without a warning


@dataclass(frozen=True)
class Row:
    """A case with the scores of ``MODES`` and ``SIMPLE`` by their names."""

    title: str
    scores: Mapping[str, Score]

    @property
    def fit(self) -> Score:
        """The score of the fit."""
        return self.scores[FIT]

    @property
    def best(self) -> str | None:
        """Name of the simple detector with the least error; None without one."""
        known = [name for name in SIMPLE if math.isfinite(self.scores[name].rms)]
        return min(known, key=lambda name: self.scores[name].rms, default=None)

    @property
    def best_rms(self) -> float:
        """Its rms error, px."""
        return math.nan if self.best is None else self.scores[self.best].rms

    @property
    def over_best(self) -> float:
        """Rms error of the fit over that of the best simple detector."""
        return self.fit.rms / self.best_rms if self.best_rms > 0.0 else math.nan

    @property
    def bad(self) -> bool:
        """Whether the fit is silent too often, or says too small a sigma."""
        return self.fit.silent > MOST_SILENT or self.fit.ratio > MOST_RATIO


@dataclass(frozen=True)
class DarkRow:
    """Lines without a spot: points, and those without a warning, of 100,000 by ``MODES``."""

    title: str
    points: Mapping[str, float]
    unwarned: Mapping[str, float]


def _warned(points: Table) -> Bools:
    """Return which lines have a flag that says doubt [n]."""
    return np.asarray(np.any([points.flags[name] for name in WARNINGS], axis=0))


def _score(points: Table, true: Floats, some: Bools) -> Score:
    """Return the score of a mode, its errors those of some of the lines."""
    error = points.position_px - true
    kept = points.measured & ~_warned(points)
    far = np.abs(error) > np.maximum(SILENT_SIGMAS * points.sigma_px, SILENT_PX)
    own = error[some & points.measured]
    rated = kept & (points.sigma_px > 0.0)
    return Score(
        rms(own),
        float(own.mean()) if len(own) else math.nan,
        float(kept.mean()),
        rms(error[rated] / points.sigma_px[rated]),
        float((kept & far).mean()),
    )


def _simple_score(found: Floats, sigma: Floats | None, true: Floats, some: Bools) -> Score:
    """Return the score of a simple detector, which has no flags."""
    error, seen = found - true, np.isfinite(found)
    enough = (seen & some).sum() >= LEAST_FOUND * max(some.sum(), 1)
    own = error[seen & some] if enough else np.empty(0)
    bias = float(own.mean()) if len(own) else math.nan
    ratio = math.nan if sigma is None else rms(error[seen] / sigma[seen])
    return Score(rms(own), bias, float(seen.mean()), ratio)


def simple(pixels: Pixels, config: Config) -> dict[str, tuple[Floats, Floats | None]]:
    """Return each simple detector's positions and their sigmas, where it has any, px [n] each.

    It knows the level and the noise of the dark, which is taken off.
    """
    level, spread = (np.full(len(pixels), v) for v in (OFFSET * unit(config), noise(config)))
    found: dict[str, tuple[Floats, Floats | None]] = {}
    for name, (key, value) in SIMPLE.items():
        own = detector(key)
        if name == SCIPY:
            given, full = config.peak.kappa, 2**config.sensor.pixel_width - 1
            found[name] = fits.scipy_fit(pixels, level, spread, given, reach=own.value, full=full)
        else:
            found[name] = own.locate(pixels, level, spread, config, value), None
    return found


@dataclass(frozen=True)
class _Work:
    """The work of a process: a case or one of the dark, by its number."""

    engine: Engine
    config: Config
    seed: int
    quick: bool

    def __call__(self, given: int) -> Row | DarkRow:
        if given < len(CASES):
            return self.spots(CASES[given])
        return self.dark(DARK[given - len(CASES)])

    def points(self, pixels: Pixels) -> dict[str, Table]:
        lines = plain_lines(pixels, self.config)
        return {name: run(self.engine, lines, with_window(self.config, name)) for name in MODES}

    def spots(self, case: Case) -> Row:
        pixels, true = case.lines(QUICK_LINES if self.quick else LINES, self.config, self.seed)
        tables = self.points(pixels)
        kept = tables[FIT].measured & ~_warned(tables[FIT])
        scores = {name: _score(points, true, kept) for name, points in tables.items()}
        for name, (found, sigma) in simple(pixels, self.config).items():
            scores[name] = _simple_score(found, sigma, true, kept)
        return Row(case.title, scores)

    def dark(self, case: DarkCase) -> DarkRow:
        count, rng = QUICK_DARK_LINES if self.quick else DARK_LINES, source(case.title, self.seed)
        points, unwarned = dict.fromkeys(MODES, 0.0), dict.fromkeys(MODES, 0.0)
        for start in range(0, count, BLOCK):
            pixels = case.lines(min(BLOCK, count - start), self.config, rng)
            for name, found in self.points(pixels).items():
                points[name] += 1e5 / count * float(found.measured.sum())
                unwarned[name] += 1e5 / count * float((found.measured & ~_warned(found)).sum())
        return DarkRow(case.title, points, unwarned)


COUNT = len(CASES) + len(DARK)  # rows


def measure(
    engine: Engine,
    config: Config,
    seed: int = SEED,
    *,
    quick: bool = False,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[list[Row], list[DarkRow]]:
    """Return the rows of all cases, with spots and dark.

    Args:
        engine: Engine of the instrument's modes; it is prepared.
        config: The instrument.
        seed: Seed of all random numbers.
        quick: Whether a quarter of the lines, and fewer dark ones, are enough.
        jobs: Number of processes.
        progress: Called with the number of rows done so far.

    Raises:
        InputError: if lines are too short.
    """
    found = for_each(_Work(engine, config, seed, quick), range(COUNT), progress, jobs)
    spots = [row for row in found if isinstance(row, Row)]
    return spots, [row for row in found if isinstance(row, DarkRow)]


def sheet(rows: Sequence[Row]) -> Sheet[Row]:
    """Return the table of spots; its file has all scores."""

    def px(heading: str | None, mode: str, field: str, name: str) -> Column[Row]:
        return Column(
            heading, lambda row: getattr(row.scores[mode], field), "{:.3f}", name=name, absent="-"
        )

    columns: list[Column[Row]] = [
        words("case", lambda row: row.title, name="case"),
        Column("kept", lambda row: row.fit.kept, "{:.0%}", name="fit_kept"),
        px("fit", FIT, "rms", "fit_rms_px"),
        Column("bias", lambda row: row.fit.bias, "{:+.3f}", name="fit_bias_px", absent="-"),
        Column("error/sigma", lambda row: row.fit.ratio, "{:.2f}", name="fit_ratio", absent="-"),
        Column("silent", lambda row: row.fit.silent, "{:.1%}", name="fit_silent"),
        px("two_pass", "two_pass", "rms", "two_pass_rms_px"),
        px("threshold", "threshold", "rms", "threshold_rms_px"),
        words("best simple", lambda row: row.best, name="best", absent="-"),
        Column("px", lambda row: row.best_rms, "{:.3f}", name="best_rms_px", absent="-"),
        Column("ratio", lambda row: row.over_best, "{:.2f}", name="fit_over_best", absent="-"),
    ]
    for mode in OTHERS:
        for field, name in (("bias", "bias_px"), ("ratio",) * 2, ("silent",) * 2, ("kept",) * 2):
            columns.append(px(None, mode, field, f"{mode}_{name}"))
    for mode in SIMPLE:
        key = mode.replace("%", "").replace(" ", "_").replace("-", "_").lower()
        for field, name in (("rms", "rms_px"), ("bias", "bias_px"), ("kept", "found")):
            columns.append(px(None, mode, field, f"{key}_{name}"))
    columns.append(px(None, SCIPY, "ratio", "scipy_ratio"))
    return Sheet(columns, rows)


def dark_sheet(rows: Sequence[DarkRow]) -> Sheet[DarkRow]:
    """Return the table of dark lines."""
    columns: list[Column[DarkRow]] = [words("dark lines", lambda row: row.title, name="case")]
    for mode, title in zip(MODES, ("fit", "two passes", "threshold"), strict=True):

        def points(row: DarkRow, mode: str = mode) -> float:
            return row.points[mode]

        def unwarned(row: DarkRow, mode: str = mode) -> float:
            return row.unwarned[mode]

        columns.append(Column(title, points, "{:g}", name=f"{mode}_points"))
        columns.append(Column("no flag", unwarned, "{:g}", name=f"{mode}_unflagged"))
    return Sheet(columns, rows)


CAPTION = (
    "rms errors, px, of the lines that the fit keeps: those with a position and none of the flags "
    f"{', '.join(WARNINGS)}.\nsilent: share of the lines that the fit keeps though it errs by more "
    f"than {SILENT_PX:g} px and {SILENT_SIGMAS:g} sigma. ratio: fit over best simple."
)
DARK_CAPTION = "points of 100,000 lines, and those without one of these flags"


def shown(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the page, those first whose fit is the worst against a simple detector."""

    def key(row: Row) -> float:
        return -row.over_best if math.isfinite(row.over_best) else 0.0

    ranked = sorted(rows, key=key)
    return [row for k, row in enumerate(ranked) if k < WORST or row.bad]


def block(rows: Sequence[Row], dark: Sequence[DarkRow], engine: Engine, seed: int) -> str:
    """Return the part of the page."""
    some = shown(rows)
    most = {mode: max((row.unwarned[mode] for row in dark), default=0.0) for mode in MODES}
    points = ", ".join(f"{name} {most[mode]:g}" for mode, name in zip(MODES, _NAMES, strict=True))
    chosen = (
        f"The {WORST} worst of {len(rows)} cases by the fit's error over that of the best simple "
        f"detector, and all that are silent on more than {MOST_SILENT:.0%} of the lines or err by "
        f"more than {MOST_RATIO} sigma rms (engine `{engine}`, seed {seed}, {LINES} lines each):"
    )
    least = (
        f"Of {len(dark)} kinds of dark lines the one with most points without such a flag has, of "
        f"100,000 lines: {points} (measured on {DARK_LINES:,} lines each)."
    )
    head, chosen, least = (
        textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)
        for text in (_TEXT, chosen, least)
    )
    return f"{head}\n\n{chosen}\n\n{sheet(some).markdown()}\n\n{least}"


_NAMES = ("fit", "two passes", "threshold")
_TEXT = (
    "`vrscan bench attack --write` makes this part. It has an optics of its own, apart from the "
    "simulator: a complex Gaussian field with the mean light's amplitude passes a round aperture, "
    "f/3.2 if no other is named; one to four such patterns (looks) are averaged, integrated over "
    "pixels, and exposed with shot and read noise by the shipped sensor. The spot has s = 2.5 px "
    "if no other is named, and moves by 0.3 to 1 px from line to line. Its place is that of the "
    "Gaussian on the surface, whatever leaves a body beside it, and whatever an edge or the "
    "surface's reflectance takes from it. Left out are motion in the pulse, speckle that stays "
    "from line to line, aberrations, sunlight, and fixed pattern. Errors are rms, in px, of the "
    "lines that the fit keeps: those with a position and none of the flags "
    f"{', '.join(WARNINGS)}. *Silent* is the share of lines that it keeps though it errs by more "
    f"than {SILENT_PX:g} px and {SILENT_SIGMAS:g} of its sigmas. The simple detectors know the "
    "level of the dark: a centroid of what is 2 noises, or 20 % of the height, above it; the "
    "filters of Blais and Rioux and of Steger; and `scipy.optimize.curve_fit` with weights."
)


def pages(root: Path) -> tuple[Path]:
    """Return the page that ``write`` writes into."""
    return (root / PAGE,)


def write(text: str, root: Path) -> list[Path]:
    """Put the block into its page; return the page, or nothing where it has no place for it."""
    return [page for page in pages(root) if rewrite(page, {ATTACK: text})]
