"""The mirror's loop, the twin of ``rtl/mirror/mirror_loop.sv``, which connects its parts.

Between two edges of any signal only accumulators and timers advance. The lines' time base is the
only part with many edges. It takes nothing from the other parts but a word at a line's start, so it
runs in a lane of its own; each lane is stepped through its edges and skips the clocks between them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from vrscan.clocked import (
    amplitude_control,
    index_capture,
    line_trigger,
    mirror_drive,
    mirror_phase,
)
from vrscan.data import pkg
from vrscan.data.arrays import Ints
from vrscan.data.edges import Rows
from vrscan.fixed.motion_map import LATENCY as MAP_LATENCY
from vrscan.fixed.motion_map import motion_map
from vrscan.fixed.scan_angle import LATENCY as SCAN_LATENCY
from vrscan.fixed.scan_angle import scan_angle
from vrscan.registers.mirror_registers import MirrorRegisters

Map = tuple[Ints, Ints]  # a_k and phi_k of the harmonics, [HARMONIC_COUNT] each
Turn = tuple[int, int, Map]  # phase and amplitude of an angle, and its harmonics

ANGLE_LATENCY = SCAN_LATENCY + 2  # clocks from centre_o to angle_valid_o

LINE = np.dtype(
    [
        (name, np.int64)
        for name in (
            "line", "centre_halves", "clock", "state", "flags", "confidence", "angle", "amplitude",
            "word", "level",
        )
    ]
)  # fmt: skip
MEASUREMENT = np.dtype(
    [
        (name, np.int64)
        for name in ("clock", "measured", "error", "level", "word", "phase", "drive_phase")
    ]
)

# Outputs of the parts that are also outputs of the loop.
_OF_DRIVE = ("drive", "level", "level_pin", "state", "fault", "word")
_OF_TRIGGER = (
    "line_start", "line", "exposure", "laser", "centre", "centre_half", "overrun_count",
)  # fmt: skip
_OF_CAPTURE = ("missing_count", "doubled_count", "impossible_count", "glitch_count")

TAKE_CLKS = 3  # from take to the renewal of the harmonics: ``TakeClks``

_NEVER = 1 << 62
_TURN_MASK = (1 << pkg.TURN_WIDTH) - 1
_PHASE_DROP = pkg.TURN_WIDTH - pkg.PHASE_WIDTH
_PHASE_MASK = (1 << pkg.PHASE_WIDTH) - 1
_UNSETTLED = 1 << (pkg.FLAG_UNSETTLED - pkg.FLAG_NOT_RUNNING)
_INDEX_FAULT = 1 << (pkg.FLAG_INDEX_FAULT - pkg.FLAG_NOT_RUNNING)


@dataclass(frozen=True)
class Report:
    """The reports of a run of the loop, as structured arrays.

    Attributes:
        lines: ``LINE`` rows, one for each line, taken in the clock of ``angle_valid``;
            ``centre_halves`` is the clock of the laser pulse's centre, in half clocks.
        measurements: ``MEASUREMENT`` rows, one for each pair of crossings.
    """

    lines: Rows
    measurements: Rows


class MirrorLoop:
    """Clock-accurate loop. A new one is in the state after a reset, with its table written.

    Args:
        registers: Object with the configuration ports as attributes without ``_i``, those of
            motion_map as sequences, and with ``table_amplitude`` and ``table_midpoint``.
        index_oversample: Samples per clock, ``IndexOversample``.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        clock: Number of clocks since the reset.
        capture, phase, control, drive, trigger: The twins of the parts; ``ports`` shows them as of
            ``clock``.
        angle_valid: Whether there is an angle.
        angle_line: Number of the angle's line; defined with ``angle_valid``.
        amplitude: Averaged amplitude of the angle; ``ports`` has more.
    """

    def __init__(
        self, registers: MirrorRegisters, index_oversample: int = 4, count_width: int = 16
    ) -> None:
        self.capture = index_capture.IndexCapture(registers, index_oversample, count_width)
        self.phase = mirror_phase.MirrorPhase(registers)
        self.phase.table_amplitude[:] = registers.table_amplitude
        self.phase.table_midpoint[:] = registers.table_midpoint
        self.control = amplitude_control.AmplitudeControl(registers)
        self.drive = mirror_drive.MirrorDrive(registers)
        self.trigger = line_trigger.LineTrigger(registers, count_width)
        self.clock = 0
        self.angle_valid = False
        self.angle_line = 0
        self.amplitude = 0

        self._scanned = registers
        self._dark = False  # the pulse began outside of what is scanned
        self._centre_outside = self._scan_outside = False
        self._drive_phase = registers.drive_phase
        self._base = self._motion(registers)
        # The harmonics in use, a_k and phi_k; the clock and the offset of those being computed.
        self._map: Map = (self._base[0], self._base[1])
        self._map_due = _NEVER
        self._known_from = _NEVER  # clock from which on motion_map knows an offset
        self._mapped = False
        self._taken: tuple[int, MirrorRegisters] | None = None  # when, and what comes into effect
        self._renewed_at = _NEVER  # clock behind which a renewal is over
        self._new_table = False
        self._offset = 0
        self._comparator = 0
        self._gate = 0
        self._enable = False
        self._line_enable = False
        # The present clock of each lane, and the clock of its next edge.
        self._mirror_clock = self._mirror_due = 0
        self._line_clock = self._line_due = 0
        # The centre's phase, then the angle being computed and the finished one.
        self._centre_halves = 0
        self._centre_phase: int | None = None
        self._scan: Turn = (0, 0, self._map)
        self._scan_end = _NEVER
        self._busy_until = -1
        self._angle_of = self._scan
        self._flags = 0
        self._confidence = 0
        # The data of the next report; the lines' angles are still phases and amplitudes.
        self._lines: list[tuple[int, ...]] = []
        self._turns: list[Turn] = []
        self._measurements: list[tuple[int, ...]] = []

    def run(
        self, until: int, samples: Rows, *, enable: bool = True, line_enable: bool = True
    ) -> Report:
        """Advance to a clock.

        Args:
            until: The clock at which to stop.
            samples: Rows of ``clock``, ``comparator`` and ``gate``, rising in time: from that clock
                on the two ports have these values. Rows before the present clock are ignored.
            enable: Port ``enable`` of the drive.
            line_enable: Port that enables the lines.
        """
        begin, end = np.searchsorted(samples["clock"], [self.clock, until])
        self._give(self._comparator, self._gate, enable, line_enable)
        columns = (samples[name][begin:end].tolist() for name in ("clock", "comparator", "gate"))
        for clock, comparator, gate in zip(*columns, strict=True):
            self._advance(clock)
            self._give(comparator, gate, enable, line_enable)
        self._advance(until)
        return self._report()

    def step(
        self,
        *,
        comparator: int = 0,
        gate: int = 0,
        enable: bool = False,
        line_enable: bool = False,
        take: MirrorRegisters | None = None,
    ) -> None:
        """Advance by one clock; ``take`` is what takes effect with ``take_i``: motion and table.

        The angle of a line whose centre came before ``renewing`` has ended is not that of the RTL.
        """
        self._give(comparator, gate, enable, line_enable)
        if take is not None:
            self._taken = self.clock, take
            table = list(take.table_amplitude), list(take.table_midpoint)
            if table != (self.phase.table_amplitude, self.phase.table_midpoint):
                self._sync_mirror()
                self._new_table, self._mirror_due = True, self.clock
        clock = self.clock
        if self._taken and clock == self._taken[0] + TAKE_CLKS - 1:
            self._scanned = self._taken[1]
        if self._taken and clock == self._taken[0] + TAKE_CLKS and not self._mapped:
            self._map = self._motion(self._taken[1])[:2]
        self._advance(clock + 1)
        if self._new_table:
            self._new_table = False
            assert take is not None
            self.phase.table_amplitude[:] = take.table_amplitude
            self.phase.table_midpoint[:] = take.table_midpoint
        if self._taken and clock == self._taken[0] + TAKE_CLKS:
            self._commit_map(clock)
            self._drive_phase = self._taken[1].drive_phase
            self._base = self._motion(self._taken[1])
            self._taken = None
            if clock >= self._known_from:
                self._map_due = self._renewed_at = clock + MAP_LATENCY - 1

    @staticmethod
    def _motion(registers: MirrorRegisters) -> tuple[Ints, Ints, Ints, Ints]:
        a, phi, da, dphi = (
            np.array(getattr(registers, f"motion_{name}"), np.int64)
            for name in ("a", "phi", "da", "dphi")
        )
        return a, phi, da, dphi

    def _renewing(self) -> bool:
        """Return whether the harmonics are not yet those of the configuration that was taken."""
        return self._taken is not None or self.clock <= self._renewed_at < _NEVER

    def ports(self) -> dict[str, int]:
        """Return all outputs of this clock, by the names of the ports without ``_o``.

        What belongs to ``angle_valid`` is defined only with it.
        """
        self._sync_mirror()
        self._sync_line()
        angle, saturated = 0, 0
        if self.angle_valid:
            angle, saturated = (int(column[0]) for column in self._angles([self._angle_of]))
        values = {
            **{name: getattr(self.drive, name) for name in _OF_DRIVE},
            **{name: getattr(self.trigger, name) for name in _OF_TRIGGER},
            **{name: getattr(self.capture, name) for name in _OF_CAPTURE},
            "laser": self.trigger.laser and not self._dark,
            "drive_phase": self.drive.phase,
            "mirror_phase": self.phase.phase,
            "index_alive": self.capture.alive,
            "settled": self.control.settled,
            "measured": self.phase.measured,
            "error": self.phase.error,
            "angle_valid": self.angle_valid,
            "angle_line": self.angle_line,
            "angle": angle,
            "mirror_flags": self._flags | saturated,
            "confidence": self._confidence,
            "renewing": self._renewing(),
        }
        return {name: int(value) for name, value in values.items()}

    def _give(self, comparator: int, gate: int, enable: bool, line_enable: bool) -> None:
        """Set the inputs of this clock."""
        given = (comparator, gate, enable)
        if given != (self._comparator, self._gate, self._enable):
            self._sync_mirror()
            self._mirror_due = self.clock
            self._comparator, self._gate, self._enable = given
        if line_enable != self._line_enable:
            self._sync_line()
            self._line_due = self.clock
            self._line_enable = line_enable

    def _advance(self, until: int) -> None:
        """Advance to a clock with the present inputs."""
        trigger = self.trigger
        drive = self.drive
        clock = self.clock
        while clock < until:
            self.clock = clock
            tail = (
                trigger.centre
                or self._centre_phase is not None
                or self.angle_valid
                or clock == self._scan_end
            )
            at_line = clock >= self._line_due
            at_mirror = clock >= self._mirror_due
            # Consumers are stepped before their sources, so each sees the outputs of this clock.
            if tail or at_mirror or (at_line and trigger.samples):
                self._sync_mirror()
            if tail:
                self._step_tail()
            if at_line:
                enable = self._line_enable
                trigger.skip(clock - self._line_clock, enable=enable, word=drive.word)
                before = trigger.laser
                trigger.step(enable=enable, word=drive.word)
                if trigger.laser and not before:
                    self._sync_mirror()
                    self._dark = self._outside()
                self._line_clock = clock + 1
                self._line_due = clock + 1 + trigger.idle(enable=enable, word=drive.word)
            if at_mirror:
                self._step_mirror()
            if self._centre_phase is not None or self.angle_valid:
                clock += 1
            else:
                clock = min(until, self._line_due, self._mirror_due, self._scan_end)
        self.clock = until

    def _step_tail(self) -> None:
        """Advance the parts behind the centre of a line by one clock."""
        clock = self.clock
        control = self.control
        drive = self.drive
        if self.angle_valid:
            self._lines.append(
                (
                    self.angle_line, self._centre_halves, clock, drive.state, self._flags,
                    self._confidence, 0, self.amplitude, drive.word, drive.level,
                )
            )  # fmt: skip
            self._turns.append(self._angle_of)
        self.angle_valid = clock == self._scan_end
        if self.angle_valid:
            self._scan_end = _NEVER
            self._angle_of = self._scan
            self._flags = (
                (drive.state != pkg.MIRROR_RUN)
                | (_INDEX_FAULT if control.index_fault else 0)
                | (_UNSETTLED if control.unsettled or self._scan_outside else 0)
            )
            self._confidence = control.confidence
        if self._centre_phase is not None:
            # A centre that comes before the last one's angle replaces it.
            self._commit_map(clock - 1)
            self._scan = (self._centre_phase, self.phase.amplitude, self._map)
            self._scan_end = self._busy_until = clock + SCAN_LATENCY
            self.amplitude = self.phase.amplitude
            self._scan_outside = self._centre_outside
            self._centre_phase = None
        if self.trigger.centre:
            half = self.trigger.centre_half
            self._centre_halves = 2 * clock + half
            # To nearest, half up; half a clock is half an increment.
            phase = self.phase.phase + (self.phase.increment >> 1 if half else 0)
            phase = (phase & _TURN_MASK) >> self._scanned.scan_facet
            self._centre_phase = ((phase >> (_PHASE_DROP - 1)) + 1 >> 1) & _PHASE_MASK
            self._centre_outside = self._outside()
            self.angle_line = self.trigger.line

    def _outside(self) -> bool:
        """Return whether the mirror is outside of the part of a turn that is scanned."""
        since = (self.phase.phase >> (pkg.TURN_WIDTH - 16)) - self._scanned.scan_begin
        return since % (1 << 16) > self._scanned.scan_span

    def _step_mirror(self) -> None:
        """Advance all parts but the lines by one clock, then find the next edge."""
        capture, phase, control, drive = self.capture, self.phase, self.control, self.drive
        word, state = drive.word, drive.state
        broken = capture.missing or capture.doubled or capture.impossible
        drive.step(
            enable=self._enable,
            trim=control.trim,
            level=control.level,
            index_alive=capture.alive,
            settled=control.settled,
        )
        control.step(
            state=state,
            valid=phase.valid,
            measured=phase.measured,
            error=phase.error,
            acquired=phase.acquired,
            broken=broken,
        )
        phase.step(
            valid=capture.valid,
            outward=capture.outward,
            age=capture.age,
            broken=broken,
            word=word,
            renew=self._new_table,
        )
        capture.step(self._comparator, self._gate)
        self._mirror_clock = self.clock + 1
        if phase.valid:
            self._commit_map(self._mirror_clock + 1)
            self._offset = (drive.phase - phase.phase) & _TURN_MASK
            self._map_due = self._mirror_clock + MAP_LATENCY
            self._known_from = min(self._known_from, self._mirror_clock + 2)
            if self._mirror_clock < self._renewed_at < _NEVER:
                self._renewed_at = self._map_due
            self._measurements.append(
                (
                    self._mirror_clock, phase.measured, phase.error, drive.level, drive.word,
                    phase.phase, drive.phase,
                )
            )  # fmt: skip
        self._mirror_due = self._mirror_clock + self._mirror_idle()

    def _commit_map(self, until: int) -> None:
        """Let motion_map change the harmonics if it does so in a clock up to ``until``.

        It waits while an angle is at work. Only the start of an angle, and of new harmonics, looks.
        """
        due = self._map_due
        if due <= self._busy_until and due != self._renewed_at:
            due = self._busy_until + 1
        if due <= until:
            a, phi, _ = motion_map(self._offset, self._drive_phase, *self._base)
            self._map = a, phi
            self._map_due, self._mapped = _NEVER, True

    def _follows(self) -> bool:
        """Return whether the phase follows a word that changes every few clocks."""
        return self.drive.state == pkg.MIRROR_SWEEP and not self.phase.tracking

    def _mirror_idle(self) -> int:
        capture, phase, control, drive = self.capture, self.phase, self.control, self.drive
        idle = capture.idle(self._comparator, self._gate)
        if idle:
            idle = min(idle, phase.idle(word=phase.increment if self._follows() else drive.word))
        if idle:
            idle = min(idle, control.idle(**self._of_control()))
        if idle:
            idle = min(idle, drive.idle(**self._of_drive()))
        return idle

    def _of_control(self) -> dict[str, Any]:
        """Return the inputs of amplitude_control in a clock without a strobe."""
        phase = self.phase
        return {
            "state": self.drive.state,
            "valid": phase.valid,
            "measured": phase.measured,
            "error": phase.error,
            "acquired": phase.acquired,
            "broken": False,
        }

    def _of_drive(self) -> dict[str, Any]:
        """Return the inputs of mirror_drive."""
        return {
            "enable": self._enable,
            "trim": self.control.trim,
            "level": self.control.level,
            "index_alive": self.capture.alive,
            "settled": self.control.settled,
        }

    def _sync_mirror(self) -> None:
        """Skip the idle clocks of the mirror's lane up to this clock."""
        clocks = self.clock - self._mirror_clock
        if not clocks:
            return
        self._mirror_clock = self.clock
        drive, phase = self.drive, self.phase
        given = self._of_drive()
        if self._follows():
            # The increment is the word of the previous clock.
            advance = phase.increment - drive.phase
            drive.skip(clocks - 1, **given)
            phase.follow(clocks, advance=advance + drive.phase, word=drive.word)
            drive.skip(1, **given)
        else:
            drive.skip(clocks, **given)
            phase.skip(clocks, word=drive.word)
        self.control.skip(clocks, **self._of_control())
        self.capture.skip(clocks, self._comparator, self._gate)

    def _sync_line(self) -> None:
        """Skip the idle clocks of the lines' lane up to this clock."""
        clocks = self.clock - self._line_clock
        self._line_clock = self.clock
        self.trigger.skip(clocks, enable=self._line_enable, word=self.drive.word)

    @staticmethod
    def _angles(turns: list[Turn]) -> tuple[Ints, Ints]:
        """Return the angles of phases and amplitudes, and the flags of those that saturate."""
        shape = -1, pkg.HARMONIC_COUNT
        phase, amplitude = (np.array([turn[k] for turn in turns], np.int64) for k in (0, 1))
        a, phi = (np.array([turn[2][k] for turn in turns], np.int64).reshape(shape) for k in (0, 1))
        angle, overflow = scan_angle(phase, amplitude, a, phi)
        return angle, overflow * np.int64(_UNSETTLED)

    def _report(self) -> Report:
        """Return the data since the last report, with all angles computed at once."""
        lines = np.array(self._lines, LINE)
        lines["angle"], saturated = self._angles(self._turns)
        lines["flags"] |= saturated
        measurements = np.array(self._measurements, MEASUREMENT)
        self._lines, self._turns, self._measurements = [], [], []
        return Report(lines, measurements)
