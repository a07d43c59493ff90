"""The one file that knows the simulator: builds an RTL module and runs its cocotb tests.

A test file holds both sides.  pytest calls ``simulate`` once an elaboration; the simulator then
imports the same file again and runs every ``@cocotb.test()`` in it, which sweep the data.
"""

import abc
import contextlib
import functools
import hashlib
import json
import os
import random
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Self

import cocotb
import numpy as np
import pytest
from _pytest.mark import ParameterSet
from cocotb.clock import Clock
from cocotb.handle import LogicArrayObject, LogicObject
from cocotb.triggers import FallingEdge, ReadOnly, RisingEdge
from cocotb_tools.runner import Verilator
from filelock import FileLock

from vrscan.engines.tools import (
    build_folder,
    contracts,
    in_place,
    repository_root,
    rtl_closure,
    rtl_folders,
    rtl_module,
    rtl_packages,
    verilator_environment,
)
from vrscan.engines.verilated import Tools
from vrscan.registers.structs import Field, Struct, package_struct, register_struct

CLOCK_NS = 8

ANEW = "VRSCAN_ANEW"  # in the environment, every simulation runs
STOOD: list[str] = []  # the simulations of this process that did not have to run again


def in_volume(*values: object) -> ParameterSet:
    """Return parameters that only the long tests take, which make soak runs."""
    return pytest.param(*values, marks=pytest.mark.soak)


def each(elaborations: Sequence[Mapping[str, int]], kept: int = 2) -> list[object]:
    """Return the first elaborations for every run, and the others for the long tests only."""
    return [
        pytest.param(given, marks=[pytest.mark.soak] * (k >= kept))
        for k, given in enumerate(elaborations)
    ]


# A test of RTL whose cocotb tests ask ``rounds`` comes in both volumes.
EACH_VOLUME = pytest.mark.parametrize("volume", ["short", in_volume("long")])
SEED = 20100301  # printed by every simulation; one seed for all random data


# Simulations are short and cocotb takes most of their time, so a quick compilation is worth more
# than quick code; Verilator's runtime is compiled once, and well. A large model with short tests is
# not optimised at all: the compilation takes a quarter of the time.
_OPTIMISATION = {False: "-O1", True: "-O0"}


class _Verilator(Verilator):
    """Verilator with only the top level's own signals visible, and a warning as an error.

    What every model shares comes ready, by the variables ``shared``.
    """

    def __init__(self, shared: Sequence[str]) -> None:
        super().__init__()
        self._shared = shared

    def _build_command(self) -> list[list[str]]:
        verilate, make = super()._build_command()
        verilate.remove("--public-flat-rw")
        return [verilate, [*make, *self._shared]]


@functools.cache
def _shared(large: bool) -> list[str]:
    """Return the variables by which a Makefile takes what all models share, built if missing."""
    return Tools.found().shared(_OPTIMISATION[large])


@contextlib.contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.update(changes)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def _build(runner: _Verilator, log_file: Path, **arguments: object) -> None:
    """Build, and on failure show what Verilator or the compiler said."""
    try:
        runner.build(log_file=log_file, **arguments)
    except RuntimeError as error:
        raise RuntimeError("\n" + log_file.read_text()[-4000:]) from error


def _state(files: Iterable[str], circumstances: Sequence[str]) -> dict[str, str]:
    """Return what a result depends on: a hash of every file, and the circumstances."""
    state = {"circumstances": hashlib.sha256(repr(circumstances).encode()).hexdigest()}
    for name in files:
        file = Path(name)
        content = file.read_bytes() if file.is_file() else b"gone"
        state[name] = hashlib.sha256(content).hexdigest()
    return state


def _stands(kept: Path, circumstances: Sequence[str]) -> bool:
    """Return whether a simulation passed before, and nothing that it read has changed since."""
    if ANEW in os.environ or not kept.exists():
        return False
    before = json.loads(kept.read_text())
    return before == _state([name for name in before if name != "circumstances"], circumstances)


def _keep(kept: Path, reads: Path, verilated: Path, circumstances: Sequence[str]) -> None:
    """Note that a simulation passed, with all that it read: RTL, its tests, the model."""
    sources = verilated.read_text().partition(":")[2].split()
    files = [name for name in sources if name.endswith((".sv", ".vlt"))]
    state = _state([*files, *json.loads(reads.read_text())], circumstances)
    kept.write_text(json.dumps(state, indent=0))


