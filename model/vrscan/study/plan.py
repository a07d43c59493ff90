"""What each effect would do to a scene's points, and which of them are worth their time.

Lines of a few blocks are rendered with all effects and then with fewer, always with the same random
numbers, and go through the chain's bit-accurate model. They are lines near, in the middle and far,
and lines whose spot the camera does not see. The change of the position is that of the effects left
out: its mean over such a part is the bias, the spread about it the rms.

``auto`` leaves effects out, the most expensive first and several at once where it can, as long as
the change by all that is left out together stays below the tolerance in every zone of a survey,
with a margin for lines that move far, and at most three lines in a thousand of each part, or one,
gain, lose or change their point. Coarse grains are judged first, and alone. Where they stay, the
others are compared without them: grains turn a little less light into another draw of the same
error, and no draw is truer than another. What sets the size of the grains then stays, too.

Each trial is made on some thousand lines, and ends as soon as it cannot succeed any more; the final
choice has to hold on the whole survey, where its parts are tried one after the other if it does
not. The time of a trial, and the time that it may save on the
scan's lines, are typical values and not measured, so that the same scene gets the same effects, and
so the same lines, whenever and wherever it is simulated. Where choosing would take more time than
it saves, the scan has all effects. So it has where no line of the survey has a point, because then
nothing that is left out changes anything.
"""

import itertools
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.points import table
from vrscan.data.table import Table
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal import geometry as triangle
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.scene.effects import EFFECTS, LINE_US, START_US, WHOLE_LINE, chosen, present, typical_us
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer
from vrscan.scene.simulate import BLOCK, Scanner, picked
from vrscan.scene.timeline import Timeline

ZONES = ("near", "middle", "far")
PARTS = (*ZONES, "hidden")  # parts of the survey; hidden: lines whose spot the camera does not see
JUMP_PX = 3.0
LEAST_LINES = 16_384  # a scan of fewer lines takes less time in full than choosing
_SURVEY = 4  # blocks in which the survey looks for its lines
_PLACE = 80  # consecutive lines whose changes are one observation: they may be one edge's
_PANNED = 24  # blocks of a scan that pans, of each of which ``_PLACE`` lines are looked at
_SWEPT = 96  # largest number of blocks of an even sweep, each of whose lines has its own angle
_PER_ZONE = 340, 1280  # least and largest number of survey lines, if there are that many
_SHARE = 100  # lines of the scan per line of the survey, in between
_HIDDEN = 4  # there are this many times fewer lines with a hidden spot
_STEPS, _TABLE = (16, 48, 128), 160  # lines per part: ends of a trial's steps; of the budget
_STEP = 512  # lines of a step that confirms a choice
_WORST = 64  # worst lines of a failed trial, which come first in the next
_STREAM = 0x9A1F
_ROUNDS = 2  # of timed renderings, the quicker of which counts
_SIGMAS = 2.0  # standard errors by which a mean square has to be below the tolerance's
_MOST_CHANGED = 0.003  # share of a part's lines, or one line, whose points may come, go or jump
_STAKE = 0.06  # trials may take this share of the scan's time in full, plus what they save
_ODDS = 1.5  # a trial has to save this many times its own time, because it may fail
_GRAIN = "grain"
_GRAINED = frozenset({_GRAIN, "defocus", "smear"})  # these set the grains' size: all three stay
_DETAIL = "detail"
FLAT_PX = 3e-3  # error of a tangent plane above which spots are followed ray by ray in full
_RAYS = "rays"  # treated like an effect: without it, only above the tolerance


@dataclass(frozen=True)
class Difference:
    """The change by leaving something out, by part of the lines: mean and spread of positions.

    They are NaN where no line has a point both times.
    """

    bias_px: Floats  # mean change [4], in the order of ``PARTS``
    rms_px: Floats  # rms change about the bias
    bias_mm: Floats  # mean change in z
    rms_mm: Floats
    changed: Floats  # share of lines with a point in only one of the two, or two far apart

    @property
    def total_px(self) -> Floats:
        """Return bias and spread together, near, middle and far [3]."""
        return np.hypot(self.bias_px, self.rms_px)[: len(ZONES)]


_NOTHING = Difference(*np.zeros((5, len(PARTS))))
_UNKNOWN = Difference(*np.outer([np.nan] * 4 + [0.0], np.ones(len(PARTS))))


