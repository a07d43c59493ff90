"""command_executor: every clock of the RTL against the model, every reply against the protocol."""

from collections import deque

import cocotb
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
from cocotb.triggers import FallingEdge
from command_bench import (
    BUSY,
    CAPTURE,
    FRAME,
    LENGTH,
    LOCK,
    NO_ADDRESS,
    OK,
    PING,
    READ,
    RO,
    START,
    STOP,
    UNKNOWN,
    VALUE,
    WRITE,
    CommandBench,
    random_payload,
    read,
    u16,
    u32,
    write,
)
from harness import as_integer, parameters, simulate

from vrscan.clocked.command_executor import Access, Answer, CommandExecutor, latency
from vrscan.clocked.command_queue import Frame
from vrscan.clocked.command_server import answer
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.data import link_pkg

NOTHING_KEPT = Frame(FrameStatus.OK, b"")


class Bench(CommandBench):
    """Keeps the frames as the queue would: each until the executor has let go of it."""

    outputs = (*CommandBench.outputs, "take", "release")

    def __init__(self, dut) -> None:
        super().__init__(dut, {"waits": 0, "status": 0, "length": 0, "byte": 0})
        self.edge = FallingEdge(dut.clk_i)

    async def start(self, **inputs: int) -> None:
        """Reset for a clock; no frame waits."""
        self.frames: deque[Frame] = deque()
        self.taken = False
        self.index = self.index_before = 0
        self.begun_clock = 0
        await self.begin(CommandExecutor(parameters()["CountWidth"]), **inputs)

    def want(self) -> list[int]:
        twin, inputs = self.twin, self.inputs
        takes = twin.takes(waits=bool(inputs["waits"]), halt=bool(inputs["halt"]))
        return [*super().want(), takes, twin.release]

    def counters(self) -> dict[str, int]:
        return {"commands_bad": self.twin.commands_bad}

    async def clock_with(self, **inputs: int) -> None:
        frame = self.frames[0] if self.frames else NOTHING_KEPT
        payload, index = frame.payload, self.index_before
        # Behind the end of the payload are bytes of an older one.
        byte = payload[index] if index < len(payload) else index * 37 & 0xFF
        waits = len(self.frames) > self.taken
        self.give(waits=waits, status=frame.status, length=len(payload), byte=byte, **inputs)
        now, twin = self.inputs, self.twin
        taken, released = twin.takes(waits=waits, halt=bool(now["halt"])), twin.release
        await self.edge
        twin.step(
            waits=waits,
            frame=frame,
            halt=bool(now["halt"]),
            ready=bool(now["ready"]),
            bus_done=bool(now["bus_done"]),
            bus_status=now["bus_status"],
            bus_data=now["bus_data"],
            capture_busy=bool(now["capture_busy"]),
        )
        self.clock += 1
        self.index_before, self.index = self.index, as_integer(self.dut.index_o)
        if taken:
            self.taken, self.begun_clock = True, self.clock - 1
        if released:
            self.frames.popleft()
            self.taken = False
        self.check()
        self.give(**dict.fromkeys(self.strobes, 0))

    async def payload(self, payload: bytes, status: int = 0) -> None:
        self.frames.append(Frame(FrameStatus(status), payload))


@cocotb.test()
async def every_command_with_every_status(dut) -> None:
    """Replies and strobes as the protocol has them, written out."""
    bench = await Bench.started(dut)
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
        (
            bytes([START, 12, 2, 9]),
            bytes([0x90, 12, OK]),
            [("stream_start", {"stream_format": 2, "stream_step": 9})],
        ),
        (bytes([START, 13, 3, 1]), bytes([0x90, 13, VALUE]), []),
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
    bad, top = 0, (1 << parameters()["CountWidth"]) - 1
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
        assert bench.twin.commands_bad == min(bad, top), "it stops at its largest value"
    assert bad > top

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
    assert bench.registers.words[FIRST] == 0x01020304


@cocotb.test()
async def every_length_of_every_command(dut) -> None:
    """Only the right ones do anything; a register is never touched by a wrong one."""
    bench = await Bench.started(dut)
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
    bench = await Bench.started(dut)
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
    """From a frame that waits to the reply, for any latency of the bus."""
    bench = await Bench.started(dut)
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
            assert bench.reply_clocks == [bench.begun_clock + clocks], (payload.hex(), bus_latency)
            longest = max(longest, clocks)
    print(f"longest command, bus of 9 clocks: {longest} clocks")


@cocotb.test()
async def halt_at_every_age(dut) -> None:
    """What is executed goes on, nothing is begun; a stop and a capture's end come at once."""
    bench = await Bench.started(dut)
    for payload in (write(1, FIRST, 80), bytes([START, 1, 1, 2]), bytes([CAPTURE, 1, 1]) + u32(3)):
        for age in range(60 if payload[0] == WRITE else 30):
            await bench.start()
            await bench.payload(payload)
            await bench.payload(bytes([PING, 9]))
            await bench.clocks(age)
            bench.events.clear()
            await bench.clocks(halt=1)
            assert [name for name, _ in bench.events] == ["stream_stop", "capture_start"]
            assert bench.events[-1][1]["capture_mode"] == 0
            await bench.rest()
            assert bench.replies == [
                bytes([payload[0] | 0x80, 1, OK])
                + (bytes([1]) + u32(80) if payload[0] == WRITE else b""),
                bytes([0x81, 9, OK]),
            ]
    await bench.payload(bytes([PING, 1]))
    for _ in range(20):
        await bench.clocks(halt=1)
    assert not bench.taken


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """Nothing of a command is left, wherever it was."""
    bench = await Bench.started(dut)
    for payload in (write(1, FIRST, 1, 2), bytes([PING, 2, 3, 4]), bytes([START, 1, 1, 1])):
        for age in range(1, 95 if payload[0] == WRITE else 35):
            await bench.start()
            await bench.payload(payload)
            await bench.clocks(age, ready=age % 2)
            await bench.start(waits=1, bus_done=1, halt=age % 3 == 0)
            await bench.clocks(5)
            assert not bench.replies and not bench.twin.busy
            assert await bench.asked(bytes([PING, age])) == bytes([0x81, age, OK])


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Payloads of all kinds, slow buses, a reader that waits, halts: as the model."""
    bench = await Bench.started(dut)
    draw = bench.draw
    for _ in range(250):
        if draw.random() < 0.02:
            await bench.start()
        bench.bus_latency = int(draw.integers(4))
        await bench.payload(
            random_payload(draw), int(draw.integers(1, 6)) if draw.random() < 0.1 else 0
        )
        for _ in range(int(draw.integers(0, 120)) * int(draw.random() < 0.7)):
            await bench.clocks(
                ready=int(draw.random() < 0.7),
                capture_busy=int(draw.random() < 0.3),
                halt=int(draw.random() < 0.002),
            )
    bench.give(ready=1)
    await bench.rest()


def test_command_executor_rtl_equals_model() -> None:
    simulate("command_executor", __file__, {"CountWidth": 3})


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
