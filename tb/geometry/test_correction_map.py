"""correction_map: RTL against the model exactly, the model against bilinear maps in float64."""

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    assert_equal,
    each,
    generator,
    parameters,
    reset,
    reset_at_every_age,
    restart_at_every_age,
    rounds,
    run_vectors,
    simulate,
)
from scanners import EACH_SCANNER

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.fixed.correction_map import (
    COLUMNS,
    LATENCY,
    READ_BACK,
    ROWS,
    Corrected,
    correction_map,
    position_width,
)
from vrscan.ideal.correction_map import correction
from vrscan.ideal.geometry import project, triangle, undistorted

ELABORATIONS = [
    {"LineLength": 2048, "MapCount": 9},
    {"LineLength": 64, "MapCount": 2},
    {"LineLength": 5000, "MapCount": 3},
]
OUTPUTS = {"position_o": True, "saturated_o": False, "filled_o": False}
LIMIT = 1 << pkg.MAP_WIDTH - 1
BEGIN, SHIFT = 1300, 10


def maps(count: int, salt: int) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes of any value, with both ends, and which are filled."""
    draw = generator(salt)
    nodes = draw.integers(-LIMIT, LIMIT, (count, ROWS, COLUMNS))
    nodes[draw.random(nodes.shape) < 0.1] = -LIMIT
    nodes[draw.random(nodes.shape) < 0.1] = LIMIT - 1
    return nodes, draw.random(nodes.shape) < 0.05


def operands(line_length: int, count: int, salt: int) -> dict[str, np.ndarray]:
    """Return places between nodes, on them, and beyond the maps on all sides."""
    draw = generator(salt)
    ends = 1 << position_width(line_length) - 1
    cell = ends // 64
    position = draw.integers(-ends // 8, ends, count)
    nodes = cell * draw.integers(0, 64, count) - draw.integers(0, 2, count)
    position = np.where(draw.random(count) < 0.3, nodes, position)
    angle = draw.integers(-(5 << 18), 5 << 18, count)
    nodes = (draw.integers(-17, 18, count) << 16) - draw.integers(0, 2, count)
    angle = np.where(draw.random(count) < 0.3, nodes, angle)
    angle[:2] = -(1 << 23), (1 << 23) - 1
    position[:2] = -ends, ends - 1
    lens = draw.integers(BEGIN - 500, BEGIN + 5 * (1 << SHIFT), count)
    lens[:2] = 0, 65535
    lens[2:8] = BEGIN + np.arange(6) * (1 << SHIFT)
    return {"position_i": position, "angle_i": angle, "lens_i": lens}


def evaluate(
    given: dict[str, np.ndarray], table: tuple[np.ndarray, np.ndarray], line_length: int
) -> Corrected:
    """Return the model's answer."""
    return correction_map(
        given["position_i"],
        given["angle_i"],
        given["lens_i"],
        nodes=table[0],
        filled=table[1],
        map_begin=BEGIN,
        map_shift=SHIFT,
        line_length=line_length,
    )


def expected(given: dict[str, np.ndarray], table: tuple[np.ndarray, np.ndarray]) -> dict:
    """Return the model's answer by port."""
    found = evaluate(given, table, parameters()["LineLength"])
    return {f"{name}_o": value for name, value in vars(found).items()}


def words_of(table: tuple[np.ndarray, np.ndarray]) -> list[int]:
    """Return maps as they are written."""
    words = (table[0] & (2 * LIMIT - 1)) | table[1].astype(np.int64) << pkg.MAP_WIDTH
    return words.ravel().tolist()


async def write(dut, table: tuple[np.ndarray, np.ndarray], bank: int) -> None:
    """Write maps into a bank."""
    dut.write_i.value, dut.access_bank_i.value = 1, bank
    for index, word in enumerate(words_of(table)):
        dut.index_i.value, dut.value_i.value = index, word
        await FallingEdge(dut.clk_i)
    dut.write_i.value = 0


async def load(dut, table: tuple[np.ndarray, np.ndarray], bank: int = 0) -> None:
    """Write maps into a bank, and use it."""
    dut.map_begin_i.value, dut.map_shift_i.value = BEGIN, SHIFT
    dut.map_count_i.value = len(table[0])
    await write(dut, table, bank)
    dut.bank_i.value, dut.enable_i.value = bank, 1


@cocotb.test()
async def without_maps_nothing_changes(dut) -> None:
    """As it begins: every position comes out as it went in, whatever the memory holds."""
    length, count = parameters()["LineLength"], parameters()["MapCount"]
    given = operands(length, 40, 1)
    zero = np.zeros((count, ROWS, COLUMNS), np.int64), np.zeros((count, ROWS, COLUMNS), np.bool_)
    await reset(dut)
    await load(dut, maps(count, 3))
    dut.enable_i.value = 0
    got = await run_vectors(dut, given, OUTPUTS, latency=LATENCY)
    assert_equal(got, expected(given, zero), given)
    assert np.array_equal(got["position_o"], given["position_i"])


@cocotb.test()
async def random_maps_back_to_back(dut) -> None:
    """Nodes of any value in both banks, places inside and outside."""
    length, count = parameters()["LineLength"], parameters()["MapCount"]
    await reset(dut)
    for bank in (1, 0):
        table = maps(count, 2 + bank)
        await load(dut, table, bank)
        given = operands(length, rounds(400, 4000), 4 + bank)
        want = expected(given, table)
        assert 0.0 < want["filled_o"].mean() < 0.9
        assert want["saturated_o"].any() or length > 4096
        got = await run_vectors(dut, given, OUTPUTS, latency=LATENCY, gaps=bank == 1)
        assert_equal(got, want, given)


