"""point_packer: every clock of the RTL against the model, every packet against the records."""

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
    generator,
    parameters,
    rounds,
    simulate,
)
from random_records import random_records

from vrscan.clocked.point_packer import SPACING, PointPacker, latency, most_records, record_bytes
from vrscan.data import pkg
from vrscan.data.link_pkg import (
    STREAM_POINTS_COMPACT,
    STREAM_POINTS_FULL,
    STREAM_POINTS_SPACE,
)
from vrscan.data.records import (
    Records,
    compact,
    decode_compact,
    decode_full,
    decode_space,
    space,
)
from vrscan.link.protocol import encode_frame
from vrscan.registers import values

ELABORATIONS = [
    {"BufferBytes": 4096},
    {"BufferBytes": 512, "TimeoutWidth": 10, "CountWidth": 5},
]
COMPACT, FULL, SPACE = 0, 1, 2
MOST, BYTES = {COMPACT: 28, FULL: 3, SPACE: 25}, {COMPACT: 8, FULL: 64, SPACE: 9}
DECODE = {COMPACT: decode_compact, FULL: decode_full, SPACE: decode_space}
LINES = 1 << 32
OUTPUTS = ("valid", "data", "last", "points_dropped")
OUTPUTS_OF = attrgetter(*OUTPUTS)
QUIET = {
    "record_valid": 0,
    "record_index": 0,
    "record": 0,
    "ready": 1,
    "stream_start": 0,
    "stream_stop": 0,
    "stream_format": 0,
    "stream_step": 1,
    "points_batch": 255,
    "points_timeout_clks": 0,
}


@dataclass(frozen=True)
class Packet:
    """A packet of points, read by the definition of it."""

    form: int
    sequence: int
    count: int
    step: int
    first: int
    dropped: int
    records: Records


def parsed(data: bytes) -> Packet:
    """Return what a packet says, if it is one."""
    form = (STREAM_POINTS_COMPACT, STREAM_POINTS_FULL, STREAM_POINTS_SPACE).index(data[0])
    assert 1 <= data[2] <= MOST[form]
    assert len(data) == 10 + data[2] * BYTES[form] <= 240
    first, dropped = int.from_bytes(data[4:8], "little"), int.from_bytes(data[8:10], "little")
    records = DECODE[form](data[10:])
    return Packet(form, data[1], data[2], data[3], first, dropped, records)


def check_stream(
    packets: Sequence[Packet], sent: Records, form: int, step: int, batch: int | None
) -> int:
    """Compare the packets of one stream with the records that came in it.

    Args:
        packets: All of them.
        sent: The records, all of the stream.
        form: Its format.
        step: Of its lines.
        batch: Records of a batch that nothing closes before its time; None if something does.

    Returns:
        The number of records dropped.
    """
    most = count_max()
    chosen = [k for k, line in enumerate(sent["line"]) if int(line - sent["line"][0]) % step == 0]
    place = 0
    lost_before = []  # of each packet: records dropped before its first
    for number, packet in enumerate(packets):
        assert packet.form == form and packet.step == step
        assert packet.sequence == number % 256
        begin = place
        while int(sent["line"][chosen[place]]) != packet.first:
            place += 1
        lost_before.append(place - begin)
        for k in range(packet.count):
            want = sent[chosen[place]].copy()
            assert int(want["line"]) == (packet.first + k * step) % LINES, "a batch has a gap"
            if k == 0 and lost_before[-1]:
                want["lost"] = min(lost_before[-1], most)
                want["flags"] |= 1 << pkg.FLAG_POINTS_LOST
            made = {COMPACT: compact, SPACE: space}.get(form)
            want = want if made is None else made(want.reshape(1))[0]
            assert packet.records[k] == want, f"packet {number}, record {k}"
            place += 1
        behind = (packet.first + packet.count * step) % LINES
        if batch is not None and number + 1 < len(packets):
            limit = min(max(batch, 1), MOST[form])
            assert packet.count == limit or packets[number + 1].first != behind
    lost_before.append(len(chosen) - place)
    # A header tells what was dropped up to the moment when its batch was closed.
    for number, packet in enumerate(packets):
        late = (packet.dropped - sum(lost_before[: number + 1])) % (most + 1)
        assert late <= lost_before[number + 1] or lost_before[number + 1] > most
    return sum(lost_before)


def count_max() -> int:
    """Return where the counts of dropped records stop or wrap."""
    return (1 << parameters().get("CountWidth", 16)) - 1


def is_large() -> bool:
    """Return whether the ring is the shipped one; the small one has the most of the work."""
    return parameters()["BufferBytes"] > 512


