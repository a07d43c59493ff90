"""A configuration as the values that a host writes into a board's registers."""

from typing import Protocol

from vrscan.data.boards import with_clock
from vrscan.data.config import Clock, Config
from vrscan.data.errors import InputError
from vrscan.registers.chain_registers import Registers
from vrscan.registers.focus_registers import FocusRegisters
from vrscan.registers.laser_registers import LaserRegisters
from vrscan.registers.map_table import map_registers
from vrscan.registers.mirror_registers import MirrorRegisters
from vrscan.registers.sensor_registers import SensorRegisters

# Registers that are not in a configuration: the host writes them to cause something.
CONTROLS = frozenset(
    {
        *("scratch", "uart_step", "mirror_enable", "line_enable", "laser_enable"),
        *("test_position", "test_move", "test_step", "test_height", "test_pedestal", "test_noise"),
        *("test_seed", "test_lines", "test_period_clks", "test_angle", "test_power"),
        *("test_start", "test_stop", "commit", "map_bank", "map_access_bank"),
        *("points_batch", "points_timeout_clks"),
    }
)


class Build(Protocol):
    """The build of a board, as given by its registers of these names."""

    @property
    def clock_hz(self) -> int:
        """Return the frequency of the board's clock, Hz."""

    @property
    def line_length(self) -> int:
        """Return ``LineLength``, px."""

    @property
    def pixel_width(self) -> int:
        """Return ``PixelWidth``, bits."""

    @property
    def index_oversample(self) -> int:
        """Return ``IndexOversample``."""


def on_build(config: Config, build: Build) -> Config:
    """Return a configuration with the clock of a board, and its sampling unless it says another.

    Raises:
        InputError: in one line with the key, if it is for another line, sensor or sampling than the
            board's, or its lines are too many for the board's clock.
    """
    mirror, built = config.mirror, build.index_oversample
    if "oversample" not in mirror.model_fields_set:
        mirror = mirror.model_copy(update={"oversample": built})
    for key, wanted, register, has in (
        ("sensor.line_length", config.sensor.line_length, "line_length", build.line_length),
        ("sensor.pixel_width", config.sensor.pixel_width, "pixel_width", build.pixel_width),
        ("mirror.oversample", mirror.oversample, "index_oversample", built),
    ):
        if wanted != has:
            raise InputError(
                f"{config.source}: {key} = {wanted}: the board is built with {register} = {has}"
            )
    clock = Clock(frequency_hz=float(build.clock_hz))
    on_board = config.model_copy(update={"clock": clock, "mirror": mirror})
    complaint = on_board.rate_complaint()
    if complaint:
        board = with_clock(build.clock_hz)
        if board is not None:
            complaint += f"; --config {board.preset} has a rate that a {board.title} takes"
        raise InputError(f"{config.source}: {complaint}")
    return on_board


def settings(config: Config, build: Build) -> dict[str, int | tuple[int, ...]]:
    """Return the value of every register and table that a configuration sets, but for the maps.

    ``Device.load`` brings the nodes of the maps into the bank that is not in use.

    Args:
        config: The configuration; its clock is not used, because the board has its own.
        build: The build of the board.

    Returns:
        Integers by the name of the register, tuples where it has several values; those of a table
        by the names of its fields, one integer for each entry.

    Raises:
        InputError: in one line with the key, as ``on_build``, or if a value does not fit in its
            register.
    """
    on_board = on_build(config, build)
    values: dict[str, int | tuple[int, ...]] = {}
    for registers in (
        Registers.from_config(on_board),
        MirrorRegisters.from_config(on_board),
        SensorRegisters.from_config(on_board),
        FocusRegisters.from_config(on_board),
        LaserRegisters.from_config(on_board),
    ):
        values |= {name: value for name, value in registers.ports.items() if name not in CONTROLS}
    return values | map_registers(on_board)
