"""mirror_phase: every clock of the RTL against the model, and the model against float tracking."""

from collections.abc import Callable

import cocotb
import numpy as np
import pytest
from harness import FallingEdge, UnitBench, drive, drive_settings, generator, port, simulate

from vrscan.clocked.mirror_phase import (
    FINE_WIDTH,
    FIRST_READ,
    HALF_FRACTION,
    HALF_WIDTH,
    LATENCY,
    OUTWARD_CLKS,
    TABLE_SIZE,
    MirrorPhase,
    interpolated,
)
from vrscan.data import pkg
from vrscan.registers.settings import PhaseSettings as Settings

TURN = 1 << pkg.TURN_WIDTH
WORD_MAX = (1 << pkg.WORD_WIDTH) - 1
ERROR_MAX = (1 << (pkg.ERROR_WIDTH - 1)) - 1
AMPLITUDE_MAX = (1 << pkg.AMPLITUDE_WIDTH) - 1
STATUS = ("phase", "increment", "valid", "amplitude", "acquired")
WITH_VALID = ("measured", "error")
SIGNED = {"error"}
STROBES = ("valid", "broken", "table_write", "renew")
BANKS = ("table_changed", "table_bank", "table_write_bank")
CALM = Settings(phase_shift=2, rate_shift=20, amplitude_shift=3, error_limit=1 << 24)

Table = tuple[list[int], list[int]]


def cosine_table() -> Table:
    """Return the table of a pure cosine: amplitude 0.04 / cos(2 pi h), the middle at zero."""
    h = np.arange(TABLE_SIZE) / (4.0 * TABLE_SIZE)
    amplitude = np.round(0.04 / np.cos(2.0 * np.pi * h) * 2.0**pkg.AMPLITUDE_FRACTION)
    return np.minimum(amplitude, AMPLITUDE_MAX).astype(int).tolist(), [0] * TABLE_SIZE


def random_table(draw: np.random.Generator) -> Table:
    """Return entries of any value, the corners among them."""
    amplitude = draw.integers(0, AMPLITUDE_MAX, TABLE_SIZE, endpoint=True)
    half_turn = 1 << (pkg.MIDPOINT_WIDTH - 1)
    midpoint = draw.integers(-half_turn, half_turn, TABLE_SIZE)
    amplitude[::7] = draw.choice([0, AMPLITUDE_MAX], amplitude[::7].size)
    midpoint[::5] = draw.choice([-half_turn, half_turn - 1, 0], midpoint[::5].size)
    return amplitude.tolist(), midpoint.tolist()