class Bench(TwinBench):
    """Gives records and commands, and keeps the packets."""

    strobes = ("stream_start", "stream_stop")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS])
        self.ready = 1.0  # how often the other end takes a byte

    def check(self) -> None:
        got, want = self.outputs.read(), OUTPUTS_OF(self.twin)
        if not self.twin.valid:
            got, want = got[::3], want[::3]
        assert got == want, f"clock {self.clock}, {self.inputs}: {OUTPUTS} {got}, want {want}"

    async def start(self, **inputs: int) -> None:
        self.packet = bytearray()
        self.packets: list[Packet] = []
        values = parameters()
        twin = PointPacker(
            values["BufferBytes"], values.get("TimeoutWidth", 24), values.get("CountWidth", 16)
        )
        await self.reset_to(twin, **(QUIET | inputs))
        self.check()

    async def tick(self, count: int = 1, **inputs: int) -> None:
        """Go on, with a reader that is as willing as ``ready`` says."""
        self.give(**inputs)
        for _ in range(count):
            ready = self.ready >= 1 or self.draw.random() < self.ready
            if self.twin.valid and ready:
                self.packet.append(self.twin.data)
                if self.twin.last:
                    self.packets.append(parsed(bytes(self.packet)))
                    self.packet.clear()
            await self.clocks(ready=int(ready))

    async def record(self, record: np.void, spacing: int = SPACING, **inputs: int) -> None:
        """Give one record, and then other values on the ports."""
        for index, byte in enumerate(record.tobytes()):
            await self.tick(record_valid=1, record_index=index, record=byte, **inputs)
            inputs = {}
        garbage = int(self.draw.integers(256))
        await self.tick(spacing - 64, record_valid=0, record_index=garbage % 64, record=garbage)

    async def stream(
        self, form: int, records: Records, step: int = 1, spacing: int = SPACING, **settings: int
    ) -> None:
        """Start a stream and give it records."""
        await self.tick(stream_start=1, stream_format=form, stream_step=step, **settings)
        # The ports carry something else behind the strobe.
        await self.tick(4, stream_format=(form + 1) % 3, stream_step=step ^ 255)
        for record in records:
            more = int(self.draw.integers(40)) if spacing == SPACING else 0
            await self.record(record, spacing + more)

    async def finish(self) -> list[Packet]:
        """Stop, wait until all is out, and return the packets."""
        self.ready = 1.0
        await self.tick(stream_stop=1)
        quiet = 0
        while quiet < 120:
            await self.tick()
            quiet = 0 if self.twin.valid else quiet + 1
        assert not self.packet
        packets, self.packets = self.packets, []
        return packets


def lines_from(first: int, count: int) -> list[int]:
    return [(first + k) % LINES for k in range(count)]


@cocotb.test()
async def batch_is_out_after_the_stated_latency(dut) -> None:
    bench = await Bench.started(dut)
    for form in (COMPACT, FULL, SPACE):
        records = random_records(bench.draw, lines_from(5, 2))
        await bench.stream(form, records[:1], points_batch=2)
        start = bench.clock
        await bench.record(records[1], 64)
        while not bench.twin.valid:
            await bench.tick()
        assert bench.clock - start == latency(form) == {COMPACT: 87, FULL: 143, SPACE: 88}[form]
        assert check_stream(await bench.finish(), records, form, 1, 2) == 0


@cocotb.test()
async def every_batch_size_gives_whole_packets(dut) -> None:
    bench = await Bench.started(dut)
    for form, sizes in (
        (COMPACT, (0, 1, 2, 5, 27, 28, 29, 255)),
        (FULL, (0, 1, 2, 3, 4, 255)),
        (SPACE, (1, 24, 25, 26)),
    ):
        for size in sizes:
            count = 2 * most_records(form) // (1 if form == FULL else 2) + 3
            records = random_records(bench.draw, lines_from(int(bench.draw.integers(LINES)), count))
            await bench.stream(form, records, points_batch=size)
            packets = await bench.finish()
            assert check_stream(packets, records, form, 1, size) == 0
            # Only what the stream's end closed is shorter.
            limit = min(max(size, 1), most_records(form))
            assert {p.count for p in packets[:-1]} == {limit}
            assert sum(p.count for p in packets) == count
    assert bench.twin.points_dropped == 0


