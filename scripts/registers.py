"""The registers: from their one description to RTL, Python and a page.

``rtl/link/registers.toml`` is read and checked here; ``scripts/generate.py`` writes what
``register_file``, ``register_pkg``, ``register_map`` and ``document`` return.
"""

import hashlib
import json
import re
import textwrap
import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, StringConstraints, ValidationError

from vrscan.clocked.register_file import LATENCY, SAMPLED, WRITTEN
from vrscan.data import link_pkg, pkg
from vrscan.data.bus import COMMIT, WRITABLE
from vrscan.data.bus import WORD_BITS as WORD
from vrscan.data.config import Section, complaint
from vrscan.data.config import load as load_config
from vrscan.data.errors import InputError
from vrscan.registers.chain_registers import Registers as ChainRegisters
from vrscan.registers.resets import constant, declaration
from vrscan.registers.structs import BANK

ROOT = Path(__file__).resolve().parents[1]
SOURCE = "rtl/link/registers.toml"
MAP_BITS = 10  # of the addresses of registers; windows lie above
PAGE_BITS = 4
COLUMNS = 100

Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$")]
Number = int | str  # or the name of a localparam
Access = Literal["rw", "strobe", "ro", "counter", "constant"]
# What no field can be called, of the words that a name could be.
_KEYWORDS = """
    accept_on alias always and assert assign assume automatic before begin bind bins binsof
    bit break buf byte case cell chandle checker class clocking config const constraint
    context continue cover covergroup cross deassign default defparam design disable dist do
    edge else end enum event eventually expect export extends extern final for force foreach
    forever fork function generate genvar global highz0 highz1 if iff implements implies
    import initial inout input inside instance int integer interconnect interface intersect
    join large let liblist library local logic longint macromodule matches medium modport
    module nand negedge new nexttime nor not null or output package packed parameter posedge
    primitive priority program property protected pull0 pull1 pulldown pullup pure rand randc
    randcase real realtime ref reg reject_on release repeat restrict return scalared sequence
    shortint shortreal signed small soft solve specify static string strong strong0 strong1
    struct super supply0 supply1 table tagged task this throughout time timeprecision timeunit
    tran tri tri0 tri1 triand trior trireg type typedef union unique unique0 unsigned until
    untyped use uwire var vectored virtual void wait wand weak weak0 weak1 while wildcard wire
    with within wor xnor xor
"""
KEYWORDS = frozenset(_KEYWORDS.split())


class Entry(Section):
    """A register, or a field of a window, as it stands in the file."""

    width: Number
    doc: str
    count: Number = 1
    access: Access | None = None
    signed: bool = False
    reset: int | Literal["config"] | None = None
    value: int | Literal["map_hash", "version"] | None = None
    fraction: Number = 0
    unit: str = ""
    min: Number | None = None
    max: Number | None = None
    lock: Name | None = None


class FieldEntry(Section):
    """A field of a window as it stands in the file."""

    width: Number
    doc: str
    signed: bool = False
    fraction: Number = 0
    unit: str = ""
    min: Number | None = None
    max: Number | None = None


class GroupEntry(Section):
    """A group of registers as it stands in the file."""

    address: int = Field(ge=0)
    doc: str
    access: Access | None = None
    reset: int | Literal["config"] = 0
    lock: Name | None = None
    commit: bool = False
    registers: dict[Name, Entry] = Field(min_length=1)


class WindowEntry(Section):
    """A table as it stands in the file."""

    address: int = Field(ge=0)
    doc: str
    entries: int = Field(ge=2)
    lock: Name | None = None
    commit: bool = False
    bank: Name | None = None
    in_use: Name | None = None
    fields: dict[Name, FieldEntry] = Field(min_length=1)


class File(Section):
    """The whole file."""

    locks_address: int = Field(ge=0)
    locks: dict[Name, str]
    groups: dict[Name, GroupEntry]
    windows: dict[Name, WindowEntry] = Field(default={})


@dataclass(frozen=True)
class Register:
    """A register with every number worked out; a field of a window is one without an address."""

    name: str
    group: str
    struct: str  # that it is a field of; a constant is of none
    address: int
    words: int  # all of them
    count: int
    width: int
    signed: bool
    access: str
    lock: str | None
    reset: tuple[int, ...]
    fraction: int
    unit: str
    minimum: int
    maximum: int
    doc: str
    commit: bool = False  # what is written waits for a commit

    @property
    def writable(self) -> bool:
        """Whether the bus writes it."""
        return self.access in WRITABLE

    @property
    def wide(self) -> bool:
        """Whether it takes two words."""
        return self.width > WORD

    @property
    def place(self) -> str:
        """Its field in the port of its struct, or in what waits for a commit."""
        port = "o" if self.writable else "i"
        return f"{self.struct}_{'q' if self.commit else port}.{self.name}"


@dataclass(frozen=True)
class Window:
    """A table with every number worked out. Entry i begins at address + i * stride."""

    name: str
    address: int
    entries: int
    stride: int  # words, a power of two
    lock: str | None
    doc: str
    fields: tuple[Register, ...]
    commit: bool = False  # its entries wait for a commit
    bank: Register | None = None  # which of two banks elsewhere the bus accesses
    in_use: Register | None = None  # and which one it may not write

    @property
    def copied(self) -> bool:
        """Whether a commit copies its entries."""
        return self.commit and self.bank is None

    @property
    def field_bits(self) -> int:
        """Bits of an address that say which field."""
        return self.stride.bit_length() - 1

    @property
    def index_bits(self) -> int:
        """Bits of an address that say which entry."""
        return (self.entries - 1).bit_length()

    @property
    def bits(self) -> int:
        """Bits of an address within the window."""
        return self.field_bits + self.index_bits


@dataclass(frozen=True)
class Struct:
    """What the bus writes of a group, what it reads of it, or what leaves with a table's entry.

    Attributes:
        name: Of the type in the package without ``_t``, and of the port without its direction.
        doc: Of the group.
        written: By the bus.
        fields: Name, bits, and whether it is signed, the most significant first.
    """

    name: str
    doc: str
    written: bool
    fields: tuple[tuple[str, int, bool], ...]


@dataclass(frozen=True)
class Group:
    """Registers that belong together."""

    name: str
    address: int
    doc: str
    registers: tuple[Register, ...]


@dataclass(frozen=True)
class Map:
    """All registers of a description."""

    source: str
    groups: tuple[Group, ...]
    windows: tuple[Window, ...]
    locks: tuple[str, ...]
    hash: int

    @property
    def registers(self) -> tuple[Register, ...]:
        """The registers of all groups, by address."""
        return tuple(register for group in self.groups for register in group.registers)

    @property
    def structs(self) -> tuple[Struct, ...]:
        """The ports of the registers, in the order of the map."""
        found: dict[str, Struct] = {}
        for group in self.groups:
            for register in group.registers:
                if register.struct:
                    doc = group.doc if register.struct == group.name else f"{group.doc}: read"
                    empty = Struct(register.struct, doc, register.writable, ())
                    before = found.get(register.struct, empty)
                    fields = (*before.fields, *_fields(register))
                    found[register.struct] = replace(before, fields=fields)
        for window in self.windows:
            fields = ((f"{window.name}_write", 1, False),)
            fields += ((f"{window.name}_index", window.index_bits, False),)
            fields += tuple(one for field in window.fields for one in _fields(field))
            if window.copied:
                fields += tuple((f"{window.name}_{one}", 1, False) for one in BANK)
            if window.bank is not None:
                fields += ((f"{window.name}_access_bank", 1, False),)
                back = (_read_back(window), window.fields[0].width, window.fields[0].signed)
                status = f"{window.name}_status"
                found[status] = Struct(status, f"{window.doc}: read", False, (back,))
            found[window.name] = Struct(window.name, window.doc, True, fields)
        return tuple(found.values())


def _read_back(window: Window) -> str:
    """Return what comes back of a table whose memory is elsewhere."""
    return f"{window.name}_read"


