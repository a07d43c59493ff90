"""Execution of commands and their replies, the twin of ``rtl/link/command_executor.sv``.

``execute`` defines a command without clocks: the accesses that it makes, one after another, and its
reply. ``CommandExecutor`` is the module, clock by clock.
"""

from collections.abc import Generator
from dataclasses import dataclass
from typing import NamedTuple

from vrscan.clocked.command_queue import Frame
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.data import link_pkg

# Clocks; the parts of ``latency``.
_VERDICT = 11  # clocks from a command's begin
_ACT = 1
_ACCESS = 2  # clocks of an access without the bus's latency
_WORD = 6  # clocks to take a word of a WRITE out of the command
_STORE = 4  # clocks to store a word in the reply
_COMPOSE = 1

Effect = tuple[str, dict[str, int]]  # a strobe, and the outputs that go with it


class Access(NamedTuple):
    """An access to a register.

    Attributes:
        access: Kind of access: ``link_pkg.ACCESS_READ``, ``ACCESS_CHECK`` or ``ACCESS_WRITE``.
        address: Address of the word.
        data: Word to be written; a READ does not use it.
    """

    access: int
    address: int
    data: int


class Answer(NamedTuple):
    """The answer of a register to an access.

    Attributes:
        status: One of ``link_pkg.STATUS_*``.
        data: The word as it is read.
    """

    status: int
    data: int


@dataclass(frozen=True)
class Outcome:
    """The outcome of a command.

    Attributes:
        status: One of ``link_pkg.STATUS_*``.
        reply: Payload of the reply.
        effect: The strobe that the command gives, with the values that go with it; None without
            one.
    """

    status: int
    reply: bytes
    effect: Effect | None = None


Execution = Generator[Access, Answer, Outcome]


def judge(payload: bytes, capture_busy: bool = False) -> int:
    """Return the status of a command before any register is accessed.

    Args:
        payload: Payload of a good frame, not empty.
        capture_busy: Whether a capture is running.
    """
    op, length = payload[0], len(payload)
    words, rest = divmod(length - 4, 4)
    fits = {
        link_pkg.COMMAND_PING: 2 <= length < link_pkg.MAX_PAYLOAD,
        link_pkg.COMMAND_READ: length == 5 and 1 <= payload[4] <= link_pkg.MAX_WORDS,
        link_pkg.COMMAND_WRITE: rest == 0 and 1 <= words <= link_pkg.MAX_WORDS,
        link_pkg.COMMAND_STREAM_START: length == 4,
        link_pkg.COMMAND_STREAM_STOP: length == 2,
        link_pkg.COMMAND_CAPTURE: length == 7,
    }
    if op not in fits:
        return link_pkg.STATUS_UNKNOWN_COMMAND
    if not fits[op]:
        return link_pkg.STATUS_BAD_LENGTH
    if op == link_pkg.COMMAND_STREAM_START and (
        payload[2] > link_pkg.FORMAT_SPACE or payload[3] == 0
    ):
        return link_pkg.STATUS_BAD_VALUE
    if op == link_pkg.COMMAND_CAPTURE:
        mode, argument = payload[2], int.from_bytes(payload[3:], "little")
        if mode > link_pkg.CAPTURE_EVERY or (mode == link_pkg.CAPTURE_EVERY and argument == 0):
            return link_pkg.STATUS_BAD_VALUE
        if mode != link_pkg.CAPTURE_STOP and capture_busy:
            return link_pkg.STATUS_BUSY
    return link_pkg.STATUS_OK


def bad_frame(status: FrameStatus) -> bytes:
    """Return the reply to a bad frame."""
    none = link_pkg.REPLY_BIT | link_pkg.COMMAND_NONE
    return bytes([none, 0, link_pkg.STATUS_BAD_FRAME, status])


