"""Speckle gains against a coherent simulation of the surface, the lens and the pixels."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from coherent_light import PITCH_MM, PUPIL_MM, SHARP, WAVELENGTH_MM, Bench, coherent_rows
from scipy import stats

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.ideal.geometry import ThinLens
from vrscan.scene import image
from vrscan.scene.radiometry import mtf
from vrscan.scene.sensor import spot_electrons
from vrscan.scene.speckle import (
    KNOT_STEP,
    KNOTS,
    Speckle,
    pixel_contrast2,
    pixel_correlation,
    position_rms_px,
    turn_correlation,
)

SEED = 1994
RANGE_MM = SHARP.range_mm
LENS = ThinLens.of(3.0, RANGE_MM, Config().geometry)
CELLS = PITCH_MM / (WAVELENGTH_MM * LENS.working)  # along a pixel


@pytest.fixture(scope="module")
def speckle() -> Speckle:
    return make(SEED)


def make(seed: int, length: int = 2048, *, focus_mm: float = RANGE_MM) -> Speckle:
    lens = ThinLens.of(3.0, focus_mm, Config().geometry)
    return Speckle(seed, length, lens, wavelength_nm=658.0, pitch_mm=0.007)


def first_harmonic(lines: Floats, cut: float = 0.05) -> Floats:
    """Return the positions that the phase of the window's first harmonic gives, T = N."""
    found = np.empty(len(lines))
    for i, line in enumerate(lines):
        peak = int(line.argmax())
        low = np.flatnonzero(line[:peak] < cut * line[peak])
        high = np.flatnonzero(line[peak:] < cut * line[peak])
        first = int(low[-1]) + 1 if len(low) else 0
        last = peak + int(high[0]) if len(high) else len(line)
        phase = 2 * math.pi * np.arange(last - first) / (last - first)
        turn = math.atan2(line[first:last] @ np.sin(phase), line[first:last] @ np.cos(phase))
        found[i] = first + (last - first) * (turn / (2 * math.pi) % 1.0)
    return found


def sample(source: Speckle, lines: int, width: int, looks: float = 1.0) -> Floats:
    """Return gains of independent lines at ``RANGE_MM``."""
    rng = np.random.default_rng(SEED)
    return source.gain(
        rng.integers(0, 2048 - width, lines),
        width,
        rng.uniform(-0.6, 0.6, lines),
        looks,
        np.full(lines, RANGE_MM),
    ).astype(float)


def test_pixel_statistics_are_those_of_a_coherent_image(speckle: Speckle) -> None:
    rng = np.random.default_rng(SEED)
    rows = coherent_rows(rng, 1e6, 20, 300)
    contrast = rows.std() / rows.mean()
    fluctuation = rows / rows.mean() - 1
    one = float((fluctuation[:, 1:] * fluctuation[:, :-1]).mean() / np.square(fluctuation).mean())
    squared = pixel_contrast2(CELLS)
    predicted_one, two = pixel_correlation(CELLS, np.array([1.0, 2.0]))
    gains = sample(speckle, 20_000, 41)
    own = gains - 1
    own_one = float((own[:, 1:] * own[:, :-1]).mean() / own.var())
    print(
        f"contrast {contrast:.4f} coherent, {gains.std():.4f} gains / {math.sqrt(squared):.4f};"
        f" neighbours {one:.4f}, {own_one:.4f} / {predicted_one:.4f}; next but one {two:.4f}"
    )
    for measured in (contrast, gains.std()):
        assert measured == pytest.approx(math.sqrt(squared), rel=0.01)
    for measured in (one, own_one):
        assert measured == pytest.approx(predicted_one, abs=0.008)
    assert gains.mean() == pytest.approx(1.0, abs=0.003)
    skew = stats.skew(rows.ravel()), stats.skew(gains.ravel())
    print(f"skewness {skew[0]:.3f} coherent, {skew[1]:.3f} gains / {2 * contrast:.3f} gamma")
    assert skew[1] == pytest.approx(2 * contrast, rel=0.05)
    assert skew[0] == pytest.approx(skew[1], rel=0.25)  # which a gamma distribution leaves out


