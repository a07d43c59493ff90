"""A polygon in the RTL's loop: against the twin, bit by bit, and against the truth."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vrscan.clocked.mirror_loop import LINE, MirrorLoop
from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.engines.mirror_engine import Mirror, Recording, World
from vrscan.registers.mirror_registers import MirrorRegisters

CLOCK_HZ = 10e6
CONFIG = Config.model_validate(
    {
        "clock": {"frequency_hz": CLOCK_HZ},
        "mirror": {"kind": "polygon", "oversample": 8, "settle_periods": 16},
        "line": {"rate_hz": 4000.3},
        "sensor": {"line_length": 256},
    }
)
FACET_RAD = math.radians(720.0 / CONFIG.mirror.facets)
UNSETTLED = 1 << pkg.FLAG_UNSETTLED - pkg.FLAG_NOT_RUNNING
INDEX_FAULT = 1 << pkg.FLAG_INDEX_FAULT - pkg.FLAG_NOT_RUNNING


@pytest.fixture(scope="module")
def run() -> tuple[MirrorRegisters, list[Recording], int]:
    """Return a polygon at its speed: the search, RUN, and RUN with lost starts of scan."""
    registers = MirrorRegisters.from_config(CONFIG)
    world = replace(World.from_config(CONFIG), start_velocity=1.0)
    with Mirror(registers, CONFIG, world) as mirror:
        parts = [mirror.run(round(0.3 * CLOCK_HZ), world, until_state=pkg.MIRROR_RUN)]
        assert mirror.state == pkg.MIRROR_RUN
        parts.append(mirror.run(round(0.25 * CLOCK_HZ), world))
        parts.append(mirror.run(round(0.05 * CLOCK_HZ), replace(world, drop_every=7)))
        assert mirror.counts["missing"] > 0 and mirror.state == pkg.MIRROR_RUN
        return registers, parts, mirror.clock


def test_every_line_is_the_twins(run: tuple[MirrorRegisters, list[Recording], int]) -> None:
    """The recorded samples give the twin the same lines and measurements."""
    registers, parts, end = run
    whole = Recording.joined(parts)
    report = MirrorLoop(registers, registers.oversample).run(end, whole.samples)
    assert np.array_equal(whole.lines[list(LINE.names or ())], report.lines)
    assert np.array_equal(whole.measurements, report.measurements)
    assert len(report.lines) > 1000 and len(report.measurements) > 80


def test_angles_are_the_beams_where_it_is_scanned(
    run: tuple[MirrorRegisters, list[Recording], int],
) -> None:
    """No flag within the reach and UNSETTLED beyond it; the error is what clock and speed leave."""
    lines = run[1][1].lines
    true = lines["angle_true"]
    inside = np.abs(true) < math.radians(CONFIG.mirror.reach_deg - 0.1)
    outside = np.abs(true) > math.radians(CONFIG.mirror.reach_deg + 0.1)
    assert (lines["flags"][inside] == 0).all() and (lines["flags"][outside] == UNSETTLED).all()
    assert (lines["confidence"][inside] == 255).all()
    late = inside & (lines["clock"] > lines["clock"][0] + 0.05 * CLOCK_HZ)
    error = lines["angle"][late] * (2 * np.pi / 2**pkg.ANGLE_WIDTH) - true[late]
    # A start is sampled to a step, uniform, twice; a facet's error turns the speed by its share of
    # 1/32 over the 0.7 of a facet behind its start; jitter; and the speed's hunting, all of it.
    speed = FACET_RAD * CONFIG.mirror.frequency_hz
    step = speed / (8 * CLOCK_HZ) / math.sqrt(24.0)
    facet = 1e-6 * CONFIG.polygon.facet_urad * math.sqrt(2.0) / 32.0 * 0.75
    jitter = 1e-9 * CONFIG.mems.jitter_ns * speed
    hunting = 1e-6 * CONFIG.polygon.speed_ppm * FACET_RAD * 0.75
    bound = math.hypot(step, facet, jitter) + hunting
    rms = float(np.sqrt(np.mean(error**2)))
    print(f"angle error {1e6 * rms:.2f} urad rms, bound {1e6 * bound:.2f}; {late.sum()} lines")
    assert late.sum() > 400 and 0.1 * bound < rms < bound


def test_a_lost_start_is_flagged(run: tuple[MirrorRegisters, list[Recording], int]) -> None:
    """Behind a start that does not come lines are INDEX_FAULT, and not before."""
    faults = [(part.lines["flags"] & INDEX_FAULT).any() for part in run[1][1:]]
    assert faults == [False, True]
