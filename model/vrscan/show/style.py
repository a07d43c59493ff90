"""How the project's pictures look."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK, QUIET, LIGHT = "#1f2933", "#7b8794", "#d5dae0"
COLOURS = ("#2a6f97", "#c8553d", "#3a7d44", "#7b4b94")
MANY_COLOURS = (*COLOURS, "#d8a31a", "#e08fb5")  # for small dots of more than four kinds
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LIGHT,
    "grid.linewidth": 0.5,
    "figure.constrained_layout.use": True,
}

DECADES = tuple(k * 10.0**power for power in range(8) for k in (1, 2, 5))  # levels of a log axis
_LEAST_GAP = 0.04  # of a logarithmic axis, between two of its numbers


@contextmanager
def drawing(width: float, height: float, title: str = "") -> Iterator[Figure]:
    """Yield an empty picture; what is drawn and saved inside has the project's style.

    Args:
        width: Width in inches.
        height: Height in inches.
        title: Text on top.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height))  # no window system involved
        if title:
            bold: dict[str, Any] = {"fontsize": 12, "fontweight": "bold", "color": INK}
            plain = title.replace("$", r"\$")  # names are no formulas
            figure.suptitle(plain, x=0.012, ha="left", **bold)
        yield figure


def plain_log(axes: Axes, which: str, levels: Sequence[float], form: str = "{:g}") -> None:
    """Write the ticks of a logarithmic axis as plain numbers.

    They are those of ``levels``, which rise, that the axis has, and that are no nearer to the one
    before than a number is wide. Two places in between are taken where fewer than two are left.
    """
    low, high = axes.get_xlim() if which == "x" else axes.get_ylim()
    ticks: list[float] = []
    for level in levels:
        near = ticks and level < ticks[-1] * (high / low) ** _LEAST_GAP
        if low <= level <= high and not near:
            ticks.append(level)
    if len(ticks) < 2:
        ticks, form = [low * (high / low) ** share for share in (0.25, 0.75)], "{:.3g}"
    names = [form.format(tick) for tick in ticks]
    (axes.set_xticks if which == "x" else axes.set_yticks)(ticks, names)
    axes.tick_params(which="minor", length=0)
    axes.minorticks_off()
