"""The loops of laser and lens in a scan decide what the twins decide in every clock."""

from dataclasses import replace

import numpy as np
import pytest
from harness import generator
from scanners import EACH_SCANNER

from vrscan.clocked.focus_control import FocusControl
from vrscan.clocked.focus_motor import State
from vrscan.clocked.laser_control import LaserControl
from vrscan.data import pkg
from vrscan.data.arrays import Ints
from vrscan.data.config import Config
from vrscan.data.points import points_equal
from vrscan.engines.chain_engine import run_rtl
from vrscan.engines.loops import Clocks, FocusLoop, LoopedScan, PowerLoop
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal.correction_map import correction, thin_lens_maps
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.registers.focus_registers import FocusRegisters, Mode
from vrscan.registers.laser_registers import LaserRegisters
from vrscan.registers.map_table import map_table
from vrscan.scene.description import load
from vrscan.scene.lens_motion import Motion, focus_of, steps_of
from vrscan.scene.light import Light
from vrscan.scene.simulate import Scanner

PERIOD, PULSE, LINES = 160, 12, 400
LASERS = {
    "open": {},
    "tight": {"limit_drain": 2_000, "limit_bucket": 1 << 20},
    "apart": {"shared": 0, "limit_power": 40_000},
}
POINT = {"maximum": 0, "background": 0, "power": 0, "inward": 0, "measured": 0, "saturated": 0}
FEW = frozenset({"shot", "read", "defocus", "speckle", "smear", "falloff"})


@EACH_SCANNER
@pytest.mark.parametrize("laser", LASERS)
def test_the_power_of_every_line_is_that_of_laser_control(laser: str, config: Config) -> None:
    """Points 2 to 5 lines behind their own line, in any clock; a bucket that cuts pulses."""
    own = LASERS[laser] | {"adapt": 1, "limit_pulse_clks": PULSE}
    settings = replace(LaserRegisters.from_config(config), **own)
    draw = generator(11)
    inward = np.arange(LINES) // 37 % 2 == 0
    delay = draw.integers(2 * PERIOD, 5 * PERIOD, LINES)
    reflectance = np.exp(draw.uniform(-1.0, 4.0, LINES))
    loop = PowerLoop(settings, PULSE)
    twin = LaserControl(replace(settings, enable=1))
    quiet = {"state": pkg.MIRROR_RUN, "index_alive": True, "scanning": True, "startup_ok": True}
    quiet |= {"alive": True, "guard_ok": True, "guard_fault": 0}
    for k in range(40):  # two lines start before line 0, as in RUN
        lines = {"line_start": k in (20, 30), "pulse": False, "centre": False, "phase": 0}
        twin.step(**lines, **quiet, guard_beat=bool(k >> 3 & 1))
    events: dict[int, dict[str, int]] = {}
    got, want = [], []
    last = 0
    for k in range(LINES):
        begin = k * PERIOD + 3
        power, lit = loop.line(begin, inward=bool(inward[k]))
        got.append((power, lit))
        clocks, seen = 0, 0
        for clock in range(k * PERIOD, (k + 1) * PERIOD):
            pulse = begin <= clock < begin + PULSE
            phase = 0 if inward[k] else 1 << 15
            clocks += twin.interlock.gate(pulse)
            point = {f"point_{name}": v for name, v in events.get(clock, POINT).items()}
            twin.step(
                pulse=pulse,
                line_start=clock == k * PERIOD,
                centre=clock == begin + PULSE // 2,
                phase=phase,
                point_valid=clock in events,
                guard_beat=bool(clock >> 3 & 1),
                **point,
                **quiet,
            )
            if clock == begin + PULSE:
                seen = twin.line(pulse=False, centre=False, phase=phase)[0]
        want.append((seen, clocks))
        # The point of this line comes some lines behind it.
        last = max(k * PERIOD + int(delay[k]), last + 40)
        height = int(min(power * reflectance[k] / 8, 65_535))
        point = {"maximum": height, "background": 300, "power": power}
        point |= {"inward": int(inward[k]), "measured": height > 900}
        point |= {"saturated": height == 65_535}
        events[last] = point
        loop.take(last, **point)
    assert got == want
    assert len({power for power, _ in got}) > 100
    if laser == "tight":
        assert any(lit < PULSE for _, lit in got)


