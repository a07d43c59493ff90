"""command_server: every clock of the RTL against the model, every reply against the protocol."""

from collections.abc import Iterable

import cocotb
import numpy as np
import pytest
from bus_registers import (
    COUNT,
    DOOR,
    FIRST,
    KEY,
    LOCKED,
    NOTHING,
    READ_ONLY,
    SMALL,
    BusRegisters,
)
from cocotb.triggers import FallingEdge, Timer
from frame_oracle import frame, is_good, random_bytes
from harness import (
    CLOCK_NS,
    EACH_VOLUME,
    TwinBench,
    as_integer,
    generator,
    reset,
    rounds,
    simulate,
)

from vrscan.clocked.command_server import (
    BAD_FRAME_PLACES,
    COUNT_MAX,
    FRAME_COUNTERS,
    PLACES,
    Access,
    Answer,
    CommandServer,
    answer,
    latency,
)
from vrscan.clocked.frame_decoder import FrameDecoder
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.data import link_pkg

# The protocol in plain numbers.
PING, READ, WRITE, START, STOP, CAPTURE = 0x01, 0x02, 0x03, 0x10, 0x11, 0x12
OK, UNKNOWN, LENGTH, NO_ADDRESS, RO, LOCK, VALUE, BUSY, FRAME = range(9)
OPS = (PING, READ, WRITE, START, STOP, CAPTURE)

QUIET = {
    "valid": 0,
    "data": 0,
    "done": 0,
    "status": 0,
    "halt": 0,
    "ready": 1,
    "bus_done": 0,
    "bus_status": 0,
    "bus_data": 0,
    "capture_busy": 0,
}
STROBES = ("stream_start", "stream_stop", "capture_start")


def u16(value: int) -> bytes:
    return value.to_bytes(2, "little")


def u32(*values: int) -> bytes:
    return b"".join(value.to_bytes(4, "little") for value in values)


def read(sequence: int, address: int, count: int) -> bytes:
    return bytes([READ, sequence]) + u16(address) + bytes([count])


def write(sequence: int, address: int, *words: int) -> bytes:
    return bytes([WRITE, sequence]) + u16(address) + u32(*words)


