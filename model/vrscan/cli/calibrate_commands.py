"""The commands ``vrscan calibrate``: what an instrument is, found in what it records."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vrscan.cli.checks import ColumnsOption, check_suffix, renamed
from vrscan.cli.panels import group
from vrscan.cli.progress import bar, console, step, telling
from vrscan.data import config as configuration
from vrscan.data.config import Config
from vrscan.data.errors import InputError, InterruptError
from vrscan.data.points import atomic_file
from vrscan.data.recordings import SUFFIX, read_config
from vrscan.engines.engine import Engine

if TYPE_CHECKING:
    from vrscan.calibrate.recording import Recording

calibrate = typer.Typer(help="Find the instrument's parameters in recordings.")

# How `vrscan calibrate --help` groups the commands, in this order.
PANELS = {
    "Step by step": ("record", "coarse", "mirror", "map", "verify"),
    "A simulated instrument": ("instrument", "run-all"),
}

ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", help="Preset, or TOML file whose values override the defaults."),
]
ScansArgument = Annotated[
    list[Path],
    typer.Argument(metavar="SCAN.mcap...", help="Scans, in the order of the stage's positions."),
]
TomlOption = Annotated[Path, typer.Option(help="File for the calibrated configuration, .toml.")]


@calibrate.command("instrument")
def calibrate_instrument(
    out: Annotated[Path, typer.Option(help="File for the instrument, .toml.")],
    seed: Annotated[int, typer.Option(help="Seed that the tolerances are drawn from.")] = 1,
    config: ConfigOption = None,
) -> None:
    """Draw a simulated instrument that differs from the configuration by its tolerances."""
    from vrscan.scene.tolerances import drawn, written

    with atomic_file(out) as file:
        file.write(written(drawn(seed, configuration.load(config))).encode())
    print(f"{out}: {step('scan', '--instrument', out)}")


@calibrate.command("record")
def calibrate_record(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SCAN", help="Recording of points, .mcap, or a folder of points.csv, edges.csv."
        ),
    ],
    out: Annotated[Path, typer.Option(help="File for the scan, a recording, .mcap.")],
    z_mm: Annotated[float, typer.Option(help="Distance of the surface, mm.")],
    focus_mm: Annotated[float, typer.Option(help="Depth that the lens is focused at, mm.")],
    kind: Annotated[str, typer.Option(help="plane, or relief for a sine over x.")] = "plane",
    amplitude_mm: Annotated[float, typer.Option(help="Amplitude of the relief, mm.")] = 0.0,
    period_mm: Annotated[float, typer.Option(help="Period of the relief, mm.")] = 40.0,
    drive_phase: Annotated[
        float | None,
        typer.Option(help="Phase of the drive that the mirror's loop measured, turns."),
    ] = None,
    edges: Annotated[
        Path | None,
        typer.Option(
            help="Index edges, .csv or .mcap; their time begins at line 0. Default: those of SCAN."
        ),
    ] = None,
    columns: ColumnsOption = None,
    config: ConfigOption = None,
) -> None:
    """Make a calibration scan of the points and index edges of a known surface."""
    from vrscan.calibrate import recording

    check_suffix(out, (SUFFIX,))
    settings = read_config(source, config)
    values: dict[str, object] = {
        "kind": kind,
        "z_mm": z_mm,
        "focus_mm": focus_mm,
        "amplitude_mm": amplitude_mm,
        "period_mm": period_mm,
        "frequency_hz": settings.mirror.frequency_hz,
        "facets": settings.mirror.facets if settings.mirror.polygon else 0,
        "drive_phase": drive_phase,
    }
    setup = configuration.checked(recording.Setup, values, "setup")
    with telling(), atomic_file(out) as file:
        points, found = recording.from_file(source, settings, edges, renamed(columns))
        made = recording.record(str(source), setup, points, found, settings, file)
    print(f"{out}: {len(made)} points, {len(made.out_s)} pairs of crossings")


def _resonant(path: Path | None, what: str, instead: str) -> Config:
    """Return the configuration, for what has no sense with a polygon.

    Args:
        path: As that of ``config.load``.
        what: What is asked for.
        instead: What there is for a polygon.

    Raises:
        InputError: as ``config.load``, and if its mirror is a polygon.
    """
    settings = configuration.load(path)
    if settings.mirror.polygon:
        raise InputError(
            f"{settings.source}: mirror.kind: {what} is of a resonant mirror; "
            f"of a polygon {instead}"
        )
    return settings


def _scans(paths: list[Path], settings: Config) -> list["Recording"]:
    """Return the scans of files.

    Raises:
        InputError: as ``recording.read``, and if a scan is of another mirror than the
            configuration's.
    """
    from vrscan.calibrate import recording

    def mirror(facets: int) -> str:
        return f"a polygon of {facets} facets" if facets else "a resonant mirror"

    with telling():
        found = [recording.read(path) for path in paths]
    facets = settings.mirror.facets if settings.mirror.polygon else 0
    for path, each in zip(paths, found, strict=True):
        if each.setup.facets != facets:
            raise InputError(
                f"{path}: a scan of {mirror(each.setup.facets)}, but {settings.source} has "
                f"{mirror(facets)}: --config needs the scanner's own"
            )
    return found


def _write(out: Path, settings: Config, notes: dict[str, object], scans: list[Path]) -> None:
    """Write a configuration with its provenance, and show the notes."""
    from vrscan.calibrate import results

    for name, value in notes.items():
        print(f"{name}: {value}")
    with atomic_file(out) as file:
        whole = results.provenance(scans) | notes
        file.write(results.configuration(settings, whole).encode())
    print(f"{out}: {step('scan', '--config', out)}")


@calibrate.command("coarse")
def calibrate_coarse(
    scans: ScansArgument,
    out: TomlOption,
    search: Annotated[
        bool, typer.Option("--simplex/--no-simplex", help="Run the paper's simplex search, too.")
    ] = True,
    config: ConfigOption = None,
) -> None:
    """Find all parameters, 18 or a polygon's 8, in scans of a sine relief at known distances."""
    from vrscan.calibrate import coarse, results

    settings = configuration.load(config)
    found = coarse.calibrate(_scans(scans, settings), settings, search=search)
    notes: dict[str, object] = results.fitted(found.fit)
    notes["mean error in z before, mm"] = f"{found.start_mm:.4f}"
    notes["after, mm"] = f"{found.mean_mm:.4f}, of single points {found.point_mm:.4f}"
    notes["least squares"] = f"{found.fit.seconds:.1f} s, {found.fit.calls} evaluations"
    if search:
        notes["simplex search"] = (
            f"{found.simplex_mean_mm:.4f} mm, {found.simplex_seconds:.1f} s, "
            f"{found.simplex_calls} evaluations"
        )
    _write(out, found.config, notes, scans)


