"""A board on a serial port: its registers, its points, its raw lines.

    with Device("/dev/ttyUSB1") as device:
        device.load(config)
        device.registers.mirror_enable = 1
        with device.stream() as points:
            for batch in points:
                ...

Every command is repeated when no reply comes, except a write of a register whose every write is an
event: it is then not known whether this write was done, and the error says so. Times to wait are in
seconds of this machine's clock; a simulated board needs many of them for one of its own seconds.
"""

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence

from vrscan.clocked.line_trigger import line_step
from vrscan.clocked.mirror_drive import RATE_FRACTION
from vrscan.clocked.point_packer import KINDS, most_records, record_bytes
from vrscan.clocked.uart_rx import STEP_WIDTH
from vrscan.data import link_pkg, pkg
from vrscan.data.errors import InputError
from vrscan.data.records import Form
from vrscan.link import protocol
from vrscan.link.protocol import Status
from vrscan.link.register_host import FAULT, RUN, STATES, DeviceError, RegisterHost
from vrscan.link.stream import DEPTH, Captured, CaptureStream, PointStream
from vrscan.link.transport import LinkError, NoAnswerError, Traffic, Transport, UnpluggedError
from vrscan.registers import values
from vrscan.registers.values import Block, Value, integer

BAUD = 3_000_000
TIMEOUT_S = 5.0
BITS_A_BYTE = 10  # with start and stop bits
LEAST_CLOCKS_A_BIT = 8
MOST_RATE_ERROR = 0.01  # leaves enough of a bit at a byte's end
SILENCE_S = 1.0  # longest time for which any board's laser stays on without its host
WATCHDOG = "laser_watchdog_clks"
FAULTS = ("none", "sweep", "settle", "index")

SETTLE_S = 0.3  # approximate duration of a start after its sweep
_START = ("sweep_timeout", "settle_timeout", "sweep_word", "work_word", "sweep_rate")
_GUARDED, _TRIPPED = 1, 4  # bits of laser_status
_GUARD_FAULTS = (
    "no heartbeat of the interlocks",
    "a pulse too long",
    "too many pulses",
    "index light too long",
    "a start-up level that is stuck",
)
MOST_STEP = 255  # largest step of a stream
_STREAM_SHARE = 0.9  # share of the serial line's time for points; the rest is for replies

# Called with a text and a share from 0 to 1.
StartProgress = Callable[[str, float], None]


