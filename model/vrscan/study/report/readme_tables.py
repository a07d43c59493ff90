"""The README's generated tables: each figure is a link to its row of the benchmark's page."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PAGE = "build/report/index.html"
MAKERS = {  # of each table, by the name of its markers
    "numbers": "vrscan numbers --write",
    "timing": "scripts/timing.py --write",
    "bitstream": "make bitstream BOARD=ulx3s ARGS=--write",
}
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


@dataclass(frozen=True)
class Shown:
    """A table of the README.

    Attributes:
        name: Of its markers.
        headings: Of its columns; the first is of the figures' names.
        rows: Its cells, without links.
    """

    name: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def slug(text: str) -> str:
    """Return a text as an id: lower case, digits, points and hyphens."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-")


def row_id(table: str, label: str) -> str:
    """Return the id of a figure's row on the page."""
    return f"readme-{table}-{slug(label)}"


def linked(table: str, label: str) -> str:
    """Return a figure's name as a link to its row."""
    return f"[{label}]({PAGE}#{row_id(table, label)})"


def _cells(line: str) -> tuple[str, ...]:
    return tuple(_LINK.sub(r"\1", cell.strip()) for cell in line.strip().strip("|").split("|"))


def tables(readme: Path) -> Iterator[Shown]:
    """Yield the README's generated tables; one that has not been made yet has no rows.

    Args:
        readme: The file.

    Raises:
        OSError: if it cannot be read.
    """
    text = readme.read_text()
    for name in MAKERS:
        _, _, rest = text.partition(f"<!-- {name}: begin -->")
        block = rest.partition(f"<!-- {name}: end -->")[0]
        lines = [line for line in block.splitlines() if line.startswith("|")]
        if lines:
            yield Shown(name, _cells(lines[0]), tuple(_cells(line) for line in lines[2:]))
