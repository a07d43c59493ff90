"""The mirror's loop in C++ against the simulated mirror: the twin bit for bit, and what it is for.

One journey from power-on through shocks, lost passes, darkness and stops is simulated once, at a
clock of 10 MHz; the tests look at its legs. Angles err more than at the shipped clock, by what a
sample of the index lasts.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest
from harness import generator
from scanners import SCANNERS, each_scanner, resonant

from vrscan.clocked import amplitude_control, mirror_phase
from vrscan.clocked.mirror_loop import ANGLE_LATENCY, LINE, MirrorLoop
from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.points import Points
from vrscan.engines.chain_engine import run_rtl
from vrscan.engines.mirror_engine import COUNTS, Mirror, Recording, World
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal.geometry import project
from vrscan.registers.chain_registers import Registers
from vrscan.registers.mirror_registers import INDEX_TIMEOUT, MirrorRegisters
from vrscan.scene.sensor import expose, spot_electrons

CLOCK_HZ = 10e6
OFF, SWEEP, SETTLE = pkg.MIRROR_OFF, pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE
RUN, FAULT = pkg.MIRROR_RUN, pkg.MIRROR_FAULT
NOT_RUNNING, INDEX_FAULT, UNSETTLED = (
    1 << bit - pkg.FLAG_NOT_RUNNING
    for bit in (pkg.FLAG_NOT_RUNNING, pkg.FLAG_INDEX_FAULT, pkg.FLAG_UNSETTLED)
)
ERROR_RAD = 60e-6  # the largest of an angle without a flag
# s: a start from rest is the sweep and this; a loop that was disturbed is settled again after this.
SETTLES_S = 0.6
RECOVERS_S = 0.2
SHOCKS = (0.0, 0.2, 0.35, 0.5, 0.65, 0.85)  # phases, fractions of a period
SHOCK_RAD_PER_S = 1.0
BLINKS = (0.05, 0.3, 0.55, 0.8)
DROPS = (7, 3)
TIMES_PERIOD = 150  # lines a period, and a tenth of a line more


DEFAULT = SCANNERS["default"]


def configured(config: Config = DEFAULT, **mirror: float) -> Config:
    """Return a shipped configuration at the slow clock, with changes of its [mirror]."""
    return config.model_copy(
        update={
            "clock": config.clock.model_copy(update={"frequency_hz": CLOCK_HZ}),
            "mirror": config.mirror.model_copy(update=mirror),
        }
    )


def reaction_clks(config: Config) -> float:
    """Return the longest time from a measurement's crossing to the line that knows of it."""
    work = mirror_phase.LATENCY + amplitude_control.LATENCY + ANGLE_LATENCY
    return work + 100 + CLOCK_HZ / config.line.rate_hz


CONFIG = configured()
PERIOD_CLKS = CLOCK_HZ / CONFIG.mirror.frequency_hz
REACTION_CLKS = reaction_clks(CONFIG)


@dataclass(frozen=True)
class Leg:
    """A part of a journey: its clocks, the inputs that held, and what was recorded."""

    begin: int
    end: int
    enable: bool
    ratio: int
    state: int  # at the end
    fault: int
    recording: Recording

    @property
    def lines(self) -> np.ndarray:
        """What came of its lines."""
        return self.recording.lines

    @property
    def seconds(self) -> float:
        """How long it took."""
        return (self.end - self.begin) / CLOCK_HZ

    def errors(self) -> np.ndarray:
        """Return by how much each angle is off, rad."""
        return self.lines["angle"] * (2.0 * np.pi / 2**pkg.ANGLE_WIDTH) - self.lines["angle_true"]

    def flagged_after(self, flag: int) -> int:
        """Return the clocks from its begin to the first line with a flag."""
        raised = np.flatnonzero(self.lines["flags"] & flag)
        assert raised.size, f"no line has flag {flag}"
        return int(self.lines["clock"][raised[0]]) - self.begin

    def flagged_until(self) -> int:
        """Return the clocks from its begin to the last line with any flag."""
        return int(self.lines["clock"][self.lines["flags"] != 0][-1]) - self.begin


