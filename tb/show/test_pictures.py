"""The look at pictures: what it has to complain of, and what not."""

from collections.abc import Callable

import pytest
from matplotlib.axes import Axes
from pictures import complaints

from vrscan.show.style import COLOURS, drawing, plain_log


def good(axes: Axes) -> None:
    axes.plot([1, 2, 3], [0, 1, 4], "o", label="data")
    axes.set(xlabel="x, mm", ylabel="z, mm", title="a title")


def doubled(axes: Axes) -> None:
    axes.text(2.0, 2.0, "one")
    axes.text(2.0, 2.2, "two")


def outside(axes: Axes) -> None:
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0))


def crowded(axes: Axes) -> None:
    axes.set_xticks([1.0, 1.01], ["1.0", "1.01"])


def thinned(axes: Axes) -> None:
    axes.set(xscale="log", xlim=(0.9, 2000.0))
    plain_log(axes, "x", [1.0, 1.1, 1.2, *(2.0**k for k in range(1, 11))])


def crossed(axes: Axes) -> None:
    """A curve from corner to corner, whose points are all outside of the legend."""
    axes.plot([1.0, 2.95, 3.0], [4.0, 0.05, 0.0], label="a")
    axes.legend(loc="lower right", bbox_to_anchor=(0.75, 0.3), borderaxespad=0.0)


def framed(axes: Axes) -> None:
    axes.legend(loc="lower left", frameon=True, facecolor="white")


def repeated(axes: Axes) -> None:
    for place, name in enumerate("abc"):
        axes.plot([2.0], [place], ".", color=COLOURS[place % 2], label=name)
    outside(axes)


def told_apart(axes: Axes) -> None:
    """Of one colour, but of other marks and dashes."""
    for mark in ("s", "v", "--", ":"):
        axes.plot([2.0], [2.0], mark, color=COLOURS[0], label=mark)
    outside(axes)


def powers(axes: Axes) -> None:
    axes.set(xscale="log", xlim=(240.0, 980.0))


BAD: dict[str, tuple[Callable[[Axes], object], str]] = {
    "two texts": (doubled, "'one' and 'two' overlap"),
    "two numbers": (crowded, "'1.0' and '1.01' overlap"),
    "a legend over marks": (lambda axes: axes.legend(loc="lower left"), "covers 1 marks"),
    "a legend in a frame": (framed, "covers 1 marks"),
    "a legend over a curve": (crossed, "covers 1 curves"),
    "a colour twice": (repeated, "'a' and 'c' look alike"),
    "powers of ten": (powers, "x of 'a title' has numbers that are no plain ones"),
    "a text cut off": (lambda axes: axes.figure.text(0.9, 0.5, "a long text"), "cut off"),
    "no numbers": (lambda axes: axes.set_xticks([1, 2], ["", ""]), "x of 'a title' has no numbers"),
    "no name": (lambda axes: axes.set_ylabel(""), "y of 'a title' has no name"),
}
FINE: list[Callable[[Axes], object]] = [
    outside,
    thinned,
    told_apart,
    lambda axes: axes.set_xticks([1, 2, 3], ["near", "middle", "far"]),
    lambda axes: axes.axis("off"),
]


def looked_at(change: Callable[[Axes], object]) -> list[str]:
    with drawing(4.0, 3.0) as figure:
        axes = figure.add_subplot()
        good(axes)
        change(axes)
        return complaints(figure)


@pytest.mark.parametrize("what", BAD)
def test_what_is_wrong_is_said(what: str) -> None:
    change, said = BAD[what]
    found = looked_at(change)
    assert len(found) == 1 and said in found[0]


@pytest.mark.parametrize("change", FINE)
def test_what_is_right_is_not(change: Callable[[Axes], object]) -> None:
    assert looked_at(change) == []


def test_axes_may_share_their_numbers_and_names() -> None:
    with drawing(6.0, 3.0) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        good(left)
        good(right)
        right.set_ylabel("")
        assert complaints(figure) == []
        left.set_ylabel("")
        assert len(complaints(figure)) == 2


def test_a_name_is_no_formula() -> None:
    """Matplotlib would refuse the one and set the other in italics."""
    for name in (r"$\frac$", "a$b$c", "<b>&"):
        with drawing(3.0, 2.0, name) as figure:
            figure.draw_without_rendering()
