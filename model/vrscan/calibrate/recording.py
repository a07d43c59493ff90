"""A calibration scan: what the chain gave of a known surface, and when the index was crossed.

Nothing here is known of the light: positions, their standard deviations and flags come from the
chain's points, the crossings from the index, and the surface from whoever put it there.
"""

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np
from pydantic import Field

from vrscan.data import edges, recordings
from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config, Positive, Section, checked
from vrscan.data.errors import InputError, reading
from vrscan.data.table import Table
from vrscan.ideal.geometry import triangle, undistorted
from vrscan.ideal.motion import Harmonics, crossings
from vrscan.scene.timeline import series

# A point with one of these flags does not take part: its place is not that of one whole spot.
LEFT_OUT = ("AT_EDGE", "SATURATED", "RIVAL", "MIXED", "NOT_RUNNING", "INDEX_FAULT", "UNSETTLED")
# So near to the sensor's end a spot lacks a part of its flank, and its position is biased.
EDGE_PX = 16.0
LEAST_POINTS = 200
PLACES = 1501  # of a mirror's period; the paper's 150.1 lines a period come back to as many
LEAST_PAIRS = 2
_SETUP = "setup"  # what a recording calls the note of the setup
_COLUMNS = ("line", "time_s", "position_px", "sigma_px", "angle_rad", "x_mm", "z_mm")


class Setup(Section):
    """What stood before the scanner in a scan, and how the scanner was set."""

    kind: Literal["plane", "relief", "other"]  # "other" is no surface to calibrate with
    z_mm: Positive  # distance of the surface's middle from the mirror
    amplitude_mm: float = Field(default=0.0, ge=0)  # of the relief's sine over x
    period_mm: Positive = 40.0
    focus_mm: Positive  # depth that the lens is focused at
    frequency_hz: Positive  # of the mirror; it is that of the drive, which is known exactly
    facets: int = Field(default=0, ge=0)  # of a polygon, whose own edges tell its speed
    drive_phase: float | None = None  # turns, that the mirror's loop measured

    def z(self, x_mm: Floats) -> Floats:
        """Return the surface's z at x, mm, of the shape of ``x_mm``."""
        return self.z_mm + self.amplitude_mm * self.wave(x_mm)

    def wave(self, x_mm: Floats) -> Floats:
        """Return the relief's sine at x, of an amplitude of 1."""
        return np.asarray(np.sin(2.0 * np.pi * x_mm / self.period_mm))


