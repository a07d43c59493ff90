"""The timeline: (12) and its slope, what the index says of it, and blocks that fit together."""

import io
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from scanners import EACH_RESONANT, EACH_SCANNER
from scipy.optimize import brentq

from vrscan.data import edges
from vrscan.data.arrays import Floats
from vrscan.data.config import Config, Line, Mems, Mirror
from vrscan.data.errors import InputError
from vrscan.ideal.motion import motion
from vrscan.scene.timeline import Scan, Timeline, series, timeline, write_edges

SEED = 20100301
QUIET = Scan(jitter_ns=0.0)
SLOW = Config(line=Line(rate_hz=2003.0))  # eight lines a period: many periods in few lines


def whole(config: Config, scan: Scan, count: int, seed: int = SEED) -> Timeline:
    return timeline(0, count, count, config, scan, seed)


def marked(config: Config, mark_deg: float) -> Config:
    """Return a scanner with its index mark at another angle."""
    mirror = config.mirror.model_copy(update={"index_deg": mark_deg})
    return config.model_copy(update={"mirror": mirror})


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def truth(config: Config, scan: Scan, time: Floats) -> Floats:
    """(12) as ``ideal`` has it, with the drifts."""
    mirror = config.mirror
    phase = mirror.frequency_hz * time + 1e-6 * scan.phase_drift_urad_per_s * time / (2 * math.pi)
    amplitude = math.radians(mirror.amplitude_deg) * (1.0 + 1e-6 * scan.drift_ppm_per_s * time)
    return motion(phase, amplitude, mirror.harmonics)


@EACH_SCANNER
def test_the_series_is_12_and_its_derivative(config: Config) -> None:
    harmonics = [[1.0, 0.0], [0.05, 2.9], [0.02, -1.4], [0.0, 0.0], [0.01, 0.7], [0.004, -2.0]]
    phase = np.linspace(-3.0, 40.0, 9001)
    for pairs in (config.mirror.harmonics, harmonics):
        value, slope = series(phase, pairs)
        assert np.abs(value - motion(phase, 1.0, pairs)).max() < 1e-13
        # d/dp of a_k cos(k p - phi_k) is the motion with k a_k and a quarter turn.
        turned = [[(2 * j + 1) * a, phi - math.pi / 2] for j, (a, phi) in enumerate(pairs)]
        wanted = 2 * math.pi * motion(phase, 1.0, turned)
        assert np.abs(slope - wanted).max() < 1e-11


def test_lines_are_at_their_pulse_and_angles_follow_12() -> None:
    config = Config(line=Line(rate_hz=30_000.0, pulse_us=2.0, pulse_delay_us=5.0))
    scan = Scan(start_s=7.0, drift_ppm_per_s=300.0, phase_drift_urad_per_s=4e4, pan_mm_per_s=12.5)
    lines = timeline(1000, 4000, 9000, config, scan, SEED)
    assert lines.line.tolist() == list(range(1000, 5000))
    since = lines.line / 30_000.0 + 6e-6
    assert np.abs(lines.time_s - 7.0 - since).max() < 1e-14
    assert np.abs(lines.y_mm - 12.5 * since).max() < 1e-12
    assert np.abs(lines.angle_rad - truth(config, scan, lines.time_s)).max() < 1e-11
    step = 1e-6
    ahead, behind = (truth(config, scan, lines.time_s + s) for s in (step, -step))
    numeric = (ahead - behind) / (2 * step)
    # The third derivative of a harmonic motion bounds the difference quotient: w^3 A h^2 / 6, and
    # 1e-15 of a phase of 1,800 turns the rounding.
    assert np.abs(lines.rate_rad_per_s - numeric).max() < 1e-5 * 562.0
    assert np.abs(lines.rate_rad_per_s).max() == pytest.approx(562.0, rel=0.01)


