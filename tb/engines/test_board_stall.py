"""A mirror that is stuck while a host writes what it likes: the light at the board's pins.

The board counts its clocks at the last edge of the index, the last pulse and the last light of the
start-up channel, all of it at the pins. ``pytest -s`` shows the figures. The host keeps mirror and
laser switched on more often than not, and the limits of the index at their ends, or chance would
soon have ended all light.
"""

from pathlib import Path

import numpy as np
import pytest
from harness import generator, in_volume
from slow_board import CONFIG, SCENE

from vrscan.engines.board import Board
from vrscan.link import protocol
from vrscan.link.device import Device
from vrscan.link.protocol import Command
from vrscan.link.transport import LinkError
from vrscan.registers import values
from vrscan.registers.register_map import REGISTERS

TIMEOUT_S = 240.0  # of this machine
PULSE_S, LIGHT_S = 0.010, 0.025  # after the last edge of the index, whatever is written
PERIODS = 1.5  # after which there is no pulse while the drive is as it was
STARTUP_CEILING = 1311
# A lock would stop the attack, and another rate the host.
SPARED = {"uart_step"} | {name for name in REGISTERS if name.startswith("lock_")}
SWITCHES = {"mirror_enable": 1, "line_enable": 1, "laser_enable": 1}
LIMITS = [
    *("glitch_clks", "width_min_clks", "width_max_clks", "period_max_clks", "lost_timeout"),
    *("sweep_timeout", "settle_timeout", "settle_limit", "settle_count", "shock_limit"),
    *("laser_watchdog_clks", "laser_limit_pulse_clks", "laser_limit_startup", "work_word"),
    *("sweep_word", "sweep_rate", "laser_startup", "laser_index_begin", "laser_index_end"),
    *("trim_min", "trim_max", "hold_count", "phase_limit", "error_limit"),
]
TARGETS = [
    name
    for name, register in REGISTERS.items()
    if register.access in values.WRITABLE and name not in SPARED
]

pytestmark = pytest.mark.timeout(1800)


def write(chance: np.random.Generator) -> tuple[str, int]:
    """Return a register's name and a word for it, not always one that it takes."""
    kind = chance.random()
    if kind < 0.2:
        name = str(chance.choice(list(SWITCHES)))
        return name, int(chance.random() < 0.97)
    name = str(chance.choice(LIMITS if kind < 0.7 else TARGETS))
    register = REGISTERS[name]
    width = min(register.width, 32)
    ends = [0, 1, (1 << width) - 1, (1 << width - 1) - 1, int(chance.integers(1 << width))]
    return name, int(chance.choice(ends))


def attacked(board: Board, chance: np.random.Generator, writes: int, before: int) -> int:
    """Start the mirror, write, stop it meanwhile, and return how many writes were taken."""
    taken = 0
    with Device(str(board.port), timeout=TIMEOUT_S, keep_alive=False) as device:
        device.load(CONFIG)
        power = [("laser_adapt", 0), ("laser_power", CONFIG.laser.power_max)]
        device.write_many([*power, *SWITCHES.items()])
        device.wait_for_mirror()
        assert device.read("laser_status") & 0b0100111 == 0b0100111
        # What would keep index_alive up for ever: it is no attack if only chance finds it.
        words = [("period_max_clks", 0xFFFF_FFFF), ("width_max_clks", 0xFFFF_FFFF)]
        device.write_many([*words, ("lost_timeout", 0xFFFF_FFFF), ("laser_watchdog_clks", 0)])
        for k in range(writes):
            if k == before:
                board.stall()
            name, word = write(chance)
            try:
                device.command(Command.WRITE, protocol.write(REGISTERS[name].address, [word]))
                taken += 1
            except LinkError:  # it does not take this word
                pass
    return taken


@pytest.mark.parametrize(("rounds", "writes"), [(1, 200), in_volume(5, 2000)])
def test_a_stuck_mirror_is_dark_in_time(rounds: int, writes: int, tmp_path: Path) -> None:
    total = 0
    for turn in range(rounds):
        chance = generator(turn)
        # The first host writes nothing before; later ones have spoilt what they could.
        before = [0, 3, 10, 30, 100][turn]
        port = tmp_path / f"port{turn}"
        with Board(SCENE, CONFIG, port=port, swinging=True, seed=turn + 1) as board:
            total += attacked(board, chance, writes, before)
            board.wait(0)
            status = board.status()
        clock = status.clock_hz
        pulse = (status.pulse_at - status.edge_at) / clock
        light = (status.startup_at - status.edge_at) / clock
        last = (status.clocks - status.stalled_at) / clock
        print(
            f"\n{1e3 * last:.0f} ms of a stuck mirror; from the last edge of its index to the ",
            end="",
        )
        print(f"last pulse {1e3 * pulse:.3f} ms, to the last light {1e3 * light:.3f} ms")
        assert status.edge_at > 0 and status.pulse_at > 0 and status.stalled_at > 0
        assert last > LIGHT_S
        assert pulse <= PULSE_S and light <= LIGHT_S
        assert status.startup_most <= STARTUP_CEILING
        if not before:
            assert pulse <= PERIODS / CONFIG.mirror.frequency_hz + 1e-5
    print(f"{total} of {rounds * writes} words were taken")
    assert total > rounds * writes // 2
