"""Lines from pictures: what was drawn is read, whatever the format, and what is wrong is told."""

import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scanners import EACH_SCANNER, SCANNERS

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.line_files import opened, read

DEFAULT = SCANNERS["default"]


def lines_of(config: Config) -> np.ndarray:
    """Return lines of a scanner's sensor, of pixels over its whole range."""
    sensor, draw = config.sensor, np.random.default_rng(5)
    shape = 23, sensor.line_length
    return draw.integers(0, 2**sensor.pixel_width, shape).astype(np.uint16)


LINES = lines_of(DEFAULT)
pytestmark = pytest.mark.filterwarnings("ignore::vrscan.data.errors.InputWarning")


def saved(array: np.ndarray, path: Path) -> Path:
    Image.fromarray(array).save(path)
    return path


@EACH_SCANNER
@pytest.mark.parametrize("name", ["lines.png", "lines.tif", "lines.TIFF"])
def test_sixteen_bits_are_counts(name: str, tmp_path: Path, config: Config) -> None:
    lines = lines_of(config)
    found = read(saved(lines, tmp_path / name), config)
    assert found.lines.dtype == np.uint16
    assert np.array_equal(found.lines, lines)


@EACH_SCANNER
@pytest.mark.parametrize("name", ["lines.png", "lines.tif"])
def test_eight_bits_are_spread_over_the_sensors_range(
    name: str, tmp_path: Path, config: Config
) -> None:
    width = config.sensor.pixel_width
    grey = (lines_of(config) >> width - 8).astype(np.uint8)
    grey[0, :2] = 0, 255
    found = read(saved(grey, tmp_path / name), config).lines
    top = 2**width - 1
    assert found[0, :2].tolist() == [0, top]
    assert np.abs(found - grey * (top / 255.0)).max() <= 0.5


@EACH_SCANNER
def test_pages_and_files_follow_each_other_by_number(tmp_path: Path, config: Config) -> None:
    lines = lines_of(config)
    parts = np.split(lines, [4, 5, 17])
    pages = [Image.fromarray(part) for part in parts]
    pages[0].save(tmp_path / "stack.tif", save_all=True, append_images=pages[1:])
    assert np.array_equal(read(tmp_path / "stack.tif", config).lines, lines)
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "notes.txt").write_text("not a picture")
    for part, name in zip(parts, ["l_2.png", "l_9.tif", "l_10.png", "l_100.png"], strict=True):
        saved(part, folder / name)
    assert np.array_equal(read(folder, config).lines, lines)
    for size in (1, 5, 100):
        with opened(folder, config) as recorded:
            assert recorded.count == len(lines)
            blocks = [block.lines for block in recorded.blocks(size)]
        assert [len(block) for block in blocks[:-1]] == [size] * (len(blocks) - 1)
        assert np.array_equal(np.concatenate(blocks), lines)


def stack(path: Path, pages: np.ndarray, order: str = "<", white: int = 1, says: str = "") -> Path:
    """Write a TIFF with the entries of its first page only, as ImageJ does for stacks."""
    count, height, width = pages.shape
    size = pages.dtype.itemsize
    words = (says or f"ImageJ=1.54f\nimages={count}\nslices={count}\n").encode() + b"\0"
    entries = [(256, width), (257, height), (258, 8 * size), (259, 1), (262, white), (277, 1)]
    rows = {270: (2, len(words), 134), 273: (4, 1, 134 + len(words)), 278: (4, 1, height)}
    rows |= {tag: (4, 1, value) for tag, value in entries}
    rows |= {279: (4, 1, height * width * size)}
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "IH", 8, len(rows))
    for tag in sorted(rows):
        kind, number, value = rows[tag]
        short = tag in (258, 259, 262, 277)
        form = "HHIHH" if short else "HHII"
        values = (value, 0) if short else (value,)
        head += struct.pack(order + form, tag, 3 if short else kind, number, *values)
    head += bytes(4)
    pixels = pages.astype(pages.dtype.newbyteorder(order)).tobytes()
    path.write_bytes(head.ljust(134, b"\0") + words + pixels)
    return path


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_stack_of_imagej_is_read_whole(tmp_path: Path, order: str, kind: type) -> None:
    lines = LINES[:20] >> 4 if kind is np.uint8 else LINES[:20]
    path = stack(tmp_path / "stack.tif", lines.astype(kind).reshape(5, 4, -1), order)
    assert Image.open(path).n_frames == 1  # no page says that there are others
    found = read(path, DEFAULT).lines
    want = saved(lines.astype(kind), tmp_path / "plain.png")
    assert np.array_equal(found, read(want, DEFAULT).lines)
    path.write_bytes(path.read_bytes()[:-1])
    refused(path, "4 of ImageJ's 5 images are there")
    pages = lines.astype(kind).reshape(2, 10, -1)
    refused(
        stack(path, pages, order, says="ImageJ=1.54f\nimages=2\nchannels=2\n"),
        "2 channels, want one of grey",
    )
    for number in ("9" * 5000, "-3", "many"):
        refused(stack(path, pages, order, says=f"ImageJ=1.54f\nimages={number}\n"), str(path))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("pages", [1, 4])
