"""test_line: every clock of the RTL against the model, and the model against the formula."""

import dataclasses
import functools

import cocotb
import numpy as np
import pytest
from harness import (
    TwinBench,
    as_integer,
    drive_settings,
    each,
    generator,
    parameters,
    port,
    simulate,
)

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.fixed.quarter_wave import amplitude, error_bound
from vrscan.fixed.test_line import (
    LINE_LATENCY,
    MIN_GAP,
    NOISE_PEAK,
    SEED_MASK,
    START_LATENCY,
    WAVE_ONE,
    WAVE_WIDTH,
    TestLine,
    draws,
    least_period,
    lines,
    positions,
    step_of_width,
)
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.registers.chain_registers import Registers
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.settings import TestLineSettings as Settings

ELABORATIONS = [
    {"LineLength": 2048, "PixelWidth": 12},
    {"LineLength": 1024, "PixelWidth": 10},
    {"LineLength": 64, "PixelWidth": 8},
    {"LineLength": 100, "PixelWidth": 16},
]
PX = 1 << pkg.POSITION_FRACTION
FULL = (1 << pkg.ALIGNED_WIDTH) - 1
CALM = Settings(
    position=30 * PX + 1234,
    move=5 * PX // 4,
    step=step_of_width(20),
    height=40_000,
    pedestal=3_000,
    noise=1_500,
    seed=20100301,
    lines=3,
    period_clks=0,
)
with_changes = functools.partial(dataclasses.replace, CALM)


def any_settings(draw: np.random.Generator, line_length: int) -> Settings:
    """Return settings of every magnitude, extremes among them."""

    def any_of(width: int) -> int:
        most = (1 << width) - 1
        kind = draw.random()
        if kind < 0.1:
            return most * int(draw.integers(2))
        return int(draw.integers(most + 1)) >> int(draw.integers(width) if kind < 0.5 else 0)

    length = line_length * PX
    wide = draw.random() < 0.3
    return Settings(
        position=any_of(24) if wide else int(draw.integers(length)),
        move=any_of(24) - (1 << 23) if wide else int(draw.integers(-length, length)),
        step=any_of(29) if draw.random() < 0.4 else step_of_width(1 + 254 * draw.random() ** 2),
        height=any_of(16),
        pedestal=any_of(16),
        noise=any_of(16),
        seed=any_of(32),
        lines=int(draw.integers(0, 4)),
        period_clks=line_length + int(draw.integers(-9, 40)),
    )


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("test_start", "test_stop")

    def __init__(self, dut) -> None:
        super().__init__(dut, self.strobes)
        self.starts: list[int] = []
        self.ends: list[int] = []
        self.ran: list[int] = []
        self.pixels: list[int] = []

    def on_port(self, name: str, value: int) -> tuple[str, int]:
        return f"{name}_strobe", value

    def change(self, settings: Settings) -> None:
        """Set the registers."""
        drive_settings(self.dut, settings, prefix="test_")
        self.twin.settings = settings

    async def start(self, **inputs: int) -> None:
        """Reset for a clock, with these inputs."""
        given = parameters()
        twin = TestLine(CALM, given["LineLength"], given["PixelWidth"])
        await self.reset_to(twin, test_start=0, test_stop=0, **inputs)
        self.change(CALM)
        self.forget()
        self.check()

    def forget(self) -> None:
        """Count clocks and pixels from here."""
        self.clock = 0
        for seen in (self.starts, self.ends, self.ran, self.pixels):
            seen.clear()

    def check(self) -> None:
        """Compare all outputs."""
        dut, twin = self.dut, self.twin
        got = tuple(
            as_integer(handle)
            for handle in (dut.line_start_o, dut.line_end_o, dut.pixel_valid_o, dut.test_running_o)
        )
        want = (twin.line_start, twin.line_end, twin.pixel_valid, twin.running)
        where = f"clock {self.clock}, {self.inputs}, {twin.settings}"
        assert got == want, f"{where}: start, end, valid, running {got}, want {want}"
        if twin.pixel_valid:
            got_pixel = int(dut.pixel_o.value)
            assert got_pixel == twin.pixel, f"{where}: pixel {got_pixel}, want {twin.pixel}"
            self.pixels.append(got_pixel)
        if twin.line_start:
            self.starts.append(self.clock)
        if twin.line_end:
            self.ends.append(self.clock)
        if twin.running:
            self.ran.append(self.clock)

    async def run(self, settings: Settings, clocks: int) -> None:
        """Begin a run; behind the strobe the registers carry something else."""
        self.change(settings)
        self.forget()
        await self.clocks(test_start=1)
        self.change(
            with_changes(
                position=~settings.position & 0xFFFFFF,
                seed=~settings.seed % 2**32,
                step=~settings.step % (1 << 29),
                lines=9,
                height=~settings.height & FULL,
                noise=~settings.noise & FULL,
                pedestal=~settings.pedestal & FULL,
                move=~settings.move,
                period_clks=~settings.period_clks & 0xFFFFFF,
            )
        )
        await self.clocks(clocks - 1)