def execute(payload: bytes, capture_busy: bool = False) -> Execution:
    """Execute a command: yield its accesses, take their answers, and return its outcome.

    Args:
        payload: Payload of a good frame, not empty.
        capture_busy: Whether a capture is running.
    """
    op, sequence = payload[0], payload[1] if len(payload) > 1 else 0
    status = judge(payload, capture_busy)
    head = bytes([link_pkg.REPLY_BIT | op, sequence])
    if status != link_pkg.STATUS_OK:
        return Outcome(status, head + bytes([status]))
    good = head + bytes([status])
    if op == link_pkg.COMMAND_PING:
        return Outcome(status, good + payload[2:])
    if op == link_pkg.COMMAND_STREAM_START:
        strobe_values = {"stream_format": payload[2], "stream_step": payload[3]}
        return Outcome(status, good, ("stream_start", strobe_values))
    if op == link_pkg.COMMAND_STREAM_STOP:
        return Outcome(status, good, ("stream_stop", {}))
    if op == link_pkg.COMMAND_CAPTURE:
        argument = int.from_bytes(payload[3:], "little")
        strobe_values = {"capture_mode": payload[2], "capture_argument": argument}
        return Outcome(status, good, ("capture_start", strobe_values))

    base = int.from_bytes(payload[2:4], "little")
    if op == link_pkg.COMMAND_READ:
        passes = [link_pkg.ACCESS_READ]
        words = [0] * payload[4]
    else:
        passes = [link_pkg.ACCESS_CHECK, link_pkg.ACCESS_WRITE]
        words = [int.from_bytes(payload[k : k + 4], "little") for k in range(4, len(payload), 4)]
    read = b""
    for access in passes:
        read = b""
        for k, word in enumerate(words):
            address = (base + k) & 0xFFFF
            status, data = yield Access(access, address, word)
            if status != link_pkg.STATUS_OK:
                where = address.to_bytes(2, "little")
                return Outcome(status, head + bytes([status, 0]) + where)
            read += data.to_bytes(4, "little")
    return Outcome(status, good + bytes([len(words)]) + read)


