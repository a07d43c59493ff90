"""A scene's lines by the beam's angle, in the form that the virtual board's sensor takes.

For even steps of the angle, a file holds the electrons that the laser at rated power puts into each
pixel, those of all other light, and the constants of the sensor: everything but the noise. Between
two angles the sensor interpolates linearly. On the default scene this is 0.007 px and 8 um rms off
except for the spots at edges, where the nearest angle alone would be 0.19 px and 200 um off;
speckle is 0.32 px and 320 um.
"""

import hashlib
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from filelock import FileLock

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Config, Mirror
from vrscan.data.points import atomic_file
from vrscan.scene import sensor
from vrscan.scene.description import Description
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer
from vrscan.scene.timeline import Timeline, series

ANGLES = 4096
REACH = 1.05  # share of the mirror's amplitude; beyond it there is no laser light
HEADER = 4096  # bytes of text before the arrays, which begin on a page
_BLOCK = 256  # angles that are rendered at a time
_FINE = 1 << 16  # steps per half period of the table of the mirror's speed


def standing(scene: Description, config: Config) -> Description:
    """Return the scene for the board: the scanner stands, the laser is at its rated power."""
    laser = scene.laser.model_copy(update={"power_mw": config.laser.rated_mw})
    scan = scene.scan.model_copy(update={"pan_mm_per_s": 0.0})
    return scene.model_copy(update={"laser": laser, "scan": scan})


def angles(config: Config, count: int = ANGLES) -> Floats:
    """Return the angles of a library, rad."""
    half = REACH * math.radians(config.mirror.amplitude_deg)
    return np.linspace(-half, half, count)


def at_angles(angle_rad: Floats, mirror: Mirror) -> Timeline:
    """Return lines at any angles, each with the speed that the mirror in RUN has there."""
    phase = np.linspace(0.0, 0.5, _FINE)  # of a polygon: half of a facet's
    shape, slope = series(phase, mirror.harmonics)
    amplitude = math.radians(mirror.amplitude_deg)
    # It falls from turn to turn; the harmonics are far too small for it to turn twice.
    speed = np.abs(slope) * amplitude * mirror.frequency_hz
    if mirror.polygon:
        speed *= 0.5
    rate = np.interp(angle_rad, amplitude * shape[::-1], speed[::-1], left=0.0, right=0.0)
    count = len(angle_rad)
    none = np.empty(0)
    return Timeline(
        line=np.arange(count, dtype=np.int64),
        time_s=np.zeros(count),
        angle_rad=np.asarray(angle_rad, np.float64),
        rate_rad_per_s=rate,
        y_mm=np.zeros(count),
        reported_rad=np.asarray(angle_rad, np.float64),
        index_s=none,
        index_outward=none.astype(np.bool_),
    )


def renderer(scene: Description, config: Config) -> Renderer:
    """Return the renderer of the library's lines, with every effect that the scene has.

    Raises:
        InputError: as ``Light``.
    """
    return Renderer(Light(standing(scene, config), config), frozenset(present(scene)))


def header(made: Renderer, count: int) -> dict[str, float | int]:
    """Return the numbers that the file states, by name."""
    config, model = made.light.config, made.light.scene.sensor
    turned = angles(config, count)
    readout = made.readout
    return {
        "angles": count,
        "line_length": config.sensor.line_length,
        "first_rad": float(turned[0]),
        "step_rad": float((turned[-1] - turned[0]) / (count - 1)),
        "rated_s": config.laser.power_max * config.line.pulse_us * 1e-6,  # power times time
        "exposure_s": made.light.exposure_s,
        "gain": readout.gain,
        "offset_counts": readout.offset_counts,
        "read_noise_e": readout.read_noise_e,
        "top_count": readout.top_count,
        "least_variance": sensor.LEAST_VARIANCE,
        "full_well_e": model.full_well_e,
        "blooming": model.blooming if "blooming" in made.active else 0.0,
        "spill_px": model.spill_px,
        "spill_reach": sensor.SPILL_REACH,
        "seed": made.light.scene.seed,
    }


def library(
    scene: Description,
    config: Config,
    folder: Path,
    *,
    count: int = ANGLES,
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Return the library of a scene; make it if there is none for this scene, instrument and code.

    Args:
        scene: The scene.
        config: The instrument.
        folder: Folder in which the file is kept.
        count: Number of angles.
        progress: Called with the number of angles done so far.

    Raises:
        InputError: as ``Light``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"lines_{_digest(scene, config, count)}.bin"
    with FileLock(f"{path}.lock"):
        if not path.exists():
            _write(path, scene, config, count, progress)
    return path


def _digest(scene: Description, config: Config, count: int) -> str:
    digest = hashlib.sha256()
    for text in (scene.model_dump_json(), config.model_dump_json(), str(count)):
        digest.update(text.encode())
    for name in _files(scene.model_dump()):  # meshes and pictures
        if (scene.folder / name).is_file():
            digest.update((scene.folder / name).read_bytes())
    package = Path(__file__).parents[1]
    for source in sorted([*package.glob("scene/*.py"), *package.glob("ideal/*.py")]):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _files(values: object) -> list[str]:
    """Return the values of all keys ``file`` anywhere in a scene."""
    if isinstance(values, dict):
        own = [str(value) for key, value in values.items() if key == "file"]
        return own + [name for value in values.values() for name in _files(value)]
    if isinstance(values, list):
        return [name for value in values for name in _files(value)]
    return []


def _write(
    path: Path,
    scene: Description,
    config: Config,
    count: int,
    progress: Callable[[int], None] | None,
) -> None:
    made = renderer(scene, config)
    turned = angles(config, count)
    text = "".join(f"{name} {value!r}\n" for name, value in header(made, count).items())
    with atomic_file(path) as file:
        file.write(text.encode("ascii").ljust(HEADER, b"\0"))
        file.write(sensor.NORMAL.astype("<f4").tobytes())
        for first in range(0, count, _BLOCK):
            block = turned[first : first + _BLOCK]
            charge = made.charge(at_angles(block, config.mirror))
            if first == 0:
                for row in (charge.other_e, charge.other_offset_e, charge.offset_e):
                    file.write(row.astype("<f4").tobytes())
            file.write(charge.laser_e.astype("<f4").tobytes())
            if progress is not None:
                progress(first + len(block))


def words(seed: int, line: int, length: int) -> Pixels:
    """Return the random words of a line of the board: splitmix64 of the seed, line and pixel."""
    with np.errstate(over="ignore"):
        step = np.uint64(0x9E3779B97F4A7C15)
        count = np.uint64(line << 16) + np.arange(1, (length + 3) // 4 + 1, dtype=np.uint64)
        z = np.uint64(seed) + step * count
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return np.asarray(z.astype("<u8").view("<u2")[:length])
