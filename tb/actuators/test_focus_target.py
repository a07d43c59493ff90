"""focus_target: every clock of the RTL against the model, and the table against interpolation."""

import cocotb
import numpy as np
from focus_bench import MM, SETTINGS, TABLE, TABLE_WRITE, Z_BEGIN, Z_SHIFT, FocusBench
from harness import EACH_VOLUME, Ports, rounds, simulate

from vrscan.clocked.focus_target import LATENCY, FocusTarget, position
from vrscan.registers.focus_registers import FRACTION_WIDTH, TABLE_SIZE, Mode

QUIET = {"valid": 0, "distance": 0, "lapse": 0, **TABLE_WRITE}
OUTPUTS = ("busy", "target", "known")


class Bench(FocusBench):
    """Target and twin, compared every clock."""

    strobes = ("valid", "lapse", "table_write")

    def __init__(self, dut, salt: int) -> None:
        super().__init__(dut, QUIET, salt)
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS])
        self.table = [0] * TABLE_SIZE

    async def start(self, table: list[int] = TABLE, **settings: int) -> None:
        """Reset both, and write the table."""
        self.configure(**vars(SETTINGS) | settings)
        await self.restart()
        if table != self.table:
            await self.write_table(table)

    async def restart(self, **inputs: int) -> None:
        """Reset for a clock with these inputs; the table stays."""
        twin = FocusTarget(self.settings)
        twin.table[:] = self.table
        await self.reset_to(twin, **(QUIET | inputs))
        self.give(valid=0, lapse=0)
        self.check()

    def check(self) -> None:
        got, twin = self.outputs.read(), self.twin
        want = (twin.busy, twin.target, twin.known)
        assert got == want, f"clock {self.clock}: {OUTPUTS} {got}, want {want}, {self.inputs}"

    async def distance(self, z: int, *, period: int = LATENCY) -> None:
        """Give a distance and wait for the target."""
        await self.clocks(valid=1, distance=z)
        await self.clocks(period - 1)


