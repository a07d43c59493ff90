"""A ``FakeBoard`` that sees a scene: the twin's points of simulated lines, with the mirror in RUN.

.venv/bin/python tb/scene_board.py build/view/port
"""

import sys
import time
from pathlib import Path

import numpy as np
from fake_board import CLOCK_HZ, FakeBoard

import vrscan
from vrscan.data import pkg
from vrscan.data.arrays import Pixels
from vrscan.data.config import Config
from vrscan.data.points import Points
from vrscan.data.records import FREE_ALIGN, FULL, INWARD, MEASURED, MORE_FLAGS, Records
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.link.device import RUN
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.registers.values import from_scaled, integer

CONFIG = Config()


def full_records(found: Points, power: int) -> Records:
    """Return points as full records, which hold all of them: one line after the other."""
    made = np.zeros(len(found), FULL)
    for name in set(FULL.names or ()) & set(vars(found)):
        made[name] = getattr(found, name) & 0xFFFF if name == "flags" else getattr(found, name)
    inward = np.diff(found.angle, prepend=found.angle[0]) < 0
    made["bits"] = found.measured * MEASURED + inward * INWARD
    for bit, flag in MORE_FLAGS.items():
        made["bits"] |= ((found.flags >> flag & 1) << bit).astype(np.uint8)
    for name, end in (("x", found.free_from), ("z", found.free_to)):
        made[name] = np.where(found.measured, made[name], end << FREE_ALIGN)
    made["power"], made["confidence"] = power, 255
    made["time"] = found.line * (CLOCK_HZ // 37400)
    return made


def scene_lines(count: int, fidelity: str = "minimal") -> tuple[Pixels, Records]:
    """Return lines of the default scene and the records of their points."""
    seen = vrscan.simulate("default", count, fidelity=fidelity, config=CONFIG)
    registers = Registers.from_config(CONFIG)
    found = run_fixed(seen.lines, angle_turns(seen.angle_rad), seen.power, registers)
    return seen.lines, full_records(found, int(seen.power[0]))


def let_see(board: FakeBoard, pixels: Pixels, made: Records) -> None:
    """Let a board run before these lines."""
    board.pixels, board.made, board.timed = pixels, made, True
    board.file.values["line_enable"] = [1]
    board.file.inputs |= {
        "line_length": pixels.shape[1],
        "mirror_state": RUN,
        "mirror_settled": 1,
        "mirror_measured": integer(from_scaled("mirror_measured", 20.5 / 360.0)),
    }


def main() -> None:
    """Be a board at a port until Ctrl-C; its mirror is not quite at rest."""
    path, draw = Path(sys.argv[1]), np.random.default_rng(1)
    with FakeBoard(path) as board:
        let_see(board, *scene_lines(1506, fidelity="auto"))
        print("ready", flush=True)
        while True:
            time.sleep(0.1)
            amplitude = 20.5 + 0.002 * draw.standard_normal()
            board.file.inputs |= {
                "mirror_measured": integer(from_scaled("mirror_measured", amplitude / 360.0)),
                "mirror_error": int(2.0**pkg.ANGLE_WIDTH * 1e-5 * draw.standard_normal()),
            }


if __name__ == "__main__":
    main()
