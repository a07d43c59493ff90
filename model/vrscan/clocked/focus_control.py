"""Control of the lens by the scene's distance, the twin of ``rtl/actuators/focus_control.sv``.

VR-SCAN IV-E: a piezo motor and a magnetic position sensor, here on one I2C bus.
"""

from dataclasses import dataclass, fields
from enum import IntEnum

from vrscan.clocked.i2c_master import I2cMaster, Status
from vrscan.data import pkg
from vrscan.registers.focus_registers import FRACTION_WIDTH, TABLE_SIZE, Mode

DISTANCE_LATENCY = 8  # clocks from valid to the distance
TARGET_LATENCY = 26  # clocks from valid to the target; points that come sooner are ignored
REPLY_LATENCY = 5  # clocks from the master's reply to its effect
PAUSE_EXTRA = 6  # clocks from a reply to the next command besides focus_poll_clks

FINE_WIDTH = 16  # bits of the average below those of z
POSITION_WIDTH = 16
NOT_REACHED = 6  # value of fault, besides the statuses of the bus
TARGET_REGISTER = 0  # register of the device
POSITION_REGISTER = 2

BAD_FLAGS = sum(
    1 << bit
    for bit in (
        pkg.FLAG_NO_RANGE,
        pkg.FLAG_OUT_OF_RANGE,
        pkg.FLAG_NOT_RUNNING,
        pkg.FLAG_INDEX_FAULT,
        pkg.FLAG_UNSETTLED,
    )
)

_AVERAGE = 6  # age of a point in clocks
_DISTANCE = DISTANCE_LATENCY - 1
_COMPARE = 22
_DECIDE = TARGET_LATENCY - 1
_MOST_OTHERS = (1 << 16) - 1
_RESULTS = {
    Status.NACK_ADDRESS: "nack_count",
    Status.NACK_DATA: "nack_count",
    Status.STRETCH_TIMEOUT: "stretch_count",
    Status.BUS_STUCK: "stuck_count",
    Status.ARBITRATION: "arbitration_count",
}


class State(IntEnum):
    """State of the motor's loop."""

    OFF = 0
    WAIT = 1
    MOVE = 2
    HOLD = 3
    FAULT = 4


@dataclass
class Settings:
    """The configuration; positions are in steps of the sensor.

    Attributes:
        mode: Source of the target, ``Mode``; u2, 3 acts as OFF.
        manual: Target in MANUAL; u16.
        average_shift: Log2 of the number of good points that are averaged; u4.
        lapse: A longer row of points that are not good ends the average; u16.
        z_begin: Distance of the table's first entry; s24, 12 fraction bits, mm.
        z_shift: The entries are 2**(z_shift + 10) steps of a distance apart; u4.
        hysteresis: A new target differs by more than this from the old one; u16.
        hold: Number of good points in a row for which it has to differ; u16, 0 counts as 1.
        address: I2C address of the motor; u7.
        quarter_clks, stretch_clks: Quarter of a bit and longest stretch of the bus; u16 and u24,
            clocks.
        poll_clks: Pause between a reply and the next command; u24, clocks.
        tolerance: Largest distance from the target that is in position; u16.
        timeout_clks: Longest time to reach a target; u32, clocks.
        retries: Number of retries of a command and of a target; u8.

    Raises:
        ValueError: if a value does not fit.
    """

    mode: int
    manual: int
    average_shift: int
    lapse: int
    z_begin: int
    z_shift: int
    hysteresis: int
    hold: int
    address: int
    quarter_clks: int
    stretch_clks: int
    poll_clks: int
    tolerance: int
    timeout_clks: int
    retries: int

    def __post_init__(self) -> None:
        """Check the widths."""
        for field in fields(self):
            width = WIDTHS[field.name]
            low = -1 << (width - 1) if field.name == "z_begin" else 0
            if not low <= getattr(self, field.name) < low + (1 << width):
                raise ValueError(f"focus_control: {field.name} does not fit in {width} bits")


WIDTHS = {
    "mode": 2,
    "manual": POSITION_WIDTH,
    "average_shift": 4,
    "lapse": 16,
    "z_begin": pkg.LENGTH_WIDTH,
    "z_shift": 4,
    "hysteresis": POSITION_WIDTH,
    "hold": 16,
    "address": 7,
    "quarter_clks": 16,
    "stretch_clks": 24,
    "poll_clks": 24,
    "tolerance": POSITION_WIDTH,
    "timeout_clks": 32,
    "retries": 8,
}  # bits; z_begin is signed


def is_good(*, measured: bool, flags: int) -> bool:
    """Return whether a point counts for the distance, if it does not belong to a test line."""
    return measured and not flags & BAD_FLAGS


