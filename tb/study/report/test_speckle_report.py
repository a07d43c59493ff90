"""Speckled lines: the fit is near the bound that knows of speckle, and its sigma holds."""

import numpy as np

from vrscan.data.config import Config
from vrscan.engines.engine import Engine
from vrscan.study.report import numbers
from vrscan.study.report.speckle_report import SPOTS, mean_efficiency, speckle_table, study
from vrscan.study.report.spot_lines import most_contrast

COUNT = 250  # lines a spot: a variance is known to 9 %, the mean of 24 to 2 %


def test_the_fit_is_near_the_bound_with_speckle() -> None:
    """Neighbours are alike by rho, and 1 + 2 rho is what that adds to the bound's variance."""
    done: list[int] = []
    cells = study(Engine.FIXED, Config(), COUNT, done.append)
    assert done == list(range(1, SPOTS + 1))
    reached = 1.0 / (1.0 + 2.0 * most_contrast(Config())[1])
    fit, two, one = (mean_efficiency(cells, name) for name in ("fit", "two_pass", "threshold"))
    print(f"\nefficiency {fit:.3f}, {two:.3f}, {one:.3f}; with alike neighbours {reached:.3f}")
    assert 0.9 * reached < fit < 1.07 * reached
    assert one < two < 0.35
    for cell in cells:
        assert cell.speckled_px > 2.0 * cell.bound_px
        assert cell.scores["fit"].lost < 0.01
        assert 0.7 < cell.scores["fit"].ratio < 1.25 and cell.scores["fit"].within > 0.9
        assert cell.scores["threshold"].ratio > 3.0
    assert speckle_table(cells, Engine.FIXED, COUNT).row_count == SPOTS
    figures = {each.name: each.measured for each in numbers.speckle_figures(cells)}
    assert figures["fit, geometric mean"] == fit
    assert figures["fit, error over sigma, largest"] < 1.25
    alone = figures["fit, over the bound of light alone, geometric mean"]
    ratio = [(cell.bound_px / cell.speckled_px) ** 2 for cell in cells]
    assert np.isclose(alone, fit * np.exp(np.mean(np.log(ratio))))
