"""The RTL's mirror loop as an engine: against the simulated mirror, or on recorded samples."""

import ctypes
import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from types import SimpleNamespace, TracebackType
from typing import Any, Self

import numpy as np

from vrscan.clocked import mirror_loop
from vrscan.data import pkg
from vrscan.data.arrays import all_rows
from vrscan.data.config import Config
from vrscan.data.edges import SAMPLES, Rows
from vrscan.engines.tools import hardware_root, rtl_module
from vrscan.engines.verilated import Design, build
from vrscan.registers.mirror_registers import MirrorRegisters
from vrscan.registers.structs import register_struct
from vrscan.scene.index_diode import IndexDiode

# The rows that the engine writes, as in tb/engine/mirror.cpp.
LINE = np.dtype([*mirror_loop.LINE.descr, ("angle_true", np.float64)])
MEASUREMENT = mirror_loop.MEASUREMENT

STATES = {
    pkg.MIRROR_OFF: "OFF",
    pkg.MIRROR_SWEEP: "SWEEP",
    pkg.MIRROR_SETTLE: "SETTLE",
    pkg.MIRROR_RUN: "RUN",
    pkg.MIRROR_FAULT: "FAULT",
}
FAULTS = {
    pkg.FAULT_NONE: "none",
    pkg.FAULT_SWEEP: "the sweep took too long",
    pkg.FAULT_SETTLE: "the amplitude did not settle in time",
    pkg.FAULT_INDEX: "the index was lost",
}
COUNTS = ("missing", "doubled", "impossible", "glitch", "overrun")
FLAG_NAMES = ("NOT_RUNNING", "INDEX_FAULT", "UNSETTLED")  # of lines, from pkg.FLAG_NOT_RUNNING on
_DEVICES = ("mems_mirror", "index_diode", "polygon_mirror")
_GROUPS = ("mirror", "mirror_limits", "motion", "line")  # in the order the engine takes them
_SETTINGS = [register_struct(name) for name in _GROUPS]
_TABLE, _STATUS = register_struct("table"), register_struct("mirror_status")
_NEVER = -1
CHUNK_S = 0.004  # mirror time between two progress reports


@dataclass(frozen=True)
class World:
    """Disturbances of the simulated mirror during a run, and the light on its diode.

    ``shock_rad_per_s`` is added to its velocity in the run's first clock. One of every
    ``drop_every`` passes over the diode is lost; 0 loses none.
    """

    natural_offset_hz: float
    damping_factor: float
    jitter_s: float
    noise_rad: float
    mark_rad: float
    width_rad: float
    beam_rad: float
    ambient_mw: float
    threshold_mw: float
    threshold_share: float
    hold_s: float
    startup_mw: float
    shock_rad_per_s: float
    start_angle: float
    start_velocity: float
    drop_every: int
    seed: int

    @classmethod
    def from_config(cls, config: Config, *, seed: int = 1) -> "World":
        """Return an undisturbed world: no drift, no shock, nothing dropped; a mirror at rest."""
        mems, diode = config.mems, IndexDiode.of(config)
        return cls(
            natural_offset_hz=0.0,
            damping_factor=1.0,
            jitter_s=1e-9 * mems.jitter_ns,
            noise_rad=1e-6 * mems.noise_urad,
            mark_rad=math.radians(config.mirror.index_deg),
            width_rad=diode.width_rad,
            beam_rad=diode.beam_rad,
            ambient_mw=diode.ambient_mw,
            threshold_mw=diode.threshold_mw,
            threshold_share=diode.threshold_share,
            hold_s=diode.hold_s,
            startup_mw=config.laser.startup_mw,
            shock_rad_per_s=0.0,
            start_angle=0.0,
            start_velocity=0.0,
            drop_every=0,
            seed=seed,
        )


class _World(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in list(World.__dataclass_fields__)[:-2]),
        *((name, ctypes.c_int64) for name in list(World.__dataclass_fields__)[-2:]),
    )


