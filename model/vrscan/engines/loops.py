"""The loops of laser and lens in a simulated scan, line by line, by the twins of the hardware.

``PowerLoop`` and ``FocusLoop`` step ``power_adaptation``, ``laser_interlock``, ``focus_filter``,
``focus_target`` and ``focus_motor`` in the clocks in which something happens, and pass over the
others, so that they decide what ``laser_control`` and ``focus_control`` decide in every clock. A
line k starts at the clock floor(k f / rate); its readout begins with line k + 1 + readout_lag, and
its point comes by the chain's latency behind that. ``LoopedScan`` makes a scan whose light follows.

Left out are the mirror's loop, which is in RUN from the first line to the last, a bus that is
disturbed, and a point that waits for ``NEIGHBOUR_CLKS`` where lines are that slow.
"""

import copy
import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from vrscan.clocked import m3_motor
from vrscan.clocked.focus_filter import FocusFilter
from vrscan.clocked.focus_motor import FocusMotor, State
from vrscan.clocked.focus_target import FocusTarget
from vrscan.clocked.i2c_master import Status, command_clocks, effect_clocks
from vrscan.clocked.laser_interlock import BUCKET_MARGIN, Ceilings, LaserInterlock
from vrscan.clocked.power_adaptation import PowerAdaptation
from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints, Pixels, all_rows, some_rows
from vrscan.data.config import BLANKING_CLKS, Config
from vrscan.data.lines import Lines, joined, part
from vrscan.data.points import Points
from vrscan.engines.engine import reach
from vrscan.fixed import vrscan_chain as chain
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.registers.focus_registers import FocusRegisters, Mode
from vrscan.registers.laser_registers import LaserRegisters
from vrscan.registers.map_table import map_table
from vrscan.registers.settings import FocusSettings, LaserSettings
from vrscan.scene.lens_motion import Foci, Motion, steps_of
from vrscan.scene.render import Unexposed
from vrscan.scene.simulate import BLOCK, Scanner, Simulation, picked
from vrscan.scene.timeline import Timeline

FloatOrFloats = TypeVar("FloatOrFloats", float, Floats)

_SETTLE_CLKS = 8  # clocks in which the interlock's registers follow what they are given


@dataclass(frozen=True)
class Clocks:
    """When lines and their points come, in clocks since line 0 began."""

    period: float  # clocks from line to line
    pulse_delay: int
    pulse: int
    lag: int  # exposures that end before a line is read out
    length: int
    pixel_width: int
    two_pass: bool
    fit: bool
    mapped: bool

    @classmethod
    def of(cls, config: Config, registers: Registers) -> "Clocks":
        """Return the clocks of a configuration."""
        hertz, line = config.clock.frequency_hz, config.line
        return cls(
            period=hertz / line.rate_hz,
            pulse_delay=round(1e-6 * line.pulse_delay_us * hertz),
            pulse=max(round(1e-6 * line.pulse_us * hertz), 1),
            lag=config.sensor.readout_lag,
            length=config.sensor.line_length,
            pixel_width=config.sensor.pixel_width,
            two_pass=registers.window_two_pass,
            fit=registers.window_fit,
            mapped=map_table(config) is not None,
        )

    def start(self, line: int) -> int:
        """Return the clock at which a line begins."""
        return math.floor(line * self.period)

    def pulse_begin(self, line: int) -> int:
        """Return the first clock of a line's pulse."""
        return self.start(line) + self.pulse_delay

    def point(self, line: int, width: int, first_width: int, *, measured: bool) -> int:
        """Return the clock at which laser and lens see the point that a line's end lets out.

        With a fit that is the point of the line before.

        Args:
            line: Number of the line.
            width: Pixels of its window.
            first_width: Pixels of its first window.
            measured: Whether it has a window.
        """
        last = self.start(line + 1 + self.lag) + BLANKING_CLKS + self.length
        return (
            last
            + 1
            + chain.latency(
                width,
                measured=measured,
                line_length=self.length,
                pixel_width=self.pixel_width,
                first_width=first_width if self.two_pass else None,
                fit=self.fit,
                mapped=self.mapped,
            )
        )

    def earliest(self, line: int) -> int:
        """Return the first clock at which the point of ``point`` may come."""
        return self.point(line, 0, 0, measured=False)


