"""What a configuration writes into a board: every register, at the board's clock."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from scanners import EACH_SCANNER

from vrscan.clocked.register_file import WORD_MASK, WRITABLE, RegisterFile
from vrscan.data import link_pkg
from vrscan.data.config import Config, Mirror, load
from vrscan.data.errors import InputError
from vrscan.registers.load import CONTROLS, settings
from vrscan.registers.mirror_registers import MirrorRegisters
from vrscan.registers.register_map import LOCKS, REGISTERS, WINDOWS


@dataclass(frozen=True)
class Built:
    clock_hz: int = 100_000_000
    line_length: int = 2048
    pixel_width: int = 12
    index_oversample: int = 4


BUILT = Built()
FIELDS = {
    field.name: (window, field) for window in WINDOWS.values() for field in window.fields
}  # fmt: skip


def of(config: Config) -> Built:
    """Return a board for a scanner's sensor, at a clock of its own."""
    own = config.sensor
    return Built(line_length=own.line_length, pixel_width=own.pixel_width)


@EACH_SCANNER
def test_every_register_has_a_value_or_is_a_control(config: Config) -> None:
    written = {name for name, register in REGISTERS.items() if register.access in WRITABLE}
    assert written >= CONTROLS
    values = settings(config, of(config))
    assert set(values) == (written - CONTROLS - set(LOCKS)) | set(FIELDS) - {"map_table_node"}


@EACH_SCANNER
def test_every_value_fits(config: Config) -> None:
    for name, value in settings(config, of(config)).items():
        register = FIELDS[name][1] if name in FIELDS else REGISTERS[name]
        count = FIELDS[name][0].entries if name in FIELDS else register.count
        values = value if isinstance(value, tuple) else (value,)
        assert len(values) == count, name
        assert all(type(v) is int for v in values), name
        assert all(register.minimum <= v <= register.maximum for v in values), name


def test_the_shipped_board_resets_to_what_the_configuration_has_of_the_image() -> None:
    """Those that do not depend on the clock: peak and geometry."""
    values = settings(Config(), BUILT)
    calibrated = [
        register
        for register in REGISTERS.values()
        if register.commit and "motion" not in register.name
    ]
    names = {register.name for register in calibrated} - {"drive_phase", "map_bank"}
    assert {"k_noise", "max_width", "centre", "n0", "e1", "map_enable"} <= names
    for name in names:
        assert REGISTERS[name].reset == (values[name],), name


@EACH_SCANNER
def test_the_clock_is_the_boards(config: Config) -> None:
    """Which need not be the configuration's."""
    clocks = (80_000_000, round(config.clock.frequency_hz))
    slow, fast = (settings(config, replace(of(config), clock_hz=each)) for each in clocks)
    for clock_hz, values in zip(clocks, (slow, fast), strict=True):
        assert values["settle_timeout"] == config.mirror.settle_timeout_s * clock_hz
        assert values["pulse_clks"] == round(1e-6 * config.line.pulse_us * clock_hz)
    ratio = MirrorRegisters.from_config(config).work_word
    assert slow["work_word"] != fast["work_word"] == ratio
    assert slow["k_noise"] == fast["k_noise"]