class Bench(TwinBench):
    """Gives payloads or frames, answers accesses, and keeps replies and strobes."""

    strobes = ("valid", "done", "halt", "bus_done")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)

    async def start(self, **inputs: int) -> None:
        """Reset for a clock; the registers are new ones, too."""
        self.registers = BusRegisters()
        self.bus_latency = 3
        self.due: int | None = None
        self.answer = Answer(0, 0)
        self.reply = bytearray()
        self.replies: list[bytes] = []
        self.reply_clocks: list[int] = []  # of the first bytes
        self.done_clock = 0
        self.events: list[tuple] = []
        self.alive = 0
        self.decoder = FrameDecoder(link_pkg.MAX_PAYLOAD)
        await self.reset_to(CommandServer(), **(QUIET | inputs))
        self.give(**dict.fromkeys(self.strobes, 0))
        self.check()

    def check(self) -> None:
        twin, dut = self.twin, self.dut
        names = ["valid", "busy", "alive", "bus_valid", *STROBES]
        want = [twin.valid, twin.busy, twin.alive, twin.bus is not None]
        want += [name in twin.strobes for name in STROBES]
        if twin.valid:
            names += ["data", "last"]
            want += [twin.data, twin.last]
        if twin.bus:
            names += ["bus_access", "bus_address", "bus_data"][: 3 if twin.bus.access else 2]
            want += twin.bus[: 3 if twin.bus.access else 2]
        names += twin.strobe_values
        want += twin.strobe_values.values()
        if self.clock % 16 == 0 or any(twin.strobes) or self.done_clock == self.clock:
            names += vars(twin.counters)
            want += vars(twin.counters).values()
        got = [as_integer(getattr(dut, f"{name}_o")) for name in names]
        assert got == [int(value) for value in want], (
            f"clock {self.clock}, {self.inputs}: {names} {got}, want {want}"
        )
        self.alive += twin.alive
        for strobe in STROBES:
            if strobe in twin.strobes:
                self.events.append((strobe, dict(twin.strobe_values)))

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on, with an answer to each access after its time, and with what is sent kept."""
        for _ in range(count):
            answered = self.due == 0
            bus = {"bus_done": answered}
            if answered:
                bus |= {"bus_status": self.answer.status, "bus_data": self.answer.data}
            elif self.draw.random() < 0.1:
                bus |= {"bus_status": int(self.draw.integers(9)), "bus_data": 0x5A5A_5A5A}
            if self.twin.valid and inputs.get("ready", self.inputs["ready"]):
                self.reply.append(self.twin.data)
                if self.twin.last:
                    self.replies.append(bytes(self.reply))
                    self.reply.clear()
            had = self.twin.valid
            if inputs.get("done"):
                self.done_clock = self.clock
            await super().clocks(1, **(bus | inputs))
            if self.twin.valid and not had and not self.reply:
                self.reply_clocks.append(self.clock)
            self.due = self.due - 1 if self.due else None
            if self.twin.bus:
                self.answer = self.registers(self.twin.bus)
                self.due = self.bus_latency

    async def payload(self, payload: bytes, status: int = 0, gap: float = 0) -> None:
        """Give a payload and its frame's end, a byte a clock or with gaps."""
        for byte in payload:
            while self.draw.random() < gap:
                await self.clocks(data=int(self.draw.integers(256)), status=0)
            await self.clocks(valid=1, data=byte)
        await self.clocks(done=1, status=status)

    async def bytes(self, stream: bytes, errors: Iterable[int] = ()) -> None:
        """Give what the decoder makes of these bytes, one a clock."""
        errors = set(errors)
        for k, byte in enumerate(stream):
            await self._decoded(True, byte, k in errors)
        for _ in range(3):
            await self._decoded(False, 0, False)

    async def _decoded(self, valid: bool, byte: int, error: bool) -> None:
        decoder = self.decoder
        inputs = {"valid": decoder.valid, "data": decoder.data, "done": decoder.done}
        await self.clocks(**inputs, status=int(decoder.status))
        decoder.step(valid, byte, error)

    async def rest(self) -> None:
        """Go on until nothing is left to do."""
        for _ in range(200_000):
            await self.clocks()
            if not self.twin.busy and not self.twin.valid:
                break
        else:
            raise AssertionError("it is busy for ever")
        await self.clocks(16 - self.clock % 16)

    async def asked(self, payload: bytes, status: int = 0) -> bytes:
        """Return the one reply to a payload."""
        self.replies.clear()
        self.events.clear()
        self.alive = 0
        await self.payload(payload, status)
        await self.rest()
        assert len(self.replies) == 1, self.replies
        return self.replies[0]


async def begin(dut) -> Bench:
    await reset(dut)
    bench = Bench(dut)
    await bench.start()
    return bench