class Device(RegisterHost):
    """A board. It is connected from its creation until ``close``.

    Args:
        port: Port of pyserial: a name, or a URL.
        baud: Rate of the board after a reset.
        timeout: Seconds to wait for a reply; a simulated board may need more.
        keep_alive: Whether to send a sign of life when nothing else is sent, because the board
            turns its laser off without one.

    Attributes:
        registers: The registers as attributes.
        build: The board's identity.
        alive_errors: Number of signs of life that were not answered.

    Raises:
        LinkError: if the port cannot be opened, nothing or something else answers, or its registers
            are not those that this program knows.

    Example:
        ``port`` is a name such as ``/dev/ttyUSB0``.

        >>> import vrscan
        >>> with vrscan.Device(port) as board:
        ...     board.registers.scratch = 7
        ...     print(board.registers.scratch, board.registers.line_enable)
        7 0
    """

    def __init__(
        self,
        port: str,
        *,
        baud: int = BAUD,
        timeout: float = TIMEOUT_S,
        keep_alive: bool = True,
    ) -> None:
        super().__init__(port, timeout)
        self.alive_errors = 0
        self._default_baud = baud
        self._keep_alive = keep_alive
        self._points: PointStream | None = None
        self._closing = threading.Event()
        self._pulse: threading.Thread | None = None
        self._transport = Transport(port, baud, timeout)
        try:
            self._connect()
        except BaseException:
            self._transport.close()
            raise

    # ---- connection ----

    def _connect(self) -> None:
        """Find the board at the other end, stop its streams, and read its identity."""
        transport = self._transport
        self.round_trip_s = self._hail()
        self.silence()
        transport.drain(*self._quiet())
        self.build = self._identify()
        self._watchdog_clks = integer(self.read(WATCHDOG))
        if self._keep_alive:
            self._closing.clear()
            self._pulse = threading.Thread(
                target=self._live, name=f"alive {self.port}", daemon=True
            )
            self._pulse.start()

    def _hail(self) -> float:
        """Return the seconds of a ping; a board that does not answer is reset by a break."""
        transport = self._transport
        for with_break in (False, True):
            if with_break:  # the board may have another rate
                transport.send_break()
            transport.send(b"\0")  # ends the rest of a frame
            with contextlib.suppress(NoAnswerError):
                self.ping(wait=self.timeout / 2)
                return self.ping(wait=self.timeout / 2)
        raise NoAnswerError(
            f"{self.port}: no board answers at {transport.baud} baud within {self.timeout:g} s"
            f"{' (there is traffic)' if transport.traffic.bytes_in else ''}"
        )

    def reconnect(self, wait: float | None = None) -> None:
        """Close the port and open it again, for example after it was unplugged.

        The board may have been without power: its registers, its streams and its rate are then as
        after a reset.

        Args:
            wait: Seconds until the port has to exist; the timeout if None.

        Raises:
            LinkError: if it does not come back, or another board does.
        """
        before = self.build
        self._disconnect()
        end = time.monotonic() + (self.timeout if wait is None else wait)
        while True:
            try:
                self._transport = Transport(self.port, self._default_baud, self.timeout)
                break
            except LinkError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.1)
        try:
            self._connect()
            if self.build != before:
                raise LinkError(f"{self.port}: this is another board than before")
        except BaseException:
            self._disconnect()
            raise

    def close(self) -> None:
        """Stop all streams, restore the rate, and close the port; the mirror keeps its state."""
        with contextlib.suppress(LinkError):
            self.silence()
            if self._transport.baud != self._default_baud:
                self._transport.send_break()
                self._transport.baud = self._default_baud
        self._disconnect()

    def _disconnect(self) -> None:
        self._closing.set()
        self._transport.close()
        if self._pulse is not None and self._pulse is not threading.current_thread():
            self._pulse.join()
        self._pulse = None

    def silence(self) -> None:
        """Stop streams and captures."""
        self.command(link_pkg.COMMAND_STREAM_STOP)
        stop = protocol.capture(link_pkg.CAPTURE_STOP, 0)
        self.command(link_pkg.COMMAND_CAPTURE, stop)

    def _quiet(self) -> tuple[float, float]:
        """Return the silence after which nothing more will come, s, and the longest wait, s."""
        return max(0.05, 3.0 * self.round_trip_s), self.timeout

    def _live(self) -> None:
        """Send a sign of life whenever nothing else was sent."""
        while not self._closing.wait(self._alive_period() / 4):
            silent = time.monotonic() - self._transport.traffic.last_out_s
            if silent < 0.75 * self._alive_period():
                continue
            try:
                self.ping()
            except UnpluggedError:
                return
            except LinkError:
                self.alive_errors += 1

    def silence_s(self) -> float:
        """Return the time without a command after which the board turns its laser off, s."""
        return min(self._watchdog_clks / self.build.clock_hz or SILENCE_S, SILENCE_S)

    def _alive_period(self) -> float:
        """Return the time between two signs of life, s.

        A simulated board's clock is slow, and this is more often than it needs.
        """
        return self.silence_s() / 3.0

    @property
    def traffic(self) -> Traffic:
        """Return the traffic over the port."""
        return self._transport.traffic

    def uptime(self) -> int:
        """Return the number of the board's clocks since its reset."""
        return integer(self.read("uptime"))

    @property
    def baud(self) -> int:
        """Return the rate."""
        return self._transport.baud

    # ---- commands ----

    def command(
        self,
        operation: int,
        data: bytes = b"",
        *,
        repeatable: bool = True,
        on_reply: Callable[[], None] | None = None,
    ) -> bytes:
        """Execute a command and return the data after the status in its reply.

        Args:
            operation: First byte of the command.
            data: Data after the sequence number.
            repeatable: Whether it may be executed twice; it is then repeated when no reply comes.
            on_reply: Function as in ``Transport.command``.

        Raises:
            DeviceError: if the board refuses it.
        """
        reply = self._transport.command(operation, data, repeatable=repeatable, on_reply=on_reply)
        if reply[2] != link_pkg.STATUS_OK:
            raise DeviceError(self.port, reply[2])
        return reply[3:]

    def ping(self, data: bytes | None = None, *, wait: float | None = None) -> float:
        """Send data to the board and back, and return the seconds that this took.

        Raises:
            LinkError: if no reply comes, or another one.
        """
        data = os.urandom(4) if data is None else data
        start = time.monotonic()
        reply = self._transport.command(link_pkg.COMMAND_PING, data, wait=wait)
        if reply[2] != link_pkg.STATUS_OK:
            raise DeviceError(self.port, reply[2])
        if reply[3:] != data:
            raise LinkError(f"{self.port}: a ping of {data.hex()} came back as {reply[3:].hex()}")
        return time.monotonic() - start

    # ---- registers ----

    def read_words(self, address: int, count: int) -> list[int]:
        """Return words at consecutive addresses, at most ``link_pkg.MAX_WORDS``.

        Raises:
            DeviceError: naming the register, if the board refuses.
        """
        reply = self._transport.command(link_pkg.COMMAND_READ, protocol.read(address, count))
        return self._words(reply, count, None)

    def write_words(self, block: Block, *, repeatable: bool = True) -> list[int]:
        """Write words, all of them or none, and return the words that were read back.

        Raises:
            DeviceError: naming register and value, if the board refuses.
        """
        data = protocol.write(block.address, block.words)
        reply = self._transport.command(link_pkg.COMMAND_WRITE, data, repeatable=repeatable)
        return self._words(reply, len(block.words), block)

    def _words(self, reply: bytes, count: int, written: Block | None) -> list[int]:
        """Return the words of a reply to a READ or a WRITE."""
        try:
            answer = protocol.words(reply)
        except ValueError as error:
            raise LinkError(f"{self.port}: {error} came ({reply.hex()})") from error
        if answer.status != link_pkg.STATUS_OK:
            name = value = None
            if answer.address is not None:
                name = values.name_at(answer.address)
                if written is not None:
                    word = written.words[answer.address - written.address]
                    value = values.integer_at(answer.address, word)
            raise DeviceError(self.port, answer.status, name, value)
        if len(answer.words) != count:
            raise LinkError(f"{self.port}: {len(answer.words)} words came, want {count}")
        return list(answer.words)

    def write_many(
        self,
        settings: Iterable[tuple[str, Value]],
        progress: Callable[[int, int], None] | None = None,
        *,
        commit: bool = True,
    ) -> None:
        """Write registers as ``RegisterHost.write_many`` does, and know the laser's watchdog."""
        settings = list(settings)
        super().write_many(settings, progress, commit=commit)
        self._watchdog_clks = integer(dict(settings).get(WATCHDOG, self._watchdog_clks))

    def start(self, progress: StartProgress | None = None) -> None:
        """Start lines, laser and mirror, and wait until the mirror is in RUN.

        The index needs the laser's light, which the board turns off when it does not hear its host.
        So everything runs only while this device is open, and is best stopped before it is closed.

        Args:
            progress: Called as in ``wait_for_mirror``.

        Raises:
            LinkError: as ``wait_for_mirror``; everything is then stopped.
        """
        if self.read("mirror_state") == FAULT:
            self.write("mirror_enable", 0)  # ends the state FAULT
        self.write_many([("line_enable", 1), ("laser_enable", 0)])  # ends a trip of the watchdog
        self.write("laser_enable", 1)
        self.write("mirror_enable", 1)
        try:
            self.wait_for_mirror(progress=progress)
        except BaseException:
            with contextlib.suppress(LinkError):
                self.stop()
            raise

    def stop(self) -> None:
        """Stop laser, mirror and lines."""
        for name in ("laser_enable", "mirror_enable", "line_enable"):
            self.write(name, 0)

    @contextlib.contextmanager
    def started(self, progress: StartProgress | None = None) -> Iterator[None]:
        """Run lines, laser and mirror for as long as the context lasts."""
        self.start(progress)
        try:
            yield
        finally:
            with contextlib.suppress(UnpluggedError):
                self.stop()

    def wait_for_mirror(self, progress: StartProgress | None = None) -> None:
        """Wait until the mirror is in RUN, for as long as the board itself allows.

        Args:
            progress: Called with a text, the state's name and the drive's frequency, and with the
                elapsed share of the time that a start takes, in the board's time.

        Raises:
            LinkError: if the mirror is in FAULT, or not in RUN in time.
        """
        start, clock_hz = self.uptime(), self.build.clock_hz
        held = self.read_many(_START)
        sweep, settle, high, low, rate = (integer(held[name]) for name in _START)
        allowed = sweep + settle + clock_hz // 10
        expected = SETTLE_S * clock_hz + ((high - low) << RATE_FRACTION) / max(rate, 1)
        while True:
            now = self.read_many(("mirror_state", "mirror_fault", "mirror_word", "uptime"))
            state, spent = integer(now["mirror_state"]), integer(now["uptime"]) - start
            if progress is not None:
                drive_hz = integer(now["mirror_word"]) / 2.0**pkg.TURN_WIDTH * clock_hz
                share = 1.0 if state == RUN else min(0.99, spent / expected)
                progress(f"{_of(STATES, state)}, drive {drive_hz:.2f} Hz", share)
            if state == RUN:
                return
            if state == FAULT:
                fault = _of(FAULTS, integer(now["mirror_fault"]))
                raise LinkError(f"{self.port}: the mirror is in FAULT: {fault}")
            if spent > allowed:
                raise LinkError(
                    f"{self.port}: the mirror is in {_of(STATES, state)} and not in "
                    f"{_of(STATES, RUN)} after {spent / self.build.clock_hz:.3g} s"
                )
            self._closing.wait(0.1)

    def darkness(self) -> str:
        """Return why lines have no peak, as far as the board knows, or an empty text."""
        names = (
            *("line_enable", "laser_enable", "laser_status", "laser_guard_fault"),
            *("mirror_state", "mirror_fault"),
        )
        found = {name: integer(value) for name, value in self.read_many(names).items()}
        state, reasons = found["mirror_state"], []
        if not found["line_enable"]:
            reasons.append("lines stand still")
        if found["laser_status"] >> _TRIPPED & 1:
            reasons.append(f"the laser went off {self.silence_s():g} s after a host's last command")
        elif not found["laser_enable"]:
            reasons.append("the laser is off")
        elif not found["laser_status"] >> _GUARDED & 1:
            faults = [w for k, w in enumerate(_GUARD_FAULTS) if found["laser_guard_fault"] >> k & 1]
            last = f", which last tripped at {' and '.join(faults)}" if faults else ""
            reasons.append(f"the laser's guard permits no light{last}")
        if state != RUN:
            fault = f" ({_of(FAULTS, found['mirror_fault'])})" if state == FAULT else ""
            reasons.append(f"the mirror is in {_of(STATES, state)}{fault}")
        return ", ".join(reasons)

    # ---- points and lines ----

    def least_step(self, form: int) -> int:
        """Return the smallest step of a stream whose points the serial line carries.

        It is for the present rates of the lines and of the link, with a tenth to spare for replies;
        1 where lines stand still.

        Args:
            form: Format of the records, a ``records.Form``.
        """
        found = self.read_many(("mirror_word", "ratio", "points_batch"))
        word, ratio, batch = (integer(value) for value in found.values())
        lines_per_s = line_step(word, ratio) / 2.0**pkg.TURN_WIDTH * self.build.clock_hz
        count = min(batch, most_records(form)) or 1
        payload = bytes(link_pkg.BATCH_HEADER_BYTES + count * record_bytes(form))
        packet_s = len(protocol.encode_frame(payload)) * BITS_A_BYTE / self.baud
        step = math.ceil(lines_per_s * packet_s / count / _STREAM_SHARE)
        return min(max(step, 1), MOST_STEP)

    def stream(self, form: int = Form.FULL, step: int = 1, *, depth: int = DEPTH) -> PointStream:
        """Make the board send points.

        Args:
            form: Format of the records, a ``records.Form``: full ones, compact ones, or points and
                free beams.
            step: Distance of the lines whose points are sent, 1 to 255.
            depth: Largest number of points that wait in this program.

        Returns:
            The points to iterate over; leaving its ``with`` stops it.

        Raises:
            InputError: if ``step`` is out of range.
            LinkError: if points are already being sent.
        """
        if step not in range(1, MOST_STEP + 1):
            raise InputError(f"step: must be 1 to {MOST_STEP} ({step})")
        if self._points is not None:
            raise LinkError(f"{self.port}: points are already being sent")
        transport = self._transport
        kind = KINDS[Form(form)]

        def stop() -> None:
            try:
                self.command(link_pkg.COMMAND_STREAM_STOP)
                # The reply overtakes the last packets.
                transport.drain(*self._quiet(), lambda: points.account.packets)
            finally:
                transport.sinks.pop(kind, None)
                self._points = None

        points = PointStream(
            form=Form(form),
            step=step,
            stop=stop,
            bad_frames=lambda: transport.traffic.bad_frames,
            check=transport.check,
            depth=depth,
        )

        def sink(payload: bytes) -> None:
            if payload:
                points.take(protocol.points(payload))
            else:
                points.wake()

        transport.sinks[kind] = sink
        self._points = points
        try:
            start = protocol.stream_start(form, step)
            self.command(link_pkg.COMMAND_STREAM_START, start, on_reply=points.begin)
        except BaseException:
            transport.sinks.pop(kind, None)
            self._points = None
            raise
        return points

    def capture(
        self, mode: int = link_pkg.CAPTURE_NEXT, argument: int = 0, *, timeout: float | None = None
    ) -> Captured:
        """Return the pixels of one raw line with its point.

        A line that did not arrive whole is requested again, unless it was requested by its number.

        Args:
            mode: ``link_pkg.CAPTURE_NEXT``, or ``CAPTURE_LINE`` with its number in ``argument``.
            argument: Number of the line for ``CAPTURE_LINE``.
            timeout: Seconds to wait for the line; three times that of a command if None.

        Raises:
            NoAnswerError: if no line came.
            DeviceError: ``BUSY``, if another line is being captured.
        """
        if mode == link_pkg.CAPTURE_STOP:
            raise InputError("mode: a line is wanted, and not to stop")
        limit = 3.0 * self.timeout if timeout is None else timeout
        end = time.monotonic() + limit
        with self.captured(mode, argument) as lines:
            while time.monotonic() < end:
                found = lines.get(max(0.0, min(self.timeout / 4, end - time.monotonic())))
                if found is not None:
                    return found
                if self.read("capture_busy"):
                    continue
                found = lines.get(max(self._quiet()[0], 0.1))  # the last packet may be on the way
                if found is not None:
                    return found
                if mode == link_pkg.CAPTURE_LINE:
                    raise LinkError(f"{self.port}: line {argument} came with packets missing")
                self._capture(lines, mode, argument)
        reason = self.darkness()
        why = f" ({reason})" if reason else ""
        raise NoAnswerError(f"{self.port}: no line came within {limit:g} s{why}")

    @contextlib.contextmanager
    def captured(self, mode: int, argument: int = 0) -> Iterator[CaptureStream]:
        """Make the board send raw lines for as long as the context lasts.

        Args:
            mode: ``link_pkg.CAPTURE_NEXT``; ``CAPTURE_LINE``, the line with the number
                ``argument``; ``CAPTURE_EVERY``, every ``argument``-th line, one at a time.
            argument: Number or distance of lines, see ``mode``.

        Yields:
            The stream from which to fetch the lines.

        Raises:
            LinkError: if lines are already being captured.
        """
        with self._captures() as lines:
            self._capture(lines, mode, argument)
            yield lines

    def _capture(self, lines: CaptureStream, mode: int, argument: int) -> None:
        lines.begin()
        before = self.traffic.retries
        try:
            self.command(link_pkg.COMMAND_CAPTURE, protocol.capture(mode, argument))
        except DeviceError as error:
            if error.status != Status.BUSY or self.traffic.retries == before:
                raise  # otherwise only the reply to the first command was lost

    @contextlib.contextmanager
    def _captures(self) -> Iterator[CaptureStream]:
        """Receive lines for as long as the context lasts."""
        transport = self._transport
        lines = CaptureStream(self.build.line_length, transport.check)
        kinds = link_pkg.STREAM_CAPTURE_PIXELS, link_pkg.STREAM_CAPTURE_RECORD
        if transport.sinks.keys() & set(kinds):
            raise LinkError(f"{self.port}: lines are already being captured")

        def pixels(payload: bytes) -> None:
            if payload:
                lines.take_pixels(protocol.capture_pixels(payload))
            else:
                lines.wake()

        def record(payload: bytes) -> None:
            if payload:
                lines.take_record(protocol.capture_record(payload))
            else:
                lines.wake()

        transport.sinks.update(zip(kinds, (pixels, record), strict=True))
        try:
            yield lines
        finally:
            try:
                stop = protocol.capture(link_pkg.CAPTURE_STOP, 0)
                with contextlib.suppress(LinkError):
                    self.command(link_pkg.COMMAND_CAPTURE, stop)
                    end = time.monotonic() + self.timeout
                    while self.read("capture_busy") and time.monotonic() < end:
                        time.sleep(0.01)
            finally:
                for kind in kinds:
                    transport.sinks.pop(kind, None)

    # ---- rate ----

    def set_baud(self, rate: int) -> None:
        """Change the rate on both sides.

        The board takes the rate on trial: where nothing that it understands comes at the new one,
        it goes back to its default, and so does this side.

        Raises:
            InputError: if the board's clock cannot make the rate.
            LinkError: if the other side does not answer at the rate; the default rate is then in
                use.
        """
        clock = self.build.clock_hz
        step = round(rate * 2**STEP_WIDTH / clock)
        register = values.find("uart_step")
        if not (
            register.minimum <= step <= register.maximum
            and 0 < rate * LEAST_CLOCKS_A_BIT <= clock
            and abs(step * clock / 2**STEP_WIDTH / rate - 1.0) < MOST_RATE_ERROR
        ):
            most = clock // LEAST_CLOCKS_A_BIT
            raise InputError(f"baud: the board makes rates up to {most} ({rate})")
        transport = self._transport
        before = transport.baud
        self.write("uart_step", step)
        try:
            transport.baud = rate
            self._settle()
        except UnpluggedError:
            raise
        except LinkError as error:
            transport.baud = before
            transport.send_break()
            transport.baud = self._default_baud
            self._settle()
            raise LinkError(f"{self.port}: nothing is heard at {rate} baud") from error

    def _settle(self) -> None:
        """Wait until both sides receive each other."""
        self._transport.send(b"\0")
        self.ping()


def _of(names: Sequence[str], index: int) -> str:
    """Return a name by its number, or a text for a number without a name."""
    return names[index] if index < len(names) else str(index)