class Device:
    """A motor on the bus as ``tb/devices/i2c_device.sv`` has it, with a lens that moves."""

    def __init__(self, start: int, step_clks: int) -> None:
        self.motion, self.registers, self.clock = Motion(0, start, start, step_clks), [0, 0], 0
        self.scl = self.sda = True
        self.active = self.reading = self.pull = False
        self.bit, self.byte, self.shift, self.pointer, self.frozen = 15, 0, 0, 0, start

    def step(self, scl: bool, sda: bool) -> None:
        """Take the levels of a clock."""
        before_scl, before_sda, self.scl, self.sda = self.scl, self.sda, scl, sda
        if before_scl and scl and before_sda and not sda:
            self.active, self.reading, self.pull, self.bit, self.byte = True, False, False, 15, 0
            self.frozen = self.motion.at(self.clock)
        elif before_scl and scl and not before_sda and sda:
            self.active = self.pull = False
        elif self.active and not before_scl and scl:
            self.shift = (self.shift << 1 | sda) & 0xFF if self.bit != 8 else self.shift
            if self.reading and self.byte and self.bit == 8 and sda:
                self.active = False
        elif self.active and before_scl and not scl:
            was, self.bit = self.bit, 0 if self.bit in (8, 15) else self.bit + 1
            self.byte += was == 8
            self._fall()
        self.clock += 1

    def _fall(self) -> None:
        shown = self.frozen >> 8 if self.pointer == 2 else self.frozen & 0xFF
        self.pull = self.reading and self.bit != 8 and not shown >> (7 - self.bit) & 1
        if self.bit != 8:
            return
        if self.byte == 0:
            self.reading, self.pull = bool(self.shift & 1), True
        elif self.reading:
            self.pointer += 1
        else:
            self.pull = True
            if self.byte == 1:
                self.pointer = self.shift
            else:
                self.registers[self.pointer] = self.shift
                self.pointer += 1
                if self.pointer == 2:
                    target = self.registers[0] << 8 | self.registers[1]
                    self.motion = self.motion.towards(target, self.clock)


class Stage(Device):
    """An M3 on the bus, as ``tb/devices/m3_stage.sv`` has it, that is always well."""

    heard = reply = b""

    def _fall(self) -> None:
        shown = self.reply[0] if self.reply else 0xFF
        self.pull = self.reading and self.bit != 8 and not shown >> (7 - self.bit) & 1
        if self.bit != 8:
            return
        if self.byte == 0:
            self.reading, self.pull = bool(self.shift & 1), True
        elif self.reading:
            self.reply = self.reply[1:]
        else:
            self.pull = True
            self.heard += bytes([self.shift])
            if self.heard == b"<10>\r":
                self.reply = b"<10 300000 %08X 00000000>\r" % self.motion.at(self.clock)
            elif self.shift == ord("\r"):
                self.motion = self.motion.towards(int(self.heard[4:12], 16), self.clock)
                self.reply = b"<08>\r"
            self.heard = b"" if self.shift == ord("\r") else self.heard


@EACH_SCANNER
@pytest.mark.parametrize("protocol", [0, 1], ids=["registers", "m3"])
def test_the_lens_goes_where_focus_control_sends_it(protocol: int, config: Config) -> None:
    """Points of a scene that jumps to and fro: targets, readings and places, clock by clock."""
    draw, unit_mm = generator(12), config.geometry.unit_mm
    registers = FocusRegisters.from_config(config)
    settings = replace(
        registers,
        mode=int(Mode.AUTOMATIC),
        average_shift=2,
        hold_points=3,
        lapse=6,
        quarter_clks=5,
        poll_clks=700,
        timeout_clks=60_000,
        protocol=protocol,
    )
    start, step_clks = 2_000, 9
    loop = FocusLoop(settings, registers.table_position, start=start, step_clks=step_clks,
                     travel=6_000)  # fmt: skip
    held = replace(settings, mode=int(Mode.MANUAL), manual=start)
    twin, device = FocusControl(held), (Device, Stage)[protocol](start, step_clks)
    twin.lens.table = list(registers.table_position)
    idle = {"valid": False, "measured": False, "flags": 0, "test": False, "z": 0}

    def clock(**point: object) -> None:
        # A pin's level is that which both left in the clock before.
        scl, sda = not twin.master.scl_low, not (twin.master.sda_low or device.pull)
        device.step(scl, sda)
        twin.step(**(idle | point), scl=scl, sda=sda)

    while twin.motor.state is not State.HOLD:
        clock()
    twin.configure(settings)
    period, z_mm = 400, config.free.focus_mm
    got, want = [], []
    for k in range(1_500):
        if k % 300 == 150:
            z_mm = float(draw.uniform(config.focus.near_mm, config.focus.far_mm))
        z = round((z_mm + draw.normal(0.0, 0.5)) / unit_mm * (1 << pkg.LENGTH_FRACTION))
        measured = bool(draw.random() < 0.7)
        loop.take(k * period + 10, measured=measured, flags=0, z=z)
        loop.run((k + 1) * period)
        for at in range(period):
            clock(valid=at == 10, measured=measured, z=z)
        got.append((loop.motion.target, loop.motion.at((k + 1) * period), loop.motor.position))
        want.append((device.motion.target, device.motion.at(device.clock), twin.motor.position))

    assert got == want
    assert len({target for target, _, _ in got}) >= 4


def scan(config: Config, scene: str, count: int, *, adaptive: bool, automatic: bool) -> LoopedScan:
    focus = config.focus.model_copy(update={"average_points": 64, "hold_points": 64})
    if automatic:
        maps = config.map.model_copy(update={"thin_lens": True})
        config = config.model_copy(update={"focus": focus, "map": maps})
    light = Light(load(scene), config)
    return LoopedScan(Scanner(light, count, FEW), adaptive=adaptive, automatic=automatic)


