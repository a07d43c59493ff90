"""What each effect would do to a scene's points, and which of them are worth their time.

A few hundred lines, near, in the middle, far, and such whose spot the camera does not see, are
rendered with everything and then with everything but one effect, always with the same random
numbers, and go through the chain's bit-accurate model. What the position changes by is what the
effect contributes here: its mean over such a part is the bias, the spread about it the rms.
``auto`` then leaves out what costs most for what it contributes, as long as everything left out
together, rendered once more to be sure, stays below the tolerance in every zone and neither adds
nor loses a point, be it one whose spot is hidden; in the end some thousand lines have to confirm
that, of which at most three in a thousand may differ.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vrscan.arrays import Bools, Floats, Ints
from vrscan.chain import run_fixed
from vrscan.config import Config
from vrscan.errors import InputError
from vrscan.ideal import geometry as triangle
from vrscan.points import table
from vrscan.registers import Registers, angle_turns
from vrscan.scene.effects import EFFECTS, chosen, present, typical_us
from vrscan.scene.light import Light
from vrscan.scene.render import Frame
from vrscan.scene.simulate import BLOCK, Scanner
from vrscan.table import Table

ZONES = ("near", "middle", "far")
PARTS = (*ZONES, "hidden")  # of the probe; the last: lines whose spot the camera does not see
JUMP_PX = 3.0
_PER_PART = 160  # probe lines
_SURVEY = 4  # blocks in which they are looked for
_STREAM = 0x9A1F
_FIRST = 32  # lines that make the tables
_SAFETY = 0.8  # of the tolerance, on the probe
_SURVEYED = 0.95  # of it, on all lines of the survey
_MOST_CHANGED = 0.003  # of those lines: points that come, go or jump
_FREE_US = 0.05  # a line: an effect cheaper than that is not worth leaving out


@dataclass(frozen=True)
class Difference:
    """What leaving something out changes, by part of the probe; mean and spread of positions."""

    bias_px: Floats  # [4], as ``PARTS``
    rms_px: Floats  # about the bias
    bias_mm: Floats  # in z
    rms_mm: Floats
    changed: Floats  # share of lines with a point in only one of the two, or two far apart

    @property
    def total_px(self) -> Floats:
        """Bias and spread together, near, middle and far [3]."""
        return np.hypot(self.bias_px, self.rms_px)[: len(ZONES)]


@dataclass(frozen=True)
class Prediction:
    """One effect in this scene."""

    name: str
    difference: Difference
    microseconds: float  # a line
    on: bool


@dataclass(frozen=True)
class Plan:
    """Which effects a scene gets, and what the others would have done."""

    fidelity: str  # "auto", "full", "minimal" or "list"
    tolerance_px: float
    active: frozenset[str]
    every_ray: bool
    present: tuple[str, ...]  # the effects that the scene has
    predictions: tuple[Prediction, ...]  # of them, where they were asked for
    absent: tuple[str, ...]  # the others
    left_out: Difference  # measured: everything that is off, together
    distance_mm: Floats  # mean z of each zone [3]
    microseconds: tuple[float, float]  # a line: as planned, and with everything
    lines: int  # of the probe
    seconds: float  # that the planning took


@dataclass(frozen=True)
class Survey:
    """Lines of some blocks of a scan, which the probes are drawn from."""

    numbers: Ints  # rising [n]
    part: Ints  # index into ``PARTS`` [n]
    probe: Ints  # rows of those that are rendered with every effect left out [m]
    distance_mm: Floats  # mean z of the zones [3]


def plan(
    light: Light,
    count: int,
    *,
    fidelity: str | list[str] | None = None,
    tolerance_px: float | None = None,
    each: bool = True,
    seen: Survey | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Plan:
    """Return which effects a scan gets.

    Args:
        light: The scene and the instrument.
        count: Lines of the scan, from which the probe is drawn.
        fidelity: ``auto``, ``full``, ``minimal``, or a list of effects; the scene's own if None.
        tolerance_px: Of ``auto``; the scene's own if None.
        each: Whether what single effects do is asked for; ``auto`` has to know it anyway.
        seen: ``survey`` of the same scan, if somebody has made it.
        progress: Called with the number of renderings done and of all.

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
    seen = survey(light, count) if seen is None else seen
    numbers = seen.numbers[seen.probe]
    probe = _Probe(light, count, numbers, seen.part[seen.probe], tolerance)
    total = len(have) + 2
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(min(done, total), total)

    whole = frozenset(have)
    probe.prepare(whole)
    probe.reference = probe.table(whole, every_ray=True)
    seconds = probe.seconds  # of each effect, in the whole
    full_us = probe.microseconds
    tick()
    found: dict[str, Difference] = {}
    for name in have if each or wanted == "auto" else ():
        found[name] = probe.against(whole - {name}, every_ray=True)
        tick()
    cost = {name: 1e6 * seconds.get(name, 0.0) / len(numbers) for name in have}
    every_ray = wanted == "full"
    if listed is not None:
        active = listed & whole
    elif wanted == "full":
        active = whole
    elif wanted == "minimal":
        active = frozenset[str]()
    else:
        everything = _Probe(light, count, seen.numbers, seen.part, tolerance)
        active, every_ray = _auto(probe, everything, found, whole)
        probe = everything
    left_out = probe.against(active, every_ray=every_ray)
    planned_us = probe.microseconds
    tick()
    return Plan(
        fidelity="list" if listed is not None else str(wanted),
        tolerance_px=tolerance,
        active=active,
        every_ray=every_ray,
        present=have,
        predictions=tuple(
            Prediction(name, found[name], cost[name], name in active) for name in found
        ),
        absent=tuple(name for name in EFFECTS if name not in have),
        left_out=left_out,
        distance_mm=seen.distance_mm,
        microseconds=(planned_us, full_us),
        lines=len(numbers),
        seconds=time.perf_counter() - begin,
    )


