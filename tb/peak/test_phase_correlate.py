"""phase_correlate: RTL against the model exactly; phase and noise sums against (8) in float64."""

import cocotb
import numpy as np
import pytest
from harness import (
    FallingEdge,
    as_integer,
    assert_equal,
    drive,
    each,
    generator,
    parameters,
    port,
    reset,
    simulate,
)

from vrscan.data import pkg
from vrscan.fixed import cordic_vector, quarter_wave
from vrscan.fixed.phase_correlate import (
    UNMEASURED_LATENCY,
    Harmonics,
    first_harmonics,
    first_latency,
    latency,
    phase_correlate,
)
from vrscan.ideal.position import first_harmonic

ELABORATIONS = [
    {"PixelWidth": 12, "UserWidth": 8},
    {"PixelWidth": 10, "UserWidth": 8},
    {"PixelWidth": 16, "UserWidth": 8},
    {"PixelWidth": 8, "UserWidth": 8},
]
OUTPUTS = {
    "measured": False,
    "no_phase": False,
    "period": False,
    "phase": False,
    "magnitude": False,
    "sum": False,
    "wave": True,
    "count": True,
}
LENGTH = 256
RING = 1 << pkg.RING_WIDTH


def windows(pixel_width: int, widths: list[int], salt: int) -> tuple[np.ndarray, np.ndarray]:
    """Return lines that start with a window of each width, and a background below its pixels."""
    draw = generator(salt)
    top = (1 << pixel_width) - 1
    lines = np.zeros((len(widths), LENGTH), np.int64)
    background = np.zeros(len(widths), np.int64)
    for row, width in enumerate(widths):
        pedestal = int(draw.random() ** 2 * 0.95 * top)
        height = draw.random() * (top - pedestal)
        place = np.arange(width)
        shape = np.exp(-(((place - draw.random() * width) / (0.1 + draw.random() * width)) ** 2))
        if row % 4 == 0:
            shape = draw.random(width)
        pixels = pedestal + np.round(height * shape)
        lines[row, :width] = pixels
        shift = pkg.COUNT_WIDTH - pixel_width
        low = int(lines[row, :width].min()) << shift if width else 0
        background[row] = int(draw.integers(0, low + 1)) if row % 3 else low
    return lines.astype(np.uint16), background


async def send(
    dut,
    lines: np.ndarray,
    background: np.ndarray,
    widths: np.ndarray,
    *,
    period_n: bool,
    left: np.ndarray | None = None,
) -> None:
    """Send windows one after the other and compare results and latencies."""
    measured = widths >= pkg.MIN_WINDOW
    left = np.zeros(len(lines), np.int64) if left is None else left
    want: Harmonics = phase_correlate(
        lines,
        left=left,
        width=widths,
        background=background,
        measured=measured,
        pixel_width=parameters()["PixelWidth"],
        period_n=period_n,
    )
    port(dut, "period_n_i").value = int(period_n)
    port(dut, "window_two_pass_i").value = 0
    got: dict[str, list[int]] = {name: [] for name in OUTPUTS}
    for row, pixels in enumerate(lines):
        dut.valid_i.value = 1
        dut.measured_i.value = int(measured[row])
        dut.left_i.value = int(left[row]) % RING
        dut.width_i.value = int(widths[row]) & 0xFF
        dut.background_i.value = int(background[row])
        dut.user_i.value = row & 0xFF
        expected = latency(int(widths[row])) if measured[row] else UNMEASURED_LATENCY
        asked = before = 0
        for cycle in range(1, expected + 1):
            asked, before = before, as_integer(dut.read_index_o, signed=False)
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
            dut.width_i.value = dut.background_i.value = dut.measured_i.value = 0
            dut.read_pixel_i.value = int(pixels[asked % len(pixels)])
            assert int(dut.valid_o.value) == (cycle == expected), f"window {row}, cycle {cycle}"
            assert dut.refine_o.value == 0, f"window {row}, cycle {cycle}"
        assert int(dut.user_o.value) == row & 0xFF
        assert int(dut.width_o.value) == int(widths[row]) & 0xFF
        for name, signed in OUTPUTS.items():
            got[name].append(as_integer(port(dut, f"{name}_o"), signed=signed))
    assert_equal(
        {name: np.array(values) for name, values in got.items()},
        {name: getattr(want, name) for name in OUTPUTS},
        {"width": widths, "background": background},
    )


