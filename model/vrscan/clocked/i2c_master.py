"""Register writes, reads and streams over I2C, the twin of ``rtl/actuators/i2c_master.sv``."""

from collections.abc import Generator
from dataclasses import dataclass
from enum import IntEnum

SEEN_LATENCY = 5  # clocks from a pin to the level that takes effect
BIT_EXTRA = SEEN_LATENCY + 1  # clocks of a bit besides its four quarters if SCL rises at once
MIN_QUARTER = 4
RECOVERY_CLOCKS = 9


class Status(IntEnum):
    """Outcome of a command."""

    OK = 0
    NACK_ADDRESS = 1
    NACK_DATA = 2
    STRETCH_TIMEOUT = 3
    BUS_STUCK = 4
    ARBITRATION = 5


def command_clocks(*, read: bool, count: int, quarter: int) -> int:
    """Return the clocks from a command to its reply on a free bus without stretching.

    Args:
        read: Whether the command is a read; otherwise it is a write.
        count: Number of data bytes, 1 to 4.
        quarter: Clocks of a quarter of a bit, at least 4.
    """
    if not read:
        return stream_clocks(count=count + 1, quarter=quarter)
    on_bus = count + 3
    return (36 * on_bus + 17) * quarter + BIT_EXTRA * (9 * on_bus + 2)


def stream_clocks(*, count: int, quarter: int) -> int:
    """Return the clocks from a stream of bytes to its reply, as ``command_clocks``."""
    on_bus = count + 1
    return (36 * on_bus + 11) * quarter + BIT_EXTRA * (9 * on_bus + 1)


def effect_clocks(*, read: bool, count: int, quarter: int) -> int:
    """Return the clocks from a command to its effect in a device, on a free bus.

    That is the fall of SCL behind a write's last bit, or the repeated start of a read, at which a
    device freezes its position.
    """
    if read:
        return 81 * quarter + 19 * BIT_EXTRA + 1
    return stream_effect_clocks(count=count + 1, quarter=quarter)


def stream_effect_clocks(*, count: int, quarter: int) -> int:
    """Return the clocks from a written stream to the fall of SCL behind its last bit."""
    on_bus = count + 1
    return (36 * on_bus + 1) * quarter + (9 * on_bus - 1) * BIT_EXTRA + 1


def most_clocks(*, quarter: int, timeout: int, count: int = 6) -> int:
    """Return an upper bound of the clocks from any command to its reply and released lines.

    Args:
        quarter: Clocks of a quarter of a bit.
        timeout: Clocks for which a line is waited for.
        count: Bytes of a stream, at least 6 to include the other commands.
    """
    return (36 * count + 106) * quarter + (9 * count + 23) * (timeout + 3)


@dataclass(frozen=True)
class _Command:
    read: bool
    address: int
    register: int
    count: int
    data: int
    stream: bool


class _EndedError(Exception):
    """The end of the command at this clock, with both lines released."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.name)
        self.status = status


class _Line:
    """The filtered level of a pin: two flip-flops, and a level that three equal samples change."""

    def __init__(self) -> None:
        self.level = False
        self.before = False
        self._synchronised = [False, False]
        self._recent = [False, False]

    def step(self, pin: bool) -> None:
        """Take a clock's sample."""
        self.before = self.level
        sample = self._synchronised[1]
        if self._recent == [sample, sample]:
            self.level = sample
        self._recent = [sample, self._recent[0]]
        self._synchronised = [pin, self._synchronised[0]]


