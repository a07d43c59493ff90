"""The table of free space: nothing in it that the camera does not see, whatever the geometry."""

import math

import numpy as np
import pytest
from scanners import EACH_SCANNER, SCANNERS

from vrscan.data import pkg
from vrscan.data.config import Config, Free, Geometry
from vrscan.fixed.free_interval import free_interval
from vrscan.ideal.free_space import free_interval as exact_interval
from vrscan.ideal.free_space import response
from vrscan.ideal.geometry import project
from vrscan.registers.chain_registers import Registers
from vrscan.registers.free_table import HALF, level_ratios

CONFIGS = {
    **SCANNERS,
    "barrel": Config(geometry=Geometry(k1=2e-3, k2=-1e-5)),
    "cushion": Config(geometry=Geometry(k1=-1.5e-3, centre_px=900.0), free=Free(edge_px=20.0)),
    "printed": Config(geometry=Geometry(k1=1e-3, distortion="even")),
    "turned": Config(geometry=Geometry(bias_deg=60.0, offset_mm=-12.0, base_mm=90.0)),
    "far": Config(
        geometry=Geometry(base_mm=300.0, bias_deg=86.5, focal_mm=35.0, unit_mm=4),
        free=Free(focus_mm=3000.0, far_mm=8000.0),
    ),
    "folded": Config(geometry=Geometry(k1=-0.0095)),
}


def words(config: Config, count: int, salt: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return random angles over and beyond the scan, powers and noises, as words."""
    draw = np.random.default_rng(salt)
    half = 1.2 * math.radians(config.mirror.amplitude_deg) / (2 * np.pi) * 2**pkg.ANGLE_WIDTH
    angle = draw.integers(-int(half), int(half), count)
    power = draw.integers(0, config.laser.power_max + 1, count)
    return angle, power, (10.0 ** draw.uniform(2.5, 6, count)).astype(np.int64)


def noise_step(config: Config) -> float:
    """Return what a step of a noise is, counts: full scale is 2**24 for every pixel width."""
    return 2.0 ** (config.sensor.pixel_width - pkg.COUNT_WIDTH)


def table_interval(
    config: Config, angle: np.ndarray, power: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the hardware's interval, mm."""
    given = Registers.from_config(config)
    least, largest = free_interval(
        angle,
        power,
        noise,
        begin=given.free_begin,
        shift=given.free_shift,
        table_from=given.free_table_from,
        table_to=given.free_table_to,
    )
    step = config.geometry.unit_mm / 16.0
    return least * step, largest * step


@pytest.mark.parametrize("name", CONFIGS)
def test_both_ends_are_seen_and_bright_enough(name: str) -> None:
    """The oracle is projection, and the response at the line's own angle; 40,000 lines."""
    config = CONFIGS[name]
    angle, power, noise = words(config, 40_000, 3)
    least, largest = table_interval(config, angle, power, noise)
    rows = largest > 0
    if name == "folded":
        assert not rows.any()
        return
    assert rows.sum() > 3000
    radians = angle[rows] * 2.0 * np.pi / 2**pkg.ANGLE_WIDTH
    last, edge = config.sensor.line_length - 1, config.free.edge_px
    for z in (least[rows], largest[rows], 0.5 * (least + largest)[rows]):
        place = project(z * np.tan(radians), z, config.geometry)
        assert np.all((place >= edge) & (place <= last - edge))
        electrons = response(z, radians, config) * config.free.darkest * power[rows]
        counts = electrons * config.peak.kappa / config.laser.power_max
        snr = counts / (noise[rows] * noise_step(config))
        assert snr.min() >= 0.995 * config.peak.snr_sure


@pytest.mark.parametrize("name", [*SCANNERS, "barrel", "turned"])
def test_little_of_the_exact_interval_is_lost(name: str) -> None:
    """Straight lines and steps of an eighth of an octave cost a tenth of the length at most."""
    config = CONFIGS[name]
    angle, power, noise = words(config, 20_000, 5)
    least, largest = table_interval(config, angle, power, noise)
    radians = angle * 2.0 * np.pi / 2**pkg.ANGLE_WIDTH
    inside = np.abs(radians) < math.radians(config.mirror.amplitude_deg)
    near, far = exact_interval(radians, power, noise * noise_step(config), config)
    exact, kept = np.sum((far - near)[inside]), np.sum((largest - least)[inside])
    print(f"{name}: {100 * kept / exact:.1f} % of the exact length")
    assert 0.88 * exact < kept <= exact


def test_levels_are_those_of_the_quotient() -> None:
    """Each ratio is the least that a rounded quotient maps to its entry."""
    ratios = level_ratios()
    for entry in (0, 24, 31, 40, 77, 127):
        octave, part = divmod(entry, 8)
        quotient = math.ceil((8 + part) * 2.0 ** (octave - 3))
        assert ratios[entry] == (quotient - 0.5) / 256
    assert len(ratios) == HALF and np.all(np.diff(ratios) >= 0)


@EACH_SCANNER
def test_the_table_follows_the_promise(config: Config) -> None:
    """Darker surfaces, a weaker laser or a higher threshold shrink it."""

    def length(section: str, **values: float) -> int:
        own = getattr(config, section).model_copy(update=values)
        given = Registers.from_config(config.model_copy(update={section: own}))
        least, largest = np.array(given.free_table_from), np.array(given.free_table_to)
        return int(np.maximum(largest - least, 0)[HALF:].sum())

    whole = length("free")
    assert length("free", darkest=0.01) < whole < length("free", darkest=0.1)
    assert length("laser", rated_mw=25.0) < whole
    assert length("peak", snr_min=16.0) < whole
