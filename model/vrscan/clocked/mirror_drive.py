"""Start, drive and stop of the mirror, the twin of ``rtl/mirror/mirror_drive.sv``.

VR-SCAN IV-G2: a downward sweep from a high frequency starts the mirror, then it is driven at a
fixed working frequency. The drive is a square wave at twice the mirror's frequency.
"""

from vrscan.clocked.idle import MOST_IDLE
from vrscan.clocked.sigma_delta import SigmaDelta
from vrscan.data import pkg
from vrscan.registers.settings import DriveSettings

DRIVE_LATENCY = 2  # clocks from phase to drive
TRIM_LATENCY = 2  # clocks from trim_i to word_o
READY_LATENCY = 2  # clocks from index_alive_i and settled_i to RUN
TIMEOUT_LATENCY = 2  # clocks that a state outlasts its time-out
SETTLE_CEILING = 1_250_000_000
LOST_CEILING = 3_125_000
LEVEL_CEILING = 1_047_527
DUTY_CEILING = 32_768
RATE_FRACTION = 16
DUTY_WIDTH = 16

_TURN_MASK = (1 << pkg.TURN_WIDTH) - 1
_WORD_MAX = (1 << pkg.WORD_WIDTH) - 1
_HALF = 1 << (pkg.TURN_WIDTH - 1)  # a period of the drive
_DUTY_SHIFT = pkg.TURN_WIDTH - 1 - DUTY_WIDTH

_OFF, _SWEEP, _SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
_RUN, _FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT


