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
PAUSE_S = 0.25  # before a new search
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
        # From the next crossing on they hold.
        board.wait(round(2 * CONFIG.clock.frequency_hz / CONFIG.mirror.frequency_hz))
        for k in range(writes):
            if k == before:
                board.stall()
            name, word = write(chance)
            try:
                device.command(Command.WRITE, protocol.write(REGISTERS[name].address, [word]))
                taken += 1
            except LinkError:  # it does not take this word
                pass
    if before >= writes:
        board.stall()
    return taken


def stuck(port: Path, writes: int, before: int, seed: int) -> tuple[float, float, int]:
    """Attack a new board; return the s from the last edge to the last pulse and light, and words.

    The first ``before`` words come while the mirror still moves.
    """
    with Board(SCENE, CONFIG, port=port, swinging=True, seed=seed) as board:
        taken = attacked(board, generator(seed), writes, before)
        board.wait(round(1.2 * LIGHT_S * CONFIG.clock.frequency_hz))
        status = board.status()
    clock = status.clock_hz
    pulse = (status.pulse_at - status.edge_at) / clock
    light = (status.startup_at - status.edge_at) / clock
    last = (status.clocks - status.stalled_at) / clock
    print(f"\n{taken} words, {1e3 * last:.0f} ms of a stuck mirror; from the last edge ", end="")
    print(f"to the last pulse {1e3 * pulse:.3f} ms, to the last light {1e3 * light:.3f} ms")
    assert status.edge_at > 0 and status.pulse_at > 0 and status.stalled_at > 0
    assert last > LIGHT_S
    assert pulse <= PULSE_S
    assert light <= LIGHT_S or light >= PAUSE_S
    assert status.startup_most <= STARTUP_CEILING
    return pulse, light, taken


def test_a_stuck_mirror_is_dark_after_three_half_turns(tmp_path: Path) -> None:
    """The drive goes on, and the limits of the index are lifted: the pulses have 3/2 turns."""
    pulse, light, _ = stuck(tmp_path / "port", 0, 0, 1)
    period = 1 / CONFIG.mirror.frequency_hz
    # The last edge is the inward one, 0.19 periods behind the outward one, or that itself.
    assert 1.25 * period < pulse < 1.5 * period + 2e-6
    assert light > 0


@pytest.mark.parametrize(
    ("befores", "writes"), [([0], 200), in_volume([0, 0, 1, 3, 10], 2000)], ids=["short", "long"]
)
def test_no_host_lights_a_stuck_mirror(befores: list[int], writes: int, tmp_path: Path) -> None:
    total = 0
    for turn, before in enumerate(befores):
        pulse, light, taken = stuck(tmp_path / f"port{turn}", writes, before, turn + 2)
        # Not dark before it was stuck, where nothing had been written by chance.
        assert before or (pulse > 0 and light > 0)
        total += taken
    assert total > len(befores) * writes // 2
