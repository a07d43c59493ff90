"""Tables in CSV files, as spreadsheets, numpy and logic analysers write them.

Fields are separated by commas, semicolons or tabs; where no comma separates them, a comma is a
decimal one. A byte order mark, spaces around fields, rows without a value, and lines that begin
with ``#`` or ``;`` do not count, but names of columns may stand in the last such line before the
first number.
"""

import codecs
import csv
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vrscan.data.arrays import Floats, Ints
from vrscan.data.errors import InputError, InputWarning, listed, nearest, one_line, shown, unread

_COMMENT = re.compile(r"\s*[#;]|\s*sep=.$")  # Excel's first line names the separator


@dataclass(frozen=True)
class CsvTable:
    """Rows of text under names.

    Attributes:
        path: The file.
        names: Names of the columns in small letters, without spaces and ``_i`` at their end.
        rows: Fields of each row, as many as there are names.
        line: Number of each row's line in the file.
    """

    path: Path
    names: list[str]
    rows: list[list[str]]
    line: list[int]

    def need(self, names: Iterable[str]) -> None:
        """Check that each of the names stands over one column.

        Raises:
            InputError: naming the file and the columns that it has.
        """
        for name in names:
            if name not in self.names:
                near = nearest(name, self.names)
                raise InputError(f"{self.path}: no column {name} (has {listed(self.names)}){near}")
            if self.names.count(name) > 1:
                raise InputError(f"{self.path}: {self.names.count(name)} columns {name}")

    def with_value(self, name: str) -> "CsvTable":
        """Return the rows in which a column is not empty."""
        place = self.names.index(name)
        kept = [k for k, row in enumerate(self.rows) if row[place]]
        return replace(self, rows=[self.rows[k] for k in kept], line=[self.line[k] for k in kept])

    def column(
        self, name: str, kind: Callable[[str], float], wrong: str = "is no number"
    ) -> npt.NDArray[Any]:
        """Return a column's values [rows], each the ``kind`` of its text.

        Raises:
            InputError: naming line and text, with ``wrong``, where ``kind`` raises ValueError.
        """
        place, found = self.names.index(name), []
        for line, row in zip(self.line, self.rows, strict=True):
            try:
                found.append(kind(row[place]))
            except ValueError:
                told = f"{self.path}: line {line}: {name} {shown(row[place])} {wrong}"
                raise InputError(told) from None
        return np.array(found)

    def levels(self, name: str) -> Ints:
        """Return a column of levels, 0 or 1 [rows].

        Raises:
            InputError: naming the line, if a level is another one.
        """
        found = self.column(name, ("0", "1").index, "is not 0 or 1")
        return np.asarray(found, np.int64)


