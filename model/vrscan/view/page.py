"""The page: what a source shows, and what can be asked of it."""

import contextlib
import html
import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import (
    BasicTicker,
    BooleanFilter,
    CDSView,
    ColumnDataSource,
    DataRange1d,
    InlineStyleSheet,
    LinearAxis,
    LinearColorMapper,
    Model,
    Range1d,
)
from bokeh.models.annotations.geometry import BoxAnnotation, Span
from bokeh.models.annotations.labels import Title
from bokeh.models.annotations.legends import ColorBar
from bokeh.models.widgets.buttons import Button
from bokeh.models.widgets.inputs import TextInput
from bokeh.models.widgets.markups import Div
from bokeh.models.widgets.sliders import Slider
from bokeh.models.widgets.tables import DataTable, TableColumn
from bokeh.plotting import figure

from vrscan.data import pkg
from vrscan.data.arrays import Floats
from vrscan.data.errors import InputError
from vrscan.link.link_report import value_text
from vrscan.registers import values
from vrscan.registers.register_map import REGISTERS
from vrscan.registers.values import Value
from vrscan.show.sheet import template
from vrscan.view.display import ROWS, SAMPLE_S, SAMPLES, Display, RawLine
from vrscan.view.live import LiveSource
from vrscan.view.picture import followed, profile
from vrscan.view.playback import Playback
from vrscan.view.word import is_word

REFRESH_MS = 200
PATIENCE_S = 5.0  # with a page that does not say that it has drawn
BLUE, RED, GREEN, VIOLET = "#3d8fc0", "#d9634a", "#4c9f5a", "#9b6fb8"  # on light and dark
EVENTS = 7  # that are shown

Source = LiveSource | Playback
Result = TypeVar("Result")


def make(document: Document, source: Source, folder: Path, word: str | None = None) -> None:
    """Fill a document.

    Args:
        document: The document of one page.
        source: What it shows.
        folder: Folder for its recordings.
        word: What has to be typed into the page before it obeys; None for a page that only shows.
    """
    page = _Page(document, source, folder, word)
    if isinstance(source, Playback):
        source.begin()  # now that somebody looks
    for each in page.roots():
        document.add_root(each)
    document.title = f"VR-SCAN: {source.name}"
    document.template = template("vrscan.view", "page.html.j2")
    document.template_variables.update(
        source=source.name, cards=page.cards(), script=_text("page.js")
    )
    document.add_periodic_callback(page.update, REFRESH_MS)


@cache
def _text(name: str) -> str:
    return resources.files("vrscan.view").joinpath(name).read_text("utf-8")


class _Page:
    """The models of one page."""

    def __init__(self, document: Document, source: Source, folder: Path, word: str | None) -> None:
        self._document = document
        self._source = source
        self._look = InlineStyleSheet(css=_text("page.css"))
        self._state = self._words("state")
        self._tiles = self._words("tiles")
        self._pictures = _Pictures(moves=not isinstance(source, Playback))
        self._controls: _Controls | _Player
        if isinstance(source, Playback):
            self._controls = _Player(source, self._look)
        else:
            self._controls = _Controls(document, source, folder, word, self._look)
        self._events = self._words("events")
        # The page moves the end after the start once it has drawn; until then nothing new is sent.
        self._beat = Range1d(start=0, end=0)
        self._pictures.profile.extra_x_ranges["beat"] = self._beat
        self._sent_s = 0.0

    def _words(self, name: str) -> Div:
        return Div(name=name, sizing_mode="stretch_width", stylesheets=[self._look])

    def roots(self) -> list[Model]:
        """Return the models that the template places by their names."""
        own = [self._state, self._tiles, self._events]
        return [*own, *self._pictures.roots(), *self._controls.roots()]

    def cards(self) -> list[tuple[str, str, str, str]]:
        """Return name, size, heading and note of each card."""
        last = ("events", "s4" if self._controls.cards() else "full", "What happened", "")
        return [*self._pictures.cards, *self._controls.cards(), last]

    def update(self) -> None:
        """Show what is new, if what was sent before has been drawn."""
        now = time.monotonic()
        if self._beat.end != self._beat.start and now - self._sent_s < PATIENCE_S:
            return
        self._sent_s = now
        self._show()
        self._beat.start = int(self._sent_s * 1e3)

    def _show(self) -> None:
        source, display = self._source, self._source.display
        word, kind = ("live", "") if source.connected else ("offline", "off")
        if isinstance(source, Playback):
            word = "recording"
        self._state.text = (
            f'<div class="state"><span class="pill {kind}">{word}</span>'
            f"<span>{html.escape(source.state)}</span></div>"
        )
        self._tiles.text = _tiles(source)
        self._events.text = _events(source)
        self._pictures.update(display)
        self._pictures.say(source)
        self._controls.update()


