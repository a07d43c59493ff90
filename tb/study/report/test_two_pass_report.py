"""The accurate mode against its goals; the whole study is ``vrscan efficiency``."""

import io
import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from harness import generator
from rich.console import Console
from rich.table import Table

from vrscan.data import pkg
from vrscan.data.config import Config, Peak
from vrscan.engines.engine import Engine
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal import two_pass as ideal
from vrscan.ideal.chain import run as run_ideal
from vrscan.registers.chain_registers import Registers
from vrscan.study.report import numbers
from vrscan.study.report import two_pass_report as two_pass
from vrscan.study.report.efficiency import cell_lines

TWO = Config(peak=Peak(window="two_pass"))
# Of an efficiency of 0.97: the two errors are correlated by 0.985, so 1,500 lines tell their ratio
# to sqrt(2 / 1500 * 2 * 0.03) = 0.9 %.
COUNT, CHANCE = 1500, 0.018


@pytest.mark.parametrize("engine", [Engine.FIXED, Engine.IDEAL])
def test_efficiency_reaches_the_goal_in_every_corner(engine: Engine) -> None:
    """The narrowest and widest spots at the least and largest heights, and beside a rung."""
    cells = two_pass.study(engine, Config(), COUNT, peaks=(0.05, 0.09, 0.9), sigmas_px=(1, 2, 12))
    for cell in cells:
        assert cell.two_pass >= two_pass.GOAL - CHANCE, cell
        assert cell.lost == 0.0, cell
    assert np.mean([cell.two_pass for cell in cells]) >= two_pass.GOAL + CHANCE / 3
    assert np.mean([cell.one_pass for cell in cells]) < 0.93
    for cell in two_pass.study(engine, Config(), COUNT, peaks=(0.02,), sigmas_px=(1, 12)):
        assert cell.two_pass >= two_pass.GOAL_DIM, cell
        assert cell.one_pass < two_pass.GOAL_DIM, cell
        assert cell.lost <= 0.002, cell


def test_the_score_reaches_the_bound() -> None:
    """The efficient score's mean square is the bound, whatever the spot, within chance."""
    for sigma, peak in ((1.0, 0.05), (4.0, 0.9), (12.0, 0.02)):
        lines, true, bound = cell_lines(sigma, peak, 2000, Config())
        score = two_pass.efficient_score(lines.lines, true, sigma, peak, Config())
        assert np.square(score).mean() / bound.mean() == pytest.approx(1.0, abs=0.12)
        assert abs(score.mean()) < 4 * np.sqrt(bound.mean() / 2000)


@pytest.mark.parametrize("engine", [Engine.FIXED, Engine.IDEAL])
def test_a_skewed_spot_stays(engine: Engine) -> None:
    one, two = two_pass.skew_positions(engine, Config(), 600)
    assert np.ptp(two) < two_pass.GOAL_SKEW_PX
    assert np.ptp(two) < np.ptp(one)


@pytest.mark.parametrize("engine", [Engine.FIXED, Engine.IDEAL])
def test_a_slope_costs_next_to_nothing(engine: Engine) -> None:
    """Less than the goal in the mean, and not a hundredth more scatter."""
    for result in two_pass.slope_study(engine, Config(), 300):
        assert abs(result.bias) < two_pass.GOAL_SLOPE_PX, result
        assert result.rms < 1.01 * result.level_rms + 1e-4, result


