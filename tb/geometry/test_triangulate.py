"""triangulate: RTL against the model exactly, the model against VR-SCAN (3) and (4) in float64."""

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import NormalDist

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
    port,
    reset,
    reset_at_every_age,
    rounds,
    run_vectors,
    simulate,
)
from scanners import EACH_SCANNER
from test_distortion import bound_px, lenses

from vrscan.data import pkg
from vrscan.data.config import Config, Geometry
from vrscan.fixed.distortion import distortion, offset_width
from vrscan.fixed.quarter_wave import MAX_STEP, error_bound
from vrscan.fixed.triangulate import AMPL_WIDTH, BUSY, FRACTION, LATENCY, Triangulated, triangulate
from vrscan.ideal import geometry as ideal
from vrscan.registers.chain_registers import Registers, angle_turns

ELABORATIONS = [
    {"LineLength": 2048, "UserWidth": 40},
    {"LineLength": 2, "UserWidth": 1},
    {"LineLength": 5000, "UserWidth": 8},
]
SHIPPED = ELABORATIONS[0]["LineLength"]
OUTPUTS = {
    "measured_o": False,
    "x_o": True,
    "z_o": True,
    "sigma_z_o": False,
    "c_obj_o": False,
    "no_range_o": False,
    "out_of_range_o": False,
    "lost_o": False,
    "user_o": False,
}
CONSTANTS = ["n0", "n1", "d0", "d1", "e0", "e1", "tolerance", "c_obj_gain"]
MM = 2.0**-pkg.LENGTH_FRACTION
SIGMA = 2.0**-pkg.SIGMA_FRACTION
LENGTH_END = 1 << (pkg.LENGTH_WIDTH - 1)
SIGMA_MAX = (1 << pkg.SIGMA_WIDTH) - 1

Columns = dict[str, np.ndarray]


def instrument(draw: np.random.Generator) -> Geometry:
    """Return a random instrument whose sensor of any length is 14 mm long."""
    return Geometry(
        base_mm=draw.uniform(20, 200),
        bias_deg=draw.uniform(60, 110),
        offset_mm=draw.uniform(-50, 50),
        focal_mm=draw.uniform(12, 50),
        confidence=("tolerance", "printed")[int(draw.integers(2))],
        snr_max=draw.uniform(1, 255),
    )


def constants_of(geometry: Geometry) -> dict[str, int]:
    """Return the constants of an instrument by port; a constant is per R, so for any length."""
    registers = Registers.from_config(Config(geometry=geometry))
    return {f"{name}_i": getattr(registers, name) for name in CONSTANTS}