@cocotb.test()
async def windows_of_every_width(dut) -> None:
    """Every N from nothing to 255, both periods, back to back."""
    await reset(dut)
    widths = generator(1).permutation(np.r_[0:256, 3:9])
    half = len(widths) // 2
    for period_n, part in ((True, widths[:half]), (False, widths[half:])):
        lines, background = windows(parameters()["PixelWidth"], part.tolist(), 1)
        await send(dut, lines, background, part, period_n=period_n)


@cocotb.test()
async def ends_of_the_range(dut) -> None:
    """Full-scale windows without background, flat ones, combs and one bright pixel."""
    top = (1 << parameters()["PixelWidth"]) - 1
    await reset(dut)
    widths = np.array([255, 255, 255, 254, 4, 3, 255, 8])
    lines = np.zeros((len(widths), LENGTH), np.uint16)
    lines[0] = top
    lines[1, :128] = top
    lines[2, 64:192] = top
    lines[3] = np.arange(LENGTH) % 2 * top  # X and Y cancel
    lines[4] = lines[5] = 7  # flat: no phase for T = N, whatever the rounding leaves
    lines[6, 254] = top
    lines[7, 0] = 1
    background = np.zeros(len(widths), np.int64)
    background[4] = 7 << (pkg.COUNT_WIDTH - parameters()["PixelWidth"])
    for period_n in (True, False):
        await send(dut, lines, background, widths, period_n=period_n)


@cocotb.test()
async def windows_anywhere_in_the_ring(dut) -> None:
    """Windows that begin at any index, also where the ring's indices begin anew."""
    await reset(dut)
    draw = generator(8)
    around = draw.integers(0, 1 << parameters()["PixelWidth"], (8, RING)).astype(np.uint16)
    lines = np.concatenate([around, around[:, :LENGTH]], axis=1)
    left = np.r_[0, RING - 1, RING - 40, draw.integers(0, RING, 5)]
    widths = draw.integers(3, 256, 8)
    await send(dut, lines, np.zeros(8, np.int64), widths, period_n=True, left=left)


