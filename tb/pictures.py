"""What every picture has to keep: no two texts overlap, and each axis has numbers and a name.

A legend is where no data are, and tells its entries apart.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
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


def _curves(axes: Axes) -> Iterator[Line2D]:
    """Yield the lines of data, but for levels."""
    for line in axes.lines:
        is_level = not line.get_transform().contains_branch(axes.transData)
        if line.get_visible() and not is_level and len(line.get_xydata()) > 2:
            yield line


def _places(axes: Axes) -> Iterator[np.ndarray]:
    """Yield where marks of data are drawn, in pixels [n, 2]."""
    for line in _curves(axes):
        yield line.get_transform().transform(line.get_xydata())
    for collection in axes.collections:
        offsets = np.ma.getdata(collection.get_offsets())
        if collection.get_visible() and len(offsets) > 1:
            yield collection.get_offset_transform().transform(offsets)


def _crossed(axes: Axes, box: Bbox) -> int:
    """Return the number of curves that go through a box, whose marks may lie outside of it."""
    seen = Bbox.intersection(box, axes.bbox)
    if seen is None or min(seen.width, seen.height) <= 1.0:
        return 0
    drawn = [line for line in _curves(axes) if line.get_linestyle() not in ("None", "", " ")]
    paths = [line.get_transform().transform_path(Path(line.get_xydata())) for line in drawn]
    return sum(path.intersects_bbox(seen, filled=False) for path in paths)


def _look(mark: Any) -> tuple[Any, ...] | None:
    """Return how an entry of a legend looks, where that is known."""
    if isinstance(mark, Line2D):
        face = to_hex(mark.get_markerfacecolor(), keep_alpha=True)
        dashes = str(mark._dash_pattern) if mark.get_linestyle() != "None" else ""
        colour = to_hex(mark.get_color())
        return colour, mark.get_marker(), face, dashes, mark.get_linewidth() if dashes else 0.0
    if isinstance(mark, Patch):
        colours = (mark.get_facecolor(), mark.get_edgecolor())
        return *(to_hex(each, keep_alpha=True) for each in colours), mark.get_hatch()
    return None


def _alike(legend: Legend) -> Iterator[str]:
    """Yield the entries of a legend that look like one another."""
    entries = zip(legend.legend_handles, legend.texts, strict=True)
    looks = [(_look(mark), text.get_text()) for mark, text in entries]
    for (look, name), (other, beside) in combinations(looks, 2):
        if look is not None and look == other:
            yield f"{name!r} and {beside!r} look alike in a legend"


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
    if any("times" in text.get_text() for text in numbers):
        return "has numbers that are no plain ones"
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
            box = legend.get_window_extent(renderer)
            names = [t.get_text() for t in legend.texts]
            inside = axes.bbox.padded(1.0)
            for places in _places(axes):
                x, y = places.T
                there = (x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)
                there &= (x > inside.x0) & (x < inside.x1) & (y > inside.y0) & (y < inside.y1)
                if there.any():
                    found.append(f"the legend {names} covers {there.sum()} marks")
            if _crossed(axes, box):
                found.append(f"the legend {names} covers {_crossed(axes, box)} curves")
    for legend in legends:
        found += _alike(legend)
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
