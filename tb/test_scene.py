"""The simple light: truth that agrees with itself, noise of the stated size, and the bound."""

import numpy as np
import pytest

from vrscan.config import Config
from vrscan.engines import Engine, run
from vrscan.ideal import geometry as g
from vrscan.report.scan import compare, stray
from vrscan.scene.sensor import cramer_rao_variance, expose, spot_electrons
from vrscan.scene.simple import SCENES, simulate
from vrscan.scene.surfaces import Cylinder, Segment, first_hit

SEED = 20100301


def test_truth_is_on_the_ray_and_where_the_camera_sees_it() -> None:
    config = Config()
    recording = simulate(SCENES["default"], 500, config)
    truth = recording.truth
    assert truth is not None
    assert np.allclose(truth.x_mm, truth.z_mm * np.tan(recording.angle_rad))
    seen = np.isfinite(truth.position_px)
    assert 0.9 < seen.mean() < 1.0
    u, _ = g.undistorted(truth.position_px[seen], config.geometry)
    found = g.triangle(u, recording.angle_rad[seen], config.geometry)
    assert np.allclose(found.z, truth.z_mm[seen])
    assert set(truth.names) == {"plane", "step", "cylinder"}
    assert set(truth.surface) == {0, 1, 2}


def test_the_same_seed_gives_the_same_lines() -> None:
    first, second = (simulate(SCENES["step"], 50, Config()) for _ in range(2))
    other = simulate(SCENES["step"], 50, Config(), seed=1)
    assert np.array_equal(first.lines, second.lines)
    assert not np.array_equal(first.lines, other.lines)


def test_hidden_spots_leave_the_line_dark() -> None:
    recording = simulate(SCENES["step"], 3000, Config())
    truth = recording.truth
    assert truth is not None
    hidden = np.isnan(truth.position_px)
    assert 10 < hidden.sum() < 300
    assert recording.lines[hidden].max() < 100


def test_the_default_scene_is_measured_as_well_as_predicted() -> None:
    config = Config()
    recording = simulate(SCENES["default"], 3000, config)
    result = run(Engine.IDEAL, recording, config)
    truth = recording.truth
    assert truth is not None
    for row in compare(result, truth):
        assert row.points >= 0.99 * row.lines
        assert row.rms_percent < 0.01
        assert row.max_percent < 0.1
        assert 0.9 < row.ratio < 1.1
    assert stray(result, truth) == 0


def test_a_spot_holds_its_electrons_wherever_it_is() -> None:
    position = np.array([100.0, 100.3, 1999.7, np.nan, -3.0])
    sigma = np.array([1.0, 2.5, 6.0, 2.0, 2.0])
    electrons = spot_electrons(position, sigma, np.full(5, 1000.0), 2048)
    whole = 1000.0 * sigma * np.sqrt(2 * np.pi)
    assert np.allclose(electrons[:3].sum(axis=1), whole[:3], rtol=1e-12)
    centre = (electrons[:3] * np.arange(2048)).sum(axis=1) / whole[:3]
    assert np.allclose(centre, position[:3], atol=1e-9)
    assert not electrons[3].any()
    assert 0.0 < electrons[4].sum() < 0.2 * whole[4]  # most of it falls beside the sensor


def test_noise_has_the_stated_size() -> None:
    rng = np.random.default_rng(SEED)
    light = np.zeros((200, 2048))
    light[:, 1000:] = 5000.0
    counts = expose(
        light, rng, background_counts=60.0, read_noise_counts=3.0, kappa=0.2, pixel_width=12
    ).astype(float)
    dark, bright = counts[:, :1000], counts[:, 1000:]
    assert dark.mean() == pytest.approx(60.0, abs=0.05)
    assert dark.var() == pytest.approx(9.0 + 0.2 * 60.0 + 1 / 12, rel=0.02)
    assert bright.mean() == pytest.approx(1060.0, abs=0.1)
    assert bright.var() == pytest.approx(9.0 + 0.2 * 1060.0 + 1 / 12, rel=0.02)


def test_the_bound_is_the_closed_form_at_both_ends() -> None:
    sigma, height, step = np.array([4.0]), np.array([1e4]), 1e-3
    spot, ahead, behind = (
        spot_electrons(np.array([1000.3 + s]), sigma, height, 2048) for s in (0.0, step, -step)
    )
    slope = (ahead - behind) / (2 * step)
    white = cramer_rao_variance(0.0 * spot, slope, 100.0**2)[0] ** 0.5
    # Pixels blur the spot: its variance grows by 1/12 px^2 and its slope falls.
    assert white == pytest.approx(1.0623 * np.sqrt(4.0) * 100.0 / 1e4, rel=0.02)
    shot = cramer_rao_variance(spot, slope, 1e-9)[0] ** 0.5
    assert shot == pytest.approx(np.sqrt(16.0 + 1 / 12) / np.sqrt(spot.sum()), rel=0.001)


def test_rays_meet_the_nearest_surface_from_either_side() -> None:
    wall = Segment("wall", 0.5, (-100.0, 500.0), (100.0, 500.0))
    post = Cylinder("post", 0.5, (0.0, 400.0), 50.0)
    origin = np.zeros((4, 2))
    direction = np.array([[0.0, 1.0], [0.19, 1.0], [0.3, 1.0], [0.0, -1.0]])
    direction /= np.hypot(direction[:, :1], direction[:, 1:])
    distance, cosine, surface = first_hit((wall, post), origin, direction)
    assert surface.tolist() == [1, 0, -1, -1]
    assert distance[0] == pytest.approx(350.0)
    assert cosine[0] == pytest.approx(1.0)
    assert (distance * direction[:, 1])[1] == pytest.approx(500.0)
    assert np.isinf(distance[2:]).all()
    behind = first_hit((wall,), np.array([[0.0, 700.0]]), np.array([[0.0, -1.0]]))
    assert behind[0][0] == pytest.approx(200.0)
