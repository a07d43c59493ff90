"""index_diode: the crossings of passes at known speed, its jitter and noise, what makes it dark.

Its currents and its threshold are those of ``vrscan.scene.index_diode``.
"""

from dataclasses import replace

import cocotb
import numpy as np
import pytest
from cocotb.triggers import Timer
from harness import CLOCK_NS, FallingEdge, each, generator, parameters, reset, simulate

from vrscan.scene.index_diode import IndexDiode, passes

MARK = 0.2967
WIDTH = 60e-6  # rad: much less than the instrument's, so that a pass is short
BEAM = 8e-6
SPEED = 314.0  # rad/s, at 17 of 20.5 degrees
BEND = -7e5  # rad/s^2
TOP_RAD = 20e-6
HALF_PASS = 64  # clocks from a pass's beginning to about its middle
NOISE_HZ = 20.0e6
ELABORATIONS = [
    {"IndexOversample": oversample, "StepClks": 16, "SinceWidth": 5} for oversample in (4, 1, 2, 8)
]
ONE_FIELD = ELABORATIONS[0] | {"Fields": 1}
DIODE = IndexDiode(
    width_rad=WIDTH,
    beam_rad=BEAM,
    ambient_mw=0.0,
    threshold_mw=0.5,  # of 1 mW: half of the beam is on the diode
    threshold_share=0.0,
    hold_s=1e3,
)
PULSE_MW = 20.0


class Bench:
    """The diode, and a mirror whose outputs are written every clock."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.clock_s = 1.0 / int(dut.ClockHz.value)
        self.oversample = parameters()["IndexOversample"]
        self.light = 1.0  # mW
        self.turn = (
            0.0  # rad/s^2: the beam turns back in the pass's middle, TOP_RAD beyond the mark
        )

    async def start(
        self,
        *,
        mark: float = MARK,
        jitter: float = 0.0,
        seed: int = 1,
        diode: IndexDiode = DIODE,
    ) -> None:
        """Reset with the laser on."""
        dut = self.dut
        await reset(dut)
        dut.mark_rad_i.value, dut.width_rad_i.value = mark, diode.width_rad
        dut.jitter_s_i.value, dut.seed_i.value = jitter, seed
        dut.beam_rad_i.value, dut.hold_s_i.value = diode.beam_rad, diode.hold_s
        dut.ambient_mw_i.value = diode.ambient_mw
        dut.threshold_share_i.value = diode.threshold_share
        dut.threshold_mw_i.value = diode.threshold_mw
        dut.startup_mw_i.value, dut.pulse_mw_i.value = self.light, 0.0
        dut.rst_i.value = 1
        await Timer(2 * CLOCK_NS, "ns")
        dut.rst_i.value = 0
        for _ in range(2):
            await FallingEdge(dut.clk_i)
        self.mark = mark

    def truth(self, clocks: np.ndarray, middle: float, outward: bool) -> tuple[np.ndarray, ...]:
        """Return angle, velocity, acceleration and jerk of a pass that is at the mark at middle."""
        sign = np.sign(self.mark)
        along = 1.0 if outward else -1.0
        t = (clocks - middle) * self.clock_s
        if self.turn:
            angle = self.mark + sign * (TOP_RAD - self.turn * t**2 / 2.0)
            return angle, -sign * self.turn * t, 0 * t - sign * self.turn, 0 * t
        angle = self.mark + sign * (along * SPEED * t + BEND * t**2 / 2.0)
        return angle, sign * (along * SPEED + BEND * t), 0 * t + sign * BEND, 0 * t

    async def run(
        self,
        middle: float,
        outward: bool,
        drop: range = range(0),
        dark: range = range(0),
        pulse: range = range(0),
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lead the beam over the diode once and return the samples of comparator and gate.

        Sample 0 is at the second clock of the pass: the mirror's outputs of a clock are for its
        beginning, the diode's answer is for the next one.
        """
        dut, step = self.dut, parameters()["StepClks"]
        got = []
        table = np.stack(self.truth(np.arange(2 * HALF_PASS), middle, outward), axis=1).tolist()
        for clock in range(2 * HALF_PASS):
            since = clock % step
            if since == 0:
                dut.angle_i.value, dut.velocity_i.value = table[clock][:2]
                dut.acceleration_i.value, dut.jerk_i.value = table[clock][2:]
            dut.since_clks_i.value = since
            dut.drop_i.value = int(clock in drop)
            dut.startup_mw_i.value = self.light * (clock not in dark)
            dut.pulse_mw_i.value = PULSE_MW * (clock in pulse)
            await FallingEdge(dut.clk_i)
            got.append((int(dut.comparator_o.value), int(dut.gate_o.value)))
        dut.angle_i.value = dut.velocity_i.value = 0.0  # far away
        dut.since_clks_i.value = 0
        dut.drop_i.value = 0
        dut.startup_mw_i.value, dut.pulse_mw_i.value = self.light, 0.0
        for _ in range(3):
            await FallingEdge(dut.clk_i)
        bits = (np.array(got)[:, :, None] >> np.arange(self.oversample)) & 1
        return bits[:, 0].ravel(), bits[:, 1].ravel()

    async def seen(self, outward: bool, pulse: range = range(0)) -> np.ndarray:
        """Return where a pass is seen, by the gate, or the comparator of one field."""
        comparator, gate = await self.run(HALF_PASS, outward, pulse=pulse)
        if parameters().get("Fields") != 1:
            return gate == 1
        assert gate.all()
        return comparator == 1

    def off(self, outward: bool) -> np.ndarray:
        """Return how far from the mark the beam is at the samples of a pass."""
        count = 2 * HALF_PASS * self.oversample
        return np.abs(self.truth(self.times(count), HALF_PASS, outward)[0] - self.mark)

    def times(self, count: int) -> np.ndarray:
        """Return the times of samples in clocks of the pass."""
        return 1.0 + np.arange(count) / self.oversample