@cocotb.test()
async def the_position_is_that_of_the_table(dut) -> None:
    """All shifts, both ends and beyond, steep tables; the target after its latency."""
    bench = await Bench.started(dut, 3)
    await bench.start(hysteresis=0, hold_points=0, mode=Mode.AUTOMATIC)
    seen: set[int] = set()
    places = bench.draw.permutation(np.arange(-1, TABLE_SIZE + 1))
    for z_shift in range(16):
        step = 1 << z_shift + FRACTION_WIDTH
        worst = bound = 0.0
        for steep in (0, 1):
            table = (
                bench.draw.choice([0, 65_535], 64)
                if steep
                else bench.draw.integers(1 << 16, size=64)
            )
            await bench.write_table([int(p) for p in table])
            begin_z = int(bench.draw.integers(-(1 << 23), 0))
            bench.configure(z_shift=z_shift, z_begin=begin_z)
            for place in places[:20]:
                z = begin_z + int(place) * step + int(bench.draw.integers(step))
                z = min(max(z, -(1 << 23)), (1 << 23) - 1)
                want = position(z, begin_z, z_shift, bench.table)
                exact = np.interp(z, begin_z + np.arange(64) * step, table)
                worst = max(worst, abs(want - exact))
                before = bench.twin.target
                await bench.distance(z, period=LATENCY - 1)
                assert bench.twin.target == before, "before its latency"
                await bench.clocks()
                assert bench.twin.target == want
                seen.add(max(z - begin_z, -1) // step)
            places = np.roll(places, 20)
            steepest = int(np.abs(np.diff(table)).max())
            bound = max(bound, 0.5 + steepest * (1 - 2.0**-z_shift) * 2.0**-FRACTION_WIDTH)
        print(
            f"table of 2**{z_shift}: measured {worst:.2f}, predicted {bound:.2f}, floor 0.5 steps"
        )
        assert worst <= bound
    assert set(range(-1, TABLE_SIZE)) <= seen, "every entry, and beyond"


@cocotb.test()
async def it_does_not_hunt(dut) -> None:
    """The first target at once; a next one only farther than the hysteresis, and for some time."""
    bench = await Bench.started(dut, 4)
    identity = [k << FRACTION_WIDTH for k in range(TABLE_SIZE)]  # the position is z
    for hysteresis, hold_points in ((10, 3), (0, 1), (3, 0), (700, 20)):
        most = max(hold_points, 1)
        settings = {"hysteresis": hysteresis, "hold_points": hold_points, "z_begin": 0}
        await bench.start(identity, **settings, z_shift=0)
        await bench.distance(5000)
        assert (bench.twin.target, bench.twin.known) == (0, False)
        bench.configure(mode=Mode.AUTOMATIC)
        await bench.distance(5000)
        assert (bench.twin.target, bench.twin.known) == (5000, True)
        for sign in (-1, 1):
            near, far = 5000 + sign * hysteresis, 5000 + sign * (hysteresis + 1)
            for _ in range(most + 2):
                await bench.distance(near)
            for _ in range(most - 1):
                await bench.distance(far)
            assert bench.twin.target == 5000
            await bench.distance(near)
            for _ in range(most - 1):
                await bench.distance(far)
            assert bench.twin.target == 5000, "counted on end"
            # A lapse ends it, too, and so does the mode.
            await bench.clocks(lapse=1)
            for _ in range(most - 1):
                await bench.distance(far)
            assert bench.twin.target == 5000, "a lapse"
            await bench.distance(far)
            assert bench.twin.target == far
            for _ in range(most):
                await bench.distance(5000)
            assert bench.twin.target == 5000
        # Another mode forgets that there was a target, and the next one is taken at once.
        bench.configure(mode=Mode.OFF)
        await bench.clocks(3)
        bench.configure(mode=Mode.AUTOMATIC)
        await bench.clocks(3)
        assert (bench.twin.target, bench.twin.known) == (5000, False)
        await bench.distance(5001)
        assert bench.twin.target == 5001
        bench.configure(mode=Mode.MANUAL, manual=77)
        await bench.clocks()
        assert (bench.twin.target, bench.twin.known) == (77, True)


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """Nothing is left but the table."""
    bench = await Bench.started(dut, 12)
    for age in range(1, LATENCY + 2):
        await bench.start(mode=Mode.AUTOMATIC)
        await bench.distance(300 * MM)
        await bench.distance(400 * MM, period=age)
        await bench.restart(valid=age % 2, lapse=1)
        assert bench.twin.target == 0
        await bench.clocks(LATENCY + 5)
        assert (bench.twin.target, bench.twin.known) == (0, False)
        await bench.distance(700 * MM)
        assert bench.twin.target == position(700 * MM, Z_BEGIN, Z_SHIFT, TABLE)


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Random distances, modes, lapses and settings, with resets: as the twin."""
    bench = await Bench.started(dut, 13)
    draw = bench.draw
    mm, taken = 500.0, 0
    for _ in range(rounds(500, 10_000)):
        if draw.random() < 0.1:
            bench.configure(
                hysteresis=int(draw.integers(30)),
                hold_points=int(draw.integers(4)),
                mode=int(draw.choice([0, 1, 2, 2, 2, 2, 2, 3])),
                manual=int(draw.integers(6000)),
            )
        if draw.random() < 0.02:
            await bench.restart(valid=1)
        mm += float(draw.normal(0.0, 2.0))
        before = bench.twin.target
        await bench.distance(round(mm * MM))
        taken += bench.twin.target != before
        await bench.clocks(int(draw.integers(1, 6)), lapse=int(draw.random() < 0.1))
    assert taken > 20


@EACH_VOLUME
def test_focus_target_rtl_equals_model(volume: str) -> None:
    simulate("focus_target", __file__, volume=volume)
