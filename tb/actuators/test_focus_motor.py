"""focus_motor: every clock of the RTL against the model, with a motor that answers soon."""

from itertools import pairwise
from operator import attrgetter

import cocotb
from focus_bench import SETTINGS, FocusBench
from harness import EACH_VOLUME, Ports, parameters, rounds, simulate

from vrscan.clocked.focus_motor import (
    NOT_REACHED,
    PAUSE_EXTRA,
    POSITION_REGISTER,
    REPLY_LATENCY,
    TARGET_REGISTER,
    FocusMotor,
    State,
)
from vrscan.clocked.i2c_master import Status
from vrscan.clocked.m3_motor import BAD_REPLY, LIMIT, MOTOR_ERROR
from vrscan.registers.focus_registers import Mode

QUIET = {"target": 0, "known": 0, "reply_valid": 0, "reply_status": 0, "reply_data": 0}
COUNTERS = (
    "nack_count", "stretch_count", "stuck_count", "arbitration_count", "timeout_count",
    "reply_count",
)  # fmt: skip
WITH_POSITION = (Status.OK, MOTOR_ERROR, LIMIT)
OUTPUTS = (
    "command_valid", "command_data", "state", "fault", "position", "in_position", *COUNTERS,
    "command_read", "command_register",
)  # fmt: skip
OUTPUTS_OF = attrgetter(*OUTPUTS)
COMMAND_CLKS = 12  # from a command to its reply
STEP_CLKS = 2  # of the motor
TRAVEL = 6000
QUICK = vars(SETTINGS) | {"mode": Mode.MANUAL, "poll_clks": 10, "timeout_clks": 4000}
PERIOD = COMMAND_CLKS + QUICK["poll_clks"] + PAUSE_EXTRA  # of the commands