@cocotb.test()
async def every_command_with_every_status(dut) -> None:
    """Replies and strobes as the protocol has them, written out."""
    bench = await begin(dut)
    data = bytes(range(100, 140))
    big = u32(*range(0x01020304, 0x01020304 + 62))
    cases: list[tuple[bytes, bytes, list]] = [
        (bytes([PING, 7]), bytes([0x81, 7, OK]), []),
        (bytes([PING, 8, 0]), bytes([0x81, 8, OK, 0]), []),
        (bytes([PING, 9]) + data, bytes([0x81, 9, OK]) + data, []),
        (bytes([PING, 10]) + bytes(253), bytes([0x81, 10, OK]) + bytes(253), []),
        (bytes([PING, 10]) + bytes(254), bytes([0x81, 10, LENGTH]), []),
        (bytes([PING]), bytes([0x81, 0, LENGTH]), []),
        (write(1, FIRST, 0xA1B2C3D4), bytes([0x83, 1, OK, 1]) + u32(0xA1B2C3D4), []),
        (read(2, FIRST, 1), bytes([0x82, 2, OK, 1]) + u32(0xA1B2C3D4), []),
        (bytes([WRITE, 3]) + u16(FIRST) + big, bytes([0x83, 3, OK, 62]) + big, []),
        (read(4, FIRST, 62), bytes([0x82, 4, OK, 62]) + big, []),
        (read(5, FIRST + 61, 2), bytes([0x82, 5, OK, 2]) + big[-4:] + bytes(4), []),
        (read(6, FIRST, 0), bytes([0x82, 6, LENGTH]), []),
        (read(6, FIRST, 63), bytes([0x82, 6, LENGTH]), []),
        (read(6, FIRST, 62 + 64), bytes([0x82, 6, LENGTH]), []),
        (write(6, FIRST), bytes([0x83, 6, LENGTH]), []),
        (write(6, FIRST, *[1] * 63), bytes([0x83, 6, LENGTH]), []),
        (read(7, NOTHING, 1), bytes([0x82, 7, NO_ADDRESS, 0]) + u16(NOTHING), []),
        (
            read(7, FIRST + COUNT - 3, 9),
            bytes([0x82, 7, NO_ADDRESS, 0]) + u16(FIRST + COUNT),
            [],
        ),
        (read(7, 0xFFFF, 2), bytes([0x82, 7, NO_ADDRESS, 0, 0xFF, 0xFF]), []),
        (read(8, READ_ONLY, 1), bytes([0x82, 8, OK, 1]) + u32(0xFEEDF00D), []),
        (write(9, NOTHING, 1), bytes([0x83, 9, NO_ADDRESS, 0]) + u16(NOTHING), []),
        (write(9, READ_ONLY, 1), bytes([0x83, 9, RO, 0]) + u16(READ_ONLY), []),
        (write(9, LOCKED, 1), bytes([0x83, 9, LOCK, 0]) + u16(LOCKED), []),
        (write(9, SMALL, 100), bytes([0x83, 9, VALUE, 0]) + u16(SMALL), []),
        (write(9, SMALL, 99), bytes([0x83, 9, OK, 1]) + u32(99), []),
        (
            bytes([START, 11, 1, 200]),
            bytes([0x90, 11, OK]),
            [("stream_start", {"stream_format": 1, "stream_step": 200})],
        ),
        (
            bytes([START, 12, 0, 1]),
            bytes([0x90, 12, OK]),
            [("stream_start", {"stream_format": 0, "stream_step": 1})],
        ),
        (bytes([START, 13, 2, 1]), bytes([0x90, 13, VALUE]), []),
        (bytes([START, 13, 0, 0]), bytes([0x90, 13, VALUE]), []),
        (bytes([START, 13, 0]), bytes([0x90, 13, LENGTH]), []),
        (bytes([STOP, 14]), bytes([0x91, 14, OK]), [("stream_stop", {})]),
        (bytes([STOP, 14, 0]), bytes([0x91, 14, LENGTH]), []),
        (
            bytes([CAPTURE, 15, 1]) + u32(0),
            bytes([0x92, 15, OK]),
            [("capture_start", {"capture_mode": 1, "capture_argument": 0})],
        ),
        (
            bytes([CAPTURE, 16, 2]) + u32(0xFFEEDDCC),
            bytes([0x92, 16, OK]),
            [("capture_start", {"capture_mode": 2, "capture_argument": 0xFFEEDDCC})],
        ),
        (
            bytes([CAPTURE, 17, 3]) + u32(1 << 31),
            bytes([0x92, 17, OK]),
            [("capture_start", {"capture_mode": 3, "capture_argument": 1 << 31})],
        ),
        (bytes([CAPTURE, 18, 3]) + u32(0), bytes([0x92, 18, VALUE]), []),
        (bytes([CAPTURE, 18, 4]) + u32(1), bytes([0x92, 18, VALUE]), []),
        (bytes([CAPTURE, 18, 1]) + u32(1)[:3], bytes([0x92, 18, LENGTH]), []),
        (
            bytes([CAPTURE, 19, 0]) + u32(5),
            bytes([0x92, 19, OK]),
            [("capture_start", {"capture_mode": 0, "capture_argument": 5})],
        ),
        (bytes([0, 20, 1]), bytes([0x80, 20, UNKNOWN]), []),
        (bytes([0x7F, 21]), bytes([0xFF, 21, UNKNOWN]), []),
        (bytes([0x81, 22]), bytes([0x81, 22, UNKNOWN]), []),
        (bytes([0xF1]), bytes([0xF1, 0, UNKNOWN]), []),
    ]
    bad = 0
    for payload, reply, events in cases:
        assert await bench.asked(payload) == reply, payload.hex()
        told = [
            (name, {k: v for k, v in beside.items() if k.startswith(name.split("_")[0])})
            for name, beside in bench.events
            if name != "stream_stop"
        ]
        want = [event for event in events if event[0] != "stream_stop"]
        assert told == want and len(bench.events) == len(events), payload.hex()
        assert bench.alive == (reply[2] not in (UNKNOWN, LENGTH)), payload.hex()
        bad += reply[2] in (UNKNOWN, LENGTH)
        assert bench.twin.counters.commands_bad == bad
    assert bench.twin.counters.frames_good == len(cases)

    bench.give(capture_busy=1)
    for mode in (1, 2, 3):
        reply = await bench.asked(bytes([CAPTURE, 30, mode]) + u32(9))
        assert reply == bytes([0x92, 30, BUSY]) and not bench.events and bench.alive
    assert await bench.asked(bytes([CAPTURE, 31, 0]) + u32(9)) == bytes([0x92, 31, OK])
    assert bench.events[0][1]["capture_mode"] == 0

    for status in range(1, 6):
        for payload in (b"", write(0, FIRST, 1)):
            reply = await bench.asked(payload, status)
            assert reply == bytes([0xFF, 0, FRAME, status]) and not bench.alive
    assert all(getattr(bench.twin.counters, name) >= 2 for name in FRAME_COUNTERS.values())
    assert bench.registers.words[FIRST] == 0x01020304


