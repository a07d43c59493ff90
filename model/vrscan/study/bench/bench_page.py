"""The page: blocks of text, tables and pictures, and the one file that holds them all.

Every table row has an id, so that other pages can link to ``index.html#id``. Nothing is fetched
from elsewhere: styles are in the head and pictures in the text. The same tables as CSV and the same
pictures as PNG are written next to the page.
"""

import base64
import csv
import html
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from vrscan.show.style import INK, LIGHT, QUIET

Value = str | int | float | None


def slug(text: str) -> str:
    """Return a text as an id: lower case, digits, points and hyphens."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-")


@dataclass(frozen=True)
class Text:
    """A paragraph; ``body`` is HTML."""

    body: str


@dataclass(frozen=True)
class Heading:
    """A heading within a section."""

    key: str
    title: str


@dataclass(frozen=True)
class Picture:
    """A picture, embedded and written as ``name``.png."""

    name: str
    png: bytes
    caption: str


@dataclass(frozen=True)
class Row:
    """A row of a table: its id on the page, the cells that are shown, and their tone.

    ``bold`` marks the shipped configuration.
    """

    key: str
    cells: Sequence[str]
    bold: bool = False


@dataclass(frozen=True)
class Table:
    """A table, shown in short and written in full as ``name``.csv.

    Attributes:
        name: Name of the file.
        headings: Headings of the columns shown; a line break in one is kept.
        rows: Rows that are shown.
        caption: Text that describes the table.
        columns: Columns of the file.
        values: Rows of the file; None stays empty.
    """

    name: str
    headings: Sequence[str]
    rows: Sequence[Row]
    caption: str
    columns: Sequence[str]
    values: Sequence[Sequence[Value]] = field(default=())


@dataclass(frozen=True)
class Attachment:
    """A file next to the page that no block shows."""

    name: str
    data: bytes


Block = Text | Heading | Picture | Table | Attachment


@dataclass(frozen=True)
class Part:
    """A section in the form in which it is shown."""

    key: str
    title: str
    blocks: Sequence[Block]


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with this many digits, without an exponent where that is readable."""
    if value is None or value != value:  # NaN
        return "-"
    if value in (float("inf"), float("-inf")):
        return "∞"
    if value == 0.0:
        return "0"
    size = abs(value)
    if size >= 10 ** (digits - 1):
        return f"{value:,.0f}"
    if size < 1e-4:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{digits}g}"


