"""distortion: RTL against the model exactly, the model against VR-SCAN (5) in float64."""

from collections.abc import Iterator

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    assert_equal,
    drive,
    each,
    generator,
    parameters,
    port,
    reset,
    reset_at_every_age,
    restart_at_every_age,
    rounds,
    run_vectors,
    simulate,
)
from scanners import EACH_SCANNER

from vrscan.data import pkg
from vrscan.data.config import Config, Geometry
from vrscan.fixed.distortion import Distorted, distortion, latency, offset_width
from vrscan.ideal.geometry import undistorted
from vrscan.registers.chain_registers import Registers

ELABORATIONS = [{"LineLength": 2048}, {"LineLength": 2}, {"LineLength": 5000}]
OUTPUTS = {"offset_o": True, "slope_o": True, "saturated_o": False}
DATA = ["position_i"]
SHIPPED = ELABORATIONS[0]["LineLength"]


def operands(line_length: int, count: int) -> dict[str, np.ndarray]:
    """Return the corners of every port, then correctable lenses, then anything that fits."""
    draw = generator(line_length)
    pixels = (line_length - 1).bit_length()
    limits = {
        "position_i": 1 << pixels + pkg.POSITION_FRACTION,
        "centre_i": 1 << pixels + pkg.OFFSET_FRACTION,
        "k1_i": 1 << pkg.DISTORTION_WIDTH - 1,
        "k2_i": 1 << pkg.DISTORTION_WIDTH - 1,
    }
    ends = [np.array([-limit, -1, 0, 1, limit - 1]) for limit in limits.values()]
    corners = np.stack(np.meshgrid(*ends, [0, 1], indexing="ij")).reshape(5, -1)
    anything = np.stack(
        [draw.integers(-limit, limit, count) for limit in limits.values()]
        + [draw.integers(0, 2, count)]
    )
    # Every other one is a lens that can be corrected, down to one that is nearly perfect.
    sensible = anything[:, ::2]
    sensible[0] = draw.integers(0, line_length << pkg.POSITION_FRACTION, sensible.shape[1])
    sensible[1] = (line_length - 1) << (pkg.OFFSET_FRACTION - 1)
    sensible[2:4] >>= draw.integers(3, pkg.DISTORTION_WIDTH, (2, sensible.shape[1]))
    columns = np.concatenate([corners, anything], axis=1)
    return dict(zip([*limits, "even_i"], columns, strict=True))


def steep(line_length: int) -> dict[str, np.ndarray]:
    """Return lenses whose slope is about its least or largest value; gain and offset fit."""
    draw = generator(line_length + 1)
    pixels = (line_length - 1).bit_length()
    top = 1 << pkg.SLOPE_WIDTH - 1
    want = np.concatenate([np.arange(-top - 3, -top + 4), np.arange(top - 4, top + 3)])
    position = np.full((6, len(want)), 9 << pixels + pkg.POSITION_FRACTION) // 10
    shares = draw.uniform(-0.55, -0.4, position.shape)
    centre = np.round(shares * (1 << pixels + pkg.OFFSET_FRACTION)).astype(np.int64)
    s = position / (1 << pixels + pkg.POSITION_FRACTION)
    s -= centre / (1 << pixels + pkg.OFFSET_FRACTION)
    # 1 + 3 k1 s^2 + 5 k2 s^4 is the slope, k1 s^2 + k2 s^4 the gain: here -3/4 or 1/4.
    slope = want / (1 << pkg.SLOPE_FRACTION)
    gain = np.where(want < 0, -0.75, 0.25)
    k2 = np.round((slope - 1.0 - 3.0 * gain) / 2.0 / s**4 * (1 << pkg.DISTORTION_FRACTION))
    second = k2 / (1 << pkg.DISTORTION_FRACTION) * s**4
    k1 = np.round((slope - 1.0 - 5.0 * second) / 3.0 / s**2 * (1 << pkg.DISTORTION_FRACTION))
    columns = {"position_i": position, "centre_i": centre, "k1_i": k1, "k2_i": k2}
    given = {name: values.ravel().astype(np.int64) for name, values in columns.items()}
    return given | {"even_i": np.zeros_like(given["k1_i"])}


def evaluate(line_length: int, given: dict[str, np.ndarray]) -> Distorted:
    """Return the model's answer."""
    return distortion(
        given["position_i"],
        centre=given["centre_i"],
        k1=given["k1_i"],
        k2=given["k2_i"],
        even=given["even_i"] != 0,
        line_length=line_length,
    )


