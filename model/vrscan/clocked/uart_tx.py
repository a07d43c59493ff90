"""Transmitter of the serial link, the twin of ``rtl/link/uart_tx.sv``: 8N1."""

from vrscan.clocked.uart_rx import STEP_WIDTH

LATENCY = 2  # clocks from a byte to its start bit, from rest

_ONE = 1 << STEP_WIDTH
_PAUSE_BITS = 2  # bits of pause after a break


class UartTx:
    """Clock-accurate transmitter. A new one is in the state after a reset.

    Attributes:
        ready: Whether a byte is taken in the next clock.
        tx: Level of the serial line.
        busy: Whether a byte waits or is on the line, or a break or the pause after it is.
    """

    def __init__(self) -> None:
        self.ready = True
        self.tx = True
        self.busy = False
        self._waiting: int | None = None
        self._bits: list[bool] = []  # bits of the frame, the one on the line first
        self._phase = 0  # phase within that bit

    def step(self, *, valid: bool, data: int, step: int, break_: bool) -> None:
        """Advance by one clock.

        Args:
            valid: Whether a byte is offered.
            data: The byte.
            step: Rate in bits per clock; u24.
            break_: Whether the line is held low.

        Raises:
            ValueError: if ``data`` or ``step`` does not fit.
        """
        if data not in range(256) or step not in range(_ONE):
            raise ValueError("uart_tx: data is 8 bits, step is 24 bits")
        offered = data if valid and self.ready else None
        if break_:
            self._bits = [True] * _PAUSE_BITS
            self._phase = 0
        elif not self._bits:
            self._phase = 0
            self._take()
        else:
            self._phase += step
            if self._phase >= _ONE:
                self._phase -= _ONE
                self._bits.pop(0)
                if not self._bits:
                    self._take()
        if offered is not None:
            self._waiting = offered
        self.ready = self._waiting is None
        self.busy = bool(self._bits) or not self.ready
        self.tx = not break_ and (self._bits[0] if self._bits else True)

    def _take(self) -> None:
        """Begin the frame of the waiting byte."""
        if self._waiting is not None:
            self._bits = [False, *(bool(self._waiting >> k & 1) for k in range(8)), True]
            self._waiting = None