class I2cMaster:
    """Clock-accurate master. A new one is in the state after a reset.

    Args:
        count_width: Bits of the counter, ``CountWidth``.

    Attributes:
        ready: Whether a command is taken in this clock.
        valid: Whether a command has ended.
        status: Outcome of the command; defined with ``valid``.
        data: Word that was read from registers, 0 if none was; defined with ``valid``.
        byte_valid: Whether a byte of a stream was taken or read.
        byte: Byte that was read; defined with ``byte_valid``.
        scl_low, sda_low: Whether the line is pulled low.
        recovery_count: Number of recoveries that have begun, saturating.
    """

    def __init__(self, count_width: int = 16) -> None:
        self.ready = True
        self.valid = False
        self.status = Status.OK
        self.data = 0
        self.byte_valid = False
        self.byte = 0
        self.scl_low = False
        self.sda_low = False
        self.recovery_count = 0
        self._count_max = (1 << count_width) - 1
        self._scl = _Line()
        self._sda = _Line()
        self._quarter = MIN_QUARTER
        self._timeout = 0
        self._given = 0
        self._last = False
        self._work: Generator[None, None, None] | None = None

    def step(
        self,
        *,
        valid: bool,
        read: bool,
        address: int,
        register: int,
        bytes: int,
        data: int,
        scl: bool,
        sda: bool,
        quarter: int,
        timeout: int,
        stream: bool = False,
        byte: int = 0,
        last: bool = False,
    ) -> None:
        """Advance by one clock with these inputs and levels of the pins."""
        self.valid = self.byte_valid = False
        self._given, self._last = byte, last
        if self._work is not None:
            next(self._work, None)
            if self.valid:
                self._work = None
                self.ready = True
        elif valid:
            self.ready = False
            self._quarter = max(quarter, MIN_QUARTER)
            self._timeout = timeout
            self._work = self._run(_Command(read, address, register, bytes + 1, data, stream))
        self._scl.step(scl)
        self._sda.step(sda)

    # A generator is resumed once per clock: its work until it yields is done at one clock edge.

    def _run(self, command: _Command) -> Generator[None, None, None]:
        """Execute a command from the clock after it was taken to its reply."""
        data = 0
        try:
            yield from self._bus_is_free()
            self.sda_low = True
            yield from self._started()
            status, data = yield from self._bytes(command)
            yield from self._stop()
        except _EndedError as ended:
            self.scl_low = self.sda_low = False
            status = ended.status
        self.valid = True
        self.status = status
        self.data = data if command.read and status is Status.OK else 0

    def _bus_is_free(self) -> Generator[None, None, None]:
        """Wait for the bus, and recover it if it does not become free."""
        if (yield from self._wait_for_bus(self._timeout)):
            return
        self.recovery_count = min(self.recovery_count + 1, self._count_max)
        try:
            yield from self._recover()
        except _EndedError:
            raise _EndedError(Status.BUS_STUCK) from None
        yield
        if not (yield from self._wait_for_bus(0)):
            raise _EndedError(Status.BUS_STUCK)

    def _wait_for_bus(self, patience: int) -> Generator[None, None, bool]:
        """Return whether the bus is free; if it is not, only SDA is low."""
        calm = 0
        moved = False
        while True:
            moved |= self._scl.before and not self._scl.level
            if self._scl.level and self._sda.level:
                calm += 1
                if calm == 3 * self._quarter:
                    return True
            else:
                calm = 0
                if patience <= 0:
                    if moved:
                        raise _EndedError(Status.ARBITRATION)
                    if not self._scl.level:
                        raise _EndedError(Status.BUS_STUCK)
                    return False
            patience -= 1
            yield

    def _recover(self) -> Generator[None, None, None]:
        """Pulse SCL until SDA is high after a stop."""
        clocks = 0
        self.scl_low = True
        while clocks < RECOVERY_CLOCKS:
            clocks += 1
            if not (yield from self._bit(True, ours=False)):
                continue
            clocks += 1
            yield from self._stop()
            if self._sda.level:
                return
            if clocks < RECOVERY_CLOCKS:
                self.scl_low = True
        raise _EndedError(Status.BUS_STUCK)

    def _bytes(self, command: _Command) -> Generator[None, None, tuple[Status, int]]:
        """Transfer all bytes; SCL is low before and after."""
        if command.stream:
            return (yield from self._stream(command))
        if (yield from self._send(command.address << 1)):
            return Status.NACK_ADDRESS, 0
        if (yield from self._send(command.register)):
            return Status.NACK_DATA, 0
        if not command.read:
            for k in reversed(range(command.count)):
                if (yield from self._send(command.data >> 8 * k & 0xFF)):
                    return Status.NACK_DATA, 0
            return Status.OK, 0
        yield from self._start_again()
        if (yield from self._send(command.address << 1 | 1)):
            return Status.NACK_ADDRESS, 0
        data = 0
        for k in reversed(range(command.count)):
            data = data << 8 | (yield from self._receive())
            yield from self._bit(k == 0, ours=True)
        return Status.OK, data

    def _stream(self, command: _Command) -> Generator[None, None, tuple[Status, int]]:
        """Transfer bytes from or to the user up to the last one."""
        if (yield from self._send(command.address << 1 | command.read)):
            return Status.NACK_ADDRESS, 0
        while True:
            if command.read:
                self.byte = yield from self._receive()
            self.byte_valid = True
            if command.read:
                yield from self._bit(None, ours=True)
            elif (yield from self._send(self._given)):
                return Status.NACK_DATA, 0
            if self._last:
                return Status.OK, 0

    def _receive(self) -> Generator[None, None, int]:
        """Return a byte of the device."""
        byte = 0
        for _ in range(8):
            byte = byte << 1 | (yield from self._bit(True, ours=False))
        return byte

    def _send(self, byte: int) -> Generator[None, None, bool]:
        """Send a byte and return the bit after it: high is no acknowledgement."""
        for k in reversed(range(8)):
            yield from self._bit(byte >> k & 1 == 1, ours=True)
        return (yield from self._bit(True, ours=False))

    def _bit(self, value: bool | None, *, ours: bool) -> Generator[None, None, bool]:
        """Transfer a bit, from SCL's fall to the next one, and return the level of SDA.

        A value of None is that of ``last``.
        """
        yield from self._low(None if value is None else not value)
        yield from self._quarter_of_bit()
        value = self._last if value is None else value
        seen = self._sda.before
        if ours and value and not seen:
            raise _EndedError(Status.ARBITRATION)
        yield from self._quarter_of_bit()
        self.scl_low = True
        return seen

    def _quarter_of_bit(self) -> Generator[None, None, None]:
        """Wait for a quarter, or until SCL falls."""
        for _ in range(self._quarter):
            yield
            if not self._scl.level:
                return

    def _start_again(self) -> Generator[None, None, None]:
        yield from self._low(False)
        yield from self._high()
        if not self._sda.level:
            raise _EndedError(Status.ARBITRATION)
        self.sda_low = True
        yield from self._started()

    def _started(self) -> Generator[None, None, None]:
        """Continue a start from SDA's fall to SCL's."""
        for _ in range(2 * self._quarter):
            yield
            if not self._scl.level:
                break
        self.scl_low = True

    def _stop(self) -> Generator[None, None, None]:
        yield from self._low(True)
        yield from self._high()
        self.sda_low = False
        yield from self._pause(2 * self._quarter)

    def _pause(self, clocks: int) -> Generator[None, None, None]:
        for _ in range(clocks):
            yield

    def _low(self, sda_low: bool | None) -> Generator[None, None, None]:
        """Wait for the low time, with SDA's change in its middle, and until SCL is seen high."""
        yield from self._pause(self._quarter)
        self.sda_low = not self._last if sda_low is None else sda_low
        yield from self._pause(self._quarter)
        self.scl_low = False
        for _ in range(self._timeout + 1):
            yield
            if self._scl.level:
                return
        raise _EndedError(Status.STRETCH_TIMEOUT)

    def _high(self) -> Generator[None, None, None]:
        """Wait for the high time before a start or a stop, in which nobody may touch SCL."""
        for _ in range(2 * self._quarter):
            yield
            if not self._scl.level:
                raise _EndedError(Status.ARBITRATION)
