"""uart_rx: every clock of the RTL against the model, and bytes from a transmitter in float time."""

from collections.abc import Sequence

import cocotb
import numpy as np
import pytest
from frame_oracle import on_the_line
from harness import (
    TwinBench,
    as_integer,
    generator,
    simulate,
)

from vrscan.clocked.uart_rx import STEP_MAX, STEP_MAX_MAJORITY, UartRx, latency
from vrscan.clocked.uart_tx import UartTx

ONE = 1 << 24
FASTEST = STEP_MAX_MAJORITY
LINK = round(3e6 / 125e6 * ONE)  # 3 Mbaud
OUTPUTS = ("valid", "framing", "break_", "glitch")
QUIET = {"rx": True, "step": FASTEST}
HARD = [0x00, 0xFF, 0x80, 0x7F, 0x55, 0xAA, 0x01, 0xFE, 0x00, 0x00, 0x80, 0x80, 0xFF, 0xFF]


def sampled(
    levels: Sequence[int],
    clocks_per_bit: float,
    *,
    lengths: np.ndarray | None = None,
    jitter: np.ndarray | None = None,
    phase: float = 0.0,
) -> np.ndarray:
    """Return a line in float time, sampled by the clock.

    Args:
        levels: One after the other.
        clocks_per_bit: The transmitter's.
        lengths: Bits for which each level lasts; one if None.
        jitter: What the beginning of each level is late, clocks.
        phase: Clocks by which all of it is late.
    """
    lengths = np.ones(len(levels)) if lengths is None else lengths
    begins = phase + np.concatenate([[0.0], np.cumsum(lengths)]) * clocks_per_bit
    end = int(begins[-1])
    begins = begins[:-1] + (0.0 if jitter is None else jitter)
    return np.asarray(levels)[np.searchsorted(begins[1:], np.arange(end), side="right")]


def run_of(data: Sequence[int], gaps: np.ndarray | None = None) -> tuple[list[int], np.ndarray]:
    """Return levels and their lengths: the line at rest, and bytes, ``gaps`` bits after each."""
    levels, lengths = [1], [3.0]
    for k, byte in enumerate(data):
        levels += on_the_line(byte)
        lengths += [1.0] * 10
        if gaps is not None:
            lengths[-1] += gaps[k]
    return [*levels, 1], np.array([*lengths, 3.0])


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.handles = [getattr(dut, f"{name.rstrip('_')}_o") for name in OUTPUTS]
        self.events: list[tuple[int, str]] = []
        self.data: list[int] = []

    async def start(self, **inputs: int) -> None:
        """Reset for a clock, with these inputs."""
        await self.reset_to(UartRx(), **(QUIET | inputs))
        self.events = []
        self.data = []
        self.check()

    def check(self) -> None:
        """Compare all that is defined."""
        twin = self.twin
        got = tuple(as_integer(handle) for handle in self.handles)
        want = tuple(int(getattr(twin, name)) for name in OUTPUTS)
        assert got == want, f"clock {self.clock}, {self.inputs}: {OUTPUTS} {got}, want {want}"
        self.events += [(self.clock, name) for name in OUTPUTS if getattr(twin, name)]
        if twin.valid:
            byte = int(self.dut.data_o.value)
            assert byte == twin.data, f"clock {self.clock}: data {byte:#x}, want {twin.data:#x}"
            self.data.append(byte)

    async def line(self, levels: Sequence[int]) -> None:
        """Drive the line, a level a clock."""
        for level in levels:
            await self.clocks(rx=bool(level))

    def kinds(self) -> list[str]:
        """Return the events without their times."""
        return [kind for _, kind in self.events]


