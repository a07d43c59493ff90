"""peak_refine: RTL against the model exactly; the rule of its windows and slopes by cases."""

import math
from dataclasses import dataclass, replace

import cocotb
import numpy as np
import pytest
from harness import (
    FallingEdge,
    as_integer,
    assert_equal,
    each,
    generator,
    parameters,
    reset,
    simulate,
)
from scipy.integrate import quad
from scipy.optimize import brentq
from sensor_gain import KAPPA, kappa_register

from vrscan.data import pkg
from vrscan.fixed.peak_refine import START_LATENCY, Refined, latency, peak_refine, sigma_table
from vrscan.fixed.phase_correlate import first_harmonics
from vrscan.ideal import two_pass as ideal

ELABORATIONS = [
    {"LineLength": 2048, "PixelWidth": 12, "MaxWindow": 255},
    {"LineLength": 64, "PixelWidth": 8, "MaxWindow": 20},
    {"LineLength": 1000, "PixelWidth": 16, "MaxWindow": 70},
    {"LineLength": 1024, "PixelWidth": 10, "MaxWindow": 255},
]
OUTPUTS = {"left": False, "width": False, "ramp": True, "slope": True, "sigma": False}
RING = 1 << pkg.RING_WIDTH
SHARE_ONE = 13813603.0  # |P1| over the sum of a line: the CORDIC's gain times the sine's amplitude


def share_by_quadrature(sigma: float) -> float:
    """Return |P1| over the sum of a Gaussian in its window, ``sigma`` in windows."""

    def spot(place: float) -> float:
        return math.exp(-0.5 * (place / sigma) ** 2)

    def wave(place: float) -> float:
        return spot(place) * math.cos(2 * math.pi * place)

    even = {"a": 0.0, "b": 0.5, "epsabs": 1e-13, "epsrel": 1e-11}
    return quad(wave, **even)[0] / quad(spot, **even)[0]


def sigma_by_quadrature(share: float) -> float:
    """Return the sigma, in windows, that has this share, from 0.1 to 0.5."""
    if share >= share_by_quadrature(0.1):
        return 0.1
    if share <= share_by_quadrature(0.5):
        return 0.5
    return float(brentq(lambda sigma: share_by_quadrature(sigma) - share, 0.1, 0.5))


@dataclass(frozen=True)
class Cases:
    """First windows of n lines with their harmonics; arrays [n] but for ``lines``."""

    lines: np.ndarray
    left: np.ndarray
    width: np.ndarray
    phase: np.ndarray
    magnitude: np.ndarray
    sum: np.ndarray
    maximum: np.ndarray
    background: np.ndarray
    noise: np.ndarray

    def refined(self, given: dict[str, int], kappa: int) -> Refined:
        """Return the twin's answer."""
        return peak_refine(
            **vars(self),
            pixel_width=given["PixelWidth"],
            max_window=given["MaxWindow"],
            kappa=kappa,
        )


def measured(
    lines: np.ndarray,
    left: np.ndarray,
    width: np.ndarray,
    background: np.ndarray,
    noise: np.ndarray,
    pixel_width: int,
) -> Cases:
    """Return the first windows of these lines; background and noise in counts with a fraction."""
    shift = pkg.COUNT_WIDTH - pixel_width
    fixed = np.floor(background * 2.0**shift).astype(np.int64)
    lines = lines.astype(np.uint16)
    found = first_harmonics(
        lines, left=left, width=width, background=fixed, pixel_width=pixel_width, period_n=True
    )
    return Cases(
        lines=lines,
        left=left,
        width=width,
        phase=found.phase,
        magnitude=found.magnitude,
        sum=found.sum,
        maximum=lines.max(axis=1).astype(np.int64),
        background=fixed,
        noise=np.floor(noise * 2.0**shift).astype(np.int64),
    )


