"""Position of phase_correlate and peak_position against (8) in float64, on the same integers."""

import dataclasses

import numpy as np
import pytest

from vrscan.study.report.accuracy import position_accuracy as position
from vrscan.study.report.figure import Figure


def figures(period_n: bool, every: int = 3) -> list[Figure]:
    """Return the figures of a third of all widths, the narrowest and the widest among them."""
    return position.measure(position.sweep(2, 2, every=every, period_n=period_n), period_n=period_n)


@pytest.mark.parametrize("period_n", [True, False])
def test_position_within_bound_and_limit(period_n: bool) -> None:
    """Every shape, pedestals to 95 % of full scale, and the worst windows there can be."""
    found = figures(period_n)
    print(*found, sep="\n")
    assert len(found) == 8
    assert sum(not np.isnan(figure.limit) for figure in found) == 7
    for figure in found:
        assert figure.judged and figure.passes, figure


@pytest.mark.parametrize("period_n", [True, False])
def test_the_widths_keep_the_limit_for_any_window(period_n: bool) -> None:
    """Not a measurement: the bound over every N, every heights and every pedestal."""
    bound = position.guarantee(period_n=period_n)
    print(f"T = {'N' if period_n else 'N - 1'}: {1e3 * bound:.4f} of 0.3 in 1e-3 px")
    assert bound <= position.LIMIT_MAX


@pytest.mark.parametrize("period_n", [True, False])
def test_every_width_is_measured_on_every_pedestal(period_n: bool) -> None:
    draw = np.random.default_rng(1)
    widths = np.arange(position.NARROWEST, position.WIDEST + 1)
    for pedestal in position.PEDESTALS:
        level = np.full(len(widths), pedestal)
        group = position.windows("Gaussian", widths, level, period_n=period_n, draw=draw)
        lowest = np.where(np.arange(255) < widths[:, None], group.pixels, 9999).min(axis=1)
        assert np.all(lowest >= np.floor(pedestal * 4095))
        assert np.all(group.background <= lowest.astype(np.int64) << 12)
        outcome = position.evaluate(group, period_n=period_n)
        good = outcome.ratio >= position.LEAST_RATIO
        assert np.abs(outcome.error[good]).max() <= position.LIMIT_MAX
        assert np.all(np.abs(outcome.error) <= outcome.bound)


def test_a_small_error_of_the_phase_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """40 steps of 24 bits, 0.6e-3 px at N = 255."""
    exact = position.phase_correlate

    def wrong(*arguments, **settings):
        found = exact(*arguments, **settings)
        return dataclasses.replace(found, phase=(found.phase + 40) % (1 << 24))

    monkeypatch.setattr(position, "phase_correlate", wrong)
    failed = [figure for figure in figures(True, every=9) if not figure.passes]
    assert {"ratio >= 0.1, rms", "largest share of a window's own bound"} <= {
        figure.name for figure in failed
    }