def survey(light: Light, count: int) -> Survey:
    """Return what there is to see in a scan.

    Raises:
        InputError: if the camera sees none of the lines.
    """
    scanner = Scanner(light, count, frozenset())
    blocks = np.unique(np.linspace(0, scanner.blocks - 1, _SURVEY).round().astype(np.int64))
    numbers, depths = [], []
    for block in blocks.tolist():
        truth = scanner.block(block).truth
        numbers.append(block * BLOCK + np.arange(len(truth.z_mm)))
        depths.append(np.where(np.isfinite(truth.position_px), truth.z_mm, np.nan))
    number, depth = np.concatenate(numbers), np.concatenate(depths)
    number, depth = number[number < count], depth[number < count]
    seen = np.flatnonzero(np.isfinite(depth))
    if len(seen) == 0:
        raise InputError(
            f"{light.scene.source}: no target where beam and camera meet, in any of "
            f"{len(number)} lines"
        )
    by_depth = seen[np.argsort(depth[seen], kind="stable")]
    groups = [*np.array_split(by_depth, len(ZONES)), np.flatnonzero(np.isnan(depth))]
    part = np.empty(len(number), np.int64)
    for index, group in enumerate(groups):
        part[group] = index
    rng = np.random.default_rng((light.scene.seed, _STREAM))
    probe = np.sort(np.concatenate([rng.permutation(group)[:_PER_PART] for group in groups]))
    distance = [depth[group].mean() if len(group) else np.nan for group in groups[: len(ZONES)]]
    return Survey(number, part, probe, np.array(distance))


