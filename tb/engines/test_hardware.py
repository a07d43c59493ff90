"""Registers and tables of a configuration's build begin with what a load of it would write."""

from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import Timer
from harness import CLOCK_NS, FallingEdge, Ports, reset, simulate
from scanners import SCANNERS

from vrscan.clocked.register_file import LATENCY
from vrscan.data import link_pkg
from vrscan.data.config import Config, load
from vrscan.data.errors import InputError
from vrscan.engines.board import on_board
from vrscan.engines.hardware import Hardware
from vrscan.engines.tools import rtl_module
from vrscan.registers.load import CONTROLS, settings
from vrscan.registers.register_map import LOCKS, REGISTERS, WINDOWS
from vrscan.registers.resets import resets, with_resets
from vrscan.registers.values import FIELDS, addresses, to_words


@cocotb.test()
@cocotb.parametrize(name=list(SCANNERS))
async def begins_with(dut, name: str) -> None:
    """Every word that the bus reads, and every register's port, after a reset."""
    config = on_board(SCANNERS[name])
    wanted = settings(config, Hardware.of(config))
    await reset(dut)
    await FallingEdge(dut.clk_i)
    names = [each for each in wanted if each not in FIELDS]
    ports = Ports(dut, [f"{each}_o" for each in names])
    for each, got in zip(names, ports.read(), strict=True):
        value, width = wanted[each], REGISTERS[each].width
        several = value if isinstance(value, tuple) else (value,)
        mask = (1 << width) - 1
        bits = sum((one & mask) << k * width for k, one in enumerate(several))
        assert got & (1 << width * len(several)) - 1 == bits, f"{each}_o is {got:#x}"
    dut.bus_access_i.value = link_pkg.ACCESS_READ
    for each, value in wanted.items():
        for address, word in zip(addresses(each), to_words(each, value), strict=True):
            dut.bus_address_i.value = address
            dut.bus_valid_i.value = 1
            await FallingEdge(dut.clk_i)
            dut.bus_valid_i.value = 0
            await Timer((LATENCY - 2) * CLOCK_NS + 1, "ns")
            await FallingEdge(dut.clk_i)
            got = int(dut.bus_data_o.value)
            assert int(dut.bus_done_o.value) == 1
            assert got == word, f"{each} at {address:#06x} is {got:#x}, want {word:#x}"


@pytest.mark.parametrize("name", SCANNERS)
def test_a_build_begins_with_what_a_load_would_write(name: str) -> None:
    config = on_board(SCANNERS[name])
    package = Hardware.of(config).register_package(config)
    assert package.read_text() != rtl_module("register_pkg").read_text()
    simulate("register_file", __file__, sources=[package], only=f"name={name}$")


def test_what_a_configuration_does_not_say_begins_as_shipped(tmp_path: Path) -> None:
    """Nothing that lights, moves or locks is on; maps, which have no nodes yet, are not used."""
    file = tmp_path / "maps.toml"
    file.write_text("[map]\nthin_lens = true\n[focus]\nmode = 'manual'\n")
    config = on_board(load(file))
    hardware = Hardware.of(config)
    values = resets(config, hardware)
    assert settings(config, hardware)["map_enable"] == 1 and values["map_enable"] == 0
    assert not values.keys() & (CONTROLS | set(LOCKS))
    banked = {field.name for window in WINDOWS.values() if window.bank for field in window.fields}
    assert not values.keys() & banked
    before = rtl_module("register_pkg").read_text().splitlines()
    after = with_resets("\n".join(before), values).splitlines()
    changed = [new for old, new in zip(before, after, strict=True) if old != new]
    assert changed and all(line.startswith("  localparam logic") for line in changed)
    assert not any("Enable" in line for line in changed)


def test_a_build_that_the_configuration_does_not_fit_is_refused() -> None:
    config = Config.model_validate({"mirror": {"oversample": 8}})
    with pytest.raises(InputError, match=r"^defaults: mirror.oversample = 8: the board is built"):
        Hardware.of(Config()).register_package(config)
