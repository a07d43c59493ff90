"""The ``vrscan`` command."""

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from enum import StrEnum
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import ValidationError

from vrscan.cli.calibrate_commands import calibrate
from vrscan.cli.case_commands import cases
from vrscan.cli.checks import ColumnsOption, check_range, check_suffix, renamed
from vrscan.cli.config_commands import config as config_text
from vrscan.cli.config_commands import new
from vrscan.cli.file_commands import export, filter_points
from vrscan.cli.link_commands import link
from vrscan.cli.panels import group
from vrscan.cli.progress import bar as _bar
from vrscan.cli.progress import console as _console
from vrscan.cli.progress import telling
from vrscan.cli.report_commands import report as report_pages
from vrscan.cli.view_commands import view
from vrscan.data import clouds, line_files
from vrscan.data import config as configuration
from vrscan.data.config import Config
from vrscan.data.errors import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_TERMINATED,
    InputError,
    InterruptError,
    blamed,
)
from vrscan.data.extras import named
from vrscan.data.parallel import processors
from vrscan.data.points import (
    atomic_file,
    check_writable,
    csv_file,
    csv_rows,
    ply_file,
    ply_vertices,
    unfinished,
)
from vrscan.data.recordings import Writer, read_config
from vrscan.data.table import Table
from vrscan.engines import engine as engines
from vrscan.engines.engine import Engine
from vrscan.registers.chain_registers import Registers

if TYPE_CHECKING:
    from vrscan.scene.light import Light
    from vrscan.study.plan import Plan
    from vrscan.study.report.mirror_report import Events as MirrorEvents

MOST_LINES = 1_000_000  # largest number that is in memory at once
MOST_SCANNED = 2**32  # largest number in the format of RTL and cloud
MOST_SECONDS = 60.0  # largest mirror time; one second takes half a minute


class Power(StrEnum):
    """What the laser's power does in a scan."""

    CONSTANT = "constant"
    ADAPTIVE = "adaptive"


class Focus(StrEnum):
    """What the lens does in a scan."""

    FIXED = "fixed"
    AUTOMATIC = "automatic"


app = typer.Typer(
    help="A MEMS laser triangulation scanner: from sensor lines to (x, z) points.",
    pretty_exceptions_enable=False,
)

app.add_typer(calibrate, name="calibrate")
app.add_typer(report_pages, name="report")

bench = typer.Typer(help="Measure speed against error.")
app.add_typer(bench, name="bench")

app.add_typer(link, name="link")
app.command()(cases)
app.command("config")(config_text)
app.command()(new)
app.command()(export)
app.command("filter")(filter_points)
app.command()(view)


def _version(wanted: bool) -> None:
    """Print the version and exit."""
    if wanted:
        print(f"vrscan {metadata.version('vrscan')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Handle the options that belong to no command."""


def _scenes(incomplete: str) -> list[str]:
    """Return the shipped scenes that a shell completes a beginning to."""
    from vrscan.scene.description import shipped

    return [name for name in shipped() if name.startswith(incomplete)]


def _presets(incomplete: str) -> list[str]:
    """Return the presets that a shell completes a beginning to."""
    return [name for name in configuration.presets() if name.startswith(incomplete)]


def _effects(incomplete: str) -> list[str]:
    """Return the fidelities, and lists of effects, that a shell completes a beginning to."""
    from vrscan.scene.effects import EFFECTS

    before, comma, begun = incomplete.rpartition(",")
    names = EFFECTS if comma else ("auto", "full", "minimal", *EFFECTS)
    return [before + comma + name for name in names if name.startswith(begun)]


SceneArgument = Annotated[
    str,
    typer.Argument(help="Name of a shipped scene, or FILE.toml.", autocompletion=_scenes),
]
FidelityOption = Annotated[
    str | None,
    typer.Option(
        help="auto, full, minimal, or names of effects with commas; default: the scene's.",
        autocompletion=_effects,
    ),
]
ToleranceOption = Annotated[
    float | None, typer.Option(help="Tolerance of auto, px; default: the scene's.")
]
ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        help="Preset, or TOML file whose values override the defaults.",
        autocompletion=_presets,
    ),
]
EngineOption = Annotated[
    Engine,
    typer.Option(
        help="Engine: the RTL, its bit-accurate model, or the papers' equations in float64."
    ),
]
InstrumentOption = Annotated[
    Path | None,
    typer.Option(help="TOML file of the instrument as it is; default: the scene's."),
]
CountOption = Annotated[int, typer.Option("--lines", help="Number of lines.")]
JobsOption = Annotated[
    int, typer.Option(help="Number of processes; 0: one per processor, fewer for few lines.")
]


