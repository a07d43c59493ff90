"""Lines from a logic analyser: pins that carry known lines, as samples and as changes."""

from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.line_files import read as read_lines
from vrscan.data.line_signals import read

LENGTH = 64
LINES = np.random.default_rng(6).integers(0, 4096, (4, LENGTH)).astype(np.uint16)


def pins(lines: np.ndarray) -> np.ndarray:
    """Return clock, valid and pixel at each half period, as a sensor drives them."""
    rows: list[tuple[int, int, int]] = []
    for line in lines:
        for valid, pixel in [(0, 4095)] * 5 + [(1, int(each)) for each in line]:
            rows += [(0, valid, pixel), (1, valid, pixel)]
    rows += [(0, 0, 0), (1, 0, 0)] * 5
    return np.array(rows)


def table(samples: np.ndarray, form: str, only_changes: bool) -> str:
    rows = []
    for k, (clock, valid, pixel) in enumerate(samples.tolist()):
        if only_changes and k and (samples[k] == samples[k - 1]).all():
            continue
        if form == "bits":
            words = ",".join(str(pixel >> b & 1) for b in range(12))
        else:
            words = f"{pixel:#x}" if form == "hex" else str(pixel)
        rows.append(f"{k * 6.25e-9},{clock},{valid},{words}")
    names = (
        ",".join(f"sensor_pixel_i[{b}]" for b in range(12)) if form == "bits" else "Sensor_Pixel"
    )
    return f"; of an analyser\nTime [s], sensor_clk_i,sensor_valid,{names}\n" + "\n".join(rows)


@pytest.mark.parametrize("form", ["bits", "hex", "decimal"])
@pytest.mark.parametrize("only_changes", [False, True])
def test_lines_are_read_from_the_pins(form: str, only_changes: bool, tmp_path: Path) -> None:
    path = tmp_path / "pins.csv"
    samples = np.repeat(pins(LINES), 2, axis=0)  # an analyser is faster than the clock
    path.write_text(table(samples, form, only_changes))
    assert np.array_equal(read(path, LENGTH), LINES)


def test_lines_that_the_recording_cuts_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "pins.csv"
    samples = pins(LINES)
    path.write_text(table(samples[40 : -2 * 5 - 20], "hex", False))
    assert np.array_equal(read(path, LENGTH), LINES[1:3])


@EACH_SCANNER
@pytest.mark.filterwarnings("ignore::vrscan.data.errors.InputWarning")
def test_a_recording_of_pins_is_a_file_of_lines(tmp_path: Path, config: Config) -> None:
    path, sensor = tmp_path / "pins.csv", config.sensor
    lines = np.tile(LINES >> 12 - sensor.pixel_width, sensor.line_length // LENGTH)
    path.write_text(table(pins(lines), "hex", True))
    found = read_lines(path, config)
    assert np.array_equal(found.lines, lines)


HEAD = "sensor_clk,sensor_valid,sensor_pixel\n"
WRONG = {
    "": ["no column sensor_clk", "has none"],
    "time_s,d0,d1\n0,1,1\n": ["no column sensor_clk", "d0"],
    "line,x_mm,y_mm,z_mm\n0,1,0,2\n": ["holds points, not lines"],
    HEAD: ["no whole line"],
    HEAD + "0,0,1\n1,2,1\n": ["line 3", "sensor_valid '2'"],
    HEAD + "0,0,1\n1,1\n": ["line 3: 2 fields, want 3"],
    HEAD + "0,0,1\n1,1,-4\n": ["line 3", "sensor_pixel '-4'"],
    HEAD + "0,0,70000\n1,1,70000\n0,0,0\n": ["more than 16 bits"],
    HEAD + "0,0,1\n1,0,1\n0,1,1\n1,1,1\n0,0,1\n1,0,1\n": ["line 5", "1 px until", "want 64"],
    "sensor_clk,sensor_valid,sensor_pixel[1]\n0,0,1\n": ["bits of sensor_pixel are missing"],
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "pins.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read(path, LENGTH)
    message = str(caught.value)
    assert "\n" not in message
    for part in [str(path), *WRONG[text]]:
        assert part in message, message
