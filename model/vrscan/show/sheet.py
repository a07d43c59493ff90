"""A table is described once, by its columns: for the terminal, for files and for pages."""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cache, partial
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from rich import box
from rich.markup import escape
from rich.table import Table as RichTable
from rich.text import Text

from vrscan.data.points import atomic_file

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

Row = TypeVar("Row")
Value = str | int | float | None


@dataclass(frozen=True)
class Column(Generic[Row]):
    """A column of a table whose rows are objects of one kind.

    Attributes:
        heading: Text above it; None for a column that only files have.
        value: Returns the column's value in a row; None or NaN where there is none.
        form: Format of a number as it is shown, for ``str.format``, or a function of it; a text is
            shown as it is.
        name: Heading in a file; a column without a name is not in files.
        unit: Unit of what is shown, behind the heading.
        scale: Factor from the value to the number that is shown.
        align: Side at which the texts stand.
        kept: Format of a float in a file.
        wraps: Whether a long text may take several lines.
        absent: Text that is shown where there is no value, or a function of the row.
    """

    heading: str | None
    value: Callable[[Row], Value]
    form: str | Callable[[Any], str] = "{}"
    _: KW_ONLY
    name: str = ""
    unit: str = ""
    scale: float = 1.0
    align: Literal["left", "right"] = "right"
    kept: str = "{:.6g}"
    wraps: bool = False
    absent: str | Callable[[Row], str] = ""

    @property
    def title(self) -> str:
        """Heading with the unit."""
        return f"{self.heading} {self.unit}" if self.unit else self.heading or ""

    def text(self, row: Row) -> str:
        """Return what a row shows in this column."""
        value = self.value(row)
        if value is None or value != value:  # NaN
            return self.absent(row) if callable(self.absent) else self.absent
        if isinstance(value, str):
            return value
        shown = value if self.scale == 1.0 else self.scale * value
        return self.form(shown) if callable(self.form) else self.form.format(shown)

    def field(self, row: Row) -> Value:
        """Return what a file has of a row in this column."""
        value = self.value(row)
        if value is None or value != value:
            return ""
        return self.kept.format(value) if isinstance(value, float) else value


def words(heading: str, value: Callable[[Row], Value], **options: Any) -> Column[Row]:
    """Return a column of texts, which stand at the left."""
    return Column(heading, value, align="left", **options)


@dataclass(frozen=True)
class Sheet(Generic[Row]):
    """A table: columns, rows, and what rows belong together.

    Attributes:
        columns: The columns from left to right.
        rows: The objects that the columns take their values from.
        group: Returns the heading of a row's group, which stands above the first row that has it.
    """

    columns: Sequence[Column[Row]]
    rows: Sequence[Row]
    group: Callable[[Row], str] | None = None

    @property
    def shown(self) -> list[Column[Row]]:
        """Columns that are not of files alone."""
        return [column for column in self.columns if column.heading is not None]

    def texts(self, row: Row) -> list[str]:
        """Return what a row shows."""
        return [column.text(row) for column in self.shown]

    def terminal(
        self,
        title: str = "",
        caption: str | None = None,
        *,
        apart: Callable[[Row], object] | None = None,
        style: Callable[[Row], str] | None = None,
        gap: int = 1,
    ) -> RichTable:
        """Return the table for the terminal, which wastes no width: no frame around it.

        Args:
            title: Text above it.
            caption: Text below it.
            apart: Returns what rows that stand together have in common.
            style: Returns the style of a row.
            gap: Blanks between the columns, beside one.
        """
        grid = RichTable(
            title=escape(title) or None,
            caption=caption and escape(caption),
            title_justify="left",
            caption_justify="left",
            caption_style="",
            show_header=any(column.title for column in self.shown),
            box=box.SIMPLE_HEAD,
            show_edge=False,
            pad_edge=False,
            padding=(0, gap, 0, 0),
        )
        for column in self.shown:
            heading = Text(column.title)
            how: dict[str, Any] = {"no_wrap": not column.wraps, "justify": column.align}
            grid.add_column(heading, overflow="fold" if column.wraps else "ellipsis", **how)
        group, last = "", None
        for k, row in enumerate(self.rows):
            together = apart and apart(row)
            if k and together != last:
                grid.add_section()
            last = together
            if self.group is not None and self.group(row) != group:
                group = self.group(row)
                grid.add_section()
                grid.add_row(Text(group, style="bold"))
            grid.add_row(*map(Text, self.texts(row)), style=style and style(row))
        return grid

    def csv(self) -> bytes:
        """Return the file: the columns that have names, of all rows."""
        kept = [column for column in self.columns if column.name]
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([column.name for column in kept])
        writer.writerows([column.field(row) for column in kept] for row in self.rows)
        return text.getvalue().encode()

    def markdown(self) -> str:
        """Return the table for a page in Markdown, without a line break at its end."""
        marks = ["---" if column.align == "left" else "--:" for column in self.shown]
        lines = [_line([column.title for column in self.shown]), f"|{'|'.join(marks)}|"]
        group = ""
        for row in self.rows:
            if self.group is not None and self.group(row) != group:
                group = self.group(row)
                lines.append(f"| **{group}** |" + " |" * (len(marks) - 1))
            lines.append(_line(self.texts(row)))
        return "\n".join(lines)

    def html(
        self, key: Callable[[Row], str] = str, bold: Callable[[Row], bool] | None = None
    ) -> "Markup":
        """Return the table for a page in HTML.

        Args:
            key: Returns the id of a row, to which its first cell links.
            bold: Returns whether a row stands out.
        """
        from markupsafe import Markup

        rows = [(key(row), bold is not None and bold(row), self.texts(row)) for row in self.rows]
        sheet = template("vrscan.show", "sheet.html.j2")
        return Markup(sheet.render(columns=self.shown, rows=rows))


