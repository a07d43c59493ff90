"""How the project's pictures look."""

from typing import Any

INK, QUIET, LIGHT = "#1f2933", "#7b8794", "#d5dae0"
COLOURS = ("#2a6f97", "#c8553d", "#3a7d44", "#7b4b94")
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
}