def test_white_may_be_zero(tmp_path: Path, kind: type, pages: int) -> None:
    lines = LINES[:20] >> 4 if kind is np.uint8 else LINES[:20]
    turned = (np.iinfo(kind).max - lines).astype(kind).reshape(pages, 20 // pages, -1)
    found = read(stack(tmp_path / "white.tif", turned, white=0), DEFAULT).lines
    want = saved(lines.astype(kind), tmp_path / "plain.png")
    assert np.array_equal(found, read(want, DEFAULT).lines)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "LA", "P"])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_colours_are_their_luma(tmp_path: Path, mode: str, ending: str) -> None:
    grey = (LINES >> 4).astype(np.uint8)
    want = read(saved(grey, tmp_path / "grey.png"), DEFAULT).lines
    path = tmp_path / f"colour.{ending}"
    Image.fromarray(grey).convert(mode).save(path)
    assert np.array_equal(read(path, DEFAULT).lines, want)
    if mode in ("RGB", "RGBA"):
        colours = np.random.default_rng(8).integers(0, 256, (3, 2048, len(mode)), np.uint8)
        Image.fromarray(colours, mode).save(path)
        luma = colours[..., :3] @ np.array([0.299, 0.587, 0.114])
        assert np.abs(read(path, DEFAULT).lines - luma * (4095.0 / 255.0)).max() <= 0.5 + 1e-9


def test_hidden_files_of_a_folder_do_not_count(tmp_path: Path) -> None:
    saved(LINES, tmp_path / "lines.png")
    (tmp_path / "._lines.png").write_bytes(b"of a Mac")
    (tmp_path / "folder.png").mkdir()
    assert np.array_equal(read(tmp_path, DEFAULT).lines, LINES)


def test_angles_come_from_a_file_beside(tmp_path: Path) -> None:
    path, angles = saved(LINES[:3], tmp_path / "lines.png"), tmp_path / "angles.csv"
    angles.write_text("angle_rad,power,time_s\n0.1,7,1\n0.2,8,2\n-0.3,65535,3.5\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = read(path, DEFAULT, angles)
    assert found.angle_rad.tolist() == [0.1, 0.2, -0.3]
    assert found.power.tolist() == [7, 8, 65535]
    assert np.asarray(found.time_s).tolist() == [1.0, 2.0, 3.5]


WRONG_ANGLES = {
    "angle_rad,pwer\n0,1\n0,1\n0,1\n": ["columns angle_rad, pwer"],
    "power\n0\n0\n0\n": ["columns power,"],
    "angle_rad\n0\n0\n": ["2 rows for the 3 lines"],
    "angle_rad\n0\nx\n0\n": ["line 3", "angle_rad 'x'"],
    "angle_rad,power\n0,1\n0,1.5\n0,1\n": ["line 3", "power '1.5'"],
    "": ["columns none"],
}


@pytest.mark.parametrize("text", WRONG_ANGLES)
def test_wrong_angles_are_one_line(text: str, tmp_path: Path) -> None:
    path, angles = saved(LINES[:3], tmp_path / "lines.png"), tmp_path / "angles.csv"
    angles.write_text(text)
    with pytest.raises(InputError) as caught:
        read(path, DEFAULT, angles)
    for part in [str(angles), *WRONG_ANGLES[text]]:
        assert part in str(caught.value)


def test_angles_given_twice_are_refused(tmp_path: Path) -> None:
    path, angles = tmp_path / "lines.npz", tmp_path / "angles.csv"
    np.savez(path, lines=LINES[:1], angle_rad=np.zeros(1))
    angles.write_text("angle_rad\n0\n")
    with pytest.raises(InputError, match=r"angles\.csv: angle_rad is in .*lines\.npz, too"):
        read(path, DEFAULT, angles)


def refused(path: Path, *wanted: str, config: Config = DEFAULT) -> None:
    with pytest.raises(InputError) as caught:
        read(path, config)
    message = str(caught.value)
    assert "\n" not in message
    for part in wanted:
        assert part in message, message


@EACH_SCANNER
def test_a_picture_of_another_sensor_is_refused(tmp_path: Path, config: Config) -> None:
    lines, length = lines_of(config), config.sensor.line_length
    top = 2**config.sensor.pixel_width - 1
    short, bright = lines[:, :100], lines + np.uint16(top + 1)
    words = "short.png", str(length), "(23, 100)"
    refused(saved(short, tmp_path / "short.png"), *words, config=config)
    refused(saved(bright, tmp_path / "bright.tif"), "bright.tif", f"above {top}", config=config)


def deep_png(kind: int, values: int) -> bytes:
    """Return a PNG of 16 bits with several values in a pixel, of which Pillow reads 8 bits."""

    def part(name: bytes, data: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + check

    rows = zlib.compress(3 * bytes(1 + 2 * values * 2048))
    head = struct.pack(">IIBBBBB", 2048, 3, 16, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", head) + part(b"IDAT", rows) + part(b"IEND", b"")


def test_bad_pictures_are_one_line_that_names_the_file(tmp_path: Path) -> None:
    refused(tmp_path / "none.png", "none.png", "No such file")
    refused(tmp_path, str(tmp_path), "no pictures")
    (tmp_path / "text.png").write_text("not a picture")
    refused(tmp_path / "text.png", "text.png", "not a PNG or TIFF")
    Image.new("CMYK", (2048, 3)).save(tmp_path / "cmyk.tif")
    refused(tmp_path / "cmyk.tif", "cmyk.tif", "grey", "CMYK")
    for kind, values in ((2, 3), (4, 2), (6, 4)):
        (tmp_path / "deep.png").write_bytes(deep_png(kind, values))
        refused(tmp_path / "deep.png", "deep.png", "grey", "of 16 bits")
    whole = saved(LINES, tmp_path / "cut.png").read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[: len(whole) // 2])
    refused(tmp_path / "cut.png", "cut.png")
    folder = tmp_path / "widths"
    folder.mkdir()
    saved(LINES, folder / "a.png")
    saved(LINES[:, :100], folder / "b.png")
    refused(folder, "b.png", "100 px wide, others are 2048")
