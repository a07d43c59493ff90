"""Registers on a bus, one access at a time; the twin of ``rtl/link/register_file.sv``."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from vrscan.data import link_pkg
from vrscan.data.bus import COMMIT, WORD_BITS, WORD_MASK, WRITABLE
from vrscan.registers.register_map import LOCKS, REGISTERS, WINDOWS, Register, Window

LATENCY = 14  # clocks from bus_valid_i to bus_done_o
WRITTEN = 7  # clocks from bus_valid_i to the first clock with the written value
SAMPLED = 10  # clocks from bus_valid_i to the clock in which a READ samples the inputs


class Place(NamedTuple):
    """The word of a register's element that an address stands for."""

    register: Register
    element: int
    word: int  # 0 is the lowest


class Written(NamedTuple):
    """An event that a write causes: a strobe, or an entry of a table.

    Attributes:
        name: Name of the register or of the table.
        entry: Number of the entry in the table; 0 for a register.
        values: Values of the entry's fields, or of the register alone.
    """

    name: str
    entry: int
    values: tuple[int, ...]


def from_word(data: int, signed: bool) -> int:
    """Return the integer that a word of 32 bits stands for."""
    return data - (1 << WORD_BITS) if signed and data >> (WORD_BITS - 1) else data


def wrapped(value: int, register: Register) -> int:
    """Return the lower bits of a value as a register's integer."""
    value &= (1 << register.width) - 1
    negative = register.signed and value >> (register.width - 1)
    return value - (1 << register.width) if negative else value


