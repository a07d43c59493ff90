"""A run of the mirror's loop compared with the truth: mirror.csv, its summary, its picture."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from matplotlib.axes import Axes
from rich.table import Table as RichTable

from vrscan.calibrate.motion_fit import NOMINAL_LEVEL
from vrscan.data import edges, pkg, recordings, residuals
from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import HARMONICS, Config
from vrscan.data.edges import SAMPLES, Rows
from vrscan.engines.mirror_engine import (
    CHUNK_S,
    FAULTS,
    FLAG_NAMES,
    STATES,
    Mirror,
    Recording,
    World,
)
from vrscan.ideal.motion import crossings, half_turn_residual
from vrscan.ideal.natural_frequency import natural_frequency, resting_point
from vrscan.registers.mirror_registers import MirrorRegisters
from vrscan.show.sheet import Sheet, listed
from vrscan.show.style import COLOURS, INK, LIGHT, QUIET, drawing
from vrscan.study.progress import Progress

_FORMS = {
    "line": "{:.0f}", "time_s": "{:.10f}", "state": "", "angle_true_rad": "{:.10f}",
    "angle_rad": "{:.9f}", "amplitude_true_rad": "{:.10f}", "amplitude_rad": "{:.10f}",
    "frequency_hz": "{:.7f}", "natural_hz": "{:.5f}", "drive_level": "{:.7f}", "flags": "",
}  # fmt: skip
COLUMNS = ",".join(_FORMS)
START_S = 0.3  # what the start takes besides its sweep, about
EVENT_S = 0.1  # after RUN: when drift, shock and drops come
BACK_PPM = 100.0  # of the amplitude: closer is back
STEADY_S = 0.05  # after an event that is over: what is judged begins
_TURN = 2.0 * math.pi
_PER_TURN = _TURN / 2.0**pkg.ANGLE_WIDTH
_PER_AMPLITUDE = _TURN / 2.0**pkg.AMPLITUDE_FRACTION
_NATURAL = 32  # pairs of crossings whose natural frequencies are averaged
_BLOCK_LINES = 4 * len(HARMONICS)  # least number of lines to fit the true amplitude


@dataclass(frozen=True)
class Events:
    """Disturbances of the mirror, ``EVENT_S`` after its loop has reached RUN."""

    drift_hz: float = 0.0  # sudden change of its natural frequency
    shock_rad_per_s: float = 0.0  # added to its velocity
    drop_every: int = 0  # one of this many passes over the diode is lost
    laser_off_s: float = 0.0  # time for which the laser is off

    @property
    def any(self) -> bool:
        """Return whether there is any disturbance."""
        return self != Events()


@dataclass(frozen=True)
class Run:
    """The lines of a run in physical units, all arrays [n], and the data of the whole run.

    ``true_rad`` and ``true_amplitude_rad`` are NaN where the truth is unknown, as in a replay.
    """

    line: Floats
    time_s: Floats
    state: Floats
    true_rad: Floats
    angle_rad: Floats
    true_amplitude_rad: Floats
    amplitude_rad: Floats
    frequency_hz: Floats
    natural_hz: Floats  # as the drive's phase tells it; NaN before RUN
    level: Floats
    flags: Floats
    confidence: Floats
    recording: Recording
    registers: MirrorRegisters
    foreseen_hz: float  # where the drive comes to rest at the last natural frequency; NaN if not
    set_rad: float
    run_s: float  # time when RUN was reached; NaN if it was not
    event_s: float  # time of the events; NaN without
    end_s: float
    counts: dict[str, int]
    fault: int

    @property
    def running(self) -> Bools:
        """Return which lines are in RUN."""
        return np.asarray(self.state == pkg.MIRROR_RUN)

    @property
    def error_rad(self) -> Floats:
        """Return the angle less the true one."""
        return self.angle_rad - self.true_rad


def simulate(
    config: Config,
    seconds: float,
    events: Events,
    progress: Progress | None = None,
    *,
    start_seconds: float | None = None,
    seed: int = 1,
) -> Run:
    """Start the mirror from rest, let it run, and disturb it.

    Args:
        config: Configuration of the instrument and of the simulated mirror.
        seconds: Mirror time from RUN on; ``EVENT_S`` of it is before the events.
        events: The disturbances.
        progress: Called with the microseconds of mirror time so far.
        start_seconds: The longest start; the loop's own time-outs if None.
        seed: Seed of jitter and noise.

    Raises:
        InputError: if a value does not fit in its register, or the engine cannot be built.
    """
    registers = MirrorRegisters.from_config(config)
    hertz = registers.clock_hz
    quiet = World.from_config(config, seed=seed)
    longest = registers.sweep_timeout + registers.settle_timeout + round(0.01 * hertz)
    if start_seconds is not None:
        longest = round(start_seconds * hertz)

    def told(clocks: int) -> None:
        if progress is not None:
            progress(round(1e6 * clocks / hertz))

    with Mirror(registers, config, quiet) as mirror:
        parts = []
        while mirror.state not in (pkg.MIRROR_RUN, pkg.MIRROR_FAULT) and mirror.clock < longest:
            step = min(round(CHUNK_S * hertz), longest - mirror.clock)
            parts.append(mirror.run(step, quiet, until_state=pkg.MIRROR_RUN, progress=told))
        run = mirror.clock if mirror.state == pkg.MIRROR_RUN else math.nan
        event = math.nan
        if mirror.state == pkg.MIRROR_RUN:
            end = mirror.clock + round(seconds * hertz)
            before = round(min(seconds, EVENT_S) * hertz)
            parts.append(mirror.run(before, quiet, progress=told))
            event = mirror.clock if events.any else math.nan
            world = replace(
                quiet,
                natural_offset_hz=events.drift_hz,
                shock_rad_per_s=events.shock_rad_per_s,
                drop_every=events.drop_every,
            )
            if events.laser_off_s:
                dark = min(end - mirror.clock, round(events.laser_off_s * hertz))
                parts.append(mirror.run(dark, replace(world, startup_mw=0.0), progress=told))
                world = replace(world, shock_rad_per_s=0.0)
            parts.append(mirror.run(end - mirror.clock, world, progress=told))
        recording = Recording.joined(parts)
        return _run(recording, mirror, config, run / hertz, event / hertz, true=True)


def replay(
    config: Config,
    recorded: Rows,
    set_rad: float,
    seconds: float,
    progress: Progress | None = None,
) -> Run:
    """Run recorded samples through the loop, with the drive at its frequency from time 0.

    Args:
        config: Configuration of the instrument.
        recorded: ``SAMPLES`` rows of the recording.
        set_rad: The amplitude from which an error is counted, because the recorded one is not
            controlled.
        seconds: Length of the replay.
        progress: Called with the microseconds of mirror time so far.

    Raises:
        InputError: as for ``simulate``.
    """
    registers = MirrorRegisters.from_config(config)
    registers = replace(
        registers,
        sweep_word=registers.work_word,
        trim_min=0,
        trim_max=0,
        amplitude_set=round(set_rad / _PER_AMPLITUDE),
    )
    hertz = registers.clock_hz
    world = World.from_config(config)
    with Mirror(registers, config, world) as mirror:
        recording = mirror.run(
            math.ceil(seconds * hertz),
            world,
            replay=recorded,
            progress=lambda clocks: progress(round(1e6 * clocks / hertz)) if progress else None,
        )
        run = recording.lines["clock"][recording.lines["state"] == pkg.MIRROR_RUN]
        started = run[0] / hertz if run.size else math.nan
        return _run(recording, mirror, config, started, math.nan, true=False, set_rad=set_rad)


def recorded_amplitude(times: tuple[Floats, Floats], config: Config) -> float:
    """Return the typical amplitude of a recording's pairs of crossings, rad.

    Args:
        times: Times of outward and inward crossings, s, [n] each, from ``edges.pairs``.
        config: Configuration of the instrument; its amplitude is returned if there is no pair,
            and of a polygon.
    """
    outward, inward = times
    mirror = config.mirror
    half = (inward - outward) / 2.0 * mirror.frequency_hz
    half = half[(half > 0.0) & (half < 0.25)]
    if half.size == 0 or mirror.polygon:
        return math.radians(mirror.amplitude_deg)
    mark = math.radians(mirror.index_deg)
    return float(crossings(np.array([np.median(half)]), mark, mirror.harmonics)[0][0])


def _run(
    recording: Recording,
    mirror: Mirror,
    config: Config,
    run_s: float,
    event_s: float,
    *,
    true: bool,
    set_rad: float | None = None,
) -> Run:
    registers, lines = mirror.registers, recording.lines
    hertz = registers.clock_hz
    time = lines["centre_halves"] / (2.0 * hertz)
    angle_true = lines["angle_true"] if true else np.full(len(lines), np.nan)
    frequency = lines["word"] * (hertz / 2.0**pkg.TURN_WIDTH)
    amplitude = math.radians(config.mirror.amplitude_deg) if set_rad is None else set_rad
    natural = _natural_hz(recording, config, amplitude, hertz)
    measured_s = recording.measurements["clock"] / hertz
    unknown = np.full(len(lines), np.nan)
    # A polygon has neither an amplitude nor harmonics.
    amplitude_true = unknown if config.mirror.polygon else fitted(time, angle_true, frequency)[0]
    return Run(
        line=lines["line"],
        time_s=time,
        state=lines["state"],
        true_rad=angle_true,
        angle_rad=lines["angle"] * _PER_TURN,
        true_amplitude_rad=amplitude_true,
        amplitude_rad=lines["amplitude"] * _PER_AMPLITUDE,
        frequency_hz=frequency,
        natural_hz=np.where(
            lines["state"] == pkg.MIRROR_RUN,
            np.interp(time, measured_s, natural) if natural.size else np.nan,
            np.nan,
        ),
        level=lines["level"] / 2.0**pkg.LEVEL_WIDTH,
        flags=lines["flags"],
        confidence=lines["confidence"] / (2.0**pkg.CONFIDENCE_WIDTH - 1.0),
        recording=recording,
        registers=registers,
        foreseen_hz=_foreseen_hz(natural, config, amplitude),
        set_rad=amplitude,
        run_s=run_s,
        event_s=event_s,
        end_s=mirror.clock / hertz,
        counts=mirror.counts,
        fault=mirror.fault,
    )


def _natural_hz(recording: Recording, config: Config, set_rad: float, hertz: float) -> Floats:
    """Return the natural frequency at each pair of crossings, mean of ``_NATURAL`` pairs."""
    rows = recording.measurements
    phase = (rows["drive_phase"] - rows["phase"]) / 2.0**pkg.TURN_WIDTH
    phase -= np.round(phase)
    found = natural_frequency(
        rows["word"] * (hertz / 2.0**pkg.TURN_WIDTH),
        phase,
        set_rad,
        quality=config.mems.quality,
        comb_rad=math.radians(config.mems.comb_deg),
        duty=config.mirror.duty,
    )
    if len(found) < _NATURAL:
        return np.empty(0)
    sums = np.cumsum(np.concatenate([[0.0], np.nan_to_num(found, nan=0.0)]))
    means = (sums[_NATURAL:] - sums[:-_NATURAL]) / _NATURAL
    return np.concatenate([np.full(_NATURAL - 1, means[0]), means])


def _foreseen_hz(natural: Floats, config: Config, set_rad: float) -> float:
    """Return the frequency at which the drive rests at its nominal level, or NaN."""
    mems, mirror = config.mems, config.mirror
    try:
        return resting_point(
            float(natural[-1]),
            set_rad,
            mems.torque * (mirror.level / NOMINAL_LEVEL) ** 2,
            quality=mems.quality,
            comb_rad=math.radians(mems.comb_deg),
            duty=mirror.duty,
        )[0]
    except (IndexError, ValueError):
        return math.nan


def fitted(time_s: Floats, angle_rad: Floats, frequency_hz: Floats) -> tuple[Floats, Floats]:
    """Fit (12), its odd harmonics, to each few periods of a motion by least squares.

    Args:
        time_s: Rising times [n].
        angle_rad: Angles [n]; NaN gives NaN.
        frequency_hz: Frequencies [n], near the motion's own.

    Returns:
        Amplitudes of the first harmonic, rad [n], linear between the blocks, and what the harmonics
        leave of the motion, rad [n]; NaN where there is less than a block.
    """
    nothing = np.full(len(time_s), np.nan)
    if len(time_s) < _BLOCK_LINES or np.isnan(angle_rad).any():
        return nothing, nothing
    step = np.diff(time_s)
    turns = np.concatenate([[0.0], np.cumsum(step * (frequency_hz[1:] + frequency_hz[:-1]) / 2.0)])
    # Whole periods, and enough lines for all harmonics; the rest at the end belongs to no block.
    per_turn = (len(time_s) - 1) / max(turns[-1], 1e-9)
    periods = max(1, math.ceil(_BLOCK_LINES / max(per_turn, 1e-9)))
    size = max(_BLOCK_LINES, round(periods * per_turn))
    count = len(time_s) // size
    if count == 0:
        return nothing, nothing
    used = count * size
    phase = _TURN * np.multiply.outer(turns[:used] % 1.0, np.asarray(HARMONICS, np.float64))
    design = np.concatenate([np.cos(phase), np.sin(phase)], axis=1).reshape(count, size, -1)
    # A small multiple of the unit matrix keeps blocks with unevenly sampled motion solvable.
    normal = np.einsum("bik,bil->bkl", design, design) + 1e-9 * np.eye(design.shape[2])
    blocks = angle_rad[:used].reshape(count, size)
    right = np.einsum("bik,bi->bk", design, blocks)
    solution = np.linalg.solve(normal, right[..., None])[..., 0]
    amplitude = np.hypot(solution[:, 0], solution[:, len(HARMONICS)])
    centre = time_s[:used].reshape(count, size).mean(axis=1)
    left = blocks - np.einsum("bik,bk->bi", design, solution)
    return (
        np.asarray(np.interp(time_s, centre, amplitude)),
        np.concatenate([left.ravel(), nothing[used:]]),
    )


def write_csv(run: Run, file: BinaryIO) -> None:
    """Write mirror.csv, one row for each line in the columns ``COLUMNS``.

    Times and angles have the decimals from which the words are read back.
    """
    names = [
        "|".join(name for bit, name in enumerate(FLAG_NAMES) if flags >> bit & 1)
        for flags in range(1 << len(FLAG_NAMES))
    ]
    columns = (
        run.line, run.time_s, run.state, run.true_rad, run.angle_rad, run.true_amplitude_rad,
        run.amplitude_rad, run.frequency_hz, run.natural_hz, run.level, run.flags,
    )  # fmt: skip
    rows = [
        (*row[:2], STATES[row[2]], *row[3:10], names[row[10]])
        for row in zip(*(column.tolist() for column in columns), strict=True)
    ]
    sheet = listed(list(_FORMS), rows)
    kept = [replace(column, kept=_FORMS[column.name]) for column in sheet.columns]
    file.write(Sheet(kept, rows).csv())


@dataclass(frozen=True)
class Summary:
    """Figures of a run; NaN where the run does not have them.

    Errors of angle and amplitude are taken over lines in RUN without a flag, after ``STEADY_S`` of
    it. Where there was an event, the lines from it to the first flag, which could not know of it,
    are left out, and for the amplitude all lines until it is back.
    """

    start_s: float  # time from power-on to RUN
    lines: int  # number of lines in RUN
    flagged: int  # number of lines in RUN with a flag
    angle_rms_urad: float
    angle_max_urad: float
    amplitude_rms_ppm: float  # true amplitude over the set one, less 1
    crossing_rms_ns: float  # time error of one index crossing, from the tracker's errors
    flag_delay_periods: float  # time from the event to the first flag
    unnoticed_urad: float  # the largest error of an angle between them
    flagged_s: float  # time from the event to the last flag
    natural_hz: float  # natural frequency before the event, from the drive's phase
    half_turn_rms_urad: float  # a(t) + a(t + T/2) of the true angles, which (11) says is 0
    harmonics_rms_urad: float  # what the odd harmonics of (12) leave of the true angles
    natural_after_hz: float  # the same at the end of a run with an event
    back_s: float  # time from the event until the true amplitude stays within BACK_PPM
    largest_ppm: float  # largest error of the amplitude after the event


def summarise(run: Run) -> Summary:
    """Return the summary of a run."""
    running = run.running & (run.time_s > run.run_s)
    flagged = running & (run.flags != 0)
    steady = running & (run.flags == 0) & (run.time_s > run.run_s + STEADY_S)
    deviation = 1e6 * (run.true_amplitude_rad / run.set_rad - 1.0)
    delay = flagged_s = back = largest = unnoticed = math.nan
    if not math.isnan(run.event_s):
        after = run.time_s > run.event_s
        flags = np.flatnonzero(after & (run.flags != 0))
        if flags.size:
            period = 1.0 / run.frequency_hz[flags[0]]
            clock = run.recording.lines["clock"][flags[0]] / run.registers.clock_hz
            delay = (clock - run.event_s) / period
            flagged_s = float(run.time_s[flags[-1]] - run.event_s)
            between = after & (run.time_s < run.time_s[flags[0]])
            unnoticed = 1e6 * float(np.abs(run.error_rad[between]).max(initial=0.0))
            steady &= ~between
        off = np.flatnonzero(after & (np.abs(deviation) > BACK_PPM))
        back = float(run.time_s[off[-1]] - run.event_s) if off.size else 0.0
        if off.size and off[-1] == len(deviation) - 1:
            back = math.nan
        largest = float(np.abs(deviation[after]).max()) if after.any() else math.nan
        quiet = ~after
        if not math.isnan(back):
            quiet |= run.time_s > run.event_s + max(
                back, 0.0 if math.isnan(flagged_s) else flagged_s
            )
        steady_amplitude = steady & quiet
    else:
        steady_amplitude = steady
    error = 1e6 * run.error_rad[steady]
    calm = running & (run.time_s > run.run_s + STEADY_S) & ~(run.time_s > run.event_s)
    half_turn, harmonics = _left_by_equations(run, calm)
    return Summary(
        start_s=run.run_s,
        lines=int(running.sum()),
        flagged=int(flagged.sum()),
        angle_rms_urad=residuals.rms(error),
        angle_max_urad=float(np.abs(error).max()) if error.size else math.nan,
        amplitude_rms_ppm=residuals.rms(deviation[steady_amplitude]),
        crossing_rms_ns=_crossing_rms_ns(run),
        flag_delay_periods=delay,
        unnoticed_urad=unnoticed,
        flagged_s=flagged_s,
        natural_hz=_last(run.natural_hz[steady & ~(run.time_s > run.event_s)]),
        half_turn_rms_urad=1e6 * half_turn,
        harmonics_rms_urad=1e6 * harmonics,
        natural_after_hz=_last(run.natural_hz[steady & (run.time_s > run.event_s)]),
        back_s=back,
        largest_ppm=largest,
    )


def _left_by_equations(run: Run, rows: Bools) -> tuple[float, float]:
    """Return the rms of what (11) and (12) leave, rad; NaN of a polygon or of too few lines."""
    if np.isnan(run.true_amplitude_rad).all():
        return math.nan, math.nan
    motion = (run.time_s[rows], run.true_rad[rows], run.frequency_hz[rows])
    left = fitted(*motion)[1]
    if not np.isfinite(left).any():
        return math.nan, math.nan
    return residuals.rms(half_turn_residual(*motion)), residuals.rms(left[np.isfinite(left)])


def _last(values: Floats) -> float:
    return float(values[-1]) if values.size else math.nan


def _crossing_rms_ns(run: Run) -> float:
    """Return the rms time error of one crossing, from the tracker's errors in steady RUN.

    A middle of two has half their variance. The tracker's error is that of the middle and of its
    own prediction: 1 + (2 a^2 + a b + 2 b) / (a (4 - 2 a - b)) times the variance, a and b the
    shares of an error that phase and rate take (the alpha-beta filter's known noise ratio).
    """
    rows = run.recording.measurements
    time = rows["clock"] / run.registers.clock_hz
    end = run.event_s if not math.isnan(run.event_s) else math.inf
    steady = rows["error"][(time > run.run_s + STEADY_S) & (time < end)].astype(np.float64)
    if steady.size < 8:
        return math.nan
    period = 2.0**pkg.TURN_WIDTH / run.registers.work_word  # clocks
    a, b = 2.0**-run.registers.phase_shift, period * 2.0**-run.registers.rate_shift
    ratio = 1.0 + (2.0 * a * a + a * b + 2.0 * b) / (a * (4.0 - 2.0 * a - b))
    turns = float(np.std(steady)) / 2.0**pkg.ERROR_WIDTH
    return math.sqrt(2.0 / ratio) * turns * period / run.registers.clock_hz * 1e9


def table(run: Run, summary: Summary, title: str) -> RichTable:
    """Return the summary as a table for the terminal, without what the run did not show."""
    rows: list[tuple[str, float, str]] = [
        ("RUN after", summary.start_s, "{:.3f} s"),
        ("mirror time", run.end_s, "{:.3f} s"),
        ("lines in RUN", summary.lines, "{}"),
        ("of them flagged", summary.flagged, "{}"),
        ("angle error, unflagged, rms", summary.angle_rms_urad, "{:.2f} urad"),
        ("angle error, unflagged, largest", summary.angle_max_urad, "{:.2f} urad"),
        ("(11), left of a(t) + a(t + T/2), rms", summary.half_turn_rms_urad, "{:.2f} urad"),
        ("(12), left by its harmonics, rms", summary.harmonics_rms_urad, "{:.2f} urad"),
        ("amplitude held, rms", summary.amplitude_rms_ppm, "{:.1f} ppm"),
        ("index crossing, rms", summary.crossing_rms_ns, "{:.2f} ns"),
        ("natural frequency, by the drive's phase", summary.natural_hz, "{:.4f} Hz"),
        ("natural frequency after the event", summary.natural_after_hz, "{:.4f} Hz"),
        ("drive's frequency at the end", float(run.frequency_hz[-1]), "{:.4f} Hz"),
        ("where it rests at the nominal level", run.foreseen_hz, "{:.4f} Hz"),
        ("event flagged after", summary.flag_delay_periods, "{:.3f} periods"),
        ("largest angle error until then", summary.unnoticed_urad, "{:.0f} urad"),
        ("last flag after the event", summary.flagged_s, "{:.3f} s"),
        ("amplitude was off by", summary.largest_ppm, "{:.0f} ppm"),
        (f"back within {BACK_PPM:.0f} ppm after", summary.back_s, "{:.3f} s"),
        *((f"{name} (counter)", count, "{}") for name, count in run.counts.items() if count),
    ]
    shown = [(name, form.format(value)) for name, value, form in rows if not math.isnan(value)]
    fault = [("FAULT", FAULTS[run.fault])] if run.fault else []
    return listed(["", ""], [*shown, *fault], left=1).terminal(title)


def picture(run: Run, summary: Summary, title: str, file: BinaryIO) -> None:
    """Draw start-up, amplitude with level and frequency, and the angle's error, as PNG."""
    with drawing(10.0, 9.6, title) as figure:
        grid = figure.add_gridspec(3, 1)
        _draw_start(figure.add_subplot(grid[0]), run)
        _draw_amplitude(figure.add_subplot(grid[1]), run)
        _draw_error(figure.add_subplot(grid[2]), run, summary)
        figure.savefig(file, format="png", dpi=130)


def _shade(axes: Axes, run: Run) -> None:
    """Mark the lines with a flag, and the time of an event."""
    if not len(run.time_s):
        return
    bad = np.concatenate([[0], (run.flags != 0).astype(np.int64), [0]])
    first, last = np.flatnonzero(np.diff(bad) == 1), np.flatnonzero(np.diff(bad) == -1)
    for index, (start, stop) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        axes.axvspan(
            run.time_s[start],
            run.time_s[min(stop, len(run.time_s) - 1)],
            color="#fbe9d7",
            linewidth=0,
            zorder=0,
            label="lines are flagged" if index == 0 else None,
        )
    if not math.isnan(run.event_s):
        axes.axvline(run.event_s, color=INK, linewidth=1, linestyle="--", label="event")


def _legend(axes: Axes, **options: Any) -> None:
    """Add a legend above the axes, where it covers nothing."""
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98)}
    place["columnspacing"] = 1.0
    axes.legend(ncols=len(axes.get_legend_handles_labels()[1]), **place, **options)


