"""command_server: every clock of the RTL against the model, from frames to replies."""

from collections.abc import Iterable

import cocotb
import numpy as np
from bus_registers import COUNT, FIRST, BusRegisters
from cocotb.triggers import FallingEdge, Timer
from command_bench import (
    CAPTURE,
    OK,
    PING,
    START,
    STOP,
    WRITE,
    CommandBench,
    random_payload,
    read,
    u32,
    write,
)
from frame_oracle import frame, is_good, random_bytes
from harness import CLOCK_NS, EACH_VOLUME, as_integer, rounds, simulate

from vrscan.clocked.command_queue import BAD_FRAME_PLACES, PLACES
from vrscan.clocked.command_server import CommandServer, answer, latency
from vrscan.clocked.frame_decoder import FrameDecoder
from vrscan.data import link_pkg

COUNT_MAX = 0xFFFF


class Bench(CommandBench):
    """Gives payloads or frames."""

    strobes = ("valid", "done", *CommandBench.strobes)

    def __init__(self, dut) -> None:
        super().__init__(dut, {"valid": 0, "data": 0, "done": 0, "status": 0})

    async def start(self, **inputs: int) -> None:
        """Reset for a clock; the registers are new ones, too."""
        self.done_clock = 0
        self.decoder = FrameDecoder(link_pkg.MAX_PAYLOAD)
        await self.begin(CommandServer(), **inputs)

    async def payload(self, payload: bytes, status: int = 0, gap: float = 0) -> None:
        """Give a payload and its frame's end, a byte a clock or with gaps."""
        for byte in payload:
            while self.draw.random() < gap:
                await self.clocks(data=int(self.draw.integers(256)), status=0)
            await self.clocks(valid=1, data=byte)
        self.done_clock = self.clock
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


@cocotb.test()
async def latency_from_the_end_of_a_frame(dut) -> None:
    """One clock more than the executor's."""
    bench = await Bench.started(dut)
    for payload in (
        bytes([PING, 1, 2]),
        read(1, FIRST, 3),
        write(1, FIRST, 1, 2),
        bytes([STOP, 1]),
    ):
        await bench.start()
        reply = await bench.asked(payload)
        outcome = answer(payload, BusRegisters())
        assert reply == outcome.reply
        clocks = latency(payload, outcome, len(bench.registers.accesses), bench.bus_latency)
        assert bench.reply_clocks == [bench.done_clock + clocks], payload.hex()


@cocotb.test()
async def commands_back_to_back(dut) -> None:
    """Seven wait for a reply that nobody takes; what comes then is lost, counted, and no harm."""
    bench = await Bench.started(dut)
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
    bench = await Bench.started(dut)
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
    bench = await Bench.started(dut)
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
    bench = await Bench.started(dut)
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
    bench = await Bench.started(dut)
    for age in range(0, 120, rounds(4, 1)):
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
    for age in range(0, 20, rounds(2, 1)):
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
    bench = await Bench.started(dut)
    for payload in (write(1, FIRST, 1, 2), bytes([PING, 2, 3, 4]), bytes([START, 1, 1, 1])):
        for age in range(0, 110 if payload[0] == WRITE else 45, rounds(5, 1)):
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
    """At 2**16 - 1, with frames that end in every clock: each is a command, or lost."""
    bench = await Bench.started(dut)
    bench.give(done=1)
    await Timer((COUNT_MAX + 5000) * CLOCK_NS, "ns")
    await FallingEdge(dut.clk_i)
    for name in ("frames_good", "commands_lost"):
        assert as_integer(getattr(dut, f"{name}_o")) == COUNT_MAX, name
    await bench.start()


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Payloads of all kinds, gaps, slow buses, a reader that waits, halts: as the model."""
    bench = await Bench.started(dut)
    draw = bench.draw
    for _ in range(rounds(80, 250)):
        if draw.random() < 0.02:
            await bench.start()
        bench.bus_latency = int(draw.integers(4))
        status = int(draw.integers(1, 6)) if draw.random() < 0.1 else 0
        await bench.payload(random_payload(draw), status, float(draw.choice([0, 0.5])))
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
