"""The library of lines that the virtual board's sensor has: against the light simulator itself."""

import math
from pathlib import Path

import numpy as np
import pytest
from harness import generator

from vrscan.data.config import Config
from vrscan.data.points import table
from vrscan.data.table import Table
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.scene import library as lines
from vrscan.scene.description import Description, load, parse
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer
from vrscan.scene.sensor import bloom, expose_pixels
from vrscan.scene.timeline import Scan, timeline
from vrscan.study.report.efficiency import with_window

CONFIG = Config()
LENGTH = CONFIG.sensor.line_length


def rated(name: str) -> Description:
    return lines.standing(load(name), CONFIG)


@pytest.mark.parametrize("name", ["default", "sunlit", "window-ghost"])
def test_charge_and_noise_make_the_simulators_lines(name: str) -> None:
    scene = rated(name)
    renderer = Renderer(Light(scene, CONFIG), frozenset(present(scene)))
    when = timeline(0, 200, 200, CONFIG, scene.scan, scene.seed)
    words = np.stack([lines.words(7, k, LENGTH) for k in range(200)])
    want = renderer.render(when, words).lines.astype(int)
    charge = renderer.charge(when)
    mean = bloom(charge.laser_e + charge.other_e, scene.sensor)
    offset = charge.other_offset_e + charge.offset_e
    got = expose_pixels(words, mean, renderer.readout, offset).astype(int)
    # The sums are taken in another order: a count's end may fall between.
    assert np.abs(got - want).max() <= 1
    assert (got != want).mean() < 1e-4
    assert want.max() > 1000


def test_a_flickering_lamp_is_its_mean() -> None:
    values: dict[str, object] = {
        "target": [{"kind": "plane", "position_mm": [0, 0, 450]}],
        "lamp": [{"kind": "halogen", "illuminance_lux": 50_000.0, "flicker": 0.8}],
    }
    scene = parse(values, "lamp", Path())
    made = lines.renderer(scene, CONFIG)
    assert made.light.flicker_e() > 1.0
    charge = made.charge(lines.at_angles(np.zeros(1), CONFIG.mirror))
    dark = scene.sensor.dark_electrons(made.light.exposure_s)
    even = dark + made.light.veil_e()
    want = made.light.ambient("lamps", 0.0) * made.light.pattern.sensitivity + even
    assert np.allclose(charge.other_e, want, rtol=0.01)
    assert charge.other_e.mean() > 10 * dark


def points(laser: np.ndarray, angle: np.ndarray, made: Renderer) -> Table:
    """Return the points of lines at four tenths of the rated power, always with the same noise."""
    charge = made.charge(lines.at_angles(angle[:1], CONFIG.mirror))
    mean = bloom(np.float32(0.4) * laser + charge.other_e, made.light.scene.sensor)
    words = np.stack([lines.words(1, k, LENGTH) for k in range(len(angle))])
    offset = charge.other_offset_e + charge.offset_e
    found = expose_pixels(words, mean, made.readout, offset)
    power = np.full(len(angle), CONFIG.laser.power_max)
    # One window: a fit would stand on a line and not on its neighbour, which is not light's doing.
    registers = Registers.from_config(with_window(CONFIG, "threshold"))
    return table(run_fixed(found, angle_turns(angle), power, registers))


def test_between_two_angles_a_line_is_far_nearer_than_speckle() -> None:
    made = lines.renderer(load("default"), CONFIG)
    turned = lines.angles(CONFIG)
    angle = generator(3).uniform(turned[100], turned[-100], 600)
    place = (angle - turned[0]) / (turned[1] - turned[0])
    row = place.astype(int)
    share = (place - row).astype(np.float32)[:, None]
    exact = made.charge(lines.at_angles(angle, CONFIG.mirror)).laser_e
    low = made.charge(lines.at_angles(turned[row], CONFIG.mirror)).laser_e
    high = made.charge(lines.at_angles(turned[row + 1], CONFIG.mirror)).laser_e
    smooth = Renderer(made.light, made.active - {"speckle"})
    still = smooth.charge(lines.at_angles(angle, CONFIG.mirror)).laser_e
    want = points(exact, angle, made)

    def apart(laser: np.ndarray) -> tuple[float, float]:
        got = points(laser, angle, made)
        both = got.located & want.located
        px = got.position_px[both] - want.position_px[both]
        near = np.argsort(np.abs(px))[: int(0.99 * len(px))]  # the others are at edges
        assert (got.located != want.located).sum() <= 3
        return float(np.std(px[near])), float(np.std((got.z_mm - want.z_mm)[both][near]))

    linear, nearest = apart(low + share * (high - low)), apart(np.where(share < 0.5, low, high))
    speckle = apart(still)
    print(f"px, mm rms: linear {linear}, nearest {nearest}, speckle {speckle}")
    assert linear[0] < 0.1 * speckle[0] and linear[1] < 0.1 * speckle[1]
    assert linear[0] < 0.2 * nearest[0]


