"""When each line is exposed, where the beam points then, and where the instrument thinks it points.

The mirror moves according to VR-SCAN (12), a = A sum a_k cos(k p - phi_k), with a slow drift of A
and of its phase. Twice a period the beam passes the index mark; the instrument knows these two
times, with jitter, and computes amplitude and phase from them (VR-SCAN IV-D), so jitter and drift
become errors of the angle that it reports. Every value depends only on the absolute number of its
line or period: a scan may be made in blocks of any size, in any order and on any number of
processes.

The model leaves out the start of the mirror and the loop that holds its amplitude, whose drive is
perfect here but for the stated drift; harmonics that change with the drive; the sampling of the
index (2 ns where the inputs are sampled at 500 MHz), chatter and lost crossings; a line clock that
is not exact; tilt and yaw of a panning scanner, and its unsteady speed. The instrument's tracker
weighs old periods exponentially and follows a frequency that is off; the model takes the plain mean
of the last periods at the nominal frequency.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import BinaryIO, Literal

import numpy as np
from pydantic import Field

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import HARMONICS, Config, Mirror, Section
from vrscan.data.edges import COLUMNS
from vrscan.data.errors import InputError
from vrscan.ideal.motion import crossings
from vrscan.scene.index_diode import IndexDiode
from vrscan.scene.polygon import Turning, lit, reported
from vrscan.scene.tolerances import Instrument, believed

PERIODS = 64  # periods that are computed and kept together
_STREAM = 0x1DE8  # separates these random numbers from others of the same seed
_NEWTON = 12
_TURN = 2.0 * math.pi


class Scan(Section):
    """The TOML section ``[scan]``: how the beam moves over the scene."""

    sweep: Literal["mirror", "even"] = "mirror"  # even: equal steps of a known angle, one way
    half_angle_deg: float = Field(default=12.5, gt=0, lt=80)  # half angle of the even sweep
    pan_mm_per_s: float = Field(default=0.0, ge=-1e4, le=1e4)  # speed of the scanner along y
    drift_ppm_per_s: float = Field(default=0.0, ge=-1e4, le=1e4)  # drift of the amplitude since 0
    phase_drift_urad_per_s: float = Field(default=0.0, ge=-1e6, le=1e6)  # since time 0
    jitter_ns: float | None = Field(
        default=None, ge=0, le=1e5
    )  # rms jitter of a crossing; by default mems.jitter_ns
    start_s: float = Field(default=0.0, ge=0, le=1e4)  # time when line 0 begins


@dataclass(frozen=True)
class Timeline:
    """n lines of a scan, and the m crossings of the index mark while they are taken."""

    line: Ints  # absolute number of the line [n]
    time_s: Floats  # time of the centre of the laser pulse [n]
    angle_rad: Floats  # true optical scan angle [n]
    rate_rad_per_s: Floats  # derivative of the angle [n]
    y_mm: Floats  # position of the scanner along y [n]
    reported_rad: Floats  # angle that the instrument reports [n]
    index_s: Floats  # times of the crossings, with jitter [m]
    index_outward: Bools  # whether they lead away from zero [m]

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.line)

    @classmethod
    def joined(cls, parts: Sequence["Timeline"]) -> "Timeline":
        """Return one timeline of all of ``parts``, at least one, in their order."""
        return cls(
            **{
                field.name: np.concatenate([getattr(part, field.name) for part in parts])
                for field in fields(cls)
            }
        )


@dataclass(frozen=True)
class _Motion:
    """The true motion: (12) with an amplitude and a phase that drift linearly."""

    frequency_hz: float
    amplitude_rad: float  # amplitude at time 0
    mark_rad: float
    harmonics: tuple[tuple[float, float], ...]
    drift: float  # relative drift of the amplitude, 1/s
    phase_drift: float  # turns/s
    jitter_s: float
    averaging: int  # number of periods that are averaged
    believed_mark_rad: float  # what the instrument computes with
    believed_harmonics: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, config: Config, scan: Scan, instrument: Instrument | None = None) -> "_Motion":
        mirror = config.mirror
        jitter_ns = config.mems.jitter_ns if scan.jitter_ns is None else scan.jitter_ns
        own = Instrument() if instrument is None else instrument
        known = believed(mirror, own.drive_phase)
        true = own.moving(mirror, scan.start_s)
        return cls(
            frequency_hz=mirror.frequency_hz,
            amplitude_rad=math.radians(true.amplitude_deg),
            mark_rad=math.radians(true.index_deg),
            harmonics=_pairs(true),
            believed_mark_rad=math.radians(known.index_deg),
            believed_harmonics=_pairs(known),
            drift=1e-6 * scan.drift_ppm_per_s,
            phase_drift=1e-6 * scan.phase_drift_urad_per_s / _TURN,
            jitter_s=1e-9 * jitter_ns,
            averaging=mirror.averaging_periods,
        )

    def at(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return angle, rad, and rate, rad/s, at times of any shape."""
        phase = self.frequency_hz * time_s + self.phase_drift * time_s
        amplitude = self.amplitude_rad * (1.0 + self.drift * time_s)
        shape, slope = series(phase, self.harmonics)
        turns = self.frequency_hz + self.phase_drift
        rate = amplitude * slope * turns + self.amplitude_rad * self.drift * shape
        return amplitude * shape, rate


