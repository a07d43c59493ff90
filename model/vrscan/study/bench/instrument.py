"""The work of the whole instrument: its error by cause, and the speed of each of its parts."""

import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from vrscan.data.arrays import Bools, Floats, Pixels
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.lines import Lines, Truth
from vrscan.data.residuals import rms
from vrscan.data.table import Table
from vrscan.engines import shadows
from vrscan.engines.engine import Engine, run
from vrscan.ideal.statistics import statistics
from vrscan.scene.description import load
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate, take
from vrscan.study.bench.cells import Figures, configuration
from vrscan.study.plan import FLAT_PX, JUMP_PX, plan
from vrscan.study.report import budget as light_budget
from vrscan.study.report import fidelity as light_fidelity
from vrscan.study.report.reliability_report import Reliability
from vrscan.study.report.space_report import Space

READS = ("scene/scenes/*.toml", "rtl/**/*.sv", "tb/engine/*")
BUDGET, FIDELITY, SPEED, GROWTH = (
    f"vrscan.study.bench.instrument:{name}" for name in ("budget", "fidelity", "speed", "growth")
)
MAX_WINDOW = 255
WINDOWS = ("threshold", "two_pass", "fit")
ROUNDS = 3  # runs of each work, in turns; the best is used
LEAST_S = 0.15  # processor time of a timed run; a shorter work is repeated
CHUNK = 512  # lines computed at a time: they fit in a cache
SEEN_PX = 0.005  # between the engines, above what the widths make of a fit
REFERENCE = "maximum, mean and variance of every line in numpy (ideal.statistics)"


