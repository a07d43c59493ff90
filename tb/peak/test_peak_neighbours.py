"""peak_neighbours: RTL against the model exactly, the model against spots that an edge cuts."""

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


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """A reset at any moment: nothing comes out, and the next lines have no neighbour before."""
    await reset(dut)
    given = rows_of_spots(3, 4)
    gaps = np.full(3, LATENCY + 1)
    for age in range(1, 3 * LATENCY, rounds(37, 5)):
        for cycle in range(age):
            drive(dut.valid_i, int(cycle % (LATENCY + 1) == 0))
            await FallingEdge(dut.clk_i)
        drive(dut.valid_i, 0)
        await reset(dut)
        await compare(dut, given, gaps)
        await reset(dut)


@EACH_VOLUME
@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_peak_neighbours_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("peak_neighbours", __file__, widths, volume=volume)


def row(**changes: object) -> dict[str, np.ndarray]:
    """Return five equal spots in a row, 50 px apart, with some columns changed."""
    given = {
        "measured": np.ones(5, np.int64),
        "position": (np.arange(5) * 50 + 300) * ONE,
        "sigma": np.full(5, ONE // 10),
        "scale": np.full(5, 3 * ONE),
        "light": np.full(5, 1 << 20),
        "power": np.full(5, 50_000),
    }
    for name, value in changes.items():
        given[name] = np.array(value, np.int64)
    return given


def test_equal_spots_in_a_row_have_no_doubt() -> None:
    """Whatever power each line had; the row's ends have one neighbour and no less light."""
    power = np.array([50_000, 25_000, 50_000, 10_000, 50_000])
    got = model(row(power=power, light=20 * power), [])
    assert not got.doubt.any() and not got.mixed.any()
    assert np.array_equal(got.sigma, row()["sigma"])


def mixed(**changes: object) -> list[bool]:
    """Return which of five equal spots are mixed where some columns are changed."""
    return model(row(**changes), []).mixed.tolist()


def moved(px: float) -> np.ndarray:
    """Return the places of five spots in a row whose middle one has left it."""
    position = row()["position"]
    position[2] += round(px / 2 * ONE)  # a bend is twice as much
    return position


MIDDLE = [False, False, True, False, False]
NONE = [False] * 5
WIDTH = 3.0  # px
STEP = 2 / ONE  # the least that a bend grows by
LIGHT = 1 << 20


def test_a_faint_spot_is_mixed_out_of_the_row() -> None:
    """Less than a quarter of both lights: beside none, or out of the row by three widths."""
    light = np.full(5, LIGHT)
    light[2] = LIGHT // 4 - 500
    assert mixed(light=light) == NONE
    assert mixed(light=light, position=moved(3 * WIDTH)) == NONE
    assert mixed(light=light, position=moved(3 * WIDTH + STEP)) == MIDDLE
    assert mixed(light=light, measured=[1, 0, 1, 1, 1]) == MIDDLE
    assert model(row(light=light), [3]).mixed.tolist() == MIDDLE
    # Beside one that has less than four times its light it is dark, or a surface's other side.
    light[3] = 4 * light[2] - 500
    assert mixed(light=light, position=moved(4 * WIDTH)) == NONE
    light[2] = LIGHT * 3 // 32 - 500
    light[3] = light[2]
    assert mixed(light=light, position=moved(4 * WIDTH)) == MIDDLE
    light[2] = LIGHT // 4 + 500
    light[3] = LIGHT
    assert mixed(light=light, position=moved(4 * WIDTH)) == NONE


def test_a_dim_spot_is_mixed_far_out_of_the_row() -> None:
    """Less than 5/16 of the light, and as wide as the brighter neighbour, within 9/8."""
    light = np.full(5, LIGHT)
    light[2], light[3] = LIGHT * 5 // 16 - 500, LIGHT // 2
    far = moved(8 * WIDTH + STEP)
    assert mixed(light=light, position=far) == MIDDLE
    assert mixed(light=light, position=moved(8 * WIDTH)) == NONE
    assert mixed(light=light, position=far, scale=np.array([24, 27, 24, 20, 24]) * 512) == MIDDLE
    assert mixed(light=light, position=far, scale=np.array([24, 28, 24, 20, 24]) * 512) == NONE
    assert mixed(light=light, position=far, scale=np.array([24, 21, 24, 24, 24]) * 512) == NONE
    light[2] += 1000
    assert mixed(light=light, position=far) == NONE


def test_a_spot_narrower_than_both_is_mixed_far_out_of_the_row() -> None:
    """Unless it is brighter than both, or beside no spot."""
    width = np.array([28, 28, 24, 28, 28]) * 512
    far = moved(8 * WIDTH + STEP)
    assert mixed(scale=width, position=far) == MIDDLE
    assert mixed(scale=width, position=moved(8 * WIDTH)) == NONE
    assert mixed(scale=np.array([28, 28, 24, 27, 28]) * 512, position=far) == NONE
    assert mixed(scale=np.array([28, 28, 32, 28, 28]) * 512, position=far) == NONE
    assert mixed(scale=width, measured=[1, 1, 1, 0, 1]) == NONE
    light = np.full(5, LIGHT)
    light[2] = LIGHT * 9 // 8 - 500
    assert mixed(scale=width, position=far, light=light) == MIDDLE
    light[2] += 1000
    assert mixed(scale=width, position=far, light=light) == NONE