class _Log(ctypes.Structure):
    _fields_ = (("rows", ctypes.c_void_p), ("room", ctypes.c_int64), ("count", ctypes.c_int64))


@dataclass(frozen=True)
class Recording:
    """The reports of a run of the loop, as structured arrays.

    Attributes:
        lines: ``LINE`` rows, one for each line: the laser pulse's centre in half clocks; state,
            flags and the other values that the loop reports; and the mirror's true angle, rad.
        measurements: ``MEASUREMENT`` rows, one for each pair of crossings.
        samples: ``SAMPLES`` rows, one for each change of the inputs of index_capture; bit 0 is the
            oldest sample.
    """

    lines: Rows
    measurements: Rows
    samples: Rows

    @classmethod
    def joined(cls, parts: Sequence["Recording"]) -> "Recording":
        """Return consecutive recordings as one."""
        return all_rows(parts)


def polygon_parameters(config: Config) -> dict[str, int | float]:
    """Return the parameters of ``mirror_world`` for a polygon; none for another mirror."""
    if not config.mirror.polygon:
        return {}
    polygon = config.polygon
    return {
        "Facets": config.mirror.facets,
        "FacetHz": config.mirror.frequency_hz,
        "SpinUpS": polygon.spin_up_s,
        "SpeedShare": 1e-6 * polygon.speed_ppm,
        "HuntingHz": polygon.hunting_hz,
        "ErrorRad": 1e-6 * polygon.facet_urad,
    }


def _library(registers: MirrorRegisters, config: Config) -> ctypes.CDLL:
    mems = config.mems
    devices = hardware_root() / "tb" / "devices"
    hertz = round(registers.clock_hz)
    structs = zip((*_GROUPS, "table", "status"), (*_SETTINGS, _TABLE, _STATUS), strict=True)
    ports = "".join(f"#define {n.upper()}_WORDS {struct.words}\n" for n, struct in structs)
    for field in _STATUS.fields.values():
        ports += f"#define AT_{field.name.upper()} {field.low}, {field.width}\n"
    ports += f"#define ANGLE_WIDTH {pkg.ANGLE_WIDTH}\n#define ERROR_WIDTH {pkg.ERROR_WIDTH}\n"
    loop = Design(rtl_module("mirror_loop"), {"IndexOversample": registers.oversample})
    world = Design(
        devices / "mirror_world.sv",
        {
            "ClockHz": hertz,
            "StepClks": max(1, round(hertz * 1e-6)),
            "IndexOversample": registers.oversample,
            "NaturalHz": mems.natural_hz,
            "Quality": mems.quality,
            "Torque": mems.torque,
            "CombRad": math.radians(mems.comb_deg),
            "Bias": mems.asymmetry,
            **polygon_parameters(config),
        },
        [devices / f"{name}.sv" for name in _DEVICES],
    )
    harness = hardware_root() / "tb" / "engine" / "mirror.cpp"
    library = ctypes.CDLL(str(build("mirror", harness, ports, [loop, world])))
    library.mirror_create.restype = ctypes.c_void_p
    for name in ("mirror_run", "mirror_state", "mirror_fault"):
        getattr(library, name).restype = ctypes.c_int64
    return library