def _draw_start(axes: Axes, run: Run) -> None:
    """Draw envelope and drive frequency since power-on."""
    height = run.true_amplitude_rad if not np.isnan(run.true_amplitude_rad).all() else (
        run.amplitude_rad)  # fmt: skip
    axes.plot(run.time_s, np.degrees(height), color=COLOURS[0], linewidth=1.2, label="amplitude")
    axes.set(ylabel="amplitude in degrees", xlabel="time in s")
    axes.set_title("Start-up: " + ", ".join(_states(run)), pad=20.0)  # the legend is below it
    if not math.isnan(run.run_s) and run.run_s > run.time_s[0]:
        axes.set_xlim(0.0, 1.15 * run.run_s)
    other = axes.twinx()
    other.plot(run.time_s, run.frequency_hz, color=COLOURS[1], linewidth=1.2)
    other.set_ylabel("drive in Hz", color=COLOURS[1])
    other.spines["right"].set_visible(True)
    other.ticklabel_format(useOffset=False)
    _shade(axes, run)
    _legend(axes)


def _states(run: Run) -> list[str]:
    """Return each state with the time of its first line."""
    changes = np.flatnonzero(np.diff(run.state, prepend=-1))
    return [f"{STATES[int(run.state[k])]} at {run.time_s[k]:.3f} s" for k in changes[:6]]


