"""The look at pictures: what it has to complain of, and what not."""

from collections.abc import Callable

import pytest
from matplotlib.axes import Axes
from pictures import complaints

from vrscan.show.style import drawing, plain_log


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


BAD: dict[str, tuple[Callable[[Axes], object], str]] = {
    "two texts": (doubled, "'one' and 'two' overlap"),
    "two numbers": (crowded, "'1.0' and '1.01' overlap"),
    "a legend over marks": (lambda axes: axes.legend(loc="lower left"), "covers 1 marks"),
    "a text cut off": (lambda axes: axes.figure.text(0.9, 0.5, "a long text"), "cut off"),
    "no numbers": (lambda axes: axes.set_xticks([1, 2], ["", ""]), "x of 'a title' has no numbers"),
    "no name": (lambda axes: axes.set_ylabel(""), "y of 'a title' has no name"),
}
FINE: list[Callable[[Axes], object]] = [
    outside,
    thinned,
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