@EACH_SCANNER
@pytest.mark.parametrize(
    "scan",
    [
        Scan(pan_mm_per_s=30.0, drift_ppm_per_s=50.0, jitter_ns=40.0, start_s=3.7),
        Scan(phase_drift_urad_per_s=1e4),
        Scan(sweep="even", half_angle_deg=9.0, pan_mm_per_s=1.0),
    ],
    ids=["drift", "start_at_0", "even"],
)
def test_any_blocks_in_any_order_are_the_same_lines(scan: Scan, config: Config) -> None:
    total = 30_000  # 200 periods and more: several of the blocks that periods come in
    wanted = whole(config, scan, total)
    random = np.random.default_rng(SEED)
    cuts = np.unique(np.concatenate([[0, 1, 2, 5, total], random.integers(0, total, 40)]))
    pieces = list(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True))
    order = random.permutation(len(pieces))
    parts = {
        k: timeline(pieces[k][0], pieces[k][1] - pieces[k][0], total, config, scan, SEED)
        for k in order.tolist()
    }
    joined = Timeline.joined([parts[k] for k in range(len(pieces))])
    for field in fields(Timeline):
        got, want = getattr(joined, field.name), getattr(wanted, field.name)
        assert np.array_equal(got, want), field.name
    periods = np.ptp(wanted.time_s) * config.mirror.frequency_hz
    crossings = periods if config.mirror.polygon else 2.0 * periods
    crossings *= scan.sweep != "even"
    assert len(wanted.index_s) == pytest.approx(crossings, abs=2)
    empty = timeline(17, 0, total, config, scan, SEED)
    assert len(empty) == len(empty.index_s) == 0


@EACH_RESONANT
@pytest.mark.parametrize("mark_deg", [17.0, -17.0, 3.0, 20.4])
def test_the_index_is_crossed_where_the_motion_is_at_the_mark(
    mark_deg: float, config: Config
) -> None:
    config = marked(config, mark_deg)
    scan = Scan(jitter_ns=0.0, drift_ppm_per_s=-100.0, phase_drift_urad_per_s=5e3, start_s=0.02)
    lines = whole(config, scan, 3000)
    mark = math.radians(mark_deg)

    def off(time: float) -> float:
        return float(truth(config, scan, np.array([time]))[0]) - mark

    grid = np.linspace(0.02, 0.02 + 3000 / config.line.rate_hz, 40_001)
    sign = np.sign(truth(config, scan, grid) - mark)
    at = np.flatnonzero(np.diff(sign))
    roots = np.array([brentq(off, grid[k], grid[k + 1], xtol=1e-15) for k in at])
    assert np.abs(lines.index_s - roots).max() < 1e-12
    assert np.array_equal(lines.index_outward, np.diff(sign)[at] * mark > 0.0)


@EACH_RESONANT
def test_without_jitter_and_drift_the_instrument_is_right(config: Config) -> None:
    for mark_deg in (17.0, -12.0):
        lines = whole(marked(config, mark_deg), Scan(jitter_ns=0.0, start_s=50.0), 20_000)
        error = np.abs(lines.reported_rad - lines.angle_rad).max()
        print(f"mark {mark_deg:g} degrees: measured {error:.1e} rad, wanted 0, rounding 1e-11")
        assert error < 1e-11


