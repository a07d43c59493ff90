"""The instrument's configuration: the shipped defaults and the TOML file that overrides them.

The thresholds of ``[peak]`` come from the study that ``vrscan efficiency`` repeats; the docstring
of ``Peak`` has its figures.
"""

import json
import math
import re
import tomllib
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from vrscan.data import pkg
from vrscan.data.errors import InputError, cut, nearest, one_line, shown, unread

HARMONICS = (1, 3, 5, 7, 9, 11, 13, 15, 17)  # orders k in the mirror's motion, (12)
FEWEST_HARMONICS = 6  # the paper's number
LINES_PER_PERIOD = 150.1  # the paper's ratio of line rate and mirror frequency
BLANKING_CLKS = 16  # between an exposure's end and its readout
PRESETS = Path(__file__).parent / "presets"
DEEPEST = 32  # tables and lists in each other, far more than any file of ours has
_MAX_WINDOW = (1 << pkg.WINDOW_WIDTH) - 1  # px

Positive = Annotated[float, Field(gt=0)]
File = TypeVar("File", bound=BaseModel)


def _number(value: object) -> object:
    """Refuse true and false where a Literal takes numbers: to Python they are 1 and 0."""
    if isinstance(value, bool):
        raise ValueError("input should be a number")
    return value


NUMBER = BeforeValidator(_number)


class Section(BaseModel):
    """One table of the configuration file.

    It refuses unknown keys, values of another type than the stated one, and infinite values.
    """

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, values: object) -> object:
        """Refuse an unknown key here, where the known ones are at hand for ``complaint``."""
        for key in values if isinstance(values, dict) else ():
            if key not in cls.model_fields:
                context = {"key": str(key), "known": list(cls.model_fields)}
                raise PydanticCustomError("unknown_key", "unknown key {key}", context)
        return values


class Peak(Section):
    """Threshold, window and confidence of the peak.

    A Gaussian is fitted to the spot (``window = "fit"``); ``"two_pass"`` keeps the window that the
    fit starts from, and ``"threshold"`` is the paper's one window.

    The thresholds are the outcome of ``vrscan efficiency`` with this one window (12 bits, 5
    electrons per count, read noise 3 and background 60 counts; spots of s = 1, 2, 4, 8, 12 px,
    peaks of 5, 20, 50, 90 % of full scale; 4,000 lines each). The table gives the geometric mean of
    the efficiency over the 20 spots, and how far a spot with sides of 0.75 s and 1.25 s, s = 3 px,
    moves between 10 and 90 % of full scale:

    | k_noise | k_height | efficiency | skewed spot moves |
    |---|---|---|---|
    | 2.5 | 0 | 0.968 | 0.11 px |
    | 2.5 | 0.015 | 0.940 | 0.05 px |
    | 2.5 | 0.02 (shipped) | 0.926 | 0.03 px |
    | 2.5 | 0.03 | 0.896 | 0.00 px |
    | 3.5 | 0.02 | 0.915 | 0.06 px |

    No line was lost in any of them, and none had a false RIVAL. ``snr_min`` and ``min_width`` cost
    nothing there, because the dimmest spot is 44 standard deviations high; 5 and 3 px keep lines
    without a spot out.

    With two passes the first window only has to find the spot and its width, and ``k_first``
    replaces ``k_height``. It is so high that the run does not climb a background that slopes by 1
    count/px beside a spot of s = 12 px at 5 %. With a fit it is ``k_fit``: a run of a quarter of
    the height is often cut where speckle is dark.
    """

    period: Literal["n", "n-1"] = "n"
    """Period T of (8): the window's width N, or N - 1 as printed, with one window only."""
    window: Literal["threshold", "two_pass", "fit"] = "fit"
    """How the window around a spot is found, and whether a Gaussian is fitted from it."""
    noise: Literal["background", "row"] = "background"
    """Where background and noise are taken: beside the spot, or in the whole row as printed."""
    k_noise: float = Field(default=2.5, ge=0, lt=256)
    """Threshold above background / spread."""
    k_height: float = Field(default=0.02, ge=0, lt=1)
    """Threshold above background / peak's height."""
    k_first: float = Field(default=0.25, ge=0, lt=1)
    """Threshold in the first of two passes, as k_height."""
    k_fit: float = Field(default=0.15, ge=0, lt=1)
    """The same before a fit."""
    snr_min: float = Field(default=5.0, ge=0, lt=256)
    """Least S/N of a spot on an even row, below which it is flagged; elsewhere ``snr_sure``."""
    min_width: int = Field(default=3, ge=3, le=255)
    """Narrowest window, px."""
    max_width: int = Field(default=255, ge=3, le=255)
    """Widest window, px."""
    max_core: int = Field(default=64, ge=3, le=255)
    """Widest at a quarter of the height, px: no spot of this instrument is, unless it is
    saturated."""
    kappa: float = Field(default=0.2, ge=0, lt=4)
    """Counts per electron; without it the range of pixel_width bits over the sensor's
    full_well_e."""

    @property
    def snr_sure(self) -> float:
        """Return the S/N from which a spot is found on any row: 13/8 times ``snr_min``."""
        return self.snr_min * (1.0 if self.noise == "row" else 13 / 8)

    @model_validator(mode="after")
    def _widths(self) -> "Peak":
        if self.min_width > self.max_width:
            raise ValueError(f"min_width {self.min_width} is above max_width {self.max_width}")
        if self.two_pass and self.period != "n":
            raise ValueError(
                f'window = "{self.window}" needs period = "n"; "n-1" is for window = "threshold"'
            )
        return self

    @property
    def two_pass(self) -> bool:
        """Return whether a second window follows the first."""
        return self.window != "threshold"

    @property
    def fit(self) -> bool:
        """Return whether a Gaussian is fitted to the spot, from the second window on."""
        return self.window == "fit"

    @property
    def period_clks(self) -> int:
        """Return the least clocks from line to line that the chain takes in the chosen mode."""
        if self.fit:
            return pkg.FIT_PERIOD
        if self.two_pass:
            return 3 * _MAX_WINDOW + pkg.TWO_PASS_OVERHEAD
        return 2 * _MAX_WINDOW + pkg.MIN_PERIOD_OVERHEAD

    @property
    def cut_height(self) -> float:
        """Return the threshold's share of the peak's height in the chosen mode."""
        return {"threshold": self.k_height, "two_pass": self.k_first, "fit": self.k_fit}[
            self.window
        ]


