"""Safety: the limits' figures, and powers that a beam moved in steps neither exceeds nor wastes."""

import math

import numpy as np
import pytest

from vrscan.data.arrays import Floats, Ints
from vrscan.data.errors import InputError
from vrscan.scene import safety as s
from vrscan.scene.safety import Emission

SEED = 20100301
PULSED = Emission(rate_hz=37_400.0, pulse_s=1e-6)


def _rows(emission: Emission) -> dict[tuple[str, str], s.SafePower]:
    return {(row.laser_class, row.place): row for row in s.largest_safe_power(emission)}


@pytest.mark.parametrize(
    ("laser_class", "wavelength", "time", "limit"),
    [
        ("1", 658.0, 1e-6, 7.7e-8),
        ("1", 658.0, 1e-12, 3.8e-8),
        ("1", 658.0, 1e-4, 7e-7),  # 7e-4 x 1e-3
        ("1", 658.0, 100.0, 0.039),  # 0.39 mW
        ("1", 420.0, 1000.0, 0.039),  # 0.039 mW: photochemistry
        ("1", 530.0, 100.0, 0.039),  # there C3 is 39.8: heat binds
        ("1", 800.0, 1e-6, 7.7e-8 * 10**0.2),
        ("1", 850.0, 1000.0, 0.39 * 10**0.3),
        ("2", 658.0, 1e-4, 7e-7),
        ("2", 658.0, 0.25, 2.5e-4),  # 1 mW
        ("3R", 658.0, 1e-6, 3.85e-7),
        ("3R", 658.0, 0.25, 1.25e-3),  # 5 mW
        ("3R", 800.0, 100.0, 0.195 * 10**0.2),
    ],
)
def test_limits(laser_class: s.LaserClass, wavelength: float, time: float, limit: float) -> None:
    assert s.emission_limit_j(laser_class, wavelength, time) == pytest.approx(limit, rel=1e-9)


def test_limits_join_to_the_rounding_of_their_figures() -> None:
    for laser_class in ("1", "2", "3R"):
        for edge in (5e-6, 0.25, 10.0, 100.0):
            below, above = (
                s.emission_limit_j(laser_class, 658.0, edge * f) for f in (1 - 1e-9, 1 + 1e-9)
            )
            assert above == pytest.approx(below, rel=0.05)
    time = np.geomspace(1e-13, 3e4, 400)
    energy = np.array([s.emission_limit_j("1", 450.0, float(t)) for t in time])
    assert np.all(energy[1:] >= 0.95 * energy[:-1])  # 7e-4 t^0.75 begins at 7.4e-8


def test_wavelengths_and_times_without_a_limit() -> None:
    with pytest.raises(InputError, match="wavelength_nm = 1064: limits are known for 400 to 1050"):
        s.emission_limit_j("1", 1064.0, 1.0)
    with pytest.raises(InputError, match="class 2 exists for 400 to 700 nm"):
        s.emission_limit_j("2", 785.0, 1.0)
    for time in (0.0, 1e5, math.nan):
        with pytest.raises(ValueError, match="emission_limit_j"):
            s.emission_limit_j("1", 658.0, time)
    for bad in ({"mirror_hz": 0.0}, {"rate_hz": 1e4}, {"rate_hz": 1e4, "pulse_s": 2e-4}):
        with pytest.raises(ValueError, match="Emission"):
            Emission(**bad)


def test_correction_for_the_near_infrared() -> None:
    assert s.correction(699.9) == s.correction(700.0) == 1.0
    assert s.correction(1050.0) == pytest.approx(5.0, rel=3e-3)
    # as detectability prints it, with both wavelengths in thousands of nm
    assert s.correction(780.0) == pytest.approx(10.0 ** (2.0 * (0.780 - 0.700)))


def test_a_train_of_short_pulses_lowers_the_limit() -> None:
    assert s.train_factor(1e-6, 600.0, 100.0) == 1.0
    assert s.train_factor(1e-6, 5000.0, 100.0) == pytest.approx(5.0 * 5000.0**-0.25)
    assert s.train_factor(1e-6, 374_000.0, 100.0) == 0.4
    assert s.train_factor(1e-6, 374_000.0, 0.25) == 1.0
    assert s.train_factor(1e-5, 374_000.0, 100.0) == 1.0


def test_the_scanner_with_a_continuous_beam() -> None:
    rows = _rows(Emission())
    ((begin, end), _) = s.passes(Emission(), 0.0)
    print(f"a pass: {1e6 * (end - begin):.1f} / 125 us")
    assert end - begin == pytest.approx(125e-6, rel=3e-3)
    for key, milliwatt in {
        ("1", "middle"): 6.2,
        ("3R", "middle"): 33.0,
        ("1", "stalled"): 0.39,
        ("2", "stalled"): 1.0,
        ("3R", "stalled"): 5.0,
    }.items():
        print(f"{key}: {1e3 * rows[key].power_w:.2f} / {milliwatt} mW, {rows[key].rule}")
        assert 1e3 * rows[key].power_w == pytest.approx(milliwatt, rel=0.01)
    assert rows["1", "middle"].rule == "average"
    assert rows["3R", "middle"].rule == "pass"
    assert rows["1", "end"].power_w < 0.4 * rows["1", "middle"].power_w


