"""The finished parts of a long scan on disk, from which an interrupted scan goes on.

A folder holds ``scan.json``, which names the scan, and a file for each ``PIECE`` blocks. Files are
pickles: they are of this program and for it, and are removed when the scan is complete.
"""

import hashlib
import json
import pickle
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from vrscan.data.errors import InputError
from vrscan.data.points import atomic_file, unfinished
from vrscan.engines.engine import Engine
from vrscan.scene.simulate import BLOCK, Scanner

PIECE = 16  # blocks of a file
LEAST_LINES = 2 * PIECE * BLOCK  # fewer are soon made again
_KEPT = "scan.json"


@dataclass(frozen=True)
class Piece:
    """Blocks of a scan that follow each other."""

    parts: Sequence[Any]  # the ``Part`` of each, before other blocks' surfaces hide free beams
    state: Any  # what the next block's light depends on; None if on nothing


def name_of(scanner: Scanner, engine: Engine, **options: object) -> str:
    """Return a text that differs where the points of two scans may differ, JSON.

    Args:
        scanner: The scene, the instrument, the effects and the number of lines.
        engine: The engine.
        options: Whatever else decides what is written.
    """
    package, digest = Path(__file__).parents[1], hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.read_bytes())
    light, renderer = scanner.light, scanner.renderer
    told = {
        "version": metadata.version("vrscan"),
        "code": digest.hexdigest(),
        "lines": scanner.count,
        "engine": str(engine),
        "effects": sorted(renderer.active),
        "tolerance_px": renderer.tolerance_px,
        "options": options,
        "folder": str(light.scene.folder),
        "scene": light.scene.model_dump(mode="json"),
        "config": light.belief.model_dump(mode="json"),
    }
    return json.dumps(told, indent=1, default=str)


class Store:
    """The folder of a scan's finished pieces."""

    def __init__(self, folder: Path, name: str) -> None:
        """Open the folder; what is there of another scan is removed.

        Args:
            folder: The folder, which is made if it does not exist.
            name: Result of ``name_of``.

        Raises:
            InputError: if it cannot be read or made.
        """
        self.folder = folder
        kept = folder / _KEPT
        try:
            if folder.exists() and not (kept.exists() and kept.read_text() == name):
                shutil.rmtree(folder)
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: {error.strerror}") from error
        for left in unfinished(folder):
            left.unlink(missing_ok=True)
        if not kept.exists():
            with atomic_file(kept) as file:
                file.write(name.encode())

    def _path(self, number: int) -> Path:
        return self.folder / f"piece-{number:06}.pickle"

    @property
    def blocks(self) -> int:
        """Return the number of blocks that need not be made again."""
        number = 0
        while self._path(number).exists():
            number += 1
        return number * PIECE

    def pieces(self) -> Iterator[Piece]:
        """Yield the finished pieces in their order.

        Raises:
            InputError: if a file cannot be read.
        """
        for number in range(self.blocks // PIECE):
            path = self._path(number)
            try:
                piece = pickle.loads(path.read_bytes())
            except (OSError, pickle.UnpicklingError, EOFError) as error:
                raise InputError(f"{path}: no part of a scan ({error})") from error
            yield piece

    def add(self, number: int, piece: Piece) -> None:
        """Write the piece of this number.

        Raises:
            InputError: if it cannot be written.
        """
        with atomic_file(self._path(number)) as file:
            pickle.dump(piece, file, protocol=pickle.HIGHEST_PROTOCOL)

    def remove(self) -> None:
        """Remove the folder: the scan is complete."""
        shutil.rmtree(self.folder, ignore_errors=True)
