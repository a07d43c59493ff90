"""Receiver of the serial link, the twin of ``rtl/link/uart_rx.sv``: 8N1."""

STEP_WIDTH = 24  # bits of the rate in bits per clock, all of them fraction bits
STEP_MAX = 1 << (STEP_WIDTH - 2)
STEP_MAX_MAJORITY = 1 << (STEP_WIDTH - 3)  # largest step at which a bit has three samples

_ONE = 1 << STEP_WIDTH
_EIGHTH = _ONE // 8
_STOP_BIT = 9


def latency(step: int) -> int:
    """Return the clocks from the first low sample of ``rx`` to ``valid``.

    Args:
        step: Rate in bits per clock, 1 to ``STEP_MAX``.
    """
    eighths = 77 if step <= STEP_MAX_MAJORITY else 76
    return -(-eighths * _EIGHTH // step) + 1


class UartRx:
    """Clock-accurate receiver. A new one is in the state after a reset.

    Attributes:
        valid: Whether ``data`` is a byte.
        data: The byte; defined with ``valid``.
        framing: Whether the stop bit is low; with ``valid`` or with ``break_``.
        break_: Whether all bits before it were low too.
        glitch: Whether a start bit turned out to be none.
    """

    def __init__(self) -> None:
        self.valid = False
        self.data = 0
        self.framing = False
        self.break_ = False
        self.glitch = False
        self._sync = False
        self._line = False
        self._wide = True  # whether a bit has three samples, in the clock before
        self._armed = False  # whether the line was high
        self._bit: int | None = None  # number of the bit in the frame
        self._phase = 0  # phase within the bit
        self._samples = (False, False)  # samples at the last two eighths

    def step(self, *, rx: bool, step: int) -> None:
        """Advance by one clock.

        Args:
            rx: Level of the serial line.
            step: Rate in bits per clock; u24.

        Raises:
            ValueError: if ``step`` does not fit.
        """
        if step not in range(_ONE):
            raise ValueError("uart_rx: step is 24 bits")
        line, wide = self._line, self._wide
        self._line, self._sync = self._sync, bool(rx)
        self._wide = step <= STEP_MAX_MAJORITY
        self.valid = self.framing = self.break_ = self.glitch = False
        if self._bit is None:
            self._armed = self._armed or line
            if self._armed and not line:
                self._start(step)
            return

        before = self._phase // _EIGHTH
        self._phase = (self._phase + step) % _ONE
        now = self._phase // _EIGHTH
        first, second = self._samples
        if now != before:
            self._samples = (second, line)
        if wide and (before, now) == (4, 5):
            self._decide(sum((first, second, line)) >= 2, line or (first and second), line, step)
        elif not wide and before < 4 <= now:
            self._decide(line, line, line, step)

    def _start(self, step: int) -> None:
        """Begin a frame with this clock's sample."""
        self._bit = 0
        self._phase = step
        self._samples = (False, False)

    def _decide(self, vote: bool, stop: bool, line: bool, step: int) -> None:
        """Take a bit: by its majority, or as a stop bit."""
        bit = self._bit
        assert bit is not None
        self._bit = bit + 1
        if bit == 0:
            self.glitch = vote
            ends = vote
        elif bit < _STOP_BIT:
            self.data = self.data >> 1 | vote << 7
            return
        else:
            self.framing = not stop
            self.break_ = not stop and self.data == 0
            self.valid = not self.break_
            self._armed = stop
            ends = True
        if ends:
            self._bit = None
            if self._armed and not line:
                self._start(step)
