"""A host's access to a board's registers by name, whatever carries their words.

``Device`` reaches them over the serial line, ``AxiDevice`` over AXI4-Lite.
"""

import abc
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

import numpy as np

from vrscan.data import link_pkg, pkg
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.link.protocol import Status
from vrscan.link.transport import LinkError
from vrscan.registers import values
from vrscan.registers.map_table import MapTable, map_registers, map_table, nodes_of
from vrscan.registers.register_map import LOCKS, MAP_HASH, REGISTERS, WINDOWS
from vrscan.registers.values import Block, Value, integer

IDENTITY = REGISTERS["identity"].reset[0]
OFF, SWEEP, SETTLE, RUN, FAULT = range(5)  # values of mirror_state
STATES = ("OFF", "SWEEP", "SETTLE", "RUN", "FAULT")

_MEANING = {
    Status.UNKNOWN_COMMAND: "the board does not know the command",
    Status.BAD_LENGTH: "the command's length is wrong",
    Status.NO_ADDRESS: "there is no such register",
    Status.READ_ONLY: "it cannot be written",
    Status.LOCKED: "it is locked until the board is reset",
    Status.BAD_VALUE: "it does not take this value",
    Status.BUSY: "a capture runs, a commit waits, or the maps are in use",
    Status.BAD_FRAME: "the frame came to grief",
}


class DeviceError(LinkError):
    """Error of a command that the board refused.

    Attributes:
        status: One of ``link_pkg.STATUS_*``.
        register: Name of the register that was accessed, or None.
        value: Value that was to be written, or None.
    """

    def __init__(
        self, port: str, status: int, register: str | None = None, value: Value | None = None
    ) -> None:
        self.status, self.register, self.value = status, register, value
        what = "" if register is None else f"{register}: "
        if value is not None:
            what = f"{register} = {value}: "
        known = Status(status) if status in set(Status) else None
        meaning = f"status {status}" if known is None else f"{known.name}: {_MEANING[known]}"
        super().__init__(f"{port}: {what}{meaning}")


@dataclass(frozen=True)
class Build:
    """A board's identity, registers of that group, and the unit of the lengths that it sends."""

    identity: int
    map_hash: int
    version: int
    board_id: int
    clock_hz: int
    line_length: int
    pixel_width: int
    max_window: int
    lanes: int
    index_oversample: int
    length_unit: int = field(default=1, compare=False)  # mm; each load may bring another one

    @property
    def version_text(self) -> str:
        """Return the version as text: major.minor.patch."""
        return f"{self.version >> 16}.{self.version >> 8 & 255}.{self.version & 255}"


def _map_blocks(words: Sequence[int]) -> list[Block]:
    """Return words of the table of maps, from its first one on, in blocks that fit a command."""
    address, most = WINDOWS["map_table"].address, link_pkg.MAX_WORDS
    return [Block(address + k, list(words[k : k + most])) for k in range(0, len(words), most)]


class RegisterView:
    """The registers as attributes, ``registers.k_noise = 640``, and as items."""

    _device: "RegisterHost"

    def __init__(self, device: "RegisterHost") -> None:
        object.__setattr__(self, "_device", device)

    def __getattr__(self, name: str) -> Value:
        if name not in values.NAMES:
            raise AttributeError(f"no register {name!r}")
        return self._device.read(name)

    def __setattr__(self, name: str, value: Value) -> None:
        if name not in values.NAMES:
            raise AttributeError(f"no register {name!r}")
        self._device.write(name, value)

    def __getitem__(self, name: str) -> Value:
        return self._device.read(name)

    def __setitem__(self, name: str, value: Value) -> None:
        self._device.write(name, value)

    def __iter__(self) -> Iterator[str]:
        return iter(values.NAMES)

    def __dir__(self) -> list[str]:
        return list(values.NAMES)