def _pairs(mirror: Mirror) -> tuple[tuple[float, float], ...]:
    return tuple((pair[0], pair[1]) for pair in mirror.harmonics)


def series(phase: Floats, harmonics: Sequence[Sequence[float]]) -> tuple[Floats, Floats]:
    """Return S(p) = sum a_k cos(k p - phi_k) of (12) and dS/dp.

    Only sums and products of elements are used, no matrix product: the result for one phase is the
    same to the last bit whatever array it is in.

    Args:
        phase: Phase p, turns, any shape.
        harmonics: Pairs [a_k, phi_k], rad, for k = 1, 3 ..

    Returns:
        S, dimensionless, and its derivative, 1/turn, both of the shape of ``phase``.
    """
    angle = _TURN * (phase % 1.0)
    cosine, sine = np.cos(angle), np.sin(angle)
    twice = 2.0 * (cosine - sine) * (cosine + sine)  # 2 cos 2p: cos (k+2)p from kp and (k-2)p
    before_c, before_s = cosine, -sine  # k = -1
    value, slope = np.zeros_like(angle), np.zeros_like(angle)
    for k, (a, phi) in zip(HARMONICS, harmonics, strict=False):
        if a != 0.0:
            along, across = a * math.cos(phi), a * math.sin(phi)
            value += along * cosine + across * sine
            slope += (_TURN * k) * (across * cosine - along * sine)
        before_c, cosine = cosine, twice * cosine - before_c
        before_s, sine = sine, twice * sine - before_s
    return value, slope


def _passes(motion: _Motion, period: Floats, level_rad: float) -> Floats:
    """Return the times at which the beam passes an angle around turning points, s.

    They are [periods, 2]: out and in.

    Raises:
        InputError: if the mirror does not reach the angle.
    """
    turning = period + (0.5 if level_rad < 0.0 else 0.0)
    frequency = motion.frequency_hz + motion.phase_drift
    amplitude = motion.amplitude_rad * (1.0 + motion.drift * turning / frequency)
    share = abs(level_rad) / np.maximum(amplitude, 1e-12)
    half = np.arccos(np.minimum(share, 1.0)) / _TURN
    time = (turning[:, None] + half[:, None] * np.array([-1.0, 1.0])) / frequency
    # Newton's method stays on the flank where it begins unless there is no crossing at all.
    for _ in range(_NEWTON):
        angle, rate = motion.at(time)
        stuck = np.abs(rate) < 1e-9 * motion.amplitude_rad * frequency
        time = time - np.where(stuck, 0.0, (angle - level_rad) / np.where(stuck, 1.0, rate))
    angle, _ = motion.at(time)
    apart = time[:, 1] - time[:, 0]
    flank = (apart > 0) & (2 * apart * frequency < 1)
    lost = (np.abs(angle - level_rad) > 1e-9).any(axis=1) | ~flank
    if lost.any():
        raise InputError(
            f"mirror.index_deg: the mirror does not reach {math.degrees(level_rad):g} degrees "
            f"in its period {int(period[lost][0])}"
        )
    return np.asarray(time)


