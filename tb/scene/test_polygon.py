"""The turning polygon: a straight line of every facet, its own start, and what is reported."""

import math
from io import BytesIO

import numpy as np
import pytest

from vrscan.data import edges
from vrscan.data.config import RAMP, SCANNED, STRAIGHT, Config, Mirror, Polygon, checked
from vrscan.data.errors import InputError
from vrscan.ideal.motion import motion
from vrscan.scene.polygon import Turning, lit
from vrscan.scene.timeline import Scan, timeline, write_edges
from vrscan.scene.tolerances import Instrument

CONFIG = Config.model_validate({"mirror": {"kind": "polygon"}})
STEADY = CONFIG.model_copy(update={"polygon": Polygon(speed_ppm=0.0)})
FACET_RAD = math.radians(720.0 / CONFIG.mirror.facets)


def test_the_harmonics_are_the_straight_line_of_least_squares() -> None:
    """They leave less than 1e-6 of a facet where it is scanned, and a solver finds the same."""
    phase = 0.5 + 0.5 * SCANNED * np.cos(np.pi * (np.arange(4000) + 0.5) / 4000)
    k = np.arange(1, 18, 2)
    waves = np.cos(np.pi * np.multiply.outer(phase, k))
    found, *_ = np.linalg.lstsq(waves, 0.5 - phase, rcond=None)
    assert found[0] == pytest.approx(STRAIGHT, abs=1e-9)
    assert found / found[0] == pytest.approx(RAMP, abs=1e-9)
    pairs = Mirror(kind="polygon").harmonics
    left = motion(phase / 2.0, STRAIGHT, pairs) - (0.5 - phase)
    print(f"left of a straight line: {np.abs(left).max():.1e} of a facet")
    assert np.abs(left).max() < 1e-6


def test_a_facet_turns_the_beam_by_twice_its_angle() -> None:
    """Between two starts of scan the beam goes over 720 degrees / facets, at twice the speed."""
    turning = Turning.of(STEADY, 1)
    starts = turning.starts(5, 40)
    jitter = 6.0 * turning.jitter_s * FACET_RAD * turning.frequency_hz
    angle, rate = turning.at(starts)
    assert np.abs(angle - math.radians(CONFIG.mirror.index_deg)).max() < jitter
    turn_hz = CONFIG.mirror.frequency_hz / CONFIG.mirror.facets
    assert rate == pytest.approx(-2.0 * 2.0 * math.pi * turn_hz)
    # The same facet comes again after a turn, and the next one is another.
    errors = np.asarray(turning.errors_rad)
    assert np.diff(starts[:: CONFIG.mirror.facets]) == pytest.approx(1 / turn_hz, abs=1e-8)
    late = np.diff(starts[:12]) - 1 / CONFIG.mirror.frequency_hz
    facets = (np.arange(5, 17)) % CONFIG.mirror.facets
    want = np.diff(errors[facets]) / (FACET_RAD * CONFIG.mirror.frequency_hz)
    assert np.abs(late - want).max() < 12.0 * turning.jitter_s


def test_lines_are_those_that_have_light_whatever_the_blocks() -> None:
    """No angle beyond the reach, no line missing within it, and blocks are parts of the whole."""
    whole = timeline(0, 6000, 6000, STEADY, Scan(), 3)
    reach = math.radians(CONFIG.mirror.reach_deg)
    slack = 6e-6 * CONFIG.polygon.facet_urad
    assert np.abs(whole.angle_rad).max() < reach + slack
    assert whole.angle_rad.max() > reach - 0.01 and whole.angle_rad.min() < -reach + 0.01
    step = np.diff(lit(CONFIG, 0.0, 6000))
    dark = CONFIG.line.rate_hz / CONFIG.mirror.frequency_hz * (1 - 2 * reach / FACET_RAD)
    assert set(step[step > 1].tolist()) <= {math.floor(dark) + 1, math.ceil(dark) + 1}
    part = timeline(2048, 1024, 6000, STEADY, Scan(), 3)
    for name in ("angle_rad", "reported_rad", "time_s"):
        assert np.array_equal(getattr(part, name), getattr(whole, name)[2048:3072])


def test_a_facets_error_is_told_by_its_own_start() -> None:
    """Facets that are off by hundreds of urad leave the jitter alone, and the speed its hunting."""
    rough = STEADY.model_copy(update={"polygon": Polygon(speed_ppm=0.0, facet_urad=500.0)})
    for config, more in ((rough, 0.0), (CONFIG, 1e-6 * CONFIG.polygon.speed_ppm)):
        made = timeline(0, 20_000, 20_000, config, Scan(), 2)
        error = made.reported_rad - made.angle_rad
        one = 1e-9 * config.mems.jitter_ns * FACET_RAD * config.mirror.frequency_hz
        # The speed is the mean of two turns, 0.1 s, so it is behind by 0.05 s of the hunting.
        lag = more * FACET_RAD * 2.0 * math.pi * CONFIG.polygon.hunting_hz * 0.06
        print(
            f"angle error {1e6 * error.std():.2f} urad rms, "
            f"jitter {1e6 * one:.2f}, lag {1e6 * lag:.2f}"
        )
        assert 0.7 * one < error.std() < 1.3 * one + lag


def test_edges_are_pulses_around_the_starts(tmp_path) -> None:
    """The middle of a pulse is the start, and its length that of the way over the diode."""
    file = BytesIO()
    pairs = write_edges(file, 0.0, 0.1, CONFIG, Scan(), 4)
    path = tmp_path / "edges.csv"
    path.write_bytes(file.getvalue())
    time, comparator, gate = edges.read(path)
    begin, end = edges.pairs(time, comparator, gate)
    starts = Turning.of(CONFIG, 4).starts(0, 24)
    assert pairs == len(begin) == 24 and gate.all()
    assert 0.5 * (begin + end) == pytest.approx(starts, abs=2e-12)
    width = 2.0 * math.radians(CONFIG.mems.diode_deg) / FACET_RAD / CONFIG.mirror.frequency_hz
    # Of the beam's light 6e-5 are beside the diode when the beam is in its middle.
    assert end - begin == pytest.approx(width, rel=1e-4)


def test_a_diode_that_stands_elsewhere_turns_all_angles() -> None:
    """What the instrument does not know of its diode is the error of every line."""
    own = Instrument(index_deg=CONFIG.mirror.index_deg + 0.1)
    made = timeline(0, 3000, 3000, STEADY, Scan(), 5, own)
    error = np.degrees(made.reported_rad - made.angle_rad)
    assert error == pytest.approx(-0.1, abs=1e-4)


@pytest.mark.parametrize(
    ("mirror", "words"),
    [
        ({"facets": 16}, "more than 15.75, the middle 70% of one of 16 facets"),
        ({"index_deg": 20.0}, "not between reach_deg 20.5 and the facet's end at 30"),
        ({"index_deg": 31.0}, "not between"),
        ({"facets": 2}, "facets"),
    ],
)
def test_a_polygon_that_cannot_be_is_refused(mirror: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked(Config, {"mirror": {"kind": "polygon", **mirror}}, "file")
