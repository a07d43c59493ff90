"""Any byte of any file that we read can be wrong: a refusal in one line, or what the file says.

Files of every kind are damaged at random, bytes and words of them, and read again. What comes back
is compared with what somebody else's reader finds in the same bytes: tomllib, numpy, or a count of
edges of our own here; never with what was in the file before.
"""

import collections
import datetime
import io
import json
import math
import re
import string
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pydantic
import pytest
import trimesh
from PIL import Image, ImageSequence
from scanners import SCANNERS

from vrscan import Lines
from vrscan.data import config as configuration
from vrscan.data import edges, line_files, points, poses
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.engines.engine import Engine, run
from vrscan.engines.tools import repository_root
from vrscan.scene import description, meshes, site

SHORT, LONG = 250, 10_000
SLOWEST_S = 20.0  # for a file of some kilobytes, on a busy machine
SCENES = sorted((repository_root() / "model/vrscan/scene/scenes").glob("*.toml"))
WORDS = [
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "1e309",
    "-1e309",
    "1e-320",
    "99999999999999999999",
    "0x10",
    "1_0",
    "true",
    "false",
    "[]",
    "{}",
    '""',
    '"x"',
    "''",
    "=",
    "[[a]]",
    "[a]",
    "1979-05-27",
    "\\u0000",
    ",",
    ";",
    "facet",
    "f",
    "v",
    "vertex",
    "end_header",
    "element",
    "comparator",
]


def toml(values: dict[str, object]) -> str:
    """Return tables of numbers, words and lists as TOML; JSON writes those alike."""
    text = "".join(
        f"{key} = {json.dumps(value)}\n"
        for key, value in values.items()
        if value is not None and not isinstance(value, dict)
    )
    for key, table in values.items():
        if isinstance(table, dict):
            text += f"[{key}]\n{toml(table)}"
    return text


def damage(whole: bytes, rng: np.random.Generator) -> bytes:
    """Return a file with one to three of the faults that disks, editors and exporters make."""
    data = bytearray(whole)
    for _ in range(int(rng.integers(1, 4))):
        # The ends hold the headers, where more can go wrong.
        near = min(len(data), 200) if rng.random() < 0.5 else len(data)
        place = int(rng.integers(0, max(near, 1)))
        place = place if rng.random() < 0.7 else max(len(data) - 1 - place, 0)
        length = int(rng.integers(1, 40))
        fault = int(rng.integers(0, 8))
        if fault == 0:
            data[place : place + 1] = rng.bytes(1)
        elif fault == 1:
            data[place : place + 1] = bytes([data[place] ^ 1 << int(rng.integers(8))])
        elif fault == 2:
            del data[place : place + length]
        elif fault == 3:
            data[place:place] = data[place : place + length]
        elif fault == 4:
            data[place:place] = rng.bytes(length)
        elif fault == 5 and rng.random() < 0.3:
            del data[place:]
        elif words := list(re.finditer(rb"[^\s,=\[\]]+", data)):
            word = words[int(rng.integers(len(words)))]
            other = WORDS[int(rng.integers(len(WORDS)))].encode()
            if fault == 7:  # a word of the file in place of another
                other = words[int(rng.integers(len(words)))][0]
            data[word.start() : word.end()] = other
        if not data:
            break
    return bytes(data)


def says(found: object, file: object, where: str = "") -> None:
    """Compare what a model of pydantic has with what tomllib found in the same file."""
    if isinstance(file, dict):
        for key, value in file.items():
            held = found[key] if isinstance(found, dict) else getattr(found, key)
            says(held, value, f"{where}.{key}")
    elif isinstance(file, list) and not isinstance(found, str):
        assert isinstance(found, (list, tuple)), where
        # Harmonics that a file leaves out are 0, and so are their slopes.
        padded = where in (".mirror.harmonics", ".mirror.slopes")
        assert all(padded and tuple(held) == (0, 0) for held in found[len(file) :]), where
        for held, value in zip(found[: len(file)], file, strict=True):
            says(held, value, where)
    elif isinstance(found, pydantic.BaseModel):
        raise AssertionError(f"{where}: {file!r} became {found!r}")
    else:
        assert isinstance(file, bool) == isinstance(found, bool), f"{where}: {file!r}, {found!r}"
        if isinstance(found, datetime.datetime) and isinstance(file, str):
            file = datetime.datetime.fromisoformat(file)
        if isinstance(found, float) and isinstance(file, int):
            file = float(file)
        assert str(found) == str(file) if isinstance(found, Path) else found == file, where


def read_config(path: Path) -> None:
    """Read a configuration."""
    says(configuration.load(path), tomllib.loads(path.read_bytes().decode()))