def test_without_the_baseline_a_slope_pulls(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the goal of the slope is worth: the same windows on the background as it is."""
    monkeypatch.setattr(ideal, "baseline", lambda lines, *_: np.zeros(len(lines)))
    results = two_pass.slope_study(Engine.IDEAL, Config(), 100, peaks=(0.2,), sigmas_px=(3.0, 8.0))
    assert all(abs(result.bias) > 4 * two_pass.GOAL_SLOPE_PX for result in results)


def test_the_study_knows_the_slope() -> None:
    """One count a px at the spot, none where the statistics look."""
    place = np.arange(-400.0, 401.0)
    rise = two_pass.sloping(place)
    near = np.abs(place) <= two_pass.SLOPE_REACH_PX
    assert np.allclose(rise[near], two_pass.SLOPE * place[near])
    assert not rise[np.abs(place) >= two_pass.SLOPE_END_PX].any()


def shown(grid: Table) -> list[list[str]]:
    """Return the cells of a table's rows as they are printed."""
    console = Console(width=120, file=io.StringIO())
    console.print(grid)
    assert isinstance(console.file, io.StringIO)
    return [re.split(r"\s{2,}", row.strip()) for row in console.file.getvalue().splitlines()]


def test_tables_have_a_row_a_height() -> None:
    """The numbers of each in its place, whatever order they come in."""
    cells = [
        two_pass.Cell(sigma, peak, 0.9 + peak / 100, 0.95 + sigma / 1000, 0.0)
        for peak, sigma in itertools.product((0.02, 0.5), (8.0, 3.0))
    ]
    rows = shown(two_pass.efficiency_grid(cells, Engine.FIXED, 50))
    assert ["2 %", "0.900/0.953", "0.900/0.958"] in rows
    assert ["50 %", "0.905/0.953", "0.905/0.958"] in rows
    rows = shown(two_pass.skew_grid(np.array([-0.1, 0.25]), np.array([-0.2, -0.21]), (0.2, 0.9)))
    assert ["one pass", "-0.100", "0.250", "0.3500"] in rows
    assert ["two passes", "-0.200", "-0.210", "0.0100"] in rows
    slopes = [two_pass.Slope(3.0, 0.2, -0.001, 0.0112, 0.0111)]
    assert ["20 %", "-1.00; 11.1, 11.2"] in shown(two_pass.slope_grid(slopes))


def test_figures_fail_where_something_is_missed() -> None:
    good = two_pass.Cell(3.0, 0.5, 0.92, 0.97, 0.0)
    slope = two_pass.Slope(3.0, 0.5, -0.001, 0.01, 0.01)
    still, moved = np.array([1.0, 1.01]), np.array([1.0, 1.03])
    dim = two_pass.Cell(1.0, 0.02, 0.8, 0.93, 0.0)

    def holds(cells: list[two_pass.Cell], places: np.ndarray, slopes: list) -> list[bool]:
        found = numbers.two_pass_figures(cells, (moved, places), slopes)
        return [figure.passes for figure in found if figure.judged]

    assert holds([good, dim], still, [slope]) == [True] * 4
    missed = (
        ([replace(good, two_pass=0.949), dim], still, [slope]),
        ([good, replace(dim, two_pass=0.899)], still, [slope]),
        ([good, dim], moved, [slope]),
        ([good, dim], still, [slope, replace(slope, bias=-0.006)]),
    )
    for k, given in enumerate(missed):
        assert holds(*given) == [k != n for n in range(4)]


def spots(count: int, salt: int) -> np.ndarray:
    """Return lines with a spot each, of any width and height, saturated ones and rivals too."""
    draw = generator(salt)
    place = np.arange(2048)
    centre, sigma = draw.uniform(10, 2038, (count, 1)), 10 ** draw.uniform(0, 1.2, (count, 1))
    height = 10 ** draw.uniform(2.3, 4.0, (count, 1))
    lines = 60 + height * np.exp(-0.5 * ((place - centre) / sigma) ** 2)
    rival = centre + sigma * draw.uniform(6, 12, (count, 1))
    share = draw.uniform(0, 0.6, (count, 1)) * (draw.random((count, 1)) < 0.3)
    lines += share * np.minimum(height, 4000) * np.exp(-0.5 * ((place - rival) / sigma) ** 2)
    lines += 4 * draw.standard_normal(lines.shape)
    return np.clip(np.round(lines), 0, 4095).astype(np.uint16)


def harmonic_by_definition(
    line: np.ndarray, left: int, width: int, *, slope: float, background: float, noise: float
) -> tuple[float, float]:
    """Return position and standard deviation, px, of (8) with T = N as a sum of complex numbers."""
    step = np.arange(width)
    pixels = line[left : left + width].astype(float)
    turn = np.exp(2j * np.pi * step / width)
    harmonic = ((pixels - slope * (step - (width - 1) / 2)) * turn).sum()
    phase = np.angle(harmonic) % (2 * np.pi)
    variance = noise**2 + TWO.peak.kappa * np.maximum(pixels - background, 0.0)
    across = np.imag(turn * np.exp(-1j * phase))
    spread = np.sqrt((variance * across**2).sum()) / np.abs(harmonic)
    return left + width * phase / (2 * np.pi), width * spread / (2 * np.pi)


def test_model_is_the_float_chain_on_every_line() -> None:
    """Flags, windows, positions and sigmas of all lines, also where the windows differ.

    What a window is rounded by moves its ends by a pixel or so (``test_peak_refine``): there the
    position has to be that of float64 in the model's own window, within the bound of one window
    and what the baseline's rounding adds.
    """
    lines = spots(1500, 1)
    nothing = np.zeros(len(lines), np.int64)
    got = run_fixed(lines, nothing, nothing, Registers.from_config(TWO))
    want = run_ideal(lines, np.zeros(len(lines)), nothing, TWO)
    assert got.measured.all() and want.measured.all()
    for name, bit in pkg.FLAGS.items():
        if bit <= pkg.FLAG_ROW_STATISTICS:
            assert np.array_equal(got.flags >> bit & 1 == 1, want.flags[name]), name
    assert (np.abs(got.width - want.width) <= 0.03 * want.width + 1).all()
    assert (np.abs(got.left - want.left) <= 0.015 * want.width + 2).all()
    same = (got.left == want.left) & (got.width == want.width)
    assert same.mean() > 0.7

    slope = ideal.baseline(lines, got.left, got.width, want.noise)
    place, sigma = np.transpose(
        [
            harmonic_by_definition(
                lines[k], int(got.left[k]), int(got.width[k]), slope=slope[k],
                background=want.background[k], noise=want.noise[k],
            )
            for k in range(len(lines))
        ]
    )  # fmt: skip
    bound = two_pass.rounding_bound(got.width, 16.0 * (got.maximum - 60.0))
    error = np.abs(got.position / 2**pkg.POSITION_FRACTION - place)
    print(
        f"\n{np.mean(~same):.1%} of the windows differ, error / bound {(error / bound).max():.3f}"
    )
    assert (error <= bound).all(), error.max()
    assert np.percentile(error, 99) < 4e-4
    # Sigma is good to 0.5 % or a step.
    steps = sigma * 2**pkg.SIGMA_FRACTION
    assert (np.abs(got.sigma - steps) <= np.maximum(1.0, 0.005 * steps)).all()


def test_sigma_is_the_spread() -> None:
    """The point's own sigma, over the bound's spots, is their root mean square error."""
    for sigma, peak in ((2.0, 0.2), (8.0, 0.05)):
        lines, true, _ = cell_lines(sigma, peak, 1500, Config())
        nothing = np.zeros(1500, np.int64)
        got = run_fixed(lines.lines, nothing, nothing, Registers.from_config(TWO))
        error = got.position / 2**pkg.POSITION_FRACTION - true
        told = got.sigma / 2**pkg.SIGMA_FRACTION
        assert np.sqrt(np.square(error).mean()) == pytest.approx(told.mean(), rel=0.08)


def test_a_spot_that_comes_from_the_edge() -> None:
    """Centred on the last pixel and beyond: AT_EDGE, a position on the sensor, never a crash."""
    place = np.arange(2048)
    centre = np.linspace(2030, 2060, 61)[:, None]
    lines = 60 + 2000 * np.exp(-0.5 * ((place - centre) / 4.0) ** 2)
    noise = 3 * generator(3).standard_normal(lines.shape)
    lines = np.clip(np.round(lines + noise), 0, 4095).astype(np.uint16)
    lines = np.concatenate([lines, lines[:, ::-1]])
    nothing = np.zeros(len(lines), np.int64)
    got = run_fixed(lines, nothing, nothing, Registers.from_config(TWO))
    at_edge = got.flags >> pkg.FLAG_AT_EDGE & 1 == 1
    near = np.tile(centre[:, 0] > 2034.5, 2)
    assert (near & got.measured).sum() > 40
    assert at_edge[near & got.measured].all()
    assert (got.position[got.measured] >= 0).all()
    assert (got.position < 2048 << pkg.POSITION_FRACTION).all()
    assert (got.left >= 0).all() and (got.right <= 2047).all()
    assert got.measured.mean() > 0.6
