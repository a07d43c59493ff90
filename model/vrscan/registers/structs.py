"""The structs of ``register_pkg`` and ``vrscan_pkg``: where their fields are, to and from bits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Ints
from vrscan.registers.register_map import REGISTERS, WINDOWS, Register, Window

_WORD = 32  # bits of what C++ takes a struct as
BANK = ("write_bank", "bank", "changed")  # what leaves with a table whose entries wait

Words = np.ndarray[tuple[int, ...], np.dtype[np.uint32]]


@dataclass(frozen=True)
class Field:
    """A field: ``count`` values of ``width`` bits, the first one lowest, from bit ``low`` on."""

    name: str
    low: int
    width: int
    signed: bool
    count: int = 1

    @property
    def bits(self) -> int:
        """Bits of all values."""
        return self.width * self.count


@dataclass(frozen=True)
class Struct:
    """A packed struct; a field of a struct within it is called by both names, with a dot between.

    Attributes:
        name: Of the type.
        fields: By name, from the highest bits down.
        width: Bits.
    """

    name: str
    fields: dict[str, Field]
    width: int

    @property
    def words(self) -> int:
        """Words of 32 bits."""
        return -(-self.width // _WORD)

    def pack(self, values: Mapping[str, int | Sequence[int]]) -> int:
        """Return the bits of some fields' values; the others are 0."""
        bits = 0
        for name, value in values.items():
            field = self.fields[name]
            several = value if isinstance(value, Sequence) else [int(value)]
            for k, one in enumerate(several):
                bits |= (int(one) & (1 << field.width) - 1) << field.low + k * field.width
        return bits

    def packed(self, source: object) -> int:
        """Return the bits of an object that has values by the names of some of the fields."""
        return self.pack({n: getattr(source, n) for n in self.fields if hasattr(source, n)})

    def as_words(self, source: object) -> list[int]:
        """Return what ``packed`` does in words, the lowest first."""
        bits = self.packed(source)
        return [bits >> _WORD * k & (1 << _WORD) - 1 for k in range(self.words)]

    def pack_rows(self, columns: Mapping[str, Ints]) -> Words:
        """Return words, the lowest first, of columns of values of up to 32 bits, [n, words]."""
        count = len(next(iter(columns.values())))
        rows = np.zeros((count, self.words + 1), np.uint64)
        for name, values in columns.items():
            place, shift = divmod(self.fields[name].low, _WORD)
            given = np.asarray(values).astype(np.uint64) & np.uint64(
                (1 << self.fields[name].width) - 1
            )
            moved = given << np.uint64(shift)
            rows[:, place] |= moved & np.uint64((1 << _WORD) - 1)
            rows[:, place + 1] |= moved >> np.uint64(_WORD)
        return np.ascontiguousarray(rows[:, : self.words], np.uint32)

    def column(self, rows: Words, name: str) -> Ints:
        """Return a field of up to 32 bits of words as ``pack_rows`` makes them, int64 [n]."""
        field = self.fields[name]
        place, shift = divmod(field.low, _WORD)
        wide = rows[:, place].astype(np.uint64)
        if shift + field.width > _WORD:
            wide |= rows[:, place + 1].astype(np.uint64) << np.uint64(_WORD)
        value = (wide >> np.uint64(shift) & np.uint64((1 << field.width) - 1)).astype(np.int64)
        sign = np.int64(1 << field.width - 1) if field.signed else np.int64(0)
        column: Ints = (value ^ sign) - sign
        return column


def _struct(name: str, fields: Sequence[tuple[str, int, bool, int]]) -> Struct:
    """Return a struct of fields, name, bits of a value, sign and count, the highest first."""
    width = low = sum(bits * count for _, bits, _, count in fields)
    made = {}
    for field, bits, signed, count in fields:
        low -= bits * count
        made[field] = Field(field, low, bits, signed, count)
    return Struct(name, made, width)


def _of(register: Register) -> list[tuple[str, int, bool, int]]:
    own = (register.name, register.width, register.signed, register.count)
    strobe = (f"{register.name}_strobe", 1, False, 1)
    return [own, strobe] if register.access == "strobe" else [own]


def _banks(window: Window) -> tuple[str, ...]:
    if window.bank is not None:
        return ("access_bank",)
    return BANK if window.commit else ()


def of_registers(
    registers: Mapping[str, Register], windows: Mapping[str, Window]
) -> dict[str, Struct]:
    """Return the structs of a register file, by the names of its ports without their direction."""
    fields: dict[str, list[tuple[str, int, bool, int]]] = {}
    for register in registers.values():
        if register.struct:
            fields.setdefault(register.struct, []).extend(_of(register))
    for window in windows.values():
        index = (window.entries - 1).bit_length()
        fields[window.name] = [
            (f"{window.name}_write", 1, False, 1),
            (f"{window.name}_index", index, False, 1),
            *(one for field in window.fields for one in _of(field)),
            *((f"{window.name}_{one}", 1, False, 1) for one in _banks(window)),
        ]
        if window.bank is not None:
            field = window.fields[0]
            back = (f"{window.name}_read", field.width, field.signed, 1)
            fields[f"{window.name}_status"] = [back]
    return {name: _struct(f"{name}_t", found) for name, found in fields.items()}


@cache
def register_struct(name: str) -> Struct:
    """Return a struct of ``register_pkg`` by the name of its type."""
    return of_registers(REGISTERS, WINDOWS)[name.removesuffix("_t")]


def _flat(name: str) -> list[tuple[str, int, bool, int]]:
    fields: list[tuple[str, int, bool, int]] = []
    for field, kind, signed in pkg.STRUCTS[name]:
        if isinstance(kind, int):
            fields.append((field, kind, signed, 1))
        else:
            fields += [(f"{field}.{inner}", bits, sign, n) for inner, bits, sign, n in _flat(kind)]
    return fields


# The fields of point_t by the names of Points and of records, where they are others.
POINT = {
    "line": "number",
    "time": "line.time_clks",
    **{
        name: f"line.{name}"
        for name in ("angle", "power", "mirror_flags", "confidence", "inward", "test")
    },
}


@cache
def package_struct(name: str) -> Struct:
    """Return a struct of ``vrscan_pkg`` by the name of its type."""
    return _struct(name, _flat(name))
