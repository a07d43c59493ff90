"""vrscan_guarded: light and drive end with either clock, and a line comes through from its pins."""

import cocotb
from axis_bench import BridgedWords, connected, received, sink_of
from cocotb.clock import Clock
from cocotb.task import bridge
from cocotb.triggers import ClockCycles, FallingEdge, Timer
from harness import generator, simulate

from vrscan.data import pkg
from vrscan.link.axi import AxiDevice

PARAMETERS = {"LineLength": 256, "MaxWindow": 31}
PERIODS_NS = {"clk_i": 10, "sensor_clk_i": 14, "guard_clk_i": 40}
GUARD_CLKS = 16 + 4  # of laser_guard, from the last beat of the core to dark
WATCH_CLKS = 64 + 3 + 1  # of guard_watch, and laser_interlock's
BEAT_CLKS = 4  # of laser_guard, from a beat to the next one
PINS = ("index_light_o", "startup_pin_o", "pulse_o")
LINE_PIXELS = PARAMETERS["LineLength"]
WORDS = {  # a mirror that is searched for at once, and a start-up channel that may shine
    "sweep_word": 1 << 20,
    "work_word": 1 << 21,
    "sweep_timeout": 1 << 30,
    "settle_timeout": 1 << 30,
    "level_nominal": 1 << 19,
    "laser_limit_startup": 1_000,
    "laser_startup": 1_000,
}


class Bench:
    """The module, its three clocks and a host on AXI."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.clocks = {name: self.clock(name) for name in PERIODS_NS}

    def clock(self, name: str):
        """Start a clock."""
        clock = Clock(getattr(self.dut, name), PERIODS_NS[name], unit="ns")
        return cocotb.start_soon(clock.start())

    def stop(self, name: str) -> None:
        """Stop a clock where it is."""
        self.clocks[name].cancel()

    async def start(self) -> AxiDevice:
        """Reset all, and return the host."""
        dut = self.dut
        for name in ("ready_i", "guard_ready_i", "sensor_valid_i", "comparator_i", "gate_i"):
            getattr(dut, name).value = 0
        for name in ("rx_i", "focus_scl_i", "focus_sda_i"):
            getattr(dut, name).value = 1
        await ClockCycles(dut.guard_clk_i, 8)
        dut.ready_i.value = dut.guard_ready_i.value = 1
        await FallingEdge(dut.axi_rst_o)
        return await bridge(connected)(BridgedWords(dut, "axi_rst_o"))

    def lit(self) -> bool:
        """Return whether the start-up channel is on at its pin."""
        return bool(int(self.dut.index_light_o.value))


def light(device: AxiDevice) -> None:
    """Bring the start-up channel up: the mirror's index is searched for."""
    device.write_many([*WORDS.items()])
    device.write_many([("laser_enable", 1), ("mirror_enable", 1)])
    for _ in range(50):
        state = device.read("mirror_state")
        if state == pkg.MIRROR_SETTLE:
            break
    assert state == pkg.MIRROR_SETTLE


async def lights_up(bench: Bench) -> AxiDevice:
    """Begin anew, and return the host of an instrument with light."""
    device = await bench.start()
    await bridge(light)(device)
    await ClockCycles(bench.dut.clk_i, 400)
    assert bench.lit() and int(bench.dut.guard_ok_o.value)
    return device


@cocotb.test()
async def dark_without_the_guards_clock(dut) -> None:
    """The core takes its light back where the guard has stopped, in mid-permission."""
    bench = Bench(dut)
    await lights_up(bench)
    bench.stop("guard_clk_i")
    await ClockCycles(dut.clk_i, BEAT_CLKS * PERIODS_NS["guard_clk_i"] // PERIODS_NS["clk_i"])
    await ClockCycles(dut.clk_i, WATCH_CLKS)
    assert int(dut.guard_ok_o.value)  # it is stuck
    for _ in range(300):
        await ClockCycles(dut.clk_i, 1)
        assert not any(int(getattr(dut, pin).value) for pin in PINS)


@cocotb.test()
async def dark_without_the_cores_clock(dut) -> None:
    """The guard ends light and drive where the core has stopped, whatever its outputs are."""
    bench = Bench(dut)
    await lights_up(bench)
    driven = set()
    for _ in range(400):
        await ClockCycles(dut.clk_i, 1)
        driven.add(int(dut.level_pin_o.value))
    assert driven == {0, 1}
    bench.stop("clk_i")
    await Timer((GUARD_CLKS + 1) * PERIODS_NS["guard_clk_i"], "ns")
    for _ in range(300):
        await ClockCycles(dut.guard_clk_i, 1)
        pins = (*PINS, "drive_o", "level_pin_o")
        assert not any(int(getattr(dut, pin).value) for pin in pins)


@cocotb.test()
async def a_line_comes_from_the_pins(dut) -> None:
    """A pixel a clock of the sensor; the host reads a line, and no overflow."""
    bench = Bench(dut)
    device = await bench.start()
    sink = sink_of(dut, "m_axis_lines", seed=1, pauses=0.2, reset="axi_rst_o")
    pixels = generator(2).integers(1 << 12, size=LINE_PIXELS)
    for pixel in pixels:
        await FallingEdge(dut.sensor_clk_i)
        dut.sensor_valid_i.value, dut.sensor_pixel_i.value = 1, int(pixel)
    await FallingEdge(dut.sensor_clk_i)
    dut.sensor_valid_i.value = 0
    await ClockCycles(dut.clk_i, 2 * LINE_PIXELS)
    assert [packet.data for packet in received(sink)] == [pixels.astype("<u2").tobytes()]
    assert await bridge(device.read)("pixel_overflow_count") == 0


def test_vrscan_guarded() -> None:
    simulate("vrscan_guarded", __file__, PARAMETERS, large=True)
