"""The style of the project's pictures and wide tables."""

from typing import Any

from rich import box
from rich.table import Table as RichTable

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


def wide_table(title: str, caption: str | None = None, *, gap: int = 1) -> RichTable:
    """Return a table without columns that wastes no width: no frame, ``gap`` between columns."""
    return RichTable(
        title=title,
        caption=caption,
        title_justify="left",
        caption_justify="left",
        caption_style="",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, gap, 0, 0),
    )
