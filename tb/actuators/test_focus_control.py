"""focus_control: every clock of the RTL against the model, with a motor on a bus that can fail."""

from itertools import product
from operator import attrgetter

import cocotb
from focus_bench import (
    ADDRESS,
    MM,
    POINT,
    SETTINGS,
    TABLE,
    TABLE_WRITE,
    Z_BEGIN,
    Z_SHIFT,
    FocusBench,
    lens,
)
from harness import EACH_VOLUME, Ports, rounds, simulate

from vrscan.clocked.focus_control import DISTANCE_LATENCY, TARGET_LATENCY, FocusControl
from vrscan.clocked.focus_motor import NOT_REACHED, PAUSE_EXTRA, REPLY_LATENCY, State
from vrscan.clocked.focus_target import position
from vrscan.clocked.i2c_master import Status, command_clocks
from vrscan.clocked.m3_motor import BAD_REPLY, BEYOND, LIMIT, MOTOR_ERROR
from vrscan.clocked.m3_motor import command_clocks as m3_clocks
from vrscan.registers.focus_registers import FRACTION_WIDTH, TABLE_SIZE, Mode

TRAVEL = 6000  # of the device
NONE = 15  # no byte is not acknowledged
CALM = {
    "valid": 0,
    **POINT,
    "z": 0,
    **TABLE_WRITE,
    "other_scl_low": 0,
    "other_sda_low": 0,
    "device_rst": 0,
    "m3": 0,
    "offset": 0,
    "status": 0,
    "spoil": 31,
    "spoilt": 0,
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
COUNTERS = (
    "nack_count", "stretch_count", "stuck_count", "arbitration_count", "timeout_count",
    "reply_count",
)  # fmt: skip
STATUS = {
    "focus_distance": "filter.distance",
    "focus_target": "lens.target",
    **{
        f"focus_{name}": f"motor.{name}"
        for name in ("state", "fault", "position", "in_position", *COUNTERS)
    },
    "focus_recovery_count": "master.recovery_count",
    "focus_motor_status": "m3.motor_status",
    "focus_scl_low": "master.scl_low",
    "focus_sda_low": "master.sda_low",
}
STATUS_OF = attrgetter(*STATUS.values())


class Bench(FocusBench):
    """Control, motor and twin, compared every clock.

    Attributes:
        ends: The statuses of all commands.
    """

    strobes = ("valid", "table_write", "push")
    period = TARGET_LATENCY

    def __init__(self, dut, salt: int) -> None:
        super().__init__(dut, CALM, salt)
        self.outputs = Ports(dut, [f"{name}_o" for name in STATUS])
        self.device = Ports(dut, ["device_scl_low_o", "device_sda_low_o"])
        self.table = list(TABLE)
        self.ends: list[int] = []

    @property
    def motor(self):
        return self.twin.motor

    @property
    def target(self) -> int:
        return self.twin.lens.target

    def tell(self) -> None:
        self.twin.configure(self.settings)

    async def start(self, **inputs: int) -> None:
        """Reset both, the motor stands at 0, and write the table; ``inputs`` may be settings."""
        self.give(**CALM | {"device_rst": 1, "focus_mode": 0})
        await self.restart(**vars(SETTINGS) | inputs)
        self.give(device_rst=0)
        await self.write_table(TABLE)
        self.ends.clear()

    async def restart(self, **inputs: int) -> None:
        """Reset for a clock; the table stays."""
        self.configure(**{k: v for k, v in inputs.items() if k in vars(SETTINGS)})
        twin = FocusControl(self.settings)
        twin.lens.table[:] = self.table
        await self.reset_to(twin, **{k: v for k, v in inputs.items() if k not in vars(SETTINGS)})
        self.check()

    def check(self) -> None:
        """Compare all outputs, and look at the device."""
        twin = self.twin
        got, want = self.outputs.read(), STATUS_OF(twin)
        assert got == want, f"clock {self.clock}: {[*STATUS]} {got}, want {want}, {self.inputs}"
        self.pulls = self.device.read()
        if twin.m3.valid:
            self.ends.append(twin.m3.status)
        elif twin.master.valid and not twin.m3.busy:
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
                table_write=bool(now["table_write"]),
                table_index=now["table_index"],
                table_position=now["table_position"],
            )
            self.clock += 1
            self.check()
            for name in self.strobes:
                if now[name]:
                    self.give(**{name: 0})

    async def until(self, *states: State, clocks: int = 60_000) -> None:
        """Go on until the loop is in one of the states."""
        for _ in range(clocks):
            if self.motor.state in states:
                return
            await self.clocks()
        raise AssertionError(f"{self.motor.state.name} after {clocks} clocks, {self.ends[-9:]}")

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
        assert self.motor.in_position
        assert abs(int(self.dut.position_o.value) - target) <= self.settings.tolerance


