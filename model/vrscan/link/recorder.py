"""A recording of a board: its points, raw lines and state, in the channels of ``recordings``."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vrscan.data.config import Config
from vrscan.data.recordings import FLUSH_S, Writer
from vrscan.data.records import Records
from vrscan.link.link_report import captured_lines
from vrscan.link.register_host import Build
from vrscan.link.stream import Captured
from vrscan.registers import values
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.values import Value, integer

# Registers that tell of a board's state: the time, and what mirror, index, laser and lens do.
_TOLD = ("mirror_status", "laser_status", "focus_status")
STATE = ("uptime", "line_enable", *(n for n, each in REGISTERS.items() if each.struct in _TOLD))


class Recorder(Writer):
    """A recording that is on the disk as its data come; see ``Writer``.

    Args:
        target: The file.
        config: The configuration in the board.
        build: The board's identity.
        step: Distance of the lines whose points come.
    """

    def __init__(self, target: Path, config: Config, build: Build, step: int = 1) -> None:
        about = {"board": str(build.board_id), "firmware": build.version_text, "step": str(step)}
        super().__init__(target, config, about=about, flush_s=FLUSH_S)
        self._build = build

    def stream(self, found: Records) -> None:
        """Write records of a stream of points."""
        build = self._build
        self.records(found, build.clock_hz, build.pixel_width, build.length_unit)

    def captures(self, found: Sequence[Captured], *, points: bool = True) -> None:
        """Write raw lines, and their points unless a stream brings these, too."""
        made = [each.record for each in found if each.record is not None]
        if points and made:
            self.stream(np.concatenate(made))
        self.lines(captured_lines(found, self.clock(self._build.clock_hz)))

    def state(self, found: Mapping[str, Value]) -> None:
        """Write what was read of ``STATE``, in the registers' units, with its time."""
        clocks = np.array([integer(found["uptime"])])
        time_s = float(self.clock(self._build.clock_hz).beside(clocks)[0])
        scaled = {name: values.to_scaled(name, value) for name, value in found.items()}
        self.board({"time_s": time_s, **scaled}, time_s)