def spots(given: dict[str, int], count: int, salt: int) -> Cases:
    """Return spots of every width and place, on slopes, with rivals, cut at a share of the peak."""
    draw = generator(salt)
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top = (1 << pixel_width) - 1
    place = np.arange(length)
    lines = np.zeros((count, length))
    left, width = np.zeros((2, count), np.int64)
    background, noise = np.zeros((2, count))
    widest = min(given["MaxWindow"], length)
    for k in range(count):
        background[k] = draw.uniform(0.01, 0.3) * top
        noise[k] = 10 ** draw.uniform(-4, -1.5) * top
        height = 10 ** draw.uniform(-1.5, 0.3) * top
        sigma = 10 ** draw.uniform(-0.3, math.log10(widest / 3.4))
        centre = draw.choice([draw.uniform(-1, length)] * 3 + [2.0, length - 4.0])
        line = background[k] + height * np.exp(-0.5 * ((place - centre) / sigma) ** 2)
        line += draw.choice([0, 0, 1, -1]) * draw.random() * top / length * (place - centre)
        if draw.random() < 0.4:
            rival = centre + draw.choice([-1, 1]) * sigma * draw.uniform(4, 12)
            line += draw.random() * height * np.exp(-0.5 * ((place - rival) / sigma) ** 2)
        line += noise[k] * draw.standard_normal(length)
        lines[k] = np.clip(np.round(line), 0, top)
        peak = int(np.clip(round(centre), 0, length - 1))
        above = lines[k] > background[k] + draw.uniform(0.05, 0.6) * (
            lines[k].max() - background[k]
        )
        begin = end = peak
        while begin > 0 and above[begin - 1] and peak - begin < widest // 2 - 2:
            begin -= 1
        while end < length - 1 and above[end + 1] and end - peak < widest // 2 - 2:
            end += 1
        begin = max(0, min(begin, length - 3))
        left[k], width[k] = begin, max(3, end - begin + 1)
        inside = slice(begin, begin + width[k])
        lines[k, inside] = np.maximum(lines[k, inside], np.ceil(background[k]))
    return measured(lines, left, width, background, noise, pixel_width)


def extremes(given: dict[str, int], count: int, salt: int) -> Cases:
    """Return harmonics at random over their ranges, on lines of nothing but noise, dark or full."""
    draw = generator(salt)
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top = (1 << pixel_width) - 1
    shift = pkg.COUNT_WIDTH - pixel_width
    lines = draw.integers(0, top + 1, (count, length))
    lines[::4] = top
    lines[1::4] = np.where(
        np.arange(length) < draw.integers(0, length, (len(lines[1::4]), 1)), 0, top
    )
    lines[2::8] = 0
    width = draw.integers(3, min(given["MaxWindow"], length) + 1, count)
    width[:8] = 3
    left = np.floor(draw.random(count) * (length - width + 1)).astype(np.int64)
    left[::3] = draw.choice([0, 1], len(left[::3]))
    left[1::3] = (length - width - draw.integers(0, 2, count))[1::3].clip(0)
    total = draw.integers(1, width * (1 << pkg.ALIGNED_WIDTH))
    most = np.where(np.arange(count) % 8 == 5, 4.2, 1.05)  # beyond the table's end, and in it
    maximum = lines.max(axis=1).astype(np.int64)
    return Cases(
        lines=lines.astype(np.uint16),
        left=left,
        width=width,
        phase=draw.integers(0, 1 << pkg.ANGLE_WIDTH, count) | draw.choice([0, 0xFFFFFF], count),
        magnitude=(draw.random(count) * most * total * 13813603).astype(np.int64),
        sum=total,
        maximum=maximum,
        background=(draw.random(count) * (maximum << shift)).astype(np.int64),
        noise=((1 << draw.integers(0, 24, count)) - 1) >> draw.integers(0, 24, count),
    )