@cocotb.test()
async def a_point_becomes_a_target(dut) -> None:
    """After its latency; points that come sooner count nowhere, others not for the hysteresis."""
    bench = await Bench.started(dut, 4)
    identity = {"z_begin": 0, "z_shift": 0, "average_shift": 0}
    await bench.start(**identity, mode=Mode.AUTOMATIC)
    await bench.write_table([k << FRACTION_WIDTH for k in range(TABLE_SIZE)])  # position is z
    await bench.clocks(valid=1, z=5000)
    for age in range(1, TARGET_LATENCY + 1):
        assert bench.twin.filter.distance == (5000 if age >= DISTANCE_LATENCY else 0)
        assert bench.target == (5000 if age >= TARGET_LATENCY else 0)
        await bench.clocks(valid=age < TARGET_LATENCY, z=30_000)
    # Far points are counted on, whatever comes between that is not good, until a lapse.
    for others in (6, 7):
        for k in range(3):
            assert bench.target == 5000
            await bench.point(z=5011)
            for _ in range(others if k == 1 else 0):
                await bench.point(z=20_000, measured=0, period=1)
                await bench.point(z=20_000, test=1, period=1)
        assert bench.target == (5011 if others == 6 else 5000)
        for _ in range(3):
            await bench.point(z=5000)


@cocotb.test()
async def the_lens_follows_the_scene(dut) -> None:
    """Noisy points of three distances: sharp at each, and a write of the motor for each."""
    bench = await Bench.started(
        dut, 5, mode=Mode.AUTOMATIC, average_shift=4, hysteresis=14, hold_points=60
    )
    await bench.clocks(2000)
    assert bench.motor.state is State.WAIT
    assert not bench.ends, "nothing on the bus before there is a target"
    targets = []
    for mm in (600.0, 400.0, 402.0, 900.0):
        for _ in range(150):
            good = bench.draw.random() < 0.9
            await bench.point(mm + float(bench.draw.normal(0.0, 1.0)), measured=int(good))
            if not targets or targets[-1] != bench.target:
                targets.append(bench.target)
        await bench.until(State.HOLD)
        await bench.clocks(2)
        assert bench.motor.in_position
        moved = int(dut.position_o.value)
        assert abs(moved - bench.target) <= 1
        # Of the lens: hysteresis, the table's chords (h**2 f**2 / 4 (z - f)**3), noise.
        off = moved - lens(mm)
        print(f"{mm} mm: the lens is at {moved}, {off:.1f} steps off")
        assert abs(off) <= 14 + 12
    print(f"targets {targets}")
    assert 4 <= len(targets) <= 8, "first the old average's way, but no hunting"
    assert bench.motor.timeout_count == 0
    assert set(bench.ends) == {Status.OK}


