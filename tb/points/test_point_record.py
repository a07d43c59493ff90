"""point_record: every byte of the RTL against the model, the model against the layout."""

import cocotb
import numpy as np
from harness import FallingEdge, generator, reset, simulate, struct_ports

from vrscan.data import link_pkg
from vrscan.data.points import Points
from vrscan.data.records import Records, encode_full
from vrscan.fixed.point_record import LATENCY, point_record
from vrscan.registers.structs import POINT, package_struct

SIGNED = ("position", "angle", "x", "z")
ADDED = ("power", "confidence", "inward", "test", "time")


FORMATS = {"pixel_width", "unit_mm"}  # of all points
NAMES = ("line", *(name for name in Points.__dataclass_fields__ if name not in FORMATS), *ADDED)


def random_inputs(draw: np.random.Generator, count: int) -> dict[str, np.ndarray]:
    """Return values of all fields of a point, a third of them the least or the largest."""
    inputs = {}
    for name in dict.fromkeys(NAMES):
        field = package_struct("point_t").fields[POINT.get(name, name)]
        least = -(1 << (field.width - 1)) if field.signed else 0
        most = least + (1 << field.width) - 1
        values = draw.integers(least, most, count, endpoint=True)
        ends = draw.choice([least, most], count)
        inputs[name] = np.where(draw.random(count) < 1 / 3, ends, values)
    for name in ("measured", "inward", "test"):
        inputs[name] = draw.random(count) < 0.5
    inputs["width"][draw.random(count) < 0.3] = 0
    return inputs


def records_of(inputs: dict[str, np.ndarray]) -> Records:
    """Return what the model makes of them."""
    columns = {name: values for name, values in inputs.items() if name not in ADDED}
    return point_record(Points(**columns), **{name: inputs[name] for name in ADDED})


def present(dut, inputs: dict[str, np.ndarray], k: int) -> None:
    """Put a point's values on the port."""
    struct_ports(dut)["point_i"].give(
        {POINT.get(name, name): int(column[k]) for name, column in inputs.items()}
    )


async def give(dut, inputs: dict[str, np.ndarray], k: int) -> None:
    """Give a point for as long as it must stand."""
    present(dut, inputs, k)
    dut.valid_i.value = 1
    await FallingEdge(dut.clk_i)
    dut.valid_i.value = 0
    for _ in range(link_pkg.FULL_BYTES):
        await FallingEdge(dut.clk_i)


async def watch(dut, seen: list[list[tuple[int, int]]]) -> None:
    """Take the bytes of each record and the clock that each comes in."""
    clock = 0
    while True:
        if dut.record_valid_o.value:
            if not dut.record_index_o.value.to_unsigned():
                seen.append([])
            assert dut.record_index_o.value.to_unsigned() == len(seen[-1])
            seen[-1].append((clock, dut.record_o.value.to_unsigned()))
        await FallingEdge(dut.clk_i)
        clock += 1


@cocotb.test()
async def random_points_come_out_byte_for_byte(dut) -> None:
    await reset(dut)
    draw = generator(1)
    inputs = random_inputs(draw, 300)
    wanted = records_of(inputs)
    seen: list[list[tuple[int, int]]] = []
    cocotb.start_soon(watch(dut, seen))
    given, clock = [], 0
    for k in range(len(wanted)):
        given.append(clock)
        await give(dut, inputs, k)
        clock += link_pkg.FULL_BYTES + 1
        # Some points follow each other as closely as they may, others have another's values in
        # between.
        gap = int(draw.choice([0, 0, 1, 2, 90]))
        if gap:
            present(dut, inputs, k - 1)
        for _ in range(gap):
            await FallingEdge(dut.clk_i)
        clock += gap
    for _ in range(LATENCY):
        await FallingEdge(dut.clk_i)
    assert len(seen) == len(wanted)
    for k, record in enumerate(seen):
        want = encode_full(wanted[k : k + 1])
        assert bytes(byte for _, byte in record) == want, {n: int(v[k]) for n, v in inputs.items()}
        first = given[k] + LATENCY
        assert [clock for clock, _ in record] == list(range(first, first + len(want)))


@cocotb.test()
async def reset_ends_a_record(dut) -> None:
    await reset(dut)
    inputs = random_inputs(generator(2), 2)
    for age in (0, 1, 2, 3, 30, 63, 64, 65):
        giving = cocotb.start_soon(give(dut, inputs, 1))
        for _ in range(1 + age):
            await FallingEdge(dut.clk_i)
        giving.cancel()
        dut.rst_i.value = 1
        dut.valid_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = dut.valid_i.value = 0
        for _ in range(70):
            assert not dut.record_valid_o.value
            await FallingEdge(dut.clk_i)


def test_point_record() -> None:
    simulate("point_record", __file__)


# Where a number lies, how long it is, and what it is called.
LAYOUT = [
    (0, 4, "line"), (4, 2, "flags"), (6, 2, "left"), (8, 2, "right"), (10, 2, "maximum"),
    (12, 4, "row_mean"), (16, 4, "row_variance"), (20, 4, "background"), (24, 4, "noise"),
    (28, 2, "snr"), (30, 2, "sigma"), (32, 4, "position"), (36, 4, "angle"), (40, 4, "x"),
    (44, 4, "z"), (48, 2, "sigma_z"), (50, 2, "power"), (52, 1, "c_obj"), (53, 1, "c_sfm"),
    (54, 2, "doubt"), (56, 1, "confidence"), (60, 4, "time"),
]  # fmt: skip


def test_point_record_model_has_the_layout_of_the_link() -> None:
    inputs = random_inputs(generator(3), 200)
    records = records_of(inputs)
    data = encode_full(records)
    assert len(data) == 200 * 64
    for k in range(200):
        record = data[64 * k : 64 * k + 64]
        one = {name: int(values[k]) for name, values in inputs.items()}
        for place, size, name in LAYOUT:
            want = one[name]
            if name in ("position", "sigma", "doubt", "sigma_z") and not one["measured"]:
                want = 0
            if name in ("x", "z") and not one["measured"]:
                want = one["free_from" if name == "x" else "free_to"] * 256
            if name in ("left", "right") and not one["width"]:
                want = int(name == "left")
            if name == "flags":
                want &= 0xFFFF
            got = int.from_bytes(record[place : place + size], "little", signed=name in SIGNED)
            assert got == want, name
        assert record[57] == one["measured"] + 2 * one["inward"] + 4 * one["test"] + (
            8 * (one["flags"] >> 16 & 1) + 32 * (one["flags"] >> 17 & 1)
        )
        assert record[58:60] == b"\0\0"