async def send(dut, cases: Cases, kappa: int) -> Refined:
    """Send windows one after the other, play the ring, and compare results and latencies."""
    given = parameters()
    length = given["LineLength"]
    want = cases.refined(given, kappa)
    dut.kappa_i.value = kappa
    got: dict[str, list[int]] = {name: [] for name in OUTPUTS}
    for row, line in enumerate(cases.lines):
        # What stands in the ring beside the line is not to be used.
        ring = np.full(RING, (1 << given["PixelWidth"]) - 1)
        middle = int(cases.left[row])
        for index in range(max(0, middle - 400), min(length, middle + 600)):
            ring[index % RING] = line[index]
        for name in ("maximum", "background", "noise", "left"):
            getattr(dut, f"{name}_i").value = int(getattr(cases, name)[row])
        dut.start_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.start_i.value = 0
        for _ in range(START_LATENCY - 1):
            assert dut.valid_o.value == 0
            await FallingEdge(dut.clk_i)
        for name in ("width", "phase", "magnitude", "sum"):
            getattr(dut, f"{name}_i").value = int(getattr(cases, name)[row])
        dut.valid_i.value = 1
        asked = before = 0
        for cycle in range(1, latency() + 1):
            asked, before = before, as_integer(dut.read_index_o, signed=False)
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
            dut.read_pixel_i.value = int(ring[asked])
            assert int(dut.valid_o.value) == (cycle == latency()), f"window {row}, cycle {cycle}"
        assert dut.reading_o.value == 0
        for name, signed in OUTPUTS.items():
            got[name].append(as_integer(getattr(dut, f"{name}_o"), signed=signed))
        right = as_integer(dut.right_o, signed=False)
        assert right == want.left[row] + want.width[row] - 1, f"window {row}"
        assert int(dut.at_edge_o.value) == (want.left[row] == 0 or right == length - 1)
    inputs = {name: getattr(cases, name) for name in ("left", "width", "phase", "noise")}
    assert_equal(
        {name: np.array(values) for name, values in got.items()},
        {name: getattr(want, name) for name in OUTPUTS},
        inputs,
    )
    return want


@cocotb.test()
async def spots_of_every_width(dut) -> None:
    """Spots, slopes and rivals anywhere on the line; every rung of the ladder comes up."""
    given = parameters()
    await reset(dut)
    cases = spots(given, 120, 1)
    want = await send(dut, cases, kappa_register(given["PixelWidth"]))
    assert (want.slope > 0).any() and (want.slope < 0).any()
    assert (want.left == 0).any() and (want.left + want.width == given["LineLength"]).any()


@cocotb.test()
async def ends_of_the_ranges(dut) -> None:
    """Harmonics that no window has, noise from nothing to full scale, kappa at its ends."""
    given = parameters()
    await reset(dut)
    for salt, kappa in ((2, 0), (3, (1 << pkg.KAPPA_WIDTH) - 1), (4, 3277)):
        want = await send(dut, extremes(given, 48, salt), kappa)
        assert want.width.min() == 3
        assert want.width.max() >= min(given["MaxWindow"], given["LineLength"])


@cocotb.test()
async def ladder_at_its_limits(dut) -> None:
    """A ratio on a limit belongs below it."""
    given = parameters()
    await reset(dut)
    shift = pkg.COUNT_WIDTH - given["PixelWidth"]
    length = given["LineLength"]
    # 16 noise**2 against kappa height: 1, 5/16 and 5/64 of 2**20 and one step of noise beside.
    roots = [256, 257, *(math.isqrt(int(2**16 * r)) + d for r in (5 / 16, 5 / 64) for d in (0, 1))]
    count = len(roots)
    lines = np.zeros((count, length), np.int64)
    lines[:, 30:43] = 16
    cases = measured(
        lines, np.full(count, 30), np.full(count, 13), np.zeros(count), np.zeros(count), 12
    )
    cases = replace(
        cases,
        magnitude=np.full(count, 516 << 31),  # the middle of an entry of the table
        sum=np.full(count, 1 << 17),
        noise=np.array(roots),
        background=np.full(count, (16 << shift) - (1 << 10)),
    )
    want = await send(dut, cases, 1 << 10)
    exact = np.square(np.array(roots)) / 2**16
    sigmas = np.select([exact <= 5 / 64, exact <= 5 / 16, exact <= 1], [6.75, 6.5, 5.5], 5.0)
    assert set(sigmas) == {6.75, 6.5, 5.5, 5.0}
    wanted = np.round(13 * sigma_by_quadrature(516 * 2**14 / SHARE_ONE) * sigmas)
    assert set(wanted) == {14, 13, 11, 10}
    assert want.width.tolist() == wanted.tolist()


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """A reset at any moment: nothing comes out, and the next window is right."""
    given = parameters()
    await reset(dut)
    cases = spots(given, 1, 6)
    for age in range(1, START_LATENCY + latency(), 13):
        dut.start_i.value = 1
        for cycle in range(age):
            dut.valid_i.value = int(cycle == START_LATENCY)
            await FallingEdge(dut.clk_i)
            dut.start_i.value = 0
        dut.rst_i.value = dut.valid_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = dut.valid_i.value = 0
        for _ in range(5):
            assert dut.valid_o.value == 0 and dut.reading_o.value == 0, f"reset at age {age}"
            await FallingEdge(dut.clk_i)
        await send(dut, cases, kappa_register(given["PixelWidth"]))


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_peak_refine_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("peak_refine", __file__, widths)


