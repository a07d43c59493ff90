"""cordic_vector at its shipped widths against float64, by decade of the input's amplitude."""

import pytest

from vrscan.study.report.accuracy import cordic_accuracy as cordic


def test_angle_within_bound_and_limit_at_every_amplitude() -> None:
    figures = cordic.measure(20_000)
    print(*figures, sep="\n")
    assert len(figures) == 14
    for figure in figures:
        assert figure.passes, figure
        assert figure.predicted <= figure.limit


def test_a_step_and_a_half_too_much_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = cordic.cordic_vector

    def wrong(x, y, **widths):
        angle, magnitude, zero = exact(x, y, **widths)
        return angle + 1, magnitude, zero

    monkeypatch.setattr(cordic, "cordic_vector", wrong)
    assert not any(figure.passes for figure in cordic.measure(1_000))