UNITS_MM: tuple[Literal[1, 2, 4, 8], ...] = (1, 2, 4, 8)


class Geometry(Section):
    """The triangle of base, camera and sensor, (2) to (5), and what C_obj promises of a point."""

    base_mm: Positive = 60.0
    """Distance of lens and mirror."""
    bias_deg: float = Field(default=82.0, gt=0, lt=180)
    """Angle of the lens's axis with the base."""
    offset_mm: float = 0.0
    """Distance of the lens from the base, along z."""
    focal_mm: Positive = 25.0
    """Distance from the lens to the sensor in (4)."""
    pitch_mm: Positive = 0.007
    """Distance of two pixels."""
    centre_px: float = 1023.5
    """The optical axis; without it the middle of the sensor's line."""
    k1: float = 0.0
    """Radial distortion, mm^-2."""
    k2: float = 0.0
    """Radial distortion, mm^-4."""
    distortion: Literal["odd", "even"] = "odd"
    """Whether (5) moves both sides of the image outwards, or both one way."""
    tolerance: float = Field(default=0.001, gt=0, lt=2**-8)
    """C_obj is the probability that a point errs by less than this share of its z."""
    confidence: Literal["tolerance", "printed"] = "tolerance"
    """Whether C_obj is that probability, or snr / snr_max as (9) is printed."""
    snr_max: float = Field(default=255.0, ge=1, lt=256)
    """S/N at which the printed C_obj is 1."""
    unit_mm: Annotated[Literal[1, 2, 4, 8], NUMBER] = 1
    """What the chain counts lengths in: x and z end at 2048 of it, in steps of 1/4096 of it."""

    @property
    def range_mm(self) -> float:
        """Return where x and z end, mm."""
        return 2.0 ** (pkg.LENGTH_WIDTH - 1 - pkg.LENGTH_FRACTION) * self.unit_mm

    @property
    def bias_rad(self) -> float:
        """Return the camera's bias, rad."""
        return math.radians(self.bias_deg)


class Map(Section):
    """The correction maps of a calibration, and where the lens stands among them."""

    file: str | None = None
    """As vrscan calibrate map writes it; relative to the configuration's file."""
    focus_mm: Positive = 420.0
    """Depth along the lens's axis that is in focus."""
    thin_lens: bool = False
    """Maps of a thin lens in place of a file; geometry.focal_mm is then that of free.focus_mm."""

    @model_validator(mode="after")
    def _one(self) -> "Map":
        if self.thin_lens and self.file is not None:
            raise ValueError(f"thin_lens: the maps come from {self.file}")
        return self


class Free(Section):
    """Where a line without a peak is free: what the camera sees, and what would be bright enough.

    A surface is promised to be seen where its reflectance times the cosine of the angle between its
    normal and the camera is ``darkest`` or more: 0.02 is black rubber of 3 % at 48 degrees. What is
    darker, polished or seen at a grazing angle may stand in a space that is called free. The peak
    of such a surface is computed from power, distance and blur; the blur follows from ``focus_mm``.
    """

    darkest: float = Field(default=0.02, gt=0, le=1)
    """Least reflectance times cosine that is promised to be seen."""
    focus_mm: Positive = 420.0
    """Depth along the lens's axis that is in focus."""
    f_number: float = Field(default=3.0, ge=0.5, le=64)
    """F number of the lens."""
    efficiency: float = Field(default=0.36, gt=0, le=1)
    """Electrons per photon at the lens, least."""
    spot_mm: Positive = 0.4
    """Radius of the laser's spot."""
    far_mm: Positive = 2000.0
    """Nothing is called free beyond; where x and z end, geometry.unit_mm has to be larger."""
    edge_px: float = Field(default=8.0, ge=0)
    """Margin at both ends of the sensor."""


