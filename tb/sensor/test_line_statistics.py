"""line_statistics: RTL against the model exactly, the model against exact fractions."""

from fractions import Fraction

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

from vrscan.fixed.line_statistics import LineStatistics, latency, line_statistics

ELABORATIONS = [
    {"LineLength": 1000, "PixelWidth": 12, "MaxWindow": 127, "UserWidth": 8},
    {"LineLength": 2048, "PixelWidth": 16, "MaxWindow": 255, "UserWidth": 8},
    {"LineLength": 256, "PixelWidth": 8, "MaxWindow": 255, "UserWidth": 8},
    {"LineLength": 300, "PixelWidth": 8, "MaxWindow": 63, "UserWidth": 8},
    {"LineLength": 4096, "PixelWidth": 10, "MaxWindow": 191, "UserWidth": 8},  # six pairs
]
OUTPUTS = (
    "maximum", "max_index", "row_mean", "row_variance", "background", "noise", "spread",
    "row_statistics",
)  # fmt: skip


def hard_lines(length: int, pixel_width: int, count: int, salt: int) -> np.ndarray:
    """Return lines with a peak at random places, and the corners: flat, full, one pixel, comb."""
    draw = generator(salt)
    top = (1 << pixel_width) - 1
    lines = draw.integers(0, top // 8, size=(count, length))
    place = draw.integers(0, length, count)
    distance = np.arange(length) - place[:, None]
    lines = lines + (top * np.exp(-((distance / draw.integers(1, 30, (count, 1))) ** 2))).astype(
        int
    )
    lines = np.clip(lines, 0, top)
    corners = np.zeros((8, length), np.int64)
    corners[1] = top
    corners[2, 0] = corners[3, -1] = top
    corners[4] = np.arange(length) % 2 * top
    corners[5, length // 2] = 1
    corners[6, 5] = corners[6, length - 5] = 3  # two equal maxima: the first one counts
    corners[7] = top - 1
    lines[: min(count, 8)] = corners[:count]
    return lines.astype(np.uint16)


def model(lines: np.ndarray, noise_row: bool) -> LineStatistics:
    """Return the twin's answer for the running elaboration."""
    given = parameters()
    return line_statistics(
        lines,
        pixel_width=given["PixelWidth"],
        max_window=given["MaxWindow"],
        noise_row=noise_row,
    )


async def send(
    dut, lines: np.ndarray, *, noise_row: bool, gap: float = 0.0, late_good: bool = False
) -> None:
    """Stream lines and compare every result and the clock in which it comes."""
    draw = generator(99)
    given = parameters()
    length = given["LineLength"]
    delay = latency(length, given["PixelWidth"], given["MaxWindow"])
    want = model(lines, noise_row)
    dut.noise_row_i.value = int(noise_row)
    got: dict[str, list[int]] = {name: [] for name in OUTPUTS}
    due: list[tuple[int, int]] = []
    cycle = row = index = 0
    while len(got["maximum"]) < len(lines):
        last = index == length - 1
        # The next line may end in the clock of the last one's result.
        early = index >= length - 1 and bool(due) and due[0][0] > cycle
        sends = row < len(lines) and not early and draw.random() >= gap
        dut.valid_i.value = int(sends and index < length)
        dut.good_i.value = int(sends and (index == length if late_good else last))
        if sends:
            if index < length:
                dut.pixel_i.value = int(lines[row, index])
                dut.index_i.value = index
            dut.user_i.value = row & 0xFF
            if index == (length if late_good else length - 1):
                due.append((cycle + delay, row))
                row, index = row + 1, 0
            else:
                index += 1
        await FallingEdge(dut.clk_i)
        cycle += 1
        expected = bool(due) and due[0][0] == cycle
        assert int(dut.valid_o.value) == expected, f"cycle {cycle}, latency {delay}, due {due[:2]}"
        if expected:
            assert int(dut.user_o.value) == due.pop(0)[1] & 0xFF
            for name in OUTPUTS:
                got[name].append(as_integer(getattr(dut, f"{name}_o"), signed=False))
    dut.valid_i.value = dut.good_i.value = 0
    assert_equal(
        {name: np.array(values) for name, values in got.items()},
        {name: getattr(want, name) for name in OUTPUTS},
        {"line": np.arange(len(lines))},
    )


def lines_here(count: int, salt: int) -> np.ndarray:
    """Return hard lines for the running elaboration."""
    given = parameters()
    return hard_lines(given["LineLength"], given["PixelWidth"], count, salt)


@cocotb.test()
async def lines_back_to_back(dut) -> None:
    """No clock between two lines: the sums of one survive the pixels of the next."""
    await reset(dut)
    for noise_row in (False, True):
        await send(dut, lines_here(14, 1), noise_row=noise_row)


@cocotb.test()
async def lines_with_gaps_and_late_ends(dut) -> None:
    """Gaps between pixels, and the end of a line in a clock of its own."""
    await reset(dut)
    await send(dut, lines_here(10, 2), noise_row=False, gap=0.3)
    await send(dut, lines_here(10, 3), noise_row=False, late_good=True)


@cocotb.test()
async def dropped_lines_leave_nothing(dut) -> None:
    """A line that is never good, of any length, does not touch the next one."""
    await reset(dut)
    lines = lines_here(12, 4)
    for k, part in enumerate((1, 63, 64, 65, 200, 255)):
        dut.valid_i.value = 1
        for index in range(part):
            dut.pixel_i.value = int(lines[k, -1 - index])
            dut.index_i.value = index
            await FallingEdge(dut.clk_i)
        await send(dut, lines[k + 4 : k + 5], noise_row=False)


@cocotb.test()
async def reset_mid_stream(dut) -> None:
    """A reset in mid-line and in mid-division: no result, and the next line is right."""
    await reset(dut)
    lines = lines_here(12, 5)
    given = parameters()
    delay = latency(given["LineLength"], given["PixelWidth"], given["MaxWindow"])
    for age in range(1, delay + 1, 7):
        dut.valid_i.value = dut.good_i.value = 1
        dut.index_i.value = given["LineLength"] - 1
        await FallingEdge(dut.clk_i)
        dut.valid_i.value = dut.good_i.value = 0
        for _ in range(age - 1):
            await FallingEdge(dut.clk_i)
        dut.rst_i.value = 1
        dut.valid_i.value = dut.good_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        dut.valid_i.value = dut.good_i.value = 0
        for _ in range(delay + 5):
            assert dut.valid_o.value == 0, f"a result after a reset at age {age}"
            await FallingEdge(dut.clk_i)
    await send(dut, lines[8:], noise_row=False)


@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_line_statistics_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("line_statistics", __file__, widths)


@pytest.mark.parametrize("pixel_width", [8, 12, 16])
def test_line_statistics_model_is_the_rounded_moment(pixel_width: int) -> None:
    """Against exact fractions: means and variance within half a step, noise within its root's."""
    length = 2048
    lines = hard_lines(length, pixel_width, 60, pixel_width)
    got = line_statistics(lines, pixel_width=pixel_width, max_window=255, noise_row=False)
    step = Fraction(1, 1 << (24 - pixel_width))
    square_step = Fraction(1 << (2 * pixel_width), 1 << 32)
    worst_noise = 0.0
    for k, pixels in enumerate(lines.astype(object)):
        block = int(np.argmax(pixels)) // 64
        far = [p for i, p in enumerate(pixels) if abs(i // 64 - block) > 4]
        mean = Fraction(sum(pixels), length)
        variance = Fraction(sum(p * p for p in pixels), length) - mean**2
        background = Fraction(sum(far), len(far))
        spread = Fraction(sum(p * p for p in far), len(far)) - background**2
        assert abs(int(got.row_mean[k]) * step - mean) <= step / 2
        assert abs(int(got.row_variance[k]) * square_step - variance) <= square_step / 2
        assert abs(int(got.background[k]) * step - background) <= step / 2
        error = abs(int(got.noise[k]) * float(step) - float(spread) ** 0.5)
        # Half a step of the result, and half a step of the root with its four fraction bits.
        worst_noise = max(worst_noise, error / (float(step) / 2 + 1 / (32 * len(far))))
    assert worst_noise <= 1 + 1e-9, f"noise error / bound {worst_noise}"


def test_line_statistics_without_a_free_block_uses_the_row() -> None:
    lines = hard_lines(256, 12, 20, 7)
    got = line_statistics(lines, pixel_width=12, max_window=255, noise_row=False)
    assert got.row_statistics.all()
    assert np.array_equal(got.background, got.row_mean)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (np.zeros((1, 63), np.uint16), "63 pixels"),
        (np.full((1, 64), 4096, np.uint16), "12 bits"),
    ],
)
def test_line_statistics_model_rejects(lines: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        line_statistics(lines, pixel_width=12, max_window=255, noise_row=False)
