"""x, z and sigma_z over the whole field of view against (3) to (5) in float64."""

import dataclasses

import numpy as np
import pytest

from vrscan.data.config import Geometry
from vrscan.study.report.accuracy import geometry_accuracy as geometry


def test_points_within_bound_and_limit() -> None:
    figures = geometry.measure(6)
    print(*figures, sep="\n")
    assert len(figures) == 4
    assert sum(figure.predicted <= figure.limit for figure in figures) == 3
    for figure in figures:
        assert figure.judged and figure.passes, figure


def test_every_point_keeps_its_own_bound() -> None:
    instruments = list(geometry.instruments())
    assert len(instruments) == geometry.INSTRUMENTS > 1
    for instrument in instruments:
        found = geometry.evaluate(instrument, 5, np.random.default_rng(1))
        assert np.all(found.place_mm <= found.bound_mm), instrument
        assert np.all(found.sigma_z <= found.sigma_bound), instrument


def test_the_view_is_the_whole_sensor_at_every_distance() -> None:
    position, angle = geometry.view(Geometry(), 4, 2048, np.random.default_rng(1))
    assert np.array_equal(np.unique((position + 2048) >> 12), np.arange(2048))
    found = geometry.ideal.triangle(
        geometry.ideal.undistorted(position / 4096.0, Geometry())[0],
        angle * (2.0 * np.pi / (1 << 24)),
        Geometry(),
    )
    assert found.z.min() == pytest.approx(250.0, abs=0.1)
    assert found.z.max() == pytest.approx(1000.0, abs=0.1)


def test_distortion_reaches_one_percent_at_the_edge() -> None:
    for instrument in list(geometry.instruments())[1:]:
        edge = np.array([2047.0])
        u, _ = geometry.ideal.undistorted(edge, instrument)
        share = u[0] / (instrument.pitch_mm * (edge[0] - instrument.centre_px)) - 1.0
        assert abs(share) == pytest.approx(0.01)


def test_a_coarser_constant_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """e0 one part in 2**18 off."""
    exact = geometry.Registers.from_config

    def wrong(config):
        registers = exact(config)
        return dataclasses.replace(registers, e0=registers.e0 + (1 << 12))

    monkeypatch.setattr(geometry.Registers, "from_config", wrong)
    assert not all(figure.passes for figure in geometry.measure(2))