def _tiles(source: Source) -> str:
    """Return the figures at the top of the page."""
    samples, account = source.display.samples(), source.account()
    last = samples[-1] if samples else None
    losses = {
        "lines missing": account.missing,
        "dropped by the board": account.dropped,
        "packets lost": account.packets_lost,
        "bad frames": account.bad_frames,
        "not taken in time": account.overflow,
    }
    shown = [
        ("points a second", f"{last.rate:,.0f}" if last else "-", False),
        (source.counted, f"{source.count:,}", False),
        ("lines with a position", _share(last.valid) if last else "-", False),
        ("S/N, median", _number(last.snr) if last else "-", False),
        *((what, f"{count:,}", count > 0) for what, count in losses.items()),
    ]
    if isinstance(source, LiveSource) and source.kept is not None:
        kept = source.kept
        what = "recorded" if not kept.open else "recording"
        more = f"{what}, {kept.lines} raw lines, {kept.lost} lost"
        shown.append((more, f"{kept.points:,}", kept.lost > 0))
    tiles = (
        f'<div class="tile{" bad" if bad else ""}"><b>{value}</b><span>{what}</span></div>'
        for what, value, bad in shown
    )
    return f'<div class="tiles">{"".join(tiles)}</div>'


def _share(value: float) -> str:
    return "-" if math.isnan(value) else f"{100.0 * value:.1f} %"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1f}"


def _events(source: Source) -> str:
    rows = [
        f"<tr><td>{time.strftime('%H:%M:%S', time.localtime(when))}</td>"
        f"<td>{html.escape(text)}</td></tr>"
        for when, text in list(source.events)[-EVENTS:][::-1]
    ]
    return f'<table class="events">{"".join(rows)}</table>'


@dataclass(frozen=True)
class _Line:
    """A figure of a raw line, and what is marked in it."""

    figure: figure
    window: BoxAnnotation
    level: Span
    place: Span


