"""A MEMS laser triangulation scanner: simulated scenes, sensor lines, and points with their errors.

    import vrscan

    lines = vrscan.simulate("bolt", 3000)
    points = vrscan.detect(lines)
    frame = vrscan.to_frame(points)

What ``__all__`` names is here; it is imported when it is first used, so that a program needs no
library but those of what it calls. ``pip install ".[all]"`` in a clone brings them all.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vrscan.api import detect, simulate, to_frame
    from vrscan.calibrate.motion_fit import fit_motion
    from vrscan.data.config import Config
    from vrscan.data.errors import InputError
    from vrscan.data.lines import Lines, Truth
    from vrscan.data.table import Table
    from vrscan.link.device import Device
    from vrscan.scene.description import Description as Scene

    __version__: str

__all__ = [
    "Config",
    "Device",
    "InputError",
    "Lines",
    "Scene",
    "Table",
    "Truth",
    "__version__",
    "detect",
    "fit_motion",
    "simulate",
    "to_frame",
]

# Where each of them is, and under which name. As texts: what imports this package, and all of its
# modules do, does not thereby import, or depend on, these.
_PLACES = {
    "Config": "vrscan.data.config:Config",
    "Device": "vrscan.link.device:Device",
    "InputError": "vrscan.data.errors:InputError",
    "Lines": "vrscan.data.lines:Lines",
    "Scene": "vrscan.scene.description:Description",
    "Table": "vrscan.data.table:Table",
    "Truth": "vrscan.data.lines:Truth",
    "detect": "vrscan.api:detect",
    "fit_motion": "vrscan.calibrate.motion_fit:fit_motion",
    "simulate": "vrscan.api:simulate",
    "to_frame": "vrscan.api:to_frame",
}


def _version() -> str:
    from importlib import metadata

    try:
        return metadata.version("vrscan")
    except metadata.PackageNotFoundError:  # files that nobody installed
        return "0+unknown"


if not TYPE_CHECKING:  # lest a type checker take any name for one of these

    def __getattr__(name: str) -> object:
        """Import what ``__all__`` names, when it is first asked for."""
        if name == "__version__":
            value = _version()
        elif name in _PLACES:
            module, _, attribute = _PLACES[name].partition(":")
            with importlib.import_module("vrscan.data.extras").named():
                value = getattr(importlib.import_module(module), attribute)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """Return the names that are here, imported or not yet."""
    return sorted({*globals(), *__all__})