class Bench(UnitBench):
    """Drives the RTL and its twin with the same ports and compares every output every clock."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.twin = MirrorPhase(CALM)
        self.clock = 0
        self.measured: list[dict[str, int]] = []
        self.given: dict[str, int] = {}

    async def start(self, settings: Settings = CALM, **given: int) -> None:
        """Set the configuration and reset for a clock, with other inputs as ``given``."""
        drive_settings(self.dut, settings)
        self.dut.rst_i.value = 1
        self.drive(given)
        await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        table = self.twin.table_amplitude, self.twin.table_midpoint
        self.twin = MirrorPhase(settings)
        self.twin.table_amplitude, self.twin.table_midpoint = table
        self.clock = 0
        self.measured = []
        self.check()

    def drive(self, given: dict[str, int]) -> None:
        """Put values on ports; strobes that are not named are low, the rest holds."""
        for name, value in (dict.fromkeys(STROBES, 0) | given).items():
            if self.given.get(name) != value:
                drive(port(self.dut, f"{name}_i"), value)
                self.given[name] = value

    def outputs(self, names: tuple[str, ...]) -> tuple[list[int], list[int]]:
        """Return what the RTL and the twin say."""
        got = []
        for name in names:
            value = port(self.dut, f"{name}_o").value
            got.append(value.to_signed() if name in SIGNED else int(value))
        return got, [int(getattr(self.twin, name)) for name in names]

    def check(self) -> None:
        """Compare all that is defined."""
        names = STATUS + WITH_VALID if self.twin.valid else STATUS
        got, want = self.outputs(names)
        assert got == want, f"clock {self.clock}: {names} {got}, want {want}, {self.given}"

    async def step(self, **given: int) -> None:
        """Do one clock."""
        self.drive(given)
        await FallingEdge(self.dut.clk_i)
        ports = {**dict.fromkeys(BANKS, 0), **self.given}
        changed, bank, written = (ports.pop(name) for name in BANKS)
        ports["renew"] &= changed
        ports["table_write"] &= bank == written
        self.twin.step(**ports)
        self.clock += 1
        self.check()
        if self.twin.valid:
            names = (*STATUS, *WITH_VALID)
            self.measured.append(
                {n: int(getattr(self.twin, n)) for n in names} | {"clock": self.clock}
            )

    async def steps(self, count: int, **given: int) -> None:
        """Do ``count`` clocks alike."""
        for _ in range(count):
            await self.step(**given)

    async def write(self, table: Table) -> None:
        """Write the whole table."""
        for index, (amplitude, midpoint) in enumerate(zip(*table, strict=True)):
            await self.step(
                table_write=1,
                table_index=index,
                table_amplitude=amplitude,
                table_midpoint=midpoint,
            )

    async def pair(self, width: int, age: int = 0) -> None:
        """Send an outward, and an inward ``width`` clocks later; wait for the measurement."""
        await self.step(valid=1, outward=1, age=age)
        await self.steps(width - 1)
        await self.step(valid=1, outward=0, age=age)
        await self.steps(LATENCY - 1)


async def begin(dut, settings: Settings = CALM, table: Table | None = None) -> Bench:
    """Return a bench after its reset, its table written."""
    bench = await Bench.started(dut, settings=settings)
    await bench.write(table or cosine_table())
    await bench.start(settings)
    return bench


def settings_of(draw: np.random.Generator) -> Settings:
    """Return any configuration, the corners often."""
    limit = int(draw.choice([0, 1 << 20, 1 << 26, ERROR_MAX, (1 << 28) - 1, (1 << 28) - 1]))
    return Settings(
        int(draw.choice([0, 1, 3, 15])),
        int(draw.choice([0, 5, 16, 40, 48, 49, 63, int(draw.integers(64))])),
        int(draw.choice([0, 1, 4, 15])),
        limit,
    )


@cocotb.test()
async def random_crossings(dut) -> None:
    """Any word, age, table and configuration, strobes without order, tables written meanwhile."""
    draw = generator(1)
    bench = await begin(dut, table=random_table(draw))
    seen = {"acquired": 0, "followed": 0}
    for _ in range(80):
        await bench.start(settings_of(draw))
        top = int(draw.choice([1 << 36, 1 << 38, 1 << 40, 1 << 20]))
        word = int(draw.integers(top))
        for _ in range(12):
            if draw.random() < 0.3:
                word = int(draw.choice([0, WORD_MAX, word, int(draw.integers(top))]))
            outward = int(draw.random() < 0.5)
            age = int(draw.choice([0, 1, (1 << 16) - 1, int(draw.integers(1 << 16))]))
            await bench.step(
                valid=1, outward=outward, age=age, word=word, broken=int(draw.random() < 0.05)
            )
            for _ in range(int(draw.choice([0, 5, 12, 30, LATENCY - 1, 63, 90]))):
                at = int(draw.integers(TABLE_SIZE))
                await bench.step(
                    broken=int(draw.random() < 0.004),
                    table_write=int(draw.random() < 0.1),
                    table_index=at,
                    table_amplitude=int(draw.integers(AMPLITUDE_MAX)),
                    table_midpoint=int(draw.integers(1 << pkg.MIDPOINT_WIDTH)) - (1 << 27),
                    age=int(draw.integers(1 << 16)),
                )
        for found in bench.measured:
            seen["acquired" if found["acquired"] else "followed"] += 1
    assert min(seen.values()) > 20, seen


@cocotb.test()
async def crossings_at_the_least_spacing(dut) -> None:
    """Crossings every MinCrossing clocks, turn by turn: each pair is measured, at its latency."""
    draw = generator(2)
    bench = await begin(dut, table=random_table(draw))
    assert max(LATENCY, OUTWARD_CLKS) <= pkg.MIN_CROSSING
    for _ in range(6):
        await bench.start(settings_of(draw), word=int(draw.integers(1 << 39)))
        sent = []
        for k in range(12):
            await bench.step(valid=1, outward=1 - k % 2, age=int(draw.integers(1 << 16)))
            sent.append(bench.clock)
            await bench.steps(pkg.MIN_CROSSING - 1)
        assert [m["clock"] for m in bench.measured] == [c + LATENCY - 1 for c in sent[1::2]]


@cocotb.test()
async def a_crossing_while_one_is_worked_on(dut) -> None:
    """At every distance: ignored until the one before is done, then taken."""
    bench = await begin(dut)
    await bench.start(word=1 << 38)
    for gap in range(1, LATENCY + 2):
        # An inward so soon after the outward.
        before = len(bench.measured)
        await bench.step(valid=1, outward=1, age=5)
        await bench.steps(gap - 1)
        await bench.step(valid=1, outward=0, age=9)
        await bench.steps(LATENCY)
        taken = gap >= OUTWARD_CLKS
        assert len(bench.measured) == before + taken
        if not taken:  # it still waits for its inward
            await bench.step(valid=1, outward=0, age=9)
            await bench.steps(LATENCY)
            assert len(bench.measured) == before + 1
        # An outward so soon after the inward: where it is ignored, the next inward is alone.
        await bench.step(valid=1, outward=1)
        await bench.steps(20)
        await bench.step(valid=1, outward=0)
        await bench.steps(gap - 1)
        await bench.step(valid=1, outward=1)
        await bench.steps(80)
        before = len(bench.measured)
        await bench.step(valid=1, outward=0)
        await bench.steps(LATENCY)
        assert len(bench.measured) == before + (gap >= LATENCY)


@cocotb.test()
async def broken_forgets_the_outward(dut) -> None:
    """Before, with and after each crossing: only a broken between the two breaks the pair."""
    bench = await begin(dut)
    await bench.start(word=1 << 37)
    width = 80
    for at in range(-3, width + LATENCY + 3):
        before = len(bench.measured)
        for k in range(-3, width + LATENCY + 3):
            ports = {"valid": int(k in (0, width)), "broken": int(k == at)}
            await bench.step(**ports, outward=int(k == 0), age=16)
        # With the outward it is of an earlier one; with the inward, of this pair.
        assert len(bench.measured) - before == (not 0 < at <= width), at
    # An inward alone is nothing; after two outwards, the newer one begins the pair.
    before = len(bench.measured)
    await bench.steps(2)
    await bench.step(valid=1, outward=0)
    await bench.steps(80)
    assert len(bench.measured) == before
    word = bench.twin.increment
    await bench.step(valid=1, outward=1, age=0)
    await bench.steps(99)
    await bench.step(valid=1, outward=1, age=0, broken=1)
    await bench.steps(69)
    await bench.step(valid=1, outward=0, age=0)
    await bench.steps(LATENCY - 1)
    half = (70 * word + (1 << 19)) >> 20
    want = interpolated(np.array([half]), *(np.array(column) for column in cosine_table()))
    assert bench.measured[-1]["measured"] == int(want.amplitude[0])
    assert len(bench.measured) == before + 1


@cocotb.test()
async def the_table_at_its_ends(dut) -> None:
    """Half distances at every corner of the table, just below and from a quarter turn on."""
    draw = generator(3)
    table = random_table(draw)
    bench = await begin(dut, table=table)
    width = 256
    halves = [0, 1, (1 << 17) - 1, 1 << 17, (1 << 27) - (1 << 17) - 1, (1 << 27) - (1 << 17)]
    halves += [(1 << 27) - 1, 1 << 27, (1 << 27) + 1, (1 << 28) - 1]
    halves += [int(h) for h in draw.integers(0, 1 << 27, 30)]
    for half in halves:
        # The oscillator turns by the distance in so many clocks.
        await bench.start(word=(half << (pkg.TURN_WIDTH - HALF_WIDTH)) // width)
        await bench.steps(3)
        await bench.pair(width)
        want = interpolated(np.array([half]), np.array(table[0]), np.array(table[1]))
        assert bench.measured[-1]["measured"] == int(want.amplitude[0])
        assert half < 1 << 27 or want.amplitude[0] == table[0][-1]
    # Nearly a whole turn: the half distance saturates, and does not wrap to nothing.
    await bench.start(word=TURN // 256 - 1)
    await bench.steps(3)
    await bench.pair(width)
    assert bench.measured[-1]["measured"] == table[0][-1]


@cocotb.test()
async def error_limit_and_saturation(dut) -> None:
    """An error at the limit is followed, a step more is acquired; half a turn saturates."""
    flat = ([1 << 20] * TABLE_SIZE, [0] * TABLE_SIZE)
    bench = await begin(dut, table=flat)
    for sign in (1, -1):
        for beyond in (-1, 0, 1):
            limit = 1 << 20
            await bench.start(Settings(0, 63, 0, limit), word=0)
            await bench.pair(64)  # acquired: the phase stands at the middle, zero
            assert bench.measured[-1]["acquired"] and bench.twin.phase == 0
            # Another table has another middle: the error is its negative.
            for index in (0, 1):
                await bench.step(
                    table_write=1,
                    table_index=index,
                    table_amplitude=1 << 20,
                    table_midpoint=-sign * (limit + beyond),
                )
            await bench.pair(64)
            found = bench.measured[-1]
            assert found["error"] == sign * (limit + beyond)
            assert found["acquired"] == (beyond > 0) and bench.twin.tracking
            for index in (0, 1):
                await bench.step(table_write=1, table_index=index, table_midpoint=0)
    # Half a turn and half a step less: rounds to what does not fit.
    for more, want in (
        (0, -ERROR_MAX - 1),
        (-1, ERROR_MAX),
        (-(1 << 19), ERROR_MAX),
        (-(1 << 20), ERROR_MAX),
    ):
        await bench.start(Settings(0, 0, 0, (1 << 28) - 1), word=TURN // 1024)
        await bench.steps(511)
        await bench.step(word=(TURN // 1024 + more) % TURN)
        await bench.step(word=0)
        await bench.steps(3)
        await bench.pair(64)
        assert bench.measured[-1]["error"] == want, more
    # The magnitude of the most negative error is compared as it is.
    await bench.start(Settings(0, 63, 0, ERROR_MAX), word=0)
    await bench.pair(64)
    for index in (0, 1):
        await bench.step(table_write=1, table_index=index, table_midpoint=-(1 << 27))
    await bench.pair(64)
    assert bench.measured[-1]["error"] == -(1 << 27) and bench.measured[-1]["acquired"]


@cocotb.test()
async def the_increment_saturates(dut) -> None:
    """Errors that would make it negative, or too large for a word."""
    bench = await begin(dut, table=([5] * TABLE_SIZE, [0] * TABLE_SIZE))
    for midpoint in (1 << 26, -(1 << 26)):
        for shift in (0, 5, 6, 7):
            # The phase stands at zero; then the table says that it should be a quarter turn off.
            await bench.start(Settings(15, shift, 0, (1 << 28) - 1), word=0)
            await bench.step(table_write=1, table_index=0, table_midpoint=0)
            await bench.pair(64)
            await bench.step(table_write=1, table_index=0, table_midpoint=midpoint)
            await bench.pair(64)
            assert bench.measured[-1]["error"] == -midpoint
            rate = (midpoint << (pkg.TURN_WIDTH - pkg.ERROR_WIDTH)) >> shift
            assert bench.twin.increment == min(max(rate, 0), WORD_MAX)


@cocotb.test()
async def the_word_counts_until_it_tracks(dut) -> None:
    """The increment is the word of the clock before; then its own, until it acquires again."""
    draw = generator(5)
    bench = await begin(dut)
    await bench.start(Settings(1, 30, 1, 1 << 22), word=77)
    assert bench.twin.increment == 0
    for _ in range(40):
        word = int(draw.integers(1 << 30, 1 << 34))
        await bench.step(word=word)
        assert bench.twin.increment == word
    await bench.step(valid=1, outward=1)
    for _ in range(64):
        await bench.step(word=int(draw.integers(1 << 30, 1 << 34)))
    await bench.step(valid=1, outward=0)
    for k in range(60):  # the word changes in the clocks around the correction too
        await bench.step(word=(1 << 33) + k)
    assert bench.twin.tracking and bench.measured[-1]["acquired"]
    assert bench.twin.increment == (1 << 33) + LATENCY - 2
    await bench.steps(5, word=1 << 20)
    assert bench.twin.increment == (1 << 33) + LATENCY - 2


@cocotb.test()
async def the_average_keeps_more_bits(dut) -> None:
    """A step of the amplitude arrives whole, even with the largest shift."""
    table = ([1000] * TABLE_SIZE, [0] * TABLE_SIZE)
    bench = await begin(dut, table=table)
    for shift in (0, 3, FINE_WIDTH):
        await bench.start(Settings(0, 63, shift, (1 << 28) - 1), word=0)
        for index in (0, 1):
            await bench.step(table_write=1, table_index=index, table_amplitude=1000)
        await bench.pair(64)
        assert bench.twin.amplitude == 1000
        for index in (0, 1):
            await bench.step(table_write=1, table_index=index, table_amplitude=AMPLITUDE_MAX)
        for _ in range(3):
            await bench.pair(64)
        share = 1.0 - (1.0 - 2.0**-shift) ** 3
        want = 1000 + share * (AMPLITUDE_MAX - 1000)
        assert abs(bench.twin.amplitude - want) <= 1.0
        # Down to nothing, and a single step of the amplitude.
        for low in (0, 1):
            for index in (0, 1):
                await bench.step(table_write=1, table_index=index, table_amplitude=low)
            for _ in range(2):
                await bench.pair(64)


@cocotb.test()
async def reset_at_every_moment(dut) -> None:
    """While an outward or an inward is worked on, waits, or has come: nothing of it is left."""
    draw = generator(6)
    bench = await begin(dut)
    width = 66
    settings = Settings(1, 12, 2, (1 << 28) - 1)
    for at in range(2, 2 * (width + LATENCY + 4)):
        await bench.start(settings, word=1 << 39)
        if at % 2:
            await bench.pair(64)  # so that it tracks
        for k in range(at // 2):
            crossing = {"valid": int(k in (0, width)), "outward": int(k == 0)}
            await bench.step(**crossing, age=40, word=1 << 39)
        last = {"valid": int(draw.integers(2)), "outward": int(draw.integers(2))}
        await bench.start(settings, **last, word=1 << 39, age=3)
        await bench.steps(int(draw.integers(12)), word=1 << 30)
        await bench.step(valid=1, outward=0, age=1)  # no outward waits
        await bench.steps(LATENCY + 2)
        assert not bench.measured
        await bench.pair(64, age=7)
        assert len(bench.measured) == 1 and bench.measured[0]["acquired"]


@cocotb.test()
async def another_table_at_every_moment(dut) -> None:
    """A pair at work is dropped; the next one is of the other bank alone, and taken whole."""
    draw = generator(8)
    settings = Settings(1, 63, 2, (1 << 28) - 1)
    banks = [([size] * TABLE_SIZE, [size << 8] * TABLE_SIZE) for size in (1000, 3000)]
    bench = await begin(dut, settings, banks[0])
    await bench.start(settings, word=1 << 39)
    width, bank = 66, 0
    for k, (amplitude, midpoint) in enumerate(zip(*banks[1], strict=True)):
        await bench.step(
            valid=int(k % width == 0),
            outward=int(k // width % 2 == 0),
            renew=int(draw.integers(2)),  # of the same table
            table_write=1,
            table_index=k,
            table_amplitude=amplitude,
            table_midpoint=midpoint,
            table_write_bank=1,
        )
    await bench.steps(LATENCY)
    assert [found["measured"] for found in bench.measured] == [1000] * (
        TABLE_SIZE // width // 2 + 1
    )
    assert not any(found["acquired"] for found in bench.measured[1:])
    for at in range(1, width + LATENCY + 3):
        await bench.start(settings, word=1 << 39)
        await bench.pair(64)  # so that it tracks
        for k in range(at):
            await bench.step(valid=int(k in (0, width)), outward=int(k == 0), age=40)
        last = {"valid": int(draw.integers(2)), "outward": int(draw.integers(2))}
        await bench.step(renew=1, table_changed=1, **last)
        assert bench.twin.acquired
        bank = 1 - bank
        bench.twin.table_amplitude, bench.twin.table_midpoint = map(list, banks[bank])
        came = len(bench.measured)
        assert came == 1 + (at >= width + LATENCY)
        await bench.steps(int(draw.integers(1, 12)), table_changed=0, table_bank=bank)
        await bench.step(valid=1, outward=0, age=1)  # no outward waits
        await bench.steps(LATENCY + 2)
        assert len(bench.measured) == came
        size = 3000 if bank else 1000
        await bench.pair(64)
        found = bench.measured[-1]
        assert found["acquired"] and found["measured"] == found["amplitude"] == size
        await bench.pair(64)
        assert len(bench.measured) == came + 2 and not bench.measured[-1]["acquired"]


def test_mirror_phase_rtl_equals_model() -> None:
    simulate("mirror_phase", __file__)


# ---- the model alone ----


def outputs(twin: MirrorPhase) -> tuple[int, ...]:
    """Return every output."""
    return tuple(int(getattr(twin, name)) for name in STATUS + WITH_VALID)


def test_mirror_phase_model_skip_is_many_steps() -> None:
    """Random crossings, two twins: one takes every step, the other skips whenever it can."""
    draw = generator(7)
    skipped = 0
    for _ in range(40):
        settings = settings_of(draw)
        table = random_table(draw)
        slow, fast = MirrorPhase(settings), MirrorPhase(settings)
        for twin in (slow, fast):
            twin.table_amplitude, twin.table_midpoint = list(table[0]), list(table[1])
        word = int(draw.integers(1 << 38))
        for _ in range(60):
            if draw.random() < 0.2:
                word = int(draw.integers(1 << 38))
            left = int(draw.choice([1, 11, 64, 300]))
            while left:
                n = min(fast.idle(word=word), left)
                if n > 1:
                    n = int(draw.integers(1, n + 1))
                for _ in range(max(n, 1)):
                    slow.step(word=word)
                if n:
                    fast.skip(n, word=word)
                    skipped += n
                else:
                    fast.step(word=word)
                left -= max(n, 1)
                assert outputs(slow) == outputs(fast)
            ports = {
                "valid": bool(draw.random() < 0.9),
                "outward": bool(draw.random() < 0.5),
                "age": int(draw.integers(1 << 16)),
                "broken": bool(draw.random() < 0.1),
                "word": word,
                "table_write": bool(draw.random() < 0.3),
                "table_index": int(draw.integers(TABLE_SIZE)),
            }
            slow.step(**ports)
            fast.step(**ports)
            assert outputs(slow) == outputs(fast)
    assert skipped > 100_000


def test_mirror_phase_model_reads_the_table_where_the_rtl_does() -> None:
    """A write in the clock of a read comes too late for it, one before in time."""
    for late in (-1, 0, 1, 2):
        twin = MirrorPhase(CALM)
        twin.step(valid=True, outward=True)
        for _ in range(70):
            twin.step()
        twin.step(valid=True)
        for k in range(1, LATENCY):
            at = k == FIRST_READ + late
            twin.step(table_write=at, table_index=0, table_amplitude=9)
        assert twin.valid and twin.measured == (9 if late < 0 else 0)


def test_mirror_phase_model_averages_with_its_time_constant() -> None:
    """A small step of the amplitude is followed as an exponential, and reached."""
    twin = MirrorPhase(Settings(0, 63, 8, 1 << 24))
    twin.table_amplitude = [1 << 20] * TABLE_SIZE
    for k in range(3000):
        twin.step(valid=True, outward=True)
        twin.skip(99)
        twin.step(valid=True)
        while not twin.valid:
            n = twin.idle()
            if n:
                twin.skip(n)
            else:
                twin.step()
        want = (1 << 20) + 100.0 * (1.0 - (1.0 - 2.0**-8) ** k)
        assert abs(twin.amplitude - want) <= 0.6
        twin.table_amplitude = [(1 << 20) + 100] * TABLE_SIZE
    assert twin.amplitude == (1 << 20) + 100


def pairs_of(
    frequency_word: float,
    phase: Callable[[float], float],
    half: float,
    clocks: float,
) -> list[tuple[float, bool]]:
    """Return (time, outward) of all crossings before ``clocks``.

    ``phase`` gives the turns at a time, at about ``frequency_word`` turns a clock; the crossings
    are where it is a whole number less and plus ``half``.
    """
    found = []
    turn = int(np.ceil(phase(0.0) + half))
    time = 0.0
    while time < clocks:
        for side, outward in ((-half, True), (half, False)):
            target = turn + side
            time = max(time, 0.0) + (target - phase(time)) / frequency_word
            for _ in range(20):
                time += (target - phase(time)) / frequency_word
            found.append((time, outward))
        turn += 1
    return found


def follow(
    twin: MirrorPhase,
    crossings: list[tuple[float, bool]],
    word: int,
    jitter: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Feed crossings and return clock, phase, error and amplitude of every measurement.

    Every crossing is reported 10 to 11 clocks after it came, its age to 1/16 clock.
    """
    rows = []

    def advance(until: int) -> None:
        while clock[0] < until:
            n = min(twin.idle(word=word), until - clock[0])
            if n:
                twin.skip(n, word=word)
            else:
                n = 1
                twin.step(word=word)
            clock[0] += n
            if twin.valid:
                rows.append((clock[0], twin.phase / TURN, twin.error, twin.amplitude))

    clock = [0]
    for k, (time, outward) in enumerate(crossings):
        seen = time + (0.0 if jitter is None else float(jitter[k]))
        report = int(np.floor(seen)) + 11
        advance(report)
        twin.step(valid=True, outward=outward, age=round((report - seen) * 16), word=word)
        clock[0] += 1
    advance(clock[0] + LATENCY)
    table = np.array(rows, dtype=float)
    return table[:, 0], table[:, 1], table[:, 2] * 2.0**-pkg.ERROR_WIDTH, table[:, 3]


