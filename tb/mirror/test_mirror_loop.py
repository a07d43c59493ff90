"""mirror_loop: every clock of the wiring against the twin, with the index of a made-up mirror."""

import dataclasses
import itertools
import pickle
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    UnitBench,
    as_integer,
    generator,
    parameters,
    port,
    rounds,
    simulate,
    struct_ports,
)

from vrscan.clocked.mirror_loop import ANGLE_LATENCY, LINE, MEASUREMENT, MirrorLoop
from vrscan.clocked.mirror_phase import TABLE_SIZE
from vrscan.data import pkg
from vrscan.data.config import STRAIGHT, Mirror
from vrscan.engines.mirror_engine import LINE as ENGINE_LINE
from vrscan.engines.mirror_engine import MEASUREMENT as ENGINE_MEASUREMENT
from vrscan.engines.mirror_engine import SAMPLES
from vrscan.fixed.motion_map import LATENCY as MAP_LATENCY
from vrscan.registers.mirror_registers import MirrorRegisters

ELABORATIONS = [
    {"IndexOversample": 4, "CountWidth": 16},
    {"IndexOversample": 8, "CountWidth": 2},
]
PERIOD_CLKS = 1200  # of the made-up mirror
MARK_TURNS, WIDTH_TURNS, AMPLITUDE_TURNS = 0.04, 0.005, 0.05
OFF, SWEEP, SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
RUN, FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT
NOT_RUNNING, INDEX_FAULT, UNSETTLED = (
    1 << bit - pkg.FLAG_NOT_RUNNING
    for bit in (pkg.FLAG_NOT_RUNNING, pkg.FLAG_INDEX_FAULT, pkg.FLAG_UNSETTLED)
)
SIGNED = {"angle", "error"}
WITH_ANGLE = ("angle_line", "angle", "mirror_flags", "confidence")
CONTROL = {  # inputs of a clock, and their ports
    "comparator": "comparator_i",
    "gate": "gate_i",
    "enable": "mirror_enable_i",
    "line_enable": "line_enable_i",
}
WHOLE = {"scan_facet": 0, "scan_span": 65_535}  # a resonant mirror, all of whose turn is scanned
GROUPS = ("mirror_i", "mirror_limits_i", "motion_i", "line_i")
STATUS = {  # fields of the status by the names of the twin, where they are others
    "mirror_state": "state",
    "mirror_fault": "fault",
    "mirror_word": "word",
    "mirror_drive_phase": "drive_phase",
    "mirror_settled": "settled",
    "mirror_measured": "measured",
    "mirror_error": "error",
}


def amplitude(turns: float) -> int:
    """Return an amplitude or a middle as the ports have it."""
    return round(turns * 2**pkg.AMPLITUDE_FRACTION)