def position(distance: int, z_begin: int, z_shift: int, table: list[int]) -> int:
    """Return the lens's position for a distance.

    Args:
        distance: Distance, s24, 12 fraction bits, mm, like ``z_begin``.
        z_begin: Distance of the table's first entry.
        z_shift: The entries are 2**(z_shift + FRACTION_WIDTH) steps of a distance apart.
        table: ``TABLE_SIZE`` positions.

    Returns:
        The position, linear between the entries, to nearest, half up; beyond the table its end.
    """
    entries = max(distance - z_begin, 0) >> z_shift
    index, fraction = entries >> FRACTION_WIDTH, entries & (1 << FRACTION_WIDTH) - 1
    if index >= TABLE_SIZE - 1:
        return table[-1]
    moved = (table[index + 1] - table[index]) * fraction
    return table[index] + ((moved >> FRACTION_WIDTH - 1) + 1 >> 1)


class FocusControl:
    """Clock-accurate control with its bus master. A new one is in the state after a reset.

    Args:
        settings: The configuration ports; they may be changed between two steps.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        table: ``TABLE_SIZE`` positions.
        state: State of the motor's loop.
        fault: Reason of the state FAULT: a status of the bus, or ``NOT_REACHED``.
        distance: Averaged distance; s24, 12 fraction bits, mm.
        target, position: Target and last position of the lens; u16.
        in_position: Whether the last position is near the present target.
        nack_count, stretch_count, stuck_count, arbitration_count: Numbers of commands that failed
            in this way.
        timeout_count: Number of targets that were not reached in time.
        master: Master of the bus, which has ``scl_low``, ``sda_low`` and ``recovery_count``.
    """

    def __init__(self, settings: Settings, count_width: int = 16) -> None:
        self.settings = settings
        self.table = [0] * TABLE_SIZE
        self.state = State.OFF
        self.fault = 0
        self.distance = 0
        self.target = 0
        self.position = 0
        self.in_position = False
        self.nack_count = 0
        self.stretch_count = 0
        self.stuck_count = 0
        self.arbitration_count = 0
        self.timeout_count = 0
        self.master = I2cMaster(count_width)
        self._count_max = (1 << count_width) - 1

        self._age = 0  # clocks since a good point, 0 when idle
        self._others = 0  # points in a row that were not good
        self._z = 0
        self._points = 0  # good points of the average so far, up to the whole average
        self._level = 0  # log2 of this number
        self._enough = False
        self._average = 0  # with FINE_WIDTH more bits than z
        self._off = 0  # distance of the candidate from the target
        self._candidate = 0
        self._far_count = 0

        self._manual = False
        self._taken = False  # whether the target comes from the table
        self._changed = False
        self._written = 0
        self._read = False  # whether the command is a read
        self._start = False
        self._since_reply = 0  # clocks since a reply, 0 for none
        self._status = Status.OK
        self._busy = False
        self._abandoned = False
        self._write = False
        self._failures = 0
        self._misses = 0
        self._pause = 0
        self._remaining_clks = 0
        self._expired = False

    @property
    def recovery_count(self) -> int:
        """Return the number of recoveries of the bus that have begun."""
        return self.master.recovery_count

    def step(
        self,
        *,
        valid: bool,
        measured: bool,
        flags: int,
        test: bool,
        z: int,
        scl: bool,
        sda: bool,
        table_write: bool = False,
        table_index: int = 0,
        table_position: int = 0,
    ) -> None:
        """Advance by one clock with these inputs and levels of the pins."""
        known, target = self._manual or self._taken, self.target
        self._step_point(valid and not test, is_good(measured=measured, flags=flags), z)
        if table_write:
            self.table[table_index] = table_position
        self._step_motor(known, target, scl, sda)

    def _step_point(self, valid: bool, good: bool, z: int) -> None:
        """Advance distance and target by one clock."""
        settings = self.settings
        age = self._age
        lapsed = False
        if not age:
            if valid and good:
                self._z = z
                self._age = 1
            elif valid:
                self._others = min(self._others + 1, _MOST_OTHERS)
        else:
            self._age += 1
        if age == 1:
            lapsed = self._others > settings.lapse
            self._others = 0
            if lapsed:
                self._level = self._points = 0
        elif age == _AVERAGE:
            self._take_average()
        elif age == _DISTANCE:
            if self._enough:
                self.distance = (self._average >> FINE_WIDTH - 1) + 1 >> 1
            else:
                self._age = 0
        elif age == _COMPARE:
            self._candidate = position(
                self.distance, settings.z_begin, settings.z_shift, self.table
            )
            self._off = abs(self._candidate - self.target)

        if lapsed:
            self._far_count = 0
        self._manual = settings.mode == Mode.MANUAL
        if self._manual:
            self.target = settings.manual
        if settings.mode != Mode.AUTOMATIC:
            self._taken = False
            self._far_count = 0
        elif age == _DECIDE:
            self._decide()
        if age == _DECIDE:
            self._age = 0

    def _take_average(self) -> None:
        """Update the average with a good point."""
        shift = min(self._level, self.settings.average_shift)
        self._enough = self._level >= self.settings.average_shift
        delta = (self._z << FINE_WIDTH) - self._average
        # To nearest, half up.
        self._average += (2 * delta >> shift) + 1 >> 1
        if not self._enough:
            self._points += 1
            self._level = (self._points + 1).bit_length() - 1

    def _decide(self) -> None:
        """Take the candidate as target, or wait."""
        far = self._off > self.settings.hysteresis
        if not self._taken or (far and self._far_count + 1 >= self.settings.hold):
            self.target = self._candidate
            self._taken = True
            self._far_count = 0
        else:
            self._far_count = self._far_count + 1 if far else 0

    def _step_motor(self, known: bool, target: int, scl: bool, sda: bool) -> None:
        """Advance the motor by one clock, with the target of the clock before."""
        settings, state = self.settings, self.state
        changed, pause, expired = self._changed, self._pause, self._expired
        busy, abandoned = self._busy, self._abandoned
        ended = self._since_reply == REPLY_LATENCY - 1

        self.in_position = state is State.HOLD and target == self._written
        self._changed = target != self._written
        self._expired = not self._remaining_clks
        self._pause = max(pause - 1, 0)
        self._remaining_clks = max(self._remaining_clks - 1, 0)
        self._step_bus(scl, sda)
        if ended:
            self._busy = self._abandoned = False
            self._pause = settings.poll_clks
        elif busy and state in (State.OFF, State.WAIT):
            self._abandoned = True

        if state is State.OFF:
            self.state = State.WAIT
        elif state is State.WAIT:
            self._write = True
            self._failures = self._misses = 0
            if known:
                self.state = State.MOVE
                self.fault = 0
        elif state is not State.FAULT:
            if not known:
                self.state = State.WAIT
            elif ended and not abandoned:
                self._end_command(expired)
            elif not busy and not pause:
                self._give_command(target, changed)
        if settings.mode not in (Mode.MANUAL, Mode.AUTOMATIC):
            self.state = State.OFF

    def _step_bus(self, scl: bool, sda: bool) -> None:
        """Advance the bus master by one clock, and take the reply of the clock before."""
        settings, master = self.settings, self.master
        if master.valid:
            self._since_reply = 1
            self._status = master.status
            if master.status is not Status.OK:
                name = _RESULTS[master.status]
                setattr(self, name, min(getattr(self, name) + 1, self._count_max))
            elif self._read and not self._abandoned:
                self.position = master.data
        elif self._since_reply:
            self._since_reply = (self._since_reply + 1) % REPLY_LATENCY
        master.step(
            valid=self._start,
            read=self._read,
            address=settings.address,
            register=POSITION_REGISTER if self._read else TARGET_REGISTER,
            bytes=1,
            data=self._written,
            scl=scl,
            sda=sda,
            quarter=settings.quarter_clks,
            timeout=settings.stretch_clks,
        )
        self._start = False

    def _give_command(self, target: int, changed: bool) -> None:
        """Begin a write of the target if it has to be written, otherwise a read."""
        self._start = self._busy = True
        self._read = not (changed or self._write)
        if not self._read:
            self.state = State.MOVE
            self._write = True
            self._written = target
        if changed:
            self._misses = 0

    def _end_command(self, expired: bool) -> None:
        """Continue from a reply that was not abandoned."""
        settings = self.settings
        if self._status is not Status.OK:
            if self._failures == settings.retries:
                self.state = State.FAULT
                self.fault = int(self._status)
            self._failures = (self._failures + 1) % 256
            return
        self._failures = 0
        if not self._read:
            self._write = False
            self._remaining_clks = settings.timeout_clks
        elif abs(self.position - self._written) <= settings.tolerance:
            self.state = State.HOLD
            self._misses = 0
        elif self.state is State.HOLD:
            self.state = State.MOVE
            self._write = True
        elif expired:
            self._write = True
            if self._misses == settings.retries:
                self.state = State.FAULT
                self.fault = NOT_REACHED
            self._misses = (self._misses + 1) % 256
            self.timeout_count = min(self.timeout_count + 1, self._count_max)
