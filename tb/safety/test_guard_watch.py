"""guard_watch: every clock of the RTL against the model, and a guard that dies or trips by name."""

import cocotb
import pytest
from harness import TwinBench, as_integer, generator, parameters, simulate

from vrscan.clocked.guard_watch import BEAT_LATENCY, OK_LATENCY, GuardWatch

ELABORATIONS = [{"BeatClks": 4, "CountWidth": 2}, {"BeatClks": 23}, {}]
QUIET = {"guard_ok": 0, "guard_beat": 0, "guard_fault": 0}


def beat_clks() -> int:
    """Return the parameter of the running elaboration."""
    return parameters().get("BeatClks", 64)


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)

    async def start(self, **inputs: int) -> None:
        """Reset for a clock with these inputs."""
        twin = GuardWatch(beat_clks(), parameters().get("CountWidth", 16))
        await self.reset_to(twin, **(QUIET | inputs))
        self.check()

    def check(self) -> None:
        """Compare all outputs."""
        names = ("ok", "fault", "trip_count")
        got = [as_integer(getattr(self.dut, f"{name}_o")) for name in names]
        want = [int(getattr(self.twin, name)) for name in names]
        assert got == want, f"clock {self.clock}, {self.inputs}: {names} {got}, want {want}"

    async def beats(self, count: int, spacing: int = 3, **inputs: int) -> None:
        """Go on for some beats of the guard."""
        for _ in range(count):
            await self.clocks(spacing, guard_beat=1 - self.inputs["guard_beat"], **inputs)


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Beats with gaps, and trips whose bits come and go as they like."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    seen = set()
    for _ in range(20):
        await bench.start(guard_ok=int(draw.integers(2)), guard_beat=int(draw.integers(2)))
        left = 0
        for _ in range(int(draw.integers(50, 1000))):
            inputs = {}
            left -= 1
            if left <= 0:
                inputs["guard_beat"] = 1 - bench.inputs["guard_beat"]
                left = int(draw.integers(2, 4 if draw.random() < 0.9 else 2 * beat_clks()))
            if draw.random() < 0.05:
                inputs["guard_ok"] = int(draw.random() < 0.8)
                inputs["guard_fault"] = int(draw.choice([0, 0, draw.integers(32)]))
            await bench.clocks(**inputs)
            seen.add(bench.twin.ok)
    assert seen == {True, False}


@cocotb.test()
async def a_guard_whose_clock_stops_is_no_guard(dut) -> None:
    """In the stated clock, at either level of its beat; and it is one again with the next beat."""
    bench = await Bench.fresh(dut)
    await bench.start()
    await bench.clocks(3 * beat_clks(), guard_ok=1)
    assert not bench.twin.ok
    for _ in range(3):
        await bench.beats(4, guard_ok=1)
        assert bench.twin.ok
        await bench.beats(1, 1)
        await bench.clocks(beat_clks() + BEAT_LATENCY - 2)
        assert bench.twin.ok
        await bench.clocks()
        assert not bench.twin.ok


@cocotb.test()
async def a_guard_that_says_no_is_heard(dut) -> None:
    """Within its latency, though it beats."""
    bench = await Bench.fresh(dut)
    await bench.start()
    await bench.beats(4, guard_ok=1)
    await bench.clocks(OK_LATENCY - 1, guard_ok=0, guard_beat=1 - bench.inputs["guard_beat"])
    assert bench.twin.ok
    await bench.clocks()
    assert not bench.twin.ok


@cocotb.test()
async def a_trip_is_told_once(dut) -> None:
    """However long it is, and though its bits come apart; the last one's is kept."""
    bench = await Bench.fresh(dut)
    await bench.start()
    most = (1 << parameters().get("CountWidth", 16)) - 1
    for k in range(5):
        await bench.clocks(guard_fault=0b00100)
        await bench.clocks(20, guard_fault=0b00110)
        assert bench.twin.trip_count == min(k + 1, most) and bench.twin.fault == 0b00110
        await bench.clocks(10, guard_fault=0)
        assert bench.twin.fault == 0b00110


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["smallest", "odd", "shipped"])
def test_rtl(elaboration: dict[str, int]) -> None:
    """Every elaboration runs every test above."""
    simulate("guard_watch", __file__, elaboration)