class Bench(FocusBench):
    """Sequencer and twin, compared every clock, and a motor that does what it is told.

    Attributes:
        at: Place of the motor.
        ends: The statuses of all commands.
        status: Status with which commands end.
        stall, noise: Whether the motor stands, and what its sensor shows beside its place.
    """

    strobes = ("reply_valid",)

    def __init__(self, dut, salt: int) -> None:
        super().__init__(dut, QUIET, salt)
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS])

    async def start(self, **settings: int) -> None:
        """Reset both; the motor stands at 0."""
        self.configure(**QUICK | settings)
        self.at = self.goal = 0
        self.status, self.stall, self.noise = Status.OK, False, 0
        self.ends: list[int] = []
        self.due = -1
        await self.restart(target=0, known=0)

    async def restart(self, **inputs: int) -> None:
        """Reset for a clock; a command that runs is forgotten."""
        self.due = -1
        self.begun = False
        twin = FocusMotor(self.settings, parameters()["CountWidth"])
        await self.reset_to(twin, **(QUIET | self.held() | inputs))
        self.give(reply_valid=0)
        self.check()

    def held(self) -> dict[str, int]:
        """Return the target as it is, for a reset."""
        return {name: self.inputs[name] or 0 for name in ("target", "known")}

    def check(self) -> None:
        got, want = self.outputs.read(), OUTPUTS_OF(self.twin)
        self.begun = self.begun or self.twin.command_valid
        if not self.begun:  # what the command is is not yet defined
            got, want = got[:-2], want[:-2]
        assert got == want, f"clock {self.clock}: {OUTPUTS} {got}, want {want}, {self.inputs}"

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks, with the motor and its replies."""
        self.give(**inputs)
        for _ in range(count):
            twin = self.twin
            if self.due == 0:
                self.ends.append(self.status)
                read = twin.command_read and self.status in WITH_POSITION
                shown = min(max(self.at + self.noise, 0), TRAVEL) if read else 0
                self.give(reply_valid=1, reply_status=int(self.status), reply_data=shown)
                if not twin.command_read and self.status == Status.OK:
                    self.goal = twin.command_data
            self.due -= 1
            await super().clocks()
            if self.twin.command_valid:
                self.due = COMMAND_CLKS - 1
            if self.clock % STEP_CLKS == 0 and not self.stall and self.at != self.goal:
                self.at = min(self.at + (1 if self.goal > self.at else -1), TRAVEL)

    async def until(self, *states: State, clocks: int = 20_000) -> None:
        """Go on until the loop is in one of the states."""
        for _ in range(clocks):
            if self.twin.state in states:
                return
            await self.clocks()
        raise AssertionError(f"{self.twin.state.name} after {clocks} clocks, {self.ends[-9:]}")

    async def commands(self, count: int = 1) -> None:
        """Go on until some more commands have ended, and what follows has followed."""
        have = len(self.ends)
        while len(self.ends) < have + count:
            await self.clocks()
        await self.clocks(REPLY_LATENCY)

    async def reach(self, target: int) -> None:
        """Go to a target."""
        self.give(target=target, known=1)
        self.configure(mode=Mode.MANUAL)
        await self.clocks(3)
        await self.until(State.HOLD)
        await self.clocks()
        assert self.twin.in_position
        assert abs(self.at - target) <= self.settings.tolerance


def top() -> int:
    """Return the largest value of a counter."""
    return (1 << parameters()["CountWidth"]) - 1


@cocotb.test()
async def commands_in_their_time(dut) -> None:
    """What the motor is told, where it is read, and the pauses between the commands."""
    for poll in (0, 1, 150):
        bench = await Bench.started(dut, 6, poll_clks=poll)
        bench.give(target=40, known=1)
        begun: list[int] = []
        kinds = []
        for _ in range(2000):
            await bench.clocks()
            if bench.twin.command_valid:
                begun.append(bench.clock)
                kinds.append((bench.twin.command_read, bench.twin.command_register))
        periods = {b - a for a, b in pairwise(begun)}
        assert periods == {COMMAND_CLKS + poll + PAUSE_EXTRA - 1}
        assert kinds[0] == (False, TARGET_REGISTER)
        assert set(kinds[1:]) == {(True, POSITION_REGISTER)}
        assert (bench.twin.in_position, bench.twin.position, bench.at) == (True, 40, 40)
    # Position and in_position of a motor that is moved by hand.
    bench.stall = True
    for at, near in ((41, True), (42, False)):
        bench.at = at
        await bench.commands(2)
        assert (bench.twin.position, bench.twin.in_position) == (at, near)
    assert bench.twin.state is State.MOVE
    bench.stall = False
    await bench.until(State.HOLD)
    assert bench.twin.position in (40, 41)


@cocotb.test()
async def a_new_target_on_the_way(dut) -> None:
    """The position of a target that is gone is no matter; in_position falls a clock after it."""
    bench = await Bench.started(dut, 7)
    await bench.reach(300)
    assert bench.twin.in_position
    await bench.clocks(target=1500)
    assert not bench.twin.in_position
    await bench.until(State.MOVE)
    await bench.commands(3)
    bench.give(target=310)
    await bench.until(State.HOLD)
    await bench.clocks(2)
    assert bench.twin.in_position
    assert bench.at in (309, 310, 311)
    # There and back between two commands: never mind.
    await bench.commands()
    await bench.clocks(3, target=900)
    bench.give(target=310)
    await bench.commands(3)
    assert bench.twin.in_position
    # At every place of a command.
    for age in range(PERIOD + 1):
        await bench.commands()
        await bench.clocks(age, target=310 + age % 5)
        bench.give(target=310 - age % 7)
        await bench.commands(3)
        await bench.until(State.HOLD)
        assert abs(bench.at - bench.inputs["target"]) <= 1


@cocotb.test()
async def the_position_is_read_while_the_target_moves_on(dut) -> None:
    """A target that is another one before every command: reads and writes by turns."""
    bench = await Bench.started(dut, 12)
    await bench.reach(50)
    kinds, seen = [], set()
    for k in range(40):
        have = len(bench.ends)
        while len(bench.ends) == have:
            await bench.clocks(target=51 + 3 * k)
            if bench.twin.command_valid:
                kinds.append(bench.twin.command_read)
        await bench.clocks(REPLY_LATENCY)
        seen.add(bench.twin.position)
    assert len(kinds) >= 40 and all(a != b for a, b in pairwise(kinds))
    assert len(seen) >= 15 and bench.twin.position > 50
    await bench.until(State.HOLD)
    while not bench.twin.in_position:
        await bench.clocks()
    assert abs(bench.at - bench.inputs["target"]) <= 1


@cocotb.test()
async def off_at_every_place(dut) -> None:
    """Off for a clock or more anywhere in a command: the old reply is nobody's, then it works."""
    bench = await Bench.started(dut, 8)
    await bench.reach(100)
    for age in range(2 * PERIOD):
        await bench.commands()
        await bench.clocks(age % PERIOD)
        before = bench.twin.position
        bench.configure(mode=int(bench.draw.choice([Mode.OFF, 3])))
        await bench.clocks()
        assert bench.twin.state is State.OFF
        await bench.clocks(age % 4)
        have = len(bench.ends)
        if age % 2:
            await bench.clocks(PERIOD)
            assert len(bench.ends) <= have + 1, "one that ran, and no more"
            assert bench.twin.state is State.OFF
        bench.configure(mode=Mode.MANUAL)
        bench.give(target=100 + age % 50)
        assert bench.twin.position == before
        await bench.clocks(3)
        assert bench.twin.state is State.MOVE
        assert not bench.twin.in_position
        await bench.until(State.HOLD)
        assert abs(bench.at - bench.inputs["target"]) <= 1
    # Without a target there is nothing to do, whatever was before.
    bench.configure(mode=Mode.AUTOMATIC)
    await bench.clocks(2, known=0)
    assert bench.twin.state is State.WAIT
    await bench.clocks(3 * PERIOD)
    have = len(bench.ends)
    await bench.clocks(3 * PERIOD)
    assert (bench.twin.state, len(bench.ends)) == (State.WAIT, have)


