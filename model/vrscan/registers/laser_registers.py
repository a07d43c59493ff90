"""The laser's configuration as the integers that the registers take."""

import math
from dataclasses import dataclass

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.registers.chain_registers import fit
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.settings import LaserSettings

GUARD_SHARE = 1 / 8  # of the time may be lit, for laser_guard


@dataclass(frozen=True)
class LaserRegisters(LaserSettings):
    """Configuration of the laser in integers; formats are those of the registers.

    ``enable`` is 0, because a configuration does not switch the light on.
    """

    @classmethod
    def from_config(cls, config: Config) -> "LaserRegisters":
        """Return the registers of a configuration: limits rounded down, all else to nearest.

        Raises:
            InputError: naming the key, if a value does not fit in its register, a pulse is longer
                than its limit or too much for the guard, the index is not lit before the beam
                comes to the mark, or a polygon's index light reaches into its scan.
        """
        laser, line, mirror = config.laser, config.line, config.mirror
        clock = config.clock.frequency_hz
        per_mw = laser.power_max / laser.rated_mw

        def share(key: str) -> int:
            return fit(config.source, f"laser.{key}", getattr(laser, key), f"laser_{key}")

        def power(key: str, name: str) -> int:
            return fit(config.source, f"laser.{key}", per_mw * getattr(laser, key), name)

        def limit(key: str, value: float, name: str) -> int:
            # A limit that fits to the last digit must not be rounded to one less.
            return fit(config.source, f"laser.{key}", math.floor(value * (1.0 + 1e-12)), name)

        if line.pulse_us > laser.limit_pulse_us:
            raise InputError(
                f"{config.source}: line.pulse_us: {line.pulse_us:g} is above "
                f"laser.limit_pulse_us = {laser.limit_pulse_us:g}: every pulse would be cut"
            )
        if 1e-6 * line.pulse_us * line.rate_hz > GUARD_SHARE:
            raise InputError(
                f"{config.source}: line.pulse_us: {line.pulse_us:g} at {line.rate_hz:g} lines a "
                f"second is light in more than {GUARD_SHARE:g} of the time: the guard would trip"
            )
        # lit_gate closes a polygon's index in each pulse, so its light ends before the scan begins.
        room = abs(mirror.index_deg) - (mirror.reach_deg if mirror.polygon else 0.0)
        if laser.index_margin_deg > room:
            whose = "from the scan to the mark" if mirror.polygon else "of the mark"
            raise InputError(
                f"{config.source}: laser.index_margin_deg: {laser.index_margin_deg:g} is more than "
                f"the {room:g} degrees {whose}"
            )
        if mirror.polygon:
            # The whole diode has to be in the light.
            middle = mirror.facet_phase(mirror.index_deg)
            half = min(laser.index_margin_deg * mirror.facets / 720.0, 0.25)
        else:
            # Phase 0 is the largest angle: the beam is beyond the window's edge for a symmetric
            # part.
            edge = (abs(mirror.index_deg) - laser.index_margin_deg) / mirror.amplitude_deg
            half = math.acos(min(edge, 1.0)) / (2.0 * math.pi)
            middle = 0.0 if mirror.index_deg > 0 else 0.5
        one = 1 << REGISTERS["laser_index_begin"].width

        joules = 1e-6 * laser.limit_burst_uj
        bucket = joules / (1e-3 * laser.rated_mw) * clock * laser.power_max
        pulse_clks = 1e-6 * laser.limit_pulse_us * clock
        return cls(
            enable=0,
            limit_power=limit("limit_power_mw", per_mw * laser.limit_power_mw, "laser_limit_power"),
            limit_startup=limit(
                "limit_startup_mw", per_mw * laser.limit_startup_mw, "laser_limit_startup"
            ),
            limit_pulse_clks=limit("limit_pulse_us", pulse_clks, "laser_limit_pulse_clks"),
            limit_drain=limit(
                "limit_average_mw", per_mw * laser.limit_average_mw, "laser_limit_drain"
            ),
            limit_bucket=limit("limit_burst_uj", bucket, "laser_limit_bucket"),
            watchdog_clks=max(
                limit("watchdog_s", laser.watchdog_s * clock, "laser_watchdog_clks"), 1
            ),
            adapt=int(laser.adapt),
            shared=int(laser.shared),
            power=power("power_mw", "laser_power"),
            power_min=power("min_mw", "laser_power_min"),
            power_max=power("max_mw", "laser_power_max"),
            startup=power("startup_mw", "laser_startup"),
            target=share("target"),
            cut=share("cut"),
            down=share("down"),
            up=share("up"),
            search=share("search"),
            index_begin=math.floor((middle - half) * one) % one,
            index_end=math.ceil((middle + half) * one) % one,
        )