def _draw_amplitude(axes: Axes, run: Run) -> None:
    """Draw the error of the amplitude and the drive's level, since RUN."""
    rows = run.running
    if rows.any():
        time = run.time_s[rows]
        measured = 1e6 * (run.amplitude_rad[rows] / run.set_rad - 1.0)
        true = 1e6 * (run.true_amplitude_rad[rows] / run.set_rad - 1.0)
        axes.plot(time, measured, color=QUIET, linewidth=0.6, label="measured, averaged")
        if not np.isnan(true).all():
            axes.plot(time, true, color=COLOURS[0], linewidth=1.2, label="true")
        axes.axhspan(-BACK_PPM, BACK_PPM, color=LIGHT, linewidth=0, zorder=0)
        other = axes.twinx()
        other.plot(time, run.level[rows], color=COLOURS[1], linewidth=0.8)
        other.set_ylabel("drive level", color=COLOURS[1])
        other.spines["right"].set_visible(True)
        other.ticklabel_format(useOffset=False)
        reach = float(np.nanmax(np.abs(np.concatenate([measured, np.nan_to_num(true)]))))
        if reach > 30.0 * BACK_PPM:
            axes.set_yscale("symlog", linthresh=BACK_PPM)
        axes.set_xlim(time[0], time[-1])
        _shade(axes, run)
        _legend(axes)
    axes.set(
        title=f"Amplitude in RUN; the band is {BACK_PPM:.0f} ppm",
        xlabel="time in s",
        ylabel="off by, ppm",
    )


