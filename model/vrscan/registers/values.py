"""Values of registers as words on the link, and the words that go into one command."""

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from vrscan.data import link_pkg
from vrscan.data.bus import WORD_BITS, WORD_MASK, WRITABLE
from vrscan.data.errors import InputError, nearest
from vrscan.registers.register_map import REGISTERS, WINDOWS, Register, Window

Value = int | tuple[int, ...]
FIELDS: dict[str, tuple[Window, Register]] = {
    entry.name: (window, entry) for window in WINDOWS.values() for entry in window.fields
}
# What can be read as a whole: a table with two banks is large, and one of them is not accessed.
NAMES = (*REGISTERS, *(name for name, (window, _) in FIELDS.items() if window.bank is None))


def find(name: str) -> Register:
    """Return a register, or a field of a table, by its name.

    Raises:
        InputError: naming the name and similar names, if there is none.
    """
    if name in REGISTERS:
        return REGISTERS[name]
    if name in FIELDS:
        return FIELDS[name][1]
    raise InputError(f"no register {name!r}{nearest(name, NAMES, most=3)}")


def count(name: str) -> int:
    """Return the number of a register's values, or of the entries of a table's field."""
    return FIELDS[name][0].entries if name in FIELDS else find(name).count


def within(register: Register, number: int) -> int:
    """Return a number reduced into a register's range, modulo the range's length."""
    return register.minimum + number % (register.maximum - register.minimum + 1)


def words_per_value(register: Register) -> int:
    """Return the number of words of one of a register's values."""
    return register.words // register.count


def addresses(name: str) -> list[int]:
    """Return the addresses of all words of a register, or of a field of a table."""
    register = find(name)
    if name in FIELDS:
        window = FIELDS[name][0]
        return [
            window.address + entry * window.stride + register.address
            for entry in range(window.entries)
        ]
    return [register.address + k for k in range(register.words)]


def _at(address: int) -> tuple[Register, int] | None:
    """Return the register or field that an address belongs to, and the index of its value."""
    for register in REGISTERS.values():
        if 0 <= address - register.address < register.words:
            return register, (address - register.address) // words_per_value(register)
    for window in WINDOWS.values():
        entry, place = divmod(address - window.address, window.stride)
        if 0 <= entry < window.entries and place < len(window.fields):
            return window.fields[place], entry
    return None


def rule_at(address: int) -> tuple[str, str | None] | None:
    """Return how what is at an address is accessed, and the name of its lock."""
    found = _at(address)
    if found is None:
        return None
    for window in WINDOWS.values():
        if found[0] in window.fields:
            return found[0].access, window.lock
    return found[0].access, found[0].lock


def name_at(address: int) -> str:
    """Return the name of the register at an address, with an index where it has several values."""
    found = _at(address)
    if found is None:
        return f"address {address:#06x}"
    register, place = found
    return register.name if count(register.name) == 1 else f"{register.name}[{place}]"


def integer_at(address: int, word: int) -> int:
    """Return the integer that a word at an address represents."""
    found = _at(address)
    negative = found is not None and found[0].signed and word >> (WORD_BITS - 1)
    return word - (1 << WORD_BITS) if negative else word


def to_words(name: str, value: Value) -> list[int]:
    """Return a value as words, the lowest first.

    Raises:
        InputError: naming register and value, if it does not fit or is of the wrong kind.
    """
    register, expected = find(name), count(name)
    values = value if isinstance(value, tuple | list) else (value,)
    if len(values) != expected:
        raise InputError(f"{name}: needs {expected} value{'s' * (expected > 1)} ({len(values)})")
    words = []
    for k, each in enumerate(values):
        place = name if expected == 1 else f"{name}[{k}]"
        if not isinstance(each, int):
            raise InputError(f"{place}: needs an integer ({each!r})")
        if not register.minimum <= each <= register.maximum:
            raise InputError(f"{place}: must be {register.minimum} to {register.maximum} ({each})")
        for word in range(1 if name in FIELDS else words_per_value(register)):
            words.append(each >> (WORD_BITS * word) & WORD_MASK)
    return words


def from_words(name: str, words: Sequence[int]) -> Value:
    """Return the value that words represent: an integer, or a tuple where there are several."""
    register, expected = find(name), count(name)
    each = 1 if name in FIELDS else words_per_value(register)
    values = []
    for k in range(expected):
        value = sum(words[k * each + j] << (WORD_BITS * j) for j in range(each))
        if register.signed and value >> (WORD_BITS * each - 1):
            value -= 1 << (WORD_BITS * each)
        values.append(value)
    return values[0] if expected == 1 else tuple(values)


def integer(value: Value) -> int:
    """Return the integer of a register with one value."""
    assert isinstance(value, int)
    return value


def to_scaled(name: str, value: Value) -> float | tuple[float, ...]:
    """Return a value in its register's unit."""
    step = 2.0 ** -find(name).fraction
    return tuple(step * each for each in value) if isinstance(value, tuple) else step * value


