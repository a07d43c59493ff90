"""The virtual experiment of VR-SCAN V: a simulated instrument is calibrated and then measured.

Every scan is made by the light of a scene and turned into points by the chain with the
configuration as it was believed before. The calibration gets these points, the index's crossings
and the stated distances, and nothing of the truth; truth only scores what comes out.

Scans are kept in a folder, so an experiment that was interrupted goes on where it was.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from importlib import metadata
from pathlib import Path

import numpy as np

from vrscan.calibrate import coarse, field_map, mirror_map, recording, results, verify
from vrscan.calibrate.motion_fit import simulated_motions
from vrscan.calibrate.recording import Recording, Setup, recorded
from vrscan.data import pkg
from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.correction_maps import FieldMaps, extension_mm, focus_of_mm
from vrscan.data.errors import InputError
from vrscan.data.parallel import processors, workers
from vrscan.data.points import atomic_file
from vrscan.data.residuals import rms
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, reach, run_block
from vrscan.ideal.geometry import ThinLens
from vrscan.scene.description import Description, parse
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import BLOCK, TOGETHER, Scanner
from vrscan.scene.timeline import timeline
from vrscan.scene.tolerances import Instrument, drawn, written
from vrscan.study.progress import Progress

FRAMES = 10_000  # lines of a scan, as in the paper: 66 periods
RELIEF_MM = tuple(320.0 + k for k in range(100))  # distances of the coarse calibration
RELIEF_FOCUS_MM = 360.0
# The stage's motion along y in the scans of the steps: else the speckle of a place comes again.
STAGE_MM_PER_S = 60.0
MIRROR_MM = (320.0, 345.0, 370.0, 395.0, 420.0)  # of the plane at each operating point
MIRROR_LEVELS = (0.62, 0.70, 0.78)  # of the drive: the middle and the ends of the loop's band
DRIFTED_LEVELS = (0.64, 0.66, 0.74, 0.76)  # where the loop may rest after a drift
MAP_COUNT = pkg.MAP_COUNT
MAP_FAR_MM = 1010.0  # focus of the first map
MAP_STEP_MM = 0.256  # of the lens from map to map: 512 of its steps of 0.5 um
MAP_PLANES_MM = (0.16, 0.0, -0.16)  # of the lens: distances beside each focus
SCALE_FOCUS_MM = 500.0  # f of (4) is that of this focus; the maps hold what other foci differ by
MAP_REACH_MM = (245.0, 1005.0)  # of the stage
VERIFY_MM = (250.0, 300.0, 350.0, 450.0, 600.0, 750.0, 875.0, 1000.0)
BOLT_MM, BOLT_PITCH_MM = 600.0, 5.0
BOLT_FOCI_MM = (560.0, 600.0, 640.0)
BOLT_POSES_DEG = (-20.0, -10.0, 0.0, 10.0, 20.0)
BUST_LINES = 1_350_000  # of one pan over 300 mm
BUST_MM, BUST_FOCUS_MM = 300.0, 310.0
BUST_HEIGHT_MM = 300.0
_CHUNK = 32  # blocks of the pan that are one piece of work
_DRAWN = 16  # one in so many points of the pan is kept for a picture
_BINS_MM = tuple(np.round(np.arange(-2.0, 2.0001, 0.05), 3).tolist())
POWER_MW, POWER_AT_MM, POWER_GROWTH = 7.0, 400.0, 1.4  # peaks of half of full scale
_STREAM = 0xCA11B
_KEPT = "plan.json"


@dataclass(frozen=True)
class Scan:
    """One scan of the experiment."""

    name: str
    setup: Setup
    instrument: Instrument
    seed: int
    frames: int
    belief: Config
    engine: Engine
    target: dict[str, object] = field(default_factory=dict)  # of the kind "other"
    pan_mm_per_s: float = 0.0
    power_mw: float | None = None  # peaks of half of full scale if None

    def description(self) -> Description:
        """Return the scene: the surface stands where the stage's error puts it."""
        setup, own = self.setup, self.instrument
        rng = np.random.default_rng((self.seed, _STREAM))
        off_mm = 1e-3 * rng.uniform(-own.stage_um, own.stage_um)
        place = [0.0, 0.0, setup.z_mm + off_mm]
        target: dict[str, object] = {"kind": setup.kind, "position_mm": place}
        if setup.kind == "relief":
            target |= {"amplitude_mm": setup.amplitude_mm, "period_mm": setup.period_mm}
            target["size_mm"] = [800.0, 200.0]
        values: dict[str, object] = {
            "target": [self.target or target],
            "lens": {"focus_mm": setup.focus_mm},
            "laser": {"power_mw": self.power_mw or power_mw(setup.z_mm)},
            "scan": {"pan_mm_per_s": self.pan_mm_per_s},
            "seed": self.seed,
        }
        instrument = own.model_copy(update={"drive_phase": setup.drive_phase})
        return parse(values, self.name, Path()).model_copy(update={"instrument": instrument})

    def scanner(self) -> Scanner:
        """Return the source of the scan's lines, in full light."""
        described = self.description()
        active = frozenset(present(described))
        return Scanner(Light(described, self.belief), self.frames, active)

    def points(self, blocks: range | None = None) -> tuple[Recording, Floats]:
        """Return the good points and crossings of some blocks, all if None, and the true z.

        Args:
            blocks: Numbers of blocks that follow each other.
        """
        scanner, config = self.scanner(), self.belief
        tables, times, index, outward, truth = [], [], [], [], []
        wanted = range(scanner.blocks) if blocks is None else blocks
        groups = (wanted[k : k + TOGETHER] for k in range(0, len(wanted), TOGETHER))
        for each in (each for group in groups for each in scanner.around(group, *reach(config))):
            part, first = each.simulation, each.number * BLOCK
            beside = each.before, each.behind
            tables.append(run_block(self.engine, part.lines, config, first, *beside))
            times.append(part.timeline.time_s)
            index.append(part.timeline.index_s)
            outward.append(part.timeline.index_outward)
            assert part.lines.truth is not None  # a simulation has a truth
            truth.append(part.lines.truth.z_mm)
        crossing, out = np.concatenate(index), np.concatenate(outward)
        pair = np.flatnonzero(out[:-1] & ~out[1:])
        points, time = Table.joined(tables), np.concatenate(times)
        made = recorded(
            self.name,
            self.setup,
            points,
            time,
            crossing[pair],
            crossing[pair + 1],
            self.belief.sensor.line_length,
        )
        first = int(points.line[0])
        return made, np.concatenate(truth)[made.line.astype(np.int64) - first]