class RegisterHost(abc.ABC):
    """A board whose registers are read and written by name.

    Args:
        port: Name of the connection, with which every error begins.
        timeout: Seconds to wait for what takes the board time.

    Attributes:
        registers: The registers as attributes.
        build: The board's identity, of ``_identify``.
    """

    build: Build

    def __init__(self, port: str, timeout: float) -> None:
        self.port = port
        self.timeout = timeout
        self.registers = RegisterView(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @abc.abstractmethod
    def close(self) -> None:
        """Let go of the board; the mirror keeps its state."""

    @abc.abstractmethod
    def read_words(self, address: int, count: int) -> list[int]:
        """Return words at consecutive addresses, at most ``link_pkg.MAX_WORDS``.

        Raises:
            DeviceError: naming the register, if the board refuses.
        """

    @abc.abstractmethod
    def write_words(self, block: Block, *, repeatable: bool = True) -> list[int]:
        """Write words and return those that were read back.

        Args:
            block: Address and words.
            repeatable: Whether it may be done twice.

        Raises:
            DeviceError: naming register and value, if the board refuses.
        """

    def _identify(self) -> Build:
        """Return the board's identity, which has to be that of this instrument."""
        first = ("identity", "map_hash", "version")  # the addresses of these never change
        known = self.read_many(first)
        if known["identity"] != IDENTITY:
            raise LinkError(
                f"{self.port}: no scanner: identity is {known['identity']:#010x}, "
                f"want {IDENTITY:#010x}"
            )
        if known["map_hash"] != MAP_HASH:
            raise LinkError(
                f"{self.port}: the board's registers are not this program's: map_hash is "
                f"{known['map_hash']:#010x}, want {MAP_HASH:#010x}"
            )
        names = tuple(Build.__dataclass_fields__)
        found = self.read_many(names)
        return Build(**{name: integer(found[name]) for name in names})

    def read(self, name: str) -> Value:
        """Return a register's integer, or a tuple of them where it has several.

        Args:
            name: Name of a register, or of a field of a table.

        Raises:
            InputError: if there is no such register.
        """
        return self.read_many([name])[name]

    def read_scaled(self, name: str) -> float | tuple[float, ...]:
        """Return a register's value in its unit, ``values.find(name).unit``."""
        return values.to_scaled(name, self.read(name))

    def read_many(
        self, names: Iterable[str], progress: Callable[[int, int], None] | None = None
    ) -> dict[str, Value]:
        """Return several registers by name, with the fewest commands.

        Args:
            names: Names of registers, or of fields of tables.
            progress: Called with the number of commands done and the number of all commands.
        """
        names = tuple(names)
        found: dict[int, int] = {}
        blocks = values.read_blocks(names)
        for k, block in enumerate(blocks):
            words = self.read_words(block.address, len(block.words))
            found.update(zip(range(block.address, block.address + len(words)), words, strict=True))
            if progress is not None:
                progress(k + 1, len(blocks))
        return {
            name: values.from_words(name, [found[a] for a in values.addresses(name)])
            for name in names
        }

    def write(self, name: str, value: Value) -> None:
        """Write a register, or all its values where it has several, and check the values read back.

        What waits for a commit is committed, as with ``write_many``.

        Raises:
            InputError: if there is no such register, or the value does not fit.
            DeviceError: naming register and value, if the board refuses it.
            NoAnswerError: if no reply came. A register whose every write is an event is written
                only once, and it is then not known whether that was done.
        """
        self.write_many([(name, value)])

    def write_many(
        self,
        settings: Iterable[tuple[str, Value]],
        progress: Callable[[int, int], None] | None = None,
        *,
        commit: bool = True,
    ) -> None:
        """Write registers and tables with the fewest commands, and check the values read back.

        Args:
            settings: Names and values. A field of a table comes with the table's other fields.
            progress: Called with the number of commands done and the number of all commands.
            commit: Whether what waits for a commit takes effect at the end, all of it together;
                else it waits for ``commit``.

        Raises:
            InputError: before anything is written, if a name or a value is wrong.
            DeviceError: naming register and value, if the board refuses; the blocks before it are
                written.
        """
        settings = list(settings)
        blocks = values.write_blocks(settings)
        events = {
            values.find(name).address
            for name, _ in settings
            if values.find(name).access == "strobe" and name in REGISTERS
        }
        for k, block in enumerate(blocks):
            reach = range(block.address, block.address + len(block.words))
            back = self.write_words(block, repeatable=events.isdisjoint(reach))
            self._compare(block, back)
            if progress is not None:
                progress(k + 1, len(blocks))
        if commit and any(values.find(name).commit for name, _ in settings):
            self.commit()

    def _compare(self, block: Block, back: Sequence[int]) -> None:
        """Raise an error if words read back differ from those written."""
        for address, (got, want) in enumerate(zip(back, block.words, strict=True), block.address):
            if got != want:
                raise LinkError(
                    f"{self.port}: {values.name_at(address)}: reads {got:#x} after a write of "
                    f"{want:#x}"
                )

    def commit(self) -> int:
        """Let all that was written take effect together, between two lines.

        Returns:
            The bit ``configuration`` of the lines that are measured from now on.

        Raises:
            LinkError: if the board refuses, or does not do it within the timeout.
        """
        register = values.find("commit")
        try:
            self.write_words(Block(register.address, values.to_words("commit", 1)))
        except DeviceError as error:
            if error.status != link_pkg.STATUS_BUSY:  # one is under way, maybe this one, repeated
                raise
        end = time.monotonic() + self.timeout
        while True:
            found = self.read_many(("commit_waiting", "configuration"))
            if not found["commit_waiting"]:
                return integer(found["configuration"])
            if time.monotonic() > end:
                raise LinkError(f"{self.port}: a commit does not take effect")

    def lock(self, group: str) -> None:
        """Lock a group until the board is reset, for example ``"calibration"`` or ``"mirror"``."""
        name = group if group in LOCKS else f"lock_{group}"
        if name not in LOCKS:
            known = ", ".join(lock.removeprefix("lock_") for lock in LOCKS)
            raise InputError(f"no lock {group!r}; there are {known}")
        self.write(name, 1)

    # ---- configuration ----

    def settings(self, config: Config) -> dict[str, Value]:
        """Return what a configuration writes into this board, by register or field of a table.

        Raises:
            InputError: if it is for another line, sensor or sampling, or a value does not fit.
        """
        from vrscan.registers.load import settings

        return settings(config, self.build)

    def load(
        self,
        config: Config,
        *,
        force: bool = False,
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        """Write a whole configuration and check what was read back.

        Args:
            config: Configuration for this board's line and sensor; its clock is not used.
            force: Whether to write even while the mirror moves: the tables of its motion and the
                limits of its drive then change during the motion.
            progress: Called with the number of commands done and the number of all commands.

        Raises:
            InputError: if the configuration is not for this board, or the mirror moves.
            DeviceError: naming register and value, if the board refuses, for example because it is
                locked.
        """
        wanted, maps = self.settings(config), map_table(config)
        self.check_still(force)
        if maps is not None:
            wanted["map_bank"] = self.write_maps(maps, progress)
        self.write_many(wanted.items(), progress)
        self.build = self._identify()

    def load_maps(
        self, config: Config, progress: Callable[[int, int], None] | None = None
    ) -> MapTable:
        """Let the correction maps of a configuration take effect, and nothing else of it.

        Returns:
            The maps.

        Raises:
            InputError: if the configuration has none, or they do not fit.
            LinkError: if the board refuses them or does not hold them; those in use stay.
        """
        maps = map_table(config)
        if maps is None:
            raise InputError(f"{config.source}: map.file: there is none")
        bank = self.write_maps(maps, progress)
        self.write_many([*map_registers(config).items(), ("map_bank", bank)])
        return maps

    def write_maps(self, maps: MapTable, progress: Callable[[int, int], None] | None = None) -> int:
        """Write maps into the bank that is not in use, and check all that is read back of it.

        Args:
            maps: The maps.
            progress: Called with the number of commands done and the number of all commands.

        Returns:
            The bank, by which positions are corrected from a commit with ``map_bank`` on.

        Raises:
            LinkError: if the board refuses, or a node reads back differently.
        """
        bank = 1 - integer(self.read("map_bank"))
        self.write("map_access_bank", bank)
        blocks = _map_blocks(maps.words.tolist())
        for k, block in enumerate(blocks):
            self.write_words(block)
            if progress is not None:
                progress(k + 1, 2 * len(blocks))
        for k, block in enumerate(blocks):  # now that no write can hit another node any more
            self._compare(block, self.read_words(block.address, len(block.words)))
            if progress is not None:
                progress(len(blocks) + k + 1, 2 * len(blocks))
        return bank

    def read_maps(self, progress: Callable[[int, int], None] | None = None) -> MapTable | None:
        """Return the correction maps in use, None where positions are not corrected.

        Where they follow the lens, it is at 0.

        Args:
            progress: Called with the number of commands done and the number of all commands.
        """
        names = ("map_enable", "map_bank", "map_count", "map_begin", "map_shift", "map_lens")
        found = self.read_many((*names, "map_follow", "map_access_bank"))
        held = {name: integer(value) for name, value in found.items()}
        if not held["map_enable"]:
            return None
        words: list[int] = []
        self.write("map_access_bank", held["map_bank"])
        try:
            blocks = _map_blocks([0] * (held["map_count"] * pkg.MAP_NODES))
            for k, block in enumerate(blocks):
                words += self.read_words(block.address, len(block.words))
                if progress is not None:
                    progress(k + 1, len(blocks))
        finally:
            self.write("map_access_bank", held["map_access_bank"])
        nodes, filled = nodes_of(np.array(words))
        lens = 0 if held["map_follow"] else held["map_lens"]
        return MapTable(nodes, filled, held["map_begin"], held["map_shift"], lens)

    def check_still(self, force: bool = False) -> None:
        """Raise an error if the mirror moves, unless ``force`` is set.

        Raises:
            LinkError: with the mirror's state.
        """
        state = integer(self.read("mirror_state"))
        if state in (SWEEP, SETTLE, RUN) and not force:
            raise LinkError(
                f"{self.port}: the mirror is in {STATES[state]}: stop it first "
                "(mirror_enable = 0), or force it"
            )