def floor_sum(count: int, numerator: int, offset: int, denominator: int) -> int:
    """Return the sum of (numerator k + offset) // denominator over k = 0 .. count - 1.

    Euclid's algorithm on the lattice points below a line: a logarithmic number of steps.
    ``numerator`` and ``offset`` may be negative.
    """
    total = 0
    while True:
        whole, numerator = divmod(numerator, denominator)
        total += whole * (count * (count - 1) // 2)
        whole, offset = divmod(offset, denominator)
        total += whole * count
        # The remainder lies below a line of slope less than one: count it along the other axis.
        count, offset = divmod(numerator * count + offset, denominator)
        if not count:
            return total
        numerator, denominator = denominator, numerator


class MirrorDrive:
    """Clock-accurate drive. A new one is in the state after a reset.

    Args:
        settings: The configuration ports.
        settle_ceiling, lost_ceiling: Largest time-outs of SETTLE and RUN in clocks,
            ``SettleCeilingClks`` and ``LostCeilingClks``.
        level_ceiling, duty_ceiling: Largest level and duty, ``LevelCeiling`` and ``DutyCeiling``.
        stop_width: A pulse that a stop waits for is cut off after 2**stop_width + 1 clocks.

    Attributes:
        state: State of the drive, ``pkg.MIRROR_*``.
        fault: Reason of the state FAULT, ``pkg.FAULT_*``; kept until the next start.
        drive: The square wave for the phase two clocks before.
        level: Level that is applied; u20.
        phase: Phase of the drive; u48, turns.
        word: Frequency word in use; u40.
    """

    def __init__(
        self,
        settings: DriveSettings,
        stop_width: int = 24,
        settle_ceiling: int = SETTLE_CEILING,
        lost_ceiling: int = LOST_CEILING,
        level_ceiling: int = LEVEL_CEILING,
        duty_ceiling: int = DUTY_CEILING,
    ) -> None:
        self.settings = settings
        self.state = _OFF
        self.fault = pkg.FAULT_NONE
        self.drive = False
        self.level = 0
        self.phase = 0
        self.word = 0
        self._duty = min(settings.duty, duty_ceiling) << _DUTY_SHIFT
        self._level_ceiling = level_ceiling
        self._stop_clks = 1 << stop_width
        self._settle_ceiling, self._lost_ceiling = settle_ceiling, lost_ceiling
        self._stop = False
        self._high = False
        self._expired = False
        self._ready = False  # ready for RUN
        self._timer = 0
        self._fine = 0  # the sweep's word with its fraction
        self._sum = 0  # working word and trim
        self._level_pin = SigmaDelta(pkg.LEVEL_WIDTH)

    @property
    def level_pin(self) -> bool:
        """Return the sigma-delta output of the level."""
        return self._level_pin.pin

    def step(
        self, *, enable: bool, trim: int, level: int, index_alive: bool, settled: bool
    ) -> None:
        """Advance by one clock."""
        state = self.state
        settings = self.settings
        active = _SWEEP <= state <= _RUN
        stop = self._stop or not enable
        arrived = self._fine <= settings.work_word << RATE_FRACTION
        following = state
        if active and stop:
            cut = self._stop and self._timer >= self._stop_clks
            if not (self.drive and self._high) or cut:
                following = _OFF
        elif state == _OFF:
            if enable:
                following = _SWEEP
        elif state == _SWEEP:
            if arrived:
                following = _SETTLE
            elif self._expired:
                following = _FAULT
        elif state == _SETTLE:
            if self._ready:
                following = _RUN
            elif self._expired:
                following = _FAULT
        elif state == _RUN:
            if self._expired:
                following = _FAULT
        elif not enable:
            following = _OFF

        if state == _OFF and following == _SWEEP:
            self.fault = pkg.FAULT_NONE
        elif active and following == _FAULT:
            self.fault = {_SWEEP: pkg.FAULT_SWEEP, _SETTLE: pkg.FAULT_SETTLE}.get(
                state, pkg.FAULT_INDEX
            )

        present = state == _RUN and index_alive
        limit = (
            settings.sweep_timeout
            if state == _SWEEP
            else min(settings.settle_timeout, self._settle_ceiling)
            if state == _SETTLE
            else min(settings.lost_timeout, self._lost_ceiling)
        )
        self._expired = active and following == state and not present and self._timer >= limit
        if following != state or stop != self._stop or (present and not stop):
            self._timer = 0
        else:
            self._timer += 1

        self._level_pin.step(self.level)
        off = state == _OFF
        high = active and (self.phase & (_HALF - 1)) < self._duty
        self.phase = 0 if off else (self.phase + self.word) & _TURN_MASK
        active_next = _SWEEP <= following <= _RUN
        self.drive = active_next and self._high
        self._high = high
        if off:
            self.word = settings.sweep_word
        elif active and not stop:
            if state != _SWEEP:
                self.word = min(max(self._sum, 0), _WORD_MAX)
            elif arrived:
                self.word = settings.work_word
            else:
                self.word = self._fine >> RATE_FRACTION
        self._sum = settings.work_word + trim
        if state == _OFF:
            self._fine = settings.sweep_word << RATE_FRACTION
        else:
            self._fine -= settings.sweep_rate
        if not active_next:
            self.level = 0
        elif following == _SWEEP:
            self.level = min(settings.sweep_level, self._level_ceiling)
        elif not stop:
            self.level = min(level, self._level_ceiling)
        self.state = following
        self._ready = index_alive and settled
        self._stop = active and stop and following != _OFF

    def idle(self, *, enable: bool, trim: int, level: int, index_alive: bool, settled: bool) -> int:
        """Return for how many clocks these inputs change nothing but accumulators and timers.

        ``phase``, ``word`` in a sweep, and ``level_pin`` go on; ``skip`` knows where they arrive.
        """
        state = self.state
        settings = self.settings
        if state in (_OFF, _FAULT):
            waits = enable == (state == _FAULT)
            quiet = not (self.drive or self._high or self.level or self._stop)
            settled_down = state == _FAULT or (
                self.word == settings.sweep_word
                and self.phase == 0
                and self._fine == settings.sweep_word << RATE_FRACTION
            )
            return MOST_IDLE if waits and quiet and settled_down else 0
        if not enable or self._stop or self._high != self.drive or self._expired:
            return 0
        if state == _SWEEP:
            left = self._fine - (settings.work_word << RATE_FRACTION)
            if left <= 0 or self.level != min(settings.sweep_level, self._level_ceiling):
                return 0
            # The word only falls, so the edges below come no sooner than with the present word.
            most = -(-left // settings.sweep_rate) if settings.sweep_rate else MOST_IDLE
            most = min(most, settings.sweep_timeout - self._timer)
        else:
            aim = settings.work_word + trim
            if (
                self._sum != aim
                or self.word != min(max(aim, 0), _WORD_MAX)
                or (self.level != min(level, self._level_ceiling))
            ):
                return 0
            if state == _SETTLE:
                if self._ready or (index_alive and settled):
                    return 0
                most = min(settings.settle_timeout, self._settle_ceiling) - self._timer
            elif index_alive:
                most = 0 if self._timer else MOST_IDLE
            else:
                most = min(settings.lost_timeout, self._lost_ceiling) - self._timer
        within = self.phase & (_HALF - 1)
        if (within < self._duty) != self._high:
            return 0
        if self.word:
            edge = self._duty if self._high else _HALF
            most = min(most, -(-(edge - within) // self.word))
        return max(0, min(most, MOST_IDLE))

    def skip(
        self, clocks: int, *, enable: bool, trim: int, level: int, index_alive: bool, settled: bool
    ) -> None:
        """Take ``clocks`` steps at once, at most as many as ``idle`` returns for these inputs."""
        if clocks <= 0:
            return
        self._level_pin.step(self.level, clocks)
        self._sum = self.settings.work_word + trim
        self._ready = index_alive and settled
        state = self.state
        if state == _OFF:
            self._timer = 0
            return
        rate = self.settings.sweep_rate
        if state == _SWEEP:
            # The words of the first clock, and of the clocks that follow the falling register.
            self.phase += self.word + floor_sum(clocks - 1, -rate, self._fine, 1 << RATE_FRACTION)
            self.word = (self._fine - (clocks - 1) * rate) >> RATE_FRACTION
        else:
            self.phase += clocks * self.word
        self.phase &= _TURN_MASK
        self._fine -= clocks * rate
        self._timer += 0 if state == _RUN and index_alive else clocks
