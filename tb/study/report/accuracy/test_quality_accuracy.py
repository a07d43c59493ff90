"""S/N and sigma of whole lines against float64 from the same pixels: 0.5 % or one step."""

import numpy as np
import pytest

from vrscan.data.config import Config
from vrscan.study.report.accuracy import quality_accuracy as quality


def test_snr_and_sigma_within_bound_and_limit() -> None:
    figures = quality.measure(1_000)
    print(*figures, sep="\n")
    for figure in figures:
        assert figure.passes, figure


@pytest.mark.parametrize("pixel_width", [8, 16])
def test_the_other_pixel_widths_too(pixel_width: int) -> None:
    config = Config.model_validate({"peak": quality.WINDOW, "sensor": {"pixel_width": pixel_width}})
    found = quality.compare(quality.spots(600, config, np.random.default_rng(3)), config)
    loud = found.noise >= quality.LEAST_NOISE_STEPS
    assert loud.sum() > 300
    assert found.snr[loud].max() <= 1.0
    assert found.sigma.max() <= 1.0
    assert np.all(found.snr <= found.snr_bound + 1e-9)
    assert np.all(found.sigma <= found.sigma_bound + 1e-9)


def test_each_line_keeps_its_own_bound() -> None:
    for period in ("n", "n-1"):
        config = Config.model_validate({"peak": {**quality.WINDOW, "period": period}})
        found = quality.compare(quality.spots(800, config, np.random.default_rng(4)), config)
        assert np.all(found.snr <= found.snr_bound + 1e-9)
        assert np.all(found.sigma <= found.sigma_bound + 1e-9)
        assert len(found.sigma) > 400


def test_a_sigma_that_is_a_hundredth_off_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    config = Config.model_validate({"peak": quality.WINDOW})
    lines = quality.spots(300, config, np.random.default_rng(5))
    right = quality.compare(lines, config)
    kappa = config.peak.kappa * 1.02
    wrong = config.model_copy(update={"peak": config.peak.model_copy(update={"kappa": kappa})})
    exact = quality.Registers.from_config(wrong)
    monkeypatch.setattr(quality.Registers, "from_config", lambda _: exact)
    assert right.sigma.max() <= 1.0 < quality.compare(lines, config).sigma.max()
