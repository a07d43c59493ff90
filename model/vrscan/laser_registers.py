"""The laser's configuration as the integers that the ports of ``laser_control`` take."""

import math
from dataclasses import dataclass

from vrscan.config import Config
from vrscan.errors import InputError
from vrscan.fixed import pkg
from vrscan.fixed.laser_control import CUT_WIDTH, GAIN_FRACTION, PHASE_WIDTH, WIDTHS
from vrscan.registers import to_register


@dataclass(frozen=True)
class LaserRegisters:
    """Configuration of the laser in integers; formats are those of ``laser_control``.

    ``laser_enable`` is not among them: the light is switched on by whoever wants it.
    """

    laser_limit_power: int
    laser_limit_startup: int
    laser_limit_pulse_clks: int
    laser_limit_drain: int
    laser_limit_bucket: int
    laser_watchdog_clks: int
    laser_adapt: int
    laser_shared: int
    laser_power: int
    laser_power_min: int
    laser_power_max: int
    laser_startup: int
    laser_target: int
    laser_cut: int
    laser_down: int
    laser_up: int
    laser_search: int
    laser_index_begin: int
    laser_index_end: int

    @classmethod
    def from_config(cls, config: Config) -> "LaserRegisters":
        """Return the registers of a configuration: limits rounded down, all else to nearest.

        Raises:
            InputError: naming the key, if a value does not fit in its register, a pulse is longer
                than its limit, or the index is not lit before the beam comes to the mark.
        """
        laser, line, mirror = config.laser, config.line, config.mirror
        clock = config.clock.frequency_hz
        per_mw = laser.power_max / laser.rated_mw

        def fit(key: str, value: float, width: int, fraction: int = 0) -> int:
            return to_register(config.source, f"laser.{key}", value, width, fraction)

        def power(key: str) -> int:
            return fit(key, per_mw * getattr(laser, key), pkg.POWER_WIDTH)

        def limit(key: str, value: float, name: str) -> int:
            # What is a limit to the last digit must not become one less.
            return fit(key, math.floor(value * (1.0 + 1e-12)), WIDTHS.get(name, pkg.POWER_WIDTH))

        if line.pulse_us > laser.limit_pulse_us:
            raise InputError(
                f"{config.source}: line.pulse_us: {line.pulse_us:g} is above "
                f"laser.limit_pulse_us = {laser.limit_pulse_us:g}: every pulse would be cut"
            )
        if laser.index_margin_deg > abs(mirror.index_deg):
            raise InputError(
                f"{config.source}: laser.index_margin_deg: {laser.index_margin_deg:g} is more than "
                f"the mark's {abs(mirror.index_deg):g} degrees"
            )
        # Phase 0 is the largest angle: the beam is beyond the window's edge for a symmetric part.
        edge = (abs(mirror.index_deg) - laser.index_margin_deg) / mirror.amplitude_deg
        half = math.acos(min(edge, 1.0)) / (2.0 * math.pi)
        middle = 0.0 if mirror.index_deg > 0 else 0.5
        one = 1 << PHASE_WIDTH

        joules = 1e-6 * laser.limit_burst_uj
        bucket = joules / (1e-3 * laser.rated_mw) * clock * laser.power_max
        pulse_clks = 1e-6 * laser.limit_pulse_us * clock
        return cls(
            laser_limit_power=limit("limit_power_mw", per_mw * laser.limit_power_mw, "limit_power"),
            laser_limit_startup=limit(
                "limit_startup_mw", per_mw * laser.limit_startup_mw, "limit_startup"
            ),
            laser_limit_pulse_clks=limit("limit_pulse_us", pulse_clks, "limit_pulse_clks"),
            laser_limit_drain=limit(
                "limit_average_mw", per_mw * laser.limit_average_mw, "limit_drain"
            ),
            laser_limit_bucket=limit("limit_burst_uj", bucket, "limit_bucket"),
            laser_watchdog_clks=max(
                limit("watchdog_s", laser.watchdog_s * clock, "watchdog_clks"), 1
            ),
            laser_adapt=int(laser.adapt),
            laser_shared=int(laser.shared),
            laser_power=power("power_mw"),
            laser_power_min=power("min_mw"),
            laser_power_max=power("max_mw"),
            laser_startup=power("startup_mw"),
            laser_target=fit("target", laser.target, pkg.ALIGNED_WIDTH, pkg.ALIGNED_WIDTH),
            laser_cut=fit("cut", laser.cut, CUT_WIDTH, CUT_WIDTH),
            laser_down=fit("down", laser.down, 16, GAIN_FRACTION),
            laser_up=fit("up", laser.up, 16, GAIN_FRACTION),
            laser_search=fit("search", laser.search, CUT_WIDTH, CUT_WIDTH),
            laser_index_begin=math.floor((middle - half) * one) % one,
            laser_index_end=math.ceil((middle + half) * one) % one,
        )
