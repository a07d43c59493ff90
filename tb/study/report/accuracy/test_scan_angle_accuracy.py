"""scan_angle at every phase, amplitude and set of harmonics against (12) in float64."""

import numpy as np
import pytest

from vrscan.data import pkg
from vrscan.study.report.accuracy import angle_accuracy as angle

TURN = 1 << pkg.PHASE_WIDTH


def test_angles_within_bound_and_limit() -> None:
    figures = angle.measure(20_000)
    print(*figures, sep="\n")
    assert len(figures) == 9
    assert sum(figure.limit == angle.LIMIT_URAD for figure in figures) == 3
    for figure in figures:
        assert figure.passes, figure
        assert np.isnan(figure.limit) or figure.predicted <= figure.limit


def test_every_angle_keeps_its_own_bound() -> None:
    for name, given, _ in angle.cases(5_000, np.random.default_rng(1)):
        error, bound = angle.errors(given)
        assert np.all(np.abs(error) <= bound), name


def test_the_cases_are_what_their_names_say() -> None:
    cases = [given for _, given, _ in angle.cases(1_000, np.random.default_rng(1))]
    for given in cases[:3]:
        # All around the turn, a phase in every thousandth of it.
        assert np.array_equal(np.sort(given.phase.ravel()) * 1_000 // TURN, np.arange(1_000))
        assert (given.a[:, 0] == 1 << pkg.MOTION_FRACTION).all() and not given.phi[:, 0].any()
    assert cases[0].amplitude * 360.0 * 2.0**-pkg.AMPLITUDE_FRACTION == pytest.approx(20.5)
    for given in cases[1:3]:
        degrees = 360.0 * given.amplitude * 2.0**-pkg.AMPLITUDE_FRACTION
        assert degrees.min() < 1.0
        assert degrees.max() == pytest.approx(25.0)
    higher = np.abs(cases[2].a[:, 1:]) * 2.0**-pkg.MOTION_FRACTION
    assert higher.max() == pytest.approx(angle.HARMONIC, abs=1e-6)
    assert len(np.unique(cases[2].phi, axis=0)) == angle.SETS
    assert (cases[3].a == (1 << (pkg.MOTION_WIDTH - 1)) - 1).all()
    assert (cases[3].amplitude == (1 << pkg.AMPLITUDE_WIDTH) - 1).all()


def test_harmonics_become_the_words_of_the_ports() -> None:
    a, phi = angle.harmonic_words(
        [[1.0, 0.0], [-0.5, -np.pi / 2.0], [2.0**-22, np.pi], *[[0.0, 0.0]] * 6]
    )
    assert a.tolist() == [1 << 22, -(1 << 21), 1, *[0] * 6]
    assert phi.tolist() == [0, 3 * TURN // 4, TURN // 2, *[0] * 6]


@pytest.mark.parametrize("steps", [1, -1])
def test_a_step_too_much_is_noticed(monkeypatch: pytest.MonkeyPatch, steps: int) -> None:
    exact = angle.scan_angle

    def wrong(*given):
        turns, overflow = exact(*given)
        return turns + steps, overflow

    monkeypatch.setattr(angle, "scan_angle", wrong)
    assert not any(f.passes for f in angle.measure(1_000) if f.name.endswith("degrees, maximum"))


def test_a_missing_gain_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """1.0 of the table taken for a power of two: 30 parts in a million."""
    from vrscan.fixed import scan_angle

    monkeypatch.setattr(scan_angle, "INVERSE_LENGTH", 1 << scan_angle.FRACTION)
    assert not any(f.passes for f in angle.measure(1_000) if not np.isnan(f.predicted))