@EACH_SCANNER
def test_all_of_it_goes_through_the_bus(config: Config) -> None:
    """Written into the twin word by word, each value is in effect."""
    twin = RegisterFile()
    values = settings(config, of(config))

    def write(address: int, data: int) -> None:
        word = data & WORD_MASK
        assert twin.access(link_pkg.ACCESS_WRITE, address, word) == (link_pkg.STATUS_OK, word)

    for name, value in values.items():
        if name in FIELDS:
            continue
        register = REGISTERS[name]
        each = register.words // register.count
        wanted = value if isinstance(value, tuple) else (value,)
        for k in range(register.words):
            write(register.address + k, wanted[k // each] >> (32 * (k % each)))
        assert tuple(twin.values[name]) == wanted
    table = WINDOWS["table"]
    for entry in range(table.entries):
        for field in table.fields:
            column = values[field.name]
            assert isinstance(column, tuple)
            write(table.address + entry * table.stride + field.address, column[entry])
    assert tuple(twin.table("table", "table_midpoint")) == values["table_midpoint"]
    twin.take()
    for name, value in values.items():
        if name not in FIELDS:
            assert tuple(twin.ports()[name]) == (value if isinstance(value, tuple) else (value,))


@pytest.mark.parametrize(
    ("built", "words"),
    [
        (Built(line_length=1024), "sensor.line_length = 2048: the board is built with line_length"),
        (Built(pixel_width=10), "sensor.pixel_width = 12: the board is built with pixel_width"),
        (Built(index_oversample=8), "mirror.oversample = 4: the board is built with index_oversam"),
    ],
)
def test_a_configuration_of_another_board_is_refused(built: Built, words: str) -> None:
    with pytest.raises(InputError) as error:
        settings(Config.model_validate({"mirror": {"oversample": 4}}), built)
    assert str(error.value).startswith(f"defaults: {words}")
    assert "\n" not in str(error.value)


@EACH_SCANNER
def test_the_sampling_is_the_boards_where_the_configuration_says_none(config: Config) -> None:
    built = of(config)
    assert settings(config, replace(built, index_oversample=2)) == settings(config, built)


@EACH_SCANNER
def test_a_window_without_times_is_that_of_its_lag(config: Config) -> None:
    """A readout at any place between two ends is inside, at any frequency of the drive."""
    line_clks, mirror = BUILT.clock_hz / config.line.rate_hz, config.mirror
    slowest = mirror.frequency_hz - mirror.trim_hz
    fastest = mirror.frequency_hz + mirror.sweep_span_hz + mirror.trim_hz
    for lag in range(4):
        own = config.sensor.model_copy(update={"readout_lag": lag, "readout_stale": True})
        values = settings(config.model_copy(update={"sensor": own}), of(config))
        least, most = values["readout_min_clks"], values["readout_max_clks"]
        assert isinstance(least, int) and isinstance(most, int)
        assert (values["readout_lag"], values["readout_stale"]) == (lag, 1)
        assert least <= math.ceil(lag * line_clks * mirror.frequency_hz / fastest)
        assert most >= math.floor((lag + 1) * line_clks * mirror.frequency_hz / slowest)
        # Half a line too early or too late is outside.
        assert least > (lag - 0.5) * line_clks and most < (lag + 1.5) * line_clks


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        ({"readout_min_us": 40.0}, "readout_min_us = 40: that is 1.49 lines behind the exposure"),
        ({"readout_lag": 2, "readout_max_us": 30.0}, "readout_max_us = 30: that is 1.12 lines"),
        (
            {"readout_lag": 2, "readout_max_us": 2e5},
            "readout_max_us: needs a register value of 2e+07",
        ),
    ],
)
def test_a_window_that_the_lag_cannot_meet_is_refused(sensor: dict[str, float], words: str) -> None:
    config = Config.model_validate({"sensor": sensor})
    with pytest.raises(InputError) as error:
        settings(config, BUILT)
    assert str(error.value).startswith(f"defaults: sensor.{words}")


def test_times_of_a_readout_are_taken() -> None:
    config = Config.model_validate({"sensor": {"readout_min_us": 0.1, "readout_max_us": 0.2}})
    values = settings(config, BUILT)
    assert (values["readout_min_clks"], values["readout_max_clks"]) == (10, 20)


def test_complaints_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "scanner.toml"
    path.write_text("[mirror]\nglitch_us = 2.0\n")
    settings(load(path), BUILT)
    with pytest.raises(InputError, match=r"scanner.toml: mirror.glitch_us"):
        settings(load(path), replace(BUILT, clock_hz=200_000_000))


def test_another_configuration_has_other_values() -> None:
    other = settings(Config(mirror=Mirror(level_max=0.9)), BUILT)
    same = settings(Config(), BUILT)
    assert {name for name in same if same[name] != other[name]} == {"level_max"}