@pytest.mark.parametrize("sigma_px", [2.0, 3.0, 4.0, 6.0])
def test_position_error_is_that_of_a_coherent_image(speckle: Speckle, sigma_px: float) -> None:
    half = math.ceil(5 * sigma_px) + 2
    rng = np.random.default_rng(SEED)
    coherent = float(first_harmonic(coherent_rows(rng, sigma_px, half, 200)).std())
    spots = spot_electrons(
        np.array([float(half)]), np.array([sigma_px]), np.array([1e4]), 2 * half + 1
    )
    own = float(first_harmonic(spots * sample(speckle, 3200, 2 * half + 1)).std())
    contrast = float(speckle.contrast())
    correlation = speckle.correlation
    predicted = float(position_rms_px(np.array(sigma_px), contrast, correlation))
    # Dorsch, Haeusler, Herrmann, Laser triangulation: fundamental uncertainty in distance
    # measurement, 1994: C lambda / (2 pi sin u') of a whole, unresolved spot, at contrast 1.
    least = 658e-6 * LENS.working / math.pi / 0.007
    print(
        f"s {sigma_px:g} px: {coherent:.3f} coherent, {own:.3f} gains / {predicted:.3f} px,"
        f" Dorsch {least:.3f}"
    )
    assert own == pytest.approx(coherent, rel=0.08)
    assert 0.97 < coherent / predicted < 1.12
    assert 0.97 < own / predicted < 1.12
    assert own > least


def test_a_first_order_error_by_direct_sums() -> None:
    # the closed form is an integral with neighbours' correlation as a factor; this is the sum
    squared = pixel_contrast2(CELLS)
    near = np.append(pixel_correlation(CELLS, np.arange(9.0)), 0.0)
    for sigma in (3.0, 8.0):
        x = np.arange(-200, 201)
        half = sigma * math.sqrt(2 * math.log(20))
        inside = np.abs(x) < half
        profile = np.exp(-0.5 * np.square(x / sigma)) * inside
        weight = profile * np.sin(math.pi * x / half)
        lag = np.abs(x[:, None] - x)
        covariance = squared * near[np.minimum(lag, 9)]
        rms = half / math.pi * math.sqrt(weight @ covariance @ weight)
        rms /= float(profile @ np.cos(math.pi * x / half))
        predicted = float(position_rms_px(np.array(sigma), math.sqrt(squared), 0.0707))
        print(f"s {sigma:g} px: sum {rms:.4f} / {predicted:.4f} px")
        assert rms == pytest.approx(predicted, rel=0.04)


def test_gains_are_gamma_distributed(speckle: Speckle) -> None:
    gains = sample(speckle, 4000, 32)
    shape = 1 / float(speckle.contrast()) ** 2
    distance = stats.kstest(gains[:, ::4].ravel(), stats.gamma(shape, scale=1 / shape).cdf)
    print(f"M = {shape:.2f} cells, distance of the distributions {distance.statistic:.4f}")
    assert distance.statistic < 0.012  # 0.0077 is the 5 % point of 32,000 independent ones


@pytest.mark.parametrize("looks", [1.0, 2.0, 4.0, 9.5, 100.0])
def test_contrast_falls_with_the_root_of_the_looks(speckle: Speckle, looks: float) -> None:
    gains = sample(speckle, 8000, 64, looks)
    predicted = math.sqrt(pixel_contrast2(CELLS) / looks)
    print(f"{looks:g} looks: {gains.std():.4f} / {predicted:.4f}")
    assert gains.std() == pytest.approx(predicted, rel=0.015)
    assert gains.mean() == pytest.approx(1.0, abs=0.004)


def test_averaging_independent_patterns_is_the_same_as_looks() -> None:
    gains = [sample(make(seed), 2000, 64) for seed in range(4)]
    assert np.mean(gains, axis=0).std() == pytest.approx(gains[0].std() / 2, rel=0.02)
    one = sample(make(0), 2000, 64, 4.0)
    assert one.std() == pytest.approx(gains[0].std() / 2, rel=0.02)


