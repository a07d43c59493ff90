"""The triangle where its equations fail: vertical lines of sight, parallel rays, strong lenses."""

from collections.abc import Iterator, Sequence

import numpy as np

from vrscan.data import pkg
from vrscan.data.config import Geometry
from vrscan.fixed.triangulate import triangulate
from vrscan.study.cases.case import Case, LineCase, ModuleCase, Outcome
from vrscan.study.cases.case_errors import PHANTOM, Value, summary
from vrscan.study.cases.case_shapes import spot

CENTRE = 1024.0
REACH_MM = 2048 * 0.007  # R, mm: 2**clog2(LineLength) pixels


def _places(
    name: str,
    breaks: str,
    defined: str,
    places: Sequence[tuple[float, float]],
    geometry: Geometry | None = None,
    no_range: Sequence[int] = (),
    out_of_range: Sequence[int] = (),
) -> LineCase:
    """Return an entry from pairs of position, px, and scan angle, degrees."""
    return LineCase(
        name,
        breaks,
        defined,
        tuple(spot(position) for position, _ in places),
        geometry=geometry or Geometry(),
        angle_deg=tuple(angle for _, angle in places),
        no_range=tuple(no_range),
        out_of_range=tuple(out_of_range),
    )


def _vertical() -> Iterator[Case]:
    yield _places(
        "beta-near-90",
        "tan(beta) of (3) changes sign through infinity inside the field of view, at px 1525.4",
        "no tangent is taken; x and z within 2 um to 1 m, more as the square of the distance",
        [(p, a) for p in (1525.0, 1525.5, 1526.0) for a in (3.5, 5.0, 10.0, 20.5)],
    )
    vertical = Geometry(bias_deg=90.0, centre_px=CENTRE)
    yield _places(
        "beta-90",
        "tan(beta) is infinite; as float64 has no pi/2 it is 1.6e16 there",
        "x is the base, 60 mm, z follows the angle; within 2 um to 1 m",
        [(CENTRE, a) for a in (3.5, 5.0, 10.0, 20.5)],
        vertical,
    )
    yield _places(
        "beta-90-alpha-0",
        "both rays are vertical: infinity over infinity",
        "NO_RANGE: x = z = 0, sigma_z at its largest",
        [(CENTRE, 0.0)],
        vertical,
        no_range=[0],
    )


def _parallel() -> Iterator[Case]:
    bias = Geometry(centre_px=CENTRE)  # the line of sight of px 1024 stands at 82 degrees
    yield _places(
        "rays-parallel",
        "the denominator of (3) is 0, or what rounding leaves of it",
        "4096 mm away or more, or behind: NO_RANGE",
        [(CENTRE, -8.0 + d) for d in (-1e-4, 0.0, 1e-4, 0.1, 0.8)],
        bias,
        no_range=range(5),
    )
    yield _places(
        "rays-nearly-parallel",
        "the denominator is small: points 2.1 to 3.8 m away",
        "z beyond 2048 mm is no point: OUT_OF_RANGE, x = z = 0",
        [(CENTRE, -8.0 + d) for d in (0.9, 1.2, 1.6)],
        bias,
        out_of_range=range(3),
    )
    yield _places(
        "denominator-small",
        "points at 1.1 and 2.0 m, where a step of the angle is 5 to 18 um",
        "within 2 um times the square of the distance in m",
        [(CENTRE, -8.0 + d) for d in (1.7, 2.0, 3.0)],
        bias,
    )
    yield _places(
        "point-behind-the-camera",
        "beyond the parallel the lines still meet, behind mirror and camera",
        "NO_RANGE",
        [(CENTRE, -8.0 - d) for d in (0.1, 1.0, 5.0, 12.5)] + [(2000.0, 0.0), (1600.0, -5.0)],
        bias,
        no_range=range(6),
    )
    yield _places(
        "point-behind-the-mirror",
        "camera 130 mm ahead, bias 60 degrees: the line of sight meets the laser's behind it",
        "the numerator is negative: NO_RANGE",
        [(CENTRE, a) for a in (-10.0, 0.0, 10.0)],
        Geometry(bias_deg=60.0, offset_mm=-130.0, centre_px=CENTRE),
        no_range=range(3),
    )

    def smallest() -> Outcome:
        # A d of one unit in 2^-30, and a d of exactly zero.
        one = np.ones(2, np.int64)
        got = triangulate(
            0 * one, one << pkg.SLOPE_FRACTION, one, 0 * one,
            n0=1 << pkg.BASE_FRACTION, n1=0, d0=np.array([1, 0]), d1=0, e0=0, e1=0, tolerance=1,
            line_length=2048,
        )  # fmt: skip
        wrong = [] if got.no_range.all() and not got.x.any() and not got.z.any() else ["a point"]
        sigma_max = (1 << pkg.SIGMA_WIDTH) - 1
        wrong += [] if (got.sigma_z == sigma_max).all() else ["sigma_z"]
        with np.errstate(divide="ignore"):
            z = np.float64(1.0) / np.array([2.0**-30, 0.0])
        naive: list[Value] = [PHANTOM if np.isfinite(v) else float(v) for v in z]
        return Outcome("NO_RANGE", "no position", summary(naive, "mm"), tuple(wrong))

    yield ModuleCase(
        "denominator-one-unit",
        "1 mm divided by 2^-30, and by 0",
        "the quotient overflows: NO_RANGE, x = z = 0",
        smallest,
        (
            "test_triangulate.py::any_point_back_to_back",
            "test_triangulate.py::test_exactly_parallel_rays",
        ),
    )