@cocotb.test()
async def commands_in_their_time(dut) -> None:
    """On the bus: how long they take, and the pauses between them."""
    for poll in (0, 150):
        bench = await Bench.started(dut, 6, poll_clks=poll)
        bench.configure(mode=Mode.MANUAL, manual=40)
        await bench.clocks()
        assert bench.target == 40
        at: list[int] = []
        reply = None
        for _ in range(2500):
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
        assert bench.motor.in_position
        assert bench.motor.position == 40
        assert int(dut.position_o.value) == 40


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
    bench = await Bench.started(dut, 9)
    for name, m3 in [*product(TROUBLE, [0]), ("nack_data", 1), ("stretch", 1), ("data", 1)]:
        status, count, broken, well = TROUBLE[name]
        retries = 1
        await bench.start(retries=retries, protocol=m3, m3=m3)
        await bench.reach(20)
        bench.ends.clear()
        # In a pause, where none of the lines is in use.
        await bench.commands()
        bench.give(**broken)
        await bench.until(State.FAULT)
        assert bench.ends[1:] == [status] * (retries + 1), (name, bench.ends)
        assert bench.motor.fault == status
        assert getattr(bench.motor, count) == retries + 1
        assert sum(getattr(bench.motor, c) for c in COUNTERS) == retries + 1
        assert bench.twin.master.recovery_count == (retries + 1 if name == "data" else 0)
        # It stays, well or not, whatever the target.
        bench.give(**well)
        bench.configure(manual=30)
        await bench.clocks(1000)
        assert bench.motor.state is State.FAULT
        bench.configure(mode=Mode.OFF)
        await bench.clocks(2)
        await bench.reach(30)
        # As often as is allowed: no FAULT, and the write is not forgotten.
        have = len(bench.ends)
        await bench.commands()
        bench.configure(manual=40)
        bench.give(**broken)
        await bench.commands()
        bench.give(**well)
        await bench.clocks(3)
        await bench.until(State.HOLD)
        assert int(dut.position_o.value) in (39, 40, 41)
        assert bench.ends[have:].count(status) == 1


M3 = {"protocol": 1, "m3": 1}


@cocotb.test()
async def an_m3_in_its_time(dut) -> None:
    """It goes where it is sent, with and without stretching; how often it is asked."""
    bench = await Bench.started(dut, 14)
    for stretch in (0, 20):
        await bench.start(**M3)
        await bench.reach(1200, stretch_clks=stretch)
        assert bench.motor.position in range(1199, 1202)
        assert bench.twin.m3.motor_status >> 18 & 3 in (1, 2)
        begun = []
        while len(begun) < 3:
            await bench.clocks()
            if bench.motor.command_valid:
                begun.append(bench.clock)
        want = 1 + m3_clocks(read=True, quarter=4) + SETTINGS.poll_clks + PAUSE_EXTRA
        if stretch:
            assert begun[2] - begun[1] > want + 36 * stretch / 2
        else:
            assert {begun[1] - begun[0], begun[2] - begun[1]} == {want}
        assert set(bench.ends) == {Status.OK}
    # A board that is set otherwise than its motor: no position, and no end without a fault.
    for protocol in (0, 1):
        await bench.start(protocol=protocol, m3=1 - protocol, retries=1, timeout_clks=2000)
        bench.configure(mode=Mode.MANUAL, manual=500)
        await bench.until(State.FAULT)
        assert bench.motor.fault in (BAD_REPLY, NOT_REACHED)
        assert int(dut.position_o.value) == 0