def _fields(register: Register) -> tuple[tuple[str, int, bool], ...]:
    """Return the fields of one register in its struct."""
    signed = register.signed and register.count == 1
    fields = ((register.name, register.width * register.count, signed),)
    strobe = ((f"{register.name}_strobe", 1, False),) if register.access == "strobe" else ()
    return fields + strobe


def _constant(name: str) -> int | None:
    """Return the value of a localparam, or None if there is none."""
    python = re.sub(r"(?<!^)(?=[A-Z])", "_", name).upper()
    for module in (pkg, link_pkg):
        if hasattr(module, python):
            return int(getattr(module, python))
    return None


class _Reader:
    """Turns what stands in the file into registers; every complaint names file and place."""

    def __init__(self, source: str, file: File) -> None:
        self._source = source
        self._file = file
        self._defaults: ChainRegisters | None = None

    def complain(self, place: str, what: str) -> InputError:
        """Return an error of one line."""
        return InputError(f"{self._source}: {place}: {what}")

    def _number(self, place: str, key: str, value: Number) -> int:
        if isinstance(value, int):
            return value
        found = _constant(value)
        if found is None:
            raise self.complain(place, f"{key} = {value!r}: no localparam of this name")
        return found

    def _default(self, place: str, name: str) -> int:
        if self._defaults is None:
            self._defaults = ChainRegisters.from_config(load_config(None))
        value = getattr(self._defaults, name, None)
        if value is None:
            raise self.complain(place, 'reset = "config": the configuration has no such register')
        return int(value)

    def _lock(self, place: str, lock: str | None) -> str | None:
        if lock is not None and lock not in self._file.locks:
            raise self.complain(place, f"lock = {lock!r}: there is no such lock")
        return lock

    def _range(self, place: str, entry: Entry | FieldEntry, width: int) -> tuple[int, int]:
        lowest = -(1 << (width - 1)) if entry.signed else 0
        highest = lowest + (1 << width) - 1
        low = lowest if entry.min is None else self._number(place, "min", entry.min)
        high = highest if entry.max is None else self._number(place, "max", entry.max)
        if not lowest <= low <= high <= highest:
            raise self.complain(place, f"min {low} to max {high} is not within {width} bits")
        if width > WORD and (low, high) != (lowest, highest):
            raise self.complain(place, f"min and max need at most {WORD} bits")
        return low, high

    def _struct(self, name: str, group: GroupEntry, access: str) -> str:
        """Return the struct of a register: the group's own is of what the bus writes, if any."""
        if access == "constant":
            return ""
        written = any((e.access or group.access) in WRITABLE for e in group.registers.values())
        return f"{name}_status" if written and access not in WRITABLE else name

    def register(self, group_name: str, group: GroupEntry, name: str, address: int) -> Register:
        """Return a register of a group."""
        entry = group.registers[name]
        place = f"group {group_name}, register {name}"
        width = self._number(place, "width", entry.width)
        if not 1 <= width <= 2 * WORD:
            raise self.complain(place, f"width {width} is not 1 to {2 * WORD}")
        count = self._number(place, "count", entry.count)
        if count < 1 or (count > 1 and width > WORD):
            raise self.complain(place, f"count {count}: 1, or more of at most {WORD} bits")
        access = entry.access or group.access
        if access is None:
            raise self.complain(place, "access is missing, here and in the group")
        low, high = self._range(place, entry, width)
        if access == "strobe" and (count > 1 or width > WORD):
            raise self.complain(place, "a strobe is one word")
        if (access == "constant") != (entry.value is not None):
            raise self.complain(place, "value is for a constant, and a constant has one")
        if group.commit and (access == "strobe" or width > 2 * WORD):
            raise self.complain(place, "an event cannot wait for a commit")
        if access not in WRITABLE and (
            entry.reset is not None
            or entry.lock is not None
            or entry.min is not None
            or entry.max is not None
        ):
            raise self.complain(place, "reset, lock, min and max are for what can be written")
        reset = 0
        if access in WRITABLE:
            given = group.reset if entry.reset is None else entry.reset
            reset = self._default(place, name) if given == "config" else given
            if not low <= reset <= high and entry.reset is not None:
                raise self.complain(place, f"reset {reset} is not within {low} to {high}")
        elif access == "constant":
            if count > 1 or width > WORD:
                raise self.complain(place, "a constant is one word")
            if entry.value == "version":
                reset = _version()
            elif isinstance(entry.value, int):
                reset = entry.value
            if not low <= reset <= high:
                raise self.complain(place, f"value {reset} is not within {low} to {high}")
        lock = (entry.lock or group.lock) if access in WRITABLE else None
        return Register(
            name=name,
            group=group_name,
            struct=self._struct(group_name, group, access),
            address=address,
            words=count * (2 if width > WORD else 1),
            count=count,
            width=width,
            signed=entry.signed,
            access=access,
            lock=self._lock(place, lock),
            reset=(reset,) * count,
            fraction=self._number(place, "fraction", entry.fraction),
            unit=entry.unit,
            minimum=low,
            maximum=high,
            doc=entry.doc,
            commit=group.commit and access in WRITABLE,
        )

    def group(self, name: str, group: GroupEntry) -> Group:
        """Return a group; its registers follow each other."""
        self._lock(f"group {name}", group.lock)
        registers: list[Register] = []
        address = group.address
        for key in group.registers:
            registers.append(self.register(name, group, key, address))
            address += registers[-1].words
            if address > 1 << MAP_BITS:
                raise self.complain(
                    f"group {name}, register {key}", f"ends above {(1 << MAP_BITS) - 1:#06x}"
                )
        return Group(name, group.address, group.doc, tuple(registers))

    def locks(self) -> Group:
        """Return the locks as a group: each takes a 1 and nothing else."""
        registers = [
            Register(
                name=name,
                group="locks",
                struct="locks",
                address=self._file.locks_address + k,
                words=1,
                count=1,
                width=1,
                signed=False,
                access="rw",
                lock=None,
                reset=(0,),
                fraction=0,
                unit="",
                minimum=1,
                maximum=1,
                doc=f"1 keeps until reset: {guarded}",
            )
            for k, (name, guarded) in enumerate(self._file.locks.items())
        ]
        if self._file.locks_address + len(registers) > 1 << MAP_BITS:
            raise self.complain("locks_address", f"ends above {(1 << MAP_BITS) - 1:#06x}")
        doc = "Each takes a 1 and nothing else, and keeps it until reset"
        return Group("locks", self._file.locks_address, doc, tuple(registers))

    def _bank(self, place: str, key: str, name: str, groups: list[Group]) -> Register:
        for register in (one for group in groups for one in group.registers):
            if register.name == name:
                break
        else:
            raise self.complain(place, f"{key} = {name!r}: there is no such register")
        if register.width > 1 or register.access != "rw" or register.commit != (key == "in_use"):
            raise self.complain(place, f"{key} = {name!r}: it has one bit, and in_use waits")
        return register

    def window(self, name: str, window: WindowEntry, groups: list[Group]) -> Window:
        """Return a window."""
        place = f"window {name}"
        banks = [
            None if of is None else self._bank(place, key, of, groups)
            for key, of in (("bank", window.bank), ("in_use", window.in_use))
        ]
        if banks != [None, None] and (None in banks or len(window.fields) > 1 or not window.commit):
            raise self.complain(place, "bank and in_use go with one field that waits for a commit")
        fields = []
        for key, entry in window.fields.items():
            at = f"{place}, field {key}"
            width = self._number(at, "width", entry.width)
            if not 1 <= width <= WORD:
                raise self.complain(at, f"width {width} is not 1 to {WORD}")
            low, high = self._range(at, entry, width)
            fields.append(
                Register(
                    name=f"{name}_{key}",
                    group=name,
                    struct=name,
                    address=0,
                    words=1,
                    count=1,
                    width=width,
                    signed=entry.signed,
                    access="rw",
                    lock=window.lock,
                    reset=(0,),
                    fraction=self._number(at, "fraction", entry.fraction),
                    unit=entry.unit,
                    minimum=low,
                    maximum=high,
                    doc=entry.doc,
                    commit=window.commit,
                )
            )
        stride = 1 << (len(fields) - 1).bit_length()
        made = Window(
            name=name,
            address=window.address,
            entries=window.entries,
            stride=stride,
            lock=self._lock(place, window.lock),
            doc=window.doc,
            fields=tuple(fields),
            commit=window.commit,
            bank=banks[0],
            in_use=banks[1],
        )
        size = 1 << made.bits
        if window.address % size or not 1 << MAP_BITS <= window.address <= 65536 - size:
            raise self.complain(
                place,
                f"address {window.address:#06x} is not a multiple of {size:#x} "
                f"from {1 << MAP_BITS:#x} to {65536 - size:#x}",
            )
        return made


