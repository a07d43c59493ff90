"""The mirror's configuration as the integers that the registers take."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.registers.chain_registers import CONFIDENCE_ONE, fit
from vrscan.registers.mirror_table import amplitude_table, pulse_table
from vrscan.registers.settings import (
    AmplitudeSettings,
    DriveSettings,
    IndexSettings,
    MotionSettings,
    PhaseSettings,
    ScanSettings,
    TriggerSettings,
)

TURN = 2.0 * math.pi
INDEX_TIMEOUT = 1.125  # periods: an index mark is missing when it comes later
REACQUIRE_TURNS = 1.0 / 64  # a larger phase error is not an error of tracking
EXPOSURE_SHARE = 0.9  # exposure over the line period
MOST_DUTY, MOST_LEVEL = 0.5, 0.999  # ceilings of mirror_drive


@dataclass(frozen=True)
class MirrorRegisters(
    IndexSettings,
    PhaseSettings,
    AmplitudeSettings,
    DriveSettings,
    TriggerSettings,
    MotionSettings,
    ScanSettings,
):
    """Configuration of the mirror's loop in integers; formats are those of the registers.

    ``oversample`` is an elaboration parameter and ``clock_hz`` a property of the board. They are
    included because the formats depend on them.
    """

    clock_hz: float
    oversample: int
    table_amplitude: tuple[int, ...]
    table_midpoint: tuple[int, ...]

    @classmethod
    def from_config(cls, config: Config) -> "MirrorRegisters":
        """Return the registers of a configuration, each rounded to nearest, half up.

        Raises:
            InputError: naming the key, if a value does not fit in its register or is above a
                ceiling of the drive, the mark is out of the mirror's reach, or the harmonics leave
                no unique amplitude.
        """
        mirror, line, clock = config.mirror, config.line, config.clock.frequency_hz

        def put(name: str, key: str, value: float) -> int:
            return fit(config.source, key, value, name)

        def clocks(name: str, key: str, seconds: float) -> int:
            return put(name, key, seconds * clock)

        def same(name: str) -> int:
            """Return a register that has the name, and the unit, of its key."""
            return put(name, f"mirror.{name}", getattr(mirror, name))

        if not mirror.polygon and not 0 < abs(mirror.index_deg) < mirror.amplitude_deg:
            raise InputError(
                f"{config.source}: mirror.index_deg: {mirror.index_deg} is not between 0 and the "
                f"amplitude of {mirror.amplitude_deg}: the mirror would never pass the mark"
            )
        turns = mirror.amplitude_deg / 360.0
        period_clks = clock / mirror.frequency_hz
        sweep_rate = mirror.sweep_hz_per_s / clock**2 * 2.0 ** (pkg.TURN_WIDTH + 16)
        sweep_s = mirror.sweep_span_hz / mirror.sweep_hz_per_s
        # Level steps per amplitude step; the integral term is added once per period.
        gain = mirror.proportional * mirror.level / turns
        gain *= 2.0 ** (pkg.LEVEL_WIDTH - pkg.AMPLITUDE_FRACTION)
        per_period = 1.0 / (mirror.integral_s * mirror.frequency_hz)
        trim = mirror.trim_hz / clock
        per_hz = 2.0**pkg.TURN_WIDTH / clock / mirror.frequency_hz  # word steps a period for 1 Hz/s
        step = mirror.trim_hz_per_s * per_hz
        trim_gain = mirror.trim_gain_hz_per_s * per_hz / 2.0**pkg.LEVEL_WIDTH
        shock = put("shock_limit", "mirror.shock_ppm", 1e-6 * mirror.shock_ppm * turns)
        # A second-order tracker that does not overshoot: the share of the rate is a quarter of the
        # square of the phase's share.
        shift = mirror.averaging_periods.bit_length() - 1
        rate_shift = round(math.log2(period_clks)) + 2 * shift + 1
        if mirror.polygon:
            # A facet begins at its own start of scan, so its phase is taken whole, and its error
            # is gone. The speed is the polygon's, and only slowly another one.
            rate_shift, shift = rate_shift - shift, 0
            table = pulse_table(mirror.facet_phase(mirror.index_deg), turns)
            begin, span = mirror.facet_phase(mirror.reach_deg), 2 * mirror.reach_deg / 720
            span *= mirror.facets
        else:
            table = amplitude_table(math.radians(mirror.index_deg), mirror.harmonics)
            begin, span = 0.0, 1.0 - 2.0**-16
        exposure_us = max(EXPOSURE_SHARE * 1e6 / line.rate_hz, line.pulse_delay_us + line.pulse_us)

        def harmonics(name: str, key: str, values: Iterable[float]) -> tuple[int, ...]:
            return tuple(put(name, f"mirror.{key}", value) for value in values)

        for key, most in (
            ("duty", MOST_DUTY),
            ("sweep_level", MOST_LEVEL),
            ("level_max", MOST_LEVEL),
        ):
            if getattr(mirror, key) > most:
                raise InputError(
                    f"{config.source}: mirror.{key}: {getattr(mirror, key):g} is above {most:g}, "
                    "the ceiling of the drive"
                )
        return cls(
            clock_hz=clock,
            oversample=mirror.oversample,
            sweep_word=put(
                "sweep_word",
                "mirror.sweep_span_hz",
                (mirror.frequency_hz + mirror.sweep_span_hz) / clock,
            ),
            work_word=put("work_word", "mirror.frequency_hz", mirror.frequency_hz / clock),
            sweep_rate=put("sweep_rate", "mirror.sweep_hz_per_s", sweep_rate),
            duty=same("duty"),
            sweep_level=same("sweep_level"),
            sweep_timeout=clocks("sweep_timeout", "mirror.sweep_hz_per_s", 2.0 * sweep_s + 1e-3),
            settle_timeout=clocks(
                "settle_timeout", "mirror.settle_timeout_s", mirror.settle_timeout_s
            ),
            lost_timeout=clocks("lost_timeout", "mirror.lost_timeout_s", mirror.lost_timeout_s),
            glitch_clks=put(
                "glitch_clks", "mirror.glitch_us", max(1.0, mirror.glitch_us * 1e-6 * clock)
            ),
            width_min_clks=pkg.MIN_CROSSING,
            width_max_clks=clocks(
                "width_max_clks", "mirror.frequency_hz", 0.5 / mirror.frequency_hz
            ),
            period_max_clks=clocks(
                "period_max_clks", "mirror.frequency_hz", INDEX_TIMEOUT / mirror.frequency_hz
            ),
            phase_shift=shift,
            rate_shift=rate_shift,
            amplitude_shift=shift,
            error_limit=put("error_limit", "mirror.frequency_hz", REACQUIRE_TURNS),
            amplitude_set=put("amplitude_set", "mirror.amplitude_deg", turns),
            k_p=put("k_p", "mirror.proportional", gain),
            k_i=put("k_i", "mirror.integral_s", gain * per_period),
            level_min=same("level_min"),
            level_max=same("level_max"),
            level_low=same("level_low"),
            level_high=same("level_high"),
            level_nominal=put("level_nominal", "mirror.level", mirror.level),
            trim_step=put("trim_step", "mirror.trim_hz_per_s", step),
            trim_gain=put("trim_gain", "mirror.trim_gain_hz_per_s", trim_gain),
            trim_min=put("trim_min", "mirror.trim_hz", -trim),
            trim_max=put("trim_max", "mirror.trim_hz", trim),
            trim_up=int(not mirror.amplitude_falls),
            settle_limit=put("settle_limit", "mirror.settle_ppm", 1e-6 * mirror.settle_ppm * turns),
            shock_limit=shock,
            phase_limit=put(
                "phase_limit",
                "mirror.phase_limit_urad",
                1e-6 * mirror.phase_limit_urad / TURN,
            ),
            settle_count=mirror.settle_periods,
            hold_count=mirror.hold_periods,
            confidence_gain=put(
                "confidence_gain", "mirror.shock_ppm", CONFIDENCE_ONE / max(shock, 1)
            ),
            ratio=put("ratio", "line.rate_hz", line.rate_hz / mirror.frequency_hz),
            exposure_delay_clks=0,
            exposure_clks=clocks("exposure_clks", "line.rate_hz", 1e-6 * exposure_us),
            pulse_delay_clks=clocks(
                "pulse_delay_clks", "line.pulse_delay_us", 1e-6 * line.pulse_delay_us
            ),
            pulse_clks=clocks("pulse_clks", "line.pulse_us", 1e-6 * line.pulse_us),
            drive_phase=same("drive_phase"),
            motion_a=harmonics("motion_a", "harmonics", (a for a, _ in mirror.harmonics)),
            motion_phi=tuple(
                math.floor(phi / TURN * 2.0**pkg.PHASE_WIDTH + 0.5) % 2**pkg.PHASE_WIDTH
                for _, phi in mirror.harmonics
            ),
            motion_da=harmonics("motion_da", "slopes", (a for a, _ in mirror.slopes)),
            motion_dphi=harmonics(
                "motion_dphi", "slopes", (phi / TURN for _, phi in mirror.slopes)
            ),
            scan_facet=int(mirror.polygon),
            scan_begin=put("scan_begin", "mirror.reach_deg", begin),
            scan_span=put("scan_span", "mirror.reach_deg", span),
            table_amplitude=tuple(table[0].tolist()),
            table_midpoint=tuple(table[1].tolist()),
        )