@cocotb.test()
async def random_runs(dut) -> None:
    """Settings of every size; runs that end, that are stopped, and that are begun anew."""
    draw = generator(1)
    bench = await Bench.started(dut)
    length = parameters()["LineLength"]
    count = 120 if length < 1000 else 6
    for _ in range(count):
        settings = any_settings(draw, length)
        await bench.run(settings, int(draw.integers(1, 4 * length)))
        if draw.random() < 0.6:
            await bench.clocks(test_stop=1)
            await bench.clocks(int(draw.integers(1, length + 60)))
    assert dut.test_running_o.value.is_resolvable


@cocotb.test()
async def a_run_is_its_lines(dut) -> None:
    """Count, period and latency; the pixels are those of the whole lines."""
    bench = await Bench.started(dut)
    given = parameters()
    length = given["LineLength"]
    for settings in (
        CALM,
        with_changes(lines=1),
        with_changes(period_clks=length + MIN_GAP + 1),
        with_changes(period_clks=length + MIN_GAP - 1),
        with_changes(period_clks=length + 300, height=FULL, noise=FULL),
        with_changes(position=(length - 1) * PX, move=PX),  # to LineLength, which is 0
        with_changes(position=PX, move=-PX),  # to 0, which is not LineLength
    ):
        period = max(settings.period_clks, least_period(length))
        await bench.run(settings, START_LATENCY + 5 * period)
        assert bench.starts == [START_LATENCY + k * period for k in range(settings.lines)]
        assert bench.ends == [start + length - 1 for start in bench.starts]
        assert bench.ran == list(range(1, bench.ends[-1] + 1))
        want = lines(settings, line_length=length, pixel_width=given["PixelWidth"])
        assert bench.pixels == want.ravel().tolist()