@cocotb.test()
async def commands_that_fail(dut) -> None:
    """Each kind is counted and tried again, ends in FAULT, and is over when the mode was off."""
    bench = await Bench.started(dut, 9)
    for status, count in (
        (Status.NACK_ADDRESS, "nack_count"),
        (Status.NACK_DATA, "nack_count"),
        (Status.STRETCH_TIMEOUT, "stretch_count"),
        (Status.BUS_STUCK, "stuck_count"),
        (Status.ARBITRATION, "arbitration_count"),
        (BAD_REPLY, "reply_count"),
        (MOTOR_ERROR, "reply_count"),
        (LIMIT, "reply_count"),
    ):
        for retries in (0, 2):
            await bench.start(retries=retries)
            await bench.reach(50)
            await bench.commands()
            bench.ends.clear()
            bench.status = status
            await bench.until(State.FAULT)
            assert bench.ends == [status] * (retries + 1), (status, bench.ends)
            assert bench.twin.fault == status
            assert getattr(bench.twin, count) == min(retries + 1, top())
            assert sum(getattr(bench.twin, c) for c in COUNTERS) == min(retries + 1, top())
            # It stays, well or not, whatever the target.
            bench.status = Status.OK
            await bench.clocks(10 * PERIOD, target=60)
            assert bench.twin.state is State.FAULT
            assert not bench.twin.in_position
            bench.configure(mode=Mode.OFF)
            await bench.clocks(2)
            assert (bench.twin.state, bench.twin.fault) == (State.OFF, status)
            await bench.reach(60)
            assert bench.twin.fault == 0
            assert getattr(bench.twin, count) == min(retries + 1, top()), "kept"
        # As often as is allowed, over and over: no FAULT, and the write is not forgotten.
        await bench.start(retries=2)
        await bench.reach(50)
        for k in range(3):
            await bench.commands()
            bench.give(target=60 + 10 * k)
            bench.status = status
            await bench.commands(2)
            bench.status = Status.OK
            await bench.until(State.HOLD)
            await bench.commands()
            assert bench.at in range(59 + 10 * k, 62 + 10 * k)
            assert bench.ends.count(status) == 2 * (k + 1)
        assert getattr(bench.twin, count) == min(6, top())
    # A motor that tells of a fault tells where it is, too.
    for status in (MOTOR_ERROR, LIMIT, BAD_REPLY):
        await bench.start()
        await bench.reach(50)
        bench.at = bench.goal = 70
        bench.status = status
        await bench.commands(2)
        assert bench.twin.position == (50 if status == BAD_REPLY else 70)


