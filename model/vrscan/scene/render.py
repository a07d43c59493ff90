"""A scene's lines, rendered with any set of its effects and always the same random numbers.

The light of a spot on the row is one or more pieces (``vrscan.scene.pieces``): a place on the row,
an amount of light, and its blur. A line with one piece on an even background takes one short
transform and a table look-up for each dark pixel; several pieces near each other have one window.
Only where something else falls on the row (ghosts, wings, light that changes along it) is the whole
line computed pixel by pixel.
Both ways use the same word of noise for the same pixel of the same line, and their results agree
bit for bit where both apply.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.data.errors import blamed
from vrscan.data.lines import Truth
from vrscan.scene import bounce, image
from vrscan.scene.beam import pulse_transform
from vrscan.scene.effects import BESIDE, whole_lines
from vrscan.scene.image import Singles
from vrscan.scene.light import Light, Windows
from vrscan.scene.pieces import OUTER, Pieces, Spotter
from vrscan.scene.sensor import (
    Readout,
    bloom,
    chunks,
    expose_even,
    expose_pixels,
    readout,
)
from vrscan.scene.speckle import SHARP
from vrscan.scene.spots import Spots
from vrscan.scene.timeline import Timeline

_WIDE_DISC = 8.0  # spot sigmas of a ghost's radius above which its ends count as hard
_LEAST_GHOST_E = 0.03  # electrons at the rated power on its brightest pixel: fainter is left out
_LEAST_FLICKER_E = 0.1  # least flicker of lamps that is rendered, electrons
_SPILT_E = 0.05  # electrons of blooming that may be lost at a window's end
_MERGED = 32  # px: a window around several of a line is as wide as some of these
_CHUNK = 256  # lines whose rays are summed at a time


@dataclass(frozen=True)
class Frame:
    """n rendered lines."""

    lines: Pixels  # counts [n, length]
    timeline: Timeline
    reported_rad: Floats  # the angle that the chain is told [n]
    truth: Truth


@dataclass(frozen=True)
class Charge:
    """Mean electrons of n lines, before blooming, noise and converter.

    A line's mean is ``laser_e + other_e``, and each pixel's noiseless offset is
    ``other_offset_e + offset_e``. All of these but ``offset_e`` grow with their light.
    """

    laser_e: Singles  # electrons of the laser [n, length]
    other_e: Singles  # all other light and the dark current in an exposure [length]
    other_offset_e: Singles  # pattern of ``other_e`` from pixel to pixel where it is even
    offset_e: Singles  # offsets of the sensor itself
    whole_e: Floats  # all light of each line's spot in the image, on the row or not [n]


@dataclass(frozen=True)
class Unexposed:
    """n lines before their exposure: what falls on the pixels, the laser's part by itself."""

    laser_e: Singles  # mean electrons of the laser at the scene's power [n, length]
    other_e: Singles  # mean electrons of all other light [n, length] or [1, length]
    reported_rad: Floats  # the angle that the chain is told [n]
    truth: Truth

    def of(self, rows: Ints) -> "Unexposed":
        """Return some of the lines."""
        truth = self.truth
        return Unexposed(
            laser_e=self.laser_e[rows],
            other_e=self.other_e if len(self.other_e) == 1 else self.other_e[rows],
            reported_rad=self.reported_rad[rows],
            truth=Truth(
                x_mm=truth.x_mm[rows],
                z_mm=truth.z_mm[rows],
                position_px=truth.position_px[rows],
                surface=truth.surface[rows],
                names=truth.names,
            ),
        )

    @classmethod
    def joined(cls, parts: Sequence["Unexposed"], order: Ints) -> "Unexposed":
        """Return all lines of ``parts``, at least one, in another order: row k is ``order[k]``."""
        others = [np.broadcast_to(each.other_e, each.laser_e.shape) for each in parts]
        truths = [each.truth for each in parts]
        return cls(
            laser_e=np.concatenate([each.laser_e for each in parts]),
            other_e=np.concatenate(others),
            reported_rad=np.concatenate([each.reported_rad for each in parts]),
            truth=Truth(
                x_mm=np.concatenate([each.x_mm for each in truths]),
                z_mm=np.concatenate([each.z_mm for each in truths]),
                position_px=np.concatenate([each.position_px for each in truths]),
                surface=np.concatenate([each.surface for each in truths]),
                names=truths[0].names,
            ),
        ).of(order)