# A straight line 1/2 - p over the middle 7/10 of a facet, 0 <= p < 1, as harmonics of p / 2: the
# least squares of the nine, over the first one's STRAIGHT. They leave 5e-7 of the facet's angle.
STRAIGHT = 0.4002428796
RAMP = (
    1.0, 0.100459081, 0.029460033, 0.010947146, 0.004254808, 0.001578005, 0.000518420, 0.000136444,
    0.000022845,
)  # fmt: skip
SCANNED = 0.7  # largest share of a facet that is scanned


class Mirror(Section):
    """The mirror's motion (12), and the loop that drives the mirror and holds its amplitude.

    A polygon turns at a speed of its own, and a diode tells the start of each facet's scan. A
    period is then a facet, ``frequency_hz`` the number of facets a second, and the angle a straight
    line from plus to minus 360 degrees / ``facets``. Amplitude and harmonics are those of this line
    if they are not given, and what controls an amplitude has nothing to do. What is averaged over
    ``averaging_periods`` is the speed alone. ``POLYGON`` has the values that a polygon needs
    otherwise than a resonant mirror.

    The gains and rates were chosen on the mirror of ``[mems]``. This mirror starts at up to twice
    the sweep rate, and the loop settles fastest with this integral time and trim gain; with either
    trim gain a third higher the loop rings.
    """

    kind: Literal["resonant", "polygon"] = "resonant"
    """What turns the beam; a resonant mirror swings, and a polygon turns."""
    facets: int = Field(default=12, ge=4, le=64)
    """Number of facets of a polygon."""
    reach_deg: float = Field(default=20.5, gt=0, lt=90)
    """Largest angle that a polygon scans to."""
    frequency_hz: float = Field(default=249.0, gt=0, le=10_000)
    """Frequency of the mirror."""
    amplitude_deg: float = Field(default=20.5, gt=0, lt=90)
    """Amplitude of the scan angle, which is twice the mirror's."""
    index_deg: float = Field(default=17.0, gt=-90, lt=90)
    """Scan angle of the index mark."""
    harmonics: list[list[float]] = [
        [1.0, 0.0],
        [0.000638120, 2.8657650],
        [0.000185824, -1.3659249],
        [0.000069625, 0.7210661],
        [0.000035598, 2.9573742],
        [0.000018590, -1.1560002],
        [0.000011640, 1.1754111],
        [0.000007234, -2.9009329],
        [0.000005089, -0.5293260],
    ]
    """[a_k, phi_k_rad] of the simulated mirror where the loop rests at level 0.7, and their
    change per turn of drive_phase, as `python -m vrscan.calibrate.motion_fit` prints them. The
    paper's six harmonics leave 3.96 urad rms of the motion, these nine leave 1.41; without slopes
    the band of levels adds up to 48. A file may give six to nine pairs, and the others are 0. A
    file without slopes has slopes of 0."""
    slopes: list[list[float]] = [
        [-0.003090255, -0.0171372],
        [0.002021759, -15.4796859],
        [0.001396327, -26.4698961],
        [0.000437955, -38.6304561],
        [0.000381772, -49.2538547],
        [0.000184112, -63.8553857],
        [0.000153265, -74.6008225],
        [0.000087911, -90.1488955],
        [0.000073320, -100.6669357],
    ]
    """Change of harmonics per turn of drive_phase."""
    drive_phase: float = Field(default=0.0654279, ge=0, lt=1)
    """Turns, where harmonics hold."""

    sweep_span_hz: float = Field(default=26.0, ge=0)
    """Height of the start above work."""
    sweep_hz_per_s: Positive = 40.0
    """Rate of the sweep."""
    sweep_level: float = Field(default=0.999, gt=0, lt=1)
    """Level of the drive in the sweep."""
    duty: float = Field(default=0.5, ge=0, lt=1)
    """Duty of the drive's square wave."""

    level: float = Field(default=0.7, gt=0, lt=1)
    """Level of the drive: at first, and nominal."""
    level_min: float = Field(default=0.3, ge=0, lt=1)
    """Least level of the drive at work."""
    level_max: float = Field(default=0.999, gt=0, lt=1)
    """Largest level of the drive at work."""
    level_low: float = Field(default=0.62, ge=0, lt=1)
    """Below it the frequency steps."""
    level_high: float = Field(default=0.78, ge=0, lt=1)
    """Above it the frequency steps."""
    proportional: float = Field(default=20.0, ge=0)
    """Relative level / relative amplitude."""
    integral_s: Positive = 0.03
    """Time constant of the integral term."""
    trim_hz: float = Field(default=2.0, ge=0)
    """Range of the trim, either way."""
    trim_hz_per_s: float = Field(default=0.6, ge=0)
    """Largest rate of the trim."""
    trim_gain_hz_per_s: float = Field(default=2.0, ge=0)
    """Rate for a level off by 1."""
    amplitude_falls: bool = True
    """Whether the amplitude falls with a rising frequency."""

    averaging_periods: Annotated[Literal[1, 2, 4, 8, 16], NUMBER] = 2
    """Averaging of phase and amplitude."""
    settle_ppm: Positive = 50.0
    """Error of the amplitude below which it is settled."""
    shock_ppm: Positive = 300.0
    """Error of the amplitude above which there is a shock."""
    phase_limit_urad: Positive = 60.0
    """Largest error of the mirror's phase."""
    settle_periods: int = Field(default=16, ge=1, le=255)
    """Good periods in a row until it is settled."""
    hold_periods: int = Field(default=4, ge=1, le=255)
    """Good periods to end an index fault."""
    settle_timeout_s: Positive = 5.0
    """Longest time to settle, then the light goes off."""
    lost_timeout_s: Positive = 0.02
    """Longest time without the index, then the light goes off."""

    oversample: Annotated[Literal[1, 2, 4, 8], NUMBER] = 4
    """Samples per clock of the index inputs."""
    glitch_us: float = Field(default=0.1, ge=0)
    """A shorter pulse of the comparator is a glitch."""

    @model_validator(mode="after")
    def _consistent(self) -> "Mirror":
        levels = (self.level_min, self.level_low, self.level, self.level_high, self.level_max)
        if sorted(levels) != list(levels):
            raise ValueError("level_min, level_low, level, level_high, level_max must not fall")
        if self.settle_ppm > self.shock_ppm:
            raise ValueError(f"settle_ppm {self.settle_ppm} is above shock_ppm {self.shock_ppm}")
        if not self.polygon:
            return self
        facet = 720.0 / self.facets
        if 2.0 * self.reach_deg > SCANNED * facet:
            raise ValueError(
                f"reach_deg {self.reach_deg:g} is more than {0.5 * SCANNED * facet:g}, the middle "
                f"{SCANNED:.0%} of one of {self.facets} facets"
            )
        if not self.reach_deg < abs(self.index_deg) < 0.5 * facet:
            raise ValueError(
                f"index_deg {self.index_deg:g} is not between reach_deg {self.reach_deg:g} and "
                f"the facet's end at {0.5 * facet:g}"
            )
        return self

    @property
    def polygon(self) -> bool:
        """Return whether the mirror is a polygon."""
        return self.kind == "polygon"

    def facet_phase(self, angle_deg: float) -> float:
        """Return the phase at which a polygon's beam is at an angle, turns of a facet."""
        return 0.5 - angle_deg * self.facets / 720.0

    @model_validator(mode="before")
    @classmethod
    def _of_polygon(cls, values: object) -> object:
        if not isinstance(values, dict) or values.get("kind") != "polygon":
            return values
        facets = values.get("facets", cls.model_fields["facets"].default)
        own = dict(POLYGON)
        if isinstance(facets, int) and facets > 0:
            own["amplitude_deg"] = STRAIGHT * 720.0 / facets
        return own | values

    @model_validator(mode="before")
    @classmethod
    def _own_slopes(cls, values: object) -> object:
        if isinstance(values, dict) and "harmonics" in values and "slopes" not in values:
            return values | {"slopes": [[0.0, 0.0]] * len(HARMONICS)}
        return values

    @field_validator("harmonics", "slopes")
    @classmethod
    def _pairs(cls, value: list[list[float]]) -> list[list[float]]:
        most = len(HARMONICS)
        if not FEWEST_HARMONICS <= len(value) <= most:
            raise ValueError(
                f"must be {FEWEST_HARMONICS} to {most} pairs [a_k, phi_k_rad], "
                f"k = 1, 3 .. {HARMONICS[-1]}, and not {len(value)}"
            )
        if any(len(pair) != 2 for pair in value):
            raise ValueError("must be pairs [a_k, phi_k_rad]")
        return value + [[0.0, 0.0]] * (most - len(value))


