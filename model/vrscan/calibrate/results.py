"""The files of a calibration: a configuration as TOML, and maps as .npz, with their provenance."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import BinaryIO

import numpy as np

from vrscan.calibrate.solve import Fit
from vrscan.data.config import Config, Map
from vrscan.data.config_text import text
from vrscan.data.correction_maps import FieldMaps

_GEOMETRY = ("base_mm", "bias_deg", "offset_mm", "focal_mm", "centre_px", "k1", "k2")
_MIRROR = ("index_deg", "drive_phase", "harmonics", "slopes")


def provenance(inputs: Iterable[Path]) -> dict[str, str]:
    """Return by whom, when and from what a file was made: version, date, SHA-256 of each input."""
    made = {
        "made_by": f"vrscan {metadata.version('vrscan')}",
        "made_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    for path in inputs:
        made[path.name] = f"sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}"
    return made


def configuration(config: Config, notes: Mapping[str, object]) -> str:
    """Return a calibrated configuration as TOML, with notes as comments.

    It has geometry and mirror, and what else was given: all but maps, which are those of another
    geometry.
    """
    geometry, mirror = (
        section.model_copy(update={name: getattr(section, name) for name in names})
        for section, names in ((config.geometry, _GEOMETRY), (config.mirror, _MIRROR))
    )
    own = config.model_copy(update={"geometry": geometry, "mirror": mirror, "map": Map()})
    return "".join(f"# {name}: {value}\n" for name, value in notes.items()) + text(own, chosen=True)


def fitted(fit: Fit) -> dict[str, object]:
    """Return the notes on a fit: each parameter with its standard deviation, and what is unsure."""
    notes: dict[str, object] = {}
    for each, value, sigma, seen in zip(
        fit.parameters, fit.values, fit.sigma, fit.observed, strict=True
    ):
        name = f"{each.name} {each.unit}".strip()
        notes[name] = f"{value:.9g} +- {sigma:.2g}" if seen else f"{value:.9g}, not observed"
    for first, second, share in fit.correlated():
        notes[f"correlation of {first} and {second}"] = f"{share:+.3f}"
    return notes


def write_maps(maps: FieldMaps, notes: Mapping[str, object], file: BinaryIO) -> None:
    """Write maps as .npz: corrections, which nodes were filled, the lens's positions, notes."""
    np.savez_compressed(
        file,
        lens=np.array([maps.focal_mm, maps.lens_begin_mm, maps.lens_step_mm]),
        corrections_px=maps.corrections_px,
        filled=maps.filled,
        residual_px=maps.residual_px,
        provenance=np.array(json.dumps(dict(notes))),
    )
