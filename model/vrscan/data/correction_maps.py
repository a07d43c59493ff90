"""Correction maps: what a position on the sensor lacks, over angle, position and lens."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from vrscan.data import pkg, recordings
from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config
from vrscan.data.errors import InputError, reading

ROWS, COLUMNS = 33, 65  # nodes of a map over the angle and over the position


@dataclass(frozen=True)
class FieldMaps:
    """Correction maps, evenly spaced over the position of the lens."""

    focal_mm: float  # focal length by which depths in focus become positions of the lens
    lens_begin_mm: float  # distance of the lens from where infinity is in focus, of the first map
    lens_step_mm: float
    corrections_px: Floats  # [maps, 33, 65]
    filled: Bools  # [maps, 33, 65]: nodes without points
    residual_px: Floats  # rms residual of the points of each map [maps]

    def words(self) -> Ints:
        """Return the nodes in the format of ``correction_map``, px with 10 fraction bits.

        Raises:
            InputError: if a correction is 64 px or more.
        """
        nodes = np.floor(self.corrections_px * 2.0**pkg.MAP_FRACTION + 0.5).astype(np.int64)
        limit = 1 << (pkg.MAP_WIDTH - 1)
        if nodes.size and (nodes.min() < -limit or nodes.max() >= limit):
            most = float(np.abs(self.corrections_px).max())
            raise InputError(f"map: a correction of {most:.1f} px, at most 64 fit; fewer foci do")
        return nodes

    def lens(self, focus_mm: float) -> float:
        """Return where a focus lies among the maps, 0 at the first."""
        return (extension_mm(focus_mm, self.focal_mm) - self.lens_begin_mm) / self.lens_step_mm

    def place(self, lens_mm: Floats) -> Floats:
        """Return where positions of the lens lie among the maps, of the shape of ``lens_mm``."""
        return (lens_mm - self.lens_begin_mm) / self.lens_step_mm


def extension_mm(focus_mm: float, focal_mm: float) -> float:
    """Return the way of the lens from infinity to a focus: f^2 / (z - f), the thin lens, mm."""
    return focal_mm * focal_mm / (focus_mm - focal_mm)


def focus_of_mm(extension: float, focal_mm: float) -> float:
    """Return the depth in focus at a way of the lens, the inverse of ``extension_mm``."""
    return focal_mm + focal_mm * focal_mm / extension


def read_maps(path: Path) -> FieldMaps:
    """Return maps from their file, or from a recording that holds them.

    Raises:
        InputError: naming the file, if it is missing or not one that ``write_maps`` made.
    """
    with reading(path, "no correction maps"):
        source = recordings.maps_file(path) if recordings.is_recording(path) else path
        with np.load(source, allow_pickle=False) as file:
            focal, begin, step = (float(each) for each in file["lens"])
            corrections, filled = file["corrections_px"], file["filled"]
            residual = file["residual_px"]
    fits = corrections.ndim == 3 and corrections.shape[1:] == (ROWS, COLUMNS)
    if not fits or filled.shape != corrections.shape or not np.isfinite(corrections).all():
        raise InputError(f"{path}: its maps are not finite numbers [maps, {ROWS}, {COLUMNS}]")
    return FieldMaps(focal, begin, step, corrections, filled.astype(np.bool_), residual)


def maps_of(config: Config) -> FieldMaps | None:
    """Return the maps of a configuration, None where it names none.

    Raises:
        InputError: naming the file, if it cannot be read, or the lens cannot stand at the focus.
    """
    if config.map.file is None:
        return None
    path = Path(config.source).parent / config.map.file
    try:
        changed = path.stat().st_mtime_ns
    except OSError as error:
        raise InputError(f"{config.source}: map.file: {path}: {error.strerror}") from error
    maps = _read_once(path, changed)
    if not config.map.focus_mm > maps.focal_mm:
        raise InputError(
            f"{config.source}: map.focus_mm = {config.map.focus_mm:g}: no farther than the focal "
            f"length, {maps.focal_mm:g} mm"
        )
    return maps


@lru_cache(maxsize=4)
def _read_once(path: Path, _changed: int) -> FieldMaps:
    return read_maps(path)