POLYGON: dict[str, object] = {
    "frequency_hz": 240.0,
    "index_deg": 25.0,
    "harmonics": [[a, 0.0] for a in RAMP],
    "slopes": [[0.0, 0.0]] * len(RAMP),
    "sweep_span_hz": 0.0,
    "trim_hz": 0.0,
    "averaging_periods": 16,
    "phase_limit_urad": 4_000.0,  # a facet differs from the one before by less
    "settle_periods": 128,  # until the motor has its speed, and the loop knows it
    "settle_timeout_s": 10.0,
}


class Line(Section):
    """Timing of a line and of its laser pulse.

    The line's clock follows the mirror's, so their ratio is what is kept, and the rate follows from
    it. 150.1 is the paper's: the lines of ten periods interlace, and the 1,501 angles come again.
    A file may give either of the two.
    """

    lines_per_period: float | None = Field(default=None, ge=1, lt=4096)
    """Without it 150.1, or what rate_hz makes it."""
    rate_hz: float = Field(default=LINES_PER_PERIOD * 249.0, gt=0, le=1_000_000)
    """Lines per second."""
    pulse_us: float = Field(default=1.0, gt=0, le=1_000)
    """Length of the laser's pulse."""
    pulse_delay_us: float = Field(default=0.0, ge=0)
    """Time from the line's start to the pulse."""

    @model_validator(mode="after")
    def _fits(self) -> "Line":
        # A rate that follows from the mirror's is known to the whole configuration only.
        if "rate_hz" in self.model_fields_set and self.late:
            raise ValueError(self.late)
        return self

    @property
    def late(self) -> str:
        """Return what is wrong where the pulse ends after the line, or ""."""
        period_us = 1e6 / self.rate_hz
        if self.pulse_delay_us + self.pulse_us > period_us:
            return f"the pulse ends after the line period of {period_us:.4g} us"
        return ""


