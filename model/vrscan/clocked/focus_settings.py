"""The configuration of the autofocus, which each of its parts takes whole, as in the RTL."""

from dataclasses import dataclass, fields

from vrscan.data import pkg

POSITION_WIDTH = 16


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
        hold_points: Number of good points in a row for which it has to differ; u16, 0 counts as 1.
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
    hold_points: int
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
    "hold_points": 16,
    "address": 7,
    "quarter_clks": 16,
    "stretch_clks": 24,
    "poll_clks": 24,
    "tolerance": POSITION_WIDTH,
    "timeout_clks": 32,
    "retries": 8,
}  # bits; z_begin is signed
