"""laser_guard: every clock of the RTL against the model, and every way into the dark by name."""

import cocotb
import numpy as np
import pytest
from harness import (
    FallingEdge,
    TwinBench,
    as_integer,
    generator,
    parameters,
    simulate,
)

from vrscan.clocked.laser_guard import (
    BEAT_CLKS,
    ENABLE_LATENCY,
    FAULT_LEVEL,
    FAULT_LIT,
    FAULT_LONG,
    FAULT_SILENT,
    FAULT_SPENT,
    HEARTBEAT_LATENCY,
    PULSE_LATENCY,
    LaserGuard,
    Parameters,
)

NAMES = {
    "GuardClks": "guard_clks",
    "PulseClks": "pulse_clks",
    "BurstClks": "burst_clks",
    "IndexClks": "index_clks",
    "StartupClks": "startup_clks",
    "DriveClks": "drive_clks",
    "RestartBeats": "restart_beats",
}
SMALLEST = dict.fromkeys(NAMES, 1) | {"GuardClks": 4}
ODD = dict(zip(NAMES, (33, 20, 27, 150, 9, 60, 5), strict=True))
ELABORATIONS = [SMALLEST, ODD, {}]
QUIET = dict.fromkeys(
    ("heartbeat", "enable", "pulse", "index_light", "startup_pin", "drive", "level_pin"), 0
)
LIGHT = ("pulse", "index_light", "startup_pin")
MOTION = ("drive", "level_pin")
# Frequencies at which the shipped times have to hold, and what the core may send.
GUARD_HZ = 310e6 / 12 * np.array([0.8, 1.0, 1.2])
LEGAL_PULSE_S = 2e-6  # limit_pulse_us
LEGAL_LINE_HZ = 100e6 / (2048 + 16)  # as fast as a sensor of 2048 pixels is read out


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.parameters = Parameters(**{NAMES[k]: v for k, v in parameters().items()})

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks; the twin does not know the mirror's level."""
        self.give(**inputs)
        for _ in range(count):
            await FallingEdge(self.dut.clk_i)
            given = {name: bool(value) for name, value in self.inputs.items()}
            del given["level_pin"]
            self.twin.step(**given)
            self.clock += 1
            self.check()

    async def start(self, **inputs: int) -> None:
        """Reset for a clock with these inputs."""
        await self.reset_to(LaserGuard(self.parameters), **(QUIET | inputs))
        self.check()

    def check(self) -> None:
        """Compare all outputs; a gate follows its request in the same clock."""
        twin, dut = self.twin, self.dut
        want = {"ok": twin.ok, "fault": twin.fault, "beat": twin.beat}
        want |= {name: twin.ok and self.inputs[name] for name in LIGHT}
        want |= {name: twin.moves and self.inputs[name] for name in MOTION}
        got = {name: as_integer(getattr(dut, f"{name}_o")) for name in want}
        assert got == {name: int(value) for name, value in want.items()}, (
            f"clock {self.clock}, {self.inputs}: {got}, want {want}"
        )

    async def beats(self, count: int, spacing: int, **inputs: int) -> None:
        """Go on for some beats."""
        for _ in range(count):
            await self.clocks(spacing, heartbeat=1 - self.inputs["heartbeat"], **inputs)

    async def wave(self, wave: list[int] | np.ndarray, name: str = "pulse") -> int:
        """Go on with the core alive and a signal of these levels; return its clocks at the pin."""
        lit = 0
        for k, level in enumerate(wave):
            beat = self.inputs["heartbeat"] ^ (k % 3 == 0)
            await self.clocks(heartbeat=int(beat), **{name: int(level)})
            lit += as_integer(getattr(self.dut, f"{name}_o"))
        return lit

    async def into_light(self) -> None:
        """Reset, beat, and enable: the light passes."""
        await self.start()
        await self.enabled_anew()

    async def enabled_anew(self) -> None:
        """Without a request, and with an enable that was low: the light passes."""
        low = dict.fromkeys((*LIGHT, *MOTION, "enable"), 0)
        await self.beats(self.parameters.restart_beats + 4, 2, **low)
        # The budgets of everything but the longest one are whole again.
        limits = self.parameters
        longest = 8 * (max(limits.burst_clks, limits.startup_clks) + 4)
        if limits.index_clks < 1000:
            longest += limits.index_clks
        await self.beats(longest // 2, 2)
        await self.beats(3, 2, enable=1)
        assert self.twin.ok


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Beats with gaps, and every signal of every length, with all trips and the reset among it."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    shipped = limits.index_clks > 1000
    longest = {
        "pulse": limits.pulse_clks,
        "index_light": 40 if shipped else limits.index_clks,
        "startup_pin": limits.startup_clks,
        "drive": 40 if shipped else limits.drive_clks,
        "level_pin": 5,
        "enable": 200,
    }
    seen, faults = set(), 0
    for _ in range(40):
        await bench.start(heartbeat=int(draw.integers(2)), pulse=int(draw.integers(2)))
        calm = draw.random() < 0.5  # few gaps and long signals
        left = dict.fromkeys((*longest, "heartbeat"), 0)
        for _ in range(int(draw.integers(20, 60 + 6 * (limits.guard_clks + limits.pulse_clks)))):
            inputs = {}
            for name in left:
                left[name] -= 1
                if left[name] > 0:
                    continue
                inputs[name] = 1 - bench.inputs[name]
                if name == "heartbeat":
                    gap = draw.random() < (0.002 if calm else 0.03)
                    left[name] = limits.guard_clks + 8 if gap else int(draw.integers(2, 4))
                elif inputs[name] == (name != "enable"):
                    most = longest[name] * (2 if draw.random() < (0.02 if calm else 0.3) else 0.2)
                    left[name] = int(draw.integers(1, max(most, 2)))
                else:
                    left[name] = int(draw.integers(1, 10 * longest[name] if calm else 40))
            await bench.clocks(**inputs)
            seen.add((bench.twin.ok, bench.twin.moves))
            faults |= bench.twin.fault
    assert {(True, True), (False, True), (False, False)} <= seen
    wanted = FAULT_SILENT | FAULT_LONG | FAULT_SPENT | FAULT_LEVEL
    assert faults & wanted == wanted and (shipped or faults & FAULT_LIT)


@cocotb.test()
async def no_light_without_beats_and_a_fresh_enable(dut) -> None:
    """After a reset: an enable that was high all along is none, and a gap among beats counts."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    await bench.start(enable=1)
    await bench.clocks(2 * limits.guard_clks)
    await bench.beats(3 * limits.restart_beats + 6, 3)
    assert bench.twin.moves and not bench.twin.ok
    await bench.start()
    await bench.beats(limits.restart_beats, 3)
    await bench.clocks(limits.guard_clks + 8)
    await bench.beats(limits.restart_beats, 3)
    await bench.clocks(2)
    assert not bench.twin.moves
    await bench.beats(3, 3)
    assert bench.twin.moves and not bench.twin.ok
    await bench.beats(2, 3, enable=1)
    assert bench.twin.ok
    await bench.clocks(ENABLE_LATENCY - 1, enable=0)
    assert bench.twin.ok
    await bench.clocks()
    assert not bench.twin.ok and bench.twin.fault == 0


@cocotb.test()
async def a_clock_that_stops_turns_all_off(dut) -> None:
    """At either level, in the stated clock; the mirror comes back with the beats."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    for level in (0, 1):
        await bench.into_light()
        if bench.inputs["heartbeat"] == level:
            await bench.beats(1, 3)
        pins = {"level_pin": 1, **({"drive": 1} if limits.drive_clks > 40 else {})}
        await bench.clocks(heartbeat=level, **pins)
        await bench.clocks(limits.guard_clks + HEARTBEAT_LATENCY - 2)
        assert bench.twin.ok and bench.twin.moves
        await bench.clocks()
        assert not bench.twin.ok and dut.drive_o.value == 0 and dut.level_pin_o.value == 0
        assert bench.twin.fault == FAULT_SILENT
        await bench.beats(3 * limits.restart_beats + 6, 3, drive=0)
        assert bench.twin.moves and not bench.twin.ok and bench.twin.fault == FAULT_SILENT
        await bench.enabled_anew()
        await bench.clocks(2)
        assert bench.twin.fault == 0


@cocotb.test()
async def a_pulse_that_does_not_end_is_cut(dut) -> None:
    """In the stated clock, and dark until a new enable, however long the beats go on."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    most = limits.pulse_clks
    if limits.burst_clks <= most:
        pytest.skip("the burst ends before the pulse")
    for length in (1, most - 1, most, most + 50):
        await bench.into_light()
        for k in range(length):
            await bench.wave([1])
            assert bench.twin.ok == (k + 1 < most + PULSE_LATENCY), (k, length)
        await bench.wave([0] * 400)
        assert bench.twin.ok == (length < most)
        assert bench.twin.fault & FAULT_LONG == (length >= most) * FAULT_LONG


@cocotb.test()
async def short_gaps_do_not_help(dut) -> None:
    """12 us of light and 40 ns of dark, for ever, at each end of the clock's tolerance."""
    bench = await Bench.fresh(dut)
    if parameters():
        pytest.skip("the times are those of the shipped limits")
    for hertz in GUARD_HZ:
        await bench.into_light()
        period = 12.04e-6 * hertz
        clocks = np.arange(round(100e-6 * hertz))
        lit = await bench.wave((clocks % period) < 12e-6 * hertz)
        assert bench.twin.fault & (FAULT_SPENT | FAULT_LONG)
        print(f"{1e-6 * hertz:.1f} MHz: {1e6 * lit / hertz:.1f} us of light")
        assert lit / hertz < 20.3e-6


@cocotb.test()
async def the_largest_pulses_of_the_quickest_lines_pass(dut) -> None:
    """At each end of the clock's tolerance, at every phase; and one of the core's ceiling."""
    bench = await Bench.fresh(dut)
    if parameters():
        pytest.skip("the times are those of the shipped limits")
    for hertz in GUARD_HZ:
        await bench.into_light()
        clocks = np.arange(round(2e-3 * hertz))
        within = (clocks / hertz) % (1.0 / LEGAL_LINE_HZ)
        await bench.wave(within < LEGAL_PULSE_S)
        await bench.wave(np.arange(1000) < 10e-6 * hertz)
        assert bench.twin.ok and bench.twin.fault == 0


@cocotb.test()
async def light_of_any_stretch_is_in_the_budget(dut) -> None:
    """Pulses of every kind, always enabled anew: the lit clocks of every stretch of the record."""
    draw = generator(2)
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    if limits.pulse_clks > 100:
        pytest.skip("pulses at random are never so long")
    await bench.into_light()
    lit = []
    for _ in range(6000):
        inputs = {}
        if draw.random() < (0.06 if bench.inputs["pulse"] else 0.1):
            inputs["pulse"] = 1 - bench.inputs["pulse"]
        if draw.random() < 0.3 and not bench.twin.ok:
            inputs["enable"] = 1 - bench.inputs["enable"]
        await bench.clocks(heartbeat=1 - bench.inputs["heartbeat"], **inputs)
        lit.append(as_integer(dut.pulse_o))
    # The largest sum over all stretches of what a clock adds: Kadane.
    worst = most = 0
    for on in lit:
        most = max(0, most + (7 if on else -1))
        worst = max(worst, most)
    assert sum(lit) > 20 and worst <= 7 * (limits.burst_clks + 4)


@cocotb.test()
async def a_level_that_is_stuck_ends_the_light(dut) -> None:
    """The start-up channel's level as a sigma-delta of 1 mW of 50 passes, one that stays does not.

    Every ratio of the two clocks is one in which the guard meets the same pulses again and again.
    """
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    if not parameters():
        core = (np.arange(400_000) * 1311) % 65_536 < 1311
        for step in (3.125, 50 / 13, 3.871, 4.0, 4.166, 4.831):  # clocks of the core in one
            await bench.into_light()
            await bench.wave(core[(np.arange(8000) * step).astype(int)], "startup_pin")
            assert bench.twin.ok, step
    await bench.into_light()
    lit = await bench.wave([1] * (limits.startup_clks + 40), "startup_pin")
    assert bench.twin.fault == FAULT_LEVEL and lit <= limits.startup_clks + 4


@cocotb.test()
async def index_light_has_its_own_end(dut) -> None:
    """It may be on for its budget at once, and for half of the time."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    if limits.index_clks > 1000:
        pytest.skip("its end takes too many clocks")
    await bench.into_light()
    if limits.index_clks > 20:
        await bench.wave([1, 1, 1, 1, 1, 0, 0, 0, 0, 0] * 100, "index_light")
        assert bench.twin.ok
    lit = await bench.wave([1] * (limits.index_clks + 40), "index_light")
    assert bench.twin.fault == FAULT_LIT and lit <= limits.index_clks + 4


@cocotb.test()
async def no_voltage_rests_on_the_comb(dut) -> None:
    """A drive that stays high is cut until it falls, and is no trip of the light."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    await bench.into_light()
    bench.give(level_pin=1)
    if limits.drive_clks > 1000:
        pytest.skip("its end takes too many clocks")
    passed = await bench.wave([1] * (limits.drive_clks + 40), "drive")
    assert passed == limits.drive_clks + 2 and dut.level_pin_o.value == 0
    assert bench.twin.ok
    await bench.wave([0] * 5, "drive")
    assert bench.twin.moves and dut.level_pin_o.value == 1


@cocotb.test()
async def the_light_does_not_begin_within_a_request(dut) -> None:
    """One that is high when the enable comes is not shown the rest of its time."""
    bench = await Bench.fresh(dut)
    limits = bench.parameters
    if limits.burst_clks < 20:
        pytest.skip("the burst ends before the request")
    for name in ("pulse", "index_light"):
        await bench.start()
        await bench.beats(limits.restart_beats + 2, 2)
        await bench.clocks(**{name: 1})
        await bench.beats(4, 2, enable=1)
        assert not bench.twin.ok
        await bench.beats(2, 2, **{name: 0})
        assert bench.twin.ok


@cocotb.test()
async def the_gates_add_no_clock(dut) -> None:
    """What comes from the core comes through within the clock in which it changes, both ways."""
    bench = await Bench.fresh(dut)
    await bench.into_light()
    for k in (31, 21, 10, 0):
        values = {name: k >> n & 1 for n, name in enumerate((*LIGHT, *MOTION))}
        bench.give(**values)
        await cocotb.triggers.Timer(1, "ns")
        assert {name: int(getattr(dut, f"{name}_o").value) for name in values} == values


@cocotb.test()
async def the_guard_has_a_beat_of_its_own(dut) -> None:
    """Whatever the core does."""
    bench = await Bench.fresh(dut)
    await bench.start()
    for k in range(40):
        assert as_integer(dut.beat_o) == k // BEAT_CLKS % 2
        await bench.clocks()


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["smallest", "odd", "shipped"])
def test_rtl(elaboration: dict[str, int]) -> None:
    """Every elaboration runs every test above."""
    simulate("laser_guard", __file__, elaboration)


@pytest.mark.parametrize("name", NAMES.values())
def test_parameters_have_a_range(name: str) -> None:
    """Zero is refused."""
    with pytest.raises(ValueError, match=name):
        Parameters(**{name: 0})