def finite(text: str) -> float:
    """Return a finite number; raise ValueError for other texts."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def whole(text: str) -> int:
    """Return a whole number of 64 bits, also of ``7.0`` or ``0x7``; raise ValueError otherwise."""
    try:
        value = int(text, 16 if text[:2].lower() == "0x" else 10)
    except ValueError:
        number = finite(text)
        value = int(number)
        if value != number:
            raise
    if not -(2**63) <= value < 2**63:
        raise ValueError(text)
    return value


def plain_name(text: str) -> str:
    """Return the name of a column as it is meant."""
    name = re.sub(r"\s", "", text).lower()
    return re.sub(r"_i(?=$|\[)", "", re.sub(r"^time[\[(]s[\])]$", "time_s", name))


def read_table(
    path: Path, what: str = "a CSV file", columns: Mapping[str, str] | None = None
) -> CsvTable:
    """Return the table of a file.

    Args:
        path: The file.
        what: What it should be, for the error.
        columns: Names of the file's columns by our names for them, as ``renamed`` returns them.

    Raises:
        InputError: naming the file, and the line if one is wrong, if it is missing, not such a
            file, or lacks one of ``columns``, or a row has more or fewer fields than the first.
    """
    text = _Text(path, what)
    names = [plain_name(name) for name in text.names]
    for own, theirs in (columns or {}).items():
        places = [k for k, name in enumerate(text.names) if plain_name(name) == plain_name(theirs)]
        if len(places) != 1:
            has = listed([name for name in text.names if name])
            raise InputError(f"{path}: {len(places)} columns {theirs!r}, want 1 (has {has})")
        names = ["" if name == own else name for name in names]
        names[places[0]] = own
    while names and not names[-1]:
        names.pop()
    table = CsvTable(path, names, [], [])
    for number, fields in text.rows() if names else ():
        while len(fields) > len(names) and not fields[-1]:
            fields.pop()
        if len(fields) != len(names):
            told = f"{len(fields)} fields, want {len(names)}"
            raise InputError(f"{path}: line {number}: {told}")
        table.rows.append(fields)
        table.line.append(number)
    return table


def read_matrix(path: Path) -> Floats | None:
    """Return the numbers of a file without names [rows, columns], None if it is another file.

    Names that are 0, 1, 2 and so on, as pandas writes them, are left out with a warning, and so
    are numbers of rows under no name.

    Raises:
        InputError: naming the file, if it is missing, no CSV file, or a field is no number.
    """
    text = _Text(path, "a CSV file")
    ranks = [str(k) for k in range(len(text.first))]
    numbered = len(ranks) > 1 and text.first[0] == "" and text.first[1:] == ranks[:-1]
    if not (numbered or (text.first and not text.names)):
        return None
    lines = text.lines if text.first != ranks else text.lines[1:]
    if numbered or text.first == ranks:
        warnings.warn(f"{path}: its first row numbers the columns", InputWarning, stacklevel=2)
    if not lines:
        return np.zeros((0, len(ranks)))
    try:
        # Quotes do not matter here, and loadtxt reads numbers many times as fast as the csv module.
        found = np.loadtxt(
            [line.replace('"', "") for _, line in lines],
            delimiter=None if text.separator == " " else text.separator,
            comments=None,
            ndmin=2,
        )
    except ValueError as error:
        raise InputError(f"{path}: no matrix of numbers ({one_line(error)})") from error
    return found[:, 1:] if numbered else found


class _Text:
    """Lines of a CSV file that count.

    Attributes:
        lines: Number in the file and text of each line from the first row of numbers on.
        separator: What separates the fields; a space only in a row of numbers.
        first: Fields of the first row, whether they are names or numbers.
        names: Names of the columns, none of a matrix of numbers.
    """

    def __init__(self, path: Path, what: str) -> None:
        self._path, self._what = path, what
        try:
            data = path.read_bytes()
            wide = data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
            text = data.decode("utf-16" if wide else "utf-8-sig")
        except OSError as error:
            raise InputError(f"{path}: {unread(error, path)}") from error
        except UnicodeDecodeError as error:
            raise InputError(f"{path}: not {what} ({one_line(error)})") from error
        there = text.splitlines()
        self.lines = [
            (number, line)
            for number, line in enumerate(there, 1)
            if line and not line.isspace() and not _COMMENT.match(line)
        ]
        self.first, self.names, self.separator = [], [], ","
        if not self.lines:
            return
        number, line = self.lines[0]
        spaced = line.split()
        self.separator = next((each for each in ";\t," if each in line), ";")
        if self.separator == ";" and len(spaced) > 1 and all(map(_is_number, spaced)):
            self.separator = " "
        if self.separator in ";\t":
            self.lines = [(k, each.replace(",", ".")) for k, each in self.lines]
        self._spaces = " " in text or "\t" in text
        self.first = next(self.rows(), (number, []))[1]
        above = there[number - 2].lstrip("#; \t") if number > 1 else ""
        if not all(map(_is_number, self.first)):
            self.names = self.first
            self.lines = self.lines[1:]
        elif _COMMENT.match(there[number - 2] if number > 1 else ""):
            names = [name.strip() for name in above.split(self.separator)]
            if len(names) == len(self.first) and not any(map(_is_number, names)):
                self.names = names

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Return the number in the file and the fields of each row that has a value.

        Raises:
            InputError: naming the line where a quote is not closed, or other faults of its form.
        """
        lines = (line for _, line in self.lines)
        reader = csv.reader(lines, delimiter=self.separator, skipinitialspace=True, strict=True)
        before = 0
        try:
            for fields in reader:
                if reader.line_num > before + 1:
                    raise csv.Error("a quote is not closed")
                if self._spaces:
                    fields = [field.strip() for field in fields]
                if any(fields):
                    yield self.lines[before][0], fields
                before = reader.line_num
        except csv.Error as error:
            number = self.lines[min(before, len(self.lines) - 1)][0]
            told = f"{self._path}: line {number}: not {self._what} ({one_line(error)})"
            raise InputError(told) from error


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
