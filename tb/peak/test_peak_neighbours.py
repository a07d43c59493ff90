"""peak_neighbours: RTL against the model exactly, the model against spots that an edge cuts."""

import math
from dataclasses import dataclass
from fractions import Fraction

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    as_integer,
    assert_equal,
    drive,
    each,
    generator,
    parameters,
    reset,
    rounds,
    simulate,
)

from vrscan.data import pkg
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.peak_neighbours import LATENCY, Beside, peak_neighbours
from vrscan.ideal import peak_neighbours as ideal

ELABORATIONS = [
    {"LineLength": 2048, "NeighbourClks": 1000, "UserWidth": 20},
    {"LineLength": 300, "NeighbourClks": LATENCY + 10, "UserWidth": 3},
]
ALONE = divide_latency(32) + 2  # clocks that a line takes that has none before it
GIVEN = ("measured", "position", "sigma", "scale", "light", "power")
OUTPUTS = ("sigma", "typical", "doubt", "mixed", "user")
ONE = 1 << pkg.POSITION_FRACTION


def rows_of_spots(count: int, salt: int) -> dict[str, np.ndarray]:
    """Return lines of a surface that changes slowly and has edges, and lines of anything.

    Widths, places and lights are often those of a limit: 9/8 and a quarter, whole widths.
    """
    draw = generator(salt)
    length = parameters()["LineLength"]
    jump = np.where(draw.random(count) < 0.2, draw.normal(0, length / 4, count), 0)
    step = np.round(jump + draw.normal(0, 5, count))
    position = (length / 2 + np.cumsum(step)) % (length - 1)
    width = 10 ** draw.uniform(-0.3, 0.3, count) * draw.choice([2.0, 2.0, 2.2, 5.0], count)
    width = np.where(draw.random(count) < 0.5, draw.choice([3.0, 3.0, 3.375], count), width)
    light = 10 ** draw.uniform(-1.5, 0.0, count) * (1 << 20)
    light = np.where(draw.random(count) < 0.5, 1 << draw.choice([20, 20, 18], count), light)
    given = {
        "measured": draw.random(count) < 0.85,
        "position": np.round(position * ONE),
        "sigma": np.round(10 ** draw.uniform(-2.5, 0.0, count) * ONE),
        "scale": np.round(width * ONE),
        "light": np.round(light),
        "power": draw.choice([65535, 65535, 20000, 1000, 0], count),
    }
    # Every number from its range, in runs of lines.
    anything = np.repeat(draw.random(-(-count // 8)) < 0.3, 8)[:count]
    ranges = {"sigma": 16, "scale": 18, "light": 24, "power": 16}
    limit = length * ONE
    for name, bits in ranges.items():
        wild = draw.integers(0, 1 << bits, count) >> draw.integers(0, bits + 1, count)
        wild = np.where(draw.random(count) < 0.2, (1 << bits) - 1, wild)
        given[name] = np.where(anything, wild, given[name])
    given["position"] = np.where(anything, draw.integers(-limit, limit, count), given["position"])
    return {name: column.astype(np.int64) for name, column in given.items()}


def model(given: dict[str, np.ndarray], breaks: list[int]) -> Beside:
    """Return the twin's answer."""
    columns = {name: given[name] for name in GIVEN if name != "measured"}
    return peak_neighbours(measured=given["measured"] == 1, **columns, breaks=breaks)


async def send(
    dut, given: dict[str, np.ndarray], gaps: np.ndarray, wait: int, flush: int | None = None
) -> list[tuple[int, dict[str, int]]]:
    """Send each line ``gaps`` clocks behind the one before; return clocks and answers."""
    count, got, cycle, due, line = len(gaps), [], 0, 0, 0
    while cycle < due + wait:
        come = line < count and cycle == due
        drive(dut.valid_i, int(come))
        drive(dut.flush_i, int(flush is not None and cycle >= flush))
        if come:
            for name in GIVEN:
                drive(getattr(dut, f"{name}_i"), int(given[name][line]))
            drive(dut.user_i, line)
            line += 1
            due += int(gaps[line]) if line < count else 0
        await FallingEdge(dut.clk_i)
        cycle += 1
        if dut.valid_o.value:
            got.append((cycle, {n: as_integer(getattr(dut, f"{n}_o")) for n in OUTPUTS}))
    return got


def row(**changes: object) -> dict[str, np.ndarray]:
    """Return five equal spots in a row, 50 px apart, with some columns changed."""
    given = {
        "measured": np.ones(5, np.int64),
        "position": (np.arange(5) * 50 + 300) * ONE,
        "sigma": np.full(5, ONE // 10),
        "scale": np.full(5, 3 * ONE),
        "light": np.full(5, 1 << 20),
        "power": np.full(5, 1 << 15),  # a light over it has no remainder
    }
    for name, value in changes.items():
        given[name] = np.array(value, np.int64)
    return given


@dataclass(frozen=True)
class Side:
    """Five spots, the middle one on one side of a limit, and whether that makes it mixed."""

    mixed: bool
    given: dict[str, np.ndarray]
    breaks: tuple[int, ...] = ()


def moved(px: float, apart: int = 50) -> np.ndarray:
    """Return the places of five spots in a row whose middle one has left it."""
    position = (np.arange(5) * apart + 300) * ONE
    position[2] += round(px / 2 * ONE)  # a bend is twice as much
    return position


def lights(middle: int, behind: int) -> list[int]:
    """Return five lights, those of the middle spot and of the one behind it changed."""
    return [LIGHT, LIGHT, middle, behind, LIGHT]


def widths(*eighths: int) -> np.ndarray:
    """Return widths that are given in eighths of a px."""
    return np.array(eighths) * (ONE // 8)


def around(share: Fraction) -> list[tuple[bool, int]]:
    """Return lights below a share, at it and above it, and whether that is below."""
    limit = LIGHT * share.numerator // share.denominator
    return [(True, limit - LITTLE), (False, limit), (False, limit + LITTLE)]


WIDTH = 3.0  # px
STEP = 2 / ONE  # the least that a bend grows by
LIGHT = 1 << 20
LITTLE = 500  # of a light
FAR = moved(40)
FAIR = LIGHT * 15 // 16 - LITTLE


def faint_spots() -> list[Side]:
    """Less than 1/4 of the light and than half of each light, of any width, in the row."""
    other = widths(37, 37, 24, 37, 37)
    faint = LIGHT // 4 - LITTLE
    return [
        *(Side(less, row(light=lights(light, LIGHT), scale=other))
          for less, light in around(Fraction(1, 4))),
        Side(True, row(light=lights(faint, LIGHT), scale=other), (3,)),
        Side(True, row(light=lights(faint, 2 * faint + LITTLE), scale=other)),
        Side(False, row(light=lights(faint, 2 * faint), scale=other)),
        Side(False, row(light=lights(faint, 2 * faint - LITTLE), scale=other)),
        Side(True, row(light=[LIGHT, 2 * faint + LITTLE, faint, LIGHT, LIGHT], scale=other)),
        Side(False, row(light=[LIGHT, 2 * faint, faint, LIGHT, LIGHT], scale=other)),
    ]  # fmt: skip


def single_spots() -> list[Side]:
    """Less than 5/16 of the light, of any width, beside a line without a spot on either side."""
    other = widths(15, 15, 24, 15, 15)
    return [
        *(Side(less, row(light=lights(light, LIGHT), scale=other, measured=there))
          for less, light in around(Fraction(5, 16))
          for there in ([1, 0, 1, 1, 1], [1, 1, 1, 0, 1])),
        Side(False, row(light=lights(1, LIGHT), measured=[1, 0, 1, 0, 1])),
    ]  # fmt: skip


def dim_spots() -> list[Side]:
    """Less than 7/16 of it and than half of each, as wide as the brighter one, within 9/8."""
    dim, less = LIGHT * 7 // 16 - LITTLE, LIGHT * 15 // 16
    before, behind = lights(dim, less), [LIGHT, less, dim, LIGHT, LIGHT]
    return [
        *(Side(below, row(light=lights(light, less))) for below, light in around(Fraction(7, 16))),
        Side(True, row(light=before, scale=widths(24, 27, 24, 30, 30))),
        Side(False, row(light=before, scale=widths(24, 28, 24, 24, 24))),
        Side(True, row(light=before, scale=widths(24, 22, 24, 24, 24))),
        Side(False, row(light=before, scale=widths(24, 21, 24, 24, 24))),
        Side(True, row(light=behind, scale=widths(24, 30, 24, 27, 24))),
        Side(False, row(light=behind, scale=widths(24, 24, 24, 28, 24))),
        Side(False, row(light=behind, scale=widths(24, 24, 24, 21, 24))),
        Side(False, row(light=lights(dim, 2 * dim - LITTLE))),
    ]


def akin_spots() -> list[Side]:
    """Less than 1/4 of it, about as wide as the brighter one, within 3/2, in the row."""

    def cut(light: int, *scale: int, turned: bool = False) -> dict[str, np.ndarray]:
        given = [LIGHT, LIGHT, light, light, light]
        return row(light=given[::-1] if turned else given, scale=widths(*scale))

    faint = LIGHT // 4 - LITTLE
    return [
        *(Side(less, cut(light, 24, 24, 24, 24, 24)) for less, light in around(Fraction(1, 4))),
        Side(True, cut(faint, 24, 36, 24, 48, 48)),
        Side(False, cut(faint, 37, 37, 24, 24, 24)),
        Side(True, cut(faint, 24, 16, 24, 48, 48)),
        Side(False, cut(faint, 24, 15, 24, 24, 24)),
        Side(True, cut(faint, 48, 48, 24, 36, 24, turned=True)),
        Side(False, cut(faint, 24, 24, 24, 37, 37, turned=True)),
    ]


def stray_spots() -> list[Side]:
    """Narrower than both, out of the row by four widths and a quarter of what is between them."""
    width = widths(28, 28, 24, 28, 28)
    return [
        Side(astray, row(light=lights(LIGHT // 2, LIGHT), scale=width, position=moved(*place)))
        for px, apart in ((25, 50), (-25, 50), (25, -50), (4 * WIDTH, 2), (-4 * WIDTH, -2))
        for astray, place in (
            (False, (px, apart)), (True, (px + math.copysign(STEP, px), apart)),
        )
    ]  # fmt: skip


def dark_spots() -> list[Side]:
    """Less than 1/8 of it, and no more than one neighbour's, out of the row."""

    def off(light: int, **changes: object) -> dict[str, np.ndarray]:
        lit = [LIGHT, LIGHT, light, light, light]
        return row(light=lit, scale=widths(15, 15, 24, 15, 15), **changes)

    return [
        *(Side(less, off(light, position=FAR)) for less, light in around(Fraction(1, 8))),
        Side(False, off(LIGHT // 8 - LITTLE)),
    ]


def narrow_spots(limit: Fraction | None, wide: int, *, one_tells: bool) -> list[Side]:
    """Astray, below a share of the light or with any, narrower than neighbours of ``wide`` eighths.

    An eighth less of either is not enough. ``one_tells``: whether one neighbour is, beside none.
    """
    share, width = limit or Fraction(3), widths(wide, wide, 24, wide, wide)
    bright = lights(LIGHT * share.numerator // share.denominator - LITTLE, LIGHT)
    lit = [(True, 3 * LIGHT)] if limit is None else around(limit)
    others = (
        (wide, wide - 1, 24, wide, wide),
        (wide, wide, 24, wide - 1, wide),
        (15, 15, 24, 15, 15),
    )
    return [
        *(Side(less, row(light=lights(light, LIGHT), scale=width, position=FAR))
          for less, light in lit),
        Side(False, row(light=bright, scale=width)),
        *(Side(False, row(light=bright, scale=widths(*each), position=FAR)) for each in others),
        *(Side(one_tells, row(light=bright, scale=width, measured=there))
          for there in ([1, 0, 1, 1, 1], [1, 1, 1, 0, 1])),
        Side(False, row(light=bright, scale=width, measured=[1, 0, 1, 0, 1])),
    ]  # fmt: skip


def thin_spots() -> list[Side]:
    """Astray, below 15/16 of the light, narrower than both by 17/16 and than one by 5/3."""

    def beside(one: int, other: int, light: int = FAIR, **changes: object) -> dict[str, np.ndarray]:
        scale = widths(60, one, 48, other, 60)
        return row(**{"light": lights(light, LIGHT), "scale": scale, "position": FAR} | changes)

    return [
        *(Side(less, beside(52, 81, light)) for less, light in around(Fraction(15, 16))),
        *(Side(True, beside(*each)) for each in ((52, 81), (81, 52))),
        *(Side(False, beside(*each)) for each in ((51, 81), (81, 51), (52, 80), (80, 52))),
        *(Side(False, beside(*each, position=moved(0))) for each in ((52, 81), (81, 52))),
        Side(False, beside(81, 70, measured=[1, 0, 1, 1, 1])),
        Side(False, beside(70, 81, measured=[1, 1, 1, 0, 1])),
    ]


SIDES = [
    *faint_spots(), *single_spots(), *dim_spots(), *akin_spots(), *dark_spots(), *stray_spots(),
    *thin_spots(),
    *narrow_spots(Fraction(11, 16), 28, one_tells=False),
    *narrow_spots(Fraction(9, 8), 37, one_tells=True),
    *narrow_spots(None, 43, one_tells=True),
]  # fmt: skip


@cocotb.test()
async def a_flush_ends_the_wait(dut) -> None:
    """Before the last line comes, with it, while it is worked on, and while it waits."""
    await reset(dut)
    given = rows_of_spots(4, 3)
    gaps = np.full(4, LATENCY + 1)
    want = model(given, [])
    last = int(gaps[1:].sum())
    for flush in (last - 1, last, last + 1, last + LATENCY, last + LATENCY + 40):
        # Of the last one alone, whose own neighbour has gone: the user of flush_i sees to that.
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        got = await send(dut, given, gaps, 3 * LATENCY + 60, flush)
        assert len(got) == 4
        for k, (_, answer) in enumerate(got):
            assert answer["sigma"] == want.sigma[k] and answer["doubt"] == want.doubt[k], (flush, k)
        assert got[-1][0] <= max(flush, last) + 2 * LATENCY + 8
    drive(dut.flush_i, 0)


async def compare(dut, given: dict[str, np.ndarray], gaps: np.ndarray) -> Beside:
    """Send lines and compare all answers and their clocks."""
    limit = parameters()["NeighbourClks"]
    come = np.cumsum(gaps) - gaps[0]
    # A line that comes while the one before it is given late waits for that.
    taken, breaks, due = [0], [], []
    idle = ALONE
    for k in range(1, len(gaps)):
        late = taken[-1] + limit
        if come[k] > late:
            breaks.append(k)
            due.append(late + LATENCY)
            taken.append(max(int(come[k]), due[-1]))
            idle = taken[-1] + ALONE
        else:
            taken.append(max(int(come[k]), idle))
            due.append(taken[-1] + LATENCY)
            idle = due[-1]
    due.append(taken[-1] + limit + LATENCY)
    want = model(given, breaks)
    got = await send(dut, given, gaps, limit + 2 * LATENCY + 20)
    assert [clock for clock, _ in got] == due
    answers = {name: np.array([each[name] for _, each in got]) for name in OUTPUTS}
    user = np.arange(len(gaps)) & (1 << parameters()["UserWidth"]) - 1
    expected = {
        "sigma": want.sigma, "typical": want.typical, "doubt": want.doubt,
        "mixed": want.mixed.astype(np.int64), "user": user,
    }  # fmt: skip
    assert_equal(answers, expected, given)
    return want


@cocotb.test()
async def lines_in_a_row(dut) -> None:
    """Lines as close as fits are, after a reset; each kind of answer comes."""
    await reset(dut)
    count = rounds(200, 2000)
    given = rows_of_spots(count, 1)
    want = await compare(dut, given, np.full(count, LATENCY + 1))
    measured = given["measured"] == 1
    assert 0.02 < want.mixed.mean() < 0.5
    assert np.count_nonzero(want.doubt) > 0 and np.any(measured & (want.doubt == 0))


@cocotb.test()
async def lines_apart(dut) -> None:
    """Gaps up to the limit, at it, and beyond it, where lines are no neighbours."""
    draw = generator(2)
    limit = parameters()["NeighbourClks"]
    await reset(dut)
    count = rounds(40, 300)
    near = [limit - 1, limit, limit + 1, limit + 5, limit + LATENCY, limit + 2 * LATENCY, 3 * limit]
    gaps = draw.choice([LATENCY + 1, LATENCY + 7, *near, *near], count)
    await compare(dut, rows_of_spots(count, 3), gaps)


async def forgotten(dut) -> None:
    """Reset for a clock with every strobe; the few clocks behind it show what is left of one."""
    strobes = dut.rst_i, dut.valid_i, dut.flush_i
    for value, clocks in ((1, 1), (0, 3)):
        for strobe in strobes:
            drive(strobe, value)
        for _ in range(clocks):
            await FallingEdge(dut.clk_i)


@cocotb.test()
async def what_passes_changes_with_the_first_result(dut) -> None:
    """A clock behind the doubt, and not before."""
    await reset(dut)
    light = np.array([2, 2, 2, 2, 1]) * LIGHT
    given = row(scale=np.array([3, 4, 6, 9, 14]) * ONE, light=light)
    assert np.all(np.diff(model(given, []).doubt))
    seen: list[tuple[int, int]] = []

    async def watch() -> None:
        while True:
            await FallingEdge(dut.clk_i)
            seen.append((as_integer(dut.doubt_o), as_integer(dut.user_o)))

    watching = cocotb.start_soon(watch())
    await compare(dut, given, np.full(5, LATENCY + 1))
    watching.cancel()
    doubts, users = (np.flatnonzero(np.diff(column))[-4:] for column in np.array(seen).T)
    assert np.array_equal(users, doubts + 1)


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """A reset at any moment: nothing comes out, and the next lines have no neighbour before.

    It is as long as a clock, in which a line and a flush come.
    """
    await reset(dut)
    given = rows_of_spots(3, 4)
    gaps = np.array([0, ALONE, LATENCY + 1])  # as close as they may be
    for age in range(1, 3 * LATENCY, rounds(37, 5)):
        for cycle in range(age):
            drive(dut.valid_i, int(cycle % (LATENCY + 1) == 0))
            await FallingEdge(dut.clk_i)
        await forgotten(dut)
        await compare(dut, given, gaps)
        await reset(dut)


@cocotb.test()
async def both_sides_of_every_limit(dut) -> None:
    """Spots that are mixed by the least that counts, and spots that are not."""
    limit = parameters()["NeighbourClks"]
    for side in SIDES:
        await reset(dut)
        gaps = np.full(5, LATENCY + 1)
        gaps[list(side.breaks)] = limit + 1
        await compare(dut, side.given, gaps)


@EACH_VOLUME
@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_peak_neighbours_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("peak_neighbours", __file__, widths, volume=volume)


def test_equal_spots_in_a_row_have_no_doubt() -> None:
    """Whatever power each line had; the row's ends have one neighbour and no less light."""
    power = np.array([50_000, 25_000, 50_000, 10_000, 50_000])
    got = model(row(power=power, light=20 * power), [])
    assert not got.doubt.any() and not got.mixed.any()
    assert np.array_equal(got.sigma, row()["sigma"])


def test_a_width_may_differ_with_the_distance_of_the_lines() -> None:
    """By 1/256 of it and by its noise; a quarter of what is beyond is the doubt."""
    sigma, turned = ONE // 10, 50 * ONE // 256
    noise = 4 * sigma**2 + ONE**2 // 32
    within = math.isqrt(noise)
    for beyond in (0, within, within + 1, 5 * sigma):
        for sign in (-1, 1):
            scale = np.array([3, 3, 3, 3, 3]) * ONE
            scale[2] += sign * (turned + beyond)
            got = model(row(scale=scale), []).doubt
            want = round(math.sqrt(max(beyond**2 - noise, 0) // 16))
            assert got.tolist() == [0, want, want, want, 0]


def in_float(given: dict[str, np.ndarray], breaks: list[int]) -> ideal.Beside:
    """Return what the equations say of the twin's numbers."""
    px = {name: given[name] / ONE for name in ("position", "sigma", "scale")}
    return ideal.peak_neighbours(
        measured=given["measured"] == 1, light=given["light"] / 1.0, power=given["power"],
        breaks=breaks, **px,
    )  # fmt: skip


def test_a_doubt_is_that_of_the_equations() -> None:
    """To half a step of the root, of the cut and of the turn, over what is left of a doubt."""
    for beyond in (-0.1, 0.0, 0.25, 1.0, 3.0):
        for share in (0.1, 0.4, 0.7, 1.0):
            scale = np.array([3, 3, 3 + beyond + 50 / 256, 3, 3]) * ONE
            given = row(scale=np.round(scale), light=lights(round(LIGHT * share), LIGHT))
            got, want = model(given, []), in_float(given, [])
            for name in ("doubt", "sigma", "typical"):
                error = getattr(got, name) / ONE - getattr(want, name)
                assert np.abs(error).max() < 3 / ONE, (name, beyond, share)


@pytest.mark.parametrize("side", SIDES)
def test_a_spot_is_mixed_by_the_equations_beyond_a_limit(side: Side) -> None:
    want = model(side.given, list(side.breaks)).mixed
    assert in_float(side.given, list(side.breaks)).mixed.tolist() == want.tolist()


@pytest.mark.parametrize("side", SIDES)
def test_a_spot_is_mixed_beyond_a_limit(side: Side) -> None:
    assert model(side.given, list(side.breaks)).mixed.tolist() == [
        False,
        False,
        side.mixed,
        False,
        False,
    ]