@cocotb.test()
async def fewer_maps_than_there_is_room_for(dut) -> None:
    """Beyond the last map it is that one, whatever stands behind it in the bank."""
    await reset(dut)
    await load(dut, maps(parameters()["MapCount"], 8))
    table = maps(2, 9)
    await load(dut, table)
    given = operands(parameters()["LineLength"], 200, 10)
    got = await run_vectors(dut, given, OUTPUTS, latency=LATENCY)
    assert_equal(got, expected(given, table), given)


@cocotb.test()
async def nodes_come_back_while_the_other_bank_corrects(dut) -> None:
    """Every kind of place of both banks; what is written comes back, and disturbs nothing."""
    count, draw = parameters()["MapCount"], generator(12)
    await reset(dut)
    tables = [maps(count, 13 + bank) for bank in (0, 1)]
    await write(dut, tables[0], 0)
    await load(dut, tables[1], 1)
    held = [words_of(each) for each in tables]
    given = operands(parameters()["LineLength"], 80, 15)
    running = cocotb.start_soon(run_vectors(dut, given, OUTPUTS, latency=LATENCY))
    wanted: list[int | None] = []  # of each clock
    for clock in range(rounds(2000, 20000)):
        want = wanted[clock - READ_BACK] if clock >= READ_BACK else None
        assert want is None or int(dut.value_o.value) == want, clock
        written, word = draw.random() < 0.4, int(draw.integers(1 << 18))
        if written or draw.random() < 0.5 or not clock:  # else of what the clock before was
            bank, index = int(not written and draw.random() < 0.6), int(draw.integers(len(held[0])))
            index = (index, 0, len(held[0]) - 1)[int(draw.choice(3, p=(0.9, 0.05, 0.05)))]
        dut.access_bank_i.value, dut.index_i.value = bank, index
        dut.write_i.value, dut.value_i.value = int(written), word
        wanted.append(None if written else held[bank][index])
        if written:
            held[0][index] = word
        await FallingEdge(dut.clk_i)
    dut.write_i.value = 0
    assert_equal(await running, expected(given, tables[1]), given)


@cocotb.test()
async def restarts_and_resets_drop_the_first_position(dut) -> None:
    """A valid_i or a reset at every moment of the work: only the second result comes out."""
    await reset(dut)
    table = maps(parameters()["MapCount"], 6)
    await load(dut, table)
    given = operands(parameters()["LineLength"], 60, 7)
    want = expected(given, table)
    await restart_at_every_age(dut, given, want, OUTPUTS, latency=LATENCY)
    await reset_at_every_age(dut, given, want, OUTPUTS, latency=LATENCY)


@EACH_VOLUME
@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_correction_map_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("correction_map", __file__, widths, volume=volume)


@EACH_SCANNER
def test_correction_map_model_is_bilinear(config: Config) -> None:
    """Against float64 with the same nodes: the bound of the widths in px, and 2 um in z to 1 m."""
    length, draw = config.sensor.line_length, generator(20)
    nodes = (draw.uniform(-1.0, 1.0, (4, ROWS, COLUMNS)) * (LIMIT - 1)).astype(np.int64)
    none = np.zeros(nodes.shape, np.bool_)
    given = operands(length, 200_000, 21)
    given["position_i"] = np.clip(given["position_i"], 0, (length - 1) << 12)
    found = evaluate(given, (nodes, none), length)
    position, angle = given["position_i"] * 2.0**-12, given["angle_i"] * (2.0 * np.pi * 2.0**-24)
    lens = (given["lens_i"] - BEGIN) / (1 << SHIFT)
    exact = correction(position, angle, lens, nodes * 2.0**-10, line_length=length)
    whole = ~found.saturated
    error = np.abs((found.position - given["position_i"]) * 2.0**-12 - exact)[whole]
    floor = 2.0**-13
    # Beyond the last node the share is 1 - 2**-17 of a difference of at most 128 px.
    predicted = floor + 3 * 2.0**-18 + 2 * 128 * 2.0**-17
    inside = (lens < 3.0) & (np.abs(given["angle_i"]) < 1 << 20)
    tight = floor + 3 * 2.0**-18
    print(f"correction, px: measured {error.max():.3g} / predicted {predicted:.3g} / {floor:.3g}")
    assert error.max() <= predicted
    assert error[inside[whole]].max() <= tight
    geometry = config.geometry
    for z in (250.0, 500.0, 1000.0):
        at = project(np.zeros(1), np.full(1, z), geometry)
        u, step = undistorted(at, geometry)
        slope = np.abs(triangle(u, np.zeros(1), geometry).slope * step)[0]
        print(f"z = {z:g} mm: {1e3 * tight * slope:.2f} um of at most 2")
        assert tight * slope <= 2e-3


def test_no_jump_between_maps_and_cells() -> None:
    """A step of angle, position or lens moves the correction by no more than the slope allows."""
    nodes, none = maps(4, 30)
    for name, steps in (("position_i", 1 << 9), ("angle_i", 1 << 12), ("lens_i", 1 << 5)):
        base = {"position_i": 700 << 12, "angle_i": 40_000, "lens_i": BEGIN + 900}
        span = {"position_i": 40 << 12, "angle_i": 1 << 17, "lens_i": 1 << 11}[name]
        at = base[name] + np.arange(0, span, span // steps)
        given = {key: np.full(at.shape, value) for key, value in base.items()} | {name: at}
        found = evaluate(given, (nodes, none), 2048)
        moved = np.abs(np.diff(found.position - given["position_i"])) * 2.0**-12
        cell = {"position_i": 32 << 12, "angle_i": 1 << 16, "lens_i": 1 << SHIFT}[name]
        assert moved.max() <= 128.0 * (span // steps) / cell + 2.0**-11
