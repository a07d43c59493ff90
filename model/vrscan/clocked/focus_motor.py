"""Commands for the lens's motor, the twin of ``rtl/actuators/focus_motor.sv``."""

from enum import IntEnum

from vrscan.clocked.i2c_master import Status
from vrscan.clocked.m3_motor import BAD_REPLY, LIMIT, MOTOR_ERROR
from vrscan.registers.focus_registers import Mode
from vrscan.registers.settings import FocusSettings

REPLY_LATENCY = 5  # clocks from a reply to its effect
PAUSE_EXTRA = 6  # clocks from a reply to the next command besides focus_poll_clks

NOT_REACHED = 6  # value of fault, besides the statuses of a reply
TARGET_REGISTER = 0  # register of the device
POSITION_REGISTER = 2
MOST_QUIET = 1 << 40  # clocks that are as good as for ever

_COUNTERS: dict[int, str] = {
    Status.NACK_ADDRESS: "nack_count",
    Status.NACK_DATA: "nack_count",
    Status.STRETCH_TIMEOUT: "stretch_count",
    Status.BUS_STUCK: "stuck_count",
    Status.ARBITRATION: "arbitration_count",
    BAD_REPLY: "reply_count",
    MOTOR_ERROR: "reply_count",
    LIMIT: "reply_count",
}
_WITH_POSITION = (Status.OK, MOTOR_ERROR, LIMIT)


class State(IntEnum):
    """State of the motor's loop."""

    OFF = 0
    WAIT = 1
    MOVE = 2
    HOLD = 3
    FAULT = 4


class FocusMotor:
    """Clock-accurate sequence of commands. A new one is in the state after a reset.

    Args:
        settings: The configuration; it may be changed between two steps.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        command_valid: Whether a command begins in this clock.
        command_read: Whether it is a read of the position, or a write of the target.
        command_data: Target that was written last; u16.
        state: State of the motor's loop.
        fault: Reason of the state FAULT: a status of a reply, or ``NOT_REACHED``.
        position: Last position of the lens; u16.
        in_position: Whether the last position is near the present target.
        nack_count, stretch_count, stuck_count, arbitration_count: Numbers of commands that failed
            in this way.
        timeout_count: Number of targets that were not reached in time.
        reply_count: Number of replies that could not be read or told of a fault.
    """

    def __init__(self, settings: FocusSettings, count_width: int = 16) -> None:
        self.settings = settings
        self.command_valid = False
        self.command_read = False
        self.command_data = 0
        self.state = State.OFF
        self.fault = 0
        self.position = 0
        self.in_position = False
        self.nack_count = 0
        self.stretch_count = 0
        self.stuck_count = 0
        self.arbitration_count = 0
        self.timeout_count = 0
        self.reply_count = 0
        self._count_max = (1 << count_width) - 1

        self._changed = False
        self._since_reply = 0  # clocks since a reply, 0 for none
        self._status: int = Status.OK
        self._busy = False
        self._abandoned = False
        self._write = False
        self._failures = 0
        self._misses = 0
        self._pause = 0
        self._remaining_clks = 0
        self._expired = False

    @property
    def command_register(self) -> int:
        """Return the register of the device that a command begins with."""
        return POSITION_REGISTER if self.command_read else TARGET_REGISTER

    def quiet_clks(self, *, target: int, known: bool) -> int:
        """Return for how many clocks only counters run, if inputs stay and no reply comes."""
        settled = self.in_position == (self.state is State.HOLD and target == self.command_data)
        settled &= self._changed == (target != self.command_data)
        if self.command_valid or self._since_reply or not settled:
            return 0
        if self.state in (State.OFF, State.FAULT):
            return 0 if self.state is State.OFF else MOST_QUIET
        if self.state is State.WAIT:
            waits = self._write and not (known or self._failures or self._misses)
            return MOST_QUIET if waits and not (self._busy and not self._abandoned) else 0
        if not known:
            return 0
        return MOST_QUIET if self._busy else self._pause

    def skip(self, clks: int) -> None:
        """Advance by clocks in which only counters run, at most ``quiet_clks``."""
        if clks > 0:
            self._expired = self._remaining_clks < clks
            self._pause = max(self._pause - clks, 0)
            self._remaining_clks = max(self._remaining_clks - clks, 0)

    def step(
        self, *, target: int, known: bool, reply_valid: bool, reply_status: int, reply_data: int
    ) -> None:
        """Advance by one clock with these inputs."""
        settings, state = self.settings, self.state
        changed, pause, expired = self._changed, self._pause, self._expired
        busy, abandoned = self._busy, self._abandoned
        ended = self._since_reply == REPLY_LATENCY - 1

        self.in_position = state is State.HOLD and target == self.command_data
        self._changed = target != self.command_data
        self._expired = not self._remaining_clks
        self._pause = max(pause - 1, 0)
        self._remaining_clks = max(self._remaining_clks - 1, 0)
        self.command_valid = False
        self._take_reply(reply_valid, reply_status, reply_data)
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

    def _take_reply(self, valid: bool, status: int, data: int) -> None:
        """Take a reply, or count the clocks since it came."""
        if not valid:
            if self._since_reply:
                self._since_reply = (self._since_reply + 1) % REPLY_LATENCY
            return
        self._since_reply = 1
        self._status = status
        if status != Status.OK:
            self._count(_COUNTERS[status])
        if status in _WITH_POSITION and self.command_read and not self._abandoned:
            self.position = data

    def _count(self, name: str) -> None:
        """Add one to a counter, which stops at its largest value."""
        setattr(self, name, min(getattr(self, name) + 1, self._count_max))

    def _give_command(self, target: int, changed: bool) -> None:
        """Begin a write of the target if it has to be written, otherwise a read.

        A target that changed after a write has to wait for a read.
        """
        self.command_valid = self._busy = True
        self.command_read = not (self._write or (changed and self.command_read))
        if not self.command_read:
            self.state = State.MOVE
            self._write = True
            self.command_data = target
            if changed:
                self._misses = 0

    def _end_command(self, expired: bool) -> None:
        """Continue from a reply that was not abandoned."""
        settings = self.settings
        if self._status != Status.OK:
            if self._failures == settings.retries:
                self.state = State.FAULT
                self.fault = self._status
            self._failures = (self._failures + 1) % 256
            return
        self._failures = 0
        if not self.command_read:
            self._write = False
            self._remaining_clks = settings.timeout_clks
        elif abs(self.position - self.command_data) <= settings.tolerance:
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
            self._count("timeout_count")
