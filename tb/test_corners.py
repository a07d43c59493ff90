"""The instrument at its shortest and longest lines and its narrowest and widest pixels."""

import sys

import numpy as np
import pytest
from harness import generator, in_volume

from vrscan.data import pkg
from vrscan.data.config import Config, Geometry, Peak, Sensor
from vrscan.data.points import points_equal
from vrscan.engines.chain_engine import run_rtl
from vrscan.engines.tools import repository_root, rtl_module
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal.geometry import triangle, undistorted
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.registers.load import settings

sys.path.insert(0, str(repository_root() / "scripts"))
import lint

# Bits of a pixel and pixels of a line; two make all of them once.
CORNERS = [(8, 256), (16, 8192), in_volume(16, 256), in_volume(8, 8192)]
EACH = pytest.mark.parametrize(("width", "length"), CORNERS)


@pytest.mark.parametrize(("width", "length"), [(8, 256), (16, 8192), (16, 256), (8, 8192)])
def test_the_instrument_passes_the_linter(width: int, length: int) -> None:
    check = lint.verilator(rtl_module("vrscan"), PixelWidth=width, LineLength=length).run()
    assert not check.failed, check.words


@EACH
def test_the_instrument_is_read_by_yosys(width: int, length: int) -> None:
    check = lint.yosys(rtl_module("vrscan"), PixelWidth=width, LineLength=length).run()
    assert not check.failed, check.words


def instrument(width: int, length: int) -> Config:
    """Return an instrument whose optical axis is not in the middle of the line.

    A line without a block far from the spot has the spot in its noise, so its S/N is small.
    """
    return Config(
        peak=Peak(snr_min=2.0 if length < 512 else 8.0),
        sensor=Sensor(pixel_width=width, line_length=length),
        geometry=Geometry(centre_px=0.6 * length, pitch_mm=14.0 / length),
    )


@EACH
def test_spots_are_where_they_were_put(width: int, length: int) -> None:
    """RTL and model are equal, and both agree with the truth and with the float triangle."""
    draw = generator(width + length)
    config = instrument(width, length)
    registers = Registers.from_config(config)
    count, top = 120, (1 << width) - 1
    place = draw.uniform(30.0, length - 31.0, count)
    size = draw.uniform(1.5, 6.0, (count, 1))
    height = draw.uniform(0.3, 0.8, (count, 1)) * top
    noise = 0.004 * top
    lines = 0.05 * top + noise * draw.standard_normal((count, length))
    lines += height * np.exp(-0.5 * ((np.arange(length) - place[:, None]) / size) ** 2)
    lines = np.clip(np.round(lines), 0, top).astype(np.uint16)
    turns = angle_turns(draw.uniform(-0.3, 0.3, count))
    angle = turns * (2.0 * np.pi / 2.0**pkg.ANGLE_WIDTH)
    power = np.full(count, 1000)
    want = run_fixed(lines, turns, power, registers)
    assert points_equal(run_rtl(lines, turns, power, registers), want) is None

    assert want.measured.mean() > 0.95
    position = want.position / 2.0**pkg.POSITION_FRACTION
    bound = (1.0623 * np.sqrt(size) * noise / height)[:, 0]  # Cramer and Rao's of white noise
    off = (np.abs(position - place) / bound)[want.measured]
    print(f"\n{width} bits, {length} px: error over its bound {np.sqrt((off**2).mean()):.3f} rms")
    assert off.max() < 6.0 and np.sqrt((off**2).mean()) < 2.0

    place_mm = triangle(undistorted(position, config.geometry)[0], angle, config.geometry)
    near = want.measured & ~place_mm.no_range & (place_mm.z > 150.0) & (place_mm.z < 1500.0)
    assert near.sum() > 10
    scale = 2.0**pkg.LENGTH_FRACTION
    z_off = np.abs(want.z / scale - place_mm.z)[near].max()
    x_off = np.abs(want.x / scale - place_mm.x)[near].max()
    print(f"z {z_off:.5f} and x {x_off:.5f} mm off the float triangle")
    assert max(z_off, x_off) < 0.003


@pytest.mark.parametrize(("width", "length"), [(8, 256), (16, 8192), (16, 256), (8, 8192)])
def test_every_register_has_room(width: int, length: int) -> None:
    """The axis at either end of the line goes through the registers."""

    class Built:
        clock_hz = 100_000_000
        line_length = length
        pixel_width = width
        index_oversample = 4

    for centre in (0.0, length - 1.0):
        config = instrument(width, length)
        slow = config.line.model_copy(update={"rate_hz": 10_000.0})
        geometry = config.geometry.model_copy(update={"centre_px": centre})
        given = config.model_copy(update={"line": slow, "geometry": geometry})
        assert settings(given, Built())["centre"] == round(centre * 2**pkg.OFFSET_FRACTION)