@cocotb.test()
async def a_stop_ends_the_run_with_a_whole_line(dut) -> None:
    """At every moment about a line's begin; and a run without end goes on until then.

    ``lead`` is from the clock behind the stop to the second line's start.
    """
    bench = await Bench.started(dut)
    length = parameters()["LineLength"]
    leads = [LINE_LATENCY, LINE_LATENCY - 1]
    if length < 1000:
        leads += [LINE_LATENCY + 1, LINE_LATENCY - 2, 1, 0, -1, -length // 2, 1 - length]
    for lead in leads:
        await bench.run(with_changes(lines=0), START_LATENCY + least_period(length) - lead - 1)
        await bench.clocks(test_stop=1)
        await bench.clocks(2 * length + 99)
        assert len(bench.starts) == len(bench.ends) == 1 + (lead < LINE_LATENCY)
        assert not bench.twin.running
    # Before the first line, in the clock of the start, and without a run.
    for wait in (1, START_LATENCY - LINE_LATENCY - 1):
        await bench.run(CALM, wait)
        await bench.clocks(test_stop=1)
        await bench.clocks(length + 60)
        assert not bench.starts and bench.ran == list(range(1, wait + 2))
    bench.change(with_changes(lines=1))
    await bench.clocks(test_stop=1)
    await bench.clocks(START_LATENCY + length + 9, test_start=1, test_stop=1)
    assert len(bench.ends) == 1


@cocotb.test()
async def a_start_at_every_age_begins_anew(dut) -> None:
    """The line that is on its way loses its rest; the new run knows nothing of the old one."""
    bench = await Bench.started(dut)
    given = parameters()
    length = given["LineLength"]
    last = START_LATENCY + length
    ages = [*range(1, last + 30)] if length < 100 else [*range(1, 30, 3), last - 1, last, last + 9]
    ages = ages if length < 1000 else [START_LATENCY - 1, START_LATENCY + 9]
    for age in ages:
        await bench.run(with_changes(lines=2, height=FULL), age)
        await bench.run(with_changes(lines=1), last + 9)
        want = lines(with_changes(lines=1), line_length=length, pixel_width=given["PixelWidth"])
        assert bench.starts == [START_LATENCY] and bench.pixels == want.ravel().tolist()


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """Alone and with a start: nothing comes after it, and the next run is right."""
    bench = await Bench.started(dut)
    length = parameters()["LineLength"]
    last = START_LATENCY + length
    ages = [*range(1, 42), last - 2, last - 1, last, last + 9] if length < 1000 else [1, 20, 50]
    for age in ages:
        await bench.run(CALM, age)
        await bench.start()
        await bench.clocks(last + 20)
        assert not bench.ran
        if age % 8 == 1:
            await bench.run(with_changes(lines=1), age)
            port(dut, "test_start_strobe_i").value = 1
            bench.inputs["test_start"] = None
            await bench.start()
            await bench.clocks(last + 20)
            assert not bench.ran
            await bench.run(with_changes(lines=1), last + 9)
            assert len(bench.ends) == 1


@pytest.mark.parametrize("elaboration", each(ELABORATIONS, 3), ids=str)
def test_test_line_rtl_equals_model(elaboration: dict[str, int]) -> None:
    simulate("test_line", __file__, elaboration)


# ---- the model alone ----


def test_a_pulse_is_a_raised_cosine() -> None:
    """Of 16-bit pixels against float64, at every width and place."""
    draw = generator(2)
    # A pixel's rounding; the cosine's error, of half the height; its amplitude; the phase's.
    floor = 0.5
    wave = error_bound(WAVE_WIDTH) / 2
    scale = 2**16 - WAVE_ONE
    worst, bound = 0.0, floor + wave + scale + 0.1
    for width in [1, 1.5, 2, 3, 255, *draw.uniform(1, 255, 200).tolist()]:
        settings = with_changes(
            position=int(draw.integers(2048 * PX)),
            move=int(draw.integers(-100 * PX, 100 * PX)),
            step=step_of_width(width),
            noise=0,
            pedestal=int(draw.integers(4000)),
            height=int(draw.integers(60_000)),
            lines=4,
        )
        got = lines(settings, pixel_width=16)
        places = positions(settings, 4, line_length=2048) / PX
        away = np.abs(np.arange(2048) - places[:, None])
        bell = np.where(away < width / 2, 1 + np.cos(2 * np.pi * away / width), 0) / 2
        want = settings.pedestal + settings.height * bell
        worst = max(worst, float(np.abs(got - want).max()))
    print(f"\npulse: measured {worst:.2f}, predicted {bound:.2f}, floor {floor} counts of 2**16")
    assert worst <= bound


def test_a_sweep_is_seen_by_its_centroid() -> None:
    """Over a pixel: the pulse is narrow, so its own centroid is off by some 1/1000 px."""
    settings = with_changes(position=700 * PX, move=PX // 64, noise=0, pedestal=0, lines=64)
    got = lines(settings, pixel_width=16).astype(float)
    centroid = got @ np.arange(2048) / got.sum(axis=1)
    error = np.abs(centroid - (700 + np.arange(64) / 64)).max()
    print(f"\ncentroid against the position: {error:.2e} px")
    assert error < 1e-3


@pytest.mark.parametrize(("window", "doubled"), [("threshold", 1), ("two_pass", 1), ("fit", 2)])
def test_the_chain_finds_the_pulse_where_it_was_put(window: str, doubled: int) -> None:
    """The registers' reset values: every point is measured, and off by its own uncertainty.

    The chain's sigma counts the electrons' noise too, which test lines do not have. Their pulse is
    no Gaussian: it is not fitted, and sigma is at least twice that of a fit.
    """
    values = {name: REGISTERS[f"test_{name}"].reset[0] for name in vars(CALM)}
    settings = dataclasses.replace(Settings(**values), lines=400)
    made = lines(settings)
    zero = np.zeros(400, np.int64)
    power = np.full(400, 1 << 15)
    registers = Registers.from_config(Config.model_validate({"peak": {"window": window}}))
    found = run_fixed(made, zero, power, registers)
    assert found.measured.all()
    error = found.position / PX - positions(settings, 400, line_length=2048) / PX
    deviation, bound = error.std(), found.sigma.mean() / (1 << pkg.SIGMA_FRACTION)
    print(f"\nchain against test lines: mean {error.mean():.4f}, deviation {deviation:.4f} px, ")
    print(f"the chain's own sigma {bound:.4f} px")
    assert abs(error.mean()) < 4 * deviation / 20 + 0.001
    assert 0.5 * bound < doubled * deviation < bound


def test_a_step_of_zero_is_a_flat_line() -> None:
    """And a width of a pixel is one of them."""
    flat = lines(with_changes(step=0, noise=0, lines=1), pixel_width=16)
    assert np.all(flat == round(3000 + 40_000 * WAVE_ONE / 2**16))
    one = lines(with_changes(step=step_of_width(1), position=9 * PX, noise=0, lines=1))
    assert np.flatnonzero(one != one[0, 0]).tolist() == [9]


def test_pixels_are_rounded_once_and_saturate() -> None:
    """Half a step goes up; below zero is zero, beyond full scale is full scale."""
    for width in (8, 12, 16):
        step = 1 << 16 - width
        for pedestal in {0, step // 2 - 1, step // 2, step, FULL - step, FULL} - {-1}:
            got = lines(
                with_changes(pedestal=pedestal, height=0, noise=0, lines=1), pixel_width=width
            )
            assert np.all(got == min((pedestal + step // 2) // step, (1 << width) - 1))
        noisy = lines(with_changes(pedestal=0, height=0, noise=FULL, lines=9), pixel_width=width)
        assert 0.4 < np.mean(noisy == 0) < 0.6
        noisy = lines(with_changes(pedestal=FULL, height=0, noise=FULL, lines=9), pixel_width=width)
        assert 0.4 < np.mean(noisy == (1 << width) - 1) < 0.6
        both = lines(with_changes(pedestal=FULL, height=FULL, noise=FULL, step=0, lines=1))
        assert np.all(both == 4095)


def test_a_sweep_stays_on_the_sensor() -> None:
    """One addition of the length brings back what a move carried off; 8192 px are a turn."""
    for length, move in ((2048, 7 * PX + 5), (2048, -7 * PX - 5), (100, 99 * PX), (8192, -PX)):
        settings = with_changes(position=50 * PX, move=move)
        got = positions(settings, 3000, line_length=length)
        want = (50 * PX + move * np.arange(3000)) % (length * PX)
        assert np.array_equal(got, want)
    far = positions(with_changes(position=(1 << 25) - 1, move=(1 << 23) - 1), 3, line_length=100)
    assert far.tolist()[1] == ((1 << 25) + (1 << 23) - 2 - 100 * PX) % (1 << 25)


def test_the_noise_is_a_bell() -> None:
    """Mean, deviation and fourth moment of a sum of four bytes; no pixel knows another."""
    count = 1 << 22
    got = draws(1, count).astype(float)
    deviation = np.sqrt(4 * (256**2 - 1) / 12)
    # The fourth moment of a sum of n is 3 - 6/5 (N^2 + 1) / (N^2 - 1) / n.
    kurtosis = 3 - 6 / 5 * (256**2 + 1) / (256**2 - 1) / 4
    found = (got**4).mean() / got.var() ** 2
    print(
        f"\nnoise: mean {got.mean():.3f}, want 0; deviation {got.std():.3f}, want {deviation:.3f}"
    )
    print(f"fourth moment {found:.4f}, want {kurtosis:.4f}; peak {np.abs(got).max():.0f}")
    assert abs(got.mean()) < 5 * deviation / np.sqrt(count)
    assert abs(got.std() / deviation - 1) < 5 / np.sqrt(2 * count)
    assert abs(found - kurtosis) < 5 * np.sqrt(24 / count)
    assert np.abs(got).max() <= NOISE_PEAK
    for lag in (*range(1, 40), 64, 2048):
        related = (got[:-lag] * got[lag:]).mean() / got.var()
        assert abs(related) < 5 / np.sqrt(count), f"lag {lag}: {related}"


def test_the_noise_steps_as_it_is_written() -> None:
    """Against the recurrence, one pixel after the other."""
    for seed in (0, 1, SEED_MASK, (1 << 32) - 1, 77):
        x = seed ^ SEED_MASK or SEED_MASK
        want = []
        for _ in range(5000):
            x ^= (x << 13) & 0xFFFFFFFF
            x ^= x >> 17
            x ^= (x << 5) & 0xFFFFFFFF
            want.append(sum(x.to_bytes(4, "little")) - 510)
        assert draws(seed, 5000).tolist() == want
    assert np.array_equal(draws(SEED_MASK, 99), draws(0, 99))


def test_the_cosine_never_exceeds_its_one() -> None:
    """Or 1 + cos would wrap below zero: amplitude and error bound stay below a step more."""
    assert amplitude(WAVE_WIDTH) + error_bound(WAVE_WIDTH) < WAVE_ONE + 1


def test_a_prefix_of_a_run_is_the_same() -> None:
    """Of lines that are worked out in blocks, too."""
    settings = with_changes(lines=0)
    many = lines(settings, 33_000, line_length=64)
    assert many.shape == (33_000, 64) and many.dtype == np.uint16
    assert np.array_equal(lines(settings, 32_900, line_length=64), many[:-100])
    place = int(positions(settings, 33_000, line_length=64)[-1])
    last = lines(with_changes(position=place, noise=0), 1, line_length=64)
    quiet = lines(with_changes(noise=0, lines=0), 33_000, line_length=64)
    assert np.array_equal(quiet[-1], last[0])


def test_a_run_without_end_and_bad_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="without end"):
        lines(with_changes(lines=0))
    for length, width in ((63, 12), (8193, 12), (2048, 7), (2048, 17)):
        with pytest.raises(ValueError, match="line_length"):
            lines(CALM, line_length=length, pixel_width=width)
