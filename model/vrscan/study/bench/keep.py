"""The computed cells: one file each, which is either complete or does not exist."""

import json
from datetime import UTC, datetime
from pathlib import Path

from vrscan.data.errors import InputError
from vrscan.data.points import atomic_file
from vrscan.study.bench.cells import Cell, Figures


class Keep:
    """A folder of figures by the keys of their cells."""

    def __init__(self, folder: Path, machine: str) -> None:
        """Open the folder, and make it if it does not exist.

        Args:
            folder: Folder of the files.
            machine: Machine on which the timed cells are measured.

        Raises:
            InputError: if it cannot be made.
        """
        self.machine = machine
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot make the folder ({error.strerror})") from error

    def path(self, cell: Cell) -> Path:
        """Return the file of a cell."""
        return self._folder / f"{cell.key(self.machine)}.json"

    def get(self, cell: Cell) -> Figures | None:
        """Return the figures of a cell, or None where they do not exist or cannot be read."""
        try:
            figures = json.loads(self.path(cell).read_text())["figures"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return figures if isinstance(figures, dict) else None

    def put(self, cell: Cell, figures: Figures) -> None:
        """Keep the figures of a cell.

        Raises:
            InputError: if the file cannot be written.
        """
        held = {
            "work": cell.work,
            "parameters": cell.parameters,
            "seed": cell.seed,
            "made": datetime.now(UTC).isoformat(timespec="seconds"),
            "figures": figures,
        }
        with atomic_file(self.path(cell)) as file:
            file.write(json.dumps(held).encode())
