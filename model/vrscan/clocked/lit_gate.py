"""A photodiode's gate, open while its light is constant: the twin of ``rtl/safety/lit_gate.sv``."""


class LitGate:
    """Clock-accurate gate. A new one is in the state after a reset.

    Args:
        answer_clks: Clocks of a light in which the diode has to answer, ``AnswerClks``.
        level_clks: Clocks in which the filter of the level settles, ``LevelClks``.
        startup: Level of the start-up channel in the reset.

    Attributes:
        gate: The gate's samples with the inputs of the last clock, the first in bit 0.
    """

    def __init__(self, answer_clks: int = 126, level_clks: int = 625_000, startup: int = 0) -> None:
        self.gate = 0
        self._answer_clks, self._level_clks = answer_clks, level_clks
        self._startup, self._left = startup, level_clks

    def step(self, *, pulse: bool, index_light: bool, startup: int, gate: int) -> None:
        """Advance by one clock; the arguments are the input ports."""
        lit = index_light and not pulse
        if startup != self._startup:
            self._left = self._level_clks
        elif not lit and self._left <= self._answer_clks:
            self._left = self._answer_clks
        else:
            self._left = max(self._left - 1, 0)
        self._startup = startup
        self.gate = gate if lit and not self._left else 0