@calibrate.command("mirror")
def calibrate_mirror(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="MOTION.csv|SCAN.mcap...",
            help="Table with the columns time_s and an angle, rad; or scans of a plane.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="With scans: file for the configuration, .toml.")
    ] = None,
    column: Annotated[str, typer.Option(help="Name of the column with the angle.")] = "angle_rad",
    from_s: Annotated[float, typer.Option("--from", help="Leave out rows before this time.")] = 0,
    config: ConfigOption = None,
) -> None:
    """Fit (12) to a recorded motion, or the mirror's map to scans of a plane; a polygon's diode."""
    from vrscan.calibrate import mirror_map, results

    if recordings[0].suffix in (SUFFIX, ".npz"):
        if out is None:
            raise InputError("mirror: scans need --out")
        settings = configuration.load(config)
        found = mirror_map.calibrate(_scans(recordings, settings), settings)
        notes: dict[str, object] = results.fitted(found.fit)
        notes["mean error in z, mm"] = f"{found.before_mm:.4f} before, {found.after_mm:.4f} after"
        for phase, natural in found.natural_hz.items():
            notes[f"natural frequency, Hz, at the drive's phase {phase:.6f}"] = f"{natural:.4f}"
        _write(out, found.config, notes, recordings)
        return
    if len(recordings) > 1:
        raise InputError(f"{recordings[1]}: one recorded motion at a time")
    instead = "mirror takes scans of a plane, for its index_deg"
    _motion(recordings[0], column, from_s, _resonant(config, "a recorded motion", instead))