def csv_text(table: Table) -> bytes:
    """Return the contents of a table's file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    for row in table.values:
        writer.writerow(
            "" if v is None or v != v else f"{v:.6g}" if isinstance(v, float) else v for v in row
        )
    return text.getvalue().encode()


_STYLE = f"""
:root {{ color: {INK}; background: #fff; font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; }}
body {{ max-width: 1260px; margin: 2rem auto; padding: 0 1.2rem; }}
h1 {{ font-size: 1.6rem; margin-bottom: .2rem; }}
h2 {{ font-size: 1.25rem; margin-top: 2.6rem; border-top: 2px solid {LIGHT}; padding-top: .8rem; }}
h3 {{ font-size: 1.02rem; margin: 1.8rem 0 .3rem; }}
p {{ max-width: 56rem; margin: .5rem 0; }}
a {{ color: #2a6f97; }}
dl {{ display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; }}
dt {{ color: {QUIET}; }} dd {{ margin: 0; }}
nav ol {{ columns: 2; max-width: 56rem; }} nav ul {{ padding-left: 1.1rem; }}
figure {{ margin: 1rem 0; }} figure img {{ max-width: 100%; height: auto; }}
figcaption, .note {{ color: #52606d; font-size: .87rem; max-width: 60rem; }}
.wide {{ overflow-x: auto; margin: .8rem 0 .3rem; }}
table {{ border-collapse: collapse; font-size: .8rem; font-variant-numeric: tabular-nums; }}
th {{ text-align: right; vertical-align: bottom; white-space: pre; font-weight: 600;
  border-bottom: 1px solid {QUIET}; padding: .15rem .42rem; }}
td {{ text-align: right; padding: .12rem .42rem; border-bottom: 1px solid #eef1f4; }}
th:first-child, td:first-child {{ text-align: left; }}
td {{ white-space: nowrap; }}
th.words, td.words {{ text-align: left; }}
td.words {{ white-space: normal; min-width: 16rem; }}
tr.bold td {{ font-weight: 600; background: #f3f7fa; }}
tr:target td {{ background: #fff3cd; }}
td a {{ color: inherit; text-decoration: none; }}
@media print {{ h2 {{ break-before: page; }} }}
"""

_LONG = 26  # characters: a cell of words, not of numbers


def _table(table: Table) -> str:
    # A column has words where any of its cells is a phrase; the first column has its own style.
    texts = {k for row in table.rows for k, cell in enumerate(row.cells) if k and len(cell) > _LONG}
    kinds = [' class="words"' if k in texts else "" for k in range(len(table.headings))]
    head = "".join(
        f"<th{kind}>{html.escape(text)}</th>"
        for kind, text in zip(kinds, table.headings, strict=True)
    )
    body = []
    for row in table.rows:
        cells = []
        for index, cell in enumerate(row.cells):
            shown = html.escape(cell)
            if index == 0:
                shown = f'<a href="#{row.key}">{shown}</a>'
            cells.append(f"<td{kinds[index]}>{shown}</td>")
        mark = ' class="bold"' if row.bold else ""
        body.append(f'<tr id="{row.key}"{mark}>{"".join(cells)}</tr>')
    return (
        f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>\n'
        + "\n".join(body)
        + f'\n</tbody></table></div>\n<p class="note">{table.caption} '
        f'<a href="{table.name}.csv">{table.name}.csv</a></p>'
    )


def _block(block: Block) -> str:
    if isinstance(block, Text):
        return f"<p>{block.body}</p>"
    if isinstance(block, Heading):
        return f'<h3 id="{block.key}">{html.escape(block.title)}</h3>'
    if isinstance(block, Picture):
        data = base64.b64encode(block.png).decode()
        return (
            f'<figure id="{block.name}"><img alt="{html.escape(block.caption)}" '
            f'src="data:image/png;base64,{data}"><figcaption>{block.caption}</figcaption></figure>'
        )
    if isinstance(block, Table):
        return _table(block)
    return ""


def _contents(parts: Iterable[Part]) -> str:
    items = []
    for part in parts:
        inner = "".join(
            f'<li><a href="#{b.key}">{html.escape(b.title)}</a></li>'
            for b in part.blocks
            if isinstance(b, Heading)
        )
        inner = f"<ul>{inner}</ul>" if inner else ""
        items.append(f'<li><a href="#{part.key}">{html.escape(part.title)}</a>{inner}</li>')
    return f"<nav><ol>{''.join(items)}</ol></nav>"


def page(title: str, lead: str, facts: Iterable[tuple[str, str]], parts: Sequence[Part]) -> str:
    """Return the page.

    Args:
        title: Heading of the page.
        lead: Introduction, as HTML.
        facts: Names and values of the circumstances of its making.
        parts: The sections.

    Raises:
        ValueError: if two elements on it have the same id.
    """
    rows = "".join(f"<dt>{html.escape(a)}</dt><dd>{html.escape(b)}</dd>" for a, b in facts)
    body = "\n".join(
        f'<section><h2 id="{part.key}">{html.escape(part.title)}</h2>\n'
        + "\n".join(map(_block, part.blocks))
        + "</section>"
        for part in parts
    )
    ids = re.findall(r' id="([^"]*)"', body)
    twice = sorted({name for name in ids if ids.count(name) > 1})
    if twice:
        raise ValueError(f"ids that are there twice: {', '.join(twice)}")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head><body>\n"
        f"<h1>{html.escape(title)}</h1>\n<p>{lead}</p>\n<dl>{rows}</dl>\n{_contents(parts)}\n"
        f"{body}\n</body></html>\n"
    )


def files(parts: Iterable[Part]) -> dict[str, bytes]:
    """Return the files next to the page by name.

    Raises:
        ValueError: if two have the same name.
    """
    found: dict[str, bytes] = {}
    for part in parts:
        for block in part.blocks:
            if isinstance(block, Picture):
                name, data = f"{block.name}.png", block.png
            elif isinstance(block, Table):
                name, data = f"{block.name}.csv", csv_text(block)
            elif isinstance(block, Attachment):
                name, data = block.name, block.data
            else:
                continue
            if name in found:
                raise ValueError(f"two files {name}")
            found[name] = data
    return found