class RegisterFile:
    """All registers and their behaviour on the bus. A new one is in the state after power-up.

    Args:
        registers: The registers; by default the instrument's.
        windows: The tables.
        locks: Names of the locks.

    Attributes:
        inputs: Values at the ports of read registers, by name: an integer, or one for each element.
        values: Values of written registers as they are read, by name, one for each element.
        written: Events that writes have caused since the last ``reset``, the newest last.
        waiting: Whether a commit waits: then what it is of cannot be written.
        active: Values at the ports of what waits for a commit, by name, one for each element.
    """

    def __init__(
        self,
        registers: Mapping[str, Register] = REGISTERS,
        windows: Mapping[str, Window] = WINDOWS,
        locks: Sequence[str] = LOCKS,
    ) -> None:
        self._registers = registers
        self._windows = windows
        self._locks = locks
        self._places: dict[int, Place] = {}
        for register in registers.values():
            each = register.words // register.count
            for k in range(register.words):
                self._places[register.address + k] = Place(register, k // each, k % each)
        self.inputs: dict[str, int | tuple[int, ...]] = {
            register.name: 0 if register.count == 1 else (0,) * register.count
            for register in registers.values()
            if register.access in ("ro", "counter")
        }
        # Of a table with two banks one stands behind the other.
        self._tables = {
            (window.name, field.address): [0] * window.entries * (1 if window.bank is None else 2)
            for window in windows.values()
            for field in window.fields
        }
        self._commits = frozenset(r.name for r in registers.values() if r.commit)
        self.reset()

    def table(self, window: str, field: str) -> list[int]:
        """Return the entries of a field of a table, of both banks where it has two."""
        own = self._windows[window]
        return self._tables[window, next(f.address for f in own.fields if f.name == field)]

    def reset(self) -> None:
        """Apply ``rst_i``; tables stay."""
        written = [r for r in self._registers.values() if r.access in WRITABLE]
        self.values = {register.name: list(register.reset) for register in written}
        self._waiting = {  # lower words of wide registers
            register.name: register.reset[0] & WORD_MASK for register in written
        }
        self._kept: dict[str, int] = dict.fromkeys(self.inputs, 0)  # higher words of wide inputs
        self.written: list[Written] = []
        self.waiting = False
        self.changed = {
            window.name: False
            for window in self._windows.values()
            if window.commit and window.bank is None
        }
        self.take()

    def take(self) -> None:
        """Apply ``take_i``."""
        self.active = {name: list(self.values[name]) for name in self._commits}
        self.changed = dict.fromkeys(self.changed, False)

    def ports(self) -> dict[str, list[int]]:
        """Return the values in effect in written registers."""
        return self.values | self.active

    def access(self, access: int, address: int, data: int = 0) -> tuple[int, int]:
        """Execute one access.

        Args:
            access: Kind of access: READ, CHECK or WRITE of ``link_pkg``; anything else is a READ.
            address: Address of a word.
            data: Word of 32 bits for a CHECK or WRITE.

        Returns:
            Status, and the word as it reads afterwards; 0 unless the status is OK.
        """
        changes = access in (link_pkg.ACCESS_CHECK, link_pkg.ACCESS_WRITE)
        place = self._places.get(address)
        cell = self._cell(address) if place is None else None
        if cell is not None:
            window, index, field = cell
            status = self._verdict(changes, field, 0, window.lock, data, self._used(window))
            if self.waiting and window.commit and not changes:
                status = link_pkg.STATUS_BUSY
            if status == link_pkg.STATUS_OK and access == link_pkg.ACCESS_WRITE:
                self._write_cell(window, index, field, data)
            read = self._tables[window.name, field.address][self._at(window, index)] & WORD_MASK
        elif place is not None:
            status = self._verdict(changes, place.register, place.word, place.register.lock, data)
            if status == link_pkg.STATUS_OK and access == link_pkg.ACCESS_WRITE:
                self._write(place, data)
            read = self._read(place, keep=not changes)
        else:
            return link_pkg.STATUS_NO_ADDRESS, 0
        return status, read if status == link_pkg.STATUS_OK else 0

    def _cell(self, address: int) -> tuple[Window, int, Register] | None:
        for window in self._windows.values():
            index, k = divmod(address - window.address, window.stride)
            if 0 <= index < window.entries and k < len(window.fields):
                return window, index, window.fields[k]
        return None

    def _at(self, window: Window, index: int) -> int:
        """Return where an entry of a table stands in its memory."""
        bank = 0 if window.bank is None else self.values[window.bank][0]
        return bank * window.entries + index

    def _used(self, window: Window) -> bool:
        """Return whether the bank that is accessed is the one in use."""
        if window.bank is None or window.in_use is None:
            return False
        return self.values[window.bank] == self.active[window.in_use]

    def _verdict(
        self,
        changes: bool,
        register: Register,
        word: int,
        lock: str | None,
        data: int,
        used: bool = False,
    ) -> int:
        """Return the status of an access."""
        if not changes:
            return link_pkg.STATUS_OK
        if register.access not in WRITABLE:
            return link_pkg.STATUS_READ_ONLY
        if lock is not None and self.values[lock] == [1]:
            return link_pkg.STATUS_LOCKED
        if used or (self.waiting and (register.commit or register.name == COMMIT)):
            return link_pkg.STATUS_BUSY
        low, high = register.minimum, register.maximum
        if register.width > WORD_BITS:
            low, high = (low >> WORD_BITS, high >> WORD_BITS) if word else (0, WORD_MASK)
        good = low <= from_word(data, low < 0) <= high
        return link_pkg.STATUS_OK if good else link_pkg.STATUS_BAD_VALUE

    def _write(self, place: Place, data: int) -> None:
        register, element, word = place
        name = register.name
        if register.width > WORD_BITS:
            if word == 0:
                self._waiting[name] = data
                return
            data = data << WORD_BITS | self._waiting[name]
        self.values[name][element] = wrapped(data, register)
        if register.access == "strobe":
            self.written.append(Written(name, 0, tuple(self.values[name])))

    def _write_cell(self, window: Window, index: int, field: Register, data: int) -> None:
        at = self._at(window, index)
        self._tables[window.name, field.address][at] = wrapped(data, field)
        if window.name in self.changed:
            self.changed[window.name] = True
        elif field.address == len(window.fields) - 1:
            entry = tuple(self._tables[window.name, f.address][at] for f in window.fields)
            self.written.append(Written(window.name, index, entry))

    def _read(self, place: Place, *, keep: bool) -> int:
        """Return a word; a READ of a wide input's lower word keeps the higher word."""
        register, element, word = place
        name, wide = register.name, register.width > WORD_BITS
        if register.access == "constant":
            value = register.reset[0]
        elif register.access in WRITABLE:
            value = self.values[name][element]
            if wide:
                value = value >> WORD_BITS if word else self._waiting[name]
        else:
            given = self.inputs[name]
            value = given[element] if isinstance(given, tuple) else given
            if wide and word:
                value = self._kept[name]
            elif wide and keep:
                self._kept[name] = value >> WORD_BITS
        return value & WORD_MASK
