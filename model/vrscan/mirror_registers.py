"""The mirror's configuration as the integers that the ports of ``mirror_loop`` take."""

import math
from dataclasses import dataclass, fields

from vrscan.config import Config
from vrscan.errors import InputError
from vrscan.fixed import pkg
from vrscan.fixed.amplitude_control import CONFIDENCE_FRACTION
from vrscan.mirror_table import amplitude_table
from vrscan.registers import to_register

TURN = 2.0 * math.pi
INDEX_TIMEOUT = 1.125  # periods: an index mark is missing when it comes later
CONFIDENCE_ONE = 2**pkg.CONFIDENCE_WIDTH - 1
REACQUIRE_TURNS = 1.0 / 64  # a phase error above this is no error of tracking
EXPOSURE_SHARE = 0.9  # of the line period


@dataclass(frozen=True)
class MirrorRegisters:
    """Configuration of the mirror's loop in integers; formats are those of ``vrscan_pkg``.

    ``oversample`` is an elaboration parameter and ``clock_hz`` a property of the board: they travel
    along because the formats depend on them. ``table_amplitude`` and ``table_midpoint`` are written
    through the table's port; everything else is a port.
    """

    clock_hz: float
    oversample: int
    sweep_word: int
    work_word: int
    sweep_rate: int
    duty: int
    sweep_level: int
    sweep_timeout: int
    settle_timeout: int
    lost_timeout: int
    glitch_clks: int
    width_min_clks: int
    width_max_clks: int
    period_max_clks: int
    phase_shift: int
    rate_shift: int
    amplitude_shift: int
    error_limit: int
    amplitude_set: int
    k_p: int
    k_i: int
    level_min: int
    level_max: int
    level_low: int
    level_high: int
    level_nominal: int
    trim_step: int
    trim_gain: int
    trim_min: int
    trim_max: int
    trim_up: int
    settle_limit: int
    shock_limit: int
    phase_limit: int
    settle_count: int
    hold_count: int
    confidence_gain: int
    ratio: int
    exposure_delay_clks: int
    exposure_clks: int
    pulse_delay_clks: int
    pulse_clks: int
    drive_phase: int
    motion_a: tuple[int, ...]
    motion_phi: tuple[int, ...]
    motion_da: tuple[int, ...]
    motion_dphi: tuple[int, ...]
    table_amplitude: tuple[int, ...]
    table_midpoint: tuple[int, ...]

    @classmethod
    def from_config(cls, config: Config) -> "MirrorRegisters":
        """Return the registers of a configuration, each rounded to nearest, half up.

        Raises:
            InputError: naming the key, if a value does not fit in its register, the mark is out of
                the mirror's reach, or the harmonics leave no unique amplitude.
        """
        mirror, line, clock = config.mirror, config.line, config.clock.frequency_hz

        def fit(key: str, value: float, width: int, fraction: int = 0) -> int:
            return to_register(config.source, key, value, width, fraction)

        def size(key: str, value: float, width: int, fraction: int) -> int:
            return to_register(config.source, key, value, width, fraction, signed=True)

        def word(key: str, hertz: float) -> int:
            return fit(key, hertz / clock, pkg.WORD_WIDTH, pkg.TURN_WIDTH)

        def clocks(key: str, seconds: float) -> int:
            return fit(key, seconds * clock, pkg.TIME_WIDTH)

        def level(key: str, value: float) -> int:
            return fit(key, value, pkg.LEVEL_WIDTH, pkg.LEVEL_WIDTH)

        def amplitude(key: str, turns: float) -> int:
            return fit(key, turns, pkg.AMPLITUDE_WIDTH, pkg.AMPLITUDE_FRACTION)

        def in_line(key: str, microseconds: float) -> int:
            return fit(key, microseconds * 1e-6 * clock, pkg.LINE_CLKS_WIDTH)

        if not 0 < abs(mirror.index_deg) < mirror.amplitude_deg:
            raise InputError(
                f"{config.source}: mirror.index_deg: {mirror.index_deg} is not between 0 and the "
                f"amplitude of {mirror.amplitude_deg}: the mirror would never pass the mark"
            )
        turns = mirror.amplitude_deg / 360.0
        period_clks = clock / mirror.frequency_hz
        sweep_word = word("mirror.sweep_span_hz", mirror.frequency_hz + mirror.sweep_span_hz)
        sweep_rate = mirror.sweep_hz_per_s / clock**2 * 2.0**pkg.TURN_WIDTH
        sweep_s = mirror.sweep_span_hz / mirror.sweep_hz_per_s
        # Level steps an amplitude step; the integral term adds up once a period.
        gain = mirror.proportional * mirror.level / turns
        gain *= 2.0 ** (pkg.LEVEL_WIDTH - pkg.AMPLITUDE_FRACTION)
        per_period = 1.0 / (mirror.integral_s * mirror.frequency_hz)
        trim = mirror.trim_hz / clock * 2.0**pkg.TURN_WIDTH
        per_hz = 2.0**pkg.TURN_WIDTH / clock / mirror.frequency_hz  # word steps a period
        step = mirror.trim_hz_per_s * per_hz
        trim_gain = mirror.trim_gain_hz_per_s * per_hz / 2.0**pkg.LEVEL_WIDTH
        shock = amplitude("mirror.shock_ppm", 1e-6 * mirror.shock_ppm * turns)
        # A tracker of second order that does not overshoot: the rate takes a quarter of the phase's
        # share squared.
        shift = mirror.averaging_periods.bit_length() - 1
        rate_shift = round(math.log2(period_clks)) + 2 * shift + 1
        limit_turns = 1e-6 * mirror.phase_limit_urad / TURN
        table = amplitude_table(math.radians(mirror.index_deg), mirror.harmonics)
        pulse_delay = in_line("line.pulse_delay_us", line.pulse_delay_us)
        pulse = in_line("line.pulse_us", line.pulse_us)
        exposure_us = max(EXPOSURE_SHARE * 1e6 / line.rate_hz, line.pulse_delay_us + line.pulse_us)
        return cls(
            clock_hz=clock,
            oversample=mirror.oversample,
            sweep_word=sweep_word,
            work_word=word("mirror.frequency_hz", mirror.frequency_hz),
            sweep_rate=fit("mirror.sweep_hz_per_s", sweep_rate, 32, 16),
            duty=fit("mirror.duty", mirror.duty, 16, 16),
            sweep_level=level("mirror.sweep_level", mirror.sweep_level),
            sweep_timeout=clocks("mirror.sweep_hz_per_s", 2.0 * sweep_s + 1e-3),
            settle_timeout=clocks("mirror.settle_timeout_s", mirror.settle_timeout_s),
            lost_timeout=clocks("mirror.lost_timeout_s", mirror.lost_timeout_s),
            glitch_clks=fit("mirror.glitch_us", max(1.0, mirror.glitch_us * 1e-6 * clock), 8),
            width_min_clks=pkg.MIN_CROSSING,
            width_max_clks=clocks("mirror.frequency_hz", 0.5 / mirror.frequency_hz),
            period_max_clks=clocks("mirror.frequency_hz", INDEX_TIMEOUT / mirror.frequency_hz),
            phase_shift=shift,
            rate_shift=rate_shift,
            amplitude_shift=shift,
            error_limit=fit(
                "mirror.frequency_hz", REACQUIRE_TURNS, pkg.ERROR_WIDTH, pkg.ERROR_WIDTH
            ),
            amplitude_set=amplitude("mirror.amplitude_deg", turns),
            k_p=fit("mirror.proportional", gain, pkg.CONTROL_GAIN_WIDTH, pkg.PROPORTIONAL_FRACTION),
            k_i=fit(
                "mirror.integral_s",
                gain * per_period,
                pkg.CONTROL_GAIN_WIDTH,
                pkg.INTEGRAL_FRACTION,
            ),
            level_min=level("mirror.level_min", mirror.level_min),
            level_max=level("mirror.level_max", mirror.level_max),
            level_low=level("mirror.level_low", mirror.level_low),
            level_high=level("mirror.level_high", mirror.level_high),
            level_nominal=level("mirror.level", mirror.level),
            trim_step=fit("mirror.trim_hz_per_s", step, pkg.TRIM_STEP_WIDTH),
            trim_gain=fit(
                "mirror.trim_gain_hz_per_s",
                trim_gain,
                pkg.CONTROL_GAIN_WIDTH,
                pkg.TRIM_GAIN_FRACTION,
            ),
            trim_min=to_register(
                config.source, "mirror.trim_hz", -trim, pkg.TRIM_WIDTH, signed=True
            ),
            trim_max=to_register(
                config.source, "mirror.trim_hz", trim, pkg.TRIM_WIDTH, signed=True
            ),
            trim_up=int(not mirror.amplitude_falls),
            settle_limit=amplitude("mirror.settle_ppm", 1e-6 * mirror.settle_ppm * turns),
            shock_limit=shock,
            phase_limit=fit(
                "mirror.phase_limit_urad", limit_turns, pkg.ERROR_WIDTH, pkg.ERROR_WIDTH
            ),
            settle_count=mirror.settle_periods,
            hold_count=mirror.hold_periods,
            confidence_gain=fit(
                "mirror.shock_ppm",
                CONFIDENCE_ONE / max(shock, 1),
                pkg.GAIN_WIDTH,
                CONFIDENCE_FRACTION,
            ),
            ratio=fit(
                "line.rate_hz",
                line.rate_hz / mirror.frequency_hz,
                pkg.RATIO_WIDTH,
                pkg.RATIO_FRACTION,
            ),
            exposure_delay_clks=0,
            exposure_clks=in_line("line.rate_hz", exposure_us),
            pulse_delay_clks=pulse_delay,
            pulse_clks=pulse,
            drive_phase=fit(
                "mirror.drive_phase", mirror.drive_phase, pkg.PHASE_WIDTH, pkg.PHASE_WIDTH
            ),
            motion_a=tuple(
                size("mirror.harmonics", a, pkg.MOTION_WIDTH, pkg.MOTION_FRACTION)
                for a, _ in mirror.harmonics
            ),
            motion_phi=tuple(
                math.floor(phi / TURN * 2.0**pkg.PHASE_WIDTH + 0.5) % 2**pkg.PHASE_WIDTH
                for _, phi in mirror.harmonics
            ),
            motion_da=tuple(
                size("mirror.slopes", a, pkg.SLOPE_MOTION_WIDTH, pkg.MOTION_SLOPE_FRACTION)
                for a, _ in mirror.slopes
            ),
            motion_dphi=tuple(
                size("mirror.slopes", phi / TURN, pkg.SLOPE_MOTION_WIDTH, pkg.PHI_SLOPE_FRACTION)
                for _, phi in mirror.slopes
            ),
            table_amplitude=tuple(table[0].tolist()),
            table_midpoint=tuple(table[1].tolist()),
        )


# Ports that hold still, in the order in which the engine takes them.
PORTS = tuple(
    field.name
    for field in fields(MirrorRegisters)
    if field.name not in ("clock_hz", "oversample")
    and not field.name.startswith(("motion_", "table_"))
)
