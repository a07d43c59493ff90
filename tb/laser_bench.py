"""What the tests of the laser's modules share: open registers, and inputs of every kind."""

import abc
import dataclasses
from operator import attrgetter

import numpy as np
from cocotb.triggers import Timer
from harness import TwinBench, as_integer, drive, parameters, port

from vrscan.clocked.laser_interlock import Ceilings, LaserInterlock
from vrscan.data import pkg
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.settings import LaserSettings, Settings

OFF, SWEEP, SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
RUN, FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT
STATES = (OFF, SWEEP, SETTLE, RUN, FAULT)
POWER_MAX = (1 << pkg.POWER_WIDTH) - 1

CEILINGS = {
    "PowerCeiling": "power",
    "StartupCeiling": "startup",
    "PulseCeilingClks": "pulse_clks",
    "DrainCeiling": "drain",
    "BucketCeiling": "bucket",
    "WatchdogCeilingClks": "watchdog_clks",
}
# Where the ceilings are met often.
LOW = {
    "CountWidth": 3,
    "PowerCeiling": 40_000,
    "StartupCeiling": 300,
    "PulseCeilingClks": 12,
    "DrainCeiling": 9_000,
    "BucketCeiling": 600_000,
    "WatchdogCeilingClks": 150,
}

OPEN = LaserSettings(
    enable=1,
    adapt=0,
    shared=0,
    power=20_000,
    power_min=240,
    power_max=POWER_MAX,
    startup=250,
    target=1 << 15,
    cut=1 << 12,
    down=1 << 13,
    up=3 << 12,
    search=1 << 13,
    index_begin=0xF000,
    index_end=0x1000,
    limit_power=30_000,
    limit_startup=280,
    limit_pulse_clks=10,
    limit_drain=8_000,
    limit_bucket=580_000,
    watchdog_clks=140,
)
POINT = {
    "point_valid": 0,
    "point_measured": 0,
    "point_saturated": 0,
    "point_maximum": 0,
    "point_background": 0,
    "point_power": 0,
    "point_inward": 0,
    "point_test": 0,
}
# Where the inputs of a twin are: the fields of the point, and how far up.
FIELDS = {
    "point_measured": ("measured", 0),
    "point_saturated": ("flags", pkg.FLAG_SATURATED),
    "point_background": ("background", pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH),
    "point_power": ("line.power", 0),
    "point_inward": ("line.inward", 0),
    "point_test": ("line.test", 0),
}


def ceilings() -> Ceilings:
    """Return the ceilings of the running elaboration."""
    return Ceilings(**{CEILINGS[k]: v for k, v in parameters().items() if k in CEILINGS})


def count_width() -> int:
    """Return the bits of the running elaboration's counters."""
    return parameters().get("CountWidth", 16)


def spare() -> int:
    """Return the bits by which a pixel is narrower than a height."""
    return pkg.ALIGNED_WIDTH - parameters().get("PixelWidth", 12)


def pixel(height: int) -> int:
    """Return the largest height of a pixel up to the given one."""
    return height >> spare() << spare()


def random_settings(draw: np.random.Generator, opened: Settings) -> Settings:
    """Return settings, often those given, often with a value at an end of its range."""
    values = dict(vars(opened))
    for name in values:
        width = REGISTERS[f"laser_{name}"].width
        if draw.random() < 0.25:
            values[name] = int(draw.choice([0, 1, (1 << width) - 1, draw.integers(1 << width)]))
    often = {
        "enable": (0.95, int(draw.random() < 0.95)),
        "adapt": (1.0, int(draw.random() < 0.7)),
        "limit_bucket": (0.8, int(draw.integers(300_000, 900_000))),
        "limit_pulse_clks": (0.8, int(draw.integers(1, 20))),
        "watchdog_clks": (0.8, int(draw.integers(20, 200))),
    }
    for name, (chance, value) in often.items():
        if name in values and draw.random() < chance:
            values[name] = value
    return type(opened)(**values)