def power_mw(z_mm: float) -> float:
    """Return the constant power of a scan, at which its peaks are about half of full scale."""
    return float(min(50.0, POWER_MW * (z_mm / POWER_AT_MM) ** POWER_GROWTH))


@dataclass(frozen=True)
class OperatingPoint:
    """A state in which the mirror's loop may rest."""

    level: float
    frequency_hz: float
    drive_phase: float  # turns, of the index against the drive
    harmonics: list[list[float]]  # of this instrument


def operating_points(
    instrument: Instrument, config: Config, levels: Sequence[float]
) -> list[OperatingPoint]:
    """Return how an instrument's mirror moves at several levels of the drive.

    The motion is that of the simulated mirror, by its differential equation; the instrument's
    harmonics differ from the shipped ones by as much at every level. Where the natural frequency
    drifts, the loop's frequency follows, so these are the states after a drift, too.

    Args:
        instrument: The instrument, whose harmonics are those at the configuration's drive phase.
        config: The configuration.
        levels: Levels of the drive.
    """
    mirror = config.mirror
    motions = simulated_motions(math.radians(mirror.amplitude_deg), levels=levels)
    shipped = np.array(Config().mirror.harmonics)
    own = np.array(instrument.harmonics or mirror.harmonics)
    size = own[:, 0] / np.where(shipped[:, 0] == 0.0, 1.0, shipped[:, 0])
    turn = own[:, 1] - shipped[:, 1]
    found = []
    for level, motion in zip(levels, motions, strict=True):
        rows = motion.harmonics.copy()
        rows[:, 0] *= size
        rows[:, 1] += turn
        rows[0] = 1.0, 0.0
        phase = motion.phase_rad / (2.0 * math.pi)
        found.append(OperatingPoint(level, motion.frequency_hz, phase, rows.tolist()))
    return found