def test_crossings_have_the_stated_jitter() -> None:
    quiet = whole(SLOW, QUIET, 40_000)
    noisy = whole(SLOW, Scan(jitter_ns=25.0), 40_000)
    shift = noisy.index_s - quiet.index_s
    measured = 1e9 * shift.std()
    print(f"jitter: measured {measured:.2f} ns, stated 25 ns, {len(shift)} crossings")
    assert measured == pytest.approx(25.0, rel=4.0 / math.sqrt(2 * len(shift)))
    assert abs(shift.mean()) < 4.0 * 25e-9 / math.sqrt(len(shift))
    pairs = shift[: len(shift) // 2 * 2].reshape(-1, 2)
    later = np.corrcoef(shift[:-1], shift[1:])[0, 1]
    assert abs(later) < 4.0 / math.sqrt(len(shift))
    assert abs(np.corrcoef(pairs[:, 0], pairs[:, 1])[0, 1]) < 4.0 / math.sqrt(len(pairs))
    other = whole(SLOW, Scan(jitter_ns=25.0), 40_000, seed=1)
    assert not np.isin(other.index_s, noisy.index_s).any()


@EACH_SCANNER
def test_the_mirror_s_own_jitter_holds_where_the_scan_has_none(config: Config) -> None:
    mems = config.mems.model_copy(update={"jitter_ns": 25.0})
    config = config.model_copy(update={"mems": mems})
    assert np.array_equal(
        whole(config, Scan(), 2000).reported_rad,
        whole(config, Scan(jitter_ns=25.0), 2000).reported_rad,
    )


def angle_error_rad(config: Config, scan: Scan) -> float:
    """Return the rms of reported less true angle that the jitter causes, rad.

    Of a = A cos(w t + d) and a mark m = A cos(w h), crossings t1, t2 with independent errors s give
    d by their mean and h by half their distance, both with s / sqrt(2). So dA = A tan(w h) w dh,
    and da = cos dA - A sin w dt averages over a period to w^2 s^2 A^2 / 4 (1 + tan^2(w h)): the rms
    is w s A^2 / (2 m), over sqrt(N) for the mean of N periods.

    It leaves out the harmonics, which change it by their share, and drift.
    """
    mirror = config.mirror
    turned = 2 * math.pi * mirror.frequency_hz * 1e-9 * scan.jitter_ns
    amplitude, mark = math.radians(mirror.amplitude_deg), math.radians(abs(mirror.index_deg))
    return turned * amplitude**2 / (2.0 * mark * math.sqrt(mirror.averaging_periods))


@pytest.mark.parametrize("averaging", [1, 2, 4, 16])
@pytest.mark.parametrize("mark_deg", [17.0, -8.0])
def test_jitter_becomes_the_predicted_angle_error(averaging: int, mark_deg: float) -> None:
    mirror = Mirror.model_validate({"averaging_periods": averaging, "index_deg": mark_deg})
    config = Config(mirror=mirror, line=SLOW.line)
    scan = Scan(jitter_ns=10.0)
    lines = whole(config, scan, 80_000)
    measured = rms(lines.reported_rad - lines.angle_rad)
    predicted = angle_error_rad(config, scan)
    periods = 80_000 / 2003.0 * 249.0
    spread = 4.0 * math.sqrt(averaging / periods)  # of an rms of so few independent means
    print(
        f"N = {averaging}, mark {mark_deg:g}: measured {1e6 * measured:.3f} urad, "
        f"predicted {1e6 * predicted:.3f} urad, within {100 * spread:.0f} %"
    )
    assert measured == pytest.approx(predicted, rel=spread + 2e-3)


def test_drift_is_reported_late_by_the_age_of_the_mean() -> None:
    """Mean of the last N turning points: its age is (N - 1) / 2 periods and what passed since.

    An amplitude that grows by d while the pair is taken also shifts its middle: of
    A (1 + d t) cos(w t) = m both crossings come late by d t cot(w t) / w. A phase that drifts is
    a faster mirror, so the distance looks shorter, and the amplitude smaller by A tan(w t) t dw.
    """
    mirror = Mirror(averaging_periods=4)
    config = Config(mirror=mirror)
    amplitude = math.radians(mirror.amplitude_deg)
    half = math.acos(mirror.index_deg / mirror.amplitude_deg) / (2 * math.pi)
    for scan in (
        Scan(jitter_ns=0.0, drift_ppm_per_s=200.0),
        Scan(jitter_ns=0.0, phase_drift_urad_per_s=2000.0),
    ):
        lines = whole(config, scan, 5000)
        phase = mirror.frequency_hz * lines.time_s
        newest = np.floor(phase - half)  # complete half a distance after its turning point
        clear = np.abs((phase - half) % 1.0 - 0.5) < 0.499  # the harmonics shift it a little
        age = (phase - newest + 1.5) / mirror.frequency_hz
        turn = 2 * math.pi * phase
        drift, phase_drift = 1e-6 * scan.drift_ppm_per_s, 1e-6 * scan.phase_drift_urad_per_s
        flank = 2 * math.pi * half
        late = drift * half / mirror.frequency_hz / math.tan(flank)
        smaller = phase_drift * half / mirror.frequency_hz * math.tan(flank)
        wanted = (phase_drift * age + late) * np.sin(turn) - (drift * age + smaller) * np.cos(turn)
        wanted *= amplitude
        error = lines.reported_rad - lines.angle_rad
        miss, size = rms((error - wanted)[clear]), rms(wanted[clear])
        print(f"drift: error {1e6 * rms(error[clear]):.3f} urad, predicted {1e6 * size:.3f} urad")
        assert clear.mean() > 0.99
        assert miss < 0.01 * size


@EACH_SCANNER
def test_an_even_sweep_is_known(config: Config) -> None:
    scan = Scan(sweep="even", half_angle_deg=10.0)
    lines = whole(config, scan, 501)
    assert np.abs(np.degrees(lines.angle_rad) - np.linspace(-10.0, 10.0, 501)).max() < 1e-12
    assert np.array_equal(lines.reported_rad, lines.angle_rad)
    slope = np.gradient(lines.angle_rad, lines.time_s)
    assert np.allclose(lines.rate_rad_per_s, slope, rtol=1e-9)
    single = whole(config, scan, 1)
    assert (single.angle_rad[0], single.rate_rad_per_s[0]) == (-math.radians(10.0), 0.0)


@EACH_RESONANT
@pytest.mark.parametrize("mark_deg", [17.0, -17.0, 19.486, 20.0])
def test_edges_are_read_back_with_the_same_crossings(
    tmp_path: Path, mark_deg: float, config: Config
) -> None:
    config = marked(config, mark_deg)
    scan = Scan(jitter_ns=200.0)
    buffer = io.BytesIO()
    count = write_edges(buffer, 0.0, 0.4, config, scan, SEED)
    path = tmp_path / "edges.csv"
    path.write_bytes(buffer.getvalue())
    time, comparator, gate = edges.read(path)
    outward, inward = edges.pairs(time, comparator, gate)
    assert count == len(outward) == pytest.approx(99, abs=1)
    lines = whole(config, scan, round(0.4 * config.line.rate_hz))
    for found, away in ((outward, True), (inward, False)):
        index = lines.index_s[lines.index_outward == away]
        nearest = np.abs(found[:, None] - index[None, :]).min(axis=1)
        assert nearest.max() < 1e-12

    # The levels are what a diode of this width would say of the true motion.
    grid = np.linspace(time[0] - 1e-4, time[-1] + 1e-4, 40_001)
    mark, width = math.radians(mark_deg), math.radians(config.mems.diode_deg)
    angle = truth(config, scan, grid)
    row = np.searchsorted(time, grid, side="right") - 1
    near = np.abs(grid[:, None] - time[None, :]).min(axis=1) < 2e-6  # ten times the jitter
    opened = np.where(row >= 0, gate[row], 0)
    assert np.array_equal((opened == 1)[~near], (np.abs(angle - mark) < width)[~near])
    lit = ~near & (opened == 1)
    assert np.array_equal(comparator[row][lit] == 1, (np.abs(angle) > abs(mark))[lit])
    rows = edges.sample(time, comparator, gate, clock_hz=config.clock.frequency_hz, oversample=4)
    assert len(rows) > 3 * count


def test_what_has_no_index_is_refused_in_one_line() -> None:
    cases = (
        (Config(mirror=Mirror(index_deg=20.6)), Scan(), r"mirror\.index_deg: .* 20\.6 degrees"),
        (Config(), Scan(start_s=100.0, drift_ppm_per_s=-2000.0), r"mirror\.index_deg: .* reach"),
    )
    for config, scan, text in cases:
        with pytest.raises(InputError, match=text) as caught:
            whole(config, scan, 100)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="an even sweep has no index"):
        write_edges(io.BytesIO(), 0.0, 1.0, Config(), Scan(sweep="even"), SEED)
    wide = Config(mems=Mems(diode_deg=18.0))
    with pytest.raises(InputError, match=r"mems\.diode_deg"):
        write_edges(io.BytesIO(), 0.0, 1.0, wide, Scan(), SEED)


def test_calls_that_make_no_sense_are_errors() -> None:
    for first, count, total, seed in ((-1, 1, 5, 0), (0, -1, 5, 0), (3, 3, 5, 0), (0, 1, 5, -1)):
        with pytest.raises(ValueError, match="timeline"):
            timeline(first, count, total, Config(), Scan(), seed)
    with pytest.raises(ValueError, match="negative"):
        write_edges(io.BytesIO(), -1.0, 1.0, Config(), Scan(), SEED)
    for key, value in (("jitter_ns", -1.0), ("half_angle_deg", 0.0), ("start_s", -1.0)):
        with pytest.raises(ValidationError):
            Scan.model_validate({key: value})
    with pytest.raises(ValidationError):
        Scan.model_validate({"sweep": "spiral"})
