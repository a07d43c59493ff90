"""Settings: the fields that the module's SystemVerilog reads, as wide as the struct has them."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from vrscan.registers import settings
from vrscan.registers.chain_registers import Registers
from vrscan.registers.mirror_registers import MirrorRegisters
from vrscan.registers.settings import Settings

RTL = Path(__file__).parents[2] / "rtl"
MODULES = {
    settings.IndexSettings: "mirror/index_capture",
    settings.PhaseSettings: "mirror/mirror_phase",
    settings.AmplitudeSettings: "mirror/amplitude_control",
    settings.DriveSettings: "mirror/mirror_drive",
    settings.TriggerSettings: "timing/line_trigger",
    settings.ReadoutSettings: "timing/line_tag",
    settings.MotionSettings: "mirror/motion_map",
    settings.ScanSettings: "mirror/mirror_loop",
    settings.TestLineSettings: "sensor/test_line",
    settings.FocusSettings: "actuators/focus_*",
    settings.InterlockSettings: "safety/laser_interlock",
    settings.AdaptationSettings: "actuators/power_adaptation",
}
# Switches and strobes, which are inputs of the twin, not settings.
INPUTS = {"mirror_enable", "line_enable", "test_start", "test_stop", "test_angle", "test_power"}
FIELD = re.compile(r"logic (signed )?(?:\[(\d+):0\] )?(\w+);")
STRUCTS = {
    name: (bool(sign), int(high or 0) + 1)
    for sign, high, name in FIELD.findall((RTL / "link/register_pkg.sv").read_text())
}
COUNT = 9  # values of a register of the motion


def registers(kind: type[Settings]) -> list[str]:
    """Return the names of the registers that a class lists."""
    return [kind.PREFIX + field.name for field in fields(kind)]


def bounds(name: str) -> tuple[int, int]:
    """Return the least and the largest value of what the struct has bits for."""
    signed, width = STRUCTS[name]
    if name.startswith("motion_"):
        signed, width = name != "motion_phi", width // COUNT
    return (-(1 << width - 1), (1 << width - 1) - 1) if signed else (0, (1 << width) - 1)


def given(kind: type[Settings], **values: int) -> Settings:
    """Return settings with some values, and zeros."""
    wanted = {}
    for field in fields(kind):
        value = values.get(field.name, 0)
        several = field.name.startswith("motion_")
        wanted[field.name] = (0,) * (COUNT - 1) + (value,) if several else value
    return kind(**wanted)


def test_no_class_is_left_out() -> None:
    assert set(Settings.__subclasses__()) == {*MODULES, Registers}


@pytest.mark.parametrize("kind", MODULES, ids=lambda kind: kind.__name__)
def test_a_module_reads_what_its_settings_list(kind: type[Settings]) -> None:
    source = "".join(file.read_text() for file in sorted(RTL.glob(f"{MODULES[kind]}.sv")))
    groups = re.findall(r"register_pkg::(?!\w*table_t)\w+_t +(\w+_i)\b", source)
    code = re.sub(r"//.*", "", source)
    read = set(re.findall(rf"\b(?:{'|'.join(groups)})\.(\w+)", code))
    read = {name for name in read if not name.endswith("_strobe")} - INPUTS
    assert read == set(registers(kind))


@pytest.mark.parametrize(
    ("kind", "name"),
    [(kind, field.name) for kind in MODULES for field in fields(kind)],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
def test_a_value_is_held_to_its_width(kind: type[Settings], name: str) -> None:
    low, high = bounds(kind.PREFIX + name)
    for value in (low, high):
        given(kind, **{name: value})
    for value in (low - 1, high + 1, -1 << 50, 1 << 50):
        with pytest.raises(ValueError, match=kind.PREFIX + name):
            given(kind, **{name: value})


def test_a_register_of_several_values_takes_so_many() -> None:
    with pytest.raises(ValueError, match="motion_a: needs 9 values"):
        settings.MotionSettings(0, (0,) * 8, (0,) * 9, (0,) * 9, (0,) * 9)


def test_a_part_takes_the_registers_of_all_parts() -> None:
    """The mirror's registers are those of its seven parts, none of them twice, and two tables."""
    parts = [kind for kind in MODULES if issubclass(MirrorRegisters, kind)]
    named = [name for kind in parts for name in registers(kind)]
    assert len(parts) == 7 and len(set(named)) == len(named)
    own = {"clock_hz", "oversample", "table_amplitude", "table_midpoint"}
    assert {field.name for field in fields(MirrorRegisters)} == set(named) | own