def at(instrument: Instrument, point: OperatingPoint) -> Instrument:
    """Return an instrument whose mirror rests at an operating point."""
    own = {"harmonics": point.harmonics, "drive_phase": point.drive_phase}
    return instrument.model_copy(update=own)


def refocused(config: Config, from_mm: float, to_mm: float) -> Config:
    """Return a configuration whose image has the scale of another focus, by the thin lens."""
    geometry = config.geometry
    scale = [ThinLens.of(1.0, focus, geometry).image_mm for focus in (from_mm, to_mm)]
    own = geometry.model_copy(update={"focal_mm": geometry.focal_mm * scale[1] / scale[0]})
    return config.model_copy(update={"geometry": own})


def pitch_mm(along_mm: Floats, across_mm: Floats) -> float:
    """Return the pitch of a thread from points on its flanks, mm.

    A line is taken off, and the period is that of the two harmonics that describe most of the rest.

    Args:
        along_mm: Coordinate x of the points [n].
        across_mm: Coordinate z [n].
    """
    points = np.stack([along_mm, across_mm], axis=1)
    for _ in range(3):  # without what is not on the rod
        middle = np.median(points, axis=0)
        axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
        off = (points - middle) @ np.array([-axis[1], axis[0]])
        points = points[np.abs(off - np.median(off)) < 4.0]
    s = (points - points.mean(axis=0)) @ axis
    off = (points - points.mean(axis=0)) @ np.array([-axis[1], axis[0]])

    def left(period: float) -> float:
        turn = 2.0 * np.pi * s / period
        columns = [np.ones(len(s)), s, np.square(s)]
        columns += [wave(k * turn) for k in (1, 2) for wave in (np.cos, np.sin)]
        design = np.stack(columns, axis=1)
        rest = off - design @ np.linalg.lstsq(design, off, rcond=None)[0]
        return float(np.sum(np.minimum(np.square(rest), 1.0)))

    from scipy.optimize import minimize_scalar

    grid = np.arange(3.5, 7.0, 0.02)
    best = float(grid[int(np.argmin([left(float(each)) for each in grid]))])
    bounds = (best - 0.03, best + 0.03)
    return float(minimize_scalar(left, bounds=bounds, method="bounded").x)


@dataclass(frozen=True)
class _Piece:
    """A part of the pan over the bust."""

    first: int
    count: int


@dataclass(frozen=True)
class _Sums:
    """What a part of the pan gave."""

    points: int = 0
    histogram: list[int] = field(default_factory=lambda: [0] * (len(_BINS_MM) - 1))
    square: float = 0.0  # sum of the squared errors in the histogram, mm^2
    drawn: list[list[float]] = field(default_factory=list)  # some of the points, mm


@dataclass(frozen=True)
class _Pan:
    """The work of a process on the pan: errors of points, by the calibrated instrument."""

    scan: Scan
    config: Config
    maps: FieldMaps

    def __call__(self, piece: _Piece) -> _Sums:
        """Return the number of points of some blocks, and the histogram of their errors in z."""
        blocks = range(piece.first, piece.first + piece.count)
        try:
            made, truth = self.scan.points(blocks)
        except InputError:  # beside the bust there are no points
            return _Sums()
        x, z = verify.measured(made, self.config, self.maps)
        error = z - truth
        counts, _ = np.histogram(error, _BINS_MM)
        inside = np.abs(error) < 2.0
        some = np.stack([x, self.scan.pan_mm_per_s * made.time_s, z], axis=1)[::_DRAWN]
        square = float(np.sum(np.square(error[inside])))
        return _Sums(len(made), counts.tolist(), square, some.round(3).tolist())