PERIOD = 502_008.137  # clocks: 249 Hz at 125 MHz
HALF = 0.11


def tracker(settings: Settings) -> MirrorPhase:
    """Return a twin with the table of a cosine."""
    twin = MirrorPhase(settings)
    twin.table_amplitude, twin.table_midpoint = cosine_table()
    return twin


def wrapped(turns: np.ndarray) -> np.ndarray:
    """Return turns in [-1/2, 1/2)."""
    return (turns + 0.5) % 1.0 - 0.5


def test_mirror_phase_model_interpolates_the_table() -> None:
    """Between entries the amplitude errs by a step's rounding and the table's curvature."""
    amplitude, midpoint = (np.array(column) for column in cosine_table())
    half = np.arange(0, int(0.2 * 2**HALF_FRACTION), 9973)
    result = interpolated(half, amplitude, midpoint)
    h = half * 2.0**-HALF_FRACTION
    exact = 0.04 / np.cos(2.0 * np.pi * h)
    error = result.amplitude * 2.0**-pkg.AMPLITUDE_FRACTION - exact
    # Linear between entries s apart: s^2 / 8 of the second derivative, and two roundings.
    tangent = np.tan(2.0 * np.pi * h)
    bend = exact * (2.0 * np.pi) ** 2 * (1.0 + 2.0 * tangent**2)
    bound = 1.05 * bend / 8.0 / 4096.0**2 + 2.0**-pkg.AMPLITUDE_FRACTION
    ratio = float(np.max(np.abs(error) / exact)), float(np.max(bound / exact))
    print(f"amplitude, of itself: measured {ratio[0]:.3g} / predicted {ratio[1]:.3g}")
    assert np.all(np.abs(error) <= bound)
    assert not result.midpoint.any()