def _source(module: str) -> Path:
    """Return the file of a module in ``rtl/`` or ``tb/devices``."""
    device = repository_root() / "tb" / "devices" / f"{module}.sv"
    return device if device.exists() else rtl_module(module)


def simulate(
    module: str,
    test_file: str,
    parameters: Mapping[str, int] | None = None,
    *,
    sources: Sequence[Path] | None = None,
    visible: Sequence[tuple[str, str]] = (),
    volume: str = "short",
    start: int = 1,
    only: str | None = None,
    large: bool = False,
) -> None:
    """Build ``module`` with ``parameters`` and run every cocotb test of ``test_file`` on it.

    A simulation has no chance in it, so one that passed stands until a file that it read changes;
    ``pytest --cache-clear`` runs it again all the same.

    Args:
        module: Name of the top module, in ``rtl/`` or ``tb/devices/``.
        test_file: ``__file__`` of the caller.
        parameters: Parameters that differ from the defaults. They reach the tests as
            ``parameters()``, so no number is stated twice.
        sources: Extra SystemVerilog files, before those of ``rtl/``; one with a package's name
            is in its place.
        visible: (module, signal) pairs below the top that the tests read or hold.
        volume: Which of the numbers of ``rounds`` holds, "short" or "long".
        start: Seed of what every register and memory holds before the reset.
        only: Pattern of the names of the cocotb tests that run; all if None.
        large: Whether the compilation takes longer than the tests.

    Raises:
        RuntimeError: if the build or a test fails.
    """
    parameters = dict(parameters or {})
    environment = verilator_environment()
    environment.pop("MAKEFLAGS", None)
    key = json.dumps([module, parameters, [str(s) for s in sources or ()], list(visible)])
    name = f"{module}_{hashlib.sha256(key.encode()).hexdigest()[:10]}"
    folder = build_folder() / "sim" / name
    folder.mkdir(parents=True, exist_ok=True)
    control = folder / "visible.vlt"
    lines = ["`verilator_config"]
    own = ((module, names) for names in ("*_*", "*Hz"))  # ports and clocks, but no genvar
    lines += [f'public_flat_rw -module "{m}" -var "{s}"' for m, s in (*own, *visible)]
    # With some parameters a range has no outside:
    lines.append('lint_off -rule CMPCONST -file "*/tb/contracts/*"')  # so a comparison is constant
    text = "\n".join(lines) + "\n"
    if not control.exists() or control.read_text() != text:
        control.write_text(text)
    path = os.pathsep.join(
        [
            str(p)
            for p in (repository_root() / "model", Path(__file__).parent, Path(test_file).parent)
        ]
        + sys.path
    )
    source = _source(module)
    packages = in_place(rtl_packages(), sources or ())
    extra = [file for file in sources or () if file not in packages]
    devices = repository_root() / "tb" / "devices"
    libraries = [part for place in [*rtl_folders(), devices] for part in ("-y", str(place))]
    stem = Path(test_file).stem
    kept = folder / f"{stem}_{volume}_{start}.json"
    with _environment(environment), FileLock(folder / "lock"):
        shared = _shared(large)
        searched = [*rtl_folders(), devices, devices.with_name("contracts")]
        places = sorted(str(f) for place in searched for f in place.glob("*.sv"))
        circumstances = [*shared, sys.version, str(only), *places]
        circumstances.append((repository_root() / "requirements.txt").read_text())
        if _stands(kept, circumstances):
            STOOD.append(kept.name)
            return
        reads = folder / "reads.json"
        for stale in (kept, reads):
            stale.unlink(missing_ok=True)
        runner = _Verilator(shared)
        _build(
            runner,
            sources=[
                control,
                *packages,
                *extra,
                source,
                *contracts(rtl_closure(source, [source, *devices.glob("*.sv")])),
            ],
            hdl_toplevel=module,
            parameters=parameters,
            build_args=["--assert", "-O3", *libraries],
            build_dir=folder,
            timescale=("1ns", "1ns"),
            log_file=folder / "build.log",
        )
        runner.test(
            hdl_toplevel=module,
            test_module=["reads", stem],
            test_dir=folder,
            results_xml=str(folder / "results.xml"),
            seed=SEED,
            test_filter=only,
            # Nothing is zero before it was written, as in a chip: a missing reset shows.
            plusargs=["+verilator+rand+reset+2", f"+verilator+seed+{start}"],
            extra_env={
                "PYTHONPATH": path,
                "VRSCAN_PARAMETERS": json.dumps(parameters),
                "VRSCAN_VOLUME": volume,
                "VRSCAN_READS": str(reads),
                # Of all files, numpy's too, it would rewrite the assertions.
                "COCOTB_REWRITE_ASSERTION_FILES": "test_*.py harness.py",
            },
        )
        _keep(kept, reads, folder / "Vtop__ver.d", circumstances)


