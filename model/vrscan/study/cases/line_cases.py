"""Difficult lines: nothing on it, too much, too narrow, too wide, at an end, or with rivals."""

from collections.abc import Iterator

import numpy as np

from vrscan.data.config import Peak
from vrscan.study.cases.case import STEP_PX, Case, LineCase
from vrscan.study.cases.case_line import Line
from vrscan.study.cases.case_shapes import (
    ANY_WIDTH,
    FULL,
    LENGTH,
    LEVEL,
    background,
    box,
    clipped,
    gauss,
    generator,
    line,
    reach,
    spot,
    with_spots,
)

LAST = LENGTH - 1
FAR = 200  # px between spots with separate windows, neither in the other's background
NOTHING = "LOW_SNR TOO_NARROW NO_NOISE"
NEARLY = "position within 0.01 px of the spot's centre"
INSIDE = "position within one step of the symmetric spot's centre"


def _even(value: int, flags: str = NOTHING) -> Line:
    return line(np.full(LENGTH, value, np.uint16), flags)


def _empty() -> Iterator[Case]:
    defined = "S/N 0 as the maximum is the background, window empty, noise 0: no position"
    yield LineCase("line-flat", "S/N is 0/0", defined, (_even(LEVEL),))
    yield LineCase("line-zero", "S/N is 0/0, every sum is 0", defined, (_even(0),))
    yield LineCase(
        "line-full-scale",
        "S/N is 0/0, and more light is not what is missing",
        f"{defined}; SATURATED without a window, so that the laser goes down",
        (_even(FULL, f"{NOTHING} SATURATED"),),
    )
    noisy = 60.0 + 3.0 * generator(1).standard_normal((20, LENGTH))
    yield LineCase(
        "line-noise-only",
        "the largest of 2048 noises is a maximum too",
        "2048 Gaussian noises reach 3 to 5 deviations, in a pixel or two: LOW_SNR or TOO_NARROW",
        tuple(line(clipped(row), None) for row in noisy),
    )


def _narrow() -> Iterator[Case]:
    dark = background()
    alone = line(box(dark, 700, [FULL]), "TOO_NARROW SATURATED", window=(700, 700))
    yield LineCase(
        "hot-pixel",
        "N = 1: T = N - 1 = 0 and (8) is 0/0",
        "one pixel is no peak: TOO_NARROW",
        (alone,),
    )
    beside = box(with_spots(dark, (1500, 3, 2000)).astype(np.float64), 700, [FULL])
    yield LineCase(
        "hot-pixel-and-spot",
        "the maximum is not the spot's",
        "the run of the first maximum decides: TOO_NARROW, and RIVAL tells that there is a peak",
        (line(beside, "TOO_NARROW SATURATED RIVAL", true=1500, window=(700, 700)),),
    )
    inside = with_spots(dark, (1500, 3, 2000))
    inside[1504] = 3500
    yield LineCase(
        "hot-pixel-in-the-spot",
        "one pixel of the window has a height of its own",
        "a fit weighs it by the spot's shape: within 0.3 px; with one window it pulls by its share "
        "of the harmonic, less than 1 px",
        (line(inside, "", true=1500),),
        within_px=1.0,
        fit_px=0.3,
    )
    yield LineCase(
        "peak-1-px", "N = 1", "TOO_NARROW",
        (line(box(dark, 700, [2000]), "TOO_NARROW", window=(700, 700)),),
    )  # fmt: skip
    yield LineCase(
        "peak-2-px", "N = 2, T = 1: both samples have one phase, 2 pi", "TOO_NARROW: no phase",
        (line(box(dark, 700, [2000, 1500]), "TOO_NARROW", true=700.43, window=(700, 701)),),
    )  # fmt: skip
    three = [
        # Heights a, b, c at the phases 0, 1/3, 2/3: by hand where two are equal.
        line(box(dark, 700, [1000, 3000, 1000]), "", true=701, window=(700, 702), position=701),
        line(box(dark, 700, [3000, 3000, 1000]), "", window=(700, 702), position=700.5),
        line(box(dark, 700, [1000, 3000, 3000]), "", window=(700, 702), position=701.5),
    ]
    yield LineCase(
        "peak-3-px",
        "N = 3, T = 2: three samples on two phases",
        "T = 3: two equal ones give their middle, one in the middle itself, to a step",
        tuple(three),
        window="threshold",
    )
    thin = [
        spot(700.0, 0.4, 3000, flags="TOO_NARROW", at_one="", window=(699, 701)),
        spot(700.25, 0.4, 3000, flags="TOO_NARROW", window=(700, 701)),
        spot(700.5, 0.4, 3000, flags="TOO_NARROW", window=(700, 701)),
    ]
    yield LineCase(
        "spot-0.4-px",
        "sharper than the pixels: 1 to 3 of them, as it falls",
        "TOO_NARROW at 15 % of the height; one window has three of them where it lies on a pixel, "
        "and its centre",
        tuple(thin),
    )
    yield LineCase(
        "spot-0.6-px",
        "sampled too coarsely for (8)",
        "where three pixels are above 15 % of the height, within 0.01 px, and TOO_NARROW "
        "elsewhere; one window measures it wherever it falls, 3 or 4 pixels, within 0.1 px",
        tuple(
            spot(
                700 + part,
                0.6,
                3000,
                flags="" if three else "TOO_NARROW",
                at_one="",
                mixed=part == 0.0,
            )
            for part in np.arange(0.0, 1.0, 0.125).tolist()
            for three in (1.0 + min(part, 1.0 - part) < 0.6 * np.sqrt(-2.0 * np.log(0.15)),)
        ),
        within_px=0.1,
        fit_px=0.01,
    )


