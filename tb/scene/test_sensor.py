"""The simulated sensor against its closed forms: transfer curve, skewness, pattern, full well."""

import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import stats

from vrscan.data.arrays import Pixels
from vrscan.scene.sensor import (
    NORMAL,
    WORDS,
    FixedPattern,
    Readout,
    SensorModel,
    Singles,
    bloom,
    expose_even,
    expose_pixels,
    fixed_pattern,
    readout,
    words,
)

SEED = 4711
FINE = Readout(gain=4.0, offset_counts=2000.0, read_noise_e=0.0, top_count=65_535)


def even(mean_e: float, shape: tuple[int, int] = (100, 1000)) -> Singles:
    return np.full(shape, mean_e, np.float32)


def test_words_depend_on_seed_and_block_alone_and_are_even() -> None:
    block = words(SEED, 3, 64, 2048)
    words(SEED, 2, 64, 2048)
    assert np.array_equal(block, words(SEED, 3, 64, 2048))
    assert not np.array_equal(block, words(SEED, 4, 64, 2048))
    assert not np.array_equal(block, words(SEED + 1, 3, 64, 2048))
    assert words(SEED, 0, 3, 5).shape == (3, 5)
    used = np.bincount(block.ravel() >> 8, minlength=256)
    chi2 = float(np.square(used - used.mean()).sum() / used.mean())
    print(f"chi2 of 256 bins {chi2:.0f} / 255 +- 23")
    assert abs(chi2 - 255) < 5 * math.sqrt(2 * 255)
    z = NORMAL[block]
    for other in (z[1:] * z[:-1], z[:, 1:] * z[:, :-1]):
        assert abs(other.mean()) < 5 / math.sqrt(other.size)


def test_the_quantiles_are_a_normal_distribution() -> None:
    z = NORMAL.astype(float)
    assert abs(z.mean()) < 1e-7
    assert np.square(z).mean() == pytest.approx(1.0, abs=1e-6)
    assert (z**4).mean() == pytest.approx(3.0, abs=2e-3)
    assert stats.kstest(z, "norm").statistic < 2e-5


@pytest.mark.parametrize("read_noise", [0.0, 3.0, 15.0])
@pytest.mark.parametrize("mean", [0.0, 1.0, 7.0, 300.0, 9000.0])
def test_both_paths_give_the_same_counts(mean: float, read_noise: float) -> None:
    way = Readout(0.2, 60.0, read_noise, 4095)
    noise = words(SEED, 0, 40, 2048)
    offset = np.linspace(-40, 40, 2048).astype(np.float32)
    for extra in (None, offset):
        table = expose_even(noise, mean, way, extra)
        single = expose_pixels(noise, even(mean, noise.shape), way, extra)
        assert np.array_equal(table, single)
        part = slice(100, 163)
        cut = None if extra is None else np.broadcast_to(extra[part], (40, 63))
        assert np.array_equal(
            table[:, part], expose_pixels(noise[:, part], even(mean, (40, 63)), way, cut)
        )


@pytest.mark.parametrize("mean", [0.0, 2.0, 20.0, 1000.0])
@pytest.mark.parametrize("read_noise", [0.5, 3.0])
def test_mean_variance_and_skewness_are_those_of_poisson_plus_read_noise(
    mean: float, read_noise: float
) -> None:
    # every word once: the moments are those of the table, without sampling error
    every = np.arange(WORDS, dtype=np.uint16).reshape(64, -1)
    way = Readout(FINE.gain, FINE.offset_counts, read_noise, FINE.top_count)
    charge = (expose_pixels(every, even(mean, every.shape), way) - 2000.0) / way.gain
    step = 1 / (12 * way.gain**2)
    variance, third = charge.var(), float(((charge - charge.mean()) ** 3).mean())
    bend = mean / (6 * (mean + read_noise**2))
    print(
        f"m {mean:g} r {read_noise:g}: variance {variance:.4f} / {mean + read_noise**2 + step:.4f}"
        f", third moment {third:.3f} / {mean - 4 * bend**3:.3f}"
    )
    assert charge.mean() == pytest.approx(mean, abs=2e-3)
    assert variance == pytest.approx(mean + read_noise**2 + step, rel=1e-3, abs=1e-3)
    assert third == pytest.approx(mean - 4 * bend**3, rel=0.02, abs=0.01)