def parameters() -> dict[str, int]:
    """Return the parameters of the running elaboration (inside the simulator)."""
    return json.loads(os.environ["VRSCAN_PARAMETERS"])


def rounds(short: int, long: int) -> int:
    """Return how often something random is tried in the running volume (inside the simulator)."""
    return {"short": short, "long": long}[os.environ["VRSCAN_VOLUME"]]


def generator(salt: int = 0) -> np.random.Generator:
    """Return a seeded generator; the same ``salt`` gives the same numbers in every run."""
    return np.random.default_rng([SEED, salt])


# Where a package's structs are known from, by the name of their type.
PACKAGES: dict[str, Callable[[str], Struct]] = {
    "register_pkg": register_struct,
    "vrscan_pkg": package_struct,
}
_STRUCT_PORT = re.compile(r"^ *(?:input|output) +(?:wire +)?(\w+)::(\w+_t) +(\w+_[io])\b", re.M)


class StructPort:
    """A port that is a struct, and what drives it."""

    def __init__(self, handle: LogicArrayObject, struct: Struct) -> None:
        assert len(handle) == struct.width, f"{handle._name}: not as wide as {struct.name}"
        self.handle = handle
        self.struct = struct
        self.driven = 0

    def give(self, values: Mapping[str, int | Sequence[int]] | object) -> None:
        """Drive fields by their names, from a mapping or an object's attributes; others are 0."""
        pack = self.struct.pack if isinstance(values, Mapping) else self.struct.packed
        self.driven = pack(values)
        self.handle.value = self.driven

    def read(self) -> dict[str, int]:
        """Return all fields; of several values in one all bits."""
        bits = self.handle._handle.get_signal_val_binstr()
        fields = self.struct.fields.values()
        return {one.name: FieldPort(self, one).integer(bits) for one in fields}


class FieldPort:
    """A field of a port that is a struct, as if it were a port of its own."""

    def __init__(self, port: StructPort, field: Field) -> None:
        self._port = port
        self._field = field
        end = port.struct.width - field.low
        self._slice = slice(end - field.bits, end)
        self._mask = (1 << field.bits) - 1 << field.low

    def __len__(self) -> int:
        return self._field.bits

    @property
    def whole(self) -> LogicArrayObject:
        """The port that has the field."""
        return self._port.handle

    def integer(self, bits: str | None = None) -> int:
        """Return its value, of several values all bits; ``bits`` are the whole port's."""
        if bits is None:
            bits = self._port.handle._handle.get_signal_val_binstr()
        value = int(bits[self._slice], 2)
        negative = self._field.signed and self._field.count == 1 and value >> self._field.width - 1
        return value - (1 << self._field.width) if negative else value

    @property
    def value(self) -> int:
        """Its bits now; setting it leaves the other fields as they are driven."""
        return self.integer() & (1 << self._field.bits) - 1

    @value.setter
    def value(self, value: int) -> None:
        port = self._port
        bits = int(value) << self._field.low
        port.driven = port.driven & ~self._mask | bits & self._mask
        port.handle.value = port.driven


Port = LogicObject | LogicArrayObject | FieldPort

_STRUCT_PORTS: dict[str, dict[str, StructPort]] = {}
_PORTS: dict[tuple[str, str], Port] = {}


def struct_ports(dut) -> dict[str, StructPort]:
    """Return the ports of the top that are structs, by name."""
    module = dut._name
    if module not in _STRUCT_PORTS:
        found = _STRUCT_PORT.findall(_source(module).read_text())
        _STRUCT_PORTS[module] = {
            name: StructPort(getattr(dut, name), PACKAGES[package](kind))
            for package, kind, name in found
        }
    return _STRUCT_PORTS[module]


