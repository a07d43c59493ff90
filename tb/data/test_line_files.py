"""Recorded lines: what is read and how what is not is refused, and what is written."""

import io
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scanners import EACH_SCANNER, SCANNERS

from vrscan.data.config import Config
from vrscan.data.errors import InputError, InputWarning
from vrscan.data.line_files import read

DEFAULT = SCANNERS["default"]
ANGLES = np.zeros(3)


def good(config: Config) -> np.ndarray:
    """Return three lines of a scanner's sensor, whose brightest pixels are at full scale."""
    lines = np.full((3, config.sensor.line_length), 60, np.uint16)
    lines[:, 1000:1008] = 2**config.sensor.pixel_width - 1
    return lines


@EACH_SCANNER
def test_an_array_alone_has_angle_zero_and_full_power(tmp_path: Path, config: Config) -> None:
    path = tmp_path / "lines.npy"
    np.save(path, good(config))
    with pytest.warns(InputWarning) as told:
        recording = read(path, config)
    assert [str(each.message) for each in told] == [
        f"{path}: no angle_rad: every line is taken at angle 0, so every x is 0 "
        "(an .npz takes angle_rad [n] beside lines, --angles a file of them)"
    ]
    assert np.array_equal(recording.lines, good(config))
    assert recording.angle_rad.tolist() == [0.0] * 3
    assert recording.power.tolist() == [65_535] * 3
    assert recording.mirror_flags.tolist() == [0] * 3


@EACH_SCANNER
@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_brings_angles_and_may_hold_more(
    tmp_path: Path, save: Any, config: Config
) -> None:
    path = tmp_path / "lines.npz"
    angle = np.array([-0.1, 0.0, np.pi])
    big_endian = good(config).astype(">u2")
    power, raised = np.array([1, 2, 3], np.uint16), np.array([7, 0, 4], np.uint8)
    save(path, lines=big_endian, angle_rad=angle, power=power, mirror_flags=raised, more="text")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording = read(path, config)
    assert recording.lines.dtype == np.uint16
    assert np.array_equal(recording.lines, good(config))
    assert np.array_equal(recording.angle_rad, angle)
    assert recording.power.tolist() == [1, 2, 3]
    assert recording.mirror_flags.tolist() == [7, 0, 4]


MISSPELT = {
    "angle_rad": ["angle_deg", "angle", "scan_angle", "Angle_rad", "angles_rad", "angel_rad"],
    "power": ["Power", "laser_power", "pwer"],
    "mirror_flags": ["flags", "mirror_flag", "mirro_flags"],
}


@pytest.mark.parametrize(("meant", "name"), [(k, name) for k in MISSPELT for name in MISSPELT[k]])
def test_a_misspelt_name_is_told(tmp_path: Path, meant: str, name: str) -> None:
    known = {"lines": good(DEFAULT), "angle_rad": ANGLES}
    known.pop(meant, None)
    path = tmp_path / "lines.npz"
    np.savez(path, **known, **{name: ANGLES})
    refused(path, [f"no array named {meant}, but {name!r}", "known are lines, angle_rad, power"])


def test_other_arrays_are_ignored_and_so_is_a_likely_name_beside_the_right_one(
    tmp_path: Path,
) -> None:
    others = dict.fromkeys(("angle_deg", "height_mm", "range_mm", "number"), ANGLES)
    path = tmp_path / "lines.npz"
    np.savez(path, lines=good(DEFAULT), angle_rad=ANGLES + 0.5, **others)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording = read(path, DEFAULT)
    assert recording.angle_rad.tolist() == [0.5] * 3


def bad_archives(config: Config) -> dict[str, tuple[dict[str, Any], list[str]]]:
    """Return arrays that are no lines of a scanner, and words of what is wrong with them."""
    lines, length = good(config), config.sensor.line_length
    width, top = str(length), 2**config.sensor.pixel_width - 1
    bright = lines.copy()
    bright[2, 7] = top + 1
    return {
        "no_lines": ({"rows": lines}, ["no array named lines", "has 'rows'"]),
        "a_number": ({"lines": np.uint16(3)}, [width, "()"]),
        "wide": ({"lines": bright.astype(np.uint32)}, [str(top), str(top + 1), "line 2"]),
        "negative": ({"lines": -1 - lines.astype(int)}, ["whole number from 0", "line 0"]),
        "floating": ({"lines": lines + 0.25}, ["whole number from 0", ".25 at line 0, pixel 0"]),
        "truth": ({"lines": lines > 60}, ["whole numbers", "bool"]),
        "objects": ({"lines": lines.astype(object)}, ["plain numbers"]),
        "short_lines": ({"lines": lines[:, :-1]}, [width, f"(3, {length - 1})"]),
        "long_lines": (
            {"lines": np.zeros((3, length + 1), np.uint16)},
            [width, f"(3, {length + 1})"],
        ),
        "one_line": ({"lines": lines[0]}, [width, f"({length},)"]),
        "three_axes": ({"lines": lines[None]}, [f"(1, 3, {length})"]),
        "no_rows": ({"lines": lines[:0]}, ["no lines", f"(0, {length})"]),
        "bright_pixel": ({"lines": bright}, [str(top), str(top + 1), "line 2", "pixel 7"]),
        "nan_angle": (
            {"lines": lines, "angle_rad": np.array([0.0, np.nan, 0.0])},
            ["nan", "line 1"],
        ),
        "infinite_angle": (
            {"lines": lines, "angle_rad": np.array([0.0, 0.0, np.inf])},
            ["inf", "line 2"],
        ),
        "large_angle": ({"lines": lines, "angle_rad": ANGLES - 3.15}, ["-3.15", "line 0"]),
        "few_angles": ({"lines": lines, "angle_rad": ANGLES[:2]}, ["(3,)", "(2,)"]),
        "integer_angles": ({"lines": lines, "angle_rad": np.zeros(3, int)}, ["angle_rad", "int64"]),
        "text_angles": ({"lines": lines, "angle_rad": np.array(["a"] * 3)}, ["angle_rad", "<U1"]),
        "floating_power": ({"lines": lines, "power": ANGLES + 0.5}, ["power", "whole"]),
        "negative_power": (
            {"lines": lines, "power": np.array([1, -2, 3])},
            ["power", "-2 at line 1"],
        ),
        "large_power": (
            {"lines": lines, "power": np.full(3, 70_000, np.uint32)},
            ["power", "70000"],
        ),
        "floating_flags": (
            {"lines": lines, "mirror_flags": ANGLES + 0.5},
            ["mirror_flags", "whole"],
        ),
        "infinite_time": (
            {"lines": lines, "time_s": np.array([0.0, np.inf, 1.0])},
            ["time_s", "line 1"],
        ),
        "nan_y": ({"lines": lines, "y_mm": np.array([0.0, 1.0, np.nan])}, ["y_mm", "line 2"]),
        "few_times": ({"lines": lines, "time_s": ANGLES[:2]}, ["time_s", "(3,)", "(2,)"]),
        "few_flags": (
            {"lines": lines, "mirror_flags": np.zeros(2, np.uint8)},
            ["mirror_flags", "(3,)", "(2,)"],
        ),
        "large_flag": (
            {"lines": lines, "mirror_flags": np.array([7, 8, 9], np.uint8)},
            ["mirror_flags outside 0 to 7", "8 at line 1"],
        ),
    }


