"""The optics of a scanner: what the sensor sees, and what each distance costs."""

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config, Geometry, Sensor
from vrscan.data.errors import InputError
from vrscan.ideal.free_space import visible
from vrscan.ideal.geometry import radial_error
from vrscan.study.layout import check, layout, terminal

NARROW = Config(geometry=Geometry(focal_mm=60.0), sensor=Sensor(line_length=1024))


@EACH_SCANNER
def test_the_check_agrees_with_what_is_visible(config: Config) -> None:
    """Against the interval of the free space, which comes from the sensor's ends."""
    near, far = (float(end) for end in visible(np.zeros(()), config))
    far = min(far, 0.999 * config.free.far_mm)
    check(config, near * 1.001, far)
    with pytest.raises(InputError, match=r"^near_mm = "):
        check(config, near * 0.999, far)


def test_the_advice_helps() -> None:
    """What the message says to change is enough, and hardly more than enough."""
    turned = Config(geometry=Geometry(bias_deg=100.0))
    with pytest.raises(InputError, match=r"bias_deg = 80\.8 sees both ends") as caught:
        check(turned, 240.0, 800.0)
    assert "\n" not in str(caught.value)
    check(Config(geometry=Geometry(bias_deg=80.8)), 240.0, 800.0)

    with pytest.raises(InputError, match="focal_mm of at most") as caught:
        check(NARROW, 240.0, 1000.0)
    words = str(caught.value).replace(",", "").split()
    focal, length, bias = (
        float(words[words.index(name) + skip])
        for name, skip in (("focal_mm", 4), ("line_length", 2), ("bias_deg", 2))
    )
    for share, sees in ((0.99, True), (1.03, False)):
        config = Config(
            geometry=Geometry(focal_mm=focal * share, bias_deg=bias), sensor=NARROW.sensor
        )
        if sees:
            check(config, 240.0, 1000.0)
        else:
            with pytest.raises(InputError):
                check(config, 240.0, 1000.0)
    long = Sensor(line_length=round(1.01 * length))
    check(Config(geometry=Geometry(focal_mm=60.0, bias_deg=bias), sensor=long), 240.0, 1000.0)


@EACH_SCANNER
def test_a_range_that_is_none_is_refused(config: Config) -> None:
    beyond = 2.0 * config.geometry.range_mm
    for near, far, word in (
        (500.0, 400.0, "near_mm"),
        (0.0, 9.0, "near_mm"),
        (9.0, beyond, "far_mm"),
    ):
        with pytest.raises(InputError, match=rf"^{word} = "):
            check(config, near, far)


@EACH_SCANNER
def test_the_step_is_that_of_the_papers_error(config: Config) -> None:
    """(6) gives the error of a pixel by range; it is exact where the axis meets the point."""
    ends_mm = config.focus.near_mm, config.focus.far_mm
    found = layout(config, *ends_mm, 60)
    geometry = config.geometry
    on_axis = int(np.abs(found.position_px - geometry.centre_px).argmin())
    beam = np.hypot(found.z_mm, geometry.base_mm)
    along = radial_error(beam, geometry.pitch_mm, geometry)
    assert found.step_mm[on_axis] == pytest.approx(along[on_axis], rel=0.01)
    assert np.all(np.diff(found.step_mm) > 0.0)
    assert np.all(found.sigma_mm == found.noise_px * found.step_mm)
    free = config.free.model_copy(update={"darkest": 4.0 * config.free.darkest})
    bright = layout(config.model_copy(update={"free": free}), 0.8 * ends_mm[1], ends_mm[1])
    dark = layout(config, 0.8 * ends_mm[1], ends_mm[1])
    assert dark.noise_px / bright.noise_px == pytest.approx(2.0)  # by the root of the light


@EACH_SCANNER
def test_the_drawing_has_every_part(config: Config) -> None:
    ends_mm = config.focus.near_mm, config.focus.far_mm
    drawn = terminal(config, *ends_mm).plain
    for mark in "MCNF.=":
        assert mark in drawn
    rows = drawn.splitlines()
    beam = next(row for row in rows if row.startswith("M"))
    assert beam.index("N") == round(ends_mm[0] / ends_mm[1] * 71) and beam.endswith("F")


@EACH_SCANNER
def test_lateral_error_angle_and_scan_are_those_of_the_papers(config: Config) -> None:
    """e_l = r p_p / f (6), p_a = atan(e_l / r) (7), with p_p of the table; dwell (1-40)."""
    near, far = config.focus.near_mm, config.focus.far_mm
    found, geometry, mirror = layout(config, near, far), config.geometry, config.mirror
    error_mm = found.noise_px * geometry.pitch_mm
    assert found.lateral_mm == pytest.approx(found.z_mm * error_mm / geometry.focal_mm)
    assert 1e-6 * found.angle_urad == pytest.approx(np.arctan(error_mm / geometry.focal_mm))
    if mirror.polygon:
        rate = 2.0 * np.radians(360.0 / mirror.facets) * mirror.frequency_hz
    else:
        k = np.arange(1, 2 * len(mirror.harmonics), 2)
        a, phi = np.array(mirror.harmonics).T
        slope = np.sum(k * a * np.sin(k * 0.5 * np.pi - phi))
        rate = 2.0 * np.pi * mirror.frequency_hz * np.radians(mirror.amplitude_deg) * slope
    assert 1e-6 * found.dwell_us == pytest.approx(found.across_mm / found.z_mm / rate, rel=1e-5)
    step = rate / config.line.rate_hz
    assert found.spacing_mm == pytest.approx(found.z_mm * np.tan(step), rel=1e-5)
