"""Recorded lines a block at a time: what is read, and what is refused."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scanners import EACH_SCANNER, SCANNERS
from test_line_files import BAD_ARCHIVES, bad_archives

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.line_files import opened, read
from vrscan.data.lines import Lines, joined

pytestmark = pytest.mark.filterwarnings("ignore::vrscan.data.errors.InputWarning")

SEED = 20100301
DEFAULT = SCANNERS["default"]
COUNT = 23


def arrays(config: Config = DEFAULT) -> dict[str, Any]:
    rng, sensor = np.random.default_rng(SEED), config.sensor
    shape = COUNT, sensor.line_length
    return {
        "lines": rng.integers(0, 2**sensor.pixel_width, shape, np.uint16),
        "angle_rad": rng.uniform(-1.0, 1.0, COUNT).astype(np.float32),
        "power": rng.integers(0, 65536, COUNT, np.uint16),
        "mirror_flags": rng.integers(0, 8, COUNT, np.uint8),
        "more": np.array("text"),
    }


def in_blocks(path: Path, size: int, config: Config = DEFAULT) -> Lines:
    with opened(path, config) as recorded:
        blocks = list(recorded.blocks(size))
    assert recorded.count == sum(map(len, blocks))
    assert all(len(block) == size for block in blocks[:-1])
    return joined(blocks)


def same(first: Lines, second: Lines) -> bool:
    names = ("lines", "angle_rad", "power", "mirror_flags")
    return all(np.array_equal(getattr(first, n), getattr(second, n)) for n in names)


@EACH_SCANNER
@pytest.mark.parametrize("size", [1, 5, COUNT, 1000])
@pytest.mark.parametrize("order", ["C", "F"])
def test_blocks_are_what_is_read_whole(
    tmp_path: Path, order: Any, size: int, config: Config
) -> None:
    given = arrays(config)
    given["lines"] = np.asarray(given["lines"].astype(">u2"), order=order)
    np.savez(tmp_path / "plain.npz", **given)
    np.savez_compressed(tmp_path / "packed.npz", **given)
    np.save(tmp_path / "lines.npy", given["lines"])
    for name in ("plain.npz", "packed.npz", "lines.npy"):
        path = tmp_path / name
        assert same(in_blocks(path, size, config), read(path, config)), name


@EACH_SCANNER
@pytest.mark.parametrize("name", BAD_ARCHIVES)
def test_blocks_are_refused_as_the_whole_is(tmp_path: Path, name: str, config: Config) -> None:
    path = tmp_path / "lines.npz"
    np.savez(path, **bad_archives(config)[name][0])
    with pytest.raises(InputError) as whole:
        read(path, config)
    for size in (1, 100):
        with pytest.raises(InputError) as blocks:
            in_blocks(path, size, config)
        assert str(blocks.value) == str(whole.value)


@EACH_SCANNER
@pytest.mark.parametrize("name", ["lines.npy", "plain.npz", "packed.npz"])
def test_damage_is_an_input_error_or_lines_of_the_right_kind(
    tmp_path: Path, name: str, config: Config
) -> None:
    rng = np.random.default_rng(SEED)
    given = arrays(config)
    np.save(tmp_path / "lines.npy", given["lines"])
    np.savez(tmp_path / "plain.npz", **given)
    np.savez_compressed(tmp_path / "packed.npz", **given)
    whole = (tmp_path / name).read_bytes()
    path = tmp_path / f"damaged_{name}"
    refusals: list[str] = []
    for trial in range(200):
        damaged = bytearray(whole)
        place = int(rng.integers(0, 200 if trial % 2 else len(whole)))
        place = place if trial % 4 < 2 else len(whole) - 1 - place
        damaged[place] = int(rng.integers(0, 256))
        path.write_bytes(damaged[: place + 1] if trial % 10 == 0 else damaged)
        try:
            found = in_blocks(path, 5, config)
        except InputError as error:
            refusals.append(str(error))
        else:
            assert found.lines.shape[1] == config.sensor.line_length
            assert found.lines.max() < 2**config.sensor.pixel_width
    assert len(refusals) > 20
    assert not any("\n" in refusal for refusal in refusals)


def test_a_changed_pixel_of_an_archive_is_noticed_in_any_block(tmp_path: Path) -> None:
    path = tmp_path / "lines.npz"
    np.savez(path, **arrays())
    whole = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as packed:
        place = packed.getinfo("lines.npy").header_offset + 1000 + 2 * 2048 * (COUNT - 1)
    whole[place] ^= 1
    path.write_bytes(whole)
    with pytest.raises(InputError, match="CRC"):
        in_blocks(path, 5)
