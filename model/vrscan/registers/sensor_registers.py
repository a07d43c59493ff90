"""The sensor's readout in the configuration as the integers that the registers take."""

from dataclasses import dataclass

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.registers.chain_registers import fit
from vrscan.registers.settings import ReadoutSettings
from vrscan.registers.values import find


@dataclass(frozen=True)
class SensorRegisters(ReadoutSettings):
    """Which exposure a readout belongs to, in integers."""

    @classmethod
    def from_config(cls, config: Config) -> "SensorRegisters":
        """Return the registers of a configuration, each rounded to nearest, half up.

        A window that the configuration does not give is as long as the lag allows at any frequency
        of the drive, from the start of its sweep to the least trim.

        Raises:
            InputError: naming the key, if a value does not fit in its register, or no readout with
                this lag can begin in the window.
        """
        sensor, mirror, line = config.sensor, config.mirror, config.line
        lag, clock_hz = sensor.readout_lag, config.clock.frequency_hz
        trim = mirror.trim_hz / mirror.frequency_hz
        sweep = mirror.sweep_span_hz / mirror.frequency_hz
        least_us = 1e6 * lag / (line.rate_hz * (1.0 + sweep + trim))
        most_us = 1e6 * (lag + 1) / (line.rate_hz * max(1.0 - trim, 0.5))
        for key, time_us, wrong in (
            ("readout_min_us", sensor.readout_min_us, (sensor.readout_min_us or 0.0) > most_us),
            ("readout_max_us", sensor.readout_max_us, (sensor.readout_max_us or 1e9) < least_us),
        ):
            if wrong and time_us is not None:
                raise InputError(
                    f"{config.source}: sensor.{key} = {time_us:g}: that is "
                    f"{1e-6 * time_us * line.rate_hz:.2f} lines behind the exposure, and "
                    f"readout_lag = {lag} is {lag} to {lag + 1}"
                )

        def clocks(name: str, time_us: float | None, default_us: float) -> int:
            if time_us is None:
                return min(round(1e-6 * default_us * clock_hz), find(name).maximum)
            return fit(config.source, f"sensor.{name[:-5]}_us", 1e-6 * time_us * clock_hz, name)

        return cls(
            readout_lag=lag,
            readout_stale=int(sensor.readout_stale),
            readout_min_clks=clocks("readout_min_clks", sensor.readout_min_us, least_us),
            readout_max_clks=clocks("readout_max_clks", sensor.readout_max_us, most_us),
        )