class _Pictures:
    """The figures, and the columns that they draw."""

    CARDS = (
        ("profile", "s8 tall", "Profile", "points with one sigma, and where beams are free"),
        ("image", "s4 tall", "Range image", "distance over the scan angle, new sweeps on top"),
        ("line", "s5 middle", "Raw line", "pixels and threshold"),
        ("window", "s3 middle", "Window", "what the position is computed from"),
        ("flags", "s4 middle", "Flags", "share of the lines that have each"),
        ("mirror", "s4 low", "Mirror", "amplitude and error of its phase"),
        ("quality", "s4 low", "S/N and valid lines", "the last two minutes"),
        ("rates", "s4 low", "Points and losses", "a second, and lost in each half second"),
    )

    def __init__(self, *, moves: bool) -> None:
        self.cards = [card for card in self.CARDS if moves or card[0] != "mirror"]
        self._count = -1
        self._line = -1
        self._data = {
            name: ColumnDataSource(data={key: [] for key in columns})
            for name, columns in {
                "sound": ("x", "z"),
                "doubtful": ("x", "z"),
                "sigma": ("x0", "z0", "x1", "z1"),
                "free": ("x0", "z0", "x1", "z1"),
                "line": ("pixel", "count"),
                "flags": ("flag", "share"),
                "history": ("time", "rate", "valid", "snr", "lost", "amplitude", "phase"),
            }.items()
        }
        self.profile = self._draw_profile()
        self._image = self._draw_image()
        self._near_range = Range1d(start=0, end=100)
        self._raw = self._draw_line()
        self._near = self._draw_line(x_range=self._near_range)
        self._flags = self._draw_flags()
        self._mirror = self._draw_pair("amplitude", "phase", "degrees", "millidegrees", BLUE, RED)
        self._quality = self._draw_pair("snr", "valid", "S/N", "valid, %", VIOLET, GREEN)
        self._quality.extra_y_ranges["other"] = Range1d(start=0.0, end=105.0)
        self._rates = self._draw_pair("rate", "lost", "points/s", "lost", BLUE, RED)

    def roots(self) -> list[Model]:
        """Return the figures."""
        made = (
            *(self.profile, self._image, self._raw.figure, self._near.figure, self._flags),
            *(self._mirror, self._quality, self._rates),
        )
        for each, (name, *_) in zip(made, self.CARDS, strict=True):
            each.name = name
        shown = {name for name, *_ in self.cards}
        return [each for each in made if each.name in shown]

    def _draw_profile(self) -> figure:
        made = _figure(
            "x in mm",
            "z in mm",
            x_range=Range1d(start=-300, end=300),
            y_range=Range1d(start=200, end=700),
        )
        data = self._data
        ends: dict[str, Any] = {"x0": "x0", "y0": "z0", "x1": "x1", "y1": "z1"}
        look: dict[str, Any] = {"line_alpha": 0.3, "line_width": 2, "legend_label": "free"}
        made.segment(**ends, source=data["free"], line_color=GREEN, **look)
        look = {"line_alpha": 0.6, "line_width": 1, "legend_label": "one sigma"}
        made.segment(**ends, source=data["sigma"], line_color=BLUE, **look)
        for name, colour, label in (
            ("sound", BLUE, "points"),
            ("doubtful", RED, "doubtful points"),
        ):
            made.scatter(
                "x", "z", source=data[name], color=colour, size=3.5, line_color=None,
                legend_label=label,
            )  # fmt: skip
        _legend(made, "horizontal")
        made.add_layout(made.legend[0], "above")  # in a narrow page it would hide points
        return made

    def _draw_image(self) -> figure:
        rows = Range1d(start=0, end=ROWS)
        made = _figure("scan angle in degrees", None, y_range=rows, y_axis_location=None)
        made.grid.visible = False
        self._colours = LinearColorMapper(palette="Viridis256", nan_color="rgba(0, 0, 0, 0)")
        self._cells = ColumnDataSource(
            data={"image": [np.full((1, 1), np.nan)], "x": [0], "dw": [1]}
        )
        cells: dict[str, Any] = {"color_mapper": self._colours, "source": self._cells}
        made.image("image", "x", 0, "dw", ROWS, **cells)
        bar = ColorBar(
            color_mapper=self._colours,
            ticker=BasicTicker(desired_num_ticks=5),
            title="mm",
            background_fill_color=None,
            width=9,
            padding=4,
            bar_line_color=None,
        )
        made.add_layout(bar, "right")
        return made

    def _draw_line(self, **ranges: Any) -> _Line:
        made = _figure("pixel", "counts", **ranges)
        window = BoxAnnotation(fill_color=VIOLET, fill_alpha=0.18, line_color=None, visible=False)
        level = Span(dimension="width", line_color=RED, line_dash="dashed", line_width=1.5)
        place = Span(dimension="height", line_color=GREEN, line_width=1.5)
        for each in (window, level, place):
            made.add_layout(each)
        source = self._data["line"]
        made.step("pixel", "count", source=source, color=BLUE, mode="center", line_width=1.2)
        return _Line(made, window, level, place)

    def _draw_flags(self) -> figure:
        names = list(pkg.FLAGS)[::-1]
        made = _figure("% of the lines", None, x_range=Range1d(start=0, end=100), y_range=names)
        made.ygrid.visible = False
        made.hbar("flag", right="share", source=self._data["flags"], height=0.6, color=RED)
        made.yaxis.major_label_text_font_size = "9px"
        return made

    def _draw_pair(
        self, left: str, right: str, left_label: str, right_label: str, *colours: str
    ) -> figure:
        """Return a figure of two columns of the history, each with an axis of its own."""
        own, other = DataRange1d(), DataRange1d()
        shown = Range1d(start=-SAMPLES * SAMPLE_S, end=0)
        made = _figure("seconds", left_label, x_range=shown, y_range=own)
        made.extra_y_ranges["other"] = other
        made.add_layout(LinearAxis(y_range_name="other", axis_label=right_label), "right")
        _calm(made)
        for axis, colour in zip(made.yaxis, colours, strict=True):
            axis.tags = [colour]
        source = self._data["history"]
        first = made.line("time", left, source=source, color=colours[0], line_width=1.6)
        look: dict[str, Any] = {"y_range_name": "other", "color": colours[1], "line_width": 1.6}
        second = made.line("time", right, source=source, **look)
        own.renderers, other.renderers = [first], [second]
        return made

    def update(self, display: Display) -> None:
        """Show what is new."""
        self._show_history(display)
        if display.count != self._count:
            self._count = display.count
            self._show_points(display)
        if display.line is not None and display.line.line != self._line:
            self._line = display.line.line
            self._show_line(display.line)

    def say(self, source: Source) -> None:
        """Say in each picture what it waits for and how long, and of which line the raw one is."""
        display = source.display

        def waiting(for_what: str) -> str:
            return f"waiting for {for_what}, for {source.age_s:.0f} s"

        what = source.awaited
        points = "" if display.count else waiting(what or "the first point")
        for each in (self.profile, self._flags, self._quality, self._rates):
            _tell(each, points)
        rows = bool(np.isfinite(self._cells.data["image"][0]).any())
        _tell(self._image, points or ("" if rows else waiting("a whole sweep")))
        known = not np.isnan(display.mirror).any()
        _tell(self._mirror, "" if known else waiting(what or "the state of the mirror"))
        line = display.line
        if line is not None:
            raw = f"line {line.line:,}" + (f": {line.note}" if line.note else "")
        elif isinstance(source, Playback) and not source.raw_lines:
            raw = "this file has no raw lines"
        else:
            raw = waiting(what or "the first raw line")
        for made in (self._raw, self._near):
            _tell(made.figure, raw)

    def _show_points(self, display: Display) -> None:
        points = display.last()
        if points is None:
            return
        found, good = profile(points), points.located
        for name in ("sound", "doubtful", "sigma", "free"):
            self._data[name].data = getattr(found, name)
        for shown, coordinates in (
            (self.profile.x_range, points.x_mm[good]),
            (self.profile.y_range, points.z_mm[good]),
        ):
            _follow(shown, coordinates)
        image, reach_rad = display.image()
        reach = math.degrees(reach_rad)
        seen = image[np.isfinite(image)]
        if len(seen):
            present = self._colours.low or 0.0, self._colours.high or 0.0
            low, high = followed(present, seen.astype(np.float64))
            self._colours.update(low=low, high=high)
        self._cells.data = {"image": [image], "x": [-reach], "dw": [2.0 * reach]}

    def _show_line(self, found: RawLine) -> None:
        pixels, point = found.pixels, found.point
        self._data["line"].data = {"pixel": np.arange(len(pixels)), "count": pixels}
        for line in (self._raw, self._near):
            line.level.location = found.threshold
            line.window.visible = point is not None and bool(point.width[0] > 0)
            line.place.visible = point is not None and bool(point.measured[0])
            if point is None or not line.window.visible:
                continue
            left, right = int(point.left[0]), int(point.right[0])
            line.window.update(left=left - 0.5, right=right + 0.5)
            line.place.location = float(point.position_px[0])
        if point is not None and point.width[0] > 0:
            spare = max(8, right - left) // 2
            self._near_range.update(start=left - spare, end=right + spare)

    def _show_history(self, display: Display) -> None:
        samples, now = display.samples(), time.monotonic()

        def column_of(name: str) -> list[float]:
            return [getattr(sample, name) for sample in samples]

        self._data["history"].data = {
            "time": [sample.time_s - now for sample in samples],
            "rate": column_of("rate"),
            "valid": [100.0 * share for share in column_of("valid")],
            "snr": column_of("snr"),
            "lost": column_of("lost"),
            "amplitude": column_of("amplitude_deg"),
            "phase": [1e3 * error for error in column_of("phase_deg")],
        }
        flags = display.flags
        shares = [100.0 * share for share in flags.values()]
        self._data["flags"].data = {"flag": list(flags), "share": shares}