def port(dut, name: str) -> Port:
    """Return a port, or the field of a struct, by the name that it would have as a port."""
    key = (dut._name, name)
    if key not in _PORTS:
        structs = struct_ports(dut)
        if name in structs or "." in name or not hasattr(dut, name):
            stem, end = name[:-2], name[-2:]
            (_PORTS[key],) = (
                FieldPort(one, one.struct.fields[stem])
                for each, one in structs.items()
                if each.endswith(end) and stem in one.struct.fields
            )
        else:
            _PORTS[key] = getattr(dut, name)
    return _PORTS[key]


def _inputs(dut) -> list[LogicObject | LogicArrayObject]:
    return [h for h in dut if h._name.endswith("_i") and h._name != "clk_i"]


async def reset(dut) -> None:
    """Start the clock, set every input to zero and hold reset for three clocks."""
    for handle in _inputs(dut):
        handle.value = 0
    for one in struct_ports(dut).values():
        one.driven = 0
    cocotb.start_soon(Clock(dut.clk_i, CLOCK_NS, unit="ns").start())
    dut.rst_i.value = 1
    for _ in range(3):
        await RisingEdge(dut.clk_i)
    await FallingEdge(dut.clk_i)
    dut.rst_i.value = 0


def as_integer(handle: Port, *, signed: bool = False) -> int:
    """Return the value of a port as an integer; a field knows whether it is signed."""
    if isinstance(handle, FieldPort):
        return handle.integer()
    # As handle.value does, but without an array of four-state bits in between, which Verilator does
    # not have and which takes six times as long.
    return _integer(handle._handle.get_signal_val_binstr(), signed)


def _integer(bits: str, signed: bool) -> int:
    value = int(bits, 2)
    return value - (1 << len(bits)) if signed and bits[0] == "1" else value


class Ports:
    """Ports whose values are wanted at every clock, as ``as_integer`` returns each.

    Args:
        dut: The top module.
        names: Names of its ports, or of fields of those that are structs, as ``port`` takes them.
        signed: Names of the ports that are signed; a field knows it.
    """

    def __init__(self, dut, names: Iterable[str], signed: Iterable[str] = ()) -> None:
        names, signed = list(names), set(signed)
        assert signed <= set(names), signed - set(names)
        ports = [port(dut, name) for name in names]
        handles = [one.whole if isinstance(one, FieldPort) else one for one in ports]
        unique = {handle._name: handle for handle in handles}
        places = {name: k for k, name in enumerate(unique)}
        self._readers = [handle._handle.get_signal_val_binstr for handle in unique.values()]
        self._decoders = [
            (places[handle._name], one if isinstance(one, FieldPort) else None, name in signed)
            for name, one, handle in zip(names, ports, handles, strict=True)
        ]
        self._bits: list[str] = []
        self._values: tuple[int, ...] = ()

    def read(self) -> tuple[int, ...]:
        """Return the values of now."""
        bits = [reader() for reader in self._readers]
        if bits != self._bits:  # most clocks change nothing
            self._bits = bits
            self._values = tuple(
                _integer(bits[k], negative) if field is None else field.integer(bits[k])
                for k, field, negative in self._decoders
            )
        return self._values


def drive(handle: Port, value: int) -> None:
    """Drive a port with an integer, negative numbers as two's complement."""
    width = 1 if isinstance(handle, LogicObject) else len(handle)
    handle.value = int(value) & ((1 << width) - 1)


def drive_settings(dut, settings: object, prefix: str = "") -> None:
    """Drive the ports of a configuration, each with the attribute of its name."""
    for name, value in vars(settings).items():
        drive(port(dut, f"{prefix}{name}_i"), value)