def registers(draw: np.random.Generator, **changes: Any) -> MirrorRegisters:
    """Return a configuration with which everything happens within some periods."""
    word = round(2**pkg.TURN_WIDTH / PERIOD_CLKS)
    line_clks = int(draw.choice([ANGLE_LATENCY - 3, ANGLE_LATENCY + 4, 2 * ANGLE_LATENCY + 9]))
    pulse_clks = int(draw.integers(0, 60))
    shock = amplitude(0.05 * AMPLITUDE_TURNS)
    h = np.arange(TABLE_SIZE) / (4.0 * TABLE_SIZE)
    table = np.minimum(
        np.round(MARK_TURNS / np.cos(2.0 * np.pi * h) * 2.0**pkg.AMPLITUDE_FRACTION),
        (1 << pkg.AMPLITUDE_WIDTH) - 1,
    )
    motion = draw.integers(-9000, 9000, pkg.HARMONIC_COUNT)
    motion[0] = (1 << pkg.MOTION_FRACTION) * int(draw.choice([1, 1, 1, -1]))
    if draw.random() < 0.2:
        motion[:] = (1 << (pkg.MOTION_WIDTH - 1)) - 1  # an angle that does not fit
    slope = 1 << (pkg.SLOPE_MOTION_WIDTH - 2)
    values: dict[str, Any] = {
        "clock_hz": 1.0,
        "oversample": 4,
        "sweep_word": word + 40_000_000,
        "work_word": word,
        "sweep_rate": (1 << 32) - 1 - int(draw.integers(1 << 30)),
        "duty": int(draw.integers(1 << 14, 1 << 16)),
        "sweep_level": int(draw.integers(1, 1 << pkg.LEVEL_WIDTH)),
        "sweep_timeout": 1 << 30,
        "settle_timeout": 20 * PERIOD_CLKS,
        "lost_timeout": 3 * PERIOD_CLKS,
        "glitch_clks": int(draw.integers(1, 4)),
        "width_min_clks": 70,
        "width_max_clks": 500,
        "period_max_clks": PERIOD_CLKS * 9 // 8,
        "phase_shift": 1,
        "rate_shift": 14,
        "amplitude_shift": int(draw.integers(3)),
        "error_limit": 1 << 22,
        "amplitude_set": amplitude(AMPLITUDE_TURNS),
        "k_p": int(draw.integers(1 << 13)),
        "k_i": int(draw.integers(1 << 17)),
        "level_min": 300_000,
        "level_low": 690_000,
        "level_nominal": 700_000,
        "level_high": 710_000,
        "level_max": 1_000_000,
        "trim_step": int(draw.integers(1 << 20)),
        "trim_gain": int(draw.integers(1 << 12)),
        "trim_min": -int(draw.integers(1 << 31)),
        "trim_max": int(draw.integers(1 << 31)),
        "trim_up": int(draw.integers(2)),
        "settle_limit": shock // 2,
        "shock_limit": shock,
        "phase_limit": 1 << 21,
        "settle_count": int(draw.integers(1, 3)),
        "hold_count": int(draw.integers(1, 3)),
        "confidence_gain": round(255 / shock * 2**20),
        "ratio": round(PERIOD_CLKS / line_clks * 2**pkg.RATIO_FRACTION),
        "exposure_delay_clks": int(draw.integers(10)),
        "exposure_clks": int(draw.integers(10, line_clks * 3 // 2)),
        "pulse_delay_clks": int(draw.integers(30)),
        "pulse_clks": pulse_clks,
        "drive_phase": int(draw.integers(1 << pkg.PHASE_WIDTH)),
        "motion_a": motion.tolist(),
        "motion_phi": draw.integers(1 << pkg.PHASE_WIDTH, size=pkg.HARMONIC_COUNT).tolist(),
        "motion_da": draw.integers(-slope, slope, pkg.HARMONIC_COUNT).tolist(),
        "motion_dphi": draw.integers(-slope, slope, pkg.HARMONIC_COUNT).tolist(),
        "scan_facet": int(draw.random() < 0.3),
        "scan_begin": int(draw.integers(1 << 16)),
        "scan_span": int(draw.choice([WHOLE["scan_span"], 30_000])),
        "table_amplitude": table.astype(int).tolist(),
        "table_midpoint": draw.integers(-2000, 2000, TABLE_SIZE).tolist(),
    }
    return MirrorRegisters(**values | changes)


def index(
    draw: np.random.Generator,
    clocks: int,
    oversample: int,
    *,
    start: float | None = None,
    quiet: bool = False,
) -> tuple[list[int], list[int]]:
    """Return comparator and gate, a word a clock, of a cosine that is disturbed in its second half.

    It is at ``start`` turns at the first sample's time; ``quiet`` leaves the disturbances out.
    """
    time = np.arange(clocks * oversample) / oversample
    turns = time / PERIOD_CLKS + (draw.random() if start is None else start)
    size = np.full(time.shape, AMPLITUDE_TURNS)
    passes = np.floor(turns + 0.5).astype(int)
    count = int(passes[-1]) + 1
    kind = np.zeros(count, int)
    if not quiet:
        disturbed = np.arange((count + 1) // 2, count)
        kind[disturbed] = np.resize(1 + draw.permutation(6), disturbed.size)
    for k in np.flatnonzero(kind == 1):  # a shock, and what it leaves for some periods
        size[(passes >= k) & (passes < k + 3)] *= 1.0 + draw.uniform(-0.2, 0.2)
    angle = size * np.cos(2.0 * np.pi * turns)
    gate = np.abs(angle - MARK_TURNS) < WIDTH_TURNS
    beyond = angle > MARK_TURNS
    of = kind[passes]
    gate &= of != 2  # lost
    gate = np.where(of == 3, np.cos(time / 20.0) > 0.0, gate)  # one outward after the other
    beyond = np.where(of == 3, np.sin(time / 20.0) > 0.0, beyond)
    beyond ^= (of == 4) & (draw.random(time.shape) < 0.02)  # chatter
    gate |= of == 5  # edges too close together
    beyond ^= (of == 5) & (np.sin(time / 9.0) > 0.0)
    beyond &= of != 6  # a dead comparator
    meaningless = np.sin(time / 170.0) > 0.0
    beyond = np.where(gate, beyond, meaningless)
    weights = 1 << np.arange(oversample)
    comparator, opened = (
        bits.reshape(clocks, oversample).astype(int) @ weights for bits in (beyond, gate)
    )
    return comparator.tolist(), opened.tolist()


def switched(draw: np.random.Generator, clocks: int, on: float, off: float) -> list[bool]:
    """Return an input that is on and off for random times around the given ones."""
    parts, total, level = [], 0, True
    while total < clocks:
        parts.append(np.full(1 + int(draw.exponential(on if level else off)), level))
        total += len(parts[-1])
        level = not level
    return np.concatenate(parts)[:clocks].tolist()


class Bench(UnitBench):
    """Drives the RTL and its twin with the same inputs and compares every output every clock."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.inputs = {name: port(dut, place) for name, place in CONTROL.items()}
        status = struct_ports(dut)["mirror_status_o"]
        outputs = [h for h in dut if h._name.endswith("_o") and h._name != "mirror_status_o"]
        self.outputs = {h._name[:-2]: h for h in outputs}
        self.outputs |= {STATUS.get(n, n): port(dut, f"{n}_o") for n in status.struct.fields}
        self.given: dict[str, int] = {}
        self.seen: set[tuple[str, int]] = set()
        self.angles = self.measurements = 0
        self.taken: int | None = None  # clock of the last take
        self.bank = 0
        self.old_until = -1  # angles of centres up to here are of the configuration before

    async def start(self, given: MirrorRegisters) -> None:
        """Set the configuration, write the table, and end a reset."""
        dut = self.dut
        dut.rst_i.value = 1
        for name in GROUPS:
            struct_ports(dut)[name].give(given)
        self.given.clear()
        self.bank, self.taken, self.old_until = 0, None, -1
        table = struct_ports(dut)["table_i"]
        for k, (turns, middle) in enumerate(
            zip(given.table_amplitude, given.table_midpoint, strict=True)
        ):
            table.give(
                {
                    "table_write": 1,
                    "table_index": k,
                    "table_amplitude": turns,
                    "table_midpoint": middle,
                }
            )
            await FallingEdge(dut.clk_i)
        table.give({})
        await self.restart(given)

    async def restart(self, given: MirrorRegisters) -> None:
        """Reset for a clock."""
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        widths = parameters()
        self.twin = MirrorLoop(given, widths["IndexOversample"], widths["CountWidth"])
        self.check()

    async def clock(self, *inputs: int) -> None:
        """Go on by a clock with the inputs of ``CONTROL``."""
        for name, value in zip(CONTROL, inputs, strict=True):
            if self.given.get(name) != value:
                self.inputs[name].value = value
                self.given[name] = value
        await FallingEdge(self.dut.clk_i)
        self.twin.step(**self.given)
        self.check()

    async def take(self, given: MirrorRegisters, *inputs: int) -> None:
        """Go on by a clock in which another motion, and another table, take effect."""
        self.dut.take_i.value = 1
        changed = list(given.table_amplitude) != self.twin.phase.table_amplitude
        table = struct_ports(self.dut)["table_i"]
        table.give({"table_changed": int(changed), "table_bank": self.bank})
        self.twin.step, step = lambda **now: step(**now, take=given), self.twin.step
        await self.clock(*inputs)
        self.twin.step = step
        self.dut.take_i.value = 0
        self.bank ^= changed
        table.give({"table_bank": self.bank})
        self.taken = self.twin.clock - 1
        self.coming = given

    async def copy(
        self,
        given: MirrorRegisters,
        inputs: Iterator[Sequence[int]],
        look: Callable[[], None],
    ) -> None:
        """Write the bank that is not in use, and look in every clock."""
        table = struct_ports(self.dut)["table_i"]
        for k, entry in enumerate(zip(given.table_amplitude, given.table_midpoint, strict=True)):
            place = {"table_write": 1, "table_index": k, "table_write_bank": 1 - self.bank}
            named = dict(zip(("table_amplitude", "table_midpoint"), entry, strict=True))
            table.give({**place, **named, "table_bank": self.bank})
            await self.clock(*next(inputs))
            look()
        table.give({"table_bank": self.bank})

    def check(self) -> None:
        """Compare all that is defined."""
        if self.taken is not None and self.twin.clock == self.taken + 2:
            struct_ports(self.dut)["motion_i"].give(self.coming)
        want = self.twin.ports()
        if want["renewing"]:
            self.old_until = self.twin.clock
        old = self.twin.clock - ANGLE_LATENCY <= self.old_until
        if want["angle_valid"] and old:  # nobody takes it
            del want["angle"], want["mirror_flags"]
            want = want | {"angle": as_integer(self.outputs["angle"], signed=True)}
            want["mirror_flags"] = as_integer(self.outputs["mirror_flags"], signed=False)
        want["mirror_level"] = want["level"]
        assert want.keys() == self.outputs.keys()
        if not want["angle_valid"]:
            for name in WITH_ANGLE:
                del want[name]
        for name, value in want.items():
            got = as_integer(self.outputs[name], signed=name in SIGNED)
            assert got == value, (
                f"clock {self.twin.clock}: {name} is {got}, want {value}; inputs {self.given}"
            )
        self.seen.add(("fault", want["fault"]))
        self.seen |= {(name, want[name] > 0) for name in want if name.endswith("_count")}
        self.seen.add(("half", bool(want["centre"] and want["centre_half"])))
        self.measurements += self.twin.phase.valid
        if want["angle_valid"]:
            self.angles += 1
            self.seen.add(("sure", want["confidence"] > 0))
            for bit in (NOT_RUNNING, INDEX_FAULT, UNSETTLED):
                self.seen.add(("flag" if want["mirror_flags"] & bit else "clear", bit))


@cocotb.test()
async def random_inputs_and_resets(dut) -> None:
    """Starts, stops, shocks, lost and false passes, and a reset in every state."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    resets = set()
    quick = [{}, {"sweep_timeout": 300}, {"settle_timeout": 300}, {"lost_timeout": 10}]
    for episode in range(rounds(8, 40)):
        clocks = int(draw.integers(4000, 9000)) if episode else 4 * PERIOD_CLKS
        given = registers(draw, **quick[episode % len(quick)])
        samples = index(draw, clocks, parameters()["IndexOversample"], quiet=episode == 0)
        enable = switched(draw, clocks, 9000 << episode % 4, 100)
        line_enable = switched(draw, clocks, 3000, 300)
        await bench.start(given)
        for row in zip(*samples, enable, line_enable, strict=True):
            await bench.clock(*row)
        for on in (True, False, True):
            resets.add(bench.twin.drive.state)
            await bench.restart(given)
            for k in range(int(draw.integers(40))):
                await bench.clock(samples[0][k], samples[1][k], on, True)
    assert resets == {OFF, SWEEP, SETTLE, RUN, FAULT}
    events = ("doubled_count", "missing_count", "glitch_count", "impossible_count", "overrun_count")
    flags = (NOT_RUNNING, INDEX_FAULT, UNSETTLED)
    missed = {
        *itertools.product(["fault"], range(1 + pkg.FAULT_INDEX)),
        *itertools.product(events, [False, True]),
        *itertools.product(["flag", "clear"], flags),
        *itertools.product(["half", "sure"], [False, True]),
    } - bench.seen
    assert not missed
    print(f"{bench.angles} angles, {bench.measurements} measurements")


@cocotb.test()
async def a_reset_amid_an_angle_holds_no_harmonics_back(dut) -> None:
    """Those of the pairs that come before the next line are the next angle's."""
    draw = generator(7)
    bench = await Bench.fresh(dut)
    given = registers(draw)
    clocks = 4 * PERIOD_CLKS
    samples = index(draw, clocks, parameters()["IndexOversample"], quiet=True)
    await bench.start(given)
    while not bench.twin.trigger.centre:
        await bench.clock(0, 0, False, True)
    for _ in range(ANGLE_LATENCY // 2):
        await bench.clock(0, 0, False, True)
    await bench.restart(given)
    for k, row in enumerate(zip(*samples, strict=True)):
        await bench.clock(*row, True, k >= clocks // 2)
    assert bench.angles and bench.measurements > 2


@cocotb.test()
async def a_quiet_mirror_runs_without_flags(dut) -> None:
    """From OFF to RUN; then every line has an angle that is right, no flag and full confidence."""
    draw = generator(2)
    bench = await Bench.fresh(dut)
    motion = [1 << pkg.MOTION_FRACTION] + [0] * (pkg.HARMONIC_COUNT - 1)
    given = registers(
        draw,
        sweep_word=round(2**pkg.TURN_WIDTH / PERIOD_CLKS),
        pulse_clks=7,
        ratio=4 << pkg.RATIO_FRACTION,
        motion_a=motion,
        motion_phi=[0] * pkg.HARMONIC_COUNT,
        motion_da=[0] * pkg.HARMONIC_COUNT,
        motion_dphi=[0] * pkg.HARMONIC_COUNT,
        **WHOLE,
        table_midpoint=[0] * TABLE_SIZE,
    )
    start = float(draw.random())
    clocks = 14 * PERIOD_CLKS
    samples = index(draw, clocks, parameters()["IndexOversample"], start=start, quiet=True)
    await bench.start(given)
    good = 0
    centre = 0.0
    for row in zip(*samples, strict=True):
        await bench.clock(*row, True, True)
        twin = bench.twin
        if twin.angle_valid and twin.drive.state == RUN:
            port = twin.ports()
            assert port["mirror_flags"] == 0 and port["confidence"] >= 250
            want = AMPLITUDE_TURNS * np.cos(2.0 * np.pi * (start + centre / PERIOD_CLKS))
            assert port["angle"] / 2**pkg.ANGLE_WIDTH == pytest.approx(want, abs=3e-5)
            good += 1
        if twin.trigger.centre:
            centre = twin.clock + 0.5 * twin.trigger.centre_half
    assert good > 16


@cocotb.test()
async def another_motion_and_table_hold_from_a_clock_on(dut) -> None:
    """Angles are of the new motion at once, and of the new table, or UNSETTLED, from there on."""
    draw = generator(5)
    bench = await Bench.fresh(dut)
    plain = registers(
        draw,
        sweep_word=round(2**pkg.TURN_WIDTH / PERIOD_CLKS),
        pulse_clks=7,
        ratio=4 << pkg.RATIO_FRACTION,
        motion_a=[1 << pkg.MOTION_FRACTION] + [0] * (pkg.HARMONIC_COUNT - 1),
        motion_phi=[0] * pkg.HARMONIC_COUNT,
        motion_da=[0] * pkg.HARMONIC_COUNT,
        motion_dphi=[0] * pkg.HARMONIC_COUNT,
        **WHOLE,
        table_midpoint=[0] * TABLE_SIZE,
        settle_timeout=1 << 30,
    )
    start = float(draw.random())
    takes = rounds(8, 60)
    clocks = (14 + 8 * takes) * PERIOD_CLKS
    samples = index(draw, clocks, parameters()["IndexOversample"], start=start, quiet=True)
    inputs = iter([(*row, True, True) for row in zip(*samples, strict=True)])
    await bench.start(plain)
    scale, good, unsettled, centre, settled = 1.0, 0, 0, 0.0, 0

    async def run(count: int) -> None:
        nonlocal good, unsettled, centre, settled
        for _ in range(count):
            await bench.clock(*next(inputs))
            look()

    def look() -> None:
        nonlocal good, unsettled, centre
        twin = bench.twin
        if twin.angle_valid and twin.clock - ANGLE_LATENCY > bench.old_until:
            given = twin.ports()
            want = scale * AMPLITUDE_TURNS * np.cos(2 * np.pi * (start + centre / PERIOD_CLKS))
            if given["mirror_flags"]:
                unsettled += given["mirror_flags"] == UNSETTLED
            elif twin.drive.state == RUN:
                assert given["angle"] / 2**pkg.ANGLE_WIDTH == pytest.approx(want, abs=4e-5)
                good += 1
        if twin.trigger.centre:
            centre = twin.clock + 0.5 * twin.trigger.centre_half

    await run(10 * PERIOD_CLKS)
    size = 1.0
    for k in range(takes):
        motion = float(draw.uniform(0.5, 1.5))
        if k % 2 == 0:
            size = float(draw.uniform(0.985, 1.015))
        given = dataclasses.replace(
            plain,
            motion_a=[round(motion * (1 << pkg.MOTION_FRACTION)), *plain.motion_a[1:]],
            table_amplitude=[
                min(round(size * value), (1 << pkg.AMPLITUDE_WIDTH) - 1)
                for value in plain.table_amplitude
            ],
        )
        await bench.copy(given, inputs, look)
        await run(int(draw.integers(PERIOD_CLKS)))
        before = good, unsettled
        await bench.take(given, *next(inputs))
        look()
        scale = motion * size
        while bench.twin.ports()["renewing"]:
            await run(1)
        assert bench.twin.clock - bench.taken < 2 * MAP_LATENCY + 10  # an offset may come meanwhile
        await run(5 * PERIOD_CLKS)
        assert good > before[0] + 6
        # Without another table no angle is in doubt; with one those up to the next pair are.
        assert unsettled == before[1] or k % 2 == 0
    assert unsettled >= takes // 2


@cocotb.test()
async def a_polygon_scans_straight_between_its_starts(dut) -> None:
    """From pulses of the index alone; lines outside of the scanned part are dark and UNSETTLED."""
    draw = generator(6)
    bench = await Bench.fresh(dut)
    start, half, begin_turn, span_turns = 0.05, 0.04, 0.15, 0.7
    polygon = Mirror(kind="polygon")
    middle = round(start * 2**pkg.MIDPOINT_WIDTH)
    given = registers(
        draw,
        sweep_word=round(2**pkg.TURN_WIDTH / PERIOD_CLKS),
        pulse_clks=7,
        ratio=round(4.3 * 2**pkg.RATIO_FRACTION),
        motion_a=[round(a * 2**pkg.MOTION_FRACTION) for a, _ in polygon.harmonics],
        motion_phi=[0] * pkg.HARMONIC_COUNT,
        motion_da=[0] * pkg.HARMONIC_COUNT,
        motion_dphi=[0] * pkg.HARMONIC_COUNT,
        table_amplitude=[amplitude(AMPLITUDE_TURNS)] * TABLE_SIZE,
        table_midpoint=[middle] * TABLE_SIZE,
        amplitude_set=amplitude(AMPLITUDE_TURNS),
        phase_shift=0,
        rate_shift=16,
        scan_facet=1,
        scan_begin=round(begin_turn * 2**16),
        scan_span=round(span_turns * 2**16),
    )
    oversample = parameters()["IndexOversample"]
    clocks = 30 * PERIOD_CLKS
    turns = np.arange(clocks * oversample) / oversample / PERIOD_CLKS + float(draw.random())
    lit = np.abs((turns - start + 0.5) % 1.0 - 0.5) < half
    comparator = lit.reshape(clocks, oversample) @ (1 << np.arange(oversample))
    await bench.start(given)
    errors, dark, pulses = [], 0, {True: 0, False: 0}
    before = turn = 0.0
    for k, samples in enumerate(comparator.tolist()):
        await bench.clock(samples, (1 << oversample) - 1, True, True)
        twin = bench.twin
        port = twin.ports()
        since = (turns[min(k + 1, clocks - 1) * oversample] - begin_turn) % 1.0
        if twin.drive.state == RUN and port["laser"] and not before:
            pulses[since < span_turns] += 1
        before = port["laser"]
        if twin.angle_valid and twin.drive.state == RUN and abs(turn - span_turns / 2) < 0.34:
            assert port["mirror_flags"] == 0 and port["confidence"] == 255
            want = AMPLITUDE_TURNS / STRAIGHT * (0.5 - begin_turn - turn)
            errors.append(port["angle"] / 2**pkg.ANGLE_WIDTH - want)
        elif twin.angle_valid and twin.drive.state == RUN and turn > span_turns + 0.01:
            assert port["mirror_flags"] == UNSETTLED
            dark += 1
        if twin.trigger.centre:
            turn = since + 0.5 * twin.trigger.centre_half / PERIOD_CLKS
    # A sample of the index, half of it at either edge, and the harmonics' own 1e-6 of a facet.
    bound = AMPLITUDE_TURNS / STRAIGHT * (1.0 / (oversample * PERIOD_CLKS) + 1e-5)
    print(f"angle {np.abs(errors).max():.2e} turns, bound {bound:.2e}; {dark} dark lines")
    assert np.abs(errors).max() < bound
    assert len(errors) > 40 and dark > 15 and pulses[True] > 40 and pulses[False] == 0


@cocotb.test()
async def a_centre_at_the_very_start_of_a_facet(dut) -> None:
    """A phase of exactly 0 is this facet's first, not the last of the one before."""
    bench, period = await Bench.fresh(dut), 1024
    word = 2**pkg.TURN_WIDTH // period
    given = registers(
        generator(9),
        sweep_word=word,
        work_word=word,
        pulse_clks=8,
        ratio=2 << pkg.RATIO_FRACTION,
        motion_a=[1 << pkg.MOTION_FRACTION] + [0] * (pkg.HARMONIC_COUNT - 1),
        motion_phi=[0] * pkg.HARMONIC_COUNT,
        motion_da=[0] * pkg.HARMONIC_COUNT,
        motion_dphi=[0] * pkg.HARMONIC_COUNT,
        table_amplitude=[amplitude(AMPLITUDE_TURNS)] * TABLE_SIZE,
        trim_step=0,
        trim_gain=0,
        scan_facet=1,
    )
    ones = (1 << parameters()["IndexOversample"]) - 1

    async def centres(midpoint: int) -> dict[int, float]:
        """Return the angles by the phases of their lines' centres, in turns."""
        await bench.start(dataclasses.replace(given, table_midpoint=[midpoint] * TABLE_SIZE))
        found, phase = {}, 0
        for k in range(4 * period):
            await bench.clock(ones * (k % period < 80), ones, True, True)
            if bench.twin.angle_valid and k > 2 * period:
                found[phase] = bench.twin.ports()["angle"] / 2**pkg.ANGLE_WIDTH
            if bench.twin.trigger.centre:
                phase = bench.twin.phase.phase
        return found

    # The phase goes on by whole steps of the midpoint, which it starts from.
    phase = min(await centres(0))
    drop = pkg.TURN_WIDTH - pkg.MIDPOINT_WIDTH
    assert phase and phase % (1 << drop) == 0
    half = 1 << (pkg.MIDPOINT_WIDTH - 1)
    angles = await centres((half - (phase >> drop)) % (2 * half) - half)
    assert angles[0] == pytest.approx(AMPLITUDE_TURNS, abs=3e-5)


@cocotb.test()
async def the_end_of_what_is_scanned_belongs_to_it(dut) -> None:
    """The first pulse begins at the last step of the span, then a step behind it."""
    bench, span = await Bench.fresh(dut), 30_000

    async def first_pulse(**changes: int) -> tuple[bool, int]:
        """Return whether the first pulse is lit, and in which step of a turn it begins."""
        await bench.start(registers(generator(8), pulse_clks=7, **changes))
        for _ in range(PERIOD_CLKS):
            step = bench.twin.phase.phase >> (pkg.TURN_WIDTH - 16)
            await bench.clock(0, 0, False, True)
            if bench.twin.trigger.laser:
                return bool(bench.twin.ports()["laser"]), step
        raise AssertionError("no pulse")

    lit, step = await first_pulse(**WHOLE)
    assert lit
    begins = (step - span) % (1 << 16)
    assert await first_pulse(scan_begin=begins, scan_span=span) == (True, step)
    assert await first_pulse(scan_begin=begins, scan_span=span - 1) == (False, step)


@cocotb.test()
async def an_angle_that_saturates_is_flagged(dut) -> None:
    """Of a loop that is settled, the angles beyond half a turn are unsettled and no others."""
    draw = generator(4)
    bench = await Bench.fresh(dut)
    given = registers(
        draw,
        sweep_word=round(2**pkg.TURN_WIDTH / PERIOD_CLKS),
        pulse_clks=7,
        ratio=round(4.3 * 2**pkg.RATIO_FRACTION),
        motion_a=[(1 << (pkg.MOTION_WIDTH - 1)) - 1] * pkg.HARMONIC_COUNT,
        motion_phi=[0] * pkg.HARMONIC_COUNT,
        motion_da=[0] * pkg.HARMONIC_COUNT,
        motion_dphi=[0] * pkg.HARMONIC_COUNT,
        **WHOLE,
        table_midpoint=[0] * TABLE_SIZE,
    )
    top = (1 << pkg.AMPLITUDE_WIDTH) - 1
    given = dataclasses.replace(
        given,
        table_amplitude=[min(4 * value, top) for value in given.table_amplitude],
        amplitude_set=4 * given.amplitude_set,
    )
    clocks = 20 * PERIOD_CLKS
    samples = index(draw, clocks, parameters()["IndexOversample"], quiet=True)
    await bench.start(given)
    seen = {0: 0, 4: 0}
    for row in zip(*samples, strict=True):
        await bench.clock(*row, True, True)
        twin = bench.twin
        if twin.angle_valid and twin.drive.state == RUN:
            port = twin.ports()
            end = 1 << (pkg.ANGLE_WIDTH - 1)
            assert (port["angle"] in (-end, end - 1)) == (port["mirror_flags"] == 4)
            seen[port["mirror_flags"]] += 1
    assert min(seen.values()) > 3, seen


@EACH_VOLUME
@pytest.mark.parametrize("widths", ELABORATIONS, ids=str)
def test_mirror_loop_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("mirror_loop", __file__, widths, volume=volume)


# ---- the model alone ----


def test_running_is_stepping() -> None:
    """Runs of any length, cut anywhere, report what every single clock shows."""
    draw = generator(3)
    lines = measurements = 0
    for _ in range(8):
        clocks = 20_000
        given = registers(draw)
        comparator, gate = (np.array(bits) for bits in index(draw, clocks, 4))
        changed = np.flatnonzero(np.diff(comparator, prepend=0) | np.diff(gate, prepend=0))
        samples = np.zeros(len(changed), SAMPLES)
        samples["clock"] = changed
        samples["comparator"], samples["gate"] = comparator[changed], gate[changed]
        stepped, run = MirrorLoop(given), MirrorLoop(given)
        cuts = sorted({0, clocks, *draw.integers(clocks, size=12).tolist()})
        for begin, end in itertools.pairwise(cuts):
            enable, line_enable = bool(draw.random() < 0.9), bool(draw.random() < 0.8)
            for k in range(begin, end):
                stepped.step(
                    comparator=int(comparator[k]),
                    gate=int(gate[k]),
                    enable=enable,
                    line_enable=line_enable,
                )
                assert stepped.ports()["angle_valid"] == stepped.angle_valid
            want = stepped.run(end, samples[:0], enable=enable, line_enable=line_enable)
            got = run.run(end, samples, enable=enable, line_enable=line_enable)
            assert np.array_equal(got.lines, want.lines)
            assert np.array_equal(got.measurements, want.measurements)
            assert run.ports() == stepped.ports()
            lines += len(got.lines)
            measurements += len(got.measurements)
    assert lines > 100 and measurements > 50


def test_a_long_run_holds_no_more_than_a_short_one() -> None:
    """What a loop holds between two reports does not grow with the clocks behind it."""
    draw = generator(4)
    clocks = 60 * PERIOD_CLKS
    given = registers(draw)
    comparator, gate = (np.array(bits) for bits in index(draw, clocks, 4, quiet=True))
    changed = np.flatnonzero(np.diff(comparator, prepend=0) | np.diff(gate, prepend=0))
    samples = np.zeros(len(changed), SAMPLES)
    samples["clock"] = changed
    samples["comparator"], samples["gate"] = comparator[changed], gate[changed]
    loop = MirrorLoop(given)
    held, measurements = [], 0
    for period in range(60):
        measurements += len(loop.run((period + 1) * PERIOD_CLKS, samples).measurements)
        held.append(len(pickle.dumps(loop)))
    assert measurements > 50
    assert max(held[30:]) < max(held[:30]) + 100, held


def test_rows_are_the_engines() -> None:
    """The same names in the same order, but for the true angle."""
    assert ENGINE_LINE.names == (*LINE.names, "angle_true")
    assert all(ENGINE_LINE[name] == LINE[name] for name in LINE.names)
    assert ENGINE_MEASUREMENT == MEASUREMENT