def _figure(x_label: str, y_label: str | None, **ranges: Any) -> figure:
    """Return an empty figure that fills its card; the page gives it its colours."""
    made = figure(
        sizing_mode="stretch_both",
        tools="pan,wheel_zoom,box_zoom,reset",
        toolbar_location="above",
        x_axis_label=x_label,
        y_axis_label=y_label,
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        min_border=4,
        output_backend="canvas",
        **ranges,
    )
    made.title = Title(text_font_style="normal", text_font_size="12px")  # what it waits for
    made.toolbar.autohide = True
    made.toolbar_inner = True
    made.toolbar.logo = None
    _calm(made)
    return made


def _tell(made: figure, text: str) -> None:
    """Say something above a figure."""
    assert isinstance(made.title, Title)
    made.title.text = text


def _calm(made: figure) -> None:
    """Let all axes of a figure speak in a low voice."""
    for axis in made.axis:
        axis.update(
            axis_label_text_font_style="normal",
            axis_label_text_font_size="12px",
            major_label_text_font_size="11px",
            minor_tick_line_color=None,
            major_tick_in=0,
        )


def _legend(made: figure, orientation: str) -> None:
    made.legend.update(
        orientation=orientation,
        location="top_left",
        background_fill_color=None,
        border_line_color=None,
        label_text_font_size="11px",
        padding=2,
        margin=2,
    )


