"""What the instrument survives, on the virtual board: after it, its self-test passes.

``pytest -s`` shows the figures; times are of the board's clock. Each kind of trouble comes once in
``make test``; ``make soak`` brings it in volume. The short tests that can leave a board as they
found it share one, look after each whether it works, and end with a whole self-test of it.
"""

import contextlib
import functools
import os
import select
import struct
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness import generator, in_volume
from port_host import Host
from slow_board import CONFIG as SLOW
from slow_board import SCENE

from vrscan.clocked.frame_decoder import FrameDecoder
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.data import link_pkg, pkg
from vrscan.data.records import CONFIGURATION
from vrscan.engines.board import Board
from vrscan.fixed.test_line import least_period
from vrscan.link import protocol, selftest
from vrscan.link.device import BAUD, RUN, Device
from vrscan.link.protocol import Batch, Command, Status
from vrscan.link.stream import PointStream
from vrscan.link.transport import NoAnswerError
from vrscan.registers import values
from vrscan.registers.register_map import REGISTERS, WINDOWS

TIMEOUT_S = 240.0  # of this machine, whatever else it does
FAST_BAUD = 12_500_000  # an eighth of the clock
LINE_RATE = 37_400
BATCH = 28  # most compact records of a packet
PACKET_BYTES = link_pkg.BATCH_HEADER_BYTES + BATCH * link_pkg.COMPACT_BYTES + 4  # CRC, COBS, 0x00
REPLY_S = 0.05
RATE_CLKS = 5_000_000  # a rate is measured
FILL_CLKS = 4_000_000  # more than the board's buffer takes to fill where the line is too slow
COUNTERS = [r.name for r in REGISTERS.values() if r.access == "counter"]
FRAMES = ("frames_crc", "frames_malformed", "frames_too_long", "frames_too_short")
INDEX = ("missing_count", "doubled_count", "impossible_count", "glitch_count", "overrun_count")
CHAIN = (
    "short_count",
    "long_count",
    "unfinished_count",
    "early_count",
    "dropped_count",
    "untagged_count",
    "unread_count",
    "mistimed_count",
)
TABLES = list(values.FIELDS)
MAPS = {field.name for field in WINDOWS["map_table"].fields}
SHARED = "shared"
SHARED_OR_NEW = pytest.mark.parametrize("tried", [SHARED, in_volume("slow_board")], indirect=True)

pytestmark = pytest.mark.timeout(1800)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    """A board of 100 MHz."""
    with Board(SCENE, port=tmp_path / "port") as running:
        yield running


@pytest.fixture
def slow_board(tmp_path: Path) -> Iterator[Board]:
    """A board of 25 MHz whose mirror swings when its drive begins."""
    with Board(SCENE, SLOW, port=tmp_path / "port", swinging=True) as running:
        yield running


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[], Board]]:
    """What starts the board of the short tests when it is first asked for."""
    port = tmp_path_factory.mktemp("survival") / "port"
    with contextlib.ExitStack() as running:
        start = Board(SCENE, SLOW, port=port, swinging=True)
        yield functools.cache(lambda: running.enter_context(start))


@pytest.fixture
def tried(request: pytest.FixtureRequest, shared: Callable[[], Board]) -> Board:
    """The board that is shared, or a new one of a name."""
    found: Board = shared() if request.param == SHARED else request.getfixturevalue(request.param)
    return found


@pytest.fixture
def aftermath(request: pytest.FixtureRequest) -> Callable[[Device], None]:
    """What is done after a test: a shared board still has its self-test before it."""
    return works if request.node.callspec.params["tried"] == SHARED else passes


