"""A configuration as hardware: the parameters of ``vrscan``, and what its registers reset to."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from vrscan.data.config import Config
from vrscan.data.points import atomic_file
from vrscan.engines.tools import build_folder, rtl_module
from vrscan.registers.resets import resets, with_resets


@dataclass(frozen=True)
class Hardware:
    """What a board is built with, the same for a simulated one and for a real one."""

    clock_hz: int
    line_length: int
    pixel_width: int
    index_oversample: int
    polygon: bool

    @classmethod
    def of(cls, config: Config) -> "Hardware":
        """Return the hardware that a configuration asks for."""
        return cls(
            clock_hz=round(config.clock.frequency_hz),
            line_length=config.sensor.line_length,
            pixel_width=config.sensor.pixel_width,
            index_oversample=config.mirror.oversample,
            polygon=config.mirror.polygon,
        )

    @property
    def parameters(self) -> dict[str, int]:
        """The parameters of ``vrscan``, by their names."""
        return {
            "ClockHz": self.clock_hz,
            "LineLength": self.line_length,
            "PixelWidth": self.pixel_width,
            "IndexOversample": self.index_oversample,
            "Polygon": int(self.polygon),
        }

    def register_package(self, config: Config) -> Path:
        """Return ``register_pkg`` with the resets of a configuration, in a file in ``build/``.

        Compiled in place of the shipped one, it makes registers and tables begin with what a load
        of the configuration would write.

        Raises:
            InputError: in one line with the key, if the configuration does not fit this hardware.
        """
        shipped = rtl_module("register_pkg")
        text = with_resets(shipped.read_text(), resets(config, self))
        name = hashlib.sha256(text.encode()).hexdigest()[:16]
        file = build_folder() / "resets" / name / shipped.name
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            with atomic_file(file) as made:
                made.write(text.encode())
        return file