async def refine(dut, salt: int, count: int) -> None:
    """Send pairs of windows, the second with a ramp, and compare both harmonics."""
    draw = generator(salt)
    width = parameters()["PixelWidth"]
    top = (1 << width) - 1
    first, second = draw.integers(3, 256, (2, count))
    second[:3] = 3, 255, 255
    lines = draw.integers(0, top + 1, (count, 2 * LENGTH))
    lines[2] = np.arange(2 * LENGTH) % 2 * top
    left = draw.integers(0, LENGTH, count)
    left[:3] = 0
    background = draw.integers(0, top << (pkg.COUNT_WIDTH - width), count)
    # The first window's pixels are above the background, the second one's need not be.
    for k in range(count):
        low = background[k] >> (pkg.COUNT_WIDTH - width)
        lines[k, : first[k]] = np.maximum(lines[k, : first[k]], low + 1)
    lines = np.minimum(lines, top).astype(np.uint16)
    steepest = (1 << (pkg.ALIGNED_WIDTH + pkg.RAMP_FRACTION)) // (second + 2)
    slope = (steepest * draw.choice([0, 1, 1e-3], count)).astype(np.int64)
    slope *= draw.choice([-1, 1], count)
    ramp = -((slope * (second - 1)) >> 1)
    given = {"background": background, "pixel_width": width, "period_n": True}
    before = first_harmonics(lines, left=np.zeros(count, np.int64), width=first, **given)
    want = phase_correlate(
        lines,
        left=left,
        width=second,
        measured=np.ones(count, np.bool_),
        ramp=ramp,
        slope=slope,
        **given,
    )
    port(dut, "window_two_pass_i").value = 1
    port(dut, "period_n_i").value = 0  # two passes have T = N, whatever this says
    got: dict[str, list[int]] = {name: [] for name in OUTPUTS}
    earlier: dict[str, list[int]] = {name: [] for name in ("phase", "magnitude", "sum")}
    for row in range(count):
        dut.valid_i.value = dut.measured_i.value = 1
        dut.left_i.value = 0
        dut.width_i.value = int(first[row])
        dut.background_i.value = int(background[row])
        wait = int(draw.integers(1, 20))  # for the second window
        refined = first_latency(int(first[row]))
        ends = refined + wait + latency(int(second[row]))
        asked = next_asked = 0
        for cycle in range(1, ends + 1):
            asked, next_asked = next_asked, as_integer(dut.read_index_o, signed=False)
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = dut.measured_i.value = dut.refined_i.value = 0
            dut.read_pixel_i.value = int(lines[row, asked % lines.shape[1]])
            assert int(dut.refine_o.value) == (cycle == refined), f"windows {row}, cycle {cycle}"
            assert int(dut.valid_o.value) == (cycle == ends), f"windows {row}, cycle {cycle}"
            if cycle == refined:
                for name, values in earlier.items():
                    values.append(as_integer(port(dut, f"{name}_o"), signed=False))
            if cycle == refined + wait:
                dut.refined_i.value = 1
                dut.refined_left_i.value = int(left[row])
                dut.refined_width_i.value = int(second[row])
                drive(dut.refined_ramp_i, int(ramp[row]))
                drive(dut.refined_slope_i, int(slope[row]))
        for name, signed in OUTPUTS.items():
            got[name].append(as_integer(port(dut, f"{name}_o"), signed=signed))
    inputs = {"first": first, "second": second, "slope": slope}
    assert_equal(
        {name: np.array(values) for name, values in earlier.items()},
        {name: getattr(before, name) for name in earlier},
        inputs,
    )
    assert_equal(
        {name: np.array(values) for name, values in got.items()},
        {name: getattr(want, name) for name in OUTPUTS},
        inputs,
    )


@cocotb.test()
async def second_windows_on_a_ramp(dut) -> None:
    """Any second window with any ramp: heights below zero, sums below zero, the steepest ramps."""
    await reset(dut)
    await refine(dut, 9, 60)
    lines, background = windows(parameters()["PixelWidth"], [40, 2, 8], 10)
    await send(dut, lines, background, np.array([40, 2, 8]), period_n=False)


@cocotb.test()
async def reset_mid_window(dut) -> None:
    """A reset in every phase of the work: nothing comes out, and the next window is right."""
    await reset(dut)
    lines, background = windows(parameters()["PixelWidth"], [40], 3)
    # Every moment around the CORDIC's start: what it still finished would end the next window.
    for age in (*range(1, latency(40), 11), *range(80, 96)):
        dut.valid_i.value = dut.measured_i.value = 1
        dut.width_i.value = 40
        for _ in range(age):
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
        dut.rst_i.value = dut.valid_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = dut.valid_i.value = 0
        assert dut.valid_o.value == 0, f"a result after a reset at age {age}"
        await send(dut, lines, background, np.array([40]), period_n=True)
    # A reset while the second window is awaited, or on its way.
    for age in (first_latency(40) + 3, first_latency(40) + 30):
        port(dut, "window_two_pass_i").value = dut.valid_i.value = dut.measured_i.value = 1
        for cycle in range(age):
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
            dut.refined_i.value = int(cycle == first_latency(40) + 4)
            dut.refined_width_i.value = 30
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.rst_i.value = dut.refined_i.value = 0
        await send(dut, lines, background, np.array([40]), period_n=True)


@pytest.mark.parametrize("widths", each(ELABORATIONS, 3), ids=str)
def test_phase_correlate_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("phase_correlate", __file__, widths)


def test_package_knows_the_table() -> None:
    assert round(quarter_wave.amplitude(pkg.SINE_WIDTH)) == pkg.SINE_AMPLITUDE


