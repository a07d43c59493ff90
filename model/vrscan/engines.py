"""The three engines behind one call: the RTL, its bit-accurate model and the float equations."""

from collections.abc import Callable
from enum import StrEnum

from vrscan.config import Config
from vrscan.contract import checked
from vrscan.ideal import chain as ideal
from vrscan.lines import Lines
from vrscan.points import table
from vrscan.registers import Registers, angle_turns
from vrscan.table import Table


class Engine(StrEnum):
    """Who turns lines into points."""

    RTL = "rtl"
    FIXED = "fixed"
    IDEAL = "ideal"


def run(
    engine: Engine,
    recording: Lines,
    config: Config,
    progress: Callable[[int], None] | None = None,
) -> Table:
    """Return the point of each line.

    Args:
        engine: Who computes it.
        recording: n lines; none give an empty table.
        config: Thresholds and geometry.
        progress: Called with the number of lines done so far.

    Raises:
        InputError: if the configuration does not fit in the registers, or ``contract.checked``
            refuses the lines: the same ones for every engine, with the same text.
    """
    registers = Registers.from_config(config)  # checks the configuration for every engine alike
    recording = checked(recording, config, pixels=False)  # each engine reads the pixels itself
    lines, power, raised = recording.lines, recording.power, recording.mirror_flags
    if engine is Engine.IDEAL:
        return ideal.run(lines, recording.angle_rad, power, config, progress, mirror_flags=raised)
    angle = angle_turns(recording.angle_rad)
    # Imported here, because the RTL engine needs a compiler and the others do not.
    if engine is Engine.FIXED:
        from vrscan.chain import run_fixed

        return table(run_fixed(lines, angle, power, registers, progress, mirror_flags=raised))
    from vrscan.rtl import run_rtl

    return table(run_rtl(lines, angle, power, registers, progress, mirror_flags=raised))