class Journey:
    """A loop, its simulated mirror, and what happened to them."""

    def __init__(self, config: Config = CONFIG, **changes: int) -> None:
        self.registers = replace(MirrorRegisters.from_config(config), **changes)
        self.world = World.from_config(config)
        self.mirror = Mirror(self.registers, config, self.world)
        self.period_clks = CLOCK_HZ / config.mirror.frequency_hz
        self.legs: list[Leg] = []

    def go(
        self,
        seconds: float,
        *,
        until: int = -1,
        enable: bool = True,
        ratio: int | None = None,
        **world: float,
    ) -> Leg:
        """Go on for a time or until a state, with changes of the world."""
        mirror = self.mirror
        ratio = self.registers.ratio if ratio is None else ratio
        mirror.configure(replace(self.registers, ratio=ratio), enable=enable)
        begin = mirror.clock
        recording = mirror.run(
            round(seconds * CLOCK_HZ), replace(self.world, **world), until_state=until
        )
        self.legs.append(
            Leg(begin, mirror.clock, enable, ratio, mirror.state, mirror.fault, recording)
        )
        return self.legs[-1]

    def to_phase(self, fraction: float) -> None:
        """Go on to a fraction of a period on the grid of all periods, the next but one."""
        periods = np.floor(self.mirror.clock / self.period_clks) + 2.0 + fraction
        self.go((periods * self.period_clks - self.mirror.clock) / CLOCK_HZ)

    def check_twin(self) -> None:
        """Compare every line and measurement with the twin's on the recorded samples."""
        registers = self.registers
        twin = MirrorLoop(registers, registers.oversample)
        samples = Recording.joined([leg.recording for leg in self.legs]).samples
        for number, leg in enumerate(self.legs):
            twin.trigger.settings = replace(twin.trigger.settings, ratio=leg.ratio)
            report = twin.run(leg.end, samples, enable=leg.enable)
            for got, want in (
                (leg.lines[list(LINE.names or ())], report.lines),
                (leg.recording.measurements, report.measurements),
            ):
                assert len(got) == len(want), f"leg {number}: {len(got)} rows, want {len(want)}"
                for name in want.dtype.names or ():
                    wrong = np.flatnonzero(got[name] != want[name])
                    assert not wrong.size, (
                        f"leg {number}: {name} differs in {wrong.size} of {len(want)} rows; first "
                        f"{wrong[0]}: got {got[wrong[0]]}, want {want[wrong[0]]}"
                    )
            port = twin.ports()
            assert (port["state"], port["fault"]) == (leg.state, leg.fault)
        counts = {name: port[f"{name}_count"] for name in COUNTS}
        assert self.mirror.counts == counts


@pytest.fixture(scope="module")
def journey() -> dict[str, Any]:
    """Return the legs of the journey by name, and the journey itself."""
    trip = Journey()
    sweep_s = CONFIG.mirror.sweep_span_hz / CONFIG.mirror.sweep_hz_per_s
    legs: dict[str, Any] = {"journey": trip}
    legs["start"] = trip.go(sweep_s + SETTLES_S, until=RUN)
    legs["quiet"] = trip.go(0.06)
    for phase in SHOCKS:
        trip.to_phase(phase)
        legs[f"shock {phase}"] = trip.go(RECOVERS_S, shock_rad_per_s=SHOCK_RAD_PER_S)
    for phase in BLINKS:
        trip.to_phase(phase)
        legs[f"dark {phase}"] = trip.go(1.3 / CONFIG.mirror.frequency_hz, startup_mw=0.0)
        legs[f"light {phase}"] = trip.go(0.6 * RECOVERS_S)
    for every in DROPS:
        legs[f"drop {every}"] = trip.go(0.05, drop_every=every)
        legs[f"after {every}"] = trip.go(RECOVERS_S)
    for tenths in (0, 1):
        ratio = (10 * TIMES_PERIOD + tenths << pkg.RATIO_FRACTION) // 10
        legs[f"tenths {tenths}"] = trip.go(0.06, ratio=ratio)
    legs["stop 3"] = trip.go(0.003, enable=False)
    legs["restart"] = trip.go(2.0 * (sweep_s + SETTLES_S), until=RUN)
    legs["lost"] = trip.go(0.05, startup_mw=0.0)
    legs["waits"] = trip.go(0.005)
    legs["off"] = trip.go(0.005, enable=False)
    legs["again"] = trip.go(2.0 * (sweep_s + SETTLES_S), until=RUN)
    legs["half"] = trip.go(0.05, drop_every=2)
    trip.go(0.001, enable=False)
    trip.go(0.1)
    legs["stop 1"] = trip.go(0.003, enable=False)
    return legs


