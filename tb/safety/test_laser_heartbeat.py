"""laser_heartbeat: every clock of the RTL against the model, and what ends and begins the beats."""

import cocotb
import pytest
from harness import TwinBench, as_integer, generator, parameters, simulate

from vrscan.clocked.laser_heartbeat import DIFFERENCE_LATENCY, LaserHeartbeat

ELABORATIONS = [{"HeartbeatBits": 1, "Width": 1}, {"HeartbeatBits": 3, "Width": 40}]
QUIET = {"enable": 1, "first": 0, "second": 0}


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares the output every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.bits = parameters()["HeartbeatBits"]

    async def start(self, **inputs: int) -> None:
        """Reset for a clock with these inputs."""
        await self.reset_to(LaserHeartbeat(self.bits), **(QUIET | inputs))
        self.check()

    def check(self) -> None:
        """Compare the output."""
        got, want = as_integer(self.dut.heartbeat_o), int(self.twin.heartbeat)
        assert got == want, f"clock {self.clock}, {self.inputs}: {got}, want {want}"

    async def changes(self, clocks: int, **inputs: int) -> int:
        """Go on by some clocks; return how often the output changed."""
        count = 0
        for _ in range(clocks):
            before = self.twin.heartbeat
            await self.clocks(**inputs)
            count += self.twin.heartbeat != before
        return count


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Values that agree now and then, and differ in one bit."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    width = parameters()["Width"]
    for _ in range(30):
        await bench.start(first=1, second=int(draw.integers(2)))
        for _ in range(int(draw.integers(20, 300))):
            first = int(draw.integers(1 << width))
            wrong = 1 << int(draw.integers(width)) if draw.random() < 0.02 else 0
            enable = int(draw.random() < 0.9)
            await bench.clocks(first=first, second=first ^ wrong, enable=enable)


@cocotb.test()
async def a_difference_of_any_bit_ends_the_beats(dut) -> None:
    """Of one clock, and until an enable that was low; within the clocks that the header says."""
    bench = await Bench.fresh(dut)
    period = 1 << bench.bits
    for bit in range(parameters()["Width"]):
        await bench.start()
        assert await bench.changes(4 * period) == 4
        await bench.clocks(first=1 << bit)
        assert (
            await bench.changes(20 * period, first=0) <= (DIFFERENCE_LATENCY - 1 + period) // period
        )
        assert await bench.changes(20 * period) == 0
        await bench.clocks(enable=0)
        assert await bench.changes(4 * period, enable=1) == 4


@cocotb.test()
async def there_are_no_beats_while_they_differ(dut) -> None:
    """Not even while the enable is low."""
    bench = await Bench.fresh(dut)
    period = 1 << bench.bits
    await bench.start()
    await bench.clocks(8, first=1, enable=0)
    assert await bench.changes(10 * period) == 0
    assert await bench.changes(4 * period + 2, second=1) >= 3


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["smallest", "wide"])
def test_rtl(elaboration: dict[str, int]) -> None:
    """Every elaboration runs every test above."""
    simulate("laser_heartbeat", __file__, elaboration)