@cocotb.test()
async def clean_passes_are_exact(dut) -> None:
    """Without noise every sample is what the angle says, both ways, on either side of zero."""
    bench = Bench(dut)
    draw = generator(1)
    crossed = idle = 0
    for mark in (MARK, -MARK):
        await bench.start(mark=mark)
        for k in range(12):
            middle, outward = HALF_PASS + draw.uniform(-8.0, 8.0), bool(k % 2)
            comparator, gate = await bench.run(middle, outward)
            angle = bench.truth(bench.times(gate.size), middle, outward)[0]
            on = np.abs(angle - mark) < WIDTH
            beyond = np.sign(mark) * (angle - mark) > 0.0
            assert np.array_equal(gate, on), f"gate, pass {k}"
            assert np.array_equal(comparator[on], beyond[on]), f"comparator, pass {k}"
            crossed += np.ptp(comparator[on]) == 1
            idle += np.count_nonzero(np.diff(comparator[np.flatnonzero(on)[-1] + 1 :]))
    assert crossed == 24 and idle < 6


@cocotb.test()
async def light_is_seen_above_a_fixed_threshold(dut) -> None:
    """Wider in more light, ambient light adds up, and nothing or everything is above it."""
    bench = Bench(dut)
    seen_rad = []
    for light, ambient in ((0.6, 0.0), (1.0, 0.0), (50.0, 0.0), (0.6, 0.3), (0.4, 0.0), (1.0, 0.5)):
        bench.light = light
        diode = replace(DIODE, ambient_mw=ambient)
        await bench.start(diode=diode)
        want_rad = diode.half_width_rad(light, diode.threshold(0.0))
        for outward in (True, False):
            seen = await bench.seen(outward)
            assert np.array_equal(seen, bench.off(outward) < want_rad), (light, ambient)
        seen_rad.append(want_rad)
    assert seen_rad[0] < WIDTH < seen_rad[3] < seen_rad[2] and seen_rad[4:] == [0.0, np.inf]


@cocotb.test()
async def the_threshold_follows_the_passes_before(dut) -> None:
    """Each pass is seen as wide as the light of those before it says, and ambient light is none."""
    bench = Bench(dut)
    light = np.repeat([1.0, 6.0, 2.0, 0.7, 40.0], 6)
    for ambient in (0.0, 3.0):
        diode = replace(DIODE, ambient_mw=ambient, threshold_mw=0.05, threshold_share=0.5)
        await bench.start(diode=diode)
        wants = passes(diode, np.arange(len(light)) * 1e-6, light)
        for k, want_rad in enumerate(wants.tolist()):
            bench.light = float(light[k])
            seen, off = await bench.seen(bool(k % 2)), bench.off(bool(k % 2))
            assert np.array_equal(seen, off < want_rad), f"pass {k}, ambient {ambient} mW"
        assert 0.0 in wants and wants.max() > 1.09 * WIDTH and wants[-1] < 1.02 * WIDTH