def _noise(seed: int, block: int) -> Floats:
    """Return normal numbers of variance 1 for a block of periods' crossings, [PERIODS, 2]."""
    number = 2 * block if block >= 0 else -2 * block - 1  # entropy must not be negative
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence((seed, _STREAM, number))))
    return np.asarray(rng.standard_normal((PERIODS, 2)))


@lru_cache(maxsize=64)
def _block(motion: _Motion, seed: int, block: int) -> tuple[Floats, Floats, Floats]:
    """Return a block of periods' crossings, s, [PERIODS, 2], and what the index gives [PERIODS].

    The index gives the amplitude, rad, and the phase against frequency times time, turns.
    """
    period = np.arange(block * PERIODS, (block + 1) * PERIODS, dtype=np.float64)
    time = _passes(motion, period, motion.mark_rad) + motion.jitter_s * _noise(seed, block)
    half = 0.5 * motion.frequency_hz * (time[:, 1] - time[:, 0])
    try:
        amplitude, middle = crossings(
            np.clip(half, 0.0, 0.25), motion.believed_mark_rad, motion.believed_harmonics
        )
    except ValueError as error:
        raise InputError(f"mirror.harmonics, mirror.index_deg: {error}") from error
    phase = middle + period - 0.5 * motion.frequency_hz * (time[:, 0] + time[:, 1])
    return time, amplitude, phase