def test_every_line_and_measurement_is_the_twins(journey: dict[str, Any]) -> None:
    trip = journey["journey"]
    trip.check_twin()
    lines = sum(len(leg.lines) for leg in trip.legs)
    seconds = trip.mirror.clock / CLOCK_HZ
    print(f"\n{lines} lines in {seconds:.2f} s of the mirror's time")
    assert lines > 100_000


def test_a_start_from_rest(journey: dict[str, Any]) -> None:
    """SWEEP, SETTLE, RUN within the time; no line before is without a flag."""
    leg = journey["start"]
    assert leg.state == RUN
    print(f"\nRUN after {leg.seconds:.3f} s")
    assert list(dict.fromkeys(leg.lines["state"].tolist())) == [SWEEP, SETTLE]
    assert np.all(leg.lines["flags"] & NOT_RUNNING)


def test_a_quiet_mirror_has_good_angles(journey: dict[str, Any]) -> None:
    leg = journey["quiet"]
    assert not np.any(leg.lines["flags"][1:])
    assert np.all(leg.lines["confidence"][1:] > 128)
    errors = np.abs(leg.errors())
    print(f"\nangles err by {1e6 * errors.max():.0f} urad at most")
    assert errors.max() < ERROR_RAD


def check_recovery(leg: Leg, flag: int, within_clks: float) -> tuple[int, int]:
    """Assert that a leg is flagged in time, without a gap, until it is good again.

    Returns the clocks to the first and the last line with a flag.
    """
    first, last = leg.flagged_after(flag), leg.flagged_until()
    clock = leg.lines["clock"] - leg.begin
    assert first <= within_clks
    assert np.all(leg.lines["flags"][(clock >= first) & (clock <= last)])
    assert leg.state == RUN
    assert last < leg.end - leg.begin - PERIOD_CLKS, "not over at the end of the leg"
    assert np.abs(leg.errors()[clock > last]).max() < ERROR_RAD
    return first, last


@pytest.mark.parametrize("phase", SHOCKS)
def test_a_shock_is_flagged_within_a_period(journey: dict[str, Any], phase: float) -> None:
    """At any phase; UNSETTLED until the loop has settled, without confidence meanwhile."""
    leg = journey[f"shock {phase}"]
    first, last = check_recovery(leg, UNSETTLED, PERIOD_CLKS + REACTION_CLKS)
    blind = np.abs(leg.errors()[leg.lines["clock"] - leg.begin < first]).max()
    print(
        f"\n{SHOCK_RAD_PER_S} rad/s at {phase}: flagged after {first / CLOCK_HZ * 1e3:.2f} ms "
        f"({first / PERIOD_CLKS:.2f} periods), until then {1e6 * blind:.0f} urad; "
        f"settled after {last / CLOCK_HZ * 1e3:.0f} ms"
    )
    raised = leg.lines["flags"] != 0
    assert np.all(leg.lines["confidence"][raised] == 0)
    assert np.abs(leg.errors()).max() > 2.0 * ERROR_RAD, "no shock worth a flag"


@pytest.mark.parametrize("phase", BLINKS)
def test_darkness_is_flagged_within_a_period(journey: dict[str, Any], phase: float) -> None:
    """The laser leaves the diode at any phase; the tracker goes on, so that angles stay right."""
    dark, light = journey[f"dark {phase}"], journey[f"light {phase}"]
    first = dark.flagged_after(INDEX_FAULT)
    print(f"\ndark at {phase}: flagged after {first / PERIOD_CLKS:.2f} periods")
    assert first <= PERIOD_CLKS + REACTION_CLKS
    assert np.abs(dark.errors()).max() < ERROR_RAD
    check_recovery(light, INDEX_FAULT, CLOCK_HZ / CONFIG.line.rate_hz)
    assert np.all(light.lines["flags"][:50] & INDEX_FAULT)


