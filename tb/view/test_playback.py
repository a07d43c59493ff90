"""Recordings of every kind, played: all of their points, and a raw line with its own result."""

import time
from pathlib import Path

import numpy as np
import pytest
from random_records import random_records
from scene_board import CONFIG, scene_lines

from vrscan.data import recordings, records
from vrscan.data.errors import InputError
from vrscan.data.lines import Lines
from vrscan.data.points import atomic_file, table
from vrscan.data.records import Form
from vrscan.link.link_report import write_points
from vrscan.link.register_host import Build
from vrscan.link.stream import DTYPES, Account
from vrscan.view.playback import Playback, opened

COUNT = 900
SEED = 20261125
BUILD = Build(*[0] * 4, 100_000_000, 2048, 12, 255, 1, 4)


def streamed(form: Form) -> records.Records:
    """Return records as a stream gives them."""
    full = random_records(np.random.default_rng(SEED), range(COUNT))
    if form is Form.FULL:
        return full
    short = records.compact(full) if form is Form.COMPACT else records.space(full)
    found = np.zeros(COUNT, DTYPES[form])
    found["line"] = full["line"]
    for name in short.dtype.names or ():
        found[name] = short[name]
    return found


def played(source: Playback) -> None:
    """Play a recording to its end."""
    source.begin()
    end = time.monotonic() + 10.0
    while source.display.count < source.length and time.monotonic() < end:
        time.sleep(0.02)
    source.close()
    assert source.display.count >= source.length


@pytest.mark.parametrize("kind", ["mcap", "npz"])
@pytest.mark.parametrize("form", list(Form))
def test_points_of_every_form_are_as_they_came(form: Form, kind: str, tmp_path: Path) -> None:
    path, found = tmp_path / f"points.{kind}", streamed(form)
    if kind == "mcap":
        with recordings.Writer(path, CONFIG) as into:
            into.records(found[:500], BUILD.clock_hz, BUILD.pixel_width, 1)
            into.records(found[500:], BUILD.clock_hz, BUILD.pixel_width, 1)
    else:
        with atomic_file(path) as file:
            write_points(".npz", file, found, form, 1, BUILD, Account(records=COUNT))
    source, want = opened(path, speed=10.0), table(records.form_points(found, form))
    for name in ("line", "x_mm", "z_mm", "snr", "free_to_mm", "located", "angle_rad"):
        np.testing.assert_array_equal(getattr(source._points, name), getattr(want, name))
    played(source)


def test_raw_lines_are_shown_with_their_own_results(tmp_path: Path) -> None:
    pixels, made = scene_lines(40)
    angle = made["angle"] * (2.0 * np.pi / 2.0**24)
    lines = Lines(pixels, angle, made["power"].astype(np.int64))
    seen = int(np.flatnonzero(made["bits"] & records.MEASURED)[3])
    bare, both = tmp_path / "lines.npz", tmp_path / "both.mcap"
    np.savez(bare, lines=pixels, angle_rad=angle, power=lines.power)
    with recordings.Writer(both, CONFIG) as into:
        into.records(streamed(Form.FULL), BUILD.clock_hz, BUILD.pixel_width, 1)
        into.lines(lines)
    for path, count in ((bare, 40), (both, COUNT)):
        source = opened(path)
        assert source.length == count and source.state.endswith(" 40 raw lines")
        source._play(1 - -seen * count // 40)
        shown = source.display.line
        assert shown is not None and shown.point is not None
        assert np.array_equal(shown.pixels, pixels[shown.line])
        assert shown.line == seen and shown.point.measured[0]
        assert shown.point.position_px[0] == made["position"][seen] / 4096.0
        assert shown.pixels.max() > shown.threshold > np.median(shown.pixels)


@pytest.mark.parametrize("name", ["none.csv", "none.npz", "none.mcap", "cut.npz", "cut.mcap"])
def test_what_is_no_recording_is_told_in_a_line(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if name.startswith("cut"):
        path.write_bytes(b"PK\x03\x04" if name.endswith("npz") else b"\x89MCAP0\r\n")
    with pytest.raises(InputError, match=name) as error:
        opened(path)
    assert "\n" not in str(error.value)
