"""vrscan_axi: a host on AXI alone loads the instrument, and its streams are those of the model."""

import re
from dataclasses import fields

import cocotb
import numpy as np
import pytest
from axis_bench import BridgedWords, connected, received, send_lines, sink_of
from cocotb.task import bridge
from cocotb.triggers import ClockCycles
from harness import FallingEdge, generator, reset, simulate

from vrscan.clocked.axis_lines import LineUser
from vrscan.clocked.axis_points import user_of
from vrscan.data import link_pkg, pkg
from vrscan.data.config import Config, Geometry, Peak, Sensor
from vrscan.data.errors import InputError
from vrscan.data.records import TEST, decode_full, encode_full
from vrscan.engines.tools import repository_root
from vrscan.fixed.point_record import point_record
from vrscan.fixed.test_line import lines, step_of_width
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.link.axi import AxiDevice
from vrscan.registers.chain_registers import Registers
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.settings import TestLineSettings as Settings

LENGTH, WINDOW, COUNT, PERIOD = 256, 31, 8, 700
ANGLE, POWER = 1 << 18, 30_000
PIXEL_WIDTH = 12
UNSETTLED = 1 << pkg.FLAG_UNSETTLED - pkg.FLAG_NOT_RUNNING
FAULT = 0b10101  # what the guard says
GUARD_OK, BEAT_CLKS = 1 << 1, 16  # in laser_status; from one beat of the guard to the next
CONFIG = Config(
    peak=Peak(window="threshold", snr_min=2.0),
    sensor=Sensor(line_length=LENGTH),
    geometry=Geometry(centre_px=0.6 * LENGTH, pitch_mm=14.0 / LENGTH),
)
PARAMETERS = {"LineLength": LENGTH, "MaxWindow": WINDOW, "PointSlots": 2}


def arranged(words: BridgedWords) -> tuple[AxiDevice, Registers, Settings]:
    """Set a run of test lines, and return what the model needs for it."""
    device = connected(words)
    with pytest.raises(InputError, match="address 0x0fff: the bus answers with an error"):
        device.read_words(0x0FFF, 1)
    assert device.read("axi_refused") == link_pkg.STATUS_NO_ADDRESS
    assert device.read("axi_refused_address") == 0x0FFF
    registers = Registers.from_config(CONFIG)
    names = [field.name for field in fields(Registers) if field.name in REGISTERS]
    names = [name for name in names if REGISTERS[name].access == "rw"]
    device.write_many([(name, int(getattr(registers, name))) for name in names])
    settings = Settings(
        position=100 << pkg.POSITION_FRACTION,
        move=3 << pkg.POSITION_FRACTION,
        step=step_of_width(12.0),
        height=40_000,
        pedestal=3_000,
        noise=400,
        seed=5,
        lines=COUNT,
        period_clks=PERIOD,
    )
    wanted = {f"test_{field.name}": getattr(settings, field.name) for field in fields(settings)}
    device.write_many([*wanted.items(), ("test_angle", ANGLE), ("test_power", POWER)])
    device.write("test_start", 1)
    return device, registers, settings


@cocotb.test()
async def a_run_of_test_lines(dut) -> None:
    """The first lines find a reader; the last ones wait, and what has no room is counted."""
    await reset(dut)
    dut.rx_i.value = 1
    points = sink_of(dut, "m_axis_points", seed=8, pauses=0.2)
    raw = sink_of(dut, "m_axis_lines", seed=9, pauses=0.1)
    device, registers, settings = await bridge(arranged)(BridgedWords(dut))
    for _ in range(3 * PERIOD):
        await FallingEdge(dut.clk_i)
    for sink in (points, raw):
        sink.clear_pause_generator()
        sink.pause = True
    for _ in range((COUNT - 1) * PERIOD):
        await FallingEdge(dut.clk_i)
    counts = await bridge(device.read_many)(("axi_points_dropped", "axi_lines_dropped"))
    points.pause = raw.pause = False
    for _ in range(2 * LENGTH):
        await FallingEdge(dut.clk_i)
    pixels = lines(settings, line_length=LENGTH)
    angle, power = np.full(COUNT, ANGLE), np.full(COUNT, POWER)
    want = run_fixed(pixels, angle, power, registers, max_window=WINDOW)
    check_points(received(points), want, counts["axi_points_dropped"])
    check_lines(received(raw), pixels, counts["axi_lines_dropped"])


