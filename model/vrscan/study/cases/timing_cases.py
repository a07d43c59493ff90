"""Counters and phases that wrap, and queues that are never emptied."""

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np

from vrscan.clocked.mirror_phase import MirrorPhase
from vrscan.clocked.point_packer import SPACING, PointPacker
from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.records import FULL
from vrscan.fixed.scan_angle import error_bound_turns, scan_angle
from vrscan.ideal.motion import motion
from vrscan.link.protocol import Batch
from vrscan.link.protocol import points as parse_points
from vrscan.registers.chain_registers import angle_turns
from vrscan.registers.settings import PhaseSettings
from vrscan.study.cases.case import Case, ModuleCase, Outcome
from vrscan.study.cases.case_errors import number

LINE_END = 1 << pkg.LINE_NUMBER_WIDTH
PHASE_TURN = 1 << pkg.PHASE_WIDTH
DAYS_30 = 30 * 86_400


def _phase_wrap() -> Outcome:
    """Return the outcome of a word that takes a line of 3342 clocks across the end of the turn."""
    twin = MirrorPhase(
        PhaseSettings(error_limit=1 << 20, phase_shift=3, rate_shift=29, amplitude_shift=3)
    )
    config = Config()
    turn, clock_hz = 1 << pkg.TURN_WIDTH, config.clock.frequency_hz
    word = round(config.mirror.frequency_hz / clock_hz * turn)
    twin.step(word=word)
    clocks = round(DAYS_30 * clock_hz)
    clocks += -clocks * word % turn // word - 1000  # the turn ends within the next line
    twin.skip(clocks, word=word)
    wrong = []
    before, wraps = twin.phase, 0
    for k in range(3342):
        twin.step(word=word)
        wraps += twin.phase < before
        before = twin.phase
        if twin.phase != (clocks + k + 1) * word % turn:
            wrong.append(f"phase {twin.phase} after {clocks + k + 1} clocks")
            break
    if wraps != 1:
        wrong.append(f"{wraps} wraps in the line, want one")
    exact = Fraction((clocks + 3342) * word, turn) % 1
    seconds = (clocks + 3342) / clock_hz
    naive = 2.0 * math.pi * (word / turn * clock_hz) * seconds / (2.0 * math.pi) % 1.0
    off = abs(float(exact) - naive)
    return Outcome(
        "none", "0 urad", number(min(off, 1 - off) * 2e6 * math.pi, "urad"), tuple(wrong)
    )


def _angle_over_wrap() -> Outcome:
    phase = np.arange(-200, 201) % PHASE_TURN
    pairs = np.array(Config().mirror.harmonics)
    size = math.radians(Config().mirror.amplitude_deg) / (2.0 * math.pi)
    amplitude = round(size * 2**pkg.AMPLITUDE_FRACTION)
    a = np.rint(pairs[:, 0] * 2.0**pkg.MOTION_FRACTION).astype(np.int64)
    phi = np.rint(pairs[:, 1] / (2.0 * math.pi) * PHASE_TURN).astype(np.int64) % PHASE_TURN
    got, over = scan_angle(phase, amplitude, a, phi)
    given = np.stack([a * 2.0**-pkg.MOTION_FRACTION, phi * (2.0 * math.pi / PHASE_TURN)], axis=-1)
    turns = amplitude * 2.0**-pkg.AMPLITUDE_FRACTION
    want = motion(phase / PHASE_TURN, turns, given)
    off = np.abs(got * 2.0**-pkg.ANGLE_WIDTH - want)
    bound = float(error_bound_turns(np.array(turns), given[:, 0]))
    wrong = [f"phase {phase[k]}: off by {off[k]} turns" for k in np.flatnonzero(off > bound)]
    wrong += ["overflow"] if over.any() else []
    wrong += ["a jump"] if np.abs(np.diff(got)).max() > 1 else []
    # (12) as printed takes 2 pi f0 t, which after 30 days is many turns.
    whole = round(DAYS_30 * Config().mirror.frequency_hz)
    place = phase / PHASE_TURN
    naive = [
        turns * sum(
            size * math.cos((2 * k + 1) * 2.0 * math.pi * (whole + p) - late)
            for k, (size, late) in enumerate(given.tolist())
        )
        for p in place.tolist()
    ]  # fmt: skip
    urad = 2e6 * math.pi
    there = float(np.abs(np.array(naive) - want).max()) * urad
    return Outcome(
        "none", number(float(off.max()) * urad, "urad"), number(there, "urad"), tuple(wrong)
    )