@dataclass(frozen=True)
class Recording:
    """n good points of a scan, and its m pairs of crossings of the index mark.

    Those of a polygon are the beginnings and ends of the diode's pulses.
    """

    name: str  # for messages
    setup: Setup
    line: Floats  # number of the line [n]
    time_s: Floats  # time of the laser pulse's centre [n]
    position_px: Floats  # position of the spot on the sensor [n]
    sigma_px: Floats  # its standard deviation [n]
    angle_rad: Floats  # angle that the chain reported [n]
    x_mm: Floats  # point that the chain gave [n]
    z_mm: Floats
    out_s: Floats  # times of the crossings away from zero [m]
    in_s: Floats  # times of those that follow them, towards zero [m]

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.time_s)

    @property
    def half(self) -> float:
        """Return half of the mean time between two crossings, turns."""
        return float(0.5 * self.setup.frequency_hz * np.mean(self.in_s - self.out_s))

    @cached_property
    def phase(self) -> Floats:
        """Return the phase of each point from the middle of the crossings, turns [n].

        The middle is the mean of all pairs, so the jitter of a crossing is averaged away. Of a
        polygon it is the middle of the last pulse, which tells that facet's error.
        """
        if self.setup.facets:
            return self._facet_phase()
        frequency = self.setup.frequency_hz
        middle = 0.5 * frequency * (self.out_s + self.in_s)
        first = middle[0]
        away = np.mean((middle - first + 0.5) % 1.0 - 0.5)
        return np.asarray(frequency * self.time_s - first - away)

    def _facet_phase(self) -> Floats:
        """Return the share of a facet that has gone by since the last pulse's middle [n].

        The speed is that of the whole turns around the pulse, in which no facet's error is.
        """
        starts = 0.5 * (self.out_s + self.in_s)
        steps = np.diff(starts)
        number = np.append(0.0, np.cumsum(np.round(steps / np.median(steps))))  # some are lost
        turn = min(self.setup.facets, len(starts) - 1)
        newest = np.maximum(np.searchsorted(starts, self.time_s, side="right") - 1, 0)
        begin = np.clip(newest - turn // 2, 0, len(starts) - 1 - turn)
        speed = (number[begin + turn] - number[begin]) / (starts[begin + turn] - starts[begin])
        return np.asarray(speed * (self.time_s - starts[newest]))

    def of(self, rows: Bools | slice) -> "Recording":
        """Return some of the points, with all crossings."""
        return replace(
            self,
            **{name: getattr(self, name)[rows] for name in _COLUMNS},
        )

    def thinned(self, most: int) -> "Recording":
        """Return at most so many points, evenly over the scan."""
        return self.of(slice(None, None, -(-len(self) // most)))

    def overlaid(self, values: Floats) -> Floats:
        """Return the means of a value of each point over the places of the period that have any."""
        place, count = self._places()
        return np.asarray((np.bincount(place, values, PLACES) / np.maximum(count, 1))[count > 0])

    def folded(self) -> "Recording":
        """Return the means of the points at each place of the period, in place of the points.

        Their standard deviations are those of the means. Places of which the scan has less than
        half of the usual number of points are left out. The points of a polygon stay as they are:
        each facet has an error of its own, and no place comes again with the next one.
        """
        if self.setup.facets:
            return self
        _, count = self._places()
        count = count[count > 0]
        kept = 2 * count >= np.median(count)
        means: dict[str, Any] = {
            name: self.overlaid(getattr(self, name))[kept] for name in _COLUMNS
        }
        means["sigma_px"] /= np.sqrt(count[kept])
        made = replace(self, **means)
        made.__dict__["phase"] = self.overlaid(self.phase % 1.0)[kept]
        return made

    def _places(self) -> tuple[Ints, Ints]:
        """Return the place of each point in the mirror's period, and the points of each place."""
        place = np.floor(self.phase % 1.0 * PLACES).astype(np.int64)
        return place, np.bincount(place, minlength=PLACES)


def angles(
    recording: Recording, mark_rad: float, harmonics: Harmonics, moved: Floats | None = None
) -> Floats:
    """Return the scan angle of each point, (12), from the index alone, rad [n].

    Amplitude and phase come from the crossings and ``harmonics``, as the instrument's table gives
    them; where the drive is elsewhere, the motion is that of ``harmonics + moved``, as
    ``motion_map`` has it. The angle of a polygon is a straight line from the mark on.

    Args:
        recording: The scan.
        mark_rad: Angle of the index mark.
        harmonics: Pairs [a_k, phi_k], rad.
        moved: Their change by the drive's phase, or None.
    """
    if recording.setup.facets:
        facet = 4.0 * math.pi / recording.setup.facets
        # From a mark behind the scan on it is the phase of the next facet.
        phase = 0.5 - mark_rad / facet + recording.phase
        return np.asarray(facet * (0.5 - phase % 1.0))
    size, middle = crossings(np.array([recording.half]), mark_rad, harmonics)
    rows = np.asarray(harmonics, np.float64)
    if moved is not None:
        rows = rows + moved
    shape, _ = series(recording.phase + middle[0], rows.tolist())
    return np.asarray(float(size[0]) * shape)


def located(recording: Recording, config: Config, angle_rad: Floats) -> tuple[Floats, Floats]:
    """Return x and z of each point, mm [n], by (3) to (5).

    Args:
        recording: The scan.
        config: The configuration, whose geometry is used.
        angle_rad: Scan angle of each point [n].
    """
    u, _ = undistorted(recording.position_px, config.geometry)
    found = triangle(u, angle_rad, config.geometry)
    return found.x, found.z


def px_per_mm(recording: Recording, config: Config) -> Floats:
    """Return how far the spot moves on the sensor for a step in z along the beam, px/mm [n]."""
    u, step = undistorted(recording.position_px, config.geometry)
    slope = triangle(u, recording.angle_rad, config.geometry).slope * step
    return np.asarray(1.0 / np.where(slope == 0.0, np.inf, np.abs(slope)))


def recorded(
    name: str,
    setup: Setup,
    points: Table,
    time_s: Floats,
    out_s: Floats,
    in_s: Floats,
    length_px: int,
) -> Recording:
    """Return the good points of a scan.

    Args:
        name: Name for messages.
        setup: What stood there.
        points: The chain's points, one a line.
        time_s: Time of each line's laser pulse, of the same clock as the crossings [len(points)].
        out_s: Times of the index's crossings away from zero [m].
        in_s: Times of those that follow them [m].
        length_px: Length of a line; points within 16 px of its ends are left out.

    Raises:
        InputError: if there are too few points or crossings.
    """
    good = points.located & np.isfinite(time_s)
    for flag in LEFT_OUT:
        good &= ~points.flags[flag]
    end = length_px - 1.0 - EDGE_PX
    good &= (points.position_px >= EDGE_PX) & (points.position_px <= end)
    if good.sum() < LEAST_POINTS:
        raise InputError(f"{name}: {good.sum()} good points of {len(points)} lines, needs 200")
    if len(out_s) < LEAST_PAIRS:
        raise InputError(f"{name}: {len(out_s)} pairs of index crossings, needs {LEAST_PAIRS}")
    return Recording(
        name=name,
        setup=setup,
        line=points.line[good].astype(np.float64),
        time_s=time_s[good],
        position_px=points.position_px[good],
        sigma_px=points.sigma_px[good],
        angle_rad=points.angle_rad[good],
        x_mm=points.x_mm[good],
        z_mm=points.z_mm[good],
        out_s=out_s,
        in_s=in_s,
    )


def from_file(
    source: Path,
    config: Config,
    edges_file: Path | None = None,
    columns: Mapping[str, str] | None = None,
) -> tuple[Table, tuple[Floats, Ints, Ints]]:
    """Return the points of a scan and its index edges, as ``edges.read`` does, by one clock.

    Args:
        source: A folder with points.csv and edges.csv, as ``vrscan scan`` leaves it, or a recording
            of both; with ``edges_file`` points.csv or a recording of points will do.
        config: The configuration, for the lines' timing.
        edges_file: Edges of another recorder, whose time begins with line 0; line k's pulse is
            centred at k / rate + delay + pulse / 2 after that.
        columns: Names of the columns of a table of edges, as those of ``edges.read``.

    Raises:
        InputError: naming the file, if one is missing or not of this form.
    """
    own = edges_file is None
    if source.is_dir():
        edges_file = edges_file or source / "edges.csv"
        source /= "points.csv"
    points = recordings.read_points(source)
    if edges_file is None:
        return points, recordings.read_edges(source, columns)
    found = recordings.read_edges(edges_file, columns)
    if own and config.mirror.polygon:  # the simulated scan has no number for a dark line
        return points, found
    timing = config.line
    delay_s = 1e-6 * (timing.pulse_delay_us + 0.5 * timing.pulse_us)
    points = replace(points, time_s=points.line / timing.rate_hz + delay_s)
    return points, found


def record(
    name: str,
    setup: Setup,
    points: Table,
    found: tuple[Floats, Ints, Ints],
    config: Config,
    file: BinaryIO,
) -> Recording:
    """Write a scan as a recording, with its setup, and return it.

    Args:
        name: Name for messages.
        setup: What stood there.
        points: The chain's points, with their times.
        found: Edges of the index, by the same clock.
        config: The configuration that made the points.
        file: A binary file.

    Raises:
        InputError: as ``recorded``.
    """
    out_s, in_s = edges.pairs(*found)
    length = config.sensor.line_length
    made = recorded(name, setup, points, points.time_s, out_s, in_s, length)
    with recordings.Writer(file, config) as into:
        into.points(points)
        into.edges(*found)
        into.note(_SETUP, {"json": setup.model_dump_json()})
    return made


def write(recording: Recording, file: BinaryIO) -> None:
    """Write the good points and crossings of a scan as .npz, and its setup as JSON."""
    arrays = {
        each.name: getattr(recording, each.name)
        for each in fields(Recording)
        if each.name not in ("name", "setup")
    }
    np.savez_compressed(file, setup=np.array(recording.setup.model_dump_json()), **arrays)


def read(path: Path) -> Recording:
    """Return a scan from its file.

    Raises:
        InputError: naming the file, if it is missing or is not one that ``record`` or ``write``
            made.
    """
    import json

    if recordings.is_recording(path):
        held = recordings.told(recordings.read(path))
        if _SETUP not in held.notes:
            raise InputError(
                f"{path}: no calibration scan; vrscan calibrate record makes one of it"
            )
        with reading(path, "its setup is damaged"):
            values = json.loads(held.notes[_SETUP]["json"])
        setup = checked(Setup, values, str(path))
        points, length = held.points, held.config.sensor.line_length
        crossings_s = edges.pairs(*held.edges)
        return recorded(path.stem, setup, points, points.time_s, *crossings_s, length)
    names = [each.name for each in fields(Recording) if each.name not in ("name", "setup")]
    arrays: dict[str, Floats] = {}
    with reading(path, "not a calibration scan"), np.load(path, allow_pickle=False) as file:
        setup = checked(Setup, json.loads(str(file["setup"])), str(path))
        with contextlib.suppress(TypeError):
            arrays = {name: np.asarray(file[name], np.float64) for name in names}
    sizes = {arrays[name].shape for name in names[:-2]} if arrays else set()
    if len(sizes) != 1 or arrays["out_s"].shape != arrays["in_s"].shape:
        raise InputError(f"{path}: its arrays have different lengths")
    if not all(np.isfinite(each).all() for each in arrays.values()):
        raise InputError(f"{path}: a value is not a finite number")
    return Recording(path.stem, setup, **arrays)