def test_mirror_phase_model_locks_onto_a_mirror() -> None:
    """Any phase and a word off by 0.1 %: no phase error is left, and the amplitude is right.

    The tracker is of second order, so a constant difference of frequency leaves nothing.
    """
    draw = generator(8)
    floor = 1.0 / 16.0 / np.sqrt(12.0) / PERIOD / np.sqrt(2.0)  # turns: ages in 1/16 clock
    for _ in range(4):
        offset = float(draw.random())
        crossings = pairs_of(1 / PERIOD, lambda t, o=offset: t / PERIOD + o, HALF, 150 * PERIOD)
        word = round(TURN / PERIOD * (1.0 + float(draw.choice([-1e-3, 1e-3]))))
        twin = tracker(Settings(1, 21, 2, 1 << 24))
        clock, phase, error, amplitude = follow(twin, crossings, word)
        assert error.size > 140 and twin.tracking
        late = slice(60, None)
        left = wrapped(phase - clock / PERIOD - offset)[late]
        print(
            f"phase after locking, turns: mean {left.mean():.2g} / 0, rms {left.std():.2g} / floor "
            f"{floor:.2g}"
        )
        assert np.abs(left).max() < 10 * floor
        assert abs(left.mean()) < floor
        assert np.abs(error[late]).max() < 10 * floor + 2.0**-pkg.ERROR_WIDTH
        assert abs(twin.increment / (TURN / PERIOD) - 1.0) < 1e-6
        want = 0.04 / np.cos(2.0 * np.pi * HALF)
        # Its slope is 2 pi tan(2 pi h) of itself a turn; the table's curvature adds 1e-6.
        spread = 2.0 * np.pi * np.tan(2.0 * np.pi * HALF) * 10 * floor
        assert np.abs(amplitude[late] * 2.0**-pkg.AMPLITUDE_FRACTION / want - 1).max() < (
            spread + 1.5e-6
        )


