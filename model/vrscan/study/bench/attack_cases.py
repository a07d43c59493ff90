"""The cases of ``vrscan bench attack``: what the light of a line's spot is, before its speckle.

A spot is a Gaussian around the place on the surface that the beam hits, which is the true position
whatever the light does: what leaves a body beside that place, what an edge takes and what the
surface reflects less of are errors. From line to line the spot moves, so it meets pixels at every
phase; surface and speckle are others in each line but where a case says that they stay.
"""

import math
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import erfc, erfcx

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.study.bench.attack_optics import (
    OFFSET,
    OVERSAMPLE,
    READ_NOISE,
    converted,
    dark,
    exposed,
    pixels,
    speckled,
    unit,
)

SIGMA_PX, WIDE_PX = 2.5, 8.0
FINE, COARSE = 3.2, 16.0  # f numbers, of grains of 0.3 and 1.5 px
PEAK = 0.25  # height of a spot's mean light over full scale; speckle makes it twice that
SLOWEST_PX, FASTEST_PX = 0.3, 1.0  # motion of the spot from the first line to the next, and at last
EDGE_PX = 0.77  # motion of an edge across the spot from line to line
EDGE_FIRST, EDGE_LAST = -1.5, 6.0  # sigmas from the spot, between which it moves
BLACK = 0.1  # reflectance of printed stripes over that of the paper
LEAST_LENGTH = 1024  # of a line
REACH, TAIL_REACH = 8.0, 10.0  # sigmas, and 1/e lengths, from the spot to the end of its light


@dataclass(frozen=True)
class Beam:
    """n lines' samples of mean light to come, w of each."""

    away: Floats  # px from the spot [n, w]
    sample: Floats  # number of the sample on the sensor [n, w]
    sigma: float  # px
    length: int  # of a line, px
    rng: np.random.Generator

    @property
    def gauss(self) -> Floats:
        """Light of the surface, which has a height of 1 [n, w]."""
        return np.asarray(np.exp(-0.5 * np.square(self.away / self.sigma)))


Light = Callable[[Beam], Floats]  # mean light [n, w]


def surface(beam: Beam) -> Floats:
    """Return the light of an even surface, whole."""
    return beam.gauss


def _spread(away: Floats, sigma: float, length: float) -> Floats:
    """Return a Gaussian of height 1 that is spread by exp(-x / length) / length, x > 0."""
    z = (sigma / length - away / sigma) / math.sqrt(2.0)
    area = sigma * math.sqrt(0.5 * math.pi) / length
    near = np.exp(-0.5 * np.square(away / sigma)) * erfcx(np.maximum(z, 0.0))
    with np.errstate(over="ignore", invalid="ignore"):
        far = np.exp(0.5 * (sigma / length) ** 2 - away / length) * erfc(z)
    return np.asarray(area * np.where(z > 0.0, near, far))


def tail(share: float, length: float, *, both: bool = False) -> Light:
    """Return light of which a share leaves beside where it entered, an exponential of it.

    Args:
        share: Share of the light.
        length: 1/e length of where it leaves, px; it is behind the spot by this in the mean.
        both: Whether it leaves on both sides alike.
    """

    def light(beam: Beam) -> Floats:
        below = _spread(beam.away, beam.sigma, length)
        if both:
            below = 0.5 * (below + _spread(-beam.away, beam.sigma, length))
        return (1.0 - share) * beam.gauss + share * below

    return light


def beside(height: float, away: float, *, sigmas: bool = False, width: float = 1.0) -> Light:
    """Return light with a second spot, ``width`` times as wide, px or sigmas behind the first."""

    def light(beam: Beam) -> Floats:
        place = away * beam.sigma if sigmas else away
        other = np.exp(-0.5 * np.square((beam.away - place) / (width * beam.sigma)))
        return np.asarray(beam.gauss + height * other)

    return light


def cut(sigmas: float) -> Light:
    """Return light of which that before a place is cut off on every line."""
    return lambda beam: np.where(beam.away > sigmas * beam.sigma, beam.gauss, 0.0)


def edges(beam: Beam) -> Floats:
    """Return light that an edge cuts off, which moves over the spot, and then the next one."""
    way = (EDGE_LAST - EDGE_FIRST) * beam.sigma
    moved = (EDGE_PX * np.arange(len(beam.away)) + beam.rng.uniform(0.0, way)) % way
    edge = EDGE_FIRST * beam.sigma + moved
    return np.where(beam.away < edge[:, None], beam.gauss, 0.0)


