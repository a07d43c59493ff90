"""CSV files as other programs write them: the same values, whatever the form around them."""

import codecs
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scanners import SCANNERS

from vrscan import Lines
from vrscan.calibrate.motion_fit import read_motion
from vrscan.data import edges, line_files, line_signals, points, poses
from vrscan.data.csv_files import read_matrix, read_table
from vrscan.data.errors import InputError, InputWarning
from vrscan.data.points import csv_file, csv_rows
from vrscan.engines.engine import Engine, run

CONFIG = SCANNERS["default"]


def spot_lines() -> np.ndarray:
    """Return two lines with a spot each, and noise that is everywhere the same."""
    pixel = np.arange(CONFIG.sensor.line_length)
    noise = np.random.default_rng(3).integers(50, 70, len(pixel))
    spots = [2000.0 * np.exp(-0.5 * ((pixel - at) / 3.0) ** 2) for at in (800.3, 900.8)]
    return np.rint(np.array(spots) + noise).astype(np.uint16)


def points_text() -> str:
    lines = Lines(spot_lines(), np.array([-0.1, 0.2]), np.array([40_000, 50_000]))
    path = Path("points.csv")
    with path.open("wb") as file, csv_file(file) as write:
        write(csv_rows(run(Engine.IDEAL, lines, CONFIG)))
    return path.read_text()


def angles_beside(path: Path) -> tuple[object, ...]:
    np.save(path.with_name("lines.npy"), spot_lines())
    found = line_files.read(path.with_name("lines.npy"), CONFIG, path)
    return found.angle_rad, found.power


# A table of each kind, and what reads it.
READERS: dict[str, tuple[str | Callable[[], str], Callable[[Path], object]]] = {
    "points": (points_text, lambda path: points.read_csv(path).to_frame().to_csv()),
    "poses": (
        "time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n-1,0,0,0.5,0,0,0\n9.5,1,2,3,4,5,-6e1\n",
        lambda path: (poses.read(path).time_s, poses.read(path).place_mm, poses.read(path).turn),
    ),
    "edges": ("time_s,comparator,gate\n-0.5,0,1\n0.001,1,1\n", edges.read),
    "angles": ("angle_rad,power\n0.25,50000\n-0.125,40000\n", angles_beside),
    "angles alone": ("angle_rad\n0.25\n-0.125\n", angles_beside),
    "motion": (
        "time_s,angle_rad\n0,0.5\n0.5,-0.25\n1,0\n",
        lambda path: read_motion(path, "angle_rad", 0.25),
    ),
    "pins": (
        "sensor_clk,sensor_valid,sensor_pixel\n"
        + "".join(f"{k % 2},{int(2 <= k // 2 < 5)},{k // 2}\n" for k in range(14)),
        lambda path: line_signals.read(path, 3),
    ),
}


def lines_of(text: str) -> list[list[str]]:
    return [line.split(",") for line in text.splitlines()]


def with_separator(text: str, separator: str) -> str:
    return text.replace(".", "\0").replace(",", separator).replace("\0", ",")


FORMS: dict[str, Callable[[str], str | bytes]] = {
    "byte order mark": lambda text: codecs.BOM_UTF8 + text.encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "Windows' lines": lambda text: text.replace("\n", "\r\n"),
    "old Macs' lines": lambda text: text.replace("\n", "\r"),
    "no last line end": lambda text: text.rstrip("\n"),
    "blank lines": lambda text: text.replace("\n", "\n\n  \n", 1) + "\n\n",
    "rows without a value": lambda text: text + "," * text.partition("\n")[0].count(",") + "\n",
    "spaces": lambda text: "\n".join("  " + " ,  ".join(row) + " " for row in lines_of(text)),
    "quotes": lambda text: "\n".join(
        ",".join(f'"{field}"' if field else "" for field in row) for row in lines_of(text)
    ),
    "comments": lambda text: f"# Device: X, 12 MS/s\n;by 'it's\n\n{text}# the end\n",
    "names in a comment": lambda text: f"# {text}",
    "semicolons": lambda text: with_separator(text, ";"),
    "semicolons with points": lambda text: text.replace(",", ";"),
    "Excel's separator": lambda text: "sep=;\r\n" + with_separator(text, ";"),
    "tabs": lambda text: with_separator(text, "\t"),
    "trailing separators": lambda text: text.replace("\n", ",\n"),
}


