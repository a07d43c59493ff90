"""focus_control: every clock of the RTL against the model, with a motor on a bus that can fail."""

from dataclasses import replace
from operator import attrgetter

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    Ports,
    TwinBench,
    generator,
    parameters,
    reset,
    rounds,
    simulate,
)

from vrscan.clocked.focus_control import (
    BAD_FLAGS,
    DISTANCE_LATENCY,
    FRACTION_WIDTH,
    NOT_REACHED,
    PAUSE_EXTRA,
    REPLY_LATENCY,
    TABLE_SIZE,
    TARGET_LATENCY,
    WIDTHS,
    FocusControl,
    Mode,
    Settings,
    State,
    position,
)
from vrscan.clocked.i2c_master import Status, command_clocks
from vrscan.data import pkg

ELABORATIONS = [{"CountWidth": 16}, {"CountWidth": 2}]
ADDRESS = 0x2A
TRAVEL = 6000  # of the device
STEP_CLKS = 16  # of its motor
MM = 1 << pkg.LENGTH_FRACTION
Z_BEGIN, Z_SHIFT = 240 * MM, 6
NONE = 15  # no byte is not acknowledged
SETTINGS = Settings(
    mode=Mode.OFF,
    manual=0,
    average_shift=2,
    lapse=6,
    z_begin=Z_BEGIN,
    z_shift=Z_SHIFT,
    hysteresis=10,
    hold=3,
    address=ADDRESS,
    quarter_clks=4,
    stretch_clks=300,
    poll_clks=150,
    tolerance=1,
    timeout_clks=40_000,
    retries=2,
)
POINT = {"measured": 1, "flags": 0, "test": 0}
CALM = {
    "valid": 0,
    **POINT,
    "z": 0,
    "focus_table_write": 0,
    "focus_table_index": 0,
    "focus_table_position": 0,
    "other_scl_low": 0,
    "other_sda_low": 0,
    "device_rst": 0,
    "device_address": ADDRESS,
    "nack_address": 0,
    "nack_byte": NONE,
    "stretch_clks": 0,
    "stretch_bits": 0,
    "hold_scl": 0,
    "hold_sda": 0,
    "stall": 0,
    "push": 0,
    "noise": 0,
}
STATUS = (
    "state", "fault", "distance", "target", "position", "in_position", "nack_count",
    "stretch_count", "stuck_count", "arbitration_count", "timeout_count", "recovery_count",
)  # fmt: skip
STATUS_OF = attrgetter(*STATUS)


def lens(distance: float) -> float:
    """Return the position of a lens that is sharp at a distance, mm, in steps."""
    return 25.0**2 / (distance - 25.0) / 0.5e-3


def table_distance(k: np.ndarray) -> np.ndarray:
    """Return the distances of the table's entries, mm."""
    return (Z_BEGIN + (k << Z_SHIFT + FRACTION_WIDTH)) / MM


TABLE = [round(float(p)) for p in lens(table_distance(np.arange(TABLE_SIZE)))]


