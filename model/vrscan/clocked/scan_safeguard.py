"""Whether the mirror moves, from the index's pins: the twin of ``rtl/safety/scan_safeguard.sv``."""

from dataclasses import dataclass

from vrscan.data import pkg

TURNS_FRACTION = 32
EDGE_LATENCY = 3  # clocks beside settle_clks from an edge at the pins to where its clocks count
LIGHT_LATENCY = 2  # clocks from the end of a time here to laser_interlock's dark outputs

_WORD_DROP = pkg.TURN_WIDTH - TURNS_FRACTION
_ONE = 1 << TURNS_FRACTION


@dataclass(frozen=True)
class Parameters:
    """The parameters of the module, under their names.

    Raises:
        ValueError: if a value is out of range.
    """

    index_oversample: int = 4
    settle_clks: int = 13
    light_clks: int = 1_250_000
    period_floor_clks: int = 250_000
    outer_floor: int = 6_144
    dark_clks: int = 3_125_000
    pause_clks: int = 31_250_000

    def __post_init__(self) -> None:
        """Check the ranges."""
        least = self.settle_clks + EDGE_LATENCY + LIGHT_LATENCY
        if self.settle_clks < 1 or not least <= self.light_clks < 1 << 30:
            raise ValueError("scan_safeguard: light_clks must be above settle_clks + 4")
        if self.period_floor_clks + self.settle_clks + EDGE_LATENCY > self.light_clks:
            raise ValueError("scan_safeguard: period_floor_clks must be below light_clks")
        if not least <= self.dark_clks < 1 << 30 or not 1 <= self.pause_clks < 1 << 30:
            raise ValueError("scan_safeguard: dark_clks above settle_clks + 4, pause_clks not 0")
        if self.outer_floor > 1 << 15:
            raise ValueError("scan_safeguard: outer_floor must be at most half a turn")


class ScanSafeguard:
    """Clock-accurate safeguard. A new one is in the state after a reset.

    Args:
        parameters: Parameters of the module.

    Attributes:
        scanning: Whether pulses may come.
        startup_ok: Whether the start-up channel may shine.
    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        self.parameters = parameters or Parameters()
        self.scanning = False
        self.startup_ok = False
        self._all = (1 << self.parameters.index_oversample) - 1
        # The samples of a clock together; a clock later, for how long they have agreed.
        self._open = False
        self._sample: bool | None = None
        self._value = False
        self._run = 0
        self._level: bool | None = None
        self._edge: bool | None = None  # whether the edge is outward, where there is one
        # Periods.
        self._clks = self.parameters.light_clks
        self._turns = 0
        self._begun = self._outer = self._whole = False
        # The start-up channel.
        self._on = self._pause = 0

    def step(self, *, comparator: int, gate: int, word: int, state: int, enable: bool) -> None:
        """Advance by one clock; the arguments are the input ports."""
        good = self._period(word)
        self._search(state, enable=enable, good=good)
        self._settle(comparator, gate)

    def _settle(self, comparator: int, gate: int) -> None:
        """Find the edges."""
        self._edge = None
        if self._open and self._run == self.parameters.settle_clks:
            if self._level is not None and self._level != self._value:
                self._edge = self._value
            self._level = self._value
        if not self._open:
            self._level = None
        if not self._open or self._sample is None:
            self._run = 0
        elif self._run and self._value == self._sample:
            self._run = min(self._run + 1, self.parameters.settle_clks)
        else:
            self._run = 1
        self._value = bool(self._sample)
        self._open = gate == self._all
        self._sample = {0: False, self._all: True}.get(comparator)

    def _period(self, word: int) -> bool:
        """Judge an edge by what was since the last outward one, and return if a period is good."""
        limits = self.parameters
        late = 2 * self._turns >= 3 * _ONE or self._clks >= limits.light_clks - LIGHT_LATENCY
        floor = limits.period_floor_clks + limits.settle_clks + EDGE_LATENCY - 1
        early = 4 * self._turns < 3 * _ONE or self._clks < floor
        inside = limits.outer_floor << 16 <= self._turns < _ONE // 2
        good = False
        if late:
            self.scanning = self._begun = False
        if self._edge:
            self.scanning = good = self._begun and self._whole and not late and not early
            self._begun = self._outer = True
            self._whole = False
            self._clks, self._turns = limits.settle_clks + EDGE_LATENCY, 0
            return good
        if self._edge is False:
            back = self._begun and self._outer and inside
            self.scanning, self._begun = self.scanning and back, back
            self._outer = False
            self._whole |= back
        if not late:
            self._clks += 1
            self._turns += word >> _WORD_DROP
        return good

    def _search(self, state: int, *, enable: bool, good: bool) -> None:
        """Time the start-up channel."""
        limits = self.parameters
        if self.startup_ok:
            ended = self._on >= limits.dark_clks - LIGHT_LATENCY
            self._on = limits.settle_clks + EDGE_LATENCY if good else self._on + 1
            self._pause = limits.pause_clks
            self.startup_ok = state in (pkg.MIRROR_SETTLE, pkg.MIRROR_RUN) and not ended
        else:
            self.startup_ok = enable and state == pkg.MIRROR_SETTLE and not self._pause
            self._on = 0
            self._pause = max(self._pause - 1, 0)