@cocotb.test()
async def a_motor_in_trouble(dut) -> None:
    """It stands, is slow, has nowhere to go, shows noise, is knocked."""
    bench = await Bench.started(dut, 11, timeout_clks=600)
    twin = bench.twin
    await bench.reach(50)
    # It stands: written again, so many times, then FAULT; and all of it anew after OFF.
    bench.stall = True
    bench.give(target=80)
    for _ in range(2):
        bench.configure(mode=Mode.MANUAL)
        await bench.clocks(3)
        bench.ends.clear()
        await bench.until(State.FAULT)
        assert (twin.fault, twin.timeout_count) == (NOT_REACHED, 3)
        assert (twin.position, set(bench.ends)) == (50, {Status.OK})
        bench.configure(mode=Mode.OFF)
        await bench.clocks(2)
    # It goes on after two of them, again and again: that is in time.
    bench.configure(mode=Mode.MANUAL)
    for k in range(2):
        bench.stall = True
        bench.give(target=100 + 20 * k)
        while twin._misses < 2:
            await bench.clocks()
        assert twin.timeout_count == min(3 + 2 * (k + 1), top())
        bench.stall = False
        await bench.until(State.HOLD)
        assert abs(bench.at - 100 - 20 * k) <= 1
    # A new target begins to count anew.
    bench.stall = True
    for k in range(4):
        await bench.clocks(900, target=500 + k)
        assert twin.state is State.MOVE
    bench.stall = False
    await bench.until(State.HOLD)
    # Slower than the time-out, but it gets there; a time-out of 0 writes after every read.
    for timeout, retries in ((600, 9), (0, 255)):
        await bench.start(timeout_clks=timeout, retries=retries)
        await bench.reach(1500)
        assert bench.twin.timeout_count > 2
    # Beyond its travel.
    await bench.start(timeout_clks=600)
    bench.at = TRAVEL
    bench.give(target=TRAVEL + 5, known=1)
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
            bench.noise = int(bench.draw.integers(-size, size + 1))
            states[twin.state] += 1
        assert (states[State.MOVE] > 0) == (size > 4), states
    bench.noise = 0
    await bench.until(State.HOLD)
    assert twin.fault == twin.timeout_count == 0
    for knock in (300, -150):
        await bench.commands()
        bench.at += knock
        await bench.until(State.MOVE)
        await bench.until(State.HOLD)
        assert abs(bench.at - 200) <= 4


@cocotb.test()
async def reset_at_every_place(dut) -> None:
    """In every state, at every age of a command: nothing is left."""
    bench = await Bench.started(dut, 12)
    for age in range(PERIOD):
        await bench.start()
        await bench.reach(9)
        await bench.commands()
        await bench.clocks(age)
        await bench.restart(reply_valid=1)
        twin = bench.twin
        assert not any(getattr(twin, name) for name in ("state", "fault", "position", *COUNTERS))
        await bench.until(State.HOLD)
        assert abs(bench.at - 9) <= 1
    await bench.start(retries=0)
    bench.status = Status.NACK_ADDRESS
    bench.give(known=1)
    await bench.until(State.FAULT)
    bench.status = Status.OK
    await bench.restart()
    await bench.until(State.HOLD)
    assert bench.twin.nack_count == 0


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Random modes, targets, failures, settings and resets: as the twin."""
    bench = await Bench.started(dut, 13)
    draw = bench.draw
    states: set[State] = set()
    for k in range(rounds(120, 2000)):
        if k % 20 == 0:
            await bench.start(
                poll_clks=int(draw.choice([0, 4, 15])),
                retries=int(draw.integers(4)),
                timeout_clks=int(draw.choice([0, 200, 500])),
                tolerance=int(draw.integers(4)),
            )
        bench.configure(mode=int(draw.choice([0, 1, 2, 2, 3])))
        bench.give(known=int(draw.random() < 0.8), target=int(draw.integers(50)))
        bench.status = int(draw.choice([0] * 10 + [1, 2, 3, 4, 5, 7, 8, 9]))
        bench.stall = draw.random() < 0.15
        for _ in range(int(draw.integers(1, 160))):
            bench.noise = int(draw.integers(-1, 2))
            await bench.clocks()
            states.add(bench.twin.state)
        if draw.random() < 0.1:
            await bench.restart(reply_valid=int(draw.integers(2)))
    assert states == set(State), states
    print(f"disorder: {bench.ends.count(Status.OK)} OK of {len(bench.ends)}")


@EACH_VOLUME
def test_focus_motor_rtl_equals_model(volume: str) -> None:
    simulate("focus_motor", __file__, {"CountWidth": 2}, volume=volume)
