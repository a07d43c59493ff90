"""A scene's file: what stands there, who lights it, and what looks at it.

A scene is TOML; every table has defaults, so the shortest scene is one ``[[target]]``. What the
instrument believes about itself (geometry, timing, thresholds) is not here but in its
configuration; ``[instrument]`` says where the instrument that stands there differs from it.
"""

from importlib import resources
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field, PrivateAttr, model_validator

from vrscan.data.config import Config, Positive, Section, checked, read_toml
from vrscan.data.errors import InputError, nearest
from vrscan.scene.beam import Laser
from vrscan.scene.sensor import SensorModel
from vrscan.scene.stray import Stray
from vrscan.scene.sun import Lamp, Sun
from vrscan.scene.surface import Material
from vrscan.scene.targets import TargetSection
from vrscan.scene.timeline import Scan
from vrscan.scene.tolerances import Instrument
from vrscan.scene.tuples import Pair

DEFAULT_TOLERANCE_PX = 0.01
FULL_WELL_SHARE = 25_000.0 / 20_475.0  # full well over the electrons of the last code

_Part = TypeVar("_Part", bound=Section)


class Lens(Section):
    """The camera's lens and filter, ``[lens]``; the focal length is the instrument's."""

    f_number: float = Field(default=3.0, ge=0.5, le=64)  # see Description.of
    focus_mm: Positive = 420.0  # depth along the lens's axis that is in focus; see Description.of
    transmission: float = Field(default=0.9, ge=0, le=1)
    filter_nm: Pair = (645.0, 665.0)
    filter_transmission: float = Field(default=0.85, ge=0, le=1)
    coma_px: float = Field(default=0.3, ge=0, le=20)  # length of the tail at the sensor's end
    row_offset_px: float = 0.0  # offset of the row from the scan plane's image

    @model_validator(mode="after")
    def _band(self) -> "Lens":
        if not 280.0 <= self.filter_nm[0] < self.filter_nm[1] <= 4000.0:
            raise ValueError(f"filter_nm {list(self.filter_nm)} must rise, within 280 to 4000")
        return self


class Speckle(Section):
    """The table ``[speckle]``: averaging of speckle by the laser's coherence."""

    looks: float = Field(default=1.0, ge=1, le=1000)  # independent patterns, as by many modes


class Description(Section):
    """A scene in the form of its file.

    Example:
        >>> import vrscan
        >>> wall = {"kind": "plane", "name": "wall", "position_mm": [0.0, 0.0, 450.0]}
        >>> scene = vrscan.Scene.model_validate({"fidelity": ["read"], "target": [wall]})
        >>> vrscan.simulate(scene, 64).truth.names
        ('wall',)
    """

    title: str = ""
    fidelity: Literal["auto", "full"] | list[str] = "auto"
    tolerance_px: float = Field(default=DEFAULT_TOLERANCE_PX, gt=0, le=10)
    seed: int = Field(default=20100301, ge=0)
    exposure_us: float | None = Field(default=None, gt=0)  # None: a whole line period
    scan: Scan = Scan()
    instrument: Instrument | None = None  # None: the configuration is right about it
    laser: Laser = Laser()
    lens: Lens = Lens()
    sensor: SensorModel = SensorModel()
    speckle: Speckle = Speckle()
    stray: Stray = Stray()
    sun: Sun | None = None
    lamp: list[Lamp] = Field(default_factory=list)
    material: dict[str, Material] = Field(default_factory=dict)
    target: Annotated[list[TargetSection], Field(min_length=1)]

    _folder: Path = PrivateAttr(Path())
    _source: str = PrivateAttr("scene")

    @property
    def folder(self) -> Path:
        """Return the folder in which the files that the scene names are looked for."""
        return self._folder

    @property
    def source(self) -> str:
        """Return the file that the scene came from, for messages."""
        return self._source

    @model_validator(mode="after")
    def _materials(self) -> "Description":
        for target in self.target:
            if target.material != "default" and target.material not in self.material:
                known = ", ".join(sorted(self.material)) or "none"
                raise ValueError(
                    f"no material {target.material!r} (there are {known})"
                    f"{nearest(target.material, self.material)}"
                )
        return self

    def of(self, config: Config) -> "Description":
        """Return the scene with what it does not say of the instrument as in a configuration.

        These are power, f-number, focus and full well. The sensor holds ``FULL_WELL_SHARE`` times
        the electrons of the converter's last code.
        """
        well = round(FULL_WELL_SHARE * config.sensor.full_well_e, 3)
        laser = _unless_said(self.laser, power_mw=config.laser.rated_mw)
        lens = _unless_said(self.lens, f_number=config.free.f_number, focus_mm=config.free.focus_mm)
        sensor = _unless_said(self.sensor, full_well_e=well)
        return self.model_copy(update={"laser": laser, "lens": lens, "sensor": sensor})

    def material_of(self, name: str) -> Material:
        """Return the material of this name; ``default`` need not be in the file."""
        return self.material.get(name, Material())


def _unless_said(section: _Part, **values: float) -> _Part:
    """Return a section with the values of keys that its file does not say."""
    missing = {key: each for key, each in values.items() if key not in section.model_fields_set}
    return section.model_copy(update=missing)


def shipped() -> tuple[str, ...]:
    """Return the names of the scenes that come with the package, ``default`` first."""
    folder = resources.files("vrscan.scene") / "scenes"
    names = sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir())
    return ("default", *[name for name in names if name != "default"])


def load(name: str) -> Description:
    """Return a shipped scene by its name, or a scene from a file.

    Args:
        name: One of ``shipped()``, or the path of a ``.toml`` file.

    Raises:
        InputError: naming file, key and value, if there is no such scene or file, the file is not
            TOML, has an unknown key, or a value of the wrong type or out of range.
    """
    path = Path(name)
    if path.suffix != ".toml":
        if name not in shipped():
            raise InputError(
                f"{name}: no such scene (there are {', '.join(shipped())}, or FILE.toml)"
                f"{nearest(name, shipped())}"
            )
        with resources.as_file(resources.files("vrscan.scene") / "scenes") as folder:
            path = folder / f"{name}.toml"
    return parse(read_toml(path, name), name, path.parent)


class _InstrumentFile(Section):
    """A file that holds nothing but an instrument."""

    instrument: Instrument


def load_instrument(path: Path) -> Instrument:
    """Return the instrument of a TOML file with the table ``[instrument]``.

    Raises:
        InputError: naming file, key and value, as ``load``.
    """
    return checked(_InstrumentFile, read_toml(path, str(path)), str(path)).instrument


def parse(values: dict[str, object], source: str, folder: Path) -> Description:
    """Return a scene from the contents of its file.

    Args:
        values: The file's tables.
        source: Name of the file, for messages.
        folder: Folder of the files that the scene names.

    Raises:
        InputError: naming source, key and value.
    """
    description = checked(Description, values, source)
    description._folder = folder
    description._source = source
    return description
