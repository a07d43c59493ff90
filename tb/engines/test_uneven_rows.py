"""Rows whose light is not even: spots beside gradients are measured, and no gradient is a spot."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SENSOR, SCANNERS

from vrscan.data.config import Config
from vrscan.data.lines import Lines
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.engines.tools import repository_root

DEFAULT = SCANNERS["default"]
FULL = 4095  # light is in counts of 12 bits
ROWS = 60  # of each kind of light
SEED = 77
WINDOWS = ["threshold", "two_pass", "fit"]
Light = Callable[[np.random.Generator, np.ndarray], np.ndarray]


def points(
    rows: np.ndarray,
    window: str,
    engine: Engine = Engine.FIXED,
    config: Config = DEFAULT,
    **sensor: int,
) -> Table:
    """Return the points of rows."""
    peak = config.peak.model_copy(update={"window": window})
    update = {"peak": peak, "sensor": config.sensor.model_copy(update=sensor)}
    config = config.model_copy(update=update)
    power = np.full(len(rows), config.laser.power_max, np.int64)
    lines = Lines(lines=rows, angle_rad=np.zeros(len(rows)), power=power)
    return run(engine, lines, config)


def places(config: Config) -> np.ndarray:
    """Return the places of a sensor's pixels, px."""
    return np.arange(config.sensor.line_length)


def pixels(light: np.ndarray, config: Config) -> np.ndarray:
    """Return light as a sensor counts it."""
    top = 2**config.sensor.pixel_width - 1
    return np.clip(np.round(light * (top / FULL)), 0, top).astype(np.uint16)


def camera(draw: np.random.Generator, light: np.ndarray, config: Config) -> np.ndarray:
    """Return light as a sensor's pixels, or as those of a camera with 8 bits, spread to its own."""
    if draw.random() < 0.5:
        return pixels(light + np.sqrt(9 + 0.2 * light) * draw.standard_normal(len(light)), config)
    coarse = light / 16 + draw.choice([0.0, 0.4, 1.0]) * draw.standard_normal(len(light))
    return pixels(np.round(coarse) * (FULL / 255), config)


def edge(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(x, -40, 40)))


