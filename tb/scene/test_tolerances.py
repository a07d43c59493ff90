"""The instrument as it is, against the one that its configuration believes in."""

import math
from pathlib import Path

import numpy as np
import pytest

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.ideal.geometry import project
from vrscan.ideal.motion import motion
from vrscan.scene import tolerances
from vrscan.scene.description import Description, load, load_instrument
from vrscan.scene.light import Light
from vrscan.scene.simulate import Scanner
from vrscan.scene.timeline import Scan, timeline
from vrscan.scene.tolerances import Instrument, drawn, written

CONFIG = Config()
QUIET = Scan(jitter_ns=0.0)


def _with(instrument: Instrument | None) -> Description:
    return load("default").model_copy(update={"instrument": instrument, "scan": QUIET})


def test_without_a_difference_the_lines_are_the_same() -> None:
    plain, same = (
        Scanner(Light(_with(own), CONFIG), 64, frozenset()).part(0).lines
        for own in (None, Instrument())
    )
    assert np.array_equal(plain.lines, same.lines)
    assert np.array_equal(plain.angle_rad, same.angle_rad)


def test_the_light_sees_the_truth_and_the_angle_is_believed() -> None:
    own = drawn(5)
    light = Light(_with(own), CONFIG)
    made = Scanner(light, 400, frozenset()).part(0)
    truth = made.lines.truth
    assert truth is not None
    assert light.belief == CONFIG
    # The place of the spot's image is that of the true camera, not of the believed one.
    for config, least, most in ((light.config, 0.0, 1e-6), (CONFIG, 1.0, math.inf)):
        apart = project(truth.x_mm, truth.z_mm, config.geometry) - truth.position_px
        assert least <= np.nanmax(np.abs(apart)) <= most
    phase = CONFIG.mirror.frequency_hz * made.timeline.time_s
    assert own.harmonics is not None
    angle = motion(phase, math.radians(CONFIG.mirror.amplitude_deg), own.harmonics)
    assert np.abs(angle - made.timeline.angle_rad).max() < 1e-11


def test_a_wrong_index_mark_scales_the_angle() -> None:
    """Twice a period the mark is passed: its share of error is the share of the angle's error."""
    own = Instrument(index_deg=CONFIG.mirror.index_deg + math.degrees(1e-3))
    lines = timeline(0, 3000, 3000, CONFIG, QUIET, 1, own)
    share = CONFIG.mirror.index_deg / (CONFIG.mirror.index_deg + math.degrees(1e-3))
    assert np.abs(lines.reported_rad - share * lines.angle_rad).max() < 2e-7
    assert np.abs(lines.reported_rad - lines.angle_rad).max() > 1e-3


def test_an_operating_point_is_believed_by_the_slopes() -> None:
    """Where the truth lies on the straight lines of the configuration, its angle is right."""
    mirror = CONFIG.mirror
    away = 0.004
    rows = (np.array(mirror.harmonics) + away * np.array(mirror.slopes)).tolist()
    rows[0] = [1.0, 0.0]
    scale = 1.0 + away * mirror.slopes[0][0]
    own = Instrument(drive_phase=mirror.drive_phase + away, harmonics=rows)
    lines = timeline(0, 3000, 3000, CONFIG, QUIET, 1, own)
    plain = timeline(0, 3000, 3000, CONFIG, QUIET, 1, own.model_copy(update={"drive_phase": None}))
    right = np.abs(lines.reported_rad - lines.angle_rad).max()
    wrong = np.abs(plain.reported_rad - plain.angle_rad).max()
    print(f"scale {scale:.6f}: with slopes {1e6 * right:.1f} urad, without {1e6 * wrong:.1f}")
    assert right < 0.2 * wrong


def test_it_warms_up() -> None:
    own = Instrument(temperature_k=10.0, warm_s=100.0, index_urad_per_k=6.0)
    assert own.warmth_k(0.0) == 0.0
    assert own.warmth_k(100.0) == pytest.approx(10.0 * (1.0 - math.exp(-1.0)))
    late = own.true(CONFIG, 420.0, 1e4).mirror.index_deg
    assert math.radians(late - CONFIG.mirror.index_deg) == pytest.approx(6e-5, rel=1e-9)


def test_the_image_grows_with_a_near_focus() -> None:
    """The thin lens: f of (4) is the sensor's distance, 1 / (1/f - 1/z)."""
    own = Instrument(reference_focus_mm=420.0)
    focal = CONFIG.geometry.focal_mm
    for focus in (250.0, 420.0, 1000.0):
        scale = own.true(CONFIG, focus).geometry.focal_mm / focal
        wanted = (1.0 - focal / 420.0) / (1.0 - focal / focus)
        assert scale == pytest.approx(wanted, rel=1e-12)
    with pytest.raises(InputError, match="no farther than the focal length"):
        own.true(CONFIG, 20.0)


def test_drawn_within_the_tolerances_and_again_the_same() -> None:
    geometry, mirror = CONFIG.geometry, CONFIG.mirror
    spread = []
    for seed in range(40):
        own = drawn(seed)
        assert own == drawn(seed)
        assert own.base_mm is not None and own.index_deg is not None
        assert abs(own.base_mm - geometry.base_mm) <= tolerances.BASE_MM
        assert abs(math.radians(own.index_deg - mirror.index_deg)) <= 1e-3
        spread.append(own.base_mm)
    assert np.ptp(spread) > 1.5 * tolerances.BASE_MM
    with pytest.raises(InputError, match="--seed"):
        drawn(-1)


def test_a_file_of_it_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    own = drawn(3)
    path.write_text(written(own))
    assert load_instrument(path) == own
    for text, wanted in (
        ("[instrument]\nbase_mm = -1.0\n", "instrument.base_mm"),
        ("[instrument]\nharmonics = [[1.0]]\n", "pairs"),
        ("base_mm = 60.0\n", "unknown key base_mm"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=wanted) as caught:
            load_instrument(path)
        assert "\n" not in str(caught.value)