@cocotb.test()
async def every_length_of_every_command(dut) -> None:
    """Only the right ones do anything; a register is never touched by a wrong one."""
    bench = await begin(dut)
    right = {
        PING: range(2, 256),
        READ: [5],
        WRITE: range(8, 253, 4),
        START: [4],
        STOP: [2],
        CAPTURE: [7],
        0x04: [],
    }
    for op, lengths in right.items():
        for length in [*range(1, 20), 31, 32, 63, 64, 65, 127, 128, *range(247, 257)]:
            payload = (bytes([op, length & 0xFF]) + u16(FIRST) + bytes([1]) * 252)[:length]
            before = len(bench.registers.accesses)
            reply = await bench.asked(payload)
            assert reply[:2] == bytes([op | 0x80, length & 0xFF if length > 1 else 0])
            if length in lengths:
                assert reply[2] == (VALUE if op == START and payload[2] > 1 else OK)
            else:
                assert reply[2:] == bytes([UNKNOWN if op == 4 else LENGTH])
                assert not bench.events and len(bench.registers.accesses) == before


@cocotb.test()
async def all_words_or_none(dut) -> None:
    """A word that is refused, at any place: no other is written, and its address is told."""
    bench = await begin(dut)
    for bad, value, status in ((READ_ONLY, 0, RO), (NOTHING, 0, NO_ADDRESS)):
        for place in (0, 1, 5):
            base = bad - place
            for k in range(place):
                bench.registers.words[base + k] = 17
            before = dict(bench.registers.words)
            bench.registers.accesses.clear()
            reply = await bench.asked(write(place, base, *[value] * 8))
            assert reply == bytes([0x83, place, status, 0]) + u16(bad)
            assert bench.registers.words == before
            assert [a.access for a in bench.registers.accesses] == [1] * (place + 1)
    # Only its value is wrong; and a word in front of it that is right.
    reply = await bench.asked(write(1, DOOR, 5, 100))
    assert reply == bytes([0x83, 1, VALUE, 0]) + u16(SMALL) and bench.registers.words[DOOR] == 0
    # All are good until the first one is written.
    reply = await bench.asked(write(2, KEY, 1, 5, 6))
    assert reply == bytes([0x83, 2, LOCK, 0]) + u16(DOOR)
    assert [bench.registers.words[a] for a in (KEY, DOOR, SMALL)] == [1, 0, 0]


