"""Synthetic lines in place of the sensor's, the twin of ``rtl/sensor/test_line.sv``.

``lines`` gives whole lines at once; ``TestLine`` gives each of their pixels in its clock. The noise
is that of G. Marsaglia, *Xorshift RNGs* (2003).
"""

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Ints, Pixels
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.quarter_wave import quarter_wave
from vrscan.registers.settings import TestLineSettings

PLACE_WIDTH = 25  # bits of a position
MIN_GAP = 16  # clocks between two lines
MOST_LENGTH = 1 << (PLACE_WIDTH - pkg.POSITION_FRACTION)
WAVE_WIDTH = 17  # bits of the cosine
WAVE_ONE = 65534  # stands for 1, instead of 1 << 16
SUM_FRACTION = 17  # fraction bits of an unrounded pixel in counts of pkg.ALIGNED_WIDTH bits
NOISE_FRACTION = 9
NOISE_PEAK = 510
SEED_MASK = 0x9E3779B9

LINE_LATENCY = 15  # clocks from the last stop that prevents a line to its line_start
# Clocks from test_start_i to the first line_start_o.
START_LATENCY = multiply_latency(PLACE_WIDTH + 1, pkg.PHASE_WIDTH + 2) + 3 + LINE_LATENCY

_WORD = (1 << 32) - 1
_CHUNK = 1 << 21  # pixels that are computed at once, to limit the memory


def step_of_width(width: float) -> int:
    """Return ``test_step`` for a pulse of this full width at its foot, px, at least 0.5."""
    return round((1 << pkg.PHASE_WIDTH) / width)


def least_period(line_length: int) -> int:
    """Return the clocks from line start to line start where the register asks for fewer."""
    return line_length + MIN_GAP


def _stepped(x: Ints) -> Ints:
    """Return the states of the noise's shift register one pixel later, int64."""
    x = x ^ (x << 13) & _WORD
    x = x ^ x >> 17
    return x ^ (x << 5) & _WORD