def _version() -> int:
    """Return the version of pyproject.toml as a word."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        text: str = tomllib.load(file)["project"]["version"]
    major, minor, patch = (int(part) for part in text.split("."))
    return major << 16 | minor << 8 | patch


def _hash(registers: list[Register], windows: list[Window]) -> int:
    """Return 32 bits of a hash of what a host has to know: neither words nor resets."""

    def facts(register: Register) -> list[object]:
        return [
            register.name, register.address, register.count, register.width, register.signed,
            register.access, register.lock, register.fraction, register.unit, register.minimum,
            register.maximum, register.commit,
        ]  # fmt: skip

    known = [
        [facts(register) for register in registers],
        [
            [
                *(window.name, window.address, window.entries),
                *(one.name for one in (window.bank, window.in_use) if one is not None),
                [facts(field) for field in window.fields],
            ]
            for window in windows
        ],
    ]
    return int(hashlib.sha256(json.dumps(known).encode()).hexdigest()[: WORD // 4], 16)


def _ports(made: Register | Window) -> list[str]:
    """Return the names that a register or window takes up, without their endings."""
    if isinstance(made, Window):
        own = [made.name, f"{made.name}_write", f"{made.name}_index"]
        own += [f"{made.name}_{one}" for one in BANK] if made.copied else []
        own += [f"{made.name}_access_bank", _read_back(made)] if made.bank is not None else []
        return own + [field.name for field in made.fields]
    return [made.name, f"{made.name}_strobe"] if made.access == "strobe" else [made.name]


def parse(path: Path) -> Map:
    """Return the registers of a description.

    Raises:
        InputError: in one line that names the file and, of a register, its group and name, if it
            is not TOML, has an unknown key or a value of the wrong type or out of range, or two
            registers have a name or an address in common.
    """
    try:
        with path.open("rb") as stream:
            file = File.model_validate(tomllib.load(stream))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({error})") from error
    except ValidationError as error:
        raise InputError(f"{path}: {complaint(error)}") from error
    reader = _Reader(str(path), file)
    groups = [reader.group(name, group) for name, group in file.groups.items()]
    if file.locks:
        groups.append(reader.locks())
    groups.sort(key=lambda group: group.address)
    registers = [register for group in groups for register in group.registers]
    windows = [reader.window(name, window, groups) for name, window in file.windows.items()]

    owner: dict[str, str] = {"clk": "the clock", "rst": "the reset"}
    for made in [*registers, *windows]:
        place = (
            f"window {made.name}"
            if isinstance(made, Window)
            else f"group {made.group}, register {made.name}"
        )
        if isinstance(made, Register) and made.name in KEYWORDS:
            raise reader.complain(place, f"the name {made.name} is taken by SystemVerilog")
        for name in _ports(made):
            if name in owner:
                raise reader.complain(place, f"the name {name} is taken by {owner[name]}")
            owner[name] = place
    of_struct = {"bus": "the bus"}
    for made in [*registers, *windows]:
        name, of = (made.name, "window") if isinstance(made, Window) else (made.struct, "group")
        place = f"{of} {made.name if isinstance(made, Window) else made.group}"
        if name and of_struct.setdefault(name, place) != place:
            raise reader.complain(place, f"the struct {name} is taken by {of_struct[name]}")
    before = registers[0]
    for register in registers[1:]:
        if register.address < before.address + before.words:
            raise reader.complain(
                f"group {register.group}, register {register.name}",
                f"address {register.address:#06x} is taken by "
                f"group {before.group}, register {before.name}",
            )
        before = register
    for k, window in enumerate(windows):
        for other in windows[:k]:
            start = max(window.address, other.address)
            if start < min(window.address + (1 << window.bits), other.address + (1 << other.bits)):
                raise reader.complain(
                    f"window {window.name}", f"{start:#06x} is taken by window {other.name}"
                )
    taken = {r.address + k for r in registers for k in range(r.words)}
    if file.locks and file.locks_address + len(file.locks) in taken:
        # A command that is checked as a whole must not lock what its later words write.
        raise reader.complain("locks_address", "a register follows the locks without a gap")

    digest = _hash(registers, windows)
    hashed = [
        key
        for group in file.groups.values()
        for key, entry in group.registers.items()
        if entry.value == "map_hash"
    ]
    groups = [
        replace(
            group,
            registers=tuple(
                replace(register, reset=(digest,)) if register.name in hashed else register
                for register in group.registers
            ),
        )
        for group in groups
    ]
    source = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
    return Map(str(source), tuple(groups), tuple(windows), tuple(file.locks), digest)


@cache
def described(source: str = SOURCE) -> Map:
    """Return the registers of a description of this repository, those of the instrument if none."""
    return parse(ROOT / source)


# ---- SystemVerilog ----


def _port(direction: str, kind: str, name: str) -> str:
    return f"  {'input  wire' if direction == 'input' else 'output     '} {kind:<35} {name}"


def register_pkg(made: Map, name: str = "register_pkg") -> str:
    """Return the package with the types of the structs."""
    lines = [
        f"// {name}: what the bus of the link writes of a group of registers, what it reads",
        "// of it, and what leaves with an entry of a table, as a struct each; and the resets.",
        "//",
        f"// Generated from {made.source} by scripts/generate.py; docs/registers.md says what the",
        "// fields are.  Widths are numbers, as packages are read in the order of their paths.",
        "",
        "`default_nettype none",
        "",
        f"package {name};",
    ]
    for struct in made.structs:
        lines += [*_comment(struct.doc), "  typedef struct packed {"]
        for field, bits, signed in struct.fields:
            words = ["logic", *(["signed"] if signed else [])]
            words += [f"[{bits - 1}:0]"] if bits > 1 else []
            lines.append(f"    {' '.join(words)} {field};")
        lines += [f"  }} {struct.name}_t;", ""]
    lines.append("  // What a reset brings; of a table what it holds before the first write.")
    for group in written_groups(made):
        lines += [declaration(r.name, r.width, r.reset) for r in group.registers if r.writable]
    for window in made.windows:
        if window.bank is None:
            lines += [
                declaration(r.name, r.width, (0,) * (1 << window.index_bits)) for r in window.fields
            ]
    lines += ["endpackage"]
    return "\n".join([*lines, "", "`default_nettype wire", ""])


def _literal(width: int, value: int) -> str:
    """Return a number as hexadecimal digits of its width."""
    return f"{width}'h{value & ((1 << width) - 1):0{-(-width // 4)}x}"


def _slice(register: Register, element: int, word: int) -> str:
    """Return what a word holds of a register's field."""
    port = register.place
    if register.count > 1:
        return f"{port}[{element * register.width}+:{register.width}]"
    if register.wide:
        if word == 0:
            low = f"{register.name}_low_q" if register.writable else f"{port}[{WORD - 1}:0]"
            return low
        if not register.writable:
            return f"{register.name}_high_q"
        return f"{port}[{register.width - 1}:{WORD}]"
    return port