def _periods(motion: _Motion, seed: int, first: int, last: int) -> tuple[Floats, Floats, Floats]:
    """Return what ``_block`` returns for the periods ``first`` to ``last``, both included."""
    begin = first // PERIODS
    blocks = [_block(motion, seed, k) for k in range(begin, last // PERIODS + 1)]
    rows = slice(first - begin * PERIODS, last - begin * PERIODS + 1)
    time, amplitude, phase = (np.concatenate(column)[rows] for column in zip(*blocks, strict=True))
    return time, amplitude, phase


def timeline(
    first: int,
    count: int,
    total: int,
    config: Config,
    scan: Scan,
    seed: int,
    instrument: Instrument | None = None,
) -> Timeline:
    """Return lines ``first`` to ``first + count - 1`` of a scan of ``total`` lines.

    Line k begins at t = start_s + k / rate; its pulse's centre comes pulse_delay + pulse / 2 later.
    The reported angle is that of the mean amplitude and the mean phase of the last
    ``mirror.averaging_periods`` pairs of crossings that were complete at the pulse's centre; the
    mirror has been running for longer than that when the scan begins. The crossings given are those
    from the beginning of the first line to that of the line after the last.

    In an even sweep the angle goes from minus to plus the half angle in equal steps, the reported
    one is the true one, and there is no index.

    Args:
        first: Number of the first line, from 0.
        count: Number of lines, 0 or more.
        total: Number of lines of the whole scan, at least ``first + count``.
        config: Line timing, mirror and, unless the scan gives one, the jitter.
        scan: The motion of the beam.
        seed: Seed of the jitter, not negative.
        instrument: Mirror and index mark as they are; None where the configuration is right.

    Returns:
        Arrays [count]; the same lines in other blocks are the same to the last bit.

    Raises:
        InputError: if the mirror does not reach its index mark.
        ValueError: if the lines are not among the ``total``, or the seed is negative.
    """
    if first < 0 or count < 0 or first + count > total or seed < 0:
        raise ValueError(f"timeline: lines {first} + {count} of {total}, seed {seed}")
    line = np.arange(first, first + count, dtype=np.int64)
    timing = config.line
    since: Floats = line / timing.rate_hz + 1e-6 * (timing.pulse_delay_us + 0.5 * timing.pulse_us)
    time = scan.start_s + since
    y = scan.pan_mm_per_s * since
    if scan.sweep == "even" or count == 0:
        half = math.radians(scan.half_angle_deg)
        step = 2.0 * half / (total - 1) if total > 1 else 0.0
        angle = np.asarray(-half + line * step)
        rate = np.full(count, step * timing.rate_hz)
        none = np.empty(0)
        return Timeline(line, time, angle, rate, y, angle.copy(), none, none.astype(np.bool_))

    if config.mirror.polygon:
        return _turning(line, total, config, scan, seed, instrument)
    motion = _Motion.of(config, scan, instrument)
    angle, rate = motion.at(time)
    begin = scan.start_s + first / timing.rate_hz
    end = scan.start_s + (first + count) / timing.rate_hz
    frequency = motion.frequency_hz + motion.phase_drift
    # A turning point is at most half a turn from either crossing, and its number at most a turn
    # from its time.
    lowest = math.floor(begin * frequency) - 2
    highest = math.ceil(end * frequency) + 2
    averaging = motion.averaging
    crossing, amplitudes, phases = _periods(motion, seed, lowest - averaging + 1, highest)
    kept = len(amplitudes) - averaging + 1
    # Sums in a fixed order: a running sum would depend on where the block begins.
    amplitude, phase = np.zeros(kept), np.zeros(kept)
    for k in range(averaging):
        amplitude += amplitudes[k : k + kept] / averaging
        phase += phases[k : k + kept] / averaging
    newest = np.searchsorted(crossing[averaging - 1 :, 1], time, side="right") - 1
    shape, _ = series(motion.frequency_hz * time + phase[newest], motion.believed_harmonics)
    flat = crossing.ravel()
    inside = (flat >= begin) & (flat < end)
    outward = np.tile([True, False], len(crossing))
    return Timeline(
        line=line,
        time_s=time,
        angle_rad=angle,
        rate_rad_per_s=rate,
        y_mm=y,
        reported_rad=amplitude[newest] * shape,
        index_s=flat[inside],
        index_outward=outward[inside],
    )


def _polygon(config: Config, scan: Scan, seed: int, instrument: Instrument | None) -> Turning:
    """Return the polygon with its diode where it is."""
    mark_deg = (instrument or Instrument()).moving(config.mirror, scan.start_s).index_deg
    return replace(Turning.of(config, seed, scan.jitter_ns), mark_rad=math.radians(mark_deg))


def _turning(
    line: Ints,
    total: int,
    config: Config,
    scan: Scan,
    seed: int,
    instrument: Instrument | None,
) -> Timeline:
    """Return lines of a scan with a polygon: those that have light, numbered without a gap.

    The time between a line and the next one that has light, dark lines and all, is the first one's.
    """
    timing = config.line
    lighted = lit(config, scan.start_s, total)
    begin = lighted[line] / timing.rate_hz
    after = line[-1] + 1
    end = (lighted[after] if after < total else lighted[-1] + 1) / timing.rate_hz
    since = begin + 1e-6 * (timing.pulse_delay_us + 0.5 * timing.pulse_us)
    time = scan.start_s + since
    turning = _polygon(config, scan, seed, instrument)
    angle, rate = turning.at(time)
    told, starts = reported(config, turning, time)
    inside = (starts >= scan.start_s + begin[0]) & (starts < scan.start_s + end)
    return Timeline(
        line=line,
        time_s=time,
        angle_rad=angle,
        rate_rad_per_s=rate,
        y_mm=scan.pan_mm_per_s * since,
        reported_rad=told,
        index_s=starts[inside],
        index_outward=np.ones(int(inside.sum()), np.bool_),
    )


def write_edges(
    file: BinaryIO,
    begin_s: float,
    end_s: float,
    config: Config,
    scan: Scan,
    seed: int,
    instrument: Instrument | None = None,
) -> int:
    """Write the index as a recording that ``vrscan.data.edges.read`` reads: EDGES.csv.

    The gate is open where ``IndexDiode`` sees the beam of ``laser.startup_mw``, the comparator high
    beyond the mark; a whole pass over the diode has one jitter. The crossings are those of
    ``Timeline.index_s``. Only turns that lie wholly inside the time are written, to 1 ps. A
    polygon's gate is always open, and its comparator high where its diode sees the beam.

    Args:
        file: A binary file.
        begin_s: Start of the recording, not negative.
        end_s: End of the recording.
        config: The configuration, whose mirror and photodiode are used.
        scan: A scan with the sweep ``mirror``.
        seed: Seed of the jitter, as in ``timeline``.
        instrument: As in ``timeline``.

    Returns:
        Number of pairs of crossings.

    Raises:
        InputError: if the sweep has no index or the mirror does not reach it.
        ValueError: if ``begin_s`` is negative.
    """
    if begin_s < 0.0:
        raise ValueError(f"write_edges: begin_s {begin_s} is negative")
    if scan.sweep == "even":
        raise InputError("scan.sweep: an even sweep has no index")
    seen = IndexDiode.of(config).settled_half_width_rad(config.laser.startup_mw)
    if not 0.0 < seen < math.inf:
        dark = "is always above" if seen else "is never above"
        raise InputError(
            f"mems, laser.startup_mw: the light on the photodiode {dark} its threshold"
        )
    if config.mirror.polygon:
        turning = _polygon(config, scan, seed, instrument)
        first, last = (math.floor(turning.frequency_hz * at) for at in (begin_s, end_s))
        starts = turning.starts(first - 1, last - first + 3)
        half = seen / (turning.facet_rad * turning.frequency_hz)
        starts = starts[(starts - half >= begin_s) & (starts + half < end_s)]
        pulses = [f"{begin_s:.12f},0,1\n"]
        pulses += [f"{at - half:.12f},1,1\n{at + half:.12f},0,1\n" for at in starts.tolist()]
        file.write("".join([f"{','.join(COLUMNS)}\n", *pulses]).encode("ascii"))
        return len(starts)
    motion = _Motion.of(config, scan, instrument)
    frequency = motion.frequency_hz + motion.phase_drift
    width = math.copysign(seen, motion.mark_rad)
    inner = motion.mark_rad - width
    if inner * motion.mark_rad <= 0.0:
        raise InputError("mems.diode_deg: the photodiode reaches to angle 0")
    least = motion.amplitude_rad * min(1.0 + motion.drift * begin_s, 1.0 + motion.drift * end_s)
    highest = least * float(np.abs(series(np.arange(4096) / 4096, motion.harmonics)[0]).max())
    leaves = abs(motion.mark_rad + width) < 0.9999 * highest  # otherwise it turns on the diode
    file.write(f"{','.join(COLUMNS)}\n".encode("ascii"))
    first, last = math.floor(begin_s * frequency) - 2, math.ceil(end_s * frequency) + 2
    pairs = 0
    for start in range(first, last + 1, PERIODS):
        stop = min(start + PERIODS, last + 1)
        period = np.arange(start, stop, dtype=np.float64)
        crossing, _, _ = _periods(motion, seed, start, stop - 1)
        shift = crossing - _passes(motion, period, motion.mark_rad)
        near = _passes(motion, period, inner) + shift
        rows: list[tuple[Floats, int, int]] = [
            (near[:, 0], 0, 1),
            (crossing[:, 0], 1, 1),
            (crossing[:, 1], 0, 1),
            (near[:, 1], 0, 0),
        ]
        if leaves:
            far = _passes(motion, period, motion.mark_rad + width) + shift
            rows[2:2] = [(far[:, 0], 1, 0), (far[:, 1], 1, 1)]
        whole = (near[:, 0] >= begin_s) & (near[:, 1] < end_s)
        time = np.stack([row[0] for row in rows], axis=1)[whole]
        levels = [f"{comparator},{gate}" for _, comparator, gate in rows]
        for turn in time.tolist():
            text = [f"{at:.12f},{level}\n" for at, level in zip(turn, levels, strict=True)]
            file.write("".join(text).encode("ascii"))
        pairs += int(whole.sum())
    return pairs