@dataclass(frozen=True)
class Prediction:
    """The prediction for one effect in this scene."""

    name: str
    difference: Difference
    microseconds: float  # time per line
    on: bool


@dataclass(frozen=True)
class Plan:
    """The effects that a scene gets, and the changes that the others would have made."""

    fidelity: str  # "auto", "full", "minimal" or "list"
    tolerance_px: float
    active: frozenset[str]
    plane_px: float  # largest error of a tangent plane; with more a spot is followed ray by ray
    present: tuple[str, ...]  # the effects that the scene has
    predictions: tuple[Prediction, ...]  # one for each, where they were asked for
    absent: tuple[str, ...]  # the other effects
    left_out: Difference  # measured change by all effects that are off, together
    distance_mm: Floats  # mean z of each zone [3]
    microseconds: tuple[float, float]  # per line: as planned, and with all effects; or NaN
    count: int  # number of lines of the scan
    lines: int  # number of lines on which predictions or left_out were measured
    seconds: float  # time that choosing and measuring took
    pointless: bool = False  # whether lines were looked at with all effects, and none has a point


@dataclass(frozen=True)
class Survey:
    """Lines from some blocks of a scan, about as many of each part, in the order of their use."""

    numbers: Ints  # numbers of the lines [n]
    part: Ints  # part of each line, an index into ``PARTS`` [n]
    rank: Ints  # rising index of a line within its part [n]
    place: Ints  # index of the place of a line, of ``_PLACE`` lines at most [n]
    distance_mm: Floats  # mean z of the zones [3]

    def first(self, per_part: int) -> int:
        """Return the number of lines among which are the first ``per_part`` of each part."""
        return int(np.searchsorted(self.rank, per_part))


