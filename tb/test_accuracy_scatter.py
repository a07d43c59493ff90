"""Noise is understood: the phase law, and sigma against the scatter of noisy lines."""

import pytest

from vrscan.report.accuracy import scatter


def test_scatter_is_that_of_the_law_and_of_sigma() -> None:
    """Within four deviations of what so many lines can tell; sigma is good to 5 %."""
    figures = scatter.measure(1_000)
    print(*figures, sep="\n")
    for figure in figures:
        law = "snr1" in figure.name
        assert figure.measured == pytest.approx(1.0, abs=0.03 if law else 0.05 + 4 * 0.0224), figure