class Sensor(Section):
    """The line sensor."""

    pixel_width: int = Field(default=12, ge=8, le=16)
    """Bits of a pixel."""
    line_length: int = Field(default=2048, ge=64, le=8192)
    """Pixels of a line."""
    full_well_e: Positive = 20_475.0
    """Electrons at the largest pixel value."""
    saturation_level: int | None = Field(default=None, ge=1)
    """Least pixel value that counts as saturated; without it the largest of pixel_width bits."""
    readout_lag: int = Field(default=0, ge=0, le=3)
    """A readout belongs to the exposure behind whose end so many others have ended. It begins so
    long behind that end; without times anywhere between those of this lag and the next one."""
    readout_min_us: float | None = Field(default=None, ge=0)
    """Shortest time from an exposure's end to its readout."""
    readout_max_us: float | None = Field(default=None, ge=0)
    """The longest one."""
    readout_stale: bool = False
    """Whether exposures start the readouts, so that the first ones of a start are of old lines."""

    @property
    def least_saturated(self) -> int:
        """Return the least pixel value that counts as saturated."""
        largest = 2**self.pixel_width - 1
        return largest if self.saturation_level is None else self.saturation_level

    @model_validator(mode="after")
    def _reachable(self) -> "Sensor":
        largest = 2**self.pixel_width - 1
        if self.least_saturated > largest:
            raise ValueError(
                f"saturation_level {self.least_saturated} is above {largest}, the largest of "
                f"{self.pixel_width} bits"
            )
        least, most = self.readout_min_us, self.readout_max_us
        if least is not None and most is not None and least > most:
            raise ValueError(f"readout_min_us {least} is above readout_max_us {most}")
        return self


class Laser(Section):
    """The laser: how its power follows the peaks, and the limits of its light.

    A hardware ceiling lies above every limit, ``docs/laser-safety.md``. One power for both
    directions of the scan follows a scene better than one for each: at the turning point the next
    place on the scene is the neighbouring one, while a direction's own power was set at the far end
    of the scan. On surfaces whose reflectance has steps over the whole range of 273:1, peaks are
    within half and twice the target on 56 % of the lines with one power and on 48 % with two; on a
    slope of 20:1 on 99 and 85 %.
    """

    power_max: int = Field(default=65_535, ge=1, le=65_535)
    """Power at which (10) is 1."""
    rated_mw: Positive = 50.0
    """Power of the laser at power_max."""

    adapt: bool = True
    """Whether the power follows the peaks."""
    shared: bool = True
    """One power for both directions of the scan."""
    power_mw: float = Field(default=5.0, ge=0)
    """Fixed, or start of the adaptation."""
    min_mw: float = Field(default=0.18, ge=0)
    """Least adapted power: rated_mw / 273."""
    max_mw: float = Field(default=50.0, ge=0)
    """Largest adapted power."""
    startup_mw: float = Field(default=1.0, ge=0)
    """Power of the start-up channel, for the index."""
    target: float = Field(default=0.5, ge=0, lt=1)
    """Height of a peak / full scale."""
    cut: float = Field(default=0.25, ge=0, lt=1)
    """Factor of the power after saturation."""
    down: float = Field(default=1.0, ge=0, lt=8)
    """Share of a peak's excess corrected per line."""
    up: float = Field(default=1.5, ge=0, lt=8)
    """Share of a peak's lack corrected per line."""
    search: float = Field(default=0.5, ge=0, lt=1)
    """Growth of the power where there is no peak."""
    index_margin_deg: float = Field(default=2.0, ge=0)
    """Lit in RUN so far before the mark."""

    limit_power_mw: float = Field(default=50.0, ge=0)
    """Limit of a pulse's power."""
    limit_startup_mw: float = Field(default=1.0, ge=0)
    """Limit of the start-up channel's power."""
    limit_pulse_us: float = Field(default=2.0, ge=0)
    """Limit of a pulse's length."""
    limit_average_mw: float = Field(default=2.5, ge=0)
    """Limit of the mean power."""
    limit_burst_uj: float = Field(default=1.0, ge=0)
    """Energy beyond the average, at once."""
    watchdog_s: Positive = 0.5
    """Light goes off when the host is silent for longer."""