def _half_turn() -> Outcome:
    given = np.array([-np.pi, np.pi, np.nextafter(np.pi, 0), 0.0])
    got = angle_turns(given)
    half = 1 << (pkg.ANGLE_WIDTH - 1)
    wrong = [] if got.tolist() == [-half, -half, -half, 0] else [f"angles {got.tolist()}"]
    whole = 2.0 * half
    off = np.abs((got - given / np.pi * half + half) % whole - half).max() / whole * 2e6 * np.pi
    # (3) uses its tangent, which is that of 0.
    naive = abs(math.atan(math.tan(math.pi)) - math.pi)
    return Outcome("none", number(float(off), "urad"), number(naive, "rad"), tuple(wrong))


def _records(lines: Sequence[int]) -> list[bytes]:
    records = np.zeros(len(lines), FULL)
    records["line"] = [line % LINE_END for line in lines]
    return [record.tobytes() for record in records]


class _Link:
    """A packer with a reader, which may stop reading."""

    def __init__(self, buffer_bytes: int, batch: int) -> None:
        self.packer = PointPacker(buffer_bytes)
        self.batch = batch
        self.bytes = bytearray()
        self.batches: list[Batch] = []

    def clocks(
        self, count: int, ready: bool, record: bytes = b"", start: bool = False, stop: bool = False
    ) -> None:
        """Advance by some clocks; in the first of them a record begins or a command comes."""
        packer = self.packer
        for k in range(count):
            if packer.valid and ready:
                self.bytes.append(packer.data)
                if packer.last:
                    self.batches.append(parse_points(bytes(self.bytes)))
                    self.bytes.clear()
            here = k < len(record)
            packer.step(
                here, k if here else 0, record[k] if here else 0, ready,
                start and k == 0, stop and k == 0, True, 1, self.batch, 0,
            )  # fmt: skip


def _sequence_wrap() -> Outcome:
    count = 260
    link = _Link(4096, 1)
    link.clocks(5, True, start=True)
    first = LINE_END - 100
    for record in _records([first + k for k in range(count)]):
        link.clocks(SPACING, True, record)
    link.clocks(600, True, stop=True)
    wrong = []
    if [b.sequence for b in link.batches] != [k % 256 for k in range(count)]:
        wrong.append("sequence numbers")
    if [b.first for b in link.batches] != [(first + k) % LINE_END for k in range(count)]:
        wrong.append("line numbers")
    lost = sum((b.sequence - k) % 256 for k, b in enumerate(link.batches))
    lost += sum(batch.dropped for batch in link.batches)
    numbers = [float(b.sequence) for b in link.batches]
    naive = max(abs(b - a - 1.0) for a, b in pairwise(numbers))
    return Outcome("none", number(lost, "packets"), number(naive, "packets"), tuple(wrong))


def _line_wrap() -> Outcome:
    link = _Link(4096, 3)
    link.clocks(5, True, start=True)
    for record in _records([LINE_END - 1, LINE_END, LINE_END + 1, LINE_END + 2]):
        link.clocks(SPACING, True, record)
    link.clocks(600, True, stop=True)
    got = [(b.first, len(b.records)) for b in link.batches]
    # There is one batch across the wrap, because a gap in the numbers would have closed it.
    wrong = [] if got == [(LINE_END - 1, 3), (2, 1)] else [f"batches {got}"]
    lines = [float(line) for b in link.batches for line in b.records["line"]]
    naive = abs(lines[1] - lines[0] - 1.0)
    return Outcome("none", "0 lines", f"{naive:.0f} lines", tuple(wrong))