class Bench(TwinBench):
    """Control, motor and twin, compared every clock.

    Attributes:
        ends: The statuses of all commands.
    """

    strobes = ("valid", "focus_table_write", "push")

    def __init__(self, dut, salt: int) -> None:
        names = [*CALM, *(f"focus_{name}" for name in WIDTHS)]
        super().__init__(dut, names)
        self.draw = generator(salt)
        outputs = [f"focus_{name}_o" for name in (*STATUS, "scl_low", "sda_low")]
        self.outputs = Ports(dut, outputs, ["focus_distance_o"])
        self.device = Ports(dut, ["device_scl_low_o", "device_sda_low_o"])
        self.settings = SETTINGS
        self.table = list(TABLE)
        self.ends: list[Status] = []

    def on_port(self, name: str, value: int) -> tuple[str, int]:
        return ("line.test" if name == "test" else name), value

    async def start(self, **inputs: int) -> None:
        """Reset both, the motor stands at 0, and write the table; ``inputs`` may be settings."""
        self.give(**CALM | {"device_rst": 1, "focus_mode": 0})
        await self.restart(**vars(SETTINGS) | inputs)
        self.give(device_rst=0)
        await self.write_table(TABLE)
        self.ends.clear()

    async def restart(self, **inputs: int) -> None:
        """Reset for a clock; the table stays."""
        self.configure(**{k: v for k, v in inputs.items() if k in WIDTHS})
        twin = FocusControl(self.settings, parameters()["CountWidth"])
        twin.table[:] = self.table
        await self.reset_to(twin, **{k: v for k, v in inputs.items() if k not in WIDTHS})
        self.check()

    def configure(self, **settings: int) -> None:
        """Change settings."""
        self.settings = replace(self.settings, **settings)
        self.give(**{f"focus_{name}": int(value) for name, value in settings.items()})
        if self.twin is not None:
            self.twin.settings = self.settings

    async def write_table(self, table: list[int]) -> None:
        """Write the whole table."""
        for k, value in enumerate(table):
            await self.clocks(focus_table_write=1, focus_table_index=k, focus_table_position=value)
        self.table = list(table)

    def check(self) -> None:
        """Compare all outputs, and look at the device."""
        twin = self.twin
        got = self.outputs.read()
        want = (*STATUS_OF(twin), twin.master.scl_low, twin.master.sda_low)
        assert got == want, f"clock {self.clock}: {STATUS} {got}, want {want}, {self.inputs}"
        self.pulls = self.device.read()
        if twin.master.valid:
            self.ends.append(twin.master.status)

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks with these inputs."""
        self.give(**inputs)
        now, edge = self.inputs, self.dut.clk_i.falling_edge
        for _ in range(count):
            master = self.twin.master
            scl = not (master.scl_low or self.pulls[0] or now["other_scl_low"])
            sda = not (master.sda_low or self.pulls[1] or now["other_sda_low"])
            await edge
            self.twin.step(
                valid=bool(now["valid"]),
                measured=bool(now["measured"]),
                flags=now["flags"],
                test=bool(now["test"]),
                z=now["z"],
                scl=scl,
                sda=sda,
                table_write=bool(now["focus_table_write"]),
                table_index=now["focus_table_index"],
                table_position=now["focus_table_position"],
            )
            self.clock += 1
            self.check()
            for name in self.strobes:
                if now[name]:
                    self.give(**{name: 0})

    async def point(self, mm: float = 0.0, *, period: int = TARGET_LATENCY, **point: int) -> None:
        """Give a point and wait for the next one's time."""
        await self.clocks(valid=1, **POINT | {"z": round(mm * MM)} | point)
        self.give(z=int(self.draw.integers(-(1 << 23), 1 << 23)))
        await self.clocks(period - 1)

    async def points(self, mm: float, count: int, **point: int) -> None:
        """Give some points of one distance."""
        for _ in range(count):
            await self.point(mm, **point)

    async def until(self, *states: State, clocks: int = 60_000) -> None:
        """Go on until the loop is in one of the states."""
        for _ in range(clocks):
            if self.twin.state in states:
                return
            await self.clocks()
        raise AssertionError(f"{self.twin.state.name} after {clocks} clocks, {self.ends[-9:]}")

    async def commands(self, count: int = 1) -> None:
        """Go on until some more commands have ended, and what follows has followed."""
        have = len(self.ends)
        for _ in range(200_000):
            if len(self.ends) >= have + count:
                return await self.clocks(REPLY_LATENCY)
            await self.clocks()
        raise AssertionError(f"no {count} commands")

    async def reach(self, target: int, **inputs: int) -> None:
        """Go to a position in MANUAL."""
        self.configure(mode=Mode.MANUAL, manual=target)
        await self.clocks(2, **inputs)
        await self.until(State.HOLD)
        await self.clocks()
        assert self.twin.in_position
        assert abs(int(self.dut.position_o.value) - target) <= self.settings.tolerance


async def begin(dut, salt: int, **inputs: int) -> Bench:
    """Return a bench after its reset."""
    await reset(dut)
    bench = Bench(dut, salt)
    await bench.start(**inputs)
    return bench