async def guard(dut) -> None:
    """Be a guard that permits light."""
    dut.guard_ok_i.value = 1
    while True:
        dut.guard_beat_i.value = 1 - int(dut.guard_beat_i.value)
        await ClockCycles(dut.clk_i, BEAT_CLKS)


@cocotb.test()
async def lines_of_the_sensors_pins(dut) -> None:
    """What a sensor sends comes out, untagged since no line was exposed, and the guard is heard."""
    await reset(dut)
    dut.rx_i.value = 1
    dut.guard_fault_i.value = FAULT
    cocotb.start_soon(guard(dut))
    points, raw = (
        sink_of(dut, f"m_axis_{name}", seed=10, pauses=0.1) for name in ("points", "lines")
    )
    device = await bridge(connected)(BridgedWords(dut))
    await FallingEdge(dut.clk_i)
    sent = generator(11).integers(1 << PIXEL_WIDTH, size=(3, LENGTH))
    await send_lines(dut, sent, 4 * PERIOD)
    packets = received(raw)
    assert [packet.data for packet in packets] == [line.astype("<u2").tobytes() for line in sent]
    users = [LineUser.unpacked(packet.user) for packet in packets]
    assert users == [LineUser(k, UNSETTLED) for k in range(len(sent))]
    records = np.concatenate([decode_full(packet.data) for packet in received(points)])
    assert [*records["line"]] == [0, 1]  # the last one waits for a line behind it
    assert not (records["bits"] & TEST).any()
    means = records["row_mean"] * 2.0 ** (PIXEL_WIDTH - pkg.COUNT_WIDTH)
    assert np.abs(means - sent[:2].mean(axis=1)).max() < 1.0
    read = await bridge(device.read_many)(
        ("laser_guard_fault", "laser_guard_count", "untagged_count", "laser_status")
    )
    assert read.pop("laser_status") & GUARD_OK
    assert read == {"laser_guard_fault": FAULT, "laser_guard_count": 1, "untagged_count": 3}


def check_points(packets, want, dropped: int) -> None:
    numbers = [int(decode_full(p.data)["line"][0]) for p in packets]
    assert numbers == list(range(COUNT - dropped)) and dropped > 0
    ones = np.ones(COUNT, np.int64)
    every = point_record(want, POWER * ones, 0 * ones, ones < 0, ones > 0, 0 * ones, 1)
    for packet, record in zip(packets, every, strict=False):
        assert packet.data == encode_full(record.reshape(1)), decode_full(packet.data)
        assert packet.user == user_of(packet.data)


def check_lines(packets, pixels, dropped: int) -> None:
    assert len(packets) == COUNT - dropped and dropped > 0
    for k, packet in enumerate(packets):
        assert packet.data == pixels[k].astype("<u2").tobytes()
        assert LineUser.unpacked(packet.user) == LineUser(k, test=True)


def test_vrscan_axi_rtl_equals_models() -> None:
    simulate("vrscan_axi", __file__, PARAMETERS, large=True)


def test_every_parameter_of_the_instrument_can_be_set() -> None:
    rtl = repository_root() / "rtl"
    inner, outer = (
        re.findall(r"^  parameter .*?(\w+) += .*", (rtl / file).read_text(), re.MULTILINE)
        for file in ("vrscan.sv", "axi/vrscan_axi.sv")
    )
    instance = (rtl / "axi/vrscan_axi.sv").read_text().split("vrscan #(")[1].split("u_vrscan")[0]
    passed = re.findall(r"\.(\w+)\((\w+)\)", instance)
    assert "Polygon" in inner and set(inner) <= set(outer)
    assert passed == [(name, name) for name in inner]