def operands(widths: dict[str, int], count: int) -> Columns:
    """Return corners of all ports, then points that an instrument can see, then anything."""
    line_length = widths["LineLength"]
    draw = generator(line_length)
    offset_end = 1 << (offset_width(line_length) - 1)
    slope_end = 1 << (pkg.SLOPE_WIDTH - 1)
    turn = 1 << pkg.ANGLE_WIDTH
    end = 1 << (pkg.GEOMETRY_WIDTH - 1)

    def ends(low: int, high: int) -> np.ndarray:
        return draw.choice([low, low + 1, -1 if low else 1, 0, 1, high - 2, high - 1], count)

    corners: Columns = {
        "offset_i": ends(-offset_end, offset_end),
        "slope_i": ends(-slope_end, slope_end),
        "sigma_i": ends(0, SIGMA_MAX + 1),
        "typical_i": ends(0, SIGMA_MAX + 1),
        "angle_i": draw.choice([-turn // 2, -turn // 4, -1, 0, 1, turn // 4, turn // 2 - 1], count),
    }
    corners |= {f"{name}_i": ends(-end, end) for name in CONSTANTS[:6]}
    corners["snr_i"] = ends(0, 1 << pkg.SNR_WIDTH)
    corners["tolerance_i"] = ends(0, 1 << pkg.TOLERANCE_WIDTH)
    corners["c_obj_gain_i"] = ends(0, 1 << pkg.OBJECT_GAIN_WIDTH)

    seen: Columns = {
        "offset_i": draw.integers(-offset_end // 4, offset_end // 4, count),
        "slope_i": draw.integers(62_000, 69_000, count),
        "sigma_i": draw.integers(0, 1 << 12, count) >> draw.integers(0, 12, count),
        "typical_i": draw.integers(0, 1 << 12, count) >> draw.integers(0, 12, count),
        "snr_i": draw.integers(0, 1 << pkg.SNR_WIDTH, count),
        "angle_i": draw.integers(-turn // 14, turn // 14, count),
    }
    instruments = [constants_of(instrument(draw)) for _ in range(8)]
    seen |= {
        f"{name}_i": np.array([instruments[k % 8][f"{name}_i"] for k in range(count)])
        for name in CONSTANTS
    }

    anything: Columns = {
        "offset_i": draw.integers(-offset_end, offset_end, count),
        "slope_i": draw.integers(-slope_end, slope_end, count),
        "sigma_i": draw.integers(0, SIGMA_MAX + 1, count),
        "typical_i": draw.integers(0, SIGMA_MAX + 1, count),
        "snr_i": draw.integers(0, 1 << pkg.SNR_WIDTH, count) >> draw.integers(0, 16, count),
        "angle_i": draw.integers(-turn // 2, turn // 2, count),
    }
    anything |= {
        f"{name}_i": draw.integers(-end, end, count) >> draw.integers(0, 32, count)
        for name in CONSTANTS[:6]
    }
    anything["tolerance_i"] = draw.integers(0, 1 << pkg.TOLERANCE_WIDTH, count)
    gain = draw.integers(0, 1 << pkg.OBJECT_GAIN_WIDTH, count)
    anything["c_obj_gain_i"] = gain * draw.integers(0, 2, count)
    given = {name: np.concatenate([corners[name], seen[name], anything[name]]) for name in corners}
    given["measured_i"] = (draw.random(3 * count) < 0.9).astype(np.int64)
    given["saturated_i"] = (draw.random(3 * count) < 0.1).astype(np.int64)
    given["user_i"] = draw.integers(0, 1 << widths["UserWidth"], 3 * count)
    return given


def of_one_instrument(dut, widths: dict[str, int], count: int) -> Columns:
    """Set the constants to those of one instrument, and return points that it can see."""
    given = {name: values[count : 2 * count] for name, values in operands(widths, count).items()}
    for name, value in constants_of(Geometry()).items():
        given[name] = np.full(count, value)
        drive(port(dut, name), value)
    return given


def only_data(given: Columns) -> Columns:
    """Return the ports that change from point to point."""
    return {name: given[name] for name in given if name[:-2] not in CONSTANTS}


def evaluate(line_length: int, given: Columns) -> Triangulated:
    """Return the model's answer."""
    return triangulate(
        given["offset_i"],
        given["slope_i"],
        given["sigma_i"],
        given["angle_i"],
        typical=given["typical_i"],
        snr=given["snr_i"],
        measured=given["measured_i"] != 0,
        saturated=given["saturated_i"] != 0,
        **{name: given[f"{name}_i"] for name in CONSTANTS},
        line_length=line_length,
    )


def expected(line_length: int, given: Columns) -> Columns:
    """Return the model's answer by port, for points of which none was dropped."""
    want = {f"{name}_o": value for name, value in vars(evaluate(line_length, given)).items()}
    want |= {f"{name}_o": given[f"{name}_i"] for name in ("measured", "user")}
    want["lost_o"] = np.zeros_like(given["user_i"])
    return want


@cocotb.test()
async def any_point_back_to_back(dut) -> None:
    """Corners, visible points and noise on all ports, as fast as it takes points."""
    widths = parameters()
    given = operands(widths, rounds(350, 3000))
    want = expected(widths["LineLength"], given)
    for name in ("measured_o", "no_range_o", "out_of_range_o"):
        assert 0.01 < np.mean(want[name]) < 0.99, f"{name} is hardly ever different"
    assert np.mean((want["z_o"] != 0) & (want["sigma_z_o"] < SIGMA_MAX)) > 0.1
    await reset(dut)
    dut.ready_i.value = 1
    got = await run_vectors(dut, given, OUTPUTS, latency=LATENCY, spacing=BUSY)
    assert_equal(got, want, given)


@cocotb.test()
async def ports_change_while_it_works(dut) -> None:
    """The ports carry other points between two results."""
    widths = parameters()
    await reset(dut)
    dut.ready_i.value = 1
    given = of_one_instrument(dut, widths, 60)
    got = await run_vectors(dut, only_data(given), OUTPUTS, latency=LATENCY, gaps=True)
    assert_equal(got, expected(widths["LineLength"], given), given)


@cocotb.test()
async def reset_mid_work(dut) -> None:
    """A reset with valid high: nothing comes out, and the next result is right."""
    widths = parameters()
    await reset(dut)
    dut.ready_i.value = 1
    given = of_one_instrument(dut, widths, 60)
    want = expected(widths["LineLength"], given)
    await reset_at_every_age(dut, only_data(given), want, OUTPUTS, latency=LATENCY)


@cocotb.test()
async def reset_without_a_new_point(dut) -> None:
    """A reset at every moment, valid low: no result, no drop, and lost points are forgotten."""
    widths = parameters()
    await reset(dut)
    given = of_one_instrument(dut, widths, 60)
    want = expected(widths["LineLength"], given)
    for age in range(1, LATENCY + 2):
        # The second point of two in a row is dropped, so there is something to forget.
        for cycle in range(LATENCY + 2):
            dut.valid_i.value = cycle < 2
            dut.rst_i.value = cycle == age
            await FallingEdge(dut.clk_i)
            assert cycle < age or dut.valid_o.value == 0, f"a result after a reset at age {age}"
            assert cycle < age or dut.dropped_o.value == 0, f"a drop after a reset at age {age}"
    dut.rst_i.value = 0
    dut.ready_i.value = 1
    got = await run_vectors(dut, only_data(given), OUTPUTS, latency=LATENCY)
    assert_equal(got, want, given)


@dataclass
class Flow:
    """What the module does with its points: which it takes, drops and holds, clock by clock."""

    want: Columns
    work: int | None = None
    work_age: int = 0
    work_lost: bool = False
    missing: bool = False
    held: int | None = None
    held_lost: bool = False
    dropped: bool = False
    drops_busy: int = 0
    drops_full: int = 0
    came_out: int = 0

    def done_next(self) -> bool:
        """Return whether the next clock edge ends the work on a point."""
        return self.work is not None and self.work_age == LATENCY - 1

    def clock(self, arriving: int | None, ready: bool) -> None:
        """Take one clock edge with these inputs."""
        done = self.done_next()
        self.work_age += 1
        full = self.held is not None and not ready
        self.came_out += self.held is not None and ready
        if ready:
            self.held = None
        drop_full = done and full
        if done and not full:
            self.held, self.held_lost = self.work, self.work_lost
        if done:
            self.work = None
        drop_busy = arriving is not None and self.work is not None
        self.dropped = drop_full or drop_busy
        self.missing |= self.dropped
        if arriving is not None and not drop_busy:
            self.work, self.work_age = arriving, 1
            self.work_lost, self.missing = self.missing, False
        self.drops_full += drop_full
        self.drops_busy += drop_busy

    def check(self, dut, edge: int) -> None:
        """Compare the ports after that edge."""
        assert int(dut.dropped_o.value) == self.dropped, f"dropped_o at edge {edge}"
        assert int(dut.valid_o.value) == (self.held is not None), f"valid_o at edge {edge}"
        if self.held is not None:
            for name, signed in OUTPUTS.items():
                want = self.held_lost if name == "lost_o" else self.want[name][self.held]
                got = as_integer(port(dut, name), signed=signed)
                assert got == want, f"{name} at edge {edge}, point {self.held}: {got}, want {want}"


@cocotb.test()
async def drops_are_told(dut) -> None:
    """Points too fast and a receiver too slow: drops are pulsed, and the next point says so."""
    widths = parameters()
    count = rounds(240, 2000)
    await reset(dut)
    given = of_one_instrument(dut, widths, count)
    flow = Flow(expected(widths["LineLength"], given))
    data = only_data(given)
    draw = generator(9)
    gaps = draw.choice([1, BUSY - 1, BUSY, BUSY + 1, LATENCY + 1, 50, 400], count)
    sends = dict(zip(np.cumsum(gaps).tolist(), range(count), strict=True))
    ready, ready_left, last_moments = False, 0, 0
    for edge in range(int(gaps.sum()) + 3 * LATENCY):
        if ready_left == 0:
            ready = not ready
            ready_left = int(draw.choice([1, 2, 40, 500 if not ready else 200]))
        ready_left -= 1
        # The place becomes free in the very clock in which the next point needs it.
        if flow.held is not None and flow.done_next() and draw.random() < 0.5:
            ready, ready_left = True, 1
            last_moments += 1
        k = sends.get(edge)
        dut.valid_i.value = k is not None
        for name, values in data.items() if k is not None else ():
            drive(port(dut, name), values[k])
        dut.ready_i.value = ready
        flow.clock(k, ready)
        await FallingEdge(dut.clk_i)
        flow.check(dut, edge)
    still_held = flow.held is not None
    assert flow.came_out + flow.drops_busy + flow.drops_full + still_held == count
    assert min(flow.came_out, flow.drops_busy, flow.drops_full, last_moments) > 10


@EACH_VOLUME
@pytest.mark.parametrize("widths", each(ELABORATIONS), ids=str)
def test_triangulate_rtl_equals_model(widths: dict[str, int], volume: str) -> None:
    simulate("triangulate", __file__, widths, volume=volume)


@dataclass(frozen=True)
class View:
    """Every position of the sensor, at scan angles that give z from one end to the other."""

    position: np.ndarray  # px, 12 fraction bits
    angle: np.ndarray  # s24 fractions of a turn

    @classmethod
    def of(
        cls, geometry: Geometry, length: int, distances: int, ends_mm: tuple[float, float]
    ) -> "View":
        """Return ``distances`` distances at each position, which has a random fraction."""
        draw = generator(distances)
        pixel = np.arange(length)[:, None] << pkg.POSITION_FRACTION
        position = pixel + draw.integers(-2048, 2048, (length, distances))
        position = np.clip(position, 0, (length - 1) << pkg.POSITION_FRACTION)
        u, _ = ideal.undistorted(position * MM, geometry)
        beta = geometry.bias_rad + np.arctan(u / geometry.focal_mm)
        z = np.linspace(*ends_mm, distances) + np.zeros(position.shape)
        x = geometry.base_mm - (z - geometry.offset_mm) / np.tan(beta)
        return cls(position.ravel(), angle_turns(np.arctan2(x, z)).ravel())

    @property
    def position_px(self) -> np.ndarray:
        """The positions in px."""
        return self.position * MM

    @property
    def angle_rad(self) -> np.ndarray:
        """The angles in rad."""
        return self.angle * (2 * np.pi / (1 << pkg.ANGLE_WIDTH))


def chain(view: View, registers: Registers, sigma: int) -> tuple[Triangulated, np.ndarray]:
    """Return the points of ``distortion`` and ``triangulate``, and the offsets between them."""
    corrected = distortion(
        view.position,
        centre=registers.centre,
        k1=registers.k1,
        k2=registers.k2,
        even=registers.even,
        line_length=registers.line_length,
    )
    assert not corrected.saturated.any()
    points = triangulate(
        corrected.offset,
        corrected.slope,
        np.full_like(view.position, sigma),
        view.angle,
        **{name: getattr(registers, name) for name in CONSTANTS},
        line_length=registers.line_length,
    )
    return points, corrected.offset


def bounds(
    view: View, registers: Registers, s: np.ndarray, extra_px: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the point from the constants as they are, and the largest error of x or z.

    Both are in the unit of length.

    Args:
        view: Positions and angles.
        registers: The constants.
        s: Exact offset in units of R.
        extra_px: Error of the offset, px.
        step: Error of a constant in its last bits: 0 as quantised, 1/2 as before rounding.
    """
    n0, n1 = (getattr(registers, n) * 2.0**-pkg.BASE_FRACTION for n in ("n0", "n1"))
    d0, d1, e0, e1 = (getattr(registers, n) * 2.0**-pkg.RAY_FRACTION for n in CONSTANTS[2:6])
    sine, cosine = np.sin(view.angle_rad), np.cos(view.angle_rad)
    n, ray_cosine, ray_sine = n0 + n1 * s, d0 + d1 * s, e0 + e1 * s
    d = ray_cosine * cosine + ray_sine * sine
    q = n / d
    reach = 2.0 ** (registers.line_length - 1).bit_length()

    half = 0.5 + step * (1 + np.abs(s))
    n_error = half * 2.0**-pkg.BASE_FRACTION
    d_error = (half * (np.abs(cosine) + np.abs(sine)) + 2 * 0.5) * 2.0**-pkg.RAY_FRACTION
    s_error = 2.0 ** -(FRACTION + 1) + extra_px / reach
    # The length of (cosine, sine) cancels; what is left of its error turns the ray.
    turn = np.sqrt(2.0) * (error_bound(AMPL_WIDTH) * 2.0**-FRACTION - MAX_STEP**2 / 4)
    q_error = (n_error + q * d_error) / d + 0.5 * 2.0**-pkg.BASE_FRACTION
    along = np.abs(n1 - q * (d1 * cosine + e1 * sine)) / d
    across = q * (1.0 + np.abs(ray_sine * cosine - ray_cosine * sine) / d)
    rounding = 0.5 * (2.0**-pkg.BASE_FRACTION + MM)
    bound = q_error + along * s_error + across * turn + rounding
    return np.stack([q * sine, q * cosine]), bound


def instruments(geometry: Geometry) -> Iterator[Geometry]:
    """Return a geometry without, and with every lens of, 1 % distortion."""
    yield geometry
    yield from lenses(0.01, geometry)


@EACH_SCANNER
def test_triangulate_model_follows_equations_3_to_5(config: Config) -> None:
    """x and z within 2 um a mm of unit_mm, in the whole view, lenses up to 1 % included."""
    unit_mm, length = config.geometry.unit_mm, config.sensor.line_length
    ends_mm = config.focus.near_mm, config.focus.far_mm
    worst = dict.fromkeys(["measured", "predicted", "unquantised", "allowed", "sigma"], 0.0)
    sigma = 205  # 0.05 px
    for geometry in instruments(config.geometry):
        registers = Registers.from_config(config.model_copy(update={"geometry": geometry}))
        view = View.of(geometry, length, 40, ends_mm)
        points, offset = chain(view, registers, sigma)
        assert not points.no_range.any()
        assert not points.out_of_range.any()
        got = np.stack([points.x, points.z]) * MM

        # The same integers, so without the errors of distortion and of the constants.
        reach = 2.0 ** (length - 1).bit_length()
        s = offset * 2.0**-pkg.OFFSET_FRACTION / reach
        exact, bound = bounds(view, registers, s, np.zeros_like(s), 0.0)
        error = np.abs(got - exact).max(axis=0)
        assert np.all(error <= bound), f"{error.max()} mm, {geometry}"
        worst["measured"] = max(worst["measured"], float(error.max()))
        worst["predicted"] = max(worst["predicted"], float(bound.max()))

        # The paper's equations from positions to points.
        u, u_slope = ideal.undistorted(view.position_px, geometry)
        located = ideal.triangle(u, view.angle_rad, geometry)
        r, s = view.position_px - geometry.centre_px, u / geometry.pitch_mm / reach
        lens_px = np.abs(r) * ((r / reach) ** 2 + (r / reach) ** 4) * 2.0**-25
        extra_px = bound_px(view.position_px, registers) + lens_px
        _, allowed = bounds(view, registers, s, extra_px, 0.5)
        error = np.abs(got - np.stack([located.x, located.z]) / unit_mm).max(axis=0)
        assert np.all(error <= 1.001 * allowed), f"{error.max()} mm, {geometry}"
        worst["unquantised"] = max(worst["unquantised"], float(error.max()))
        worst["allowed"] = max(worst["allowed"], float(allowed.max()))

        sigma_z = np.abs(located.slope * u_slope) / unit_mm * sigma * SIGMA
        error = np.abs(points.sigma_z * SIGMA - sigma_z)
        assert np.all(error <= np.maximum(0.005 * sigma_z, SIGMA))
        worst["sigma"] = max(worst["sigma"], float(error.max() / SIGMA))
    print(
        f"x and z, um a mm of unit_mm: measured {1e3 * worst['measured']:.3f} / predicted "
        f"{1e3 * worst['predicted']:.3f} / floor {1e3 * MM / 2:.3f}; through distortion, constants "
        f"before rounding: measured {1e3 * worst['unquantised']:.3f} / predicted "
        f"{1e3 * worst['allowed']:.3f}; sigma_z off by {worst['sigma']:.2f} steps"
    )
    assert worst["allowed"] <= 2e-3
    assert worst["unquantised"] <= 2e-3


def one(geometry: Geometry, position_px: np.ndarray, angle_deg: np.ndarray) -> Triangulated:
    """Return the points of an instrument with a perfect lens."""
    registers = Registers.from_config(Config(geometry=geometry))
    position_px, angle_deg = np.broadcast_arrays(position_px, angle_deg)
    position = np.round(position_px / MM).astype(np.int64)
    points, _ = chain(
        View(position.ravel(), angle_turns(np.radians(angle_deg.ravel()))), registers, 1
    )
    return points


def test_line_of_sight_at_90_degrees() -> None:
    """Beta = 90 degrees, where (3) has an infinite tangent: x is the base, z follows the angle."""
    angle = np.linspace(1.8, 40.0, 500)
    points = one(Geometry(bias_deg=90.0), np.array(1023.5), angle)
    assert not points.no_range.any()
    assert np.abs(points.x * MM - 60.0).max() <= 5e-4
    radians = angle_turns(np.radians(angle)) * (2 * np.pi / (1 << pkg.ANGLE_WIDTH))
    error = np.abs(points.z * MM - 60.0 / np.tan(radians))
    # dz/da grows with the square of z, from 250 mm to almost 2 m.
    assert np.all(error <= 2e-3 * np.maximum(1.0, (points.z * MM / 1000.0) ** 2))


def test_laser_straight_ahead() -> None:
    """Alpha = 0: x is 0 to a step, z is that of beta alone."""
    position = np.arange(0.0, 1300.0)
    points = one(Geometry(), position, np.array(0.0))
    beta = np.radians(82.0) + np.arctan((position - 1023.5) * 0.007 / 25.0)
    assert np.abs(points.x).max() <= 1
    assert np.abs(points.z * MM - 60.0 * np.tan(beta)).max() <= 2e-3


def test_rays_that_part() -> None:
    """Parallel rays and beyond: no range, x = z = 0 and the largest sigma; before, far points."""
    # The line of sight of px 1023.5 stands at 82 degrees: parallel at an angle of -8 degrees.
    angle = np.linspace(-30.0, 30.0, 6001)
    points = one(Geometry(), np.array(1023.5), angle)
    q = 60.0 * np.sin(np.radians(82.0)) / np.maximum(np.sin(np.radians(angle + 8.0)), 1e-9)
    assert np.array_equal(points.no_range, (angle <= -8.0) | (q >= 4096.0))
    none = points.no_range
    assert np.all(points.x[none] == 0)
    assert np.all(points.z[none] == 0)
    assert np.all(points.sigma_z[none] == SIGMA_MAX)
    assert not points.out_of_range[none].any()
    z = q * np.cos(np.radians(angle))
    assert np.array_equal(points.out_of_range[~none], z[~none] * 4096 >= LENGTH_END)
    beyond = points.out_of_range
    assert beyond.any()
    assert not (points.x[beyond].any() or points.z[beyond].any() or points.c_obj[beyond].any())
    assert np.all(points.sigma_z[beyond] == SIGMA_MAX)


def test_exactly_parallel_rays() -> None:
    """A divisor of exactly zero."""
    result = triangulate(
        *(np.array([v]) for v in (0, 1 << 16, 1, 0)),
        n0=1 << 20, n1=0, d0=0, d1=0, e0=1 << 29, e1=0, tolerance=16777, line_length=SHIPPED,
    )  # fmt: skip
    # The table's sine of 0 is a few 1e-9, so even this has a sign: either way there is no range.
    assert result.no_range.all()
    assert result.x[0] == result.z[0] == 0
    assert result.sigma_z[0] == SIGMA_MAX
    result = triangulate(
        *(np.array([v]) for v in (0, 1 << 16, 1, 0)),
        n0=1 << 20, n1=0, d0=0, d1=0, e0=0, e1=0, tolerance=16777, line_length=SHIPPED,
    )  # fmt: skip
    assert result.no_range.all()


def test_points_behind_the_mirror() -> None:
    """A line of sight that meets the laser's line behind the mirror: no range."""
    # The line of sight crosses the laser's line 26 mm behind the mirror: n < 0, d > 0.
    geometry = Geometry(bias_deg=60.0, offset_mm=-130.0)
    points = one(geometry, np.array(1023.5), np.linspace(-10.0, 10.0, 100))
    constants = constants_of(geometry)
    assert constants["n0_i"] < 0
    assert constants["d0_i"] > 0
    assert points.no_range.all()
    assert np.all(points.z == 0)


def test_unmeasured_points_are_zero() -> None:
    """No position: every result is 0, whatever the ports carry."""
    given = operands({"LineLength": SHIPPED, "UserWidth": 1}, 500)
    given["measured_i"][:] = 0
    for values in vars(evaluate(SHIPPED, given)).values():
        assert not np.any(values)


def test_saturated_offsets_are_out_of_range() -> None:
    """An offset that distortion could not represent is no point."""
    given = operands({"LineLength": SHIPPED, "UserWidth": 1}, 500)
    given["measured_i"][:] = given["saturated_i"][:] = 1
    result = evaluate(SHIPPED, given)
    assert np.array_equal(result.out_of_range, ~result.no_range)
    assert not (result.x.any() or result.z.any() or result.c_obj.any())


def test_sigma_scales_and_saturates() -> None:
    """sigma_z is proportional to sigma and to |slope| up to the largest number, then stays."""
    sigma = np.arange(0, SIGMA_MAX + 1)
    constants = {name: constants_of(Geometry())[f"{name}_i"] for name in CONSTANTS}
    for slope in (1 << 16, -(1 << 16), 1 << 14):
        result = triangulate(
            np.full_like(sigma, -300 << 20),
            np.full_like(sigma, slope),
            sigma,
            np.zeros_like(sigma),
            **constants,
            line_length=SHIPPED,
        )
        u = np.array(-300 * Geometry().pitch_mm)
        unit = ideal.triangle(u, np.array(0.0), Geometry()).slope * Geometry().pitch_mm
        want = np.abs(unit * slope / (1 << 16)) * sigma
        assert np.abs(result.sigma_z - np.minimum(want, SIGMA_MAX)).max() <= max(
            1.0, 0.005 * SIGMA_MAX
        )
        assert np.all(np.diff(result.sigma_z) >= 0)


@pytest.mark.parametrize("snr_max", [1.0, 7.3, 255.9])
def test_confidence_is_a_share_of_the_snr_as_printed(snr_max: float) -> None:
    """c_obj is (9) where that is asked for, whatever the sigma; 0 without a point."""
    snr = np.arange(1 << pkg.SNR_WIDTH)
    draw = generator(78)
    constants = constants_of(Geometry(confidence="printed", snr_max=snr_max))
    result = triangulate(
        draw.integers(-1400 << 20, 1400 << 20, len(snr)),
        np.full_like(snr, 1 << 16),
        draw.integers(0, 1 << 16, len(snr)),
        draw.integers(0, 1 << 19, len(snr)),
        snr=snr,
        **{name: constants[f"{name}_i"] for name in CONSTANTS},
        line_length=SHIPPED,
    )
    found = ~(result.no_range | result.out_of_range)
    assert 0.1 < found.mean() < 1.0 and not result.c_obj[~found].any()
    share = np.minimum(snr * 2.0**-pkg.SNR_FRACTION / snr_max, 1.0)
    # Half a step of c_obj, and half the gain's last bit times the largest S/N.
    allowed = 0.5 / 255 + 0.5 * 2.0 ** (pkg.SNR_WIDTH - pkg.OBJECT_GAIN_FRACTION) / 255
    error = np.abs(result.c_obj / 255 - share)[found].max()
    print(f"c_obj: measured {error:.5f} / predicted {allowed:.5f} / floor {0.5 / 255:.5f}")
    assert error <= allowed


def test_confidence_is_a_gaussian_s_share() -> None:
    """c_obj is what a Gaussian of sigma_z has within the tolerance: drawn, and as erf has it."""
    draw = generator(77)
    sigma = draw.integers(0, 1 << 13, 4000)
    geometry = Geometry(tolerance=0.0007)
    constants = {name: constants_of(geometry)[f"{name}_i"] for name in CONSTANTS}
    result = triangulate(
        draw.integers(-600 << 20, 600 << 20, 4000),
        np.full_like(sigma, 1 << 16),
        sigma,
        draw.integers(0, 1 << 19, 4000),
        **constants,
        line_length=SHIPPED,
    )
    found = ~(result.no_range | result.out_of_range)
    seen = found & (result.sigma_z > 0) & (result.sigma_z < SIGMA_MAX)
    z, sigma_z = result.z[seen] * MM, result.sigma_z[seen] * SIGMA
    assert seen.sum() > 3000
    assert np.all(result.c_obj[found & (result.sigma_z == 0)] == 255)
    # Half a step of the table, whose slope is at most sqrt(2 / pi); its own rounding; the
    # tolerance's last bit.
    allowed = 0.5 / 255 + np.sqrt(2 / np.pi) / 128 + 1e-4
    share = np.array([NormalDist(0, s).cdf(0.0007 * d) for s, d in zip(sigma_z, z, strict=True)])
    error = np.abs(result.c_obj[seen] / 255 - (2 * share - 1)).max()
    print(f"c_obj: measured {error:.4f} / predicted {allowed:.4f} / floor {0.5 / 255:.4f}")
    assert error <= allowed
    drawn = np.abs(draw.normal(size=(400, seen.sum())) * sigma_z) < 0.0007 * z
    middle = (result.c_obj[seen] > 20) & (result.c_obj[seen] < 235)
    assert middle.sum() > 500
    assert abs(drawn[:, middle].mean() - result.c_obj[seen][middle].mean() / 255) < 0.004
