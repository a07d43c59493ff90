"""scan_angle: RTL against the model exactly, the model against VR-SCAN (12) in float64."""

import math

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    assert_equal,
    drive,
    generator,
    reset,
    reset_at_every_age,
    restart_at_every_age,
    rounds,
    run_vectors,
    simulate,
)

from vrscan.data import pkg
from vrscan.fixed.quarter_wave import amplitude as wave_amplitude
from vrscan.fixed.scan_angle import (
    AMPL_WIDTH,
    INVERSE_LENGTH,
    LATENCY,
    error_bound_turns,
    scan_angle,
)

OUTPUTS = {"angle_o": True, "overflow_o": False}
TURN = 1 << pkg.PHASE_WIDTH
AMPLITUDE_END = 1 << pkg.AMPLITUDE_WIDTH
MOTION_END = 1 << (pkg.MOTION_WIDTH - 1)
ONE = 1 << pkg.MOTION_FRACTION
ANGLE_END = 1 << (pkg.ANGLE_WIDTH - 1)
COUNT = pkg.HARMONIC_COUNT

Columns = dict[str, np.ndarray]


def packed(values: np.ndarray, width: int) -> np.ndarray:
    """Return rows of integers [n, k] as words with the first one lowest, object [n]."""
    mask = (1 << width) - 1
    return np.array(
        [sum((int(v) & mask) << (width * k) for k, v in enumerate(row)) for row in values], object
    )


def expected(given: Columns) -> Columns:
    """Return the model's answer by port."""
    angle, overflow = scan_angle(given["phase"], given["amplitude"], given["a"], given["phi"])
    return {"angle_o": angle, "overflow_o": overflow.astype(np.int64)}


def as_ports(given: Columns) -> Columns:
    """Return what the ports take."""
    return {
        "phase_i": given["phase"],
        "amplitude_i": given["amplitude"],
        "a_i": packed(given["a"], pkg.MOTION_WIDTH),
        "phi_i": packed(given["phi"], pkg.PHASE_WIDTH),
    }