@cocotb.test()
async def the_distance_is_an_average_of_good_points(dut) -> None:
    """Running means to begin with, then 1 / 2**s of each; a latency; no bad point counts."""
    bench = await begin(dut, 1)
    for shift in (0, 1, 3, 5, 15):
        await bench.start(average_shift=shift)
        twin = bench.twin
        want, worst = 0.0, 0.0
        for k in range(100):
            z = int(bench.draw.integers(-(1 << 23), 1 << 23))
            want += (z - want) * 2.0 ** -min((k + 1).bit_length() - 1, shift)
            before = twin.distance
            await bench.clocks(valid=1, **POINT, z=z)
            await bench.clocks(DISTANCE_LATENCY - 2)
            assert twin.distance == before, "before its latency"
            await bench.clocks()
            enough = k + 1 >= 1 << shift
            assert (twin.distance != before) == enough, (shift, k)
            if enough:
                worst = max(worst, abs(twin.distance - want))
            await bench.clocks(TARGET_LATENCY - DISTANCE_LATENCY)
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
    bench = await begin(dut, 2)
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
    # A point that comes too early counts neither way.
    await bench.start(average_shift=1, lapse=0)
    await bench.points(300.0, 8)
    for early in range(1, TARGET_LATENCY):
        for measured in (0, 1):
            await bench.point(300.0, period=early)
            await bench.point(1000.0, period=TARGET_LATENCY - early, measured=measured)
            assert bench.twin.distance == 300 * MM
    # The others stop at their largest.
    if parameters()["CountWidth"] == 2:
        await bench.start(average_shift=1, lapse=3)
        await bench.points(300.0, 8)
        await bench.clocks(1, measured=0)
        for _ in range((1 << 16) + 1):
            await bench.clocks(valid=1)
        await bench.points(400.0, 2)
        assert bench.twin.distance == 400 * MM


@cocotb.test()
async def the_position_is_that_of_the_table(dut) -> None:
    """All shifts, both ends and beyond, steep tables; the target after its latency."""
    bench = await begin(dut, 3)
    await bench.start(average_shift=0, hysteresis=0, hold=0, mode=Mode.AUTOMATIC)
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
                await bench.clocks(valid=1, **POINT, z=z)
                await bench.clocks(TARGET_LATENCY - 2)
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
    bench = await begin(dut, 4)
    for hysteresis, hold in ((10, 3), (0, 1), (3, 0), (700, 20)):
        most = max(hold, 1)
        await bench.start(average_shift=0, hysteresis=hysteresis, hold=hold, z_begin=0, z_shift=0)
        await bench.write_table([k << FRACTION_WIDTH for k in range(TABLE_SIZE)])  # position is z
        await bench.point(z=5000)
        assert bench.twin.target == 0
        bench.configure(mode=Mode.AUTOMATIC)
        await bench.point(z=5000)
        assert bench.twin.target == 5000
        for sign in (-1, 1):
            near, far = 5000 + sign * hysteresis, 5000 + sign * (hysteresis + 1)
            for _ in range(most + 2):
                await bench.point(z=near)
            for _ in range(most - 1):
                await bench.point(z=far)
            # Not a point of one kind or the other.
            await bench.point(z=20_000, measured=0)
            await bench.point(z=20_000, test=1)
            assert bench.twin.target == 5000
            await bench.point(z=near)
            for _ in range(most - 1):
                await bench.point(z=far)
            assert bench.twin.target == 5000, "counted on end"
            # The others of a lapse end it, too, and so does the mode.
            for _ in range(7):
                await bench.point(measured=0)
            for _ in range(most - 1):
                await bench.point(z=far)
            assert bench.twin.target == 5000, "a lapse"
            await bench.point(z=far)
            assert bench.twin.target == far
            for _ in range(most):
                await bench.point(z=5000)
            assert bench.twin.target == 5000
        # Another mode forgets that there was a target, and the next one is taken at once.
        bench.configure(mode=Mode.OFF)
        await bench.clocks(3)
        bench.configure(mode=Mode.AUTOMATIC)
        await bench.clocks(3)
        assert bench.twin.state is State.WAIT
        assert bench.twin.target == 5000
        await bench.point(z=5001)
        assert bench.twin.target == 5001


