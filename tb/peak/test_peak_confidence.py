"""peak_confidence: RTL against the model exactly, the model against the formulas in float64."""

import math

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
    reset_at_every_age,
    run_vectors,
    simulate,
)

from vrscan.data import pkg
from vrscan.fixed import cordic_vector
from vrscan.fixed.peak_confidence import latency, peak_confidence

ELABORATIONS = [{"PixelWidth": 12}, {"PixelWidth": 10}, {"PixelWidth": 16}, {"PixelWidth": 8}]
OUTPUTS = dict.fromkeys(("snr_o", "no_noise_o", "sigma_o", "c_sfm_o"), False)
REGISTERS = ("kappa", "c_sfm_gain")


def operands(pixel_width: int, count: int) -> dict[str, np.ndarray]:
    """Return peaks of every size, with the corners of each input first."""
    draw = generator(pixel_width)
    shift = pkg.COUNT_WIDTH - pixel_width
    maximum = draw.integers(0, 1 << pixel_width, count)
    background = (draw.random(count) ** 2 * (maximum << shift)).astype(np.int64)
    noise = draw.integers(0, 1 << 23, count, endpoint=True) >> draw.integers(0, 24, count)
    background[:4] = maximum[:4] << shift
    noise[2:6] = 0
    noise[6] = 1 << 23
    width = draw.integers(3, 256, count)
    total = (draw.integers(0, 65536, count) * width) >> draw.integers(0, 8, count)
    given = {
        "measured": draw.random(count) < 0.9,
        "clear": draw.random(count) < 0.3,
        "maximum": maximum,
        "background": background,
        "noise": noise,
        "width": width,
        "period": width - draw.integers(0, 2, count),
        "magnitude": draw.integers(0, 1 << 49, count) >> draw.integers(0, 49, count),
        "sum": total,
        "wave": ((2 * draw.random(count) - 1) * total * 16).astype(np.int64),
        "count": ((2 * draw.random(count) - 1) * width * 256).astype(np.int64),
        "power": draw.integers(0, 1 << 16, count),
        "kappa": draw.integers(0, 1 << 18, count) >> draw.integers(0, 18, count),
        "c_sfm_gain": draw.integers(0, 1 << 24, count) >> draw.integers(0, 24, count),
    }
    given["magnitude"][7:9] = 0
    given["measured"][:2] = True
    # Next to no light: the variance is below zero, and then one step of kappa f decides.
    dark = {"maximum": 100, "noise": 0, "wave": 0, "magnitude": 1 << 30, "measured": True}
    dark |= {"background": 1, "kappa": 9, "width": 255, "period": 255, "count": -255 * 256}
    for name, value in dark.items():
        given[name][8:10] = value
    given["sum"][8:10] = 0, 10
    return given


def model(given: dict[str, np.ndarray], pixel_width: int) -> dict[str, np.ndarray]:
    """Return the twin's answers, a call for each set of registers."""
    results: dict[str, list[np.ndarray]] = {name: [] for name in OUTPUTS}
    for k in range(len(given["maximum"])):
        line = {name: values[k : k + 1] for name, values in given.items()}
        registers = {name: int(line.pop(name)[0]) for name in REGISTERS}
        got = peak_confidence(**line, **registers, pixel_width=pixel_width)
        for name in OUTPUTS:
            results[name].append(getattr(got, name.removesuffix("_o")))
    return {name: np.concatenate(values) for name, values in results.items()}


