"""axis_ring: every clock of the RTL against the model; packets stay whole, in order, and wait."""

import cocotb
import pytest
from axis_bench import AxisBench, received, sink_of
from harness import FallingEdge, as_integer, each, generator, parameters, reset, simulate

from vrscan.clocked.axis_ring import LATENCY, AxisRing

ELABORATIONS = [
    {"Slots": 4, "Words": 16, "DataWidth": 32, "UserWidth": 24},
    {"Slots": 2, "Words": 5, "DataWidth": 16, "UserWidth": 3},
]
QUIET = {"write": 0, "place": 0, "data": 0, "commit": 0, "user": 0}


class Bench(AxisBench):
    """Writes packets and keeps what has been committed."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)
        self.size = parameters()

    def check(self) -> None:
        super().check()
        assert as_integer(self.dut.room_o) == self.twin.room, f"clock {self.clock}: room"

    async def start(self, **inputs: int) -> None:
        self.packets.clear()
        self.words.clear()
        self.sent: list[tuple[tuple[int, ...], int]] = []
        twin = AxisRing(self.size["Slots"], self.size["Words"])
        await self.reset_to(twin, **(QUIET | {"ready": 1} | inputs))
        self.give(**QUIET)
        self.check()

    def random(self, width: str) -> int:
        return int(self.draw.integers(1 << self.size[width]))

    async def write(self, ready: float, *, good: bool = True, gaps: float = 0.2) -> None:
        """Write a packet in any order, and commit it with its last word or later."""
        words = [self.random("DataWidth") for _ in range(self.size["Words"])]
        user = self.random("UserWidth")
        order = list(self.draw.permutation(len(words)))
        late = bool(self.draw.random() < gaps)
        for n, place in enumerate(order):
            while self.draw.random() < gaps:
                await self.tick(ready=int(self.draw.random() < ready))
            commit = good and not late and n == len(order) - 1
            given = {"write": 1, "place": int(place), "data": words[place], "commit": int(commit)}
            await self.tick(ready=int(self.draw.random() < ready), user=user, **given)
            self.give(**QUIET)
        if good and late:
            await self.tick(ready=int(self.draw.random() < ready), commit=1, user=user)
            self.give(**QUIET)
        if good:
            self.sent.append((tuple(words), user))


@cocotb.test()
async def packets_come_whole_and_in_order(dut) -> None:
    """With readers of every speed, and packets that are not committed in between."""
    bench = await Bench.started(dut)
    for ready in (1.0, 0.7, 0.2, 0.05):
        await bench.start()
        for _ in range(30):
            while not bench.twin.room:
                await bench.tick(ready=int(bench.draw.random() < ready))
            await bench.write(ready, good=bench.draw.random() < 0.8)
        while bench.twin.valid or len(bench.packets) < len(bench.sent):
            await bench.tick(ready=1)
        assert bench.packets == bench.sent


@cocotb.test()
async def a_full_ring_keeps_what_it_has(dut) -> None:
    """As many as the slots, and one more whose first words are on their way out."""
    bench = await Bench.started(dut)
    slots = bench.size["Slots"]
    for _ in range(slots):
        assert bench.twin.room
        await bench.write(0)
    for _ in range(20):
        await bench.tick(ready=0)
    assert not bench.twin.room and not bench.packets
    while len(bench.packets) < slots:
        await bench.tick(ready=1)
    assert bench.packets == bench.sent


@cocotb.test()
async def latency_and_no_bubble(dut) -> None:
    bench = await Bench.started(dut)
    await bench.write(0, gaps=0)
    for _ in range(LATENCY - 1):
        assert not bench.twin.valid
        await bench.tick(ready=0)
    assert bench.twin.valid
    await bench.write(0, gaps=0)
    for _ in range(2 * bench.size["Words"]):
        assert bench.twin.valid
        await bench.tick(ready=1)
    assert not bench.twin.valid and bench.packets == bench.sent


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    bench = await Bench.started(dut)
    for age in range(1, 2 * bench.size["Words"]):
        await bench.start()
        await bench.write(0, gaps=0)
        await bench.write(0, gaps=0)
        for _ in range(age):
            await bench.tick(ready=1)
        await bench.start(commit=1, write=1, ready=age % 2)
        await bench.write(1)
        while len(bench.packets) < 1:
            await bench.tick(ready=1)
        assert bench.packets == bench.sent


@cocotb.test()
async def another_ones_sink_takes_them(dut) -> None:
    """The sink of cocotbext-axi, with pauses, receives the same packets."""
    await reset(dut)
    sink = sink_of(dut, "m_axis", seed=3, pauses=0.6)
    draw, size = generator(3), parameters()
    edge, sent = FallingEdge(dut.clk_i), []
    for _ in range(20):
        while not as_integer(dut.room_o):
            await edge
        words = [int(draw.integers(1 << size["DataWidth"])) for _ in range(size["Words"])]
        user = int(draw.integers(1 << size["UserWidth"]))
        for place, word in enumerate(words):
            dut.write_i.value, dut.place_i.value, dut.data_i.value = 1, place, word
            dut.commit_i.value, dut.user_i.value = int(place == len(words) - 1), user
            await edge
        dut.write_i.value = dut.commit_i.value = 0
        sent.append((b"".join(w.to_bytes(size["DataWidth"] // 8, "little") for w in words), user))
    while not sink.idle() or as_integer(dut.m_axis_tvalid):
        await edge
    assert [(packet.data, packet.user) for packet in received(sink)] == sent


@pytest.mark.parametrize("given", each(ELABORATIONS), ids=lambda given: f"{given['Slots']}")
def test_axis_ring_rtl_equals_model(given: dict[str, int]) -> None:
    simulate("axis_ring", __file__, given)


@pytest.mark.parametrize(("slots", "words"), [(1, 4), (3, 4), (4, 1)])
def test_axis_ring_model_refuses(slots: int, words: int) -> None:
    with pytest.raises(ValueError, match="axis_ring: "):
        AxisRing(slots, words)
