"""Correction of positions by calibrated maps, the twin of ``rtl/geometry/correction_map.sv``."""

from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.multiply import multiply
from vrscan.fixed.saturate import saturated

ROWS, COLUMNS = 33, 65  # nodes over the angle and over the position
ROW_BITS, COLUMN_BITS = 5, 6  # ``RowBits``, ``ColumnBits``
ANGLE_STEP = 16  # ``AngleStep``: bits of an angle between two nodes
SHARE_WIDTH = 17  # ``ShareWidth``
VALUE_FRACTION = 17  # ``ValueFraction``
DIFFERENCE_WIDTH = pkg.MAP_WIDTH + VALUE_FRACTION - pkg.MAP_FRACTION + 1

LATENCY = 6 + 4 * 6 + 7 * (multiply_latency(DIFFERENCE_WIDTH, SHARE_WIDTH + 1) + 3)

READ_BACK = 4  # clocks from ``index_i`` to ``value_o``


@dataclass(frozen=True)
class Corrected:
    """Corrected positions, of the shape of ``position``.

    Attributes:
        position: px, 12 fraction bits, int64.
        saturated: Whether it did not fit; bool.
        filled: Whether one of the nodes around was filled and not measured; bool.
    """

    position: Ints
    saturated: Bools
    filled: Bools


def position_width(line_length: int) -> int:
    """Return the bits of a position."""
    return (line_length - 1).bit_length() + 1 + pkg.POSITION_FRACTION


def correction_map(
    position: Ints,
    angle: Ints,
    lens: Ints,
    *,
    nodes: Ints,
    filled: Bools,
    map_begin: int,
    map_shift: int,
    line_length: int,
) -> Corrected:
    """Return corrected positions exactly as the hardware rounds them.

    Each of the three interpolations on the way to a result is rounded by half a step of 2**-17 px,
    the result by half a step of 2**-12 px: against bilinear maps in float64 it errs by at most
    2**-13 + 3 * 2**-18 px, and by the end's share, 2**-17 of a difference, beyond the last map. The
    share of a position on a line of more than 2048 px loses bits below 2**-17.

    Args:
        position: Positions on the sensor, px, 12 fraction bits, [n].
        angle: Scan angles, fractions of a turn, s24, [n].
        lens: Positions of the lens, steps, u16, [n].
        nodes: Corrections, px, 10 fraction bits, s17, [maps, 33, 65].
        filled: Whether a node was filled and not measured, of the shape of ``nodes``.
        map_begin: Position of the lens of the first map, steps, u16.
        map_shift: Steps of the lens from map to map: 2**map_shift.
        line_length: ``LineLength`` of the module.
    """
    pixel_bits = (line_length - 1).bit_length()
    place_bits = pixel_bits + pkg.POSITION_FRACTION
    cell_bits = place_bits - COLUMN_BITS
    full = (1 << SHARE_WIDTH) - 1
    position, angle, lens = (np.asarray(v, np.int64) for v in (position, angle, lens))

    inside = np.maximum(position, 0)
    column = inside >> cell_bits
    rest = inside & ((1 << cell_bits) - 1)
    column_share = (
        rest >> (cell_bits - SHARE_WIDTH)
        if cell_bits >= SHARE_WIDTH
        else rest << (SHARE_WIDTH - cell_bits)
    )
    angle_bits = ROW_BITS + ANGLE_STEP
    turned = np.maximum(angle + (1 << (angle_bits - 1)), 0)
    beyond = turned >= 1 << angle_bits
    row = np.where(beyond, (1 << ROW_BITS) - 1, turned >> ANGLE_STEP)
    row_share = (turned & ((1 << ANGLE_STEP) - 1)) << (SHARE_WIDTH - ANGLE_STEP)
    row_share = np.where(beyond, full, row_share)
    moved = np.maximum(lens - map_begin, 0)
    last = len(nodes) - 2
    past = moved >> map_shift > last
    number = np.where(past, last, moved >> map_shift)
    map_share = np.where(past, full, ((moved << SHARE_WIDTH) >> map_shift) & full)

    def between(low: Ints, high: Ints, share: Ints) -> Ints:
        # To nearest, half up.
        product = multiply(high - low, share, a_width=DIFFERENCE_WIDTH, b_width=SHARE_WIDTH + 1)
        return low + ((product + (1 << (SHARE_WIDTH - 1))) >> SHARE_WIDTH)

    values = np.asarray(nodes, np.int64) << (VALUE_FRACTION - pkg.MAP_FRACTION)
    guessed = np.zeros(position.shape, np.bool_)
    planes = []
    for k in (0, 1):
        rows = []
        for i in (0, 1):
            at = number + k, row + i
            rows.append(between(values[*at, column], values[*at, column + 1], column_share))
            guessed |= filled[*at, column] | filled[*at, column + 1]
        planes.append(between(rows[0], rows[1], row_share))
    value = between(planes[0], planes[1], map_share)
    drop = VALUE_FRACTION - pkg.POSITION_FRACTION
    exact = position + ((value + (1 << (drop - 1))) >> drop)
    result = saturated(exact, position_width(line_length))
    return Corrected(result, result != exact, guessed)
