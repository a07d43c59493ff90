"""The command ``vrscan bench report``: computes the cells of all sections and writes the page."""

import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from vrscan.data.config import Config
from vrscan.data.points import atomic_file
from vrscan.engines.tools import build_folder
from vrscan.study.bench import bench_page as page
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.keep import Keep
from vrscan.study.bench.runner import run
from vrscan.study.bench.sections import ALL
from vrscan.study.bench.sections.section import Order, Section
from vrscan.study.progress import Progress

SEED = 20_260_611
INDEX = "index.html"


def machine() -> str:
    """Return the machine on which times are measured: processor, processors, system and Python."""
    model = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next(x.partition(":")[2].strip() for x in lines if x.startswith("model name"))
    except (OSError, StopIteration):
        pass
    cores = os.cpu_count() or 1
    return f"{model}, {cores} processors, {platform.system()}, Python {platform.python_version()}"


def cells(order: Order, sections: Sequence[Section] = ALL) -> list[Cell]:
    """Return every cell that the sections need, each once."""
    found: dict[str, Cell] = {}
    for section in sections:
        for cell in section.cells(order):
            found.setdefault(cell.key(), cell)
    return list(found.values())


def make(
    order: Order,
    out: Path,
    *,
    scheduler: str | None = None,
    jobs: int = 0,
    progress: Progress | None = None,
    sections: Sequence[Section] = ALL,
    kept: Path | None = None,
) -> list[Path]:
    """Compute the cells that are not kept, and write page, tables and pictures; return the files.

    Args:
        order: The order that is given to all sections.
        out: Folder of the page; it exists.
        scheduler: Address of a Dask scheduler; without one, local processes are used.
        jobs: Number of local processes; 0 is one for each processor.
        progress: Called with the number of cells done so far, of ``cells``.
        sections: Sections of the page.
        kept: Folder of the computed cells; build/bench if None.

    Raises:
        InputError: if the folder cannot be written, or as ``runner.run``.
    """
    begin = datetime.now(UTC)
    keep = Keep(build_folder() / "bench" if kept is None else kept, machine())
    wanted = cells(order, sections)
    done = run(wanted, keep, scheduler=scheduler, jobs=jobs, progress=progress)
    figures = {cell.key(): found for cell, found in zip(wanted, done, strict=True)}

    def found(cell: Cell) -> Figures:
        return figures[cell.key()]

    parts = [page.Part(s.key, s.title, s.blocks(order, found)) for s in sections]
    text = page.page(
        "Speed against error",
        "How far each detector of a laser line is from the physical limit, at what cost, and what "
        "it does when the line is ugly; then the same of the whole instrument. Every figure is "
        "measured by this run, none in a test; every table row can be linked to.",
        facts(order, begin, len(wanted), scheduler),
        parts,
    )
    written = {**page.files(parts), INDEX: text.encode()}  # the page last: its files exist
    for name, data in written.items():
        with atomic_file(out / name) as file:
            file.write(data)
    return [out / name for name in written]


def facts(
    order: Order, begin: datetime, count: int, scheduler: str | None
) -> list[tuple[str, str]]:
    """Return the circumstances of its making for the head of the page."""
    changed = changes(order.config)
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "scipy"))
    where = f"Dask cluster at {scheduler}" if scheduler else "all processors of this machine"
    return [
        ("Date", begin.strftime("%Y-%m-%d %H:%M UTC")),
        ("Machine", f"{machine()}, {versions}"),
        ("Sweeps ran on", f"{where}; {count} cells, kept ones among them"),
        ("Size", "quick: a tenth of the lines, less of everything" if order.quick else "full"),
        ("Seed", f"{order.seed}; the shipped scenes have their own, in their files"),
        ("Configuration", "; ".join([order.config.source, *changed])),
    ]


def changes(config: Config) -> list[str]:
    """Return the values of a configuration that differ from the shipped ones."""
    shipped: dict[str, Any] = Config().model_dump()
    found = []
    for section, values in config.model_dump().items():
        for name, value in values.items():
            if value != shipped[section][name]:
                found.append(f"{section}.{name} = {value}")
    return found