BAD_ARCHIVES = list(bad_archives(DEFAULT))


def refused(path: Path, wanted: list[str], config: Config = DEFAULT) -> None:
    with pytest.raises(InputError) as caught:
        read(path, config)
    message = str(caught.value)
    assert "\n" not in message
    for part in [str(path), *wanted]:
        assert part in message, message


@EACH_SCANNER
@pytest.mark.parametrize("name", BAD_ARCHIVES)
def test_a_bad_archive_is_one_line_that_names_the_value(
    tmp_path: Path, name: str, config: Config
) -> None:
    arrays, wanted = bad_archives(config)[name]
    path = tmp_path / "lines.npz"
    np.savez(path, **arrays)
    refused(path, wanted, config)


# The types of arrays that other programs write, as numpy names them.
KINDS = ["<u2", ">u2", "i1", "<i2", ">i4", "<u4", "<i8", "<u8", ">f4", "<f8", "<f2"]


@pytest.mark.filterwarnings("ignore::vrscan.data.errors.InputWarning")
@pytest.mark.parametrize("kind", ["u1", *KINDS])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_the_type_of_an_array_does_not_matter_where_its_values_fit(
    tmp_path: Path, kind: str, order: Any, version: tuple[int, int]
) -> None:
    lines = good(DEFAULT) // (40 if "1" in kind else 2)  # float16 has 11 bits
    path = tmp_path / "lines.npy"
    with path.open("wb") as file:
        array = np.asarray(lines.astype(kind), order=order)
        np.lib.format.write_array(file, array, version=version)
    found = read(path, DEFAULT).lines
    assert found.dtype == np.uint16
    assert np.array_equal(found, lines)


def test_powers_and_flags_may_be_whole_floats(tmp_path: Path) -> None:
    path = tmp_path / "lines.npz"
    more = {"power": np.array([1.0, 2.0, 65535.0]), "mirror_flags": np.array([0.0, 7.0, 1.0])}
    np.savez(path, lines=good(DEFAULT), angle_rad=ANGLES, **more)
    found = read(path, DEFAULT)
    assert (found.power.tolist(), found.mirror_flags.tolist()) == ([1, 2, 65535], [0, 7, 1])


@pytest.mark.parametrize("shape", [(2**40, 2048), (2**40,), (3, 2**50), (2**70, 2048)])
@pytest.mark.parametrize("packed", [False, True])
def test_a_header_without_its_rows_is_one_line(
    tmp_path: Path, shape: tuple[int, ...], packed: bool
) -> None:
    array = io.BytesIO()
    header = {"descr": "<u2", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(array, header)
    path = tmp_path / "lines.npz"
    path.write_bytes(array.getvalue())
    if packed:
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("lines.npy", array.getvalue())
    refused(path, ["it ends too early: 0 bytes of"])


def test_bad_files_are_one_line(tmp_path: Path) -> None:
    refused(tmp_path / "none.npy", ["No such file"])
    refused(tmp_path, [])
    path = tmp_path / "lines.npz"
    path.write_bytes(b"")
    refused(path, ["empty file"])
    path.write_bytes(b"line,peak\n1,2\n")
    refused(path, ["not a .npy or .npz file"])
    np.savez_compressed(path, lines=good(DEFAULT))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    refused(path, [])
    path.write_bytes(whole[:60] + bytes(40) + whole[100:])
    refused(path, [])
    np.save(tmp_path / "lines.npy", good(DEFAULT))
    path.write_bytes((tmp_path / "lines.npy").read_bytes()[:-100])
    refused(path, [])


@pytest.mark.filterwarnings("ignore::vrscan.data.errors.InputWarning")
def test_the_sensor_of_the_configuration_decides(tmp_path: Path) -> None:
    path = tmp_path / "lines.npy"
    np.save(path, np.full((2, 512), 255, np.uint16))
    config = Config.model_validate({"sensor": {"line_length": 512, "pixel_width": 8}})
    assert len(read(path, config)) == 2
    np.save(path, np.full((2, 512), 256, np.uint16))
    with pytest.raises(InputError, match="above 255"):
        read(path, config)