class Wire(Host):
    """A host that sends any bytes, and sorts the frames that come."""

    def __init__(self, port: Path, baud: int = BAUD) -> None:
        super().__init__(port, baud)
        os.set_blocking(self.file, False)
        self.frames = protocol.FrameReader()
        self.come: deque[bytes] = deque()
        self._sequence = 0

    def send(self, data: bytes) -> None:
        """Send bytes, and take what comes meanwhile."""
        left = memoryview(data)
        end = time.monotonic() + TIMEOUT_S
        while left:
            reading, writing, _ = select.select([self.file], [self.file], [], 1.0)
            if reading:
                self.come += self.frames.feed(os.read(self.file, 1 << 16))
            if writing:
                left = left[os.write(self.file, left[:1024]) :]
                end = time.monotonic() + TIMEOUT_S
            assert time.monotonic() < end, "the board takes no bytes"

    def payload(self) -> bytes:
        """Return the next payload that comes."""
        end = time.monotonic() + TIMEOUT_S
        while not self.come:
            reading, _, _ = select.select([self.file], [], [], 1.0)
            if reading:
                self.come += self.frames.feed(os.read(self.file, 1 << 16))
            assert self.come or time.monotonic() < end, "nothing comes"
        return self.come.popleft()

    def frame(self, operation: int, data: bytes = b"") -> tuple[bytes, int]:
        """Return the frame of a command, and its sequence number."""
        self._sequence = (self._sequence + 1) & 0xFF
        payload = protocol.command(operation, self._sequence, data)
        return protocol.encode_frame(payload), self._sequence

    def command(self, operation: int, data: bytes = b"", *, before: bytes = b"") -> list[bytes]:
        """Send a command once, and return all that comes up to its reply, which is the last."""
        frame, sequence = self.frame(operation, data)
        self.send(before + frame)
        found = [self.payload()]
        while tuple(found[-1][:2]) != (link_pkg.REPLY_BIT | operation, sequence):
            found.append(self.payload())
        return found

    def words(self, address: int, count: int, *, before: bytes = b"") -> list[int]:
        """Return registers; nothing else may come before them but refusals of bad frames."""
        *others, reply = self.command(Command.READ, protocol.read(address, count), before=before)
        self.refused = [each[3] for each in others]
        assert all(each[:3] == bytes([0xFF, 0, Status.BAD_FRAME]) for each in others)
        return list(protocol.words(reply).words)


def connected(board: Board, baud: int = BAUD) -> Device:
    return Device(str(board.port), baud=baud, timeout=TIMEOUT_S, keep_alive=False)


def settings_of(device: Device, whole: bool) -> dict[str, values.Value]:
    """Return all that can be set; if not whole without the maps, which are more than all else."""
    names = [r.name for r in REGISTERS.values() if r.access in values.WRITABLE]
    return device.read_many([*names, *(n for n in TABLES if whole or n not in MAPS)])


def passes(device: Device) -> None:
    """Do a self-test of all kinds of checks, but of few of its runs of lines."""
    test = selftest.SelfTest(device)
    named = selftest.runs(device.build.line_length)
    with selftest.arranged(device):
        faults = device.read_many(selftest.FAULTS)
        checks = [
            test.pings(),
            test.registers(),
            test.answers(),
            test.run("much noise", named["much noise"], True, selftest.ANGLES[2], 1000),
            test.run("moving peak", named["moving peak"], False, selftest.ANGLES[1], 30_000),
            test.captured("saturated", named["saturated"]),
            test.no_faults(faults),
        ]
    assert [str(check) for check in checks if check.difference] == []
    assert sum(check.lines for check in checks) == 2 * selftest.LINES + 2
    assert sum(check.compared for check in checks) > 5000


def works(device: Device) -> None:
    """See that a board answers, and does a run of lines as the model, with no fault counted."""
    test = selftest.SelfTest(device)
    noise = selftest.runs(device.build.line_length)["much noise"]
    with selftest.arranged(device):
        faults = device.read_many(selftest.FAULTS)
        checks = [
            test.pings(),
            test.run("much noise", noise, True, selftest.ANGLES[2], 1000),
            test.no_faults(faults),
        ]
    assert [str(check) for check in checks if check.difference] == []
    assert sum(check.lines for check in checks) == selftest.LINES


def endless(device: Device, period_clks: int = 0) -> None:
    """Set the registers of test lines without end."""
    plain = selftest.runs(device.build.line_length)["moving peak"]
    selftest.arrange(device, replace(plain, lines=0, period_clks=period_clks))


