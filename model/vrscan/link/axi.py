"""A board whose registers are in this processor's memory, over AXI4-Lite.

    with AxiDevice.mapped("/dev/uio0") as board:
        board.load(config)
        board.registers.mirror_enable = 1

Points and lines come as AXI4-Streams, which are not this class's. docs/axi.md has the bus.
"""

import mmap
import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Protocol, Self

from vrscan.data import link_pkg
from vrscan.data.bus import WRITABLE
from vrscan.data.errors import InputError
from vrscan.link.protocol import Status
from vrscan.link.register_host import DeviceError, RegisterHost
from vrscan.link.transport import LinkError
from vrscan.registers import values
from vrscan.registers.values import Block

WORD_BYTES = 4
MAP_BYTES = WORD_BYTES << link_pkg.ADDRESS_WIDTH  # of all registers
TIMEOUT_S = 5.0


class BusError(Exception):
    """The bus answered SLVERR or DECERR.

    Attributes:
        status: Why, as ``axi_refused`` has it; None if it is not known.
    """

    def __init__(self, status: int | None = None) -> None:
        super().__init__(f"refused: {status}")
        self.status = status


class Words(Protocol):
    """Memory with the registers, by the addresses of docs/registers.md."""

    def read(self, address: int) -> int:
        """Return a word; ``BusError`` if the bus refuses."""

    def write(self, address: int, word: int) -> None:
        """Write a word; ``BusError`` if the bus refuses."""


class MappedWords:
    """Registers in a file that can be mapped: a UIO device, or /dev/mem.

    On most systems an access that the bus refuses ends the process with SIGBUS, so ``AxiDevice``
    asks for what would be refused before it writes.

    Args:
        file: Path of the file.
        offset: Where the registers begin in it, bytes.

    Raises:
        InputError: if it cannot be mapped.
    """

    def __init__(self, file: str, offset: int = 0) -> None:
        with ExitStack() as stack:
            try:
                handle = os.open(file, os.O_RDWR | getattr(os, "O_SYNC", 0))
                stack.callback(os.close, handle)
                self._memory = mmap.mmap(handle, MAP_BYTES, offset=offset)
            except (OSError, ValueError) as error:
                raise InputError(f"{file}: cannot map its registers ({error})") from error
        self._words = memoryview(self._memory).cast("I")  # one access for each word

    def read(self, address: int) -> int:
        """Return a word."""
        return self._words[address]

    def write(self, address: int, word: int) -> None:
        """Write a word."""
        self._words[address] = word

    def close(self) -> None:
        """Let go of the memory."""
        self._words.release()
        self._memory.close()


class AxiDevice(RegisterHost):
    """A board on this processor's bus. Registers are those of ``Device``.

    Args:
        words: The registers' memory.
        name: Name of the board in errors.
        timeout: Seconds to wait for a commit.

    Raises:
        LinkError: if something else is there, or its registers are not those of this program.
    """

    def __init__(self, words: Words, name: str = "AXI", timeout: float = TIMEOUT_S) -> None:
        super().__init__(name, timeout)
        self._bus = words
        self._close: Callable[[], None] = lambda: None
        self.build = self._identify()

    @classmethod
    def mapped(cls, file: str, offset: int = 0, timeout: float = TIMEOUT_S) -> Self:
        """Return a board in a file that can be mapped, as ``MappedWords`` takes it."""
        words = MappedWords(file, offset)
        try:
            device = cls(words, file, timeout)
        except BaseException:
            words.close()
            raise
        device._close = words.close
        return device

    def close(self) -> None:
        """Let go of the registers; mirror and laser keep their state."""
        self._close()

    def read_words(self, address: int, count: int) -> list[int]:
        """Return words at consecutive addresses, one access each."""
        words = []
        for place in range(address, address + count):
            try:
                words.append(self._bus.read(place))
            except BusError as error:
                raise self._refused(error, place) from error
        return words

    def write_words(self, block: Block, *, repeatable: bool = True) -> list[int]:
        """Write words one after another, and return those that were read back.

        Nothing is written where the map or a lock tells beforehand that a word would be refused.
        """
        del repeatable  # no answer is lost here
        self._check(block.address, block.words)
        for place, word in enumerate(block.words, block.address):
            try:
                self._bus.write(place, word)
            except BusError as error:
                raise self._refused(error, place, word) from error
        return self.read_words(block.address, len(block.words))

    def _check(self, address: int, words: Sequence[int]) -> None:
        """Raise the error that a write would bring, as far as it is known beforehand."""
        locked: dict[str, bool] = {}
        for place, word in enumerate(words, address):
            found = values.rule_at(place)
            if found is None:
                raise DeviceError(self.port, Status.NO_ADDRESS, values.name_at(place))
            (access, lock), name = found, values.name_at(place)
            if access not in WRITABLE:
                raise DeviceError(self.port, Status.READ_ONLY, name, word)
            if lock is not None and lock not in locked:
                locked[lock] = bool(self._bus.read(values.find(lock).address))
            if lock is not None and locked[lock]:
                raise DeviceError(self.port, Status.LOCKED, name, values.integer_at(place, word))

    def _refused(self, error: BusError, place: int, word: int | None = None) -> LinkError:
        name = values.name_at(place)
        value = None if word is None else values.integer_at(place, word)
        if error.status is None:
            what = name if value is None else f"{name} = {value}"
            return LinkError(f"{self.port}: {what}: the bus answers with an error")
        return DeviceError(self.port, error.status, name, value)
