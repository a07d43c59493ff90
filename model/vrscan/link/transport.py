"""A serial port with a board at its other end: commands with their replies, and packets of streams.

One thread reads. It gives a reply to the command that waits for it, by its sequence number, and a
packet of a stream to the function that is registered for its kind. Everything that nobody waits for
is counted.

What a port raises depends on its kind: ``termios.error`` is no ``OSError``, a closed port makes a
``TypeError``, and some URLs raise errors of their own. Whatever it is becomes a ``LinkError`` here.
"""

import contextlib
import errno
import os
import re
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from vrscan.data import link_pkg
from vrscan.data.errors import InputError
from vrscan.data.extras import named
from vrscan.link import protocol

if TYPE_CHECKING:
    import serial

POLL_S = 0.1  # period at which the reading thread checks whether to end
ATTEMPTS = 4  # attempts of a repeatable command without an answer; more for bad frames
BREAK_RATIO = 12  # a byte of zeros is then longer than a byte with its stop bit
BREAK_S = 0.05  # time until a port has taken a byte
GONE = {errno.EIO, errno.ENXIO, errno.ENODEV, errno.EBADF, errno.EPIPE, errno.ECONNRESET}

Sink = Callable[[bytes], None]


class LinkError(InputError):
    """Error of the link that prevents what was asked; the text is one line."""


class NoAnswerError(LinkError):
    """No reply came in time."""


class UnpluggedError(LinkError):
    """The port is gone."""


@dataclass
class Traffic:
    """The traffic over the port since it was opened.

    Attributes:
        bytes_in, bytes_out: Numbers of all bytes, including those between frames.
        frames: Number of good frames.
        bad: Numbers of bad frames, by their fault.
        refused: Number of frames that the board found bad.
        retries: Number of commands that were sent again.
        late: Number of replies that nobody waited for any more.
        unasked: Number of packets of streams that nobody waited for.
        unknown: Number of good frames that are not packets of this protocol.
        last_out_s: Time of the last command, of ``time.monotonic``.
    """

    bytes_in: int = 0
    bytes_out: int = 0
    frames: int = 0
    bad: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    retries: int = 0
    late: int = 0
    unasked: int = 0
    unknown: int = 0
    last_out_s: float = 0.0

    @property
    def bad_frames(self) -> int:
        """Return the number of bad frames of all faults."""
        return sum(self.bad.values())