class PowerLoop:
    """The laser's power from line to line, equal to ``laser_control`` in every line.

    A new one is in RUN and armed, and has the power that ``laser.power_mw`` says.

    Args:
        settings: The registers; ``enable`` is taken as 1.
        pulse_clks: Clocks of a line's pulse.
        ceilings: Parameters of the interlock.
    """

    def __init__(
        self, settings: LaserSettings, pulse_clks: int, ceilings: Ceilings | None = None
    ) -> None:
        settings = replace(settings, enable=1)
        self._adaptation = PowerAdaptation(settings)
        self._interlock = LaserInterlock(settings, ceilings)
        self._pulse_clks = pulse_clks
        self._clock = 0  # the adaptation has been stepped up to here
        self._checked = 0  # and the interlock's bucket
        self._pulse = False
        self._level = 0
        self._points: deque[tuple[int, dict[str, Any]]] = deque()
        for k in range(_SETTLE_CLKS):
            self._adaptation.step(pulse=False, armed=False, inward=True)
            self._guarded(pulse=False, line_start=k > _SETTLE_CLKS // 2)

    def _guarded(self, *, pulse: bool, line_start: bool = False) -> bool:
        """Step the interlock by a clock with all well; return whether there is light in it."""
        lit = self._interlock.gate(pulse)
        self._interlock.step(
            pulse=pulse,
            power=self._adaptation.power,
            line_start=line_start,
            state=pkg.MIRROR_RUN,
            index_alive=True,
            scanning=True,
            startup_ok=True,
            phase=0,
            alive=True,
            guard_ok=True,
        )
        return lit

    @property
    def level(self) -> int:
        """Return the level of the laser in the last pulse's lit part, u16."""
        return self._level

    def take(self, clock: int, **point: int | bool) -> None:
        """Take a point that comes at a clock, not before those that came; fields as the ports."""
        self._points.append((clock, point))

    def _run(self, clock: int) -> None:
        """Step the adaptation up to a clock, which is not stepped."""
        while self._clock < clock:
            due = self._points[0][0] if self._points else clock
            if due > self._clock and not self._adaptation.busy:
                self._clock = min(due, clock)
            else:
                self._step(inward=True)  # the direction counts at a pulse's end only

    def line(self, begin: int, *, inward: bool) -> tuple[int, int]:
        """Return a line's power, u16, and the clocks of light in its pulse.

        Lines are taken in their order, and every point that comes before the end of a line's pulse
        before the line behind it. The power of a pulse that is cut is 0.

        Args:
            begin: First clock of the pulse.
            inward: Whether the mirror is in the first half of its turn at the pulse's end.
        """
        self._run(begin)
        self._idle(begin)
        self._level = self._interlock.power
        power, lit = self._level, self._light(begin)
        self._pulse = True
        self._run(begin + self._pulse_clks - 1)
        self._step(inward=inward)
        self._pulse = False
        self._step(inward=inward)
        return (power if lit == self._pulse_clks else 0), lit

    def _step(self, *, inward: bool) -> None:
        """Step the adaptation by one clock, with a point if it comes now."""
        fields: dict[str, Any] = {}
        if self._points and self._points[0][0] <= self._clock:
            _, point = self._points.popleft()
            fields = {f"point_{name}": value for name, value in point.items()}
            fields["point_valid"] = True
        self._adaptation.step(pulse=self._pulse, armed=True, inward=inward, **fields)
        self._clock += 1

    def _idle(self, clock: int) -> None:
        """Let the bucket run out up to a clock, and the power follow."""
        clks = max(clock - self._checked - _SETTLE_CLKS, 0)
        lock = self._interlock
        drain = min(lock.settings.limit_drain, lock.ceilings.drain)
        lock.level = max(lock.level - drain * clks, 0)
        for _ in range(self._checked + clks, clock):
            self._guarded(pulse=False)
        self._checked = clock

    def _light(self, begin: int) -> int:
        """Return the clocks of light of a pulse, as far as the bucket lets it."""
        lock, clks = self._interlock, self._pulse_clks
        bucket = min(lock.settings.limit_bucket, lock.ceilings.bucket)
        drain = min(lock.settings.limit_drain, lock.ceilings.drain)
        gain = lock.power - drain
        limit = min(lock.settings.limit_pulse_clks, lock.ceilings.pulse_clks)
        self._checked = begin + clks
        if lock.permit and clks <= limit and lock.level + gain * clks <= bucket - BUCKET_MARGIN:
            lock.level = max(lock.level + gain * clks, 0)
            return clks
        lit = sum(self._guarded(pulse=True) for _ in range(clks))
        for _ in range(_SETTLE_CLKS):
            self._guarded(pulse=False)
        self._checked += _SETTLE_CLKS
        return lit


class FocusLoop:
    """The position of the lens, equal to ``focus_control`` on a bus that nobody disturbs.

    A new one has been put to a position by the mode MANUAL, where the motor holds it, and its mode
    is now that of its settings.

    Args:
        settings: The registers.
        table: Positions over z, as ``FocusRegisters.table_position``.
        start: Position of the lens, steps.
        step_clks: Clocks in which the motor moves by a step.
        travel: Largest position of the lens.
    """

    def __init__(
        self,
        settings: FocusSettings,
        table: tuple[int, ...],
        *,
        start: int,
        step_clks: int,
        travel: int,
    ) -> None:
        held = replace(settings, mode=int(Mode.MANUAL), manual=start)
        self._filter, self._target, self.motor = (
            FocusFilter(held),
            FocusTarget(held),
            FocusMotor(held),
        )
        self._target.table = list(table)
        self._travel = travel
        self.motion = Motion(0, start, start, step_clks)
        self._clock = 0
        self._points: deque[tuple[int, bool, int, int]] = deque()
        self._effect: tuple[int, int] | None = None  # clock and new target
        self._reply: tuple[int, int] | None = None  # clock and position
        self._settings = held
        while self.motor.state is not State.HOLD:
            self._advance(self._clock + 1)
        self._settings = settings
        for each in (self._filter, self._target, self.motor):
            each.settings = settings
        # The scan's clocks begin here.
        self._shift(-self._clock)

    def _shift(self, clks: int) -> None:
        """Count clocks from another moment."""
        self._clock += clks
        self.motion = replace(self.motion, begin=self.motion.begin + clks)
        if self._effect is not None:
            self._effect = self._effect[0] + clks, self._effect[1]
        if self._reply is not None:
            self._reply = self._reply[0] + clks, self._reply[1]

    def take(self, clock: int, *, measured: bool, flags: int, z: int) -> None:
        """Take a point that comes at a clock, not before those that came; ``z`` as the port."""
        self._points.append((clock, measured, flags, z))

    def run(self, clock: int) -> None:
        """Go on up to a clock."""
        self._advance(clock)

    def _advance(self, clock: int) -> None:
        while self._clock < clock:
            due = [clock]
            due += [each[0] for each in (self._reply, self._effect) if each is not None]
            due += [self._points[0][0]] if self._points else []
            quiet = min(due) - self._clock
            if quiet > 0:
                quiet = min(quiet, self._quiet())
            if quiet > 0:
                self.motor.skip(quiet)
                self._clock += quiet
            else:
                self._step()

    def _quiet(self) -> int:
        """Return for how many clocks nothing happens unless a point or a reply comes."""
        if self._filter.busy or self._filter.valid or self._target.busy:
            return 0
        lens = self._target
        return self.motor.quiet_clks(target=lens.target, known=lens.known)

    def _step(self) -> None:
        """Step all twins by one clock."""
        now, lens, motor, taken = self._clock, self._target, self.motor, self._filter
        busy = lens.busy
        reply, self._reply = (
            (self._reply, None)
            if self._reply is not None and self._reply[0] <= now
            else (None, self._reply)
        )
        if self._effect is not None and self._effect[0] <= now:
            self.motion = self.motion.towards(min(self._effect[1], self._travel), now)
            self._effect = None
        if motor.command_valid:
            self._command(now)
        motor.step(
            target=lens.target,
            known=lens.known,
            reply_valid=reply is not None,
            reply_status=int(Status.OK),
            reply_data=0 if reply is None else reply[1],
        )
        lens.step(valid=taken.valid, distance=taken.distance, lapse=taken.lapse)
        point = None
        if self._points and self._points[0][0] <= now:
            point = self._points.popleft()
        valid = point is not None
        _, measured, flags, z = point if point is not None else (0, False, 0, 0)
        taken.step(valid=valid, measured=measured, flags=flags, test=False, z=z, busy=busy)
        self._clock += 1

    def _command(self, now: int) -> None:
        """Send the motor's command over the bus."""
        motor, quarter = self.motor, self._settings.quarter_clks
        bus: dict[str, Any] = {"read": motor.command_read, "quarter": quarter}
        if self._settings.protocol:
            effect, end = m3_motor.effect_clocks(**bus), m3_motor.command_clocks(**bus)
        else:
            effect, end = effect_clocks(count=2, **bus), command_clocks(count=2, **bus)
        effect, end = now + effect, now + end + 1
        if motor.command_read:
            self._reply = end, self.motion.at(effect)
        else:
            self._effect = effect, motor.command_data
            self._reply = end, 0


@dataclass(frozen=True)
class Controls:
    """What laser and lens did in n lines."""

    power: Ints  # power of the line as its point has it, u16 [n]
    light: Floats  # power that the pulse's light has on average [n]
    lens: Ints  # position of the lens, steps from infinity's [n]
    known: Ints  # the same as the instrument knows it [n]

    def of(self, rows: Bools) -> "Controls":
        """Return some of the lines."""
        return some_rows(self, rows)

    @classmethod
    def joined(cls, parts: Sequence["Controls"]) -> "Controls | None":
        """Return all lines of ``parts``; None of none."""
        return all_rows(parts) if parts else None


@dataclass(frozen=True)
class Looped:
    """A block of lines whose light followed the loops."""

    simulation: Simulation
    controls: Controls


@dataclass(frozen=True)
class _Peak:
    """What the point of one line says to laser and lens."""

    measured: bool
    saturated: bool
    maximum: int
    background: int
    power: int
    inward: bool
    flags: int = 0
    z: int = 0


@dataclass
class Progress:
    """Where a scan stands between two blocks; it may be pickled."""

    number: int  # of the next block
    power: PowerLoop | None
    focus: FocusLoop | None
    waiting: _Peak | None  # the point that waits for the next line's
    before: Lines | None  # the last lines, whose speckle the next points depend on


class LoopedScan:
    """A scan whose laser, lens or both follow the scene; blocks come in their order.

    Args:
        scanner: The scan as it is without loops.
        adaptive: Whether the power follows the peaks; otherwise it is the scene's.
        automatic: Whether the lens follows the distance; otherwise it stays at the scene's focus.

    Raises:
        InputError: if a value of the configuration does not fit in its register.
    """

    def __init__(self, scanner: Scanner, *, adaptive: bool, automatic: bool) -> None:
        self.scanner, light = scanner, scanner.light
        config = self._config = light.belief
        self._registers = Registers.from_config(config)
        self._maps = map_table(config)
        self._clocks = Clocks.of(config, self._registers)
        level = light.scene.laser.power_mw / config.laser.rated_mw
        self._scene_power = level * config.laser.power_max
        power = focus = None
        if adaptive:
            laser = replace(LaserRegisters.from_config(config), adapt=1)
            power = PowerLoop(laser, self._clocks.pulse)
        self._infinity = round(1e3 * config.focus.infinity_mm / config.focus.resolution_um)
        self._still = steps_of(light.scene.lens.focus_mm, config) + self._infinity
        self._foci: Foci | None = None
        if automatic:
            registers = FocusRegisters.from_config(config)
            step_s = 1e-3 * config.focus.resolution_um / config.focus.speed_mm_per_s
            focus = FocusLoop(
                replace(registers, mode=int(Mode.AUTOMATIC)),
                registers.table_position,
                start=self._still,
                step_clks=max(1, round(step_s * config.clock.frequency_hz)),
                travel=round(1e3 * config.focus.travel_mm / config.focus.resolution_um),
            )
            self._foci = Foci(light, scanner.renderer.of)
        self.progress = Progress(0, power, focus, None, None)

    def blocks(self) -> Iterator[Looped]:
        """Yield the blocks of the scan that are left, and go on after each."""
        while self.progress.number < self.scanner.blocks:
            yield self._block()

    def line(self, number: int, light: float, lens: int) -> Pixels:
        """Return the counts of one line [length].

        Args:
            number: Number of the line.
            light: Power of its pulse, as ``Controls.light``.
            lens: Position of the lens, as ``Controls.lens``.
        """
        when, words = self.scanner.given(np.array([number]))
        made = self._unexposed(when, np.array([lens + self._infinity]))
        share = np.array([self._share(light)])
        counts: Pixels = self.scanner.renderer.exposed(made, slice(None), share, words)[0]
        return counts

    def _share(self, light: FloatOrFloats) -> FloatOrFloats:
        """Return the light of pulses over that at the scene's power."""
        return light / self._scene_power if self._scene_power else light

    def _block(self) -> Looped:
        now, scanner = self.progress, self.scanner
        when, first = scanner.timeline(now.number), now.number * BLOCK
        words = scanner.words(now.number)[: len(when)]
        lens, known = self._positions(copy.deepcopy(now.focus), when)
        light = self._unexposed(when, lens)
        while True:
            power = copy.deepcopy(now.power)
            frame = self._exposed(light, when, words, power, now.waiting)
            lines = replace(frame.lines, truth=light.truth, lens=self._from_infinity(known))
            focus = copy.deepcopy(now.focus)
            waiting = now.waiting
            if focus is None:
                break
            points = self._points(lines)
            for k, peak in enumerate(frame.peaks):
                full = replace(peak, flags=int(points.flags[k]), z=int(points.z[k]))
                waiting = self._let_out(focus, waiting, full, frame.clocks[k])
            found, told = self._positions(focus, when)
            if np.array_equal(found, lens) and np.array_equal(told, known):
                break
            light = self._unexposed(when, found, light, found != lens)
            lens, known = found, told
        last = frame.peaks[-1] if focus is None else waiting
        before, depth = lines, reach(self._config)[0]
        if now.before is not None:
            before = joined([now.before, replace(lines, truth=None)])
        before = part(replace(before, truth=None), slice(len(before) - depth, None))
        held = last if self._clocks.fit else None
        self.progress = Progress(now.number + 1, power, focus, held, before if depth else None)
        rows = slice(0, min(len(when), scanner.count - first))
        controls = Controls(
            power=lines.power[rows],
            light=frame.light[rows],
            lens=lens[rows] - self._infinity,
            known=known[rows] - self._infinity,
        )
        return Looped(Simulation(part(lines, rows), picked(when, rows)), controls)

    def _from_infinity(self, known: Ints) -> Ints | None:
        """Return positions of the lens as the maps take them, None where it does not move."""
        return None if self._foci is None else np.maximum(known - self._infinity, 0)

    def _positions(self, focus: FocusLoop | None, when: Timeline) -> tuple[Ints, Ints]:
        """Return where the lens stands in the middle of each pulse, and where it was last read."""
        clocks = self._clocks
        if focus is None:
            place = np.full(len(when), self._still)
            return place, place
        found = np.empty((2, len(when)), np.int64)
        for k, line in enumerate(when.line.tolist()):
            middle = clocks.pulse_begin(line) + clocks.pulse // 2
            focus.run(middle)
            found[:, k] = focus.motion.seen(middle), focus.motor.position
        return found[0], found[1]

    def _unexposed(
        self,
        when: Timeline,
        lens: Ints,
        known: Unexposed | None = None,
        changed: Bools | None = None,
    ) -> Unexposed:
        """Return the light of lines; of those that have not changed it is known."""
        if self._foci is None:
            return self.scanner.renderer.unexposed(when)
        rows = np.arange(len(when)) if changed is None else np.flatnonzero(changed)
        parts = []
        order = []
        for place in np.unique(lens[rows]).tolist():
            some = rows[lens[rows] == place]
            order.append(some)
            renderer = self._foci.renderer(place - self._infinity)
            parts.append(renderer.unexposed(picked(when, some)))
        if known is not None and changed is not None:
            kept = np.flatnonzero(~changed)
            order.append(kept)
            parts.append(known.of(kept))
        return Unexposed.joined(parts, np.argsort(np.concatenate(order), kind="stable"))

    def _exposed(
        self,
        light: Unexposed,
        when: Timeline,
        words: Pixels,
        loop: PowerLoop | None,
        waiting: _Peak | None,
    ) -> "_Exposed":
        """Return lines with the power that the loop asks for, a few at a time."""
        clocks, renderer, count = self._clocks, self.scanner.renderer, len(when)
        first = int(when.line[0])
        inward = when.rate_rad_per_s < 0.0
        counts = np.empty((count, words.shape[1]), np.uint16)
        power = np.full(count, round(self._scene_power), np.int64)
        bright = np.full(count, self._scene_power)
        peaks: list[_Peak] = []
        times: list[int] = []
        row = 0
        while row < count:
            end = row
            if loop is None:
                end = count
            else:
                # No point that is still to come is there before the ends of these lines' pulses.
                soonest = clocks.earliest(first + row)
                while end < count and clocks.pulse_begin(first + end) + clocks.pulse < soonest:
                    begin = clocks.pulse_begin(first + end)
                    power[end], lit = loop.line(begin, inward=bool(inward[end]))
                    bright[end] = loop.level * lit / clocks.pulse
                    end += 1
            some = slice(row, end)
            counts[some] = renderer.exposed(light, some, self._share(bright[some]), words[some])
            found = chain.peaks(counts[some], self._registers)
            for k in range(row, end):
                made = _peak(found, k - row, int(power[k]), bool(inward[k]), clocks.pixel_width)
                at = clocks.point(
                    first + k,
                    int(found.width[k - row]),
                    int(found.first_width[k - row]),
                    measured=bool((found.measured if clocks.fit else found.placed)[k - row]),
                )
                if loop is not None:
                    waiting = self._let_out(loop, waiting, made, at)
                peaks.append(made)
                times.append(at)
            row = end
        lines = Lines(counts, light.reported_rad, power)
        return _Exposed(lines, bright, peaks, times)

    def _let_out(
        self,
        loop: PowerLoop | FocusLoop,
        waiting: _Peak | None,
        peak: _Peak,
        clock: int,
    ) -> _Peak:
        """Give a loop the point that a line's end lets out: with a fit that of the line before."""
        given = waiting if self._clocks.fit else peak
        if given is not None:
            if isinstance(loop, PowerLoop):
                loop.take(
                    clock,
                    measured=given.measured,
                    saturated=given.saturated,
                    maximum=given.maximum,
                    background=given.background,
                    power=given.power,
                    inward=given.inward,
                    test=False,
                )
            else:
                loop.take(clock, measured=given.measured, flags=given.flags, z=given.z)
        return peak

    def _points(self, lines: Lines) -> Points:
        """Return the points of a block's lines, but for what the line behind says of the last."""
        before = self.progress.before
        skipped = 0 if before is None else len(before)
        whole = lines if before is None else joined([before, replace(lines, truth=None)])
        points = chain.run_fixed(
            whole.lines,
            angle_turns(whole.angle_rad),
            whole.power,
            self._registers,
            maps=self._maps,
            lens=whole.lens,
        )
        return points.of(slice(skipped, None))


@dataclass(frozen=True)
class _Exposed:
    """Lines of a block, and what their points say."""

    lines: Lines
    light: Floats  # power that the pulse's light has on average
    peaks: list[_Peak]
    clocks: list[int]  # when the end of each line lets a point out


def _peak(found: chain.Peaks, k: int, power: int, inward: bool, pixel_width: int) -> _Peak:
    """Return what the point of one line says; counts are left-aligned to 16 bits."""
    return _Peak(
        measured=bool(found.measured[k]),
        saturated=bool(found.saturated[k]),
        maximum=int(found.maximum[k]) << (16 - pixel_width),
        background=int(found.background[k]) >> 8,
        power=power,
        inward=inward,
    )