@cocotb.test()
async def the_lens_follows_the_scene(dut) -> None:
    """Noisy points of three distances: sharp at each, and a write of the motor for each."""
    if parameters()["CountWidth"] != 16:
        return  # counters are no part of it
    bench = await begin(dut, 5, mode=Mode.AUTOMATIC, average_shift=4, hysteresis=14, hold=60)
    await bench.clocks(2000)
    assert bench.twin.state is State.WAIT
    assert not bench.ends, "nothing on the bus before there is a target"
    targets = []
    for mm in (600.0, 400.0, 402.0, 900.0):
        for _ in range(150):
            good = bench.draw.random() < 0.9
            await bench.point(mm + float(bench.draw.normal(0.0, 1.0)), measured=int(good))
            if not targets or targets[-1] != bench.twin.target:
                targets.append(bench.twin.target)
        await bench.until(State.HOLD)
        await bench.clocks(2)
        assert bench.twin.in_position
        moved = int(dut.position_o.value)
        assert abs(moved - bench.twin.target) <= 1
        # Of the lens: hysteresis, the table's chords (h**2 f**2 / 4 (z - f)**3), noise.
        off = moved - lens(mm)
        print(f"{mm} mm: the lens is at {moved}, {off:.1f} steps off")
        assert abs(off) <= 14 + 12
    print(f"targets {targets}")
    assert 4 <= len(targets) <= 8, "first the old average's way, but no hunting"
    assert bench.twin.timeout_count == 0
    assert set(bench.ends) == {Status.OK}


@cocotb.test()
async def commands_in_their_time(dut) -> None:
    """What the motor is told, where it is read, and the pauses between the commands."""
    for poll in (0, 1, 150):
        bench = await begin(dut, 6, poll_clks=poll)
        bench.configure(mode=Mode.MANUAL, manual=40)
        await bench.clocks()
        assert bench.twin.target == 40
        at: list[int] = []
        reply = None
        for _ in range(7000):
            ready = bench.twin.master.ready
            await bench.clocks()
            if ready and not bench.twin.master.ready:
                if reply is not None:
                    at.append(bench.clock - 1 - reply)
                begun = bench.clock - 1
            if bench.twin.master.valid:
                reply = bench.clock
                read = len(bench.ends) > 1
                assert reply - begun - 1 == command_clocks(read=read, count=2, quarter=4)
        assert set(at) == {poll + PAUSE_EXTRA}
        assert bench.twin.in_position
        assert bench.twin.position == 40
        assert int(dut.position_o.value) == 40
    # Position and in_position of a motor that is moved by hand.
    await bench.commands()
    await bench.clocks(stall=1, push=1)
    await bench.commands(2)
    assert bench.twin.position == 41
    assert bench.twin.in_position, "within the tolerance"
    await bench.clocks(push=1)
    await bench.commands(2)
    assert bench.twin.position == 42
    assert not bench.twin.in_position
    assert bench.twin.state is State.MOVE
    bench.give(stall=0)
    await bench.until(State.HOLD)
    assert bench.twin.position in (40, 41)


@cocotb.test()
async def a_new_target_on_the_way(dut) -> None:
    """The position of a target that is gone is no matter; in_position falls a clock after it."""
    if parameters()["CountWidth"] != 16:
        return  # counters are no part of it
    bench = await begin(dut, 7)
    await bench.reach(300)
    bench.configure(manual=1500)
    await bench.clocks()
    assert (bench.twin.target, bench.twin.in_position) == (1500, True)
    await bench.clocks()
    assert not bench.twin.in_position
    await bench.until(State.MOVE)
    await bench.commands(3)
    bench.configure(manual=310)
    await bench.until(State.HOLD)
    await bench.clocks(2)
    assert bench.twin.in_position
    assert int(dut.position_o.value) in (309, 310, 311)
    # There and back between two commands: never mind.
    await bench.commands()
    bench.configure(manual=900)
    await bench.clocks(3)
    bench.configure(manual=310)
    await bench.commands(3)
    assert bench.twin.in_position
    # At every place of a command.
    total = command_clocks(read=True, count=2, quarter=4) + 170
    for age in range(0, total, rounds(142, 17)):
        await bench.commands()
        bench.configure(manual=310 + age % 5)
        await bench.clocks(age)
        bench.configure(manual=310 - age % 7)
        await bench.commands(3)
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - bench.twin.target) <= 1


@cocotb.test()
async def off_at_every_place(dut) -> None:
    """Off for a clock or more anywhere in a command: the old reply is nobody's, then it works."""
    if parameters()["CountWidth"] != 16:
        return  # counters are no part of it
    bench = await begin(dut, 8)
    await bench.reach(100)
    total = command_clocks(read=True, count=2, quarter=4) + 170
    for age in range(0, total, 61):
        await bench.commands()
        await bench.clocks(age)
        before = bench.twin.position
        bench.configure(mode=int(bench.draw.choice([Mode.OFF, 3])))
        await bench.clocks()
        assert bench.twin.state is State.OFF
        await bench.clocks(age % 4)
        have = len(bench.ends)
        if age % 2:
            await bench.clocks(total)
            assert len(bench.ends) <= have + 1, "one that ran, and no more"
            assert bench.twin.state is State.OFF
        bench.configure(mode=Mode.MANUAL, manual=100 + age % 50)
        assert bench.twin.position == before
        await bench.clocks(3)
        assert bench.twin.state is State.MOVE
        assert not bench.twin.in_position
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - bench.twin.target) <= 1
    # Without a target there is nothing to do, whatever the mode was.
    bench.configure(mode=Mode.AUTOMATIC)
    await bench.clocks(2)
    assert bench.twin.state is State.WAIT
    await bench.clocks(3 * total)
    assert bench.twin.state is State.WAIT