def test_mean_and_contrast_are_right_for_a_pixel_of_one_cell() -> None:
    # a lens stopped down until a cell is larger than a pixel: the distribution nears exp(-g)
    lens = ThinLens.of(32.0, 300.0, Config().geometry)
    small = Speckle(SEED, 2048, lens, wavelength_nm=658.0, pitch_mm=0.002)
    rng = np.random.default_rng(SEED)
    gains = small.gain(
        rng.integers(0, 2000, 8000), 32, rng.uniform(-2, 2, 8000), 1.0, np.full(8000, 300.0)
    )
    predicted = float(small.contrast())
    print(f"contrast {gains.std():.4f} / {predicted:.4f}, mean {gains.mean():.4f}")
    assert 0.99 < predicted <= 1.0
    assert gains.std() == pytest.approx(predicted, rel=0.02)
    assert gains.mean() == pytest.approx(1.0, abs=0.02)
    assert gains.min() >= 0


def test_contrast_is_the_same_between_knots(speckle: Speckle) -> None:
    knot_rad = KNOT_STEP * PUPIL_MM / RANGE_MM
    spread = []
    for part in (0.0, 0.25, 0.5, 0.75):
        angle = np.asarray((np.arange(-200, 200) + part) * knot_rad)
        lines = speckle.gain(np.zeros(400, int), 2048, angle, 1.0, np.full(400, RANGE_MM))
        spread.append(lines.std())
        assert lines.mean() == pytest.approx(1.0, abs=0.003)
    print("contrast between knots", np.round(spread, 4))
    assert max(spread) / min(spread) < 1.01


@pytest.mark.parametrize(
    "bench", [Bench(250, 250), Bench(1000, 1000), Bench(250, 420), Bench(1000, 420)]
)
def test_the_cells_are_those_of_the_focus_wherever_the_surface_is(bench: Bench) -> None:
    rows = 16 + 2 * math.ceil(bench.radius_px)
    light = coherent_rows(np.random.default_rng(SEED), 1e6, 30, 10 * 16 // rows + 3,
                          bench=bench, rows=rows)  # fmt: skip
    seen = light.std() / light.mean()
    own = float(make(SEED, focus_mm=bench.focus_mm).contrast())
    surface = 3.0 / (1.0 - 25.0 / bench.range_mm)
    others = [math.sqrt(pixel_contrast2(PITCH_MM / WAVELENGTH_MM / n)) for n in (3.0, surface)]
    print(f"{bench}: {seen:.4f} coherent / {own:.4f}; F {others[0]:.4f}, surface's {others[1]:.4f}")
    assert seen == pytest.approx(own, rel=0.012)
    lens = ThinLens.of(3.0, bench.focus_mm, Config().geometry)
    assert lens.working == pytest.approx(bench.image_mm / PUPIL_MM)


def test_the_discs_radius_is_that_of_the_rays() -> None:
    for bench in (Bench(250, 420), Bench(420, 420), Bench(1000, 420), Bench(900, 260)):
        depth = np.array([bench.range_mm])
        found = image.defocus_radius_px(depth, bench.focus_mm, 3.0, Config())[0]
        assert found == pytest.approx(bench.radius_px, abs=1e-9)


# (range, focus, motion in the pulse px)
OUT_OF_FOCUS = [(400.0, 420.0, 0.0), (350.0, 420.0, 0.0), (600.0, 420.0, 0.0), (350.0, 420.0, 3.0)]