@pytest.mark.parametrize("every", DROPS)
def test_lost_passes_are_flagged_and_leave_angles_right(
    journey: dict[str, Any], every: int
) -> None:
    """Each k-th pass over the diode is lost, so that no index fault is over before the next."""
    leg, after = journey[f"drop {every}"], journey[f"after {every}"]
    first = leg.flagged_after(INDEX_FAULT)
    known = leg.recording.measurements["clock"] - leg.begin
    known = known[known < first][-1] if np.any(known < first) else 0
    assert first - known <= PERIOD_CLKS + REACTION_CLKS
    assert np.all(leg.lines["flags"][leg.lines["clock"] - leg.begin >= first] & INDEX_FAULT)
    errors = np.abs(leg.errors())
    unflagged = leg.lines["flags"] == 0
    print(
        f"\nevery pass of {every} lost: {1e6 * errors[unflagged].max():.0f} urad at most without a "
        f"flag, {1e6 * errors.max():.0f} urad with one"
    )
    assert errors[unflagged].max() < ERROR_RAD
    assert errors.max() < 2.0 * ERROR_RAD
    check_recovery(after, INDEX_FAULT, CLOCK_HZ / CONFIG.line.rate_hz)


@pytest.mark.parametrize("name", ["lost", "half"])
def test_a_lost_index_ends_in_fault(journey: dict[str, Any], name: str) -> None:
    """No light, or no pass but in one direction: flagged, then FAULT, and nothing is driven."""
    leg = journey[name]
    assert (leg.state, leg.fault) == (FAULT, pkg.FAULT_INDEX)
    first = leg.flagged_after(INDEX_FAULT)
    faulty = leg.lines[leg.lines["state"] == FAULT]
    fault = int(faulty["clock"][0]) - leg.begin
    lost = CONFIG.mirror.lost_timeout_s * CLOCK_HZ
    print(f"\nFAULT {(fault - first) / CLOCK_HZ * 1e3:.2f} ms after the first flag")
    assert first <= 2.0 * INDEX_TIMEOUT * PERIOD_CLKS + REACTION_CLKS
    assert abs(fault - first - lost) <= 2.0 * CLOCK_HZ / CONFIG.line.rate_hz
    assert np.all(faulty["flags"] & (NOT_RUNNING | INDEX_FAULT) == NOT_RUNNING | INDEX_FAULT)
    assert not np.any(faulty["level"])


def test_fault_stays_until_it_is_told(journey: dict[str, Any]) -> None:
    """The light is back: FAULT stays; enable low ends it, and the next start is as good."""
    assert journey["waits"].state == FAULT
    assert set(journey["waits"].lines["state"]) == {FAULT}
    off = journey["off"]
    assert off.state == OFF and set(off.lines["state"]) == {OFF}
    assert np.all(off.lines["flags"] & NOT_RUNNING)
    again = journey["again"]
    print(f"\nRUN {again.seconds:.3f} s after FAULT")
    assert again.state == RUN and again.fault == pkg.FAULT_NONE
    assert np.all(again.lines["flags"] & NOT_RUNNING)


@pytest.mark.parametrize("state", [SWEEP, RUN])
def test_a_stop_is_over_within_a_period_of_the_drive(journey: dict[str, Any], state: int) -> None:
    """From either state, and then nothing is driven."""
    leg = journey[f"stop {state}"]
    assert leg.state == OFF and set(leg.lines["state"]) <= {state, OFF}
    still = leg.lines["state"] == OFF
    clock = leg.lines["clock"][still][0] - leg.begin
    assert clock <= PERIOD_CLKS / 2.0 + CLOCK_HZ / CONFIG.line.rate_hz
    assert not np.any(leg.lines["level"][still])
    assert np.all(leg.lines["flags"][still] & NOT_RUNNING)