@cocotb.test()
async def every_step_takes_its_lines_and_a_gap_closes_the_batch(dut) -> None:
    bench = await Bench.started(dut)
    for form in (COMPACT, FULL, SPACE):
        for step in (1, 2, 3, 7, 16, 100, 128, 254, 255):
            # Line numbers wrap; lines are missing, few or very many; others are between.
            line = LINES - int(bench.draw.integers(10)) * step
            lines = [line]
            while len(lines) < 30:
                kind = bench.draw.random()
                many = (
                    1 if kind < 0.7 else int(bench.draw.integers(2, 5 if kind < 0.9 else 1 << 22))
                )
                line += many * step
                if step > 1 and bench.draw.random() < 0.3:
                    lines.append(line - int(bench.draw.integers(1, step)))
                lines.append(line)
            records = random_records(bench.draw, lines)
            await bench.stream(form, records, step, points_batch=200)
            packets = await bench.finish()
            assert check_stream(packets, records, form, step, 200) == 0
            assert {p.dropped for p in packets} == {0}
            assert len(packets) > 1


@cocotb.test()
async def stalled_reader_drops_records_and_says_so(dut) -> None:
    bench = await Bench.started(dut)
    total = 0
    streams = [(FULL, 1), (SPACE, 2)] if is_large() else [(COMPACT, 1), (FULL, 2), (COMPACT, 3)]
    for form, step in streams:
        size = record_bytes(form)
        count = step * (parameters()["BufferBytes"] // size + 12)
        records = random_records(bench.draw, lines_from(LINES - 20, 2 * count))
        bench.ready = 0.0
        await bench.stream(form, records[:count], step)
        # Now and then a few bytes leave: some records have room.
        for part in np.array_split(records[count:], 10):
            bench.ready = float(bench.draw.choice([0.0, 0.02, 0.1, 0.5]))
            for record in part:
                await bench.record(record)
        packets = await bench.finish()
        lost = check_stream(packets, records, form, step, 255)
        assert lost > 10
        total += lost
        assert bench.twin.points_dropped == min(total, count_max())


@cocotb.test()
async def batch_begins_where_the_longest_one_has_room(dut) -> None:
    """To the byte; and what is begun is kept to its end."""
    bench = await Bench.started(dut)
    ring = parameters()["BufferBytes"]
    # The output register holds a byte that has left the ring.
    for form, batch in ((COMPACT, 28), (COMPACT, 1), (FULL, 3), (FULL, 1), (SPACE, 25)):
        size = record_bytes(form)
        longest = 10 + size * MOST[form]
        fits, used = 0, 0
        while used - (fits > 0) + longest <= ring:
            used += 10 + size * batch
            fits += batch
        records = random_records(bench.draw, lines_from(0, fits + 3))
        bench.ready = 0.0
        before = bench.twin.points_dropped
        await bench.stream(form, records, points_batch=batch)
        assert bench.twin.points_dropped - before == 3
        packets = await bench.finish()
        assert sum(p.count for p in packets) == fits
        check_stream(packets, records, form, 1, batch)


@cocotb.test()
async def sequence_numbers_wrap(dut) -> None:
    bench = await Bench.started(dut)
    records = random_records(bench.draw, lines_from(LINES - 100, 259))
    await bench.stream(COMPACT, records, points_batch=1)
    packets = await bench.finish()
    assert len(packets) == 259
    assert check_stream(packets, records, False, 1, 1) == 0


@cocotb.test()
async def counts_of_dropped_records_wrap_or_stop(dut) -> None:
    bench = await Bench.started(dut)
    most = count_max()
    if most > 31:
        pytest.skip("to count that far takes ten million clocks")
    total = 0
    for lost in (most - 1, most, most + 1, 3 * most):
        room = 6
        records = random_records(bench.draw, lines_from(9, room + lost + 1))
        bench.ready = 0.0
        await bench.stream(FULL, records[:-1])
        bench.ready = 1.0
        await bench.tick(1000)
        await bench.record(records[-1])
        packets = await bench.finish()
        assert sum(p.count for p in packets) == room + 1
        last = packets[-1]
        assert last.records["line"].tolist() == [records["line"][-1]]
        assert last.records["lost"].tolist() == [min(lost, most)]
        assert last.dropped == lost % (most + 1)
        total += lost
        assert bench.twin.points_dropped == min(total, most)


@cocotb.test()
async def old_batch_is_closed(dut) -> None:
    bench = await Bench.started(dut)
    for form in (COMPACT, FULL, SPACE):
        for timeout in (1, 100, 500):
            record = random_records(bench.draw, [7])
            await bench.stream(form, record, spacing=64, points_timeout_clks=timeout)
            start = bench.clock
            while not bench.twin.valid:
                await bench.tick()
            # The age counts from the clock in which the record finds its room; 12 clocks after the
            # batch is found old the packet is there.
            want = max(timeout, record_bytes(form)) + 15
            assert bench.clock - start == want, (form, timeout)
            await bench.finish()
    # Never: not even when the age stops.
    records = random_records(bench.draw, [7, 8])
    await bench.stream(COMPACT, records[:1], points_timeout_clks=0)
    await bench.tick(1100)
    assert not bench.packets
    # An age that has stopped is the largest timeout.
    await bench.tick(60, points_timeout_clks=1000 if is_large() else 1023)
    assert len(bench.packets) == 1
    await bench.record(records[1])
    packets = await bench.finish()
    assert [p.count for p in packets] == [1, 1]


@cocotb.test()
async def stop_at_any_moment_sends_what_there_is(dut) -> None:
    bench = await Bench.started(dut)
    for form in (COMPACT, FULL, SPACE):
        for age in range(form, 170, 19 if is_large() else rounds(3, 1)):
            gap = 1 + age % 2
            records = random_records(bench.draw, [20, 21, 21 + gap, 30])
            await bench.stream(form, records[:2], points_batch=4)
            # The strobe comes at some moment of the third record, or after it.
            bytes_ = records[2].tobytes()
            for k in range(200):
                inside = k < 64
                await bench.tick(
                    record_valid=int(inside),
                    record_index=k % 64,
                    record=bytes_[k % 64],
                    stream_stop=int(k == age),
                )
            await bench.record(records[3])
            packets = await bench.finish()
            assert check_stream(packets, records[:3], form, 1, None) == 0
            assert bench.twin.points_dropped == 0


@cocotb.test()
async def start_at_any_moment_begins_anew(dut) -> None:
    bench = await Bench.started(dut)
    for age in range(0, 260, 29 if is_large() else rounds(7, 1)):
        first, second = age % 2, age // 2 % 2
        step = 1 + age % 3
        one = random_records(bench.draw, lines_from(100, 3))
        two = random_records(bench.draw, lines_from(1000, 5))
        await bench.stream(first, one[:2], points_batch=3)
        bytes_ = one[2].tobytes()
        for k in range(age + 200):
            inside = k < 64
            await bench.tick(
                record_valid=int(inside),
                record_index=k % 64,
                record=bytes_[k % 64],
                stream_start=int(k == age),
                stream_format=second,
                stream_step=step,
            )
        for record in two:
            await bench.record(record)
        packets = await bench.finish()
        cut = next(k for k, p in enumerate(packets) if p.first >= 1000)
        assert check_stream(packets[:cut], one, bool(first), 1, None) == 0
        assert check_stream(packets[cut:], two, bool(second), step, None) == 0


@cocotb.test()
async def nothing_runs_before_a_start_or_after_a_stop(dut) -> None:
    bench = await Bench.started(dut)
    records = random_records(bench.draw, lines_from(0, 4))
    await bench.record(records[0])
    await bench.tick(stream_stop=1)
    await bench.record(records[1])
    await bench.tick(stream_start=1, stream_stop=1)
    await bench.record(records[2])
    assert await bench.finish() == []
    assert bench.twin.points_dropped == 0


@cocotb.test()
async def reset_forgets_everything(dut) -> None:
    bench = await Bench.started(dut)
    for age in range(0, 900, 67 if is_large() else rounds(23, 3)):
        form = age % 2
        before = random_records(bench.draw, lines_from(3, 6))
        bench.ready = 0.3
        await bench.tick(stream_start=1, stream_format=form, points_batch=2)
        left = age
        for record in before:
            for index, byte in enumerate(record.tobytes()):
                if left:
                    await bench.tick(record_valid=1, record_index=index, record=byte)
                    left -= 1
            for _ in range(min(left, SPACING - 64)):
                await bench.tick(record_valid=0)
                left -= 1
        if age % 3 == 0:
            bench.give(stream_start=1)
        bench.give(record_valid=1, record_index=0, ready=1)
        await bench.start(**{name: bench.inputs[name] for name in ("record_valid", "stream_start")})
        bench.ready = 1.0
        await bench.tick(100, stream_start=0, record_valid=0)
        assert not bench.twin.valid and not bench.packets
        after = random_records(bench.draw, lines_from(7, 3))
        await bench.stream(1 - form, after, points_batch=2)
        assert check_stream(await bench.finish(), after, not form, 1, 2) == 0


@cocotb.test()
async def everything_at_random(dut) -> None:
    """Only the model knows what is right: settings change and records come too early, too."""
    bench = await Bench.started(dut)
    line = LINES - 300
    for _ in range(rounds(30, 120)):
        bench.ready = float(bench.draw.choice([0.0, 0.01, 0.1, 0.5, 1.0]))
        settings = {
            "points_batch": int(bench.draw.choice([0, 1, 2, 3, 10, 28, 255])),
            "points_timeout_clks": int(bench.draw.choice([0, 1, 200, 800])),
        }
        if bench.draw.random() < 0.4:
            settings["stream_start"] = 1
            settings["stream_format"] = int(bench.draw.integers(3))
            settings["stream_step"] = int(bench.draw.choice([1, 2, 3, 255]))
        elif bench.draw.random() < 0.1:
            settings["stream_stop"] = 1
        await bench.tick(**settings)
        for _ in range(int(bench.draw.integers(1, 30))):
            line += 1 if bench.draw.random() < 0.8 else int(bench.draw.integers(1, 300))
            spacing = int(bench.draw.choice([64, 65, 100, 140, 150, 160, 200]))
            await bench.record(random_records(bench.draw, [line])[0], spacing)
    # A record that is cut short by the next one is lost.
    before = bench.twin.points_dropped
    bench.ready = 1.0
    await bench.finish()
    await bench.tick(stream_start=1, stream_format=FULL, stream_step=1)
    await bench.tick(10)
    for index in range(30):
        await bench.tick(record_valid=1, record_index=index, record=index)
    await bench.record(random_records(bench.draw, [5])[0])
    packets = await bench.finish()
    assert [p.first for p in packets] == [5] and int(packets[0].records["lost"][0]) == 1
    assert bench.twin.points_dropped == min(before + 1, count_max())


@EACH_VOLUME
@pytest.mark.parametrize("values", ELABORATIONS, ids=str)
def test_point_packer(values: dict[str, int], volume: str) -> None:
    simulate("point_packer", __file__, values, volume=volume)


@pytest.mark.parametrize("size", [0, 128, 300, 1 << 17])
def test_point_packer_model_rejects_what_does_not_fit(size: int) -> None:
    with pytest.raises(ValueError, match="point_packer: "):
        PointPacker(size)


# ---- the model alone ----


@pytest.mark.parametrize(("form", "baud", "fits"), [(SPACE, 4e6, True), (FULL, 4e6, False)])
def test_every_line_of_points_and_free_beams_fits_into_4_mbaud(
    form: int, baud: float, fits: bool
) -> None:
    """At 37,400 lines/s and 100 MHz, with the frames' own bytes, and the batch after reset."""
    clock_hz, lines = 100e6, 300
    draw = generator(12)
    records = random_records(draw, range(lines))
    twin = PointPacker()
    quiet = QUIET | {"points_batch": values.find("points_batch").reset[0]}
    due, sent, payload, free_at, wire = 0.0, 0, bytearray(), 0.0, 0.0
    twin.step(**quiet | {"stream_start": 1, "stream_format": form})
    twin.step(**quiet)
    packets = []
    byte = 0
    for clock in range(round(lines * clock_hz / 37_400)):
        inputs = dict(quiet)
        if byte < 64 and sent < lines and (byte or clock >= due):
            due += (clock_hz / 37_400) * (byte == 0)
            inputs |= {
                "record_valid": 1,
                "record_index": byte,
                "record": records[sent : sent + 1].tobytes()[byte],
            }
            byte += 1
            if byte == 64:
                byte, sent = 0, sent + 1
        # The encoder takes a packet at once, and the next one when its last byte is on the wire.
        inputs["ready"] = int(bool(payload) or clock >= free_at)
        if twin.valid and inputs["ready"]:
            payload.append(twin.data)
            if twin.last:
                packets.append(parsed(bytes(payload)))
                bits = 10 * len(encode_frame(bytes(payload)))
                wire += bits * clock_hz / baud
                free_at = max(clock, free_at) + bits * clock_hz / baud
                payload.clear()
        twin.step(**inputs)
    arrived = sum(packet.count for packet in packets)
    busy = wire / (arrived * clock_hz / 37_400)
    print(f"{arrived} of {sent} lines sent, {twin.points_dropped} dropped, line busy {busy:.2f}")
    if fits:
        # What is not out yet is an open batch and the packet that waits for it.
        assert twin.points_dropped == 0 and sent - arrived <= 2 * quiet["points_batch"]
        assert busy < 0.95
    else:
        assert twin.points_dropped > 0 or sent - arrived > 4 * quiet["points_batch"]


def test_4_mbaud_can_be_set() -> None:
    step = round(4e6 / 100e6 * 2**24)
    assert values.to_words("uart_step", step) == [step]
    assert abs(step * 100e6 / 2**24 / 4e6 - 1) < 1e-6