def _wide() -> Iterator[Case]:
    def flanked(width: int) -> Line:
        left = 900
        flags = "TOO_WIDE" if width == 65 or width > 255 else ""
        heights = np.full(width, 3000.0)
        heights[[0, -1]] = 1500.0
        middle = left + (width - 1) / 2
        return line(
            box(background(), left, heights),
            flags,
            mixed=not flags,
            true=middle,
            window=(left, left + width - 1),
        )

    yield LineCase(
        "peak-of-max-window",
        "254 and 255 pixels: the last that are measured",
        f"with max_core at its largest: {INSIDE}",
        (flanked(254), flanked(255)),
        peak=ANY_WIDTH,
    )
    yield LineCase(
        "peak-wider-than-max-window",
        "256 pixels and more do not fit in the window's memory",
        "TOO_WIDE, no position; left, right and width are those of the run",
        (flanked(256), flanked(280), flanked(300)),
        peak=ANY_WIDTH,
    )
    yield LineCase(
        "core-of-64-and-65-px",
        "a lamp or a lit edge is as bright as a spot, and wider",
        "64 pixels at a quarter of the height are measured, 65 are TOO_WIDE",
        (flanked(64), flanked(65)),
    )
    wide = np.full(400, 3000.0)
    yield LineCase(
        "plateau-400-px",
        "the run reaches into the blocks that are its background",
        "LOW_SNR and TOO_WIDE: 256 px from the maximum the run counts as background",
        (line(box(background(), 900, wide), "LOW_SNR TOO_WIDE", true=1099.5, window=(900, 1299)),),
    )
    yield LineCase(
        "spot-60-px",
        "a blurred spot, 335 pixels above 2 % of its height",
        "TOO_WIDE",
        (spot(1024, 60, 3000, flags="TOO_WIDE"),),
    )
    limited = spot(1024, 3, 3000, flags="TOO_WIDE")
    yield LineCase(
        "max-width-10",
        "11 pixels at the first cut, 17 at that of one window, where the register allows 10",
        "TOO_WIDE by the register",
        (limited,),
        peak=Peak(max_width=10),
    )


def _ends() -> Iterator[Case]:
    edge = reach(3.0)
    yield LineCase(
        "spot-at-window-touching-ends",
        "the whole spot is there, and its window ends with the sensor",
        f"AT_EDGE; {INSIDE}",
        (
            spot(edge, flags="AT_EDGE", window=(0, 2 * edge)),
            spot(LAST - edge, flags="AT_EDGE", window=(LAST - 2 * edge, LAST)),
        ),
    )
    yield LineCase(
        "spot-at-pixel-0",
        "half of the spot is outside",
        "AT_EDGE; (8) of the half that is there, between its end and its middle: 1 to 4 px inside",
        (spot(0.0, flags="AT_EDGE", mixed=True, window=(0, edge)),),
        within_px=4.0,
    )
    yield LineCase(
        "spot-at-the-last-pixel",
        "half of the spot is outside",
        "as at pixel 0",
        (spot(float(LAST), flags="AT_EDGE", mixed=True, window=(LAST - edge, LAST)),),
        within_px=4.0,
    )
    out = [-3.0, LAST + 3.0, -1.5, LAST + 1.5, 1.5, LAST - 1.5]  # at one end it would be a foot
    yield LineCase(
        "spot-half-outside",
        "centres from 3 px outside to 1.5 px inside, at both ends",
        "AT_EDGE; (8) of what is there: within the window, so at most N px off",
        tuple(spot(each, flags="AT_EDGE", mixed=not 0 < each < LAST) for each in out),
        within_px=edge + 1.0,
    )