async def run_vectors(
    dut,
    inputs: Mapping[str, np.ndarray],
    outputs: Mapping[str, bool],
    *,
    latency: int,
    spacing: int | None = None,
    gaps: bool = False,
) -> dict[str, np.ndarray]:
    """Send one operand set after another through a unit with fixed latency.

    Args:
        dut: The unit, with ``valid_i`` and ``valid_o``.
        inputs: Port name to integers [n].
        outputs: Port name to whether the port is signed.
        latency: Clocks from ``valid_i`` to ``valid_o``; asserted for every result.
        spacing: Clocks from one ``valid_i`` to the next: 1 for a pipeline; ``latency`` if None.
        gaps: Stretch the spacing at random, with other operands on the ports meanwhile.

    Returns:
        Port name to int64 array [n] (object array where a port is wider than 63 bits).

    Raises:
        AssertionError: if a result comes early, late, twice or not at all.
    """
    chance = random.Random(SEED)
    spacing = latency if spacing is None else spacing
    count = len(next(iter(inputs.values())))
    columns = {name: [int(v) for v in values] for name, values in inputs.items()}
    handles = {name: port(dut, name) for name in columns}
    ports = {name: port(dut, name) for name in outputs}
    edge, valid_i, valid_o = FallingEdge(dut.clk_i), dut.valid_i, dut.valid_o
    results: dict[str, list[int]] = {name: [] for name in outputs}
    due: list[int] = []
    cycle = 0
    sent = 0
    wait = 0
    before = None
    first = next(iter(results.values()))
    while len(first) < count:
        # At the falling edge the inputs change; the outputs are those of the last rising edge.
        valid = sent < count and wait == 0
        if valid != before:
            valid_i.value = int(valid)
            before = valid
        if valid:
            for name, values in columns.items():
                drive(handles[name], values[sent])
            due.append(cycle + latency)
            sent += 1
            wait = spacing - 1 + (chance.randrange(4) if gaps else 0)
        else:
            wait = max(0, wait - 1)
            if gaps:
                for name, handle in handles.items():
                    drive(handle, columns[name][chance.randrange(count)])
        await edge
        cycle += 1
        expected = bool(due) and due[0] == cycle
        came = as_integer(valid_o)
        assert came == expected, (
            f"cycle {cycle}: valid_o is {came}, want {int(expected)} (latency {latency})"
        )
        if expected:
            due.pop(0)
            for name, signed in outputs.items():
                results[name].append(as_integer(ports[name], signed=signed))
    dut.valid_i.value = 0
    if count > 1:
        for age in range(1, latency + 2):
            await edge
            assert as_integer(valid_o) == 0, f"a second result, {age} clocks after the last one"
    return {name: _array(values) for name, values in results.items()}


def _slice(columns: Mapping[str, np.ndarray], k: int) -> dict[str, np.ndarray]:
    return {name: np.asarray(values)[k : k + 1] for name, values in columns.items()}


async def _present(dut, columns: Mapping[str, np.ndarray], k: int) -> None:
    for name, values in columns.items():
        drive(port(dut, name), values[k])
    dut.valid_i.value = 1
    await FallingEdge(dut.clk_i)
    dut.valid_i.value = 0


async def restart_at_every_age(
    dut,
    inputs: Mapping[str, np.ndarray],
    want: Mapping[str, np.ndarray],
    outputs: Mapping[str, bool],
    *,
    latency: int,
) -> None:
    """Start a sequential unit anew at every moment of its work: only the later result comes out.

    ``inputs`` and ``want`` hold at least two operand sets and their results, as for
    ``run_vectors``.
    """
    count = len(next(iter(inputs.values())))
    for age in range(1, latency):
        await _present(dut, inputs, (age + 2) % count)  # another one than that of the last result
        for _ in range(age - 1):
            assert dut.valid_o.value == 0, f"a result at age {age}, before the latency"
            await FallingEdge(dut.clk_i)
        k = (age + 1) % count
        got = await run_vectors(dut, _slice(inputs, k), outputs, latency=latency)
        assert_equal(got, _slice(want, k), _slice(inputs, k))


async def reset_at_every_age(
    dut,
    inputs: Mapping[str, np.ndarray],
    want: Mapping[str, np.ndarray],
    outputs: Mapping[str, bool],
    *,
    latency: int,
    valid: bool = True,
) -> None:
    """Reset a unit with valid high at every moment of its work: no result, and the next is right.

    What is missing in a reset shows here, not at the start. A start hides the missing reset of what
    it clears itself; with ``valid`` false the reset comes alone.
    """
    count = len(next(iter(inputs.values())))
    for age in range(1, latency + 1):
        await _present(dut, inputs, age % count)
        for _ in range(age - 1):
            await FallingEdge(dut.clk_i)
        dut.rst_i.value = 1
        if valid:
            await _present(dut, inputs, age % count)
        else:
            await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        for _ in range(latency + 2):
            assert dut.valid_o.value == 0, f"a result after a reset at age {age}"
            await FallingEdge(dut.clk_i)
        k = (age + 1) % count
        got = await run_vectors(dut, _slice(inputs, k), outputs, latency=latency)
        assert_equal(got, _slice(want, k), _slice(inputs, k))


