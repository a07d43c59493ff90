"""line_capture: every clock of the RTL against the model, every packet against the lines."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    Ports,
    TwinBench,
    each,
    generator,
    parameters,
    rounds,
    simulate,
)
from random_records import random_records

from vrscan.clocked.line_capture import BETWEEN, LATENCY, LineCapture, record_clks
from vrscan.data import pkg
from vrscan.data.link_pkg import (
    CAPTURE_EVERY,
    CAPTURE_LINE,
    CAPTURE_NEXT,
    CAPTURE_STOP,
    FULL_BYTES,
    STREAM_CAPTURE_PIXELS,
    STREAM_CAPTURE_RECORD,
)
from vrscan.fixed import peak_neighbours, point_record
from vrscan.fixed.vrscan_chain import MAX_WINDOW, latency

ELABORATIONS = [
    {"LineLength": 230, "PixelWidth": 12},
    {"LineLength": 64, "PixelWidth": 16},
    {"LineLength": 2048, "PixelWidth": 8},
]
OUTPUTS = ("valid", "capture_busy", "data", "last")
OUTPUTS_OF = attrgetter(*OUTPUTS)
QUIET = {
    "line_start": 0,
    "line_end": 0,
    "pixel_valid": 0,
    "pixel": 0,
    "record_valid": 0,
    "record_index": 0,
    "record": 0,
    "ready": 1,
    "capture_start": 0,
    "capture_mode": 0,
    "capture_argument": 0,
}
Captured = tuple[int, list[int], bytes | None]  # line, pixels, record


@dataclass
class Line:
    """What a sensor sends for a line."""

    pixels: Sequence[int]
    end: bool = True
    gaps: bool = False


def is_large() -> bool:
    """Return whether the line is the shipped one; the small ones have the most of the work."""
    return parameters()["LineLength"] > 300


class Bench(TwinBench):
    """Sends lines and records, and puts the packets together."""

    strobes = ("capture_start",)

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)
        self.length = parameters()["LineLength"]
        self.width = parameters()["PixelWidth"]
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS])
        self.ready = 1.0  # how often the other end takes a byte
        self.reads = True

    def check(self) -> None:
        got, want = self.outputs.read(), OUTPUTS_OF(self.twin)
        if not self.twin.valid:
            got, want = got[:2], want[:2]
        assert got == want, f"clock {self.clock}, {self.inputs}: {OUTPUTS} {got}, want {want}"

    async def start(self, **inputs: int) -> None:
        self.number = 0  # of the next line
        self.packet = bytearray()
        self.pixels: list[int] = []
        self.sequences = {STREAM_CAPTURE_PIXELS: 0, STREAM_CAPTURE_RECORD: 0}
        self.captured: list[Captured] = []
        self.records = {}
        await self.reset_to(LineCapture(self.length), **(QUIET | inputs))
        self.check()

    async def tick(self, count: int = 1, **inputs: int) -> None:
        """Go on, with a reader that is as willing as ``ready`` says."""
        self.give(**inputs)
        for _ in range(count):
            ready = self.ready >= 1 or self.draw.random() < self.ready
            if self.twin.valid and ready and self.reads:
                self.packet.append(self.twin.data)
                if self.twin.last:
                    self.read(bytes(self.packet))
                    self.packet.clear()
            await self.clocks(ready=int(ready))

    def read(self, packet: bytes) -> None:
        """Take a packet apart."""
        kind, sequence, first, second = packet[:4]
        line = int.from_bytes(packet[4:8], "little")
        assert sequence == self.sequences[kind]
        self.sequences[kind] = (sequence + 1) % 256
        if kind == STREAM_CAPTURE_PIXELS:
            assert first * 100 == len(self.pixels)
            assert second == min(100, self.length - first * 100)
            assert len(packet) == 8 + 2 * second
            self.pixels += np.frombuffer(packet[8:], "<u2").tolist()
        else:
            assert kind == STREAM_CAPTURE_RECORD and second == 0
            assert len(packet) == (8 if first else 72) and first in (0, 1)
            assert len(self.pixels) in (0, self.length)
            self.captured.append((line, self.pixels, packet[8:] or None))
            self.pixels = []

    def line(self, *, gaps: bool = False, length: int | None = None, end: bool = True) -> Line:
        """Return a line of random pixels."""
        count = self.length if length is None else length
        return Line(self.draw.integers(1 << self.width, size=count).tolist(), end, gaps)

    async def send(self, line: Line, **inputs: int) -> int:
        """Send a line, with ``inputs`` in its first clock, and return its number."""
        number = self.number
        self.number = (self.number + 1) % (1 << 32)
        gap = line.gaps and self.draw.random() < 0.5
        if gap:
            await self.tick(line_start=1, pixel_valid=0, pixel=1, line_end=0, **inputs)
            inputs = {}
        for k, pixel in enumerate(line.pixels):
            while line.gaps and self.draw.random() < 0.2:
                await self.tick(pixel_valid=0, pixel=pixel ^ 1, line_start=0, line_end=0, **inputs)
            last = k == len(line.pixels) - 1 and line.end and not gap
            await self.tick(
                line_start=int(k == 0 and not gap),
                line_end=int(last),
                pixel_valid=1,
                pixel=pixel,
                **inputs,
            )
            inputs = {}
        if gap and line.end:
            await self.tick(pixel_valid=0, line_start=0, line_end=1, **inputs)
        # Blanking.
        await self.tick(2, line_start=0, line_end=0, pixel_valid=1, pixel=3)
        return number

    async def record(self, number: int) -> bytes:
        """Give a record of a line, then other values on the ports, and return it."""
        data = random_records(self.draw, [number])[0].tobytes()
        for index, byte in enumerate(data):
            await self.tick(record_valid=1, record_index=index, record=byte)
        await self.tick(record_valid=0, record_index=5, record=int(self.draw.integers(256)))
        return data

    async def call(self, mode: int, argument: int = 0) -> None:
        """Start a capture, and check that it says so in time."""
        await self.tick(capture_start=1, capture_mode=mode, capture_argument=argument)
        other = int(self.draw.integers(1 << 32))
        await self.tick(2, capture_mode=mode ^ 3, capture_argument=other)
        assert self.twin.capture_busy

    async def drain(self) -> list[Captured]:
        """Wait for the end of the capture and return what it has brought."""
        self.ready = 1.0
        while self.twin.capture_busy:
            await self.tick()
        await self.tick(5)
        assert not self.packet and not self.pixels
        captured, self.captured = self.captured, []
        return captured


@cocotb.test()
async def next_line_comes_whole_with_its_record(dut) -> None:
    bench = await Bench.started(dut)
    for trial in range(4 if is_large() else 8):
        bench.ready = (1.0, 0.5, 0.1, 0.9)[trial % 4]
        await bench.call(CAPTURE_NEXT, trial)
        # Two records of lines before it come in between.
        await bench.record(bench.number - 1)
        line = bench.line(gaps=trial % 2 == 1)
        number = await bench.send(line)
        if trial > 2:
            await bench.record(number - 1)
        data = await bench.record(number)
        await bench.record(number + 1)
        assert await bench.drain() == [(number, line.pixels, data)]
        await bench.send(bench.line())


@cocotb.test()
async def packets_follow_each_other_as_stated(dut) -> None:
    bench = await Bench.started(dut)
    await bench.call(CAPTURE_NEXT)
    line = bench.line()
    for k, pixel in enumerate(line.pixels):
        last = k == bench.length - 1
        start = bench.clock
        await bench.tick(line_start=int(k == 0), line_end=int(last), pixel_valid=1, pixel=pixel)
    await bench.tick(LATENCY - 1, line_end=0, pixel_valid=0)
    assert bench.twin.valid and bench.clock - start == LATENCY
    left = bench.length
    while left:
        count = min(left, 100)
        left -= count
        for k in range(8 + 2 * count):
            assert bench.twin.valid and bench.twin.last == (k == 7 + 2 * count)
            await bench.tick()
        if left:
            await bench.tick(BETWEEN - 1)
            assert not bench.twin.valid
            await bench.tick()
    assert not bench.twin.valid and bench.twin.capture_busy
    await bench.record(0)
    assert len(await bench.drain()) == 1


@cocotb.test()
async def bad_lines_are_not_taken(dut) -> None:
    bench = await Bench.started(dut)
    await bench.send(bench.line(length=bench.length - 1, end=False))
    for mode in (CAPTURE_NEXT, CAPTURE_EVERY):
        await bench.call(mode, 1)
        for bad in (-1, 1, 2, -bench.length + 1, -20):
            await bench.send(bench.line(length=bench.length + bad))
            await bench.send(bench.line(length=bench.length + bad, gaps=True))
        # One without an end, too long or too short; the next line's start ends it.
        for bad in (0, -3, 3):
            await bench.send(bench.line(length=bench.length + bad, end=False))
        # A line that has one clock.
        await bench.tick(line_start=1, line_end=1, pixel_valid=1)
        await bench.tick(line_start=0, line_end=0, pixel_valid=0)
        bench.number += 1
        line = bench.line()
        number = await bench.send(line)
        data = await bench.record(number)
        if mode == CAPTURE_EVERY:
            while not bench.captured:
                await bench.tick()
            await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)
            await bench.tick(4)
        assert await bench.drain() == [(number, line.pixels, data)]


@cocotb.test()
async def line_under_way_is_not_taken(dut) -> None:
    bench = await Bench.started(dut)
    for lead in range(6):
        # The start comes with the first pixel of a line, or a few clocks before or after it.
        inputs = {"capture_start": 1, "capture_mode": CAPTURE_NEXT, "capture_argument": 0}
        if lead == 0:
            first = bench.line()
            await bench.send(first, **inputs)
        else:
            await bench.tick(lead - 1)
            await bench.tick(**inputs)
            await bench.tick(lead - 1)
            first = bench.line()
            await bench.send(first)
        second = bench.line()
        number = await bench.send(second)
        if lead < 2:
            data = await bench.record(number)
            assert await bench.drain() == [(number, second.pixels, data)]
        else:
            data = await bench.record(number - 1)
            assert await bench.drain() == [(number - 1, first.pixels, data)]


@cocotb.test()
async def line_of_a_number_is_taken_or_missed(dut) -> None:
    bench = await Bench.started(dut)
    for ahead in (0, 1, 2, 5):
        number = bench.number + ahead
        await bench.call(CAPTURE_LINE, number)
        for _ in range(ahead):
            await bench.send(bench.line(length=70))
        line = bench.line()
        assert await bench.send(line) == number
        data = await bench.record(number)
        assert await bench.drain() == [(number, line.pixels, data)]
    for past in (1, 2, (1 << 31) - 1):
        number = (bench.number - past) % (1 << 32)
        await bench.call(CAPTURE_LINE, number)
        assert await bench.drain() == [(number, [], None)]
    # The farthest that is not past is waited for.
    await bench.call(CAPTURE_LINE, (bench.number + (1 << 31)) % (1 << 32))
    await bench.send(bench.line())
    await bench.tick(50)
    assert bench.twin.capture_busy and not bench.captured
    await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)
    await bench.tick(5)
    # It is bad: short, long, unfinished, of one clock.
    for bad in ("short", "long", "unfinished", "clock"):
        number = bench.number + 1
        await bench.call(CAPTURE_LINE, number)
        await bench.send(bench.line())
        if bad == "clock":
            await bench.tick(line_start=1, line_end=1, pixel_valid=1)
            await bench.tick(line_start=0, line_end=0)
            bench.number += 1
        else:
            length = bench.length + {"short": -1, "long": 1, "unfinished": 0}[bad]
            await bench.send(bench.line(length=length, end=bad != "unfinished"))
        if bad == "unfinished":
            assert bench.twin.capture_busy
            await bench.tick(20)
            assert bench.twin.capture_busy and not bench.captured
            await bench.send(bench.line())
        assert await bench.drain() == [(number, [], None)]
    # The start comes in the clock in which the line does: it is past.
    number = bench.number
    inputs = {"capture_start": 1, "capture_mode": CAPTURE_LINE, "capture_argument": number}
    await bench.send(bench.line(), **inputs)
    assert await bench.drain() == [(number, [], None)]
    # The line starts in the clock behind the start.
    number = bench.number
    await bench.tick(capture_start=1, capture_mode=CAPTURE_LINE, capture_argument=number)
    await bench.send(bench.line())
    assert await bench.drain() == [(number, [], None)]


@cocotb.test()
async def every_nth_line_is_taken_where_there_is_time(dut) -> None:
    bench = await Bench.started(dut)
    for step in (1, 3) if is_large() else (0, 1, 2, 3, 7):
        bench.ready = 1.0
        await bench.call(CAPTURE_EVERY, step)
        await bench.send(bench.line(length=80))
        origin = None
        sent = {}
        for k in range(12 if is_large() else 30):
            bad = bench.draw.random() < 0.2
            line = bench.line(length=bench.length - 1 if bad else None)
            idle = not bench.twin.valid and len(sent) == len(bench.captured)
            if idle:
                await bench.tick(4)
            number = await bench.send(line)
            due = origin is None or (number - origin) % max(step, 1) == 0
            taken = idle and due and not bad
            if taken:
                origin = number
            data = b""
            if not bad:
                data = await bench.record(number)
            if taken:
                sent[number] = (number, line.pixels, data)
                if k % 2:
                    while len(bench.captured) < len(sent):
                        await bench.tick()
        while len(bench.captured) < len(sent):
            await bench.tick()
        assert bench.twin.capture_busy
        await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)
        await bench.tick(4)
        assert await bench.drain() == list(sent.values()) and len(sent) > 1


@cocotb.test()
async def line_numbers_wrap(dut) -> None:
    """The count is set near its end: lines of one clock bring it only a little further."""
    bench = await Bench.started(dut)
    await bench.call(CAPTURE_LINE, (1 << 31) - 1)
    await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)
    await bench.tick(10)
    start = (1 << 32) - 2
    dut.number_q.value = start
    bench.twin._number = start
    bench.number = start
    await bench.call(CAPTURE_LINE, 1)
    for _ in range(3):
        await bench.send(bench.line(length=70))
    line = bench.line()
    assert await bench.send(line) == 1
    await bench.record(0)
    await bench.record((1 << 32) - 1)
    data = await bench.record(1)
    assert await bench.drain() == [(1, line.pixels, data)]
    dut.number_q.value = start
    bench.twin._number = start
    bench.number = start
    await bench.call(CAPTURE_EVERY, 3)
    first = bench.line()
    assert await bench.send(first) == start
    one = await bench.record(start)
    while not bench.captured:
        await bench.tick()
    await bench.tick(3)
    await bench.send(bench.line())
    await bench.send(bench.line())
    second = bench.line()
    assert await bench.send(second) == 1
    # A record of a later line, beyond the wrap: of this one there is none.
    await bench.record(2)
    while len(bench.captured) < 2:
        await bench.tick()
    await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)
    await bench.tick(5)
    assert await bench.drain() == [(start, first.pixels, one), (1, second.pixels, None)]


@cocotb.test()
async def missing_record_ends_the_capture_without_it(dut) -> None:
    bench = await Bench.started(dut)
    # One of a later line: the next, or very much later.
    for ahead in (1, 256, 1 << 16, 1 << 24, (1 << 31) - 1):
        await bench.call(CAPTURE_NEXT)
        line = bench.line()
        number = await bench.send(line)
        # One of a line before it changes nothing.
        for behind in (1, 256, 1 << 16, 1 << 24, (1 << 31) - 1):
            await bench.record(number - behind)
        await bench.record(number + ahead)
        await bench.record(number)
        assert await bench.drain() == [(number, line.pixels, None)]
    # None at all.
    await bench.call(CAPTURE_NEXT)
    line = bench.line()
    number = await bench.send(line)
    start = bench.clock - 3  # of the line's end
    assert await bench.drain() == [(number, line.pixels, None)]
    took = bench.clock - start
    assert 0 <= took - record_clks(bench.length) < 30
    # One that began before its line was taken is not taken for it.
    await bench.call(CAPTURE_NEXT)
    line = bench.line()
    number = bench.number
    data = random_records(bench.draw, [number])[0].tobytes()
    for k, pixel in enumerate(line.pixels):
        ahead = k - bench.length + 10
        await bench.tick(
            line_start=int(k == 0),
            line_end=int(k == bench.length - 1),
            pixel_valid=1,
            pixel=pixel,
            record_valid=int(ahead >= 0),
            record_index=max(ahead, 0),
            record=data[max(ahead, 0)],
        )
    bench.number += 1
    for k in range(10, 64):
        await bench.tick(line_end=0, pixel_valid=0, record_index=k, record=data[k])
    await bench.tick(record_valid=0)
    await bench.tick(50)
    data = await bench.record(number)
    assert await bench.drain() == [(number, line.pixels, data)]


@cocotb.test()
async def record_of_a_fit_comes_however_slow_lines_are(dut) -> None:
    """A fit's point comes with the next line's, or when that one is too late to be a neighbour."""
    bench = await Bench.started(dut)
    late = longest(bench.length, bench.width, window=min(bench.length, MAX_WINDOW))
    clocks = {pkg.FIT_PERIOD, 6000, pkg.NEIGHBOUR_CLKS - 1, pkg.NEIGHBOUR_CLKS + 1}
    for period in sorted(clocks if is_large() else clocks - {6000}):
        await bench.call(CAPTURE_NEXT)
        line = bench.line()
        number = await bench.send(line)
        end = bench.clock - 3
        due = end + late + min(period, pkg.NEIGHBOUR_CLKS)
        await bench.tick(max(period - bench.length, 0))
        await bench.send(bench.line())
        await bench.tick(due - bench.clock)
        data = await bench.record(number)
        assert await bench.drain() == [(number, line.pixels, data)], f"a line every {period} clocks"


@cocotb.test()
async def stop_ends_it_behind_the_packet(dut) -> None:
    bench = await Bench.started(dut)
    packets = -(-bench.length // 100)
    span = bench.length + 30 + 2 * bench.length + 10 * packets
    for age in [*range(12), *range(12, span, 997 if is_large() else 61)]:
        for mode, argument in ((CAPTURE_NEXT, 0), (CAPTURE_LINE, bench.number), (CAPTURE_EVERY, 2)):
            bench.ready = 1.0 if age % 2 else 0.8
            line = bench.line()
            if mode == CAPTURE_LINE:
                argument = bench.number
            for k in range(age + 1):
                at = k - 3
                inside = 0 <= at < bench.length
                await bench.tick(
                    capture_start=int(k in (0, age)),
                    capture_mode=CAPTURE_STOP if k == age and k else mode,
                    capture_argument=argument,
                    line_start=int(at == 0),
                    line_end=int(at == bench.length - 1),
                    pixel_valid=int(inside),
                    pixel=line.pixels[at] if inside else 7,
                )
            bench.number += age >= 3
            if age == 0:
                await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)
            await bench.tick(5, line_start=0, line_end=0, pixel_valid=0)
            bench.ready = 1.0
            waited = 0
            while bench.twin.capture_busy:
                await bench.tick()
                waited += 1
            assert waited < 220 and not bench.packet and not bench.captured
            assert bench.pixels == line.pixels[: len(bench.pixels)]
            bench.pixels = []
            await bench.tick(line_end=1)  # of a line cut short above
            await bench.tick(line_end=0)
    # While it waits for the record, and while that goes out.
    for age in (0, 1, 40, 70):
        await bench.call(CAPTURE_NEXT)
        line = bench.line()
        number = await bench.send(line)
        while len(bench.pixels) < bench.length:
            await bench.tick()
        await bench.tick(5)
        if age:
            data = await bench.record(number)
            await bench.tick(age - 1)
        await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)
        await bench.tick(3)
        while bench.twin.capture_busy:
            await bench.tick()
        assert not bench.packet
        assert bench.captured == ([(number, line.pixels, data)] if age else [])
        bench.captured = []
        bench.pixels = []
    # A second start changes nothing while one runs.
    await bench.call(CAPTURE_NEXT)
    await bench.call(CAPTURE_LINE, 5)
    line = bench.line()
    number = await bench.send(line)
    await bench.call(CAPTURE_EVERY, 1)
    data = await bench.record(number)
    assert await bench.drain() == [(number, line.pixels, data)]


@cocotb.test()
async def sequence_numbers_wrap(dut) -> None:
    bench = await Bench.started(dut)
    for _ in range(258):
        await bench.call(CAPTURE_LINE, (1 << 32) - 1)
        while bench.twin.capture_busy:
            await bench.tick()
    assert bench.sequences[STREAM_CAPTURE_RECORD] == 2


@cocotb.test()
async def reset_forgets_everything(dut) -> None:
    bench = await Bench.started(dut)
    for age in range(5, 3 * bench.length + 120, 997 if is_large() else 37):
        await bench.call(CAPTURE_NEXT)
        line = bench.line()
        data = random_records(bench.draw, [bench.number])[0].tobytes()
        for k in range(age):
            inside = k < bench.length
            at = k - bench.length - 10
            await bench.tick(
                line_start=int(k == 0),
                line_end=int(k == bench.length - 1),
                pixel_valid=int(inside),
                pixel=line.pixels[k] if inside else 0,
                record_valid=int(0 <= at < 64),
                record_index=at % 64,
                record=data[at % 64],
                capture_mode=0,
                capture_start=int(k == age - 1 and age % 2 == 0),
            )
        more = {"capture_start": 1, "capture_mode": CAPTURE_NEXT, "line_start": 1}
        await bench.start(**more)
        await bench.tick(50, capture_start=0, line_start=0)
        assert not bench.twin.valid and not bench.twin.capture_busy
        await bench.call(CAPTURE_NEXT)
        line = bench.line()
        assert await bench.send(line) == 0
        data = await bench.record(0)
        assert await bench.drain() == [(0, line.pixels, data)]


@cocotb.test()
async def everything_at_random(dut) -> None:
    """Only the model knows what is right."""
    bench = await Bench.started(dut)
    bench.reads = False
    for _ in range(rounds(12, 60) if is_large() else rounds(100, 1000)):
        bench.ready = float(bench.draw.choice([0.0, 0.1, 0.5, 1.0, 1.0, 1.0]))
        if bench.draw.random() < 0.5:
            await bench.tick(int(bench.draw.integers(1, 6)))
            mode = int(bench.draw.integers(4))
            await bench.tick(
                capture_start=1,
                capture_mode=mode,
                capture_argument=int(bench.draw.integers(4))
                + (max(bench.number - 1, 0) if mode == CAPTURE_LINE else 0),
            )
        kind = bench.draw.random()
        number = await bench.send(
            bench.line(
                gaps=bench.draw.random() < 0.3,
                length=None if kind < 0.8 else bench.length + int(bench.draw.integers(-3, 4)),
                end=bench.draw.random() < 0.95,
            )
        )
        if bench.draw.random() < 0.8:
            await bench.record(number - int(bench.draw.integers(2)))
        await bench.tick(int(bench.draw.integers(1, 3 * bench.length)))
        if not bench.twin.valid and bench.draw.random() < 0.5:
            await bench.tick(capture_start=1, capture_mode=CAPTURE_STOP)


def longest(line_length: int, pixel_width: int, *, window: int, fit: bool = True) -> int:
    """Return the clocks from a line's last pixel to its record, but for the wait of a fit."""
    point = latency(
        window,
        measured=True,
        line_length=line_length,
        pixel_width=pixel_width,
        max_window=window,
        first_width=window,
        fit=fit,
        mapped=True,
    )
    # The chain sees a line a clock after the capture, the record its point a clock after the chain.
    return 1 + point + 1 + point_record.LATENCY


@pytest.mark.parametrize("line_length", [64, 1000, 2048, 8192, 25500])
def test_line_capture_waits_as_long_as_a_point_takes(line_length: int) -> None:
    """A point that comes with the late end of another's wait is weighed after it."""
    widths = range(8, 17)
    windows = (min(line_length, MAX_WINDOW), 3)
    most = max(
        longest(line_length, bits, window=window, fit=fit)
        for bits in widths
        for window in windows
        for fit in (True, False)
    )
    needed = most + peak_neighbours.LATENCY + FULL_BYTES + pkg.NEIGHBOUR_CLKS
    waits = record_clks(line_length)
    print(f"{line_length} px: {needed} clocks needed, {waits} waited")
    assert needed < waits <= needed + 512


@EACH_VOLUME
@pytest.mark.parametrize("values", each(ELABORATIONS), ids=str)
def test_line_capture(values: dict[str, int], volume: str) -> None:
    simulate("line_capture", __file__, values, volume=volume)


@pytest.mark.parametrize("length", [63, 25501])
def test_line_capture_model_rejects_what_does_not_fit(length: int) -> None:
    with pytest.raises(ValueError, match="line_capture: "):
        LineCapture(length)
