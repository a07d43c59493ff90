"""The turning polygon: where its beam points, and when the beam passes its diode.

The beam's angle is a straight line of time, 720 degrees in a turn, which begins anew with each
facet. Each facet has an error of its own, the same in every turn, and the speed hunts slowly about
its mean. The diode tells the start of each facet's scan, with jitter.

It leaves out: the pyramid error, which moves the line of a facet along y and no point in x or z but
by its square; the walk of the place at which the beam meets the facet, some tenths of a millimetre,
which is a part of the correction map; and the beam that is cut by a facet's edge, where nothing is
scanned.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import Config

_STREAM = 0x9017  # separates these random numbers from others of the same seed
_JITTERS = 4096  # starts of scan whose jitter is drawn together
_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Turning:
    """The true motion of a polygon.

    Attributes:
        frequency_hz: Mean number of facets a second.
        facet_rad: Optical angle of a facet.
        mark_rad: Angle of the diode.
        speed: Relative amplitude of the speed's hunting.
        hunting_hz: Its frequency.
        errors_rad: Error of the optical angle of each facet.
        jitter_s: Jitter of a start of scan, rms.
        seed: Seed of the jitter.
    """

    frequency_hz: float
    facet_rad: float
    mark_rad: float
    speed: float
    hunting_hz: float
    errors_rad: tuple[float, ...]
    jitter_s: float
    seed: int

    @classmethod
    def of(cls, config: Config, seed: int, jitter_ns: float | None = None) -> "Turning":
        """Return a configuration's polygon; ``jitter_ns`` is in place of that of ``[mems]``."""
        mirror, polygon = config.mirror, config.polygon
        rng = np.random.default_rng((seed, _STREAM))
        errors = 1e-6 * polygon.facet_urad * rng.standard_normal(mirror.facets)
        return cls(
            frequency_hz=mirror.frequency_hz,
            facet_rad=2.0 * _TURN / mirror.facets,
            mark_rad=math.radians(mirror.index_deg),
            speed=1e-6 * polygon.speed_ppm,
            hunting_hz=polygon.hunting_hz,
            errors_rad=tuple(errors.tolist()),
            jitter_s=1e-9 * (config.mems.jitter_ns if jitter_ns is None else jitter_ns),
            seed=seed,
        )

    def facets(self, time_s: Floats) -> Floats:
        """Return the facets that have gone by, with the fraction of the present one."""
        swing = self.speed * self.frequency_hz / (_TURN * self.hunting_hz)
        return np.asarray(
            self.frequency_hz * time_s + swing * np.sin(_TURN * self.hunting_hz * time_s)
        )

    def at(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return angle, rad, and rate, rad/s, at times of any shape."""
        turns = self.facets(time_s)
        number = np.floor(turns)
        angle = self.facet_rad * (0.5 - (turns - number)) + self._errors(number)
        speed = 1.0 + self.speed * np.cos(_TURN * self.hunting_hz * time_s)
        return np.asarray(angle), -self.facet_rad * self.frequency_hz * speed

    def _errors(self, number: Floats) -> Floats:
        return np.asarray(self.errors_rad)[number.astype(np.int64) % len(self.errors_rad)]

    def starts(self, first: int, count: int) -> Floats:
        """Return the times at which facets ``first`` .. begin their scan at the diode, s."""
        number = np.arange(first, first + count, dtype=np.float64)
        phase = 0.5 - (self.mark_rad - self._errors(number)) / self.facet_rad
        time = (number + phase) / self.frequency_hz
        for _ in range(4):  # the speed hunts by millionths: each step gains six digits
            time = time - (self.facets(time) - number - phase) / self.frequency_hz
        blocks = range(first // _JITTERS, (first + count) // _JITTERS + 1)
        noise = np.concatenate([_noise(self.seed, block) for block in blocks])
        begin = first - blocks[0] * _JITTERS
        return np.asarray(time + self.jitter_s * noise[begin : begin + count])


def _noise(seed: int, block: int) -> Floats:
    number = 2 * block if block >= 0 else -2 * block - 1  # entropy must not be negative
    rng = np.random.default_rng((seed, _STREAM, number))
    return np.asarray(rng.standard_normal(_JITTERS))


def lit(config: Config, start_s: float, total: int) -> Ints:
    """Return the numbers of the first ``total`` lines that have light, from 0 at ``start_s``.

    They are those whose pulse lies within ``mirror.reach_deg``; in the others the laser is dark.
    """
    mirror, line = config.mirror, config.line
    per_line = mirror.frequency_hz / line.rate_hz
    begin = mirror.frequency_hz * (start_s + 1e-6 * line.pulse_delay_us)
    begin -= mirror.facet_phase(mirror.reach_deg)
    pulse = mirror.frequency_hz * 1e-6 * line.pulse_us
    return _lit(begin, per_line, pulse, mirror.reach_deg * mirror.facets / 360.0, total)


@lru_cache(maxsize=4)
def _lit(begin: float, per_line: float, pulse: float, span: float, total: int) -> Ints:
    """Return ``lit`` of the phase of line 0's pulse, its lines' distance and length, in facets."""
    found: list[Ints] = []
    first, missing = 0, total
    while missing > 0:
        number = np.arange(first, first + math.ceil(missing / span) + 1, dtype=np.int64)
        phase = begin + per_line * number
        inside = (phase % 1.0 < span) & ((phase + pulse) % 1.0 < span)
        found.append(number[inside][:missing])
        first, missing = int(number[-1]) + 1, missing - len(found[-1])
    return np.concatenate(found) if found else np.empty(0, np.int64)


def reported(config: Config, turning: Turning, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the angle that the instrument computes, rad, and the starts of scan that it rests on.

    The phase is that since the last start of scan, the facet's own where the diode is before the
    scan, so the facet's error is in it. The speed is that of the last ``mirror.averaging_periods``
    facets and as many before as make turns.
    """
    mirror = config.mirror
    back = mirror.facets * math.ceil(mirror.averaging_periods / mirror.facets)
    first = math.floor(time_s.min() * turning.frequency_hz) - back - 2
    last = math.ceil(time_s.max() * turning.frequency_hz) + 2
    starts = turning.starts(first, last - first + 1)
    newest = np.searchsorted(starts, time_s, side="right") - 1
    speed = back / (starts[newest] - starts[newest - back])
    phase = mirror.facet_phase(mirror.index_deg) + speed * (time_s - starts[newest])
    facet = math.radians(720.0 / mirror.facets)
    return np.asarray(facet * (0.5 - phase % 1.0)), starts