def test_tails_are_poissons() -> None:
    noise = words(SEED, 9, 400, 1000)
    charge = (expose_pixels(noise, even(10.0, noise.shape), FINE) - 2000.0) / FINE.gain
    # whole electrons hide in the continuous number: compare half way between them
    for limit in (3, 17, 21):
        measured = float((charge > limit + 0.5).mean())
        predicted = float(stats.poisson(10.0).sf(limit))
        normal = float(stats.norm(10.0, math.sqrt(10.0)).sf(limit + 0.5))
        print(f"P(> {limit} of 10 e) {measured:.2e} / {predicted:.2e}, a normal one {normal:.2e}")
        assert measured == pytest.approx(predicted, rel=0.15)


def test_transfer_curve_has_the_gain_as_slope_and_the_read_noise_as_floor() -> None:
    way = readout(SensorModel(), 0.2, 12)
    noise = words(SEED, 1, 100, 1000)
    mean = np.array([0.0, 1000.0, 3000.0, 6000.0, 12_000.0])
    counts = [expose_pixels(noise, even(m), way).astype(float) for m in mean]
    level = np.array([c.mean() for c in counts]) - 60.0
    variance = np.array([c.var() for c in counts])
    slope, floor = np.polyfit(level, variance, 1)
    floor_predicted = (0.2 * 15) ** 2 + 1 / 12
    print(f"gain {slope:.4f} / 0.2 counts/e, floor {floor:.2f} / {floor_predicted:.2f} counts^2")
    assert slope == pytest.approx(0.2, rel=0.01)
    assert variance[0] == pytest.approx(floor_predicted, rel=0.02)


def test_signal_to_noise_rises_with_the_root_of_the_light_and_below_read_noise_with_the_light() -> (
    None
):
    noise = words(SEED, 2, 200, 1000)

    def slope(low: float, high: float, read_noise: float) -> float:
        way = Readout(1.0, 500.0, read_noise, 65_535)
        snr = []
        for mean in (low, high):
            counts = expose_pixels(noise, even(mean, noise.shape), way).astype(float)
            snr.append((counts.mean() - 500.0) / counts.std())
        return math.log(snr[1] / snr[0]) / math.log(high / low)

    shot, read = slope(1000, 16_000, 2.0), slope(10, 100, 100.0)
    print(f"slope of S/N over light: {shot:.4f} / 0.5 shot, {read:.4f} / 1 read noise")
    assert shot == pytest.approx(0.5, abs=0.005)
    assert read == pytest.approx(1.0, abs=0.03)


def test_counts_end_at_the_converter_or_at_full_well() -> None:
    noise = words(SEED, 5, 8, 256)
    assert readout(SensorModel(), 0.2, 12).top_count == 4095
    low = readout(SensorModel(full_well_e=10_000.0), 0.2, 12)
    assert low.top_count == 2060
    for mean in (1e5, 1e9, 3e38):
        assert np.all(expose_pixels(noise, even(mean, noise.shape), low) == 2060)
        assert np.all(expose_even(noise, min(mean, 1e30), low) == 2060)
    below = Readout(0.2, 0.0, 15.0, 4095)
    dark = expose_even(noise, 0.0, below)
    assert (dark == 0).mean() == pytest.approx(0.56, abs=0.05)  # z 3 counts below half a count


def test_zero_light_without_read_noise_is_the_offset() -> None:
    noise = words(SEED, 6, 4, 64)
    way = Readout(0.2, 60.0, 0.0, 4095)
    assert np.all(expose_even(noise, 0.0, way) == 60)
    assert np.all(expose_pixels(noise, even(0.0, noise.shape), way) == 60)


def test_fixed_pattern_has_the_stated_size_and_comes_from_its_seed() -> None:
    model = SensorModel(prnu=0.01, dsnu_e=8.0)
    pattern = fixed_pattern(model, SEED, 8192)
    again = fixed_pattern(model, SEED, 8192)
    assert np.array_equal(pattern.sensitivity, again.sensitivity)
    assert not np.array_equal(pattern.dark_e, fixed_pattern(model, SEED + 1, 8192).dark_e)
    print(f"prnu {pattern.sensitivity.std():.5f} / 0.01, dsnu {pattern.dark_e.std():.3f} / 8 e")
    assert pattern.sensitivity.std() == pytest.approx(0.01, rel=0.04)
    assert pattern.dark_e.std() == pytest.approx(8.0, rel=0.04)
    assert abs(np.corrcoef(pattern.sensitivity, pattern.dark_e)[0, 1]) < 0.05


