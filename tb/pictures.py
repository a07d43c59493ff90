"""What every picture has to keep: no two texts overlap, and each axis has numbers and a name."""

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

TOUCH_PT = 1.0  # that two boxes may share: a box has some room around its letters


def _shown(artist: Any) -> bool:
    """Return whether a text is there and says something."""
    return bool(artist.get_visible() and artist.get_text().strip())


def _ticks(axis: Axis) -> list[Text]:
    """Return the numbers that are drawn at an axis."""
    ticks = axis._update_ticks()
    return [label for tick in ticks for label in (tick.label1, tick.label2) if _shown(label)]


def _texts(axes: Axes) -> Iterator[Text]:
    """Yield what is written in and around the axes, but for the legend."""
    yield from axes.texts
    yield from (axes.title, axes._left_title, axes._right_title)
    if axes.axison:
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_visible():
                yield from _ticks(axis)
                yield from (axis.label, axis.offsetText)


def _legends(figure: Figure) -> list[Legend]:
    found = [each for each in figure.findobj(Legend) if each.get_visible()]
    return [each for each in found if isinstance(each, Legend)]


def _overlap(one: Bbox, other: Bbox, least: float) -> bool:
    both = Bbox.intersection(one, other)
    return both is not None and min(both.width, both.height) > least


def _places(axes: Axes) -> Iterator[np.ndarray]:
    """Yield where marks of data are drawn, in pixels [n, 2]."""
    for line in axes.lines:
        places, how = line.get_xydata(), line.get_transform()
        is_data = len(places) > 2 and how.contains_branch(axes.transData)  # and no level
        if is_data and line.get_visible():
            yield how.transform(places)
    for collection in axes.collections:
        offsets = np.ma.getdata(collection.get_offsets())
        if collection.get_visible() and len(offsets) > 1:
            yield collection.get_offset_transform().transform(offsets)


def _without_numbers(axes: Axes, which: str) -> str | None:
    """Return what an axis lacks."""
    axis: Axis = getattr(axes, f"{which}axis")
    if not axes.axison or not axis.get_visible():
        return None
    assert axes.figure is not None
    group = getattr(axes, f"get_shared_{which}_axes")().get_siblings(axes)
    shared = [getattr(each, f"{which}axis") for each in group]
    # A name may stand at the picture's edge, or at the first of axes in a row or a column.
    ends = [axes.bbox.x0, axes.bbox.x1] if which == "x" else [axes.bbox.y0, axes.bbox.y1]
    named = [
        getattr(each, f"{which}axis").label.get_text()
        for each in axes.figure.axes
        if np.allclose(ends, getattr(each.bbox, f"interval{which}"), atol=1.0)
    ]
    named += [each.label.get_text() for each in shared]
    named.append(getattr(axes.figure, f"get_sup{which}label")())
    numbers = max((_ticks(each) for each in shared), key=len)
    if len(numbers) < 2 and len(axis.get_ticklocs()) != 0:
        return "has no numbers"
    are_names = any(
        c.isalpha() for text in numbers for c in text.get_text().replace("mathdefault", "")
    )
    if numbers and not are_names and not any(named):
        return "has no name and unit"
    return None


def complaints(figure: Figure) -> list[str]:
    """Return what is not as it should be in a picture, each in a line."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw_without_rendering()
    least = TOUCH_PT * figure.dpi / 72.0
    boxes = [
        (repr(text.get_text()), text.get_window_extent(renderer))
        for text in [*figure.texts, *(t for axes in figure.axes for t in _texts(axes))]
        if _shown(text)
    ]
    legends = _legends(figure)
    for legend in legends:
        boxes.append(
            (
                f"the legend {[t.get_text() for t in legend.texts]}",
                legend.get_window_extent(renderer),
            )
        )
    found = [
        f"{name} and {other} overlap"
        for (name, box), (other, beside) in combinations(boxes, 2)
        if _overlap(box, beside, least)
    ]
    whole = figure.bbox.padded(least)
    for name, box in boxes:
        if not (
            whole.containsx(box.x0)
            and whole.containsx(box.x1)
            and whole.containsy(box.y0)
            and whole.containsy(box.y1)
        ):
            found.append(f"{name} is cut off by the picture's edge")
    for axes in figure.axes:
        for which in "xy":
            lack = _without_numbers(axes, which)
            if lack:
                found.append(f"{which} of {axes.get_title('left') or axes.get_title()!r} {lack}")
        for legend in legends:
            if legend.get_frame_on():
                continue  # it stands in front of the curves on purpose
            box = legend.get_window_extent(renderer)
            inside = axes.bbox.padded(1.0)
            for places in _places(axes):
                x, y = places.T
                there = (x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)
                there &= (x > inside.x0) & (x < inside.x1) & (y > inside.y0) & (y < inside.y1)
                if there.any():
                    names = [t.get_text() for t in legend.texts]
                    found.append(f"the legend {names} covers {there.sum()} marks")
    return found


def watch() -> None:
    """Let every picture that is saved from now on be looked at.

    Raises:
        AssertionError: by the picture's ``savefig``.
    """
    save = Figure.savefig

    def checked(figure: Figure, *words: Any, **options: Any) -> None:
        save(figure, *words, **options)
        found = complaints(figure)
        assert not found, "\n".join(found)

    Figure.savefig = checked