def _address(array: np.ndarray[Any, Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class Mirror:
    """The Verilated ``mirror_loop``, and the simulated mirror that it drives.

    Time is in clocks; clock 0 is the first one after the reset, and the loop is enabled in it.
    """

    def __init__(self, registers: MirrorRegisters, config: Config, world: World) -> None:
        """Build what has changed, reset the loop, and write the table.

        Raises:
            InputError: if the engine cannot be built.
        """
        self._library = _library(registers, config)
        self._handle = ctypes.c_void_p(self._library.mirror_create())
        self.registers = registers
        self.clock = 0
        self.configure(registers)
        self._library.mirror_world(self._handle, ctypes.byref(_World(*astuple(world))))
        table = {
            "table_write": np.ones(len(registers.table_amplitude), np.int64),
            "table_index": np.arange(len(registers.table_amplitude)),
            "table_amplitude": np.array(registers.table_amplitude),
            "table_midpoint": np.array(registers.table_midpoint),
        }
        rows = _TABLE.pack_rows(table)
        self._library.mirror_reset(self._handle, _address(rows), ctypes.c_int64(len(rows)))

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Free the simulation."""
        self._library.mirror_destroy(self._handle)

    def configure(self, registers: MirrorRegisters, *, enable: bool = True) -> None:
        """Set every register, ``mirror_enable`` and ``line_enable`` too; the table stays."""
        given = SimpleNamespace(**vars(registers), mirror_enable=enable, line_enable=True)
        words = [word for struct in _SETTINGS for word in struct.as_words(given)]
        self._library.mirror_configure(self._handle, (ctypes.c_uint32 * len(words))(*words))

    def run(
        self,
        clocks: int,
        world: World,
        *,
        until_state: int = _NEVER,
        replay: Rows | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Recording:
        """Run for a number of clocks, or until the loop reaches a state.

        Args:
            clocks: Largest number of clocks.
            world: Disturbances of the mirror; a shock comes in the first clock.
            until_state: One of ``STATES``, or -1 for none.
            replay: ``SAMPLES`` rows, rising in time, that replace those of the simulated diode.
            progress: Called with the number of clocks since the reset.

        Raises:
            RuntimeError: if the loop makes more reports than the line rate and the mirror's
                frequency allow.
        """
        end = self.clock + clocks
        parts: list[Recording] = []
        chunk = max(1, round(CHUNK_S * self.registers.clock_hz))
        samples = None if replay is None else np.ascontiguousarray(replay, SAMPLES)
        while self.clock < end and self.state != until_state:
            stop = min(end, self.clock + chunk)
            parts.append(self._chunk(stop, world, until_state, samples))
            world = World(**{**world.__dict__, "shock_rad_per_s": 0.0})
            if progress is not None:
                progress(self.clock)
        if not parts:
            parts.append(self._chunk(self.clock, world, until_state, samples))
        return Recording.joined(parts)

    def _chunk(self, stop: int, world: World, state: int, replay: Rows | None) -> Recording:
        span = stop - self.clock
        most = 2 * span // 32 + 4  # a line takes 32 clocks or more
        lines = np.zeros(min(most, 200_000), LINE)
        measurements = np.zeros(span // pkg.MIN_CROSSING + 4, MEASUREMENT)
        samples = np.zeros(min(span, 1_000_000) + 4, SAMPLES)
        logs = [_Log(rows.ctypes.data, len(rows), 0) for rows in (lines, measurements, samples)]
        self.clock = self._library.mirror_run(
            self._handle,
            ctypes.c_int64(stop),
            ctypes.c_int64(state),
            ctypes.byref(_World(*astuple(world))),
            *(ctypes.byref(log) for log in logs),
            None if replay is None else _address(replay),
            ctypes.c_int64(0 if replay is None else len(replay)),
        )
        if any(log.count > log.room for log in logs):
            raise RuntimeError("mirror engine: more reports than there was room for")
        return Recording(*(rows[: log.count].copy() for rows, log in zip(
            (lines, measurements, samples), logs, strict=True)))  # fmt: skip

    @property
    def state(self) -> int:
        """Return the loop's present state, one of ``STATES``."""
        return int(self._library.mirror_state(self._handle))

    @property
    def fault(self) -> int:
        """Return the reason of the state FAULT, one of ``FAULTS``."""
        return int(self._library.mirror_fault(self._handle))

    @property
    def counts(self) -> dict[str, int]:
        """Return the loop's counters of faults, by the names of ``COUNTS``."""
        values = np.zeros(len(COUNTS), np.int64)
        self._library.mirror_counts(self._handle, _address(values))
        return dict(zip(COUNTS, values.tolist(), strict=True))