class Transport:
    """An open port.

    Args:
        port: Name of the port, or a URL of pyserial.
        baud: Rate of the port.
        timeout: Seconds after which a command without a reply is given up.

    Attributes:
        port, timeout: The arguments of these names.
        traffic: The traffic over the port.
        sinks: Functions that take the packets with a given first byte; called in the reading
            thread.

    Raises:
        LinkError: if there is no such port, or another program has it.
    """

    def __init__(self, port: str, baud: int, timeout: float) -> None:
        self.port = port
        self.timeout = timeout
        self.traffic = Traffic()
        self.sinks: dict[int, Sink] = {}
        self._frames = protocol.FrameReader()
        self.traffic.bad = self._frames.bad
        self._turn = threading.RLock()  # one command at a time
        self._arrived = threading.Condition()
        self._sequence = 0
        self._awaited: tuple[int, int] | None = None  # first two bytes of the reply
        self._reply: bytes | None = None
        self._on_reply: Callable[[], None] | None = None
        self._spoiled = False  # whether a frame was bad since the command was sent, on either side
        self._failure: UnpluggedError | None = None
        self._ending = False
        self._serial = _opened(port, baud, timeout)
        self._reader = threading.Thread(target=self._read, name=f"reader {port}", daemon=True)
        self._reader.start()

    def close(self) -> None:
        """Close the port; the reading thread ends."""
        self._ending = True
        with contextlib.suppress(Exception):
            self._serial.cancel_read()
        if threading.current_thread() is not self._reader:
            self._reader.join()
        with contextlib.suppress(Exception):  # an unplugged port may raise an error
            self._serial.close()

    @property
    def baud(self) -> int:
        """Return the port's rate; writing it takes effect when all bytes have been sent."""
        return int(self._serial.baudrate)

    @baud.setter
    def baud(self, rate: int) -> None:
        try:
            self._serial.flush()
            self._serial.baudrate = rate
        except Exception as error:
            if _is_gone(error):
                raise self._unplugged(error) from error
            raise LinkError(f"{self.port}: no rate of {rate} baud ({_reason(error)})") from error

    def send_break(self) -> None:
        """Hold the line low for longer than a byte: the board returns to its default rate.

        A 0x00 is sent at a rate so low that the board sees no stop bit. Every port can do that,
        whereas a real break does not pass a pty and some adapters.
        """
        rate = self.baud
        self.baud = rate // BREAK_RATIO
        self.send(b"\0")
        time.sleep(max(BREAK_S, 10.0 * BREAK_RATIO / rate))
        self.baud = rate

    def check(self) -> None:
        """Raise the error that ended the reading thread, if one did."""
        if self._failure is not None:
            raise self._failure

    def send(self, data: bytes) -> None:
        """Send bytes as they are.

        Raises:
            UnpluggedError: if the port is gone.
            NoAnswerError: if the port takes no bytes.
        """
        from serial import SerialTimeoutException

        self.check()
        try:
            self._serial.write(data)
        except SerialTimeoutException as error:
            raise NoAnswerError(f"{self.port}: takes no data for {self.timeout:g} s") from error
        except Exception as error:
            raise self._unplugged(error) from error
        self.traffic.bytes_out += len(data)
        self.traffic.last_out_s = time.monotonic()

    def command(
        self,
        operation: int,
        data: bytes = b"",
        *,
        repeatable: bool = True,
        wait: float | None = None,
        on_reply: Callable[[], None] | None = None,
    ) -> bytes:
        """Send a command and return the payload of its reply, whatever its status.

        Args:
            operation: First byte of the command.
            data: Data after the sequence number.
            repeatable: Whether it may be executed twice: it is then sent again when no reply comes.
            wait: Seconds for all attempts together; ``timeout`` if None.
            on_reply: Function that the reading thread calls on a reply of ``STATUS_OK``, before
                anything that comes after it is processed.

        Raises:
            NoAnswerError: if no reply came. A command that may not be repeated may have been
                executed.
            UnpluggedError: if the port is gone.
        """
        wait = self.timeout if wait is None else wait
        end = time.monotonic() + wait
        attempts = 0
        with self._turn:
            self._on_reply = on_reply
            while attempts == 0 or (repeatable and time.monotonic() < end):
                self.traffic.retries += attempts > 0
                left = end - time.monotonic()
                limit = min(left, wait / ATTEMPTS) if repeatable else left
                reply = self._once(operation, data, limit, repeatable, first=attempts == 0)
                if reply is not None:
                    return reply
                attempts += 1
        tried = f" and {attempts} attempts" if repeatable else ""
        unsure = "" if repeatable else "; whether the board did it is not known"
        name = protocol.COMMANDS.get(operation, f"command {operation:#04x}")
        raise NoAnswerError(f"{self.port}: no answer to {name} after {wait:g} s{tried}{unsure}")

    def _once(
        self, operation: int, data: bytes, limit: float, hasty: bool, *, first: bool
    ) -> bytes | None:
        """Send a command and return its reply or None; ``hasty`` gives up once a frame was bad."""
        self._sequence = (self._sequence + 1) & 0xFF
        frame = protocol.encode_frame(protocol.command(operation, self._sequence, data))
        with self._arrived:
            self._awaited = operation | link_pkg.REPLY_BIT, self._sequence
            self._reply = None
            self._spoiled = False
        # The 0x00 that ended the frame before may not have come.
        self.send(frame if first else b"\0" + frame)
        with self._arrived:
            self._arrived.wait_for(
                lambda: (
                    self._reply is not None
                    or self._failure is not None
                    or (hasty and self._spoiled)
                ),
                limit,
            )
            self._awaited = None
            reply, self._reply = self._reply, None
        if reply is None:
            self.check()
        return reply

    def drain(self, quiet: float, longest: float, come: Callable[[], int] | None = None) -> None:
        """Wait until nothing has come for ``quiet`` s, but no longer than ``longest`` s.

        Args:
            quiet: Silence to wait for, s.
            longest: Longest time to wait, s.
            come: Function that returns the amount that has come; that of all bytes if None.
        """
        come = come or (lambda: self.traffic.bytes_in)
        end = time.monotonic() + longest
        while time.monotonic() < end:
            before = come()
            time.sleep(quiet)
            self.check()
            if come() == before:
                return

    def _read(self) -> None:
        """Read until the port is closed or gone."""
        bad = 0
        try:
            while not self._ending:
                data = self._serial.read(self._serial.in_waiting or 1)
                self.traffic.bytes_in += len(data)
                for payload in self._frames.feed(data):
                    self._sort(payload)
                self.traffic.frames = self._frames.good
                if self.traffic.bad_frames != bad:
                    bad = self.traffic.bad_frames
                    with self._arrived:
                        self._spoiled = True
                        self._arrived.notify_all()
        except Exception as error:
            if not self._ending:
                self._unplugged(error)

    def _unplugged(self, error: Exception) -> UnpluggedError:
        """Keep the error that ended the connection, and wake all waiting threads."""
        with self._arrived:
            if self._failure is None:
                self._failure = UnpluggedError(f"{self.port}: the port is gone ({_reason(error)})")
            self._arrived.notify_all()
        for sink in list(self.sinks.values()):
            sink(b"")
        return self._failure

    def _sort(self, payload: bytes) -> None:
        """Give the payload of a good frame to its receiver."""
        if not payload[0] & link_pkg.REPLY_BIT:
            sink = self.sinks.get(payload[0])
            if sink is None:
                self.traffic.unasked += 1
                return
            try:
                sink(payload)
            except ValueError:
                self.traffic.unknown += 1
            return
        with self._arrived:
            if payload[0] == protocol.BAD_FRAME:
                self.traffic.refused += 1
                self._spoiled = True
            elif tuple(payload[:2]) == self._awaited and len(payload) > 2:
                self._reply = payload
                self._awaited = None
                if self._on_reply is not None and payload[2] == link_pkg.STATUS_OK:
                    self._on_reply()
            else:
                self.traffic.late += 1
            self._arrived.notify_all()