def _states(seed: int, count: int) -> Ints:
    """Return the states of the noise's shift register in the first ``count`` pixels.

    A step is linear: the state many pixels later is the exclusive or of what those steps make of
    each byte, so the states known so far give as many new ones.
    """
    states = np.empty(count, np.int64)
    states[:1] = _stepped(np.array([seed ^ SEED_MASK or SEED_MASK]))
    bits = _stepped(1 << np.arange(32, dtype=np.int64))  # the step's result for every bit
    known = 1
    while known < count:
        tables = np.zeros((4, 256), np.int64)
        for bit in range(32):
            chosen = np.arange(256) >> bit % 8 & 1 == 1
            tables[bit // 8, chosen] ^= bits[bit]

        def ahead(x: Ints, tables: Ints = tables) -> Ints:
            jumped: Ints = tables[0][x & 255] ^ tables[1][x >> 8 & 255]
            jumped ^= tables[2][x >> 16 & 255] ^ tables[3][x >> 24]
            return jumped

        more = min(known, count - known)
        states[known : known + more] = ahead(states[:more])
        bits = ahead(bits)
        known += more
    return states


def draws(seed: int, count: int) -> Ints:
    """Return the noise of a run's first ``count`` pixels before it is scaled, -510 .. 510."""
    states = _states(seed, count)
    total: Ints = (states & 255) + (states >> 8 & 255) + (states >> 16 & 255) + (states >> 24)
    return total - NOISE_PEAK


def positions(settings: TestLineSettings, count: int, *, line_length: int) -> Ints:
    """Return the positions of the pulses of a run's first ``count`` lines, px, 12 fraction bits."""
    length = line_length << pkg.POSITION_FRACTION
    place = settings.position
    found = []
    for _ in range(count):
        found.append(place)
        place += settings.move
        place += length if place < 0 else -length if place >= length else 0
        place &= (1 << PLACE_WIDTH) - 1
    return np.array(found, np.int64)


def lines(
    settings: TestLineSettings,
    count: int | None = None,
    *,
    line_length: int = 2048,
    pixel_width: int = 12,
) -> Pixels:
    """Return the first ``count`` lines of a run, or all of it, as the hardware sends them.

    Args:
        settings: The registers; ``lines`` of them is the length of the run, whatever ``count`` is.
        count: Number of lines to return; ``settings.lines`` if None.
        line_length: ``LineLength`` of the module.
        pixel_width: ``PixelWidth`` of the module.

    Returns:
        uint16 [count, line_length], full scale 2**pixel_width.

    Raises:
        ValueError: if there is no such module, or all lines of a run without end are asked for.
    """
    if not (pkg.BLOCK_LENGTH <= line_length <= MOST_LENGTH and 8 <= pixel_width <= 16):
        raise ValueError("test_line: line_length must be 64 to 8192 and pixel_width 8 to 16")
    if count is None:
        if not settings.lines:
            raise ValueError("test_line: a run without end")
        count = settings.lines
    # The phase of a line's first pixel: to nearest, half up.
    half = 1 << (pkg.POSITION_FRACTION - 1)
    places = positions(settings, count, line_length=line_length)
    first = -((places * settings.step + half) >> pkg.POSITION_FRACTION)
    noise = draws(settings.seed, count * line_length).reshape(count, line_length)
    made = np.empty((count, line_length), np.uint16)
    rows = max(_CHUNK // line_length, 1)
    for k in range(0, count, rows):
        made[k : k + rows] = _pixels(
            settings, first[k : k + rows], noise[k : k + rows], pixel_width
        )
    return made


def _pixels(settings: TestLineSettings, first: Ints, noise: Ints, pixel_width: int) -> Pixels:
    """Return lines from the phases of their first pixels and their noise."""
    half_turn = 1 << (pkg.PHASE_WIDTH - 1)
    phase = first[:, None] + settings.step * np.arange(noise.shape[1])
    inside = (phase >= -half_turn) & (phase < half_turn)
    turn = phase[inside] & (2 * half_turn - 1)
    _, cosine = quarter_wave(turn, phase_width=pkg.PHASE_WIDTH, ampl_width=WAVE_WIDTH)

    # Rounded once, to nearest, half up.
    cut = pkg.ALIGNED_WIDTH + SUM_FRACTION - pixel_width
    total = noise * (settings.noise << (SUM_FRACTION - NOISE_FRACTION))
    total += (settings.pedestal << SUM_FRACTION) + (1 << (cut - 1))
    total[inside] += settings.height * (WAVE_ONE + cosine)
    pixels: Pixels = np.clip(total >> cut, 0, (1 << pixel_width) - 1).astype(np.uint16)
    return pixels


class TestLine:
    """Clock-accurate source of test lines; a new one is in the state after a reset.

    Args:
        settings: The registers; ``settings`` may be replaced between two steps, which takes effect
            at the next start.
        line_length: ``LineLength`` of the module.
        pixel_width: ``PixelWidth`` of the module.

    Attributes:
        line_start, line_end, pixel_valid: The strobes.
        pixel: The pixel with ``pixel_valid``; the hardware does not define it otherwise.
        running: Whether a run is in progress.
    """

    __test__ = False  # pytest must not collect it as a test

    def __init__(
        self, settings: TestLineSettings, line_length: int = 2048, pixel_width: int = 12
    ) -> None:
        self.settings = settings
        self.line_length = line_length
        self.pixel_width = pixel_width
        self.line_start = False
        self.line_end = False
        self.pixel_valid = False
        self.pixel = 0
        self.running = False
        self._run = settings
        self._made: Pixels = np.empty((0, line_length), np.uint16)
        self._active = False
        self._begun = 0  # lines of the run so far
        self._wait = 0  # clocks until the next line begins
        self._age = 0  # clocks since the last line began, 0 before the first one

    def step(self, *, test_start: bool, test_stop: bool) -> None:
        """Advance by one clock."""
        if test_start:
            self.line_start = self.line_end = self.pixel_valid = False
            self._run = self.settings
            self._made = self._made[:0]
            self._active = self.running = True
            self._begun = self._age = 0
            self._wait = START_LATENCY - LINE_LATENCY - 1
            return
        self._age += self._age > 0
        self.running = self._active or 1 < self._age < LINE_LATENCY + self.line_length
        index = self._age - LINE_LATENCY
        self.pixel_valid = 0 <= index < self.line_length
        self.line_start = index == 0
        self.line_end = index == self.line_length - 1
        if self.pixel_valid:
            self.pixel = int(self._line()[index])
        if self._active:
            if self._wait == 0:
                self._begun += 1
                self._age = 1
                self._wait = max(self._run.period_clks, least_period(self.line_length))
                self._active = self._begun != self._run.lines
            self._wait -= 1
            self._active = self._active and not test_stop

    def _line(self) -> Pixels:
        """Return the line in progress; each time twice as many lines of a run are computed."""
        if self._begun > len(self._made):
            self._made = lines(
                self._run,
                2 * self._begun,
                line_length=self.line_length,
                pixel_width=self.pixel_width,
            )
        made: Pixels = self._made[self._begun - 1]
        return made
