"""Speckled lines: those of the bench against wave optics, and the section's sums."""

import math
from dataclasses import replace

import numpy as np
import pytest
from coherent_light import coherent_rows
from harness import generator

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Config
from vrscan.detectors.catalogue import detector
from vrscan.ideal.statistics import statistics
from vrscan.study.bench import design_cost, detect
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.sections import speckle_section as section
from vrscan.study.bench.sections.section import Order
from vrscan.study.report.efficiency import BACKGROUND_COUNTS, READ_NOISE_COUNTS
from vrscan.study.report.spot_lines import Spot, most_contrast, score, take

CONFIG = Config()
ORDER = Order(CONFIG, 1, quick=True)
CHECKED = ("one-pass", "two-pass", "fit", "root", "logarithm", "one-step", "centroid-height")
COUNT = 1600
TOLERANCE = 0.12  # over three of either's standard deviation; rows of an image are alike
BOUND, SPECKLED = 0.01, 0.04


def coherent(sigma: float, counts: float, count: int) -> tuple[Pixels, Floats]:
    """Return lines of a rough surface in coherent light, and their true positions."""
    draw = generator(round(100 * sigma))
    half = math.ceil(5 * sigma) + 3
    centre = draw.uniform(-0.5, 0.5, math.ceil(count / 4))
    rows = [coherent_rows(draw, sigma, half, 1, centre_px=place)[::4] for place in centre]
    light = np.concatenate(rows)[:count]
    light *= counts * sigma * math.sqrt(2 * math.pi) / light.sum(axis=1).mean()
    length, kappa = CONFIG.sensor.line_length, CONFIG.peak.kappa
    first = draw.integers(length // 4, 3 * length // 4, count)
    mean = np.full((count, length), BACKGROUND_COUNTS)
    mean[np.arange(count)[:, None], first[:, None] + np.arange(2 * half + 1)] += light
    noisy = kappa * draw.poisson(mean / kappa)
    noisy = noisy + READ_NOISE_COUNTS * draw.standard_normal(mean.shape)
    lines = np.clip(np.floor(noisy + 0.5), 0, 4095).astype(np.uint16)
    return lines, first + half + np.repeat(centre, 4)[:count]


def rms(key: str, lines: Pixels, true: Floats) -> float:
    row = statistics(lines, max_window=255)
    found = score(detector(key).locate(lines, row.background, row.noise, CONFIG), true)
    assert found.lost < 0.01, key
    return found.rms


@pytest.mark.parametrize(("sigma", "counts"), [(3.0, 1500), (7.0, 600)])
def test_the_lines_have_the_errors_of_coherent_light(sigma: float, counts: float) -> None:
    """Speckle of the bench is a shortcut, a table of gains; each detector must err as it does."""
    contrast = most_contrast(CONFIG)[0]
    spot = Spot(sigma, counts / 4096, contrast=contrast)
    taken = take(spot, COUNT, CONFIG, generator(1))
    lines, true = coherent(sigma, counts, COUNT)
    bound = math.sqrt(float(taken.speckled.mean()))
    assert bound > 2.0 * math.sqrt(float(taken.bound.mean()))
    for key in CHECKED:
        own, waves = rms(key, taken.lines, taken.true), rms(key, lines, true)
        print(f"s {sigma:g}, {key}: bench {own:.4f}, waves {waves:.4f}, bound {bound:.4f} px")
        assert own == pytest.approx(waves, rel=TOLERANCE), key
        assert min(own, waves) > bound * (1.0 - TOLERANCE), key


def test_the_bounds_are_one_without_speckle_and_grow_with_it() -> None:
    taken = [take(Spot(3.0, 0.3, contrast=c), 50, CONFIG, generator(2)) for c in (0.0, 0.1, 0.29)]
    assert np.array_equal(taken[0].bound, taken[0].speckled)
    means = [float(each.speckled.mean()) for each in taken]
    assert means == sorted(means) and means[2] > 4.0 * means[1]
    alone = take(Spot(3.0, 0.9, contrast=0.29), 50, CONFIG, generator(2))
    # Under speckle alone the flanks tell as much as the top: more light tells nothing new.
    assert float(alone.speckled.mean()) > 0.4 * means[2]


def made_up(cell: Cell) -> Figures:
    if cell.work == detect.WORK:
        keys = cell.parameters["detectors"]
        bounds = {"bound_px": BOUND, "speckled_px": SPECKLED if cell.parameters["contrast"] else
                  BOUND}  # fmt: skip
        rest = {"bias": 0.0, "spread": 0.0, "lost": 0.01}
        errors = {key: {"rms": 0.02 * (1 + k), **rest} for k, key in enumerate(keys)}
        return {**bounds, "lines": 5, "errors": errors}
    assert cell.work == design_cost.WORK
    lut = 1000.0 if cell.parameters["module"] == "peak_fit" else 100.0
    return {"lut": lut, "ff": 1.0, "ebr": 0.0, "dsp": 0.5}


def test_errors_are_over_their_bounds_and_hardware_is_added_up() -> None:
    rows = {row.detector.key: row for row in section.rows(ORDER, made_up)}
    assert set(rows) == {each.key for each in section.shown()}
    first = rows["one-pass"]
    assert first.by_contrast == pytest.approx((2.0, 0.5, 0.5))
    assert first.over_light == pytest.approx(2.0) and first.worst == pytest.approx(0.5)
    assert (first.lut, first.dsp, first.estimate) == (300, 1.5, "")
    assert rows["two-pass"].lut == 400 and rows["fit"].lut == 1400
    assert rows["root"].lut == 400 + 100 * 2 and rows["root"].estimate
    assert rows["centroid-height"].lut == 400 and rows["one-step"].lut == 1400


def test_every_module_named_is_in_the_rtl_and_synthesised() -> None:
    cells = section.cells(ORDER)
    modules = {c.parameters["module"] for c in cells if c.work == design_cost.WORK}
    assert modules == {name for each in section.shown() for name in section.hardware(each).modules}
    count = len(section.SIGMAS_PX) * len(section.COUNTS) * len(section.CONTRASTS)
    assert sum(c.work == detect.WORK for c in cells) == count


def test_the_work_gives_the_figures_of_the_detectors_asked_for() -> None:
    cell = next(c for c in section.cells(ORDER) if c.parameters.get("contrast"))
    small = replace(cell, parameters={**cell.parameters, "lines": 20})
    found = detect.spots(small.parameters, small.seed)
    assert list(found["errors"]) == cell.parameters["detectors"]
    assert found["speckled_px"] > found["bound_px"]
