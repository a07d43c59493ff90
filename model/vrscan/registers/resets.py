"""What registers and tables of a board hold after its reset, as ``register_pkg`` has it."""

import re
from collections.abc import Iterable, Mapping

from vrscan.data.config import Config
from vrscan.registers.load import Build, settings
from vrscan.registers.values import Value, find


def resets(config: Config, build: Build) -> dict[str, Value]:
    """Return what a board that is built for a configuration holds: what a load of it would write.

    Only the maps are not in use, because no reset brings their nodes.

    Raises:
        InputError: as ``settings``.
    """
    return settings(config, build) | {"map_enable": 0}


def constant(name: str) -> str:
    """Return the name of the constant with what a register or a table's field resets to."""
    return "Reset" + "".join(word.capitalize() for word in name.split("_"))


def declaration(name: str, width: int, values: Iterable[int]) -> str:
    """Return the line that declares the constant: all values, ``width`` bits each, first lowest."""
    digits = [f"{value & (1 << width) - 1:0{width}b}" for value in values]
    bits, value = len(digits) * width, int("".join(reversed(digits)), 2)
    kind = "logic" if bits == 1 else f"logic [{bits - 1}:0]"
    return f"  localparam {kind} {constant(name)} = {bits}'h{value:x};"


def with_resets(package: str, values: Mapping[str, Value]) -> str:
    """Return the text of ``register_pkg`` with other resets.

    Args:
        package: As shipped.
        values: By the names of registers and fields of tables.
    """
    for name, value in values.items():
        several = value if isinstance(value, tuple) else (value,)
        line = declaration(name, find(name).width, several)
        old = rf"^  localparam logic[^=]* {constant(name)} = .*;$"
        package, found = re.subn(old, line, package, flags=re.MULTILINE)
        assert found == 1, name
    return package
