"""motion_map: every clock of the RTL against the model, the model against float64."""

import cocotb
import numpy as np
import pytest
from harness import FallingEdge, TwinBench, as_integer, drive, generator, port, simulate

from vrscan.data import pkg
from vrscan.fixed.motion_map import LATENCY, MotionMap, motion_map
from vrscan.registers.settings import MotionSettings as Settings

COUNT = pkg.HARMONIC_COUNT
FULL_TURN = 1 << pkg.TURN_WIDTH  # of the offset
TURN = 1 << pkg.PHASE_WIDTH
QUARTER = TURN // 4
DROP = pkg.TURN_WIDTH - pkg.PHASE_WIDTH
MOTION_END = 1 << (pkg.MOTION_WIDTH - 1)
SLOPE_END = 1 << (pkg.SLOPE_MOTION_WIDTH - 1)
ONE = 1 << pkg.MOTION_FRACTION
# Bits of one harmonic in the packed ports.
WIDTHS = {
    "motion_a": pkg.MOTION_WIDTH,
    "motion_phi": pkg.PHASE_WIDTH,
    "motion_da": pkg.SLOPE_MOTION_WIDTH,
    "motion_dphi": pkg.SLOPE_MOTION_WIDTH,
}
QUIET = {"valid": False, "offset": 0, "busy": False, "renew": False}
# Moments of the work: its first steps, the change from a_k to phi_k, and its end.
AGES = (*range(1, 15), *range(106, 124), *range(LATENCY - 15, LATENCY + 2))

Outputs = tuple[int, int, int]


def packed(values: tuple[int, ...], width: int) -> int:
    """Return a word with the first value lowest."""
    mask = (1 << width) - 1
    return sum((value & mask) << (width * k) for k, value in enumerate(values))


def as_ports(settings: Settings) -> dict[str, int]:
    """Return what the configuration ports take."""
    words = {name: packed(getattr(settings, name), width) for name, width in WIDTHS.items()}
    return {"drive_phase": settings.drive_phase, **words}


def shown(twin: MotionMap) -> Outputs:
    """Return all outputs of a twin, packed."""
    a, phi = packed(twin.a, pkg.MOTION_WIDTH), packed(twin.phi, pkg.PHASE_WIDTH)
    return a, phi


