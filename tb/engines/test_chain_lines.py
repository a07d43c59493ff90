"""The whole chain at the shipped sizes, from C++: RTL against the model, line for line."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from harness import generator
from scanners import EACH_SENSOR

from vrscan.data import pkg
from vrscan.data.config import Config, Geometry, Peak, Sensor
from vrscan.data.points import Points, points_equal
from vrscan.engines.chain_engine import latencies, run_rtl
from vrscan.fixed.vrscan_chain import MAX_WINDOW, first_windows, latency, min_period, run_fixed
from vrscan.ideal.geometry import undistorted
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.registers.free_table import HALF

SHIPPED = Config()


def spots(count: int, salt: int, sensor: Sensor = SHIPPED.sensor) -> np.ndarray:
    """Return lines with a spot of any width, height and place, with noise, rivals and slopes."""
    draw = generator(salt)
    length, top = sensor.line_length, 2**sensor.pixel_width - 1
    place = np.arange(length)
    lines = np.zeros((count, length))
    for row in range(count):
        background = draw.random() ** 3 * 0.9 * top
        noise = 10 ** draw.uniform(-1.5, 2) * top / 4095
        line = background + noise * draw.standard_normal(length)
        for _ in range(1 + (draw.random() < 0.3)):
            centre, width = draw.uniform(-5, length + 5), 10 ** draw.uniform(-0.5, 1.7)
            height = 10 ** draw.uniform(-2, 0.5) * top
            line += height * np.exp(-(((place - centre) / width) ** 2))
        line += draw.choice([0, 0, 0.02]) * place * top / length
        lines[row] = line
    return np.clip(np.round(lines), 0, top).astype(np.uint16)


def plateaus(count: int, salt: int, sensor: Sensor = SHIPPED.sensor) -> np.ndarray:
    """Return lines with a window of each width 0..MaxWindow and beyond, in random order."""
    draw = generator(salt)
    length, top = sensor.line_length, 2**sensor.pixel_width - 1
    lines = draw.integers(top // 100, top // 68, size=(count, length))
    widths = draw.permutation(np.arange(max(count, 300)) % 300)[:count]
    for row, width in enumerate(widths):
        left = int(draw.integers(0, length - width + 1))
        lines[row, left : left + width] = draw.integers(top // 4, top + 1, width)
    lines[:7] = 0
    lines[1] = top
    lines[2, 1000] = top
    lines[3, :100] = lines[4, -100:] = top
    lines[5] = np.arange(length) % 2 * top
    lines[6] = np.arange(length) % 3
    lines[6, -3:] = top - 1, 300, 301  # its position rounds up to LineLength, which does not fit
    return lines.astype(np.uint16)


def extremes(registers: Registers, draw: np.random.Generator) -> Registers:
    """Return registers at random over their whole range."""

    def word(bits: int) -> int:
        return int(draw.integers(1 << bits)) >> int(draw.integers(bits))

    return Registers(
        **vars(registers)
        | {
            "period_n": bool(draw.integers(2)),
            "noise_row": bool(draw.integers(2)),
            "even": bool(draw.integers(2)),
            "k_noise": word(11),
            "k_height": word(16),
            "snr_min": word(12),
            "min_width": word(4),
            "max_width": 255 - word(4),
            "kappa": word(pkg.KAPPA_WIDTH),
            "tolerance": word(pkg.TOLERANCE_WIDTH),
            "c_sfm_gain": word(pkg.GAIN_WIDTH),
            "c_obj_gain": word(pkg.OBJECT_GAIN_WIDTH) * int(draw.integers(2)),
            "k1": word(22) - word(22),
            "k2": word(24) - word(24),
            "centre": registers.centre + word(26) - word(26),
            "free_begin": word(23) - word(23),
            "free_shift": word(4),
            "free_table_from": tuple(word(pkg.FREE_WIDTH) for _ in range(2 * HALF)),
            "free_table_to": tuple(word(pkg.FREE_WIDTH) for _ in range(2 * HALF)),
        }
    )


WINDOWS = ("threshold", "two_pass", "fit")
EACH_WINDOW = pytest.mark.parametrize("window", WINDOWS)


def with_window(window: str, config: Config = SHIPPED) -> Registers:
    """Return the registers of a configuration with another kind of window."""
    peak = config.peak.model_copy(update={"window": window})
    return Registers.from_config(config.model_copy(update={"peak": peak}))


ONE_PASS, TWO_PASS, _ = map(with_window, WINDOWS)


@EACH_SENSOR
@pytest.mark.parametrize("salt", range(9))
def test_chain_rtl_equals_model_on_whole_lines(salt: int, config: Config) -> None:
    """3,600 lines in all: shipped registers of all modes first, then registers at random."""
    draw = generator(salt)
    registers = with_window(WINDOWS[salt % 3], config)
    if salt > 2:
        registers = extremes(registers, draw)
    some = spots(200, salt, config.sensor), plateaus(200, 100 + salt, config.sensor)
    lines = np.concatenate(some)
    angle = draw.integers(-(1 << 23), 1 << 23, len(lines)) >> draw.integers(0, 5)
    power = draw.integers(0, 1 << 16, len(lines))
    raised = draw.integers(0, 8, len(lines)) * (draw.random(len(lines)) < 0.5)
    want = run_fixed(lines, angle, power, registers, mirror_flags=raised)
    got = run_rtl(lines, angle, power, registers, mirror_flags=raised)
    assert points_equal(got, want) is None


@EACH_SENSOR
@EACH_WINDOW
def test_latency_is_its_formula(window: str, config: Config) -> None:
    """Every width and every unmeasured line, back to back: the clock of each point."""
    mode, sensor = with_window(window, config), config.sensor
    registers = replace(mode, k_height=ONE_PASS.k_height, max_core=255)
    lines = plateaus(320, 7, sensor)
    angle = power = np.zeros(len(lines), np.int64)
    points = run_fixed(lines, angle, power, registers)
    _, first = first_windows(lines, registers, MAX_WINDOW)
    measured = points.measured if registers.window_fit else first.measured
    want = [
        latency(
            int(width),
            measured=bool(m),
            line_length=sensor.line_length,
            pixel_width=sensor.pixel_width,
            first_width=int(before) if registers.window_two_pass else None,
            fit=registers.window_fit,
        )
        for width, m, before in zip(points.width, measured, first.width, strict=True)
    ]
    if registers.window_fit:  # a point comes with the next line, the last one after a wait
        length = sensor.line_length
        period = min_period(length, MAX_WINDOW, two_pass=True, fit=True) or length
        want = [period + clocks for clocks in want[1:]] + [want[-1] + pkg.NEIGHBOUR_CLKS]
    assert latencies(lines, angle, power, registers).tolist() == want
    assert len({*first.width[first.measured].tolist()}) > 200


@EACH_SENSOR
def test_one_bitstream_does_both(config: Config) -> None:
    """The same lines in both modes: other windows, other positions, the same thresholds."""
    lines, nothing = spots(100, 60, config.sensor), np.zeros(100, np.int64)
    one = with_window("threshold", config)
    two = replace(one, window_two_pass=True)
    before, after = (run_rtl(lines, nothing, nothing, r) for r in (one, two))
    both = before.measured & after.measured
    assert both.sum() > 50
    assert (before.position != after.position)[both].mean() > 0.7
    near = np.abs(before.position - after.position)[both & (before.flags == 0)]
    assert np.median(near) < 1 << (pkg.POSITION_FRACTION - 2)
    assert np.array_equal(before.background, after.background)
    assert np.array_equal(before.snr, after.snr)


def test_engines_in_several_threads_do_not_meet() -> None:
    """Three at once, in the mode that each asks for."""
    lines, nothing = spots(90, 80), np.zeros(90, np.int64)
    work = [(k, (ONE_PASS, TWO_PASS)[k % 2]) for k in range(3)]

    def run(part: tuple[int, Registers]) -> Points:
        return run_rtl(lines[part[0] :: 3], nothing[:30], nothing[:30], part[1])

    with ThreadPoolExecutor(3) as pool:
        for (k, registers), got in zip(work, pool.map(run, work), strict=True):
            want = run_fixed(lines[k::3], nothing[:30], nothing[:30], registers)
            assert points_equal(got, want) is None


@EACH_WINDOW
def test_short_lines_come_with_a_gap(window: str) -> None:
    """Lines in whose time no window of 255 pixels is measured: every point, in its clock."""
    peak = Peak.model_validate({"window": window})
    config = Config(peak=peak, sensor=Sensor(line_length=700), geometry=Geometry(centre_px=349.5))
    registers = Registers.from_config(config)
    lines = spots(150, 70)[:, 600:1300]
    nothing = np.zeros(len(lines), np.int64)
    want = run_fixed(lines, nothing, nothing, registers)
    assert points_equal(run_rtl(lines, nothing, nothing, registers), want) is None
    assert 0.2 < want.measured.mean() < 1
    clocks = latencies(lines, nothing, nothing, registers)
    fit = window == "fit"
    idle = latency(0, measured=False, line_length=700, pixel_width=12, fit=fit)
    behind = ~want.measured
    if fit:  # a point comes with the next line
        idle += min_period(700, MAX_WINDOW, two_pass=True, fit=True)
        behind = np.append(behind[1:], False)
    assert (clocks[behind] == idle).any() and clocks.min() == idle


@EACH_SENSOR
def test_every_flag_that_a_good_line_can_raise(config: Config) -> None:
    """Spots at every angle, a flat box on black and a spot on black: all flags, RTL and model.

    LINES_LOST, POINTS_LOST, ROW_STATISTICS and MAP_FILLED need more: ``test_vrscan_chain``. One
    window alone has NO_PHASE on a box, for a second one has black beside it; a fit alone has MIXED.
    """
    lines = np.concatenate([spots(150, 50, config.sensor), plateaus(300, 51, config.sensor)])
    top = 2**config.sensor.pixel_width - 1
    lines[:2] = 0
    lines[0, 900:910] = top
    lines[1, 900:907] = np.array([5, 40, 900, 3000, 900, 40, 5]) * top // 4095
    angle = generator(52).integers(-(1 << 23), 1 << 23, len(lines))
    geometry, far = config.geometry, 1.5 * config.geometry.range_mm  # the second spot's place
    u, _ = undistorted(np.array(903.0), geometry)
    beta = geometry.bias_rad + np.arctan(u / geometry.focal_mm)
    x = geometry.base_mm - (far - geometry.offset_mm) / np.tan(beta)
    angle[1] = angle_turns(np.arctan2(x, far)[None])[0]
    power = np.zeros(len(lines), np.int64)
    raised = generator(53).integers(0, 8, len(lines))
    raised[:2] = 0
    seen = 0
    for registers in (with_window(each, config) for each in ("fit", "threshold")):
        want = run_fixed(lines, angle, power, registers, mirror_flags=raised)
        got = run_rtl(lines, angle, power, registers, mirror_flags=raised)
        assert points_equal(got, want) is None
        seen |= int(np.bitwise_or.reduce(want.flags))
    unseen = {name for name, bit in pkg.FLAGS.items() if not seen >> bit & 1}
    assert unseen == {"LINES_LOST", "POINTS_LOST", "ROW_STATISTICS", "MAP_FILLED"}
    assert want.flags[0] == sum(
        1 << bit for bit in (pkg.FLAG_SATURATED, pkg.FLAG_NO_PHASE, pkg.FLAG_NO_NOISE)
    )


@EACH_SENSOR
def test_the_mirrors_flags_reach_the_points_and_change_nothing_else(config: Config) -> None:
    """Every combination: NOT_RUNNING, INDEX_FAULT and UNSETTLED by bit, the position stays."""
    registers = Registers.from_config(config)
    lines = spots(64, 54, config.sensor)
    angle = power = np.zeros(len(lines), np.int64)
    raised = np.arange(len(lines)) % 8
    bare = run_fixed(lines, angle, power, registers)
    flagged = run_fixed(lines, angle, power, registers, mirror_flags=raised)
    names = "NOT_RUNNING", "INDEX_FAULT", "UNSETTLED"
    added = sum((raised >> bit & 1) << pkg.FLAGS[name] for bit, name in enumerate(names))
    assert bare.measured.any()
    assert np.array_equal(flagged.flags, bare.flags + added)
    assert points_equal(replace(flagged, flags=bare.flags), bare) is None
    all_of_one = run_rtl(lines, angle, power, registers, mirror_flags=7)
    assert np.array_equal(all_of_one.flags, bare.flags | 7 << pkg.FLAG_NOT_RUNNING)


@pytest.mark.parametrize("engine", [run_fixed, run_rtl])
@pytest.mark.parametrize("wrong", [8, -1])
def test_mirror_flags_that_do_not_fit_are_refused(
    engine: Callable[..., Points], wrong: int
) -> None:
    registers = Registers.from_config(Config())
    lines, nothing = spots(2, 55), np.zeros(2, np.int64)
    with pytest.raises(ValueError, match="mirror_flags"):
        engine(lines, nothing, nothing, registers, mirror_flags=np.array([0, wrong]))