def ports(given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the operands under the names of the ports."""
    return {f"{name}_i": values for name, values in given.items()}


@cocotb.test()
async def random_peaks(dut) -> None:
    """Every input at every magnitude, back to back."""
    width = parameters()["PixelWidth"]
    given = operands(width, 500)
    await reset(dut)
    got = await run_vectors(dut, ports(given), OUTPUTS, latency=latency())
    assert_equal(got, model(given, width), given)


@cocotb.test()
async def another_peak_meanwhile_is_ignored(dut) -> None:
    """A valid_i with other operands at any moment of the work changes nothing."""
    width = parameters()["PixelWidth"]
    given = operands(width, 20)
    want = model(given, width)
    await reset(dut)
    for age in range(1, latency(), 3):
        for name, values in ports(given).items():
            drive(port(dut, name), values[10])
        dut.valid_i.value = 1
        await FallingEdge(dut.clk_i)
        for clock in range(2, latency() + 1):
            dut.valid_i.value = int(clock - 1 == age)
            for name, values in ports(given).items():
                if name.removesuffix("_i") not in REGISTERS:
                    drive(port(dut, name), values[11])
            await FallingEdge(dut.clk_i)
            assert int(dut.valid_o.value) == (clock == latency()), f"clock {clock}, age {age}"
        got = {name: np.array([as_integer(port(dut, name), signed=False)]) for name in OUTPUTS}
        assert_equal(got, {name: values[10:11] for name, values in want.items()})


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """Reset at every moment of its work, with valid high."""
    width = parameters()["PixelWidth"]
    given = {name: values[10:12] for name, values in operands(width, 20).items()}
    want = model(given, width)
    await reset(dut)
    await reset_at_every_age(dut, ports(given), want, OUTPUTS, latency=latency())


@pytest.mark.parametrize("widths", each(ELABORATIONS, 3), ids=str)
def test_peak_confidence_rtl_equals_model(widths: dict[str, int]) -> None:
    simulate("peak_confidence", __file__, widths)


def test_sigma_gain_is_its_formula() -> None:
    exact = 16 * cordic_vector.GAIN * pkg.SINE_AMPLITUDE / (2 * math.pi * math.sqrt(2))
    assert round(exact) == pkg.SIGMA_GAIN


def test_peak_confidence_model_is_the_formula() -> None:
    """S/N within half a step, sigma within 0.1 % and one step, C_sfm within half a step."""
    given = operands(12, 20_000)
    power_max = 40_000
    given["kappa"][:] = round(0.2 * (1 << 16))
    given["c_sfm_gain"][:] = round(255 * 65536 / power_max)
    registers = {name: int(given.pop(name)[0]) for name in REGISTERS}
    got = peak_confidence(**given, **registers, pixel_width=12)

    height = given["maximum"] - given["background"] / 4096
    noise = given["noise"] / 4096
    with np.errstate(divide="ignore", invalid="ignore"):
        snr = np.where(height == 0, 0, height / noise)
    snr = np.minimum(snr, 65535 / 256)
    assert np.abs(got.snr / 256 - snr).max() <= 0.5 / 256 + 1e-12
    clear = given["clear"] & (given["noise"] > 0)
    sfm = np.where(clear, np.minimum(given["power"] / power_max, 1), 0)
    assert np.abs(got.c_sfm - sfm * 255).max() <= 0.5 + 255 * 2**-9

    # In counts of 12 bits; the fraction of the background counts for every pixel.
    fraction = (given["background"] & 255) / 4096
    free = given["width"] - given["count"] / 256
    shot = (given["sum"] - given["wave"] / 16) / 16 - fraction * free
    variance = (noise**2 * free + registers["kappa"] / 65536 * shot) / 2
    harmonic = given["magnitude"] / (cordic_vector.GAIN * pkg.SINE_AMPLITUDE * 16)
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = given["period"] / (2 * math.pi) * np.sqrt(np.maximum(variance, 0)) / harmonic
    judged = given["measured"] & (given["magnitude"] > 0) & (variance > 1e-4)
    assert judged.sum() > 5000
    error = np.abs(got.sigma / 4096 - np.minimum(sigma, 65535 / 4096))[judged]
    bound = 0.5 / 4096 + 1e-3 * np.minimum(sigma, 16)[judged]
    assert (error <= bound).all(), (error / bound).max()