def settings_of(draw: np.random.Generator, kind: int = 2) -> Settings:
    """Return corners (0), a mirror (1) or anything (2)."""
    if kind == 0:
        ends = {
            "motion_a": [-MOTION_END, -1, 0, 1, ONE, MOTION_END - 1],
            "motion_phi": [0, 1, TURN // 2, TURN - 1],
            "motion_da": [-SLOPE_END, -1, 0, 1, SLOPE_END - 1],
            "motion_dphi": [-SLOPE_END, -1, 0, 1, SLOPE_END - 1],
        }
        lists = {name: draw.choice(values, COUNT) for name, values in ends.items()}
        drive_phase = int(draw.choice([0, 1, QUARTER, TURN // 2, TURN - 1]))
    else:
        small = 50 if kind == 1 else 1
        motion, slope = MOTION_END // small, SLOPE_END // small
        lists = {
            "motion_a": draw.integers(-motion, motion, COUNT),
            "motion_phi": draw.integers(0, TURN, COUNT),
            "motion_da": draw.integers(-slope, slope, COUNT),
            "motion_dphi": draw.integers(-slope, slope, COUNT),
        }
        drive_phase = int(draw.integers(TURN))
    return Settings(drive_phase, **{name: tuple(v.tolist()) for name, v in lists.items()})


def offset_of(draw: np.random.Generator, settings: Settings) -> int:
    """Return an offset: at, or within a rounding of, an end or the middle of d; or anything."""
    if draw.random() < 0.4:
        return int(draw.integers(FULL_TURN))
    d = int(draw.choice([-QUARTER, -QUARTER + 1, -1, 0, 1, QUARTER - 1, QUARTER]))
    half = 1 << (DROP - 1)
    rest = int(draw.choice([-half, -half + 1, 0, half - 1]))
    return (((settings.drive_phase + d) << DROP) + rest) % FULL_TURN


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    strobes = ("valid", "renew")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)

    def configure(self, settings: Settings) -> None:
        """Set the configuration ports."""
        for name, value in as_ports(settings).items():
            drive(port(self.dut, f"{name}_i"), value)
        self.settings = settings

    async def start(self, settings: Settings, **inputs: int) -> None:
        """Set the configuration and reset, with these inputs."""
        self.configure(settings)
        await self.reset(**inputs)

    async def reset(self, count: int = 2, **inputs: int) -> None:
        """Reset; the base values follow results in the second clock."""
        await self.reset_to(MotionMap(self.settings), count, **(QUIET | inputs))
        self.give(valid=False)
        self.check()

    def check(self) -> None:
        """Compare all outputs."""
        got = (
            as_integer(self.dut.a_o, signed=False),
            as_integer(self.dut.phi_o, signed=False),
        )
        want = shown(self.twin)
        assert int(self.dut.renewing_o.value) == self.twin.renewing, f"clock {self.clock}"
        assert got == want, (
            f"clock {self.clock}, {self.inputs}: a, phi {[hex(v) for v in got]}, "
            f"want {[hex(v) for v in want]}\n{self.settings}"
        )

    async def work(self, offset: int, clocks: int = LATENCY, **inputs: int) -> None:
        """Start the work, and wait; behind valid the port carries something else."""
        await self.clocks(valid=True, offset=offset, **inputs)
        self.give(offset=offset ^ 0x5A5A5A5A5A5A)
        await self.clocks(clocks - 1)


@cocotb.test()
async def any_motion_at_any_offset(dut) -> None:
    """Corners, mirrors and anything, the next offset in the clock of the results."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    low = high = 0
    for k in range(45):
        await bench.start(settings_of(draw, k % 3), offset=(1 << 40) + 5, valid=True)
        for _ in range(4):
            await bench.work(offset_of(draw, bench.settings))
            low += bench.twin.a.count(-MOTION_END)
            high += bench.twin.a.count(MOTION_END - 1)
    assert min(low, high) > 10, "a corner is not tested"


@cocotb.test()
async def results_come_all_at_once_and_only_once(dut) -> None:
    """LATENCY clocks after valid_i, not before; then nothing changes, whatever is configured."""
    draw = generator(2)
    bench = await Bench.fresh(dut)
    await bench.start(settings_of(draw))
    offset = (bench.settings.drive_phase << DROP) + (1 << 45)
    before = shown(bench.twin)
    await bench.work(offset % FULL_TURN, LATENCY - 1)
    assert shown(bench.twin) == before
    await bench.clocks()
    after = shown(bench.twin)
    assert all(x != y for x, y in zip(before, after, strict=True))
    for name in as_ports(bench.settings):
        drive(port(dut, f"{name}_i"), 0)
    await bench.clocks(LATENCY)
    assert shown(bench.twin) == after


@cocotb.test()
async def base_values_until_the_first_results(dut) -> None:
    """They follow the configuration within a clock, busy or at work; a reset brings them back."""
    draw = generator(3)
    bench = await Bench.fresh(dut)
    await bench.start(settings_of(draw))
    for busy in (False, True):
        await bench.clocks(3, busy=busy)
        bench.configure(settings_of(draw))
        bench.twin = MotionMap(bench.settings)
        await FallingEdge(dut.clk_i)
        bench.check()
    await bench.work(12345, 20, busy=False)
    drive(port(dut, "motion_a_i"), 77)
    await FallingEdge(dut.clk_i)
    assert as_integer(dut.a_o, signed=False) == 77
    # One clock of reset after results, with base values that have changed since.
    await bench.start(settings_of(draw))
    await bench.work(1 << 44)
    await bench.start(settings_of(draw))
    await bench.clocks(3)


@cocotb.test()
async def busy_holds_the_results(dut) -> None:
    """Released at every clock around the end, and long after it; busy before the end is nothing."""
    draw = generator(4)
    bench = await Bench.fresh(dut)
    await bench.start(settings_of(draw))
    for release in (1, 2, *range(LATENCY - 4, LATENCY + 5), 3 * LATENCY):
        before = shown(bench.twin)
        await bench.work(offset_of(draw, bench.settings), release, busy=True)
        assert shown(bench.twin) == before
        await bench.clocks(max(LATENCY - release, 1), busy=False)
        assert shown(bench.twin) != before
        await bench.clocks(2, busy=bool(release % 2))
    # It comes and goes.
    for _ in range(20):
        await bench.work(offset_of(draw, bench.settings), LATENCY - 5)
        for _ in range(12):
            await bench.clocks(busy=bool(draw.random() < 0.7))
    await bench.clocks(busy=False)


@cocotb.test()
async def restart_drops_the_first_offset(dut) -> None:
    """A valid_i at moments of the work, in the clock of the results, and while they wait."""
    draw = generator(5)
    bench = await Bench.fresh(dut)
    await bench.start(settings_of(draw))
    for age in AGES:
        await bench.work(offset_of(draw, bench.settings), age)
        await bench.work(offset_of(draw, bench.settings), LATENCY + age % 2)
    for wait in (0, 1, 2, 30):
        for busy in (False, True):
            await bench.work(offset_of(draw, bench.settings), LATENCY - 1 + wait, busy=True)
            await bench.work(offset_of(draw, bench.settings), 1, busy=busy)
            await bench.clocks(LATENCY - 1, busy=False)


@cocotb.test()
async def another_motion_is_worked_out_for_the_last_offset(dut) -> None:
    """At moments of the work, busy or not, with an offset of its own or not, and before any."""
    draw = generator(7)
    bench = await Bench.fresh(dut)
    await bench.start(settings_of(draw))
    await bench.clocks(2, renew=True)
    assert not bench.twin.renewing
    await bench.work(offset_of(draw, bench.settings))
    for k, age in enumerate((*AGES[::3], LATENCY + 40)):
        offset = offset_of(draw, bench.settings)
        await bench.work(offset, age)
        bench.configure(settings_of(draw))
        bench.twin.settings = bench.settings
        busy, valid = bool(k % 2), k % 5 == 0
        await bench.clocks(renew=True, busy=busy, valid=valid, offset=offset)
        assert bench.twin.renewing
        if k % 4 == 3:  # a new offset meanwhile starts anew
            await bench.clocks(50)
            offset = offset_of(draw, bench.settings)
            await bench.clocks(valid=True, offset=offset)
        bench.give(offset=offset ^ 0x5A5A5A5A5A5A)
        await bench.clocks(LATENCY - 1)
        assert not bench.twin.renewing
        given = vars(bench.settings)
        lists = [np.array(given[f"motion_{name}"]) for name in ("a", "phi", "da", "dphi")]
        a, phi, _ = motion_map(offset, bench.settings.drive_phase, *lists)
        assert (bench.twin.a, bench.twin.phi) == (tuple(a.tolist()), tuple(phi.tolist()))
        await bench.clocks(3, busy=False)


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """With and without valid: nothing comes of it, and the next results are right."""
    draw = generator(6)
    bench = await Bench.fresh(dut)
    await bench.start(settings_of(draw))
    for age in AGES:
        for valid in (False, True)[: 1 + age % 2]:
            await bench.work(offset_of(draw, bench.settings), age)
            await bench.reset(valid=valid)
            await bench.clocks(LATENCY + 2)
            assert shown(bench.twin) == shown(MotionMap(bench.settings))
        if age % 3 == 0:
            await bench.work(offset_of(draw, bench.settings), age)
            await bench.reset()
            await bench.work(offset_of(draw, bench.settings))
    # Results that wait are dropped too.
    for wait in range(3):
        await bench.work(offset_of(draw, bench.settings), LATENCY + wait, busy=True)
        await bench.reset(busy=wait == 0)
        await bench.clocks(3, busy=False)


@cocotb.test()
async def one_clock_of_reset_ends_the_work(dut) -> None:
    """Nothing that is on its way in that clock comes out behind it."""
    draw = generator(8)
    bench = await Bench.fresh(dut)
    for age in AGES:
        if age < LATENCY - 1:  # no results yet
            await bench.start(settings_of(draw))
            await bench.work(offset_of(draw, bench.settings), age)
            await bench.reset(1)
            await bench.clocks(LATENCY + 2)


def test_motion_map_rtl_equals_model() -> None:
    simulate("motion_map", __file__)


def test_latency_is_twelve_clocks_a_product_and_four() -> None:
    assert LATENCY == 220 == 12 * 2 * COUNT + 4


# ---- the model alone ----

ZERO = np.zeros(COUNT, np.int64)


def full(value: int) -> np.ndarray:
    """Return a value for every harmonic."""
    return np.full(COUNT, value, np.int64)


def test_the_harmonics_are_linear_in_the_phase() -> None:
    """Against float64, where nothing saturates: half a step of rounding each, and of the offset."""
    draw = generator(11)
    count = 2000
    offset = draw.integers(0, FULL_TURN, count)
    drive_phase = draw.integers(0, TURN, count)
    a = draw.integers(-MOTION_END // 2, MOTION_END // 2, (count, COUNT))
    phi = draw.integers(0, TURN, (count, COUNT))
    da, dphi = (draw.integers(-SLOPE_END, SLOPE_END, (count, COUNT)) for _ in range(2))
    got_a, got_phi, d = motion_map(offset, drive_phase, a, phi, da, dphi)
    exact_d = offset / FULL_TURN - drive_phase / TURN
    exact_d -= np.floor(2.0 * exact_d + 0.5) / 2.0
    # Where rounding takes d over its end there are two right answers.
    inner = np.abs(exact_d) < 0.2499
    worst = np.abs(exact_d - d / TURN)[inner].max() * TURN
    print(
        f"\nd: measured {worst:.3f}, predicted 0.5, floor 0.5 steps of 2**-{pkg.PHASE_WIDTH} turn"
    )
    assert worst <= 0.5 + 1e-6
    turns = d[:, None] / TURN
    want_a = a + da * turns * 2.0 ** (pkg.MOTION_FRACTION - pkg.MOTION_SLOPE_FRACTION)
    worst = np.abs(got_a - want_a).max()
    print(f"a_k: measured {worst:.3f}, predicted 0.5, floor 0.5 steps")
    assert worst <= 0.5
    error = got_phi - phi - dphi * turns * 2.0 ** (pkg.PHASE_WIDTH - pkg.PHI_SLOPE_FRACTION)
    worst = np.abs((error + TURN / 2) % TURN - TURN / 2).max()
    print(f"phi_k: measured {worst:.3f}, predicted 0.5, floor 0.5 steps")
    assert worst <= 0.5 + 1e-5
    assert got_phi.min() >= 0 and got_phi.max() < TURN


def test_halves_go_up() -> None:
    """Of the offset and of both products, either sign."""
    half = 1 << (DROP - 1)
    for offset, want in ((half - 1, 0), (half, 1), (-half, 0), (-half - 1, -1)):
        assert motion_map(offset % FULL_TURN, 0, ZERO, ZERO, ZERO, ZERO)[2] == want
    for sign, up in ((1, 1), (-1, 0)):
        offset = (sign * QUARTER // 2 << DROP) % FULL_TURN  # an eighth of a turn
        a, phi, _ = motion_map(offset, 0, ZERO, ZERO, full(4), full(0))
        assert (a == up).all() and (phi == 0).all()
        offset = (sign << (DROP + pkg.PHI_SLOPE_FRACTION - 1)) % FULL_TURN
        a, phi, _ = motion_map(offset, 0, ZERO, ZERO, full(0), full(1))
        assert (phi == up).all() and (a == 0).all()


def test_half_a_turn_more_is_the_same_drive() -> None:
    draw = generator(12)
    given = [np.array(values) for values in vars(settings_of(draw)).values()]
    offset = draw.integers(0, FULL_TURN // 2, 1000)
    for one, other in zip(
        motion_map(offset, *given), motion_map(offset + FULL_TURN // 2, *given), strict=True
    ):
        assert np.array_equal(one, other)
    # The end of d is excluded above only.
    for turns, want in ((0.25, -QUARTER), (0.75, -QUARTER), (0.125, QUARTER // 2)):
        assert motion_map(int(turns * FULL_TURN), *given)[2] == (
            (want - int(given[0]) + QUARTER) % (2 * QUARTER) - QUARTER
        )
    assert motion_map(FULL_TURN // 4, 0, *given[1:])[2] == -QUARTER
    assert motion_map(FULL_TURN - 1, 0, *given[1:])[2] == 0


def test_motion_saturates_and_phases_wrap() -> None:
    """Each end fits and a step more does not."""
    eighth = FULL_TURN // 8
    for sign, end in ((1, MOTION_END - 1), (-1, -MOTION_END)):
        base = np.arange(end - sign * 8, end + sign, sign)[:COUNT]
        a, _, _ = motion_map(eighth, 0, base, ZERO, full(sign * 24), ZERO)
        assert np.array_equal(a, np.clip(base + 3 * sign, -MOTION_END, MOTION_END - 1))
        assert (a == end).sum() == 4

    _, phi, _ = motion_map(eighth, 0, ZERO, full(TURN - 1), ZERO, full(1))
    assert (phi == (TURN - 1 + (1 << (pkg.PHASE_WIDTH - 3 - pkg.PHI_SLOPE_FRACTION))) % TURN).all()
    _, phi, _ = motion_map(eighth, 0, ZERO, ZERO, ZERO, full(-1))
    assert (phi == TURN - (1 << (pkg.PHASE_WIDTH - 3 - pkg.PHI_SLOPE_FRACTION))).all()


ZERO_GIVEN = {"offset": 0, "drive_phase": 0, "a": ZERO, "phi": ZERO, "da": ZERO, "dphi": ZERO}
BEYOND = {
    "offset": (-1, FULL_TURN),
    "drive_phase": (-1, TURN),
    "a": (-MOTION_END - 1, MOTION_END),
    "phi": (-1, TURN),
    "da": (-SLOPE_END - 1, SLOPE_END),
    "dphi": (-SLOPE_END - 1, SLOPE_END),
}


@pytest.mark.parametrize("name", BEYOND)
def test_what_does_not_fit_is_refused(name: str) -> None:
    for beyond, inside in zip(BEYOND[name], (1, -1), strict=True):
        value = beyond if np.ndim(ZERO_GIVEN[name]) == 0 else full(beyond)
        with pytest.raises(ValueError, match=name):
            motion_map(**ZERO_GIVEN | {name: value})
        motion_map(**ZERO_GIVEN | {name: value + inside})
    if name not in ("offset", "drive_phase"):
        with pytest.raises(ValueError, match="axis"):
            motion_map(**ZERO_GIVEN | {name: np.zeros(COUNT - 1, np.int64)})


def test_arguments_are_broadcast() -> None:
    """One motion for many offsets, and a motion each, are the same."""
    draw = generator(13)
    offset = draw.integers(0, FULL_TURN, 100)
    given = [np.array(values) for values in vars(settings_of(draw)).values()]
    one = motion_map(offset, *given)
    each = motion_map(
        offset, np.full(100, given[0]), *(np.broadcast_to(v, (100, COUNT)) for v in given[1:])
    )
    assert all(np.array_equal(x, y) for x, y in zip(one, each, strict=True))
    assert one[0].shape == one[1].shape == (100, COUNT) and one[2].shape == (100,)
