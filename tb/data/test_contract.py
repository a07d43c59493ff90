"""What goes into the engines: all three take the same lines and refuse the same, in one line."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scanners import EACH_SCANNER

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.lines import Lines
from vrscan.engines import engine as engines
from vrscan.engines.chain_engine import run_rtl
from vrscan.engines.engine import Engine
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal.chain import run as run_ideal
from vrscan.registers.chain_registers import Registers, angle_turns

LENGTH = 2048
SPOT = np.full((3, LENGTH), 60, np.uint16)
SPOT[:, 1000:1008] = 100, 400, 900, 3000, 2900, 800, 400, 100
STILL = np.zeros(3)
POWER = np.full(3, 20_000)
HALF_TURN = 2**23
CONFIG = Config.model_validate({"laser": {"power_max": 40_000}})
REGISTERS = Registers.from_config(CONFIG)


def run_turns(engine: Callable[..., Any], recording: Lines) -> Any:
    """Run an engine of integers, past ``engines.run``."""
    turns = angle_turns(recording.angle_rad)
    flags = recording.mirror_flags
    return engine(recording.lines, turns, recording.power, REGISTERS, mirror_flags=flags)


def outcome(call: Callable[[], Any]) -> int | str:
    """Return the number of points, or the one line that says what was wrong."""
    try:
        return len(call())
    except InputError as error:
        text = str(error)
    assert text and "\n" not in text
    return text


def outcomes(recording: Lines) -> list[int | str]:
    """Return what each engine makes of lines."""
    return [outcome(lambda e=engine: engines.run(e, recording, CONFIG)) for engine in Engine]


def recorded(**changed: Any) -> Lines:
    return Lines(**{"lines": SPOT, "angle_rad": STILL, "power": POWER} | changed)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "a list of nothing": (
        {"lines": np.array([])},
        "lines must have shape [n, 2048] (have (0,))",
    ),
    "negative pixels": (
        {"lines": SPOT.astype(np.int16) - 61},
        "pixel no whole number from 0 to 4095 (-1 at line 0, pixel 0)",
    ),
    "half a count": (
        {"lines": SPOT + 0.5},
        "pixel no whole number from 0 to 4095 (60.5 at line 0, pixel 0)",
    ),
    "no counts": (
        {"lines": np.where(SPOT == 3000, np.nan, SPOT)},
        "pixel no whole number from 0 to 4095 (nan at line 0, pixel 1003)",
    ),
    "lines of objects": (
        {"lines": SPOT.astype(object)},
        "lines must be whole numbers (are object)",
    ),
    "lines of truth": ({"lines": SPOT > 60}, "lines must be whole numbers (are bool)"),
    "one line": ({"lines": SPOT[0]}, "lines must have shape [n, 2048] (have (2048,))"),
    "short lines": (
        {"lines": SPOT[:, :1000]},
        "lines must have shape [n, 2048] (have (3, 1000))",
    ),
    "pixels of 16 bits": (
        {"lines": SPOT << np.uint16(3)},
        "pixel above 4095 (7200 at line 0, pixel 1002)",
    ),
    "no angle": ({"angle_rad": STILL * np.nan}, "angle_rad outside -pi to pi (nan at line 0)"),
    "infinite angle": (
        {"angle_rad": np.array([0, 0, -np.inf])},
        "angle_rad outside -pi to pi (-inf at line 2)",
    ),
    "a turn and more": (
        {"angle_rad": np.array([0, 7.0, 0])},
        "angle_rad outside -pi to pi (7.0 at line 1)",
    ),
    "scalar angle": ({"angle_rad": np.float64(0.1)}, "angle_rad must have shape (3,) (has ())"),
    "angles in a column": (
        {"angle_rad": STILL[:, None]},
        "angle_rad must have shape (3,) (has (3, 1))",
    ),
    "angles in turns": (
        {"angle_rad": np.zeros(3, int)},
        "angle_rad must be floating point (is int64)",
    ),
    "complex angles": (
        {"angle_rad": STILL + 0j},
        "angle_rad must be floating point (is complex128)",
    ),
    "half a power": ({"power": POWER + 0.5}, "power outside the whole numbers (20000.5 at line 0)"),
    "power on or off": ({"power": POWER > 0}, "power must be whole numbers (is bool)"),
    "negative power": ({"power": -POWER}, "power outside 0 to 40000 (-20000 at line 0)"),
    "too much power": (
        {"power": np.array([1, 40_001, 1], np.uint16)},
        "power outside 0 to 40000 (40001 at line 1)",
    ),
    "enormous power": (
        {"power": np.full(3, 2**64 - 1, np.uint64)},
        "power outside 0 to 40000 (18446744073709551615 at line 0)",
    ),
    "few powers": ({"power": POWER[:2]}, "power must have shape (3,) (has (2,))"),
    "negative flags": ({"mirror_flags": -1}, "mirror_flags outside 0 to 7 (-1 at line 0)"),
    "a fourth flag": (
        {"mirror_flags": np.array([7, 0, 8])},
        "mirror_flags outside 0 to 7 (8 at line 2)",
    ),
    "no flags": (
        {"mirror_flags": STILL * np.nan},
        "mirror_flags outside the whole numbers (nan at line 0)",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_one_engine_refuses_all_refuse_in_the_same_words(name: str) -> None:
    changed, text = REFUSED[name]
    assert outcomes(recorded(**changed)) == [text] * 3


@EACH_SCANNER
def test_all_engines_take_the_lines_of_their_own_sensor_only(config: Config) -> None:
    length, top = config.sensor.line_length, 2**config.sensor.pixel_width - 1
    lines = np.full((3, length), top, np.uint16)
    most = f"pixel above {top} ({top + 1} at line 0, pixel 0)"
    shape = f"lines must have shape [n, {length}] (have (3, {length - 1}))"
    for some, want in ((lines, 3), (lines + np.uint16(1), most), (lines[:, 1:], shape)):
        recording = recorded(lines=some)
        assert [outcome(lambda e=e, r=recording: engines.run(e, r, config)) for e in Engine] == (
            [want] * 3
        )


def test_no_lines_are_an_empty_table_of_every_engine() -> None:
    nothing = recorded(lines=SPOT[:0], angle_rad=STILL[:0], power=POWER[:0])
    assert outcomes(nothing) == [0] * 3
    assert len(run_turns(run_fixed, nothing)) == len(run_turns(run_rtl, nothing)) == 0


FROZEN = SPOT.copy()
FROZEN.setflags(write=False)
TAKEN: dict[str, dict[str, Any]] = {
    "big-endian": {
        "lines": SPOT.astype(">u2"),
        "angle_rad": STILL.astype(">f4"),
        "power": POWER.astype(">i4"),
    },
    "every second of a column-major array": {"lines": np.asfortranarray(SPOT.repeat(2, 0))[::2]},
    "backwards": {"lines": SPOT[::-1, ::-1][:, ::-1], "power": POWER[::-1]},
    "read-only": {"lines": FROZEN},
    "other integers": {"power": POWER.astype(np.uint16), "mirror_flags": np.zeros(3, np.int8)},
    "lists": {"angle_rad": [0.0, 0.0, 0.0], "power": [20_000] * 3},
}


@pytest.mark.parametrize("engine", Engine)
@pytest.mark.parametrize("name", TAKEN)
def test_how_an_array_lies_in_memory_changes_no_point(name: str, engine: Engine) -> None:
    want = engines.run(engine, recorded(), CONFIG)
    got = engines.run(engine, recorded(**TAKEN[name]), CONFIG)
    assert want.located.all()
    for column in ("angle_rad", "position_px", "x_mm", "z_mm", "c_sfm"):
        assert np.array_equal(getattr(got, column), getattr(want, column)), column


TURNS = np.zeros(3, np.int64)
REFUSED_WORDS: dict[str, tuple[dict[str, Any], str]] = {
    "half a turn": (
        {"angle": TURNS + HALF_TURN},
        "angle outside -8388608 to 8388607 (8388608 at line 0)",
    ),
    "less than half a turn": (
        {"angle": np.array([0, -HALF_TURN - 1, 0])},
        "angle outside -8388608 to 8388607 (-8388609 at line 1)",
    ),
    "angle in rad": ({"angle": STILL}, "angle must be integers (is float64)"),
    "scalar angle": ({"angle": 0}, "angle must have shape (3,) (has ())"),
    "power of 17 bits": ({"power": POWER * 4}, "power outside 0 to 65535 (80000 at line 0)"),
    "negative power": ({"power": -POWER}, "power outside 0 to 65535 (-20000 at line 0)"),
    "half a power": ({"power": POWER + 0.5}, "power outside the whole numbers (20000.5 at line 0)"),
    "pixels of 16 bits": (
        {"lines": SPOT << np.uint16(3)},
        "pixel above 4095 (7200 at line 0, pixel 1002)",
    ),
    "short lines": (
        {"lines": SPOT[:, :1000]},
        "lines must have shape [n, 2048] (have (3, 1000))",
    ),
}


@pytest.mark.parametrize("engine", [run_fixed, run_rtl])
@pytest.mark.parametrize("name", REFUSED_WORDS)
def test_words_that_do_not_fit_are_refused(name: str, engine: Callable[..., Any]) -> None:
    changed, text = REFUSED_WORDS[name]
    words = {"lines": SPOT, "angle": TURNS, "power": POWER} | changed
    with pytest.raises(ValueError, match=f"^{re.escape(text)}$"):
        engine(*words.values(), REGISTERS)


def test_the_equations_alone_refuse_the_same() -> None:
    """``ideal.run`` is called past ``engines.run``, too."""
    for changed, text in REFUSED.values():
        given = recorded(**changed)
        flags = given.mirror_flags
        with pytest.raises(ValueError, match=f"^{re.escape(text)}$"):
            run_ideal(given.lines, given.angle_rad, given.power, CONFIG, mirror_flags=flags)


# ---- any arrays ----


@dataclass(frozen=True)
class Some:
    """An array, and whether an engine takes it."""

    array: np.ndarray
    good: bool


def frozen(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.setflags(write=False)
    return array


ORDERS = (np.ascontiguousarray, np.asfortranarray, lambda array: array[::-1], frozen)


@st.composite
def any_lines(draw: st.DrawFn, count: int, wild: bool) -> Some:
    """Lines of any type of numbers and order in memory, if wild of any type, shape, brightness."""
    kinds = ["<u2", ">u2", "u1", "i2", "u4", "f4"]
    shapes, tops = [(count, LENGTH)], [3000, 4095]
    kind = draw(st.sampled_from(kinds + wild * ["?", "c8", "O", "U4"]))
    others = [(count, LENGTH - 1), (LENGTH,), (1, count, LENGTH), (count, 0), ()]
    shape = draw(st.sampled_from(shapes + wild * others))
    top = draw(st.sampled_from(tops + wild * [4096, 65_535]))
    array = np.resize(SPOT, shape)
    array = np.where(array == SPOT.max(), top, array).astype(kind)
    good = kind in kinds and shape in shapes
    good = good and array.min(initial=0) >= 0 and array.max(initial=0) <= 4095
    return Some(draw(st.sampled_from(ORDERS))(array) if array.ndim else array, good)


@st.composite
def any_column(
    draw: st.DrawFn,
    count: int,
    wild: bool,
    kinds: list[str],
    others: list[str],
    limits: list[float],
    beyond: list[float],
    scalar: bool = False,
) -> Some:
    """One value a line, and if wild of any type, shape and size; ``scalar``: or one for all."""
    shapes: list[tuple[int, ...]] = [(count,)] + scalar * [()]
    kind = draw(st.sampled_from(kinds + wild * others))
    shape = draw(st.sampled_from(shapes + wild * [(count + 1,), (count, 1), ()]))
    array = np.full(shape, draw(st.sampled_from(limits))).astype(kind)
    if array.size:
        value = draw(st.sampled_from(limits + wild * beyond))
        with np.errstate(all="ignore"):  # many do not fit in the type: they are what comes of it
            array.flat[draw(st.integers(0, 2)) % array.size] = np.asarray(value).astype(kind)[()]
    values = array.real.ravel().tolist() if count else []
    fits = all(limits[0] <= value <= limits[1] for value in values)
    return Some(array, kind in kinds and shape in shapes and fits)


@st.composite
def recordings(draw: st.DrawFn) -> tuple[Lines, bool]:
    """Lines with their columns, any of which may be wild, and whether all are as they must be."""
    count = draw(st.integers(0, 3))
    wild = draw(st.sampled_from([(), (), (0,), (1,), (2,), (3,), (0, 1, 2, 3)]))
    whole = ["i1", "i8", ">i4", "u1", "u2", "u8", "f8"], ["?", "c16", "O"]
    real = ["f4", ">f8", "f8", "g"], ["i8", "?", "c16", "O"]
    parts = (
        draw(any_lines(count, 0 in wild)),
        draw(any_column(count, 1 in wild, *real, [-3.0, 0.25], [4.0, -7.0, np.nan, np.inf])),
        draw(any_column(count, 2 in wild, *whole, [0, 100], [-1, 40_001, 70_000, 2**62])),
        draw(any_column(count, 3 in wild, *whole, [0, 7], [-1, 8, 300], scalar=True)),
    )
    lines, angle, power, flags = (part.array for part in parts)
    return Lines(lines, angle, power, mirror_flags=flags), all(part.good for part in parts)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(recordings())
def test_any_arrays_are_points_of_every_engine_or_one_line_of_refusal(
    drawn: tuple[Lines, bool],
) -> None:
    recording, good = drawn
    got = outcomes(recording)
    assert got == [got[0]] * 3
    assert got[0] == len(recording) if good else isinstance(got[0], str), got[0]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(recordings())
def test_any_words_are_points_of_rtl_and_model_or_one_line_of_refusal(
    drawn: tuple[Lines, bool],
) -> None:
    recording, good = drawn
    try:
        turns = angle_turns(recording.angle_rad)
    except InputError:
        assert not good
        return
    words = recording.lines, turns, recording.power, REGISTERS
    flags = recording.mirror_flags
    got = [
        outcome(lambda e=engine: e(*words, mirror_flags=flags)) for engine in (run_fixed, run_rtl)
    ]
    assert got[0] == got[1]
    assert isinstance(got[0], str) or got[0] == len(recording)
    assert not good or got[0] == len(recording)
