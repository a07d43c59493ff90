"""Noise is understood: the phase law, and sigma against the scatter of noisy lines."""

import math

from scipy.stats import chi2, norm

from vrscan.study.report.accuracy import scatter_accuracy as scatter

COUNT = 1_000
CHANCE = norm.sf(4.0)  # of either end: four deviations


def ends(count: int) -> tuple[float, float]:
    """Return between what the rms of so many standard normal numbers lies, but for CHANCE."""
    low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], count)
    return math.sqrt(low / count), math.sqrt(high / count)


def test_scatter_is_that_of_the_law_and_of_sigma() -> None:
    """Each within the chi-square of its windows or lines; sigma as a whole is good to 3 %."""
    figures = scatter.measure(COUNT)
    print(*figures, sep="\n")
    laws = [figure for figure in figures if "snr1" in figure.name]
    sigmas = [figure for figure in figures if "predicted sigma" in figure.name]
    assert len(laws) == 5 and len(sigmas) == 10 and len(figures) == 15
    for some, count in ((laws, 20 * COUNT), (sigmas, COUNT)):
        low, high = ends(count)
        for figure in some:
            assert low <= figure.measured <= high, figure
    # All spots together tell more than one of them.
    low, high = ends(len(sigmas) * COUNT)
    assert 0.97 < low < high < 1.03
    assert low <= math.sqrt(sum(f.measured**2 for f in sigmas) / len(sigmas)) <= high