def _plateau(width: int, left: int, flanks: int) -> Line:
    """Return a saturated plateau, with one pixel of half its height at ``flanks`` of its sides."""
    heights = [FULL] * width
    if flanks:
        heights = [2000, *heights, 2000]
    total = len(heights)
    start = left - (1 if flanks else 0)
    pixels = box(background(), start, heights)
    names = ["SATURATED"]
    middle = start + (total - 1) / 2
    if total < 3:
        names.append("TOO_NARROW")
    if start == 0 or start + total == LENGTH:
        names.append("AT_EDGE")
    at_one = [*names, "NO_PHASE"] if total >= 3 and not flanks else names
    return line(
        pixels,
        " ".join(names),
        at_one=" ".join(at_one),
        true=middle,
        window=(start, start + total - 1),
    )


def _plateaus() -> Iterator[Case]:
    odd, even = range(1, 201, 2), range(2, 201, 2)
    defined = "SATURATED; the run counts, not its first pixel: the middle of it, to a step"
    for name, widths in (("odd", odd), ("even", even)):
        yield LineCase(
            f"plateau-{name}",
            f"{len(widths)} saturated plateaus of 1 to 200 pixels with a flank on either side",
            defined,
            tuple(_plateau(width, 800, 1) for width in widths),
        )
    yield LineCase(
        "plateau-without-flanks",
        "boxes of 1 to 200 saturated pixels: all phases alike, X = Y = 0",
        "SATURATED; the second window lies around the run, whose middle it gives, to a step. One "
        "window is flat and has no first harmonic: NO_PHASE. Below 3 pixels TOO_NARROW",
        tuple(_plateau(width, 800, 0) for width in (1, 2, 3, 4, 5, 10, 50, 51, 100, 199, 200)),
    )
    uneven = []
    for width in (3, 10, 51, 200):
        pixels = box(background(), 800, [1000, *[FULL] * width, 3000])
        # Above the background the run has the weight (height - level) at its ends and in between.
        shift = (3000 - 1000) / (FULL - LEVEL) / 2
        uneven.append(line(pixels, "SATURATED", true=800 + (width + 1) / 2 + shift))
    yield LineCase(
        "plateau-uneven-flanks",
        "the plateau's edges lie between pixels: one flank at 1000, one at 3000",
        "SATURATED; the middle of the light, which is 0.25 px off the run's, within 0.02 px",
        tuple(uneven),
        within_px=0.02,
    )
    ends = [
        _plateau(width, left, 1)
        for width in (1, 2, 9, 10, 99, 200)
        for left in (1, LENGTH - width - 1)
    ]
    yield LineCase(
        "plateau-touching-an-edge",
        "plateaus whose flank is the first or the last pixel",
        "SATURATED and AT_EDGE; the middle of the run, to a step",
        tuple(ends),
    )
    flags = "SATURATED AT_EDGE"
    cut = []
    for n in (2, 9, 10, 99, 200):
        # The phase is opposite to the weaker sample: its place and half of T = n + 1.
        pixels = box(background(), 0, [FULL] * n + [2000])
        cut.append(line(pixels, flags, position=(n + 1) / 2 - 1))
        left = LENGTH - n - 1
        pixels = box(background(), left, [2000] + [FULL] * n)
        cut.append(line(pixels, flags, position=left + (n + 1) / 2))
    yield LineCase(
        "plateau-cut-by-an-edge",
        "plateaus of 2 to 200 pixels of which one flank is outside",
        "SATURATED and AT_EDGE; (8) of a box with one weaker end: the place opposite to that end",
        tuple(cut),
        window="threshold",
    )
    level = 3900
    low = [
        clipped(background() + gauss(LENGTH, 1000 + part, 3.0, 1.5 * FULL), level + noise)
        for part in (0.0, 0.25, 0.5)
        for noise in (0, 60)
    ]
    yield LineCase(
        "camera-clips-below-full-scale",
        "a camera's pixels end at 3900 or at 3960, and none is at 4095",
        "saturation_level 3900: SATURATED; the flanks keep the position within 0.06 px",
        tuple(
            line(row, "SATURATED", true=1000 + part)
            for row, part in zip(low, (0.0, 0.0, 0.25, 0.25, 0.5, 0.5), strict=True)
        ),
        within_px=0.06,
        saturation_level=level,
    )
    over = [
        line(clipped(background() + gauss(LENGTH, 1000 + part, 3.0, 20.0 * FULL)), "SATURATED",
             true=1000 + part)
        for part in (0.0, 0.25, 0.5, 0.75)
    ]  # fmt: skip
    yield LineCase(
        "spot-saturated-20-fold",
        "7 to 15 pixels of 21 have lost their height",
        "SATURATED; the flanks keep the position within 0.06 px",
        tuple(over),
        within_px=0.06,
    )