class UnitBench:
    """Drives a unit; a test's own class has ``start``, which gives the first inputs."""

    @classmethod
    async def fresh(cls, dut, *args: object) -> Self:
        """Return a bench after the unit's reset."""
        await reset(dut)
        return cls(dut, *args)

    @classmethod
    async def started(cls, dut, *args: object, **inputs: object) -> Self:
        """Return a bench after the unit's reset, started with these inputs."""
        bench = await cls.fresh(dut, *args)
        await bench.start(**inputs)
        return bench


class TwinBench(UnitBench, abc.ABC):
    """Drives a unit and its stateful twin with the same inputs, and compares them every clock.

    A test's own class makes ``twin``, puts the first inputs into ``inputs``, and says in ``check``
    what is compared.

    Attributes:
        strobes: Inputs that last one clock of ``clocks``.
    """

    strobes: tuple[str, ...] = ()

    def __init__(self, dut, inputs: Iterable[str]) -> None:
        self.dut = dut
        self.inputs: dict[str, int | None] = dict.fromkeys(inputs)
        self.twin = None
        self.clock = 0

    @abc.abstractmethod
    def check(self) -> None:
        """Compare all outputs."""

    def on_port(self, name: str, value: int) -> tuple[str, int]:
        """Return the port of an input of the twin, without its end, and what it carries."""
        return name, value

    def give(self, **inputs: int) -> None:
        """Change inputs."""
        for name, value in inputs.items():
            if self.inputs[name] != value:
                place, bits = self.on_port(name, value)
                drive(port(self.dut, f"{place}_i"), bits)
                self.inputs[name] = value

    def change(self, settings: object) -> None:
        """Change the configuration, which the twin has as ``settings``."""
        drive_settings(self.dut, settings)
        self.twin.settings = settings

    async def reset_to(self, twin, count: int = 1, **inputs: int) -> None:
        """Reset for some clocks with these inputs; a new twin goes on from there."""
        self.give(**inputs)
        self.dut.rst_i.value = 1
        for _ in range(count):
            await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        self.twin = twin
        self.clock = 0

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks with these inputs."""
        self.give(**inputs)
        edge = FallingEdge(self.dut.clk_i)
        for _ in range(count):
            await edge
            self.twin.step(**self.inputs)
            self.clock += 1
            self.check()
            for name in self.strobes:
                if self.inputs[name]:
                    self.give(**{name: False})


def _array(values: list[int]) -> np.ndarray:
    if any(abs(v) >= 1 << 63 for v in values):
        return np.array(values, dtype=object)
    return np.array(values, dtype=np.int64)


def assert_equal(
    got: Mapping[str, np.ndarray],
    want: Mapping[str, np.ndarray],
    inputs: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Assert that every output equals the model's, and say which input differs first."""
    for name, expected in want.items():
        expected = np.asarray(expected)
        assert len(got[name]) == len(expected), (
            f"{name}: {len(got[name])} results, want {len(expected)}"
        )
        wrong = np.flatnonzero(got[name] != expected)
        if wrong.size:
            k = int(wrong[0])
            given = {key: int(values[k]) for key, values in (inputs or {}).items()}
            raise AssertionError(
                f"{name}: {wrong.size} of {len(expected)} differ; first at {k}: "
                f"got {got[name][k]}, want {expected[k]}, input {given}"
            )


__all__ = [
    "CLOCK_NS",
    "EACH_VOLUME",
    "PACKAGES",
    "SEED",
    "FallingEdge",
    "Ports",
    "ReadOnly",
    "RisingEdge",
    "TwinBench",
    "UnitBench",
    "as_integer",
    "assert_equal",
    "drive",
    "drive_settings",
    "each",
    "generator",
    "in_volume",
    "parameters",
    "port",
    "reset",
    "reset_at_every_age",
    "restart_at_every_age",
    "rounds",
    "run_vectors",
    "simulate",
    "struct_ports",
]