def _full_for_long() -> Outcome:
    count = 300
    link = _Link(512, 1)
    link.clocks(5, False, start=True)
    records = _records(range(count + 1))
    for record in records[:-1]:
        link.clocks(SPACING, False, record)
    dropped = link.packer.points_dropped
    link.clocks(3000, True)
    link.clocks(SPACING, True, records[-1])
    link.clocks(600, True, stop=True)
    kept = sum(len(b.records) for b in link.batches)
    last = link.batches[-1]
    wrong = []
    if kept + dropped != count + 1:
        wrong.append(f"{kept} kept and {dropped} dropped of {count + 1}")
    if last.dropped != dropped or int(last.records["lost"][0]) != dropped:
        wrong.append(f"the next packet tells of {last.dropped}, not {dropped}")
    flagged = int(last.records["flags"][0]) >> pkg.FLAG_POINTS_LOST & 1
    if not flagged or any(int(b.records["flags"][0]) for b in link.batches[:-1]):
        wrong.append("POINTS_LOST")
    # Losses without a report, and losses that a queue without counters would not report.
    silent = count + 1 - kept - last.dropped
    return Outcome(
        "POINTS_LOST", number(silent, "points untold"), f"{dropped} points untold", tuple(wrong)
    )


def cases() -> Iterator[Case]:
    """Return the entries of this module."""
    yield ModuleCase(
        "phase-wraps-in-a-line",
        "after 30 days the mirror's phase passes a whole turn in mid-line",
        "an accumulator modulo 2^48: the phase of n clocks is n words, exactly, for ever",
        _phase_wrap,
        (
            "test_mirror_phase.py::random_crossings",
            "test_mirror_phase.py::test_mirror_phase_model_skip_is_many_steps",
            "test_line_trigger.py::a_ratio_of_150_keeps_its_phases",
        ),
    )
    yield ModuleCase(
        "scan-angle-across-the-wrap",
        "phases from 200 steps before a whole turn to 200 after it; (12) as printed: after 30 days",
        "one step of the angle at most from one phase to the next; (12) within its bound",
        _angle_over_wrap,
        ("test_scan_angle.py::any_motion_back_to_back",),
    )
    yield ModuleCase(
        "angle-of-half-a-turn",
        "pi has no place in 24 signed bits",
        "it wraps to minus half a turn, which is the same direction; (3) takes it for 0",
        _half_turn,
        (
            "test_chain_registers.py::test_angles_are_turns_and_wrap_at_half_a_turn",
            "test_triangulate.py::any_point_back_to_back",
        ),
    )
    yield ModuleCase(
        "line-number-wraps",
        "line 2^32 - 1 is followed by line 0",
        "no gap: the batch goes on",
        _line_wrap,
        (
            "test_line_capture.py::line_numbers_wrap",
            "test_point_packer.py::every_step_takes_its_lines_and_a_gap_closes_the_batch",
        ),
    )
    yield ModuleCase(
        "sequence-number-wraps",
        "packet 255 is followed by packet 0",
        "counted modulo 256: no packet is missed",
        _sequence_wrap,
        ("test_point_packer.py::sequence_numbers_wrap",),
    )
    yield ModuleCase(
        "points-fifo-full-for-long",
        "300 points and nobody reads",
        "what has no room is dropped and counted; the next point has POINTS_LOST and the number, "
        "and kept + dropped is all",
        _full_for_long,
        (
            "test_point_packer.py::stalled_reader_drops_records_and_says_so",
            "test_point_packer.py::counts_of_dropped_records_wrap_or_stop",
            "test_vrscan_chain.py::consumer_that_waits",
            "test_triangulate.py::drops_are_told",
        ),
    )