@app.command()
def scan(
    out: Annotated[Path, typer.Option(help="Folder for points, picture and index edges.")],
    scene: SceneArgument = "default",
    engine: EngineOption = Engine.RTL,
    count: CountOption = 3000,
    fidelity: FidelityOption = None,
    tolerance: ToleranceOption = None,
    jobs: JobsOption = 0,
    instrument: InstrumentOption = None,
    keep: Annotated[
        bool,
        typer.Option("--keep-lines", help="Also write lines.mcap: the lines with their truth."),
    ] = False,
    power: Annotated[
        Power, typer.Option(help="The scene's power, or one that follows the peaks.")
    ] = Power.CONSTANT,
    focus: Annotated[
        Focus, typer.Option(help="The scene's focus, or one that follows the distance.")
    ] = Focus.FIXED,
    config: ConfigOption = None,
) -> None:
    """Simulate a scene, turn its lines into points and compare them with the truth.

    A long scan that was interrupted goes on where it was when the same command is given again.
    """
    from vrscan.engines.loops import LoopedScan
    from vrscan.ideal.correction_map import with_moving_lens
    from vrscan.scene.simulate import Scanner
    from vrscan.scene.timeline import write_edges
    from vrscan.study import scan as scans
    from vrscan.study import scan_store
    from vrscan.study.report import budget, reliability_report, space_report
    from vrscan.study.report import scan_report as report
    from vrscan.study.report.unmeasured import unmeasured

    _check_count(count, 1, MOST_SCANNED)
    _check_jobs(jobs)
    settings = _with_lines(_settings(config))
    automatic, follows = focus is Focus.AUTOMATIC, power is Power.ADAPTIVE
    if automatic:
        settings = with_moving_lens(settings)
    store = None
    with _folder(out), contextlib.ExitStack() as stack:
        names = ["points.csv", "points.ply", "picture.png", "reliability.png", "space.png"]
        names += ["lines.mcap"] * keep + ["loops.csv"] * (follows or automatic)
        files = {name: stack.enter_context(atomic_file(out / name)) for name in names}
        light, chosen = _planned(
            scene, count, fidelity, tolerance, settings, instrument=instrument, engine=engine
        )
        sweeps = light.scene.scan.sweep == "mirror"
        if sweeps:
            names.append("edges.csv")
            files["edges.csv"] = stack.enter_context(atomic_file(out / "edges.csv"))
        scanner = Scanner(
            light,
            count,
            chosen.active,
            tolerance_px=chosen.plane_px,
        )
        looped = None
        if follows or automatic:
            looped = LoopedScan(scanner, adaptive=follows, automatic=automatic)
        if count >= scan_store.LEAST_LINES:
            name = scan_store.name_of(scanner, engine, keep=keep, power=power, focus=focus)
            store = scan_store.Store(out / "parts", name)
        with contextlib.ExitStack() as parts:
            csv = parts.enter_context(csv_file(files["points.csv"]))
            ply = parts.enter_context(ply_file(files["points.ply"], out))
            if keep:
                about = {"scene": scene}
                recording = Writer(files["lines.mcap"], settings, about=about)
                lines = parts.enter_context(recording).lines
            if looped is not None:
                files["loops.csv"].write(scans.LOOPS_HEADER)

            def take(part: scans.Part) -> None:
                csv(csv_rows(part.points))
                ply(part.ply)
                if part.lines is not None:
                    lines(part.lines)
                if part.controls is not None:
                    files["loops.csv"].write(scans.loops_rows(part, settings))

            with _bar(f"light, {engine}", count) as progress:
                tally, sample, space = scans.scan(
                    scanner,
                    engine,
                    take,
                    keep=keep,
                    jobs=jobs,
                    progress=progress,
                    looped=looped,
                    store=store,
                )
        if sweeps:
            begin, end = light.scene.scan.start_s, scanner.end_s
            scanned = light.scene.scan, light.scene.seed, light.scene.instrument
            write_edges(files["edges.csv"], begin, end, settings, *scanned)
        title = f"{light.scene.title or Path(scene).name}: {count} lines, engine {engine}"
        drawn = len(sample.lines)
        report.picture(
            sample.lines,
            sample.points,
            settings,
            title if drawn == count else f"{title}; {drawn} of them drawn",
            files["picture.png"],
            y_mm=sample.y_mm,
            pixels=scanner.line if looped is None else scans.pixels_of(looped, sample),
        )
        truth = sample.lines.truth
        assert truth is not None
        reliability_report.picture(tally.reliability, title, files["reliability.png"])
        space_report.picture(sample.points, truth, title, files["space.png"], y_mm=sample.y_mm)
    if store is not None:
        store.remove()
    console = _console()
    console.print(report.error_table(tally.errors(), title))
    console.print(
        f"{tally.lines} lines, {tally.points} points; "
        f"{tally.dark} lines whose spot the camera cannot see, "
        f"{tally.stray} of them with a point"
    )
    console.print(str(tally.reliability), highlight=False)
    console.print(str(space), highlight=False)
    lens, free = light.scene.lens, settings.free
    if not automatic and (lens.focus_mm, lens.f_number) != (free.focus_mm, free.f_number):
        console.print(
            f"the scene's lens is focused at {lens.focus_mm:g} mm with f/{lens.f_number:g}, and "
            f"[free] says {free.focus_mm:g} mm with f/{free.f_number:g}",
            markup=False,
        )
    for line in budget.summary(chosen):
        console.print(line, highlight=False)
    if tally.points == 0:
        console.print(unmeasured(light, count), highlight=False, soft_wrap=True)
    console.print(f"{out}: {', '.join(names)}", highlight=False)