def read_scene(path: Path) -> None:
    """Read a scene."""
    says(description.load(str(path)), tomllib.loads(path.read_bytes().decode()))


def read_site(path: Path) -> None:
    """Read a site."""
    says(site.load(path), tomllib.loads(path.read_bytes().decode()))


def read_lines(path: Path) -> None:
    """Read a recording whole and in blocks."""
    config = Config()
    found = line_files.read(path, config)
    with np.errstate(all="ignore"):
        loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        arrays = {"lines": loaded}
    else:
        names = ("lines", "angle_rad", "power", "mirror_flags")
        arrays = {name: loaded[name] for name in names if name in loaded.files}
    assert found.lines.shape == arrays["lines"].shape
    assert (found.lines == arrays["lines"]).all()
    assert found.lines.max() <= 4095
    for name in ("angle_rad", "power", "mirror_flags"):
        if name in arrays:
            assert (getattr(found, name) == arrays[name]).all()
    assert np.isfinite(found.angle_rad).all()
    assert (np.abs(found.angle_rad) <= np.pi).all()


def read_edges(path: Path) -> None:
    """Read edges of the index."""
    time_s, comparator, gate = edges.read(path)
    assert len(table_of(path)) == len(time_s)
    for name, found in (("time_s", time_s), ("comparator", comparator), ("gate", gate)):
        assert column_of(path, name) == found.tolist()
    assert np.isfinite(time_s).all()
    assert (np.diff(time_s) >= 0.0).all()


def table_of(path: Path) -> pd.DataFrame:
    """Return what pandas reads of a table, after what spreadsheets add to it is taken away."""
    text = path.read_bytes().decode("utf-8-sig")
    kept = [line for line in text.splitlines() if line.strip(" ,") and line.lstrip()[0] not in "#;"]
    table = pd.read_csv(io.StringIO("\n".join(kept)), dtype=str, skipinitialspace=True)
    return table.rename(columns=lambda name: re.sub(r"\s|_i$", "", str(name).lower()))


def column_of(path: Path, name: str) -> list[float]:
    """Return the numbers of a column as pandas finds them."""
    return [float(text) for text in table_of(path)[name]]


def read_poses(path: Path) -> None:
    """Read poses."""
    found = poses.read(path)
    assert column_of(path, "time_s") == found.time_s.tolist()
    assert column_of(path, "z_mm") == found.place_mm[:, 2].tolist()


def read_points(path: Path) -> None:
    """Read points."""
    found, want = points.read_csv(path), table_of(path)
    assert len(found) == len(want)
    for name in ("z_mm", "position_px"):
        there = [math.nan if text != text else float(text) for text in want[name]]
        held = np.where(
            found.located if name == "z_mm" else found.measured, getattr(found, name), np.nan
        )
        np.testing.assert_array_equal(held, there)


def read_matrix(path: Path) -> None:
    """Read lines as a matrix of numbers."""
    found = line_files.read(path, Config.model_validate({"sensor": {"line_length": 64}})).lines
    rows = [line for line in path.read_text().splitlines() if line.strip(" ,")]
    rows = [line for line in rows if line.lstrip()[0] not in "#;"]
    assert [
        [float(each) for each in row.replace('"', "").split(",")] for row in rows
    ] == found.tolist()


def read_picture(path: Path) -> None:
    """Read lines of a picture."""
    found = line_files.read(path, Config()).lines
    with Image.open(path) as picture:
        if picture.mode == "I;16" and getattr(picture, "tag_v2", {}).get(262) != 0:
            pages = [np.asarray(page) for page in ImageSequence.Iterator(picture)]
            assert np.array_equal(found, np.concatenate(pages))


def read_mesh(path: Path) -> None:
    """Read a mesh."""
    vertices, faces = meshes.load_mesh(path)
    assert np.isfinite(vertices).all()
    assert len(faces) >= 4
    edge = collections.Counter(
        frozenset((int(face[k]), int(face[(k + 1) % 3]))) for face in faces for k in range(3)
    )
    assert all(len(ends) == 2 and count % 2 == 0 for ends, count in edge.items())