@EACH_SCANNER
def test_a_thin_lens_needs_the_maps_of_a_thin_lens(config: Config) -> None:
    """What the image's scale takes a position by, the maps give back, with the lens between two."""
    focal_mm, maps = config.geometry.focal_mm, thin_lens_maps(config)
    own, length = config.free.focus_mm, config.sensor.line_length
    near_mm, far_mm = config.focus.near_mm, config.focus.far_mm
    for focus_mm in (1.08 * near_mm, 1.39 * near_mm, own, 1.12 * own, 0.99 * far_mm):
        steps = steps_of(focus_mm, config)
        assert focus_of(steps, config) == pytest.approx(focus_mm, rel=2e-3)
        moved = 1 / focal_mm - 1 / focus_of(steps, config)
        scale = (1 / focal_mm - 1 / own) / moved
        sharp = np.linspace(100.0, length - 100.0, 50)
        centre = config.geometry.centre_px
        place = np.full(50, maps.place(np.array(1e-3 * config.focus.resolution_um * steps)))
        given = centre + (sharp - centre) * scale, np.zeros(50), place, maps.corrections_px
        found = given[0] + correction(*given, line_length=length)
        assert np.abs(found - sharp).max() < 0.03  # between two maps a chord for a hyperbola


@EACH_SCANNER
def test_lines_whose_power_is_known_beforehand_are_those_of_a_scan(config: Config) -> None:
    """At the scene's power, in any groups, light is that of ``Scanner``."""
    plain = scan(config, "default", 1024, adaptive=False, automatic=False)
    looped = next(plain.blocks())
    lines = plain.scanner.part(0).lines
    got = looped.simulation.lines
    assert (got.lines != lines.lines).mean() < 1e-4
    assert np.array_equal(got.power, lines.power)
    assert np.array_equal(got.angle_rad, lines.angle_rad)


@EACH_SCANNER
def test_power_brings_peaks_to_the_target(config: Config) -> None:
    """The adapted power follows near and far parts; a scan goes on from a copy of its progress."""
    adapted = scan(config, "default", 2100, adaptive=True, automatic=False)
    first = next(adapted.blocks())
    again = scan(config, "default", 2100, adaptive=True, automatic=False)
    again.progress = adapted.progress
    one, two = (list(each.blocks()) for each in (adapted, again))
    assert [len(each.simulation.lines) for each in one] == [1024, 52]
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a.simulation.lines.lines, b.simulation.lines.lines)
        assert np.array_equal(a.controls.power, b.controls.power)
    power = first.controls.power
    assert power[0] == round(65_535 * 5.0 / 50.0) and len(np.unique(power)) > 100
    # The power of a line is what points asked for before it starts. With a fit the first point
    # comes with the end of the second line.
    clocks = Clocks.of(config, Registers.from_config(config))
    comes = clocks.point(1, 3, 3, measured=True)
    before = sum(clocks.start(line) <= comes for line in range(9))
    assert before >= 4 and len(set(power[:before].tolist())) == 1


@EACH_SCANNER
def test_the_lens_follows_a_plane_and_the_points_stay(config: Config) -> None:
    """From the scene's focus to the plane's: points are right at rest, by RTL as by the twin."""
    automatic = scan(config, "plane", 2048, adaptive=False, automatic=True)
    blocks = list(automatic.blocks())
    lens = np.concatenate([each.controls.lens for each in blocks])
    focus_mm = automatic.scanner.light.scene.lens.focus_mm
    assert lens[0] == steps_of(focus_mm, config) and len(np.unique(lens)) > 20
    assert np.abs(np.diff(lens)).max() <= 4
    lines, config = blocks[1].simulation.lines, automatic.scanner.light.belief
    registers, maps = Registers.from_config(config), map_table(config)
    given = lines.lines, angle_turns(lines.angle_rad), lines.power, registers
    points = run_fixed(*given, maps=maps, lens=lines.lens)
    assert lines.truth is not None
    good = points.measured & np.isfinite(lines.truth.position_px)
    z_mm = points.z[good] * config.geometry.unit_mm / (1 << pkg.LENGTH_FRACTION)
    error = z_mm - lines.truth.z_mm[good]
    assert abs(np.median(error)) < 0.03 and np.median(np.abs(error)) < 0.2
    # Positions of the lens that differ from line to line.
    moving: Ints = np.asarray(lines.lens) + generator(3).integers(-200, 200, len(lines))
    some = slice(0, 300)
    few = given[0][some], given[1][some], given[2][some], registers
    want = run_fixed(*few, maps=maps, lens=moving[some])
    got = run_rtl(*few, maps=maps, lens=moving[some])
    assert points_equal(got, want) is None
    assert points_equal(replace(want, x=points.x[some], z=points.z[some]), want) is not None
