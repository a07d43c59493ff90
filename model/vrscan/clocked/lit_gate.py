"""A photodiode's gate, open while one light goes on: the twin of ``rtl/safety/lit_gate.sv``."""


class LitGate:
    """Clock-accurate gate. A new one is in the state after a reset.

    Args:
        answer_clks: Clocks of a light in which the diode has to answer, ``AnswerClks``.

    Attributes:
        gate: The gate's samples, the first in bit 0.
    """

    def __init__(self, answer_clks: int = 126) -> None:
        self.gate = 0
        self._answer_clks = answer_clks
        self._lit = 0

    def step(self, *, lit: bool, gate: int) -> None:
        """Advance by one clock; the arguments are the input ports."""
        self._lit = min(self._lit + 1, self._answer_clks) if lit else 0
        self.gate = gate if self._lit == self._answer_clks else 0
