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
    # Around the inner blocks none is left, around the outer ones some are.
    {"LineLength": 300, "PixelWidth": 12, "MaxWindow": 127, "UserWidth": 8},
    {"LineLength": 2048, "PixelWidth": 16, "MaxWindow": 255, "UserWidth": 8},
    {"LineLength": 1000, "PixelWidth": 12, "MaxWindow": 127, "UserWidth": 8},
    {"LineLength": 256, "PixelWidth": 8, "MaxWindow": 255, "UserWidth": 8},
    {"LineLength": 600, "PixelWidth": 12, "MaxWindow": 60, "UserWidth": 8},
    {"LineLength": 4096, "PixelWidth": 10, "MaxWindow": 191, "UserWidth": 8},  # six pairs
    {"LineLength": 1024, "PixelWidth": 10, "MaxWindow": 255, "UserWidth": 8},
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
    corners = np.zeros((9, length), np.int64)
    corners[1] = top
    corners[2, 0] = corners[3, -1] = top
    corners[4] = np.arange(length) % 2 * top
    corners[5, length // 2] = 1
    corners[6, 5] = corners[6, length - 5] = 3  # two equal maxima: the first one counts
    corners[7] = top - 1
    # Blocks as bright as each other, each with a noise of its own: of equal pairs the nearer count.
    place = np.arange(length)
    corners[8] = 40 + np.where(place % 2 == 0, 1, -1) * (place // 64 % 37)
    corners[8, length // 2] = top
    lines[: min(count, 9)] = corners[:count]
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


def darkest_pairs(pixels: list[int], block: int) -> list[list[list[int]]]:
    """Return the blocks beside block ``block`` of a line by their definition: pairs of pixels."""
    whole = [pixels[k : k + 64] for k in range(0, len(pixels) - 63, 64)]
    pairs, guard = [], 4
    for distance in range(2, 2 * guard + 1):
        there = [whole[k] for k in (block - distance, block + distance) if 0 <= k < len(whole)]
        if there:
            pairs.append([there[0], there[-1]])
    darkest = sorted(pairs, key=lambda pair: sum(pair[0]) + sum(pair[1]))
    return darkest[: max(min(guard, len(pairs) + 1 - guard), 0)]


@pytest.mark.parametrize(("pixel_width", "length"), [(8, 2048), (12, 2048), (16, 2048), (12, 900)])
def test_line_statistics_model_is_the_rounded_moment(pixel_width: int, length: int) -> None:
    """Against exact fractions: half a step for means and variance, a root's for deviations."""
    lines = hard_lines(length, pixel_width, 60, pixel_width)
    lines[40:] = lines[40:] // 4 + np.arange(length) * np.linspace(-6, 6, 20)[:, None] % 97
    lines = np.minimum(lines, (1 << pixel_width) - 1).astype(np.uint16)
    got = line_statistics(lines, pixel_width=pixel_width, max_window=255, noise_row=False)
    step = Fraction(1, 1 << (24 - pixel_width))
    square_step = Fraction(1 << (2 * pixel_width), 1 << 32)
    worst, used_row = 0.0, 0

    def moments(values: list[int]) -> tuple[Fraction, Fraction]:
        mean = Fraction(sum(values), len(values))
        return mean, Fraction(sum(p * p for p in values), len(values)) - mean**2

    def error(found: int, variance: Fraction, count: int) -> float:
        """Over half a step of the result and of the root with its four fraction bits."""
        off = abs(found * float(step) - float(variance) ** 0.5)
        return off / (float(step) / 2 + 1 / (32 * count))

    for k, pixels in enumerate(lines.astype(object).tolist()):
        block = pixels.index(max(pixels)) // 64
        mean, variance = moments(pixels)
        kept = [half for pair in darkest_pairs(pixels, block) for half in pair]
        far = [p for i, p in enumerate(pixels) if abs(i // 64 - block) > 4]
        used_row += not kept
        background = sum((moments(half)[0] for half in kept), Fraction(0)) / max(len(kept), 1)
        parts = [half[k : k + 16] for half in kept for k in range(0, 64, 16)]
        noise = sum((moments(part)[1] for part in parts), Fraction(0)) / max(len(parts), 1)
        noise *= Fraction(16, 15)
        _, spread = moments(far) if kept else (mean, variance)
        assert abs(int(got.row_mean[k]) * step - mean) <= step / 2
        assert abs(int(got.row_variance[k]) * square_step - variance) <= square_step / 2
        assert abs(int(got.background[k]) * step - (background if kept else mean)) <= step / 2
        assert got.row_statistics[k] == (not kept)
        worst = max(worst, error(int(got.spread[k]), spread, len(far) if kept else length))
        worst = max(
            worst,
            error(int(got.noise[k]), noise if kept else variance, 120 * len(kept) or length),
        )
    assert worst <= 1 + 1e-9, f"error of a deviation / bound {worst}"
    assert used_row == 0 or length < 2048


def test_a_gradient_is_no_noise_and_its_level_is_that_at_the_spot() -> None:
    """On slopes, with spots and rivals: the background at the spot's block, and its noise."""
    draw = generator(8)
    place = np.arange(2048)
    slope = draw.uniform(-0.8, 0.8, (200, 1))
    centre = draw.uniform(600, 1400, (200, 1))
    lines = 1000 + slope * (place - 1024) + 4 * draw.standard_normal((200, 2048))
    lines += 1500 * np.exp(-(((place - centre) / 6) ** 2))
    rival = centre + draw.uniform(150, 450, (200, 1)) * draw.choice([-1, 1], (200, 1))
    lines += 900 * np.exp(-(((place - rival) / 6) ** 2))
    lines = np.clip(np.round(lines), 0, 4095).astype(np.uint16)
    got = line_statistics(lines, pixel_width=12, max_window=255, noise_row=False)
    middle = got.max_index // 64 * 64 + 31.5
    level = 1000 + slope[:, 0] * (middle - 1024)
    # 16 steps of a slope have a sample variance of 16 17 / 12 of its square.
    noise = np.sqrt(16 + 1 / 12 + np.square(slope[:, 0]) * 16 * 17 / 12)
    # The darkest of eight pairs: their mean is a deviation of a pair's below the level at most.
    assert np.abs(got.background / 4096 - level).max() < 4 * noise.max() / np.sqrt(128)
    assert np.abs(got.noise / 4096 / noise - 1).max() < 5 / np.sqrt(2 * 512)
    # What the whole line would say of the steepest ones.
    assert (got.spread / 4096 > 10 * noise).sum() > 50


def test_line_statistics_without_a_free_block_uses_the_row() -> None:
    lines = hard_lines(256, 12, 20, 7)
    got = line_statistics(lines, pixel_width=12, max_window=255, noise_row=False)
    assert got.row_statistics.all()
    assert np.array_equal(got.background, got.row_mean)
    row = line_statistics(lines, pixel_width=12, max_window=255, noise_row=True)
    assert not row.row_statistics.any()
    assert np.array_equal(got.noise, row.noise) and np.array_equal(got.noise, got.spread)


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
