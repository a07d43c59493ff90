"""The autofocus's registers against the lens, and the table's error against its focus."""

import re
import tomllib

import numpy as np
import pytest
from documented import ROOT

from vrscan.clocked.focus_target import position
from vrscan.data.config import Clock, Config, Focus, Geometry
from vrscan.data.errors import InputError
from vrscan.registers.focus_registers import TABLE_SIZE, FocusRegisters, Mode, image_shift

MM = 4096  # steps of z


def registers(**focus: object) -> FocusRegisters:
    """Return the registers of a focus section."""
    return FocusRegisters.from_config(Config(focus=Focus(**focus)))


def test_the_image_of_a_thin_lens() -> None:
    geometry = Geometry(focal_mm=25.0, bias_deg=90.0, offset_mm=-5.0)
    # 1/25 = 1/45 + 1/56.25; twice the focal length; infinity; no image.
    assert image_shift(40.0, geometry) == pytest.approx(31.25)
    assert image_shift(45.0, geometry) == pytest.approx(25.0)
    assert image_shift(1e9, geometry) == pytest.approx(0.0, abs=1e-6)
    assert image_shift(20.0, geometry) == np.inf
    # Towards an axis that is 30 degrees off, it is a longer way.
    slanted = Geometry(focal_mm=25.0, bias_deg=60.0)
    assert image_shift(250.0, slanted) == pytest.approx(625.0 / (250.0 / np.cos(np.pi / 6) - 25.0))


@pytest.mark.parametrize(("near", "far"), [(240.0, 1000.0), (300.0, 420.0), (900.0, 1900.0)])
@pytest.mark.parametrize("offset", [0.0, 12.5])
def test_the_table_is_the_lens(near: float, far: float, offset: float) -> None:
    config = Config(
        focus=Focus(
            mode="automatic",
            near_mm=near,
            far_mm=far,
            infinity_mm=0.05,
            manual_mm=near,
            travel_mm=4.0,
        ),
        geometry=Geometry(offset_mm=offset),
    )
    given = FocusRegisters.from_config(config)
    assert given.mode == Mode.AUTOMATIC
    assert len(given.table_position) == TABLE_SIZE
    z = np.linspace(near, far, 2001)
    got = [position(round(mm * MM), given.z_begin, given.z_shift,
                    list(given.table_position)) for mm in z]  # fmt: skip
    want = [(0.05 + image_shift(mm, config.geometry)) / 0.5e-3 for mm in z]
    worst = float(np.abs(np.array(got) - want).max())
    # An eighth of the spacing squared times the curvature where it is largest; two roundings, and
    # a fraction of 10 bits that is cut.
    spacing = 2.0 ** (given.z_shift + 10) / MM
    way = (near - offset) / np.sin(config.geometry.bias_rad) - 25.0
    chord = spacing**2 / 8.0 * 2.0 * 25.0**2 / way**3 / 0.5e-3
    slope = spacing * 25.0**2 / way**2 / 0.5e-3
    bound = 1.05 * chord + 1.0 + slope / 1024
    print(f"table {near} to {far} mm: measured {worst:.2f}, predicted {bound:.2f}, floor 0.5 steps")
    assert worst <= bound
    assert 63 * spacing >= far - near
    assert far - near > 63 * spacing / 2 or given.z_shift == 0
    assert given.manual == round(want[0])


def test_another_unit_of_length_asks_for_the_same_places_of_the_lens() -> None:
    focus = Focus(mode="automatic", near_mm=256.0, far_mm=1024.0)
    small, large = (
        FocusRegisters.from_config(Config(focus=focus, geometry=Geometry(unit_mm=unit)))
        for unit in (1, 4)
    )
    assert (small.z_begin, large.z_begin) == (256 * MM, 64 * MM)
    for mm in (256.0, 300.0, 512.0, 1000.0):
        got, want = (
            position(round(mm / unit * MM), each.z_begin, each.z_shift, list(each.table_position))
            for unit, each in ((4, large), (1, small))
        )
        assert abs(got - want) <= 1


def test_an_m3_has_its_own_address_and_speed() -> None:
    """Chosen as the bring-up page says; what is given stays."""
    page = (ROOT / "docs" / "bring-up.md").read_text()
    (text,) = re.findall(r"```toml\n(\[focus\]\n.*?)```", page, re.DOTALL)
    focus = Focus(**tomllib.loads(text)["focus"])
    given = FocusRegisters.from_config(Config(focus=focus))
    assert (given.protocol, given.address, focus.speed_mm_per_s) == (1, 0x33, 4.0)
    assert (given.mode, given.quarter_clks) == (Mode.MANUAL, 88)
    assert 6000 < given.table_position[0] < 30_000
    assert registers(motor="m3", address=0x44).address == 0x44
    with pytest.raises(ValueError, match="motor"):
        Focus(motor="m4")


def test_the_shipped_registers() -> None:
    given = registers()
    assert given == FocusRegisters(
        table_position=given.table_position,
        mode=0,
        manual=round(625.0 / (500.0 / np.sin(np.radians(82.0)) - 25.0) / 0.5e-3),
        average_shift=12,
        lapse=20_000,
        z_begin=240 * MM,
        z_shift=6,
        hysteresis=20,
        hold_points=4096,
        address=0x2A,
        quarter_clks=313,
        stretch_clks=3_125_000,
        poll_clks=250_000,
        tolerance=2,
        timeout_clks=125_000_000,
        retries=3,
        protocol=0,
    )
    assert max(given.table_position) <= 6000
    assert min(np.diff(given.table_position)) < 0
    assert registers(mode="manual").mode == Mode.MANUAL


@pytest.mark.parametrize(
    ("focus", "words"),
    [
        ({"mode": "automatic", "near_mm": 200.0}, "focus.near_mm: 200 mm needs the lens at 3.5"),
        ({"mode": "automatic", "infinity_mm": -0.7}, "focus.far_mm: 1000 mm needs the lens at -0"),
        ({"mode": "manual", "manual_mm": 24.0}, "focus.manual_mm: 24 mm needs the lens at inf"),
        ({"quarter_us": 1000.0}, "focus.quarter_us: needs a register value of 125000"),
        ({"travel_mm": 40.0}, "focus.travel_mm: needs"),
        ({"hysteresis_um": 40_000.0}, "focus.hysteresis_um: needs"),
        ({"tolerance_um": 40_000.0}, "focus.tolerance_um: needs"),
        ({"timeout_s": 40.0}, "focus.timeout_s: needs"),
        ({"poll_ms": 140.0}, "focus.poll_ms: needs"),
        ({"stretch_ms": 140.0}, "focus.stretch_ms: needs"),
        ({"near_mm": 2049.0, "far_mm": 3000.0}, "focus.near_mm: needs"),
    ],
)
def test_what_does_not_fit(focus: dict[str, object], words: str) -> None:
    with pytest.raises(InputError) as error:
        registers(**focus)
    assert str(error.value).startswith(f"defaults: {words}")


def test_a_focus_that_is_off_asks_nothing_of_the_lens() -> None:
    config = Config(geometry=Geometry(focal_mm=300.0), clock=Clock(frequency_hz=100e6))
    given = FocusRegisters.from_config(config)
    assert set(given.table_position) == {6000}
    assert given.quarter_clks == 250


@pytest.mark.parametrize(
    ("focus", "words"),
    [
        ({"average_points": 3000}, "power of two"),
        ({"near_mm": 1000.0}, "not below far_mm"),
        ({"address": 128}, "address"),
        ({"mode": "auto"}, "mode"),
    ],
)
def test_what_is_no_configuration(focus: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Focus(**focus)