@cocotb.test()
async def an_m3_in_trouble(dut) -> None:
    """Replies that are none, faults that it tells of, a limit, positions without 16 bits."""
    bench = await Bench.started(dut, 15)
    end = ord("\r")
    for fault, trouble in (
        (BAD_REPLY, {"spoil": 2, "spoilt": ord("9")}),  # of another command
        (BAD_REPLY, {"spoil": 12, "spoilt": end}),  # cut
        (BAD_REPLY, {"spoil": 29, "spoilt": ord(">")}),  # without an end
        (MOTOR_ERROR, {"status": 1 << 3}),
        (MOTOR_ERROR, {"status": 1 << 16}),
    ):
        await bench.start(**M3, retries=1)
        await bench.reach(60)
        await bench.commands()
        bench.give(**trouble)
        await bench.until(State.FAULT)
        assert (bench.motor.fault, bench.motor.reply_count) == (fault, 2), trouble
        bench.give(spoil=31, status=0)
        bench.configure(mode=Mode.OFF)
        await bench.clocks(2)
        await bench.reach(90)
    # It stalls, or has nowhere to go.
    await bench.start(**M3, retries=1)
    await bench.clocks(push=TRAVEL)
    bench.configure(mode=Mode.MANUAL, manual=TRAVEL + 5)
    await bench.until(State.FAULT)
    assert (bench.motor.fault, bench.motor.position) == (LIMIT, TRAVEL)
    await bench.start(**M3, retries=1)
    bench.configure(mode=Mode.MANUAL, manual=300)
    await bench.clocks(stall=1, status=1 << 23)
    await bench.until(State.FAULT)
    assert (bench.motor.fault, bench.motor.timeout_count) == (MOTOR_ERROR, 0)
    # Shown beside where it is: the nearest position of 16 bits, and the flag.
    await bench.start(**M3, retries=255)
    await bench.reach(40)
    for offset, shown in ((-50, 0), (70_000, 0xFFFF), (-(1 << 31), 0), (10, 50)):
        await bench.commands(2)
        bench.give(offset=offset)
        await bench.commands(3)
        assert bench.motor.position in range(shown - 1, shown + 2)
        assert bench.twin.m3.motor_status >> BEYOND == (shown != 50)
        assert not bench.motor.in_position
    # It loses power in the middle of a command: at most that one fails.
    await bench.start(**M3, retries=1)
    await bench.reach(40)
    for age in range(100, 5500, rounds(1300, 97)):
        await bench.commands()
        await bench.clocks(age)
        await bench.clocks(device_rst=1)
        bench.give(device_rst=0)
        await bench.commands(2)
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - bench.target) <= 1


@cocotb.test()
async def a_bus_that_recovers(dut) -> None:
    """A device stuck within a byte is clocked free by the next command, another master is heard."""
    bench = await Bench.started(dut, 10)
    await bench.reach(50)
    # The control is reset while the device sends: it may hold SDA for ever.
    recovered = 0
    for age in range(520, 1000, rounds(116, 7)):
        await bench.commands()
        await bench.clocks(150)
        await bench.clocks(age)
        table = bench.table
        await bench.restart()
        assert bench.table is table
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - bench.target) <= 1
        recovered += bench.twin.master.recovery_count
    print(f"{recovered} recoveries")
    assert recovered > rounds(1, 12)
    # SDA is low for the first few clocks of the recovery only: the command goes through.
    for clocks in (1, 8):
        await bench.start()
        await bench.reach(50)
        await bench.commands()
        await bench.clocks(hold_sda=1)
        while not bench.twin.master.recovery_count:
            await bench.clocks()
        await bench.clocks(clocks * 22)
        bench.give(hold_sda=0)
        await bench.commands()
        assert bench.ends[-1] is Status.OK
        assert (bench.twin.master.recovery_count, bench.motor.stuck_count) == (1, 0)
    # Another master takes the bus in the middle of a byte.
    await bench.start(retries=8)
    await bench.reach(50)
    for age in range(200, 900, rounds(140, 5)):
        await bench.commands()
        await bench.clocks(age)
        await bench.clocks(45, other_sda_low=1)
        bench.give(other_sda_low=0)
        await bench.commands(2)
        await bench.until(State.HOLD)
    lost = bench.ends.count(Status.ARBITRATION)
    assert lost > rounds(1, 32)
    assert bench.motor.arbitration_count == lost


@cocotb.test()
async def a_motor_in_trouble(dut) -> None:
    """It has nowhere to go, is knocked, loses power."""
    bench = await Bench.started(dut, 11, timeout_clks=2000, retries=1)
    await bench.clocks(push=TRAVEL)
    bench.configure(mode=Mode.MANUAL, manual=TRAVEL + 5)
    await bench.until(State.FAULT)
    assert (bench.motor.fault, bench.motor.position) == (NOT_REACHED, TRAVEL)
    await bench.start(tolerance=4)
    await bench.reach(600)
    for knock in (800, -550):
        await bench.commands()
        await bench.clocks(push=knock)
        await bench.until(State.MOVE)
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - 600) <= 4
    await bench.commands()
    await bench.clocks(40)
    await bench.clocks(device_rst=1)
    bench.give(device_rst=0)
    await bench.until(State.MOVE)
    await bench.until(State.HOLD)
    assert abs(int(dut.position_o.value) - 600) <= 4