# An M3 smart stage's address, and its speed as it leaves the factory (06224-M-0003).
M3: dict[str, int | float] = {"address": 0x33, "speed_mm_per_s": 4.0}


class Focus(Section):
    """The autofocus, VR-SCAN IV-E: a motor that moves the lens, and its position sensor, on I2C.

    It is off as shipped, because the image moves with the lens and ``[geometry]`` holds for one
    position only. A defocus of 10 um blurs a point by half a pixel with a lens of 1:3. ``M3`` has
    the values that an M3 smart stage needs otherwise than a motor with registers.
    """

    mode: Literal["off", "manual", "automatic"] = "off"
    """Whether the lens stands, follows manual_mm, or follows the points."""
    manual_mm: Positive = 500.0
    """Z in focus in the mode manual."""
    near_mm: Positive = 240.0
    """Least z that has a lens position."""
    far_mm: Positive = 1000.0
    """Largest z that has a lens position."""
    infinity_mm: float = 0.0
    """Position of the lens for objects at infinity."""
    travel_mm: Positive = 3.0
    """Positions are 0 .. travel_mm, larger for nearer objects."""
    resolution_um: Positive = 0.5
    """Step of the lens position."""

    average_points: int = Field(default=4096, ge=1, le=32_768)
    """A power of two."""
    lapse_points: int = Field(default=20_000, ge=0, le=65_535)
    """Bad points to end an average."""
    hysteresis_um: float = Field(default=10.0, ge=0)
    """Least change of the target."""
    hold_points: int = Field(default=4096, ge=1, le=65_535)
    """Points in a row that ask for it."""
    tolerance_um: float = Field(default=1.0, ge=0)
    """Largest distance to the target in position."""
    timeout_s: Positive = 1.0
    """Longest time to reach a target."""
    retries: int = Field(default=3, ge=0, le=255)
    """Retries of a command and of a target."""

    motor: Literal["registers", "m3"] = "registers"
    """What the motor speaks: registers of two bytes, or the commands of an M3 smart stage."""
    address: int = Field(default=0x2A, ge=0, le=0x7F)
    """I2C address of the motor; 0x33 is an M3's."""
    quarter_us: Positive = 2.5
    """Quarter of a bit: 100 kHz."""
    stretch_ms: Positive = 25.0
    """Longest time of a stretched clock or a busy bus."""
    poll_ms: float = Field(default=2.0, ge=0)
    """Pause between two commands."""
    speed_mm_per_s: Positive = 5.0
    """Of the simulated motor."""

    @model_validator(mode="before")
    @classmethod
    def _of_m3(cls, values: object) -> object:
        if isinstance(values, dict) and values.get("motor") == "m3":
            return M3 | values
        return values

    @field_validator("average_points")
    @classmethod
    def _power(cls, value: int) -> int:
        if value & (value - 1):
            raise ValueError("must be a power of two")
        return value

    @model_validator(mode="after")
    def _range(self) -> "Focus":
        if self.near_mm >= self.far_mm:
            raise ValueError(f"near_mm {self.near_mm} is not below far_mm {self.far_mm}")
        return self


class Clock(Section):
    """The FPGA's clock."""

    frequency_hz: float = Field(default=125e6, ge=1e6, le=1e9)
    """Frequency of the core; that of each board is in ``vrscan.data.boards``, none has 125 MHz."""