TROUBLE = {
    "nack_address": (Status.NACK_ADDRESS, "nack_count", {"nack_address": 1}, {"nack_address": 0}),
    "nack_data": (Status.NACK_DATA, "nack_count", {"nack_byte": 0}, {"nack_byte": NONE}),
    "stretch": (
        Status.STRETCH_TIMEOUT, "stretch_count", {"stretch_clks": 400}, {"stretch_clks": 0},
    ),
    "clock": (Status.BUS_STUCK, "stuck_count", {"hold_scl": 1}, {"hold_scl": 0}),
    "data": (Status.BUS_STUCK, "stuck_count", {"hold_sda": 1}, {"hold_sda": 0}),
}  # fmt: skip


@cocotb.test()
async def a_bus_in_trouble(dut) -> None:
    """Each kind is counted and tried again, ends in FAULT, and is over when the mode was off."""
    bench = await begin(dut, 9)
    top = (1 << parameters()["CountWidth"]) - 1
    for name, (status, count, broken, well) in TROUBLE.items():
        for retries in (0, 2):
            await bench.start(retries=retries)
            await bench.reach(50)
            bench.ends.clear()
            # In a pause, where none of the lines is in use.
            await bench.commands()
            bench.give(**broken)
            await bench.until(State.FAULT)
            assert bench.ends[1:] == [status] * (retries + 1), (name, bench.ends)
            assert bench.twin.fault == status
            assert getattr(bench.twin, count) == min(retries + 1, top)
            assert sum(getattr(bench.twin, c) for c in STATUS[6:11]) == min(retries + 1, top)
            recoveries = retries + 1 if name == "data" else 0
            assert bench.twin.recovery_count == min(recoveries, top)
            # It stays, well or not, whatever the target.
            bench.give(**well)
            bench.configure(manual=60)
            await bench.clocks(3000)
            assert bench.twin.state is State.FAULT
            assert not bench.twin.in_position
            bench.configure(mode=Mode.OFF)
            await bench.clocks(2)
            assert (bench.twin.state, bench.twin.fault) == (State.OFF, status)
            await bench.reach(60)
            assert bench.twin.fault == 0
            assert getattr(bench.twin, count) == min(retries + 1, top), "kept"
        # As often as is allowed, over and over: no FAULT, and the write is not forgotten.
        await bench.start(retries=2, poll_clks=400)
        await bench.reach(50)
        for k in range(3):
            await bench.commands()
            bench.configure(manual=60 + 10 * k)
            bench.give(**broken)
            await bench.commands(2)
            bench.give(**well)
            await bench.clocks(3)
            await bench.until(State.HOLD)
            assert int(dut.position_o.value) in range(59 + 10 * k, 62 + 10 * k)
            assert bench.ends.count(status) == 2 * (k + 1)
        assert getattr(bench.twin, count) == min(6, top)


