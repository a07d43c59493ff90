"""LaserRegisters: a configuration in milliwatts and microseconds as the laser's registers."""

import contextlib
import math

import numpy as np
import pytest
from scanners import EACH_RESONANT, EACH_SCANNER, each_scanner

from vrscan.clocked.laser_guard import DUTY_COST
from vrscan.clocked.laser_interlock import BUCKET_MARGIN, Ceilings
from vrscan.clocked.mirror_drive import DUTY_CEILING, DUTY_WIDTH, LEVEL_CEILING
from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.ideal.motion import motion
from vrscan.registers.laser_registers import GUARD_SHARE, LaserRegisters
from vrscan.registers.mirror_registers import MOST_DUTY, MOST_LEVEL, MirrorRegisters


def registers(section: str, **values: float) -> LaserRegisters:
    """Return the registers of the defaults but for some values."""
    return LaserRegisters.from_config(Config.model_validate({section: values}))


@EACH_SCANNER
def test_shipped_limits_are_within_the_ceilings(config: Config) -> None:
    """No limit that a host reads back is more than what holds, and pulses get through."""
    shipped, ceilings = LaserRegisters.from_config(config), Ceilings()
    assert shipped.limit_power <= ceilings.power
    assert shipped.limit_startup <= ceilings.startup
    assert shipped.limit_pulse_clks <= ceilings.pulse_clks
    assert shipped.limit_drain <= ceilings.drain
    assert BUCKET_MARGIN < shipped.limit_bucket <= ceilings.bucket
    assert 0 < shipped.watchdog_clks <= ceilings.watchdog_clks
    assert shipped.startup - shipped.limit_startup <= 1


@EACH_SCANNER
def test_the_shipped_line_is_within_its_limits(config: Config) -> None:
    """At full power on every line the bucket never fills."""
    shipped = LaserRegisters.from_config(config)
    pulse_clks = config.line.pulse_us * 1e-6 * config.clock.frequency_hz
    line_clks = config.clock.frequency_hz / config.line.rate_hz
    assert shipped.power_max * pulse_clks / line_clks < shipped.limit_drain


def test_limits_are_rounded_down() -> None:
    """Half a step more than a register can say is not granted; a whole one is."""
    step_mw = 50.0 / 65_535
    assert registers("laser", limit_power_mw=99.5 * step_mw).limit_power == 99
    assert registers("laser", limit_power_mw=100 * step_mw).limit_power == 100
    assert registers("laser", power_mw=99.6 * step_mw).power == 100
    assert registers("laser", watchdog_s=1e-12).watchdog_clks == 1


@EACH_SCANNER
def test_energy_and_average_are_of_the_same_light(config: Config) -> None:
    """A bucket's power times clocks, and a drain's power, in joules and watts."""
    shipped = LaserRegisters.from_config(config)
    watts = 0.05 / 65_535
    second = config.clock.frequency_hz
    assert math.isclose(shipped.limit_bucket * watts / second, 1e-6, rel_tol=1e-6)
    assert math.isclose(shipped.limit_drain * watts, 2.5e-3, rel_tol=1e-3)


@EACH_RESONANT
@pytest.mark.parametrize("index_deg", [17.0, -17.0])
@pytest.mark.parametrize("margin_deg", [0.0, 2.0, 17.0])
def test_the_index_is_lit_beyond_its_margin(
    index_deg: float, margin_deg: float, config: Config
) -> None:
    """The window's phases are those at which the beam is that far out, on the mark's side.

    Those of a polygon are on both sides of the mark: ``test_a_polygon_lights_its_whole_diode``.
    """
    config = config.model_copy(
        update={
            "mirror": config.mirror.model_copy(update={"index_deg": index_deg}),
            "laser": config.laser.model_copy(update={"index_margin_deg": margin_deg}),
        }
    )
    found = LaserRegisters.from_config(config)
    phase = np.arange(0, 1 << 16)
    inside = (phase - found.index_begin) % 65536 < (found.index_end - found.index_begin) % 65536
    angle = np.degrees(
        motion(
            phase / 65536,
            math.radians(config.mirror.amplitude_deg),
            np.array(config.mirror.harmonics),
        )
    )
    outside = angle * np.sign(index_deg) > abs(index_deg) - margin_deg
    # The harmonics, which the window leaves out, move the angle by a fraction of a degree.
    far = np.abs(angle * np.sign(index_deg) - (abs(index_deg) - margin_deg)) > 0.2
    assert np.array_equal(inside[far], outside[far])


