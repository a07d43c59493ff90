"""A cut beam's cross section as a row of pixels sees it, with all of its rings.

The row does not see all of a spot, nor an infinitely thin slice: it sees a band of it, which is the
higher, the farther the lens is out of focus. Along the row such a band has a transform that depends
on the distance and on the band's height; both are tabulated here.

The tables' source is the transform of the whole irradiance, which for a cut Gaussian beam is the
transfer function of an apodised, defocused pupil (Hopkins 1955): where its two copies lie 2 t radii
apart, and nu = lambda z / a^2,

    I(t) ~ exp(-2 t^2 / T^2) int_0^(1-t) exp(-2 x^2 / T^2) erf(sqrt(2 - 2 (x + t)^2) / T)
           cos(4 pi t x / nu) dx.

Beyond t = 1 it is exactly 0, so the rings of all orders are in it. The transform of a band is its
integral across the row, weighted with the transform of the band's height.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import erf, j1

from vrscan.data.arrays import Floats, Ints
from vrscan.data.kept import Array, kept
from vrscan.scene.legendre import legendre

Singles = npt.NDArray[np.float32]

_ZONES = 161  # distances, even in nu / (1 + nu): 0 is the stop's shadow, 1 is the far field
_NODES = 64  # nodes of the integral over the stop
_BANDS = 17  # heights of the band, even in b / (1 + b): 0 is a slice, 1 is all of the spot
_STEP, _END = 0.0125, 3.2  # frequencies, in cycles per 1/e2 radius
_PLACE, _FARTHEST = 0.05, 6.0  # places, in 1/e2 radii
_DISCS = 65  # radii of the lens's disc, even in r / (1 + r)
_FINE = 8  # steps between tabulated zones and bands, to the nearest of which shapes are computed
_LEGENDRE = legendre(40)
_FIT_TURNS = 1.0 + _LEGENDRE[0]  # frequencies of a fit, in cycles per approximate radius
_TRIALS = np.linspace(0.4, 1.4, 101)  # radii that a fit tries, before a parabola through three


def gaussian_cumulated(x: Floats) -> tuple[Floats, Floats]:
    """Return int p dx and int x p dx of an uncut beam of light 1, from its middle to ``x``.

    Args:
        x: Places in 1/e2 radii, any shape.
    """
    light = 0.5 * erf(math.sqrt(2.0) * x)
    return light, -np.expm1(-2.0 * np.square(x)) / math.sqrt(8.0 * math.pi)


def stop_transform(shift: Floats, turns: Floats, ratio: float) -> Floats:
    """Return the 2-D transform of a cut beam's irradiance along a radius, up to a factor.

    Args:
        shift: t = nu turns / 2, half the distance of the stop's copies in radii of the stop [n].
        turns: Frequencies in cycles per radius of the stop [n]; 0 in the far field.
        ratio: 1/e2 diameter of the beam at the stop over the stop's diameter.
    """
    node, weight = legendre(_NODES)
    t = np.minimum(shift, 1.0)[:, None]
    # x = (1 - t) sin(angle), as the chord has a root at its end.
    angle = 0.25 * math.pi * (node + 1.0)
    x = (1.0 - t) * np.sin(angle)
    chord = np.sqrt(np.maximum(1.0 - np.square(x + t), 0.0))
    light = np.exp(-2.0 * (np.square(x) + np.square(t)) / ratio**2)
    light *= erf(math.sqrt(2.0) / ratio * chord) * (1.0 - t) * np.cos(angle) * weight
    return np.asarray((light * np.cos(2.0 * math.pi * turns[:, None] * x)).sum(axis=1))


@dataclass(frozen=True)
class CutBeam:
    """Tables of a cut beam by distance; lengths are in its 1/e2 radius, of the nearest Gaussian.

    A distance is given by its zone, nu / (1 + nu), and a band by its height, b / (1 + b) for one
    that reaches b radii to either side. Places and discs are given in radii of the beam, too.
    """

    near: float  # 1/e2 radius of the stop's shadow, in radii of the stop
    far: float  # slope of the far field's 1/e2 radius with nu
    radii: Floats  # 1/e2 radius over hypot(near, far nu) [zones]
    transforms: Singles  # of a band's light along the row, 1 at frequency 0 [zones, bands, ...]
    light: Singles  # integral of a band's profile from its middle [zones, bands, places]
    moment: Singles  # and of x times that
    middle: Floats  # light that a disc takes in a thin row, times 1 + its radius [zones, discs]
    bend: Floats  # second derivative of that light across the row, over itself [zones, discs]

    def radius(self, spread: Floats, shadow: Floats) -> Floats:
        """Return the 1/e2 radius of the nearest Gaussian, in the unit of the arguments [n].

        Args:
            spread: lambda z / a, the width of the light that the stop bends [n].
            shadow: Radius of the stop's shadow [n].
        """
        zone = spread / (spread + shadow)
        ratio = np.interp(zone, np.linspace(0.0, 1.0, _ZONES), self.radii)
        return np.asarray(np.hypot(self.near * shadow, self.far * spread) * ratio)

    def transfer(self, turns: Singles, zone: Floats, band: Floats) -> Singles:
        """Return the transform of the light along the row at rising frequencies [n, k], 1 at 0.

        Args:
            turns: Frequencies in cycles per 1/e2 radius [n, k].
            zone: Zones of the distances [n].
            band: Heights of the bands [n].
        """
        found = np.zeros(turns.shape, np.float32)
        used = int(np.searchsorted(turns.min(axis=0), _END)) if len(turns) else 0
        which, (tables,) = _blended([self.transforms], zone, band)
        place = np.minimum(turns[:, :used] * np.float32(1.0 / _STEP), np.float32(_END / _STEP))
        found[:, :used] = _at(tables, which[:, None], place)
        return found

    def cumulated(
        self, zone: Floats, band: Floats
    ) -> Callable[[Floats, Ints], tuple[Floats, Floats]]:
        """Return a function that sums the light of bands' profiles, of 1 in all.

        It returns int p dx and int x p dx from the middle to x for places [k, ...] and their
        bands' indices [k, ...]. What is beyond 6 radii counts as being there.

        Args:
            zone: Zones of the distances [n].
            band: Heights of the bands [n].
        """
        which, (light, moment) = _blended([self.light, self.moment], zone, band)

        def sums(x: Floats, index: Ints) -> tuple[Floats, Floats]:
            place = np.minimum(np.abs(x), _FARTHEST) / _PLACE
            row = which[index]
            found = np.copysign(_at(light, row, place), x)
            return np.asarray(found, np.float64), np.asarray(_at(moment, row, place), np.float64)

        return sums

    def row_share(self, height: Floats, disc: Floats, zone: Floats) -> Floats:
        """Return the share of all light in a row through the middle, up to 1 [n].

        Args:
            height: Height of the row, less than the spot's [n].
            disc: Radius of the lens's disc [n].
            zone: Zones of the distances [n].
        """
        column = disc / (1.0 + disc) * (_DISCS - 1)
        row = zone * (_ZONES - 1)
        thin, bend = (_between(table, row, column) for table in (self.middle, self.bend))
        thin = thin / (1.0 + disc)
        # The mean over the height, to the second order.
        return np.minimum(thin * height * np.exp(np.square(height) * bend / 24.0), 1.0)


def _between(table: Floats, row: Floats, column: Floats) -> Floats:
    """Return the values of a table at places between its rows and columns."""
    i = np.minimum(row.astype(np.int64), len(table) - 2)
    j = np.minimum(column.astype(np.int64), table.shape[1] - 2)
    row, column = row - i, column - j
    low = table[i, j] + column * (table[i, j + 1] - table[i, j])
    high = table[i + 1, j] + column * (table[i + 1, j + 1] - table[i + 1, j])
    return np.asarray(low + row * (high - low))


def _blended(tables: list[Singles], zone: Floats, band: Floats) -> tuple[Ints, list[Singles]]:
    """Interpolate tables by zone and band; of alike ones only the first.

    Returns:
        Index of the blended row of each place [n], and the rows of each table [rows, k].
    """
    wide = _FINE * (_BANDS - 1) + 1
    key = np.rint(zone * (_FINE * (_ZONES - 1))).astype(np.int64) * wide
    key += np.rint(band * (wide - 1)).astype(np.int64)
    kinds, which = np.unique(key, return_inverse=True)
    i, a = np.divmod(kinds // wide, _FINE)
    j, b = np.divmod(kinds % wide, _FINE)
    i, a = np.where(i == _ZONES - 1, i - 1, i), np.where(i == _ZONES - 1, _FINE, a)
    j, b = np.where(j == _BANDS - 1, j - 1, j), np.where(j == _BANDS - 1, _FINE, b)
    a, b = ((each / _FINE).astype(np.float32)[:, None] for each in (a, b))
    found = []
    for table in tables:
        low = table[i, j] * (1 - b) + table[i, j + 1] * b
        high = table[i + 1, j] * (1 - b) + table[i + 1, j + 1] * b
        found.append(low + a * (high - low))
    return which, found


def _at(rows: Singles, which: Ints, place: npt.NDArray[np.floating]) -> Singles:
    """Return the values of rows of tables at places between their columns."""
    low = place.astype(np.int32)
    np.minimum(low, rows.shape[1] - 2, out=low)
    part = (place - low).astype(np.float32)
    at = which * rows.shape[1] + low
    flat = rows.ravel()
    found = flat[at]
    found += part * (flat[at + 1] - found)
    return np.asarray(found)


def _fitted(light: Floats) -> float:
    """Return the 1/e2 radius of the Gaussian nearest to an irradiance in least squares.

    That is where <I g>^2 / <g g> is largest; both are integrals of transforms.

    Args:
        light: The irradiance's transform at ``_FIT_TURNS``.
    """
    gauss = np.exp(-0.5 * np.square(math.pi * np.outer(_TRIALS, _FIT_TURNS)))
    score = np.square(_TRIALS * (gauss @ (light * _FIT_TURNS * _LEGENDRE[1])))
    k = int(np.clip(np.argmax(score), 1, len(_TRIALS) - 2))
    left, middle, right = score[k - 1 : k + 2]
    shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return float(_TRIALS[k] + shift * (_TRIALS[1] - _TRIALS[0]))


@lru_cache(maxsize=16)
def cut_beam(ratio: float, far: float) -> CutBeam:
    """Return the tables of a beam behind a stop.

    Args:
        ratio: 1/e2 diameter of the beam at the stop over the stop's diameter.
        far: 1/e2 radius of the far field over nu, in radii of the stop.
    """
    names = [field.name for field in fields(CutBeam) if field.name != "far"]
    found: dict[str, Any] = kept(_tabulated, ratio, far, names=names)
    return CutBeam(**found | {"near": float(found["near"]), "far": far})


def _tabulated(ratio: float, far: float) -> dict[str, Array]:
    """Return all of a ``CutBeam`` but ``far``."""

    def transform(zone: float, scale: float, turns: Floats) -> Floats:
        """Transform at frequencies in cycles per ``scale`` times the radius near or far."""
        turns = turns / (scale * math.hypot(near * (1.0 - zone), far * zone))
        return stop_transform(0.5 * zone * turns, (1.0 - zone) * turns, ratio)

    near = min(ratio, 1.0)
    near *= _fitted(transform(0.0, 1.0, _FIT_TURNS))
    turns = np.arange(0.0, _END + 1.5 * _STEP, _STEP)
    places = np.arange(0.0, _FARTHEST + 0.5 * _PLACE, _PLACE)
    disc = np.linspace(0.0, 1.0, _DISCS)[:-1]
    disc /= 1.0 - disc
    turn = 2.0 * math.pi * np.outer(turns, np.maximum(disc, 1e-6))
    turn[0] = 1e-9
    through = 2.0 * j1(turn) / turn
    through[0] *= 0.5  # the trapezoidal rule, over both halves
    across = through[:, :: (_DISCS - 1) // (_BANDS - 1)]
    turn = 2.0 * math.pi * np.outer(turns[1:], places)
    summed = np.vstack([0.5 * places, np.sin(turn) / (2.0 * math.pi * turns[1:, None])])
    square = np.minimum(np.hypot(turns[:, None], turns) / _STEP, len(turns) - 1.0)
    low = np.minimum(square.astype(np.int64), len(turns) - 2)
    part = square - low

    radii, middle, bend = np.empty(_ZONES), np.empty((_ZONES, _DISCS)), np.zeros((_ZONES, _DISCS))
    transforms = np.empty((_ZONES, _BANDS, len(turns)))
    for k, zone in enumerate(np.linspace(0.0, 1.0, _ZONES)):
        radii[k] = _fitted(transform(zone, 1.0, _FIT_TURNS))
        whole = transform(zone, radii[k], turns)
        whole /= whole[0]
        whole[-1] = 0.0
        middle[k, :-1] = 2.0 * _STEP * (whole @ through) * (1.0 + disc)
        middle[k, -1] = 2.0 / math.pi
        curved = -np.square(2.0 * math.pi * turns) * whole
        bend[k, :-1] = 2.0 * _STEP * (curved @ through) * (1.0 + disc) / middle[k, :-1]
        ring = whole[low] + part * (whole[low + 1] - whole[low])
        transforms[k] = np.vstack([(ring @ across).T, whole])
    transforms /= transforms[..., :1]
    transforms[..., -2:] = 0.0  # at the end and beyond, whatever other lines need
    light = 2.0 * _STEP * transforms @ summed
    light[..., -1] = 0.5  # what is farther counts as being there
    gone = np.cumsum(0.5 * _PLACE * (light[..., 1:] + light[..., :-1]), axis=2)
    moment = places * light
    moment[..., 1:] -= gone
    return {
        "near": np.array(near),
        "radii": radii,
        "transforms": transforms.astype(np.float32),
        "light": light.astype(np.float32),
        "moment": moment.astype(np.float32),
        "middle": middle,
        "bend": bend,
    }