@pytest.mark.filterwarnings("ignore::vrscan.data.errors.InputWarning")
@pytest.mark.parametrize("kind", READERS)
def test_the_form_does_not_matter(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given, read = READERS[kind]
    text = given if isinstance(given, str) else given()
    path = tmp_path / "table.csv"
    path.write_text(text)
    want = read(path)
    for form, change in FORMS.items():
        if form == "names in a comment" and kind == "points":
            continue  # its rows have words, so the first row that counts is taken for the names
        changed = change(text)
        path.write_bytes(changed if isinstance(changed, bytes) else changed.encode())
        np.testing.assert_equal(read(path), want, err_msg=form)


def test_columns_may_have_other_names_and_places(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("Note,Channel 1,Time [s],Channel 0\nstart,1,-0.5,0\n,1,0.25,1\n")
    found = edges.read(path, {"comparator": "channel 0", "gate": "Channel 1"})
    np.testing.assert_equal(found, ([-0.5, 0.25], [0, 1], [1, 1]))
    with pytest.raises(InputError, match="0 columns 'Channel 7', want 1"):
        edges.read(path, {"gate": "Channel 7"})


MATRIX = np.random.default_rng(2).integers(0, 4096, (3, CONFIG.sensor.line_length))
FRAME = pd.DataFrame(MATRIX)
MATRICES: dict[str, Callable[[Path], object]] = {
    "plain": lambda path: FRAME.to_csv(path, header=False, index=False),
    "semicolons": lambda path: np.savetxt(path, MATRIX, "%d", ";"),
    "decimal commas": lambda path: FRAME.astype(float).to_csv(
        path, header=False, index=False, sep=";", decimal=","
    ),
    "numpy's spaces": lambda path: np.savetxt(path, MATRIX),
    "padded": lambda path: np.savetxt(path, MATRIX, "%5d", ", ", header="of a sensor"),
    "tabs": lambda path: np.savetxt(path, MATRIX, "%.1f", "\t"),
    "numbered columns": lambda path: FRAME.to_csv(path, index=False),
    "numbered columns and rows": lambda path: FRAME.to_csv(path),
    "byte order mark": lambda path: FRAME.to_csv(
        path, header=False, index=False, encoding="utf-8-sig"
    ),
}


@pytest.mark.filterwarnings("ignore:.*no angle_rad")
@pytest.mark.parametrize("form", MATRICES)
def test_a_matrix_of_numbers_is_lines(form: str, tmp_path: Path) -> None:
    path = tmp_path / "lines.csv"
    MATRICES[form](path)
    if form.startswith("numbered"):
        with pytest.warns(InputWarning, match="its first row numbers the columns"):
            found = line_files.read(path, CONFIG).lines
    else:
        found = line_files.read(path, CONFIG).lines
    assert np.array_equal(found, MATRIX)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("1,2,3\n4,5\n", "columns"),
        ("1,2,3\n4,x,6\n", "'x'"),
        ("1,2,3\n4,5,6\n", r"lines must have shape \[n, 2048\] \(have \(2, 3\)\)"),
    ],
)
def test_a_matrix_that_is_none_is_one_line(text: str, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "lines.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=wanted) as caught:
        line_files.read(path, CONFIG)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_names_are_no_matrix(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    for text in ("a,b\n1,2\n", "# a,b\n1,2\n", ""):
        path.write_text(text)
        assert read_matrix(path) is None, text


def test_a_line_of_the_file_is_named_whatever_stands_before_it(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("# one\n\na,b\n1,2\n\n; five\n3\n")
    with pytest.raises(InputError, match="line 7: 1 fields, want 2"):
        read_table(path)
    path.write_text('a,b\n1,2\n3,"4\n' + "5,6\n" * 100_000)
    with pytest.raises(InputError, match="line 3: not a CSV file") as caught:
        read_table(path)
    assert len(str(caught.value)) < len(str(path)) + 200