def _company() -> Iterator[Case]:
    dark = background()
    reached = reach(3.0)

    def far(distance: float, ratio: float) -> Iterator[Line]:
        """Return lines with a second spot: on a pixel, by hand; between two, by the equations."""
        for place in (600.0, 600.3):
            pixels = with_spots(dark, (place, 3, 3000), (place + distance, 3, 3000 * ratio))
            window = (600 - reached, 600 + reached) if place == 600.0 else None
            yield line(pixels, "RIVAL", true=place, window=window)

    yield LineCase(
        "two-equal-maxima-far",
        "two peaks, one as good as the other",
        f"the first maximum's run, RIVAL; {NEARLY}",
        tuple(far(FAR, 1.0)),
        within_px=0.01,
    )
    near = []
    for distance in (2, 4, 6, 8, 10, 12):
        pixels = with_spots(dark, (600, 3, 1500), (600 + distance, 3, 1500))
        near.append(line(pixels, "", mixed=distance >= 6, true=600 + distance / 2))
    yield LineCase(
        "two-equal-maxima-near",
        "2 to 12 px apart: one run, two maxima",
        "one peak: the middle of both by symmetry, to a step; MIXED from 2 sigma on",
        tuple(near),
    )
    valley = []
    for distance in (18, 19, 20):
        pixels = with_spots(dark, (600, 3.5, 3000), (600 + distance, 3.5, 3000))
        valley.append(line(pixels, "RIVAL", position=600 + distance / 2))
    yield LineCase(
        "two-equal-maxima-two-runs",
        "18 to 20 px apart: the valley is below the first cut",
        "RIVAL; the first maximum's run, which the other spot pulls by less than 0.1 px",
        # Two lines tell the other spot as a foot, before which the third's fit ends.
        tuple(line(e.pixels, "RIVAL", mixed=k < 2, true=600) for k, e in enumerate(valley)),
        within_px=0.1,
        window="fit",
    )
    yield LineCase(
        "two-equal-maxima-one-run",
        "18 to 20 px apart, the valley just above the threshold: the distance is half the window, "
        "so the first harmonic of the two cancels or turns over",
        "RIVAL, for a quarter of the height is above the valley; by symmetry the middle of both, "
        "or half a window from it where the harmonic turns over",
        tuple(_turned(entry) for entry in valley),
        within_px=20.0,
        window="threshold",
    )
    for ratio in (0.3, 0.9, 0.99):
        yield LineCase(
            f"rival-{ratio:g}",
            f"another peak of {ratio:g} of the height, 200 px away, behind and before",
            f"RIVAL; the higher one has no part of it in its window: {NEARLY}",
            (*far(FAR, ratio), *far(-FAR, ratio)),
            within_px=0.01,
        )
        merged = with_spots(dark, (600, 3, 3000), (612, 3, 3000 * ratio))
        seen = ratio < 0.5
        yield LineCase(
            f"rival-{ratio:g}-near",
            f"another peak of {ratio:g} of the height, 4 sigma away, in the same run",
            "RIVAL, for the valley is below a quarter of the height; (8) of both, between them"
            if seen
            else "one run at a quarter of the height, no RIVAL: (8) of both, between them; MIXED "
            "by a fit",
            (line(merged, "RIVAL" if seen else "", mixed=True, true=600),),
            within_px=12.0,
        )
    normal = spot(900.0, 3, 2000)
    ghost = with_spots(dark, (900, 3, 2000), (1400, 3, 3500))
    yield LineCase(
        "ghost-for-one-line",
        "a reflection is brighter than the spot, on one line of five",
        "the ghost's position and RIVAL on that line; nothing of it on the next",
        (normal, normal, line(ghost, "RIVAL", true=900), normal, normal),
        within_px=500.0 + STEP_PX,
    )
    # A run narrower than min_width is no rival.
    flake = with_spots(dark, (900, 3, 2000))
    flake[1100:1102] = 1500
    yield LineCase(
        "bright-flake",
        "two bright pixels elsewhere",
        f"no RIVAL, for they could not be a peak; {INSIDE}",
        (line(flake, "", true=900, window=(900 - reached, 900 + reached)),),
    )


def _turned(entry: Line) -> Line:
    """Return a symmetric window's line with its position: the middle, or half a window off it."""
    pixels = entry.pixels.astype(np.int64)
    assert entry.position is not None
    maximum = int(pixels.max())
    cut = LEVEL + 0.02 * (maximum - LEVEL)
    middle = entry.position
    left = int(np.ceil(middle))
    while pixels[left - 1] > cut:
        left -= 1
    width = round(2 * (middle - left)) + 1
    place = np.arange(width) - (width - 1) / 2
    along = float((pixels[left : left + width] * np.cos(2.0 * np.pi * place / width)).sum())
    position = middle if along > 0 else left + ((middle - left + width / 2) % width)
    window = (left, left + width - 1)
    return Line(entry.pixels, entry.flags, true=middle, window=window, position=position)


def cases() -> Iterator[Case]:
    """Return the entries of this module."""
    for part in (_empty, _narrow, _wide, _ends, _plateaus, _company):
        yield from part()
