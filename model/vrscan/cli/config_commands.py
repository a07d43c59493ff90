"""The commands ``vrscan config`` and ``vrscan new``: a configuration as text, and another one."""

import math
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from vrscan.cli.progress import console as _console
from vrscan.cli.progress import step
from vrscan.data import config as configuration
from vrscan.data.boards import SHIPPED
from vrscan.data.config import UNITS_MM, Config, Geometry, checked
from vrscan.data.config_text import text
from vrscan.data.errors import InputError
from vrscan.data.points import atomic_file
from vrscan.registers.chain_registers import Registers


def config(
    source: Annotated[
        Path | None,
        typer.Option("--config", help="Preset, or TOML file whose values override the defaults."),
    ] = None,
) -> None:
    """Print a configuration as TOML: every value with its meaning, unit and range."""
    print(text(configuration.load(source)), end="")


def _asked(option: str, words: str, given: float | None, default: float) -> float:
    """Return the value of an option, which is asked for if it is not given."""
    if given is not None:
        return given
    try:
        return float(typer.prompt(words, default=default, type=float))
    except typer.Abort as error:
        raise InputError(f"{option}: neither given nor answered") from error


def new(
    file: Annotated[Path, typer.Argument(help="File for the configuration, .toml.")],
    base_mm: Annotated[float | None, typer.Option(help="Base, mm.")] = None,
    bias_deg: Annotated[float | None, typer.Option(help="Angle of the camera, degrees.")] = None,
    focal_mm: Annotated[float | None, typer.Option(help="Focal length, mm.")] = None,
    f_number: Annotated[float | None, typer.Option(help="f-number of the lens.")] = None,
    line_length: Annotated[int | None, typer.Option(help="Pixels of the sensor.")] = None,
    pitch_um: Annotated[float | None, typer.Option(help="Pitch of the pixels, um.")] = None,
    pixel_width: Annotated[int | None, typer.Option(help="Bits of a pixel.")] = None,
    near_mm: Annotated[float | None, typer.Option(help="Near end of the range, mm.")] = None,
    far_mm: Annotated[float | None, typer.Option(help="Far end of the range, mm.")] = None,
    rate_hz: Annotated[float | None, typer.Option(help="Lines in a second.")] = None,
    clock_mhz: Annotated[float | None, typer.Option(help="The FPGA's clock, MHz.")] = None,
    picture: Annotated[Path | None, typer.Option(help="File for the triangle, .png.")] = None,
    scene: Annotated[
        Path | None, typer.Option(help="File for a scene within its range, .toml.")
    ] = None,
) -> None:
    """Write the configuration of another scanner, after checking that it sees its whole range.

    What is not given as an option is asked for.
    """
    from vrscan.study import layout

    usual = Config()
    geometry, sensor, free = usual.geometry, usual.sensor, usual.free
    near = _asked("--near-mm", "near end of the range, mm", near_mm, usual.focus.near_mm)
    far = _asked("--far-mm", "far end of the range, mm", far_mm, usual.focus.far_mm)
    base = _asked("--base-mm", "base, mm", base_mm, geometry.base_mm)
    bias = _asked("--bias-deg", "angle of the camera, degrees", bias_deg, geometry.bias_deg)
    focal = _asked("--focal-mm", "focal length, mm", focal_mm, geometry.focal_mm)
    aperture = _asked("--f-number", "f-number", f_number, free.f_number)
    length = _asked("--line-length", "pixels of the sensor", line_length, sensor.line_length)
    pitch = _asked("--pitch-um", "pitch of the pixels, um", pitch_um, 1e3 * geometry.pitch_mm)
    bits = _asked("--pixel-width", "bits of a pixel", pixel_width, sensor.pixel_width)
    of_board = f"the FPGA's clock, MHz; that of a {SHIPPED.title}"
    clock = _asked("--clock-mhz", of_board, clock_mhz, 1e-6 * SHIPPED.clock_hz)
    clocked = {
        "clock": usual.clock.model_copy(update={"frequency_hz": 1e6 * clock}),
        "sensor": sensor.model_copy(update={"line_length": int(length)}),
    }
    most = math.floor(usual.model_copy(update=clocked).most_lines_hz)
    rate = _asked("--rate-hz", "lines in a second", rate_hz, min(usual.line.rate_hz, most))
    for option, count in (("--line-length", length), ("--pixel-width", bits)):
        if count != int(count):
            raise InputError(f"{option} = {count:g}: not a whole number")
    # In the sum of 1 / z between both ends the blur at either end is the same.
    focus = 2.0 / (1.0 / near + 1.0 / far) if min(near, far) > 0.0 else free.focus_mm
    # The finest unit of length in which the far end fits.
    fitting = [unit for unit in UNITS_MM if far < Geometry(unit_mm=unit).range_mm]
    unit_mm = min(fitting, default=UNITS_MM[-1])
    values: dict[str, object] = {
        "clock": {"frequency_hz": 1e6 * clock},
        "geometry": {
            "base_mm": base,
            "bias_deg": bias,
            "focal_mm": focal,
            "pitch_mm": round(1e-3 * pitch, 9),
            "unit_mm": unit_mm,
        },
        "free": {"focus_mm": round(focus, 1), "f_number": aperture, "far_mm": far},
        "map": {"focus_mm": round(focus, 1)},
        "focus": {"near_mm": near, "far_mm": far},
        "line": {"rate_hz": rate},
        "sensor": {"line_length": int(length), "pixel_width": int(bits)},
    }
    made = checked(Config, values, str(file))
    layout.check(made, near, far)
    Registers.from_config(made)
    found = layout.layout(made, near, far)
    if picture is not None and picture.suffix != ".png":
        raise InputError(f"{picture}: the name does not end in .png")
    if scene is not None and scene.resolve() == file.resolve():
        raise InputError(f"--scene {scene}: that is the configuration's file")
    with ExitStack() as stack:  # all files or none
        stack.enter_context(atomic_file(file)).write(text(made, chosen=True).encode())
        if picture is not None:
            layout.picture(made, near, far, stack.enter_context(atomic_file(picture)))
        if scene is not None:
            board = layout.scene(made, focus)
            stack.enter_context(atomic_file(scene)).write(board.encode())
    console = _console()
    console.print(layout.terminal(made, near, far))
    console.print(layout.summary(made), highlight=False)
    console.print(layout.sheet(found).terminal("over the range, on the resting beam"))
    seen = () if scene is None else (scene,)
    print(f"{file}: {step('scan', *seen, '--config', file)}")
