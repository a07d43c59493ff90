"""The float chain as a whole: every flag, every row, and where the paper's choices differ."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config
from vrscan.data.points import write_csv
from vrscan.data.table import Table
from vrscan.ideal.chain import run

pytestmark = EACH_SCANNER
COUNT = 1.0 / 4095.0  # a step of 12 bits; light and noise are shares of full scale


def places(config: Config) -> np.ndarray:
    """Return the places of the pixels, px from the middle of the line."""
    return np.arange(config.sensor.line_length) - config.sensor.line_length / 2


def pixel(config: Config, place: Any) -> Any:
    return place + config.sensor.line_length / 2


def top(config: Config) -> int:
    return 2**config.sensor.pixel_width - 1


def spot(config: Config, centre: float, counts: float, sigma: float = 4.0) -> np.ndarray:
    return counts * COUNT * np.exp(-0.5 * ((places(config) - centre) / sigma) ** 2)


def box(config: Config, left: float, right: float, counts: float) -> np.ndarray:
    return np.where((places(config) >= left) & (places(config) < right), counts * COUNT, 0.0)


def chain(
    config: Config, light: np.ndarray, noise: float = 4.0, peak: dict[str, object] | None = None
) -> Table:
    rng = np.random.default_rng(20100301)
    light = np.atleast_2d(light)
    shares = light + COUNT * (60.0 + noise * rng.standard_normal(light.shape))
    lines = np.clip(np.round(shares * top(config)), 0, top(config)).astype(np.uint16)
    config = config.model_copy(update={"peak": config.peak.model_copy(update=peak or {})})
    count = len(lines)
    return run(lines, np.full(count, 0.2), np.full(count, 30_000), config)


def flags(result: Table) -> set[str]:
    assert len(result) == 1
    return {name for name, rows in result.flags.items() if rows[0]}


def test_a_clean_spot_has_no_flag_and_its_place(config: Config) -> None:
    result = chain(config, spot(config, -23.7, 2000.0))
    assert flags(result) == set()
    assert result.position_px[0] == pytest.approx(pixel(config, -23.7), abs=0.05)
    assert 0.005 < result.sigma_px[0] < 0.05
    assert result.c_obj[0] == 1.0
    assert result.c_sfm[0] == 0.0


def test_an_empty_line_is_free_space(config: Config) -> None:
    result = chain(config, spot(config, 0.0, 0.0))
    assert "LOW_SNR" in flags(result)
    assert not result.measured[0]
    assert result.c_obj[0] == 0.0
    assert result.c_sfm[0] == pytest.approx(30_000 / 65_535)


@pytest.mark.parametrize(
    ("name", "light"),
    [
        ("TOO_NARROW", lambda c: box(c, -100, -99, 1000.0)),
        ("TOO_WIDE", lambda c: spot(c, -24.0, 2000.0, 100.0)),
        ("AT_EDGE MIXED", lambda c: spot(c, 2.0 - pixel(c, 0.0), 2000.0)),
        ("AT_EDGE MIXED", lambda c: spot(c, pixel(c, 0.0) - 3.0, 2000.0)),
        ("SATURATED", lambda c: spot(c, -24.0, 6000.0)),
        ("RIVAL", lambda c: spot(c, -300.0, 2000.0) + spot(c, 250.0, 1500.0)),
    ],
    ids=["narrow", "wide", "first", "last", "saturated", "rival"],
)
def test_each_flag_has_its_cause(
    name: str, light: Callable[[Config], np.ndarray], config: Config
) -> None:
    result = chain(config, light(config))
    assert flags(result) == set(name.split())
    assert result.measured[0] == (not name.startswith("TOO"))


def test_the_mirrors_flags_go_with_their_lines(config: Config) -> None:
    counts = top(config) * (spot(config, -23.7, 2000.0) + 60.0 * COUNT)
    lines = np.tile(np.round(counts).astype(np.uint16), (8, 1))
    result = run(lines, np.full(8, 0.2), np.full(8, 30_000), config, mirror_flags=np.arange(8))
    for bit, name in enumerate(("NOT_RUNNING", "INDEX_FAULT", "UNSETTLED")):
        assert result.flags[name].tolist() == [bool(k >> bit & 1) for k in range(8)]
    assert result.located.all()
    assert len(set(result.z_mm.tolist())) == 1


def test_a_flat_window_has_no_phase(config: Config) -> None:
    """One window is flat; a second one has dark beside it, and the middle."""
    light = box(config, -324, -304, 9000.0)
    result = chain(config, light, peak={"window": "threshold"})
    assert flags(result) == {"SATURATED", "NO_PHASE"}
    assert not result.measured[0]
    result = chain(config, light)
    assert flags(result) == {"SATURATED"}
    assert result.position_px[0] == pytest.approx(pixel(config, -314.5), abs=0.1)


def test_without_noise_the_ratio_is_the_largest(config: Config) -> None:
    result = chain(config, spot(config, -24.0, 2000.0), noise=0.0)
    assert flags(result) == {"NO_NOISE"}
    assert result.snr[0] == np.inf
    assert result.measured[0]


def test_a_flat_line_is_low_whatever_its_noise(config: Config) -> None:
    assert {"LOW_SNR", "NO_NOISE"} <= flags(chain(config, spot(config, 0.0, 0.0), noise=0.0))


def test_saturated_twentyfold_is_still_in_the_middle(config: Config) -> None:
    result = chain(config, spot(config, -23.6, 20 * 4095.0, 6.0))
    assert result.position_px[0] == pytest.approx(pixel(config, -23.6), abs=0.1)


def test_row_statistics_see_the_peak_and_background_does_not(config: Config) -> None:
    light, step = spot(config, -24.0, 3000.0, 10.0), COUNT * top(config)
    background = chain(config, light, peak={"noise": "background"})
    row = chain(config, light, peak={"noise": "row"})
    assert background.noise[0] == pytest.approx(4.0 * step, rel=0.1)
    assert row.noise[0] == pytest.approx(row.row_variance[0] ** 0.5)
    assert row.noise[0] > 0.05 * 3000.0 * step
    assert row.background[0] == row.row_mean[0] > background.background[0] + 20.0 * step
    assert row.width[0] < background.width[0]


def test_many_lines_are_rows_in_order(config: Config) -> None:
    centres = np.linspace(-0.35, 0.33, 1300) * config.sensor.line_length
    result = chain(config, np.stack([spot(config, c, 1000.0) for c in centres]))
    assert result.line.tolist() == list(range(1300))
    assert np.abs(result.position_px - pixel(config, centres)).max() < 0.2


@pytest.mark.parametrize("window", ["threshold", "two_pass"])
def test_no_lines_are_no_rows(window: str, config: Config) -> None:
    peak = config.peak.model_copy(update={"window": window})
    config = config.model_copy(update={"peak": peak})
    nothing = np.zeros((0, config.sensor.line_length), np.uint16)
    result = run(nothing, np.zeros(0), np.zeros(0, int), config)
    file = io.BytesIO()
    write_csv(result, file)
    assert file.getvalue().count(b"\n") == 1  # the heading