def latency(payload: bytes, outcome: Outcome, accesses: int = 0, bus_latency: int = 0) -> int:
    """Return the clocks from ``waits_i`` of a command, with none before it, to ``valid_o``.

    Args:
        payload: The command; any payload for a bad frame.
        outcome: The outcome of the command.
        accesses: Number of accesses that it makes.
        bus_latency: Clocks from ``bus_valid_o`` to ``bus_done_i``.
    """
    clocks = 2 + _VERDICT + _ACT + _COMPOSE + _header_bytes(outcome)
    done = outcome.status == link_pkg.STATUS_OK
    if done and outcome.reply[0] == link_pkg.REPLY_BIT | link_pkg.COMMAND_PING:
        return clocks + _copy(payload)
    stored = accesses if done else max(accesses - 1, 0)
    if accesses and payload[0] == link_pkg.COMMAND_WRITE:
        clocks += accesses * _WORD
        stored = max(stored - (len(payload) // 4 - 1), 0)
    return clocks + accesses * (_ACCESS + bus_latency) + stored * _STORE


def _copy(payload: bytes) -> int:
    """Return the clocks for copying a PING's data into the reply."""
    return len(payload) if len(payload) > 2 else 1


def _header_bytes(outcome: Outcome) -> int:
    """Return the number of bytes of a reply that are not data."""
    length = len(outcome.reply)
    done = outcome.status == link_pkg.STATUS_OK
    if not done or length < 4:
        return length
    return 3 if outcome.reply[0] == link_pkg.REPLY_BIT | link_pkg.COMMAND_PING else 4


class _Inputs(NamedTuple):
    """Inputs of this clock."""

    waits: bool = False
    frame: Frame = Frame(FrameStatus.OK, b"")
    halt: bool = False
    ready: bool = False
    bus_done: bool = False
    answer: Answer = Answer(0, 0)
    capture_busy: bool = False


class CommandExecutor:
    """Clock-accurate executor. A new one is in the state after a reset.

    Args:
        count_width: Bits of the counter, ``CountWidth``.

    Attributes:
        release: Whether the frame is needed no more after this clock.
        valid, data, last: A byte of a reply; ``data`` and ``last`` are defined with ``valid``.
        bus: The access that begins in this clock.
        strobes: The strobes ``stream_start``, ``stream_stop`` and ``capture_start`` that are high.
        strobe_values: Values that came with the last starts: ``stream_format``, ``stream_step``,
            ``capture_mode`` and ``capture_argument``, as far as there were such starts.
        alive: Whether a command of a known kind and the right length is executed in this clock.
        busy: Whether a command waits, is executed, or has a reply that is not yet taken.
        commands_bad: Number of commands of no kind or a wrong length.
    """

    def __init__(self, count_width: int = 16) -> None:
        self._count_max = (1 << count_width) - 1
        self.release = False
        self.valid = False
        self.data = 0
        self.last = False
        self.bus: Access | None = None
        self.strobes: set[str] = set()
        self.strobe_values: dict[str, int] = {}
        self.alive = False
        self.busy = False
        self.commands_bad = 0

        self._active = False  # a command is executed, or its reply is sent
        self._in = _Inputs()
        self._life = self._run()

    def takes(self, *, waits: bool, halt: bool) -> bool:
        """Return whether a frame is begun in this clock, with these inputs."""
        return waits and not (self._active or halt)

    def step(
        self,
        *,
        waits: bool,
        frame: Frame,
        halt: bool,
        ready: bool,
        bus_done: bool,
        bus_status: int,
        bus_data: int,
        capture_busy: bool,
    ) -> None:
        """Advance by one clock; ``frame`` is the one that waits, and its payload whole."""
        answered = Answer(bus_status, bus_data)
        self._in = _Inputs(waits, frame, halt, ready, bus_done, answered, capture_busy)
        self.bus = None
        self.strobes = set()
        self.alive = False
        self.busy = waits or self._active
        next(self._life)
        if halt:
            self.strobes = (self.strobes - {"stream_start"}) | {"stream_stop", "capture_start"}
            self.strobe_values["capture_mode"] = link_pkg.CAPTURE_STOP

    def _run(self) -> Generator[None]:
        """Execute one command after another; a ``yield`` ends a clock."""
        while True:
            if not self.takes(waits=self._in.waits, halt=self._in.halt):
                yield
                continue
            self._active = True
            status, payload = self._in.frame
            yield from _clocks(_VERDICT)
            if status == FrameStatus.OK:
                outcome = yield from self._execute(payload)
            else:
                outcome = Outcome(link_pkg.STATUS_BAD_FRAME, bad_frame(status))
                yield from _clocks(_ACT)
            yield from _clocks(_COMPOSE + _header_bytes(outcome) - 1)
            self.release = True
            yield
            self.release = False
            yield
            yield from self._send(outcome.reply)
            self._active = False
            yield

    def _execute(self, payload: bytes) -> Generator[None, None, Outcome]:
        """Execute a command from its verdict to its last access."""
        status = judge(payload, self._in.capture_busy)
        run = execute(payload, self._in.capture_busy)
        yield from _clocks(_ACT)
        if status in (link_pkg.STATUS_UNKNOWN_COMMAND, link_pkg.STATUS_BAD_LENGTH):
            self.commands_bad = min(self.commands_bad + 1, self._count_max)
        else:
            self.alive = True
        try:
            access = next(run)
            while True:
                if payload[0] == link_pkg.COMMAND_WRITE:
                    yield from _clocks(_WORD)
                yield
                self.bus = access
                yield
                while not self._in.bus_done:
                    yield
                last, answer = access, self._in.answer
                access = run.send(answer)
                if last.access != link_pkg.ACCESS_CHECK:
                    yield from _clocks(_STORE)
        except StopIteration as end:
            outcome: Outcome = end.value
        if outcome.effect is not None:
            strobe, strobe_values = outcome.effect
            self.strobes = {strobe}
            self.strobe_values |= strobe_values
        if status == link_pkg.STATUS_OK and payload[0] == link_pkg.COMMAND_PING:
            yield from _clocks(_copy(payload))
        elif outcome.status == link_pkg.STATUS_OK and len(outcome.reply) > 3:
            yield from _clocks(_STORE)  # stores the last word
        return outcome

    def _send(self, reply: bytes) -> Generator[None]:
        """Send a reply; end in the clock in which the last byte is taken."""
        for k, byte in enumerate(reply):
            self.valid, self.data, self.last = True, byte, k == len(reply) - 1
            yield
            while not self._in.ready:
                yield
        self.valid = False


def _clocks(count: int) -> Generator[None]:
    """Wait for this number of clocks."""
    for _ in range(count):
        yield