def budget(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the change of a scene's points by each effect, and by the arithmetic.

    The scene has its own seed; ``seed`` is not used.

    Args:
        parameters: ``config``, ``scene`` and ``lines``.
        seed: Not used.

    Returns:
        ``csv``, the table of ``vrscan budget --csv`` without its times; rms and median of positions
        and of z about the truth, the rms of those within ``JUMP_PX``, and the share beyond; rms of
        the bit-accurate model about the float equations where both have the same window and the
        fit stands in both or in none, and the shares of lines of other windows and of one fit
        only; ``fit_px`` and ``fit_mm``, by how much the fit moves points, 0 where the configuration
        has none; ``windows``, by kind of window the error, that over sigma, the share of points
        that 2 sigma hold and of those astray, all of points without a flag but the first, and the
        shares of lines with a free part, falsely free and hidden.
    """
    config, count = configuration(parameters), int(parameters["lines"])
    light = Light(load(parameters["scene"]), config)
    found = plan(light, count, fidelity="full", each=True)
    lines = simulate(light, count, found.active, tolerance_px=found.plane_px).lines
    truth = lines.truth
    assert truth is not None  # a simulation has a truth
    lens = {"focus_mm": light.scene.lens.focus_mm, "f_number": light.scene.lens.f_number}
    focused = config.model_copy(update={"free": config.free.model_copy(update=lens)})
    tables = {name: run(Engine.FIXED, lines, with_window(focused, name)) for name in WINDOWS}
    fixed, ideal = (run(engine, lines, config) for engine in (Engine.FIXED, Engine.IDEAL))
    both = fixed.located & ideal.located
    same = both & (fixed.left == ideal.left) & (fixed.width == ideal.width)
    off_px, off_mm = fixed.position_px - ideal.position_px, fixed.z_mm - ideal.z_mm
    # A fit that moves its point by less than a step of positions seems to be none, and where it
    # cannot be told whether one stands, both do.
    moved, joined = _moved(Engine.FIXED, fixed, lines, config)
    moves, joins = _moved(Engine.IDEAL, ideal, lines, config)
    one = both & (np.abs(off_px) > SEEN_PX) & (moved != moves) & ~(joined | joins)
    like = same & ~one
    seen = fixed.located & np.isfinite(truth.position_px)
    px, mm = fixed.position_px - truth.position_px, fixed.z_mm - truth.z_mm
    near = seen & (np.abs(px) < JUMP_PX)
    second = tables["two_pass"]
    apart = fixed.located & second.located if config.peak.fit else np.zeros(len(lines), np.bool_)
    apart &= np.abs(fixed.position_px - second.position_px) < JUMP_PX
    return {
        "csv": light_budget.budget_csv(found, times=False).decode(),
        "points": int(seen.sum()),
        "jumped": 1.0 - float(near.sum()) / max(int(seen.sum()), 1),
        "error_px": rms(px[near], 0.0),
        "median_px": _median(px[seen]),
        "error_mm": rms(mm[near], 0.0),
        "median_mm": _median(mm[seen]),
        "other_window": 1.0 - float(same.sum()) / max(int(both.sum()), 1),
        "one_fit": float(one.sum()) / max(int(both.sum()), 1),
        "arithmetic_px": rms(off_px[like], 0.0),
        "arithmetic_mm": rms(off_mm[like], 0.0),
        "fit_px": rms((fixed.position_px - second.position_px)[apart], 0.0),
        "fit_mm": rms((fixed.z_mm - second.z_mm)[apart], 0.0),
        "windows": {name: _window(points, truth, config) for name, points in tables.items()},
    }


def with_window(config: Config, window: str) -> Config:
    """Return the instrument with another kind of window; the period is N."""
    peak = config.peak.model_copy(update={"window": window, "period": "n"})
    return config.model_copy(update={"peak": peak})


def _moved(engine: Engine, points: Table, lines: Lines, config: Config) -> tuple[Bools, Bools]:
    """Return where the fit gives the position, and not the second window that it follows.

    And where that cannot be told, as a spot's parts are one window only where a fit follows.
    """
    if not config.peak.fit:
        return np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    peak = config.peak.model_copy(update={"window": "two_pass", "k_first": config.peak.k_fit})
    given = run(engine, lines, config.model_copy(update={"peak": peak}))
    joined = (points.left != given.left) | (points.right != given.right)
    return (points.position_px != given.position_px) & ~joined, np.asarray(joined)


def _window(points: Table, truth: Truth, config: Config) -> Figures:
    """Return what points of one kind of window come to."""
    px, mm = points.position_px - truth.position_px, points.z_mm - truth.z_mm
    near = points.located & (np.abs(np.nan_to_num(px, nan=np.inf)) < JUMP_PX)
    found = Reliability.of(points, truth)
    space = Space.of(Table.joined(list(shadows.shaded([points], config))), truth)
    return {
        "error_px": rms(px[near], 0.0),
        "error_mm": rms(mm[near], 0.0),
        "ratio": found.ratio,
        "within": found.share(2),
        "astray": found.astray / max(found.points, 1),
        **{name: getattr(space, name) / len(points) for name in ("free", "false", "hidden")},
    }


def _median(values: Floats) -> float:
    return float(np.median(np.abs(values))) if len(values) else 0.0


def fidelity(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the rows of ``vrscan bench light`` for one scene, a timed work.

    Args:
        parameters: ``config``, ``scene`` and ``lines``.
        seed: Not used: the scene has its own.
    """
    config, count = configuration(parameters), int(parameters["lines"])
    rows = light_fidelity.run([parameters["scene"]], count, config, rounds=2)
    return {"rows": [asdict(row) for row in rows]}


def best(works: dict[str, Callable[[], object]], rounds: int = ROUNDS) -> dict[str, float]:
    """Return the processor time of each work, s: the best of several runs that take turns.

    A work shorter than ``LEAST_S`` is repeated for that time, and its mean is taken.
    """
    seconds = dict.fromkeys(works, float("inf"))
    times = dict.fromkeys(works, 1)
    for name, work in works.items():
        work()  # fills tables, imports and caches
        begin = time.process_time()
        work()
        times[name] = 1 + int(LEAST_S / max(time.process_time() - begin, 1e-6))
    for _ in range(rounds):
        for name, work in works.items():
            begin = time.process_time()
            for _ in range(times[name]):
                work()
            spent = (time.process_time() - begin) / times[name]
            seconds[name] = min(seconds[name], spent)
    return seconds


def reference(lines: Pixels) -> None:
    """Do the work that speeds are compared with, ``CHUNK`` lines at a time."""
    for start in range(0, len(lines), CHUNK):
        statistics(lines[start : start + CHUNK], max_window=MAX_WINDOW)


def _some(recording: Lines, count: int) -> Lines:
    return Lines(recording.lines[:count], recording.angle_rad[:count], recording.power[:count])


def speed(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the lines/s of the engines on one core, a timed work; the RTL's if it can be built.

    Args:
        parameters: ``config``, ``lines`` of the default scene, and ``rtl``, the number of them for
            the RTL.
        seed: Not used: the scene has its own.

    Returns:
        ``rates`` by name: the reference, and each engine with each kind of window; ``missing``, the
        reason why the RTL is missing; ``lines``, their number for ``model`` and ``rtl``.
    """
    config = configuration(parameters)
    count, few = int(parameters["lines"]), int(parameters["rtl"])
    recording = take("default", count, config).lines
    short = _some(recording, few)
    works: dict[str, Callable[[], object]] = {"reference": lambda: reference(recording.lines)}
    for name in WINDOWS:
        own = with_window(config, name)
        for engine in (Engine.FIXED, Engine.IDEAL):
            works[f"{engine} {name}"] = partial(run, engine, recording, own)
    missing = "not asked for with --quick"
    if few:
        try:
            run(Engine.RTL, _some(recording, 8), config)
            for name in WINDOWS:
                works[f"rtl {name}"] = partial(run, Engine.RTL, short, with_window(config, name))
            missing = ""
        except InputError as error:  # there is no compiler
            missing = str(error)
    seconds = best(works)
    lines = {name: few if name.startswith("rtl") else count for name in works}
    rates = {name: lines[name] / seconds[name] for name in works}
    return {"rates": rates, "missing": missing, "lines": {"model": count, "rtl": few}}


def _of_length(config: Config, length: int) -> Config:
    """Return the instrument with lines of another length and the same view of the scene."""
    sensor = config.sensor.model_copy(update={"line_length": length})
    # A longer sensor has its axis at the same place: its outer pixels see nothing.
    centre = min(config.geometry.centre_px, 0.5 * (length - 1))
    geometry = config.geometry.model_copy(update={"centre_px": centre})
    return config.model_copy(update={"sensor": sensor, "geometry": geometry})


def growth(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the seconds of the engines for several sizes of work, a timed work.

    The lines are those of the default scene; a longer sensor has the same spots and more
    background, a shorter one sees less of the scene.

    Args:
        parameters: ``config``, ``sizes``, pairs of line length and number of lines, and ``rtl``,
            such pairs for the RTL.
        seed: Not used: the scene has its own.

    Returns:
        ``seconds``: rows of name, length, lines, s.
    """
    config = configuration(parameters)
    rows = []
    for length, count in parameters["sizes"]:
        own = _of_length(config, length)
        light = Light(load("default"), own)
        try:
            active = plan(light, count, fidelity="full", each=False).active
        except InputError:  # a length for which a register overflows, or nothing is seen
            continue
        recording = simulate(light, count, active).lines
        works = _growing(recording, light, active, count, own)
        seconds = best(works, rounds=2)
        rows += [[name, length, count, seconds[name]] for name in works]
    for length, count in parameters["rtl"]:
        own = _of_length(config, length)
        recording = take("default", count, own).lines
        try:
            run(Engine.RTL, _some(recording, 8), own)
        except InputError:
            continue
        seconds = best({"rtl": partial(run, Engine.RTL, recording, own)}, rounds=2)
        rows.append(["rtl", length, count, seconds["rtl"]])
    return {"seconds": rows}


def _growing(
    recording: Lines, light: Light, active: frozenset[str], count: int, config: Config
) -> dict[str, Callable[[], object]]:
    return {
        "reference": lambda: reference(recording.lines),
        "fixed": lambda: run(Engine.FIXED, recording, config),
        "ideal": lambda: run(Engine.IDEAL, recording, config),
        "simulator": lambda: simulate(light, count, active, tolerance_px=FLAT_PX),
    }