class Mems(Section):
    """The simulated mirror, ``vrscan.scene.mems_mirror``; the instrument does not know it.

    Of a real mirror ``quality``, ``torque`` and ``comb_deg`` tell the host its natural frequency.
    """

    natural_hz: Positive = 248.5
    """Its natural frequency."""
    quality: Positive = 200.0
    """Its quality factor."""
    torque: Positive = 8.52e4
    """S^-2, at a drive level of 0.7."""
    comb_deg: Positive = 8.52
    """Scan angle over which its comb drive pulls."""
    asymmetry: float = 2e-7
    """Constant torque over natural angular frequency squared, rad."""
    diode_deg: Positive = 1.0
    """Half width of the photodiode about the mark."""
    beam_deg: Positive = 0.5
    """Radius of the beam on the photodiode, to 1/e^2."""
    ambient_mw: float = Field(default=0.0, ge=0)
    """Other light on the photodiode, as much as this power of the laser."""
    threshold_share: float = Field(default=0.5, ge=0, lt=1)
    """Threshold / the current of preceding passes; 0 for a fixed one."""
    threshold_mw: Positive = 0.05
    """Least threshold, or the fixed one, in power of the laser."""
    hold_s: Positive = 0.5
    """Time constant of the current that is held from pass to pass."""
    jitter_ns: float = Field(default=1.0, ge=0)
    """Jitter of a crossing, rms."""
    noise_urad: float = Field(default=0.0, ge=0)
    """Noise of the comparator: makes it chatter."""


class Polygon(Section):
    """The simulated polygon, ``vrscan.scene.polygon``; the instrument does not know it.

    The jitter and the width of its diode are those of ``[mems]``.
    """

    facet_urad: float = Field(default=100.0, ge=0)
    """Error of a facet's optical angle, rms."""
    speed_ppm: float = Field(default=10.0, ge=0)
    """Amplitude of the speed's hunting."""
    hunting_hz: Positive = 1.0
    """Frequency of the speed's hunting."""
    spin_up_s: Positive = 0.1
    """Time constant of the speed from rest; that of a real one is longer."""


class Config(Section):
    """The whole configuration, one attribute for each table of the file.

    What is not given is as shipped, or follows from what is.

    Example:
        >>> from vrscan import Config
        >>> config = Config.model_validate({"peak": {"window": "two_pass"}})
        >>> config.peak.window, config.geometry.base_mm
        ('two_pass', 60.0)
    """

    clock: Clock = Clock()
    peak: Peak = Peak()
    geometry: Geometry = Geometry()
    map: Map = Map()
    free: Free = Free()
    mirror: Mirror = Mirror()
    mems: Mems = Mems()
    polygon: Polygon = Polygon()
    line: Line = Line()
    sensor: Sensor = Sensor()
    laser: Laser = Laser()
    focus: Focus = Focus()
    _source: str = PrivateAttr("defaults")

    @model_validator(mode="after")
    def _rate(self) -> "Config":
        if "rate_hz" not in self.line.model_fields_set:
            ratio = self.line.lines_per_period or LINES_PER_PERIOD
            self._follows("line", "rate_hz", ratio * self.mirror.frequency_hz)
            if self.line.late:
                raise ValueError(f"line: {self.line.late}")
        elif self.line.lines_per_period is not None:
            follows = self.line.lines_per_period * self.mirror.frequency_hz
            if not math.isclose(self.line.rate_hz, follows, rel_tol=1e-12):
                raise ValueError(
                    f"line.rate_hz = {self.line.rate_hz:g}: lines_per_period = "
                    f"{self.line.lines_per_period:g} makes it {follows:g}; give one of the two"
                )
        # What only replays lines of another sensor need not say a rate.
        asked = self.line.model_fields_set & {"rate_hz", "lines_per_period"}
        complaint = self.rate_complaint() if asked else ""
        if complaint:
            raise ValueError(complaint)
        return self

    @model_validator(mode="after")
    def _of_sensor(self) -> "Config":
        sensor = self.sensor
        if self.free.far_mm >= self.geometry.range_mm:
            raise ValueError(
                f"free.far_mm = {self.free.far_mm:g}: x and z end at {self.geometry.range_mm:g} mm "
                f"with geometry.unit_mm = {self.geometry.unit_mm}"
            )
        self._follows("geometry", "centre_px", sensor.line_length / 2 - 0.5)
        self._follows("peak", "kappa", (2**sensor.pixel_width - 1) / sensor.full_well_e)
        return self

    def _follows(self, section: str, key: str, value: float) -> None:
        """Give a key that no file has said the value that follows from other sections."""
        before: Section = getattr(self, section)
        if key not in before.model_fields_set:
            after = before.model_copy(update={key: value})
            after.model_fields_set.discard(key)  # it follows in a copy, too
            self.__dict__[section] = after

    @property
    def line_clks(self) -> int:
        """Return the clocks from a line to the next at least: a pixel a clock, behind a gap."""
        return max(self.sensor.line_length + BLANKING_CLKS, self.peak.period_clks)

    @property
    def most_lines_hz(self) -> float:
        """Return the highest line rate at the clock.

        The lines follow the mirror, so the trim of its frequency makes them faster.
        """
        trim = self.mirror.trim_hz / self.mirror.frequency_hz
        return self.clock.frequency_hz / self.line_clks / (1.0 + trim)

    def rate_complaint(self) -> str:
        """Return what is wrong where a line comes before the one ahead of it is done, or ""."""
        if self.line.rate_hz <= self.most_lines_hz:
            return ""
        slow = self.peak.period_clks > self.sensor.line_length + BLANKING_CLKS
        what = f'window = "{self.peak.window}"' if slow else "their readout"
        trim = self.mirror.trim_hz / self.mirror.frequency_hz
        return (
            f"line.rate_hz = {self.line.rate_hz:g}: {self.sensor.line_length} px at "
            f"{1e-6 * self.clock.frequency_hz:g} MHz allow at most "
            f"{math.floor(self.most_lines_hz)} Hz ({what} takes {self.line_clks} clocks, and the "
            f"mirror's trim adds {trim:.1%})"
        )

    @property
    def source(self) -> str:
        """Return the file that this configuration came from, or ``defaults``."""
        return self._source


