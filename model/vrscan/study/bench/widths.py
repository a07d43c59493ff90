"""The widths of the position's arithmetic that the design space changes."""

from dataclasses import asdict, dataclass
from typing import Self

from vrscan.data import pkg
from vrscan.fixed import cordic_vector, quarter_wave

ADC_BITS = 12  # bits of the counts in which noise and background are given


@dataclass(frozen=True)
class Design:
    """The widths that are changed; the defaults are the shipped ones.

    Attributes:
        table_bits: Logarithm to base 2 of the length of the quarter-wave table.
        entry_width: Bits of an entry of the table.
        sine_width: Bits of a sine that the table gives, ``vrscan_pkg::SineWidth``.
        phase_width: Bits of the phase that addresses it, ``vrscan_pkg::PhaseWidth``.
        angle_width: Bits of the CORDIC's angle, ``vrscan_pkg::AngleWidth``.
        rotations: Number of rotations of the CORDIC.
        pixel_width: Bits of a pixel.
    """

    table_bits: int = quarter_wave.TABLE_BITS
    entry_width: int = quarter_wave.ENTRY_WIDTH
    sine_width: int = pkg.SINE_WIDTH
    phase_width: int = pkg.PHASE_WIDTH
    angle_width: int = pkg.ANGLE_WIDTH
    rotations: int = cordic_vector.iterations(pkg.ANGLE_WIDTH)
    pixel_width: int = ADC_BITS

    @property
    def xy_width(self) -> int:
        """Return the bits of X and Y, ``vrscan_pkg::HarmonicWidth``."""
        return pkg.ALIGNED_WIDTH + self.sine_width + pkg.WINDOW_WIDTH

    @property
    def sine_amplitude(self) -> int:
        """Return the value that stands for a sine of 1, ``vrscan_pkg::SineAmplitude``."""
        return round(quarter_wave.amplitude(self.sine_width, self.table_bits, self.entry_width))

    @property
    def key(self) -> str:
        """Return a name for rows and files."""
        return "-".join(
            f"{letter}{value}" for letter, value in zip("despark", vars(self).values(), strict=True)
        )

    @property
    def table(self) -> tuple[int, int, int, int]:
        """Return the widths that X and Y depend on, except for the pixels'."""
        return self.table_bits, self.entry_width, self.sine_width, self.phase_width

    def plain(self) -> dict[str, int]:
        """Return the design as a parameter of a cell."""
        return asdict(self)

    @classmethod
    def of(cls, values: dict[str, int]) -> Self:
        """Return the design from the result of ``plain``."""
        return cls(**values)