def texture(length: float, rms: float) -> Light:
    """Return light of a surface whose reflectance is log-normal, and stays as the spot moves.

    Args:
        length: Distance at which its logarithm's correlation is 1/e, px.
        rms: Standard deviation over mean.
    """
    spread = math.sqrt(math.log1p(rms**2))

    def light(beam: Beam) -> Floats:
        white = beam.rng.standard_normal(beam.length * OVERSAMPLE)
        smooth = gaussian_filter1d(white, 0.5 * length * OVERSAMPLE, mode="wrap")
        surface = np.exp(spread * smooth / smooth.std() - 0.5 * spread**2)
        return np.asarray(beam.gauss * surface[beam.sample.astype(np.int64)])

    return light


def printed(length: float) -> Light:
    """Return light of black and white stripes, exponentially long with this mean, px."""

    def light(beam: Beam) -> Floats:
        samples = beam.length * OVERSAMPLE
        lengths = beam.rng.exponential(length * OVERSAMPLE, 20 * math.ceil(beam.length / length))
        number = np.searchsorted(np.cumsum(lengths), np.arange(samples))
        surface = np.where(number % 2, BLACK, 1.0)
        return np.asarray(beam.gauss * surface[beam.sample.astype(np.int64)])

    return light


@dataclass(frozen=True)
class Case:
    """One row of the table: spots of one kind on lines that follow each other.

    Attributes:
        name: What is special, without what the fields below say.
        light: The mean light.
        sigma: Standard deviation of the spot, px.
        f_number: F number on the sensor's side, by which grains are long.
        looks: Number of independent patterns, 0 for light without speckle.
        beyond: Reach of the light beyond that of the spot, px.
        snr: Height of the dimmest and the brightest spot over the noise, instead of ``PEAK``.
    """

    name: str
    light: Light = surface
    sigma: float = SIGMA_PX
    f_number: float = FINE
    looks: int = 1
    beyond: float = 0.0
    snr: tuple[float, float] | None = None

    @property
    def title(self) -> str:
        """Name of the row."""
        parts = [self.name]
        if self.sigma != SIGMA_PX:
            parts.append(f"s = {self.sigma:g}")
        if self.f_number != FINE:
            parts.append(f"f/{self.f_number:g}")
        if self.looks != 1:
            parts.append(f"{self.looks} looks" if self.looks else "no speckle")
        return ", ".join(parts)

    def lines(self, count: int, config: Config, seed: int) -> tuple[Pixels, Floats]:
        """Return lines [count, line length] and the true positions, px [count].

        Raises:
            InputError: if lines have less than ``LEAST_LENGTH`` pixels.
        """
        length = config.sensor.line_length
        if length < LEAST_LENGTH:
            raise InputError(f"sensor.line_length: at least {LEAST_LENGTH} px here ({length})")
        rng = source(self.title, seed)
        steps = np.linspace(SLOWEST_PX, FASTEST_PX, count)
        true = np.cumsum(steps) - 0.5 * steps.sum() + 0.5 * length + rng.uniform(-0.5, 0.5)
        half = math.ceil(REACH * self.sigma + self.beyond)
        first = np.round(true) - half
        sample = first[:, None] * OVERSAMPLE + np.arange((2 * half + 1) * OVERSAMPLE)
        away = (sample + 0.5) / OVERSAMPLE - 0.5 - true[:, None]
        mean = self.light(Beam(away, sample, self.sigma, length, rng))
        light = speckled(mean, self.f_number, self.looks, rng) if self.looks else pixels(mean)
        peak = PEAK * 2**config.sensor.pixel_width
        if self.snr is not None:
            peak = noise(config)
            light *= rng.uniform(*self.snr, (count, 1))
        return exposed(light, first, peak, config, rng), true


def noise(config: Config) -> float:
    """Return the standard deviation of a dark pixel, counts."""
    return math.hypot(READ_NOISE * unit(config), math.sqrt(1.0 / 12.0))


def source(title: str, seed: int) -> np.random.Generator:
    """Return the random numbers of a row, which no other row and no other seed have."""
    return np.random.default_rng([seed, zlib.crc32(title.encode())])