GIVEN = ELABORATIONS[0]


def gaussian(centre: float, sigma: float, height: float) -> np.ndarray:
    return height * np.exp(-0.5 * ((np.arange(2048) - centre) / sigma) ** 2)


def one(line: np.ndarray, left: int, width: int, noise: float = 3.0) -> Refined:
    """Return the second window of one line on a background of 60 counts."""
    pixels = np.clip(np.round(line + 60.0), 0, 4095)[None]
    cases = measured(
        pixels, np.array([left]), np.array([width]), np.array([60.0]), np.array([noise]), 12
    )
    return cases.refined(GIVEN, kappa_register(12))


def slope_of(refined: Refined) -> float:
    """Return the slope in counts of 12 bits a px."""
    aligned = 1 << (pkg.ALIGNED_WIDTH - 12)
    return float(refined.slope[0]) / aligned / (1 << pkg.RAMP_FRACTION)


def test_peak_refine_model_is_the_float_rule() -> None:
    """Windows within the table's step of those of float64; where they agree, slopes within a step.

    An entry of the table stands for 8 of 843 steps of the share, and is right in its middle: half
    an entry away sigma is off by less than 3 %, so is the width, and the ends by half of that and
    a pixel for each of two roundings.
    """
    cases = spots(GIVEN, 600, 5)
    got = cases.refined(GIVEN, kappa_register(12))
    scale = 2.0 ** (pkg.COUNT_WIDTH - 12)
    position = cases.left + cases.phase / 2**pkg.ANGLE_WIDTH * cases.width
    share = cases.magnitude / (13813603.0 * cases.sum)
    height = cases.maximum - cases.background / scale
    want = ideal.second_windows(
        cases.lines,
        left=cases.left,
        width=cases.width,
        position=position,
        share=share,
        rho=np.square(cases.noise / scale) / (KAPPA * height),
        noise=cases.noise / scale,
        max_window=255,
    )
    box = float(ideal.harmonic_share(np.array([1.0]))[0])
    clear = np.abs(share - box) > 0.01  # of the limit between a plateau and a spot
    assert clear.mean() > 0.9
    assert (np.abs(got.width - want.width) <= 0.03 * want.width + 1)[clear].all()
    assert (np.abs(got.left - want.left) <= 0.015 * want.width + 2)[clear].all()
    same = (got.left == want.left) & (got.width == want.width)
    assert same.mean() > 0.5
    step = 2.0**-pkg.RAMP_FRACTION / 16
    assert np.abs(got.slope * step - want.slope)[same].max() <= 0.51 * step
    middle = got.ramp + got.slope * (got.width - 1) / 2
    assert np.abs(middle).max() <= 1