def _motion(path: Path, column: str, from_s: float, settings: Config) -> None:
    """Print (12) of a recorded motion in the form of the configuration."""
    from vrscan.calibrate.motion_fit import fit_motion, read_motion

    times, angles = read_motion(path, column, from_s)
    found = fit_motion(times, angles, settings.mirror.frequency_hz, refine=True)
    print(f"# {len(times)} samples; the fit leaves {1e6 * found.residual_rad:.3f} urad rms")
    print("[mirror]")
    print(f"frequency_hz = {found.frequency_hz:.7f}")
    print(f"amplitude_deg = {math.degrees(found.amplitude_rad):.6f}")
    rows = ", ".join(f"[{size:.9f}, {phi:.7f}]" for size, phi in found.harmonics)
    print(f"harmonics = [{rows}]")


@calibrate.command("map")
def calibrate_map(
    scans: ScansArgument,
    out: Annotated[Path, typer.Option(help="File for the correction maps, .npz.")],
    config: ConfigOption = None,
) -> None:
    """Make the correction maps from planes over the whole field at several foci."""
    from vrscan.calibrate import field_map, results

    settings = configuration.load(config)
    maps = field_map.calibrate(_scans(scans, settings), settings)
    maps.words()
    with atomic_file(out) as file:
        results.write_maps(maps, results.provenance(scans), file)
    for k, (rms, filled) in enumerate(zip(maps.residual_px, maps.filled, strict=True)):
        print(f"map {k}: residual {rms:.3f} px rms, {filled.mean():.0%} of its nodes filled")
    print(f"{out}: {len(maps.corrections_px)} maps")


@calibrate.command("verify")
def calibrate_verify(
    scans: ScansArgument,
    maps: Annotated[Path | None, typer.Option("--map", help="Correction maps, .npz.")] = None,
    config: ConfigOption = None,
) -> None:
    """Show how well a calibration measures planes at known distances."""
    from vrscan.calibrate import verify
    from vrscan.data.correction_maps import read_maps
    from vrscan.study.report import experiment_report as report

    settings = configuration.load(config)
    held = None if maps is None else read_maps(maps)
    console().print(
        report.planes(
            [vars(verify.verified(each, settings, held)) for each in _scans(scans, settings)]
        )
    )


@calibrate.command("run-all")
def calibrate_run_all(
    out: Annotated[Path, typer.Option(help="Folder of the experiment; it goes on there.")],
    seed: Annotated[int, typer.Option(help="Seed of the instrument and its scans.")] = 1,
    engine: Annotated[
        Engine, typer.Option(help="Engine; fixed is the RTL to the last bit, and faster.")
    ] = Engine.FIXED,
    frames: Annotated[int, typer.Option(help="Lines of a scan.")] = 10_000,
    bust_lines: Annotated[int, typer.Option(help="Lines of the pan over the bust.")] = 1_350_000,
    jobs: Annotated[int, typer.Option(help="Number of processes; 0: one per processor.")] = 0,
    config: ConfigOption = None,
) -> None:
    """Calibrate a simulated instrument as in VR-SCAN V, and measure what it then reaches."""
    from vrscan.engines import engine as engines
    from vrscan.study import experiment
    from vrscan.study.report import experiment_report as report

    instead = "the steps themselves work: record, coarse, mirror, map, verify"
    belief = _resonant(config, "the paper's experiment", instead)
    for name, value, least in (
        ("--seed", seed, 0),
        ("--jobs", jobs, 0),
        ("--frames", frames, 1501),
    ):
        if value < least:
            raise InputError(f"{name}: must be at least {least} ({value})")
    if bust_lines < 1024:
        raise InputError(f"--bust-lines: must be at least 1024 ({bust_lines})")
    engines.prepare(engine, belief)
    plan = experiment.Experiment(seed, out, belief, engine, frames, bust_lines, jobs)
    try:
        found = experiment.run(plan, bar)
    except KeyboardInterrupt:
        raise InterruptError("interrupted; the same command goes on there") from None
    console().print(report.table(found))
    print(f"{out}: coarse.toml, mirror.toml, calibrated.toml, map.npz, results.json")


group(calibrate, PANELS)