def _as_word(register: Register, element: int, word: int) -> str:
    """Return a word as it is read."""
    if register.access == "constant":
        return _literal(WORD, register.reset[0])
    text = _slice(register, element, word)
    width = register.width if not register.wide else (WORD, register.width - WORD)[word]
    if width == WORD:
        return f"unsigned'({text})" if register.signed and register.count == 1 else text
    if not register.signed or (register.wide and word == 0):
        return f"{WORD}'({text})"
    if register.count == 1 and not register.wide:
        return f"{WORD}'({text})"  # the port is signed
    return f"{WORD}'(signed'({text}))"


def _words(register: Register) -> list[tuple[int, int, int]]:
    """Return address, element and word of each of a register's words."""
    each = register.words // register.count
    return [(register.address + k, k // each, k % each) for k in range(register.words)]


def _element(register: Register, element: int) -> str:
    """Return what a comment calls a register or one of several."""
    return f"{register.name}[{element}]" if register.count > 1 else register.name


def _active(register: Register) -> str:
    """Return a register that waits as the instrument sees it."""
    return replace(register, commit=False).place


def _bounds(register: Register, word: int) -> tuple[int, int]:
    """Return the least and the largest value that a word takes."""
    if not register.wide:
        return register.minimum, register.maximum
    if word == 0:
        return 0, (1 << WORD) - 1
    return register.minimum >> WORD, register.maximum >> WORD


def written_groups(registers: Map) -> tuple[Group, ...]:
    """Return the groups with something to reset, in the order of their resets."""
    return tuple(g for g in registers.groups if any(r.writable for r in g.registers))


class _Rules:
    """What the RTL knows of an address: its kind, its lock, and what it takes."""

    def __init__(self, locks: tuple[str, ...]) -> None:
        self._locks = locks
        self.lock_bits = max(1, len(locks).bit_length())
        self.bits = 3 + self.lock_bits + 2 * (WORD + 1)

    def lock(self, name: str | None) -> int:
        """Return the number of a lock, 0 for none."""
        return 0 if name is None else 1 + self._locks.index(name)

    def rule(self, register: Register, word: int) -> str:
        """Return an entry of the rules' memory."""
        low, high = _bounds(register, word) if register.writable else (0, 0)
        kind = "KindReadWrite" if register.writable else "KindReadOnly"
        waits = register.commit or register.name == COMMIT
        lock = f"{self.lock_bits}'d{self.lock(register.lock)}"
        bounds = f"{_literal(WORD + 1, low)}, {_literal(WORD + 1, high)}"
        return f"{{{kind}, 1'd{int(waits)}, {lock}, {bounds}}}"


def _comment(doc: str) -> list[str]:
    """Return a sentence as a comment."""
    return [f"  // {line}" for line in textwrap.wrap(f"{doc}.", COLUMNS - 5)]


def _ports_section(made: Map, package: str) -> list[str]:
    lines = [
        _port("input", "logic", "clk_i,"),
        _port("input", "logic", "rst_i,"),
        "",
        _port("input", "logic", "bus_valid_i,"),
        _port("input", "logic [link_pkg::AccessWidth-1:0]", "bus_access_i,"),
        _port("input", "logic [link_pkg::AddressWidth-1:0]", "bus_address_i,"),
        _port("input", "logic [31:0]", "bus_data_i,"),
        _port("output", "logic", "bus_done_o,"),
        _port("output", "logic [link_pkg::StatusWidth-1:0]", "bus_status_o,"),
        _port("output", "logic [31:0]", "bus_data_o,"),
        "",
    ]
    for struct in made.structs:
        direction = "output" if struct.written else "input"
        port = f"{struct.name}_{direction[0]},"
        lines.append(_port(direction, f"{package}::{struct.name}_t", port))
    bits = _copy_bits(made)
    if _commits(made):
        lines += ["", _port("input", "logic", "waiting_i,")]
        if bits:
            lines += [_port("input", "logic", "copy_i,")]
            lines += [_port("input", f"logic [{bits - 1}:0]", "copy_index_i,")]
            lines += [_port("input", "logic", "bank_i,")]
        lines += [_port("input", "logic", "take_i,")]
    lines[-1] = lines[-1].removesuffix(",")
    return lines


def _commits(made: Map) -> bool:
    """Return whether anything waits for a commit."""
    return any(r.commit for r in made.registers) or _copy_bits(made) > 0


def _copy_bits(made: Map) -> int:
    """Return the bits of an entry's number in the largest table that waits; 0 if none does."""
    return max((window.index_bits for window in made.windows if window.copied), default=0)


HEADER = """\
// {name}: registers on the bus of the link.
//
// Generated from {source} by scripts/generate.py; docs/registers.md lists
// them and says how they behave.
//
// A memory has the rule of each address; the value is compared with the rule's bounds, a register
// takes it, and all are read through the sixteen words of a page and then the page.  So what a
// WRITE answers has been read back.  The registers stand all over the die, so what goes to many of
// them, data, selection and reset, comes from registers near them.
//
//   rst_i         works a clock later; each group of settings has a register of its own for it, so
//                 that no net resets all of them
//   bus_valid_i   ignored from the clock after it until bus_done_o
//   bus_access_i  link_pkg; CHECK says what WRITE would, and changes nothing; 3 is as READ
//   bus_status_o  with bus_done_o, the first that applies: StatusNoAddress, StatusReadOnly,
//                 StatusLocked, StatusBusy, StatusBadValue, StatusOk
//   bus_data_o    with bus_done_o, the word as it is read; 0 unless OK
//   *_o           structs of {package}: what the bus has written, {written} clocks after
//                 bus_valid_i; a field *_strobe is high in the first clock in which its register
//                 has what was written
//   *_i           structs, too: a READ sees them {sampled} clocks after bus_valid_i
//   Wide ones     take effect with their higher word; until then the lower one waits, and is read
//                 as written.  The READ of a lower word of *_i keeps the higher one for its READ
//   Tables        an entry goes out with its last field and with *_write, the others are those
//                 written before; a reset leaves what was written for the bus to read
//   Two banks     of a table elsewhere: an entry goes out with *_write, to bank *_access_bank, and
//                 *_read of *_index comes back, {back} clocks behind a write as it was written.
//                 StatusBusy is also for a write into the bank in use
//   waiting_i ..  of commit_control.  What waits goes out 2 clocks after take_i.  Entries of
//                 waiting tables go out 2 clocks after copy_i, into the bank that is not
//                 bank_i's.  StatusBusy is for waiting_i
//   Latency       {latency} clocks from bus_valid_i to bus_done_o
//   Model         vrscan.clocked.register_file, bit-exact

`default_nettype none

module {name} (
"""


def register_file(made: Map, name: str = "register_file", package: str = "register_pkg") -> str:
    """Return the module that holds the registers."""
    rules = _Rules(made.locks)
    registers = made.registers
    rw = [register for register in registers if register.writable]
    wide_inputs = [r for r in registers if r.wide and not r.writable]
    words = [(a, r, e, w) for r in registers for a, e, w in _words(r)]
    pages = sorted({address >> PAGE_BITS for address, *_ in words})
    last = LATENCY - 1
    map_bits = MAP_BITS
    entries = 1 << map_bits

    out = HEADER.format(
        name=name,
        source=made.source,
        package=package,
        latency=LATENCY,
        written=WRITTEN,
        sampled=SAMPLED,
        back=LATENCY - 9,
    ).splitlines()
    out += _ports_section(made, package)
    out += [
        ");",
        "",
        "  // ---- the reset, once for each group of settings ----",
        "  logic rst;",
        "  local_register u_reset (.clk_i, .d_i(rst_i), .q_o(rst));",
    ]
    for group in written_groups(made):
        out += [
            f"  logic {group.name}_rst;",
            f"  local_register u_{group.name}_reset (.clk_i, .d_i(rst_i), .q_o({group.name}_rst));",
        ]
    out += [
        "",
        "  // ---- an access, and how far it is ----",
        f"  logic [{last}:1] step_q;",
        "  logic [link_pkg::AccessWidth-1:0] access_q;",
        "  logic [link_pkg::AddressWidth-1:0] address_q;",
        "  logic [31:0] data_q;",
        "  logic start, read, write_q;",
        "  assign start = bus_valid_i && step_q == '0;",
        "  assign read = access_q != link_pkg::AccessWidth'(link_pkg::AccessCheck)",
        "                && access_q != link_pkg::AccessWidth'(link_pkg::AccessWrite);",
        "  always_ff @(posedge clk_i) begin",
        f"    step_q <= {{step_q[{last - 1}:1], start}};",
        "    if (start) begin",
        "      access_q  <= bus_access_i;",
        "      address_q <= bus_address_i;",
        "      data_q    <= bus_data_i;",
        "    end",
        "    if (rst) step_q <= '0;",
        "  end",
        "",
        "  // ---- 1: look up the rule; 2: take it.  Its bounds are signed, hence the 33 bits ----",
        "  localparam logic [1:0] KindNone = 2'd0;",
        "  localparam logic [1:0] KindReadOnly = 2'd1;",
        "  localparam logic [1:0] KindReadWrite = 2'd2;",
        "  typedef struct packed {",
        "    logic [1:0] kind;",
        "    logic commit;",
        f"    logic [{rules.lock_bits - 1}:0] lock;",
        f"    logic signed [{WORD}:0] minimum;",
        f"    logic signed [{WORD}:0] maximum;",
        "  } rule_t;",
        f"  logic [{rules.bits - 1}:0] rule_mem[{entries}];",
        f"  logic [{rules.bits - 1}:0] map_rule_q;",
        "  logic map_hit_q;",
        "  rule_t rule_q;",
    ]
    for window in made.windows:
        out.append(f"  logic {window.name}_hit_q;")
        index = window.index_bits
        out.append(f"  logic [{index - 1}:0] {window.name}_index;")
        low = window.field_bits
        out.append(f"  assign {window.name}_index = address_q[{low + index - 1}:{low}];")
    out += [
        "  always_ff @(posedge clk_i) begin",
        f"    map_rule_q <= rule_mem[address_q[{map_bits - 1}:0]];",
        f"    map_hit_q  <= address_q[15:{map_bits}] == '0;",
    ]
    for window in made.windows:
        top = window.bits
        hit = f"address_q[15:{top}] == {_literal(16 - top, window.address >> top)}"
        if window.entries != 1 << window.index_bits:
            span = f"{window.index_bits}'d{window.entries - 1}"
            hit += f" && {window.name}_index <= {span}"
        out.append(f"    {window.name}_hit_q <= {hit};")
    out.append("    rule_q <= map_hit_q ? map_rule_q : '0;")
    for window in made.windows:
        if len(window.fields) == 1:
            out.append(f"    if ({window.name}_hit_q) rule_q <= {rules.rule(window.fields[0], 0)};")
            continue
        out.append(f"    if ({window.name}_hit_q)")
        out.append(f"      case (address_q[{window.field_bits - 1}:0])")
        for k, field in enumerate(window.fields):
            at = _literal(window.field_bits, k)
            out += [f"        {at}: rule_q <=", f"          {rules.rule(field, 0)};"]
        out += ["        default: rule_q <= '0;", "      endcase"]
    out += ["  end", ""]

    busy, busy_q = [], []
    if _commits(made):
        busy = [
            "    else if (busy_q)",
            "      verdict = link_pkg::StatusWidth'(link_pkg::StatusBusy);",
        ]
        tables = "".join(f" || {w.name}_hit_q" for w in made.windows if w.commit)
        busy_q = [f"    busy_q <= rule_q.commit && waiting_i && (!read{tables});"]
        if len(busy_q[0]) > COLUMNS:
            busy_q = [
                "    busy_q <= rule_q.commit && waiting_i",
                f"              && (!read{tables});",
            ]
        for w in made.windows:
            if w.bank is not None and w.in_use is not None:
                used = f"{w.bank.place} == {_active(w.in_use)}"
                busy_q.append(f"    if (!read && {w.name}_hit_q && {used}) busy_q <= 1'b1;")
    padded = (1 << rules.lock_bits) - 1 - len(made.locks)
    lock_list = [f"locks_o.{name}" for name in reversed(made.locks)]
    lock_list = ([f"{padded}'d0"] if padded else []) + lock_list + ["1'b0"]
    out += [
        "  // ---- 3: against the rule; 4: the verdict ----",
        f"  logic [{(1 << rules.lock_bits) - 1}:0] locks;",
        f"  assign locks = {{{', '.join(lock_list)}}};",
        f"  logic signed [{WORD}:0] value;",
        f"  assign value = signed'({{rule_q.minimum[{WORD}] && data_q[{WORD - 1}], data_q}});",
        "  logic [1:0] kind_q;",
        "  logic below_q, above_q, locked_q" + (", busy_q;" if _commits(made) else ";"),
        "  logic [link_pkg::StatusWidth-1:0] verdict, status_q;",
        "  always_comb begin",
        "    verdict = link_pkg::StatusWidth'(link_pkg::StatusOk);",
        "    if (kind_q == KindNone)",
        "      verdict = link_pkg::StatusWidth'(link_pkg::StatusNoAddress);",
        "    else if (!read && kind_q == KindReadOnly)",
        "      verdict = link_pkg::StatusWidth'(link_pkg::StatusReadOnly);",
        "    else if (!read && locked_q)",
        "      verdict = link_pkg::StatusWidth'(link_pkg::StatusLocked);",
        *busy,
        "    else if (!read && (below_q || above_q))",
        "      verdict = link_pkg::StatusWidth'(link_pkg::StatusBadValue);",
        "  end",
        "  always_ff @(posedge clk_i) begin",
        "    kind_q   <= rule_q.kind;",
        "    below_q  <= value < rule_q.minimum;",
        "    above_q  <= value > rule_q.maximum;",
        "    locked_q <= locks[rule_q.lock];",
        *busy_q,
        "    // What an access changes judges the next: a commit waits from its own write on.",
        "    if (step_q[4]) status_q <= verdict;",
        "    write_q  <= step_q[4] && access_q == link_pkg::AccessWidth'(link_pkg::AccessWrite)",
        "                && verdict == link_pkg::StatusWidth'(link_pkg::StatusOk);",
        "    if (rst) write_q <= 1'b0;",
        "  end",
        "",
        "  // ---- 2: which page, which of its words, for writing and for reading ----",
        *(f"  logic page_{page:02x}_hit_q;" for page in pages),
        f"  logic [{(1 << PAGE_BITS) - 1}:0] word_hit_q;",
        "  always_ff @(posedge clk_i) begin",
    ]
    out += [
        f"    page_{page:02x}_hit_q <= address_q[15:{PAGE_BITS}] == {16 - PAGE_BITS}'h{page:03x};"
        for page in pages
    ]
    out += [
        f"    for (int unsigned k = 0; k < {1 << PAGE_BITS}; k++)",
        f"      word_hit_q[k] <= address_q[{PAGE_BITS - 1}:0] == {PAGE_BITS}'(k);",
        "  end",
        "",
        "  // ---- 5: which register; 6: it takes the word ----",
        f"  logic [{sum(register.writable for _, register, *_ in words) - 1}:0] take_q;",
        "  logic write_q2;",
        "  always_ff @(posedge clk_i) begin",
        "    write_q2 <= write_q;",
        "    if (rst) write_q2 <= 1'b0;",
    ]
    writable = [word for word in words if word[1].writable]
    for k, (address, *_) in enumerate(writable):
        page, word = divmod(address, 1 << PAGE_BITS)
        out.append(
            f"    take_q[{k}] <= write_q && page_{page:02x}_hit_q && word_hit_q[{word}] && !rst;"
        )
    out += ["  end", ""]
    group_of = {r.name: g.name for g in made.groups for r in g.registers}
    data_width = {
        group.name: min(WORD, max(r.width for r in group.registers if r.writable))
        for group in written_groups(made)
    }
    for group_name, taken in data_width.items():
        out += [
            f"  logic [{taken - 1}:0] {group_name}_data;",
            f"  local_register #(.Width({taken})) u_{group_name}_data (",
            f"    .clk_i, .d_i(data_q[{taken - 1}:0]), .q_o({group_name}_data)",
            "  );",
        ]
    out += [f"  logic [{WORD - 1}:0] {r.name}_low_q;" for r in rw if r.wide]
    waiting = [g for g in written_groups(made) if any(r.commit for r in g.registers)]
    for group in waiting:
        out.append(f"  {package}::{group.name}_t {group.name}_q;")
        # As many bits as a group has are too far apart for one register to reach in a clock.
        for register in group.registers:
            out += [
                f"  logic {register.name}_take, {register.name}_taken_rst;",
                f"  local_register #(.Width(2)) u_{register.name}_take (",
                "    .clk_i, .d_i({take_i, rst_i}),",
                f"    .q_o({{{register.name}_take, {register.name}_taken_rst}})",
                "  );",
            ]
    out.append("  always_ff @(posedge clk_i) begin")
    out += [
        f"    {register.place}_strobe <= take_q[{k}];"
        for k, (_, register, *_) in enumerate(writable)
        if register.access == "strobe"
    ]
    for k, (_, register, element, word) in enumerate(writable):
        width = register.width
        data = f"{group_of[register.name]}_data"
        if register.wide and word == 0:
            take = f"{register.name}_low_q <= {data};"
        elif register.wide:
            take = f"{register.place} <= {{{data}[{width - WORD - 1}:0], {register.name}_low_q}};"
        else:
            whole = width == data_width[group_of[register.name]]
            bits = data if whole else f"{data}[{width - 1}:0]"
            bits = f"{data}[0]" if width == 1 else bits
            if register.signed and register.count == 1:
                bits = f"signed'({bits})"
            take = f"{_slice(register, element, 0)} <= {bits};"
        out.append(f"    if (take_q[{k}]) {take}")
    for group in written_groups(made):
        for register in group.registers if group in waiting else ():
            taken = replace(register, commit=False)
            out += [
                f"    if ({register.name}_take) {taken.place} <= {register.place};",
                f"    if ({register.name}_taken_rst) begin",
                *_reset(taken, package)[-1:],
                "    end",
            ]
        out.append(f"    if ({group.name}_rst) begin")
        for register in group.registers:
            if register.writable:
                out += _reset(register, package)
        out.append("    end")
    out += ["  end", ""]

    for window in made.windows:
        out += _window_memory(window, package)
    steps = f"{SAMPLED}: half a page's words, wide ones whole; {SAMPLED + 1}: a page"
    out.append(f"  // ---- {steps} ----")
    if wide_inputs:
        for register in wide_inputs:
            out.append(f"  logic [{register.width - WORD - 1}:0] {register.name}_high_q;")
        out += [f"  logic [{len(wide_inputs) - 1}:0] keep_q;", "  always_ff @(posedge clk_i) begin"]
        for k, register in enumerate(wide_inputs):
            high = f"{register.place}[{register.width - 1}:{WORD}]"
            page, word = divmod(register.address, 1 << PAGE_BITS)
            hit = f"page_{page:02x}_hit_q && word_hit_q[{word}]"
            out += [
                f"    keep_q[{k}] <= step_q[{SAMPLED - 1}] && read && {hit};",
                f"    if (keep_q[{k}]) {register.name}_high_q <= {high};",
            ]
        cleared = [f"      {register.name}_high_q <= '0;" for register in wide_inputs]
        out += ["    if (rst) begin", "      keep_q <= '0;", *cleared, "    end", "  end", ""]
    for page in pages:
        here = [word for word in words if word[0] >> PAGE_BITS == page]
        name = f"page_{page:02x}"
        sides = {
            side: [word for word in here if word[0] >> (PAGE_BITS - 1) & 1 == high]
            for high, side in enumerate(("low", "high"))
        }
        sides = {side: half for side, half in sides.items() if half}
        bits = PAGE_BITS - 2 + len(sides)
        out += [
            f"  logic [{WORD - 1}:0] {name}_q;",
            f"  logic [{bits - 1}:0] {name}_word;",
            f"  local_register #(.Width({bits})) u_{name}_word (",
            f"    .clk_i, .d_i(address_q[{bits - 1}:0]), .q_o({name}_word)",
            "  );",
        ]
        out += [f"  logic [{WORD - 1}:0] {name}_{side}_q;" for side in sides]
        out.append("  always_ff @(posedge clk_i) begin")
        for side, half in sides.items():
            reads = [
                f"{name}_{side}_q <= {_as_word(register, element, word)};"
                for _, register, element, word in half
            ]
            if len(half) == 1:
                out.append(f"    {reads[0]}")
                continue
            out.append(f"    case ({name}_word[{PAGE_BITS - 2}:0])")
            for (address, *_), read in zip(half[:-1], reads[:-1], strict=True):
                at = _literal(PAGE_BITS - 1, address & ((1 << (PAGE_BITS - 1)) - 1))
                out.append(f"      {at}: {read}")
            # Where there is none, the status says so.
            out += [f"      default: {reads[-1]}", "    endcase"]
        halves = [f"{name}_{side}_q" for side in sides]
        if len(halves) > 1:
            out.append(f"    {name}_q <= {name}_word[{PAGE_BITS - 1}] ? {halves[1]} : {halves[0]};")
        else:
            out.append(f"    {name}_q <= {halves[0]};")
        out += [f"    if (!{name}_hit_q) {name}_q <= '0;", "  end", ""]
    out += [
        f"  // ---- {last - 1}: the page, the only one that is not 0; {last}: the answer ----",
        f"  logic [{WORD - 1}:0] read_q;",
        "  always_ff @(posedge clk_i)",
        "    read_q <= " + "\n              | ".join(f"page_{page:02x}_q" for page in pages) + ";",
        "",
        "  always_ff @(posedge clk_i) begin",
        f"    bus_done_o   <= step_q[{last}];",
        "    bus_status_o <= status_q;",
        "    bus_data_o   <= read_q;",
    ]
    out += [f"    if ({w.name}_hit_q) bus_data_o <= {w.name}_read_q;" for w in made.windows]
    out += [
        "    if (status_q != link_pkg::StatusWidth'(link_pkg::StatusOk)) bus_data_o <= '0;",
        "    if (rst) bus_done_o <= 1'b0;",
        "  end",
        "",
        "  // ---- the rules, by address ----",
        "  initial begin",
        f"    for (int k = 0; k < {entries}; k = k + 1) rule_mem[k] = '0;",
    ]
    for address, register, element, word in words:
        out += [
            f"    // {_element(register, element)}" + (f", word {word}" if register.wide else ""),
            f"    rule_mem[{address}] = {rules.rule(register, word)};",
        ]
    out += ["  end", "", "endmodule", "", "`default_nettype wire", ""]
    return "\n".join(out)


def _reset(register: Register, package: str) -> list[str]:
    """Return what a reset does to a register that can be written."""
    out = []
    value = f"{package}::{constant(register.name)}"
    if register.wide:
        out.append(f"      {register.name}_low_q <= {value}[{WORD - 1}:0];")
    out.append(f"      {register.place} <= {value};")
    if register.access == "strobe":
        out.append(f"      {register.place}_strobe <= 1'b0;")
    return out


def _window_memory(window: Window, package: str) -> list[str]:
    """Return a table's own memory, a field each, and what leaves with an entry."""
    name, bits, size = window.name, window.field_bits, 1 << window.index_bits
    last = len(window.fields) - 1
    if window.bank is not None:
        return _elsewhere(window, window.bank)
    out = [f"  // ---- {name}: written at 6, read back at 7 and 8 ----"]
    entry = f"{name}_entry" if window.commit else f"{name}_index"
    if window.commit:
        count = window.index_bits
        out += [
            f"  logic {name}_copy_q;",
            f"  logic [{count - 1}:0] {name}_entry, {name}_entry_q;",
            f"  assign {name}_entry = copy_i ? copy_index_i[{count - 1}:0] : {name}_index;",
        ]
    for k, field in enumerate(window.fields):
        kept = f"{field.name}_q, {field.name}_q2"
        kept = f"{field.name}_q" if k == last or window.commit else kept
        out += [
            f"  logic [{field.width - 1}:0] {field.name}_mem[{size}];",
            f"  logic [{field.width - 1}:0] {kept};",
        ]
    out += [
        "  // What the bus reads of an entry that it has not written.",
        f"  initial for (int k = 0; k < {size}; k = k + 1) begin",
        *(
            f"    {field.name}_mem[k] = {package}::{constant(field.name)}"
            f"[{field.width} * k+:{field.width}];"
            for field in window.fields
        ),
        "  end",
        f"  logic [{WORD - 1}:0] {name}_read_q;",
        "  always_ff @(posedge clk_i) begin",
    ]
    for k, field in enumerate(window.fields):
        here = f"write_q2 && {name}_hit_q"
        if bits:
            here += f" && address_q[{bits - 1}:0] == {_literal(bits, k)}"
        out += [
            f"    if ({here} && !rst)",
            f"      {field.name}_mem[{entry}] <= data_q[{field.width - 1}:0];",
            f"    {field.name}_q <= {field.name}_mem[{entry}];",
        ]
        if k != last and not window.commit:
            out.append(f"    {field.name}_q2 <= {field.name}_q;")
    if window.commit:
        out += _copied(window)
    else:
        out += _entry_out(window)

    def word(field: Register) -> str:
        return _cell_word(field, f"{field.name}_q")

    if bits:
        out.append(f"    case (address_q[{bits - 1}:0])")
        for k, field in enumerate(window.fields):
            out.append(f"      {_literal(bits, k)}: {name}_read_q <= {word(field)};")
        out += [f"      default: {name}_read_q <= '0;", "    endcase"]
    else:
        out.append(f"    {name}_read_q <= {word(window.fields[0])};")
    out += [f"    if (rst) {name}_o.{name}_write <= 1'b0;", "  end", ""]
    return out


def _cell_word(field: Register, text: str) -> str:
    """Return the word of a field of a table."""
    if field.width == WORD:
        return text
    return f"{WORD}'(signed'({text}))" if field.signed else f"{WORD}'({text})"


def _elsewhere(window: Window, bank: Register) -> list[str]:
    """Return what leaves of a table whose memory is elsewhere, and what comes back of it."""
    name, field = window.name, window.fields[0]
    source = f"data_q[{field.width - 1}:0]"
    source = f"signed'({source})" if field.signed else source
    back = _cell_word(field, f"{name}_status_i.{_read_back(window)}")
    return [
        f"  // ---- {name}: goes out at 6, comes back at {LATENCY - 2} ----",
        f"  logic [{WORD - 1}:0] {name}_read_q;",
        "  always_ff @(posedge clk_i) begin",
        f"    {name}_o.{name}_write       <= write_q2 && {name}_hit_q && !rst;",
        f"    {name}_o.{name}_access_bank <= {bank.place};",
        f"    {name}_o.{name}_index       <= {name}_index;",
        f"    {name}_o.{field.name} <= {source};",
        f"    {name}_read_q <= {back};",
        "  end",
        "",
    ]


def _copied(window: Window) -> list[str]:
    """Return how the entries of a table that waits leave for the bank that is not in use."""
    name = window.name
    out = [
        f"    {name}_copy_q  <= copy_i && !rst;",
        f"    {name}_entry_q <= {name}_entry;",
        f"    {name}_o.{name}_write      <= {name}_copy_q;",
        f"    {name}_o.{name}_index      <= {name}_entry_q;",
        f"    {name}_o.{name}_write_bank <= !bank_i;",
        f"    {name}_o.{name}_bank       <= bank_i;",
        f"    if (take_i) {name}_o.{name}_changed <= 1'b0;",
        f"    if (write_q2 && {name}_hit_q) {name}_o.{name}_changed <= 1'b1;",
        f"    if (rst) {name}_o.{name}_changed <= 1'b0;",
    ]
    for field in window.fields:
        source = f"signed'({field.name}_q)" if field.signed else f"{field.name}_q"
        out.append(f"    {name}_o.{field.name} <= {source};")
    return out


def _entry_out(window: Window) -> list[str]:
    """Return how an entry of a table leaves with its last field."""
    name, bits = window.name, window.field_bits
    last = len(window.fields) - 1
    out = [f"    {name}_o.{name}_write <= 1'b0;"]
    here = f"write_q2 && {name}_hit_q"
    if bits:
        here += f" && address_q[{bits - 1}:0] == {_literal(bits, last)}"
    out += [
        f"    if ({here}) begin",
        f"      {name}_o.{name}_write <= 1'b1;",
        f"      {name}_o.{name}_index <= {name}_index;",
    ]
    for k, field in enumerate(window.fields):
        source = f"data_q[{field.width - 1}:0]" if k == last else f"{field.name}_q2"
        source = f"signed'({source})" if field.signed else source
        out.append(f"      {field.place} <= {source};")
    out.append("    end")
    return out


# ---- Python ----

PYTHON_HEADER = '''"""Every register by name, written from SOURCE by scripts/generate.py."""

from dataclasses import dataclass
from typing import Literal

Access = Literal["rw", "strobe", "ro", "counter", "constant"]

_WORD = 32  # bits


@dataclass(frozen=True)
class Register:
    """A register, several of one kind, or a field of a table.

    Attributes:
        name: Of the field in its struct.
        struct: That it is a field of, in register_pkg and as a port; empty of a constant.
        address: Of its first word; of a field, its place in an entry.
        words: All of them; a value of more than 32 bits has two, the lower first.
        count: How many values.
        width: Bits of a value.
        signed: Two's complement; a word is sign-extended.
        access: "rw" and "strobe" can be written; "constant" never changes.
        lock: The register that keeps it as it is, or None.
        reset: Values after a reset; of a constant its value.
        fraction: value = integer / 2**fraction.
        unit: Of the value; empty where it has none.
        minimum: Least integer that it takes.
        maximum: Largest integer that it takes.
        doc: What it means.
        commit: What is written waits for a commit.
    """

    name: str
    struct: str
    address: int
    words: int
    count: int
    width: int
    signed: bool
    access: Access
    lock: str | None
    reset: tuple[int, ...]
    fraction: int
    unit: str
    minimum: int
    maximum: int
    doc: str
    commit: bool


@dataclass(frozen=True)
class Window:
    """A table. Field k of entry i is at address + i * stride + k, the last one writes the entry.

    Attributes:
        bank: The register that says which of two banks is accessed, or None.
        in_use: The register of the bank that is in use; it is not written.
    """

    name: str
    address: int
    entries: int
    stride: int  # words
    fields: tuple[Register, ...]
    lock: str | None
    commit: bool
    bank: str | None
    in_use: str | None
    doc: str


def _one(
    struct: str,
    address: int,
    name: str,
    width: int,
    access: Access,
    doc: str,
    *,
    lock: str | None = None,
    count: int = 1,
    signed: bool = False,
    reset: int = 0,
    fraction: int = 0,
    unit: str = "",
    low: int | None = None,
    high: int | None = None,
    commit: bool = False,
) -> Register:
    """Return a register; it takes what its width takes where low and high do not say otherwise."""
    words = count * (2 if width > _WORD else 1)
    least = -(1 << (width - 1)) if signed else 0
    most = least + (1 << width) - 1
    return Register(
        name, struct, address, words, count, width, signed, access, lock, (reset,) * count,
        fraction, unit, least if low is None else low, most if high is None else high, doc, commit,
    )  # fmt: skip
'''


def _quoted(text: str) -> str:
    """Return a text as ruff writes it."""
    return repr(text) if '"' in text else f'"{text}"'


def _call(begin: str, arguments: list[str], end: str) -> list[str]:
    """Return the lines of a call, each as full as it gets; a text that is too long is in pieces."""
    indent = " " * len(begin)
    room = COLUMNS - 1 - len(indent) - len(end)
    lines, line = [], begin
    for k, argument in enumerate(arguments):
        after = end if k == len(arguments) - 1 else ","
        if len(line) > len(indent) and len(line) + len(argument) + len(after) >= COLUMNS:
            lines.append(line.rstrip())
            line = indent
        if len(argument) > room:
            text = argument[1:-1]
            pieces = textwrap.wrap(text, room - 2, drop_whitespace=False, break_long_words=False)
            *whole, argument = [argument[0] + piece + argument[0] for piece in pieces]
            lines += [indent + piece for piece in whole]
        line += f"{argument}{after} "
    return [*lines, line.rstrip()]


def _python(register: Register, address: int, indent: str = "    ") -> list[str]:
    """Return the call that makes a register; what is as for most of them is not said."""
    least = -(1 << (register.width - 1)) if register.signed else 0
    most = least + (1 << register.width) - 1
    reset = register.reset[0]
    shown = f"0x{reset:08X}" if register.access == "constant" and reset >= 0 else repr(reset)
    said = [
        ("lock", _quoted(register.lock or ""), register.lock is not None),
        ("count", repr(register.count), register.count > 1),
        ("signed", "True", register.signed),
        ("reset", shown, reset != 0),
        ("fraction", repr(register.fraction), register.fraction != 0),
        ("unit", _quoted(register.unit), register.unit != ""),
        ("low", repr(register.minimum), register.minimum != least),
        ("high", repr(register.maximum), register.maximum != most),
        ("commit", "True", register.commit),
    ]
    arguments = [
        _quoted(register.struct), f"0x{address:03X}", _quoted(register.name), repr(register.width),
        _quoted(register.access), _quoted(register.doc),
    ]  # fmt: skip
    arguments += [f"{key}={value}" for key, value, wanted in said if wanted]
    return _call(f"{indent}_one(", arguments, "),")


def register_map(made: Map) -> str:
    """Return register_map.py."""
    out = [PYTHON_HEADER.replace("SOURCE", made.source), "", f"MAP_HASH = 0x{made.hash:08X}", ""]
    out += ["# fmt: off", "_REGISTERS = ("]
    for register in made.registers:
        out += _python(register, register.address)
    out += [")", "", "_WINDOWS = ("]
    for window in made.windows:
        out.append(
            f"    Window({_quoted(window.name)}, 0x{window.address:04X}, {window.entries}, "
            f"{window.stride}, ("
        )
        for k, field in enumerate(window.fields):
            out += _python(field, k, " " * 8)
        bank, in_use = (
            "None" if one is None else _quoted(one.name) for one in (window.bank, window.in_use)
        )
        lock = "None" if window.lock is None else _quoted(window.lock)
        made_of = [lock, repr(window.commit), bank, in_use, _quoted(window.doc)]
        out += _call("    ), ", made_of, "),")
    names = ", ".join(_quoted(name) for name in made.locks)
    out += [
        ")",
        "# fmt: on",
        "",
        "REGISTERS: dict[str, Register] = {one.name: one for one in _REGISTERS}",
        "WINDOWS: dict[str, Window] = {one.name: one for one in _WINDOWS}",
        f"LOCKS: tuple[str, ...] = ({names}{',' if len(made.locks) == 1 else ''})",
    ]
    return "\n".join([*out, ""])


# ---- the page ----

PAGE_HEADER = f"""# Registers

Written from [{SOURCE}](../{SOURCE}) by `scripts/generate.py`; the map's hash is {{hash}}.

Every word has 32 bits and a word address. The value of a register is its word divided by
2^fraction, in its unit. A signed value is sign-extended to the whole word.

- **Writing.** The board reads a register back before it answers a write. A value that is outside
  the register's range, or wider than the register, is answered with `BAD_VALUE` and changes
  nothing.
- **Two words.** A register of more than 32 bits has two words, the lower one first. Both take
  effect together when the higher one is written. Reading the lower word of a measured value keeps
  the higher word for the next read, so that both belong to one measurement.
- **Arrays.** `name[n]` has n values in consecutive words.
- **Access.** `rw` can be read and written. `strobe` is `rw`, and every write is an event. `ro` can
  only be read. A `counter` is `ro` and stops at its largest value. A `constant` never changes.
- **Locks.** A lock can be set to 1, and stays so until the reset. Registers that name a set lock
  answer `LOCKED` to every write. The locks are the last registers of the map, so a write of several
  words cannot lock what it has still to write.
- **Commit.** What is written into registers and tables that say "At a commit." waits, and is read
  back as written. A write of 1 to `commit` lets all of it take effect together, between two lines.
  Until `commit_waiting` is 0 again, writes of what waits, and any access to its tables, are
  answered with `BUSY`. A reset is followed by a commit.
- **Tables.** Each field of a table's entry is a word. The entry takes effect when its last field is
  written. A reset does not change a table. Before the first write it holds zeros, or what
  [its configuration](bring-up.md#a-board-of-your-own) has; `map_table` is undefined until then.
- **Other addresses** are answered with `NO_ADDRESS`.
"""


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _limits(register: Register) -> str:
    """Return the range where it is not that of the width."""
    lowest = -(1 << (register.width - 1)) if register.signed else 0
    if (register.minimum, register.maximum) == (lowest, lowest + (1 << register.width) - 1):
        return ""
    if register.minimum == register.maximum:
        return f"; only {register.minimum}"
    return f"; {register.minimum} to {register.maximum}"


def _format(register: Register) -> str:
    """Return sign, bits and fraction: s26.24 has 24 fraction bits."""
    fraction = f".{register.fraction}" if register.fraction else ""
    return f"{'s' if register.signed else 'u'}{register.width}{fraction}"


def _row(register: Register, address: str) -> str:
    name = register.name if register.count == 1 else f"{register.name}[{register.count}]"
    reset = register.reset[0]
    shown = f"0x{reset:08X}" if register.access == "constant" else str(reset)
    cells = [
        address,
        f"`{name}`",
        register.access,
        _format(register),
        shown if register.writable or register.access == "constant" else "",
        register.unit,
        f"`{register.lock}`" if register.lock else "",
        register.doc + _limits(register),
    ]
    return "| " + " | ".join(_cell(cell) for cell in cells) + " |"


def _banks(window: Window) -> list[str]:
    """Return what the page says of a table with two banks."""
    if window.bank is None or window.in_use is None:
        return []
    return [
        f"There are two banks: `{window.bank.name}` says which one is accessed. That of "
        f"`{window.in_use.name}` is in use, and a write into it is answered with `BUSY`.",
    ]


def document(made: Map) -> str:
    """Return docs/registers.md."""
    lines = PAGE_HEADER.format(hash=f"0x{made.hash:08X}").splitlines()
    titles = ["address", "name", "access", "format", "reset", "unit", "lock", "meaning"]
    head = ["", "| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for group in made.groups:
        committed = " At a commit." if any(r.commit for r in group.registers) else ""
        lines += ["", f"## {group.name}", "", f"{group.doc}.{committed}", *head]
        for register in group.registers:
            span = f"0x{register.address:04X}"
            if register.words > 1:
                span += f"..{register.address + register.words - 1:04X}"
            lines.append(_row(register, span))
    for window in made.windows:
        end = window.address + (window.entries - 1) * window.stride + len(window.fields) - 1
        lines += [
            "",
            f"## Table {window.name}",
            "",
            f"{window.doc}. {window.entries} entries of {window.stride} "
            f"word{'s' * (window.stride > 1)}, "
            f"0x{window.address:04X}..{end:04X}.{' At a commit.' if window.copied else ''}",
            *_banks(window),
            *head,
        ]
        lines += [_row(field, f"+{k}") for k, field in enumerate(window.fields)]
    return "\n".join([*lines, ""])
