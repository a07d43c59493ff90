"""What commands refuse of their options."""

from pathlib import Path
from typing import Annotated

import typer

from vrscan.data.csv_files import plain_name
from vrscan.data.errors import InputError, shown

ColumnsOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME=COLUMN,...",
        help="Names of a logic analyser's columns, as comparator=Channel 0,gate=Channel 1.",
    ),
]


def check_range(name: str, value: float, low: float, high: float) -> None:
    """Raise an error, which names the option, unless its value is within a range."""
    if not low <= value <= high:  # also refuses NaN
        raise InputError(f"{name}: must be {low:g} to {high:g} ({value:g})")


def check_suffix(path: Path | None, known: tuple[str, ...]) -> str:
    """Return the suffix of a file's name, which has to be a known one."""
    if path is None:
        return ""
    if path.suffix not in known:
        raise InputError(f"{path}: must end in {' or '.join(known)}")
    return path.suffix


def renamed(option: str | None) -> dict[str, str]:
    """Return which column of a file is meant by which name.

    Args:
        option: As ``comparator=Channel 0,gate=Channel 1``; None for none.

    Raises:
        InputError: if it is of another form.
    """
    pairs = [pair.partition("=") for pair in option.split(",")] if option else []
    if not all(own.strip() and theirs.strip() for own, _, theirs in pairs):
        raise InputError(f"--columns: want NAME=COLUMN,... ({shown(option)})")
    return {plain_name(own): theirs for own, _, theirs in pairs}