class Renderer:
    """Renderer of a scene's lines with the effects ``active``.

    ``seconds`` holds the processor time that each effect has taken so far, and under ``""`` that of
    all else.
    """

    def __init__(
        self,
        light: Light,
        active: frozenset[str],
        *,
        tolerance_px: float | None = None,
    ) -> None:
        """Prepare what depends only on the effects.

        Args:
            light: The scene.
            active: Names of the effects that are on.
            tolerance_px: Largest error of a tangent plane, above which a spot is followed ray by
                ray; the scene's tolerance if None. With 0 all spots are.
        """
        self.light, self.active = light, active
        self.tolerance_px = light.scene.tolerance_px if tolerance_px is None else tolerance_px
        self.seconds: dict[str, float] = {}
        self._inner = 0.0
        scene, config = light.scene, light.config
        self._spotter = Spotter(light, active, self._clock, tolerance_px=self.tolerance_px)
        model = scene.sensor
        if "read" not in active:
            model = model.model_copy(update={"read_noise_e": 0.0})
        self._readout = readout(model, config.peak.kappa, config.sensor.pixel_width)
        # A spot that moves v px in the pulse has at k cycles/px the pulse's transform at k v.
        pulse_s = 1e-6 * config.line.pulse_us
        turns = image.PULSE_TURNS / pulse_s
        with blamed(scene.source):
            self._pulse = pulse_transform(turns, scene.laser, pulse_s).astype(np.float32)
        self._transfer: dict[int, Singles] = {}
        pattern = light.pattern
        self._sensitivity: Singles | None = pattern.sensitivity if "prnu" in active else None
        if "dust" in active:
            shadow = light.shadow
            known = self._sensitivity
            self._sensitivity = shadow if known is None else known * shadow
        # A panning scanner sees something else in every line, and lamps may flicker.
        panning = scene.scan.pan_mm_per_s != 0.0
        flickers = "lamps" in active and light.flicker_e() > _LEAST_FLICKER_E
        self._changing = [
            name
            for name in ("sun", "lamps")
            if name in active and (panning or (flickers and name == "lamps"))
        ]
        self._even_e, self._uneven_e = self._ambient()
        # Even light's pattern counts as an offset, so that one table serves all dark pixels.
        self._offset: Singles | None = pattern.dark_e if "dsnu" in active else None
        if self._sensitivity is not None and self._even_e > 0.0:
            extra = np.float32(self._even_e) * (self._sensitivity - np.float32(1.0))
            self._offset = extra if self._offset is None else self._offset + extra

    def of(self, light: Light) -> "Renderer":
        """Return a renderer of another light with these effects."""
        return Renderer(light, self.active, tolerance_px=self.tolerance_px)

    # -- one block --

    def render(self, timeline: Timeline, words: Pixels) -> Frame:
        """Return the lines of a timeline.

        Args:
            timeline: n lines.
            words: The random words of their pixels, uint16 [n, length].
        """
        begin, self._inner = time.thread_time(), 0.0
        frame = self._render(timeline, words)
        rest = time.thread_time() - begin - self._inner
        self.seconds[""] = self.seconds.get("", 0.0) + rest
        return frame

    @contextmanager
    def _clock(self, name: str) -> Iterator[None]:
        begin, before = time.thread_time(), self._inner
        try:
            yield
        finally:
            taken = time.thread_time() - begin
            own = taken - (self._inner - before)
            self.seconds[name] = self.seconds.get(name, 0.0) + own
            self._inner = before + taken

    def _render(self, timeline: Timeline, words: Pixels) -> Frame:
        spots, pieces, second = self._spotter.find(timeline)
        lines = self._expose(pieces, second, timeline, words)
        return Frame(
            lines=lines,
            timeline=timeline,
            reported_rad=self._reported(timeline),
            truth=self.truth(spots),
        )

    def _reported(self, timeline: Timeline) -> Floats:
        """Return the angles that the instrument states."""
        return timeline.reported_rad if "index" in self.active else timeline.angle_rad

    def unexposed(self, timeline: Timeline) -> Unexposed:
        """Return the light of lines whose laser's power is not known yet.

        Args:
            timeline: n lines.
        """
        spots, pieces, second = self._spotter.find(timeline)
        length = self.light.config.sensor.line_length
        laser = self._laser_e(pieces, second, timeline)
        other = np.zeros((1, length), np.float32)
        if self._uneven_e is not None:
            other = other + self._uneven_e
        if self._changing:
            other = other + self.light.changing_ambient(self._changing, timeline)
        if self._sensitivity is not None:
            other *= self._sensitivity
        other += np.float32(self._even_e)
        return Unexposed(laser, other, self._reported(timeline), self.truth(spots))

    def exposed(self, light: Unexposed, rows: slice, share: Floats, words: Pixels) -> Pixels:
        """Return the counts of some lines; a line is the same whichever come with it.

        Against ``render`` with the same power only float32 rounding differs, and that there are
        always ``wings``.

        Args:
            light: What falls on the pixels.
            rows: m of its lines.
            share: Light of each line's pulse over that at the scene's power [m].
            words: The random words of their pixels, uint16 [m, length].
        """
        mean = light.laser_e[rows] * share.astype(np.float32)[:, None]
        mean += light.other_e if len(light.other_e) == 1 else light.other_e[rows]
        return self._pixels(mean, words, self._offset)

    def _laser_e(self, pieces: list[Pieces], second: list[Pieces], timeline: Timeline) -> Singles:
        """Return the electrons of the laser's light on all pixels [n, length]."""
        laser = np.zeros((len(timeline), self.light.config.sensor.line_length), np.float32)
        for row, first, light in (d for p in pieces + second for d in self._drawn(p, timeline)):
            _add(laser, row, first, light)
        self._elsewhere(laser, np.arange(len(timeline)), pieces, timeline)
        return laser

    def look(self, timeline: Timeline) -> Truth:
        """Return the truth of the lines' spots, without making the lines."""
        return self.truth(self._spotter.find(timeline)[0])

    def charge(self, timeline: Timeline) -> Charge:
        """Return the charge of lines before the sensor's noise, with the laser's part by itself.

        It leaves out the lamps' flicker and a scanner's way along y.

        Args:
            timeline: n lines, whose angles and their rates are used.
        """
        _, pieces, second = self._spotter.find(timeline)
        length = self.light.config.sensor.line_length
        laser = self._laser_e(pieces, second, timeline)
        other = np.zeros(length, np.float32) if self._uneven_e is None else self._uneven_e.copy()
        for name in self._changing:
            other += self.light.ambient(name, 0.0).astype(np.float32)
        offset = np.zeros(length, np.float32)
        own = self.light.pattern.dark_e if "dsnu" in self.active else offset
        if self._sensitivity is not None:
            other *= self._sensitivity
            offset = np.float32(self._even_e) * (self._sensitivity - np.float32(1.0))
        other += np.float32(self._even_e)
        whole = np.zeros(len(timeline))
        for piece in pieces:
            np.add.at(whole, piece.row, piece.whole_e)
        return Charge(
            laser_e=laser, other_e=other, other_offset_e=offset, offset_e=own, whole_e=whole
        )

    @property
    def readout(self) -> Readout:
        """Return the readout, which turns charge into counts."""
        return self._readout

    def truth(self, spots: Spots) -> Truth:
        """Return the truth of the lines' spots: those of the beam's axis."""
        light = self.light
        length = light.config.sensor.line_length
        place = spots.position_px
        with np.errstate(invalid="ignore"):
            seen = spots.seen & (place > -0.5) & (place < length - 0.5)
        return Truth(
            x_mm=np.where(spots.lit, spots.point[:, 0], np.nan),
            z_mm=np.where(spots.lit, spots.point[:, 2], np.nan),
            position_px=np.where(seen, place, np.nan),
            surface=light.groups[spots.target],
            names=light.names,
        )

    # -- on the row --

    def _drawn(self, pieces: Pieces, timeline: Timeline) -> Iterator[tuple[Ints, Ints, Singles]]:
        """Yield rows, first pixels and mean electrons [m, width] of pieces, one width at a time."""
        if len(pieces) == 0:
            return
        spread = pieces.sigma_px * (1.0 if pieces.zone is None else self._spotter.ring_reach)
        if pieces.parts_px is not None and pieces.share is not None and pieces.cell_px is not None:
            spread = 0.5 * pieces.cell_px.max(axis=1) / image.REACH
            used = np.where(pieces.share > 0.0, pieces.parts_px, pieces.place_px[:, None])
            spread = spread + np.abs(used - pieces.place_px[:, None]).max(axis=1) / image.REACH
        tail = np.abs(pieces.coma_px)
        if pieces.beneath is not None:
            tail = tail + np.abs(pieces.beneath[:, 0]) + pieces.beneath[:, 1]
        widths = image.window_width(spread, pieces.radius_px, pieces.speed_px, tail)
        for width in np.unique(widths):
            rows = np.flatnonzero(widths == width)
            for start in range(0, len(rows), _CHUNK if pieces.parts_px is not None else len(rows)):
                step = _CHUNK if pieces.parts_px is not None else len(rows)
                some = pieces.of(rows[start : start + step])
                yield self._draw(some, int(width), timeline)

    def _draw(self, some: Pieces, width: int, timeline: Timeline) -> tuple[Ints, Ints, Singles]:
        middle = np.round(some.place_px)
        first = middle.astype(np.int64) - width // 2
        shape, spectrum = None, None
        cut = self._spotter.cut
        if some.parts_px is not None and some.share is not None and some.cell_px is not None:
            with self._clock("footprint"):
                place = some.parts_px - middle[:, None]
                spectrum = _spectrum(place, some.share, some.cell_px, width)
        elif cut is not None and some.zone is not None:
            with self._clock("truncation"):
                turns = (2.0 * some.sigma_px)[:, None] * image.frequencies(width)
                band = image.band(some.height_px, some.radius_px)
                shape = cut.transfer(turns.astype(np.float32), some.zone, band)
        # Each blur is a factor; its time is that of the transform with it, less that without it.
        light = image.profiles(
            some.place_px - middle,
            width,
            some.sigma_px if spectrum is None else np.zeros(len(some)),
            # The disc of a ghost is its own.
            radius_px=some.radius_px if "defocus" in self.active or not some.speckled else None,
            height_ratio=some.height_px / np.maximum(some.radius_px, 1e-3),
            # Parts of a spot stay where they are, and have the light of the moving beam.
            speed_px=(
                some.speed_px
                if "smear" in self.active and some.speckled and spectrum is None
                else None
            ),
            pulse=self._pulse,
            coma_px=some.coma_px if "coma" in self.active and some.speckled else None,
            beneath=some.beneath,
            transfer=self._pupil(width),
            shape=shape,
            spectrum=spectrum,
            clock=self._clock,
        )
        light *= some.electrons.astype(np.float32)[:, None]
        np.maximum(light, np.float32(0.0), out=light)
        if "speckle" in self.active and some.speckled:
            with self._clock("speckle"):
                light *= self._speckle(some, first, width, timeline)
        return some.row, first, light

    def _speckle(self, some: Pieces, first: Ints, width: int, timeline: Timeline) -> Singles:
        """Return the gains of the pixels of windows."""
        length, speckle = self.light.config.sensor.line_length, self.light.speckle
        kept = min(width, length)
        start = first if width <= length else np.zeros_like(first)
        blur = SHARP
        if "grain" in self.active:
            with self._clock("grain"):
                # Light from beneath comes from a wider place.
                wide, high = some.sigma_px, some.height_px
                if some.beneath is not None:
                    across = high / np.maximum(some.beneath[:, 2], 1e-6)
                    wide, high = np.hypot(wide, some.beneath[:, 1]), np.hypot(high, across)
                blur = speckle.blur(
                    start[:, None] + np.arange(kept) - some.place_px[:, None],
                    wide,
                    high,
                    some.radius_px,
                    some.speed_px,
                    some.range_mm,
                )
        gain = speckle.gain(
            start,
            kept,
            timeline.angle_rad[some.row],
            self.light.looks[some.surface],
            some.range_mm,
            blur=blur,
            travel_mm=timeline.y_mm[some.row],
            surface=some.surface,
        )
        if width <= length:
            return gain
        column = np.clip(first[:, None] + np.arange(width), 0, length - 1)
        return np.take_along_axis(gain, column, axis=1)

    def _pupil(self, width: int) -> Singles | None:
        if "diffraction" not in self.active:
            return None
        if width not in self._transfer:
            scene, config = self.light.scene, self.light.config
            self._transfer[width] = image.diffraction(
                image.frequencies(width),
                scene.laser.wavelength_nm,
                self.light.lens.working,
                config.geometry.pitch_mm,
            ).astype(np.float32)
        return self._transfer[width]

    def _ambient(self) -> tuple[float, Singles | None]:
        """Return the electrons of all lines: the even part, and the part of each pixel or None."""
        scene = self.light.scene
        even = 0.0
        if "dark" in self.active:
            even += scene.sensor.dark_electrons(self.light.exposure_s)
        if "veil" in self.active:
            even += self.light.veil_e()
        uneven = None
        for name in ("sun", "lamps"):
            if name in self.active and name not in self._changing:
                known = self.light.ambient(name, 0.0)
                if np.ptp(known) > 0.02 * known.mean() + 0.1:
                    uneven = known if uneven is None else uneven + known
                else:
                    even += float(known.mean())
        return even, None if uneven is None else np.asarray(uneven, np.float32)

    def _expose(
        self, pieces: list[Pieces], second: list[Pieces], timeline: Timeline, words: Pixels
    ) -> Pixels:
        """Return the counts of a block; ``second`` are pieces too faint for ghosts and halo."""
        count, length = words.shape
        drawn = []
        low, high, held = np.full(count, length), *np.zeros((2, count), np.int64)
        for row, first, light in (d for p in pieces + second for d in self._drawn(p, timeline)):
            near = (first < length) & (first + light.shape[1] > 0)  # some of it is on the sensor
            row, first, light = row[near], first[near], light[near]
            drawn.append((row, first, light))
            np.minimum.at(low, row, first)
            np.maximum.at(high, row, first + light.shape[1])
            np.add.at(held, row, 1)
        everywhere = whole_lines(self.active) or bool(self._changing)
        everywhere |= self._uneven_e is not None
        whole = np.full(count, everywhere)
        if not everywhere:
            whole |= (low < 0) | (high > length) | ((held > 1) & (high - low > length // 4))
            for row, _, light in drawn if "blooming" in self.active else ():
                whole[row[self._spills(light)]] = True

        lines = np.empty((0, length), np.uint16) if everywhere else self._even(words)
        single = [(at, ~whole[at[0]] & (held[at[0]] == 1)) for at in drawn]
        for width in {each[2].shape[1] for each in drawn}:
            alike = [[k[some] for k in at] for at, some in single if at[2].shape[1] == width]
            row, first, light = (np.concatenate(each) for each in zip(*alike, strict=True))
            if len(row):
                self._windows(lines, row, first, light, pieces, timeline, words)
        # Where a line has several windows, one around them.
        wide = np.where(~whole & (held > 1), -(-(high - low) // _MERGED) * _MERGED, 0)
        for width in np.unique(wide[wide > 0]).tolist():
            rows = np.flatnonzero(wide == width)
            first = np.minimum(low[rows], length - width)
            field = np.zeros((len(rows), width), np.float32)
            _gather(field, rows, first, drawn)
            self._windows(lines, rows, first, field, pieces, timeline, words)
        rows = np.flatnonzero(whole)
        field = np.zeros((len(rows), length), np.float32)
        if self._uneven_e is not None:
            field += self._uneven_e
        if self._changing:
            with self._clock(self._changing[0]):
                field += self.light.changing_ambient(self._changing, timeline)
        _gather(field, rows, np.zeros_like(rows), drawn)
        if len(rows):
            self._elsewhere(field, rows, pieces, timeline)
            field += np.float32(self._even_e)
            if everywhere:
                return self._pixels(field, words, self._offset)
            lines[rows] = self._pixels(field, words[rows], self._offset)
        return lines

    def _spills(self, light: Singles) -> Bools:
        """Return the windows, [m, w] electrons, over whose ends charge of full pixels spills."""
        sensor, width = self.light.scene.sensor, light.shape[1]
        full = np.float32(sensor.full_well_e - self._even_e)
        spills = np.zeros(len(light), np.bool_)
        rows = np.flatnonzero(light.max(axis=1) > full)
        if len(rows):
            over = light[rows] > full
            excess = np.where(over, light[rows] - full, np.float32(0.0)).sum(axis=1)
            charge = 0.5 * sensor.blooming * excess.astype(np.float64)  # to either side
            reach = charge / sensor.full_well_e
            reach += sensor.spill_px * np.log(np.maximum(charge / _SPILT_E, 1.0))
            left, right = over.argmax(axis=1), over[:, ::-1].argmax(axis=1)
            spills[rows] = np.minimum(left, right) < np.minimum(reach, width)
        return spills

    def _even(self, words: Pixels) -> Pixels:
        """Return lines without a spot."""
        if "shot" in self.active:
            return expose_even(words, self._even_e, self._readout, self._offset)
        still = np.full(words.shape[1], np.float32(self._even_e))
        if self._offset is not None:
            still += self._offset
        return expose_even(words, 0.0, self._readout, still)

    def _pixels(self, mean_e: Singles, words: Pixels, dark: Singles | None) -> Pixels:
        """Return the counts of pixels, [m, w], from their mean electrons, which are overwritten."""
        sensor = self.light.scene.sensor
        if "blooming" in self.active:
            with self._clock("blooming"):
                mean_e = bloom(mean_e, sensor, out=mean_e)
        if "shot" in self.active:
            return expose_pixels(words, mean_e, self._readout, dark)
        still = mean_e if dark is None else mean_e + dark
        return expose_pixels(words, np.zeros_like(mean_e), self._readout, still)

    def _windows(
        self,
        lines: Pixels,
        row: Ints,
        first: Ints,
        light: Singles,
        pieces: list[Pieces],
        timeline: Timeline,
        words: Pixels,
    ) -> None:
        """Put spots on an even background into windows, one a line; ``light`` is overwritten."""
        column = first[:, None] + np.arange(light.shape[1])
        mean = light
        if BESIDE & self.active:
            self._beside(mean, row, pieces, timeline, Windows(first, light.shape[1]))
        if self._sensitivity is not None:
            with self._clock("prnu" if "prnu" in self.active else "dust"):
                mean = light * self._sensitivity[column]
        mean = mean + np.float32(self._even_e)
        offset = None
        if self._offset is not None:
            with self._clock("dsnu" if "dsnu" in self.active else "prnu"):
                offset = self._offset[column]
        at = (row[:, None], column)
        lines[at] = self._pixels(mean, words[at], offset)

    def _elsewhere(
        self, field: Singles, rows: Ints, pieces: list[Pieces], timeline: Timeline
    ) -> None:
        """Add to whole lines the light that falls beside the spot."""
        if "ghosts" in self.active:
            with self._clock("ghosts"):
                inside = np.full(len(timeline), -1)
                inside[rows] = np.arange(len(rows))
                self._add_ghosts(field, inside, pieces, timeline)
        self._beside(field, rows, pieces, timeline)
        if self._sensitivity is not None:
            with self._clock("prnu" if "prnu" in self.active else "dust"):
                field *= self._sensitivity

    def _beside(
        self,
        field: Singles,
        rows: Ints,
        pieces: list[Pieces],
        timeline: Timeline,
        windows: Windows | None = None,
    ) -> None:
        """Add halo, skirt and bounce to lines ``rows``, or to windows of them."""
        where = timeline.angle_rad[rows], timeline.y_mm[rows], windows
        if "halo" in self.active:
            with self._clock("halo"):
                inside = np.full(len(timeline), -1)
                inside[rows] = np.arange(len(rows))
                for piece in pieces:
                    some = piece.of(inside[piece.row] >= 0)
                    self._add_halo(field, inside[some.row], some, windows)
        if "skirt" in self.active:
            with self._clock("skirt"):
                self.light.add_skirt(field, self._spotter.electrons, *where)
        if "bounce" in self.active:
            with self._clock("bounce"):
                light = bounce.bounced(self.light, *where)
                light *= np.float32(self._spotter.electrons)
                field += light

    def _add_halo(self, field: Singles, at: Ints, some: Pieces, windows: Windows | None) -> None:
        """Add the halo of pieces, each to the line ``at`` of the field, [n, length] or windows."""
        length = self.light.config.sensor.line_length
        # The halo comes from all light in the image, not only from the row's share.
        whole = some.whole_e.astype(np.float32)
        begin = 2 * length - np.clip(np.round(some.place_px), -length, 2 * length).astype(np.int64)
        if windows is not None:
            begin += windows.first[at]
        weights = sliding_window_view(self.light.halo_table, field.shape[1])
        for once in _each_once(at):
            for few in chunks(len(once), field.shape[1]):
                part = once[few]
                field[at[part]] += whole[part, None] * weights[begin[part]]

    def _add_ghosts(
        self, field: Singles, inside: Ints, pieces: list[Pieces], timeline: Timeline
    ) -> None:
        """Add double reflections in the camera: discs on the row, soft where they are small.

        A disc far wider than the spot has hard ends: what the spot's own width does to them is
        left out. A smaller one beside the row is dimmed as if disc and spot were one Gaussian. A
        ghost that no pixel sees is left out.
        """
        geometry = self.light.config.geometry
        here = [piece.of(inside[piece.row] >= 0) for piece in pieces]
        if not any(len(piece) for piece in here):
            return
        spot = _joined(here)
        assert spot.zone is not None
        found = self.light.ghosts(
            spot.range_mm, (spot.place_px - geometry.centre_px) * geometry.pitch_mm
        )
        area = np.square(found.blur_px) + 2.0 * np.square(spot.height_px)
        share = self.light.scene.laser.power_mw / self.light.config.laser.rated_mw
        lit = spot.whole_e * found.power > share * _LEAST_GHOST_E * np.pi * area
        wide = found.blur_px > _WIDE_DISC * spot.height_px
        hard = (lit & wide).any(axis=1)
        blur, across = found.blur_px[hard], found.across_px[hard]
        half = np.sqrt(np.maximum(np.square(blur) - np.square(across), 0.0))
        level = spot.whole_e * found.power[hard] / (np.pi * np.square(np.maximum(blur, 1e-9)))
        level = np.where((lit & wide)[hard], level, 0.0)
        centre = spot.place_px + found.offset_px[hard] + 0.5
        _add_runs(field, inside[spot.row], centre - half, centre + half, level)
        for zoned in (True, False):  # beams and mirrored spots
            own = np.isnan(spot.zone) != zoned
            ghost, at = np.nonzero(lit & ~wide & own)
            some = spot.of(at) if zoned else replace(spot, zone=None).of(at)
            blur, across = found.blur_px[ghost, at], found.across_px[ghost, at]
            spread = np.square(some.height_px) + 0.25 * np.square(blur)
            light = some.whole_e * found.power[ghost, at]
            light *= image.row_share(some.height_px, blur, cut=self._spotter.cut, zone=some.zone)
            some = replace(
                some,
                place_px=some.place_px + found.offset_px[ghost, at],
                electrons=light * np.exp(-0.5 * np.square(across) / spread),
                radius_px=blur,
                sigma_px=some.height_px,
                speed_px=np.zeros(len(at)),
                coma_px=np.zeros(len(at)),
                speckled=False,
            )
            for row, first, drawn in self._drawn(some, timeline):
                _add(field, inside[row], first, drawn)


def _joined(pieces: list[Pieces]) -> Pieces:
    """Return pieces as one, without their rays; their zone is NaN where they have none."""
    whole = [
        replace(
            each,
            parts_px=None,
            share=None,
            cell_px=None,
            beneath=None,
            zone=np.full(len(each), np.nan) if each.zone is None else each.zone,
        )
        for each in pieces
    ]
    joined: dict[str, Any] = {
        name: np.concatenate([vars(piece)[name] for piece in whole])
        for name, value in vars(whole[0]).items()
        if isinstance(value, np.ndarray)
    }
    return replace(whole[0], **joined)


def _spectrum(
    offset_px: Floats, share: Floats, cell_px: Floats, width: int
) -> npt.NDArray[np.complex64]:
    """Return the spectrum of a spot's cells on the row [m, width + 1].

    Args:
        offset_px: Places of the cells' light [m, k].
        share: Their shares of the light [m, k].
        cell_px: Lengths of the cells in the middle and of the ``OUTER`` ones on either side [m, 2].
        width: Width of the window.
    """
    frequency = image.frequencies(width).astype(np.float32)
    # A wave of frequency a + b is the product of two, and their sum over cells one of matrices.
    step = 1 << (width.bit_length() // 2)
    turn = np.float32(-2.0 * np.pi) * offset_px.astype(np.float32)[:, :, None]
    fine, coarse = (_wave(turn * each) for each in (frequency[:step], frequency[::step]))
    ends = np.r_[:OUTER, share.shape[1] - OUTER : share.shape[1]]
    found = np.zeros((len(share), width + 1), np.complex64)
    for cells, length in ((slice(OUTER, -OUTER), cell_px[:, :1]), (ends, cell_px[:, 1:])):
        some = coarse[:, cells] * share[:, cells, None].astype(np.float32)
        waves = some.transpose(0, 2, 1) @ fine[:, cells]
        waves = waves.reshape(len(share), -1)[:, : width + 1]
        found += waves * np.sinc(length.astype(np.float32) * frequency)
    return found


def _wave(turn: Singles) -> npt.NDArray[np.complex64]:
    """Return exp(i turn); numpy's complex exponential is slow."""
    found = np.empty(turn.shape, np.complex64)
    np.cos(turn, out=found.real)
    np.sin(turn, out=found.imag)
    return found


def _gather(
    field: Singles, rows: Ints, start: Ints, windows: list[tuple[Ints, Ints, Singles]]
) -> None:
    """Add windows of light (row, first pixel, light) to parts of the lines ``rows``.

    Args:
        field: The parts, which begin at pixels ``start`` [n, width].
        rows: Rising numbers of their lines [n].
        start: [n].
        windows: Windows of any lines.
    """
    for row, first, light in windows:
        place = np.searchsorted(rows, row)
        some = np.flatnonzero(np.append(rows, -1)[place] == row)
        if len(some):
            at = place[some]
            _add(field, at, first[some] - start[at], light[some])


def _add_runs(field: Singles, row: Ints, begin: Floats, end: Floats, level: Floats) -> None:
    """Add runs of equal light to whole lines.

    Args:
        field: The lines [n, length].
        row: Line of each spot, which may come several times [m].
        begin: Where the runs of each spot begin, px from the line's start [k, m].
        end: Where they end.
        level: Their light on each pixel; on one that a run covers in part, that share.
    """
    count, length = field.shape
    if not level.size:
        return
    place = np.clip(np.concatenate([begin, end]), 0.0, length).T
    step = np.concatenate([level, -level]).astype(np.float32).T
    pixel = np.minimum(place.astype(np.int32), length)
    flat = row[:, None] * length + np.minimum(pixel, length - 1)
    np.add.at(
        field.reshape(count * length),
        flat.ravel(),
        (step * (pixel - place)).astype(np.float32).ravel(),
    )
    # All steps of a spot in their order along the line; between two of them the light is even.
    bits = max(step.shape[1] - 1, 1).bit_length()
    order = np.sort((pixel << bits) | np.arange(step.shape[1], dtype=np.int32), axis=1)
    even = np.zeros((len(row), step.shape[1] + 1), np.float32)
    np.cumsum(np.take_along_axis(step, order & ((1 << bits) - 1), axis=1), axis=1, out=even[:, 1:])
    even[:, -1:] = 0.0
    ends = np.zeros((len(row), 1), np.int32)
    pixels = np.diff(order >> bits, axis=1, prepend=ends, append=ends + length)
    for once in _each_once(row):
        for few in chunks(len(once), length):
            part = once[few]
            light = np.repeat(even[part].ravel(), pixels[part].ravel())
            field[row[part]] += light.reshape(len(part), length)


def _each_once(row: Ints) -> list[Ints]:
    """Return the indices of all elements of ``row`` in groups in which no value comes twice."""
    order = np.argsort(row, kind="stable")
    begin = np.flatnonzero(np.diff(row[order], prepend=-1))
    rank = np.empty_like(order)  # how often the element's value came before
    rank[order] = np.arange(len(row)) - np.repeat(begin, np.diff(begin, append=len(row)))
    ends = np.cumsum(np.bincount(rank))[:-1]
    return np.split(np.argsort(rank, kind="stable"), ends) if len(row) else []


def _add(field: Singles, row: Ints, first: Ints, light: Singles) -> None:
    """Add windows to whole lines; what is beyond the sensor's ends is lost."""
    (count, length), width = field.shape, light.shape[1]
    whole = (first >= 0) & (first + width <= length)
    if whole.any():
        windows = sliding_window_view(field.reshape(count * length), width, writeable=True)
        rows = np.flatnonzero(whole)
        for once in _each_once(row[rows]):
            some = rows[once]
            windows[row[some] * length + first[some]] += light[some]
    rows = np.flatnonzero(~whole)
    column = first[rows, None] + np.arange(width)
    inside = (column >= 0) & (column < length)
    at = column + (row[rows] * length)[:, None]
    np.add.at(field.reshape(count * length), at[inside], light[rows][inside])