@pytest.mark.parametrize(("distance", "focus", "pulse"), OUT_OF_FOCUS)
def test_speckle_out_of_focus_is_that_of_a_coherent_image(
    distance: float, focus: float, pulse: float
) -> None:
    """Contrast at every place in the spot, correlation, and the error of the first harmonic."""
    bench, sigma, tall = Bench(distance, focus), 2.0, 4.0
    radius = bench.radius_px
    half = math.ceil(5 * sigma + radius) + 2
    rows = 2 * math.ceil(3.0 * tall + radius) + 1
    steps, trials = (5, 80) if pulse else (1, 160)
    light = coherent_rows(np.random.default_rng(SEED), sigma, half, trials, bench=bench, rows=rows,
                          height_px=tall, pulse_px=pulse, steps=steps)  # fmt: skip
    source, count = make(SEED, focus_mm=focus), 6000
    rng = np.random.default_rng(SEED)
    same = np.full(count, 1.0)
    offset = np.arange(-half, half + 1.0)
    blur = source.blur(
        np.tile(offset, (count, 1)), *(each * same for each in (sigma, tall, radius, pulse)),
        distance * same,
    )  # fmt: skip
    gain = source.gain(rng.integers(0, 1900, count), 2 * half + 1, rng.uniform(-0.6, 0.6, count),
                       1.0, distance * same, blur=blur).astype(float)  # fmt: skip
    mean = light.mean(axis=0)
    lit = mean > 0.05 * mean.max()
    unit = light[:, lit] / mean[lit] - 1
    own = gain[:, lit] - 1
    seen, got = (np.sqrt(np.square(each).mean(axis=0)) for each in (unit, own))
    weight = mean[lit] / mean[lit].sum()
    off = math.sqrt(float(weight @ np.square(got / seen - 1)))
    lighted = [e * weight for e in (unit, own)]
    near = [float((e[:, 1:] * e[:, :-1]).mean() / np.square(e).mean()) for e in lighted]
    moved = first_harmonic(light), first_harmonic(mean * gain)
    error = [float(np.median(np.abs(e - np.median(e)))) for e in moved]
    sharp = first_harmonic(mean * sample(source, count, 2 * half + 1))
    plain = float(np.median(np.abs(sharp - np.median(sharp))))
    print(
        f"{distance:g} mm, focus {focus:g}, disc {radius:.1f} px, pulse {pulse:g} px: contrast"
        f" {weight @ got:.3f} / {weight @ seen:.3f}, rms apart {off:.3f}; neighbours"
        f" {near[1]:.3f} / {near[0]:.3f}; median error {error[1]:.3f} / {error[0]:.3f} px,"
        f" as if in focus {plain:.3f}"
    )
    assert off < 0.09
    assert near[1] == pytest.approx(near[0], abs=0.08)
    assert error[1] == pytest.approx(error[0], rel=0.2)


