"""What the tests of the autofocus share: settings, the table of a lens, and a bench."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from harness import TwinBench, generator

from vrscan.data import pkg
from vrscan.registers.focus_registers import FRACTION_WIDTH, TABLE_SIZE, Mode
from vrscan.registers.settings import FocusSettings

ADDRESS = 0x2A
MM = 1 << pkg.LENGTH_FRACTION
Z_BEGIN, Z_SHIFT = 240 * MM, 6
SETTINGS = FocusSettings(
    mode=Mode.OFF,
    manual=0,
    average_shift=2,
    lapse=6,
    z_begin=Z_BEGIN,
    z_shift=Z_SHIFT,
    hysteresis=10,
    hold_points=3,
    address=ADDRESS,
    quarter_clks=4,
    stretch_clks=300,
    poll_clks=150,
    tolerance=1,
    timeout_clks=40_000,
    retries=2,
    protocol=0,
)
POINT = {"measured": 1, "flags": 0, "test": 0}
TABLE_WRITE = {"table_write": 0, "table_index": 0, "table_position": 0}
PORTS = {"test": "line.test"}  # that have another name


def lens(distance: float) -> float:
    """Return the position of a lens that is sharp at a distance, mm, in steps."""
    return 25.0**2 / (distance - 25.0) / 0.5e-3


def table_distance(k: np.ndarray) -> np.ndarray:
    """Return the distances of the table's entries, mm."""
    return (Z_BEGIN + (k << Z_SHIFT + FRACTION_WIDTH)) / MM


TABLE = [round(float(p)) for p in lens(table_distance(np.arange(TABLE_SIZE)))]


class FocusBench(TwinBench):
    """A bench whose twin takes the settings beside the inputs.

    Attributes:
        period: Clocks from one ``point`` to the next.
    """

    period: int

    def __init__(self, dut, inputs: Iterable[str], salt: int) -> None:
        super().__init__(dut, [*inputs, *(f"focus_{name}" for name in vars(SETTINGS))])
        self.given = list(inputs)
        self.draw = generator(salt)
        self.settings = SETTINGS

    def on_port(self, name: str, value: int) -> tuple[str, int]:
        if name in TABLE_WRITE:
            return f"focus_{name}", value
        return PORTS.get(name, name), value

    def configure(self, **settings: int) -> None:
        """Change settings."""
        self.settings = replace(self.settings, **settings)
        self.give(**{f"focus_{name}": int(value) for name, value in settings.items()})
        if self.twin is not None:
            self.tell()

    def tell(self) -> None:
        """Tell the twin its settings."""
        self.twin.settings = self.settings

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks with these inputs."""
        self.give(**inputs)
        edge = self.dut.clk_i.falling_edge
        for _ in range(count):
            await edge
            self.twin.step(**{name: self.inputs[name] for name in self.given})
            self.clock += 1
            self.check()
            self.give(**{name: 0 for name in self.strobes if self.inputs[name]})

    async def write_table(self, table: list[int]) -> None:
        """Write the whole table."""
        for k, value in enumerate(table):
            await self.clocks(table_write=1, table_index=k, table_position=value)
        self.table = list(table)

    async def point(self, mm: float = 0.0, *, period: int | None = None, **point: int) -> None:
        """Give a point and wait for the next one's time."""
        await self.clocks(valid=1, **POINT | {"z": round(mm * MM)} | point)
        self.give(z=int(self.draw.integers(-(1 << 23), 1 << 23)))
        await self.clocks((self.period if period is None else period) - 1)

    async def points(self, mm: float, count: int, **point: int) -> None:
        """Give some points of one distance."""
        for _ in range(count):
            await self.point(mm, **point)