def _all() -> Iterator[Case]:
    for sigma in (SIGMA_PX, WIDE_PX):
        yield Case("Gaussian", sigma=sigma, looks=0)
    for looks in (1, 2, 4):
        yield Case("speckle", looks=looks)
    yield Case("speckle", sigma=WIDE_PX)
    yield Case("speckle", f_number=COARSE)
    yield Case("speckle", f_number=COARSE, sigma=WIDE_PX)
    yield Case("speckle", f_number=COARSE, sigma=WIDE_PX, looks=4)
    for share in (0.1, 0.3):
        for length in (3.0, 5.0, 8.0):
            for looks in (1, 2, 4):
                name = f"tail {share:.0%}, {length:g} px"
                yield Case(name, tail(share, length), looks=looks, beyond=TAIL_REACH * length)
    yield Case("tail 30%, 8 px", tail(0.3, 8.0), sigma=WIDE_PX, looks=4, beyond=80.0)
    for length in (3.0, 6.0):
        name = f"scatter 50%, {length:g} px"
        yield Case(name, tail(0.5, length, both=True), looks=4, beyond=TAIL_REACH * length)
    for looks in (1, 4):
        yield Case("halo 5% at 8 px", beside(0.05, 8.0, width=3.0), looks=looks, beyond=40.0)
        yield Case(
            "second spot 10% at 3 s", beside(0.1, 3.0, sigmas=True), looks=looks, beyond=10.0
        )
    for looks in (1, 2, 4):
        yield Case("cut at its axis", cut(0.0), looks=looks)
    yield Case("cut at its axis", cut(0.0), sigma=WIDE_PX, looks=4)
    for looks in (1, 4):
        yield Case("cut at -0.5 s", cut(-0.5), looks=looks)
        yield Case("moving edges", edges, looks=looks)
    yield Case("moving edges", edges, sigma=WIDE_PX, looks=4)
    for rms in (0.2, 0.5):
        for length in (1.0, 4.0, 12.0):
            for looks in (4, 0):
                yield Case(f"texture {rms:.0%}, {length:g} px", texture(length, rms), looks=looks)
    yield Case("texture 50%, 12 px", texture(12.0, 0.5), sigma=WIDE_PX, looks=4)
    for length in (4.0, 12.0):
        yield Case(f"printed stripes, {length:g} px", printed(length), looks=4)
    yield Case("dim, S/N 5 to 6", looks=4, snr=(5.0, 6.0))


CASES = tuple(_all())


@dataclass(frozen=True)
class DarkCase:
    """A row of lines without a spot.

    Attributes:
        title: Name of the row.
        offset: Level of the dark, counts of 12 bits.
        hot: Whether two pixels, 2 to 5 px apart, are lit.
        pink: Rms of 1/f noise beside that of the readout, counts of 12 bits.
    """

    title: str
    offset: float = OFFSET
    hot: bool = False
    pink: float = 0.0

    def lines(self, count: int, config: Config, rng: np.random.Generator) -> Pixels:
        """Return the next lines [count, line length]."""
        counts = dark(count, self.offset, config, rng)
        length = counts.shape[1]
        if self.pink:
            white = rng.standard_normal((count, length // 2 + 1, 2))
            shape = 1.0 / np.sqrt(np.maximum(np.arange(length // 2 + 1), 1.0))
            shape[0] = 0.0
            scale = length / math.sqrt(4.0 * np.square(shape).sum())
            noisy = np.fft.irfft((white[..., 0] + 1j * white[..., 1]) * shape * scale, length)
            counts += self.pink * unit(config) * noisy
        if self.hot:
            place = rng.integers(0, length - 5, count)
            for at in (place, place + rng.integers(2, 6, count)):
                counts[np.arange(count), at] += rng.uniform(0.05, 1.0, count) * counts_full(config)
        return converted(counts, config)


def counts_full(config: Config) -> int:
    """Return the largest count."""
    return int(2**config.sensor.pixel_width - 1)


DARK = (
    DarkCase("no spot"),
    DarkCase("two hot pixels, 2 to 5 px apart", hot=True),
    DarkCase("black clipped, offset -2", offset=-2.0),
    DarkCase("pink noise, 6 counts", pink=6.0),
)