class Scene:
    """Draws inputs that reach every state: lines with pulses, a host, a mirror, points."""

    def __init__(self, draw: np.random.Generator, quiet: dict[str, int]) -> None:
        self.draw = draw
        self.quiet = quiet
        self.inputs = {"pulse": 0, "phase": 0} | quiet

    def step(self) -> dict[str, int]:
        """Return the inputs of the next clock, those that the module has."""
        draw, inputs = self.draw, self.inputs
        chance = draw.random(11)
        if chance[0] < 0.01:
            weights = (0.05, 0.1, 0.1, 0.7, 0.05)
            inputs["state"] = int(draw.choice(STATES, p=weights))
        if chance[1] < 0.01:
            inputs["index_alive"] = int(draw.random() < 0.9)
        for name in ("scanning", "startup_ok"):
            if draw.random() < 0.005:
                inputs[name] = int(draw.random() < 0.9)
        if chance[2] < 0.004:
            inputs["guard_ok"] = int(draw.random() < 0.8)
            inputs["guard_fault"] = int(draw.choice([0, draw.integers(32)]))
        inputs["alive"] = int(chance[3] < 0.02)
        inputs["pulse"] = int(chance[4] < (0.85 if inputs["pulse"] else 0.15))
        inputs["centre"] = int(chance[5] < (0.2 if inputs["pulse"] else 0.02))
        inputs["line_start"] = int(chance[6] < 0.1)
        inputs["phase"] = (inputs["phase"] + int(draw.integers(900))) % (1 << 16)
        inputs["inward"] = int(inputs["phase"] < 1 << 15)
        if chance[8] < 0.02:
            inputs["power"] = int(draw.choice([0, 1, POWER_MAX, draw.integers(1 << 16)]))
        if chance[9] < 0.02:
            inputs["armed"] = int(chance[10] < 0.8)
        inputs["point_valid"] = 0
        if chance[7] < 0.04 and "point_valid" in self.quiet:
            height = int(draw.choice([0, 100, 1 << 15, POWER_MAX, draw.integers(1 << 16)]))
            inputs |= {
                "point_valid": 1,
                "point_measured": int(draw.random() < 0.7),
                "point_saturated": int(draw.random() < 0.2),
                "point_maximum": pixel(height),
                "point_background": int(draw.choice([0, 500, draw.integers(1 << 16)])),
                "point_power": int(draw.choice([0, 1, 300, POWER_MAX, draw.integers(1 << 16)])),
                "point_inward": int(draw.integers(2)),
                "point_test": int(draw.random() < 0.1),
            }
        return {name: inputs[name] for name in self.quiet}


class SettingsBench(TwinBench):
    """A bench of a module that takes the laser's registers.

    Args:
        dut: The top module.
        quiet: The inputs after a reset.
        outputs: By the name of each output, what the twin calls it.
    """

    def __init__(self, dut, quiet: dict[str, int], outputs: dict[str, str]) -> None:
        super().__init__(dut, quiet)
        self.quiet = quiet
        self.settings: Settings | None = None
        self.compared = [
            (name, port(dut, f"{name}_o"), attrgetter(place)) for name, place in outputs.items()
        ]

    @abc.abstractmethod
    def twin_of(self, settings: Settings) -> object:
        """Return a new twin with these registers."""

    def on_port(self, name: str, value: int) -> tuple[str, int]:
        if name == "point_maximum":
            return "maximum", value >> spare()
        place, shift = FIELDS.get(name, (name, 0))
        return place, int(value) << shift

    def set(self, settings: Settings) -> None:
        """Change the registers."""
        before = self.settings.ports if self.settings else {}
        for name, value in settings.ports.items():
            if before.get(name) != value:
                drive(port(self.dut, f"{name}_i"), value)
        self.settings = settings
        if self.twin is not None:
            self.twin.settings = settings

    async def start(self, settings: Settings, **inputs: int) -> None:
        """Set the registers and reset for a clock, with these inputs."""
        self.set(settings)
        await self.reset_to(self.twin_of(settings), **(self.quiet | inputs))
        self.check()

    def check(self) -> None:
        """Compare all outputs that are registers."""
        for name, handle, of_twin in self.compared:
            got, want = as_integer(handle), int(of_twin(self.twin))
            assert got == want, f"clock {self.clock}, {name}: {got}, want {want}, {self.inputs}"


class LightBench(SettingsBench):
    """A bench of a module that has the interlock, with its lines and the way into RUN."""

    def __init__(self, dut, quiet: dict[str, int], outputs: dict[str, str]) -> None:
        super().__init__(dut, quiet, outputs)
        self.lit = False  # the main channel in the last clock
        self.shown = 0  # its level

    @property
    def interlock(self) -> LaserInterlock:
        """Return the twin of the interlock."""
        return self.twin

    def check_gates(self) -> None:
        """Compare what hangs on an input of the same clock."""
        got, want = as_integer(self.dut.pulse_o), int(self.interlock.gate(self.inputs["pulse"]))
        assert got == want, f"clock {self.clock}, pulse: {got}, want {want}, {self.inputs}"

    async def start(self, settings: Settings, **inputs: int) -> None:
        await super().start(settings, **inputs)
        self.lit = False

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks with these inputs, and look at the gates before each edge."""
        self.give(**inputs)
        for _ in range(count):
            await Timer(1, "ns")
            self.check_gates()
            self.lit = bool(as_integer(self.dut.pulse_o))
            self.shown = self.interlock.power
            await super().clocks()

    async def line(self, clks: int = 4, period: int = 30, **inputs: int) -> list[tuple[int, int]]:
        """Go on by a line with a pulse of some clocks; return pulse and power of each clock."""
        shown = []
        for k in range(period):
            marks = {
                "line_start": k == 0,
                "pulse": k < clks,
                "centre": k == clks // 2,
                "alive": k == 0,
            }
            await self.clocks(**{n: v for n, v in marks.items() if n in self.quiet}, **inputs)
            shown.append((int(self.lit), self.shown))
        return shown

    async def into_run(self, settings: Settings, **inputs: int) -> None:
        """Reset and go on until pulses are permitted."""
        await self.start(settings, **inputs)
        for _ in range(3):
            await self.line(0, state=RUN, index_alive=1, **inputs)
        await self.clocks(alive=1)
        assert self.interlock.permit


def part(kind: type[Settings]) -> Settings:
    """Return the open settings of one module."""
    return kind(**{field.name: getattr(OPEN, field.name) for field in dataclasses.fields(kind)})