def presets() -> dict[str, Path]:
    """Return the shipped configurations of other scanners: the file of each name."""
    return {path.stem: path for path in sorted(PRESETS.glob("*.toml"))}


def load(path: Path | None) -> Config:
    """Return the shipped defaults, overridden by a TOML file.

    Args:
        path: The file, the name of a preset, or None for the defaults alone.

    Raises:
        InputError: naming file, key and value, if the file is missing, is not TOML, has an
            unknown key, or a value of the wrong type or out of range.
    """
    if path is None:
        return Config()
    name, known = str(path), presets()
    if path.name == name and not path.suffix and not path.exists() and name not in known:
        raise InputError(
            f"{name}: no such file, nor a preset of {', '.join(known)}{nearest(name, list(known))}"
        )
    config = checked(Config, read_toml(known.get(name, path), name), name)
    config._source = name
    return config


def to_toml(config: Config) -> str:
    """Return a configuration with all its values as TOML, which ``load`` reads back."""
    text = ""
    for name, section in config.model_dump(mode="json", exclude_none=True).items():
        # JSON writes numbers, texts and lists as TOML does.
        text += f"[{name}]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in section.items())
    return text


def read_toml(path: Path, source: str) -> dict[str, object]:
    """Return the tables of a TOML file.

    Args:
        path: The file.
        source: Its name in messages.

    Raises:
        InputError: naming source, if the file cannot be read or is not TOML.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"{source}: {unread(error, path, '.toml')}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{source}: not a TOML file ({error})") from error
    return parsed_toml(text, source)


def parsed_toml(text: str, source: str) -> dict[str, object]:
    """Return the tables of a TOML text, at most ``DEEPEST`` in each other, with 64-bit integers.

    Raises:
        InputError: naming source, if it is another text.
    """
    try:
        values: dict[str, object] = tomllib.loads(text)
    except RecursionError as error:
        raise InputError(f"{source}: tables or lists in more than {DEEPEST} others") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: not a TOML file ({one_line(error)})") from error
    except ValueError as error:  # Python reads no integer of more than 4300 digits
        raise InputError(f"{source}: an integer of more than 64 bits") from error
    level: list[object] = [values]
    for _ in range(DEEPEST):
        inner: list[object] = []
        for each in level:
            inner += (
                each.values() if isinstance(each, dict) else each if isinstance(each, list) else ()
            )
            if isinstance(each, int) and not -(2**63) <= each < 2**63:
                raise InputError(f"{source}: an integer of more than 64 bits ({shown(each)})")
        level = inner
    if level:
        raise InputError(f"{source}: tables or lists in more than {DEEPEST} others")
    return values


def checked(kind: type[File], values: dict[str, object], source: str) -> File:
    """Return the contents of a file as an object of a kind.

    Raises:
        InputError: naming source, key and value of the first fault.
    """
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise InputError(f"{source}: {complaint(error)}") from error


def complaint(error: ValidationError) -> str:
    """Return the first fault of a file in one line, with its key and value."""
    first = error.errors(include_url=False)[0]
    key = ".".join(cut(str(part), 60) for part in first["loc"])
    value = first["input"]
    if first["type"] == "unknown_key":
        own, known = first["ctx"]["key"], first["ctx"]["known"]
        key = f"{key}.{cut(own, 60)}" if key else cut(own, 60)
        return f"unknown key {key} ({shown(value[own])}){nearest(own, known)}"
    if first["type"] == "union_tag_invalid":  # a kind, by which a table is chosen
        context = first["ctx"]
        known = [each.strip("'") for each in context["expected_tags"].split(", ")]
        name = context["discriminator"].strip("'")
        tag = context["tag"]
        return f"{key}.{name} = {shown(tag)}: there is {', '.join(known)}{nearest(tag, known)}"
    what = first["msg"].removeprefix("Value error, ")
    what = what[0].lower() + what[1:]
    if not key:
        return what
    if first["type"] == "literal_error" and isinstance(value, str):
        words = re.findall(r"'([^']*)'", first["ctx"]["expected"])
        what += nearest(value, words)
    given = f" = {shown(value)}" if not isinstance(value, dict) else ""
    return f"{key}{given}: {what}"