@pytest.mark.parametrize("sigma", [1.0, 3.0, 12.0])
@pytest.mark.parametrize("rise", [-1.0, 0.25, 1.0])
def test_a_slope_is_found_beside_a_spot(sigma: float, rise: float) -> None:
    width = 2 * round(1.6 * sigma) + 1
    left = 1000 - width // 2
    ramp = 200.0 + rise * (np.arange(2048) - 1000)
    got = one(gaussian(1000.2, sigma, 800.0) + np.clip(ramp, 0, None), left, width)
    assert slope_of(got) == pytest.approx(rise, abs=0.02)


def test_a_rival_in_a_side_does_not_tilt() -> None:
    """A rival as wide as the spot, anywhere from 6 sigmas on: far less than what it would be."""
    for place in range(1020, 1110, 5):
        spot = gaussian(1000.2, 3.0, 1500.0)
        got = one(spot + gaussian(place, 3.0, 600.0), 995, 11)
        plain = 600.0 * 3.0 * math.sqrt(2 * math.pi) / 64 / 95  # all of it in one mean
        assert abs(slope_of(got)) < plain / 4, place


def test_the_sensors_end_leaves_the_pairs_that_are_whole() -> None:
    ramp = 1.0 * np.arange(2048)
    ramp[ramp > 1000] = 1000
    width = 11
    for centre in (60, 40, 30):
        got = one(gaussian(centre + 0.3, 3.0, 2000.0) + ramp, centre - 5, width)
        assert slope_of(got) == pytest.approx(1.0, abs=0.03), centre
    got = one(gaussian(12.3, 3.0, 2000.0) + ramp, 7, width)  # no room for a block of 16
    assert got.slope[0] == 0


def test_a_plateau_keeps_its_middle() -> None:
    """Nothing but full scale in the first window: the second one lies around it."""
    line = np.zeros(2048)
    line[500:520] = 4095
    line[499] = line[520] = 900
    got = one(line, 500, 20)
    assert got.left[0] + (got.width[0] - 1) / 2 == pytest.approx(509.5, abs=0.5)
    assert got.width[0] > 40


def test_every_entry_of_the_table_is_the_sigma_by_quadrature() -> None:
    """To nearest, in the middle of its shares, from that of a line to that of a plateau."""
    table = sigma_table()
    steps = 4.0 + 8.0 * np.arange(128)
    want = 512 * np.array([sigma_by_quadrature(step * 2**14 / SHARE_ONE) for step in steps])
    assert want.min() == 51.2 and want.max() == 256.0
    assert len(np.unique(want)) > 70
    assert np.abs(table - want).max() <= 0.5 + 1e-3


def test_the_equations_invert_the_same_share() -> None:
    sigma = np.linspace(0.101, 0.499, 50)
    share = np.array([share_by_quadrature(each) for each in sigma])
    assert np.abs(ideal.sigma_share(share) / sigma - 1).max() < 1e-4


@pytest.mark.parametrize("width", [32, 51, 76])
def test_a_gaussian_gets_the_window_of_its_sigma(width: int) -> None:
    """A spot of pixels in its first window, no noise: 6.75 sigmas, within an entry of the table.

    The quotient is an integer below the share, an entry half of 8 of its steps away: 5 at most.
    """
    given = {"LineLength": 2048, "PixelWidth": 16, "MaxWindow": 255}
    step = 5 * 2**14 / SHARE_ONE
    share = np.linspace(0.05, 0.49, 60)  # below 0.1: the least
    left = 1000
    centre = left + (width - 1) / 2
    lines = np.array([np.round(gaussian(centre, s * width, 60_000.0)) for s in share])
    zeros = np.zeros(len(share))
    cases = measured(lines, np.full(len(share), left), np.full(len(share), width), zeros, zeros, 16)
    got = cases.refined(given, kappa_register(16))
    exact = np.array([share_by_quadrature(max(s, 0.1)) for s in share])
    for sign, end in ((-1, exact + step), (1, exact - step)):
        sigma = width * np.array([sigma_by_quadrature(each) for each in end])
        most = 6.75 * (sigma + sign * width / 1024) + sign * 0.5
        beyond = sign * (got.width - most)
        assert (beyond <= 0).all(), share[beyond > 0]
    assert np.abs(2 * got.left + got.width - 1 - 2 * centre).max() <= 1