def from_scaled(name: str, value: float | Sequence[float]) -> Value:
    """Return the nearest integer, half up, for a value in its register's unit.

    Raises:
        InputError: naming the register and its range in that unit, if it does not fit.
    """
    import math

    register, expected = find(name), count(name)
    numbers = [value] if isinstance(value, int | float) else list(value)
    if len(numbers) != expected:
        raise InputError(f"{name}: needs {expected} value{'s' * (expected > 1)} ({len(numbers)})")
    found = []
    for number in numbers:
        if not math.isfinite(number):
            raise InputError(f"{name}: must be a number ({number})")
        # Integers are computed as integers: a float of 2**53 and more has no halves.
        scaled = math.floor(math.ldexp(number, register.fraction) + 0.5)
        if isinstance(number, int):
            scaled = number << register.fraction
        if not register.minimum <= scaled <= register.maximum:
            step, unit = 2.0**-register.fraction, f" {register.unit}" * bool(register.unit)
            low, high = register.minimum * step, register.maximum * step
            raise InputError(f"{name}: must be {low:.9g} to {high:.9g}{unit} ({number:.9g})")
        found.append(scaled)
    return found[0] if expected == 1 else tuple(found)


def from_texts(name: str, texts: Sequence[str], *, raw: bool = False) -> Value:
    """Return the value that somebody typed, each number in the register's unit.

    Args:
        name: Name of the register.
        texts: A text for each of its values.
        raw: Whether they are the integers themselves.

    Raises:
        InputError: naming register and text, if one is no number, or as ``from_scaled``.
    """
    numbers = [_number(name, text, raw) for text in texts]
    if not raw:
        return from_scaled(name, numbers)
    whole = [number for number in numbers if isinstance(number, int)]
    value = whole[0] if len(whole) == 1 else tuple(whole)
    to_words(name, value)
    return value


def _number(name: str, text: str, raw: bool) -> int | float:
    """Return a typed text as a number."""
    with contextlib.suppress(ValueError):
        return int(text, 0)
    if not raw:
        with contextlib.suppress(ValueError):
            return float(text)
    raise InputError(f"{name}: must be {'an integer' if raw else 'a number'} ({text})")


@dataclass
class Block:
    """Words at consecutive addresses."""

    address: int
    words: list[int] = field(default_factory=list)


def write_blocks(settings: Iterable[tuple[str, Value]]) -> list[Block]:
    """Return the fewest WRITEs that set registers and tables, sorted by address.

    A wide value and an entry of a table stay whole.

    Raises:
        InputError: naming what cannot be written, does not fit or is given twice, or a table with a
            missing field.
    """
    words: dict[int, int] = {}
    named: set[str] = set()
    for name, value in settings:
        register = find(name)
        if register.access not in WRITABLE:
            raise InputError(f"{name}: cannot be written")
        if name in named:
            raise InputError(f"{name}: is given twice")
        named.add(name)
        words.update(zip(addresses(name), to_words(name, value), strict=True))
    for window in WINDOWS.values():
        given = [entry.name in named for entry in window.fields]
        if any(given) and not all(given):
            missing = window.fields[given.index(False)].name
            raise InputError(f"{missing}: is missing; an entry of {window.name} is written whole")
    return _blocks(words)


def read_blocks(names: Iterable[str]) -> list[Block]:
    """Return the fewest READs that fetch registers and tables, with zeros for words."""
    return _blocks(dict.fromkeys(sorted({a for name in names for a in addresses(name)}), 0))


def _blocks(words: Mapping[int, int]) -> list[Block]:
    """Return words by address in blocks that fit into a command."""
    blocks: list[Block] = []
    for unit in _units(words):
        last = blocks[-1] if blocks else None
        if (
            last is None
            or last.address + len(last.words) != unit[0]
            or len(last.words) + len(unit) > link_pkg.MAX_WORDS
        ):
            last = Block(unit[0])
            blocks.append(last)
        last.words += [words[address] for address in unit]
    return blocks


def _units(words: Mapping[int, int]) -> list[list[int]]:
    """Return addresses in groups that one command has to contain."""
    units: list[list[int]] = []
    owner: object = None
    for address in sorted(words):
        place = _whole(address)
        if place is not None and place == owner and units[-1][-1] == address - 1:
            units[-1].append(address)
        else:
            units.append([address])
        owner = place
    return units


def _whole(address: int) -> tuple[str, int] | None:
    """Return the value or entry that an address is part of and that must stay whole, or None."""
    for window in WINDOWS.values():
        entry = (address - window.address) // window.stride
        if 0 <= entry < window.entries:
            return window.name, entry
    register = _WIDE.get(address)
    return None if register is None else (register, 0)


_WIDE = {
    register.address + k: register.name
    for register in REGISTERS.values()
    if register.width > WORD_BITS
    for k in range(register.words)
}
