"""Angle and magnitude of a vector, the twin of ``rtl/trig/cordic_vector.sv``."""

import math

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints

TABLE_ENTRIES = 32
TABLE_WIDTH = 40  # fraction bits of a turn
ANGLE_GUARD = 10  # bits of the angle below its output step
NORM_GUARD = 7  # bits of a normalised vector above the angle's
COARSE = 8  # bits of a coarse normalising step

GAIN = math.prod(math.sqrt(1 + 4.0**-i) for i in range(TABLE_ENTRIES))  # 1.6467602581210656


def iterations(angle_width: int) -> int:
    """Return the number of rotations, by atan(2**-i) from i = 0."""
    return angle_width + 2


def latency(xy_width: int, angle_width: int, rotations: int | None = None) -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``; ``rotations`` as in ``cordic_vector``."""
    count = iterations(angle_width) if rotations is None else rotations
    return 2 * count + 2 * ((xy_width - 1) // COARSE) + 18


def arc_tangents() -> list[int]:
    """Return atan(2**-i) in turns / 2**TABLE_WIDTH, cut to integers, for i < TABLE_ENTRIES."""
    scale = 2**TABLE_WIDTH / (2 * math.pi)
    return [math.floor(math.atan(2.0**-i) * scale) for i in range(TABLE_ENTRIES)]


def angle_bounds(angle_width: int, rotations: int | None = None) -> tuple[float, float]:
    """Return peak and rms of the angle's error in output steps, derived from the widths.

    ``rotations`` are those of ``cordic_vector``.

    The error consists of the output's rounding, the remainder of the last rotation, the cut arc
    tangents and the cut input. For the rms the first two are uniformly distributed and the small
    ones count in full.
    """
    count = iterations(angle_width) if rotations is None else rotations
    steps_per_radian = 2.0**angle_width / (2 * math.pi)
    left = math.atan(2.0 ** (1 - count)) * steps_per_radian
    table = count * 2.0**-ANGLE_GUARD
    # A cut of one unit in each of x and y, and the few units that the first rotations cut from x.
    norm = angle_width + NORM_GUARD
    cut = (math.sqrt(2.0) + 3) * 2.0 ** (1 - norm) * steps_per_radian
    return 0.5 + left + table + cut, math.sqrt(1 / 12 + left * left / 3) + table + cut


def magnitude_bound(magnitude: Floats, *, angle_width: int) -> Floats:
    """Return the largest error of the magnitude, in units of the input.

    Args:
        magnitude: Exact magnitudes GAIN * sqrt(x**2 + y**2). Any shape.
        angle_width: ``AngleWidth`` of the module.

    Returns:
        Half a unit for the output's rounding, and a share of the magnitude for the input's cut to
        ``angle_width + 7`` bits and for the unit that each rotation but the first may cut, a tenth
        of which comes back through the side.
    """
    cuts = math.sqrt(2.0) * GAIN + 1.1 * (iterations(angle_width) - 1)
    share = cuts / (GAIN * 2.0 ** (angle_width + NORM_GUARD - 1))
    return 0.5 + share * magnitude


def cordic_vector(
    x: Ints, y: Ints, *, xy_width: int, angle_width: int, rotations: int | None = None
) -> tuple[Ints, Ints, Bools]:
    """Return angle and magnitude of the vectors (x, y) exactly as the hardware does.

    Args:
        x: Signed integers of ``xy_width`` bits. Any shape.
        y: Signed integers of ``xy_width`` bits, broadcast against ``x``.
        xy_width: ``XyWidth`` of the module, 9 to 60.
        angle_width: ``AngleWidth`` of the module, 8 to 28.
        rotations: Number of rotations, at most ``TABLE_ENTRIES``. The module has
            ``iterations(angle_width)``, which is the default; the design space has others. Bounds
            and gain are those of the module; ``angle_bounds`` also takes the number of rotations.

    Returns:
        The angle atan2(y, x), int64 in [0, 2**angle_width), in turns / 2**angle_width, to within
        ``angle_bounds(angle_width)``; the magnitude GAIN * sqrt(x**2 + y**2), int64, to within
        ``magnitude_bound``; and a bool array that is true where x = y = 0, where both are 0.

    Raises:
        ValueError: if an operand does not fit or a width is out of range.
    """
    if not (9 <= xy_width <= 60 and 8 <= angle_width <= 28):
        raise ValueError("cordic_vector: xy_width must be 9 to 60, angle_width 8 to 28")
    count = iterations(angle_width) if rotations is None else rotations
    if not 1 <= count <= TABLE_ENTRIES:
        raise ValueError(f"cordic_vector: rotations must be 1 to {TABLE_ENTRIES}")
    x, y = np.broadcast_arrays(np.asarray(x, np.int64), np.asarray(y, np.int64))
    for operand in (x, y):
        if np.any(operand >> (xy_width - 1) != operand >> 63):
            raise ValueError(f"cordic_vector: an operand does not fit in {xy_width} bits")
    norm = angle_width + NORM_GUARD
    wide = max(xy_width, norm)

    # Fold into the first quadrant and shift left until the longer side fills its width.
    across, up = np.abs(x) << (wide - xy_width), np.abs(y) << (wide - xy_width)
    both = across | up
    zero = both == 0
    shift = np.zeros(both.shape, np.int64)
    for step in (32, 16, 8, 4, 2, 1):
        if step < wide:
            shift += np.where((both << shift) >> (wide - step) == 0, step, 0)
    along = (across << shift) >> (wide - norm)
    side = (up << shift) >> (wide - norm)

    # The side doubles with every rotation, so it loses no bit.
    accumulator = angle_width + ANGLE_GUARD
    turned = np.where(x < 0, 1 << (accumulator - 1), 0) + (1 << (ANGLE_GUARD - 1))
    flip = (x < 0) ^ (y < 0)
    for i, entry in enumerate(arc_tangents()[:count]):
        below = side < 0
        part = side >> (2 * i)
        side, along = (
            2 * np.where(below, side + along, side - along),
            np.where(below, along - part, along + part),
        )
        arc = entry >> (TABLE_WIDTH - accumulator)
        turned = turned + np.where(below ^ flip, -arc, arc)

    angle = (turned >> ANGLE_GUARD) & ((1 << angle_width) - 1)
    doubled = (along << (wide - norm + 1)) >> (shift + wide - xy_width)
    magnitude = (doubled + 1) >> 1
    return np.where(zero, 0, angle), np.where(zero, 0, magnitude), zero


def package_source(entries: int = TABLE_ENTRIES) -> str:
    """Return rtl/trig/cordic_pkg.sv, the arc tangents for any angle width.

    Args:
        entries: Largest number of rotations; the repository's file serves all.
    """
    arcs = arc_tangents()[:entries]
    lines = [
        "// cordic_pkg: the angles of a CORDIC's rotations.",
        "//",
        "// Generated from vrscan.fixed.cordic_vector.arc_tangents() by scripts/generate.py.",
        "",
        "`default_nettype none",
        "",
        "package cordic_pkg;",
        f"  localparam int unsigned TableWidth = {TABLE_WIDTH};  // one turn is 2**TableWidth",
        "",
        "  // atan(2**-index), cut.",
        f"  function automatic logic [{TABLE_WIDTH - 1}:0] arc_tangent(input logic [4:0] index);",
        "    case (index)",
        *(
            f"      5'd{i}: arc_tangent = {TABLE_WIDTH}'h{entry:0{TABLE_WIDTH // 4}x};"
            for i, entry in enumerate(arcs[:-1])
        ),
        f"      default: arc_tangent = {TABLE_WIDTH}'h{arcs[-1]:0{TABLE_WIDTH // 4}x};",
        "    endcase",
        "  endfunction",
        "endpackage",
        "",
        "`default_nettype wire",
        "",
    ]
    return "\n".join(lines)
