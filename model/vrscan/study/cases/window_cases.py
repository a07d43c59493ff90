"""Difficult backgrounds under the spot: a pedestal, a slope, a pattern, noise."""

from collections.abc import Iterator

import numpy as np

from vrscan.data.arrays import Floats
from vrscan.study.cases.case import Case, LineCase, SpreadCase
from vrscan.study.cases.case_line import Line
from vrscan.study.cases.case_shapes import (
    FULL,
    LENGTH,
    background,
    clipped,
    gauss,
    generator,
    line,
    spot,
    with_spots,
)

PARTS = tuple(np.arange(0.0, 1.0, 0.125).tolist())  # px: positions between two pixels
NOISES = 60  # lines per case of noise


def _pedestals() -> Iterator[Case]:
    share = (0.0, 0.05, 0.25, 0.5, 0.75, 0.9, 0.95)
    lines = []
    for part in PARTS:
        for k, level in enumerate(share):
            ground = np.floor(level * FULL)
            base = background(level=int(ground)) if k else np.zeros(LENGTH)
            flags = "" if k else "NO_NOISE"
            lines.append(spot(700 + part, 3, 150, flags=flags, base=base, level=ground))
    yield LineCase(
        "pedestal-0-to-95-percent",
        "with T = N - 1 the first and last sample share a phase: the pedestal leaks into X",
        "T = N: a pedestal drops out exactly. One spot of 150 counts on 0, 5, 25 .. 95 % of full "
        "scale: within 0.02 px, its pixels' rounding",
        tuple(lines),
        within_px=0.02,
    )


def _slopes() -> Iterator[Case]:
    place = np.arange(LENGTH)
    whole = [
        line(clipped(60.0 + place + gauss(LENGTH, 1024, s, 1500)), None, true=1024) for s in (3, 8)
    ]
    yield LineCase(
        "slope-1-count-per-px-whole-line",
        "the line's deviation is that of the slope, 590 counts, the height 2.5 times as much",
        "S/N by the noise within parts of 16 pixels beside the spot, 5 counts; RIVAL, for the "
        "bright end is above a quarter of the height. The slope is taken off: within 0.01 px; it "
        "pulls one window, by less than 0.1 px",
        tuple(whole),
        within_px=0.1,
        fit_px=0.01,
    )
    wall = np.clip(1.2 * (place - 900), 0.0, None)
    yield LineCase(
        "gradient-far-from-the-spot",
        "a wall that gets brighter 400 px away: the line's deviation is 450 counts",
        "S/N by the noise beside the spot; RIVAL, for the wall's end is above a quarter of the "
        "height. Within 0.01 px",
        tuple(
            line(with_spots(background() + wall, (500 + part, 3, 3000)), "RIVAL", true=500 + part)
            for part in PARTS
        ),
        within_px=0.01,
    )
    bumps = [gauss(LENGTH, centre, s, 1500) for centre, s in ((700, 25), (1300, 80), (40, 60))]
    ramp: Floats = 1500.0 * place / LENGTH
    lit: Floats = np.where(place < 1500, 1500.0, 0.0)
    yield LineCase(
        "light-without-a-spot",
        "lamps, an edge and a gradient that are brighter than any noise",
        "no position: wider than a spot, or no more than the line's deviation allows",
        tuple(line(clipped(background() + light), None) for light in (*bumps, ramp, lit)),
    )
    bend = np.where(np.abs(place - 1024) <= 30, place - 1024.0, 0.0)
    for sigma, within in ((3.0, 0.1), (8.0, 0.3)):
        lines = [
            line(
                clipped(background() + bend + gauss(LENGTH, 1024 + part, sigma, 3000)),
                None,
                true=1024 + part,
            )
            for part in PARTS
        ]
        yield LineCase(
            f"slope-1-count-per-px-under-{sigma:g}-px",
            f"a slope over 60 px under a spot of {sigma:g} px and 3000 counts",
            f"too short to be told as a slope, it is part of the window: within {within} px",
            tuple(lines),
            within_px=within,
        )
    long = np.where(np.abs(place - 1024) <= 200, 200.0 + (place - 1024.0), 0.0)
    for sigma in (3.0, 8.0):
        lines = [
            line(
                clipped(background() + long + gauss(LENGTH, 1024 + part, sigma, 3000)),
                None if sigma < 8 else "",  # light on one side line after line is a foot
                at_one="TOO_WIDE",
                mixed=sigma == 8,
                true=1024 + part,
            )
            for part in PARTS
        ]
        yield LineCase(
            f"slope-1-count-per-px-of-400-px-{sigma:g}",
            f"a slope that rises by 400 counts under a spot of {sigma:g} px and 3000 counts",
            "the first cut is above the slope, which is taken off: within 0.01 px; the run of one "
            "window climbs it: TOO_WIDE",
            tuple(lines),
        )
    halo = np.where(np.abs(place - 1024) <= 40, 220.0 + (place - 1024.0), 0.0)
    lines = [
        line(clipped(background() + halo + gauss(LENGTH, 1024 + p, 3, 3000)), None, true=1024 + p)
        for p in PARTS
    ]
    yield LineCase(
        "halo-under-the-spot",
        "a halo of 80 px, uneven, higher than the cut: 180 to 260 counts under a spot of 3000",
        "the first cut is above the halo: within 0.05 px; the run of one window has the halo, and "
        "so has (8): within the run",
        tuple(lines),
        within_px=40.0,
        fit_px=0.05,
    )
    tilted = [
        line(clipped(60.0 + 0.1 * place + gauss(LENGTH, 700 + p, 3, 3000)), None, true=700 + p)
        for p in PARTS
    ]
    yield LineCase(
        "slope-0.1-count-per-px-whole-line",
        "the threshold is that of the mean, not of the place",
        "the slope is taken off: within 0.01 px; it pulls one window, by less than 0.02 px",
        tuple(tilted),
        within_px=0.02,
        fit_px=0.01,
    )


