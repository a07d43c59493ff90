"""The float chain as a whole: every flag, every row, and where the paper's choices differ."""

import io

import numpy as np
import pytest

from vrscan.data.config import Config
from vrscan.data.points import write_csv
from vrscan.data.table import Table
from vrscan.ideal.chain import run

LENGTH = 2048
STEP = np.arange(LENGTH)


def spot(centre: float, height: float, sigma: float = 4.0) -> np.ndarray:
    return height * np.exp(-0.5 * ((STEP - centre) / sigma) ** 2)


def chain(light: np.ndarray, noise: float = 4.0, peak: dict[str, object] | None = None) -> Table:
    rng = np.random.default_rng(20100301)
    light = np.atleast_2d(light)
    counts = light + 60.0 + noise * rng.standard_normal(light.shape)
    lines = np.clip(np.round(counts), 0, 4095).astype(np.uint16)
    config = Config.model_validate({"peak": peak or {}})
    count = len(lines)
    return run(lines, np.full(count, 0.2), np.full(count, 30_000), config)


def flags(result: Table) -> set[str]:
    assert len(result) == 1
    return {name for name, rows in result.flags.items() if rows[0]}


def test_a_clean_spot_has_no_flag_and_its_place() -> None:
    result = chain(spot(1000.3, 2000.0))
    assert flags(result) == set()
    assert result.position_px[0] == pytest.approx(1000.3, abs=0.05)
    assert 0.005 < result.sigma_px[0] < 0.05
    assert result.c_obj[0] == 1.0
    assert result.c_sfm[0] == 0.0


def test_an_empty_line_is_free_space() -> None:
    result = chain(np.zeros(LENGTH))
    assert "LOW_SNR" in flags(result)
    assert not result.measured[0]
    assert result.c_obj[0] == 0.0
    assert result.c_sfm[0] == pytest.approx(30_000 / 65_535)


@pytest.mark.parametrize(
    ("name", "light"),
    [
        ("TOO_NARROW", np.where(STEP == 700, 1000.0, 0.0)),
        ("TOO_WIDE", spot(1000.0, 2000.0, 100.0)),
        ("AT_EDGE MIXED", spot(2.0, 2000.0)),
        ("AT_EDGE MIXED", spot(2045.0, 2000.0)),
        ("SATURATED", spot(1000.0, 6000.0)),
        ("RIVAL", spot(400.0, 2000.0) + spot(1500.0, 1500.0)),
    ],
)
def test_each_flag_has_its_cause(name: str, light: np.ndarray) -> None:
    result = chain(light)
    assert flags(result) == set(name.split())
    assert result.measured[0] == (not name.startswith("TOO"))


def test_the_mirrors_flags_go_with_their_lines() -> None:
    lines = np.tile(np.round(spot(1000.3, 2000.0) + 60.0).astype(np.uint16), (8, 1))
    result = run(lines, np.full(8, 0.2), np.full(8, 30_000), Config(), mirror_flags=np.arange(8))
    for bit, name in enumerate(("NOT_RUNNING", "INDEX_FAULT", "UNSETTLED")):
        assert result.flags[name].tolist() == [bool(k >> bit & 1) for k in range(8)]
    assert result.located.all()
    assert len(set(result.z_mm.tolist())) == 1


def test_a_flat_window_has_no_phase() -> None:
    """One window is flat; a second one has dark beside it, and the middle."""
    box = np.where((STEP >= 700) & (STEP < 720), 9000.0, 0.0)
    result = chain(box, peak={"window": "threshold"})
    assert flags(result) == {"SATURATED", "NO_PHASE"}
    assert not result.measured[0]
    result = chain(box)
    assert flags(result) == {"SATURATED"}
    assert result.position_px[0] == pytest.approx(709.5, abs=0.1)


def test_without_noise_the_ratio_is_the_largest() -> None:
    result = chain(spot(1000.0, 2000.0), noise=0.0)
    assert flags(result) == {"NO_NOISE"}
    assert result.snr[0] == np.inf
    assert result.measured[0]


def test_a_flat_line_is_low_whatever_its_noise() -> None:
    assert {"LOW_SNR", "NO_NOISE"} <= flags(chain(np.zeros(LENGTH), noise=0.0))


def test_saturated_twentyfold_is_still_in_the_middle() -> None:
    result = chain(spot(1000.4, 20 * 4095.0, 6.0))
    assert result.position_px[0] == pytest.approx(1000.4, abs=0.1)


def test_row_statistics_see_the_peak_and_background_does_not() -> None:
    light = spot(1000.0, 3000.0, 10.0)
    background = chain(light, peak={"noise": "background"})
    row = chain(light, peak={"noise": "row"})
    assert background.noise[0] == pytest.approx(4.0, rel=0.1)
    assert row.noise[0] == pytest.approx(row.row_variance[0] ** 0.5)
    assert row.noise[0] > 0.05 * 3000.0
    assert row.background[0] == row.row_mean[0] > background.background[0] + 20.0
    assert row.width[0] < background.width[0]


def test_many_lines_are_rows_in_order() -> None:
    centres = np.linspace(300.0, 1700.0, 1300)
    result = chain(np.stack([spot(c, 1000.0) for c in centres]))
    assert result.line.tolist() == list(range(1300))
    assert np.abs(result.position_px - centres).max() < 0.2


@pytest.mark.parametrize("window", ["threshold", "two_pass"])
def test_no_lines_are_no_rows(window: str) -> None:
    config = Config.model_validate({"peak": {"window": window}})
    result = run(np.zeros((0, LENGTH), np.uint16), np.zeros(0), np.zeros(0, int), config)
    file = io.BytesIO()
    write_csv(result, file)
    assert file.getvalue().count(b"\n") == 1  # the heading