@cocotb.test()
async def a_bus_that_recovers(dut) -> None:
    """A device stuck within a byte is clocked free by the next command, another master is heard."""
    if parameters()["CountWidth"] != 16:
        return  # counters are no part of it
    bench = await begin(dut, 10)
    await bench.reach(50)
    # The control is reset while the device sends: it may hold SDA for ever.
    recovered = 0
    for age in range(520, 1000, rounds(58, 7)):
        await bench.commands()
        await bench.clocks(150)
        await bench.clocks(age)
        table = bench.table
        await bench.restart()
        assert bench.table is table
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - bench.twin.target) <= 1
        recovered += bench.twin.recovery_count
    print(f"{recovered} recoveries")
    assert recovered > rounds(1, 12)
    # SDA is low for the first few clocks of the recovery only: the command goes through.
    for clocks in (1, 4, 8):
        await bench.start()
        await bench.reach(50)
        await bench.commands()
        await bench.clocks(hold_sda=1)
        while not bench.twin.recovery_count:
            await bench.clocks()
        await bench.clocks(clocks * 22)
        bench.give(hold_sda=0)
        await bench.commands()
        assert bench.ends[-1] is Status.OK
        assert (bench.twin.recovery_count, bench.twin.stuck_count) == (1, 0)
    # Another master takes the bus in the middle of a byte.
    await bench.start(retries=8)
    await bench.reach(50)
    for age in range(200, 900, rounds(46, 5)):
        await bench.commands()
        await bench.clocks(age)
        await bench.clocks(45, other_sda_low=1)
        bench.give(other_sda_low=0)
        await bench.commands(2)
        await bench.until(State.HOLD)
    lost = bench.ends.count(Status.ARBITRATION)
    assert lost > rounds(4, 32)
    assert bench.twin.arbitration_count == min(lost, (1 << parameters()["CountWidth"]) - 1)


@cocotb.test()
async def a_motor_in_trouble(dut) -> None:
    """It stands, is slow, has nowhere to go, shows noise, loses power, is knocked."""
    bench = await begin(dut, 11, timeout_clks=6000)
    twin = bench.twin
    top = (1 << parameters()["CountWidth"]) - 1
    await bench.reach(50)
    # It stands: written again, so many times, then FAULT.
    bench.give(stall=1)
    bench.configure(manual=80)
    await bench.until(State.FAULT)
    assert (twin.fault, twin.timeout_count) == (NOT_REACHED, 3)
    assert (twin.position, set(bench.ends)) == (50, {Status.OK})
    bench.configure(mode=Mode.OFF)
    await bench.clocks(2)
    # It goes on after two of them, again and again: that is in time.
    for k in range(2):
        bench.configure(mode=Mode.MANUAL, manual=100 + 20 * k)
        await bench.clocks(18_000, stall=1)
        assert twin.timeout_count == min(3 + 2 * (k + 1), top)
        bench.give(stall=0)
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - 100 - 20 * k) <= 1
    # A new target begins to count anew.
    bench.give(stall=1)
    for k in range(4):
        bench.configure(manual=500 + k)
        await bench.clocks(9000)
        assert twin.state is State.MOVE
    bench.give(stall=0)
    await bench.until(State.HOLD)
    # Slower than the time-out, but it gets there; a time-out of 0 writes after every read.
    for timeout, retries in ((6000, 9), (0, 255)):
        await bench.start(timeout_clks=timeout, retries=retries)
        await bench.reach(1500)
        assert bench.twin.timeout_count > 2
    # Beyond its travel.
    await bench.start(timeout_clks=6000, poll_clks=2000)
    await bench.clocks(push=TRAVEL)
    bench.configure(mode=Mode.MANUAL, manual=TRAVEL + 5)
    await bench.until(State.FAULT)
    assert (bench.twin.fault, bench.twin.position) == (NOT_REACHED, TRAVEL)
    # Noise within the tolerance is none, more of it is seen and is over again.
    await bench.start(tolerance=4)
    twin = bench.twin
    await bench.reach(200)
    states = {State.HOLD: 0, State.MOVE: 0}
    for size in (4, 9):
        for _ in range(24):
            await bench.commands()
            bench.give(noise=int(bench.draw.integers(-size, size + 1)))
            states[twin.state] += 1
        assert (states[State.MOVE] > 0) == (size > 4), states
    bench.give(noise=0)
    await bench.until(State.HOLD)
    assert twin.fault == twin.timeout_count == 0
    # Knocked, and without power for a moment.
    for knock in (300, -150):
        await bench.commands()
        await bench.clocks(push=knock)
        await bench.until(State.MOVE)
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - 200) <= 4
    await bench.commands()
    await bench.clocks(40)
    await bench.clocks(device_rst=1)
    bench.give(device_rst=0)
    await bench.until(State.MOVE)
    await bench.until(State.HOLD)
    assert abs(int(dut.position_o.value) - 200) <= 4