def uptime(device: Device, come: Callable[[], object] = lambda: None) -> tuple[int, Any]:
    """Return the board's clocks, and what ``come`` says when that reply is in."""
    seen: list[object] = []
    data = protocol.read(REGISTERS["uptime"].address, 2)
    reply = device.command(Command.READ, data, on_reply=lambda: seen.append(come()))
    low, high = struct.unpack("<x2I", reply)
    return low | high << 32, seen[-1]


def fetched(points: PointStream) -> np.ndarray:
    """Return all points that wait."""
    found = points.get(0.0)
    assert found is not None
    return found


def show(baud: int, points: float, line_rate: float) -> None:
    most = baud * BATCH / (10 * PACKET_BYTES)
    print(
        f"\n{baud:>9} baud: {points:>7.0f} points/s of {line_rate:.0f} lines/s, "
        f"the line has room for {most:.0f}"
    )


@pytest.mark.parametrize(
    ("tried", "count"), [(SHARED, 10_000), in_volume("board", 1_000_000)], indirect=["tried"]
)
def test_random_bytes(tried: Board, count: int, aftermath: Callable[[Device], None]) -> None:
    board = tried
    chance = generator(1)
    data = chance.integers(0, 256, count, dtype=np.uint8)
    # Frames of some 22 bytes, and behind them some of 256.
    data[chance.random(count) < np.where(np.arange(count) % 5000 < 4000, 0.04, 0.0)] = 0
    data[-1] = 0
    decoder = FrameDecoder(link_pkg.MAX_PAYLOAD)
    ends = Counter(decoder.take(byte).status for byte in data.tolist())
    assert ends[FrameStatus.OK] == 0, "another seed: the noise has a good frame"
    bad = {f"frames_{s.name.lower()}": n for s, n in ends.items() if s is not None}
    assert set(bad) <= set(FRAMES) and max(bad.values()) < 0xFFFF
    assert len(bad) == len(FRAMES) or count < 1_000_000

    with connected(board) as device:
        baud = device.build.clock_hz // 8
        device.set_baud(baud)
        whole = count >= 1_000_000
        settings, before = settings_of(device, whole), device.read_many(COUNTERS)
        device._disconnect()
    begin, clocks = time.monotonic(), board.clocks()
    with Wire(board.port, baud) as wire:
        wire.send(data.tobytes())
        *refused, reply = wire.command(Command.PING, b"alive", before=b"\0")
        assert reply[2:] == b"\0alive"
        assert wire.frames.bad.total() == 0
        assert {each[:3] for each in refused} == {bytes([0xFF, 0, Status.BAD_FRAME])}
    wall = time.monotonic() - begin
    clocks = board.clocks() - clocks
    with connected(board, baud) as device:
        now = device.read_many(COUNTERS)
        after = settings_of(device, whole)
        assert {name: after[name] for name in after if after[name] != settings[name]} == {}
        moved = {name: now[name] - before[name] for name in COUNTERS if now[name] != before[name]}
        print(f"\n{count} random bytes: {clocks / 1e6:.0f} M clocks in {wall:.0f} s; {moved}")
        lost = moved.pop("commands_lost", 0)
        moved.pop("frames_good")
        assert moved == bad
        assert board.status().dropped > 0 or len(refused) + lost == sum(bad.values())
        assert device.read("laser_enable") == 0 and device.read("laser_status") & 0b100 == 0
        aftermath(device)
        device.set_baud(BAUD)