def plan(
    light: Light,
    count: int,
    *,
    fidelity: str | list[str] | None = None,
    tolerance_px: float | None = None,
    each: bool = True,
    seen: Survey | None = None,
    break_even_lines: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Plan:
    """Return the plan of the effects that a scan gets.

    Args:
        light: The scene and the instrument.
        count: Number of lines of the scan, from which the survey is drawn.
        fidelity: ``auto``, ``full``, ``minimal``, or a list of effects; the scene's own if None.
        tolerance_px: Tolerance of ``auto``; the scene's own if None.
        each: Whether the changes by single effects are asked for. ``auto`` then chooses as for
            ``LEAST_LINES`` if the scan is shorter.
        seen: Result of ``survey`` for the same scan, if there is one.
        break_even_lines: Lines on which the choice of ``auto`` has to pay; ``count`` if None.
        progress: Called with the number of steps done and the number of all steps.

    Raises:
        InputError: if the camera sees none of the lines, an effect or fidelity is unknown, or the
            tolerance is not positive.
    """
    begin = time.perf_counter()
    scene = light.scene
    wanted = scene.fidelity if fidelity is None else fidelity
    tolerance = scene.tolerance_px if tolerance_px is None else tolerance_px
    have = present(scene)
    listed = chosen(wanted, scene.source) if isinstance(wanted, list) else None
    if listed is None and wanted not in ("auto", "full", "minimal"):
        raise InputError(f"{scene.source}: fidelity {wanted!r} is not auto, full or minimal")
    if not tolerance > 0.0:
        raise InputError(f"{scene.source}: tolerance_px = {tolerance:g}: must be above 0")
    break_even_lines = count if break_even_lines is None else break_even_lines
    if each:
        break_even_lines = max(break_even_lines, LEAST_LINES)
    seen = survey(light, count) if seen is None else seen
    full = frozenset((*have, _RAYS))
    trial = _Trial(light, count, seen, tolerance, full)
    total = 2 + len(have) * (each + (wanted == "auto"))
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(min(done, total), total)

    table_rows = np.arange(seen.first(_TABLE))
    references: dict[frozenset[str], Table] = {}

    def compared(effects: frozenset[str]) -> Difference:
        """Return the change by all other effects."""
        of, less = alike(full, effects)
        if of not in references:
            references[of] = trial.points(table_rows, of)
        return difference(references[of], trial.points(table_rows, less), part, light)

    part = seen.part[table_rows]
    found: dict[str, Difference] = {}
    cost: dict[str, float] = {}
    measured: dict[frozenset[str], float] = {}
    if each or wanted not in ("auto", "full"):
        references[full] = trial.points(table_rows, full)
        trial.pointless = not references[full].located.any()
        # The first lines make the tables that these lines use, whose time is no effect's.
        trial.microseconds.clear()
        rounds = []
        for _ in range(_ROUNDS):
            trial.points(table_rows, full)
            rounds.append(trial.seconds)
        measured = dict(trial.microseconds)
        best = min(rounds, key=lambda each: sum(each.values()))
        cost = {name: 1e6 * best.get(name, 0.0) / len(part) for name in have}
    tick()
    for name in have if each else ():
        found[name] = compared(full - {name})
        tick()
    state, left_out = full, _NOTHING
    if wanted == "auto":
        if break_even_lines >= LEAST_LINES:
            state, left_out = _auto(trial, break_even_lines, tick)
            if each and state not in measured:
                trial.microseconds.pop(state, None)
                for _ in range(_ROUNDS):  # on the same lines as with all effects
                    trial.points(table_rows, state)
            elif state not in trial.microseconds:
                trial.points(table_rows, state)  # for its time alone
    elif wanted != "full":
        state = frozenset(have) & (listed or frozenset())
        left_out = compared(state)
    us = {full: np.nan} | trial.microseconds | measured
    tick()
    return Plan(
        fidelity="list" if listed is not None else str(wanted),
        tolerance_px=tolerance,
        active=state - {_RAYS},
        plane_px=_plane_px(state, tolerance),
        present=have,
        predictions=tuple(
            Prediction(name, found[name], cost[name], name in state) for name in found
        ),
        absent=tuple(name for name in EFFECTS if name not in have),
        left_out=_UNKNOWN if trial.pointless else left_out,
        distance_mm=seen.distance_mm,
        microseconds=(us[state], us[full]),
        count=count,
        lines=len(table_rows),
        seconds=time.perf_counter() - begin,
        pointless=trial.pointless,
    )


def survey(light: Light, count: int) -> Survey:
    """Return the survey of a scan.

    Raises:
        InputError: if the camera sees none of the lines.
    """
    scanner = Scanner(light, count, frozenset())
    if light.scene.scan.pan_mm_per_s != 0.0:  # a place is in few lines, and its view takes time
        some, rows = _PANNED, slice(_PLACE)
    elif light.scene.scan.sweep == "mirror":
        some, rows = _SURVEY, slice(BLOCK)
    else:
        some = min(_SWEPT, scanner.blocks)
        rows = slice(0, BLOCK, max(1, some // _SURVEY))
    blocks = np.unique(np.linspace(0, scanner.blocks - 1, some).round().astype(np.int64))
    when = Timeline.joined([picked(scanner.timeline(k), rows) for k in blocks.tolist()])
    when = picked(when, np.flatnonzero(when.line < count))
    number, truth = when.line, scanner.renderer.look(when)
    depth = np.where(np.isfinite(truth.position_px), truth.z_mm, np.nan)
    seen = np.flatnonzero(np.isfinite(depth))
    if len(seen) == 0:
        raise InputError(
            f"{light.scene.source}: no target where beam and camera meet, in any of "
            f"{len(number)} lines"
        )
    by_depth = seen[np.argsort(depth[seen], kind="stable")]
    groups = [*np.array_split(by_depth, len(ZONES)), np.flatnonzero(np.isnan(depth))]
    distance = [depth[group].mean() if len(group) else np.nan for group in groups[: len(ZONES)]]
    most = int(np.clip(count // _SHARE, *_PER_ZONE))
    limits = [most] * len(ZONES) + [most // _HIDDEN]
    rng = np.random.default_rng((light.scene.seed, _STREAM))
    drawn = [rng.permutation(group)[:n] for group, n in zip(groups, limits, strict=True)]
    part = np.repeat(np.arange(len(PARTS)), [len(group) for group in drawn])
    rank = np.concatenate([np.arange(len(group)) for group in drawn])
    order = np.lexsort((part, rank))
    chosen_lines = number[np.concatenate(drawn)]
    run = chosen_lines // BLOCK * BLOCK + chosen_lines % BLOCK // _PLACE
    _, place = np.unique(run[order], return_inverse=True)
    return Survey(chosen_lines[order], part[order], rank[order], place, np.array(distance))


class _Trial:
    """A survey's lines, rendered with any set of effects and compared with all effects.

    ``_RAYS`` among the effects stands for ``FLAT_PX`` in place of the tolerance.
    """

    seconds: dict[str, float]  # time of each effect in the last lines rendered
    pointless = False  # whether lines were looked at with all effects, and none has a point

    def __init__(
        self, light: Light, count: int, seen: Survey, tolerance_px: float, full: frozenset[str]
    ) -> None:
        self.light, self.seen, self.tolerance_px, self.full = light, seen, tolerance_px, full
        self._count = count
        self.spent_us = 0.0  # typical time of all renderings so far
        self.microseconds: dict[frozenset[str], float] = {}  # best time per line, by effects
        self._registers = Registers.from_config(judged(light.belief))
        tries, last = seen.first(_PER_ZONE[0]), len(seen.numbers)
        ends = {0, *(seen.first(n) for n in _STEPS), tries, *range(tries, last, _STEP), last}
        self._steps = [np.arange(a, b) for a, b in itertools.pairwise(sorted(ends))]
        self._known: dict[tuple[int, frozenset[str]], Table] = {}  # by a step's first line
        # The worst lines of a failed trial and their points, by the effects of the reference.
        self._worst: dict[frozenset[str], tuple[Ints, Table]] = {}

    @cached_property
    def _given(self) -> tuple[Timeline, Pixels]:
        """Return the input of rendering for the survey's lines."""
        return Scanner(self.light, self._count, frozenset()).given(self.seen.numbers)

    def points(self, rows: Ints, effects: frozenset[str]) -> Table:
        """Return the points of some lines."""
        renderer = Renderer(
            self.light,
            effects - {_RAYS},
            tolerance_px=_plane_px(effects, self.tolerance_px),
        )
        self.spent_us += START_US + len(rows) * _us(effects)
        timeline, words = picked(self._given[0], rows), self._given[1][rows]
        begin = time.thread_time()
        frame = renderer.render(timeline, words)
        taken_us = 1e6 * (time.thread_time() - begin) / len(rows)
        self.microseconds[effects] = min(taken_us, self.microseconds.get(effects, np.inf))
        self.seconds = dict(renderer.seconds)
        power = np.full(len(rows), self.light.belief.laser.power_max, np.int64)
        angle = angle_turns(frame.reported_rad)
        return table(run_fixed(frame.lines, angle, power, self._registers))

    def _reference(self, rows: Ints, effects: frozenset[str]) -> Table:
        """Return the points of a step's lines with the effects of a reference."""
        key = int(rows[0]), effects
        if key not in self._known:
            self._known[key] = self.points(rows, effects)
        return self._known[key]

    def look(self, lines: int) -> None:
        """Find out whether any of the first lines has a point: without one, all change nothing."""
        steps = (rows for rows in self._steps if rows[0] < lines)
        self.pointless = not any(self._reference(rows, self.full).located.any() for rows in steps)

    def judge(self, effects: frozenset[str], lines: int) -> Difference | None:
        """Return the change by the other effects on the first lines, or None once it is too large.

        For each zone the mean square of the changes, plus ``_SIGMAS`` standard errors of that mean,
        has to be below the tolerance's square, so a few lines that move far weigh more. Errors are
        those of places, because all lines of a place may be of one edge.
        """
        full, effects = alike(self.full, effects)
        part, place = self.seen.part[:lines], self.seen.place[:lines]
        size = np.bincount(part, minlength=len(PARTS)).astype(np.float64)
        if full in self._worst:
            rows, reference = self._worst[full]
            spent = _spent(reference, self.points(rows, effects), self.light.belief)
            if self._exceeds(spent, self.seen.part[rows], self.seen.place[rows], size):
                return None
        pairs: list[tuple[Table, Table]] = []
        spent = np.zeros((2, 0))
        for rows in self._steps:
            done = int(rows[-1]) + 1
            pairs.append((self._reference(rows, full), self.points(rows, effects)))
            spent = np.append(spent, _spent(*pairs[-1], self.light.belief), axis=1)
            if done == lines or self._exceeds(spent, part[:done], place[:done], size, done / lines):
                break
        first, second = (Table.joined(each) for each in zip(*pairs, strict=True))
        both = first.located & second.located
        if done == lines and not self._exceeds(
            spent, part, place, size, kept=np.bincount(part, both, len(PARTS)).astype(np.float64)
        ):
            return difference(first, second, part, self.light)
        if len(pairs) > 1:
            room = np.array([np.square(self.tolerance_px) * size, np.ones(len(PARTS))])
            score = (spent / room[:, part[:done]]).sum(axis=0)
            rows = np.sort(np.argsort(-score, kind="stable")[:_WORST])
            self._worst[full] = rows, self.points(rows, full)
        return None

    def _exceeds(
        self,
        spent: Floats,
        part: Ints,
        place: Ints,
        size: Floats,
        share: float = 1.0,
        kept: Floats | None = None,
    ) -> bool:
        """Return whether some lines alone change too much for all of their part.

        Args:
            spent: Changes of the lines, from ``_spent`` [2, n].
            part: Part of each line [n].
            place: Place of each line [n].
            size: Number of lines of each part [4].
            share: Share of all lines that these are; they may use up the square root of that share
                of the sum that all squares may have.
            kept: Number of lines of each part that have both points [4]; ``size`` if None.
        """
        square, other = (np.bincount(part, values, len(PARTS)) for values in spent)
        places = np.bincount(len(PARTS) * place + part, spent[0])
        fourth = np.bincount(np.arange(len(places)) % len(PARTS), np.square(places), len(PARTS))
        room = np.square(self.tolerance_px) * (size if kept is None else kept)
        over = square + _SIGMAS * np.sqrt(fourth) > room
        over |= square > np.sqrt(share) * room
        return bool(
            over[: len(ZONES)].any() or (other > np.maximum(_MOST_CHANGED * size, 1.0)).any()
        )


def dearest(names: Iterable[str]) -> list[str]:
    """Return the effects among some names, the most expensive first, in one order for ever."""
    some = frozenset(names)
    return sorted((e for e in EFFECTS if e in some), key=lambda name: -EFFECTS[name].typical_us)


def alike(full: frozenset[str], effects: frozenset[str]) -> tuple[frozenset[str], frozenset[str]]:
    """Return the two sets of effects whose points are compared: without grain, if both have it."""
    return (full - {_GRAIN}, effects - {_GRAIN}) if _GRAIN in effects else (full, effects)


def judged(config: Config) -> Config:
    """Return the configuration of the points that are compared: one window, whatever is set.

    Its position changes as little as the light does. A fit depends on 15 other lines, and where it
    stands with all effects and not with fewer, its line moves by more than any of them is worth.
    """
    update = {"window": "threshold"}
    return config.model_copy(update={"peak": config.peak.model_copy(update=update)})


def _spent(first: Table, second: Table, config: Config) -> Floats:
    """Return each line's square of the change, and whether its point is another one [2, n]."""
    apart = moved(first, second, config)
    other = (np.abs(apart) > JUMP_PX) | (first.located != second.located)
    return np.array([np.where(other, 0.0, np.square(apart)), other])


def moved(first: Table, second: Table, config: Config) -> Floats:
    """Return the distances of points from those of a second table, px [n], 0 without both points.

    Where the angle differs and not the spot (as by the index), the distance is that in pixels which
    would move z as far.

    Args:
        first: n points.
        second: Points of the same lines.
        config: The instrument, for the slope dz/dx_s.
    """
    both = first.located & second.located
    apart = np.where(both, first.position_px - second.position_px, 0.0)
    turned = both & (first.angle_rad != second.angle_rad)
    if turned.any():
        u, step = triangle.undistorted(second.position_px[turned], config.geometry)
        slope = triangle.triangle(u, second.angle_rad[turned], config.geometry).slope * step
        rise = first.z_mm[turned] - second.z_mm[turned]
        apart[turned] = np.where(slope == 0.0, 0.0, rise / np.where(slope == 0.0, 1.0, slope))
    return apart


def difference(first: Table, second: Table, part: Ints, light: Light) -> Difference:
    """Return the difference of two tables of the same lines, by part.

    Points more than ``JUMP_PX`` apart belong to two peaks, not to one that moved: they count as
    changed, and not in bias and rms.

    Args:
        first: n points.
        second: Points of the same lines.
        part: Part of each line, 0 to 3 in the order of ``PARTS`` [n].
        light: The instrument, for the slope dz/dx_s.
    """
    both = first.located & second.located
    moved_mm = np.where(both, first.z_mm - second.z_mm, 0.0)
    moved_px = moved(first, second, light.belief)
    jumped = np.abs(moved_px) > JUMP_PX
    changed = (first.located != second.located) | jumped
    both &= ~jumped
    rows = [_part(moved_px, moved_mm, changed, both, part == k) for k in range(len(PARTS))]
    return Difference(*(np.array(column) for column in zip(*rows, strict=True)))


def _part(
    px: Floats, mm: Floats, changed: Bools, both: Bools, inside: Bools
) -> tuple[float, float, float, float, float]:
    rows = both & inside
    lost = float(changed[inside].mean()) if inside.any() else 0.0
    if not rows.any():
        return np.nan, np.nan, np.nan, np.nan, lost
    return (
        float(px[rows].mean()),
        float(px[rows].std()),
        float(mm[rows].mean()),
        float(mm[rows].std()),
        lost,
    )


def _plane_px(effects: frozenset[str], tolerance_px: float) -> float:
    """Return the largest error of a tangent plane with these effects."""
    return min(tolerance_px, FLAT_PX) if _RAYS in effects else tolerance_px


def _us(effects: frozenset[str]) -> float:
    """Return the typical time of a line with these effects, up to its point."""
    return typical_us(effects - {_RAYS}, rays=_RAYS in effects) + LINE_US


def _auto(
    trial: _Trial, break_even_lines: int, tick: Callable[[], None]
) -> tuple[frozenset[str], Difference]:
    """Return the effects that are on, with ``_RAYS`` if spots need them, and the change."""
    lines = trial.seen.first(_PER_ZONE[0])
    full = state = trial.full
    kept = [(full, _NOTHING)]
    before_us = trial.spent_us
    trial.look(lines)
    if trial.pointless:
        return full, _NOTHING

    def confirms(effects: frozenset[str]) -> bool:
        """Return whether it pays to render the rest of the survey for these effects."""
        rest_us = (len(trial.seen.numbers) - lines) * (_us(full) + _us(effects))
        return break_even_lines * (_us(full) - _us(effects)) >= _ODDS * rest_us

    tick()
    found = trial.judge(full - {_GRAIN}, lines)
    if found is not None:
        state = full - {_GRAIN}
        kept.append((state, found))
    stay = _GRAINED & state if _GRAIN in state else frozenset({_GRAIN})
    dear = dearest(full - stay)
    everywhere = [name for name in dear if name in WHOLE_LINE]
    others = [name for name in dear if name not in WHOLE_LINE and name != _DETAIL]
    others = [name for name in others if EFFECTS[name].typical_us > 0.0]
    todo = [everywhere, [_RAYS, _DETAIL], others]
    while todo:
        names = todo.pop(0)
        less = _without(state, names)
        saved_us = break_even_lines * (_us(full) - _us(state))
        if trial.spent_us - before_us > _STAKE * break_even_lines * _us(full) + saved_us:
            break
        if not confirms(less.difference(*todo)):
            break
        if break_even_lines * (_us(state) - _us(less)) < _ODDS * (START_US + lines * _us(less)):
            continue
        tick()
        found = trial.judge(less, lines)
        if found is not None:
            state = less
            kept.append((state, found))
        elif len(names) > 1:
            half = len(names) // 2
            todo += [names[:half], names[half:]]
    if len(trial.seen.numbers) == lines:
        return kept[-1]
    # What was left out has to hold on all lines: together, else one after the other.
    steps = [first - second for (first, _), (second, _) in itertools.pairwise(kept)]
    whole = frozenset[str]().union(*steps)
    state, change, left = full, _NOTHING, [whole]
    while left:
        group = left.pop(0)
        less = _without(state, group)
        rest_us = (len(trial.seen.numbers) - lines) * _us(less)
        if group == whole:
            rest_us += (len(trial.seen.numbers) - lines) * _us(full)
        if break_even_lines * (_us(state) - _us(less)) < _ODDS * rest_us:
            continue
        tick()
        found = trial.judge(less, len(trial.seen.numbers))
        if found is not None:
            state, change = less, found
        elif group == whole:
            left = steps if len(steps) > 1 else []
        elif len(group) > 1:
            left += [frozenset({name}) for name in sorted(group)]
    return state, change


def _without(state: frozenset[str], names: Iterable[str]) -> frozenset[str]:
    """Return a set of effects without some names, but for those that others of the set need."""
    less = state.difference(names)
    # Where spots need their rays if a plane is wrong, they need more than a plane.
    needed = {"footprint"} if _RAYS in less else set()
    needed |= _GRAINED if _GRAIN in less else set()
    return less | (state & needed)