@cocotb.test()
async def latency_of_every_kind(dut) -> None:
    """From the frame's end to the reply, for any latency of the bus."""
    bench = await begin(dut)
    longest = 0
    for bus_latency in (0, 1, 9):
        for payload, status in (
            (bytes([PING, 1]), OK),
            (bytes([PING, 1, 2]), OK),
            (bytes([PING, 1]) + bytes(253), OK),
            (read(1, FIRST, 1), OK),
            (read(1, FIRST, 62), OK),
            (read(1, FIRST + COUNT - 2, 3), NO_ADDRESS),
            (read(1, NOTHING, 1), NO_ADDRESS),
            (write(1, FIRST, 1), OK),
            (write(1, FIRST, *range(62)), OK),
            (write(1, FIRST + COUNT - 2, *range(6)), NO_ADDRESS),
            (write(1, KEY, 1, 2, 3), LOCK),
            (bytes([START, 1, 1, 1]), OK),
            (bytes([STOP, 1]), OK),
            (bytes([STOP, 1]), FRAME),
            (bytes([STOP]), LENGTH),
            (bytes([9, 9]), UNKNOWN),
        ):
            await bench.start()
            bench.bus_latency = bus_latency
            reply = await bench.asked(payload, int(status == FRAME) * 3)
            assert reply[2] == status
            outcome = answer(payload, BusRegisters())
            if status == FRAME:
                outcome = type(outcome)(FRAME, reply)
            clocks = latency(payload, outcome, len(bench.registers.accesses), bus_latency)
            assert bench.reply_clocks == [bench.done_clock + clocks], (payload.hex(), bus_latency)
            longest = max(longest, clocks)
    print(f"longest command, bus of 9 clocks: {longest} clocks")


@cocotb.test()
async def commands_back_to_back(dut) -> None:
    """Seven wait for a reply that nobody takes; what comes then is lost, counted, and no harm."""
    bench = await begin(dut)
    bench.give(ready=0)
    sent = [write(k, FIRST + k, k, 2 * k) for k in range(PLACES + 4)]
    for payload in sent:
        await bench.payload(payload)
    await bench.clocks(1000)
    assert bench.twin.counters.commands_lost == 3
    for payload in sent:
        await bench.payload(payload)
    assert bench.twin.counters.commands_lost == 3 + len(sent)
    bench.give(ready=1)
    await bench.rest()
    # The first one's reply waits apart from the seven.
    want = [bytes([0x83, p[1], OK, 2]) + p[4:] for p in sent[: PLACES + 1]]
    assert bench.replies == want
    assert await bench.asked(bytes([PING, 77])) == bytes([0x81, 77, OK])
    assert bench.twin.counters.commands_lost == 3 + len(sent)
    assert bench.twin.counters.frames_good == 2 * len(sent) + 1


@cocotb.test()
async def bad_frames_take_no_place_of_a_command(dut) -> None:
    """Any number of them, while a reply waits: three commands still have theirs."""
    bench = await begin(dut)
    bench.give(ready=0)
    for k in range(40):
        await bench.payload(bytes(k % 5), 1 + k % 5)
    await bench.clocks(40)
    for k in range(40):
        await bench.payload(bytes(k % 5), 1 + k % 5)
    for k in range(PLACES - BAD_FRAME_PLACES + 1):
        await bench.payload(bytes([PING, k]))
    bench.give(ready=1)
    await bench.rest()
    told = [reply for reply in bench.replies if reply[0] == 0xFF]
    assert len(told) == BAD_FRAME_PLACES + 1
    assert bench.replies[-3:] == [bytes([0x81, k, OK]) for k in range(3)]
    assert bench.twin.counters.commands_lost == 1
    assert sum(vars(bench.twin.counters).values()) == 80 + 4 + 1


@cocotb.test()
async def frames_cut_at_every_length(dut) -> None:
    """What is left of a frame is told to be bad, and the command behind it is answered."""
    bench = await begin(dut)
    for whole in (
        frame(write(5, FIRST, 0, 0x01010101)),
        frame(bytes([PING, 6]) + bytes(9)),
        frame(bytes([CAPTURE, 5, 2]) + u32(0)),
    ):
        for cut in range(1, len(whole) - 1):
            for end in (whole[:cut] + b"\0", b"\0" + whole[cut:]):
                bench.replies.clear()
                before = dict(bench.registers.words)
                await bench.bytes(end)
                await bench.bytes(b"\0" + frame(bytes([PING, cut])))
                await bench.rest()
                good = bytes([0x81, cut, OK])
                assert [r for r in bench.replies if r[0] != 0xFF] == [good], whole[:cut].hex()
                assert len(bench.replies) == 2 and bench.replies[-1] == good
                assert bench.registers.words == before and not bench.events


