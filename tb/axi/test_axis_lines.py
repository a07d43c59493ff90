"""axis_lines: every clock of the RTL against the model, every packet against the lines sent."""

import cocotb
import pytest
from axis_bench import AxisBench, received, send_lines, sink_of
from harness import FallingEdge, as_integer, each, generator, parameters, port, reset, simulate

from vrscan.clocked.axis_lines import LATENCY, AxisLines, LineUser

ELABORATIONS = [
    {"LineLength": 64, "PixelWidth": 12},
    {"LineLength": 72, "PixelWidth": 16, "Lanes": 4, "Slots": 4, "CountWidth": 2},
]
OF_LINE = ("mirror_flags", "test", "superseded")
QUIET = dict.fromkeys(("line_start", "line_end", "pixel_valid", "pixel", *OF_LINE), 0)
KINDS = ("good", "good", "good", "good", "short", "long", "unfinished")


class Bench(AxisBench):
    """Sends lines, good ones and others."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)
        self.length = parameters()["LineLength"]
        self.most = (1 << parameters().get("CountWidth", 16)) - 1

    def check(self) -> None:
        super().check()
        assert as_integer(self.dut.lines_dropped_o) == self.twin.lines_dropped

    async def start(self, **inputs: int) -> None:
        self.packets.clear()
        self.words.clear()
        self.sent: dict[int, tuple[list[int], LineUser]] = {}  # the good ones by number
        self.number = 0
        size = parameters()
        twin = AxisLines(
            self.length, size.get("Lanes", 2), size.get("Slots", 2), size.get("CountWidth", 16)
        )
        await self.reset_to(twin, **(QUIET | {"ready": 1} | inputs))
        self.give(**QUIET)
        self.check()

    async def line(self, kind: str, ready: float, gaps: float = 0.1) -> None:
        count = self.length + {"short": -1, "long": 1, "unfinished": -3}.get(kind, 0)
        top = 1 << parameters()["PixelWidth"]
        pixels = [int(self.draw.integers(top)) for _ in range(count)]
        flags, test, old = (int(self.draw.integers(n)) for n in (8, 2, 2))
        for k, pixel in enumerate(pixels):
            end = k == count - 1 and kind != "unfinished"
            given = {"line_start": int(k == 0), "pixel_valid": 1, "pixel": pixel}
            of_line = zip(OF_LINE, (flags, test, old) if end else (0, 0, 0), strict=True)
            turn = int(self.draw.random() < ready)
            await self.tick(ready=turn, line_end=int(end), **given, **dict(of_line))
            self.give(**QUIET)
            while self.draw.random() < gaps:
                await self.tick(ready=int(self.draw.random() < ready))
        if kind == "good":
            self.sent[self.number] = pixels, LineUser(self.number, flags, bool(test), bool(old))
        self.number += 1

    def compare(self, ready: float) -> None:
        lanes, before = parameters().get("Lanes", 2), -1
        for words, user in self.packets:
            got = LineUser.unpacked(user)
            pixels, want = self.sent[got.number]
            assert user == LineUser(**{**vars(want), "lost": got.number != before + 1}).packed
            unpacked = [w >> 16 * k & 0xFFFF for w in words for k in range(lanes)]
            assert unpacked == pixels, f"line {got.number} at {ready}"
            before = got.number
        missing = len(self.sent) - len(self.packets)
        assert self.twin.lines_dropped == min(missing, self.most)


@cocotb.test()
async def every_good_line_comes_whole_or_is_counted(dut) -> None:
    bench = await Bench.fresh(dut)
    for ready in (1.0, 0.6, 0.1, 0.0):
        await bench.start()
        for k in range(24):
            kind = KINDS[int(bench.draw.integers(len(KINDS)))]
            await bench.line(kind, ready if k < 18 else 1.0, gaps=0.1 if k % 2 else 0)
        for _ in range(2 * bench.length * parameters().get("Slots", 2)):
            await bench.tick(ready=1)
        assert not bench.stream.valid and bench.packets
        bench.compare(ready)
        assert (bench.twin.lines_dropped > 0) == (ready < 0.2)


@cocotb.test()
async def latency_behind_a_line(dut) -> None:
    """A line may begin in the clock behind another one's end."""
    bench = await Bench.started(dut)
    for _ in range(3):
        await bench.line("good", 1, gaps=0)
        for _ in range(LATENCY - 1):
            assert not bench.stream.valid
            await bench.tick()
        assert bench.stream.valid
        while bench.stream.valid:
            await bench.tick()
    for _ in range(4):
        await bench.line("good", 1, gaps=0)
    for _ in range(bench.length):
        await bench.tick()
    assert len(bench.packets) == 7


@cocotb.test()
async def reset_within_a_line(dut) -> None:
    """The rest of the line is none's, and numbers begin with 0."""
    bench = await Bench.fresh(dut)
    for kind in ("unfinished", "good"):
        await bench.start()
        await bench.line("short", 0)
        await bench.line(kind, 0)
        await bench.start(pixel_valid=1, line_start=1, ready=0)
        for _ in range(bench.length):
            await bench.tick(pixel_valid=1)
        await bench.tick(line_end=1)
        bench.give(**QUIET)
        await bench.line("good", 1)
        for _ in range(bench.length):
            await bench.tick()
        assert [LineUser.unpacked(user).number for _, user in bench.packets] == [0]
        bench.compare(1)


@cocotb.test()
async def another_ones_sink_takes_them(dut) -> None:
    """The sink of cocotbext-axi, with pauses, receives the same pixels."""
    await reset(dut)
    sink = sink_of(dut, "m_axis", seed=5, pauses=0.3)
    draw, length = generator(5), parameters()["LineLength"]
    sent = draw.integers(1 << parameters()["PixelWidth"], size=(6, length))
    port(dut, "mirror_flags_i").value = 5
    await send_lines(dut, sent, 10)
    for _ in range(4 * length):
        await FallingEdge(dut.clk_i)
    packets = received(sink)
    assert [p.data for p in packets] == [line.astype("<u2").tobytes() for line in sent]
    assert [LineUser.unpacked(p.user) for p in packets] == [LineUser(k, 5) for k in range(6)]


@pytest.mark.parametrize("given", each(ELABORATIONS), ids=lambda given: f"{given['LineLength']}")
def test_axis_lines_rtl_equals_model(given: dict[str, int]) -> None:
    simulate("axis_lines", __file__, given)


@pytest.mark.parametrize(("length", "lanes"), [(64, 3), (66, 4), (64, 1)])
def test_axis_lines_model_refuses(length: int, lanes: int) -> None:
    with pytest.raises(ValueError, match="axis_lines: lanes"):
        AxisLines(length, lanes)
