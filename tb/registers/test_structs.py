"""The structs: every field in its place, whichever way its bits come and go."""

import numpy as np
import pytest
from harness import generator

from vrscan.data import pkg
from vrscan.registers.register_map import REGISTERS, WINDOWS
from vrscan.registers.structs import (
    POINT,
    Struct,
    of_registers,
    package_struct,
    register_struct,
)

STRUCTS = [
    *of_registers(REGISTERS, WINDOWS).values(),
    *(package_struct(name) for name in pkg.STRUCTS),
]


@pytest.mark.parametrize("struct", STRUCTS, ids=lambda struct: struct.name)
def test_the_fields_fill_the_struct(struct: Struct) -> None:
    """From the top down, without a gap and without an overlap."""
    top = struct.width
    for field in struct.fields.values():
        top -= field.bits
        assert field.low == top, field.name
    assert top == 0


@pytest.mark.parametrize("struct", STRUCTS, ids=lambda struct: struct.name)
def test_rows_are_the_packed_values(struct: Struct) -> None:
    """Columns to words, words to columns, and value by value."""
    draw = generator(struct.width)
    columns = {}
    for name, field in struct.fields.items():
        if field.bits <= 32:
            least = -(1 << field.width - 1) if field.signed else 0
            columns[name] = draw.integers(least, least + (1 << field.width), 50)
    rows = struct.pack_rows(columns) if columns else np.zeros((0, struct.words), np.uint32)
    for k, row in enumerate(rows):
        bits = struct.pack({name: int(values[k]) for name, values in columns.items()})
        assert sum(int(word) << 32 * n for n, word in enumerate(row)) == bits
    for name, values in columns.items():
        assert np.array_equal(struct.column(rows, name), values), name


def test_a_strobe_follows_its_register() -> None:
    names = list(register_struct("test_t").fields)
    assert names[names.index("test_start") + 1] == "test_start_strobe"
    assert list(register_struct("table_t").fields) == [
        "table_write", "table_index", "table_amplitude", "table_midpoint",
        "table_write_bank", "table_bank", "table_changed",
    ]  # fmt: skip


def test_several_values_are_one_field() -> None:
    """The first of them lowest; what an object does not have is 0."""
    values = range(-4, 5)
    bits = register_struct("motion_t").pack({"motion_a": list(values), "drive_phase": 5})
    low = register_struct("motion_t").fields["motion_a"].low
    got = [bits >> low + pkg.MOTION_WIDTH * k & (1 << pkg.MOTION_WIDTH) - 1 for k in range(9)]
    assert got == [value & (1 << pkg.MOTION_WIDTH) - 1 for value in values]
    assert register_struct("motion_t").packed(object()) == 0


def test_every_name_of_a_point_is_a_field() -> None:
    assert set(POINT.values()) <= set(package_struct("point_t").fields)