def loop_gains(settings: Settings) -> tuple[float, float]:
    """Return what is taken off the phase, and what the next period takes off, of an error."""
    return 2.0**-settings.phase_shift, PERIOD * 2.0**-settings.rate_shift


def test_mirror_phase_model_lags_a_frequency_ramp_as_predicted() -> None:
    """A frequency that rises by r turns a period a period leaves an error of r / b."""
    settings = Settings(2, 23, 2, 1 << 24)
    _, b = loop_gains(settings)
    ramp = 2e-7  # turns per period, more every period

    def phase(t: float) -> float:
        n = t / PERIOD
        return n + 0.5 * ramp * n * n

    crossings = pairs_of(1 / PERIOD, phase, HALF, 400 * PERIOD)
    _, _, error, _ = follow(tracker(settings), crossings, round(TURN / PERIOD))
    measured, predicted = float(error[-100:].mean()), -ramp / b
    print(f"error in a ramp, turns: measured {measured:.4g} / predicted {predicted:.4g}")
    assert abs(measured / predicted - 1.0) < 0.01


def noise_share(a: float, b: float) -> float:
    """Return the variance of the corrected phase over that of a measurement, white noise.

    Before measurement k the phase errs by x and the increment by y, in turns a period. e = x + w:
    x' = x - a e + y - b e, y' = y - b e; the corrected phase errs by x - a e. The stationary
    covariance P solves P = F P F^T + G G^T.
    """
    f = np.array([[1.0 - a - b, 1.0], [-b, 1.0]])
    g = np.array([-a - b, -b])
    p = np.linalg.solve(np.eye(4) - np.kron(f, f), np.outer(g, g).ravel()).reshape(2, 2)
    return float((1.0 - a) ** 2 * p[0, 0] + a * a)


