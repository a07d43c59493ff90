"""packet_arbiter: every clock of the RTL against the model; packets stay whole and none starves."""

from collections import deque

import cocotb
import pytest
from harness import (
    TwinBench,
    as_integer,
    each,
    generator,
    parameters,
    simulate,
)

from vrscan.clocked.packet_arbiter import LATENCY, PACKET_BUBBLE, PacketArbiter

ELABORATIONS = [{"Sources": 3}, {"Sources": 7}, {"Sources": 2}]
QUIET = {"valid": 0, "data": 0, "last": 0, "hold": 0, "ready": 1}


class Bench(TwinBench):
    """Gives the packets of every source, and keeps what comes out."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)
        self.sources = parameters()["Sources"]

    def check(self) -> None:
        twin, dut = self.twin, self.dut
        names = ["valid", "busy", "ready", *(("data", "last") * twin.valid)]
        want = [twin.valid, twin.busy, twin.ready(bool(self.inputs["ready"]))]
        want += [twin.data, twin.last] * twin.valid
        got = [as_integer(getattr(dut, f"{name}_o")) for name in names]
        assert got == [int(value) for value in want], (
            f"clock {self.clock}, {self.inputs}: {names} {got}, want {want}"
        )

    async def start(self, **inputs: int) -> None:
        self.waiting: list[deque[bytes]] = [deque() for _ in range(self.sources)]
        self.place = [0] * self.sources  # in the packet that goes out
        self.packets: list[bytes] = []
        self.first_clocks: list[int] = []
        self.last_clocks: list[int] = []
        self.open = bytearray()
        await self.reset_to(PacketArbiter(self.sources), **(QUIET | inputs))
        self.give(**QUIET)
        self.check()

    async def run(self, count: int = 1, ready: float = 1, gaps: float = 0, hold: int = 0) -> None:
        """Go on by some clocks; the sources give what waits, with gaps where asked for."""
        for _ in range(count):
            valid = last = 0
            data = int.from_bytes(self.draw.bytes(self.sources))
            for k, waiting in enumerate(self.waiting):
                inside = bool(self.place[k])
                if waiting and not (inside and self.draw.random() < gaps):
                    packet = waiting[0]
                    valid |= 1 << k
                    last |= (self.place[k] == len(packet) - 1) << k
                    data &= ~(0xFF << 8 * k)
                    data |= packet[self.place[k]] << 8 * k
            now = int(self.draw.random() < ready)
            taken = valid & self.twin.ready(bool(now))
            if self.twin.valid and now:
                self.open.append(self.twin.data)
                if len(self.open) == 1:
                    self.first_clocks.append(self.clock)
                if self.twin.last:
                    self.packets.append(bytes(self.open))
                    self.last_clocks.append(self.clock)
                    self.open.clear()
            await self.clocks(valid=valid, data=data, last=last, ready=now, hold=hold)
            for k, waiting in enumerate(self.waiting):
                if taken >> k & 1:
                    self.place[k] += 1
                    if self.place[k] == len(waiting[0]):
                        waiting.popleft()
                        self.place[k] = 0

    async def drain(self, **how: float) -> None:
        """Go on until nothing waits."""
        while any(self.waiting) or self.twin.busy or self.twin.valid:
            await self.run(**how)

    def packet(self, source: int, length: int) -> bytes:
        """Return a packet that tells its source."""
        return bytes([source]) + self.draw.bytes(length - 1)


@cocotb.test()
async def packets_of_all_sources_stay_whole(dut) -> None:
    """Of every length, with gaps in them and a line that waits: each comes once, in its order."""
    bench = await Bench.started(dut)
    for ready, gaps, hold in ((1, 0, 0), (0.5, 0, 0), (0.3, 0.5, 0.3), (1, 0.5, 0.1)):
        sent: list[list[bytes]] = [[] for _ in range(bench.sources)]
        bench.packets.clear()
        for _ in range(150):
            source = int(bench.draw.integers(bench.sources))
            packet = bench.packet(source, int(bench.draw.choice([1, 1, 2, 3, 20])))
            sent[source].append(packet)
            bench.waiting[source].append(packet)
            for _ in range(int(bench.draw.integers(20))):
                await bench.run(1, ready, gaps, int(bench.draw.random() < hold))
        await bench.drain(ready=ready, gaps=gaps)
        for source, packets in enumerate(sent):
            assert [p for p in bench.packets if p[0] == source] == packets


@cocotb.test()
async def replies_wait_for_one_packet(dut) -> None:
    """Streams that never end: a reply goes behind the packet under way, whatever its age."""
    bench = await Bench.started(dut)
    for age in range(30):
        await bench.start()
        for source in range(1, bench.sources):
            bench.waiting[source].extend(bench.packet(source, 12) for _ in range(8))
        await bench.run(age)
        bench.waiting[0].append(bench.packet(0, 5))
        bench.waiting[0].append(bench.packet(0, 1))
        before = bench.clock
        await bench.drain()
        place = [p[0] for p in bench.packets].index(0)
        assert bench.packets[place + 1][0] == 0
        assert bench.first_clocks[place] - before <= 12 + 2 * PACKET_BUBBLE + LATENCY
        assert place <= age // 12 + 1


@cocotb.test()
async def streams_take_turns(dut) -> None:
    """All that have a packet in turn, those that have none are passed over."""
    bench = await Bench.started(dut)
    streams = list(range(1, bench.sources))
    for source in streams:
        bench.waiting[source].extend(bench.packet(source, 3) for _ in range(4))
    await bench.drain()
    assert [p[0] for p in bench.packets] == streams * 4
    # Who has just had its turn is behind all others; a reply in between changes no turn.
    bench.packets.clear()
    last = streams[0]
    bench.waiting[last].append(bench.packet(last, 1))
    await bench.drain()
    bench.waiting[0].append(bench.packet(0, 2))
    for source in streams:
        bench.waiting[source].append(bench.packet(source, 2))
    await bench.drain()
    order = [s for s in streams if s > last] + [s for s in streams if s <= last]
    assert [p[0] for p in bench.packets] == [last, 0, *order]


@cocotb.test()
async def hold_lets_replies_pass(dut) -> None:
    """No stream begins while it lasts; one that has begun ends."""
    bench = await Bench.started(dut)
    stream = bench.sources - 1
    bench.waiting[stream].extend(bench.packet(stream, 10) for _ in range(2))
    await bench.run(6)
    bench.waiting[0].extend(bench.packet(0, 4) for _ in range(3))
    await bench.run(100, hold=1)
    assert [p[0] for p in bench.packets] == [stream, 0, 0, 0] and not bench.twin.busy
    await bench.drain()
    assert bench.packets[-1][0] == stream and len(bench.packets) == 5


@cocotb.test()
async def latency_and_bubble(dut) -> None:
    bench = await Bench.started(dut)
    for source in range(bench.sources):
        await bench.start()
        bench.waiting[source].extend(bench.packet(source, n) for n in (5, 1, 7))
        at = bench.clock
        await bench.drain()
        assert bench.first_clocks[0] == at + LATENCY
        for first, last, packet in zip(
            bench.first_clocks, bench.last_clocks, bench.packets, strict=True
        ):
            assert last - first == len(packet) - 1
        for last, first in zip(bench.last_clocks, bench.first_clocks[1:], strict=False):
            assert first - last == 1 + PACKET_BUBBLE


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """The rest of a packet is none's; turns begin with the first stream."""
    bench = await Bench.started(dut)
    for age in range(1, 25):
        await bench.start()
        for source in range(bench.sources):
            bench.waiting[source].extend(bench.packet(source, 4) for _ in range(2))
        await bench.run(age, ready=1 if age % 2 else 0.3)
        await bench.start(valid=(1 << bench.sources) - 1, ready=age % 2)
        for source in range(1, bench.sources):
            bench.waiting[source].append(bench.packet(source, 2))
        await bench.drain()
        assert [p[0] for p in bench.packets] == list(range(1, bench.sources))


@pytest.mark.parametrize("given", each(ELABORATIONS), ids=lambda given: f"{given['Sources']}")
def test_packet_arbiter_rtl_equals_model(given: dict[str, int]) -> None:
    simulate("packet_arbiter", __file__, given)


@pytest.mark.parametrize("sources", [1, 17])
def test_packet_arbiter_model_refuses(sources: int) -> None:
    with pytest.raises(ValueError, match="packet_arbiter: sources"):
        PacketArbiter(sources)