def _draw_error(axes: Axes, run: Run, summary: Summary) -> None:
    """Draw the angle less the truth in RUN, or the angle itself where the truth is unknown."""
    rows = run.running
    known = rows & ~np.isnan(run.true_rad)
    axes.set_xlabel("time in s")
    if known.any():
        time, error = run.time_s[known], 1e6 * run.error_rad[known]
        good = run.flags[known] == 0
        axes.plot(time[~good], error[~good], ".", color=COLOURS[1], markersize=1.5, label="flagged")
        axes.plot(
            time[good], error[good], ".", color=COLOURS[0], markersize=1.5, label="not flagged"
        )
        rms = summary.angle_rms_urad
        reach = max(1.0, 20.0 * (rms if math.isfinite(rms) else residuals.rms(error)))
        axes.set_ylim(-reach, reach)
        axes.set(
            title=f"Angle error in RUN, {rms:.2f} urad rms where not flagged",
            ylabel="measured - true in urad",
        )
        axes.set_xlim(time[0], time[-1])
        _shade(axes, run)
        _legend(axes, markerscale=4.0)
    else:
        last = slice(-min(len(run.time_s), 1200), None)
        axes.plot(
            run.time_s[last], np.degrees(run.angle_rad[last]), ".", color=COLOURS[0], markersize=2.0
        )
        axes.set(title="Angle of the last lines", ylabel="scan angle in degrees")


def read_edges(
    path: Path, config: Config, columns: Mapping[str, str] | None = None
) -> tuple[Rows, float, float]:
    """Return a recording's samples, its amplitude, rad, and its length, s.

    Times before 0, such as those before a trigger, are counted from the first row.

    Raises:
        InputError: as ``recordings.read_edges``, whose arguments ``path`` and ``columns`` are.
    """
    time, comparator, gate = recordings.read_edges(path, columns)
    time = time - min(float(time[0]), 0.0)
    rows = edges.sample(
        time,
        comparator,
        gate,
        clock_hz=config.clock.frequency_hz,
        oversample=config.mirror.oversample,
    )
    amplitude = recorded_amplitude(edges.pairs(time, comparator, gate), config)
    assert rows.dtype == SAMPLES
    return rows, amplitude, float(time[-1])