def _patterns() -> Iterator[Case]:
    place = np.arange(LENGTH)
    for name, amplitude, period, within in (
        ("weak", 30.0, 37.0, 0.2),
        ("strong", 200.0, 37.0, 0.3),
        ("fine", 200.0, 2.0, 0.02),
    ):
        lines = []
        for part in PARTS:
            wave = amplitude * np.cos(2.0 * np.pi * (place / period + part))
            if period == 2.0:
                wave = amplitude * np.where(place % 2 == 0, 1.0, -1.0)
            pixels = clipped(300.0 + wave + gauss(LENGTH, 700 + part, 3, 3000))
            lines.append(line(pixels, None, true=700 + part))
        yield LineCase(
            f"periodic-background-{name}",
            f"a wave of {amplitude:g} counts and {period:g} px under the spot and beside it",
            f"it counts as noise and lifts the cut; within {within} px. What lies under the "
            "spot cannot be told from its flanks",
            tuple(lines),
            within_px=within,
        )


def _noises() -> Iterator[Case]:
    draw = generator(2)
    calm = []
    for level in (60.0, 60.4):
        for part in PARTS:
            noise = 0.1 * draw.standard_normal(LENGTH)
            pixels = clipped(level + gauss(LENGTH, 700 + part, 3, 3000) + noise)
            calm.append(line(pixels, None, true=700 + part))
    yield LineCase(
        "noise-a-tenth-of-a-count",
        "less than a count: rounded away, or a count now and then",
        "what is left of it decides: NO_NOISE and the largest S/N, or a small noise; within 0.01 "
        "px",
        tuple(calm),
        within_px=0.01,
    )

    def noisy(height: float, noise: float, salt: int) -> tuple[Line, ...]:
        draw = generator(salt)
        true = 700.0 + draw.uniform(0, 1, NOISES)
        spots = (gauss(LENGTH, t, 3, height) for t in true)
        rows = (300.0 + s + noise * draw.standard_normal(LENGTH) for s in spots)
        return tuple(
            line(clipped(r), None, true=t) for r, t in zip(rows, true.tolist(), strict=True)
        )

    yield LineCase(
        "noise-snr-10",
        "a spot of 300 counts in a noise of 30: the window's ends are the noise's",
        f"the bound is 0.18 px rms; all of {NOISES} lines within 2 px",
        noisy(300.0, 30.0, 5),
        within_px=2.0,
    )  # fmt: skip
    draw = generator(4)
    wild = draw.integers(0, FULL // 2 + 1, (20, LENGTH)).astype(np.float64)
    yield LineCase(
        "noise-half-the-scale",
        "every second pixel is as high as a peak",
        "even noise over half the scale has a deviation of 591 counts, and no pixel is 8 of them "
        "above the mean: LOW_SNR",
        tuple(line(clipped(row + gauss(LENGTH, 700, 3, 2000)), None, true=700) for row in wild),
    )
    step = with_spots(background(), (700, 3, 3000))
    step[:512] += 400
    yield LineCase(
        "background-step",
        "the background is 400 counts higher on a quarter of the line",
        "the step counts as noise and lifts the cut; the spot is symmetric, so its place stays",
        (line(step, None, true=700),),
    )
    place = np.arange(LENGTH, dtype=np.float64) - 700.0
    skewed = np.exp(-(place**2) / (2.0 * np.where(place < 0, 2.25, 3.75) ** 2))
    skew = [line(clipped(background() + h * FULL * skewed), None) for h in (0.1, 0.25, 0.5, 0.9)]
    yield SpreadCase(
        "skewed-spot",
        "sides of 2.25 and 3.75 px: where it is cut decides its place, and power moves the cut",
        "cut at a share of any height: from 10 to 90 % of full scale it moves less than 0.02 px",
        tuple(skew),
        within_px=0.02,
    )


def cases() -> Iterator[Case]:
    """Return the entries of this module."""
    for part in (_pedestals, _slopes, _patterns, _noises):
        yield from part()
