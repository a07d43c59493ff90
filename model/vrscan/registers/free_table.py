"""The table of free space, from the geometry, the optics and the darkest surface to be seen."""

import math
from functools import lru_cache

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config
from vrscan.ideal.free_space import config_sections, reach, sectioned, visible

HALF = 128  # entries over the angle, and as many over power / noise
FRACTION_WIDTH = 10  # fraction bits of an angle between two entries
QUOTIENT_FRACTION = 8  # of power / noise
MANTISSA_WIDTH = 3  # bits of an entry's number below those of its octave

_FINE = 32  # places between two entries at which the straight line is compared
_EMPTY = (1 << pkg.FREE_WIDTH) - 1, 0


def free_table(config: Config) -> tuple[int, int, tuple[int, ...], tuple[int, ...]]:
    """Return the table's place and entries: begin, shift, from and to.

    Straight lines between the entries lie within the exact interval of ``ideal.free_space``.
    """
    return _table(*config_sections(config))


@lru_cache(maxsize=16)
def _table(*sections: object) -> tuple[int, int, tuple[int, ...], tuple[int, ...]]:
    config, angles = sectioned(sections)
    half = math.ceil(angles[-1] / (2.0 * math.pi) * 2**pkg.ANGLE_WIDTH)
    shift = 0
    while (HALF - 1) << (shift + FRACTION_WIDTH) < 2 * half:
        shift += 1
    seen_from, seen_to = _seen(-half, shift, config)

    scale = 2.0 ** (pkg.COUNT_WIDTH - config.sensor.pixel_width)
    near, far = reach(level_ratios() * scale, angles, config)
    unit = config.geometry.unit_mm
    bright_from, bright_to = _words(near / unit, far / unit)
    return (
        -half,
        shift,
        tuple(np.concatenate([seen_from, bright_from]).tolist()),
        tuple(np.concatenate([seen_to, bright_to]).tolist()),
    )


def level_ratios() -> Floats:
    """Return the least power / noise of each entry of the second half, for a noise in 24 bits.

    The hardware's quotient is rounded to nearest, so the true one may be half a step lower.
    """
    each = np.arange(HALF)
    octave, part = each >> MANTISSA_WIDTH, each & (1 << MANTISSA_WIDTH) - 1
    least = np.ceil(((1 << MANTISSA_WIDTH) + part) * 2.0 ** (octave - MANTISSA_WIDTH))
    return np.asarray((least - 0.5) * 2.0**-QUOTIENT_FRACTION)


def _seen(begin: int, shift: int, config: Config) -> tuple[Ints, Ints]:
    """Return the entries over the angle, from ``begin`` up to the same angle on the other side."""
    places = np.arange((HALF - 1) * _FINE + 1) / _FINE
    steps = begin + places * (1 << (shift + FRACTION_WIDTH))
    angle = np.clip(steps * (2.0 * np.pi * 2.0**-pkg.ANGLE_WIDTH), -0.499 * np.pi, 0.499 * np.pi)
    near, far = visible(angle, config)
    none = ~np.isfinite(near) | (steps > -begin)
    cell = np.arange(HALF - 1)[:, None] * _FINE + np.arange(_FINE + 1)
    # A cell with an end where nothing is seen is empty by itself; one with such a place between
    # its ends gets an empty end.
    entry_none = none[::_FINE].copy()
    entry_none[:-1] |= none[cell].any(axis=1) & ~(none[cell[:, 0]] | none[cell[:, -1]])
    near, far = np.where(none, 0.0, near), np.where(none, 0.0, far)
    whole = ~none[cell].any(axis=1)
    near_entry = near[::_FINE] + _bend(near[cell], whole)
    far_entry = far[::_FINE] - _bend(-far[cell], whole)
    near_entry[entry_none], far_entry[entry_none] = np.inf, 0.0
    unit = config.geometry.unit_mm
    return _words(near_entry / unit, far_entry / unit)


def _bend(values: Floats, whole: Bools) -> Floats:
    """Return how far each entry has to rise for straight lines to be above cells [m, k] of values.

    What the places between the fine ones can add is far below a twentieth of that.
    """
    share = np.linspace(0.0, 1.0, values.shape[1])
    line = values[:, :1] * (1.0 - share) + values[:, -1:] * share
    rise = np.where(whole, np.maximum((values - line).max(axis=1), 0.0), 0.0)
    return np.asarray(1.05 * np.maximum(np.append(rise, 0.0), np.append(0.0, rise)))


def _words(near: Floats, far: Floats) -> tuple[Ints, Ints]:
    """Return intervals in the format of the table, rounded inwards, with a step to spare."""
    one, top = 2.0**pkg.FREE_FRACTION, float(_EMPTY[0])
    least = np.ceil(np.minimum(near * one, top)) + 1.0
    largest = np.floor(np.minimum(far * one, top)) - 1.0
    none = least >= largest
    return (
        np.where(none, _EMPTY[0], least).astype(np.int64),
        np.where(none, _EMPTY[1], largest).astype(np.int64),
    )