def test_a_restart_finds_a_mirror_that_still_swings(journey: dict[str, Any]) -> None:
    """SWEEP begins 3 ms after the stop; RUN comes all the same, and no line before is good."""
    leg = journey["restart"]
    print(f"\nRUN {leg.seconds:.3f} s after a stop")
    assert leg.state == RUN
    assert np.all(leg.lines["flags"] & NOT_RUNNING)


@each_scanner(lambda config: resonant(config) and config is not DEFAULT)
def test_the_loop_of_another_scanner_is_the_twins_and_as_good(config: Config) -> None:
    """A start, rest, a shock and darkness, with its own rate of lines.

    The whole journey is the default's. A polygon's loop is in ``test_polygon_mirror``.
    """
    config = configured(config)
    trip, mirror = Journey(config), config.mirror
    start = trip.go(mirror.sweep_span_hz / mirror.sweep_hz_per_s + SETTLES_S, until=RUN)
    assert start.state == RUN and np.all(start.lines["flags"] & NOT_RUNNING)
    quiet = trip.go(0.06)
    assert not np.any(quiet.lines["flags"][1:]) and np.abs(quiet.errors()).max() < ERROR_RAD
    assert len(quiet.lines) == pytest.approx(0.06 * config.line.rate_hz, abs=2)
    within_clks = trip.period_clks + reaction_clks(config)
    trip.to_phase(SHOCKS[1])
    leg = trip.go(RECOVERS_S, shock_rad_per_s=SHOCK_RAD_PER_S)
    check_recovery(leg, UNSETTLED, within_clks)
    trip.to_phase(BLINKS[1])
    dark = trip.go(1.3 / mirror.frequency_hz, startup_mw=0.0)
    assert dark.flagged_after(INDEX_FAULT) <= within_clks
    trip.check_twin()


def turns(leg: Leg) -> np.ndarray:
    """Return the phase of lines of the falling half, fractions of a period, by their angles."""
    lines = leg.lines[20:]
    sine = lines["angle"] / 2**pkg.ANGLE_WIDTH / (lines["amplitude"] / 2**pkg.AMPLITUDE_FRACTION)
    falling = np.r_[np.diff(lines["angle"]) < 0, False] & (np.abs(sine) < 0.9)
    return np.where(falling, np.arccos(np.clip(sine, -1.0, 1.0)) / (2.0 * np.pi), np.nan)


def test_a_multiple_of_the_frequency_repeats_each_period(journey: dict[str, Any]) -> None:
    phase = turns(journey["tenths 0"])
    moved = phase[TIMES_PERIOD:] - phase[:-TIMES_PERIOD]
    moved = moved[np.isfinite(moved)]
    assert moved.size > 500
    print(f"\na line moves by {np.abs(moved).max() * TIMES_PERIOD:.3f} of a line's step a period")
    assert np.abs(moved).max() * TIMES_PERIOD < 0.02


def test_a_tenth_of_a_line_more_interleaves_ten_periods(journey: dict[str, Any]) -> None:
    """Sorted, the angles of ten periods are evenly spaced, ten times as dense as one period's."""
    count = 10 * TIMES_PERIOD + 1
    phase = turns(journey["tenths 1"])[:count]
    steps = np.diff(np.sort(phase[np.isfinite(phase)])) * count
    print(f"\nsteps from {steps.min():.2f} to {steps.max():.2f} of a tenth of a line's")
    assert steps.size > 500
    assert np.abs(steps - 1.0).max() < 0.5


