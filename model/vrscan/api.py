"""What a notebook or a program calls: scenes to lines, lines to points, points to a data frame.

``import vrscan`` offers these functions, with the types that they take and return. They are the
``vrscan`` command's own steps without its files, bars and tables.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import ValidationError

from vrscan.data.config import Config, Peak, complaint
from vrscan.data.config import load as load_config
from vrscan.data.contract import checked
from vrscan.data.errors import InputError, LinesError
from vrscan.data.extras import named
from vrscan.data.lines import Lines, part
from vrscan.data.table import Table
from vrscan.engines import engine as engines
from vrscan.engines.engine import Engine
from vrscan.engines.shadows import shaded
from vrscan.study.progress import Progress

if TYPE_CHECKING:
    import pandas as pd

    from vrscan.scene.description import Description

ConfigSource = Config | str | os.PathLike[str] | None


def simulate(
    scene: "str | os.PathLike[str] | Description" = "default",
    lines: int = 3000,
    *,
    fidelity: str | Sequence[str] | None = None,
    tolerance_px: float | None = None,
    config: ConfigSource = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Lines:
    """Return the sensor's lines of a scan over a scene, with the truth of each.

    The same arguments give the same lines, which are those of ``vrscan scan --keep-lines``.

    Args:
        scene: The name of a shipped scene, the path of a ``.toml`` file, or a ``Scene``.
        lines: How many, n, at least 1. They take 2 bytes a pixel, 4 kB each.
        fidelity: Which effects of the light are simulated: ``auto`` those that move points by more
            than the tolerance, ``full`` all that the scene has, ``minimal`` none, or some by their
            names; the scene's own choice if None.
        tolerance_px: What ``auto`` may leave out, px; the scene's if None.
        config: The instrument, or the path of its TOML file; the shipped one if None.
        jobs: Processes; 0 is one for each processor. The lines do not depend on it.
        progress: Called with the number of lines done so far.

    Returns:
        ``lines`` uint16 [n, 2048], counts; ``angle_rad`` [n], of the scan; ``power`` [n], of the
        laser; and ``truth``, with ``x_mm``, ``z_mm`` and ``position_px`` [n], NaN where the camera
        does not see the spot, and ``surface`` [n], an index into its ``names``.

    Raises:
        InputError: if there is no such scene, file or effect, a value in one is out of range, or
            the camera sees none of the lines.
        MissingError: if a library is not installed; ``vrscan[scene]`` brings all of them.

    Example:
        >>> import vrscan
        >>> lines = vrscan.simulate("plane", 64, fidelity=["shot", "read"])
        >>> lines.lines.shape, lines.lines.dtype
        ((64, 2048), dtype('uint16'))
        >>> lines.truth.names
        ('plane',)
    """
    with named():
        from vrscan.scene import simulate as simulator
        from vrscan.scene.description import Description, load
        from vrscan.scene.light import Light
        from vrscan.study.plan import plan

        if lines < 1:
            raise InputError(f"simulate: lines must be 1 or more ({lines})")
        _check_jobs("simulate", jobs)
        described = load(os.fspath(scene)) if isinstance(scene, str | os.PathLike) else scene
        if not isinstance(described, Description):
            raise InputError(
                f"simulate: scene must be a name, a file or a vrscan.Scene, not {_named(scene)}"
            )
        light = Light(described, _configured(config))
        wanted = fidelity if fidelity is None or isinstance(fidelity, str) else list(fidelity)
        chosen = plan(light, lines, fidelity=wanted, tolerance_px=tolerance_px, each=False)
        return simulator.simulate(
            light,
            lines,
            chosen.active,
            tolerance_px=chosen.plane_px,
            jobs=jobs,
            progress=progress,
        ).lines


def detect(
    lines: Lines,
    mode: Literal["threshold", "two_pass", "fit"] | None = None,
    engine: Literal["fixed", "ideal", "rtl"] = "fixed",
    config: ConfigSource = None,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Table:
    """Return the point of each line, as ``vrscan replay`` finds it.

    Args:
        lines: n lines, simulated or your own: ``Lines(pixels, angle_rad, power)`` with pixels
            uint16 [n, 2048], angles of the scan in rad [n], and integers from 0 to
            ``config.laser.power_max`` [n].
        mode: How the spot is found: ``threshold``, one window, as in the paper; ``two_pass``, a
            second window that suits spot and noise; or ``fit``, a Gaussian that is fitted from
            there on, with the speckle of the 62 lines before. None takes what ``config`` says, and
            that is ``fit`` unless it says otherwise.
        engine: Who computes: ``fixed``, the bit-accurate model of the hardware; ``ideal``, the
            papers' equations in float64; or ``rtl``, the hardware itself in Verilator, which gives
            the same bits as ``fixed`` and is built when first used, in a minute or so.
        config: The instrument, or the path of its TOML file; the shipped one if None.
        jobs: Processes; 0 is one for each processor, or fewer for few lines. The points do not
            depend on it.
        progress: Called with the number of lines done so far.

    Returns:
        A table with a row for each line, whose columns are arrays [n]: ``position_px``,
        ``sigma_px`` and ``doubt_px`` where ``measured``; ``x_mm``, ``z_mm`` and ``sigma_z_mm``
        where ``located``; ``flags``, by name; and what else was measured of the line.

    Raises:
        LinesError: if an array has another shape or type, or a value is out of range. It is an
            ``InputError`` and a ``ValueError``.
        InputError: if there is no such mode, engine or file, a value of the configuration is out
            of range or does not fit in the hardware's registers, or there is no Verilator or
            compiler for ``rtl``.
        MissingError: if what ``vrscan[sim]`` brings is not installed, for ``rtl``, or loky, for
            several processes.

    Example:
        >>> import numpy as np
        >>> import vrscan
        >>> pixels = np.arange(2048)
        >>> spot = 60 + 2000 * np.exp(-0.5 * ((pixels - 1000.3) / 3.0) ** 2)
        >>> one = vrscan.Lines(spot.round().astype(np.uint16)[None], np.zeros(1), np.array([65535]))
        >>> points = vrscan.detect(one)
        >>> round(float(points.position_px[0]), 2), round(float(points.z_mm[0]), 2)
        (1000.3, 407.69)
    """
    settings = _configured(config)
    if not isinstance(lines, Lines):
        raise LinesError(
            f"detect: lines must be vrscan.Lines(pixels, angle_rad, power), with pixels uint16 [n, "
            f"{settings.sensor.line_length}], not {_named(lines)}"
        )
    if mode is not None:
        try:
            peak = Peak.model_validate(settings.peak.model_dump() | {"window": mode})
        except ValidationError as error:
            raise InputError(f"detect: peak: {complaint(error)}") from error
        settings = settings.model_copy(update={"peak": peak})
    if engine not in list(Engine):
        raise InputError(f"detect: engine must be {', '.join(Engine)} ({engine})")
    _check_jobs("detect", jobs)
    chosen = Engine(engine)
    with named():
        processes = engines.processes(chosen, len(lines), jobs)
        if processes == 1:
            found = [engines.run(chosen, lines, settings, progress)]
            return Table.joined(list(shaded(found, settings)) or found)
        recording = checked(lines, settings)  # here, where it knows the number of a bad line
        engines.prepare(chosen, settings)
        starts = range(0, len(recording), engines.BLOCK)
        blocks = (part(recording, slice(first, first + engines.BLOCK)) for first in starts)
        found = []
        with engines.streamed(chosen, blocks, settings, processes) as results:
            for points in results:
                found.append(points)
                if progress is not None:
                    progress(int(points.line[-1]) + 1)
        return Table.joined(found)


def to_frame(points: Table) -> "pd.DataFrame":
    """Return points as a pandas data frame with the columns of points.csv.

    Args:
        points: What ``detect`` returns, n rows.

    Returns:
        n rows, as ``Table.to_frame`` has them.

    Raises:
        MissingError: if pandas is not installed.

    Example:
        >>> import vrscan
        >>> points = vrscan.detect(vrscan.simulate("plane", 64, fidelity="minimal"))
        >>> frame = vrscan.to_frame(points)
        >>> len(frame), list(frame.columns[:3])
        (64, ['line', 'peak', 'flags'])
    """
    if not isinstance(points, Table):
        raise InputError(f"to_frame: points must be what detect returns, not {_named(points)}")
    return points.to_frame()


def _configured(config: ConfigSource) -> Config:
    """Return the instrument, from its file if it is in one."""
    if isinstance(config, Config):
        return config
    if not (config is None or isinstance(config, str | os.PathLike)):
        raise InputError(
            f"config must be a vrscan.Config, a file or the name of a preset, not {_named(config)}"
        )
    return load_config(None if config is None else Path(config))


def _named(value: object) -> str:
    """Return what a value is, for a message: its type, and an array's shape."""
    kind, shape = type(value).__name__, getattr(value, "shape", None)
    return kind if shape is None else f"{kind} {list(shape)} of {getattr(value, 'dtype', '?')}"


def _check_jobs(name: str, jobs: int) -> None:
    if jobs < 0:
        raise InputError(f"{name}: jobs must not be negative ({jobs})")
