"""The page: blocks of text, tables and pictures, and the one file that holds them all.

Every table row has an id, so that other pages can link to ``index.html#id``. Nothing is fetched
from elsewhere: styles are in the head and pictures in the text. The same tables as CSV and the same
pictures as PNG are written next to the page.
"""

import base64
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic

from vrscan.show.sheet import Row, Sheet, template
from vrscan.show.style import INK, LIGHT, QUIET


def slug(text: str) -> str:
    """Return a text as an id: lower case, digits, points and hyphens."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-")


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    body: str


@dataclass(frozen=True)
class Heading:
    """A heading within a section."""

    kind: ClassVar[str] = "heading"
    key: str
    title: str


@dataclass(frozen=True)
class Picture:
    """A picture, embedded and written as ``name``.png."""

    kind: ClassVar[str] = "picture"
    name: str
    png: bytes
    caption: str

    @property
    def data(self) -> str:
        """The file as text that a page can hold."""
        return base64.b64encode(self.png).decode()


@dataclass(frozen=True)
class Table(Generic[Row]):
    """A table, shown in short and written in full as ``name``.csv.

    Attributes:
        name: Name of the file.
        sheet: The table that is shown.
        caption: Text that says what it shows and how to read it.
        key: Returns the id of a row on the page.
        bold: Returns whether a row is the shipped configuration's.
        full: Table of the file; ``sheet`` where None.
    """

    kind: ClassVar[str] = "table"
    name: str
    sheet: Sheet[Row]
    caption: str
    key: Callable[[Row], str]
    bold: Callable[[Row], bool] | None = None
    full: Sheet[Any] | None = None

    @property
    def html(self) -> str:
        """The table that is shown."""
        return self.sheet.html(self.key, self.bold)

    @property
    def csv(self) -> bytes:
        """The file."""
        return (self.full or self.sheet).csv()


@dataclass(frozen=True)
class Attachment:
    """A file beside the page, to which the page links."""

    kind: ClassVar[str] = "attachment"
    name: str
    data: bytes


Block = Text | Heading | Picture | Table[Row] | Attachment


@dataclass(frozen=True)
class Part:
    """A section in the form in which it is shown."""

    key: str
    title: str
    blocks: Sequence[Block[Any]]


def page(title: str, lead: str, facts: Iterable[tuple[str, str]], parts: Sequence[Part]) -> str:
    """Return the page.

    Args:
        title: Heading of the page.
        lead: Text that says what the page is.
        facts: Names and values of how it was made.
        parts: The sections.

    Raises:
        ValueError: if two elements on it have the same id.
    """
    text = template("vrscan.study.bench", "page.html.j2").render(
        title=title, lead=lead, facts=facts, parts=parts, ink=INK, light=LIGHT, quiet=QUIET
    )
    ids = re.findall(r' id="([^"]*)"', text)
    twice = sorted({name for name in ids if ids.count(name) > 1})
    if twice:
        raise ValueError(f"ids that are there twice: {', '.join(twice)}")
    return text


def files(parts: Iterable[Part]) -> dict[str, bytes]:
    """Return the files next to the page by name.

    Raises:
        ValueError: if two have the same name.
    """
    found: dict[str, bytes] = {}
    for block in (block for part in parts for block in part.blocks):
        if isinstance(block, Picture):
            name, data = f"{block.name}.png", block.png
        elif isinstance(block, Table):
            name, data = f"{block.name}.csv", block.csv
        elif isinstance(block, Attachment):
            name, data = block.name, block.data
        else:
            continue
        if name in found:
            raise ValueError(f"two files {name}")
        found[name] = data
    return found