def test_the_scanner_with_pulses() -> None:
    rows = _rows(PULSED)
    # 0.4 x 7.7e-8 J in 1 us; 7.7e-8 J in 1 us; 1 mW over a duty of 0.0374
    assert rows["1", "end"].power_w == pytest.approx(0.4 * 0.077, rel=1e-9)
    assert rows["1", "end"].rule == "pulse train"
    assert rows["2", "end"].power_w == pytest.approx(0.077, rel=1e-9)
    assert rows["2", "end"].rule == "single pulse"
    assert rows["2", "stalled"].power_w == pytest.approx(1e-3 / 0.0374, rel=1e-9)
    assert rows["1", "stalled"].power_w == pytest.approx(0.39e-3 / 0.0374, rel=1e-9)
    assert rows["2", "stalled"].rule == rows["1", "stalled"].rule == "average"


def test_pulses_within_five_microseconds_are_one() -> None:
    fast = Emission(rate_hz=1e6, pulse_s=1e-7)  # five in 5 us: 5e-7 s of light
    row = _rows(fast)["1", "end"]
    assert row.power_w <= 0.4 * 7.7e-8 / 5e-7 * (1.0 + 1e-9)


def test_passes_at_the_turning_point_and_beyond_the_opening() -> None:
    emission = Emission()
    t = np.linspace(-0.25, 0.75, 2_000_001) / emission.mirror_hz
    angle = emission.amplitude_rad * np.sin(2.0 * math.pi * emission.mirror_hz * t)
    half = math.atan(0.035)
    for opening in (math.inf, math.radians(12.5), 0.02):  # the last is less than the pupil
        moved = Emission(opening_rad=opening)
        for centre in (0.0, 0.15, 0.2, emission.amplitude_rad - half, 0.38, -0.1):
            inside = (np.abs(angle - abs(centre)) <= half) & (np.abs(angle) <= opening)
            found = sum(end - begin for begin, end in s.passes(moved, centre))
            assert found == pytest.approx(inside.mean() / emission.mirror_hz, abs=2e-8)
    assert s.passes(emission, 1.0) == ()


def _on_times(emission: Emission, centre: float, periods: int, phase: float) -> Floats:
    """Start times of what enters the pupil: pulses, or steps of 2 us of a continuous beam."""
    step = 1.0 / emission.rate_hz if emission.rate_hz else 2e-6
    t = np.arange(phase * step, periods / emission.mirror_hz, step)
    angle = emission.amplitude_rad * np.sin(2.0 * math.pi * emission.mirror_hz * t)
    half = math.atan(0.035)
    inside = (np.abs(angle - centre) <= half) & (np.abs(angle) <= emission.opening_rad)
    return t[inside]


@pytest.mark.parametrize("laser_class", ["1", "2", "3R"])
@pytest.mark.parametrize(
    "emission",
    [
        Emission(),
        Emission(opening_rad=math.radians(12.5)),
        Emission(mirror_hz=40.0),
        PULSED,
        Emission(rate_hz=20_000.0, pulse_s=20e-6),
    ],
)
@pytest.mark.parametrize("place", ["middle", "end"])
def test_no_stretch_of_the_exposure_exceeds_its_limit(
    emission: Emission, laser_class: s.LaserClass, place: str
) -> None:
    row = _rows(emission)[laser_class, place]
    reach = min(emission.amplitude_rad, emission.opening_rad)
    centre = 0.0 if place == "middle" else reach - math.atan(0.035)
    rng = np.random.default_rng(SEED)
    each = emission.pulse_s if emission.rate_hz else 2e-6
    tightest = math.inf
    for phase in rng.random(3):
        t = _on_times(emission, centre, 12, float(phase))
        # every stretch from one piece of light to another
        first, last = np.triu_indices(len(t)) if len(t) < 700 else _some_pairs(rng, len(t))
        duration = np.maximum(t[last] - t[first] + each, each)
        energy = row.power_w * each * (last - first + 1)
        edges, at = np.unique(np.round(np.log(duration) * 200.0), return_inverse=True)
        limit = np.array(
            [s.emission_limit_j(laser_class, 658.0, math.exp(edge / 200.0)) for edge in edges]
        )
        tightest = min(tightest, float((limit[at] / energy).min()))
    base = s.time_base_s(laser_class, 658.0)
    share = len(t) * each / (12.0 / emission.mirror_hz)
    mean = s.emission_limit_j(laser_class, 658.0, base) / base / (row.power_w * share)
    print(
        f"{1e3 * row.power_w:.2f} mW by {row.rule}: spare {tightest:.3f}, over the base {mean:.3f}"
    )
    assert min(tightest, mean) > 0.97  # steps of 2 us in 125, the beam's 12 periods
    if row.rule in ("pass", "passes", "average"):
        assert min(tightest, mean) < 1.08  # a stretch may hold one pulse more than it does here


def _some_pairs(rng: np.random.Generator, count: int) -> tuple[Ints, Ints]:
    pairs = np.sort(rng.integers(0, count, (2, 400_000)), axis=0)
    return pairs[0], pairs[1]


def test_infrared_has_no_class_2() -> None:
    rows = s.largest_safe_power(Emission(wavelength_nm=785.0))
    assert {row.laser_class for row in rows} == {"1", "3R"}
    assert all(math.isfinite(row.power_w) and row.power_w > 0.0 for row in rows)
    with pytest.raises(InputError):
        s.largest_safe_power(Emission(wavelength_nm=1550.0))