class _Probe:
    """Renders the probe lines with any set of effects and compares the points."""

    reference: Table
    seconds: dict[str, float]
    microseconds: float

    def __init__(
        self, light: Light, count: int, numbers: Ints, part: Ints, tolerance_px: float
    ) -> None:
        self.light, self.count, self.numbers, self.part = light, count, numbers, part
        self.tolerance_px = tolerance_px
        self._registers = Registers.from_config(light.config)
        self._power = np.full(len(numbers), light.config.laser.power_max, np.int64)

    def prepare(self, active: frozenset[str]) -> None:
        """Let the scene make the tables that all lines share, lest one effect pays for them."""
        Scanner(self.light, self.count, active, every_ray=True).some(self.numbers[:_FIRST])

    def table(self, active: frozenset[str], *, every_ray: bool) -> Table:
        """Return the points of the probe lines."""
        scanner = Scanner(
            self.light, self.count, active, every_ray=every_ray, tolerance_px=self.tolerance_px
        )
        begin = time.perf_counter()
        frame: Frame = scanner.some(self.numbers)
        self.microseconds = 1e6 * (time.perf_counter() - begin) / len(self.numbers)
        self.seconds = dict(scanner.renderer.seconds)
        angle = angle_turns(frame.reported_rad)
        return table(run_fixed(frame.lines, angle, self._power, self._registers))

    def against(self, active: frozenset[str], *, every_ray: bool) -> Difference:
        """Return what the reference has more than this set."""
        return difference(
            self.reference, self.table(active, every_ray=every_ray), self.part, self.light
        )


def moved(first: Table, second: Table, config: Config) -> Floats:
    """Return how far points are from those of a second table, px [n], 0 without a point in both.

    Where the angle differs and not the spot (the index does that), it is the pixels that would move
    z as far.

    Args:
        first: n points.
        second: Of the same lines.
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
    """Return how two tables of the same lines differ, by part.

    Points more than ``JUMP_PX`` apart are of two peaks, not of one that moved: they count as
    changed, and not in bias and rms.

    Args:
        first: n points.
        second: Of the same lines.
        part: 0 to 3 for each line, as ``PARTS`` [n].
        light: The instrument, for the slope dz/dx_s.
    """
    both = first.located & second.located
    moved_mm = np.where(both, first.z_mm - second.z_mm, 0.0)
    moved_px = moved(first, second, light.config)
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
        return 0.0, 0.0, 0.0, 0.0, lost
    return (
        float(px[rows].mean()),
        float(px[rows].std()),
        float(mm[rows].mean()),
        float(mm[rows].std()),
        lost,
    )


def _auto(
    probe: _Probe,
    everything: _Probe,
    found: dict[str, Difference],
    whole: frozenset[str],
) -> tuple[frozenset[str], bool]:
    """Return the effects that are on, and whether every spot needs its rays.

    Time is reckoned with as it typically is, not as it was measured: the same scene gets the same
    effects, and so the same lines, whenever and wherever it is simulated.
    """
    limit = _SAFETY * probe.tolerance_px

    def price(name: str) -> float:
        cost = typical_us(frozenset({name}), every_ray=False) + _FREE_US
        return float(found[name].total_px.max()) / cost

    off: list[str] = []
    bias, square = np.zeros(len(PARTS)), np.zeros(len(PARTS))  # the hidden count only as points
    for name in sorted(found, key=price):
        one = found[name]
        if one.changed.any():
            continue
        after = np.sqrt((bias + np.abs(one.bias_px)) ** 2 + square + one.rms_px**2)
        if after[: len(ZONES)].max() > limit:
            continue
        off.append(name)
        bias, square = bias + np.abs(one.bias_px), square + one.rms_px**2
    # Together they may do more than one by one, and the probe is a sample: the sum is measured, on
    # the probe and then on all lines of the survey, and what weighs most returns.
    everything.reference = everything.table(whole, every_ray=True)
    checks = ((probe, limit, 0.0), (everything, _SURVEYED * probe.tolerance_px, _MOST_CHANGED))

    def settled(every_ray: bool) -> tuple[float, frozenset[str], bool] | None:
        """Return typical us a line, effects and ``every_ray``; None if only rays would do."""
        out = list(off)
        while True:
            active = whole - frozenset(out)
            for lines, most, lost in checks:
                joint = lines.against(active, every_ray=every_ray)
                if joint.total_px.max() > most or joint.changed.max() > lost:
                    break
            else:
                return typical_us(active, every_ray=every_ray), active, every_ray
            if not out:
                return None
            out.remove(max(out, key=price))

    by_need, by_all = settled(False), settled(True)
    if by_all is None or (by_need is not None and by_need[0] <= by_all[0]):
        by_all = by_need
    return (whole, True) if by_all is None else by_all[1:]
