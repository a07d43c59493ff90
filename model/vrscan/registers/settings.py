"""The registers that each module of the hardware takes, as the settings of its twin.

A settings class lists names; width, sign and number of values, what the value means and its unit
are those of the register in ``rtl/link/registers.toml``, which docs/registers.md prints.
"""

from dataclasses import dataclass, fields
from typing import ClassVar

from vrscan.data.bus import WRITABLE
from vrscan.registers.values import NAMES, Value, count, find

_WRITTEN = frozenset(name for name in NAMES if find(name).access in WRITABLE)


@dataclass(frozen=True)
class Settings:
    """Values of some registers, by their names without ``PREFIX``.

    Raises:
        ValueError: naming the register and the value, if one does not fit.
    """

    PREFIX: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Check the values against the bits of their ports; a register may allow fewer values."""
        for name, value in self.ports.items():
            several = value if isinstance(value, tuple) else (value,)
            width = find(name).width
            low = -1 << width - 1 if find(name).signed else 0
            if len(several) != count(name):
                raise ValueError(f"{name}: needs {count(name)} values ({len(several)})")
            if min(several) < low or max(several) >= low + (1 << width):
                raise ValueError(f"{name}: does not fit in {width} bits ({value})")

    @property
    def ports(self) -> dict[str, Value]:
        """The values of all fields that are registers, by their names."""
        values = {self.PREFIX + field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: tuple(value) if isinstance(value, tuple | list) else int(value)
            for name, value in values.items()
            if name in _WRITTEN
        }


@dataclass(frozen=True)
class IndexSettings(Settings):
    """What ``index_capture`` takes."""

    glitch_clks: int
    width_min_clks: int
    width_max_clks: int
    period_max_clks: int


@dataclass(frozen=True)
class PhaseSettings(Settings):
    """What ``mirror_phase`` takes."""

    phase_shift: int
    rate_shift: int
    amplitude_shift: int
    error_limit: int


@dataclass(frozen=True)
class AmplitudeSettings(Settings):
    """What ``amplitude_control`` takes."""

    amplitude_set: int
    k_p: int
    k_i: int
    level_min: int
    level_max: int
    level_low: int
    level_high: int
    level_nominal: int
    trim_step: int
    trim_gain: int
    trim_min: int
    trim_max: int
    trim_up: int
    settle_limit: int
    shock_limit: int
    phase_limit: int
    settle_count: int
    hold_count: int
    confidence_gain: int


@dataclass(frozen=True)
class DriveSettings(Settings):
    """What ``mirror_drive`` takes."""

    sweep_word: int
    work_word: int
    sweep_rate: int
    duty: int
    sweep_level: int
    sweep_timeout: int
    settle_timeout: int
    lost_timeout: int


@dataclass(frozen=True)
class TriggerSettings(Settings):
    """What ``line_trigger`` takes."""

    ratio: int
    exposure_delay_clks: int
    exposure_clks: int
    pulse_delay_clks: int
    pulse_clks: int


@dataclass(frozen=True)
class ReadoutSettings(Settings):
    """What ``line_tag`` takes."""

    readout_lag: int
    readout_stale: int
    readout_min_clks: int
    readout_max_clks: int


@dataclass(frozen=True)
class MotionSettings(Settings):
    """What ``motion_map`` takes; the harmonics are k = 1, 3 .. 17."""

    drive_phase: int
    motion_a: tuple[int, ...]
    motion_phi: tuple[int, ...]
    motion_da: tuple[int, ...]
    motion_dphi: tuple[int, ...]


@dataclass(frozen=True)
class ScanSettings(Settings):
    """What ``mirror_loop`` takes itself."""

    scan_facet: int
    scan_begin: int
    scan_span: int


@dataclass(frozen=True)
class TestLineSettings(Settings):
    """What ``test_line`` takes."""

    PREFIX: ClassVar[str] = "test_"

    position: int
    move: int
    step: int
    height: int
    pedestal: int
    noise: int
    seed: int
    lines: int
    period_clks: int


@dataclass(frozen=True)
class InterlockSettings(Settings):
    """What ``laser_interlock`` takes."""

    PREFIX: ClassVar[str] = "laser_"

    enable: int
    startup: int
    index_begin: int
    index_end: int
    limit_power: int
    limit_startup: int
    limit_pulse_clks: int
    limit_drain: int
    limit_bucket: int
    watchdog_clks: int


@dataclass(frozen=True)
class AdaptationSettings(Settings):
    """What ``power_adaptation`` takes."""

    PREFIX: ClassVar[str] = "laser_"

    enable: int
    adapt: int
    shared: int
    power: int
    power_min: int
    power_max: int
    target: int
    cut: int
    down: int
    up: int
    search: int


@dataclass(frozen=True)
class LaserSettings(InterlockSettings, AdaptationSettings):
    """What ``laser_control`` takes for its parts."""


@dataclass(frozen=True)
class FocusSettings(Settings):
    """What ``focus_control`` and its parts take; a ``mode`` of 3 acts as OFF."""

    PREFIX: ClassVar[str] = "focus_"

    mode: int
    manual: int
    average_shift: int
    lapse: int
    z_begin: int
    z_shift: int
    hysteresis: int
    hold_points: int
    address: int
    quarter_clks: int
    stretch_clks: int
    poll_clks: int
    tolerance: int
    timeout_clks: int
    retries: int
    protocol: int