def operands(count: int) -> Columns:
    """Return corners of all ports, then motions of a mirror, then anything: 20 or more of each."""
    draw = generator(12)
    ends = {
        "phase": [0, 1, TURN // 4 - 1, TURN // 4, TURN // 2, 3 * TURN // 4, TURN - 1],
        "amplitude": [0, 1, AMPLITUDE_END // 2, AMPLITUDE_END - 1],
        "a": [-MOTION_END, -ONE, -1, 0, 1, ONE, MOTION_END - 1],
    }
    corners = {
        "phase": draw.choice(ends["phase"], count),
        "amplitude": draw.choice(ends["amplitude"], count),
        "a": draw.choice(ends["a"], (count, COUNT)),
        "phi": draw.choice(ends["phase"], (count, COUNT)),
    }
    # One harmonic alone at a time, so that none hides behind another.
    alone = count // 5
    corners["a"][:alone] *= np.eye(COUNT, dtype=np.int64)[np.arange(alone) % COUNT]
    corners["a"][alone : alone + 4] = 0
    # All terms at their largest and in step: four turns and more, either way.
    corners["a"][-8:] = np.where(np.arange(8) % 2, MOTION_END - 1, -MOTION_END)[:, None]
    corners["amplitude"][-8:] = AMPLITUDE_END - 1
    corners["phase"][-8:] = np.arange(8) // 4 * TURN // 2
    corners["phi"][-8:] = 0

    mirror = {
        "phase": draw.integers(0, TURN, count),
        "amplitude": draw.integers(1 << 23, 1 << 25, count),
        "a": draw.integers(-ONE // 50, ONE // 50, (count, COUNT)),
        "phi": draw.integers(0, TURN, (count, COUNT)),
    }
    mirror["a"][:, 0], mirror["phi"][:, 0] = ONE, 0
    anything = {
        "phase": draw.integers(0, TURN, count),
        "amplitude": AMPLITUDE_END - 1 - (draw.integers(0, AMPLITUDE_END, count) >> 2),
        "a": draw.integers(-MOTION_END, MOTION_END, (count, COUNT)),
        "phi": draw.integers(0, TURN, (count, COUNT)),
    }
    return {name: np.concatenate([corners[name], mirror[name], anything[name]]) for name in corners}


async def one_mirror(dut, count: int) -> Columns:
    """Reset, set the ports to the motion of one mirror, and return phases and amplitudes of it."""
    await reset(dut)
    given = operands(count)
    given = {name: values[count : 2 * count] for name, values in given.items()}
    given["a"][:], given["phi"][:] = given["a"][0], given["phi"][0]
    ports = as_ports(given)
    for name in ("a_i", "phi_i"):
        drive(getattr(dut, name), int(ports[name][0]))
    return given


def only_data(given: Columns) -> Columns:
    """Return the ports that change from angle to angle."""
    return {
        name: values for name, values in as_ports(given).items() if name not in ("a_i", "phi_i")
    }


@cocotb.test()
async def any_motion_back_to_back(dut) -> None:
    """Corners, mirrors and anything, a new phase in the clock of the last result."""
    given = operands(rounds(400, 3000))
    want = expected(given)
    assert 0.05 < np.mean(want["overflow_o"]) < 0.9, "one of the two cases is not tested"
    assert {ANGLE_END - 1, -ANGLE_END} <= set(want["angle_o"][want["overflow_o"] == 1].tolist())
    await reset(dut)
    got = await run_vectors(dut, as_ports(given), OUTPUTS, latency=LATENCY)
    assert_equal(got, want, given | {"a": as_ports(given)["a_i"], "phi": as_ports(given)["phi_i"]})


@cocotb.test()
async def phase_changes_while_it_works(dut) -> None:
    """The ports carry other phases and amplitudes between two results."""
    given = await one_mirror(dut, 60)
    got = await run_vectors(dut, only_data(given), OUTPUTS, latency=LATENCY, gaps=True)
    assert_equal(got, expected(given), only_data(given))


@cocotb.test()
async def restart_drops_the_first_phase(dut) -> None:
    """A valid_i at every moment of the work: only the second result comes out."""
    given = await one_mirror(dut, 60)
    await restart_at_every_age(dut, only_data(given), expected(given), OUTPUTS, latency=LATENCY)


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """A reset at every moment with valid high: nothing comes out, and the next result is right."""
    given = await one_mirror(dut, 60)
    await reset_at_every_age(dut, only_data(given), expected(given), OUTPUTS, latency=LATENCY)


@cocotb.test()
async def reset_without_a_new_phase(dut) -> None:
    """A reset at every moment, valid low: nothing comes out, and the next result is right."""
    given = await one_mirror(dut, 60)
    want = expected(given)
    await reset_at_every_age(dut, only_data(given), want, OUTPUTS, latency=LATENCY, valid=False)


@EACH_VOLUME
def test_scan_angle_rtl_equals_model(volume: str) -> None:
    simulate("scan_angle", __file__, volume=volume)


def test_latency_is_within_its_limit() -> None:
    assert LATENCY == 193
    assert LATENCY <= 200


def test_the_inverse_length_is_that_of_the_table() -> None:
    assert INVERSE_LENGTH * wave_amplitude(AMPL_WIDTH) == pytest.approx(2.0 ** (2 * AMPL_WIDTH - 2))


def harmonics(*terms: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return a and phi with the terms (index, a_k, phi_k); the others are 0."""
    a, phi = np.zeros(COUNT, np.int64), np.zeros(COUNT, np.int64)
    for n, value, shift in terms:
        a[n], phi[n] = value, shift
    return a, phi


@pytest.mark.parametrize("n", range(COUNT))
def test_each_harmonic_alone_follows_equation_12(n: int) -> None:
    """A cosine of 2 n + 1 periods a turn, late by phi_k, within two steps."""
    phase = np.arange(0, TURN, TURN // 999)
    shift = TURN // 7
    angle, overflow = scan_angle(phase, AMPLITUDE_END - 1, *harmonics((n, ONE, shift)))
    turns = 2.0 * math.pi / TURN
    want = (AMPLITUDE_END - 1) / 16.0 * np.cos(((2 * n + 1) * phase - shift) * turns)
    assert not overflow.any()
    assert np.abs(angle - want).max() < 2.0


def test_no_harmonics_or_no_amplitude_is_no_angle() -> None:
    phase = generator(1).integers(0, TURN, 1000)
    for amplitude, motion in ((AMPLITUDE_END - 1, 0), (0, MOTION_END - 1), (0, -MOTION_END)):
        a = np.full(COUNT, motion)
        angle, overflow = scan_angle(phase, amplitude, a, np.zeros(COUNT, np.int64))
        assert not angle.any() and not overflow.any()


def test_largest_terms_at_their_zeros_leave_their_errors_only() -> None:
    """At a quarter of a turn every k p is an odd number of quarters: all cosines are 0."""
    phase = np.array([TURN // 4, 3 * TURN // 4])
    for value in (MOTION_END - 1, -MOTION_END):
        a = np.full(COUNT, value)
        angle, overflow = scan_angle(phase, AMPLITUDE_END - 1, a, np.zeros(COUNT, np.int64))
        bound = error_bound_turns(np.array(0.25), a / ONE) * (1 << pkg.ANGLE_WIDTH)
        assert np.abs(angle).max() <= bound < 15.0
        assert not overflow.any()


def test_largest_terms_saturate_in_order() -> None:
    """As the amplitude grows the angle grows too, to the end of its format: there is the flag."""
    amplitude = np.arange(0, AMPLITUDE_END, 4099)
    for sign in (1, -1):
        a = np.full(COUNT, sign * (MOTION_END - 1))
        angle, overflow = scan_angle(np.int64(0), amplitude, a, np.zeros(COUNT, np.int64))
        assert np.all(sign * np.diff(angle) >= 0)
        assert angle[-1] == (ANGLE_END - 1 if sign > 0 else -ANGLE_END)
        whole = 2.0 * COUNT * amplitude / 2.0**pkg.AMPLITUDE_FRACTION  # turns
        assert np.array_equal(overflow, whole > 0.5)
        assert np.all(np.abs(angle[~overflow]) < ANGLE_END)


@pytest.mark.parametrize("sign", [1, -1])
def test_both_ends_of_the_angle_fit_and_a_step_more_saturates(sign: int) -> None:
    """Amplitudes around half a turn, in quarters of a step."""
    a, phi = harmonics(*((n, sign * ONE, 0) for n in range(4)))
    amplitude = np.arange(AMPLITUDE_END // 2 - 64, AMPLITUDE_END // 2 + 64)
    angle, overflow = scan_angle(np.int64(0), amplitude, a, phi)
    end = ANGLE_END - 1 if sign > 0 else -ANGLE_END
    assert overflow.any() and (angle[overflow] == end).all()
    assert (angle[~overflow] == end).any()
    # The largest amplitudes saturate, and nothing but them.
    assert np.all(np.diff(overflow.astype(int)) >= 0)
    exact = sign * amplitude / 4.0
    assert np.abs(angle - exact)[~overflow].max() < 3.0


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("phase", {"phase": TURN}),
        ("phase", {"phase": -1}),
        ("amplitude", {"amplitude": AMPLITUDE_END}),
        ("amplitude", {"amplitude": -1}),
        ("a", {"a": np.full(COUNT, MOTION_END)}),
        ("a", {"a": np.full(COUNT, -MOTION_END - 1)}),
        ("phi", {"phi": np.full(COUNT, TURN)}),
        ("phi", {"phi": np.full(COUNT, -1)}),
        ("axis", {"a": np.zeros(COUNT - 1, np.int64)}),
        ("axis", {"phi": np.zeros(COUNT - 1, np.int64)}),
    ],
)
def test_what_does_not_fit_is_refused(name: str, change: dict[str, object]) -> None:
    zero = np.zeros(COUNT, np.int64)
    good = {"phase": 0, "amplitude": 0, "a": zero, "phi": zero}
    with pytest.raises(ValueError, match=name):
        scan_angle(**(good | change))


def test_arguments_are_broadcast() -> None:
    """One motion for many phases, and a motion each, are the same."""
    given = operands(100)
    one = scan_angle(given["phase"], given["amplitude"], given["a"][3], given["phi"][3])
    each = scan_angle(
        given["phase"],
        given["amplitude"],
        np.broadcast_to(given["a"][3], given["a"].shape),
        np.broadcast_to(given["phi"][3], given["phi"].shape),
    )
    assert np.array_equal(one[0], each[0]) and np.array_equal(one[1], each[1])
    angle, overflow = scan_angle(given["phase"][:, None], given["amplitude"][:3], *harmonics())
    assert angle.shape == overflow.shape == (300, 3)