def expected(line_length: int, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the model's answer by port."""
    return {f"{name}_o": value for name, value in vars(evaluate(line_length, given)).items()}


def one_lens(dut, line_length: int) -> dict[str, np.ndarray]:
    """Set the configuration ports to a strong lens, and return positions with it."""
    given = operands(line_length, 60)
    lens = {
        "centre_i": (line_length - 1) << (pkg.OFFSET_FRACTION - 1),
        "k1_i": 5_033_165,
        "k2_i": -3_355_443,
        "even_i": 1,
    }
    for name, value in lens.items():
        drive(port(dut, name), value)
        given[name][:] = value
    return {name: values[-60:] for name, values in given.items()}


def only_data(given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the ports that change from point to point."""
    return {name: given[name] for name in DATA}


@cocotb.test()
async def random_lenses_back_to_back(dut) -> None:
    """Every corner of the ports and any lens, a new position in the clock of the last result."""
    line_length = parameters()["LineLength"]
    count = rounds(500, 5000)
    given = operands(line_length, count)
    ends = steep(line_length)
    given = {name: np.concatenate([ends[name], values]) for name, values in given.items()}
    want = expected(line_length, given)
    top = 1 << pkg.SLOPE_WIDTH - 1
    whole = want["slope_o"][~want["saturated_o"]]
    assert {-top, top - 1} <= set(whole), "no slope at the end of its range"
    assert 0.1 < np.mean(want["saturated_o"][-count:]) < 0.9, "one of the two cases is not tested"
    await reset(dut)
    got = await run_vectors(dut, given, OUTPUTS, latency=latency(line_length))
    assert_equal(got, want, given)


@cocotb.test()
async def position_changes_while_it_works(dut) -> None:
    """The port carries other positions between two results."""
    line_length = parameters()["LineLength"]
    await reset(dut)
    given = one_lens(dut, line_length)
    got = await run_vectors(dut, only_data(given), OUTPUTS, latency=latency(line_length), gaps=True)
    assert_equal(got, expected(line_length, given), given)


@cocotb.test()
async def restart_drops_the_first_position(dut) -> None:
    """A valid_i at every moment of the work: only the second result comes out."""
    line_length = parameters()["LineLength"]
    await reset(dut)
    given = one_lens(dut, line_length)
    want = expected(line_length, given)
    await restart_at_every_age(dut, only_data(given), want, OUTPUTS, latency=latency(line_length))


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """A reset with valid high: nothing comes out, and the next result is right."""
    line_length = parameters()["LineLength"]
    await reset(dut)
    given = one_lens(dut, line_length)
    want = expected(line_length, given)
    await reset_at_every_age(dut, only_data(given), want, OUTPUTS, latency=latency(line_length))


@cocotb.test()
async def reset_without_a_new_position(dut) -> None:
    """A reset at every moment of the work, valid low: nothing comes out."""
    line_length = parameters()["LineLength"]
    await reset(dut)
    for age in range(1, latency(line_length) + 1):
        dut.valid_i.value = 1
        for cycle in range(age + latency(line_length)):
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
            dut.rst_i.value = cycle == age - 1
            assert cycle < age or dut.valid_o.value == 0, f"a result after a reset at age {age}"
        dut.rst_i.value = 0


@EACH_VOLUME
@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_distortion_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("distortion", __file__, widths, volume=volume)


def lenses(share: float, geometry: Geometry) -> Iterator[Geometry]:
    """Return lenses that move the sensor's last pixel by ``share`` of its distance."""
    edge = geometry.pitch_mm * geometry.centre_px
    for first, second in [(1, 0), (-1, 0), (0, 1), (0, -1), (2, -1), (0.5, 0.5)]:
        for form in ("odd", "even"):
            k1, k2 = first * share / edge**2, second * share / edge**4
            yield geometry.model_copy(update={"k1": k1, "k2": k2, "distortion": form})


def as_quantised(geometry: Geometry, registers: Registers) -> Geometry:
    """Return the geometry that registers stand for."""
    reach_mm = 2.0 ** (registers.line_length - 1).bit_length() * geometry.pitch_mm
    scale = 2.0**-pkg.DISTORTION_FRACTION
    return geometry.model_copy(
        update={
            "k1": registers.k1 * scale / reach_mm**2,
            "k2": registers.k2 * scale / reach_mm**4,
            "centre_px": registers.centre * 2.0**-pkg.OFFSET_FRACTION,
        }
    )


def bound_px(position_px: np.ndarray, registers: Registers) -> np.ndarray:
    """Return the largest error of an offset that the widths allow, px."""
    reach = 2.0 ** (registers.line_length - 1).bit_length()
    scale = 2.0**-pkg.DISTORTION_FRACTION
    r = np.abs(position_px - registers.centre * 2.0**-pkg.OFFSET_FRACTION)
    s, k1, k2 = r / reach, registers.k1 * scale, registers.k2 * scale
    half_step = 2.0**-30
    square = 2 * s * half_step + half_step
    factor = abs(k2) * square + half_step
    gain = s**2 * factor + abs(k1 + k2 * s**2) * square + half_step
    return r * gain + 2.0 ** -(pkg.OFFSET_FRACTION + 1)


@EACH_SCANNER
@pytest.mark.parametrize("share", [0.01, 0.1])
def test_distortion_model_follows_equation_5(share: float, config: Config) -> None:
    """Offset within 2**-18 px and slope within 0.1 %, whole sensor, with the lens as quantised."""
    length = config.sensor.line_length
    position = np.arange(0, length << pkg.POSITION_FRACTION, 37)
    position_px = position * 2.0**-pkg.POSITION_FRACTION
    measured = predicted = unquantised = slope_measured = 0.0
    for geometry in lenses(share, config.geometry):
        registers = Registers.from_config(config.model_copy(update={"geometry": geometry}))
        result = distortion(
            position,
            centre=registers.centre,
            k1=registers.k1,
            k2=registers.k2,
            even=registers.even,
            line_length=length,
        )
        assert not result.saturated.any()
        offset_px = result.offset * 2.0**-pkg.OFFSET_FRACTION
        u, slope = undistorted(position_px, as_quantised(geometry, registers))
        error = np.abs(offset_px - u / geometry.pitch_mm)
        bound = bound_px(position_px, registers)
        assert np.all(error <= bound), geometry
        slope_error = np.abs(
            result.slope * 2.0**-pkg.SLOPE_FRACTION / (slope / geometry.pitch_mm) - 1.0
        )
        exact, _ = undistorted(position_px, geometry)
        measured = max(measured, float(error.max()))
        predicted = max(predicted, float(bound.max()))
        slope_measured = max(slope_measured, float(slope_error.max()))
        unquantised = max(unquantised, float(np.abs(offset_px - exact / geometry.pitch_mm).max()))
    floor = 2.0 ** -(pkg.OFFSET_FRACTION + 1)
    print(
        f"offset, {share:.0%} distortion, px: measured {measured:.3g} / predicted "
        f"{predicted:.3g} / floor {floor:.3g}; with k1, k2 before rounding {unquantised:.3g}; "
        f"slope {slope_measured:.2g} of its value"
    )
    assert predicted <= 2.0**-18
    # k1 and k2 are off by half a step each, which r s^2 and r s^4 carry to the edge.
    edge = 2.0 ** (length - 1).bit_length() / 2
    assert unquantised <= predicted + 2.0**-25 * (2.0**-2 + 2.0**-4) * edge
    assert slope_measured <= 1e-3


def test_distortion_model_saturates_in_order() -> None:
    """Beyond its limits the offset stays monotonic in k1, keeps its side and is flagged."""
    k1 = np.arange(-(1 << 25), 1 << 25, 1 << 15)
    position = np.full_like(k1, (SHIPPED << pkg.POSITION_FRACTION) - 1)
    result = distortion(position, centre=0, k1=k1, k2=0, even=False, line_length=SHIPPED)
    assert np.all(np.diff(result.offset) >= 0)
    # Full correction is reached where |k1| s^2 = 1, here within a pixel of |k1| = 1.
    share = np.abs(k1) / 2.0**pkg.DISTORTION_FRACTION
    assert np.array_equal(result.saturated, share * (position / (SHIPPED << 12)) ** 2 >= 1.0)
    assert np.abs(result.offset).max() < 1 << (offset_width(SHIPPED) - 1)


def test_distortion_model_without_distortion_is_a_difference() -> None:
    """A perfect lens: the offset is position - centre to the last bit, and the slope is 1."""
    given = operands(SHIPPED, 2000)
    given["k1_i"][:] = given["k2_i"][:] = 0
    result = evaluate(SHIPPED, given)
    assert np.array_equal(result.offset, (given["position_i"] << 8) - given["centre_i"])
    assert np.all(result.slope == 1 << pkg.SLOPE_FRACTION)
    assert not result.saturated.any()