def _angles() -> Iterator[Case]:
    yield _places(
        "alpha-0",
        "sin(alpha) = 0: x is nothing but rounding",
        "x is 0, z is that of beta alone",
        [(p, 0.0) for p in (200.0, 600.5, 1000.0, 1200.0)],
    )
    yield _places(
        "alpha-at-the-limit",
        "20.5 degrees either way, the mirror's amplitude",
        "within 2 um to 1 m, more as the square of the distance",
        [(100.0, -20.5), (100.0, 20.5), (400.0, 20.5), (1024.0, 20.5), (2000.0, 20.5)],
    )
    yield _places(
        "alpha-90",
        "tan(alpha) is infinite; the mirror does not get there, a register does",
        "the laser runs along the base: x is where the line of sight meets it, z is 0",
        [(CENTRE, 90.0)],
        Geometry(centre_px=CENTRE),
    )
    yield _places(
        "alpha-half-a-turn",
        "the most negative angle: the laser points backwards, and tan(alpha) does not tell",
        "NO_RANGE",
        [(CENTRE, -180.0), (CENTRE, 180.0), (CENTRE, 179.0)],
        Geometry(centre_px=CENTRE),
        no_range=range(3),
    )


def _lenses() -> Iterator[Case]:
    k1_limit = 1.999 / REACH_MM**2
    k2_limit = 1.999 / REACH_MM**4
    middle = [(CENTRE, 0.0), (CENTRE, 10.0), (1100.0, 10.0), (900.0, 10.0)]
    for name, k1, k2 in (("k1", k1_limit, 0.0), ("k2", 0.0, k2_limit)):
        for sign in (1.0, -1.0):
            word = "largest" if sign > 0 else "most-negative"
            yield _places(
                f"{name}-{word}",
                f"{name} at the end of its register: {sign * 2:+g} of the offset at R",
                "odd, and near the axis as small as the equation has it; within 2 um to 1 m",
                middle,
                Geometry(centre_px=CENTRE, k1=sign * k1, k2=sign * k2),
            )
    beyond = Geometry(centre_px=2047.0, k1=k1_limit)
    yield _places(
        "k1-beyond-100-percent",
        "the correction is larger than the offset itself",
        "it has no offset, so there is no point: OUT_OF_RANGE, x = z = 0",
        [(100.0, 20.5), (500.0, 20.5)],
        beyond,
        out_of_range=range(2),
    )
    one = Geometry(centre_px=CENTRE, k1=0.01 / (REACH_MM / 2) ** 2)
    yield _places(
        "lens-1-percent",
        "(5) as printed is even in x_s - x_M: on one side it corrects the wrong way",
        "odd, as a radial distortion is; within 2 um to 1 m",
        [(p, a) for p in (100.0, 300.0, 600.0, 1800.0, 2000.0) for a in (10.0, 20.5)],
        one,
    )


def cases() -> Iterator[Case]:
    """Return the entries of this module."""
    for part in (_vertical, _parallel, _angles, _lenses):
        yield from part()