@app.command()
def budget(
    scene: SceneArgument = "default",
    count: CountOption = 3000,
    fidelity: FidelityOption = None,
    tolerance: ToleranceOption = None,
    csv: Annotated[
        Path | None, typer.Option(help="File to which the table of effects is written too.")
    ] = None,
    link: Annotated[
        Path | None, typer.Option("--link-csv", help="File for the link budget.")
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Show a scene's link budget, what each effect does to its points, and which are simulated."""
    from vrscan.study.report import budget as report
    from vrscan.study.report import link_budget
    from vrscan.study.report.unmeasured import unmeasured

    _check_count(count, 1)
    settings = _settings(config)
    with contextlib.ExitStack() as stack:
        file = None if csv is None else stack.enter_context(atomic_file(csv))
        link_file = None if link is None else stack.enter_context(atomic_file(link))
        light, chosen = _planned(scene, count, fidelity, tolerance, settings, each=True)
        links = link_budget.link_budget(light, count)
        if file is not None:
            file.write(report.budget_csv(chosen))
        if link_file is not None:
            link_file.write(link_budget.link_csv(links))
    console = _console()
    console.print(link_budget.link_table(links, light))
    console.print()
    console.print(report.budget_table(chosen, light.scene))
    notes = [unmeasured(light, count)] if chosen.pointless else []
    notes += report.light_lines(light, chosen) + report.stray_lines(light, chosen)
    for line in notes + report.safety_lines(light.scene, settings):
        console.print(line, highlight=False)


@app.command()
def stray(
    scene: SceneArgument = "default",
    count: CountOption = 3000,
    tolerance: Annotated[
        float | None,
        typer.Option(help="Shift that stray light may make, px; default: scene's."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="File for the budget by cause.")] = None,
    ghosts: Annotated[Path | None, typer.Option("--ghost-csv", help="File for the ghosts.")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="File for the picture of the BSDF, .png.")
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Show a scene's stray light: what each cause does, what keeps to the tolerance, all ghosts."""
    from vrscan.scene.description import load
    from vrscan.scene.light import Light
    from vrscan.study.report import stray_report as report

    _check_count(count, 1)
    if picture is not None:
        check_suffix(picture, (".png",))
    if tolerance is not None:
        check_range("--tolerance", tolerance, 1e-6, 10.0)
    settings = _settings(config)
    with contextlib.ExitStack() as stack:
        table, listed, drawn = (
            None if path is None else stack.enter_context(atomic_file(path))
            for path in (csv, ghosts, picture)
        )
        found = report.stray_budget(Light(load(scene), settings), count, tolerance)
        if table is not None:
            table.write(report.budget_csv(found))
        if listed is not None:
            listed.write(report.ghost_csv(found))
        if drawn is not None:
            report.picture(found, drawn)
    _console().print(report.report(found), highlight=False)


@app.command()
def detectability(
    site: Annotated[
        Path | None,
        typer.Argument(metavar="[SITE.toml]", help="File with the site; default: the paper's."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="File for the figures.")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="File for the picture of light and brightness, .png.")
    ] = None,
) -> None:
    """Show whether a laser stands out against the sun on a wall, at a place and time."""
    from vrscan.scene import site as sites
    from vrscan.study.report import detectability_report as report

    if picture is not None:
        check_suffix(picture, (".png",))
    with contextlib.ExitStack() as stack:
        table = None if csv is None else stack.enter_context(atomic_file(csv))
        drawn = None if picture is None else stack.enter_context(atomic_file(picture))
        wanted = sites.load(site)
        with contextlib.nullcontext() if site is None else blamed(str(site)):
            found = report.outlooks(wanted)
        if table is not None:
            table.write(report.csv_file(found))
        if drawn is not None:
            report.picture(found, drawn)
    _console().print(report.report(found), highlight=False)


@bench.command("light")
def bench_light(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENE]...", help="Scenes to measure; default: all shipped ones."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for fidelity.csv and .png; default: build/light.")
    ] = None,
    count: CountOption = 4096,
    write: Annotated[
        bool, typer.Option("--write", help="Rewrite the tables of docs/light.md.")
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Measure the simulator: lines per second against the error of what it leaves out."""
    from vrscan.engines.tools import build_folder, repository_root
    from vrscan.scene.description import load, shipped
    from vrscan.scene.light import Light
    from vrscan.study.report import fidelity as report
    from vrscan.study.report.unmeasured import unmeasured

    _check_count(count, 1)
    if write and scenes:
        raise InputError(f"--write: needs all scenes ({', '.join(scenes)} given)")
    settings = _settings(config)
    chosen = scenes or list(shipped())
    for path in report.pages(repository_root()) if write else ():
        check_writable(path)
    folder = build_folder() / "light" if out is None else out
    with (
        _folder(folder),
        atomic_file(folder / "fidelity.csv") as csv,
        atomic_file(folder / "fidelity.png") as png,
    ):
        lights = [Light(load(name), settings) for name in chosen]  # all, so that errors come first
        for light in lights:
            _question(light)
        with _bar("light", len(chosen)) as progress:
            rows = report.run(chosen, count, settings, progress)
        times = report.costs(chosen, count, settings) if write else {}
        _console().print(report.table(rows))
        for light in lights:
            if not any(row.points for row in rows if row.scene == light.scene.source):
                _console().print(unmeasured(light, count), highlight=False, soft_wrap=True)
        csv.write(report.csv_file(rows))
        report.picture(rows, png)
    _console().print(f"{folder}: fidelity.csv, fidelity.png", highlight=False)
    for path in report.write_pages(rows, times, repository_root()) if write else ():
        _console().print(f"{path}: rewritten", highlight=False)


@bench.command("loops")
def bench_loops(
    out: Annotated[
        Path | None, typer.Option(help="Folder for loops.csv and .png; default: build/loops.")
    ] = None,
    write: Annotated[
        bool, typer.Option("--write", help="Rewrite the table of docs/loops.md.")
    ] = False,
    jobs: JobsOption = 1,
    config: ConfigOption = None,
) -> None:
    """Measure planes with power and focus that follow the scene, and without."""
    from vrscan.engines.tools import build_folder, repository_root
    from vrscan.study.report import loops_report as report

    _check_jobs(jobs)
    settings = _with_lines(_settings(config))
    for path in report.pages(repository_root()) if write else ():
        check_writable(path)
    folder = build_folder() / "loops" if out is None else out
    with (
        _folder(folder),
        atomic_file(folder / "loops.csv") as csv,
        atomic_file(folder / "loops.png") as png,
    ):
        with _bar("planes", report.COUNT) as progress:
            rows = report.measure(settings, jobs or processors(), progress)
        csv.write(report.sheet(rows).csv())
        report.picture(rows, png)
    _console().print(report.table(rows))
    _console().print(f"{folder}: loops.csv, loops.png", highlight=False)
    for path in report.write(rows, repository_root()) if write else ():
        _console().print(f"{path}: rewritten", highlight=False)


@bench.command("attack")
def bench_attack(
    out: Annotated[
        Path | None, typer.Option(help="Folder for attack.csv and dark.csv; default: build/attack.")
    ] = None,
    engine: EngineOption = Engine.IDEAL,
    seed: Annotated[
        int | None, typer.Option(help="Seed of all random numbers; default: a fixed one.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Use a quarter of the lines, fewer dark ones.")
    ] = False,
    write: Annotated[
        bool, typer.Option("--write", help="Rewrite the worst rows in docs/hard-cases.md.")
    ] = False,
    jobs: JobsOption = 0,
    config: ConfigOption = None,
) -> None:
    """Measure detectors on spots, and dark lines, of another optics than the simulator's."""
    from vrscan.engines.tools import build_folder, repository_root
    from vrscan.study.bench import attack as report
    from vrscan.study.bench.cells import MOST_SEED

    _check_jobs(jobs)
    if seed is not None and not 0 <= seed <= MOST_SEED:
        raise InputError(f"--seed: must be 0 to {MOST_SEED} ({seed})")
    if write and quick:
        raise InputError("--write: needs all lines (--quick is given)")
    settings, drawn = _settings(config), report.SEED if seed is None else seed
    for path in report.pages(repository_root()) if write else ():
        check_writable(path)
    engines.prepare(engine, settings)
    folder = build_folder() / "attack" if out is None else out
    with (
        _folder(folder),
        atomic_file(folder / "attack.csv") as csv,
        atomic_file(folder / "dark.csv") as dark_csv,
    ):
        with _bar("cases", report.COUNT) as progress:
            rows, dark = report.measure(
                engine, settings, drawn, quick=quick, jobs=jobs or processors(), progress=progress
            )
        csv.write(report.sheet(rows).csv())
        dark_csv.write(report.dark_sheet(dark).csv())
    title = f"engine {engine}, seed {drawn}"
    _console().print(report.sheet(rows).terminal(title, report.CAPTION, gap=0))
    _console().print(report.dark_sheet(dark).terminal("", report.DARK_CAPTION))
    _console().print(f"{folder}: attack.csv, dark.csv", highlight=False)
    text = report.block(rows, dark, engine, drawn)
    for path in report.write(text, repository_root()) if write else ():
        _console().print(f"{path}: rewritten", highlight=False)


@bench.command("choose")
def bench_choose(
    write: Annotated[
        bool, typer.Option("--write", help="Rewrite docs/choice.png and docs/numbers.md's table.")
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Measure the modes of the board and a PC's detectors: error on speckled scenes, lines/s."""
    from vrscan.engines.tools import build_folder, repository_root
    from vrscan.study.bench.bench_report import SEED
    from vrscan.study.bench.cells import plain
    from vrscan.study.bench.sections import choice_section as section

    settings = _settings(config)
    drawn = build_folder() / "choice.png"
    for path in section.pages(repository_root()) if write else (drawn,):
        check_writable(path)
    with _bar("scenes", 1) as progress:
        figures = section.ways({"config": plain(settings), "lines": section.LINES}, SEED)
        progress(1)
    ways = section.ranked(settings, figures)
    _console().print(section.sheet(ways).terminal("Ways to a point"))
    drawn.write_bytes(section.picture(ways))
    _console().print(f"{drawn}: drawn", highlight=False)
    for path in section.write(settings, figures, repository_root()) if write else ():
        _console().print(f"{path}: rewritten", highlight=False)


@bench.command("report")
def bench_report(
    out: Annotated[
        Path | None, typer.Option(help="Folder for index.html, its tables and pictures.")
    ] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Use a tenth of the lines, two scenes and no RTL."),
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Address of a Dask scheduler for the sweeps: tcp://HOST:PORT."
        ),
    ] = None,
    jobs: Annotated[int, typer.Option(help="Number of local processes; 0: one per processor.")] = 0,
    seed: Annotated[
        int | None, typer.Option(help="Seed of the sweeps' random numbers; default: a fixed one.")
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Write the page on speed against error: detectors, hard lines, instrument, growth."""
    from vrscan.engines.tools import build_folder
    from vrscan.study.bench import bench_report as report
    from vrscan.study.bench.cells import MOST_SEED
    from vrscan.study.bench.sections.section import Order

    _check_jobs(jobs)
    if seed is not None and not 0 <= seed <= MOST_SEED:
        raise InputError(f"--seed: must be 0 to {MOST_SEED} ({seed})")
    order = Order(_settings(config), report.SEED if seed is None else seed, quick)
    folder = build_folder() / "report" if out is None else out
    total, known = len(report.cells(order)), 0
    try:
        with _folder(folder):
            check_writable(folder / report.INDEX)
            with _bar("cells", total) as progress:

                def tell(done: int) -> None:
                    nonlocal known
                    known = done
                    progress(done)

                report.make(order, folder, scheduler=scheduler, jobs=jobs, progress=tell)
    except KeyboardInterrupt:
        raise InterruptError(
            f"interrupted; {known} of {total} cells are kept, the same command goes on there"
        ) from None
    _console().print(f"{folder / report.INDEX}: {total} cells", highlight=False, soft_wrap=True)


@bench.command("tune")
def bench_tune(
    count: Annotated[int, typer.Option("--lines", help="Number of lines per cell.")] = 2000,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of a Dask scheduler: tcp://HOST:PORT."),
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Search each detector's best parameter, for vrscan/detectors/catalogue.py."""
    from vrscan.engines.tools import build_folder
    from vrscan.study.bench import tune
    from vrscan.study.bench.bench_report import machine
    from vrscan.study.bench.keep import Keep
    from vrscan.study.bench.runner import run

    _check_count(count, 100)
    cells = tune.cells(_settings(config), count)
    keep = Keep(build_folder() / "bench", machine())
    with _bar("training cells", len(cells)) as progress:
        figures = run(cells, keep, scheduler=scheduler, progress=progress)
    _console().print(tune.table(tune.trials(figures)))


@app.command()
def replay(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="LINES",
            help="Recorded lines: .mcap, .npy, .npz, .png, .tif or a folder of pictures, or .csv "
            "of a logic analyser.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(help="File for the points: .csv, or any that export writes, by its ending."),
    ],
    angles: Annotated[
        Path | None,
        typer.Option(
            help="CSV file with angle_rad, and power, mirror_flags, time_s or y_mm, of each line."
        ),
    ] = None,
    columns: ColumnsOption = None,
    engine: EngineOption = Engine.RTL,
    jobs: JobsOption = 0,
    config: ConfigOption = None,
) -> None:
    """Turn recorded lines into points."""
    _check_jobs(jobs)
    suffix = check_suffix(out, (".csv", *clouds.SUFFIXES))
    settings = _settings(config, recording)
    taken: list[Table] = []  # of a format that needs the whole scan
    located = 0
    source = line_files.opened(recording, settings, angles, renamed(columns))
    with atomic_file(out) as file, source as recorded:
        engines.prepare(engine, settings)
        blocks = recorded.blocks(engines.BLOCK)
        jobs = engines.processes(engine, recorded.count, jobs)
        with contextlib.ExitStack() as stack:
            stack.enter_context(telling())
            into: Callable[[Any], object] = taken.append
            form: Callable[[Table], bytes] | None = None
            if suffix == ".csv":
                into, form = stack.enter_context(csv_file(file)), csv_rows
            elif suffix == ".ply":
                into, form = stack.enter_context(ply_file(file, out.parent)), ply_vertices
            progress = stack.enter_context(_bar(f"engine {engine}", recorded.count))
            for points in stack.enter_context(engines.streamed(engine, blocks, settings, jobs)):
                into(points if form is None else form(points))
                located += int(points.located.sum())
                progress(int(points.line[-1]) + 1)
        if taken:
            cloud = clouds.cloud(Table.joined(taken), name=str(recording))
            clouds.write(cloud, suffix, file, name=str(recording))
    print(f"{out}: {located} points of {recorded.count} lines")


@app.command()
def mirror(
    out: Annotated[
        Path, typer.Option(help="Table to write, .csv; a picture is written next to it.")
    ],
    seconds: Annotated[
        float | None,
        typer.Option(
            help="Mirror time from RUN on; default: 0.5, with --drift 3, with --replay all."
        ),
    ] = None,
    drift: Annotated[
        float, typer.Option(help="Change of the natural frequency 0.1 s after RUN, Hz.")
    ] = 0.0,
    shock: Annotated[
        float, typer.Option(help="Change of the mirror's velocity 0.1 s after RUN, rad/s.")
    ] = 0.0,
    jitter_ns: Annotated[
        float | None,
        typer.Option(help="Rms jitter of the index comparator; default: mems.jitter_ns."),
    ] = None,
    drop: Annotated[
        int, typer.Option(help="Lose every n-th pass over the index, from 0.1 s after RUN on.")
    ] = 0,
    recording: Annotated[
        Path | None,
        typer.Option(
            "--replay",
            metavar="EDGES",
            help="Recorded index edges, .csv or .mcap, used instead of a mirror.",
        ),
    ] = None,
    columns: ColumnsOption = None,
    config: ConfigOption = None,
) -> None:
    """Run the RTL's mirror loop against the simulated mirror, or on recorded index edges."""
    from vrscan.study.report import mirror_report as report

    check_suffix(out, (".csv",))  # a .png would be overwritten by the picture
    settings = _mirror_settings(config, jitter_ns)
    check_range("--drift", drift, -100.0, 100.0)
    check_range("--shock", shock, -1000.0, 1000.0)
    if drop < 0 or drop == 1:
        raise InputError(f"--drop: must be 0 for none, or 2 or more ({drop})")
    if seconds is not None:
        check_range("--seconds", seconds, 0.001, MOST_SECONDS)
    events = report.Events(drift_hz=drift, shock_rad_per_s=shock, drop_every=drop)
    if recording is not None:
        if events.any or jitter_ns is not None:
            raise InputError("--replay: no --drift, --shock, --drop or --jitter-ns with it")
        with telling():
            rows, amplitude, last = report.read_edges(recording, settings, renamed(columns))
        length = last if seconds is None else min(seconds, last)
        check_range(f"{recording}: last time_s", length, 0.0, MOST_SECONDS)
        title = f"Mirror: {recording.name}, {length:.3f} s"
    else:
        length = (3.0 if drift else 0.5) if seconds is None else seconds
        title = f"Mirror: start and {length:g} s of RUN{_happening(events)}"
    started = time.perf_counter()
    with atomic_file(out) as csv, atomic_file(out.with_suffix(".png")) as png:
        start = report.START_S + settings.mirror.sweep_span_hz / settings.mirror.sweep_hz_per_s
        whole = length if recording is not None else length + start
        what = "recorded edges" if recording is not None else "start and run"
        with _bar(f"{what}, us of mirror time", round(1e6 * whole)) as progress:
            if recording is not None:
                run = report.replay(settings, rows, amplitude, length, progress)
            else:
                run = report.simulate(settings, length, events, progress)
        summary = report.summarise(run)
        report.write_csv(run, csv)
        report.picture(run, summary, title, png)
    console = _console()
    console.print(report.table(run, summary, title))
    wall = time.perf_counter() - started
    console.print(f"{run.end_s:.3f} s of mirror time in {wall:.1f} s")
    console.print(f"{out}, {out.with_suffix('.png')}", highlight=False)
    if run.fault and recording is None:
        raise typer.Exit(1)


@app.command()
def board(
    scene: SceneArgument = "default",
    port: Annotated[
        Path | None,
        typer.Option(
            "--port-file", help="Symbolic link to the serial port; default: build/board/port."
        ),
    ] = None,
    swinging: Annotated[
        bool, typer.Option("--swinging", help="Start with the mirror at its working point.")
    ] = False,
    seconds: Annotated[
        float | None,
        typer.Option(help="Simulated time after which the board stops; default: never."),
    ] = None,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Run no faster than real time.")
    ] = False,
    clock_hz: Annotated[
        float | None,
        typer.Option(help="Clock of the board; default: the configuration's, or 100 MHz."),
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Simulate a board before a scene, with a serial port to talk to it, until it is stopped."""
    from vrscan.engines import board as virtual
    from vrscan.engines.tools import build_folder
    from vrscan.scene.description import load
    from vrscan.scene.library import ANGLES, renderer

    if os.name == "nt":
        raise InputError("board: its serial port is a pseudoterminal, which Windows has none of")
    settings = virtual.on_board(_settings(config))
    if clock_hz is not None:
        check_range("--clock-hz", clock_hz, 1e6, 1e9)
        clock = settings.clock.model_copy(update={"frequency_hz": clock_hz})
        settings = settings.model_copy(update={"clock": clock})
    if seconds is not None:
        check_range("--seconds", seconds, 1e-6, 1e6)
    _with_lines(settings)
    where = build_folder() / "board" / "port" if port is None else port
    _question(
        renderer(load(scene), settings).light
    )  # raises its errors before a bar or a build begins
    virtual.make_folder(where)
    loaded = config is not None
    virtual.build(settings, loaded=loaded)
    with _bar("scene", ANGLES) as progress:
        words = virtual.command(
            scene,
            settings,
            where,
            swinging=swinging,
            seconds=seconds,
            real_time=real_time,
            loaded=loaded,
            progress=progress,
        )
        progress(ANGLES)
    os.execv(words[0], words)


def _happening(events: "MirrorEvents") -> str:
    """Return the events of a run, for its title."""
    parts = []
    if events.drift_hz:
        parts.append(f"natural frequency {events.drift_hz:+g} Hz")
    if events.shock_rad_per_s:
        parts.append(f"shock of {events.shock_rad_per_s:g} rad/s")
    if events.drop_every:
        parts.append(f"one index pass of {events.drop_every} lost")
    return "".join(f", {part}" for part in parts)


def _mirror_settings(path: Path | None, jitter_ns: float | None) -> Config:
    """Return the configuration with the jitter that was asked for."""
    settings = configuration.load(path)
    if jitter_ns is None:
        return settings
    check_range("--jitter-ns", jitter_ns, 0.0, 1e6)
    mems = settings.mems.model_copy(update={"jitter_ns": jitter_ns})
    return settings.model_copy(update={"mems": mems})


@app.command()
def efficiency(
    engine: EngineOption = Engine.FIXED,
    count: Annotated[int, typer.Option("--lines", help="Number of lines per cell.")] = 4000,
    jobs: Annotated[int, typer.Option(help="Number of processes; 0: one per processor.")] = 0,
    config: ConfigOption = None,
) -> None:
    """Compare the detector with the Cramer-Rao bound; exit status 1 below the stated figures."""
    from vrscan.study.report import efficiency as report
    from vrscan.study.report import numbers
    from vrscan.study.report import speckle_report as speckle
    from vrscan.study.report import two_pass_report as two_pass

    _check_count(count, 100)
    _check_jobs(jobs)
    settings = _settings(config)
    engines.prepare(engine, settings)
    cores = jobs or processors()
    with _bar("spots", len(report.PEAKS) * len(report.SIGMAS_PX)) as progress:
        cells = report.study(engine, settings, count, progress, jobs=cores)
    with _bar("two passes", len(two_pass.PEAKS) * len(two_pass.SIGMAS_PX) + 2) as progress:
        both = two_pass.study(engine, settings, count, progress, jobs=cores)
        one, two = two_pass.skew_positions(engine, settings, count // 2)
        progress(len(both) + 1)
        slopes = two_pass.slope_study(engine, settings, count // 4)
        progress(len(both) + 2)
    with _bar("speckled lines", speckle.SPOTS) as progress:
        speckled = speckle.study(engine, settings, count // 2, progress, jobs=cores)
    console = _console()
    console.print(report.efficiency_table(cells, engine, count))
    console.print(two_pass.efficiency_grid(both, engine, count))
    console.print(two_pass.skew_grid(one, two))
    console.print(two_pass.slope_grid(slopes))
    console.print(speckle.speckle_table(speckled, engine, count // 2))
    figures = numbers.efficiency_figures(cells)
    figures += numbers.two_pass_figures(both, (one, two), slopes)
    figures += numbers.speckle_figures(speckled)
    console.print(numbers.table(figures))
    if not all(figure.passes for figure in figures):
        raise typer.Exit(1)


@app.command()
def speed(
    engine: Annotated[
        Engine | None, typer.Option(help="Engine to measure; default: all three.")
    ] = None,
    count: Annotated[
        int | None,
        typer.Option("--lines", help="Number of lines; default: 10000, for the RTL 2000."),
    ] = None,
    jobs: Annotated[
        int, typer.Option(help="Number of cores of the second measurement; 0: all.")
    ] = 0,
    config: ConfigOption = None,
) -> None:
    """Measure the lines per second of the engines, on one core and on all, and of recordings."""
    from vrscan.study.report import speed as report

    if count is not None:
        _check_count(count, 1)
    _check_jobs(jobs)
    settings = _settings(config)
    chosen = list(Engine) if engine is None else [engine]
    rates = []
    with _bar("engines", len(chosen)) as progress:
        for each in chosen:
            rates.append(report.measure(each, settings, count, jobs or None))
            progress(len(rates))
    kept = report.recorded(settings, count or report.LINES[Engine.IDEAL])
    _console().print(report.table(rates))
    _console().print(report.recorded_table(kept))


@app.command()
def numbers(
    out: Annotated[
        Path | None,
        typer.Option("--csv", help="File for the figures; default: build/numbers/numbers.csv."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Do a tenth of the work, without the RTL.")
    ] = False,
    write: Annotated[
        bool, typer.Option("--write", help="Rewrite the tables of README.md and docs/numbers.md.")
    ] = False,
    only: Annotated[
        str,
        typer.Option(
            help="Measure only figures that begin with this: mirror, position, latency, ..."
        ),
    ] = "",
) -> None:
    """Measure accuracy, efficiency, latency and speed; exit status 1 if a figure fails."""
    from vrscan.engines.tools import build_folder, repository_root
    from vrscan.study.report import numbers as report

    if write and (quick or only):
        raise InputError(f"--write: needs all of it ({'--quick' if quick else '--only'} is given)")
    stages = report.stages(report.QUICK if quick else report.FULL)
    chosen = [stage for stage in stages if stage.name.startswith(only)]
    if not chosen:
        names = ", ".join(stage.name for stage in stages)
        raise InputError(f"--only: nothing begins with {only!r}; there are {names}")
    for path in report.pages(repository_root()) if write else ():
        check_writable(path)
    if out is None:
        out = build_folder() / "numbers" / "numbers.csv"
        out.parent.mkdir(exist_ok=True)
    figures = []
    with atomic_file(out) as file:
        for stage in chosen:
            with _bar(stage.name, stage.steps) as progress:
                figures += stage.run(progress)
                progress(stage.steps)
        _console().print(report.table(figures))
        file.write(report.sheet(figures).csv())
    for path in report.write_pages(figures, repository_root()) if write else ():
        _console().print(f"{path}: tables rewritten", highlight=False)
    failed = [figure for figure in figures if not figure.passes]
    for figure in failed:
        print(f"vrscan: {figure.group}: {figure.name}: FAIL", file=sys.stderr)
    if failed:
        raise typer.Exit(1)


def _with_lines(settings: Config) -> Config:
    """Return a configuration whose lines are to come, after checking that they can."""
    complaint = settings.rate_complaint()
    if complaint:
        raise InputError(f"{settings.source}: {complaint}")
    return settings


def _settings(path: Path | None, recording: Path | None = None) -> Config:
    """Return the configuration, by default a recording's; it is checked to fit the registers."""
    settings = configuration.load(path) if recording is None else read_config(recording, path)
    Registers.from_config(settings)
    return settings


def _planned(
    scene: str,
    count: int,
    fidelity: str | None,
    tolerance: float | None,
    settings: Config,
    *,
    each: bool = False,
    instrument: Path | None = None,
    engine: Engine | None = None,
) -> tuple["Light", "Plan"]:
    """Return a scene and its plan of effects, which is made while a bar is shown.

    An engine is prepared before, once the scene is known to be good.
    """
    from vrscan.scene import effects
    from vrscan.scene.description import load, load_instrument
    from vrscan.scene.light import Light
    from vrscan.study.plan import plan, survey

    if tolerance is not None:
        check_range("--tolerance", tolerance, 1e-6, 10.0)
    wanted: str | list[str] | None = fidelity
    if fidelity is not None and fidelity not in ("auto", "full", "minimal"):
        wanted = [name.strip() for name in fidelity.split(",")]
    with telling():
        described = load(scene)
    if instrument is not None:
        own = {"instrument": load_instrument(instrument)}
        described = described.model_copy(update=own)
    light = Light(described, settings)
    for names, source in ((wanted, "--fidelity"), (light.scene.fidelity, light.scene.source)):
        if isinstance(names, list):
            effects.chosen(names, source)  # raises its errors before a bar is shown
    _question(light)
    if engine is not None:
        engines.prepare(engine, settings)
    seen = survey(light, count)
    with _bar("budget", 100) as progress:
        found = plan(
            light,
            count,
            fidelity=wanted,
            tolerance_px=tolerance,
            each=each,
            seen=seen,
            progress=lambda done, total: progress(100 * done // total),
        )
        progress(100)
    return light, found


def _question(light: "Light") -> None:
    """Print a line on the error stream for each value of a scene that hardly anybody means."""
    from vrscan.scene.doubts import doubts

    for line in doubts(light):
        print(f"vrscan: {light.scene.source}: {line}", file=sys.stderr)


def _check_jobs(jobs: int) -> None:
    if jobs < 0:
        raise InputError(f"--jobs: must not be negative ({jobs})")


def _check_count(count: int, least: int, most: int = MOST_LINES) -> None:
    if not least <= count <= most:
        raise InputError(f"--lines: must be {least} to {most} ({count})")


@contextlib.contextmanager
def _folder(path: Path) -> Iterator[None]:
    """Make the folder if it does not exist, and remove it again if the block fails.

    What a command that was killed has left in it goes, and no other command writes there meanwhile.
    """
    made = not path.exists()
    try:
        path.mkdir(exist_ok=True)
        place = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise InputError(f"{path}: cannot make the folder ({error.strerror})") from error
    try:
        _taken(path, place)
        for left in unfinished(path):
            left.unlink()
        yield
    except BaseException:
        if made:
            with contextlib.suppress(OSError):
                for left in unfinished(path):
                    left.unlink()
                path.rmdir()
        raise
    finally:
        os.close(place)


def _taken(path: Path, place: int) -> None:
    """Take a folder for this command, until its descriptor is closed."""
    try:
        import fcntl
    except ModuleNotFoundError:  # of another system
        return
    try:
        fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise InputError(f"{path}: another command writes there") from error


# How `vrscan --help` groups the commands, in this order.
PANELS = {
    "From light to points": ("scan", "replay", "mirror"),
    "Another scanner": ("new", "config"),
    "Boards": ("board", "link", "view"),
    "Calibration": ("calibrate",),
    "Points in other programs": ("export", "filter"),
    "Light": ("budget", "stray", "detectability"),
    "Figures of merit": ("numbers", "efficiency", "cases", "speed", "bench", "report"),
}

group(app, PANELS)


def main() -> None:
    """Run the command; every error of the user becomes one line on the error stream."""
    signal.signal(
        signal.SIGTERM, lambda *_: sys.exit(EXIT_TERMINATED)
    )  # lets temporary files be removed
    try:
        with named():
            status = app(sys.argv[1:] or ["--help"], prog_name="vrscan", standalone_mode=False)
        if status == EXIT_INTERRUPTED:
            _complain("interrupted")
    except InputError as error:
        status = _complain(str(error))
    except InterruptError as error:
        _complain(str(error))
        status = EXIT_INTERRUPTED
    except typer.TyperException as error:  # an unknown option, a missing argument
        text = error.format_message().replace("Value error, ", "")
        context = getattr(error, "ctx", None)
        if context is not None and text == "Missing command.":
            names = ", ".join(context.command.commands)
            text = f"{context.command_path.removeprefix('vrscan ')}: which command? {names}"
        if isinstance(error.__cause__, ValidationError):
            text = f"{text} ({error.__cause__.errors()[0]['input']})"
        status = _complain(text)
    sys.exit(status)


def _complain(text: str) -> int:
    """Print one line on the error stream and return the exit status."""
    print(f"vrscan: {' '.join(text.split())}", file=sys.stderr)
    return EXIT_BAD_INPUT