@cocotb.test()
async def a_pulse_is_seen_and_does_not_count(dut) -> None:
    """Both channels' light adds up, and the threshold stays that of the start-up light."""
    bench = Bench(dut)
    diode = replace(DIODE, threshold_mw=0.05, threshold_share=0.5)
    await bench.start(diode=diode)
    for k in range(20):
        await bench.seen(bool(k % 2))
    threshold = diode.threshold(diode.peak(1.0))
    pulse = range(
        HALF_PASS - 32, HALF_PASS - 20
    )  # off the mark: where the start-up light is not seen
    wide = diode.half_width_rad(1.0 + PULSE_MW, threshold)
    off = bench.off(True)
    inside = np.isin(np.arange(off.size) // bench.oversample, list(pulse))
    want = np.where(inside, off < wide, off < diode.half_width_rad(1.0, threshold))
    for _ in range(5):
        seen = await bench.seen(True, pulse)
        # A hundredth of the hold is still missing, and the samples at the edges tell.
        assert np.count_nonzero(seen != want) <= 2
        assert seen[inside].any() and off[seen].max() > 1.05 * WIDTH


async def crossing_times(bench: Bench, passes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return for each pass the crossing's time after the true one, ns, and how often it changed.

    The time keeps the area: as many samples of the new level as there are, less half a sample.
    """
    draw = generator(2)
    late, changes = np.empty(passes), np.empty(passes, int)
    for k in range(passes):
        middle, outward = HALF_PASS + draw.uniform(-2.0, 2.0), bool(k // 2 % 2)
        comparator, gate = await bench.run(middle, outward)
        seen = comparator[gate == 1] == outward
        end = bench.times(gate.size)[gate == 1][-1]
        late[k] = end - (seen.sum() - 0.5) / bench.oversample - middle
        changes[k] = np.count_nonzero(np.diff(seen))
        assert not seen[0] and seen[-1]
    return late * bench.clock_s * 1e9, changes


@cocotb.test()
async def jitter_is_what_was_asked_for(dut) -> None:
    """1 ns rms on top of the sampling's, one shift a pass: every pass has one clean edge."""
    bench = Bench(dut)
    asked_ns = 1.0
    passes = 1500 if bench.oversample == 8 else 100
    await bench.start(jitter=asked_ns * 1e-9)
    late, changes = await crossing_times(bench, passes)
    sample_ns = bench.clock_s * 1e9 / bench.oversample
    want = np.hypot(asked_ns, sample_ns / np.sqrt(12.0))
    got = np.sqrt(np.mean(np.square(late)))
    slack = 4.0 / np.sqrt(2.0 * passes)  # four deviations of an rms of so many
    print(
        f"jitter: {got:.3f} ns rms of {passes} passes, want {want:.3f} within {slack:.0%}, "
        f"mean {late.mean():+.3f} ns"
    )
    assert abs(got / want - 1.0) < slack
    assert abs(late.mean()) < 4.0 * want / np.sqrt(passes)
    assert np.all(changes == 1)
    if bench.oversample == 8:
        together = np.corrcoef(late[1:], late[:-1])[0, 1]
        assert abs(together) < 4.0 / np.sqrt(passes)  # the two crossings of a period, too


def chatter(bench: Bench, noise_rad: float, passes: int) -> tuple[float, float]:
    """Return rms time, ns, and mean changes of passes with first-order noise, by numpy."""
    draw = generator(3)
    step_s = bench.clock_s / bench.oversample
    remain = np.exp(-2.0 * np.pi * NOISE_HZ * step_s)
    count = round(2.0 * WIDTH / SPEED / step_s)
    t = (np.arange(count) - count / 2 + draw.random((passes, 1))) * step_s
    noise = draw.standard_normal((passes, count))
    for k in range(1, count):
        noise[:, k] = remain * noise[:, k - 1] + np.sqrt(1.0 - remain**2) * noise[:, k]
    beyond = SPEED * t + noise_rad * noise > 0.0
    late = (t[:, -1] - (beyond.sum(axis=1) - 0.5) * step_s) * 1e9
    changes = np.count_nonzero(np.diff(beyond.astype(int), axis=1), axis=1)
    return float(np.sqrt(np.mean(np.square(late)))), float(changes.mean())


@cocotb.test()
async def a_pass_ends_where_the_beam_turns_back(dut) -> None:
    """Out and back without leaving the diode: two shifts that know nothing of each other."""
    bench = Bench(dut)
    await bench.start(jitter=20e-9)
    bench.turn = 1.5e9
    away = np.sqrt(2.0 * TOP_RAD / bench.turn) / bench.clock_s
    shifts = []
    for _ in range(150):
        comparator, gate = await bench.run(HALF_PASS, True)
        beyond = bench.times(gate.size)[(comparator & gate) == 1]
        shifts.append((beyond[0] - HALF_PASS + away, beyond[-1] - HALF_PASS - away))
    out, back = np.array(shifts).T * bench.clock_s * 1e9
    print(f"turning back: {out.std():.1f} and {back.std():.1f} ns rms, want 20")
    assert 14.0 < out.std() < 26.0 and 14.0 < back.std() < 26.0
    assert abs(np.corrcoef(out, back)[0, 1]) < 4.0 / np.sqrt(150)


@cocotb.test()
async def noise_makes_it_chatter(dut) -> None:
    """Noise of a few urad: several changes a crossing, as many as first-order noise makes."""
    bench = Bench(dut)
    passes = 500 if bench.oversample == 8 else 100
    noise_rad = 4e-6
    await bench.start()
    dut.noise_rad_i.value = noise_rad
    late, changes = await crossing_times(bench, passes)
    rms, mean = chatter(bench, noise_rad, 20_000)
    got = np.sqrt(np.mean(np.square(late)))
    print(
        f"noise: {got:.2f} ns rms, want {rms:.2f}; "
        f"{changes.mean():.2f} changes a crossing, want {mean:.2f}"
    )
    assert abs(got / rms - 1.0) < 4.0 / np.sqrt(2.0 * passes)
    assert abs(changes.mean() - mean) < 4.0 * max(changes.std(), 0.1) / np.sqrt(passes)
    assert np.all(changes % 2 == 1)
    if bench.oversample == 8:
        assert changes.max() >= 3


@cocotb.test()
async def a_dropped_pass_is_lost_from_edge_to_edge(dut) -> None:
    """drop_i when the beam runs onto the diode takes that pass; later in it, it takes nothing."""
    bench = Bench(dut)
    await bench.start()
    for outward in (True, False):
        changes = 0
        for _ in range(10):
            comparator, gate = await bench.run(HALF_PASS, outward, drop=range(HALF_PASS))
            assert not gate.any()
            changes += np.count_nonzero(np.diff(comparator))
        assert changes < 5, "it toggles once in 128 steps, and does not show the crossing"
        _, gate = await bench.run(HALF_PASS, outward)
        whole = gate.sum()
        assert whole > 30 * bench.oversample
        later = range(HALF_PASS, 2 * HALF_PASS)
        comparator, gate = await bench.run(HALF_PASS, outward, drop=later)
        assert gate.sum() == whole and np.ptp(comparator[gate == 1]) == 1


@cocotb.test()
async def without_light_it_means_nothing(dut) -> None:
    """Laser off: no gate, from the very clock on; the comparator toggles now and then."""
    bench = Bench(dut)
    await bench.start()
    _, lit = await bench.run(HALF_PASS, True)
    changes = 0
    for _ in range(10):
        comparator, gate = await bench.run(HALF_PASS, True, dark=range(2 * HALF_PASS))
        assert not gate.any()
        changes += np.count_nonzero(np.diff(comparator))
    assert changes < 5, "it toggles once in 128 steps, and does not show the crossing"
    _, gate = await bench.run(HALF_PASS, True, dark=range(60, 70))
    want = lit.copy()
    want[60 * bench.oversample : 70 * bench.oversample] = 0
    assert np.array_equal(gate, want)
    levels = []
    for _ in range(6000):  # each a step of the mirror, which stands still far away
        await FallingEdge(dut.clk_i)
        assert int(dut.gate_o.value) == 0
        levels.append(int(dut.comparator_o.value))
    assert set(levels) == {0, 2**bench.oversample - 1}
    toggles = np.count_nonzero(np.diff(levels))
    assert 20 < toggles < 80, f"{toggles} toggles in 6000 steps, want about one in 128"


@cocotb.test()
async def reset_mid_pass_and_seeds(dut) -> None:
    """Reset darkens it at once; the same seed gives the same numbers, another one others."""
    bench = Bench(dut)
    runs = []
    for seed in (7, 7, 0, 0xFFFFFFFF):
        await bench.start(jitter=20e-9, seed=seed)
        times, _ = await crossing_times(bench, 6)
        runs.append(times.tolist())
    assert runs[0] == runs[1]
    assert runs[0] != runs[2] != runs[3] != runs[0]
    dut.angle_i.value = MARK + WIDTH / 2
    for _ in range(3):
        await FallingEdge(dut.clk_i)
    ones = 2**bench.oversample - 1
    assert (int(dut.gate_o.value), int(dut.comparator_o.value)) == (ones, ones)
    dut.rst_i.value = 1
    await FallingEdge(dut.clk_i)
    assert (int(dut.gate_o.value), int(dut.comparator_o.value)) == (0, 0)
    dut.rst_i.value = 0
    await FallingEdge(dut.clk_i)
    assert (int(dut.gate_o.value), int(dut.comparator_o.value)) == (ones, ones)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_index_diode_sees_the_mark(widths: dict[str, int]) -> None:
    simulate("index_diode", __file__, widths)


def test_a_diode_of_one_field_sees_the_light() -> None:
    simulate("index_diode", __file__, ONE_FIELD, only="light_is|the_threshold|a_pulse_is")
