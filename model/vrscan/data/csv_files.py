"""The rows of CSV files, with an error of one line where a file is none."""

import csv
from pathlib import Path

from vrscan.data.errors import InputError, one_line, unread


def csv_fields(path: Path, what: str = "a CSV file") -> list[list[str]]:
    """Return the fields of every row, none of an empty one.

    Args:
        path: The file.
        what: What it should be, for the error.

    Raises:
        InputError: naming the file, if it is missing or not such a file.
    """
    try:
        with path.open(newline="") as file:
            return list(csv.reader(file))
    except OSError as error:
        raise InputError(f"{path}: {unread(error, path)}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not {what} ({one_line(error)})") from error