@cache
def template(package: str, name: str) -> "Template":
    """Return a template of HTML that lies in a package; what it is given is text, and escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader(package, "")
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined).get_template(name)


def _line(cells: Sequence[str]) -> str:
    """Return a row of a table in Markdown."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def listed(
    names: Sequence[str], rows: Sequence[Sequence[Value]], *, left: int = 0, kept: str = "{:.6g}"
) -> Sheet[Sequence[Value]]:
    """Return a table of rows that are values already.

    Args:
        names: Headings, and names in a file.
        rows: A value for each of them.
        left: Number of columns at the left whose texts stand at the left, too.
        kept: Format of a float in a file.
    """
    make: Any = partial(Column, kept=kept)
    columns = [
        make(name, itemgetter(k), name=name, align="left" if k < left else "right")
        for k, name in enumerate(names)
    ]
    return Sheet(columns, rows)


def short(value: float, room: int) -> str:
    """Return a number in ``room`` characters, one more if it is negative; decimals give way."""
    digits = len(str(int(abs(value))))
    shown = f"{value:.{max(room - 1 - digits, 0)}f}"
    return "0" if float(shown) == 0.0 else shown


def number(value: float | None, digits: int = 3) -> str:
    """Return a number to so many digits, without an exponent where that is readable."""
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


def block_of(text: str, name: str) -> str:
    """Return the block of that name in ``text`` with its markers, an empty one if it has none."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    _, found, rest = text.partition(begin)
    block, closed, _ = rest.partition(end)
    return f"{begin}{block}{end}" if found and closed else f"{begin}\n\n{end}"


def replace_block(text: str, name: str, block: str) -> str | None:
    """Return ``text`` with ``block`` between the markers of that name, or None without markers."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, found_begin, rest = text.partition(begin)
    _, found_end, after = rest.partition(end)
    if not (found_begin and found_end):
        return None
    return f"{before}{begin}\n\n{block}\n\n{end}{after}"


def rewrite(page: Path, blocks: Mapping[str, str]) -> bool:
    """Put blocks between their markers in a page.

    Returns:
        Whether the page is there and has the markers; else it stays as it is.
    """
    text = page.read_text() if page.exists() else ""
    for name, block in blocks.items():
        found = replace_block(text, name, block)
        if found is None:
            return False
        text = found
    with atomic_file(page) as file:
        file.write(text.encode())
    return True
