"""A table that is described once is the same on the terminal, in a file and on a page."""

import csv
import io
import math
from dataclasses import dataclass

import pytest
from rich.console import Console

from vrscan.show.sheet import Column, Sheet, listed, number, short, words


@dataclass(frozen=True)
class Size:
    name: str
    share: float | None
    count: int = 3


SIZES = [Size("a|b <[0]>", 0.123456789), Size("c", None), Size("d", math.nan, 12)]
COLUMNS: list[Column[Size]] = [
    words("name", lambda size: size.name, name="name"),
    Column("share", lambda size: size.share, "{:.1f} %", unit="of it", scale=100, name="share",
           absent="-"),
    Column(None, lambda size: size.count, name="count"),
    Column("counted", lambda size: size.count, lambda count: f"{count} times"),
]  # fmt: skip
SHEET = Sheet(COLUMNS, SIZES)


def test_a_file_has_the_named_columns_in_full() -> None:
    rows = list(csv.reader(io.StringIO(SHEET.csv().decode())))
    assert rows[0] == ["name", "share", "count"]
    assert rows[1:] == [["a|b <[0]>", "0.123457", "3"], ["c", "", "3"], ["d", "", "12"]]


def test_a_page_in_markdown_has_the_shown_ones_and_no_bar_of_a_text() -> None:
    assert SHEET.markdown().splitlines() == [
        "| name | share of it | counted |",
        "|---|--:|--:|",
        "| a\\|b <[0]> | 12.3 % | 3 times |",
        "| c | - | 3 times |",
        "| d | - | 12 times |",
    ]


def test_a_page_in_html_escapes_and_links_each_row() -> None:
    text = SHEET.html(key=lambda size: f"row-{size.name[0]}", bold=lambda size: size.name == "c")
    assert '<tr id="row-a"><td><a href="#row-a">a|b &lt;[0]&gt;</a></td><td>12.3 %</td>' in text
    assert '<tr id="row-c" class="bold">' in text
    assert text.count("<th") - text.count("<thead") == 3


def test_a_terminal_shows_texts_as_they_are_at_their_side() -> None:
    console = Console(width=60, file=io.StringIO())
    console.print(SHEET.terminal("Sizes [of]", "below"))
    assert isinstance(console.file, io.StringIO)
    lines = [line.rstrip() for line in console.file.getvalue().splitlines()]
    assert lines[0] == "Sizes [of]" and lines[-1] == "below"
    assert lines[1] == "name       share of it   counted"
    assert lines[3:-1] == [
        "a|b <[0]>       12.3 %   3 times",
        "c                    -   3 times",
        "d                    -  12 times",
    ]


def test_a_group_has_its_heading_once() -> None:
    sheet = Sheet(COLUMNS[:1], SIZES, group=lambda size: f"{size.count} of them")
    rows = sheet.markdown().splitlines()[2:]
    assert rows == ["| **3 of them** |", "| a\\|b <[0]> |", "| c |", "| **12 of them** |", "| d |"]
    assert sheet.terminal().row_count == 5


def test_listed_rows_have_headings_and_names_alike() -> None:
    sheet = listed(("name", "size"), [("a", 0.1234567), ("b", None)], left=1, kept="{}")
    assert sheet.csv() == b"name,size\na,0.1234567\nb,\n"
    assert sheet.markdown().splitlines()[:2] == ["| name | size |", "|---|--:|"]


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "-"), (math.nan, "-"), (math.inf, "∞"), (0.0, "0"), (12345.6, "12,346"),
     (99.96, "100"), (1.2345, "1.23"), (0.00123, "0.00123"), (3e-6, "3.00e-06"), (-250.2, "-250")],
)  # fmt: skip
def test_numbers_are_short(value: float | None, text: str) -> None:
    assert number(value) == text


def test_a_number_keeps_its_room() -> None:
    assert [short(value, 6) for value in (0.0, 1e-9, 1.23456, -1.23456, 123456.0)] == [
        "0", "0", "1.2346", "-1.2346", "123456",
    ]  # fmt: skip
