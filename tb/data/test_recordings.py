"""Recordings: what was written comes back, by the library's own reader too, up to any cut."""

import io
import json
import tempfile
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_records import random_records
from scanners import EACH_SCANNER, SCANNERS
from test_points import random_points

from vrscan.data import recordings
from vrscan.data.config import Config, Line
from vrscan.data.errors import InputError
from vrscan.data.lines import Lines, Truth
from vrscan.data.points import table
from vrscan.data.table import Table

LENGTH, COUNT = 64, 300
CONFIG = Config(line=Line(lines_per_period=150.4))
CONFIGS = {"interlaced": CONFIG, **SCANNERS}
MAPS = b"maps " * 100


def lines() -> Lines:
    rng = np.random.default_rng(3)
    truth = Truth(*rng.random((3, COUNT)), rng.integers(-1, 2, COUNT), ("wall", "step"))
    return Lines(
        lines=rng.integers(0, 4096, (COUNT, LENGTH)).astype(np.uint16),
        angle_rad=rng.uniform(-0.3, 0.3, COUNT),
        power=rng.integers(0, 65536, COUNT),
        truth=truth,
        mirror_flags=rng.integers(0, 8, COUNT),
        time_s=np.arange(COUNT) / 37400.0,
        y_mm=rng.random(COUNT),
        lens=rng.integers(0, 65536, COUNT),
        number=np.arange(COUNT) + 2**32 - COUNT,
    )


def points() -> Table:
    return table(random_points()).of(np.arange(4000) < 1500)


@cache
def whole(name: str = "interlaced") -> bytes:
    """Return a recording of everything by a scanner, in several chunks."""
    file = io.BytesIO()
    with recordings.Writer(
        file, CONFIGS[name], maps=MAPS, about={"scene": "step"}, flush_s=0.0
    ) as into:
        into.points(points())
        into.lines(lines())
        into.edges(np.arange(4) * 1e-3, np.arange(4) % 2, np.ones(4, np.int64))
        into.board({"state": "RUN"}, time_s=1.0)
        into.note("account", {"records": 5})
    return file.getvalue()


def read(data: bytes, folder: Path) -> recordings.Recording:
    path = folder / "scan.mcap"
    path.write_bytes(data)
    return recordings.read(path)


def read_or_refused(data: bytes, folder: Path) -> recordings.Recording | str:
    """Return what is read, or the words with which it is refused."""
    try:
        return read(data, folder)
    except InputError as error:
        return str(error)


def same(got: Any, want: Any) -> None:
    for each in fields(want):
        a, b = getattr(got, each.name), getattr(want, each.name)
        if each.name == "flags":
            assert a.keys() == b.keys() and all(np.array_equal(a[k], b[k]) for k in a)
        elif isinstance(b, Truth):
            same(a, b)
        else:
            assert np.array_equal(a, b, equal_nan=isinstance(b, np.ndarray) and b.dtype == float)


@pytest.mark.parametrize("name", CONFIGS)
def test_everything_comes_back(tmp_path: Path, name: str) -> None:
    found, config = read(whole(name), tmp_path), CONFIGS[name]
    assert (found.complete, found.lost, found.told()) == (True, 0, "")
    assert found.about["scene"] == "step" and found.notes["account"] == {"records": "5"}
    want = config.model_copy(update={"map": config.map.model_copy(update={"file": "scan.mcap"})})
    assert found.config.model_dump() == want.model_dump()
    assert recordings.maps_file(found.path).read() == MAPS
    same(found.points, points())
    same(found.lines, lines())
    assert found.edges[0].tolist() == [0.0, 1e-3, 2e-3, 3e-3]
    assert found.edges[1].tolist() == [0, 1, 0, 1] and found.board == [{"state": "RUN"}]


