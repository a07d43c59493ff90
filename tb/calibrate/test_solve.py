"""Robust least squares and the simplex search, on problems whose answer is known."""

import numpy as np

from vrscan.calibrate.solve import Parameter, least_squares, simplex

ONE, TWO = Parameter("one", "", 0.0, 1.0), Parameter("two", "", 0.0, 1.0)


def test_a_straight_line_has_the_textbook_deviations() -> None:
    draw = np.random.default_rng(3)
    t = np.linspace(-1.0, 1.0, 400)
    y = 0.3 + 0.2 * t + 0.01 * draw.standard_normal(400)
    fit = least_squares(lambda v: (v[0] + v[1] * t - y) / 0.01, [ONE, TWO])
    assert fit.observed.all()
    wanted = 0.01 / np.sqrt([400.0, np.sum(t * t)])
    assert np.allclose(fit.sigma, wanted, rtol=0.15)
    assert np.all(np.abs(fit.values - [0.3, 0.2]) < 4.0 * wanted)
    assert abs(fit.correlation[0, 1]) < 0.05


def test_what_the_residuals_do_not_tell_keeps_its_start() -> None:
    """A parameter without effect, and two that have the same one."""
    blind = Parameter("blind", "", 0.7, 0.1)
    fit = least_squares(lambda v: 100.0 * (v[0] - 0.4) * np.ones(50), [ONE, blind])
    assert fit.observed.tolist() == [True, False]
    assert fit.value("blind") == 0.7 and abs(fit.value("one") - 0.4) < 1e-6
    same = least_squares(lambda v: 100.0 * (v[0] + v[1] - 0.4) * np.ones(50), [ONE, TWO])
    assert same.observed.sum() == 1


def test_the_simplex_search_finds_a_valley() -> None:
    values, _, calls = simplex(
        lambda v: float(abs(v[0] - 0.3) + abs(v[1] + 0.2)), [ONE, TWO], most=400
    )
    assert np.allclose(values, [0.3, -0.2], atol=1e-3)
    assert calls <= 400