@pytest.mark.parametrize("period_n", [True, False])
@pytest.mark.parametrize("pixel_width", [8, 16])
def test_phase_correlate_model_is_equation_8(pixel_width: int, period_n: bool) -> None:
    """Phase, magnitude and both noise sums of (8) on raw pixels, in float64.

    The phase of a first harmonic of at least a tenth of the sum above background may be off by
    0.3e-3 px; the other three are sums of at most 255 products with a table of 24 bits, and a half
    step for their rounding.
    """
    widths = np.array([*range(3, 256), 255, 255])
    lines, background = windows(pixel_width, widths.tolist(), 5)
    zeros = np.zeros(len(widths), np.int64)
    got = phase_correlate(
        lines,
        left=zeros,
        width=widths,
        background=background,
        measured=np.ones(len(widths), np.bool_),
        pixel_width=pixel_width,
        period_n=period_n,
    )
    pixels = lines[:, :256] * 2.0 ** (pkg.ALIGNED_WIDTH - pixel_width)
    place = np.arange(256)
    inside = place < widths[:, None]
    period = widths if period_n else widths - 1
    theta = 2 * np.pi * place / period[:, None]
    harmonic = np.where(inside, pixels * np.exp(1j * theta), 0).sum(axis=1)
    pedestal = background >> (pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH)
    height = np.where(inside, pixels - pedestal[:, None], 0)

    turns = got.phase / 2**pkg.ANGLE_WIDTH
    ideal = first_harmonic(
        np.where(inside, pixels, 0.0),
        widths,
        period_n=period_n,
        background=np.zeros(len(widths)),
        noise=np.ones(len(widths)),
        kappa=0.0,
    )
    error = np.abs(ideal.delta - turns * period)
    judged = np.abs(harmonic) >= 0.1 * height.sum(axis=1)
    judged &= got.measured
    assert judged.sum() > 150 and np.array_equal(got.period, period)
    print(f"position: {error[judged].max():.1e} px, at most 3e-4")
    assert error[judged].max() <= 3e-4
    magnitude = got.magnitude / (cordic_vector.GAIN * pkg.SINE_AMPLITUDE)
    assert np.abs(magnitude / np.abs(harmonic) - 1)[judged].max() <= 1e-5
    assert np.array_equal(got.sum, height.sum(axis=1))
    # Around the phase it found; the table's 1 is 4e-5 below 2**23, where sums take it to be.
    around = np.cos(2 * theta - 4 * np.pi * turns[:, None])
    wave = (height * around).sum(axis=1)
    slack = 1e-4 * height.sum(axis=1) + 0.5 / 2**pkg.WAVE_FRACTION
    assert (np.abs(got.wave / 2**pkg.WAVE_FRACTION - wave) <= slack)[judged].all()
    count = np.where(inside, around, 0).sum(axis=1)
    slack = 1e-4 * widths + 0.5 / 2**pkg.WAVE_COUNT_FRACTION
    assert (np.abs(got.count / 2**pkg.WAVE_COUNT_FRACTION - count) <= slack)[judged].all()


@pytest.mark.parametrize("width", [3, 4, 20, 57, 200, 255])
def test_flat_window_has_no_phase(width: int) -> None:
    """A saturated box above its background: the harmonic is rounding, and is called so."""
    lines = np.zeros((1, LENGTH), np.uint16)
    lines[0, :width] = 4095
    got = phase_correlate(
        lines,
        left=np.zeros(1, np.int64),
        width=np.array([width]),
        background=np.array([60 << 12]),
        measured=np.ones(1, np.bool_),
        pixel_width=12,
        period_n=True,
    )
    assert got.no_phase[0] and not got.measured[0]
    lines[0, 0] -= 2  # a little less at one end is a phase again
    got = phase_correlate(
        lines,
        left=np.zeros(1, np.int64),
        width=np.array([width]),
        background=np.array([60 << 12]),
        measured=np.ones(1, np.bool_),
        pixel_width=12,
        period_n=True,
    )
    assert got.measured[0]
