"""peak_fit: RTL against the model exactly."""

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
from sensor_gain import kappa_register

from vrscan.data import pkg
from vrscan.fixed.peak_fit import (
    FINE_LEAN,
    LATENCY,
    MOST_GRAINS,
    PRIOR_LEAN,
    SPAN,
    STEEP,
    UNMEASURED_LATENCY,
    Fitted,
    History,
    peak_fit,
)

ELABORATIONS = [
    {"LineLength": 2048, "PixelWidth": 12},
    {"LineLength": 1024, "PixelWidth": 10},
    {"LineLength": 300, "PixelWidth": 16},  # the floor of the noise is below a step
    {"LineLength": 1000, "PixelWidth": 8},
]
RING = 1 << pkg.RING_WIDTH
GIVEN = (
    "measured", "left", "width", "slope", "position", "spread", "sigma", "maximum", "background",
    "noise",
)  # fmt: skip


@dataclass(frozen=True)
class Cases:
    """What peak_fit is given of n lines; arrays [n] but for ``lines``."""

    lines: np.ndarray
    measured: np.ndarray
    left: np.ndarray
    width: np.ndarray
    slope: np.ndarray
    position: np.ndarray
    spread: np.ndarray
    sigma: np.ndarray
    maximum: np.ndarray
    background: np.ndarray
    noise: np.ndarray

    def fitted(self, pixel_width: int, kappa: int, level: int) -> Fitted:
        """Return the twin's answer."""
        return peak_fit(
            **vars(self),
            pixel_width=pixel_width,
            kappa=kappa,
            saturation_level=level,
            history=History.empty(),
        )


def spots(given: dict[str, int], count: int, salt: int) -> Cases:
    """Return spots of every width, height and place, with speckle, slope and saturation."""
    draw = generator(salt)
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top, shift = (1 << pixel_width) - 1, pkg.COUNT_WIDTH - pixel_width
    place = np.arange(length)
    sigma = 10 ** draw.uniform(-0.1, 1.4, count)
    centre = draw.uniform(0, length - 1, count)
    centre[::3] = draw.uniform(0.4, 0.6, len(centre[::3])) * length
    height = 10 ** draw.uniform(-1.5, 0.15, count) * top
    level = draw.uniform(0.0, 0.2, count) * top
    noise = 10 ** draw.uniform(-4, -2, count) * top
    slope = draw.choice([0, 0, 1, -1], count) * draw.random(count) * top / 2000
    contrast = draw.choice([0, 0.1, 0.3], count)
    away = (place - centre[:, None]) / sigma[:, None]
    profile = np.exp(-0.5 * np.square(away))
    profile[4::10] += np.exp(-0.5 * np.square(away[4::10] - 4.0))  # two spots are MIXED
    gain = np.maximum(1 + contrast[:, None] * draw.standard_normal(profile.shape), 0)
    light = level[:, None] + slope[:, None] * (place - centre[:, None])
    light += height[:, None] * profile * gain
    light += noise[:, None] * draw.standard_normal(profile.shape)
    lines = np.clip(np.round(light), 0, top).astype(np.uint16)
    seen = sigma * 10 ** draw.uniform(-0.2, 0.2, count)
    width = np.clip(np.round(6.75 * seen), 3, min(255, length)).astype(np.int64)
    begin = np.clip(np.round(centre - width / 2), 0, length - width).astype(np.int64)
    given_at = centre + seen * draw.uniform(-0.5, 0.5, count)
    return Cases(
        lines=lines,
        measured=draw.random(count) < 0.9,
        left=begin,
        width=width,
        slope=np.round(slope * 2 ** (16 - pixel_width + pkg.RAMP_FRACTION)).astype(np.int64),
        position=np.round(given_at.clip(0, length) * 2**pkg.POSITION_FRACTION).astype(np.int64),
        spread=draw.integers(0, 1 << 12, count),
        sigma=np.round(seen * 2**9).astype(np.int64),
        maximum=lines.max(axis=1).astype(np.int64),
        background=np.floor(np.minimum(level, lines.max(axis=1)) * 2.0**shift).astype(np.int64),
        noise=np.floor(noise * 2.0**shift).astype(np.int64),
    )


