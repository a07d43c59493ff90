"""A configuration as text: the same one comes back, and each value has its unit and range."""

import re
from pathlib import Path

import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config, Peak, Sensor, load
from vrscan.data.config_text import FOLLOWS, text


def again(folder: Path, written: str) -> Config:
    path = folder / "written.toml"
    path.write_text(written)
    return load(path)


@EACH_SCANNER
@pytest.mark.parametrize("chosen", [False, True])
def test_what_is_written_is_read_as_the_same(tmp_path: Path, config: Config, chosen: bool) -> None:
    back = again(tmp_path, text(config, chosen=chosen))
    assert back.model_dump() == config.model_dump()
    for section, key in FOLLOWS:  # what followed follows again
        sides = (getattr(each, section).model_fields_set for each in (config, back))
        assert len({key in side for side in sides}) == 1, key


@pytest.mark.parametrize("name", Config.model_fields)
def test_every_value_has_a_meaning(name: str) -> None:
    section = type(getattr(Config(), name))
    assert [key for key, field in section.model_fields.items() if not field.description] == []


@EACH_SCANNER
def test_every_value_is_there_and_can_be_changed(tmp_path: Path, config: Config) -> None:
    written = text(config)
    for name, section in config:
        keys = type(section).model_fields
        block = re.search(rf"^\[{name}\]\n(.*?)(?:\n\n|\Z)", written, re.DOTALL | re.MULTILINE)
        assert block is not None
        assert re.findall(r"^(?:# )?(\w+) =", block[1], re.MULTILINE) == list(keys)
    shorter = written.replace(f"line_length = {config.sensor.line_length}", "line_length = 512")
    assert again(tmp_path, shorter).geometry.centre_px == 255.5  # in a comment, so it follows


def test_ranges_and_units_are_those_that_are_checked() -> None:
    written = text(Config(sensor=Sensor(saturation_level=4000), peak=Peak(kappa=0.25)))
    for lines in (
        "# Bits of a pixel; >= 8, <= 16\npixel_width = 12\n",
        "# Distance of lens and mirror; mm; > 0\nbase_mm = 60.0\n",
        "# Averaging of phase and amplitude; periods; 1 | 2 | 4 | 8 | 16\naveraging_periods = 2\n",
        "\nsaturation_level = 4000\n",
        "\nkappa = 0.25\n",
        "; us; >= 0\n# readout_min_us =\n",
    ):
        assert lines in written, lines
    assert max(map(len, re.findall(r"^# .*$", written, re.MULTILINE))) <= 400