def _taken(scan: Scan) -> Recording:
    return scan.points()[0]


@dataclass(frozen=True)
class Experiment:
    """A virtual experiment in a folder."""

    seed: int
    folder: Path
    belief: Config
    engine: Engine = Engine.FIXED
    frames: int = FRAMES
    bust_lines: int = BUST_LINES
    jobs: int = 0  # processes; 0 is one for each processor

    def __post_init__(self) -> None:
        if self.frames < 1501:
            raise InputError(f"--frames: {self.frames} lines; ten periods interlace in 1501")

    @property
    def instrument(self) -> Instrument:
        """Return the instrument that is calibrated."""
        return drawn(self.seed, self.belief)

    def _scan(self, name: str, number: int, setup: Setup, own: Instrument | None = None) -> Scan:
        seed, instrument = 1000 * self.seed + number, own or self.instrument
        return Scan(name, setup, instrument, seed, self.frames, self.belief, self.engine)

    def _moved(self, name: str, number: int, setup: Setup, own: Instrument | None = None) -> Scan:
        """Return a scan during which the stage moves along y."""
        return replace(self._scan(name, number, setup, own), pan_mm_per_s=STAGE_MM_PER_S)

    def _setup(self, kind: str, z_mm: float, focus_mm: float, **other: float) -> Setup:
        frequency = self.belief.mirror.frequency_hz
        values = {"kind": kind, "z_mm": z_mm, "focus_mm": focus_mm, "frequency_hz": frequency}
        return Setup.model_validate(values | other)

    def coarse_scans(self) -> list[Scan]:
        """Return the scans of step 1."""
        sine = {"amplitude_mm": 5.0, "period_mm": 40.0}
        return [
            self._moved(f"relief-{z:g}", k, self._setup("relief", z, RELIEF_FOCUS_MM, **sine))
            for k, z in enumerate(RELIEF_MM)
        ]

    def mirror_scans(self) -> list[Scan]:
        """Return the scans of step 2, by operating point and distance."""
        found = []
        points = operating_points(self.instrument, self.belief, MIRROR_LEVELS)
        for k, point in enumerate(points):
            for j, z in enumerate(MIRROR_MM):
                setup = self._setup("plane", z, RELIEF_FOCUS_MM, drive_phase=point.drive_phase)
                name = f"mirror-{point.level:.2f}-{z:g}"
                own = at(self.instrument, point)
                found.append(self._moved(name, 100 + 10 * k + j, setup, own))
        return found

    @property
    def foci_mm(self) -> list[float]:
        """Return the foci of the maps, the farthest first."""
        focal = self.belief.geometry.focal_mm
        begin = extension_mm(MAP_FAR_MM, focal)
        places = [begin + MAP_STEP_MM * k for k in range(MAP_COUNT)]
        return [focus_of_mm(place, focal) for place in places]

    def map_scans(self) -> list[Scan]:
        """Return the scans of step 3, by focus and distance."""
        found, focal = [], self.belief.geometry.focal_mm
        for k, focus in enumerate(self.foci_mm):
            place = extension_mm(focus, focal)
            near, far = MAP_REACH_MM
            distances = {
                round(min(max(focus_of_mm(max(place + off, 0.3), focal), near), far), 1)
                for off in MAP_PLANES_MM
            }
            for j, z in enumerate(sorted(distances)):
                setup = self._setup("plane", z, focus)
                found.append(self._moved(f"map-{k}-{z:g}", 200 + 10 * k + j, setup))
        return found

    def focus_mm(self, z_mm: float) -> float:
        """Return where the lens goes for a distance: into focus, as far as there are maps."""
        return min(max(z_mm, self.foci_mm[-1]), self.foci_mm[0])

    def verify_scans(self) -> list[Scan]:
        """Return scans of planes that no step has seen, each in focus."""
        return [
            self._scan(f"plane-{z:g}", 300 + k, self._setup("plane", z, self.focus_mm(z)))
            for k, z in enumerate(VERIFY_MM)
        ]

    def bolt_scans(self) -> list[Scan]:
        """Return the scans of the threaded bolt."""
        found = []
        for k, focus in enumerate(BOLT_FOCI_MM):
            for j, turn in enumerate(BOLT_POSES_DEG):
                target: dict[str, object] = {
                    "kind": "bolt",
                    "position_mm": [0.0, 0.0, BOLT_MM + 20.0],
                    "rotation_deg": [0.0, turn, 0.0],
                    "diameter_mm": 40.0,
                    "pitch_mm": BOLT_PITCH_MM,
                    "length_mm": 150.0,
                }
                setup = self._setup("other", BOLT_MM, focus)
                name = f"bolt-{focus:g}-{turn:+g}"
                scan = self._scan(name, 400 + 10 * k + j, setup)
                found.append(replace(scan, target=target))
        return found

    def bust_scan(self) -> Scan:
        """Return the pan over the bust."""
        target: dict[str, object] = {
            "kind": "bust",
            "position_mm": [0.0, 0.5 * BUST_HEIGHT_MM, BUST_MM + 60.0],
            "height_mm": BUST_HEIGHT_MM,
        }
        speed = BUST_HEIGHT_MM * self.belief.line.rate_hz / self.bust_lines
        scan = self._scan("bust", 500, self._setup("other", BUST_MM, BUST_FOCUS_MM))
        lines = self.bust_lines
        return replace(scan, target=target, pan_mm_per_s=speed, frames=lines, power_mw=8.0)

    def open(self) -> None:
        """Make the folder, or check that it is of this experiment.

        Raises:
            InputError: if it cannot be made, or belongs to another experiment.
        """
        plan = {
            "version": metadata.version("vrscan"),
            "seed": self.seed,
            "engine": str(self.engine),
            "frames": self.frames,
            "bust_lines": self.bust_lines,
            "belief": self.belief.model_dump(),
        }
        text = json.dumps(plan, indent=1)
        path = self.folder / _KEPT
        try:
            (self.folder / "scans").mkdir(parents=True, exist_ok=True)
            held = path.read_text() if path.exists() else None
        except OSError as error:
            raise InputError(f"{self.folder}: {error.strerror}") from error
        if held is None:
            with atomic_file(path) as file:
                file.write(text.encode())
            with atomic_file(self.folder / "instrument.toml") as file:
                file.write(written(self.instrument).encode())
        elif held != text:
            raise InputError(
                f"{self.folder}: holds another experiment (its {_KEPT} differs); another --out"
            )

    def take(self, scans: Sequence[Scan], progress: Progress) -> list[Recording]:
        """Return scans, from the folder where they are kept already."""
        paths = [self.path(scan) for scan in scans]
        left = [(s, p) for s, p in zip(scans, paths, strict=True) if not p.exists()]
        done = len(scans) - len(left)
        progress(done)
        jobs = max(1, min(self.jobs or processors(), len(left)))
        with workers(_taken, jobs) as do:
            for (_, path), made in zip(left, do([s for s, _ in left]), strict=True):
                with atomic_file(path) as file:
                    recording.write(made, file)
                done += 1
                progress(done)
        return [recording.read(path) for path in paths]

    def path(self, scan: Scan) -> Path:
        """Return the file of a scan."""
        return self.folder / "scans" / f"{scan.name}.npz"

    def pan(self, config: Config, maps: FieldMaps) -> Iterator[tuple[int, _Sums]]:
        """Yield the number of blocks done and the sums of each piece of the pan."""
        scan = self.bust_scan()
        blocks = -(-scan.frames // BLOCK)
        pieces = [_Piece(k, min(_CHUNK, blocks - k)) for k in range(0, blocks, _CHUNK)]
        kept = {k: self.folder / "scans" / f"bust-{k.first}.json" for k in pieces}
        left = [piece for piece in pieces if not kept[piece].exists()]
        done = 0
        for piece in pieces:
            if piece not in left:
                done += piece.count
                yield done, _Sums(**json.loads(kept[piece].read_text()))
        jobs = max(1, min(self.jobs or processors(), len(left)))
        with workers(_Pan(scan, config, maps), jobs) as do:
            for piece, sums in zip(left, do(left), strict=True):
                with atomic_file(kept[piece]) as file:
                    file.write(json.dumps(asdict(sums)).encode())
                done += piece.count
                yield done, sums


Bar = Callable[[str, int], AbstractContextManager[Progress]]


def run(plan: Experiment, bar: Bar) -> dict[str, object]:
    """Return the results of an experiment, and write its files.

    Args:
        plan: The experiment.
        bar: Context manager that shows the progress of a named stage of so many steps, and yields a
            function that takes the number done.

    Raises:
        InputError: as the steps of the calibration, ``Experiment.open`` and the light.
    """
    plan.open()
    folder = plan.folder

    def taken(name: str, wanted: list[Scan]) -> tuple[list[Recording], dict[str, object]]:
        with bar(name, len(wanted)) as progress:
            made = plan.take(wanted, progress)
        return made, dict(results.provenance(plan.path(scan) for scan in wanted))

    def kept(name: str, config: Config, notes: dict[str, object]) -> None:
        with atomic_file(folder / name) as file:
            file.write(results.configuration(config, notes).encode())

    reliefs, notes = taken("1. relief", plan.coarse_scans())
    first = coarse.calibrate(reliefs, plan.belief)
    notes |= {"mean_mm": first.mean_mm} | results.fitted(first.fit)
    kept("coarse.toml", first.config, notes)

    made, notes = taken("2. mirror", plan.mirror_scans())
    second = mirror_map.calibrate(made, first.config)
    notes |= {"mean_mm": second.after_mm} | results.fitted(second.fit)
    kept("mirror.toml", second.config, notes)

    made, notes = taken("3. map", plan.map_scans())
    config = refocused(second.config, RELIEF_FOCUS_MM, SCALE_FOCUS_MM)
    maps = field_map.calibrate(made, config)
    maps.words()  # refuses what does not fit
    kept("calibrated.toml", config, {"focus of the image's scale": f"{SCALE_FOCUS_MM:g} mm"})
    with atomic_file(folder / "map.npz") as file:
        results.write_maps(maps, notes, file)

    made, _ = taken("planes", plan.verify_scans())
    checks = [verify.verified(each, config, maps) for each in made]
    made, _ = taken("bolt", plan.bolt_scans())
    bolts = [pitch_mm(*verify.measured(each, config, maps)) for each in made]
    pan = plan.bust_scan()
    histogram = np.zeros(len(_BINS_MM) - 1, np.int64)
    points, square = 0, 0.0
    some: list[list[float]] = []
    with bar("bust, blocks", -(-pan.frames // BLOCK)) as progress:
        for done, sums in plan.pan(config, maps):
            points += sums.points
            square += sums.square
            some.extend(sums.drawn)
            histogram += np.array(sums.histogram, np.int64)
            progress(done)
    with atomic_file(folder / "bust.npz") as file:
        np.savez_compressed(file, points_mm=np.array(some).reshape(-1, 3))
    drifted = drift(plan, config)
    true = plan.instrument.true(plan.belief, RELIEF_FOCUS_MM)
    near, far = checks[0], checks[-1]
    share = plan.belief.line.rate_hz / plan.belief.mirror.frequency_hz / plan.frames
    found: dict[str, object] = {
        "coarse_mean_mm": first.mean_mm,
        "plane_percent": max(each.plane_percent for each in checks),
        "points_percent_rms": max(each.points_percent for each in checks),
        "drift_urad": max(each["view_urad"] for each in drifted),
        "pitch_mm": float(np.mean(bolts)),
        "bust_points": points,
        "index_mrad": 1e3 * abs(math.radians(config.mirror.index_deg - true.mirror.index_deg)),
        "coarse": {
            "start_mm": first.start_mm,
            "points_mm": first.point_mm,
            "least_squares_seconds": first.fit.seconds,
            "least_squares_calls": first.fit.calls,
            "simplex_mean_mm": first.simplex_mean_mm,
            "simplex_seconds": first.simplex_seconds,
            "simplex_calls": first.simplex_calls,
            "parameters": _scored(first, true),
        },
        "mirror": {"before_mm": second.before_mm, "after_mm": second.after_mm},
        "map": {
            "foci_mm": plan.foci_mm,
            "largest_px": np.abs(maps.corrections_px).max(axis=(1, 2)).tolist(),
            "filled": maps.filled.mean(axis=(1, 2)).tolist(),
            "residual_px": maps.residual_px.tolist(),
        },
        "planes": [asdict(each) for each in checks],
        "drift": drifted,
        "pitches_mm": bolts,
        "bust": {
            "lines": pan.frames,
            "bins_mm": list(_BINS_MM),
            "histogram": histogram.tolist(),
            "rms_mm": math.sqrt(square / max(1, int(histogram.sum()))),
        },
        "width_near_mm": near.width_mm,
        "width_far_mm": far.width_mm,
        "lines_in_view": [each.count * share for each in checks],
        "seed": plan.seed,
        "frames": plan.frames,
        "engine": str(plan.engine),
        "provenance": results.provenance(
            folder / name for name in ("coarse.toml", "mirror.toml", "calibrated.toml", "map.npz")
        ),
    }
    with atomic_file(folder / "results.json") as file:
        file.write(json.dumps(found, indent=1).encode())
    return found


def _scored(first: coarse.Coarse, true: Config) -> list[dict[str, object]]:
    """Return each parameter of step 1 with its truth, which nothing but this table uses."""
    right = [each.start for each in coarse.parameters(true)]
    return [
        {
            "name": each.name,
            "unit": each.unit,
            "start": each.start,
            "true": wanted,
            "found": float(value),
            "sigma": float(sigma),
            "observed": bool(seen),
            "simplex": float(other),
        }
        for each, wanted, value, sigma, seen, other in zip(
            first.fit.parameters[: len(right)],
            right,
            first.fit.values[: len(right)],
            first.fit.sigma[: len(right)],
            first.fit.observed[: len(right)],
            first.simplex_values,
            strict=True,
        )
    ]


def drift(plan: Experiment, config: Config) -> list[dict[str, float]]:
    """Return the error of the angle at operating points of which the calibration knows nothing.

    A drift of the natural frequency by 0.2 Hz changes the amplitude of a free mirror by 20 %; the
    loop follows it and comes to rest somewhere in its band of levels.

    Args:
        plan: The experiment, whose truth this is compared with.
        config: The calibrated configuration.
    """
    found = []
    count = 3002
    for point in operating_points(plan.instrument, plan.belief, DRIFTED_LEVELS):
        own = at(plan.instrument, point)
        scan = Description.model_fields["scan"].default
        lines = timeline(0, count, count, config, scan, plan.seed, own)
        error = 1e6 * (lines.reported_rad - lines.angle_rad)
        view = np.abs(lines.angle_rad) < math.radians(13.0)  # as the camera sees of a scan
        found.append(
            {
                "level": point.level,
                "frequency_hz": point.frequency_hz,
                "natural_hz": mirror_map.natural_hz(config, point.frequency_hz, point.drive_phase),
                "view_urad": rms(error[view]),
                "whole_urad": rms(error),
            }
        )
    return found