@pytest.mark.parametrize(
    ("config", "changes", "fault", "seconds"),
    [
        pytest.param(
            configured(
                sweep_hz_per_s=80.0, settle_timeout_s=0.2, sweep_level=0.3,
                level_min=0.2, level_low=0.25, level=0.3, level_high=0.35, level_max=0.4,
            ),
            lambda r: {},
            pkg.FAULT_SETTLE,
            26.0 / 80.0 + 0.2,
            id="too little drive",
        ),
        pytest.param(
            configured(settle_timeout_s=0.2),
            lambda r: {"sweep_word": 2 * r.work_word - r.sweep_word},
            pkg.FAULT_SETTLE,
            0.2,
            id="sweep from below",
        ),
        pytest.param(
            configured(sweep_hz_per_s=4.0),
            lambda r: {"sweep_timeout": round(0.2 * CLOCK_HZ)},
            pkg.FAULT_SWEEP,
            0.2,
            id="too long a sweep",
        ),
    ],
)  # fmt: skip
def test_a_sweep_without_ever_an_index_ends_in_fault(config, changes, fault, seconds) -> None:
    """By time-out; every line is flagged."""
    trip = Journey(config, **changes(MirrorRegisters.from_config(config)))
    leg = trip.go(seconds + 0.01)
    assert (leg.state, leg.fault) == (FAULT, fault)
    clock = int(leg.lines["clock"][leg.lines["state"] == FAULT][0])
    assert clock / CLOCK_HZ == pytest.approx(seconds, abs=1e-4)
    assert not len(leg.recording.measurements)
    assert np.all(leg.lines["flags"] == NOT_RUNNING | UNSETTLED)
    trip.check_twin()


def test_an_amplitude_just_above_the_mark_ends_in_fault() -> None:
    """The loop comes below the mark, where there is nothing to control: flagged, never RUN."""
    config = configured(amplitude_deg=17.05, settle_timeout_s=0.4)
    trip = Journey(config)
    leg = trip.go(1.1)
    assert (leg.state, leg.fault) == (FAULT, pkg.FAULT_SETTLE)
    assert len(leg.recording.measurements)
    assert np.all(leg.lines["flags"] & NOT_RUNNING)
    assert trip.mirror.counts["missing"] > 0
    trip.check_twin()


def test_points_carry_the_flags_of_their_lines(journey: dict[str, Any]) -> None:
    """Around a shock, a wall seen at the true angles: flagged points stay where they are."""
    leg = journey[f"shock {SHOCKS[0]}"]
    first = leg.flagged_after(UNSETTLED)
    k = int(np.searchsorted(leg.lines["clock"], leg.begin + first))
    last = int(np.flatnonzero(leg.lines["flags"])[-1])
    chosen = np.r_[max(k - 80, 0) : k + 80, last - 80 : last + 80]
    lines = leg.lines[chosen]
    config = CONFIG
    position = project(
        np.tan(lines["angle_true"]) * 200.0, np.full(len(lines), 200.0), config.geometry
    )
    place = np.where(
        (position > 20) & (position < config.sensor.line_length - 20), position, np.nan
    )
    seen = np.isfinite(place)
    assert 100 < np.count_nonzero(seen) < len(seen)
    pixels = expose(
        spot_electrons(
            place,
            np.full(len(lines), 2.5),
            np.full(len(lines), 2000.0 / config.peak.kappa),
            config.sensor.line_length,
        ),
        generator(1),
        background_counts=60.0,
        read_noise_counts=3.0,
        kappa=config.peak.kappa,
        pixel_width=config.sensor.pixel_width,
    )
    registers = Registers.from_config(config)
    power = np.full(len(lines), config.laser.power_max)
    raised = lines["flags"]
    assert len(set(raised.tolist())) > 1

    got = run_rtl(pixels, lines["angle"], power, registers, mirror_flags=raised)
    bare = run_fixed(pixels, lines["angle"], power, registers)
    assert np.array_equal(got.flags, bare.flags | raised << pkg.FLAG_NOT_RUNNING)
    for field in fields(Points):
        want = getattr(bare, field.name)
        if field.name in ("c_sfm", "free_from", "free_to"):
            want = np.where(raised == 0, want, 0)  # a line of a doubtful angle frees nothing
        if field.name != "flags":
            assert np.array_equal(getattr(got, field.name), want), field.name
    good = seen & got.measured & (raised == 0)
    z_mm = got.z[good] / 2**pkg.LENGTH_FRACTION
    print(f"\n{np.count_nonzero(good)} points without a flag, z off by {np.ptp(z_mm):.3f} mm")
    assert np.abs(z_mm - 200.0).max() < 1.0