def files(folder: Path) -> dict[str, tuple[list[bytes], Callable[[Path], None]]]:
    """Return files of every kind, and what reads them and looks at what was read."""
    rng = np.random.default_rng(7)
    lines = rng.integers(50, 4000, (3, 2048)).astype(np.uint16)
    angle_rad, power = np.linspace(-0.3, 0.3, 3), np.full(3, 50_000, np.uint16)
    bare, plain, packed = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.save(bare, lines)
    np.savez(plain, lines=lines, angle_rad=angle_rad, power=power)
    np.savez_compressed(packed, lines=lines // 64, angle_rad=angle_rad, power=power)
    table = "time_s,comparator,gate\n" + "".join(
        f"{k * 1e-5:.7f},{k % 2},{k // 2 % 2}\n" for k in range(40)
    )
    tracks = "time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n" + "".join(
        f"{k / 8},{k},{k / 4},-{k},{k},0,{k / 2}\n" for k in range(20)
    )
    cloud, matrix = io.BytesIO(), io.BytesIO()
    points.write_csv(run(Engine.IDEAL, Lines(lines, angle_rad, power), Config()), cloud)
    np.savetxt(matrix, lines[:, :64], "%d", ",")
    shape = trimesh.creation.box((40.0, 30.0, 20.0))

    def drawn(kind: str, **options: object) -> bytes:
        file = io.BytesIO()
        Image.fromarray(lines).save(file, kind, **options)
        return file.getvalue()

    def mesh(kind: str, **options: object) -> bytes:
        text = shape.export(file_type=kind, **options)
        return text if isinstance(text, bytes) else text.encode()

    return {
        "config.toml": (
            [toml(config.model_dump(mode="json")).encode() for config in SCANNERS.values()],
            read_config,
        ),
        "scene.toml": ([file.read_bytes() for file in SCENES], read_scene),
        "lines.npy": ([bare.getvalue()], read_lines),
        "lines.npz": ([plain.getvalue(), packed.getvalue()], read_lines),
        "edges.csv": ([table.encode()], read_edges),
        "poses.csv": ([tracks.encode()], read_poses),
        "lines.tif": ([drawn("TIFF"), drawn("TIFF", compression="tiff_lzw")], read_picture),
        "points.csv": ([cloud.getvalue()], read_points),
        "matrix.csv": ([matrix.getvalue()], read_matrix),
        "site.toml": ([toml(site.Site().model_dump(mode="json")).encode()], read_site),
        "mesh.stl": ([mesh("stl"), mesh("stl_ascii")], read_mesh),
        "mesh.obj": ([mesh("obj")], read_mesh),
        "mesh.ply": ([mesh("ply"), mesh("ply", encoding="ascii")], read_mesh),
    }


NAMES = sorted(files(Path()))
ABSURD = {
    "5000 digits": "[line]\nrate_hz = " + 5000 * "9",
    "5000 digits of 16": "[sun]\ntime = 0x" + 5000 * "f",
    "brackets": "a = " + 3000 * "[" + 3000 * "]",
    "fewer brackets": "a = " + 40 * "[" + 40 * "]",
    "tables": "a = " + 3000 * "{b = " + "1" + 3000 * "}",
    "dotted parts": ".".join(3000 * "a") + " = 1",
    "a dotted table": "[" + ".".join(3000 * "a") + "]",
    "a long key": 100_000 * "k" + " = 1",
    "a key of two lines": '"a\\nb" = 1',
    "a long value": "[peak]\nwindow = '" + 100_000 * "w" + "'",
    "a long list": "a = [" + 9_999 * "1," + "]",
}


@pytest.mark.parametrize("read", [read_config, read_scene, read_site])
@pytest.mark.parametrize("name", ABSURD)
def test_absurd_tables_are_one_short_line(
    tmp_path: Path, name: str, read: Callable[[Path], None]
) -> None:
    path = tmp_path / "file.toml"
    path.write_text(ABSURD[name])
    with pytest.raises(InputError) as caught:
        read(path)
    words = str(caught.value)
    assert words.startswith(str(path))
    assert "\n" not in words
    assert len(words) < len(str(path)) + 300


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("cases", "seed"),
    [pytest.param(SHORT, 1, id="short"), pytest.param(LONG, 2, id="long", marks=pytest.mark.soak)],
)
@pytest.mark.parametrize("name", NAMES)
def test_damage_is_refused_or_read_as_it_is(
    tmp_path: Path, name: str, cases: int, seed: int
) -> None:
    wholes, look = files(tmp_path)[name]
    path = tmp_path / name
    for whole in wholes:
        path.write_bytes(whole)
        look(path)
    rng = np.random.default_rng(seed)
    counts = collections.Counter[str]()
    for case in range(cases):
        path.write_bytes(damage(wholes[case % len(wholes)], rng))
        begin = time.monotonic()
        try:
            look(path)
            counts["read"] += 1
        except InputError as error:
            words = str(error)
            assert words.startswith(str(path)), (case, words)
            assert "\n" not in words, (case, words)
            assert len(words) < 2_000, (case, words)
            assert all(c in string.printable or c.isprintable() for c in words), (case, words)
            counts["refused"] += 1
        assert time.monotonic() - begin < SLOWEST_S, case
    assert counts["refused"] > cases // 20, counts
    assert counts["read"] > 0, counts
