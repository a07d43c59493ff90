"""uart_tx: every clock of the RTL against the model, and the line against a float-time receiver."""

from math import ceil

import cocotb
import numpy as np
import pytest
from frame_oracle import on_the_line
from harness import (
    FallingEdge,
    TwinBench,
    as_integer,
    drive,
    generator,
    simulate,
)

from vrscan.clocked.uart_tx import LATENCY, UartTx

ONE = 1 << 24
FASTEST = 1 << 21
LINK = round(3e6 / 125e6 * ONE)  # 3 Mbaud
OUTPUTS = ("ready", "tx", "busy")
QUIET = {"valid": False, "data": 0, "step": FASTEST, "break_": False}


def heard(line: list[int], clocks_per_bit: float) -> tuple[list[int], list[int]]:
    """Receive with a clock in float time: the bytes, and the clock each began in."""
    data, begins = [], []
    at = 0
    while True:
        while at < len(line) and line[at]:
            at += 1
        ticks = [int(at + (k + 0.5) * clocks_per_bit) for k in range(10)]
        if at == len(line) or ticks[-1] >= len(line):
            return data, begins
        bits = [line[tick] for tick in ticks]
        assert bits[0] == 0 and bits[9] == 1, f"no frame at clock {at}: {bits}"
        data.append(sum(bit << k for k, bit in enumerate(bits[1:9])))
        begins.append(at)
        at = ticks[-1]


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.handles = [getattr(dut, f"{name}_o") for name in OUTPUTS]
        self.line: list[int] = []

    def give(self, **inputs: int) -> None:
        """Change inputs; ``break`` is a word of Python's."""
        for name, value in inputs.items():
            if self.inputs[name] != value:
                drive(getattr(self.dut, f"{name.rstrip('_')}_i"), value)
                self.inputs[name] = value

    async def start(self, **inputs: int) -> None:
        """Reset for a clock, with these inputs."""
        await self.reset_to(UartTx(), **(QUIET | inputs))
        self.line = []
        self.compare()

    def compare(self) -> None:
        got = tuple(as_integer(handle) for handle in self.handles)
        want = tuple(int(getattr(self.twin, name)) for name in OUTPUTS)
        assert got == want, f"clock {self.clock}, {self.inputs}: {OUTPUTS} {got}, want {want}"

    def check(self) -> None:
        """Compare all outputs and keep the line."""
        self.compare()
        self.line.append(int(self.twin.tx))

    async def send(self, data: list[int]) -> None:
        """Give bytes as soon as they are taken."""
        for byte in data:
            self.give(valid=True, data=byte)
            while not self.twin.ready:
                await self.clocks()
            await self.clocks()
        self.give(valid=False, data=0x5A)

    async def finish(self) -> None:
        """Go on until all is sent."""
        while self.twin.busy:
            await self.clocks()


@cocotb.test()
async def random_inputs(dut) -> None:
    """Bytes with and without gaps, breaks and changes of the rate, in any order."""
    draw = generator(1)
    bench = await Bench.started(dut)
    for _ in range(1500):
        if draw.random() < 0.02:
            step = int(draw.choice([0, 1 << 18, LINK, FASTEST, 1 << 22, ONE - 1]))
            bench.give(step=step)
        pressed = draw.random() < 0.02
        valid = bool(draw.random() < 0.6)
        await bench.clocks(
            int(draw.integers(1, 25)), valid=valid, data=int(draw.integers(256)), break_=pressed
        )
    for _ in range(4000):
        await bench.clocks(
            valid=bool(draw.random() < 0.3),
            data=int(draw.integers(256)),
            step=int(draw.integers(ONE)) >> int(draw.integers(5)),
            break_=bool(draw.random() < 0.01),
        )


@cocotb.test()
async def bytes_with_gaps(dut) -> None:
    """A receiver in float time hears what was sent, and how soon."""
    draw = generator(2)
    bench = await Bench.started(dut)
    for step in (FASTEST, LINK, 1_234_567, 1 << 19, 3 << 20, 1 << 22):
        await bench.start(step=step)
        data = draw.integers(0, 256, 60).tolist()
        given = []
        for byte in data:
            await bench.finish()
            await bench.clocks(int(draw.integers(0, 40)))
            given.append(bench.clock)
            await bench.send([byte])
        await bench.finish()
        await bench.clocks(20)
        got, begins = heard(bench.line, ONE / step)
        assert got == data
        # line[n] is the line after n + 1 clocks.
        assert [b + 1 - g for b, g in zip(begins, given, strict=True)] == [LATENCY] * len(data)


@cocotb.test()
async def back_to_back_without_a_gap(dut) -> None:
    """The line of a run is bit floor(n * step / 2**24) in its clock n: no gap, exact mean rate."""
    draw = generator(3)
    bench = await Bench.started(dut)
    for step, count in ((FASTEST, 256), (LINK, 100), (1_999_999, 200), (15_461, 3), (5 << 20, 99)):
        await bench.start(step=step)
        data = draw.permutation(256)[:count].tolist()
        await bench.send(data)
        await bench.finish()
        begins = bench.line.index(0)
        bits = [bit for byte in data for bit in on_the_line(byte)]
        run = bench.line[begins:]
        want = [bits[n * step >> 24] for n in range(ceil(len(bits) * ONE / step))]
        assert run[: len(want)] == want and all(run[len(want) :])
        assert len(run) <= len(want) + 1, "busy for longer than its bytes"
        assert heard([*run, 1, 1], ONE / step)[0] == data
        if step == FASTEST:
            assert len(want) == 80 * count