def correlation(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    return float(np.corrcoef(np.ravel(first), np.ravel(second))[0, 1])


def test_pattern_changes_as_the_light_turns_like_a_coherent_image(speckle: Speckle) -> None:
    rng = np.random.default_rng(SEED)
    angle = rng.uniform(-0.3, 0.3, 300)
    distance = np.full(300, RANGE_MM)
    start = speckle.gain(np.zeros(300, int), 2048, angle, 1.0, distance)
    still = coherent_rows(np.random.default_rng(7), 1e6, 20, 60)
    for cycles in (7, 14, 27, 48, 82, 150):
        turn = cycles / (41 * CELLS)
        moved = np.asarray(angle + turn * PUPIL_MM / RANGE_MM)
        own = correlation(start, speckle.gain(np.zeros(300, int), 2048, moved, 1.0, distance))
        tilted = coherent_rows(np.random.default_rng(7), 1e6, 20, 60, cycles=cycles)
        seen = correlation(still, tilted)
        predicted = float(turn_correlation(CELLS, np.array([turn]))[0])
        print(f"turn {turn:.3f} D/R: {own:.3f} gains, {seen:.3f} coherent / {predicted:.3f}")
        assert own == pytest.approx(predicted, abs=0.03)
        assert seen == pytest.approx(predicted, abs=0.03)


def test_turned_light_correlates_with_the_pupils_overlap_or_its_square() -> None:
    turn = np.array([0.0, 0.1, 0.3, 0.6, 0.9, 1.0, 2.0])
    point, sum_of_many = turn_correlation(1e-3, turn), turn_correlation(20.0, turn)
    print(f"a point {np.round(point, 3)} / {np.round(mtf(turn) ** 2, 3)}")
    print(f"400 cells {np.round(sum_of_many, 3)} / {np.round(mtf(turn), 3)}")
    assert point == pytest.approx(mtf(turn) ** 2, abs=0.005)
    assert sum_of_many == pytest.approx(mtf(turn), abs=0.05)


def test_pattern_changes_as_the_scanner_travels_like_a_coherent_image(speckle: Speckle) -> None:
    lines = 300
    angle = np.random.default_rng(SEED).uniform(-0.3, 0.3, lines)
    distance = np.full(lines, RANGE_MM)
    row_mm = 0.007 * (RANGE_MM - 25.0) / 25.0
    first = np.zeros(lines, int)
    start = speckle.gain(first, 2048, angle, 1.0, distance)
    for shift in (0.25, 0.5, 1.0):
        moved = speckle.gain(first, 2048, angle, 1.0, distance, travel_mm=shift * row_mm)
        still = coherent_rows(np.random.default_rng(8), 1e6, 20, 40)
        shifted = coherent_rows(np.random.default_rng(8), 1e6, 20, 40, shift_px=shift)
        own, seen = correlation(start, moved), correlation(still, shifted)
        print(f"{shift} px along the normal: {own:.3f} gains, {seen:.3f} coherent")
        predicted = float(pixel_correlation(CELLS, np.array(shift)))
        assert seen == pytest.approx(predicted, abs=0.04)
        assert own == pytest.approx(seen, abs=0.2)  # only where it halves do they agree closely
    half = speckle.gain(first, 2048, angle, 1.0, distance, travel_mm=0.56 * row_mm)
    assert correlation(start, half) == pytest.approx(0.5, abs=0.03)


def test_a_pixel_keeps_its_gain_whatever_the_window_order_and_block() -> None:
    rng = np.random.default_rng(SEED)
    lines = 700
    first = rng.integers(-30, 1990, lines)
    angle, distance = rng.uniform(-0.36, 0.36, lines), rng.uniform(250, 1000, lines)
    surface = rng.integers(0, 4, lines)
    whole = make(3).gain(first, 96, angle, 2.0, distance, surface=surface)
    again = make(3)
    order = rng.permutation(lines)
    parts = [
        again.gain(first[i], 96, angle[i], 2.0, distance[i], surface=surface[i])
        for i in np.array_split(order, 5)
    ]
    assert np.array_equal(np.concatenate(parts), whole[order])
    later = again.gain(first + 40, 56, angle, 2.0, distance, surface=surface)
    assert np.array_equal(later, whole[:, 40:])
    assert not np.allclose(make(4).gain(first, 96, angle, 2.0, distance), whole)


def test_another_surface_and_the_wrap_of_the_turn_are_other_patterns(speckle: Speckle) -> None:
    first, angle = np.zeros(200, int), np.linspace(-0.3, 0.3, 200)
    distance = np.full(200, RANGE_MM)
    patterns = [speckle.gain(first, 2048, angle, 1.0, distance, surface=s) for s in range(4)]
    for a in range(4):
        for b in range(a):
            assert abs(correlation(patterns[a], patterns[b])) < 0.02
    # even across the table's end
    turn = np.array([-0.06, 0.06]) + KNOTS * KNOT_STEP
    ends = speckle.gain(first[:2], 2048, turn * PUPIL_MM / RANGE_MM, 1.0, distance[:2])
    expected = float(turn_correlation(CELLS, np.array([0.12]))[0])
    assert correlation(ends[0], ends[1]) == pytest.approx(expected, abs=0.06)


def test_extreme_input_gives_finite_gains(speckle: Speckle) -> None:
    bad = np.array([np.inf, np.nan, -100.0, 0.0, 25.0, 1e12, 300.0, 300.0])
    angle = np.array([0.1, 0.1, 0.1, 0.1, 0.1, 1.5, np.nan, np.inf])
    first = np.array([-5000, 0, 5000, 2047, -2048, 2048, 10, 20])
    with np.errstate(all="raise"):
        gains = speckle.gain(first, 64, angle, np.linspace(0.0, 1e9, 8), bad)
        assert speckle.gain(first[:0], 64, angle[:0], 1.0, bad[:0]).shape == (0, 64)
    assert gains.shape == (8, 64) and gains.dtype == np.float32
    assert np.all(np.isfinite(gains)) and np.all(gains >= 0)
    assert np.allclose(gains[-1], 1.0, atol=1e-3)  # a billion looks


def test_limits_of_the_pixel_sum() -> None:
    assert pixel_contrast2(1e-3) == pytest.approx(1.0, abs=1e-5)  # a point sees contrast 1
    area = 4 / math.pi / 15**2  # and a large pixel 1/M, M pixel over correlation area
    assert pixel_contrast2(15.0) == pytest.approx(area, rel=0.1)


def test_programming_errors_are_named(speckle: Speckle) -> None:
    with pytest.raises(ValueError, match="window"):
        speckle.gain(np.zeros(1, int), 4096, np.zeros(1), 1.0, np.full(1, 300.0))
    with pytest.raises(ValueError, match="above 0"):
        Speckle(0, 2048, LENS, wavelength_nm=0.0, pitch_mm=0.007)
    with pytest.raises(ValueError, match="cells"):
        pixel_contrast2(0.0)