@pytest.mark.soak
def test_points_that_a_slow_line_has_no_room_for(slow_board: Board) -> None:
    baud, line_rate = 500_000, 9000
    with connected(slow_board) as device, selftest.arranged(device):
        clock = device.build.clock_hz
        endless(device, clock // line_rate)
        before = device.read("points_dropped")
        device.set_baud(baud)
        with device.stream(False) as points:
            device.write("test_start", 1)
            while device.read("points_dropped") == before:  # the buffer is full
                pass
            marks = [uptime(device, lambda: replace(points.account)) for _ in range(11)]
            (start, first), (end, account) = marks[0], marks[-1]
            assert device.read("points_dropped") - before >= account.dropped > 0
            device.set_baud(BAUD)  # what is left goes faster
            device.write("test_stop", 1)
        found = fetched(points)[: account.records]
        # From one execution to the next: a whole reply, the request, and what the host needs.
        took = np.diff([clocks for clocks, _ in marks]) / clock
        print(f"\nreplies on a full line of {baud} baud: {1e3 * took.mean():.1f} ms, ", end="")
        print(f"at most {1e3 * took.max():.1f} ms")
        assert took.max() < REPLY_S

        assert account.packets_lost == account.bad_frames == account.restarts == 0
        gap = np.diff(found["line"].astype(np.int64))
        assert (gap > 0).all() and (gap > 1).sum() >= 5
        lost = found["flags"] >> link_pkg.COMPACT_LOST & 1
        assert np.array_equal(lost[1:] == 1, gap > 1) and lost[0] == 0
        # A packet's header counts what was dropped until it was written.
        assert account.missing == (gap - 1).sum() <= account.dropped
        rate = (account.records - first.records) * clock / (end - start)
        show(baud, rate, line_rate)
        assert rate > 0.85 * baud * BATCH / (10 * PACKET_BYTES)
    with connected(slow_board) as device:
        passes(device)


class Storm:
    """Commands with what has to be answered, by a model of the registers that they touch."""

    def __init__(self, held: dict[str, int]) -> None:
        self.held = held
        self.chance = generator(6)

    def next(self) -> tuple[int, bytes, bytes]:
        """Return a command's operation and data, and how its reply begins, from the status on."""
        kind = int(self.chance.integers(10))
        some = int(self.chance.integers(1 << 32))
        names = ("scratch", "points_batch", "k_noise", "snr_min", "min_width", "c_sfm_gain")
        name = names[some % len(names)]
        register = REGISTERS[name]
        if kind < 4:  # any word, also what does not fit
            word = some if kind == 0 else values.within(register, some)
            return Command.WRITE, protocol.write(register.address, [word]), self.write(name, word)
        if kind < 7:
            word = self.held[name]
            reply = struct.pack("<BBI", Status.OK, 1, word)
            return Command.READ, protocol.read(register.address, 1), reply
        if kind == 7:
            address = 0x2000 + some % 0x1000
            reply = struct.pack("<BBH", Status.NO_ADDRESS, 0, address)
            if some & 1 << 31:
                return Command.READ, protocol.read(address, 62), reply
            return Command.WRITE, protocol.write(address, [some]), reply
        if kind == 8:
            register = REGISTERS["mirror_state"]
            if some & 1 << 31:
                reply = struct.pack("<BBI", Status.OK, 1, RUN)
                return Command.READ, protocol.read(register.address, 1), reply
            reply = struct.pack("<BBH", Status.READ_ONLY, 0, register.address)
            return Command.WRITE, protocol.write(register.address, [0]), reply
        reply = bytes([Status.OK, 12])
        return Command.READ, protocol.read(REGISTERS["mirror_word"].address, 12), reply

    def write(self, name: str, word: int) -> bytes:
        """Write a word to a register, and return the reply."""
        register = REGISTERS[name]
        refused = None
        if register.lock is not None and self.held[register.lock]:
            refused = Status.LOCKED
        elif not register.minimum <= word <= register.maximum:
            refused = Status.BAD_VALUE
        if refused is not None:
            return struct.pack("<BBH", refused, 0, register.address)
        self.held[name] = word
        return struct.pack("<BBI", Status.OK, 1, word)


@pytest.mark.parametrize(
    ("commands", "after"), [(150, works), in_volume(2000, passes)], ids=["short", "long"]
)
def test_a_storm_of_commands_while_the_mirror_runs(
    slow_board: Board, commands: int, after: Callable[[Device], None]
) -> None:
    window = 6
    touched = ("scratch", "points_batch", "k_noise", "snr_min", "min_width", "c_sfm_gain")
    with connected(slow_board) as device:
        device.load(SLOW)
        power = SLOW.laser.power_max // 2
        device.write_many(
            [("line_enable", 1), ("laser_adapt", 0), ("laser_power", power), ("laser_enable", 1)]
        )
        device.write("mirror_enable", 1)
        device.wait_for_mirror()
        held = device.read_many([*touched, "lock_calibration"])
        faults = device.read_many([*INDEX, *CHAIN, "commands_lost"])
        passed_over = device.read("skipped_count")
    storm, sensor = Storm(dict(held)), slow_board.status()
    batches: list[Batch] = []
    with Wire(slow_board.port) as wire:
        wire.command(Command.STREAM_START, protocol.stream_start(True, 1), before=b"\0")
        waiting: deque[tuple[bytes, bytes]] = deque()
        answers: Counter[str] = Counter()
        sent = 0
        begin = slow_board.clocks()
        while sent < commands or waiting:
            while sent < commands and len(waiting) < window:
                if sent == commands // 2 - 1:  # what waits takes effect now or never
                    data = protocol.write(REGISTERS["commit"].address, [1])
                    operation, want = Command.WRITE, storm.write("commit", 1)
                elif sent == commands // 2:
                    data = protocol.write(REGISTERS["lock_calibration"].address, [1])
                    operation, want = Command.WRITE, storm.write("lock_calibration", 1)
                else:
                    operation, data, want = storm.next()
                frame, sequence = wire.frame(operation, data)
                wire.send(frame)
                waiting.append((bytes([link_pkg.REPLY_BIT | operation, sequence]), want))
                sent += 1
            payload = wire.payload()
            if payload[0] == link_pkg.STREAM_POINTS_FULL:
                batches.append(protocol.points(payload))
                continue
            head, want = waiting.popleft()
            assert payload[:2] == head and payload[2:].startswith(want), (payload.hex(), want.hex())
            answers[Status(payload[2]).name] += 1
        took = slow_board.clocks() - begin
        wire.command(Command.STREAM_STOP)
        assert wire.frames.bad.total() == 0
    found = np.concatenate([batch.records for batch in batches])
    lines = found["line"].astype(np.int64)
    lost = (np.diff(lines) - 1).sum()
    print(f"\n{commands} commands in {took / 1e6:.1f} M clocks: {dict(answers)}; ", end="")
    print(f"{len(lines)} points in {len(batches)} packets, {lost} had no room")
    assert set(answers) == {"OK", "LOCKED", "BAD_VALUE", "NO_ADDRESS", "READ_ONLY"}
    assert min(answers.values()) > commands // 60
    assert [batch.sequence for batch in batches] == [k % 256 for k in range(len(batches))]
    assert (np.diff(lines) > 0).all() and len(lines) > commands // 4
    changes = np.diff(found["bits"] // CONFIGURATION & 1) != 0
    skipped = np.diff(lines) - 1 - found["lost"][1:]
    assert changes.sum() == 1 and not skipped[~changes].any() and found["lost"][0] == 0
    # A packet's header counts what was dropped until it was written.
    gaps = np.cumsum([int(batch.records["lost"].sum()) for batch in batches])
    dropped = np.array([batch.dropped for batch in batches])
    assert (gaps <= dropped).all() and (dropped[:-1] <= gaps[1:]).all()
    running = (1 << pkg.FLAG_NOT_RUNNING) | (1 << pkg.FLAG_INDEX_FAULT)
    assert (found["flags"] & running == 0).all()
    # The first line behind those that the commit has skipped says so, if there was room for it.
    told = found["flags"] >> pkg.FLAG_LINES_LOST & 1 != 0
    assert not told[0] and not told[1:][~changes].any()
    with connected(slow_board) as device:
        assert device.read("mirror_state") == RUN
        assert device.read_many(list(faults)) == faults
        assert device.read("skipped_count") - passed_over == skipped.sum()
        assert slow_board.status().lines_lost == sensor.lines_lost
        device.write_many([("mirror_enable", 0), ("line_enable", 0), ("laser_enable", 0)])
        after(device)


@pytest.mark.soak
def test_a_rate_that_no_host_follows(slow_board: Board) -> None:
    with connected(slow_board) as device:
        before = device.read("uart_fallbacks")
        clock, usual = device.build.clock_hz, device.read("uart_step_now")
        device.write("uart_step", usual // 3)
        with pytest.raises(NoAnswerError):
            device.ping(wait=0.5)  # at the old rate
        slow_board.wait(clock)
        device._transport.send(b"\0")
        device.ping()
        assert device.read("uart_step_now") == usual
        assert device.read("uart_fallbacks") == before + 1
        passes(device)


@pytest.mark.soak
def test_the_rate_of_the_scan_at_4_mbaud(board: Board) -> None:
    baud, share = 4_000_000, 10  # of a second
    with connected(board) as device:
        clock = device.build.clock_hz
        device.set_baud(baud)
        with selftest.arranged(device):
            endless(device, clock // LINE_RATE)
            dropped = device.read("points_dropped")
            with device.stream(False) as points:
                start, _ = uptime(device)
                device.write("test_start", 1)
                marks = []
                while not marks or marks[-1][0] < start + clock // (share - 1):
                    marks.append(uptime(device, lambda: points.account.records))
                    time.sleep(0.05)
                device.write("test_stop", 1)
                while device.read("test_running"):
                    pass
            account, found = points.account, fetched(points)
            assert device.read("points_dropped") == dropped
        assert account.lost == account.dropped == account.packets_lost == account.bad_frames == 0
        assert (np.diff(found["line"].astype(np.int64)) == 1).all()
        assert ((found["flags"] >> link_pkg.COMPACT_LOST & 1) == 0).all()
        # Points that were here when the board told its time, from before the first line on.
        late = [
            LINE_RATE * (clocks - start) / clock - come
            for clocks, come in marks
            if clocks >= start + clock // share
        ]
        clocks, come = marks[-1]
        assert len(found) >= come > LINE_RATE // share
        show(baud, come * clock / (clocks - start), clock / (clock // LINE_RATE))
        assert min(late) <= BATCH and max(late) <= 3 * BATCH
        passes(device)


@pytest.mark.soak
def test_points_by_rate(board: Board) -> None:
    with connected(board) as device:
        clock = device.build.clock_hz
        lines = clock / least_period(device.build.line_length)
        for baud in (1_000_000, BAUD, 4_000_000, FAST_BAUD):
            if baud != device.baud:
                device.set_baud(baud)
            trips = np.diff([uptime(device)[0] for _ in range(51)])
            trip = int(np.median(trips))
            with selftest.arranged(device):
                endless(device)
                before = device.read("points_dropped")
                with device.stream(False) as points:
                    start, _ = uptime(device)
                    device.write("test_start", 1)
                    # Until the buffer of a line that is too slow is full.
                    while device.read("points_dropped") == before:
                        if uptime(device)[0] > start + FILL_CLKS:
                            break
                    begin, first = uptime(device, lambda: points.account.records)
                    end, last = begin, first
                    while end < begin + RATE_CLKS:
                        end, last = uptime(device, lambda: points.account.records)
                    device.write("test_stop", 1)
                assert points.account.packets_lost == points.account.bad_frames == 0
            rate = (last - first) * clock / (end - begin)
            show(baud, rate, lines)
            print(f"{' ':>15} a reply after {trip} clocks, {1e6 * trip / clock:.0f} us")
            assert rate > 0.85 * min(lines, baud * BATCH / (10 * PACKET_BYTES))


@pytest.mark.parametrize(
    ("tried", "every"), [(SHARED, 17), in_volume("slow_board", 1)], indirect=["tried"]
)
def test_frames_cut_everywhere(
    tried: Board, every: int, aftermath: Callable[[Device], None]
) -> None:
    table = values.FIELDS["focus_table_position"][0].address
    old = [7 * k + 1 for k in range(link_pkg.MAX_WORDS)]
    new = [0xFFFF - word for word in old]
    most = bytes(range(1, link_pkg.MAX_PAYLOAD - 2))
    with Wire(tried.port) as wire:
        wire.command(Command.WRITE, protocol.write(table, old), before=b"\0")
        assert wire.words(table, link_pkg.MAX_WORDS) == old
        for operation, data in (
            (Command.PING, most),
            (Command.READ, protocol.read(table, link_pkg.MAX_WORDS)),
            (Command.WRITE, protocol.write(table, new)),
        ):
            whole, _ = wire.frame(operation, data)
            count = link_pkg.MAX_WORDS if operation == Command.WRITE else 1
            lengths = [*range(0, len(whole) - 1, every), len(whole) - 2]
            for length in dict.fromkeys(lengths):
                part = whole[:length]
                want = [int(protocol.decode_frame(part)[0])] if part else []
                # What follows comes with the 0x00, and when the board has dealt with that.
                assert wire.words(table, count, before=part + b"\0") == old[:count], length
                assert wire.refused == want, length
                wire.send(part + b"\0")
                for _ in want:
                    assert wire.payload() == bytes([0xFF, 0, Status.BAD_FRAME, *want])
                assert wire.words(table, count) == old[:count], length
                assert wire.refused == []
        wire.command(Command.WRITE, protocol.write(table, new))
        assert wire.words(table, link_pkg.MAX_WORDS) == new
        assert wire.frames.bad.total() == 0
    with connected(tried) as device:
        aftermath(device)


@SHARED_OR_NEW
def test_a_host_that_dies_in_mid_command(tried: Board, aftermath: Callable[[Device], None]) -> None:
    with connected(tried) as device:
        endless(device)
        device.write("scratch", 5)
    with Wire(tried.port) as wire:
        wire.command(Command.STREAM_START, protocol.stream_start(True, 1), before=b"\0")
        wire.command(Command.WRITE, protocol.write(REGISTERS["test_start"].address, [1]))
        while wire.payload()[0] != link_pkg.STREAM_POINTS_FULL:
            pass
        frame, _ = wire.frame(
            Command.WRITE, protocol.write(REGISTERS["scratch"].address, [0x1234_5678])
        )
        wire.send(frame[:-3])
    with connected(tried) as device:
        assert device.read("scratch") == 5 and device.read("frames_good") > 0
        unasked = device.traffic.unasked
        for _ in range(20):
            device.ping()
        assert device.traffic.unasked == unasked
        assert device.read("test_running") == 1  # a host may come back to what it began
        aftermath(device)


@pytest.mark.soak
def test_unplugged_while_everything_streams(slow_board: Board) -> None:
    with connected(slow_board) as device:
        endless(device)
    with Wire(slow_board.port) as wire:
        wire.command(Command.STREAM_START, protocol.stream_start(True, 1), before=b"\0")
        every = protocol.capture(link_pkg.CAPTURE_EVERY, 1)
        wire.command(Command.CAPTURE, every)
        wire.command(Command.WRITE, protocol.write(REGISTERS["test_start"].address, [1]))
        kinds = set()
        while not kinds >= {link_pkg.STREAM_POINTS_FULL, link_pkg.STREAM_CAPTURE_RECORD}:
            kinds.add(wire.payload()[0])
        while slow_board.status().dropped < 20_000:  # nobody reads
            time.sleep(0.05)
    while slow_board.status().unheard < 50_000:  # nobody is there
        time.sleep(0.05)
    with connected(slow_board) as device:
        assert device.read("capture_busy") == 0
        unasked = device.traffic.unasked
        for _ in range(20):
            device.ping()
        assert device.traffic.unasked == unasked
        passes(device)


@SHARED_OR_NEW
def test_a_break_in_mid_stream(tried: Board, aftermath: Callable[[Device], None]) -> None:
    with connected(tried) as device:
        usual, breaks = device.read("uart_step_now"), device.read("uart_breaks")
        with selftest.arranged(device):
            endless(device)
            device.set_baud(1_000_000)
            assert device.read("uart_step_now") != usual
            with device.stream(True) as points:
                device.write("test_start", 1)
                while points.account.records < 10:
                    device.ping()
                device._transport.send_break()
                device._transport.baud = BAUD
                device._transport.drain(0.5, TIMEOUT_S)
                device._transport.send(b"\0")
                device.ping()
                come = points.account.records
                for _ in range(20):
                    device.ping()
                assert device.read("test_running") == 1 and points.account.records == come
            assert device.read("uart_step_now") == usual
            assert device.read("uart_breaks") == breaks + 1
        aftermath(device)


def test_after_all_that_the_shared_board_passes(shared: Callable[[], Board]) -> None:
    with connected(shared()) as device:
        passes(device)
