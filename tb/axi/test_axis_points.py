"""axis_points: every clock of the RTL against the model, every packet against the records sent."""

import cocotb
import numpy as np
import pytest
from axis_bench import AxisBench, received, sink_of
from harness import FallingEdge, as_integer, each, generator, parameters, reset, simulate
from random_records import random_records

from vrscan.clocked.axis_points import LATENCY, AxisPoints
from vrscan.data import link_pkg, pkg
from vrscan.data.records import Records, decode_full, encode_full, flags_of

ELABORATIONS = [{"Slots": 16}, {"Slots": 2, "CountWidth": 3}]
QUIET = {"record_valid": 0, "record_index": 0, "record": 0}


def compare(data: bytes, user: int, sent: Records, lost: int) -> None:
    """Compare a packet with a record, before which some were dropped."""
    want = sent.copy().reshape(1)
    want["lost"] = lost
    if lost:
        want["flags"] |= 1 << pkg.FLAG_POINTS_LOST
    assert (decode_full(data) == want).all(), "another record"
    bits = int(want["bits"][0])
    above = (bits & 1) | (bits >> 4 & 1) << 1 | (bits >> 1 & 1) << 2 | (bits >> 2 & 1) << 3
    assert user == int(flags_of(want)[0]) | above << pkg.FLAG_WIDTH


class Bench(AxisBench):
    """Sends records."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)

    def check(self) -> None:
        super().check()
        assert as_integer(self.dut.points_dropped_o) == self.twin.points_dropped

    async def start(self, **inputs: int) -> None:
        self.packets.clear()
        self.words.clear()
        size = parameters()
        twin = AxisPoints(size["Slots"], size.get("CountWidth", pkg.COUNTER_WIDTH))
        await self.reset_to(twin, **(QUIET | {"ready": 1} | inputs))
        self.give(**QUIET)
        self.check()

    async def send(self, record: Records, ready: float, gap: int = 0) -> None:
        for index, byte in enumerate(encode_full(record)):
            given = {"record_valid": 1, "record_index": index, "record": byte}
            await self.tick(ready=int(self.draw.random() < ready), **given)
        self.give(**QUIET)
        for _ in range(gap):
            await self.tick(ready=int(self.draw.random() < ready))


@cocotb.test()
async def every_record_comes_or_is_counted(dut) -> None:
    """Readers of every speed: what is missing is told in the next record."""
    bench = await Bench.fresh(dut)
    most = (1 << parameters().get("CountWidth", pkg.COUNTER_WIDTH)) - 1
    for ready, gap in ((1.0, 0), (0.3, 5), (0.08, 0), (0.0, 1)):
        await bench.start()
        sent = random_records(bench.draw, range(40))
        for k in range(len(sent)):
            await bench.send(sent[k : k + 1], ready if k < 30 else 1.0, gap if k < 30 else 60)
        while bench.stream.valid:
            await bench.tick(ready=1)
        place = 0
        for words, user in bench.packets:
            data = b"".join(word.to_bytes(4, "little") for word in words)
            number = int(decode_full(data)["line"][0])
            compare(data, user, sent[number], min(number - place, most))
            place = number + 1
        missing = len(sent) - len(bench.packets)
        assert bench.twin.points_dropped == min(missing, most)
        assert bool(missing) == (ready < 0.2)


@cocotb.test()
async def latency(dut) -> None:
    bench = await Bench.started(dut)
    await bench.send(random_records(bench.draw, [7]), 1)
    for _ in range(LATENCY - link_pkg.FULL_BYTES):
        assert not bench.stream.valid
        await bench.tick()
    assert bench.stream.valid


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """A reset within a record: the rest of it goes nowhere."""
    bench = await Bench.fresh(dut)
    for age in (1, 4, 5, 6, 58, 59, 63):
        await bench.start()
        record = encode_full(random_records(bench.draw, [1]))
        for index in range(age):
            given = {"record_valid": 1, "record_index": index, "record": record[index]}
            await bench.tick(**given)
        await bench.start(record_valid=1, record_index=age, record=record[age])
        for index in range(age + 1, len(record)):
            given = {"record_valid": 1, "record_index": index, "record": record[index]}
            await bench.tick(**given)
        bench.give(**QUIET)
        sent = random_records(bench.draw, [2])
        await bench.send(sent, 1, 40)
        assert len(bench.packets) == 1


@cocotb.test()
async def another_ones_sink_takes_them(dut) -> None:
    """The sink of cocotbext-axi, with pauses, receives the same records."""
    await reset(dut)
    sink = sink_of(dut, "m_axis", seed=4, pauses=0.5)
    sent = random_records(generator(4), range(12))
    for k in range(len(sent)):
        for index, byte in enumerate(encode_full(sent[k : k + 1])):
            dut.record_valid_i.value, dut.record_index_i.value = 1, index
            dut.record_i.value = byte
            await FallingEdge(dut.clk_i)
        dut.record_valid_i.value = 0
    for _ in range(200):
        await FallingEdge(dut.clk_i)
    packets = received(sink)
    assert len(packets) == len(sent)
    for packet, record in zip(packets, sent, strict=True):
        compare(packet.data, packet.user, record, 0)


@pytest.mark.parametrize("given", each(ELABORATIONS), ids=lambda given: f"{given['Slots']}")
def test_axis_points_rtl_equals_model(given: dict[str, int]) -> None:
    simulate("axis_points", __file__, given)


def test_the_user_bits_are_those_of_the_page() -> None:
    """Each bit of a record's flags and bits alone."""
    from vrscan.clocked.axis_points import user_of
    from vrscan.data.records import FULL

    record = np.zeros(1, FULL)
    seen = set()
    for name, width in (("flags", 16), ("bits", 6)):
        for bit in range(width):
            record[name] = 1 << bit
            seen.add(user_of(encode_full(record)))
        record[name] = 0
    assert seen == {1 << bit for bit in range(22)}