def _opened(port: str, baud: int, timeout: float) -> "serial.Serial":
    """Return an open port that no other program has."""
    with named():
        import serial
    try:
        return serial.serial_for_url(
            port, baud, timeout=POLL_S, write_timeout=timeout, exclusive=True
        )
    except Exception as error:
        number = _number(error)
        if number in (errno.EAGAIN, errno.EBUSY):
            raise LinkError(f"{port}: another program has this port open") from error
        at = "" if isinstance(error, serial.SerialException) else f" at {baud} baud"
        raise LinkError(f"{port}: cannot open{at} ({_reason(error)})") from error


def _number(error: BaseException) -> int | None:
    """Return the system's number of an error; pyserial has some of them in its texts alone."""
    number = getattr(error, "errno", None)
    if number is None and error.args and isinstance(error.args[0], int):
        number = error.args[0]  # of termios.error, which is no OSError
    if isinstance(number, int):
        return number
    found = re.search(r"\[Errno (\d+)\]|\((\d+), '", str(error))
    return None if found is None else int(found[1] or found[2])


def _is_gone(error: BaseException) -> bool:
    """Return whether a change of rate failed because the port is gone, not because of the rate."""
    number = _number(error)
    if number is None:  # a rate is refused by a ValueError, a closed port shows in other errors
        return not isinstance(error, (ValueError, OverflowError))
    return number in GONE


def _reason(error: BaseException) -> str:
    """Return the system's text of an error, without the text that pyserial adds."""
    number = _number(error)
    return (str(error) or type(error).__name__) if number is None else os.strerror(number)