def test_the_mirrors_speed_goes_with_its_angle() -> None:
    when = timeline(0, 2000, 2000, CONFIG, Scan(), 1)
    made = lines.at_angles(when.angle_rad, CONFIG.mirror)
    peak = np.abs(when.rate_rad_per_s).max()
    # Between inward and outward the harmonics differ by 1e-3.
    assert np.abs(made.rate_rad_per_s - np.abs(when.rate_rad_per_s)).max() < 4e-3 * peak
    beyond = lines.at_angles(np.radians([-22.0, 22.0]), CONFIG.mirror)
    assert (beyond.rate_rad_per_s == 0.0).all()


def test_the_angles_reach_beyond_the_mirrors() -> None:
    turned = lines.angles(CONFIG)
    assert len(turned) == lines.ANGLES and turned[0] == -turned[-1]
    assert turned[-1] == pytest.approx(1.05 * math.radians(CONFIG.mirror.amplitude_deg))


def test_a_library_is_made_once_for_a_scene_and_an_instrument(tmp_path: Path) -> None:
    told: list[int] = []
    scene = load("plane")
    first = lines.library(scene, CONFIG, tmp_path, count=300, progress=told.append)
    assert told == [256, 300]
    again = lines.library(scene, CONFIG, tmp_path, count=300, progress=told.append)
    assert again == first and told == [256, 300]
    other = Config.model_validate({"line": {"pulse_us": 2.0}})
    assert lines.library(scene, other, tmp_path, count=300) != first
    assert lines.library(load("step"), CONFIG, tmp_path, count=300) != first


def test_the_file_holds_what_its_header_says(tmp_path: Path) -> None:
    scene = load("plane")
    data = lines.library(scene, CONFIG, tmp_path, count=300).read_bytes()
    text = data[: lines.HEADER].rstrip(b"\0").decode()
    named = {name: float(value) for name, value in (row.split() for row in text.splitlines())}
    made = lines.renderer(scene, CONFIG)
    assert named == lines.header(made, 300)
    numbers = np.frombuffer(data[lines.HEADER :], "<f4")
    rows = numbers[1 << 16 :].reshape(-1, LENGTH)
    turned = lines.angles(CONFIG, 300)
    some = np.array([140, 150, 255, 256])  # of two blocks
    charge = made.charge(lines.at_angles(turned[some], CONFIG.mirror))
    assert (rows[0] == charge.other_e).all() and (rows[2] == charge.offset_e).all()
    assert (rows[3 + some] == charge.laser_e).all()
    assert rows.shape[0] == 303 and charge.laser_e.max() > 1000


def test_words_of_lines_and_places_have_nothing_in_common() -> None:
    words = np.stack([lines.words(5, k, 4096) for k in range(64)])
    assert len(np.unique(words.astype(np.uint64).view(np.uint64), axis=0)) == 64
    normal = (words.astype(float) - 32767.5) / 18918.6
    assert abs(normal.mean()) < 0.01 and abs(normal.std() - 1) < 0.01
    across = (normal[:, 1:] * normal[:, :-1]).mean()
    along = (normal[1:] * normal[:-1]).mean()
    assert max(abs(across), abs(along)) < 0.01
    assert (lines.words(5, 1, 4096)[:100] == lines.words(5, 1, 100)).all()


def test_a_scanner_that_pans_stands_still_at_its_rated_power() -> None:
    scene = load("default")
    pans = scene.model_copy(update={"scan": scene.scan.model_copy(update={"pan_mm_per_s": 50.0})})
    angle = np.radians(np.linspace(-5.0, 5.0, 20))
    same = [
        lines.renderer(each, CONFIG).charge(lines.at_angles(angle, CONFIG.mirror)).laser_e
        for each in (scene, pans)
    ]
    assert (same[0] == same[1]).all()
    own = Renderer(Light(scene, CONFIG), frozenset(present(scene)))
    less = own.charge(lines.at_angles(angle, CONFIG.mirror)).laser_e
    share = scene.laser.power_mw / CONFIG.laser.rated_mw
    assert share < 1 and np.allclose(less, share * same[0], rtol=1e-4, atol=1e-2)
