"""The command ``vrscan cases``: the catalogue of hard cases, as a table and as a page."""

import sys
from typing import Annotated

import typer


def cases(
    write: Annotated[bool, typer.Option("--write", help="Rewrite docs/hard-cases.md.")] = False,
    only: Annotated[
        str, typer.Option(help="Show only cases that begin with this: plateau, rival, ...")
    ] = "",
) -> None:
    """Run the hard cases; exit status 1 if one is not as defined."""
    from rich.console import Console

    from vrscan.data.errors import InputError
    from vrscan.data.points import atomic_file, check_writable
    from vrscan.engines.tools import repository_root
    from vrscan.show.sheet import Sheet
    from vrscan.study.cases import case_page as page
    from vrscan.study.cases.registry import rooms

    if not any(case.name.startswith(only) for room in rooms().values() for case in room):
        raise InputError(f"--only: nothing begins with {only!r}")
    path = repository_root() / page.PAGE if write else None
    if path is not None:
        check_writable(path)
    outcomes = page.measure()
    console = Console()
    for title, room in rooms().items():
        table = page.sheet([case for case in room if case.name.startswith(only)], outcomes)
        if table.rows:
            shown = [table.columns[k] for k in (0, 3, 4, 5)]
            console.print(Sheet(shown, table.rows).terminal(title))
    if path is not None:
        before = path.read_text() if path.exists() else ""
        with atomic_file(path) as file:
            file.write(page.page(outcomes, before).encode())
        console.print(f"{path}: rewritten", highlight=False)
    failed = False
    for name, found in outcomes.items():
        for text in (text for outcome in found for text in outcome.wrong):
            print(f"vrscan: {name}: {text}", file=sys.stderr)
            failed = True
    if failed:
        raise typer.Exit(1)
