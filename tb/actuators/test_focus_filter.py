"""focus_filter: every clock of the RTL against the model, and the average against a float one."""

import cocotb
from cocotb.triggers import FallingEdge, Timer
from focus_bench import MM, POINT, SETTINGS, FocusBench
from harness import CLOCK_NS, EACH_VOLUME, Ports, rounds, simulate

from vrscan.clocked.focus_filter import BAD_FLAGS, LATENCY, FocusFilter
from vrscan.data import pkg

QUIET = {"valid": 0, **POINT, "z": 0, "busy": 0}
OUTPUTS = ("valid", "distance", "lapse")
PERIOD = LATENCY + 1


class Bench(FocusBench):
    """Filter and twin, compared every clock."""

    strobes = ("valid",)
    period = PERIOD

    def __init__(self, dut, salt: int) -> None:
        super().__init__(dut, QUIET, salt)
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS], ["distance_o"])

    async def start(self, **settings: int) -> None:
        """Reset both."""
        self.configure(**vars(SETTINGS) | settings)
        await self.restart()

    async def restart(self, **inputs: int) -> None:
        """Reset for a clock with these inputs."""
        await self.reset_to(FocusFilter(self.settings), **(QUIET | inputs))
        self.give(valid=0)
        self.check()

    def check(self) -> None:
        got, twin = self.outputs.read(), self.twin
        want = (twin.valid, twin.distance, twin.lapse)
        assert got == want, f"clock {self.clock}: {OUTPUTS} {got}, want {want}, {self.inputs}"


@cocotb.test()
async def the_distance_is_an_average_of_good_points(dut) -> None:
    """Running means to begin with, then 1 / 2**s of each; a latency; no bad point counts."""
    bench = await Bench.started(dut, 1)
    for shift in (0, 1, 3, 5, 15):
        await bench.start(average_shift=shift)
        twin = bench.twin
        want, worst = 0.0, 0.0
        for k in range(100):
            z = int(bench.draw.integers(-(1 << 23), 1 << 23))
            want += (z - want) * 2.0 ** -min((k + 1).bit_length() - 1, shift)
            before = twin.distance
            await bench.clocks(valid=1, **POINT, z=z)
            await bench.clocks(LATENCY - 2)
            assert twin.distance == before, "before its latency"
            await bench.clocks()
            enough = k + 1 >= 1 << shift
            assert (twin.distance != before) == enough, (shift, k)
            if enough:
                worst = max(worst, abs(twin.distance - want))
            await bench.clocks(1)
            # What does not count, as far apart as anything.
            bad = 1 << int(bench.draw.choice([b for b in range(16) if BAD_FLAGS >> b & 1]))
            z = int(bench.draw.integers(-(1 << 23), 1 << 23))
            for point in ({"flags": bad}, {"measured": 0}, {"test": 1}):
                await bench.point(period=1, z=z, **point)
        # Each of 2**s points on which the average rests may add half of its step.
        print(f"average of 2**{shift}: measured {worst:.4f}, predicted 0.5 steps, floor 0.5")
        assert worst <= 0.5 + 2.0**shift * 2.0**-17
    # All other flags are good ones.
    await bench.start(average_shift=0)
    for bit in range(16):
        if not BAD_FLAGS >> bit & 1:
            await bench.point(300.0 + bit, flags=1 << bit)
            assert bench.twin.distance == (300 + bit) * MM
    # The ends.
    await bench.start(average_shift=1)
    for z in ((1 << 23) - 1, -(1 << 23)) * 2:
        await bench.point(z=z)
        for _ in range(44):
            await bench.point(z=z)
        assert bench.twin.distance == z


@cocotb.test()
async def a_lapse_starts_the_average_anew(dut) -> None:
    """As many others as are allowed, and one more; points of test lines are not counted."""
    bench = await Bench.started(dut, 2)
    for lapse in (0, 1, 6):
        await bench.start(average_shift=2, lapse=lapse)
        await bench.points(300.0, 8)
        await bench.points(0.0, lapse, measured=0, period=1)
        await bench.points(0.0, 20, test=1, period=1)
        await bench.point(400.0)
        assert bench.twin.distance == 325 * MM
        await bench.points(0.0, lapse + 1, flags=1 << pkg.FLAG_UNSETTLED, period=1)
        for k, mm in enumerate((500.0, 600.0, 800.0)):
            await bench.point(mm)
            assert bench.twin.distance == 325 * MM, k
        # 500, and the halves of those at 600 and 800, make 675; a quarter of the next.
        await bench.point(675.0)
        assert bench.twin.distance == 675 * MM
    # A point that comes too early counts neither way, nor does one while the target is at work.
    await bench.start(average_shift=1, lapse=0)
    await bench.points(300.0, 8)
    for measured in (0, 1):
        for early in range(1, PERIOD):
            await bench.point(300.0, period=early)
            await bench.point(1000.0, period=PERIOD - early, measured=measured)
            assert bench.twin.distance == 300 * MM
        await bench.point(1000.0, measured=measured, busy=1)
        bench.give(busy=0)
        await bench.point(300.0)
        assert bench.twin.distance == 300 * MM
    # The others stop at their largest.
    await bench.start(average_shift=1, lapse=3)
    await bench.points(300.0, 8)
    bench.give(valid=1, measured=0)
    others = (1 << 16) + 1
    await Timer(others * CLOCK_NS, "ns")
    await FallingEdge(dut.clk_i)
    for _ in range(others + 1):
        bench.twin.step(**{name: bench.inputs[name] for name in bench.given})
    bench.give(valid=0)
    await bench.points(400.0, 2)
    assert bench.twin.distance == 400 * MM


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """Nothing of the average is left."""
    bench = await Bench.started(dut, 12)
    for age in range(1, PERIOD + 1):
        await bench.start(average_shift=1)
        await bench.points(300.0, 2)
        await bench.points(0.0, 9, measured=0, period=1)
        await bench.point(400.0, period=age)
        await bench.restart(valid=1, measured=age % 2)
        assert bench.twin.distance == 0
        await bench.clocks(PERIOD)
        for mm, distance in ((700.0, 0), (700.0, 700 * MM)):
            await bench.point(mm)
            assert bench.twin.distance == distance


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Random points, settings and resets: as the twin."""
    bench = await Bench.started(dut, 13)
    draw = bench.draw
    for k in range(rounds(3000, 60_000)):
        if k % 500 == 0:
            await bench.start(average_shift=int(draw.integers(4)), lapse=int(draw.integers(5)))
        await bench.clocks(
            valid=int(draw.random() < 0.3),
            z=int(draw.integers(-(1 << 23), 1 << 23)),
            measured=int(draw.random() < 0.7),
            flags=int(draw.integers(1 << 16)) if draw.random() < 0.1 else 0,
            test=int(draw.random() < 0.1),
            busy=int(draw.random() < 0.3),
        )


@EACH_VOLUME
def test_focus_filter_rtl_equals_model(volume: str) -> None:
    simulate("focus_filter", __file__, volume=volume)