@each_scanner(lambda config: config.mirror.polygon)
def test_a_polygon_lights_its_whole_diode(config: Config) -> None:
    """The window's phases are those at which the beam is within the margin of the mark."""
    found, mirror = LaserRegisters.from_config(config), config.mirror
    phase = np.arange(0, 1 << 16)
    inside = (phase - found.index_begin) % 65536 < (found.index_end - found.index_begin) % 65536
    angle = (0.5 - phase / 65536) * 720.0 / mirror.facets
    off = np.abs(angle - mirror.index_deg) - config.laser.index_margin_deg
    far = np.abs(off) > 720.0 / mirror.facets / 65536  # of an end, which is rounded outwards
    assert np.array_equal(inside[far], off[far] < 0.0)
    assert config.laser.index_margin_deg >= config.mems.diode_deg


@pytest.mark.parametrize(
    ("section", "values", "key"),
    [
        ("line", {"pulse_us": 2.1}, "pulse_us"),
        ("laser", {"limit_power_mw": 50.1}, "limit_power_mw"),
        ("laser", {"max_mw": 51.0}, "max_mw"),
        ("laser", {"index_margin_deg": 17.1}, "index_margin_deg"),
        ("laser", {"watchdog_s": 40.0}, "watchdog_s"),
        ("laser", {"limit_burst_uj": 30.0}, "limit_burst_uj"),
    ],
)
def test_what_does_not_fit_is_named(section: str, values: dict[str, float], key: str) -> None:
    """In one line with the key."""
    with pytest.raises(InputError, match=key):
        registers(section, **values)


@each_scanner(lambda config: config.mirror.polygon)
def test_a_polygon_has_no_pulses_in_its_index_light(config: Config) -> None:
    """The longest light that is taken ends where the scan begins; a longer one is refused."""
    most = abs(config.mirror.index_deg) - config.mirror.reach_deg
    for margin_deg, good in ((most, True), (most + 0.01, False)):
        laser = config.laser.model_copy(update={"index_margin_deg": margin_deg})
        with contextlib.nullcontext() if good else pytest.raises(InputError, match="to the mark"):
            own = config.model_copy(update={"laser": laser})
            found, mirror = LaserRegisters.from_config(own), MirrorRegisters.from_config(own)
            phase = np.arange(1 << 16)
            index = (phase - found.index_begin) % 65536 < found.index_end - found.index_begin
            scan = (phase - mirror.scan_begin) % 65536 < mirror.scan_span
            assert index.any() and scan.any() and (index & scan).sum() <= 1


def test_a_pulse_that_the_guard_would_end_is_refused() -> None:
    """An eighth of the time is the guard's own number."""
    assert 1 / (1 + DUTY_COST) == GUARD_SHARE
    for pulse_us, good in ((3.3, True), (3.4, False)):
        text = {"line": {"pulse_us": pulse_us}, "laser": {"limit_pulse_us": 5.0}}
        config = Config.model_validate(text)
        with contextlib.nullcontext() if good else pytest.raises(InputError, match="guard"):
            LaserRegisters.from_config(config)


@pytest.mark.parametrize(("key", "value"), [("duty", 0.51), ("sweep_level", 0.9995)])
def test_a_drive_above_its_ceiling_is_refused(key: str, value: float) -> None:
    """The configuration's numbers are mirror_drive's."""
    assert round(MOST_LEVEL * 2**pkg.LEVEL_WIDTH) == LEVEL_CEILING
    assert MOST_DUTY * 2**DUTY_WIDTH == DUTY_CEILING
    with pytest.raises(InputError, match=key):
        MirrorRegisters.from_config(Config.model_validate({"mirror": {key: value}}))
