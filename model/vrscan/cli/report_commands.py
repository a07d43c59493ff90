"""The commands ``vrscan report``: pages of the documentation that are measured."""

from pathlib import Path
from typing import Annotated

import typer

report = typer.Typer(help="Write pages of measured figures.")


@report.callback()
def options() -> None:
    """Keep ``instrument`` a command of its own, though it is the only one."""


@report.command("instrument")
def report_instrument(
    experiment: Annotated[
        Path, typer.Argument(help="Folder that vrscan calibrate run-all has filled.")
    ],
    root: Annotated[
        Path | None, typer.Option(help="Folder that has docs; default: the repository.")
    ] = None,
) -> None:
    """Write docs/instrument.md and its pictures: the paper's tables, measured."""
    from vrscan.engines.tools import repository_root
    from vrscan.study.report import instrument_report

    for path in instrument_report.write(experiment, root or repository_root()):
        print(path)