def _follow(shown: Any, found: Floats) -> None:
    low, high = followed((shown.start, shown.end), found)
    shown.update(start=low, end=high)


class _Controls:
    """What can be asked of a board."""

    def __init__(
        self,
        document: Document,
        source: LiveSource,
        folder: Path,
        word: str | None,
        look: InlineStyleSheet,
    ) -> None:
        self._document, self._source, self._folder = document, source, folder
        self._word, self._open = word, False  # whether the word was typed into this page
        self._worker = ThreadPoolExecutor(1)
        document.on_session_destroyed(lambda _: self._worker.shutdown(wait=False))
        size: dict[str, Any] = {"width": 84, "height": 32, "stylesheets": [look]}
        self._start = Button(label="Start", name="start", **size)
        self._stop = Button(label="Stop", name="stop", button_type="danger", **size)
        self._record = Button(label="Record", name="record", button_type="primary", **size)
        self._start.on_click(lambda: self._order(source.start))
        self._stop.on_click(lambda: self._order(source.stop, at_once=True))
        self._record.on_click(self._recording)
        self._typed = TextInput(
            placeholder="word in the terminal", name="word", width=170, stylesheets=[look]
        )
        self._unlock = Button(label="Unlock", name="unlock", button_type="primary", **size)
        self._typed.on_change("value", lambda attr, old, new: self._try())
        self._unlock.on_click(self._try)
        self._only = Div(text="read-only", name="only", stylesheets=[look])
        # Registers.
        fields: dict[str, Any] = {"sizing_mode": "stretch_width", "stylesheets": [look]}
        self._found: Mapping[str, Value] = {}
        self._filter = TextInput(placeholder="part of a name", name="filter", **fields)
        self._value = TextInput(placeholder="value", name="value", **fields)
        self._read = Button(label="Read", name="read", **size)
        self._write = Button(label="Write", name="write", button_type="primary", **size)
        self._answer = Div(text="", name="answer", **fields)
        self._rows = ColumnDataSource(data={"name": [], "value": [], "doc": []})
        self._shown = BooleanFilter()
        self._table = DataTable(
            source=self._rows,
            view=CDSView(filter=self._shown),
            columns=[
                TableColumn(field="name", title="register", width=180),
                TableColumn(field="value", title="value", width=140),
                TableColumn(field="doc", title="meaning", width=590),
            ],
            index_position=None,
            autosize_mode="none",
            sizing_mode="stretch_both",
            stylesheets=[InlineStyleSheet(css=_text("table.css"))],
        )
        self._filter.on_change("value_input", lambda attr, old, new: self._narrow())
        self._rows.selected.on_change("indices", lambda attr, old, new: self._choose())
        self._read.on_click(lambda: self._ask(source.registers, self._come))
        self._write.on_click(self._writing)
        self._connected = False
        self._list()

    def roots(self) -> list[Model]:
        """Return the models that the template places by their names."""
        parts = self._only, self._typed, self._unlock, self._start, self._stop, self._record
        buttons = row(*parts, name="buttons")
        above = row(self._filter, self._read, sizing_mode="stretch_width")
        below = row(self._value, self._write, sizing_mode="stretch_width")
        lines = above, self._table, below, self._answer
        self._show()
        return [buttons, column(*lines, name="registers", sizing_mode="stretch_both")]

    def cards(self) -> list[tuple[str, str, str, str]]:
        """Return name, size, heading and note of each card."""
        note = "choose one for its meaning" if self._word is None else "choose one to write it"
        return [("registers", "s8 tall", "Registers", note)]

    def update(self) -> None:
        """Show what is new."""
        source = self._source
        kept = source.kept
        self._record.label = "End" if kept is not None and kept.open else "Record"
        if source.connected and not self._connected:
            self._ask(source.registers, self._come)
        self._connected = source.connected

    # ---- who may give orders ----

    def _try(self) -> None:
        """Take orders from now on, if what was typed is the word."""
        typed = self._typed.value
        if not typed or self._word is None:
            return
        self._typed.value = ""
        self._open = is_word(typed, self._word)
        if not self._open:
            self._source.happened("a page was given a wrong word")
            self._answer.text = "This is not the word that the terminal printed."
        self._show()

    def _show(self) -> None:
        """Show the buttons that have an effect."""
        self._only.visible = self._word is None
        self._typed.visible = self._unlock.visible = self._word is not None and not self._open
        self._stop.visible = self._word is not None
        for each in (self._start, self._record, self._value, self._write):
            each.visible = self._open

    def _order(
        self,
        work: Callable[[], Result],
        done: Callable[[Result], None] = lambda _: None,
        *,
        at_once: bool = False,
    ) -> None:
        """Let the board do something, if this page may; what makes it dark needs no word.

        A browser can press a button that it does not show.
        """
        if self._open or (at_once and self._word is not None):
            self._ask(work, done)
        else:
            self._answer.text = "This page is read-only."

    def _ask(
        self, work: Callable[[], Result], done: Callable[[Result], None] = lambda _: None
    ) -> None:
        """Do what may take its time beside the page, and show what came of it."""

        def act() -> None:
            try:
                result, text = work(), ""
            except InputError as error:
                result, text = None, str(error)
                self._source.happened(text)

            def show() -> None:
                self._answer.text = html.escape(text)
                if result is not None:
                    done(result)

            if self._document.session_context is not None:
                self._document.add_next_tick_callback(show)

        with contextlib.suppress(RuntimeError):  # of a page that is closed
            self._worker.submit(act)

    def _recording(self) -> None:
        source, kept = self._source, self._source.kept
        if kept is not None and kept.open:
            self._order(source.stop_recording)
            return
        name = time.strftime("view-%Y%m%d-%H%M%S.mcap")
        self._order(lambda: source.record(self._folder / name))

    # ---- registers ----

    def _come(self, found: Mapping[str, Value]) -> None:
        self._found = found
        self._list()

    def _list(self) -> None:
        found = self._found
        self._rows.data = {
            "name": list(REGISTERS),
            "value": [value_text(n, found[n]) if n in found else "" for n in REGISTERS],
            "doc": [each.doc for each in REGISTERS.values()],
        }

    def _narrow(self) -> None:
        """Show the registers with the text in their names; the others keep their places."""
        text = self._filter.value_input.lower()
        self._shown.booleans = [text in name for name in REGISTERS]

    def _chosen(self) -> str | None:
        indices = self._rows.selected.indices
        return self._rows.data["name"][indices[0]] if indices else None

    def _choose(self) -> None:
        name = self._chosen()
        if name is None:
            return
        held = self._found.get(name)
        scaled = () if held is None else values.to_scaled(name, held)
        numbers = scaled if isinstance(scaled, tuple) else (scaled,)
        self._value.value = " ".join(f"{number:.12g}" for number in numbers)
        each = REGISTERS[name]
        self._answer.text = html.escape(f"{name}: {each.access}, {each.doc}")

    def _writing(self) -> None:
        name, text = self._chosen() or "", self._value.value
        if self._open and not name:
            self._answer.text = "No register is chosen."
            return

        def done(value: Value) -> None:
            self._found = {**self._found, name: value}
            self._list()
            self._answer.text = html.escape(f"{name} = {value_text(name, value)}")

        self._order(lambda: self._source.write(name, text), done)


class _Player:
    """How a recording is played."""

    def __init__(self, source: Playback, look: InlineStyleSheet) -> None:
        self._source = source
        size: dict[str, Any] = {"width": 84, "height": 32, "stylesheets": [look]}
        self._play = Button(label="Pause", name="play", **size)
        self._place = Slider(
            start=0, end=max(source.length, 1), value=0, step=1, width=260, show_value=False,
            title="points", name="place", stylesheets=[look],
        )  # fmt: skip
        self._play.on_click(source.toggle)
        self._place.on_change("value_throttled", lambda attr, old, new: source.seek(int(new)))

    def roots(self) -> list[Model]:
        """Return the models that the template places by their names."""
        return [row(self._play, self._place, name="buttons")]

    def cards(self) -> list[tuple[str, str, str, str]]:
        """Return no cards: a recording has no registers."""
        return []

    def update(self) -> None:
        """Show what is new."""
        self._play.label = "Pause" if self._source.playing else "Play"
        position, length = self._source.position, self._source.length
        self._place.update(value=position, title=f"{position:,} of {length:,} points")