def gradient(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    fall = (place / len(place)) ** draw.uniform(0.7, 3)
    return fall if draw.random() < 0.5 else fall[::-1]


def step(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    # Lit for more than a window's length: what is lit for less is a bump.
    return edge(
        draw.choice([-1, 1]) * (place - draw.uniform(300, len(place) - 300)) / draw.uniform(1, 60)
    )


def vignette(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    return np.exp(-(((place - draw.uniform(400, len(place) - 400)) / draw.uniform(400, 1500)) ** 2))


def bump(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * ((place - draw.uniform(0, len(place))) / draw.uniform(45, 400)) ** 2)


def lamps(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    light = np.zeros(len(place))
    for _ in range(draw.integers(1, 5)):
        middle, half = draw.uniform(60, len(place) - 60), draw.uniform(45, 250)
        soft = draw.uniform(1, 20)
        light += (
            draw.uniform(0.3, 1)
            * edge((place - middle + half) / soft)
            * edge((middle + half - place) / soft)
        )
    return light / light.max()


def wave(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    period, shift = np.exp(draw.uniform(np.log(300), np.log(3000))), draw.uniform(0, 7)
    return (0.5 + 0.5 * np.sin(2 * np.pi * place / period + shift)) ** draw.uniform(0.5, 2)


def wall(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    # On any line so many grains that the texture is more than the two rivals a spot may have.
    width = np.exp(draw.uniform(np.log(2), np.log(60 * len(place) / 2048)))
    kernel = np.exp(-0.5 * (np.arange(-200, 201) / width) ** 2)
    texture = np.convolve(draw.standard_normal(len(place) + 400), kernel, "valid")
    light = np.clip(1 + draw.uniform(0.05, 0.35) * texture / texture.std(), 0, None)
    return light / light.max()


def walk(draw: np.random.Generator, place: np.ndarray) -> np.ndarray:
    light = np.cumsum(draw.standard_normal(len(place)))
    return (light - light.min()) / np.ptp(light)


LIGHTS: tuple[Light, ...] = (gradient, step, vignette, bump, lamps, wave, wall, walk)


@EACH_SENSOR
@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.__name__)
def test_light_without_a_spot_is_none(light: Light, window: str, config: Config) -> None:
    """Wider than a spot at a quarter of its height, or one of many: at most one in a hundred."""
    draw = np.random.default_rng([SEED, LIGHTS.index(light)])
    rows = []
    for _ in range(2 * ROWS):
        dark = draw.choice([0, 40, 300])
        counts = dark + draw.uniform(60, 3600) * light(draw, places(config))
        rows.append(camera(draw, counts, config))
    found = points(np.array(rows), window, config=config)
    assert found.measured.mean() <= 0.01, np.flatnonzero(found.measured)


@EACH_SENSOR
@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize(("share", "least"), [(0.2, 0.97), (0.5, 0.9)])
def test_a_gradient_far_from_a_spot_costs_nothing(
    share: float, least: float, window: str, config: Config
) -> None:
    """Spots whose row has a deviation of up to half their height: measured, and where they are."""
    draw = np.random.default_rng([SEED, 100 + int(10 * share)])
    place, step_of = places(config), (2**config.sensor.pixel_width - 1) / FULL
    lights = (gradient, step, vignette, wave)
    rows, true, least_noise, most_noise = [], [], [], []
    for k in range(4 * ROWS):
        centre, sigma = draw.uniform(150, len(place) - 150), draw.uniform(1.5, 6)
        height = draw.uniform(1200, 2500)
        light = share * height * lights[k % 4](draw, place)
        light *= 1 - np.exp(-0.5 * ((place - centre) / 150) ** 2)
        spot = height * np.exp(-0.5 * ((place - centre) / sigma) ** 2)
        deviation = draw.uniform(2, 8)
        row = 60 + light + spot + deviation * draw.standard_normal(len(place))
        rows.append(pixels(row, config))
        true.append(centre)
        beside = np.abs(place - centre) < 9 * 64
        slope = np.abs(np.gradient(light))[beside].max()
        least_noise.append(0.8 * deviation)
        # 16 steps of a slope have a sample variance of 16 17 / 12 of its square.
        most_noise.append(1.2 * np.sqrt(deviation**2 + 1 / 12 + slope**2 * 16 * 17 / 12))
    found = points(np.array(rows), window, config=config)
    assert found.measured.mean() >= least
    off = np.abs(found.position_px - true)[found.measured]
    assert np.median(off) < 0.02 and off.max() < 0.5
    noise = found.noise / step_of
    own = (noise >= least_noise) & (noise <= most_noise)
    assert own.mean() >= least


@EACH_SENSOR
@pytest.mark.parametrize("engine", [Engine.FIXED, Engine.IDEAL])
def test_a_camera_that_clips_below_full_scale_is_saturated_there(
    engine: Engine, config: Config
) -> None:
    spot = 1.5 * FULL * np.exp(-0.5 * ((places(config) - 700) / 3) ** 2)
    clips = int(0.98 * 2**config.sensor.pixel_width)
    row = np.minimum(pixels(60 + spot, config), clips)
    rows = np.stack([row, np.minimum(row, clips - 1)])
    assert not points(rows, "threshold", engine, config).flags["SATURATED"].any()
    level = points(rows, "threshold", engine, config, saturation_level=clips)
    assert level.flags["SATURATED"].tolist() == [True, False]


def measured_rows() -> np.ndarray:
    default = repository_root().parent / "shared" / "data"
    path = Path(os.environ.get("VRSCAN_DATA", default)) / "stairs.npz"
    if not path.is_file():
        pytest.skip(f"no {path}; set VRSCAN_DATA to the folder of stairs.npz")
    with np.load(path) as arrays:
        return np.asarray(arrays["lines"])


@pytest.mark.parametrize("window", WINDOWS)
def test_a_measured_row_without_its_stripe_has_no_clear_point(window: str) -> None:
    """The stripe and its halo are replaced by what is beside them on the darker side."""
    rows = measured_rows()
    rise = rows.max(axis=1).astype(float) - np.median(rows, axis=1)
    rows = rows[rise >= 0.05 * FULL]
    cut = rows.copy()
    for row in cut:
        centre = int(row.argmax())
        sides = [row[centre - 300 : centre - 100], row[centre + 101 : centre + 301]]
        darker = min((side for side in sides if len(side) == 200), key=np.sum)
        hole = row[max(centre - 100, 0) : centre + 100]
        hole[:] = darker[: len(hole)]
    found = points(cut, window)
    assert found.measured.mean() <= 0.025


@pytest.mark.parametrize("window", WINDOWS)
def test_a_rival_is_no_halo(window: str) -> None:
    """On measured rows of one stripe a cut at 2 % of the height saw rivals on 60 %."""
    rows = measured_rows()
    found = points(rows, window)
    assert found.flags["RIVAL"][found.measured].mean() < 0.05