@cocotb.test()
async def random_bytes_between_commands(dut) -> None:
    """A byte a clock, some more of them zero; commands in between are answered exactly."""
    bench = await begin(dut)
    total = 0
    number = 0
    words = dict(bench.registers.words)
    most = rounds(25_000, 250_000)
    while total < most:
        noise = random_bytes(
            bench.draw, int(bench.draw.integers(1, 700)), float(bench.draw.choice([0, 0.01, 0.1]))
        )
        # A frame of it that is good would be a command: one in 2**16 has a CRC that fits.
        assert all(is_good(piece) is None for piece in noise.split(b"\0") if piece)
        total += len(noise)
        await bench.bytes(noise, np.flatnonzero(bench.draw.random(len(noise)) < 0.001))
        if bench.draw.random() < 0.5:
            await bench.clocks(int(bench.draw.integers(100)))
        at = FIRST + number % COUNT
        if number % 3 == 0:
            value = int(bench.draw.integers(1 << 32))
            command, data = write(number % 256, at, value), u32(value)
            words[at] = value
        else:
            command, data = read(number % 256, at, 1), u32(words[at])
        await bench.bytes(b"\0" + frame(command))
        await bench.rest()
        good = [reply for reply in bench.replies if reply[0] != 0xFF]
        assert good == [bytes([command[0] | 0x80, number % 256, OK, 1]) + data]
        assert all(len(r) == 4 and r[:3] == b"\xff\0\x08" for r in bench.replies if r not in good)
        bench.replies.clear()
        number += 1
    counters = bench.twin.counters
    assert bench.registers.words == words
    assert counters.frames_good == number > most // 500
    assert counters.commands_lost == counters.commands_bad == 0
    assert counters.frames_malformed > most // 100 and counters.frames_framing > most // 10_000
    print(f"{total} random bytes, {number} commands, bad frames: {counters}")


@cocotb.test()
async def halt_at_every_age(dut) -> None:
    """What waits is dropped, what is executed goes on; a stop and a capture's end come at once."""
    bench = await begin(dut)
    for age in range(120):
        await bench.start()
        for k in range(4):
            await bench.payload(write(k, FIRST + k, k + 1))
        await bench.payload(bytes([START, 9, 0, 1]))
        await bench.clocks(age)
        bench.events.clear()
        await bench.clocks(halt=1)
        assert {name for name, _ in bench.events} >= {"stream_stop", "capture_start"}
        assert bench.events[-1][1]["capture_mode"] == 0
        await bench.payload(write(8, FIRST + 8, 80))
        await bench.payload(bytes([PING, 9]))
        await bench.rest()
        assert [r[1] for r in bench.replies][-2:] == [8, 9] and len(bench.replies) < 7
        assert bench.registers.words[FIRST + 8] == 80
    # In the very clock in which a stream would start, and a frame ends.
    for age in range(20):
        await bench.start()
        await bench.payload(bytes([START, 9, 1, 2]))
        await bench.clocks(age)
        await bench.clocks(valid=1, data=PING)
        await bench.clocks(valid=1, data=age)
        await bench.clocks(halt=1, done=1, status=0)
        await bench.rest()
        assert bench.replies[-1] == bytes([0x81, age, OK])
    # While one is executed, the places behind a halt are fewer, and none is written over.
    await bench.start()
    bench.bus_latency = 800
    for k in range(5):
        await bench.payload(write(k, FIRST, 1))
    await bench.clocks(halt=1)
    for k in range(10, 20):
        await bench.payload(write(k, FIRST + k, k))
    bench.bus_latency = 2
    await bench.rest()
    assert [r[1] for r in bench.replies] == [0, 10, 11]
    assert bench.twin.counters.commands_lost == 8


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """Nothing of a command is left, wherever it was."""
    bench = await begin(dut)
    for payload in (write(1, FIRST, 1, 2), bytes([PING, 2, 3, 4]), bytes([START, 1, 1, 1])):
        for age in range(110 if payload[0] == WRITE else 45):
            await bench.start()
            await bench.payload(payload)
            await bench.payload(payload)
            await bench.clocks(valid=1, data=9)
            await bench.clocks(age, ready=age % 2)
            await bench.start(valid=1, done=age % 2, bus_done=1, halt=age % 3 == 0)
            await bench.clocks(20)
            assert not bench.replies and not bench.twin.busy
            assert await bench.asked(bytes([PING, age])) == bytes([0x81, age, OK])