@cocotb.test()
async def reset_mid_stream(dut) -> None:
    """At every age of a point, and in every state: nothing is left but the table."""
    bench = await Bench.started(dut, 12)
    for age in range(1, TARGET_LATENCY + 2, rounds(5, 1)):
        await bench.start(mode=Mode.AUTOMATIC, average_shift=0)
        await bench.point(300.0)
        await bench.point(400.0, period=age)
        await bench.restart(valid=age % 2, **POINT)
        bench.give(valid=0)
        assert (bench.twin.filter.distance, bench.target) == (0, 0)
        await bench.clocks(TARGET_LATENCY + 5)
        assert bench.twin.filter.distance == 0
        assert bench.motor.state is State.WAIT
        await bench.point(700.0)
        assert bench.twin.filter.distance == 700 * MM
        assert bench.target == position(700 * MM, Z_BEGIN, Z_SHIFT, TABLE)
    for age in range(7, 1000, rounds(241, 83)):
        await bench.start(average_shift=0)
        await bench.reach(30)
        await bench.commands()
        await bench.clocks(age)
        await bench.restart()
        assert not any(STATUS_OF(bench.twin))
        await bench.until(State.HOLD)
        assert abs(int(dut.position_o.value) - 30) <= 1
    await bench.start(retries=0, nack_address=1)
    bench.configure(mode=Mode.MANUAL)
    await bench.until(State.FAULT)
    await bench.restart(nack_address=0)
    await bench.until(State.HOLD)
    assert bench.motor.nack_count == 0


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Random points, modes, targets, faults of bus and motor, and resets: as the twin."""
    bench = await Bench.started(dut, 13)
    draw = bench.draw
    states: set[State] = set()
    for k in range(rounds(20, 300)):
        if k % 5 == 0:
            m3 = int(k % 10 == 5)
            await bench.start(
                protocol=m3,
                m3=m3,
                quarter_clks=int(draw.integers(4, 6)),
                stretch_clks=int(draw.choice([7, 60, 300, 300])),
                poll_clks=int(draw.choice([0, 40, 150])),
                retries=int(draw.integers(4)),
                timeout_clks=int(draw.choice([0, 3000, 8000])),
                average_shift=int(draw.integers(4)),
                hysteresis=int(draw.integers(30)),
                hold_points=int(draw.integers(4)),
                lapse=int(draw.integers(5)),
                tolerance=int(draw.integers(4)),
            )
            await bench.write_table([200 - 3 * entry for entry in range(TABLE_SIZE)])
        if bench.motor.state is State.FAULT:
            bench.configure(mode=Mode.OFF)
            await bench.clocks(2)
        bench.configure(mode=int(draw.choice([0, 1, 2, 2, 3])), manual=int(draw.integers(200)))
        rate = float(draw.choice([0.0, 0.0, 0.0, 0.0003, 0.003]))
        bench.give(
            nack_address=int(draw.random() < 0.05),
            nack_byte=int(draw.choice([NONE] * 8 + [0, 1])),
            stretch_clks=int(draw.choice([0] * 8 + [10, 70])),
            stall=int(draw.random() < 0.15),
            spoil=int(draw.choice([31, 31, 31, int(draw.integers(30))])),
            spoilt=int(draw.integers(256)),
        )
        left = dict.fromkeys(("hold_scl", "hold_sda", "other_scl_low", "other_sda_low"), 0)
        mm = float(draw.uniform(300, 1000))
        for _ in range(2000):
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
            states.add(bench.motor.state)
        if draw.random() < 0.1:
            await bench.restart(valid=int(draw.integers(2)))
    assert states == set(State), states
    print(f"disorder: {bench.ends.count(Status.OK)} OK of {len(bench.ends)}")


@EACH_VOLUME
def test_focus_control_rtl_equals_model(volume: str) -> None:
    simulate("focus_bus", __file__, volume=volume)