@pytest.mark.parametrize(("phase_shift", "rate_shift"), [(1, 21), (2, 23), (3, 25)])
def test_mirror_phase_model_passes_noise_as_predicted(phase_shift: int, rate_shift: int) -> None:
    """Jitter of the crossings reaches the phase through the tracker's noise bandwidth."""
    settings = Settings(phase_shift, rate_shift, 3, 1 << 24)
    draw = generator(9 + phase_shift)
    jitter = 4.0  # clocks rms
    count = 12_000
    crossings = pairs_of(1 / PERIOD, lambda t: t / PERIOD + 0.3, HALF, count * PERIOD)
    noise = draw.normal(0.0, jitter, len(crossings))
    clock, phase, _, amplitude = follow(tracker(settings), crossings, round(TURN / PERIOD), noise)
    left = wrapped(phase - clock / PERIOD - 0.3)[100:]
    middle = jitter / np.sqrt(2.0) / PERIOD  # of a measurement: two crossings' mean
    measured = float(np.std(left) / middle)
    predicted = float(np.sqrt(noise_share(*loop_gains(settings))))
    # The average of first order passes s / (2 - s) of the variance.
    s = 2.0**-settings.amplitude_shift
    slope = 2.0 * np.pi * np.tan(2.0 * np.pi * HALF)
    amplitude_measured = float(np.std(amplitude[100:]) / np.mean(amplitude[100:]))
    amplitude_predicted = float(slope * middle * np.sqrt(s / (2.0 - s)))
    print(
        f"noise of the phase over that of a measurement, shifts {phase_shift}, {rate_shift}: "
        f"measured {measured:.3f} / predicted {predicted:.3f}; of the amplitude: measured "
        f"{amplitude_measured:.3g} / predicted {amplitude_predicted:.3g}"
    )
    assert abs(measured / predicted - 1.0) < 0.06
    assert abs(amplitude_measured / amplitude_predicted - 1.0) < 0.06