@cocotb.test()
async def break_holds_the_line(dut) -> None:
    """From every moment of two frames: low at once and as long as asked for, then the next byte."""
    bench = await Bench.started(dut)
    for age in range(175):
        await bench.start()
        bench.give(valid=True, data=0xA7)
        await bench.clocks()
        bench.give(valid=True, data=0x3C)
        for _ in range(age):
            if bench.twin.ready and bench.inputs["valid"]:
                await bench.clocks()
                bench.give(valid=False)
            else:
                await bench.clocks()
        bench.give(valid=False)
        waits = not bench.twin.ready
        byte = 0xA7 if age < 1 else 0x3C
        at = len(bench.line)
        length = 1 + age % 120
        await bench.clocks(length, break_=True)
        assert not any(bench.line[at:]) and bench.twin.busy
        bench.give(break_=False)
        await bench.finish()
        await bench.clocks(3)
        after = bench.line[at + length :]
        assert all(after[:15]), "two bits less a clock"
        assert heard(after, 8.0)[0] == ([byte] if waits else [])
        if not waits:
            assert all(after)
    # A byte given in a break waits for its end.
    await bench.start()
    await bench.clocks(30, break_=True)
    await bench.send([0x96])
    await bench.clocks(200)
    assert not any(bench.line) and not bench.twin.ready
    bench.give(break_=False)
    await bench.finish()
    rest = bench.line[bench.line.index(1) :]
    assert all(rest[:15]) and heard([*rest, 1, 1], 8.0)[0] == [0x96]


@cocotb.test()
async def a_step_of_zero_stops_the_line(dut) -> None:
    """And it goes on from there."""
    bench = await Bench.started(dut)
    await bench.send([0x0F])
    await bench.clocks(20)
    level = bench.line[-1]
    at = len(bench.line)
    await bench.clocks(500, step=0)
    assert set(bench.line[at:]) == {level}
    bench.give(step=FASTEST)
    await bench.finish()
    assert heard([*bench.line[:at], *bench.line[at + 500 :], 1, 1], 8.0)[0] == [0x0F]


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """With a byte waiting, one on the line or a break: the line rests, and the next is right."""
    bench = await Bench.started(dut)
    for age in range(190):
        await bench.start()
        bench.give(valid=True, data=0x12)
        await bench.clocks(age, break_=False)
        if age % 3 == 2:
            await bench.clocks(1 + age // 3, break_=True)
        await bench.start(valid=bool(age % 2), break_=bool(age % 4 == 3), data=0x33)
        bench.give(valid=False, break_=False)
        await bench.clocks(20 if age % 5 else 0)
        assert all(bench.line)
        await bench.send([0xC5])
        await bench.finish()
        assert heard([*bench.line, 1, 1], 8.0)[0] == [0xC5]


@cocotb.test()
async def no_output_before_the_clock(dut) -> None:
    """In reset the line rests and nothing is busy."""
    bench = await Bench.started(dut)
    await bench.send([0x00])
    await bench.clocks(30)
    dut.rst_i.value = 1
    for _ in range(5):
        await FallingEdge(dut.clk_i)
        assert dut.tx_o.value == 1 and dut.busy_o.value == 0


def test_uart_tx_rtl_equals_model() -> None:
    simulate("uart_tx", __file__)


def test_uart_tx_model_mean_rate_is_exact() -> None:
    """Bytes without a gap: every edge is less than a clock behind the first and k bits."""
    draw = generator(4)
    worst = 0.0
    for step in [FASTEST, LINK, 1_000_003, *draw.integers(1 << 19, 1 << 22, 5).tolist()]:
        twin = UartTx()
        levels = []
        for _ in range(3000 * ONE // step):
            twin.step(valid=True, data=0x55, step=step, break_=False)
            levels.append(twin.tx)
        # 0x55: the line changes with every bit, so edge k is k bits after the first.
        edges = np.flatnonzero(np.diff(np.array(levels, np.int64)))
        late = edges - edges[0] - np.arange(len(edges)) * ONE / step
        assert len(edges) > 2990 and late.min() >= 0 and late.max() < 1
        worst = max(worst, float(late.max()))
    print(f"an edge's lateness, clocks: measured {worst:.6f} / predicted < 1 / floor 0")


@pytest.mark.parametrize(("data", "step"), [(256, 1), (-1, 1), (0, ONE), (0, -1)])
def test_uart_tx_model_rejects_what_does_not_fit(data: int, step: int) -> None:
    with pytest.raises(ValueError, match="uart_tx: "):
        UartTx().step(valid=True, data=data, step=step, break_=False)