def extremes(given: dict[str, int], count: int, salt: int) -> Cases:
    """Return numbers at random over their ranges on lines of noise, dark ones and full ones."""
    draw = generator(salt)
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top, shift = (1 << pixel_width) - 1, pkg.COUNT_WIDTH - pixel_width
    lines = draw.integers(0, top + 1, (count, length))
    lines[::4] = top
    lines[1::4] = np.where(
        np.arange(length) < draw.integers(0, length, (len(lines[1::4]), 1)), 0, top
    )
    lines[2::8] = 0
    width = draw.integers(3, min(255, length) + 1, count)
    left = np.floor(draw.random(count) * (length - width + 1)).astype(np.int64)
    maximum = lines.max(axis=1).astype(np.int64)
    most = (1 << (pkg.SLOPE_LEVEL_WIDTH - 1)) - 1
    limit = 1 << draw.integers(0, 27, count)
    return Cases(
        lines=lines.astype(np.uint16),
        measured=draw.random(count) < 0.95,
        left=left,
        width=width,
        slope=np.clip((draw.random(count) * 2 - 1) * limit, -most, most).astype(np.int64),
        position=(draw.random(count) * (length << pkg.POSITION_FRACTION)).astype(np.int64),
        spread=draw.integers(0, 1 << pkg.SIGMA_WIDTH, count),
        sigma=draw.integers(0, 1 << 17, count) >> draw.integers(0, 17, count),
        maximum=maximum,
        background=(draw.random(count) * (maximum << shift)).astype(np.int64),
        noise=((1 << draw.integers(0, 24, count)) - 1) >> draw.integers(0, 24, count),
    )


def posed(lines: np.ndarray, **columns: object) -> Cases:
    """Return lines without slope, background, noise and spread, but for the columns given."""
    still = dict.fromkeys(("slope", "background", "noise", "spread"), 0)
    columns = still | {"maximum": lines.max(axis=1)} | columns
    return Cases(
        lines=lines.astype(np.uint16),
        measured=np.ones(len(lines), np.bool_),
        **{
            name: np.broadcast_to(np.array(value, np.int64), len(lines))
            for name, value in columns.items()
        },
    )


