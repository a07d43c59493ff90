"""laser_guard: every clock of the RTL against the model, and every way into the dark by name."""

import cocotb
import pytest
from harness import (
    FallingEdge,
    TwinBench,
    as_integer,
    drive,
    generator,
    parameters,
    reset,
    simulate,
)

from vrscan.clocked.laser_guard import (
    FAULT_HEARTBEAT,
    FAULT_PULSE,
    HEARTBEAT_LATENCY,
    PULSE_LATENCY,
    LaserGuard,
    Parameters,
)

ELABORATIONS = [
    {"GuardClks": 4, "PulseClks": 1, "RestartBeats": 1, "CountWidth": 2},
    {"GuardClks": 33, "PulseClks": 20, "RestartBeats": 5, "CountWidth": 4},
    {},
]
NAMES = {
    "GuardClks": "guard_clks",
    "PulseClks": "pulse_clks",
    "RestartBeats": "restart_beats",
    "CountWidth": "count_width",
}
QUIET = {"heartbeat": 0, "pulse": 0, "index_light": 0}


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.parameters = Parameters(**{NAMES[k]: v for k, v in parameters().items()})

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks; the twin does not know the start-up channel."""
        self.give(**inputs)
        for _ in range(count):
            await FallingEdge(self.dut.clk_i)
            self.twin.step(
                heartbeat=bool(self.inputs["heartbeat"]), pulse=bool(self.inputs["pulse"])
            )
            self.clock += 1
            self.check()

    async def start(self, **inputs: int) -> None:
        """Reset for a clock with these inputs."""
        await self.reset_to(LaserGuard(self.parameters), **(QUIET | inputs))
        self.check()

    def check(self) -> None:
        """Compare all outputs; a gate follows its request in the same clock."""
        twin, dut = self.twin, self.dut
        want = (
            int(twin.ok),
            twin.fault,
            twin.heartbeat_trips,
            twin.pulse_trips,
            int(twin.ok and self.inputs["pulse"]),
            int(twin.ok and self.inputs["index_light"]),
        )
        names = ("ok", "fault", "heartbeat_trips", "pulse_trips", "pulse", "index_light")
        got = tuple(as_integer(getattr(dut, f"{name}_o")) for name in names)
        assert got == want, f"clock {self.clock}, {self.inputs}: {names} {got}, want {want}"

    async def beats(self, count: int, spacing: int, **inputs: int) -> None:
        """Go on for some beats."""
        for _ in range(count):
            await self.clocks(spacing, heartbeat=1 - self.inputs["heartbeat"], **inputs)

    async def into_light(self) -> None:
        """Reset and beat until the light passes."""
        await self.start()
        await self.beats(self.parameters.restart_beats + 4, 2)
        assert self.twin.ok


async def begin(dut) -> Bench:
    """Return a bench after its reset."""
    await reset(dut)
    return Bench(dut)


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Beats with gaps and pulses of every length, with both trips and the reset among them."""
    draw = generator(1)
    bench = await begin(dut)
    guard, longest = bench.parameters.guard_clks, bench.parameters.pulse_clks
    often, long = (0.97, 0.03) if longest < 100 else (0.997, 0.4)  # no gap, a long pulse
    seen = set()
    resets = set()
    for _ in range(25):
        drive(dut.index_light_i, 0)
        await bench.start(heartbeat=int(draw.integers(2)), pulse=int(draw.integers(2)))
        gap, left, pulse_left = 2, 0, 0
        for _ in range(int(draw.integers(20, 40 + 6 * (guard + longest)))):
            inputs = {"index_light": int(draw.integers(2))}
            if left <= 0:
                inputs["heartbeat"] = 1 - bench.inputs["heartbeat"]
                gap = int(draw.integers(2, 6)) if draw.random() < often else guard + 8
                left = gap
            left -= 1
            if pulse_left <= 0:
                inputs["pulse"] = 1 - bench.inputs["pulse"]
                most = 2 * longest if draw.random() < long else max(longest // 2, 2)
                most = most if inputs["pulse"] else 40
                pulse_left = int(draw.integers(1, most + 2))
            pulse_left -= 1
            await bench.clocks(**inputs)
            seen.add((bench.twin.ok, bench.twin.fault))
        resets.add(bench.twin.ok)
    assert {ok for ok, _ in seen} == {True, False} == resets
    assert {FAULT_HEARTBEAT, FAULT_PULSE} <= {fault for _, fault in seen}


@cocotb.test()
async def no_light_before_the_beats_have_come(dut) -> None:
    """After a reset; and a gap among them starts the count anew."""
    bench = await begin(dut)
    limits = bench.parameters
    await bench.start(index_light=1)
    await bench.clocks(2 * limits.guard_clks, index_light=1)
    assert not bench.twin.ok
    for _ in range(2):
        await bench.beats(limits.restart_beats, 3)
        await bench.clocks(2)
        assert not bench.twin.ok
        await bench.clocks(limits.guard_clks + 8)
    await bench.beats(limits.restart_beats + 1, 3)
    await bench.clocks(2)
    assert bench.twin.ok


@cocotb.test()
async def a_clock_that_stops_turns_both_off(dut) -> None:
    """At either level, and in the stated clock; the light comes back with the beats alone."""
    bench = await begin(dut)
    limits = bench.parameters
    for level in (0, 1):
        await bench.into_light()
        if bench.inputs["heartbeat"] == level:
            await bench.beats(1, 3)
        await bench.clocks(heartbeat=level, index_light=1)
        await bench.clocks(limits.guard_clks + HEARTBEAT_LATENCY - 2)
        assert bench.twin.ok and dut.index_light_o.value == 1
        await bench.clocks()
        assert not bench.twin.ok and dut.index_light_o.value == 0
        assert bench.twin.fault == FAULT_HEARTBEAT and bench.twin.heartbeat_trips == 1
        await bench.beats(limits.restart_beats + 2, 3)
        assert bench.twin.ok


@cocotb.test()
async def a_pulse_that_does_not_end_is_cut(dut) -> None:
    """In the stated clock, and dark until it has ended and the beats have come again."""
    bench = await begin(dut)
    limits = bench.parameters
    most = limits.pulse_clks
    for length in (1, most, most + 1, most + 50):
        await bench.into_light()
        for k in range(length):
            assert bench.twin.ok or k > most
            await bench.beats(1, 1, pulse=1) if k % 3 == 0 else await bench.clocks(pulse=1)
            assert bench.twin.ok == (k + 1 < most + PULSE_LATENCY), (k, length)
        for k in range(PULSE_LATENCY + 1):
            await bench.clocks(pulse=0, heartbeat=k & 1 ^ bench.inputs["heartbeat"])
        assert bench.twin.pulse_trips == (length >= most)
        await bench.beats(limits.restart_beats + 4, 2)
        assert bench.twin.ok
        await bench.into_light()
        await bench.clocks(most + PULSE_LATENCY, pulse=1)
        await bench.beats(3 * limits.restart_beats + 6, 2)
        assert not bench.twin.ok and dut.pulse_o.value == 0


@cocotb.test()
async def the_light_does_not_come_back_within_a_pulse(dut) -> None:
    """A request that is high when the last beat comes is not shown the rest of its time."""
    bench = await begin(dut)
    if bench.parameters.pulse_clks < 8:
        return
    await bench.start()
    await bench.beats(bench.parameters.restart_beats, 2)
    await bench.clocks(3, pulse=1)
    await bench.beats(1, 5)
    assert not bench.twin.ok
    await bench.beats(1, 4, pulse=0)
    assert bench.twin.ok


@cocotb.test()
async def the_gates_add_no_clock(dut) -> None:
    """Requests come through within the clock in which they change, both ways."""
    bench = await begin(dut)
    await bench.into_light()
    for pulse, light in ((0, 1), (1, 1), (1, 0), (0, 0)):
        bench.give(pulse=pulse, index_light=light)
        await cocotb.triggers.Timer(1, "ns")
        assert (int(dut.pulse_o.value), int(dut.index_light_o.value)) == (pulse, light)


@cocotb.test()
async def the_counts_stop_at_their_largest(dut) -> None:
    """Counters of a few bits do not begin again."""
    if parameters().get("CountWidth", 16) > 4:
        return
    bench = await begin(dut)
    limits = bench.parameters
    most = (1 << limits.count_width) - 1
    await bench.into_light()
    for _ in range(most + 2):
        await bench.clocks(limits.guard_clks + 6)
        await bench.beats(limits.restart_beats + 4, 2)
    assert bench.twin.heartbeat_trips == most
    for _ in range(most + 2):
        for k in range(limits.pulse_clks + 5):
            await bench.clocks(pulse=1, heartbeat=k & 2 != 0)
        await bench.beats(limits.restart_beats + 6, 2, pulse=0)
    assert bench.twin.pulse_trips == most


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["smallest", "odd", "shipped"])
def test_rtl(elaboration: dict[str, int]) -> None:
    """Every elaboration runs every test above."""
    simulate("laser_guard", __file__, elaboration)


@pytest.mark.parametrize("name", ["guard_clks", "pulse_clks", "restart_beats"])
def test_parameters_have_a_range(name: str) -> None:
    """Zero is refused."""
    with pytest.raises(ValueError, match=name):
        Parameters(**{name: 0})