def test_pattern_is_seen_in_the_mean_of_many_lines() -> None:
    model = SensorModel(prnu=0.02, dsnu_e=30.0)
    pattern = fixed_pattern(model, SEED, 256)
    way = readout(model, 0.2, 12)
    light = 8000.0
    counts = expose_even(words(SEED, 0, 8000, 256), light, way, pattern.offset(light))
    seen = counts.mean(axis=0)
    expected = 60 + 0.2 * (light * pattern.sensitivity + pattern.dark_e)
    assert np.abs(seen - expected).max() < 5 * 0.2 * math.sqrt(light + 225) / math.sqrt(8000)


def test_a_window_with_a_spot_joins_the_even_line_without_a_seam() -> None:
    model = SensorModel()
    pattern, way = fixed_pattern(model, SEED, 512), readout(model, 0.2, 12)
    noise = words(SEED, 7, 32, 512)
    offset = pattern.offset(40.0)
    line = expose_even(noise, 40.0, way, offset)
    spot = np.zeros((32, 64), np.float32)
    spot[:, 20:44] = 3000.0
    part = slice(100, 164)
    window = np.float32(40.0) + spot * pattern.sensitivity[part]
    counts = expose_pixels(noise[:, part], window, way, offset[part])
    dark = spot == 0
    assert np.array_equal(counts[dark], line[:, part][dark])
    assert counts[~dark].mean() == pytest.approx(60 + 0.2 * 3040, rel=0.01)


def test_blooming_keeps_the_charge_that_is_not_drained() -> None:
    model = SensorModel(full_well_e=1000.0, blooming=0.25, spill_px=3.0)
    light = np.zeros((3, 401), np.float32)
    light[0, 200] = 9000.0
    light[1, 195:206] = 3000.0
    light[2] = 999.0
    after = bloom(light, model)
    excess = np.maximum(light - 1000.0, 0.0).sum(axis=1)
    kept = after.sum(axis=1, dtype=float)
    predicted = light.sum(axis=1, dtype=float) - 0.75 * excess
    print(f"charge {kept} / {predicted}")
    assert kept == pytest.approx(predicted, rel=1e-5)
    assert after.max() <= 1000.0
    assert np.array_equal(after[2], light[2])
    assert after[:2] == pytest.approx(after[:2, ::-1], abs=0.05)
    tail = after[0, 201:212].astype(float)  # 1/e in three pixels, 1,000 e to either side
    assert tail == pytest.approx(1000 * -math.expm1(-1 / 3) * np.exp(-np.arange(11) / 3), rel=1e-4)


def test_spilt_charge_passes_full_neighbours() -> None:
    model = SensorModel(full_well_e=1000.0, blooming=1.0, spill_px=0.1)
    light = np.zeros((1, 101), np.float32)
    light[0, 50] = 5000.0
    after = bloom(light, model)[0]
    assert after[48:53] == pytest.approx(np.full(5, 1000.0), rel=1e-3)
    assert after.sum() == pytest.approx(5000.0, rel=1e-5)


def test_blooming_does_nothing_below_full_well() -> None:
    light = np.full((4, 50), 25_000.0, np.float32)
    assert bloom(light, SensorModel()) is light
    none = bloom(np.full((1, 9), 1e6, np.float32), SensorModel(blooming=0.0))
    assert np.all(none == 25_000.0)


def test_dark_current_is_a_rate() -> None:
    assert SensorModel(dark_e_per_s=1e6).dark_electrons(26.74e-6) == pytest.approx(26.74)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("quantum_efficiency", 1.2),
        ("read_noise_e", -1.0),
        ("full_well_e", 0.0),
        ("prnu", -0.1),
        ("blooming", 2.0),
        ("gain", 0.0),
        ("exposure", 1.0),
    ],
)
def test_bad_keys_and_values_are_rejected(key: str, value: float) -> None:
    with pytest.raises(ValidationError):
        SensorModel.model_validate({key: value})


def test_programming_errors_are_named() -> None:
    with pytest.raises(ValueError, match="gain"):
        readout(SensorModel(), 0.0, 12)
    noise: Pixels = words(SEED, 0, 1, 8)
    for mean in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="electrons"):
            expose_even(noise, mean, FINE)
    assert readout(SensorModel(gain=0.5), 0.2, 12).gain == 0.5
    assert isinstance(fixed_pattern(SensorModel(), 0, 8), FixedPattern)