@EACH_SCANNER
def test_records_keep_every_bit_and_unwrap_their_time(tmp_path: Path, config: Config) -> None:
    clock_hz, width = round(config.clock.frequency_hz), config.sensor.pixel_width
    made = random_records(np.random.default_rng(5), range(3000))
    made["time"] = (np.arange(3000, dtype=np.int64) * (clock_hz // 20) + 2**32 - 10**9) % 2**32
    path = tmp_path / "a.mcap"
    with recordings.Writer(path, config) as into:
        for part in np.split(made, [1, 700, 701]):
            into.records(part, clock_hz, width, 1)
    kept = np.concatenate([rows for _, rows, _ in recordings._messages(path)])
    assert kept.tobytes() == made.tobytes()
    found = recordings.read(path).points
    with recordings.Writer(tmp_path / "b.mcap", config) as into:
        into.records(made, clock_hz, width, 4)  # in units of 4 mm
    assert np.array_equal(recordings.read(tmp_path / "b.mcap").points.z_mm, 4.0 * found.z_mm)
    assert np.allclose(np.diff(found.time_s), 0.05) and np.array_equal(found.power, made["power"])


def test_a_moment_beside_records_is_by_their_clock() -> None:
    clock, ticks = recordings.Clock(100), np.array([2**32 - 50, 50, 150])
    for tick, now in zip(ticks, (2**32 - 50, 2**32 + 50, 2**32 + 150), strict=True):
        assert clock.beside(np.array([tick]))[0] == now / 100  # no record has come
    assert clock.seconds(ticks)[-1] == (2**32 + 150) / 100
    near = np.array([2**32 - 1, 0, 2**31 + 100])
    assert clock.beside(near).tolist() == [(2**32 - 1) / 100, 2**32 / 100, (2**32 + near[2]) / 100]
    assert clock.seconds(np.array([151]))[0] == (2**32 + 151) / 100  # and they move nothing


def test_what_is_not_packed_is_larger_and_the_same(tmp_path: Path) -> None:
    dark = replace(lines(), lines=np.zeros((COUNT, LENGTH), np.uint16))
    sizes = []
    for packed in (True, False):
        path = tmp_path / f"{packed}.mcap"
        with recordings.Writer(path, CONFIG, packed=packed) as into:
            into.lines(dark)
        same(recordings.read(path).lines, dark)
        sizes.append(path.stat().st_size)
    assert sizes[0] < sizes[1] - dark.lines.nbytes // 2


def test_by_the_own_reader_of_mcap() -> None:
    from mcap.reader import make_reader

    reader = make_reader(io.BytesIO(whole()), validate_crcs=True)
    assert reader.get_header().profile == "vrscan"
    summary = reader.get_summary()
    counts = {
        summary.channels[k].topic: n for k, n in summary.statistics.channel_message_counts.items()
    }
    assert counts == {"points": 2, "lines": 5, "edges": 1, "board": 1}
    x_mm = []
    for schema, channel, message in reader.iter_messages(topics=["points"]):
        assert channel.message_encoding == "numpy"
        kind = np.dtype([tuple(each) for each in json.loads(schema.data)])
        x_mm.append(np.frombuffer(message.data, kind)["x_mm"])
    assert np.array_equal(np.concatenate(x_mm), points().x_mm)


@settings(max_examples=120, deadline=None)
@given(st.integers(0, len(whole()) - 1))
def test_what_is_cut_off_anywhere_is_read_up_to_there(cut: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        found = read_or_refused(whole()[:cut], Path(folder))
        if isinstance(found, str):
            assert cut < whole().index(b"numpy") and "\n" not in found
            return
        assert not found.complete and found.lost == 0 and "cut off" in found.told()
        # Chunks that end before the cut, by the index of the whole file.
        from mcap.reader import make_reader

        ends = [
            each.chunk_start_offset + each.chunk_length
            for each in make_reader(io.BytesIO(whole())).get_summary().chunk_indexes
        ]
        wants = [1024, 476, 64, 64, 64, 64, 44, 4, 1]
        assert len(ends) == len(wants)
        assert sum(found.rows.values()) == sum(
            n for n, end in zip(wants, ends, strict=True) if end <= cut
        )
        if found.rows.get("lines"):
            count = found.rows["lines"]
            assert np.array_equal(found.lines.lines, lines().lines[:count])


@settings(max_examples=120, deadline=None)
@given(st.integers(0, len(whole()) - 1), st.integers(0, 7))
def test_a_flipped_bit_is_told_and_nothing_else_is_believed(place: int, bit: int) -> None:
    data = bytearray(whole())
    data[place] ^= 1 << bit
    with tempfile.TemporaryDirectory() as folder:
        found = read_or_refused(bytes(data), Path(folder))
        if isinstance(found, str):
            assert place < whole().index(b"numpy") and "\n" not in found
            return
        rows = sum(found.rows.values())
        assert rows == 1805 or found.told(), place
        if found.rows.get("points") == 1500:
            same(found.points, points())
        if found.rows.get("lines") == COUNT:
            assert np.array_equal(found.lines.lines, lines().lines)


def test_other_files_are_refused_and_nothing_stays_without_data(tmp_path: Path) -> None:
    from mcap_ros2.writer import Writer

    path = tmp_path / "ros.mcap"
    with path.open("wb") as file, Writer(file):
        pass
    with pytest.raises(InputError, match=r"ros\.mcap: not a recording \(profile 'ros2'\)"):
        recordings.read(path)
    path.write_bytes(b"points")
    with pytest.raises(InputError, match="no MCAP file"):
        recordings.read(path)
    failed = tmp_path / "failed.mcap"
    with pytest.raises(InputError), recordings.Writer(failed, Config()):
        raise InputError("the board is gone")
    assert not failed.exists()

    def cut_short() -> None:
        with recordings.Writer(failed, Config()) as into:
            into.points(points())
            raise InputError("the board is gone")

    with pytest.raises(InputError, match="gone"):
        cut_short()
    assert len(recordings.read(failed).points) == 1500
    with pytest.raises(InputError, match="no raw lines"):
        _ = recordings.read(failed).lines