@cocotb.test()
async def counters_stop_at_their_largest(dut) -> None:
    """Frames that end in every clock; of those, unknown commands are executed in a row."""
    bench = await begin(dut)
    for status, counter in FRAME_COUNTERS.items():
        await bench.start()
        bench.give(valid=1, data=99, done=1, status=int(status))
        counters = {counter}
        clocks = COUNT_MAX + 5
        if status == FrameStatus.OK:
            counters |= {"commands_bad", "commands_lost"}
            clocks *= 3 + latency(b"\x63", answer(b"\x63", BusRegisters()))
        await Timer(clocks * CLOCK_NS, "ns")
        await FallingEdge(dut.clk_i)
        for name in vars(bench.twin.counters):
            got = as_integer(getattr(dut, f"{name}_o"))
            assert got == (COUNT_MAX if name in counters else 0), (name, got)


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Payloads of all kinds, gaps, slow buses, a reader that waits, halts: as the model."""
    bench = await begin(dut)
    draw = bench.draw
    for _ in range(250):
        if draw.random() < 0.02:
            await bench.start()
        bench.bus_latency = int(draw.integers(4))
        kind = draw.random()
        address = int(draw.choice([FIRST, FIRST + COUNT - 2, READ_ONLY - 1, KEY, NOTHING, 0xFFFF]))
        words = [int(v) for v in draw.integers(0, 150, int(draw.integers(1, 8)))]
        if kind < 0.3:
            payload = write(int(draw.integers(256)), address, *words)
        elif kind < 0.6:
            payload = read(int(draw.integers(256)), address, int(draw.integers(8)))
        elif kind < 0.8:
            payload = bytes([int(draw.choice(OPS)), *draw.integers(0, 5, int(draw.integers(8)))])
        else:
            payload = bytes(draw.integers(0, 256, int(draw.integers(1, 40))).tolist())
        status = int(draw.integers(1, 6)) if draw.random() < 0.1 else 0
        await bench.payload(payload, status, float(draw.choice([0, 0.5])))
        for _ in range(int(draw.integers(0, 120)) * int(draw.random() < 0.7)):
            await bench.clocks(
                ready=int(draw.random() < 0.7),
                capture_busy=int(draw.random() < 0.3),
                halt=int(draw.random() < 0.002),
            )
    bench.give(ready=1)
    await bench.rest()


@EACH_VOLUME
def test_command_server_rtl_equals_model(volume: str) -> None:
    simulate("command_server", __file__, volume=volume)


# ---- the model alone ----


def test_a_write_checks_all_words_before_the_first_is_written() -> None:
    registers = BusRegisters()
    outcome = answer(write(3, FIRST, 5, 6), registers)
    assert outcome.reply == bytes([0x83, 3, OK, 2]) + u32(5, 6)
    checks = [Access(1, FIRST, 5), Access(1, FIRST + 1, 6)]
    writes = [Access(2, FIRST, 5), Access(2, FIRST + 1, 6)]
    assert registers.accesses == checks + writes


def test_addresses_wrap() -> None:
    seen = []

    def registers(access: Access) -> Answer:
        seen.append(access.address)
        return Answer(OK, 1)

    assert answer(read(1, 0xFFFF, 3), registers).status == OK
    assert seen == [0xFFFF, 0, 1]


@pytest.mark.parametrize("count", [1, 62])
def test_the_longest_payload_holds_every_command_and_reply(count: int) -> None:
    command = write(0, FIRST, *[1] * count)
    reply = answer(command, BusRegisters()).reply
    assert len(command) == len(reply) == 4 + 4 * count <= link_pkg.MAX_PAYLOAD