@cocotb.test()
async def reset_mid_stream(dut) -> None:
    """At every age of a point, and in every state: nothing is left but the table."""
    if parameters()["CountWidth"] != 16:
        return  # counters are no part of it
    bench = await begin(dut, 12)
    for age in range(1, TARGET_LATENCY + 2):
        await bench.start(mode=Mode.AUTOMATIC, average_shift=0)
        await bench.point(300.0)
        await bench.point(400.0, period=age)
        await bench.restart(valid=age % 2, **POINT)
        bench.give(valid=0)
        assert (bench.twin.distance, bench.twin.target) == (0, 0)
        await bench.clocks(TARGET_LATENCY + 5)
        assert bench.twin.distance == 0
        assert bench.twin.state is State.WAIT
        await bench.point(700.0)
        assert bench.twin.distance == 700 * MM
        assert bench.twin.target == position(700 * MM, Z_BEGIN, Z_SHIFT, TABLE)
    for age in range(7, 1000, 83):
        await bench.start(average_shift=0)
        await bench.reach(30)
        await bench.commands()
        await bench.clocks(age)
        await bench.restart()
        assert not any(getattr(bench.twin, name) for name in STATUS)
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - 30) <= 1
    await bench.start(retries=0, nack_address=1)
    bench.configure(mode=Mode.MANUAL)
    await bench.until(State.FAULT)
    await bench.restart(nack_address=0)
    await bench.until(State.HOLD)
    assert bench.twin.nack_count == 0


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Random points, modes, targets, faults of bus and motor, and resets: as the twin."""
    if parameters()["CountWidth"] != 16:
        return  # counters are no part of it
    bench = await begin(dut, 13)
    draw = bench.draw
    states: set[State] = set()
    for k in range(rounds(30, 120)):
        if k % 6 == 0:
            await bench.start(
                quarter_clks=int(draw.integers(4, 6)),
                stretch_clks=int(draw.choice([7, 60, 300])),
                poll_clks=int(draw.choice([0, 40, 150])),
                retries=int(draw.integers(4)),
                timeout_clks=int(draw.choice([0, 3000, 8000])),
                average_shift=int(draw.integers(4)),
                hysteresis=int(draw.integers(30)),
                hold=int(draw.integers(4)),
                lapse=int(draw.integers(5)),
                tolerance=int(draw.integers(4)),
            )
            await bench.write_table([200 - 3 * entry for entry in range(TABLE_SIZE)])
        bench.configure(mode=int(draw.choice([0, 1, 2, 2, 3])), manual=int(draw.integers(200)))
        rate = float(draw.choice([0.0, 0.0, 0.0003, 0.003]))
        bench.give(
            nack_address=int(draw.random() < 0.05),
            nack_byte=int(draw.choice([NONE] * 8 + [0, 1])),
            stretch_clks=int(draw.choice([0, 0, 0, 10, 70])),
            stall=int(draw.random() < 0.15),
        )
        left = dict.fromkeys(("hold_scl", "hold_sda", "other_scl_low", "other_sda_low"), 0)
        mm = float(draw.uniform(300, 1000))
        for _ in range(5000):
            for name, chance in zip(left, draw.random(4), strict=True):
                left[name] = max(left[name] - 1, 0)
                if chance < rate:
                    left[name] = int(draw.choice([1, 3, 30, 150, 900]))
            bench.give(**{name: int(n > 0) for name, n in left.items()})
            if draw.random() < 0.05:
                mm += float(draw.normal(0.0, 2.0))
                await bench.clocks(
                    valid=1,
                    z=round(mm * MM),
                    measured=int(draw.random() < 0.8),
                    flags=int(draw.integers(1 << 16)) if draw.random() < 0.1 else 0,
                    test=int(draw.random() < 0.1),
                )
            else:
                await bench.clocks(noise=int(draw.integers(-1, 2)))
            states.add(bench.twin.state)
        if draw.random() < 0.1:
            await bench.restart(valid=int(draw.integers(2)))
    assert states == set(State), states
    print(f"disorder: {bench.ends.count(Status.OK)} OK of {len(bench.ends)}")


def test_settings_that_do_not_fit() -> None:
    for name, width in WIDTHS.items():
        low = -1 << (width - 1) if name == "z_begin" else 0
        for value in (low - 1, low + (1 << width)):
            with pytest.raises(ValueError, match=f"{name} does not fit"):
                replace(SETTINGS, **{name: value})


@EACH_VOLUME
@pytest.mark.parametrize("given", ELABORATIONS, ids=str)
def test_focus_control_rtl_equals_model(given: dict[str, int], volume: str) -> None:
    simulate("focus_bus", __file__, given, volume=volume)