@cocotb.test()
async def random_levels(dut) -> None:
    """Levels without any order, of all lengths, at rates that change: every event comes about."""
    draw = generator(1)
    bench = await Bench.started(dut)
    total = dict.fromkeys(OUTPUTS, 0)
    for most in (3, 20, 80, 300):
        for step in (FASTEST, LINK, FASTEST + 1, STEP_MAX, 1_500_000):
            await bench.start(step=step)
            level = True
            for _ in range(8000 // most):
                level = not level
                if draw.random() < 0.05:
                    bench.give(step=int(draw.integers(1 << 18, STEP_MAX + 1)))
                elif draw.random() < 0.1:
                    bench.give(step=step)
                await bench.clocks(int(draw.integers(1, most + 1)), rx=level)
            for kind in bench.kinds():
                total[kind] += 1
    assert all(count > 10 for count in total.values()), total


@cocotb.test()
async def a_rate_that_changes_every_clock(dut) -> None:
    """What comes out means nothing, but it is defined."""
    draw = generator(9)
    bench = await Bench.started(dut)
    for least in (3, 2, 0):
        await bench.start()
        for _ in range(8000):
            step = int(draw.integers(ONE)) >> int(draw.integers(least, 6))
            await bench.clocks(rx=bool(draw.random() < 0.3), step=step)
        assert len(bench.events) > 50
    # A start bit that skips its first two samples has nothing of the bits before it.
    await bench.start()
    await bench.clocks(30)
    await bench.clocks(2, rx=False)
    await bench.clocks(step=1 << 23)
    await bench.clocks(2, rx=True, step=1)
    await bench.clocks(10, step=FASTEST)
    assert bench.events == []


@cocotb.test()
async def bytes_with_gaps(dut) -> None:
    """A transmitter in float time, any phase, with gaps of any length: its bytes and no more."""
    draw = generator(2)
    bench = await Bench.started(dut)
    for step in (FASTEST, LINK, 1_234_567, 1 << 19, STEP_MAX):
        await bench.start(step=step)
        data = [*range(256)] if step == FASTEST else draw.integers(0, 256, 40).tolist()
        gaps = np.where(draw.random(len(data)) < 0.5, draw.uniform(0, 6, len(data)), 0.0)
        error = draw.uniform(-0.015, 0.015)
        levels, lengths = run_of(data, gaps)
        await bench.line(sampled(levels, ONE / step * (1 + error), lengths=lengths))
        assert bench.data == data
        assert bench.kinds() == ["valid"] * len(data)


@cocotb.test()
async def back_to_back_three_percent_off(dut) -> None:
    """At clk/8, edges off by half a clock: any two of them are then a clock off at most."""
    draw = generator(3)
    bench = await Bench.started(dut)
    for error in (-0.03, 0.03, 0.0):
        await bench.start()
        data = [*HARD, *draw.integers(0, 256, 150).tolist()]
        levels, lengths = run_of(data)
        jitter = draw.choice([-0.5, 0.5], len(levels))
        await bench.line(sampled(levels, 8 * (1 + error), lengths=lengths, jitter=jitter))
        assert bench.data == data
        assert bench.kinds() == ["valid"] * len(data)


@cocotb.test()
async def latency_at_every_rate(dut) -> None:
    """From the first low sample to valid, framing and break."""
    bench = await Bench.started(dut)
    for step in (FASTEST, LINK, 1_000_003, 1 << 20, 1 << 18, FASTEST + 1, 3_000_000, STEP_MAX):
        for levels, kinds in (
            (on_the_line(0xA6), ["valid"]),
            ([*on_the_line(0xA6)[:9], 0], ["valid", "framing"]),
            ([0] * 10, ["framing", "break_"]),
        ):
            await bench.start(step=step)
            await bench.clocks(10)
            at = bench.clock
            await bench.line(sampled(levels, ONE / step))
            await bench.clocks(10, rx=True)
            assert bench.events == [(at + 1 + latency(step), kind) for kind in kinds]
    assert latency(FASTEST) == 78


@cocotb.test()
async def glitches_are_no_start_bits(dut) -> None:
    """Low for less than half a bit: ignored and told; a byte right after it is received."""
    bench = await Bench.started(dut)
    for step, longest in ((FASTEST, 3), (1 << 18, 31), (LINK, 20), (STEP_MAX, 1)):
        for width in {1, 2, longest, longest + 2}:
            if width > longest and step == STEP_MAX:
                continue
            await bench.start(step=step)
            await bench.clocks(10)
            await bench.clocks(width, rx=False)
            await bench.clocks(5 * ONE // (8 * step) + 1 - min(width, 2), rx=True)
            if width > longest:
                await bench.clocks(10 * ONE // step)
                assert bench.kinds() == ["valid"] and bench.data == [0xFF]
                continue
            await bench.line(sampled(on_the_line(0x5C), ONE / step))
            await bench.clocks(5, rx=True)
            assert bench.kinds() == ["glitch", "valid"], (step, width)
            assert bench.data == [0x5C]


@cocotb.test()
async def a_clock_of_noise_in_every_bit(dut) -> None:
    """One wrong sample a bit, anywhere: the majority is right, and so is the stop bit."""
    draw = generator(4)
    bench = await Bench.started(dut, step=1 << 20)
    await bench.clocks(20)
    data = draw.integers(0, 256, 100).tolist()
    for byte in data:
        line = np.repeat(on_the_line(byte), 16)
        for k in range(9):  # at its very beginning a start bit would begin later
            line[16 * k + int(draw.integers(1 if k == 0 else 0, 16))] ^= 1
        # The stop bit's last sample rests: after it, a low one is a start.
        line[144 + int(draw.integers(0, 9))] ^= 1
        await bench.line(line)
        await bench.clocks(int(draw.integers(0, 20)), rx=True)
    await bench.clocks(20)
    assert bench.data == data and bench.kinds() == ["valid"] * len(data)


@cocotb.test()
async def low_stop_bits(dut) -> None:
    """The byte comes with framing; nothing is a start until the line was high, then all is well."""
    bench = await Bench.started(dut)
    for byte in (0x01, 0x80, 0xFF, 0x5A):
        for low in (1, 2, 7, 11, 40):
            await bench.start()
            await bench.clocks(20)
            await bench.line(sampled([*on_the_line(byte)[:9], *[0] * low], 8.0))
            await bench.clocks(1, rx=True)
            await bench.line(sampled(on_the_line(0x3E), 8.0))
            await bench.clocks(10, rx=True)
            assert bench.kinds() == ["valid", "framing", "valid"]
            assert bench.data == [byte, 0x3E]


@cocotb.test()
async def break_is_told_once(dut) -> None:
    """Low for a frame or for a hundred: one pulse, no byte; the next byte is received."""
    bench = await Bench.started(dut)
    for clocks in (80, 81, 100, 159, 160, 161, 1000, 8000):
        await bench.start()
        await bench.clocks(20)
        await bench.clocks(clocks, rx=False)
        await bench.clocks(8, rx=True)
        await bench.line(sampled(on_the_line(0x00), 8.0))
        await bench.clocks(10, rx=True)
        assert bench.kinds() == ["framing", "break_", "valid"]
        assert bench.data == [0x00]
    # Low for all but the stop bit is a byte.
    await bench.start()
    await bench.clocks(20)
    await bench.clocks(72, rx=False)
    await bench.clocks(20, rx=True)
    assert bench.kinds() == ["valid"] and bench.data == [0]


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """Nothing of a frame, a glitch or a break is left; a low line is no start until it was high."""
    bench = await Bench.started(dut)
    lives = [sampled(on_the_line(byte) * 2, 8.0) for byte in (0xA5, 0x00)] + [np.zeros(160, int)]
    for age in range(1, 160):
        life = lives[age % 3]
        await bench.start()
        await bench.clocks(4)
        await bench.line(life[:age])
        await bench.start(rx=bool(age % 2))
        await bench.clocks(100 if age % 5 == 0 else age % 4, rx=False)
        assert bench.events == []
        await bench.clocks(1 + age % 7, rx=True)
        await bench.line(sampled(on_the_line(0x6B), 8.0))
        await bench.clocks(10, rx=True)
        assert bench.kinds() == ["valid"] and bench.data == [0x6B]
    # A strobe that is due in the clock of the reset does not come.
    byte = np.repeat(on_the_line(0x11), 8)
    low_stop = np.append(byte[:72], np.zeros(8, int))
    for line in (byte, low_stop, np.zeros(80, int), np.arange(80) >= 2):
        for age in (*range(4, 12), *range(76, 80)):
            await bench.start()
            await bench.clocks(4)
            await bench.line(line[:age])
            await bench.start()
            await bench.clocks(100)
            assert bench.events == []


def test_uart_rx_rtl_equals_model() -> None:
    simulate("uart_rx", __file__)


# ---- the model alone ----


def heard(line: np.ndarray, step: int) -> tuple[list[int], int]:
    """Return what the model makes of a line: bytes, and how often it complained."""
    twin = UartRx()
    data, faults = [], 0
    for level in line.tolist():
        twin.step(rx=bool(level), step=step)
        if twin.valid:
            data.append(twin.data)
        faults += twin.framing or twin.glitch or twin.break_
    for _ in range(4):
        twin.step(rx=True, step=step)
    return data, faults


def worst_jitters(count: int, jitter: float, draw: np.random.Generator) -> list[np.ndarray]:
    """Return what edges are late, for ``count`` bytes: the worst ways, and a random one."""
    if not jitter:
        return [np.zeros(10 * count + 2)]
    late = np.where(np.arange(10) == 0, -jitter, jitter)
    shapes = (
        np.tile(late, count),
        np.tile(-late, count),
        # The frame's start is late, the rest of it and the next start are early.
        np.tile(np.concatenate([-late, -np.abs(late)]), count)[: 10 * count],
        draw.choice([-jitter, jitter], 10 * count),
    )
    return [np.concatenate([[0.0], shape, [0.0]]) for shape in shapes]


@pytest.mark.parametrize("jitter", [0.0, 0.5, 1.0])
def test_uart_rx_model_tolerates_other_rates(jitter: float) -> None:
    """At clk/8, bytes back to back, edges off by up to ``jitter`` clocks: the limit of the rate.

    Every edge is off by itself, so two are 2 * jitter off each other. No receiver can do 3 % with
    a jitter of 1: the edge after 0x80's zeros can then be at 64 * 1.03 + 2 = 67.9 clocks, and the
    one after 0x00's at 72 * 0.97 - 2 = 67.8.
    """
    draw = generator(5)
    data = [*HARD, *draw.integers(0, 256, 10).tolist()]
    levels, lengths = run_of(data)
    grid = 0.001
    # A low majority needs an edge before sample 3, and a high one none before sample 3 + 1.
    predicted = {1: (3 - 2 * jitter) / 64, -1: (4 - 2 * jitter) / 80}
    for sign in (1, -1):
        error = 0.0
        while all(
            heard(
                sampled(levels, 8 * (1 + sign * error), lengths=lengths, jitter=j, phase=p), FASTEST
            )
            == (data, 0)
            for j in worst_jitters(len(data), jitter, draw)
            for p in np.arange(8) / 8 + 2
        ):
            error += grid
            assert error < 0.1
        measured = error - grid
        print(
            f"rate at clk/8, edges off by {jitter} clocks, {'slow' if sign > 0 else 'fast'}, %: "
            f"measured {100 * measured:.1f} / predicted {100 * predicted[sign]:.2f}"
        )
        assert measured >= 0.03 - 1e-9 or jitter == 1.0
        assert predicted[sign] - grid - 1e-9 <= measured <= predicted[sign] + 3 * grid


def test_uart_rx_model_tolerates_three_percent_at_every_rate() -> None:
    """Any step up to clk/8, 3 % slow or fast, and edges off by what is left.

    A sample is taken up to a clock before or after the middle of T clocks. The next start, 10 T
    clocks after this one, has to come after the stop bit's second: 10 T e < T / 2 - 1 - 2 J.
    """
    draw = generator(6)
    for _ in range(150):
        step = int(ONE / 8 / np.exp(draw.uniform(0, np.log(12))))
        data = draw.integers(0, 256, 8).tolist()
        for error in (-0.03, 0.03):
            levels, lengths = run_of(data)
            most = (0.2 * ONE / step - 1) / 2
            jitter = draw.choice([-most, most], len(levels))
            line = sampled(levels, ONE / step * (1 + error), lengths=lengths, jitter=jitter)
            assert heard(line, step) == (data, 0), (step, error)


def test_uart_rx_model_after_noise_receives_again() -> None:
    """Any levels, a rest of a frame, and a byte: it is the last one that comes out."""
    draw = generator(7)
    for _ in range(300):
        noise = np.repeat(draw.integers(0, 2, 60), draw.integers(1, 12, 60))
        line = np.concatenate([noise, np.ones(90, int), np.repeat(on_the_line(0xD2), 8)])
        assert heard(line, FASTEST)[0][-1] == 0xD2


@pytest.mark.parametrize("step", [STEP_MAX, 3_333_333, FASTEST, 2_000_003, LINK, 1 << 18])
def test_uart_rx_model_hears_uart_tx(step: int) -> None:
    """Both at one clock and rate, bytes back to back, and after them a break."""
    draw = generator(8)
    tx, rx = UartTx(), UartRx()
    sent: list[int] = []
    got: list[int] = []
    breaks = faults = 0
    for clock in range(900 * ONE // step):
        sending = clock < 500 * ONE // step
        byte = int(draw.integers(256))
        if sending and tx.ready:
            sent.append(byte)
        line = tx.tx
        held = 700 * ONE // step < clock < 730 * ONE // step
        tx.step(valid=sending, data=byte, step=step, break_=held)
        rx.step(rx=line, step=step)
        got += [rx.data] if rx.valid else []
        breaks += rx.break_
        faults += rx.glitch + rx.framing
    assert got == sent and len(sent) >= 50
    assert breaks == faults == 1


@pytest.mark.parametrize("step", [-1, ONE])
def test_uart_rx_model_rejects_what_does_not_fit(step: int) -> None:
    with pytest.raises(ValueError, match="uart_rx: "):
        UartRx().step(rx=True, step=step)