async def send(dut, cases: Cases, kappa: int, level: int = 0) -> Fitted:
    """Send lines one after the other, play the ring, and compare results and latencies."""
    given = parameters()
    length = given["LineLength"]
    level = level or (1 << given["PixelWidth"]) - 1
    want = cases.fitted(given["PixelWidth"], kappa, level)
    dut.kappa_i.value = kappa
    dut.saturation_level_i.value = level
    got: dict[str, list[int]] = {
        "mixed": [],
        "position": [],
        "sigma": [],
        "scale": [],
    }
    for row, line in enumerate(cases.lines):
        # What stands in the ring beside the line is not to be used.
        ring = np.full(RING, 1)
        middle = int(cases.left[row] + cases.width[row] // 2)
        for index in range(max(0, middle - 110), min(length, middle + 110)):
            ring[index % RING] = line[index]
        for name in GIVEN:
            getattr(dut, f"{name}_i").value = int(getattr(cases, name)[row])
        dut.valid_i.value = 1
        clocks = LATENCY if cases.measured[row] else UNMEASURED_LATENCY
        asked = before = 0
        for cycle in range(1, clocks + 1):
            if cycle <= SPAN + 5:
                asked, before = before, as_integer(dut.read_index_o, signed=False)
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
            if cycle <= SPAN + 5:
                dut.read_pixel_i.value = int(ring[asked])
            assert int(dut.valid_o.value) == (cycle == clocks), f"line {row}, cycle {cycle}"
        assert dut.reading_o.value == 0
        got["mixed"].append(int(dut.mixed_o.value))
        got["position"].append(as_integer(dut.position_o, signed=True))
        for name in ("sigma", "scale"):
            got[name].append(as_integer(getattr(dut, f"{name}_o"), signed=False))
    expected = {
        "mixed": want.mixed.astype(np.int64),
        "position": want.position,
        "sigma": want.sigma,
        "scale": np.where(cases.measured, want.scale, got["scale"]),
    }
    inputs = {name: getattr(cases, name).astype(np.int64) for name in GIVEN}
    assert_equal({name: np.array(values) for name, values in got.items()}, expected, inputs)
    return want


@cocotb.test()
async def spots_of_every_kind(dut) -> None:
    """Spots of every width, with speckle, slope, saturation; most fit, some do not."""
    given = parameters()
    await reset(dut)
    want = await send(dut, spots(given, 100, 1), kappa_register(given["PixelWidth"]))
    assert 0.2 < want.fitted.mean() < 1
    assert 0 < want.mixed.mean() < 0.5


@cocotb.test()
async def ends_of_the_ranges(dut) -> None:
    """Numbers that no line has, noise from nothing to full scale, kappa at its ends."""
    given = parameters()
    top = (1 << given["PixelWidth"]) - 1
    most = (1 << pkg.KAPPA_WIDTH) - 1
    for salt, kappa, level in ((2, 0, top), (3, most, 1), (4, 3277, top // 2)):
        await reset(dut)
        await send(dut, extremes(given, 24, salt), kappa, level)


@cocotb.test()
async def a_fit_on_the_lines_end_is_beyond_it(dut) -> None:
    """A spot beyond the line is fitted to the span's end: that of the line, then a pixel before.

    One before the line is not fitted, either.
    """
    given = parameters()
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top, shift = (1 << pixel_width) - 1, pkg.COUNT_WIDTH - pixel_width
    middle = np.array([[length + 16], [length + 16], [-9]])
    cases = posed(
        np.round(top * np.exp(-0.5 * ((np.arange(length) - middle) / 25.0) ** 2)),
        left=[length - SPAN // 2 - 49, length - SPAN // 2 - 50, 0],
        width=99,
        position=np.array([length - 2, length - 2, 0]) << pkg.POSITION_FRACTION,
        spread=100,
        sigma=25 << 9,
        noise=[(top << shift) // 50, (top << shift) // 50, (top << shift) // 15],
    )
    await reset(dut)
    want = await send(dut, cases, kappa_register(pixel_width))
    assert want.fitted.tolist() == [False, True, False]
    assert want.position[1] == length - 1 << pkg.POSITION_FRACTION


@cocotb.test()
async def a_line_without_any_variance(dut) -> None:
    """No shot noise, no speckle behind a line of noise, and a floor below a step for 16 bits."""
    given = parameters()
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top, shift = (1 << pixel_width) - 1, pkg.COUNT_WIDTH - pixel_width
    middle = length // 2
    lines = np.full((2, length), top)
    lines[0] = 0.4 * top * np.exp(-0.5 * ((np.arange(length) - middle) / 12.0) ** 2)
    lines[1, middle + 10 : middle + 14] = 0  # what is not saturated
    cases = posed(
        lines,
        left=middle - 49,
        width=99,
        position=middle << pkg.POSITION_FRACTION,
        sigma=[12 << 9, 60 << 9],
        noise=[(top << shift) // 50, 0],
    )
    await reset(dut)
    want = await send(dut, cases, 0, top // 2)
    assert want.speckle[1] == 0


@cocotb.test()
async def two_spots_with_a_saturated_pixel_are_not_mixed(dut) -> None:
    """One of some sixty pixels is enough, which the fit itself does without."""
    given = parameters()
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top, shift = (1 << pixel_width) - 1, pkg.COUNT_WIDTH - pixel_width
    away = (np.arange(length) - length // 2) / 8.0
    line = np.round(0.4 * top * (np.exp(-0.5 * away**2) + np.exp(-0.5 * (away - 4.0) ** 2)))
    lines = np.tile(line, (2, 1))
    lines[1, length // 2] = top // 2
    cases = posed(
        lines,
        left=length // 2 - 27,
        width=55,
        position=length // 2 << pkg.POSITION_FRACTION,
        sigma=8 << 9,
        noise=(top << shift) // 500,
    )
    await reset(dut)
    want = await send(dut, cases, kappa_register(pixel_width), top // 2)
    assert want.mixed.tolist() == [True, False]


@cocotb.test()
async def what_is_not_one_spot_tells_nothing_of_grains(dut) -> None:
    """However far it pulls the middle: neither its own sigma nor the next line's.

    Seven ramps do, and one that the line's end cuts.
    """
    given = parameters()
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top, shift = (1 << pixel_width) - 1, pkg.COUNT_WIDTH - pixel_width
    middle = np.array([length // 2] * 8 + [length - 12])
    away = (np.arange(length) - middle[:, None]) / 8.0
    light = np.where(np.abs(away) < 2.0, (away + 2.0) / 4.0, 0.0)
    light[0] = np.exp(-0.5 * (away[0] / np.where(away[0] < 0, 1.6, 0.6)) ** 2)
    light[1] = np.exp(-0.5 * away[1] ** 2)
    light[8] = np.where(np.abs(away[8]) < 2.0, (2.0 - away[8]) / 4.0, 0.0)
    cases = posed(
        np.round(0.8 * top * light),
        left=np.minimum(middle - 40, length - 81),
        width=81,
        position=middle << pkg.POSITION_FRACTION,
        sigma=[12 << 9, 8 << 9, *[12 << 9] * 7],
        noise=(top << shift) // 500,
    )
    await reset(dut)
    want = await send(dut, cases, kappa_register(pixel_width))
    assert want.mixed[[0, 1, -2, -1]].tolist() == [True, False, False, False]
    before = [PRIOR_LEAN, 2 * PRIOR_LEAN // 3]  # the second line does not lean at all
    assert want.grains[:2].tolist() == [STEEP * (lean - FINE_LEAN) >> 1 for lean in before]
    assert want.grains[-2] == MOST_GRAINS
    # Ramps that turn the middle to one side end a fit there, and grains excuse no worse one.
    assert want.end.tolist() == [8] * 3 + [2] * 6
    assert want.fitted[-3:].tolist() == [False, False, True]


def feet(given: dict[str, int]) -> Cases:
    """Return spots with a foot: small on the right, large there, then on the left."""
    length, pixel_width = given["LineLength"], given["PixelWidth"]
    top, shift = (1 << pixel_width) - 1, pkg.COUNT_WIDTH - pixel_width
    side = np.repeat([1, -1], [16, 30])
    share = np.repeat([0.008, 0.12, 0.12], [8, 8, 30])
    away = (np.arange(length) - length // 2) / 6.0 * side[:, None]
    light = np.exp(-0.5 * away**2) + share[:, None] * np.exp(-0.5 * (away - 2.5) ** 2)
    light[20, length // 2 - 2 : length // 2 + 3] = 2.0
    cases = posed(
        np.round(np.minimum(0.7 * light, 1.0) * top),
        left=length // 2 - 22,
        width=45,
        position=length // 2 << pkg.POSITION_FRACTION,
        spread=100,
        sigma=6 << 9,
        noise=(top << shift) // 60,
    )
    cases.measured[12] = False
    return cases


@cocotb.test()
async def a_foot_ends_the_fit(dut) -> None:
    """At 3 where it is small, at 2 where it is large; none is told where its side changes.

    Lines that are clipped or have no spot tell nothing of it, and have none of their own.
    """
    given = parameters()
    await reset(dut)
    want = await send(dut, feet(given), kappa_register(given["PixelWidth"]))
    ends = want.end[:12].tolist()
    assert ends == sorted(ends, reverse=True) and set(ends) == {8, 3, 2}
    assert want.end[12:].tolist() == [8] + [2] * 4 + [8] * 24 + [2] * 5
    assert want.fitted.sum() == len(want.end) - 1


@cocotb.test()
async def a_line_in_each_of_the_first_clocks(dut) -> None:
    """Nothing that a reset leaves behind is in its way."""
    given = parameters()
    cases = replace(spots(given, 1, 6), measured=np.ones(1, np.bool_))
    for clocks in range(4):
        await reset(dut)
        for _ in range(clocks):
            await FallingEdge(dut.clk_i)
        await send(dut, cases, kappa_register(given["PixelWidth"]))


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """A reset at any moment: nothing comes out, the history is empty, the next line is right."""
    given = parameters()
    await reset(dut)
    cases = spots(given, 1, 6)
    cases = replace(cases, measured=np.ones(1, np.bool_))
    for age in range(1, LATENCY, 149):
        dut.valid_i.value = 1
        for _ in range(age):
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
        dut.rst_i.value = dut.valid_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = dut.valid_i.value = 0
        for _ in range(5):
            assert dut.valid_o.value == 0 and dut.reading_o.value == 0, f"reset at age {age}"
            await FallingEdge(dut.clk_i)
        if age % 4 == 1:
            await send(dut, cases, kappa_register(given["PixelWidth"]))
            await reset(dut)


@pytest.mark.parametrize("widths", each(ELABORATIONS, 3), ids=str)
def test_peak_fit_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("peak_fit", __file__, widths)
